/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_SPACEMOUSE_H
#define HAPODE_TOOLS_RUN_SPACEMOUSE_H

/* A SpaceMouse through libspnav, which is loaded where it is there (Debian: libspnav0, and the
 * daemon spacenavd). Nothing of it is needed to build. */

#include <stdbool.h>

typedef struct run_spacemouse {
  void *library; /* NULL: there is none, or no daemon answers */
  int (*poll)(void *event);
  int (*close)(void);
  double deflection[6];
} run_spacemouse;

/* May take 0.3 s, in which the daemon is asked for its version. */
void run_spacemouse_open(run_spacemouse *out);
void run_spacemouse_close(run_spacemouse *mouse);

/* How far the cap is out of its middle, -1 to 1: pushed to the right, up, away from the user, then
 * turned about the axes to the right, up, towards the user. False: it is in its middle, or there is
 * no SpaceMouse. */
bool run_spacemouse_read(run_spacemouse *mouse, double out[6]);

#endif
