/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/dial.h"

#include <math.h>

#include "base/assert.h"
#include "base/vec.h"

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
  out->edge_probes = (int32_t)s->edge_probes;
  out->shapes = s->shapes;
  out->row_updates = s->row_updates;
  out->reuse = s->reuse;
}

void hapi_dial_reset(hapi_dial *dial, int percent)
{
  dial->asked = dial->aim = percent;
  dial->error_turn = (hapi_turn){0.0};
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
