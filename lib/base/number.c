/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/number.h"

#include <locale.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/assert.h"
#include "base/vec.h"

static bool is_digit(char c)
{
  return c >= '0' && c <= '9';
}

static const char *skip_digits(const char *at)
{
  while (is_digit(*at)) {
    ++at;
  }
  return at;
}

/* End of the optional exponent; a lone 'e' is not part of the number. */
static const char *skip_exponent(const char *at)
{
  if (*at != 'e' && *at != 'E') {
    return at;
  }
  const char *digits = at + 1;
  if (*digits == '+' || *digits == '-') {
    ++digits;
  }
  return is_digit(*digits) ? skip_digits(digits) : at;
}

/* The form is checked here because strtod takes more: blanks, hex, nan and inf. */
static const char *skip_number(const char *text)
{
  const char *at = text;
  if (*at == '+' || *at == '-') {
    ++at;
  }
  const char *whole = at;
  at = skip_digits(at);
  bool any = at > whole;
  if (*at == '.') {
    const char *fraction = at + 1;
    at = skip_digits(fraction);
    any = any || at > fraction;
  }
  return any ? skip_exponent(at) : NULL;
}

const char *hapi_number_read(const char *text, double *out)
{
  const char *end = skip_number(text);
  if (end == NULL) {
    return NULL;
  }
  /* All categories: for these the C library hands out a constant and allocates nothing. */
  locale_t point = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (point == (locale_t)0) {
    return NULL;
  }
  locale_t before = uselocale(point);
  char *read_end = NULL;
  double value = strtod(text, &read_end);
  uselocale(before);
  freelocale(point);
  if (read_end != end || !hapi_finite(&value, 1)) {
    return NULL;
  }
  *out = value;
  return end;
}

void hapi_number_write(char *out, size_t size, double value)
{
  HAPI_ASSERT(size > 0);
  locale_t point = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  locale_t before = uselocale(point);
  snprintf(out, size, "%.9g", value);
  uselocale(before);
  if (point != (locale_t)0) {
    freelocale(point);
  }
}
