/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The coupling between device and world: what a device can hold, the proxy, the choice between
 * it and the direct coupling. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "haptic/coupling_gains.h"
#include "tests/contact_world.h"
#include "tests/unknown_shape.h"

#define T 1e-3
#define HAND_RADIUS 0.01

/* ---- what a device can hold ---- */

static hapi_coupling_gains gains_of(const hap_device_info *device)
{
  const hapi_pointer_setup setup = {.size = sizeof setup};
  return hapi_coupling_gains_of(device, &setup, T);
}

TEST(gains_follow_the_device)
{
  hap_device_info device = {.damping = 0.2};
  hapi_coupling_gains g = gains_of(&device);
  CHECK(g.known);
  CHECK_NEAR(g.stiffness, 0.8 * 0.2 / (0.5 * T), 1e-9); /* 320 N/m */
  CHECK_NEAR(g.damping, 0.5 * (0.2 - 0.5 * T * g.stiffness), 1e-12);
  device.delay = 1.5 * T;
  g = gains_of(&device);
  CHECK_NEAR(g.stiffness, 0.8 * 0.2 / (2.0 * T), 1e-9);
  CHECK(g.damping > 0.0 && g.damping + g.stiffness * 2.0 * T <= 0.2);
  device.rated_stiffness = 50.0;
  CHECK_NEAR(gains_of(&device).stiffness, 50.0, 1e-12);
  device.quantum = 3e-5;
  CHECK_NEAR(gains_of(&device).stiffness, 50.0, 1e-12); /* without friction no limit */
  device.friction = 3e-4;
  CHECK_NEAR(gains_of(&device).stiffness, 20.0, 1e-9);
}

TEST(gains_are_not_invented)
{
  hap_device_info device = {.quantum = 3e-5, .delay = 1e-3, .max_force = 10.0};
  hapi_pointer_setup setup = {.size = sizeof setup};
  CHECK(!hapi_coupling_gains_of(&device, &setup, T).known);
  setup.hand_damping = 1.0; /* the hand may let go of a device that says nothing */
  CHECK(!hapi_coupling_gains_of(&device, &setup, T).known);
  device.damping = 0.2;
  CHECK_NEAR(hapi_coupling_gains_of(&device, &setup, T).stiffness, 0.8 * 1.2 / (1.5 * T), 1e-9);
  setup.coupling_stiffness = 700.0;
  setup.coupling_damping = 0.3;
  hapi_coupling_gains g = hapi_coupling_gains_of(&device, &setup, T);
  CHECK(g.known && g.stiffness == 700.0 && g.damping == 0.3);
}

/* ---- the proxy ---- */

static hap_pointer_state state_of(const contact_world *w)
{
  hap_pointer_state state;
  memset(&state, 0, sizeof state);
  CHECK(hap_pointer_get(w->session, w->hand, &state, sizeof state) == HAP_OK);
  return state;
}

static void use_proxy(contact_world *w, double stiffness)
{
  w->hand_expert.coupling = HAP_COUPLING_PROXY;
  w->hand_expert.coupling_stiffness = stiffness;
}

/* A floor, felt through a proxy. */
static contact_world *proxy_wall(double stiffness, double coupling_stiffness)
{
  contact_world *w = cw_new(0.0);
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 1.0);
  w->hand_def.stiffness = stiffness;
  w->hand_def.damping = 0.0;
  use_proxy(w, coupling_stiffness);
  return w;
}

/* On the static floor, pressed 2 mm in. */
TEST(a_wall_and_the_proxy_are_springs_in_series)
{
  static const double stiffness[] = {100.0, 1000.0, 1e4, 1e6};
  for (size_t i = 0; i < sizeof stiffness / sizeof stiffness[0]; ++i) {
    double k = stiffness[i];
    double k_v = 500.0;
    contact_world *w = proxy_wall(k, k_v);
    cw_start(w, 0.0, 0.0, HAND_RADIUS + 0.001);
    cw_go(w, 0.0, 0.0, -0.03, 100);
    cw_go(w, 0.0, 0.0, 0.0, 100);
    double series = k * k_v / (k + k_v);
    hap_pointer_state state = state_of(w);
    CHECK_NEAR(w->force[2], 0.002 * series, 1e-6);
    CHECK(state.coupling == HAP_COUPLING_PROXY && state.coupling_reason == HAP_COUPLING_ASKED);
    CHECK_NEAR(state.coupling_stiffness, k_v, 1e-9);
    CHECK_NEAR(state.device.position[2], HAND_RADIUS - 0.002, 1e-12);
    CHECK_NEAR(state.proxy.position[2], HAND_RADIUS - 0.002 * k_v / (k + k_v), 1e-8);
    cw_close(w);
  }
}

/* A device turned by 90 degrees about x, whose motions are 5 times as large in the world and
 * which gives half of the world's force: 1 N/m of the device is 1 / (5 x 0.5) N/m there. */
TEST(the_spring_is_the_devices_whatever_its_frame_and_scales)
{
  const double k = 1000.0;
  const double k_device = 1500.0;
  const double k_v = k_device / 2.5;
  const double series = k * k_v / (k + k_v);
  contact_world *w = proxy_wall(k, k_device);
  w->hand_def.motion_scale = 5.0;
  w->hand_def.force_scale = 0.5;
  w->hand_def.pose_world_device = (hap_pose){{0.0, 0.0, 0.002}, {M_SQRT1_2, M_SQRT1_2, 0.0, 0.0}};
  cw_start(w, 0.0, (HAND_RADIUS - 0.001) / 5.0, 0.0); /* y: 1 mm above the floor */
  cw_go(w, 0.0, -0.006, 0.0, 100);
  cw_go(w, 0.0, 0.0, 0.0, 100);
  hap_pointer_state state = state_of(w);
  CHECK_NEAR(state.wrench.force[2], 0.002 * series, 1e-6);
  CHECK_NEAR(state.proxy.position[2], HAND_RADIUS - 0.002 * k_v / (k + k_v), 1e-8);
  CHECK_NEAR(state.coupling_stiffness, k_device, 1e-9);
  CHECK_NEAR(state.contact_stiffness, 2.5 * k, 1e-9);
}

TEST(in_the_air_the_proxy_is_at_the_device_and_gives_no_force)
{
  contact_world *w = cw_new(0.0);
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 0.0);
  use_proxy(w, 500.0);
  cw_start(w, 0.0, 0.0, 0.0);
  cw_move_hand(w, 0.3, -0.2, 0.1);
  for (int i = 0; i < 100; ++i) {
    cw_tick(w);
    hap_pointer_state state = state_of(w);
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(state.proxy.position[k], state.device.position[k], 1e-12);
      CHECK_NEAR(w->force[k], 0.0, 1e-9);
    }
  }
}

/* A kinematic cube comes from below: a wall that moves, at the tick and at both ends of its way. */
TEST(a_driven_body_presses_through_the_proxy)
{
  const double k = 1e5;
  const double k_v = 500.0;
  const double speed = 0.05;
  const double series = k * k_v / (k + k_v);
  contact_world *w = cw_new(0.0);
  dBodyID cube = cw_add_cube(w, 1.0, 0.1, 0.0, 0.0, -0.05 - 0.001);
  dBodySetKinematic(cube);
  dBodySetLinearVel(cube, 0.0, 0.0, speed);
  w->hand_def.stiffness = k;
  w->hand_def.damping = 0.0;
  use_proxy(w, k_v);
  cw_start(w, 0.0, 0.0, HAND_RADIUS);
  for (int i = 0; i < 200; ++i) {
    cw_tick(w);
    double depth = w->position[0][2] + 0.05;
    CHECK_NEAR(w->force[2], fmax(0.0, series * depth), 1.1 * series * speed * T);
  }
  CHECK(w->force[2] > 4.0);
}

/* A cube on rails is moved by what testing simulations say of it, where it has a shape that the
 * loop does not know as well. */
TEST(a_measured_body_is_pushed_through_the_proxy)
{
  contact_world *w = cw_new(0.0);
  dBodyID cube = cw_add_cube(w, 0.2, 0.05, 0.025, 0.0, 0.0);
  dJointAttach(dJointCreateSlider(w->world, NULL), cube, NULL);
  add_unknown_shape(w->space, cube);
  w->hand_def.stiffness = 1e5;
  use_proxy(w, 400.0);
  cw_start(w, -HAND_RADIUS - 0.002, 0.001, 0.002);
  cw_go(w, 0.2, 0.0, 0.0, 400);
  CHECK(cw_stats(w).model.measured_bodies == 1);
  CHECK(w->impulse[0] > 0.05 && cw_stats(w).faults.count == 0);
  CHECK_NEAR(0.2 * w->velocity[0][0], w->impulse[0], 0.01 * w->impulse[0]);
  CHECK_NEAR(cw_stats(w).hand.momentum_ratio, 1.0, 0.01);
}

/* Two hands on one cube, one through a proxy and one direct: each has its own coupling. */
TEST(pointers_of_one_body_have_each_their_own_coupling)
{
  const double k = 2000.0;
  const double k_v = 500.0;
  hap_pointer_id other;
  hap_pose pose = {{HAND_RADIUS + 0.05 - 0.002, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  contact_world *w = cw_new(0.0);
  cw_add_cube(w, 0.5, 0.05, 0.025, 0.0, 0.0);
  w->hand_def.stiffness = k;
  w->hand_def.damping = 5.0;
  use_proxy(w, k_v);
  cw_start(w, -HAND_RADIUS + 0.002, 0.0, 0.0);
  hap_pointer_def def = w->hand_def;
  hap_pointer_expert_def expert = w->hand_expert;
  def.expert = &expert;
  expert.coupling = HAP_COUPLING_DIRECT;
  CHECK(hap_pointer_add(w->session, &def, &other) == HAP_OK);
  CHECK(hap_pointer_set_target(w->session, other, &pose, NULL) == HAP_OK);
  cw_run(w, 3000); /* until it has come to rest between them */
  hap_pointer_state state;
  double soft = k * k_v / (k + k_v);
  CHECK(hap_pointer_get(w->session, other, &state, sizeof state) == HAP_OK);
  CHECK(state.coupling == HAP_COUPLING_DIRECT && state.contacts == 1);
  CHECK(state_of(w).coupling == HAP_COUPLING_PROXY && state_of(w).contacts == 1);
  CHECK_NEAR(state.wrench.force[0], 0.004 * soft * k / (soft + k), 1e-3);
  CHECK_NEAR(w->force[0], -state.wrench.force[0], 1e-3);
  CHECK(hap_pointer_remove(w->session, w->hand) ==
        HAP_OK); /* its place in the solver goes with it */
  CHECK(hap_session_advance(w->session, 200) == HAP_OK);
  CHECK(hap_pointer_get(w->session, other, &state, sizeof state) == HAP_OK);
  CHECK(state.wrench.force[0] == 0.0);
  w->hand_expert.coupling_stiffness = 1000.0;
  CHECK(hap_pointer_add(w->session, &w->hand_def, &w->hand) == HAP_OK);
  cw_put_hand(w, 0.0, 0.0, 0.0);
  CHECK(hap_session_advance(w->session, 3) == HAP_OK);
  CHECK_NEAR(state_of(w).coupling_stiffness, 1000.0, 1e-9);
  CHECK_NEAR(state_of(w).proxy.position[0], -HAND_RADIUS + 0.002, 1e-9);
}

/* Without mass the proxy keeps nothing: what the hand gives the cube gets. */
TEST(a_proxy_passes_the_whole_impulse_on)
{
  contact_world *w = cw_new(0.0);
  cw_add_cube(w, 0.2, 0.05, 0.025, 0.0, 0.0);
  w->hand_def.stiffness = 1e5;
  use_proxy(w, 400.0);
  cw_start(w, -HAND_RADIUS - 0.002, 0.0, 0.0);
  cw_go(w, 0.2, 0.0, 0.0, 400);
  CHECK(w->impulse[0] > 0.05);
  CHECK_NEAR(0.2 * w->velocity[0][0], w->impulse[0], 1e-6 * w->impulse[0]);
  CHECK_NEAR(cw_stats(w).hand.momentum_ratio, 1.0, 1e-9);
}

/* A cube of 60 g hit through the coupling: half a period of mass and spring, as if the hand were a
 * wall. Neither coupling nor contact damps. */
TEST(an_impact_through_the_proxy_has_the_time_of_its_spring)
{
  const double k_v = 300.0;
  const double k = 1e4;
  const double mass = 0.06;
  const double speed = 0.1;
  contact_world *w = cw_new(0.0);
  dBodyID cube = cw_add_cube(w, mass, 0.05, 0.025 + 0.005, 0.0, 0.0);
  dBodySetLinearVel(cube, -speed, 0.0, 0.0);
  w->hand_def.stiffness = k;
  w->hand_def.damping = 0.0;
  use_proxy(w, k_v);
  cw_start(w, -HAND_RADIUS, 0.0, 0.0);
  int touching = 0;
  double peak = 0.0;
  for (int i = 0; i < 300; ++i) {
    cw_tick(w);
    touching += state_of(w).contacts > 0;
    peak = fmax(peak, cw_norm(w->force));
  }
  double series = k * k_v / (k + k_v);
  CHECK_NEAR(touching * T, M_PI * sqrt(mass / series), 2.5 * T);
  CHECK_NEAR(peak, speed * sqrt(mass * series), 0.01 * speed * sqrt(mass * series));
  CHECK_NEAR(w->velocity[0][0], speed, 0.01 * speed);
}

/* ---- the choice ---- */

/* Small balls that stand around the way of the hand along z, to be touched all at once. */
static void add_ring(contact_world *w, int count)
{
  for (int i = 0; i < count; ++i) {
    double angle = 2.0 * M_PI * i / count;
    dGeomID ball = dCreateSphere(w->space, fmin(0.002, 0.015 / count)); /* apart */
    dGeomSetPosition(ball, 0.006 * cos(angle), 0.006 * sin(angle), 0.0);
  }
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 0.0);
}

static contact_world *open_many(int count, double hold)
{
  contact_world *w = cw_new(0.0);
  add_ring(w, count);
  w->hand_expert.coupling = HAP_COUPLING_AUTO;
  w->hand_expert.coupling_stiffness = hold;
  w->hand_def.stiffness = 300.0;
  cw_start(w, 0.0, 0.0, 0.03);
  return w;
}

TEST(auto_takes_the_proxy_for_more_than_the_device_holds)
{
  static const struct {
    int count;
    double hold;
    hap_coupling_reason reason;
  } cases[] = {{1, 500.0, HAP_COUPLING_WITHIN},
               {1, 200.0, HAP_COUPLING_ABOVE},
               {4, 1250.0, HAP_COUPLING_WITHIN},
               {4, 1150.0, HAP_COUPLING_ABOVE},
               {4, 0.0, HAP_COUPLING_UNKNOWN}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    bool above = cases[i].reason == HAP_COUPLING_ABOVE;
    contact_world *w = open_many(cases[i].count, cases[i].hold);
    REQUIRE(w != NULL);
    cw_run(w, 10);
    CHECK(state_of(w).coupling == HAP_COUPLING_DIRECT); /* nothing is near */
    cw_move_hand(w, 0.0, 0.0, -0.05);
    while (state_of(w).contacts < (uint32_t)cases[i].count && w->seen.ticks < 500) {
      cw_tick(w);
    }
    hap_pointer_state state = state_of(w);
    CHECK(state.contacts == (uint32_t)cases[i].count);
    CHECK(state.coupling == (above ? HAP_COUPLING_PROXY : HAP_COUPLING_DIRECT));
    CHECK(state.coupling_reason == cases[i].reason);
    CHECK_NEAR(state.coupling_stiffness, above ? cases[i].hold : 0.0, 1e-9);
    CHECK_NEAR(state.contact_stiffness, 300.0 * cases[i].count, 1e-9);
    cw_go(w, 0.0, 0.0, 0.05, 300);
    CHECK(state_of(w).coupling == HAP_COUPLING_DIRECT); /* and is let go of again */
    CHECK_NEAR(cw_norm(w->force), 0.0, 1e-9);
  }
}

/* A hand that presses a heavy cube down goes sideways over the border of a second one: the coupling
 * changes while there is force. */
TEST(the_change_while_pressing_has_no_jump)
{
  const double press = 0.002;
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  cw_add_cube(w, 5.0, 0.1, -0.05, 0.0, 0.05);
  cw_add_cube(w, 5.0, 0.1, 0.0505, 0.0, 0.05); /* a gap, else it is one surface */
  w->hand_expert.coupling = HAP_COUPLING_AUTO;
  w->hand_expert.coupling_stiffness = 1500.0; /* one contact of 1 kN/m, not two */
  w->hand_def.stiffness = 1000.0;
  w->hand_def.damping = 0.0;
  cw_start(w, -0.03, 0.0, 0.1 + HAND_RADIUS + 0.001);
  cw_go(w, 0.0, 0.0, -0.03, (int)lround((press + 0.001) / 0.03 / T));
  cw_move_hand(w, 0.05, 0.0, 0.0);
  double before = w->force[2];
  CHECK_NEAR(before, 1000.0 * press, 0.05);
  double jump = 0.0;
  bool changed = false;
  for (int i = 0; i < 600 && !changed; ++i) {
    before = w->force[2];
    cw_tick(w);
    changed = state_of(w).coupling == HAP_COUPLING_PROXY;
    jump = fmax(jump, fabs(w->force[2] - before));
  }
  CHECK(changed);
  CHECK(state_of(w).contacts == 1);    /* before the second contact closes */
  CHECK(jump < 0.06 * 1000.0 * press); /* 20 ms long 1 / 20 of the difference at most */
  cw_go(w, 0.0, 0.0, 0.0, 300);
  double series = 1000.0 * 1500.0 / 2500.0;
  CHECK_NEAR(w->force[2], series * press, 0.02 * series * press);
}

/* Seen, not felt: whatever is near, there is nothing that could shake. */
TEST(auto_without_a_force_stays_direct)
{
  static const double scale[] = {0.0, 1e-15};
  for (int i = 0; i < 2; ++i) {
    contact_world *w = cw_new(0.0);
    cw_add_floor(w);
    cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 1.0);
    w->hand_expert.coupling = HAP_COUPLING_AUTO;
    w->hand_expert.coupling_stiffness = 100.0;
    w->hand_def.force_scale = scale[i];
    cw_start(w, 0.0, 0.0, HAND_RADIUS + 0.001);
    cw_go(w, 0.0, 0.0, -0.03, 100);
    hap_pointer_state state = state_of(w);
    CHECK(state.contacts == 1 && state.coupling == HAP_COUPLING_DIRECT);
    CHECK(state.coupling_reason == (i == 0 ? HAP_COUPLING_UNKNOWN : HAP_COUPLING_WITHIN));
    CHECK(cw_stats(w).faults.count == 0);
    cw_close(w);
  }
}

/* A hand that taps: between two touches the coupling does not change, and after the last it
 * does. */
TEST(a_hop_does_not_change_the_coupling)
{
  contact_world *w = open_many(4, 1000.0);
  REQUIRE(w != NULL);
  cw_move_hand(w, 0.0, 0.0, -0.05);
  while (state_of(w).contacts < 4 && w->seen.ticks < 1000) {
    cw_tick(w);
  }
  CHECK(state_of(w).coupling == HAP_COUPLING_PROXY);
  int apart = 0;
  for (int i = 0; i < 44; ++i) { /* 2 mm away and back */
    cw_move_hand(w, 0.0, 0.0, i < 20 ? 0.1 : -0.1);
    cw_tick(w);
    CHECK(state_of(w).coupling == HAP_COUPLING_PROXY);
    apart += state_of(w).contacts == 0;
  }
  CHECK(apart > 20 && apart < 44);
  apart = 0;
  cw_move_hand(w, 0.0, 0.0, 0.1);
  for (int i = 0; i < 200; ++i) {
    cw_tick(w);
    apart = state_of(w).contacts == 0 ? apart + 1 : 0;
    CHECK(apart >= 50 || state_of(w).coupling == HAP_COUPLING_PROXY);
  }
  CHECK(state_of(w).coupling == HAP_COUPLING_DIRECT);
}

/* A proxy of 0.5 kg swings about the device when the touch is over: it is let go of where the
 * device is, not where it would leap. */
TEST(a_heavy_proxy_is_let_go_of_at_the_device)
{
  contact_world *w = cw_new(0.0);
  add_ring(w, 4);
  w->hand_expert.coupling = HAP_COUPLING_AUTO;
  w->hand_expert.coupling_stiffness = 1000.0;
  w->hand_expert.coupling_damping = 2.0;
  w->hand_def.stiffness = 300.0;
  w->hand_expert.proxy_mass = 0.5;
  cw_start(w, 0.0, 0.0, 0.03);
  cw_move_hand(w, 0.0, 0.0, -0.05);
  while (state_of(w).contacts < 4 && w->seen.ticks < 1000) {
    cw_tick(w);
  }
  CHECK(state_of(w).coupling == HAP_COUPLING_PROXY);
  hap_pointer_state state = state_of(w);
  double leap = 0.0;
  for (int i = 0; i < 5000 && state.coupling == HAP_COUPLING_PROXY; ++i) {
    cw_move_hand(w, 0.0, 0.0, i < 50 ? 1.0 : 0.0);
    double before = state.proxy.position[2];
    double way = T * state.twist.linear[2];
    cw_tick(w);
    state = state_of(w);
    leap = fabs(state.proxy.position[2] - before - way);
  }
  CHECK(state.coupling == HAP_COUPLING_DIRECT);
  CHECK(leap < 1e-4);
}

TEST(a_proxy_is_refused_where_it_cannot_be)
{
  hap_pointer_id id;
  contact_world *w = cw_new(0.0);
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, 0.0);
  hap_pointer_def def = w->hand_def;
  hap_pointer_expert_def expert = w->hand_expert;
  def.expert = &expert;
  expert.coupling = HAP_COUPLING_PROXY;
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT && id.v == 0);
  expert.coupling_stiffness = 100.0;
  def.force_scale = 0.0; /* a spring without a force at its other end */
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT && id.v == 0);
  def.force_scale = 1e-15; /* no number for the spring in the world */
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT && id.v == 0);
  def.force_scale = 1.0;
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_OK);
  w = cw_new(0.0);
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 0.0);
  w->def.model = HAP_MODEL_ACCELERANCE;
  cw_start(w, 0.0, 0.0, 0.0);
  CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_UNSUPPORTED);
  cw_tick(w);
  CHECK(state_of(w).coupling_reason == HAP_COUPLING_MODEL);
}

/* ---- proxy and guard ---- */

/* What the hand was given, by the force that was written over the way of the device. */
static double port_energy(contact_world *w, int ticks)
{
  double sum = 0.0;
  for (int i = 0; i < ticks; ++i) {
    double before[3];
    double force[3];
    memcpy(before, w->hand_at, sizeof before);
    memcpy(force, w->force, sizeof force);
    cw_tick(w);
    for (int k = 0; k < 3; ++k) {
      sum += force[k] * (w->hand_at[k] - before[k]);
    }
  }
  return sum;
}

/* The cube brings its energy with it: the observer has nothing to hold back. */
TEST(the_guard_leaves_an_impact_through_a_proxy_alone)
{
  double speed[2];
  for (int i = 0; i < 2; ++i) {
    contact_world *w = cw_new(0.0);
    dBodyID cube = cw_add_cube(w, 0.2, 0.05, 0.025 + 0.05, 0.0, 0.0);
    dBodySetLinearVel(cube, -1.0, 0.0, 0.0);
    w->research.guard = i == 0 ? HAP_GUARD_MEASURE : HAP_GUARD_ON;
    w->hand_def.stiffness = 1e5;
    w->hand_def.damping = 0.0;
    use_proxy(w, 800.0);
    cw_start(w, -HAND_RADIUS, 0.0, 0.0);
    cw_run(w, 45);
    double given = port_energy(w, 20);
    cw_move_hand(w, -0.3, 0.0, 0.0); /* and gives way */
    given += port_energy(w, 200);
    speed[i] = w->velocity[0][0];
    CHECK(given > 0.01);
    CHECK(cw_stats(w).faults.energy_ticks == 0);
    cw_close(w);
  }
  CHECK_NEAR(speed[1], speed[0], 1e-9);
}

/* At the change the spring of the coupling is there at once, with a force in it: the hand must
 * not get what it never put in. */
TEST(a_change_of_the_coupling_is_no_source_of_energy)
{
  for (int i = 0; i < 2; ++i) {
    contact_world *w = cw_new(0.0);
    cw_add_floor(w);
    cw_add_cube(w, 5.0, 0.1, -0.05, 0.0, 0.05);
    cw_add_cube(w, 5.0, 0.1, 0.0505, 0.0, 0.05); /* a gap, else it is one surface */
    w->research.guard = i == 0 ? HAP_GUARD_MEASURE : HAP_GUARD_ON;
    w->hand_expert.coupling = HAP_COUPLING_AUTO;
    w->hand_expert.coupling_stiffness = 4500.0;
    w->hand_def.stiffness = 4000.0;
    w->hand_def.damping = 0.0;
    w->hand_def.max_force = 20.0;
    cw_start(w, -0.03, 0.0, 0.1 + HAND_RADIUS + 0.001);
    double given = port_energy(w, 30);
    cw_move_hand(w, 0.0, 0.0, -0.03);
    given += port_energy(w, 133);
    cw_move_hand(w, 0.1, 0.0, 0.0);
    while (state_of(w).coupling == HAP_COUPLING_DIRECT && w->seen.ticks < 1000) {
      given += port_energy(w, 1);
    }
    CHECK(state_of(w).coupling == HAP_COUPLING_PROXY);
    double put_in = -given;
    cw_move_hand(w, 0.0, 0.0, 1.0);
    given += port_energy(w, 100);
    printf("# guard %s: put in %.4g J, got back %.4g J\n", i == 0 ? "off" : "on", put_in,
           given + put_in);
    CHECK(put_in > 0.01);
    CHECK(i == 0 || given < 0.02 * put_in); /* 1 % of what the two springs held together */
    cw_close(w);
  }
}

/* ---- models that have no proxy ---- */

static void change_model(contact_world *w, hap_model model)
{
  CHECK(hap_session_set_model(w->session, model) == HAP_OK);
  for (int i = 0; i < 200 && cw_stats(w).loop.model != (uint32_t)model; ++i) {
    cw_tick(w);
  }
  CHECK(cw_stats(w).loop.model == (uint32_t)model);
}

/* Pressed 2 mm into the floor, through a proxy while the model has one. */
TEST(another_model_ends_the_proxy_and_contact_begins_it_anew)
{
  const double k = 8000.0;
  const double k_v = 500.0;
  const double series = k * k_v / (k + k_v);
  contact_world *w = proxy_wall(k, k_v);
  cw_start(w, 0.0, 0.0, HAND_RADIUS + 0.001);
  cw_go(w, 0.0, 0.0, -0.03, 100);
  cw_go(w, 0.0, 0.0, 0.0, 100);
  CHECK_NEAR(w->force[2], 0.002 * series, 1e-6);
  change_model(w, HAP_MODEL_ACCELERANCE);
  hap_pointer_state state = state_of(w);
  CHECK(state.coupling == HAP_COUPLING_DIRECT && state.coupling_reason == HAP_COUPLING_MODEL);
  CHECK(state.coupling_stiffness == 0.0 && state.contact_stiffness == 0.0);
  CHECK_NEAR(state.proxy.position[2], state.device.position[2], 1e-12);
  CHECK(w->force[2] <= 0.002 * k / 20.0 + 1e-9); /* what was behind the spring comes in slowly */
  cw_run(w, 100);
  CHECK_NEAR(w->force[2], 0.002 * k, 1e-6);
  cw_go(w, 0.3, 0.0, 0.0, 100); /* far from where the proxy was */
  cw_go(w, 0.0, 0.0, 0.0, 10);
  change_model(w, HAP_MODEL_CONTACT);
  state = state_of(w);
  CHECK(state.coupling == HAP_COUPLING_PROXY && state.coupling_reason == HAP_COUPLING_ASKED);
  CHECK_NEAR(w->force[0], 0.0, 1e-6);
  CHECK(w->force[2] > 0.0 && w->force[2] < 0.002 * k + 1e-6);
  cw_run(w, 300);
  CHECK_NEAR(w->force[2], 0.002 * series, 1e-5);
}

/* ---- eight contacts at once ---- */

/* A device of 0.1 kg and 0.2 N s/m in a relaxed hand that presses it into a ring of balls; the
 * fastest it moves when it should have come to rest. */
static double hand_shaking(hap_coupling coupling, int count, double stiffness)
{
  hap_detail detail = {""};
  double fastest = 0.0;
  contact_world *w = cw_new(0.0);
  add_ring(w, count);
  w->hand_def.stiffness = stiffness;
  w->hand_def.damping = 0.0;
  w->hand_expert.coupling = coupling;
  w->ode.world = w->world;
  w->ode.space = w->space;
  w->ode.user = w;
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_OK);
  CHECK(hap_device_open("virtual:hand=relaxed,device_mass=0.1,device_damping=0.2,max_force=1000,"
                        "path=0:0/0/0.014;1:0/0/0",
                        &w->hand_def.device, &detail) == HAP_OK);
  CHECK(hap_pointer_add(w->session, &w->hand_def, &w->hand) == HAP_OK);
  CHECK(hap_session_start(w->session) == HAP_OK);
  CHECK(hap_session_advance(w->session, 3000) == HAP_OK);
  hap_pointer_state state = state_of(w);
  double at = state.device.position[2];
  for (int i = 0; i < 500; ++i) {
    CHECK(hap_session_advance(w->session, 1) == HAP_OK);
    state = state_of(w);
    fastest = fmax(fastest, fabs(state.device.position[2] - at) / T);
    at = state.device.position[2];
  }
  CHECK(state.contacts == (uint32_t)count || coupling == HAP_COUPLING_DIRECT);
  hap_session_stop(w->session);
  hap_device *device = w->hand_def.device;
  cw_close(w);
  hap_device_close(device);
  return fastest;
}

TEST(eight_contacts_at_once_do_not_shake_the_device)
{
  double direct = hand_shaking(HAP_COUPLING_DIRECT, 8, 2000.0);
  double chosen = hand_shaking(HAP_COUPLING_AUTO, 8, 2000.0);
  printf("# device at rest moves: direct %.3g m/s, auto %.3g m/s\n", direct, chosen);
  CHECK(direct > 1e-3);
  CHECK(chosen < 1e-6);
  CHECK(hand_shaking(HAP_COUPLING_AUTO, 64, 1e6) < 1e-6);
}
