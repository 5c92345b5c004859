/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "near/near.h"

/* Which bodies rest on the loop's, judged by the boxes of their geoms. At the border of the range
 * the loop holds those, and the world holds all others. For the first interval of a body at the
 * border this is a guess (brace.h); later it is measured. */

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
  bool above = hapi_v3_dot(up, dBodyGetPosition(link->body)) > box_top(own, up);
  for (int k = 0; k < 3; ++k) { /* a link may be to what comes near later */
    own[2 * k] -= TOUCH;
    own[2 * k + 1] += TOUCH;
  }
  return above && hapi_boxes_meet(own, other);
}
