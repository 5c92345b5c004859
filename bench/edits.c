/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench edits: a world that three threads change 60 times a second each under the lock,
 * and a fourth by posted edits, with sixteen hands in it that come and go. What it shows: the
 * loop goes on, physics keeps its steps, nobody waits for the lock longer than a step, and no
 * force jumps. */

#include <math.h>

#include <hapode/stats.h>

#include "bench/bench.h"
#include "bench/storm.h"

#define MISSED_SHARE 0.01 /* of the ticks */

typedef struct edits_case {
  hap_drive drive;
  hap_model model;
  const char *drive_name;
} edits_case;

static const edits_case cases[] = {
    {HAP_DRIVE_THREADS, HAP_MODEL_CONTACT, "threads"},
    {HAP_DRIVE_THREADS, HAP_MODEL_ACCELERANCE, "threads"},
    {HAP_DRIVE_FRAME, HAP_MODEL_CONTACT, "frame"},
};
#define CASES BENCH_COUNT(cases)

static storm_def def_of(const bench *b, const edits_case *what)
{
  return (storm_def){.drive = what->drive,
                     .model = what->model,
                     .seconds = b->quick ? 2.0 : 60.0,
                     .physics_hz = 60.0,
                     .seed = 20111,
                     .editors = 3,
                     .editor_hz = 60.0,
                     .posts = true,
                     .hands = STORM_SPOTS,
                     .churn = true,
                     .rt_priority = 80,
                     .telling = STORM_TELLS_HALF};
}

static void case_write(FILE *csv, const edits_case *what, const storm_def *def,
                       const storm_result *r)
{
  const hap_stats *s = &r->stats;
  fprintf(csv, "%s,%s,%g,%d,%d,%llu,%llu,%llu,%llu,%llu,%llu,%llu,%.4g,%llu,%.4g,%.4g,%.4g,%.4g,",
          what->drive_name, hap_model_name(what->model), def->seconds, def->hands, def->editors,
          (unsigned long long)r->edits, (unsigned long long)r->posts_run,
          (unsigned long long)s->loop.ticks, (unsigned long long)s->loop.missed_ticks,
          (unsigned long long)s->loop.contact_ticks, (unsigned long long)s->physics.steps,
          (unsigned long long)s->physics.missed, s->physics.ms_max,
          (unsigned long long)s->edits.locks, r->wait_ms_p50, r->wait_ms_p99, s->edits.wait_ms_max,
          s->edits.held_ms_max);
  fprintf(csv, "%.4g,%.4g,%llu,%llu,%.6g,%.3g,%llu\n", r->peak, r->steepest,
          (unsigned long long)r->lost, (unsigned long long)r->untold, s->hand.impulse_abs_ns,
          s->hand.momentum_error_ns, (unsigned long long)r->faults);
}

static void case_report(bench *b, const edits_case *what, const storm_def *def,
                        const storm_result *r)
{
  const hap_stats *s = &r->stats;
  /* In drive FRAME physics is an ordinary thread, which others may keep from running. */
  double step_ms = fmax(1e3 / def->physics_hz, s->physics.ms_max);
  double missed = (double)s->loop.missed_ticks / (double)(s->loop.ticks + s->loop.missed_ticks);
  bench_say(
      "%s, %s, %d hands, %g s: %llu edits, %llu of them by %llu posts; %.0f %% of the ticks in "
      "contact",
      what->drive_name, hap_model_name(what->model), def->hands, def->seconds,
      (unsigned long long)r->edits, (unsigned long long)(2 * r->posts_run),
      (unsigned long long)r->posts_run,
      100.0 * (double)s->loop.contact_ticks / (double)s->loop.ticks);
  bench_check(b, missed < MISSED_SHARE, "  %llu of %llu ticks missed: %.3f %% (bound %g)%s",
              (unsigned long long)s->loop.missed_ticks,
              (unsigned long long)(s->loop.ticks + s->loop.missed_ticks), 100.0 * missed,
              100.0 * MISSED_SHARE, s->loop.realtime != 0 ? "" : ", without real time");
  bench_check(b, s->physics.missed == 0,
              "  %llu of %llu physics steps missed, a cycle %.2f ms at most",
              (unsigned long long)s->physics.missed,
              (unsigned long long)(s->physics.steps + s->physics.missed), s->physics.ms_max);
  bench_check(b, s->edits.wait_ms_max <= step_ms,
              "  %llu times locked: waits of %.3f ms (median), %.3f (99 %%), %.3f at most (bound "
              "%.1f, a step or the longest cycle); held %.3f at most",
              (unsigned long long)s->edits.locks, r->wait_ms_p50, r->wait_ms_p99,
              s->edits.wait_ms_max, step_ms, s->edits.held_ms_max);
  bench_check(
      b, r->bad == 0 && r->unreleased == 0 && r->faults == 0 && r->unexpected == 0,
      "  %llu forces written: %.2f N at most, steps of %.2f N at most; %llu bad, %llu devices "
      "not released, %llu faults, %llu wrong answers",
      (unsigned long long)r->writes, r->peak, r->steepest, (unsigned long long)r->bad,
      (unsigned long long)r->unreleased, (unsigned long long)r->faults,
      (unsigned long long)r->unexpected);
  bench_check(b, s->hand.momentum_error_ns <= 1e-6 * s->hand.impulse_abs_ns,
              "  momentum: hands gave %.3f N s in all, the world's share is off by %.2g; %llu of "
              "%llu bodies that went without a word noticed "
              "(the others had come since the last step)",
              s->hand.impulse_abs_ns, s->hand.momentum_error_ns, (unsigned long long)r->lost,
              (unsigned long long)r->untold);
}

static void edits_draw(FILE *script, const void *data)
{
  const storm_result *results = data;
  fprintf(script, "$w << EOD\n");
  for (size_t i = 0; i < CASES; ++i) {
    const storm_result *r = &results[i];
    fprintf(script, "\"%s, %s\" %g %g %g\n", cases[i].drive_name, hap_model_name(cases[i].model),
            r->wait_ms_p50, r->wait_ms_p99, r->stats.edits.wait_ms_max);
  }
  fprintf(
      script,
      "EOD\nset title 'Waits for the lock while a world is edited'\n"
      "set style data histograms\nset style fill solid 0.6\nset logscale y\n"
      "set yrange [1e-5:100]\nset format y '%%g'\nset ylabel 'wait [ms]'\nset key outside right "
      "top\n"
      "plot $w using 2:xtic(1) title 'median', $w using 3 title '99 %%', "
      "$w using 4 title 'longest', %g with lines lc rgb '#606060' dt 2 title 'a physics step'\n",
      1e3 / 60.0);
}

hap_status bench_edits(bench *b)
{
  static storm_result results[CASES];
  FILE *csv =
      bench_csv_open(b, "edits",
                     "drive,model,seconds,hands,editors,edits,posts,ticks,missed_ticks,"
                     "contact_ticks,physics_steps,physics_missed,physics_ms_max,locks,"
                     "wait_ms_p50,wait_ms_p99,wait_ms_max,held_ms_max,peak_n,steepest_n,lost,"
                     "untold,impulse_abs_ns,momentum_error_ns,faults");
  hap_status status = csv != NULL ? HAP_OK : HAP_ERROR_IO;
  for (size_t i = 0; i < CASES && status >= HAP_OK; ++i) {
    storm_def def = def_of(b, &cases[i]);
    status = storm_run(&def, &results[i], &b->detail);
    if (status >= HAP_OK) {
      case_write(csv, &cases[i], &def, &results[i]);
      case_report(b, &cases[i], &def, &results[i]);
    }
  }
  status = bench_csv_close(b, csv, status);
  return status >= HAP_OK ? bench_draw(b, "edits", 900, 400, edits_draw, results) : status;
}
