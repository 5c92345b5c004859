/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "bench/accuracy.h"
#include "bench/bare.h"
#include "bench/cycles.h"

#define HOLD_BOUND 0.02
#define SETTLED_S 0.6 /* the hand has come to rest and the stack under it */

static const double rates[] = {20.0, 60.0};

/* Force of eq. 7 on a hand above the first body of a stack that stays upright. */
static double push_down(const bare *b, const scene_parameters *p, double hand_z, double hand_v)
{
  dBodyID top = b->scene->bodies[0];
  double depth = dBodyGetPosition(top)[2] + 0.5 * p->size + p->radius - hand_z;
  double closing = dBodyGetLinearVel(top)[2] - hand_v;
  return depth > 0.0 ? fmax(0.0, p->stiffness * depth + p->damping * closing) : 0.0;
}

/* Largest relative distance of the force from that of the same stack under dWorldStep, whose hand
 * moves as this run's did. */
static double worst_of(const accuracy_motion *test, const scene_parameters *p, bare *b)
{
  double step = 1.0 / ACCURACY_HAPTIC_HZ;
  double worst = 0.0;
  for (size_t t = 0; t < test->count; ++t) {
    const double *hand = test->frames[t].hand[0];
    double before = test->frames[t > 0 ? t - 1 : 0].hand[0][2];
    double force = push_down(b, p, hand[2], (hand[2] - before) / step);
    if ((double)t * step > SETTLED_S) {
      worst = fmax(worst, fabs(test->frames[t].force[0][2] - force) / fmax(force, 1e-9));
    }
    dBodyAddForceAtPos(b->scene->bodies[0], 0.0, 0.0, -force, hand[0], hand[1],
                       hand[2] - p->radius);
    bare_exact_step(b, step);
  }
  return worst;
}

static hap_status check_rate(bench *b, const scene_parameters *p, double physics_hz)
{
  bare exact;
  accuracy_motion test;
  accuracy_run_def def;
  char hand[ACCURACY_SPEC_MAX];
  if (!accuracy_hand(p->hands[0], 1.0, hand, sizeof hand)) {
    return bench_fail(b, HAP_ERROR_ARGUMENT, "hold: no hand can be made of \"%s\"", p->hands[0]);
  }
  accuracy_run_def_init(&def);
  def.parameters = p;
  def.hands[0] = hand;
  def.seconds = p->duration;
  def.model = HAP_MODEL_CONTACT;
  def.physics_hz = physics_hz;
  hap_status status = accuracy_run(b, &def, &test);
  if (status < HAP_OK) {
    return status;
  }
  status = bare_create(p, 0, &exact, &b->detail);
  if (status >= HAP_OK) {
    double worst = worst_of(&test, p, &exact);
    bench_check(b, worst <= HOLD_BOUND,
                "hold at %g Hz: force within %.3g %% of dWorldStep from %g s to %g s (bound 2 %%)",
                physics_hz, 100.0 * worst, SETTLED_S, def.seconds);
    bare_destroy(&exact);
  }
  accuracy_motion_free(&test);
  return status;
}

hap_status accuracy_check_hold(bench *b)
{
  const scene_parameters *p = cycles_scene("hold");
  hap_status status = HAP_OK;
  for (size_t i = 0; i < sizeof rates / sizeof rates[0] && status >= HAP_OK; ++i) {
    status = check_rate(b, p, rates[i]);
  }
  return status;
}
