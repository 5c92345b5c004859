/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A SPIDAR at 1 kHz through the emulator, both in real time: how many ticks found no new answer of all boards,
 * and what read and write cost. Positions come over a pseudo-terminal, so what is measured is the code and the
 * scheduler, not a USB adapter. */

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/histogram.h"
#include "base/thread.h"
#include "bench/bench.h"
#include "device/device.h"
#include "plugins/spidar/spidar.h"

#define HZ 1000.0
#define PRIORITY 70
#define LATE_MOST 0.005 /* share of the ticks */
#define WARM_TICKS 200

typedef struct setup {
  const char *model;
  const char *boards; /* for people */
  pid_t emulator;
  int input; /* its stdin: it ends with us */
  char spec[128];
  hap_device *device;
} setup;

typedef struct figures {
  uint64_t ticks;
  uint64_t late;   /* no new answer since the tick before */
  uint64_t missed; /* woken up more than a period late */
  uint64_t failed;
  hapi_histogram tick_ns; /* read and write */
  bool realtime;
} figures;

typedef struct job {
  hap_device *device;
  uint64_t ticks;
  figures figures;
} job;

/* ---- the emulator ---- */

static void path_of_emulator(char *out, size_t size)
{
  ssize_t length = readlink("/proc/self/exe", out, size - 1);
  out[length > 0 ? length : 0] = '\0';
  char *name = strrchr(out, '/');
  size_t used = name != NULL ? (size_t)(name - out) : 0;
  (void)snprintf(out + used, size - used, "/spidar-emulator");
}

static void run_emulator(const setup *s, int in, int out)
{
  char path[4096];
  path_of_emulator(path, sizeof path);
  dup2(in, STDIN_FILENO);
  dup2(out, STDOUT_FILENO);
  execl(path, path, "--model", s->model, "--hand", "hold", "--fifo", "60", (char *)NULL);
  _exit(127);
}

static bool start_emulator(setup *s)
{
  int in[2];
  int out[2];
  char line[100] = "";
  if (pipe(in) != 0 || pipe(out) != 0) {
    return false;
  }
  s->emulator = fork();
  if (s->emulator == 0) {
    close(in[1]);
    run_emulator(s, in[0], out[1]);
  }
  close(in[0]);
  close(out[1]);
  s->input = in[1];
  FILE *said = fdopen(out[0], "r");
  bool good =
      said != NULL && fgets(line, sizeof line, said) != NULL && strncmp(line, "port: ", 6) == 0;
  if (said != NULL) {
    fclose(said);
  }
  line[strcspn(line, "\n")] = '\0';
  (void)snprintf(s->spec, sizeof s->spec, "spidar:%.80s,timeout=5,stall=5", line + 6);
  return good;
}

static void stop_emulator(const setup *s)
{
  close(s->input);
  if (s->emulator > 0) {
    (void)kill(s->emulator, SIGTERM);
    (void)waitpid(s->emulator, NULL, 0);
  }
}

/* ---- the loop ---- */

static void tick(const hap_device_ops *ops, hapi_spidar_device *self, bool counts, figures *f)
{
  const hap_wrench wanted = {{0.2, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_pose pose;
  hap_twist twist;
  hap_wrench reached;
  uint32_t buttons;
  double before = self->line.taken;
  int64_t begin_ns = hapi_clock_now();
  bool good = ops->read(self, begin_ns, &pose, &twist, &buttons) >= HAP_OK &&
              ops->write(self, &wanted, &reached) >= HAP_OK;
  if (counts) {
    hapi_histogram_add(&f->tick_ns, hapi_clock_now() - begin_ns);
    f->failed += !good;
    f->late += self->line.taken == before;
    ++f->ticks;
  }
}

static void *run_loop(void *argument)
{
  job *j = argument;
  const hap_device_ops *ops = hapi_device_ops(j->device);
  void *self = hapi_device_self(j->device);
  hapi_thread_prepare_for_ticks();
  int64_t start_ns = hapi_clock_now();
  for (uint64_t i = 1; i <= j->ticks + WARM_TICKS; ++i) {
    int64_t due_ns = start_ns + hapi_clock_deadline(i, HZ);
    hapi_clock_sleep_until(due_ns);
    int64_t late_ns = hapi_clock_now() - due_ns;
    if (late_ns > (int64_t)(1e9 / HZ)) { /* not made up for in a burst */
      start_ns += late_ns;
      j->figures.missed += i > WARM_TICKS;
    }
    tick(ops, self, i > WARM_TICKS, &j->figures);
  }
  ops->zero(self);
  return NULL;
}

static hap_status measure(bench *b, setup *s, figures *out)
{
  job j = {.ticks = b->quick ? 2000 : 60000};
  hapi_thread thread;
  hapi_histogram_reset(&j.figures.tick_ns);
  hap_status status = hap_device_open(s->spec, &j.device, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  void *self = hapi_device_self(j.device);
  status = hapi_device_ops(j.device)->start(self);
  if (status >= HAP_OK) {
    status = hapi_thread_start(&thread, run_loop, &j, "bench-line", PRIORITY);
  }
  if (status >= HAP_OK) {
    hapi_thread_join(&thread);
    j.figures.realtime = atomic_load(&thread.realtime);
  } else {
    (void)bench_fail(b, status, "line: the device did not start");
  }
  hapi_device_ops(j.device)->stop(self);
  hap_device_close(j.device);
  *out = j.figures;
  return status;
}

/* ---- what it tells ---- */

static void report(bench *b, const setup *s, const figures *f)
{
  double share = (double)f->late / (double)f->ticks;
  bench_check(b, f->failed == 0, "line: %s: %llu of %llu ticks failed", s->boards,
              (unsigned long long)f->failed, (unsigned long long)f->ticks);
  if (f->realtime && !b->quick) {
    bench_check(b, share <= LATE_MOST, "line: %s: %.3f %% of the ticks without a new answer",
                s->boards, 1e2 * share);
  } else {
    bench_skip(b, "line: %s: %.3f %% of the ticks without a new answer (%s)", s->boards,
               1e2 * share, b->quick ? "too few to judge" : "no SCHED_FIFO");
  }
}

static hap_status run_one(bench *b, setup *s, FILE *csv)
{
  figures f;
  memset(&f, 0, sizeof f);
  bool started = start_emulator(s);
  hap_status status =
      started ? measure(b, s, &f) : bench_fail(b, HAP_ERROR_SYSTEM, "line: no spidar-emulator");
  stop_emulator(s);
  if (status < HAP_OK) {
    return status;
  }
  report(b, s, &f);
  fprintf(csv, "%s,%s,%d,%llu,%llu,%llu,%.6f,%.2f,%.2f,%.2f\n", s->model, s->boards,
          f.realtime ? 1 : 0, (unsigned long long)f.ticks, (unsigned long long)f.late,
          (unsigned long long)f.missed, (double)f.late / (double)f.ticks,
          1e-3 * hapi_histogram_quantile_ns(&f.tick_ns, 0.5),
          1e-3 * hapi_histogram_quantile_ns(&f.tick_ns, 0.99),
          1e-3 * hapi_histogram_max_ns(&f.tick_ns));
  return HAP_OK;
}

hap_status bench_line(bench *b)
{
  setup setups[] = {{.model = "x4r", .boards = "two B3M"}, {.model = "x5r", .boards = "one B5M"}};
  hap_status status = HAP_OK;
  FILE *csv = bench_csv_open(b, "line",
                             "model,boards,realtime,ticks,late,missed,late_share,tick_us_p50,"
                             "tick_us_p99,tick_us_max");
  if (csv == NULL) {
    return bench_csv_close(b, csv);
  }
  signal(SIGPIPE, SIG_IGN);
  for (size_t i = 0; i < sizeof setups / sizeof setups[0] && status >= HAP_OK; ++i) {
    status = run_one(b, &setups[i], csv);
  }
  hap_status closed = bench_csv_close(b, csv);
  return status < HAP_OK ? status : closed;
}
