/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <float.h>

#include "proximity/deep.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* The normal of two cores. It starts with a guess: the best of the faces and of the directions
 * across the axes. Clearly apart: GJK. Nearer or shallowly penetrated: the cores are shifted apart
 * along the guess, and GJK's normal for the shifted cores is a better guess. Faces and edges are
 * found after one to three such steps. Only what this does not settle, or is so deep that the guess
 * may have led to a wrong side, goes to hapi_deep_nearest. */

enum {
  STEPS_MAX = 60,
  STARTS_MAX = 8,
  START_STEPS = 3
};

/* Parts of the cores: below this gap GJK loses digits; beyond this depth several guesses are
 * followed; beyond that none is trusted. */
static const double thin_gap = 1e-3;
static const double shallow_part = 0.003;
static const double deep_part = 0.5;

static double smaller_core(const hapi_solid *a, const hapi_solid *b)
{
  double small = fmin(a->reach, b->reach);
  return small > 0.0 ? small : fmax(a->reach, b->reach);
}

typedef struct candidate {
  double normal[3];
  double separation; /* m */
} candidate;

typedef struct guess {
  const hapi_solid *a;
  const hapi_solid *b;
  double normal[3];
  double separation; /* m */
  candidate *starts; /* the best ones, best first; NULL: only the best one is wanted */
  int start_count;
} guess;

/* Among starts that look the same way only the first one stays. */
static void keep_start(guess *g, const double normal[3], double separation)
{
  static const double same_way = 0.97;
  for (int i = 0; i < g->start_count; ++i) {
    if (hapi_v3_dot(g->starts[i].normal, normal) > same_way) {
      return;
    }
  }
  int place = g->start_count;
  while (place > 0 && separation > g->starts[place - 1].separation) {
    --place;
  }
  if (place == STARTS_MAX) {
    return;
  }
  g->start_count += g->start_count < STARTS_MAX;
  for (int i = g->start_count - 1; i > place; --i) {
    g->starts[i] = g->starts[i - 1];
  }
  g->starts[place].separation = separation;
  hapi_v3_copy(normal, g->starts[place].normal);
}

static void try_normal(guess *g, const double direction[3])
{
  double normal[3] = {0.0, 0.0, 0.0};
  if (!(hapi_v3_unit(direction, normal) > 0.0)) {
    return;
  }
  double separation = hapi_solid_separation(g->a, g->b, normal);
  if (g->starts != NULL) {
    keep_start(g, normal, separation);
  }
  if (separation > g->separation) {
    g->separation = separation;
    hapi_v3_copy(normal, g->normal);
  }
}

static void try_both_ways(guess *g, const double direction[3])
{
  double back[3];
  hapi_v3_scale(-1.0, direction, back);
  try_normal(g, direction);
  try_normal(g, back);
}

/* Faces of the solid, and across its axis. sign: 1 for b, whose normals lead from b to a. */
static void try_solid(guess *g, const hapi_solid *solid, double sign)
{
  double between[3];
  double axis[3];
  double direction[3];
  hapi_v3_sub(g->a->inside, g->b->inside, between);
  if (solid->kind == HAPI_SHAPE_HULL) {
    hapi_feature face;
    hapi_v3_scale(sign, between, direction);
    if (hapi_feature_face(solid, direction, &face)) {
      try_both_ways(g, face.normal);
    }
    return;
  }
  for (int i = solid->kind == HAPI_SHAPE_BOX ? 0 : 2; i < 3; ++i) {
    hapi_solid_axis(solid, i, axis);
    try_both_ways(g, axis);
  }
  if (solid->kind != HAPI_SHAPE_BOX) {
    hapi_v3_madd(between, -hapi_v3_dot(between, axis), axis, direction);
    try_normal(g, direction);
    hapi_v3_across(axis, direction);
    try_both_ways(g, direction);
  }
}

/* The faces of the hulls that look along a direction (b to a). */
static void try_hull_along(guess *g, const double direction[3])
{
  hapi_feature face;
  double back[3];
  hapi_v3_scale(-1.0, direction, back);
  if (g->a->kind == HAPI_SHAPE_HULL && hapi_feature_face(g->a, back, &face)) {
    hapi_v3_scale(-1.0, face.normal, back);
    try_normal(g, back);
  }
  if (g->b->kind == HAPI_SHAPE_HULL && hapi_feature_face(g->b, direction, &face)) {
    try_normal(g, face.normal);
  }
}

static void guess_all(guess *g)
{
  double between[3];
  g->separation = -DBL_MAX;
  hapi_v3_sub(g->a->inside, g->b->inside, between);
  try_normal(g, between);
  try_solid(g, g->a, -1.0);
  try_solid(g, g->b, 1.0);
  try_hull_along(g, g->normal);
  try_hull_along(g, g->normal);
}

/* Uphill in separation until the normal stays. A large clearance sees farther, on rims a small one
 * arrives sooner. */
static bool guess_climb(guess *g, int steps, hapi_gjk *out)
{
  double size = smaller_core(g->a, g->b);
  for (int i = 0; i < steps; ++i) {
    double turn[3];
    double clear = i < START_STEPS ? 0.02 * size + 0.2 * fabs(g->separation) : 1e-3 * size;
    /* The cores shifted apart until the guess has a clear gap. */
    double shift = fmax(clear, g->separation) - g->separation;
    if (!hapi_gjk_shifted(g->a, g->b, g->normal, shift, out)) {
      return false;
    }
    double separation = hapi_solid_separation(g->a, g->b, out->normal);
    hapi_v3_sub(out->normal, g->normal, turn);
    if (separation < g->separation || hapi_v3_norm(turn) < 1e-9) {
      hapi_v3_copy(g->normal, out->normal);
      out->distance = g->separation;
      return true;
    }
    g->separation = separation;
    hapi_v3_copy(out->normal, g->normal);
  }
  hapi_v3_copy(g->normal, out->normal);
  out->distance = g->separation;
  return true;
}

bool hapi_patch_guess(const hapi_solid *a, const hapi_solid *b, hapi_gjk *out)
{
  guess g = {.a = a, .b = b};
  guess_all(&g);
  hapi_v3_copy(g.normal, out->normal);
  out->distance = g.separation;
  return g.separation > -shallow_part * smaller_core(a, b);
}

/* Short climbs from the best of many starts; the best end becomes the guess. */
static void guess_again(guess *g)
{
  candidate starts[STARTS_MAX];
  guess wide = {.a = g->a, .b = g->b, .starts = starts};
  guess_all(&wide);
  for (int i = 0; i < 27; ++i) {
    int side[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    double direction[3] = {side[0], side[1], side[2]};
    try_normal(&wide, direction);
    try_hull_along(&wide, direction);
  }
  for (int i = 0; i < wide.start_count; ++i) {
    guess one = {.a = g->a, .b = g->b, .separation = starts[i].separation};
    hapi_gjk unused;
    hapi_v3_copy(starts[i].normal, one.normal);
    if (guess_climb(&one, START_STEPS, &unused) && one.separation > g->separation) {
      g->separation = one.separation;
      hapi_v3_copy(one.normal, g->normal);
    }
  }
}

bool hapi_patch_axis(const hapi_solid *a, const hapi_solid *b, const hapi_gjk *start, hapi_gjk *out)
{
  guess g = {.a = a, .b = b, .separation = start->distance};
  double small = smaller_core(a, b);
  hapi_v3_copy(start->normal, g.normal);
  bool apart = hapi_gjk_nearest(a, b, start->normal, out);
  if (apart && out->distance > thin_gap * fmax(a->reach, b->reach)) {
    return true;
  }
  try_normal(&g, out->normal);
  bool climbed = guess_climb(&g, STEPS_MAX, out);
  if (climbed && out->distance < -shallow_part * small) {
    guess_again(&g);
    climbed = guess_climb(&g, STEPS_MAX, out);
  }
  return (climbed && out->distance > -deep_part * small) || hapi_deep_nearest(a, b, g.normal, out);
}
