/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A sphere on a heightfield: on a plain, on a slope, over a ridge and beside the field's end, in
 * every model. The forces have closed forms. */

#include "tests/tap.h"

#include "base/hash.h"
#include "sync/mesh_filter.h"
#include "tests/contact_world.h"
#include "tests/solids.h"

#define RADIUS 0.01
#define K 1000.0
#define CELLS 20
#define CELL 0.05 /* m */

static double slope_height(int i, int k)
{
  (void)k;
  return 0.5 * CELL * (i - CELLS / 2);
}

static double ridge_height(int i, int k)
{
  return -fabs(slope_height(i, k));
}

/* Down to a place, and what is felt there. */
static void hand_press(grid_height height, hap_model model, double x, double z, double out[3])
{
  static grid ground;
  contact_world w;
  cw_open(&w, 0.0);
  w.def.model = model;
  w.def.physics_hz = 60.0;
  w.hand_def.radius = RADIUS;
  w.hand_def.stiffness = K;
  w.hand_def.damping = 0.0;
  w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  cw_add_cube(&w, 1.0, 0.1, 5.0, 0.0, 0.0);
  grid_fill(&ground, CELLS, CELL, height);
  grid_field(w.space, &ground);
  cw_start(&w, x, 0.013, z + 0.05);
  cw_move_hand(&w, 0.0, 0.0, -0.05);
  cw_run(&w, 1000);
  cw_move_hand(&w, 0.0, 0.0, 0.0);
  cw_run(&w, 100);
  memcpy(out, w.force, sizeof w.force);
  cw_close(&w);
}

TEST(a_sphere_feels_a_plain)
{
  for (int i = 0; i < 4; ++i) {
    double force[3] = {0.0};
    hand_press(grid_level, all_models[i], 0.021, RADIUS - 0.005, force);
    CHECK_NEAR(force[0], 0.0, 1e-6);
    CHECK_NEAR(force[2], 5.0, 1e-6);
  }
}

/* Its centre goes below the surface. */
TEST(a_sphere_feels_a_plain_as_deep_as_it_is)
{
  double force[3] = {0.0};
  hand_press(grid_level, HAP_MODEL_CONTACT, 0.021, RADIUS - 0.03, force);
  CHECK_NEAR(force[2], 30.0, 1e-6);
}

TEST(a_sphere_feels_a_slope_along_its_normal)
{
  const double n[3] = {-0.5 / sqrt(1.25), 0.0, 1.0 / sqrt(1.25)};
  for (int i = 0; i < 4; ++i) {
    double force[3] = {0.0};
    double z = 0.5 * 0.021 + (RADIUS - 0.004) * sqrt(1.25); /* 4 mm deep */
    hand_press(slope_height, all_models[i], 0.021, z, force);
    CHECK_NEAR(force[0], 4.0 * n[0], 1e-6);
    CHECK_NEAR(force[1], 0.0, 1e-6);
    CHECK_NEAR(force[2], 4.0 * n[2], 1e-6);
  }
}

/* The edge is nearest. */
TEST(a_sphere_feels_a_ridge)
{
  for (int i = 0; i < 4; ++i) {
    double force[3] = {0.0};
    hand_press(ridge_height, all_models[i], 0.0, RADIUS - 0.003, force);
    CHECK_NEAR(force[0], 0.0, 1e-6);
    CHECK_NEAR(force[2], 3.0, 1e-6);
  }
}

TEST(beside_its_end_a_field_is_not_felt)
{
  double force[3] = {0.0};
  hand_press(grid_level, HAP_MODEL_CONTACT, 0.5 * CELLS * CELL + 2.0 * RADIUS, RADIUS - 0.005,
             force);
  CHECK(force[0] == 0.0 && force[1] == 0.0 && force[2] == 0.0);
}

/* ---- bodies on a field: the loop moves them, on the field's triangles ---- */

static double rough_height(int i, int k)
{
  return 0.0008 * sin(1.7 * i + 0.4 * k) + 0.0005 * cos(2.3 * k - 0.9 * i);
}

typedef struct slide {
  double at[3];
  double largest;
  double bound; /* N, of the largest */
  uint32_t owned;
  uint32_t measured;
} slide;

#define MASS 0.5  /* kg */
#define SPEED 0.1 /* m/s */
#define STEEP 0.1 /* more than any slope of the ground */

/* A crate that is pushed over rough ground. */
static slide crate_slide(bool field, double physics_hz)
{
  static grid ground;
  slide s = {.largest = 0.0};
  contact_world *w = cw_new(CW_GRAVITY);
  w->def.physics_hz = physics_hz;
  w->def.max_contacts = 2048;
  w->expert.max_hull_points = 20000;
  cw_add_box(w, MASS, (const double[3]){0.06, 0.05, 0.04}, -0.03, 0.004, 0.0212);
  grid_fill(&ground, 12, 0.02, rough_height);
  if (field) {
    grid_field(w->space, &ground);
  } else {
    grid_mesh(w->space, &ground);
  }
  cw_start(w, -0.075, 0.004, 0.03);
  cw_run(w, 200);
  cw_move_hand(w, SPEED, 0.0, 0.0);
  for (int i = 0; i < 600; ++i) {
    cw_tick(w);
    s.largest = fmax(s.largest, -w->force[0]);
  }
  hap_stats stats = cw_stats(w);
  s.owned = stats.model.range_bodies;
  s.measured = stats.model.measured_bodies;
  /* Friction on the steepest slope, and what takes a mass to that speed by a spring. */
  double mu = w->surface.mu;
  s.bound =
      9.81 * MASS * (mu + STEEP) / (1.0 - mu * STEEP) + SPEED * sqrt(w->hand_def.stiffness * MASS);
  memcpy(s.at, w->position[0], sizeof s.at);
  cw_close(w);
  return s;
}

/* At the start the crate's front stands over tops of the ground, which it must not run against. */
TEST(a_crate_on_a_field_is_that_on_the_same_triangles)
{
  for (int i = 0; i < 2; ++i) {
    double hz = i == 0 ? 20.0 : 60.0;
    slide field = crate_slide(true, hz);
    slide mesh = crate_slide(false, hz);
    printf("# %.0f Hz: field %.6f %.6f %.6f, %.3f N; mesh %.6f %.6f %.6f, %.3f N\n", hz,
           field.at[0], field.at[1], field.at[2], field.largest, mesh.at[0], mesh.at[1], mesh.at[2],
           mesh.largest);
    CHECK(field.owned == 1 && field.measured == 0);
    CHECK(mesh.owned == 1);
    CHECK(field.at[0] > 0.02);
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(field.at[k], mesh.at[k], 5e-5);
    }
    CHECK_NEAR(field.largest, mesh.largest, 0.01 * mesh.largest);
    CHECK(mesh.largest <= mesh.bound);
  }
}

/* ---- steep ground: no contact may be missing that holds a body ---- */

#define ROUGH_CELLS 12
#define ROUGH_CELL 0.02
#define CRATE_HALF    \
  {                   \
    0.03, 0.025, 0.02 \
  }

static uint64_t ground_seed;

/* Up to 8 mm up or down: slopes of up to 45 degrees and more. */
static double steep_height(int i, int k)
{
  uint64_t bits = hapi_hash_word(hapi_hash_word(ground_seed, (uint64_t)i), (uint64_t)k);
  return 0.008 * (2.0 * (double)(bits >> 11) / 9007199254740992.0 - 1.0);
}

/* m, of the ground's triangles: see grid_mesh. */
static double ground_height(const grid *g, double x, double y)
{
  double u = x / g->cell + 0.5 * g->cells;
  double v = 0.5 * g->cells - y / g->cell;
  int i = (int)fmin(fmax(u, 0.0), g->cells - 1.0);
  int k = (int)fmin(fmax(v, 0.0), g->cells - 1.0);
  const double *a = &g->heights[k * (g->cells + 1) + i];
  const double *b = a + g->cells + 1;
  u -= i;
  v -= k;
  return u + v <= 1.0 ? a[0] + u * (a[1] - a[0]) + v * (b[0] - a[0])
                      : b[1] + (1.0 - u) * (b[0] - b[1]) + (1.0 - v) * (a[1] - b[1]);
}

/* m, how deep the crate's corners are in the ground, and the ground's corners in the crate. */
static double crate_sinks(const grid *g, dBodyID crate)
{
  static const double half[3] = CRATE_HALF;
  double deepest = 0.0;
  for (int n = 0; n < 8; ++n) {
    dVector3 at;
    dBodyGetRelPointPos(crate, (n & 1) != 0 ? half[0] : -half[0], (n & 2) != 0 ? half[1] : -half[1],
                        (n & 4) != 0 ? half[2] : -half[2], at);
    deepest = fmax(deepest, ground_height(g, at[0], at[1]) - at[2]);
  }
  for (int n = 0; n < (g->cells + 1) * (g->cells + 1); ++n) {
    dVector3 in;
    double x = g->cell * (n % (g->cells + 1) - 0.5 * g->cells);
    double y = g->cell * (0.5 * g->cells - n / (g->cells + 1));
    dBodyGetPosRelPoint(crate, x, y, g->heights[n], in);
    double depth = fmin(fmin(half[0] - fabs(in[0]), half[1] - fabs(in[1])), half[2] - fabs(in[2]));
    deepest = fmax(deepest, depth);
  }
  return deepest;
}

TEST(a_crate_does_not_sink_into_steep_ground)
{
  static grid ground;
  double deepest = 0.0;
  for (ground_seed = 1; ground_seed <= 24; ++ground_seed) {
    contact_world *w = cw_new(CW_GRAVITY);
    w->def.physics_hz = 60.0;
    w->def.max_contacts = 2048;
    w->expert.max_hull_points = 20000;
    dBodyID crate = cw_add_box(w, MASS, (const double[3]){0.06, 0.05, 0.04}, -0.03, 0.004, 0.035);
    grid_fill(&ground, ROUGH_CELLS, ROUGH_CELL, steep_height);
    if (ground_seed % 2 == 0) {
      grid_field(w->space, &ground);
    } else {
      grid_mesh(w->space, &ground);
    }
    cw_start(w, -0.075, 0.004, 0.04);
    cw_run(w, 300);
    cw_move_hand(w, SPEED, 0.0, 0.0);
    double own = 0.0;
    for (int i = 0; i < 500; ++i) {
      cw_tick(w);
      own = fmax(own, i > 50 ? crate_sinks(&ground, crate) : 0.0);
    }
    CHECK_SAY(own < 1e-3, "ground %d: %g m", (int)ground_seed, own);
    CHECK(cw_stats(w).model.range_bodies == 1);
    deepest = fmax(deepest, own);
    cw_close(w);
  }
  printf("# %g m deep at most\n", deepest);
}

/* ---- the border of a sheet ---- */

static double sheet_height(int i, int k)
{
  (void)i;
  (void)k;
  return 0.021;
}

/* m: how far a crate that a hand pushes gets over the border of an open mesh without thickness, as
 * high as the middle of its side. */
static double crate_gets_beyond(double yaw)
{
  static grid sheet;
  const double size[3] = {0.06, 0.05, 0.04};
  const double border = -0.5 * ROUGH_CELLS * ROUGH_CELL;
  dMatrix3 turned;
  double farthest = -HUGE_VAL;
  contact_world *w = cw_new(CW_GRAVITY);
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
  dBodyID crate = cw_add_box(w, MASS, size, border - 0.045, 0.004, 0.02);
  dRFromAxisAndAngle(turned, 0.0, 0.0, 1.0, yaw);
  dBodySetRotation(crate, turned);
  grid_fill(&sheet, ROUGH_CELLS, ROUGH_CELL, sheet_height);
  grid_mesh(w->space, &sheet);
  cw_start(w, border - 0.1, 0.004, 0.02);
  cw_run(w, 100);
  cw_move_hand(w, SPEED, 0.0, 0.0);
  for (int i = 0; i < 500; ++i) {
    cw_tick(w);
    for (int n = 0; n < 8; ++n) {
      dVector3 at;
      dBodyGetRelPointPos(crate, (n & 1) != 0 ? 0.03 : -0.03, (n & 2) != 0 ? 0.025 : -0.025,
                          (n & 4) != 0 ? 0.02 : -0.02, at);
      farthest = fmax(farthest, at[0] - border);
    }
  }
  cw_close(w);
  return farthest;
}

TEST(a_crate_does_not_go_through_the_border_of_a_sheet)
{
  for (int i = 0; i <= 6; ++i) {
    double beyond = crate_gets_beyond(0.25 * i);
    printf("# yaw %.2f: %g m beyond the border\n", 0.25 * i, beyond);
    CHECK(beyond > -1e-3 && beyond < 1e-3);
  }
}

/* Over which of a triangle's edges a normal in its plane may lean: an open one, also a little past
 * its end; no closed one, and not between two such at a sharp tip. */
TEST(a_normal_leans_over_open_edges)
{
  static const double even[9] = {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0};
  static const double sharp[9] = {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.05, 0.0}; /* tip at 0 */
  static const struct {
    const double *corners;
    uint32_t open; /* edges */
    double angle;  /* of the normal in the plane, from x, rad */
    bool allowed;
  } rows[] = {
      {even, 1u, -0.5 * M_PI, true},         {even, 1u, -0.5 * M_PI - 0.08, true},
      {even, 1u, -0.5 * M_PI - 0.1, false},  {even, 1u, -0.5 * M_PI + 0.3, true},
      {even, 1u, -0.25 * M_PI + 0.2, false}, {even, 3u, -0.25 * M_PI + 0.2, true},
      {even, 2u, -0.5 * M_PI, false},        {even, 0u, 0.25 * M_PI, false},
      {sharp, 5u, M_PI - 0.025, true},       {sharp, 2u, M_PI - 0.025, false},
      {sharp, 7u, M_PI - 0.025, true},       {sharp, 0u, M_PI - 0.025, false},
  };
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    const double normal[3] = {cos(rows[i].angle), sin(rows[i].angle), 0.0};
    uint32_t edges = hapi_mesh_lean(0.0) | 8u | rows[i].open;
    CHECK_SAY(hapi_mesh_allows(edges, rows[i].corners, normal) == rows[i].allowed, "row %d",
              (int)i);
  }
}

static double tile_heights[16];

static void tile_read(double first)
{
  for (int i = 0; i < 16; ++i) {
    tile_heights[i] = i == 0 ? first : 0.01 * (i % 3);
  }
}

/* A ball that lies in a field which ODE repeats for ever, or which has no pose of its own: its y is
 * up then. */
static void ball_rests(bool placeable, bool wraps, const double at[3])
{
  contact_world *w = cw_new(0.0);
  dHeightfieldDataID data = dGeomHeightfieldDataCreate();
  tile_read(0.0);
  dGeomHeightfieldDataBuildDouble(data, tile_heights, 0, 0.3, 0.3, 4, 4, 1.0, 0.0, 1.0, wraps);
  dCreateHeightfield(w->space, data, placeable);
  dWorldSetGravity(w->world, 0.0, -CW_GRAVITY, 0.0);
  cw_add_ball(w, 0.5, 0.03, at[0], at[1], at[2]);
  cw_start(w, at[0], at[1] + 0.05, at[2]);
  double least = HUGE_VAL;
  cw_run(w, 20);
  hap_stats stats = cw_stats(w); /* it may roll away from the hand */
  for (int i = 0; i < 600; ++i) {
    cw_tick(w);
    least = fmin(least, w->position[0][1]);
  }
  printf("# placeable %d wraps %d: lowest %.4f\n", placeable, wraps, least);
  CHECK(stats.model.range_bodies == 1 && stats.model.measured_bodies == 0);
  CHECK(least > 0.02 && least < 0.06);
}

TEST(a_field_may_have_no_pose_and_no_end)
{
  const double inside[3] = {0.02, 0.045, 0.03};
  const double outside[3] = {0.73, 0.045, -0.51};
  ball_rests(false, false, inside);
  ball_rests(true, false, inside);
  ball_rests(false, true, outside);
  ball_rests(true, true, outside);
}

static double lift_height;

static dReal lift_at(void *user, int x, int z)
{
  (void)user;
  return x == 3 && z == 3 ? lift_height : 0.0;
}

/* The ground grows under a ball. */
TEST(a_field_may_change)
{
  contact_world *w = cw_new(CW_GRAVITY);
  dHeightfieldDataID data = dGeomHeightfieldDataCreate();
  dMatrix3 upright;
  lift_height = 0.0;
  dGeomHeightfieldDataBuildCallback(data, NULL, lift_at, 0.6, 0.6, 7, 7, 1.0, 0.0, 0.5, 0);
  dGeomID geom = dCreateHeightfield(w->space, data, 1); /* no bounds are said */
  dRFromAxisAndAngle(upright, 1.0, 0.0, 0.0, 0.5 * M_PI);
  dGeomSetRotation(geom, upright);
  cw_add_ball(w, 0.5, 0.03, 0.0, 0.0, 0.0299);
  cw_start(w, 0.0, 0.0, 0.09);
  for (int i = 0; i < 500; ++i) {
    lift_height = 2e-5 * i;
    cw_tick(w);
  }
  cw_run(w, 100);
  hap_stats stats = cw_stats(w);
  printf("# lifted to %.5f\n", w->position[0][2]);
  CHECK(stats.model.range_bodies == 1);
  CHECK_NEAR(w->position[0][2], 0.03 + lift_height, 3e-3);
}
