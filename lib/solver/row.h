/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SOLVER_ROW_H
#define HAPODE_SOLVER_ROW_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* hapi_row.triple; 0: none. */
#define HAPI_TRIPLE_ANY 1u
#define HAPI_TRIPLE_BY_MASS \
  2u /* of bodies that answer by their mass, of which a does; the normal's
                                  bounds are 0 .. HUGE_VAL */

/* hapi_row.moves */
#define HAPI_MOVES_A 1u /* j A j^T is 0 only if it does not respond */
#define HAPI_MOVES_B 2u

/* One scalar row, in the order in which a sweep reads it. Three rows of a contact stand together:
 * normal, then its two frictions. Chains of bodies converge best in their order, beginning at the
 * hand. A body that does not respond in one row must not respond in any. */
typedef struct hapi_row {
  double ja[6];    /* row of the Jacobian, linear and angular */
  double ba[6];    /* A J^T, usually M^-1 J^T: change of v[a] by one N s; 0: a does not respond */
  double impulse;  /* N s; in: warm start, out: result */
  double drive;    /* inner: target without the part of a partner that does not respond */
  double softness; /* (m/s)/(N s), >= 0 */
  double inverse;  /* out: 1 / (ja.ba + jb.bb + softness); 0: singular or invalid, row left out */
  double response; /* inner: 1 / inverse */
  double mu; /* normal >= 0: bounds are -mu (p - lo) .. mu (p - lo), of that row; may be HUGE_VAL */
  double coupling[2]; /* inner, of a friction: j.b of the rows before it of its contact; of one of a
                         ball that slides: [0] its part of the force's direction, [1] the softness
                         that the slip adds */
  double lo;          /* N s; may be -HUGE_VAL */
  double hi;          /* N s; may be HUGE_VAL. normal >= 0: a load that bounds go by at least, the
                         same of both frictions of a contact */
  uint32_t a;         /* index into v */
  uint32_t b;         /* several static partners may share one index, whose v stays as it is */
  int32_t normal;     /* index of the normal row, before this one and of the same a and b; -1: none,
                      the bounds are lo .. hi */
  uint8_t ball;   /* of the first of 2 or 3 frictions that stand together and whose impulses are one
                      vector, no longer than mu p: how many; 0: the pyramid */
  uint8_t round;  /* of the others: how many of them come before */
  uint8_t single; /* a static partner: jb and bb are 0 and are not looked at */
  uint8_t triple; /* inner: HAPI_TRIPLE_, of a normal whose two frictions come next, all of use */
  uint8_t moves;  /* inner: HAPI_MOVES_, the bodies that respond */
  uint8_t state;  /* inner, of direct_solver.c */
  uint32_t next;  /* inner: of the same island */
  uint64_t made;  /* inner, of a normal of a triple: no other contact of this solver has it */
  double target;  /* m/s */
  double jb[6]; /* 0 for a static partner; a sweep reads this and the next where b responds only */
  double bb[6];
} hapi_row;

static inline bool hapi_row_moves_a(const hapi_row *row)
{
  return (row->moves & HAPI_MOVES_A) != 0;
}

static inline bool hapi_row_moves_b(const hapi_row *row)
{
  return (row->moves & HAPI_MOVES_B) != 0;
}

/* Inverse mass, 1/kg, of a body that answers by its mass: from the largest part of a direction, to
 * the last bit as in the row. */
static inline double hapi_row_inverse_mass(const double j[6], const double b[6])
{
  int k = fabs(j[0]) > fabs(j[1]) ? 0 : 1;
  k = fabs(j[k]) > fabs(j[2]) ? k : 2;
  return b[k] / j[k];
}

/* False: of a joint that holds, whose impulse may be any. */
static inline bool hapi_row_is_bounded(const hapi_row *row)
{
  return row->normal >= 0 || row->lo != -HUGE_VAL || row->hi != HUGE_VAL;
}

/* Of two contacts of the same bodies, exactly: of a patch they are, and of what was made at the
 * same time. Only then is the way between the bodies' centres the same in both. */
static inline bool hapi_same_directions(const hapi_row *normal, const hapi_row *other)
{
  bool same = true;
  for (int i = 0; i < 3; ++i) {
    const double *j = normal[i].ja;
    const double *k = other[i].ja;
    same = same && j[0] == k[0] && j[1] == k[1] && j[2] == k[2];
  }
  return same;
}

#endif
