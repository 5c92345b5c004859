/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

void hapi_surface_lift(const hapi_solid *solid, double ball, double rim, const double dir[3],
                       double out[3])
{
  hapi_v3_scale(ball, dir, out);
  if (rim > 0.0) {
    double axis[3];
    double across[3];
    hapi_solid_axis(solid, 2, axis);
    hapi_v3_madd(dir, -hapi_v3_dot(dir, axis), axis, across);
    if (hapi_v3_unit(across, across) > 0.0) {
      hapi_v3_madd(out, rim, across, out);
    }
  }
}

static double gap_of(const hapi_pair *pair, const hapi_patch_point *p)
{
  double back[3];
  double lift_a[3];
  double lift_b[3];
  double between[3];
  hapi_v3_scale(-1.0, p->normal, back);
  hapi_surface_lift(pair->a, p->ball_a, p->rim_a, back, lift_a);
  hapi_surface_lift(pair->b, p->ball_b, p->rim_b, p->normal, lift_b);
  hapi_v3_sub(p->core_a, p->core_b, between);
  hapi_v3_add(between, lift_a, between);
  hapi_v3_sub(between, lift_b, between);
  return hapi_v3_dot(between, p->normal);
}

void hapi_patch_add(const hapi_pair *pair, const hapi_patch_point *point)
{
  HAPI_ASSERT_UNIT(point->normal);
  hapi_patch *patch = pair->out;
  HAPI_ASSERT(patch->count >= 0 && patch->count <= HAPI_PATCH_POINTS);
  double gap = gap_of(pair, point);
  if (!(gap <= pair->margin)) {
    return;
  }
  int place = patch->count;
  while (place > 0 && gap < patch->points[place - 1].gap) {
    --place;
  }
  if (place == HAPI_PATCH_POINTS) {
    return;
  }
  patch->count += patch->count < HAPI_PATCH_POINTS;
  for (int i = patch->count - 1; i > place; --i) {
    patch->points[i] = patch->points[i - 1];
  }
  patch->points[place] = *point;
  patch->points[place].gap = gap;
}

/* Field by field: clearing the point first takes as long as all the rest. */
static void face_point(hapi_patch_point *p, bool reference_is_a, const hapi_frame *frame,
                       const hapi_feature *incident, const hapi_spot *spot)
{
  double *fixed = reference_is_a ? p->core_a : p->core_b;
  double *pushed = reference_is_a ? p->core_b : p->core_a;
  p->touch = reference_is_a ? HAPI_TOUCH_FACE_A : HAPI_TOUCH_FACE_B;
  for (int i = 0; i < 3; ++i) {
    fixed[i] = frame->origin[i] + spot->x * frame->x[i] + spot->y * frame->y[i];
  }
  hapi_v3_madd(fixed, spot->gap, frame->normal, pushed);
  hapi_v3_sub(pushed, incident->lift, pushed);
  p->ball_a = reference_is_a ? 0.0 : incident->ball;
  p->ball_b = reference_is_a ? incident->ball : 0.0;
  p->rim_a = reference_is_a ? 0.0 : incident->rim;
  p->rim_b = reference_is_a ? incident->rim : 0.0;
  double *side = reference_is_a ? p->edge_a : p->edge_b;
  double *edge = reference_is_a ? p->edge_b : p->edge_a;
  p->slide = spot->slide;
  hapi_v3_set(side, 0.0, 0.0, 0.0);
  hapi_v3_set(edge, 0.0, 0.0, 0.0);
  if (spot->slide == HAPI_SLIDE_EDGE) {
    for (int i = 0; i < 3; ++i) {
      side[i] = spot->side[0] * frame->x[i] + spot->side[1] * frame->y[i];
      edge[i] = spot->edge[0] * frame->x[i] + spot->edge[1] * frame->y[i] +
                spot->edge[2] * frame->normal[i];
    }
  } else if (spot->slide == HAPI_SLIDE_CORNER) {
    hapi_v3_copy(incident->normal, edge);
  }
  hapi_v3_scale(reference_is_a ? -1.0 : 1.0, frame->normal, p->normal);
  p->gap = spot->gap;
}

void hapi_patch_add_spots(const hapi_pair *pair, bool reference_is_a, const hapi_frame *frame,
                          const hapi_feature *incident, hapi_spot *spots, int count)
{
  HAPI_ASSERT(count >= 0 && count <= HAPI_SPOTS_MAX);
  HAPI_ASSERT_UNIT(frame->normal);
  hapi_patch *patch = pair->out;
  int kept = 0;
  for (int i = 0; i < count; ++i) {
    if (spots[i].gap <= pair->margin) {
      spots[kept++] = spots[i];
    }
  }
  kept = hapi_patch_reduce(spots, kept, pair->size);
  for (int i = 0; i < kept && patch->count < HAPI_PATCH_POINTS; ++i) {
    face_point(&patch->points[patch->count++], reference_is_a, frame, incident, &spots[i]);
  }
}

bool hapi_patch_add_faces(const hapi_pair *pair, bool reference_is_a, const hapi_feature *reference,
                          const hapi_feature *incident)
{
  HAPI_ASSERT(reference->count >= 3 && reference->count <= HAPI_CORNERS_MAX);
  HAPI_ASSERT(incident->count >= 1 && incident->count <= HAPI_CORNERS_MAX);
  hapi_spot spots[HAPI_SPOTS_MAX];
  hapi_frame frame;
  int before = pair->out->count;
  hapi_v3_copy(reference->center, frame.origin);
  hapi_v3_copy(reference->normal, frame.normal);
  hapi_v3_sub(reference->corner[1], reference->corner[0], frame.x);
  hapi_v3_unit(frame.x, frame.x);
  hapi_v3_cross(frame.normal, frame.x, frame.y);
  for (int i = 0; i < incident->count; ++i) {
    double arm[3];
    hapi_v3_sub(incident->corner[i], frame.origin, arm);
    spots[i] = (hapi_spot){.x = hapi_v3_dot(arm, frame.x),
                           .y = hapi_v3_dot(arm, frame.y),
                           .gap = hapi_v3_dot(arm, frame.normal)};
  }
  int count = hapi_patch_clip(reference, &frame, spots, incident->count);
  hapi_patch_add_spots(pair, reference_is_a, &frame, incident, spots, count);
  return pair->out->count > before;
}
