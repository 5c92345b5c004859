/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROXIMITY_CONSTRAINED_BALL_H
#define HAPODE_PROXIMITY_CONSTRAINED_BALL_H

/* A ball that cannot enter a shape, and follows one that can: the god-object of Zilles and
 * Salisbury (1995), with a radius as in Ruspini, Kolarov, Khatib (1997). The nearest point of the
 * surface is the answer as long as the centre of the ball is outside of the shape and came there
 * without crossing it. Deeper, and behind the shape, the nearest point is that of another side: the
 * hand would fall through. The constrained ball stays on the side where it was; it comes to another
 * one only along the surface, round an edge.
 *
 * All in one frame, that of the shape's body. No state but the struct's; no calls: the caller
 * answers the search's questions for nearest points, as it can. */

#include <stdbool.h>
#include <stdint.h>

#include "proximity/proximity.h"

typedef struct hapi_constrained_ball {
  bool known;       /* what follows holds */
  bool held;        /* the nearest point of the surface is on another side */
  double center[3]; /* m, of the constrained ball: outside of the shape, or touching it */
  double normal[3]; /* unit, out of the shape, where it touches */
  double gap;       /* m, from there to the shape: 0 touching */
  double ball[3];   /* m, centre of the ball that it follows */
  double outside;   /* m, signed, from the surface to the centre of the ball */
} hapi_constrained_ball;

typedef struct hapi_ball_search {
  double ball[3]; /* m, centre, now */
  double radius;
  double ask[3];        /* m, where to ask for the nearest points of a ball of this radius */
  hapi_nearest nearest; /* of the ball itself */
  bool near;            /* it holds */
  uint32_t steps;
  bool reached; /* the constrained ball is where the ball is */
} hapi_ball_search;

/* Whether the ball cannot have crossed the shape since the last call: then *io is brought up to
 * date, and nearest is the answer. Else a search begins. nearest: points of the ball (a) and the
 * shape (b); NULL: there are none near. */
bool hapi_ball_is_free(hapi_constrained_ball *io, const double ball[3], double radius,
                       const hapi_nearest *nearest);
void hapi_ball_search_begin(const hapi_constrained_ball *b, const double ball[3], double radius,
                            const hapi_nearest *nearest, hapi_ball_search *out);

/* False: the search is at its end; else a question is in ask. */
bool hapi_ball_search_asks(hapi_constrained_ball *b, hapi_ball_search *io);
/* Points of the ball (a) that is at ask, and the shape (b); NULL: there are none. */
void hapi_ball_search_answer(hapi_constrained_ball *b, hapi_ball_search *io,
                             const hapi_nearest *nearest);

/* Where the ball touches, seen from its side. False: it left the shape, and nothing is near. */
bool hapi_ball_search_end(hapi_constrained_ball *b, const hapi_ball_search *io, hapi_nearest *out);

#endif
