/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/touch_place.h"

#include "local/ball_nearest.h"

typedef struct touch {
  const hapi_patch_contact *in;
  const hapi_touch_frame *a;
  const hapi_touch_frame *b;
  hapi_touch_spot *out;
} touch;

static void frame_point(const hapi_touch_frame *frame, const double local[3], double out[3])
{
  if (frame->pose == NULL) {
    hapi_v3_copy(local, out);
    return;
  }
  hapi_m3_apply(frame->rotation, local, out);
  hapi_v3_add(out, frame->pose->position, out);
}

static void frame_vector(const hapi_touch_frame *frame, const double local[3], double out[3])
{
  if (frame->pose == NULL) {
    hapi_v3_copy(local, out);
    return;
  }
  hapi_m3_apply(frame->rotation, local, out);
}

/* What of a contact belongs to one of its sides. */
typedef struct side {
  const hapi_touch_frame *frame;
  const double *core;
  const double *axis;
  double ball;
  double rim;
} side;

static void add_rim(const side *s, const double direction[3], double out[3])
{
  double axis[3];
  double across[3];
  frame_vector(s->frame, s->axis, axis);
  hapi_v3_madd(direction, -hapi_v3_dot(direction, axis), axis, across);
  double length = hapi_v3_norm(across);
  if (length > 1e-9) {
    hapi_v3_madd(out, s->rim / length, across, out);
  }
}

/* Surface point: ball and rim lie towards direction. */
static inline void surface_point(const side *s, const double direction[3], double out[3])
{
  frame_point(s->frame, s->core, out);
  hapi_v3_madd(out, s->ball, direction, out);
  if (s->rim > 0.0) {
    add_rim(s, direction, out);
  }
}

#define SLIDE_MAX 0.1 /* m between two passes */

/* Limits of hapi_touch_spot.follows: what is left out is of second order over the way and the turn
 * of body_stay.h. */
#define FOLLOW_ASIDE 5e-5 /* m across the normal between the two points */
#define FOLLOW_SLOPE 0.2  /* of what slides against the face */
#define FOLLOW_ACROSS 0.1 /* sine of the angle between crossing edges */

/* The point of the pushed body goes on to where the border of the face is now. */
static void point_slide(const touch *c, double a[3], double b[3])
{
  if (c->in->slide == HAPI_SLIDE_NONE) {
    return;
  }
  bool face_is_a = c->in->touch == HAPI_TOUCH_FACE_A;
  const double *normal = c->out->normal;
  double *fixed = face_is_a ? a : b;
  double *pushed = face_is_a ? b : a;
  double *slope = c->out->slope;
  double edge[3];
  double apart[3];
  double way = 0.0;
  hapi_v3_sub(fixed, pushed, apart);
  frame_vector(face_is_a ? c->b : c->a, face_is_a ? c->in->edge_b : c->in->edge_a, edge);
  if (c->in->slide == HAPI_SLIDE_EDGE) {
    double border[3];
    frame_vector(face_is_a ? c->a : c->b, face_is_a ? c->in->edge_a : c->in->edge_b, border);
    double across = hapi_v3_dot(edge, border);
    way = hapi_v3_dot(apart, border) / across;
    hapi_v3_scale(-hapi_v3_dot(normal, edge) / across, border, slope);
    if (fabs(way) < SLIDE_MAX) { /* false for edges that have become parallel */
      hapi_v3_madd(pushed, way, edge, pushed);
    }
  } else {
    double across = hapi_v3_dot(normal, edge);
    way = -hapi_v3_dot(apart, edge) / across;
    hapi_v3_scale(1.0 / across, edge, slope);
    hapi_v3_sub(slope, normal, slope);
    if (fabs(way) < SLIDE_MAX) {
      hapi_v3_madd(fixed, way, normal, pushed);
    }
  }
  c->out->follows &=
      fabs(way) < SLIDE_MAX && hapi_v3_dot(slope, slope) <= FOLLOW_SLOPE * FOLLOW_SLOPE;
}

static void place_surfaces(const touch *c)
{
  double a[3];
  double b[3];
  double apart[3];
  double back[3];
  const hapi_patch_contact *in = c->in;
  const side side_a = {c->a, in->core_a, in->axis_a, in->ball_a, in->rim_a};
  const side side_b = {c->b, in->core_b, in->axis_b, in->ball_b, in->rim_b};
  hapi_v3_scale(-1.0, c->out->normal, back);
  surface_point(&side_a, back, a);
  surface_point(&side_b, c->out->normal, b);
  point_slide(c, a, b);
  hapi_v3_sub(a, b, apart);
  c->out->gap = hapi_v3_dot(c->out->normal, apart);
  double aside2 = hapi_v3_dot(apart, apart) - c->out->gap * c->out->gap;
  c->out->follows &= !(in->rim_a > 0.0) && !(in->rim_b > 0.0) &&
                     (in->touch != HAPI_TOUCH_EDGES || aside2 <= FOLLOW_ASIDE * FOLLOW_ASIDE);
  hapi_v3_madd(a, -0.5 * c->out->gap, c->out->normal, c->out->of_a);
  switch (in->touch) {
    case HAPI_TOUCH_FACE_A:
      hapi_v3_copy(b, c->out->point);
      break;
    case HAPI_TOUCH_FACE_B:
      hapi_v3_copy(a, c->out->point);
      break;
    case HAPI_TOUCH_EDGES:
    case HAPI_TOUCH_BALL_A:
    case HAPI_TOUCH_BALL_B:
      hapi_v3_copy(c->out->of_a, c->out->point);
      break;
  }
}

/* Crossing edges: the normal turns with both. Edges that have become parallel keep the last one. */
static void edge_normal(const touch *c)
{
  double a[3];
  double b[3];
  double across[3];
  frame_vector(c->a, c->in->edge_a, a);
  frame_vector(c->b, c->in->edge_b, b);
  hapi_v3_cross(a, b, across);
  double length = hapi_v3_norm(across);
  hapi_v3_copy(c->in->normal, c->out->normal);
  if (length > 1e-3) {
    double sign = hapi_v3_dot(across, c->in->normal) < 0.0 ? -1.0 : 1.0;
    hapi_v3_scale(sign / length, across, c->out->normal);
  }
  c->out->follows = length >= FOLLOW_ACROSS;
}

/* A ball is asked anew where it touches the other shape. */
static bool place_ball(const touch *c)
{
  bool ball_is_a = c->in->touch == HAPI_TOUCH_BALL_A;
  const hapi_touch_frame *ball = ball_is_a ? c->a : c->b;
  const hapi_touch_frame *other = ball_is_a ? c->b : c->a;
  double center[3];
  hapi_nearest nearest;
  frame_point(ball, ball_is_a ? c->in->core_a : c->in->core_b, center);
  if (!hapi_ball_nearest(center, ball_is_a ? c->in->ball_a : c->in->ball_b, &c->in->shape,
                         &c->in->shape_pose, other, &nearest)) {
    return false;
  }
  hapi_v3_scale(ball_is_a ? 1.0 : -1.0, nearest.normal, c->out->normal);
  c->out->gap = nearest.distance;
  hapi_v3_madd(nearest.point_a, -0.5 * nearest.distance, nearest.normal, c->out->point);
  hapi_v3_copy(c->out->point, c->out->of_a);
  return true;
}

bool hapi_touch_place(const hapi_patch_contact *in, const hapi_touch_frame *a,
                      const hapi_touch_frame *b, hapi_touch_spot *out)
{
  /* cppcheck-suppress ctuuninitvar ; out is written only, its normal before it is read */
  const touch at = {in, a, b, out};
  const touch *c = &at;
  out->follows = true;
  hapi_v3_set(out->slope, 0.0, 0.0, 0.0);
  switch (c->in->touch) {
    case HAPI_TOUCH_FACE_A:
      frame_vector(c->a, c->in->normal, c->out->normal);
      break;
    case HAPI_TOUCH_FACE_B:
      frame_vector(c->b, c->in->normal, c->out->normal);
      break;
    case HAPI_TOUCH_EDGES:
      edge_normal(c);
      break;
    case HAPI_TOUCH_BALL_A:
    case HAPI_TOUCH_BALL_B:
      return place_ball(c);
  }
  place_surfaces(c);
  return true;
}
