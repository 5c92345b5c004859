/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_COUNTS_H
#define HAPODE_PHYSICS_COUNTS_H

/* Physics' part of the statistics. */

#include <pthread.h>
#include <stdint.h>

#include <hapode/accuracy.h>
#include <hapode/effects.h>
#include <hapode/stats.h>

#include "base/effect_figures.h"
#include "base/histogram.h"
#include "physics/reconcile.h"

typedef struct hapi_physics hapi_physics;

typedef struct hapi_physics_counts {
  hap_stats stats; /* physics' part */
  double collide_s;
  double neighbour_s;
  double testing_s;
  double step_s;
  double publish_s;
  double range_s;  /* part of neighbour_s */
  double beyond_s; /* part of range_s: bodies that are no neighbours */
  double joints_s; /* of joints: their scan and their part of the message; of publish_s */
  double cross_s;  /* part of testing_s and publish_s */
  hapi_effect_figures effects[HAP_EFFECTS];
  hap_accuracy_info accuracy;
  uint64_t cycles;
} hapi_physics_counts;

typedef struct hapi_counts {
  hapi_physics_counts own;
  hapi_histogram cycle_ns;
  hapi_account_counts shown_account;
  hapi_physics_counts shown; /* copied once a cycle for readers */
  pthread_mutex_t lock;      /* of shown */
} hapi_counts;

void hapi_counts_show(hapi_physics *physics); /* copies the figures for readers */

#endif
