/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_EMERGENCY_H
#define HAPODE_DEVICE_EMERGENCY_H

/* The devices that run in this process, for hap_emergency_zero. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/device_impl.h>

#define HAPI_EMERGENCY_DEVICES 64

/* [control] A device that was started; false: no room. */
bool hapi_emergency_add(const hap_device_ops *ops, void *self);

/* [control] After it has returned true, nobody calls zero of this device any more. Waits for a call
 * that is under way in another thread. False: that call has not come back for
 * HAPI_SAFETY_STOP_WAIT_S; the device stays in the table. */
HAP_NODISCARD bool hapi_emergency_remove(const hap_device_ops *ops, const void *self);

/* [any, also a signal handler] Zero of one device in the table. */
void hapi_emergency_zero_one(const hap_device_ops *ops, const void *self);
/* [any] A zero of the device is under way: one that hangs, or is about to come back. */
bool hapi_emergency_is_zeroing(const hap_device_ops *ops, const void *self);

/* [any] Calls of hap_emergency_zero so far. */
uint64_t hapi_emergencies(void);

#endif
