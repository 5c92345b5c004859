/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_HISTORY_H
#define HAPODE_TOOLS_RUN_HISTORY_H

/* Moments of a replay that are kept, to be looked at in any order. */

#include "view/view.h"

typedef struct run_history {
  view_frame *list; /* count, by time */
  size_t count;
  size_t capacity;
  size_t bytes;
  double interval; /* s, the least between two */
} run_history;

void run_history_init(run_history *out);
void run_history_free(run_history *of); /* zeroed allowed */

/* Keeps it unless the newest one is less than the interval old. Where all of them would take too
 * much memory, every other one is forgotten and the interval doubled. False: there is no memory. */
bool run_history_add(run_history *io, const view_frame *frame);

/* The newest one that is not later than t, or the first; NULL: there is none. */
const view_frame *run_history_at(const run_history *of, double t);

#endif
