/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_RULE_H
#define HAPODE_CONTACT_RULE_H

/* A contact is a rule of where the touch is, wherever the two bodies go: a corner on a face, an
 * edge on the border of a face. Of bodies that slide on each other most rules stay, and with the
 * number of the contact the loop keeps rows, impulses and packs. */

#include <stdbool.h>

#include "sync/patches.h"

/* An angle between directions, of what tells one in world axes for its sign. */
#define HAPI_RULE_TURN 0.05

/* Whether two contacts of the same two geoms are the same rule: the same corner, line or plane of
 * each, but for rounding, wherever the bodies are. way [m]: so far crossing edges may meet from
 * where they met. Surfaces are not looked at. */
bool hapi_rule_is_same(const hapi_patch_contact *x, const hapi_patch_contact *y, double way);

/* Whether both are of one face of the same body. */
bool hapi_rule_is_of_face(const hapi_patch_contact *x, const hapi_patch_contact *y);

#endif
