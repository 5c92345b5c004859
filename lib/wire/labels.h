/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_LABELS_H
#define HAPODE_WIRE_LABELS_H

/* The sender's labels of one kind: small numbers for the keys of records. A record has its label as
 * long as it is in messages; then the label that was used longest ago is the next to be given
 * again. */

#include <stdbool.h>
#include <stdint.h>

typedef struct hapi_wire_labels {
  uint32_t count;   /* of labels */
  uint32_t fresh;   /* from here on none was used yet */
  uint32_t buckets; /* a power of two */
  uint32_t *heads;  /* by bucket: 1 + label, 0: none */
  uint32_t *next;   /* by label, likewise */
  uint64_t *keys;
  uint64_t *used;   /* number of the newest message with it */
  uint64_t *serial; /* of the description that was sent of it; 0: none */
} hapi_wire_labels;

bool hapi_wire_labels_create(hapi_wire_labels *labels, uint32_t count);
void hapi_wire_labels_finish(hapi_wire_labels *labels); /* also of zeroed ones */

/* The label of a key in message number. Two records of a message with one key have two labels. */
uint32_t hapi_wire_label_of(hapi_wire_labels *labels, uint64_t key, uint64_t number);

#endif
