/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/accuracy.h"

#define LINES 6        /* the physics rate and 5 harmonics */
#define LINE_STEPS 4.0 /* a line is 2 / window wide to either side */
#define CHANNELS (SCENE_POINTERS_MAX * 3)
#define REST_SPEED 0.01 /* of the hand's largest speed */

static double norm(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double distance(const double a[3], const double b[3])
{
  return norm((const double[3]){a[0] - b[0], a[1] - b[1], a[2] - b[2]});
}

static bool touches(const accuracy_frame *f)
{
  for (size_t i = 0; i < CHANNELS; ++i) {
    if (f->force[i / 3][i % 3] != 0.0) {
      return true;
    }
  }
  return false;
}

static double difference(const accuracy_frame *a, const accuracy_frame *b, size_t channel)
{
  return a->force[channel / 3][channel % 3] - b->force[channel / 3][channel % 3];
}

/* ---- forces ---- */

typedef struct sums {
  double error;        /* N^2 */
  double reference;    /* N^2 */
  double torque_error; /* N^2 m^2 */
  double torque;       /* N^2 m^2, of the reference */
  double impulse[2];
  double peak[2];
  size_t ticks;
} sums;

static void add_norms(const accuracy_frame *f, double *impulse, double *peak)
{
  for (size_t i = 0; i < SCENE_POINTERS_MAX; ++i) {
    double force = norm(f->force[i]);
    *impulse += force;
    *peak = fmax(*peak, force);
  }
}

static void add_tick(const accuracy_frame *reference, const accuracy_frame *test, sums *s)
{
  if (!touches(reference) && !touches(test)) {
    return;
  }
  for (size_t i = 0; i < CHANNELS; ++i) {
    double e = difference(test, reference, i);
    double f = reference->force[i / 3][i % 3];
    s->error += e * e;
    s->reference += f * f;
    double torque = reference->torque[i / 3][i % 3];
    double other = test->torque[i / 3][i % 3];
    s->torque_error += (other - torque) * (other - torque);
    s->torque += torque * torque;
  }
  add_norms(reference, &s->impulse[0], &s->peak[0]);
  add_norms(test, &s->impulse[1], &s->peak[1]);
  ++s->ticks;
}

/* ---- lines ---- */

/* Amplitude of the difference at a frequency, N. The window from the first to the last tick with contact, faded at both ends (Hann): what drifts
 * over it, and ends where it did not begin, would else look like a line. */
static double line_at(const accuracy_motion *reference, const accuracy_motion *test,
                      const size_t window[2], double hz)
{
  double re[CHANNELS] = {0.0};
  double im[CHANNELS] = {0.0};
  double weights = 0.0;
  double power = 0.0;
  double length = (double)(window[1] - window[0]);
  for (size_t t = window[0]; t < window[1]; ++t) {
    double w = 0.5 - 0.5 * cos(2.0 * M_PI * ((double)(t - window[0]) + 0.5) / length);
    double phase = 2.0 * M_PI * hz * (double)t / ACCURACY_HAPTIC_HZ;
    weights += w;
    for (size_t i = 0; i < CHANNELS; ++i) {
      double e = w * difference(&test->frames[t], &reference->frames[t], i);
      re[i] += e * cos(phase);
      im[i] += e * sin(phase);
    }
  }
  for (size_t i = 0; i < CHANNELS; ++i) {
    power += re[i] * re[i] + im[i] * im[i];
  }
  return 2.0 * sqrt(power) / weights;
}

/* A line is what stands out of its surroundings, here those half way to its neighbours: an impact
 * that is a tick late is in all frequencies alike. Two impacts make a spectrum of hills and valleys,
 * and a harmonic may lie on a hill: what a run at another physics rate has there as well is no line
 * of this one. False: the window is too short to tell the two apart. */
static bool largest_line(const accuracy_motion *reference, const accuracy_motion *test,
                         const accuracy_motion *control, double physics_hz, double *out)
{
  size_t window[2] = {reference->count, 0};
  for (size_t t = 0; t < reference->count; ++t) {
    if (touches(&reference->frames[t]) || touches(&test->frames[t])) {
      window[0] = t < window[0] ? t : window[0];
      window[1] = t + 1;
    }
  }
  *out = 0.0;
  if ((double)(window[1] - window[0]) < LINE_STEPS * ACCURACY_HAPTIC_HZ / physics_hz) {
    return false;
  }
  double before = line_at(reference, test, window, 0.5 * physics_hz);
  for (int i = 1; i <= LINES && (i + 0.5) * physics_hz < 0.5 * ACCURACY_HAPTIC_HZ; ++i) {
    double line = line_at(reference, test, window, i * physics_hz);
    double after = line_at(reference, test, window, (i + 0.5) * physics_hz);
    double around = before * after;
    if (control != NULL) {
      double other = line_at(reference, control, window, i * physics_hz);
      around = fmax(around, other * other);
    }
    *out = fmax(*out, sqrt(fmax(0.0, line * line - around)));
    before = after;
  }
  return true;
}

/* ---- poses ---- */

static bool compare_poses(const accuracy_motion *reference, const accuracy_motion *test,
                          accuracy_errors *out)
{
  double *distances = calloc(test->count * test->bodies + 1, sizeof *distances);
  size_t count = 0;
  if (distances == NULL) {
    return false;
  }
  for (size_t t = 0; t < test->count; ++t) {
    for (size_t i = 0; i < test->bodies; ++i) {
      if ((test->frames[t].local >> i & 1u) != 0) {
        distances[count] = distance(test->frames[t].body[i], reference->frames[t].body[i]);
        ++count;
      }
    }
  }
  out->pose_median = bench_median(distances, count);
  out->pose_max = bench_quantile(distances, count, 1.0);
  free(distances);
  return true;
}

bool accuracy_compare(const accuracy_motion *reference, const accuracy_motion *test,
                      const accuracy_motion *control, double physics_hz, accuracy_errors *out)
{
  sums s = {0};
  memset(out, 0, sizeof *out);
  for (size_t t = 0; t < reference->count; ++t) {
    add_tick(&reference->frames[t], &test->frames[t], &s);
  }
  if (!(s.reference > 0.0)) {
    return false;
  }
  out->force = sqrt(s.error / s.reference);
  out->torque = s.torque > 0.0 ? sqrt(s.torque_error / s.torque) : 0.0;
  out->force_rms = sqrt(s.reference / (double)s.ticks);
  out->impulse_ratio = s.impulse[1] / s.impulse[0];
  out->peak_ratio = s.peak[1] / s.peak[0];
  out->lines = largest_line(reference, test, control, physics_hz, &out->line_n) ? 1.0 : 0.0;
  out->joint_loop = test->joints_loop.way;
  out->joint_world = test->joints_world.way;
  out->joint_left = test->joints_left.way;
  out->joint_turn = fmax(test->joints_loop.turn, test->joints_world.turn);
  return compare_poses(reference, test, out);
}

/* ---- the hand ---- */

static double speed_at(const accuracy_motion *m, size_t t)
{
  double fastest = 0.0;
  for (size_t i = 0; i < SCENE_POINTERS_MAX; ++i) {
    fastest = fmax(fastest, distance(m->frames[t].hand[i], m->frames[t - 1].hand[i]));
  }
  return fastest * ACCURACY_HAPTIC_HZ;
}

double accuracy_hand_speed(const accuracy_motion *m)
{
  double fastest = 0.0;
  for (size_t t = 1; t < m->count; ++t) {
    fastest = fmax(fastest, speed_at(m, t));
  }
  return fastest;
}

double accuracy_rest_share(const accuracy_motion *m)
{
  double slow = REST_SPEED * accuracy_hand_speed(m);
  size_t touched = 0;
  size_t rested = 0;
  for (size_t t = 1; t < m->count; ++t) {
    if (touches(&m->frames[t])) {
      ++touched;
      rested += speed_at(m, t) <= slow;
    }
  }
  return touched > 0 ? (double)rested / (double)touched : 0.0;
}
