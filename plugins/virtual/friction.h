/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_VIRTUAL_FRICTION_H
#define HAPODE_PLUGINS_VIRTUAL_FRICTION_H

/* Coulomb friction on a hand's motion, for each axis. An axis stops at the moment its velocity
 * passes zero, stays while the push is not stronger than the friction, and goes on at the moment it
 * is. Between these moments the step is the hand's exact one, so nothing chatters at any step
 * length. */

#include "plugins/virtual/hand.h"

/* friction in N, >= 0; length in s; push as of hapi_hand_push. */
void hapi_friction_step(hapi_hand *hand, int axis, double friction, double length,
                        const double push[2]);

#endif
