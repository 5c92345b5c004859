/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RESEARCH_CROSS_H
#define HAPODE_RESEARCH_CROSS_H

/* Cross accelerance: what a force at a pointer contact does to the other local bodies of its
 * island. Nothing where the effect is off. */

#include <stdbool.h>
#include <stdint.h>

#include "probe/probe.h"
#include "sync/messages.h"

/* Of a contact and a body that it does not push. */
typedef struct hapi_cross_block {
  uint32_t contact; /* slot */
  uint32_t contact_generation;
  uint32_t body; /* slot */
  uint32_t body_generation;
  double response; /* (m/s^2)/N of the body's surface */
  double a[6][3];
} hapi_cross_block;

typedef struct hapi_cross_counts {
  double seconds;
  uint64_t dropped; /* blocks that there was no room for */
  uint64_t clipped;
  uint64_t singular;
} hapi_cross_counts;

typedef struct hapi_cross {
  /* What it reads; it is called back while the probe is at work. */
  const hapi_cycle *cycle;
  const hapi_slots *slots;
  const hapi_probe *probe;

  hapi_cross_block *blocks; /* of the newest testing simulations; capacity.crosses */
  uint32_t block_count;
  double (*columns)[6][3]; /* by body slot: its answer to the contact of its island in this round */
  hapi_contact_watch watch;
  hapi_cross_counts counts;
} hapi_cross;

/* False: no memory. What is read outlives it. */
bool hapi_cross_create(hapi_cross *cross, const hapi_cycle *cycle, const hapi_slots *slots,
                       const hapi_probe *probe);
void hapi_cross_finish(hapi_cross *cross);
void hapi_cross_reset(hapi_cross *cross);
bool hapi_cross_is_full(const hapi_cross *cross);
/* For the testing simulations of this cycle; NULL where it is off. */
const hapi_contact_watch *hapi_cross_watch(hapi_cross *cross);
/* The blocks of a contact, which is the one of this number in the message. */
void hapi_cross_publish(hapi_cross *cross, uint32_t contact, uint32_t number, hapi_model *out);

#endif
