/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_ADMITTANCE_H
#define HAPODE_PROBE_ADMITTANCE_H

/* What a measured accelerance can be. The answer of a mechanism without friction to a force is
 * symmetric, it gives way and never comes towards the force, and contacts and joints can only
 * make it less than that of the free body: 0 <= A <= M^-1 (for every direction). A testing
 * simulation that says otherwise has not converged, or met a constraint that has no solution. */

#include <stdbool.h>

/* A body without anything that holds it, world axes. */
typedef struct hapi_free_body {
  double inverse_mass;       /* 1/kg, > 0 */
  double inverse_inertia[9]; /* 1/(kg m^2), row-major, symmetric positive definite */
} hapi_free_body;

typedef enum hapi_admittance {
  HAPI_ADMITTANCE_GOOD = 0,
  HAPI_ADMITTANCE_CLIPPED = 1, /* it was outside of the bounds and is on them now */
  HAPI_ADMITTANCE_SINGULAR = 2 /* no numbers, or far outside: not to be used; not changed */
} hapi_admittance;

/* Of a free body: force at a point, at arm from its centre of mass, to its acceleration. */
void hapi_free_point(const hapi_free_body *body, const double arm[3], double out[6][3]);

/* Eq. 6: force at a point of the body, at arm from its centre of mass, to the body's acceleration.
 * The bounds hold for the acceleration of the point, a 3x3 part; what is done to that is done by
 * forces at the point, so that the rest follows as in the free body. Along the normal, where a
 * pointer pushes, the bounds are kept to 1e-3. Across it friction goes beyond them for good, and
 * symmetric it is not: there only what friction cannot be is cut off. Where nothing is outside, a
 * stays as it is, bit for bit. */
hapi_admittance hapi_admittance_tidy_point(const hapi_free_body *body, const double arm[3],
                                           const double normal[3], double a[6][3]);

/* The same force to another body, which something ties to the first: the acceleration of that
 * one's centre of mass. In the measure of the two free bodies it is half of a free body's at
 * most, and with friction three quarters; what is more is scaled down to that. *out_share: what
 * it is then, 0 where SINGULAR. */
hapi_admittance hapi_admittance_tidy_cross(const hapi_free_body *pushed, const double arm[3],
                                           const hapi_free_body *other, double a[6][3],
                                           double *out_share);

/* Wrench at the centre of mass to acceleration. Made symmetric and brought within the bounds in
 * any case: the rows of the loop are solved with it. CLIPPED only for more than the rounding of
 * a solver, 1e-3. */
hapi_admittance hapi_admittance_tidy_body(const hapi_free_body *body, double response[6][6]);

/* One equation of a joint: wrench . (velocity of one body against the other) + softness impulse
 * = target, where an impulse gives wrench x impulse to the one body and the reaction to the
 * other. */
typedef struct hapi_constraint_row {
  double
      wrench[6]; /* force and torque about the centre of mass of the one; one of them of length 1 */
  double softness; /* (velocity along wrench) / impulse, >= 0 */
} hapi_constraint_row;

/* Equations that hold two bodies as a joint was seen to do. free[6][6]: relative velocity at the
 * centre of the one by a unit impulse there, with no joint; held[6][6]: impulse of the joint by
 * a unit of that velocity, with the sign turned. free^-1 >= held >= 0 for every direction, else
 * it is CLIPPED; SINGULAR: no numbers, or far outside. Sorted, the stiffest first; *out_count is
 * 0 to 6. */
hapi_admittance hapi_admittance_rows(const double free[6][6], const double held[6][6],
                                     hapi_constraint_row out[6], int *out_count);

#endif
