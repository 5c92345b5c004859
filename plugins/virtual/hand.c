/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/virtual/hand.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"

#define SIZE 4
#define TERMS 16 /* of the series: 0.5^17 / 17! is far below the last bit */

static void multiply(double a[SIZE][SIZE], double b[SIZE][SIZE], double out[SIZE][SIZE])
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
static void exponential(double a[SIZE][SIZE], double out[SIZE][SIZE])
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
    multiply(scaled, out, product);
    for (int i = 0; i < SIZE; ++i) {
      for (int j = 0; j < SIZE; ++j) {
        out[i][j] = product[i][j] / term + (i == j ? 1.0 : 0.0);
      }
    }
  }
  for (int i = 0; i < halvings; ++i) {
    multiply(out, out, product);
    memcpy(out, product, sizeof product);
  }
}

/* The oscillator and a right side u that grows by du over the step are one linear system of the
 * state (x, v / w, u, du); its exponential holds the whole step. w, near the natural frequency,
 * makes rows of like size, which keeps the number of squarings and the rounding small. */
static void prepare(hapi_hand *hand, double length)
{
  double per_mass = 1.0 / hand->def.mass;
  double w = fmax(sqrt(hand->def.stiffness * per_mass), 1.0);
  double system[SIZE][SIZE] = {{0.0, w * length, 0.0, 0.0},
                               {-hand->def.stiffness * per_mass / w * length,
                                -hand->def.damping * per_mass * length, per_mass / w * length, 0.0},
                               {0.0, 0.0, 0.0, 1.0},
                               {0.0, 0.0, 0.0, 0.0}};
  double step[SIZE][SIZE];
  exponential(system, step);
  for (int i = 0; i < SIZE; ++i) {
    hand->p[i] = step[0][i];
    hand->q[i] = w * step[1][i];
  }
  hand->p[1] /= w;
  hand->q[1] /= w;
  hand->length = length;
}

void hapi_hand_init(hapi_hand *hand, const hapi_hand_def *def)
{
  *hand = (hapi_hand){.def = *def};
  prepare(hand, 1e-3);
}

void hapi_hand_place(hapi_hand *hand, const double position[3], const double velocity[3])
{
  hapi_v3_copy(position, hand->position);
  hapi_v3_copy(velocity, hand->velocity);
}

void hapi_hand_step(hapi_hand *hand, double length, const hapi_hand_target *target,
                    const double force[3])
{
  if (length != hand->length) {
    prepare(hand, length);
  }
  const double *p = hand->p;
  const double *q = hand->q;
  for (int i = 0; i < 3; ++i) {
    double push[2];
    for (int end = 0; end < 2; ++end) {
      push[end] = hand->def.stiffness * target->position[end][i] +
                  hand->def.damping * target->velocity[end][i] + force[i];
    }
    double x = hand->position[i];
    double v = hand->velocity[i];
    double rise = push[1] - push[0];
    hand->position[i] = p[0] * x + p[1] * v + p[2] * push[0] + p[3] * rise;
    hand->velocity[i] = q[0] * x + q[1] * v + q[2] * push[0] + q[3] * rise;
  }
}
