/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_CCD_CORE_H
#define HAPODE_PROXIMITY_CCD_CORE_H

#include <ccd/ccd.h>

#include "proximity/support.h"

/* What libccd sees of a solid. Its tolerances are absolute, so lengths are scaled to about 1; its
 * loops have no bound, so the support calls are counted. */
typedef struct hapi_ccd_core {
  const hapi_solid *solid;
  double inflation; /* m, ball added to the core. For yes-or-no questions only: libccd's directions
                       of inflated shapes are wrong by tens of degrees */
  double scale;     /* 1/m */
  int *calls_left; /* shared by the pair; then the answer is the centre: libccd sees no progress and
                       ends */
} hapi_ccd_core;

void hapi_ccd_init(ccd_t *ccd, double tolerance);

#endif
