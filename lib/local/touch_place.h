/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_TOUCH_PLACE_H
#define HAPODE_LOCAL_TOUCH_PLACE_H

/* Where two shapes touch now: a point of a patch, placed anew from moved poses. */

#include <stdbool.h>

#include "base/vec.h"
#include "sync/messages.h"

/* What a side of the contact is fixed to. */
typedef struct hapi_touch_frame {
  const hap_pose *pose;   /* NULL: the static world */
  const double *rotation; /* of pose, row-major */
} hapi_touch_frame;

typedef struct hapi_touch_spot {
  double normal[3]; /* world, unit, from b to a */
  double point[3];  /* world: the corner that a face pushes, as ODE's collision of boxes and planes
                       has it; else between the surfaces */
  double of_a[3];   /* between the surfaces; on a face of a it stays with a while b slides there */
  double gap;       /* m */
  double slope[3];  /* of the gap: it grows as a goes from b along the normal and this, which is
                       across: where the spot slides along what is tilted; not of a ball */
  bool follows;     /* so it does while the bodies go a little way, and the spot goes with them */
} hapi_touch_spot;

/* False: there is no answer (a ball against a hull). */
bool hapi_touch_place(const hapi_patch_contact *in, const hapi_touch_frame *a,
                      const hapi_touch_frame *b, hapi_touch_spot *out);

#endif
