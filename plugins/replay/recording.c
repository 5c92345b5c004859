/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/replay/recording.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "plugins/replay/csv.h"

#define ROWS_MAX 50000000u
#define ROWS_FIRST 1024u
/* With these bounds no slope or curvature of the spline can leave the range of a double. */
#define TIME_MAX 1e10 /* s; has room for a count of seconds since 1970 */
#define STEP_MIN 1e-9 /* s */
#define PLACE_MAX 1e6 /* m */

static size_t row_bytes(const hapi_recording *recording)
{
  return (size_t)(1 + recording->channels) * sizeof(double);
}

/* No realloc behind the hooks; half as much again keeps the peak below three times the rows. */
static hap_status recording_grow(hapi_recording *recording, size_t *capacity, const hapi_csv *csv,
                                 hap_detail *detail)
{
  if (*capacity >= ROWS_MAX) {
    return hapi_csv_fail(csv, HAP_ERROR_CAPACITY, "more than 50 million rows", detail);
  }
  size_t wanted = *capacity < ROWS_FIRST ? ROWS_FIRST : *capacity + *capacity / 2;
  wanted = wanted < ROWS_MAX ? wanted : ROWS_MAX;
  double *rows = hapi_alloc_array(wanted, row_bytes(recording));
  if (rows == NULL) {
    return hapi_csv_fail(csv, HAP_ERROR_MEMORY, "no memory for the rows", detail);
  }
  if (recording->count > 0) {
    memcpy(rows, recording->rows, recording->count * row_bytes(recording));
  }
  hapi_free(recording->rows);
  recording->rows = rows;
  *capacity = wanted;
  return HAP_OK;
}

/* Unit, and on the side of the previous one: q and -q are the same turn, but not to a spline. */
static bool settle_quaternion(double q[4], const double *previous)
{
  double largest = 0.0;
  for (int i = 0; i < 4; ++i) {
    largest = fmax(largest, fabs(q[i]));
  }
  if (largest < 1e-6 || largest > 1e6) {
    return false;
  }
  hapi_quat_normalize(q);
  double along = 1.0;
  if (previous != NULL) {
    along = q[0] * previous[0] + q[1] * previous[1] + q[2] * previous[2] + q[3] * previous[3];
  }
  for (int i = 0; i < 4 && along < 0.0; ++i) {
    q[i] = -q[i];
  }
  return true;
}

/* NULL when the row is good, else what is wrong. */
static const char *settle_row(double *row, const double *previous, int channels)
{
  if (fabs(row[0]) > TIME_MAX) {
    return "t is beyond 1e10 s";
  }
  if (previous != NULL && !(row[0] > previous[0])) {
    return "t does not increase";
  }
  if (previous != NULL && row[0] - previous[0] < STEP_MIN) {
    return "t increases by less than 1 ns";
  }
  for (int i = 1; i < 4; ++i) {
    if (fabs(row[i]) > PLACE_MAX) {
      return "the position is beyond 1e6 m";
    }
  }
  if (channels == 7 && !settle_quaternion(row + 4, previous != NULL ? previous + 4 : NULL)) {
    return "the quaternion has no direction (zero, or beyond 1e6)";
  }
  return NULL;
}

static hap_status read_rows(hapi_recording *recording, hapi_csv *csv, hap_detail *detail)
{
  size_t capacity = 0;
  double row[HAPI_CSV_COLUMNS_MAX];
  hap_status status;
  while ((status = hapi_csv_next(csv, row, detail)) == HAP_OK) {
    const double *previous =
        recording->count > 0 ? hapi_recording_row(recording, recording->count - 1) : NULL;
    const char *wrong = settle_row(row, previous, recording->channels);
    if (wrong != NULL) {
      return hapi_csv_fail(csv, HAP_ERROR_FORMAT, wrong, detail);
    }
    if (recording->count == capacity) {
      status = recording_grow(recording, &capacity, csv, detail);
      if (status < 0) {
        return status;
      }
    }
    memcpy(recording->rows + recording->count * (size_t)(1 + recording->channels), row,
           row_bytes(recording));
    ++recording->count;
  }
  if (status == HAP_END && recording->count == 0) {
    return hapi_csv_fail(csv, HAP_ERROR_FORMAT, "the header is followed by no row", detail);
  }
  return status < 0 ? status : HAP_OK;
}

hap_status hapi_recording_load(hapi_recording *recording, const char *path, hap_detail *detail)
{
  *recording = (hapi_recording){.count = 0};
  hapi_csv csv;
  hap_status status = hapi_csv_open(&csv, path, detail);
  if (status == HAP_OK) {
    recording->channels = csv.columns - 1;
    status = read_rows(recording, &csv, detail);
  }
  hapi_csv_close(&csv);
  return status;
}

void hapi_recording_finish(hapi_recording *recording)
{
  hapi_free(recording->rows);
  hapi_free(recording->curvature);
  *recording = (hapi_recording){.count = 0};
}
