/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/key_file.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "base/assert.h"
#include "base/log.h"
#include "base/regular.h"

#define LINE_SIZE 512

static const char blanks[] = " \t\r\n";

static void trim_end(char *text)
{
  char *end = text + strlen(text);
  while (end > text && strchr(blanks, end[-1]) != NULL) {
    *--end = '\0';
  }
}

/* At the first '='. An empty key: there is nothing but a comment. False: there is no '=', or no
 * key; the key is then all of the line. */
static bool line_split(char *text, char **key, char **value)
{
  *key = text + strspn(text, blanks);
  trim_end(*key);
  *value = *key + strlen(*key);
  if (**key == '#' || **key == '\0') {
    **key = '\0';
    return true;
  }
  char *equals = strchr(*key, '=');
  if (equals == NULL || equals == *key) {
    return false;
  }
  *equals = '\0';
  *value = equals + 1 + strspn(equals + 1, blanks);
  trim_end(*key);
  return true;
}

hap_status hapi_key_file_read(hapi_key_file *file, hapi_key_take take, void *self)
{
  char text[LINE_SIZE];
  char *key = NULL;
  char *value = NULL;
  hap_status status = HAP_OK;
  HAPI_ASSERT(file->path != NULL && take != NULL);
  const char *why = NULL;
  FILE *stream = hapi_regular_open(file->path, &why);
  if (stream == NULL) {
    return hapi_fail(file->detail, HAP_ERROR_IO, "%.200s: cannot be opened: %s", file->path, why);
  }
  for (file->line = 1; fgets(text, sizeof text, stream) != NULL; ++file->line) {
    /* A line of more than the buffer, and one with a zero byte, have no line end where it should
     * be. */
    if (strchr(text, '\n') == NULL && feof(stream) == 0) {
      status = hapi_key_file_fail(file, "longer than 510 characters, or not text", "");
    } else if (!line_split(text, &key, &value)) {
      status = hapi_key_file_fail(file, "expected key = value, not ", key);
    } else if (*key != '\0') {
      status = take(self, file, key, value);
    }
    if (status < HAP_OK) {
      break;
    }
  }
  if (status >= HAP_OK && ferror(stream) != 0) {
    status = hapi_fail(file->detail, HAP_ERROR_IO, "%.200s, line %lu: cannot be read: %s",
                       file->path, file->line, strerror(errno));
  }
  fclose(stream);
  return status < HAP_OK ? status : HAP_OK;
}

void hapi_key_file_uncomment(char *value)
{
  value[strcspn(value, "#")] = '\0';
  trim_end(value);
}

hap_status hapi_key_file_fail(const hapi_key_file *file, const char *what, const char *item)
{
  return hapi_fail(file->detail, HAP_ERROR_FORMAT, "%.200s, line %lu: %s%.60s", file->path,
                   file->line, what, item);
}

hap_status hapi_key_file_lacks(const hapi_key_file *file, const char *prefix, const char *key)
{
  return hapi_fail(file->detail, HAP_ERROR_FORMAT,
                   "%.200s, line %lu: the file ends without a line %s%s = ...", file->path,
                   file->line, prefix, key);
}
