/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_PAIR_FEEL_H
#define HAPODE_LOCAL_PAIR_FEEL_H

/* Surfaces of their own, from tick to tick. */

#include <stdbool.h>
#include <stdint.h>

#include "pointer/declared.h"
#include "sync/messages.h"

/* What a texture makes of a contact. */
typedef struct hapi_touch_lift {
  double height;   /* m, that the texture is above the geom */
  double push[3];  /* along which it pushes: the unit normal less the slope of the texture */
  double slope[3]; /* that slope, world */
  double left;     /* m, and the slope: of a texture that goes, when it went */
  double left_slope[3];
} hapi_touch_lift;

/* How a contact is felt in this tick. */
typedef struct hapi_touch_feel {
  bool rubs;       /* friction is worked out: there is some, or it was asked for */
  bool special;    /* a surface of its own; else stiffness and damping are the pointer's */
  uint32_t number; /* as hapi_model_feel.number */
  uint32_t pair;   /* of a special one: index into the feels */
  double mu;
  double stiffness; /* N/m */
  double damping;   /* N s/m */
  hapi_touch_lift lift;
  double lifted; /* m, by which its height has changed since the tick before, whatever its sign */
  double turned; /* the same of push: sum over its parts */
  bool sticks;   /* the spring pulls too: */
  double pull;   /* N, at most, of this contact alone; 0 where it does not */
} hapi_touch_feel;

#define HAPI_FEEL_SAID (-1.0) /* stiffness of a pair that has just come */
#define HAPI_FEEL_OWN (-2.0)  /* and has pressed with the pointer's up to now */

/* Adhesion of a pair, from tick to tick. */
typedef struct hapi_pair_hold {
  bool sticks;
  bool presses; /* in this tick: it sticks in the next */
  double pull;  /* N, sum over the contacts: what holds in this tick */
  double taken; /* N, and what of it was taken */
  double depth; /* m, of the deepest */
} hapi_pair_hold;

/* The pull of a surface from a distance. */
typedef struct hapi_pair_magnet {
  bool any;        /* in this tick */
  bool known;      /* in the tick before, too */
  bool begins;     /* nothing has been declared of it yet */
  double strength; /* N, on its way to what is said */
  double hardest;  /* N/m, the most that a way can change it */
  hap_wrench pull; /* on the hand, about the pointer's origin, world */
  uint32_t body;   /* slot; HAPI_SLOT_NONE: static */
  double push[6];  /* N, N m on the body, about its centre */
  hapi_purse purse;
} hapi_pair_magnet;

/* A pointer and a geom with a surface of its own. */
typedef struct hapi_pair_feel {
  hapi_model_feel in;
  uint64_t tick; /* of the state behind: */
  bool presses;
  bool pressed;     /* in the tick before */
  double stiffness; /* N/m: on its way to what is said */
  const hapi_texture *texture;
  double lift_share; /* 0..1, of a texture that comes in */
  bool parts;        /* in this tick another texture went */
  double left_share; /* 0..1, of it */
  hapi_pair_hold hold;
  hapi_pair_magnet magnet;
} hapi_pair_feel;

#endif
