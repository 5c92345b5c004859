/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The couplings of the literature, "god-object" and "virtual", against closed forms. */

#include "tests/tap.h"

#include <float.h>

#include "base/vec.h"
#include "tests/contact_world.h"

#define T 1e-3
#define RADIUS 0.01
#define KV 800.0

static const hap_coupling rigid_couplings[] = {HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};

static hap_pointer_state state_of(const contact_world *w)
{
  hap_pointer_state state;
  memset(&state, 0, sizeof state);
  CHECK(hap_pointer_get(w->session, w->hand, &state, sizeof state) == HAP_OK);
  return state;
}

static contact_world *open_world(hap_coupling coupling, double damping)
{
  contact_world *w = cw_new(0.0);
  w->hand_def.radius = RADIUS;
  w->hand_expert.coupling = coupling;
  w->hand_expert.coupling_stiffness = KV;
  w->hand_expert.coupling_damping = damping;
  return w;
}

/* Far from all that is tried: a session needs a body. */
static void world_start_far(contact_world *w, double x, double y, double z)
{
  cw_add_cube(w, 1.0, 0.1, 5.0, 0.0, 0.0);
  cw_start(w, x, y, z);
}

/* Straight to a place, in so many ticks. */
static void go_to(contact_world *w, const double to[3], int ticks)
{
  double v[3];
  for (int k = 0; k < 3; ++k) {
    v[k] = (to[k] - w->hand_at[k]) / (ticks * T);
  }
  cw_go(w, v[0], v[1], v[2], ticks);
  cw_move_hand(w, 0.0, 0.0, 0.0);
}

/* ---- god-object: places ---- */

TEST(in_the_air_a_god_object_is_the_device_to_the_bit)
{
  static const double damping[] = {0.0, 3.0};
  for (int i = 0; i < 2; ++i) {
    contact_world *w = open_world(HAP_COUPLING_GOD_OBJECT, damping[i]);
    cw_add_floor(w);
    world_start_far(w, 0.0, 0.0, 0.1);
    for (int t = 0; t < 500; ++t) {
      cw_move_hand(w, 0.7 * sin(0.1 * t), 0.3, 0.5 * cos(0.07 * t));
      cw_tick(w);
      hap_pointer_state state = state_of(w);
      CHECK(memcmp(state.proxy.position, state.device.position, sizeof state.proxy.position) == 0);
      CHECK(w->force[0] == 0.0 && w->force[1] == 0.0 && w->force[2] == 0.0);
      CHECK(state.coupling == HAP_COUPLING_GOD_OBJECT && state.contacts == 0);
      CHECK(state.coupling_reason == HAP_COUPLING_ASKED);
    }
  }
}

TEST(a_god_object_stays_on_a_plane)
{
  double deepest = 0.0;
  contact_world *w = open_world(HAP_COUPLING_GOD_OBJECT, 0.0);
  cw_add_floor(w);
  world_start_far(w, 0.0, 0.0, 0.02);
  for (int t = 0; t < 2000; ++t) {
    cw_move_hand(w, 0.2, -0.1 * cos(0.003 * t), -0.3 * sin(0.005 * t));
    cw_tick(w);
    hap_pointer_state state = state_of(w);
    double depth = RADIUS - state.device.position[2];
    deepest = fmax(deepest, depth);
    CHECK_NEAR(state.proxy.position[0], state.device.position[0], 1e-12);
    CHECK_NEAR(state.proxy.position[1], state.device.position[1], 1e-12);
    CHECK_NEAR(state.proxy.position[2], fmax(RADIUS, state.device.position[2]), 1e-9);
    CHECK_NEAR(w->force[2], KV * fmax(0.0, depth), 1e-6);
    CHECK_NEAR(w->force[0], 0.0, 1e-9);
  }
  CHECK(deepest > 0.05);
}

/* With a damper the force has its part, and the place is the same. */
TEST(a_god_objects_damper_resists_the_way_in)
{
  contact_world *w = open_world(HAP_COUPLING_GOD_OBJECT, 2.0);
  cw_add_floor(w);
  world_start_far(w, 0.0, 0.0, RADIUS + 0.001);
  cw_go(w, 0.0, 0.0, -0.05, 60);
  hap_pointer_state state = state_of(w);
  CHECK_NEAR(state.proxy.position[2], RADIUS, 1e-9);
  CHECK_NEAR(w->force[2], KV * 0.002 + 2.0 * 0.05, 1e-6);
}

/* The nearest place of the corner that planes with these normals leave, through the origin: by
 * the planes that hold it, tried in all combinations. */
static void point_project(const double (*normals)[3], int count, const double from[3],
                          double out[3])
{
  double best = DBL_MAX;
  for (int set = 0; set < 1 << count; ++set) {
    double at[3];
    memcpy(at, from, sizeof at);
    for (int round = 0; round < 4000; ++round) { /* Kaczmarz: onto all planes of the set */
      for (int i = 0; i < count; ++i) {
        if ((set >> i & 1) != 0) {
          hapi_v3_madd(at, RADIUS - hapi_v3_dot(normals[i], at), normals[i], at);
        }
      }
    }
    bool inside = true;
    for (int i = 0; i < count; ++i) {
      inside = inside && hapi_v3_dot(normals[i], at) > RADIUS - 1e-9;
    }
    double way[3];
    hapi_v3_sub(at, from, way);
    if (inside && hapi_v3_norm(way) < best) {
      best = hapi_v3_norm(way);
      memcpy(out, at, sizeof at);
    }
  }
}

#define CORNERS 4

/* Walls at right angles, two and three; an obtuse and an acute groove. Into each by a winding
 * way. */
TEST(a_god_object_in_a_corner_is_where_the_spring_is_shortest)
{
  static const double s = 0.70710678118654752;
  const double normals[CORNERS][3][3] = {
      {{0, 0, 1}, {1, 0, 0}, {0, 0, 0}},
      {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
      {{0.5, 0, 0.8660254037844386}, {-0.5, 0, 0.8660254037844386}, {0, 0, 0}},
      {{0.9659258262890683, 0, 0.25881904510252074}, {-s, 0, s}, {0, 0, 0}}};
  static const int counts[CORNERS] = {2, 3, 2, 2};
  static const double ways[5][3] = {{-0.004, -0.003, -0.005},
                                    {0.006, 0.004, -0.003},
                                    {-0.007, 0.002, -0.001},
                                    {0.002, -0.006, -0.008},
                                    {0.03, 0.02, 0.02}};
  for (int c = 0; c < CORNERS; ++c) {
    contact_world *w = open_world(HAP_COUPLING_GOD_OBJECT, 0.0);
    for (int i = 0; i < counts[c]; ++i) {
      const double *n = normals[c][i];
      dCreatePlane(w->space, n[0], n[1], n[2], 0.0);
    }
    double at[3] = {0.0, RADIUS + 0.002, 0.0};
    at[0] = c < 2 ? RADIUS + 0.002 : 0.0;
    at[2] = c == 3 ? 0.05 : 2.0 * RADIUS;
    world_start_far(w, at[0], at[1], at[2]);
    cw_run(w, 5);
    double off = 0.0;
    for (int k = 0; k < 5; ++k) {
      for (int t = 0; t < 40; ++t) {
        double to[3];
        double wanted[3] = {0.0, 0.0, 0.0};
        for (int j = 0; j < 3; ++j) {
          to[j] = w->hand_at[j] + (ways[k][j] - w->hand_at[j]) / (40.0 - t);
        }
        go_to(w, to, 1);
        hap_pointer_state state = state_of(w);
        point_project(normals[c], counts[c], state.device.position, wanted);
        for (int j = 0; j < 3; ++j) {
          off = fmax(off, fabs(state.proxy.position[j] - wanted[j]));
          CHECK_NEAR(state.wrench.force[j], KV * (wanted[j] - state.device.position[j]), 1e-5);
        }
      }
    }
    printf("# corner %d: off by %.2g m\n", c, off);
    CHECK(off < 1e-8);
  }
}

/* From the top of a box past its edge down its side, the device inside: the nearest place of a
 * rounded box that the way along its surface leads to. */
TEST(a_god_object_slides_over_an_edge)
{
  contact_world *w = open_world(HAP_COUPLING_GOD_OBJECT, 0.0);
  dCreateBox(w->space, 0.1, 0.1, 0.1);
  world_start_far(w, 0.03, 0.0, 0.05 + RADIUS + 0.001);
  go_to(w, (const double[3]){0.03, 0.0, 0.05 - 0.003}, 100);
  CHECK_NEAR(state_of(w).proxy.position[2], 0.05 + RADIUS, 1e-9);
  go_to(w, (const double[3]){0.048, 0.0, 0.05 - 0.003}, 100);
  CHECK_NEAR(state_of(w).proxy.position[2], 0.05 + RADIUS, 1e-9);
  CHECK_NEAR(state_of(w).proxy.position[0], 0.048, 1e-9);
  go_to(w, (const double[3]){0.053, 0.0, 0.05 + 0.004}, 200);
  cw_run(w, 50);
  hap_pointer_state state = state_of(w);
  CHECK_NEAR(state.proxy.position[0], 0.05 + RADIUS * 0.6, 1e-7);
  CHECK_NEAR(state.proxy.position[2], 0.05 + RADIUS * 0.8, 1e-7);
  CHECK_NEAR(hapi_v3_norm(w->force), KV * 0.005, 1e-4);
  go_to(w, (const double[3]){0.055, 0.0, 0.02}, 200);
  cw_run(w, 50);
  state = state_of(w);
  CHECK_NEAR(state.proxy.position[0], 0.05 + RADIUS, 1e-9);
  CHECK_NEAR(state.proxy.position[2], 0.02, 1e-9);
  CHECK_NEAR(w->force[0], KV * 0.005, 1e-5);
}

/* The device comes out at the other side of a plate thinner than the pointer: the force goes on. */
TEST(a_thin_plate_holds_a_god_object)
{
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(rigid_couplings[i], 2.0);
    dCreateBox(w->space, 0.4, 0.4, 0.001);
    world_start_far(w, 0.0, 0.0, RADIUS + 0.002);
    go_to(w, (const double[3]){0.02, 0.0, -0.04}, 200);
    cw_run(w, 600);
    CHECK_NEAR(state_of(w).proxy.position[2], 0.0005 + RADIUS, 1e-8);
    CHECK_NEAR(w->force[2], KV * (0.0405 + RADIUS), 1e-4);
  }
}

/* ---- both: bodies ---- */

/* Between a hand that rests and a spring: all couplings hold the same but for the contact's own
 * spring. */
TEST(held_still_all_couplings_are_springs_in_a_row)
{
  static const hap_coupling all[] = {HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY,
                                     HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};
  static const double k = 2000.0;
  const double wanted[] = {k, k * KV / (k + KV), KV, KV};
  for (int on_cube = 0; on_cube < 2; ++on_cube) {
    for (size_t i = 0; i < 4; ++i) {
      contact_world *w = open_world(all[i], 2.0);
      w->hand_def.stiffness = k;
      dWorldSetGravity(w->world, 0.0, 0.0, -CW_GRAVITY);
      cw_add_floor(w);
      if (on_cube) {
        cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.05);
      }
      double top = on_cube ? 0.1 : 0.0;
      world_start_far(w, 0.0, 0.0, top + RADIUS + 0.001);
      cw_run(w, 300); /* the cube has come to rest */
      double rest = on_cube ? w->position[0][2] + 0.05 : 0.0;
      go_to(w, (const double[3]){0.0, 0.0, rest + RADIUS - 0.004}, 100);
      cw_run(w, 1500);
      double sunk = on_cube ? rest - w->position[0][2] - 0.05 : 0.0;
      CHECK_NEAR(sunk, 0.0, 1e-6);
      CHECK_NEAR(w->force[2], (0.004 - sunk) * wanted[i], 1e-4);
      CHECK((all[i] == HAP_COUPLING_DIRECT) == (state_of(w).coupling == HAP_COUPLING_DIRECT));
    }
  }
}

/* What the hand gives the cube gets, less what the tool takes: F = m a, and momentum. */
TEST(a_free_cube_is_accelerated_by_the_force)
{
  const double mass = 0.2;
  for (size_t i = 0; i < 2; ++i) {
    double own = i == 0 ? 0.0 : 0.1;
    contact_world *w = open_world(rigid_couplings[i], 2.0);
    cw_add_cube(w, mass, 0.05, 0.025, 0.0, 0.0);
    cw_start(w, -RADIUS - 0.0005, 0.0, 0.0);
    double tool = 0.0;
    int pushed = 0;
    cw_run(w, 2);
    cw_move_hand(w, 0.1, 0.0, 0.0);
    for (int t = 0; t < 200; ++t) {
      cw_tick(w);
      hap_pointer_state state = state_of(w);
      double speed = state.twist.linear[0];
      CHECK_NEAR(mass * w->velocity[0][0] + own * speed, w->impulse[0], 2e-4); /* of 0.03 */
      CHECK(state.proxy.position[0] <= w->position[0][0] - 0.025 - RADIUS + 1e-8);
      tool = speed;
      pushed += state.contacts > 0;
    }
    CHECK(pushed > 5 && w->velocity[0][0] > 0.1);
    CHECK_NEAR(mass * w->velocity[0][0] + own * tool, w->impulse[0], 1e-6);
    CHECK_NEAR(cw_stats(w).hand.momentum_ratio, 1.0, 1e-9);
  }
}

/* Thrown against a hand that does not move: half a swing of the cube on the coupling's spring. */
TEST(a_cube_bounces_on_a_god_object_in_the_time_of_its_spring)
{
  const double mass = 0.06;
  const double speed = 0.1;
  contact_world *w = open_world(HAP_COUPLING_GOD_OBJECT, 0.0);
  dBodyID cube = cw_add_cube(w, mass, 0.05, 0.025 + 0.005, 0.0, 0.0);
  dBodySetLinearVel(cube, -speed, 0.0, 0.0);
  cw_start(w, -RADIUS, 0.0, 0.0);
  int touching = 0;
  double peak = 0.0;
  for (int i = 0; i < 300; ++i) {
    cw_tick(w);
    touching += state_of(w).contacts > 0;
    peak = fmax(peak, cw_norm(w->force));
  }
  printf("# %d ticks, %.4f N, back at %.4f m/s\n", touching, peak, w->velocity[0][0]);
  CHECK_NEAR(touching * T, M_PI * sqrt(mass / KV), 2.5 * T);
  CHECK_NEAR(peak, speed * sqrt(mass * KV), 0.01 * speed * sqrt(mass * KV));
  CHECK_NEAR(w->velocity[0][0], speed, 0.01 * speed);
}

/* Two hands squeeze a cube: it is held between two springs. */
TEST(two_hands_squeeze_a_cube)
{
  for (size_t i = 0; i < 2; ++i) {
    hap_pointer_id other;
    hap_pointer_state state;
    hap_pose pose = {{RADIUS + 0.025 - 0.002, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    contact_world *w = open_world(rigid_couplings[i], 2.0);
    cw_add_cube(w, 0.5, 0.05, 0.0, 0.0, 0.0);
    cw_start(w, -RADIUS - 0.025 + 0.002, 0.0, 0.0);
    CHECK(hap_pointer_add(w->session, &w->hand_def, &other) == HAP_OK);
    CHECK(hap_pointer_set_target(w->session, other, &pose, NULL) == HAP_OK);
    cw_run(w, 3000);
    CHECK(hap_pointer_get(w->session, other, &state, sizeof state) == HAP_OK);
    CHECK_NEAR(state.wrench.force[0], 0.002 * KV, 1e-3);
    CHECK_NEAR(w->force[0], -0.002 * KV, 1e-3);
    CHECK(state.coupling == (uint32_t)rigid_couplings[i]);
  }
}

/* A kinematic cube comes from below. */
TEST(a_driven_body_carries_a_god_object_with_it)
{
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(rigid_couplings[i], 2.0);
    dBodyID cube = cw_add_cube(w, 1.0, 0.1, 0.0, 0.0, -0.05 - 0.001);
    dBodySetKinematic(cube);
    dBodySetLinearVel(cube, 0.0, 0.0, 0.05);
    cw_start(w, 0.0, 0.0, RADIUS);
    cw_run(w, 200);
    hap_pointer_state state = state_of(w);
    double depth = w->position[0][2] + 0.05;
    CHECK_NEAR(state.proxy.position[2], RADIUS + depth, 1e-8);
    CHECK_NEAR(w->force[2], KV * depth + 2.0 * 0.05, 1.1 * KV * 0.05 * T);
    CHECK(depth > 0.008);
  }
}

/* ---- friction ---- */

TEST(friction_holds_a_god_object_to_the_cone)
{
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(rigid_couplings[i], i == 0 ? 0.5 : 5.0);
    w->hand_def.friction = 0.5;
    cw_add_floor(w);
    world_start_far(w, 0.0, 0.0, RADIUS + 0.001);
    go_to(w, (const double[3]){0.0, 0.0, RADIUS - 0.004}, 50);
    cw_run(w, 300);
    CHECK_NEAR(w->force[2], 0.004 * KV, 1e-5);
    double held = state_of(w).proxy.position[0];
    go_to(w, (const double[3]){0.0015, 0.001, RADIUS - 0.004}, 100); /* 1.8 mm of 2 */
    cw_run(w, 2000);
    CHECK_NEAR(state_of(w).proxy.position[0], held, 1e-9);
    CHECK_NEAR(w->force[0], -0.0015 * KV, 1e-4);
    CHECK_NEAR(w->force[1], -0.001 * KV, 1e-4);
    go_to(w, (const double[3]){0.0, 0.0, RADIUS - 0.004}, 100); /* and back: nothing has crept */
    cw_run(w, 500);
    CHECK_NEAR(w->force[0], 0.0, 1e-6);
    go_to(w, (const double[3]){0.012, -0.016, RADIUS - 0.004}, 400);
    CHECK_NEAR(w->force[0], -0.5 * w->force[2] * 0.6, 2e-3);
    CHECK_NEAR(w->force[1], 0.5 * w->force[2] * 0.8, 2e-3);
    cw_run(w, 300); /* at rest without mass it stays where the spring has the cone's force */
    double across = hypot(w->force[0], w->force[1]);
    CHECK(across < 0.5 * w->force[2] + 1e-6 && (i == 1 || across > 0.5 * w->force[2] - 1e-6));
    hap_pointer_state state = state_of(w);
    CHECK_NEAR(hypot(state.proxy.position[0] - 0.012, state.proxy.position[1] + 0.016), across / KV,
               1e-6);
    double slid[3];
    memcpy(slid, state.proxy.position, sizeof slid);
    go_to(w, (const double[3]){0.0114, -0.0152, RADIUS - 0.004}, 100); /* 1 mm back: it sticks */
    state = state_of(w);
    CHECK_NEAR(state.proxy.position[0], slid[0], i == 0 ? 1e-6 : 1e-4);
    CHECK_NEAR(state.proxy.position[1], slid[1], i == 0 ? 1e-6 : 1e-4);
  }
}

/* Held by friction and drawn along: the cube goes with the pointer. */
TEST(friction_of_a_god_object_draws_a_cube_along)
{
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(rigid_couplings[i], 2.0);
    w->hand_def.friction = 0.8;
    w->surface.mu = 0.1;
    dWorldSetGravity(w->world, 0.0, 0.0, -CW_GRAVITY);
    cw_add_floor(w);
    cw_add_cube(w, 0.2, 0.1, 0.0, 0.0, 0.05);
    cw_start(w, 0.0, 0.0, 0.1 + RADIUS + 0.001);
    cw_run(w, 200);
    go_to(w, (const double[3]){0.0, 0.0, 0.1 + RADIUS - 0.004}, 100);
    cw_run(w, 100);
    go_to(w, (const double[3]){0.05, 0.0, 0.1 + RADIUS - 0.004}, 1000);
    hap_pointer_state state = state_of(w);
    CHECK_NEAR(state.proxy.position[0] - w->position[0][0], 0.0, 1e-4);
    CHECK(w->position[0][0] > 0.04);
    CHECK_NEAR(-w->force[0], 0.1 * (0.2 * CW_GRAVITY + w->force[2]), 0.02);
  }
}

/* ---- virtual coupling ---- */

/* A hand that speeds up evenly feels the tool's mass. */
TEST(in_the_air_the_virtual_tool_is_felt_as_its_mass)
{
  static const double masses[] = {0.02, 0.1, 0.5};
  for (size_t i = 0; i < 3; ++i) {
    contact_world *w = open_world(HAP_COUPLING_VIRTUAL, 2.0 * sqrt(masses[i] * KV));
    w->hand_research.virtual_mass = masses[i];
    world_start_far(w, 0.0, 0.0, 0.0);
    for (int t = 0; t < 600; ++t) {
      cw_move_hand(w, 0.5 * T * t, 0.0, 0.0);
      cw_tick(w);
    }
    CHECK_NEAR(w->force[0], -masses[i] * 0.5, 0.01 * masses[i]);
    CHECK(state_of(w).contacts == 0 && state_of(w).coupling == HAP_COUPLING_VIRTUAL);
  }
}

/* Swinging on the spring of a hand that was moved and stopped. */
TEST(the_virtual_tool_swings_at_its_resonance)
{
  static const double masses[] = {0.2, 1.0};
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(HAP_COUPLING_VIRTUAL, 0.0);
    w->hand_research.virtual_mass = masses[i];
    world_start_far(w, 0.0, 0.0, 0.0);
    go_to(w, (const double[3]){0.01, 0.0, 0.0}, 10);
    double first = 0.0;
    double last = 0.0;
    int crossings = 0;
    double before = w->force[0];
    double peaks[2] = {0.0, 0.0};
    for (int t = 0; t < 600; ++t) {
      cw_tick(w);
      peaks[t / 300] = fmax(peaks[t / 300], fabs(w->force[0]));
      if ((before < 0.0) != (w->force[0] < 0.0)) {
        last = t - w->force[0] / (w->force[0] - before);
        first = crossings == 0 ? last : first;
        ++crossings;
      }
      before = w->force[0];
    }
    double period = 2.0 * (last - first) * T / (crossings - 1);
    double wanted = 2.0 * M_PI * sqrt(masses[i] / KV);
    printf("# %g kg: period %.5f s, %.5f s\n", masses[i], period, wanted);
    CHECK(crossings >= 5);
    CHECK_NEAR(peaks[1], peaks[0], 0.02 * peaks[0]); /* without a damper it goes on */
    CHECK_NEAR(period, wanted, 0.005 * wanted);
  }
}

/* Two bodies that meet without a rebound: the tool and what it hit go on together for a moment. */
TEST(a_virtual_tool_hits_as_a_body_without_rebound)
{
  const double tool = 0.3;
  const double mass = 0.2;
  contact_world *w = open_world(HAP_COUPLING_VIRTUAL, 0.0);
  w->hand_research.virtual_mass = tool;
  w->hand_expert.coupling_stiffness = 1.0;
  cw_add_cube(w, mass, 0.05, 0.025 + 0.02, 0.0, 0.0);
  cw_start(w, -RADIUS, 0.0, 0.0);
  cw_move_hand(w, 0.5, 0.0, 0.0);
  hap_pointer_state state = state_of(w);
  double before = 0.0;
  while (w->velocity[0][0] == 0.0 && w->seen.ticks < 2000) {
    before = state.twist.linear[0];
    cw_tick(w);
    state = state_of(w);
  }
  cw_run(w, 2);
  state = state_of(w);
  CHECK(before > 0.02);
  CHECK_NEAR(w->velocity[0][0], before * tool / (tool + mass), 0.02 * before);
  CHECK_NEAR(state.twist.linear[0], w->velocity[0][0], 0.02 * before);
}

/* ---- what may be asked for ---- */

TEST(what_cannot_be_is_refused)
{
  const struct {
    double mass;
    double inertia;
    bool good;
  } values[] = {{0.1, 0.0, true},       {1e-6, 0.0, true},  {1e6, 1e12, true},
                {0.0, 0.0, false},      {-1.0, 0.0, false}, {NAN, 0.0, false},
                {HUGE_VAL, 0.0, false}, {0.1, -1.0, false}, {0.1, NAN, false},
                {0.1, HUGE_VAL, false}};
  for (size_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
    hap_pointer_id id;
    contact_world *w = open_world(HAP_COUPLING_VIRTUAL, 0.0);
    world_start_far(w, 0.0, 0.0, 0.0);
    hap_pointer_def def = w->hand_def;
    hap_pointer_research_def research = w->hand_research;
    def.research = &research;
    research.virtual_mass = values[i].mass;
    research.virtual_inertia = values[i].inertia;
    hap_status status = hap_pointer_add(w->session, &def, &id);
    CHECK(status == (values[i].good ? HAP_OK : HAP_ERROR_ARGUMENT));
  }
  CHECK(strcmp(hap_coupling_name(HAP_COUPLING_GOD_OBJECT), "god-object") == 0);
  CHECK(strcmp(hap_coupling_name(HAP_COUPLING_VIRTUAL), "virtual") == 0);
  CHECK(hap_coupling_name((hap_coupling)5) == NULL && hap_coupling_name((hap_coupling)-1) == NULL);
}

TEST(a_spring_is_asked_for_as_for_a_proxy)
{
  for (size_t i = 0; i < 2; ++i) {
    hap_pointer_id id;
    contact_world *w = open_world(rigid_couplings[i], 0.0);
    world_start_far(w, 0.0, 0.0, 0.0);
    hap_pointer_def def = w->hand_def;
    hap_pointer_expert_def expert = w->hand_expert;
    def.expert = &expert;
    expert.coupling_stiffness = 0.0; /* and no device that says what it holds */
    CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
    def = w->hand_def;
    def.force_scale = 0.0;
    CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
    def = w->hand_def;
    expert = w->hand_expert;
    def.expert = &expert;
    expert.coupling = (hap_coupling)5;
    CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_ARGUMENT);
    w = open_world(HAP_COUPLING_DIRECT, 0.0);
    w->hand_expert.coupling_damping = w->hand_expert.coupling_stiffness = 0.0;
    w->def.model = HAP_MODEL_ACCELERANCE;
    world_start_far(w, 0.0, 0.0, 0.0);
    def = w->hand_def;
    expert = w->hand_expert;
    def.expert = &expert;
    expert.coupling = rigid_couplings[i];
    expert.coupling_stiffness = KV;
    CHECK(hap_pointer_add(w->session, &def, &id) == HAP_ERROR_UNSUPPORTED);
  }
}

static void change_model(contact_world *w, hap_model model)
{
  CHECK(hap_session_set_model(w->session, model) == HAP_OK);
  for (int i = 0; i < 200 && cw_stats(w).loop.model != (uint32_t)model; ++i) {
    cw_tick(w);
  }
}

/* Pressed into the floor: direct in another model, and out of it again, slowly, in contact. */
TEST(another_model_ends_it_and_contact_begins_it_anew)
{
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(rigid_couplings[i], 5.0);
    cw_add_floor(w);
    world_start_far(w, 0.0, 0.0, RADIUS + 0.001);
    go_to(w, (const double[3]){0.0, 0.0, RADIUS - 0.002}, 50);
    cw_run(w, 300);
    CHECK_NEAR(w->force[2], 0.002 * KV, 1e-4);
    change_model(w, HAP_MODEL_ACCELERANCE);
    hap_pointer_state state = state_of(w);
    CHECK(state.coupling == HAP_COUPLING_DIRECT && state.coupling_reason == HAP_COUPLING_MODEL);
    cw_run(w, 100);
    CHECK_NEAR(w->force[2], 0.002 * w->hand_def.stiffness, 1e-4);
    change_model(w, HAP_MODEL_CONTACT);
    double before = w->force[2];
    double jump = 0.0;
    for (int t = 0; t < 500; ++t) {
      cw_tick(w);
      jump = fmax(jump, fabs(w->force[2] - before));
      before = w->force[2];
    }
    state = state_of(w);
    CHECK(state.coupling == (uint32_t)rigid_couplings[i]);
    CHECK_NEAR(w->force[2], 0.002 * KV, 1e-4);
    CHECK_NEAR(state.proxy.position[2], RADIUS, 1e-8);
    CHECK(jump < 0.3 * 0.002 * w->hand_def.stiffness);
  }
}

/* A device that leaps has not been pressed in: no force, and going on from there is felt. */
TEST(a_device_that_leaps_begins_anew)
{
  for (size_t i = 0; i < 2; ++i) {
    hap_detail detail = {""};
    contact_world *w = open_world(rigid_couplings[i], 1.0);
    cw_add_floor(w);
    cw_add_cube(w, 1.0, 0.1, 5.0, 0.0, 0.0);
    w->ode.world = w->world;
    w->ode.space = w->space;
    w->ode.user = w;
    REQUIRE(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_OK);
    REQUIRE(hap_device_open("virtual:hand=rigid,max_force=1000,blend=linear,"
                            "path=0:0/0/0.03;0.3:0/0/0.02;0.3001:0/0/-0.03;1:0/0/-0.032",
                            &w->hand_def.device, &detail) == HAP_OK);
    REQUIRE(hap_pointer_add(w->session, &w->hand_def, &w->hand) == HAP_OK);
    REQUIRE(hap_session_start(w->session) == HAP_OK);
    double peak = 0.0;
    for (int t = 0; t < 1000; ++t) {
      CHECK(hap_session_advance(w->session, 1) == HAP_OK);
      hap_pointer_state state = state_of(w);
      peak = fmax(peak, hapi_v3_norm(state.wrench.force));
    }
    printf("# peak %.3f N\n", peak);
    CHECK(peak < 2.0 * 0.002 * KV && cw_stats(w).faults.count == 0);
    hap_session_stop(w->session);
    hap_device *device = w->hand_def.device;
    cw_close(w);
    hap_device_close(device);
  }
}

/* What was put over the pointer lets it out slowly. */
TEST(a_body_that_is_put_over_the_pointer_lets_it_out)
{
  for (size_t i = 0; i < 2; ++i) {
    contact_world *w = open_world(rigid_couplings[i], 2.0);
    dGeomID wall = dCreateBox(w->space, 0.1, 0.1, 0.1);
    dGeomSetPosition(wall, 0.0, 0.0, -1.0);
    world_start_far(w, 0.0, 0.0, 0.05 + RADIUS - 0.004);
    cw_run(w, 100);
    CHECK(cw_norm(w->force) == 0.0);
    CHECK(hap_session_lock(w->session) == HAP_OK);
    dGeomSetPosition(wall, 0.0, 0.0, 0.0);
    CHECK(hap_session_unlock(w->session) == HAP_OK);
    double jump = 0.0;
    double before = 0.0;
    for (int t = 0; t < 300; ++t) {
      cw_tick(w);
      jump = fmax(jump, fabs(w->force[2] - before));
      before = w->force[2];
    }
    CHECK_NEAR(w->force[2], 0.004 * KV, 1e-3);
    CHECK(jump < 0.3 * 0.004 * KV);
  }
}

/* The same run twice, in lockstep. */
TEST(lockstep_repeats_them)
{
  for (size_t i = 0; i < 2; ++i) {
    uint64_t hashes[2];
    for (int k = 0; k < 2; ++k) {
      contact_world *w = open_world(rigid_couplings[i], 2.0);
      w->hand_def.friction = 0.4;
      dWorldSetGravity(w->world, 0.0, 0.0, -CW_GRAVITY);
      cw_add_floor(w);
      cw_add_cube(w, 0.3, 0.05, 0.0, 0.0, 0.025);
      cw_add_cube(w, 0.3, 0.05, 0.051, 0.0, 0.025);
      cw_start(w, -0.045, 0.003, 0.02);
      for (int t = 0; t < 800; ++t) {
        cw_move_hand(w, 0.1 * sin(0.02 * t) + 0.05, 0.02 * cos(0.05 * t), 0.0);
        cw_tick(w);
      }
      hashes[k] = cw_stats(w).loop.trace_hash;
      CHECK(hashes[k] != 0 && w->position[1][0] > 0.055);
    }
    CHECK(hashes[0] == hashes[1]);
  }
}
