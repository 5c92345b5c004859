/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* How late the haptic thread wakes up, and what it then costs: scene row10 in threads with its
 * simulated hand, by turns with cyclictest at the same period, priority and duration, which
 * shows what this machine gives to any program. What the kernel counts of the thread's ticks:
 * faults of pages and context switches. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "bench/bench.h"
#include "bench/thread_counts.h"
#include "tools/rig.h"

#define TURNS 4
#define LATE_US_MAX 20000 /* of cyclictest's histogram */

typedef struct turn {
  uint64_t ticks;
  uint64_t missed; /* later than a period */
  double wake_us[4];
  double tick_us[3]; /* p50, p99, largest; cyclictest: none */
  thread_counts counts;
  bool realtime;
} turn;

static const char *const columns =
    "rate_hz,policy,p50_us,p99_us,p999_us,max_us,missed,source,turn,ticks,tick_us_p50,tick_us_p99,"
    "tick_us_max,minor_faults,major_faults,voluntary_switches,involuntary_switches";

static void wait_for(double seconds)
{
  hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * seconds));
}

/* ---- the library ---- */

static hap_status session_watch(bench *b, hap_session *session, double seconds, turn *out)
{
  hap_stats stats;
  thread_counts before;
  thread_counts after;
  int thread = thread_find("hapode-haptic");
  wait_for(0.25 + 0.05 * seconds); /* first models, first touch */
  bool counted = thread_count(thread, &before);
  wait_for(seconds);
  counted = counted && thread_count(thread, &after);
  hap_status status = hap_session_stats(session, &stats, sizeof stats);
  if (status < HAP_OK || stats.faults.count != 0) {
    return bench_fail(b, HAP_ERROR_STATE, "jitter: the session has a fault");
  }
  *out = (turn){
      .ticks = stats.loop.ticks,
      .missed = stats.loop.missed_ticks,
      .wake_us = {stats.loop.wake_us_p50, stats.loop.wake_us_p99, stats.loop.wake_us_p999,
                  stats.loop.wake_us_max},
      .tick_us = {stats.loop.tick_us_p50, stats.loop.tick_us_p99, stats.loop.tick_us_max},
      .realtime = stats.loop.realtime != 0,
  };
  if (counted) {
    out->counts = thread_counts_since(&after, &before);
  }
  return HAP_OK;
}

static hap_status run_session(bench *b, double hz, double seconds, turn *out)
{
  rig r;
  rig_options options;
  rig_options_init(&options);
  options.def.drive = HAP_DRIVE_THREADS;
  options.def.haptic_hz = hz;
  memset(out, 0, sizeof *out);
  hap_status status = rig_create(&options, &r, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  status = hap_session_start(r.session);
  if (status >= HAP_OK) {
    status = session_watch(b, r.session, seconds, out);
  }
  rig_destroy(&r);
  return status;
}

/* ---- cyclictest ---- */

static double counts_quantile(const uint64_t *counts, uint64_t total, double share)
{
  uint64_t below = 0;
  for (int us = 0; us < LATE_US_MAX; ++us) {
    below += counts[us];
    if ((double)below >= share * (double)total) {
      return us;
    }
  }
  return LATE_US_MAX;
}

/* Lines "microseconds count", and comments, of which "Max Latencies" and "Histogram Overflows"
 * count. */
static bool read_histogram(FILE *from, double period_us, turn *out)
{
  static uint64_t counts[LATE_US_MAX];
  char line[256];
  uint64_t beyond = 0;
  memset(counts, 0, sizeof counts);
  while (fgets(line, sizeof line, from) != NULL) {
    unsigned us = 0;
    unsigned long long n = 0;
    if (sscanf(line, "# Max Latencies: %llu", &n) == 1) {
      out->wake_us[3] = (double)n;
    } else if (sscanf(line, "# Histogram Overflows: %llu", &n) == 1) {
      beyond = n;
    } else if (line[0] != '#' && sscanf(line, "%u %llu", &us, &n) == 2 && us < LATE_US_MAX) {
      counts[us] = n;
      out->ticks += n;
      out->missed += us >= period_us ? n : 0;
    }
  }
  out->ticks += beyond;
  out->missed += beyond;
  static const double shares[] = {0.5, 0.99, 0.999};
  for (int i = 0; i < 3; ++i) {
    out->wake_us[i] = counts_quantile(counts, out->ticks, shares[i]);
  }
  return out->ticks > 0;
}

/* False: it is not there, or may not run so. */
static bool run_cyclictest(double hz, double seconds, bool realtime, turn *out)
{
  char command[200];
  memset(out, 0, sizeof *out);
  out->realtime = realtime;
  (void)snprintf(command, sizeof command,
                 "cyclictest -q -m %s -t 1 -i %.0f -l %.0f -h %d 2>/dev/null",
                 realtime ? "-p 80" : "", 1e6 / hz, hz * seconds, LATE_US_MAX);
  FILE *from = popen(command, "r"); /* NOLINT(cert-env33-c): a program of the PATH, numbers only */
  bool good = from != NULL && read_histogram(from, 1e6 / hz, out);
  return from != NULL && pclose(from) == 0 && good;
}

/* ---- both ---- */

static void turn_write(FILE *csv, double hz, int number, const char *source, const turn *t)
{
  fprintf(csv, "%.0f,%s", hz, t->realtime ? "fifo" : "other");
  for (int i = 0; i < 4; ++i) {
    fprintf(csv, ",%.1f", t->wake_us[i]);
  }
  fprintf(csv, ",%llu,%s,%d,%llu", (unsigned long long)t->missed, source, number,
          (unsigned long long)t->ticks);
  if (strcmp(source, "hapode") != 0) {
    fprintf(csv, ",,,,,,,\n");
    return;
  }
  fprintf(csv, ",%.2f,%.2f,%.2f,%llu,%llu,%llu,%llu\n", t->tick_us[0], t->tick_us[1], t->tick_us[2],
          (unsigned long long)t->counts.minor_faults, (unsigned long long)t->counts.major_faults,
          (unsigned long long)t->counts.voluntary, (unsigned long long)t->counts.involuntary);
}

/* Sums of counts, medians of the turns' quantiles, the largest of the largest. */
static turn sum_up(const turn *turns)
{
  turn sum = turns[0];
  for (int i = 1; i < TURNS; ++i) {
    sum.ticks += turns[i].ticks;
    sum.missed += turns[i].missed;
    sum.counts.minor_faults += turns[i].counts.minor_faults;
    sum.counts.major_faults += turns[i].counts.major_faults;
    sum.counts.voluntary += turns[i].counts.voluntary;
    sum.counts.involuntary += turns[i].counts.involuntary;
    sum.wake_us[3] = fmax(sum.wake_us[3], turns[i].wake_us[3]);
    sum.tick_us[2] = fmax(sum.tick_us[2], turns[i].tick_us[2]);
  }
  for (int q = 0; q < 3; ++q) {
    double values[TURNS];
    for (int i = 0; i < TURNS; ++i) {
      values[i] = turns[i].wake_us[q];
    }
    sum.wake_us[q] = bench_median(values, TURNS);
  }
  return sum;
}

static void rate_report(bench *b, double hz, double seconds, const turn *own, const turn *other)
{
  bench_say(
      "%.0f Hz: woken up %.0f / %.0f / %.0f us late (p50, p99, p99.9), at most %.0f; %llu of %llu "
      "ticks missed; longest tick %.0f us",
      hz, own->wake_us[0], own->wake_us[1], own->wake_us[2], own->wake_us[3],
      (unsigned long long)own->missed, (unsigned long long)own->ticks, own->tick_us[2]);
  bench_check(b, own->counts.minor_faults + own->counts.major_faults == 0,
              "%.0f Hz: %llu faults of pages in the ticks (bound 0)", hz,
              (unsigned long long)(own->counts.minor_faults + own->counts.major_faults));
  double waits = (double)own->counts.voluntary / (TURNS * hz * seconds);
  bench_check(b, waits <= 1.01, "%.0f Hz: %.3f waits a tick (bound 1.01), put aside %llu times", hz,
              waits, (unsigned long long)own->counts.involuntary);
  if (other == NULL) {
    bench_skip(b, "%.0f Hz: nothing to compare with (Debian: rt-tests has cyclictest)", hz);
    return;
  }
  bench_say(
      "%.0f Hz: cyclictest %.0f / %.0f / %.0f us, at most %.0f; %llu of %llu later than a period",
      hz, other->wake_us[0], other->wake_us[1], other->wake_us[2], other->wake_us[3],
      (unsigned long long)other->missed, (unsigned long long)other->ticks);
  double excess =
      (double)own->missed / (double)own->ticks - (double)other->missed / (double)other->ticks;
  bench_check(b, excess <= 1e-3,
              "%.0f Hz: %+.3f %% of ticks missed beyond what cyclictest misses (bound "
              "0.1)",
              hz, 100.0 * excess);
}

#define RATES 3

typedef struct rate {
  double hz;
  turn own;
  turn other;
  bool compared;
} rate;

static hap_status run_rate(bench *b, FILE *csv, double seconds, rate *out)
{
  turn own[TURNS];
  turn other[TURNS];
  out->compared = true;
  for (int i = 0; i < TURNS; ++i) {
    hap_status status = run_session(b, out->hz, seconds, &own[i]);
    if (status < HAP_OK) {
      return status;
    }
    turn_write(csv, out->hz, i, "hapode", &own[i]);
    out->compared = out->compared && run_cyclictest(out->hz, seconds, own[i].realtime, &other[i]);
    if (out->compared) {
      turn_write(csv, out->hz, i, "cyclictest", &other[i]);
    }
  }
  out->own = sum_up(own);
  if (out->compared) {
    out->other = sum_up(other);
  }
  rate_report(b, out->hz, seconds, &out->own, out->compared ? &out->other : NULL);
  return HAP_OK;
}

static void draw_line(FILE *script, const char *name, size_t number, const turn *t)
{
  fprintf(script, "$%s%zu << EOD\n", name, number);
  for (int q = 0; q < 4; ++q) {
    fprintf(script, "%d %g\n", q, fmax(t->wake_us[q], 0.5));
  }
  fprintf(script, "EOD\n");
}

static void jitter_draw(FILE *script, const void *data)
{
  const rate *rates = data;
  for (size_t i = 0; i < RATES; ++i) {
    draw_line(script, "own", i, &rates[i].own);
    draw_line(script, "other", i, rates[i].compared ? &rates[i].other : &rates[i].own);
  }
  fprintf(script,
          "set title 'Woken up late: the haptic thread and cyclictest'\n"
          "set xtics ('median' 0, '99 in 100' 1, '999 in 1000' 2, 'largest' 3)\nset xrange "
          "[-0.2:3.2]\n"
          "set ylabel 'us'\nset logscale y\nset grid y\nset key top left\nplot ");
  for (size_t i = 0; i < RATES; ++i) {
    fprintf(script, "$own%zu with linespoints lw 2 title 'hapode, %.0f Hz'%s", i, rates[i].hz,
            rates[i].compared || i + 1 < RATES ? ", " : "");
    if (rates[i].compared) {
      fprintf(script, "$other%zu with linespoints dt 2 title 'cyclictest, %.0f Hz'%s", i,
              rates[i].hz, i + 1 < RATES ? ", " : "");
    }
  }
  fprintf(script, "\n");
}

hap_status bench_jitter(bench *b)
{
  rate rates[RATES] = {{.hz = 1000.0}, {.hz = 4000.0}, {.hz = 10000.0}};
  const double seconds = b->quick ? 1.0 : 15.0;
  FILE *csv = bench_csv_open(b, "jitter", columns);
  hap_status status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t i = 0; i < RATES && status >= HAP_OK; ++i) {
    status = run_rate(b, csv, seconds, &rates[i]);
  }
  status = bench_csv_close(b, csv, status);
  return status >= HAP_OK ? bench_draw(b, "jitter", 800, 500, jitter_draw, rates) : status;
}
