/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_REPLAY_SPLINE_H
#define HAPODE_PLUGINS_REPLAY_SPLINE_H

/* The natural cubic spline through a recording: twice differentiable, exact at the rows, no filter.
 * A device at 1 kHz would feel the steps of velocity that straight pieces between 100 Hz rows
 * have. */

#include "plugins/replay/recording.h"

/* Fills recording->curvature. HAP_ERROR_MEMORY. */
HAP_NODISCARD hap_status hapi_spline_solve(hapi_recording *recording, hap_detail *detail);

/* The segment, from row index to the next one, that holds time, searched from near on: a few
 * comparisons when time has moved by a few rows, bisection else. time is within the recording. */
size_t hapi_spline_find(const hapi_recording *recording, double time, size_t near);

/* All channels and their derivatives at a time of that segment. */
void hapi_spline_at(const hapi_recording *recording, size_t segment, double time,
                    double value[HAPI_RECORDING_CHANNELS_MAX],
                    double slope[HAPI_RECORDING_CHANNELS_MAX]);

#endif
