/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "bench/bench.h"
#include "bench/child.h"
#include "bench/late.h"

/* hapode-bench stopped: hapode-run as a process of its own, in real time, with the virtual device
 * and with a SPIDAR's emulator, a new one for each run, which nobody stops. Signals stop hapode-run
 * and let it go on in pulses, or busy loops take its processor. Judged are what the device was
 * told, from the trace, and what the emulator's strings pulled, against a run that nobody
 * disturbed. `late` does the same by a virtual clock, without the machine's own lateness. */

#define STOPPED_BEGIN_S 1.0 /* after the start of the process */
#define STOPPED_PULSES_S 2.0
#define STOPPED_SECONDS "4" /* of a run */
#define STOPPED_BURNERS_MAX 8
#define STOPPED_MISSED_MOST 0.01 /* of a run that nobody disturbs, to judge by it */
#define STOPPED_SCENE "row10"
#define STOPPED_FIFO "40" /* of the emulator, where it is allowed */

typedef struct stopped_def {
  const char *name;
  int stop_ms; /* 0: nobody stops it */
  int run_ms;
  bool common; /* one processor, without real-time rights */
  int burners; /* busy loops on that processor */
} stopped_def;

/* After each run that nothing disturbs those that are compared with it. */
static const stopped_def stopped_defs[] = {
    {.name = "nothing"},
    {.name = "8/8 ms", .stop_ms = 8, .run_ms = 8},
    {.name = "12/4 ms", .stop_ms = 12, .run_ms = 4},
    {.name = "15/5 ms", .stop_ms = 15, .run_ms = 5},
    {.name = "30/10 ms", .stop_ms = 30, .run_ms = 10},
    {.name = "no real time", .common = true},
    {.name = "four busy loops", .common = true, .burners = 4},
};

typedef struct stopped_result {
  double peak; /* N */
  double step; /* N, largest change from tick to tick */
  unsigned steps;
  double ticks;
  double missed;
  double derated;
  double pulled; /* N, by the strings of a SPIDAR */
  bool realtime;
  char fault[64]; /* "none" */
  bool ended;     /* with exit 0 */
} stopped_result;

static double stopped_share(const stopped_result *r)
{
  return r->missed / fmax(r->ticks + r->missed, 1.0);
}

/* ---- what a run leaves behind ---- */

static bool trace_take(const char *file, stopped_result *out)
{
  char line[8192];
  double before[3] = {0.0, 0.0, 0.0};
  FILE *trace = fopen(file, "r");
  if (trace == NULL) {
    return false;
  }
  while (fgets(line, sizeof line, trace) != NULL) {
    double t;
    double at[3];
    double f[3];
    if (sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf,%lf", &t, &at[0], &at[1], &at[2], &f[0], &f[1],
               &f[2]) != 7) {
      continue; /* the header */
    }
    double change =
        sqrt((f[0] - before[0]) * (f[0] - before[0]) + (f[1] - before[1]) * (f[1] - before[1]) +
             (f[2] - before[2]) * (f[2] - before[2]));
    out->peak = fmax(out->peak, sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]));
    out->step = fmax(out->step, change);
    out->steps += change > LATE_STEP_N;
    memcpy(before, f, sizeof before);
  }
  fclose(trace);
  return true;
}

static void said_take(FILE *said, stopped_result *out)
{
  char line[512];
  char word[64];
  while (said != NULL && fgets(line, sizeof line, said) != NULL) {
    (void)sscanf(line, "ticks: %lf", &out->ticks);
    (void)sscanf(line, "missed_ticks: %lf", &out->missed);
    (void)sscanf(line, "derated_ticks: %lf", &out->derated);
    (void)sscanf(line, "fault: %63s", out->fault);
    out->realtime =
        out->realtime || (sscanf(line, "realtime: %63s", word) == 1 && strcmp(word, "yes") == 0);
  }
}

/* ---- what is done to it ---- */

static void pulses_send(pid_t pid, const stopped_def *def)
{
  int64_t now_ns = hapi_clock_now();
  int64_t end_ns = now_ns + (int64_t)(1e9 * STOPPED_PULSES_S);
  while (now_ns < end_ns) {
    (void)kill(pid, SIGSTOP);
    now_ns += 1000000LL * def->stop_ms;
    hapi_clock_sleep_until(now_ns);
    (void)kill(pid, SIGCONT);
    now_ns += 1000000LL * def->run_ms;
    hapi_clock_sleep_until(now_ns);
  }
}

static pid_t burner_start(void)
{
  pid_t pid = fork();
  if (pid == 0) {
    (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (volatile uint64_t i = 0;; ++i) {
    }
  }
  return pid;
}

static void burners_run(int count)
{
  pid_t burners[STOPPED_BURNERS_MAX];
  for (int i = 0; i < count; ++i) {
    burners[i] = burner_start();
  }
  hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * STOPPED_PULSES_S));
  for (int i = 0; i < count; ++i) {
    if (burners[i] > 0) {
      (void)kill(burners[i], SIGKILL);
      (void)waitpid(burners[i], NULL, 0);
    }
  }
}

/* Child and busy loops are on the processor that the caller is on. */
static void processor_share(cpu_set_t *before)
{
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(sched_getcpu(), &one);
  (void)sched_getaffinity(0, sizeof *before, before);
  (void)sched_setaffinity(0, sizeof one, &one);
}

static bool run_disturbed(const stopped_def *def, const char *const words[], stopped_result *out)
{
  bench_child child;
  cpu_set_t before;
  if (def->common) {
    processor_share(&before);
  }
  int64_t begin_ns = hapi_clock_now() + (int64_t)(1e9 * STOPPED_BEGIN_S);
  bool started = bench_child_start("hapode-run", words, &child);
  if (started) {
    hapi_clock_sleep_until(begin_ns);
    if (def->stop_ms > 0) {
      pulses_send(child.pid, def);
    } else if (def->burners > 0) {
      burners_run(def->burners);
    }
    said_take(child.said, out);
  }
  if (def->common) {
    (void)sched_setaffinity(0, sizeof before, &before);
  }
  out->ended = bench_child_finish(&child, 0);
  return started;
}

/* ---- the table ---- */

/* The scene's own device, or that of an emulator. */
typedef struct stopped_device {
  const char *name;
  bool spidar;
} stopped_device;

static bool emulator_begin(bench_child *emulator, char *spec, size_t size)
{
  static const char *const words[] = {"--hand", "push", "--fifo", STOPPED_FIFO, NULL};
  char line[100] = "";
  bool good = bench_child_start("spidar-emulator", words, emulator) &&
              fgets(line, sizeof line, emulator->said) != NULL && strncmp(line, "port: ", 6) == 0;
  line[strcspn(line, "\n")] = '\0';
  (void)snprintf(spec, size, "spidar:%.80s", line + (good ? 6 : 0));
  return good;
}

static bool emulator_ask(const bench_child *emulator, double *out_pulled)
{
  static const char question[] = "state\n";
  char line[1024] = "";
  bool told = write(emulator->input, question, sizeof question - 1) == sizeof question - 1 &&
              fgets(line, sizeof line, emulator->said) != NULL;
  const char *at = told ? strstr(line, " pulled=") : NULL;
  return at != NULL && sscanf(at, " pulled=%lf", out_pulled) == 1;
}

static hap_status stopped_run(bench *b, const stopped_device *device, const stopped_def *def,
                              stopped_result *out)
{
  bench_child emulator = {.pid = -1, .input = -1};
  char spec[128];
  char trace[4096];
  *out = (stopped_result){.fault = "none"};
  (void)snprintf(trace, sizeof trace, "%s/stopped_trace.csv", b->out);
  const char *words[16] = {"--scene",       STOPPED_SCENE, "--seconds",
                           STOPPED_SECONDS, "--trace",     trace};
  int count = 6;
  bool good = !device->spidar || emulator_begin(&emulator, spec, sizeof spec);
  if (device->spidar) {
    words[count++] = "--device";
    words[count++] = spec;
  }
  if (def->common) {
    words[count++] = "--no-realtime";
  }
  good = good && run_disturbed(def, words, out);
  good = good && trace_take(trace, out) && out->ticks > 0.0;
  good = good && (!device->spidar || emulator_ask(&emulator, &out->pulled));
  (void)bench_child_finish(&emulator, SIGTERM);
  (void)unlink(trace);
  return good ? HAP_OK
              : bench_fail(b, HAP_ERROR_SYSTEM, "stopped: hapode-run with %s did not run",
                           device->name);
}

static void stopped_judge(bench *b, FILE *csv, const stopped_device *device, const stopped_def *def,
                          const stopped_result *still, const stopped_result *now)
{
  bool fault = strcmp(now->fault, "none") != 0;
  bool told = fault || now->derated > 0.0;
  double ratio = still->peak > 0.0 ? now->peak / still->peak : 1.0;
  double pulled = still->pulled > 0.0 ? now->pulled / still->pulled : 0.0;
  static const char text[] =
      "%s, %s: %.2f N, %.2f of that undisturbed; %u steps above %g N (%u), "
      "largest %.2f N; %.1f %% missed, %.0f ticks with less force, fault %s; strings %.2f N";
  fprintf(csv, "%s,%s,%.4f,%.3f,%u,%u,%.3f,%.0f,%.0f,%.0f,%s,%.3f\n", device->name, def->name,
          now->peak, ratio, now->steps, still->steps, now->step, now->ticks, now->missed,
          now->derated, now->fault, now->pulled);
  if (now == still) {
    bench_skip(b, "%s, %s: %.2f N, %u steps above %g N; %.2f %% missed, real time: %s",
               device->name, def->name, now->peak, now->steps, LATE_STEP_N,
               1e2 * stopped_share(now), now->realtime ? "yes" : "no");
  } else if (stopped_share(still) > STOPPED_MISSED_MOST) {
    bench_skip(b, text, device->name, def->name, now->peak, ratio, now->steps, LATE_STEP_N,
               still->steps, now->step, 1e2 * stopped_share(now), now->derated, now->fault,
               now->pulled);
  } else {
    bench_check(b,
                told && fmax(ratio, pulled) <= LATE_PEAK_RATIO &&
                    now->steps <= LATE_PEAK_RATIO * still->steps,
                text, device->name, def->name, now->peak, ratio, now->steps, LATE_STEP_N,
                still->steps, now->step, 1e2 * stopped_share(now), now->derated, now->fault,
                now->pulled);
  }
}

static hap_status stopped_device_run(bench *b, FILE *csv, const stopped_device *device)
{
  stopped_result still = {0};
  hap_status status = HAP_OK;
  size_t count = b->quick ? 2 : BENCH_COUNT(stopped_defs);
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    const stopped_def *def = &stopped_defs[i];
    bool reference = def->stop_ms == 0 && def->burners == 0;
    stopped_result now = {0};
    status = stopped_run(b, device, def, reference ? &still : &now);
    if (status >= HAP_OK) {
      stopped_judge(b, csv, device, def, &still, reference ? &still : &now);
    }
  }
  return status;
}

hap_status bench_stopped(bench *b)
{
  static const stopped_device own = {.name = "virtual"};
  static const stopped_device spidar = {.name = "spidar", .spidar = true};
  FILE *csv = bench_csv_open(b, "stopped",
                             "device,disturbed,peak_n,peak_ratio,steps,steps_without,step_n,ticks,"
                             "missed,derated,fault,pulled_n");
  if (csv == NULL) {
    return HAP_ERROR_IO;
  }
  signal(SIGPIPE, SIG_IGN);
  hap_status status = stopped_device_run(b, csv, &own);
  return bench_csv_close(b, csv, status >= HAP_OK ? stopped_device_run(b, csv, &spidar) : status);
}
