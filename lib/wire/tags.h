/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_TAGS_H
#define HAPODE_WIRE_TAGS_H

/* Numbers for the application's geoms: addresses do not leave the process. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/message.h"

typedef struct hapi_wire_tags {
  uint32_t buckets; /* a power of two */
  uint32_t used;
  uint64_t newest; /* number; none is given twice */
  hapi_tag *keys;
  uint64_t *numbers;
} hapi_wire_tags;

/* For that many at a time. */
bool hapi_wire_tags_create(hapi_wire_tags *tags, uint32_t count);
void hapi_wire_tags_finish(hapi_wire_tags *tags); /* also of zeroed ones */

/* 0: of NULL. A tag keeps its number until there have been four times as many tags as were asked
 * for; then all get new ones. */
uint64_t hapi_wire_tag_number(hapi_wire_tags *tags, hapi_tag tag);

#endif
