/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "base/vec.h"
#include "proximity/closed_forms.h"
#include "proximity/patch_parts.h"

static void swap_vectors(double u[3], double v[3])
{
  double kept[3];
  hapi_v3_copy(u, kept);
  hapi_v3_copy(v, u);
  hapi_v3_copy(kept, v);
}

static void swap_numbers(double *u, double *v)
{
  double kept = *u;
  *u = *v;
  *v = kept;
}

static hapi_touch touch_swapped(hapi_touch touch)
{
  switch (touch) {
    case HAPI_TOUCH_FACE_A:
      return HAPI_TOUCH_FACE_B;
    case HAPI_TOUCH_FACE_B:
      return HAPI_TOUCH_FACE_A;
    case HAPI_TOUCH_BALL_A:
      return HAPI_TOUCH_BALL_B;
    case HAPI_TOUCH_BALL_B:
      return HAPI_TOUCH_BALL_A;
    case HAPI_TOUCH_EDGES:
      break;
  }
  return HAPI_TOUCH_EDGES;
}

static bool balls_apart(const hapi_pair *pair)
{
  const hapi_solid *a = pair->a;
  const hapi_solid *b = pair->b;
  double between[3];
  hapi_v3_sub(a->center, b->center, between);
  double reach = a->reach + b->reach + a->ball + b->ball;
  double limit = reach + pair->margin;
  bool apart = limit < 0.0 || hapi_v3_dot(between, between) > limit * limit;
  if (apart) {
    pair->out->apart = hapi_v3_norm(between) - reach;
  }
  return apart;
}

/* The kinds come in the order of the enumeration. */
static bool find_ordered(const hapi_pair *pair)
{
  HAPI_ASSERT(pair->a->kind <= pair->b->kind);
  if (pair->a->kind == HAPI_SHAPE_PLANE || pair->b->kind == HAPI_SHAPE_PLANE) {
    return hapi_patch_plane(pair);
  }
  if (balls_apart(pair)) {
    return true;
  }
  if (pair->a->kind == HAPI_SHAPE_SPHERE) {
    return hapi_patch_sphere(pair);
  }
  if (pair->b->kind == HAPI_SHAPE_BOX) {
    return hapi_patch_boxes(pair);
  }
  return hapi_patch_general(pair);
}

static double core_size(const hapi_solid *solid)
{
  return solid->kind == HAPI_SHAPE_PLANE ? (double)INFINITY : solid->reach + solid->ball;
}

bool hapi_patch_find(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                     const hap_pose *pose_b, double margin, hapi_patch *out)
{
  hapi_solid solid[2];
  out->count = 0;
  out->apart = 0.0;
  if (!(margin < (double)INFINITY) || !hapi_pair_place(a, pose_a, b, pose_b, solid)) {
    return false;
  }
  bool swapped = a->kind > b->kind;
  hapi_pair pair = {.a = &solid[swapped], .b = &solid[!swapped], .margin = margin, .out = out};
  pair.size = fmin(core_size(&solid[0]), core_size(&solid[1]));
  if (!find_ordered(&pair)) {
    out->count = 0;
    return false;
  }
  for (int i = 0; i < out->count; ++i) {
    hapi_patch_point *point = &out->points[i];
    hapi_v3_add(point->core_a, pose_a->position, point->core_a);
    hapi_v3_add(point->core_b, pose_a->position, point->core_b);
    if (swapped) {
      point->touch = touch_swapped(point->touch);
      swap_vectors(point->core_a, point->core_b);
      swap_vectors(point->edge_a, point->edge_b);
      swap_numbers(&point->ball_a, &point->ball_b);
      swap_numbers(&point->rim_a, &point->rim_b);
      hapi_v3_scale(-1.0, point->normal, point->normal);
    }
  }
  return true;
}

bool hapi_patch_distance(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                         const hap_pose *pose_b, double *out_distance, double out_normal[3])
{
  hapi_solid solid[2];
  hapi_nearest nearest;
  hapi_gjk guess;
  hapi_gjk cores;
  if (!hapi_pair_place(a, pose_a, b, pose_b, solid)) {
    return false;
  }
  if (hapi_closed_form(&solid[0], &solid[1], &nearest)) {
    *out_distance = nearest.distance;
    hapi_v3_copy(nearest.normal, out_normal);
    return true;
  }
  (void)hapi_patch_guess(&solid[0], &solid[1], &guess);
  if (!hapi_patch_axis(&solid[0], &solid[1], &guess, &cores)) {
    return false;
  }
  *out_distance = cores.distance - solid[0].ball - solid[1].ball;
  hapi_v3_copy(cores.normal, out_normal);
  return true;
}
