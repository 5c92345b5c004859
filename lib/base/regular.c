/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/regular.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char *why_not_regular(mode_t mode)
{
  if (S_ISDIR(mode)) {
    return "it is a folder, not a file";
  }
  if (S_ISFIFO(mode) || S_ISSOCK(mode)) {
    return "it is a pipe or socket, not a file: save what comes out of it to a file first";
  }
  return S_ISREG(mode) ? NULL : "it is a device, not a file";
}

/* Looked at before it is opened, which would raise the lines of a serial port, and again after it,
 * as it may have become something else meanwhile. */
FILE *hapi_regular_open(const char *path, const char **out_why)
{
  struct stat about;
  FILE *stream = NULL;
  int file = -1;
  *out_why = NULL;
  bool good = stat(path, &about) == 0;
  if (good && (*out_why = why_not_regular(about.st_mode)) == NULL) {
    file = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
    good = file >= 0 && fstat(file, &about) == 0;
  }
  if (good && *out_why == NULL && (*out_why = why_not_regular(about.st_mode)) == NULL) {
    stream = fdopen(file, "rb");
  }
  if (stream == NULL && *out_why == NULL) {
    *out_why = strerror(errno);
  }
  if (stream == NULL && file >= 0) {
    close(file);
  }
  return stream;
}
