/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_STORM_HAND_H
#define HAPODE_BENCH_STORM_HAND_H

/* A device on a circle, which nothing stops, that keeps book of every force it is given. */

#include <stdatomic.h>
#include <stdint.h>

#include <hapode/device.h>

#define STORM_FORCE 10.0 /* N, of the device */
#define STORM_SLEW 5.0   /* N a tick at 1 kHz: the default slew limit of such a device */

typedef struct storm_book {
  uint64_t writes;
  uint64_t bad; /* not finite, beyond the limit, too steep, or to a device that does not run */
  uint64_t stops_with_force;
  double peak;       /* N */
  double steepest;   /* N, between two writes */
  atomic_bool holds; /* a force */
} storm_book;

/* On a circle of radius [m] about center [m], hz turns a second. */
hap_status storm_hand_open(const double center[3], double radius, double hz, hap_device **out,
                           hap_detail *detail);
const storm_book *storm_hand_book(hap_device *device); /* while no loop has it */

#endif
