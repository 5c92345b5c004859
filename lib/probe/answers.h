/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_ANSWERS_H
#define HAPODE_PROBE_ANSWERS_H

/* What testing simulations found out: of each body and each contact that has a slot. */

#include <stdbool.h>
#include <stdint.h>

#include "near/slots.h"
#include "sync/exchange.h"

typedef struct hapi_body_answer {
  uint32_t generation; /* of the slot that the rest is of */
  uint32_t flags;      /* HAPI_BODY_*: the slot's, and what was found out in this cycle */
  bool b_is_good;      /* of the newest testing simulations */
  bool known_free;     /* model ACCELERANCE: nothing holds it, so nothing was measured */
  bool measured;       /* model CONTACT: response and b hold a measurement */
  double b[6];
  double response[6][6]; /* wrench at the centre of mass to acceleration */
} hapi_body_answer;

typedef struct hapi_contact_answer {
  uint32_t generation; /* of the slot that the rest is of */
  bool probed;         /* a holds a measured accelerance */
  double push;    /* N, of this cycle's testing simulations; their directions are of the contact */
  double a[6][3]; /* eq. 6 */
  double turn[6]; /* the same of a torque about the normal */
} hapi_contact_answer;

typedef struct hapi_answers {
  hapi_body_answer *bodies; /* by slot */
  hapi_contact_answer *contacts;
  uint32_t body_capacity;
  uint32_t contact_capacity;
} hapi_answers;

bool hapi_answers_create(hapi_answers *answers, const hapi_capacity *capacity);
void hapi_answers_finish(hapi_answers *answers);
void hapi_answers_reset(hapi_answers *answers);
/* Forgets those of slots that another body or contact has by now, and takes the slots' flags.
 * Once a cycle, when the slots are those of the model to come. */
void hapi_answers_follow(hapi_answers *answers, const hapi_slots *slots);

/* Model CONTACT: whether the body must answer all that acts on it by one matrix: more than one
 * pointer contact acts on it, or another body may. */
bool hapi_body_is_whole(const hapi_slots *slots, uint32_t body);

#endif
