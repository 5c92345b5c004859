/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The numerics of string devices, model by model: pose errors in motion, how fast poses are
 * found from home, what rounding can do, velocity, tensions against the exact solution, wrenches
 * reached at home, times. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/vec.h"
#include "bench/bench.h"
#include "bench/spidar_truth.h"
#include "plugins/spidar/rates.h"
#include "plugins/spidar/tensions.h"
#include "pointer/velocity.h"

#define SPEED 1.0      /* m/s */
#define TURN_SPEED 5.0 /* rad/s */
#define MOTION_TICKS 250
#define DEGREES 57.295779513082321
#define POSITION_GOAL 0.05 /* mm */
#define TURN_GOAL 0.1      /* degrees */
#define ASKED_FORCE 1.0
#define ASKED_TORQUE 0.02
#define MODELS_MAX 16
#define REPEATS 64 /* of a call within one time */

typedef struct figures {
  const hapi_spidar_model *model;
  double position_mm; /* largest errors in motion */
  double turn_deg;
  double position_rms_mm;
  double turn_rms_deg;
  double
      excess; /* m, largest distance from the pose of least squares of the same rounded lengths */
  double bound_mm; /* by rounding alone, the worst of the workspace */
  double bound_deg;
  int calls;               /* from home */
  int lost;                /* poses that were not found in 5 calls */
  double velocity_mm_s[3]; /* rms error: by rates, by the library's windows, by difference */
  double angular_rad_s[3];
  double solve_us; /* medians */
  double tensions_us;
  double jump_us;       /* tensions after a jump of everything */
  double qp_gap;        /* relative, largest */
  double qp_brute;      /* N, largest distance from the solution by trying all sets */
  int changes;          /* of the active set, largest, in motion */
  double force_reached; /* of 1 N, worst direction, at the centre of the workspace */
  double torque_reached;
  double force_n; /* capability */
  double torque_nm;
} figures;

typedef struct spidar_table {
  figures all[MODELS_MAX];
  size_t count;
} spidar_table;

/* ---- pose ---- */

/* Solves to the last digit, for the least squares' own answer. */
static void solve_fully(const hapi_spidar_model *model, const double *lengths, hap_pose *io)
{
  hapi_spidar_solver solver;
  hapi_spidar_solver_init(&solver, model, io);
  for (int i = 0; i < 4; ++i) {
    (void)hapi_spidar_solve(&solver, model, lengths);
  }
  *io = solver.pose;
}

static void lengths_of(const hapi_spidar_model *model, const double *counts, double *out)
{
  for (int i = 0; i < model->strings; ++i) {
    out[i] = counts[i] * model->metres_per_count[i] + model->offset[i];
  }
}

typedef struct sums {
  double position;
  double turn;
  double linear[3];
  double angular[3];
  double ticks;
} sums;

static double square_apart(const double *a, const double *b)
{
  double way[3];
  hapi_v3_sub(a, b, way);
  return hapi_v3_dot(way, way);
}

static void add_velocity(sums *s, int kind, const hap_twist *twist, const hap_twist *truth)
{
  s->linear[kind] += square_apart(twist->linear, truth->linear);
  s->angular[kind] += square_apart(twist->angular, truth->angular);
}

static void difference_of(const hap_pose *before, const hap_pose *now, hap_twist *out)
{
  double turn[4];
  double back[4] = {before->quat_wxyz[0], -before->quat_wxyz[1], -before->quat_wxyz[2],
                    -before->quat_wxyz[3]};
  hapi_v3_sub(now->position, before->position, out->linear);
  hapi_v3_scale(1.0 / SPIDAR_TICK_S, out->linear, out->linear);
  hapi_quat_multiply(now->quat_wxyz, back, turn);
  hapi_v3_scale(2.0 / SPIDAR_TICK_S, turn + 1, out->angular);
}

/* One call a tick, from the last tick's pose. */
static void motion_follow(const spidar_motion *motion, figures *f, sums *s)
{
  const hapi_spidar_model *model = f->model;
  hapi_spidar_solver solver;
  hapi_spidar_rates rates;
  hapi_velocity velocity;
  hap_pose truth;
  spidar_motion_at(motion, 0.0, &truth);
  hapi_spidar_solver_init(&solver, model, &truth);
  hapi_spidar_rates_reset(&rates);
  hapi_velocity_reset(&velocity, fabs(model->metres_per_count[0]));
  for (int tick = 1; tick <= MOTION_TICKS; ++tick) {
    double counts[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    double lengths[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    double rate[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
    hap_twist twist[3];
    hap_twist true_twist;
    hap_pose before = solver.pose;
    spidar_motion_at(motion, tick * SPIDAR_TICK_S, &truth);
    spidar_motion_twist(motion, tick * SPIDAR_TICK_S, &true_twist);
    spidar_counts(model, &truth, counts);
    lengths_of(model, counts, lengths);
    (void)hapi_spidar_solve(&solver, model, lengths);
    hap_pose best = solver.pose;
    solve_fully(model, lengths, &best);
    double position = spidar_distance(&solver.pose, &truth);
    double turn = spidar_turn_between(&solver.pose, &truth);
    f->position_mm = fmax(f->position_mm, 1e3 * position);
    f->turn_deg = fmax(f->turn_deg, DEGREES * turn);
    f->excess = fmax(f->excess, spidar_distance(&solver.pose, &best) +
                                    0.02 * spidar_turn_between(&solver.pose, &best));
    s->position += position * position;
    s->turn += turn * turn;
    s->ticks += 1.0;
    int64_t now_ns = tick * (int64_t)1000000;
    hapi_spidar_rates_update(&rates, model, now_ns, counts, rate);
    hapi_spidar_twist(model, &solver.pose, rate, &twist[0]);
    hapi_velocity_update(&velocity, now_ns, &solver.pose, 0.0, &twist[1]);
    difference_of(&before, &solver.pose, &twist[2]);
    for (int k = 0; k < 3 && tick > HAPI_SPIDAR_RATES_SAMPLES; ++k) {
      add_velocity(s, k, &twist[k], &true_twist);
    }
  }
}

static void measure_motion(const bench *b, figures *f)
{
  sums s;
  sums fast;
  uint64_t seed = 1;
  int motions = b->quick ? 40 : 400;
  memset(&s, 0, sizeof s);
  memset(&fast, 0, sizeof fast);
  for (int i = 0; i < motions; ++i) {
    spidar_motion motion;
    spidar_motion_init(&motion, f->model, SPEED, TURN_SPEED, &seed);
    motion_follow(&motion, f, &fast);
    spidar_motion_init(&motion, f->model, 0.05, 0.5, &seed); /* velocities: of a hand that works */
    motion_follow(&motion, f, &s);
  }
  f->position_rms_mm = 1e3 * sqrt(fast.position / fast.ticks);
  f->turn_rms_deg = DEGREES * sqrt(fast.turn / fast.ticks);
  double counted = s.ticks * (MOTION_TICKS - HAPI_SPIDAR_RATES_SAMPLES) / MOTION_TICKS;
  for (int k = 0; k < 3; ++k) {
    f->velocity_mm_s[k] = 1e3 * sqrt(s.linear[k] / counted);
    f->angular_rad_s[k] = sqrt(s.angular[k] / counted);
  }
}

/* Point number index of a grid over the workspace and its turns. */
static bool grid_pose(const hapi_spidar_model *model, int steps, int index, hap_pose *out)
{
  double axis[3] = {0.0, 0.0, 0.0};
  int turns = model->dof == 6 ? 27 : 1;
  int turn = index % turns;
  index /= turns;
  for (int i = 0; i < 3; ++i, index /= steps) {
    double share = 2.0 * (index % steps) / (steps - 1) - 1.0;
    out->position[i] = model->centre[i] + share * model->workspace[i];
    axis[i] = model->dof == 6 ? turn % 3 - 1 : 0.0;
    turn /= 3;
  }
  double size = hapi_v3_norm(axis);
  double half = size > 0.0 ? 0.5 * model->workspace_turn : 0.0;
  out->quat_wxyz[0] = cos(half);
  hapi_v3_scale(size > 0.0 ? sin(half) / size : 0.0, axis, out->quat_wxyz + 1);
  return index == 0;
}

static void measure_grid(const bench *b, figures *f)
{
  int steps = b->quick ? 3 : 7;
  hap_pose pose;
  for (int i = 0; grid_pose(f->model, steps, i, &pose); ++i) {
    hapi_spidar_solver solver;
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    double position = 0.0;
    double turn = 0.0;
    int calls = 0;
    hapi_spidar_fit fit = HAPI_SPIDAR_FIT_MOVING;
    hapi_spidar_lengths(f->model, &pose, lengths);
    hapi_spidar_solver_init(&solver, f->model, NULL);
    while (fit == HAPI_SPIDAR_FIT_MOVING && calls < 5) {
      fit = hapi_spidar_solve(&solver, f->model, lengths);
      ++calls;
    }
    bool found = fit == HAPI_SPIDAR_FIT_GOOD && spidar_distance(&solver.pose, &pose) < 1e-6 &&
                 spidar_turn_between(&solver.pose, &pose) < 5e-5;
    f->lost += !found;
    f->calls = calls > f->calls ? calls : f->calls;
    spidar_rounding_bound(f->model, &pose, &position, &turn);
    f->bound_mm = fmax(f->bound_mm, 1e3 * position);
    f->bound_deg = fmax(f->bound_deg, DEGREES * turn);
  }
}

/* ---- tensions ---- */

static void measure_qp(const bench *b, figures *f)
{
  uint64_t seed = 7;
  int count = b->quick ? 2000 : 20000;
  for (int i = 0; i < count; ++i) {
    hapi_spidar_box_qp qp;
    hapi_spidar_at at[HAPI_SPIDAR_ORDER_MAX] = {HAPI_SPIDAR_AT_FREE};
    double x[HAPI_SPIDAR_ORDER_MAX];
    double brute[HAPI_SPIDAR_ORDER_MAX];
    spidar_random_qp(f->model, &seed, &qp);
    bool solved = hapi_spidar_box_qp_solve(&qp, at, x) >= 0;
    double gap = spidar_gap(&qp, x) / (1.0 + fabs(spidar_cost(&qp, x)));
    f->qp_gap = solved ? fmax(f->qp_gap, gap) : HUGE_VAL;
    if (i % 20 == 0) {
      f->qp_brute = spidar_brute_force(&qp, brute) ? f->qp_brute : HUGE_VAL;
      for (int k = 0; k < qp.n; ++k) {
        f->qp_brute = fmax(f->qp_brute, fabs(x[k] - brute[k]));
      }
    }
  }
}

static double wrench_reach(const hapi_spidar_model *model, bool torque, uint64_t *seed)
{
  hapi_spidar_tensions state;
  hap_pose pose;
  hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench reached;
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  double *asked = torque ? wanted.torque : wanted.force;
  double size = 0.0;
  hapi_spidar_home(&pose);
  hapi_v3_copy(model->centre, pose.position);
  hapi_spidar_tensions_init(&state, model);
  while (size < 0.1) {
    for (int i = 0; i < 3; ++i) {
      asked[i] = spidar_random(seed);
    }
    size = hapi_v3_norm(asked);
  }
  double length = torque ? ASKED_TORQUE : ASKED_FORCE;
  hapi_v3_scale(length / size, asked, asked);
  if (hapi_spidar_tensions_solve(&state, model, &pose, &wanted, tension, &reached) < HAP_OK) {
    return 0.0;
  }
  return hapi_v3_dot(torque ? reached.torque : reached.force, asked) / (length * length);
}

static void measure_reach(figures *f)
{
  uint64_t seed = 3;
  f->force_reached = HUGE_VAL;
  f->torque_reached = f->model->dof == 6 ? HUGE_VAL : 0.0;
  for (int i = 0; i < 5000; ++i) {
    f->force_reached = fmin(f->force_reached, wrench_reach(f->model, false, &seed));
    if (f->model->dof == 6) {
      f->torque_reached = fmin(f->torque_reached, wrench_reach(f->model, true, &seed));
    }
  }
  hapi_spidar_capability(f->model, &f->force_n, &f->torque_nm);
}

/* ---- time ---- */

typedef struct timed {
  hap_pose pose[REPEATS];
  double lengths[REPEATS][HAPI_SPIDAR_STRINGS_MAX];
  hap_wrench wrench[REPEATS];
} timed;

static void timed_prepare(const hapi_spidar_model *model, bool jumps, uint64_t *seed, timed *out)
{
  spidar_motion motion;
  spidar_motion_init(&motion, model, SPEED, TURN_SPEED, seed);
  for (int i = 0; i < REPEATS; ++i) {
    double counts[HAPI_SPIDAR_STRINGS_MAX];
    double angle = 0.02 * i;
    spidar_motion_at(&motion, i * SPIDAR_TICK_S, &out->pose[i]);
    if (jumps) {
      spidar_random_pose(model, 1.0, seed, &out->pose[i]);
      angle = 100.0 * spidar_random(seed);
    }
    spidar_counts(model, &out->pose[i], counts);
    lengths_of(model, counts, out->lengths[i]);
    out->wrench[i] = (hap_wrench){{3.0 * cos(angle), 3.0 * sin(angle), sin(0.7 * angle)},
                                  {0.03 * sin(angle), 0.02 * cos(0.3 * angle), 0.0}};
  }
}

static double time_solves(const hapi_spidar_model *model, const timed *t)
{
  hapi_spidar_solver solver;
  hapi_spidar_solver_init(&solver, model, &t->pose[0]);
  int64_t begin = hapi_clock_now();
  for (int i = 0; i < REPEATS; ++i) {
    (void)hapi_spidar_solve(&solver, model, t->lengths[i]);
  }
  return 1e-3 * (double)(hapi_clock_now() - begin) / REPEATS;
}

static double time_tensions(const hapi_spidar_model *model, const timed *t, int *changes)
{
  hapi_spidar_tensions state;
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  hap_wrench reached;
  int most = 0;
  hapi_spidar_tensions_init(&state, model);
  hap_status status =
      hapi_spidar_tensions_solve(&state, model, &t->pose[0], &t->wrench[0], tension, &reached);
  int64_t begin = hapi_clock_now();
  for (int i = 1; i < REPEATS && status >= HAP_OK; ++i) {
    status =
        hapi_spidar_tensions_solve(&state, model, &t->pose[i], &t->wrench[i], tension, &reached);
    most = state.changes > most ? state.changes : most;
  }
  *changes = most > *changes ? most : *changes;
  return 1e-3 * (double)(hapi_clock_now() - begin) / (REPEATS - 1);
}

static void measure_time(const bench *b, figures *f)
{
  enum {
    ROUNDS_MAX = 400
  };
  static double times[3][ROUNDS_MAX];
  size_t rounds = b->quick ? 100 : ROUNDS_MAX;
  uint64_t seed = 11;
  int jumped = 0;
  for (size_t i = 0; i < rounds; ++i) {
    timed t;
    timed_prepare(f->model, false, &seed, &t);
    times[0][i] = time_solves(f->model, &t);
    times[1][i] = time_tensions(f->model, &t, &f->changes);
    timed_prepare(f->model, true, &seed, &t);
    times[2][i] = time_tensions(f->model, &t, &jumped);
  }
  f->solve_us = bench_median(times[0], rounds);
  f->tensions_us = bench_median(times[1], rounds);
  f->jump_us = bench_median(times[2], rounds);
}

/* ---- output ---- */

static void report_pose(bench *b, const figures *f)
{
  const char *name = f->model->name;
  bool turns = f->model->dof == 6;
  double position = fmax(POSITION_GOAL, f->bound_mm);
  double turn = fmax(TURN_GOAL, f->bound_deg);
  bench_check(b, f->position_mm <= position && f->turn_deg <= turn,
              "%s: pose at 1 m/s, 5 rad/s, one call a tick: off by at most %.4f mm, %.4f degrees "
              "(rms %.4f, %.4f); half a count a string explains up to %.4f mm, %.4f degrees",
              name, f->position_mm, turns ? f->turn_deg : 0.0, f->position_rms_mm,
              turns ? f->turn_rms_deg : 0.0, f->bound_mm, turns ? f->bound_deg : 0.0);
  bench_check(b, f->excess <= 0.02 * fabs(f->model->metres_per_count[0]),
              "%s: of which the solver's own is at most %.2g count", name,
              f->excess / fabs(f->model->metres_per_count[0]));
  bench_check(b, f->lost == 0 && f->calls <= 5,
              "%s: from home to the workspace's grid in at most %d calls, %d poses not found", name,
              f->calls, f->lost);
  bench_check(b, f->velocity_mm_s[0] < f->velocity_mm_s[2],
              "%s: velocity at 0.05 m/s, 0.5 rad/s off by %.2f mm/s, %.3f rad/s rms; the library's "
              "windows %.2f, %.3f; a difference %.2f, %.3f",
              name, f->velocity_mm_s[0], f->angular_rad_s[0], f->velocity_mm_s[1],
              f->angular_rad_s[1], f->velocity_mm_s[2], f->angular_rad_s[2]);
}

static void report_tensions(bench *b, const figures *f)
{
  const char *name = f->model->name;
  bool turns = f->model->dof == 6;
  bench_check(b, f->qp_gap <= 1e-9 && f->qp_brute <= 1e-7,
              "%s: tensions above the minimum by at most %.2g of it, off by %.2g N", name,
              f->qp_gap, f->qp_brute);
  bench_check(b, f->force_reached >= 0.97 && (!turns || f->torque_reached >= 0.975),
              "%s: of 1 N at the centre %.4f N are reached, of 0.02 N m %.5f N m (worst direction)",
              name, f->force_reached, ASKED_TORQUE * f->torque_reached);
  bench_check(b, f->changes <= 8, "%s: the active set changes at most %d times a tick in motion",
              name, f->changes);
  bench_say("%s: for long in every direction %.2f N, %.3f N m", name, f->force_n, f->torque_nm);
  bench_check(b, f->solve_us <= 2.0 && f->tensions_us <= 3.0,
              "%s: medians: pose %.2f us, tensions %.2f us, after a jump %.2f us", name,
              f->solve_us, f->tensions_us, f->jump_us);
}

static hap_status table_write(bench *b, const spidar_table *table)
{
  FILE *csv = bench_csv_open(
      b, "spidar",
      "model,strings,dof,position_mm,turn_deg,position_rms_mm,turn_rms_deg,bound_mm,bound_deg,"
      "excess_counts,calls,lost,velocity_mm_s,velocity_windows_mm_s,velocity_difference_mm_s,"
      "angular_rad_s,angular_windows_rad_s,angular_difference_rad_s,qp_gap,qp_brute_n,changes,"
      "force_reached,torque_reached,force_n,torque_nm,solve_us,tensions_us,jump_us");
  for (size_t i = 0; i < table->count && csv != NULL; ++i) {
    const figures *f = &table->all[i];
    fprintf(csv,
            "%s,%d,%d,%.5g,%.5g,%.5g,%.5g,%.5g,%.5g,%.3g,%d,%d,%.4g,%.4g,%.4g,%.4g,%.4g,%.4g,%.3g,"
            "%.3g,%d,%.5g,%.5g,%.4g,%.4g,%.3g,%.3g,%.3g\n",
            f->model->name, f->model->strings, f->model->dof, f->position_mm, f->turn_deg,
            f->position_rms_mm, f->turn_rms_deg, f->bound_mm,
            f->model->dof == 6 ? f->bound_deg : 0.0,
            f->excess / fabs(f->model->metres_per_count[0]), f->calls, f->lost, f->velocity_mm_s[0],
            f->velocity_mm_s[1], f->velocity_mm_s[2], f->angular_rad_s[0], f->angular_rad_s[1],
            f->angular_rad_s[2], f->qp_gap, f->qp_brute, f->changes, f->force_reached,
            f->torque_reached, f->force_n, f->torque_nm, f->solve_us, f->tensions_us, f->jump_us);
  }
  return bench_csv_close(b, csv, HAP_OK);
}

static void spidar_draw(FILE *script, const void *data)
{
  const spidar_table *table = data;
  const figures *f = table->all;
  fprintf(script, "$d << EOD\n");
  for (size_t i = 0; i < table->count; ++i) {
    fprintf(script, "%s %.6g %.6g %.6g %.6g\n", f[i].model->name, f[i].position_mm, f[i].bound_mm,
            f[i].turn_deg, f[i].model->dof == 6 ? f[i].bound_deg : 0.0);
  }
  fprintf(script,
          "EOD\nset multiplot layout 1,2 title 'Pose from rounded counts at 1 m/s, 5 rad/s'\n"
          "set style data histograms\nset style fill solid 0.6\nset yrange [0:*]\n"
          "set key top left font ',8'\nset ylabel 'largest error [mm]'\n"
          "plot $d using 2:xtic(1) title 'one call a tick', '' using 3 title 'rounding, worst'\n"
          "set ylabel 'largest error [degrees]'\n"
          "plot $d using 4:xtic(1) title 'one call a tick', '' using 5 title 'rounding, worst'\n"
          "unset multiplot\n");
}

hap_status bench_spidar(bench *b)
{
  static spidar_table table;
  memset(&table, 0, sizeof table);
  while (table.count < MODELS_MAX && hapi_spidar_model_at(table.count) != NULL) {
    figures *f = &table.all[table.count];
    f->model = hapi_spidar_model_at(table.count++);
    measure_motion(b, f);
    measure_grid(b, f);
    measure_qp(b, f);
    measure_reach(f);
    measure_time(b, f);
    report_pose(b, f);
    report_tensions(b, f);
  }
  hap_status status = table_write(b, &table);
  return status >= HAP_OK ? bench_draw(b, "spidar", 900, 420, spidar_draw, &table) : status;
}
