/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/belief.h"

#include <string.h>

#include "base/assert.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "plugins/spidar/calibration.h"

/* Replies have no checksum, so a false one looks like any other. Three things tell:
 *
 *   strings  A string cannot leave the length that it comes to at its rate by more than a hand can
 *            accelerate it. Where that is true of one, the others decide: they are one more than a
 *            pose needs.
 *   fit      Lengths that fit no pose. hapi_spidar_diagnose leaves out each string in turn; where
 *            the rest fits without one of them alone, that one is wrong.
 *   counts   A reply that was there before: not one count of all strings has changed, though they
 *            ran fast. Between two counts a hand does not come to rest from such a speed. Or all
 *            counts are those of some time ago, and not where the strings were going: a hand does
 *            not leap back to the very count of each string.
 *
 * One old reply that is near enough may be believed, when its counts were never told. The velocity
 * that it makes is false, and the right replies behind it seem to leap back. So what goes on from
 * the course before the newest believed reply is no leap, and of the two velocities the smaller
 * one carries the pose on.
 *
 * Where several leave their lengths at once nothing is believed. The bound grows with the time
 * since the newest reply that was: a grip that really jumped is back after some ms. */

static double metres_of(const hapi_spidar_model *model, int string)
{
  HAPI_ASSERT_INDEX(string, model->strings);
  return fabs(model->metres_per_count[string]);
}

void hapi_spidar_belief_begin(hapi_spidar_belief *belief, const hapi_spidar_model *model,
                              const hap_pose *start)
{
  memset(belief, 0, sizeof *belief);
  hapi_spidar_solver_init(&belief->solver, model, start);
  belief->trial = belief->solver;
  belief->wrong = -1;
}

/* Rates of the strings [m/s] at the believed pose and twist. */
static void rates_expect(const hapi_spidar_belief *b, const hapi_spidar_rows *rows, int strings,
                         double out[HAPI_SPIDAR_STRINGS_MAX])
{
  for (int i = 0; i < strings; ++i) {
    out[i] = -hapi_v3_dot(rows->unit[i], b->twist.linear) -
             hapi_v3_dot(rows->moment[i], b->twist.angular);
  }
}

/* Strings that are not where they can have come to, as bits. */
static uint32_t strings_suspect(const hapi_spidar_belief *b, const hapi_spidar_model *model,
                                const double rates[HAPI_SPIDAR_STRINGS_MAX], double seconds,
                                const double lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  uint32_t suspects = 0;
  double t = hapi_min(seconds, HAPI_SAFETY_SILENCE_S);
  double bound = HAPI_SAFETY_STRING_SHARE * HAPI_SAFETY_ACCELERATION_LIMIT *
                 hapi_max(t, HAPI_SAFETY_JUDGE_S) * hapi_max(t, HAPI_SAFETY_JUDGE_S);
  for (int i = 0; b->known && i < model->strings; ++i) {
    double off = lengths[i] - b->length[i] - t * rates[i];
    suspects |= fabs(off) > bound + HAPI_SAFETY_QUANTA * metres_of(model, i) ? 1u << i : 0;
  }
  return suspects;
}

/* Whether all strings have the counts of an older reply; then this one is remembered, too. */
static bool is_known(hapi_spidar_belief *b, const hapi_spidar_model *model, bool off,
                     const double *counts)
{
  int32_t now[HAPI_SPIDAR_STRINGS_MAX] = {0};
  bool known = false;
  uint32_t count = b->replies < HAPI_SPIDAR_REPLIES ? b->replies : HAPI_SPIDAR_REPLIES;
  for (int i = 0; i < model->strings; ++i) {
    now[i] = (int32_t)counts[i];
  }
  for (uint32_t i = 0; off && i < count && !known; ++i) {
    known = memcmp(b->reply[i], now, sizeof now) == 0;
  }
  memcpy(b->reply[b->replies % HAPI_SPIDAR_REPLIES], now, sizeof now);
  ++b->replies;
  return known;
}

/* The course since the newest reply that is believed. */
static hapi_spidar_course course_now(const hapi_spidar_belief *b, int64_t time_ns,
                                     const double rates[HAPI_SPIDAR_STRINGS_MAX])
{
  hapi_spidar_course now = {
      .known = b->known, .time_ns = b->known ? b->believe_ns : time_ns, .twist = b->twist};
  memcpy(now.length, b->length, sizeof now.length);
  memcpy(now.rate, rates, sizeof now.rate);
  return now;
}

/* Some string is not where it was going, by more than a hand is likely to turn it from there. */
static bool is_off(const hapi_spidar_course *course, const hapi_spidar_model *model,
                   int64_t time_ns, const double lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  double seconds = 1e-9 * (double)(time_ns - course->time_ns);
  bool off = false;
  for (int i = 0; course->known && i < model->strings; ++i) {
    double way = lengths[i] - course->length[i] - seconds * course->rate[i];
    off = off || fabs(way) > HAPI_SAFETY_STALE_QUANTA * metres_of(model, i);
  }
  return off;
}

static double shorter_of(double a, double b)
{
  return a * b > 0.0 ? (fabs(a) < fabs(b) ? a : b) : 0.0;
}

/* Whether it is the reply before, though the strings run. */
static bool is_stale(hapi_spidar_belief *b, const hapi_spidar_model *model, int64_t time_ns,
                     const hapi_spidar_course *now, const double *counts)
{
  bool changed = !b->known;
  double finest = metres_of(model, 0);
  for (int i = 0; i < model->strings; ++i) {
    changed = changed || counts[i] != b->counts[i];
    b->counts[i] = counts[i];
    finest = hapi_min(finest, metres_of(model, i));
  }
  if (changed) {
    b->change_ns = time_ns;
    b->pace = 0.0;
    for (int i = 0; i < model->strings; ++i) {
      b->pace = hapi_max(fabs(shorter_of(now->rate[i], b->before.rate[i])), b->pace);
    }
    return false;
  }
  double way = b->pace * 1e-9 * (double)(time_ns - b->change_ns);
  return b->pace >= HAPI_SAFETY_STALE_SPEED && way >= HAPI_SAFETY_STALE_QUANTA * finest;
}

/* One more than the pose needs is left when one is left out. */
static bool can_spare(const hapi_spidar_model *model)
{
  return model->strings - 1 > model->dof;
}

static int string_alone(uint32_t strings)
{
  int string = -1;
  if (strings != 0 && (strings & (strings - 1)) == 0) {
    for (string = 0; (strings >> string & 1u) == 0; ++string) {
    }
  }
  return string;
}

/* The string without which the others fit; < 0: none of them, or more than one might be it. */
static int find_wrong(const hapi_spidar_belief *b, const hapi_spidar_model *model,
                      const double lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  hapi_spidar_diagnosis why;
  if (!can_spare(model)) {
    return -1;
  }
  hapi_spidar_diagnose(model, &b->solver.pose, lengths, &why);
  bool again = b->wrong >= 0 && (why.suspects >> b->wrong & 1u) != 0;
  return again ? b->wrong : string_alone(why.suspects);
}

static bool fits_without(hapi_spidar_belief *b, const hapi_spidar_model *model, int string,
                         const double lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  const uint32_t all = (1u << model->strings) - 1u;
  return hapi_spidar_solve_with(&b->trial, model, lengths, all & ~(1u << string)) ==
         HAPI_SPIDAR_FIT_GOOD;
}

/* The trial is it. Of a string that was left out, the length that it should have come to is taken,
 * and the count that belongs to that. A string that left its length was right before and keeps
 * what the calibration has it off by; of one that crept away nothing is known but the fit. */
static void trial_believe(hapi_spidar_belief *b, const hapi_spidar_model *model, int64_t time_ns,
                          const double *counts, const double *lengths, bool crept)
{
  double told[HAPI_SPIDAR_STRINGS_MAX];
  double rates[HAPI_SPIDAR_STRINGS_MAX];
  memcpy(told, counts, sizeof told);
  if (b->wrong >= 0) {
    int i = b->wrong;
    double before[HAPI_SPIDAR_STRINGS_MAX];
    double after[HAPI_SPIDAR_STRINGS_MAX];
    double right;
    hapi_spidar_lengths(model, &b->start, before);
    hapi_spidar_lengths(model, &b->trial.pose, after);
    right = crept ? after[i] : b->length[i] + after[i] - before[i];
    b->error = lengths[i] - right;
    memcpy(b->length, lengths, sizeof b->length);
    b->length[i] = right;
    told[i] = (right - model->offset[i]) / model->metres_per_count[i];
  } else {
    memcpy(b->length, lengths, sizeof b->length);
  }
  b->start = b->trial.pose;
  b->solver = b->trial;
  b->believe_ns = time_ns;
  b->known = true;
  hapi_spidar_rates_update(&b->rates, model, time_ns, told, rates);
  hapi_spidar_twist(model, &b->solver.pose, rates, &b->twist);
}

/* On as it went, no faster than a hand is sure to; then it stays. Of the newest two velocities the
 * smaller counts: the newest reply that was believed may have been false, too. */
static void pose_carry(hapi_spidar_belief *b, int64_t time_ns, double seconds)
{
  if (1e-9 * (double)(time_ns - b->believe_ns) > HAPI_SAFETY_CARRY_S) {
    memset(&b->twist, 0, sizeof b->twist);
    return;
  }
  for (int i = 0; i < 3; ++i) {
    b->twist.linear[i] = shorter_of(b->twist.linear[i], b->before.twist.linear[i]);
    b->twist.angular[i] = shorter_of(b->twist.angular[i], b->before.twist.angular[i]);
  }
  (void)hapi_v3_shorten(b->twist.linear, HAPI_SAFETY_CARRY_SPEED);
  (void)hapi_v3_shorten(b->twist.angular, HAPI_SAFETY_CARRY_SPIN);
  hapi_pose_move(&b->solver.pose, &b->twist, seconds);
}

hapi_spidar_verdict hapi_spidar_belief_update(hapi_spidar_belief *belief,
                                              const hapi_spidar_model *model, int64_t time_ns,
                                              const double counts[HAPI_SPIDAR_STRINGS_MAX],
                                              bool taut)
{
  hapi_spidar_belief *b = belief;
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  double rates[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_rows rows;
  double since_update = b->known ? 1e-9 * (double)(time_ns - b->update_ns) : 0.0;
  double since = b->known ? 1e-9 * (double)(time_ns - b->believe_ns) : 0.0;
  hapi_spidar_measure(model, counts, lengths);
  hapi_spidar_rows_at(model, &b->solver.pose, &rows);
  rates_expect(b, &rows, model->strings, rates);
  const hapi_spidar_course now = course_now(b, time_ns, rates);
  uint32_t suspects = strings_suspect(b, model, rates, since, lengths);
  bool stale = is_stale(b, model, time_ns, &now, counts);
  int wrong = taut && can_spare(model) ? string_alone(suspects) : -1;
  bool off = wrong < 0 && is_off(&now, model, time_ns, lengths) &&
             (!b->before.known || is_off(&b->before, model, time_ns, lengths));
  stale = is_known(b, model, off, counts) || stale;
  b->update_ns = time_ns;
  bool good = wrong >= 0 ? fits_without(b, model, wrong, lengths)
                         : hapi_spidar_solve(&b->trial, model, lengths) == HAPI_SPIDAR_FIT_GOOD;
  bool crept = false;
  if (!taut) {
    b->wrong = -1;
    b->before = now;
    trial_believe(b, model, time_ns, counts, lengths, false);
    return HAPI_SPIDAR_BELIEVED;
  }
  if (!good && wrong < 0) {
    wrong = find_wrong(b, model, lengths);
    crept = wrong >= 0;
    b->trial.pose = crept ? b->solver.pose : b->trial.pose;
    good = crept && fits_without(b, model, wrong, lengths);
  }
  bool several = suspects != 0 && string_alone(suspects) < 0;
  if (stale || several || !good) {
    b->wrong = -1;
    pose_carry(b, time_ns, since_update);
    return HAPI_SPIDAR_DOUBTED;
  }
  b->wrong = wrong;
  b->before = now;
  trial_believe(b, model, time_ns, counts, lengths, crept);
  return wrong >= 0 ? HAPI_SPIDAR_SPARED : HAPI_SPIDAR_BELIEVED;
}
