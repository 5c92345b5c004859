/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Going over a window: the reference of a tick is what ODE and the loop's tick of model SINGLE make of it, with
 * the bodies where they are by that reckoning. */

#define ITERATIONS 2         /* times those of the world: what they leave undone shows as well */
#define ITERATIONS_LEAST 200 /* where there is time for them */
#define RATE_HZ 1000.0       /* at least, of its steps */
#define APART_M 0.5          /* from the session's body: it would not know what is there */

/* ---- which geoms there still are ---- */

static bool see_geoms(hapi_lookback *w, dSpaceID space, uint32_t *count)
{
  int geoms = dSpaceGetNumGeoms(space);
  if (!hapi_index_reserve(&w->geoms, *count + (uint32_t)geoms)) {
    return false;
  }
  for (int i = 0; i < geoms; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    hapi_index_put(&w->geoms, hapi_index_address(geom), 0);
    ++*count;
    if (dGeomIsSpace(geom) && !see_geoms(w, (dSpaceID)geom, count)) {
      return false;
    }
  }
  return true;
}

static bool there(const hapi_lookback *w, dGeomID geom)
{
  return hapi_index_get(&w->geoms, hapi_index_address(geom)) != HAPI_INDEX_NONE;
}

static bool find_geoms(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  uint32_t count = 0;
  hapi_index_clear(&w->geoms);
  if (!see_geoms(w, physics->world.ode.space, &count)) {
    return false;
  }
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    w->pairs[i].there = there(w, w->pairs[i].a) && there(w, w->pairs[i].b);
  }
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    w->touches[i].there = w->touches[i].geom != NULL && there(w, w->touches[i].geom);
  }
  return true;
}

/* ---- contacts between bodies ---- */

static bool under_test(const hapi_physics *physics, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&physics->world.bodies, body);
  return known != HAPI_NONE && hapi_test_has(&physics->lookback.test, known);
}

static bool boxes_meet(dGeomID a, dGeomID b)
{
  dReal x[6];
  dReal y[6];
  dGeomGetAABB(a, x);
  dGeomGetAABB(b, y);
  return x[0] <= y[1] && y[0] <= x[1] && x[2] <= y[3] && y[2] <= x[3] && x[4] <= y[5] &&
         y[4] <= x[5];
}

/* What is not under test stands still. */
static void collide(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  dJointGroupEmpty(physics->world.contact_group);
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    const hapi_lookback_pair *pair = &w->pairs[i];
    if (!pair->there || !dGeomIsEnabled(pair->a) || !dGeomIsEnabled(pair->b) ||
        !boxes_meet(pair->a, pair->b)) {
      continue;
    }
    dBodyID body_a = dGeomGetBody(pair->a);
    dBodyID body_b = dGeomGetBody(pair->b);
    body_a = under_test(physics, body_a) ? body_a : NULL;
    body_b = under_test(physics, body_b) ? body_b : NULL;
    bool awake =
        (body_a != NULL && dBodyIsEnabled(body_a)) || (body_b != NULL && dBodyIsEnabled(body_b));
    if (awake) {
      const hapi_touching touching = {{pair->a, pair->b}, {body_a, body_b}};
      dSurfaceParameters surface = pair->surface;
      physics->counts.own.stats.faults.contacts_rejected += hapi_world_make_contacts(
          &physics->world, &physics->cycle, &touching, &surface, HAPI_CONTACT_PLAIN);
    }
  }
}

/* ---- what comes out ---- */

/* What is felt is held until the next row. */
static void compare(hapi_physics *physics, const hapi_path_pointer *row)
{
  hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < physics->config.capacity.pointers; ++i) {
    double wrong[3];
    const double *felt = row[i].wrench.force;
    const double *right = hapi_lookback_felt(w, i);
    if (row[i].generation == 0) {
      continue;
    }
    hapi_v3_sub(felt, right, wrong);
    if (hapi_v3_dot(right, right) > 0.0 || hapi_v3_dot(felt, felt) > 0.0) {
      w->wrong2 += hapi_v3_dot(wrong, wrong);
      w->right2 += hapi_v3_dot(right, right);
      ++w->touched;
    }
  }
}

/* ---- steps ---- */

static void add_wrenches(hapi_physics *physics)
{
  const hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    dBodyID body = physics->world.bodies.entries[w->bodies[i].known].body;
    const double *f = w->bodies[i].wrench;
    if (dBodyIsEnabled(body)) {
      dBodyAddForce(body, f[0], f[1], f[2]);
      dBodyAddTorque(body, f[3], f[4], f[5]);
    }
  }
}

/* One that is no more is not to be stepped: ODE would abort the process. */
static bool sound(const hapi_physics *physics)
{
  const hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    if (!hapi_pose_is_sound(physics->world.bodies.entries[w->bodies[i].known].body)) {
      return false;
    }
  }
  return true;
}

static double period_of(const hapi_physics *physics, uint32_t row)
{
  const hapi_lookback *w = &physics->lookback;
  return row + 1 < w->row_count ? 1e-9 * (double)(w->times_ns[row + 1] - w->times_ns[row])
                                : 1.0 / w->haptic_hz;
}

/* Steps from a row to the next one. */
static int parts_of(double haptic_hz)
{
  return haptic_hz < RATE_HZ ? (int)ceil(RATE_HZ / haptic_hz - 1e-6) : 1;
}

static bool go_over(hapi_physics *physics, uint32_t row)
{
  hapi_lookback *w = &physics->lookback;
  uint32_t count = physics->config.capacity.pointers;
  int parts = parts_of(w->haptic_hz);
  double period = period_of(physics, row) / parts;
  for (int i = 0; i < parts; ++i) {
    const hapi_lookback_moment at = {
        .row = &w->path[row * count],
        .next = row + 1 < w->row_count ? &w->path[(row + 1) * count] : NULL,
        .share = (double)i / parts,
        .later_s = i * period,
        .period = period};
    if (!hapi_lookback_feel(physics, &at)) {
      return false;
    }
    compare(physics, at.row);
    add_wrenches(physics);
    collide(physics);
    ++physics->counts.own.stats.physics.quickstep_calls;
    dWorldQuickStep(physics->world.ode.world, period);
    if (!sound(physics)) {
      return false;
    }
  }
  return true;
}

static void put_states(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  hapi_snapshot states = {.bodies = w->states, .body_count = w->body_count, .seed = w->seed};
  hapi_snapshot_rewind(&states);
  for (uint32_t i = 0; i < w->body_count; ++i) {
    dBodySetForce(w->states[i].body, 0.0, 0.0, 0.0);
    dBodySetTorque(w->states[i].body, 0.0, 0.0, 0.0);
    if (w->states[i].enabled) {
      dBodyEnable(w->states[i].body);
    } else {
      dBodyDisable(w->states[i].body);
    }
  }
}

/* Where the bodies were at the first row, of which some were kept a part of a tick before or after. */
static void even_out(hapi_physics *physics)
{
  const hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    dBodyID body = w->states[i].body;
    double lag = 1e-9 * (double)w->bodies[i].lag_ns;
    const dReal *p = dBodyGetPosition(body);
    const dReal *v = dBodyGetLinearVel(body);
    dBodySetPosition(body, p[0] + lag * v[0], p[1] + lag * v[1], p[2] + lag * v[2]);
  }
}

void hapi_lookback_keep(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  hapi_snapshot states = {.bodies = w->states, .body_capacity = w->state_capacity};
  hapi_snapshot_clear(&states);
  for (uint32_t i = 0; i < w->body_count; ++i) {
    hapi_snapshot_add_body(&states, physics->world.bodies.entries[w->bodies[i].known].body, NULL);
  }
  w->seed = states.seed;
}

static const hapi_body_state *end_of(const hapi_lookback *w, const hapi_lookback_body *body)
{
  for (uint32_t i = 0; i < w->ended_count; ++i) {
    if (w->ended[i].known == body->known && w->ended[i].birth == body->birth) {
      return &w->ends[i];
    }
  }
  return NULL;
}

/* Whether the reference of the window before ended when this one begins, and not too far from where the
 * session is. */
static bool can_chain(const hapi_lookback *w)
{
  double apart_s = 1e-9 * fabs((double)(w->times_ns[0] - w->end_ns));
  bool good = w->end_ns != 0 && apart_s < 0.5 / w->haptic_hz;
  for (uint32_t i = 0; i < w->body_count && good; ++i) {
    const hapi_body_state *end = end_of(w, &w->bodies[i]);
    double apart[3] = {0.0};
    if (end != NULL) {
      hapi_v3_sub(end->position, w->states[i].position, apart);
    }
    good = hapi_v3_norm(apart) < APART_M;
  }
  return good;
}

/* Goes on from there; a body that was not part of it comes in as the session has it. */
static void chain(hapi_physics *physics)
{
  hapi_lookback *w = &physics->lookback;
  w->chained = can_chain(w);
  w->chain_s = w->chained ? w->chain_s : 0.0;
  if (!w->chained) {
    hapi_lookback_hand_begin(&w->hand);
  }
  for (uint32_t i = 0; i < w->body_count && w->chained; ++i) {
    const hapi_body_state *end = end_of(w, &w->bodies[i]);
    if (end != NULL) {
      w->states[i] = *end;
      w->bodies[i].lag_ns = 0;
    }
  }
}

static int iterations_of(const hapi_lookback *w, int world)
{
  int more = ITERATIONS * world;
  return !w->lean && more < ITERATIONS_LEAST ? ITERATIONS_LEAST : more;
}

static bool go(hapi_physics *physics, double seconds)
{
  hapi_lookback *w = &physics->lookback;
  int64_t begin_ns = hapi_clock_now();
  int iterations = dWorldGetQuickStepNumIterations(physics->world.ode.world);
  hap_model model = physics->cycle.model;
  bool good = true;
  physics->cycle.model = HAP_MODEL_SINGLE; /* whose step this is */
  w->haptic_hz = physics->config.haptic_hz;
  physics->config.haptic_hz = parts_of(w->haptic_hz) * w->haptic_hz;
  dWorldSetQuickStepNumIterations(physics->world.ode.world,
                                  iterations_of(w, physics->dial.own_iterations));
  hapi_meant meant;
  hapi_world_convert(&physics->world, hapi_step_ratio(&physics->cycle), &meant);
  bool first = w->next == 0;
  if (first) {
    chain(physics);
  }
  put_states(physics);
  if (first) {
    even_out(physics);
  }
  while (good && w->next < w->row_count &&
         (seconds < 0.0 || 1e-9 * (double)(hapi_clock_now() - begin_ns) < seconds)) {
    good = go_over(physics, w->next++);
  }
  w->spent_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  hapi_lookback_keep(physics);
  dJointGroupEmpty(physics->world.contact_group);
  hapi_world_restore(&physics->world, &meant);
  dWorldSetQuickStepNumIterations(physics->world.ode.world, iterations);
  physics->config.haptic_hz = w->haptic_hz;
  physics->cycle.model = model;
  return good;
}

static hap_status enter(hapi_lookback *w, const hapi_world *world, double step_s)
{
  hap_status status = hapi_test_begin(&w->test, world, step_s);
  for (uint32_t i = 0; i < w->body_count && status >= HAP_OK; ++i) {
    status = hapi_test_add_body(&w->test, w->bodies[i].known);
  }
  return status >= HAP_OK ? hapi_test_enter(&w->test) : status;
}

hap_status hapi_lookback_run(hapi_physics *physics, double seconds)
{
  hapi_lookback *w = &physics->lookback;
  uint64_t searched = physics->near.range.number;
  if (!find_geoms(physics)) {
    return HAP_ERROR_MEMORY;
  }
  hap_status status = enter(w, &physics->world, physics->cycle.probe_step_s);
  if (status >= HAP_OK) {
    status = w->row_count == 0 || go(physics, seconds) ? status : HAP_ERROR_STATE;
    hapi_test_leave(&w->test);
  }
  physics->near.range.number = searched; /* of the meshes that were asked */
  return status;
}
