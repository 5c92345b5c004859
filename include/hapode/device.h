/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_H
#define HAPODE_DEVICE_H

/* Devices: opening them by name, and what they say of themselves. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

typedef struct hap_device hap_device;

/* What a device is and can hold. Zero in a figure: the device does not know; others are from 1e-15
 * to 1e9. It has a size and may grow at its end. */
typedef struct hap_device_info {
  uint32_t size;              /* bytes filled in */
  uint32_t dof;               /* 3: force only; 6: force and torque */
  char name[64];              /* for people: "virtual", a product's name */
  double max_force;           /* N, norm of the force vector that the device may be asked for */
  double max_torque;          /* N m */
  double rated_stiffness;     /* N/m, largest that the maker promises to hold */
  double damping;             /* N s/m, the mechanism's own */
  double quantum;             /* m, smallest step of the measured position */
  double mass;                /* kg, the mechanism's own, felt at the grip */
  double friction;            /* N, Coulomb friction of the mechanism */
  double delay;               /* s, from a force command until its effect is in a measured pose */
  uint32_t measures_velocity; /* 1: the twist is measured, not a difference of rounded positions */
} hap_device_info;

/* [control] Opens a device by its spec: a name, then ':' and arguments separated by commas.
 * Examples: "virtual", "virtual:sine=0.1/0/0,hz=1", "replay:hand.csv,scale=0.5". A device in a
 * shared object is "module:/whole/path.so,ARGUMENTS" (docs/writing-a-device.md). May block. The
 * caller owns the device and closes it after the session that uses it was stopped.
 *
 * On failure *out is NULL. detail (may be NULL) says what was wrong, and for an unknown name
 * which names exist. HAP_ERROR_ARGUMENT, HAP_ERROR_NOT_FOUND, HAP_ERROR_DEVICE, HAP_ERROR_IO,
 * HAP_ERROR_FORMAT, HAP_ERROR_UNSUPPORTED, HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_device_open(const char *spec, hap_device **out,
                                                 hap_detail *detail);

/* [control] Writes zero force, then lets go and frees. NULL is allowed. */
HAP_API void hap_device_close(hap_device *device);

/* [any, not while the device is being closed] size_of_out: sizeof *out of the caller's build.
 * HAP_ERROR_ARGUMENT: a NULL, or no room for the size. */
HAP_API hap_status hap_device_get_info(const hap_device *device, hap_device_info *out,
                                       size_t size_of_out);

/* [any, also a signal handler] Zero force on every device of every running session, at once. The
 * sessions latch HAP_FAULT_EMERGENCY: no force until hap_session_reset_fault. A device that is
 * being identified is let go too, and its identification fails.
 *
 * A write that is under way in the haptic thread may still come after it; another zero follows
 * within the same tick. A handler that ends the process calls this twice, 2 ms apart. */
HAP_API void hap_emergency_zero(void);

/* [any] The names that hap_device_open knows, index from 0; NULL past the end. One line about each
 * in *out_description, unless that is NULL. */
HAP_API const char *hap_device_name_at(size_t index, const char **out_description);

HAP_END_DECLS

#endif
