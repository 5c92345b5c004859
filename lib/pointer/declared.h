/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_DECLARED_H
#define HAPODE_POINTER_DECLARED_H

/* What a hand shall feel beside its contacts, by wish and not by simulation: own forces,
 * vibrations, textures. It goes to the guard beside hapi_pointer.wrench: the energy observer judges
 * contacts alone, and a vibration that is meant is no swing. World frame and units, as
 * hapi_pointer.wrench.
 *
 * Once a tick it is emptied, when the device was read. From there to the guard everyone adds who
 * has something: finite, and within what was promised of it. Zeroed: nothing is declared. */

#include <stdbool.h>

#include <hapode/spatial.h>

#include "base/vec.h"

/* Of what gives energy by a promise of its power: guard/promise.h. */
typedef struct hapi_purse {
  double joules; /* that it may give */
  hap_wrench last;
} hapi_purse;

typedef struct hapi_declared {
  bool any;  /* in this tick */
  bool was;  /* in the tick before */
  bool held; /* some of it was more than was promised, and was shortened */
  /* Goes by where the hand is: springs, textures. The device may swing by it. */
  hap_wrench follows;
  double stiffness; /* N/m, at most: change of follows.force with the way */
  /* Goes by time: what it does to the hand is meant. */
  hap_wrench driven;
  hap_wrench given; /* device frame and units: the part of the wrench for the device */
  /* Since the tick before, where something was declared then: */
  double way[3];  /* m, of the hand */
  double turn[3]; /* rad */
  double work;    /* J, that the driven part did on the hand */
} hapi_declared;

/* The device was read, and has gone on by a way and a turn. */
static inline void hapi_declared_begin(hapi_declared *d, const double way[3], const double turn[3])
{
  double work = hapi_v3_dot(d->driven.force, way) + hapi_v3_dot(d->driven.torque, turn);
  *d = (hapi_declared){.was = d->any, .work = work};
  if (d->was) {
    hapi_v3_copy(way, d->way);
    hapi_v3_copy(turn, d->turn);
  }
}

static inline void hapi_wrench_add(hap_wrench *io, const hap_wrench *more)
{
  hapi_v3_add(io->force, more->force, io->force);
  hapi_v3_add(io->torque, more->torque, io->torque);
}

/* stiffness: N/m, no less than what turns a way into this force; 0 where it does not follow one. */
static inline void hapi_declare_following(hapi_declared *d, const hap_wrench *wrench,
                                          double stiffness)
{
  d->any = true;
  d->stiffness += stiffness;
  hapi_wrench_add(&d->follows, wrench);
}

static inline void hapi_declare_driven(hapi_declared *d, const hap_wrench *wrench)
{
  d->any = true;
  hapi_wrench_add(&d->driven, wrench);
}

#endif
