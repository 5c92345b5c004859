/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/tensions.h"

#include "base/assert.h"
#include "base/vec.h"

#define CAPABILITY_REACHED 0.9
#define SANE_MAX 1e6  /* m, N, N m */
#define DIRECTIONS 26 /* to faces, edges and corners of a cube */

void hapi_spidar_tensions_init(hapi_spidar_tensions *state, const hapi_spidar_model *model)
{
  memset(state, 0, sizeof *state);
  for (int i = 0; i < HAPI_SPIDAR_STRINGS_MAX; ++i) {
    state->most[i] = model->max_tension;
    state->at[i] = HAPI_SPIDAR_AT_LOW;
  }
}

static void wrench_of(const hapi_spidar_model *model, const hapi_spidar_rows *rows,
                      const double *tension, hap_wrench *out)
{
  memset(out, 0, sizeof *out);
  for (int i = 0; i < model->strings; ++i) {
    hapi_v3_madd(out->force, tension[i], rows->unit[i], out->force);
    hapi_v3_madd(out->torque, tension[i], rows->moment[i], out->torque);
  }
}

void hapi_spidar_wrench(const hapi_spidar_model *model, const hap_pose *pose,
                        const double tension[HAPI_SPIDAR_STRINGS_MAX], hap_wrench *out)
{
  hapi_spidar_rows rows;
  hapi_spidar_rows_at(model, pose, &rows);
  wrench_of(model, &rows, tension, out);
}

static void set_matrix(const hapi_spidar_model *model, const hapi_spidar_rows *rows,
                       const hap_wrench *wanted, hapi_spidar_box_qp *qp)
{
  HAPI_ASSERT(model->strings > 0 && model->strings <= HAPI_SPIDAR_STRINGS_MAX);
  double weight = model->torque_weight;
  qp->n = model->strings;
  for (int i = 0; i < qp->n; ++i) {
    double scaled[3];
    hapi_v3_scale(weight, rows->moment[i], scaled);
    qp->g[i] = hapi_v3_dot(rows->unit[i], wanted->force) + hapi_v3_dot(scaled, wanted->torque);
    for (int k = 0; k <= i; ++k) {
      qp->h[i][k] =
          hapi_v3_dot(rows->unit[i], rows->unit[k]) + hapi_v3_dot(scaled, rows->moment[k]);
    }
    qp->h[i][i] += model->spread_weight;
  }
}

/* What the string may do now. The rate goes before min_tension, which a string comes to from below
 * at the start, and after most, which is there to save a motor. */
static void set_box(const hapi_spidar_tensions *state, const hapi_spidar_model *model,
                    hapi_spidar_box_qp *qp)
{
  double step = state->seconds > 0.0 ? model->tension_rate * state->seconds : HUGE_VAL;
  for (int i = 0; i < qp->n; ++i) {
    bool room = state->most[i] >= model->min_tension; /* false for NaN */
    double most = room ? fmin(model->max_tension, state->most[i]) : model->min_tension;
    double high = fmin(most, state->tension[i] + step);
    double low = fmax(model->min_tension, state->tension[i] - step);
    qp->high[i] = high;
    qp->low[i] = fmin(low, high);
  }
}

static bool is_saturated(const hapi_spidar_box_qp *qp, const hapi_spidar_at *at)
{
  bool saturated = false;
  for (int i = 0; i < qp->n; ++i) {
    saturated = saturated || at[i] == HAPI_SPIDAR_AT_HIGH;
  }
  return saturated;
}

/* Finite, and so that their squares are. */
static bool is_sane(const double *values, int count)
{
  bool sane = true;
  for (int i = 0; i < count; ++i) {
    sane = sane && fabs(values[i]) <= SANE_MAX;
  }
  return sane;
}

hap_status hapi_spidar_tensions_solve(hapi_spidar_tensions *state, const hapi_spidar_model *model,
                                      const hap_pose *pose, const hap_wrench *wanted,
                                      double out_tension[HAPI_SPIDAR_STRINGS_MAX],
                                      hap_wrench *reached)
{
  static const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hapi_spidar_rows rows;
  hapi_spidar_box_qp qp;
  bool finite = is_sane(wanted->force, 3) && (model->dof == 3 || is_sane(wanted->torque, 3));
  bool placed = is_sane(pose->position, 3) && is_sane(pose->quat_wxyz, 4);
  if (placed) {
    hapi_spidar_rows_at(model, pose, &rows);
    set_matrix(model, &rows, finite ? wanted : &none, &qp);
    set_box(state, model, &qp);
    state->changes = hapi_spidar_box_qp_solve(&qp, state->at, state->tension);
  }
  memcpy(out_tension, state->tension, sizeof state->tension);
  if (reached != NULL) {
    *reached = none;
    if (placed) {
      wrench_of(model, &rows, state->tension, reached);
    }
  }
  if (!placed || !finite) {
    return HAP_ERROR_ARGUMENT;
  }
  return is_saturated(&qp, state->at) ? HAP_SATURATED : HAP_OK;
}

/* ---- capability ---- */

static void direction_of(int index, double out[3])
{
  HAPI_ASSERT_INDEX(index, DIRECTIONS);
  int code = index < DIRECTIONS / 2 ? index : index + 1; /* not the middle of the cube */
  const double digits[3] = {-1.0, 0.0, 1.0};
  hapi_v3_set(out, digits[code % 3], digits[code / 3 % 3], digits[code / 9]);
  hapi_v3_scale(1.0 / hapi_v3_norm(out), out, out);
}

static bool model_gives(const hapi_spidar_model *model, bool torque, double size)
{
  hapi_spidar_tensions state;
  hap_pose pose;
  bool all = true;
  hapi_spidar_tensions_init(&state, model);
  hapi_spidar_home(&pose);
  hapi_v3_copy(model->centre, pose.position);
  for (int i = 0; i < model->strings; ++i) {
    state.most[i] = model->heat_tension;
  }
  for (int k = 0; k < DIRECTIONS && all; ++k) {
    double tension[HAPI_SPIDAR_STRINGS_MAX];
    double direction[3];
    hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hap_wrench reached;
    direction_of(k, direction);
    hapi_v3_scale(size, direction, torque ? wanted.torque : wanted.force);
    all = hapi_spidar_tensions_solve(&state, model, &pose, &wanted, tension, &reached) >= HAP_OK &&
          hapi_v3_dot(torque ? reached.torque : reached.force, direction) >=
              CAPABILITY_REACHED * size;
  }
  return all;
}

static double wrench_largest(const hapi_spidar_model *model, bool torque)
{
  double low = 0.0;
  double high = model->max_tension * model->strings;
  for (int i = 0; i < 40; ++i) {
    double middle = 0.5 * (low + high);
    *(model_gives(model, torque, middle) ? &low : &high) = middle;
  }
  return low;
}

void hapi_spidar_capability(const hapi_spidar_model *model, double *out_force, double *out_torque)
{
  *out_force = wrench_largest(model, false);
  *out_torque = model->dof == 6 ? wrench_largest(model, true) : 0.0;
}
