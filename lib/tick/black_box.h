/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_BLACK_BOX_H
#define HAPODE_TICK_BLACK_BOX_H

/* The last ticks, kept until somebody has asked what led to a fault.
 *
 * Who may touch the rows is in one atomic word. FILLING: the loop. FROZEN: nobody; either side
 * takes it from there by an exchange. READING: one reader, who puts FROZEN back. A loop that would
 * go on while it is READING keeps no rows until the reader is done: it never waits. */

#include <stdatomic.h>

#include <hapode/trace.h>

#include "tick/tick.h"

enum {
  HAPI_BOX_FILLING = 0,
  HAPI_BOX_FROZEN = 1,
  HAPI_BOX_READING = 2
};

typedef struct hapi_black_box {
  hap_black_box_row *rows; /* HAP_BLACK_BOX_TICKS x pointers, a tick's rows side by side */
  uint32_t *counts;        /* of the ticks; HAP_BLACK_BOX_TICKS */
  uint32_t pointers;
  uint32_t newest; /* place of the newest tick */
  uint64_t faults; /* latched so far, when it was frozen */
  _Atomic int state;
} hapi_black_box;

/* Empties it; rows, counts and pointers are set. Touches all of its memory. */
void hapi_black_box_reset(hapi_black_box *box);

/* [haptic] After the devices were written. Freezes the box with the first tick of a fault, and
 * begins anew after its reset, or with the next fault. */
void hapi_black_box_record(hapi_black_box *box, const hapi_tick *tick);

/* One reader at a time, any thread. Rows copied: the newest capacity of them, oldest first; 0: no
 * fault is latched. */
size_t hapi_black_box_read(hapi_black_box *box, hap_black_box_row *rows, size_t capacity,
                           size_t size_of_row);

#endif
