/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* An application that makes contact joints of its own, as ODE's manual shows it: the hand feels the
 * bodies, nothing goes through the floor, and it is said once that they are measured. */

#include "tests/tap.h"

#include <stdatomic.h>

#include <hapode/hooks.h>

#include "tests/contact_world.h"

static dJointGroupID group;
static atomic_int said;

static bool no_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  (void)io;
  return false;
}

static void near_callback(void *data, dGeomID a, dGeomID b)
{
  contact_world *w = data;
  dContact contacts[8];
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.5};
    dJointID joint = dJointCreateContact(w->world, group, &contacts[i]);
    dJointAttach(joint, dGeomGetBody(a), dGeomGetBody(b));
  }
}

static void collide_before_step(void *user, double step_s)
{
  contact_world *w = user;
  (void)step_s;
  dJointGroupEmpty(group);
  dSpaceCollide(w->space, w, near_callback);
}

static void count_lines(hap_log_level level, const char *text, void *user)
{
  (void)user;
  if (level >= HAP_LOG_WARNING && strstr(text, "contact joints of its own") != NULL) {
    atomic_fetch_add(&said, 1);
  }
}

/* Before the first step nobody has seen the joints. */
TEST(a_body_near_the_hand_does_not_fall_in_the_first_step)
{
  group = dJointGroupCreate(0);
  contact_world *w = cw_new(CW_GRAVITY);
  dWorldSetContactSurfaceLayer(w->world, 1e-4);
  w->def.physics_hz = 20.0;
  w->ode.surface = no_surface;
  w->ode.before_step = collide_before_step;
  w->hand_def.radius = 0.005;
  (void)cw_add_floor(w);
  dBodyID box = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.05 - 1e-4);
  cw_start(w, 0.0, 0.0, 0.1 + 0.005 + 0.001);
  for (int i = 0; i < 200; ++i) {
    cw_tick(w);
    CHECK_NEAR(dBodyGetPosition(box)[2], 0.05 - 1e-4, 1e-5);
  }
  dJointGroupEmpty(group);
}

TEST(a_body_on_contact_joints_of_the_application_is_felt)
{
  contact_world w;
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = count_lines;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  group = dJointGroupCreate(0);
  cw_open(&w, CW_GRAVITY);
  w.def.physics_hz = 60.0;
  w.ode.surface = no_surface;
  w.ode.before_step = collide_before_step;
  w.hand_def.radius = 0.005;
  w.hand_def.stiffness = 1000.0;
  w.hand_def.damping = 0.0;
  w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  (void)cw_add_floor(&w);
  dBodyID box = cw_add_cube(&w, 0.5, 0.1, 0.0, 0.0, 0.05);
  cw_start(&w, 0.0, 0.0, 0.1 + 0.005 + 0.02);
  cw_move_hand(&w, 0.0, 0.0, -0.024 / 0.5); /* 4 mm deep */
  cw_run(&w, 500);
  cw_move_hand(&w, 0.0, 0.0, 0.0);
  cw_run(&w, 1000);
  CHECK_NEAR(w.force[2], 4.0, 0.05 * 4.0);
  CHECK(dBodyGetPosition(box)[2] > 0.049);
  CHECK(atomic_load(&said) == 1);
  dJointGroupDestroy(group);
  cw_close(&w);
  CHECK(hap_hooks_set(NULL) == HAP_OK);
}
