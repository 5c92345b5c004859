/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_FACTS_H
#define HAPODE_LOCAL_FACTS_H

/* What is in force in a tick: the clock, and what the model in use says. Only lib/tick writes
 * it. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/research.h>
#include <hapode/session.h>

#include "base/wishes.h"

typedef struct hapi_tick_facts {
  double period; /* s, T */
  uint64_t tick; /* number of this one */
  int64_t now_ns;
  int64_t read_ns; /* time of the tick before */
  double elapsed;  /* s, since that tick, at least T: more where ticks were missed */
  bool faulted;    /* a fault is latched: no contact pushes */
  bool observes;   /* the energy observer watches, if the guard's mode has one */

  hap_model model;
  uint32_t wishes; /* base/wishes.h */
  bool bounces;    /* some contact or stop gives back speed */
  hap_impulse_pose impulse_pose;
  double blend_s;
  uint64_t model_number;
  int64_t adopted_ns;
  int64_t state_ns;
  int64_t sent_ns;
  double physics_period; /* s, H; 0: not known */
  double look_ahead_s;   /* see hapi_model */
  double time_scale;     /* likewise */
} hapi_tick_facts;

#endif
