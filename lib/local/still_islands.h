/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_STILL_ISLANDS_H
#define HAPODE_LOCAL_STILL_ISLANDS_H

/* Which islands stand still (body_still.h), and which wake. */

#include "local/contact_memory.h"
#include "local/facts.h"
#include "local/rows.h"

/* The islands that go on being still, of those that were. After all rows but those of contacts,
 * which are in v as well. What wakes is as if it had never been still. */
void hapi_still_check(hapi_body_contacts *contacts, hapi_bodies *bodies, hapi_rows *rows,
                      const hapi_tick_facts *facts);

/* The islands that are still from the next tick on. At the end of a tick, after its books. */
void hapi_still_find(hapi_body_contacts *contacts, hapi_bodies *bodies, hapi_rows *rows,
                     const hapi_tick_facts *facts);

#endif
