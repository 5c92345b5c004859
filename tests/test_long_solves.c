/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A solve that takes long leaves the rest to the next ticks: a row of ten cubes that is pushed
 * along the floor. */

#include "tests/tap.h"

#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/contact_world.h"

#define CUBES 10
#define MASS 0.1
#define EDGE 0.05
#define RADIUS 0.01
#define MU 0.5
#define SPEED 0.05
#define SETTLES 300
#define TICKS 1500
#define SLIDES 500 /* ticks, after which all cubes slide */

typedef struct figures {
  double median; /* row updates of a tick */
  double p99;
  double force; /* N, mean while all slide */
  uint64_t unsolved;
  int bounded; /* ticks whose last solve was to leave something */
  double kept; /* of all rows */
} figures;

static int order_numbers(const void *a, const void *b)
{
  double x = *(const double *)a;
  double y = *(const double *)b;
  return (x > y) - (x < y);
}

static figures row_push(double accuracy, double speed)
{
  static double work[TICKS];
  figures out = {0};
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < CUBES; ++i) {
    cw_add_cube(w, MASS, EDGE, (EDGE - 1e-3) * i, 0.0, 0.5 * EDGE);
  }
  w->def.physics_hz = 60.0;
  w->def.accuracy = accuracy;
  w->hand_def.radius = RADIUS;
  w->hand_velocity[0] = speed;
  cw_start(w, -0.5 * EDGE - RADIUS, 0.0, 0.5 * EDGE);
  const hapi_rows *rows = &w->session->haptic->tick.rows;
  for (int i = 0; i < SETTLES + TICKS; ++i) {
    cw_tick(w);
    if (i >= SETTLES) {
      uint32_t made = rows->solver.row_count - rows->kept;
      work[i - SETTLES] = (double)rows->work.done - (double)HAPI_ROW_MAKING * made -
                          (double)HAPI_ROW_KEEPING * rows->kept;
      out.kept += (double)rows->kept / rows->solver.row_count / TICKS;
      out.bounded += rows->solver.enough > 0;
    }
    if (i >= SETTLES + SLIDES) {
      out.force -= w->force[0] / (TICKS - SLIDES);
    }
  }
  out.unsolved = cw_stats(w).room.unsolved_ticks;
  qsort(work, TICKS, sizeof work[0], order_numbers);
  out.median = work[TICKS / 2];
  out.p99 = work[TICKS - TICKS / 100];
  printf("# accuracy %g: %g row updates, p99 %g, %.4f N, %d bounded, %.3f of rows kept\n", accuracy,
         out.median, out.p99, out.force, out.bounded, out.kept);
  return out;
}

/* What slides is felt: mu m g of all. */
TEST(a_long_solve_goes_on_in_the_next_tick)
{
  figures f = row_push(0.5, SPEED);
  CHECK(f.bounded > TICKS / 2 && f.unsolved == 0);
  CHECK(f.p99 < 10000.0); /* without a bound 31000 */
  CHECK_NEAR(f.force, MU * CUBES * MASS * CW_GRAVITY, 0.005 * MU * CUBES * MASS * CW_GRAVITY);
}

TEST(nothing_is_left_where_all_is_asked_for)
{
  figures f = row_push(1.0, SPEED);
  CHECK(f.bounded == 0 && f.unsolved == 0);
}

/* Rows go on while their bodies do not turn, however fast the hand is, as all cubes go together. */
TEST(rows_that_go_on_count_as_kept)
{
  CHECK(row_push(0.5, 0.01).kept > 0.95);
  CHECK(row_push(0.5, SPEED).kept > 0.95);
  CHECK(row_push(0.5, 10.0 * SPEED).kept > 0.95);
}
