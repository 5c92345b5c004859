/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_EDITS_H
#define HAPODE_PHYSICS_EDITS_H

/* Edits that other threads posted. */

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

typedef struct hapi_physics hapi_physics;

#define HAPI_EDITS_MAX 256

typedef struct hapi_edit {
  hap_edit_fn run;
  void *arg;
} hapi_edit;

typedef struct hapi_edits {
  pthread_mutex_t lock;
  hapi_edit ring[HAPI_EDITS_MAX];
  uint32_t first;
  uint32_t count;
  bool closed;
} hapi_edits;

void hapi_edits_run(hapi_physics *physics);

#endif
