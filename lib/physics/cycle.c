/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/assert.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/vec.h"
#include "physics/brace.h"
#include "physics/physics_internal.h"

/* One cycle of the physics thread, in the paper's order: step, neighbours, testing simulations,
 * sync. The step goes from the last cycle's time up to now, with the impulse that the pointers gave
 * in that time: so what the world makes of it can be held against what the loop made of it. Model
 * IMPULSE steps from now to the next cycle, as its poses are shown on the way there. */

typedef struct stopwatch {
  int64_t last_ns;
} stopwatch;

/* Seconds since the last call. */
static double stopwatch_lap(stopwatch *watch)
{
  int64_t now = hapi_clock_now();
  double seconds = 1e-9 * (double)(now - watch->last_ns);
  watch->last_ns = now;
  return seconds;
}

/* s, that the world is ahead of the loop. */
static double lead_of(const hapi_cycle *cycle)
{
  return cycle->model == HAP_MODEL_IMPULSE ? cycle->physics_s : 0.0;
}

/* A change of model or rate changes how far ahead the world is: the step between makes up for it.
 * interval_ns: until the next cycle. */
static void follow_model(hapi_physics *physics, int64_t interval_ns)
{
  hapi_cycle *cycle = &physics->cycle;
  hap_model wanted = hapi_tape_wanted_model(&physics->tape, &physics->wanted, cycle, false);
  double lead_s = lead_of(cycle);
  cycle->step_s = cycle->soft_s = cycle->probe_step_s;
  cycle->step_scale = cycle->time_scale;
  cycle->time_scale = hapi_tape_wanted_scale(&physics->tape, &physics->wanted);
  cycle->model = wanted;
  if (wanted != HAP_MODEL_SINGLE && interval_ns > 0) {
    cycle->physics_s = hapi_config_seconds(cycle->config, interval_ns);
  }
  cycle->probe_step_s = hapi_cycle_period(cycle, wanted);
  cycle->step_s = cycle->step_scale * (cycle->step_s + lead_of(cycle) - lead_s);
  if (cycle->step_s < 1e-9) {
    cycle->step_s = 0.0;
  }
  cycle->steady = cycle->soft_s == hapi_cycle_test_s(cycle) && cycle->soft_s == cycle->probe_step_s;
  cycle->wishes = hapi_tape_wanted_effects(&physics->tape, &physics->wanted);
}

/* ODE aborts the process on a pose that is not finite: nothing that makes one may reach it. */
static bool world_is_sound(hapi_physics *physics)
{
  hap_detail what;
  if (!hapi_physics_is_unsound(physics, &what)) {
    physics->world_faulty = false;
    return true;
  }
  hap_detail text;
  snprintf(text.text, sizeof text.text, "%.400s; ODE is not stepped until then", what.text);
  if (!physics->world_faulty) {
    hapi_log(HAP_LOG_ERROR, "%s", text.text);
  }
  physics->config.report(physics->config.user, HAP_FAULT_WORLD,
                         text.text); /* as long as it lasts */
  physics->world_faulty = true;
  return false;
}

/* Nothing of it is touched then. */
static bool world_is_there(hapi_physics *physics)
{
  if (!hapi_world_is_gone(&physics->world)) {
    return true;
  }
  physics->config.report(physics->config.user, HAP_FAULT_WORLD, HAPI_WORLD_GONE_TEXT);
  return false;
}

static void step_part(hapi_physics *physics, double part_s)
{
  hapi_meant meant;
  hapi_hold(&physics->account);
  hapi_world_convert(&physics->world, hapi_world_ratio(&physics->cycle), &meant);
  if (physics->cycle.model == HAP_MODEL_CONTACT) { /* the others are as they were published */
    hapi_flight_prepare(&physics->world, part_s);
  }
  hapi_world_step(&physics->world, part_s);
  hapi_world_restore(&physics->world, &meant);
  hapi_feedback_tell(&physics->feedback);
  hapi_hold_let_go(&physics->account);
}

/* In parts of H, if that is wanted. Testing simulations have steps of the H as created: contacts
 * that were softened for another step are made once more. */
static void global_step(hapi_physics *physics)
{
  hapi_cycle *cycle = &physics->cycle;
  bool notes = physics->probe.reuse.wanted;
  if (cycle->step_s <= 0.0) {
    return;
  }
  uint32_t parts = cycle->parts > 1 ? cycle->parts : 1;
  hapi_sleep_step(&physics->world.bodies, cycle->step_s);
  for (uint32_t i = 0; i < parts; ++i) {
    if (i > 0) {
      hapi_reconcile_push_on(&physics->account);
      hapi_world_collide(&physics->world, cycle, notes);
    }
    step_part(physics, cycle->step_s / (double)parts);
  }
  bool other = parts > 1 || cycle->soft_s != hapi_cycle_test_s(cycle);
  cycle->parts = 1;
  cycle->soft_s = hapi_cycle_test_s(cycle);
  if (other && physics->world.notes->softened) {
    hapi_world_collide(&physics->world, cycle, notes);
  }
}

/* Testing simulations of a body that sleeps need its contacts. */
static void collide_near(hapi_physics *physics)
{
  const hapi_slots *slots = &physics->near.slots;
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    dBodyID body =
        slot->phase == HAPI_SLOT_FREE ? NULL : hapi_account_body(&physics->account, slot);
    if (body != NULL && !slot->loop_owned) {
      hapi_world_collide_also(&physics->world, &physics->cycle, physics->probe.reuse.wanted, body);
    }
  }
}

static bool call_step(hapi_physics *physics, hap_step_fn callback)
{
  if (callback == NULL || !(physics->cycle.step_s > 0.0)) {
    return false;
  }
  physics->lock.editable = true;
  callback(physics->world.ode.user, physics->cycle.step_s);
  physics->lock.editable = false;
  return true;
}

void hapi_physics_fill_settings(hapi_physics *physics)
{
  hapi_settings *settings = &physics->cycle.settings;
  hapi_dial_fill(&physics->dial, physics->config.haptic_hz, settings);
  settings->row_updates = hapi_room_updates(&physics->room, &physics->cycle, settings);
  settings->range_bodies = physics->room.bodies;
  hapi_dial_tell(&physics->dial, settings, &physics->counts.own.accuracy);
}

void hapi_physics_enter_dial(hapi_physics *physics)
{
  HAPI_ASSERT(hapi_lock_in_callback(&physics->lock));
  hapi_dial_enter(&physics->dial, &physics->cycle.settings, physics->world.ode.world);
  physics->counts.own.accuracy.iterations = physics->dial.iterations;
}

static void sync_in(hapi_physics *physics, int64_t interval_ns)
{
  hapi_physics_run_edits(physics);
  follow_model(physics, interval_ns);
  int percent[HAPI_DIALS];
  if (!hapi_tape_plays(physics->tape.tape)) {
    hapi_dial_follow(&physics->dial, &physics->cycle);
  }
  if (!hapi_tape_plays(physics->tape.tape) && !physics->config.lockstep) {
    hapi_room_time(&physics->room, &physics->cycle);
  }
  hapi_tape_pace(&physics->tape, &physics->room.pace, &physics->room.margin);
  hapi_room_follow(&physics->room, &physics->cycle, physics->near.range.cut);
  hapi_dial_positions(&physics->dial, percent);
  hapi_tape_dials(&physics->tape, percent);
  hapi_dial_place(&physics->dial, percent);
  hapi_physics_fill_settings(physics);
  /* The callbacks come where no list of bodies or geoms is in use: they may destroy some. */
  (void)call_step(physics, physics->world.ode.before_step);
  hapi_physics_see(physics, true);
  int64_t begin_ns = hapi_clock_now();
  hapi_joints_scan(&physics->world);
  physics->counts.own.joints_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  hapi_physics_take_state(physics);
  if (physics->cycle.has_new_state) {
    hapi_reconcile_own(&physics->account);
  }
}

static void sync_out(hapi_physics *physics, int64_t now_ns, int64_t next_ns)
{
  int64_t half_tick = (int64_t)(0.5e9 / physics->config.haptic_hz); /* clocks are rounded */
  int64_t state_ns = physics->cycle.model == HAP_MODEL_IMPULSE ? next_ns : now_ns;
  int64_t valid_ns = state_ns;
  if (physics->cycle.model != HAP_MODEL_SINGLE && physics->wanted.latency_s >= 0.0) {
    valid_ns = now_ns + (int64_t)llround(1e9 * physics->wanted.latency_s);
  } else if (physics->cycle.model >= HAP_MODEL_ACCELERANCE && physics->config.lockstep &&
             !hapi_tape_plays(physics->tape.tape)) {
    valid_ns = now_ns + 2 * half_tick; /* nothing is ready at once */
  }
  hapi_physics_make_model(physics, state_ns, valid_ns - half_tick);
  hapi_reconcile_leave(&physics->account);
  hapi_slots_release(&physics->near);
  hapi_joints_leave(&physics->world.joints);
  physics->cycle.last_cycle_ns = now_ns;
  /* The loop of model IMPULSE shows bodies on their way to a pose that is reached a step later. */
  int64_t lag_ns = physics->cycle.model == HAP_MODEL_IMPULSE ? next_ns - now_ns : 0;
  const int64_t times_ns[2] = {
      physics->cycle.model == HAP_MODEL_IMPULSE ? valid_ns + lag_ns : now_ns,
      physics->config.lockstep ? now_ns : hapi_clock_now()};
  hapi_poses_publish(&physics->drawing, &physics->world, &physics->near.slots, &physics->cycle,
                     times_ns);
}

void hapi_physics_collide(hapi_physics *physics)
{
  HAPI_ASSERT(hapi_lock_in_callback(&physics->lock));
  bool notes =
      hapi_reuse_open(&physics->probe.reuse, &physics->cycle, !hapi_cross_is_full(&physics->cross));
  hapi_world_collide(&physics->world, &physics->cycle, notes);
}

/* What testing simulations find out of a body's role is the slots' before anybody reads it. */
void hapi_physics_test(hapi_physics *physics)
{
  HAPI_ASSERT(hapi_lock_in_callback(&physics->lock));
  hapi_probe *probe = &physics->probe;
  hapi_slots *slots = &physics->near.slots;
  hapi_answers_follow(&probe->answers, slots);
  hapi_accelerance_measure(probe, hapi_cross_watch(&physics->cross));
  hapi_operating_point_measure(probe);
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    hapi_slots_set_flags(slots, i, probe->answers.bodies[i].flags);
  }
}

/* It simulates in the hand's time alone, with the step as created, and knows of contacts alone:
 * those with the surface of their pair. */
static bool may_look_back(const hapi_physics *physics)
{
  const hapi_cycle *cycle = &physics->cycle;
  return !hapi_world_asks(physics->world.asking) && !hapi_state_holds(cycle->state) &&
         cycle->time_scale == 1.0 && cycle->step_scale == 1.0 && cycle->steady;
}

static void look_back(hapi_physics *physics, int64_t now_ns)
{
  if (!may_look_back(physics)) {
    hapi_lookback_reset(&physics->lookback);
    return;
  }
  const hapi_lookback_time time = {now_ns,
                                   hapi_dial_spare(&physics->dial, physics->cycle.probe_step_s),
                                   physics->dial.own_iterations};
  hapi_lookback_verdict verdict;
  bool told = hapi_lookback_follow(&physics->lookback, &time, &verdict);
  if (told && hapi_dial_note_error(&physics->dial, verdict.error, verdict.seconds,
                                   !hapi_tape_plays(physics->tape.tape))) {
    hapi_lookback_unchain(&physics->lookback);
  }
}

#define LATE_S 1.0
#define UNSOLVED_TICKS 50u

/* What the application can mend and would not see: physics in slow motion, a force that is not
 * what the bodies would give. */
static void cycle_tell(hapi_physics *physics, double seconds)
{
  const hapi_cycle *cycle = &physics->cycle;
  double late_s = seconds > cycle->probe_step_s ? physics->late_s + seconds : 0.0;
  physics->late_s = physics->config.lockstep ? 0.0 : late_s;
  if (physics->late_s > LATE_S) {
    hapi_say_once(cycle, &physics->said.late,
                  "physics takes longer than its period: the world is beyond real time; fewer "
                  "bodies, iterations or a lower physics_hz would help");
  }
  if (physics->room.cut_s > LATE_S) {
    hapi_say_once(cycle, &physics->said.cut,
                  physics->room.crowded
                      ? "bodies touch at more points than there are places for: the range ends "
                        "before them, and the force is approximate (hap_stats.room.range_most); "
                        "give more max_contacts"
                      : "more bodies touch than a tick has time for: the range ends before them, "
                        "and the force is approximate (hap_stats.room.range_most)");
  }
  if (cycle->state != NULL && cycle->state->unsolved >= UNSOLVED_TICKS) {
    hapi_say_once(cycle, &physics->said.unsolved,
                  "more bodies touch than a tick can solve: the force is approximate "
                  "(hap_stats.contact.residual_max)");
  }
  if (cycle->state != NULL && cycle->state->derated) {
    hapi_say_once(cycle, &physics->said.derated,
                  "ticks of the haptic loop come late: the force is lowered meanwhile "
                  "(hap_stats.safety.derated_ticks); real time or less to do would help");
  }
  if (cycle->state != NULL && cycle->state->swings) {
    hapi_say_once(cycle, &physics->said.swings,
                  "a device swings by itself: the force is lowered meanwhile "
                  "(hap_stats.safety.oscillation_ticks); less stiffness would help");
  }
  if (cycle->state != NULL && cycle->state->force_out != HAP_FORCE_IN) {
    hapi_say_once(cycle, &physics->said.force_out,
                  cycle->state->force_out == HAP_FORCE_OUT_NOT_FINITE
                      ? "the call of an own force gave what is not finite: it is taken out "
                        "(hap_pointer_force_get)"
                      : "the call of an own force takes too long: it is taken out "
                        "(hap_pointer_force_get)");
  }
  if (cycle->state != NULL && cycle->state->texture_out) {
    hapi_say_once(cycle, &physics->said.texture_out,
                  "the function of a texture takes too long: it is felt as smooth from now on "
                  "(hap_session_get_texture)");
  }
}

static void note_times(hapi_physics *physics, const double seconds[5], double looked_s)
{
  hapi_physics_counts *f = &physics->counts.own;
  hap_stats *s = &f->stats;
  double total = seconds[0] + seconds[1] + seconds[2] + seconds[3] + seconds[4];
  f->collide_s += seconds[0];
  f->neighbour_s += seconds[1];
  f->testing_s += seconds[2];
  f->step_s += seconds[3];
  f->publish_s += seconds[4];
  ++f->cycles;
  s->physics.steps += physics->cycle.step_s > 0.0;
  s->physics.last.collide_ms = 1e3 * seconds[0];
  s->physics.last.neighbour_ms = 1e3 * seconds[1];
  s->physics.last.testing_ms = 1e3 * seconds[2];
  s->physics.last.step_ms = 1e3 * seconds[3];
  s->physics.last.publish_ms = 1e3 * seconds[4];
  hapi_histogram_add(&physics->counts.cycle_ns, (int64_t)(1e9 * total));
  hapi_dial_note(&physics->dial, total, looked_s);
  cycle_tell(physics, total);
  hapi_counts_show(physics);
}

static void cycle_run(hapi_physics *physics, int64_t now_ns, int64_t next_ns)
{
  HAPI_ASSERT(physics->world.begun && hapi_lock_in_callback(&physics->lock));
  if (!world_is_there(physics)) {
    return;
  }
  stopwatch watch = {hapi_clock_now()};
  double seconds[5] = {0.0};
  /* Those of the last step: what looks at the bodies' joints has that many less to look at. */
  dJointGroupEmpty(physics->world.contact_group);
  seconds[0] = stopwatch_lap(&watch);
  sync_in(physics, next_ns - now_ns);
  if (!world_is_sound(physics)) {
    return;
  }
  hapi_physics_enter_dial(physics);
  seconds[4] = stopwatch_lap(&watch);
  look_back(physics, now_ns);
  double looked_s = seconds[2] = stopwatch_lap(&watch);
  if (physics->cycle.model == HAP_MODEL_IMPULSE && may_look_back(physics)) {
    hapi_lookback_open(&physics->lookback, now_ns);
  }
  hapi_reconcile_push(&physics->account);
  hapi_brace_begin(&physics->account);
  bool in_parts = physics->cycle.model == HAP_MODEL_CONTACT && physics->cycle.step_s > 0.0;
  physics->cycle.parts = in_parts ? physics->config.substeps : 1;
  seconds[4] += stopwatch_lap(&watch);
  hapi_physics_collide(physics);
  seconds[0] += stopwatch_lap(&watch);
  hapi_neighbors_collect(&physics->near);
  seconds[1] = stopwatch_lap(&watch);
  global_step(physics);
  seconds[3] = stopwatch_lap(&watch);
  hapi_brace_find(&physics->account);
  hapi_reconcile_residual(&physics->account);
  hapi_reconcile_overwrite(&physics->account);
  hapi_neighbors_find(&physics->near);
  collide_near(physics);
  seconds[1] += stopwatch_lap(&watch) - physics->near.range.links.cover.boxes_s;
  seconds[0] +=
      physics->near.range.links.cover.boxes_s; /* which the next collision phase finds done */
  hapi_physics_test(physics);
  hapi_joint_probes(&physics->probe, &physics->world.joints, physics->near.range.number);
  seconds[2] += stopwatch_lap(&watch);
  if (may_look_back(physics)) {
    hapi_lookback_note(&physics->lookback);
  }
  sync_out(physics, now_ns, next_ns);
  if (physics->cycle.model != HAP_MODEL_IMPULSE && may_look_back(physics)) {
    hapi_lookback_open(&physics->lookback, now_ns);
  }
  hapi_dial_leave(&physics->dial, physics->world.ode.world);
  seconds[4] += stopwatch_lap(&watch);
  note_times(physics, seconds, looked_s);
  if (call_step(physics, physics->world.ode.after_step)) {
    hapi_physics_see(physics, false);
    hapi_physics_renew_model(physics);
  }
  hapi_physics_send_model(physics);
}

static void outside_call(const hapi_physics *physics, void (*call)(void *of, int64_t now_ns),
                         int64_t now_ns)
{
  if (call != NULL) {
    call(physics->calls.of, now_ns);
  }
}

void hapi_physics_cycle(hapi_physics *physics, int64_t now_ns, int64_t next_ns)
{
  outside_call(physics, physics->calls.before, now_ns);
  hapi_lock_enter(&physics->lock);
  hapi_tape_cycle(&physics->tape, &physics->wanted, now_ns, next_ns);
  cycle_run(physics, now_ns, next_ns);
  hapi_tape_cycled(&physics->tape, &physics->cycle);
  hapi_lock_leave(&physics->lock);
  outside_call(physics, physics->calls.after, now_ns);
}
