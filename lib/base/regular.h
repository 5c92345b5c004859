/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_REGULAR_H
#define HAPODE_BASE_REGULAR_H

/* Files that are read: regular ones. A pipe would hang its reader, and opening a device may do
 * something to it. */

#include <stdio.h>

/* For reading; NULL: why, in a few words, until the thread's next call of strerror. Neither waits
 * nor touches what is no regular file. */
FILE *hapi_regular_open(const char *path, const char **out_why);

#endif
