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
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define LOOK_MS 20
#define ROUNDS 4 /* of zeros: a byte of one may be lost */
#define ROUND_NS 3000000
#define END_MS 1000

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
    hapi_spidar_guard_end(guard);
    munmap(guard->pulse, sizeof *guard->pulse);
    guard->pulse = NULL;
  }
}

/* ---- in the guard: nothing but what a signal handler may call, for other threads of the process
 * that was forked may have held any lock ---- */

typedef struct watch {
  int port;
  int channel;
  int parent; /* pidfd; < 0: the kernel has none, the channel must do */
  const uint8_t *zeros;
  int count;
  int stall_looks;
  hapi_spidar_pulse *pulse;
} watch;

static void send_zeros(const watch *w)
{
  static const uint8_t flush[HAPI_SPIDAR_FRAME_MAX]; /* ends a command that went out in part */
  const struct timespec pause = {0, ROUND_NS};
  for (int i = 0; i < ROUNDS; ++i) {
    struct pollfd room = {w->port, POLLOUT, 0};
    (void)poll(&room, 1, LOOK_MS);
    if (i == 0) {
      (void)!write(w->port, flush, sizeof flush);
    }
    (void)!write(w->port, w->zeros, (size_t)w->count);
    (void)nanosleep(&pause, NULL);
  }
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
  int keep[3] = {w->port, w->channel, w->parent};
  unsigned from = 0;
  for (int i = 0; i < 3; ++i) { /* in their order */
    int next = -1;
    for (int k = 0; k < 3; ++k) {
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

/* Looks at the beats; *looks counts how often they stood still. */
static void look_at_pulse(const watch *w, unsigned *beats, int *looks)
{
  unsigned now = atomic_load(&w->pulse->beats);
  bool still = now == *beats && atomic_load(&w->pulse->pulling);
  *looks = still ? *looks + 1 : 0;
  *beats = now;
  if (*looks == w->stall_looks) {
    atomic_store(&w->pulse->stalled, true); /* first: a loop that wakes up now must not go on */
    send_zeros(w);
  }
}

static void guard_main(const watch *w)
{
  sigset_t all;
  unsigned beats = 0;
  int looks = 0;
  sigfillset(&all);
  sigprocmask(SIG_SETMASK, &all, NULL); /* of a terminal, meant for the program */
  (void)setsid();
  (void)prctl(PR_SET_NAME, "spidar-guard");
  close_others(w);
  for (;;) {
    struct pollfd files[2] = {{w->channel, POLLIN, 0}, {w->parent, POLLIN, 0}};
    (void)poll(files, 2, LOOK_MS);
    char word = 0;
    ssize_t said = files[0].revents != 0 ? read(w->channel, &word, 1) : -1;
    if (said > 0) {
      return; /* the port was zeroed and is let go */
    }
    if (said == 0 || files[1].revents != 0) {
      send_zeros(w);
      return;
    }
    look_at_pulse(w, &beats, &looks);
  }
}

/* ---- in the process that drives the device ---- */

/* Not a child of the process, which may wait for children of its own: a child's child. */
static bool fork_guard(const watch *w)
{
  pid_t child = fork();
  if (child == 0) {
    if (fork() == 0) {
      guard_main(w);
    }
    _exit(0);
  }
  if (child < 0) {
    return false;
  }
  while (waitpid(child, NULL, 0) < 0 && errno == EINTR) {
  }
  return true;
}

bool hapi_spidar_guard_start(hapi_spidar_guard *guard, int port, const uint8_t *zeros, int count,
                             double stall_s)
{
  int ends[2];
  hapi_spidar_guard_end(guard);
  atomic_store(&guard->pulse->pulling, false);
  atomic_store(&guard->pulse->stalled, false);
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return false;
  }
  int self = (int)syscall(SYS_pidfd_open, getpid(), 0);
  const watch w = {.port = port,
                   .channel = ends[1],
                   .parent = self,
                   .zeros = zeros,
                   .count = count,
                   .stall_looks = (int)(stall_s * 1000.0 / LOOK_MS) + 1,
                   .pulse = guard->pulse};
  bool good = fork_guard(&w);
  close(ends[1]);
  if (self >= 0) {
    close(self);
  }
  if (!good) {
    close(ends[0]);
    return false;
  }
  guard->channel = ends[0];
  return true;
}

void hapi_spidar_guard_end(hapi_spidar_guard *guard)
{
  char word = 'e';
  if (guard->channel < 0) {
    return;
  }
  struct pollfd gone = {guard->channel, POLLIN, 0};
  if (send(guard->channel, &word, 1, MSG_NOSIGNAL) == 1) {
    while (poll(&gone, 1, END_MS) < 0 && errno == EINTR) {
    }
  }
  close(guard->channel);
  guard->channel = -1;
}
