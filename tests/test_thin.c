/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Thin things: a hand that presses on one is not let through, whatever the depth, the speed, the
 * coupling, the model and the kind of geom. The force has a closed form, the spring's. */

#include "tests/tap.h"

#include "tests/contact_world.h"
#include "tests/solids.h"

#define T 1e-3
#define RADIUS 0.005
#define K 1000.0

typedef struct press {
  sheet_kind kind;
  double thickness; /* m */
  hap_coupling coupling;
  hap_model model;
  double hz;
  double speed; /* m/s, of the hand */
} press;

/* Down onto the plate until the hand is 30 mm deep, and back up. Largest error of the force, in N,
 * once it presses with 1 N or more, and what is felt when the hand is back above it. */
static double press_error(const press *t, double *out_after)
{
  contact_world w;
  box_arrays box;
  double worst = 0.0;
  cw_open(&w, 0.0);
  w.def.physics_hz = t->hz;
  w.def.model = t->model;
  w.hand_def.radius = RADIUS;
  w.hand_def.stiffness = K;
  w.hand_def.damping = 0.0;
  w.hand_expert.coupling = t->coupling;
  w.hand_expert.coupling_stiffness = K;
  sheet_create(w.space, &box, t->kind, 0.2, t->thickness);
  cw_add_cube(&w, 1.0, 0.1, 5.0, 0.0, 0.0);
  cw_start(&w, 0.013, 0.007, RADIUS + 0.1);
  bool soft = t->coupling == HAP_COUPLING_PROXY;
  double stiffness = soft ? 0.5 * K : K; /* two springs behind each other */
  double way = RADIUS + 0.1;
  while (w.hand_at[2] > -0.03 + RADIUS) {
    cw_move_hand(&w, 0.0, 0.0, -t->speed);
    cw_tick(&w);
    double force = stiffness * (RADIUS - w.hand_at[2]);
    if (force > 1.0 && t->speed < 0.3) {
      worst = fmax(worst, fabs(w.force[2] - force));
    }
  }
  cw_move_hand(&w, 0.0, 0.0, 0.0);
  cw_run(&w, 200);
  worst = fmax(worst, fabs(w.force[2] - stiffness * (RADIUS - w.hand_at[2])));
  while (w.hand_at[2] < way) {
    cw_move_hand(&w, 0.0, 0.0, 0.2);
    cw_tick(&w);
    double force = stiffness * (RADIUS - w.hand_at[2]);
    if (force > 1.0) {
      worst = fmax(worst, fabs(w.force[2] - force));
    }
  }
  cw_run(&w, 100);
  *out_after = cw_norm(w.force);
  cw_close(&w);
  return worst;
}

static void check_press(const press *t)
{
  double after = 0.0;
  double error = press_error(t, &after);
  bool swings = t->coupling == HAP_COUPLING_VIRTUAL; /* about the device */
  bool good = error < 0.3 && (after < 1e-9 || swings);
  if (!good) {
    printf("# %s of %g mm, coupling %d, model %d, %g Hz, %g m/s: %g N off, %g N after it\n",
           sheet_names[t->kind], 1e3 * t->thickness, (int)t->coupling, (int)t->model, t->hz,
           t->speed, error, after);
  }
  CHECK(good);
}

static const double thicknesses[] = {0.0001, 0.001, 0.02};

TEST(no_sheet_gives_way_to_a_slow_hand)
{
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    for (int m = 0; m < 4; ++m) {
      for (int i = 0; i < 3; ++i) {
        press t = {(sheet_kind)kind, thicknesses[i], HAP_COUPLING_DIRECT, all_models[m], 60.0, 0.1};
        check_press(&t);
      }
    }
  }
}

TEST(no_sheet_gives_way_in_any_coupling)
{
  static const hap_coupling couplings[] = {HAP_COUPLING_AUTO, HAP_COUPLING_PROXY,
                                           HAP_COUPLING_GOD_OBJECT, HAP_COUPLING_VIRTUAL};
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    for (int m = 0; m < 4; ++m) {
      for (int i = 0; i < 3; ++i) {
        press t = {(sheet_kind)kind, thicknesses[i], couplings[m], HAP_MODEL_CONTACT, 20.0, 0.1};
        check_press(&t);
      }
    }
  }
}

TEST(no_sheet_gives_way_to_a_fast_hand)
{
  static const double speeds[] = {0.5, 1.0, 2.0};
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    for (int m = 0; m < 3; ++m) {
      for (int i = 0; i < 3; ++i) {
        press t = {(sheet_kind)kind,  thicknesses[i], HAP_COUPLING_DIRECT,
                   HAP_MODEL_CONTACT, 60.0,           speeds[m]};
        check_press(&t);
      }
    }
  }
}

/* A hand that is put behind a plate is behind it: nobody pressed it through. */
TEST(a_jump_through_a_plate_is_no_touch)
{
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    contact_world w;
    box_arrays box;
    cw_open(&w, 0.0);
    w.hand_def.radius = RADIUS;
    w.hand_def.stiffness = K;
    w.hand_def.damping = 0.0;
    w.hand_expert.coupling = HAP_COUPLING_DIRECT;
    sheet_create(w.space, &box, (sheet_kind)kind, 0.2, 0.001);
    cw_add_cube(&w, 1.0, 0.1, 5.0, 0.0, 0.0);
    cw_start(&w, 0.013, 0.007, RADIUS + 0.01);
    cw_move_hand(&w, 0.0, 0.0, -0.05);
    cw_run(&w, 240); /* 2 mm deep */
    CHECK_NEAR(w.force[2], 2.0, 1e-6);
    cw_move_hand(&w, 0.0, 0.0, 0.0);
    w.hand_at[2] = -0.03;
    cw_run(&w, 300);
    CHECK_NEAR(cw_norm(w.force), 0.0, 1e-9);
    w.hand_at[2] = -0.02;
    cw_run(&w, 300);
    CHECK_NEAR(cw_norm(w.force), 0.0, 1e-9);
    cw_close(&w);
  }
}
