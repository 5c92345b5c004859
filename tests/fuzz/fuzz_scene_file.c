/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* import: the bytes are a scene file. What is taken is a scene of finite bodies; what is refused
 * leaves none. */

#include <unistd.h>

#include "base/vec.h"
#include "import/import.h"
#include "tests/fuzz/fuzz.h"

#define SIZE_MOST 20000 /* a larger one is as good and takes longer */

static void check_line(void *user, const char *line)
{
  size_t *count = user;
  ++*count;
  FUZZ_CHECK(strchr(line, ':') != NULL && strlen(line) < sizeof(hap_detail));
}

static void check_scene(const hap_scene *scene)
{
  hap_scene_counts counts;
  FUZZ_CHECK(hap_scene_count(scene, &counts, sizeof counts) == HAP_OK);
  for (uint32_t i = 0; i < counts.bodies; ++i) {
    hap_scene_body body;
    FUZZ_CHECK(hap_scene_get_body(scene, i, &body, sizeof body) == HAP_OK);
    FUZZ_CHECK(body.mass > 0.0 && hapi_finite(body.pose.position, 3));
    FUZZ_CHECK(hapi_finite(&body.inertia[0][0], 9));
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char path[64];
  hap_detail detail;
  size_t lines = 0;
  size_t told = 0;
  const import_options options = {.said = check_line, .user = &lines};
  hap_scene *scene = (hap_scene *)&detail; /* must be overwritten */
  if (size > SIZE_MOST) {
    return;
  }
  int descriptor = fuzz_file(data, size, path, sizeof path);
  fuzz_detail_spoil(&detail);
  hap_status status = import_scene(path, &options, &scene, &told, &detail);
  fuzz_check_answer(status, scene, &detail);
  FUZZ_CHECK(told == lines);
  if (status >= HAP_OK) {
    check_scene(scene);
  }
  FUZZ_CHECK(hap_scene_destroy(scene) == HAP_OK);
  close(descriptor);
}
