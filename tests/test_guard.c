/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The guard of the pure tick: what it lets through, what it holds back, and how it comes back. */

#include "tests/tap.h"

#include "base/safety.h"
#include "guard/force_guard.h"
#include "tests/tick_world.h"
#include "tick/black_box.h"

#define LIMIT 20.0     /* N */
#define STEP 10.0      /* N a tick: LIMIT in 2 ms */
#define ROUNDING 1e-12 /* of the bounds */

static hapi_pointer *guarded_pointer(uint32_t index)
{
  hapi_pointer *p = add_pointer(index, -0.1, 0.0, 0.0);
  p->device.limits.max_force = LIMIT;
  p->device.limits.max_torque = 1.0;
  p->device.limits.slew_force = STEP / T;
  p->device.limits.slew_torque = 0.5 / T;
  return p;
}

/* One pointer before a wall at x = 0, guard on. */
static hapi_pointer *guarded_wall(void)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  hapi_pointer *p = guarded_pointer(0);
  begin_model();
  f.model->period_s = 0.02;
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  ticks_run(1);
  return p;
}

/* The guard alone, with a wrench that the simulation is said to want. */
static void guard_wrench(hapi_pointer *p, double fx, double fy, double fz)
{
  hapi_v3_set(p->wrench.force, fx, fy, fz);
  hapi_v3_set(p->wrench.torque, 0.0, 0.0, 0.0);
  hapi_tick_guard(&f.tick);
}

static hapi_pointer *guarded_alone(void)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  return guarded_pointer(0);
}

/* As a run of 20 ms without force leaves it. */
static hapi_pointer *guarded_and_warm(void)
{
  hapi_pointer *p = guarded_alone();
  for (int i = 0; i < 25; ++i) {
    guard_wrench(p, 0.0, 0.0, 0.0);
  }
  return p;
}

/* ---- bounds ---- */

static uint64_t random_state = 1;

static double random_number(void) /* -1 .. 1 */
{
  random_state = random_state * 6364136223846793005u + 1442695040888963407u;
  return (double)(int64_t)(random_state & ~(uint64_t)0x7ff) / 9223372036854775808.0;
}

static void random_vector(double v[3], int decades)
{
  double size = 1.0;
  int power = (int)((random_number() + 1.0) * 0.5 * decades);
  for (int i = 0; i < power; ++i) {
    size *= 10.0;
  }
  hapi_v3_set(v, size * random_number(), size * random_number(), size * random_number());
}

static double points_distance(const double a[3], const double b[3])
{
  double apart[3];
  hapi_v3_sub(a, b, apart);
  return hapi_v3_norm(apart);
}

TEST(a_million_random_wrenches_keep_limit_and_slew)
{
  hapi_pointer *p = guarded_alone();
  p->device.pose_world_device = (hap_pose){{1.0, 2.0, 3.0}, {0.5, 0.5, -0.5, 0.5}};
  p->device.force_scale = 0.7;
  uint64_t wrong = 0;
  double largest = 0.0;
  double fastest = 0.0;
  for (int i = 0; i < 1000000; ++i) {
    hap_wrench before = p->device.wrench;
    random_vector(p->wrench.force, 12);
    random_vector(p->wrench.torque, 12);
    if (i % 5000 == 4999) {
      p->wrench.force[i % 3] = i % 2 == 0 ? (double)NAN : (double)INFINITY;
    } else if (i % 5000 == 50) {
      hapi_tick_reset_fault(&f.tick);
    }
    for (int k = 0; k < 3; ++k) {
      p->device.pose.position[k] += 1e-3 * random_number();
    }
    hapi_tick_guard(&f.tick);
    double force = hapi_v3_norm(p->device.wrench.force);
    double change = points_distance(p->device.wrench.force, before.force);
    double torque = hapi_v3_norm(p->device.wrench.torque);
    double turn = points_distance(p->device.wrench.torque, before.torque);
    wrong += !(force <= LIMIT * (1.0 + ROUNDING) && change <= STEP * (1.0 + ROUNDING) &&
               torque <= 1.0 + ROUNDING && turn <= 0.5 * (1.0 + ROUNDING));
    largest = fmax(largest, force);
    fastest = fmax(fastest, change);
  }
  CHECK(wrong == 0);
  CHECK_NEAR(largest, LIMIT, 1e-9); /* both bounds were reached */
  CHECK_NEAR(fastest, STEP, 1e-9);
  CHECK(f.tick.guard.latch.count == 200);
}

TEST(torque_has_bounds_of_its_own)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.feels_torque = true;
  for (int i = 1; i <= 3; ++i) {
    hapi_v3_set(p->wrench.force, 0.0, 0.0, 0.0);
    hapi_v3_set(p->wrench.torque, 0.0, 0.0, 3.0);
    hapi_tick_guard(&f.tick);
    check_v3(p->device.wrench.torque, 0.0, 0.0, fmin(0.5 * i, 1.0), 1e-12);
    CHECK((p->guard.flags & HAP_GUARD_SLEW) != 0);
    CHECK(((p->guard.flags & HAP_GUARD_SATURATED) != 0) == (i == 3));
  }
  p->device.limits.slew_torque = 1e6;
  hapi_v3_set(p->wrench.torque, 0.0, 0.0, 3.0);
  hapi_tick_guard(&f.tick);
  CHECK(p->guard.flags == HAP_GUARD_SATURATED);
  check_v3(p->device.wrench.torque, 0.0, 0.0, 1.0, 1e-12);
}

TEST(a_wrench_is_used_as_long_as_each_of_its_numbers_can_be)
{
  for (int i = 0; i < 2; ++i) {
    hapi_pointer *p = guarded_and_warm();
    p->device.feels_torque = true;
    double *wanted = i == 0 ? p->wrench.force : p->wrench.torque;
    for (int k = 0; k < 3; ++k) {
      hapi_v3_set(wanted, 0.9e12, 0.9e12, 0.9e12); /* their sum of squares is beyond */
      hapi_tick_guard(&f.tick);
    }
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE);
    const double *given = i == 0 ? p->device.wrench.force : p->device.wrench.torque;
    CHECK_NEAR(hapi_v3_norm(given), i == 0 ? LIMIT : 1.0, 1e-9);
    hapi_v3_set(wanted, 0.0, 0.0, 1.1e12);
    hapi_tick_guard(&f.tick);
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE);
  }
}

/* Whatever went wrong between the first check and the last. */
TEST(nothing_but_numbers_is_written)
{
  for (int i = 0; i < 2; ++i) {
    hapi_pointer *p = guarded_and_warm();
    guard_wrench(p, 5.0, 0.0, 0.0);
    hapi_v3_set(p->wrench.force, 5.0, 0.0, 0.0);
    hapi_guard_begin(&f.tick.guard, &f.tick.facts, &f.tick.pointers);
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE);
    (i == 0 ? p->device.wrench.force : p->device.wrench.torque)[1] = (double)NAN;
    hapi_guard_write(&f.tick.guard, T, &f.tick.pointers);
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE && f.tick.guard.latch.pointer == 1);
    CHECK(p->guard.flags == HAP_GUARD_FAULT);
    check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
    check_v3(p->device.wrench.torque, 0.0, 0.0, 0.0, 0.0);
    check_v3(p->guard.written.force, 0.0, 0.0, 0.0, 0.0);
  }
}

/* ---- a device that is not believed ---- */

TEST(a_pointer_comes_in_when_its_device_is_believed)
{
  hapi_pointer *p = guarded_alone();
  p->belief.doubted = true;
  for (int i = 0; i < 30; ++i) {
    guard_wrench(p, 10.0, 0.0, 0.0);
    check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
    CHECK((p->guard.flags & HAP_GUARD_INPUT) != 0);
  }
  p->belief.doubted = false;
  for (int i = 1; i <= 20; ++i) {
    guard_wrench(p, 10.0, 0.0, 0.0);
    check_v3(p->device.wrench.force, 0.5 * i, 0.0, 0.0, 1e-9);
  }
  p->belief.doubted = true; /* one that is in already stays */
  guard_wrench(p, 10.0, 0.0, 0.0);
  check_v3(p->device.wrench.force, 10.0, 0.0, 0.0, 1e-9);
}

TEST(a_torque_that_no_motion_explains_comes_in_slowly)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.feels_torque = true;
  p->device.speed_limit = 10.0;
  p->belief.doubt_s = 0.01;
  hapi_v3_set(p->wrench.force, 0.0, 0.0, 0.0);
  hapi_v3_set(p->wrench.torque, 0.0, 0.0, 0.5);
  hapi_tick_guard(&f.tick);
  check_v3(p->device.wrench.torque, 0.0, 0.0, 1.0 / 30.0, 1e-9);
  CHECK((p->guard.flags & HAP_GUARD_INPUT) != 0);
}

/* The force that a way explains has a grip of 5 cm as its arm. */
TEST(a_way_explains_the_torque_of_a_grip)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.feels_torque = true;
  p->device.speed_limit = 10.0;
  f.tick.facts.model = HAP_MODEL_CONTACT;
  guard_wrench(p, 0.0, 0.0, 0.0);
  p->guard.change.explained = (hapi_explained){.stiffness = 1000.0};
  p->device.pose.position[0] -= 2e-3;
  hapi_v3_set(p->wrench.torque, 0.0, 0.0, -0.5);
  hapi_tick_guard(&f.tick);
  CHECK_NEAR(p->device.wrench.torque[2], -(0.05 * 1000.0 * 2e-3 + 1.0 / 30.0), 1e-9);
}

/* Its corner goes 2 mm; after a jump nobody knows how far. */
TEST(a_turn_of_a_tool_explains_the_way_of_its_corners)
{
  static const hapi_tool_hull hull;
  for (int jumped = 0; jumped < 2; ++jumped) {
    hapi_pointer *p = guarded_and_warm();
    p->device.speed_limit = 10.0;
    p->shape.hull = &hull;
    p->shape.extent = 0.1;
    f.tick.facts.model = HAP_MODEL_CONTACT;
    guard_wrench(p, 0.0, 0.0, 0.0);
    guard_wrench(p, 0.0, 0.0, 0.0);
    p->guard.change.explained = (hapi_explained){.stiffness = 1000.0};
    p->device.jumped = jumped != 0;
    p->device.pose.quat_wxyz[3] = sin(0.5 * 0.02);
    p->device.pose.quat_wxyz[0] = -cos(0.5 * 0.02); /* the same turn */
    p->device.pose.quat_wxyz[3] *= -1.0;
    guard_wrench(p, -9.0, 0.0, 0.0);
    CHECK_NEAR(p->device.wrench.force[0], -((jumped != 0 ? 0.0 : 2.0) + LIMIT / 30.0), 1e-3);
  }
}

/* The device is held, and its base goes on. */
TEST(the_way_of_a_base_explains_as_that_of_the_device)
{
  for (int moves = 0; moves < 2; ++moves) {
    hapi_pointer *p = guarded_and_warm();
    p->device.speed_limit = 10.0;
    f.tick.facts.model = HAP_MODEL_CONTACT;
    f.tick.facts.observes = false;
    guard_wrench(p, 0.0, 0.0, 0.0);
    p->guard.change.explained = (hapi_explained){.stiffness = 1000.0, .damping = 4.0};
    p->guard.change.before = p->guard.change.explained;
    p->frame.used = moves != 0;
    p->frame.step[0] = 2e-3;
    p->frame.carries.linear[0] = 0.5;
    guard_wrench(p, -9.0, 0.0, 0.0);
    CHECK_NEAR(p->device.wrench.force[0], -((moves != 0 ? 2.0 + 2.0 : 0.0) + LIMIT / 30.0), 1e-9);
  }
}

TEST(a_force_beyond_the_limit_comes_to_it_in_its_own_direction)
{
  hapi_pointer *p = guarded_and_warm();
  for (int i = 0; i < 20; ++i) {
    guard_wrench(p, 0.0, 20.0, 0.0);
  }
  check_v3(p->device.wrench.force, 0.0, 20.0, 0.0, 1e-12);
  for (int i = 0; i < 80; ++i) { /* along the sphere: what is left falls to 2/3 a tick */
    guard_wrench(p, 3e11, 0.0, -4e11);
  }
  check_v3(p->device.wrench.force, 12.0, 0.0, -16.0, 1e-9);
  CHECK(p->guard.flags == HAP_GUARD_SATURATED ||
        p->guard.flags == (HAP_GUARD_SATURATED | HAP_GUARD_SLEW));
}

/* ---- order ---- */

TEST(the_ramp_comes_before_slew_and_slew_before_saturation)
{
  hapi_pointer *p = guarded_alone();
  guard_wrench(p, 120.0, 0.0, 0.0); /* 1/20 of it; saturated first it would be 1 N */
  check_v3(p->device.wrench.force, 6.0, 0.0, 0.0, 1e-12);
  CHECK(p->guard.flags == HAP_GUARD_RAMP_IN);
  guard_wrench(p, 3000.0, 0.0, 0.0); /* 300 N, of which one step is made */
  check_v3(p->device.wrench.force, 16.0, 0.0, 0.0, 1e-12);
  CHECK(p->guard.flags == (HAP_GUARD_RAMP_IN | HAP_GUARD_SLEW));
  guard_wrench(p, 3000.0, 0.0, 0.0);
  check_v3(p->device.wrench.force, 20.0, 0.0, 0.0, 1e-12);
  CHECK(p->guard.flags == (HAP_GUARD_RAMP_IN | HAP_GUARD_SLEW | HAP_GUARD_SATURATED));
  check_v3(p->guard.wanted.force, 3000.0, 0.0, 0.0, 0.0);
}

TEST(what_the_observer_takes_goes_at_the_slew_bound)
{
  hapi_pointer *p = guarded_and_warm();
  guard_wrench(p, 10.0, 0.0, 0.0);
  guard_wrench(p, 19.0, 0.0, 0.0);
  CHECK(p->guard.flags == 0); /* it stands still: nothing flows */
  for (int i = 0; i < 2; ++i) {
    p->device.pose.position[0] += 1e-3; /* 19 N along 1 mm: 19 mJ of nothing */
    guard_wrench(p, 19.0, 0.0, 0.0);
    CHECK((p->guard.flags & HAP_GUARD_ENERGY) != 0);
    check_v3(p->device.wrench.force, i == 0 ? 9.0 : 0.0, 0.0, 0.0, 1e-9);
  }
  p->device.pose.position[0] += 1e-3;
  guard_wrench(p, 5.0, 7.0, 0.0); /* across the motion it may push */
  check_v3(p->device.wrench.force, 0.0, 7.0, 0.0, 1e-9);
  p->device.pose.position[0] -= 2e-3;
  guard_wrench(p, 5.0, 7.0, 0.0); /* and against it */
  check_v3(p->device.wrench.force, 5.0, 7.0, 0.0, 1e-9);
  CHECK(p->guard.flags == 0 && f.tick.guard.energy_ticks == 3);
}

/* Nor more than motion explains, while the device is doubted: the way may be none. */
TEST(what_the_observer_takes_of_a_doubted_device_goes_slowly)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.speed_limit = 10.0;
  p->belief.doubt_s = 1e-3;
  for (int i = 0; i < 30; ++i) {
    guard_wrench(p, 15.0, 0.0, 0.0);
  }
  CHECK_NEAR(p->device.wrench.force[0], 15.0, 1e-9);
  for (int i = 1; i <= 3; ++i) {
    p->device.pose.position[0] += 1e-3;
    guard_wrench(p, 15.0, 0.0, 0.0);
    CHECK((p->guard.flags & HAP_GUARD_ENERGY) != 0);
    CHECK_NEAR(p->device.wrench.force[0], 15.0 - i * LIMIT / 30.0, 1e-9);
  }
  p->belief.loss = 0.5; /* what doubt takes goes at once, and the rest as before */
  guard_wrench(p, 15.0, 0.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], 7.5, 1e-9);
  p->device.pose.position[0] += 1e-3;
  guard_wrench(p, 15.0, 0.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], 7.5 - LIMIT / 30.0, 1e-9);
  p->belief.doubt_s = 0.0;
  p->device.pose.position[0] += 1e-3;
  guard_wrench(p, 15.0, 0.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], 0.0, 1e-9);
  p->belief.doubt_s = 1e-3;
  p->device.feels_torque = true;
  p->guard.contact = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.4}};
  p->guard.written = p->guard.contact;
  p->guard.change.most_torque = 0.01;
  p->guard.flags = 0;
  memset(&p->device.wrench, 0, sizeof p->device.wrench);
  hapi_guard_write(&f.tick.guard, T, &f.tick.pointers);
  CHECK_NEAR(p->device.wrench.torque[2], 0.39, 1e-9);
  CHECK(p->guard.flags == HAP_GUARD_INPUT);
}

/* After a gap a force that rises does so slowly, whatever the observer took of it. */
TEST(a_force_that_the_observer_cut_and_that_rises_is_late_all_the_same)
{
  const double late = T * LIMIT / HAPI_SAFETY_LATE_SLEW_S;
  for (int falls = 0; falls < 2; ++falls) {
    hapi_pointer *p = guarded_and_warm();
    f.tick.guard.late.slew_s = 0.01;
    p->guard.flags = HAP_GUARD_ENERGY;
    p->guard.written.force[0] = 10.0;
    p->device.wrench.force[0] = falls != 0 ? 4.0 : 18.0;
    hapi_guard_write(&f.tick.guard, T, &f.tick.pointers);
    CHECK_NEAR(p->device.wrench.force[0], falls != 0 ? 4.0 : 10.0 + late, 1e-12);
  }
}

/* ---- ramp-in, faults, reset ---- */

static void check_ramp_in(hapi_pointer *p)
{
  for (int i = 1; i <= 25; ++i) {
    guard_wrench(p, 0.0, 4.0, 0.0);
    CHECK_NEAR(p->device.wrench.force[1], fmin(4.0 * i / 20.0, 4.0), 1e-12);
    CHECK(((p->guard.flags & HAP_GUARD_RAMP_IN) != 0) == (i < 20));
    CHECK_NEAR(p->wrench.force[1], p->device.wrench.force[1], 1e-12); /* what is felt is reported */
  }
}

TEST(a_pointer_comes_in_over_20_ms_and_so_after_a_reset)
{
  hapi_pointer *p = guarded_alone();
  check_ramp_in(p);
  hapi_tick_fault(&f.tick, HAP_FAULT_WORLD, 0);
  for (int i = 0; i < 50; ++i) {
    guard_wrench(p, 0.0, 4.0, 0.0);
  }
  hapi_tick_reset_fault(&f.tick);
  check_ramp_in(p);
  CHECK(f.tick.guard.latch.count == 1 && f.tick.guard.slewed_ticks == 0);
}

/* A slew limit that is meant for touch must not keep the motors on for minutes. */
TEST(a_fault_takes_the_force_away_in_100_ms_whatever_the_slew_limit)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.limits.slew_force = p->device.limits.slew_torque = 1e-3;
  p->guard.written.force[1] = LIMIT;
  p->guard.written.torque[0] = 1.0;
  hapi_tick_fault(&f.tick, HAP_FAULT_WORLD, 0);
  double before = LIMIT;
  for (int i = 0; i < 100; ++i) {
    guard_wrench(p, 0.0, LIMIT, 0.0);
    CHECK(before - p->device.wrench.force[1] <= LIMIT / 100.0 + 1e-9);
    before = p->device.wrench.force[1];
  }
  CHECK_NEAR(hapi_v3_norm(p->device.wrench.force), 0.0, 1e-9);
  CHECK_NEAR(hapi_v3_norm(p->device.wrench.torque), 0.0, 1e-9);
}

TEST(a_reset_of_no_fault_changes_nothing)
{
  hapi_pointer *p = guarded_and_warm();
  hapi_tick_reset_fault(&f.tick);
  guard_wrench(p, 0.0, 4.0, 0.0);
  check_v3(p->device.wrench.force, 0.0, 4.0, 0.0, 0.0);
}

TEST(a_force_that_is_not_finite_ramps_from_the_last_good_one_to_zero)
{
  static const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e200};
  for (int i = 0; i < 4; ++i) {
    hapi_pointer *p = guarded_and_warm();
    hapi_pointer *other = guarded_pointer(2);
    other->guard.share = 1.0;
    hapi_v3_set(other->wrench.force, 0.0, 3.0, 0.0);
    guard_wrench(p, 10.0, 0.0, 0.0);
    guard_wrench(p, 16.0, 0.0, 0.0);
    guard_wrench(p, 16.0, bad[i], 0.0);
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE && f.tick.guard.latch.pointer == 1 &&
          f.tick.guard.latch.count == 1);
    check_v3(p->device.wrench.force, 6.0, 0.0, 0.0, 1e-12);
    check_v3(p->wrench.force, 6.0, 0.0, 0.0, 1e-12);
    check_v3(other->device.wrench.force, 0.0, 0.0, 0.0, 0.0); /* 3 N are within one step */
    guard_wrench(p, 16.0, 0.0, 0.0);                          /* the cause has gone */
    check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
    guard_wrench(p, 16.0, 0.0, 0.0);
    check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
    CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE && (p->guard.flags & HAP_GUARD_FAULT) != 0);
  }
}

TEST(a_torque_that_is_not_finite_is_a_fault_too)
{
  hapi_pointer *p = guarded_and_warm();
  p->wrench.torque[2] = (double)NAN;
  hapi_tick_guard(&f.tick);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE);
  check_v3(p->device.wrench.torque, 0.0, 0.0, 0.0, 0.0);
}

/* ---- what is reported ---- */

static void torque_guarded(hapi_pointer *p, double z)
{
  hapi_v3_set(p->wrench.force, 1.0, 0.0, 0.0);
  hapi_v3_set(p->wrench.torque, 0.0, 0.0, z);
  hapi_tick_guard(&f.tick);
}

TEST(torque_is_reported_where_a_hand_feels_it)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.three_dof = false;
  p->device.feels_torque = true;
  torque_guarded(p, 0.1);
  CHECK_NEAR(p->wrench.torque[2], 0.1, 1e-12);
  p->device.feels_torque = false;
  torque_guarded(p, 0.1);
  CHECK(p->wrench.torque[2] == 0.0 && p->wrench.force[0] == 1.0);
  p->device.feels_torque = true;
  p->device.three_dof = true;
  torque_guarded(p, 0.1);
  CHECK(p->wrench.torque[2] == 0.0 && p->wrench.force[0] == 1.0);
}

/* Nothing is felt there, so nothing can be taken back from what was written. */
TEST(a_fault_is_reported_as_no_force_at_a_force_scale_of_0)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.force_scale = 0.0;
  guard_wrench(p, 3.0, 0.0, 0.0);
  CHECK(p->wrench.force[0] == 3.0); /* of the world, as no limit of the device was met */
  guard_wrench(p, (double)NAN, 0.0, 0.0);
  CHECK(hapi_v3_norm(p->wrench.force) == 0.0 && hapi_v3_norm(p->device.wrench.force) == 0.0);
}

TEST(the_first_fault_is_the_one_that_stays)
{
  hapi_pointer *p = guarded_and_warm();
  (void)guarded_pointer(1);
  hapi_tick_fault(&f.tick, HAP_FAULT_DEVICE_POSE, 2);
  guard_wrench(p, (double)NAN, 0.0, 0.0);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_DEVICE_POSE && f.tick.guard.latch.pointer == 2 &&
        f.tick.guard.latch.count == 1);
}

TEST(a_device_that_failed_is_zeroed_at_once)
{
  hapi_pointer *p = guarded_and_warm();
  guard_wrench(p, 10.0, 0.0, 0.0);
  guard_wrench(p, 20.0, 0.0, 0.0);
  hapi_tick_fault(&f.tick, HAP_FAULT_DEVICE_READ, 1);
  hapi_guard_cut(p);
  guard_wrench(p, 20.0, 0.0, 0.0);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
  hapi_tick_reset_fault(&f.tick);
  check_ramp_in(p);
}

TEST(a_measuring_guard_keeps_checks_and_limits_alone)
{
  hapi_pointer *p = guarded_alone();
  f.tick.guard.mode = HAP_GUARD_MEASURE;
  guard_wrench(p, 19.0, 0.0, 0.0);
  check_v3(p->device.wrench.force, 19.0, 0.0, 0.0, 0.0);
  p->device.pose.position[0] += 0.01;
  guard_wrench(p, 0.0, -40.0, 0.0);
  check_v3(p->device.wrench.force, 0.0, -20.0, 0.0, 1e-12);
  CHECK(p->guard.flags == HAP_GUARD_SATURATED);
  guard_wrench(p, (double)NAN, 0.0, 0.0);
  check_v3(p->device.wrench.force, 0.0, 0.0, 0.0, 0.0);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE);
}

/* ---- age ---- */

/* A tick, with a new model when it is due: every 20 ms, and none from 200 ms on for 200 ms. */
static void stalled_tick(int tick)
{
  if (tick % 20 == 0 && (tick < 200 || tick >= 400)) {
    begin_model();
    f.model->period_s = 0.02;
    (void)add_contact(0, HAPI_SLOT_NONE, 0);
    model_adopt();
  }
  ticks_run(1);
}

TEST(a_stall_takes_the_force_down_and_the_next_model_brings_it_back)
{
  hapi_pointer *p = guarded_wall();
  double before = 0.0;
  double fastest = 0.0;
  hapi_v3_set(p->device.pose.position, -0.005, 0.0, 0.0); /* 5 mm deep, at rest: 5 N */
  for (int tick = 0; tick < 500; ++tick) {
    stalled_tick(tick);
    double force = -p->device.wrench.force[0];
    fastest = tick >= 50 ? fmax(fastest, fabs(force - before)) : 0.0;
    before = force;
    bool stale = (p->guard.flags & HAP_GUARD_STALE) != 0;
    if ((tick >= 50 && tick <= 220) || tick >= 420) { /* a step after the recovery: all of it */
      CHECK_NEAR(force, 5.0, 1e-9);
      CHECK(!stale && p->guard.flags == 0);
    } else if (tick >= 330 && tick < 400) {
      CHECK_NEAR(force, 0.0, 1e-9);
      CHECK(stale);
    }
  }
  CHECK(fastest <= 5.0 / 20.0 + 1e-9); /* down in 100 ms, up in one step of physics */
  CHECK(f.tick.guard.stale_times == 1 && f.tick.guard.latch.fault == HAP_FAULT_NONE);
  CHECK(f.tick.guard.stale_ticks >= 170 && f.tick.guard.stale_ticks <= 180);
}

TEST(a_model_of_two_steps_is_not_too_old)
{
  hapi_pointer *p = guarded_wall();
  hapi_v3_set(p->device.pose.position, -0.005, 0.0, 0.0);
  int64_t state_ns = f.tick.facts.state_ns;
  while (f.now_ns <= state_ns + 41 * TICK_NS) { /* two steps and a tick */
    ticks_run(1);
    CHECK(!f.tick.guard.stale);
  }
  ticks_run(1);
  CHECK(f.tick.guard.stale);
}

/* Of 20 ms: two steps, the round trip that both ends have agreed on, and a tick. */
TEST(a_model_that_the_network_holds_back_is_not_too_old_and_an_outage_takes_100_ms)
{
  hapi_pointer *p = guarded_wall();
  begin_model();
  f.model->period_s = 0.02;
  f.model->look_ahead_s = 0.23;
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  hapi_v3_set(p->device.pose.position, -0.005, 0.0, 0.0);
  int64_t state_ns = f.tick.facts.state_ns;
  while (f.now_ns <= state_ns + 271 * TICK_NS) {
    ticks_run(1);
    CHECK(!f.tick.guard.stale);
  }
  CHECK_NEAR(p->device.wrench.force[0], -5.0, 1e-9);
  ticks_run(1);
  CHECK(f.tick.guard.stale && p->device.wrench.force[0] > -5.0);
  ticks_run(98);
  CHECK(p->device.wrench.force[0] < -1e-3);
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], 0.0, 1e-9);
}

TEST(without_a_model_and_in_model_single_nothing_grows_old)
{
  hapi_pointer *p = guarded_alone();
  f.now_ns = 1000 * TICK_NS;
  ticks_run(50);
  CHECK(f.tick.guard.stale_times == 0);
  begin_model();
  f.model->model = HAP_MODEL_SINGLE;
  f.model->period_s = T;
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  hapi_v3_set(p->device.pose.position, -0.005, 0.0, 0.0);
  ticks_run(10); /* models late by a few ms are no reason */
  CHECK(f.tick.guard.stale_times == 0);
  ticks_run(10);
  CHECK(f.tick.guard.stale_times == 1);
}

/* ---- energy ---- */

typedef struct energy {
  double gained; /* J, by the hand, from the wrench held over each tick */
  double most;   /* J, largest gain at any time */
  double stored; /* J, largest in the spring */
  double peak;   /* N */
} energy;

/* The hand goes 10 mm to and fro about the wall's surface, at hz; a device that is scale times
 * smaller and weaker. The work is taken from what was written and where the device was, nothing
 * else. */
static energy tap_wall(hap_guard mode, double scale, double hz, double damping, int ticks)
{
  const double depth = 0.01;
  energy e = {0.0, 0.0, 0.0, 0.0};
  hapi_pointer *p = guarded_wall();
  f.tick.guard.mode = mode;
  p->device.motion_scale = scale;
  p->device.force_scale = 1.0 / scale;
  p->surface.damping = damping;
  f.tick.facts.physics_period = 0.0; /* the wall does not grow old */
  for (int i = 0; i < ticks; ++i) {
    double angle = 2.0 * 3.14159265358979 * hz * T * i;
    double x = -0.01 - depth * cos(angle);
    double moved = x / scale - p->device.pose.position[0];
    e.gained += i > 0 ? scale * scale * p->device.wrench.force[0] * moved : 0.0;
    e.most = fmax(e.most, e.gained);
    p->device.pose.position[0] = x / scale;
    p->device.twist.linear[0] = 2.0 * 3.14159265358979 * hz * depth * sin(angle) / scale;
    ticks_run(1);
    double deep = fmax(x + 0.01, 0.0);
    e.stored = fmax(e.stored, 0.5 * p->surface.stiffness * deep * deep);
    e.peak = fmax(e.peak, hapi_v3_norm(p->wrench.force));
  }
  return e;
}

TEST(a_wall_held_over_ticks_gives_back_no_more_than_was_put_in)
{
  /* k v^2 T^2 / 2 a tick is what holding the force makes of nothing (Colgate, Schenkel). */
  energy bare = tap_wall(HAP_GUARD_MEASURE, 1.0, 5.0, 0.0, 10000);
  energy kept = tap_wall(HAP_GUARD_ON, 1.0, 5.0, 0.0, 10000);
  printf("# of %.3g J stored: %.3g bare, %.3g guarded, peak %.4g and %.4g N, %llu ticks\n",
         bare.stored, bare.most, kept.most, bare.peak, kept.peak,
         (unsigned long long)f.tick.guard.energy_ticks);
  CHECK(bare.most > 0.5 * bare.stored); /* of 50 taps */
  CHECK(kept.most <= 0.01 * kept.stored + 1e-6);
  CHECK(kept.peak >= 0.98 * bare.peak);
}

TEST(energy_counts_in_the_world_whatever_the_scales)
{
  energy kept = tap_wall(HAP_GUARD_ON, 5.0, 5.0, 0.0, 10000);
  CHECK(kept.most > 0.005 * kept.stored && kept.most <= 0.01 * kept.stored);
}

TEST(a_damper_that_drives_is_held_back)
{
  energy bare = tap_wall(HAP_GUARD_MEASURE, 1.0, 3.0, -20.0, 3000);
  energy kept = tap_wall(HAP_GUARD_ON, 1.0, 3.0, -20.0, 3000);
  printf("# of %.3g J stored: %.3g bare, %.3g guarded\n", bare.stored, bare.most, kept.most);
  CHECK(bare.most > bare.stored);
  CHECK(kept.most <= 0.01 * kept.stored + 1e-5);
}

TEST(a_wall_with_a_damper_is_left_alone)
{
  energy kept = tap_wall(HAP_GUARD_ON, 1.0, 5.0, 5.0, 10000);
  CHECK(f.tick.guard.energy_ticks == 0 && kept.peak > 9.0);
}

/* Against x, at a speed [m/s]. */
static void body_comes(double mass, double from, double speed)
{
  hapi_model_body *body = add_body(0);
  body->flags = HAPI_BODY_OWNED;
  body->mass = mass;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = 1e-3;
    body->inverse_inertia[4 * i] = 1e3;
  }
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->pose.position[0] = from;
  body->twist.linear[0] = -speed;
}

/* A body of 1 kg comes at 0.5 m/s, at a hand of 0.3 kg on a spring of hand_k [N/m]; 0: at rest. The
 * largest sum of what the hand has gained and the body still has goes to *out_total. */
static double wall_impact(hap_guard mode, double hand_k, double *out_total)
{
  set_up();
  f.tick.guard.mode = mode;
  hapi_pointer *p = guarded_pointer(0);
  p->surface.stiffness = 500.0;
  p->device.speed_limit = 10.0;
  hapi_v3_set(p->device.pose.position, 0.0, 0.0, 0.0);
  f.model->model = HAP_MODEL_CONTACT;
  begin_model();
  body_comes(1.0, 0.06, 0.5);
  hapi_model_contact *c = add_contact(0, 0, 0);
  c->point_body[0] = -0.02;
  model_adopt();
  double peak = 0.0;
  double speed = 0.0;
  double gained = 0.0;
  *out_total = 0.0;
  for (int i = 0; i < 160; ++i) {
    ticks_run(1);
    double force = p->device.wrench.force[0];
    peak = fmax(peak, fabs(force));
    if (hand_k > 0.0) {
      speed += T * (force - hand_k * p->device.pose.position[0]) / 0.3;
      p->device.pose.position[0] += T * speed;
      p->device.twist.linear[0] = speed;
      gained += force * T * speed;
    }
    double v = f.bodies[0].twist.linear[0];
    *out_total = fmax(*out_total, gained + 0.5 * v * v);
  }
  return peak;
}

TEST(an_honest_impact_is_felt_whole)
{
  static const double hands[] = {0.0, 100.0, 1000.0};
  for (int i = 0; i < 3; ++i) {
    double total[2];
    double bare = wall_impact(HAP_GUARD_MEASURE, hands[i], &total[0]);
    double kept = wall_impact(HAP_GUARD_ON, hands[i], &total[1]);
    printf("# hand of %g N/m: peak %.4g N, guarded %.4g; of 0.125 J at most %.5g, guarded %.5g\n",
           hands[i], bare, kept, total[0], total[1]);
    CHECK(bare > 2.0 && fabs(kept - bare) <= 0.02 * bare);
    CHECK(hands[i] > 0.0 || f.tick.guard.energy_ticks == 0);
    CHECK(total[1] <= 1.01 * 0.125); /* J that the body brought */
  }
}

/* A hand of 0.2 kg comes at a wall, or a body of 0.2 kg at the hand at rest. The largest force, and
 * all flags in *out_flags. */
static double fast_impact(hap_guard mode, double stiffness, double speed, bool of_body,
                          uint32_t *out_flags)
{
  double v = of_body ? 0.0 : speed;
  double peak = 0.0;
  set_up();
  f.tick.guard.mode = mode;
  hapi_pointer *p = guarded_pointer(0);
  p->device.limits.max_force = 100.0;
  p->device.limits.slew_force = 1e6;
  p->device.speed_limit = 10.0;
  p->surface.stiffness = stiffness;
  p->surface.damping = 2.0;
  hapi_v3_set(p->device.pose.position, of_body ? 0.0 : -0.0303, 0.0, 0.0);
  f.model->model = HAP_MODEL_CONTACT;
  begin_model();
  if (of_body) {
    body_comes(0.2, 0.0603, speed);
  }
  hapi_model_contact *c = add_contact(0, of_body ? 0 : HAPI_SLOT_NONE, 0);
  c->point_body[0] = of_body ? -0.02 : 0.0;
  model_adopt();
  p->guard.share = 1.0;
  *out_flags = 0;
  for (int i = 0; i < 100; ++i) {
    ticks_run(1);
    double force = p->device.wrench.force[0];
    peak = fmax(peak, fabs(force));
    *out_flags |= p->guard.flags;
    if (!of_body) {
      v += T * force / 0.2;
      p->device.pose.position[0] += T * v;
      p->device.twist.linear[0] = v;
    }
  }
  return peak;
}

TEST(an_impact_at_1_m_s_is_felt_whole_at_the_rated_stiffness)
{
  for (int i = 0; i < 6; ++i) {
    const double stiffness = i % 3 == 0 ? 1000.0 : i % 3 == 1 ? 3000.0 : 8000.0;
    uint32_t flags[2];
    double bare = fast_impact(HAP_GUARD_MEASURE, stiffness, 1.0, i >= 3, &flags[0]);
    double kept = fast_impact(HAP_GUARD_ON, stiffness, 1.0, i >= 3, &flags[1]);
    printf("# %s at 1 m/s, %g N/m: %.4g N, guarded %.4g\n", i >= 3 ? "body" : "hand", stiffness,
           bare, kept);
    CHECK(bare > 10.0 && fabs(kept - bare) <= 0.02 * bare);
    CHECK((flags[1] & HAP_GUARD_INPUT) == 0);
  }
}

/* Force of a pointer that is held, which no motion explains: with the largest force in 30 ms. */
TEST(what_no_motion_explains_comes_in_slowly)
{
  hapi_pointer *p = guarded_and_warm();
  p->device.speed_limit = 10.0;
  f.tick.facts.model = HAP_MODEL_CONTACT;
  for (int i = 1; i <= 20; ++i) {
    guard_wrench(p, -9.9, 0.0, 0.0);
    CHECK_NEAR(p->device.wrench.force[0], -fmin(i * LIMIT / 30.0, 9.9), 1e-9);
    CHECK(((p->guard.flags & HAP_GUARD_INPUT) != 0) == (i < 15));
  }
  guard_wrench(p, -5.0, 3.0, 0.0); /* what falls, falls at once; what comes beside it does not */
  CHECK_NEAR(p->device.wrench.force[0], -5.0, 1e-9);
  CHECK_NEAR(p->device.wrench.force[1], LIMIT / 30.0, 1e-9);
  guard_wrench(p, 5.0, 0.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], LIMIT / 30.0, 1e-9);
  guard_wrench(p, 0.0, 0.0, 0.0);
  CHECK(p->device.wrench.force[0] == 0.0);
  p->device.speed_limit = 0.0; /* the application moves it */
  guard_wrench(p, -5.0, 0.0, 0.0);
  CHECK(p->device.wrench.force[0] == -5.0);
}

/* Into a wall by 5 mm in a tick: of a hand that is believed, and of one that was not a moment ago
 * and went at 0.5 m/s. Then a jump away from it. */
TEST(a_way_explains_stiffness_times_it)
{
  const double slow = LIMIT / 30.0;
  for (int doubted = 0; doubted < 2; ++doubted) {
    hapi_pointer *p = guarded_wall();
    p->device.speed_limit = 10.0;
    p->device.pose.position[0] = -0.01;
    p->guard.share = 1.0;
    f.tick.facts.physics_period = 0.0;
    f.tick.facts.observes = false; /* nobody paid for the 5 mm */
    ticks_run(3);
    p->device.pose.position[0] = -0.005;
    p->belief.doubted = doubted != 0;
    p->belief.doubt_s = doubted != 0 ? 1e-3 : 0.0;
    p->belief.way.velocity_before[0] = 0.5;
    ticks_run(1);
    CHECK_NEAR(p->device.wrench.force[0], doubted != 0 ? -(0.5 + slow) : -5.0, 1e-9);
    ticks_run(20);
    CHECK_NEAR(p->device.wrench.force[0], -5.0, 1e-9);
    p->device.pose.position[0] = -0.007;
    p->belief.jumped = true;
    p->belief.doubt_s = 1e-3;
    ticks_run(1);
    p->belief.jumped = false;
    CHECK_NEAR(p->device.wrench.force[0], -(5.0 - slow), 1e-9);
    ticks_run(8);
    CHECK_NEAR(p->device.wrench.force[0], -3.0, 1e-9);
  }
}

/* A body presses against a hand that gives way at 0.05 m/s: with its weight, or because it is
 * driven. The hand gains energy all the time, and the world loses it. */
static void yield_to(uint32_t flags, hap_model model)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  hapi_pointer *p = guarded_pointer(0);
  f.model->model = model;
  begin_model();
  hapi_model_body *body = add_body(0);
  body->flags = flags;
  body->mass = 0.2;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = 1e-3;
    body->inverse_inertia[4 * i] = 1e3;
  }
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->gravity[0] = -10.0;
  body->pose.position[0] = 0.028; /* 2 mm deep: 2 N */
  body->twist.linear[0] = -0.05;
  hapi_model_contact *c = add_contact(0, 0, 0);
  c->point_body[0] = -0.02;
  model_adopt();
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  patches->model_number = f.model->number;
  patches->contact_count = 0;
  hapi_tick_adopt_patches(&f.tick, patches);
  f.contacts[0].seen = true; /* no ramp of its own */
  f.contacts[0].ramp.share = 1.0;
  p->guard.share = 1.0;
  for (int i = 0; i < 2000; ++i) { /* 100 mm: 0.2 J, a hundred times what the spring holds */
    p->device.pose.position[0] = -0.05 * T * i;
    p->device.twist.linear[0] = -0.05;
    ticks_run(1);
    CHECK_NEAR(p->device.wrench.force[0], -2.0, 0.05);
  }
  CHECK(f.tick.guard.energy_ticks == 0 && f.tick.guard.stored_max < 0.01);
}

TEST(what_a_weight_or_a_drive_gives_is_felt)
{
  yield_to(HAPI_BODY_OWNED, HAP_MODEL_CONTACT);
  yield_to(HAPI_BODY_DRIVEN, HAP_MODEL_CONTACT);
  yield_to(HAPI_BODY_DRIVEN, HAP_MODEL_ACCELERANCE);
}

TEST(a_device_has_not_moved_when_it_is_first_seen)
{
  hapi_pointer *p = guarded_alone(); /* 0.1 m from its origin, on the side that it is pushed to */
  for (int again = 0; again < 2; ++again) {
    p->guard.share = 1.0;
    guard_wrench(p, -4.0, 0.0, 0.0);
    check_v3(p->device.wrench.force, -4.0, 0.0, 0.0, 0.0);
    hapi_tick_fault(&f.tick, HAP_FAULT_DEVICE_POSE, 1);
    p->device.pose.position[0] = (double)NAN;
    guard_wrench(p, 0.0, 0.0, 0.0);
    p->device.pose.position[0] = -0.3; /* where it is put meanwhile */
    hapi_tick_reset_fault(&f.tick);
  }
  CHECK(f.tick.guard.energy_ticks == 0);
}

/* 5 mm deep in two walls, 5 N and 12.5 mJ each; pressed in within the ledger. */
static hapi_pointer *pressed_in_two(void)
{
  hapi_pointer *p = guarded_wall();
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  (void)add_contact(1, HAPI_SLOT_NONE, 0);
  model_adopt();
  f.tick.facts.physics_period = 0.0; /* the walls do not grow old */
  p->guard.share = 1.0;
  for (int i = -100; i <= 50; ++i) {
    p->device.pose.position[0] = -0.01 + 1e-4 * i;
    ticks_run(1);
  }
  CHECK_NEAR(p->device.wrench.force[0], -10.0, 1e-9);
  CHECK_NEAR(f.tick.guard.balance, 0.025, 1e-3);
  return p;
}

TEST(the_spring_of_a_contact_that_vanishes_is_lost)
{
  hapi_pointer *p = pressed_in_two();
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -5.0, 1e-9);
  CHECK_NEAR(f.tick.guard.balance, 0.0125, 1e-3);
}

TEST(nobody_pays_for_a_jump_but_what_it_gives_is_given)
{
  for (int out = 0; out < 2; ++out) {
    hapi_pointer *p = pressed_in_two();
    p->device.speed_limit = 10.0;
    p->device.pose.position[0] += out != 0 ? -0.1 : 0.1;
    ticks_run(1);
    /* Of 1 J no more than 10 N at 10 m/s give in a tick. */
    CHECK_NEAR(f.tick.guard.balance, out != 0 ? 0.025 - 0.1 : 0.0, 1e-3);
  }
}

/* ---- the black box ---- */

static hap_black_box_row box_rows[HAP_BLACK_BOX_TICKS * POINTERS];
static uint32_t box_counts[HAP_BLACK_BOX_TICKS];
static hap_black_box_row read_rows[HAP_BLACK_BOX_TICKS * POINTERS];
static hapi_black_box box;

static void ticks_record(int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    ticks_run(1);
    hapi_black_box_record(&box, &f.tick);
  }
}

static hapi_pointer *open_box(void)
{
  hapi_pointer *p = guarded_wall();
  box = (hapi_black_box){.rows = box_rows, .counts = box_counts, .pointers = POINTERS};
  hapi_black_box_reset(&box);
  f.tick.facts.physics_period = 0.0; /* the wall does not grow old */
  return p;
}

static size_t read_box(size_t room)
{
  memset(read_rows, 0xee, sizeof read_rows);
  return hapi_black_box_read(&box, read_rows, room, sizeof read_rows[0]);
}

/* The age of a model that there is not would be the time since the machine was switched on. */
TEST(the_black_box_knows_no_age_before_the_first_model)
{
  (void)guarded_alone();
  box = (hapi_black_box){.rows = box_rows, .counts = box_counts, .pointers = POINTERS};
  hapi_black_box_reset(&box);
  f.now_ns = 1000000 * TICK_NS;
  ticks_record(2);
  hapi_tick_fault(&f.tick, HAP_FAULT_WORLD, 0);
  ticks_record(1);
  REQUIRE(read_box(10) == 3);
  CHECK(read_rows[0].model_age_s == 0.0 && read_rows[2].model_age_s == 0.0);
}

TEST(the_black_box_keeps_the_last_256_ticks_until_the_reset)
{
  hapi_pointer *p = open_box();
  ticks_record(1000);
  CHECK(read_box(1000) == 0); /* nothing has happened */
  p->surface.stiffness = (double)INFINITY;
  p->device.pose.position[0] = -0.005;
  ticks_record(1);
  p->surface.stiffness = 1000.0;
  uint64_t last = f.tick.facts.tick - 1;
  ticks_record(100);
  for (int again = 0; again < 2; ++again) {
    REQUIRE(read_box(1000) == 256);
    for (uint64_t i = 0; i < 256; ++i) {
      const hap_black_box_row *row = &read_rows[i];
      CHECK(row->tick == last - 255 + i && row->pointer.v == (((uint64_t)1 << 32) | 1));
      CHECK(row->fault == (i == 255 ? HAP_FAULT_FORCE : HAP_FAULT_NONE));
      CHECK(row->time_ns == (int64_t)row->tick * TICK_NS);
    }
  }
  CHECK(!isfinite(read_rows[255].wanted.force[0]) && read_rows[255].written.force[0] == 0.0);
  CHECK(read_rows[255].pose.position[0] == -0.005 && read_rows[254].pose.position[0] == -0.1);
  CHECK(read_rows[255].guard == HAP_GUARD_FAULT);
  CHECK(read_box(3) == 3 && read_rows[0].tick == last - 2 && read_rows[2].tick == last);
  hapi_tick_reset_fault(&f.tick);
  ticks_record(1);
  CHECK(read_box(1000) == 0);
  ticks_record(9);
  hapi_tick_fault(&f.tick, HAP_FAULT_WORLD, 0);
  ticks_record(1);
  CHECK(read_box(1000) == 11 && read_rows[10].fault == HAP_FAULT_WORLD);
  CHECK(read_rows[1].written.force[0] < 0.0 && read_rows[0].guard == HAP_GUARD_RAMP_IN);
}

TEST(each_pointer_has_its_rows)
{
  (void)open_box();
  ticks_record(3);
  (void)guarded_pointer(2);
  ticks_record(2);
  hapi_tick_fault(&f.tick, HAP_FAULT_DEVICE_POSE, 3);
  ticks_record(1);
  CHECK(read_box(1000) == 9);
  CHECK(read_rows[2].tick + 1 == read_rows[3].tick && read_rows[3].tick == read_rows[4].tick);
  CHECK((uint32_t)read_rows[3].pointer.v == 1 && (uint32_t)read_rows[4].pointer.v == 3);
}

TEST(a_loop_never_waits_for_a_reader)
{
  (void)open_box();
  ticks_record(5);
  hapi_tick_fault(&f.tick, HAP_FAULT_WORLD, 0);
  ticks_record(1);
  box.state = HAPI_BOX_READING; /* a reader that takes its time */
  hapi_tick_reset_fault(&f.tick);
  ticks_record(4); /* not kept */
  hapi_tick_fault(&f.tick, HAP_FAULT_LOCAL_STATE, 0);
  ticks_record(1);
  box.state = HAPI_BOX_FROZEN; /* done */
  ticks_record(3);
  CHECK(read_box(1000) == 1); /* of the new fault, not of the old one */
  CHECK(read_rows[0].fault == HAP_FAULT_LOCAL_STATE);
}
