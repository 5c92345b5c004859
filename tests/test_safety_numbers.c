/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What single numbers of the safety concept mean, where no test of a whole part needs them: times,
 * ways and speeds against closed forms. The numbers are written out, as docs/safety.md has them. */

#include "tests/tap.h"

#include <math.h>

#include "guard/energy_observer.h"
#include "guard/force_guard.h"
#include "haptic/haptic_internal.h"
#include "local/contact_ramp.h"
#include "local/grab_place.h"
#include "plugins/spidar/belief.h"
#include "plugins/spidar/calibration.h"
#include "pointer/coupling.h"
#include "pointer/plausible.h"
#include "tests/tick_world.h"

/* ---- grips ---- */

TEST(a_grip_waits_a_second_for_a_body_that_does_not_come)
{
  static hapi_pointer hands[1];
  static const hapi_bodies nobody;
  static const hapi_touches none;
  hapi_pointers pointers = {.of = hands, .high = 1};
  const hapi_tick_facts facts = {.model = HAP_MODEL_CONTACT, .period = 1e-3};
  int ticks = 0;
  hands[0] = (hapi_pointer){.generation = 1};
  hands[0].grab.any = true;
  hands[0].grab.wanted = (hapi_grab_setup){.birth = 7, .serial = 1};
  do {
    hapi_grabs_place(&pointers, &nobody, &none, &facts);
    ticks += hands[0].grab.phase == HAPI_GRAB_WAITS;
  } while (hands[0].grab.phase == HAPI_GRAB_WAITS && ticks < 100000);
  CHECK_NEAR(1e-3 * ticks, 1.0, 2e-3);
  CHECK(hands[0].grab.ended == HAP_GRAB_GONE);
}

/* ---- contacts that arrive deep ---- */

typedef struct ramp_rig {
  hapi_ramp ramp;
  hapi_pointer pointer;
  bool seen;
} ramp_rig;

/* The depth that counts; *out_share of the force. */
static double ramp_tick(ramp_rig *r, double depth, double period, double *out_share)
{
  *out_share = hapi_ramp_follow(&r->ramp, &r->seen, &r->pointer, &depth, period);
  return depth;
}

TEST(a_contact_that_arrives_deep_comes_in_over_20_ms)
{
  ramp_rig r = {.seen = false};
  double share;
  for (int i = 0; i <= 30; ++i) {
    CHECK_NEAR(ramp_tick(&r, 0.009, T, &share), 0.009, 0.0); /* all of the depth */
    CHECK_NEAR(share, fmin(i * T / 0.02, 1.0), 1e-9);
  }
}

TEST(depth_beyond_10_mm_comes_in_at_200_mm_a_second)
{
  ramp_rig r = {.seen = false};
  double share;
  for (int i = 0; i <= 200; ++i) {
    double counted = ramp_tick(&r, 0.03, T, &share);
    CHECK_NEAR(counted, fmin(0.01 + 0.2 * i * T, 0.03), 1e-9);
  }
}

/* Ticks of 4 ms: 10 m/s are 40 mm in one. */
TEST(no_contact_is_pressed_in_faster_than_10_m_a_second)
{
  for (int put = 0; put < 2; ++put) {
    ramp_rig r = {.seen = false};
    double share;
    (void)ramp_tick(&r, -0.001, 0.004, &share);
    double deep = put != 0 ? 0.041 : 0.039;
    double counted = ramp_tick(&r, deep, 0.004, &share);
    CHECK_NEAR(share, put != 0 ? 0.0 : 1.0, 0.0);
    CHECK_NEAR(counted, put != 0 ? 0.01 : deep, 1e-12);
  }
}

/* ---- a plausible device ---- */

/* In time; steps of 20 ms. */
static uint32_t coupling_read(void)
{
  const hapi_coupling_late late = {.elapsed = T};
  return hapi_coupling_read(&f.tick.pointers, f.now_ns, T, &late, 0.02);
}

static hapi_pointer *coupling_pointer(void)
{
  static const hapi_tool_hull hull;
  set_up();
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->shape.hull = &hull;
  p->device.speed_limit = 10.0;
  f.tick.pointers.high = 1;
  CHECK(coupling_read() == 0);
  return p;
}

static void turn_to(hapi_pointer *p, double angle)
{
  p->device.pose.quat_wxyz[0] = cos(0.5 * angle);
  p->device.pose.quat_wxyz[3] = sin(0.5 * angle);
}

TEST(a_device_that_turns_by_more_than_a_tenth_in_a_tick_has_jumped)
{
  hapi_pointer *p = coupling_pointer();
  turn_to(p, 0.095);
  CHECK(coupling_read() == 0 && !p->device.jumped);
  turn_to(p, 0.2);
  CHECK(coupling_read() == 0 && p->device.jumped);
}

/* In this tick it is known; 10 ms, and two steps until a model of the new place has come. */
TEST(contacts_that_come_after_a_jump_begin_anew_for_10_ms_and_two_steps)
{
  hapi_pointer *p = coupling_pointer();
  int ticks = 0;
  p->device.pose.position[0] = 0.02;
  (void)coupling_read();
  CHECK(p->device.jumped);
  for (; p->device.jump_s > 0.5 * T && ticks < 1000; ++ticks) {
    (void)coupling_read();
  }
  CHECK_SAY(ticks == 50, "%d ticks", ticks);
}

TEST(a_speed_that_no_wrist_has_is_no_speed)
{
  hapi_pointer *p = coupling_pointer();
  hapi_v3_set(p->device.twist.angular, 0.0, 99.0, 0.0);
  (void)coupling_read();
  CHECK_NEAR(p->twist.angular[1], 99.0, 1e-9);
  hapi_v3_set(p->device.twist.angular, 0.0, 101.0, 0.0);
  (void)coupling_read();
  CHECK(p->twist.angular[1] == 0.0);
}

TEST(a_coordinate_or_a_speed_of_more_than_a_million_is_an_error)
{
  for (int i = 0; i < 6; ++i) {
    for (int beyond = 0; beyond < 2; ++beyond) {
      hapi_pointer *p = coupling_pointer();
      double *value = i < 3 ? &p->device.pose.position[i] : &p->device.twist.linear[i - 3];
      p->device.speed_limit = 0.0;
      *value = beyond != 0 ? 1.01e6 : 0.99e6;
      CHECK(coupling_read() == (beyond != 0 ? 1 : 0));
    }
  }
}

/* ---- a plausible input ---- */

#define MS 1000000LL

static const hapi_tool_hull any_hull;
static hapi_pointer hand;
static int64_t hand_ns;

/* One read; true: it was believed. */
static bool hand_tell(double x, double angle, int64_t after_ns)
{
  hand_ns += after_ns;
  hapi_v3_set(hand.device.pose.position, x, 0.0, 0.0);
  turn_to(&hand, angle);
  return hapi_input_judge(&hand, hand_ns, false);
}

/* At rest for 25 ms, with a tool. */
static void hand_rest(void)
{
  memset(&hand, 0, sizeof hand);
  hand.device.speed_limit = 10.0;
  hand.shape.hull = &any_hull;
  hand.guard.share = 1.0;
  hand_ns = 0;
  for (int i = 0; i < 25; ++i) {
    CHECK(hand_tell(0.0, 0.0, MS));
  }
}

TEST(a_pose_that_is_false_goes_on_at_1_m_a_second_at_most)
{
  hand_rest();
  for (int i = 1; i <= 30; ++i) { /* to 3 m/s by 100 m/s^2 */
    CHECK(hand_tell(0.5 * 100.0 * 1e-6 * i * i, 0.0, MS));
  }
  double told = hand.device.pose.position[0];
  CHECK(!hand_tell(told - 0.05, 0.0, MS));
  CHECK_NEAR(hand.device.pose.position[0], told + 0.001, 1e-9);
  CHECK_NEAR(hand.device.twist.linear[0], 1.0, 1e-9);
}

TEST(a_tool_changes_its_turning_by_50_rad_a_second_in_a_tick)
{
  hand_rest();
  CHECK(hand_tell(0.0, 0.047, MS));
  hand_rest();
  CHECK(!hand_tell(0.0, 0.053, MS));
}

/* Poses that go on from another place are believed. Surfaces go there from half a mm on. */
TEST(surfaces_go_with_a_jump_of_half_a_millimetre)
{
  for (int far = 0; far < 2; ++far) {
    hand_rest();
    hand.device.good.position[0] = far != 0 ? 0.0494 : 0.0496; /* where it was felt meanwhile */
    hand.device.good.quat_wxyz[0] = 1.0;
    for (int i = 0; i < 10 && !hand_tell(0.05, 0.0, MS); ++i) {
      CHECK(!hand.belief.jumped);
    }
    CHECK(hand.belief.jumped == (far != 0));
    CHECK(far == 0 || hand.device.pose.position[0] == 0.05);
  }
}

/* Every 4 ms, without a quantum. */
TEST(steps_of_less_than_20_um_say_nothing_of_the_pace)
{
  for (int large = 0; large < 2; ++large) {
    hand_rest();
    for (int i = 0; i < 80; ++i) {
      (void)hand_tell((large != 0 ? 25e-6 : 15e-6) * (double)(i / 4), 0.0, MS);
    }
    CHECK_NEAR(hapi_input_gap(&hand, T), large != 0 ? 0.004 : 0.0, 1e-12);
  }
}

/* The hand has accelerated by 300 m/s^2 for 15 ms: half of that way, as what had begun before was
 * seen. */
TEST(a_hand_that_was_not_read_may_have_gone_by_300_m_a_second_squared)
{
  const double most = 0.5 * 300.0 * 0.015 * 0.015;
  hand_rest();
  CHECK(hand_tell(0.95 * most, 0.0, 15 * MS));
  hand_rest();
  CHECK(!hand_tell(1.05 * most, 0.0, 15 * MS));
}

TEST(nothing_is_known_of_a_hand_that_was_not_read_for_20_ms)
{
  hand_rest();
  CHECK(!hand_tell(0.15, 0.0, 19 * MS));
  hand_rest();
  CHECK(hand_tell(0.15, 0.0, 21 * MS));
}

/* 5 ms of doubt, and 8 ms without any. */
TEST(a_second_without_doubt_takes_a_quarter_of_one_away)
{
  hand_rest();
  for (int i = 0; i < 5; ++i) {
    CHECK(!hand_tell(i % 2 == 0 ? 0.02 : -0.02, 0.0, MS));
  }
  CHECK_NEAR(hand.belief.doubt_s, 0.005, 1e-9);
  for (int i = 0; i < 8; ++i) {
    CHECK(hand_tell(0.0, 0.0, MS));
  }
  CHECK_NEAR(hand.belief.doubt_s, 0.005 - 0.25 * 0.008, 1e-9);
}

/* The same counts again, of a grip whose fastest string goes at 0.12 m/s: 3.4 counts a ms. */
TEST(a_reply_is_old_when_a_string_has_not_gone_by_6_counts)
{
  hapi_spidar_model model = *hapi_spidar_model_find("x4r");
  hapi_spidar_belief belief;
  hap_pose grip = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  double counts[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  int64_t ns = 0;
  int same = 0;
  hapi_spidar_calibrate_at(&model, NULL, counts);
  hapi_spidar_belief_begin(&belief, &model, NULL);
  for (int i = 0; i < 60; ++i, ns += MS) {
    grip.position[1] = 1e-3 * 0.15 * (i - 30);
    hapi_spidar_lengths(&model, &grip, lengths);
    for (int k = 0; k < model.strings; ++k) {
      counts[k] = round((lengths[k] - model.offset[k]) / model.metres_per_count[k]);
    }
    CHECK(hapi_spidar_belief_update(&belief, &model, ns, counts, true) == HAPI_SPIDAR_BELIEVED);
  }
  CHECK(belief.pace > 0.105 && belief.pace < 0.2);
  while (same < 20 &&
         hapi_spidar_belief_update(&belief, &model, ns, counts, true) == HAPI_SPIDAR_BELIEVED) {
    ++same;
    ns += MS;
  }
  /* the first of them comes 1 ms after the change */
  CHECK_SAY(same + 1 == (int)ceil(6.0 * 3.485e-5 / (1e-3 * belief.pace)), "%d, %g m/s", same,
            belief.pace);
}

/* By half a count a ms: no string leaves where it can have come to, and it is the fit that fails.
 * Away from home few strings of x4r leave the same misfit as another one. */
TEST(a_string_that_creeps_is_named_away_from_home)
{
  hapi_spidar_model model = *hapi_spidar_model_find("x4r");
  int named = 0;
  for (int string = 0; string < model.strings; ++string) {
    hapi_spidar_belief belief;
    hap_pose grip = {{0.012, 0.02, -0.015}, {1.0, 0.1, -0.05, 0.15}};
    double counts[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    hapi_spidar_verdict said = HAPI_SPIDAR_BELIEVED;
    hapi_quat_normalize(grip.quat_wxyz);
    hapi_spidar_calibrate_at(&model, NULL, counts);
    hapi_spidar_belief_begin(&belief, &model, &grip);
    hapi_spidar_lengths(&model, &grip, lengths);
    for (int i = 0; i < 1000 && said == HAPI_SPIDAR_BELIEVED; ++i) {
      for (int k = 0; k < model.strings; ++k) {
        counts[k] = round((lengths[k] - model.offset[k]) / model.metres_per_count[k]);
        counts[k] += k == string ? 0.5 * i : 0.0;
      }
      said = hapi_spidar_belief_update(&belief, &model, i * MS, counts, true);
    }
    CHECK(said == HAPI_SPIDAR_DOUBTED || belief.wrong == string);
    named += said == HAPI_SPIDAR_SPARED;
  }
  CHECK(named >= 6);
}

/* Turning at 20 rad/s, until the lengths of four strings are 10 mm off. */
TEST(a_grip_whose_strings_are_false_turns_on_at_10_rad_a_second_at_most)
{
  hapi_spidar_model model = *hapi_spidar_model_find("x4r");
  hapi_spidar_belief belief;
  hap_pose grip = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  double counts[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_calibrate_at(&model, NULL, counts);
  hapi_spidar_belief_begin(&belief, &model, NULL);
  for (int i = 0; i <= 20; ++i) {
    bool false_now = i == 20;
    double angle = 0.02 * i - 0.2;
    grip.quat_wxyz[0] = cos(0.5 * angle);
    grip.quat_wxyz[2] = sin(0.5 * angle);
    hapi_spidar_lengths(&model, &grip, lengths);
    for (int k = 0; k < model.strings; ++k) {
      double off = false_now && k < 4 ? (k % 2 == 0 ? 0.01 : -0.01) : 0.0;
      counts[k] = round((lengths[k] + off - model.offset[k]) / model.metres_per_count[k]);
    }
    CHECK(hapi_spidar_belief_update(&belief, &model, i * MS, counts, true) ==
          (false_now ? HAPI_SPIDAR_DOUBTED : HAPI_SPIDAR_BELIEVED));
  }
  const double *q = belief.solver.pose.quat_wxyz;
  CHECK_NEAR(2.0 * atan2(q[2], q[0]), 0.02 * 19 - 0.2 + 0.01, 5e-4);
  CHECK_NEAR(hapi_v3_norm(belief.twist.angular), 10.0, 1e-6);
}

/* ---- the ledger of energy ---- */

/* A hand of 1000 N/m at rest in a wall, the touch of which has just begun. */
static hapi_pointer *ledger_wall(double depth)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  hapi_pointer *p = add_pointer(0, -0.02, 0.0, 0.0);
  p->device.limits.max_force = 20.0;
  p->device.limits.slew_force = 1e6;
  p->device.limits.slew_torque = 1e6;
  f.model->model = HAP_MODEL_CONTACT;
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  ticks_run(30);
  f.tick.facts.physics_period = 0.0; /* the wall does not grow old */
  p->device.pose.position[0] = -0.01 + depth;
  return p;
}

TEST(a_debt_is_forgiven_in_a_touch_that_lasts_by_a_time_constant_of_300_ms)
{
  const hapi_guard *guard = &f.tick.guard;
  (void)ledger_wall(0.002);
  ticks_run(200);
  f.tick.guard.balance = guard->sprung - 1e-3;
  ticks_run(95);
  CHECK_NEAR(guard->sprung - guard->balance, 1e-3, 1e-9);
  ticks_run(305);
  CHECK_NEAR(guard->sprung - guard->balance, 1e-3 * exp(-1.0), 2e-5);
}

/* 0.9 mm in, as often as wanted: 0.4 mJ in the spring, of which 0.6 % are less than 10 uJ. */
TEST(a_hand_may_gain_10_uj_of_nothing)
{
  hapi_pointer *p = ledger_wall(0.0);
  double gained = 0.0;
  double most = 0.0;
  for (int i = 0; i < 20000; ++i) {
    double x = -0.01 + 0.0009 * sin(2.0 * M_PI * 7.0 * i * T);
    gained += p->device.wrench.force[0] * (x - p->device.pose.position[0]);
    p->device.pose.position[0] = x;
    most = fmax(most, gained);
    ticks_run(1);
  }
  CHECK_SAY(most > 5e-6 && most < 2e-5, "%g J", most);
}

/* J, of the body as it is turned now: each axis by itself. */
static double spin_energy(const hapi_local_body *body, const double inertia[3])
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    double axis[3] = {0.0, 0.0, 0.0};
    axis[i] = 1.0;
    hapi_quat_rotate(body->pose.quat_wxyz, axis, axis);
    double along = hapi_v3_dot(axis, body->twist.angular);
    sum += 0.5 * inertia[i] * along * along;
  }
  return sum;
}

/* The application turns it by a torque. Its work goes into the body, and the ledger has none. */
TEST(what_turns_a_body_is_no_loan_of_the_ledger)
{
  static const double inertia[3] = {1e-3, 2e-3, 5e-3};
  static const double torque[3] = {0.02, -0.01, 0.03};
  (void)ledger_wall(0.002);
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  hapi_model_body *body = add_body(0);
  body->flags = HAPI_BODY_OWNED;
  body->mass = 1.0;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = inertia[i];
    body->inverse_inertia[4 * i] = 1.0 / inertia[i];
  }
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->pose.position[0] = 1.0;
  hapi_v3_set(body->twist.angular, 1.0, 2.0, 2.5);
  hapi_v3_copy(torque, body->user_wrench + 3);
  model_adopt();
  f.bodies[0].entered_model = 0; /* its contacts are known: none */
  ticks_run(20);
  const double *w = f.bodies[0].twist.angular;
  double energy = spin_energy(&f.bodies[0], inertia);
  double balance = f.tick.guard.balance;
  double begun = energy;
  for (int i = 0; i < 250; ++i) {
    double before = hapi_v3_dot(torque, w);
    ticks_run(1);
    energy += 0.5 * T * (before + hapi_v3_dot(torque, w));
    double lost = energy - spin_energy(&f.bodies[0], inertia);
    CHECK_NEAR(f.tick.guard.balance - balance, lost, 1e-9);
  }
  CHECK(spin_energy(&f.bodies[0], inertia) > begun + 0.01);
}

TEST(a_tool_pays_for_its_torque_as_far_as_it_turns)
{
  hapi_pointer *p = coupling_pointer();
  hapi_v3_set(p->guard.contact.torque, 0.0, 0.0, 0.1);
  hapi_v3_set(p->guard.turned, 0.0, 0.0, 0.01);
  hapi_energy_observe(&f.tick.guard, &f.tick.facts, &f.tick.pointers, &f.tick.bodies,
                      &f.tick.touches);
  CHECK_NEAR(f.tick.guard.balance, -0.1 * 0.01, 1e-7);
}

static double grip_observe(hapi_pointer *p, double share)
{
  double before = f.tick.guard.balance;
  p->grab.share = share;
  p->grab.pull.stiffness = share * 1000.0;
  hapi_energy_observe(&f.tick.guard, &f.tick.facts, &f.tick.pointers, &f.tick.bodies,
                      &f.tick.touches);
  return f.tick.guard.balance - before;
}

/* The spring of a grip is stretched by 4 mm all the time, and holds 8 mJ with its whole share. */
TEST(what_fading_adds_to_the_spring_of_a_grip_nobody_paid_for)
{
  hapi_pointer *p = coupling_pointer();
  f.tick.pointers.grabs = true;
  p->guard.share = 1.0;
  p->device.wrench.force[0] = 1.0;
  p->grab.phase = HAPI_GRAB_HOLDS;
  hapi_v3_set(p->grab.pull.way, 4e-3, 0.0, 0.0);
  CHECK_NEAR(grip_observe(p, 0.5), 4e-3, 1e-9);
  CHECK_NEAR(grip_observe(p, 0.5), 0.0, 1e-9);
  CHECK_NEAR(grip_observe(p, 1.0), 4e-3, 1e-9);
  CHECK_NEAR(grip_observe(p, 0.25), -6e-3, 1e-9);
  CHECK_NEAR(grip_observe(p, 1.0), 6e-3, 1e-9);
  p->belief.loss = 1.0; /* the device is not believed: nothing is felt */
  CHECK_NEAR(grip_observe(p, 1.0), -8e-3, 1e-9);
  CHECK_NEAR(grip_observe(p, 1.0), 0.0, 1e-9);
}

/* F^2 / 2 k, m v^2 / 2, and of a tool the same of its turning. */
TEST(what_is_stored_between_a_device_and_its_proxy)
{
  for (int tool = 0; tool < 2; ++tool) {
    hapi_pointer *p = coupling_pointer();
    p->shape.hull = tool != 0 ? p->shape.hull : NULL;
    p->proxied = true;
    p->coupling.stiffness = 800.0;
    p->coupling.spin_stiffness = 2.0;
    p->coupling.mass = 0.05;
    p->coupling.inertia = 1e-4;
    hapi_v3_set(p->wrench.force, 0.0, 4.0, 0.0);
    hapi_v3_set(p->wrench.torque, 0.2, 0.0, 0.0);
    hapi_v3_set(p->proxy.velocity, 0.0, 0.0, 0.3);
    hapi_v3_set(p->proxy.spin, 0.0, 6.0, 0.0);
    p->device.wrench.force[1] = 4.0;
    hapi_energy_observe(&f.tick.guard, &f.tick.facts, &f.tick.pointers, &f.tick.bodies,
                        &f.tick.touches);
    double moved = 4.0 * 4.0 / 1600.0 + 0.5 * 0.05 * 0.3 * 0.3;
    double turned = 0.2 * 0.2 / 4.0 + 0.5 * 1e-4 * 36.0;
    CHECK_NEAR(f.tick.guard.stored_max, moved + (tool != 0 ? turned : 0.0), 1e-12);
  }
}

/* ---- limits ---- */

TEST(all_of_the_force_comes_in_2_ms_where_nobody_asks_for_more_time)
{
  hapi_pointer_slot slot;
  memset(&slot, 0, sizeof slot);
  slot.def.max_force = 15.0;
  slot.def.max_torque = 0.6;
  CHECK_NEAR(hapi_pointer_limits(&slot).slew_force, 15.0 / 0.002, 1e-9);
  CHECK_NEAR(hapi_pointer_limits(&slot).slew_torque, 0.6 / 0.002, 1e-9);
  slot.def.max_slew = 100.0;
  CHECK_NEAR(hapi_pointer_limits(&slot).slew_force, 100.0, 0.0);
}

/* Both come in over 20 ms: after a tick it is a twentieth. */
TEST(what_is_declared_is_wanted_and_comes_in_as_contacts_do)
{
  for (int any = 0; any < 2; ++any) {
    hapi_pointer *p = coupling_pointer();
    f.tick.guard.mode = HAP_GUARD_ON;
    p->device.limits.slew_force = p->device.limits.slew_torque = 1e9;
    p->wrench.force[0] = 1.0;
    p->declared.any = any != 0;
    p->declared.follows.force[0] = p->declared.given.force[0] = 2.0;
    hapi_tick_guard(&f.tick);
    CHECK_NEAR(p->guard.wanted.force[0], any != 0 ? 3.0 : 1.0, 1e-12);
    CHECK_NEAR(p->device.wrench.force[0], 0.05 * (any != 0 ? 3.0 : 1.0), 1e-9);
  }
}
