/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/common/arguments.h, with a table that has every kind of argument */

#include <math.h>

#include "plugins/common/arguments.h"
#include "tests/fuzz/fuzz.h"

enum argument {
  NUMBER,
  VECTOR,
  QUATERNION,
  WORD,
  TEXT,
  ARGUMENT_COUNT
};

static const char *const words[] = {"on", "off", "onward", NULL};

static const hapi_argument known[ARGUMENT_COUNT] = {
    [NUMBER] = {"n", HAPI_ARGUMENT_NUMBER, false, -2.0, 1e3, "a number from -2 to 1000",
                .number = {1.0}},
    [VECTOR] = {"v", HAPI_ARGUMENT_VECTOR, false, -1e6, 1e6, "x/y/z within 1e6"},
    [QUATERNION] = {"q", HAPI_ARGUMENT_QUATERNION, .expected = "w/x/y/z, not all zero",
                    .number = {1.0}},
    [WORD] = {"word", HAPI_ARGUMENT_WORD, .expected = "on, off or onward", .words = words},
    [TEXT] = {"text", HAPI_ARGUMENT_TEXT, .expected = "a text"},
};

static void check_range(const hapi_argument *argument, int count)
{
  for (int i = 0; i < count; ++i) {
    FUZZ_CHECK(argument->number[i] >= argument->least && argument->number[i] <= argument->most);
  }
}

static void check_values(const hapi_argument *entries, const char *text)
{
  check_range(&entries[NUMBER], 1);
  check_range(&entries[VECTOR], 3);
  const double *q = entries[QUATERNION].number;
  FUZZ_CHECK(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-12);
  const hapi_argument *turn = &entries[QUATERNION];
  FUZZ_CHECK(!turn->given || strcspn(turn->text, "123456789") < turn->length); /* not zero */
  FUZZ_CHECK(entries[WORD].word < 3);
  const hapi_argument *given = &entries[TEXT];
  if (given->given) {
    FUZZ_CHECK(given->length > 0 && given->text > text);
    FUZZ_CHECK(given->text + given->length <= text + strlen(text));
    FUZZ_CHECK(memchr(given->text, ',', given->length) == NULL);
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char *text = fuzz_text(data, size);
  hapi_argument entries[ARGUMENT_COUNT];
  memcpy(entries, known, sizeof entries);
  const hapi_argument_table table = {"fuzz", entries, ARGUMENT_COUNT};
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  hap_status status = hapi_arguments_read(&table, text, &detail);
  fuzz_check_answer(status, status >= HAP_OK ? text : NULL, &detail);
  if (status >= HAP_OK) {
    check_values(entries, text);
  } else {
    FUZZ_CHECK(status == HAP_ERROR_ARGUMENT);
    FUZZ_CHECK(strstr(detail.text, "known: n, v, q, word, text") != NULL);
  }
  free(text);
}
