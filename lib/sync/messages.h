/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MESSAGES_H
#define HAPODE_SYNC_MESSAGES_H

/* What the threads tell each other. A message is one block: a header and arrays behind it at
 * offsets, no pointers. Bodies and contacts have slots, small numbers that physics gives out; a
 * slot's generation tells one user of the slot from the next. World frame, SI.
 *
 *   physics -> haptic    hapi_model    bodies, pointer contacts, joints
 *   haptic  -> physics   hapi_state    where they are now, what was exchanged
 *   physics -> contact   hapi_near     geoms and pairs near the pointers   (model CONTACT)
 *   haptic  -> contact   hapi_poses    newest poses of the bodies          (model CONTACT)
 *   contact -> haptic    hapi_patches  contacts between bodies             (model CONTACT) */

#include "sync/model.h"
#include "sync/near.h"
#include "sync/patches.h"
#include "sync/state.h"

#endif
