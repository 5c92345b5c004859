/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/lookback_window.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/vec.h"

/* Going over a window: the reference of a tick is what ODE and the loop's tick of model SINGLE
 * make of it, with the bodies where they are by that reckoning. */

#define ITERATIONS 2         /* times those of the world: what they leave undone shows as well */
#define ITERATIONS_LEAST 200 /* where there is time for them */
#define RATE_HZ 1000.0       /* at least, of its steps */
#define APART_M 0.5          /* from the session's body: it would not know what is there */

/* ---- which geoms there still are ---- */

static bool window_see_geoms(hapi_lookback *w, dSpaceID space, uint32_t *count)
{
  int geoms = dSpaceGetNumGeoms(space);
  if (!hapi_index_reserve(&w->geoms, *count + (uint32_t)geoms)) {
    return false;
  }
  for (int i = 0; i < geoms; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    hapi_index_put(&w->geoms, hapi_index_address(geom), 0);
    ++*count;
    if (dGeomIsSpace(geom) && !window_see_geoms(w, (dSpaceID)geom, count)) {
      return false;
    }
  }
  return true;
}

static bool geom_is_there(const hapi_lookback *w, dGeomID geom)
{
  return hapi_index_get(&w->geoms, hapi_index_address(geom)) != HAPI_INDEX_NONE;
}

static bool window_find_geoms(hapi_lookback *w, dSpaceID space)
{
  uint32_t count = 0;
  hapi_index_clear(&w->geoms);
  if (!window_see_geoms(w, space, &count)) {
    return false;
  }
  for (uint32_t i = 0; i < w->pairs.count; ++i) {
    w->pairs.list[i].there =
        geom_is_there(w, w->pairs.list[i].a) && geom_is_there(w, w->pairs.list[i].b);
  }
  for (uint32_t i = 0; i < w->touches.count; ++i) {
    w->touches.list[i].there =
        w->touches.list[i].geom != NULL && geom_is_there(w, w->touches.list[i].geom);
  }
  return true;
}

/* ---- contacts between bodies ---- */

static bool body_is_under_test(const hapi_test_set *test, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&test->world->bodies, body);
  return known != HAPI_NONE && hapi_test_has(test, known);
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
static void window_collide(hapi_lookback *w, const hapi_cycle *cycle)
{
  dJointGroupEmpty(w->test.world->contact_group);
  for (uint32_t i = 0; i < w->pairs.count; ++i) {
    const hapi_lookback_pair *pair = &w->pairs.list[i];
    if (!pair->there || !dGeomIsEnabled(pair->a) || !dGeomIsEnabled(pair->b) ||
        !boxes_meet(pair->a, pair->b)) {
      continue;
    }
    dBodyID body_a = dGeomGetBody(pair->a);
    dBodyID body_b = dGeomGetBody(pair->b);
    body_a = body_is_under_test(&w->test, body_a) ? body_a : NULL;
    body_b = body_is_under_test(&w->test, body_b) ? body_b : NULL;
    bool awake =
        (body_a != NULL && dBodyIsEnabled(body_a)) || (body_b != NULL && dBodyIsEnabled(body_b));
    if (awake) {
      const hapi_touching touching = {{pair->a, pair->b}, {body_a, body_b}};
      dSurfaceParameters surface = pair->surface;
      w->counts.contacts_rejected +=
          hapi_world_make_contacts(w->test.world, cycle, &touching, &surface, false);
    }
  }
}

/* ---- what comes out ---- */

/* What is felt is held until the next row. */
static void window_compare(hapi_lookback *w, const hapi_path_pointer *row)
{
  for (uint32_t i = 0; i < w->rows.pointers; ++i) {
    double wrong[3];
    const double *felt = row[i].wrench.force;
    const double *right = hapi_lookback_felt(w, i);
    if (row[i].generation == 0) {
      continue;
    }
    hapi_v3_sub(felt, right, wrong);
    if (hapi_v3_dot(right, right) > 0.0 || hapi_v3_dot(felt, felt) > 0.0) {
      w->sums.wrong2 += hapi_v3_dot(wrong, wrong);
      w->sums.right2 += hapi_v3_dot(right, right);
      ++w->sums.touched;
    }
  }
}

/* ---- steps ---- */

static void window_add_wrenches(const hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodyID body = w->test.world->bodies.entries[w->bodies.list[i].known].body;
    const double *f = w->bodies.list[i].wrench;
    if (dBodyIsEnabled(body)) {
      dBodyAddForce(body, f[0], f[1], f[2]);
      dBodyAddTorque(body, f[3], f[4], f[5]);
    }
  }
}

/* One that is no more is not to be stepped: ODE would abort the process. */
static bool window_is_sound(const hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    if (!hapi_pose_is_sound(w->test.world->bodies.entries[w->bodies.list[i].known].body)) {
      return false;
    }
  }
  return true;
}

static double row_period(const hapi_lookback *w, double haptic_hz, uint32_t row)
{
  return row + 1 < w->rows.count
             ? 1e-9 * (double)(w->rows.times_ns[row + 1] - w->rows.times_ns[row])
             : 1.0 / haptic_hz;
}

/* Steps from a row to the next one. */
static int row_parts(double haptic_hz)
{
  return haptic_hz < RATE_HZ ? (int)ceil(RATE_HZ / haptic_hz - 1e-6) : 1;
}

/* as_single: the cycle as that of a session of model SINGLE at the reference's own rate. */
static bool row_go_over(hapi_lookback *w, const hapi_cycle *as_single, double haptic_hz,
                        uint32_t row)
{
  HAPI_ASSERT_INDEX(row, w->rows.count);
  uint32_t count = w->rows.pointers;
  int parts = row_parts(haptic_hz);
  double period = row_period(w, haptic_hz, row) / parts;
  for (int i = 0; i < parts; ++i) {
    const hapi_lookback_moment at = {
        .row = &w->rows.path[row * count],
        .next = row + 1 < w->rows.count ? &w->rows.path[(row + 1) * count] : NULL,
        .share = (double)i / parts,
        .later_s = i * period,
        .period = period};
    if (!hapi_lookback_feel(w, as_single->wishes, &at)) {
      return false;
    }
    window_compare(w, at.row);
    window_add_wrenches(w);
    window_collide(w, as_single);
    ++w->counts.steps;
    dWorldQuickStep(w->test.world->ode.world, period);
    if (!window_is_sound(w)) {
      return false;
    }
  }
  return true;
}

static void window_put_states(hapi_lookback *w)
{
  hapi_snapshot states = {
      .bodies = w->bodies.states, .body_count = w->bodies.count, .seed = w->bodies.seed};
  hapi_snapshot_rewind(&states);
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodySetForce(w->bodies.states[i].body, 0.0, 0.0, 0.0);
    dBodySetTorque(w->bodies.states[i].body, 0.0, 0.0, 0.0);
    if (w->bodies.states[i].enabled) {
      dBodyEnable(w->bodies.states[i].body);
    } else {
      dBodyDisable(w->bodies.states[i].body);
    }
  }
}

/* Where the bodies were at the first row, of which some were kept a part of a tick before or
 * after. */
static void window_even_out(const hapi_lookback *w)
{
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    dBodyID body = w->bodies.states[i].body;
    double lag = 1e-9 * (double)w->bodies.list[i].lag_ns;
    const dReal *p = dBodyGetPosition(body);
    const dReal *v = dBodyGetLinearVel(body);
    dBodySetPosition(body, p[0] + lag * v[0], p[1] + lag * v[1], p[2] + lag * v[2]);
  }
}

void hapi_lookback_keep(hapi_lookback *w, const hapi_body_table *bodies)
{
  hapi_snapshot states = {.bodies = w->bodies.states, .body_capacity = w->bodies.state_capacity};
  hapi_snapshot_clear(&states);
  for (uint32_t i = 0; i < w->bodies.count; ++i) {
    hapi_snapshot_add_body(&states, bodies->entries[w->bodies.list[i].known].body, NULL);
  }
  w->bodies.seed = states.seed;
}

static const hapi_body_state *window_end_of(const hapi_lookback *w, const hapi_lookback_body *body)
{
  for (uint32_t i = 0; i < w->ended.count; ++i) {
    if (w->ended.list[i].known == body->known && w->ended.list[i].birth == body->birth) {
      return &w->ended.states[i];
    }
  }
  return NULL;
}

/* Whether the reference of the window before ended when this one begins, and not too far from
 * where the session is. */
static bool window_can_chain(const hapi_lookback *w, double haptic_hz)
{
  double apart_s = 1e-9 * fabs((double)(w->rows.times_ns[0] - w->end_ns));
  bool good = w->end_ns != 0 && apart_s < 0.5 / haptic_hz;
  for (uint32_t i = 0; i < w->bodies.count && good; ++i) {
    const hapi_body_state *end = window_end_of(w, &w->bodies.list[i]);
    double apart[3] = {0.0};
    if (end != NULL) {
      hapi_v3_sub(end->position, w->bodies.states[i].position, apart);
    }
    good = hapi_v3_norm(apart) < APART_M;
  }
  return good;
}

/* Goes on from there; a body that was not part of it comes in as the session has it. */
static void window_chain(hapi_lookback *w, double haptic_hz)
{
  w->chained = window_can_chain(w, haptic_hz);
  w->chain_s = w->chained ? w->chain_s : 0.0;
  if (!w->chained) {
    hapi_lookback_hand_begin(&w->hand);
  }
  for (uint32_t i = 0; i < w->bodies.count && w->chained; ++i) {
    const hapi_body_state *end = window_end_of(w, &w->bodies.list[i]);
    if (end != NULL) {
      w->bodies.states[i] = *end;
      w->bodies.list[i].lag_ns = 0;
    }
  }
}

static int window_iterations(const hapi_lookback *w, int world)
{
  int more = ITERATIONS * world;
  return !w->lean && more < ITERATIONS_LEAST ? ITERATIONS_LEAST : more;
}

static bool window_go(hapi_lookback *w, const hapi_cycle *cycle, int own_iterations, double seconds)
{
  const hapi_world *world = w->test.world;
  int64_t begin_ns = hapi_clock_now();
  int iterations = dWorldGetQuickStepNumIterations(world->ode.world);
  double haptic_hz = cycle->config->haptic_hz;
  bool good = true;
  hapi_physics_config config = *cycle->config;
  hapi_cycle as_single = *cycle;
  hapi_meant meant;
  config.haptic_hz = row_parts(haptic_hz) * haptic_hz;
  as_single.config = &config;
  as_single.model = HAP_MODEL_SINGLE; /* whose step this is */
  dWorldSetQuickStepNumIterations(world->ode.world, window_iterations(w, own_iterations));
  hapi_world_convert(world, hapi_step_ratio(&as_single), &meant);
  bool first = w->rows.next == 0;
  if (first) {
    window_chain(w, haptic_hz);
  }
  window_put_states(w);
  if (first) {
    window_even_out(w);
  }
  while (good && w->rows.next < w->rows.count &&
         (seconds < 0.0 || 1e-9 * (double)(hapi_clock_now() - begin_ns) < seconds)) {
    good = row_go_over(w, &as_single, haptic_hz, w->rows.next++);
  }
  w->spent_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  hapi_lookback_keep(w, &world->bodies);
  dJointGroupEmpty(world->contact_group);
  hapi_world_restore(world, &meant);
  dWorldSetQuickStepNumIterations(world->ode.world, iterations);
  return good;
}

static hap_status window_enter(hapi_lookback *w, const hapi_world *world, double step_s)
{
  hap_status status = hapi_test_begin(&w->test, world, step_s);
  for (uint32_t i = 0; i < w->bodies.count && status >= HAP_OK; ++i) {
    status = hapi_test_add_body(&w->test, w->bodies.list[i].known);
  }
  return status >= HAP_OK ? hapi_test_enter(&w->test) : status;
}

hap_status hapi_lookback_run(hapi_lookback *w, const hapi_cycle *cycle, const hapi_world *world,
                             int own_iterations, double seconds)
{
  if (!window_find_geoms(w, world->ode.space)) {
    return HAP_ERROR_MEMORY;
  }
  hap_status status = window_enter(w, world, cycle->probe_step_s);
  if (status >= HAP_OK) {
    bool good = w->rows.count == 0 || window_go(w, cycle, own_iterations, seconds);
    status = good ? status : HAP_ERROR_STATE;
    hapi_test_leave(&w->test);
  }
  return status;
}
