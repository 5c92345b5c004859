/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/regular.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#define MEMORY_DEVICES 1 /* their major number */
#define NULL_DEVICE 3    /* minor numbers */
#define FULL_DEVICE 7

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

/* ---- writing ---- */

static bool is_stream_of_process(const struct stat *about, int file)
{
  struct stat own;
  return fstat(file, &own) == 0 && own.st_dev == about->st_dev && own.st_ino == about->st_ino;
}

static const char *why_not_writable(const struct stat *about)
{
  bool sink = S_ISCHR(about->st_mode) && major(about->st_rdev) == MEMORY_DEVICES &&
              (minor(about->st_rdev) == NULL_DEVICE || minor(about->st_rdev) == FULL_DEVICE);
  if (sink || is_stream_of_process(about, STDOUT_FILENO) ||
      is_stream_of_process(about, STDERR_FILENO)) {
    return NULL;
  }
  if (S_ISFIFO(about->st_mode) || S_ISSOCK(about->st_mode)) {
    return "it is a pipe or socket, not a file: a reader that waits would stop the program";
  }
  return why_not_regular(about->st_mode);
}

int hapi_regular_create(const char *path, int how, const char **out_why)
{
  struct stat about;
  int file = -1;
  *out_why = stat(path, &about) == 0 ? why_not_writable(&about) : NULL;
  if (*out_why == NULL) {
    file = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | O_NOCTTY | O_NONBLOCK | how, 0666);
    /* Only the opening shall not wait. */
    if (file < 0 || fstat(file, &about) != 0 || fcntl(file, F_SETFL, how & O_APPEND) != 0) {
      *out_why = strerror(errno);
    } else {
      *out_why = why_not_writable(&about);
    }
  }
  if (*out_why != NULL && file >= 0) {
    close(file);
    file = -1;
  }
  return file;
}

FILE *hapi_regular_create_stream(const char *path, int how, const char **out_why)
{
  int file = hapi_regular_create(path, how, out_why);
  FILE *stream = file >= 0 ? fdopen(file, (how & O_APPEND) != 0 ? "ab" : "wb") : NULL;
  if (file >= 0 && stream == NULL) {
    *out_why = strerror(errno);
    close(file);
  }
  return stream;
}
