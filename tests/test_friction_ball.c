/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Frictions of the solver that are one vector: on random bodies under random pointers the
 * impulses are within the ball, the error is none inside of it, and at its border it is along
 * the force. */

#include "tests/tap.h"

#include <stdint.h>

#include "solver/contact_solver.h"

#define BODIES 6 /* the ground, some free ones, and one that stands for a proxy */
#define ROWS 64
#define WORK (HAPI_SOLVER_WORK(ROWS, BODIES))

static struct {
  hapi_row rows[ROWS];
  double v[BODIES][6];
  double free_v[BODIES][6];
  double work[WORK];
  double mass[BODIES];
  uint32_t count;
  uint64_t random;
} s;

/* 0 .. 1 */
static double random_uniform(void)
{
  s.random = s.random * 6364136223846793005u + 1442695040888963407u;
  return (double)(s.random >> 11) / 9007199254740992.0;
}

static double random_within(double most)
{
  return most * (2.0 * random_uniform() - 1.0);
}

static double from_to(double low, double high)
{
  return low * pow(high / low, random_uniform());
}

/* Along a direction at an arm from the first body, less the second one's linear motion. */
static hapi_row *add_row(uint32_t a, uint32_t b, const double n[3], const double arm[3])
{
  hapi_row *row = &s.rows[s.count++];
  memset(row, 0, sizeof *row);
  memcpy(row->ja, n, 3 * sizeof *n);
  row->ja[3] = arm[1] * n[2] - arm[2] * n[1];
  row->ja[4] = arm[2] * n[0] - arm[0] * n[2];
  row->ja[5] = arm[0] * n[1] - arm[1] * n[0];
  for (int i = 0; i < 3; ++i) {
    row->jb[i] = -n[i];
    row->ba[i] = row->ja[i] / s.mass[a];
    row->ba[3 + i] = row->ja[3 + i] / (s.mass[a] * 4e-4);
    row->bb[i] = s.mass[b] > 0.0 ? row->jb[i] / s.mass[b] : 0.0;
  }
  row->hi = HUGE_VAL;
  row->normal = -1;
  row->a = a;
  row->b = b;
  return row;
}

static const double axes[3][3] = {{0.0, 0.0, -1.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};

/* Pushes the body down; the frictions pull at it, the third one turns it. */
static uint32_t add_pointer(uint32_t body, uint32_t pointer, double mu, int ball)
{
  double arm[3] = {random_within(0.02), random_within(0.02), 0.025};
  uint32_t first = s.count;
  double softness = from_to(1e-2, 1e3);
  for (int i = 0; i <= ball; ++i) {
    hapi_row *row = add_row(body, pointer, axes[i % 3], arm);
    row->softness = softness;
    row->target = i == 0 ? from_to(0.01, 1.0) : random_within(0.1);
    if (i == 3) { /* about the normal, at 6 mm */
      memset(row->ja, 0, sizeof row->ja);
      memset(row->ba, 0, sizeof row->ba);
      memset(row->jb, 0, sizeof row->jb);
      memset(row->bb, 0, sizeof row->bb);
      row->ja[5] = 0.006;
      row->ba[5] = 0.006 / (s.mass[body] * 4e-4);
    }
    if (i > 0) {
      row->normal = (int32_t)first;
      row->mu = mu;
      row->hi = 0.0;
      row->ball = i == 1 ? (uint8_t)ball : 0;
      row->round = (uint8_t)(i - 1);
    }
  }
  return first;
}

/* Four corners on the ground, with the pyramid. */
static void add_ground(uint32_t body)
{
  static const double up[3] = {0.0, 0.0, 1.0};
  for (int corner = 0; corner < 4; ++corner) {
    double arm[3] = {corner % 2 != 0 ? 0.025 : -0.025, corner / 2 != 0 ? 0.025 : -0.025, -0.025};
    int32_t normal = (int32_t)s.count;
    (void)add_row(body, 0, up, arm);
    for (int i = 1; i < 3; ++i) {
      hapi_row *row = add_row(body, 0, axes[i], arm);
      row->normal = normal;
      row->mu = 0.4;
      row->hi = 0.0;
    }
  }
}

static void check_ball(const hapi_solver *solver, uint32_t normal, int ball, int *slides)
{
  const hapi_row *f = &s.rows[normal + 1];
  double radius = f->mu * fmax(s.rows[normal].impulse, 0.0);
  double error[3] = {0.0};
  double force = 0.0;
  double along = 0.0;
  double across = 0.0;
  for (int i = 0; i < ball; ++i) {
    error[i] = hapi_row_error(solver, &f[i]);
    force += f[i].impulse * f[i].impulse;
    along += error[i] * f[i].impulse;
  }
  force = sqrt(force);
  CHECK(force <= radius * (1.0 + 1e-9));
  if (radius == 0.0) {
    return;
  }
  const double left = solver->tolerance * f->inverse; /* N s, that may be left */
  bool free = force < radius * (1.0 - 1e-6) - left;
  along = free ? 0.0 : along / force;
  for (int i = 0; i < ball; ++i) {
    double rest = error[i] - (free ? 0.0 : along * f[i].impulse / force);
    across += rest * rest;
  }
  CHECK(sqrt(across) < 1e-6); /* m/s */
  CHECK(along > -1e-6);
  *slides += !free;
}

/* Pushed and free ones by turns; returns how many frictions a ball has. */
static int bodies_make(int turn, uint32_t balls[BODIES])
{
  bool proxy = turn % 2 != 0;
  int ball = 2 + turn % 3 / 2;
  memset(s.v, 0, sizeof s.v);
  s.count = 0;
  s.mass[0] = 0.0;
  s.mass[BODIES - 1] = proxy ? from_to(1e-3, 1.0) : 0.0;
  for (uint32_t i = 1; i < BODIES - 1; ++i) {
    s.mass[i] = from_to(1e-2, 1.0);
    s.v[i][2] = -9.81e-3;
    s.v[i][0] = random_within(0.1);
    s.v[i][5] = random_within(1.0);
  }
  for (uint32_t i = 1; i < BODIES - 1; ++i) {
    balls[i] = add_pointer(i, BODIES - 1, 0.6 * random_uniform(), ball);
    if (i % 2 == 0) {
      add_ground(i);
    }
  }
  return ball;
}

static hapi_solver bodies_solve(void)
{
  memcpy(s.free_v, s.v, sizeof s.v);
  hapi_solver solver = {.rows = s.rows,
                        .v = s.v,
                        .free = s.free_v,
                        .row_count = s.count,
                        .body_count = BODIES,
                        .hub_count = s.mass[BODIES - 1] > 0.0 ? 1 : 0,
                        .tolerance = 1e-9,
                        .update_budget = 1000000,
                        .direct_rows = 100,
                        .work = s.work,
                        .work_count = WORK};
  hapi_solver_run(&solver);
  return solver;
}

TEST(balls_hold_what_they_say)
{
  int slides = 0;
  int pushes = 0;
  int solved = 0;
  s.random = 5;
  for (int turn = 0; turn < 2000; ++turn) {
    uint32_t balls[BODIES];
    int ball = bodies_make(turn, balls);
    hapi_solver solver = bodies_solve();
    solved += solver.residual < 1e-9;
    for (uint32_t i = 1; i < BODIES - 1 && solver.residual < 1e-9; ++i) {
      check_ball(&solver, balls[i], ball, &slides);
      pushes += s.rows[balls[i]].impulse > 0.0;
    }
  }
  printf("# %d solved, %d push, %d of them slide\n", solved, pushes, slides);
  CHECK(solved > 1940); /* with the pyramid as many: friction from above and below may jam */
  CHECK(pushes > 4000 && slides > 1000 && pushes - slides > 300);
}

/* m/s and rad/s, by which velocities are not what the impulses make. */
static double velocities_off(void)
{
  double off = 0.0;
  for (uint32_t i = 0; i < s.count; ++i) {
    const hapi_row *row = &s.rows[i];
    for (int k = 0; k < 6; ++k) {
      s.free_v[row->a][k] += row->ba[k] * row->impulse;
      s.free_v[row->b][k] += row->bb[k] * row->impulse;
    }
  }
  for (uint32_t i = 0; i < BODIES; ++i) {
    for (int k = 0; k < 6; ++k) {
      off = fmax(off, fabs(s.free_v[i][k] - s.v[i][k]));
    }
  }
  return off;
}

/* Along one of its rows a body on rails does not answer: the normal, or a friction. */
TEST(rows_that_a_body_does_not_answer_stay_with_their_contact)
{
  double most = 0.0;
  uint32_t direct = 0;
  s.random = 6;
  for (int turn = 0; turn < 2000; ++turn) {
    uint32_t balls[BODIES];
    int ball = bodies_make(turn, balls);
    for (uint32_t i = 1; i < BODIES - 1; ++i) {
      hapi_row *row = &s.rows[balls[i] + (uint32_t)(turn / 6) % (uint32_t)(ball + 1)];
      memset(row->ja, 0, sizeof row->ja);
      memset(row->ba, 0, sizeof row->ba);
    }
    direct += bodies_solve().direct_solves;
    most = fmax(most, velocities_off());
  }
  printf("# %u direct solves, velocities off by %.2g at most\n", direct, most);
  CHECK(direct > 1000);
  CHECK(most < 1e-6); /* without such rows 1e-9 */
}
