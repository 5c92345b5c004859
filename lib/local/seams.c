/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/seams.h"

#include <math.h>

#include "base/pose.h"
#include "local/ball_nearest.h"
#include "local/pointer_friction.h"

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

static bool contact_hides(const hapi_touches *touches, const hapi_local_contact *by,
                          const hapi_local_contact *c, const hapi_pointer *p,
                          const hapi_bodies *bodies)
{
  double radius = p->shape.radius;
  double step = fmin(ON_SHARE * radius, ON_MOST);
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

/* The deeper one; of two that are as deep, the first. */
static bool goes_before(const hapi_local_contact *a, const hapi_local_contact *b)
{
  return a->ramp.depth > b->ramp.depth || (a->ramp.depth == b->ramp.depth && a < b);
}

/* Of a sphere, near its pointer. */
static bool is_near(const hapi_local_contact *c, const hapi_pointers *pointers)
{
  return c->placed && c->tool == 0 &&
         c->ramp.depth > -REACH * pointers->of[c->pointer].shape.radius;
}

/* Those that may hide others, by their next_hider; returns the first one. What is deeper than a
 * contact that is near is near as well. */
static uint32_t hiders_list(const hapi_pointers *pointers, const hapi_touches *touches)
{
  uint32_t first = HAPI_SLOT_NONE;
  for (uint32_t i = touches->count; i > 0; --i) {
    hapi_local_contact *c = &touches->of[i - 1];
    if (hapi_touch_has_shape(c) && is_near(c, pointers)) {
      c->next_hider = first;
      first = i - 1;
    }
  }
  return first;
}

void hapi_seams_hide(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                     const hapi_bodies *bodies, const hapi_touches *touches)
{
  uint32_t first = hiders_list(pointers, touches);
  for (uint32_t i = 0; i < touches->count; ++i) {
    hapi_local_contact *c = &touches->of[i];
    const hapi_pointer *p = &pointers->of[c->pointer];
    c->hidden = c->is_hidden;
    if (first == HAPI_SLOT_NONE || !is_near(c, pointers)) {
      continue;
    }
    for (uint32_t k = first; k != HAPI_SLOT_NONE && !c->hidden; k = touches->of[k].next_hider) {
      const hapi_local_contact *by = &touches->of[k];
      if (k != i && by->pointer == c->pointer && goes_before(by, c) &&
          contact_hides(touches, by, c, p, bodies)) {
        c->hidden = true;
        friction_hand_over(facts, p, bodies, touches, c, by);
      }
    }
  }
}
