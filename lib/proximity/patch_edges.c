/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* Sine of the angle below which two lines are side by side and not crossing: there the cross
 * product follows the bodies' rotations a hundred times too fast. */
static const double parallel = 0.01;

/* How far beyond its end, in parts of the smaller solid, an edge may be met. */
static const double beyond_end = 1e-6;

static void round_set(hapi_patch_point *p, const hapi_edge *a, const hapi_edge *b)
{
  p->ball_a = a->ball;
  p->ball_b = b->ball;
  p->rim_a = a->rim;
  p->rim_b = b->rim;
}

bool hapi_patch_add_edges(const hapi_pair *pair, const hapi_edge *a, const hapi_edge *b,
                          const double normal[3])
{
  HAPI_ASSERT_UNIT(a->direction);
  HAPI_ASSERT_UNIT(b->direction);
  hapi_patch_point p = {.touch = HAPI_TOUCH_EDGES};
  double along_a;
  double along_b;
  double slack = beyond_end * pair->size;
  hapi_v3_cross(a->direction, b->direction, p.normal);
  double sine = hapi_v3_unit(p.normal, p.normal);
  if (sine < parallel) {
    return false;
  }
  /* Where the lines come nearest, along each from its middle. sine: of their angle. */
  HAPI_ASSERT(sine > 0.0);
  double between[3];
  hapi_v3_sub(b->middle, a->middle, between);
  double cosine = hapi_v3_dot(a->direction, b->direction);
  double u = hapi_v3_dot(between, a->direction);
  double v = hapi_v3_dot(between, b->direction);
  along_a = (u - cosine * v) / (sine * sine);
  along_b = (cosine * u - v) / (sine * sine);
  if (fabs(along_a) > a->half + slack || fabs(along_b) > b->half + slack) {
    return false;
  }
  if (hapi_v3_dot(p.normal, normal) < 0.0) {
    hapi_v3_scale(-1.0, p.normal, p.normal);
  }
  hapi_v3_copy(a->direction, p.edge_a);
  hapi_v3_copy(b->direction, p.edge_b);
  hapi_v3_madd(a->middle, along_a, a->direction, p.core_a);
  hapi_v3_madd(b->middle, along_b, b->direction, p.core_b);
  round_set(&p, a, b);
  hapi_patch_add(pair, &p);
  return true;
}

bool hapi_patch_add_lines(const hapi_pair *pair, const hapi_edge *a, const hapi_edge *b,
                          const double normal[3])
{
  HAPI_ASSERT_UNIT(a->direction);
  HAPI_ASSERT_UNIT(b->direction);
  hapi_patch_point p = {.touch = HAPI_TOUCH_FACE_B};
  double between[3];
  hapi_v3_cross(a->direction, b->direction, between);
  if (hapi_v3_norm(between) >= parallel) {
    return false;
  }
  hapi_v3_sub(a->middle, b->middle, between);
  double shift = hapi_v3_dot(between, b->direction);
  double cosine = hapi_v3_dot(a->direction, b->direction);
  double low = fmax(-b->half, shift - a->half);
  double high = fmin(b->half, shift + a->half);
  double slack = beyond_end * pair->size;
  if (high < low - slack) {
    return false;
  }
  hapi_v3_madd(normal, -hapi_v3_dot(normal, b->direction), b->direction, p.normal);
  hapi_v3_unit(p.normal, p.normal);
  round_set(&p, a, b);
  for (int i = 0; i < 2; ++i) {
    double along = i == 0 ? low : high;
    hapi_v3_madd(b->middle, along, b->direction, p.core_b);
    hapi_v3_madd(a->middle, (along - shift) / cosine, a->direction, p.core_a);
    if (i == 0 || high - low > slack) {
      hapi_patch_add(pair, &p);
    }
  }
  return true;
}
