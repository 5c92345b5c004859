/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_RATES_H
#define HAPODE_PLUGINS_SPIDAR_RATES_H

/* Rates of the strings from their counts. The rounding of a count is known exactly, that of a pose
 * is not. So each string has its own window, and hapi_spidar_twist makes the twist from the rates.
 * A window is the longest one over which a straight line stays within a count of every sample; the
 * rate is the slope of the least-squares line in it. Windows are short when the motion turns and
 * long when it is slow. Janabi-Sharifi, Hayward, Chen, IEEE Trans. Control Systems Technology 8(6),
 * 2000. Pure: no heap, no lock, no system call, bounded time. */

#include <stdint.h>

#include "plugins/spidar/model.h"

#define HAPI_SPIDAR_RATES_SAMPLES 32

typedef struct hapi_spidar_rates {
  uint32_t newest;
  uint32_t count;                             /* of valid samples */
  int64_t time_ns[HAPI_SPIDAR_RATES_SAMPLES]; /* rings */
  double counts[HAPI_SPIDAR_STRINGS_MAX][HAPI_SPIDAR_RATES_SAMPLES];
} hapi_spidar_rates;

/* Forgets all samples. */
void hapi_spidar_rates_reset(hapi_spidar_rates *rates);

/* Takes the unwrapped counts that were read at time_ns and gives the rates of the lengths [m/s]
 * there; zero after the first sample. Counts at the time of those before take their place; a time
 * that goes back, and a count that is not finite, make it begin anew. */
void hapi_spidar_rates_update(hapi_spidar_rates *rates, const hapi_spidar_model *model,
                              int64_t time_ns, const double counts[HAPI_SPIDAR_STRINGS_MAX],
                              double out_rates[HAPI_SPIDAR_STRINGS_MAX]);

#endif
