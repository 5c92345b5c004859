/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The solver two numbers at a time against the same sources in plain C (`plain_`, see
 * meson.build): the same bits, from the rows' preparation to direct solves and what is done with
 * islands that are not solved. */

#include "tests/tap.h"

#include <stdint.h>

#include "base/lanes.h"
#include "base/pose.h"
#include "local/gyro.h"
#include "solver/contact_solver.h"

#define BODIES 24u
#define CONTACTS 90u
#define ROWS (3 * CONTACTS + 8)
#define WORK (HAPI_SOLVER_WORK(ROWS, BODIES))

void plain_hapi_solver_run(hapi_solver *solver);
void plain_hapi_solver_calm(hapi_solver *solver);
void plain_hapi_contact_ready(hapi_solver *solver, uint32_t first, uint32_t count, bool by_mass);

typedef struct problem {
  hapi_row rows[ROWS];
  double v[BODIES][6];
  double free_v[BODIES][6];
  double work[WORK];
  hapi_solver solver;
} problem;

static problem wide;
static problem plain;
static uint64_t state;

static double random_next(void) /* -1 .. 1 */
{
  state = state * 6364136223846793005u + 1442695040888963407u;
  return (double)(int64_t)state / 9.3e18;
}

static void row_fill(hapi_row *row, uint32_t a, uint32_t b, double inertia[BODIES][6])
{
  memset(row, 0, sizeof *row);
  row->a = a;
  row->b = b;
  for (int k = 0; k < 6; ++k) {
    row->ja[k] = random_next();
    row->jb[k] = b != 0 ? random_next() : 0.0;
    row->ba[k] = row->ja[k] * inertia[a][k];
    row->bb[k] = row->jb[k] * inertia[b][k];
  }
  row->hi = HUGE_VAL;
  row->normal = -1;
  row->impulse = 1e-3 * random_next();
  row->target = 0.1 * random_next();
  row->softness = 0.01 * fabs(random_next());
}

/* Contacts between bodies of unlike mass, some with the world, and a few rows by themselves. */
static void problem_make(uint64_t seed, uint32_t budget, uint32_t direct_rows)
{
  double inertia[BODIES][6];
  memset(&wide, 0, sizeof wide);
  state = seed;
  for (uint32_t i = 0; i < BODIES; ++i) {
    for (int k = 0; k < 6; ++k) {
      inertia[i][k] = i == 0 ? 0.0 : exp(3.0 * random_next());
      wide.v[i][k] = wide.free_v[i][k] = i == 0 ? 0.0 : random_next();
    }
  }
  uint32_t count = 0;
  for (uint32_t c = 0; c < CONTACTS; ++c) {
    uint32_t a = 1 + c % (BODIES - 1);
    uint32_t b = c % 3 == 0 ? 0 : a > 1 ? a - 1 : BODIES - 1;
    for (int part = 0; part < 3; ++part) {
      hapi_row *row = &wide.rows[count + (uint32_t)part];
      row_fill(row, a, b, inertia);
      row->normal = part == 0 ? -1 : (int32_t)count;
      row->mu = part == 0 ? 0.0 : 0.6;
      row->hi = part == 0 ? HUGE_VAL : 0.0;
    }
    count += 3;
  }
  for (; count < ROWS; ++count) {
    row_fill(&wide.rows[count], 1 + count % (BODIES - 1), 0, inertia);
  }
  wide.solver = (hapi_solver){.row_count = ROWS,
                              .body_count = BODIES,
                              .tolerance = 1e-9,
                              .update_budget = budget,
                              .direct_rows = direct_rows,
                              .work_count = WORK};
  plain = wide;
  for (int i = 0; i < 2; ++i) {
    problem *p = i == 0 ? &wide : &plain;
    p->solver.rows = p->rows;
    p->solver.v = p->v;
    p->solver.free = p->free_v;
    p->solver.work = p->work;
  }
}

static void solvers_compare(void)
{
  CHECK(memcmp(wide.v, plain.v, sizeof wide.v) == 0);
  for (uint32_t i = 0; i < ROWS; ++i) {
    CHECK(memcmp(&wide.rows[i].impulse, &plain.rows[i].impulse, sizeof(double)) == 0);
    CHECK_NEAR(wide.rows[i].inverse, plain.rows[i].inverse, 0.0);
  }
  CHECK(wide.solver.sweeps == plain.solver.sweeps && wide.solver.sweeps >= 2);
  CHECK(wide.solver.direct_solves == plain.solver.direct_solves);
  CHECK_NEAR(wide.solver.residual, plain.solver.residual, 0.0);
}

static bool is_plain(void)
{
#ifdef HAPODE_PLAIN_LANES
  tap_skip("built in plain C");
  return true;
#else
  return false;
#endif
}

TEST(solver_sweeps)
{
  for (uint64_t seed = 1; seed <= 10 && !is_plain(); ++seed) {
    problem_make(seed, 20000, 0);
    hapi_solver_run(&wide.solver);
    plain_hapi_solver_run(&plain.solver);
    solvers_compare();
  }
}

TEST(direct_solves)
{
  uint32_t solves = 0;
  for (uint64_t seed = 1; seed <= 10 && !is_plain(); ++seed) {
    problem_make(seed, 200000, ROWS);
    for (uint32_t i = 0; i < 3 * CONTACTS; ++i) { /* of more there is no solution */
      wide.rows[i].mu = plain.rows[i].mu *= 0.1;
    }
    hapi_solver_run(&wide.solver);
    plain_hapi_solver_run(&plain.solver);
    solvers_compare();
    solves += wide.solver.direct_solves;
  }
  CHECK(is_plain() || solves > 0);
}

/* As the tick makes them: contact by contact, from last impulses. */
TEST(contacts_one_by_one)
{
  for (uint64_t seed = 1; seed <= 10 && !is_plain(); ++seed) {
    problem_make(seed, 1000, 0);
    for (uint32_t i = 0; i < ROWS; i += i < 3 * CONTACTS ? 3 : 1) {
      uint32_t count = i < 3 * CONTACTS ? 3 : 1;
      hapi_contact_ready(&wide.solver, i, count, false);
      plain_hapi_contact_ready(&plain.solver, i, count, false);
    }
    wide.solver.ready = plain.solver.ready = true;
    hapi_solver_run(&wide.solver);
    plain_hapi_solver_run(&plain.solver);
    hapi_solver_calm(&wide.solver);
    plain_hapi_solver_calm(&plain.solver);
    solvers_compare();
  }
}

/* What the solver still owes to v. */
static void triples_push(problem *p)
{
  for (uint32_t i = 0; i < 3 * CONTACTS; i += 3) {
    for (uint32_t k = i; p->rows[i].triple && k < i + 3; ++k) {
      hapi_madd6(p->v[p->rows[k].a], p->rows[k].impulse, p->rows[k].ba);
      if (hapi_row_moves_b(&p->rows[k])) {
        hapi_madd6(p->v[p->rows[k].b], p->rows[k].impulse, p->rows[k].bb);
      }
    }
  }
}

/* All rows of a contact at once are what they are one by one. */
TEST(contact_as_rows)
{
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    problem_make(seed, 1000, 0);
    for (uint32_t i = 0; i < 3 * CONTACTS; ++i) {
      hapi_row_ready(&plain.solver, i);
    }
    for (uint32_t i = 0; i < 3 * CONTACTS; i += 3) {
      hapi_contact_ready(&wide.solver, i, 3, false);
    }
    for (uint32_t i = 0; i < 3 * CONTACTS; ++i) {
      CHECK_NEAR(wide.rows[i].impulse, plain.rows[i].impulse, 0.0);
      CHECK_NEAR(wide.rows[i].drive, plain.rows[i].drive, 0.0);
      CHECK(wide.rows[i].triple == plain.rows[i].triple);
    }
    CHECK(wide.solver.owes && !plain.solver.owes);
    triples_push(&wide);
    for (uint32_t i = 0; i < BODIES; ++i) {
      for (int k = 0; k < 6; ++k) {
        CHECK_NEAR(wide.v[i][k], plain.v[i][k], 1e-12);
      }
    }
  }
}

/* A row by itself of which the sum is known, added up one by one; one that cannot be used
 * likewise. */
TEST(single_as_row)
{
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    problem_make(seed, 1000, 0);
    for (uint32_t i = 3 * CONTACTS; i < ROWS; ++i) {
      hapi_row *row = &wide.rows[i];
      row->single = 1;
      row->target = i % 4 == 1 ? NAN : row->target;
      row->hi = i % 4 == 2 ? -1.0 : row->hi;
      plain.rows[i] = *row;
      double response = hapi_dot6_fresh(row->ja, row->ba);
      CHECK_NEAR(response, hapi_dot6(row->ja, row->ba), 0.0);
      hapi_single_ready(&wide.solver, i, response);
      hapi_row_ready(&plain.solver, i);
    }
    CHECK(memcmp(wide.rows, plain.rows, sizeof wide.rows) == 0);
    CHECK(memcmp(wide.v, plain.v, sizeof wide.v) == 0);
  }
}

static void random_quat(double out[4], double length)
{
  for (int i = 0; i < 4; ++i) {
    out[i] = random_next();
  }
  hapi_quat_normalize(out);
  for (int i = 0; i < 4; ++i) {
    out[i] *= length;
  }
}

/* Two bodies at once turn as each by itself does, also one that has no unit length. */
TEST(two_turns)
{
  state = 7;
  for (int i = 0; i < 1000; ++i) {
    double quats[2][4];
    double moved[2][4]; /* by eq. 11 */
    double alone[2][4];
    double moved_alone[2][4];
    double spins[2][3];
    for (int k = 0; k < 2; ++k) {
      random_quat(quats[k], i % 10 == 0 && k == i % 20 / 10 ? 2.0 + random_next() : 1.0);
      for (int axis = 0; axis < 3; ++axis) {
        spins[k][axis] = i % 7 == 0 ? 0.0 : 40.0 * random_next();
      }
    }
    memcpy(alone, quats, sizeof alone);
    memcpy(moved, quats, sizeof moved);
    memcpy(moved_alone, quats, sizeof moved_alone);
    for (int k = 0; k < 2; ++k) {
      hapi_turn(alone[k], spins[k], 1e-3);
      hapi_quat_move(moved_alone[k], spins[k], 1e-3);
    }
    hapi_turn_two(quats[0], spins[0], quats[1], spins[1], 1e-3);
    hapi_two_turns_move(moved[0], spins[0], moved[1], spins[1], 1e-3);
    CHECK(memcmp(quats, alone, sizeof quats) == 0);
    CHECK(memcmp(moved, moved_alone, sizeof moved) == 0);
  }
}
