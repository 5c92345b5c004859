/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The pure tick on local models made by hand. Equation numbers are those of the paper. */

#include "tests/tap.h"

#include <sys/resource.h>

#include <hapode/hapode.h>

#include "haptic/haptic.h"
#include "local/contact_ramp.h"
#include "session/session_internal.h"
#include "tests/tick_world.h"

/* ---- eq. 7 ---- */

TEST(force_is_spring_on_depth)
{
  hapi_pointer *p = pointer_before_wall();
  for (int mm10 = -200; mm10 <= 200; ++mm10) {
    double depth = 1e-4 * mm10;
    p->device.pose.position[0] = -0.01 + depth;
    ticks_run(1);
    check_v3(p->device.wrench.force, depth > 0.0 ? -1000.0 * depth : 0.0, 0.0, 0.0, 1e-11);
    CHECK(p->contacts == (depth > 0.0 ? 1u : 0u));
  }
}

TEST(damper_acts_only_in_contact_and_never_pulls)
{
  hapi_pointer *p = pointer_before_wall();
  p->surface.damping = 20.0;
  p->device.twist.linear[0] = 0.1; /* closing, 2 N */
  p->device.pose.position[0] = -0.0101;
  ticks_run(1);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0); /* apart, however fast it comes */
  p->device.pose.position[0] = -0.009;
  ticks_run(1);
  check_v3(p->device.wrench.force, -3.0, 0.0, 0.0, 1e-12);
  p->device.twist.linear[0] = -0.02;
  ticks_run(1);
  check_v3(p->device.wrench.force, -0.6, 0.0, 0.0, 1e-12);
  p->device.twist.linear[0] = -0.5; /* opening: 1 N - 10 N would pull */
  ticks_run(1);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
  CHECK(p->contacts == 0);
  p->device.twist.linear[0] = 0.0;
  p->device.twist.linear[1] = 5.0; /* along the plane: no force */
  ticks_run(1);
  check_v3(p->device.wrench.force, -1.0, 0.0, 0.0, 1e-12);
}

TEST(damper_takes_the_speed_of_the_surface)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -0.02, 0.0, 0.0);
  p->surface.damping = 10.0;
  begin_model();
  hapi_model_body *body = add_body(2);
  body->flags = HAPI_BODY_DRIVEN;
  hapi_v3_set(body->twist.linear, 0.3, 0.0, 0.0);
  hapi_v3_set(body->twist.angular, 0.0, 0.0, 2.0);
  hapi_v3_set(add_contact(0, 2, 0)->point_body, 0.0, 0.05, 0.0);
  model_adopt();
  ticks_run(1);
  /* The point moves at 0.3 - 2 x 0.05 = 0.2 m/s; put the pointer there, 1 mm deep. */
  f.bodies[2].pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hapi_v3_set(p->device.pose.position, -0.009, 0.05, 0.0);
  p->device.twist.linear[0] = 0.25;
  ticks_run(1);
  check_v3(p->device.wrench.force, -(1.0 + 10.0 * 0.05), 0.0, 0.0, 1e-11);
}

TEST(a_static_contact_takes_no_impulse)
{
  hapi_pointer *p = pointer_before_wall();
  p->device.pose.position[0] = 0.0;
  ticks_run(100);
  check_v3(p->device.wrench.force, -10.0, 0.0, 0.0, 1e-11);
  CHECK(f.tick.touches.contact_ticks == 100);
  CHECK_NEAR(f.tick.touches.hand_impulse_abs, 0.0, 0.0); /* the audit is about dynamic bodies */
  CHECK_NEAR(f.tick.guard.peak_force, 10.0, 1e-11);
  hapi_state *state = tick_report();
  check_v3(hapi_state_contacts(state)[0].force, 10.0, 0.0, 0.0, 1e-11);
  CHECK(state->body_high == 0);
}

/* ---- eq. 8 to 11 ---- */

/* A body of 2 kg at rest, 3 mm deep at a point off its centre. */
static hapi_model_body *body_under_pointer(double depth)
{
  set_up();
  (void)add_pointer(0, -1.0, 0.01, 0.0);
  begin_model();
  hapi_model_body *body = add_body(3);
  hapi_model_contact *c = add_contact(1, 3, 0);
  hapi_v3_set(c->point_body, -0.025, 0.01, 0.0);
  set_free(c, 2.0, 0.02);
  model_adopt();
  ticks_run(1); /* seen apart */
  f.pointers[0].device.pose.position[0] = -0.025 - 0.01 + depth;
  return body;
}

TEST(one_step_of_eq_8_and_9_to_the_last_digit)
{
  body_under_pointer(0.003);
  static const double b[6] = {0.5, -9.81, 0.25, 1.0, -2.0, 3.0};
  memcpy(f.bodies[3].linear.b, b, sizeof b);
  ticks_run(1);
  const hapi_local_body *body = &f.bodies[3];
  const double w[3] = {1.0 * T, -2.0 * T, (3.0 - 0.03 / 0.02) * T}; /* r x F = (0, 0, -0.03) */
  check_v3(f.pointers[0].device.wrench.force, -3.0, 0.0, 0.0, 1e-12);
  check_v3(body->twist.linear, (3.0 / 2.0 + 0.5) * T, -9.81 * T, 0.25 * T, 1e-16);
  check_v3(body->twist.angular, w[0], w[1], w[2], 1e-16);
  /* eq. 10 and 11 with the new velocity, from the identity */
  check_v3(body->pose.position, 2.0 * T * T, -9.81 * T * T, 0.25 * T * T, 1e-18);
  double q[4] = {1.0, 0.5 * T * w[0], 0.5 * T * w[1], 0.5 * T * w[2]};
  hapi_quat_normalize(q);
  for (int i = 0; i < 4; ++i) {
    CHECK_NEAR(body->pose.quat_wxyz[i], q[i], 1e-16);
  }
}

/* Planes are carried by the body: a quarter turn about z takes the normal from -x to -y. */
TEST(contact_turns_with_the_body)
{
  set_up();
  hapi_pointer *p = add_pointer(0, 5.0, 1.0, 0.0);
  begin_model();
  hapi_model_body *body = add_body(0);
  hapi_v3_set(body->pose.position, 5.0, 2.0, 0.0);
  const double half = sqrt(0.5);
  const double quarter[4] = {half, 0.0, 0.0, half};
  memcpy(body->pose.quat_wxyz, quarter, sizeof quarter);
  hapi_v3_set(add_contact(0, 0, 0)->point_body, -0.5, 0.0, 0.0);
  model_adopt();
  ticks_run(1);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
  p->device.pose.position[1] = 1.5 - 0.01 + 0.002;
  ticks_run(1);
  check_v3(p->device.wrench.force, 0.0, -2.0, 0.0, 1e-11);
  check_v3(f.bodies[0].account.impulse, 0.0, 2.0 * T, 0.0, 1e-14);
  /* moment of (0, 2, 0) at the arm (0, -0.5, 0) */
  check_v3(f.bodies[0].account.angular_impulse, 0.0, 0.0, 0.0, 1e-14);
  p->device.pose.position[0] += 0.1;
  ticks_run(1);
  check_v3(f.bodies[0].account.angular_impulse, 0.0, 0.0, 0.0,
           1e-14); /* at the contact point still */
}

TEST(quaternion_stays_unit_over_a_million_ticks)
{
  enum {
    TICKS = 1000000
  };
  set_up();
  begin_model();
  hap_twist *twist = &add_body(0)->twist;
  hapi_v3_set(twist->angular, 6.0, 0.0, 8.0); /* 10 rad/s */
  model_adopt();
  double worst = 0.0;
  for (int i = 0; i < TICKS; ++i) {
    ticks_run(1);
    const double *q = f.bodies[0].pose.quat_wxyz;
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    worst = fmax(worst, fabs(norm - 1.0));
  }
  CHECK(worst < 1e-12);
  /* Eq. 11 and a division by the norm turn by 2 atan(w T / 2) a tick. */
  double half = fmod(TICKS * atan(0.5 * 10.0 * T), 2.0 * acos(-1.0));
  const double *q = f.bodies[0].pose.quat_wxyz;
  CHECK_NEAR(q[0], cos(half), 1e-8);
  check_v3(q + 1, 0.6 * sin(half), 0.0, 0.8 * sin(half), 1e-8);
}

TEST(free_fall_is_symplectic_euler)
{
  set_up();
  begin_model();
  add_body(0)->b[2] = -9.81;
  model_adopt();
  ticks_run(1000);
  CHECK_NEAR(f.bodies[0].twist.linear[2], -9.81, 1e-12);
  CHECK_NEAR(f.bodies[0].pose.position[2], -9.81 * T * T * 1000.0 * 1001.0 / 2.0, 1e-11);
  CHECK(f.tick.facts.tick == 1000);
}

/* ---- several ---- */

TEST(several_pointers_on_one_body_add_up)
{
  set_up();
  begin_model();
  (void)add_body(1);
  for (uint32_t i = 0; i < 3; ++i) {
    (void)add_pointer(i, -1.0, 0.02 * i, 0.0);
    hapi_model_contact *c = add_contact(i, 1, i);
    hapi_v3_set(c->point_body, 0.0, 0.02 * i, 0.0);
    set_free(c, 1.5, 0.01);
  }
  model_adopt();
  ticks_run(1);
  for (uint32_t i = 0; i < 3; ++i) {
    f.pointers[i].device.pose.position[0] = -0.01 + 0.001 * (i + 1); /* 1, 2, 3 N */
  }
  ticks_run(1);
  for (uint32_t i = 0; i < 3; ++i) {
    check_v3(f.pointers[i].device.wrench.force, -1.0 * (i + 1), 0.0, 0.0, 1e-12);
    CHECK(f.pointers[i].contacts == 1);
  }
  check_v3(f.bodies[1].twist.linear, 6.0 / 1.5 * T, 0.0, 0.0, 1e-15);
  /* -(0.02 x 2 + 0.04 x 3) N m about z */
  check_v3(f.bodies[1].twist.angular, 0.0, 0.0, -0.16 / 0.01 * T, 1e-14);
  check_v3(f.bodies[1].account.impulse, 6.0 * T, 0.0, 0.0, 1e-15);
  check_v3(f.bodies[1].account.angular_impulse, 0.0, 0.0, -0.16 * T, 1e-15);
  check_v3(f.tick.touches.hand_impulse, 6.0 * T, 0.0, 0.0, 1e-15);
  CHECK_NEAR(f.tick.touches.hand_impulse_abs, 6.0 * T, 1e-15);
  CHECK(f.tick.touches.contact_ticks == 1 && f.tick.touches.pushing == 3);
}

TEST(one_pointer_between_several_bodies)
{
  set_up();
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 1.0);
  begin_model();
  for (uint32_t i = 0; i < BODIES; ++i) {
    (void)add_body(i);
    hapi_model_contact *c = add_contact(i, i, 0);
    double angle = acos(-1.0) / 4.0 * i;
    hapi_v3_set(c->normal_body, cos(angle), sin(angle), 0.0);
    hapi_v3_scale(-0.008, c->normal_body, c->point_body); /* each 2 mm deep at z = 0 */
    set_free(c, 1.0 + i, 1.0);
  }
  model_adopt();
  f.tick.touches.of[0].point_body[2] = 0.0;
  p->device.pose.position[0] = 1.0; /* far from half of them only: come back through the ramp */
  ticks_run(1);
  hapi_v3_set(p->device.pose.position, 0.0, 0.0, 0.0);
  ticks_run(30);
  /* Let go, then all around at once: forces cancel on the hand, each body gets its own. */
  for (uint32_t i = 0; i < BODIES; ++i) {
    f.bodies[i].pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    memset(&f.bodies[i].twist, 0, sizeof f.bodies[i].twist);
  }
  ticks_run(1);
  CHECK(p->contacts == BODIES);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 1e-12);
  for (uint32_t i = 0; i < BODIES; ++i) {
    CHECK_NEAR(hapi_v3_norm(f.bodies[i].twist.linear), 2.0 * T / (1.0 + i), 1e-14);
  }
}

TEST(a_driven_body_pushes_and_is_not_pushed)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -0.1, 0.0, 0.0);
  begin_model();
  hapi_model_body *body = add_body(0);
  body->flags = HAPI_BODY_DRIVEN;
  body->twist.linear[0] = -0.5;
  body->b[0] = 100.0; /* must not matter */
  set_free(add_contact(0, 0, 0), 1e-3, 1e-6);
  model_adopt();
  ticks_run(180);
  check_v3(f.bodies[0].pose.position, -0.09, 0.0, 0.0, 1e-12);
  ticks_run(10);
  check_v3(p->device.wrench.force, -1000.0 * 0.0045, 0.0, 0.0,
           1e-9); /* places of the tick before */
  check_v3(f.bodies[0].twist.linear, -0.5, 0.0, 0.0, 0.0);
  check_v3(f.bodies[0].account.impulse, 0.0, 0.0, 0.0, 0.0);
  CHECK_NEAR(f.tick.touches.hand_impulse_abs, 0.0, 0.0);
}

/* ---- sleep, FOLLOWS, residual ---- */

TEST(a_resting_body_moves_only_after_a_push)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -0.1, 0.0, 0.0);
  begin_model();
  hapi_model_body *body = add_body(0);
  body->flags = HAPI_BODY_RESTING;
  body->b[2] = -1.0; /* what a testing simulation of a waking body may see */
  set_free(add_contact(0, 0, 0), 1.0, 1.0);
  model_adopt();
  ticks_run(50);
  check_v3(f.bodies[0].pose.position, 0.0, 0.0, 0.0, 0.0);
  check_v3(f.bodies[0].twist.linear, 0.0, 0.0, 0.0, 0.0);
  CHECK((hapi_state_bodies(tick_report())[0].flags & HAPI_BODY_RESTING) != 0);
  p->device.pose.position[0] = -0.009;
  ticks_run(1);
  check_v3(f.bodies[0].twist.linear, T, 0.0, -T, 1e-15);
  CHECK((hapi_state_bodies(tick_report())[0].flags & HAPI_BODY_RESTING) == 0);
  p->device.pose.position[0] = -0.1;
  begin_model(); /* physics still thinks that it rests: the loop knows better */
  body = add_body(0);
  body->flags = HAPI_BODY_RESTING;
  model_adopt();
  ticks_run(10);
  CHECK(f.bodies[0].pose.position[0] > 10.0 * T * T);
}

TEST(follows_hands_a_body_that_was_not_pushed_to_the_world)
{
  for (int follows = 0; follows < 2; ++follows) {
    for (int push = 0; push < 2; ++push) {
      set_up();
      hapi_pointer *p = add_pointer(0, -0.1, 0.0, 0.0);
      begin_model();
      (void)add_body(0);
      set_free(add_contact(0, 0, 0), 1.0, 1.0);
      model_adopt();
      ticks_run(1);
      p->device.pose.position[0] = push != 0 ? -0.009 : -0.1;
      ticks_run(1);
      p->device.pose.position[0] = -0.1;
      begin_model();
      hapi_model_body *body = add_body(0);
      body->flags = follows != 0 ? HAPI_BODY_FOLLOWS : 0;
      hapi_v3_set(body->pose.position, 7.0, 8.0, 9.0);
      hapi_v3_set(body->twist.linear, 1.0, 2.0, 3.0);
      model_adopt();
      bool worlds = follows != 0 && push == 0;
      CHECK((f.bodies[0].pose.position[0] == 7.0) == worlds);
      CHECK((f.bodies[0].twist.linear[0] == 1.0) == worlds);
      CHECK((fabs(f.bodies[0].twist.linear[0] - T) < 1e-15) == (!worlds && push != 0));
    }
  }
}

TEST(a_body_that_comes_in_is_advanced_by_the_age_of_the_model)
{
  set_up();
  begin_model();
  hapi_model_body *body = add_body(5);
  hapi_v3_set(body->twist.linear, 1.0, -2.0, 0.0);
  f.now_ns += 20 * TICK_NS;
  model_adopt();
  check_v3(f.bodies[5].pose.position, 0.02, -0.04, 0.0, 1e-15);
  begin_model();
  body = add_body(5);
  body->generation = 2; /* the slot has another body now */
  hapi_v3_set(body->pose.position, 1.0, 1.0, 1.0);
  model_adopt();
  check_v3(f.bodies[5].pose.position, 1.0, 1.0, 1.0, 0.0);
  check_v3(f.bodies[5].twist.linear, 0.0, 0.0, 0.0, 0.0);
}

static void adopt_residual(double total)
{
  begin_model();
  hapi_model_body *body = add_body(0);
  for (int i = 0; i < 6; ++i) {
    body->residual[i] = total * (i + 1);
  }
  model_adopt();
}

TEST(residual_is_added_once_also_when_a_model_is_skipped)
{
  set_up();
  adopt_residual(3.0); /* it was there before the body came in: is in its twist already */
  ticks_run(5);
  CHECK_NEAR(f.bodies[0].twist.linear[0], 0.0, 0.0);
  adopt_residual(3.5);
  ticks_run(1);
  CHECK_NEAR(f.bodies[0].twist.linear[0], 0.5, 1e-15);
  CHECK_NEAR(f.bodies[0].twist.angular[2], 0.5 * 6, 1e-14);
  ticks_run(20);
  CHECK_NEAR(f.bodies[0].twist.linear[0], 0.5, 1e-15);
  adopt_residual(3.5); /* nothing new */
  ticks_run(3);
  CHECK_NEAR(f.bodies[0].twist.linear[0], 0.5, 1e-15);
  /* 3.75 is lost on the way; the next one has it in its total */
  adopt_residual(4.0);
  ticks_run(2);
  CHECK_NEAR(f.bodies[0].twist.linear[0], 1.0, 1e-15);
  adopt_residual(4.25); /* two adoptions between two ticks */
  adopt_residual(4.5);
  ticks_run(2);
  CHECK_NEAR(f.bodies[0].twist.linear[0], 1.5, 1e-15);
  const hapi_state_body *told = &hapi_state_bodies(tick_report())[0];
  for (int i = 0; i < 6; ++i) {
    CHECK_NEAR(told->residual[i], 4.5 * (i + 1), 1e-14);
  }
}

/* ---- ramp ---- */

TEST(a_contact_that_arrives_deep_ramps_from_zero)
{
  set_up();
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0); /* 10 mm deep, 10 N */
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  int ticks = (int)lround(HAPI_SAFETY_CONTACT_RAMP_S / T);
  for (int i = 0; i <= ticks + 5; ++i) {
    if (i == ticks / 2) { /* a new model of the same contact goes on where it was */
      begin_model();
      (void)add_contact(0, HAPI_SLOT_NONE, 0);
      model_adopt();
    }
    ticks_run(1);
    double share = i < ticks ? (double)i / ticks : 1.0;
    check_v3(p->device.wrench.force, -10.0 * share, 0.0, 0.0, 1e-9);
  }
  begin_model(); /* another contact in the same slot begins anew */
  add_contact(0, HAPI_SLOT_NONE, 0)->generation = 2;
  model_adopt();
  ticks_run(1);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
  p->device.pose.position[0] = -0.1; /* letting go ends the ramp */
  ticks_run(1);
  p->device.pose.position[0] = 0.0;
  ticks_run(1);
  check_v3(p->device.wrench.force, -10.0, 0.0, 0.0, 1e-9);
}

TEST(contacts_of_a_pointer_that_has_gone_are_not_used)
{
  set_up();
  (void)add_pointer(0, 0.0, 0.0, 0.0);
  begin_model();
  add_contact(0, HAPI_SLOT_NONE, 0)->pointer_generation = 7;
  model_adopt();
  ticks_run(40);
  CHECK(f.tick.touches.count == 0 && f.tick.touches.contact_ticks == 0);
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  f.pointers[0].generation = 0;
  ticks_run(40);
  CHECK(f.tick.touches.contact_ticks == 0);
}

/* ---- guard ---- */

TEST(saturation_keeps_the_direction)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -1.0, -1.0, -1.0);
  p->device.limits.max_force = 20.0;
  p->device.force_scale = 4.0;
  begin_model();
  for (uint32_t i = 0; i < 3; ++i) {
    hapi_model_contact *c = add_contact(i, HAPI_SLOT_NONE, 0);
    hapi_v3_set(c->normal_body, 0.0, 0.0, 0.0);
    c->normal_body[i] = -1.0;
  }
  model_adopt();
  ticks_run(1);
  CHECK((p->guard.flags & HAP_GUARD_SATURATED) == 0 && f.tick.guard.saturated_ticks == 0);
  p->surface.stiffness = 10000.0;
  hapi_v3_set(p->device.pose.position, -0.008, -0.007, -0.004); /* 20, 30, 60 N, 4 times that */
  ticks_run(1);
  const double norm = sqrt(4.0 + 9.0 + 36.0);
  check_v3(p->device.wrench.force, -20.0 * 2 / norm, -20.0 * 3 / norm, -20.0 * 6 / norm, 1e-12);
  check_v3(p->wrench.force, -5.0 * 2 / norm, -5.0 * 3 / norm, -5.0 * 6 / norm, 1e-12);
  CHECK((p->guard.flags & HAP_GUARD_SATURATED) != 0 && f.tick.guard.saturated_ticks == 1);
  CHECK_NEAR(f.tick.guard.peak_force, 5.0, 1e-12);
  hapi_v3_set(p->device.pose.position, -1.0, -1.0, -0.0099);
  ticks_run(1);
  check_v3(p->device.wrench.force, 0.0, 0.0, -4.0, 1e-11);
  CHECK((p->guard.flags & HAP_GUARD_SATURATED) == 0 && f.tick.guard.saturated_ticks == 1);
}

static bool state_is_finite(hapi_state *state)
{
  bool good = true;
  for (uint32_t i = 0; i < state->body_high; ++i) {
    const hapi_state_body *b = &hapi_state_bodies(state)[i];
    good = good && hapi_finite(b->pose.position, 3) && hapi_finite(b->pose.quat_wxyz, 4) &&
           hapi_finite(b->twist.linear, 3) && hapi_finite(b->twist.angular, 3) &&
           hapi_finite(b->impulse, 3) && hapi_finite(b->angular_impulse, 3) &&
           hapi_finite(b->residual, 6);
  }
  for (uint32_t i = 0; i < state->contact_count; ++i) {
    good = good && hapi_finite(hapi_state_contacts(state)[i].force, 3);
  }
  for (uint32_t i = 0; i < state->pointer_count; ++i) {
    const hapi_state_pointer *p = &hapi_state_pointers(state)[i];
    good = good && hapi_finite(p->pose.position, 3) && hapi_finite(p->pose.quat_wxyz, 4) &&
           hapi_finite(p->twist.linear, 3) && hapi_finite(p->twist.angular, 3);
  }
  return good;
}

static bool force_is_zero(const hapi_pointer *p)
{
  return hapi_v3_norm(p->device.wrench.force) == 0.0 &&
         hapi_v3_norm(p->device.wrench.torque) == 0.0 && hapi_v3_norm(p->wrench.force) == 0.0;
}

/* One bad number among the 13 of a device's sample. */
static void bad_sample(int place, double bad)
{
  body_under_pointer(0.003);
  hapi_pointer *other = add_pointer(1, 3.0, 0.0, 0.0);
  hapi_pointer *p = &f.pointers[0];
  ticks_run(1);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE && p->device.wrench.force[0] < -1.0);
  hap_pose good_pose = p->device.pose;
  double *sample[13];
  for (int i = 0; i < 13; ++i) {
    sample[i] = i < 3    ? &p->device.pose.position[i]
                : i < 7  ? &p->device.pose.quat_wxyz[i - 3]
                : i < 10 ? &p->device.twist.linear[i - 7]
                         : &p->device.twist.angular[i - 10];
  }
  *sample[place] = bad;
  ticks_run(1);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_DEVICE_POSE && f.tick.guard.latch.count == 1);
  CHECK(force_is_zero(p) && force_is_zero(other));
  CHECK(state_is_finite(tick_report()));
  p->device.pose = good_pose;
  memset(&p->device.twist, 0, sizeof p->device.twist);
  ticks_run(10); /* latched */
  CHECK(force_is_zero(p) && f.tick.guard.latch.fault == HAP_FAULT_DEVICE_POSE &&
        f.tick.guard.latch.count == 1);
  double before = f.bodies[3].account.impulse[0];
  ticks_run(5);
  CHECK_NEAR(f.bodies[3].account.impulse[0], before, 0.0); /* and the world is not pushed either */
  p->device.pose.position[0] += 0.01;
  hapi_tick_reset_fault(&f.tick);
  ticks_run(1);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE &&
        force_is_zero(p)); /* its contacts begin anew */
  ticks_run(21);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE && p->device.wrench.force[0] < -1.0);
}

TEST(bad_device_samples_latch_a_fault_and_go_no_further)
{
  const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e30, -1e30};
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    for (int place = 0; place < 13; ++place) {
      bad_sample(place, bad[k]);
    }
  }
}

TEST(a_fault_that_goes_on_latches_again_after_a_reset)
{
  body_under_pointer(0.003);
  f.pointers[0].device.pose.position[1] = (double)NAN;
  ticks_run(5);
  CHECK(f.tick.guard.latch.count == 1);
  hapi_tick_reset_fault(&f.tick);
  ticks_run(5);
  CHECK(f.tick.guard.latch.count == 2 && f.tick.guard.latch.fault == HAP_FAULT_DEVICE_POSE);
  hapi_tick_fault(&f.tick, HAP_FAULT_DEVICE_WRITE, 0); /* the first one stays */
  CHECK(f.tick.guard.latch.count == 2 && f.tick.guard.latch.fault == HAP_FAULT_DEVICE_POSE);
}

TEST(a_local_state_that_is_not_finite_is_stopped)
{
  const double bad[] = {(double)NAN, (double)INFINITY, 1e30};
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    for (int place = 0; place < 6; ++place) {
      body_under_pointer(0.003);
      ticks_run(1);
      f.bodies[3].linear.b[place] = bad[k];
      hap_pose before = f.bodies[3].pose;
      ticks_run(1);
      CHECK(f.tick.guard.latch.fault == HAP_FAULT_LOCAL_STATE);
      CHECK(force_is_zero(&f.pointers[0]));
      CHECK(state_is_finite(tick_report()));
      CHECK(memcmp(&before, &f.bodies[3].pose, sizeof before) == 0);
      body_under_pointer(0.003);
      f.contacts[0].response.a[place][0] = bad[k];
      ticks_run(1);
      CHECK(f.tick.guard.latch.fault == HAP_FAULT_LOCAL_STATE && state_is_finite(tick_report()));
      CHECK(force_is_zero(&f.pointers[0]));
    }
  }
}

/* Too large for a double: in the world, and only at the device. */
TEST(a_force_that_overflows_is_not_written)
{
  for (int k = 0; k < 2; ++k) {
    body_under_pointer(0.003);
    memset(f.contacts[0].response.a, 0, sizeof f.contacts[0].response.a); /* stays where it is */
    ticks_run(50);                                                        /* the ramp is over */
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE && f.pointers[0].contacts == 1);
    f.pointers[0].surface.stiffness = k == 0 ? 1e308 : 1e306;
    f.pointers[0].surface.damping = k == 0 ? 1e308 : 0.0;
    f.pointers[0].device.twist.linear[0] = k == 0 ? 1e3 : 0.0;
    f.pointers[0].device.force_scale = 1e6;
    ticks_run(1);
    CHECK(f.tick.guard.latch.fault ==
          (k == 0 ? HAP_FAULT_LOCAL_STATE : HAP_FAULT_FORCE)); /* the first one */
    CHECK(force_is_zero(&f.pointers[0]));
    CHECK(isfinite(f.tick.guard.peak_force) && hapi_finite(f.tick.touches.hand_impulse, 3));
  }
}

/* ---- device and world ---- */

/* What the hand does on the device and what the pointer does in the world are the same work up to
 * force_scale / motion_scale, and position, velocity and force go through the same frame. */
TEST(scales_and_frame_keep_virtual_work)
{
  const double frame[4] = {0.5, -0.1, 0.7, 0.3};
  static const double motion[] = {1.0, 0.25, 3.0};
  static const double force[] = {1.0, 2.0, 0.1};
  for (size_t i = 0; i < 9; ++i) {
    hapi_pointer *p = pointer_before_wall();
    p->device.motion_scale = motion[i % 3];
    p->device.force_scale = force[i / 3];
    hapi_v3_set(p->device.pose_world_device.position, 0.3, -0.2, 0.1);
    memcpy(p->device.pose_world_device.quat_wxyz, frame, sizeof frame);
    hapi_quat_normalize(p->device.pose_world_device.quat_wxyz);
    /* the device's position for 2 mm depth, and one 1e-6 s later at its velocity */
    const double target[3] = {-0.008, 0.4, -0.7};
    hapi_pose_unpoint(p->device.pose_world_device.position, p->device.pose_world_device.quat_wxyz,
                      target, p->device.pose.position);
    hapi_v3_scale(1.0 / p->device.motion_scale, p->device.pose.position, p->device.pose.position);
    hapi_v3_set(p->device.twist.linear, 0.02, -0.05, 0.03);
    hapi_v3_set(p->device.twist.angular, 0.5, 0.2, -0.1);
    ticks_run(1);
    check_v3(p->pose.position, target[0], target[1], target[2], 1e-14);
    check_v3(p->wrench.force, -2.0, 0.0, 0.0, 1e-10);
    double at_device = hapi_v3_dot(p->device.wrench.force, p->device.twist.linear);
    double in_world = hapi_v3_dot(p->wrench.force, p->twist.linear);
    CHECK_NEAR(at_device, in_world * p->device.force_scale / p->device.motion_scale, 1e-12);
    CHECK(fabs(at_device) > 1e-4);
    CHECK_NEAR(hapi_v3_norm(p->twist.angular), hapi_v3_norm(p->device.twist.angular), 1e-15);
    double moved[3];
    double force_before[3];
    hapi_v3_copy(p->pose.position, moved);
    hapi_v3_copy(p->device.wrench.force, force_before);
    hapi_v3_madd(p->device.pose.position, 1e-3, p->device.twist.linear, p->device.pose.position);
    ticks_run(1);
    hapi_v3_madd(moved, 1e-3, p->twist.linear, moved);
    check_v3(p->pose.position, moved[0], moved[1], moved[2], 1e-14);
    /* stiffness at the device = k x motion_scale x force_scale, along the wall's normal there */
    double normal[3];
    const double x[3] = {1.0, 0.0, 0.0};
    hapi_quat_unrotate(p->device.pose_world_device.quat_wxyz, x, normal);
    double step = 1e-3 * hapi_v3_dot(normal, p->device.twist.linear);
    double change = hapi_v3_dot(normal, p->device.wrench.force) - hapi_v3_dot(normal, force_before);
    CHECK_NEAR(change, -1000.0 * p->device.motion_scale * p->device.force_scale * step, 1e-9);
  }
}

static void press_wall(bool aligned, hapi_pointer *out)
{
  hapi_pointer *p = pointer_before_wall();
  p->device.aligned = aligned;
  p->device.motion_scale = 0.7;
  p->device.force_scale = 1.3;
  hapi_v3_set(p->device.pose_world_device.position, 0.3, -0.2, 0.1);
  hapi_v3_set(p->device.pose.position, -0.44, 0.7, -0.9);
  memcpy(p->device.pose.quat_wxyz, (double[4]){0.5, -0.1, 0.7, 0.3}, 4 * sizeof(double));
  hapi_v3_set(p->device.twist.linear, 0.02, -0.05, 0.03);
  hapi_v3_set(p->device.twist.angular, 0.5, 0.2, -0.1);
  ticks_run(1);
  *out = *p;
}

/* The turning is left out, and no bit is another. */
TEST(an_aligned_device_is_as_one_that_is_turned_by_nothing)
{
  hapi_pointer turned;
  hapi_pointer aligned;
  press_wall(false, &turned);
  press_wall(true, &aligned);
  CHECK(turned.device.wrench.force[0] < -1.0);
  CHECK(memcmp(&turned.pose, &aligned.pose, sizeof turned.pose) == 0);
  CHECK(memcmp(&turned.twist, &aligned.twist, sizeof turned.twist) == 0);
  CHECK(memcmp(&turned.device.wrench, &aligned.device.wrench, sizeof turned.device.wrench) == 0);
}

/* ---- model IMPULSE and SINGLE ---- */

static void impulse_model(hap_impulse_pose shown, double x, double sign)
{
  begin_model();
  f.model->model = HAP_MODEL_IMPULSE;
  f.model->impulse_pose = shown;
  f.model->blend_s = 0.05;
  hapi_model_body *body = add_body(0);
  body->pose.position[0] = x;
  body->pose.quat_wxyz[0] = sign;
  body->b[2] = -9.81; /* not of this model */
  set_free(add_contact(0, 0, 0), 1.0, 1.0);
  model_adopt();
}

TEST(impulse_interpolates_from_the_last_but_one_to_the_last_pose)
{
  set_up();
  (void)add_pointer(0, -1.0, 0.0, 0.0);
  impulse_model(HAP_IMPULSE_INTERPOLATED, 0.0, 1.0);
  ticks_run(50);
  impulse_model(HAP_IMPULSE_INTERPOLATED, 0.1, -1.0); /* -q is the same attitude */
  for (int i = 0; i < 80; ++i) {
    ticks_run(1);
    double share = i < 50 ? i / 50.0 : 1.0;
    check_v3(f.bodies[0].pose.position, 0.1 * share, 0.0, 0.0, 1e-14);
    CHECK_NEAR(fabs(f.bodies[0].pose.quat_wxyz[0]), 1.0, 1e-15);
    CHECK_NEAR(f.bodies[0].twist.linear[0], i < 50 ? 2.0 : 0.0, 1e-13);
  }
  impulse_model(HAP_IMPULSE_INTERPOLATED, 0.0, 1.0);
  ticks_run(1);
  CHECK_NEAR(f.bodies[0].pose.position[0], 0.1, 1e-14); /* without a jump */
}

TEST(impulse_holds_the_last_pose_and_sums_the_impulse)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -1.0, 0.0, 0.0);
  impulse_model(HAP_IMPULSE_HELD, 0.0, 1.0);
  ticks_run(1);
  p->device.pose.position[0] = -0.008;
  ticks_run(49);
  check_v3(f.bodies[0].pose.position, 0.0, 0.0, 0.0, 0.0);
  check_v3(f.bodies[0].account.impulse, 49 * 2.0 * T, 0.0, 0.0, 1e-13);
  impulse_model(HAP_IMPULSE_HELD, 0.002, 1.0);
  ticks_run(50);
  check_v3(f.bodies[0].pose.position, 0.002, 0.0, 0.0, 0.0);
  CHECK_NEAR(f.bodies[0].account.impulse[0], 49 * 2.0 * T, 1e-13); /* total goes on; apart now */
  f.model->model = HAP_MODEL_SINGLE;
  f.model->blend_s = 0.0;
  begin_model();
  add_body(0)->pose.position[0] = -0.001;
  (void)add_contact(0, 0, 0);
  model_adopt();
  ticks_run(1);
  check_v3(f.bodies[0].pose.position, -0.001, 0.0, 0.0, 0.0);
  CHECK_NEAR(f.bodies[0].account.impulse[0], 49 * 2.0 * T + 3.0 * T, 1e-13);
}

/* ---- bounce, totals, cost ---- */

/* The paper's Fig. 5: 60 kg at 0.017 m/s into a fixed pointer. Symplectic Euler conserves a
 * neighbour of the energy, so the speed comes back within (w T)^2. */
TEST(a_bounce_conserves_energy)
{
  static const double stiffness[] = {1000.0, 3000.0, 10000.0};
  for (int k = 0; k < 3; ++k) {
    const double m = 60.0;
    const double v = 0.017;
    const double omega = sqrt(stiffness[k] / m);
    set_up();
    add_pointer(0, 0.0, 0.0, 0.0)->surface.stiffness = stiffness[k];
    begin_model();
    hapi_model_body *body = add_body(0);
    hapi_v3_set(body->pose.position, 0.1119, 0.0, 0.0); /* 1.9 mm before contact */
    body->twist.linear[0] = -v;
    hapi_model_contact *c = add_contact(0, 0, 0);
    c->point_body[0] = -0.1;
    set_free(c, m, 0.4);
    model_adopt();
    double contact_ns = 0.0;
    for (int i = 0; i < 1200; ++i) {
      ticks_run(1);
      contact_ns += f.pointers[0].contacts != 0 ? TICK_NS : 0.0;
    }
    double bound = omega * omega * T * T;
    CHECK_NEAR(f.bodies[0].twist.linear[0], v, bound * v);
    CHECK_NEAR(f.bodies[0].account.impulse[0], 2.0 * m * v, bound * 2.0 * m * v);
    CHECK_NEAR(f.tick.guard.peak_force, v * sqrt(stiffness[k] * m),
               5e-4 * v * sqrt(stiffness[k] * m));
    CHECK_NEAR(1e-9 * contact_ns, acos(-1.0) / omega, 2.0 * T);
    CHECK_NEAR(f.pointers[0].wrench.force[0], 0.0, 0.0);
  }
}

TEST(totals_run_on_over_models_and_begin_anew_with_a_generation)
{
  set_up();
  hapi_pointer *p = add_pointer(0, -1.0, 0.0, 0.0);
  double expected = 0.0;
  for (int n = 0; n < 20; ++n) {
    begin_model();
    (void)add_body(0);
    (void)add_contact(0, 0, 0); /* A = 0: does not give way */
    model_adopt();
    for (int i = 0; i < 20; ++i) {
      ticks_run(1);
      expected += T * fabs(p->wrench.force[0]);
    }
    p->device.pose.position[0] = n % 2 == 0 ? -0.005 : -1.0;
  }
  CHECK_NEAR(expected, 10 * 20 * 5.0 * T, 1e-12); /* every second of 20 intervals */
  CHECK_NEAR(hapi_state_bodies(tick_report())[0].impulse[0], expected, 1e-12);
  CHECK_NEAR(f.tick.touches.hand_impulse[0], expected, 1e-12);
  CHECK_NEAR(f.tick.touches.hand_impulse_abs, expected, 1e-12);
  begin_model();
  add_body(0)->generation = 2;
  model_adopt();
  ticks_run(1);
  CHECK_NEAR(hapi_state_bodies(tick_report())[0].impulse[0], 0.0, 0.0);
  CHECK(hapi_state_bodies(tick_report())[0].generation == 2);
  CHECK_NEAR(f.tick.touches.hand_impulse[0], expected, 1e-12);
}

TEST(the_hash_tells_any_change)
{
  uint64_t first = 0;
  for (int run_number = 0; run_number < 3; ++run_number) {
    body_under_pointer(0.003);
    f.pointers[0].device.pose.position[1] += run_number == 2 ? 1e-16 : 0.0;
    ticks_run(100);
    first = run_number == 0 ? f.tick.hash : first;
    CHECK((f.tick.hash == first) == (run_number < 2));
  }
}

/* Page faults of the whole cycle, with a device, bodies and a trace. */
TEST(ten_thousand_cycles_touch_no_new_memory)
{
  hapi_haptic *haptic = NULL;
  hap_device *device = NULL;
  hap_pointer_id id;
  hap_pointer_def def;
  hap_detail detail;
  struct rusage before;
  struct rusage after;
  tap_fresh_memory();
  set_up();
  hapi_haptic_config config = {.capacity = capacity,
                               .haptic_hz = 1000.0,
                               .lockstep = true,
                               .trace_rows = 12000,
                               .exchange = f.exchange};
  REQUIRE(hapi_haptic_create(&config, &haptic) == HAP_OK);
  REQUIRE(hap_device_open("virtual:sine=0.02/0/0,hz=2,hand=tense", &device, &detail) == HAP_OK);
  hap_pointer_def_init(&def, sizeof def);
  def.device = device;
  hapi_pointer_setup setup;
  REQUIRE(hapi_session_read_pointer(&def, &setup, &detail) == HAP_OK);
  REQUIRE(hapi_haptic_add_pointer(haptic, &setup, &id, &detail) == HAP_OK);
  REQUIRE(hapi_haptic_begin(haptic, 0, &detail) == HAP_OK);
  begin_model();
  (void)add_body(0);
  hapi_v3_set(add_contact(0, 0, 0)->point_body, 0.015, 0.0, 0.0);
  set_free(&hapi_model_contacts(f.model)[0], 1.0, 1.0);
  hapi_exchange_model_publish(f.exchange);
  for (int i = 0; i < 11000; ++i) {
    if (i == 1000) {
      getrusage(RUSAGE_THREAD, &before);
    }
    hapi_haptic_cycle(haptic, i * TICK_NS);
  }
  getrusage(RUSAGE_THREAD, &after);
  hap_stats stats;
  hapi_haptic_stats(haptic, &stats);
  CHECK(stats.loop.ticks == 11000 && stats.loop.contact_ticks > 0 &&
        stats.loop.models_adopted == 1);
#if !TAP_ADDRESS_SANITIZER && !TAP_THREAD_SANITIZER /* they touch memory of theirs */
  CHECK(after.ru_minflt == before.ru_minflt);
  CHECK(after.ru_majflt == before.ru_majflt);
#endif
  hapi_haptic_destroy(haptic);
  hap_device_close(device);
}
