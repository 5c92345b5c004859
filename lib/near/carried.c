/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "near/near.h"

/* What rests on a body of the loop, by its geoms' boxes: at the border of the range that is held by
 * the loop, and other bodies by the world. In the interval in which a body comes to the border
 * nobody has seen which. */

#define TOUCH 1e-3 /* m, between boxes */

/* Unit; false: there is no gravity. */
static bool find_up(const hapi_nearby *nearby, double out[3])
{
  dVector3 gravity;
  dWorldGetGravity(nearby->world->ode.world, gravity);
  double size = dCalcVectorLength3(gravity);
  if (!(size > 0.0)) {
    return false;
  }
  hapi_v3_scale(-1.0 / size, gravity, out);
  return true;
}

/* m, along the direction: how far the box reaches. */
static double box_top(const dReal box[6], const double up[3])
{
  double top = 0.0;
  for (int k = 0; k < 3; ++k) {
    top += up[k] * (up[k] > 0.0 ? box[2 * k + 1] : box[2 * k]);
  }
  return top;
}

/* A link may be to what comes near later. */
static bool boxes_touch(const dReal a[6], const dReal b[6])
{
  bool touch = true;
  for (int k = 0; k < 3; ++k) {
    touch = touch && a[2 * k] <= b[2 * k + 1] + TOUCH && b[2 * k] <= a[2 * k + 1] + TOUCH;
  }
  return touch;
}

bool hapi_link_is_carried(const hapi_nearby *nearby, const hapi_link *link)
{
  double up[3];
  dReal own[6];
  dReal other[6];
  if (link->body == NULL || dBodyIsKinematic(link->body) || !find_up(nearby, up)) {
    return false;
  }
  dGeomGetAABB(link->own, own);
  dGeomGetAABB(link->other, other);
  return boxes_touch(own, other) &&
         hapi_v3_dot(up, dBodyGetPosition(link->body)) > box_top(own, up);
}
