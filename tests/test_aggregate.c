/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* All pairs of bodies at once (solver/aggregate.h): a row of cubes against its closed form, and
 * trees of random bodies, where what the normals minimise is worked out here from the rows. */

#include "tests/tap.h"

#include "tests/pack_problem.h"

#define CUBE 0.05 /* kg */

static problem one;
static problem two;
static uint64_t state;
static double warm; /* N s, of each normal */

static double six_dot(const double a[6], const double b[6])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5];
}

static void problem_begin(problem *p, const hapi_pack_work *work, bool pairs)
{
  memset(p, 0, sizeof *p);
  problem_link(p, work);
  p->solver.body_count = BODIES;
  p->solver.update_budget = UINT32_MAX;
  p->solver.ready = true;
  p->solver.packs.aggregate = pairs ? &p->aggregate : NULL;
  for (uint32_t i = 1; i < BODIES; ++i) {
    for (int k = 0; k < 3; ++k) {
      p->inverse_inertia[i][4 * k] = 1.0 / (CUBE * 4e-4);
    }
  }
}

/* Contacts of two bodies across x at points of a square, 3 rows each. b 0: the static world. */
static void pair_add(problem *p, uint32_t a, uint32_t b, uint32_t contacts, double mu)
{
  for (uint32_t c = 0; c < contacts; ++c) {
    uint32_t first = p->solver.row_count;
    double y = (c % 2 == 0 ? 0.01 : -0.01) * (1.0 + 0.3 * random_next(&state));
    double z = (c / 2 == 0 ? 0.01 : -0.01) * (1.0 + 0.3 * random_next(&state));
    const double x = b == 0 ? 0.0 : 0.02;
    const double directions[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (uint32_t i = 0; i < 3; ++i) {
      hapi_row *row = &p->rows[first + i];
      const double *d = directions[i];
      const double turn[2][3] = {{y * d[2] - z * d[1], z * d[0] + x * d[2], -x * d[1] - y * d[0]},
                                 {y * d[2] - z * d[1], z * d[0] - x * d[2], x * d[1] - y * d[0]}};
      row->a = a;
      row->b = b;
      row->single = b == 0;
      for (int k = 0; k < 3; ++k) {
        row->ja[k] = d[k];
        row->ja[3 + k] = turn[0][k];
        row->ba[k] = d[k] / CUBE;
        row->ba[3 + k] = turn[0][k] / (CUBE * 4e-4);
        row->jb[k] = b == 0 ? 0.0 : -d[k];
        row->jb[3 + k] = b == 0 ? 0.0 : -turn[1][k];
        row->bb[k] = row->jb[k] / CUBE;
        row->bb[3 + k] = row->jb[3 + k] / (CUBE * 4e-4);
      }
      row->hi = i == 0 ? HUGE_VAL : 0.0;
      row->mu = i == 0 ? 0.0 : mu;
      row->normal = i == 0 ? -1 : (int32_t)first;
      row->impulse = i == 0 ? warm : 0.0;
    }
    p->solver.row_count += 3;
    hapi_contact_ready(&p->solver, first, 3, true);
  }
}

/* ---- a row of cubes ---- */

#define SPEED 1.0 /* m/s of the last one, towards the others */

static void row_make(problem *p, const hapi_pack_work *work, bool pairs)
{
  problem_begin(p, work, pairs);
  warm = 1e-4;
  state = 7;
  p->v[BODIES - 1][0] = p->free_v[BODIES - 1][0] = -SPEED;
  for (uint32_t i = 1; i + 1 < BODIES; ++i) {
    pair_add(p, i + 1, i, PAIR_CONTACTS, 0.0);
  }
  p->solver.tolerance = 1e-9;
}

/* N s, by how much the pairs miss the closed form: one of n cubes hits the others, and all go on
 * together. Each hands on what those before it take. */
static double row_miss(const problem *p)
{
  double most = 0.0;
  for (uint32_t i = 1; i + 1 < BODIES; ++i) {
    double sum = 0.0;
    for (uint32_t c = 0; c < PAIR_CONTACTS; ++c) {
      sum += p->rows[3 * ((i - 1) * PAIR_CONTACTS + c)].impulse;
    }
    most = fmax(most, fabs(sum - CUBE * SPEED * i / (BODIES - 1)));
  }
  return most;
}

TEST(a_row_of_cubes_ends_as_in_its_closed_form)
{
  row_make(&one, hapi_pack_work_best(), true);
  problem_run(&one);
  CHECK(one.solver.residual < 1e-9);
  CHECK(one.solver.packs.aggregate->count == BODIES - 2);
  CHECK_SAY(row_miss(&one) < 1e-8, "%g", row_miss(&one));
  for (uint32_t i = 1; i < BODIES; ++i) {
    CHECK_NEAR(one.v[i][0], -SPEED / (BODIES - 1), 1e-7);
  }
}

/* A load that goes through all of the row, in as few sweeps as a tick makes. All cubes touch from
 * the begin. */
TEST(a_row_of_cubes_is_near_its_end_after_a_few_sweeps)
{
  for (int pairs = 0; pairs < 2; ++pairs) {
    problem *p = pairs ? &one : &two;
    row_make(p, hapi_pack_work_best(), pairs);
    p->solver.max_sweeps = 16;
    problem_run(p);
    CHECK(p->solver.sweeps == 16);
  }
  CHECK_SAY(row_miss(&one) < 0.01 * CUBE * SPEED, "%g", row_miss(&one));
  CHECK_SAY(row_miss(&one) < 0.02 * row_miss(&two), "%g of %g", row_miss(&one), row_miss(&two));
}

/* ---- random trees ---- */

static void tree_make(problem *p, const hapi_pack_work *work, uint64_t seed)
{
  problem_begin(p, work, true);
  warm = 0.0;
  state = seed;
  for (uint32_t i = 1; i < BODIES; ++i) {
    for (int k = 0; k < 6; ++k) {
      p->v[i][k] = p->free_v[i][k] = (k < 3 ? 0.1 : 1.0) * random_next(&state);
    }
  }
  for (uint32_t i = 1; i < BODIES; ++i) {
    uint32_t before = i > 3 ? i - 1 - (uint32_t)(1.0 + random_next(&state)) : i - 1;
    uint32_t contacts = 1 + (uint32_t)(2.0 * (1.0 + random_next(&state)));
    pair_add(p, i, before, contacts < 4 ? contacts : 4, 0.4);
    if (random_next(&state) > 0.0 && before != 0) {
      pair_add(p, i, 0, 2, 0.4);
    }
  }
}

static void packs_begin(void)
{
  REQUIRE(hapi_packs_begin(&one.solver.packs, one.rows, one.solver.row_count, BODIES));
  hapi_aggregate_plan(&one.solver.packs);
}

/* J: half of impulse x A x impulse, less what the errors without impulses ask for. */
static double energy_of(const problem *p)
{
  static double dv[BODIES][6];
  double energy = 0.0;
  memset(dv, 0, sizeof dv);
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    const hapi_row *row = &p->rows[i];
    for (int k = 0; k < 6; ++k) {
      dv[row->a][k] += row->impulse * row->ba[k];
      dv[row->b][k] += row->impulse * row->bb[k];
    }
  }
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    const hapi_row *row = &p->rows[i];
    double made = six_dot(row->ja, dv[row->a]) + six_dot(row->jb, dv[row->b]);
    double asked =
        row->target - six_dot(row->ja, p->free_v[row->a]) - six_dot(row->jb, p->free_v[row->b]);
    energy += row->impulse * (0.5 * made - asked);
  }
  return energy;
}

TEST(energy_falls_by_what_a_step_says)
{
  double most = 0.0;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    tree_make(&one, hapi_pack_work_best(), seed);
    packs_begin();
    REQUIRE(one.solver.packs.aggregate->count > BODIES / 2);
    for (int step = 0; step < 4; ++step) {
      hapi_corrections sum = {0.0, 0.0};
      one.solver.packs.work->sweep(&one.solver.packs, one.v, step % 2 == 0, &sum);
      hapi_packs_store(&one.solver.packs, one.rows);
      double before = energy_of(&one);
      double taken = hapi_aggregate_step(&one.solver.packs, one.v);
      hapi_packs_store(&one.solver.packs, one.rows);
      CHECK(taken >= 0.0);
      CHECK_NEAR(before - energy_of(&one), 0.5 * taken, 1e-12 + 1e-9 * fabs(before));
      most = fmax(most, taken);
    }
  }
  CHECK(most > 1e-5);
}

/* Nothing pulls, frictions stay, and the velocities are those of the impulses. */
TEST(a_step_moves_normals_and_bodies_together)
{
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    static double v[BODIES][6];
    static double friction[ROWS];
    hapi_corrections sum = {0.0, 0.0};
    tree_make(&one, hapi_pack_work_best(), seed);
    packs_begin();
    one.solver.packs.work->sweep(&one.solver.packs, one.v, true, &sum);
    hapi_packs_store(&one.solver.packs, one.rows);
    for (uint32_t i = 0; i < one.solver.row_count; ++i) {
      friction[i] = one.rows[i].impulse;
    }
    (void)hapi_aggregate_step(&one.solver.packs, one.v);
    hapi_packs_store(&one.solver.packs, one.rows);
    memcpy(v, one.free_v, sizeof v);
    for (uint32_t i = 0; i < one.solver.row_count; ++i) {
      const hapi_row *row = &one.rows[i];
      CHECK(row->normal >= 0 ? row->impulse == friction[i] : row->impulse >= 0.0);
      for (int k = 0; k < 6; ++k) {
        v[row->a][k] += row->impulse * row->ba[k];
        v[row->b][k] += row->impulse * row->bb[k];
      }
    }
    for (uint32_t i = 1; i < BODIES; ++i) {
      for (int k = 0; k < 6; ++k) {
        CHECK_NEAR(v[i][k], one.v[i][k], 1e-11);
      }
    }
  }
}

TEST(the_bits_are_the_same_by_pairs_and_in_plain_c)
{
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    tree_make(&one, hapi_pack_work_best(), seed);
    tree_make(&two, &hapi_pack_work_pairs, seed);
    one.solver.max_sweeps = two.solver.max_sweeps = 12;
    problem_run(&one);
    problem_run(&two);
    CHECK(one.solver.packs.aggregate->count > 0);
    CHECK(memcmp(one.v, two.v, sizeof one.v) == 0);
    tree_make(&two, &plain_hapi_pack_work_pairs, seed);
    two.solver.max_sweeps = 12;
    problem_run_by(&two, plain_hapi_solver_run);
    CHECK(memcmp(one.v, two.v, sizeof one.v) == 0);
  }
}

/* ---- where steps are made ---- */

#define SIDE 6 /* bodies of a square that each touch four others and the floor, as in a pile */

static void square_make(problem *p)
{
  problem_begin(p, hapi_pack_work_best(), true);
  state = 5;
  warm = 0.0;
  for (uint32_t i = 0; i < SIDE * SIDE; ++i) {
    pair_add(p, 1 + i, 0, PAIR_CONTACTS, 0.4);
    if (i % SIDE > 0) {
      pair_add(p, 1 + i, i, 1, 0.4);
    }
    if (i >= SIDE && p->solver.row_count + 3 * PAIR_CONTACTS < ROWS) {
      pair_add(p, 1 + i, 1 + i - SIDE, 1, 0.4);
    }
  }
}

/* Loads of bodies that touch many others are not determined: sweeps alone say which they are. */
TEST(bodies_that_touch_many_others_take_no_steps)
{
  square_make(&one);
  packs_begin();
  CHECK(one.solver.packs.count > 0);
  CHECK(one.solver.packs.aggregate->count == 0);
  memset(&one.aggregate, 0, sizeof one.aggregate);
  row_make(&one, hapi_pack_work_best(), true);
  packs_begin();
  CHECK(one.solver.packs.aggregate->count == BODIES - 2);
}

/* Nor is the plan made anew in each tick. One of fewer pairs is. */
TEST(a_plan_that_came_out_too_wide_is_left_out_for_a_while)
{
  hapi_packs *packs = &one.solver.packs;
  square_make(&one);
  packs_begin();
  const hapi_aggregate_wide wide = one.aggregate.wide;
  CHECK(wide.units == packs->unit_count && wide.plans > 0);
  for (uint32_t i = wide.plans; i > 0; --i) {
    hapi_aggregate_plan(packs);
    CHECK(one.aggregate.wide.plans == i - 1 && one.aggregate.count == 0);
  }
  hapi_aggregate_plan(packs);
  CHECK(one.aggregate.wide.plans == wide.plans);
  row_make(&one, hapi_pack_work_best(), true);
  one.aggregate.wide = wide;
  packs_begin();
  CHECK(packs->unit_count < wide.units);
  CHECK(one.aggregate.count == BODIES - 2 && one.aggregate.wide.units == 0);
}

/* A tick whose budget is nearly spent makes none. */
TEST(a_step_is_within_the_budget)
{
  row_make(&one, hapi_pack_work_best(), true);
  row_make(&two, hapi_pack_work_best(), false);
  one.solver.update_budget = two.solver.update_budget = 1000;
  problem_run(&one);
  problem_run(&two);
  CHECK(one.solver.updates <= two.solver.updates);
  CHECK(memcmp(one.v, two.v, sizeof one.v) == 0);
}

/* ---- what may be wrong ---- */

TEST(what_is_no_number_ends_no_step_in_the_velocities_of_others)
{
  tree_make(&one, hapi_pack_work_best(), 3);
  packs_begin();
  one.v[BODIES - 1][0] = NAN;
  CHECK(hapi_aggregate_step(&one.solver.packs, one.v) == 0.0);
  for (uint32_t i = 1; i + 1 < BODIES; ++i) {
    CHECK(isfinite(one.v[i][0]));
  }
}
