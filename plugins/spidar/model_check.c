/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a model must be before anything is computed with it. */

#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "plugins/spidar/kinematics.h"
#include "plugins/spidar/matrix.h"
#include "plugins/spidar/tensions.h"

#define POINT_MAX 10.0   /* m */
#define LENGTH_MIN 0.005 /* m, of a string at home */
#define APART 1e-4       /* m, between the ends of two strings */
#define TURN_LENGTH 0.02 /* m, as in kinematics.c */
/* Least eigenvalue of J^T J, in which a string counts 1 along its own direction: below it they
 * tell a direction seven times worse than one string tells its own. */
#define TELL_MIN 0.02
#define GRID 3
#define TURNS 54
#define UNBALANCED 0.2 /* of min_tension: what may be left */

typedef struct range {
  const char *name;
  double value;
  double least;
  double most;
} range;

static hap_status check_ranges(const range *ranges, size_t count, hap_detail *detail)
{
  for (size_t i = 0; i < count; ++i) {
    const range *r = &ranges[i];
    if (!(r->value >= r->least && r->value <= r->most)) {
      return hapi_fail(detail, HAP_ERROR_FORMAT, "%s is %g, not within %g .. %g", r->name, r->value,
                       r->least, r->most);
    }
  }
  return HAP_OK;
}

static hap_status check_name(const char *name, hap_detail *detail)
{
  static const char allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
  size_t length = strspn(name, allowed);
  if (memchr(name, '\0', sizeof((hapi_spidar_model *)NULL)->name) == NULL || length == 0 ||
      name[length] != '\0') {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "name: expected 1 to 31 letters, digits, '_', '-' or '.'");
  }
  return HAP_OK;
}

/* Figures that are for the whole device, with the names of the geometry file. */
static hap_status check_device(const hapi_spidar_model *m, hap_detail *detail)
{
  bool turns = m->dof == 6;
  const range ranges[] = {
      {"min_tension_n", m->min_tension, 0.001, 1e3},
      {"max_tension_n", m->max_tension, m->min_tension * 1.01, 1e3},
      {"tension_rate_n_per_s", m->tension_rate, 1.0, 1e7},
      {"torque_weight_per_m2", m->torque_weight, turns ? 1.0 : 0.0, turns ? 1e8 : 0.0},
      {"spread_weight", m->spread_weight, 1e-6, 10.0},
      {"centre_mm (here in m), x", m->centre[0], -POINT_MAX, POINT_MAX},
      {"centre_mm (here in m), y", m->centre[1], -POINT_MAX, POINT_MAX},
      {"centre_mm (here in m), z", m->centre[2], -POINT_MAX, POINT_MAX},
      {"workspace_mm (here in m), x", m->workspace[0], 1e-3, POINT_MAX},
      {"workspace_mm (here in m), y", m->workspace[1], 1e-3, POINT_MAX},
      {"workspace_mm (here in m), z", m->workspace[2], 1e-3, POINT_MAX},
      {"workspace_deg (here in rad)", m->workspace_turn, turns ? 0.01 : 0.0, turns ? 2.1 : 0.0},
      {"residual_mm (here in m)", m->residual, 1e-5, 0.1},
      {"heat_tension_n", m->heat_tension, m->min_tension * 1.01, 1e3},
      {"heat_time_s", m->heat_time, 1.0, 1e5},
      {"mass_kg", m->mass, 0.0, 1e2},
      {"damping_ns_per_m", m->damping, 0.0, 1e3},
      {"friction_n", m->friction, 0.0, 1e3},
  };
  if (m->strings < HAPI_SPIDAR_STRINGS_MIN || m->strings > HAPI_SPIDAR_STRINGS_MAX) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "strings is %d, not within 4 .. 8", m->strings);
  }
  if (m->dof != 3 && m->dof != 6) {
    return hapi_fail(detail, HAP_ERROR_FORMAT, "dof is %d, expected 3 or 6", m->dof);
  }
  if (turns && m->strings < 7) {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "%d strings cannot hold 6 dof, as strings only pull: 7 are needed, or dof = 3",
                     m->strings);
  }
  return check_ranges(ranges, sizeof ranges / sizeof ranges[0], detail);
}

static hap_status check_string(const hapi_spidar_model *m, int i, hap_detail *detail)
{
  char name[64];
  for (int axis = 0; axis < 3; ++axis) {
    if (!(fabs(m->motor[i][axis]) <= POINT_MAX && fabs(m->grip[i][axis]) <= POINT_MAX)) {
      return hapi_fail(detail, HAP_ERROR_FORMAT, "string_%d: a point is beyond 10 m or not finite",
                       i);
    }
  }
  snprintf(name, sizeof name, "string_%d.metres_per_count, without its sign,", i);
  const range scale = {name, fabs(m->metres_per_count[i]), 1e-8, 1e-2};
  hap_status status = check_ranges(&scale, 1, detail);
  if (status < HAP_OK) {
    return status;
  }
  snprintf(name, sizeof name, "string_%d.volts_per_newton, without its sign,", i);
  const range volts = {name, fabs(m->volts_per_newton[i]), 1e-4, 100.0};
  status = check_ranges(&volts, 1, detail);
  if (status >= HAP_OK && !(fabs(m->offset[i]) <= 1e3)) {
    status = hapi_fail(detail, HAP_ERROR_FORMAT, "string_%d: its offset is beyond 1 km", i);
  }
  return status;
}

static double points_apart(const double a[3], const double b[3])
{
  double way[3];
  hapi_v3_sub(a, b, way);
  return hapi_v3_norm(way);
}

/* Two strings that begin and end together tell and pull the same. */
static hap_status check_distinct(const hapi_spidar_model *m, hap_detail *detail)
{
  for (int i = 0; i < m->strings; ++i) {
    if (points_apart(m->motor[i], m->grip[i]) < LENGTH_MIN) {
      return hapi_fail(detail, HAP_ERROR_FORMAT,
                       "string_%d is shorter than 5 mm at home: its motor and its grip point meet",
                       i);
    }
    for (int k = 0; k < i; ++k) {
      if (points_apart(m->motor[i], m->motor[k]) < APART &&
          points_apart(m->grip[i], m->grip[k]) < APART) {
        return hapi_fail(detail, HAP_ERROR_FORMAT,
                         "string_%d and string_%d have the same motor and grip points", k, i);
      }
    }
  }
  return HAP_OK;
}

/* Whether every direction is told: J^T J - TELL_MIN is positive definite. */
static bool pose_is_told(const hapi_spidar_model *m, const hap_pose *pose)
{
  hapi_spidar_rows rows;
  hapi_spidar_matrix h;
  memset(h, 0, sizeof h);
  hapi_spidar_rows_at(m, pose, &rows);
  for (int a = 0; a < m->dof; ++a) {
    for (int b = 0; b <= a; ++b) {
      for (int i = 0; i < m->strings; ++i) {
        double x = a < 3 ? rows.unit[i][a] : rows.moment[i][a - 3] / TURN_LENGTH;
        double y = b < 3 ? rows.unit[i][b] : rows.moment[i][b - 3] / TURN_LENGTH;
        h[a][b] += x * y;
      }
    }
    h[a][a] -= TELL_MIN;
  }
  return hapi_spidar_cholesky(h, m->dof);
}

/* A grid of GRID points to each side over the workspace; not turned, and half and wholly turned
 * about the 26 directions to faces, edges and corners of a cube. */
static void sample_at(const hapi_spidar_model *m, int index, hap_pose *out)
{
  double axis[3];
  int turn = index % TURNS;
  int point = index / TURNS;
  for (int i = 0; i < 3; ++i, point /= GRID, turn /= 3) {
    double share = 2.0 * (point % GRID) / (GRID - 1) - 1.0;
    int digit = turn % 3;
    out->position[i] = m->centre[i] + share * m->workspace[i];
    axis[i] = digit - 1;
  }
  double size = hapi_v3_norm(axis);
  double half = size > 0.0 ? 0.5 * m->workspace_turn * (turn > 0 ? 0.5 : 1.0) : 0.0;
  out->quat_wxyz[0] = cos(half);
  hapi_v3_scale(size > 0.0 ? sin(half) / size : 0.0, axis, out->quat_wxyz + 1);
}

static hap_status check_workspace(const hapi_spidar_model *m, hap_detail *detail)
{
  for (int i = 0; i < GRID * GRID * GRID * TURNS; ++i) {
    hap_pose pose;
    sample_at(m, i, &pose);
    if (!pose_is_told(m, &pose)) {
      return hapi_fail(detail, HAP_ERROR_FORMAT,
                       "the strings do not tell the pose at %.3g %.3g %.3g mm turned by %.3g "
                       "degrees: make the workspace smaller, or look at the motor and grip points",
                       1e3 * pose.position[0], 1e3 * pose.position[1], 1e3 * pose.position[2],
                       2.0 * acos(fmin(1.0, fabs(pose.quat_wxyz[0]))) * 57.2957795);
    }
  }
  return HAP_OK;
}

/* Whether tensions within their limits can pull at the grip without moving it. */
static hap_status check_balance(const hapi_spidar_model *m, hap_detail *detail)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hapi_spidar_model free = *m;
  hapi_spidar_tensions state;
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  hap_pose pose;
  hap_wrench left;
  free.spread_weight = 1e-6;
  hapi_spidar_home(&pose);
  hapi_v3_copy(m->centre, pose.position);
  hapi_spidar_tensions_init(&state, &free);
  hap_status status = hapi_spidar_tensions_solve(&state, &free, &pose, &none, tension, &left);
  double force = hapi_v3_norm(left.force);
  double torque = hapi_v3_norm(left.torque);
  if (status < HAP_OK || force > UNBALANCED * m->min_tension ||
      torque > UNBALANCED * TURN_LENGTH * m->min_tension) {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "at the centre of the workspace the strings cannot hold the grip: within "
                     "their tensions %.3g N and %.3g N m are left; move centre_mm, or look at the "
                     "motor and grip points",
                     force, torque);
  }
  return HAP_OK;
}

hap_status hapi_spidar_model_check(const hapi_spidar_model *model, hap_detail *detail)
{
  hap_status status = check_name(model->name, detail);
  if (status >= HAP_OK) {
    status = check_device(model, detail);
  }
  for (int i = 0; status >= HAP_OK && i < model->strings; ++i) {
    status = check_string(model, i, detail);
  }
  if (status >= HAP_OK) {
    status = check_distinct(model, detail);
  }
  if (status >= HAP_OK) {
    status = check_balance(model, detail);
  }
  return status >= HAP_OK ? check_workspace(model, detail) : status;
}
