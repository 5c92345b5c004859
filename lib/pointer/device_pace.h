/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_DEVICE_PACE_H
#define HAPODE_POINTER_DEVICE_PACE_H

/* How often a device tells another position: the lower median of the newest intervals between two.
 * Of eight, up to three false ones in a row do not move it out of the range of the others. Longer
 * ones are not rare either: a device that rested looks like a slow one for once. Zeroed: nothing
 * is known. */

#include <stdint.h>

#define HAPI_DEVICE_PACE_GAPS 8

typedef struct hapi_device_pace {
  double gap;                         /* s, between two positions; 0: not known yet */
  uint32_t noted;                     /* goes on counting modulo the ring, once that is full */
  double gaps[HAPI_DEVICE_PACE_GAPS]; /* s, a ring */
} hapi_device_pace;

/* Takes the time between two positions in s. A longer one than HAPI_SAFETY_GAP_MOST_S is rest, and
 * says nothing. */
void hapi_device_pace_note(hapi_device_pace *pace, double seconds);

/* From now on it is taken to be so, whatever was before. */
void hapi_device_pace_set(hapi_device_pace *pace, double seconds);

#endif
