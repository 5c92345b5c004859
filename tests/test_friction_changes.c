/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The friction of a pointer as the application says it, and what comes and goes while it sticks. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "tests/contact_world.h"

#define RADIUS 0.01
#define STIFFNESS 2000.0

#define MODELS (sizeof all_models / sizeof all_models[0])

/* What the callback is asked, and says. */
static struct {
  hap_pointer_id pointer;
  dGeomID geom; /* the last one */
  double came_with;
  double says;
  int calls;
  bool keeps; /* says what it came with */
} asked;

static void pointer_surface(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  asked.pointer = pointer;
  asked.geom = geom;
  asked.came_with = io->friction_dynamic;
  ++asked.calls;
  if (!asked.keeps) {
    io->friction_static = io->friction_dynamic = asked.says;
  }
}

static contact_world *open_world(hap_model model)
{
  memset(&asked, 0, sizeof asked);
  contact_world *w = cw_new(CW_GRAVITY);
  w->def.model = model;
  w->def.physics_hz = 100.0;
  w->hand_def.radius = RADIUS;
  w->hand_def.stiffness = STIFFNESS;
  w->hand_def.damping = 0.0;
  w->hand_def.friction = 0.3;
  return w;
}

static void surface_says(contact_world *w, double mu)
{
  asked.says = mu;
  CHECK(hap_session_lock(w->session) == HAP_OK);
  CHECK(hap_session_surface_changed(w->session, dBodyGetFirstGeom(w->bodies[0])) == HAP_OK);
  hap_session_unlock(w->session);
}

/* Pressed 2 mm into a cube of 1000 kg, 4 N, and then pulled by a way along x. */
static void cube_pull(contact_world *w, double way)
{
  w->surface.mu = 0.8;
  cw_add_floor(w);
  cw_add_cube(w, 1000.0, 0.3, 0.0, 0.0, 0.15 - 1e-4);
  cw_start(w, 0.0, 0.0, 0.3 - 1e-4 + RADIUS + 0.001);
  cw_run(w, 30);
  cw_go(w, 0.0, 0.0, -0.06, 50);
  cw_go(w, way / 0.05, 0.0, 0.0, 50);
  cw_go(w, 0.0, 0.0, 0.0, 60);
}

TEST(the_callback_says_the_friction_of_a_geom)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = open_world(all_models[m]);
    w->ode.pointer_surface = pointer_surface;
    asked.says = 0.1;
    cube_pull(w, 0.002);
    CHECK(asked.calls > 0 && asked.came_with == 0.3 && asked.pointer.v == w->hand.v);
    CHECK(asked.geom == dBodyGetFirstGeom(w->bodies[0]));
    CHECK_NEAR(w->force[0], -0.1 * w->force[2], 1e-3 * w->force[2]);
    surface_says(w, 0.5); /* more of it holds what it holds */
    cw_run(w, 60);
    CHECK_NEAR(w->force[0], -0.1 * w->force[2], 1e-3 * w->force[2]);
    surface_says(w, 0.05); /* less of it slides */
    cw_run(w, 60);
    CHECK_NEAR(w->force[0], -0.05 * w->force[2], 1e-3 * w->force[2]);
    surface_says(w, 0.0);
    cw_run(w, 60);
    CHECK_NEAR(w->force[0], 0.0, 1e-6); /* the cube tilts by as little */
    surface_says(w, 0.5);               /* and begins anew */
    cw_run(w, 60);
    CHECK_NEAR(w->force[0], 0.0, 1e-6);
    asked.keeps = true;
    surface_says(w, 0.5);
    cw_go(w, 0.05, 0.0, 0.0, 100);
    CHECK_NEAR(w->force[0], -0.3 * w->force[2], 2e-3 * w->force[2]);
  }
}

TEST(more_than_ten_is_ten)
{
  contact_world *w = open_world(HAP_MODEL_CONTACT);
  w->ode.pointer_surface = pointer_surface;
  asked.says = 1e6;
  cube_pull(w, 0.0);
  cw_go(w, 0.3, 0.0, 0.0, 120);
  CHECK_NEAR(w->force[0], -10.0 * w->force[2], 1e-2 * w->force[2]);
}

/* Advancing then says that there is a fault. */
static void run_faulty(contact_world *w, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    (void)hap_session_advance(w->session, 1);
    cw_read(w);
  }
}

TEST(a_friction_that_is_none_is_a_fault_with_a_text)
{
  static const double wrong[] = {-0.1, (double)NAN, (double)INFINITY};
  for (int i = 0; i < 3; ++i) {
    hap_detail detail = {""};
    contact_world *w = open_world(HAP_MODEL_CONTACT);
    w->ode.pointer_surface = pointer_surface;
    asked.says = 0.2;
    cube_pull(w, 0.002);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE && w->force[0] < -0.5);
    surface_says(w, wrong[i]);
    run_faulty(w, 20);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_WORLD);
    CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
    CHECK(strstr(detail.text, "pointer_surface") != NULL);
    run_faulty(w, 200);
    CHECK(cw_norm(w->force) == 0.0);
    asked.says = 0.2; /* no call: after an answer that was none it is asked anyway */
    run_faulty(w, 20);
    CHECK(hap_session_reset_fault(w->session) == HAP_OK);
    cw_run(w, 100);
    CHECK_NEAR(w->force[2], 4.0, 0.05); /* the depth comes in again, and no old pull with it */
    CHECK_NEAR(w->force[0], 0.0, 1e-6);
  }
}

/* ---- what comes and goes ---- */

TEST(a_pointer_that_is_removed_lets_go)
{
  for (size_t m = 0; m < MODELS; ++m) {
    hap_pointer_id other;
    hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    contact_world *w = open_world(all_models[m]);
    cube_pull(w, 0.0004);
    CHECK_NEAR(w->force[0], -0.8, 1e-2);
    memcpy(pose.position, w->hand_at, sizeof pose.position);
    CHECK(hap_pointer_remove(w->session, w->hand) == HAP_OK);
    CHECK(hap_pointer_add(w->session, &w->hand_def, &other) == HAP_OK);
    CHECK(hap_pointer_set_target(w->session, other, &pose, NULL) == HAP_OK);
    w->hand = other;
    cw_run(w, 100); /* it comes in where the other was, and pulls at nothing */
    CHECK_NEAR(w->force[0], 0.0, 1e-6);
    CHECK(w->force[2] > 3.9);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

TEST(a_body_that_is_destroyed_lets_go)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = open_world(all_models[m]);
    cube_pull(w, 0.0004);
    CHECK(hap_session_lock(w->session) == HAP_OK);
    dGeomID geom = dBodyGetFirstGeom(w->bodies[0]);
    CHECK(hap_session_forget_geom(w->session, geom) == HAP_OK);
    CHECK(hap_session_forget_body(w->session, w->bodies[0]) == HAP_OK);
    dGeomDestroy(geom);
    dBodyDestroy(w->bodies[0]);
    w->body_count = 0;
    hap_session_unlock(w->session);
    cw_run(w, 60);
    CHECK(cw_norm(w->force) == 0.0);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

/* The application puts the body a millimetre aside: that is no motion that the hand would feel. */
TEST(a_body_that_is_put_elsewhere_keeps_the_pull)
{
  contact_world *w = open_world(HAP_MODEL_CONTACT);
  cube_pull(w, 0.0004);
  double before = w->force[0];
  CHECK(hap_session_lock(w->session) == HAP_OK);
  const dReal *at = dBodyGetPosition(w->bodies[0]);
  dBodySetPosition(w->bodies[0], at[0] + 0.0003, at[1], at[2]);
  hap_session_unlock(w->session);
  cw_run(w, 100);
  CHECK_NEAR(w->force[0], before, 2e-3);
  CHECK_NEAR(before, -0.8, 2e-3);
}

TEST(a_change_of_model_keeps_the_pull)
{
  contact_world *w = open_world(HAP_MODEL_CONTACT);
  cube_pull(w, 0.0004);
  for (size_t m = 0; m < MODELS; ++m) {
    CHECK(hap_session_set_model(w->session, all_models[m]) == HAP_OK);
    cw_run(w, 100);
    CHECK_NEAR(w->force[0], -0.8, 5e-3);
  }
}

TEST(a_conveyor_takes_the_hand_along)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = open_world(all_models[m]);
    cw_add_cube(w, 1.0, 0.3, 0.0, 0.0, 0.15);
    dBodySetKinematic(w->bodies[0]);
    cw_start(w, 0.0, 0.0, 0.3 + RADIUS + 0.001);
    cw_run(w, 30);
    cw_go(w, 0.0, 0.0, -0.06, 50);
    cw_move_hand(w, 0.0, 0.0, 0.0);
    CHECK(hap_session_lock(w->session) == HAP_OK);
    dBodySetLinearVel(w->bodies[0], 0.0, 0.05, 0.0);
    hap_session_unlock(w->session);
    cw_run(w, 200);
    CHECK_NEAR(w->force[2], 4.0, 1e-2);
    CHECK_NEAR(w->force[1], 0.3 * w->force[2], 2e-3 * w->force[2]);
  }
}
