/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_SURFACE_H
#define HAPODE_SYNC_SURFACE_H

/* How two geoms touch, as the application says it. */

#include <stdint.h>

/* ODE's dSurfaceParameters with fdir1; soft constraints converted from the world's step to the tick
 * (the same spring and damper). */
typedef struct hapi_surface {
  uint32_t flags; /* HAPI_SURFACE_* */
  double mu;      /* with APPROX1: friction coefficient, else N */
  double mu2;
  double direction[3]; /* unit, world: first friction direction, with FDIR1 */
  double bounce;
  double bounce_speed; /* m/s */
  double erp;          /* at the tick */
  double cfm;          /* (m/s)/N at the tick: J v = target - cfm x force */
  double layer;        /* m, depth that is not pushed out */
  double max_push;     /* m/s, largest correcting velocity */
  double motion[3];    /* m/s along friction 1, friction 2, normal */
  double slip[2];      /* m/(N s) */
} hapi_surface;

enum {
  HAPI_SURFACE_APPROX1_1 = 1,
  HAPI_SURFACE_APPROX1_2 = 2,
  HAPI_SURFACE_FDIR1 = 4,
  HAPI_SURFACE_BOUNCE = 8,
  HAPI_SURFACE_SOFT = 16, /* push-out is a spring's, and stays in the velocity */
  HAPI_SURFACE_SLIP1 = 32,
  HAPI_SURFACE_SLIP2 = 64
};

#endif
