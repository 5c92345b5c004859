/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Rows that have their bodies to themselves: one sweep solves them, and a static partner is not
 * looked at. */

#include <stdint.h>

#include <tests/tap.h>

#include "solver/contact_solver.h"

#define COUNT 20u

static hapi_row rows[COUNT];
static double v[COUNT + 1][6];

/* A body in each that comes to the ground at 0.5 m/s, with its contact beside its centre. */
static hapi_solver problem_solve(bool apart)
{
  memset(rows, 0, sizeof rows);
  memset(v, 0, sizeof v);
  for (uint32_t i = 0; i < COUNT; ++i) {
    const double j[6] = {0.0, 0.0, 1.0, 0.01, -0.03, 0.0};
    hapi_row *row = &rows[i];
    for (int k = 0; k < 6; ++k) {
      row->ja[k] = j[k];
      row->ba[k] = j[k] * (k < 3 ? 1.0 : 600.0) / (1.0 + i);
      row->jb[k] = row->bb[k] = apart ? 3.0 : 0.0; /* which is not looked at */
    }
    row->hi = HUGE_VAL;
    row->normal = -1;
    row->a = i + 1;
    row->softness = 0.01 * i;
    row->target = i % 3 == 0 ? -1.0 : 0.1; /* of every third it stays open */
    row->impulse = 0.02 * i;
    row->single = apart;
    v[i + 1][2] = -0.5;
  }
  hapi_solver s = {.rows = rows,
                   .v = v,
                   .row_count = COUNT,
                   .body_count = COUNT + 1,
                   .tolerance = 1e-9,
                   .update_budget = 100000,
                   .apart = apart};
  hapi_solver_run(&s);
  return s;
}

TEST(rows_that_share_no_body_take_one_sweep)
{
  double wanted[COUNT];
  CHECK(problem_solve(false).sweeps >= 2);
  for (uint32_t i = 0; i < COUNT; ++i) {
    wanted[i] = rows[i].impulse;
  }
  hapi_solver s = problem_solve(true);
  CHECK(s.sweeps == 1 && s.residual == 0.0);
  for (uint32_t i = 0; i < COUNT; ++i) {
    CHECK((i % 3 == 0) == (wanted[i] == 0.0));
    CHECK_NEAR(rows[i].impulse, wanted[i], 1e-14 * wanted[i]);
  }
}
