/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_GRAB_ROWS_H
#define HAPODE_LOCAL_GRAB_ROWS_H

/* The springs between pointers and what they hold, after hapi_grabs_place. */

#include "local/facts.h"
#include "local/rows.h"
#include "local/touch.h"
#include "pointer/pointer.h"

#define HAPI_GRAB_ROWS 6u /* of a pointer */

/* Model CONTACT: rows of the solver, and after the solve their forces, on the hand too. */
void hapi_grab_rows(const hapi_pointers *pointers, const hapi_bodies *bodies, hapi_rows *rows,
                    double period);
void hapi_grab_forces(const hapi_pointers *pointers, const hapi_bodies *bodies,
                      hapi_touches *touches, const hapi_rows *rows, double period);

/* Model SINGLE: forces of the springs as they are at the tick, on hands and bodies. */
void hapi_grab_push(const hapi_tick_facts *facts, const hapi_pointers *pointers,
                    const hapi_bodies *bodies, hapi_touches *touches);

/* J/s that the motion of the body does on the pointer's spring; mean: with the mean of its
 * velocities in this tick, as its energy goes. */
double hapi_grab_power(const hapi_grab *grab, const hapi_local_body *body, bool mean);

#endif
