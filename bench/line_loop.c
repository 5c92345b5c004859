/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/line_loop.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/thread.h"

#define WARM_TICKS 200
#define BYTES_MAX 256

/* ---- the loop ---- */

typedef struct job {
  line_tick tick;
  void *self;
  uint64_t ticks;
  line_figures *figures;
} job;

static void count_tick(const job *j, bool counts)
{
  line_figures *f = j->figures;
  int64_t begin_ns = hapi_clock_now();
  line_answer answer = j->tick(j->self);
  if (counts) {
    hapi_histogram_add(&f->tick_ns, hapi_clock_now() - begin_ns);
    f->failed += answer == LINE_FAILED;
    f->late += answer != LINE_ANSWERED;
    ++f->ticks;
  }
}

static void *run_loop(void *argument)
{
  const job *j = argument;
  hapi_thread_prepare_for_ticks();
  int64_t start_ns = hapi_clock_now();
  for (uint64_t i = 1; i <= j->ticks + WARM_TICKS; ++i) {
    int64_t due_ns = start_ns + hapi_clock_deadline(i, LINE_HZ);
    hapi_clock_sleep_until(due_ns);
    int64_t late_ns = hapi_clock_now() - due_ns;
    if (late_ns > (int64_t)(1e9 / LINE_HZ)) { /* not made up for in a burst */
      start_ns += late_ns;
      j->figures->missed += i > WARM_TICKS;
    }
    count_tick(j, i > WARM_TICKS);
  }
  return NULL;
}

hap_status line_loop_run(line_tick tick, void *self, uint64_t ticks, line_figures *io)
{
  job j = {tick, self, ticks, io};
  hapi_thread thread;
  hap_status status = hapi_thread_start(&thread, run_loop, &j, "bench-line", LINE_PRIORITY);
  if (status >= HAP_OK) {
    hapi_thread_join(&thread);
    io->realtime = atomic_load(&thread.realtime);
  }
  return status;
}

/* ---- the floor ---- */

/* In a process of its own, as an emulator is; it ends when the other end is closed. */
static void echo(int master, const line_floor_def *def)
{
  const struct sched_param parameters = {.sched_priority = LINE_ECHO_PRIORITY};
  const uint8_t reply[BYTES_MAX] = {0};
  uint8_t bytes[BYTES_MAX];
  struct pollfd file = {master, POLLIN, 0};
  (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
  (void)sched_setscheduler(0, SCHED_FIFO, &parameters);
  for (int have = 0;;) {
    (void)poll(&file, 1, -1);
    ssize_t count = read(master, bytes, sizeof bytes);
    if (count <= 0) {
      return;
    }
    for (have += (int)count; have >= def->command; have -= def->command) {
      hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * def->wait));
      (void)!write(master, reply, (size_t)def->reply);
    }
  }
}

static int open_raw(int master)
{
  char name[64];
  struct termios raw;
  if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0 ||
      ptsname_r(master, name, sizeof name) != 0) {
    return -1;
  }
  int port = open(name, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (port >= 0 && tcgetattr(port, &raw) == 0) {
    cfmakeraw(&raw);
    (void)tcsetattr(port, TCSANOW, &raw);
  }
  return port;
}

hap_status line_floor_start(bench *b, const line_floor_def *def, line_floor *out)
{
  int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  *out = (line_floor){.def = *def, .port = open_raw(master), .echo = -1};
  out->echo = out->port >= 0 ? fork() : -1;
  if (out->echo == 0) {
    close(out->port);
    echo(master, def);
    _exit(0);
  }
  if (master >= 0) {
    close(master);
  }
  return out->echo > 0 ? HAP_OK
                       : bench_fail(b, HAP_ERROR_SYSTEM, "line: no pseudo-terminal, or no process");
}

void line_floor_stop(line_floor *f)
{
  if (f->port >= 0) {
    close(f->port);
  }
  if (f->echo > 0) {
    (void)kill(f->echo, SIGKILL);
    (void)waitpid(f->echo, NULL, 0);
  }
}

line_answer line_floor_tick(void *self)
{
  const line_floor *f = self;
  uint8_t bytes[4 * BYTES_MAX] = {0};
  ssize_t count = read(f->port, bytes, sizeof bytes);
  bool sent = write(f->port, bytes, (size_t)f->def.command) == f->def.command;
  if (!sent) {
    return LINE_FAILED;
  }
  return count >= f->def.reply ? LINE_ANSWERED : LINE_LATE;
}
