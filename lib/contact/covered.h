/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_CONTACT_COVERED_H
#define HAPODE_CONTACT_COVERED_H

/* Geoms of one body, or of the static world, that lie side by side are one surface, as the tiles of
 * a floor. A body that slides from one tile to the next one sinks a little into the first, so its
 * front meets the side of the next, and would stop there, as in ODE. A side is covered at a point
 * where another geom of the same body stands in front of it and is as high, to 0.1 mm. A pair of
 * geoms has no contact where all of its points are on covered sides. */

#include <stdbool.h>
#include <stdint.h>

#include "base/index.h"
#include "contact/kept.h"
#include "contact/places.h"

typedef struct hapi_covered {
  uint32_t *next;    /* by pair of hapi_kept: the next one of the same two bodies, in a ring */
  hapi_index firsts; /* scratch: pairs by their two bodies */
} hapi_covered;

/* Of one pair, where its points are on one of its two geoms. */
typedef struct hapi_covered_patch {
  uint32_t pair; /* index into those of hapi_kept */
  int side;      /* of the geom that may be covered: 0 or 1 */
  int count;
  double point[HAPI_PATCH_POINTS][3];  /* m, world, on that geom */
  double normal[HAPI_PATCH_POINTS][3]; /* unit, world, out of it */
} hapi_covered_patch;

/* False: no memory; finish is due all the same. */
bool hapi_covered_create(hapi_covered *covered, const hapi_capacity *capacity);
void hapi_covered_finish(hapi_covered *covered); /* also of a zeroed one */

/* After hapi_kept_take_near. */
void hapi_covered_take_near(hapi_covered *covered, const hapi_places *places,
                            const hapi_kept *kept);

/* Whether other pairs have the same two bodies. */
bool hapi_covered_has_others(const hapi_covered *covered, uint32_t pair);

/* Whether all points are on covered sides. Hulls cover nothing, and are not covered. */
bool hapi_covered_all(const hapi_covered *covered, const hapi_places *places, const hapi_kept *kept,
                      const hapi_covered_patch *patch);

#endif
