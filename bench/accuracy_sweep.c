/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* All runs of one scene. At a physics rate: the reference from each start, made once, then every
 * model from each start, then the knobs one at a time from the first start. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench/accuracy.h"

#define REFERENCE_ITERATIONS 1000
#define SINGLE_AT_HZ 60.0 /* whose soft constraints model SINGLE is given */
#define SPEEDS_AT_HZ 20.0
#define CONTROL_RATE 1.3 /* times the physics rate: shares none of its harmonics up to the 5th */
#define TABLE_GROWTH 64

/* Against the hand, so that no scene's gap to a wall is closed; a little aside, so that nothing is
 * in the middle by luck. The first two differ by 1 um, which is one of the noise floors. */
static const double starts[ACCURACY_STARTS_MAX] = {1e-6, 2e-6, 5e-6, 1e-5, 2e-5,
                                                   5e-5, 1e-4, 2e-4, 5e-4, 1e-3};
static const double aside = 0.05;

static const double rates[] = {10.0, 20.0, 60.0, 120.0};
static const double rates_quick[] = {20.0, 60.0};
static const double contact_rates[] = {20.0, 100.0, 200.0, 1000.0};
static const double speeds[] = {0.05, 0.3, 1.0}; /* the first takes long */
static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE};

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

typedef struct sweep {
  bench *bench;
  const accuracy_scene *scene;
  accuracy_table *table;
  scene_parameters parameters;
  char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];
  double seconds;
  double physics_hz;
  size_t start_count;
  size_t start[ACCURACY_STARTS_MAX]; /* indices into starts */
  accuracy_motion references[ACCURACY_STARTS_MAX];
  double noise_floor;
  double torque_floor; /* the same of the torque */
  size_t worst;        /* index of the worst start in the newest row */
} sweep;

/* What is run beside the default, and how the table calls it. */
typedef struct setting {
  hap_model model;
  double physics_hz; /* as the table says it */
  const char *knob;
  double value;
  double contact_hz;
  int latency_ticks;
  size_t start_count;
  hap_probe probe;
  hap_effect_wish cross;
  hap_coupling coupling; /* DIRECT, or with the spring and damper of the scene's contacts */
} setting;

void accuracy_table_free(accuracy_table *table)
{
  free(table->rows);
  memset(table, 0, sizeof *table);
}

hap_status accuracy_table_add(bench *b, accuracy_table *table, const accuracy_row *row)
{
  if (table->count == table->capacity) {
    size_t capacity = table->capacity + TABLE_GROWTH;
    accuracy_row *rows = realloc(table->rows, capacity * sizeof *rows);
    if (rows == NULL) {
      return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the table");
    }
    table->rows = rows;
    table->capacity = capacity;
  }
  table->rows[table->count] = *row;
  ++table->count;
  return HAP_OK;
}

/* ---- runs ---- */

static hap_status run_from(const sweep *s, const accuracy_run_def *of, double start, int iterations,
                           accuracy_motion *out)
{
  accuracy_run_def def = *of;
  scene_parameters parameters = s->parameters;
  parameters.shift[0] = -start;
  parameters.shift[1] = aside * start;
  parameters.iterations = iterations > 0 ? iterations : parameters.iterations;
  def.parameters = &parameters;
  def.seconds = s->seconds;
  for (int i = 0; i < parameters.pointers; ++i) {
    def.hands[i] = s->hands[i];
  }
  return accuracy_run(s->bench, &def, out);
}

static hap_status run_reference(const sweep *s, double start, double haptic_hz,
                                accuracy_motion *out)
{
  accuracy_run_def def;
  accuracy_run_def_init(&def);
  def.model = HAP_MODEL_SINGLE;
  def.physics_hz = s->physics_hz; /* what soft constraints are converted from */
  def.haptic_hz = haptic_hz;
  return run_from(s, &def, start, REFERENCE_ITERATIONS, out);
}

static hap_status untouched(const sweep *s)
{
  return bench_fail(s->bench, HAP_ERROR_STATE, "%s: the hand touches nothing", s->scene->name);
}

static void free_references(sweep *s)
{
  for (size_t i = 0; i < ACCURACY_STARTS_MAX; ++i) {
    accuracy_motion_free(&s->references[i]);
  }
}

/* To where two references differ, if that is higher. */
static hap_status raise_floor(sweep *s, const accuracy_motion *a, const accuracy_motion *b)
{
  accuracy_errors errors;
  if (!accuracy_compare(a, b, NULL, s->physics_hz, &errors)) {
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
  hap_status status = run_reference(s, starts[s->start[index]], 2.0 * ACCURACY_HAPTIC_HZ, &finer);
  if (status >= HAP_OK) {
    status = raise_floor(s, &s->references[index], &finer);
    accuracy_motion_free(&finer);
  }
  return status;
}

static hap_status make_references(sweep *s)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < s->start_count && status >= HAP_OK; ++i) {
    status = run_reference(s, starts[s->start[i]], ACCURACY_HAPTIC_HZ, &s->references[i]);
  }
  s->noise_floor = s->torque_floor = 0.0;
  if (status >= HAP_OK) {
    status = raise_floor(s, &s->references[0], &s->references[1]);
  }
  return status >= HAP_OK ? raise_floor_by_step(s, 0) : status;
}

/* ---- rows ---- */

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
  worst->lines = worst->lines || e->lines;
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

static void note_times(const accuracy_motion *m, size_t i, times *out)
{
  const hap_stats *stats = &m->stats;
  double seconds = (double)m->count / ACCURACY_HAPTIC_HZ;
  double spent = 1e-6 * stats->tick_us_mean * (double)stats->ticks +
                 1e-3 * stats->physics_ms_mean * (double)stats->physics_steps +
                 1e-6 * stats->contact_us_mean * (double)stats->contact_passes;
  out->tick_us[i] = stats->tick_us_mean;
  out->physics_ms[i] = stats->physics_ms_mean;
  out->duty[i] = spent / seconds;
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

static void begin_row(const sweep *s, const setting *set, accuracy_row *row)
{
  memset(row, 0, sizeof *row);
  snprintf(row->scene, sizeof row->scene, "%s", s->scene->name);
  snprintf(row->knob, sizeof row->knob, "%s", set->knob);
  snprintf(row->hand, sizeof row->hand, "%s", s->scene->recording != NULL ? "recorded" : "rigid");
  row->model = set->model;
  row->physics_hz = set->physics_hz;
  row->value = set->value;
  row->haptic_hz = ACCURACY_HAPTIC_HZ;
  row->noise_floor = s->noise_floor;
  row->torque_floor = s->torque_floor;
  row->joints = s->references[0].joints;
  row->joint_floor = widest_of_references(s);
  row->hand_speed = accuracy_hand_speed(&s->references[0]);
  row->rest_share = s->scene->rests ? 0.0 : accuracy_rest_share(&s->references[0]);
  row->errors.impulse_ratio = row->errors.peak_ratio = 1.0;
  row->bound = set->physics_hz == 60.0   ? 0.5 * s->scene->bound
               : set->physics_hz == 20.0 ? s->scene->bound
                                         : 0.0;
}

static hap_status run_model(const sweep *s, const setting *set, size_t i, double physics_hz,
                            accuracy_motion *out)
{
  accuracy_run_def def;
  accuracy_run_def_init(&def);
  def.model = set->model;
  def.physics_hz = physics_hz;
  def.contact_hz = set->contact_hz > 0.0 ? set->contact_hz : def.contact_hz;
  def.latency_ticks = set->latency_ticks;
  def.probe = set->probe;
  def.cross = set->cross;
  def.coupling = set->coupling;
  if (set->coupling != HAP_COUPLING_DIRECT) {
    def.coupling_stiffness = s->parameters.stiffness;
    def.coupling_damping = s->parameters.damping;
  }
  return run_from(s, &def, starts[s->start[i]], 0, out);
}

/* From start i. */
static hap_status measure_start(sweep *s, const setting *set, size_t i, accuracy_errors *out,
                                times *t)
{
  accuracy_motion motion;
  accuracy_motion control;
  bool controls = set->model == HAP_MODEL_CONTACT && strcmp(set->knob, "default") == 0;
  hap_status status = run_model(s, set, i, s->physics_hz, &motion);
  if (status < HAP_OK) {
    return status;
  }
  memset(&control, 0, sizeof control);
  status = controls ? run_model(s, set, i, CONTROL_RATE * s->physics_hz, &control) : HAP_OK;
  if (status >= HAP_OK && !accuracy_compare(&s->references[i], &motion, controls ? &control : NULL,
                                            s->physics_hz, out)) {
    status = untouched(s);
  }
  note_times(&motion, i, t);
  if (getenv("LB")) fprintf(stderr, "LB %s %s %g %s %g start %zu err %.5f est %.5f n %.4f win %llu spoilt %llu rest %g floor %.5f\n", s->scene->name, hap_model_name(set->model), s->physics_hz, set->knob, set->value, i, out->force, motion.stats.force_error, motion.stats.force_error_n, (unsigned long long)motion.stats.lookbacks, (unsigned long long)motion.stats.lookbacks_spoilt, 0.0, s->noise_floor);
  accuracy_motion_free(&motion);
  accuracy_motion_free(&control);
  return status;
}

static hap_status measure(sweep *s, const setting *set)
{
  accuracy_row row;
  times t;
  begin_row(s, set, &row);
  for (size_t i = 0; i < set->start_count; ++i) {
    accuracy_errors errors;
    hap_status status = measure_start(s, set, i, &errors, &t);
    if (status < HAP_OK) {
      return status;
    }
    if (errors.force >= row.errors.force) {
      row.start_um = 1e6 * starts[s->start[i]];
      s->worst = i;
    }
    take_worst(&row.errors, &errors);
  }
  row.tick_us = bench_median(t.tick_us, set->start_count);
  row.physics_ms = bench_median(t.physics_ms, set->start_count);
  row.duty = bench_median(t.duty, set->start_count);
  return accuracy_table_add(s->bench, s->table, &row);
}

static setting setting_of(const sweep *s, hap_model model, const char *knob, double value)
{
  bool all = strcmp(knob, "default") == 0;
  return (setting){.model = model,
                   .physics_hz = s->physics_hz,
                   .knob = knob,
                   .value = value,
                   .latency_ticks = HAP_LATENCY_DEFAULT,
                   .start_count = all ? s->start_count : 1};
}

/* ---- knobs ---- */

static hap_status sweep_contact_rate(sweep *s)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < COUNT(contact_rates) && status >= HAP_OK; ++i) {
    setting set = setting_of(s, HAP_MODEL_CONTACT, "contact_hz", contact_rates[i]);
    set.contact_hz = contact_rates[i];
    status = measure(s, &set);
  }
  return status;
}

static hap_status sweep_age(sweep *s, hap_model model)
{
  int step = (int)(ACCURACY_HAPTIC_HZ / s->physics_hz);
  const int ages[] = {0, 1, step / 2, step};
  hap_status status = HAP_OK;
  for (size_t i = 0; i < COUNT(ages) && status >= HAP_OK; ++i) {
    setting set = setting_of(s, model, "model_age", ages[i] / ACCURACY_HAPTIC_HZ);
    set.latency_ticks = ages[i];
    status = measure(s, &set);
  }
  return status;
}

/* When an impact falls between two ticks, its time depends on the start by up to a tick, and so does
 * how far the reference is off: the floor is that of the start it is held against. */
static hap_status measure_contact(sweep *s)
{
  setting set = setting_of(s, HAP_MODEL_CONTACT, "default", 0.0);
  hap_status status = measure(s, &set);
  if (status >= HAP_OK && s->worst > 0) {
    status = raise_floor_by_step(s, s->worst);
    s->table->rows[s->table->count - 1].noise_floor = s->noise_floor;
    s->table->rows[s->table->count - 1].torque_floor = s->torque_floor;
  }
  return status;
}

static const struct {
  const char *knob;
  hap_probe probe;
  hap_effect_wish cross;
} ways[] = {{ACCURACY_EQ4, HAP_PROBE_SHARED, HAP_EFFECT_OFF},
            {ACCURACY_OPERATING, HAP_PROBE_OPERATING, HAP_EFFECT_OFF},
            {ACCURACY_CROSS, HAP_PROBE_OPERATING, HAP_EFFECT_ON}};

/* How model accelerance can test. From all starts the first way is the default row. */
static hap_status sweep_probes(sweep *s)
{
  hap_status status = HAP_OK;
  for (size_t i = s->bench->quick ? 0 : 1; i < COUNT(ways) && status >= HAP_OK; ++i) {
    setting set = setting_of(s, HAP_MODEL_ACCELERANCE, ways[i].knob, 0.0);
    set.probe = ways[i].probe;
    set.cross = ways[i].cross;
    set.start_count = s->bench->quick ? 1 : s->start_count;
    status = measure(s, &set);
  }
  return status;
}

/* From all starts, as a row of its own. */
static hap_status sweep_coupling(sweep *s)
{
  setting set = setting_of(s, HAP_MODEL_CONTACT, s->bench->coupling, s->parameters.stiffness);
  set.start_count = s->start_count;
  return bench_find_coupling(s->bench->coupling, &set.coupling) ? measure(s, &set) : HAP_OK;
}

static hap_status sweep_models(sweep *s)
{
  hap_status status = measure_contact(s);
  if (status >= HAP_OK && s->bench->coupling != NULL) {
    status = sweep_coupling(s);
  }
  for (size_t i = 0; i < COUNT(models) && status >= HAP_OK; ++i) {
    setting set = setting_of(s, models[i], "default", 0.0);
    status = models[i] != HAP_MODEL_CONTACT ? measure(s, &set) : status;
  }
  if (status >= HAP_OK) {
    status = sweep_probes(s);
  }
  if (status >= HAP_OK && s->physics_hz == SINGLE_AT_HZ) {
    setting set = setting_of(s, HAP_MODEL_SINGLE, "default", 0.0);
    set.physics_hz = ACCURACY_HAPTIC_HZ; /* its steps are the loop's */
    status = measure(s, &set);
  }
  return status;
}

static hap_status sweep_rate(sweep *s, double physics_hz)
{
  s->physics_hz = physics_hz;
  hap_status status = make_references(s);
  if (status >= HAP_OK) {
    status = sweep_models(s);
  }
  if (status >= HAP_OK && (!s->bench->quick || physics_hz == SPEEDS_AT_HZ)) {
    status = sweep_contact_rate(s);
    for (size_t i = 0; i < COUNT(models) && status >= HAP_OK; ++i) {
      status = sweep_age(s, models[i]);
    }
  }
  free_references(s);
  return status;
}

/* ---- the scene ---- */

static const scene_parameters *base_of(const accuracy_scene *which)
{
  for (size_t i = 0; scene_table_at(i) != NULL; ++i) {
    if (strcmp(scene_table_at(i)->name, which->base) == 0) {
      return scene_table_at(i);
    }
  }
  return NULL;
}

static hap_status set_hands(sweep *s, double stretch)
{
  const scene_parameters *p = &s->parameters;
  if (s->scene->recording != NULL) {
    return accuracy_recorded_hand(s->bench, s->scene, s->hands[0], sizeof s->hands[0]);
  }
  for (int i = 0; i < p->pointers; ++i) {
    if (!accuracy_hand(p->hands[i], stretch, s->hands[i], sizeof s->hands[i])) {
      return bench_fail(s->bench, HAP_ERROR_ARGUMENT, "%s: no hand can be made of \"%s\"",
                        s->scene->name, p->hands[i]);
    }
  }
  return HAP_OK;
}

static size_t starts_of(const accuracy_scene *which)
{
  size_t count = ACCURACY_STARTS_MAX;
  while (which->start_most > 0.0 && count > 2 && starts[count - 1] > which->start_most) {
    --count;
  }
  return count;
}

static hap_status begin_sweep(bench *b, const accuracy_scene *which, accuracy_table *table,
                              sweep *s)
{
  const scene_parameters *base = base_of(which);
  memset(s, 0, sizeof *s);
  s->bench = b;
  s->scene = which;
  s->table = table;
  if (base == NULL) {
    return bench_fail(b, HAP_ERROR_NOT_FOUND, "there is no scene %s", which->base);
  }
  s->parameters = *base;
  s->seconds = b->quick && which->seconds_quick > 0.0 ? which->seconds_quick
               : which->seconds > 0.0                 ? which->seconds
                                                      : base->duration;
  size_t fewer = b->quick ? (size_t)which->starts_quick : 0;
  size_t all = starts_of(which);
  s->start_count = fewer > 0 ? fewer : all;
  for (size_t i = 0; i < s->start_count; ++i) {
    /* the smallest ones, and of fewer starts the last is the largest */
    s->start[i] = i > 1 && i + 1 == s->start_count ? all - 1 : i;
  }
  return set_hands(s, 1.0);
}

/* The same way in another time. Rows of the knob hand_speed, from one start. */
static hap_status sweep_speeds(sweep *s, double own_speed)
{
  double seconds = s->seconds;
  hap_status status = HAP_OK;
  s->physics_hz = SPEEDS_AT_HZ;
  s->start_count = 2; /* the floor needs them */
  for (size_t i = s->bench->quick ? 1 : 0; i < COUNT(speeds) && status >= HAP_OK; ++i) {
    double stretch = own_speed / speeds[i];
    s->seconds = seconds * stretch;
    status = set_hands(s, stretch);
    if (status >= HAP_OK) {
      status = make_references(s);
    }
    for (size_t m = 0; m < COUNT(models) && status >= HAP_OK; ++m) {
      setting set = setting_of(s, models[m], "hand_speed", speeds[i]);
      status = measure(s, &set);
    }
    free_references(s);
  }
  return status;
}

hap_status accuracy_sweep(bench *b, const accuracy_scene *which, accuracy_table *table)
{
  sweep s;
  const double *list = b->quick ? rates_quick : rates;
  size_t count = b->quick ? COUNT(rates_quick) : COUNT(rates);
  size_t first = table->count;
  hap_status status = begin_sweep(b, which, table, &s);
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    status = sweep_rate(&s, list[i]);
  }
  if (status >= HAP_OK && which->speeds) {
    status = sweep_speeds(&s, table->rows[first].hand_speed);
  }
  free_references(&s);
  return status;
}
