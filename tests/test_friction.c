/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Friction of the pointer against closed forms: sticking, sliding in every direction, what it
 * drags, what a soft finger holds. In every model, direct and behind a proxy. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "tests/contact_world.h"

#define RADIUS 0.01
#define MU 0.5

#define MODELS (sizeof all_models / sizeof all_models[0])

static contact_world *open_world(hap_model model, double gravity)
{
  contact_world *w = cw_new(gravity);
  w->def.model = model;
  w->def.physics_hz = 60.0;
  w->hand_def.radius = RADIUS;
  w->hand_def.stiffness = 2000.0;
  w->hand_def.damping = 0.0;
  w->hand_def.friction = MU;
  w->hand_def.max_torque = 1e6;
  return w;
}

/* Over the floor, then pressed into it by depth. A body that nobody touches makes it a world. */
static void press_floor(contact_world *w, double depth)
{
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 0.05);
  cw_start(w, 0.0, 0.0, RADIUS + 0.001);
  cw_run(w, 20);
  cw_go(w, 0.0, 0.0, -(0.001 + depth) / 0.05, 50);
  cw_go(w, 0.0, 0.0, 0.0, 40);
}

/* ---- against a wall ---- */

TEST(sticking_is_a_spring_of_the_contacts_stiffness)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = open_world(all_models[m], CW_GRAVITY);
    press_floor(w, 0.002);
    CHECK_NEAR(w->force[2], 4.0, 4e-3);
    CHECK_NEAR(w->force[0], 0.0, 1e-9);
    for (int i = 1; i <= 4; ++i) {
      cw_go(w, 0.2, -0.1, 0.0, 1);
      cw_go(w, 0.0, 0.0, 0.0, 1);
      CHECK_NEAR(w->force[0], -2000.0 * 2e-4 * i, 1e-3 * 2000.0 * 2e-4 * i);
      CHECK_NEAR(w->force[1], 2000.0 * 1e-4 * i, 1e-3 * 2000.0 * 1e-4 * i);
    }
    for (int i = 0; i < 500; ++i) {
      cw_tick(w);
    }
    CHECK_NEAR(w->force[0], -1.6, 1.6e-3); /* and stays */
    cw_close(w);
  }
}

TEST(sliding_is_coulombs_in_every_direction)
{
  for (size_t m = 0; m < MODELS; ++m) {
    for (int i = 0; i < 24; ++i) {
      double angle = 2.0 * M_PI * (i + 0.3) / 24.0;
      contact_world *w = open_world(all_models[m], CW_GRAVITY);
      press_floor(w, 0.002);
      cw_go(w, 0.05 * cos(angle), 0.05 * sin(angle), 0.0, 100);
      CHECK_NEAR(w->force[0], -MU * w->force[2] * cos(angle), 1e-3 * MU * w->force[2]);
      CHECK_NEAR(w->force[1], -MU * w->force[2] * sin(angle), 1e-3 * MU * w->force[2]);
      CHECK_NEAR(w->force[2], 4.0, 1e-6);
      cw_close(w);
    }
  }
}

/* ---- on bodies of the loop ---- */

typedef struct way {
  hap_coupling coupling;
  hap_integration integration;
} way;

static const way ways[] = {
    {HAP_COUPLING_DIRECT, HAP_INTEGRATION_AUTO},
    {HAP_COUPLING_DIRECT, HAP_INTEGRATION_EXPLICIT},
    {HAP_COUPLING_DIRECT, HAP_INTEGRATION_IMPLICIT},
    {HAP_COUPLING_DIRECT, HAP_INTEGRATION_MIDPOINT},
    {HAP_COUPLING_PROXY, HAP_INTEGRATION_AUTO},
};
#define WAYS (sizeof ways / sizeof ways[0])

static void take_way(contact_world *w, const way *how)
{
  w->hand_expert.coupling = how->coupling;
  w->hand_research.integration = how->integration;
  w->hand_expert.coupling_stiffness = how->coupling == HAP_COUPLING_PROXY ? 1e6 : 0.0;
}

/* Onto the middle of a cube that stands on the floor, which has a friction of its own. */
static void press_cube(contact_world *w, double mass, double edge, double floor_mu, double depth)
{
  w->surface.mu = floor_mu;
  cw_add_floor(w);
  cw_add_cube(w, mass, edge, 0.0, 0.0, edge / 2 - 1e-4);
  cw_start(w, 0.0, 0.0, edge - 1e-4 + RADIUS + 0.001);
  cw_run(w, 20);
  cw_go(w, 0.0, 0.0, -(0.001 + depth) / 0.05, 50);
  cw_go(w, 0.0, 0.0, 0.0, 100);
}

TEST(a_heavy_body_is_held_and_slid_on_as_a_wall)
{
  for (size_t i = 0; i < WAYS; ++i) {
    contact_world *w = open_world(HAP_MODEL_CONTACT, CW_GRAVITY);
    take_way(w, &ways[i]);
    press_cube(w, 1000.0, 0.3, 0.8, 0.002);
    double stiffness = ways[i].coupling == HAP_COUPLING_PROXY ? 2000.0 / 1.002 : 2000.0;
    double normal = 0.002 * stiffness;
    CHECK_NEAR(w->force[2], normal, 1e-3 * normal);
    cw_go(w, 0.02, -0.015, 0.0, 20);
    cw_go(w, 0.0, 0.0, 0.0, 50);
    CHECK_NEAR(w->force[0], -stiffness * 4e-4, 1e-3 * stiffness * 4e-4);
    CHECK_NEAR(w->force[1], stiffness * 3e-4, 1e-3 * stiffness * 3e-4);
    for (int k = 0; k < 12; ++k) {
      double angle = 2.0 * M_PI * (k + 0.3) / 12.0;
      cw_go(w, 0.05 * cos(angle), 0.05 * sin(angle), 0.0, 250); /* the spring turns round */
      CHECK_NEAR(w->force[0], -MU * w->force[2] * cos(angle), 2e-3 * MU * w->force[2]);
      CHECK_NEAR(w->force[1], -MU * w->force[2] * sin(angle), 2e-3 * MU * w->force[2]);
      CHECK_NEAR(hypot(w->force[0], w->force[1]), MU * w->force[2], 1e-6 * w->force[2]);
      cw_go(w, -0.05 * cos(angle), -0.05 * sin(angle), 0.0, 250);
    }
    cw_close(w);
  }
}

/* A body that gives way: acceleration by the sliding hand, whatever the direction. */
TEST(sliding_pulls_a_free_body_along)
{
  for (size_t i = 0; i < WAYS; ++i) {
    for (int k = 0; k < 8; ++k) {
      double angle = 2.0 * M_PI * (k + 0.3) / 8.0;
      contact_world *w = open_world(HAP_MODEL_CONTACT, CW_GRAVITY);
      take_way(w, &ways[i]);
      press_cube(w, 1.0, 0.3, 0.0, 0.002);
      cw_go(w, 1.0 * cos(angle), 1.0 * sin(angle), 0.0, 20);
      double before[2] = {w->velocity[0][0], w->velocity[0][1]};
      double force = 0.0;
      for (int j = 0; j < 80; ++j) {
        cw_tick(w);
        force += w->force[2] / 80.0;
      }
      double gain = MU * force * 0.08 / 1.0;
      CHECK_NEAR(w->velocity[0][0] - before[0], gain * cos(angle), 2e-3 * gain);
      CHECK_NEAR(w->velocity[0][1] - before[1], gain * sin(angle), 2e-3 * gain);
      cw_close(w);
    }
  }
}

TEST(sticking_drags_a_block_over_the_floor)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double mass = 0.5;
    if (all_models[m] == HAP_MODEL_IMPULSE || all_models[m] == HAP_MODEL_ACCELERANCE) {
      continue; /* as far as they go: see test_grasp */
    }
    contact_world *w = open_world(all_models[m], CW_GRAVITY);
    w->hand_def.damping = 20.0;
    w->hand_def.friction = 0.9;
    press_cube(w, mass, 0.1, 0.1, 0.003);
    cw_go(w, 0.05, 0.0, 0.0, 400);
    double at = w->position[0][0] - w->hand_at[0];
    cw_run(w, 400);
    double needed = 0.1 * (mass * CW_GRAVITY + w->force[2]);
    CHECK_NEAR(w->position[0][0] - w->hand_at[0], at, 1e-6);
    CHECK_NEAR(w->force[0], -needed, 2e-3 * needed);
    CHECK_NEAR(w->force[2], 6.0, 0.05);
    cw_close(w);
  }
}

/* ---- soft fingers ---- */

#define FINGER 0.006

typedef struct pinch {
  contact_world *w;
  hap_pointer_id other; /* at the other side of the box */
  double depth;         /* m, of each */
} pinch;

static void put_other(pinch *p)
{
  const hap_pose pose = {{0.1 + RADIUS - p->depth, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(p->w->session, p->other, &pose, NULL) == HAP_OK);
}

/* A box that floats, between two fingers along x. */
static void open_pinch(pinch *p, hap_model model, double damping)
{
  p->w = open_world(model, 0.0);
  p->depth = 0.002;
  p->w->hand_def.damping = damping;
  p->w->hand_def.finger_radius = FINGER;
  p->w->hand_def.max_torque = 1e3;
  cw_add_cube(p->w, 0.2, 0.2, 0.0, 0.0, 0.0);
  p->w->ode.max_contacts_per_pair = 4;
  cw_start(p->w, -0.1 - RADIUS - 0.001, 0.0, 0.0);
  REQUIRE(hap_pointer_add(p->w->session, &p->w->hand_def, &p->other) == HAP_OK);
  double depth = p->depth;
  for (int i = 0; i <= 50; ++i) {
    p->depth = -0.001 + (0.001 + depth) * i / 50.0;
    p->w->hand_at[0] = -0.1 - RADIUS + p->depth;
    put_other(p);
    cw_tick(p->w);
  }
  p->depth = depth;
  cw_run(p->w, 200);
}

static double other_torque(const pinch *p)
{
  return p->w->row.pointers[1].torque[0];
}

static double spin_about_x(const pinch *p)
{
  return dBodyGetAngularVel(p->w->bodies[0])[0];
}

/* Radians that the box has turned about x. */
static double turn_about_x(const pinch *p)
{
  const dReal *q = dBodyGetQuaternion(p->w->bodies[0]);
  return 2.0 * asin(q[1]);
}

TEST(soft_fingers_are_a_torsion_spring_of_k_r2)
{
  for (size_t m = 0; m < MODELS; ++m) {
    pinch p;
    if (all_models[m] == HAP_MODEL_IMPULSE) {
      continue; /* its poses are a step late: it shakes */
    }
    open_pinch(&p, all_models[m], 120.0);
    double torque = 0.01; /* of 0.024 that they hold */
    p.w->user.torque[0] = torque;
    cw_run(p.w, 3000);
    double angle = torque / (2.0 * 2000.0 * FINGER * FINGER);
    CHECK_NEAR(turn_about_x(&p), angle, 1e-3 * angle);
    CHECK_NEAR(p.w->row.pointers[0].torque[0], 0.5 * torque, 1e-3 * torque);
    CHECK_NEAR(other_torque(&p), 0.5 * torque, 1e-3 * torque);
    CHECK_NEAR(cw_norm(p.w->force), 4.0, 1e-2);
    p.w->user.torque[0] = 0.0;
    cw_run(p.w, 3000);
    CHECK_NEAR(turn_about_x(&p), 0.0, 1e-3 * angle); /* and back: nothing has slid */
    cw_close(p.w);
  }
}

TEST(beyond_their_limit_soft_fingers_slip_and_brake)
{
  for (size_t m = 0; m < MODELS; ++m) {
    pinch p;
    if (all_models[m] == HAP_MODEL_IMPULSE) {
      continue;
    }
    open_pinch(&p, all_models[m], 5.0);
    double torque = 0.1;
    double limit = 2.0 * MU * 4.0 * FINGER;
    double inertia = 0.2 * 0.2 * 0.2 / 6.0;
    p.w->user.torque[0] = torque;
    cw_run(p.w, 200);
    double before = spin_about_x(&p);
    cw_run(p.w, 200);
    double gain = (torque - limit) / inertia * 0.2;
    CHECK_NEAR(spin_about_x(&p) - before, gain, 5e-3 * gain);
    CHECK_NEAR(other_torque(&p), 0.5 * limit, 2e-3 * limit);
    cw_close(p.w);
  }
}

/* Sliding and turning share the limit: (f / mu n)^2 + (m / mu n r)^2 = 1. */
TEST(turning_and_sliding_share_one_limit)
{
  for (size_t m = 0; m < MODELS; ++m) {
    hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    hap_twist twist = {{0.05, 0.0, 0.0}, {0.0, 0.0, 4.0}};
    contact_world *w = open_world(all_models[m], CW_GRAVITY);
    w->hand_def.finger_radius = FINGER;
    press_floor(w, 0.002);
    for (int i = 1; i <= 400; ++i) {
      double angle = 4.0 * 1e-3 * i;
      memcpy(pose.position, w->hand_at, sizeof pose.position);
      pose.position[0] += 0.05 * 1e-3 * i;
      pose.quat_wxyz[0] = cos(0.5 * angle);
      pose.quat_wxyz[3] = sin(0.5 * angle);
      CHECK(hap_pointer_set_target(w->session, w->hand, &pose, &twist) == HAP_OK);
      CHECK(hap_session_advance(w->session, 1) == HAP_OK);
      cw_read(w);
    }
    double limit = MU * w->force[2];
    double slide = w->force[0] / limit;
    double turn = w->row.pointers[0].torque[2] / (limit * FINGER);
    CHECK_NEAR(slide * slide + turn * turn, 1.0, 1e-3);
    CHECK_NEAR(turn / slide, FINGER * 4.0 / 0.05, 5e-3); /* along the motion */
    CHECK(slide < -0.5 && turn < -0.2);
    cw_close(w);
  }
}
