/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Scenes of hapode-bench faults in which bodies come and go by themselves. */

#include <math.h>

#include "bench/faults_build.h"

/* ---- joints that nobody touches ---- */

#define LINKS 12
#define LINK_PITCH 0.045
#define LINK_RADIUS 0.006
#define LINK_MASS 0.03

static void joint_keep(faults_world *w, dJointID joint, dBodyID a, dBodyID b, const double at[3])
{
  dJointAttach(joint, a, b);
  dJointSetHingeAnchor(joint, at[0], at[1], at[2]);
  dJointSetHingeAxis(joint, 0.0, 1.0, 0.0);
  w->hinges[w->hinge_count++] = joint;
}

/* Links that hang down from the origin. */
static void chain_build(faults_world *w)
{
  dBodyID above = NULL;
  faults_gravity(w);
  for (int i = 0; i < LINKS; ++i) {
    dMass mass;
    double top = -LINK_PITCH * i;
    dBodyID link = faults_body(w, LINK_MASS, (double[3]){0.01, 0.01, LINK_PITCH},
                               (double[3]){0.0, 0.0, top - 0.5 * LINK_PITCH});
    dMassSetCapsuleTotal(&mass, LINK_MASS, 3, LINK_RADIUS, LINK_PITCH - 4.0 * LINK_RADIUS);
    dBodySetMass(link, &mass);
    dGeomSetBody(dCreateCapsule(w->space, LINK_RADIUS, LINK_PITCH - 4.0 * LINK_RADIUS), link);
    joint_keep(w, dJointCreateHinge(w->world, NULL), link, above, (double[3]){0.0, 0.0, top});
    above = link;
  }
}

/* Pushes the sixth link aside, and goes away fast. */
static const faults_path chain_path = {{-0.017, 0.0, -5.5 * LINK_PITCH},
                                       {{X, 0.05, 0.55, 0.08}, {X, 0.6, 0.8, -0.22}}};

#define PLANKS 12
#define PLANK_PITCH 0.042
#define PLANK_MASS 0.1
#define PLANK_SLOPE 0.5 /* rad, of the outermost */

/* Planks that sag between the hinges at their ends, along an arc. */
static void bridge_build(faults_world *w)
{
  const double size[3] = {0.038, 0.06, 0.008};
  double at[3] = {0.0, 0.0, 0.0};
  dBodyID last = NULL;
  faults_gravity(w);
  for (int i = 0; i < PLANKS; ++i) {
    at[0] -= 0.5 * PLANK_PITCH * cos(PLANK_SLOPE * (1.0 - 2.0 * (i + 0.5) / PLANKS));
  }
  for (int i = 0; i < PLANKS; ++i) {
    dMatrix3 turned;
    double slope = PLANK_SLOPE * (1.0 - 2.0 * (i + 0.5) / PLANKS);
    const double half[3] = {0.5 * PLANK_PITCH * cos(slope), 0.0, -0.5 * PLANK_PITCH * sin(slope)};
    dBodyID plank =
        faults_body(w, PLANK_MASS, size, (double[3]){at[0] + half[0], 0.0, at[2] + half[2]});
    dRFromAxisAndAngle(turned, 0.0, 1.0, 0.0, slope);
    dBodySetRotation(plank, turned);
    faults_box(w, plank, size, at);
    joint_keep(w, dJointCreateHinge(w->world, NULL), plank, last, at);
    at[0] += 2.0 * half[0];
    at[2] += 2.0 * half[2];
    last = plank;
  }
  joint_keep(w, dJointCreateHinge(w->world, NULL), last, NULL, at);
}

/* Comes from far above and presses on the middle, as the bridge has nearly come to rest. */
static const faults_path bridge_path = {{0.0, 0.0, 0.2}, {{Z, 0.6, 1.2, -0.26}}};

/* ---- bodies that arrive ---- */

static void fall_build(faults_world *w)
{
  dMass mass;
  const double size[3] = {0.04, 0.04, 0.04};
  faults_gravity(w);
  dBodyID ball = faults_body(w, 0.05, size, (double[3]){0.0, 0.0, 0.23});
  dMassSetSphereTotal(&mass, 0.05, 0.02);
  dBodySetMass(ball, &mass);
  dGeomSetBody(dCreateSphere(w->space, 0.02), ball);
}

static const faults_path still_path = {{0.0, 0.0, 0.0}};

static void fly_build(faults_world *w)
{
  const double size[3] = {0.05, 0.05, 0.05};
  dBodyID cube = faults_body(w, 0.1, size, (double[3]){0.235, 0.0, 0.0});
  faults_box(w, cube, size, (double[3]){0.0, 0.0, 0.0});
  dBodySetLinearVel(cube, -1.0, 0.0, 0.0);
}

#define BELT_SPEED 0.3

/* A box is put on a long belt, which carries it against the hand; there it slips. */
static void belt_build(faults_world *w)
{
  const double belt_size[3] = {4.0, 0.3, 0.05};
  const double size[3] = {0.06, 0.06, 0.06};
  const double at[3] = {-0.09, 0.0, 0.03 - FAULTS_LAYER};
  faults_gravity(w);
  dBodyID box = faults_body(w, 0.3, size, at);
  faults_box(w, box, size, at);
  dBodyID belt = faults_body(w, 10.0, belt_size, (double[3]){0.0, 0.0, -0.025});
  faults_box(w, belt, belt_size, (double[3]){0.0, 0.0, 0.0});
  dBodySetKinematic(belt);
  dBodySetLinearVel(belt, BELT_SPEED, 0.0, 0.0);
}

static const faults_path belt_path = {{0.0, 0.0, 0.03}};

/* A bar of 150 mm on a motor, which turns it against the hand. */
static void arm_build(faults_world *w)
{
  const double size[3] = {0.15, 0.02, 0.02};
  dMatrix3 turned;
  dBodyID arm = faults_body(w, 0.2, size, (double[3]){0.075 * cos(-0.8), 0.075 * sin(-0.8), 0.0});
  dRFromAxisAndAngle(turned, 0.0, 0.0, 1.0, -0.8);
  dBodySetRotation(arm, turned);
  faults_box(w, arm, size, (double[3]){0.0, 0.0, 0.0});
  dJointID axle = dJointCreateHinge(w->world, NULL);
  dJointAttach(axle, arm, NULL);
  dJointSetHingeAnchor(axle, 0.0, 0.0, 0.0);
  dJointSetHingeAxis(axle, 0.0, 0.0, 1.0);
  dJointSetHingeParam(axle, dParamVel, 3.0);
  dJointSetHingeParam(axle, dParamFMax, 0.3);
}

static const faults_path arm_path = {{0.12, 0.021, 0.0}};

/* ---- slow motion ---- */

static void slow_wall_build(faults_world *w)
{
  faults_box(w, NULL, (double[3]){0.1, 0.1, 0.1}, (double[3]){0.0, 0.0, -0.05});
}

/* 5 N from the begin. */
static const faults_path slow_wall_path = {{0.0, 0.0, 0.005}};

/* Beside the hand, which does not touch it. */
static void slow_fall_build(faults_world *w)
{
  const double size[3] = {0.04, 0.04, 0.04};
  faults_gravity(w);
  dBodyID cube = faults_body(w, 0.1, size, (double[3]){0.035, 0.0, 0.0});
  faults_box(w, cube, size, (double[3]){0.0, 0.0, 0.0});
}

static void height_read(faults_world *w, double begin, double end)
{
  (void)begin, (void)end;
  w->told = dBodyGetPosition(w->bodies[0])[2];
}

#define DRIVEN                                                                        \
  {                                                                                   \
    .kind = FAULTS_FORCE, .bound = 0.05, .reference_hz = 16000.0, .begins_hard = true \
  }
#define ARRIVES                                                    \
  {                                                                \
    .kind = FAULTS_ARRIVAL, .bound = 0.05, .reference_hz = 16000.0 \
  }

const faults_scene faults_moving_table[] = {
    /* item, name, world, hand, seconds, judged by */
    {11, "slow_wall", slow_wall_build, FINGER(&slow_wall_path), 1.0, WITHIN(0.02, .begin_s = 0.1),
     .slow = 0.1},
    {11, "slow_fall", slow_fall_build, FINGER(&still_path), 1.0,
     JUDGED(FAULTS_FEEDBACK, 0.05, .begin_s = 0.1), .after = height_read, .slow = 0.1},
    {12, "chain_let_go", chain_build, FINGER(&chain_path), 2.0, WITHIN(0.02)},
    {12, "bridge", bridge_build, FINGER(&bridge_path), 1.6, WITHIN(0.02)},
    {12, "fall", fall_build, FINGER(&still_path), 0.4, ARRIVES},
    {12, "fly", fly_build, FINGER(&still_path), 0.5, ARRIVES},
    {12, "belt", belt_build, FINGER(&belt_path, .damping = 10.0), 1.2, DRIVEN},
    {12, "motor_arm", arm_build, FINGER(&arm_path, .damping = 5.0), 1.0, DRIVEN},
};

const size_t faults_moving_count = sizeof faults_moving_table / sizeof faults_moving_table[0];
