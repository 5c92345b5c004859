/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_STAMPS_H
#define HAPODE_REMOTE_STAMPS_H

/* How far the world's clock is ahead of the loop's: by four stamps, of which two are the world's
 * (Mills, RFC 5905, section 8). Where the transport does not know when a question came, it waits
 * until the next cycle looks for it, and that counts as way. So questions come at other phases of
 * the cycle each time, and of the last 16 answers the one with the shortest round trip counts. */

#include <stdbool.h>
#include <stdint.h>

#define HAPI_STAMPS_CHANNEL 4u
#define HAPI_STAMPS_QUESTION 8u /* bytes */
#define HAPI_STAMPS_ANSWER 24u  /* bytes */
#define HAPI_STAMPS_KEPT 16u

typedef struct hapi_stamps {
  int64_t offset_ns[HAPI_STAMPS_KEPT];
  int64_t trip_ns[HAPI_STAMPS_KEPT];
  uint32_t count;  /* answers so far */
  uint32_t asked;  /* questions so far */
  int64_t next_ns; /* when the next question is due */
} hapi_stamps;

/* [loop] A question, when it is due; false: not yet. */
bool hapi_stamps_ask(hapi_stamps *stamps, int64_t now_ns, unsigned char out[HAPI_STAMPS_QUESTION]);
/* [world] The answer to a question that came at times_ns[0], and goes at times_ns[1]. False: it is
 * none. */
bool hapi_stamps_answer(const void *data, uint32_t bytes, const int64_t times_ns[2],
                        unsigned char out[HAPI_STAMPS_ANSWER]);
/* [loop] Takes an answer that came at that time. False: it is none, or cannot be true. */
bool hapi_stamps_take(hapi_stamps *stamps, const void *data, uint32_t bytes, int64_t came_ns);
/* [loop] World's clock - loop's; *out_trip_ns: round trip of that answer. Some answer has come. */
int64_t hapi_stamps_offset(const hapi_stamps *stamps, int64_t *out_trip_ns);

#endif
