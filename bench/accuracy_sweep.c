/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The points of one group: the references, each made once and when it is needed, and every point
 * from its starts. */

#include <math.h>
#include <string.h>

#include "bench/accuracy.h"
#include "bench/cycles.h"

#define LOOKBACK 0.1     /* in lockstep any share is all of the time */
#define CONTROL_RATE 1.3 /* times the physics rate: shares none of its harmonics up to the 5th */
#define CONTROL_HZ_MOST 500.0
#define HAND_HZ 20.0

/* Beside the offset against the hand, so that nothing is in the middle by luck. */
static const double aside = 0.05;

typedef struct sweep {
  bench *bench;
  const accuracy_group *group;
  scene_parameters parameters;
  char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];
  double seconds;
  size_t start_count;
  size_t start[ACCURACY_STARTS_MAX];
  accuracy_motion references[ACCURACY_STARTS_MAX]; /* frames: NULL until it is needed */
  double noise_floor;
  double torque_floor; /* the same of the torque */
  bool has_floor;
  size_t worst; /* index of the worst start in the newest row */
} sweep;

/* ---- runs ---- */

static hap_status run_from(const sweep *s, const accuracy_run_def *of, size_t index,
                           accuracy_motion *out)
{
  accuracy_run_def def = *of;
  scene_parameters parameters = s->parameters;
  double start = accuracy_start(s->start[index]);
  parameters.shift[0] = -start;
  parameters.shift[1] = aside * start;
  def.parameters = &parameters;
  def.seconds = s->seconds;
  for (int i = 0; i < parameters.pointers; ++i) {
    def.hands[i] = s->hands[i];
  }
  if (def.coupling != HAP_COUPLING_DIRECT) {
    def.coupling_stiffness = parameters.stiffness;
    def.coupling_damping = parameters.damping;
  }
  return accuracy_run(s->bench, &def, out);
}

static hap_status run_reference(const sweep *s, size_t index, double haptic_hz,
                                accuracy_motion *out)
{
  accuracy_run_def def;
  accuracy_run_def_init(&def);
  def.model = HAP_MODEL_SINGLE;
  def.physics_hz = s->group->physics_hz; /* what soft constraints are converted from */
  def.haptic_hz = haptic_hz;
  def.iterations = accuracy_reference_iterations(&s->parameters);
  return run_from(s, &def, index, out);
}

static hap_status need_reference(sweep *s, size_t index)
{
  return s->references[index].frames != NULL
             ? HAP_OK
             : run_reference(s, index, ACCURACY_HAPTIC_HZ, &s->references[index]);
}

static hap_status untouched(const sweep *s)
{
  return bench_fail(s->bench, HAP_ERROR_STATE, "%s: the hand touches nothing",
                    s->group->scene->name);
}

static void free_references(sweep *s)
{
  for (size_t i = 0; i < ACCURACY_STARTS_MAX; ++i) {
    accuracy_motion_free(&s->references[i]);
  }
}

/* ---- the noise floor ---- */

/* To where two references differ, if that is higher. */
static hap_status raise_floor(sweep *s, const accuracy_motion *a, const accuracy_motion *b)
{
  accuracy_errors errors;
  if (!accuracy_compare(a, b, NULL, s->group->physics_hz, &errors)) {
    return untouched(s);
  }
  s->noise_floor = fmax(s->noise_floor, errors.force);
  s->torque_floor = fmax(s->torque_floor, errors.torque);
  return HAP_OK;
}

/* With the reference at 2 kHz from that start. */
static hap_status raise_floor_by_step(sweep *s, size_t index)
{
  accuracy_motion finer;
  hap_status status = run_reference(s, index, 2.0 * ACCURACY_HAPTIC_HZ, &finer);
  if (status >= HAP_OK) {
    status = raise_floor(s, &s->references[index], &finer);
    accuracy_motion_free(&finer);
  }
  return status;
}

static hap_status need_floor(sweep *s)
{
  hap_status status = need_reference(s, 0);
  if (s->has_floor || status < HAP_OK) {
    return status;
  }
  status = need_reference(s, 1);
  if (status >= HAP_OK) {
    status = raise_floor(s, &s->references[0], &s->references[1]);
  }
  if (status >= HAP_OK) {
    status = raise_floor_by_step(s, 0);
    s->has_floor = true;
  }
  return status;
}

/* ---- a row ---- */

static double further_from_1(double a, double b)
{
  return fabs(a - 1.0) >= fabs(b - 1.0) ? a : b;
}

/* The worst of each figure, whichever start it comes from. */
static void take_worst(accuracy_errors *worst, const accuracy_errors *e)
{
  worst->force = fmax(worst->force, e->force);
  worst->torque = fmax(worst->torque, e->torque);
  worst->impulse_ratio = further_from_1(worst->impulse_ratio, e->impulse_ratio);
  worst->peak_ratio = further_from_1(worst->peak_ratio, e->peak_ratio);
  worst->pose_max = fmax(worst->pose_max, e->pose_max);
  worst->pose_median = fmax(worst->pose_median, e->pose_median);
  worst->lines = fmax(worst->lines, e->lines);
  worst->line_n = fmax(worst->line_n, e->line_n);
  worst->force_rms = fmax(worst->force_rms, e->force_rms);
  worst->joint_loop = fmax(worst->joint_loop, e->joint_loop);
  worst->joint_world = fmax(worst->joint_world, e->joint_world);
  worst->joint_left = fmax(worst->joint_left, e->joint_left);
  worst->joint_turn = fmax(worst->joint_turn, e->joint_turn);
}

typedef struct times {
  double tick_us[ACCURACY_STARTS_MAX];
  double physics_ms[ACCURACY_STARTS_MAX];
  double duty[ACCURACY_STARTS_MAX];
} times;

/* All in one thread: what it used of the processor is not stretched by what else runs there. */
static void note_times(const accuracy_motion *m, size_t i, times *out)
{
  out->tick_us[i] = m->stats.tick_us_mean;
  out->physics_ms[i] = m->stats.physics_ms_mean;
  out->duty[i] = m->used_s * ACCURACY_HAPTIC_HZ / (double)m->count;
}

static double widest_of_references(const sweep *s)
{
  double widest = 0.0;
  for (size_t i = 0; i < s->start_count; ++i) {
    const accuracy_motion *m = &s->references[i];
    widest = fmax(widest, fmax(m->joints_world.way, m->joints_left.way));
  }
  return widest;
}

static void begin_row(const sweep *s, const accuracy_point *point, accuracy_row *row)
{
  const accuracy_scene *of = s->group->scene;
  memset(row, 0, sizeof *row);
  snprintf(row->scene, sizeof row->scene, "%s", of->name);
  snprintf(row->knob, sizeof row->knob, "%s", point->knob);
  snprintf(row->model, sizeof row->model, "%s", hap_model_name(point->def.model));
  snprintf(row->hand, sizeof row->hand, "%s", of->recording != NULL ? "recorded" : "rigid");
  row->physics_hz = point->physics_hz;
  row->value = point->value;
  row->haptic_hz = point->def.haptic_hz;
  row->noise_floor = s->noise_floor;
  row->torque_floor = s->torque_floor;
  row->joint_floor = widest_of_references(s);
  row->hand_speed = accuracy_hand_speed(&s->references[0]);
  row->rest_share = of->rests ? 0.0 : accuracy_rest_share(&s->references[0]);
  row->errors.impulse_ratio = row->errors.peak_ratio = 1.0;
}

static bool is_main(const accuracy_point *point)
{
  return point->def.model == HAP_MODEL_CONTACT && strcmp(point->knob, ACCURACY_DEFAULT) == 0;
}

/* From start i. */
static hap_status measure_start(sweep *s, const accuracy_point *point, size_t i,
                                accuracy_errors *out, times *t)
{
  accuracy_motion motion;
  accuracy_motion control;
  double hz = s->group->physics_hz;
  bool controls = is_main(point) && hz <= CONTROL_HZ_MOST;
  memset(&control, 0, sizeof control);
  hap_status status = need_reference(s, i);
  if (status >= HAP_OK) {
    status = run_from(s, &point->def, i, &motion);
  }
  if (status < HAP_OK) {
    return status;
  }
  if (controls) {
    accuracy_run_def def = point->def;
    def.physics_hz = CONTROL_RATE * hz;
    status = run_from(s, &def, i, &control);
  }
  if (status >= HAP_OK &&
      !accuracy_compare(&s->references[i], &motion, controls ? &control : NULL, hz, out)) {
    status = untouched(s);
  }
  note_times(&motion, i, t);
  accuracy_motion_free(&motion);
  accuracy_motion_free(&control);
  return status;
}

/* What the session itself says of its error. In a run of its own, as looking back takes time; it changes no
 * bit. */
static hap_status measure_estimate(sweep *s, const accuracy_point *point, accuracy_row *row)
{
  accuracy_run_def def = point->def;
  accuracy_motion motion;
  bool asked = accuracy_estimates_all(s->bench) || strcmp(point->knob, ACCURACY_DEFAULT) == 0;
  if (def.model == HAP_MODEL_SINGLE || !asked) {
    return HAP_OK; /* SINGLE is what it is held against */
  }
  def.lookback = LOOKBACK;
  hap_status status = run_from(s, &def, s->worst, &motion);
  if (status < HAP_OK) {
    return status;
  }
  row->estimate = motion.stats.force_error;
  accuracy_motion_free(&motion);
  return HAP_OK;
}

static hap_status measure(sweep *s, const accuracy_point *point, accuracy_row *row)
{
  times t;
  size_t count = point->all_starts ? s->start_count : 1;
  begin_row(s, point, row);
  for (size_t i = 0; i < count; ++i) {
    accuracy_errors errors;
    hap_status status = measure_start(s, point, i, &errors, &t);
    if (status < HAP_OK) {
      return status;
    }
    if (errors.force >= row->errors.force) {
      row->start_um = 1e6 * accuracy_start(s->start[i]);
      s->worst = i;
    }
    row->first_force = i == 0 ? errors.force : row->first_force;
    take_worst(&row->errors, &errors);
  }
  row->starts = (double)count;
  row->tick_us = bench_median(t.tick_us, count);
  row->physics_ms = bench_median(t.physics_ms, count);
  row->duty = bench_median(t.duty, count);
  return measure_estimate(s, point, row);
}

/* When an impact falls between two ticks, its time depends on the start by up to a tick, and so does
 * how far the reference is off: the floor is that of the start it is held against. */
static hap_status measure_point(sweep *s, const accuracy_point *point, accuracy_row *row)
{
  hap_status status = need_floor(s);
  if (status >= HAP_OK) {
    status = measure(s, point, row);
  }
  if (status >= HAP_OK && is_main(point) && s->worst > 0) {
    status = raise_floor_by_step(s, s->worst);
    row->noise_floor = s->noise_floor;
    row->torque_floor = s->torque_floor;
  }
  return status;
}

/* ---- the group ---- */

static hap_status set_hands(sweep *s, double stretch)
{
  const scene_parameters *p = &s->parameters;
  if (s->group->scene->recording != NULL) {
    return accuracy_recorded_hand(s->bench, s->group->scene, s->hands[0], sizeof s->hands[0]);
  }
  for (int i = 0; i < p->pointers; ++i) {
    if (!accuracy_hand(p->hands[i], stretch, s->hands[i], sizeof s->hands[i])) {
      return bench_fail(s->bench, HAP_ERROR_ARGUMENT, "%s: no hand can be made of \"%s\"",
                        s->group->scene->name, p->hands[i]);
    }
  }
  return HAP_OK;
}

/* The hand of the scene moves as it is told, so any run shows how fast. */
static hap_status set_speed(sweep *s)
{
  accuracy_run_def def;
  accuracy_motion motion;
  accuracy_run_def_init(&def);
  def.model = HAP_MODEL_IMPULSE;
  def.physics_hz = HAND_HZ;
  hap_status status = run_from(s, &def, 0, &motion);
  if (status < HAP_OK) {
    return status;
  }
  double stretch = accuracy_hand_speed(&motion) / s->group->hand_speed;
  accuracy_motion_free(&motion);
  s->seconds *= stretch;
  return set_hands(s, stretch);
}

static hap_status begin_sweep(bench *b, const accuracy_plan *plan, const accuracy_group *group,
                              sweep *s)
{
  const accuracy_scene *which = group->scene;
  memset(s, 0, sizeof *s);
  s->bench = b;
  s->group = group;
  s->parameters = accuracy_parameters(which); /* the plan has looked */
  s->seconds = accuracy_seconds(which, plan->quick);
  s->start_count = accuracy_starts(which, plan->quick, s->start);
  hap_status status = set_hands(s, 1.0);
  return status >= HAP_OK && group->hand_speed > 0.0 ? set_speed(s) : status;
}

/* The group's first row has settled the floor. */
static void take_floor(sweep *s, const accuracy_row *first)
{
  if (first->scene[0] != '\0') {
    s->noise_floor = first->noise_floor;
    s->torque_floor = first->torque_floor;
    s->has_floor = true;
  }
}

hap_status accuracy_sweep(bench *b, const accuracy_plan *plan, const accuracy_group *group,
                          const accuracy_row *have, accuracy_done_fn done, void *user)
{
  sweep s;
  hap_status status = begin_sweep(b, plan, group, &s);
  take_floor(&s, &have[group->first]);
  for (size_t i = group->first; i < group->first + group->count && status >= HAP_OK; ++i) {
    accuracy_row row;
    if (have[i].scene[0] != '\0') {
      continue;
    }
    status = measure_point(&s, &plan->points[i], &row);
    if (status >= HAP_OK) {
      status = done(user, i, &row);
    }
  }
  free_references(&s);
  return status;
}
