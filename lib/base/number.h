/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_NUMBER_H
#define HAPODE_BASE_NUMBER_H

#include <stddef.h>

/* Reads a decimal number such as -1, .5, 2.5e-3 at the start of text, with a point whatever the
 * locale says. No blanks, hex, nan or inf. text ends with a zero byte. Returns the first character
 * behind the number; NULL: there is no number, or it is beyond the range of a double. Only then
 * *out is not written. [any] */
const char *hapi_number_read(const char *text, double *out);

/* Writes value with nine digits in the form that hapi_number_read reads, whatever the locale says.
 * 32 bytes are enough. value is finite. */
void hapi_number_write(char *out, size_t size, double value);

#endif
