/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/virtual/hand.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"

#define SIZE 4
#define TERMS 16 /* of the series: 0.5^17 / 17! is far below the last bit */

static void matrix_multiply(double a[SIZE][SIZE], double b[SIZE][SIZE], double out[SIZE][SIZE])
{
  for (int i = 0; i < SIZE; ++i) {
    for (int j = 0; j < SIZE; ++j) {
      out[i][j] = 0.0;
      for (int k = 0; k < SIZE; ++k) {
        out[i][j] += a[i][k] * b[k][j];
      }
    }
  }
}

static double norm_of(double a[SIZE][SIZE])
{
  double largest = 0.0;
  for (int i = 0; i < SIZE; ++i) {
    double sum = 0.0;
    for (int j = 0; j < SIZE; ++j) {
      sum += fabs(a[i][j]);
    }
    largest = fmax(largest, sum);
  }
  return largest;
}

/* out = exp(a) by scaling and squaring (Higham, Functions of Matrices, chapter 10, with a Taylor
 * series in Horner form). Preferred to the three closed forms of a damped oscillator: no case
 * near critical damping, and none without spring or damper. */
static void matrix_exponential(double a[SIZE][SIZE], double out[SIZE][SIZE])
{
  int halvings = 0;
  (void)frexp(norm_of(a) * 2.0, &halvings);
  halvings = halvings > 0 ? halvings : 0;
  double scaled[SIZE][SIZE];
  double product[SIZE][SIZE];
  memset(out, 0, sizeof product);
  for (int i = 0; i < SIZE; ++i) {
    for (int j = 0; j < SIZE; ++j) {
      scaled[i][j] = ldexp(a[i][j], -halvings);
    }
    out[i][i] = 1.0;
  }
  for (int term = TERMS; term > 0; --term) {
    matrix_multiply(scaled, out, product);
    for (int i = 0; i < SIZE; ++i) {
      for (int j = 0; j < SIZE; ++j) {
        out[i][j] = product[i][j] / term + (i == j ? 1.0 : 0.0);
      }
    }
  }
  for (int i = 0; i < halvings; ++i) {
    matrix_multiply(out, out, product);
    memcpy(out, product, sizeof product);
  }
}

/* The oscillator and a right side u that grows by du over the step are one linear system of the
 * state (x, v / w, u, du). Its exponential is the whole step. The scale w, near the natural
 * frequency, makes rows of like size: fewer squarings, less rounding. */
static void solution_prepare(const hapi_hand_def *def, double length, hapi_hand_solution *out)
{
  HAPI_ASSERT(def->mass > 0.0 && def->stiffness >= 0.0);
  double per_mass = 1.0 / def->mass;
  double w = fmax(sqrt(def->stiffness * per_mass), 1.0);
  double damping = def->damping + def->drag;
  double system[SIZE][SIZE] = {{0.0, w * length, 0.0, 0.0},
                               {-def->stiffness * per_mass / w * length,
                                -damping * per_mass * length, per_mass / w * length, 0.0},
                               {0.0, 0.0, 0.0, 1.0},
                               {0.0, 0.0, 0.0, 0.0}};
  double step[SIZE][SIZE];
  matrix_exponential(system, step);
  for (int i = 0; i < SIZE; ++i) {
    out->p[i] = step[0][i];
    out->q[i] = w * step[1][i];
  }
  out->p[1] /= w;
  out->q[1] /= w;
  out->length = length;
}

static const hapi_hand_solution *solution_of(hapi_hand *hand, double length)
{
  HAPI_ASSERT_INDEX(hand->next, HAPI_HAND_SOLUTIONS);
  for (int i = 0; i < HAPI_HAND_SOLUTIONS; ++i) {
    if (hand->solutions[i].length == length) {
      return &hand->solutions[i];
    }
  }
  hapi_hand_solution *oldest = &hand->solutions[hand->next];
  hand->next = (hand->next + 1) % HAPI_HAND_SOLUTIONS;
  solution_prepare(&hand->def, length, oldest);
  return oldest;
}

void hapi_hand_init(hapi_hand *hand, const hapi_hand_def *def)
{
  *hand = (hapi_hand){.def = *def};
  for (int i = 0; i < HAPI_HAND_SOLUTIONS; ++i) {
    solution_prepare(&hand->def, 1e-3, &hand->solutions[i]);
  }
}

void hapi_hand_place(hapi_hand *hand, const double position[3], const double velocity[3])
{
  hapi_v3_copy(position, hand->position);
  hapi_v3_copy(velocity, hand->velocity);
}

void hapi_hand_push(const hapi_hand *hand, int axis, const hapi_hand_target *target, double force,
                    double out_push[2])
{
  HAPI_ASSERT_INDEX(axis, 3);
  for (int end = 0; end < 2; ++end) {
    out_push[end] = hand->def.stiffness * target->position[end][axis] +
                    hand->def.damping * target->velocity[end][axis] + force;
  }
}

void hapi_hand_step_axis(hapi_hand *hand, int axis, double length, const double push[2])
{
  HAPI_ASSERT_INDEX(axis, 3);
  const hapi_hand_solution *s = solution_of(hand, length);
  double x = hand->position[axis];
  double v = hand->velocity[axis];
  double rise = push[1] - push[0];
  hand->position[axis] = s->p[0] * x + s->p[1] * v + s->p[2] * push[0] + s->p[3] * rise;
  hand->velocity[axis] = s->q[0] * x + s->q[1] * v + s->q[2] * push[0] + s->q[3] * rise;
}
