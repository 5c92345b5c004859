/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/dial.h"

#include <math.h>

#include <hapode/expert.h>

#include "base/assert.h"
#include "base/vec.h"

/* The order in which accuracy is given up, and in which it is bought. Measured by hapode-bench
 * accuracy over all scenes (docs/accuracy.md): first goes what costs most for what it adds to
 * the force, last what the force cannot do without. */

/* A row holds from its position on up to the next one's. */
typedef struct tick_row {
  int from; /* percent */
  double contact_hz;
  uint32_t row_updates;
  uint32_t updates_per_row; /* where these are more, and a tick has time for them */
  double force_drift;       /* 1/s */
  int32_t range_hops;
  bool shapes;
} tick_row;

/* What one tick leaves undone the next one goes on with, so what a solve may spend goes first; a
 * bound on its row updates costs less of the force than one on its sweeps, which stops small
 * islands that would soon be solved. Contacts that are found late are felt where things come to
 * new ground. A shorter range is wrong where bodies carry each other, a plane instead of a shape
 * where they roll: the last resort of a budget. */
static const tick_row tick_rows[] = {
    {0, 50.0, 600, 0, 0.1, 1, false},
    {10, 50.0, 600, 0, 0.1, 4, true},
    {20, 100.0, 2500, 0, 0.1, HAP_RANGE_ALL, true},
    {30, 100.0, 4000, 0, 0.1, HAP_RANGE_ALL, true},
    {40, 200.0, 8000, 0, 0.05, HAP_RANGE_ALL, true},
    {50, 200.0, 20000, 6, 0.03, HAP_RANGE_ALL, true},
    {70, 333.0, 20000, 8, 0.01, HAP_RANGE_ALL, true},
    {80, 500.0, 20000, 12, 0.003, HAP_RANGE_ALL, true},
    {100, 1000.0, 20000, 64, 0.0, HAP_RANGE_ALL, true},
};

typedef struct physics_row {
  int from;
  hap_probe probe;
  double iterations; /* times those of the world */
  double reuse;      /* m */
} physics_row;

/* Iterations last: a world that is solved too badly pushes on the loop with forces that are not
 * there. */
static const physics_row physics_rows[] = {
    {0, HAP_PROBE_SHARED, 0.5, 1e-4},     {20, HAP_PROBE_SHARED, 0.75, 1e-5},
    {30, HAP_PROBE_SHARED, 1.0, 1e-5},    {40, HAP_PROBE_SHARED, 1.0, 1e-6},
    {50, HAP_PROBE_SHARED, 1.0, 1e-7},    {60, HAP_PROBE_OPERATING, 1.0, 1e-7},
    {80, HAP_PROBE_OPERATING, 2.0, 1e-7}, {90, HAP_PROBE_OPERATING, 2.0, 0.0},
    {100, HAP_PROBE_OPERATING, 4.0, 0.0},
};

/* A row update takes about this on a slow processor. No solve may run past its tick on account
 * of the rows alone; where it is slower still, a budget turns the dial. */
#define UPDATE_S 12e-9
#define TICK_SHARE 0.8

static const tick_row *tick_row_of(int percent)
{
  const tick_row *row = tick_rows;
  for (size_t i = 0; i < sizeof tick_rows / sizeof tick_rows[0]; ++i) {
    row = percent >= tick_rows[i].from ? &tick_rows[i] : row;
  }
  return row;
}

static const physics_row *physics_row_of(int percent)
{
  const physics_row *row = physics_rows;
  for (size_t i = 0; i < sizeof physics_rows / sizeof physics_rows[0]; ++i) {
    row = percent >= physics_rows[i].from ? &physics_rows[i] : row;
  }
  return row;
}

void hapi_dial_settings(const hapi_knobs *knobs, int tick_percent, int physics_percent,
                        double period_s, hapi_settings *out)
{
  const tick_row *tick = tick_row_of(tick_percent);
  const physics_row *physics = physics_row_of(physics_percent);
  bool by_accuracy = knobs->iterations == HAP_BY_ACCURACY;
  out->contact_hz = knobs->contact_hz > 0.0 ? knobs->contact_hz : tick->contact_hz;
  out->max_sweeps = knobs->max_sweeps > 0 ? (uint32_t)knobs->max_sweeps : 0;
  double most = TICK_SHARE * period_s / UPDATE_S;
  out->row_updates = most < tick->row_updates ? (uint32_t)most : tick->row_updates;
  out->updates_per_row = tick->updates_per_row;
  out->force_drift = tick->force_drift;
  out->range_hops = knobs->range_hops != HAP_BY_ACCURACY ? knobs->range_hops : tick->range_hops;
  out->shapes = tick->shapes;
  out->probe = knobs->probe != HAP_PROBE_BY_ACCURACY ? knobs->probe : physics->probe;
  out->iterations = by_accuracy ? physics->iterations : knobs->iterations == 0 ? 1.0 : 0.0;
  out->reuse = knobs->reuse >= 0.0 ? knobs->reuse : physics->reuse;
  out->fixed_iterations = knobs->iterations > 0 ? knobs->iterations : 0;
}

/* ---- when one is turned ---- */

#define ROOM 0.6 /* a load below it leaves room for a step */
#define FAR_OVER 2.0
#define FAR_STEPS 3
#define PATIENCE_S 1.0
#define PATIENCE_MOST_S 60.0
#define SOON 2.0 /* times the patience */

int hapi_turn_by(hapi_turn *turn, double load, double seconds)
{
  turn->patience_s = turn->patience_s > 0.0 ? turn->patience_s : PATIENCE_S;
  turn->since_s += seconds;
  turn->low_s = load < ROOM ? turn->low_s + seconds : 0.0;
  if (load > 1.0) {
    double longer = 2.0 * turn->patience_s;
    if (turn->tried && turn->since_s < SOON * turn->patience_s) {
      turn->patience_s = longer < PATIENCE_MOST_S ? longer : PATIENCE_MOST_S;
    }
    turn->tried = false;
    return load > FAR_OVER ? FAR_STEPS : 1;
  }
  if (turn->low_s < turn->patience_s) {
    return 0;
  }
  turn->low_s = turn->since_s = 0.0;
  turn->tried = true;
  return -1;
}

/* ---- two of them ---- */

#define STEP 10 /* percent, of a turn */
#define LOOK_TICKS 100u
#define LOOK_CYCLES 4u
#define OVER_SHARE 0.05 /* of the ticks, that may be above the budget: threads are interrupted */
#define BURST 1.5       /* times the budget, for one cycle */
#define ERROR_SPAN 2.0  /* less than the wanted error by this: a lower accuracy is tried */
#define REST_KEEP 0.75
#define ITERATIONS_MOST 10000

/* ---- what a side has to do for its budget ---- */

static void side_turn(hapi_dial_side *side, int aim, double load, double seconds)
{
  int before = side->percent;
  int steps = hapi_turn_by(&side->turn, load, seconds);
  side->load = load;
  side->percent = before - STEP * steps;
  side->percent = side->percent < 0 ? 0 : side->percent > aim ? aim : side->percent;
  side->turns += side->percent != before;
}

/* Of the ticks that the loop has told of: their mean, and how many were above the budget. */
static void dial_look_at_ticks(hapi_dial *dial, const hapi_cycle *cycle, double budget_s)
{
  const hapi_tick_load *told = &cycle->state->load;
  uint64_t ticks = told->ticks - dial->ticks_seen;
  uint64_t over = told->over - dial->over_seen;
  if (ticks < LOOK_TICKS && (2 * over < ticks || ticks < LOOK_CYCLES)) {
    return;
  }
  double mean_s = 1e-9 * (told->spent_ns - dial->ns_seen) / (double)ticks;
  double load = fmax(mean_s / budget_s, (double)over / (OVER_SHARE * (double)ticks));
  side_turn(&dial->sides[HAPI_DIAL_TICK], dial->aim, load,
            (double)ticks / cycle->config->haptic_hz);
  dial->ticks_seen = told->ticks;
  dial->over_seen = told->over;
  dial->ns_seen = told->spent_ns;
}

static void dial_look_at_cycles(hapi_dial *dial, double period_s, double budget_s)
{
  hapi_dial_side *side = &dial->sides[HAPI_DIAL_PHYSICS];
  bool burst = side->longest > BURST * budget_s;
  if (side->count == 0 || (side->count < LOOK_CYCLES && !burst)) {
    return;
  }
  double mean_s = side->seconds / (double)side->count;
  double load = fmax(mean_s, side->longest / BURST) / budget_s;
  side_turn(side, dial->aim, load, (double)side->count * period_s);
  side->seconds = side->longest = 0.0;
  side->count = 0;
}

/* A loop that does not count yet, as it has not had a model with the budget, tells of no ticks. */
static void dial_follow_budgets(hapi_dial *dial, const hapi_cycle *cycle)
{
  double tick_s = atomic_load(&dial->share[HAPI_DIAL_TICK]) / cycle->config->haptic_hz;
  double cycle_s = atomic_load(&dial->share[HAPI_DIAL_PHYSICS]) * cycle->probe_step_s;
  if (tick_s > 0.0 && cycle->state != NULL) {
    dial_look_at_ticks(dial, cycle, tick_s);
  }
  if (cycle_s > 0.0) {
    dial_look_at_cycles(dial, cycle->probe_step_s, cycle_s);
  }
  for (int i = 0; i < HAPI_DIALS; ++i) {
    hapi_dial_side *side = &dial->sides[i];
    bool budget = (i == HAPI_DIAL_TICK ? tick_s : cycle_s) > 0.0;
    side->load = budget ? side->load : 0.0;
    side->percent = budget && side->percent < dial->aim ? side->percent : dial->aim;
  }
}

/* ---- where both are to be ---- */

static void dial_follow_wishes(hapi_dial *dial)
{
  int asked = hapi_dial_percent(atomic_load(&dial->wanted));
  double error = atomic_load(&dial->force_error);
  if (asked == dial->asked && (error > 0.0 || dial->error_in_force == 0.0)) {
    dial->error_in_force = error;
    return;
  }
  for (int i = 0; i < HAPI_DIALS; ++i) { /* what was not held back goes with it */
    hapi_dial_side *side = &dial->sides[i];
    side->percent = side->percent >= dial->aim || side->percent > asked ? asked : side->percent;
  }
  dial->error_in_force = error;
  dial->asked = dial->aim = asked;
}

/* One step at a time, and the window after a turn is left out: in it things come to where they
 * are under the new settings. Those that come then begin where the session is, not with what the
 * old settings have added up. */
bool hapi_dial_note_error(hapi_dial *dial, double error, double seconds, bool turns)
{
  double wanted = atomic_load(&dial->force_error);
  dial->told = wanted > 0.0;
  if (!dial->told || !turns) {
    return false;
  }
  if (dial->settles) {
    dial->settles = false;
    return true;
  }
  double load = error / wanted;
  load = load > 1.0 ? load : fmin(ERROR_SPAN * load, 1.0); /* what is as wanted is not too much */
  int steps = hapi_turn_by(&dial->error_turn, load, seconds);
  int aim = dial->aim + STEP * (steps > 0 ? 1 : steps);
  aim = aim < 0 ? 0 : aim > HAPI_DIAL_MOST ? HAPI_DIAL_MOST : aim;
  for (int i = 0; i < HAPI_DIALS; ++i) {
    hapi_dial_side *side = &dial->sides[i];
    side->percent = side->percent >= dial->aim || side->percent > aim ? aim : side->percent;
  }
  dial->settles = aim != dial->aim;
  dial->aim = aim;
  HAPI_ASSERT(aim >= 0 && aim <= HAPI_DIAL_MOST);
  return dial->settles;
}

/* ---- what is told ---- */

static uint32_t side_reason(const hapi_dial *dial, const hapi_dial_side *side)
{
  if (side->percent == 0 && side->load > 1.0) {
    return HAP_ACCURACY_LEAST;
  }
  if (side->percent < dial->aim) {
    return HAP_ACCURACY_BUDGET;
  }
  return dial->error_in_force == 0.0 ? HAP_ACCURACY_ASKED
         : dial->told                ? HAP_ACCURACY_ERROR
                                     : HAP_ACCURACY_UNTOLD;
}

void hapi_dial_tell(const hapi_dial *dial, const hapi_settings *s, hap_accuracy_info *out)
{
  hap_accuracy_side *sides[HAPI_DIALS] = {&out->tick, &out->physics};
  for (int i = 0; i < HAPI_DIALS; ++i) {
    *sides[i] = (hap_accuracy_side){.accuracy = 0.01 * dial->sides[i].percent,
                                    .share = atomic_load(&dial->share[i]),
                                    .load = dial->sides[i].load,
                                    .turns = dial->sides[i].turns,
                                    .reason = side_reason(dial, &dial->sides[i])};
  }
  for (int i = 0; i < HAPI_DIALS; ++i) {
    sides[i]->load *= sides[i]->share;
  }
  out->accuracy = 0.01 * dial->aim;
  out->force_error_wanted = dial->error_in_force;
  out->probe = s->probe;
  out->contact_hz = s->contact_hz;
  out->max_sweeps = (int32_t)s->max_sweeps;
  out->range_hops = s->range_hops;
  out->shapes = s->shapes;
  out->row_updates = s->row_updates;
  out->reuse = s->reuse;
}

void hapi_dial_reset(hapi_dial *dial, int percent)
{
  dial->asked = dial->aim = percent;
  dial->error_turn = (hapi_turn){0};
  dial->error_in_force = atomic_load(&dial->force_error);
  dial->settles = dial->told = false;
  dial->ticks_seen = dial->over_seen = 0;
  dial->ns_seen = dial->rest_s = 0.0;
  for (int i = 0; i < HAPI_DIALS; ++i) {
    dial->sides[i] = (hapi_dial_side){.percent = percent};
  }
}

void hapi_dial_follow(hapi_dial *dial, const hapi_cycle *cycle)
{
  dial_follow_wishes(dial);
  dial_follow_budgets(dial, cycle);
}

void hapi_dial_positions(const hapi_dial *dial, int out_percent[HAPI_DIALS])
{
  for (int i = 0; i < HAPI_DIALS; ++i) {
    out_percent[i] = dial->sides[i].percent;
  }
}

void hapi_dial_place(hapi_dial *dial, const int percent[HAPI_DIALS])
{
  for (int i = 0; i < HAPI_DIALS; ++i) {
    dial->sides[i].percent = percent[i];
  }
}

void hapi_dial_fill(const hapi_dial *dial, double haptic_hz, hapi_settings *out)
{
  hapi_dial_settings(&dial->knobs, dial->sides[HAPI_DIAL_TICK].percent,
                     dial->sides[HAPI_DIAL_PHYSICS].percent, 1.0 / haptic_hz, out);
}

int64_t hapi_dial_tick_budget(const hapi_dial *dial, double haptic_hz)
{
  return (int64_t)(1e9 * atomic_load(&dial->share[HAPI_DIAL_TICK]) / haptic_hz);
}

/* ---- around the steps ---- */

/* The number is the application's: it finds it in its callbacks as it set it. */
void hapi_dial_enter(hapi_dial *dial, const hapi_settings *s, dWorldID world)
{
  dial->own_iterations = dWorldGetQuickStepNumIterations(world);
  double scaled = round(s->iterations * (double)dial->own_iterations);
  scaled = fmin(fmax(scaled, 1.0), fmax(ITERATIONS_MOST, (double)dial->own_iterations));
  dial->iterations = s->fixed_iterations > 0 ? s->fixed_iterations : (int)scaled;
  dWorldSetQuickStepNumIterations(world, dial->iterations);
}

void hapi_dial_leave(const hapi_dial *dial, dWorldID world)
{
  if (dWorldGetQuickStepNumIterations(world) == dial->iterations) {
    dWorldSetQuickStepNumIterations(world, dial->own_iterations);
  }
}

void hapi_dial_note(hapi_dial *dial, double seconds, double looked_s)
{
  hapi_dial_side *side = &dial->sides[HAPI_DIAL_PHYSICS];
  double rest_s = seconds - looked_s;
  side->seconds += rest_s;
  side->longest = fmax(side->longest, rest_s);
  ++side->count;
  dial->rest_s = fmax(rest_s, REST_KEEP * dial->rest_s + (1.0 - REST_KEEP) * rest_s);
}

double hapi_dial_spare(const hapi_dial *dial, double period_s)
{
  double share = atomic_load(&dial->share[HAPI_DIAL_PHYSICS]);
  return share > 0.0 ? fmax(share * period_s - dial->rest_s, 0.0) : HUGE_VAL;
}
