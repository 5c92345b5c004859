/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Serial ports of the SPIDAR when the system fails: no descriptors, no rights, a port that goes
 * away between two calls, a driver that takes half of the bytes. The calls of the system are those
 * of this file, which fail when told. The port is a pseudo-terminal. */

#include "tests/files.h"
#include "tests/tap.h"

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdarg.h>
#include <stdint.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <hapode/device.h>
#include <hapode/hooks.h>

#include "plugins/spidar/serial.h"
#ifdef HAPODE_LIBSERIALPORT
#include <libserialport.h>
#endif

/* ---- the system ---- */

typedef enum call {
  CALL_OPEN,
  CALL_DUP3,
  CALL_TCGETATTR,
  CALL_TCSETATTR,
  CALL_READ,
  CALL_WRITE,
  CALLS
} call;

static struct failing {
  int good;  /* calls that work before */
  int times; /* that fail then */
  int error; /* errno; 0: a write of half of the bytes */
} fails[CALLS];

static bool call_fails(call which)
{
  struct failing *f = &fails[which];
  if (f->times == 0 || f->good-- > 0) {
    return false;
  }
  f->good = 0;
  --f->times;
  errno = f->error;
  return true;
}

static void fail_at(call which, int good, int times, int error)
{
  fails[which] = (struct failing){good, times, error};
}

/* A port that takes some of the bytes, by chance. seed 0: all. */
static struct {
  _Atomic uint32_t seed;
  int fd;
} shares;

/* Behind the next write, once: what a signal handler does then. */
static void (*write_hook)(void);

static void *real_symbol(const char *name)
{
  void *symbol = dlsym(RTLD_NEXT, name);
  if (symbol == NULL) {
    abort();
  }
  return symbol;
}

#define REAL(function, name)               \
  void *function##_at = real_symbol(name); \
  memcpy(&(function), &function##_at, sizeof(function))

static const char *latency_file; /* stands for that of sysfs; NULL: there is none */

/* NOLINTBEGIN(readability-inconsistent-declaration-parameter-name): the system's begin with _ */

int open(const char *path, int flags, ...)
{
  int (*real)(const char *, int, mode_t);
  va_list arguments;
  va_start(arguments, flags);
  mode_t mode = (flags & O_CREAT) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  REAL(real, "open");
  if (strncmp(path, "/sys/bus/usb-serial/", 20) == 0 && latency_file != NULL) {
    path = latency_file;
  } else if (call_fails(CALL_OPEN)) {
    return -1;
  }
  return real(path, flags, mode);
}

int dup3(int from, int to, int flags)
{
  int (*real)(int, int, int);
  REAL(real, "dup3");
  return call_fails(CALL_DUP3) ? -1 : real(from, to, flags);
}

int tcgetattr(int fd, struct termios *out)
{
  int (*real)(int, struct termios *);
  REAL(real, "tcgetattr");
  return call_fails(CALL_TCGETATTR) ? -1 : real(fd, out);
}

int tcsetattr(int fd, int when, const struct termios *wanted)
{
  int (*real)(int, int, const struct termios *);
  REAL(real, "tcsetattr");
  return call_fails(CALL_TCSETATTR) ? -1 : real(fd, when, wanted);
}

ssize_t read(int fd, void *bytes, size_t size)
{
  ssize_t (*real)(int, void *, size_t);
  REAL(real, "read");
  return call_fails(CALL_READ) ? -1 : real(fd, bytes, size);
}

ssize_t write(int fd, const void *bytes, size_t size)
{
  ssize_t (*real)(int, const void *, size_t);
  REAL(real, "write");
  if (shares.seed != 0 && fd == shares.fd) {
    uint32_t dice = atomic_fetch_add(&shares.seed, 1) * 2654435761u;
    size = (dice >> 8) % (size + 1);
    if (size == 0) {
      errno = EAGAIN;
      return -1;
    }
  }
  ssize_t sent;
  if (!call_fails(CALL_WRITE)) {
    sent = real(fd, bytes, size);
  } else {
    sent = errno == 0 ? real(fd, bytes, size / 2) : -1;
  }
  void (*hook)(void) = write_hook;
  write_hook = NULL;
  if (hook != NULL) {
    hook();
  }
  return sent;
}

/* The clock, and sleep, of who waits for another writer. */
static struct waiting {
  int64_t step_ns; /* of each look at the clock; 0: the real one */
  int64_t now_ns;
  int looks;
  int pauses;
  int64_t asleep_ns;
  void (*hook)(void); /* in each pause */
} waiting;

int clock_gettime(clockid_t clock, struct timespec *out)
{
  int (*real)(clockid_t, struct timespec *);
  REAL(real, "clock_gettime");
  if (waiting.step_ns == 0) {
    return real(clock, out);
  }
  ++waiting.looks;
  waiting.now_ns += waiting.step_ns;
  *out = (struct timespec){waiting.now_ns / 1000000000, waiting.now_ns % 1000000000};
  return 0;
}

int nanosleep(const struct timespec *length, struct timespec *left)
{
  int (*real)(const struct timespec *, struct timespec *);
  REAL(real, "nanosleep");
  if (waiting.step_ns == 0) {
    return real(length, left);
  }
  ++waiting.pauses;
  waiting.asleep_ns += 1000000000 * length->tv_sec + length->tv_nsec;
  if (waiting.hook != NULL) {
    waiting.hook();
  }
  return 0;
}

static int locks_tried;

int flock(int fd, int operation)
{
  int (*real)(int, int);
  REAL(real, "flock");
  ++locks_tried;
  return real(fd, operation);
}

/* NOLINTEND(readability-inconsistent-declaration-parameter-name) */

/* An adapter's lines and flags, which a pseudo-terminal does not have. */
static struct adapter {
  bool there;
  int lines;
  int flags;
} adapter;

/* NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name) */
int ioctl(int fd, unsigned long request, ...)
{
  int (*real)(int, unsigned long, void *);
  va_list arguments;
  va_start(arguments, request);
  void *about = va_arg(arguments, void *);
  va_end(arguments);
  REAL(real, "ioctl");
  if (!adapter.there) {
    return real(fd, request, about);
  }
  struct serial_struct *serial = about;
  switch (request) {
    case TIOCMGET:
      *(int *)about = adapter.lines;
      return 0;
    case TIOCMSET:
      adapter.lines = *(const int *)about;
      return 0;
    case TIOCGSERIAL:
      memset(serial, 0, sizeof *serial);
      serial->flags = adapter.flags;
      return 0;
    case TIOCSSERIAL:
      adapter.flags = serial->flags;
      return 0;
    default:
      return real(fd, request, about);
  }
}

/* ---- a port ---- */

typedef struct rig {
  hapi_spidar_serial serial;
  int board; /* the other end */
  char port[64];
} rig;

static void rig_end(void *self)
{
  rig *r = self;
  memset(fails, 0, sizeof fails);
  hapi_spidar_serial_finish(&r->serial);
  close(r->board);
}

static rig *rig_new(void)
{
  hap_detail detail = {""};
  rig *r = tap_own(sizeof *r, rig_end);
  r->board = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(r->board >= 0 && grantpt(r->board) == 0 && unlockpt(r->board) == 0);
  REQUIRE(ptsname_r(r->board, r->port, sizeof r->port) == 0);
  REQUIRE(hapi_spidar_serial_init(&r->serial, &detail) == HAP_OK);
  return r;
}

static rig *rig_open(void)
{
  hap_detail detail = {""};
  rig *r = rig_new();
  REQUIRE(hapi_spidar_serial_open(&r->serial, r->port, &detail) == HAP_OK);
  return r;
}

static int files_open(void)
{
  int count = 0;
  DIR *folder = opendir("/proc/self/fd");
  REQUIRE(folder != NULL);
  while (readdir(folder) != NULL) {
    ++count;
  }
  closedir(folder);
  return count;
}

static bool is_null_device(int fd)
{
  char name[40] = "";
  char path[40];
  snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
  return readlink(path, name, sizeof name - 1) > 0 && strcmp(name, "/dev/null") == 0;
}

static void open_fails(rig *r, const char *path, const char *word)
{
  hap_detail detail = {""};
  int before = files_open();
  hap_status status = hapi_spidar_serial_open(&r->serial, path, &detail);
  CHECK_SAY(status == HAP_ERROR_DEVICE && strstr(detail.text, word) != NULL &&
                strstr(detail.text, path) != NULL,
            "\"%s\" is not in \"%s\"", word, detail.text);
  CHECK(files_open() == before && is_null_device(r->serial.fd));
}

/* ---- opening ---- */

TEST(without_descriptors_there_is_no_port)
{
  hapi_spidar_serial serial;
  hap_detail detail = {""};
  fail_at(CALL_OPEN, 0, 1, EMFILE);
  CHECK(hapi_spidar_serial_init(&serial, &detail) == HAP_ERROR_SYSTEM);
  CHECK(strstr(detail.text, strerror(EMFILE)) != NULL);
  hapi_spidar_serial_finish(&serial); /* nothing */
  rig *r = rig_new();
  fail_at(CALL_DUP3, 0, 1, EMFILE);
  open_fails(r, r->port, strerror(EMFILE));
}

TEST(a_port_that_does_not_open_says_what_to_do)
{
  static const struct {
    int error;
    const char *help;
  } rows[] = {{EACCES, "60-hapode-spidar.rules"}, {EPERM, "60-hapode-spidar.rules"},
              {ENOENT, "is it plugged in"},       {ENXIO, "is it plugged in"},
              {ENODEV, "is it plugged in"},       {EIO, "is it plugged in"}};
  rig *r = rig_new();
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    fail_at(CALL_OPEN, 0, 1, rows[i].error);
    open_fails(r, r->port, rows[i].help);
    fail_at(CALL_OPEN, 0, 1, rows[i].error);
    open_fails(r, r->port, strerror(rows[i].error));
  }
  hap_detail detail = {""};
  fail_at(CALL_OPEN, 0, 1, ELOOP);
  CHECK(hapi_spidar_serial_open(&r->serial, r->port, &detail) == HAP_ERROR_DEVICE);
  CHECK(strchr(detail.text, ';') == NULL); /* nothing helps in general */
}

TEST(a_port_that_cannot_be_set_up_is_let_go)
{
  rig *r = rig_new();
  open_fails(r, "/dev/zero", "not a serial port");
  fail_at(CALL_TCGETATTR, 0, 1, EIO);
  open_fails(r, r->port, "2 Mbit/s");
  fail_at(CALL_TCSETATTR, 0, 1, EINVAL);
  open_fails(r, r->port, strerror(EINVAL));
  int other = open(r->port, O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(other >= 0 && flock(other, LOCK_EX | LOCK_NB) == 0);
  locks_tried = 0;
  open_fails(r, r->port, "in use");
  /* A guard whose driver has died has it for some 50 ms; nobody waits for a second. */
  CHECK_SAY(locks_tried >= 10 && locks_tried <= 100, "%d tries, 10 ms apart", locks_tried);
  close(other);
  hap_detail detail = {""};
  CHECK(hapi_spidar_serial_open(&r->serial, r->port, &detail) == HAP_OK);
  CHECK(strcmp(r->serial.path, r->port) == 0 && !is_null_device(r->serial.fd));
}

TEST(boards_are_not_reset_by_the_lines_of_the_port_and_bytes_come_at_once)
{
  rig *r = rig_new();
  hap_detail detail = {""};
  adapter = (struct adapter){true, TIOCM_RTS | TIOCM_DTR | TIOCM_CTS, 0x10};
  CHECK(hapi_spidar_serial_open(&r->serial, r->port, &detail) == HAP_OK);
  CHECK(adapter.lines == TIOCM_CTS && adapter.flags == (0x10 | ASYNC_LOW_LATENCY));
  struct termios t = {0};
  REQUIRE(tcgetattr(r->serial.fd, &t) == 0);
  CHECK(cfgetospeed(&t) == B2000000 && cfgetispeed(&t) == B2000000);
  CHECK((t.c_cflag & (CRTSCTS | CSTOPB | HUPCL)) == 0 && (t.c_cflag & CLOCAL) != 0);
  CHECK((t.c_lflag & (ECHO | ICANON | ISIG)) == 0 && t.c_cc[VMIN] == 1);
  adapter.there = false;
}

static char warned[600];

static void keep_warning(hap_log_level level, const char *text, void *user)
{
  (void)user;
  snprintf(warned, sizeof warned, "%d %s", (int)level, text);
}

TEST(an_adapter_that_is_slow_to_tell_is_a_warning)
{
  hap_hooks hooks;
  rig *r = rig_new();
  hap_detail detail = {""};
  CHECK(hapi_spidar_serial_latency(r->port) < 0); /* no USB adapter */
  CHECK(hapi_spidar_serial_latency("/no/such/port") < 0);
  file_write(folder_path("latency"), "16\n");
  latency_file = folder_path("latency");
  int before = files_open();
  CHECK(hapi_spidar_serial_latency(r->port) == 16);
  CHECK(files_open() == before);
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = keep_warning;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  CHECK(hapi_spidar_serial_open(&r->serial, r->port, &detail) == HAP_OK);
  CHECK(strstr(warned, "16 ms") != NULL && strstr(warned, r->port) != NULL);
  warned[0] = '\0';
  hapi_spidar_serial_shut(&r->serial);
  file_write(latency_file, "1\n");
  CHECK(hapi_spidar_serial_open(&r->serial, r->port, &detail) == HAP_OK && warned[0] == '\0');
  REQUIRE(hap_hooks_set(NULL) == HAP_OK);
  fail_at(CALL_READ, 0, 1, EIO);
  CHECK(hapi_spidar_serial_latency(r->port) < 0);
  latency_file = NULL;
}

/* The guard's way to a port that came back: it does not wait, and leaves what others have. */
TEST(a_guard_takes_a_port_only_whole)
{
  rig *r = rig_new();
  hapi_spidar_serial other = {.fd = -1};
  int before = files_open();
  CHECK(hapi_spidar_serial_attach(&other, "/no/such/port") == -ENOENT);
  CHECK(hapi_spidar_serial_attach(&other, "/dev/zero") == -ENOTTY);
  int holder = open(r->port, O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(holder >= 0 && flock(holder, LOCK_EX | LOCK_NB) == 0);
  CHECK(hapi_spidar_serial_attach(&other, r->port) == -EWOULDBLOCK);
  close(holder);
  fail_at(CALL_TCSETATTR, 0, 1, EIO);
  CHECK(hapi_spidar_serial_attach(&other, r->port) == -EIO);
  CHECK(other.fd == -1 && files_open() == before);
  CHECK(hapi_spidar_serial_attach(&other, r->port) == 0 && other.fd >= 0);
  CHECK(write(r->board, "x", 1) == 1);
  hapi_spidar_port port;
  uint8_t byte = 0;
  hapi_spidar_serial_port(&other, &port);
  port.await(&other, 1.0);
  CHECK(port.receive(&other, &byte, 1) == 1 && byte == 'x');
  hapi_spidar_serial_finish(&other);
}

TEST(a_port_that_is_finished_is_let_go)
{
  rig *r = rig_open();
  int before = files_open();
  hapi_spidar_serial_finish(&r->serial);
  CHECK(files_open() == before - 1 && r->serial.fd == -1);
  hapi_spidar_serial_finish(&r->serial);
  CHECK(files_open() == before - 1);
}

TEST(a_port_that_is_shut_is_the_null_device)
{
  rig *r = rig_open();
  int number = r->serial.fd;
  fail_at(CALL_OPEN, 0, 1, EMFILE);
  hapi_spidar_serial_shut(&r->serial); /* it cannot be: the old port is better than none */
  CHECK(!is_null_device(number));
  hapi_spidar_serial_shut(&r->serial);
  CHECK(r->serial.fd == number && is_null_device(number));
}

/* ---- every tick ---- */

/* All that comes until nothing does for 50 ms: the kernel hands it over in parts. */
static ssize_t board_read(const rig *r, uint8_t *out, size_t room)
{
  struct pollfd wait = {.fd = r->board, .events = POLLIN};
  size_t got = 0;
  while (got < room && poll(&wait, 1, 50) == 1) {
    ssize_t now = read(r->board, out + got, room - got);
    REQUIRE(now > 0);
    got += (size_t)now;
  }
  return (ssize_t)got;
}

TEST(a_write_is_whole_or_is_tried_again)
{
  rig *r = rig_open();
  const uint8_t bytes[8] = {1, 2, 3, 4, 5, 6, 7, 8};
  uint8_t come[256];
  hapi_spidar_port port;
  hapi_spidar_serial_port(&r->serial, &port);
  CHECK(port.send(&r->serial, bytes, 8) == 0);
  /* Who had the port before may have left a command in part. */
  CHECK(board_read(r, come, sizeof come) == HAPI_SPIDAR_FRAME_MAX + 8);
  CHECK(port.send(&r->serial, bytes, 8) == 0);
  fail_at(CALL_WRITE, 0, 1, EINTR);
  CHECK(port.send(&r->serial, bytes, 8) == -EAGAIN);
  fail_at(CALL_WRITE, 0, 1, EAGAIN);
  CHECK(port.send(&r->serial, bytes, 8) == -EAGAIN);
  fail_at(CALL_WRITE, 0, 1, EIO);
  CHECK(port.send(&r->serial, bytes, 8) == -EIO);
  CHECK(board_read(r, come, sizeof come) == 8);
  fail_at(CALL_WRITE, 0, 1, 0);
  CHECK(port.send(&r->serial, bytes, 8) == 0); /* half of it, and the rest is kept */
  CHECK(board_read(r, come, sizeof come) == 4);
  fail_at(CALL_WRITE, 0, 1, EAGAIN);
  CHECK(port.send(&r->serial, bytes, 8) == -EAGAIN); /* the rest first, and that does not go */
  CHECK(port.send(&r->serial, bytes, 8) == 0);
  CHECK(board_read(r, come, sizeof come) == 12 && memcmp(come + 4, bytes, 8) == 0);
}

/* ---- commands on the line ---- */

#define PULL_LOW 0xf1 /* a current of -15 */
#define PULL_HIGH 0xff
#define PULL_SIZE 37
#define NONE_SIZE (16 + PULL_SIZE)

/* CURRENT to board 0, a B3M, and the padding behind it. */
static const uint8_t pull_bytes[PULL_SIZE] = {0x30,     PULL_LOW,  PULL_HIGH, PULL_LOW, PULL_HIGH,
                                              PULL_LOW, PULL_HIGH, PULL_LOW,  PULL_HIGH};
static const uint8_t none_bytes[NONE_SIZE] = {[16] = 0x30}; /* behind zeros */

/* What a board hears: bytes to commands. */
typedef struct heard {
  uint8_t bytes[9];
  int have;
  unsigned pulls;
  unsigned nones;
  unsigned torn; /* a pull whose end is zeros */
  unsigned wild;
} heard;

static void board_hear(heard *h, const uint8_t *bytes, ssize_t count)
{
  for (ssize_t i = 0; i < count; ++i) {
    if (h->have == 0 && bytes[i] == 0) {
      continue;
    }
    h->bytes[h->have++] = bytes[i];
    if (h->have < 9) {
      continue;
    }
    int same = 0;
    int zeros = 0;
    for (; same < 9 && h->bytes[same] == pull_bytes[same]; ++same) {
    }
    for (; zeros < 9 && h->bytes[8 - zeros] == 0; ++zeros) {
    }
    h->pulls += same == 9;
    h->nones += zeros == 8 && same >= 1;
    h->torn += zeros < 8 && same < 9 && same + zeros == 9;
    h->wild += same + zeros < 9;
    h->have = 0;
  }
}

static void board_listen(const rig *r, heard *h)
{
  uint8_t bytes[4096];
  struct pollfd some = {r->board, POLLIN, 0};
  while (poll(&some, 1, 0) > 0) {
    ssize_t count = read(r->board, bytes, sizeof bytes);
    REQUIRE(count > 0);
    board_hear(h, bytes, count);
  }
}

static rig *interrupted;

static void zero_from_handler(void)
{
  CHECK(hapi_spidar_serial_force(&interrupted->serial, none_bytes, NONE_SIZE));
}

static void half_zero_from_handler(void)
{
  fail_at(CALL_WRITE, 0, 100000, 0); /* never whole */
  CHECK(!hapi_spidar_serial_force(&interrupted->serial, none_bytes, NONE_SIZE));
  memset(fails, 0, sizeof fails);
}

/* A header must never be taken for a current, whoever writes when. */
TEST(a_zero_in_the_middle_of_a_write_leaves_no_wild_command)
{
  for (int cut = 0; cut < 2; ++cut) {
    for (int half = 0; half < 2; ++half) {
      rig *r = rig_open();
      heard h = {.have = 0};
      hapi_spidar_port port;
      hapi_spidar_serial_port(&r->serial, &port);
      CHECK(port.send(&r->serial, pull_bytes, PULL_SIZE) == 0);
      interrupted = r;
      if (cut != 0) {
        fail_at(CALL_WRITE, 0, 1, 0);
      }
      write_hook = half != 0 ? half_zero_from_handler : zero_from_handler;
      (void)port.send(&r->serial, pull_bytes, 12); /* half of it is in the currents */
      CHECK(port.send(&r->serial, pull_bytes, PULL_SIZE) == 0);
      board_listen(r, &h);
      CHECK(h.wild == 0 && h.pulls + h.torn == 3 && h.have == 0);
      CHECK(h.nones >= 1);
      CHECK(h.torn <= (cut != 0 ? 1 : 0));
    }
  }
}

static atomic_bool pull_end;

static void *pull_often(void *self)
{
  rig *r = self;
  hapi_spidar_port port;
  hapi_spidar_serial_port(&r->serial, &port);
  while (!atomic_load(&pull_end)) {
    (void)port.send(&r->serial, pull_bytes, PULL_SIZE);
    sched_yield();
  }
  return NULL;
}

/* Two threads, and a port that takes what it likes. */
TEST(commands_are_whole_whatever_the_port_takes)
{
  rig *r = rig_open();
  heard h = {.have = 0};
  pthread_t thread;
  shares.fd = r->serial.fd;
  shares.seed = 1;
  atomic_store(&pull_end, false);
  REQUIRE(pthread_create(&thread, NULL, pull_often, r) == 0);
  for (int i = 0; i < 1000000 && (h.pulls < 1000 || h.nones < 1000); ++i) {
    (void)hapi_spidar_serial_force(&r->serial, none_bytes, NONE_SIZE);
    sched_yield();
    board_listen(r, &h);
  }
  atomic_store(&pull_end, true);
  pthread_join(thread, NULL);
  shares.seed = 0;
  bool whole = false;
  for (int i = 0; i < 10000 && !whole; ++i) { /* a busy kernel may be behind */
    whole = hapi_spidar_serial_force(&r->serial, none_bytes, NONE_SIZE);
    board_listen(r, &h);
  }
  CHECK(whole);
  /* One for the port that was opened. A thread that is away for ms in the driver was not waited
   * for. */
  unsigned beside = atomic_load(&r->serial.cuts) - 1;
  CHECK_SAY(h.wild <= beside && h.torn <= beside && h.pulls >= 1000 && h.nones >= 1000,
            "%u wild, %u torn, %u pulls, %u nones, %u not waited for", h.wild, h.torn, h.pulls,
            h.nones, beside);
}

TEST(nothing_to_read_is_no_error_and_a_hang_up_is)
{
  rig *r = rig_open();
  uint8_t byte = 0;
  hapi_spidar_port port;
  hapi_spidar_serial_port(&r->serial, &port);
  CHECK(port.receive(&r->serial, &byte, 1) == 0);
  fail_at(CALL_READ, 0, 1, EINTR);
  CHECK(port.receive(&r->serial, &byte, 1) == 0);
  fail_at(CALL_READ, 0, 1, EIO);
  CHECK(port.receive(&r->serial, &byte, 1) == -EIO);
  hapi_spidar_serial_shut(&r->serial);
  CHECK(port.receive(&r->serial, &byte, 1) == -EIO); /* the end of the null device */
}

/* Zeros: from a signal handler, while the loop writes to the same port. */
TEST(zeros_are_tried_again_and_leave_errno_as_it_was)
{
  rig *r = rig_open();
  const uint8_t bytes[8] = {0};
  fail_at(CALL_WRITE, 0, 20, EAGAIN);
  errno = ERANGE;
  CHECK(hapi_spidar_serial_force(&r->serial, bytes, 8) && errno == ERANGE);
  CHECK(fails[CALL_WRITE].times == 0);
  fail_at(CALL_WRITE, 0, 20, EINTR);
  CHECK(hapi_spidar_serial_force(&r->serial, bytes, 8));
  fail_at(CALL_WRITE, 0, 3, 0);
  CHECK(hapi_spidar_serial_force(&r->serial, bytes, 8)); /* once it is whole */
  fail_at(CALL_WRITE, 0, 2, EIO);
  CHECK(!hapi_spidar_serial_force(&r->serial, bytes, 8) && fails[CALL_WRITE].times == 1);
  fail_at(CALL_WRITE, 0, 1000000, EAGAIN);
  CHECK(!hapi_spidar_serial_force(&r->serial, bytes, 8)); /* it comes back all the same */
  /* Within 1 ms, as it may be a signal handler; a write that is refused takes a us. */
  int tries = 1000000 - fails[CALL_WRITE].times;
  CHECK_SAY(tries >= 50 && tries <= 1000 && errno == ERANGE, "%d tries", tries);
}

static hapi_spidar_serial *written_to;

static void writer_leaves_in_the_third_pause(void)
{
  if (waiting.pauses == 3) {
    atomic_store(&written_to->writer, 0);
  }
}

/* While another thread writes: from when on, and whether, it lets go. */
static unsigned zeros_wait(rig *r, void (*hook)(void))
{
  unsigned cuts = atomic_load(&r->serial.cuts);
  written_to = &r->serial;
  atomic_store(&r->serial.writer, 1); /* no thread has this name */
  waiting = (struct waiting){.step_ns = 100, .hook = hook};
  CHECK(hapi_spidar_serial_force(&r->serial, none_bytes, NONE_SIZE));
  waiting.step_ns = 0;
  CHECK(atomic_load(&r->serial.writer) == (waiting.pauses == 3 ? 0 : 1)); /* who had it has it */
  atomic_store(&r->serial.writer, 0);
  return atomic_load(&r->serial.cuts) - cuts;
}

/* A write is over in some us, and a thread that lost the processor is back in some 0.1 ms, if the
 * caller sleeps. Zeros that come ms later would be late for whoever stopped a driver that hangs. */
TEST(zeros_wait_for_another_writer_but_not_for_long)
{
  rig *r = rig_open();
  CHECK(zeros_wait(r, NULL) == 2); /* beside it */
  CHECK_SAY(waiting.looks >= 70 && waiting.looks <= 700, "%d looks", waiting.looks);
  CHECK_SAY(waiting.asleep_ns >= 500000 && waiting.asleep_ns <= 5000000, "%g ms asleep",
            1e-6 * (double)waiting.asleep_ns);
  CHECK(waiting.asleep_ns <= 200000 * waiting.pauses);
  CHECK(zeros_wait(r, writer_leaves_in_the_third_pause) == 0 && waiting.pauses == 3);
  atomic_store(&r->serial.forcing, 1); /* other zeros wait: these need not */
  CHECK(zeros_wait(r, NULL) == 2 && waiting.pauses == 0 && waiting.looks > 0);
  atomic_store(&r->serial.forcing, 0);
}

/* ---- which ports there are ---- */

#ifdef HAPODE_LIBSERIALPORT

/* What libserialport lists. Its ports are not looked into. */
static char listed[3][8] = {"ttyS0", "ttyUSB0", "ttyACM1"};
static bool list_fails;
static int lists; /* that nobody has freed */

enum sp_return sp_list_ports(struct sp_port ***list_ptr)
{
  static struct sp_port *ports[4];
  if (list_fails) {
    return SP_ERR_FAIL;
  }
  for (int i = 0; i < 3; ++i) {
    ports[i] = (struct sp_port *)(void *)listed[i];
  }
  ports[3] = NULL;
  *list_ptr = ports;
  ++lists;
  return SP_OK;
}

void sp_free_port_list(struct sp_port **ports)
{
  (void)ports;
  --lists;
}

char *sp_get_port_name(const struct sp_port *port)
{
  return (char *)(uintptr_t)port;
}

enum sp_transport sp_get_port_transport(const struct sp_port *port)
{
  return strncmp((const char *)port, "ttyS", 4) == 0 ? SP_TRANSPORT_NATIVE : SP_TRANSPORT_USB;
}

static bool none_found(const char *word)
{
  hap_device *device = NULL;
  hap_detail detail = {""};
  hap_status status = hap_device_open("spidar", &device, &detail);
  CHECK_SAY(status == HAP_ERROR_DEVICE && device == NULL && strstr(detail.text, word) != NULL,
            "\"%s\" is not in \"%s\"", word, detail.text);
  return status < HAP_OK;
}

static bool port_is(int index, const char *wanted)
{
  char path[HAPI_SPIDAR_PATH_MAX] = "";
  bool there = hapi_spidar_port_at(index, path);
  CHECK(lists == 0);
  return wanted != NULL ? there && strcmp(path, wanted) == 0 : !there;
}

TEST(usb_adapters_alone_are_looked_at)
{
  unsetenv("HAPODE_SPIDAR_PORT");
  CHECK(port_is(0, "ttyUSB0") && port_is(1, "ttyACM1") && port_is(2, NULL));
  setenv("HAPODE_SPIDAR_PORT", "", 1);
  CHECK(port_is(0, "ttyUSB0"));
  setenv("HAPODE_SPIDAR_PORT", "/my/port", 1);
  CHECK(port_is(0, "/my/port") && port_is(1, "ttyUSB0") && port_is(3, NULL));
  list_fails = true;
  CHECK(port_is(0, "/my/port") && port_is(1, NULL));
  unsetenv("HAPODE_SPIDAR_PORT");
  CHECK(port_is(0, NULL) && none_found("there is no serial port of a USB adapter"));
  list_fails = false;
  CHECK(none_found("ttyUSB0: No such file") && none_found("; ttyACM1: No such file"));
}

#endif

/* ---- boards ---- */

/* A port that plays back what it is told to, in a time of its own. */
typedef struct fake {
  hapi_spidar_port port;
  double now;
  int full;          /* sends that it does not take yet */
  int send_error;    /* 0: it takes all */
  int receive_error; /* behind what there is */
  uint8_t bytes[1200];
  int used;
  int given;
  int model; /* that board 0 answers to a question; 0: nothing */
  int sent;  /* commands that it took */
} fake;

static void fake_add(fake *f, const void *bytes, int count)
{
  REQUIRE(f->used + count <= (int)sizeof f->bytes);
  memcpy(f->bytes + f->used, bytes, (size_t)count);
  f->used += count;
}

static int fake_send(void *self, const uint8_t *bytes, int count)
{
  fake *f = self;
  const hapi_spidar_kind *kind = hapi_spidar_kind_find(f->model);
  if (f->full > 0) {
    --f->full;
    return -EAGAIN;
  }
  ++f->sent;
  if (f->send_error == 0 && kind != NULL && count > HAPI_SPIDAR_FRAME_MAX &&
      bytes[HAPI_SPIDAR_FRAME_MAX] == hapi_spidar_header(HAPI_SPIDAR_BOARD_INFO, 0)) {
    const uint8_t answer[7] = {bytes[HAPI_SPIDAR_FRAME_MAX], (uint8_t)f->model,
                               HAPI_SPIDAR_TARGETS,          (uint8_t)kind->motors,
                               (uint8_t)kind->currents,      (uint8_t)kind->forces};
    fake_add(f, answer, 7);
  }
  return -f->send_error;
}

static int fake_receive(void *self, uint8_t *bytes, int size)
{
  fake *f = self;
  int count = f->used - f->given < size ? f->used - f->given : size;
  memcpy(bytes, f->bytes + f->given, (size_t)count);
  f->given += count;
  return count == 0 && f->receive_error != 0 ? -f->receive_error : count;
}

static void fake_await(void *self, double seconds)
{
  fake *f = self;
  f->now += seconds;
}

static double fake_now(void *self)
{
  const fake *f = self;
  return f->now;
}

static void fake_flush(void *self)
{
  (void)self;
}

static void fake_end(void *self)
{
  (void)self;
}

static fake *fake_new(int model)
{
  fake *f = tap_own(sizeof *f, fake_end);
  f->port = (hapi_spidar_port){f, fake_send, fake_receive, fake_await, fake_now, fake_flush};
  f->model = model;
  return f;
}

static const hapi_spidar_boards one_b5m = {.count = 1, .id = {0}, .model = {7}};

TEST(a_full_port_is_waited_for_but_not_for_ever)
{
  hapi_spidar_line line;
  fake *f = fake_new(7);
  f->full = 10;
  CHECK(hapi_spidar_line_begin(&line, &f->port, &one_b5m, 1e6) == HAP_OK && f->full == 0);
  CHECK_NEAR(f->now, 0.01, 1e-9);
  f->full = 1000000;
  CHECK(hapi_spidar_line_begin(&line, &f->port, &one_b5m, 1e6) < HAP_OK);
  CHECK_NEAR(f->now, 0.06, 2e-3);
}

TEST(boards_are_compared_with_those_before)
{
  hapi_spidar_boards other = one_b5m;
  other.model[0] = 5;
  CHECK(hapi_spidar_line_compare(&fake_new(7)->port, &one_b5m) == 1);
  CHECK(hapi_spidar_line_compare(&fake_new(7)->port, &other) == 0);
  CHECK(hapi_spidar_line_compare(&fake_new(0)->port, &one_b5m) == -EAGAIN); /* silent */
  fake *f = fake_new(7);
  f->send_error = EIO;
  CHECK(hapi_spidar_line_compare(&f->port, &one_b5m) == -EIO);
  f = fake_new(0);
  f->receive_error = ENXIO;
  CHECK(hapi_spidar_line_compare(&f->port, &one_b5m) == -ENXIO);
}

TEST(an_answer_is_taken_only_from_a_board_that_there_can_be)
{
  static const uint8_t info = HAPI_SPIDAR_BOARD_INFO << 3;           /* of board 0 */
  static const uint8_t wrong[][7] = {{info, 9, 12, 8, 0, 4, 0},      /* no such model */
                                     {info, 7, 11, 8, 0, 4, 0},      /* targets */
                                     {info, 7, 12, 7, 0, 4, 0},      /* motors */
                                     {info, 7, 12, 8, 0, 3, 0},      /* force channels */
                                     {info | 1, 7, 12, 8, 0, 4, 0}}; /* another board */
  hapi_spidar_boards found;
  hap_detail detail = {""};
  fake *f = fake_new(0);
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    fake_add(f, wrong[i], 7);
  }
  CHECK(hapi_spidar_line_find(&f->port, &found, &detail) == HAP_ERROR_DEVICE && found.count == 0);
  f = fake_new(0);
  const uint8_t garbage[300] = {0xff, 0xff, 0xff};
  const uint8_t right[7] = {info, 7, 12, 8, 8, 4, 0}; /* currents: some firmware says 8 */
  fake_add(f, garbage, 300);
  fake_add(f, right, 7);
  CHECK(hapi_spidar_line_find(&f->port, &found, &detail) == HAP_OK);
  CHECK(found.count == 1 && found.id[0] == 0 && found.model[0] == 7);
}

TEST(an_exchange_that_fails_says_how)
{
  const int16_t none[8] = {0};
  hapi_spidar_line line;
  fake *f = fake_new(7);
  REQUIRE(hapi_spidar_line_begin(&line, &f->port, &one_b5m, 1e6) == HAP_OK);
  CHECK(hapi_spidar_line_exchange(&line, none, 0.1) == HAP_ERROR_TIMEOUT);
  CHECK_NEAR(f->now, 0.1, 1e-3);
  f->receive_error = EIO;
  CHECK(hapi_spidar_line_exchange(&line, none, 0.1) == HAP_ERROR_DEVICE);
  f->receive_error = 0;
  f->send_error = EIO;
  CHECK(hapi_spidar_line_exchange(&line, none, 0.1) == HAP_ERROR_DEVICE);
}

/* A board that is just switched on may miss a question, a busy machine an answer. */
TEST(each_board_is_asked_three_times_for_10_ms)
{
  hapi_spidar_boards found;
  hap_detail detail = {""};
  fake *f = fake_new(0);
  CHECK(hapi_spidar_line_find(&f->port, &found, &detail) == HAP_ERROR_DEVICE);
  CHECK(f->sent == 3 * HAPI_SPIDAR_BOARDS);
  CHECK_NEAR(f->now, 0.01 * f->sent, 1e-9);
}

TEST(a_command_without_an_answer_is_sent_again_every_5_ms)
{
  const int16_t none[8] = {0};
  hapi_spidar_line line;
  fake *f = fake_new(7);
  REQUIRE(hapi_spidar_line_begin(&line, &f->port, &one_b5m, 1e6) == HAP_OK);
  f->sent = 0;
  CHECK(hapi_spidar_line_exchange(&line, none, 0.1) == HAP_ERROR_TIMEOUT);
  CHECK(f->sent >= 19 && f->sent <= 21);
}

/* A reply of the board with one string at raw, after seconds of silence. */
static int reply_comes(fake *f, hapi_spidar_line *line, double seconds, int raw)
{
  uint8_t bytes[HAPI_SPIDAR_REPLIES_MAX];
  hapi_spidar_frame frame = {.board = 0, .command = HAPI_SPIDAR_CURRENT};
  frame.position[2] = (int16_t)raw;
  fake_add(f, bytes, hapi_spidar_encode(&frame, 7, HAPI_SPIDAR_FROM_BOARD, bytes));
  f->now += seconds;
  return hapi_spidar_line_receive(line);
}

TEST(a_string_goes_32_counts_and_what_its_speed_allows)
{
  hapi_spidar_line line;
  fake *f = fake_new(7);
  REQUIRE(hapi_spidar_line_begin(&line, &f->port, &one_b5m, 1000.0) == HAP_OK);
  CHECK(reply_comes(f, &line, 0.001, 500) == 1); /* the first may be anywhere */
  CHECK(reply_comes(f, &line, 0.0105, 543) == 0 && line.bad_steps == 1);
  CHECK(reply_comes(f, &line, 0.0, 542) == 1 && line.bad_steps == 0);
  CHECK(reply_comes(f, &line, 0.0005, 542 - 33) == 0);
  CHECK(reply_comes(f, &line, 0.0, 542 - 32) == 1);
  CHECK(reply_comes(f, &line, 1e6, 542 - 32 + 32767) == 1); /* as far as numbers go */
}

SET_UP
{
  return folder_make();
}
