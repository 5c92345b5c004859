/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "import/path.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"

hap_status import_folder(import_work *work, const char *path)
{
  char folder[PATH_MAX];
  char real[PATH_MAX];
  const char *slash = strrchr(path, '/');
  int length = slash == NULL ? 1 : slash == path ? 1 : (int)(slash - path);
  if (length >= PATH_MAX) {
    return hapi_fail(work->detail, HAP_ERROR_ARGUMENT, "a path of %d bytes", length);
  }
  snprintf(folder, sizeof folder, "%.*s", length, slash == NULL ? "." : path);
  if (realpath(folder, real) == NULL) {
    return hapi_fail(work->detail, HAP_ERROR_NOT_FOUND, "%.300s: there is no such folder", folder);
  }
  work->folder = import_text(work, real, strlen(real));
  return work->folder != NULL ? HAP_OK : import_no_memory(work);
}

const char *import_path(import_work *work, const char *prefix, const char *name,
                        const char **out_why)
{
  char joined[PATH_MAX];
  char real[PATH_MAX];
  const size_t root = strcmp(work->folder, "/") == 0 ? 0 : strlen(work->folder);
  *out_why = "it leads out of the folder";
  if (prefix[0] == '/' || name[0] == '/') {
    return NULL;
  }
  int length = snprintf(joined, sizeof joined, "%s/%s%s%s", work->folder, prefix,
                        prefix[0] != '\0' ? "/" : "", name);
  if (length >= (int)sizeof joined || realpath(joined, real) == NULL) {
    *out_why = "it is not there";
    return NULL;
  }
  if (strncmp(real, work->folder, root) != 0 || real[root] != '/') {
    return NULL;
  }
  *out_why = "no memory";
  return import_text(work, real, strlen(real));
}
