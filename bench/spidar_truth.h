/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_SPIDAR_TRUTH_H
#define HAPODE_BENCH_SPIDAR_TRUTH_H

/* What the numerics of plugins/spidar are held against, by the bench and by tests: motions of a
 * known pose and twist, what rounding of the counts can do, the box-constrained problem by
 * trying all active sets. */

#include <stdint.h>

#include "plugins/spidar/box_qp.h"
#include "plugins/spidar/kinematics.h"

#define SPIDAR_TICK_S 0.001

/* -1 .. 1, the same sequence everywhere. */
double spidar_random(uint64_t *seed);

/* In the workspace scaled by share; turned by up to workspace_turn times share about any axis. */
void spidar_random_pose(const hapi_spidar_model *model, double share, uint64_t *seed,
                        hap_pose *out);

/* A circle about a point, and an axis of turn that goes round: constant speeds. */
typedef struct spidar_motion {
  double middle[3];
  double across[2][3]; /* m, radii of the circle */
  double hz;           /* rad/s on the circle */
  double turn;         /* rad */
  double turn_hz;      /* rad/s of the axis */
  double axis[2][3];   /* that the axis of turn lies between */
} spidar_motion;

/* A random one within the workspace, of that speed [m/s] and, for 6 dof, angular speed [rad/s]. */
void spidar_motion_init(spidar_motion *motion, const hapi_spidar_model *model, double speed,
                        double turn_speed, uint64_t *seed);
void spidar_motion_at(const spidar_motion *motion, double time, hap_pose *pose);

/* By central difference. */
void spidar_motion_twist(const spidar_motion *motion, double time, hap_twist *out);

/* Counts, rounded, of a model whose offsets are what they are. */
void spidar_counts(const hapi_spidar_model *model, const hap_pose *pose,
                   double out_counts[HAPI_SPIDAR_STRINGS_MAX]);

/* m and rad. */
double spidar_distance(const hap_pose *a, const hap_pose *b);
double spidar_turn_between(const hap_pose *a, const hap_pose *b);

/* The largest error of position [m] and turn [rad] that half a count on each string can make in
 * the pose of least squares there, to first order: over all signs. */
void spidar_rounding_bound(const hapi_spidar_model *model, const hap_pose *pose,
                           double *out_position, double *out_turn);

/* The solution by trying all 3^n sets; false: none of them fulfils the conditions of a minimum. */
bool spidar_brute_force(const hapi_spidar_box_qp *qp, double out_x[HAPI_SPIDAR_ORDER_MAX]);

/* 1/2 x^T h x - g^T x */
double spidar_cost(const hapi_spidar_box_qp *qp, const double *x);

/* How far the cost of x is above the minimum at most: the sum of what each variable could still
 * gain in its box, which for a convex cost is not less than the truth. */
double spidar_gap(const hapi_spidar_box_qp *qp, const double *x);

/* A random problem of a model, as the tensions have it, with boxes of all kinds, or of no model
 * (NULL). */
void spidar_random_qp(const hapi_spidar_model *model, uint64_t *seed, hapi_spidar_box_qp *out);

#endif
