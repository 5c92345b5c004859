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

#define CANDIDATES_PER_CONTACT 8u
#define LAST_ROUNDS 16 /* of edits, when the session stops: also of what edits post */

static bool allocate(hapi_physics *physics)
{
  const hapi_capacity *c = &physics->config.capacity;
  hapi_neighborhood *hood = &physics->neighborhood;
  hood->candidate_capacity = CANDIDATES_PER_CONTACT * c->contacts; /* grows when needed */
  physics->bodies = hapi_alloc_array(c->bodies, sizeof *physics->bodies);
  physics->contacts = hapi_alloc_array(c->contacts, sizeof *physics->contacts);
  physics->crosses = hapi_alloc_array(c->crosses, sizeof *physics->crosses);
  hood->candidates = hapi_alloc_array(hood->candidate_capacity, sizeof *hood->candidates);
  hood->hits = hapi_alloc_array(hood->candidate_capacity, sizeof *hood->hits);
  physics->test.contacts = hapi_alloc_array(c->contacts, sizeof *physics->test.contacts);
  physics->test.bodies = hapi_alloc_array(c->bodies, sizeof *physics->test.bodies);
  physics->test.base = hapi_alloc_array(c->bodies, sizeof *physics->test.base);
  physics->test.rounds = hapi_alloc_array(c->contacts, sizeof *physics->test.rounds);
  hood->vertices = hapi_alloc_array(HAPI_HULL_POINTS, sizeof *hood->vertices);
  hood->hull = hapi_alloc_array(HAPI_HULL_POINTS, 3 * sizeof *hood->hull);
  physics->contact_scratch =
      hapi_alloc_array((size_t)physics->ode.max_contacts_per_pair, sizeof(dContact));
  return physics->bodies != NULL && physics->contacts != NULL && physics->crosses != NULL &&
         hood->candidates != NULL && hood->hits != NULL && hood->vertices != NULL &&
         hood->hull != NULL && physics->test.contacts != NULL && physics->test.rounds != NULL &&
         physics->test.bodies != NULL && physics->test.base != NULL && hapi_range_create(physics) &&
         hapi_joints_create(physics) && hapi_cover_create(&hood->cover) &&
         physics->contact_scratch != NULL && hapi_bodies_init(&physics->table) == HAP_OK;
}

static bool init_locks(hapi_physics *physics)
{
  return pthread_mutex_init(&physics->edits_lock, NULL) == 0 &&
         pthread_mutex_init(&physics->poses_lock, NULL) == 0 &&
         pthread_mutex_init(&physics->shown_lock, NULL) == 0 && hapi_fair_lock_init(&physics->lock);
}

/* The world as it is must be one that can be stepped. */
static hap_status check_world(hapi_physics *physics, hap_detail *detail)
{
  if (hapi_bodies_scan(physics) < HAP_OK) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the table of bodies");
  }
  hapi_joints_scan(physics);
  hap_detail text;
  if (hapi_world_is_unsound(physics, &text)) {
    return hapi_fail(detail, HAP_ERROR_WORLD, "%s", text.text);
  }
  return HAP_OK;
}

static void release_bodies(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->table.high; ++i) {
    if (physics->table.entries[i].body != NULL) {
      hapi_sleep_give_back(&physics->table.entries[i]);
    }
  }
}

hap_status hapi_physics_create(const hapi_physics_config *config, const struct hap_ode_def *ode,
                               hapi_physics **out, hap_detail *detail)
{
  *out = NULL;
  hapi_physics *physics = hapi_alloc(sizeof *physics);
  if (physics == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the physics side");
  }
  if (!hapi_claim_take(&physics->claim, ode->world)) {
    hapi_free(physics);
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "the world already has a session: destroy that one first");
  }
  physics->config = *config;
  physics->ode = *ode;
  physics->model = config->model;
  physics->latency_s = -1.0;
  atomic_init(&physics->wanted_model, (int)config->model);
  atomic_init(&physics->wanted_effects, config->effects);
  physics->dial.knobs = config->knobs;
  atomic_init(&physics->dial.wanted, config->accuracy);
  atomic_init(&physics->dial.force_error, config->force_error_wanted);
  atomic_init(&physics->dial.share[HAPI_DIAL_TICK], config->tick_share);
  atomic_init(&physics->dial.share[HAPI_DIAL_PHYSICS], config->physics_share);
  if (!init_locks(physics) || !allocate(physics)) {
    hapi_physics_destroy(physics);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the physics side");
  }
  physics->neighborhood.probe_geom = dCreateSphere(NULL, 1.0);
  physics->neighborhood.plane_geom = dCreatePlane(NULL, 0.0, 0.0, 1.0, 0.0);
  physics->contact_group = dJointGroupCreate(0);
  physics->carried_group = dJointGroupCreate(0);
  hapi_slots_reset(physics);
  hap_status status = check_world(physics, detail);
  if (status < HAP_OK) {
    hapi_physics_destroy(physics);
    return status;
  }
  *out = physics;
  return HAP_OK;
}

void hapi_physics_destroy(hapi_physics *physics)
{
  if (physics == NULL) {
    return;
  }
  hapi_physics_end(physics);
  if (physics->neighborhood.probe_geom != NULL) {
    dGeomDestroy(physics->neighborhood.probe_geom);
    dGeomDestroy(physics->neighborhood.plane_geom);
  }
  if (physics->contact_group != NULL) {
    dJointGroupDestroy(physics->contact_group);
    dJointGroupDestroy(physics->carried_group);
  }
  hapi_bodies_finish(&physics->table);
  hapi_free(physics->surfaces.entries);
  hapi_range_finish(physics);
  hapi_joints_finish(&physics->joints);
  hapi_meshes_finish(&physics->meshes);
  hapi_snapshot_finish(&physics->snapshot);
  hapi_test_finish(&physics->test);
  hapi_reuse_finish(physics);
  hapi_lookback_finish(&physics->lookback);
  hapi_free(physics->bodies);
  hapi_free(physics->contacts);
  hapi_free(physics->crosses);
  hapi_cover_finish(&physics->neighborhood.cover);
  hapi_free(physics->neighborhood.candidates);
  hapi_free(physics->neighborhood.hits);
  hapi_free(physics->tools.points);
  hapi_free(physics->neighborhood.vertices);
  hapi_free(physics->neighborhood.hull);
  hapi_free(physics->contact_scratch);
  hapi_fair_lock_finish(&physics->lock);
  pthread_mutex_destroy(&physics->edits_lock);
  pthread_mutex_destroy(&physics->poses_lock);
  pthread_mutex_destroy(&physics->shown_lock);
  hapi_claim_release(&physics->claim);
  hapi_free(physics);
}

static void give_world_back(hapi_physics *physics)
{
  dJointGroupEmpty(physics->contact_group);
  dJointGroupEmpty(physics->carried_group);
  /* What was destroyed since the last cycle must not be given anything back. */
  (void)hapi_bodies_scan(physics); /* a body without memory for it was given nothing */
  release_bodies(physics);
  hapi_islands_end(physics);
  if (physics->islands_threads != 0) {
    dWorldSetStepIslandsProcessingMaxThreadCount(physics->ode.world, physics->islands_threads);
    physics->islands_threads = 0;
  }
  physics->begun = false;
}

static void reset_figures(hapi_physics *physics)
{
  memset(&physics->figures, 0, sizeof physics->figures);
  hapi_histogram_reset(&physics->cycle_ns);
  hapi_lock_figures_reset(&physics->lock_figures);
  hapi_counts_show(physics);
}

double hapi_period_of(const hapi_physics *physics, hap_model model)
{
  return 1.0 / (model == HAP_MODEL_SINGLE ? physics->config.haptic_hz : physics->config.physics_hz);
}

static void build_first_model(hapi_physics *physics)
{
  hapi_dial_enter(physics);
  hapi_reconcile_take(physics);
  hapi_world_collide(physics);
  hapi_neighbors_collect(physics);
  hapi_neighbors_find(physics);
  hapi_accelerance_measure(physics);
  hapi_operating_point_measure(physics);
  hapi_range_error_measure(physics);
  hapi_dial_leave(physics);
}

static void prepare(hapi_physics *physics)
{
  reset_figures(physics);
  hapi_range_reset(physics);
  hapi_lookback_reset(physics);
  hapi_dial_reset(physics);
  hapi_reuse_reset(physics);
  hapi_meshes_finish(&physics->meshes); /* the application may have changed them */
  physics->model = (hap_model)atomic_load(&physics->wanted_model);
  physics->wishes = atomic_load(&physics->wanted_effects);
  physics->probe_step_s = hapi_period_of(physics, physics->model);
  physics->state = NULL;
  physics->step_s = 0.0;
  physics->model_number = 0;
  physics->cross_count = 0;
  physics->world_faulty = false;
  physics->table.said_lost = false;
  physics->islands_threads = dWorldGetStepIslandsProcessingMaxThreadCount(physics->ode.world);
  if (physics->config.lockstep || physics->tape != NULL) {
    dWorldSetStepIslandsProcessingMaxThreadCount(physics->ode.world, 1);
  }
  if (physics->config.lockstep && physics->tape == NULL) {
    dRandSetSeed(0);
  }
}

hap_status hapi_physics_begin(hapi_physics *physics, int64_t *start_ns, hap_detail *detail)
{
  physics->begun = true;
  hapi_slots_reset(physics);  /* of a session before: the scan leaves what is local to others */
  hapi_joints_reset(physics); /* as for the meshes below; and walks are counted from 1 again */
  hap_status status = check_world(physics, detail);
  if (status >= HAP_OK) {
    status = hapi_tape_world(physics, detail);
  }
  if (status < HAP_OK) {
    give_world_back(physics);
    return status;
  }
  if (!hapi_islands_begin(physics)) {
    give_world_back(physics);
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for island_threads = %d",
                     physics->ode.island_threads);
  }
  hapi_physics_claim(physics); /* surfaces are asked for */
  prepare(physics);
  build_first_model(physics);
  *start_ns = physics->config.lockstep ? 0 : hapi_clock_now();
  hapi_tape_start(physics, start_ns);
  physics->start_ns = *start_ns;
  physics->last_cycle_ns = *start_ns;
  hapi_poses_reset(physics);
  hapi_poses_publish(physics, *start_ns, *start_ns);
  hapi_publish_model(physics, *start_ns, *start_ns);
  hapi_tape_started(physics);
  hapi_reconcile_leave(physics);
  hapi_physics_unclaim(physics);
  hapi_counts_show(physics);
  return HAP_OK;
}

void hapi_physics_end(hapi_physics *physics)
{
  if (!physics->begun) {
    return;
  }
  hapi_physics_stop_thread(physics);
  hapi_physics_enter(physics);
  for (int round = 0; round < LAST_ROUNDS; ++round) {
    hapi_edits_run(physics);
  }
  hapi_counts_show(physics);
  give_world_back(physics);
  hapi_physics_leave(physics);
}

int64_t hapi_physics_last_cycle(const hapi_physics *physics)
{
  return physics->last_cycle_ns;
}

double hapi_physics_period(const hapi_physics *physics)
{
  return hapi_period_of(physics, physics->model);
}

double hapi_physics_next_period(const hapi_physics *physics)
{
  return hapi_period_of(physics, (hap_model)atomic_load(&physics->wanted_model));
}

void hapi_physics_set_tape(hapi_physics *physics, hapi_tape *tape)
{
  physics->tape = tape;
}

void hapi_physics_set_latency(hapi_physics *physics, double seconds)
{
  physics->latency_s = seconds;
}

void hapi_physics_set_model(hapi_physics *physics, hap_model model)
{
  atomic_store(&physics->wanted_model, (int)model);
}

hap_model hapi_physics_wanted_model(hapi_physics *physics)
{
  return (hap_model)atomic_load(&physics->wanted_model);
}

/* Several threads may wish for something at a time. */
void hapi_physics_set_effect(hapi_physics *physics, hap_effect effect, hap_effect_wish wish)
{
  uint32_t before = atomic_load(&physics->wanted_effects);
  while (!atomic_compare_exchange_weak(&physics->wanted_effects, &before,
                                       hapi_wish_set(before, effect, wish))) {
  }
}

uint32_t hapi_physics_wanted_effects(hapi_physics *physics)
{
  return atomic_load(&physics->wanted_effects);
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
  return physics->model != HAP_MODEL_IMPULSE;
}

void hapi_physics_say_once(hapi_physics *physics, bool *io_said, const char *text)
{
  if (!*io_said) {
    hapi_log(HAP_LOG_WARNING, "%s", text);
    physics->config.report(physics->config.user, HAP_FAULT_NONE, text);
  }
  *io_said = true;
}
