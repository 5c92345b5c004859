/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_ACCELERANCE_H
#define HAPODE_PROBE_ACCELERANCE_H

/* A and b by testing simulations: of contacts (eq. 3-6), and of whole bodies in model CONTACT. */

#include <ode/ode.h>

#include "near/slots.h"
#include "probe/admittance.h"

typedef struct hapi_physics hapi_physics;

/* Share of the weight that a probe uses at least where the pointer gave no force yet (eq. 4 would
 * divide by zero). */
#define HAPI_PROBE_FLOOR 0.01

/* accelerance.c */
/* Of a dynamic body at a rotation of ODE's. */
void hapi_accelerance_free_body(dBodyID body, const dReal rotation[12], hapi_free_body *out);
void hapi_accelerance_measure(hapi_physics *physics);
/* N, of the next testing simulations; their directions are of the contact. */
double hapi_accelerance_push(hapi_physics *physics, const hapi_contact_slot *contact);

/* operating_point.c */
void hapi_operating_point_measure(hapi_physics *physics);

#endif
