/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_IDENTIFY_H
#define HAPODE_IDENTIFY_H

/* Measuring the mechanism of a device: inertia, damping, friction, delay, quantum. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* What an identification found. It has a size and may grow at its end. */
typedef struct hap_device_identity {
  uint32_t size;   /* set by hap_device_identity_init */
  uint32_t cookie; /* set by hap_device_identity_init */
  char device[64]; /* name of the device, as in hap_device_info */
  double mass;     /* kg, 0..1e4: the mechanism's own, felt at the grip; the least of all axes */
  double damping;  /* N s/m, 0..1e6, viscous; the least of all axes */
  double friction; /* N, 0..1e6, Coulomb; the least of all axes */
  double delay;   /* s, 0..1, from a command until its effect is in a measured pose; the greatest */
  double quantum; /* m, 0..1, smallest step of the measured position; 0: none was seen */
  double residual; /* 0..1, share of the force (RMS) that the model does not explain: mass, damping,
                      friction, a constant force and a spring */
} hap_device_identity;

/* [any] Zeroes *identity. size_of_identity: sizeof *identity of the caller's build. */
HAP_API void hap_device_identity_init(hap_device_identity *identity, size_t size_of_identity);

/* [control] Reads a text file of lines "key = value", '#' begins a comment, into an initialised
 * *out. HAP_ERROR_IO. HAP_ERROR_FORMAT: detail (may be NULL) has the number of the line. Then *out
 * is unchanged. */
HAP_NODISCARD HAP_API hap_status hap_device_identity_read(const char *path,
                                                          hap_device_identity *out,
                                                          hap_detail *detail);

/* [control] Writes *identity to the file at path, in the form that hap_device_identity_read
 * takes. A regular file that is there is overwritten. HAP_ERROR_IO with the reason in detail (may
 * be NULL). */
HAP_NODISCARD HAP_API hap_status hap_device_identity_write(const char *path,
                                                           const hap_device_identity *identity,
                                                           hap_detail *detail);

/* [control] From now on hap_device_get_info gives these figures in place of the device's own, and a
 * pointer that is added takes them over. A quantum of 0 leaves the device's own. HAP_ERROR_STATE: a
 * pointer has the device. HAP_ERROR_ARGUMENT: the identity is of a device of another name. */
HAP_NODISCARD HAP_API hap_status hap_device_set_identity(hap_device *device,
                                                         const hap_device_identity *identity,
                                                         hap_detail *detail);

/* How an identification is done. It has a size and may grow at its end. */
typedef struct hap_identify_def {
  uint32_t size;   /* set by hap_identify_def_init */
  uint32_t cookie; /* set by hap_identify_def_init */
  /* Hz, 100..20000, default 1000: of commands and reads. A device with HAP_PACING_DEVICE sets its
   * own, at most this. */
  double rate_hz;
  /* N, at most 30 % of the device's own limit. Default 0: that, or 1 N for a device without one. */
  double max_force;
  /* m, 0.005..0.5, default 0.05. Moved further from where it began, the device is let go and the
   * identification fails. */
  double max_travel;
  double max_speed; /* m/s, 0.05..2, default 0.5: likewise; it tries to reach half of it */

  /* [control] Called about ten times a second of the device's time; done is 0..1. Any result but 0
   * ends the identification with HAP_END. NULL is allowed. */
  int (*watch)(void *user, double done);
  void *user; /* handed to watch; the caller's */
} hap_identify_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_identify_def_init(hap_identify_def *def, size_t size_of_def);

/* [control] Moves the device to and fro along each of its axes, and fills in the initialised *out.
 * Nobody must hold the device. Least squares on f(t - delay) = m a + b v + c sign(v) + k x + g.
 * Blocks for some 30 s; with HAP_PACING_VIRTUAL for the time of the computation alone. On return
 * the force is zero and the device is stopped, whatever the status.
 *
 * HAP_ERROR_STATE: a pointer has the device. HAP_ERROR_DEVICE, with a detail text: it failed,
 * was let go by hap_emergency_zero, went beyond a limit, did not move, is held by a hand (a
 * spring of more than 30 N/m), or moved in a way that the model does not explain. */
HAP_NODISCARD HAP_API hap_status hap_device_identify(hap_device *device,
                                                     const hap_identify_def *def,
                                                     hap_device_identity *out, hap_detail *detail);

HAP_END_DECLS

#endif
