/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/spidar/kinematics.h"

#include "base/assert.h"
#include "base/vec.h"
#include "plugins/spidar/matrix.h"

#define TURN_LENGTH 0.02 /* m, makes an angle a length like the others; near the grips' radii */
#define STEPS 6          /* of one call */
#define STEPS_ALONE 24   /* of one string left out */
#define STEP_MAX 0.01    /* m */
#define TURN_MAX 0.3     /* rad, of a step */
/* m. After a step of this size what is left is below 1/50 of a count: 1/100 of the step by the
 * damping, its square over some 50 mm by the curvature. */
#define STILL 2e-5
/* Damping over the gradient: leaves a share of step / (10 TURN_LENGTH) of the way, which vanishes
 * with it, as the error of the linearisation does. */
#define DAMPING (0.1 / TURN_LENGTH)
#define DAMPING_MOST 1e6
#define FLOOR 1e-12 /* of the matrix: it can be inverted where the strings fail to tell the pose */
#define BEYOND \
  0.6981317008 /* rad, 40 degrees: a pose may be turned by as much more than the workspace */
/* Without a suspect the others fit about as well as without the best one. */
#define SUSPECT_RATIO 3.0
#define SUSPECT_SHARE 0.05 /* of model.residual */
#define TURN_ENDS 3.0      /* rad */
#define WORKSPACES 2.0     /* to each side, as far may the grip be besides */

void hapi_spidar_home(hap_pose *out)
{
  *out = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
}

void hapi_spidar_rows_at(const hapi_spidar_model *model, const hap_pose *pose,
                         hapi_spidar_rows *out)
{
  HAPI_ASSERT(model->strings > 0 && model->strings <= HAPI_SPIDAR_STRINGS_MAX);
  HAPI_ASSERT(model->dof == 3 || model->dof == 6);
  double turn[9];
  hapi_quat_to_matrix(pose->quat_wxyz, turn);
  for (int i = 0; i < model->strings; ++i) {
    double arm[3];
    double way[3];
    hapi_m3_apply(turn, model->grip[i], arm);
    hapi_v3_sub(model->motor[i], pose->position, way);
    hapi_v3_sub(way, arm, way);
    double length = hapi_v3_norm(way);
    out->length[i] = length;
    hapi_v3_scale(length > 0.0 ? 1.0 / length : 0.0, way, out->unit[i]);
    if (model->dof == 6) {
      hapi_v3_cross(arm, out->unit[i], out->moment[i]);
    } else {
      hapi_v3_set(out->moment[i], 0.0, 0.0, 0.0);
    }
  }
}

void hapi_spidar_lengths(const hapi_spidar_model *model, const hap_pose *pose,
                         double out_lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  hapi_spidar_rows rows;
  hapi_spidar_rows_at(model, pose, &rows);
  for (int i = 0; i < model->strings; ++i) {
    out_lengths[i] = rows.length[i];
  }
}

/* ---- least squares ---- */

/* Unknowns: position, then turn (world axes, left) times TURN_LENGTH. */
typedef struct normal {
  int n;
  hapi_spidar_matrix h; /* J^T J */
  double g[6];          /* J^T r, r = length at the pose - measured length */
  double cost;          /* r^T r */
  double worst;         /* largest |r| */
} normal;

/* n is a constant where it is called, here and below: the loops are unrolled for 3 and for 6. */
static inline void add_row(normal *e, int n, const double *row, double r)
{
  for (int a = 0; a < n; ++a) {
    e->g[a] += row[a] * r;
    for (int b = 0; b <= a; ++b) {
      e->h[a][b] += row[a] * row[b];
    }
  }
}

static void row_of(const hapi_spidar_rows *rows, int string, double row[6])
{
  HAPI_ASSERT_INDEX(string, HAPI_SPIDAR_STRINGS_MAX);
  hapi_v3_copy(rows->unit[string], row);
  hapi_v3_scale(1.0 / TURN_LENGTH, rows->moment[string], row + 3);
}

/* What is measured: lengths of the strings of a set. */
typedef struct measured {
  const double *lengths;
  uint32_t strings;
} measured;

static inline void equations_of(const hapi_spidar_rows *rows, const measured *given, int strings,
                                int n, normal *out)
{
  memset(out, 0, sizeof *out);
  out->n = n;
  for (int i = 0; i < strings; ++i) {
    if ((given->strings >> i & 1u) != 0) {
      double row[6];
      double r = rows->length[i] - given->lengths[i];
      double size = fabs(r);
      row_of(rows, i, row);
      add_row(out, n, row, r);
      out->cost += r * r;
      out->worst = size > out->worst ? size : out->worst;
    }
  }
}

static void equations_at(const hapi_spidar_model *model, const hap_pose *pose,
                         const measured *given, normal *out)
{
  hapi_spidar_rows rows;
  hapi_spidar_rows_at(model, pose, &rows);
  if (model->dof == 6) {
    equations_of(&rows, given, model->strings, 6, out);
  } else {
    equations_of(&rows, given, model->strings, 3, out);
  }
}

static inline bool solve_n(const normal *e, double added, int n, double *out)
{
  hapi_spidar_matrix l;
  double trace = 0.0;
  for (int a = 0; a < n; ++a) {
    for (int b = 0; b <= a; ++b) {
      l[a][b] = e->h[a][b];
    }
    trace += e->h[a][a];
    out[a] = e->g[a];
  }
  for (int a = 0; a < n; ++a) {
    l[a][a] += added + FLOOR * trace;
  }
  if (!hapi_spidar_cholesky(l, n)) {
    return false;
  }
  hapi_spidar_substitute(l, n, out);
  return true;
}

/* (h + added)^-1 g; 0 where that does not exist. */
static void solve_normal(const normal *e, double added, double out[6])
{
  if (!(e->n == 6 ? solve_n(e, added, 6, out) : solve_n(e, added, 3, out))) {
    memset(out, 0, 6 * sizeof *out);
  }
}

/* Returns the length of the step in m. */
static double find_step(const normal *e, double damping, double step[6])
{
  double gradient = 0.0;
  for (int a = 0; a < e->n; ++a) {
    gradient += e->g[a] * e->g[a];
  }
  solve_normal(e, damping * sqrt(gradient), step);
  double way = hapi_v3_norm(step);
  double turn = e->n == 6 ? hapi_v3_norm(step + 3) : 0.0;
  double shorter = fmax(1.0, fmax(way / STEP_MAX, turn / (TURN_LENGTH * TURN_MAX)));
  for (int a = 0; a < e->n; ++a) {
    step[a] /= shorter;
  }
  return fmax(way, turn) / shorter;
}

/* Back to where a grip can be. */
static void pose_confine(const hapi_spidar_solver *solver, hap_pose *pose)
{
  for (int axis = 0; axis < 3; ++axis) {
    double x = pose->position[axis];
    x = x < solver->low[axis] ? solver->low[axis] : x;
    pose->position[axis] = x > solver->high[axis] ? solver->high[axis] : x;
  }
  double *q = pose->quat_wxyz;
  double sine = hapi_v3_norm(q + 1);
  if (fabs(q[0]) < solver->half_cos && sine > 0.0) {
    hapi_v3_scale(solver->half_sin / sine, q + 1, q + 1);
    q[0] = (q[0] < 0.0 ? -1.0 : 1.0) * solver->half_cos;
  }
}

/* The turn by a vector v is taken as (1, v/2), normalised: a small step needs no sine, and none is
 * lost where the steps end. */
static void pose_move(const hapi_spidar_solver *solver, const hapi_spidar_model *model,
                      const double step[6], hap_pose *pose)
{
  hapi_v3_add(pose->position, step, pose->position);
  if (model->dof == 6) {
    double turn[4] = {1.0, 0.0, 0.0, 0.0};
    hapi_v3_scale(0.5 / TURN_LENGTH, step + 3, turn + 1);
    hapi_quat_multiply(turn, pose->quat_wxyz, pose->quat_wxyz);
    hapi_quat_normalize(pose->quat_wxyz);
  }
  pose_confine(solver, pose);
}

/* Steps until one is below STILL or none is left; true: arrived. */
static bool pose_descend(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                         const measured *given, int steps)
{
  normal here;
  bool arrived = false;
  equations_at(model, &solver->pose, given, &here);
  for (solver->iterations = 0; solver->iterations < steps && !arrived; ++solver->iterations) {
    double step[6];
    normal there;
    hap_pose pose = solver->pose;
    double size = find_step(&here, solver->damping, step);
    pose_move(solver, model, step, &pose);
    equations_at(model, &pose, given, &there);
    arrived = size < STILL;
    if (there.cost < here.cost) {
      solver->pose = pose;
      solver->damping = fmax(0.1 * solver->damping, DAMPING);
      here = there;
    } else if (!arrived) {
      solver->damping = fmin(10.0 * solver->damping, DAMPING_MOST);
    }
  }
  solver->residual = here.worst;
  return arrived;
}

static bool is_outside(const hapi_spidar_solver *solver, const hapi_spidar_model *model)
{
  bool outside = fabs(solver->pose.quat_wxyz[0]) < solver->work_cos;
  for (int axis = 0; axis < 3; ++axis) {
    outside =
        outside || fabs(solver->pose.position[axis] - model->centre[axis]) > model->workspace[axis];
  }
  return outside;
}

/* The box of the motors, and that of home and the workspace, which lie beside the motors in
 * some. */
static void set_box(hapi_spidar_solver *solver, const hapi_spidar_model *model)
{
  for (int axis = 0; axis < 3; ++axis) {
    double reach = WORKSPACES * model->workspace[axis];
    double low = fmin(0.0, model->centre[axis]) - reach;
    double high = fmax(0.0, model->centre[axis]) + reach;
    for (int i = 0; i < model->strings; ++i) {
      low = fmin(low, model->motor[i][axis]);
      high = fmax(high, model->motor[i][axis]);
    }
    solver->low[axis] = low;
    solver->high[axis] = high;
  }
}

void hapi_spidar_solver_init(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                             const hap_pose *start)
{
  double half = 0.5 * fmin(model->workspace_turn + BEYOND, TURN_ENDS);
  memset(solver, 0, sizeof *solver);
  solver->damping = DAMPING;
  set_box(solver, model);
  solver->half_cos = cos(half);
  solver->half_sin = sin(half);
  solver->work_cos = model->dof == 6 ? cos(0.5 * model->workspace_turn) : -1.0;
  if (start != NULL) {
    solver->pose = *start;
  } else {
    hapi_spidar_home(&solver->pose);
  }
}

hapi_spidar_fit hapi_spidar_solve(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                                  const double lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  return hapi_spidar_solve_with(solver, model, lengths, (1u << model->strings) - 1u);
}

hapi_spidar_fit hapi_spidar_solve_with(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                                       const double lengths[HAPI_SPIDAR_STRINGS_MAX],
                                       uint32_t strings)
{
  const measured given = {lengths, strings};
  for (int i = 0; i < model->strings; ++i) {
    if (!(fabs(lengths[i]) < 1e3)) {
      return HAPI_SPIDAR_FIT_INVALID;
    }
  }
  bool arrived = pose_descend(solver, model, &given, STEPS);
  solver->outside = is_outside(solver, model);
  if (!arrived) {
    return HAPI_SPIDAR_FIT_MOVING;
  }
  return solver->residual <= model->residual ? HAPI_SPIDAR_FIT_GOOD : HAPI_SPIDAR_FIT_POOR;
}

void hapi_spidar_twist(const hapi_spidar_model *model, const hap_pose *pose,
                       const double rates[HAPI_SPIDAR_STRINGS_MAX], hap_twist *out)
{
  const measured given = {rates, (1u << model->strings) - 1u};
  hapi_spidar_rows rows;
  normal e;
  double v[6];
  memset(out, 0, sizeof *out);
  if (!hapi_finite(rates, model->strings)) {
    return;
  }
  hapi_spidar_rows_at(model, pose, &rows);
  for (int i = 0; i < model->strings; ++i) {
    rows.length[i] = 0.0; /* the rates take the place of the lengths */
  }
  if (model->dof == 6) {
    equations_of(&rows, &given, model->strings, 6, &e);
  } else {
    equations_of(&rows, &given, model->strings, 3, &e);
  }
  solve_normal(&e, 0.0, v);
  hapi_v3_copy(v, out->linear);
  if (model->dof == 6) {
    hapi_v3_scale(1.0 / TURN_LENGTH, v + 3, out->angular);
  }
}

/* What is left when one string is not asked. */
typedef struct without {
  double residual; /* m, of the others; HUGE_VAL: no pose was found */
  double error;    /* m, of the one, measured minus fitting */
} without;

static without leave_out(const hapi_spidar_model *model, const hap_pose *good,
                         const double *lengths, int string)
{
  HAPI_ASSERT_INDEX(string, model->strings);
  const uint32_t all = (1u << model->strings) - 1u;
  const measured others = {lengths, all & ~(1u << string)};
  hapi_spidar_solver solver;
  hapi_spidar_rows rows;
  hapi_spidar_solver_init(&solver, model, good);
  if (!pose_descend(&solver, model, &others, STEPS_ALONE)) {
    return (without){HUGE_VAL, 0.0};
  }
  hapi_spidar_rows_at(model, &solver.pose, &rows);
  return (without){solver.residual, lengths[string] - rows.length[string]};
}

void hapi_spidar_diagnose(const hapi_spidar_model *model, const hap_pose *good,
                          const double lengths[HAPI_SPIDAR_STRINGS_MAX], hapi_spidar_diagnosis *out)
{
  without left[HAPI_SPIDAR_STRINGS_MAX];
  double least = HUGE_VAL;
  memset(out, 0, sizeof *out);
  if (!hapi_finite(lengths, model->strings)) {
    return;
  }
  for (int i = 0; i < model->strings; ++i) {
    left[i] = leave_out(model, good, lengths, i);
    least = fmin(least, left[i].residual);
  }
  double like_least = SUSPECT_RATIO * least + SUSPECT_SHARE * model->residual;
  for (int i = 0; i < model->strings && least <= model->residual; ++i) {
    if (left[i].residual <= like_least) {
      out->suspects |= 1u << i;
      out->error[i] = left[i].error;
    }
  }
}
