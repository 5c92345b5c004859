/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_DIAL_TURN_H
#define HAPODE_ACCURACY_DIAL_TURN_H

#include <stdbool.h>

/* When a dial is turned: at once where a load is above 1, and back where it has been low for a
 * while. A load that comes again soon after that makes the next while twice as long, so that a
 * dial between two positions does not go to and fro. */

typedef struct hapi_turn {
  double low_s;      /* that the load has been low */
  double since_s;    /* the last turn back */
  bool tried;        /* it is the last turn */
  double patience_s; /* that it is to be low; 0: not begun */
} hapi_turn;

/* Steps that relieve the load: 3 where it is above 2, 1 where above 1, -1 where one may be taken
 * back, else 0. seconds: that the load was measured over. */
int hapi_turn_by(hapi_turn *turn, double load, double seconds);

#endif
