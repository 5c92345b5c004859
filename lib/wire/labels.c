/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/labels.h"

#include "base/alloc.h"
#include "base/assert.h"
#include "base/hash.h"

bool hapi_wire_labels_create(hapi_wire_labels *labels, uint32_t count)
{
  labels->count = count;
  labels->buckets = 1;
  while (labels->buckets < count) {
    labels->buckets *= 2;
  }
  labels->heads = hapi_alloc_array(labels->buckets, sizeof *labels->heads);
  labels->next = hapi_alloc_array(count, sizeof *labels->next);
  labels->keys = hapi_alloc_array(count, sizeof *labels->keys);
  labels->used = hapi_alloc_array(count, sizeof *labels->used);
  labels->serial = hapi_alloc_array(count, sizeof *labels->serial);
  return labels->heads != NULL && labels->next != NULL && labels->keys != NULL &&
         labels->used != NULL && labels->serial != NULL;
}

void hapi_wire_labels_finish(hapi_wire_labels *labels)
{
  hapi_free(labels->heads);
  hapi_free(labels->next);
  hapi_free(labels->keys);
  hapi_free(labels->used);
  hapi_free(labels->serial);
  memset(labels, 0, sizeof *labels);
}

static uint32_t *label_head(const hapi_wire_labels *labels, uint64_t key)
{
  return &labels->heads[(hapi_hash_word(HAPI_HASH_BEGIN, key) >> 7) & (labels->buckets - 1)];
}

static void label_unlink(const hapi_wire_labels *labels, uint32_t label)
{
  uint32_t *at = label_head(labels, labels->keys[label]);
  while (*at != label + 1) {
    HAPI_ASSERT(*at != 0);
    at = &labels->next[*at - 1];
  }
  *at = labels->next[label];
}

static uint32_t label_take_oldest(const hapi_wire_labels *labels)
{
  uint32_t oldest = 0;
  for (uint32_t i = 1; i < labels->count; ++i) {
    oldest = labels->used[i] < labels->used[oldest] ? i : oldest;
  }
  label_unlink(labels, oldest);
  return oldest;
}

uint32_t hapi_wire_label_of(hapi_wire_labels *labels, uint64_t key, uint64_t number)
{
  uint32_t *head = label_head(labels, key);
  for (uint32_t at = *head; at != 0; at = labels->next[at - 1]) {
    if (labels->keys[at - 1] == key && labels->used[at - 1] != number) {
      labels->used[at - 1] = number;
      return at - 1;
    }
  }
  uint32_t label = labels->fresh < labels->count ? labels->fresh++ : label_take_oldest(labels);
  HAPI_ASSERT(labels->used[label] != number);
  labels->next[label] = *head; /* read anew: taking the oldest may have changed it */
  *head = label + 1;
  labels->keys[label] = key;
  labels->used[label] = number;
  labels->serial[label] = 0;
  return label;
}
