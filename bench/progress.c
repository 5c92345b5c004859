/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/progress.h"

#include <assert.h>
#include <stdbool.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

static struct {
  bool on; /* between begin and end, on a terminal */
  const char *program;
  const char *what;
  size_t count;
  size_t finished;
  double cost;
  double paid;
  double began; /* s */
} line;

static double now_s(void)
{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void progress_begin(const char *program, const char *what, size_t count, double cost)
{
  assert(!line.on);
  line.on = isatty(STDERR_FILENO) == 1;
  line.program = program;
  line.what = what;
  line.count = count;
  line.finished = 0;
  line.cost = cost;
  line.paid = 0.0;
  line.began = now_s();
  progress_show();
}

void progress_add(size_t count, double cost)
{
  line.finished += count;
  line.paid += cost;
  progress_show();
}

static void left_show(double left)
{
  if (left >= 5400.0) {
    fprintf(stderr, ", about %.1f h left", left / 3600.0);
  } else if (left >= 90.0) {
    fprintf(stderr, ", about %.0f min left", left / 60.0);
  } else {
    fprintf(stderr, ", about %.0f s left", left);
  }
}

void progress_show(void)
{
  if (!line.on) {
    return;
  }
  fprintf(stderr, "\r%s: %zu of %zu %s", line.program, line.finished, line.count, line.what);
  if (line.paid > 0.0) {
    left_show((now_s() - line.began) * (line.cost - line.paid) / line.paid);
  }
  fputs("\033[K", stderr);
}

void progress_hide(void)
{
  if (line.on) {
    fputs("\r\033[K", stderr);
  }
}

void progress_end(void)
{
  progress_hide();
  line.on = false;
}
