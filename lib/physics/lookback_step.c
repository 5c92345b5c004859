/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Going over a window: the reference of a tick is what ODE and eq. 7 make of it at the haptic rate, with the
 * bodies where they are by that reckoning. */

#define ITERATIONS 2 /* times those of the world: what they leave undone shows as well */

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
  if (!see_geoms(w, physics->ode.space, &count)) {
    return false;
  }
  for (uint32_t i = 0; i < w->pair_count; ++i) {
    w->pairs[i].there = there(w, w->pairs[i].a) && there(w, w->pairs[i].b);
  }
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    w->touches[i].there = there(w, w->touches[i].geom);
  }
  return true;
}

/* ---- contacts between bodies ---- */

static bool under_test(const hapi_physics *physics, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&physics->table, body);
  return known != HAPI_NONE && physics->table.entries[known].island != HAPI_NONE;
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
  dJointGroupEmpty(physics->contact_group);
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
      const dGeomID geoms[2] = {pair->a, pair->b};
      const dBodyID bodies[2] = {body_a, body_b};
      dSurfaceParameters surface = pair->surface;
      hapi_world_make_contacts(physics, geoms, bodies, &surface, false);
    }
  }
}

/* ---- pointers ---- */

typedef struct closing {
  hapi_nearest at;
  double speed[3]; /* m/s, of the pointer against the body */
  double period;   /* s */
} closing;

/* Stick, and slip at mu times the normal force; eq. 7 along the surface. */
static void rub(hapi_lookback_touch *t, const hapi_path_pointer *p, const closing *c, double limit,
                double io_force[3])
{
  const hapi_nearest *at = &c->at;
  const double *speed = c->speed;
  double v[3];
  double f[3];
  hapi_v3_madd(speed, -hapi_v3_dot(speed, at->normal), at->normal, v);
  if (!t->closed) {
    hapi_v3_set(t->stretch, 0.0, 0.0, 0.0);
  }
  hapi_v3_madd(t->stretch, c->period, v, t->stretch);
  hapi_v3_madd(t->stretch, -hapi_v3_dot(t->stretch, at->normal), at->normal, t->stretch);
  hapi_v3_scale(p->stiffness, t->stretch, f);
  hapi_v3_madd(f, p->damping, v, f);
  double size = hapi_v3_norm(f);
  if (size > limit) {
    hapi_v3_scale(limit / size, f, f);
    double length = hapi_v3_norm(t->stretch);
    double most = limit / p->stiffness;
    if (length > most) {
      hapi_v3_scale(most / length, t->stretch, t->stretch);
    }
  }
  hapi_v3_sub(io_force, f, io_force);
}

/* N on the hand. */
static bool press(hapi_physics *physics, hapi_lookback_touch *t, const hapi_path_pointer *p,
                  double period, double force[3], double point[3])
{
  closing c = {.period = period};
  const hapi_nearest *at = &c.at;
  dVector3 of_body = {0.0};
  dBodyID body = dGeomGetBody(t->geom);
  if (!hapi_geom_nearest(physics, t->geom, p->pose.position, p->radius, p->radius, &c.at) ||
      at->distance >= 0.0) {
    t->closed = false;
    return false;
  }
  if (under_test(physics, body)) {
    dBodyGetPointVel(body, at->point_b[0], at->point_b[1], at->point_b[2], of_body);
  }
  hapi_v3_sub(p->twist.linear, of_body, c.speed);
  double normal = -p->stiffness * at->distance - p->damping * hapi_v3_dot(c.speed, at->normal);
  normal = normal > 0.0 ? normal : 0.0;
  hapi_v3_scale(normal, at->normal, force);
  if (t->mu > 0.0) {
    rub(t, p, &c, t->mu * normal, force);
  }
  t->closed = true;
  hapi_v3_copy(at->point_b, point);
  return true;
}

/* Before the first row: a spring along the surface that was loaded before the window is as long as the force
 * says. That of several contacts cannot be told apart: they begin without. */
static void load(hapi_physics *physics, uint32_t index, const hapi_path_pointer *p)
{
  hapi_lookback *w = &physics->lookback;
  hapi_lookback_touch *only = NULL;
  hapi_nearest at = {.distance = 0.0};
  uint32_t closed = 0;
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    hapi_lookback_touch *t = &w->touches[i];
    hapi_nearest near;
    if (t->there && t->pointer == index && t->generation == p->generation &&
        hapi_geom_nearest(physics, t->geom, p->pose.position, p->radius, p->radius, &near) &&
        near.distance < 0.0) {
      at = near;
      only = t;
      ++closed;
    }
  }
  if (closed == 1 && only->mu > 0.0) {
    const double *f = p->wrench.force;
    hapi_v3_madd(f, -hapi_v3_dot(f, at.normal), at.normal, only->stretch);
    hapi_v3_scale(-1.0 / p->stiffness, only->stretch, only->stretch);
    only->closed = true;
  }
}

static void push(hapi_physics *physics, const hapi_lookback_touch *t, const double force[3],
                 const double at[3])
{
  dBodyID body = dGeomGetBody(t->geom);
  if (under_test(physics, body) && !dBodyIsKinematic(body)) {
    dBodyEnable(body);
    dBodyAddForceAtPos(body, -force[0], -force[1], -force[2], at[0], at[1], at[2]);
  }
}

static void push_pointer(hapi_physics *physics, uint32_t index, const hapi_path_pointer *p,
                         double period)
{
  hapi_lookback *w = &physics->lookback;
  double sum[3] = {0.0};
  double wrong[3];
  for (uint32_t i = 0; i < w->touch_count; ++i) {
    hapi_lookback_touch *t = &w->touches[i];
    double force[3];
    double point[3];
    if (t->there && t->pointer == index && t->generation == p->generation &&
        press(physics, t, p, period, force, point)) {
      hapi_v3_add(sum, force, sum);
      push(physics, t, force, point);
    }
  }
  hapi_v3_sub(p->wrench.force, sum, wrong);
  if (hapi_v3_dot(sum, sum) > 0.0 || hapi_v3_dot(p->wrench.force, p->wrench.force) > 0.0) {
    w->wrong2 += hapi_v3_dot(wrong, wrong);
    w->right2 += hapi_v3_dot(sum, sum);
    ++w->touched;
  }
}

/* ---- steps ---- */

static void add_wrenches(hapi_physics *physics)
{
  const hapi_lookback *w = &physics->lookback;
  for (uint32_t i = 0; i < w->body_count; ++i) {
    dBodyID body = physics->table.entries[w->bodies[i].known].body;
    const double *f = w->bodies[i].wrench;
    if (dBodyIsEnabled(body)) {
      dBodyAddForce(body, f[0], f[1], f[2]);
      dBodyAddTorque(body, f[3], f[4], f[5]);
    }
  }
}

static void go_over(hapi_physics *physics, uint32_t row)
{
  hapi_lookback *w = &physics->lookback;
  uint32_t count = physics->config.capacity.pointers;
  double period = 1.0 / physics->config.haptic_hz;
  if (row + 1 < w->row_count) {
    period = 1e-9 * (double)(w->times_ns[row + 1] - w->times_ns[row]);
  }
  for (uint32_t i = 0; i < count; ++i) {
    const hapi_path_pointer *p = &w->path[row * count + i];
    if (p->generation != 0 && row == 0) {
      load(physics, i, p);
    }
    if (p->generation != 0) {
      push_pointer(physics, i, p, period);
    }
  }
  add_wrenches(physics);
  collide(physics);
  hapi_world_quickstep(physics, period);
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
    hapi_snapshot_add_body(&states, physics->table.entries[w->bodies[i].known].body, NULL);
  }
  w->seed = states.seed;
}

static void go(hapi_physics *physics, double seconds)
{
  hapi_lookback *w = &physics->lookback;
  int64_t begin_ns = hapi_clock_now();
  int iterations = dWorldGetQuickStepNumIterations(physics->ode.world);
  hap_model model = physics->model;
  physics->model = HAP_MODEL_SINGLE; /* whose step this is */
  dWorldSetQuickStepNumIterations(physics->ode.world, ITERATIONS * iterations);
  hapi_world_convert(physics);
  put_states(physics);
  if (w->next == 0) {
    even_out(physics);
  }
  while (w->next < w->row_count &&
         (seconds < 0.0 || 1e-9 * (double)(hapi_clock_now() - begin_ns) < seconds)) {
    go_over(physics, w->next++);
  }
  w->spent_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  hapi_lookback_keep(physics);
  dJointGroupEmpty(physics->contact_group);
  hapi_world_restore(physics);
  dWorldSetQuickStepNumIterations(physics->ode.world, iterations);
  physics->model = model;
}

hap_status hapi_lookback_run(hapi_physics *physics, double seconds)
{
  hapi_lookback *w = &physics->lookback;
  if (!find_geoms(physics)) {
    return HAP_ERROR_MEMORY;
  }
  hap_status status = hapi_test_enter_bodies(physics, w->bodies, w->body_count);
  if (status >= HAP_OK) {
    go(physics, seconds);
    hapi_test_leave(physics);
  }
  return status;
}
