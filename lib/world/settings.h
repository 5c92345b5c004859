/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_SETTINGS_H
#define HAPODE_WORLD_SETTINGS_H

/* The single settings between exact and fast: what the application fixed, and what is in force. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/research.h>

/* As in hap_expert_def: HAP_BY_ACCURACY, or the fixed value. */
typedef struct hapi_knobs {
  double contact_hz;
  hap_probe probe;
  int32_t max_sweeps;
  int32_t range_hops;
  int32_t edge_probes;
  int32_t iterations;
  double reuse;
} hapi_knobs;

typedef struct hapi_settings {
  double contact_hz;
  hap_probe probe;
  uint32_t max_sweeps;  /* 0: until the system is solved */
  uint32_t row_updates; /* the most, in a solve of a tick */
  int32_t range_hops;
  uint32_t edge_probes;
  double iterations; /* times those of the world; 0: fixed_iterations */
  int32_t fixed_iterations;
  double reuse; /* m */
  bool shapes;  /* where the effect is auto */
} hapi_settings;

#endif
