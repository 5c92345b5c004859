/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_CONTACT_H
#define HAPODE_CONTACT_CONTACT_H

/* The contact thread of model CONTACT: finds the contacts between the bodies near the pointers from
 * the loop's newest poses, faster than the world is stepped and slower than the loop runs. It waits
 * for nobody and nobody waits for it. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/effects.h>
#include <hapode/stats.h>

#include "record/tape.h"
#include "sync/exchange.h"

typedef struct hapi_contact hapi_contact;

typedef struct hapi_contact_config {
  hapi_capacity capacity;
  double haptic_hz;
  int rt_priority;
  hapi_exchange *exchange;
  hapi_contact_ask_fn ask; /* NULL: nobody is asked about contacts */
  const void *ask_of;
} hapi_contact_config;

hap_status hapi_contact_create(const hapi_contact_config *config, hapi_contact **out);
void hapi_contact_destroy(hapi_contact *contact); /* NULL allowed; thread stopped before */

/* [control] Forgets all state. */
void hapi_contact_begin(hapi_contact *contact, int64_t start_ns);

/* [control] Before begin, as hapi_haptic_set_tape. */
void hapi_contact_set_tape(hapi_contact *contact, hapi_tape *tape);

/* [control] After begin; not in lockstep. */
hap_status hapi_contact_start_thread(hapi_contact *contact);
void hapi_contact_stop_thread(hapi_contact *contact); /* idempotent */

/* [contact] Whether the loop uses a local model whose pairs have not been looked at. */
bool hapi_contact_has_news(hapi_contact *contact);

/* [contact] One pass; the loop uses its contacts from valid_from_ns on. Nothing happens before the
 * first local model of model CONTACT. */
void hapi_contact_pass(hapi_contact *contact, int64_t valid_from_ns);

/* [contact] Seconds from one pass to the next one, as physics asks for. */
double hapi_contact_period(const hapi_contact *contact);

void hapi_contact_effects(const hapi_contact *contact, hap_effect_info *out); /* [any] likewise */
void hapi_contact_stats(const hapi_contact *contact, hap_stats *out); /* [any] its part of *out */

#endif
