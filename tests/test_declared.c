/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What is declared beside contacts: it reaches the device within all limits, the energy observer
 * leaves it out, and a vibration that is meant is no swing. */

#include "tests/tap.h"

#include "guard/force_guard.h"
#include "guard/oscillation.h"
#include "guard/promise.h"
#include "tests/tick_world.h"

#define LIMIT 20.0 /* N */

static hapi_pointer *declared_pointer(void)
{
  set_up();
  f.tick.guard.mode = HAP_GUARD_ON;
  f.tick.facts.elapsed = T;
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->device.limits = (hapi_device_limits){LIMIT, 1.0, 1e6, 1e5};
  p->device.speed_limit = 10.0;
  p->guard.share = 1.0;
  f.tick.pointers.high = 1;
  return p;
}

/* A tick at a place along x, with a force of contacts and one that is declared. */
static void declared_tick(double at, double contact, double follows, double driven)
{
  hapi_pointer *p = &f.pointers[0];
  hapi_v3_set(p->device.pose.position, at, 0.0, 0.0);
  hapi_tick_read(&f.tick, f.now_ns += TICK_NS);
  hapi_v3_set(p->wrench.force, contact, 0.0, 0.0);
  hapi_v3_set(p->wrench.torque, 0.0, 0.0, 0.0);
  if (follows != 0.0) {
    const hap_wrench w = {{follows, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hapi_declare_following(&p->declared, &w, 0.0);
  }
  if (driven != 0.0) {
    const hap_wrench w = {{driven, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hapi_declare_driven(&p->declared, &w);
  }
  hapi_tick_guard(&f.tick);
}

TEST(the_hand_feels_contacts_and_what_is_declared)
{
  hapi_pointer *p = declared_pointer();
  declared_tick(0.0, 2.0, 3.0, -1.0);
  CHECK_NEAR(p->device.wrench.force[0], 4.0, 1e-12);
  CHECK_NEAR(p->wrench.force[0], 4.0, 1e-12);
  CHECK_NEAR(p->guard.contact.force[0], 2.0, 1e-12);
  declared_tick(0.0, 2.0, 0.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], 2.0, 1e-12);
  CHECK_NEAR(p->guard.contact.force[0], 2.0, 1e-12);
}

TEST(torque_that_is_declared_reaches_a_device_that_can_give_it)
{
  const hap_wrench w = {{0.0, 0.0, 0.0}, {0.0, 0.3, 0.0}};
  for (int three_dof = 0; three_dof < 2; ++three_dof) {
    hapi_pointer *p = declared_pointer();
    p->device.three_dof = three_dof != 0;
    hapi_tick_read(&f.tick, f.now_ns += TICK_NS);
    hapi_declare_driven(&p->declared, &w);
    hapi_tick_guard(&f.tick);
    CHECK_NEAR(p->device.wrench.torque[1], three_dof ? 0.0 : 0.3, 1e-12);
    CHECK_NEAR(p->wrench.torque[1], three_dof ? 0.0 : 0.3, 1e-12);
  }
}

TEST(both_together_keep_the_limits_and_share_what_is_left)
{
  hapi_pointer *p = declared_pointer();
  declared_tick(0.0, 18.0, 12.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], LIMIT, 1e-9);
  CHECK_NEAR(p->guard.contact.force[0], LIMIT * 18.0 / 30.0, 1e-9);
  CHECK((p->guard.flags & HAP_GUARD_SATURATED) != 0);
  p->device.limits.slew_force = 1000.0; /* 1 N a tick */
  declared_tick(0.0, 18.0, -12.0, 0.0);
  CHECK_NEAR(p->device.wrench.force[0], LIMIT - 1.0, 1e-9);
  hapi_fault_set(&f.tick.guard.latch, HAP_FAULT_EMERGENCY, 0, 0);
  for (int i = 0; i < 100; ++i) {
    declared_tick(0.0, 18.0, 12.0, 5.0);
  }
  CHECK(hapi_v3_norm(p->device.wrench.force) == 0.0);
}

TEST(a_declared_force_that_is_not_finite_is_a_fault)
{
  hapi_pointer *p = declared_pointer();
  declared_tick(0.0, 1.0, (double)NAN, 0.0);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_FORCE && f.tick.guard.latch.pointer == 1);
  CHECK(hapi_v3_norm(p->device.wrench.force) == 0.0);
}

/* N that are left of 2 N along a motion of 0.1 m/s, after half a second. */
static double left_of_push(bool declared)
{
  hapi_pointer *p = declared_pointer();
  for (int i = 0; i < 500; ++i) {
    declared_tick(1e-4 * i, declared ? 0.0 : 2.0, declared ? 2.0 : 0.0, 0.0);
  }
  return p->device.wrench.force[0];
}

TEST(the_energy_observer_judges_contacts_alone)
{
  CHECK(left_of_push(false) < 0.1);
  CHECK_NEAR(left_of_push(true), 2.0, 1e-12);
  /* Nor does a force that is declared pay for what a contact makes of nothing. */
  hapi_pointer *p = declared_pointer();
  for (int i = 0; i < 500; ++i) {
    declared_tick(1e-4 * i, 2.0, -3.0, 0.0);
  }
  CHECK_NEAR(p->device.wrench.force[0], -3.0, 0.1);
  CHECK(f.tick.guard.energy_ticks > 400);
}

/* Whether a fault comes of a spring of 1000 N/m that swings by 3 mm at 12 Hz, where a force along
 * the motion of so many N is declared, at some Hz. */
static bool swing_latches(double newtons, double hz)
{
  (void)declared_pointer();
  f.tick.facts.model = HAP_MODEL_CONTACT;
  for (int i = 0; i < 1000; ++i) {
    double phase = 2.0 * M_PI * 12.0 * i * T;
    double way = 0.01 + 0.003 * sin(phase);
    declared_tick(way, -1000.0 * way, 0.0, newtons * cos(2.0 * M_PI * hz * i * T));
  }
  return f.tick.guard.latch.fault == HAP_FAULT_OSCILLATION;
}

TEST(a_vibration_that_is_meant_is_no_swing_and_one_beside_it_is_found)
{
  CHECK(swing_latches(0.0, 12.0));  /* by itself */
  CHECK(!swing_latches(2.0, 12.0)); /* fed by the vibration */
  CHECK(f.tick.guard.oscillation_ticks == 0);
  CHECK(swing_latches(2.0, 90.0)); /* the vibration has no part in it */
}

TEST(a_spring_that_is_declared_is_found_to_swing_as_contacts_are)
{
  hapi_pointer *p = declared_pointer();
  f.tick.facts.model = HAP_MODEL_CONTACT;
  for (int i = 0; i < 1000; ++i) {
    double way = 0.003 * sin(2.0 * M_PI * 12.0 * i * T);
    hapi_v3_set(p->device.pose.position, way, 0.0, 0.0);
    hapi_tick_read(&f.tick, f.now_ns += TICK_NS);
    memset(&p->wrench, 0, sizeof p->wrench);
    p->surface.stiffness = 0.0;
    const hap_wrench w = {{-1000.0 * way, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hapi_declare_following(&p->declared, &w, 1000.0);
    hapi_tick_guard(&f.tick);
  }
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_OSCILLATION);
}

/* ---- promises, by themselves ---- */

/* 0 of everything: no force is left, whatever the hand does. */
TEST(who_promises_nothing_gives_nothing)
{
  const hapi_promise none = {0.0, 0.0, 0.0};
  hapi_declared way = {.way = {1e-3, 0.0, 0.0}, .turn = {0.0, 0.0, 0.01}};
  hap_wrench w = {{5.0, -3.0, 1.0}, {0.1, 0.0, 0.2}};
  hapi_purse purse;
  hapi_purse_fill(&purse, &none);
  CHECK(hapi_promise_keep(&none, &purse, &way, T, &w));
  CHECK(hapi_v3_norm(w.force) == 0.0 && hapi_v3_norm(w.torque) == 0.0);
  purse.last.force[0] = 2.0; /* of a promise before: what it gave is a debt */
  hapi_v3_set(w.force, 5.0, 0.0, 0.0);
  CHECK(hapi_promise_keep(&none, &purse, &way, T, &w) && purse.joules <= 0.0);
  CHECK(hapi_v3_norm(w.force) == 0.0);
}

/* Without power a torque may hold the hand, and not turn it; each flow has its own sign. */
TEST(a_torque_without_power_only_brakes)
{
  const hapi_promise brake = {10.0, 1.0, 0.0};
  for (int drives = 0; drives < 2; ++drives) {
    hapi_declared way = {.turn = {0.0, 0.0, drives != 0 ? 0.01 : -0.01}};
    hap_wrench w = {{4.0, 0.0, 0.0}, {0.0, 0.0, 0.5}};
    hapi_purse purse;
    hapi_purse_fill(&purse, &brake);
    CHECK(hapi_promise_keep(&brake, &purse, &way, T, &w) == (drives != 0));
    CHECK_NEAR(w.torque[2], drives != 0 ? 0.0 : 0.5, 1e-12);
    CHECK_NEAR(w.force[0], 4.0, 0.0); /* it stands still: nothing flows */
  }
}

/* A torque beyond its promise is told where force and power are within theirs. A way whose square
 * is zero in a double has no direction to shorten along: the force stays as it was. */
TEST(a_torque_alone_may_be_too_much_and_no_way_is_too_short)
{
  const hapi_promise promise = {10.0, 0.3, 2.0};
  const hapi_declared still = {.any = false};
  hap_wrench w = {{4.0, 0.0, 0.0}, {0.0, 0.0, 0.5}};
  hapi_purse purse;
  hapi_purse_fill(&purse, &promise);
  CHECK(hapi_promise_keep(&promise, &purse, &still, T, &w));
  CHECK(w.force[0] == 4.0);
  CHECK_NEAR(w.torque[2], 0.3, 1e-12);
  const hapi_promise brake = {10.0, 1.0, 0.0};
  const hapi_declared way = {.way = {1e-200, 0.0, 0.0}};
  hapi_purse_fill(&purse, &brake);
  w.torque[2] = 0.0;
  CHECK(hapi_promise_keep(&brake, &purse, &way, T, &w) && w.force[0] == 4.0);
}

/* Half of what it may give in 100 ms: half of the force, until the debt is forgiven. */
TEST(who_gave_too_much_pays_with_force)
{
  const hapi_promise promise = {10.0, 1.0, 2.0};
  const hapi_declared still = {.any = false};
  double before = 0.0;
  hapi_purse purse = {.joules = -0.1};
  for (int i = 0; i < 400; ++i) {
    hap_wrench w = {{4.0, 0.0, 0.0}, {0.0, 0.0, 0.4}};
    double owed = hapi_min(purse.joules + 2.0 * T, 0.0);
    CHECK(hapi_promise_keep(&promise, &purse, &still, T, &w) == (owed < 0.0));
    CHECK_NEAR(w.force[0], 4.0 * (1.0 + owed / 0.2), 1e-12);
    CHECK_NEAR(w.torque[2], 0.4 * (1.0 + owed / 0.2), 1e-12);
    CHECK(w.force[0] >= before);
    before = w.force[0];
  }
  CHECK(before == 4.0);
}
