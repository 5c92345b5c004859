/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/closed_forms.h"
#include "proximity/deep.h"
#include "proximity/gjk.h"

#include "base/vec.h"

/* Below this gap of the cores, in parts of their size, the normal of GJK is losing digits;
 * the descent in hapi_deep_nearest measures it from farther off. */
static const double thin_gap = 1e-3;

static bool nearest_iterated(const hapi_solid *a, const hapi_solid *b, hapi_nearest *out)
{
  hapi_gjk cores;
  bool apart = hapi_gjk_nearest(a, b, NULL, &cores);
  if (!apart || cores.distance < thin_gap * fmax(a->reach, b->reach)) {
    hapi_gjk thin = cores;
    if (!hapi_deep_nearest(a, b, thin.normal, &cores)) {
      cores = thin;
      if (!apart) {
        return false;
      }
    }
  }
  hapi_v3_copy(cores.normal, out->normal);
  hapi_v3_madd(cores.point_a, -a->ball, cores.normal, out->point_a);
  hapi_v3_madd(cores.point_b, b->ball, cores.normal, out->point_b);
  out->distance = cores.distance - a->ball - b->ball;
  /* Makes point_a - point_b = distance x normal to the last bit that the coordinates allow; what is
   * left over of an iteration is shared by both points. */
  double middle[3];
  hapi_v3_add(out->point_a, out->point_b, middle);
  hapi_v3_scale(0.5, middle, middle);
  hapi_v3_madd(middle, 0.5 * out->distance, out->normal, out->point_a);
  hapi_v3_madd(middle, -0.5 * out->distance, out->normal, out->point_b);
  return true;
}

/* One order of kinds, so that a swapped pair takes the same way to its answer. */
static bool nearest_ordered(const hapi_solid *a, const hapi_solid *b, hapi_nearest *out)
{
  if (a->kind <= b->kind) {
    return nearest_iterated(a, b, out);
  }
  bool found = nearest_iterated(b, a, out);
  hapi_nearest_swap(out);
  return found;
}

bool hapi_nearest_points(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                         const hap_pose *pose_b, hapi_nearest *out)
{
  hapi_solid solid[2];
  hapi_nearest nearest = {.distance = 0.0};
  if (!hapi_pair_place(a, pose_a, b, pose_b, solid)) {
    return false;
  }
  if (!hapi_closed_form(&solid[0], &solid[1], &nearest) &&
      !nearest_ordered(&solid[0], &solid[1], &nearest)) {
    return false;
  }
  hapi_v3_add(nearest.point_a, pose_a->position, nearest.point_a);
  hapi_v3_add(nearest.point_b, pose_a->position, nearest.point_b);
  *out = nearest;
  return true;
}
