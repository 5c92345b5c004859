/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOUCH_FEEL_H
#define HAPODE_LOCAL_TOUCH_FEEL_H

/* Contacts with a surface of their own (hapode/surface.h). */

#include <math.h>

#include "base/vec.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* N/m */
static inline double hapi_touch_stiffness(const hapi_local_contact *c, const hapi_pointer *p)
{
  return c->feel.special ? c->feel.stiffness : p->surface.stiffness;
}

/* N s/m */
static inline double hapi_touch_damping(const hapi_local_contact *c, const hapi_pointer *p)
{
  return c->feel.special ? c->feel.damping : p->surface.damping;
}

/* How much softer than the pointer's own spring it is. */
static inline double hapi_touch_softer(const hapi_local_contact *c, const hapi_pointer *p)
{
  bool other = c->feel.special && c->feel.stiffness > 0.0;
  return other ? p->surface.stiffness / c->feel.stiffness : 1.0;
}

/* Along which the contact pushes the pointer, by its force along the geom's normal. */
static inline const double *hapi_touch_push(const hapi_local_contact *c)
{
  return c->feel.special ? c->feel.lift.push : c->normal_now;
}

/* N, the normal force that friction goes by, before friction is added: with what sticks. */
static inline double hapi_touch_load(const hapi_local_contact *c)
{
  return c->feel.special ? hapi_max(c->feel.pull - hapi_v3_dot(c->force, c->normal_now), 0.0)
                         : hapi_v3_norm(c->force);
}

/* Whether spring and damper act at that depth [m]. */
static inline bool hapi_touch_acts(const hapi_local_contact *c, double depth)
{
  return depth > 0.0 || c->feel.sticks;
}

/* m, by which the spring is longer or shorter than without a force. */
static inline double hapi_touch_strain(const hapi_local_contact *c, double depth)
{
  return c->feel.sticks ? fabs(depth) : depth;
}

/* What a message says of a contact. */
typedef struct hapi_feel_told {
  double mu;
  uint32_t number;
  uint32_t wishes;
  bool goes_on; /* the contact was there before */
} hapi_feel_told;

/* Before the contacts of the model are adopted. */
void hapi_feels_adopt(hapi_touches *touches, hapi_model *model);

void hapi_touch_feel_adopt(hapi_touches *touches, const hapi_feel_told *told,
                           hapi_local_contact *c);

/* A contact that stays as it is while the pairs have changed. */
void hapi_touch_feel_find(const hapi_touches *touches, hapi_local_contact *c);

#endif
