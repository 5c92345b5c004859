/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/tool_side.h"

#include <math.h>

#include "base/assert.h"
#include "proximity/constrained_ball.h"

/* Where a hull may be beside a geom is, for its orientation, all space but a convex region: the
 * hull is a point there, and follows the constrained ball's ways. The radius is any; it only keeps
 * what is a little inside from being taken for deep. */
#define RADIUS 1.0

#define SAME_PLACE 1e-6 /* m: the points are those of the told side */
#define SAME_COSINE 0.5 /* of the way out to the told one */
#define LIFT 1e-4       /* of the hull's extent: off the surface, to look at it */

const hapi_tool_side *hapi_tool_side_find(const hapi_tool_side *sides, uint32_t count, uint64_t key,
                                          uint32_t pointer)
{
  for (uint32_t i = 0; i < count; ++i) {
    if (sides[i].key == key && sides[i].pointer == pointer) {
      return &sides[i];
    }
  }
  return NULL;
}

/* The told side in the world, now. */
typedef struct told_place {
  double at[3];     /* m, of the hull if it could not enter */
  double normal[3]; /* unit, of the way to there */
  double before[3]; /* m, where it was itself */
  double turned;    /* m, how far the hull's turning since may have moved a point of it */
} told_place;

static void told_place_now(const hapi_tool_seek *seek, told_place *out)
{
  const hapi_tool_side *told = seek->told;
  double way[3];
  double turn[4];
  hap_pose place = told->place;
  hapi_v3_copy(told->way, way);
  if (seek->body != NULL && told->body != HAPI_SLOT_NONE) {
    const double *q = seek->body->quat_wxyz;
    hapi_pose_point(seek->body->position, q, told->place.position, place.position);
    hapi_quat_multiply(q, told->place.quat_wxyz, place.quat_wxyz);
    hapi_quat_rotate(q, told->way, way);
  }
  const double *q = seek->hull->quat_wxyz;
  const double back[4] = {place.quat_wxyz[0], -place.quat_wxyz[1], -place.quat_wxyz[2],
                          -place.quat_wxyz[3]};
  hapi_quat_multiply(q, back, turn);
  out->turned = 2.0 * seek->extent * hapi_v3_norm(turn + 1);
  hapi_v3_copy(place.position, out->at);
  hapi_v3_sub(place.position, way, out->before);
  hapi_v3_scale(1.0 / hapi_v3_norm(way), way, out->normal);
}

/* The way out of all points that were found. */
static double spots_way(const hapi_tool_spots *found, double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  for (uint32_t i = 0; i < HAPI_TOOL_WAY_ROUNDS * found->count; ++i) {
    uint32_t k = i % found->count;
    hapi_tool_way_add(found->normals[k], -found->gaps[k], out);
  }
  return hapi_v3_norm(out);
}

/* The found way leads to the told side, by all points: the hull has moved since it was told, but
 * not past it. */
static bool is_told_side(const hapi_tool_seek *seek, const told_place *told,
                         const hapi_tool_spots *found, const double way[3], double length)
{
  for (uint32_t i = 0; i < found->count; ++i) {
    if (found->gaps[i] < 0.0 && hapi_v3_dot(found->normals[i], way) <= 0.0) {
      return false;
    }
  }
  double moved[3];
  double apart[3];
  hapi_v3_sub(seek->hull->position, told->before, moved);
  hapi_v3_add(seek->hull->position, way, apart);
  hapi_v3_sub(apart, told->at, apart);
  return hapi_v3_dot(way, told->normal) > SAME_COSINE * length &&
         hapi_v3_norm(apart) <= hapi_v3_norm(moved) + told->turned + SAME_PLACE;
}

static bool hull_nearest(const hapi_tool_seek *seek, const double at[3], hapi_nearest *out)
{
  hap_pose pose = *seek->hull;
  hapi_v3_copy(at, pose.position);
  if (!seek->distance(seek->geom, &pose, &out->distance, out->normal)) {
    return false;
  }
  hapi_v3_madd(at, -(out->distance + RADIUS), out->normal, out->point_b);
  return true;
}

/* A place off the geom on the told side: where it was told, but for what has turned since; at the
 * most as far off as the hull is large. False: there is none, it is another geom. */
static bool begin_place(const hapi_tool_seek *seek, const told_place *told,
                        hapi_constrained_ball *out)
{
  const double lifts[2] = {told->turned + LIFT * seek->extent, 2.0 * seek->extent};
  for (int i = 0; i < 2; ++i) {
    hapi_nearest there;
    hapi_v3_madd(told->at, lifts[i], told->normal, out->center);
    if (!hull_nearest(seek, out->center, &there) || there.distance >= 0.0) {
      return true;
    }
  }
  return false;
}

bool hapi_tool_side_seek(const hapi_tool_seek *seek, const hapi_tool_spots *found,
                         double out_way[3])
{
  told_place told;
  double way[3];
  hapi_constrained_ball ball = {.known = true, .held = true};
  hapi_ball_search search;
  hapi_nearest here;
  told_place_now(seek, &told);
  double length = spots_way(found, way);
  if (length > 0.0 && is_told_side(seek, &told, found, way, length)) {
    return false;
  }
  if (!begin_place(seek, &told, &ball)) {
    return false;
  }
  hapi_v3_copy(told.normal, ball.normal);
  here.distance = -length;
  if (length > 0.0) {
    hapi_v3_scale(1.0 / length, way, here.normal);
    hapi_v3_madd(seek->hull->position, length - RADIUS, here.normal, here.point_b);
    hapi_v3_copy(here.point_b, here.point_a);
  }
  hapi_ball_search_begin(&ball, seek->hull->position, RADIUS, length > 0.0 ? &here : NULL, &search);
  while (hapi_ball_search_asks(&ball, &search)) {
    hapi_nearest there;
    bool near = hull_nearest(seek, search.ask, &there);
    hapi_ball_search_answer(&ball, &search, near ? &there : NULL);
  }
  hapi_ball_search_end(&ball, &search, &here);
  if (!ball.held) {
    return false;
  }
  hapi_v3_sub(ball.center, seek->hull->position, out_way);
  hapi_v3_madd(out_way, LIFT * seek->extent, ball.normal, out_way);
  return true;
}
