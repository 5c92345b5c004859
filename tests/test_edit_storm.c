/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Everything in the world changes all the time, under hands that come and go. "long": for a
 * minute each; "SECONDS": for so long. */

#include "tests/tap.h"

#include "bench/storm.h"
#include "tests/repeat.h"

static double seconds = 2.0;

static void storm_say(const storm_result *r)
{
  const hap_stats *s = &r->stats;
  printf(
      "# %llu edits, %llu posts run, %llu refused, %llu tries in vain, %llu hands, %llu writes, "
      "%.2f N at most, steps %.2f N\n",
      (unsigned long long)r->edits, (unsigned long long)r->posts_run,
      (unsigned long long)r->posts_refused, (unsigned long long)r->tries_in_vain,
      (unsigned long long)r->hands_added, (unsigned long long)r->writes, r->peak, r->steepest);
  printf(
      "# ticks %llu, missed %llu, in contact %llu; steps %llu, missed %llu; lock waits %.3f ms at "
      "most, held %.3f; lost %llu of %llu untold\n",
      (unsigned long long)s->loop.ticks, (unsigned long long)s->loop.missed_ticks,
      (unsigned long long)s->loop.contact_ticks, (unsigned long long)s->physics.steps,
      (unsigned long long)s->physics.missed, s->edits.wait_ms_max, s->edits.held_ms_max,
      (unsigned long long)r->lost, (unsigned long long)r->untold);
  printf("# momentum %.9f, error %.3g N s of %.3g N s\n", s->hand.momentum_ratio,
         s->hand.momentum_error_ns, s->hand.impulse_abs_ns);
}

static void storm_check(const storm_def *def, storm_result *out)
{
  hap_detail detail = {""};
  hap_status status = storm_run(def, out, &detail);
  if (status < HAP_OK) {
    printf("# %s\n", detail.text);
  }
  REQUIRE(status >= HAP_OK);
  storm_say(out);
  CHECK(out->bad == 0 && out->unreleased == 0);
  CHECK(out->peak <= STORM_FORCE * (1.0 + 1e-9) && out->steepest <= STORM_SLEW * (1.0 + 1e-9));
  CHECK_SAY(out->unexpected == 0 && out->faults == 0, "%llu unexpected results, %llu faults",
            (unsigned long long)out->unexpected, (unsigned long long)out->faults);
  CHECK(out->posts_run == out->posts_taken); /* nothing lost */
  CHECK(out->edits > 0 && out->writes > 0 && out->stats.loop.contact_ticks > 0);
  CHECK(out->stats.faults.states_rejected == 0);
  CHECK(out->lost <= out->untold && (def->telling != STORM_TELLS || out->lost == 0));
  CHECK(out->stats.hand.momentum_error_ns <= 1e-6 * out->stats.hand.impulse_abs_ns);
}

static storm_def storm_usual(hap_drive drive, hap_model model)
{
  return (storm_def){.drive = drive,
                     .model = model,
                     .seconds = seconds,
                     .physics_hz = 60.0,
                     .seed = 12345,
                     .editors = drive == HAP_DRIVE_LOCKSTEP ? 0 : 3,
                     .posts = true,
                     .hands = STORM_SPOTS,
                     .churn = true,
                     .restarts = true,
                     .telling = STORM_TELLS_HALF};
}

TEST(threads_in_model_contact)
{
  storm_result r;
  storm_def def = storm_usual(HAP_DRIVE_THREADS, HAP_MODEL_CONTACT);
  storm_check(&def, &r);
  CHECK(r.tries_in_vain > 0 && r.stats.edits.locks > 0);
}

TEST(threads_in_the_other_models)
{
  for (int model = HAP_MODEL_SINGLE; model < HAP_MODEL_CONTACT; ++model) {
    storm_result r;
    storm_def def = storm_usual(HAP_DRIVE_THREADS, (hap_model)model);
    def.seconds = 0.5 * seconds;
    storm_check(&def, &r);
  }
}

TEST(storm_frame)
{
  storm_result r;
  storm_def def = storm_usual(HAP_DRIVE_FRAME, HAP_MODEL_CONTACT);
  def.telling = STORM_TELLS_NOT;
  storm_check(&def, &r);
  CHECK(r.lost > 0);
}

static void trace_note(hap_session *session, void *log)
{
  repeat_note(log, session);
}

static void run_told(repeat_log *log, const void *arg)
{
  storm_result r;
  storm_def def = *(const storm_def *)arg;
  def.ticked = trace_note;
  def.ticked_arg = log;
  storm_check(&def, &r);
  CHECK(r.stats.loop.ticks == log->count && r.stats.loop.trace_hash != 0);
}

/* Told of what goes, lockstep has the same bits in every run, whatever addresses the heap gives. */
TEST(lockstep_repeats_bit_by_bit)
{
  int seeds = seconds < 30.0 ? 1 : 3;
  for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_CONTACT; ++model) {
    storm_def def = storm_usual(HAP_DRIVE_LOCKSTEP, (hap_model)model);
    def.telling = STORM_TELLS;
    def.restarts = false;
    for (int i = 0; i < seeds; ++i) {
      def.seed += (uint64_t)i;
      CHECK(repeat_run(run_told, &def));
    }
  }
}

TEST(lockstep_untold)
{
  for (uint64_t seed = 1; seed < 4; ++seed) {
    storm_result r;
    storm_def def = storm_usual(HAP_DRIVE_LOCKSTEP, HAP_MODEL_CONTACT);
    def.seed = seed;
    def.telling = STORM_TELLS_NOT;
    storm_check(&def, &r);
    CHECK(r.lost > 0);
  }
}

SET_UP
{
  bool is_long = strcmp(tap_argument, "long") == 0;
  double asked = strtod(tap_argument, NULL);
  seconds = is_long ? 60.0 : asked > 0.0 ? asked : seconds;
  repeat_init();
  return true;
}
