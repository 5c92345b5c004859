/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The rows of the table before they are measured. At each physics rate every model as it is, then
 * the knobs, one at a time and the others as by default. */

#include <assert.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "bench/accuracy.h"
#include "bench/cycles.h"

#define SPEEDS_AT_HZ 20.0
#define TICK_COST 250.0 /* one of the loop's, in iterations of QuickStep */
#define STEP_COST 300.0 /* what a physics step takes beside its iterations, likewise */
#define PROBES 4.0      /* testing simulations beside a step of model ACCELERANCE */
#define BODIES_GUESSED 3
#define FLOOR_REFERENCES 4.0      /* two at 2 kHz, in runs of a reference */
#define REFERENCE_ITERATIONS 1000 /* at least */
#define LOOKBACK_ITERATIONS 100   /* half of the fewest of the session's own reference */
#define SCENE_SPEED 0.1           /* m/s, about that of most hands */

/* Against the hand, so that no scene's gap to a wall is closed. The first two differ by 1 um,
 * which is one of the noise floors. */
static const double starts[ACCURACY_STARTS_MAX] = {1e-6, 2e-6, 5e-6, 1e-5, 2e-5,
                                                   5e-5, 1e-4, 2e-4, 5e-4, 1e-3};

/* Values of a knob; the first of them with --quick too. */
typedef struct values {
  const double *all;
  size_t count;
  size_t quick; /* so many of them */
} values;

#define VALUES(name, quick)        \
  {                                \
    name, BENCH_COUNT(name), quick \
  }

static const double rates[] = {10.0, 20.0, 60.0, 120.0, 250.0, 500.0, 1000.0};
static const double rates_quick[] = {20.0, 60.0};
static const double speeds[] = {0.3, 1.0, 0.05}; /* the last one takes long */
static const double contact_rates[] = {20.0, 100.0, 200.0, 1000.0, 50.0, 500.0};
static const double iterations[] = {5.0, 100.0, 10.0, 20.0, 50.0, 200.0, 500.0};
static const double sweeps[] = {2.0, 4.0, 3.0, 6.0, 10.0, 20.0};
static const double hops[] = {0.0, 2.0, 1.0, 4.0, 8.0};
static const double reuses[] = {0.0, 1e-7, 1e-6, 1e-5, 1e-4};
static const double haptic_rates[] = {500.0, 2000.0, 5000.0, 10000.0};

static const double positions[] = {0.0, 0.2, 0.4, 0.8, 1.0, 0.1, 0.3, 0.6, 0.7, 0.9};

static const values dial = VALUES(positions, 5);
static const values all_speeds = VALUES(speeds, 2);

static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE};

double accuracy_start(size_t index)
{
  return starts[index];
}

size_t accuracy_starts(const accuracy_scene *which, bool quick, size_t out[ACCURACY_STARTS_MAX])
{
  size_t all = ACCURACY_STARTS_MAX;
  while (which->start_most > 0.0 && all > 2 && starts[all - 1] > which->start_most) {
    --all;
  }
  size_t count = quick && which->starts_quick > 0 ? (size_t)which->starts_quick : all;
  for (size_t i = 0; i < count; ++i) {
    /* the smallest ones, and of fewer starts the last is the largest */
    out[i] = i > 1 && i + 1 == count ? all - 1 : i;
  }
  return count;
}

/* ---- the lists ---- */

static hap_status array_grow(bench *b, void **array, size_t *capacity, size_t count, size_t size)
{
  if (count < *capacity) {
    return HAP_OK;
  }
  size_t wanted = *capacity > 0 ? 2 * *capacity : 64;
  void *larger = realloc(*array, wanted * size);
  if (larger == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the plan");
  }
  *array = larger;
  *capacity = wanted;
  return HAP_OK;
}

void accuracy_plan_free(accuracy_plan *plan)
{
  free(plan->groups);
  free(plan->points);
  memset(plan, 0, sizeof *plan);
}

/* What adds points to the newest group. Of a failure later calls do nothing. */
typedef struct writer {
  bench *bench;
  accuracy_plan *plan;
  accuracy_group *group;
  hap_status status;
} writer;

static void begin_group(writer *w, const accuracy_scene *which, double physics_hz, double speed)
{
  accuracy_plan *plan = w->plan;
  if (w->status >= HAP_OK) {
    w->status = array_grow(w->bench, (void **)&plan->groups, &plan->group_capacity,
                           plan->group_count, sizeof *plan->groups);
  }
  if (w->status < HAP_OK) {
    return;
  }
  w->group = &plan->groups[plan->group_count++];
  *w->group = (accuracy_group){
      .scene = which, .physics_hz = physics_hz, .hand_speed = speed, .first = plan->count};
}

static accuracy_point point_of(const writer *w, hap_model model, const char *knob, double value)
{
  accuracy_point p;
  memset(&p, 0, sizeof p);
  snprintf(p.knob, sizeof p.knob, "%s", knob);
  accuracy_run_def_init(&p.def);
  p.def.session.model = model;
  p.def.session.physics_hz = p.physics_hz = w->group != NULL ? w->group->physics_hz : 0.0;
  p.value = value;
  p.all_starts = strcmp(knob, ACCURACY_DEFAULT) == 0;
  return p;
}

static inline bool is_same(const accuracy_point *a, const accuracy_point *b) /* of an assert */
{
  return a->def.session.model == b->def.session.model && strcmp(a->knob, b->knob) == 0 &&
         a->value == b->value && a->physics_hz == b->physics_hz;
}

/* A row is known by its model, knob, value and rate. */
static void point_add(writer *w, const accuracy_point *point)
{
  accuracy_plan *plan = w->plan;
  if (w->status >= HAP_OK) {
    w->status = array_grow(w->bench, (void **)&plan->points, &plan->capacity, plan->count,
                           sizeof *plan->points);
  }
  if (w->status < HAP_OK) {
    return;
  }
  plan->points[plan->count] = *point;
  if (point->def.session.model == HAP_MODEL_SINGLE) { /* its steps are the loop's */
    plan->points[plan->count].physics_hz = point->def.session.haptic_hz;
  }
  for (size_t i = w->group->first; i < plan->count; ++i) {
    assert(!is_same(&plan->points[i], &plan->points[plan->count]));
  }
  ++plan->count;
  ++w->group->count;
}

/* ---- knobs ---- */

#define KNOB(member) offsetof(accuracy_run_def, member)

static const struct {
  const char *name;
  size_t at;  /* in the def */
  bool whole; /* an int32_t, else a double */
  values values;
  size_t models; /* so many of the first ones; with all of them model SINGLE too */
} knobs[] = {
    {"contact_hz", KNOB(expert.contact_hz), false, VALUES(contact_rates, 4), 1},
    {"iterations", KNOB(iterations), true, VALUES(iterations, 2), BENCH_COUNT(models)},
    {"sweeps", KNOB(expert.max_sweeps), true, VALUES(sweeps, 2), 1},
    {"range_hops", KNOB(expert.range_hops), true, VALUES(hops, 2), 1},
    {"reuse", KNOB(expert.reuse), false, VALUES(reuses, 0), 2},
    {"haptic_hz", KNOB(session.haptic_hz), false, VALUES(haptic_rates, 2), BENCH_COUNT(models)},
};

static void add_knob(writer *w, size_t knob, hap_model model)
{
  const values *v = &knobs[knob].values;
  size_t count = w->plan->quick ? v->quick : v->count;
  for (size_t i = 0; i < count; ++i) {
    accuracy_point p = point_of(w, model, knobs[knob].name, v->all[i]);
    int32_t whole = (int32_t)v->all[i];
    char *at = (char *)&p.def + knobs[knob].at;
    memcpy(at, knobs[knob].whole ? (const void *)&whole : &v->all[i],
           knobs[knob].whole ? sizeof whole : sizeof v->all[i]);
    if (p.def.session.haptic_hz >= p.def.session.physics_hz || model == HAP_MODEL_SINGLE) {
      point_add(w, &p);
    }
  }
}

static void add_plane_and_integrations(writer *w)
{
  static const struct {
    const char *name;
    hap_integration integration;
  } integrations[] = {{"explicit", HAP_INTEGRATION_EXPLICIT},
                      {"implicit", HAP_INTEGRATION_IMPLICIT},
                      {"midpoint", HAP_INTEGRATION_MIDPOINT}};
  accuracy_point plane = point_of(w, HAP_MODEL_CONTACT, "plane", 0.0);
  expert_wish(&plane.def.expert, HAP_EFFECT_SHAPE, HAP_EFFECT_OFF);
  point_add(w, &plane);
  for (size_t i = 0; i < BENCH_COUNT(integrations); ++i) {
    accuracy_point p = point_of(w, HAP_MODEL_CONTACT, integrations[i].name, 0.0);
    p.def.integration = integrations[i].integration;
    point_add(w, &p);
  }
}

/* Its middle is the default. */
static void add_dial(writer *w, hap_model model)
{
  for (size_t i = 0; i < (w->plan->quick ? dial.quick : dial.count); ++i) {
    accuracy_point p = point_of(w, model, ACCURACY_DIAL, dial.all[i]);
    p.def.session.accuracy = dial.all[i];
    point_add(w, &p);
  }
}

static void add_ages(writer *w, hap_model model)
{
  int step = (int)(ACCURACY_HAPTIC_HZ / w->group->physics_hz);
  const int ages[] = {0, 1, step / 2, step};
  int oldest = -1;
  for (size_t i = 0; i < BENCH_COUNT(ages); ++i) {
    if (ages[i] <= oldest) {
      continue;
    }
    oldest = ages[i];
    accuracy_point p = point_of(w, model, ACCURACY_AGE, ages[i] / ACCURACY_HAPTIC_HZ);
    p.def.research.physics_latency_ticks = ages[i];
    point_add(w, &p);
  }
}

/* How model accelerance can test. From all starts eq. 4 is the default row. */
static void add_probes(writer *w)
{
  static const struct {
    const char *knob;
    hap_probe probe;
    hap_effect_wish cross;
    bool quick_alone;
  } ways[] = {{ACCURACY_EQ4, HAP_PROBE_SHARED, HAP_EFFECT_OFF, true},
              {ACCURACY_OPERATING, HAP_PROBE_OPERATING, HAP_EFFECT_OFF, false},
              {ACCURACY_CROSS, HAP_PROBE_OPERATING, HAP_EFFECT_ON, false},
              {ACCURACY_PAPER, HAP_PROBE_PAPER, HAP_EFFECT_OFF, false}};
  bool quick = w->plan->quick;
  for (size_t i = 0; i < BENCH_COUNT(ways); ++i) {
    bool paper = strcmp(ways[i].knob, ACCURACY_PAPER) == 0;
    accuracy_point p = point_of(w, HAP_MODEL_ACCELERANCE, ways[i].knob, 0.0);
    p.def.research.probe = ways[i].probe;
    expert_wish(&p.def.expert, HAP_EFFECT_CROSS, ways[i].cross);
    p.all_starts = !quick && !paper; /* the same force as by default, in another time */
    if (quick ? !paper || p.physics_hz == ACCURACY_PAPER_HZ : !ways[i].quick_alone) {
      point_add(w, &p);
    }
  }
}

bool accuracy_estimates_all(const bench *b)
{
  return b->estimates != NULL ? strcmp(b->estimates, "all") == 0 : !b->quick;
}

bool accuracy_knob_has_value(const char *knob)
{
  bool has = strcmp(knob, ACCURACY_SPEED) == 0 || strcmp(knob, ACCURACY_AGE) == 0 ||
             strcmp(knob, ACCURACY_DIAL) == 0;
  for (size_t i = 0; i < BENCH_COUNT(knobs); ++i) {
    has = has || strcmp(knob, knobs[i].name) == 0;
  }
  return has;
}

/* ---- groups ---- */

static void add_models(writer *w)
{
  accuracy_point contact = point_of(w, HAP_MODEL_CONTACT, ACCURACY_DEFAULT, 0.0);
  point_add(w, &contact); /* first: it settles the noise floor */
  if (w->bench->coupling != NULL) {
    double stiffness = cycles_scene(w->group->scene->base)->stiffness;
    accuracy_point p = point_of(w, HAP_MODEL_CONTACT, w->bench->coupling, stiffness);
    (void)bench_find_coupling(w->bench->coupling, &p.def.coupling);
    p.all_starts = true;
    point_add(w, &p);
  }
  for (size_t i = 1; i < BENCH_COUNT(models); ++i) {
    accuracy_point p = point_of(w, models[i], ACCURACY_DEFAULT, 0.0);
    point_add(w, &p);
  }
  add_probes(w);
  if (w->group->physics_hz == ACCURACY_DEFAULT_HZ) { /* whose soft constraints it is given */
    accuracy_point p = point_of(w, HAP_MODEL_SINGLE, ACCURACY_DEFAULT, 0.0);
    point_add(w, &p);
  }
}

static void add_knobs(writer *w)
{
  bool single = w->group->physics_hz == ACCURACY_DEFAULT_HZ && !w->plan->quick;
  for (size_t knob = 0; knob < BENCH_COUNT(knobs); ++knob) {
    add_knob(w, knob, HAP_MODEL_CONTACT);
    for (size_t m = 1; m < BENCH_COUNT(models) && m < knobs[knob].models && !w->plan->quick; ++m) {
      add_knob(w, knob, models[m]);
    }
    if (single && knobs[knob].models == BENCH_COUNT(models)) {
      add_knob(w, knob, HAP_MODEL_SINGLE);
    }
  }
  add_plane_and_integrations(w);
  add_dial(w, HAP_MODEL_CONTACT);
  if (!w->plan->quick) {
    add_dial(w, HAP_MODEL_ACCELERANCE);
  }
  for (size_t m = 0; m < BENCH_COUNT(models); ++m) {
    add_ages(w, models[m]);
  }
}

static void add_rate(writer *w, const accuracy_scene *which, double physics_hz)
{
  begin_group(w, which, physics_hz, 0.0);
  if (w->status >= HAP_OK) {
    add_models(w);
  }
  if (w->status >= HAP_OK && (!w->plan->quick || physics_hz == SPEEDS_AT_HZ)) {
    add_knobs(w);
  }
}

/* The same way in another time, from one start. */
static void add_speed(writer *w, const accuracy_scene *which, double speed)
{
  begin_group(w, which, SPEEDS_AT_HZ, speed);
  for (size_t m = 0; m < BENCH_COUNT(models) && w->status >= HAP_OK; ++m) {
    accuracy_point p = point_of(w, models[m], ACCURACY_SPEED, speed);
    point_add(w, &p);
  }
}

hap_status accuracy_plan_make(bench *b, const accuracy_scene *const *scenes, size_t count,
                              accuracy_plan *out)
{
  memset(out, 0, sizeof *out);
  out->quick = b->quick;
  out->estimates_all = accuracy_estimates_all(b);
  writer w = {.bench = b, .plan = out, .status = HAP_OK};
  for (size_t i = 0; i < count; ++i) {
    if (cycles_scene(scenes[i]->base) == NULL) {
      w.status = bench_fail(b, HAP_ERROR_NOT_FOUND, "there is no scene %s", scenes[i]->base);
    }
    for (size_t k = 0; k < (b->quick ? BENCH_COUNT(rates_quick) : BENCH_COUNT(rates)); ++k) {
      add_rate(&w, scenes[i], b->quick ? rates_quick[k] : rates[k]);
    }
    for (size_t k = 0; scenes[i]->speeds && k < (b->quick ? all_speeds.quick : all_speeds.count);
         ++k) {
      add_speed(&w, scenes[i], all_speeds.all[k]);
    }
  }
  if (w.status < HAP_OK) {
    accuracy_plan_free(out);
    return w.status;
  }
  for (size_t i = 0; i < out->group_count; ++i) {
    accuracy_group *g = &out->groups[i];
    for (size_t k = 0; k < g->count; ++k) {
      g->cost += accuracy_point_cost(out, g, &out->points[g->first + k]);
    }
  }
  return HAP_OK;
}

/* ---- what it takes ---- */

scene_parameters accuracy_parameters(const accuracy_scene *which)
{
  scene_parameters p = *cycles_scene(which->base);
  p.count_default = which->count > 0 ? which->count : p.count_default;
  return p;
}

/* Rows of a step grow with the bodies. */
static double step_cost(const scene_parameters *p, int its)
{
  int bodies = p->count_default > 0 ? p->count_default : BODIES_GUESSED;
  return STEP_COST + (double)(its > 0 ? its : p->iterations) * bodies;
}

static double run_cost(const scene_parameters *p, const accuracy_run_def *def, double seconds)
{
  double step = step_cost(p, def->iterations);
  double ticks = seconds * def->session.haptic_hz;
  if (def->session.model == HAP_MODEL_SINGLE) {
    return ticks * step;
  }
  double tests = def->session.model == HAP_MODEL_ACCELERANCE ? PROBES : 0.0;
  return ticks * TICK_COST + seconds * def->session.physics_hz * (1.0 + tests) * step;
}

/* What takes more iterations to be simulated well takes more of them to be a reference: in the
 * tower, which has 2000, the force with 1000 is 1 % off, and the noise floor does not show it. */
int accuracy_reference_iterations(const scene_parameters *p)
{
  return p->iterations > REFERENCE_ITERATIONS / 2 ? 2 * p->iterations : REFERENCE_ITERATIONS;
}

double accuracy_seconds(const accuracy_scene *which, bool quick)
{
  return quick && which->seconds_quick > 0.0 ? which->seconds_quick
         : which->seconds > 0.0              ? which->seconds
                                             : cycles_scene(which->base)->duration;
}

double accuracy_point_cost(const accuracy_plan *plan, const accuracy_group *group,
                           const accuracy_point *point)
{
  size_t used[ACCURACY_STARTS_MAX];
  const scene_parameters parameters = accuracy_parameters(group->scene);
  const scene_parameters *p = &parameters;
  size_t all = accuracy_starts(group->scene, plan->quick, used);
  double slower = group->hand_speed > 0.0 ? SCENE_SPEED / group->hand_speed : 1.0;
  double seconds = slower * accuracy_seconds(group->scene, plan->quick);
  bool first = point == &plan->points[group->first];
  bool main = first && point->all_starts;
  double references = !first ? 0.0 : FLOOR_REFERENCES + (main ? (double)all : 2.0);
  double runs = point->all_starts ? (double)all * (main ? 2.0 : 1.0) : 1.0;
  bool estimated = point->def.session.model != HAP_MODEL_SINGLE &&
                   (plan->estimates_all || strcmp(point->knob, ACCURACY_DEFAULT) == 0);
  double looks = estimated ? 2.0 * step_cost(p, LOOKBACK_ITERATIONS + p->iterations) : 0.0;
  return references * seconds * ACCURACY_HAPTIC_HZ *
             step_cost(p, accuracy_reference_iterations(p)) +
         runs * run_cost(p, &point->def, seconds) + seconds * ACCURACY_HAPTIC_HZ * looks;
}

/* The dearest first, each to the shard that has least. */
hap_status accuracy_deal(bench *b, const accuracy_plan *plan, size_t shards, size_t *out)
{
  double *given = calloc(shards, sizeof *given);
  if (given == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for %zu shards", shards);
  }
  for (size_t i = 0; i < plan->group_count; ++i) {
    out[i] = shards; /* nobody's yet */
  }
  for (size_t round = 0; round < plan->group_count; ++round) {
    size_t dearest = plan->group_count;
    size_t poorest = 0;
    for (size_t i = 0; i < plan->group_count; ++i) {
      bool dearer =
          dearest == plan->group_count || plan->groups[i].cost > plan->groups[dearest].cost;
      dearest = out[i] == shards && dearer ? i : dearest;
    }
    for (size_t k = 1; k < shards; ++k) {
      poorest = given[k] < given[poorest] ? k : poorest;
    }
    out[dearest] = poorest;
    given[poorest] += plan->groups[dearest].cost;
  }
  free(given);
  return HAP_OK;
}

/* ---- whether it is the same ---- */

static uint64_t hash_text(uint64_t hash, const char *text) /* FNV-1a */
{
  for (; *text != '\0'; ++text) {
    hash = (hash ^ (unsigned char)*text) * 0x100000001b3ull;
  }
  return hash;
}

uint64_t accuracy_plan_hash(const accuracy_plan *plan)
{
  uint64_t hash = 0xcbf29ce484222325ull;
  for (size_t i = 0; i < plan->group_count; ++i) {
    const accuracy_group *g = &plan->groups[i];
    for (size_t k = 0; k < g->count; ++k) {
      const accuracy_point *p = &plan->points[g->first + k];
      char text[160];
      snprintf(text, sizeof text, "%s %g %g %s %d %g %g;", g->scene->name, g->physics_hz,
               g->hand_speed, p->knob, (int)p->def.session.model, p->value, p->physics_hz);
      hash = hash_text(hash, text);
    }
  }
  return hash;
}
