/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/histogram.h"
#include "base/thread.h"
#include "bench/bench.h"
#include "bench/child.h"
#include "device/device.h"
#include "device/one_effector.h"
#include "plugins/spidar/spidar.h"

/* A loop of 1 kHz that asks something at each tick and wants the answer by the next one; and the
 * least that can be asked: a few bytes through a pseudo-terminal to a process that gives some
 * back. */

#define LINE_HZ 1000.0
#define LINE_PRIORITY 70      /* of the loop, SCHED_FIFO */
#define LINE_ECHO_PRIORITY 60 /* of what answers */

typedef struct line_figures {
  uint64_t ticks;
  uint64_t late;   /* no new answer since the tick before */
  uint64_t missed; /* woken up more than a period late */
  uint64_t failed;
  hapi_histogram tick_ns; /* taking and asking */
  bool realtime;
} line_figures;

typedef enum line_answer {
  LINE_FAILED,
  LINE_LATE,
  LINE_ANSWERED
} line_answer;

/* Takes what has come since the call before and asks anew, without waiting. */
typedef line_answer (*line_tick)(void *self);

/* ---- the floor: the same wake-ups without a device and an emulator ---- */

typedef struct line_floor_def {
  int command; /* bytes that are sent each tick */
  int reply;   /* bytes that come back */
  double wait; /* s, between the two */
} line_floor_def;

typedef struct line_floor {
  line_floor_def def;
  int port;
  pid_t echo;
} line_floor;

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

/* So many ticks, after some that do not count, in a thread of its own; the figures are added to
 * *io. */
static hap_status line_loop_run(line_tick tick, void *self, uint64_t ticks, line_figures *io)
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
static void echo_bytes(int master, const line_floor_def *def)
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

static hap_status line_floor_start(bench *b, const line_floor_def *def, line_floor *out)
{
  int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  *out = (line_floor){.def = *def, .port = open_raw(master), .echo = -1};
  out->echo = out->port >= 0 ? fork() : -1;
  if (out->echo == 0) {
    close(out->port);
    echo_bytes(master, def);
    _exit(0);
  }
  if (master >= 0) {
    close(master);
  }
  return out->echo > 0 ? HAP_OK
                       : bench_fail(b, HAP_ERROR_SYSTEM, "line: no pseudo-terminal, or no process");
}

static void line_floor_stop(line_floor *f)
{
  if (f->port >= 0) {
    close(f->port);
  }
  if (f->echo > 0) {
    (void)kill(f->echo, SIGKILL);
    (void)waitpid(f->echo, NULL, 0);
  }
}

static line_answer line_floor_tick(void *self)
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

/* A SPIDAR at 1 kHz through the emulator, both in real time: how many ticks found no new answer
 * of all boards, and what read and write cost. Positions come over a pseudo-terminal, so what is
 * measured is the code and the scheduler, not a USB adapter; and in turns with it, how many are
 * late where there is nothing but the scheduler. */

#define LATE_MOST 0.005 /* share of the ticks */
#define PULLED_MS_MOST 5.0
#define FLOOR_MOST 0.001 /* of a machine that is idle */
#define SEGMENTS 12      /* of each, in turns */
#define SEGMENT_TICKS 5000
#define SEGMENTS_QUICK 2
#define SEGMENT_TICKS_QUICK 1000

typedef struct setup {
  const char *model;
  const char *boards;   /* for people */
  line_floor_def floor; /* the same bytes; their time from the first command to the last reply */
  bench_child emulator;
  char spec[128];
  double pulled_ms;
} setup;

/* ---- the emulator ---- */

static bool start_emulator(setup *s)
{
  const char *const words[] = {"--model", s->model, "--hand", "hold", "--fifo", "60", NULL};
  char line[100] = "";
  bool good = bench_child_start("spidar-emulator", words, &s->emulator) &&
              fgets(line, sizeof line, s->emulator.said) != NULL && strncmp(line, "port: ", 6) == 0;
  line[strcspn(line, "\n")] = '\0';
  (void)snprintf(s->spec, sizeof s->spec, "spidar:%.80s,timeout=5,stall=5", line + 6);
  return good;
}

/* ---- what is measured ---- */

typedef struct subject {
  const hap_device_ops *ops;
  hapi_spidar_device *self;
} subject;

static line_answer device_tick(void *self)
{
  const subject *s = self;
  const hap_wrench wanted = {{0.2, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_pose pose;
  hap_twist twist;
  hap_wrench reached;
  uint32_t buttons;
  double before = s->self->line.taken;
  bool good = hapi_one_read(s->ops, s->self, hapi_clock_now(), &pose, &twist, &buttons) >= HAP_OK &&
              hapi_one_write(s->ops, s->self, &wanted, &reached) >= HAP_OK;
  if (!good) {
    return LINE_FAILED;
  }
  return s->self->line.taken != before ? LINE_ANSWERED : LINE_LATE;
}

/* In turns, so that what the machine does to one it does to the other. */
static hap_status measure_turns(const bench *b, subject *s, line_floor *lowest, line_figures out[2])
{
  int segments = b->quick ? SEGMENTS_QUICK : SEGMENTS;
  uint64_t ticks = b->quick ? SEGMENT_TICKS_QUICK : SEGMENT_TICKS;
  hap_status status = HAP_OK;
  for (int i = 0; i < segments && status >= HAP_OK; ++i) {
    status = line_loop_run(device_tick, s, ticks, &out[0]);
    s->ops->zero(s->self);
    if (status >= HAP_OK) {
      status = line_loop_run(line_floor_tick, lowest, ticks, &out[1]);
    }
  }
  return status;
}

/* ms, from when the emulator is told to pull the cable out until a tick fails and says so; < 0:
 * none does. */
static double pull_cable(const setup *s, subject *measured)
{
  static const char word[] = "unplug\n";
  int64_t begin_ns = hapi_clock_now();
  if (write(s->emulator.input, word, sizeof word - 1) != (ssize_t)sizeof word - 1) {
    return -1.0;
  }
  for (int i = 0; i < 1000; ++i) {
    if (device_tick(measured) == LINE_FAILED) {
      int64_t passed_ns = hapi_clock_now() - begin_ns;
      hap_detail why = {""};
      hapi_device_explain(measured->ops, measured->self, &why);
      return strstr(why.text, "cable") != NULL ? 1e-6 * (double)passed_ns : -1.0;
    }
    hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 / LINE_HZ));
  }
  return -1.0;
}

static hap_status measure_with(bench *b, setup *s, line_floor *lowest, line_figures out[2])
{
  hap_device *device = NULL;
  hap_status status = hap_device_open(s->spec, &device, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  subject measured = {hapi_device_ops(device), hapi_device_self(device)};
  status = measured.ops->start(measured.self);
  if (status >= HAP_OK) {
    status = measure_turns(b, &measured, lowest, out);
    s->pulled_ms = pull_cable(s, &measured);
  } else {
    status = bench_fail(b, status, "line: the device did not start");
  }
  measured.ops->stop(measured.self);
  hap_device_close(device);
  return status;
}

static hap_status setup_measure(bench *b, setup *s, line_figures out[2])
{
  line_floor lowest;
  hap_status status = line_floor_start(b, &s->floor, &lowest);
  if (status >= HAP_OK) {
    status = start_emulator(s) ? measure_with(b, s, &lowest, out)
                               : bench_fail(b, HAP_ERROR_SYSTEM, "line: no spidar-emulator");
    (void)bench_child_finish(&s->emulator, SIGTERM);
  }
  line_floor_stop(&lowest);
  return status;
}

/* ---- what it tells ---- */

static double late_share(const line_figures *f)
{
  return (double)f->late / (double)f->ticks;
}

/* More than it may be is the code's doing only where the machine itself is hardly ever late: the
 * chain of the floor is a part of that of the device, so what is left over is no measure of the
 * code alone. */
static void late_judge(bench *b, const setup *s, const line_figures figures[2])
{
  double share = late_share(&figures[0]);
  double lowest = late_share(&figures[1]);
  bool idle = lowest <= FLOOR_MOST;
  const char *text =
      "line: %s: %.3f %% of the ticks without a new answer; %.3f %% by the machine alone%s";
  if (figures[0].realtime && !b->quick && (idle || share <= LATE_MOST)) {
    bench_check(b, share <= LATE_MOST, text, s->boards, 1e2 * share, 1e2 * lowest, "");
  } else {
    bench_skip(b, text, s->boards, 1e2 * share, 1e2 * lowest,
               b->quick               ? " (too few to judge)"
               : !figures[0].realtime ? " (no SCHED_FIFO)"
                                      : " (which is not idle: not judged)");
  }
}

static void setup_report(bench *b, const setup *s, const line_figures figures[2], FILE *csv)
{
  const line_figures *f = &figures[0];
  bench_check(b, f->failed == 0, "line: %s: %llu of %llu ticks failed", s->boards,
              (unsigned long long)f->failed, (unsigned long long)f->ticks);
  late_judge(b, s, figures);
  bool pulled = s->pulled_ms >= 0.0 && s->pulled_ms <= PULLED_MS_MOST;
  const char *text = "line: %s: a pulled cable failed with its cause after %.2f ms";
  if (pulled || s->pulled_ms < 0.0 || (!b->quick && late_share(&figures[1]) <= FLOOR_MOST)) {
    bench_check(b, pulled, text, s->boards, s->pulled_ms);
  } else {
    bench_skip(b, text, s->boards, s->pulled_ms); /* once, on a machine that may be late itself */
  }
  fprintf(csv, "%s,%s,%d,%llu,%llu,%llu,%.6f,%.2f,%.2f,%.2f,%llu,%llu,%llu,%.6f,%.2f\n", s->model,
          s->boards, f->realtime ? 1 : 0, (unsigned long long)f->ticks, (unsigned long long)f->late,
          (unsigned long long)f->missed, late_share(f),
          1e-3 * hapi_histogram_quantile_ns(&f->tick_ns, 0.5),
          1e-3 * hapi_histogram_quantile_ns(&f->tick_ns, 0.99),
          1e-3 * hapi_histogram_max_ns(&f->tick_ns), (unsigned long long)figures[1].ticks,
          (unsigned long long)figures[1].late, (unsigned long long)figures[1].missed,
          late_share(&figures[1]), s->pulled_ms);
}

hap_status bench_line(bench *b)
{
  setup setups[] = {
      {.model = "x4r", .boards = "two B3M", .floor = {74, 34, 320e-6}},
      {.model = "x5r", .boards = "one B5M", .floor = {61, 33, 220e-6}},
  };
  hap_status status = HAP_OK;
  FILE *csv = bench_csv_open(b, "line",
                             "model,boards,realtime,ticks,late,missed,late_share,tick_us_p50,"
                             "tick_us_p99,tick_us_max,floor_ticks,floor_late,floor_missed,"
                             "floor_late_share,pulled_ms");
  if (csv == NULL) {
    return HAP_ERROR_IO;
  }
  signal(SIGPIPE, SIG_IGN);
  for (size_t i = 0; i < BENCH_COUNT(setups) && status >= HAP_OK; ++i) {
    line_figures figures[2];
    memset(figures, 0, sizeof figures);
    hapi_histogram_reset(&figures[0].tick_ns);
    hapi_histogram_reset(&figures[1].tick_ns);
    status = setup_measure(b, &setups[i], figures);
    if (status >= HAP_OK) {
      setup_report(b, &setups[i], figures, csv);
    }
  }
  return bench_csv_close(b, csv, status);
}
