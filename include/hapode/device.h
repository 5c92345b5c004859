/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_H
#define HAPODE_DEVICE_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

typedef struct hap_device hap_device;

/* What a device is and can hold. Zero in a limit means that the device does not know. */
typedef struct hap_device_info {
  char name[64];
  unsigned dof;               /* 3: force only; 6: force and torque */
  double max_force;           /* N, norm of the force vector the device may be asked for */
  double max_torque;          /* N m */
  double rated_stiffness;     /* N/m, largest the maker promises to hold */
  double damping;             /* N s/m, the mechanism's own */
  double quantum;             /* m, smallest step of the measured position */
  double mass;                /* kg, the mechanism's own, felt at the grip */
  double friction;            /* N, Coulomb friction of the mechanism */
  double delay;               /* s, from a force command until its effect is in a measured pose */
  uint32_t measures_velocity; /* 1: the twist is measured, not a difference of rounded positions */
} hap_device_info;

/* [control] Opens a device by its spec: a name, then ':' and arguments separated by commas, such
 * as "virtual", "virtual:sine=0.1/0/0,hz=1", "replay:hand.csv,scale=0.5". On failure *out is
 * NULL and detail (may be NULL) says what was wrong and, for an unknown name, which exist.
 * May block. The caller owns the device and closes it after the session that uses it stopped. */
HAP_API HAP_NODISCARD hap_status hap_device_open(const char *spec, hap_device **out,
                                                 hap_detail *detail);

/* [control] NULL is allowed. Writes zero force before it lets go. */
HAP_API void hap_device_close(hap_device *device);

/* [control] */
HAP_API hap_status hap_device_get_info(const hap_device *device, hap_device_info *out,
                                       size_t size_of_out);

/* [any, also a signal handler] Zero force on every device of every running session, at once. The
 * sessions latch HAP_FAULT_EMERGENCY: no force until hap_session_reset_fault. A write that is under way
 * in the haptic thread may still come after it, and is followed by another zero within the same tick;
 * a handler that ends the process calls this twice, 2 ms apart. */
HAP_API void hap_emergency_zero(void);

/* [any] The names that hap_device_open knows, index from 0; NULL past the end. One line about
 * each in *out_description when it is not NULL. */
HAP_API const char *hap_device_name_at(size_t index, const char **out_description);

HAP_END_DECLS

#endif
