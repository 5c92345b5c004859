/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_POINTER_FRICTION_H
#define HAPODE_LOCAL_POINTER_FRICTION_H

/* Friction of a pointer contact: a spring from a point that is fixed in the pointer to one that is
 * fixed in the body, along the surface, and with a soft finger about the normal too
 * (docs/decisions/friction.md). Sliding and turning are one vector of four numbers: along the
 * surface in world axes [m], and the turn about the normal times the finger's radius [m]. Its
 * spring and damper are those of the contact, whatever the direction, and its force is within a
 * ball of mu times the normal force. Each point of a hull has its own. */

#include <stdbool.h>

#include "base/vec.h"
#include "local/facts.h"
#include "local/rows.h"
#include "local/tool_friction.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* Of a ball: the point of the surface below it, whatever point of the plane was given. Of a hull:
 * the point. */
static inline void hapi_friction_foot(const hapi_pointer *p, const double normal[3],
                                      const double point[3], double out[3])
{
  double apart[3];
  if (p->shape.hull != NULL) {
    hapi_v3_copy(point, out);
    return;
  }
  hapi_v3_sub(p->pose.position, point, apart);
  hapi_v3_madd(p->pose.position, -hapi_v3_dot(normal, apart), normal, out);
}

/* Where the contact's friction stands in this tick, but for the axes; NULL: it has none. Once in
 * each tick in which the contact is closed: after one without, it begins anew; a point of a hull
 * with what the others of its pair hold. bodies: of those. */
hapi_friction *hapi_friction_begin(const hapi_touches *touches, const hapi_bodies *bodies,
                                   uint64_t tick, const hapi_local_contact *contact,
                                   const hapi_rub_place *at);

/* As if the contact had been closed in the tick before, with its spring that long: for a tick that
 * is begun in the midst of something. stretch_body: m, of the pointer ahead of the body, in the
 * body's frame; turn: rad. */
void hapi_friction_resume(hapi_friction *f, uint64_t tick, const hapi_local_contact *contact,
                          const hapi_rub_place *at, const double stretch_body[3], double turn);

/* Sets the axes along the force that there is when all sticks. lead: how far the spring's is
 * foreseen, with the speed and what the pointer gets of it besides (m/s; NULL: nothing): where
 * pointer or body follow the force within the tick, only that tells where they slide. */
void hapi_friction_aim(hapi_friction *f, double lead, const double gain[3]);

/* The force of spring and damper on the body, at most limit [N]: for those who know the normal
 * force. */
void hapi_friction_push(const hapi_friction *f, double limit, double out[4]);

/* The same as force and torque about a point. */
void hapi_friction_wrench(const hapi_friction *f, const hapi_pointer *p, const double push[4],
                          const double point[3], hap_wrench *out);

/* Once the force of the tick is known: a contact that slides drags the body's anchor along. */
void hapi_friction_end(hapi_friction *f, const double push[4], double limit);

/* Once the rows are solved: adds friction to the normal force on the body, and its torque on the
 * hand. */
void hapi_friction_rub(const hapi_touches *touches, const hapi_rows *rows,
                       const hapi_tick_facts *facts, hapi_local_contact *c, hapi_pointer *pointer);

/* J in the contact's spring. */
double hapi_friction_energy(const hapi_touches *touches, uint64_t tick,
                            const hapi_local_contact *contact);

#endif
