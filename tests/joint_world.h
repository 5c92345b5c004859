/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_JOINT_WORLD_H
#define HAPODE_TESTS_JOINT_WORLD_H

/* Mechanisms in a contact_world. The hand stays near the first body, so that all of it is in the
 * range, and touches nothing unless a test says so. Include after tap.h. */

#include <math.h>

#include "tests/contact_world.h"

#define BALL 0.03  /* m, radius of the first body's geom */
#define NEAR 0.005 /* m, from there to the hand's */
#define PERIOD 1e-3
#define STEP_TICKS 20 /* of a physics step at 50 Hz */
#define JOINTS_MAX 32
#define CLOSED 1e-4 /* m */

typedef struct mechanism {
  contact_world w;
  dJointID joints[JOINTS_MAX];
  int joint_count;
} mechanism;

typedef void (*build_fn)(mechanism *m);

/* A mechanism that is held against ODE's for a second. */
typedef struct joint_case {
  const char *name;
  build_fn build;
  double gravity;
  double way;  /* m, bounds of mechanisms_compare */
  double turn; /* rad */
} joint_case;

/* Box masses; the first body has a ball as its geom, the others have none. */
static inline dBodyID add_body(mechanism *m, double mass, const double edges[3], double x, double y,
                               double z)
{
  dMass box;
  dMassSetBoxTotal(&box, mass, edges[0], edges[1], edges[2]);
  dGeomID geom = m->w.body_count == 0 ? dCreateSphere(m->w.space, BALL) : NULL;
  return cw_add(&m->w, geom, &box, x, y, z);
}

static const double bar[3] = {0.2, 0.04, 0.02};

static inline dJointID joint_keep(mechanism *m, dJointID joint, dBodyID a, dBodyID b)
{
  dJointAttach(joint, a, b);
  m->joints[m->joint_count++] = joint;
  return joint;
}

static inline dJointID add_ball(mechanism *m, dBodyID a, dBodyID b, double x, double y, double z)
{
  dJointID joint = joint_keep(m, dJointCreateBall(m->w.world, NULL), a, b);
  dJointSetBallAnchor(joint, x, y, z);
  return joint;
}

static inline dJointID add_hinge(mechanism *m, dBodyID a, dBodyID b, const double at[3],
                                 const double axis[3])
{
  dJointID joint = joint_keep(m, dJointCreateHinge(m->w.world, NULL), a, b);
  dJointSetHingeAnchor(joint, at[0], at[1], at[2]);
  dJointSetHingeAxis(joint, axis[0], axis[1], axis[2]);
  return joint;
}

static inline dJointID add_slider(mechanism *m, dBodyID a, dBodyID b, const double axis[3])
{
  dJointID joint = joint_keep(m, dJointCreateSlider(m->w.world, NULL), a, b);
  dJointSetSliderAxis(joint, axis[0], axis[1], axis[2]);
  return joint;
}

/* ---- runs ---- */

static inline void start_mechanism(mechanism *m)
{
  cw_start_following(&m->w, 0.0, 0.0, BALL + m->w.hand_def.radius + NEAR);
}

static inline void mechanism_owned(void *owned)
{
  cw_close(&((mechanism *)owned)->w);
}

/* Closed when the test has ended. */
static inline mechanism *mechanism_new(build_fn build, double gravity)
{
  mechanism *m = tap_own(sizeof *m, mechanism_owned);
  cw_open(&m->w, gravity);
  m->w.def.physics_hz = 1.0 / (STEP_TICKS * PERIOD);
  dWorldSetCFM(m->w.world, 1e-10);
  build(m);
  return m;
}

/* The same, started. */
static inline mechanism *mechanism_running(build_fn build, double gravity)
{
  mechanism *m = mechanism_new(build, gravity);
  start_mechanism(m);
  return m;
}

/* Both anchors of a joint, as ODE has them; false: the joint has none. */
static inline bool anchors_of(dJointID joint, dVector3 a, dVector3 b)
{
  switch (dJointGetType(joint)) {
    case dJointTypeBall:
      dJointGetBallAnchor(joint, a);
      dJointGetBallAnchor2(joint, b);
      return true;
    case dJointTypeHinge:
      dJointGetHingeAnchor(joint, a);
      dJointGetHingeAnchor2(joint, b);
      return true;
    case dJointTypeUniversal:
      dJointGetUniversalAnchor(joint, a);
      dJointGetUniversalAnchor2(joint, b);
      return true;
    default:
      return false;
  }
}

/* m, how far the joints are open at the last sync. */
static inline double mechanism_openness(const mechanism *m)
{
  double widest = 0.0;
  for (int i = 0; i < m->joint_count; ++i) {
    dVector3 a;
    dVector3 b;
    if (m->joints[i] != NULL && anchors_of(m->joints[i], a, b)) {
      widest = fmax(widest, cw_norm((const double[3]){a[0] - b[0], a[1] - b[1], a[2] - b[2]}));
    }
  }
  return widest;
}

static inline double turn_between(dBodyID a, dBodyID b)
{
  const dReal *p = dBodyGetQuaternion(a);
  const dReal *q = dBodyGetQuaternion(b);
  double dot = fabs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]);
  return 2.0 * acos(fmin(dot, 1.0));
}

typedef struct mechanism_difference {
  double way;  /* m, of the centres */
  double turn; /* rad, at the end */
  double open; /* m, of the loop's joints at the syncs */
} mechanism_difference;

/* The loop against ODE's exact solver at the rate of the loop. The last tick of a step is in ODE
 * with the next one. */
static inline mechanism_difference mechanisms_compare(mechanism *loop, mechanism *ode,
                                                      double seconds)
{
  mechanism_difference out = {0.0, 0.0, 0.0};
  int ticks = STEP_TICKS * (int)lround(seconds / (STEP_TICKS * PERIOD));
  for (int t = 1; t <= ticks; ++t) {
    dWorldStep(ode->w.world, PERIOD);
    cw_tick(&loop->w);
    for (int i = 0; i < loop->w.body_count; ++i) {
      const dReal *p = dBodyGetPosition(ode->w.bodies[i]);
      const double *q = loop->w.position[i];
      out.way = fmax(out.way, cw_norm(AT(p[0] - q[0], p[1] - q[1], p[2] - q[2])));
    }
    out.open = t % STEP_TICKS == 0 ? fmax(out.open, mechanism_openness(loop)) : out.open;
  }
  cw_tick(&loop->w); /* with its sync */
  for (int i = 0; i < loop->w.body_count; ++i) {
    out.turn = fmax(out.turn, turn_between(loop->w.bodies[i], ode->w.bodies[i]));
  }
  return out;
}

static inline uint32_t moving_bodies(const mechanism *m)
{
  uint32_t moving = 0;
  for (int i = 0; i < m->w.body_count; ++i) {
    moving += dBodyIsKinematic(m->w.bodies[i]) == 0;
  }
  return moving;
}

/* The loop owns all of it, and nothing is probed. */
static inline void check_owned(const mechanism *m, uint32_t bodies)
{
  hap_stats stats = cw_stats(&m->w);
  CHECK(stats.model.range_bodies == bodies);
  CHECK(stats.model.range_joints == (uint32_t)m->joint_count);
  CHECK(stats.model.measured_bodies == 0 && stats.probes.steps == 0);
  CHECK(stats.faults.fault == 0 && stats.faults.states_rejected == 0);
}

#endif
