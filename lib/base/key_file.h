/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_KEY_FILE_H
#define HAPODE_BASE_KEY_FILE_H

/* Text files of lines "key = value"; lines that are empty or begin with '#' say nothing. */

#include <hapode/status.h>

typedef struct hapi_key_file {
  const char *path;
  unsigned long line; /* from 1; behind the last one when all are read */
  hap_detail *detail; /* may be NULL */
} hapi_key_file;

/* A line with its key and value, both trimmed, in memory that take may write to; a comment behind
 * the value is a part of it. A negative status ends the reading. */
typedef hap_status (*hapi_key_take)(void *self, const hapi_key_file *file, char *key, char *value);

/* [control] Reads the file line by line; *file, with path and detail set, says where it is. What
 * take said, HAP_ERROR_IO, or HAP_ERROR_FORMAT for what is no such line. */
HAP_NODISCARD hap_status hapi_key_file_read(hapi_key_file *file, hapi_key_take take, void *self);

/* Takes a comment and the blanks before it off the end of a value. */
void hapi_key_file_uncomment(char *value);

/* HAP_ERROR_FORMAT with "PATH, line N: " and both texts in detail. */
hap_status hapi_key_file_fail(const hapi_key_file *file, const char *what, const char *item);

/* The same for a line that all lines together lack. */
hap_status hapi_key_file_lacks(const hapi_key_file *file, const char *prefix, const char *key);

#endif
