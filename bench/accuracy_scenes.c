/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench/accuracy.h"

/* A device's own limit would be part of the comparison. */
#define NO_LIMIT ",hand=rigid,max_force=1000,max_torque=1000"

/* A finger that comes down to the row and pushes it along: turned and shifted so that it meets the
 * first cube's face. The window has one push; later ones meet a row that lies still. */
#define RECORDING_PLACE \
  ",scale=0.15,rotate=0.8991/-0.018/-0.4357/-0.0371,offset=0.005/-0.0342/-0.036,start=1.5"

static const accuracy_scene scenes[] = {
    {.name = "fig5", .base = "fig5", .bound = 0.005, .rests = true},
    {.name = "fig6", .base = "fig6", .bound = 0.005},
    {.name = "fig7", .base = "fig7", .bound = 0.02, .starts_quick = 3},
    {.name = "slide", .base = "slide", .bound = 0.005, .speeds = true},
    {.name = "row10", .base = "row10", .bound = 0.01, .starts_quick = 3, .speeds = true},
    {.name = "wedge", .base = "wedge", .bound = 0.005},
    {.name = "stack", .base = "stack", .bound = 0.03},
    {.name = "tower", .base = "tower", .bound = 0.03, .starts_quick = 3},
    {.name = "topple", .base = "topple", .bound = 0.01, .speeds = true},
    {.name = "edge", .base = "edge", .bound = 0.03},
    {.name = "hit", .base = "hit", .bound = 0.06},
    {.name = "roll", .base = "roll", .bound = 0.01},
    {.name = "roll_capsule", .base = "roll_capsule", .bound = 0.01},
    {.name = "roll_cylinder", .base = "roll_cylinder", .bound = 0.01},
    {.name = "clump8", .base = "clump8", .bound = 0.03},
    {.name = "spheres", .base = "spheres", .bound = 0.06},
    {.name = "door", .base = "door", .bound = 0.005},
    {.name = "pendulum", .base = "pendulum", .bound = 0.005},
    {.name = "hinged", .base = "hinged", .bound = 0.005},
    {.name = "cart", .base = "cart", .bound = 0.005},
    {.name = "chain", .base = "chain", .bound = 0.005},
    {.name = "lightstand", .base = "lightstand", .bound = 0.03, .starts_quick = 3},
    {.name = "telescope", .base = "telescope", .bound = 0.03, .starts_quick = 3},
    {.name = "grasp", .base = "grasp", .bound = 0.03, .speeds = true},
    {.name = "lever", .base = "lever", .bound = 0.03, .starts_quick = 3},
    {.name = "peg", .base = "peg", .bound = 0.08, .starts_quick = 3, .start_most = 2e-4},
    {.name = "hold", .base = "hold", .seconds_quick = 3, .starts_quick = 2, .rests = true},
    {.name = "recorded",
     .base = "row10",
     .recording = "dfki_index_tip.csv",
     .seconds = 3,
     .bound = 0.03,
     .starts_quick = 3},
    {.name = "field", .base = "field", .bound = 0.005, .starts_quick = 3},
    {.name = "pile8", .base = "pile", .count = 8, .bound = 0.05, .starts_quick = 2},
};

const accuracy_scene *accuracy_scene_at(size_t index)
{
  return index < sizeof scenes / sizeof scenes[0] ? &scenes[index] : NULL;
}

/* A text that grows in a caller's buffer; full: too long once. */
typedef struct writer {
  char *text;
  size_t size;
  size_t used;
  bool full;
} writer;

static void write_part(writer *w, const char *part, size_t length)
{
  if (w->used + length >= w->size) {
    w->full = true;
    return;
  }
  memcpy(w->text + w->used, part, length);
  w->used += length;
  w->text[w->used] = '\0';
}

/* "path=T:x/y/z;T:x/y/z", or turn= for path=, with each T stretched; false: no such thing. */
static bool write_path(writer *w, const char *path, size_t length, double stretch)
{
  const char *end = path + length;
  const char *at = path + strlen("path=");
  write_part(w, path, strlen("path=")); /* as long as the other one */
  while (at < end) {
    char *after = NULL;
    char time[32];
    double seconds = strtod(at, &after);
    size_t rest = strcspn(after, ";,");
    if (after == at || *after != ':') {
      return false;
    }
    int written = snprintf(time, sizeof time, "%.9g", stretch * seconds);
    write_part(w, time, (size_t)written);
    rest += after[rest] == ';';
    write_part(w, after, rest);
    at = after + rest;
  }
  return true;
}

bool accuracy_hand(const char *spec, double stretch, char *out, size_t size)
{
  writer w = {.size = size};
  w.text = out;
  size_t length = strcspn(spec, ":") + 1;
  const char *at = spec + length;
  if (strncmp(spec, "virtual:", length) != 0) {
    return false;
  }
  write_part(&w, spec, length);
  for (bool first = true; *at != '\0'; at += length + (at[length] == ',')) {
    length = strcspn(at, ",");
    if (strncmp(at, "hand=", 5) == 0) {
      continue;
    }
    if (!first) {
      write_part(&w, ",", 1);
    }
    first = false;
    if (strncmp(at, "path=", 5) != 0 && strncmp(at, "turn=", 5) != 0) {
      write_part(&w, at, length);
    } else if (!write_path(&w, at, length, stretch)) {
      return false;
    }
  }
  write_part(&w, NO_LIMIT, strlen(NO_LIMIT));
  return !w.full;
}

hap_status accuracy_recorded_hand(bench *b, const accuracy_scene *which, char *out, size_t size)
{
  char path[ACCURACY_SPEC_MAX];
  const char *shared = getenv("HAPODE_SHARED");
  int length = snprintf(path, sizeof path, "%s/data/%s", shared != NULL ? shared : "../shared",
                        which->recording);
  if (length >= (int)sizeof path || access(path, R_OK) != 0) {
    return bench_fail(b, HAP_ERROR_NOT_FOUND, "no recording HAPODE_SHARED/data/%s",
                      which->recording);
  }
  length = snprintf(out, size, "replay:%s" RECORDING_PLACE, path);
  return length < (int)size ? HAP_OK : bench_fail(b, HAP_ERROR_NOT_FOUND, "%s: too long", path);
}
