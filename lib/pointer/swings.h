/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_SWINGS_H
#define HAPODE_POINTER_SWINGS_H

/* What the guard keeps of how a device goes to and fro (guard/oscillation.c), and faster and faster
 * (guard/runaway.c). World frame, N and m; of a torque N m and rad. Zeroed: nothing is known. */

#include <stdbool.h>
#include <stdint.h>

#define HAPI_SWINGS 6       /* halves that are looked at: three cycles */
#define HAPI_SWING_STAGES 3 /* of the filter for what is fast */

/* Two signals against each other. */
typedef struct hapi_swing_sums {
  double both;
  double force2;
  double way2;
} hapi_swing_sums;

/* Energies, J, since the pointer came; of a half of a swing: in it. */
typedef struct hapi_swing_work {
  double given; /* by moving bodies */
  double own;   /* of the force along this axis */
  double other; /* along the others */
} hapi_swing_work;

/* Where the force turned, or is on the way to. */
typedef struct hapi_swing_end {
  double force;
  double way;
  double seconds;
  hapi_swing_work work;
} hapi_swing_end;

typedef struct hapi_half_swing {
  double force;  /* change from end to end */
  double energy; /* J, of a spring that swings so far to either side */
  double seconds;
  hapi_swing_work work;
  hapi_swing_sums ticks; /* changes from tick to tick, where the force changes */
  double felt; /* N m, of a spring as stiff as what was touched: its force x way, likewise */
  hapi_swing_sums fast; /* of force and way what is fast */
} hapi_half_swing;

typedef struct hapi_swing_axis {
  bool rises;
  uint32_t count;      /* of halves in a row */
  double most;         /* largest force of them */
  hapi_swing_end turn; /* the last one */
  hapi_swing_end top;  /* the farthest since then */
  hapi_half_swing now; /* its sums, since the last turn */
  double force;        /* at the last tick */
  double way;          /* likewise */
  double work;         /* J */
  double slow_force[HAPI_SWING_STAGES];
  double slow_way[HAPI_SWING_STAGES];
  hapi_half_swing halves[HAPI_SWINGS]; /* a ring */
} hapi_swing_axis;

/* A device that goes faster and faster against the force. */
typedef struct hapi_runaway {
  int stage;
  uint32_t contacts; /* of the pointer, at the last tick */
  double seconds;    /* since the force was taken away to see */
  double loss;       /* 0..1, share of the force that this takes */
  double level;      /* N, the next one */
  double newtons;    /* at the last level */
  double speed;      /* m/s against the force, at the last level; when the force was gone */
  double square;     /* m2/s2, of the whole speed, at the last level */
  double leap;       /* m2/s2, its largest growth in one tick since then */
  double before;     /* m2/s2, the same at the last tick */
  uint32_t ticks;    /* since the last level */
  double work;       /* J, against the force since then */
  double way;        /* m, likewise */
  double gain;       /* 1/kg, up to the last level */
  double acceleration;
} hapi_runaway;

typedef struct hapi_swings {
  double seconds;
  double given;     /* J, by moving bodies */
  double work;      /* J, of force and torque along all axes */
  double turned[3]; /* rad, a sum: of small turns alone */
  double counted;   /* halves of swings, slowly forgotten */
  double hold_s;    /* for so long more the force stays down */
  double target;    /* 0..1, share of the force to be taken */
  double loss;      /* 0..1, on the way there */
  double taken;     /* 0..1, with that of a runaway */
  hapi_swing_axis force[3];
  hapi_swing_axis torque[3];
  hapi_runaway runaway;
} hapi_swings;

#endif
