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
#define REACH 2.0 /* radii: things that are farther have no part in the touch */

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

static bool contact_hides(const hapi_touches *touches, const hapi_local_contact *by,
                          const hapi_local_contact *c, const hapi_pointer *p,
                          const hapi_bodies *bodies)
{
  double radius = p->shape.radius;
  double step = no_step(radius);
  double held[3];
  double distance;
  if (!shape_distance(touches, by, hapi_bodies_at(bodies, by->body), c->point_now, 0.0,
                      &distance) ||
      distance > step) {
    return false;
  }
  hapi_v3_madd(by->point_now, radius, by->normal_now, held);
  return shape_distance(touches, c, hapi_bodies_at(bodies, c->body), held, radius, &distance) &&
         distance > -step;
}

static bool friction_held(const hapi_friction *f, const hapi_local_contact *c, uint64_t tick)
{
  return f->generation == c->generation && f->tick + 1 == tick;
}

static void friction_hand_over(const hapi_tick_facts *facts, const hapi_pointer *p,
                               const hapi_bodies *bodies, const hapi_touches *touches,
                               const hapi_local_contact *from, const hapi_local_contact *to)
{
  const hapi_friction *held = hapi_friction_of(touches, from);
  hapi_friction *taker = hapi_friction_of(touches, to);
  const hapi_local_body *body = hapi_bodies_at(bodies, to->body);
  const hapi_local_body *before = hapi_bodies_at(bodies, from->body);
  double stretch[3];
  double foot[3];
  if (!from->feel.rubs || !to->feel.rubs || !friction_held(held, from, facts->tick) ||
      friction_held(taker, to, facts->tick)) {
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
  hapi_friction_resume(taker, facts->tick, to, &place, stretch, held->left * held->now.turn);
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

/* True: the point is surely not on the hider's shape. The nearest point of the shape need not be
 * computed then. */
static bool is_far(const hapi_hider *hider, const double point[3])
{
  double way[3];
  hapi_v3_sub(point, hider->middle, way);
  return hapi_v3_dot(way, way) > hider->within * hider->within;
}

void hapi_seams_hide(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_touches *touches)
{
  uint32_t count = hiders_list(pointers, bodies, touches);
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    const hapi_pointer *p = &pointers->of[c->pointer];
    c->hidden = c->is_hidden;
    if (count == 0 || !is_near(c, pointers)) {
      continue;
    }
    for (uint32_t k = 0; k < count && !c->hidden; ++k) {
      const hapi_hider *hider = &touches->hiders[k];
      if (!is_far(hider, c->point_now) && hider->pointer == c->pointer &&
          goes_before(hider, c, i) &&
          contact_hides(touches, &touches->of[hider->contact], c, p, bodies)) {
        c->hidden = true;
        friction_hand_over(facts, p, bodies, touches, c, &touches->of[hider->contact]);
      }
    }
  }
}
