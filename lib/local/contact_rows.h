/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_CONTACT_ROWS_H
#define HAPODE_LOCAL_CONTACT_ROWS_H

/* Contacts between bodies as rows, model CONTACT. */

#include "base/effect_clock.h"
#include "local/contact_memory.h"
#include "local/facts.h"
#include "local/rows.h"

/* Wakes what touches a body that moves. */
void hapi_contact_wake(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                       hapi_rows *rows, double period);

/* Whether the contact of that index would have rows. */
bool hapi_contact_is_near(const hapi_body_contacts *contacts, const hapi_bodies *bodies,
                          uint32_t index, const hapi_tick_facts *facts);

void hapi_contact_rows(hapi_body_contacts *contacts, const hapi_bodies *bodies, hapi_rows *rows,
                       const hapi_tick_facts *facts, hapi_effect_sample *sample);

#endif
