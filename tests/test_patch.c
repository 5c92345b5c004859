/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/patch.h"

#include "tests/convex_things.h"
#include "tests/tap.h"

/* A patch is right when its points are on the surfaces, one over the other along the normal, none
 * deeper than the shapes are along that normal (their extents are computed here), and the deepest
 * one as deep as the shapes are. The distance of the shapes is the one of hapi_nearest_points,
 * which has its own test. */

enum {
  POLYGON_MAX = 32
};

/* --- random things -------------------------------------------------------------------------- */

static double random_size(uint64_t *state)
{
  return pow(10.0, random_in(state, -2.0, 0.0));
}

static void hull_make(thing *t, uint64_t *state)
{
  static const double corner[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  for (int k = 0; k < 4; ++k) {
    for (int i = 0; i < 3; ++i) {
      t->points[3 * k + i] = t->shape.half[i] * (corner[k][i] + random_in(state, -0.2, 0.2));
    }
  }
  for (int k = 4; k < HULL_POINTS; ++k) {
    for (int i = 0; i < 3; ++i) {
      t->points[3 * k + i] = 0.24 * (t->points[i] + t->points[3 + i] + t->points[6 + i]) +
                             0.28 * t->points[9 + i] + 0.02 * t->points[3 * (k - 4) + i];
    }
  }
  t->shape.hull = t->points;
  t->shape.hull_count = HULL_POINTS;
}

static void thing_make(thing *t, hapi_shape_kind kind, uint64_t *state)
{
  memset(t, 0, sizeof *t);
  t->shape.kind = kind;
  t->shape.radius = random_size(state);
  for (int i = 0; i < 3; ++i) {
    t->shape.half[i] = random_size(state);
  }
  if (kind == HAPI_SHAPE_HULL) {
    hull_make(t, state);
  }
  random_quat(state, t->pose.quat_wxyz);
}

static double thing_size(const thing *t)
{
  const hapi_shape *s = &t->shape;
  return s->kind == HAPI_SHAPE_PLANE
             ? 0.0
             : fmax(s->radius, fmax(s->half[0], fmax(s->half[1], s->half[2])));
}

/* --- points of a patch ---------------------------------------------------------------------- */

static bool patch_find(const thing *a, const thing *b, double margin, hapi_patch *out)
{
  return hapi_patch_find(&a->shape, &a->pose, &b->shape, &b->pose, margin, out);
}

/* The formula of patch.h. */
static void thing_surface(const thing *t, const double core[3], double ball, double rim,
                          const double dir[3], double out[3])
{
  double across[3];
  hapi_quat_unrotate(t->pose.quat_wxyz, dir, across);
  across[2] = 0.0;
  double length = hapi_v3_norm(across);
  hapi_v3_scale(length > 0.0 ? rim / length : 0.0, across, across);
  hapi_quat_rotate(t->pose.quat_wxyz, across, out);
  hapi_v3_madd(out, ball, dir, out);
  hapi_v3_add(core, out, out);
}

static void things_surfaces(const thing *a, const thing *b, const hapi_patch_point *p,
                            double out_a[3], double out_b[3])
{
  double back[3];
  hapi_v3_scale(-1.0, p->normal, back);
  thing_surface(a, p->core_a, p->ball_a, p->rim_a, back, out_a);
  thing_surface(b, p->core_b, p->ball_b, p->rim_b, p->normal, out_b);
}

/* All relative to the larger thing. */
typedef struct errors {
  double gap;      /* from the fields of the point */
  double sideways; /* surface points not over each other */
  double surface;  /* surface points off the surfaces */
  double deeper;   /* than the shapes are along the normal */
  double missed;   /* the deepest point is higher than the distance of the shapes */
  double excess;   /* the deepest point is lower than that */
  int none;        /* no points though within the margin */
} errors;

/* The ball of a tilted capsule's upper end is a bit inside, and so are points of a hull that are
 * given and not needed. */
static double point_off(const thing *t, double ball, const double point[3])
{
  double h = height(t, point);
  return ball > 0.0 || t->shape.kind == HAPI_SHAPE_HULL ? h : fabs(h);
}

static void point_errors(const thing *a, const thing *b, const hapi_patch_point *p, errors *worst)
{
  double size = fmax(thing_size(a), thing_size(b));
  double on_a[3];
  double on_b[3];
  double gap[3];
  double edges[3];
  things_surfaces(a, b, p, on_a, on_b);
  hapi_v3_sub(on_a, on_b, gap);
  double length = hapi_v3_dot(gap, p->normal);
  hapi_v3_madd(gap, -length, p->normal, gap);
  worst->gap = fmax(worst->gap, fabs(length - p->gap) / size);
  worst->gap = fmax(worst->gap, fabs(hapi_v3_norm(p->normal) - 1.0));
  worst->sideways = fmax(worst->sideways, hapi_v3_norm(gap) / size);
  worst->surface = fmax(worst->surface,
                        fmax(point_off(a, p->ball_a, on_a), point_off(b, p->ball_b, on_b)) / size);
  bool ball = p->touch == HAPI_TOUCH_BALL_A || p->touch == HAPI_TOUCH_BALL_B;
  if (!ball) {
    worst->deeper = fmax(worst->deeper, (separation(a, b, p->normal) - p->gap) / size);
  }
  if (p->touch == HAPI_TOUCH_EDGES) {
    hapi_v3_cross(p->edge_a, p->edge_b, edges);
    double sine = fabs(hapi_v3_dot(edges, p->normal)) / hapi_v3_norm(edges);
    worst->gap = fmax(worst->gap, fabs(sine - 1.0));
  }
}

static bool is_polytope(const thing *t)
{
  return t->shape.kind == HAPI_SHAPE_BOX || t->shape.kind == HAPI_SHAPE_HULL;
}

static void patch_errors(const thing *a, const thing *b, double distance, const hapi_patch *patch,
                         errors *worst)
{
  double size = fmax(thing_size(a), thing_size(b));
  double last = -INFINITY;
  for (int i = 0; i < patch->count; ++i) {
    point_errors(a, b, &patch->points[i], worst);
    CHECK(i == 0 || patch->points[i].gap >= patch->points[0].gap - 2e-6 * size);
    last = fmax(last, patch->points[i].gap);
  }
  if (patch->count > 0) {
    double allowed = 0.06 * fabs(distance);
    double over = patch->points[0].gap - distance;
    if (distance <= 0.0 || !is_polytope(a) || !is_polytope(b)) {
      worst->missed = fmax(worst->missed, (over - allowed) / size);
    }
    worst->excess = fmax(worst->excess, (-over - allowed) / size);
  } else if (distance <= 0.0 || !is_polytope(a) || !is_polytope(b)) {
    ++worst->none;
  }
}

/* --- random pairs --------------------------------------------------------------------------- */

static const double margin = 0.005;

/* Brings a from afar to a gap; not deeper than a fifth of the smaller one. */
static bool pair_make(thing *a, thing *b, const hapi_shape_kind kinds[2], double deepest,
                      uint64_t *state)
{
  hapi_nearest n;
  thing_make(a, kinds[0], state);
  thing_make(b, kinds[1], state);
  double least = fmin(thing_size(a) + 10.0 * (kinds[0] == HAPI_SHAPE_PLANE),
                      thing_size(b) + 10.0 * (kinds[1] == HAPI_SHAPE_PLANE));
  random_direction(state, a->pose.position);
  hapi_v3_scale(3.0, a->pose.position, a->pose.position);
  if (!nearest(a, b, &n)) {
    return false;
  }
  double gap = random_in(state, -fmin(deepest, 0.2 * least), margin);
  hapi_v3_madd(a->pose.position, gap - n.distance, n.normal, a->pose.position);
  return true;
}

static void pair_run(const hapi_shape_kind kinds[2], double deepest, uint64_t *state)
{
  errors worst = {0};
  for (int i = 0; i < 400; ++i) {
    thing a;
    thing b;
    hapi_nearest n;
    hapi_patch patch;
    REQUIRE(pair_make(&a, &b, kinds, deepest, state));
    REQUIRE(nearest(&a, &b, &n) && patch_find(&a, &b, margin, &patch));
    if (n.distance < 0.999 * margin) {
      patch_errors(&a, &b, n.distance, &patch, &worst);
    }
  }
  printf(
      "# %-8s %-8s gap %.0e, sideways %.0e, surface %.0e, deeper %.0e, missed %.0e, excess %.0e, "
      "none %d\n",
      kind_names[kinds[0]], kind_names[kinds[1]], worst.gap, worst.sideways, worst.surface,
      worst.deeper, worst.missed, worst.excess, worst.none);
  bool rim = kinds[0] == HAPI_SHAPE_CYLINDER || kinds[1] == HAPI_SHAPE_CYLINDER;
  CHECK(worst.gap < 1e-12);
  CHECK(worst.sideways < 1e-9);
  CHECK(worst.surface < (rim ? 5e-4 : 1e-4));
  CHECK(worst.deeper < 1e-9);
  CHECK(worst.missed < 1e-4);
  CHECK(worst.excess < 3e-3); /* another side of a sharp hull; see patch_axis.c */
  CHECK(worst.none == 0);
}

static void pairs_run(double deepest)
{
  uint64_t state = 20260202;
  for (int i = 0; i < PAIRS; ++i) {
    hapi_shape_kind kinds[2] = {(hapi_shape_kind)(i / KINDS), (hapi_shape_kind)(i % KINDS)};
    if (kinds[0] != HAPI_SHAPE_PLANE || kinds[1] != HAPI_SHAPE_PLANE) {
      pair_run(kinds, deepest, &state);
    }
  }
}

TEST(random_pairs_near_and_touching)
{
  pairs_run(1e-4);
}

TEST(random_pairs_in_penetration)
{
  pairs_run(0.02);
}

/* --- order ---------------------------------------------------------------------------------- */

static hapi_touch touch_mirrored(hapi_touch touch)
{
  static const hapi_touch other[] = {HAPI_TOUCH_FACE_B, HAPI_TOUCH_FACE_A, HAPI_TOUCH_EDGES,
                                     HAPI_TOUCH_BALL_B, HAPI_TOUCH_BALL_A};
  return other[touch];
}

static bool has_mirror(const hapi_patch *patch, const hapi_patch_point *p, bool same_touch)
{
  for (int i = 0; i < patch->count; ++i) {
    const hapi_patch_point *q = &patch->points[i];
    double apart[3];
    double between[3];
    hapi_v3_sub(p->core_a, q->core_b, apart);
    hapi_v3_add(p->normal, q->normal, between);
    if (fabs(p->gap - q->gap) < 1e-6 && hapi_v3_norm(apart) < 1e-3 &&
        hapi_v3_norm(between) < 5e-3 && p->ball_a == q->ball_b && p->rim_b == q->rim_a &&
        (!same_touch || q->touch == touch_mirrored(p->touch))) {
      return true;
    }
  }
  return false;
}

/* Of one kind twice, single points stay on b whatever b is. On a rim the normal of a penetration is
 * known to 1e-3 only, and two searches may end at different sides of a sharp hull. */
TEST(swapping_mirrors_the_patch)
{
  uint64_t state = 77;
  int unlike = 0;
  for (int i = 0; i < PAIRS * 100; ++i) {
    hapi_shape_kind kinds[2] = {(hapi_shape_kind)(i % KINDS), (hapi_shape_kind)(i / KINDS % KINDS)};
    thing a;
    thing b;
    hapi_patch one;
    hapi_patch other;
    if ((kinds[0] == HAPI_SHAPE_PLANE && kinds[1] == HAPI_SHAPE_PLANE) ||
        !pair_make(&a, &b, kinds, 0.01, &state)) {
      continue;
    }
    REQUIRE(patch_find(&a, &b, margin, &one) && patch_find(&b, &a, margin, &other));
    bool alike = one.count == other.count;
    for (int k = 0; k < one.count; ++k) {
      alike = alike && has_mirror(&other, &one.points[k], kinds[0] != kinds[1]);
    }
    unlike += !alike;
  }
  printf("# unlike when swapped: %d of %d\n", unlike, PAIRS * 100);
  CHECK(unlike <= 4);
}

/* --- faces ---------------------------------------------------------------------------------- */

static thing thing_simple(hapi_shape_kind kind, double x, double y, double z)
{
  thing t;
  memset(&t, 0, sizeof t);
  t.shape = (hapi_shape){.kind = kind, .radius = 0.04, .half = {0.05, 0.06, 0.1}};
  t.pose = (hap_pose){.position = {x, y, z}, .quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  return t;
}

/* Turns a thing about a world axis through its centre. */
static void thing_turn(thing *t, const double axis[3], double angle)
{
  double q[4] = {cos(0.5 * angle), sin(0.5 * angle) * axis[0], sin(0.5 * angle) * axis[1],
                 sin(0.5 * angle) * axis[2]};
  hapi_quat_multiply(q, t->pose.quat_wxyz, t->pose.quat_wxyz);
}

static const double along_x[3] = {1.0, 0.0, 0.0};
static const double along_y[3] = {0.0, 1.0, 0.0};
static const double along_z[3] = {0.0, 0.0, 1.0};

TEST(box_on_plane_keeps_four_corners)
{
  static const double tilts[] = {0.0, 1e-9, 1e-4, 0.00873, 0.02};
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.3, 0.1, 0.0);
  for (size_t i = 0; i < sizeof tilts / sizeof tilts[0]; ++i) {
    thing box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.1005);
    hapi_patch patch;
    thing_turn(&box, along_z, 0.3);
    thing_turn(&box, along_x, tilts[i]);
    thing_turn(&box, along_y, 0.3 * tilts[i]);
    REQUIRE(patch_find(&box, &plane, margin, &patch));
    CHECK(patch.count == 4);
    for (int k = 0; k < patch.count; ++k) {
      double corner[3];
      hapi_pose_unpoint(box.pose.position, box.pose.quat_wxyz, patch.points[k].core_a, corner);
      CHECK(patch.points[k].touch == HAPI_TOUCH_FACE_B);
      CHECK_NEAR(fabs(corner[0]), 0.05, 1e-12);
      CHECK_NEAR(fabs(corner[1]), 0.06, 1e-12);
      CHECK_NEAR(corner[2], -0.1, 1e-12);
    }
  }
}

TEST(thin_plate_on_plane_stands_on_its_lower_face)
{
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0);
  thing plate = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.002);
  hapi_patch patch;
  plate.shape.half[2] = 0.001;
  thing_turn(&plate, along_x, 0.08); /* the higher corners are out of the margin */
  REQUIRE(patch_find(&plate, &plane, 0.004, &patch));
  CHECK(patch.count == 2);
  for (int k = 0; k < patch.count; ++k) {
    double corner[3];
    hapi_pose_unpoint(plate.pose.position, plate.pose.quat_wxyz, patch.points[k].core_a, corner);
    CHECK_NEAR(corner[2], -0.001, 1e-12);
  }
}

static void rectangle_check(double tilt, double gap)
{
  thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0);
  thing high = thing_simple(HAPI_SHAPE_BOX, 0.03, 0.05, 0.2 + gap);
  hapi_patch patch;
  int seen = 0;
  thing_turn(&high, along_y, tilt);
  REQUIRE(patch_find(&high, &low, margin, &patch));
  CHECK(patch.count == 4);
  for (int i = 0; i < patch.count; ++i) {
    const hapi_patch_point *p = &patch.points[i];
    double x = p->core_b[0];
    double y = p->core_b[1];
    CHECK(fabs(x - 0.05) < 1e-9 || fabs(x + 0.02) < 0.11 * fabs(tilt) + 1e-9);
    CHECK(fabs(y - 0.06) < 1e-9 || fabs(y + 0.01) < 1e-9);
    CHECK_NEAR(fabs(p->normal[2]), 1.0, tilt == 0.0 ? 1e-9 : tilt * tilt);
    seen |= 1 << ((x > 0.0) + 2 * (y > 0.0));
  }
  CHECK(seen == 15);
}

TEST(stacked_boxes_touch_in_the_corners_of_their_overlap)
{
  rectangle_check(0.0, 0.0);
  rectangle_check(0.0, 0.004);
  rectangle_check(0.0, -0.02);
  rectangle_check(0.00873, 0.0005);
  rectangle_check(-0.00873, 0.0005);
}

TEST(equal_boxes_do_not_flip)
{
  thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0);
  for (int i = 0; i < 200; ++i) {
    thing high = thing_simple(HAPI_SHAPE_BOX, 0.01, 0.02, 0.2);
    hapi_patch patch;
    thing_turn(&high, along_x, 1e-5 * sin(i));
    thing_turn(&high, along_y, 1e-5 * cos(3.0 * i));
    REQUIRE(patch_find(&high, &low, margin, &patch));
    CHECK(patch.count == 4 && patch.points[0].touch == HAPI_TOUCH_FACE_B);
  }
}

/* --- overlaps of faces against polygons cut here -------------------------------------------- */

typedef struct polygon {
  int count;
  double at[POLYGON_MAX][2];
} polygon;

/* Corners of a rectangle turned by angle. */
static polygon polygon_rectangle(const double half[2], const double middle[2], double angle)
{
  static const double side[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  polygon p = {.count = 4};
  for (int i = 0; i < 4; ++i) {
    double x = side[i][0] * half[0];
    double y = side[i][1] * half[1];
    p.at[i][0] = middle[0] + cos(angle) * x - sin(angle) * y;
    p.at[i][1] = middle[1] + sin(angle) * x + cos(angle) * y;
  }
  return p;
}

/* How far a point is outside; negative: inside. */
static double polygon_outside(const polygon *p, const double at[2])
{
  double most = -INFINITY;
  for (int i = 0; i < p->count; ++i) {
    const double *from = p->at[i];
    const double *to = p->at[(i + 1) % p->count];
    double x = to[0] - from[0];
    double y = to[1] - from[1];
    most = fmax(most, (y * (at[0] - from[0]) - x * (at[1] - from[1])) / hypot(x, y));
  }
  return most;
}

static double turn_of(const double a[2], const double b[2], const double c[2])
{
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Area of the convex hull: every ordered pair of points with all others on its left is a side. */
static double hull_area(const polygon *p)
{
  double area = 0.0;
  for (int i = 0; i < p->count; ++i) {
    for (int k = 0; k < p->count; ++k) {
      bool side = i != k;
      for (int m = 0; m < p->count && side; ++m) {
        side = m == i || m == k || turn_of(p->at[i], p->at[k], p->at[m]) > 0.0;
      }
      area += side ? 0.5 * (p->at[i][0] * p->at[k][1] - p->at[i][1] * p->at[k][0]) : 0.0;
    }
  }
  return area;
}

/* Edges over edges cross half way where one box is turned a little, as in a row or a stack that was
 * pushed: that crossing is no corner, and a box without one of its corners tips. */
TEST(boxes_edge_over_edge_keep_the_corners_of_their_overlap)
{
  uint64_t state = 5;
  double least = 1.0;
  for (int i = 0; i < 5000; ++i) {
    double slid = random_in(&state, 0.0, 0.08);
    double tiny = pow(10.0, random_in(&state, -9.0, -5.0));
    thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0);
    thing high = thing_simple(HAPI_SHAPE_BOX, slid, random_in(&state, -1e-6, 1e-6), 0.2 - 1e-4);
    hapi_patch patch;
    polygon spanned = {0};
    thing_turn(&high, along_z, random_in(&state, -10.0, 10.0) * tiny);
    thing_turn(&high, along_x, random_in(&state, -1.0, 1.0) * tiny);
    thing_turn(&high, along_y, random_in(&state, -1.0, 1.0) * tiny);
    REQUIRE(patch_find(&high, &low, margin, &patch));
    for (; spanned.count < patch.count; ++spanned.count) {
      memcpy(spanned.at[spanned.count], patch.points[spanned.count].core_b, sizeof spanned.at[0]);
    }
    least = fmin(least, hull_area(&spanned) / ((0.1 - slid) * 0.12));
  }
  CHECK_SAY(least > 0.95, "%g of the overlap", least);
}

/* Area of an overlap by counting the points of a grid over the first polygon's box. */
static double overlap_area(const polygon *p, const polygon *q, double reach)
{
  enum {
    GRID = 200
  };
  int inside = 0;
  for (int i = 0; i < GRID * GRID; ++i) {
    int cell[2] = {i % GRID, i / GRID};
    double at[2] = {reach * (2.0 * (cell[0] + 0.5) / GRID - 1.0),
                    reach * (2.0 * (cell[1] + 0.5) / GRID - 1.0)};
    inside += polygon_outside(p, at) < 0.0 && polygon_outside(q, at) < 0.0;
  }
  return 4.0 * reach * reach * inside / (GRID * GRID);
}

/* Share of the overlap that the points span; negative: one of them is outside of a face. */
static double overlap_share(uint64_t *state, bool as_hulls)
{
  thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0);
  double middle[2] = {random_in(state, -0.05, 0.05), random_in(state, -0.05, 0.05)};
  double angle = random_in(state, -3.0, 3.0);
  thing high = thing_simple(HAPI_SHAPE_BOX, middle[0], middle[1], 0.1 + 0.03 - 1e-4);
  double corners[2][24];
  hapi_patch patch;
  static const double origin[2] = {0.0, 0.0};
  hapi_v3_set(high.shape.half, random_in(state, 0.01, 0.1), random_in(state, 0.01, 0.1), 0.03);
  thing_turn(&high, along_z, angle);
  polygon p = polygon_rectangle(low.shape.half, origin, 0.0);
  polygon q = polygon_rectangle(high.shape.half, middle, angle);
  double area = overlap_area(&p, &q, 0.06);
  if (as_hulls) {
    box_to_hull(&low, &low, corners[0]);
    box_to_hull(&high, &high, corners[1]);
  }
  if (area < 1e-4 || !patch_find(&high, &low, margin, &patch)) {
    return area < 1e-4 ? 1.0 : -1.0;
  }
  polygon found = {.count = patch.count};
  for (int i = 0; i < patch.count; ++i) {
    memcpy(found.at[i], patch.points[i].core_a, sizeof found.at[i]);
    if (fmax(polygon_outside(&p, found.at[i]), polygon_outside(&q, found.at[i])) > 1e-8) {
      return -1.0;
    }
  }
  return hull_area(&found) / area;
}

static void overlaps_check(bool as_hulls)
{
  uint64_t state = 5;
  double least = INFINITY;
  double most = 0.0;
  double sum = 0.0;
  for (int i = 0; i < 500; ++i) {
    double share = overlap_share(&state, as_hulls);
    least = fmin(least, share);
    most = fmax(most, share);
    sum += share / 500.0;
  }
  printf("# share of the overlap spanned: least %.3f, mean %.3f, most %.3f\n", least, sum, most);
  CHECK(least > 0.6);
  CHECK(most < 1.05); /* the grid is coarse */
  CHECK(sum > 0.85);
}

TEST(random_overlaps_of_boxes)
{
  overlaps_check(false);
}

TEST(random_overlaps_of_hulls)
{
  overlaps_check(true);
}

TEST(margin_does_not_reach_sideways)
{
  static const double margins[] = {1e-4, 0.01, 0.05};
  for (size_t i = 0; i < sizeof margins / sizeof margins[0]; ++i) {
    thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0);
    thing high = thing_simple(HAPI_SHAPE_BOX, 0.08, 0.0, 0.2);
    thing beside = thing_simple(HAPI_SHAPE_BOX, 0.1005, 0.0, 0.2001);
    thing corner = thing_simple(HAPI_SHAPE_HULL, 0.0, 0.0, 0.0);
    double corners[24];
    hapi_patch patch;
    REQUIRE(patch_find(&high, &low, margins[i], &patch));
    CHECK(patch.count == 4);
    for (int k = 0; k < patch.count; ++k) {
      CHECK(patch.points[k].core_a[0] > 0.03 - 1e-9 && patch.points[k].core_a[0] < 0.05 + 1e-9);
    }
    REQUIRE(patch_find(&beside, &low, margins[i], &patch));
    CHECK(patch.count == 0);
    box_to_hull(&beside, &corner, corners);
    REQUIRE(patch_find(&corner, &low, margins[i], &patch));
    CHECK(patch.count == 0);
  }
}

/* --- points evaluated again from moved poses ------------------------------------------------- */

static void point_carry(const hap_pose *from, const hap_pose *to, const double point[3],
                        double out[3])
{
  hapi_pose_unpoint(from->position, from->quat_wxyz, point, out);
  hapi_pose_point(to->position, to->quat_wxyz, out, out);
}

static void carry_direction(const hap_pose *from, const hap_pose *to, const double v[3],
                            double out[3])
{
  hapi_quat_unrotate(from->quat_wxyz, v, out);
  hapi_quat_rotate(to->quat_wxyz, out, out);
}

static double ball_gap(const double center[3], double radius, const thing *other)
{
  hapi_shape ball = {.kind = HAPI_SHAPE_SPHERE, .radius = radius};
  hap_pose pose = {.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  hapi_nearest n = {.distance = NAN};
  hapi_v3_copy(center, pose.position);
  CHECK(hapi_nearest_points(&ball, &pose, &other->shape, &other->pose, &n));
  return n.distance;
}

/* What the haptic loop does with a point: a and b have moved to a2 and b2. */
static double point_evaluate(const hapi_patch_point *p, const thing *const was[2],
                             const thing *const is[2])
{
  hapi_patch_point now = *p;
  double on_a[3];
  double on_b[3];
  point_carry(&was[0]->pose, &is[0]->pose, p->core_a, now.core_a);
  point_carry(&was[1]->pose, &is[1]->pose, p->core_b, now.core_b);
  if (p->touch == HAPI_TOUCH_BALL_A) {
    return ball_gap(now.core_a, p->ball_a, is[1]);
  }
  if (p->touch == HAPI_TOUCH_BALL_B) {
    return ball_gap(now.core_b, p->ball_b, is[0]);
  }
  int fixed = p->touch == HAPI_TOUCH_FACE_A ? 0 : 1;
  carry_direction(&was[fixed]->pose, &is[fixed]->pose, p->normal, now.normal);
  if (p->touch == HAPI_TOUCH_EDGES) {
    double old[3];
    double sign = hapi_v3_dot((hapi_v3_cross(p->edge_a, p->edge_b, old), old), p->normal);
    carry_direction(&was[0]->pose, &is[0]->pose, p->edge_a, now.edge_a);
    carry_direction(&was[1]->pose, &is[1]->pose, p->edge_b, now.edge_b);
    hapi_v3_cross(now.edge_a, now.edge_b, now.normal);
    hapi_v3_scale((sign < 0.0 ? -1.0 : 1.0) / hapi_v3_norm(now.normal), now.normal, now.normal);
  }
  things_surfaces(is[0], is[1], &now, on_a, on_b);
  hapi_v3_sub(on_a, on_b, on_a);
  return hapi_v3_dot(on_a, now.normal);
}

static void thing_move(thing *t, double step, uint64_t *state)
{
  double direction[3];
  random_direction(state, direction);
  thing_turn(t, direction, step);
  random_direction(state, direction);
  hapi_v3_madd(t->pose.position, 0.1 * step, direction, t->pose.position);
}

/* The least gap of the points must follow the distance of the shapes but for step squared. */
static double patch_follow(const thing *a, const thing *b, double step, uint64_t *state)
{
  double worst = 0.0;
  for (int i = 0; i < 200; ++i) {
    thing a2 = *a;
    thing b2 = *b;
    const thing *was[2] = {a, b};
    const thing *is[2] = {&a2, &b2};
    hapi_patch patch;
    hapi_nearest n;
    double least = INFINITY;
    CHECK(patch_find(a, b, margin, &patch) && patch.count > 0);
    thing_move(&a2, step, state);
    thing_move(&b2, step, state);
    CHECK(nearest(&a2, &b2, &n));
    for (int k = 0; k < patch.count; ++k) {
      least = fmin(least, point_evaluate(&patch.points[k], was, is));
    }
    worst = fmax(worst, fabs(least - n.distance));
  }
  return worst;
}

static void follow_check(const thing *a, const thing *b, const char *what)
{
  uint64_t state = 9;
  double coarse = patch_follow(a, b, 4e-3, &state);
  double fine = patch_follow(a, b, 1e-3, &state);
  printf("# %-28s error %.1e m after 4 mrad, %.1e after 1 mrad\n", what, coarse, fine);
  CHECK(fine < 0.5 * 1e-3 * 1e-3);
  CHECK(coarse < 0.5 * 4e-3 * 4e-3);
}

TEST(points_follow_small_motions)
{
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0);
  thing box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.1);
  thing corner = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.123);
  thing rod = thing_simple(HAPI_SHAPE_CYLINDER, 0.0, 0.0, 0.04);
  thing pill = thing_simple(HAPI_SHAPE_CAPSULE, 0.0, 0.0, 0.04);
  thing_turn(&corner, along_x, 0.6);
  thing_turn(&corner, along_y, 0.6);
  thing_turn(&rod, along_y, 1.5707963267948966);
  thing_turn(&pill, along_y, 1.5707963267948966);
  follow_check(&box, &plane, "box standing on plane");
  follow_check(&corner, &plane, "corner of a box over plane");
  follow_check(&rod, &plane, "cylinder lying on plane");
  follow_check(&plane, &pill, "plane under lying capsule");
  thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, -0.1);
  follow_check(&pill, &low, "capsule over box, overhanging");
  thing roof = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.11);
  thing ridge = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, -0.107);
  thing_turn(&roof, along_x, 0.8);
  thing_turn(&ridge, along_y, 0.8);
  roof.pose.position[2] = 0.1112;
  follow_check(&roof, &ridge, "edge on edge");
  thing cross = thing_simple(HAPI_SHAPE_CYLINDER, 0.01, 0.0, -0.04);
  thing_turn(&cross, along_x, 1.5707963267948966);
  follow_check(&rod, &cross, "crossed cylinders");
  follow_check(&pill, &cross, "capsule across cylinder");
}

/* A whole turn without a new patch: the rim keeps the gap. */
TEST(lying_cylinder_rolls_exactly)
{
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0);
  thing rod = thing_simple(HAPI_SHAPE_CYLINDER, 0.0, 0.0, 0.0395);
  hapi_patch patch;
  thing_turn(&rod, along_y, 1.5707963267948966);
  REQUIRE(patch_find(&rod, &plane, margin, &patch));
  CHECK(patch.count == 2);
  for (int i = 0; i < 24; ++i) {
    thing rolled = rod;
    const thing *was[2] = {&rod, &plane};
    const thing *is[2] = {&rolled, &plane};
    thing_turn(&rolled, along_x, 0.26 * i);
    rolled.pose.position[1] = -0.04 * 0.26 * i;
    for (int k = 0; k < patch.count; ++k) {
      CHECK(patch.points[k].rim_a == 0.04);
      CHECK_NEAR(point_evaluate(&patch.points[k], was, is), -0.0005, 1e-12);
    }
  }
}

/* --- round things --------------------------------------------------------------------------- */

static int count_touch(const hapi_patch *patch, hapi_touch touch)
{
  int count = 0;
  for (int i = 0; i < patch->count; ++i) {
    count += patch->points[i].touch == touch;
  }
  return count;
}

TEST(standing_cylinder_has_four_points_and_a_leaning_one_its_rim)
{
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0);
  thing table = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, -0.1);
  for (int i = 0; i < 2; ++i) {
    const thing *ground = i == 0 ? &plane : &table;
    thing rod = thing_simple(HAPI_SHAPE_CYLINDER, 0.0, 0.0, 0.1);
    hapi_patch patch;
    thing_turn(&rod, along_x, 0.01);
    REQUIRE(patch_find(&rod, ground, margin, &patch));
    CHECK(patch.count == 4);
    CHECK_NEAR(patch.points[0].gap, 0.1 - 0.1 * cos(0.01) - 0.04 * sin(0.01), 1e-12);
    CHECK(patch.points[0].rim_a == 0.0);
    thing_turn(&rod, along_x, 0.09);
    REQUIRE(patch_find(&rod, ground, margin, &patch));
    CHECK(patch.count == 1 && patch.points[0].rim_a == 0.04);
    CHECK_NEAR(patch.points[0].gap, 0.1 - 0.1 * cos(0.1) - 0.04 * sin(0.1), 1e-12);
  }
}

TEST(capsule_over_a_box_face_ends_at_the_face)
{
  thing low = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, -0.1);
  thing pill = thing_simple(HAPI_SHAPE_CAPSULE, 0.08, 0.0, 0.0395);
  hapi_patch patch;
  thing_turn(&pill, along_y, 1.5707963267948966);
  REQUIRE(patch_find(&pill, &low, margin, &patch));
  CHECK(patch.count == 2);
  CHECK(count_touch(&patch, HAPI_TOUCH_BALL_A) == 1);
  CHECK(count_touch(&patch, HAPI_TOUCH_FACE_B) == 1);
  for (int i = 0; i < patch.count; ++i) {
    double at = patch.points[i].touch == HAPI_TOUCH_BALL_A ? -0.02 : 0.05;
    CHECK_NEAR(patch.points[i].core_a[0], at, 1e-9);
    CHECK_NEAR(patch.points[i].gap, -0.0005, 1e-12);
  }
}

TEST(capsules_across_and_along_each_other)
{
  thing one = thing_simple(HAPI_SHAPE_CAPSULE, 0.0795, 0.01, 0.03);
  thing two = thing_simple(HAPI_SHAPE_CAPSULE, 0.0, 0.0, 0.0);
  hapi_patch patch;
  one.pose.position[1] = 0.0;
  REQUIRE(patch_find(&one, &two, margin, &patch));
  CHECK(patch.count == 2); /* ends of the overlap */
  CHECK(count_touch(&patch, HAPI_TOUCH_BALL_A) == 1);
  CHECK(count_touch(&patch, HAPI_TOUCH_BALL_B) == 1);
  thing_turn(&one, along_x, 1.0);
  REQUIRE(patch_find(&one, &two, margin, &patch));
  CHECK(patch.count == 1 && patch.points[0].touch == HAPI_TOUCH_EDGES);
  CHECK_NEAR(patch.points[0].gap, -0.0005, 1e-12);
}

/* A box on the half of a cap: the rim between its sides belongs to the overlap. */
TEST(cap_under_a_box_has_its_rim)
{
  thing cap = thing_simple(HAPI_SHAPE_CYLINDER, 0.0, 0.0, -0.1);
  thing box = thing_simple(HAPI_SHAPE_BOX, 0.08, 0.0, 0.0995);
  hapi_patch patch;
  cap.shape.radius = 0.1;
  hapi_v3_set(box.shape.half, 0.08, 0.08, 0.1);
  thing_turn(&box, along_y, -0.002);
  REQUIRE(patch_find(&box, &cap, margin, &patch));
  CHECK(patch.count == 4 && patch.points[0].touch == HAPI_TOUCH_FACE_B);
  double farthest = 0.0;
  for (int i = 0; i < patch.count; ++i) {
    const double *at = patch.points[i].core_b;
    farthest = fmax(farthest, at[0]);
    CHECK(hypot(at[0], at[1]) < 0.1 + 1e-8 && at[0] > -2e-3 && fabs(at[1]) < 0.08 + 1e-8);
  }
  CHECK(farthest > 0.09);
}

TEST(cap_on_cap_touches_in_the_overlap_of_the_discs)
{
  thing low = thing_simple(HAPI_SHAPE_CYLINDER, 0.0, 0.0, -0.1);
  thing high = thing_simple(HAPI_SHAPE_CYLINDER, 0.03, 0.0, 0.099);
  hapi_patch patch;
  polygon found = {.count = 0};
  thing_turn(&high, along_z, 0.4);
  REQUIRE(patch_find(&high, &low, margin, &patch));
  found.count = patch.count;
  for (int i = 0; i < patch.count; ++i) {
    const double *at = patch.points[i].core_b;
    memcpy(found.at[i], at, sizeof found.at[i]);
    CHECK(hypot(at[0], at[1]) < 0.04 + 1e-8 && hypot(at[0] - 0.03, at[1]) < 0.04 + 1e-8);
    CHECK_NEAR(patch.points[i].gap, -0.001, 1e-9);
  }
  /* the lens of two discs of 0.04 m, 0.03 m apart, has 2.684e-3 m2 */
  CHECK(hull_area(&found) > 0.6 * 2.684e-3);
}

static const double triangle[9] = {-0.5, -0.5, 0.0, 0.5, -0.5, 0.0, 0.0, 0.5, 0.0};

TEST(triangle_carries_everything)
{
  static const int wanted[KINDS] = {1, 4, 2, 4, 0, 4};
  static const double up[KINDS] = {0.04, 0.1, 0.04, 0.1, 0.0, 0.1};
  for (int kind = 0; kind < KINDS; ++kind) {
    for (int side = -1; side <= 1; side += 2) {
      thing ground = thing_simple(HAPI_SHAPE_HULL, 0.0, 0.0, 0.0);
      thing load = thing_simple((hapi_shape_kind)kind, 0.0, 0.0, side * (up[kind] - 0.002));
      double corners[24];
      hapi_patch patch;
      ground.shape.hull = triangle;
      ground.shape.hull_count = 3;
      if (kind == HAPI_SHAPE_PLANE) {
        continue;
      }
      if (kind == HAPI_SHAPE_HULL) {
        box_to_hull(&load, &load, corners);
      }
      if (kind == HAPI_SHAPE_CAPSULE) {
        thing_turn(&load, along_y, 1.5707963267948966);
      }
      REQUIRE(patch_find(&load, &ground, margin, &patch));
      CHECK(patch.count == wanted[kind]);
      for (int k = 0; k < patch.count; ++k) {
        CHECK_NEAR(patch.points[k].normal[2], side, 1e-9);
        CHECK_NEAR(patch.points[k].gap, -0.002, 1e-9);
      }
    }
  }
}

TEST(no_answer)
{
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0);
  thing box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0);
  hapi_patch patch = {.count = 3};
  CHECK(!patch_find(&plane, &plane, margin, &patch) && patch.count == 0);
  CHECK(!patch_find(&box, &plane, NAN, &patch));
  box.pose.position[1] = NAN;
  CHECK(!patch_find(&box, &plane, margin, &patch));
  box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 5.0);
  CHECK(patch_find(&box, &plane, margin, &patch) && patch.count == 0);
}
