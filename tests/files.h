/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FILES_H
#define HAPODE_TESTS_FILES_H

/* Files of a test, in a folder of its own that goes with all that is in it after the last test. */

#include <stdbool.h>
#include <stddef.h>

extern char test_folder[100];

/* In $TMPDIR or /tmp; false: there is none, which is told. For SET_UP. */
bool folder_make(void);
/* Of all that is in it. */
void folder_clear(void);
/* Of the last eight calls. */
const char *folder_path(const char *name);

/* A copy of the module that the variable names, in that folder: a module is loaded only from where
 * nobody else may write, and a build tree may be open to all. NULL: there is none. */
const char *folder_module(const char *variable);

bool file_exists(const char *path);
/* "" when it cannot be read. Until the next call. */
const char *file_text(const char *path);
/* These end the program when they fail. */
void file_write(const char *path, const char *text);
void file_write_bytes(const char *path, const void *bytes, size_t size);

/* Lines of a text that have the part in them, or begin with it. */
int lines_with(const char *text, const char *part);
int lines_from(const char *text, const char *part);

#endif
