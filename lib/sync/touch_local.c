/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/touch_local.h"

#include <math.h>
#include <stdbool.h>

#include "base/assert.h"
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
  HAPI_ASSERT_UNIT(in->normal);
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

void hapi_touch_on_shape(const hapi_touch_side *b, const hapi_patch_point *in, double out[3])
{
  if (in->touch == HAPI_TOUCH_FACE_B) { /* the plane's point may be any */
    hapi_v3_madd(in->core_a, -(in->ball_a + in->gap), in->normal, out);
    return;
  }
  hapi_v3_madd(in->core_b, in->ball_b, in->normal, out);
  if (in->rim_b > 0.0) {
    const double z[3] = {0.0, 0.0, 1.0};
    double axis[3];
    double across[3];
    hapi_quat_rotate(b->pose.quat_wxyz, z, axis);
    hapi_v3_madd(in->normal, -hapi_v3_dot(in->normal, axis), axis, across);
    double length = hapi_v3_norm(across);
    if (length > 0.0) {
      hapi_v3_madd(out, in->rim_b / length, across, out);
    }
  }
}

/* ---- of many points few ---- */

/* See tool_place.c: on a steeper face what lies behind the deepest points adds nothing. */
#define SLOPE_MOST 0.08
#define SAME_COSINE 0.99 /* of the normals: points of one face */
#define DEEPER 1e-7 /* m: a point that is not more than that deeper than the others adds nothing */

/* Points that push the same way, of those not yet dealt with. */
typedef struct face {
  const hapi_tool_spots *in;
  uint32_t members[HAPI_TOOL_SPOTS];
  uint32_t count;
  uint32_t deepest;
} face;

static double off_line(const face *f, uint32_t index, const uint32_t ends[2], double out_off[3])
{
  HAPI_ASSERT_INDEX(index, f->in->count);
  double line[3];
  double arm[3];
  hapi_v3_sub(f->in->places[ends[1]], f->in->places[ends[0]], line);
  hapi_v3_sub(f->in->places[index], f->in->places[ends[0]], arm);
  double length2 = hapi_v3_dot(line, line);
  hapi_v3_madd(arm, length2 > 0.0 ? -hapi_v3_dot(arm, line) / length2 : 0.0, line, out_off);
  return hapi_v3_norm(out_off);
}

/* m, what a point's distance from others is worth when it is higher than the deepest. */
static double face_worth(const face *f, uint32_t index, double distance)
{
  return distance - (f->in->gaps[index] - f->in->gaps[f->deepest]) / SLOPE_MOST;
}

static uint32_t farthest_from(const face *f, uint32_t from)
{
  uint32_t best = from;
  double most = 0.0;
  for (uint32_t i = 0; i < f->count; ++i) {
    double way[3];
    hapi_v3_sub(f->in->places[f->members[i]], f->in->places[from], way);
    double value = face_worth(f, f->members[i], hapi_v3_norm(way));
    if (value > most) {
      most = value;
      best = f->members[i];
    }
  }
  return best;
}

/* The farthest from a line, on the other side than `beside` where that is not NULL. */
static uint32_t farthest_off(const face *f, const uint32_t ends[2], const double *beside)
{
  uint32_t best = ends[0];
  double most = 0.0;
  for (uint32_t i = 0; i < f->count; ++i) {
    double off[3];
    double distance = face_worth(f, f->members[i], off_line(f, f->members[i], ends, off));
    if (distance > most && (beside == NULL || hapi_v3_dot(off, beside) < 0.0)) {
      most = distance;
      best = f->members[i];
    }
  }
  return best;
}

static bool add_index(uint32_t *kept, uint32_t *io_count, uint32_t index)
{
  HAPI_ASSERT(*io_count <= HAPI_TOOL_PAIR_POINTS);
  for (uint32_t i = 0; i < *io_count; ++i) {
    if (kept[i] == index) {
      return false;
    }
  }
  if (*io_count < HAPI_TOOL_PAIR_POINTS) {
    kept[(*io_count)++] = index;
  }
  return true;
}

/* Its corners, and its deepest point where none of them is. */
static void keep_face(const face *f, uint32_t *kept, uint32_t *io_count)
{
  HAPI_ASSERT(f->count > 0);
  HAPI_ASSERT_INDEX(f->deepest, f->in->count);
  double beside[3];
  uint32_t ends[2] = {farthest_from(f, f->deepest), 0};
  ends[1] = farthest_from(f, ends[0]);
  uint32_t third = farthest_off(f, ends, NULL);
  (void)off_line(f, third, ends, beside);
  const uint32_t corners[4] = {ends[0], ends[1], third, farthest_off(f, ends, beside)};
  double least = HUGE_VAL;
  for (int i = 0; i < 4; ++i) {
    least = fmin(least, f->in->gaps[corners[i]]);
  }
  if (f->in->gaps[f->deepest] < least - DEEPER) {
    (void)add_index(kept, io_count, f->deepest);
  }
  for (int i = 0; i < 4; ++i) {
    (void)add_index(kept, io_count, corners[i]);
  }
}

uint32_t hapi_tool_reduce(const hapi_tool_spots *in, uint32_t out_kept[HAPI_TOOL_PAIR_POINTS])
{
  HAPI_ASSERT(in->count <= HAPI_TOOL_SPOTS);
  bool done[HAPI_TOOL_SPOTS] = {false};
  uint32_t kept = 0;
  for (;;) {
    uint32_t first = HAPI_TOOL_SPOTS; /* the deepest of what is left */
    for (uint32_t i = 0; i < in->count; ++i) {
      if (!done[i] && (first == HAPI_TOOL_SPOTS || in->gaps[i] < in->gaps[first])) {
        first = i;
      }
    }
    if (first == HAPI_TOOL_SPOTS || kept == HAPI_TOOL_PAIR_POINTS) {
      return kept;
    }
    face f = {.in = in, .deepest = first};
    for (uint32_t i = 0; i < in->count; ++i) {
      if (!done[i] && hapi_v3_dot(in->normals[i], in->normals[first]) > SAME_COSINE) {
        f.members[f.count++] = i;
        done[i] = true;
      }
    }
    keep_face(&f, out_kept, &kept);
  }
}

uint64_t hapi_tool_key(uint64_t geom_key, uint32_t pointer, uint32_t generation)
{
  uint64_t x = geom_key ^ (((uint64_t)pointer << 32 | generation) * 0x9e3779b97f4a7c15u);
  x = (x ^ (x >> 33)) * 0xff51afd7ed558ccdu;
  return x ^ (x >> 29);
}

double hapi_tool_same_within(double extent)
{
  HAPI_ASSERT(extent >= 0.0);
  return fmin(SAME_MOST, SAME_SHARE * extent);
}
