/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hap_device_open. "replay:3" and "replay:7" are recordings that exist. */

#include <unistd.h>

#include "tests/fuzz/device_check.h"
#include "tests/fuzz/fuzz.h"

#define REPLAY "replay:"
#define MODULE "module:"

static const char places[] = "t,x,y,z\n0,0,0,0\n0.5,0.1,0,0\n1,0.1,-0.2,0.3\n";
static const char poses[] =
    "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.5,0.1,0,0,0.7,0.7,0,0\n1,0,0,1,0,0,-1,0\n";

/* False for what could be any file of the machine, or any service. */
static bool is_harmless(const char *spec)
{
  static const char *const keys[] = {"library=", "host=", "port="};
  for (size_t i = 0; i < sizeof keys / sizeof keys[0]; ++i) {
    if (strstr(spec, keys[i]) != NULL) {
      return false;
    }
  }
  size_t length = strcspn(spec, ":");
  bool file =
      strncmp(spec, REPLAY, strlen(REPLAY)) == 0 || strncmp(spec, MODULE, strlen(MODULE)) == 0;
  return !file || memchr(spec + length, '/', strcspn(spec + length, ",")) == NULL;
}

static void open_recording(const char *recording, const char *rest)
{
  char path[40];
  int descriptor = fuzz_file((const uint8_t *)recording, strlen(recording), path, sizeof path);
  size_t size = strlen(REPLAY) + strlen(path) + strlen(rest) + 1;
  char *spec = malloc(size);
  FUZZ_CHECK(spec != NULL);
  snprintf(spec, size, REPLAY "%s%s", path, rest);
  fuzz_device(spec);
  free(spec);
  close(descriptor);
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char *spec = fuzz_text(data, size);
  size_t length = strlen(REPLAY);
  if (strncmp(spec, REPLAY "3", length + 1) == 0) {
    open_recording(places, spec + length + 1);
  } else if (strncmp(spec, REPLAY "7", length + 1) == 0) {
    open_recording(poses, spec + length + 1);
  } else if (is_harmless(spec)) {
    fuzz_device(spec);
  }
  free(spec);
}
