/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Which points of a flat area are spare: those on its edges and within it, and no other. */

#include "tests/tap.h"

#include <math.h>

#include "contact/flat_areas.h"

static const double up[3] = {0.0, 0.0, 1.0};

static void areas_end(void *owned)
{
  (void)owned; /* it has nothing of its own */
}

static hapi_flat_areas *areas_new(void)
{
  return tap_own(sizeof(hapi_flat_areas), areas_end);
}

static uint32_t point_add(hapi_flat_areas *areas, double x, double y, double gap)
{
  return hapi_flat_add(areas, (const double[3]){x, y, gap}, up, gap);
}

/* A grid of n x n points of one area, with the gap of a function. */
static hapi_flat_areas *grid_areas(int n, double (*gap)(double x, double y))
{
  hapi_flat_areas *areas = areas_new();
  for (int i = 0; i < n * n; ++i) {
    double x = 0.01 * (i % n);
    int row = i / n;
    double y = 0.02 * row;
    uint32_t at = point_add(areas, x, y, gap(x, y));
    hapi_flat_join(areas, at > 0 ? at - 1 : at, at);
  }
  return areas;
}

static double gap_level(double x, double y)
{
  (void)x, (void)y;
  return -1e-4;
}

static double gap_tilted(double x, double y)
{
  return -1e-4 + 0.03 * x - 0.02 * y;
}

static double gap_bowed(double x, double y)
{
  return 5.0 * (x - 0.02) * (x - 0.02) + 0.0 * y;
}

TEST(the_corners_of_an_area_are_left)
{
  static double (*const gaps[])(double, double) = {gap_level, gap_tilted};
  for (int g = 0; g < 2; ++g) {
    for (int n = 2; n < 20; ++n) {
      hapi_flat_areas *areas = grid_areas(n, gaps[g]);
      CHECK(hapi_flat_reduce(areas) == 4);
      CHECK(!areas->points[0].spare && !areas->points[n - 1].spare);
      CHECK(!areas->points[n * n - n].spare && !areas->points[n * n - 1].spare);
    }
  }
}

/* The middle of a bow comes nearest. */
TEST(where_a_surface_bends_all_points_count)
{
  CHECK(hapi_flat_reduce(grid_areas(5, gap_bowed)) == 25);
}

TEST(areas_that_share_no_point_keep_their_corners)
{
  hapi_flat_areas *areas = areas_new();
  for (int i = 0; i < 3; ++i) { /* three in a row */
    uint32_t first = point_add(areas, 0.1 * i, 0.0, 0.0);
    hapi_flat_join(areas, first, point_add(areas, 0.1 * i + 0.05, 0.0, 0.0));
    hapi_flat_join(areas, first, point_add(areas, 0.1 * i, 0.05, 0.0));
    hapi_flat_join(areas, first, point_add(areas, 0.1 * i + 0.05, 0.05, 0.0));
    hapi_flat_join(areas, first, point_add(areas, 0.1 * i + 0.02, 0.05, 0.0)); /* of a seam */
  }
  CHECK(hapi_flat_reduce(areas) == 12);
}

TEST(other_normals_are_other_areas)
{
  hapi_flat_areas *areas = grid_areas(2, gap_level);
  uint32_t turned = hapi_flat_add(areas, (const double[3]){0.005, 0.01, -1e-4},
                                  (const double[3]){sin(1e-3), 0.0, cos(1e-3)}, -1e-4);
  hapi_flat_join(areas, 0, turned);
  CHECK(hapi_flat_reduce(areas) == 5 && !areas->points[turned].spare);
}

/* Rounding puts points beside the line and beside each other. */
TEST(points_in_a_line_and_round_shapes_are_left_as_they_are)
{
  hapi_flat_areas *line = areas_new();
  hapi_flat_areas *ring = areas_new();
  for (int i = 0; i < 9; ++i) {
    hapi_flat_join(line, 0, point_add(line, 0.01 * i, 1e-12 * (i % 2), 0.0));
  }
  CHECK(hapi_flat_reduce(line) == 9);
  for (int i = 0; i < 60; ++i) {
    double angle = 2.0 * M_PI * i / 60;
    hapi_flat_join(ring, 0, point_add(ring, 0.05 * cos(angle), 0.05 * sin(angle), 0.0));
  }
  CHECK(hapi_flat_reduce(ring) == 60);
}

TEST(the_most_points_are_one_area)
{
  hapi_flat_areas *areas = grid_areas(22, gap_tilted); /* 484 */
  CHECK(areas->count <= HAPI_FLAT_POINTS && hapi_flat_reduce(areas) == 4);
  CHECK(hapi_flat_find(areas, areas->points[37].place, up) == 37);
}
