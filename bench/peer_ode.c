/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Plain ODE: collision, QuickStep, one thread. */

#include <stdlib.h>
#include <string.h>

#include "bench/peer_ode.h"

#define CONTACTS_FLAT 8
#define CONTACTS_MESH 32

typedef struct ode_sim {
  peer_ode_world w;
  dJointGroupID contacts;
  double step_s;
} ode_sim;

/* ---- the world ---- */

static void box_create(peer_ode_world *w, size_t i)
{
  const peer_box *box = &w->description->boxes[i];
  const double *e = box->edges;
  dMass mass;
  dBodyID body = dBodyCreate(w->world);
  dMassSetBoxTotal(&mass, box->mass, e[0], e[1], e[2]);
  dBodySetMass(body, &mass);
  dBodySetPosition(body, box->at[0], box->at[1], box->at[2]);
  dGeomSetBody(dCreateBox(w->space, e[0], e[1], e[2]), body);
  w->bodies[i] = body;
}

static void joint_create(const peer_ode_world *w, const peer_joint *joint)
{
  const double *a = joint->anchor;
  dBodyID parent = joint->parent < 0 ? NULL : w->bodies[joint->parent];
  dBodyID child = w->bodies[joint->child];
  if (joint->kind == PEER_BALL) {
    dJointID ball = dJointCreateBall(w->world, NULL);
    dJointAttach(ball, child, parent);
    dJointSetBallAnchor(ball, a[0], a[1], a[2]);
  } else {
    dJointID hinge = dJointCreateHinge(w->world, NULL);
    dJointAttach(hinge, child, parent);
    dJointSetHingeAnchor(hinge, a[0], a[1], a[2]);
    dJointSetHingeAxis(hinge, joint->axis[0], joint->axis[1], joint->axis[2]);
  }
}

static void ground_create(peer_ode_world *w)
{
  const peer_ground *g = &w->description->ground;
  w->mesh = dGeomTriMeshDataCreate();
  dGeomTriMeshDataBuildDouble(w->mesh, g->vertices, 3 * sizeof *g->vertices, (int)g->vertex_count,
                              g->indices, (int)(3 * g->triangle_count), 3 * sizeof *g->indices);
  dCreateTriMesh(w->space, w->mesh, NULL, NULL, NULL);
}

bool peer_ode_world_create(const peer_world *world, bool may_sleep, peer_ode_world *out)
{
  memset(out, 0, sizeof *out);
  dRandSetSeed(1);
  out->description = world;
  out->world = dWorldCreate();
  out->space = dHashSpaceCreate(NULL);
  out->bodies = calloc(world->count, sizeof(dBodyID));
  if (out->bodies == NULL) {
    peer_ode_world_destroy(out);
    return false;
  }
  dWorldSetGravity(out->world, 0.0, 0.0, -world->gravity);
  dWorldSetContactSurfaceLayer(out->world, world->layer);
  dWorldSetStepIslandsProcessingMaxThreadCount(out->world, 1);
  dWorldSetAutoDisableFlag(out->world, may_sleep);
  dWorldSetAutoDisableSteps(out->world, 0);
  dWorldSetAutoDisableTime(out->world, PEER_SLEEP_S);
  if (world->has_floor) {
    dCreatePlane(out->space, 0.0, 0.0, 1.0, 0.0);
  }
  if (world->ground.cells > 0) {
    ground_create(out);
  }
  for (size_t i = 0; i < world->count; ++i) {
    box_create(out, i);
  }
  for (size_t i = 0; i < world->joint_count; ++i) {
    joint_create(out, &world->joints[i]);
  }
  return true;
}

void peer_ode_world_destroy(peer_ode_world *w)
{
  if (w->world != NULL) {
    dSpaceDestroy(w->space);
    dWorldDestroy(w->world);
  }
  if (w->mesh != NULL) {
    dGeomTriMeshDataDestroy(w->mesh);
  }
  free(w->bodies);
  memset(w, 0, sizeof *w);
}

int peer_ode_contacts(const peer_world *world)
{
  return world->ground.cells > 0 ? CONTACTS_MESH : CONTACTS_FLAT;
}

bool peer_ode_collides(const peer_world *world, dGeomID a, dGeomID b)
{
  dBodyID x = dGeomGetBody(a);
  dBodyID y = dGeomGetBody(b);
  return (x != NULL || y != NULL) && (x == NULL || y == NULL || !world->boxes_pass);
}

int peer_ode_touch(const peer_world *world, dGeomID a, dGeomID b, int most, dContact *out)
{
  int found = dCollide(a, b, most, &out[0].geom, sizeof out[0]);
  int count = 0;
  for (int i = 0; i < found; ++i) {
    const dReal *n = out[i].geom.normal;
    if (dCalcVectorDot3(n, n) < 0.98) {
      continue; /* ODE would abort on a contact without a normal */
    }
    out[count].geom = out[i].geom;
    memset(&out[count].surface, 0, sizeof out[count].surface);
    out[count].surface.mode = dContactApprox1;
    out[count].surface.mu = world->mu;
    ++count;
  }
  return count;
}

/* ---- the engine ---- */

static void ode_near(void *data, dGeomID a, dGeomID b)
{
  ode_sim *sim = data;
  dContact contacts[CONTACTS_MESH];
  const peer_world *world = sim->w.description;
  dBodyID x = dGeomGetBody(a);
  dBodyID y = dGeomGetBody(b);
  bool x_rests = x == NULL || dBodyIsEnabled(x) == 0;
  bool y_rests = y == NULL || dBodyIsEnabled(y) == 0;
  if (!peer_ode_collides(world, a, b) || (x_rests && y_rests)) {
    return;
  }
  int count = peer_ode_touch(world, a, b, peer_ode_contacts(world), contacts);
  for (int i = 0; i < count; ++i) {
    dJointAttach(dJointCreateContact(sim->w.world, sim->contacts, &contacts[i]), x, y);
  }
}

static void *ode_create(const peer_world *world, const peer_setting *setting)
{
  ode_sim *sim = calloc(1, sizeof *sim);
  if (sim == NULL || !peer_ode_world_create(world, setting->may_sleep, &sim->w)) {
    free(sim);
    return NULL;
  }
  sim->contacts = dJointGroupCreate(0);
  sim->step_s = setting->step_s;
  dWorldSetQuickStepNumIterations(sim->w.world, setting->iterations);
  return sim;
}

static void ode_destroy(void *data)
{
  ode_sim *sim = data;
  dJointGroupDestroy(sim->contacts);
  peer_ode_world_destroy(&sim->w);
  free(sim);
}

static void ode_step(void *data, const peer_push *pushes, size_t count)
{
  ode_sim *sim = data;
  for (size_t i = 0; i < count; ++i) {
    const double *f = pushes[i].force;
    const double *p = pushes[i].point;
    dBodyID body = sim->w.bodies[pushes[i].box];
    dBodyEnable(body);
    dBodyAddForceAtPos(body, f[0], f[1], f[2], p[0], p[1], p[2]);
  }
  dJointGroupEmpty(sim->contacts);
  dSpaceCollide(sim->w.space, sim, ode_near);
  dWorldQuickStep(sim->w.world, sim->step_s);
}

static void ode_read(const void *data, size_t box, peer_motion *out)
{
  const ode_sim *sim = data;
  dBodyID body = sim->w.bodies[box];
  memcpy(out->position, dBodyGetPosition(body), sizeof out->position);
  memcpy(out->quat_wxyz, dBodyGetQuaternion(body), sizeof out->quat_wxyz);
  memcpy(out->linear, dBodyGetLinearVel(body), sizeof out->linear);
  memcpy(out->angular, dBodyGetAngularVel(body), sizeof out->angular);
}

static double ode_mass(const void *data, size_t box)
{
  const ode_sim *sim = data;
  dMass mass;
  dBodyGetMass(sim->w.bodies[box], &mass);
  return mass.mass;
}

static bool ode_sleeps(const void *data, size_t box)
{
  const ode_sim *sim = data;
  return dBodyIsEnabled(sim->w.bodies[box]) == 0;
}

static size_t ode_boxes(const void *data)
{
  const ode_sim *sim = data;
  size_t sum = 0;
  for (int i = 0; i < dSpaceGetNumGeoms(sim->w.space); ++i) {
    sum += dGeomGetBody(dSpaceGetGeom(sim->w.space, i)) != NULL;
  }
  return sum;
}

const peer_engine peer_ode = {.name = "ode",
                              .iterations = 20,
                              .boxes_most = 5000,
                              .can_sleep = true,
                              .create = ode_create,
                              .destroy = ode_destroy,
                              .step = ode_step,
                              .read = ode_read,
                              .mass = ode_mass,
                              .sleeps = ode_sleeps,
                              .boxes = ode_boxes};
