/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_PHYSICS_WORLD_H
#define HAPODE_TESTS_PHYSICS_WORLD_H

/* A small ODE world with a lockstep session over it, for the tests of lib/physics. Pointers have no
 * device: a test puts them where it wants them. Include after tap.h. */

#include "base/vec.h"
#include "physics/physics_internal.h"
#include "session/session_internal.h"
#include "tests/ode_world.h"

#define WORLD_BODIES_MAX 64
#define WORLD_POINTERS_MAX 4

typedef struct test_world {
  dWorldID world;
  dSpaceID space;
  dBodyID bodies[WORLD_BODIES_MAX];
  int body_count;
  double mu; /* of every pair */
  hap_session *session;
  hap_pointer_id pointers[WORLD_POINTERS_MAX];
  int pointer_count;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_step_fn before_step;
  hap_step_fn after_step;
  int surface_calls;
} test_world;

/* A step H of 20 Hz. */
static inline void world_open(test_world *w, double gravity, int iterations)
{
  memset(w, 0, sizeof *w);
  ode_world_make(gravity, &w->world, &w->space);
  ode_world_stiffen(w->world, iterations);
  w->mu = 0.5;
  session_defs_init(&w->def, &w->expert, &w->research);
  w->def.drive = HAP_DRIVE_LOCKSTEP;
  w->def.model = HAP_MODEL_ACCELERANCE;
  w->def.physics_hz = 20.0;
  w->def.haptic_hz = 1000.0;
}

static inline void world_close(test_world *w)
{
  ode_world_end(w->session, w->world, w->space);
  memset(w, 0, sizeof *w);
}

static inline void world_close_owned(void *owned)
{
  world_close(owned);
}

/* Closed when the test has ended. */
static inline test_world *world_new(double gravity, int iterations)
{
  test_world *w = tap_own(sizeof *w, world_close_owned);
  world_open(w, gravity, iterations);
  return w;
}

static inline dBodyID world_add(test_world *w, dGeomID geom, const dMass *mass, double x, double y,
                                double z)
{
  return w->bodies[w->body_count++] = ode_body(w->world, geom, mass, AT(x, y, z));
}

static inline dBodyID world_add_box(test_world *w, const double edges[3], double mass, double x,
                                    double y, double z)
{
  return w->bodies[w->body_count++] = ode_box(w->world, w->space, mass, edges, AT(x, y, z));
}

static inline dBodyID world_add_cube(test_world *w, double edge, double mass, double x, double y,
                                     double z)
{
  return world_add_box(w, AT(edge, edge, edge), mass, x, y, z);
}

static inline dBodyID world_add_sphere(test_world *w, double radius, double mass, double x,
                                       double y, double z)
{
  return w->bodies[w->body_count++] = ode_ball(w->world, w->space, mass, radius, AT(x, y, z));
}

static inline bool world_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  test_world *w = user;
  (void)a;
  (void)b;
  ++w->surface_calls;
  io->mu = w->mu;
  return true;
}

static inline void world_create_session(test_world *w, hap_surface_fn surface)
{
  hap_ode_def ode;
  if (w->def.model == HAP_MODEL_ACCELERANCE) { /* also of free bodies: it is what is looked at */
    expert_wish(&w->expert, HAP_EFFECT_TESTING, HAP_EFFECT_ON);
  }
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = w->world;
  ode.space = w->space;
  ode.surface = surface != NULL ? surface : world_surface;
  ode.before_step = w->before_step;
  ode.after_step = w->after_step;
  ode.user = w;
  w->session = session_make(&w->def, &ode);
}

static inline void world_move_pointer(test_world *w, int index, const double at[3],
                                      const double velocity[3])
{
  hap_pose pose = {{at[0], at[1], at[2]}, {1.0, 0.0, 0.0, 0.0}};
  hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  if (velocity != NULL) {
    memcpy(twist.linear, velocity, sizeof twist.linear);
  }
  CHECK(hap_pointer_set_target(w->session, w->pointers[index], &pose, &twist) == HAP_OK);
}

static inline void world_add_pointer(test_world *w, double radius, double x, double y, double z)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.radius = radius;
  int index = w->pointer_count++;
  CHECK(hap_pointer_add(w->session, &def, &w->pointers[index]) == HAP_OK);
  world_move_pointer(w, index, AT(x, y, z), NULL);
}

/* A session with one pointer, started: the first local model is built. */
static inline void world_start(test_world *w, double radius, double x, double y, double z)
{
  world_create_session(w, NULL);
  world_add_pointer(w, radius, x, y, z);
  session_run(w->session);
}

static inline hapi_physics *world_physics(const test_world *w)
{
  return w->session->physics;
}

/* One physics step: 50 ticks. */
static inline void world_step(test_world *w, int steps)
{
  uint64_t ticks = (uint64_t)(w->def.haptic_hz / w->def.physics_hz + 0.5) * (uint64_t)steps;
  CHECK(hap_session_advance(w->session, ticks) == HAP_OK);
}

static inline hap_stats world_stats(const test_world *w)
{
  return session_stats(w->session);
}

/* The live contact of a body (NULL: the static world) and a pointer; NULL: there is none. */
static inline hapi_contact_slot *world_contact(const test_world *w, dBodyID body, uint32_t pointer)
{
  hapi_physics *physics = world_physics(w);
  for (uint32_t i = 0; i < physics->config.capacity.contacts; ++i) {
    hapi_contact_slot *slot = &physics->near.slots.contacts[i];
    if (slot->phase != HAPI_SLOT_LIVE || slot->pointer != pointer) {
      continue;
    }
    dBodyID of = NULL;
    if (slot->body != HAPI_SLOT_NONE) {
      of = physics->world.bodies.entries[physics->near.slots.bodies[slot->body].known].body;
    }
    if (of == body) {
      return slot;
    }
  }
  return NULL;
}

static inline int world_count_contacts(const test_world *w)
{
  hapi_physics *physics = world_physics(w);
  int count = 0;
  for (uint32_t i = 0; i < physics->config.capacity.contacts; ++i) {
    count += physics->near.slots.contacts[i].phase == HAPI_SLOT_LIVE;
  }
  return count;
}

static inline hapi_body_slot *world_slot(const test_world *w, dBodyID body)
{
  hapi_physics *physics = world_physics(w);
  uint32_t known = hapi_bodies_find(&physics->world.bodies, body);
  uint32_t slot = known != HAPI_NONE ? physics->world.bodies.entries[known].slot : HAPI_NONE;
  return slot != HAPI_NONE ? &physics->near.slots.bodies[slot] : NULL;
}

/* What testing simulations found out. */
static inline hapi_body_answer *world_answer(const test_world *w, const hapi_body_slot *slot)
{
  hapi_physics *physics = world_physics(w);
  return &physics->probe.answers.bodies[slot - physics->near.slots.bodies];
}

static inline hapi_contact_answer *world_contact_answer(const test_world *w,
                                                        const hapi_contact_slot *contact)
{
  hapi_physics *physics = world_physics(w);
  return &physics->probe.answers.contacts[contact - physics->near.slots.contacts];
}

/* The testing simulations of the contacts once more. */
static inline void world_measure(const test_world *w)
{
  hapi_physics *physics = world_physics(w);
  hapi_accelerance_measure(&physics->probe, hapi_cross_watch(&physics->cross));
}

static inline const hapi_slot_account *world_account(const test_world *w, dBodyID body)
{
  hapi_physics *physics = world_physics(w);
  const hapi_body_slot *slot = world_slot(w, body);
  return slot != NULL
             ? hapi_account_of(&physics->account, (uint32_t)(slot - physics->near.slots.bodies))
             : NULL;
}

#endif
