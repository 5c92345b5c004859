/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/physics.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Life of the physics side: create, begin, end, destroy; what the session asks it for. */

#define LAST_ROUNDS 16 /* of edits, when the session stops: also of what edits post */

static bool physics_allocate(hapi_physics *physics, const hap_ode_def *ode)
{
  const hapi_capacity *c = &physics->config.capacity;
  return hapi_account_create(&physics->account, &physics->cycle, &physics->world,
                             &physics->near.slots) &&
         hapi_feedback_create(&physics->feedback, &physics->cycle, &physics->world) &&
         hapi_probe_create(&physics->probe, &physics->cycle, &physics->world,
                           &physics->near.slots) &&
         hapi_cross_create(&physics->cross, &physics->cycle, &physics->near.slots,
                           &physics->probe) &&
         hapi_nearby_create(&physics->near, &physics->world, &physics->cycle) &&
         hapi_world_create(&physics->world, ode, c->joints, &physics->listener);
}

static bool init_locks(hapi_physics *physics)
{
  return pthread_mutex_init(&physics->edits.lock, NULL) == 0 &&
         pthread_mutex_init(&physics->drawing.lock, NULL) == 0 &&
         pthread_mutex_init(&physics->counts.lock, NULL) == 0 &&
         hapi_fair_lock_init(&physics->lock.fair);
}

/* The world as it is must be one that can be stepped. */
static hap_status check_world(hapi_physics *physics, hap_detail *detail)
{
  if (hapi_physics_scan(physics, false) < HAP_OK) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the table of bodies");
  }
  hapi_joints_scan(&physics->world);
  hap_detail text;
  if (hapi_physics_is_unsound(physics, &text)) {
    return hapi_fail(detail, HAP_ERROR_WORLD, "%s", text.text);
  }
  return HAP_OK;
}

hap_status hapi_physics_create(const hapi_physics_config *config, const struct hap_ode_def *ode,
                               hapi_physics **out, hap_detail *detail)
{
  *out = NULL;
  hapi_physics *physics = hapi_alloc(sizeof *physics);
  if (physics == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the physics side");
  }
  if (!hapi_claim_take(&physics->world.claim, ode->world)) {
    hapi_free(physics);
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "the world already has a session: destroy that one first");
  }
  physics->config = *config;
  physics->cycle.config = &physics->config;
  hapi_physics_listen(physics);
  physics->cycle.model = config->model;
  physics->wanted.latency_s = -1.0;
  atomic_init(&physics->wanted.model, (int)config->model);
  atomic_init(&physics->wanted.effects, config->effects);
  atomic_init(&physics->wanted.time_scale, 1.0F);
  physics->lookback.cycle = &physics->cycle;
  physics->lookback.world = &physics->world;
  physics->lookback.near = &physics->near;
  physics->dial.knobs = config->knobs;
  atomic_init(&physics->dial.wanted, config->accuracy);
  atomic_init(&physics->dial.force_error, config->force_error_wanted);
  atomic_init(&physics->dial.share[HAPI_DIAL_TICK], config->tick_share);
  atomic_init(&physics->dial.share[HAPI_DIAL_PHYSICS], config->physics_share);
  if (!init_locks(physics) || !physics_allocate(physics, ode)) {
    hapi_physics_destroy(physics);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the physics side");
  }
  hap_status taken =
      hapi_spaces_add(&physics->world.spaces, ode->space, HAP_SPACE_INSIDE | HAP_SPACE_OTHERS);
  if (taken < HAP_OK) {
    hapi_physics_destroy(physics);
    return hapi_fail(detail, taken,
                     taken == HAP_ERROR_STATE
                         ? "the space already has a session: destroy that one first, or make a "
                           "space for each world"
                         : "no memory for the physics side");
  }
  physics->world.asking->caller = (hapi_contact_caller){.call = ode->contact,
                                                        .user = ode->user,
                                                        .report = config->report,
                                                        .report_user = config->user};
  hap_status status = check_world(physics, detail);
  if (status < HAP_OK) {
    hapi_physics_destroy(physics);
    return status;
  }
  *out = physics;
  return HAP_OK;
}

const hapi_contact_caller *hapi_physics_caller(const hapi_physics *physics)
{
  return &physics->world.asking->caller;
}

bool hapi_physics_asks(const hapi_physics *physics)
{
  return hapi_physics_caller(physics)->call != NULL;
}

void hapi_physics_destroy(hapi_physics *physics)
{
  if (physics == NULL) {
    return;
  }
  hapi_physics_end(physics);
  hapi_nearby_finish(&physics->near);
  hapi_world_finish(&physics->world);
  hapi_account_finish(&physics->account);
  hapi_feedback_finish(&physics->feedback);
  hapi_poses_finish(&physics->drawing);
  hapi_probe_finish(&physics->probe);
  hapi_cross_finish(&physics->cross);
  hapi_lookback_finish(&physics->lookback);
  hapi_fair_lock_finish(&physics->lock.fair);
  pthread_mutex_destroy(&physics->edits.lock);
  pthread_mutex_destroy(&physics->drawing.lock);
  pthread_mutex_destroy(&physics->counts.lock);
  hapi_claim_release(&physics->world.claim);
  hapi_free(physics);
}

void hapi_physics_set_springs(hapi_physics *physics, const hapi_springs *springs)
{
  physics->world.springs = springs;
}

static void give_world_back(hapi_physics *physics)
{
  dJointGroupEmpty(physics->world.contact_group); /* joints of a world that is gone, too */
  physics->world.begun = false;
  hapi_world_unwatch(&physics->world);
  if (physics->world.gone) {
    hapi_log(HAP_LOG_ERROR, HAPI_WORLD_GONE_TEXT);
    hapi_islands_end(&physics->world);
    return;
  }
  /* What was destroyed since the last cycle must not be given anything back. */
  (void)hapi_physics_scan(physics, false); /* a body without memory for it was given nothing */
  const hapi_body_table *table = &physics->world.bodies;
  for (uint32_t i = 0; i < table->high; ++i) {
    if (table->entries[i].body != NULL) {
      hapi_sleep_give_back(&table->entries[i]);
    }
  }
  hapi_islands_end(&physics->world);
  if (physics->world.islands_threads != 0) {
    dWorldSetStepIslandsProcessingMaxThreadCount(physics->world.ode.world,
                                                 physics->world.islands_threads);
    physics->world.islands_threads = 0;
  }
}

static void physics_prepare(hapi_physics *physics)
{
  memset(&physics->counts.own, 0, sizeof physics->counts.own);
  memset(&physics->world.counts, 0, sizeof physics->world.counts);
  memset(&physics->account.counts, 0, sizeof physics->account.counts);
  physics->edits.run = 0;
  physics->tape.played_missed = physics->tape.played_dropped = 0;
  hapi_histogram_reset(&physics->counts.cycle_ns);
  hapi_lock_figures_reset(&physics->lock.figures);
  hapi_counts_show(physics);
  hapi_nearby_reset(&physics->near);
  for (uint32_t i = 0; i < physics->world.bodies.high; ++i) {
    physics->world.bodies.entries[i].loop_owned = false;
    physics->world.bodies.entries[i].posed = false; /* where it was put meanwhile it stands */
  }
  hapi_lookback_reset(&physics->lookback);
  hapi_dial_reset(&physics->dial,
                  hapi_tape_dial_at_start(&physics->tape,
                                          hapi_dial_percent(atomic_load(&physics->dial.wanted))));
  hapi_room_reset(&physics->room, &physics->config);
  hapi_physics_fill_settings(physics);
  hapi_probe_reset(&physics->probe);
  hapi_cross_reset(&physics->cross);
  physics->cycle.model = (hap_model)atomic_load(&physics->wanted.model);
  physics->cycle.wishes = atomic_load(&physics->wanted.effects);
  physics->cycle.physics_s = 1.0 / physics->config.physics_hz;
  atomic_store(&physics->wanted.period_ns, llround(1e9 * physics->cycle.physics_s));
  physics->cycle.probe_step_s = hapi_cycle_period(&physics->cycle, physics->cycle.model);
  physics->cycle.soft_s = hapi_cycle_test_s(&physics->cycle);
  physics->cycle.state = NULL;
  physics->cycle.step_s = 0.0;
  physics->cycle.time_scale = (double)atomic_load(&physics->wanted.time_scale);
  physics->cycle.step_scale = physics->cycle.time_scale;
  physics->cycle.model_number = 0;
  physics->world_faulty = false;
  physics->world.bodies.said_lost = false;
  physics->world.said_space = false;
  physics->world.islands_threads =
      dWorldGetStepIslandsProcessingMaxThreadCount(physics->world.ode.world);
  if (physics->config.lockstep || physics->tape.tape != NULL) {
    dWorldSetStepIslandsProcessingMaxThreadCount(physics->world.ode.world, 1);
  }
  if (physics->config.lockstep && physics->tape.tape == NULL) {
    dRandSetSeed(0);
  }
}

hap_status hapi_physics_begin(hapi_physics *physics, int64_t *start_ns, hap_detail *detail)
{
  if (physics->world.gone) {
    return hapi_fail(detail, HAP_ERROR_WORLD, HAPI_WORLD_GONE_TEXT);
  }
  physics->world.begun = true;
  hapi_world_watch(&physics->world);
  hapi_carriers_reset(&physics->world.carriers); /* what was moved meanwhile stands */
  hapi_account_reset(&physics->account);
  hapi_feedback_reset(&physics->feedback);
  hapi_slots_reset(&physics->near); /* the scan leaves what is local to others */
  hapi_joints_reset(
      &physics->world.joints); /* as for the meshes below; and walks are counted from 1 again */
  hap_status status = check_world(physics, detail);
  if (status >= HAP_OK) {
    status = hapi_tape_world(&physics->tape, &physics->world, &physics->wanted, detail);
  }
  if (status < HAP_OK) {
    give_world_back(physics);
    return status;
  }
  if (!hapi_islands_begin(&physics->world,
                          physics->config.lockstep || physics->tape.tape != NULL)) {
    give_world_back(physics);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for island_threads = %d",
                     physics->world.ode.island_threads);
  }
  hapi_lock_claim(&physics->lock); /* surfaces are asked for */
  physics_prepare(physics);
  hapi_physics_enter_dial(physics);
  hapi_physics_take_state(physics);
  hapi_physics_collide(physics);
  hapi_neighbors_collect(&physics->near);
  hapi_neighbors_find(&physics->near);
  hapi_physics_test(physics);
  hapi_dial_leave(&physics->dial, physics->world.ode.world);
  *start_ns = physics->config.lockstep ? 0 : hapi_clock_now();
  hapi_tape_start(&physics->tape, start_ns);
  physics->pace.start_ns = *start_ns;
  physics->cycle.last_cycle_ns = *start_ns;
  hapi_poses_reset(&physics->drawing);
  const int64_t times_ns[2] = {*start_ns, *start_ns};
  hapi_poses_publish(&physics->drawing, &physics->world, &physics->near.slots, &physics->cycle,
                     times_ns);
  hapi_physics_make_model(physics, *start_ns, *start_ns);
  hapi_physics_send_model(physics);
  hapi_tape_started(&physics->tape, &physics->cycle);
  hapi_reconcile_leave(&physics->account);
  hapi_slots_release(&physics->near);
  hapi_lock_unclaim(&physics->lock);
  hapi_counts_show(physics);
  return HAP_OK;
}

void hapi_physics_end(hapi_physics *physics)
{
  if (!physics->world.begun) {
    return;
  }
  hapi_physics_stop_thread(physics);
  hapi_lock_enter(&physics->lock);
  for (int round = 0; round < LAST_ROUNDS; ++round) {
    hapi_physics_run_edits(physics);
  }
  hapi_counts_show(physics);
  give_world_back(physics);
  hapi_lock_leave(&physics->lock);
}

/* ---- what the session asks for ---- */

const char *hapi_physics_ode_configuration(void)
{
  return dGetConfiguration();
}

hap_status hapi_physics_post(hapi_physics *physics, hap_edit_fn edit, void *arg)
{
  return hapi_edits_post(&physics->edits, edit, arg);
}

void hapi_physics_close(hapi_physics *physics)
{
  hapi_edits_close(&physics->edits);
  hapi_lock_enter(&physics->lock);
  hapi_physics_run_edits(physics); /* all of them: no more can come */
  hapi_lock_leave(&physics->lock);
}

bool hapi_physics_in_callback(const hapi_physics *physics)
{
  return hapi_lock_in_callback(&physics->lock);
}

bool hapi_physics_lock_is_mine(hapi_physics *physics)
{
  return hapi_fair_lock_is_mine(&physics->lock.fair);
}

bool hapi_physics_may_edit(hapi_physics *physics)
{
  if (hapi_lock_in_callback(&physics->lock)) {
    return physics->lock.editable;
  }
  return !physics->world.begun || physics->config.lockstep ||
         hapi_fair_lock_is_mine(&physics->lock.fair);
}

hap_status hapi_physics_lock(hapi_physics *physics, int64_t timeout_ns)
{
  hap_status status = hapi_lock_take(&physics->lock, timeout_ns);
  if (status >= HAP_OK) {
    ++physics->tape.locks; /* by who has the lock */
  }
  return status;
}

/* What was made meanwhile can be drawn at once. */
hap_status hapi_physics_unlock(hapi_physics *physics)
{
  if (physics->world.begun && hapi_physics_lock_is_mine(physics)) {
    hapi_physics_see(physics, false);
  }
  return hapi_lock_give(&physics->lock);
}

int64_t hapi_physics_last_cycle(const hapi_physics *physics)
{
  return physics->cycle.last_cycle_ns;
}

double hapi_physics_period(const hapi_physics *physics)
{
  return hapi_cycle_period(&physics->cycle, physics->cycle.model);
}

double hapi_physics_next_period(const hapi_physics *physics)
{
  return hapi_wanted_period(&physics->wanted, &physics->config);
}

void hapi_physics_set_tape(hapi_physics *physics, hapi_tape *tape)
{
  physics->tape.tape = tape;
}

void hapi_physics_set_calls(hapi_physics *physics, const hapi_physics_calls *calls)
{
  physics->calls = *calls;
}

void hapi_physics_set_exchange(hapi_physics *physics, hapi_exchange *exchange)
{
  physics->config.exchange = exchange;
}

void hapi_physics_set_latency(hapi_physics *physics, double seconds)
{
  physics->wanted.latency_s = seconds;
}

void hapi_physics_set_model(hapi_physics *physics, hap_model model)
{
  atomic_store(&physics->wanted.model, (int)model);
}

hap_model hapi_physics_wanted_model(hapi_physics *physics)
{
  return (hap_model)atomic_load(&physics->wanted.model);
}

/* Several threads may wish for something at a time. */
void hapi_physics_set_effect(hapi_physics *physics, hap_effect effect, hap_effect_wish wish)
{
  uint32_t before = atomic_load(&physics->wanted.effects);
  while (!atomic_compare_exchange_weak(&physics->wanted.effects, &before,
                                       hapi_wish_set(before, effect, wish))) {
  }
}

void hapi_physics_set_time_scale(hapi_physics *physics, double scale)
{
  atomic_store(&physics->wanted.time_scale, (float)scale);
}

void hapi_physics_set_period(hapi_physics *physics, int64_t period_ns)
{
  atomic_store(&physics->wanted.period_ns, period_ns);
}

uint32_t hapi_physics_wanted_effects(hapi_physics *physics)
{
  return atomic_load(&physics->wanted.effects);
}

void hapi_physics_set_accuracy(hapi_physics *physics, double accuracy)
{
  atomic_store(&physics->dial.wanted, accuracy);
}

void hapi_physics_set_force_error(hapi_physics *physics, double wanted)
{
  atomic_store(&physics->dial.force_error, wanted);
}

void hapi_physics_set_budget(hapi_physics *physics, double tick_share, double physics_share)
{
  atomic_store(&physics->dial.share[HAPI_DIAL_TICK], tick_share);
  atomic_store(&physics->dial.share[HAPI_DIAL_PHYSICS], physics_share);
}

bool hapi_physics_steps_to_now(const hapi_physics *physics)
{
  return hapi_cycle_steps_to_now(&physics->cycle);
}
