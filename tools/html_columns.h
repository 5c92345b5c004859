/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_HTML_COLUMNS_H
#define HAPODE_TOOLS_HTML_COLUMNS_H

/* Columns of numbers for a page: each in 65536 steps from its least to its largest value, as
 * differences from row to row, all of them deflated and in base 64. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Bytes that grow. */
typedef struct html_bytes {
  uint8_t *data;
  size_t count;
  size_t capacity;
  bool failed; /* no memory: what came since is not there */
} html_bytes;

void html_bytes_add(html_bytes *io, const void *data, size_t count);
void html_bytes_free(html_bytes *of);

/* Adds a column of finite values. No step is finer than finest. What the page has to know of it
 * goes to out: [least, step, count]; a step of 0 says that all are the least, and no bytes come. */
void html_column_add(html_bytes *io, const double *values, size_t count, double finest, FILE *out);

/* Deflated, in base 64. False: no memory, or the file. */
bool html_bytes_write(const html_bytes *from, FILE *out);

#endif
