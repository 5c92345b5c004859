/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_VERDICTS_H
#define HAPODE_BASE_VERDICTS_H

/* What the application said of contacts, one after the other, for a recording or out of one: a
 * replay need not ask. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Values are of the file. */
typedef enum hapi_verdict {
  HAPI_VERDICT_DROPPED = 0, /* there is no contact */
  HAPI_VERDICT_KEPT = 1,    /* it has the surface of its pair */
  HAPI_VERDICT_OWN = 2,     /* it has one of its own */
  HAPI_VERDICT_SAME = 3     /* it has the last one of these */
} hapi_verdict;

#define HAPI_VERDICT_BYTES 168u /* of a surface of its own, at most: three cells */

/* Zeroed at first. */
typedef struct hapi_verdicts {
  uint8_t *codes; /* hapi_verdict */
  uint32_t count;
  uint32_t capacity;
  char (*own)[HAPI_VERDICT_BYTES];
  uint32_t own_count;
  uint32_t own_capacity;
  uint32_t at; /* of a replay: the next one */
  uint32_t own_at;
  bool missing; /* no memory for one */
} hapi_verdicts;

void hapi_verdicts_finish(hapi_verdicts *verdicts);
void hapi_verdicts_clear(hapi_verdicts *verdicts);
/* For so many in all; false: no memory. */
bool hapi_verdicts_reserve(hapi_verdicts *verdicts, uint32_t count, uint32_t own_count);
/* own: of a verdict OWN, that many bytes. */
void hapi_verdicts_note(hapi_verdicts *verdicts, hapi_verdict verdict, const void *own,
                        size_t size);
/* KEPT where there are no more. SAME is told as OWN; *out_own is set for OWN alone. */
hapi_verdict hapi_verdicts_next(hapi_verdicts *verdicts, void *out_own, size_t size);

#endif
