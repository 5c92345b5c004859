/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_ROWS_H
#define HAPODE_LOCAL_ROWS_H

/* The rows of a tick, model CONTACT: what contact, joint and pointer rows share. */

#include <math.h>

#include "local/body.h"
#include "solver/contact_solver.h"

/* Place 0 of the solver's velocities never moves: the static world. */
#define HAPI_STATIC_ROW 0u

#define HAPI_CONTACT_ROWS 3u /* of a contact, at most: its normal and two frictions */

/* Where a row of the solver comes from. */
typedef struct hapi_row_source {
  uint32_t contact; /* of the patches, or of the pointers */
  uint32_t body_a;  /* slot; HAPI_SLOT_NONE: none */
  uint32_t body_b;
  uint8_t part;    /* 0 normal, 1 and 2 friction; of a joint: see joint_rows.c */
  bool pointer;    /* also of a brace, which has neither a contact nor bodies here */
  bool joint;      /* contact is the index of a joint */
  bool pushes_out; /* its target lifts a body out of another one, or closes a joint: not to stay in
                      the velocity */
  bool gives;      /* may do work on bodies of the loop: a partner that the loop does not own, a
                      surface that moves, a spring */
  uint8_t count;   /* of the first row of a contact: its rows */
  double stays;    /* m/s, of a row that pushes out: its target without that */
} hapi_row_source;

/* What a tick does, in row updates of the solver. It is counted and not timed: a run in lockstep,
 * or in a replay, goes the same way on every machine. */
typedef struct hapi_work {
  uint64_t most; /* of a tick, solves stop there; 0: no bound */
  uint64_t done; /* in this tick */
  uint64_t all;  /* since start */
  double usual;  /* about the median of a tick, each row counted as kept */
} hapi_work;

/* A contact between bodies whose target pushes them out of each other. */
typedef struct hapi_row_lifted {
  uint32_t row;   /* its normal's */
  uint32_t which; /* index into packables; HAPI_NO_PACKABLE: it is not packable */
} hapi_row_lifted;

/* Of a row, in the solve that did not come last in a tick of two. */
typedef struct hapi_row_aside {
  hapi_row_source source;
  double impulse;
} hapi_row_aside;

/* The rows of the tick before, behind those of this one. */
typedef struct hapi_rows_before {
  uint32_t end;   /* beyond the last */
  uint32_t next;  /* contacts before that one have been reached, or have no rows that stand */
  uint32_t up;    /* how far those went up in this tick that were not reached yet, */
  uint32_t from;  /* and where the first of them stands; 0: they stand where they stood */
  uint32_t step;  /* by which they go up the next time, or a few less */
  uint32_t moved; /* rows that went up so far, each time that they did */
} hapi_rows_before;

typedef struct hapi_rows {
  hapi_solver solver;
  hapi_work work;
  hapi_rows_before before;
  hapi_row_source *sources; /* of the rows; capacity */
  uint32_t capacity;
  uint32_t kept;           /* rows of the tick before that go on in this one */
  uint32_t contact_begin;  /* the first row of contacts between bodies */
  hapi_row_lifted *lifted; /* in this tick; capacity */
  uint32_t lifted_count;
  hapi_row_aside *aside; /* see push_out.h; capacity */
  uint32_t aside_count;  /* 0: the last tick had one solve */
  bool swapped;          /* since it began to push out: each solve goes on from its own impulses */
  double drift;          /* 1/s, of the force on a hand, that solves may leave undone; 0: nothing */
  double hand; /* J s^2, the least F^2 / (k^2 a) of the tick's springs to hands, with F of the tick
                   before; HUGE_VAL: none */
  bool exact_hand;     /* a hull or a rigid pointer is near in this tick: nothing may stay undone */
  bool touched;        /* by a pointer that has been in reach since */
  double residual_max; /* m/s; this and the next since start */
  uint64_t sweeps;
  uint32_t unsolved;      /* ticks in a row of which HAPI_UNSOLVED or more was left undone */
  uint32_t unsolved_most; /* since start */
  uint64_t unsolved_all;  /* ticks, likewise */
} hapi_rows;

/* What a unit impulse along j does to the body's velocity. */
static inline void hapi_row_response(const hapi_local_body *body, const double j[6], double b[6])
{
  if (!hapi_body_responds(body)) {
    memset(b, 0, 6 * sizeof *b);
  } else if ((body->flags & HAPI_BODY_MEASURED) == 0) {
    hapi_v3_scale(body->inverse_mass, j, b);
    hapi_body_spin_up(body, j + 3, b + 3);
  } else {
    for (int i = 0; i < 6; ++i) {
      b[i] =
          hapi_v3_dot(body->given.response[i], j) + hapi_v3_dot(body->given.response[i] + 3, j + 3);
    }
  }
}

/* Jacobian and response of a unit impulse along direction, sign: -1 for the second body of a
 * contact. */
static inline void hapi_row_column(const hapi_local_body *body, const double arm[3],
                                   const double direction[3], double sign, double j[6], double b[6])
{
  memset(j, 0, 6 * sizeof *j);
  if (body != NULL) {
    hapi_v3_scale(sign, direction, j);
    hapi_v3_cross(arm, j, j + 3);
  }
  hapi_row_response(body, j, b);
}

/* The same of a turn about direction. */
static inline void hapi_row_turn_column(const hapi_local_body *body, const double direction[3],
                                        double sign, double j[6], double b[6])
{
  memset(j, 0, 6 * sizeof *j);
  if (body != NULL) {
    hapi_v3_scale(sign, direction, j + 3);
  }
  hapi_row_response(body, j, b);
}

/* The angle of a sine and a cosine, in -pi .. pi, to 1e-13: halved until the series is short. */
static inline double hapi_row_angle(double sine, double cosine)
{
  double length = sqrt(sine * sine + cosine * cosine);
  double down = fabs(cosine) + length;
  if (!(down > 0.0)) {
    return 0.0;
  }
  double t = sine / down; /* tan of the half, up to 1 */
  for (int i = 0; i < 3; ++i) {
    t = t / (1.0 + sqrt(1.0 + t * t));
  }
  double t2 = t * t;
  double small =
      t * (1.0 - t2 * (1.0 / 3 - t2 * (1.0 / 5 - t2 * (1.0 / 7 - t2 * (1.0 / 9 - t2 / 11)))));
  double angle = 16.0 * small;
  return cosine < 0.0 ? copysign(M_PI, sine) - angle : angle;
}

/* Velocity along j before this tick. */
static inline double hapi_row_start_speed(const hapi_local_body *body, const double j[6])
{
  return body == NULL
             ? 0.0
             : hapi_v3_dot(j, body->start_twist) + hapi_v3_dot(j + 3, body->start_twist + 3);
}

#endif
