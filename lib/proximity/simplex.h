/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_SIMPLEX_H
#define HAPODE_PROXIMITY_SIMPLEX_H

#include <stdbool.h>

/* A vertex of the difference of two solids: gap = a - b. */
typedef struct hapi_vertex {
  double gap[3];
  double a[3];
  double b[3];
  double weight; /* of the nearest point, after hapi_simplex_reduce */
} hapi_vertex;

typedef struct hapi_simplex {
  hapi_vertex vertex[4];
  int count;
} hapi_simplex;

/* Keeps the vertices that span the point nearest to the origin, sets their weights and writes that
 * point. False: a simplex of four contains the origin; nothing is changed. */
bool hapi_simplex_reduce(hapi_simplex *simplex, double out_nearest[3]);

/* Points of the two solids that belong to the weights. */
void hapi_simplex_witness(const hapi_simplex *simplex, double out_a[3], double out_b[3]);

#endif
