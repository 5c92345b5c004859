/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A sphere on ground of triangles, which the loop asks at every tick. */

#include "tests/tap.h"

#include "base/vec.h"
#include "proximity/ball_among.h"
#include "proximity/triangle.h"
#include "tests/contact_world.h"
#include "tests/solids.h"

#define RADIUS 0.01

/* ---- the ball that cannot enter ---- */

/* A valley along y, each side going up by the slope. */
static void make_valley(double slope, hapi_triangle out[4])
{
  for (int side = 0; side < 2; ++side) {
    double x = side == 0 ? -1.0 : 1.0;
    const double low[2][3] = {{0.0, -1.0, 0.0}, {0.0, 1.0, 0.0}};
    const double high[2][3] = {{x, -1.0, slope}, {x, 1.0, slope}};
    double corners[9];
    hapi_v3_copy(low[0], corners);
    hapi_v3_copy(low[1], corners + 3);
    hapi_v3_copy(high[0], corners + 6);
    hapi_triangle_set(corners, &out[2 * side]);
    hapi_v3_copy(high[1], corners);
    hapi_triangle_set(corners, &out[2 * side + 1]);
  }
}

/* Both sides push: what is nearest to the ball touches both, whatever the angle. */
TEST(a_ball_in_a_valley_lies_on_both_sides)
{
  const double slopes[] = {2.0, 1.0, 0.3, 0.01};
  for (int i = 0; i < 4; ++i) {
    hapi_triangle valley[4];
    hapi_nearest at = {.distance = 0.0};
    double cosine = 1.0 / sqrt(1.0 + slopes[i] * slopes[i]);
    const double rest = RADIUS / cosine; /* of the centre that touches both */
    const double ball[3] = {0.0, 0.1, rest - 0.003};
    hapi_constrained_ball c = {.known = true, .center = {0.001, 0.1, 2.0 * rest}};
    make_valley(slopes[i], valley);
    REQUIRE(hapi_ball_among(valley, 4, ball, RADIUS, &c, &at));
    CHECK_NEAR(at.distance, -0.003, 1e-9);
    CHECK_NEAR(at.normal[0], 0.0, 1e-6);
    CHECK_NEAR(at.normal[2], 1.0, 1e-9);
    /* On one side of it alone: along that side's normal. */
    const double beside[3] = {0.5, 0.1, 0.5 * slopes[i] + (RADIUS - 0.003) / cosine};
    c.center[0] = 0.5;
    c.center[2] = beside[2] + 0.02;
    for (int k = 0; k < 8; ++k) {
      REQUIRE(hapi_ball_among(valley, 4, beside, RADIUS, &c, &at));
    }
    CHECK_NEAR(at.distance, -0.003, 1e-9);
    CHECK_NEAR(at.normal[2], cosine, 1e-6);
    CHECK_NEAR(at.normal[0], -slopes[i] * cosine, 1e-6);
  }
}

/* The force goes over the lowest line of a valley without a jump. */
TEST(a_valley_makes_no_jump)
{
  hapi_triangle valley[4];
  hapi_nearest at = {.distance = 0.0};
  hapi_constrained_ball c = {.known = true, .center = {-0.01, 0.1, 0.03}};
  double before[3] = {0.0, 0.0, 0.0};
  double largest = 0.0;
  make_valley(0.5, valley);
  for (int i = 0; i < 400; ++i) {
    const double ball[3] = {-0.01 + 5e-5 * i, 0.1, 0.011};
    double way[3];
    REQUIRE(hapi_ball_among(valley, 4, ball, RADIUS, &c, &at));
    hapi_v3_sub(c.center, ball, way);
    if (i > 0) {
      double change[3];
      hapi_v3_sub(way, before, change);
      largest = fmax(largest, hapi_v3_norm(change));
    }
    hapi_v3_copy(way, before);
  }
  printf("# largest change %.3g m by a way of 5e-05 m\n", largest);
  CHECK(largest < 1e-4);
}

#define HILLS 24
#define HILL_CELL 0.004

static double hill_height(int i, int k)
{
  return 0.004 * sin(1.9 * i + 0.7 * k) * cos(1.3 * k);
}

static uint32_t make_hills(hapi_triangle *out)
{
  static const int cell[2][3][2] = {{{0, 0}, {0, 1}, {1, 0}}, {{1, 1}, {1, 0}, {0, 1}}};
  uint32_t count = 0;
  for (int k = 0; k < HILLS; ++k) {
    for (int i = 0; i < HILLS; ++i) {
      for (int t = 0; t < 2; ++t) {
        double corners[9];
        for (int c = 0; c < 3; ++c) {
          int x = i + cell[t][c][0];
          int y = k + cell[t][c][1];
          hapi_v3_set(corners + 3 * c, HILL_CELL * (x - HILLS / 2), HILL_CELL * (y - HILLS / 2),
                      hill_height(x, y));
        }
        hapi_triangle_set(corners, &out[count++]);
      }
    }
  }
  return count;
}

static double hills_apart(const hapi_triangle *hills, uint32_t count, const double place[3])
{
  hapi_nearest at;
  CHECK(hapi_triangles_ball(hills, count, place, 0.0, &at));
  return at.distance;
}

/* However deep the hand goes, and wherever: the ball enters nothing, and is on its side. */
TEST(a_ball_that_is_pressed_through_hills_stays_above_them)
{
  static hapi_triangle hills[2 * HILLS * HILLS];
  uint32_t count = make_hills(hills);
  for (int run = 0; run < 6; ++run) {
    double radius = run % 2 == 0 ? 0.006 : 0.002;
    hapi_constrained_ball c = {.known = true, .center = {0.0, 0.0, 0.03}};
    hapi_nearest at = {.distance = 0.0};
    double least = HUGE_VAL;
    double lowest = HUGE_VAL;
    double largest = 0.0;
    for (int i = 0; i < 4000; ++i) {
      double before[3];
      double t = 1e-3 * i;
      const double ball[3] = {0.025 * sin((2.1 + run) * t),
                              0.025 * sin((3.4 - 0.3 * run) * t + 1.0),
                              0.012 - 0.01 * t + 0.006 * sin(9.0 * t)};
      hapi_v3_copy(c.center, before);
      CHECK(hapi_ball_among(hills, count, ball, radius, &c, &at));
      least = fmin(least, hills_apart(hills, count, c.center) - radius);
      lowest = fmin(lowest, c.center[2]);
      hapi_v3_sub(c.center, before, before);
      largest = fmax(largest, i > 0 ? hapi_v3_norm(before) : 0.0);
    }
    printf("# radius %.0f mm: enters by %.2g m at most, goes %.2g mm in a tick at most\n",
           1e3 * radius, -least, 1e3 * largest);
    CHECK(least > -1e-6);
    CHECK(lowest > -0.004);
  }
}

/* ---- in a session ---- */

static double ground_height(int i, int k)
{
  return 0.004 * fabs(sin(0.9 * i + 0.3 * k)) + 0.002 * cos(1.7 * k);
}

typedef enum ground_kind {
  GROUND_FIELD,
  GROUND_MESH,
  GROUND_CARRIED /* by a body that is driven */
} ground_kind;

#define TICKS 1200

/* The force of a hand that goes over the ground, tick by tick. */
static void ground_feel(ground_kind kind, double physics_hz, double friction, double out[TICKS][3])
{
  static grid ground;
  contact_world w;
  cw_open(&w, 0.0);
  w.def.physics_hz = physics_hz;
  w.hand_def.radius = RADIUS;
  w.hand_def.stiffness = 1000.0;
  w.hand_def.damping = 0.0;
  w.hand_def.friction = friction;
  w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  cw_add_cube(&w, 1.0, 0.1, 5.0, 0.0, 0.0);
  grid_fill(&ground, 20, 0.01, ground_height);
  if (kind == GROUND_FIELD) {
    grid_field(w.space, &ground);
  } else {
    dGeomID geom = grid_mesh(w.space, &ground);
    if (kind == GROUND_CARRIED) {
      dBodyID body = dBodyCreate(w.world);
      dBodySetKinematic(body);
      dGeomSetBody(geom, body);
      w.bodies[w.body_count++] = body;
    }
  }
  cw_start(&w, -0.06, 0.013, 0.02);
  cw_move_hand(&w, 0.0, 0.0, -0.05);
  for (int i = 0; i < TICKS; ++i) {
    if (i == 200) {
      cw_move_hand(&w, 0.12, 0.004, 0.0);
    }
    cw_tick(&w);
    memcpy(out[i], w.force, sizeof out[i]);
  }
  cw_close(&w);
}

/* The rate of the world does not show, and the ground's kind neither. */
TEST(ground_feels_the_same_at_every_rate)
{
  static double fine[TICKS][3];
  static double coarse[TICKS][3];
  const double rates[] = {20.0, 60.0};
  for (int friction = 0; friction < 2; ++friction) {
    ground_feel(GROUND_FIELD, 500.0, 0.4 * friction, fine);
    for (int kind = 0; kind < 3; ++kind) {
      for (int r = 0; r < 2; ++r) {
        double largest = 0.0;
        double jump = 0.0;
        double most = 0.0;
        ground_feel((ground_kind)kind, rates[r], 0.4 * friction, coarse);
        for (int i = 1; i < TICKS; ++i) {
          double change[3];
          hapi_v3_sub(coarse[i], coarse[i - 1], change);
          jump = fmax(jump, hapi_v3_norm(change));
          hapi_v3_sub(coarse[i], fine[i], change);
          largest = fmax(largest, hapi_v3_norm(change));
          most = fmax(most, hapi_v3_norm(fine[i]));
        }
        printf("# kind %d, %.0f Hz, friction %.1f: %.2g of %.2f N apart, %.2f N in a tick\n", kind,
               rates[r], 0.4 * friction, largest, most, jump);
        CHECK(most > 3.0);
        CHECK(largest < 1e-4);
        CHECK(jump < 0.4);
      }
    }
  }
}
