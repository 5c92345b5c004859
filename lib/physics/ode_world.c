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

bool hapi_world_direction(hapi_physics *physics, dGeomID a, dGeomID b, double out[3])
{
  bool given = physics->ode.friction_direction != NULL &&
               physics->ode.friction_direction(physics->ode.user, a, b, out);
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
  if (physics->model != HAP_MODEL_SINGLE || (s->mode & (dContactSoftERP | dContactSoftCFM)) == 0) {
    return;
  }
  double erp = (s->mode & dContactSoftERP) != 0 ? s->soft_erp : dWorldGetERP(physics->ode.world);
  double cfm = (s->mode & dContactSoftCFM) != 0 ? s->soft_cfm : dWorldGetCFM(physics->ode.world);
  hapi_soften(physics->config.physics_hz / physics->config.haptic_hz, &erp, &cfm);
  s->soft_erp = erp;
  s->soft_cfm = cfm;
  s->mode |= dContactSoftERP | dContactSoftCFM;
}

static void make_contacts(hapi_physics *physics, dGeomID a, dGeomID b, dSurfaceParameters *surface)
{
  dContact *contacts = physics->contact_scratch;
  double direction[3];
  int count =
      dCollide(a, b, physics->ode.max_contacts_per_pair, &contacts[0].geom, sizeof(dContact));
  soften(physics, surface);
  bool directed = count > 0 && (surface->mode & dContactFDir1) != 0 &&
                  hapi_world_direction(physics, a, b, direction);
  if (!directed) {
    surface->mode &= ~dContactFDir1;
  }
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = *surface;
    if (directed) {
      set_direction(&contacts[i], direction);
    }
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

bool hapi_world_ask_surface(hapi_physics *physics, dGeomID a, dGeomID b, dSurfaceParameters *out)
{
  *out = (dSurfaceParameters){.mode = dContactApprox1, .mu = dInfinity};
  if (physics->ode.surface != NULL && !physics->ode.surface(physics->ode.user, a, b, out)) {
    return false;
  }
  if (!sound_surface(out)) {
    physics->config.report(physics->config.user, HAP_FAULT_WORLD,
                           "the surface callback gave a number that is not finite or a friction "
                           "below 0: the pair has no contact");
    return false;
  }
  return true;
}

/* The loop carries the contacts of what it moves: ODE must not have them as well. */
static bool carried_by_loop(const hapi_physics *physics, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&physics->table, body);
  uint32_t slot = known != HAPI_NONE ? physics->table.entries[known].slot : HAPI_NONE;
  return slot != HAPI_NONE && physics->bodies[slot].loop_owned;
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
  dSurfaceParameters surface;
  if (carried_by_loop(physics, body_a) || carried_by_loop(physics, body_b) ||
      !hapi_world_ask_surface(physics, a, b, &surface)) {
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
