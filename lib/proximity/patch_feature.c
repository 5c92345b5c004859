/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <float.h>

#include "base/assert.h"
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* Faces, lines and corners of solids along a direction. */

/* --- hulls ------------------------------------------------------------------------------------ */

/* A hull is a heap of points with no list of faces. A plane that comes along d is wrapped around
 * the hull. It meets the farthest point, tilts until it meets a second one, and turns about these
 * two until it meets a third. Of the two faces there the one turned least is taken. */

typedef struct wrap {
  const hapi_solid *hull;
  double d[3];    /* local */
  double top[3];  /* local, farthest along d */
  double next[3]; /* local, other end of the edge that falls least from top */
  double slope;   /* of that edge, tangent */
  bool has_edge;
} wrap;

/* Parts of the hull's size: points nearer than that are one; a face is as thick as that. */
static const double same_point = 1e-9;
static const double face_depth = 1e-6;

static void wrap_top(wrap *w)
{
  const hapi_solid *hull = w->hull;
  size_t best = 0;
  for (size_t i = 1; i < hull->hull_count; ++i) {
    if (hapi_v3_dot(hull->hull + 3 * i, w->d) > hapi_v3_dot(hull->hull + 3 * best, w->d)) {
      best = i;
    }
  }
  hapi_v3_copy(hull->hull + 3 * best, w->top);
}

static void wrap_start(wrap *w, const hapi_solid *hull, const double d[3])
{
  *w = (wrap){.hull = hull};
  hapi_solid_to_local(hull, d, w->d);
  hapi_v3_unit(w->d, w->d);
  wrap_top(w);
  /* Of edges that fall alike the longest one: points inside an edge are passed over. */
  double least2 = DBL_MAX;
  double longest2 = 0.0;
  double tiny2 = pow(same_point * w->hull->reach, 2.0);
  for (size_t i = 0; i < w->hull->hull_count; ++i) {
    double arm[3];
    hapi_v3_sub(w->hull->hull + 3 * i, w->top, arm);
    double drop = hapi_v3_dot(arm, w->d);
    double flat2 = hapi_v3_dot(arm, arm) - drop * drop;
    if (!(flat2 > tiny2)) {
      continue;
    }
    double slope2 = drop * drop / flat2;
    if (slope2 < least2 - 1e-14 || (slope2 <= least2 + 1e-14 && flat2 > longest2)) {
      least2 = slope2;
      longest2 = flat2;
      hapi_v3_copy(w->hull->hull + 3 * i, w->next);
    }
  }
  w->has_edge = least2 < DBL_MAX;
  w->slope = w->has_edge ? sqrt(least2) : 0.0;
}

/* Frame of the tilted plane: edge, across, up. */
static void wrap_frame(const wrap *w, hapi_frame *out)
{
  hapi_v3_copy(w->top, out->origin);
  hapi_v3_sub(w->next, w->top, out->x);
  hapi_v3_unit(out->x, out->x);
  hapi_v3_madd(w->d, -hapi_v3_dot(w->d, out->x), out->x, out->normal);
  hapi_v3_unit(out->normal, out->normal);
  hapi_v3_cross(out->normal, out->x, out->y);
}

/* Turns the frame about its edge into the face turned least. False: all points are on the edge. */
static bool wrap_face(const wrap *w, hapi_frame *frame)
{
  double best = -2.0;
  double longest = 1e-7 * w->hull->reach; /* a far third point tells the plane best */
  double normal[2] = {0.0, 1.0};          /* along y and normal */
  for (size_t i = 0; i < w->hull->hull_count; ++i) {
    double arm[3];
    hapi_v3_sub(w->hull->hull + 3 * i, w->top, arm);
    double y = hapi_v3_dot(arm, frame->y);
    double down = fmax(0.0, -hapi_v3_dot(arm, frame->normal));
    double length = hypot(y, down);
    double level = length > 1e-7 * w->hull->reach ? fabs(y) / length : -2.0;
    if (level > best + 1e-12 || (level > best - 1e-12 && length > longest)) {
      best = level;
      longest = length;
      normal[0] = (y < 0.0 ? -down : down) / length;
      normal[1] = level;
    }
  }
  double turned[3];
  hapi_v3_scale(normal[0], frame->y, turned);
  hapi_v3_madd(turned, normal[1], frame->normal, frame->normal);
  hapi_v3_cross(frame->normal, frame->x, frame->y);
  return best > -1.0;
}

/* --- corners of a face ------------------------------------------------------------------------ */

typedef struct flat {
  const hapi_solid *hull;
  const hapi_frame *frame;
} flat;

static bool flat_point(const flat *f, size_t i, double out[2])
{
  double arm[3];
  hapi_v3_sub(f->hull->hull + 3 * i, f->frame->origin, arm);
  out[0] = hapi_v3_dot(arm, f->frame->x);
  out[1] = hapi_v3_dot(arm, f->frame->y);
  return fabs(hapi_v3_dot(arm, f->frame->normal)) < face_depth * f->hull->reach;
}

static size_t flat_lowest(const flat *f)
{
  size_t best = 0;
  double low[2] = {DBL_MAX, DBL_MAX};
  for (size_t i = 0; i < f->hull->hull_count; ++i) {
    double p[2];
    if (flat_point(f, i, p) && (p[1] < low[1] || (p[1] == low[1] && p[0] < low[0]))) {
      best = i;
      low[0] = p[0];
      low[1] = p[1];
    }
  }
  return best;
}

/* The corner that comes after one, counter-clockwise: no point is to the right of the way there.
 * Of points in line the farthest. Back at itself: the face is a point. */
static size_t flat_next(const flat *f, size_t from)
{
  double at[2];
  double way[2] = {0.0, 0.0};
  size_t best = from;
  double tiny2 = pow(same_point * f->hull->reach, 2.0);
  flat_point(f, from, at);
  for (size_t i = 0; i < f->hull->hull_count; ++i) {
    double p[2];
    if (!flat_point(f, i, p)) {
      continue;
    }
    double v[2] = {p[0] - at[0], p[1] - at[1]};
    double length2 = v[0] * v[0] + v[1] * v[1];
    double way2 = way[0] * way[0] + way[1] * way[1];
    double right = v[0] * way[1] - v[1] * way[0];
    bool in_line = right * right <= 1e-18 * way2 * length2;
    if (length2 > tiny2 && (best == from || (in_line ? length2 > way2 : right > 0.0))) {
      best = i;
      way[0] = v[0];
      way[1] = v[1];
    }
  }
  return best;
}

/* Gift wrapping; false: more corners than a feature has. */
static bool corners_wrap(const flat *f, hapi_feature *out)
{
  size_t start = flat_lowest(f);
  size_t at = start;
  out->count = 0;
  do {
    if (out->count == HAPI_CORNERS_MAX) {
      return false;
    }
    hapi_v3_copy(f->hull->hull + 3 * at, out->corner[out->count++]);
    at = flat_next(f, at);
  } while (at != start);
  return true;
}

/* The extreme points in evenly spread directions. */
static void corners_sample(const flat *f, hapi_feature *out)
{
  static const double pi = 3.14159265358979323846;
  for (int k = 0; k < HAPI_CORNERS_MAX; ++k) {
    double u[2] = {cos(2.0 * pi * k / HAPI_CORNERS_MAX), sin(2.0 * pi * k / HAPI_CORNERS_MAX)};
    double most = -DBL_MAX;
    for (size_t i = 0; i < f->hull->hull_count; ++i) {
      double p[2];
      if (flat_point(f, i, p) && p[0] * u[0] + p[1] * u[1] > most) {
        most = p[0] * u[0] + p[1] * u[1];
        hapi_v3_copy(f->hull->hull + 3 * i, out->corner[k]);
      }
    }
  }
  out->count = HAPI_CORNERS_MAX;
}

static void corners_measure(hapi_feature *out)
{
  HAPI_ASSERT(out->count >= 1 && out->count <= HAPI_CORNERS_MAX);
  double twice[3] = {0.0, 0.0, 0.0};
  hapi_v3_scale(1.0 / out->count, out->corner[0], out->center);
  for (int i = 1; i < out->count; ++i) {
    double u[3];
    double v[3];
    double part[3];
    hapi_v3_sub(out->corner[i], out->corner[0], u);
    hapi_v3_sub(out->corner[i + 1 < out->count ? i + 1 : 0], out->corner[0], v);
    hapi_v3_cross(u, v, part);
    hapi_v3_add(twice, part, twice);
    hapi_v3_madd(out->center, 1.0 / out->count, out->corner[i], out->center);
  }
  out->area = 0.5 * hapi_v3_norm(twice);
}

static void to_world(const hapi_solid *hull, double point[3])
{
  hapi_solid_to_world(hull, point, point);
  hapi_v3_add(hull->center, point, point);
}

/* One of the faces at the corner farthest along d; or a line or corner, if the hull has no more. */
static void hull_feature(const hapi_solid *hull, const double d[3], hapi_feature *out)
{
  wrap w;
  hapi_frame frame = {.normal = {0.0, 0.0, 1.0}};
  wrap_start(&w, hull, d);
  hapi_v3_copy(w.top, out->corner[0]);
  hapi_v3_copy(w.next, out->corner[1]);
  out->count = w.has_edge ? 2 : 1;
  if (w.has_edge) {
    wrap_frame(&w, &frame);
    if (wrap_face(&w, &frame)) {
      flat f = {hull, &frame};
      if (!corners_wrap(&f, out)) {
        corners_sample(&f, out);
      }
    }
  }
  corners_measure(out);
  hapi_solid_to_world(hull, frame.normal, out->normal);
  to_world(hull, out->center);
  for (int i = 0; i < out->count; ++i) {
    to_world(hull, out->corner[i]);
  }
}

static bool hull_edge(const hapi_solid *hull, const double d[3], hapi_edge *out)
{
  wrap w;
  wrap_start(&w, hull, d);
  if (!w.has_edge) {
    return false;
  }
  hapi_v3_add(w.top, w.next, out->middle);
  hapi_v3_scale(0.5, out->middle, out->middle);
  to_world(hull, out->middle);
  hapi_v3_sub(w.next, w.top, out->direction);
  out->half = 0.5 * hapi_v3_unit(out->direction, out->direction);
  hapi_solid_to_world(hull, out->direction, out->direction);
  return w.slope < 1e-3;
}

enum {
  RIM_CORNERS = 8 /* of a cap; 90 % of its area */
};

/* --- all kinds -------------------------------------------------------------------------------- */

/* Sine of the tilt below which a cap lies on its whole rim, and above which it stands on one point
 * of it: 2 degrees. */
static const double cap_tilt = 0.0349;

/* Part of d along its edge below which an edge is square to d. Directions that come from cylinders
 * are wrong by 1e-5. */
static const double square_to = 1e-3;

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

static void box_face(const hapi_solid *box, const double d[3], hapi_feature *out)
{
  static const double side[4][2] = {{1.0, 1.0}, {-1.0, 1.0}, {-1.0, -1.0}, {1.0, -1.0}};
  double local[3];
  double axis[3][3];
  hapi_solid_to_local(box, d, local);
  int largest = fabs(local[1]) > fabs(local[0]) ? 1 : 0;
  int k = fabs(local[2]) > fabs(local[largest]) ? 2 : largest;
  double sign = local[k] < 0.0 ? -1.0 : 1.0;
  for (int i = 0; i < 3; ++i) {
    hapi_solid_axis(box, (k + i) % 3, axis[i]);
  }
  const double *half = box->half;
  double u = half[(k + 1) % 3];
  double v = half[(k + 2) % 3];
  hapi_v3_scale(sign, axis[0], out->normal);
  hapi_v3_madd(box->center, half[k], out->normal, out->center);
  for (int i = 0; i < 4; ++i) {
    hapi_v3_madd(out->center, sign * side[i][0] * u, axis[1], out->corner[i]);
    hapi_v3_madd(out->corner[i], side[i][1] * v, axis[2], out->corner[i]);
  }
  out->count = 4;
  out->area = 4.0 * u * v;
}

void hapi_rim_corners(const hapi_solid *cylinder, double side, const double d[3], int count,
                      double (*out)[3])
{
  HAPI_ASSERT(cylinder->kind == HAPI_SHAPE_CYLINDER && count <= HAPI_CORNERS_MAX);
  static const double pi = 3.14159265358979323846;
  double axis[3];
  double first[3];
  double second[3];
  double cap[3];
  hapi_solid_axis(cylinder, 2, axis);
  hapi_v3_madd(d, -hapi_v3_dot(d, axis), axis, first);
  if (hapi_v3_norm(first) > 1e-6) {
    hapi_v3_unit(first, first);
  } else {
    hapi_solid_axis(cylinder, 0, first);
  }
  hapi_v3_scale(side, axis, axis);
  hapi_v3_cross(axis, first, second);
  hapi_v3_madd(cylinder->center, cylinder->half[2], axis, cap);
  for (int i = 0; i < count; ++i) {
    double angle = 2.0 * pi * i / count;
    hapi_v3_madd(cap, cylinder->disc * cos(angle), first, out[i]);
    hapi_v3_madd(out[i], cylinder->disc * sin(angle), second, out[i]);
  }
}

static void cylinder_cap(const hapi_solid *cylinder, const double d[3], hapi_feature *out)
{
  static const double pi = 3.14159265358979323846;
  double axis[3];
  hapi_solid_axis(cylinder, 2, axis);
  double side = hapi_v3_dot(axis, d) < 0.0 ? -1.0 : 1.0;
  hapi_rim_corners(cylinder, side, d, RIM_CORNERS, out->corner);
  hapi_v3_scale(side, axis, out->normal);
  hapi_v3_madd(cylinder->center, cylinder->half[2], out->normal, out->center);
  out->count = RIM_CORNERS;
  out->disc = cylinder->disc;
  out->area = pi * cylinder->disc * cylinder->disc;
}

static void feature_clear(hapi_feature *out)
{
  out->count = 0;
  out->ball = out->rim = out->disc = out->area = 0.0;
  hapi_v3_set(out->lift, 0.0, 0.0, 0.0);
}

static bool on_cap(const hapi_solid *cylinder, const double d[3])
{
  double local[3];
  hapi_solid_to_local(cylinder, d, local);
  return local[0] * local[0] + local[1] * local[1] < cap_tilt * cap_tilt;
}

static void move_corners(hapi_feature *io, const double way[3])
{
  for (int i = 0; i < io->count; ++i) {
    hapi_v3_add(io->corner[i], way, io->corner[i]);
  }
  hapi_v3_add(io->center, way, io->center);
}

bool hapi_feature_face(const hapi_solid *solid, const double d[3], hapi_feature *out)
{
  feature_clear(out);
  if (solid->kind == HAPI_SHAPE_BOX) {
    box_face(solid, d, out);
  } else if (solid->kind == HAPI_SHAPE_CYLINDER) {
    cylinder_cap(solid, d, out);
  } else if (solid->kind == HAPI_SHAPE_HULL) {
    hull_feature(solid, d, out);
    /* Of a rounded hull the flat part of its surface. */
    double way[3];
    if (solid->ball > 0.0) {
      hapi_v3_scale(solid->ball, out->normal, way);
      move_corners(out, way);
    }
  }
  return out->count > 2 && out->area > 0.0;
}

void hapi_feature_along(const hapi_solid *solid, const double d[3], hapi_feature *out)
{
  HAPI_ASSERT(solid->kind != HAPI_SHAPE_PLANE);
  if (solid->kind == HAPI_SHAPE_HULL && solid->ball > 0.0) {
    /* What of a rounded hull comes nearest along d: the corners of the core, each with its ball. */
    feature_clear(out);
    hull_feature(solid, d, out);
    out->ball = solid->ball;
    hapi_v3_scale(solid->ball, d, out->lift);
    move_corners(out, out->lift);
    return;
  }
  if (solid->kind == HAPI_SHAPE_BOX || solid->kind == HAPI_SHAPE_HULL ||
      (solid->kind == HAPI_SHAPE_CYLINDER && on_cap(solid, d))) {
    hapi_feature_face(solid, d, out);
    return;
  }
  feature_clear(out);
  /* The line of a capsule's or cylinder's side, or a sphere's point. */
  double axis[3];
  hapi_solid_axis(solid, 2, axis);
  out->ball = solid->ball;
  out->rim = solid->disc;
  hapi_surface_lift(solid, out->ball, out->rim, d, out->lift);
  hapi_v3_add(solid->center, out->lift, out->corner[0]);
  hapi_v3_madd(out->corner[0], solid->half[2], axis, out->corner[1]);
  hapi_v3_madd(out->corner[0], -solid->half[2], axis, out->corner[0]);
  out->count = solid->half[2] > 0.0 ? 2 : 1;
}

static bool box_edge(const hapi_solid *box, const double d[3], hapi_edge *out)
{
  double local[3];
  hapi_solid_to_local(box, d, local);
  int k = fabs(local[1]) < fabs(local[0]) ? 1 : 0;
  k = fabs(local[2]) < fabs(local[k]) ? 2 : k;
  double middle[3];
  for (int i = 0; i < 3; ++i) {
    middle[i] = local[i] < 0.0 ? -box->half[i] : box->half[i];
  }
  middle[k] = 0.0;
  hapi_solid_to_world(box, middle, out->middle);
  hapi_v3_add(box->center, out->middle, out->middle);
  hapi_solid_axis(box, k, out->direction);
  out->half = box->half[k];
  return fabs(local[k]) < square_to;
}

bool hapi_feature_edge(const hapi_solid *solid, const double d[3], hapi_edge *out)
{
  *out = (hapi_edge){.ball = solid->ball, .rim = solid->disc, .half = solid->half[2]};
  if (solid->kind == HAPI_SHAPE_BOX) {
    return box_edge(solid, d, out);
  }
  if (solid->kind == HAPI_SHAPE_HULL) {
    return hull_edge(solid, d, out);
  }
  hapi_v3_copy(solid->center, out->middle);
  hapi_solid_axis(solid, 2, out->direction);
  return out->half > 0.0 && fabs(hapi_v3_dot(out->direction, d)) < square_to;
}
