/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_CONFORM_H
#define HAPODE_TOOLS_CONFORM_H

/* Holds a device against the contract of hapode/device_impl.h, point by point. It knows nothing
 * about the particular device. docs/writing-a-device.md lists the points. */

#include <stdbool.h>
#include <stdio.h>

typedef struct conform_options {
  const char *spec;
  double rate_hz;  /* of reads and writes */
  double force;    /* N, the largest that is asked for while the device obeys; 0: no force */
  double wait_s;   /* warning before the device is energised; a virtual device needs none */
  bool limits;     /* also ask for more than the device can: if it is wrong, it may give all it
                         has, for less than a tick */
  double unplug_s; /* 0: no; else a person pulls the plug and puts it in again, so long for each */
  bool (*stop)(void); /* asked at every tick; true ends the check with the force taken off */
} conform_options;

#define CONFORM_FORCE_MAX 1.0
#define CONFORM_FORCE_DEFAULT 0.3

/* Test Anything Protocol on out, warnings on stderr. True: every point holds. It does not come back
 * when a function of the device does not: then the force is taken off and the process ends with
 * 1. */
bool conform_run(const conform_options *options, FILE *out);

#endif
