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
  char name[64];              /* for people: "virtual", a product's name */
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
 * as "virtual", "virtual:sine=0.1/0/0,hz=1", "replay:hand.csv,scale=0.5"; or from a shared object,
 * "module:/whole/path.so,ARGUMENTS" (docs/writing-a-device.md). On failure *out is
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
 * sessions latch HAP_FAULT_EMERGENCY: no force until hap_session_reset_fault. A device that is being
 * identified is let go too, and its identification fails. A write that is under way
 * in the haptic thread may still come after it, and is followed by another zero within the same tick;
 * a handler that ends the process calls this twice, 2 ms apart. */
HAP_API void hap_emergency_zero(void);

/* What an identification found out about a device's mechanism. */
typedef struct hap_device_identity {
  uint32_t size;   /* set by hap_device_identity_init */
  uint32_t cookie; /* set by hap_device_identity_init */
  char device[64]; /* name of the device, as in hap_device_info */
  double mass;     /* kg, 0..1e4: the mechanism's own, felt at the grip; the least of all axes */
  double damping;  /* N s/m, 0..1e6, viscous; the least of all axes */
  double friction; /* N, 0..1e6, Coulomb; the least of all axes */
  double delay;   /* s, 0..1, from a command until its effect is in a measured pose; the greatest */
  double quantum; /* m, 0..1, smallest step of the measured position; 0: none was seen */
  double residual; /* 0..1, share of the force (root mean square) that mass, damping, friction, a
                      constant force and a spring do not explain */
} hap_device_identity;

/* [any] Zeroes *identity. size_of_identity: sizeof *identity of the caller's build. */
HAP_API void hap_device_identity_init(hap_device_identity *identity, size_t size_of_identity);

/* [control] A text file of lines "key = value", '#' begins a comment. Read into an initialised
 * *out. HAP_ERROR_IO, HAP_ERROR_FORMAT with the number of the line in detail (may be NULL); *out is
 * then unchanged. */
HAP_API HAP_NODISCARD hap_status hap_device_identity_read(const char *path,
                                                          hap_device_identity *out,
                                                          hap_detail *detail);

/* [control] Writes *identity to a new file at path, or over what was there, in the form that
 * hap_device_identity_read takes. HAP_ERROR_IO with the reason in detail (may be NULL). */
HAP_API HAP_NODISCARD hap_status hap_device_identity_write(const char *path,
                                                           const hap_device_identity *identity,
                                                           hap_detail *detail);

/* [control] From now on hap_device_get_info gives these figures in place of what the device says of
 * itself, and a pointer that is added takes them over. A quantum of 0 leaves the device's own: none was
 * seen, which is not to say that there is none. HAP_ERROR_STATE when a pointer has the
 * device, HAP_ERROR_ARGUMENT when the identity is that of a device of another name. */
HAP_API HAP_NODISCARD hap_status hap_device_set_identity(hap_device *device,
                                                         const hap_device_identity *identity,
                                                         hap_detail *detail);

/* How an identification goes about it. */
typedef struct hap_identify_def {
  uint32_t size;    /* set by hap_identify_def_init */
  uint32_t cookie;  /* set by hap_identify_def_init */
  double rate_hz;   /* Hz, 100..20000, default 1000: of commands and reads; a device with
                        HAP_PACING_DEVICE sets its own, at most this */
  double max_force; /* N, at most 30 % of the device's own limit. Default 0: that, or 1 N for a
                        device without one */
  double
      max_travel;   /* m, 0.005..0.5, default 0.05: moved further from where it began, the device is
                        let go and the identification fails */
  double max_speed; /* m/s, 0.05..2, default 0.5: the same; half of it is what it tries to reach */

  /* Called about ten times a second of the device's time; done is 0..1. Anything but 0 ends the
   * identification with HAP_END. NULL is allowed. */
  int (*watch)(void *user, double done);
  void *user;
} hap_identify_def;

/* [any] Fills *def with defaults. */
HAP_API void hap_identify_def_init(hap_identify_def *def, size_t size_of_def);

/* [control] Moves the device, which nobody must hold, along each of its axes to and fro and fills in
 * the initialised *out: least squares on f(t - delay) = m a + b v + c sign(v) + k x + g. Blocks for some
 * 30 s; with HAP_PACING_VIRTUAL it takes the time of the computation alone. On return, whatever it
 * is, the force is zero and the device is stopped. HAP_ERROR_STATE when a pointer has the device;
 * HAP_ERROR_DEVICE with a detail text when it failed, was let go by hap_emergency_zero, went beyond a limit, did not move, is held by
 * a hand (a spring of more than 30 N/m), or moved in a way that the model does not explain. */
HAP_API HAP_NODISCARD hap_status hap_device_identify(hap_device *device,
                                                     const hap_identify_def *def,
                                                     hap_device_identity *out, hap_detail *detail);

/* [any] The names that hap_device_open knows, index from 0; NULL past the end. One line about
 * each in *out_description when it is not NULL. */
HAP_API const char *hap_device_name_at(size_t index, const char **out_description);

HAP_END_DECLS

#endif
