/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RESEARCH_RESEARCH_H
#define HAPODE_RESEARCH_RESEARCH_H

/* What only comparisons use: cross accelerance, and the error of the range. */

#include <stdbool.h>
#include <stdint.h>

#include "near/slots.h"
#include "probe/reuse.h"
#include "sync/messages.h"

typedef struct hapi_physics hapi_physics;

/* Of a contact and a body that it does not push. */
typedef struct hapi_cross {
  uint32_t contact; /* slot */
  uint32_t contact_generation;
  uint32_t body; /* slot */
  uint32_t body_generation;
  double response; /* (m/s^2)/N of the body's surface */
  double a[6][3];
} hapi_cross;

typedef struct hapi_research {
  hapi_cross *crosses; /* of the newest testing simulations; capacity.crosses */
  uint32_t cross_count;
} hapi_research;

/* cross.c: cross accelerance, nothing where it is off */
bool hapi_cross_is_full(const hapi_physics *physics);
/* Before the islands that are measured are: blocks of others stay, where A is used again. */
void hapi_cross_begin(hapi_physics *physics, const hapi_reuse_book *book);
/* After a testing simulation with a force [N] at the contact: what the others did. */
void hapi_cross_column(hapi_physics *physics, const hapi_contact_slot *contact, int axis,
                       double force);
void hapi_cross_keep(hapi_physics *physics, uint32_t contact_index); /* after three of them */
void hapi_cross_take_out(hapi_physics *physics); /* of b: what last_force does by the blocks */
/* Those of a contact that is the one of this number in the message. */
void hapi_cross_publish(hapi_physics *physics, uint32_t contact, uint32_t number, hapi_model *out);

/* range_error.c: the effect testing=on of model CONTACT */
bool hapi_range_error_wanted(const hapi_physics *physics);
void hapi_range_error_measure(hapi_physics *physics);

#endif
