/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_IDENTIFY_H
#define HAPODE_DEVICE_IDENTIFY_H

/* Parts of hap_device_identify:
 *   identify          moves the device within its limits and records it, axis by axis
 *   identify_fit      mass, damping, friction and delay from a record
 *   identify_quantum  the step of the measured positions */

#include <stdint.h>

#include <hapode/identify.h>

/* Longest delay that is looked for [s]. */
#define HAPI_IDENTIFY_DELAY_MAX 0.03

/* A position, and the force that was commanded when it had been read. */
typedef struct hapi_identify_sample {
  double time;     /* s */
  double position; /* m, along the axis */
  double force;    /* N */
} hapi_identify_sample;

typedef struct hapi_identify_record {
  hapi_identify_sample *samples;
  uint32_t count;
  uint32_t capacity;
} hapi_identify_record;

/* Velocity at sample i [m/s]: a mean over some samples on both sides; 0 near the ends. */
double hapi_identify_velocity(const hapi_identify_record *record, uint32_t i);

typedef struct hapi_identify_fit {
  double mass;
  double damping;
  double friction;
  double bias;      /* N, constant: gravity that is not compensated */
  double stiffness; /* N/m, of what pulls it back to where it began: a hand */
  double delay;
  double residual; /* share of the force, root mean square */
} hapi_identify_fit;

/* HAP_ERROR_DEVICE when there is too little motion in the record, HAP_ERROR_MEMORY. */
HAP_NODISCARD hap_status hapi_identify_fit_record(const hapi_identify_record *record,
                                                  hapi_identify_fit *out, hap_detail *detail);

/* [m] 0: none can be seen. */
double hapi_identify_quantum(const hapi_identify_record *record);

/* identity.c: to a caller of whatever build, whose *out was initialised. */
HAP_NODISCARD hap_status hapi_device_identity_give(const hap_device_identity *identity,
                                                   hap_device_identity *out, hap_detail *detail);

#endif
