/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/deep.h"

#include <float.h>

#include "base/assert.h"
#include "proximity/ccd_core.h"
#include "proximity/direction.h"

/* Depth along a unit normal n (b to a) is what a must move along n to be free of b. Every n gives a
 * true separation, the least one is wanted. It is found in three steps: directions in which
 * polytope pairs have their minimum, libccd for what has no such list, and a descent from the best
 * one.
 *
 * The expanding polytope of libccd 2.0 lies inside the difference of the cores, so the depth it
 * reports is a bound from below and the depth along its direction one from above. In 5 to 20 % of
 * the cylinder and hull pairs the two do not meet (rounding, an edge as the nearest feature); then
 * many descents search instead. Where cores of 1 mm and 100 m just touch, both bounds have been
 * wrong alike by metres: the hint, the last direction of GJK, covers that. */

enum {
  CCD_CALLS_MAX = 1500,
  DESCENT_MAX = 60
};

typedef struct search {
  const hapi_solid *a;
  const hapi_solid *b;
  double small; /* m, size of the smaller core that has one */
  double large;
  double normal[3]; /* best so far */
  double depth;
} search;

static void try_direction(search *s, const double direction[3])
{
  double normal[3] = {0.0, 0.0, 0.0};
  if (!(hapi_v3_unit(direction, normal) > 0.0)) {
    return;
  }
  double depth = -hapi_solid_separation(s->a, s->b, normal);
  if (depth < s->depth) {
    s->depth = depth;
    hapi_v3_copy(normal, s->normal);
  }
}

static void try_both_ways(search *s, const double direction[3])
{
  double back[3];
  hapi_v3_scale(-1.0, direction, back);
  try_direction(s, direction);
  try_direction(s, back);
}

/* Directions of straight edges, which are normals of faces as well for a box and a cylinder. */
static int edges_of(const hapi_solid *solid, double out[3][3])
{
  if (solid->kind == HAPI_SHAPE_BOX) {
    for (int i = 0; i < 3; ++i) {
      hapi_solid_axis(solid, i, out[i]);
    }
    return 3;
  }
  if (solid->kind == HAPI_SHAPE_CAPSULE || solid->kind == HAPI_SHAPE_CYLINDER) {
    hapi_solid_axis(solid, 2, out[0]);
    return 1;
  }
  return 0;
}

/* Across the axis of a long solid: towards the other one, and anywhere when that is undefined. */
static void try_across(search *s, const double axis[3], const double between[3])
{
  double direction[3];
  hapi_v3_madd(between, -hapi_v3_dot(between, axis), axis, direction);
  try_both_ways(s, direction);
  hapi_v3_across(axis, direction);
  try_both_ways(s, direction);
}

static void try_listed(search *s)
{
  static const double any[3] = {0.0, 0.0, 1.0};
  double edge_a[3][3];
  double edge_b[3][3];
  double direction[3];
  int count_a = edges_of(s->a, edge_a);
  int count_b = edges_of(s->b, edge_b);
  hapi_v3_sub(s->a->inside, s->b->inside, direction);
  try_direction(s, any);
  try_both_ways(s, direction);
  for (int i = 0; i < count_a; ++i) {
    try_both_ways(s, edge_a[i]);
    try_across(s, edge_a[i], direction);
  }
  for (int i = 0; i < count_b; ++i) {
    try_both_ways(s, edge_b[i]);
    try_across(s, edge_b[i], direction);
  }
  for (int i = 0; i < count_a * count_b; ++i) {
    hapi_v3_cross(edge_a[i / count_b], edge_b[i % count_b], direction);
    try_both_ways(s, direction);
  }
}

static bool listed_completely(const hapi_solid *solid)
{
  return solid->kind == HAPI_SHAPE_BOX || solid->kind == HAPI_SHAPE_CAPSULE;
}

/* Whether the two bounds of libccd have met: the minimum is found. */
static bool try_ccd(search *s)
{
  static const double tolerance = 1e-6; /* of the smaller core; what remains is the descent's */
  int calls_left = CCD_CALLS_MAX;
  double scale = 1.0 / s->small;
  hapi_ccd_core a = {.solid = s->a, .scale = scale, .calls_left = &calls_left};
  hapi_ccd_core b = {.solid = s->b, .scale = scale, .calls_left = &calls_left};
  ccd_t ccd;
  ccd_real_t depth;
  ccd_vec3_t direction;
  ccd_vec3_t position;
  hapi_ccd_init(&ccd, tolerance);
  if (ccdGJKPenetration(&b, &a, &ccd, &depth, &direction, &position) != 0) {
    return false;
  }
  try_direction(s, direction.v);
  return depth > 0.0 && s->depth * scale <= depth * (1.0 + 1e-5) + 10.0 * tolerance;
}

/* The turns shrink by a constant ratio on curved parts; their sum to the end is known beforehand.
 * */
static void search_leap(search *s, const double turn[3], const double last_turn[3])
{
  double last2 = hapi_v3_dot(last_turn, last_turn);
  double ratio = last2 > 0.0 ? hapi_v3_dot(turn, last_turn) / last2 : 0.0;
  if (ratio > 0.1 && ratio < 1.0) {
    double there[3];
    hapi_v3_madd(s->normal, ratio / (1.0 - ratio), turn, there);
    try_direction(s, there);
  }
}

/* a moved clear of b along the normal: the nearest points then show the way downhill. With C = b -
 * a it is the projection of a point outside C back onto C; the depth never rises, and falls to the
 * minimum at once where C is flat. The clearance is a compromise: small is fast on curved parts,
 * large makes the direction exact.
 *
 * At most so many steps; out is of the last one. False: none succeeded. */
static bool search_descend(search *s, int steps, hapi_gjk *out)
{
  double last_turn[3] = {0.0, 0.0, 0.0};
  for (int i = 0; i < steps; ++i) {
    double turn[3];
    double clear = 1e-3 * s->small + 1e-8 * s->large;
    clear += s->depth > 0.0 ? 0.1 * s->depth : -2.0 * s->depth;
    if (!hapi_gjk_shifted(s->a, s->b, s->normal, s->depth + clear, out)) {
      return i > 0;
    }
    double depth = -hapi_solid_separation(s->a, s->b, out->normal);
    hapi_v3_sub(out->normal, s->normal, turn);
    if (depth > s->depth || hapi_v3_norm(turn) < 1e-11) {
      return true;
    }
    s->depth = depth;
    hapi_v3_copy(out->normal, s->normal);
    if (i % 3 == 2) {
      search_leap(s, turn, last_turn);
    }
    hapi_v3_copy(turn, last_turn);
  }
  return true;
}

/* Short descents from all around. */
static void try_everywhere(search *s)
{
  for (int i = 0; i < 27; ++i) {
    const int cell[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    double start[3] = {cell[0], cell[1], cell[2]};
    search local = *s;
    hapi_gjk unused;
    local.depth = DBL_MAX;
    try_direction(&local, start);
    if (local.depth < DBL_MAX && search_descend(&local, 4, &unused)) {
      try_direction(s, local.normal);
    }
  }
}

static void search_globally(search *s)
{
  try_listed(s);
  bool complete = listed_completely(s->a) && listed_completely(s->b);
  if (!complete && !try_ccd(s)) {
    try_everywhere(s);
  }
}

/* The descent is slow from corner to corner when the cores are apart by a hair; but now a
 * separating normal is known and GJK cannot be mistaken about it. */
static bool settle_apart(search *s, hapi_gjk *out)
{
  hapi_gjk cores = {0};
  if (hapi_gjk_nearest(s->a, s->b, s->normal, &cores)) {
    try_direction(s, cores.normal);
  }
  return search_descend(s, DESCENT_MAX, out);
}

bool hapi_deep_nearest(const hapi_solid *a, const hapi_solid *b, const double *hint, hapi_gjk *out)
{
  HAPI_ASSERT(a->kind != HAPI_SHAPE_PLANE && b->kind != HAPI_SHAPE_PLANE);
  search s = {.a = a, .b = b, .depth = DBL_MAX};
  s.large = fmax(a->reach, b->reach);
  s.small = fmin(a->reach, b->reach);
  s.small = s.small > 0.0 ? s.small : s.large;
  s.small = s.small > 0.0 ? s.small : 1.0; /* two points: any length will do */
  try_direction(&s, hint);
  if (!(s.depth < 0.0)) {
    search_globally(&s); /* cores that are apart have one minimum only */
  }
  if (!search_descend(&s, DESCENT_MAX, out)) {
    return false;
  }
  if (s.depth < 0.0 && !settle_apart(&s, out)) {
    return false;
  }
  hapi_v3_copy(s.normal, out->normal);
  out->distance = -s.depth;
  return true;
}
