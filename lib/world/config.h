/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_CONFIG_H
#define HAPODE_WORLD_CONFIG_H

/* What the physics side is created with, and what the dial comes to. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/research.h>
#include <hapode/session.h>
#include <hapode/stats.h>

#include "sync/exchange.h"
#include "sync/texture.h"

/* As in hap_expert_def: HAP_BY_ACCURACY, or the fixed value. */
typedef struct hapi_knobs {
  double contact_hz;
  hap_probe probe;
  int32_t max_sweeps;
  int32_t range_hops;
  int32_t iterations;
  double reuse;
} hapi_knobs;

typedef struct hapi_settings {
  double contact_hz;
  hap_probe probe;
  uint32_t max_sweeps;      /* 0: until the system is solved */
  uint32_t row_updates;     /* the most, in a solve of a tick */
  uint32_t updates_per_row; /* that it may make where that is more, and a tick has the time */
  double force_drift;       /* 1/s, what solves may leave undone of the force on a hand */
  int32_t range_hops;
  uint32_t range_bodies; /* that the range may own: what a tick has time for */
  double iterations;     /* times those of the world; 0: fixed_iterations */
  int32_t fixed_iterations;
  double reuse; /* m */
  bool shapes;  /* where the effect is auto */
} hapi_settings;

/* What the physics side is created with. Constant from then on. */
typedef struct hapi_physics_config {
  hapi_capacity capacity;
  uint32_t max_bodies; /* that the loop may move itself; capacity.bodies is more */
  uint32_t substeps;   /* parts of a step of the world in model CONTACT */
  hap_model model;
  hap_impulse_pose impulse_pose;
  hapi_knobs knobs;
  double accuracy; /* as in hap_session_def and hap_expert_def, also the next three */
  double force_error_wanted;
  double tick_share;
  double physics_share;
  uint32_t effects; /* wishes at the start, base/wishes.h */
  double physics_hz;
  double haptic_hz;
  double look_ahead_s;   /* beyond the next sync, for which bodies are looked for */
  double lookback_share; /* of the period of physics, that the error estimate may take; 0: none */
  bool lockstep;
  bool frame; /* drive FRAME: a cycle may come later than the time that it is for */
  int rt_priority;
  hapi_exchange *exchange;
  const hapi_textures *textures; /* NULL: there are none */
  /* [physics] HAP_FAULT_NONE: something that the application should know, but no fault */
  void (*report)(void *user, hap_fault fault, const char *text);
  void *user;
} hapi_physics_config;

/* s, from a cycle to the next: H as created, or T in model SINGLE. */
static inline double hapi_config_period(const hapi_physics_config *config, hap_model model)
{
  return 1.0 / (model == HAP_MODEL_SINGLE ? config->haptic_hz : config->physics_hz);
}

/* What a period of physics in nanoseconds stands for: that of the rate as created exactly. */
static inline double hapi_config_seconds(const hapi_physics_config *config, int64_t period_ns)
{
  double created_s = 1.0 / config->physics_hz;
  return period_ns == llround(1e9 * created_s) ? created_s : 1e-9 * (double)period_ns;
}

#endif
