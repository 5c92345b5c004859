/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tools/run_progress.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define BAR 30

void run_progress_init(run_progress *progress, double full_scale)
{
  progress->terminal = isatty(STDERR_FILENO) == 1;
  progress->full_scale = full_scale;
}

void run_progress_show(const run_progress *progress, double seconds_left, double force,
                       uint64_t missed_ticks)
{
  char bar[BAR + 1];
  if (!progress->terminal) {
    return;
  }
  double share = fmin(fmax(force / progress->full_scale, 0.0), 1.0);
  int filled = (int)lround(BAR * share);
  memset(bar, ' ', BAR);
  memset(bar, '#', (size_t)filled);
  bar[BAR] = '\0';
  fprintf(stderr, "\r%6.1f s left  [%s] %6.2f N  %" PRIu64 " ticks missed\033[K",
          fmax(seconds_left, 0.0), bar, force, missed_ticks);
}

void run_progress_clear(const run_progress *progress)
{
  if (progress->terminal) {
    fputs("\r\033[K", stderr);
  }
}
