/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_OWN_LIST_H
#define HAPODE_HAPTIC_OWN_LIST_H

/* The own forces that the application wants a pointer to have, on their way to the loop: the whole
 * list at each change, by a triple buffer. Samples of vibrations stay where they are until the loop
 * has taken a list without them. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

#include "base/force_setup.h"
#include "sync/triple_buffer.h"

typedef struct hapi_own_wave hapi_own_wave;

/* A function of the application's; call NULL: none. */
typedef struct hapi_own_call {
  hap_force_call call;
  void *user;
  int64_t most_ns; /* that it may take */
} hapi_own_call;

/* The loop's side of it. Figures are since it was set; anyone reads them. */
typedef struct hapi_own_caller {
  hapi_own_call of;
  double strikes;          /* late calls that are not forgotten */
  _Atomic uint32_t number; /* of the setting */
  _Atomic uint32_t out;    /* hap_force_out */
  _Atomic uint64_t calls;
  _Atomic uint64_t late;
  _Atomic int64_t spent_ns;
  _Atomic int64_t most_ns;
} hapi_own_caller;

/* setup.serial 0: no force is in this place. */
typedef struct hapi_own_message {
  uint64_t number; /* 1, 2, 3 ... */
  hapi_force_setup setups[HAP_FORCES_MAX];
  const float *samples[HAP_FORCES_MAX];
  hapi_own_call calls[HAP_FORCES_MAX];
} hapi_own_message;

/* Zeroed: no force. */
typedef struct hapi_own_list {
  hapi_triple_buffer buffer;
  hapi_own_message messages[3];
  _Atomic uint64_t taken; /* message that the loop has in use */

  /* The loop's. */
  bool partly; /* a message was taken, and not all of it is in use */
  hapi_own_caller callers[HAP_FORCES_MAX];

  /* The application's, under the lock of the pointer's slot. */
  hapi_own_message wanted;
  hapi_own_wave *waves;
  uint32_t serials; /* so far */
  uint32_t numbers;
} hapi_own_list;

void hapi_own_list_begin(hapi_own_list *list);  /* a new pointer, which the loop does not have */
void hapi_own_list_finish(hapi_own_list *list); /* idempotent */

/* What is put besides numbers. */
typedef struct hapi_own_extra {
  const float *samples; /* copied; NULL for a sine */
  hapi_own_call call;
} hapi_own_extra;

/* [application, locked] io: of the force whose place the setup takes; v 0: it is added.
 * HAP_ERROR_CAPACITY, HAP_ERROR_NOT_FOUND, HAP_ERROR_MEMORY. */
HAP_NODISCARD hap_status hapi_own_list_put(hapi_own_list *list, hap_force_id *io,
                                           const hapi_force_setup *setup,
                                           const hapi_own_extra *extra);
HAP_NODISCARD hap_status hapi_own_list_remove(hapi_own_list *list, hap_force_id force);

/* [application, locked] Place of a force; HAP_FORCES_MAX: it is not there. */
uint32_t hapi_own_list_place(const hapi_own_list *list, hap_force_id force);
/* Whether it is one that the loop calls. */
bool hapi_own_list_calls(const hapi_own_list *list, hap_force_id force);

/* [replay] Room for samples that come from the tape; NULL: no memory. Given back where no force
 * uses them any more. */
float *hapi_own_list_room(hapi_own_list *list, uint32_t count);
void hapi_own_list_give_back(hapi_own_list *list, const float *samples);

/* Another function is set: its figures begin. */
void hapi_own_caller_begin(hapi_own_caller *caller, const hapi_own_call *call, uint32_t number);

/* After a call: its figures; [any] what they come to. */
void hapi_own_call_note(hapi_own_caller *caller, int64_t spent_ns);
void hapi_own_caller_tell(const hapi_own_caller *caller, hap_force_state *out);

#endif
