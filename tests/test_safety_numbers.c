/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What single numbers of the safety concept mean, where no test of a whole part needs them: times,
 * ways and speeds against closed forms. The numbers are written out, as docs/safety.md has them. */

#include "tests/tap.h"

#include <math.h>

#include "guard/force_guard.h"
#include "local/contact_ramp.h"
#include "pointer/coupling.h"
#include "tests/tick_world.h"

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

static hapi_pointer *coupling_pointer(void)
{
  static const hapi_tool_hull hull;
  set_up();
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->shape.hull = &hull;
  p->device.speed_limit = 10.0;
  f.tick.pointers.high = 1;
  CHECK(hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02) == 0);
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
  CHECK(hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02) == 0 && !p->device.jumped);
  turn_to(p, 0.2);
  CHECK(hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02) == 0 && p->device.jumped);
}

/* In this tick it is known; 10 ms, and two steps until a model of the new place has come. */
TEST(contacts_that_come_after_a_jump_begin_anew_for_10_ms_and_two_steps)
{
  hapi_pointer *p = coupling_pointer();
  int ticks = 0;
  p->device.pose.position[0] = 0.02;
  (void)hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02);
  CHECK(p->device.jumped);
  for (; p->device.jump_s > 0.5 * T && ticks < 1000; ++ticks) {
    (void)hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02);
  }
  CHECK_SAY(ticks == 50, "%d ticks", ticks);
}

TEST(a_speed_that_no_wrist_has_is_no_speed)
{
  hapi_pointer *p = coupling_pointer();
  hapi_v3_set(p->device.twist.angular, 0.0, 99.0, 0.0);
  (void)hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02);
  CHECK_NEAR(p->twist.angular[1], 99.0, 1e-9);
  hapi_v3_set(p->device.twist.angular, 0.0, 101.0, 0.0);
  (void)hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02);
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
      CHECK(hapi_coupling_read(&f.tick.pointers, f.now_ns, T, T, 0.02) == (beyond != 0 ? 1 : 0));
    }
  }
}
