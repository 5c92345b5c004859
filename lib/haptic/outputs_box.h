/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OUTPUTS_BOX_H
#define HAPODE_HAPTIC_OUTPUTS_BOX_H

/* From applications to the loop: what a device shall do beside the wrench. */

#include <stdbool.h>

#include <hapode/outputs.h>

#include "sync/triple_buffer.h"

typedef struct hapi_outputs_box {
  hapi_triple_buffer buffer;
  hap_pointer_outputs places[3]; /* size 0: nothing was set */
  hap_pointer_outputs last;      /* that were set; of the slot's lock; size 0 likewise */
  bool again; /* the loop's: the pointer comes anew, with what was taken before */
} hapi_outputs_box;

#endif
