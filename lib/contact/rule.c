/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/rule.h"

#include <math.h>

#include "base/vec.h"

#define SAME_NEAR 1e-10 /* m */
#define SAME_TURN 1e-9  /* of a component of a direction */

static bool vectors_agree(const double x[3], const double y[3], double most)
{
  return fabs(x[0] - y[0]) <= most && fabs(x[1] - y[1]) <= most && fabs(x[2] - y[2]) <= most;
}

static bool same_plane(const double x[3], const double y[3], const double normal[3])
{
  double apart[3];
  hapi_v3_sub(x, y, apart);
  return fabs(hapi_v3_dot(apart, normal)) <= SAME_NEAR;
}

static bool same_line(const double x[3], const double y[3], const double along[3])
{
  static const double zero[3] = {0.0, 0.0, 0.0};
  double apart[3];
  double off[3];
  hapi_v3_sub(x, y, apart);
  hapi_v3_cross(apart, along, off);
  return vectors_agree(off, zero, SAME_NEAR);
}

/* What hapi_touch_place goes by, and hapi_slide. */
static bool places_agree(const hapi_patch_contact *x, const hapi_patch_contact *y, double way)
{
  bool face_is_a = x->touch == HAPI_TOUCH_FACE_A;
  const double *face[2] = {face_is_a ? x->core_a : x->core_b, face_is_a ? y->core_a : y->core_b};
  const double *on_it[2] = {face_is_a ? x->core_b : x->core_a, face_is_a ? y->core_b : y->core_a};
  const double *side = face_is_a ? x->edge_a : x->edge_b;
  const double *edge = face_is_a ? x->edge_b : x->edge_a;
  if (x->touch == HAPI_TOUCH_BALL_A || x->touch == HAPI_TOUCH_BALL_B) {
    bool ball_is_a = x->touch == HAPI_TOUCH_BALL_A;
    return vectors_agree(ball_is_a ? x->core_a : x->core_b, ball_is_a ? y->core_a : y->core_b,
                         SAME_NEAR);
  }
  if (x->touch == HAPI_TOUCH_EDGES) {
    return vectors_agree(x->core_a, y->core_a, way) && vectors_agree(x->core_b, y->core_b, way) &&
           same_line(x->core_a, y->core_a, x->edge_a) && same_line(x->core_b, y->core_b, x->edge_b);
  }
  switch (x->slide) {
    case HAPI_SLIDE_EDGE:
      return same_line(on_it[0], on_it[1], edge) && same_plane(face[0], face[1], side) &&
             same_plane(face[0], face[1], x->normal);
    case HAPI_SLIDE_CORNER:
      return same_plane(on_it[0], on_it[1], edge) && vectors_agree(face[0], face[1], SAME_NEAR);
    case HAPI_SLIDE_NONE:
      break;
  }
  return vectors_agree(on_it[0], on_it[1], SAME_NEAR) && same_plane(face[0], face[1], x->normal);
}

/* A ball's rule has the other shape in it, which is the same one, as the pair has not changed. */
bool hapi_rule_is_same(const hapi_patch_contact *x, const hapi_patch_contact *y, double way)
{
  bool turns = x->touch == HAPI_TOUCH_EDGES; /* the normal is there for its sign */
  bool ball = x->touch == HAPI_TOUCH_BALL_A || x->touch == HAPI_TOUCH_BALL_B;
  bool slides = x->touch == HAPI_TOUCH_EDGES || x->slide != HAPI_SLIDE_NONE;
  return x->touch == y->touch && x->slide == y->slide && x->body_a == y->body_a &&
         x->generation_a == y->generation_a && x->body_b == y->body_b &&
         x->generation_b == y->generation_b && x->ball_a == y->ball_a && x->ball_b == y->ball_b &&
         x->rim_a == y->rim_a && x->rim_b == y->rim_b &&
         (ball || vectors_agree(x->normal, y->normal, turns ? HAPI_RULE_TURN : SAME_TURN)) &&
         (!slides || (vectors_agree(x->edge_a, y->edge_a, SAME_TURN) &&
                      vectors_agree(x->edge_b, y->edge_b, SAME_TURN))) &&
         places_agree(x, y, way);
}

bool hapi_rule_is_of_face(const hapi_patch_contact *x, const hapi_patch_contact *y)
{
  return x->touch == y->touch && (x->touch == HAPI_TOUCH_FACE_A || x->touch == HAPI_TOUCH_FACE_B) &&
         vectors_agree(x->normal, y->normal, SAME_TURN);
}
