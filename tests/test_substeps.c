/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Steps of the world in parts, against a plain loop of ODE at the rate of the parts. */

#include "tests/tap.h"

#include "tests/contact_world.h"

#define PARTS 4
#define STEPS 20
#define HZ 20.0
#define ERP 0.2
#define CFM 1e-3
#define DAMPING 0.02
#define PUSH 3.0 /* N */

/* A cube that is pushed over a soft floor, and a bar that swings. */
typedef struct things {
  dWorldID world;
  dSpaceID space;
  dBodyID cube;
  dBodyID bar;
} things;

static dBodyID box_add(const things *t, double x, double y, double z, const double size[3])
{
  dMass mass;
  dBodyID body = dBodyCreate(t->world);
  dMassSetBoxTotal(&mass, 0.5, size[0], size[1], size[2]);
  dBodySetMass(body, &mass);
  dBodySetPosition(body, x, y, z);
  dGeomSetBody(dCreateBox(t->space, size[0], size[1], size[2]), body);
  return body;
}

static void things_build(things *t)
{
  const double cube[3] = {0.1, 0.1, 0.1};
  const double bar[3] = {0.2, 0.02, 0.02};
  (void)dCreatePlane(t->space, 0.0, 0.0, 1.0, 0.0);
  t->cube = box_add(t, 0.0, 0.0, 0.05, cube);
  t->bar = box_add(t, 0.1, 2.0, 1.0, bar);
  dJointID hinge = dJointCreateHinge(t->world, NULL);
  dJointAttach(hinge, t->bar, NULL);
  dJointSetHingeAnchor(hinge, 0.0, 2.0, 1.0);
  dJointSetHingeAxis(hinge, 0.0, 1.0, 0.0);
  dBodySetLinearDamping(t->bar, DAMPING);
  dBodySetLinearDampingThreshold(t->bar, 0.0);
}

static void surface_set(dSurfaceParameters *s, double erp, double cfm)
{
  *s = (dSurfaceParameters){.mode = dContactApprox1 | dContactSoftERP | dContactSoftCFM,
                            .mu = 0.2,
                            .soft_erp = erp,
                            .soft_cfm = cfm};
}

/* The same spring and damper in a step that is shorter by that. */
static void spring_convert(double ratio, double *io_erp, double *io_cfm)
{
  double part = ratio * *io_erp + 1.0 - *io_erp;
  *io_erp *= ratio / part;
  *io_cfm /= part;
}

typedef struct plain_loop {
  things t;
  dJointGroupID contacts;
  dSurfaceParameters surface;
} plain_loop;

static void plain_near(void *data, dGeomID a, dGeomID b)
{
  plain_loop *p = data;
  dContact contacts[8];
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = p->surface;
    dJointID joint = dJointCreateContact(p->t.world, p->contacts, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
  }
}

static void plain_run(plain_loop *p)
{
  double erp = ERP;
  double cfm = CFM;
  double world_erp = ERP;
  double world_cfm = 1e-12;
  spring_convert(1.0 / PARTS, &erp, &cfm);
  spring_convert(1.0 / PARTS, &world_erp, &world_cfm);
  surface_set(&p->surface, erp, cfm);
  p->t.world = dWorldCreate();
  p->t.space = dHashSpaceCreate(NULL);
  p->contacts = dJointGroupCreate(0);
  dWorldSetGravity(p->t.world, 0.0, 0.0, -9.81);
  dWorldSetERP(p->t.world, world_erp);
  dWorldSetCFM(p->t.world, world_cfm);
  dWorldSetContactSurfaceLayer(p->t.world, 1e-4);
  dWorldSetQuickStepNumIterations(p->t.world, 100);
  things_build(&p->t);
  dBodySetLinearDamping(p->t.bar, 1.0 - pow(1.0 - DAMPING, 1.0 / PARTS));
  for (int i = 0; i < STEPS * PARTS; ++i) {
    dBodyAddForce(p->t.cube, PUSH, 0.0, 0.0);
    dJointGroupEmpty(p->contacts);
    dSpaceCollide(p->t.space, p, plain_near);
    dWorldQuickStep(p->t.world, 1.0 / HZ / PARTS);
  }
}

static void plain_close(plain_loop *p)
{
  dJointGroupDestroy(p->contacts);
  dSpaceDestroy(p->t.space);
  dWorldDestroy(p->t.world);
}

/* m, of cube and bar together, after the same time. */
static double session_off(int substeps, const plain_loop *witness, uint32_t *out_callbacks)
{
  contact_world *w = cw_new(9.81);
  things t = {.world = w->world, .space = w->space};
  double off = 0.0;
  surface_set(&w->surface, ERP, CFM);
  things_build(&t);
  w->bodies[w->body_count++] = t.cube;
  w->bodies[w->body_count++] = t.bar;
  w->user.force[0] = PUSH;
  w->expert.substeps = substeps;
  w->expert.iterations = 0;
  w->expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECT_RANGE); /* all of it is ODE's */
  cw_start(w, 0.0, 100.0, 0.0);
  cw_run(w, (int)lround(1000.0 * STEPS / HZ) + 1);
  const dBodyID mine[2] = {t.cube, t.bar};
  const dBodyID right[2] = {witness->t.cube, witness->t.bar};
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 3; ++k) {
      off = fmax(off, fabs(dBodyGetPosition(mine[i])[k] - dBodyGetPosition(right[i])[k]));
    }
  }
  *out_callbacks = w->seen.steps;
  CHECK(cw_stats(w).physics.steps == STEPS);
  CHECK(w->seen.range_max == 0);
  return off;
}

TEST(a_step_in_parts_is_that_of_a_world_at_their_rate)
{
  plain_loop witness;
  uint32_t callbacks = 0;
  plain_run(&witness);
  double off = session_off(PARTS, &witness, &callbacks);
  double whole = session_off(1, &witness, &callbacks);
  printf("# off by %.3g m in %d parts, %.3g m in one\n", off, PARTS, whole);
  CHECK(off <= 1e-6);
  CHECK(whole > 1e-3);
  CHECK(callbacks == STEPS);
  plain_close(&witness);
}

/* What a hand pushes and the loop does not own gets the same impulse, whatever the parts. */
TEST(the_hands_impulse_acts_over_all_parts)
{
  for (int substeps = 1; substeps <= 8; substeps *= 8) {
    contact_world *w = cw_new(0.0);
    w->expert.substeps = substeps;
    w->expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECT_CONTACTS);
    dBodyID cube = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.0);
    (void)cw_add_cube(w, 0.5, 0.1, 0.1001, 0.0, 0.0); /* so that the loop may not own the first */
    w->hand_def.radius = 0.01;
    cw_start(w, -0.065, 0.0, 0.0);
    cw_move_hand(w, 0.1, 0.0, 0.0);
    cw_run(w, 501);
    printf("# %d parts: %.4g N s given, %.4g N s there\n", substeps, w->seen.impulse[0],
           w->seen.momentum[0]);
    CHECK(dBodyGetLinearVel(cube)[0] > 0.01);
    CHECK_NEAR(w->seen.momentum[0], w->seen.impulse[0], 0.02 * w->seen.impulse[0]);
  }
}

TEST(the_number_of_parts_is_checked)
{
  static const int32_t bad[] = {0, -1, 65};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    contact_world *w = cw_new(0.0);
    hap_detail detail = {""};
    w->expert.substeps = bad[i];
    w->ode.world = w->world;
    w->ode.space = w->space;
    CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_ARGUMENT);
    CHECK(strstr(detail.text, "substeps") != NULL);
  }
}
