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

void faults_hand_at(double out_position[3], double out_velocity[3], double x, double y, double z);

/* Adds a way with soft ends along one axis, from begin to end [s]. */
void faults_glide(double t, double begin, double end, double way, double *io_position,
                  double *io_velocity);

#endif
