/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "proximity/ccd_core.h"
#include "proximity/closed_forms.h"

enum {
  CCD_CALLS_MAX = 500
};

static bool reach_apart(const hapi_solid *a, const hapi_solid *b, double margin)
{
  double between[3];
  hapi_v3_sub(a->center, b->center, between);
  return hapi_v3_norm(between) - a->reach - b->reach - a->ball - b->ball > margin;
}

/* The margin is added to a as a ball. Against the distance by GJK this saves two thirds of the time
 * where a cylinder takes part, and no pair was found on which the two disagree. */
static bool inflated_overlap(const hapi_solid *a, const hapi_solid *b, double margin)
{
  int calls_left = CCD_CALLS_MAX;
  double size = a->reach + b->reach + a->ball + b->ball + margin;
  if (!(size > 0.0)) {
    return false; /* two points in one place touch and come no nearer */
  }
  double scale = 1.0 / size;
  hapi_ccd_core core_a = {a, a->ball + margin, scale, &calls_left};
  hapi_ccd_core core_b = {b, b->ball, scale, &calls_left};
  ccd_t ccd;
  hapi_ccd_init(&ccd, 1e-12);
  return ccdMPRIntersect(&core_a, &core_b, &ccd) != 0;
}

bool hapi_overlap(const hapi_shape *a, const hap_pose *pose_a, const hapi_shape *b,
                  const hap_pose *pose_b, double margin)
{
  hapi_solid solid[2];
  hapi_nearest nearest;
  if (!hapi_pair_place(a, pose_a, b, pose_b, solid)) {
    return false;
  }
  if (!hapi_finite(&margin, 1)) {
    return margin > 0.0;
  }
  if (hapi_closed_form(&solid[0], &solid[1], &nearest)) {
    return nearest.distance < margin;
  }
  if (!(margin >= 0.0)) {
    return hapi_nearest_points(a, pose_a, b, pose_b, &nearest) && nearest.distance < margin;
  }
  return !reach_apart(&solid[0], &solid[1], margin) &&
         inflated_overlap(&solid[0], &solid[1], margin);
}
