/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_CYCLE_H
#define HAPODE_WORLD_CYCLE_H

/* What is in force in this cycle of physics. physics/cycle.c writes it, all parts read it. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

#include "base/wishes.h"
#include "sync/messages.h"
#include "world/config.h"

typedef struct hapi_cycle {
  const hapi_physics_config *config;
  hapi_settings settings; /* of the dial */
  hap_model model;
  uint32_t wishes;     /* effects, base/wishes.h */
  double step_s;       /* of this cycle's global step */
  double physics_s;    /* H in force: from a cycle to the next where the model is not SINGLE */
  double probe_step_s; /* from this cycle to the next: H, or T in model SINGLE */
  double soft_s;       /* of a step of the world, that its contacts and joints are softened for */
  bool steady;         /* the step of this cycle and the next one are as created */
  double time_scale;   /* of the interval to come: what passes for bodies in a second of the hand */
  double step_scale;   /* the same of this cycle's step */
  uint64_t model_number;
  int64_t last_cycle_ns; /* time of the last cycle, for which ODE's state holds */
  hapi_state *state;     /* newest message of the loop; NULL: none yet */
  bool has_new_state;    /* state came in this cycle */
  uint32_t parts;        /* of H, that the contacts of the collision phase are for; 0: all of it */
} hapi_cycle;

/* The step ends at now: the world is never ahead of the loop. */
static inline bool hapi_cycle_steps_to_now(const hapi_cycle *cycle)
{
  return cycle->model != HAP_MODEL_IMPULSE;
}

/* s, for which what may come to touch is of interest: so many steps, and what the session looks
 * ahead beyond them. */
static inline double hapi_cycle_horizon(const hapi_cycle *cycle, double steps)
{
  return steps * cycle->probe_step_s + cycle->config->look_ahead_s;
}

/* s, from a cycle of this model to the next. */
static inline double hapi_cycle_period(const hapi_cycle *cycle, hap_model model)
{
  return model == HAP_MODEL_SINGLE ? 1.0 / cycle->config->haptic_hz : cycle->physics_s;
}

/* s, that the world's ERP and CFM are meant for: a step of a testing simulation. */
static inline double hapi_cycle_test_s(const hapi_cycle *cycle)
{
  return hapi_config_period(cycle->config, cycle->model);
}

/* In a pause nothing is converted: no body moves. */
static inline double hapi_cycle_scale(const hapi_cycle *cycle)
{
  return cycle->time_scale > 0.0 ? cycle->time_scale : 1.0;
}

/* To the log and the application, unless *io_said. */
void hapi_say_once(const hapi_cycle *cycle, bool *io_said, const char *text);

#endif
