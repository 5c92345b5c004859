/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/seen.h"

#include <math.h>
#include <string.h>

#include "base/pose.h"
#include "base/vec.h"

#define HIT_S 1e-3     /* shorter times say no more: noise is the same at every rate */
#define LONGEST_S 0.02 /* for longer a hand may do anything */
#define ARM 0.02       /* m, makes an angle a length like the others */
#define UNKNOWNS 6     /* position and turn */
#define ROUNDINGS 2.0  /* of x - 2 x + x: half a quantum each */
#define DEPENDENT 1e-9 /* what is left of a column that depends on the others */

bool seen_motion_take(seen_motion *m, const seen_bounds *bounds, const double *told, int ways)
{
  bool seen = false;
  memcpy(m->told[m->count % SEEN_KEPT], told, (size_t)ways * sizeof *told);
  int64_t longest = llround(LONGEST_S / bounds->period);
  for (int64_t n = llround(ceil(HIT_S / bounds->period - 1e-6)); n <= longest; ++n) {
    if (2 * n > m->count || 2 * n >= SEEN_KEPT) {
      break;
    }
    const double *before = m->told[(m->count - n) % SEEN_KEPT];
    const double *first = m->told[(m->count - 2 * n) % SEEN_KEPT];
    double h = (double)n * bounds->period;
    double most = bounds->swing * h * h + (bounds->hit - bounds->swing) * HIT_S * h +
                  ROUNDINGS * bounds->quantum;
    for (int i = 0; i < ways; ++i) {
      seen = seen || fabs(told[i] - 2.0 * before[i] + first[i]) > most;
    }
  }
  ++m->count;
  return seen;
}

/* Of the strings: how fast each shortens as the grip moves and turns. */
static void columns_at(const double (*motor)[3], const double (*grip)[3], const hap_pose *pose,
                       double out[UNKNOWNS][SEEN_WAYS])
{
  for (int i = 0; i < SEEN_WAYS; ++i) {
    double arm[3];
    double way[3];
    double moment[3];
    hapi_quat_rotate(pose->quat_wxyz, grip[i], arm);
    hapi_v3_add(arm, pose->position, way);
    hapi_v3_sub(motor[i], way, way);
    hapi_v3_scale(1.0 / hapi_v3_norm(way), way, way);
    hapi_v3_cross(arm, way, moment);
    for (int k = 0; k < 3; ++k) {
      out[k][i] = way[k];
      out[3 + k][i] = moment[k] / ARM;
    }
  }
}

static double columns_dot(const double a[SEEN_WAYS], const double b[SEEN_WAYS])
{
  double sum = 0.0;
  for (int i = 0; i < SEEN_WAYS; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

static void column_leave(const double unit[SEEN_WAYS], double io[SEEN_WAYS])
{
  double along = columns_dot(unit, io);
  for (int i = 0; i < SEEN_WAYS; ++i) {
    io[i] -= along * unit[i];
  }
}

double seen_misfit(const double (*motor)[3], const double (*grip)[3], const hap_pose *pose,
                   const double error[SEEN_WAYS])
{
  double columns[UNKNOWNS][SEEN_WAYS];
  double left[SEEN_WAYS];
  double worst = 0.0;
  memcpy(left, error, sizeof left);
  columns_at(motor, grip, pose, columns);
  for (int k = 0; k < UNKNOWNS; ++k) {
    for (int before = 0; before < k; ++before) {
      column_leave(columns[before], columns[k]);
    }
    double norm = sqrt(columns_dot(columns[k], columns[k]));
    for (int i = 0; i < SEEN_WAYS; ++i) {
      columns[k][i] = norm > DEPENDENT ? columns[k][i] / norm : 0.0;
    }
    column_leave(columns[k], left);
  }
  for (int i = 0; i < SEEN_WAYS; ++i) {
    worst = fmax(worst, fabs(left[i]));
  }
  return worst;
}
