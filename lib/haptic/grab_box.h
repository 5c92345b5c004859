/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_GRAB_BOX_H
#define HAPODE_HAPTIC_GRAB_BOX_H

/* From applications to the loop: what a pointer is to hold. */

#include "base/grab_setup.h"
#include "sync/triple_buffer.h"

typedef struct hapi_grab_box {
  hapi_triple_buffer buffer;
  hapi_grab_setup places[3];
  uint32_t serials; /* of the application, under the slot's lock */
} hapi_grab_box;

#endif
