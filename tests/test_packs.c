/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Contacts side by side in packs: what they end at is what the rows ask for, worked out here from
 * nothing but the rows; the same bits by AVX2, by pairs and in plain C (`plain_`, see meson.build);
 * packs that are kept go the way of packs that are made anew. */

#include "tests/tap.h"

#include "solver/island.h"
#include "solver/island_packs.h"
#include "tests/pack_problem.h"

static problem one;
static problem two;
static double mass[BODIES];     /* inverse; 0: does not respond */
static double turns[BODIES][9]; /* inverse inertia, likewise */
static double centre[BODIES][3];
static uint64_t state;

static void vector_cross(const double a[3], const double b[3], double out[3])
{
  for (int k = 0; k < 3; ++k) {
    out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  }
}

static double vector_dot(const double *a, const double *b, int count)
{
  double sum = 0.0;
  for (int k = 0; k < count; ++k) {
    sum += a[k] * b[k];
  }
  return sum;
}

static void random_frame(double out[3][3])
{
  for (int k = 0; k < 3; ++k) {
    out[0][k] = random_next(&state);
    out[1][k] = random_next(&state);
  }
  double length = sqrt(vector_dot(out[0], out[0], 3));
  for (int k = 0; k < 3; ++k) {
    out[0][k] /= length;
  }
  double along = vector_dot(out[0], out[1], 3);
  for (int k = 0; k < 3; ++k) {
    out[1][k] -= along * out[0][k];
  }
  length = sqrt(vector_dot(out[1], out[1], 3));
  for (int k = 0; k < 3; ++k) {
    out[1][k] /= length;
  }
  vector_cross(out[0], out[1], out[2]);
  double hand = random_next(&state) < 0.0 ? -1.0 : 1.0;
  for (int k = 0; k < 3; ++k) {
    out[2][k] *= hand;
  }
}

/* Of another inverse inertia along each of three axes. */
static void random_body(uint32_t body)
{
  double axes[3][3];
  random_frame(axes);
  memset(turns[body], 0, sizeof turns[body]);
  for (int i = 0; i < 3; ++i) {
    double along = mass[body] * 1000.0 * exp(random_next(&state));
    centre[body][i] = 0.05 * random_next(&state);
    for (int k = 0; k < 9; ++k) {
      turns[body][k] += along * axes[i][k / 3] * axes[i][k % 3];
    }
  }
}

static void row_column(uint32_t body, double sign, const double direction[3], const double arm[3],
                       double j[6], double b[6])
{
  for (int k = 0; k < 3; ++k) {
    j[k] = sign * direction[k];
  }
  vector_cross(arm, j, j + 3);
  for (int k = 0; k < 3; ++k) {
    b[k] = j[k] * mass[body];
    b[3 + k] = vector_dot(turns[body] + 3 * (ptrdiff_t)k, j + 3, 3);
  }
}

/* One of a pair's contacts, 3 rows. */
static void contact_fill(hapi_row *rows, uint32_t a, uint32_t b, double frame[3][3], double mu)
{
  double arm[2][3];
  for (int k = 0; k < 3; ++k) {
    double point = 0.05 * random_next(&state);
    arm[0][k] = point - centre[a][k];
    arm[1][k] = point - centre[b][k];
  }
  for (int i = 0; i < 3; ++i) {
    hapi_row *row = &rows[i];
    memset(row, 0, sizeof *row);
    row->a = a;
    row->b = b;
    row->single = b == 0;
    row_column(a, 1.0, frame[i], arm[0], row->ja, row->ba);
    if (b != 0) {
      row_column(b, -1.0, frame[i], arm[1], row->jb, row->bb);
    }
    row->hi = i == 0 ? HUGE_VAL : 0.0;
    row->mu = i == 0 ? 0.0 : mu;
    row->normal = -1;
    row->impulse = i == 0 ? 1e-3 * fabs(random_next(&state)) : 0.0;
    row->softness = 0.1;
  }
}

/* A row that goes into no pack: a motor along one axis. */
static void other_fill(hapi_row *row, uint32_t a)
{
  memset(row, 0, sizeof *row);
  row->a = a;
  row->single = 1;
  row->ja[a % 3] = 1.0;
  row->ba[a % 3] = mass[a];
  row->lo = -0.01;
  row->hi = 0.01;
  row->normal = -1;
  row->target = 0.1 * random_next(&state);
  row->softness = 1e-4;
}

static void contacts_make(problem *p, double mu)
{
  uint32_t count = 0;
  for (uint32_t pair = 0; pair < PAIRS; ++pair) {
    double frame[3][3];
    uint32_t a = 1 + pair % (BODIES - 1);
    uint32_t b = pair % 2 == 0 ? 0 : 1 + (pair * 7 + 3) % (BODIES - 1);
    b = b == a ? 0 : b;
    random_frame(frame);
    for (uint32_t i = 0; i < 1 + pair % PAIR_CONTACTS; ++i) {
      contact_fill(&p->rows[count], a, b, frame, mu);
      for (uint32_t k = 1; k < 3; ++k) {
        p->rows[count + k].normal = (int32_t)count;
      }
      count += 3;
    }
    if (pair % 8 == 5) {
      other_fill(&p->rows[count++], a);
    }
  }
  p->solver.row_count = count;
}

static void problem_make(problem *p, uint64_t seed, double mu, uint32_t sweeps)
{
  memset(p, 0, sizeof *p);
  state = seed;
  for (uint32_t i = 0; i < BODIES; ++i) {
    mass[i] = i == 0 ? 0.0 : i == 9 ? 0.0 : exp(random_next(&state));
    random_body(i);
    memcpy(p->inverse_inertia[i], turns[i], sizeof turns[i]);
    for (int k = 0; k < 6; ++k) {
      p->v[i][k] = p->free_v[i][k] = i == 0 ? 0.0 : (k < 3 ? 0.1 : 1.0) * random_next(&state);
    }
  }
  contacts_make(p, mu);
  p->solver.body_count = BODIES;
  p->solver.tolerance = 1e-12;
  p->solver.update_budget = UINT32_MAX;
  p->solver.max_sweeps = sweeps;
  p->solver.ready = true;
}

typedef void (*contact_ready)(hapi_solver *solver, uint32_t first, uint32_t count, bool by_mass);
typedef void (*row_ready)(hapi_solver *solver, uint32_t index);

static void rows_ready(problem *p, contact_ready contact, row_ready other)
{
  for (uint32_t i = 0; i < p->solver.row_count;) {
    bool triple = i + 1 < p->solver.row_count && p->rows[i + 1].normal == (int32_t)i;
    if (triple) {
      contact(&p->solver, i, 3, true);
    } else {
      other(&p->solver, i);
    }
    i += triple ? 3 : 1;
  }
}

/* What the impulses of all rows make of the free velocities. */
static void velocities_make(const problem *p, double (*out)[6])
{
  memcpy(out, p->free_v, BODIES * sizeof *out);
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    const hapi_row *row = &p->rows[i];
    for (int k = 0; k < 6; ++k) {
      out[row->a][k] += row->impulse * row->ba[k];
      out[row->b][k] += row->impulse * row->bb[k];
    }
  }
}

/* m/s, by how much the impulses miss what the rows ask for. */
static double rows_miss(const problem *p)
{
  static double v[BODIES][6];
  double most = 0.0;
  velocities_make(p, v);
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    const hapi_row *row = &p->rows[i];
    double load = row->normal < 0 ? 0.0 : fmax(p->rows[row->normal].impulse, row->hi);
    double hi = row->normal < 0 ? row->hi : row->mu * load;
    double lo = row->normal < 0 ? row->lo : -hi;
    double w = vector_dot(row->ja, v[row->a], 6) + vector_dot(row->jb, v[row->b], 6);
    double over = w + row->softness * row->impulse - row->target;
    if (vector_dot(row->ja, row->ba, 6) + vector_dot(row->jb, row->bb, 6) == 0.0) {
      continue;
    }
    CHECK(row->impulse >= lo - 1e-15 && row->impulse <= hi + 1e-15);
    double slack = 1e-12 * hi; /* direct solves end at bounds to the last bits */
    double miss = row->impulse <= lo && lo == hi ? 0.0
                  : row->impulse <= lo + slack   ? fmax(-over, 0.0)
                  : row->impulse >= hi - slack   ? fmax(over, 0.0)
                                                 : fabs(over);
    most = fmax(most, miss);
  }
  return most;
}

/* By sweeps alone, and by direct solves. */
TEST(impulses_are_what_the_rows_ask_for)
{
  uint32_t solves = 0;
  for (uint64_t seed = 1; seed <= 16; ++seed) {
    problem_make(&one, seed, 0.3, 20000);
    problem_link(&one, hapi_pack_work_best());
    one.solver.direct_rows = seed % 2 == 0 ? ROWS : 0;
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    problem_run(&one);
    CHECK(one.solver.packs.count > 0);
    CHECK(one.solver.packs.loose_rows < one.solver.row_count / 4);
    CHECK_SAY(rows_miss(&one) < 1e-10, "%g", rows_miss(&one));
    CHECK(!one.solver.packs.in_use);
    solves += one.solver.direct_solves;
  }
  CHECK_SAY(solves >= 8, "%u direct solves", solves);
}

/* Bodies on the ground that do not know of each other; direct_rows is for each. */
TEST(what_is_too_much_at_once_is_solved_one_by_one)
{
  uint32_t count = 0;
  problem_make(&one, 5, 0.3, 4);
  memset(one.rows, 0, sizeof one.rows);
  for (uint32_t body = 10; body < 30; ++body) {
    double frame[3][3];
    random_frame(frame);
    for (uint32_t i = 0; i < 3; ++i) {
      contact_fill(&one.rows[count], body, 0, frame, 0.3);
      one.rows[count + 1].normal = one.rows[count + 2].normal = (int32_t)count;
      count += 3;
    }
  }
  one.solver.row_count = count;
  one.solver.direct_rows = 9;
  problem_link(&one, hapi_pack_work_best());
  rows_ready(&one, hapi_contact_ready, hapi_row_ready);
  problem_run(&one);
  CHECK(one.solver.packs.count > 0);
  CHECK_SAY(one.solver.direct_solves >= 10, "%u direct solves", one.solver.direct_solves);
  CHECK_SAY(rows_miss(&one) < 1e-10, "%g", rows_miss(&one));
}

/* As what was pushed out has it; with packs and without. */
TEST(frictions_go_by_a_load_of_their_own)
{
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    uint32_t more = 0; /* than their normals would let them */
    problem_make(&one, seed, 0.3, 20000);
    for (uint32_t i = 0; i < one.solver.row_count; ++i) {
      one.rows[i].hi =
          one.rows[i].normal >= 0 && one.rows[i].normal % 2 == 0 ? 2e-3 : one.rows[i].hi;
    }
    problem_link(&one, seed % 2 == 0 ? hapi_pack_work_best() : NULL);
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    problem_run(&one);
    CHECK((one.solver.packs.count > 0) == (seed % 2 == 0));
    CHECK_SAY(rows_miss(&one) < 1e-10, "%g", rows_miss(&one));
    for (uint32_t i = 0; i < one.solver.row_count; ++i) {
      const hapi_row *row = &one.rows[i];
      more +=
          row->normal >= 0 && fabs(row->impulse) > 1.01 * row->mu * one.rows[row->normal].impulse;
    }
    CHECK(more > 10);
  }
}

/* J, beyond what the targets ask for, and the largest difference of v from what the impulses make,
 * m/s. */
static double energy_beyond(const problem *p, double *out_apart)
{
  static double v[BODIES][6];
  double energy = 0.0;
  *out_apart = 0.0;
  velocities_make(p, v);
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    const hapi_row *row = &p->rows[i];
    double before =
        vector_dot(row->ja, p->free_v[row->a], 6) + vector_dot(row->jb, p->free_v[row->b], 6);
    double after = vector_dot(row->ja, v[row->a], 6) + vector_dot(row->jb, v[row->b], 6);
    double mean = 0.5 * (before + after + row->softness * row->impulse);
    energy += row->impulse * (mean - row->target);
  }
  for (uint32_t i = 0; i < BODIES; ++i) {
    for (int k = 0; k < 6; ++k) {
      *out_apart = fmax(*out_apart, fabs(v[i][k] - p->v[i][k]));
    }
  }
  return energy;
}

/* What the calm solve goes by, of each row as solver_calm.c has it. */
TEST(rays_of_packs_are_those_of_their_rows)
{
  problem_make(&one, 3, 0.5, 2);
  problem_link(&one, hapi_pack_work_best());
  rows_ready(&one, hapi_contact_ready, hapi_row_ready);
  problem_run(&one);
  const hapi_packs *packs = &one.solver.packs;
  double a = 0.0;
  double b = 0.0;
  double size = 0.0;
  CHECK(packs->count > 0);
  for (uint32_t i = 0; i < packs->count; ++i) {
    hapi_pack_ray ray;
    hapi_pack_ray by_pairs;
    hapi_pack_ray plain;
    packs->work->ray(packs, i, one.free_v, one.v, &ray);
    hapi_pack_work_pairs.ray(packs, i, one.free_v, one.v, &by_pairs);
    plain_hapi_pack_work_pairs.ray(packs, i, one.free_v, one.v, &plain);
    CHECK(memcmp(&ray, &by_pairs, sizeof ray) == 0 && memcmp(&ray, &plain, sizeof ray) == 0);
    for (uint32_t lane = 0; lane < HAPI_LANES; ++lane) {
      a += ray.a[lane];
      b += ray.b[lane];
      size += ray.size[lane];
    }
  }
  double size_rows = 0.0;
  for (uint32_t i = 0; i < packs->packable_count; ++i) {
    for (uint32_t k = 0; k < 3; ++k) {
      const hapi_row *row = &one.rows[packs->packables[i].row + k];
      double before =
          vector_dot(row->ja, one.free_v[row->a], 6) + vector_dot(row->jb, one.free_v[row->b], 6);
      double after = vector_dot(row->ja, one.v[row->a], 6) + vector_dot(row->jb, one.v[row->b], 6);
      double asked = row->impulse * (row->target - before);
      double made = row->impulse * (after - before + row->softness * row->impulse);
      CHECK(packs->packables[i].place != HAPI_NO_PLACE);
      a -= asked;
      b -= made;
      size_rows += fabs(asked) + fabs(made);
    }
  }
  CHECK_NEAR(size, size_rows, 1e-9 * size_rows);
  CHECK_NEAR(a, 0.0, 1e-12 * size_rows);
  CHECK_NEAR(b, 0.0, 1e-12 * size_rows);
}

/* Impulses of another load, of which two sweeps make little: what is left of them. */
TEST(what_packs_leave_undone_adds_no_energy)
{
  int shortened = 0;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    double least[2];
    for (int packed = 0; packed < 2; ++packed) {
      problem *p = packed ? &one : &two;
      problem_make(p, seed, 0.5, 2);
      problem_link(p, packed ? hapi_pack_work_best() : NULL);
      for (uint32_t i = 0; i < p->solver.row_count; ++i) {
        p->rows[i].impulse *= 1e5;
      }
      rows_ready(p, hapi_contact_ready, hapi_row_ready);
      double apart;
      problem_run(p);
      p->solver.packs.ahead = packed; /* the rows have them as well, for what is measured here */
      CHECK(packed == (p->solver.packs.count > 0));
      bool gives = energy_beyond(p, &apart) > 0.0 && p->solver.residual > HAPI_UNSOLVED;
      hapi_solver_calm(&p->solver);
      if (packed) {
        hapi_packs_store(&p->solver.packs, p->rows);
      }
      double energy = energy_beyond(p, &apart);
      CHECK_SAY(energy <= 1e-9, "seed %d, packed %d: %g J", (int)seed, packed, energy);
      CHECK_SAY(apart <= 1e-9, "seed %d, packed %d: %g", (int)seed, packed, apart);
      CHECK(!p->solver.packs.in_use);
      (void)rows_miss(p); /* checks the bounds */
      least[packed] = energy;
      shortened += gives && packed;
    }
    CHECK_SAY(least[1] < 0.8 * least[0], "seed %d: %g and %g J", (int)seed, least[1], least[0]);
  }
  CHECK_SAY(shortened >= 6, "%d", shortened);
}

/* Without friction there is one answer: rows one by one find it, too. */
TEST(rows_one_by_one_end_there_too)
{
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    for (int packed = 0; packed < 2; ++packed) {
      problem *p = packed ? &one : &two;
      problem_make(p, seed, 0.0, 20000);
      problem_link(p, packed ? hapi_pack_work_best() : NULL);
      rows_ready(p, hapi_contact_ready, hapi_row_ready);
      problem_run(p);
    }
    CHECK(one.solver.packs.count > 0 && two.solver.packs.count == 0);
    for (uint32_t i = 0; i < BODIES; ++i) {
      for (int k = 0; k < 6; ++k) {
        CHECK_NEAR(one.v[i][k], two.v[i][k], 1e-9);
      }
    }
  }
}

/* Pairs that share no body: the order of the pairs is of no account, and rows one by one go the
 * same way from sweep to sweep. Of some there are more contacts than one pack has. */
TEST(packs_go_the_way_of_rows_one_by_one)
{
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    for (int packed = 0; packed < 2; ++packed) {
      problem *p = packed ? &one : &two;
      uint32_t count = 0;
      problem_make(p, seed, 0.4, 3 + (uint32_t)seed);
      for (uint32_t pair = 0; pair < 16; ++pair) {
        double frame[3][3];
        random_frame(frame);
        for (uint32_t i = 0; i < 1 + pair % 7; ++i) {
          uint32_t b = pair % 3 == 0 ? 0 : 20 + pair;
          if (pair % 5 == 4) { /* each has its own directions */
            random_frame(frame);
          }
          contact_fill(&p->rows[count], 1 + pair + (pair >= 8), b, frame, 0.4);
          p->rows[count + 1].normal = p->rows[count + 2].normal = (int32_t)count;
          count += 3;
        }
      }
      p->solver.row_count = count;
      problem_link(p, packed ? hapi_pack_work_best() : NULL);
      rows_ready(p, hapi_contact_ready, hapi_row_ready);
      problem_run(p);
    }
    CHECK(one.solver.packs.count > 0 && one.solver.packs.loose_rows == 0);
    CHECK(two.solver.packs.count == 0 && one.solver.sweeps == two.solver.sweeps);
    CHECK_NEAR(one.solver.residual, two.solver.residual, 1e-12);
    for (uint32_t i = 0; i < BODIES; ++i) {
      for (int k = 0; k < 6; ++k) {
        CHECK_NEAR(one.v[i][k], two.v[i][k], 1e-12);
      }
    }
  }
}

/* No impulse goes from one body to another one and comes out different. */
TEST(momentum_is_handed_on)
{
  double before[3] = {0.0};
  double after[3] = {0.0};
  problem_make(&one, 3, 0.5, 12);
  for (uint32_t i = 0; i < one.solver.row_count; ++i) { /* nothing is held */
    one.rows[i].target = one.rows[i].single ? -100.0 : 0.0;
    one.rows[i].impulse = 0.0;
    one.rows[i].lo = one.rows[i].normal < 0 ? 0.0 : one.rows[i].lo;
  }
  problem_link(&one, hapi_pack_work_best());
  rows_ready(&one, hapi_contact_ready, hapi_row_ready);
  problem_run(&one);
  CHECK(one.solver.packs.count > 0);
  for (uint32_t i = 1; i < BODIES; ++i) {
    for (int k = 0; k < 3 && mass[i] > 0.0; ++k) {
      before[k] += one.free_v[i][k] / mass[i];
      after[k] += one.v[i][k] / mass[i];
    }
  }
  for (uint32_t i = 0; i < one.solver.row_count; ++i) { /* what 9 got, which does not move */
    const hapi_row *row = &one.rows[i];
    for (int k = 0; k < 3 && (row->a == 9 || row->b == 9); ++k) {
      after[k] += row->impulse * (row->a == 9 ? row->ja[k] : row->jb[k]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    CHECK_NEAR(after[k], before[k], 1e-12);
  }
}

static void same_bits(void)
{
  CHECK(one.solver.packs.count > 0 && one.solver.packs.count == two.solver.packs.count);
  CHECK(one.solver.sweeps == two.solver.sweeps && one.solver.sweeps > 2);
  CHECK(memcmp(one.v, two.v, sizeof one.v) == 0);
  CHECK(memcmp(&one.solver.residual, &two.solver.residual, sizeof(double)) == 0);
  CHECK(memcmp(&one.solver.swept.energy2, &two.solver.swept.energy2, sizeof(double)) == 0);
  for (uint32_t i = 0; i < one.solver.row_count; ++i) {
    CHECK(memcmp(&one.rows[i].impulse, &two.rows[i].impulse, sizeof(double)) == 0);
  }
}

TEST(pairs_and_plain_c_have_the_same_bits)
{
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    for (int plain = 0; plain < 2; ++plain) {
      problem_make(&one, seed, 0.4, 40);
      problem_make(&two, seed, 0.4, 40);
      one.solver.direct_rows = two.solver.direct_rows = seed % 2 == 0 ? ROWS : 0;
      problem_link(&one, hapi_pack_work_best());
      problem_link(&two, plain ? &plain_hapi_pack_work_pairs : &hapi_pack_work_pairs);
      rows_ready(&one, hapi_contact_ready, hapi_row_ready);
      rows_ready(&two, plain ? plain_hapi_contact_ready : hapi_contact_ready,
                 plain ? plain_hapi_row_ready : hapi_row_ready);
      problem_run(&one);
      problem_run_by(&two, plain ? plain_hapi_solver_run : hapi_solver_run);
      same_bits();
    }
  }
}

/* ---- rounds of direct solves ---- */

/* The rows that the island sees one by one, in their order: all of use, or those in no pack. */
static void island_list(problem *p, hapi_island *is, bool packed)
{
  static bool in_pack[ROWS];
  memset(in_pack, 0, sizeof in_pack);
  for (uint32_t i = 0; packed && i < p->solver.packs.packable_count; ++i) {
    const hapi_packable *packable = &p->solver.packs.packables[i];
    for (uint32_t k = 0; packable->place != HAPI_NO_PLACE && k < 3; ++k) {
      in_pack[packable->row + k] = true;
    }
  }
  is->first = HAPI_NO_SOLVER_ROW;
  for (uint32_t i = p->solver.row_count; i-- > 0;) {
    if (p->rows[i].inverse != 0.0 && !in_pack[i]) {
      p->rows[i].next = is->first;
      is->first = i;
    }
  }
}

/* sticking: as the second direct solve of a run begins. */
static void round_begin(problem *p, hapi_island *is, bool packed, bool sticking)
{
  REQUIRE(hapi_packs_begin(&p->solver.packs, p->rows, p->solver.row_count, BODIES));
  p->solver.packs.work->push(&p->solver.packs, p->v);
  p->solver.packs.in_use = true;
  hapi_island_begin(is, &p->solver);
  is->softening = 1e-2; /* so large that the equations are well behaved */
  island_list(p, is, packed);
  REQUIRE(!packed || hapi_packed_begin(is));
  REQUIRE(hapi_island_inspect(is, sticking) > 0.01);
  REQUIRE(hapi_island_gather(is) && hapi_island_plan(is) > 0 && hapi_island_place(is));
  hapi_island_save(is);
}

/* Impulses in their rows, whoever has worked on them. */
static double impulse_of(problem *p, bool packed, uint32_t row)
{
  if (packed) {
    hapi_packs_store(&p->solver.packs, p->rows);
  }
  return p->rows[row].impulse;
}

static hapi_island by_packs;
static hapi_island by_rows;

static void rounds_compare(const char *after)
{
  double most = 0.0;
  for (uint32_t i = 0; i < one.solver.row_count; ++i) {
    most = fmax(most, fabs(impulse_of(&one, true, i) - impulse_of(&two, false, i)));
  }
  CHECK_SAY(most < 1e-11, "%s: impulses %g N s apart", after, most);
  most = 0.0;
  for (uint32_t i = 0; i < BODIES; ++i) {
    for (int k = 0; k < 6; ++k) {
      most = fmax(most, fabs(one.v[i][k] - two.v[i][k]));
    }
  }
  CHECK_SAY(most < 1e-9, "%s: %g m/s apart", after, most);
}

static double looks_compare(bool sticking, const char *after)
{
  double due = hapi_island_inspect(&by_packs, sticking);
  CHECK_NEAR(due, hapi_island_inspect(&by_rows, sticking), 1e-9);
  CHECK_SAY(by_packs.free_rows == by_rows.free_rows, "%s: %u and %u are free", after,
            by_packs.free_rows, by_rows.free_rows);
  CHECK(by_packs.look.changed == by_rows.look.changed);
  CHECK(by_packs.look.outside == by_rows.look.outside);
  CHECK(by_packs.look.settled == by_rows.look.settled);
  return due;
}

static void rounds_make(uint64_t seed, bool sticking)
{
  const double mu = seed % 3 == 0 ? 0.0 : 0.3;
  problem_make(&one, seed, mu, 40);
  problem_make(&two, seed, mu, 40);
  for (uint32_t i = 0; i < one.solver.row_count; ++i) { /* some slide, some are too large */
    one.rows[i].impulse = two.rows[i].impulse = 2e-3 * random_next(&state);
    one.rows[i].hi = two.rows[i].hi =
        seed % 2 == 0 && one.rows[i].normal >= 0 && one.rows[i].normal % 2 == 0 ? 1e-3
                                                                                : one.rows[i].hi;
  }
  problem_link(&one, hapi_pack_work_best());
  problem_link(&two, hapi_pack_work_best());
  one.solver.coarse = two.solver.coarse = (hapi_coarse){1e-3, 1.0, 1.0};
  rows_ready(&one, hapi_contact_ready, hapi_row_ready);
  rows_ready(&two, hapi_contact_ready, hapi_row_ready);
  round_begin(&one, &by_packs, true, sticking);
  round_begin(&two, &by_rows, false, sticking);
  CHECK(one.solver.packs.count > 8 && by_packs.count == by_rows.count);
}

TEST(a_round_in_packs_is_that_of_rows)
{
  uint32_t stay = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const bool sticking = seed % 4 == 0;
    hapi_island *const both[2] = {&by_packs, &by_rows};
    rounds_make(seed, sticking);
    (void)looks_compare(sticking, "at first");
    for (int round = 0; round < 12; ++round) {
      for (int i = 0; i < 2; ++i) {
        hapi_island_gains(both[i]);
        hapi_island_bound(both[i]);
        hapi_island_solve(both[i]);
      }
      rounds_compare("round");
      (void)looks_compare(false, "round");
      stay += !by_rows.look.changed;
      hapi_island_save(&by_packs);
      hapi_island_save(&by_rows);
    }
    for (int i = 0; i < 2 && !by_rows.look.changed; ++i) { /* of the same set */
      hapi_island_solve_again(both[i]);
    }
    rounds_compare("again");
    hapi_island_cut(&by_packs);
    hapi_island_cut(&by_rows);
    rounds_compare("cut");
    hapi_island_restore(&by_packs);
    hapi_island_restore(&by_rows);
    rounds_compare("restored");
  }
  CHECK_SAY(stay > 4 && stay < 90, "the set has stayed in %u rounds", stay);
  one.v[5][2] = NAN;
  CHECK(isnan(hapi_island_inspect(&by_packs, false)));
}

enum {
  ALL_GO_ON,
  SOME_GO_ON,
  ALL_ARE_MADE
};

/* Of a contact, whether its rows are made anew. */
static bool is_made(uint32_t first, int what)
{
  return what == ALL_ARE_MADE || (what == SOME_GO_ON && first % 4 == 0);
}

static void next_tick(problem *p, int what)
{
  uint32_t count = p->solver.row_count;
  memcpy(p->v, p->free_v, sizeof p->v);
  hapi_solver_clear(&p->solver);
  p->solver.row_count = count;
  for (uint32_t i = 0; i < count;) {
    bool triple = i + 1 < p->solver.row_count && p->rows[i + 1].normal == (int32_t)i;
    p->rows[i].target += 1e-3 * (i % 5);
    if (!triple) {
      hapi_row_ready(&p->solver, i);
    } else if (is_made(i, what)) {
      hapi_contact_ready(&p->solver, i, 3, true);
    } else {
      hapi_contact_again(&p->solver, i, 3);
    }
    i += triple ? 3 : 1;
  }
}

#define DRIVEN 3u /* body */

/* Rows by which it moves others, and is moved by none. */
static void partner_is_driven(problem *p)
{
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    if (p->rows[i].b == DRIVEN) {
      memset(p->rows[i].bb, 0, sizeof p->rows[i].bb);
    }
  }
}

/* Some rows, or none, are made anew in each tick, others go on. */
TEST(what_is_kept_is_what_would_be_made)
{
  for (int turn = 0; turn < 4; ++turn) {
    int what = turn % 2 == 0 ? ALL_GO_ON : SOME_GO_ON;
    problem_make(&one, 5, 0.4, 10);
    problem_make(&two, 5, 0.4, 10);
    problem_link(&one, hapi_pack_work_best());
    problem_link(&two, hapi_pack_work_best());
    if (turn >= 2) {
      partner_is_driven(&one);
      partner_is_driven(&two);
    }
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    rows_ready(&two, hapi_contact_ready, hapi_row_ready);
    for (int tick = 0; tick < 5; ++tick) {
      hapi_packs_forget(&two.solver.packs);
      problem_run(&one);
      problem_run(&two);
      same_bits();
      one.free_v[DRIVEN][tick % 3] = two.free_v[DRIVEN][tick % 3] = 0.01 * tick;
      next_tick(&one, what);
      next_tick(&two, what);
    }
  }
}

/* N s, of all rows, wherever they are. */
static void impulses_get(const problem *p, double out[])
{
  const hapi_packs *packs = &p->solver.packs;
  for (uint32_t i = 0; i < p->solver.row_count; ++i) {
    out[i] = p->rows[i].impulse;
  }
  for (uint32_t i = 0; packs->ahead && i < packs->packable_count; ++i) {
    uint32_t row = packs->packables[i].row;
    hapi_impulses from = hapi_packs_impulses(packs, i, &p->rows[row]);
    for (size_t k = 0; k < 3; ++k) {
      out[row + k] = from.of[k * from.step];
    }
  }
}

/* The first contact goes, and those after it move up; the rows that moved are told their impulses.
 */
static void rows_move_up(problem *p, const double impulses[])
{
  uint32_t count = p->solver.row_count -= 3;
  memmove(p->rows, p->rows + 3, count * sizeof *p->rows);
  for (uint32_t i = 0; i < count; ++i) {
    p->rows[i].normal -= p->rows[i].normal < 0 ? 0 : 3;
    p->rows[i].impulse = impulses[3 + i];
  }
  hapi_contact_moved(&p->solver);
}

enum {
  NOTHING_CHANGES,
  SOME_ARE_MADE,
  ONE_RUN_WITHOUT_PACKS,
  ROWS_MOVE_UP,
  LAST_CONTACT_GOES,
  PACKS_CHANGE_COUNT
};

/* One leaves the impulses of many runs in its packs, whatever comes between them; the other one has
 * them in its rows after each. */
TEST(impulses_that_stay_in_packs_are_not_lost)
{
  static double in_packs[ROWS];
  static double in_rows[ROWS];
  for (int change = NOTHING_CHANGES; change < PACKS_CHANGE_COUNT; ++change) {
    problem_make(&one, 6, 0.4, 10);
    problem_make(&two, 6, 0.4, 10);
    problem_link(&one, hapi_pack_work_best());
    problem_link(&two, hapi_pack_work_best());
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    rows_ready(&two, hapi_contact_ready, hapi_row_ready);
    for (int tick = 0; tick < 6; ++tick) {
      hapi_solver_run(&one.solver);
      problem_run(&two);
      CHECK(one.solver.packs.ahead == (one.solver.packs.count > 0) && !two.solver.packs.ahead);
      CHECK(memcmp(one.v, two.v, sizeof one.v) == 0);
      impulses_get(&one, in_packs);
      impulses_get(&two, in_rows);
      CHECK(memcmp(in_packs, in_rows, one.solver.row_count * sizeof in_rows[0]) == 0);
      for (int i = 0; i < 2; ++i) {
        problem *p = i == 0 ? &one : &two;
        bool apart = change == ONE_RUN_WITHOUT_PACKS && tick == 2;
        p->solver.packs.contact_capacity = PACKS;
        p->solver.packs.body_capacity = apart ? 1 : BODIES;
        if (change == ROWS_MOVE_UP && tick % 2 == 0) {
          rows_move_up(p, i == 0 ? in_packs : in_rows);
        }
        p->solver.row_count -= change == LAST_CONTACT_GOES && tick == 3 ? OTHERS : 0;
        for (uint32_t k = 0; change == SOME_ARE_MADE && k < p->solver.row_count; ++k) {
          hapi_row *row = &p->rows[k];
          uint32_t first = row->normal < 0 ? k : (uint32_t)row->normal;
          row->impulse = is_made(first, SOME_GO_ON) ? in_rows[k] : row->impulse;
        }
        next_tick(p, change == SOME_ARE_MADE ? SOME_GO_ON : ALL_GO_ON);
      }
    }
  }
}

static void rows_become_others(problem *p, uint32_t first)
{
  for (uint32_t i = first; i < p->solver.row_count; ++i) {
    p->rows[i].normal = -1;
    p->rows[i].lo = -1.0;
    p->rows[i].hi = 1.0;
  }
}

static uint32_t last_contact(const problem *p)
{
  uint32_t i = p->solver.row_count - 3;
  while (p->rows[i + 1].normal != (int32_t)i || p->rows[i + 2].normal != (int32_t)i) {
    --i;
  }
  return i;
}

/* One that goes while the others stay where they are; without and with other rows in its place. */
TEST(a_contact_that_goes_is_in_no_pack)
{
  for (int others = 0; others < 2; ++others) {
    problem_make(&one, 8, 0.4, 10);
    problem_make(&two, 8, 0.4, 10);
    problem_link(&one, hapi_pack_work_best());
    problem_link(&two, hapi_pack_work_best());
    for (int i = 0; i < 2; ++i) {
      problem *p = i == 0 ? &one : &two;
      rows_ready(p, hapi_contact_ready, hapi_row_ready);
      problem_run(p);
      next_tick(p, ALL_GO_ON);
      problem_run(p);
      uint32_t last = last_contact(p);
      p->solver.row_count = others ? last + 3 : last;
      rows_become_others(p, last);
      next_tick(p, ALL_GO_ON);
    }
    hapi_packs_forget(&two.solver.packs);
    problem_run(&one);
    problem_run(&two);
    same_bits();
  }
}

static void row_turn_round(hapi_row *row)
{
  for (int k = 0; k < 6; ++k) {
    row->ja[k] = -row->ja[k];
    row->ba[k] = -row->ba[k];
    row->jb[k] = -row->jb[k];
    row->bb[k] = -row->bb[k];
  }
}

/* A contact that changes its bodies, is another kind of row, goes, or no longer has the directions
 * of its neighbour. */
TEST(packs_that_no_longer_hold_are_made_anew)
{
  for (int change = 0; change < 4; ++change) {
    problem_make(&one, 7, 0.4, 10);
    problem_make(&two, 7, 0.4, 10);
    problem_link(&one, hapi_pack_work_best());
    problem_link(&two, hapi_pack_work_best());
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    problem_run(&one);
    memcpy(two.rows, one.rows, sizeof one.rows);
    two.solver.packs.known.made = one.solver.packs.known.made;
    for (int i = 0; i < 2; ++i) {
      problem *p = i == 0 ? &one : &two;
      for (uint32_t k = 0; k < 3; ++k) {
        p->rows[k].a = change == 0 ? 30 : p->rows[k].a;
        p->rows[k].softness = change == 1 ? NAN : p->rows[k].softness;
      }
      p->solver.row_count -= change == 2 ? 3 : 0;
      if (change == 3) { /* a friction of the second contact of the second pair */
        row_turn_round(&p->rows[8]);
      }
      next_tick(p, ALL_ARE_MADE);
      problem_run(p);
    }
    same_bits();
  }
}

/* What finds no room in the packs is swept one by one. */
TEST(without_room_rows_stay_loose)
{
  for (uint32_t room = 0; room < 40; room += 13) {
    problem_make(&one, 9, 0.3, 20000);
    problem_link(&one, hapi_pack_work_best());
    one.solver.packs.contact_capacity = room;
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    problem_run(&one);
    CHECK(one.solver.packs.contact_count <= room);
    CHECK((one.solver.packs.count > 0) == (room > 0));
    CHECK_SAY(rows_miss(&one) < 1e-10, "%g", rows_miss(&one));
  }
}

TEST(what_is_no_number_shows)
{
  problem_make(&one, 11, 0.3, 10);
  problem_link(&one, hapi_pack_work_best());
  one.v[5][2] = one.free_v[5][2] = NAN;
  rows_ready(&one, hapi_contact_ready, hapi_row_ready);
  problem_run(&one);
  CHECK(one.solver.residual == HUGE_VAL);
}

/* Where a load has to go through many bodies, rows keep their order. */
TEST(a_high_stack_is_in_no_pack)
{
  for (uint32_t height = 8; height <= 9; ++height) {
    double frame[3][3];
    problem_make(&one, 13, 0.3, 10);
    random_frame(frame);
    for (uint32_t i = 0; i < 2 * height; ++i) {
      uint32_t level = i % height;
      mass[9] = 1.0;
      random_body(9);
      memcpy(one.inverse_inertia[9], turns[9], sizeof turns[9]);
      contact_fill(&one.rows[3 * i], 1 + level, level, frame, 0.3);
      one.rows[3 * i + 1].normal = one.rows[3 * i + 2].normal = (int32_t)(3 * i);
    }
    one.solver.row_count = 6 * height;
    problem_link(&one, hapi_pack_work_best());
    one.solver.packs.contact_capacity = PACKS;
    rows_ready(&one, hapi_contact_ready, hapi_row_ready);
    problem_run(&one);
    CHECK((one.solver.packs.count > 0) == (height == 8));
  }
}
