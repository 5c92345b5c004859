/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/touch_local.h"

#include <string.h>

#include "base/vec.h"

#define SAME_MOST 0.005  /* m */
#define LEVEL_SHARE 0.18 /* of the hull's extent: a face of twice that length at 5 degrees */
#define SAME_SHARE 0.25  /* of the hull's extent */

static void point_to_body(const hapi_touch_side *side, const double world[3], double out[3])
{
  if (side->body == NULL) {
    hapi_v3_copy(world, out);
    return;
  }
  hapi_pose_unpoint(side->body->position, side->body->quat_wxyz, world, out);
}

static void vector_to_body(const hapi_touch_side *side, const double world[3], double out[3])
{
  if (side->body == NULL) {
    hapi_v3_copy(world, out);
    return;
  }
  hapi_quat_unrotate(side->body->quat_wxyz, world, out);
}

static void fill_axis(const hapi_touch_side *side, double rim, double out[3])
{
  const double z[3] = {0.0, 0.0, 1.0};
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  if (rim > 0.0) {
    double world[3];
    hapi_quat_rotate(side->pose.quat_wxyz, z, world);
    vector_to_body(side, world, out);
  }
}

void hapi_touch_localise(const hapi_touch_side *a, const hapi_touch_side *b,
                         const hapi_patch_point *in, hapi_patch_contact *out)
{
  const hapi_touch_side *face = in->touch == HAPI_TOUCH_FACE_A ? a : b;
  const hapi_touch_side *target = in->touch == HAPI_TOUCH_BALL_A ? b : a;
  out->touch = in->touch;
  point_to_body(a, in->core_a, out->core_a);
  point_to_body(b, in->core_b, out->core_b);
  out->ball_a = in->ball_a;
  out->ball_b = in->ball_b;
  out->rim_a = in->rim_a;
  out->rim_b = in->rim_b;
  fill_axis(a, in->rim_a, out->axis_a);
  fill_axis(b, in->rim_b, out->axis_b);
  out->slide = in->slide;
  vector_to_body(a, in->edge_a, out->edge_a);
  vector_to_body(b, in->edge_b, out->edge_b);
  hapi_v3_copy(in->normal, out->normal);
  if (in->touch == HAPI_TOUCH_FACE_A || in->touch == HAPI_TOUCH_FACE_B) {
    vector_to_body(face, in->normal, out->normal);
  }
  out->shape = target->shape;
  out->shape.hull = NULL; /* of another message; a ball against a hull is no BALL */
  out->shape.hull_count = 0;
  out->shape_pose = target->shape_pose;
}

bool hapi_tool_patch(const hapi_touch_side *a, const hapi_touch_side *b, double margin,
                     double extent, hapi_patch *out)
{
  if (!hapi_patch_find(&a->shape, &a->pose, &b->shape, &b->pose, margin, out)) {
    return false;
  }
  double level = out->count > 0 ? out->points[0].gap + LEVEL_SHARE * extent : margin;
  if (level < margin && out->points[out->count - 1].gap > level) {
    return hapi_patch_find(&a->shape, &a->pose, &b->shape, &b->pose, level, out);
  }
  return true;
}

static void swap(hapi_tool_point *points, double *gaps, uint32_t a, uint32_t b)
{
  hapi_tool_point point = points[a];
  double gap = gaps[a];
  points[a] = points[b];
  gaps[a] = gaps[b];
  points[b] = point;
  gaps[b] = gap;
}

/* m, of where the points are on the hull; two with the same place and other directions are apart, too. */
static double apart(const hapi_tool_point *p, const hapi_tool_point *q)
{
  double way[3];
  double turn[3];
  hapi_v3_sub(p->at.core_a, q->at.core_a, way);
  hapi_v3_sub(p->at.normal, q->at.normal, turn);
  return hapi_v3_norm(way) + p->same_within * hapi_v3_norm(turn);
}

static double nearest_chosen(const hapi_tool_point *points, uint32_t chosen, uint32_t index)
{
  double nearest = HUGE_VAL;
  for (uint32_t i = 0; i < chosen; ++i) {
    nearest = fmin(nearest, apart(&points[i], &points[index]));
  }
  return nearest;
}

uint32_t hapi_tool_points_reduce(hapi_tool_point *points, double *gaps, uint32_t count)
{
  uint32_t kept = 0;
  for (; kept < count && kept < HAPI_TOOL_PAIR_POINTS; ++kept) {
    uint32_t best = kept;
    double best_worth = -HUGE_VAL;
    for (uint32_t i = kept; i < count; ++i) {
      double worth = kept == 0 ? -gaps[i] : nearest_chosen(points, kept, i);
      if (worth > best_worth) {
        best = i;
        best_worth = worth;
      }
    }
    if (kept > 0 && best_worth < 0.02 * points[0].same_within) {
      break; /* what is left repeats what there is: seams of triangles */
    }
    swap(points, gaps, kept, best);
  }
  return kept;
}

uint64_t hapi_tool_key(uint64_t geom_key, uint32_t pointer, uint32_t generation)
{
  uint64_t x = geom_key ^ (((uint64_t)pointer << 32 | generation) * 0x9e3779b97f4a7c15u);
  x = (x ^ (x >> 33)) * 0xff51afd7ed558ccdu;
  return x ^ (x >> 29);
}

double hapi_tool_same_within(double extent)
{
  return fmin(SAME_MOST, SAME_SHARE * extent);
}
