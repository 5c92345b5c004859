/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What is left of islands that the solver did not solve: no energy beyond what their rows ask
 * for. */

#include "tests/tap.h"

#include <stdint.h>

#include "solver/island.h"

#define ROWS 512
#define BODIES 600
#define GROUND 0
#define WORK HAPI_SOLVER_WORK(ROWS, 64)

static struct {
  hapi_row rows[ROWS];
  double v[BODIES][6];
  double free_v[BODIES][6];
  double mass[BODIES]; /* kg and kg m^2 alike; 0: does not move */
  double work[WORK];
  hapi_solver solver;
} s;

static uint64_t state;

static double random_draw(double lo, double hi)
{
  state = state * 6364136223846793005u + 1442695040888963407u;
  return lo + (hi - lo) * (double)(state >> 11) / 9007199254740992.0;
}

static uint32_t draw_below(uint32_t count)
{
  return (uint32_t)random_draw(0.0, count) % count;
}

static void set_up(uint32_t bodies)
{
  memset(&s, 0, sizeof s);
  for (uint32_t i = 1; i < bodies; ++i) {
    s.mass[i] = 1.0;
  }
  s.solver = (hapi_solver){.rows = s.rows,
                           .v = s.v,
                           .free = s.free_v,
                           .body_count = bodies,
                           .tolerance = 1e-9,
                           .update_budget = 100000,
                           .direct_rows = 1000,
                           .work = s.work,
                           .work_count = WORK};
}

static hapi_row *add_row(uint32_t a, uint32_t b, const double ja[6], const double jb[6])
{
  hapi_row *row = &s.rows[s.solver.row_count++];
  row->a = a;
  row->b = b;
  row->normal = -1;
  row->hi = HUGE_VAL;
  for (int k = 0; k < 6; ++k) {
    row->ja[k] = ja[k];
    row->jb[k] = jb[k];
    row->ba[k] = s.mass[a] > 0.0 ? ja[k] / s.mass[a] : 0.0;
    row->bb[k] = s.mass[b] > 0.0 ? jb[k] / s.mass[b] : 0.0;
  }
  return row;
}

static void problem_solve(void)
{
  memcpy(s.free_v, s.v, sizeof s.v);
  hapi_solver_run(&s.solver);
  hapi_solver_calm(&s.solver);
}

static double energy_of(double v[BODIES][6])
{
  double sum = 0.0;
  for (uint32_t i = 0; i < s.solver.body_count; ++i) {
    for (int k = 0; k < 6; ++k) {
      sum += 0.5 * s.mass[i] * v[i][k] * v[i][k];
    }
  }
  return sum;
}

static void check_velocities(void)
{
  static double sum[BODIES][6];
  memcpy(sum, s.free_v, sizeof sum);
  for (uint32_t i = 0; i < s.solver.row_count; ++i) {
    for (int k = 0; k < 6; ++k) {
      sum[s.rows[i].a][k] += s.rows[i].impulse * s.rows[i].ba[k];
      sum[s.rows[i].b][k] += s.rows[i].impulse * s.rows[i].bb[k];
    }
  }
  for (uint32_t i = 0; i < s.solver.body_count; ++i) {
    for (int k = 0; k < 6; ++k) {
      CHECK_NEAR(s.v[i][k], sum[i][k], 1e-9 * (1.0 + fabs(sum[i][k])));
    }
  }
}

/* ---- impulses of no body ---- */

/* One body that answers its second row as if another stood in its place, so that the rows lift each
 * other: no impulses fit, and those that sweeps come to grow for ever. */
static void make_impossible(uint32_t body)
{
  const double none[6] = {0.0};
  const double x[6] = {1.0};
  const double y[6] = {0.0, 1.0};
  hapi_row *first = add_row(body, GROUND, x, none);
  hapi_row *second = add_row(body, GROUND, y, none);
  first->ba[1] = -2.0;
  second->ba[0] = -2.0;
  s.v[body][0] = s.v[body][1] = -0.01;
}

static void solve_impossible(uint32_t direct_rows, uint32_t budget)
{
  set_up(2);
  make_impossible(1);
  s.solver.direct_rows = direct_rows;
  s.solver.update_budget = budget;
  double before = energy_of(s.v);
  for (int tick = 0; tick < 200; ++tick) {
    problem_solve();
  }
  CHECK(energy_of(s.v) <= before * (1.0 + 1e-9)); /* false for NaN */
}

TEST(what_no_impulse_can_solve_adds_no_energy)
{
  for (uint32_t budget = 0; budget <= 100000; budget = 3 * budget + 10) {
    solve_impossible(0, budget);
    solve_impossible(100, budget);
  }
}

TEST(no_numbers_leave_the_bodies_alone)
{
  set_up(3);
  const double none[6] = {0.0};
  const double x[6] = {1.0};
  hapi_row *row = add_row(1, GROUND, x, none);
  row->impulse = 1e305; /* finite, and not what it makes of a light body */
  row->lo = row->hi = 1e305;
  row->ba[0] = 1e10;
  (void)add_row(2, GROUND, x, none);
  s.v[1][0] = s.v[2][0] = -0.5;
  problem_solve();
  CHECK_NEAR(s.v[1][0], -0.5, 0.0);
  CHECK(s.rows[0].impulse == 0.0);
  CHECK_NEAR(s.v[2][0], 0.0, 1e-9); /* another island */
}

/* Two rows of bodies of their own, the first body with a velocity that is none. */
static void make_broken(void)
{
  const double none[6] = {0.0};
  const double x[6] = {1.0};
  set_up(3);
  add_row(1, GROUND, x, none)->impulse = 1.0; /* within its bounds */
  (void)add_row(2, GROUND, x, none);
  s.v[1][0] = NAN;
  memcpy(s.free_v, s.v, sizeof s.v);
  hapi_row_ready(&s.solver, 0);
  hapi_row_ready(&s.solver, 1);
}

TEST(a_direct_solve_does_not_lose_what_is_no_number)
{
  static double by_row[2][ROWS];
  hapi_island is = {.solver = &s.solver, .gain = by_row[0], .error = by_row[1]};
  make_broken();
  s.rows[0].next = 1;
  s.rows[1].next = HAPI_NO_SOLVER_ROW;
  CHECK(isnan(hapi_island_inspect(&is, false)));
  make_broken();
  CHECK(hapi_direct_run(&s.solver, 1000) == 0);
  CHECK(s.solver.direct.residual == HUGE_VAL);
}

/* ---- other islands ---- */

/* A row of bodies that runs into the ground: each holds all those behind it, which is far more
 * than a few sweeps find anew. */
TEST(a_solved_island_keeps_its_impulses_beside_an_impossible_one)
{
  const double none[6] = {0.0};
  const double x[6] = {1.0};
  const double back[6] = {-1.0};
  set_up(42);
  make_impossible(1);
  for (uint32_t i = 2; i < 42; ++i) {
    (void)add_row(i, i > 2 ? i - 1 : GROUND, x, i > 2 ? back : none);
    s.v[i][0] = -0.3;
  }
  problem_solve();
  CHECK(s.solver.residual > 1e-3);
  for (uint32_t i = 2; i < 42; ++i) {
    CHECK_NEAR(s.v[i][0], 0.0, 1e-6);
    CHECK_NEAR(s.rows[i].impulse, 0.3 * (42 - i), 1e-6);
  }
}

/* ---- what the budget cuts off ---- */

/* Bodies at random, half of them hanging together, with frictions up to 10 and warm starts that
 * are far too large. No target gives anything: energy can only be lost. */
static void make_heap(uint32_t bodies)
{
  set_up(bodies);
  for (uint32_t i = 1; i < bodies; ++i) {
    s.mass[i] = pow(10.0, random_draw(-3.0, 1.0));
    for (int k = 0; k < 6; ++k) {
      s.v[i][k] = random_draw(-1.0, 1.0);
    }
  }
  while (s.solver.row_count + 3 <= ROWS) {
    uint32_t a = 1 + draw_below(bodies - 1);
    uint32_t b = draw_below(a);
    int32_t normal = (int32_t)s.solver.row_count;
    for (int part = 0; part < 3; ++part) {
      double j[2][6];
      for (int k = 0; k < 6; ++k) {
        j[0][k] = random_draw(-1.0, 1.0);
        j[1][k] = b == GROUND ? 0.0 : random_draw(-1.0, 1.0);
      }
      hapi_row *row = add_row(a, b, j[0], j[1]);
      row->impulse = pow(10.0, random_draw(-3.0, 2.0));
      row->mu = part > 0 ? random_draw(0.0, 10.0) : 0.0;
      row->hi = part > 0 ? 0.0 : HUGE_VAL;
      row->normal = part > 0 ? normal : -1;
    }
  }
}

static void problem_spoil(uint32_t bodies, uint32_t budget)
{
  make_heap(bodies);
  s.solver.update_budget = budget;
  double before = energy_of(s.v);
  problem_solve();
  check_velocities();
  CHECK(energy_of(s.v) <= before * (1.0 + 1e-9));
}

TEST(no_budget_is_too_small_to_add_no_energy)
{
  state = 1;
  for (uint32_t i = 0; i < 40; ++i) {
    problem_spoil(8 + 3 * (i % 17), i % 4 * 3000);
  }
  problem_spoil(BODIES, 2000); /* more than there are islands for */
}
