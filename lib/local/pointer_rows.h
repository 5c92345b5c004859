/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_POINTER_ROWS_H
#define HAPODE_LOCAL_POINTER_ROWS_H

/* Contacts of pointers as rows, model CONTACT. */

#include "base/effect_clock.h"
#include "local/body.h"
#include "local/facts.h"
#include "local/rows.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* A contact of a pointer where it is in this tick. */
typedef struct hapi_placed_pointer {
  uint32_t index; /* of the contact */
  hapi_pointer *pointer;
  hapi_local_body *body; /* NULL: static world */
  const double *normal;  /* out of the body: normal_now and point_now of the contact */
  const double *point;
  const double *push; /* of a force of 1 N along the normal; other than it where there is texture */
  double depth;
  double share; /* of the stiffness, that is felt */
  double j[6];  /* of the body, of a force into it at the point; NULL: the force alone */
  double w;     /* m/s, along it before the tick */
  double own;   /* m/s, likewise of the pointer, with nothing in touch */
  double arm
      [3]; /* from the pointer's origin to the point; of a sphere 0: it pushes through its centre */
} hapi_placed_pointer;

/* The contacts of hulls have been placed. */
void hapi_pointer_rows(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                       const hapi_bodies *bodies, hapi_touches *touches, hapi_rows *rows,
                       hapi_effect_sample *sample);

/* The rows of a contact's friction, after that of its normal. */
void hapi_pointer_friction_rows(const hapi_tick_facts *facts, const hapi_bodies *bodies,
                                const hapi_touches *touches, hapi_rows *rows,
                                const hapi_placed_pointer *at);

/* Rows of god-objects that have been let go. */
void hapi_pointers_brake(const hapi_pointers *pointers, hapi_rows *rows);

#endif
