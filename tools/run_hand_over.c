/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-run of a build whose pictures are in hapode-view. */

#include "tools/run_hand_over.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

#define VIEWER "hapode-view"

/* A viewer elsewhere may be of another version: no search. */
static bool viewer_path(char *out, size_t size)
{
  ssize_t length = readlink("/proc/self/exe", out, size - sizeof VIEWER);
  if (length <= 0 || (size_t)length >= size - sizeof VIEWER) {
    return false;
  }
  out[length] = '\0';
  char *slash = strrchr(out, '/');
  if (slash == NULL) {
    return false;
  }
  memcpy(slash + 1, VIEWER, sizeof VIEWER);
  return true;
}

hap_status run_hand_over(const run_options *options, char *const arguments[], hap_detail *detail)
{
  char path[4096];
  if (options->shot.path == NULL && options->shot.frames == NULL && !options->window.wanted) {
    return HAP_OK;
  }
  if (!viewer_path(path, sizeof path)) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "/proc is not there: call " VIEWER " itself, with the same arguments");
  }
  (void)fflush(NULL);
  (void)execv(path, arguments);
  return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                   "--shot, --frames and --view need %.300s (Debian: apt install " VIEWER "): %s",
                   path, strerror(errno));
}
