/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_TARGET_H
#define HAPODE_HAPTIC_TARGET_H

#include <stdint.h>

#include <hapode/spatial.h>

/* Where a pointer without a device is to be. */
typedef struct hapi_pointer_target {
  hap_pose pose;
  hap_twist twist;
  int64_t told_ns;    /* it goes on from then, */
  int64_t carried_ns; /* so long; then it stands. 0: it is as it was told */
} hapi_pointer_target;

#endif
