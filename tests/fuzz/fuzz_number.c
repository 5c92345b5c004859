/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/common/number.h */

#include <math.h>

#include "plugins/common/number.h"
#include "tests/fuzz/fuzz.h"

void fuzz_one(const uint8_t *data, size_t size)
{
  char *text = fuzz_text(data, size);
  double value = -7.25; /* stays when there is no number */
  const char *end = hapi_number_read(text, &value);
  if (end == NULL) {
    FUZZ_CHECK(value == -7.25);
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
