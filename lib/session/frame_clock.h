/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SESSION_FRAME_CLOCK_H
#define HAPODE_SESSION_FRAME_CLOCK_H

/* Drive FRAME: which physics steps a frame is for, and for which times on the clock. */

#include <stdint.h>

#define HAPI_FRAME_S_MOST 86400.0 /* a machine that slept comes back with hours */

typedef struct hapi_frame_steps {
  int count;        /* 0 .. most */
  uint64_t dropped; /* steps that there would be beyond */
  int64_t first_ns; /* time of the first one */
  int64_t apart_ns;
} hapi_frame_steps;

/* Takes frame_s in. The steps end where the frame time has come to, which is the remainder before
 * now_ns: so they lie as evenly on the clock as if physics had a thread of its own, whenever frames
 * come. Where frame time goes faster than the clock they share what there is of it since last_ns,
 * the time of the last step. */
hapi_frame_steps hapi_frame_take(double *remainder_s, double frame_s, double period, int most,
                                 int64_t now_ns, int64_t last_ns);

#endif
