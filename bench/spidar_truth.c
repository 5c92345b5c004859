/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/spidar_truth.h"

#include "base/pose.h"

#define TURN_LENGTH 0.02 /* m, to weigh turns like lengths */

double spidar_random(uint64_t *seed)
{
  *seed = *seed * 6364136223846793005ull + 1442695040888963407ull;
  uint64_t mixed = *seed ^ (*seed >> 29);
  mixed = mixed * 0xbf58476d1ce4e5b9ull;
  mixed ^= mixed >> 32;
  return 2.0 * ((double)(mixed >> 11) / 9007199254740992.0) - 1.0;
}

static void random_axis(uint64_t *seed, double out[3])
{
  double v[3] = {0.0, 0.0, 0.0};
  double size = 0.0;
  while (size < 0.1 || size > 1.0) {
    for (int i = 0; i < 3; ++i) {
      v[i] = spidar_random(seed);
    }
    size = hapi_v3_norm(v);
  }
  hapi_v3_scale(1.0 / size, v, out);
}

static void turn_to(const double axis[3], double angle, double quat[4])
{
  quat[0] = cos(0.5 * angle);
  hapi_v3_scale(sin(0.5 * angle), axis, quat + 1);
}

void spidar_random_pose(const hapi_spidar_model *model, double share, uint64_t *seed, hap_pose *out)
{
  double axis[3];
  random_axis(seed, axis);
  turn_to(axis, share * model->workspace_turn * spidar_random(seed), out->quat_wxyz);
  for (int i = 0; i < 3; ++i) {
    out->position[i] = model->centre[i] + share * model->workspace[i] * spidar_random(seed);
  }
}

/* Two unit vectors across each other. */
static void random_pair(uint64_t *seed, double out[2][3])
{
  random_axis(seed, out[0]);
  do {
    random_axis(seed, out[1]);
    hapi_v3_cross(out[0], out[1], out[1]);
  } while (hapi_v3_norm(out[1]) < 0.1);
  hapi_v3_scale(1.0 / hapi_v3_norm(out[1]), out[1], out[1]);
}

void spidar_motion_init(spidar_motion *motion, const hapi_spidar_model *model, double speed,
                        double turn_speed, uint64_t *seed)
{
  double least = fmin(model->workspace[0], fmin(model->workspace[1], model->workspace[2]));
  double radius = least * (0.3 + 0.2 * fabs(spidar_random(seed)));
  for (int i = 0; i < 3; ++i) {
    double room = model->workspace[i] - radius;
    motion->middle[i] = model->centre[i] + room * spidar_random(seed);
  }
  random_pair(seed, motion->across);
  hapi_v3_scale(radius, motion->across[0], motion->across[0]);
  hapi_v3_scale(radius, motion->across[1], motion->across[1]);
  motion->hz = speed / radius;
  random_pair(seed, motion->axis);
  motion->turn = model->workspace_turn * (0.6 + 0.4 * fabs(spidar_random(seed)));
  motion->turn_hz = motion->turn > 0.0 ? turn_speed / (2.0 * sin(0.5 * motion->turn)) : 0.0;
}

static void pair_at(const double pair[2][3], double angle, double out[3])
{
  hapi_v3_scale(cos(angle), pair[0], out);
  hapi_v3_madd(out, sin(angle), pair[1], out);
}

void spidar_motion_at(const spidar_motion *motion, double time, hap_pose *pose)
{
  double axis[3];
  pair_at(motion->across, motion->hz * time, pose->position);
  hapi_v3_add(pose->position, motion->middle, pose->position);
  pair_at(motion->axis, motion->turn_hz * time, axis);
  turn_to(axis, motion->turn, pose->quat_wxyz);
}

void spidar_motion_twist(const spidar_motion *motion, double time, hap_twist *out)
{
  const double h = 1e-5;
  hap_pose before;
  hap_pose after;
  double turn[4];
  spidar_motion_at(motion, time - h, &before);
  spidar_motion_at(motion, time + h, &after);
  hapi_v3_sub(after.position, before.position, out->linear);
  hapi_v3_scale(0.5 / h, out->linear, out->linear);
  double back[4] = {before.quat_wxyz[0], -before.quat_wxyz[1], -before.quat_wxyz[2],
                    -before.quat_wxyz[3]};
  hapi_quat_multiply(after.quat_wxyz, back, turn);
  hapi_v3_scale(1.0 / h, turn + 1, out->angular);
}

void spidar_counts(const hapi_spidar_model *model, const hap_pose *pose,
                   double out_counts[HAPI_SPIDAR_STRINGS_MAX])
{
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_lengths(model, pose, lengths);
  for (int i = 0; i < model->strings; ++i) {
    out_counts[i] = rint((lengths[i] - model->offset[i]) / model->metres_per_count[i]);
  }
}

double spidar_distance(const hap_pose *a, const hap_pose *b)
{
  double way[3];
  hapi_v3_sub(a->position, b->position, way);
  return hapi_v3_norm(way);
}

double spidar_turn_between(const hap_pose *a, const hap_pose *b)
{
  double turn[4];
  double back[4] = {b->quat_wxyz[0], -b->quat_wxyz[1], -b->quat_wxyz[2], -b->quat_wxyz[3]};
  hapi_quat_multiply(a->quat_wxyz, back, turn);
  return 2.0 * atan2(hapi_v3_norm(turn + 1), fabs(turn[0]));
}

/* ---- rounding ---- */

/* Gauss and Jordan with the largest pivot: a x = b for several right sides, in b. */
static bool rows_eliminate(double a[8][8], int n, double b[8][8], int columns)
{
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i) {
      best = fabs(a[i][k]) > fabs(a[best][k]) ? i : best;
    }
    if (!(fabs(a[best][k]) > 1e-12)) {
      return false;
    }
    for (int c = 0; c < 8; ++c) {
      double x = a[k][c];
      a[k][c] = a[best][c];
      a[best][c] = x;
      x = b[k][c];
      b[k][c] = b[best][c];
      b[best][c] = x;
    }
    for (int i = 0; i < n; ++i) {
      double share = i == k ? 0.0 : a[i][k] / a[k][k];
      for (int c = 0; c < n; ++c) {
        a[i][c] -= share * a[k][c];
      }
      for (int c = 0; c < columns; ++c) {
        b[i][c] -= share * b[k][c];
      }
    }
  }
  for (int k = 0; k < n; ++k) {
    for (int c = 0; c < columns; ++c) {
      b[k][c] /= a[k][k];
    }
  }
  return true;
}

/* out[a][i]: what unknown a moves by for each metre that string i is measured too long. */
static bool pseudo_inverse(const hapi_spidar_model *model, const hap_pose *pose, double out[8][8])
{
  hapi_spidar_rows rows;
  double normal[8][8] = {{0.0}};
  hapi_spidar_rows_at(model, pose, &rows);
  memset(out, 0, 64 * sizeof(double));
  for (int i = 0; i < model->strings; ++i) {
    for (int a = 0; a < model->dof; ++a) {
      double x = a < 3 ? rows.unit[i][a] : rows.moment[i][a - 3] / TURN_LENGTH;
      out[a][i] = -x;
      for (int b = 0; b < model->dof; ++b) {
        normal[a][b] += x * (b < 3 ? rows.unit[i][b] : rows.moment[i][b - 3] / TURN_LENGTH);
      }
    }
  }
  return rows_eliminate(normal, model->dof, out, model->strings);
}

void spidar_rounding_bound(const hapi_spidar_model *model, const hap_pose *pose,
                           double *out_position, double *out_turn)
{
  double inverse[8][8];
  *out_position = *out_turn = HUGE_VAL;
  if (!pseudo_inverse(model, pose, inverse)) {
    return;
  }
  *out_position = *out_turn = 0.0;
  for (unsigned signs = 0; signs < 1u << model->strings; ++signs) {
    double moved[6] = {0.0};
    for (int a = 0; a < model->dof; ++a) {
      for (int i = 0; i < model->strings; ++i) {
        double half = 0.5 * fabs(model->metres_per_count[i]);
        moved[a] += inverse[a][i] * ((signs >> i & 1u) != 0 ? half : -half);
      }
    }
    *out_position = fmax(*out_position, hapi_v3_norm(moved));
    *out_turn = fmax(*out_turn, hapi_v3_norm(moved + 3) / TURN_LENGTH);
  }
}

/* ---- the box ---- */

static double qp_entry(const hapi_spidar_box_qp *qp, int i, int k)
{
  return i >= k ? qp->h[i][k] : qp->h[k][i];
}

static double qp_gradient(const hapi_spidar_box_qp *qp, const double *x, int i)
{
  double sum = -qp->g[i];
  for (int k = 0; k < qp->n; ++k) {
    sum += qp_entry(qp, i, k) * x[k];
  }
  return sum;
}

double spidar_cost(const hapi_spidar_box_qp *qp, const double *x)
{
  double sum = 0.0;
  for (int i = 0; i < qp->n; ++i) {
    sum += 0.5 * x[i] * (qp_gradient(qp, x, i) - qp->g[i]);
  }
  return sum;
}

double spidar_gap(const hapi_spidar_box_qp *qp, const double *x)
{
  double sum = 0.0;
  for (int i = 0; i < qp->n; ++i) {
    double slope = qp_gradient(qp, x, i);
    sum += slope * (x[i] - (slope > 0.0 ? qp->low[i] : qp->high[i]));
  }
  return sum;
}

/* x for one set, digits of code to the base 3: low, high, free. False: not a minimum. */
static bool try_set(const hapi_spidar_box_qp *qp, int code, double *x)
{
  double a[8][8] = {{0.0}};
  double b[8][8] = {{0.0}};
  int kind[8] = {0};
  int free[8] = {0};
  int count = 0;
  for (int i = 0; i < qp->n; ++i, code /= 3) {
    kind[i] = code % 3;
    x[i] = kind[i] == 0 ? qp->low[i] : kind[i] == 1 ? qp->high[i] : 0.0;
    if (kind[i] == 2) {
      free[count++] = i;
    }
  }
  for (int r = 0; r < count; ++r) {
    b[r][0] = -qp_gradient(qp, x, free[r]);
    for (int c = 0; c < count; ++c) {
      a[r][c] = qp_entry(qp, free[r], free[c]);
    }
  }
  bool good = rows_eliminate(a, count, b, 1);
  for (int r = 0; r < count && good; ++r) {
    double value = b[r][0];
    x[free[r]] = value;
    good = value >= qp->low[free[r]] - 1e-9 && value <= qp->high[free[r]] + 1e-9;
  }
  for (int i = 0; i < qp->n && good; ++i) {
    double slope = qp_gradient(qp, x, i);
    good = kind[i] == 2 || (kind[i] == 0 ? slope >= -1e-9 : slope <= 1e-9);
  }
  return good;
}

bool spidar_brute_force(const hapi_spidar_box_qp *qp, double out_x[HAPI_SPIDAR_ORDER_MAX])
{
  int sets = 1;
  for (int i = 0; i < qp->n; ++i) {
    sets *= 3;
  }
  for (int code = 0; code < sets; ++code) {
    if (try_set(qp, code, out_x)) {
      return true;
    }
  }
  return false;
}

static void random_box(uint64_t *seed, hapi_spidar_box_qp *out)
{
  double kind = spidar_random(seed);
  for (int i = 0; i < out->n; ++i) {
    double a = 10.0 + 10.0 * spidar_random(seed);
    double b = 10.0 + 10.0 * spidar_random(seed);
    out->low[i] = kind < 0.0 ? 0.2 : fmin(a, b);
    out->high[i] = kind < 0.0 ? 20.0 : fmax(a, b);
    if (kind > 0.8) {
      out->high[i] = out->low[i] + (kind > 0.9 ? 0.0 : 1e-6);
    }
  }
}

void spidar_random_qp(const hapi_spidar_model *model, uint64_t *seed, hapi_spidar_box_qp *out)
{
  double size = pow(10.0, 1.5 * spidar_random(seed));
  double rows[6][8];
  double wanted[6];
  memset(out, 0, sizeof *out);
  out->n = model != NULL ? model->strings : 1 + (int)(3.999 * (1.0 + spidar_random(seed)));
  hap_pose pose;
  hapi_spidar_rows strings;
  memset(&strings, 0, sizeof strings);
  if (model != NULL) {
    spidar_random_pose(model, 1.0, seed, &pose);
    hapi_spidar_rows_at(model, &pose, &strings);
  }
  for (int a = 0; a < 6; ++a) {
    wanted[a] = size * spidar_random(seed);
    for (int i = 0; i < out->n; ++i) {
      rows[a][i] = model == NULL ? spidar_random(seed)
                   : a < 3       ? strings.unit[i][a]
                                 : strings.moment[i][a - 3] * sqrt(model->torque_weight);
    }
  }
  for (int i = 0; i < out->n; ++i) {
    for (int k = 0; k <= i; ++k) {
      out->h[i][k] = i == k ? (model != NULL ? model->spread_weight : 0.01) : 0.0;
      for (int a = 0; a < 6; ++a) {
        out->h[i][k] += rows[a][i] * rows[a][k];
      }
    }
    for (int a = 0; a < 6; ++a) {
      out->g[i] += rows[a][i] * wanted[a];
    }
  }
  random_box(seed, out);
}
