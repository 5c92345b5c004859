/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

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

static void make_contacts(hapi_physics *physics, dGeomID a, dGeomID b,
                          const dSurfaceParameters *surface)
{
  dContact *contacts = physics->contact_scratch;
  int count =
      dCollide(a, b, physics->ode.max_contacts_per_pair, &contacts[0].geom, sizeof(dContact));
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = *surface;
    dJointID joint = dJointCreateContact(physics->ode.world, physics->contact_group, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
  }
}

/* What ODE reads of a surface must be numbers: one that is not ends in an abort of the process. */
static bool sound_surface(const dSurfaceParameters *s)
{
  const struct {
    int bit;
    double value;
  } parts[] = {
      {dContactMu2, s->mu2},          {dContactRolling, s->rho},
      {dContactBounce, s->bounce},    {dContactBounce, s->bounce_vel},
      {dContactSoftERP, s->soft_erp}, {dContactSoftCFM, s->soft_cfm},
      {dContactMotion1, s->motion1},  {dContactMotion2, s->motion2},
      {dContactMotionN, s->motionN},  {dContactSlip1, s->slip1},
      {dContactSlip2, s->slip2},
  };
  bool sound = s->mu >= 0.0; /* also infinity; false for NaN */
  for (size_t i = 0; i < sizeof parts / sizeof parts[0]; ++i) {
    bool friction = parts[i].bit == dContactMu2 || parts[i].bit == dContactRolling;
    bool good = friction ? parts[i].value >= 0.0 : fabs(parts[i].value) <= 1e12;
    sound = sound && ((s->mode & parts[i].bit) == 0 || good);
  }
  return sound;
}

static bool can_move(dBodyID body)
{
  return body != NULL && !dBodyIsKinematic(body);
}

static void near_callback(void *data, dGeomID a, dGeomID b)
{
  hapi_physics *physics = data;
  if (dGeomIsSpace(a) || dGeomIsSpace(b)) {
    dSpaceCollide2(a, b, data, near_callback); /* what is inside of one is met by itself */
    return;
  }
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (body_a == body_b || (!can_move(body_a) && !can_move(body_b))) {
    return;
  }
  dSurfaceParameters surface = {.mode = dContactApprox1, .mu = dInfinity};
  if (physics->ode.surface != NULL && !physics->ode.surface(physics->ode.user, a, b, &surface)) {
    return;
  }
  if (!sound_surface(&surface)) {
    physics->config.report(physics->config.user, HAP_FAULT_WORLD,
                           "the surface callback gave a number that is not finite or a friction "
                           "below 0: the pair has no contact");
    return;
  }
  make_contacts(physics, a, b, &surface);
}

/* The pairs inside a space, and those inside each space in it: every pair once. */
static void collide_inside(hapi_physics *physics, dSpaceID space)
{
  dSpaceCollide(space, physics, near_callback);
  int count = dSpaceGetNumGeoms(space);
  for (int i = 0; i < count; ++i) {
    dGeomID geom = dSpaceGetGeom(space, i);
    if (dGeomIsSpace(geom)) {
      collide_inside(physics, (dSpaceID)geom);
    }
  }
}

void hapi_world_collide(hapi_physics *physics)
{
  dJointGroupEmpty(physics->contact_group);
  collide_inside(physics, physics->ode.space);
}

void hapi_world_quickstep(hapi_physics *physics, double step_s)
{
  ++physics->figures.stats.quickstep_calls;
  dWorldQuickStep(physics->ode.world, step_s);
}

void hapi_world_read_user_wrenches(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->table.high; ++i) {
    hapi_known_body *known = &physics->table.entries[i];
    if (known->body != NULL) {
      hapi_v3_copy(dBodyGetForce(known->body), known->user_force);
      hapi_v3_copy(dBodyGetTorque(known->body), known->user_torque);
    }
  }
}
