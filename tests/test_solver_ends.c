/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Where a run of the solver ends that cannot be solved: two rows ask a body for two speeds. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>

#include "solver/contact_solver.h"

#define BODIES 2 /* the ground, and one that moves */
#define ROWS 2

static struct {
  hapi_row rows[ROWS];
  double v[BODIES][6];
  double free_v[BODIES][6];
  double work[HAPI_SOLVER_WORK(ROWS, BODIES)];
  hapi_solver solver;
} s;

/* Each sweep corrects the body's speed to and fro by `apart`; one that is left to the next run may
 * have COARSE. */
#define COARSE 1e-9 /* J */

static void contrary_run(double mass, double apart, uint32_t enough)
{
  memset(&s, 0, sizeof s);
  s.solver = (hapi_solver){.rows = s.rows,
                           .v = s.v,
                           .free = s.free_v,
                           .row_count = ROWS,
                           .body_count = BODIES,
                           .tolerance = 1e-9,
                           .coarse = {COARSE, HAPI_COARSE, 1.0},
                           .update_budget = 20000,
                           .enough = enough,
                           .work = s.work,
                           .work_count = HAPI_SOLVER_WORK(ROWS, BODIES)};
  for (int i = 0; i < ROWS; ++i) {
    s.rows[i] = (hapi_row){.a = 1,
                           .normal = -1,
                           .lo = -HUGE_VAL,
                           .hi = HUGE_VAL,
                           .ja = {1.0},
                           .ba = {1.0 / mass},
                           .target = i == 0 ? 0.0 : apart};
  }
  hapi_solver_run(&s.solver);
}

TEST(sweeps_that_go_in_a_circle_end)
{
  contrary_run(1.0, 1.0, 1);
  CHECK(s.solver.sweeps < 50);
  CHECK_NEAR(s.solver.residual, 1.0, 1e-9);
  contrary_run(1.0, 1.0, 0); /* nothing is to be left: as many as there is time for */
  CHECK(s.solver.sweeps > 5000);
  CHECK_NEAR(s.solver.residual, 1.0, 1e-9);
  CHECK(s.v[1][0] >= -1e-9 && s.v[1][0] <= 1.0 + 1e-9);
}

TEST(what_is_light_is_left_to_the_next_run)
{
  contrary_run(1e-6, 5.0 * HAPI_COARSE, 1);
  CHECK(s.solver.sweeps == 2);
  contrary_run(1.0, 5.0 * HAPI_COARSE, 1); /* felt */
  CHECK(s.solver.sweeps > 10);
  contrary_run(1e-6, 20.0 * HAPI_COARSE, 1); /* too fast */
  CHECK(s.solver.sweeps > 10);
}
