/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <limits.h>

#include "bench/bench.h"
#include "tools/plot.h"

FILE *bench_picture_begin(bench *b, const char *name, int width, int height)
{
  char path[PATH_MAX];
  if (!plot_available() ||
      snprintf(path, sizeof path, "%s/%s.svg", b->out, name) >= (int)sizeof path) {
    return NULL;
  }
  return plot_begin(path, width, height, &b->detail);
}

hap_status bench_picture_end(bench *b, const char *name, FILE *script)
{
  if (!plot_available()) {
    bench_say("no picture %s.svg: %s", name, PLOT_ABSENT_TEXT);
    return HAP_OK;
  }
  return script != NULL ? plot_end(script, &b->detail) : HAP_ERROR_IO;
}
