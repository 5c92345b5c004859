/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_DRAW_H
#define HAPODE_LOCAL_BODY_DRAW_H

/* A copy of a body that another loop moves is drawn to that body, by HAPI_DRAW_SPEED at most. What
 * is drawn is the pose: it gives the copy no momentum, and its velocity stays that of its contacts.
 * Where no hand pushes on the copy, the velocity follows, too: a body that slides or flies would
 * go elsewhere for ever. */

#include "local/body.h"

#define HAPI_DRAW_SPEED 0.05  /* m/s */
#define HAPI_DRAW_TIME 0.03   /* s, of what is so near that it takes less */
#define HAPI_DRAW_FOLLOW 0.05 /* s, in which the velocity follows */

/* A new model of some age. goes_on: the loop had the body before. Before the body's flags. */
void hapi_body_draw_adopt(hapi_local_body *body, const hapi_model_body *in, double age_s,
                          bool goes_on);
/* Before a tick. */
void hapi_bodies_draw(const hapi_bodies *bodies, double period);

#endif
