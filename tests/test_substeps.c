/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Steps of the world in parts, against a plain loop of ODE at the rate of the parts. */

#include "tests/tap.h"

#include "tests/plain_steps.h"

#define PARTS 4
#define STEPS 20

/* m, of cube and bar together, after the same time. */
static double session_off(int substeps, const plain_loop *witness, uint32_t *out_callbacks)
{
  plain_things t;
  contact_world *w = plain_session(&t);
  w->expert.substeps = substeps;
  cw_start(w, 0.0, 100.0, 0.0);
  cw_run(w, (int)lround(1000.0 * STEPS / PLAIN_HZ) + 1);
  *out_callbacks = w->seen.steps;
  CHECK(cw_stats(w).physics.steps == STEPS);
  CHECK(w->seen.range_max == 0);
  return plain_off(witness, &t);
}

TEST(a_step_in_parts_is_that_of_a_world_at_their_rate)
{
  plain_loop witness;
  uint32_t callbacks = 0;
  plain_open(&witness);
  plain_run(&witness, STEPS * PARTS, PLAIN_HZ * PARTS, PLAIN_HZ);
  double off = session_off(PARTS, &witness, &callbacks);
  double whole = session_off(1, &witness, &callbacks);
  printf("# off by %.3g m in %d parts, %.3g m in one\n", off, PARTS, whole);
  CHECK(off <= 1e-6);
  CHECK(whole > 1e-3);
  CHECK(callbacks == STEPS);
  plain_close(&witness);
}

/* What a hand pushes and the loop does not own gets the same impulse, whatever the parts. */
TEST(the_hands_impulse_acts_over_all_parts)
{
  for (int substeps = 1; substeps <= 8; substeps *= 8) {
    contact_world *w = cw_new(0.0);
    w->expert.substeps = substeps;
    w->expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECT_CONTACTS);
    dBodyID cube = cw_add_cube(w, 0.5, 0.1, 0.0, 0.0, 0.0);
    (void)cw_add_cube(w, 0.5, 0.1, 0.1001, 0.0, 0.0); /* so that the loop may not own the first */
    w->hand_def.radius = 0.01;
    cw_start(w, -0.065, 0.0, 0.0);
    cw_move_hand(w, 0.1, 0.0, 0.0);
    cw_run(w, 501);
    printf("# %d parts: %.4g N s given, %.4g N s there\n", substeps, w->seen.impulse[0],
           w->seen.momentum[0]);
    CHECK(dBodyGetLinearVel(cube)[0] > 0.01);
    CHECK_NEAR(w->seen.momentum[0], w->seen.impulse[0], 0.02 * w->seen.impulse[0]);
  }
}

TEST(the_number_of_parts_is_checked)
{
  static const int32_t bad[] = {0, -1, 65};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    contact_world *w = cw_new(0.0);
    hap_detail detail = {""};
    w->expert.substeps = bad[i];
    w->ode.world = w->world;
    w->ode.space = w->space;
    CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_ARGUMENT);
    CHECK(strstr(detail.text, "substeps") != NULL);
  }
}
