/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Poses of string devices from the lengths of their strings, twists from their rates. */

#include "tests/tap.h"

#include "base/vec.h"
#include "bench/spidar_truth.h"
#include "plugins/spidar/rates.h"

#define DEGREES 57.295779513082321

static bool is_unit_and_finite(const hap_pose *pose)
{
  const double *q = pose->quat_wxyz;
  double size = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return hapi_finite(pose->position, 3) && fabs(size - 1.0) < 1e-9;
}

static void lengths_of(const hapi_spidar_model *m, const double *counts, double *out)
{
  for (int i = 0; i < m->strings; ++i) {
    out[i] = counts[i] * m->metres_per_count[i] + m->offset[i];
  }
}

/* ---- forward ---- */

TEST(lengths_are_distances)
{
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    hap_pose pose;
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    hapi_spidar_home(&pose);
    hapi_spidar_lengths(m, &pose, lengths);
    for (int i = 0; i < m->strings; ++i) {
      double way[3];
      hapi_v3_sub(m->motor[i], m->grip[i], way);
      CHECK_NEAR(lengths[i], hapi_v3_norm(way), 1e-15);
    }
  }
  /* A quarter turn about y takes the grip's (22.5, 0, 0) to (0, 0, -22.5). */
  const hapi_spidar_model *x4 = hapi_spidar_model_find("x4r");
  hap_pose turned = {{0.01, 0.0, 0.0}, {sqrt(0.5), 0.0, sqrt(0.5), 0.0}};
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_lengths(x4, &turned, lengths);
  CHECK_NEAR(lengths[1], sqrt(0.059 * 0.059 + 0.095 * 0.095 + 0.0915 * 0.0915), 1e-12);
}

/* The rows are what the lengths do when the grip moves. */
TEST(rows_are_derivatives_of_the_lengths)
{
  const double h = 1e-6;
  uint64_t seed = 5;
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    for (int n = 0; n < 50; ++n) {
      hap_pose pose;
      hapi_spidar_rows rows;
      spidar_random_pose(m, 1.0, &seed, &pose);
      hapi_spidar_rows_at(m, &pose, &rows);
      for (int axis = 0; axis < m->dof; ++axis) {
        double length[2][HAPI_SPIDAR_STRINGS_MAX];
        for (int side = 0; side < 2; ++side) {
          hap_pose moved = pose;
          double by = side == 0 ? -h : h;
          if (axis < 3) {
            moved.position[axis] += by;
          } else {
            double turn[4] = {1.0, 0.0, 0.0, 0.0};
            turn[axis - 2] = 0.5 * by;
            hapi_quat_multiply(turn, pose.quat_wxyz, moved.quat_wxyz);
            hapi_quat_normalize(moved.quat_wxyz);
          }
          hapi_spidar_lengths(m, &moved, length[side]);
        }
        for (int i = 0; i < m->strings; ++i) {
          double row = axis < 3 ? rows.unit[i][axis] : rows.moment[i][axis - 3];
          CHECK_NEAR(-(length[1][i] - length[0][i]) / (2.0 * h), row, 1e-8);
        }
      }
    }
  }
}

/* ---- back ---- */

/* In motion at 1 m/s and 5 rad/s one call a tick finds the pose of least squares to 1/50 of a
 * count, and the true one within what rounding does. */
TEST(one_call_a_tick_follows_fast_motion)
{
  uint64_t seed = 2;
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    double count = fabs(m->metres_per_count[0]);
    for (int n = 0; n < 20; ++n) {
      spidar_motion motion;
      hapi_spidar_solver solver;
      hap_pose truth;
      spidar_motion_init(&motion, m, 1.0, 5.0, &seed);
      spidar_motion_at(&motion, 0.0, &truth);
      hapi_spidar_solver_init(&solver, m, &truth);
      for (int tick = 1; tick <= 100; ++tick) {
        double counts[HAPI_SPIDAR_STRINGS_MAX];
        double lengths[HAPI_SPIDAR_STRINGS_MAX];
        double bound[2];
        spidar_motion_at(&motion, tick * SPIDAR_TICK_S, &truth);
        spidar_counts(m, &truth, counts);
        lengths_of(m, counts, lengths);
        CHECK(hapi_spidar_solve(&solver, m, lengths) == HAPI_SPIDAR_FIT_GOOD);
        CHECK(!solver.outside);
        hapi_spidar_solver fully = solver;
        for (int i = 0; i < 4; ++i) {
          (void)hapi_spidar_solve(&fully, m, lengths);
        }
        CHECK(spidar_distance(&solver.pose, &fully.pose) < 0.02 * count);
        CHECK(spidar_turn_between(&solver.pose, &fully.pose) < 0.02 * count / 0.02);
        spidar_rounding_bound(m, &truth, &bound[0], &bound[1]);
        CHECK(spidar_distance(&solver.pose, &truth) < 1.02 * bound[0] + 1e-6);
        CHECK(spidar_turn_between(&solver.pose, &truth) < 1.02 * bound[1] + 2e-5);
      }
    }
  }
}

/* Lengths that are not rounded have no such excuse: 0.05 mm and 0.1 degrees are met by far. */
TEST(exact_lengths_give_the_pose)
{
  uint64_t seed = 9;
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    for (int n = 0; n < 300; ++n) {
      hap_pose truth;
      double lengths[HAPI_SPIDAR_STRINGS_MAX];
      hapi_spidar_solver solver;
      int calls = 0;
      hapi_spidar_fit fit = HAPI_SPIDAR_FIT_MOVING;
      spidar_random_pose(m, 1.0, &seed, &truth);
      hapi_spidar_lengths(m, &truth, lengths);
      hapi_spidar_solver_init(&solver, m, NULL);
      for (; calls < 5 && fit == HAPI_SPIDAR_FIT_MOVING; ++calls) {
        fit = hapi_spidar_solve(&solver, m, lengths);
      }
      CHECK(fit == HAPI_SPIDAR_FIT_GOOD);
      CHECK(spidar_distance(&solver.pose, &truth) < 1e-6);
      CHECK(spidar_turn_between(&solver.pose, &truth) < 5e-5);
    }
  }
}

/* The makers' case: 15 mm and 0.3 rad away. One call comes within a count. */
TEST(a_jump_is_found_within_one_call)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  hap_pose truth = {{0.015, 0.0, 0.0}, {cos(0.15), 0.0, sin(0.15), 0.0}};
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_solver solver;
  hapi_spidar_lengths(m, &truth, lengths);
  hapi_spidar_solver_init(&solver, m, NULL);
  (void)hapi_spidar_solve(&solver, m, lengths);
  CHECK(spidar_distance(&solver.pose, &truth) < 3e-5);
  CHECK(spidar_turn_between(&solver.pose, &truth) < 1e-3);
}

TEST(the_workspace_ends_where_it_says)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  const double past[2] = {0.99, 1.02};
  for (int k = 0; k < 2; ++k) {
    double half = 0.5 * past[k] * m->workspace_turn;
    const hap_pose poses[2] = {{{past[k] * m->workspace[0], 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}},
                               {{0.0, 0.0, 0.0}, {-cos(half), 0.0, 0.0, -sin(half)}}};
    for (int n = 0; n < 2; ++n) {
      double lengths[HAPI_SPIDAR_STRINGS_MAX];
      hapi_spidar_solver solver;
      hapi_spidar_solver_init(&solver, m, &poses[n]);
      hapi_spidar_lengths(m, &poses[n], lengths);
      CHECK(hapi_spidar_solve(&solver, m, lengths) == HAPI_SPIDAR_FIT_GOOD);
      CHECK(solver.outside == (k == 1));
    }
  }
}

/* ---- attacks ---- */

static double cost_of(const hapi_spidar_model *m, const hap_pose *pose, const double *lengths)
{
  double here[HAPI_SPIDAR_STRINGS_MAX];
  double sum = 0.0;
  hapi_spidar_lengths(m, pose, here);
  for (int i = 0; i < m->strings; ++i) {
    sum += (here[i] - lengths[i]) * (here[i] - lengths[i]);
  }
  return sum;
}

/* Lengths that no grip has: nothing runs away, nothing gets worse, the bounds hold. */
TEST(nonsense_does_not_diverge)
{
  uint64_t seed = 21;
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    hapi_spidar_solver solver;
    hapi_spidar_solver_init(&solver, m, NULL);
    for (int n = 0; n < 3000; ++n) {
      double lengths[HAPI_SPIDAR_STRINGS_MAX];
      double size = pow(10.0, 2.4 * spidar_random(&seed));
      for (int i = 0; i < m->strings; ++i) {
        lengths[i] = 0.1 + size * spidar_random(&seed);
      }
      hap_pose before = solver.pose;
      double cost = cost_of(m, &before, lengths);
      hapi_spidar_fit fit = hapi_spidar_solve(&solver, m, lengths);
      CHECK(is_unit_and_finite(&solver.pose));
      CHECK(fit != HAPI_SPIDAR_FIT_GOOD || solver.residual <= m->residual);
      CHECK(cost_of(m, &solver.pose, lengths) <= cost);
      CHECK(spidar_distance(&solver.pose, &before) <= 6.0 * 0.01 + 1e-9);
      hap_pose none = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
      CHECK(spidar_turn_between(&solver.pose, &none) <= m->workspace_turn + 40.01 / DEGREES);
    }
    /* and comes back from wherever that led */
    hap_pose centre = {{m->centre[0], m->centre[1], m->centre[2]}, {1.0, 0.0, 0.0, 0.0}};
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    hapi_spidar_lengths(m, &centre, lengths);
    hapi_spidar_fit fit = HAPI_SPIDAR_FIT_MOVING;
    for (int n = 0; n < 20 && fit == HAPI_SPIDAR_FIT_MOVING; ++n) {
      fit = hapi_spidar_solve(&solver, m, lengths);
    }
    CHECK(fit == HAPI_SPIDAR_FIT_GOOD);
    CHECK(spidar_distance(&solver.pose, &centre) < 1e-5);
  }
}

TEST(lengths_that_are_not_finite_change_nothing)
{
  const double bad[] = {NAN, INFINITY, -INFINITY, 1e30};
  const hapi_spidar_model *m = hapi_spidar_model_find("x5r");
  hap_pose pose = {{0.01, 0.02, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_lengths(m, &pose, lengths);
  for (int i = 0; i < m->strings; ++i) {
    for (int k = 0; k < 4; ++k) {
      hapi_spidar_solver solver;
      hapi_spidar_solver_init(&solver, m, NULL);
      hapi_spidar_solver before = solver;
      double given[HAPI_SPIDAR_STRINGS_MAX];
      memcpy(given, lengths, sizeof given);
      given[i] = bad[k];
      CHECK(hapi_spidar_solve(&solver, m, given) == HAPI_SPIDAR_FIT_INVALID);
      CHECK(memcmp(&solver, &before, sizeof solver) == 0);
      hapi_spidar_diagnosis diagnosis;
      hapi_spidar_diagnose(m, &pose, given, &diagnosis);
      CHECK(k == 3 || diagnosis.suspects == 0);
    }
  }
  /* what a model of 3 dof does not use may be anything */
  const hapi_spidar_model *four = hapi_spidar_model_find("x3r4");
  hapi_spidar_solver solver;
  hapi_spidar_solver_init(&solver, four, NULL);
  hapi_spidar_lengths(four, &solver.pose, lengths);
  lengths[5] = NAN;
  CHECK(hapi_spidar_solve(&solver, four, lengths) == HAPI_SPIDAR_FIT_GOOD);
}

/* ---- a string that is wrong ---- */

/* Follows the motion while one string gets longer (slack) or is wound in (broken) by 0.2 m/s.
 * Returns the first tick at which the fit is poor, and the diagnosis there. */
static int follow_fault(const hapi_spidar_model *m, int string, double speed, uint64_t *seed,
                        hapi_spidar_diagnosis *out)
{
  spidar_motion motion;
  hapi_spidar_solver solver;
  hap_pose good;
  spidar_motion_init(&motion, m, 0.1, 0.5, seed);
  spidar_motion_at(&motion, 0.0, &good);
  hapi_spidar_solver_init(&solver, m, &good);
  for (int tick = 0; tick < 500; ++tick) {
    hap_pose truth;
    double counts[HAPI_SPIDAR_STRINGS_MAX];
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    spidar_motion_at(&motion, tick * SPIDAR_TICK_S, &truth);
    spidar_counts(m, &truth, counts);
    lengths_of(m, counts, lengths);
    lengths[string] += speed * tick * SPIDAR_TICK_S;
    if (hapi_spidar_solve(&solver, m, lengths) == HAPI_SPIDAR_FIT_POOR) {
      hapi_spidar_diagnose(m, &good, lengths, out);
      return tick;
    }
    good = solver.pose;
  }
  return -1;
}

TEST(a_wrong_string_is_noticed_and_named)
{
  uint64_t seed = 33;
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    int named = 0;
    int among = 0;
    int tries = 0;
    double latest = 0.0;
    double sum = 0.0;
    for (int string = 0; string < m->strings; ++string) {
      for (int n = 0; n < 10; ++n, ++tries) {
        double speed = n % 2 == 0 ? 0.2 : -0.2;
        hapi_spidar_diagnosis diagnosis = {0, {0.0}};
        int tick = follow_fault(m, string, speed, &seed, &diagnosis);
        CHECK(tick > 0);
        latest = fmax(latest, fabs(speed) * tick * SPIDAR_TICK_S);
        bool it = (diagnosis.suspects >> string & 1u) != 0;
        among += it;
        bool alone = diagnosis.suspects == 1u << string;
        named += alone;
        /* slack is longer, broken shorter; how much, roughly */
        CHECK(!alone || diagnosis.error[string] * speed > 0.0);
        sum += alone ? fabs(diagnosis.error[string] / (speed * tick * SPIDAR_TICK_S)) : 0.0;
      }
    }
    printf("# %s: of %d faults %d among the suspects, %d named alone, noticed within %.1f mm\n",
           m->name, tries, among, named, 1e3 * latest);
    CHECK(100 * among >= 97 * tries);
    CHECK(m->strings == 8 ? named >= tries / 2 : named == 0);
    CHECK(named == 0 || (sum / named > 0.9 && sum / named < 1.1));
    CHECK(latest < 0.06);
  }
}

/* ---- twist ---- */

TEST(rates_of_the_lengths_give_the_twist)
{
  uint64_t seed = 12;
  for (size_t k = 0; hapi_spidar_model_at(k) != NULL; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    for (int n = 0; n < 100; ++n) {
      hap_pose pose;
      hapi_spidar_rows rows;
      double rates[HAPI_SPIDAR_STRINGS_MAX];
      double linear[3];
      double angular[3] = {0.0, 0.0, 0.0};
      hap_twist twist;
      spidar_random_pose(m, 1.0, &seed, &pose);
      for (int axis = 0; axis < 3; ++axis) {
        linear[axis] = spidar_random(&seed);
        angular[axis] = m->dof == 6 ? 5.0 * spidar_random(&seed) : 0.0;
      }
      hapi_spidar_rows_at(m, &pose, &rows);
      for (int i = 0; i < m->strings; ++i) {
        rates[i] = -hapi_v3_dot(rows.unit[i], linear) - hapi_v3_dot(rows.moment[i], angular);
      }
      hapi_spidar_twist(m, &pose, rates, &twist);
      for (int axis = 0; axis < 3; ++axis) {
        CHECK_NEAR(twist.linear[axis], linear[axis], 1e-8);
        CHECK_NEAR(twist.angular[axis], angular[axis], 1e-6);
      }
      rates[n % m->strings] = NAN;
      hapi_spidar_twist(m, &pose, rates, &twist);
      CHECK(twist.linear[0] == 0.0 && twist.angular[2] == 0.0);
    }
  }
}

TEST(rates_of_a_straight_line_are_its_slope)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  hapi_spidar_rates rates;
  double out[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_rates_reset(&rates);
  for (int tick = 0; tick < 200; ++tick) {
    double counts[HAPI_SPIDAR_STRINGS_MAX];
    for (int i = 0; i < m->strings; ++i) {
      counts[i] = rint(1e6 + (i - 3) * 0.37 * tick); /* 370 counts a second and its multiples */
    }
    hapi_spidar_rates_update(&rates, m, tick * (int64_t)1000000, counts, out);
    for (int i = 0; i < m->strings && tick >= HAPI_SPIDAR_RATES_SAMPLES; ++i) {
      /* a count over 31 ms, at worst */
      CHECK_NEAR(out[i] / m->metres_per_count[i], (i - 3) * 370.0, 33.0);
    }
    CHECK(tick > 0 || out[0] == 0.0);
  }
}

/* Nothing of an earlier motion is left after a pause of counts, a jump, a time that goes back,
 * and NaN. */
TEST(rates_forget)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  hapi_spidar_rates rates;
  double counts[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double out[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_rates_reset(&rates);
  int64_t now = 0;
  for (int tick = 0; tick < 100; ++tick, now += 1000000) {
    counts[0] = tick < 50 ? 10.0 * tick : 490.0;
    hapi_spidar_rates_update(&rates, m, now, counts, out);
  }
  CHECK_NEAR(out[0], 0.0, 1e-12);
  counts[0] = NAN;
  hapi_spidar_rates_update(&rates, m, now, counts, out);
  CHECK(out[0] == 0.0 && rates.count == 0);
  counts[0] = 1e6;
  hapi_spidar_rates_update(&rates, m, now, counts, out);
  CHECK(out[0] == 0.0);
  counts[0] = 1e6 + 10.0;
  hapi_spidar_rates_update(&rates, m, now, counts, out); /* the same time: takes its place */
  CHECK(out[0] == 0.0 && rates.count == 1);
  hapi_spidar_rates_update(&rates, m, now - 5000000, counts, out);
  CHECK(out[0] == 0.0 && rates.count == 1);
}
