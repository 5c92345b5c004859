/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench/effects.h"

/* Instructions of a tick: effects-tick, which lies beside this program, under valgrind's callgrind, which
 * counts inside of one function alone. */

static bool beside(const char *name, char *out, size_t size)
{
  char self[PATH_MAX];
  ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
  if (length <= 0) {
    return false;
  }
  self[length] = '\0';
  char *slash = strrchr(self, '/');
  int used = snprintf(out, size, "%.*s/%s", slash != NULL ? (int)(slash - self) : 0, self, name);
  return used > 0 && (size_t)used < size && access(out, X_OK) == 0;
}

bool effects_can_count(const char **out_why_not)
{
  char path[PATH_MAX];
  *out_why_not = NULL;
  if (system("valgrind --version >/dev/null 2>&1") != 0) { /* NOLINT(cert-env33-c): a fixed text */
    *out_why_not = "there is no valgrind";
  } else if (!beside("effects-tick", path, sizeof path)) {
    *out_why_not = "there is no effects-tick beside this program (ninja effects-tick)";
  }
  return *out_why_not == NULL;
}

/* "refs: N" or "Collected : N" of what callgrind says. */
static double read_count(FILE *in)
{
  char line[256];
  double count = -1.0;
  while (fgets(line, sizeof line, in) != NULL) {
    const char *at = strstr(line, "Collected : ");
    count = at != NULL ? strtod(at + strlen("Collected : "), NULL) : count;
  }
  return count;
}

double effects_instructions(const effects_counting *of)
{
  char program[PATH_MAX];
  char command[2 * PATH_MAX];
  if (!beside("effects-tick", program, sizeof program)) {
    return -1.0;
  }
  snprintf(command, sizeof command,
           "valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect=%s "
           "'%s' %s %s %d 2>&1",
           of->inside, program, of->scene, of->list, of->ticks);
  FILE *in = popen(command, "r"); /* NOLINT(cert-env33-c): names of the library's own */
  if (in == NULL) {
    return -1.0;
  }
  double count = read_count(in);
  return pclose(in) == 0 && count > 0.0 ? count / of->ticks : -1.0;
}
