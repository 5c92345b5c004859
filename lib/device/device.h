/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_DEVICE_H
#define HAPODE_DEVICE_DEVICE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

#include <hapode/device.h>
#include <hapode/device_impl.h>

#include "device/watchdog.h"

/* Who holds the device, as bits: one for each end effector that a pointer has, and one when the
 * application has closed it. The last one to let go frees it, so closing before the session stopped
 * is late, not fatal. */
typedef struct hapi_device_holders {
  atomic_uint bits;
  _Atomic(const void *)
      owner; /* of the pointers; NULL: there is none, or it has all of the device */
} hapi_device_holders;

/* A running device and the pointers that have its end effectors. */
typedef struct hapi_device_drive {
  uint32_t users;         /* pointers for which it was started [control] */
  uint32_t active;        /* pointers in the loop [haptic, with those below] */
  uint32_t filled;        /* of those, whose output of this tick is in wanted */
  uint64_t read_number;   /* as the loop counts them: of the last read */
  hap_status read_status; /* of that one */
  hap_status write_status;
  hapi_watchdog watchdog;
} hapi_device_drive;

/* What is known of an end effector is asked once, at open: the session may read it while the loop
 * runs. The rest is the loop's. */
typedef struct hapi_effector {
  hap_device_info info;
  hap_axis_info axes[HAP_AXES_MAX];
  hap_device_input input;
  hap_device_output wanted;
  hap_device_output reached;
} hapi_effector;

struct hap_device {
  const hap_device_ops *ops;
  void *self;
  uint32_t effector_count;
  hapi_effector *effectors;
  hap_device_input *inputs[HAP_EFFECTORS_MAX]; /* as the ops have them */
  const hap_device_output *wanted[HAP_EFFECTORS_MAX];
  hap_device_output *reached[HAP_EFFECTORS_MAX];
  hapi_device_holders holders;
  hapi_device_drive drive;
  void *library; /* of module.h; NULL: built in */
  bool wrapped;  /* who has claimed it is another device */
};

/* [control] Opens a device of these ops; the ways to find ops are the registry and module.h. The
 * ops must outlive the device. HAP_ERROR_UNSUPPORTED for another ABI; detail is not NULL and says
 * why it failed. */
HAP_NODISCARD hap_status hapi_device_open_ops(const hap_device_ops *ops, void *context,
                                              const char *args, hap_device **out,
                                              hap_detail *detail);
/* [any] Of a table of which nothing is known yet. */
HAP_NODISCARD hap_status hapi_device_check_abi(const hap_device_ops *ops, hap_detail *detail);

/* [haptic] Of all end effectors; what was read is in their input, what shall be written in their
 * wanted. */
static inline hap_status hapi_device_read(hap_device *device, int64_t time_ns)
{
  return device->ops->read(device->self, time_ns, device->inputs);
}

static inline hap_status hapi_device_write(hap_device *device)
{
  return device->ops->write(device->self, device->wanted, device->reached);
}

/* [any] For the calls of a session; self goes into each op. */
const hap_device_ops *hapi_device_ops(const hap_device *device);
void *hapi_device_self(const hap_device *device);

/* [any] Whether read or write did its work: a number that is no hap_status says nothing good. */
static inline bool hapi_device_did(hap_status status)
{
  return status >= HAP_OK && status <= HAP_DIVERGED;
}

/* [any] Of the first end effector; lives as long as the device. */
const hap_device_info *hapi_device_info(const hap_device *device);

/* [any] Whether a device may describe itself with these: each is 0 (unknown) or from
 * HAPI_NUMBER_LEAST to 1e9 in SI units. */
HAP_NODISCARD bool hapi_device_figures_good(const double *figures, size_t count);
/* [any] Likewise an axis: known, a range, and a figure. */
HAP_NODISCARD bool hapi_device_axis_good(const hap_axis_info *axis);

/* [any] What the device says of its last failure; "" when it says nothing. */
void hapi_device_explain(const hap_device_ops *ops, void *self, hap_detail *out);

/* [control] Takes all of the device; false when somebody has a part of it or it was closed. */
HAP_NODISCARD bool hapi_device_claim(hap_device *device);

/* [control] A pointer of a session takes an end effector; false when another one has it, a pointer
 * of another session has one, or the device was closed. */
HAP_NODISCARD bool hapi_device_claim_effector(hap_device *device, const void *session,
                                              uint32_t effector);
void hapi_device_release_effector(hap_device *device, uint32_t effector); /* after ops->stop */

/* [control] After ops->stop. Frees the device when it was closed in the meantime. */
void hapi_device_release(hap_device *device);

/* [any] The built-in devices: by index, NULL past the end; by a name of that length, NULL when
 * there is none. */
const hap_device_ops *hapi_registry_at(size_t index);
const hap_device_ops *hapi_registry_find(const char *name, size_t length);

#endif
