/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_EXPLAINED_H
#define HAPODE_LOCAL_EXPLAINED_H

/* By how much a contact's force may change in a tick: the guard holds it against the change that
 * came. A spring k with a damper d makes, on a way of the pointer and of the surface,
 *
 *   |f' - f| <= k (|dx| + T |u|) + d (|dv| + |du|)
 *
 * with dx and dv of the pointer, and u the velocity of the surface where it is touched. A damper
 * that begins or ends adds d (|v| + |u|), and a contact that comes in slowly its force in its time.
 * A texture pushes along a vector q that is no unit vector, f q with f = k (depth + height) and the
 * damper d (q v) q, so that each of them gets its factor of |q|, and what height and q change in
 * the tick adds
 *
 *   k |q| |dh| + f |dq| + 2 d |q| |dq| |v|
 *
 * Sums of absolute values stand for norms: they are larger, and need no root. */

#include <math.h>

#include "base/safety.h"
#include "base/vec.h"
#include "local/body.h"
#include "local/touch.h"
#include "local/touch_feel.h"
#include "pointer/pointer.h"

static inline double hapi_sum_of_sizes(const double v[3])
{
  return fabs(v[0]) + fabs(v[1]) + fabs(v[2]);
}

static inline void hapi_explained_begin(hapi_pointer *p)
{
  p->guard.change.before = p->guard.change.explained;
  memset(&p->guard.change.explained, 0, sizeof p->guard.change.explained);
}

/* Of a contact that pushes; its damper begins with a depth above 0. depth: m, without a texture.
 * body: after its step; NULL: it
 * does not move. */
static inline void hapi_contact_explain(hapi_pointer *p, const hapi_local_contact *c, double depth,
                                        const hapi_local_body *body, double period)
{
  hapi_explained *e = &p->guard.change.explained;
  depth += c->feel.special ? c->feel.lift.height : 0.0;
  double k = c->weight * (p->rigid ? p->coupling.stiffness : hapi_touch_stiffness(c, p));
  double d = !hapi_touch_acts(c, depth)
                 ? 0.0
                 : c->weight * (p->proxied ? p->coupling.damping : hapi_touch_damping(c, p));
  double comes = 0.0;
  if (c->ramp.felt_stiffness > 0.0) { /* one that is set changes in its time */
    double added = fabs(hapi_touch_stiffness(c, p) - c->ramp.felt_stiffness);
    e->world += c->weight * added * fmax(depth, 0.0);
  }
  if (c->feel.special) {
    double push = hapi_v3_norm(c->feel.lift.push) + c->feel.turned; /* now or before, at most */
    e->world += k * (push * c->feel.lifted + fmax(depth, 0.0) * c->feel.turned);
    e->world += 2.0 * d * push * c->feel.turned * hapi_sum_of_sizes(p->twist.linear);
    k *= push;
    d *= push * push;
  }
  e->stiffness += k;
  e->damping += d;
  if (c->ramp.share < 1.0) {
    comes = fmax(depth, 0.0) / HAPI_SAFETY_CONTACT_RAMP_S;
  }
  if (c->ramp.excess > 0.0 && !c->ramp.held) {
    comes += HAPI_SAFETY_CONTACT_SPEED;
  }
  if (body == NULL) {
    e->world += k * period * comes;
    return;
  }
  double arm[3];
  double now[3];
  double before[3];
  double change[3];
  hapi_v3_sub(c->point_now, body->pose.position, arm);
  hapi_v3_cross(body->twist.angular, arm, now);
  hapi_v3_add(now, body->twist.linear, now);
  hapi_v3_cross(body->start_twist + 3, arm, before);
  hapi_v3_add(before, body->start_twist, before);
  hapi_v3_sub(now, before, change);
  double changes = hapi_sum_of_sizes(change);
  e->world += k * period * (comes + hapi_sum_of_sizes(now) + changes) + d * changes;
  e->speed = hapi_max(hapi_sum_of_sizes(now) + changes, e->speed); /* NaN does not count */
}

#endif
