/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_CODES_H
#define HAPODE_WIRE_CODES_H

/* Bytes in and out (docs/wire.md): numbers in groups of seven bits, the lowest first; the high bit
 * says that another group follows. So the order of bytes in the machine's memory does not show. */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define HAPI_CODE_MOST 10u /* bytes of a number of 64 bits */

typedef struct hapi_code_writer {
  uint8_t *at;
  uint8_t *end;
  bool full; /* something had no room; what is written is of no use */
} hapi_code_writer;

typedef struct hapi_code_reader {
  const uint8_t *at;
  const uint8_t *end;
  bool bad; /* ended too early, or a number of more than 64 bits */
} hapi_code_reader;

static inline void hapi_code_byte(hapi_code_writer *w, uint8_t byte)
{
  if (w->at == w->end) {
    w->full = true;
    return;
  }
  *w->at++ = byte;
}

static inline void hapi_code_put(hapi_code_writer *w, uint64_t value)
{
  while (value >= 0x80u) {
    hapi_code_byte(w, (uint8_t)(value | 0x80u));
    value >>= 7;
  }
  hapi_code_byte(w, (uint8_t)value);
}

static inline void hapi_code_copy(hapi_code_writer *w, const uint8_t *bytes, size_t count)
{
  if ((size_t)(w->end - w->at) < count) {
    w->full = true;
    return;
  }
  memcpy(w->at, bytes, count);
  w->at += count;
}

static inline uint8_t hapi_code_take_byte(hapi_code_reader *r)
{
  if (r->at == r->end) {
    r->bad = true;
    return 0;
  }
  return *r->at++;
}

static inline uint64_t hapi_code_take(hapi_code_reader *r)
{
  uint64_t value = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    uint8_t byte = hapi_code_take_byte(r);
    if (shift == 63 && byte > 1) {
      break;
    }
    value |= (uint64_t)(byte & 0x7fu) << shift;
    if (byte < 0x80u) {
      return value;
    }
  }
  r->bad = true;
  return 0;
}

/* At most most, else the reader is bad. */
static inline uint32_t hapi_code_take_most(hapi_code_reader *r, uint32_t most)
{
  uint64_t value = hapi_code_take(r);
  if (value > most) {
    r->bad = true;
    return 0;
  }
  return (uint32_t)value;
}

/* Small numbers of either sign as small numbers: 0, -1, 1, -2 ... */
static inline uint64_t hapi_code_fold(uint64_t difference)
{
  return (difference << 1) ^ (uint64_t) - (int64_t)(difference >> 63);
}

static inline uint64_t hapi_code_unfold(uint64_t folded)
{
  return (folded >> 1) ^ (uint64_t) - (int64_t)(folded & 1u);
}

#endif
