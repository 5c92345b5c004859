/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Friction of the pointer against closed forms: sticking, sliding in every direction, what it drags, what
 * a soft finger holds. In every model, direct and behind a proxy. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "tests/contact_world.h"

#define RADIUS 0.01
#define MU 0.5

static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_CONTACT};
#define MODELS (sizeof models / sizeof models[0])

static void open_world(contact_world *w, hap_model model, double gravity)
{
  cw_open(w, gravity);
  w->def.model = model;
  w->def.physics_hz = 60.0;
  w->hand_def.radius = RADIUS;
  w->hand_def.stiffness = 2000.0;
  w->hand_def.damping = 0.0;
  w->hand_def.friction = MU;
  w->hand_def.max_torque = 1e6;
}

/* Over the floor, then pressed into it by depth. A body that nobody touches makes it a world. */
static bool press_floor(contact_world *w, double depth)
{
  cw_add_floor(w);
  cw_add_cube(w, 1.0, 0.1, 1.0, 0.0, 0.05);
  if (!cw_start(w, 0.0, 0.0, RADIUS + 0.001)) {
    return false;
  }
  cw_run(w, 20);
  cw_move_hand(w, 0.0, 0.0, -(0.001 + depth) / 0.05);
  cw_run(w, 50);
  cw_move_hand(w, 0.0, 0.0, 0.0);
  cw_run(w, 40);
  return true;
}

/* ---- against a wall ---- */

TEST(sticking_is_a_spring_of_the_contacts_stiffness)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world w;
    open_world(&w, models[m], CW_GRAVITY);
    REQUIRE(press_floor(&w, 0.002));
    CHECK_NEAR(w.force[2], 4.0, 4e-3);
    CHECK_NEAR(w.force[0], 0.0, 1e-9);
    for (int i = 1; i <= 4; ++i) {
      cw_move_hand(&w, 0.2, -0.1, 0.0);
      cw_run(&w, 1);
      cw_move_hand(&w, 0.0, 0.0, 0.0);
      cw_run(&w, 1);
      CHECK_NEAR(w.force[0], -2000.0 * 2e-4 * i, 1e-3 * 2000.0 * 2e-4 * i);
      CHECK_NEAR(w.force[1], 2000.0 * 1e-4 * i, 1e-3 * 2000.0 * 1e-4 * i);
    }
    for (int i = 0; i < 500; ++i) {
      cw_tick(&w);
    }
    CHECK_NEAR(w.force[0], -1.6, 1.6e-3); /* and stays */
    cw_close(&w);
  }
}

TEST(sliding_is_coulombs_in_every_direction)
{
  for (size_t m = 0; m < MODELS; ++m) {
    for (int i = 0; i < 24; ++i) {
      double angle = 2.0 * M_PI * (i + 0.3) / 24.0;
      contact_world w;
      open_world(&w, models[m], CW_GRAVITY);
      REQUIRE(press_floor(&w, 0.002));
      cw_move_hand(&w, 0.05 * cos(angle), 0.05 * sin(angle), 0.0);
      cw_run(&w, 100);
      CHECK_NEAR(w.force[0], -MU * w.force[2] * cos(angle), 1e-3 * MU * w.force[2]);
      CHECK_NEAR(w.force[1], -MU * w.force[2] * sin(angle), 1e-3 * MU * w.force[2]);
      CHECK_NEAR(w.force[2], 4.0, 1e-6);
      cw_close(&w);
    }
  }
}

int main(void)
{
  dInitODE2(0);
  dAllocateODEDataForThread(dAllocateMaskAll);
  RUN(sticking_is_a_spring_of_the_contacts_stiffness);
  RUN(sliding_is_coulombs_in_every_direction);
  dCloseODE();
  return tap_done();
}
