/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Model contact where the world changes under the hand: sleep, the border of the
 * range, ground of triangles, edits, other models, other rates, real threads. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/clock.h"
#include "tests/contact_world.h"
#include "tests/owned_rig.h"
#include "tests/solids.h"

#define G CW_GRAVITY

static double points_distance(const double a[3], const double b[3])
{
  double apart[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return cw_norm(apart);
}

/* ---- sleep ---- */

static void let_sleep(contact_world *w)
{
  dWorldSetAutoDisableFlag(w->world, 1);
  dWorldSetAutoDisableSteps(w->world, 5);
}

static int count_awake(const contact_world *w)
{
  int awake = 0;
  for (int i = 0; i < w->body_count; ++i) {
    awake += dBodyIsEnabled(w->bodies[i]);
  }
  return awake;
}

TEST(a_body_falls_asleep_beside_the_hand_and_wakes_when_touched)
{
  contact_world *w = cw_new(G);
  let_sleep(w);
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.06, 0.0, 0.0, 0.03);
  cw_start(w, -0.045, 0.0, 0.03);
  cw_run(w, 1001);
  CHECK(w->seen.range_min == 1);
  CHECK(count_awake(w) == 0);
  double where[3];
  memcpy(where, w->position[0], sizeof where);
  cw_run(w, 1000);
  CHECK(count_awake(w) == 0);
  CHECK(points_distance(where, w->position[0]) == 0.0);
  cw_go(w, 0.1, 0.0, 0.0, 200);
  CHECK(count_awake(w) == 1);
  CHECK(w->position[0][0] > 0.005);
  CHECK(-w->force[0] > 1.0);
}

TEST(a_sleeping_body_wakes_when_another_one_hits_it)
{
  contact_world *w = cw_new(G);
  let_sleep(w);
  w->surface.mu = 0.1;
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.06, 0.0, 0.0, 0.0299);
  cw_add_cube(w, 1.0, 0.06, -0.3, 0.0, 0.0299);
  cw_start(w, 0.0, 0.0, 0.075);
  cw_run(w, 1001);
  CHECK(count_awake(w) == 0);
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dBodyEnable(w->bodies[1]);
  dBodySetLinearVel(w->bodies[1], 1.0, 0.0, 0.0);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  cw_run(w, 700);
  CHECK(w->position[0][0] > 0.04); /* half of 0.7 m/s, against friction */
  CHECK(w->position[0][0] - w->position[1][0] > 0.0595);
}

TEST(a_tower_falls_asleep_in_its_whole)
{
  contact_world *w = cw_new(G);
  let_sleep(w);
  cw_add_floor(w);
  for (int i = 0; i < 5; ++i) {
    cw_add_cube(w, 1.0, 0.06, 0.0, 0.0, 0.03 + 0.06 * i - 1e-4 * (i + 1));
  }
  cw_start(w, -0.045, 0.0, 0.15);
  cw_run(w, 2001);
  printf("# %d awake, range %u .. %u\n", count_awake(w), w->seen.range_min, w->seen.range_max);
  CHECK(count_awake(w) == 0);
  CHECK(w->seen.range_min == 5);
  for (int i = 0; i < 5; ++i) {
    CHECK(fabs(w->position[i][0]) < 1e-4);
  }
}

/* ---- the range ---- */

TEST(the_range_is_the_touched_island_when_it_fits)
{
  contact_world *w = cw_new(G);
  w->def.physics_hz = 100.0; /* a short reach */
  cw_add_floor(w);
  for (int i = 0; i < 6; ++i) {
    cw_add_cube(w, 1.0, 0.05, 0.05 * i, 0.0, 0.0249);
  }
  for (int i = 0; i < 6; ++i) {
    cw_add_cube(w, 1.0, 0.05, 0.05 * i, 0.3, 0.0249);
  }
  cw_start(w, -0.036, 0.0, 0.025);
  cw_run(w, 400); /* the others might move: until it is seen that they rest, they are in it */
  w->seen.range_min = UINT32_MAX;
  w->seen.range_max = 0;
  cw_run(w, 200);
  hap_stats stats = cw_stats(w);
  CHECK(stats.model.range_bodies == 6 && stats.model.edge_bodies == 0 &&
        stats.model.measured_bodies == 0);
  CHECK(w->seen.range_min == 6 && w->seen.range_max == 6);
}

/* Outside of the range a body does not wake: the nearest three answer at once. */
TEST(what_does_not_fit_is_left_out_from_the_far_end)
{
  contact_world *w = cw_new(0.0);
  w->surface.mu = 0.0;
  w->def.physics_hz = 100.0;
  w->def.max_bodies = 3;
  for (int i = 0; i < 8; ++i) {
    cw_add_cube(w, 1.0, 0.05, 0.05 * (7 - i), 0.0, 0.0); /* the far one first */
  }
  cw_start(w, -0.036, 0.0, 0.0);
  cw_run(w, 100);
  hap_stats stats = cw_stats(w);
  CHECK(stats.model.range_bodies == 3);
  CHECK(stats.model.edge_bodies == 1);
}

/* Sliding and turning cubes that the hand flies past: they do not notice. */
static void fly_past(double hz, double gravity)
{
  double worst_place = 0.0;
  double worst_speed = 0.0;
  uint32_t owned = 0;
  double start[12][3];
  contact_world *w = cw_new(gravity);
  w->surface.mu = 0.0;
  w->def.physics_hz = hz;
  if (gravity > 0.0) {
    cw_add_floor(w);
  }
  for (int i = 0; i < 12; ++i) {
    dBodyID cube = cw_add_cube(w, 1.0, 0.06, 0.12 * i, -0.2, 0.0299);
    dBodySetLinearVel(cube, 0.0, 0.3, 0.0);
    dBodySetAngularVel(cube, 0.0, 0.0, gravity > 0.0 ? 0.0 : 1.0);
    memcpy(start[i], dBodyGetPosition(cube), sizeof start[i]);
  }
  cw_start(w, -0.2, 0.0, 0.09);
  cw_move_hand(w, 1.2, 0.0, 0.0);
  int step = (int)(1000.0 / hz + 0.5);
  for (int i = 1; i <= 1400 / step; ++i) {
    cw_run(w, i == 1 ? step + 1 : step);
    double t = (double)i / hz;
    for (int k = 0; k < 12; ++k) {
      double wanted[3] = {start[k][0], start[k][1] + 0.3 * t, start[k][2]};
      double speed[3] = {0.0, 0.3, 0.0};
      worst_place = fmax(worst_place, points_distance(dBodyGetPosition(w->bodies[k]), wanted));
      worst_speed =
          fmax(worst_speed, points_distance(dBodyGetLinearVel(w->bodies[k]), speed) / 0.3);
    }
    owned += cw_stats(w).model.range_bodies;
  }
  printf("# %g Hz gravity %g: place %.3g mm, speed %.3g, owned %u\n", hz, gravity,
         1e3 * worst_place, worst_speed, owned);
  CHECK(owned > 5);
  CHECK(worst_place < 1e-3);
  CHECK(worst_speed < 0.01);
  CHECK(cw_stats(w).loop.contact_ticks == 0);
  cw_close(w);
}

TEST(what_enters_and_leaves_the_range_keeps_its_motion)
{
  fly_past(20.0, 0.0);
  fly_past(50.0, 0.0);
  fly_past(20.0, G);
  fly_past(50.0, G);
}

/* ---- fast things come in from outside ---- */

static void wall_hit(double speed, double hz)
{
  contact_world *w = cw_new(0.0);
  w->surface.mu = 0.0;
  w->def.physics_hz = hz;
  cw_add_ball(w, 1.0, 0.03, 0.0, 0.0, 0.0);
  cw_add_ball(w, 1.0, 0.03, -0.06 - 0.37 * speed, 0.0, 0.0);
  dBodySetLinearVel(w->bodies[1], speed, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, 0.042);
  cw_run(w, 801);
  const dReal *a = dBodyGetLinearVel(w->bodies[1]);
  const dReal *b = dBodyGetLinearVel(w->bodies[0]);
  double gap = dBodyGetPosition(w->bodies[0])[0] - dBodyGetPosition(w->bodies[1])[0] - 0.06;
  printf("# %g m/s at %g Hz: %.4f %.4f, gap %.3g mm\n", speed, hz, a[0], b[0], 1e3 * gap);
  CHECK_NEAR((a[0] + b[0]) / speed, 1.0, 5e-3);
  CHECK_NEAR(b[0] / speed, 0.5, 0.05);
  CHECK(gap > -2e-3);
  cw_close(w);
}

TEST(a_ball_that_flies_in_hits_what_is_near_the_hand)
{
  static const double speeds[] = {0.3, 1.0, 3.0, 6.0};
  for (int i = 0; i < 4; ++i) {
    wall_hit(speeds[i], 20.0);
    wall_hit(speeds[i], 60.0);
  }
}

/* ---- edits under the hand ---- */

/* A free cube that the hand pushes; after a third of a second it is steady. */
static contact_world *start_push(void)
{
  contact_world *w = cw_new(0.0);
  cw_add_cube(w, 1.0, 0.06, 0.0, 0.0, 0.0);
  cw_add_cube(w, 1.0, 0.06, 0.3, 0.0, 0.0);
  cw_start(w, -0.0405, 0.0, 0.0);
  cw_go(w, 0.05, 0.0, 0.0, 30);
  return w;
}

TEST(a_body_destroyed_under_the_hand_is_gone)
{
  contact_world *w = start_push();
  CHECK(w->force[0] < 0.0);
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dGeomID geom = dBodyGetFirstGeom(w->bodies[0]);
  CHECK(hap_session_forget_geom(w->session, geom) == HAP_OK);
  CHECK(hap_session_forget_body(w->session, w->bodies[0]) == HAP_OK);
  dGeomDestroy(geom);
  dBodyDestroy(w->bodies[0]);
  w->bodies[0] = NULL;
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  w->ode.before_step = NULL;
  cw_run(w, 100);
  CHECK(cw_norm(w->force) == 0.0);
  CHECK(cw_stats(w).faults.count == 0 && cw_stats(w).faults.bodies_lost == 0);
}

TEST(a_body_moved_by_the_application_stays_where_it_was_put)
{
  contact_world *w = start_push();
  CHECK(w->force[0] < 0.0);
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dBodySetPosition(w->bodies[0], 0.0, 0.02, 0.5);
  dBodySetLinearVel(w->bodies[0], 0.0, 0.0, 0.1); /* another one than before: that can be seen */
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  cw_run(w, 121);
  const double wanted[3] = {0.0, 0.02, 0.5 + 0.1 * 0.1};
  /* the loop's push of the one tick until it hears of it is the body's */
  const double speed[3] = {0.0, 0.0, 0.1};
  CHECK(points_distance(dBodyGetPosition(w->bodies[0]), wanted) < 6e-3);
  CHECK(points_distance(dBodyGetLinearVel(w->bodies[0]), speed) < 5e-3);
  CHECK(cw_norm(w->force) == 0.0);
}

TEST(a_body_put_back_under_the_hand_is_felt_there)
{
  contact_world *w = start_push();
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dBodySetPosition(w->bodies[0], -0.002, 0.003, 0.0);
  dBodySetLinearVel(w->bodies[0], 0.0, 0.0, 0.0);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  cw_go(w, 0.0, 0.0, 0.0, 22);
  CHECK_NEAR(w->position[0][0], -0.002, 5e-4);
  CHECK_NEAR(w->position[0][1], 0.003, 1e-6);
  cw_run(w, 5);
  CHECK(w->force[0] < -0.5);
}

TEST(a_new_mass_counts_from_the_next_step)
{
  contact_world *w = start_push();
  dMass mass;
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dMassSetBoxTotal(&mass, 4.0, 0.06, 0.06, 0.06);
  dBodySetMass(w->bodies[0], &mass);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  cw_go(w, 0.4, 0.0, 0.0, 22);
  for (int i = 0; i < 20; ++i) {
    double before = w->velocity[0][0];
    cw_tick(w);
    CHECK(w->force[0] < 0.0);
    CHECK_NEAR((w->velocity[0][0] - before) * 4.0 / 1e-3, -w->force[0],
               1e-6 * fabs(w->force[0]) + 1e-6);
  }
}

TEST(a_geom_that_grows_is_felt_and_stands_on_its_new_faces)
{
  contact_world *w = cw_new(G);
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.06, 0.0, 0.0, 0.0299);
  cw_start(w, 0.0, 0.0, 0.0695);
  cw_run(w, 100);
  double before = w->force[2];
  CHECK_NEAR(before, 2000.0 * 4e-4, 0.05);
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dGeomBoxSetLengths(dBodyGetFirstGeom(w->bodies[0]), 0.06, 0.06, 0.064);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  cw_run(w, 1500);
  CHECK_NEAR(w->position[0][2], 0.032 - 1e-4, 2e-4);
  CHECK_NEAR(w->force[2], 2000.0 * 4.4e-3, 0.1);
}

TEST(a_body_added_in_front_of_another_is_pushed_with_it)
{
  contact_world *w = cw_new(0.0);
  cw_add_cube(w, 1.0, 0.06, 0.0, 0.0, 0.0);
  cw_start(w, -0.0405, 0.0, 0.0);
  cw_go(w, 0.05, 0.0, 0.0, 40);
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  cw_add_cube(w, 1.0, 0.06, 0.07, 0.0, 0.0);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  cw_run(w, 561);
  CHECK(cw_stats(w).model.range_bodies == 2);
  CHECK(dBodyGetLinearVel(w->bodies[1])[0] > 0.03);
  CHECK(dBodyGetPosition(w->bodies[1])[0] - dBodyGetPosition(w->bodies[0])[0] > 0.0595);
  CHECK_NEAR(w->seen.momentum[0] / w->seen.impulse[0], 1.0, 5e-3);
}

/* ---- ground of triangles ---- */

/* Ridges along y, 0.1 m apart and 0.05 m high, in cells of 0.05 m. */
static double ground_ridges(int i, int k)
{
  (void)k;
  return i % 2 == 0 ? -0.05 : 0.0;
}

typedef struct slide {
  double mean;
  double least;
  double most;
  double lowest;
  double highest;
} slide;

/* A box pushed over the floor at 0.1 m/s, off the diagonals and seams. */
static slide push_over(bool triangles)
{
  static grid g;
  slide s = {0.0, 1e9, 0.0, 1e9, -1e9};
  contact_world *w = cw_new(G);
  w->expert.max_hull_points = 100000;
  if (triangles) {
    grid_fill(&g, 24, 0.031, grid_level);
    grid_mesh(w->space, &g);
  } else {
    cw_add_floor(w);
  }
  cw_add_box(w, 1.0, (const double[3]){0.08, 0.08, 0.06}, -0.1, 0.013, 0.0299);
  cw_start(w, -0.1505, 0.013, 0.012);
  cw_go(w, 0.1, 0.0, 0.0, 700);
  for (int i = 0; i < 1500; ++i) {
    cw_tick(w);
    s.mean -= w->force[0] / 1500.0;
    s.least = fmin(s.least, -w->force[0]);
    s.most = fmax(s.most, -w->force[0]);
    s.lowest = fmin(s.lowest, w->position[0][2]);
    s.highest = fmax(s.highest, w->position[0][2]);
  }
  hap_stats stats = cw_stats(w);
  printf(
      "# triangles %d: %.4f N, %.4f .. %.4f, z %.5f .. %.5f, x %.3f, range %u, "
      "dropped %llu\n",
      triangles, s.mean, s.least, s.most, s.lowest, s.highest, w->position[0][0], w->seen.range_min,
      (unsigned long long)stats.model.capacity_dropped);
  CHECK(w->seen.range_min == 1);
  CHECK(stats.faults.count == 0);
  cw_close(w);
  return s;
}

TEST(a_box_slides_over_triangles_as_over_a_plane)
{
  slide plane = push_over(false);
  slide mesh_floor = push_over(true);
  CHECK_NEAR(plane.mean / (0.5 * G), 1.0, 0.01);
  CHECK_NEAR(mesh_floor.mean / plane.mean, 1.0, 0.01);
  CHECK(mesh_floor.least > 0.99 * plane.mean && mesh_floor.most < 1.01 * plane.mean);
  CHECK(mesh_floor.highest - mesh_floor.lowest < 1e-4);
}

TEST(a_ball_rolls_over_triangles_as_over_a_plane)
{
  static grid g;
  double lowest = 1.0;
  double highest = 0.0;
  contact_world *w = cw_new(G);
  w->expert.max_hull_points = 100000;
  grid_fill(&g, 24, 0.031, grid_level);
  grid_mesh(w->space, &g);
  cw_add_ball(w, 1.0, 0.03, -0.1, 0.013, 0.0299);
  dBodySetLinearVel(w->bodies[0], 0.2, 0.013, 0.0);
  dBodySetAngularVel(w->bodies[0], -0.013 / 0.03, 0.2 / 0.03, 0.0);
  cw_start_following(w, 0.0, 0.0, 0.043);
  for (int i = 0; i < 1001; ++i) {
    cw_tick(w);
    lowest = fmin(lowest, w->position[0][2]);
    highest = fmax(highest, w->position[0][2]);
  }
  printf("# ball: v %.5f %.5f, z %.5f .. %.5f, range %u\n", w->velocity[0][0], w->velocity[0][1],
         lowest, highest, w->seen.range_min);
  CHECK(w->seen.range_min == 1 && cw_norm(w->force) == 0.0);
  CHECK_NEAR(w->velocity[0][0] / 0.2, 1.0, 0.01);
  CHECK_NEAR(w->velocity[0][1], 0.013, 0.01 * 0.2);
  CHECK(highest - lowest < 1.5e-4);
}

TEST(ridges_carry_a_box)
{
  static grid g;
  contact_world *w = cw_new(G);
  w->expert.max_hull_points = 100000;
  grid_fill(&g, 24, 0.05, ground_ridges);
  grid_mesh(w->space, &g);
  cw_add_box(w, 1.0, (const double[3]){0.24, 0.1, 0.04}, 0.01, 0.013, 0.0199);
  cw_start(w, 0.01, 0.013, 0.055);
  cw_run(w, 1500);
  printf("# ridges: x %.5f z %.5f, range %u\n", w->position[0][0], w->position[0][2],
         w->seen.range_min);
  CHECK(w->seen.range_min == 1);
  CHECK_NEAR(w->position[0][2], 0.02, 1e-3);
  CHECK_NEAR(w->position[0][0], 0.01, 1e-3);
  cw_go(w, 0.0, 0.0, -0.02, 400);
  CHECK_NEAR(w->force[2], 2000.0 * 3e-3, 2.0);
  CHECK_NEAR(w->position[0][2], 0.02, 2e-3);
}

TEST(a_ball_on_a_heightfield_is_owned_and_felt)
{
  static grid g;
  contact_world *w = cw_new(G);
  grid_fill(&g, 20, 0.1, grid_level);
  grid_field(w->space, &g);
  cw_add_ball(w, 1.0, 0.05, 0.02, 0.03, 0.0499);
  cw_start(w, 0.02, 0.03, 0.112);
  cw_run(w, 200);
  hap_stats stats = cw_stats(w);
  CHECK(stats.model.measured_bodies == 0 && stats.model.range_bodies == 1);
  cw_go(w, 0.0, 0.0, -0.02, 200);
  cw_move_hand(w, 0.0, 0.0, 0.0);
  double least = 1e9;
  double most = 0.0;
  for (int i = 0; i < 500; ++i) {
    cw_tick(w);
    least = fmin(least, w->force[2]);
    most = fmax(most, w->force[2]);
  }
  printf("# heightfield: %.3f .. %.3f N, z %.5f\n", least, most, w->position[0][2]);
  CHECK(least > 0.5 * 4.0 && most < 1.5 * 4.4);
  CHECK(w->position[0][2] > 0.045 && w->position[0][2] < 0.055);
}

/* ---- shapes and who collides ---- */

TEST(a_hull_slides_as_a_box_does)
{
  static box_arrays box;
  dMass mass;
  contact_world *w = cw_new(G);
  cw_add_floor(w);
  dMassSetBoxTotal(&mass, 1.0, 0.08, 0.08, 0.08);
  cw_add(w, convex_box(w->space, &box, AT(0.04, 0.04, 0.04)), &mass, 0.0, 0.0, 0.0399);
  cw_start(w, -0.0505, 0.0, 0.012);
  cw_go(w, 0.1, 0.0, 0.0, 600);
  double worst = 0.0;
  for (int i = 0; i < 600; ++i) {
    cw_tick(w);
    worst = fmax(worst, fabs(-w->force[0] / (0.5 * G) - 1.0));
  }
  CHECK(w->seen.range_min == 1);
  CHECK(worst < 0.02);
  CHECK_NEAR(w->position[0][2], 0.0399, 2e-4);
}

/* A table of a plate and two bars below it, in a space of its own. */
TEST(a_body_of_several_geoms_in_a_nested_space_stands)
{
  dMass mass;
  contact_world *w = cw_new(G);
  cw_add_floor(w);
  dSpaceID own = dSimpleSpaceCreate(w->space);
  dMassSetBoxTotal(&mass, 1.0, 0.2, 0.1, 0.06);
  cw_add(w, dCreateBox(own, 0.2, 0.1, 0.02), &mass, 0.0, 0.0, 0.05);
  for (int i = 0; i < 2; ++i) {
    dGeomID leg = dCreateBox(own, 0.02, 0.1, 0.04);
    dGeomSetBody(leg, w->bodies[0]);
    dGeomSetOffsetPosition(leg, i == 0 ? -0.08 : 0.08, 0.0, -0.0299);
  }
  cw_start(w, 0.0, 0.0, 0.075);
  cw_run(w, 500);
  CHECK(w->seen.range_min == 1);
  CHECK_NEAR(w->position[0][2], 0.05, 4e-4);
  cw_go(w, 0.0, 0.0, -0.02, 500);
  CHECK_NEAR(w->position[0][2], 0.05, 4e-4);
  CHECK_NEAR(w->force[2], 2000.0 * 5e-3, 1.6);
  CHECK(fabs(w->position[0][0]) < 1e-4);
}

static bool no_pair(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  (void)io;
  return false;
}

/* One cube flies through another one. */
static void fly_through(bool by_bits)
{
  contact_world *w = cw_new(0.0);
  w->ode.surface = by_bits ? cw_surface : no_pair;
  for (int i = 0; i < 2; ++i) {
    dGeomID geom = dBodyGetFirstGeom(cw_add_cube(w, 1.0, 0.06, 0.07 * i, 0.0, 0.0));
    dGeomSetCategoryBits(geom, by_bits ? 1ul << i : ~0ul);
    dGeomSetCollideBits(geom, by_bits ? 1ul << i : ~0ul);
  }
  dBodySetLinearVel(w->bodies[0], 0.2, 0.0, 0.0);
  cw_start_following(w, 0.0, 0.0, 0.043);
  cw_run(w, 501);
  CHECK_NEAR(w->velocity[0][0], 0.2, 1e-9);
  CHECK_NEAR(dBodyGetPosition(w->bodies[1])[0], 0.07, 1e-12);
  cw_close(w);
}

TEST(a_pair_without_common_bits_or_refused_has_no_contact)
{
  fly_through(true);
  fly_through(false);
}

static struct {
  dGeomID pairs[4096][2];
  int count;
  int twice;
} asking;

static bool surface_ask(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  contact_world *w = user;
  for (int i = 0; i < asking.count; ++i) {
    const dGeomID *p = asking.pairs[i];
    asking.twice += (p[0] == a && p[1] == b) || (p[0] == b && p[1] == a);
  }
  if (asking.count < 4096) {
    asking.pairs[asking.count][0] = a;
    asking.pairs[asking.count++][1] = b;
  }
  *io = w->surface;
  return true;
}

static void forget_asked(void *user, double step_s)
{
  asking.count = 0;
  cw_before_step(user, step_s);
}

static void ask_in_pile(int range)
{
  contact_world *w = cw_new(G);
  memset(&asking, 0, sizeof asking);
  w->ode.surface = surface_ask;
  w->ode.before_step = forget_asked;
  w->def.max_bodies = range;
  cw_add_floor(w);
  for (int i = 0; i < 8; ++i) {
    cw_add_cube(w, 1.0, 0.05, 0.05 * i, 0.0, 0.0249);
  }
  cw_start(w, -0.0355, 0.0, 0.025);
  cw_go(w, 0.05, 0.0, 0.0, 500);
  printf("# range %d: %d pairs asked twice in a step, of %u steps\n", range, asking.twice,
         w->seen.steps);
  CHECK(asking.twice == 0);
  cw_close(w);
}

TEST(the_surface_of_a_pair_is_asked_once_a_step)
{
  ask_in_pile(64);
  ask_in_pile(3);
}

/* ---- other models on the way ---- */

/* Between two syncs a body goes no farther than its speed says; IMPULSE is a step ahead. */
TEST(other_models_take_over_without_a_jump)
{
  static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE, HAP_MODEL_CONTACT,
                                     HAP_MODEL_IMPULSE, HAP_MODEL_CONTACT};
  contact_world *w = cw_new(0.0);
  w->surface.mu = 0.0;
  for (int i = 0; i < 3; ++i) {
    cw_add_cube(w, 1.0, 0.05, 0.0501 * i, 0.0, 0.0);
  }
  cw_start(w, -0.0355, 0.0, 0.0);
  for (int m = 0; m < 6; ++m) {
    double worst = 0.0;
    cw_move_hand(w, 0.05 + 0.05 * m, 0.0, 0.0);
    for (int i = 0; i < 6; ++i) {
      double before[3];
      memcpy(before, dBodyGetPosition(w->bodies[0]), sizeof before);
      cw_run(w, 50);
      double way = points_distance(before, dBodyGetPosition(w->bodies[0]));
      worst = fmax(worst, way - 0.05 * fmax(cw_norm(dBodyGetLinearVel(w->bodies[0])), 0.1));
    }
    printf("# %s: %.3g mm too far in a step, momentum %.5f of %.5f, speed %.3f, force %.2f\n",
           m == 0 ? "contact" : hap_model_name(models[m - 1]), 1e3 * worst, w->seen.momentum[0],
           w->seen.impulse[0], dBodyGetLinearVel(w->bodies[0])[0], w->force[0]);
    CHECK(worst < 0.02);
    if (m < 5) {
      CHECK(hap_session_set_model(w->session, models[m]) == HAP_OK);
    }
  }
  cw_go(w, -0.5, 0.0, 0.0, 301);
  printf("# momentum %.5f, impulse %.5f, stats %.5f\n", w->seen.momentum[0], w->impulse[0],
         cw_stats(w).hand.momentum_ratio);
  CHECK_NEAR(w->seen.momentum[0] / w->impulse[0], 1.0, 5e-3);
  CHECK(cw_stats(w).faults.count == 0);
}

/* ---- the same again, at every rate ---- */

static hap_stats push_stack(double physics_hz, double contact_hz, double haptic_hz, int latency)
{
  contact_world *w = cw_new(G);
  w->def.physics_hz = physics_hz;
  w->expert.contact_hz = contact_hz;
  w->def.haptic_hz = haptic_hz;
  w->research.physics_latency_ticks = latency;
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.05, 0.0, 0.0, 0.0249);
  cw_add_cube(w, 1.0, 0.05, 0.0, 0.0, 0.0748);
  cw_add_cube(w, 1.0, 0.05, 0.0501, 0.0, 0.0249);
  cw_add_ball(w, 0.2, 0.02, 0.09, 0.0, 0.02);
  cw_start(w, -0.0355, 0.0, 0.02);
  cw_go(w, 0.08, 0.0, 0.0, (int)haptic_hz);
  hap_stats stats = cw_stats(w);
  CHECK(stats.faults.count == 0);
  CHECK(stats.loop.contact_ticks > 100);
  CHECK(w->position[0][0] > 0.02 && w->position[0][0] < 0.12);
  CHECK(w->position[0][2] > 0.0235 && w->position[0][2] < 0.03);
  CHECK(w->position[1][2] > 0.0225 && w->position[1][2] < 0.09);
  cw_close(w);
  return stats;
}

TEST(every_run_has_the_same_hash)
{
  static const double rates[][3] = {{20, 200, 1000}, {20, 20, 1000},   {20, 1000, 1000},
                                    {10, 200, 1000}, {120, 200, 1000}, {37, 200, 1000},
                                    {60, 77, 1000},  {50, 200, 2000},  {100, 100, 500}};
  for (size_t i = 0; i < sizeof rates / sizeof rates[0]; ++i) {
    hap_stats a = push_stack(rates[i][0], rates[i][1], rates[i][2], HAP_LATENCY_DEFAULT);
    hap_stats b = push_stack(rates[i][0], rates[i][1], rates[i][2], HAP_LATENCY_DEFAULT);
    printf("# %g %g %g: %016llx, residual %.2g, momentum %.4f\n", rates[i][0], rates[i][1],
           rates[i][2], (unsigned long long)a.loop.trace_hash, a.contact.residual_max,
           a.hand.momentum_ratio);
    CHECK(a.loop.trace_hash != 0 && a.loop.trace_hash == b.loop.trace_hash);
  }
}

TEST(a_model_of_any_age_will_do)
{
  static const int ages[] = {0, 1, 7, 25, 49, 50};
  for (size_t i = 0; i < sizeof ages / sizeof ages[0]; ++i) {
    hap_stats a = push_stack(20.0, 200.0, 1000.0, ages[i]);
    hap_stats b = push_stack(20.0, 200.0, 1000.0, ages[i]);
    CHECK(a.loop.trace_hash != 0 && a.loop.trace_hash == b.loop.trace_hash);
    CHECK_NEAR(a.hand.momentum_ratio, 1.0, 5e-3);
  }
}

/* ---- real threads ---- */

static void run_threads(double contact_hz, double seconds)
{
  rig_options options;
  rig_options_init(&options);
  options.scene = "row10";
  options.def.model = HAP_MODEL_CONTACT;
  options.def.rt_priority = 0;
  options.def.physics_hz = 20.0;
  options.expert.contact_hz = contact_hz;
  rig *r = rig_own(&options);
  CHECK(hap_session_start(r->session) >= HAP_OK);
  hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * seconds));
  CHECK(hap_session_stop(r->session) == HAP_OK);
  hap_stats stats;
  CHECK(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
  printf(
      "# %g Hz: %llu ticks, %llu passes, %llu contact ticks, residual %.2g, momentum %.4f, peak "
      "%.2f N, model age max %.4f\n",
      contact_hz, (unsigned long long)stats.loop.ticks, (unsigned long long)stats.contact.passes,
      (unsigned long long)stats.loop.contact_ticks, stats.contact.residual_max,
      stats.hand.momentum_ratio, stats.hand.peak_force_n, stats.loop.model_age_max_s);
  CHECK(stats.faults.count == 0 && stats.faults.states_rejected == 0);
  CHECK(stats.loop.ticks > 100 && stats.loop.contact_ticks > 10);
  CHECK((double)stats.contact.passes > 0.25 * contact_hz * seconds);
  CHECK((double)stats.contact.passes < 1.5 * contact_hz * seconds + 25.0 * seconds);
  CHECK(stats.contact.residual_max < 1e-2);
  CHECK(stats.hand.peak_force_n < 100.0);
  CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 0.02);
}

TEST(two_seconds_of_threads_and_a_late_contact_thread)
{
  run_threads(200.0, 2.0);
  run_threads(20.0, 1.5);
}
