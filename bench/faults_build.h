/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_FAULTS_BUILD_H
#define HAPODE_BENCH_FAULTS_BUILD_H

/* What the scenes of hapode-bench faults are built from. */

#include "bench/faults.h"

#define FAULTS_LAYER 1e-4 /* m, contact surface layer of the worlds */

void faults_gravity(faults_world *w);

/* A body with the mass of a box. */
dBodyID faults_body(faults_world *w, double mass, const double size[3], const double at[3]);

/* body NULL: it stands in the world, at. Else it is the body's, about its middle. */
dGeomID faults_box(faults_world *w, dBodyID body, const double size[3], const double at[3]);

/* Arguments: a path or NULL, then other members. */
#define FINGER(...)                                          \
  {                                                          \
    .radius = 0.01, .stiffness = 1000.0, .path = __VA_ARGS__ \
  }
#define FINGERTIP(...)                                        \
  {                                                           \
    .radius = 0.005, .stiffness = 1000.0, .path = __VA_ARGS__ \
  }
/* Arguments: kind, bound, then other members. */
#define JUDGED(...) \
  {                 \
    __VA_ARGS__     \
  }
/* Arguments: the bound, then other members. */
#define WITHIN(...)                            \
  {                                            \
    .kind = FAULTS_FORCE, .bound = __VA_ARGS__ \
  }

#endif
