/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/surfaces.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/index.h"
#include "base/vec.h"
#include "world/world.h"

/* Surfaces of pairs of geoms, from the application's callback: checked, kept for the step, and
 * converted for the loop. */

/* A softness from which on a contact is a spring, not a rigid one with rounding. */
#define SOFT_CFM 1e-6

#define FEWEST_PLACES 256u

#define SURFACE_MOST 1e12

static bool part_is_sound(const dSurfaceParameters *s, int bit, double value, double low,
                          double high)
{
  return (s->mode & bit) == 0 || (value >= low && value <= high); /* not NaN */
}

/* What ODE reads of a surface must be numbers: one that is not ends in an abort of the process, and
 * so can a softness below 0, which divides by what is left of a row. */
bool hapi_surface_is_sound(const dSurfaceParameters *s)
{
  const double most = SURFACE_MOST;
  return s->mu >= 0.0 && /* ODE reads it whatever the mode is */
         part_is_sound(s, dContactMu2, s->mu2, 0.0, HUGE_VAL) &&
         part_is_sound(s, dContactRolling, s->rho, 0.0, HUGE_VAL) &&
         part_is_sound(s, dContactRolling, s->rho2, 0.0, HUGE_VAL) &&
         part_is_sound(s, dContactRolling, s->rhoN, 0.0, HUGE_VAL) &&
         part_is_sound(s, dContactBounce, s->bounce, -most, most) &&
         part_is_sound(s, dContactBounce, s->bounce_vel, -most, most) &&
         part_is_sound(s, dContactSoftERP, s->soft_erp, -most, most) &&
         part_is_sound(s, dContactSoftCFM, s->soft_cfm, 0.0, most) &&
         part_is_sound(s, dContactMotion1, s->motion1, -most, most) &&
         part_is_sound(s, dContactMotion2, s->motion2, -most, most) &&
         part_is_sound(s, dContactMotionN, s->motionN, -most, most) &&
         part_is_sound(s, dContactSlip1, s->slip1, 0.0, most) &&
         part_is_sound(s, dContactSlip2, s->slip2, 0.0, most);
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
  if (!hapi_surface_is_sound(out)) {
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
static uint32_t pair_hash(dGeomID a, dGeomID b)
{
  uint64_t x = hapi_index_address(a);
  uint64_t y = hapi_index_address(b);
  return (uint32_t)hapi_index_mix((x < y ? x : y) * 0x9e3779b97f4a7c15u ^ (x < y ? y : x));
}

/* The place of a pair, or the free one where it would be. */
static hapi_surface_place *cache_place(const hapi_surface_cache *cache, uint32_t hash, dGeomID a,
                                       dGeomID b)
{
  HAPI_ASSERT(cache->used < cache->place_count); /* or the search has no end */
  for (uint32_t at = hash;; ++at) {
    hapi_surface_place *place = &cache->places[at & (cache->place_count - 1)];
    if (place->taken == 0) {
      return place;
    }
    const hapi_surface_entry *entry = &cache->entries[place->taken - 1];
    if (place->hash == hash &&
        ((entry->a == a && entry->b == b) || (entry->a == b && entry->b == a))) {
      return place;
    }
  }
}

/* Room for one more, places at most half taken; false without memory: the application is asked
 * again. */
static bool cache_reserve(hapi_surface_cache *cache)
{
  if (!hapi_reserve((void **)&cache->entries, &cache->capacity, cache->used, 1,
                    sizeof *cache->entries)) {
    return false;
  }
  if (2 * cache->used < cache->place_count) {
    return true;
  }
  HAPI_ASSERT((cache->place_count & (cache->place_count - 1)) == 0);
  uint32_t place_count = cache->place_count > 0 ? 2 * cache->place_count : FEWEST_PLACES;
  hapi_surface_place *places = hapi_alloc_array(place_count, sizeof *places);
  if (places == NULL) {
    return false;
  }
  hapi_free(cache->places);
  cache->places = places;
  cache->place_count = place_count;
  for (uint32_t i = 0; i < cache->used; ++i) {
    uint32_t hash = pair_hash(cache->entries[i].a, cache->entries[i].b);
    *cache_place(cache, hash, cache->entries[i].a, cache->entries[i].b) =
        (hapi_surface_place){hash, i + 1};
  }
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
  uint32_t hash = pair_hash(a, b);
  hapi_surface_place *place = cache_place(cache, hash, a, b);
  bool is_new = place->taken == 0;
  if (is_new) {
    *place = (hapi_surface_place){hash, ++cache->used};
  }
  hapi_surface_entry *entry = &cache->entries[place->taken - 1];
  if (is_new) {
    entry->a = a;
    entry->b = b;
    entry->collides = ask_application(world, cycle, a, b, &entry->surface);
  }
  *out = entry->surface;
  *out_turned = entry->a != a; /* directions of motion belong to the order that was asked for */
  return entry->collides;
}

void hapi_said_surface_of(const dSurfaceParameters *s, const double direction[3],
                          hapi_said_surface *out)
{
  *out = (hapi_said_surface){.mode = s->mode,
                             .mu = s->mu,
                             .mu2 = s->mu2,
                             .rho = {s->rho, s->rho2, s->rhoN},
                             .bounce = s->bounce,
                             .bounce_speed = s->bounce_vel,
                             .soft_erp = s->soft_erp,
                             .soft_cfm = s->soft_cfm,
                             .motion = {s->motion1, s->motion2, s->motionN},
                             .slip = {s->slip1, s->slip2}};
  hapi_v3_copy(direction, out->direction);
}

void hapi_surface_terms_of(const hapi_world *world, const hapi_cycle *cycle,
                           hapi_surface_terms *out)
{
  dWorldID ode = world->ode.world;
  *out = (hapi_surface_terms){
      .erp = dWorldGetERP(ode),
      .cfm = dWorldGetCFM(ode),
      .ratio = hapi_tick_ratio(cycle),
      .scale = hapi_cycle_scale(cycle), /* the loop's velocities are those of the hand's time */
      .layer = dWorldGetContactSurfaceLayer(ode),
      .max_push = dWorldGetContactMaxCorrectingVel(ode),
      .rigid = hapi_wish_is_off(cycle->wishes, HAP_EFFECT_RESTITUTION)};
}

void hapi_surface_make(const hapi_surface_terms *terms, const dSurfaceParameters *s,
                       hapi_surface *out)
{
  memset(out, 0, sizeof *out);
  out->erp = (s->mode & dContactSoftERP) != 0 ? s->soft_erp : terms->erp;
  out->cfm = (s->mode & dContactSoftCFM) != 0 ? s->soft_cfm : terms->cfm;
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
  double scale = terms->scale;
  out->flags = terms->rigid != 0 ? flags & ~(uint32_t)HAPI_SURFACE_BOUNCE : flags;
  hapi_soften(terms->ratio, &out->erp, &out->cfm);
  out->cfm *= scale;
  out->mu = s->mu;
  out->mu2 = (s->mode & dContactMu2) != 0 ? s->mu2 : s->mu;
  out->bounce = s->bounce;
  out->bounce_speed = scale * s->bounce_vel;
  out->layer = terms->layer;
  out->max_push = scale * terms->max_push;
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
  hapi_surface_terms terms;
  hapi_surface_terms_of(world, cycle, &terms);
  hapi_surface_make(&terms, &surface, out);
  double direction[3];
  if ((surface.mode & dContactFDir1) != 0 && hapi_world_direction(world, a, b, direction)) {
    hapi_v3_copy(direction, out->direction);
  } else {
    out->flags &= ~(uint32_t)HAPI_SURFACE_FDIR1;
    surface.mode &= ~dContactFDir1;
  }
  if (world->asking->caller.call != NULL) {
    hapi_said_surface_of(&surface, out->direction, &link->said);
  }
  return true;
}

void hapi_world_forget_surfaces(hapi_world *world)
{
  hapi_surface_cache *cache = world->surfaces;
  cache->used = 0;
  if (cache->place_count > 0) {
    memset(cache->places, 0, cache->place_count * sizeof *cache->places);
  }
}
