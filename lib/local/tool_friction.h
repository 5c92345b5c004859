/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOOL_FRICTION_H
#define HAPODE_LOCAL_TOOL_FRICTION_H

#include "local/body.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* Where a contact rubs. */
typedef struct hapi_rub_place {
  const hapi_pointer *pointer;
  const hapi_local_body *body; /* NULL: static world */
  const double *normal;        /* out of the body */
  const double *foot;          /* of the surface, below the pointer: hapi_friction_foot */
} hapi_rub_place;

/* Stretch [m; rad] with which a point of a hull begins; of a sphere none. */
void hapi_tool_friction_begin(const hapi_touches *touches, const hapi_bodies *bodies, uint64_t tick,
                              const hapi_local_contact *contact, const hapi_rub_place *at,
                              double out[4]);

#endif
