/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_IMPL_H
#define HAPODE_DEVICE_IMPL_H

/* For people who write a device. Copy plugins/virtual as a start.
 *
 * Threads: open, describe, start, stop and close are called by the application's thread, read and
 * write by the haptic thread (in lockstep all by one thread), zero by any thread. A session calls
 * start, then read and write once a tick in this order, then, when the haptic thread has let go of
 * the device, zero and stop. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Goes up when a member of hap_device_ops changes its meaning. */
#define HAP_DEVICE_ABI 1u

typedef enum hap_device_pacing {
  HAP_PACING_VIRTUAL = 0, /* lives in the time it is given; may run in lockstep */
  HAP_PACING_HOST = 1,    /* answers at once with its newest state; the loop sleeps */
  HAP_PACING_DEVICE = 2   /* read blocks until the device's own tick */
} hap_device_pacing;

typedef struct hap_device_ops {
  uint32_t abi;     /* HAP_DEVICE_ABI; checked before any other member */
  uint32_t size;    /* sizeof(hap_device_ops) of the device's build */
  const char *name; /* of the spec, [a-z0-9_-] */
  const char *help; /* one line: what it is and its arguments */
  uint32_t pacing;  /* hap_device_pacing */

  /* May block, may allocate. args is the text after "name:" or "" and is not kept. On failure
   * *self stays NULL and detail (never NULL) says why. */
  hap_status (*open)(const char *args, void **self, hap_detail *detail);

  /* Fills *out, which arrives zeroed; .name may be left empty. Never fails, never blocks. */
  void (*describe)(void *self, hap_device_info *out);

  /* Energises the device with zero force. May block. */
  hap_status (*start)(void *self);

  /* Pose and twist of the end effector in the device's frame at time_ns (for pacing DEVICE: not
   * later than time_ns). Never blocks except for pacing DEVICE, never allocates. On an error the
   * outputs are not used and the session latches a fault and calls zero. It goes on reading: a device that
   * was unplugged may answer again, and is used again after hap_session_reset_fault; start is not called
   * in between. buttons: bit 0 is the first one. */
  hap_status (*read)(void *self, int64_t time_ns, hap_pose *pose, hap_twist *twist,
                     uint32_t *buttons);

  /* Wrench on the hand in the device's frame, held until the next write. Never blocks, never
   * allocates. reached is what the device really gives. */
  hap_status (*write)(void *self, const hap_wrench *wanted, hap_wrench *reached);

  /* Zero force now. Any thread, also a signal handler; idempotent; never fails. */
  void (*zero)(void *self);

  /* De-energises; zero was called before. May block. */
  void (*stop)(void *self);

  /* Frees self. */
  void (*close)(void *self);
} hap_device_ops;

HAP_END_DECLS

#endif
