/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_EFFECTS_H
#define HAPODE_ACCURACY_EFFECTS_H

/* Which effects the model that goes out has, and why not the others. */

#include <hapode/effects.h>

#include "base/effect_figures.h"
#include "near/near.h"
#include "probe/answers.h"
#include "sync/messages.h"
#include "world/cycle.h"
#include "world/world.h"

/* Figures of the model that goes out. */
void hapi_effects_note(hapi_effect_figures out[HAP_EFFECTS], const hapi_cycle *cycle,
                       const hapi_world *world, const hapi_nearby *near,
                       const hapi_answers *answers, hapi_model *model);

#endif
