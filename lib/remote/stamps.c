/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/stamps.h"

#include <string.h>

#include "base/assert.h"
#include "remote/bytes.h"

#define ASK_NS 237000000LL    /* no multiple of a usual period of physics */
#define ASK_SOON_NS 5300000LL /* the first ones */
#define TRIP_MOST_NS 10000000000LL

/* The answer: when it was asked (loop's clock), found and answered (world's). A question is the
 * first of them. */

bool hapi_stamps_ask(hapi_stamps *stamps, int64_t now_ns, unsigned char out[HAPI_STAMPS_QUESTION])
{
  if (now_ns < stamps->next_ns) {
    return false;
  }
  stamps->next_ns = now_ns + (++stamps->asked < HAPI_STAMPS_KEPT ? ASK_SOON_NS : ASK_NS);
  hapi_bytes_write((uint64_t)now_ns, 8, out);
  return true;
}

bool hapi_stamps_answer(const void *data, uint32_t bytes, const int64_t times_ns[2],
                        unsigned char out[HAPI_STAMPS_ANSWER])
{
  if (bytes != HAPI_STAMPS_QUESTION) {
    return false;
  }
  memcpy(out, data, HAPI_STAMPS_QUESTION);
  hapi_bytes_write((uint64_t)times_ns[0], 8, out + 8);
  hapi_bytes_write((uint64_t)times_ns[1], 8, out + 16);
  return true;
}

bool hapi_stamps_take(hapi_stamps *stamps, const void *data, uint32_t bytes, int64_t came_ns)
{
  const unsigned char *in = data;
  if (bytes != HAPI_STAMPS_ANSWER) {
    return false;
  }
  /* Unsigned, as clocks of others may be anything. */
  uint64_t asked = hapi_bytes_read(in, 8);
  uint64_t found = hapi_bytes_read(in + 8, 8);
  uint64_t answered = hapi_bytes_read(in + 16, 8);
  int64_t trip = (int64_t)(((uint64_t)came_ns - asked) - (answered - found));
  if ((int64_t)asked < 0 || (int64_t)((uint64_t)came_ns - asked) < 0 || trip < 0 ||
      trip > TRIP_MOST_NS) {
    return false;
  }
  uint32_t at = stamps->count++ % HAPI_STAMPS_KEPT;
  stamps->trip_ns[at] = trip;
  stamps->offset_ns[at] = (int64_t)(found - asked) - trip / 2;
  return true;
}

int64_t hapi_stamps_offset(const hapi_stamps *stamps, int64_t *out_trip_ns)
{
  uint32_t kept = stamps->count < HAPI_STAMPS_KEPT ? stamps->count : HAPI_STAMPS_KEPT;
  uint32_t best = 0;
  HAPI_ASSERT(kept > 0);
  for (uint32_t i = 1; i < kept; ++i) {
    best = stamps->trip_ns[i] < stamps->trip_ns[best] ? i : best;
  }
  *out_trip_ns = stamps->trip_ns[best];
  return stamps->offset_ns[best];
}
