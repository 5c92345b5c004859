/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/ball_among.h"

#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "proximity/triangle.h"

/* The constrained ball is where its centre comes as near as it can to that of the ball while no
 * triangle comes nearer than the radius. A triangle is convex: where its nearest point is known for
 * some place, all places beyond the plane that is a radius above that point are free of it. So the
 * centre goes to the nearest place beyond the planes of the triangles that are in its way, the
 * planes are found anew from there, and so on. No step crosses a triangle. */

#define STEPS_MOST 8u
#define PLANES_MOST 12u
#define SWEEPS_MOST 64
#define STEP_SHARE 0.5   /* of the radius: no triangle is passed over */
#define ENTERS 1e-9      /* m */
#define MOVE_LEAST 1e-10 /* m: the centre no longer moves */
#define LEVEL 1e-9       /* of a matrix of cosines: planes are the same */
#define SAME_PLACE 1e-9  /* m: the ball touches nothing */

void hapi_triangle_set(const double corners[9], hapi_triangle *out)
{
  memcpy(out->corners, corners, sizeof out->corners);
  out->reach = 0.0;
  for (int k = 0; k < 3; ++k) {
    out->middle[k] = (corners[k] + corners[3 + k] + corners[6 + k]) / 3.0;
  }
  for (int i = 0; i < 9; i += 3) {
    double apart[3];
    hapi_v3_sub(corners + i, out->middle, apart);
    out->reach = hapi_max(out->reach, hapi_v3_norm(apart));
  }
}

/* From the triangle's nearest point to the place; of a place on it the triangle's normal. */
static double triangle_apart(const hapi_triangle *triangle, const double place[3], double point[3],
                             double normal[3])
{
  hapi_triangle_nearest(triangle->corners, place, point);
  hapi_v3_sub(place, point, normal);
  double distance = hapi_v3_norm(normal);
  if (distance > 0.0) {
    hapi_v3_scale(1.0 / distance, normal, normal);
    return distance;
  }
  double sides[2][3];
  hapi_v3_sub(triangle->corners + 3, triangle->corners, sides[0]);
  hapi_v3_sub(triangle->corners + 6, triangle->corners, sides[1]);
  hapi_v3_cross(sides[0], sides[1], normal);
  double area = hapi_v3_norm(normal);
  if (area > 0.0) {
    hapi_v3_scale(1.0 / area, normal, normal);
  } else {
    hapi_v3_set(normal, 0.0, 0.0, 1.0);
  }
  return 0.0;
}

/* Which triangle is nearest to a place, as long as it is nearer than *io_distance; count: none. */
static uint32_t nearest_triangle(const hapi_triangle *triangles, uint32_t count,
                                 const double place[3], double *io_distance)
{
  uint32_t best = count;
  for (uint32_t i = 0; i < count; ++i) {
    double apart[3];
    double point[3];
    hapi_v3_sub(place, triangles[i].middle, apart);
    double within = *io_distance + triangles[i].reach;
    if (hapi_v3_dot(apart, apart) >= within * within) {
      continue;
    }
    hapi_triangle_nearest(triangles[i].corners, place, point);
    hapi_v3_sub(place, point, apart);
    double distance = hapi_v3_norm(apart);
    if (distance < *io_distance) {
      *io_distance = distance;
      best = i;
    }
  }
  return best;
}

bool hapi_triangles_ball(const hapi_triangle *triangles, uint32_t count, const double center[3],
                         double radius, hapi_nearest *out)
{
  double distance = HUGE_VAL;
  uint32_t nearest = nearest_triangle(triangles, count, center, &distance);
  if (nearest == count) {
    return false;
  }
  out->distance = triangle_apart(&triangles[nearest], center, out->point_b, out->normal) - radius;
  hapi_v3_madd(center, -radius, out->normal, out->point_a);
  return true;
}

/* Where the centre may be: normal . place >= least. */
typedef struct among_plane {
  uint32_t triangle;
  double normal[3];
  double least;
  double push; /* m */
} among_plane;

typedef struct among {
  const hapi_triangle *triangles;
  uint32_t count;
  const double *ball;
  double radius;
  among_plane planes[PLANES_MOST];
  uint32_t plane_count;
} among;

static void plane_set(const among *a, const double from[3], among_plane *io)
{
  double point[3];
  (void)triangle_apart(&a->triangles[io->triangle], from, point, io->normal);
  io->least = hapi_v3_dot(io->normal, point) + a->radius;
}

/* The place beyond all planes that is nearest to the ball: by the planes' pushes in turn. */
static void among_project(among *a, double out[3])
{
  hapi_v3_copy(a->ball, out);
  for (uint32_t i = 0; i < a->plane_count; ++i) {
    a->planes[i].push = 0.0;
  }
  double change = HUGE_VAL;
  for (int sweep = 0; sweep < SWEEPS_MOST && change > 0.1 * MOVE_LEAST; ++sweep) {
    change = 0.0;
    for (uint32_t i = 0; i < a->plane_count; ++i) {
      among_plane *plane = &a->planes[i];
      double more = plane->least - hapi_v3_dot(plane->normal, out);
      more = hapi_max(plane->push + more, 0.0) - plane->push;
      plane->push += more;
      hapi_v3_madd(out, more, plane->normal, out);
      change = hapi_max(change, fabs(more));
    }
  }
}

/* Pushes in turn come to their end slowly where planes are nearly level with each other: of up to
 * three planes the pushes are solved for at once. */
static void among_polish(const among *a, double io[3])
{
  const among_plane *held[3];
  double matrix[3][4];
  uint32_t count = 0;
  for (uint32_t i = 0; i < a->plane_count; ++i) {
    if (a->planes[i].push > 0.0) {
      if (count == 3) {
        return;
      }
      held[count++] = &a->planes[i];
    }
  }
  if (count < 2) {
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    for (uint32_t k = 0; k < count; ++k) {
      matrix[i][k] = hapi_v3_dot(held[i]->normal, held[k]->normal);
    }
    matrix[i][count] = held[i]->least - hapi_v3_dot(held[i]->normal, a->ball);
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (matrix[i][i] < LEVEL) {
      return;
    }
    for (uint32_t k = 0; k < count; ++k) {
      double share = k == i ? 0.0 : matrix[k][i] / matrix[i][i];
      for (uint32_t l = i; l <= count; ++l) {
        matrix[k][l] -= share * matrix[i][l];
      }
    }
  }
  double to[3];
  hapi_v3_copy(a->ball, to);
  for (uint32_t i = 0; i < count; ++i) {
    double push = matrix[i][count] / matrix[i][i];
    if (push < 0.0) {
      return;
    }
    hapi_v3_madd(to, push, held[i]->normal, to);
  }
  for (uint32_t i = 0; i < a->plane_count; ++i) {
    if (hapi_v3_dot(a->planes[i].normal, to) < a->planes[i].least - ENTERS) {
      return;
    }
  }
  hapi_v3_copy(to, io);
}

/* Back along the way from a place, to where it has not gone through any plane. */
static void among_clip(const among *a, const double from[3], double io[3])
{
  double share = 1.0;
  double way[3];
  hapi_v3_sub(io, from, way);
  double length = hapi_v3_norm(way);
  if (length > STEP_SHARE * a->radius) {
    share = STEP_SHARE * a->radius / length;
  }
  for (uint32_t i = 0; i < a->plane_count; ++i) {
    const among_plane *plane = &a->planes[i];
    double above = hapi_v3_dot(plane->normal, from) - plane->least;
    double down = -hapi_v3_dot(plane->normal, way);
    if (share * down > hapi_max(above, 0.0) + 0.5 * ENTERS) {
      share = hapi_max(above, 0.0) / down;
    }
  }
  hapi_v3_madd(from, share, way, io);
}

/* Of the triangles that hold the ball where it is now, those of others are in no way. */
static void among_renew(among *a, const double from[3])
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < a->plane_count; ++i) {
    if (a->planes[i].push > 0.0) {
      a->planes[kept] = a->planes[i];
      plane_set(a, from, &a->planes[kept++]);
    }
  }
  a->plane_count = kept;
}

/* False: the triangle has its plane already. */
static bool among_add(among *a, uint32_t triangle, const double from[3])
{
  for (uint32_t i = 0; i < a->plane_count; ++i) {
    if (a->planes[i].triangle == triangle) {
      return false;
    }
  }
  if (a->plane_count == PLANES_MOST) {
    return false;
  }
  a->planes[a->plane_count].triangle = triangle;
  plane_set(a, from, &a->planes[a->plane_count++]);
  return true;
}

/* From a place to the next one on the way to the ball, where no triangle is nearer than the radius.
 * Returns how far that is. */
static double among_step(among *a, double io[3])
{
  double to[3];
  double way[3];
  bool more = true;
  for (uint32_t tries = 0; more && tries <= PLANES_MOST; ++tries) {
    among_project(a, to);
    among_polish(a, to);
    among_clip(a, io, to);
    double distance = a->radius - ENTERS;
    uint32_t in_way = nearest_triangle(a->triangles, a->count, to, &distance);
    more = in_way < a->count && among_add(a, in_way, io);
    if (in_way < a->count && a->plane_count == PLANES_MOST) {
      hapi_v3_copy(io, to); /* too many are in the way: it stays */
    }
  }
  hapi_v3_sub(to, io, way);
  hapi_v3_copy(to, io);
  return hapi_v3_norm(way);
}

bool hapi_ball_among(const hapi_triangle *triangles, uint32_t count, const double ball[3],
                     double radius, hapi_constrained_ball *io, hapi_nearest *out)
{
  among a = {.triangles = triangles, .count = count, .ball = ball, .radius = radius};
  double way[3];
  HAPI_ASSERT(io->known);
  for (uint32_t step = 0; step < STEPS_MOST; ++step) {
    double moved = among_step(&a, io->center);
    among_renew(&a, io->center);
    if (moved < MOVE_LEAST) {
      break;
    }
  }
  hapi_v3_copy(ball, io->ball);
  hapi_v3_sub(io->center, ball, way);
  double depth = hapi_v3_norm(way);
  if (depth < SAME_PLACE) {
    bool near = hapi_triangles_ball(triangles, count, ball, radius, out);
    hapi_v3_copy(ball, io->center);
    io->held = false;
    if (near) {
      hapi_v3_copy(out->normal, io->normal);
      io->gap = hapi_max(out->distance, 0.0);
      io->outside = out->distance + radius;
    }
    return near;
  }
  io->held = true;
  io->gap = 0.0;
  io->outside = radius - depth;
  hapi_v3_scale(1.0 / depth, way, io->normal);
  hapi_v3_copy(io->normal, out->normal);
  hapi_v3_madd(io->center, -radius, io->normal, out->point_b);
  out->distance = -depth;
  hapi_v3_madd(out->point_b, -depth, io->normal, out->point_a);
  return true;
}
