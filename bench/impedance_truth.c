/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "bench/impedance.h"

#define FREE_MASS 0.2  /* kg: resonates with the contact at 11 Hz */
#define FLAP_MASS 0.25 /* kg */
#define STUCK_MASS 1.0 /* kg: slips at 4.9 N */
#define PARAMETERS 3
#define FIT_STEPS 30
#define FIT_DONE 1e-10

const impedance_case impedance_cases[PORT_BODIES] = {
    [PORT_WALL] = {"wall", "static wall", 0.0, 2.0},
    [PORT_HELD] = {"held", "body held by a fixed joint", FREE_MASS, 2.0},
    [PORT_STUCK] = {"pushed", "cube on a floor, friction holds", STUCK_MASS, 2.0},
    [PORT_FREE] = {"free", "free body", FREE_MASS, FREE_MASS *PORT_GRAVITY},
    [PORT_SLIDER] = {"slider", "body on a slider", FREE_MASS, FREE_MASS *PORT_GRAVITY},
    [PORT_HINGE] = {"hinge", "flap on a hinge", FLAP_MASS,
                    FLAP_MASS *PORT_GRAVITY * 0.5 * PORT_FLAP_LENGTH / PORT_FLAP_ARM},
};

/* A flap that is turned by q about its level pose, p the pointer's height, r the arm and F0 the
 * preload: the contact is moved by p - r q, and
 *
 *   I q" = r dF - (F0 (radius - depth) - m g h) q
 *
 * as the lever from hinge to contact gets shorter while the flap rises and its centre of mass, which
 * is h above the hinge, comes nearer to the hinge's axis. */
static void set_flap(impedance_truth *truth)
{
  const double arm2 = PORT_FLAP_ARM * PORT_FLAP_ARM;
  const double half = PORT_FLAP_HALF;
  const double preload = impedance_cases[PORT_HINGE].preload;
  double inertia = FLAP_MASS * (PORT_FLAP_LENGTH * PORT_FLAP_LENGTH + 4.0 * half * half) / 3.0;
  double turning =
      preload * (PORT_RADIUS - preload / IMPEDANCE_STIFFNESS) - FLAP_MASS * PORT_GRAVITY * half;
  truth->mass = inertia / arm2;
  truth->body_stiffness = turning / arm2;
}

impedance_truth impedance_truth_of(port_body body)
{
  impedance_truth truth = {
      .grounded = body == PORT_WALL || body == PORT_HELD || body == PORT_STUCK,
      .mass = impedance_cases[body].mass,
      .stiffness = IMPEDANCE_STIFFNESS,
      .damping = IMPEDANCE_DAMPING,
  };
  if (body == PORT_HINGE) {
    set_flap(&truth);
  }
  return truth;
}

double complex impedance_of(const impedance_truth *truth, double hz)
{
  double w = 2.0 * M_PI * hz;
  double complex compliance = 1.0 / (truth->stiffness + I * w * truth->damping);
  if (!truth->grounded) {
    compliance += 1.0 / (truth->body_stiffness - w * w * truth->mass);
  }
  if (truth->coupling_stiffness > 0.0) {
    compliance += 1.0 / (truth->coupling_stiffness + I * w * truth->coupling_damping);
  }
  return 1.0 / compliance;
}

/* What ticks make of the closed form, T a tick, z = exp(i w T) one tick ahead. A body moves by
 * x' = x + T v', v' = v + T F / m: its w^2 is that of the central difference. Direct, u the device's place
 * and x the body's: the midpoint rule takes the mean of x z, x, x, x / z, and the damper the velocity from
 * before the tick, x (1 - 1/z) / T, half a tick old. Through a proxy whose place after the tick is p:
 *
 *   F = k (p - (x z - x + x / z)) + d (1 - 1/z) / T (p - x z)
 *   F = k_v (u - p) + d_v (i w u - (1 - 1/z) / T p) */
double complex impedance_sampled(const impedance_truth *truth, double hz)
{
  double angle = 2.0 * M_PI * hz * PORT_TICK_S;
  double complex w = I * 2.0 * M_PI * hz;
  double complex ahead = cexp(I * angle);
  double complex rate = (1.0 - 1.0 / ahead) / PORT_TICK_S;
  double move = 2.0 * sin(0.5 * angle) / PORT_TICK_S;
  double body = truth->body_stiffness - move * move * truth->mass;
  double complex give = truth->grounded ? 0.0 : 1.0 / body;
  if (truth->coupling_stiffness > 0.0) {
    double complex contact = truth->stiffness + truth->damping * rate;
    double complex coupling = truth->coupling_stiffness + truth->coupling_damping * rate;
    double complex back =
        truth->stiffness * (ahead - 1.0 + 1.0 / ahead) + truth->damping * rate * ahead;
    return (truth->coupling_stiffness + truth->coupling_damping * w) /
           (1.0 + coupling / contact * (1.0 + back * give));
  }
  double mean = cos(0.5 * angle) * cos(0.5 * angle);
  return (truth->stiffness + truth->damping * w) /
         (1.0 + (truth->stiffness * mean + truth->damping * rate) * give);
}

/* ---- fit: Gauss and Newton, relative errors ---- */

static double *parameter(impedance_truth *truth, int index)
{
  return index == 0 ? &truth->stiffness : index == 1 ? &truth->damping : &truth->mass;
}

typedef struct normal_equations {
  double a[PARAMETERS][PARAMETERS];
  double b[PARAMETERS];
} normal_equations;

static void add_point(normal_equations *n, const impedance_point *point, impedance_truth *at,
                      int count)
{
  double complex slope[PARAMETERS];
  double complex here = impedance_of(at, point->hz);
  for (int i = 0; i < count; ++i) {
    double *p = parameter(at, i);
    double kept = *p;
    double step = 1e-6 * fmax(fabs(kept), 1e-3);
    *p = kept + step;
    slope[i] = (impedance_of(at, point->hz) - here) / (step * point->felt);
    *p = kept;
  }
  for (int i = 0; i < count; ++i) {
    n->b[i] += creal(conj(slope[i]) * (1.0 - here / point->felt));
    for (int j = 0; j < count; ++j) {
      n->a[i][j] += creal(conj(slope[i]) * slope[j]);
    }
  }
}

/* The matrix is that of least squares: positive definite, no pivots are needed. */
static bool eliminate(normal_equations *n, int count)
{
  for (int i = 0; i < count; ++i) {
    if (!(n->a[i][i] > 0.0)) {
      return false;
    }
    for (int j = i + 1; j < count; ++j) {
      double factor = n->a[j][i] / n->a[i][i];
      for (int k = i; k < count; ++k) {
        n->a[j][k] -= factor * n->a[i][k];
      }
      n->b[j] -= factor * n->b[i];
    }
  }
  for (int i = count - 1; i >= 0; --i) {
    for (int k = i + 1; k < count; ++k) {
      n->b[i] -= n->a[i][k] * n->b[k];
    }
    n->b[i] /= n->a[i][i];
  }
  return true;
}

bool impedance_fit(const impedance_point *points, size_t count, double hz_max,
                   const impedance_truth *truth, impedance_truth *out)
{
  int free_count = truth->grounded ? PARAMETERS - 1 : PARAMETERS;
  *out = *truth;
  for (int step = 0; step < FIT_STEPS; ++step) {
    normal_equations n = {{{0.0}}, {0.0}};
    double change = 0.0;
    for (size_t i = 0; i < count && points[i].hz <= hz_max; ++i) {
      add_point(&n, &points[i], out, free_count);
    }
    if (!eliminate(&n, free_count)) {
      return false;
    }
    for (int i = 0; i < free_count; ++i) {
      double *p = parameter(out, i);
      *p += n.b[i];
      change = fmax(change, fabs(n.b[i] / *p));
    }
    if (change < FIT_DONE) {
      return true;
    }
  }
  return false;
}
