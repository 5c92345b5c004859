/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_REPLAY_RECORDING_H
#define HAPODE_PLUGINS_REPLAY_RECORDING_H

/* A recording in memory: rows as read, quaternions unit and without jumps of sign. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

#define HAPI_RECORDING_CHANNELS_MAX 7

typedef struct hapi_recording {
  size_t count;      /* rows, at least 1 */
  int channels;      /* 3: position; 7: quaternion as well */
  double *rows;      /* count x (1 + channels): t [s], x, y, z [m], w, x, y, z */
  double *curvature; /* count x channels: second derivatives, by hapi_spline_solve */
} hapi_recording;

/* HAP_ERROR_IO, _FORMAT with file and line, _CAPACITY beyond 50 million rows, _MEMORY. Finish it
 * also after an error. */
HAP_NODISCARD hap_status hapi_recording_load(hapi_recording *recording, const char *path,
                                             hap_detail *detail);
void hapi_recording_finish(hapi_recording *recording);

static inline const double *hapi_recording_row(const hapi_recording *recording, size_t index)
{
  return recording->rows + index * (size_t)(1 + recording->channels);
}

#endif
