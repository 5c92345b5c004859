/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Heat of the motors. Current goes as tension, heat as its square, and leaves through one thermal
 * resistance and capacity. In units of what heat_tension makes in the end: heat_time d share/dt =
 * (tension / heat_tension)^2 - share. */

#include "base/assert.h"
#include "base/vec.h"
#include "plugins/spidar/tensions.h"

#define LIMITED_FROM 0.8
#define HELD_MAX 10.0 /* of max_tension: no motor holds more, a bad number does */

void hapi_spidar_heat_init(hapi_spidar_heat *heat, double share)
{
  for (int i = 0; i < HAPI_SPIDAR_STRINGS_MAX; ++i) {
    heat->share[i] = share >= 0.0 && share <= 1.0 ? share : 1.0;
  }
}

/* The power that may come in, in units of that of heat_tension; at share 1 it equals what goes out.
 * step: length of the next step over heat_time; share must stay within 1 after it, too. */
static double allowed_power(const hapi_spidar_model *model, double share, double step)
{
  double most = model->max_tension / model->heat_tension;
  double left = fmax(0.0, 1.0 - share);
  double open = fmin(1.0, left / (1.0 - LIMITED_FROM));
  double power = 1.0 + fmax(0.0, most * most - 1.0) * open * open;
  return step > 0.0 ? fmin(power, 1.0 + left / step) : power;
}

void hapi_spidar_heat_step(hapi_spidar_heat *heat, const hapi_spidar_model *model,
                           const double tension[HAPI_SPIDAR_STRINGS_MAX], double seconds,
                           double out_most[HAPI_SPIDAR_STRINGS_MAX])
{
  HAPI_ASSERT(model->heat_time > 0.0 && model->heat_tension > 0.0);
  double step = seconds > 0.0 && seconds < HUGE_VAL ? seconds / model->heat_time : 0.0;
  for (int i = 0; i < model->strings; ++i) {
    double held =
        fabs(tension[i]) <= HELD_MAX * model->max_tension ? tension[i] : model->max_tension;
    double ratio = held / model->heat_tension;
    /* implicit: good for a step of any length */
    heat->share[i] = (heat->share[i] + step * ratio * ratio) / (1.0 + step);
    double power = allowed_power(model, heat->share[i], step);
    out_most[i] = fmin(model->max_tension, model->heat_tension * sqrt(power));
  }
}
