/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_DIAL_SETTINGS_H
#define HAPODE_PHYSICS_DIAL_SETTINGS_H

/* What the dials come to: a table from the positions of the tick's and of the physics thread's dial to the
 * single settings. Positions are in percent, so that one fits into a byte of a recording. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

#define HAPI_DIAL_MOST 100
#define HAPI_DIAL_DEFAULT 50 /* HAP_ACCURACY_DEFAULT */

/* As in hap_session_def: HAP_BY_ACCURACY, or what it stays at. */
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
  uint32_t max_sweeps;  /* 0: until it is solved */
  uint32_t row_updates; /* the most, in a solve of a tick */
  int32_t range_hops;
  uint32_t edge_probes;
  double iterations; /* times those of the world; 0: fixed_iterations */
  int32_t fixed_iterations;
  double reuse; /* m */
  bool shapes;  /* where the effect is auto */
} hapi_settings;

/* period_s: of a tick. */
void hapi_dial_settings(const hapi_knobs *knobs, int tick_percent, int physics_percent,
                        double period_s, hapi_settings *out);

static inline int hapi_dial_percent(double accuracy) /* 0..1 */
{
  return (int)(100.0 * accuracy + 0.5);
}

#endif
