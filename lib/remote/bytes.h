/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_BYTES_H
#define HAPODE_REMOTE_BYTES_H

/* Numbers in messages: little endian, whatever the machine. */

#include <stdint.h>
#include <string.h>

static inline void hapi_bytes_write(uint64_t word, int bytes, unsigned char *out)
{
  for (int i = 0; i < bytes; ++i) {
    out[i] = (unsigned char)(word >> (8 * i));
  }
}

static inline uint64_t hapi_bytes_read(const unsigned char *data, int bytes)
{
  uint64_t word = 0;
  for (int i = 0; i < bytes; ++i) {
    word |= (uint64_t)data[i] << (8 * i);
  }
  return word;
}

static inline void hapi_bytes_write_real(double value, unsigned char *out)
{
  uint64_t word;
  memcpy(&word, &value, sizeof word);
  hapi_bytes_write(word, 8, out);
}

static inline double hapi_bytes_read_real(const unsigned char *data)
{
  uint64_t word = hapi_bytes_read(data, 8);
  double value;
  memcpy(&value, &word, sizeof value);
  return value;
}

#endif
