/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/tags.h"

#include "base/alloc.h"
#include "base/hash.h"

bool hapi_wire_tags_create(hapi_wire_tags *tags, uint32_t count)
{
  tags->buckets = 16;
  while (tags->buckets / 8 < count) {
    tags->buckets *= 2;
  }
  tags->keys = hapi_alloc_array(tags->buckets, sizeof *tags->keys);
  tags->numbers = hapi_alloc_array(tags->buckets, sizeof *tags->numbers);
  return tags->keys != NULL && tags->numbers != NULL;
}

void hapi_wire_tags_finish(hapi_wire_tags *tags)
{
  hapi_free(tags->keys);
  hapi_free(tags->numbers);
  memset(tags, 0, sizeof *tags);
}

uint64_t hapi_wire_tag_number(hapi_wire_tags *tags, hapi_tag tag)
{
  if (tag == NULL) {
    return 0;
  }
  if (tags->used >= tags->buckets / 2) {
    memset(tags->keys, 0, tags->buckets * sizeof *tags->keys);
    tags->used = 0;
  }
  uint64_t at = hapi_hash_word(HAPI_HASH_BEGIN, (uint64_t)(uintptr_t)tag) >> 5;
  for (;; ++at) {
    at &= tags->buckets - 1;
    if (tags->keys[at] == tag) {
      return tags->numbers[at];
    }
    if (tags->keys[at] == NULL) {
      ++tags->used;
      tags->keys[at] = tag;
      tags->numbers[at] = ++tags->newest;
      return tags->newest;
    }
  }
}
