/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* m a + b v + c sign(v) + g + k x = f(t - delay) is multiplied with functions that vanish, with
 * their slopes, at both ends of a window, and is integrated by parts (modulating functions:
 * Shinbrot 1957; Preisig, Rippin 1993). No position is differentiated, so rounded positions do. The
 * second derivatives of the functions are Legendre polynomials of order 2 and up. These are
 * orthogonal: white noise of the positions is white noise of the rows, as least squares needs it.
 * Within a window the velocity keeps its sign. For a given delay the equation is linear in the
 * other five unknowns; the delay with the least residual is taken. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "device/identify.h"

#define SPREAD 4u        /* samples on either side that make a velocity */
#define TRIM 2u          /* samples at the ends of a window */
#define WINDOW_LEAST 12u /* samples */
#define WINDOWS_LEAST 8u
#define SLOW 4e-3 /* m/s: the sign of less is not trusted */
#define SHAPES 5
#define TERMS 12
#define UNKNOWNS 5
#define GRID 1e-3 /* s, of the first search for the delay */
#define SHRINKS 24

/* Coefficients of a function of 0..1, of its derivatives and of its integral from 0. */
typedef struct shape {
  double value[TERMS];
  double slope[TERMS];
  double curve[TERMS];
  double integral[TERMS];
} shape;

typedef struct window {
  uint32_t first;
  uint32_t last;
  double sign; /* of the velocity */
} window;

typedef struct fitting {
  const hapi_identify_record *record;
  shape shapes[SHAPES];
  window *windows;
  uint32_t window_count;
  double (*rows)[UNKNOWNS]; /* window by window, SHAPES each */
  double *force;            /* right sides, for one delay */
  double normal[UNKNOWNS][UNKNOWNS];
} fitting;

double hapi_identify_velocity(const hapi_identify_record *record, uint32_t i)
{
  if (i < SPREAD || i + SPREAD >= record->count) {
    return 0.0;
  }
  const hapi_identify_sample *before = &record->samples[i - SPREAD];
  const hapi_identify_sample *after = &record->samples[i + SPREAD];
  return (after->position - before->position) / (after->time - before->time);
}

/* ---- shapes ---- */

static void polynomial_integrate(const double a[TERMS], double out[TERMS])
{
  out[0] = 0.0;
  for (int i = 1; i < TERMS; ++i) {
    out[i] = a[i - 1] / i;
  }
}

/* Legendre polynomials on 0..1, of unit mean square. */
static void make_shapes(shape shapes[SHAPES])
{
  double last[TERMS] = {1.0};
  double now[TERMS] = {-1.0, 2.0};
  for (int n = 1; n <= SHAPES; ++n) { /* (n + 1) P(n + 1) = (2 n + 1) (2 s - 1) P(n) - n P(n - 1) */
    shape *s = &shapes[n - 1];
    double next[TERMS];
    for (int i = 0; i < TERMS; ++i) {
      double shifted = i > 0 ? now[i - 1] : 0.0;
      next[i] = ((2.0 * n + 1.0) * (2.0 * shifted - now[i]) - n * last[i]) / (n + 1.0);
      s->curve[i] = sqrt(2.0 * n + 3.0) * next[i];
    }
    memcpy(last, now, sizeof last);
    memcpy(now, next, sizeof now);
    polynomial_integrate(s->curve, s->slope);
    polynomial_integrate(s->slope, s->value);
    polynomial_integrate(s->value, s->integral);
  }
}

static double polynomial_evaluate(const double a[TERMS], double s)
{
  double sum = 0.0;
  for (int i = TERMS - 1; i >= 0; --i) {
    sum = sum * s + a[i];
  }
  return sum;
}

/* ---- windows ---- */

static double sign_at(const hapi_identify_record *record, uint32_t i)
{
  double velocity = hapi_identify_velocity(record, i);
  return fabs(velocity) < SLOW ? 0.0 : copysign(1.0, velocity);
}

static void find_windows(fitting *f)
{
  const hapi_identify_record *record = f->record;
  for (uint32_t first = 0; first < record->count;) {
    double sign = sign_at(record, first);
    uint32_t end = first + 1;
    while (end < record->count && sign_at(record, end) == sign) {
      ++end;
    }
    if (sign != 0.0 && end - first >= WINDOW_LEAST + 2 * TRIM) {
      f->windows[f->window_count++] = (window){first + TRIM, end - 1 - TRIM, sign};
    }
    first = end;
  }
}

/* ---- rows ---- */

static double length_of(const fitting *f, const window *w)
{
  return f->record->samples[w->last].time - f->record->samples[w->first].time;
}

/* Noise of the positions is then the same in rows of short and of long windows. */
static double weight_of(double length)
{
  return length * sqrt(length);
}

/* Time that a sample stands for: trapezoids with Gregory's correction at the ends, 4th order. */
static double share_of(const hapi_identify_sample *samples, const window *w, uint32_t i)
{
  static const double correction[3] = {0.75, 7.0 / 6.0, 23.0 / 24.0};
  double before = i > w->first ? samples[i].time - samples[i - 1].time : 0.0;
  double after = i < w->last ? samples[i + 1].time - samples[i].time : 0.0;
  uint32_t inside = i - w->first < w->last - i ? i - w->first : w->last - i;
  return 0.5 * (before + after) * (inside < 3 ? correction[inside] : 1.0);
}

static void make_row(const fitting *f, const window *w, const shape *factor, double row[UNKNOWNS])
{
  const hapi_identify_sample *samples = f->record->samples;
  double length = length_of(f, w);
  double weight = weight_of(length);
  double middle = samples[(w->first + w->last) / 2].position; /* its integral is zero */
  double area = weight * length * polynomial_evaluate(factor->integral, 1.0);
  row[0] = 0.0;
  row[1] = 0.0;
  row[2] = w->sign * area;
  row[3] = area;
  row[4] = 0.0;
  for (uint32_t i = w->first; i <= w->last; ++i) {
    double s = (samples[i].time - samples[w->first].time) / length;
    double x = weight * (samples[i].position - middle) * share_of(samples, w, i);
    row[0] += x * polynomial_evaluate(factor->curve, s) / (length * length);
    row[1] -= x * polynomial_evaluate(factor->slope, s) / length;
    row[4] += weight * (samples[i].position - samples[0].position) * share_of(samples, w, i) *
              polynomial_evaluate(factor->value, s);
  }
}

/* Integral of the shape times the force, which is held from sample to sample. */
static double push_on(const fitting *f, const window *w, const shape *factor, double delay)
{
  const hapi_identify_sample *samples = f->record->samples;
  double length = length_of(f, w);
  double start = samples[w->first].time - delay;
  double sum = 0.0;
  double upper = polynomial_evaluate(factor->integral, 1.0);
  double s = 1.0;
  for (uint32_t i = w->last; i-- > 0 && s > 0.0;) {
    s = fmin(fmax((samples[i].time - start) / length, 0.0), 1.0);
    double lower = polynomial_evaluate(factor->integral, s);
    sum += samples[i].force * (upper - lower);
    upper = lower;
  }
  return sum * length * weight_of(length);
}

static void make_rows(fitting *f)
{
  memset(f->normal, 0, sizeof f->normal);
  for (uint32_t r = 0; r < f->window_count * SHAPES; ++r) {
    make_row(f, &f->windows[r / SHAPES], &f->shapes[r % SHAPES], f->rows[r]);
    for (int i = 0; i < UNKNOWNS; ++i) {
      for (int k = 0; k < UNKNOWNS; ++k) {
        f->normal[i][k] += f->rows[r][i] * f->rows[r][k];
      }
    }
  }
}

/* ---- least squares ---- */

/* Elimination with the largest pivot; false when the rows do not tell the unknowns apart. */
static bool equations_solve(double a[UNKNOWNS][UNKNOWNS + 1], double out[UNKNOWNS])
{
  double whole[UNKNOWNS];
  for (int k = 0; k < UNKNOWNS; ++k) {
    whole[k] = a[k][k];
  }
  for (int k = 0; k < UNKNOWNS; ++k) {
    int best = k;
    for (int i = k + 1; i < UNKNOWNS; ++i) {
      best = fabs(a[i][k]) > fabs(a[best][k]) ? i : best;
    }
    for (int j = 0; j <= UNKNOWNS; ++j) {
      double swapped = a[k][j];
      a[k][j] = a[best][j];
      a[best][j] = swapped;
    }
    if (!(fabs(a[k][k]) > 1e-12 * whole[k])) {
      return false;
    }
    for (int i = k + 1; i < UNKNOWNS; ++i) {
      double share = a[i][k] / a[k][k];
      for (int j = k; j <= UNKNOWNS; ++j) {
        a[i][j] -= share * a[k][j];
      }
    }
  }
  for (int k = UNKNOWNS - 1; k >= 0; --k) {
    out[k] = a[k][UNKNOWNS];
    for (int j = k + 1; j < UNKNOWNS; ++j) {
      out[k] -= a[k][j] * out[j];
    }
    out[k] /= a[k][k];
  }
  return true;
}

/* The best unknowns for a delay; gives the share of the force that they leave, more than 1 when
 * there are none. */
static double fit_at(fitting *f, double delay, double out[UNKNOWNS])
{
  double a[UNKNOWNS][UNKNOWNS + 1];
  double all = 0.0;
  double rest = 0.0;
  for (int i = 0; i < UNKNOWNS; ++i) {
    memcpy(a[i], f->normal[i], sizeof f->normal[i]);
    a[i][UNKNOWNS] = 0.0;
  }
  uint32_t rows = f->window_count * SHAPES;
  for (uint32_t r = 0; r < rows; ++r) {
    f->force[r] = push_on(f, &f->windows[r / SHAPES], &f->shapes[r % SHAPES], delay);
    all += f->force[r] * f->force[r];
    for (int i = 0; i < UNKNOWNS; ++i) {
      a[i][UNKNOWNS] += f->rows[r][i] * f->force[r];
    }
  }
  if (!equations_solve(a, out) || !(all > 0.0)) {
    return 2.0;
  }
  for (uint32_t r = 0; r < rows; ++r) {
    double left = f->force[r];
    for (int i = 0; i < UNKNOWNS; ++i) {
      left -= f->rows[r][i] * out[i];
    }
    rest += left * left;
  }
  return sqrt(rest / all);
}

/* On a grid first: the rest is smooth near its least value only. Then by golden sections. */
static double find_delay(fitting *f)
{
  double unknowns[UNKNOWNS];
  double best = 0.0;
  double least = INFINITY;
  for (int i = 0; i * GRID <= HAPI_IDENTIFY_DELAY_MAX; ++i) {
    double rest = fit_at(f, i * GRID, unknowns);
    if (rest < least) {
      least = rest;
      best = i * GRID;
    }
  }
  const double share = 0.61803398874989485;
  double low = fmax(best - GRID, 0.0);
  double high = best + GRID;
  double at[2] = {high - share * (high - low), low + share * (high - low)};
  double rest[2] = {fit_at(f, at[0], unknowns), fit_at(f, at[1], unknowns)};
  for (int i = 0; i < SHRINKS; ++i) {
    int worse = rest[0] < rest[1];
    *(worse == 1 ? &high : &low) = at[worse];
    at[worse] = at[1 - worse];
    rest[worse] = rest[1 - worse];
    at[1 - worse] = worse == 1 ? high - share * (high - low) : low + share * (high - low);
    rest[1 - worse] = fit_at(f, at[1 - worse], unknowns);
  }
  return low < 1e-7 ? 0.0 : 0.5 * (low + high);
}

static hap_status fitting_run(fitting *f, hapi_identify_fit *out, hap_detail *detail)
{
  double unknowns[UNKNOWNS];
  make_shapes(f->shapes);
  find_windows(f);
  make_rows(f);
  if (f->window_count < WINDOWS_LEAST) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "it moved to and fro too little to be identified");
  }
  out->delay = find_delay(f);
  out->residual = fit_at(f, out->delay, unknowns);
  if (out->residual > 1.0 || !(unknowns[0] > 0.0)) {
    return hapi_fail(detail, HAP_ERROR_DEVICE, "its motion does not follow the force");
  }
  out->mass = unknowns[0];
  out->damping = fmax(unknowns[1], 0.0);
  out->friction = fmax(unknowns[2], 0.0);
  out->bias = unknowns[3];
  out->stiffness = unknowns[4];
  return HAP_OK;
}

hap_status hapi_identify_fit_record(const hapi_identify_record *record, hapi_identify_fit *out,
                                    hap_detail *detail)
{
  fitting f = {.record = record};
  uint32_t most = record->count / WINDOW_LEAST + 1;
  f.windows = hapi_alloc_array(most, sizeof *f.windows);
  f.rows = hapi_alloc_array((size_t)most * SHAPES, sizeof *f.rows);
  f.force = hapi_alloc_array((size_t)most * SHAPES, sizeof *f.force);
  bool room = f.windows != NULL && f.rows != NULL && f.force != NULL;
  hap_status status = room
                          ? fitting_run(&f, out, detail)
                          : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the identification");
  hapi_free(f.windows);
  hapi_free(f.rows);
  hapi_free(f.force);
  return status;
}
