/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* base/number.h */

#include <ctype.h>
#include <math.h>

#include "base/number.h"
#include "tests/fuzz/fuzz.h"

void fuzz_one(const uint8_t *data, size_t size)
{
  char *text = fuzz_text(data, size);
  double value = -7.25; /* stays when there is no number */
  const char *end = hapi_number_read(text, &value);
  if (end == NULL) {
    /* What begins like a number is one: in decimal, and within the range of a double. */
    const char *digit = text + (*text == '+' || *text == '-');
    bool hex = digit[0] == '0' && (digit[1] == 'x' || digit[1] == 'X');
    FUZZ_CHECK(value == -7.25);
    FUZZ_CHECK(!isdigit((unsigned char)*digit) || hex || !isfinite(strtod(text, NULL)));
  } else {
    size_t length = (size_t)(end - text);
    FUZZ_CHECK(length > 0 && length <= strlen(text));
    FUZZ_CHECK(strspn(text, "0123456789+-.eE") >= length);
    FUZZ_CHECK(isfinite(value));
    text[length] = '\0'; /* a number means the same whatever follows */
    double again = 0.0;
    FUZZ_CHECK(hapi_number_read(text, &again) == end && again == value);
    FUZZ_CHECK(strtod(text, NULL) == value);
  }
  free(text);
}
