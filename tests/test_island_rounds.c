/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Rounds of direct solves: contacts of a pair enter one together, and it asks for what their rows
 * ask for one by one; none is made where what is due may be left. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>

#include "solver/island.h"
#include "tests/pack_problem.h"

#define BOXES 4u /* one on another, the lowest on the ground, which is body 0 */
#define POINTS 4u
#define CONTACTS (BOXES * POINTS)
#define DAMPED 1e-3 /* R: so large that the equations are well behaved */

static problem p;
static uint64_t seed;

static void cross_product(const double a[3], const double b[3], double out[3])
{
  for (int k = 0; k < 3; ++k) {
    out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  }
}

static void body_make(uint32_t body)
{
  for (int i = 0; i < 3; ++i) {
    p.inverse_inertia[body][4 * i] = 1000.0 * (double)(body + (uint32_t)i);
  }
  for (int k = 0; k < 6; ++k) {
    p.v[body][k] = (k < 3 ? 0.1 : 1.0) * random_next(&seed);
  }
}

static double inverse_mass(uint32_t body)
{
  return 2.0 * (double)body;
}

static void column_make(uint32_t body, double sign, const double direction[3], const double arm[3],
                        double j[6], double b[6])
{
  for (int k = 0; k < 3; ++k) {
    j[k] = sign * direction[k];
    b[k] = inverse_mass(body) * j[k];
  }
  cross_product(arm, j, j + 3);
  for (int k = 0; k < 3; ++k) {
    b[3 + k] = p.inverse_inertia[body][4 * k] * j[3 + k];
  }
}

/* Of a box and the one below, at a corner. tilt: rad and m, by which what was made later is off. */
static void contact_make(uint32_t first, uint32_t box, uint32_t corner, double tilt)
{
  const double point[3] = {(corner & 1u) != 0 ? 0.03 : -0.03, (corner & 2u) != 0 ? 0.03 : -0.03,
                           0.02 * random_next(&seed)};
  const double directions[3][3] = {
      {sin(tilt), 0.0, cos(tilt)}, {cos(tilt), 0.0, -sin(tilt)}, {0.0, 1.0, 0.0}};
  const double arm_a[3] = {point[0], point[1], point[2] - 0.02};
  const double arm_b[3] = {point[0] + tilt, point[1] - tilt, point[2] + 0.03 + tilt};
  for (uint32_t i = 0; i < 3; ++i) {
    hapi_row *row = &p.rows[first + i];
    *row = (hapi_row){.a = box,
                      .b = box - 1,
                      .single = box == 1,
                      .normal = i == 0 ? -1 : (int32_t)first,
                      .hi = i == 0 ? HUGE_VAL : 0.0,
                      .mu = i == 0 ? 0.0 : 0.3};
    column_make(box, 1.0, directions[i], arm_a, row->ja, row->ba);
    if (box > 1) {
      column_make(box - 1, -1.0, directions[i], arm_b, row->jb, row->bb);
    }
  }
}

/* Contacts of all kinds: most stick, some slide along, some do not push. */
static void impulses_make(uint32_t contact)
{
  hapi_row *row = &p.rows[3 * contact];
  row[0].impulse = contact % 7 == 6 ? 0.0 : 0.01 * (1.5 + random_next(&seed));
  row[0].target = contact % 7 == 6 ? -10.0 : 0.0;
  for (int i = 1; i < 3; ++i) {
    bool slides = contact % 3 == 1;
    row[i].impulse = row[0].impulse * 0.3 * (slides ? 1.0 : 0.5 * random_next(&seed));
    row[i].target = slides ? 10.0 : 0.0;
  }
}

static void problem_make(double tilt)
{
  memset(&p, 0, sizeof p);
  seed = 7;
  problem_link(&p, hapi_pack_work_best());
  p.solver.body_count = BOXES + 1;
  p.solver.row_count = 3 * CONTACTS;
  for (uint32_t box = 1; box <= BOXES; ++box) {
    body_make(box);
  }
  for (uint32_t i = 0; i < CONTACTS; ++i) {
    contact_make(3 * i, 1 + i / POINTS, i % POINTS, i % POINTS < 2 ? 0.0 : tilt);
    impulses_make(i);
    hapi_contact_ready(&p.solver, 3 * i, 3, true);
    for (uint32_t k = 3 * i; k < 3 * i + 3; ++k) {
      p.rows[k].next = k + 1 < p.solver.row_count ? k + 1 : HAPI_NO_SOLVER_ROW;
    }
  }
}

/* The change of all velocities that a round asks for; counts rows by their states. */
static void round_ask(double (*out)[6], uint32_t counts[3])
{
  static hapi_island is;
  hapi_island_begin(&is, &p.solver);
  is.softening = DAMPED;
  is.first = 0;
  REQUIRE(hapi_island_inspect(&is, false) > 0.0);
  memset(counts, 0, 3 * sizeof *counts);
  for (uint32_t i = 0; i < p.solver.row_count; ++i) {
    REQUIRE(p.rows[i].state < 3);
    ++counts[p.rows[i].state];
  }
  REQUIRE(hapi_island_gather(&is));
  REQUIRE(hapi_island_plan(&is) > 0);
  REQUIRE(hapi_island_place(&is));
  hapi_island_gains(&is);
  hapi_island_factor(&is);
  hapi_island_substitute(&is);
  for (uint32_t i = 0; i < is.count; ++i) {
    memcpy(out[is.body[i]], is.dv[is.body[i]], sizeof *out);
  }
}

/* turned: by how much, since the rows were made, a body answers otherwise now. */
static void check_alike(double tilt, double turned)
{
  double together[BODIES][6] = {{0.0}};
  double one_by_one[BODIES][6] = {{0.0}};
  uint32_t counts[3];
  double apart = 0.0;
  double size = 0.0;
  problem_make(tilt);
  p.inverse_inertia[2][4] *= 1.0 + turned;
  round_ask(together, counts);
  CHECK(counts[HAPI_ROW_FREE] > 8 && counts[HAPI_ROW_TIED] > 4 && counts[HAPI_ROW_FIXED] > 4);
  for (uint32_t i = 0; i < p.solver.row_count; ++i) {
    p.rows[i].triple = 0;
  }
  round_ask(one_by_one, counts);
  for (uint32_t i = 1; i <= BOXES; ++i) {
    for (int k = 0; k < 6; ++k) {
      apart = fmax(apart, fabs(together[i][k] - one_by_one[i][k]));
      size = fmax(size, fabs(one_by_one[i][k]));
    }
  }
  CHECK_SAY(size > 0.01 && apart < (1e-11 + turned) * size, "%g of %g", apart, size);
}

TEST(contacts_of_a_pair_ask_for_what_their_rows_do)
{
  check_alike(0.0, 0.0);
  check_alike(0.0, 1e-3);
}

/* A body that turns a little keeps the rows of some of its contacts. */
TEST(so_do_contacts_that_were_made_one_after_the_other)
{
  check_alike(1e-5, 0.0);
}

/* All boxes fall on each other, and stick. */
static void stack_fall(void)
{
  for (uint32_t i = 1; i <= BOXES; ++i) {
    memcpy(p.v[i], (double[6]){0.02, 0.01, -0.1, 0.0, 0.0, 0.0}, sizeof p.v[i]);
  }
  for (uint32_t i = 0; i < p.solver.row_count; ++i) {
    p.rows[i].drive = p.rows[i].target = p.rows[i].impulse = 0.0;
    p.rows[i].mu = 10.0;
  }
  memcpy(p.free_v, p.v, sizeof p.v);
  p.solver.packs.work = NULL;
}

/* Row updates of its direct solve. may_stay: J */
static uint32_t direct_cost(double may_stay)
{
  problem_make(0.0);
  stack_fall();
  p.solver.ready = true;
  p.solver.tolerance = 1e-12;
  p.solver.coarse = (hapi_coarse){may_stay, 1e-3, 1e-3};
  p.solver.update_budget = 20000;
  p.solver.direct_rows = 3 * CONTACTS;
  hapi_solver_run(&p.solver);
  printf("# %u sweeps, residual %g m/s, direct solve %u row updates\n", p.solver.sweeps,
         p.solver.residual, p.solver.direct.cost);
  return p.solver.direct.cost;
}

/* That one is with least R. */
TEST(a_round_more_is_made_where_nothing_may_be_left)
{
  uint32_t some = direct_cost(1e-7);
  CHECK(some > 0 && p.solver.direct_solves == 1);
  CHECK(p.solver.residual < 1e-3);
  CHECK(direct_cost(0.0) > some);
  CHECK(p.solver.residual < 1e-12);
}
