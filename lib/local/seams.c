/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/seams.h"

#include <math.h>

#include "base/pose.h"
#include "local/ball_nearest.h"
#include "local/pointer_friction.h"
#include "proximity/support.h"

/* A step between two surfaces that is none: of the pointer's radius, and m at most. */
#define ON_SHARE 0.01
#define ON_MOST 1e-4
#define SLIT_MOST 2.0 /* steps: a slit that is wider parts two things; up to there it comes to */
#define REACH 2.0     /* radii: things that are farther have no part in the touch */

/* m, from a ball to the contact's shape; false: it has none that can be asked. */
static bool shape_distance(const hapi_touches *touches, const hapi_local_contact *c,
                           const hapi_local_body *body, const double center[3], double radius,
                           double *out)
{
  hapi_touch_frame frame = {NULL, NULL};
  hapi_nearest nearest;
  if (!hapi_touch_has_shape(c)) {
    return false;
  }
  if (c->asked.told.count > 0) {
    double local[3];
    hapi_body_unpoint(body, center, local);
    if (hapi_triangles_ball(touches->triangles + c->asked.told.first, c->asked.told.count, local,
                            radius, &nearest)) {
      *out = nearest.distance;
      return true;
    }
    return false;
  }
  if (body != NULL) {
    frame = (hapi_touch_frame){&body->pose, body->rotation};
  }
  if (!hapi_ball_nearest(center, radius, &c->asked.shape, &c->asked.pose, &frame, &nearest)) {
    return false;
  }
  *out = nearest.distance;
  return true;
}

/* m, a step between two surfaces that is none. */
static double no_step(double radius)
{
  return fmin(ON_SHARE * radius, ON_MOST);
}

/* True: the point is surely not on the hider's shape. The nearest point of the shape need not be
 * computed then. */
static bool is_far(const hapi_hider *hider, const double point[3])
{
  double way[3];
  hapi_v3_sub(point, hider->middle, way);
  return hapi_v3_dot(way, way) > hider->within * hider->within;
}

/* What the seams of a tick are looked for in. */
typedef struct seam_search {
  const hapi_tick_facts *facts;
  const hapi_pointers *pointers;
  const hapi_bodies *bodies;
  const hapi_touches *touches;
  uint32_t count; /* hiders */
} seam_search;

static hapi_local_contact *contact_of(const seam_search *s, const hapi_hider *hider)
{
  return &s->touches->of[hider->contact];
}

static double radius_of(const seam_search *s, const hapi_hider *hider)
{
  return s->pointers->of[hider->pointer].shape.radius;
}

/* m, from a point to a hider's shape; HUGE_VAL: it is far. */
static double hider_distance(const seam_search *s, const hapi_hider *hider, const double point[3])
{
  const hapi_local_contact *c = contact_of(s, hider);
  double distance = HUGE_VAL;
  if (!is_far(hider, point)) {
    (void)shape_distance(s->touches, c, hapi_bodies_at(s->bodies, c->body), point, 0.0, &distance);
  }
  return distance;
}

/* 0 where two adjoin, 1 where they do not. */
static double seam_parts(const seam_search *s, const hapi_hider *a, const hapi_hider *b)
{
  double step = no_step(radius_of(s, a));
  double slit = hider_distance(s, a, contact_of(s, b)->point_now);
  if (slit > step) {
    slit = fmin(slit, hider_distance(s, b, contact_of(s, a)->point_now));
  }
  return hapi_clamp((slit / step - 1.0) / (SLIT_MOST - 1.0), 0.0, 1.0);
}

/* The same of two that push, which may also hang together by a third one: two of four boxes whose
 * corners meet. */
static double surface_parts(const seam_search *s, const hapi_hider *a, const hapi_hider *b)
{
  double parts = seam_parts(s, a, b);
  bool both = a->depth > 0.0 && b->depth > 0.0;
  for (uint32_t k = 0; k < s->count && both && parts > 0.0; ++k) {
    const hapi_hider *by = &s->touches->hiders[k];
    if (by != a && by != b && by->pointer == a->pointer) {
      double first = seam_parts(s, a, by);
      parts = first < parts ? fmin(parts, fmax(first, seam_parts(s, by, b))) : parts;
    }
  }
  return parts;
}

/* Whether the sphere would not touch the other thing where one alone would hold it. */
static bool hold_clears(const seam_search *s, const hapi_hider *holds, const hapi_hider *other)
{
  const hapi_local_contact *by = contact_of(s, holds);
  const hapi_local_contact *c = contact_of(s, other);
  double radius = radius_of(s, other);
  double held[3];
  double distance;
  hapi_v3_madd(by->point_now, radius, by->normal_now, held);
  return shape_distance(s->touches, c, hapi_bodies_at(s->bodies, c->body), held, radius,
                        &distance) &&
         distance > -no_step(radius);
}

static bool friction_held(const hapi_friction *f, const hapi_local_contact *c, uint64_t tick)
{
  return f->generation == c->generation && f->tick + 1 == tick;
}

static void friction_hand_over(const seam_search *s, const hapi_local_contact *from,
                               const hapi_local_contact *to)
{
  const hapi_touches *touches = s->touches;
  const hapi_pointer *p = &s->pointers->of[to->pointer];
  const hapi_friction *held = hapi_friction_of(touches, from);
  hapi_friction *taker = hapi_friction_of(touches, to);
  const hapi_local_body *body = hapi_bodies_at(s->bodies, to->body);
  const hapi_local_body *before = hapi_bodies_at(s->bodies, from->body);
  double stretch[3];
  double foot[3];
  if (!from->feel.rubs || !to->feel.rubs || !friction_held(held, from, s->facts->tick) ||
      friction_held(taker, to, s->facts->tick)) {
    return;
  }
  hapi_v3_scale(held->left, held->now.stretch_body, stretch);
  if (before != NULL) {
    hapi_quat_rotate(before->pose.quat_wxyz, stretch, stretch);
  }
  if (body != NULL) {
    hapi_quat_unrotate(body->pose.quat_wxyz, stretch, stretch);
  }
  const hapi_rub_place place = {p, body, to->normal_now, foot};
  hapi_friction_foot(p, to->normal_now, to->point_now, foot);
  hapi_friction_resume(taker, s->facts->tick, to, &place, stretch, held->left * held->now.turn);
}

/* Of a sphere, near its pointer. */
static bool is_near(const hapi_local_contact *c, const hapi_pointers *pointers)
{
  return c->placed && c->tool == 0 &&
         c->ramp.depth > -REACH * pointers->of[c->pointer].shape.radius;
}

/* Those that may hide others; returns how many. What is deeper than a contact that is near is near
 * as well. */
static uint32_t hiders_list(const hapi_pointers *pointers, const hapi_bodies *bodies,
                            const hapi_touches *touches)
{
  uint32_t count = 0;
  for (uint32_t i = 0; i < touches->count; ++i) {
    const hapi_local_contact *c = &touches->of[i];
    if (hapi_touch_has_shape(c) && is_near(c, pointers)) {
      double step = no_step(pointers->of[c->pointer].shape.radius);
      bool known = c->asked.told.count == 0;
      hapi_hider *hider = &touches->hiders[count++];
      hapi_body_point(hapi_bodies_at(bodies, c->body), c->asked.pose.position, hider->middle);
      hider->within = known ? hapi_shape_reach(&c->asked.shape) + 2.0 * step : HUGE_VAL;
      hider->depth = c->ramp.depth;
      hider->contact = i;
      hider->pointer = c->pointer;
    }
  }
  return count;
}

/* The deeper one; of two that are as deep, the first. */
static bool goes_before(const hapi_hider *hider, const hapi_local_contact *c, uint32_t index)
{
  return hider->depth > c->ramp.depth || (hider->depth == c->ramp.depth && hider->contact < index);
}

/* shows: 0..1, how much of it is felt still. */
static void contact_hide(const seam_search *s, const hapi_hider *hidden, const hapi_hider *by,
                         double shows)
{
  hapi_local_contact *c = contact_of(s, hidden);
  c->shown = fmin(c->shown, shows);
  if (!(c->shown > 0.0)) {
    friction_hand_over(s, c, contact_of(s, by));
  }
}

/* Mostly there are none: things around a pointer stand apart. */
static bool seams_are_any(const seam_search *s)
{
  const hapi_hider *hiders = s->touches->hiders;
  for (uint32_t i = 1; i < s->count; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      if (hiders[k].pointer == hiders[i].pointer && seam_parts(s, &hiders[k], &hiders[i]) < 1.0) {
        return true;
      }
    }
  }
  return false;
}

/* One against all that are deeper. What one of them hides hides none: of a surface something is
 * left that pushes. */
static void seams_of(const seam_search *s, const hapi_hider *own)
{
  const hapi_local_contact *c = contact_of(s, own);
  for (int turned = 0; turned < 2 && c->shown >= 1.0; ++turned) {
    for (uint32_t k = 0; k < s->count && c->shown > 0.0; ++k) {
      const hapi_hider *deeper = &s->touches->hiders[k];
      const hapi_hider *hidden = turned == 0 ? own : deeper;
      const hapi_hider *by = turned == 0 ? deeper : own;
      if (deeper->pointer != own->pointer || !goes_before(deeper, c, own->contact)) {
        continue;
      }
      double parts = surface_parts(s, deeper, own);
      if (parts < 1.0 && hold_clears(s, by, hidden)) {
        contact_hide(s, hidden, by, parts);
      }
    }
  }
}

void hapi_seams_hide(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_touches *touches)
{
  const seam_search s = {facts, pointers, bodies, touches, hiders_list(pointers, bodies, touches)};
  for (uint32_t i = 0; i < touches->count; ++i) {
    touches->of[i].shown = touches->of[i].is_hidden ? 0.0 : 1.0;
  }
  bool any = seams_are_any(&s);
  for (uint32_t k = 0; k < s.count && any; ++k) {
    seams_of(&s, &touches->hiders[k]);
  }
}
