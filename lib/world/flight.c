/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/vec.h"
#include "world/world.h"

/* ODE moves a body by its velocity at the end of a step. What nothing touches goes a/2 step_s^2 too
 * far with each step: after a fall of a second at 20 Hz it is 25 ms early. Such a body is put back
 * by that before the step, and comes to where it would be without steps. What touches anything or
 * hangs on a joint is left as it is: there the velocity at the end is the one that is right. */

static bool body_flies(const hapi_known_body *known)
{
  return known->body != NULL && !known->jointed && dBodyGetJoint(known->body, 0) == NULL &&
         dBodyIsEnabled(known->body) && !dBodyIsKinematic(known->body);
}

/* False: there is none. */
static bool flight_acceleration(dBodyID body, const double gravity[3], double out[3])
{
  dMass mass;
  dBodyGetMass(body, &mass);
  hapi_v3_scale(1.0 / mass.mass, dBodyGetForce(body), out);
  if (dBodyGetGravityMode(body) != 0) {
    hapi_v3_add(out, gravity, out);
  }
  return out[0] != 0.0 || out[1] != 0.0 || out[2] != 0.0;
}

void hapi_flight_prepare(const hapi_world *world, double step_s)
{
  dVector3 gravity;
  dWorldGetGravity(world->ode.world, gravity);
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    const hapi_known_body *known = &world->bodies.entries[i];
    double at[3];
    double acceleration[3];
    if (body_flies(known) && flight_acceleration(known->body, gravity, acceleration)) {
      hapi_v3_madd(dBodyGetPosition(known->body), -0.5 * step_s * step_s, acceleration, at);
      dBodySetPosition(known->body, at[0], at[1], at[2]);
    }
  }
}
