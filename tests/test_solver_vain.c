/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Direct solves that are in vain rest, as of a long row of cubes that is pushed along the floor;
 * those of a row of 44 or a tower of which a cube slides are not. */

#include "tests/tap.h"

#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/contact_world.h"
#include "tools/rig.h"

#define EDGE 0.05
#define RADIUS 0.01
#define SPEED 0.1
#define SETTLES 300
#define TICKS 600

typedef struct figures {
  int rests;      /* ticks whose last solve had no direct ones on account of those before */
  int tried;      /* ticks after which more runs are to rest than before */
  int solved;     /* ticks whose last solve had some that were accepted */
  double most;    /* row updates of a tick, */
  double budget;  /* and of each of its two solves */
  double force;   /* N, mean */
  double largest; /* m/s, correction that a solve may leave where it may leave some */
  uint32_t rows;
} figures;

static figures push_row(int count, double accuracy)
{
  figures out = {0};
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < count; ++i) {
    cw_add_cube(w, 0.15, EDGE, EDGE * i, 0.0, 0.5 * EDGE);
  }
  w->def.physics_hz = 60.0;
  w->def.accuracy = accuracy;
  w->hand_def.radius = RADIUS;
  w->hand_velocity[0] = SPEED;
  cw_start(w, -0.5 * EDGE - RADIUS, 0.0, 0.5 * EDGE);
  const hapi_solver *solver = &w->session->haptic->tick.rows.solver;
  for (int i = 0; i < SETTLES + TICKS; ++i) {
    uint32_t rest = solver->rest.runs;
    cw_tick(w);
    double updates = (double)w->session->haptic->tick.rows.work.done;
    if (i >= SETTLES) {
      out.rests += solver->rest.rows > 0;
      out.tried += solver->rest.rows > 0 && solver->rest.runs > rest;
      out.solved += solver->direct_solves > 0;
      out.most = updates > out.most ? updates : out.most;
      out.force -= w->force[0] / TICKS;
    }
  }
  out.rows = solver->row_count;
  out.budget = solver->update_budget;
  out.largest = solver->coarse.largest;
  printf("# %d cubes: %u rows, %d rest, %d tried, %d solved, %g updates, %.3f N\n", count, out.rows,
         out.rests, out.tried, out.solved, out.most, out.force);
  return out;
}

/* Not too dear, and in vain: it is tried again, less and less often. A tick has two solves, and
 * what slides is felt. */
TEST(what_is_in_vain_rests)
{
  figures f = push_row(60, 1.0);
  CHECK(f.rests > TICKS / 4 && f.tried > 1 && f.tried < TICKS / 20);
  CHECK(f.rows > 900 && f.largest > 1.3e-4 && f.largest <= 2e-4);
  CHECK_SAY(f.most < 2.0 * (f.budget + 4.0 * f.rows), "%g, budget %g", f.most, f.budget);
  CHECK_NEAR(f.force, 0.5 * 60 * 0.15 * 9.81, 0.05 * 60 * 0.15 * 9.81);
}

TEST(what_is_solved_does_not)
{
  figures f = push_row(3, 1.0);
  CHECK(f.rests == 0 && f.solved > 0);
  CHECK(f.largest == HAPI_COARSE);
  f = push_row(44, 1.0);
  CHECK(f.rests == 0 && f.solved > TICKS / 2);
  CHECK_NEAR(f.force, 0.5 * 44 * 0.15 * 9.81, 0.05 * 44 * 0.15 * 9.81);
}

/* Of sets of contacts that cannot be. With impulses cut in each round 39 ticks used up the budget,
 * and the force was 2 % off. */
TEST(a_tower_that_slides_is_solved)
{
  rig_options options;
  rig r = {0};
  hap_detail detail = {0};
  int used_up = 0;
  rig_options_init(&options);
  options.scene = "tower";
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.physics_hz = 20.0;
  options.def.accuracy = 0.5;
  REQUIRE(rig_create(&options, &r, &detail) >= HAP_OK);
  REQUIRE(hap_session_start(r.session) >= HAP_OK);
  const hapi_solver *solver = &r.session->haptic->tick.rows.solver;
  for (int i = 0; i < 1000; ++i) {
    REQUIRE(hap_session_advance(r.session, 1) >= HAP_OK);
    used_up += solver->updates > solver->update_budget * 3 / 4;
  }
  rig_destroy(&r);
  printf("# %d ticks used their budget up\n", used_up);
  CHECK(used_up == 0);
}
