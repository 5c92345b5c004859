/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_PROGRESS_H
#define HAPODE_TOOLS_RUN_PROGRESS_H

/* One line on stderr that shows a run while it runs; only when stderr is a terminal. */

#include <stdbool.h>
#include <stdint.h>

typedef struct run_progress {
  bool terminal;
  double full_scale; /* N, of the force bar */
} run_progress;

void run_progress_init(run_progress *progress, double full_scale);
void run_progress_show(const run_progress *progress, double seconds_left, double force,
                       uint64_t missed_ticks);
void run_progress_clear(const run_progress *progress);

#endif
