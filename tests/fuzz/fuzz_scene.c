/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* scene_create: "name" or "name:N" */

#include "base/vec.h"
#include "scenes/build.h"
#include "tests/fuzz/fuzz.h"

#define COUNT_BUILT 200 /* a larger N is as good and takes longer */

static void check_scene(const scene *s)
{
  FUZZ_CHECK(s->body_count > 0 && s->count >= 0 && s->count <= SCENE_COUNT_MAX);
  for (size_t i = 0; i < s->body_count; ++i) {
    FUZZ_CHECK(hapi_finite(dBodyGetPosition(s->bodies[i]), 3));
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  static bool initialised;
  if (!initialised) {
    dInitODE2(0);
    initialised = true;
  }
  char *spec = fuzz_text(data, size);
  const char *colon = strchr(spec, ':');
  long count = colon != NULL ? strtol(colon + 1, NULL, 10) : 0;
  if (count <= COUNT_BUILT || count > SCENE_COUNT_MAX) {
    scene *s = (scene *)&spec; /* must be overwritten */
    hap_detail detail;
    fuzz_detail_spoil(&detail);
    hap_status status = scene_create(spec, &s, &detail);
    fuzz_check_answer(status, s, &detail);
    if (status >= HAP_OK) {
      check_scene(s);
    } else {
      FUZZ_CHECK(strstr(detail.text, "there are: ") != NULL);
    }
    scene_destroy(s);
  }
  free(spec);
}
