/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef EXAMPLE_VR_DEVICE_H
#define EXAMPLE_VR_DEVICE_H

/* A device of hapode that the frame loop feeds with poses, and that gives its force back as one
 * number: what a vibration can tell. The haptic loop takes the newest pose and waits for nobody. */

#include <hapode/device_impl.h>
#include <stdatomic.h>
#include <stdbool.h>

typedef struct vr_sample {
  hap_pose pose;
  hap_twist twist;
  int64_t time_ns;
  bool is_good;
} vr_sample;

/* Zeroed, then vr_device_init. */
typedef struct vr_device {
  vr_sample samples[3]; /* triple buffer: one is written, one read, and the middle one waits */
  atomic_uint middle;   /* its index, and 4 while nobody has read it */
  unsigned back, front;
  hap_pose shown; /* what the haptic loop was told last */
  int64_t shown_ns;
  bool has_shown;
  _Atomic double force; /* N */
} vr_device;

void vr_device_init(vr_device *device);
const hap_device_ops *vr_device_ops(void);

/* [frame loop] A pose at a time of CLOCK_MONOTONIC; not good: tracking or focus is lost. */
void vr_device_put(vr_device *device, const vr_sample *sample);

/* [frame loop] Size of the force on the hand, N. */
double vr_device_force(vr_device *device);

#endif
