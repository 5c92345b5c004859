/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/surfaces.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"
#include "world/world.h"

/* Surfaces of pairs of geoms, from the application's callback: checked, kept for the step, and
 * converted for the loop. */

/* A softness from which on a contact is a spring, not a rigid one with rounding. */
#define SOFT_CFM 1e-6

/* What ODE reads of a surface must be numbers: one that is not ends in an abort of the process, and
 * so can a softness below 0, which divides by what is left of a row. */
static bool surface_is_sound(const dSurfaceParameters *s)
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

bool hapi_world_direction(const hapi_world *world, dGeomID a, dGeomID b, double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  bool given = world->ode.friction_direction != NULL &&
               world->ode.friction_direction(world->ode.user, a, b, out);
  double length = given && hapi_finite(out, 3) ? hapi_v3_norm(out) : 0.0;
  if (!(length > 1e-12)) {
    return false;
  }
  hapi_v3_scale(1.0 / length, out, out);
  return true;
}

static bool ask_application(const hapi_world *world, const hapi_cycle *cycle, dGeomID a, dGeomID b,
                            dSurfaceParameters *out)
{
  *out = (dSurfaceParameters){.mode = dContactApprox1, .mu = dInfinity};
  if (world->ode.surface != NULL && !world->ode.surface(world->ode.user, a, b, out)) {
    return false;
  }
  if (!surface_is_sound(out)) {
    cycle->config->report(cycle->config->user, HAP_FAULT_WORLD,
                          "the surface callback gave a number that is not finite, or a friction, "
                          "softness or slip below 0: the pair has no contact");
    return false;
  }
  world->bodies.listener->surface_asked(world->bodies.listener->physics, a, b, out);
  return true;
}

/* The application is asked once a step for each pair; model CONTACT asks for some of them twice, in
 * the collision phase and when it looks for what is near. */
static hapi_surface_entry *cache_find(hapi_surface_cache *cache, dGeomID a, dGeomID b)
{
  HAPI_ASSERT(cache->used < cache->capacity); /* or the search has no end */
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
static bool cache_reserve(hapi_surface_cache *cache)
{
  if (cache->entries != NULL && 2 * cache->used < cache->capacity) {
    return true;
  }
  HAPI_ASSERT((cache->capacity & (cache->capacity - 1)) == 0);
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
      *cache_find(&larger, entry->a, entry->b) = *entry;
      ++larger.used;
    }
  }
  hapi_free(cache->entries);
  *cache = larger;
  return true;
}

bool hapi_world_ask_surface(const hapi_world *world, const hapi_cycle *cycle, dGeomID a, dGeomID b,
                            dSurfaceParameters *out, bool *out_turned)
{
  *out_turned = false;
  hapi_surface_cache *cache = world->surfaces;
  if (cycle->model != HAP_MODEL_CONTACT || !cache_reserve(cache)) {
    return ask_application(world, cycle, a, b, out);
  }
  hapi_surface_entry *entry = cache_find(cache, a, b);
  if (entry->step != cache->step) {
    *entry = (hapi_surface_entry){.a = a, .b = b, .step = cache->step};
    entry->collides = ask_application(world, cycle, a, b, &entry->surface);
    ++cache->used;
  }
  *out = entry->surface;
  *out_turned = entry->a != a; /* directions of motion belong to the order that was asked for */
  return entry->collides;
}

static void fill_surface(dWorldID world, const hapi_cycle *cycle, const dSurfaceParameters *s,
                         hapi_surface *out)
{
  memset(out, 0, sizeof *out);
  out->erp = (s->mode & dContactSoftERP) != 0 ? s->soft_erp : dWorldGetERP(world);
  out->cfm = (s->mode & dContactSoftCFM) != 0 ? s->soft_cfm : dWorldGetCFM(world);
  const struct {
    int mode;
    uint32_t flag;
  } bits[] = {
      {dContactApprox1_1, HAPI_SURFACE_APPROX1_1}, {dContactApprox1_2, HAPI_SURFACE_APPROX1_2},
      {dContactFDir1, HAPI_SURFACE_FDIR1},         {dContactBounce, HAPI_SURFACE_BOUNCE},
      {dContactSlip1, HAPI_SURFACE_SLIP1},         {dContactSlip2, HAPI_SURFACE_SLIP2},
  };
  bool asked = (s->mode & (dContactSoftERP | dContactSoftCFM)) != 0;
  uint32_t flags = (asked && out->cfm > 0.0) || out->cfm > SOFT_CFM ? HAPI_SURFACE_SOFT : 0u;
  for (size_t i = 0; i < sizeof bits / sizeof bits[0]; ++i) {
    flags |= (s->mode & bits[i].mode) != 0 ? bits[i].flag : 0u;
  }
  out->flags = flags;
  double scale = hapi_cycle_scale(cycle); /* the loop's velocities are those of the hand's time */
  hapi_soften(hapi_tick_ratio(cycle), &out->erp, &out->cfm);
  out->cfm *= scale;
  out->mu = s->mu;
  out->mu2 = (s->mode & dContactMu2) != 0 ? s->mu2 : s->mu;
  out->bounce = s->bounce;
  out->bounce_speed = scale * s->bounce_vel;
  out->layer = dWorldGetContactSurfaceLayer(world);
  out->max_push = scale * dWorldGetContactMaxCorrectingVel(world);
  out->motion[0] = (s->mode & dContactMotion1) != 0 ? scale * s->motion1 : 0.0;
  out->motion[1] = (s->mode & dContactMotion2) != 0 ? scale * s->motion2 : 0.0;
  out->motion[2] = (s->mode & dContactMotionN) != 0 ? scale * s->motionN : 0.0;
  out->slip[0] = scale * s->slip1;
  out->slip[1] = scale * s->slip2;
}

bool hapi_world_surface(const hapi_world *world, const hapi_cycle *cycle, hapi_link *link)
{
  hapi_surface *out = &link->surface;
  dSurfaceParameters surface;
  if (!hapi_world_ask_surface(world, cycle, link->own, link->other, &surface, &link->turned)) {
    return false;
  }
  dGeomID a = link->turned ? link->other : link->own;
  dGeomID b = link->turned ? link->own : link->other;
  fill_surface(world->ode.world, cycle, &surface, out);
  double direction[3];
  if ((surface.mode & dContactFDir1) != 0 && hapi_world_direction(world, a, b, direction)) {
    hapi_v3_copy(direction, out->direction);
  } else {
    out->flags &= ~(uint32_t)HAPI_SURFACE_FDIR1;
  }
  if (hapi_wish_is_off(cycle->wishes, HAP_EFFECT_RESTITUTION)) {
    out->flags &= ~(uint32_t)HAPI_SURFACE_BOUNCE;
  }
  return true;
}

void hapi_world_forget_surfaces(hapi_world *world)
{
  ++world->surfaces->step;
  world->surfaces->used = 0;
}
