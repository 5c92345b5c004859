/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_EFFECTS_H
#define HAPODE_ACCURACY_EFFECTS_H

/* Which effects the model that goes out has, and why not the others. */

#include "sync/messages.h"

typedef struct hapi_physics hapi_physics;

/* Figures of the model that goes out. */
void hapi_effects_note(hapi_physics *physics, hapi_model *model);

#endif
