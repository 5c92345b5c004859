/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_PLAIN_STEPS_H
#define HAPODE_TESTS_PLAIN_STEPS_H

/* A plain loop of ODE for tests of how the world is stepped: a cube that is pushed over a soft
 * floor, and a bar that swings. */

#include "tests/contact_world.h"

#define PLAIN_HZ 20.0 /* of the steps that ERP, CFM and damping are meant for */
#define PLAIN_ERP 0.2
#define PLAIN_CFM 1e-3
#define PLAIN_DAMPING 0.02
#define PLAIN_PUSH 3.0 /* N, on the cube */

typedef struct plain_things {
  dBodyID cube;
  dBodyID bar;
} plain_things;

typedef struct plain_loop {
  dWorldID world;
  dSpaceID space;
  dJointGroupID contacts;
  dSurfaceParameters surface;
  plain_things t;
} plain_loop;

static void plain_build(dWorldID world, dSpaceID space, plain_things *out)
{
  (void)dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  out->cube = ode_box(world, space, 0.5, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, 0.05));
  out->bar = ode_box(world, space, 0.5, AT(0.2, 0.02, 0.02), AT(0.1, 2.0, 1.0));
  dJointID hinge = dJointCreateHinge(world, NULL);
  dJointAttach(hinge, out->bar, NULL);
  dJointSetHingeAnchor(hinge, 0.0, 2.0, 1.0);
  dJointSetHingeAxis(hinge, 0.0, 1.0, 0.0);
  dBodySetLinearDamping(out->bar, PLAIN_DAMPING);
  dBodySetLinearDampingThreshold(out->bar, 0.0);
}

static dSurfaceParameters plain_surface(double erp, double cfm)
{
  return (dSurfaceParameters){.mode = dContactApprox1 | dContactSoftERP | dContactSoftCFM,
                              .mu = 0.2,
                              .soft_erp = erp,
                              .soft_cfm = cfm};
}

/* The things in a world that only ODE steps, left to the session of w. */
static contact_world *plain_session(plain_things *out)
{
  contact_world *w = cw_new(9.81);
  w->surface = plain_surface(PLAIN_ERP, PLAIN_CFM);
  dWorldSetQuickStepNumIterations(w->world, 1000); /* else its order of rows shows */
  plain_build(w->world, w->space, out);
  w->bodies[w->body_count++] = out->cube;
  w->bodies[w->body_count++] = out->bar;
  w->user.force[0] = PLAIN_PUSH;
  w->expert.iterations = 0;
  w->expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECT_RANGE); /* all of it is ODE's */
  return w;
}

static void plain_open(plain_loop *p)
{
  ode_world_make(9.81, &p->world, &p->space);
  p->contacts = dJointGroupCreate(0);
  dWorldSetContactSurfaceLayer(p->world, 1e-4);
  dWorldSetQuickStepNumIterations(p->world, 1000);
  plain_build(p->world, p->space, &p->t);
}

static void plain_close(plain_loop *p)
{
  dJointGroupDestroy(p->contacts);
  ode_world_end(NULL, p->world, p->space);
}

static void plain_near(void *data, dGeomID a, dGeomID b)
{
  plain_loop *p = data;
  dContact contacts[8];
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = p->surface;
    dJointID joint = dJointCreateContact(p->world, p->contacts, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
  }
}

/* The same spring and damper in a step that is that many times as long. */
static void plain_convert(double ratio, double *io_erp, double *io_cfm)
{
  double part = ratio * *io_erp + 1.0 - *io_erp;
  *io_erp *= ratio / part;
  *io_cfm /= part;
}

/* meant_hz: the rate that ERP, CFM and damping are taken as meant for. */
static void plain_run(plain_loop *p, int steps, double hz, double meant_hz)
{
  double ratio = meant_hz / hz;
  double erp = PLAIN_ERP;
  double cfm = PLAIN_CFM;
  double world_erp = PLAIN_ERP;
  double world_cfm = 1e-12;
  plain_convert(ratio, &erp, &cfm);
  plain_convert(ratio, &world_erp, &world_cfm);
  p->surface = plain_surface(erp, cfm);
  dWorldSetERP(p->world, world_erp);
  dWorldSetCFM(p->world, world_cfm);
  dBodySetLinearDamping(p->t.bar, 1.0 - pow(1.0 - PLAIN_DAMPING, ratio));
  for (int i = 0; i < steps; ++i) {
    dBodyAddForce(p->t.cube, PLAIN_PUSH, 0.0, 0.0);
    dJointGroupEmpty(p->contacts);
    dSpaceCollide(p->space, p, plain_near);
    dWorldQuickStep(p->world, 1.0 / hz);
  }
}

/* m: the most by which cube or bar are off along an axis. */
static double plain_off(const plain_loop *p, const plain_things *mine)
{
  const dBodyID right[2] = {p->t.cube, p->t.bar};
  const dBodyID have[2] = {mine->cube, mine->bar};
  double off = 0.0;
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 3; ++k) {
      off = fmax(off, fabs(dBodyGetPosition(have[i])[k] - dBodyGetPosition(right[i])[k]));
    }
  }
  return off;
}

#endif
