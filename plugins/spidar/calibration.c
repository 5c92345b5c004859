/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Variable projection. For given unknowns hapi_spidar_solve finds the poses; the residual of the
 * lengths is then a function of the unknowns alone. Its derivative is the one at held poses,
 * projected on what no motion of the grip explains. Golub, Pereyra, SIAM J. Numerical Analysis
 * 10(2), 1973; Kaufman, BIT 15, 1975. */

#include "plugins/spidar/calibration.h"

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"
#include "base/vec.h"
#include "plugins/spidar/eigen.h"
#include "plugins/spidar/matrix.h"

#define PER_STRING 5       /* unknowns at most: offset, scale, motor point */
#define SCALE_LENGTH 0.1   /* m: a change of scale counts as what it makes of this length */
#define TURN_LENGTH 0.02   /* m, as in kinematics.c */
#define ROUNDS 30          /* of the outer iteration */
#define CALLS 30           /* of the pose solver for a pose */
#define ARRIVED 1e-9       /* m */
#define TOLD 5e-4          /* m: a combination is told when its standard deviation is below */
#define COUNT_NOISE 0.2887 /* of a count, root mean square of rounding */
#define COUNT_MAX 1e9
#define ARM_LEAST 1e-3 /* m */

typedef struct problem {
  const hapi_spidar_sample *samples;
  size_t count;
  int per_string;
  unsigned find;
  double middle[HAPI_SPIDAR_STRINGS_MAX]; /* of the counts: offsets are held there */
  hapi_spidar_model model;                /* the newest */
  hap_pose *poses;                        /* of the samples */
} problem;

/* Sum of squares and normal equations of the unknowns. */
typedef struct equations {
  int n;
  double h[HAPI_SPIDAR_EIGEN_MAX][HAPI_SPIDAR_EIGEN_MAX];
  double g[HAPI_SPIDAR_EIGEN_MAX];
  double cost;
  double worst;
  size_t worst_sample;
  int worst_string;
} equations;

void hapi_spidar_measure(const hapi_spidar_model *model,
                         const double counts[HAPI_SPIDAR_STRINGS_MAX],
                         double out_lengths[HAPI_SPIDAR_STRINGS_MAX])
{
  for (int i = 0; i < model->strings; ++i) {
    out_lengths[i] = counts[i] * model->metres_per_count[i] + model->offset[i];
  }
}

void hapi_spidar_calibrate_at(hapi_spidar_model *model, const hap_pose *pose,
                              const double counts[HAPI_SPIDAR_STRINGS_MAX])
{
  hap_pose home;
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_home(&home);
  hapi_spidar_lengths(model, pose != NULL ? pose : &home, lengths);
  for (int i = 0; i < model->strings; ++i) {
    model->offset[i] = lengths[i] - counts[i] * model->metres_per_count[i];
  }
  model->calibrated = true;
}

/* ---- one sample ---- */

/* What no motion of the grip explains of a change of the lengths: I - J (J^T J)^-1 J^T. */
static void untold_project(const hapi_spidar_model *model, const hapi_spidar_rows *rows,
                           hapi_spidar_matrix out)
{
  double part[HAPI_SPIDAR_STRINGS_MAX][6];
  hapi_spidar_matrix l;
  memset(l, 0, sizeof l);
  for (int i = 0; i < model->strings; ++i) {
    hapi_v3_copy(rows->unit[i], part[i]);
    hapi_v3_scale(1.0 / TURN_LENGTH, rows->moment[i], part[i] + 3);
    for (int a = 0; a < model->dof; ++a) {
      for (int b = 0; b <= a; ++b) {
        l[a][b] += part[i][a] * part[i][b];
      }
    }
  }
  bool told = hapi_spidar_cholesky(l, model->dof);
  for (int i = 0; i < model->strings; ++i) {
    if (told) {
      hapi_spidar_forward(l, model->dof, part[i]);
    }
    for (int k = 0; k <= i; ++k) {
      double sum = i == k ? 1.0 : 0.0;
      for (int a = 0; a < model->dof && told; ++a) {
        sum -= part[i][a] * part[k][a];
      }
      /* a pose that the strings do not tell says nothing about the unknowns either */
      out[i][k] = out[k][i] = told ? sum : 0.0;
    }
  }
}

/* Derivatives of a string's error (length at the pose - measured length) by its unknowns. */
static void string_derive(const problem *p, const hapi_spidar_rows *rows,
                          const hapi_spidar_sample *sample, int string, double out[PER_STRING])
{
  HAPI_ASSERT_INDEX(string, p->model.strings);
  int next = 0;
  out[next++] = -1.0;
  if ((p->find & HAPI_SPIDAR_FIND_SCALES) != 0) {
    double way = sample->counts[string] - p->middle[string];
    out[next++] = -way * p->model.metres_per_count[string] / SCALE_LENGTH;
  }
  if ((p->find & HAPI_SPIDAR_FIND_MOTORS) != 0) {
    hapi_v3_copy(rows->unit[string], out + next);
  }
}

/* The pose that fits, from start; m, the largest error of a length there. */
static double place_from(const problem *p, const hap_pose *start, const double *lengths,
                         hap_pose *out)
{
  hapi_spidar_solver solver;
  hapi_spidar_solver_init(&solver, &p->model, start);
  int calls = 0;
  while (hapi_spidar_solve(&solver, &p->model, lengths) == HAPI_SPIDAR_FIT_MOVING &&
         calls < CALLS) {
    ++calls;
  }
  *out = solver.pose;
  return solver.residual;
}

/* From the pose of the round before; where that does not fit, from the middle of the workspace. Not
 * from the sample before: samples need not lie on one path. */
static void sample_place(problem *p, size_t index, const double *lengths)
{
  HAPI_ASSERT_INDEX(index, p->count);
  const hapi_spidar_sample *sample = &p->samples[index];
  hap_pose *pose = &p->poses[index];
  if (sample->known) {
    *pose = sample->pose;
    return;
  }
  double error = place_from(p, pose, lengths, pose);
  if (error > p->model.residual) {
    hap_pose middle;
    hap_pose other;
    hapi_spidar_home(&middle);
    hapi_v3_copy(p->model.centre, middle.position);
    if (place_from(p, &middle, lengths, &other) < error) {
      *pose = other;
    }
  }
}

static void add_errors(const problem *p, size_t index, const double *error, equations *e)
{
  for (int i = 0; i < p->model.strings; ++i) {
    e->cost += error[i] * error[i];
    if (fabs(error[i]) > e->worst) {
      e->worst = fabs(error[i]);
      e->worst_sample = index;
      e->worst_string = i;
    }
  }
}

static void add_sample(problem *p, size_t index, equations *e)
{
  const hapi_spidar_sample *sample = &p->samples[index];
  const hapi_spidar_model *model = &p->model;
  double lengths[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double error[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  double slope[HAPI_SPIDAR_STRINGS_MAX][PER_STRING] = {{0.0}};
  hapi_spidar_rows rows;
  hapi_spidar_matrix left = {{0.0}};
  hapi_spidar_measure(model, sample->counts, lengths);
  sample_place(p, index, lengths);
  hapi_spidar_rows_at(model, &p->poses[index], &rows);
  untold_project(model, &rows, left);
  for (int i = 0; i < model->strings; ++i) {
    error[i] = rows.length[i] - lengths[i];
    string_derive(p, &rows, sample, i, slope[i]);
  }
  add_errors(p, index, error, e);
  for (int a = 0; a < e->n; ++a) {
    int i = a / p->per_string;
    double da = slope[i][a % p->per_string];
    for (int k = 0; k < model->strings; ++k) {
      double weight = sample->known ? (i == k ? 1.0 : 0.0) : left[i][k];
      e->g[a] += da * weight * error[k];
      for (int b = 0; b < p->per_string; ++b) {
        e->h[a][k * p->per_string + b] += da * weight * slope[k][b];
      }
    }
  }
}

static void problem_evaluate(problem *p, equations *e)
{
  memset(e, 0, sizeof *e);
  e->n = p->model.strings * p->per_string;
  for (size_t i = 0; i < p->count; ++i) {
    add_sample(p, i, e);
  }
}

/* ---- unknowns ---- */

static void model_change(const problem *p, const double *step, hapi_spidar_model *model)
{
  for (int i = 0; i < model->strings; ++i) {
    const double *part = step + (ptrdiff_t)i * p->per_string;
    double before = model->metres_per_count[i];
    double at_middle = model->offset[i] + before * p->middle[i] + *part++;
    if ((p->find & HAPI_SPIDAR_FIND_SCALES) != 0) {
      model->metres_per_count[i] = before * (1.0 + *part++ / SCALE_LENGTH);
    }
    if ((p->find & HAPI_SPIDAR_FIND_MOTORS) != 0) {
      hapi_v3_add(model->motor[i], part, model->motor[i]);
    }
    model->offset[i] = at_middle - model->metres_per_count[i] * p->middle[i];
  }
}

/* m, root mean square error of a length: what is left, over what was free to be left; rounding at
 * least. */
static double noise_of(const problem *p, const equations *e, int told)
{
  double rows = 0.0;
  double rounding = 0.0;
  for (size_t i = 0; i < p->count; ++i) {
    rows += p->model.strings - (p->samples[i].known ? 0 : p->model.dof);
  }
  for (int i = 0; i < p->model.strings; ++i) {
    rounding = fmax(rounding, COUNT_NOISE * fabs(p->model.metres_per_count[i]));
  }
  return rows > told ? fmax(rounding, sqrt(e->cost / (rows - told))) : rounding;
}

/* Strings that all meet in one point do not tell how the frame is turned either, whatever the
 * dof. */
static bool arms_differ(const hapi_spidar_model *model)
{
  bool differ = false;
  for (int i = 1; i < model->strings; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      differ = differ || fabs(model->grip[i][axis] - model->grip[0][axis]) > ARM_LEAST;
    }
  }
  return differ;
}

/* Motions of the whole frame that poses take up which nobody knows. */
static int free_of(const problem *p)
{
  size_t known = 0;
  for (size_t i = 0; i < p->count; ++i) {
    known += p->samples[i].known;
  }
  if ((p->find & HAPI_SPIDAR_FIND_MOTORS) == 0 || known > 0) {
    return 0;
  }
  return p->model.dof == 3 && arms_differ(&p->model) ? 3 : 6;
}

/* The step down, without the combinations of unknowns that the samples do not tell: the first ones,
 * as the eigenvalues rise. Returns its length. */
static double find_step(const hapi_spidar_eigen *eigen, const equations *e, int skipped,
                        double damping, double *step)
{
  double square = 0.0;
  memset(step, 0, HAPI_SPIDAR_EIGEN_MAX * sizeof *step);
  for (int k = skipped; k < e->n; ++k) {
    double along = 0.0;
    for (int a = 0; a < e->n; ++a) {
      along += eigen->vector[k][a] * e->g[a];
    }
    along /= -(eigen->value[k] + damping);
    square += along * along;
    for (int a = 0; a < e->n; ++a) {
      step[a] += along * eigen->vector[k][a];
    }
  }
  return sqrt(square);
}

/* Combinations whose standard deviation is not below the limit: values rise. */
static int count_untold(const hapi_spidar_eigen *eigen, int n, double noise)
{
  int untold = 0;
  while (untold < n && !(eigen->value[untold] * TOLD * TOLD > noise * noise)) {
    ++untold;
  }
  return untold;
}

/* Levenberg and Marquardt. What is not told is left alone: it would run away. */
static void problem_descend(problem *p, equations *here, hapi_spidar_eigen *eigen)
{
  double damping = 0.0;
  double size = 1.0;
  problem_evaluate(p, here);
  for (int round = 0; round < ROUNDS && size > ARRIVED; ++round) {
    equations there;
    problem next = *p;
    double step[HAPI_SPIDAR_EIGEN_MAX];
    hapi_spidar_eigen_find(here->n, here->h, eigen);
    double rounding = noise_of(p, &(equations){.cost = 0.0}, 0);
    int untold = count_untold(eigen, here->n, rounding);
    size = find_step(eigen, here, untold, damping, step);
    model_change(p, step, &next.model);
    problem_evaluate(&next, &there);
    if (there.cost <= here->cost) {
      p->model = next.model;
      *here = there;
      damping *= 0.1;
    } else {
      damping = damping > 0.0 ? 10.0 * damping : 1e-3 * eigen->value[here->n - 1];
    }
  }
  hapi_spidar_eigen_find(here->n, here->h, eigen);
}

/* ---- what came out ---- */

static void report_deviations(const problem *p, const hapi_spidar_eigen *eigen, double noise,
                              hapi_spidar_calibration *out)
{
  for (int a = 0; a < out->unknowns; ++a) {
    double variance = 0.0;
    for (int k = out->free; k < out->unknowns; ++k) {
      double share = eigen->vector[k][a];
      variance += share * share / fmax(eigen->value[k], 1e-30);
    }
    double deviation = noise * sqrt(variance);
    int string = a / p->per_string;
    int kind = a % p->per_string;
    bool scales = (p->find & HAPI_SPIDAR_FIND_SCALES) != 0;
    if (kind == 0) {
      out->offset_deviation[string] = deviation;
    } else if (kind == 1 && scales) {
      out->scale_deviation[string] = deviation / SCALE_LENGTH;
    } else {
      out->motor_deviation[string] = fmax(out->motor_deviation[string], deviation);
    }
  }
}

static int string_of_most(const problem *p, const double *vector, int n)
{
  double share[HAPI_SPIDAR_STRINGS_MAX] = {0.0};
  int most = 0;
  for (int a = 0; a < n; ++a) {
    share[a / p->per_string] += vector[a] * vector[a];
  }
  for (int i = 1; i < p->model.strings; ++i) {
    most = share[i] > share[most] ? i : most;
  }
  return most;
}

static void result_report(const problem *p, const equations *e, const hapi_spidar_eigen *eigen,
                          hapi_spidar_calibration *out)
{
  memset(out, 0, sizeof *out);
  out->unknowns = e->n;
  out->free = free_of(p);
  double noise = noise_of(p, e, e->n - out->free);
  out->told = e->n - count_untold(eigen, e->n, noise);
  out->residual = sqrt(e->cost / ((double)p->count * p->model.strings));
  out->worst = e->worst;
  double least = fmax(eigen->value[out->free], 0.0);
  out->condition = eigen->value[e->n - 1] > 0.0 ? least / eigen->value[e->n - 1] : 0.0;
  out->weakest = noise / sqrt(fmax(least, 1e-30));
  out->weakest_string = string_of_most(p, eigen->vector[out->free], e->n);
  report_deviations(p, eigen, noise, out);
}

static hap_status result_judge(const problem *p, const equations *e, hapi_spidar_calibration *out,
                               hap_detail *detail)
{
  if (out->told < out->unknowns - out->free) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the samples tell %d of %d unknowns, the weakest only to %.3g mm, most about "
                     "string %d: move the grip further to all sides and turn it about all axes, or "
                     "look for less",
                     out->told, out->unknowns - out->free, 1e3 * out->weakest, out->weakest_string);
  }
  if (e->worst > p->model.residual) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "sample %zu: the length of string %d is off by %.3g mm from what the others "
                     "say: it was slack, or the geometry is not this",
                     e->worst_sample, e->worst_string, 1e3 * e->worst);
  }
  out->model = p->model;
  out->model.calibrated = true;
  return hapi_spidar_model_check(&out->model, detail);
}

/* ---- beginning ---- */

static hap_status check_samples(const problem *p, hap_detail *detail)
{
  int spare = p->model.strings - p->model.dof;
  double rows = 0.0;
  if (p->count == 0 || p->count > HAPI_SPIDAR_SAMPLES_MAX) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%zu samples, expected 1 to %d", p->count,
                     HAPI_SPIDAR_SAMPLES_MAX);
  }
  for (size_t i = 0; i < p->count; ++i) {
    const hapi_spidar_sample *s = &p->samples[i];
    rows += s->known ? p->model.strings : spare;
    bool good =
        !s->known || (hapi_finite(s->pose.position, 3) && hapi_finite(s->pose.quat_wxyz, 4));
    for (int k = 0; k < p->model.strings; ++k) {
      good = good && fabs(s->counts[k]) <= COUNT_MAX;
    }
    if (!good) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "sample %zu: a count or its pose is not finite, or beyond 1e9", i);
    }
  }
  int unknowns = p->model.strings * p->per_string - free_of(p);
  if (rows < unknowns) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "%zu samples say %.0f things about %d unknowns: record more", p->count, rows,
                     unknowns);
  }
  return HAP_OK;
}

/* Middles of the counts, offsets and poses to begin with. */
static void problem_begin(problem *p)
{
  const hapi_spidar_sample *first = &p->samples[0];
  for (int i = 0; i < p->model.strings; ++i) {
    double sum = 0.0;
    for (size_t k = 0; k < p->count; ++k) {
      sum += p->samples[k].counts[i] - first->counts[i];
    }
    p->middle[i] = first->counts[i] + sum / (double)p->count;
  }
  if (!p->model.calibrated) {
    hapi_spidar_calibrate_at(&p->model, first->known ? &first->pose : NULL, first->counts);
  }
  for (size_t k = 0; k < p->count; ++k) {
    if (k == 0) {
      hapi_spidar_home(&p->poses[k]);
    } else {
      p->poses[k] = p->poses[k - 1]; /* a recording of one motion */
    }
    double lengths[HAPI_SPIDAR_STRINGS_MAX];
    hapi_spidar_measure(&p->model, p->samples[k].counts, lengths);
    sample_place(p, k, lengths);
  }
}

hap_status hapi_spidar_calibrate(const hapi_spidar_model *model, const hapi_spidar_sample *samples,
                                 size_t count, unsigned find, hapi_spidar_calibration *out,
                                 hap_detail *detail)
{
  problem p = {.samples = samples, .count = count, .find = find, .model = *model};
  equations e;
  hapi_spidar_eigen eigen;
  memset(out, 0, sizeof *out);
  p.per_string = 1 + ((find & HAPI_SPIDAR_FIND_SCALES) != 0 ? 1 : 0) +
                 ((find & HAPI_SPIDAR_FIND_MOTORS) != 0 ? 3 : 0);
  hap_status status = check_samples(&p, detail);
  if (status < HAP_OK) {
    return status;
  }
  p.poses = hapi_alloc_array(count, sizeof *p.poses);
  if (p.poses == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for %zu poses", count);
  }
  problem_begin(&p);
  problem_descend(&p, &e, &eigen);
  result_report(&p, &e, &eigen, out);
  status = result_judge(&p, &e, out, detail);
  hapi_free(p.poses);
  return status;
}
