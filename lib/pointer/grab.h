/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_GRAB_H
#define HAPODE_POINTER_GRAB_H

/* What a pointer holds. World frame and units where nothing else is said. Zeroed: nothing. */

#include <stdbool.h>
#include <stdint.h>

#include "base/grab_setup.h"

#define HAPI_GRIP_ARM 0.05 /* m at the device: of a spring against turning */

typedef enum hapi_grab_phase {
  HAPI_GRAB_NONE = 0,
  HAPI_GRAB_WAITS = 1, /* for its body: the next model brings it */
  HAPI_GRAB_HOLDS = 2,
  HAPI_GRAB_LEAVES = 3 /* the force goes */
} hapi_grab_phase;

/* Where the body is held, in its frame. */
typedef struct hapi_grab_hold {
  uint32_t body; /* slot */
  uint32_t generation;
  uint32_t epoch;
  double place[3]; /* m, of the pointer */
  double turn[4];
  double asked[3]; /* on its way to: */
  double asked_turn[4];
  double at[3];      /* m, of the pointer at the last tick */
  double at_turn[4]; /* likewise */
  double spin[3];    /* rad/s, likewise */
  double way[3];     /* m, from the body's place to the pointer, then */
} hapi_grab_hold;

/* Spring and damper in this tick, and what came of them. */
typedef struct hapi_grab_pull {
  double stiffness; /* N/m, with the share; likewise the others */
  double damping;
  double turn_stiffness;
  double turn_damping;
  double point[3]; /* m, of the body: where it is held */
  double way[3];   /* m, from there to the pointer, as far as the grip follows */
  double turn[3];  /* rad, likewise */
  uint32_t row;    /* model CONTACT: the first of the rows */
  uint32_t rows;
  double force[3];  /* N, on the body at the point; at the last tick until there is a new one */
  double torque[3]; /* N m, beside it */
} hapi_grab_pull;

/* What the guard keeps. */
typedef struct hapi_grab_ledger {
  double felt;   /* 0..1, share of the force, with what the guard took */
  double sprung; /* J in the spring, as it was felt */
  double moved;  /* J, by the place where it is held: of this tick */
  bool turns;    /* the turn of the device is followed */
} hapi_grab_ledger;

typedef struct hapi_grab {
  bool any; /* there is something to follow */
  hapi_grab_phase phase;
  uint32_t holds;         /* that have begun */
  uint32_t ended;         /* hap_grab_end, of the last one */
  double share;           /* 0..1, of the force */
  double waited_s;        /* for the body */
  hapi_grab_setup wanted; /* what the application asked for last */
  hapi_grab_setup setup;  /* in force */
  void *tag;              /* dBodyID, as told to the application */
  hapi_grab_hold hold;
  hapi_grab_pull pull;
  hapi_grab_ledger ledger;
} hapi_grab;

/* Whether the pointer holds a body of the tick. */
static inline bool hapi_grab_acts(const hapi_grab *grab)
{
  return grab->phase >= HAPI_GRAB_HOLDS;
}

/* Whether it has torque for the hand. */
static inline bool hapi_grab_turns(const hapi_grab *grab)
{
  return hapi_grab_acts(grab) && grab->pull.turn_stiffness > 0.0;
}

/* Birth of the body that the model is to have for it; 0: none. */
static inline uint64_t hapi_grab_holds_for(const hapi_grab *grab)
{
  return grab->phase != HAPI_GRAB_NONE ? grab->setup.birth : 0;
}

#endif
