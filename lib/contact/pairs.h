/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_PAIRS_H
#define HAPODE_CONTACT_PAIRS_H

/* Contacts of the pairs of geoms of a near message. */

#include <stdatomic.h>

#include "contact/asking.h"
#include "contact/places.h"

typedef struct hapi_pairs hapi_pairs;

/* Places and asking outlive it; left_out counts what finds no room. False: no memory; destroy is
 * due. */
bool hapi_pairs_create(const hapi_places *places, hapi_asking *asking,
                       const hapi_capacity *capacity, _Atomic uint64_t *left_out, hapi_pairs **out);
void hapi_pairs_destroy(hapi_pairs *pairs); /* NULL allowed, or in part created */
void hapi_pairs_begin(hapi_pairs *pairs);   /* forgets all */

void hapi_pairs_take_near(hapi_pairs *pairs); /* after hapi_places_take_near */
void hapi_pairs_find(hapi_pairs *pairs, hapi_patches *out);

#endif
