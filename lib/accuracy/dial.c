/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/dial.h"

#include <math.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

#define STEP 10 /* percent, of a turn */
#define LOOK_TICKS 100u
#define LOOK_CYCLES 4u
#define OVER_SHARE 0.05 /* of the ticks, that may be above the budget: threads are interrupted */
#define BURST 1.5       /* times the budget, for one cycle */
#define ERROR_SPAN 2.0  /* less than the wanted error by this: a lower accuracy is tried */
#define REST_KEEP 0.75
#define ITERATIONS_MOST 10000

/* ---- what a side has to do for its budget ---- */

static void turn(hapi_dial_side *side, int aim, double load, double seconds)
{
  int before = side->percent;
  int steps = hapi_turn_by(&side->turn, load, seconds);
  side->load = load;
  side->percent = before - STEP * steps;
  side->percent = side->percent < 0 ? 0 : side->percent > aim ? aim : side->percent;
  side->turns += side->percent != before;
}

/* Of the ticks that the loop has told of: their mean, and how many were above the budget. */
static void look_at_ticks(hapi_physics *physics, double budget_s)
{
  hapi_dial *dial = &physics->dial;
  const hapi_tick_load *told = &physics->cycle.state->load;
  uint64_t ticks = told->ticks - dial->ticks_seen;
  uint64_t over = told->over - dial->over_seen;
  if (ticks < LOOK_TICKS && (2 * over < ticks || ticks < LOOK_CYCLES)) {
    return;
  }
  double mean_s = 1e-9 * (told->spent_ns - dial->ns_seen) / (double)ticks;
  double load = fmax(mean_s / budget_s, (double)over / (OVER_SHARE * (double)ticks));
  turn(&dial->sides[HAPI_DIAL_TICK], dial->aim, load, (double)ticks / physics->config.haptic_hz);
  dial->ticks_seen = told->ticks;
  dial->over_seen = told->over;
  dial->ns_seen = told->spent_ns;
}

static void look_at_cycles(hapi_physics *physics, double budget_s)
{
  hapi_dial *dial = &physics->dial;
  hapi_dial_side *side = &dial->sides[HAPI_DIAL_PHYSICS];
  bool burst = side->longest > BURST * budget_s;
  if (side->count == 0 || (side->count < LOOK_CYCLES && !burst)) {
    return;
  }
  double mean_s = side->seconds / (double)side->count;
  double load = fmax(mean_s, side->longest / BURST) / budget_s;
  turn(side, dial->aim, load, (double)side->count * hapi_physics_period(physics));
  side->seconds = side->longest = 0.0;
  side->count = 0;
}

/* A loop that does not count yet, as it has not had a model with the budget, tells of no ticks. */
static void follow_budgets(hapi_physics *physics)
{
  hapi_dial *dial = &physics->dial;
  double tick_s = atomic_load(&dial->share[HAPI_DIAL_TICK]) / physics->config.haptic_hz;
  double cycle_s = atomic_load(&dial->share[HAPI_DIAL_PHYSICS]) * hapi_physics_period(physics);
  if (tick_s > 0.0 && physics->cycle.state != NULL) {
    look_at_ticks(physics, tick_s);
  }
  if (cycle_s > 0.0) {
    look_at_cycles(physics, cycle_s);
  }
  for (int i = 0; i < HAPI_DIALS; ++i) {
    hapi_dial_side *side = &dial->sides[i];
    bool budget = (i == HAPI_DIAL_TICK ? tick_s : cycle_s) > 0.0;
    side->load = budget ? side->load : 0.0;
    side->percent = budget && side->percent < dial->aim ? side->percent : dial->aim;
  }
}

/* ---- where both are to be ---- */

static void follow_wishes(hapi_physics *physics)
{
  hapi_dial *dial = &physics->dial;
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

/* One step at a time, and the window after a turn is left out: in it things come to where they are under the new
 * settings. Those that come then begin where the session is, not with what the old settings have added up. */
void hapi_dial_note_error(hapi_physics *physics, double error, double seconds)
{
  hapi_dial *dial = &physics->dial;
  double wanted = atomic_load(&dial->force_error);
  dial->told = wanted > 0.0;
  if (!dial->told || hapi_tape_plays(physics->tape.tape)) {
    return;
  }
  if (dial->settles) {
    dial->settles = false;
    physics->lookback.end_ns = 0;
    return;
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
  if (aim != dial->aim) {
    dial->settles = true;
    physics->lookback.end_ns = 0;
  }
  dial->aim = aim;
}

/* ---- what is told ---- */

static uint32_t reason_of(const hapi_physics *physics, const hapi_dial_side *side)
{
  const hapi_dial *dial = &physics->dial;
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

static void tell(hapi_physics *physics)
{
  const hapi_dial *dial = &physics->dial;
  const hapi_settings *s = &physics->cycle.settings;
  hap_accuracy_info *out = &physics->counts.own.accuracy;
  hap_accuracy_side *sides[HAPI_DIALS] = {&out->tick, &out->physics};
  for (int i = 0; i < HAPI_DIALS; ++i) {
    *sides[i] = (hap_accuracy_side){.accuracy = 0.01 * dial->sides[i].percent,
                                    .share = atomic_load(&dial->share[i]),
                                    .load = dial->sides[i].load,
                                    .turns = dial->sides[i].turns,
                                    .reason = reason_of(physics, &dial->sides[i])};
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
  out->edge_probes = (int32_t)s->edge_probes;
  out->shapes = s->shapes;
  out->row_updates = s->row_updates;
  out->reuse = s->reuse;
}

void hapi_dial_reset(hapi_physics *physics)
{
  hapi_dial *dial = &physics->dial;
  int percent = hapi_tape_dial_at_start(physics, hapi_dial_percent(atomic_load(&dial->wanted)));
  dial->asked = dial->aim = percent;
  dial->error_turn = (hapi_turn){0.0};
  dial->error_in_force = atomic_load(&dial->force_error);
  dial->settles = dial->told = false;
  dial->ticks_seen = dial->over_seen = 0;
  dial->ns_seen = dial->looked_s = dial->rest_s = 0.0;
  for (int i = 0; i < HAPI_DIALS; ++i) {
    dial->sides[i] = (hapi_dial_side){.percent = percent};
  }
  hapi_dial_settings(&dial->knobs, percent, percent, 1.0 / physics->config.haptic_hz,
                     &physics->cycle.settings);
  tell(physics);
}

void hapi_dial_follow(hapi_physics *physics)
{
  hapi_dial *dial = &physics->dial;
  if (!hapi_tape_plays(physics->tape.tape)) {
    follow_wishes(physics);
    follow_budgets(physics);
  }
  int percent[HAPI_DIALS] = {dial->sides[0].percent, dial->sides[1].percent};
  hapi_tape_dials(physics, percent);
  dial->sides[0].percent = percent[0];
  dial->sides[1].percent = percent[1];
  hapi_dial_settings(&dial->knobs, percent[HAPI_DIAL_TICK], percent[HAPI_DIAL_PHYSICS],
                     1.0 / physics->config.haptic_hz, &physics->cycle.settings);
  tell(physics);
}

int64_t hapi_dial_tick_budget(hapi_physics *physics)
{
  double share = atomic_load(&physics->dial.share[HAPI_DIAL_TICK]);
  return (int64_t)(1e9 * share / physics->config.haptic_hz);
}

/* ---- around the steps ---- */

/* The number is the application's: it finds it in its callbacks as it set it. */
void hapi_dial_enter(hapi_physics *physics)
{
  hapi_dial *dial = &physics->dial;
  const hapi_settings *s = &physics->cycle.settings;
  dial->own_iterations = dWorldGetQuickStepNumIterations(physics->world.ode.world);
  double scaled = round(s->iterations * (double)dial->own_iterations);
  scaled = fmin(fmax(scaled, 1.0), fmax(ITERATIONS_MOST, (double)dial->own_iterations));
  dial->iterations = s->fixed_iterations > 0 ? s->fixed_iterations : (int)scaled;
  dWorldSetQuickStepNumIterations(physics->world.ode.world, dial->iterations);
  physics->counts.own.accuracy.iterations = dial->iterations;
}

void hapi_dial_leave(hapi_physics *physics)
{
  const hapi_dial *dial = &physics->dial;
  if (dWorldGetQuickStepNumIterations(physics->world.ode.world) == dial->iterations) {
    dWorldSetQuickStepNumIterations(physics->world.ode.world, dial->own_iterations);
  }
}

void hapi_dial_note(hapi_physics *physics, double seconds, double looked_s)
{
  hapi_dial *dial = &physics->dial;
  hapi_dial_side *side = &dial->sides[HAPI_DIAL_PHYSICS];
  double rest_s = seconds - looked_s;
  side->seconds += rest_s;
  side->longest = fmax(side->longest, rest_s);
  ++side->count;
  dial->rest_s = fmax(rest_s, REST_KEEP * dial->rest_s + (1.0 - REST_KEEP) * rest_s);
}

double hapi_dial_spare(const hapi_physics *physics)
{
  double share = atomic_load(&physics->dial.share[HAPI_DIAL_PHYSICS]);
  double left = share * hapi_physics_period(physics) - physics->dial.rest_s;
  return share > 0.0 ? fmax(left, 0.0) : HUGE_VAL;
}
