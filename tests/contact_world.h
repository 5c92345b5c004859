/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_CONTACT_WORLD_H
#define HAPODE_TESTS_CONTACT_WORLD_H

/* A world with a lockstep session of model CONTACT over it and one hand that a test moves. Every
 * tick is read from the trace: where the traced bodies are, how fast they move, what the hand gave.
 * Public API only. Include after tap.h. */

#include "tests/ode_world.h"

#define CW_BODIES_MAX 128
#define CW_TRACED_MAX HAP_TRACE_BODIES_MAX
#define CW_GRAVITY 9.81

typedef struct contact_world {
  dWorldID world;
  dSpaceID space;
  dBodyID bodies[CW_BODIES_MAX];
  int body_count;
  dSurfaceParameters surface; /* of every pair */
  double direction[3];        /* first friction direction, with dContactFDir1 */

  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  hap_pointer_expert_def hand_expert;
  hap_pointer_research_def hand_research;
  hap_session *session;
  hap_pointer_id hand;

  double hand_at[3];
  double hand_velocity[3];
  struct { /* the hand goes with the first body, offset from it */
    bool on;
    double offset[3];
  } follow;
  struct { /* on the first body, in every step */
    double force[3];
    double torque[3];
  } user;

  hap_trace_row row;                 /* of the newest tick */
  double position[CW_TRACED_MAX][3]; /* after it */
  double velocity[CW_TRACED_MAX][3]; /* of the way made in it */
  double force[3];                   /* on the hand */
  double impulse[3];                 /* N s, the hand's on the bodies, up to now */
  struct {
    uint64_t ticks;
    uint32_t steps;
    double impulse[3];  /* up to the newest sync */
    double momentum[3]; /* of all bodies, in ODE at the newest sync */
    uint32_t range_min; /* bodies in the range, at the syncs so far */
    uint32_t range_max;
    int surface_calls;
  } seen;
} contact_world;

static inline bool cw_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  contact_world *w = user;
  (void)a;
  (void)b;
  ++w->seen.surface_calls;
  *io = w->surface;
  return true;
}

static inline bool cw_direction(void *user, dGeomID a, dGeomID b, double out[3])
{
  contact_world *w = user;
  (void)a;
  (void)b;
  memcpy(out, w->direction, sizeof w->direction);
  return true;
}

static inline void cw_before_step(void *user, double step_s)
{
  contact_world *w = user;
  const double *f = w->user.force;
  const double *t = w->user.torque;
  (void)step_s;
  if (w->body_count > 0 && (f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0)) {
    dBodyAddForce(w->bodies[0], f[0], f[1], f[2]);
  }
  if (w->body_count > 0 && (t[0] != 0.0 || t[1] != 0.0 || t[2] != 0.0)) {
    dBodyAddTorque(w->bodies[0], t[0], t[1], t[2]);
  }
}

/* At a sync ODE holds what the loop had made of its bodies up to then. */
static inline void cw_after_step(void *user, double step_s)
{
  contact_world *w = user;
  (void)step_s;
  memset(w->seen.momentum, 0, sizeof w->seen.momentum);
  for (int i = 0; i < w->body_count; ++i) {
    dMass mass;
    if (w->bodies[i] == NULL || dBodyIsKinematic(w->bodies[i])) {
      continue;
    }
    dBodyGetMass(w->bodies[i], &mass);
    for (int k = 0; k < 3; ++k) {
      w->seen.momentum[k] += mass.mass * dBodyGetLinearVel(w->bodies[i])[k];
    }
  }
  memcpy(w->seen.impulse, w->impulse, sizeof w->impulse);
  ++w->seen.steps;
}

static inline void cw_open(contact_world *w, double gravity)
{
  memset(w, 0, sizeof *w);
  ode_world_make(gravity, &w->world, &w->space);
  ode_world_stiffen(w->world, 100);
  w->surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.5};
  session_defs_init(&w->def, &w->expert, &w->research);
  w->def.drive = HAP_DRIVE_LOCKSTEP;
  w->research.guard = HAP_GUARD_MEASURE; /* what the hand feels is what the bodies get */
  w->def.model = HAP_MODEL_CONTACT;
  w->def.physics_hz = 20.0;
  w->expert.trace_rows = 16;
  hap_ode_def_init(&w->ode, sizeof w->ode);
  w->ode.surface = cw_surface;
  w->ode.friction_direction = cw_direction;
  w->ode.before_step = cw_before_step;
  w->ode.after_step = cw_after_step;
  pointer_defs_init(&w->hand_def, &w->hand_expert, &w->hand_research);
  w->hand_def.stiffness = 2000.0;
  w->hand_def.damping = 20.0;
  w->hand_def.max_force = 1e6;
}

static inline void cw_close(contact_world *w)
{
  ode_world_end(w->session, w->world, w->space);
  memset(w, 0, sizeof *w);
}

static inline void cw_close_owned(void *owned)
{
  cw_close(owned);
}

/* Closed when the test has ended. */
static inline contact_world *cw_new(double gravity)
{
  contact_world *w = tap_own(sizeof *w, cw_close_owned);
  cw_open(w, gravity);
  return w;
}

static inline dBodyID cw_add(contact_world *w, dGeomID geom, const dMass *mass, double x, double y,
                             double z)
{
  return w->bodies[w->body_count++] = ode_body(w->world, geom, mass, AT(x, y, z));
}

static inline dBodyID cw_add_box(contact_world *w, double mass, const double edges[3], double x,
                                 double y, double z)
{
  return w->bodies[w->body_count++] = ode_box(w->world, w->space, mass, edges, AT(x, y, z));
}

static inline dBodyID cw_add_cube(contact_world *w, double mass, double edge, double x, double y,
                                  double z)
{
  return cw_add_box(w, mass, AT(edge, edge, edge), x, y, z);
}

static inline dBodyID cw_add_ball(contact_world *w, double mass, double radius, double x, double y,
                                  double z)
{
  return w->bodies[w->body_count++] = ode_ball(w->world, w->space, mass, radius, AT(x, y, z));
}

static inline dGeomID cw_add_floor(contact_world *w)
{
  return dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
}

static inline void cw_put_hand(contact_world *w, double vx, double vy, double vz)
{
  const double *at = w->hand_at;
  hap_pose pose = {{at[0], at[1], at[2]}, {1.0, 0.0, 0.0, 0.0}};
  hap_twist twist = {{vx, vy, vz}, {0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(w->session, w->hand, &pose, &twist) == HAP_OK);
}

static inline hap_stats cw_stats(const contact_world *w)
{
  return session_stats(w->session);
}

/* Session and hand. The first 16 bodies are traced. */
static inline void cw_make(contact_world *w, double x, double y, double z)
{
  size_t traced = w->body_count < CW_TRACED_MAX ? (size_t)w->body_count : CW_TRACED_MAX;
  w->ode.world = w->world, w->ode.space = w->space, w->ode.user = w;
  w->seen.range_min = UINT32_MAX;
  w->session = session_make(&w->def, &w->ode);
  memcpy(w->hand_at, AT(x, y, z), sizeof w->hand_at);
  for (size_t i = 0; i < traced; ++i) {
    memcpy(w->position[i], dBodyGetPosition(w->bodies[i]), 3 * sizeof(double));
  }
  REQUIRE(hap_session_trace_bodies(w->session, w->bodies, traced) == HAP_OK);
  hap_detail detail = {""};
  bool added = hap_pointer_add(w->session, &w->hand_def, &w->hand) == HAP_OK;
  (void)hap_session_detail(w->session, &detail);
  REQUIRE_SAY(added, "%s", detail.text);
  cw_put_hand(w, 0.0, 0.0, 0.0);
}

static inline void cw_start(contact_world *w, double x, double y, double z)
{
  cw_make(w, x, y, z);
  session_run(w->session);
}

/* As cw_start, with a hand that goes with the first body at this distance from its centre. */
static inline void cw_start_following(contact_world *w, double dx, double dy, double dz)
{
  const dReal *p = dBodyGetPosition(w->bodies[0]);
  w->follow.on = true;
  memcpy(w->follow.offset, AT(dx, dy, dz), sizeof w->follow.offset);
  cw_start(w, p[0] + dx, p[1] + dy, p[2] + dz);
}

static inline void cw_read(contact_world *w)
{
  size_t count = 0;
  double period = 1.0 / w->def.haptic_hz;
  CHECK(hap_session_trace_read(w->session, &w->row, 1, sizeof(hap_trace_row), &count) == HAP_OK &&
        count == 1);
  for (uint32_t i = 0; i < w->row.body_count; ++i) {
    for (int k = 0; k < 3; ++k) {
      w->velocity[i][k] = (w->row.body_position[i][k] - w->position[i][k]) / period;
      w->position[i][k] = w->row.body_position[i][k];
    }
  }
  for (int k = 0; k < 3; ++k) {
    w->force[k] = w->row.pointers[0].force[k];
    w->impulse[k] -= period * w->force[k];
  }
  hap_stats stats = cw_stats(w);
  w->seen.range_min =
      stats.model.range_bodies < w->seen.range_min ? stats.model.range_bodies : w->seen.range_min;
  w->seen.range_max =
      stats.model.range_bodies > w->seen.range_max ? stats.model.range_bodies : w->seen.range_max;
}

/* One tick. */
static inline void cw_tick(contact_world *w)
{
  const double *v = w->hand_velocity;
  double period = 1.0 / w->def.haptic_hz;
  if (w->follow.on) {
    for (int k = 0; k < 3; ++k) {
      w->hand_at[k] = w->position[0][k] + w->follow.offset[k];
    }
    cw_put_hand(w, w->velocity[0][0], w->velocity[0][1], w->velocity[0][2]);
  } else {
    for (int k = 0; k < 3; ++k) {
      w->hand_at[k] += period * v[k];
    }
    cw_put_hand(w, v[0], v[1], v[2]);
  }
  CHECK(hap_session_advance(w->session, 1) == HAP_OK);
  ++w->seen.ticks;
  cw_read(w);
}

static inline void cw_run(contact_world *w, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    cw_tick(w);
  }
}

static inline void cw_move_hand(contact_world *w, double vx, double vy, double vz)
{
  memcpy(w->hand_velocity, AT(vx, vy, vz), sizeof w->hand_velocity);
}

/* Moves the hand at a velocity for some ticks. */
static inline void cw_go(contact_world *w, double vx, double vy, double vz, int ticks)
{
  cw_move_hand(w, vx, vy, vz);
  cw_run(w, ticks);
}

static inline double cw_norm(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

#endif
