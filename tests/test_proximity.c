/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/proximity.h"

#include <stdint.h>

#include "base/vec.h"
#include "proximity/gjk.h"
#include "tests/convex_things.h"
#include "tests/tap.h"

/* The oracle shares no code with the library but the vector algebra. For convex shapes the signed
 * distance is the largest separation over all unit normals n, separation(n) = min of a.n - max of
 * b.n. So an answer is right when (1) its normal has that separation, (2) its points are on the
 * surfaces, and (3) a search over normals finds nothing larger. When the shapes are apart, (1) and
 * (2) alone prove it. */

/* --- random things -------------------------------------------------------------------------- */

static double random_size(uint64_t *state, double scale)
{
  return scale * pow(10.0, random_in(state, -1.3, 0.0));
}

static void hull_make(thing *t, uint64_t *state, double scale)
{
  static const double corner[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  double size[3];
  for (int i = 0; i < 3; ++i) {
    size[i] = random_size(state, scale);
  }
  for (int k = 0; k < 4; ++k) {
    for (int i = 0; i < 3; ++i) {
      t->points[3 * k + i] = size[i] * (corner[k][i] + random_in(state, -0.2, 0.2));
    }
  }
  for (int k = 4; k < HULL_POINTS; ++k) {
    for (int i = 0; i < 3; ++i) {
      t->points[3 * k + i] =
          0.25 * (t->points[i] + t->points[3 + i] + t->points[6 + i] + t->points[9 + i]) +
          0.1 * (t->points[3 * (k - 4) + i] - t->points[9 + i]);
    }
  }
  t->shape.hull = t->points;
  t->shape.hull_count = HULL_POINTS;
}

static void thing_make(thing *t, hapi_shape_kind kind, uint64_t *state, double scale)
{
  memset(t, 0, sizeof *t);
  t->shape.kind = kind;
  t->shape.radius = random_size(state, scale);
  for (int i = 0; i < 3; ++i) {
    t->shape.half[i] = random_size(state, scale);
  }
  if (kind == HAPI_SHAPE_HULL) {
    hull_make(t, state, scale);
  }
  random_quat(state, t->pose.quat_wxyz);
}

static void thing_place(thing *t, uint64_t *state, double far)
{
  double direction[3];
  random_direction(state, direction);
  hapi_v3_scale(random_in(state, 0.0, far), direction, t->pose.position);
}

static double thing_size(const thing *t)
{
  const hapi_shape *s = &t->shape;
  double size = s->radius;
  for (int i = 0; i < 3; ++i) {
    size = fmax(size, s->half[i]);
  }
  for (size_t i = 0; i < 3 * s->hull_count; ++i) {
    size = fmax(size, fabs(s->hull[i]));
  }
  return size;
}

/* --- oracle --------------------------------------------------------------------------------- */

static double normal_climb(const thing *a, const thing *b, double normal[3], uint64_t *state)
{
  double best = separation(a, b, normal);
  for (double step = 0.2; step > 1e-10; step *= 0.6) {
    for (int i = 0; i < 12; ++i) {
      double trial[3];
      random_direction(state, trial);
      hapi_v3_madd(normal, step, trial, trial);
      hapi_v3_scale(1.0 / hapi_v3_norm(trial), trial, trial);
      double value = separation(a, b, trial);
      if (value > best) {
        best = value;
        hapi_v3_copy(trial, normal);
      }
    }
  }
  return best;
}

/* Normals spread evenly; the best of each batch is climbed from. Planes leave one normal only. */
static double best_separation(const thing *a, const thing *b, uint64_t *state)
{
  enum {
    BATCHES = 8,
    BATCH = 60
  };
  double up[3] = {0.0, 0.0, 1.0};
  const thing *plane = a->shape.kind == HAPI_SHAPE_PLANE ? a : b;
  if (plane->shape.kind == HAPI_SHAPE_PLANE) {
    hapi_quat_rotate(plane->pose.quat_wxyz, up, up);
    hapi_v3_scale(plane == a ? -1.0 : 1.0, up, up);
    return separation(a, b, up);
  }
  double best = -INFINITY;
  for (int i = 0; i < BATCHES; ++i) {
    double normal[3] = {0.0, 0.0, 1.0};
    for (int k = 0; k < BATCH; ++k) {
      double trial[3];
      random_direction(state, trial);
      if (separation(a, b, trial) > separation(a, b, normal)) {
        hapi_v3_copy(trial, normal);
      }
    }
    best = fmax(best, normal_climb(a, b, normal, state));
  }
  return best;
}

static void clamp_length(double v[2], double most)
{
  double length = hypot(v[0], v[1]);
  double scale = length > most ? most / length : 1.0;
  v[0] *= scale;
  v[1] *= scale;
}

/* Nearest point of the solid. Not for hulls. */
static void point_project(const thing *t, const double world[3], double out[3])
{
  const hapi_shape *s = &t->shape;
  double p[3];
  double axis[3] = {0.0, 0.0, 0.0};
  hapi_pose_unpoint(t->pose.position, t->pose.quat_wxyz, world, p);
  axis[2] = s->kind == HAPI_SHAPE_CAPSULE ? fmin(fmax(p[2], -s->half[2]), s->half[2]) : 0.0;
  if (s->kind == HAPI_SHAPE_PLANE) {
    p[2] = fmin(p[2], 0.0);
  } else if (s->kind == HAPI_SHAPE_CYLINDER) {
    clamp_length(p, s->radius);
    p[2] = fmin(fmax(p[2], -s->half[2]), s->half[2]);
  } else if (s->kind == HAPI_SHAPE_BOX) {
    for (int i = 0; i < 3; ++i) {
      p[i] = fmin(fmax(p[i], -s->half[i]), s->half[i]);
    }
  } else {
    hapi_v3_sub(p, axis, p);
    double length = hapi_v3_norm(p);
    hapi_v3_scale(length > s->radius ? s->radius / length : 1.0, p, p);
    hapi_v3_add(p, axis, p);
  }
  hapi_pose_point(t->pose.position, t->pose.quat_wxyz, p, out);
}

/* Distance by projecting to and fro: falls towards the truth from above. */
static double points_alternate(const thing *a, const thing *b, int rounds)
{
  double p[3];
  double q[3];
  double gap[3];
  hapi_v3_copy(a->pose.position, p);
  for (int i = 0; i < rounds; ++i) {
    point_project(b, p, q);
    point_project(a, q, p);
  }
  hapi_v3_sub(p, q, gap);
  return hapi_v3_norm(gap);
}

/* --- checks of one answer ------------------------------------------------------------------- */

typedef struct errors {
  double gap;         /* point_a - point_b against distance x normal */
  double certificate; /* separation along the normal against the distance */
  double surface;     /* points off the surfaces */
  double missed;      /* a better normal exists */
} errors;

/* All relative to the size of the pair. The normal's length is in certificate. */
static errors answer_errors(const thing *a, const thing *b, const hapi_nearest *n)
{
  errors e;
  double gap[3];
  double size = fmax(thing_size(a), thing_size(b));
  hapi_v3_sub(n->point_a, n->point_b, gap);
  hapi_v3_madd(gap, -n->distance, n->normal, gap);
  e.gap = hapi_v3_norm(gap) / size;
  e.certificate = fmax(fabs(separation(a, b, n->normal) - n->distance) / size,
                       fabs(hapi_v3_norm(n->normal) - 1.0));
  e.surface = fmax(fabs(height(a, n->point_a)), fabs(height(b, n->point_b))) / size;
  e.missed = 0.0;
  return e;
}

static void errors_max(errors *worst, errors e)
{
  worst->gap = fmax(worst->gap, e.gap);
  worst->certificate = fmax(worst->certificate, e.certificate);
  worst->surface = fmax(worst->surface, e.surface);
  worst->missed = fmax(worst->missed, e.missed);
}

static void errors_check(errors worst, const errors *bound, const char *a, const char *b)
{
  bool good = worst.gap <= bound->gap && worst.certificate <= bound->certificate &&
              worst.surface <= bound->surface && worst.missed <= bound->missed;
  CHECK_SAY(good, "%s against %s: off the bounds", a, b);
}

static void errors_print(errors worst, const char *a, const char *b)
{
  printf("# %-8s %-8s gap %.1e, certificate %.1e, surface %.1e, missed %.1e\n", a, b, worst.gap,
         worst.certificate, worst.surface, worst.missed);
}

typedef struct run {
  const char *name;
  int rounds;
  double far;    /* m, largest distance of the centres */
  double size_b; /* m, largest size of b; a: 1 */
  double offset; /* m, of the whole scene */
  bool search;   /* for a better normal */
  errors bound;
  errors bound_rim; /* a cylinder against a box, capsule, cylinder or hull */
} run;

static bool rim_pair(hapi_shape_kind a, hapi_shape_kind b)
{
  bool closed = a == HAPI_SHAPE_SPHERE || b == HAPI_SHAPE_SPHERE || a == HAPI_SHAPE_PLANE ||
                b == HAPI_SHAPE_PLANE;
  return !closed && (a == HAPI_SHAPE_CYLINDER || b == HAPI_SHAPE_CYLINDER);
}

static void pair_run(const run *r, hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  errors worst = {0.0, 0.0, 0.0, 0.0};
  for (int i = 0; i < r->rounds; ++i) {
    thing a;
    thing b;
    hapi_nearest answer;
    thing_make(&a, kind_a, state, 1.0);
    thing_make(&b, kind_b, state, r->size_b);
    thing_place(&a, state, r->far);
    for (int k = 0; k < 3; ++k) {
      a.pose.position[k] += r->offset;
      b.pose.position[k] += r->offset;
    }
    REQUIRE(nearest(&a, &b, &answer));
    errors e = answer_errors(&a, &b, &answer);
    if (r->search) {
      double size = fmax(thing_size(&a), thing_size(&b));
      e.missed = (best_separation(&a, &b, state) - answer.distance) / size;
    }
    errors_max(&worst, e);
  }
  errors_print(worst, kind_names[kind_a], kind_names[kind_b]);
  errors_check(worst, rim_pair(kind_a, kind_b) ? &r->bound_rim : &r->bound, kind_names[kind_a],
               kind_names[kind_b]);
}

static const run runs[] = {
    {.name = "random_pairs",
     .rounds = 300,
     .far = 3.0,
     .size_b = 1.0,
     .search = true,
     .bound = {1e-14, 1e-12, 1e-11, 1e-12},
     .bound_rim = {1e-14, 1e-8, 1e-5, 1e-9}},
    {.name = "deep_pairs",
     .rounds = 300,
     .far = 0.3,
     .size_b = 1.0,
     .search = true,
     .bound = {1e-14, 1e-11, 1e-11, 1e-9},
     .bound_rim = {1e-14, 1e-7, 1e-5, 1e-6}},
    {.name = "small_against_large",
     .rounds = 100,
     .far = 0.02,
     .size_b = 0.001,
     .search = true,
     .bound = {1e-14, 1e-9, 1e-9, 1e-9},
     .bound_rim = {1e-14, 1e-9, 1e-5, 1e-9}},
    {.name = "ten_kilometres_away",
     .rounds = 100,
     .far = 3.0,
     .size_b = 1.0,
     .offset = 1e4,
     .bound = {1e-9, 1e-9, 1e-9, 0.0},
     .bound_rim = {1e-9, 1e-8, 1e-5, 0.0}},
};

TEST_EACH(runs, const run *r)
{
  uint64_t state = 20260101;
  for (int i = 0; i < PAIRS; ++i) {
    hapi_shape_kind a = (hapi_shape_kind)(i / KINDS);
    hapi_shape_kind b = (hapi_shape_kind)(i % KINDS);
    if (a != HAPI_SHAPE_PLANE || b != HAPI_SHAPE_PLANE) {
      pair_run(r, a, b, &state);
    }
  }
}

/* --- relations between answers -------------------------------------------------------------- */

typedef void pair_test(hapi_shape_kind a, hapi_shape_kind b, uint64_t *state);

static void each_pair(pair_test *test, int rounds)
{
  uint64_t state = 7;
  for (int i = 0; i < PAIRS * rounds; ++i) {
    hapi_shape_kind a = (hapi_shape_kind)(i % PAIRS / KINDS);
    hapi_shape_kind b = (hapi_shape_kind)(i % KINDS);
    if (a != HAPI_SHAPE_PLANE || b != HAPI_SHAPE_PLANE) {
      test(a, b, &state);
    }
  }
}

static void pair_make(thing *a, thing *b, hapi_shape_kind kind_a, hapi_shape_kind kind_b,
                      double far, uint64_t *state)
{
  thing_make(a, kind_a, state, 1.0);
  thing_make(b, kind_b, state, 1.0);
  thing_place(a, state, far);
}

static void swap_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  hapi_nearest one;
  hapi_nearest other;
  pair_make(&a, &b, kind_a, kind_b, 3.0, state);
  REQUIRE(nearest(&a, &b, &one) && nearest(&b, &a, &other));
  CHECK_NEAR(one.distance, other.distance, rim_pair(kind_a, kind_b) ? 1e-7 : 1e-12);
  for (int i = 0; i < 3 && one.distance > 1e-3; ++i) {
    CHECK_NEAR(one.normal[i], -other.normal[i], 1e-6);
  }
}

static double largest_projection_error; /* m */

static void project_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  hapi_nearest n;
  pair_make(&a, &b, kind_a, kind_b, 4.0, state);
  REQUIRE(nearest(&a, &b, &n));
  if (n.distance < 0.3 || kind_a == HAPI_SHAPE_HULL || kind_b == HAPI_SHAPE_HULL) {
    return;
  }
  double distance = points_alternate(&a, &b, 3000);
  CHECK(distance >= n.distance - 1e-12);
  CHECK_NEAR(distance, n.distance, 1e-4);
  largest_projection_error = fmax(largest_projection_error, distance - n.distance);
}

TEST(alternating_projections_agree)
{
  largest_projection_error = 0.0;
  each_pair(project_pair, 60);
  printf("# projections end at most %.1e m farther\n", largest_projection_error);
  CHECK(largest_projection_error > 0.0);
}

static void separate_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  hapi_nearest deep;
  hapi_nearest free;
  pair_make(&a, &b, kind_a, kind_b, 0.5, state);
  REQUIRE(nearest(&a, &b, &deep));
  if (deep.distance > -1e-5) {
    return;
  }
  thing moved = a;
  hapi_v3_madd(a.pose.position, -deep.distance - 1e-6, deep.normal, moved.pose.position);
  CHECK(hapi_overlap(&moved.shape, &moved.pose, &b.shape, &b.pose, 0.0));
  hapi_v3_madd(a.pose.position, -deep.distance + 1e-6, deep.normal, moved.pose.position);
  CHECK(!hapi_overlap(&moved.shape, &moved.pose, &b.shape, &b.pose, 0.0));
  REQUIRE(nearest(&moved, &b, &free));
  CHECK_NEAR(free.distance, 1e-6, rim_pair(kind_a, kind_b) ? 1e-7 : 1e-9);
}

/* Brings a to the gap along the normal of the answer. */
static void move_to_gap(thing *a, const hapi_nearest *answer, double gap)
{
  hapi_v3_madd(a->pose.position, gap - answer->distance, answer->normal, a->pose.position);
}

/* Moving along the normal changes the distance by as much, until contact. Beyond, another normal
 * may be better, and a needle may even come out again. */
static void thing_approach(thing *a, const thing *b, double reach, double grain)
{
  static const double gaps[] = {1.0, 1e-3, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-3};
  hapi_nearest start;
  hapi_nearest near;
  REQUIRE(nearest(a, b, &start));
  move_to_gap(a, &start, 3.0 * reach);
  REQUIRE(nearest(a, b, &start));
  thing moved = *a;
  for (size_t i = 0; i < sizeof gaps / sizeof gaps[0]; ++i) {
    double gap = reach * gaps[i];
    moved.pose = a->pose;
    move_to_gap(&moved, &start, gap);
    REQUIRE(nearest(&moved, b, &near));
    CHECK(near.distance >= gap - grain);
    CHECK(near.distance <= fabs(gap) + grain);
    CHECK_NEAR(separation(&moved, b, near.normal), near.distance, grain);
  }
}

static void approach_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  pair_make(&a, &b, kind_a, kind_b, 0.0, state);
  random_direction(state, a.pose.position);
  hapi_v3_scale(10.0, a.pose.position, a.pose.position);
  if (kind_a == HAPI_SHAPE_PLANE || kind_b == HAPI_SHAPE_PLANE) {
    hapi_v3_set(a.pose.position, 0.0, 0.0, 0.0);
  }
  thing_approach(&a, &b, 1e-2, rim_pair(kind_a, kind_b) ? 1e-6 : 1e-10);
}

static void extreme_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  thing_make(&a, kind_a, state, 0.001);
  thing_make(&b, kind_b, state, 100.0);
  random_direction(state, a.pose.position);
  hapi_v3_scale(1000.0, a.pose.position, a.pose.position);
  thing_approach(&a, &b, 1e-3, rim_pair(kind_a, kind_b) ? 1e-5 : 1e-6);
}

static void core_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  static const double origin[3] = {0.0, 0.0, 0.0};
  thing a;
  thing b;
  hapi_nearest closed;
  hapi_gjk cores;
  hapi_solid solid_a;
  hapi_solid solid_b;
  pair_make(&a, &b, HAPI_SHAPE_SPHERE, kind_b, 2.0, state);
  if (kind_a != HAPI_SHAPE_SPHERE || kind_b == HAPI_SHAPE_PLANE) {
    return;
  }
  REQUIRE(nearest(&a, &b, &closed));
  REQUIRE(hapi_solid_place(&solid_a, &a.shape, &a.pose, origin));
  REQUIRE(hapi_solid_place(&solid_b, &b.shape, &b.pose, origin));
  if (!hapi_gjk_nearest(&solid_a, &solid_b, NULL, &cores)) {
    CHECK(closed.distance <= -a.shape.radius + 1e-12); /* the centre is inside */
    return;
  }
  double gap = cores.distance;
  CHECK_NEAR(closed.distance, gap - solid_a.ball - solid_b.ball, 1e-12);
  for (int i = 0; i < 3; ++i) {
    CHECK_NEAR(closed.normal[i], cores.normal[i], 1e-8 + 1e-12 / gap);
    CHECK_NEAR(closed.point_b[i], cores.point_b[i] + solid_b.ball * cores.normal[i],
               1e-7 + 1e-12 / gap);
  }
}

static void hull_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing box;
  thing hull;
  double corners[24];
  hapi_nearest one;
  hapi_nearest other;
  pair_make(&a, &box, kind_a, HAPI_SHAPE_BOX, 2.0, state);
  if (kind_b != HAPI_SHAPE_BOX) {
    return;
  }
  box_to_hull(&box, &hull, corners);
  REQUIRE(nearest(&a, &box, &one) && nearest(&a, &hull, &other));
  CHECK_NEAR(one.distance, other.distance, 1e-9);
}

static void overlap_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  hapi_nearest n;
  pair_make(&a, &b, kind_a, kind_b, 2.0, state);
  REQUIRE(nearest(&a, &b, &n));
  CHECK(hapi_overlap(&a.shape, &a.pose, &b.shape, &b.pose, n.distance + 1e-8));
  CHECK(!hapi_overlap(&a.shape, &a.pose, &b.shape, &b.pose, n.distance - 1e-8));
}

static void coincident_pair(hapi_shape_kind kind_a, hapi_shape_kind kind_b, uint64_t *state)
{
  thing a;
  thing b;
  hapi_nearest n;
  pair_make(&a, &b, kind_a, kind_b, 0.0, state);
  memcpy(a.pose.quat_wxyz, b.pose.quat_wxyz, sizeof a.pose.quat_wxyz);
  REQUIRE(nearest(&a, &b, &n));
  errors e = answer_errors(&a, &b, &n);
  CHECK(n.distance < 0.0);
  CHECK(e.gap < 1e-14 && e.certificate < 1e-9 && e.surface < 1e-5);
  CHECK(best_separation(&a, &b, state) < n.distance + 1e-6);
}

typedef struct pair_relation {
  const char *name;
  pair_test *test;
  int rounds;
} pair_relation;

static const pair_relation relations[] = {
    {"swapping_changes_roles_only", swap_pair, 100},
    {"normal_leads_out", separate_pair, 100},
    {"distance_follows_the_approach", approach_pair, 100},
    {"millimetre_against_hundred_metres", extreme_pair, 100},
    {"closed_forms_against_gjk", core_pair, 300},
    {"box_and_hull_of_its_corners", hull_pair, 200},
    {"overlap_agrees_with_distance", overlap_pair, 200},
    {"coincident_frames", coincident_pair, 20},
};

TEST_EACH(relations, const pair_relation *row)
{
  each_pair(row->test, row->rounds);
}

/* --- single cases --------------------------------------------------------------------------- */

static thing thing_simple(hapi_shape_kind kind, double radius, double x, double y, double z)
{
  thing t;
  memset(&t, 0, sizeof t);
  t.shape = (hapi_shape){.kind = kind, .radius = radius, .half = {0.3, 0.4, 0.5}};
  t.pose = (hap_pose){.position = {x, y, z}, .quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  return t;
}

static void touch_expect(const thing *a, const thing *b, double distance, int axis)
{
  hapi_nearest n;
  REQUIRE(nearest(a, b, &n));
  errors e = answer_errors(a, b, &n);
  CHECK_NEAR(n.distance, distance, 1e-14);
  CHECK(e.gap < 1e-14 && e.certificate < 1e-14 && e.surface < 1e-14);
  CHECK(axis < 0 || fabs(fabs(n.normal[axis]) - 1.0) < 1e-14);
}

TEST(centre_of_sphere_on_surface_axis_and_centre)
{
  thing ball = thing_simple(HAPI_SHAPE_SPHERE, 0.1, 0.0, 0.0, 0.0);
  thing box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.3, 0.0, 0.0);
  thing capsule = thing_simple(HAPI_SHAPE_CAPSULE, 0.2, 0.0, 0.0, 0.1);
  thing tube = thing_simple(HAPI_SHAPE_CYLINDER, 0.2, 0.0, 0.0, 0.5);
  thing other = thing_simple(HAPI_SHAPE_SPHERE, 0.2, 0.0, 0.0, 0.0);
  thing floor = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0, 0.0);
  touch_expect(&ball, &box, -0.1, 0);
  touch_expect(&ball, &capsule, -0.3, -1);
  touch_expect(&ball, &tube, -0.1, 2);
  touch_expect(&ball, &other, -0.3, -1);
  touch_expect(&ball, &floor, -0.1, 2);
  box.pose.position[0] = 0.0;
  tube.pose.position[2] = 0.0;
  capsule.pose.position[2] = 0.5; /* the end of the segment */
  touch_expect(&ball, &box, -0.4, 0);
  touch_expect(&ball, &tube, -0.3, -1);
  touch_expect(&ball, &capsule, -0.3, -1);
  tube.pose.position[0] = 0.2;
  touch_expect(&ball, &tube, -0.1, 0);
  ball.pose.position[0] = 1e-200; /* a hair off the centre */
  touch_expect(&ball, &other, -0.3, 0);
}

TEST(parallel_boxes)
{
  thing a = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0, 0.0);
  thing b = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.1, 0.1, 1.0);
  touch_expect(&a, &b, 0.0, 2);
  b.pose.position[2] = 1.25;
  touch_expect(&a, &b, 0.25, 2);
  b.pose.position[2] = 0.9;
  touch_expect(&a, &b, -0.1, 2);
  hapi_v3_set(b.pose.position, 0.6, 0.8, 1.0); /* corner to corner */
  touch_expect(&a, &b, 0.0, -1);
  hapi_v3_set(b.pose.position, 0.0, 0.0, 0.0);
  touch_expect(&a, &b, -0.6, 0);
}

TEST(capsules_on_one_axis_and_crossed)
{
  thing a = thing_simple(HAPI_SHAPE_CAPSULE, 0.1, 0.0, 0.0, 0.0);
  thing b = thing_simple(HAPI_SHAPE_CAPSULE, 0.2, 0.0, 0.0, 0.7);
  touch_expect(&a, &b, -0.3, -1);
  b.pose.position[2] = 1.5;
  touch_expect(&a, &b, 0.2, 2);
  hapi_v3_set(b.pose.position, 0.1, 0.0, 0.0);
  touch_expect(&a, &b, -0.2, 0);
  hapi_v3_set(b.pose.position, 0.0, 0.0, 0.0);
  b.pose.quat_wxyz[0] = b.pose.quat_wxyz[1] = sqrt(0.5);
  touch_expect(&a, &b, -0.3, 0);
}

static bool touch_refused(const thing *a, const thing *b)
{
  hapi_nearest n;
  memset(&n, 0x5a, sizeof n);
  hapi_nearest before = n;
  return !nearest(a, b, &n) && memcmp(&n, &before, sizeof n) == 0 &&
         !hapi_overlap(&a->shape, &a->pose, &b->shape, &b->pose, 1.0);
}

TEST(no_answer)
{
  thing box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0, 0.0);
  thing plane = thing_simple(HAPI_SHAPE_PLANE, 0.0, 0.0, 0.0, 0.0);
  thing hull = thing_simple(HAPI_SHAPE_HULL, 0.0, 0.0, 0.0, 0.0);
  CHECK(!touch_refused(&box, &box));
  CHECK(touch_refused(&plane, &plane));
  CHECK(touch_refused(&hull, &box) && touch_refused(&box, &hull));
  hull.shape.hull = hull.points;
  CHECK(touch_refused(&hull, &box));
  hull.shape.hull_count = 1;
  CHECK(!touch_refused(&hull, &box));
  hull.points[1] = NAN;
  CHECK(touch_refused(&hull, &box));
  thing bad = box;
  bad.pose.position[1] = NAN;
  CHECK(touch_refused(&bad, &box) && touch_refused(&box, &bad));
  bad = box;
  bad.pose.quat_wxyz[2] = INFINITY;
  CHECK(touch_refused(&bad, &plane) && touch_refused(&plane, &bad));
  bad = box;
  bad.pose.position[0] = 1e31;
  CHECK(touch_refused(&bad, &box) && touch_refused(&plane, &bad));
  bad.pose.position[0] = 1e29;
  CHECK(!touch_refused(&bad, &plane));
  bad = box;
  bad.shape.half[0] = -0.1;
  CHECK(touch_refused(&bad, &box));
}

TEST(points_and_plates)
{
  thing box = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0, 0.0);
  thing speck = thing_simple(HAPI_SHAPE_HULL, 0.0, 0.0, 0.0, 0.5);
  thing plate = thing_simple(HAPI_SHAPE_BOX, 0.0, 0.0, 0.0, 0.45);
  thing rod = thing_simple(HAPI_SHAPE_CYLINDER, 0.0, 0.0, 0.0, 0.0);
  hapi_nearest n;
  speck.shape.hull = speck.points;
  speck.shape.hull_count = 1;
  plate.shape.half[2] = 0.0;
  REQUIRE(nearest(&speck, &box, &n));
  CHECK_NEAR(n.distance, 0.0, 1e-14);
  REQUIRE(nearest(&speck, &speck, &n));
  CHECK_NEAR(n.distance, 0.0, 1e-14);
  touch_expect(&plate, &box, -0.05, 2);
  touch_expect(&rod, &box, -0.3, 0);
  touch_expect(&plate, &rod, -0.05, 2);
}
