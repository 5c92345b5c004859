/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/closed_forms.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* A ball of one solid (its centre given) against the other one. False: no closed form. */
static bool ball_point(const hapi_pair *pair, bool of_a, const double center[3],
                       hapi_patch_point *out)
{
  const hapi_solid *owner = of_a ? pair->a : pair->b;
  const hapi_solid *other = of_a ? pair->b : pair->a;
  hapi_solid ball = {.kind = HAPI_SHAPE_SPHERE, .ball = owner->ball};
  hapi_nearest nearest;
  hapi_v3_copy(center, ball.center);
  if (!hapi_closed_form(&ball, other, &nearest)) {
    return false;
  }
  *out = (hapi_patch_point){.touch = of_a ? HAPI_TOUCH_BALL_A : HAPI_TOUCH_BALL_B};
  hapi_v3_copy(center, of_a ? out->core_a : out->core_b);
  hapi_v3_madd(nearest.point_b, -other->ball, nearest.normal, of_a ? out->core_b : out->core_a);
  out->ball_a = pair->a->ball;
  out->ball_b = pair->b->ball;
  hapi_v3_scale(of_a ? 1.0 : -1.0, nearest.normal, out->normal);
  out->gap = nearest.distance;
  return true;
}

/* --- spheres ---------------------------------------------------------------------------------- */

static bool sphere_hull(const hapi_pair *pair)
{
  hapi_gjk start;
  hapi_gjk cores;
  hapi_patch_point p = {
      .touch = HAPI_TOUCH_FACE_B, .ball_a = pair->a->ball, .ball_b = pair->b->ball};
  hapi_patch_guess(pair->a, pair->b, &start);
  if (!hapi_patch_axis(pair->a, pair->b, &start, &cores)) {
    return false;
  }
  hapi_v3_copy(cores.normal, p.normal);
  /* A normal within 1e-4 rad of the face's is the face's: then the plane is exact. */
  double *normal = p.normal;
  hapi_feature face;
  if (hapi_feature_face(pair->b, normal, &face) &&
      hapi_v3_dot(face.normal, normal) > 1.0 - 0.5 * 1e-4 * 1e-4) {
    hapi_v3_copy(face.normal, normal);
  }
  hapi_v3_copy(pair->a->center, p.core_a);
  hapi_v3_madd(p.core_a, -cores.distance, p.normal, p.core_b);
  hapi_patch_add(pair, &p);
  return true;
}

bool hapi_patch_sphere(const hapi_pair *pair)
{
  hapi_patch_point p;
  if (pair->b->kind == HAPI_SHAPE_HULL) {
    return sphere_hull(pair);
  }
  if (!ball_point(pair, true, pair->a->center, &p)) {
    return false;
  }
  hapi_patch_add(pair, &p);
  return true;
}

/* --- ends of capsules ------------------------------------------------------------------------- */

/* Whether a normal stands on a face or a straight side, so that the nearest point follows when the
 * ball moves along it. */
static bool on_smooth(const hapi_solid *solid, const double normal[3])
{
  double n[3];
  hapi_solid_to_local(solid, normal, n);
  double most = fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2])));
  switch (solid->kind) {
    case HAPI_SHAPE_BOX:
      return most > 1.0 - 1e-12;
    case HAPI_SHAPE_CYLINDER:
      return fabs(n[2]) > 1.0 - 1e-12 || fabs(n[2]) < 1e-6;
    case HAPI_SHAPE_CAPSULE:
      return fabs(n[2]) < 1e-6;
    case HAPI_SHAPE_PLANE:
      return true;
    case HAPI_SHAPE_SPHERE:
    case HAPI_SHAPE_HULL:
      break;
  }
  return false;
}

/* Where an edge is nearer to the middle than the capsule's end, that end hangs over it. The line of
 * the capsule holds it there; the end's ball would have a leaning normal. A centre inside of the
 * other solid may leave by another side than the capsule. */
static bool end_counts(const hapi_solid *other, const double outward[3], const double to_other[3],
                       double core_gap)
{
  bool inside = core_gap < 0.0 && other->kind != HAPI_SHAPE_PLANE;
  return !inside && (hapi_v3_dot(outward, to_other) > -1e-9 || on_smooth(other, to_other));
}

static bool same_place(const hapi_pair *pair, const hapi_patch_point *p)
{
  for (int i = 0; i < pair->out->count; ++i) {
    const hapi_patch_point *q = &pair->out->points[i];
    double apart[3];
    double apart_b[3];
    hapi_v3_sub(p->core_a, q->core_a, apart);
    hapi_v3_sub(p->core_b, q->core_b, apart_b);
    if (fmax(hapi_v3_norm(apart), hapi_v3_norm(apart_b)) < 1e-6 * pair->size) {
      return true;
    }
  }
  return false;
}

/* The ball takes the place of what the lines found at this end. */
static void drop_near(const hapi_pair *pair, bool of_a, const double center[3])
{
  hapi_patch *patch = pair->out;
  int kept = 0;
  for (int i = 0; i < patch->count; ++i) {
    const hapi_patch_point *p = &patch->points[i];
    double arm[3];
    hapi_v3_sub(of_a ? p->core_a : p->core_b, center, arm);
    bool ball = p->touch == HAPI_TOUCH_BALL_A || p->touch == HAPI_TOUCH_BALL_B;
    if (ball || hapi_v3_norm(arm) > 1e-6 * pair->size) {
      patch->points[kept++] = *p;
    }
  }
  patch->count = kept;
}

static void add_end(const hapi_pair *pair, bool of_a, double side)
{
  const hapi_solid *capsule = of_a ? pair->a : pair->b;
  const hapi_solid *other = of_a ? pair->b : pair->a;
  double outward[3];
  double center[3];
  double to_other[3];
  hapi_patch_point p;
  hapi_solid_axis(capsule, 2, outward);
  hapi_v3_scale(side, outward, outward);
  hapi_v3_madd(capsule->center, capsule->half[2], outward, center);
  if (!ball_point(pair, of_a, center, &p)) {
    return;
  }
  hapi_v3_scale(of_a ? -1.0 : 1.0, p.normal, to_other);
  if (end_counts(other, outward, to_other, p.gap + p.ball_a + p.ball_b)) {
    drop_near(pair, of_a, center);
    if (!same_place(pair, &p)) {
      hapi_patch_add(pair, &p);
    }
  }
}

void hapi_patch_add_ends(const hapi_pair *pair)
{
  for (int i = 0; i < 2; ++i) {
    const hapi_solid *solid = i == 0 ? pair->a : pair->b;
    if (solid->kind == HAPI_SHAPE_CAPSULE) {
      add_end(pair, i == 0, -1.0);
      add_end(pair, i == 0, 1.0);
    }
  }
}
