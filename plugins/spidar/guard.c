/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/guard.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/safety.h"
#include "plugins/spidar/serial.h"

#define LOOK_MS ((int)(1e3 * HAPI_SAFETY_GUARD_LOOK_S + 0.5))
#define ROUND_NS 3000000
#define END_MS 1000
#define WAIT_LOOKS (1e3 * HAPI_SAFETY_GUARD_WAIT_S / LOOK_MS) /* for a port, alone */
#define ASK_LOOKS (500 / LOOK_MS) /* between two questions to boards that do not answer */
#define KEPT 4                    /* descriptors */

enum {
  WORD_END = 'e',  /* the port was zeroed */
  WORD_LEFT = 'l', /* the port is lost, and nobody else will zero it */
};

bool hapi_spidar_guard_init(hapi_spidar_guard *guard)
{
  void *memory =
      mmap(NULL, sizeof *guard->pulse, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  guard->channel = -1;
  guard->pulse = memory != MAP_FAILED ? memory : NULL;
  return guard->pulse != NULL;
}

void hapi_spidar_guard_finish(hapi_spidar_guard *guard)
{
  if (guard->pulse != NULL) {
    hapi_spidar_guard_end(guard, true);
    munmap(guard->pulse, sizeof *guard->pulse);
    guard->pulse = NULL;
  }
}

/* ---- in the guard: nothing but what a signal handler may call, for other threads of the process
 * that was forked may have held any lock ---- */

typedef struct watch {
  hapi_spidar_guard_def def;
  int port; /* < 0: it went away */
  int channel;
  int parent;   /* pidfd; < 0: the kernel has none, the channel must do */
  int terminal; /* < 0: none */
  int stall_looks;
  bool rescued; /* the port that came back was zeroed, or is another one */
  int pause;    /* looks until boards are asked again */
  hapi_spidar_pulse *pulse;
} watch;

/* To the terminal, if there is one, and to the system's log: the program may have ended. */
static void guard_say(const watch *w, const char *text)
{
  static const char begin[] = "<28>spidar-guard: "; /* a warning of a daemon */
  char line[400];
  size_t used = 0;
  const char *const parts[] = {begin, w->def.path, ": ", text};
  for (size_t i = 0; i < sizeof parts / sizeof parts[0]; ++i) {
    size_t length = strlen(parts[i]);
    length = length < sizeof line - 1 - used ? length : sizeof line - 1 - used;
    memcpy(line + used, parts[i], length);
    used += length;
  }
  struct sockaddr_un log = {.sun_family = AF_UNIX, .sun_path = "/dev/log"};
  int to = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (to >= 0) {
    (void)sendto(to, line, used, MSG_NOSIGNAL, (const struct sockaddr *)&log, sizeof log);
    close(to);
  }
  line[used++] = '\n';
  if (w->terminal >= 0) {
    (void)!write(w->terminal, line + 4, used - 4);
  }
}

/* False: the port takes nothing any more. */
static bool send_zeros(const watch *w, int port)
{
  static const uint8_t flush[HAPI_SPIDAR_FRAME_MAX]; /* ends a command that went out in part */
  const struct timespec pause = {0, ROUND_NS};
  bool sent = false;
  for (int i = 0; i < HAPI_SAFETY_GUARD_ROUNDS; ++i) {
    struct pollfd room = {port, POLLOUT, 0};
    (void)poll(&room, 1, LOOK_MS);
    if (i == 0) {
      (void)!write(port, flush, sizeof flush);
    }
    sent = write(port, w->def.zeros, (size_t)w->def.zero_count) == w->def.zero_count || sent;
    (void)nanosleep(&pause, NULL);
  }
  return sent;
}

/* close_range(2) of the kernels that have it, for two calls and not one for each that may be
 * open. */
static void close_between(unsigned first, unsigned last)
{
  if (first > last || syscall(SYS_close_range, first, last, 0) == 0) {
    return;
  }
  long most = sysconf(_SC_OPEN_MAX);
  unsigned end = most > 0 && most < 65536 ? (unsigned)most : 65536;
  for (unsigned fd = first; fd <= last && fd < end; ++fd) {
    close((int)fd);
  }
}

static void close_others(const watch *w)
{
  const int keep[KEPT] = {w->port, w->channel, w->parent, w->terminal};
  unsigned from = 0;
  for (int i = 0; i < KEPT; ++i) { /* in their order */
    int next = -1;
    for (int k = 0; k < KEPT; ++k) {
      bool ahead = keep[k] >= (int)from;
      next = ahead && (next < 0 || keep[k] < next) ? keep[k] : next;
    }
    if (next >= 0) {
      if ((unsigned)next > from) {
        close_between(from, (unsigned)next - 1);
      }
      from = (unsigned)next + 1;
    }
  }
  close_between(from, ~0u);
}

static void file_drop(int *file)
{
  if (*file >= 0) {
    close(*file);
    *file = -1;
  }
}

/* A port that goes away may come back under another name, and its own name only when nobody holds
 * it: so it is let go. */
static void port_lose(watch *w)
{
  file_drop(&w->port);
}

/* The kernel gives the name of a pseudo-terminal to the next one, which may be a person's shell. */
static bool port_can_return(const watch *w)
{
  static const char pseudo[] = "/dev/pts/";
  return w->def.identity->usb || strncmp(w->def.path, pseudo, sizeof pseudo - 1) != 0;
}

/* Zero for a port that is there again. An adapter that is known by sysfs is zeroed at once. Else
 * the name alone is known, which may be another machine's: its boards are asked first. */
static void port_rescue(watch *w)
{
  char path[HAPI_SPIDAR_PATH_MAX];
  const char *at = w->def.path;
  hapi_spidar_serial serial = {.fd = -1};
  hapi_spidar_port port;
  if (w->def.identity->usb) {
    at = hapi_spidar_identity_find(HAPI_SPIDAR_SYSFS, w->def.identity, path, sizeof path) ? path
                                                                                          : NULL;
  }
  if (at == NULL || w->pause-- > 0) {
    return;
  }
  int attached = hapi_spidar_serial_attach(&serial, at);
  if (attached < 0) {
    w->pause = attached == -EWOULDBLOCK ? ASK_LOOKS : 0; /* who has it knows what it is for */
    return;
  }
  hapi_spidar_serial_port(&serial, &port);
  int same = w->def.identity->usb ? 1 : hapi_spidar_line_compare(&port, w->def.boards);
  w->pause = w->def.identity->usb ? 0 : ASK_LOOKS;
  if (same == 1 && send_zeros(w, serial.fd)) {
    w->rescued = true;
    atomic_store(&w->pulse->rescued, true);
    guard_say(w, "the port came back: the force was taken off");
  } else if (same == 0) {
    w->rescued = true;
    guard_say(w, "other boards answer on this port: nothing was sent to their motors");
  }
  close(serial.fd);
}

/* Looks at the beats; *looks counts how often they stood still. */
static void look_at_pulse(watch *w, unsigned *beats, int *looks)
{
  unsigned now = atomic_load(&w->pulse->beats);
  bool still = now == *beats && atomic_load(&w->pulse->pulling);
  *looks = still ? *looks + 1 : 0;
  *beats = now;
  if (*looks == w->stall_looks) {
    atomic_store(&w->pulse->stalled, true); /* first: a loop that wakes up now must not go on */
    if (!send_zeros(w, w->port)) {
      port_lose(w);
    }
  }
}

/* What came from the process that drives the device, and whether it still does. */
static int channel_read(watch *w, short channel, short parent)
{
  char word = 0;
  ssize_t said = channel != 0 ? read(w->channel, &word, 1) : -1;
  return said > 0 ? word : said == 0 || parent != 0 ? WORD_LEFT : 0;
}

static void guard_main(watch *w)
{
  sigset_t all;
  unsigned beats = 0;
  int looks = 0;
  int waits = 0; /* looks since it has been alone; 0: it is not */
  sigfillset(&all);
  sigprocmask(SIG_SETMASK, &all, NULL); /* of a terminal, meant for the program */
  (void)setsid();
  (void)prctl(PR_SET_NAME, "spidar-guard");
  atomic_store(&w->pulse->guard, (int)getpid());
  close_others(w);
  for (;;) {
    struct pollfd files[3] = {{w->channel, POLLIN, 0}, {w->parent, POLLIN, 0}, {w->port, 0, 0}};
    (void)poll(files, 3, LOOK_MS);
    int word = channel_read(w, files[0].revents, files[1].revents);
    if (word == WORD_END) {
      return; /* the port was zeroed and is let go */
    }
    if (word == WORD_LEFT) { /* by a process that has gone, or that leaves the port to the guard */
      waits = 1;
      file_drop(&w->channel);
      file_drop(&w->parent);
      if (w->port >= 0 && send_zeros(w, w->port)) {
        return;
      }
      port_lose(w);
    }
    if (w->port >= 0 && files[2].revents != 0) {
      port_lose(w);
    }
    if (w->port >= 0) {
      look_at_pulse(w, &beats, &looks);
    } else if (!w->rescued && port_can_return(w)) {
      port_rescue(w);
    }
    waits += waits > 0;
    if (waits > 0 && (w->rescued || !port_can_return(w) || waits > WAIT_LOOKS)) {
      return;
    }
  }
}

/* ---- in the process that drives the device ---- */

/* Not a child of the process, which may wait for children of its own: a child's child. */
static int fork_guard(watch *w)
{
  pid_t child = fork();
  if (child == 0) {
    pid_t guard = fork();
    if (guard == 0) {
      guard_main(w);
    }
    _exit(guard < 0 ? errno & 0xff : 0);
  }
  if (child < 0) {
    return errno;
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : ECANCELED;
}

static int guard_open(hapi_spidar_guard *guard, const hapi_spidar_guard_def *def)
{
  int ends[2];
  hapi_spidar_guard_end(guard, true);
  atomic_store(&guard->pulse->pulling, false);
  atomic_store(&guard->pulse->stalled, false);
  atomic_store(&guard->pulse->rescued, false);
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return errno;
  }
  int self = (int)syscall(SYS_pidfd_open, getpid(), 0);
  watch w = {.def = *def,
             .port = def->port,
             .channel = ends[1],
             .parent = self,
             .terminal = isatty(STDERR_FILENO) ? STDERR_FILENO : -1,
             .stall_looks = (int)(def->stall_s * 1000.0 / LOOK_MS) + 1,
             .pulse = guard->pulse};
  int error = fork_guard(&w);
  close(ends[1]);
  if (self >= 0) {
    close(self);
  }
  if (error != 0) {
    close(ends[0]);
    return error;
  }
  guard->channel = ends[0];
  return 0;
}

bool hapi_spidar_guard_start(hapi_spidar_guard *guard, const hapi_spidar_guard_def *def)
{
  int error = guard_open(guard, def);
  atomic_store(&guard->error, error);
  return error == 0;
}

bool hapi_spidar_guard_is_lost(const hapi_spidar_guard *guard)
{
  char word;
  return guard->channel >= 0 && recv(guard->channel, &word, 1, MSG_DONTWAIT) == 0;
}

void hapi_spidar_guard_end(hapi_spidar_guard *guard, bool zeroed)
{
  const char word = zeroed ? WORD_END : WORD_LEFT;
  if (guard->channel < 0) {
    return;
  }
  struct pollfd gone = {guard->channel, POLLIN, 0};
  if (send(guard->channel, &word, 1, MSG_NOSIGNAL) == 1 && zeroed) {
    while (poll(&gone, 1, END_MS) < 0 && errno == EINTR) {
    }
  }
  close(guard->channel);
  guard->channel = -1;
}
