/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_DIAL_SETTINGS_H
#define HAPODE_ACCURACY_DIAL_SETTINGS_H

/* What the dials come to: a table from the positions of the tick's and of the physics thread's
 * dial to the single settings. Positions are in percent, so that one fits into a byte of a
 * recording. */

#include "world/settings.h"

#define HAPI_DIAL_MOST 100
#define HAPI_DIAL_DEFAULT 50 /* HAP_ACCURACY_DEFAULT */

/* period_s: of a tick. */
void hapi_dial_settings(const hapi_knobs *knobs, int tick_percent, int physics_percent,
                        double period_s, hapi_settings *out);

static inline int hapi_dial_percent(double accuracy) /* 0..1 */
{
  return (int)(100.0 * accuracy + 0.5);
}

#endif
