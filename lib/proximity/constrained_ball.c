/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/constrained_ball.h"

#include "base/assert.h"
#include "base/vec.h"

/* The constrained ball goes straight towards the ball as far as nothing is in its way, then along
 * the tangent plane where it touches: to the point of it that is nearest to the ball, and from
 * there back onto the surface. That point is outside of a convex shape, so its nearest point of the
 * surface is never that of another side. Where it no longer moves, it is nearest to the ball among
 * its neighbours. A ball that goes round an edge does so in some ticks. */

#define STEPS_MOST 9u    /* questions in a search */
#define GAP_LEAST 1e-9   /* m: it touches */
#define ROUNDING 1e-9    /* m */
#define MOVE_LEAST 1e-10 /* m: it no longer moves */
#define SAME_PLACE 1e-6  /* m: the nearest point is that of its own side */

static double distance_between(const double a[3], const double b[3])
{
  double apart[3];
  hapi_v3_sub(a, b, apart);
  return hapi_v3_norm(apart);
}

/* Where the ball is, or where it touches: the constrained ball of one that crossed nothing. */
static void ball_settle(hapi_constrained_ball *b, const double ball[3], double radius,
                        const hapi_nearest *nearest)
{
  b->known = true;
  b->held = false;
  hapi_v3_copy(ball, b->ball);
  hapi_v3_copy(ball, b->center);
  b->gap = b->outside = HUGE_VAL;
  if (nearest != NULL) {
    b->outside = nearest->distance + radius;
    b->gap = hapi_max(nearest->distance, 0.0);
    hapi_v3_copy(nearest->normal, b->normal);
    hapi_v3_madd(nearest->point_b, b->gap + radius, nearest->normal, b->center);
  }
}

bool hapi_ball_is_free(hapi_constrained_ball *io, const double ball[3], double radius,
                       const hapi_nearest *nearest)
{
  double outside = nearest != NULL ? nearest->distance + radius : HUGE_VAL;
  bool may_cross =
      io->known && (io->held || outside <= 0.0 || io->outside <= 0.0 ||
                    distance_between(ball, io->ball) + ROUNDING >= outside + io->outside);
  if (!may_cross) {
    ball_settle(io, ball, radius, nearest);
  }
  return !may_cross;
}

void hapi_ball_search_begin(const hapi_constrained_ball *b, const double ball[3], double radius,
                            const hapi_nearest *nearest, hapi_ball_search *out)
{
  HAPI_ASSERT(b->known);
  hapi_v3_copy(ball, out->ball);
  out->radius = radius;
  out->near = nearest != NULL;
  if (out->near) {
    out->nearest = *nearest;
  }
  out->steps = 0;
  out->reached = false;
}

bool hapi_ball_search_asks(hapi_constrained_ball *b, hapi_ball_search *io)
{
  double way[3];
  hapi_v3_sub(io->ball, b->center, way);
  double length = hapi_v3_norm(way);
  if (io->reached || io->steps == STEPS_MOST) {
    return false;
  }
  if (io->steps++ == 0) { /* the shape may be another one since */
    hapi_v3_copy(b->center, io->ask);
    return true;
  }
  if (b->gap > GAP_LEAST) {
    io->reached = length <= b->gap; /* nothing is in the way */
    hapi_v3_madd(b->center, hapi_min(b->gap / length, 1.0), way, io->ask);
    return !io->reached;
  }
  double into = hapi_v3_dot(way, b->normal);
  hapi_v3_madd(io->ball, -into, b->normal, io->ask);
  io->reached = into >= 0.0; /* beyond the tangent plane there is nothing of the shape */
  return !io->reached && distance_between(io->ask, b->center) > MOVE_LEAST;
}

void hapi_ball_search_answer(hapi_constrained_ball *b, hapi_ball_search *io,
                             const hapi_nearest *nearest)
{
  if (nearest == NULL) {
    io->steps = STEPS_MOST; /* no surface is known there: it stays where it is */
    return;
  }
  if (nearest->distance < -io->radius) {
    io->reached = true; /* it is deep in the shape: begin anew */
    return;
  }
  HAPI_ASSERT_UNIT(nearest->normal);
  b->gap = hapi_max(nearest->distance, 0.0);
  hapi_v3_copy(nearest->normal, b->normal);
  hapi_v3_madd(nearest->point_b, b->gap + io->radius, nearest->normal, b->center);
}

bool hapi_ball_search_end(hapi_constrained_ball *b, const hapi_ball_search *io, hapi_nearest *out)
{
  double own[3] = {HUGE_VAL, 0.0, 0.0};
  double way[3];
  const hapi_nearest *nearest = io->near ? &io->nearest : NULL;
  if (io->near) {
    hapi_v3_madd(nearest->point_b, io->radius, nearest->normal, own);
    *out = *nearest;
  }
  if (io->reached || distance_between(own, b->center) < SAME_PLACE) {
    ball_settle(b, io->ball, io->radius, nearest);
    return io->near;
  }
  b->held = true;
  hapi_v3_copy(io->ball, b->ball);
  b->outside = io->near ? nearest->distance + io->radius : HUGE_VAL;
  hapi_v3_sub(io->ball, b->center, way);
  out->distance = hapi_v3_dot(way, b->normal);
  hapi_v3_copy(b->normal, out->normal);
  hapi_v3_madd(b->center, -io->radius, b->normal, out->point_b);
  hapi_v3_madd(out->point_b, out->distance, out->normal, out->point_a);
  return true;
}
