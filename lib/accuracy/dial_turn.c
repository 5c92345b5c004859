/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "accuracy/dial_turn.h"

#define ROOM 0.6 /* a load below it leaves room for a step */
#define FAR_OVER 2.0
#define FAR_STEPS 3
#define PATIENCE_S 1.0
#define PATIENCE_MOST_S 60.0
#define SOON 2.0 /* times the patience */

int hapi_turn_by(hapi_turn *turn, double load, double seconds)
{
  turn->patience_s = turn->patience_s > 0.0 ? turn->patience_s : PATIENCE_S;
  turn->since_s += seconds;
  turn->low_s = load < ROOM ? turn->low_s + seconds : 0.0;
  if (load > 1.0) {
    double longer = 2.0 * turn->patience_s;
    if (turn->tried && turn->since_s < SOON * turn->patience_s) {
      turn->patience_s = longer < PATIENCE_MOST_S ? longer : PATIENCE_MOST_S;
    }
    turn->tried = false;
    return load > FAR_OVER ? FAR_STEPS : 1;
  }
  if (turn->low_s < turn->patience_s) {
    return 0;
  }
  turn->low_s = turn->since_s = 0.0;
  turn->tried = true;
  return -1;
}
