/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* plugins/replay: the bytes are the file. */

#include <math.h>
#include <unistd.h>

#include "base/vec.h"
#include "plugins/replay/recording.h"
#include "plugins/replay/spline.h"
#include "tests/fuzz/device_check.h"
#include "tests/fuzz/fuzz.h"

#define TIME_MAX 1e10
#define STEP_MIN 1e-9
#define PLACE_MAX 1e6
#define ROWS_LOOKED_AT 50

static void check_row(const hapi_recording *recording, size_t index)
{
  const double *row = hapi_recording_row(recording, index);
  FUZZ_CHECK(fabs(row[0]) <= TIME_MAX);
  FUZZ_CHECK(index == 0 || row[0] - hapi_recording_row(recording, index - 1)[0] >= STEP_MIN);
  for (int i = 1; i < 4; ++i) {
    FUZZ_CHECK(fabs(row[i]) <= PLACE_MAX);
  }
  if (recording->channels == 7) {
    const double *q = row + 4;
    FUZZ_CHECK(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-12);
  }
}

/* The spline meets its rows, and has no place without a value. */
static void check_segment(const hapi_recording *recording, size_t index)
{
  const double *from = hapi_recording_row(recording, index);
  const double *to = hapi_recording_row(recording, index + 1);
  double value[HAPI_RECORDING_CHANNELS_MAX];
  double slope[HAPI_RECORDING_CHANNELS_MAX];
  FUZZ_CHECK(hapi_spline_find(recording, from[0], 0) == index);
  hapi_spline_at(recording, index, from[0], value, slope);
  FUZZ_CHECK(hapi_finite(slope, recording->channels));
  for (int i = 0; i < recording->channels; ++i) {
    FUZZ_CHECK(value[i] == from[1 + i]);
  }
  for (int k = 1; k <= 4; ++k) {
    hapi_spline_at(recording, index, from[0] + 0.25 * k * (to[0] - from[0]), value, slope);
    FUZZ_CHECK(hapi_finite(value, recording->channels) && hapi_finite(slope, recording->channels));
  }
}

static void check_recording(const hapi_recording *recording)
{
  FUZZ_CHECK(recording->count > 0);
  FUZZ_CHECK(recording->channels == 3 || recording->channels == 7);
  for (size_t i = 0; i < recording->count; ++i) {
    check_row(recording, i);
  }
  for (size_t i = 0; i + 1 < recording->count && i < ROWS_LOOKED_AT; ++i) {
    check_segment(recording, i);
  }
}

void fuzz_one(const uint8_t *data, size_t size)
{
  char spec[64] = "replay:";
  char *path = spec + strlen(spec);
  int descriptor = fuzz_file(data, size, path, sizeof spec - strlen(spec));
  hapi_recording recording;
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  hap_status status = hapi_recording_load(&recording, path, &detail);
  if (status >= HAP_OK) {
    status = hapi_spline_solve(&recording, &detail);
  }
  fuzz_check_answer(status, status >= HAP_OK ? &recording : NULL, &detail);
  if (status >= HAP_OK) {
    check_recording(&recording);
  } else {
    FUZZ_CHECK(status == HAP_ERROR_FORMAT || status == HAP_ERROR_MEMORY);
  }
  hapi_recording_finish(&recording);
  if (!fuzz_starved()) {
    fuzz_device(spec);
  }
  close(descriptor);
}
