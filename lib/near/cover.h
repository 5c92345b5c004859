/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_COVER_H
#define HAPODE_NEAR_COVER_H

/* Space queries of one round: several boxes that lie close together are asked for as one. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "world/spaces.h"

typedef struct hapi_covered {
  dReal box[6];
  dGeomID geom;
  uint32_t space; /* a bit */
} hapi_covered;

/* Of a round of questions to a space, in which nothing moves. Zeroed, then created. */
typedef struct hapi_cover {
  dGeomID box_geom; /* private, in no space */
  bool filled;      /* found holds what is in the box */
  bool has_box;
  bool has_asked;
  bool missing;    /* no memory for one */
  dReal box[6];    /* also while it is not filled: what is to be in it */
  dReal asked[6];  /* all questions of this round */
  double boxes_s;  /* spent in this round on ODE's boxes around what moved */
  uint32_t asking; /* bit of the space that is asked */
  hapi_covered *found;
  uint32_t count;
  uint32_t capacity;
} hapi_cover;

/* Boxes are low and high by axis, as ODE's. */
static inline bool hapi_boxes_meet(const double a[6], const double b[6])
{
  /* cppcheck-suppress ctuArrayIndex ; the chunks of a mesh have six numbers each */
  return a[0] <= b[1] && b[0] <= a[1] && a[2] <= b[3] && b[2] <= a[3] && a[4] <= b[5] &&
         b[4] <= a[5];
}

bool hapi_cover_create(hapi_cover *cover);
void hapi_cover_finish(hapi_cover *cover);
void hapi_cover_begin(hapi_cover *cover); /* a round: what was moved since counts */
typedef struct hapi_cover_question {
  const hapi_spaces *spaces;
  uint32_t mask; /* of the spaces: bits by place */
  dGeomID geom;
} hapi_cover_question;

/* As dSpaceCollide2(geom, space, data, callback) with each space of the mask, of a geom in no space
 * that collides with all. The callback gets the geoms inside of nested spaces, or such a space to
 * ask itself. */
void hapi_cover_ask(hapi_cover *cover, const hapi_cover_question *question, void *data,
                    dNearCallback *callback);

#endif
