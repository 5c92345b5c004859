/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_SETTINGS_BOX_H
#define HAPODE_HAPTIC_SETTINGS_BOX_H

/* From applications to the loop: what is set while a pointer runs. */

#include "base/pointer_setup.h"
#include "sync/messages.h"
#include "sync/triple_buffer.h"

/* Hand-over of what is set. Several settings between two ticks are one: each bit of the mask has
 * the number of the setting that had it last. */
typedef struct hapi_pointer_wishes {
  hapi_pointer_setting value;
  hapi_tool_hull hull; /* of HAP_SET_SHAPE */
  uint32_t numbers[HAPI_SET_BITS];
} hapi_pointer_wishes;

typedef struct hapi_pointer_settings_box {
  hapi_triple_buffer buffer;
  hapi_pointer_wishes places[3];
  hapi_pointer_wishes newest; /* of the application, under the slot's lock */
  /* Of the loop: */
  uint32_t taken[HAPI_SET_BITS];
  uint32_t swaps; /* HAPI_SET_SWAP bits that wait until no force is felt, of: */
  hapi_pointer_setup next;
  hapi_tool_hull next_hull;
  uint32_t shape; /* number of the shape, see base/pointer_setup.h */
} hapi_pointer_settings_box;

#endif
