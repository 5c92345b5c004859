/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* The global step's parts that are plain ODE. */

double hapi_body_mass(dBodyID body)
{
  dMass mass;
  if (dBodyIsKinematic(body)) {
    return 0.0;
  }
  dBodyGetMass(body, &mass);
  return mass.mass;
}

bool hapi_world_direction(hapi_physics *physics, dGeomID a, dGeomID b, double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  bool given = physics->world.ode.friction_direction != NULL &&
               physics->world.ode.friction_direction(physics->world.ode.user, a, b, out);
  double length = given && hapi_finite(out, 3) ? hapi_v3_norm(out) : 0.0;
  if (!(length > 1e-12)) {
    return false;
  }
  hapi_v3_scale(1.0 / length, out, out);
  return true;
}

/* ODE wants it at right angles to the normal. A pair whose normal it is has ODE's own direction. */
static void set_direction(dContact *contact, const double direction[3])
{
  double across[3];
  const double *n = contact->geom.normal;
  hapi_v3_madd(direction, -hapi_v3_dot(direction, n), n, across);
  double length = hapi_v3_norm(across);
  if (length > 1e-6) {
    hapi_v3_scale(1.0 / length, across, contact->fdir1);
  } else {
    contact->surface.mode &= ~dContactFDir1;
  }
}

/* A surface that is soft for the world's step, in a world that model SINGLE steps at another. */
static void soften(const hapi_physics *physics, dSurfaceParameters *s)
{
  if (physics->cycle.model != HAP_MODEL_SINGLE ||
      (s->mode & (dContactSoftERP | dContactSoftCFM)) == 0) {
    return;
  }
  double erp =
      (s->mode & dContactSoftERP) != 0 ? s->soft_erp : dWorldGetERP(physics->world.ode.world);
  double cfm =
      (s->mode & dContactSoftCFM) != 0 ? s->soft_cfm : dWorldGetCFM(physics->world.ode.world);
  hapi_soften(physics->config.physics_hz / physics->config.haptic_hz, &erp, &cfm);
  s->soft_erp = erp;
  s->soft_cfm = cfm;
  s->mode |= dContactSoftERP | dContactSoftCFM;
}

static void attach(hapi_physics *physics, const dContact *contact, const dBodyID bodies[2],
                   bool carried)
{
  dJointGroupID group = carried ? physics->world.carried_group : physics->world.contact_group;
  dJointID joint = dJointCreateContact(physics->world.ode.world, group, contact);
  dJointAttach(joint, bodies[0], bodies[1]);
  if (!carried && hapi_reuse_wanted(physics)) {
    hapi_reuse_note(physics, joint, contact);
  }
}

void hapi_world_make_contacts(hapi_physics *physics, const dGeomID geoms[2],
                              const dBodyID bodies[2], dSurfaceParameters *surface, bool carried)
{
  dGeomID a = geoms[0];
  dGeomID b = geoms[1];
  dContact *contacts = physics->world.contact_scratch;
  double direction[3];
  int count =
      dCollide(a, b, physics->world.ode.max_contacts_per_pair, &contacts[0].geom, sizeof(dContact));
  soften(physics, surface);
  bool directed = count > 0 && (surface->mode & dContactFDir1) != 0 &&
                  hapi_world_direction(physics, a, b, direction);
  if (!directed) {
    surface->mode &= ~dContactFDir1;
  }
  for (int i = 0; i < count; ++i) {
    if (!hapi_contact_is_sound(&contacts[i].geom)) {
      ++physics->counts.own.stats.contacts_rejected;
      continue;
    }
    contacts[i].surface = *surface;
    if (directed) {
      set_direction(&contacts[i], direction);
    }
    attach(physics, &contacts[i], bodies, carried);
  }
}

/* What ODE reads of a surface must be numbers: one that is not ends in an abort of the process, and
 * so can a softness below 0, which divides by what is left of a row. */
static bool sound_surface(const dSurfaceParameters *s)
{
  const double most = 1e12;
  const struct {
    int bit;
    double value;
    double low;
    double high;
  } parts[] = {
      {0, s->mu, 0.0, HUGE_VAL}, /* ODE reads it whatever the mode is */
      {dContactMu2, s->mu2, 0.0, HUGE_VAL},
      {dContactRolling, s->rho, 0.0, HUGE_VAL},
      {dContactRolling, s->rho2, 0.0, HUGE_VAL},
      {dContactRolling, s->rhoN, 0.0, HUGE_VAL},
      {dContactBounce, s->bounce, -most, most},
      {dContactBounce, s->bounce_vel, -most, most},
      {dContactSoftERP, s->soft_erp, -most, most},
      {dContactSoftCFM, s->soft_cfm, 0.0, most},
      {dContactMotion1, s->motion1, -most, most},
      {dContactMotion2, s->motion2, -most, most},
      {dContactMotionN, s->motionN, -most, most},
      {dContactSlip1, s->slip1, 0.0, most},
      {dContactSlip2, s->slip2, 0.0, most},
  };
  for (size_t i = 0; i < sizeof parts / sizeof parts[0]; ++i) {
    bool read = parts[i].bit == 0 || (s->mode & parts[i].bit) != 0;
    bool good = parts[i].value >= parts[i].low && parts[i].value <= parts[i].high; /* not NaN */
    if (read && !good) {
      return false;
    }
  }
  return true;
}

static bool can_move(dBodyID body)
{
  return body != NULL && !dBodyIsKinematic(body);
}

static bool ask_application(hapi_physics *physics, dGeomID a, dGeomID b, dSurfaceParameters *out)
{
  *out = (dSurfaceParameters){.mode = dContactApprox1, .mu = dInfinity};
  if (physics->world.ode.surface != NULL &&
      !physics->world.ode.surface(physics->world.ode.user, a, b, out)) {
    return false;
  }
  if (!sound_surface(out)) {
    physics->config.report(physics->config.user, HAP_FAULT_WORLD,
                           "the surface callback gave a number that is not finite, or a friction, "
                           "softness or slip below 0: the pair has no contact");
    return false;
  }
  hapi_lookback_ask(physics, a, b, out);
  return true;
}

/* The application is asked once a step for each pair; model CONTACT asks for some of them twice, in
 * the collision phase and when it looks for what is near. */
static hapi_surface_entry *cached(hapi_surface_cache *cache, dGeomID a, dGeomID b)
{
  uint64_t x = (uint64_t)(uintptr_t)a;
  uint64_t y = (uint64_t)(uintptr_t)b;
  uint64_t key = (x < y ? x : y) * 0x9e3779b97f4a7c15u ^ (x < y ? y : x);
  uint32_t at = (uint32_t)((key * 0xff51afd7ed558ccdu) >> 40) & (cache->capacity - 1);
  for (;; at = (at + 1) & (cache->capacity - 1)) {
    hapi_surface_entry *entry = &cache->entries[at];
    bool same = (entry->a == a && entry->b == b) || (entry->a == b && entry->b == a);
    if (entry->step != cache->step || same) {
      return entry;
    }
  }
}

/* Room for one more, at most half full; false without memory: the application is asked again. */
static bool reserve(hapi_surface_cache *cache)
{
  if (cache->entries != NULL && 2 * cache->used < cache->capacity) {
    return true;
  }
  hapi_surface_cache larger = {.capacity = cache->capacity > 0 ? 2 * cache->capacity : 256,
                               .step = cache->step};
  larger.entries = hapi_alloc_array(larger.capacity, sizeof *larger.entries);
  if (larger.entries == NULL) {
    return false;
  }
  const hapi_surface_entry *old = cache->entries;
  for (uint32_t i = 0; old != NULL && i < cache->capacity; ++i) {
    const hapi_surface_entry *entry = &old[i];
    if (entry->step == cache->step) {
      *cached(&larger, entry->a, entry->b) = *entry;
      ++larger.used;
    }
  }
  hapi_free(cache->entries);
  *cache = larger;
  return true;
}

bool hapi_world_ask_surface(hapi_physics *physics, dGeomID a, dGeomID b, dSurfaceParameters *out,
                            bool *out_turned)
{
  *out_turned = false;
  hapi_surface_cache *cache = &physics->world.surfaces;
  if (physics->cycle.model != HAP_MODEL_CONTACT || !reserve(cache)) {
    return ask_application(physics, a, b, out);
  }
  hapi_surface_entry *entry = cached(cache, a, b);
  if (entry->step != cache->step) {
    *entry = (hapi_surface_entry){.a = a, .b = b, .step = cache->step};
    entry->collides = ask_application(physics, a, b, &entry->surface);
    ++cache->used;
  }
  *out = entry->surface;
  *out_turned = entry->a != a; /* directions of motion belong to the order that was asked for */
  return entry->collides;
}

/* The loop carries the contacts of what it moves: ODE must not have them as well. */
static bool carried_by_loop(const hapi_physics *physics, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&physics->world.bodies, body);
  return known != HAPI_NONE && physics->world.bodies.entries[known].loop_owned;
}

typedef struct collision {
  hapi_physics *physics;
  bool carried; /* the pairs that the loop carries, else the others */
} collision;

static void near_callback(void *data, dGeomID a, dGeomID b)
{
  const collision *c = data;
  hapi_physics *physics = c->physics;
  if (dGeomIsSpace(a) || dGeomIsSpace(b)) {
    dSpaceCollide2(a, b, data, near_callback); /* what is inside of one is met by itself */
    return;
  }
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (body_a == body_b || (!can_move(body_a) && !can_move(body_b))) {
    return;
  }
  dSurfaceParameters surface;
  bool turned;
  bool carried = carried_by_loop(physics, body_a) || carried_by_loop(physics, body_b);
  if (carried != c->carried || !hapi_world_ask_surface(physics, a, b, &surface, &turned)) {
    return;
  }
  const dGeomID geoms[2] = {turned ? b : a, turned ? a : b};
  const dBodyID bodies[2] = {dGeomGetBody(geoms[0]), dGeomGetBody(geoms[1])};
  hapi_world_make_contacts(physics, geoms, bodies, &surface, carried);
}

/* The pairs inside a space, and those inside each space in it: every pair once. */
static void collide_inside(collision *c, dSpaceID space)
{
  dSpaceCollide(space, c, near_callback);
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      collide_inside(c, (dSpaceID)geom);
    }
  }
}

void hapi_world_collide(hapi_physics *physics)
{
  collision c = {physics, false};
  dJointGroupEmpty(physics->world.contact_group);
  ++physics->world.surfaces.step; /* forgets what the surfaces were */
  physics->world.surfaces.used = 0;
  physics->probe.reuse.notes.count = 0;
  collide_inside(&c, physics->world.ode.space);
}

void hapi_world_collide_carried(hapi_physics *physics)
{
  collision c = {physics, true};
  collide_inside(&c, physics->world.ode.space);
}

void hapi_world_quickstep(hapi_physics *physics, double step_s)
{
  ++physics->counts.own.stats.quickstep_calls;
  dWorldQuickStep(physics->world.ode.world, step_s);
}
