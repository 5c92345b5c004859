/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_REGULAR_H
#define HAPODE_BASE_REGULAR_H

/* Files that are read or written: regular ones. A pipe would hang its reader or writer, and opening
 * a device may do something to it. */

#include <stdio.h>

/* For reading; NULL: why, in a few words, until the thread's next call of strerror. Neither waits
 * nor touches what is no regular file. */
FILE *hapi_regular_open(const char *path, const char **out_why);

/* For writing, from nothing (O_TRUNC) or behind what is there (O_APPEND); made when there is none.
 * < 0: why. Standard output and error may be pipes or terminals, and /dev/null takes what nobody
 * wants. */
int hapi_regular_create(const char *path, int how, const char **out_why);
/* The same as a stream. */
FILE *hapi_regular_create_stream(const char *path, int how, const char **out_why);

#endif
