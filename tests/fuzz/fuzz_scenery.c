/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* remote/scenery.h: one message that tells where bodies are. */

#include "fuzz.h"

#include "base/assert.h"
#include "remote/scenery.h"

void fuzz_one(const uint8_t *data, size_t size)
{
  hapi_told_body told[HAPI_SCENERY_MOST];
  unsigned char again[HAP_LINK_NEWEST_MOST];
  hapi_told_body twice[HAPI_SCENERY_MOST];
  uint64_t numbers[2] = {0, 0};
  uint32_t count = hapi_scenery_read(data, (uint32_t)size, &numbers[0], told);
  FUZZ_CHECK(count <= HAPI_SCENERY_MOST);
  for (uint32_t i = 0; i < count; ++i) {
    FUZZ_CHECK(told[i].name > 0 && told[i].birth > 0);
    FUZZ_CHECK(hapi_assert_is_unit(told[i].pose.quat_wxyz, 4));
    FUZZ_CHECK(hapi_assert_is_finite(told[i].pose.position, 3));
  }
  if (count > 0) { /* what was read can be written, and is read alike */
    uint32_t bytes = hapi_scenery_write(numbers[0], told, count, again);
    FUZZ_CHECK(bytes == size);
    FUZZ_CHECK(hapi_scenery_read(again, bytes, &numbers[1], twice) == count);
    FUZZ_CHECK(numbers[0] == numbers[1] && told[0].name == twice[0].name);
  }
}
