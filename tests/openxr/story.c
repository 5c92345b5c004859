/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "story.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846

/* Height from to height to, between two times, with no velocity at either. */
typedef struct story_leg {
  double begin, end;
  double from, to;
} story_leg;

static const story_leg touch_legs[] = {
    {0.3, 0.6, 0.05, 0.006}, /* down onto the floor: 4 mm into it, as the ball has 10 mm */
    {1.4, 1.4, 0.006, 0.05}, /* it comes back elsewhere after it was lost */
    {1.6, 1.9, 0.05, 0.006}, /* and touches again */
    {2.9, 3.1, 0.006, 0.05}, /* up, and on to the box */
};

bool story_hand_at(const char *story, double time, story_hand *out)
{
  *out = (story_hand){{0, 0.05, 0}, {0, 0, 0}};
  for (size_t i = 0; i < sizeof touch_legs / sizeof *touch_legs; ++i) {
    const story_leg *leg = &touch_legs[i];
    double whole = leg->end - leg->begin;
    if (time >= leg->end) {
      out->position[1] = leg->to;
    } else if (time > leg->begin) {
      double phase = PI * (time - leg->begin) / whole;
      out->position[1] = leg->from + (leg->to - leg->from) * 0.5 * (1 - cos(phase));
      out->velocity[1] = (leg->to - leg->from) * 0.5 * PI / whole * sin(phase);
    }
  }
  if (time >= 1.4) {
    out->position[0] = 0.05;
  }
  return strcmp(story, "touch") != 0 || time < 1.0 || time >= 1.4;
}

/* To the box, whose face is at 0.45 m, and on for a while. */
double story_stick(const char *story, double time)
{
  (void)story;
  return time >= 3.1 && time < 3.8 ? 0.8 : 0.0;
}

XrSessionState story_state(const char *story, double time)
{
  if (time > 4.2) {
    return XR_SESSION_STATE_STOPPING;
  }
  bool looks_away = strcmp(story, "touch") == 0 && time >= 2.2 && time < 2.6;
  return looks_away ? XR_SESSION_STATE_VISIBLE : XR_SESSION_STATE_FOCUSED;
}
