/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_TOOLS_H
#define HAPODE_CONTACT_TOOLS_H

/* Contacts of pointers that are hulls: as of pairs of bodies, with the pointer as the first one. */

#include <stdatomic.h>

#include "contact/places.h"

typedef struct hapi_tools hapi_tools;

/* Places outlive it; left_out counts what finds no room. False: no memory; destroy is due. */
bool hapi_tools_create(const hapi_places *places, uint32_t capacity, _Atomic uint64_t *left_out,
                       hapi_tools **out);
void hapi_tools_destroy(hapi_tools *tools); /* NULL allowed, or in part created */

void hapi_tools_find(hapi_tools *tools, hapi_patches *out);

#endif
