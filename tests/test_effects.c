/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tap.h"

#include <math.h>
#include <string.h>

#include "contact_world.h"
#include "solids.h"
#include "tools/rig.h"

/* Each effect: decided from worlds that are made for it, for its reason; off leaves it out; auto
 * is as on. */

#define EDGE 0.05
#define HAND 0.01

static hap_effect_info effect_look(const contact_world *w, hap_effect effect)
{
  hap_effect_info all[HAP_EFFECTS];
  memset(all, 0, sizeof all);
  CHECK(hap_session_effects(w->session, all, HAP_EFFECTS, sizeof all[0]) == HAP_OK);
  return all[effect];
}

static bool effect_is(const contact_world *w, hap_effect effect, hap_effect_state state,
                      hap_effect_reason reason)
{
  hap_effect_info info = effect_look(w, effect);
  bool good = info.state == (uint32_t)state && info.reason == (uint32_t)reason;
  if (!good) {
    printf("# %s: state %u, %u of %u, %s\n", hap_effect_name(effect), info.state, info.on, info.of,
           hap_effect_reason_text((hap_effect_reason)info.reason));
  }
  return good;
}

static bool is_off(const contact_world *w, hap_effect effect, hap_effect_reason reason)
{
  return effect_is(w, effect, HAP_EFFECT_IS_OFF, reason);
}

static bool is_called(const contact_world *w, hap_effect effect)
{
  return effect_is(w, effect, HAP_EFFECT_IS_ON, HAP_REASON_CALLED);
}

static void effect_wish(contact_world *w, hap_effect effect, hap_effect_wish wished)
{
  expert_wish(&w->expert, effect, wished);
}

/* A cube on a floor, and a hand that comes from its left. */
static contact_world *open_on_floor(int cubes)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < cubes; ++i) {
    cw_add_cube(w, 0.2, EDGE, i * (EDGE + 1e-4), 0.0, EDGE / 2);
  }
  return w;
}

static void start_left(contact_world *w, double gap)
{
  cw_move_hand(w, 0.1, 0.0, 0.0);
  cw_start(w, -EDGE / 2 - HAND - gap, 0.0, EDGE / 2);
}

/* ---- why ---- */

TEST(a_free_body_alone_calls_for_nothing)
{
  contact_world *w = cw_new(0.0);
  w->research.guard = HAP_GUARD_ON;
  cw_add_cube(w, 0.2, EDGE, 0.0, 0.0, 0.0);
  cw_start(w, -EDGE / 2 - HAND - 0.002, 0.0, 0.0);
  cw_go(w, 0.1, 0.0, 0.0, 60);
  CHECK(is_off(w, HAP_EFFECT_TESTING, HAP_REASON_OWNED));
  CHECK(is_off(w, HAP_EFFECT_CROSS, HAP_REASON_NOT_IN_MODEL));
  CHECK(is_off(w, HAP_EFFECT_CONTACTS, HAP_REASON_ALONE));
  CHECK(is_off(w, HAP_EFFECT_PASSES, HAP_REASON_ALONE));
  CHECK(is_off(w, HAP_EFFECT_JOINTS, HAP_REASON_FREE));
  CHECK(is_off(w, HAP_EFFECT_RANGE, HAP_REASON_ALONE));
  CHECK(is_off(w, HAP_EFFECT_RESTITUTION, HAP_REASON_ALONE));
  CHECK(is_off(w, HAP_EFFECT_FRICTION, HAP_REASON_NO_FRICTION));
  CHECK(is_off(w, HAP_EFFECT_TORQUE, HAP_REASON_ROUND));
  CHECK(is_off(w, HAP_EFFECT_GYRO, HAP_REASON_SYMMETRIC));
  CHECK(is_called(w, HAP_EFFECT_SHAPE));
  CHECK(is_off(w, HAP_EFFECT_PROXY, HAP_REASON_DEVICE_UNKNOWN));
  CHECK(is_called(w, HAP_EFFECT_OBSERVER));
  CHECK(is_off(w, HAP_EFFECT_RECORDING, HAP_REASON_NOT_RECORDED));
  hap_stats stats = cw_stats(w);
  CHECK(stats.probes.steps == 0 && stats.contact.passes == 0 && stats.contact.us_max == 0.0);
  CHECK(stats.loop.contact_ticks > 0 &&
        w->velocity[0][0] > 0.01); /* it is pushed, and does not wait */
}

TEST(far_away_nothing_is_on)
{
  contact_world *w = open_on_floor(2);
  w->research.guard = HAP_GUARD_ON;
  cw_start(w, 0.0, 0.0, 5.0);
  cw_run(w, 60);
  for (int i = HAP_EFFECT_TESTING; i <= HAP_EFFECT_PASSES; ++i) {
    hap_effect effect = (hap_effect)i;
    CHECK(effect == HAP_EFFECT_CROSS || is_off(w, effect, HAP_REASON_FAR));
  }
  CHECK(is_off(w, HAP_EFFECT_JOINTS, HAP_REASON_FAR));
  CHECK(is_off(w, HAP_EFFECT_RANGE, HAP_REASON_FAR));
  CHECK(is_off(w, HAP_EFFECT_RESTITUTION, HAP_REASON_FAR));
  CHECK(is_off(w, HAP_EFFECT_FRICTION, HAP_REASON_FAR));
  CHECK(is_off(w, HAP_EFFECT_GYRO, HAP_REASON_FAR));
  CHECK(is_off(w, HAP_EFFECT_SHAPE, HAP_REASON_FAR));
  CHECK(is_off(w, HAP_EFFECT_OBSERVER, HAP_REASON_FAR));
  CHECK(cw_stats(w).contact.passes == 0);
}

TEST(a_row_on_a_floor_calls_for_contacts_passes_and_range)
{
  contact_world *w = open_on_floor(3);
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(is_called(w, HAP_EFFECT_CONTACTS) && effect_look(w, HAP_EFFECT_CONTACTS).on == 3);
  CHECK(is_called(w, HAP_EFFECT_PASSES));
  CHECK(is_called(w, HAP_EFFECT_RANGE) && effect_look(w, HAP_EFFECT_RANGE).on == 2);
  CHECK(is_off(w, HAP_EFFECT_RESTITUTION, HAP_REASON_NO_BOUNCE));
  CHECK(is_off(w, HAP_EFFECT_OBSERVER, HAP_REASON_MEASURING));
  CHECK(cw_stats(w).contact.passes > 8);
}

TEST(surfaces_that_give_back_speed_call_for_restitution)
{
  contact_world *w = open_on_floor(1);
  w->surface.mode |= dContactBounce;
  w->surface.bounce = 0.4;
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(is_called(w, HAP_EFFECT_RESTITUTION));
}

static dBodyID add_hinged_door(contact_world *w)
{
  dBodyID door = cw_add_box(w, 1.0, (const double[3]){0.2, 0.02, 0.2}, 0.1, 0.0, 0.0);
  dJointID hinge = dJointCreateHinge(w->world, NULL);
  dJointAttach(hinge, door, NULL);
  dJointSetHingeAnchor(hinge, 0.0, 0.0, 0.0);
  dJointSetHingeAxis(hinge, 0.0, 0.0, 1.0);
  return door;
}

static contact_world *open_door(void)
{
  contact_world *w = cw_new(0.0);
  add_hinged_door(w);
  cw_move_hand(w, 0.0, 0.1, 0.0);
  return w;
}

static void start_at_door(contact_world *w)
{
  cw_start(w, 0.18, -0.01 - HAND - 0.002, 0.0);
}

TEST(a_hinge_calls_for_joints)
{
  contact_world *w = open_door();
  start_at_door(w);
  cw_run(w, 160);
  CHECK(is_called(w, HAP_EFFECT_JOINTS) && effect_look(w, HAP_EFFECT_JOINTS).on == 1);
  CHECK(is_called(w, HAP_EFFECT_GYRO)); /* a box that spins by now */
}

TEST(why_a_body_has_no_gyroscopic_term)
{
  const struct {
    bool spins;
    bool locked;
    bool mode;
    bool sleeps;
    hap_effect_reason reason;
  } cases[] = {{true, false, true, false, HAP_REASON_CALLED},
               {false, false, true, false, HAP_REASON_STILL},
               {false, true, true, false, HAP_REASON_LOCKED},
               {true, false, false, false, HAP_REASON_NOT_IN_WORLD},
               {false, false, true, true, HAP_REASON_ASLEEP}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    contact_world *w = cw_new(0.0);
    dBodyID plate = cw_add_box(w, 0.5, (const double[3]){0.2, 0.1, 0.02}, 0.0, 0.0, 0.0);
    dBodySetAngularVel(plate, 0.0, cases[i].spins ? 0.3 : 0.0, cases[i].spins ? 0.4 : 0.0);
    dBodySetGyroscopicMode(plate, cases[i].mode);
    if (cases[i].locked) {
      dBodySetMaxAngularSpeed(plate, 0.0);
    }
    if (cases[i].sleeps) {
      dBodyDisable(plate);
    }
    cw_start(w, 0.0, 0.0, 0.01 + HAND + 0.012);
    cw_run(w, 60);
    CHECK(effect_is(w, HAP_EFFECT_GYRO,
                    cases[i].reason == HAP_REASON_CALLED ? HAP_EFFECT_IS_ON : HAP_EFFECT_IS_OFF,
                    cases[i].reason));
    cw_close(w);
  }
}

TEST(friction_calls_for_friction_and_for_torque)
{
  contact_world *w = open_on_floor(1);
  w->hand_def.friction = 0.5;
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(is_called(w, HAP_EFFECT_FRICTION));
  CHECK(is_called(w, HAP_EFFECT_TORQUE)); /* this hand turns */
}

TEST(a_plane_needs_no_shape_and_a_convex_geom_has_none)
{
  static box_arrays box;
  contact_world *w = cw_new(0.0);
  cw_add_floor(w);
  cw_start(w, 0.0, 0.0, HAND + 0.002);
  cw_run(w, 60);
  CHECK(is_off(w, HAP_EFFECT_SHAPE, HAP_REASON_FLAT));
  CHECK(hap_session_set_effect(w->session, HAP_EFFECT_SHAPE, HAP_EFFECT_ON) == HAP_OK);
  cw_run(w, 60);
  CHECK(effect_is(w, HAP_EFFECT_SHAPE, HAP_EFFECT_IS_ON, HAP_REASON_ASKED));

  dMass m;
  w = cw_new(0.0);
  dMassSetBoxTotal(&m, 0.1, 0.04, 0.04, 0.04);
  cw_add(w, convex_box(w->space, &box, AT(0.02, 0.02, 0.02)), &m, 0.0, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, 0.02 + HAND + 0.002);
  cw_run(w, 60);
  CHECK(is_off(w, HAP_EFFECT_SHAPE, HAP_REASON_NO_CLOSED_FORM));
}

TEST(a_tool_that_touches_is_near_and_has_no_closed_form)
{
  double corners[24];
  box_corners(AT(HAND, HAND, HAND), AT(0.0, 0.0, 0.0), corners);
  contact_world *w = open_on_floor(1);
  w->hand_def.hull_xyz = corners;
  w->hand_def.hull_points = 8;
  w->hand_def.radius = 0.001;
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(cw_stats(w).loop.contact_ticks > 0);
  CHECK(is_off(w, HAP_EFFECT_SHAPE, HAP_REASON_NO_CLOSED_FORM));
}

TEST(the_range_that_has_no_room_is_told)
{
  contact_world *w = open_on_floor(4);
  w->def.max_bodies = 2;
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(effect_is(w, HAP_EFFECT_RANGE, HAP_EFFECT_IS_PARTLY, HAP_REASON_OUTSIDE));
}

TEST(a_coupling_of_its_own_is_a_reason)
{
  contact_world *w = open_on_floor(1);
  w->hand_expert.coupling = HAP_COUPLING_DIRECT;
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(is_off(w, HAP_EFFECT_PROXY, HAP_REASON_COUPLING));
}

TEST(what_the_device_can_hold_decides_on_the_proxy)
{
  for (int i = 0; i < 2; ++i) {
    contact_world *w = open_on_floor(1);
    w->hand_expert.coupling_stiffness = i == 0 ? 5000.0 : 500.0;
    start_left(w, 0.0);
    cw_run(w, 101);
    CHECK(i == 0 ? is_off(w, HAP_EFFECT_PROXY, HAP_REASON_WITHIN) : is_called(w, HAP_EFFECT_PROXY));
  }
}

/* ---- model accelerance ---- */

TEST(a_free_body_needs_no_testing_simulation_and_answers_alike)
{
  double force[2][3];
  double velocity[2];
  for (int i = 0; i < 2; ++i) {
    contact_world *w = cw_new(0.0);
    w->def.model = HAP_MODEL_ACCELERANCE;
    effect_wish(w, HAP_EFFECT_TESTING, i == 0 ? HAP_EFFECT_AUTO : HAP_EFFECT_ON);
    cw_add_cube(w, 0.2, EDGE, 0.0, 0.0, 0.0);
    cw_start(w, -EDGE / 2 - HAND - 0.002, 0.01, 0.0); /* beside the middle: it turns */
    cw_go(w, 0.1, 0.0, 0.0, 80);
    CHECK(i == 0 ? is_off(w, HAP_EFFECT_TESTING, HAP_REASON_FREE)
                 : effect_is(w, HAP_EFFECT_TESTING, HAP_EFFECT_IS_ON, HAP_REASON_ASKED));
    CHECK((cw_stats(w).probes.steps == 0) == (i == 0));
    memcpy(force[i], w->force, sizeof w->force);
    velocity[i] = w->velocity[0][0];
    cw_close(w);
  }
  CHECK(cw_norm(force[0]) > 0.01 || velocity[0] > 0.01);
  for (int k = 0; k < 3; ++k) {
    CHECK_NEAR(force[0][k], force[1][k], 1e-6);
  }
  CHECK_NEAR(velocity[0], velocity[1], 1e-8);
}

TEST(a_body_on_a_floor_is_tested)
{
  contact_world *w = open_on_floor(2);
  w->def.model = HAP_MODEL_ACCELERANCE;
  start_left(w, 0.002);
  cw_run(w, 60);
  CHECK(is_called(w, HAP_EFFECT_TESTING));
  CHECK(is_off(w, HAP_EFFECT_GYRO, HAP_REASON_NOT_IN_MODEL));
  CHECK(is_off(w, HAP_EFFECT_PROXY, HAP_REASON_NOT_IN_MODEL));
}

TEST(bodies_of_one_island_call_for_cross_accelerance)
{
  for (int i = 0; i < 3; ++i) {
    contact_world *w = cw_new(0.0);
    w->def.model = HAP_MODEL_ACCELERANCE;
    expert_wish(&w->expert, HAP_EFFECT_CROSS, i < 2 ? HAP_EFFECT_ON : HAP_EFFECT_AUTO);
    dBodyID a = cw_add_cube(w, 0.2, EDGE, 0.0, 0.0, 0.0);
    dBodyID b = cw_add_cube(w, 0.2, EDGE, EDGE + 0.002, 0.0, 0.0);
    if (i != 1) {
      dJointID joint = dJointCreateFixed(w->world, NULL);
      dJointAttach(joint, a, b);
      dJointSetFixed(joint);
    }
    cw_start(w, EDGE / 2, 0.0, EDGE / 2 + HAND + 0.002);
    cw_run(w, 130); /* two ticks of them are looked at */
    hap_effect_info info = effect_look(w, HAP_EFFECT_CROSS);
    CHECK(i == 2 ? is_off(w, HAP_EFFECT_CROSS, HAP_REASON_NOT_PAPERS)
                 : info.reason == HAP_REASON_ASKED);
    CHECK((info.on > 0) == (i == 0));
    CHECK((info.physics_ms > 0.0) == (i < 2)); /* that there is none has to be found out */
    CHECK(isnan(info.tick_us) || (info.tick_us > 0.0) == (i == 0));
    cw_close(w);
  }
}

/* ---- off leaves it out ---- */

/* Two cubes in a row, of which the first is pushed: how fast the second one moves in the loop
 * between two syncs, before the world could say anything of it. */
static double second_moves(hap_effect effect, hap_effect_wish wished)
{
  contact_world *w = cw_new(0.0);
  effect_wish(w, effect, wished);
  cw_add_cube(w, 0.2, EDGE, 0.0, 0.0, 0.0);
  cw_add_cube(w, 0.2, EDGE, EDGE + 1e-4, 0.0, 0.0);
  dJointID joint = dJointCreateBall(w->world, NULL);
  if (effect == HAP_EFFECT_JOINTS) {
    dJointAttach(joint, w->bodies[0], w->bodies[1]);
    dJointSetBallAnchor(joint, EDGE / 2, 0.0, 0.0);
  }
  cw_move_hand(w, 0.2, 0.0, 0.0);
  cw_start(w, -EDGE / 2 - HAND - 0.011, 0.0, 0.0); /* touches just after a sync */
  cw_run(w, 75);
  return w->velocity[1][0];
}

TEST(contacts_and_joints_that_are_off_are_not_in_the_loop)
{
  double with = second_moves(HAP_EFFECT_CONTACTS, HAP_EFFECT_AUTO);
  CHECK(with > 0.02);
  CHECK_NEAR(second_moves(HAP_EFFECT_CONTACTS, HAP_EFFECT_ON), with, 1e-12);
  CHECK_NEAR(second_moves(HAP_EFFECT_CONTACTS, HAP_EFFECT_OFF), 0.0, 1e-6);
  with = second_moves(HAP_EFFECT_JOINTS, HAP_EFFECT_AUTO);
  CHECK(with > 0.02);
  CHECK_NEAR(second_moves(HAP_EFFECT_JOINTS, HAP_EFFECT_ON), with, 1e-12);
  CHECK(second_moves(HAP_EFFECT_JOINTS, HAP_EFFECT_OFF) < 0.9 * with);
}

TEST(what_the_loop_does_not_simulate_is_measured_or_nothing_is_known_of_it)
{
  for (int i = 0; i < 2; ++i) {
    contact_world *w = open_door();
    effect_wish(w, HAP_EFFECT_JOINTS, HAP_EFFECT_OFF);
    effect_wish(w, HAP_EFFECT_TESTING, i == 0 ? HAP_EFFECT_AUTO : HAP_EFFECT_OFF);
    start_at_door(w);
    cw_run(w, 60);
    hap_stats stats = cw_stats(w);
    CHECK(stats.model.range_bodies == 0 && stats.model.range_joints == 0);
    CHECK((stats.model.measured_bodies == 1) == (i == 0) && (stats.probes.steps > 0) == (i == 0));
    CHECK(effect_is(w, HAP_EFFECT_JOINTS, HAP_EFFECT_IS_OFF, HAP_REASON_ASKED));
    CHECK(i == 0 ? is_called(w, HAP_EFFECT_TESTING)
                 : is_off(w, HAP_EFFECT_TESTING, HAP_REASON_ASKED));
  }
}

TEST(the_range_that_is_off_ends_at_the_neighbours)
{
  for (int i = 0; i < 2; ++i) {
    contact_world *w = open_on_floor(4);
    effect_wish(w, HAP_EFFECT_RANGE, i == 0 ? HAP_EFFECT_OFF : HAP_EFFECT_ON);
    cw_add_cube(w, 0.2, EDGE, 2.0, 2.0, EDGE / 2); /* far from all */
    w->def.physics_hz = 50.0;
    start_left(w, 0.002);
    cw_run(w, 60);
    CHECK(cw_stats(w).model.range_bodies == (i == 0 ? 1u : 5u));
    CHECK(i == 0 ? is_off(w, HAP_EFFECT_RANGE, HAP_REASON_ASKED)
                 : effect_is(w, HAP_EFFECT_RANGE, HAP_EFFECT_IS_ON, HAP_REASON_ASKED));
  }
}

TEST(passes_that_are_off_come_with_the_syncs)
{
  static const hap_effect_wish wishes[] = {HAP_EFFECT_OFF, HAP_EFFECT_AUTO, HAP_EFFECT_ON};
  uint64_t passes[3];
  for (int i = 0; i < 3; ++i) {
    contact_world *w = open_on_floor(1);
    effect_wish(w, HAP_EFFECT_PASSES, wishes[i]);
    start_left(w, 0.002);
    cw_run(w, 500);
    passes[i] = cw_stats(w).contact.passes;
    CHECK(fabs(w->position[0][2] - EDGE / 2) < 1e-3); /* the floor holds all the same */
  }
  CHECK(passes[0] >= 8 && passes[0] <= 12); /* 0.5 s at 20 Hz */
  CHECK(passes[1] >= 90 && passes[1] == passes[2]);
}

TEST(passes_that_are_asked_for_come_without_need)
{
  contact_world *w = cw_new(0.0);
  effect_wish(w, HAP_EFFECT_PASSES, HAP_EFFECT_ON);
  cw_add_cube(w, 0.2, EDGE, 0.0, 0.0, 0.0);
  cw_start(w, -EDGE, 0.0, 0.0);
  cw_run(w, 200);
  CHECK(cw_stats(w).contact.passes >= 35);
}

static double bounces_to(hap_effect_wish wished)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  w->surface.mode |= dContactBounce;
  w->surface.bounce = 0.8;
  effect_wish(w, HAP_EFFECT_RESTITUTION, wished);
  cw_add_ball(w, 0.2, 0.02, 0.0, 0.0, 0.05);
  cw_start(w, 0.0, 0.0, 0.02 + 0.05 + HAND + 0.002);
  cw_go(w, 0.0, 0.0, 0.1, 120);
  return w->velocity[0][2];
}

TEST(restitution_that_is_off_gives_back_nothing)
{
  double with = bounces_to(HAP_EFFECT_AUTO);
  CHECK(with > 0.0);
  CHECK_NEAR(bounces_to(HAP_EFFECT_ON), with, 1e-12);
  CHECK(bounces_to(HAP_EFFECT_OFF) < 1e-3);
}

/* Along a floor that is pressed on: force and torque at the end. */
static void rub_floor(hap_effect effect, hap_effect_wish wished, double mu, hap_wrench *out)
{
  contact_world *w = cw_new(0.0);
  cw_add_floor(w);
  w->hand_def.friction = mu;
  effect_wish(w, effect, wished);
  cw_move_hand(w, 0.05, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, HAND - 0.001);
  cw_run(w, 200);
  memcpy(out->force, w->row.pointers[0].force, sizeof out->force);
  memcpy(out->torque, w->row.pointers[0].torque, sizeof out->torque);
}

TEST(friction_and_torque_that_are_off_are_zero)
{
  hap_wrench with;
  hap_wrench without;
  rub_floor(HAP_EFFECT_FRICTION, HAP_EFFECT_AUTO, 0.5, &with);
  CHECK_NEAR(with.force[0], -0.5 * with.force[2], 1e-3 * with.force[2]);
  CHECK(fabs(with.torque[1]) > 1e-3);
  rub_floor(HAP_EFFECT_FRICTION, HAP_EFFECT_OFF, 0.5, &without);
  CHECK(without.force[0] == 0.0 && without.force[2] > 1.0 && without.torque[1] == 0.0);
  rub_floor(HAP_EFFECT_TORQUE, HAP_EFFECT_OFF, 0.5, &without);
  CHECK(without.torque[1] == 0.0);
  CHECK_NEAR(without.force[0], with.force[0], 1e-9);
  rub_floor(HAP_EFFECT_FRICTION, HAP_EFFECT_ON, 0.0, &with); /* rows that may give nothing */
  rub_floor(HAP_EFFECT_FRICTION, HAP_EFFECT_AUTO, 0.0, &without);
  CHECK_NEAR(with.force[0], 0.0, 1e-12);
  CHECK_NEAR(with.force[2], without.force[2], 1e-9);
}

/* The inertia of a plate in a ball, spinning about its middle axis and a little about another
 * one. */
static double box_tumbles(hap_effect_wish wished)
{
  contact_world *w = cw_new(0.0);
  effect_wish(w, HAP_EFFECT_GYRO, wished);
  dMass mass;
  dMassSetBoxTotal(&mass, 0.5, 0.2, 0.1, 0.02);
  dBodyID plate = cw_add(w, dCreateSphere(w->space, 0.05), &mass, 0.0, 0.0, 0.0);
  dBodySetAngularVel(plate, 0.5, 8.0, 0.0);
  dBodySetGyroscopicMode(plate, 1);
  cw_start(w, 0.0, 0.0, 0.05 + HAND + 0.003);
  cw_run(w, 301);
  CHECK(effect_look(w, HAP_EFFECT_GYRO).of == 1 && cw_stats(w).loop.contact_ticks == 0);
  return dBodyGetAngularVel(plate)[2];
}

TEST(a_gyroscopic_term_that_is_off_does_not_tumble)
{
  CHECK(fabs(box_tumbles(HAP_EFFECT_AUTO)) > 0.5);
  CHECK_NEAR(box_tumbles(HAP_EFFECT_ON), box_tumbles(HAP_EFFECT_AUTO), 1e-9);
  CHECK_NEAR(box_tumbles(HAP_EFFECT_OFF), 0.0, 1e-9);
}

/* A hand that goes across a ball without pressing it: on a plane it would sink in beside it. */
static double across_ball(hap_effect_wish wished)
{
  contact_world *w = cw_new(0.0);
  effect_wish(w, HAP_EFFECT_SHAPE, wished);
  dGeomID ball = dCreateSphere(w->space, 0.05);
  dGeomSetPosition(ball, 0.0, 0.0, 0.0);
  cw_move_hand(w, 0.2, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, 0.05 + HAND - 0.005);
  cw_run(w, 99); /* two ticks short of a sync */
  return w->force[2];
}

TEST(the_shape_that_is_off_is_a_plane)
{
  double shape = across_ball(HAP_EFFECT_AUTO);
  CHECK_NEAR(across_ball(HAP_EFFECT_ON), shape, 1e-12);
  CHECK(fabs(across_ball(HAP_EFFECT_OFF) - shape) > 0.1);
}

TEST(the_proxy_can_be_had_and_left_out)
{
  static const hap_effect_wish wishes[] = {HAP_EFFECT_OFF, HAP_EFFECT_ON};
  for (int i = 0; i < 2; ++i) {
    hap_pointer_state state;
    contact_world *w = open_on_floor(1);
    w->hand_expert.coupling_stiffness = i == 0 ? 500.0 : 5000.0; /* auto would do the other */
    effect_wish(w, HAP_EFFECT_PROXY, wishes[i]);
    start_left(w, 0.0);
    cw_run(w, 101);
    REQUIRE(hap_pointer_get(w->session, w->hand, &state, sizeof state) == HAP_OK);
    CHECK(state.coupling == (uint32_t)(i == 0 ? HAP_COUPLING_DIRECT : HAP_COUPLING_PROXY));
    CHECK(effect_is(w, HAP_EFFECT_PROXY, i == 0 ? HAP_EFFECT_IS_OFF : HAP_EFFECT_IS_ON,
                    HAP_REASON_ASKED));
  }
}

/* ---- at run time, refusals, figures ---- */

TEST(wishes_can_change_from_sync_to_sync)
{
  contact_world *w = open_on_floor(2);
  w->hand_def.friction = 0.3;
  w->hand_expert.coupling_stiffness = 5000.0;
  w->research.guard = HAP_GUARD_ON;
  start_left(w, 0.0);
  for (int round = 0; round < 3; ++round) {
    hap_effect_wish wished = (hap_effect_wish)(round == 2 ? HAP_EFFECT_AUTO : round + 1);
    for (int i = 0; i < HAP_EFFECT_RECORDING; ++i) {
      if (i != HAP_EFFECT_CROSS) {
        CHECK(hap_session_set_effect(w->session, (hap_effect)i, wished) == HAP_OK);
        CHECK(effect_look(w, (hap_effect)i).wish == (uint32_t)wished);
      }
    }
    cw_run(w, 101);
    bool off = wished == HAP_EFFECT_OFF;
    CHECK((effect_look(w, HAP_EFFECT_OBSERVER).state == HAP_EFFECT_IS_OFF) == off);
    CHECK((effect_look(w, HAP_EFFECT_FRICTION).state == HAP_EFFECT_IS_OFF) == off);
    CHECK((effect_look(w, HAP_EFFECT_CONTACTS).state == HAP_EFFECT_IS_OFF) == off);
    CHECK(wished == HAP_EFFECT_AUTO || /* which stays one as long as it is touched */
          (effect_look(w, HAP_EFFECT_PROXY).state == HAP_EFFECT_IS_OFF) == off);
    CHECK(isfinite(w->force[0]) && cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

static bool detail_says(const hap_detail *detail, const char *what)
{
  bool found = strstr(detail->text, what) != NULL;
  if (!found) {
    printf("# %s\n", detail->text);
  }
  return found;
}

TEST(what_a_model_cannot_do_is_refused_with_what_to_do)
{
  const struct {
    hap_effect effect;
    hap_effect_wish wish;
    hap_model model;
    const char *text;
  } cases[] = {{HAP_EFFECT_GYRO, HAP_EFFECT_ON, HAP_MODEL_ACCELERANCE, "use model contact"},
               {HAP_EFFECT_CROSS, HAP_EFFECT_ON, HAP_MODEL_CONTACT, "use model accelerance"},
               {HAP_EFFECT_TESTING, HAP_EFFECT_OFF, HAP_MODEL_ACCELERANCE, "use model contact"},
               {HAP_EFFECT_TESTING, HAP_EFFECT_ON, HAP_MODEL_SINGLE, "use model contact"},
               {HAP_EFFECT_RECORDING, HAP_EFFECT_ON, HAP_MODEL_CONTACT, "hap_session_record"}};
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    hap_detail detail = {""};
    CHECK(hap_effect_check(cases[i].effect, cases[i].wish, cases[i].model, &detail) ==
          HAP_ERROR_UNSUPPORTED);
    CHECK(detail_says(&detail, cases[i].text) &&
          detail_says(&detail, hap_effect_name(cases[i].effect)));
    contact_world *w = cw_new(0.0);
    w->def.model = cases[i].model;
    cw_start(w, 0.0, 0.0, 0.0);
    uint32_t before = effect_look(w, cases[i].effect).wish;
    CHECK(hap_session_set_effect(w->session, cases[i].effect, cases[i].wish) ==
          HAP_ERROR_UNSUPPORTED);
    CHECK(hap_session_detail(w->session, &detail) == HAP_OK && detail_says(&detail, cases[i].text));
    CHECK(effect_look(w, cases[i].effect).wish == before);
    hap_session_destroy(w->session);
    w->session = NULL;
    effect_wish(w, cases[i].effect, cases[i].wish);
    w->ode.world = w->world;
    CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_UNSUPPORTED);
    CHECK(detail_says(&detail, cases[i].text));
  }
}

TEST(bad_arguments_change_nothing)
{
  hap_effect_info info;
  hap_detail detail = {""};
  contact_world *w = cw_new(0.0);
  cw_start(w, 0.0, 0.0, 0.0);
  CHECK(hap_session_set_effect(NULL, HAP_EFFECT_GYRO, HAP_EFFECT_ON) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_effect(w->session, (hap_effect)HAP_EFFECTS, HAP_EFFECT_ON) ==
        HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_effect(w->session, (hap_effect)-1, HAP_EFFECT_ON) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_effect(w->session, HAP_EFFECT_GYRO, (hap_effect_wish)3) ==
        HAP_ERROR_ARGUMENT);
  /* this guard only measures */
  CHECK(hap_session_set_effect(w->session, HAP_EFFECT_OBSERVER, HAP_EFFECT_ON) ==
        HAP_ERROR_UNSUPPORTED);
  memset(&info, 0xee, sizeof info);
  CHECK(hap_session_effects(w->session, &info, HAP_EFFECTS + 1, sizeof info) == HAP_ERROR_ARGUMENT);
  CHECK(info.size == 0xeeeeeeeeu); /* nothing is changed */
  CHECK(hap_session_effects(w->session, NULL, 1, sizeof info) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_effects(w->session, &info, 1, 2) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_effects(w->session, &info, 1, sizeof info) == HAP_OK && info.effect == 0);
  CHECK(hap_effect_name((hap_effect)HAP_EFFECTS) == NULL &&
        hap_effect_name((hap_effect)-1) == NULL);
  CHECK(hap_effect_reason_text((hap_effect_reason)1000)[0] == '\0');
  CHECK(hap_effect_wish_name((hap_effect_wish)3) == NULL);
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    CHECK(hap_effect_name((hap_effect)i) != NULL && hap_effect_text((hap_effect)i) != NULL);
  }
  hap_session_destroy(w->session);
  w->session = NULL;
  w->expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECTS);
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(detail_says(&detail, "effects_off"));
  w->expert.effects_off = w->expert.effects_on = HAP_EFFECT_BIT(HAP_EFFECT_GYRO);
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(detail_says(&detail, "gyro is in effects_on and in effects_off"));
}

TEST(a_wish_outlives_a_model_that_cannot_fulfil_it)
{
  contact_world *w = open_on_floor(1);
  effect_wish(w, HAP_EFFECT_SHAPE, HAP_EFFECT_ON);
  start_left(w, 0.002);
  CHECK(hap_session_set_model(w->session, HAP_MODEL_IMPULSE) == HAP_OK);
  cw_run(w, 101);
  CHECK(is_off(w, HAP_EFFECT_SHAPE, HAP_REASON_NOT_IN_MODEL));
  CHECK(effect_look(w, HAP_EFFECT_SHAPE).wish == HAP_EFFECT_ON);
  CHECK(hap_session_set_model(w->session, HAP_MODEL_CONTACT) == HAP_OK);
  cw_run(w, 151);
  CHECK(effect_is(w, HAP_EFFECT_SHAPE, HAP_EFFECT_IS_ON, HAP_REASON_ASKED));
}

TEST(times_are_of_what_is_on)
{
  contact_world *w = open_on_floor(3);
  start_left(w, 0.0);
  cw_run(w, 640);
  hap_stats stats = cw_stats(w);
  hap_effect_info contacts = effect_look(w, HAP_EFFECT_CONTACTS);
  CHECK(isnan(contacts.tick_us) ||
        (contacts.tick_us > 0.0 && contacts.tick_us < stats.loop.tick_us_max));
  CHECK(contacts.contact_us > 0.0 && contacts.physics_ms > 0.0);
  CHECK(isnan(effect_look(w, HAP_EFFECT_GYRO).tick_us) ||
        effect_look(w, HAP_EFFECT_GYRO).tick_us == 0.0);
  CHECK(isnan(effect_look(w, HAP_EFFECT_RANGE).tick_us));
}

TEST(bodies_of_the_loop_are_not_tested_when_it_is_asked_for)
{
  double force[2];
  for (int i = 0; i < 2; ++i) {
    contact_world *w = open_on_floor(3);
    effect_wish(w, HAP_EFFECT_TESTING, i == 0 ? HAP_EFFECT_AUTO : HAP_EFFECT_ON);
    start_left(w, 0.002);
    cw_run(w, 400);
    force[i] = w->force[0];
    CHECK(cw_stats(w).probes.steps == 0);
  }
  CHECK(force[0] < -0.1);
  CHECK(force[0] == force[1]);
}
