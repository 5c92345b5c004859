/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef TESTS_OPENXR_STORY_H
#define TESTS_OPENXR_STORY_H

/* What happens to a person with a headset, by seconds. Frame: the stage, y up. */

#include <openxr/openxr.h>
#include <stdbool.h>

typedef struct story_hand {
  double position[3]; /* m */
  double velocity[3]; /* m/s, the derivative */
} story_hand;

/* False: it is not tracked. */
bool story_hand_at(const char *story, double time, story_hand *out);
double story_stick(const char *story, double time); /* forwards */
XrSessionState story_state(const char *story, double time);

#endif
