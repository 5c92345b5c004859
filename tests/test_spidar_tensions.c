/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Tensions of string devices: the exact solution of their box-constrained problem, wrenches
 * reached, steadiness, and the heat of the motors. Argument: long, for 1e5 problems against all
 * active sets. */

#include "tests/tap.h"

#include "base/vec.h"
#include "bench/spidar_truth.h"
#include "plugins/spidar/tensions.h"

#define MODELS 7

static const hapi_spidar_model *model_at(size_t index)
{
  return hapi_spidar_model_at(index % (MODELS + 1)); /* NULL in turn: a problem of no model */
}

static hap_pose centre_of(const hapi_spidar_model *m)
{
  return (hap_pose){{m->centre[0], m->centre[1], m->centre[2]}, {1.0, 0.0, 0.0, 0.0}};
}

/* ---- the problem ---- */

/* A closed form: with a diagonal matrix each variable is by itself. */
TEST(variables_without_bonds_are_clipped)
{
  hapi_spidar_box_qp qp = {.n = 8};
  hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX] = {HAPI_SPIDAR_AT_FREE};
  double x[HAPI_SPIDAR_ORDER_MAX];
  for (int i = 0; i < 8; ++i) {
    qp.h[i][i] = 2.0 + i;
    qp.g[i] = (2.0 + i) * (i - 3.0);
    qp.low[i] = -1.0;
    qp.high[i] = 2.0;
  }
  CHECK(hapi_spidar_box_qp_solve(&qp, at, x) >= 0);
  for (int i = 0; i < 8; ++i) {
    CHECK_NEAR(x[i], fmax(-1.0, fmin(2.0, i - 3.0)), 1e-14);
  }
}

/* What each variable could still gain in its box is a bound of the distance to the minimum. */
TEST(solutions_are_minima)
{
  uint64_t seed = 1;
  double worst = 0.0;
  int most = 0;
  for (size_t n = 0; n < 100000; ++n) {
    hapi_spidar_box_qp qp;
    hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX];
    double x[HAPI_SPIDAR_ORDER_MAX];
    spidar_random_qp(model_at(n), &seed, &qp);
    for (int i = 0; i < HAPI_SPIDAR_ORDER_MAX; ++i) {
      at[i] = (hapi_spidar_at)((int)(n >> i & 3u) % 3 - 1); /* any beginning is good */
    }
    int sets = hapi_spidar_box_qp_solve(&qp, at, x);
    CHECK(sets >= 0);
    most = sets > most ? sets : most;
    worst = fmax(worst, spidar_gap(&qp, x) / (1.0 + fabs(spidar_cost(&qp, x))));
    for (int i = 0; i < qp.n; ++i) {
      CHECK(x[i] >= qp.low[i] && x[i] <= qp.high[i]);
    }
  }
  printf("# above the minimum by at most %.2g of it, %d sets at most\n", worst, most);
  CHECK(worst <= 1e-9);
  CHECK(most < 40);
}

TEST(solutions_are_those_of_all_active_sets)
{
  uint64_t seed = 77;
  double worst = 0.0;
  size_t count = strcmp(tap_argument, "long") == 0 ? 100000 : 400;
  for (size_t n = 0; n < count; ++n) {
    hapi_spidar_box_qp qp;
    hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX] = {HAPI_SPIDAR_AT_LOW};
    double x[HAPI_SPIDAR_ORDER_MAX];
    double brute[HAPI_SPIDAR_ORDER_MAX];
    spidar_random_qp(model_at(n), &seed, &qp);
    CHECK(hapi_spidar_box_qp_solve(&qp, at, x) >= 0);
    bool found = spidar_brute_force(&qp, brute);
    CHECK(found);
    for (int i = 0; i < qp.n && found; ++i) {
      worst = fmax(worst, fabs(x[i] - brute[i]) / (1.0 + fabs(brute[i])));
    }
    CHECK(!found || fabs(spidar_cost(&qp, x) - spidar_cost(&qp, brute)) <=
                        1e-9 * (1.0 + fabs(spidar_cost(&qp, brute))));
  }
  printf("# %zu problems, off by at most %.2g\n", count, worst);
  CHECK(worst <= 1e-7); /* where the cost is flat to 1e-9 */
}

/* Not convex, not finite: an answer within the box, and an end. */
TEST(bad_matrices_are_survived)
{
  static const double bad[] = {-1.0, 0.0, NAN, INFINITY};
  for (int k = 0; k < 4; ++k) {
    for (int n = 0; n < 4; ++n) {
      hapi_spidar_box_qp qp = {.n = 2, .h = {{1.0}, {0.5, 1.0}}, .high = {1.0, 1.0}};
      hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX] = {HAPI_SPIDAR_AT_FREE};
      double x[HAPI_SPIDAR_ORDER_MAX];
      double *target = n < 3 ? &qp.h[n > 0][n > 1] : &qp.g[0];
      *target = bad[k];
      (void)hapi_spidar_box_qp_solve(&qp, at, x);
      CHECK(x[0] >= 0.0 && x[0] <= 1.0 && x[1] >= 0.0 && x[1] <= 1.0);
    }
  }
}

/* ---- wrenches ---- */

static void random_direction(uint64_t *seed, double out[3])
{
  double v[3] = {0.0, 0.0, 0.0};
  double size = 0.0;
  while (size < 0.1 || size > 1.0) {
    for (int i = 0; i < 3; ++i) {
      v[i] = spidar_random(seed);
    }
    size = hapi_v3_norm(v);
  }
  hapi_v3_scale(1.0 / size, v, out);
}

/* At the centre of the workspace, that is home for all but one: 0.97 of 1 N and 0.975 of 0.02 N
 * m at least. */
TEST(small_wrenches_are_reached)
{
  uint64_t seed = 4;
  for (size_t k = 0; k < MODELS; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    hap_pose pose = centre_of(m);
    hapi_spidar_tensions state;
    double least[2] = {1.0, 1.0};
    hapi_spidar_tensions_init(&state, m);
    for (int n = 0; n < 4000; ++n) {
      bool torque = n % 2 != 0 && m->dof == 6;
      double direction[3];
      double tension[HAPI_SPIDAR_STRINGS_MAX];
      hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
      hap_wrench reached;
      hap_wrench again;
      double size = torque ? 0.02 : 1.0;
      random_direction(&seed, direction);
      hapi_v3_scale(size, direction, torque ? wanted.torque : wanted.force);
      CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached) == HAP_OK);
      double share = hapi_v3_dot(torque ? reached.torque : reached.force, direction) / size;
      least[torque] = fmin(least[torque], share);
      hapi_spidar_wrench(m, &pose, tension, &again);
      CHECK(memcmp(&again, &reached, sizeof again) == 0);
      for (int i = 0; i < m->strings; ++i) {
        CHECK(tension[i] >= m->min_tension && tension[i] <= m->max_tension);
      }
    }
    printf("# %s: %.4f of the force, %.4f of the torque\n", m->name, least[0], least[1]);
    CHECK(least[0] >= 0.97);
    CHECK(least[1] >= 0.975);
  }
}

/* The capability keeps its word in directions that were not tried for it. */
TEST(capability_is_reached_everywhere)
{
  uint64_t seed = 8;
  for (size_t k = 0; k < MODELS; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    double size[2];
    hap_pose pose = centre_of(m);
    hapi_spidar_capability(m, &size[0], &size[1]);
    printf("# %s: %.2f N, %.3f N m\n", m->name, size[0], size[1]);
    CHECK(size[0] > 1.0 && size[0] < 8.0 * m->max_tension);
    CHECK(m->dof == 6 ? size[1] > 0.02 : size[1] == 0.0);
    for (int n = 0; n < 1000; ++n) {
      bool torque = n % 2 != 0 && m->dof == 6;
      hapi_spidar_tensions state;
      double direction[3];
      double tension[HAPI_SPIDAR_STRINGS_MAX];
      hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
      hap_wrench reached;
      hapi_spidar_tensions_init(&state, m);
      for (int i = 0; i < m->strings; ++i) {
        state.most[i] = m->heat_tension;
      }
      random_direction(&seed, direction);
      hapi_v3_scale(size[torque], direction, torque ? wanted.torque : wanted.force);
      hap_status status = hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached);
      CHECK(status >= HAP_OK);
      CHECK(hapi_v3_dot(torque ? reached.torque : reached.force, direction) >= 0.85 * size[torque]);
    }
  }
}

TEST(too_much_is_said_to_be_too_much)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  hapi_spidar_tensions state;
  hap_pose pose = centre_of(m);
  hap_wrench wanted = {{1000.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench reached;
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_tensions_init(&state, m);
  CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached) == HAP_SATURATED);
  CHECK(reached.force[0] > 30.0 && reached.force[0] < 160.0);
  /* a limit of one string alone is kept */
  wanted.force[0] = 5.0;
  CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached) == HAP_OK);
  state.most[0] = 0.7 * tension[0];
  double before = tension[0];
  CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached) == HAP_SATURATED);
  CHECK(tension[0] <= 0.7 * before);
  CHECK(reached.force[0] > 4.0);
  state.most[0] = NAN; /* as no room at all */
  CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached) >= HAP_OK);
  CHECK(hapi_finite(tension, m->strings) && tension[0] == m->min_tension);
}

TEST(what_is_not_finite_gives_no_force)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  const double bad[] = {NAN, INFINITY, -INFINITY, 1e300};
  for (int k = 0; k < 4; ++k) {
    for (int where = 0; where < 13; ++where) {
      hapi_spidar_tensions state;
      hap_pose pose = centre_of(m);
      hap_wrench wanted = {{5.0, 0.0, 0.0}, {0.0, 0.1, 0.0}};
      hap_wrench reached;
      double tension[HAPI_SPIDAR_STRINGS_MAX];
      hapi_spidar_tensions_init(&state, m);
      CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, NULL) == HAP_OK);
      double before[HAPI_SPIDAR_STRINGS_MAX];
      memcpy(before, tension, sizeof before);
      double *target = where < 3   ? &wanted.force[where]
                       : where < 6 ? &wanted.torque[where - 3]
                       : where < 9 ? &pose.position[where - 6]
                                   : &pose.quat_wxyz[where - 9];
      *target = bad[k];
      CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, &reached) ==
            HAP_ERROR_ARGUMENT);
      CHECK(hapi_finite(tension, m->strings) && hapi_finite(reached.force, 3));
      CHECK(where < 6 ? hapi_v3_norm(reached.force) < 0.05
                      : memcmp(before, tension, sizeof before) == 0);
    }
  }
}

TEST(a_wrench_of_a_million_is_the_largest)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  for (int where = 0; where < 6; ++where) {
    hapi_spidar_tensions state;
    hap_pose pose = centre_of(m);
    hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    double tension[HAPI_SPIDAR_STRINGS_MAX];
    double *target = where < 3 ? &wanted.force[where] : &wanted.torque[where - 3];
    hapi_spidar_tensions_init(&state, m);
    *target = -0.99e6;
    CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, NULL) == HAP_SATURATED);
    *target = -1.01e6;
    CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, NULL) ==
          HAP_ERROR_ARGUMENT);
  }
}

/* ---- steadiness ---- */

/* The tensions are a continuous function: a small step of pose and wrench makes a small one of
 * theirs, whichever strings come to a bound. No rate limit here. */
TEST(tensions_do_not_jump)
{
  uint64_t seed = 6;
  for (size_t k = 0; k < MODELS; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    hapi_spidar_tensions state;
    double before[HAPI_SPIDAR_STRINGS_MAX];
    double steepest = 0.0;
    int changed = 0;
    hapi_spidar_tensions_init(&state, m);
    for (int run = 0; run < 20; ++run) {
      spidar_motion motion;
      double phase = 3.0 * spidar_random(&seed);
      spidar_motion_init(&motion, m, 0.1, 0.5, &seed);
      for (int n = 0; n < 2000; ++n) {
        double t = 1e-4 * n; /* ten steps a tick, to see jumps apart from slopes */
        double tension[HAPI_SPIDAR_STRINGS_MAX];
        hap_pose pose;
        hap_wrench wanted = {
            {8.0 * sin(30.0 * t + phase), 6.0 * cos(23.0 * t), 3.0 * sin(11.0 * t)},
            {0.0, 0.1 * sin(17.0 * t + phase), 0.05 * cos(29.0 * t)}};
        spidar_motion_at(&motion, t, &pose);
        CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, NULL) >= HAP_OK);
        CHECK(n == 0 || state.changes <= 8);
        changed += n > 0 && state.changes > 0;
        for (int i = 0; i < m->strings && n > 0; ++i) {
          steepest = fmax(steepest, fabs(tension[i] - before[i]));
        }
        memcpy(before, tension, sizeof before);
      }
    }
    printf("# %s: %d changes of the active set, at most %.3f N in 0.1 ms\n", m->name, changed,
           steepest);
    CHECK(changed > 100);
    CHECK(steepest < 0.4); /* of wanted forces that change by 0.03 N in that time */
  }
}

TEST(the_rate_is_kept)
{
  uint64_t seed = 14;
  for (size_t k = 0; k < MODELS; ++k) {
    const hapi_spidar_model *m = hapi_spidar_model_at(k);
    hapi_spidar_tensions state;
    double before[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    const double step = m->tension_rate * SPIDAR_TICK_S;
    hapi_spidar_tensions_init(&state, m);
    state.seconds = SPIDAR_TICK_S;
    for (int n = 0; n < 2000; ++n) {
      hap_pose pose;
      hap_wrench wanted;
      double tension[HAPI_SPIDAR_STRINGS_MAX];
      spidar_random_pose(m, 1.0, &seed, &pose);
      for (int axis = 0; axis < 3; ++axis) {
        wanted.force[axis] = 30.0 * spidar_random(&seed);
        wanted.torque[axis] = spidar_random(&seed);
      }
      CHECK(hapi_spidar_tensions_solve(&state, m, &pose, &wanted, tension, NULL) >= HAP_OK);
      CHECK(state.changes >= 0);
      for (int i = 0; i < m->strings; ++i) {
        CHECK(fabs(tension[i] - before[i]) <= step * (1.0 + 1e-9));
        CHECK(tension[i] <= m->max_tension && tension[i] >= 0.0);
        CHECK(n * step < m->min_tension || tension[i] >= m->min_tension);
      }
      memcpy(before, tension, sizeof before);
    }
  }
}

/* ---- heat ---- */

/* A motor that is asked for all it has: full for a while, then down to what it bears, smoothly,
 * never too hot. */
TEST(motors_do_not_get_too_hot)
{
  static const double steps[] = {0.001, 0.01, 0.1};
  for (size_t k = 0; k < MODELS; ++k) {
    for (int n = 0; n < 3; ++n) {
      hapi_spidar_model m = *hapi_spidar_model_at(k);
      m.heat_time = 5.0;
      /* with the longest steps one that bears little, which a step alone could make too hot */
      m.heat_tension = n == 2 ? 1.1 * m.min_tension : m.heat_tension;
      hapi_spidar_heat heat;
      double most[HAPI_SPIDAR_STRINGS_MAX];
      double tension[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
      double before = m.max_tension;
      double full_s = 0.0;
      double steepest = 0.0;
      hapi_spidar_heat_init(&heat, 0.0);
      for (double t = 0.0; t < 60.0; t += steps[n]) {
        hapi_spidar_heat_step(&heat, &m, tension, steps[n], most);
        for (int i = 0; i < m.strings; ++i) {
          CHECK(heat.share[i] <= 1.0 + 1e-9);
          CHECK(most[i] <= m.max_tension && most[i] >= m.heat_tension * (1.0 - 1e-9));
          tension[i] = most[i];
        }
        full_s += most[0] == m.max_tension ? steps[n] : 0.0;
        steepest = fmax(steepest, fabs(most[0] - before) / steps[n]);
        before = most[0];
      }
      CHECK_NEAR(most[0], m.heat_tension, 1e-3 * m.heat_tension);
      CHECK_NEAR(heat.share[0], 1.0, 1e-3);
      /* full up to share 0.8: -ln(1 - 0.8 / (max / heat)^2) time constants */
      double ratio = m.max_tension / m.heat_tension;
      CHECK_NEAR(full_s, -m.heat_time * log(1.0 - 0.8 / (ratio * ratio)), 0.03 * m.heat_time);
      CHECK(n > 0 || steepest < 40.0 * m.max_tension / m.heat_time);
      /* and cools down: to 1/e in a time constant */
      memset(tension, 0, sizeof tension);
      for (double t = 0.0; t < m.heat_time; t += steps[n]) {
        hapi_spidar_heat_step(&heat, &m, tension, steps[n], most);
      }
      CHECK_NEAR(heat.share[0], exp(-1.0), 0.02);
      CHECK(n == 2 || most[0] == m.max_tension);
    }
  }
}

/* The force fades without a kink where the motor is as hot as it may be. */
TEST(the_last_force_fades_slowly)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  const double none[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double most[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_heat heat;
  hapi_spidar_heat_init(&heat, 0.99);
  hapi_spidar_heat_step(&heat, m, none, 0.0, most);
  CHECK(most[0] > m->heat_tension && most[0] < 1.005 * m->heat_tension);
  hapi_spidar_heat_init(&heat, 0.9);
  hapi_spidar_heat_step(&heat, m, none, 0.0, most);
  CHECK_NEAR(most[0], sqrt(1.75) * m->heat_tension, 1e-9); /* a quarter of the power above */
}

TEST(heat_bears_bad_numbers)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  static const double seconds[] = {NAN, INFINITY, -1.0, 0.0, 1e9};
  hapi_spidar_heat heat;
  double most[HAPI_SPIDAR_STRINGS_MAX];
  double tension[HAPI_SPIDAR_STRINGS_MAX] = {1.0, NAN, INFINITY, 1e300, -1.0, 0.0, 0.0, 0.0};
  for (int k = 0; k < 5; ++k) {
    hapi_spidar_heat_init(&heat, k == 0 ? NAN : 0.5);
    for (int n = 0; n < 3; ++n) {
      hapi_spidar_heat_step(&heat, m, tension, seconds[k], most);
      for (int i = 0; i < m->strings; ++i) {
        CHECK(heat.share[i] >= 0.0);
        CHECK(most[i] >= m->heat_tension * 0.999 && most[i] <= m->max_tension);
      }
    }
    CHECK(heat.share[5] <= (k == 0 ? 1.0 : 0.5) + 1e-12);
  }
  /* a NaN counts as the most there is, not as nothing */
  hapi_spidar_heat_init(&heat, 0.0);
  hapi_spidar_heat_step(&heat, m, tension, 10.0, most);
  CHECK(heat.share[1] > heat.share[0]);
  /* and what one tick of nonsense claims is forgotten like other heat */
  double none[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  hapi_spidar_heat_init(&heat, 0.0);
  hapi_spidar_heat_step(&heat, m, tension, 0.001, most);
  for (int n = 0; n < 20; ++n) {
    hapi_spidar_heat_step(&heat, m, none, m->heat_time, most);
  }
  for (int i = 0; i < m->strings; ++i) {
    CHECK(hapi_finite(&heat.share[i], 1) && heat.share[i] < 1e-3);
  }
}

/* From cold by one implicit step: share = s r^2 / (1 + s). A string that is hit may be far beyond
 * the tension of its motor; ten times as much is no tension of it. */
TEST(heat_counts_tensions_up_to_ten_times_the_greatest)
{
  const hapi_spidar_model *m = hapi_spidar_model_find("x4r");
  double tension[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double most[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_heat heat;
  const double step = 1e-4;
  const double ratio = m->max_tension / m->heat_tension;
  tension[0] = 9.9 * m->max_tension;
  tension[1] = 10.1 * m->max_tension;
  hapi_spidar_heat_init(&heat, 0.0);
  hapi_spidar_heat_step(&heat, m, tension, step * m->heat_time, most);
  CHECK_NEAR(heat.share[0], step * 9.9 * 9.9 * ratio * ratio / (1.0 + step), 1e-12);
  CHECK_NEAR(heat.share[1], step * ratio * ratio / (1.0 + step), 1e-12);
}
