/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* The plane is the reference; what is pushed against it keeps its own points. */

static hapi_spot spot_of(const hapi_frame *frame, const double point[3])
{
  double arm[3];
  hapi_v3_sub(point, frame->origin, arm);
  return (hapi_spot){hapi_v3_dot(arm, frame->x), hapi_v3_dot(arm, frame->y),
                     hapi_v3_dot(arm, frame->normal)};
}

static int spots_of(const hapi_frame *frame, double (*points)[3], int count, hapi_spot *out)
{
  for (int i = 0; i < count; ++i) {
    out[i] = spot_of(frame, points[i]);
  }
  return count;
}

/* Corners of the face that looks down come first; when the margin takes them all, no others are
 * needed. */
static int box_spots(const hapi_solid *box, const hapi_frame *frame, double margin, hapi_spot *out)
{
  double down[3];
  hapi_feature face;
  bool all_near = true;
  hapi_v3_scale(-1.0, frame->normal, down);
  hapi_feature_face(box, down, &face);
  spots_of(frame, face.corner, 4, out);
  for (int i = 0; i < 4; ++i) {
    all_near = all_near && out[i].gap <= margin;
  }
  if (all_near) {
    return 4;
  }
  hapi_v3_scale(-1.0, face.normal, down);
  hapi_feature_face(box, down, &face);
  return 4 + spots_of(frame, face.corner, 4, out + 4);
}

/* m; those that are not among the spots are beyond the margin. */
static double least_gap(const hapi_spot *spots, int count, double margin)
{
  double least = count > 0 ? spots[0].gap : margin;
  for (int i = 1; i < count; ++i) {
    least = hapi_min(spots[i].gap, least);
  }
  return least;
}

/* When there are more corners near the plane than places, those seen so far are reduced to the four
 * that matter most. */
static int hull_spots(const hapi_solid *hull, const hapi_frame *frame, const hapi_pair *pair,
                      hapi_spot *out)
{
  int count = 0;
  for (size_t i = 0; i < hull->hull_count; ++i) {
    double point[3];
    hapi_solid_to_world(hull, hull->hull + 3 * i, point);
    hapi_v3_add(hull->center, point, point);
    hapi_v3_madd(point, -hull->ball, frame->normal, point);
    hapi_spot spot = spot_of(frame, point);
    if (!(spot.gap <= pair->margin)) {
      continue;
    }
    if (count == HAPI_CORNERS_MAX) {
      count = hapi_patch_reduce(out, count, pair->size);
    }
    out[count++] = spot;
  }
  return count;
}

/* Nearly upright it stands on its rim, else on the lowest points of both caps. */
static void cylinder_add(const hapi_pair *pair, bool plane_is_a, const hapi_solid *cylinder,
                         const hapi_frame *frame)
{
  enum {
    STANDS_ON = 4
  };
  double down[3];
  double corner[STANDS_ON][3];
  hapi_spot spots[STANDS_ON];
  hapi_feature lowest;
  int count = 0;
  hapi_v3_scale(-1.0, frame->normal, down);
  hapi_feature_along(cylinder, down, &lowest);
  if (lowest.count <= 2) {
    count = spots_of(frame, lowest.corner, lowest.count, spots);
  } else {
    double axis[3];
    hapi_solid_axis(cylinder, 2, axis);
    hapi_rim_corners(cylinder, hapi_v3_dot(axis, down) < 0.0 ? -1.0 : 1.0, down, STANDS_ON, corner);
    count = spots_of(frame, corner, STANDS_ON, spots);
  }
  hapi_patch_add_spots(pair, plane_is_a, frame, &lowest, spots, count);
}

bool hapi_patch_plane(const hapi_pair *pair)
{
  bool plane_is_a = pair->a->kind == HAPI_SHAPE_PLANE;
  const hapi_solid *plane = plane_is_a ? pair->a : pair->b;
  const hapi_solid *solid = plane_is_a ? pair->b : pair->a;
  hapi_feature corners = {.count = 1, .ball = solid->ball};
  hapi_spot spots[HAPI_SPOTS_MAX];
  hapi_frame frame;
  int count = 0;
  if (solid->kind == HAPI_SHAPE_SPHERE) {
    return hapi_patch_sphere(pair);
  }
  if (solid->kind == HAPI_SHAPE_CAPSULE) {
    hapi_patch_add_ends(pair);
    return true;
  }
  /* The plane seen from above; its origin below the other solid, so that coordinates stay small. */
  double height[3];
  hapi_solid_axis(plane, 0, frame.x);
  hapi_solid_axis(plane, 1, frame.y);
  hapi_solid_axis(plane, 2, frame.normal);
  hapi_v3_sub(solid->center, plane->center, height);
  hapi_v3_madd(solid->center, -hapi_v3_dot(height, frame.normal), frame.normal, frame.origin);
  if (solid->kind == HAPI_SHAPE_CYLINDER) {
    cylinder_add(pair, plane_is_a, solid, &frame);
    return true;
  }
  if (solid->kind == HAPI_SHAPE_BOX) {
    count = box_spots(solid, &frame, pair->margin, spots);
  } else {
    hapi_v3_scale(-solid->ball, frame.normal, corners.lift);
    count = hull_spots(solid, &frame, pair, spots);
  }
  pair->out->apart = least_gap(spots, count, pair->margin);
  hapi_patch_add_spots(pair, plane_is_a, &frame, &corners, spots, count);
  return true;
}
