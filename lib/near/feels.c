/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "near/feels.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include <hapode/surface.h>

#include "base/alloc.h"
#include "base/force_setup.h"
#include "base/pointer_id.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"
#include "near/near.h"

#define FIRST_CAPACITY 64u
#define FRICTION_MOST 10.0 /* as between bodies */
#define STIFFNESS_MOST 1e9 /* as of hap_pointer_def */
#define DAMPING_MOST 1e6
#define IMPACT_MOST 1000.0 /* N s/m */
#define PULL_MOST 100.0    /* N, of adhesion and magnets */
#define MAGNET_LEAST 0.001 /* m */
#define IMPACT_DECAY_LEAST 10.0
#define IMPACT_DECAY_MOST 10000.0 /* 1/s */
#define IMPACT_HZ_LEAST 5.0
#define IMPACT_HZ_MOST 1000.0

void hapi_feels_finish(hapi_feels *feels)
{
  hapi_free(feels->list);
  hapi_index_finish(&feels->by_pair);
  memset(feels, 0, sizeof *feels);
}

void hapi_feels_clear(hapi_feels *feels)
{
  feels->count = 0;
  hapi_index_clear(&feels->by_pair);
}

void hapi_feels_renew(hapi_feels *feels, uint64_t geom)
{
  for (uint32_t i = 0; i < feels->count; ++i) {
    feels->list[i].known = feels->list[i].known && geom != 0 && feels->list[i].geom != geom;
  }
}

/* ---- what the application says ---- */

static bool number_is_good(double value, double most)
{
  return value >= 0.0 && value <= most; /* not NaN */
}

static bool surface_is_good(const hap_surface *s, const hapi_texture *texture)
{
  return (s->texture == 0 || texture != NULL) && number_is_good(s->stiffness, STIFFNESS_MOST) &&
         number_is_good(s->damping, DAMPING_MOST) && number_is_good(s->friction_static, DBL_MAX) &&
         number_is_good(s->friction_dynamic, DBL_MAX) && number_is_good(s->adhesion, PULL_MOST);
}

static bool impact_is_good(const hap_surface *s, double haptic_hz)
{
  return s->impact_force == 0.0 || /* then the others do not count */
         (number_is_good(s->impact_force, IMPACT_MOST) && s->impact_decay >= IMPACT_DECAY_LEAST &&
          s->impact_decay <= IMPACT_DECAY_MOST && s->impact_hz >= IMPACT_HZ_LEAST &&
          s->impact_hz <= fmin(IMPACT_HZ_MOST, 0.25 * haptic_hz));
}

static bool magnet_is_good(const hap_surface *s, double most)
{
  return s->magnet_force == 0.0 || /* then the reach does not count */
         (number_is_good(s->magnet_force, PULL_MOST) && s->magnet_reach >= MAGNET_LEAST &&
          s->magnet_reach <= most);
}

/* As the pointer has it of its own. */
static void surface_begin(const hapi_state_pointer *pointer, double reach, hap_surface *out)
{
  memset(out, 0, sizeof *out);
  out->size = sizeof *out;
  out->touchable = 1;
  out->stiffness = pointer->stiffness;
  out->damping = pointer->damping;
  out->friction_static = out->friction_dynamic = pointer->friction;
  out->impact_decay = 80.0;
  out->impact_hz = 100.0;
  out->magnet_reach = reach;
}

static const hapi_texture *texture_of(const hapi_nearby *nearby, uint32_t number)
{
  const hapi_textures *textures = nearby->cycle->config->textures;
  return textures != NULL ? hapi_texture_find(textures, number) : NULL;
}

static void feel_read(const hap_surface *s, const hapi_state_pointer *pointer, hapi_feel *out)
{
  memset(out, 0, sizeof *out);
  out->mu = fmin(s->friction_dynamic, FRICTION_MOST);
  out->mu_static = fmax(fmin(s->friction_static, FRICTION_MOST), out->mu);
  out->more |= out->mu_static > out->mu ? HAPI_FEEL_STATIC : 0u;
  if (s->stiffness != pointer->stiffness || s->damping != pointer->damping) {
    out->more |= HAPI_FEEL_SPRING;
    out->stiffness = s->stiffness;
    out->damping = s->damping;
  }
  if (s->impact_force > 0.0) {
    out->more |= HAPI_FEEL_IMPACT;
    out->impact = (hapi_impact){s->impact_force, s->impact_decay, s->impact_hz};
  }
  if (s->adhesion > 0.0) {
    out->more |= HAPI_FEEL_ADHESION;
    out->adhesion = s->adhesion;
  }
  if (s->magnet_force > 0.0) {
    out->more |= HAPI_FEEL_MAGNET;
    out->magnet_force = s->magnet_force;
    out->magnet_reach = s->magnet_reach;
  }
}

/* The loop cuts it, as the device may change its scales. */
static void magnet_say(hapi_nearby *nearby, const hapi_state_pointer *pointer,
                       const hapi_feel *feel)
{
  if ((feel->more & HAPI_FEEL_MAGNET) != 0 &&
      HAPI_MAGNET_PEAK * feel->magnet_force > pointer->magnet_hold * feel->magnet_reach) {
    hapi_say_once(nearby->cycle, &nearby->neighbors.feels.said_steep,
                  "a surface pulls a pointer with a force that changes more with the way than the "
                  "device can hold: the pull is cut (hapode/surface.h, magnet_reach)");
  }
}

/* False: the answer was not good. */
static bool feel_ask(hapi_nearby *nearby, uint32_t index, dGeomID geom, hapi_known_feel *out)
{
  const hapi_state_pointer *pointer = &hapi_state_pointers(nearby->cycle->state)[index];
  const hap_ode_def *ode = &nearby->world->ode;
  const hap_pointer_id id = {hapi_pointer_id_of(pointer->generation, index + 1)};
  hap_surface surface;
  surface_begin(pointer, ode->magnet_reach, &surface);
  ode->pointer_surface(ode->user, id, geom, &surface);
  const hapi_texture *texture = texture_of(nearby, surface.texture);
  if (!surface_is_good(&surface, texture) || !magnet_is_good(&surface, ode->magnet_reach) ||
      !impact_is_good(&surface, nearby->cycle->config->haptic_hz)) {
    nearby->cycle->config->report(
        nearby->cycle->config->user, HAP_FAULT_WORLD,
        "the pointer_surface callback gave a number that is not finite or out of its range, or a "
        "texture that there is not (hapode/surface.h): the pointer does not feel the geom");
    return false;
  }
  out->touchable = surface.touchable != 0;
  feel_read(&surface, pointer, &out->feel);
  magnet_say(nearby, pointer, &out->feel);
  out->reach = fmax(out->feel.magnet_reach,
                    (out->feel.more & HAPI_FEEL_ADHESION) != 0 ? HAPI_SAFETY_ADHESION_WAY : 0.0);
  if (texture != NULL) {
    out->feel.texture = texture;
    out->feel.texture_number = surface.texture;
    out->feel.more |= HAPI_FEEL_TEXTURE;
  }
  return true;
}

/* ---- what is kept ---- */

static uint64_t pair_key(uint64_t geom, uint32_t pointer)
{
  return geom << 8 | pointer;
}

static bool feels_grow(hapi_feels *feels)
{
  uint32_t capacity = feels->capacity > 0 ? 2 * feels->capacity : FIRST_CAPACITY;
  hapi_known_feel *list = hapi_index_reserve(&feels->by_pair, capacity)
                              ? hapi_alloc_array(capacity, sizeof *list)
                              : NULL;
  if (list == NULL) {
    return false;
  }
  if (feels->count > 0) {
    memcpy(list, feels->list, feels->count * sizeof *list);
  }
  hapi_free(feels->list);
  feels->list = list;
  feels->capacity = capacity;
  return true;
}

/* Pairs that are no longer near are forgotten before the list grows. */
static bool feels_make_room(hapi_feels *feels, uint64_t model)
{
  uint32_t kept = 0;
  if (feels->count < feels->capacity) {
    return true;
  }
  hapi_index_clear(&feels->by_pair);
  for (uint32_t i = 0; i < feels->count; ++i) {
    const hapi_known_feel *known = &feels->list[i];
    if (known->model + 1 >= model) {
      feels->list[kept] = *known;
      hapi_index_put(&feels->by_pair, pair_key(known->geom, known->pointer), kept++);
    }
  }
  feels->count = kept;
  return 2 * feels->count < feels->capacity || feels_grow(feels) || feels->count < feels->capacity;
}

/* The pair's place, also of one that is new; NULL: without memory. */
static hapi_known_feel *feels_place(hapi_feels *feels, uint64_t geom, uint32_t pointer,
                                    uint64_t model)
{
  uint32_t at = hapi_index_get(&feels->by_pair, pair_key(geom, pointer));
  if (at == HAPI_INDEX_NONE) {
    if (!feels_make_room(feels, model)) {
      return NULL;
    }
    at = feels->count++;
    hapi_index_put(&feels->by_pair, pair_key(geom, pointer), at);
    feels->list[at] = (hapi_known_feel){.geom = geom, .pointer = pointer};
  }
  return &feels->list[at];
}

/* False: the answer was not good. */
static bool feel_know(hapi_nearby *nearby, dGeomID geom, hapi_known_feel *io)
{
  uint32_t generation = hapi_state_pointers(nearby->cycle->state)[io->pointer].generation;
  if (io->generation != generation) {
    io->known = io->special = false;
    io->generation = generation;
    io->number = ++nearby->neighbors.feels.given;
  }
  io->known = io->known || feel_ask(nearby, io->pointer, geom, io);
  io->special = io->special || (io->known && io->feel.more != 0);
  return io->known;
}

/* A geom's frame in that of its body. */
static void geom_place(const hapi_nearby *nearby, dGeomID geom, hap_pose *out)
{
  dBodyID body = hapi_geom_body(nearby->world, geom);
  hap_pose world = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  if (dGeomGetClass(geom) != dPlaneClass) {
    hapi_v3_copy(dGeomGetPosition(geom), world.position);
    dGeomGetQuaternion(geom, world.quat_wxyz);
  }
  *out = world;
  if (body != NULL) {
    hapi_pose_into(dBodyGetPosition(body), dBodyGetQuaternion(body), &world, out);
  }
}

static bool feel_find(hapi_nearby *nearby, uint32_t pointer, dGeomID geom, hapi_feels_said *out)
{
  uint64_t model = nearby->cycle->model_number + 1;
  uint64_t name = hapi_geom_names_get(&nearby->tools.names, geom, model);
  hapi_known_feel spare = {.geom = name, .pointer = pointer};
  hapi_known_feel *known = feels_place(&nearby->neighbors.feels, name, pointer, model);
  known = known != NULL ? known : &spare;
  if (!feel_know(nearby, geom, known)) {
    return false;
  }
  known->model = model;
  if (known->feel.texture != NULL) {
    geom_place(nearby, geom, &known->feel.geom);
  }
  *out = (hapi_feels_said){.mu = known->feel.mu_static,
                           .reach = known->reach,
                           .feel = known->special ? known->number : 0};
  nearby->neighbors.feels.reach_now = fmax(nearby->neighbors.feels.reach_now, known->reach);
  return known->touchable;
}

bool hapi_feels_ask(hapi_nearby *nearby, uint32_t pointer, dGeomID geom, hapi_feels_said *out)
{
  bool touchable = true;
  *out = (hapi_feels_said){.mu = hapi_state_pointers(nearby->cycle->state)[pointer].friction};
  if (nearby->world->ode.pointer_surface != NULL) {
    touchable = feel_find(nearby, pointer, geom, out);
  }
  if (hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_FRICTION)) {
    out->mu = 0.0;
  }
  return touchable;
}

/* ---- to the loop ---- */

static void feel_tell(const hapi_known_feel *known, bool friction, hapi_model_feel *out)
{
  *out = (hapi_model_feel){.number = known->number, .pointer = known->pointer, .feel = known->feel};
  if (!friction) {
    out->feel.mu = out->feel.mu_static = 0.0;
  }
}

void hapi_feels_publish(hapi_nearby *nearby, hapi_model *out)
{
  hapi_feels *feels = &nearby->neighbors.feels;
  bool friction = !hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_FRICTION);
  out->feel_count = 0;
  for (uint32_t i = 0; i < feels->count; ++i) {
    const hapi_known_feel *known = &feels->list[i];
    if (known->model != out->number || !known->special || !known->touchable) {
      continue;
    }
    if (out->feel_count == nearby->cycle->config->capacity.feels) {
      hapi_say_once(
          nearby->cycle, &feels->said_crowded,
          "more geoms with a surface of their own are near pointers than there is room "
          "for, 128: the others have the pointer's stiffness, and their static friction only");
      return;
    }
    feel_tell(known, friction, &hapi_model_feels(out)[out->feel_count++]);
  }
}
