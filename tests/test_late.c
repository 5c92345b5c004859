/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Ticks that come late: what is taken from the force, when it comes back, when a fault latches,
 * and what a hand feels of it. Time is that of a virtual clock. */

#include "tests/tap.h"

#include "base/safety.h"
#include "bench/late.h"
#include "guard/lateness.h"
#include "tests/tick_world.h"
#include "tools/rig.h"

#define LIMIT 20.0 /* N */

/* ---- the rule alone ---- */

/* A pointer of 1000 N/m that is under force. */
static hapi_pointer *late_pointer(void)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->guard.written.force[0] = 5.0;
  f.tick.pointers.high = 1;
  return p;
}

/* A tick after so many missed ones; what is taken of the pointer's force. */
static double late_tick(int missed)
{
  f.tick.facts.elapsed = (missed + 1) * T;
  if (hapi_lateness_follow(&f.tick.guard, &f.tick.facts, &f.tick.pointers)) {
    hapi_tick_fault(&f.tick, HAP_FAULT_LATE, 0);
  }
  return f.pointers[0].guard.late_loss;
}

static double late_ticks(int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    (void)late_tick(0);
  }
  return f.pointers[0].guard.late_loss;
}

static bool late_is_good(void)
{
  return f.tick.guard.late.derated_ticks == 0 && f.tick.guard.latch.fault == HAP_FAULT_NONE;
}

TEST(gaps_of_5_ms_and_less_than_a_hundredth_missed_take_nothing)
{
  (void)late_pointer();
  for (int i = 0; i < 200; ++i) { /* 5 of 600 */
    (void)late_tick(5);
    (void)late_ticks(594);
  }
  CHECK(late_is_good());
  for (int i = 0; i < 200; ++i) { /* 1 of 101, in time with nothing */
    (void)late_tick(1);
    (void)late_ticks(99 + i % 3);
  }
  CHECK(late_is_good());
  for (int i = 0; i < 20; ++i) { /* all that 2 s may miss at once */
    (void)late_tick(5), (void)late_tick(5), (void)late_tick(5), (void)late_tick(4);
    (void)late_ticks(1981);
  }
  CHECK(late_is_good());
}

/* 0 .. 1 */
static double dice_throw(uint32_t *dice)
{
  *dice = *dice * 1664525u + 1013904223u;
  return (double)(*dice >> 8) / 16777216.0;
}

/* A run with gaps up to a number of missed ticks, anywhere, that lose a share of the time at most.
 * Ticks with less force. */
static uint64_t random_run(uint32_t *dice, int ticks, double share, int gap_most)
{
  static int gaps[10001];
  int left = (int)(share * ticks);
  memset(gaps, 0, sizeof gaps);
  for (int tries = 0; left > 0 && tries < 10000; ++tries) {
    int *gap = &gaps[(int)(dice_throw(dice) * (ticks - 1))];
    int missed = 1 + (int)(gap_most * dice_throw(dice));
    if (*gap == 0 && missed <= left) {
      *gap = missed;
      left -= missed;
    }
  }
  (void)late_pointer();
  for (int t = 0; t < ticks; t += 1 + gaps[t]) {
    (void)late_tick(gaps[t]);
  }
  return f.tick.guard.late.derated_ticks;
}

TEST(ten_thousand_runs_of_good_real_time_take_nothing_and_worse_ones_do)
{
  uint32_t dice = 7;
  int chance = 0;
  int lowered = 0;
  for (int i = 0; i < 10000; ++i) {
    CHECK(random_run(&dice, 2000, 0.0099 * dice_throw(&dice), 1 + i % 5) == 0);
  }
  for (int i = 0; i < 500; ++i) {
    chance += random_run(&dice, 10000, 0.0099, 5) > 0;
    lowered += random_run(&dice, 10000, 0.04, 5) > 0;
    (void)late_pointer();
    (void)late_ticks(100);
    (void)late_tick(6);
    CHECK(f.tick.guard.late.derated_ticks > 0);
  }
  printf("# of 500 runs of 10 s: %d with 1 %% missed, %d with 4 %% have less force\n", chance,
         lowered);
  CHECK(chance == 0 && lowered > 450);
}

#define WALK_UNITS 100 /* of a tick */
#define WALK_MOST 10000

/* Probability that a run of 10 s, 1 % of it missed in gaps of first to last ticks, all alike and
 * anywhere, loses so much at once that force is taken. Lost time beyond the share that is forgotten
 * is a walk with a floor at zero: its distribution, tick by tick, without a run. */
static double chance_of_less_force(int first, int last)
{
  static double now[WALK_MOST];
  static double next[WALK_MOST];
  int level = (int)lround(HAPI_SAFETY_LATE_FEW_S / T * WALK_UNITS);
  int forgotten = (int)lround(HAPI_SAFETY_LATE_FEW_SHARE * WALK_UNITS);
  double mean = 0.5 * (first + last);
  double gaps = 0.01 / 0.99 / mean;
  double taken = 0.0;
  CHECK(level < WALK_MOST);
  memset(now, 0, sizeof now);
  now[0] = 1.0;
  for (int t = 0; t < 9900; ++t) {
    memset(next, 0, sizeof next);
    for (int at = 0; at <= level; ++at) {
      int left = at > forgotten ? at - forgotten : 0;
      next[left] += (1.0 - gaps) * now[at];
      for (int k = first; k <= last && now[at] > 0.0; ++k) {
        int to = at + k * WALK_UNITS - (k + 1) * forgotten;
        double share = gaps / (last - first + 1) * now[at];
        next[to <= level ? to : 0] += to <= level ? share : 0.0;
        taken += to <= level ? 0.0 : share;
      }
    }
    memcpy(now, next, sizeof now);
  }
  return taken;
}

TEST(random_gaps_of_a_good_machine_hardly_ever_come_together)
{
  double alike = chance_of_less_force(1, 5);
  double long_ones = chance_of_less_force(5, 5);
  double short_ones = chance_of_less_force(1, 1);
  printf(
      "# less force in a run of 10 s with 1 %% missed: gaps of 1 to 5 ticks %.2g, of 5 %.2g, of 1 "
      "%.2g\n",
      alike, long_ones, short_ones);
  CHECK(alike < 2e-5 && long_ones < 5e-4 && short_ones < 1e-12);
}

TEST(more_missed_ticks_than_that_take_force_however_short_the_gaps_are)
{
  (void)late_pointer();
  int ticks = 0;
  while (late_tick(1) == 0.0 && ticks < 100) {
    ++ticks;
  }
  CHECK(ticks >= 30 && ticks <= 34);    /* 30 ms are lost, one of two */
  CHECK_NEAR(late_ticks(3), 0.5, 0.02); /* writes are 2 T apart */
}

TEST(a_longer_gap_takes_force_in_four_ticks_holds_it_down_and_gives_it_back)
{
  (void)late_pointer();
  CHECK(late_tick(5) == 0.0);
  (void)late_ticks(2000);
  CHECK_NEAR(late_tick(6), 0.25, 1e-12);
  CHECK_NEAR(late_tick(0), 0.5, 1e-12);
  CHECK_NEAR(late_tick(0), 0.75, 1e-12);
  CHECK(late_tick(0) > 1.0 - 1.0 / 6.7); /* the stiffness that it holds falls as 1 / 7 */
  for (int i = 4; i < 80; ++i) {
    double loss = late_tick(0);
    CHECK(loss >= 1.0 - 1.0 / 4.0 && loss <= 1.0 - 1.0 / 7.0);
  }
  for (int i = 80; i < 120; ++i) {
    CHECK(late_tick(0) > 0.3);
  }
  CHECK(late_ticks(60) == 0.0); /* 180 ms after the gap */
  uint64_t derated = f.tick.guard.late.derated_ticks;
  CHECK(derated > 150 && derated < 180);
  CHECK(late_ticks(100) == 0.0 && f.tick.guard.late.derated_ticks == derated);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE);
}

TEST(the_longest_gap_counts_and_is_forgotten_while_shorter_ones_go_on)
{
  (void)late_pointer();
  (void)late_tick(39);
  CHECK(late_ticks(5) > 1.0 - 1.0 / 37.0);
  (void)late_tick(7);
  CHECK(late_ticks(5) > 1.0 - 1.0 / 30.0); /* that of 40 T still */
  for (int i = 0; i < 20; ++i) {
    (void)late_tick(7);
    (void)late_ticks(30);
  }
  CHECK_NEAR(late_tick(7), 1.0 - 1.0 / 8.0, 0.03);
}

TEST(a_device_that_holds_more_than_it_touches_keeps_more)
{
  hapi_pointer *p = late_pointer();
  p->coupling.hold_known = true;
  p->coupling.hold = 4000.0; /* four times the pointer's stiffness: good for 4 T */
  (void)late_tick(7);
  CHECK_NEAR(late_ticks(3), 1.0 - 4.0 / 7.88, 0.01);
  (void)late_ticks(300);
  p->coupling.contact_stiffness = 2000.0; /* two contacts at once */
  (void)late_tick(7);
  CHECK_NEAR(late_ticks(3), 1.0 - 2.0 / 7.88, 0.01);
  (void)late_ticks(300);
  p->coupling.contact_stiffness = 8000.0; /* more than it holds: not above T */
  (void)late_tick(7);
  CHECK_NEAR(late_ticks(5), 1.0 - 1.0 / 7.8, 0.01);
  (void)late_ticks(300);
  p->proxied = true;
  p->coupling.stiffness = 4000.0; /* of the spring, whatever is touched behind it */
  (void)late_tick(7);
  CHECK_NEAR(late_ticks(5), 1.0 - 1.0 / 7.8, 0.01);
}

static int ticks_to_fault(int missed, int run, bool force)
{
  hapi_pointer *p = late_pointer();
  p->guard.written.force[0] = force ? 5.0 : 0.0;
  for (int t = 0; t < 5000;) {
    (void)late_tick(missed);
    (void)late_ticks(run - 1);
    t += missed + run;
    if (f.tick.guard.latch.fault == HAP_FAULT_LATE) {
      return t;
    }
  }
  return 0;
}

TEST(a_fault_latches_where_more_than_half_of_the_time_is_lost_under_force)
{
  CHECK(ticks_to_fault(3, 1, true) >= 790 && ticks_to_fault(3, 1, true) <= 820); /* 0.2 / 0.25 */
  CHECK(ticks_to_fault(12, 4, true) >= 760 && ticks_to_fault(12, 4, true) <= 830);
  CHECK(ticks_to_fault(12, 4, false) == 0);
  CHECK(ticks_to_fault(8, 8, true) == 0); /* half: less force, no fault */
  CHECK(ticks_to_fault(6, 5, true) == 0 || ticks_to_fault(6, 5, true) > 3000);
  CHECK(ticks_to_fault(11, 10, true) > 0 || f.tick.guard.late.derated_ticks > 0);
}

TEST(a_fault_latches_after_one_gap_of_more_than_50_ms_under_force)
{
  CHECK(ticks_to_fault(48, 1000, true) == 0);
  CHECK(ticks_to_fault(51, 1000, true) == 1051);
  CHECK(ticks_to_fault(300, 1000, false) == 0);
}

TEST(a_torque_is_a_force_that_is_held_too)
{
  hapi_pointer *p = late_pointer();
  p->guard.written.force[0] = 0.0;
  (void)late_tick(60);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE); /* nothing is held */
  p->guard.written.torque[1] = 0.01;
  (void)late_tick(60);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_LATE);
}

TEST(a_reset_forgives_what_was_lost)
{
  (void)ticks_to_fault(3, 1, true);
  hapi_tick_reset_fault(&f.tick);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE);
  for (int i = 0; i < 100; ++i) { /* half of what it takes */
    (void)late_tick(3);
  }
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE);
}

TEST(a_measuring_guard_takes_nothing)
{
  (void)late_pointer();
  f.tick.guard.mode = HAP_GUARD_MEASURE;
  for (int i = 0; i < 100; ++i) {
    CHECK(late_tick(60) == 0.0);
  }
  CHECK(late_is_good());
}

/* ---- a tick ---- */

/* 5 mm deep in a wall, 5 N. */
static hapi_pointer *late_wall(hap_model model)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  hapi_pointer *p = add_pointer(0, -0.1, 0.0, 0.0);
  p->device.limits.max_force = LIMIT;
  p->device.limits.slew_force = LIMIT / 0.002;
  p->device.limits.slew_torque = 500.0;
  p->device.speed_limit = 10.0;
  f.model->model = model;
  begin_model();
  (void)add_contact(0, HAPI_SLOT_NONE, 0);
  model_adopt();
  ticks_run(1);
  f.tick.facts.physics_period = 0.0; /* the wall does not grow old */
  for (int i = 0; i < 95; ++i) {
    p->device.pose.position[0] += 1e-3;
    ticks_run(1);
  }
  ticks_run(30);
  CHECK_NEAR(p->device.wrench.force[0], -5.0, 1e-9);
  CHECK(p->guard.flags == 0);
  return p;
}

static void ticks_miss(int ticks)
{
  f.now_ns += ticks * TICK_NS;
}

TEST(the_force_goes_down_and_up_slowly_and_says_why)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  p->device.limits.max_force = 10.0;
  ticks_miss(19);
  double before = 5.0;
  double least = 5.0;
  for (int i = 0; i < 200; ++i) {
    ticks_run(1);
    double force = -p->device.wrench.force[0];
    CHECK(fabs(force - before) <= 0.8 + 1e-9); /* the whole force in 12.5 ms */
    CHECK(i > 170 || (p->guard.flags & HAP_GUARD_LATE) != 0);
    CHECK(i < 10 || i > 70 || force < 5.0 / 10.0);
    least = fmin(least, force);
    before = force;
  }
  CHECK_NEAR(least, 5.0 / 20.0, 0.02);
  CHECK_NEAR(before, 5.0, 1e-9);
  CHECK(p->guard.flags == 0 && f.tick.guard.slewed_ticks > 2 && f.tick.guard.energy_ticks == 0);
}

TEST(what_the_hand_went_in_a_gap_is_not_pressed_in_at_once)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  ticks_miss(7);
  p->device.pose.position[0] += 4e-3;
  ticks_run(1);
  CHECK_NEAR(p->guard.wanted.force[0], -5.5, 1e-9); /* an eighth of the way */
  ticks_run(1);
  CHECK_NEAR(p->guard.wanted.force[0], -5.7, 1e-9); /* 0.2 m/s */
  /* The hand has paid 0 + 1 + 2 + 3 + 4 mJ on its way in, as each force was held for a tick, and
   * 5 N over 4 mm in the gap: a spring of 1 kN/m is 7.746 mm deep then. */
  ticks_run(100);
  CHECK_NEAR(p->guard.wanted.force[0], -sqrt(2.0 * 1000.0 * 0.03), 1e-3);
  double touch_s = f.tick.guard.touch_s;
  CHECK(touch_s < 0.3);
  ticks_run((int)lround((0.3 - touch_s) / T) + 150); /* the rest, within 0.3 s to 1 / e */
  CHECK_NEAR(p->guard.wanted.force[0], -9.0 + 1.254 * exp(-0.5), 0.01);
  double debt = f.tick.guard.sprung - f.tick.guard.balance;
  printf("# %.3g mJ came in unpaid and not booked\n", 1e3 * debt);
  CHECK(debt < 5e-4); /* 3 mJ where it is nobody's work */
  CHECK(f.tick.guard.energy_ticks == 0);
  ticks_run(9000);
  CHECK_NEAR(p->guard.wanted.force[0], -9.0, 1e-9);
  ticks_miss(7);
  p->device.pose.position[0] -= 4e-3; /* out: at once */
  ticks_run(1);
  CHECK_NEAR(p->guard.wanted.force[0], -5.0, 1e-9);
  ticks_run(900);
  ticks_miss(4); /* a short one */
  p->device.pose.position[0] += 1e-3;
  ticks_run(1);
  CHECK_NEAR(p->guard.wanted.force[0], -6.0, 1e-9);
}

TEST(a_force_that_the_energy_observer_takes_is_not_held_up_by_a_gap_and_comes_back_slowly)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  p->coupling.hold_known = true;
  p->coupling.hold = 1e4; /* good for ten ticks: no less force */
  ticks_miss(7);
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -5.0, 1e-9);
  f.tick.guard.balance = -1.0;
  p->device.pose.position[0] -= 5e-4;
  ticks_run(1);
  CHECK((p->guard.flags & HAP_GUARD_ENERGY) != 0);
  CHECK_NEAR(p->device.wrench.force[0], 0.0, 1e-9);
  f.tick.guard.balance = 1.0;
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -LIMIT / 12.5, 1e-9);
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -2.0 * LIMIT / 12.5, 1e-9);
  f.tick.guard.balance = -1.0; /* less is held than is asked: that is no reason to hold it up */
  p->device.pose.position[0] -= 5e-4;
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], 0.0, 1e-9);
  f.tick.guard.balance = 1.0;
  ticks_run(3);
  CHECK_NEAR(p->device.wrench.force[0], -4.0, 1e-9);
}

TEST(what_the_energy_observer_gives_back_under_less_force_comes_slowly)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  ticks_miss(7);
  ticks_run(155); /* the gap's own limit is long over, and most of the force is back */
  CHECK(p->guard.late_loss > 0.05 && p->guard.late_loss < 0.2);
  f.tick.guard.balance = -1.0;
  p->device.pose.position[0] -= 5e-4;
  ticks_run(1);
  CHECK((p->guard.flags & HAP_GUARD_ENERGY) != 0);
  CHECK_NEAR(p->device.wrench.force[0], 0.0, 1e-9);
  f.tick.guard.balance = 1.0;
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -LIMIT / 12.5, 1e-9);
}

TEST(less_force_comes_slowly_though_the_hand_draws_back)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  p->device.limits.max_force = 10.0;
  ticks_miss(19);
  double before = 5.0;
  for (int i = 0; i < 20; ++i) {
    p->device.pose.position[0] -= 1e-5;
    ticks_run(1);
    double force = -p->device.wrench.force[0];
    CHECK(before - force <= 0.8 + 1e-9 && force <= -p->guard.wanted.force[0] + 1e-9);
    before = force;
  }
  p->device.pose.position[0] -= 2e-3; /* what the world asks no more goes at once */
  ticks_run(1);
  CHECK(-p->device.wrench.force[0] <= -p->guard.wanted.force[0] + 1e-9);
}

/* 5 N in a touch with a gap, long after it; the hand draws back by 10 um a tick, and the ledger
 * pays for 50 uJ and its overdraft. Returns the largest change of force; *out_given: J to the
 * hand. */
static double debt_taken(bool in_touch, double *out_given)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  double step = 0.0;
  double before = 5.0;
  ticks_run(300);
  f.tick.guard.late.in_touch = in_touch;
  f.tick.guard.touch_s = 0.0;
  f.tick.guard.balance = 5e-5;
  *out_given = 0.0;
  for (int i = 0; i < 50; ++i) {
    p->device.pose.position[0] -= 1e-5;
    *out_given += 1e-5 * before;
    ticks_run(1);
    double force = -p->device.wrench.force[0];
    step = fmax(step, fabs(force - before));
    before = force;
  }
  CHECK(before < 0.01);
  return step;
}

TEST(a_debt_that_a_gap_left_takes_the_force_in_some_ticks_and_costs_no_more)
{
  double once_given;
  double eased_given;
  double once = debt_taken(false, &once_given);
  double eased = debt_taken(true, &eased_given);
  double overdraft = fmax(HAPI_SAFETY_OVERDRAFT * f.tick.guard.stored_max, 1e-5);
  printf("# %.3g N at once, %.3g N; gave %.4g and %.4g mJ\n", once, eased, 1e3 * once_given,
         1e3 * eased_given);
  CHECK(once > 2.4);
  CHECK(eased <= LIMIT / 12.5 + 1e-9);
  CHECK(eased_given <= 5e-5 + overdraft + 1e-9 && eased_given > 0.7 * once_given);
}

/* ---- the closed forms of the bench ---- */

/* A hand against a wall whose spring falls to 1 / n of its force and stiffness, step by step. */
static double swing_stepped(const late_hand *hand, const late_touch *touch, double force, double n)
{
  const double step = 1e-6;
  double x = 0.0; /* m, farther in */
  double v = 0.0;
  double most = force / n;
  for (int i = 0; i < 200000; ++i) {
    double pressed = force / n + touch->stiffness / n * x;
    double a = force - hand->stiffness * x - hand->damping * v - pressed - touch->damping / n * v;
    v += step * a / hand->mass;
    x += step * v;
    most = fmax(most, pressed);
  }
  return most;
}

/* A hand that is pressed, with no more force, meets a wall at a speed. */
static double blow_stepped(const late_hand *hand, const late_touch *touch, double speed)
{
  const double step = 1e-6;
  double x = 0.0;
  double v = speed;
  double most = 0.0;
  for (int i = 0; i < 200000; ++i) {
    double k = touch->stiffness + hand->stiffness;
    v -= step * (k * x + (hand->damping + touch->damping) * v) / hand->mass;
    x += step * v;
    most = fmax(most, touch->stiffness * x);
  }
  return most;
}

TEST(what_pulses_demand_is_what_a_stepped_hand_gives)
{
  static const char *const specs[] = {"virtual:hand=relaxed", "virtual:hand=tense"};
  const late_touch touch = {2000.0, 5.0};
  for (int i = 0; i < 2; ++i) {
    const late_hand hand = late_hand_of(specs[i]);
    double swing = 0.0;
    CHECK(hand.known && !hand.prescribed);
    for (int n = 2; n <= 3; ++n) {
      swing = fmax(swing, swing_stepped(&hand, &touch, 5.0, n));
      CHECK_NEAR(late_demands(&hand, &touch, 5.0, 0.0, n), fmax(swing, 5.0), 2e-3);
      double u = 0.1 * (1.0 - 1.0 / n);
      double more = fmax(blow_stepped(&hand, &touch, u), 2000.0 * 0.1 * 1e-3 * (n - 1));
      double both = fmax(swing / 5.0, 1.0) * (5.0 + more);
      CHECK_NEAR(late_demands(&hand, &touch, 5.0, 0.1, n), both, 3e-3);
    }
  }
  const late_hand rigid = late_hand_of("virtual:hand=rigid");
  CHECK_NEAR(late_demands(&rigid, &touch, 5.0, 0.1, 4), 5.0 + 2000.0 * 0.1 * 3e-3, 1e-12);
  CHECK_NEAR(late_demands(&rigid, &touch, 5.0, 0.1, 31), 5.0 + 2000.0 * 0.1 * 5e-3, 1e-12);
  CHECK(!late_hand_of("virtual:hand=relaxed,mass=1").known && !late_hand_of(NULL).known);
}

/* The rod hangs still: its surface is 0.02 m from its axis, the ball's radius is 0.01 m. */
TEST(the_true_change_of_a_force_is_that_of_spring_and_damper)
{
  rig r;
  rig_options options;
  hap_detail detail;
  late_bodies bodies = {.known = false};
  rig_options_init(&options);
  options.scene = "pendulum";
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  REQUIRE(rig_create(&options, &r, &detail) >= HAP_OK);
  REQUIRE(hap_session_start(r.session) >= HAP_OK);
  const double way[5] = {-0.0305, -0.0295, -0.0293, -0.0290, -0.0290};
  const int ticks[5] = {1, 1, 1, 3, 1};
  const double k = r.scene->parameters.stiffness;
  const double d = r.scene->parameters.damping;
  late_true now[5];
  for (int i = 0; i < 5; ++i) {
    const double at[3] = {way[i], 0.0, -0.2};
    const late_place place = {at, ticks[i], false};
    now[i] = late_spring(r.scene, r.session, &place, &bodies);
  }
  CHECK(!now[0].known && now[1].known);
  CHECK_NEAR(now[1].change, k * 0.0005 + d * 1.0, 1e-6); /* the damper is there at once */
  CHECK_NEAR(now[1].most, k * 0.0005 + d * 1.0, 1e-6);
  CHECK_NEAR(now[2].change, fabs(k * 0.0002 - d * 0.8), 1e-6);
  CHECK_NEAR(now[3].change, fabs(k * 0.0003 - d * 0.1), 1e-6);
  CHECK_NEAR(now[4].change, d * 0.1, 1e-6);
  CHECK_NEAR(now[4].most, k * 0.001, 1e-6);
  rig_destroy(&r);
}

TEST(where_nobody_watches_what_a_gap_held_back_comes_in_unpaid)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  f.tick.guard.mode = HAP_GUARD_MEASURE;
  ticks_run(1);
  ticks_miss(7);
  p->device.pose.position[0] += 4e-3;
  ticks_run(11);
  CHECK_NEAR(p->guard.wanted.force[0], -7.5, 1e-9); /* 0.5 mm in the gap, 10 ticks of 0.2 mm */
  ticks_run(10);
  CHECK_NEAR(p->guard.wanted.force[0], -9.0, 1e-9);
}

TEST(a_touch_lasts_as_long_as_its_time_and_not_as_its_ticks)
{
  (void)late_wall(HAP_MODEL_CONTACT);
  double before = f.tick.guard.touch_s;
  for (int i = 0; i < 10; ++i) {
    ticks_miss(3);
    ticks_run(1);
  }
  CHECK_NEAR(f.tick.guard.touch_s - before, 0.04, 1e-9);
}

TEST(a_contact_that_ended_in_a_gap_pushes_no_more)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  double gave = 0.0;
  ticks_miss(9);
  for (int i = 0; i < 15; ++i) { /* out of the wall, and on at 1 m/s */
    double force = p->device.wrench.force[0];
    p->device.pose.position[0] -= i == 0 ? 0.01 : 1e-3;
    gave += i == 0 ? 0.0 : force * -1e-3;
    ticks_run(1);
  }
  printf("# %.3g mJ after the gap\n", 1e3 * gave);
  CHECK(gave < 1e-3); /* 20 mJ at 0.8 N a tick, down from 5 N */
}

TEST(the_spring_of_a_proxy_is_not_stretched_at_once_by_a_gap)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  p->coupling.kind = HAP_COUPLING_PROXY;
  p->coupling.hold_known = true;
  p->coupling.hold = p->coupling.stiffness = 1000.0;
  f.tick.pointers.proxies = true;
  ticks_run(200);
  CHECK(p->proxied);
  double before = -p->guard.wanted.force[0];
  ticks_miss(7);
  p->device.pose.position[0] += 4e-3;
  ticks_run(1);
  double once = -p->guard.wanted.force[0] - before;
  ticks_run(300);
  double all = -p->guard.wanted.force[0] - before;
  printf("# %.3g N at once, %.3g N in the end\n", once, all);
  CHECK(all > 1.9 && once > 0.05 * all && once < 0.25 * all);
}

TEST(a_late_fault_fades_the_force_over_100_ms_however_few_ticks_come)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  ticks_miss(60);
  ticks_run(1);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_LATE && f.tick.guard.latch.pointer == 0);
  CHECK(p->guard.flags == HAP_GUARD_FAULT);
  double before = -p->device.wrench.force[0];
  CHECK_NEAR(before, 5.0 * 0.39, 0.01); /* 61 of 100 ms are over */
  ticks_miss(9);
  ticks_run(1);
  CHECK_NEAR(-p->device.wrench.force[0], 5.0 * 0.29, 0.01);
  ticks_run(30);
  CHECK(p->device.wrench.force[0] == 0.0);
  hapi_tick_reset_fault(&f.tick);
  ticks_run(250);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE && p->device.wrench.force[0] < 0.0);
}

TEST(other_faults_take_the_force_by_the_time_that_has_passed)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  p->device.limits.slew_force = 1.0; /* N/s: 100 ms then, 200 N/s */
  hapi_tick_fault(&f.tick, HAP_FAULT_WORLD, 0);
  ticks_miss(9);
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -3.0, 1e-9);
  ticks_run(1);
  CHECK_NEAR(p->device.wrench.force[0], -2.8, 1e-9);
}

TEST(an_old_model_fades_by_the_time_that_has_passed)
{
  hapi_pointer *p = late_wall(HAP_MODEL_CONTACT);
  f.tick.facts.physics_period = 0.005;
  ticks_run(1);
  double loss = f.tick.guard.age_loss;
  ticks_miss(4);
  ticks_run(1);
  CHECK_NEAR(f.tick.guard.age_loss - loss, 0.05, 1e-9);
  CHECK((p->guard.flags & HAP_GUARD_STALE) != 0);
}

/* ---- a hand ---- */

/* peak and steps: no more than 1.2 of what they are without pulses. A loop that is late is no fault
 * of the device. */
static void check_pulses(late_def def, int first, const late_pulse *pulses, int count)
{
  bench b = {.out = "."};
  late_result still;
  late_result now;
  REQUIRE(late_run(&b, &def, &still) >= HAP_OK);
  CHECK(still.derated == 0 && still.missed == 0 && still.steps == 0 && still.peak > 4.0);
  def.pulses = pulses, def.pulse_count = count;
  for (def.begin = first; def.begin < first + 900; def.begin += 614) {
    def.end = def.begin + 1000;
    REQUIRE(late_run(&b, &def, &now) >= HAP_OK);
    printf("# %s %u/%u from %d: %.3g N of %.3g, %u steps, %llu derated, fault %u, back %d ms\n",
           def.scene, pulses[0].stop, pulses[0].run, def.begin, now.peak, still.peak, now.steps,
           (unsigned long long)now.derated, now.fault, now.back_ms);
    CHECK(now.missed > 400 && now.derated > 200);
    CHECK(now.peak <= 1.2 * still.peak && now.steps == 0);
    CHECK(now.pulled <= 1.2 * still.pulled); /* by the strings, of a SPIDAR */
    CHECK(now.fault == HAP_FAULT_LATE || (now.fault == 0 && now.back_ms <= 200));
  }
}

/* A body that was thrown in slow motion meets a hand that rests: d v is there at once. */
static void check_step(const char *name, int begin, late_pulse pulse)
{
  bench b = {.out = "."};
  late_result now;
  const late_def def = {.scene = name,
                        .ticks = 2500,
                        .begin = begin,
                        .end = begin + 1000,
                        .pulses = &pulse,
                        .pulse_count = 1};
  REQUIRE(late_run(&b, &def, &now) >= HAP_OK);
  printf("# %s: largest step %.3g N, %u unexplained; %.3g N beyond the spring\n", name, now.step,
         now.steps, now.beyond);
  CHECK(now.steps == 0 && (!now.deep_known || now.beyond <= LATE_BEYOND_N));
}

TEST(no_step_is_felt_that_the_bodies_do_not_make)
{
  check_step("slide", 728, (late_pulse){8, 8});
  check_step("lever", 1156, (late_pulse){25, 4});
  check_step("roll", 300, (late_pulse){12, 4});
  check_step("pendulum", 514, (late_pulse){3, 1});
}

TEST(a_loop_stopped_in_pulses_shakes_no_hand)
{
  static const late_pulse pulses[4] = {{8, 8}, {12, 4}, {15, 5}, {30, 10}};
  const late_def row = {.scene = "row10", .ticks = 2500};
  const late_def wedge = {.scene = "wedge", .ticks = 2500};
  const late_def spidar = {.scene = "row10", .device = LATE_SPIDAR, .ticks = 4200};
  for (int i = 0; i <= 4; ++i) {
    const late_pulse *some = i < 4 ? &pulses[i] : late_busy;
    int count = i < 4 ? 1 : LATE_BUSY;
    check_pulses(row, 300, some, count);
    check_pulses(wedge, 300, some, count);
    check_pulses(spidar, 1914, some, count);
  }
}
