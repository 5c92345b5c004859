/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Pointers that are changed while they run, by the public headers, against closed forms. */

#include "tests/tap.h"

#include <time.h>

#include "tests/desk.h"

#define DEPTH 0.002 /* m, that the hand is in the floor */
#define LIMIT 20.0  /* N */
#define SET_S 0.02  /* s, in which a setting is reached */
#define SETTLE 60   /* ticks: beyond every ramp */

static hap_pointer_settings settings_of(uint32_t mask)
{
  hap_pointer_settings settings;
  hap_pointer_settings_init(&settings, sizeof settings);
  settings.mask = mask;
  return settings;
}

static void hand_set(desk *d, const hap_pointer_settings *settings)
{
  hap_detail detail = {""};
  bool good = hap_pointer_set(d->session, d->hand, settings) == HAP_OK;
  (void)hap_session_detail(d->session, &detail);
  REQUIRE_SAY(good, "%s", detail.text);
}

static hap_pointer_state hand_state(const desk *d)
{
  hap_pointer_state state;
  REQUIRE(hap_pointer_get(d->session, d->hand, &state, sizeof state) == HAP_OK);
  return state;
}

static double vector_far(const double a[3], const double b[3])
{
  return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
              (a[2] - b[2]) * (a[2] - b[2]));
}

/* N: the largest change of the force in one of these ticks. The hand stands. */
static double force_steepest(desk *d, int ticks)
{
  double most = 0.0;
  hap_pointer_state before = hand_state(d);
  for (int i = 0; i < ticks; ++i) {
    desk_wait(d, 1);
    hap_pointer_state now = hand_state(d);
    most = fmax(most, vector_far(now.wrench.force, before.wrench.force));
    before = now;
  }
  return most;
}

/* A floor, and a hand that is in it and stands. */
static desk *floor_desk(hap_model model)
{
  desk *d = desk_new(0.0, model);
  d->hand_def.max_force = LIMIT;
  floor_add(d);
  desk_run(d, 0.1, -0.2, RADIUS + 0.002);
  desk_wait(d, 40);
  desk_move(d, 0.0, 0.0, -0.002 - DEPTH, 200);
  desk_wait(d, SETTLE);
  CHECK_NEAR(hand_state(d).wrench.force[2], STIFFNESS * DEPTH, 1e-9);
  return d;
}

/* ---- surface ---- */

typedef struct model_row {
  const char *name;
  hap_model model;
} model_row;

static const model_row stiffened[] = {
    {"a_stiffness_is_reached_in_20_ms_in_model_single", HAP_MODEL_SINGLE},
    {"a_stiffness_is_reached_in_20_ms_in_model_impulse", HAP_MODEL_IMPULSE},
    {"a_stiffness_is_reached_in_20_ms_in_model_accelerance", HAP_MODEL_ACCELERANCE},
    {"a_stiffness_is_reached_in_20_ms_in_model_contact", HAP_MODEL_CONTACT},
};

TEST_EACH(stiffened, const model_row *row)
{
  desk *d = floor_desk(row->model);
  hap_pointer_settings s = settings_of(HAP_SET_STIFFNESS);
  s.stiffness = 3.0 * STIFFNESS;
  s.damping = 1e9; /* is not in the mask */
  hand_set(d, &s);
  double step = 2.0 * STIFFNESS * DEPTH * T / SET_S;
  CHECK_NEAR(force_steepest(d, 10), step, 1e-9);
  CHECK_NEAR(hand_state(d).wrench.force[2], 2.0 * STIFFNESS * DEPTH, 1e-9);
  CHECK_NEAR(force_steepest(d, 10), step, 1e-9);
  CHECK_NEAR(hand_state(d).wrench.force[2], 3.0 * STIFFNESS * DEPTH, 1e-9);
  CHECK(force_steepest(d, 10) == 0.0);
  CHECK(hand_state(d).guard == 0);
}

TEST(a_stiffness_that_is_set_gives_and_takes_its_own_energy)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_STIFFNESS);
  s.stiffness = 4.0 * STIFFNESS;
  hand_set(d, &s);
  desk_wait(d, SETTLE);
  for (int i = 0; i < 401; ++i) { /* the spring gives back more than the hand put in */
    desk_move(d, 0.0, 0.0, 0.0025 * DEPTH, 1);
    CHECK((hand_state(d).guard & HAP_GUARD_ENERGY) == 0);
  }
  CHECK(hand_state(d).wrench.force[2] == 0.0);
}

TEST(damping_that_is_set_is_felt)
{
  const double speed = 0.02;
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_DAMPING);
  s.damping = 10.0;
  hand_set(d, &s);
  desk_wait(d, SETTLE);
  desk_move(d, 0.0, 0.0, -speed * 0.05, 50);
  CHECK_NEAR(hand_state(d).wrench.force[2], STIFFNESS * (DEPTH + speed * 0.05) + 10.0 * speed,
             1e-6);
}

TEST(friction_that_is_set_is_felt_from_the_next_steps_on)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_FRICTION);
  desk_move(d, 0.01, 0.0, 0.0, 100);
  CHECK_NEAR(hand_state(d).wrench.force[0], 0.0, 1e-9);
  s.friction = 0.5;
  hand_set(d, &s);
  desk_wait(d, SETTLE);
  desk_move(d, 0.01, 0.0, 0.0, 100);
  CHECK_NEAR(hand_state(d).wrench.force[0], -0.5 * STIFFNESS * DEPTH, 1e-6);
  s.finger_radius = 0.005; /* while it sticks */
  hand_set(d, &s);
  CHECK(force_steepest(d, SETTLE) < 1e-9);
  s.friction = 0.0;
  hand_set(d, &s);
  CHECK(force_steepest(d, SETTLE) < 1.0);
  CHECK_NEAR(hand_state(d).wrench.force[0], 0.0, 1e-9);
}

TEST(what_is_set_to_what_it_is_changes_no_force)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(0);
  REQUIRE(hap_pointer_settings_get(d->session, d->hand, &s) == HAP_OK);
  for (int i = 0; i < 5; ++i) {
    hand_set(d, &s);
    CHECK(force_steepest(d, 7) < 1e-12);
  }
}

/* ---- limits and scales ---- */

TEST(a_limit_falls_with_the_slew_limit_and_rises_slowly)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_LIMITS);
  desk_move(d, 0.0, 0.0, -0.02, 400);
  CHECK_NEAR(hand_state(d).wrench.force[2], LIMIT, 1e-9);
  s.max_force = 0.1 * LIMIT;
  hand_set(d, &s);
  CHECK_NEAR(force_steepest(d, 4), LIMIT / 0.002 * T, 1e-6);
  CHECK_NEAR(hand_state(d).wrench.force[2], 0.1 * LIMIT, 1e-9);
  s.max_force = LIMIT;
  hand_set(d, &s);
  CHECK(force_steepest(d, 50) <= LIMIT * T / 0.1 + 1e-9);
  CHECK_NEAR(hand_state(d).wrench.force[2], 0.6 * LIMIT, 1e-6);
  desk_wait(d, 100);
  CHECK_NEAR(hand_state(d).wrench.force[2], LIMIT, 1e-9);
}

TEST(while_the_motion_scale_changes_the_pointer_stands_and_nothing_leaps)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_MOTION_SCALE);
  s.motion_scale = 3.0;
  hand_set(d, &s);
  CHECK(force_steepest(d, SETTLE) < 1e-9);
  hap_pointer_state state = hand_state(d);
  check_vector(state.proxy.position, 0.1, -0.2, RADIUS - DEPTH, 1e-12);
  desk_move(d, 0.001, 0.0, 0.0, 10);
  check_vector(hand_state(d).proxy.position, 0.103, -0.2, RADIUS - DEPTH, 1e-12);
  CHECK_NEAR(hand_state(d).twist.linear[0], 0.3, 1e-9);
}

/* ---- shape, what it touches, coupling ---- */

static const double wedge[4][3] = {
    {0.03, 0.03, -0.012}, {0.03, -0.03, -0.012}, {-0.03, 0.0, -0.012}, {0.0, 0.0, 0.03}};

/* Goes from the force at the begin to none and on to another one, and never by much more a tick
 * than a ramp of 20 ms: two of them may come together. */
static void hand_swaps(desk *d, const hap_pointer_settings *s, double newtons)
{
  const hap_pointer_id id = d->hand;
  double most = 3.0 * fmax(hand_state(d).wrench.force[2], newtons) * T / SET_S;
  hand_set(d, s);
  CHECK(force_steepest(d, 30) <= most);
  CHECK(force_steepest(d, 150) <= most);
  CHECK_NEAR(hand_state(d).wrench.force[2], newtons, 1e-6);
  CHECK(hand_state(d).guard == 0);
  CHECK(d->hand.v == id.v);
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
}

static const model_row swapped[] = {
    {"a_shape_is_another_one_while_the_pointer_runs_in_model_impulse", HAP_MODEL_IMPULSE},
    {"a_shape_is_another_one_while_the_pointer_runs_in_model_contact", HAP_MODEL_CONTACT},
};

TEST_EACH(swapped, const model_row *row)
{
  desk *d = floor_desk(row->model);
  hap_pointer_settings s = settings_of(HAP_SET_SHAPE);
  s.radius = RADIUS + 0.001;
  hand_swaps(d, &s, STIFFNESS * (DEPTH + 0.001));
  s.hull_xyz = &wedge[0][0];
  s.hull_points = 4;
  s.radius = 0.0;
  hand_swaps(d, &s, STIFFNESS * (0.012 - RADIUS + DEPTH));
  s = settings_of(HAP_SET_SHAPE);
  hand_swaps(d, &s, STIFFNESS * DEPTH); /* the sphere of the default */
  CHECK_NEAR(s.radius, RADIUS, 0.0);
}

TEST(collide_bits_that_are_set_are_felt)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  dGeomSetCategoryBits(dSpaceGetGeom(d->space, 0), 2u);
  hap_pointer_settings s = settings_of(HAP_SET_COLLIDE_BITS);
  s.collide_bits = 1u;
  hand_swaps(d, &s, 0.0);
  s.collide_bits = 3u;
  hand_swaps(d, &s, STIFFNESS * DEPTH);
}

TEST(a_coupling_is_another_one_while_the_pointer_runs)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_COUPLING);
  s.coupling = HAP_COUPLING_PROXY;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT); /* no stiffness */
  s.coupling_stiffness = STIFFNESS;
  hand_swaps(d, &s, 0.5 * STIFFNESS * DEPTH); /* two springs in series */
  CHECK(hand_state(d).coupling == HAP_COUPLING_PROXY);
  s.coupling = HAP_COUPLING_GOD_OBJECT;
  hand_swaps(d, &s, STIFFNESS * DEPTH);
  CHECK(hand_state(d).coupling == HAP_COUPLING_GOD_OBJECT);
  s.coupling = HAP_COUPLING_DIRECT;
  hand_swaps(d, &s, STIFFNESS * DEPTH);
  desk *other = floor_desk(HAP_MODEL_IMPULSE);
  s.coupling = HAP_COUPLING_PROXY;
  CHECK(hap_pointer_set(other->session, other->hand, &s) == HAP_ERROR_UNSUPPORTED);
}

/* ---- the base ---- */

typedef struct coupling_row {
  const char *name;
  hap_coupling coupling;
} coupling_row;

static const coupling_row couplings[] = {
    {"a_moving_base_is_no_force_for_a_pointer_that_is_direct", HAP_COUPLING_DIRECT},
    {"a_moving_base_is_no_force_for_a_proxy", HAP_COUPLING_PROXY},
    {"a_moving_base_is_no_force_for_a_god_object", HAP_COUPLING_GOD_OBJECT},
    {"a_moving_base_is_no_force_for_a_virtual_tool", HAP_COUPLING_VIRTUAL},
};

TEST_EACH(couplings, const coupling_row *row)
{
  hap_pointer_expert_def expert;
  hap_pointer_expert_def_init(&expert, sizeof expert);
  expert.coupling = row->coupling;
  expert.coupling_stiffness = 1000.0;
  expert.coupling_damping = 2.0;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  d->hand_def.expert = &expert;
  desk_run(d, 0.1, 0.2, 0.3);
  desk_wait(d, SETTLE);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device = (hap_twist){{2.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  for (int frame = 0; frame < 20; ++frame) { /* locomotion at 2 m/s, of 90 frames a second */
    s.pose_world_device.position[0] = 0.022 * frame;
    hand_set(d, &s);
    for (int i = 0; i < 11; ++i) {
      desk_wait(d, 1);
      hap_pointer_state state = hand_state(d);
      CHECK(vector_far(state.wrench.force, AT(0.0, 0.0, 0.0)) < 1e-3);
      CHECK_NEAR(state.proxy.position[0], 0.1 + 0.022 * frame + 0.002 * i,
                 row->coupling == HAP_COUPLING_DIRECT ? 1e-9 : 3e-3);
    }
  }
  CHECK(hand_state(d).guard == 0);
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
}

TEST(a_base_that_is_not_set_again_goes_on_for_50_ms_and_comes_to_rest)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.0, 0.0, 0.3);
  desk_wait(d, SETTLE);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[1] = 1.0;
  hand_set(d, &s);
  desk_wait(d, 51);
  CHECK_NEAR(hand_state(d).proxy.position[1], 0.05, 1e-9);
  CHECK_NEAR(hand_state(d).twist.linear[1], 1.0, 1e-9);
  desk_wait(d, 10);
  CHECK_NEAR(hand_state(d).twist.linear[1], 0.5, 1e-6);
  desk_wait(d, 200);
  CHECK_NEAR(hand_state(d).proxy.position[1], 0.06, 1e-9);
  CHECK_NEAR(hand_state(d).twist.linear[1], 0.0, 1e-12);
}

TEST(a_base_that_turns_takes_the_pointer_about_its_origin)
{
  const double spin = 2.0;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.5, 0.0, 0.3);
  desk_wait(d, SETTLE);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device.angular[2] = spin;
  hand_set(d, &s);
  desk_wait(d, 41);
  hap_pointer_state state = hand_state(d);
  double angle = spin * 0.04;
  check_vector(state.proxy.position, 0.5 * cos(angle), 0.5 * sin(angle), 0.3, 1e-4);
  check_vector(state.twist.linear, -0.5 * spin * sin(angle), 0.5 * spin * cos(angle), 0.0, 1e-3);
  CHECK_NEAR(state.twist.angular[2], spin, 1e-9);
  CHECK_NEAR(state.proxy.quat_wxyz[3], sin(0.5 * angle), 1e-4);
}

TEST(a_time_of_the_base_takes_the_noise_of_threads_out)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.0, 0.0, 0.3);
  desk_wait(d, SETTLE);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[0] = 3.0;
  for (int frame = 0; frame < 10; ++frame) {
    int64_t now = hap_session_now(d->session);
    int64_t of_frame = now - 1000000 * (frame * 7 % 5); /* up to 4 ms ago */
    s.base_time_ns = of_frame;
    s.pose_world_device.position[0] = 3.0 * 1e-9 * (double)of_frame;
    s.mask = HAP_SET_BASE | (frame == 0 ? HAP_SET_TELEPORT : 0);
    hand_set(d, &s);
    for (int i = 0; i < 11; ++i) {
      desk_wait(d, 1);
      hap_pointer_state state = hand_state(d);
      CHECK_NEAR(state.proxy.position[0], 3.0 * 1e-9 * (double)state.stamp_ns, 1e-9);
      CHECK_NEAR(state.twist.linear[0], 3.0, 1e-6);
    }
  }
}

TEST(a_surface_feels_the_velocity_of_the_base)
{
  const double speed = 0.05;
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_DAMPING | HAP_SET_FRICTION);
  s.damping = 20.0;
  s.friction = 0.4;
  hand_set(d, &s);
  desk_wait(d, SETTLE);
  s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[2] = -speed;
  hand_set(d, &s);
  desk_wait(d, 41);
  CHECK_NEAR(hand_state(d).wrench.force[2], STIFFNESS * (DEPTH + speed * 0.04) + 20.0 * speed,
             1e-6);
  s.pose_world_device.position[2] = -speed * 0.041;
  s.twist_world_device = (hap_twist){{0.5, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hand_set(d, &s);
  desk_wait(d, 41);
  double normal = STIFFNESS * (DEPTH + speed * 0.041);
  check_vector(hand_state(d).wrench.force, -0.4 * normal, 0.0, normal, 1e-3);
}

/* On a belt, that moves as the base does, nothing is felt of either. */
TEST(a_base_that_rides_on_a_platform_changes_no_force)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID lift = ode_box(d->world, d->space, 1.0, AT(1.0, 1.0, 0.1), AT(0.0, 0.0, -0.05));
  dBodySetKinematic(lift);
  d->hand_def.friction = 0.5;
  desk_run(d, 0.1, -0.2, RADIUS - DEPTH);
  desk_wait(d, 200);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[0] = 0.5;
  s.twist_world_device.linear[2] = 0.25;
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  dBodySetLinearVel(lift, 0.5, 0.0, 0.25);
  hap_session_unlock(d->session);
  hand_set(d, &s);
  desk_wait(d, 100); /* they begin at different ticks */
  for (int i = 0; i < 20; ++i) {
    hap_pose pose;
    REQUIRE(hap_session_poses_now(d->session, &lift, 1, &pose) == HAP_OK);
    s.pose_world_device.position[0] = pose.position[0];
    s.pose_world_device.position[2] = pose.position[2] + 0.05;
    hand_set(d, &s);
    double change = force_steepest(d, 20);
    if (i > 3) {
      CHECK_NEAR(change, 0.0, 1e-3);
      CHECK_NEAR(hand_state(d).wrench.force[2], STIFFNESS * DEPTH, 0.3);
    }
  }
}

TEST(what_a_base_presses_in_the_hand_gets_back)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[2] = -0.2;
  hand_set(d, &s);
  desk_wait(d, 100); /* by 12 mm */
  CHECK_NEAR(hand_state(d).wrench.force[2], STIFFNESS * (DEPTH + 0.012), 1e-6);
  for (int i = 0; i < 1000; ++i) {
    desk_move(d, 0.0, 0.0, 0.000015, 1);
    CHECK((hand_state(d).guard & HAP_GUARD_ENERGY) == 0);
  }
  CHECK(hand_state(d).wrench.force[2] == 0.0);
}

/* The base goes down by z, as the hand of the device would if the device swung or ran away. */
static void base_drive(desk *d, double z, double speed)
{
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.pose_world_device.position[2] = -z;
  s.twist_world_device.linear[2] = -speed;
  hand_set(d, &s);
  desk_wait(d, 1);
  CHECK((hand_state(d).guard & HAP_GUARD_OSCILLATION) == 0);
}

TEST(a_base_that_shakes_is_no_device_that_swings)
{
  const double omega = 2.0 * M_PI * 15.0;
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  for (int i = 0; i < 2000; ++i) {
    base_drive(d, 0.004 + 0.004 * sin(omega * T * i), 0.004 * omega * cos(omega * T * i));
  }
}

TEST(a_base_that_accelerates_is_no_device_that_runs_away)
{
  const double growth = 45.0; /* 1/s: v^2 / work as of a mass of less than a kg */
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  desk_move(d, 0.0, 0.0, DEPTH, 200);
  desk_wait(d, SETTLE);
  for (int i = 0; i < 120; ++i) {
    double z = 1e-4 * exp(growth * T * i);
    base_drive(d, z, growth * z);
  }
}

TEST(a_base_that_is_elsewhere_is_reached_in_20_ms)
{
  desk *d = floor_desk(HAP_MODEL_CONTACT);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.pose_world_device.position[0] = 0.1;
  s.pose_world_device.position[2] = -0.004;
  hand_set(d, &s);
  desk_wait(d, 1);
  CHECK_NEAR(force_steepest(d, 10), STIFFNESS * 0.004 * T / SET_S, 1e-6);
  check_vector(hand_state(d).proxy.position, 0.15, -0.2, RADIUS - DEPTH - 0.002, 1e-9);
  check_vector(hand_state(d).twist.linear, 5.0, 0.0, -0.2, 1e-9);
  desk_wait(d, 20);
  check_vector(hand_state(d).proxy.position, 0.2, -0.2, RADIUS - DEPTH - 0.004, 1e-12);
  check_vector(hand_state(d).twist.linear, 0.0, 0.0, 0.0, 1e-12);
}

TEST(a_base_that_is_far_away_or_asked_to_leap_takes_the_pointer_there_at_once)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  d->hand_def.max_force = LIMIT;
  floor_add(d);
  desk_run(d, 0.0, 0.0, 0.3);
  desk_wait(d, SETTLE);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.pose_world_device.position[0] = 5.0;
  hand_set(d, &s);
  desk_wait(d, 1);
  check_vector(hand_state(d).proxy.position, 5.0, 0.0, 0.3, 1e-12);
  check_vector(hand_state(d).twist.linear, 0.0, 0.0, 0.0, 1e-12);
  s.mask |= HAP_SET_TELEPORT;
  s.pose_world_device.position[2] = -0.295 + RADIUS; /* into the floor, 5 mm */
  s.pose_world_device.position[2] -= 0.01;
  s.pose_world_device.position[0] = 5.01;
  hand_set(d, &s);
  CHECK(force_steepest(d, SETTLE) < 0.5); /* nobody pressed it in */
  check_vector(hand_state(d).proxy.position, 5.01, 0.0, 0.005, 1e-12);
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
}

/* ---- clutch and workspace ---- */

static const model_row clutched[] = {
    {"with_the_clutch_held_the_device_moves_and_the_pointer_stands_in_model_impulse",
     HAP_MODEL_IMPULSE},
    {"with_the_clutch_held_the_device_moves_and_the_pointer_stands_in_model_contact",
     HAP_MODEL_CONTACT},
};

TEST_EACH(clutched, const model_row *row)
{
  desk *d = floor_desk(row->model);
  REQUIRE(hap_pointer_clutch(d->session, d->hand, true) == HAP_OK);
  CHECK_NEAR(force_steepest(d, 20), STIFFNESS * DEPTH * T / SET_S, 1e-9);
  CHECK_NEAR(hand_state(d).wrench.force[2], 0.0, 1e-12);
  desk_move(d, -0.05, 0.02, 0.07, 50);
  hap_pointer_state state = hand_state(d);
  check_vector(state.proxy.position, 0.1, -0.2, RADIUS - DEPTH, 1e-12);
  check_vector(state.twist.linear, 0.0, 0.0, 0.0, 1e-12);
  CHECK(state.wrench.force[2] == 0.0);
  REQUIRE(hap_pointer_clutch(d->session, d->hand, false) == HAP_OK);
  desk_wait(d, 1);
  CHECK(force_steepest(d, 30) <= STIFFNESS * DEPTH * T / SET_S + 1e-9);
  CHECK_NEAR(hand_state(d).wrench.force[2], STIFFNESS * DEPTH, 1e-9);
  desk_move(d, 0.01, 0.0, -0.001, 20);
  check_vector(hand_state(d).proxy.position, 0.11, -0.2, RADIUS - DEPTH - 0.001, 1e-12);
  hap_pointer_settings s = settings_of(HAP_SET_UNCLUTCHED);
  hand_set(d, &s);
  desk_wait(d, SETTLE);
  check_vector(hand_state(d).proxy.position, d->at[0], d->at[1], d->at[2], 1e-12);
}

TEST(a_clutch_keeps_the_turn_and_the_pointer_turns_as_the_hand_does)
{
  const double half = 0.3;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.0, 0.0, 0.3);
  desk_wait(d, SETTLE);
  REQUIRE(hap_pointer_clutch(d->session, d->hand, true) == HAP_OK);
  desk_wait(d, 5);
  hap_pose pose = {{0.0, 0.0, 0.3}, {cos(half), sin(half), 0.0, 0.0}};
  REQUIRE(hap_pointer_set_target(d->session, d->hand, &pose, NULL) == HAP_OK);
  REQUIRE(hap_session_advance(d->session, 5) >= HAP_OK);
  CHECK_NEAR(hand_state(d).proxy.quat_wxyz[0], 1.0, 1e-12);
  REQUIRE(hap_pointer_clutch(d->session, d->hand, false) == HAP_OK);
  REQUIRE(hap_session_advance(d->session, 5) >= HAP_OK);
  CHECK_NEAR(hand_state(d).proxy.quat_wxyz[0], 1.0, 1e-12);
  /* About z of the world, beyond the turn about x: the pointer turns about z of the world. */
  pose = (hap_pose){
      {0.0, 0.0, 0.3},
      {cos(half) * cos(0.1), sin(half) * cos(0.1), sin(half) * sin(0.1), cos(half) * sin(0.1)}};
  REQUIRE(hap_pointer_set_target(d->session, d->hand, &pose, NULL) == HAP_OK);
  REQUIRE(hap_session_advance(d->session, 5) >= HAP_OK);
  hap_pointer_state state = hand_state(d);
  CHECK_NEAR(state.proxy.quat_wxyz[1], 0.0, 1e-12);
  CHECK_NEAR(state.proxy.quat_wxyz[2], 0.0, 1e-12);
  CHECK_NEAR(state.proxy.quat_wxyz[3], sin(0.1), 1e-12);
}

TEST(a_workspace_is_fitted_to_a_box)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.0, 0.0, 0.0);
  desk_wait(d, SETTLE);
  /* A quarter turn about z: the device's x goes along the world's y. */
  const hap_pose box = {{1.0, 2.0, 3.0}, {sqrt(0.5), 0.0, 0.0, sqrt(0.5)}};
  REQUIRE(hap_pointer_fit_workspace(d->session, d->hand, AT(-0.1, -0.05, 0.0), AT(0.1, 0.05, 0.1),
                                    &box, AT(0.8, 0.2, 0.2)) == HAP_OK);
  desk_wait(d, SETTLE);
  d->at[0] = 0.1, d->at[1] = 0.05, d->at[2] = 0.1;
  desk_wait(d, 5);
  check_vector(hand_state(d).proxy.position, 1.0 - 0.2, 2.0 + 0.4, 3.0 + 0.2, 1e-9);
  CHECK(hap_pointer_fit_workspace(d->session, d->hand, AT(0.1, 0.0, 0.0), AT(0.1, 0.05, 0.1), &box,
                                  AT(0.8, 0.2, 0.2)) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_fit_workspace(d->session, d->hand, AT(0.0, 0.0, 0.0), AT(0.1, 0.05, 0.1), &box,
                                  AT(0.8, NAN, 0.2)) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_fit_workspace(d->session, d->hand, NULL, AT(0.1, 0.05, 0.1), &box,
                                  AT(0.8, 0.2, 0.2)) == HAP_ERROR_ARGUMENT);
}

/* ---- whatever is set ---- */

typedef struct storm_row {
  const char *name;
  hap_model model;
  bool sharp;
} storm_row;

static const storm_row storms[] = {
    {"a_storm_of_settings_is_bounded_in_model_single", HAP_MODEL_SINGLE, false},
    {"a_storm_of_settings_is_bounded_in_model_impulse", HAP_MODEL_IMPULSE, false},
    {"a_storm_of_settings_is_bounded_in_model_accelerance", HAP_MODEL_ACCELERANCE, false},
    {"a_storm_of_settings_is_bounded_in_model_contact", HAP_MODEL_CONTACT, false},
    {"a_storm_of_settings_of_a_tool_is_bounded_in_model_single", HAP_MODEL_SINGLE, true},
    {"a_storm_of_settings_of_a_tool_is_bounded_in_model_contact", HAP_MODEL_CONTACT, true},
};

/* 0..1, the same in every run. */
static double storm_number(uint64_t *io)
{
  *io = *io * 6364136223846793005u + 1442695040888963407u;
  return (double)(*io >> 11) / 9007199254740992.0;
}

static void storm_set(desk *d, const storm_row *row, uint64_t *io)
{
  const hap_coupling kinds[] = {HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY, HAP_COUPLING_AUTO,
                                HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};
  hap_pointer_settings s = settings_of((uint32_t)(storm_number(io) * 4096.0));
  s.mask &= (uint32_t)(storm_number(io) * 4096.0); /* a quarter of the bits */
  s.mask &= ~(uint32_t)((s.mask & (HAP_SET_BASE | HAP_SET_UNCLUTCHED)) == 0 ? HAP_SET_TELEPORT : 0);
  for (int i = 0; i < 3; ++i) {
    s.pose_world_device.position[i] = 0.03 * (storm_number(io) - 0.5);
    s.twist_world_device.linear[i] = storm_number(io) - 0.5;
    s.twist_world_device.angular[i] = storm_number(io) - 0.5;
  }
  double half = storm_number(io) - 0.5;
  s.pose_world_device.quat_wxyz[0] = cos(half);
  s.pose_world_device.quat_wxyz[2] = sin(half);
  s.motion_scale = 0.3 + 2.0 * storm_number(io);
  s.stiffness = 3000.0 * storm_number(io);
  s.damping = 5.0 * storm_number(io);
  s.friction = storm_number(io);
  s.finger_radius = storm_number(io) < 0.5 ? 0.0 : 0.005;
  s.max_force = 2.0 + 18.0 * storm_number(io);
  s.radius = 0.002 + 0.015 * storm_number(io);
  if (row->sharp && storm_number(io) < 0.7) {
    s.hull_xyz = &wedge[0][0];
    s.hull_points = 4;
  }
  s.collide_bits = storm_number(io) < 0.2 ? 0u : ~0u;
  s.coupling =
      row->model == HAP_MODEL_CONTACT ? kinds[(int)(storm_number(io) * 5.0)] : HAP_COUPLING_AUTO;
  s.coupling_stiffness = 200.0 + 2000.0 * storm_number(io);
  hand_set(d, &s);
  if (storm_number(io) < 0.1) {
    REQUIRE(hap_pointer_clutch(d->session, d->hand, storm_number(io) < 0.4) == HAP_OK);
  }
}

TEST_EACH(storms, const storm_row *row)
{
  uint64_t number = 7;
  double steepest = 0.0;
  double most = 0.0;
  int pushing = 0;
  desk *d = desk_new(10.0, row->model);
  d->hand_def.max_force = LIMIT;
  floor_add(d);
  for (int i = 0; i < 3; ++i) {
    ode_box(d->world, d->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.06 * i - 0.06, 0.02, 0.02));
  }
  desk_run(d, 0.0, 0.0, 0.06);
  hap_pointer_state before = hand_state(d);
  for (int i = 0; i < 6000; ++i) {
    if (storm_number(&number) < 0.03) {
      storm_set(d, row, &number);
    }
    double t = T * i;
    desk_move(d, 0.06 * sin(2.0 * t) - d->at[0], 0.02 * sin(3.1 * t) - d->at[1],
              0.03 + 0.03 * cos(5.0 * t) - d->at[2], 1);
    hap_pointer_state now = hand_state(d);
    steepest = fmax(steepest, vector_far(now.wrench.force, before.wrench.force));
    most = fmax(most, vector_far(now.wrench.force, AT(0.0, 0.0, 0.0)));
    pushing += vector_far(now.wrench.force, AT(0.0, 0.0, 0.0)) > 0.1;
    before = now;
  }
  CHECK(isfinite(most) && most <= LIMIT * (1.0 + 1e-9));
  CHECK(steepest <= LIMIT * T / 0.002 * (1.0 + 1e-9));
  CHECK(pushing > 200);
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
  tap_say("most %.1f N, steepest %.2f N a tick, force in %d ticks", most, steepest, pushing);
}

/* ---- devices ---- */

/* The guard judges the device in its own frame, and the id stays. */
TEST(a_fast_base_and_a_clutch_are_no_fault_of_the_device)
{
  hap_detail detail;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  REQUIRE(hap_device_open("virtual:path=0:0/0/0.05;0.4:0.02/0/0.05;0.8:0/0/0.05",
                          &d->hand_def.device, &detail) == HAP_OK);
  d->hand_def.motion_scale = 2.0;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[0] = 30.0;
  for (int i = 0; i < 40; ++i) {
    s.pose_world_device.position[0] = 0.3 * i;
    s.pose_world_device.position[2] = i < 20 ? 0.0 : -0.05;
    hand_set(d, &s);
    REQUIRE(hap_session_advance(d->session, 10) >= HAP_OK);
    CHECK((hand_state(d).guard & (HAP_GUARD_INPUT | HAP_GUARD_FAULT)) == 0);
    REQUIRE(hap_pointer_clutch(d->session, d->hand, i % 4 == 0) == HAP_OK);
  }
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(d->hand_def.device);
}

/* ---- what is asked ---- */

TEST(what_was_set_is_told)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.0, 0.0, 0.3);
  hap_pointer_settings s = settings_of(HAP_SET_STIFFNESS | HAP_SET_BASE);
  s.stiffness = 2500.0;
  s.friction = 3.0;
  s.pose_world_device.position[1] = 2.0;
  s.twist_world_device.angular[0] = 0.5;
  hand_set(d, &s);
  hap_pointer_settings told = settings_of(0);
  REQUIRE(hap_pointer_settings_get(d->session, d->hand, &told) == HAP_OK);
  CHECK(told.stiffness == 2500.0 && told.friction == 0.0 && told.motion_scale == 1.0);
  CHECK(told.pose_world_device.position[1] == 2.0 && told.twist_world_device.angular[0] == 0.5);
  CHECK(told.max_force == d->hand_def.max_force && told.damping == 0.0);
  CHECK((told.mask & HAP_SET_STIFFNESS) != 0 && (told.mask & HAP_SET_TELEPORT) == 0);
}

TEST(wrong_settings_change_nothing_and_say_what_is_wrong)
{
  hap_detail detail;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, 0.0, 0.0, 0.3);
  hap_pointer_settings s = settings_of(HAP_SET_STIFFNESS | HAP_SET_DAMPING);
  s.stiffness = 5.0;
  s.damping = NAN;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  (void)hap_session_detail(d->session, &detail);
  CHECK(strstr(detail.text, "damping") != NULL);
  hap_pointer_settings told = settings_of(0);
  REQUIRE(hap_pointer_settings_get(d->session, d->hand, &told) == HAP_OK);
  CHECK(told.stiffness == STIFFNESS);
  s = settings_of(1u << 20);
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s = settings_of(HAP_SET_SHAPE);
  s.hull_xyz = &wedge[0][0];
  s.hull_points = 3;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s.hull_points = 65;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s = settings_of(HAP_SET_TELEPORT);
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s = settings_of(HAP_SET_BASE);
  s.pose_world_device.quat_wxyz[0] = 2.0;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s = settings_of(HAP_SET_BASE);
  s.twist_world_device.linear[0] = INFINITY;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s = settings_of(HAP_SET_BASE);
  s.base_time_ns = -1;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_ARGUMENT);
  s = settings_of(0);
  CHECK(hap_pointer_set(d->session, (hap_pointer_id){12345}, &s) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_clutch(d->session, (hap_pointer_id){12345}, true) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_settings_get(d->session, (hap_pointer_id){12345}, &told) ==
        HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_set(d->session, d->hand, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_set(NULL, d->hand, &s) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_clutch(NULL, d->hand, true) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_settings_get(NULL, d->hand, &told) == HAP_ERROR_ARGUMENT);
  s.cookie = 0;
  CHECK(hap_pointer_set(d->session, d->hand, &s) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_pointer_settings_get(d->session, d->hand, &s) == HAP_ERROR_UNINITIALISED);
}

/* ---- recordings ---- */

static void hand_ride(desk *d)
{
  hap_pointer_settings s = settings_of(HAP_SET_BASE);
  for (int i = 0; i < 40; ++i) { /* from a thread of its own, at any time */
    s.mask = HAP_SET_BASE | (i % 7 == 0 ? HAP_SET_STIFFNESS | HAP_SET_FRICTION : 0) |
             (i % 9 == 0 ? HAP_SET_MOTION_SCALE | HAP_SET_LIMITS : 0) |
             (i % 13 == 5 ? HAP_SET_UNCLUTCHED | HAP_SET_TELEPORT : 0);
    s.pose_world_device.position[0] = 0.002 * i;
    s.twist_world_device.linear[0] = 0.4;
    s.twist_world_device.angular[2] = 0.1;
    s.stiffness = 500.0 + 50.0 * i;
    s.friction = 0.01 * i;
    s.motion_scale = 1.0 + 0.01 * i;
    s.max_force = 20.0 - 0.2 * i;
    if (i % 11 == 6) {
      s.mask |= HAP_SET_SHAPE | HAP_SET_COLLIDE_BITS;
      s.hull_xyz = i % 2 == 0 ? &wedge[0][0] : NULL;
      s.hull_points = i % 2 == 0 ? 4 : 0;
      s.radius = 0.001 + 0.0003 * i;
    }
    hand_set(d, &s);
    if (i % 8 == 3) {
      REQUIRE(hap_pointer_clutch(d->session, d->hand, i % 16 == 3) == HAP_OK);
    }
    d->at[2] = RADIUS - 0.002 + 0.0001 * (i % 5);
    hand_lead(d);
    nanosleep(&(struct timespec){.tv_nsec = 6000000}, NULL);
  }
}

TEST(a_replay_has_what_was_set_bit_for_bit)
{
  desk *d = desk_new(10.0, HAP_MODEL_CONTACT);
  floor_add(d);
  ode_box(d->world, d->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.05, 0.0, 0.02));
  desk_record(d, "set.rec", RADIUS);
  hap_pointer_settings s = settings_of(HAP_SET_DAMPING);
  s.damping = 3.0; /* before the first tick */
  hand_set(d, &s);
  session_run(d->session);
  hand_ride(d);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  tap_release(d);

  desk *r = desk_new(10.0, HAP_MODEL_CONTACT);
  floor_add(r);
  ode_box(r->world, r->space, 0.1, AT(0.04, 0.04, 0.04), AT(0.05, 0.0, 0.02));
  desk_replay(r, "set.rec");
  desk_play(r);
  CHECK(hap_pointer_set(r->session, (hap_pointer_id){1}, &s) == HAP_ERROR_STATE);
}
