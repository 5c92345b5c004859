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

/* An open device: of the library or of a module, or of the application (hapode/device_impl.h). */
typedef struct hap_device hap_device;

#define HAP_EFFECTORS_MAX 16 /* of a device */
#define HAP_AXES_MAX 8       /* of an end effector */
#define HAP_VIBRATORS_MAX 4  /* of an end effector */

/* What an end effector of a device is and can hold. Zero in a figure: the device does not know;
 * others are from 1e-15 to 1e9. It has a size and may grow at its end. */
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

  /* hap_device_pacing of hapode/device_impl.h: who sets the pace. Filled in by the library. */
  uint32_t pacing;
  uint32_t effector_count; /* of the device, 1..HAP_EFFECTORS_MAX; the same for each of them */
  uint32_t axis_count;     /* 0..HAP_AXES_MAX, beyond the pose: a gripper, joints of a finger */
  uint32_t button_count;   /* 0..32 */
  uint32_t led_count;      /* 0..32 */
  uint32_t vibrator_count; /* 0..HAP_VIBRATORS_MAX */
  uint32_t reserved;
  double vibrator_hz[2]; /* Hz, slowest and fastest of all its vibrators */
  /* m, device frame: corners of the box in which the end effector's origin can be. Equal along an
   * axis: not known. */
  double workspace_low[3];
  double workspace_high[3]; /* m, device frame: the opposite corner */
} hap_device_info;

/* What an axis measures. Values are never renumbered. */
typedef enum hap_axis_kind {
  HAP_AXIS_OTHER = 0,  /* its meaning is the device's own */
  HAP_AXIS_GRIPPER = 1 /* opening: low is closed, high is open */
} hap_axis_kind;

/* Unit of an axis. Values are never renumbered. */
typedef enum hap_axis_unit {
  HAP_AXIS_RADIANS = 0, /* its rate is in rad/s, its force in N m */
  HAP_AXIS_METRES = 1,  /* m, m/s, N */
  HAP_AXIS_SHARE = 2    /* of a travel that the device does not know; its force is a share, too */
} hap_axis_unit;

/* An axis of an end effector beyond its pose. It has a size and may grow at its end. */
typedef struct hap_axis_info {
  uint32_t size; /* bytes filled in */
  uint32_t kind; /* hap_axis_kind */
  uint32_t unit; /* hap_axis_unit */
  uint32_t reserved;
  double low;       /* of its values; low < high, both within 1e6 */
  double high;      /* largest value */
  double max_force; /* N, N m or 1, either way; 0: it gives no force */
  /* What the maker promises to hold, at any haptic_hz from 1 kHz on; in the unit of max_force by
   * that of the axis, and by that a second. 0: not known, else from 1e-15 to 1e9 */
  double rated_stiffness;
  double rated_damping; /* likewise */
} hap_axis_info;

/* How strongly a vibrator shakes, and how fast. Final. */
typedef struct hap_vibration {
  double amplitude; /* 0..1, share of the strongest that it can; 0: off */
  double frequency; /* Hz; the device takes the nearest that it can */
} hap_vibration;

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

/* [any, not while the device is being closed] The first end effector, and with it the device.
 * size_of_out: sizeof *out of the caller's build. HAP_ERROR_ARGUMENT: a NULL, or no room for the
 * size. */
HAP_API hap_status hap_device_get_info(const hap_device *device, hap_device_info *out,
                                       size_t size_of_out);

/* [any, likewise] An end effector, from 0. HAP_ERROR_NOT_FOUND: the device has fewer. */
HAP_API hap_status hap_device_get_effector(const hap_device *device, uint32_t effector,
                                           hap_device_info *out, size_t size_of_out);

/* [any, likewise] An axis of an end effector, both from 0. HAP_ERROR_NOT_FOUND: there are fewer. */
HAP_API hap_status hap_device_get_axis(const hap_device *device, uint32_t effector, uint32_t axis,
                                       hap_axis_info *out, size_t size_of_out);

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
