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

/* root/prefix/name, which does not lead out of root. */
static const char *path_inside(import_work *work, const char *root, const char *prefix,
                               const char *name, const char **out_why)
{
  char joined[PATH_MAX];
  char real[PATH_MAX];
  const size_t length = strcmp(root, "/") == 0 ? 0 : strlen(root);
  *out_why = "it leads out of the folder";
  if (prefix[0] == '/' || name[0] == '/') {
    return NULL;
  }
  int size = snprintf(joined, sizeof joined, "%s/%s%s%s", root, prefix,
                      prefix[0] != '\0' ? "/" : "", name);
  if (size >= (int)sizeof joined || realpath(joined, real) == NULL) {
    *out_why = "it is not there";
    return NULL;
  }
  if (strncmp(real, root, length) != 0 || real[length] != '/') {
    return NULL;
  }
  *out_why = "no memory";
  return import_text(work, real, strlen(real));
}

const char *import_path(import_work *work, const char *prefix, const char *name,
                        const char **out_why)
{
  return path_inside(work, work->folder, prefix, name, out_why);
}

const char *import_package_path(import_work *work, const char *name, const char **out_why)
{
  static const char scheme[] = "package://";
  if (strncmp(name, "file://", 7) == 0) {
    return path_inside(work, work->folder, "", name + 7, out_why);
  }
  if (strncmp(name, scheme, sizeof scheme - 1) != 0) {
    return path_inside(work, work->folder, "", name, out_why);
  }
  const char *package = name + sizeof scheme - 1;
  const size_t length = strcspn(package, "/");
  const char *rest = package + length + (package[length] == '/' ? 1 : 0);
  char root[PATH_MAX];
  snprintf(root, sizeof root, "%s", work->folder);
  for (char *slash = strrchr(root, '/'); slash != NULL && length > 0; slash = strrchr(root, '/')) {
    if (strlen(slash + 1) == length && memcmp(slash + 1, package, length) == 0) {
      return path_inside(work, root, "", rest, out_why);
    }
    *slash = '\0';
  }
  return path_inside(work, work->folder, "", package, out_why);
}
