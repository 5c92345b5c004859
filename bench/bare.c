/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/bare.h"

#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "bench/bench.h"

#define CONTACTS_PER_PAIR 8 /* hap_ode_def's default */
#define REPEATS_MAX 16

hap_status bare_create(const scene_parameters *parameters, int count, bare *out, hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  hap_status status = scene_create_from(parameters, count, &out->scene, detail);
  if (status < HAP_OK) {
    return status;
  }
  out->contacts = dJointGroupCreate(0);
  out->scratch = calloc(CONTACTS_PER_PAIR, sizeof *out->scratch);
  dWorldSetStepIslandsProcessingMaxThreadCount(out->scene->world, 1);
  if (out->scratch == NULL) {
    bare_destroy(out);
    snprintf(detail->text, sizeof detail->text, "no memory for contacts");
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
  memset(b, 0, sizeof *b);
}

void bare_follow(bare *b, const scene *from)
{
  for (size_t i = 0; i < from->body_count; ++i) {
    const dReal *p = dBodyGetPosition(from->bodies[i]);
    const dReal *v = dBodyGetLinearVel(from->bodies[i]);
    const dReal *w = dBodyGetAngularVel(from->bodies[i]);
    dBodySetPosition(b->scene->bodies[i], p[0], p[1], p[2]);
    dBodySetQuaternion(b->scene->bodies[i], dBodyGetQuaternion(from->bodies[i]));
    dBodySetLinearVel(b->scene->bodies[i], v[0], v[1], v[2]);
    dBodySetAngularVel(b->scene->bodies[i], w[0], w[1], w[2]);
  }
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
    contacts[i].surface = surface;
    dJointID joint = dJointCreateContact(b->scene->world, b->contacts, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(x), dGeomGetBody(y));
  }
}

static double since(int64_t begin_ns)
{
  return 1e-9 * (double)(hapi_clock_now() - begin_ns);
}

double bare_cycle(bare *b, double step_s)
{
  unsigned long seed = dRandGetSeed();
  int64_t begin_ns = hapi_clock_now();
  dJointGroupEmpty(b->contacts);
  dSpaceCollide(b->scene->space, b, near_callback);
  dWorldQuickStep(b->scene->world, step_s);
  double spent = since(begin_ns);
  dRandSetSeed(seed);
  return spent;
}

/* ---- the island of the first body ---- */

/* Enables what hangs together with the first body and switches all others off. The scenes of the
 * bench are rows: a body of the island is jointed to the one before it or after it. */
static void enable_island(const scene *s)
{
  bool linked = true;
  for (size_t i = 0; i < s->body_count; ++i) {
    linked = linked && (i == 0 || dAreConnected(s->bodies[i - 1], s->bodies[i]) != 0);
    if (linked) {
      dBodyEnable(s->bodies[i]);
    } else {
      dBodyDisable(s->bodies[i]);
    }
  }
}

static void enable_all(const scene *s)
{
  for (size_t i = 0; i < s->body_count; ++i) {
    dBodyEnable(s->bodies[i]);
  }
}

double bare_island_step(bare *b, double step_s, int repeats)
{
  double times[REPEATS_MAX];
  unsigned long seed = dRandGetSeed();
  int count = repeats < REPEATS_MAX ? repeats : REPEATS_MAX;
  enable_island(b->scene);
  for (int i = 0; i < count; ++i) {
    dRandSetSeed(seed);
    int64_t begin_ns = hapi_clock_now();
    dWorldQuickStep(b->scene->world, step_s);
    times[i] = since(begin_ns);
  }
  enable_all(b->scene);
  dRandSetSeed(seed);
  return bench_median(times, (size_t)count);
}
