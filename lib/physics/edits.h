/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_EDITS_H
#define HAPODE_PHYSICS_EDITS_H

/* Edits that other threads posted. */

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>

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
  uint64_t run; /* so far; of the thread that runs them */
} hapi_edits;

/* [any] HAP_ERROR_CAPACITY: too many wait; HAP_ERROR_STATE: closed. */
hap_status hapi_edits_post(hapi_edits *edits, hap_edit_fn edit, void *arg);
uint32_t hapi_edits_waiting(hapi_edits *edits);
void hapi_edits_run(hapi_edits *edits, uint32_t count); /* at most; they may post others */
void hapi_edits_close(hapi_edits *edits);

#endif
