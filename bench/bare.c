/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/bare.h"

#include <stdlib.h>
#include <string.h>

#include "base/clock.h"

#define CONTACTS_PER_PAIR 8 /* hap_ode_def's default */

hap_status bare_create(const scene_parameters *parameters, int count, bare *out, hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  hap_status status = scene_create_from(parameters, count, &out->scene, detail);
  if (status < HAP_OK) {
    return status;
  }
  out->contacts = dJointGroupCreate(0);
  out->scratch = calloc(CONTACTS_PER_PAIR, sizeof *out->scratch);
  out->states = calloc(out->scene->body_count, sizeof *out->states);
  dWorldSetStepIslandsProcessingMaxThreadCount(out->scene->world, 1);
  if (out->scratch == NULL || out->states == NULL) {
    bare_destroy(out);
    snprintf(detail->text, sizeof detail->text, "no memory for a second scene");
    return HAP_ERROR_MEMORY;
  }
  return HAP_OK;
}

void bare_destroy(bare *b)
{
  if (b->contacts != NULL) {
    dJointGroupDestroy(b->contacts);
  }
  scene_destroy(b->scene);
  free(b->scratch);
  free(b->states);
  memset(b, 0, sizeof *b);
}

static void read_states(const scene *from, bare_state *states)
{
  for (size_t i = 0; i < from->body_count; ++i) {
    dBodyID body = from->bodies[i];
    memcpy(states[i].position, dBodyGetPosition(body), sizeof states[i].position);
    memcpy(states[i].quat, dBodyGetQuaternion(body), sizeof states[i].quat);
    memcpy(states[i].linear, dBodyGetLinearVel(body), sizeof states[i].linear);
    memcpy(states[i].angular, dBodyGetAngularVel(body), sizeof states[i].angular);
  }
}

static void write_states(bare *b)
{
  for (size_t i = 0; i < b->scene->body_count; ++i) {
    const bare_state *s = &b->states[i];
    dBodyID body = b->scene->bodies[i];
    dBodySetPosition(body, s->position[0], s->position[1], s->position[2]);
    dBodySetQuaternion(body, s->quat);
    dBodySetLinearVel(body, s->linear[0], s->linear[1], s->linear[2]);
    dBodySetAngularVel(body, s->angular[0], s->angular[1], s->angular[2]);
  }
}

void bare_follow(bare *b, const scene *from)
{
  read_states(from, b->states);
  write_states(b);
}

static void near_callback(void *data, dGeomID x, dGeomID y)
{
  bare *b = data;
  dContact *contacts = b->scratch;
  dSurfaceParameters surface;
  memset(&surface, 0, sizeof surface);
  if (dGeomGetBody(x) == NULL && dGeomGetBody(y) == NULL) {
    return;
  }
  if (!scene_surface(b->scene, x, y, &surface)) {
    return;
  }
  int count = dCollide(x, y, CONTACTS_PER_PAIR, &contacts[0].geom, sizeof *contacts);
  for (int i = 0; i < count; ++i) {
    const dReal *n = contacts[i].geom.normal;
    if (dCalcVectorDot3(n, n) < 0.98) {
      continue; /* ODE would abort on a contact without a normal */
    }
    contacts[i].surface = surface;
    dJointID joint = dJointCreateContact(b->scene->world, b->contacts, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(x), dGeomGetBody(y));
  }
  b->contact_count += (size_t)count;
}

static void find_contacts(bare *b)
{
  dJointGroupEmpty(b->contacts);
  b->contact_count = 0;
  dSpaceCollide(b->scene->space, b, near_callback);
}

static double seconds_since(int64_t begin_ns)
{
  return 1e-9 * (double)(hapi_clock_now() - begin_ns);
}

double bare_cycle(bare *b, double step_s, bool step_alone)
{
  unsigned long seed = dRandGetSeed();
  int64_t begin_ns = hapi_clock_now();
  find_contacts(b);
  begin_ns = step_alone ? hapi_clock_now() : begin_ns;
  dWorldQuickStep(b->scene->world, step_s);
  double spent = seconds_since(begin_ns);
  dRandSetSeed(seed);
  return spent;
}

void bare_exact_step(bare *b, double step_s)
{
  find_contacts(b);
  dWorldStep(b->scene->world, step_s);
}

/* ---- islands ---- */

static double distance_squared(dBodyID body, const double at[3])
{
  const dReal *p = dBodyGetPosition(body);
  return (p[0] - at[0]) * (p[0] - at[0]) + (p[1] - at[1]) * (p[1] - at[1]) +
         (p[2] - at[2]) * (p[2] - at[2]);
}

/* The body nearest to a point among those that are switched off; NULL when there is none. */
static dBodyID nearest_off(const scene *s, const double at[3])
{
  dBodyID nearest = NULL;
  for (size_t i = 0; i < s->body_count; ++i) {
    bool off = dBodyIsEnabled(s->bodies[i]) == 0;
    if (off &&
        (nearest == NULL || distance_squared(s->bodies[i], at) < distance_squared(nearest, at))) {
      nearest = s->bodies[i];
    }
  }
  return nearest;
}

/* Switches on what hangs together with this body. */
static void enable_island(dBodyID body)
{
  dBodyEnable(body);
  int joints = dBodyGetNumJoints(body);
  for (int i = 0; i < 2 * joints; ++i) {
    dBodyID other = dJointGetBody(dBodyGetJoint(body, i / 2), i % 2);
    if (other != NULL && dBodyIsEnabled(other) == 0) {
      enable_island(other);
    }
  }
}

/* Leaves on the bodies nearest to the hand and what hangs together with them. */
static dBodyID enable_islands(const scene *s, size_t neighbours, const double hand[3])
{
  dBodyID first = NULL;
  for (size_t i = 0; i < s->body_count; ++i) {
    dBodyDisable(s->bodies[i]);
  }
  for (size_t i = 0; i < neighbours; ++i) {
    dBodyID body = nearest_off(s, hand);
    first = first == NULL ? body : first;
    if (body != NULL) {
      enable_island(body);
    }
  }
  return first;
}

double bare_island_step(bare *b, size_t neighbours, const double hand[3], double force,
                        double step_s)
{
  unsigned long seed = dRandGetSeed();
  double spent = 0.0;
  read_states(b->scene, b->states);
  dBodyID touched = enable_islands(b->scene, neighbours, hand);
  for (int i = 0; i < 4; ++i) {
    write_states(b);
    if (i > 0 && touched != NULL) {
      const dReal *at = dBodyGetPosition(touched); /* where the hand meets it */
      dBodyAddForceAtPos(touched, i == 1 ? force : 0.0, i == 2 ? force : 0.0, i == 3 ? force : 0.0,
                         at[0] - 0.5 * b->scene->parameters.size, at[1], at[2]);
    }
    dRandSetSeed(seed);
    int64_t begin_ns = hapi_clock_now();
    dWorldQuickStep(b->scene->world, step_s);
    spent += seconds_since(begin_ns);
  }
  for (size_t i = 0; i < b->scene->body_count; ++i) {
    dBodyEnable(b->scene->bodies[i]);
  }
  dRandSetSeed(seed);
  return spent / 4.0;
}
