/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_EFFECTS_H
#define HAPODE_PHYSICS_EFFECTS_H

/* What the effects come to, and other figures. Included by physics_internal.h. */

#include "physics/physics.h"
#include "sync/messages.h"

/* range_error.c: the effect testing=on of model CONTACT */
bool hapi_range_error_wanted(const hapi_physics *physics);
void hapi_range_error_measure(hapi_physics *physics);

/* publish.c: the same inertia about every axis, as of a ball or a cube */
bool hapi_turns_alike(const double inertia[9]);

/* effects.c: figures of the model that goes out */
void hapi_effects_note(hapi_physics *physics, hapi_model *model);

/* counts.c */
void hapi_counts_show(hapi_physics *physics); /* copies the figures for readers */
void hapi_counts_range(hapi_physics *physics, double seconds);

#endif
