/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The second process of the SPIDAR, byte by byte: when it zeroes, how often, what does not end it,
 * and what it leaves alone. The port is a socket, whose other end this test reads. Some calls of
 * the system are those of this file, which fail, or do not wait, when told. */

#include "tests/files.h"
#include "tests/tap.h"

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/safety.h"
#include "plugins/spidar/guard.h"
#include "plugins/spidar/serial.h"

#define ROUNDS_LEAST 3 /* of zeros: the line may lose a byte of one */
#define ZEROS 20
#define STALL_S 0.2
#define PATIENCE_MS 20000

/* ---- the system ---- */

/* The guard inherits what is set here. */
static struct trouble {
  int forks_good; /* before one fails; -1: none does */
  int wait_interrupts;
  bool wait_killed; /* a child that was waited for was killed */
  int poll_interrupts;
  bool hurries; /* polls and pauses of the guard come back at once */
  bool old_kernel;
  bool no_sockets;
  bool no_memory;
  char sysfs[100];   /* stands for /sys; "": it does not */
  char adapter[100]; /* stands for /dev/ttyUSB0 */
} trouble = {.forks_good = -1};

/* Of the guard, in memory that both have. */
static struct looks {
  atomic_int count;
  atomic_int longest_ms;
  atomic_int pauses; /* between two zeros */
  atomic_llong shortest_ns;
  atomic_int logged; /* lines to the system's log */
} * looks;

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

pid_t fork(void)
{
  pid_t (*real)(void);
  REAL(real, "fork");
  if (trouble.forks_good >= 0 && trouble.forks_good-- == 0) {
    errno = EAGAIN;
    return -1;
  }
  return real();
}

/* NOLINTBEGIN(readability-inconsistent-declaration-parameter-name): the system's begin with _ */

pid_t waitpid(pid_t child, int *status, int options)
{
  pid_t (*real)(pid_t, int *, int);
  REAL(real, "waitpid");
  if (trouble.wait_interrupts > 0) {
    --trouble.wait_interrupts;
    errno = EINTR;
    return -1;
  }
  pid_t ended = real(child, status, options);
  if (trouble.wait_killed && status != NULL) {
    *status = SIGKILL;
  }
  return ended;
}

static bool is_guard(void)
{
  char name[17] = "";
  return prctl(PR_GET_NAME, name) == 0 && strcmp(name, "spidar-guard") == 0;
}

static int waited_ms; /* of the newest poll of a process that is no guard: what it asked for */

int poll(struct pollfd *files, nfds_t count, int timeout)
{
  int (*real)(struct pollfd *, nfds_t, int);
  REAL(real, "poll");
  waited_ms = timeout;
  if (trouble.poll_interrupts > 0) {
    --trouble.poll_interrupts;
    errno = EINTR;
    return -1;
  }
  if (is_guard()) {
    atomic_fetch_add(&looks->count, 1);
    if (timeout > atomic_load(&looks->longest_ms)) {
      atomic_store(&looks->longest_ms, timeout);
    }
  }
  return real(files, count, trouble.hurries && is_guard() ? 0 : timeout);
}

int nanosleep(const struct timespec *wanted, struct timespec *left)
{
  int (*real)(const struct timespec *, struct timespec *);
  REAL(real, "nanosleep");
  if (is_guard()) {
    long long ns = 1000000000LL * wanted->tv_sec + wanted->tv_nsec;
    bool first = atomic_fetch_add(&looks->pauses, 1) == 0;
    if (first || ns < atomic_load(&looks->shortest_ns)) {
      atomic_store(&looks->shortest_ns, ns);
    }
  }
  return real(wanted, left);
}

int socket(int family, int type, int protocol)
{
  int (*real)(int, int, int);
  REAL(real, "socket");
  return trouble.no_sockets ? -1 : real(family, type, protocol);
}

ssize_t sendto(int fd, const void *bytes, size_t size, int flags, __CONST_SOCKADDR_ARG to,
               socklen_t length)
{
  ssize_t (*real)(int, const void *, size_t, int, __CONST_SOCKADDR_ARG, socklen_t);
  REAL(real, "sendto");
  if (is_guard()) {
    atomic_fetch_add(&looks->logged, fd >= 0 && memcmp(bytes, "<28>spidar-guard: ", 18) == 0);
  }
  return real(fd, bytes, size, flags, to, length);
}

void *mmap(void *at, size_t size, int protection, int flags, int fd, off_t offset)
{
  void *(*real)(void *, size_t, int, int, int, off_t);
  REAL(real, "mmap");
  return trouble.no_memory ? MAP_FAILED : real(at, size, protection, flags, fd, offset);
}

int open(const char *path, int flags, ...)
{
  char other[300];
  int (*real)(const char *, int, mode_t);
  va_list arguments;
  va_start(arguments, flags);
  mode_t mode = (flags & O_CREAT) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  REAL(real, "open");
  if (trouble.sysfs[0] != '\0' && strncmp(path, "/sys/", 5) == 0) {
    snprintf(other, sizeof other, "%s/%s", trouble.sysfs, path + 5);
    path = other;
  } else if (trouble.adapter[0] != '\0' && strcmp(path, "/dev/ttyUSB0") == 0) {
    path = trouble.adapter;
  }
  return real(path, flags, mode);
}

long syscall(long number, ...)
{
  long (*real)(long, long, long, long);
  va_list arguments;
  va_start(arguments, number);
  long a = va_arg(arguments, long);
  long b = va_arg(arguments, long);
  long c = va_arg(arguments, long);
  va_end(arguments);
  REAL(real, "syscall");
  if (trouble.old_kernel && (number == SYS_close_range || number == SYS_pidfd_open)) {
    errno = ENOSYS;
    return -1;
  }
  return real(number, a, b, c);
}

/* NOLINTEND(readability-inconsistent-declaration-parameter-name) */

static void trouble_over(void)
{
  trouble = (struct trouble){.forks_good = -1};
}

/* ---- the rig ---- */

typedef struct rig {
  hapi_spidar_guard guard;
  int port;
  int board; /* the other end of the port */
  uint8_t zeros[ZEROS];
  hapi_spidar_boards boards; /* that a port has to have; none: any */
} rig;

static void rig_end(void *self)
{
  rig *r = self;
  trouble_over();
  hapi_spidar_guard_finish(&r->guard);
  close(r->port);
  close(r->board);
}

static rig *rig_new(void)
{
  int ends[2];
  rig *r = tap_own(sizeof *r, rig_end);
  REQUIRE(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
  r->port = ends[0];
  r->board = ends[1];
  for (int i = 0; i < ZEROS; ++i) {
    r->zeros[i] = (uint8_t)(0x40 + i);
  }
  REQUIRE(hapi_spidar_guard_init(&r->guard));
  return r;
}

static const hapi_spidar_identity unknown = {.usb = false};

static bool rig_start_as(rig *r, const char *path, const hapi_spidar_identity *identity,
                         double stall_s)
{
  const hapi_spidar_guard_def def = {.port = r->port,
                                     .path = path,
                                     .identity = identity,
                                     .boards = &r->boards,
                                     .zeros = r->zeros,
                                     .zero_count = ZEROS,
                                     .stall_s = stall_s};
  return hapi_spidar_guard_start(&r->guard, &def);
}

static bool rig_start_at(rig *r, const char *path, double stall_s)
{
  return rig_start_as(r, path, &unknown, stall_s);
}

static bool rig_start(rig *r, double stall_s)
{
  return rig_start_at(r, "/no/such/port", stall_s);
}

/* Whole rounds of zeros that come until nothing has come for quiet_ms, or the port is closed. */
static int rounds_read(int board, const uint8_t *zeros, int first_ms, int quiet_ms)
{
  uint8_t bytes[4096];
  int used = 0;
  int rounds = 0;
  struct pollfd ready = {board, POLLIN, 0};
  while (used < (int)sizeof bytes && poll(&ready, 1, used == 0 ? first_ms : quiet_ms) > 0) {
    ssize_t count = read(board, bytes + used, sizeof bytes - (size_t)used);
    if (count <= 0) {
      break;
    }
    used += (int)count;
  }
  for (int i = 0; i + ZEROS <= used; ++i) {
    rounds += memcmp(bytes + i, zeros, ZEROS) == 0;
  }
  /* Before the first one zeros end a command that went out in part. */
  CHECK(rounds == 0 || (used == HAPI_SPIDAR_FRAME_MAX + rounds * ZEROS && bytes[0] == 0 &&
                        memcmp(bytes + HAPI_SPIDAR_FRAME_MAX, zeros, ZEROS) == 0));
  return rounds;
}

static bool is_quiet(const rig *r, int ms)
{
  struct pollfd ready = {r->board, POLLIN, 0};
  return poll(&ready, 1, ms) == 0;
}

/* The guard's process, which is a child of this one, who reaps orphans; 0: it did not come. */
static pid_t guard_await(const rig *r)
{
  for (int ms = 0; ms < PATIENCE_MS && atomic_load(&r->guard.pulse->guard) == 0; ms += 5) {
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return (pid_t)atomic_load(&r->guard.pulse->guard);
}

static bool guard_ends(pid_t guard)
{
  int end = 0;
  for (int ms = 0; ms < PATIENCE_MS; ms += 5) {
    if (waitpid(guard, &end, WNOHANG) == guard) {
      return true;
    }
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return false;
}

/* What users see in a list of processes. */
static bool process_is_named(pid_t process, const char *wanted)
{
  char path[60];
  char name[40] = "";
  snprintf(path, sizeof path, "/proc/%d/comm", (int)process);
  FILE *file = fopen(path, "r");
  bool read = file != NULL && fgets(name, sizeof name, file) != NULL;
  if (file != NULL) {
    fclose(file);
  }
  name[strcspn(name, "\n")] = '\0';
  return read && strcmp(name, wanted) == 0;
}

TEST(an_orderly_end_sends_nothing)
{
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await(r);
  REQUIRE(guard > 0);
  CHECK(process_is_named(guard, "spidar-guard"));
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(waited_ms == 1000); /* at most, for a guard that hangs */
  CHECK(r->guard.channel < 0);
  CHECK(guard_ends(guard));
  CHECK(is_quiet(r, 50));
  hapi_spidar_guard_end(&r->guard, true); /* again: nothing */
}

TEST(a_loop_that_stands_still_while_it_pulls_is_zeroed_several_times)
{
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  CHECK(is_quiet(r, (int)(4.0 * STALL_S * 1000.0))); /* no force, no stall */
  CHECK(!atomic_load(&r->guard.pulse->stalled));
  atomic_store(&r->guard.pulse->pulling, true);
  for (int i = 0; i < 40; ++i) { /* it beats */
    atomic_fetch_add(&r->guard.pulse->beats, 1);
    hapi_clock_sleep_until(hapi_clock_now() + 10000000);
  }
  CHECK(!atomic_load(&r->guard.pulse->stalled) && is_quiet(r, 0));
  int64_t begin = hapi_clock_now();
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 300) >= ROUNDS_LEAST);
  CHECK(atomic_load(&r->guard.pulse->stalled));
  CHECK(hapi_clock_now() - begin > (int64_t)(0.5e9 * STALL_S)); /* not at once */
  REQUIRE(rig_start(r, STALL_S)); /* a new one knows nothing of that */
  CHECK(!atomic_load(&r->guard.pulse->stalled) && !atomic_load(&r->guard.pulse->pulling));
  CHECK(is_quiet(r, 100));
}

/* A process that drives a device dies in each of these ways. */
static void driver_dies(rig *r, int number)
{
  pid_t driver = fork();
  REQUIRE(driver >= 0);
  if (driver == 0) {
    if (!rig_start(r, 100.0)) {
      _exit(1);
    }
    if (number == 0) {
      _exit(0);
    }
    (void)signal(number, SIG_DFL); /* a shell's job in the background ignores SIGINT */
    (void)raise(number);
    for (;;) {
      pause();
    }
  }
  close(r->port); /* the guard alone has it then */
  r->port = open("/dev/null", O_RDWR | O_CLOEXEC);
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 1000) >= ROUNDS_LEAST);
  CHECK(waitpid(driver, NULL, 0) == driver);
  char byte = 0;
  CHECK(read(r->board, &byte, 1) == 0); /* it has let go of the port */
}

TEST(a_driver_that_dies_is_zeroed_several_times)
{
  static const int ways[] = {0, SIGKILL, SIGTERM, SIGINT};
  for (size_t i = 0; i < sizeof ways / sizeof ways[0]; ++i) {
    driver_dies(rig_new(), ways[i]);
  }
}

/* Ctrl-C, a closed terminal and others are meant for the program. */
TEST(signals_for_the_program_do_not_end_it)
{
  static const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGUSR1, SIGALRM};
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await(r);
  REQUIRE(guard > 0);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i) {
    CHECK(kill(guard, numbers[i]) == 0);
  }
  hapi_clock_sleep_until(hapi_clock_now() + 100000000);
  CHECK(waitpid(guard, NULL, WNOHANG) == 0);
  CHECK(getsid(guard) != getsid(0)); /* nor those of a terminal's group */
  atomic_store(&r->guard.pulse->pulling, true);
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 300) >= ROUNDS_LEAST);
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(guard_ends(guard));
}

static int descriptors_of(pid_t process)
{
  char path[60];
  int count = 0;
  snprintf(path, sizeof path, "/proc/%d/fd", (int)process);
  DIR *folder = opendir(path);
  for (struct dirent *entry = folder != NULL ? readdir(folder) : NULL; entry != NULL;
       entry = readdir(folder)) {
    count += entry->d_name[0] != '.';
  }
  if (folder != NULL) {
    closedir(folder);
  }
  return count;
}

static int descriptors_await(pid_t process, int most)
{
  int count = 0;
  for (int ms = 0; ms < PATIENCE_MS; ms += 5) {
    count = descriptors_of(process);
    if (count <= most) {
      break;
    }
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return count;
}

TEST(it_keeps_nothing_else_of_the_program_open)
{
  int many[20];
  rig *r = rig_new();
  for (int i = 0; i < 20; ++i) {
    many[i] = open("/dev/null", O_RDONLY);
  }
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await(r);
  REQUIRE(guard > 0);
  int told = isatty(STDERR_FILENO) ? 1 : 0; /* where it says what it did */
  int kept = descriptors_await(guard, 3 + told) - told;
  CHECK(kept == 2 || kept == 3); /* port, channel, and the parent where the kernel has that */
  for (int i = 0; i < 20; ++i) {
    close(many[i]);
  }
  int before = descriptors_of(getpid());
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(descriptors_of(getpid()) == before - 1);
  CHECK(guard_ends(guard));
}

/* Its name is the next one's, and that may be a person's shell. */
TEST(a_pseudo_terminal_is_not_waited_for)
{
  static const char *const paths[] = {"/no/such/port", "/dev/pts/1000000"};
  for (int i = 0; i < 2; ++i) {
    rig *r = rig_new();
    REQUIRE(rig_start_at(r, paths[i], STALL_S));
    pid_t guard = guard_await(r);
    REQUIRE(guard > 0);
    close(r->board); /* the other end of the port is gone */
    r->board = open("/dev/null", O_RDWR | O_CLOEXEC);
    hapi_spidar_guard_end(&r->guard, false);
    hapi_clock_sleep_until(hapi_clock_now() + 300000000);
    bool waits = waitpid(guard, NULL, WNOHANG) == 0;
    CHECK(waits == (i == 0));
    if (waits) {
      kill(guard, SIGKILL);
      CHECK(waitpid(guard, NULL, 0) == guard);
    }
  }
}

TEST(no_process_no_guard)
{
  rig *r = rig_new();
  struct rlimit none;
  REQUIRE(getrlimit(RLIMIT_NOFILE, &none) == 0);
  struct rlimit few = {3, none.rlim_max};
  REQUIRE(setrlimit(RLIMIT_NOFILE, &few) == 0);
  CHECK(!rig_start(r, STALL_S)); /* no channel */
  CHECK(r->guard.channel < 0);
  REQUIRE(setrlimit(RLIMIT_NOFILE, &none) == 0);
  CHECK(rig_start(r, STALL_S));
}

TEST(a_fork_that_fails_says_why)
{
  for (int good = 0; good < 2; ++good) { /* of the process, or of its child */
    rig *r = rig_new();
    int before = descriptors_of(getpid());
    trouble.forks_good = good;
    CHECK(!rig_start(r, STALL_S));
    CHECK(atomic_load(&r->guard.error) == EAGAIN && r->guard.channel < 0);
    CHECK(descriptors_of(getpid()) == before);
    trouble_over();
    trouble.wait_interrupts = 2;
    CHECK(rig_start(r, STALL_S) && atomic_load(&r->guard.error) == 0);
  }
  rig *r = rig_new();
  trouble.wait_killed = true;
  CHECK(!rig_start(r, STALL_S) && atomic_load(&r->guard.error) == ECANCELED);
  trouble_over();
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 300) >= ROUNDS_LEAST); /* nobody wants it */
  CHECK(guard_ends(guard_await(r)));
}

TEST(without_memory_there_is_no_guard)
{
  hapi_spidar_guard guard;
  trouble.no_memory = true;
  CHECK(!hapi_spidar_guard_init(&guard) && guard.pulse == NULL && guard.channel < 0);
  trouble_over();
  hapi_spidar_guard_finish(&guard); /* nothing */
}

/* Older kernels have neither close_range nor a descriptor of a process. */
TEST(an_old_kernel_has_a_guard_too)
{
  int many[5];
  rig *r = rig_new();
  for (int i = 0; i < 5; ++i) {
    many[i] = open("/dev/null", O_RDONLY);
  }
  trouble.old_kernel = true;
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await(r);
  int told = isatty(STDERR_FILENO) ? 1 : 0;
  CHECK(descriptors_await(guard, 2 + told) == 2 + told); /* port and channel */
  for (int i = 0; i < 5; ++i) {
    close(many[i]);
  }
  trouble.poll_interrupts = 2; /* a signal while it is waited for */
  hapi_spidar_guard_end(&r->guard, true);
  CHECK(guard_ends(guard) && is_quiet(r, 0));
}

TEST(a_guard_that_has_gone_is_noticed)
{
  rig *r = rig_new();
  CHECK(!hapi_spidar_guard_is_lost(&r->guard)); /* there was none */
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await(r);
  CHECK(!hapi_spidar_guard_is_lost(&r->guard));
  REQUIRE(guard > 0 && kill(guard, SIGKILL) == 0 && guard_ends(guard));
  CHECK(hapi_spidar_guard_is_lost(&r->guard));
  hapi_spidar_guard_end(&r->guard, true); /* and is not waited for */
}

/* ---- a port that comes back ---- */

typedef struct terminal {
  int board;
  char name[64];
} terminal;

static void terminal_end(void *self)
{
  close(((terminal *)self)->board);
}

static terminal *terminal_new(void)
{
  terminal *t = tap_own(sizeof *t, terminal_end);
  t->board = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(t->board >= 0 && grantpt(t->board) == 0 && unlockpt(t->board) == 0);
  REQUIRE(ptsname_r(t->board, t->name, sizeof t->name) == 0);
  return t;
}

/* Its guard runs, and the port is gone. */
static rig *rig_lost(const char *path, const hapi_spidar_identity *identity, int boards)
{
  rig *r = rig_new();
  r->boards = (hapi_spidar_boards){.count = boards, .id = {0}, .model = {5}};
  REQUIRE(rig_start_as(r, path, identity, STALL_S));
  REQUIRE(guard_await(r) > 0);
  close(r->board);
  r->board = open("/dev/null", O_RDWR | O_CLOEXEC);
  return r;
}

static bool rescue_await(const rig *r)
{
  for (int ms = 0; ms < PATIENCE_MS && !atomic_load(&r->guard.pulse->rescued); ms += 5) {
    hapi_clock_sleep_until(hapi_clock_now() + 5000000);
  }
  return atomic_load(&r->guard.pulse->rescued);
}

/* By its name, when others have let go of it. What the guard did it says on the terminal. */
TEST(a_port_that_comes_back_is_zeroed_and_that_is_said)
{
  char said[200] = "";
  const char *path = folder_path("port");
  terminal *own = terminal_new();
  terminal *t = terminal_new();
  int before = dup(STDERR_FILENO);
  int errors = open(own->name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(before >= 0 && errors >= 0 && dup2(errors, STDERR_FILENO) >= 0);
  rig *r = rig_lost(path, &unknown, 0);
  dup2(before, STDERR_FILENO);
  close(before);
  close(errors);
  hapi_clock_sleep_until(hapi_clock_now() + 100000000); /* it looks for the port */
  int holder = open(t->name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  REQUIRE(holder >= 0 && flock(holder, LOCK_EX | LOCK_NB) == 0);
  REQUIRE(symlink(t->name, path) == 0);
  hapi_clock_sleep_until(hapi_clock_now() + 100000000);
  CHECK(!atomic_load(&r->guard.pulse->rescued)); /* who has it knows what it is for */
  close(holder);
  CHECK(rescue_await(r));
  CHECK(rounds_read(t->board, r->zeros, PATIENCE_MS, 100) >= ROUNDS_LEAST);
  struct pollfd ready = {own->board, POLLIN, 0};
  CHECK(poll(&ready, 1, PATIENCE_MS) == 1 && read(own->board, said, sizeof said - 1) > 0);
  CHECK_SAY(strstr(said, "spidar-guard: ") == said && strstr(said, path) != NULL &&
                strstr(said, "came back") != NULL,
            "%s", said);
  CHECK(atomic_load(&looks->logged) == 1);
  REQUIRE(unlink(path) == 0);
}

/* Reads until the guard has asked for the board of id 0. */
static bool question_await(int board)
{
  struct pollfd ready = {board, POLLIN, 0};
  uint8_t byte = 0;
  while (byte != hapi_spidar_header(HAPI_SPIDAR_BOARD_INFO, 0)) {
    if (poll(&ready, 1, PATIENCE_MS) <= 0 || read(board, &byte, 1) != 1) {
      return false;
    }
  }
  return true;
}

/* Boards that do not answer are asked again. Others get nothing. */
TEST(a_port_whose_boards_are_silent_is_asked_again)
{
  static const uint8_t other[7] = {1 << 3, 7, 12, 8, 0, 4, 0}; /* B5M */
  const char *path = folder_path("silent");
  terminal *t = terminal_new();
  int kept = open(t->name, O_RDWR | O_NOCTTY | O_CLOEXEC); /* else its end is a hang-up */
  REQUIRE(kept >= 0);
  rig *r = rig_lost(path, &unknown, 1);
  atomic_store(&looks->logged, 0);
  REQUIRE(symlink(t->name, path) == 0);
  for (int i = 0; i < 6; ++i) { /* it tries three times each */
    CHECK(question_await(t->board));
    CHECK(atomic_load(&looks->logged) == 0);
  }
  while (atomic_load(&looks->logged) == 0 && question_await(t->board)) {
    CHECK(write(t->board, other, sizeof other) == (ssize_t)sizeof other);
    hapi_clock_sleep_until(hapi_clock_now() + 200000000);
  }
  CHECK(atomic_load(&looks->logged) == 1 && !atomic_load(&r->guard.pulse->rescued));
  close(kept);
  REQUIRE(unlink(path) == 0);
}

/* A USB adapter is known by what sysfs says: zeroed at once, under whatever name. */
TEST(an_adapter_that_is_in_again_is_zeroed_without_a_question)
{
  static const hapi_spidar_identity adapter = {
      .usb = true, .product = "0403:6001", .serial = "A1", .place = "1-2", .interface = ""};
  static const char *const files[][2] = {{"idVendor", "0403\n"},
                                         {"idProduct", "6001\n"},
                                         {"serial", "A1\n"},
                                         {"busnum", "1\n"},
                                         {"devpath", "2\n"}};
  static const char *const folders[] = {"sys", "sys/class", "sys/class/tty",
                                        "sys/class/tty/ttyUSB0", "sys/class/tty/ttyUSB0/device"};
  char path[200];
  terminal *t = terminal_new();
  snprintf(trouble.sysfs, sizeof trouble.sysfs, "%s", folder_path("sys"));
  snprintf(trouble.adapter, sizeof trouble.adapter, "%s", t->name);
  trouble.no_sockets = true; /* nor a log */
  rig *r = rig_lost("/no/such/port", &adapter, 0);
  hapi_clock_sleep_until(hapi_clock_now() + 100000000);
  CHECK(!atomic_load(&r->guard.pulse->rescued));
  for (size_t i = 0; i < sizeof folders / sizeof folders[0]; ++i) {
    REQUIRE(mkdir(folder_path(folders[i]), 0700) == 0);
  }
  /* The vendor last: it is what an adapter is known by. */
  for (size_t i = sizeof files / sizeof files[0]; i-- > 0;) {
    snprintf(path, sizeof path, "sys/class/tty/ttyUSB0/device/%s", files[i][0]);
    file_write(folder_path(path), files[i][1]);
  }
  CHECK(rescue_await(r));
  CHECK(rounds_read(t->board, r->zeros, PATIENCE_MS, 100) >= ROUNDS_LEAST);
}

/* Ten minutes after its program, in looks of 20 ms, and no longer. */
TEST(a_guard_that_is_alone_waits_for_ten_minutes)
{
  rig *r = rig_lost("/no/such/port", &unknown, 0);
  pid_t guard = guard_await(r);
  kill(guard, SIGKILL);
  REQUIRE(guard_ends(guard));
  trouble.hurries = true;
  atomic_store(&looks->longest_ms, 0);
  r = rig_lost("/no/such/port", &unknown, 0);
  guard = guard_await(r);
  atomic_store(&looks->count, 0);
  hapi_spidar_guard_end(&r->guard, false);
  CHECK(guard_ends(guard));
  CHECK(atomic_load(&looks->longest_ms) == 20);
  CHECK_NEAR(atomic_load(&looks->count), 600.0 / 0.02, 100.0);
}

/* While it is stuck, a loop is zeroed once more each time it begins to stand still. */
TEST(the_pause_between_zeros_lets_a_command_end)
{
  rig *r = rig_new();
  atomic_store(&looks->pauses, 0);
  REQUIRE(rig_start(r, STALL_S));
  atomic_store(&r->guard.pulse->pulling, true);
  CHECK(rounds_read(r->board, r->zeros, PATIENCE_MS, 300) == HAPI_SAFETY_GUARD_ROUNDS);
  CHECK(atomic_load(&looks->pauses) == HAPI_SAFETY_GUARD_ROUNDS);
  /* A command of 100 bytes takes 0.5 ms; the force must be off 50 ms after the end. */
  CHECK(atomic_load(&looks->shortest_ns) >= 1000000 &&
        atomic_load(&looks->shortest_ns) <= 10000000);
}

/* A port that takes nothing any more is let go: its own name comes back only then. */
TEST(a_port_that_fails_at_a_stall_is_let_go)
{
  rig *r = rig_new();
  REQUIRE(rig_start(r, STALL_S));
  pid_t guard = guard_await(r);
  int told = isatty(STDERR_FILENO) ? 1 : 0;
  int kept = descriptors_await(guard, 3 + told);
  REQUIRE(shutdown(r->port, SHUT_WR) == 0); /* of both processes */
  atomic_store(&r->guard.pulse->pulling, true);
  CHECK(descriptors_await(guard, kept - 1) == kept - 1);
  CHECK(atomic_load(&r->guard.pulse->stalled) && !atomic_load(&r->guard.pulse->rescued));
}

SET_UP
{
  looks = mmap(NULL, sizeof *looks, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (looks == MAP_FAILED || !folder_make()) {
    return tap_bail_out("no memory that processes share, or no folder");
  }
  return prctl(PR_SET_CHILD_SUBREAPER, 1) == 0 || tap_skip_all("orphans cannot be reaped here");
}
