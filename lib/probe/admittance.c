/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/admittance.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"

/* All bounds are looked at in the measure of the free body: with M^-1 = L L^T, B = L^-1 A L^-T has
 * its eigenvalues between 0 and 1. */

#define N_MAX 6
#define JACOBI_SWEEPS 16 /* it ends after 5 to 7 */

/* Two things make a measurement leave the bounds. A solver that stops early: a little. And
 * friction, for good: to press a body that slides slows it down, to push it along presses
 * nothing. With a coefficient mu half of the difference is up to mu / 2, and the eigenvalues lie
 * between (1 - s)/2 and (1 + s)/2, s = sqrt(1 + mu^2); measured in the scenes: 0.34, and -0.11
 * .. 1.3. */
#define SOLVER_SLACK 1e-3
#define FRICTION_SLACK 0.25
/* Beyond these no part of a measurement can be trusted. */
#define ENTRY_MOST 10.0
#define DIAGONAL_MOST 1.5
#define DIAGONAL_LEAST (-0.5)

typedef struct matrix {
  double m[N_MAX][N_MAX];
} matrix;

/* Lower triangle L of a = L L^T; false where a is not positive definite. */
static bool matrix_cholesky(const matrix *a, int n, matrix *out)
{
  memset(out, 0, sizeof *out);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k <= i; ++k) {
      double sum = a->m[i][k];
      for (int j = 0; j < k; ++j) {
        sum -= out->m[i][j] * out->m[k][j];
      }
      if (i == k && !(sum > 0.0)) {
        return false;
      }
      out->m[i][k] = i == k ? sqrt(sum) : sum / out->m[k][k];
    }
  }
  return true;
}

/* b = L^-1 b: column by column. */
static void matrix_solve_lower(const matrix *l, int n, matrix *b)
{
  for (int c = 0; c < n; ++c) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < i; ++j) {
        b->m[i][c] -= l->m[i][j] * b->m[j][c];
      }
      b->m[i][c] /= l->m[i][i];
    }
  }
}

static void matrix_solve_upper(const matrix *l, int n, matrix *b) /* b = L^-T b */
{
  for (int c = 0; c < n; ++c) {
    for (int i = n - 1; i >= 0; --i) {
      for (int j = i + 1; j < n; ++j) {
        b->m[i][c] -= l->m[j][i] * b->m[j][c];
      }
      b->m[i][c] /= l->m[i][i];
    }
  }
}

static void matrix_transpose(int n, matrix *a)
{
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) {
      double swap = a->m[i][k];
      a->m[i][k] = a->m[k][i];
      a->m[k][i] = swap;
    }
  }
}

/* out = a b^T; out is none of the two */
static void matrix_multiply_transposed(const matrix *a, const matrix *b, int n, matrix *out)
{
  memset(out, 0, sizeof *out);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n; ++k) {
      for (int j = 0; j < n; ++j) {
        out->m[i][k] += a->m[i][j] * b->m[k][j];
      }
    }
  }
}

static void matrix_symmetrise(int n, matrix *a)
{
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) {
      a->m[i][k] = a->m[k][i] = 0.5 * (a->m[i][k] + a->m[k][i]);
    }
  }
}

/* One rotation of Jacobi's method: a[p][q] becomes 0; v collects the eigenvectors as columns. */
static void matrix_rotate(matrix *a, matrix *v, int n, int p, int q)
{
  double theta = 0.5 * (a->m[q][q] - a->m[p][p]) / a->m[p][q];
  double t = (theta < 0.0 ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
  double c = 1.0 / sqrt(t * t + 1.0);
  double s = t * c;
  for (int i = 0; i < n; ++i) {
    double x = a->m[i][p];
    double y = a->m[i][q];
    a->m[i][p] = c * x - s * y;
    a->m[i][q] = s * x + c * y;
  }
  for (int i = 0; i < n; ++i) {
    double x = a->m[p][i];
    double y = a->m[q][i];
    a->m[p][i] = c * x - s * y;
    a->m[q][i] = s * x + c * y;
    x = v->m[i][p];
    y = v->m[i][q];
    v->m[i][p] = c * x - s * y;
    v->m[i][q] = s * x + c * y;
  }
}

static void matrix_eigen(matrix *a, int n, matrix *out_vectors)
{
  memset(out_vectors, 0, sizeof *out_vectors);
  for (int i = 0; i < n; ++i) {
    out_vectors->m[i][i] = 1.0;
  }
  for (int sweep = 0; sweep < JACOBI_SWEEPS; ++sweep) {
    double off = 0.0;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        off += a->m[p][q] * a->m[p][q];
        if (fabs(a->m[p][q]) > 1e-17) {
          matrix_rotate(a, out_vectors, n, p, q);
        }
      }
    }
    if (off < 1e-30) {
      return;
    }
  }
}

/* Gershgorin: no eigenvalue is farther from a diagonal entry than the rest of its row is large.
 * Mostly enough, and much cheaper than the eigenvalues. */
static bool surely_within(const matrix *b, int n, double slack)
{
  for (int i = 0; i < n; ++i) {
    double rest = 0.0;
    for (int k = 0; k < n; ++k) {
      rest += k != i ? fabs(b->m[i][k]) : 0.0;
    }
    if (!(b->m[i][i] - rest >= -slack && b->m[i][i] + rest <= 1.0 + slack)) {
      return false;
    }
  }
  return true;
}

/* Brings the eigenvalues of a symmetric b back to 0 .. 1 when one is farther out than slack; how
 * far the farthest was, 0 when nothing was done. */
static double matrix_clip(matrix *b, int n, double slack)
{
  matrix values = *b;
  matrix vectors;
  double excess[N_MAX];
  double most = 0.0;
  if (surely_within(b, n, slack)) {
    return 0.0;
  }
  matrix_eigen(&values, n, &vectors);
  for (int e = 0; e < n; ++e) {
    excess[e] = values.m[e][e] - fmax(0.0, fmin(1.0, values.m[e][e]));
    most = fmax(most, fabs(excess[e]));
  }
  if (most <= slack) {
    return 0.0;
  }
  for (int e = 0; e < n; ++e) {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) {
        b->m[i][k] -= excess[e] * vectors.m[i][e] * vectors.m[k][e];
      }
    }
  }
  return most;
}

/* The same for one direction: normal in world axes, to the measure by L^T. */
static bool matrix_clip_along(matrix *b, const matrix *l, const double normal[3])
{
  double u[3];
  double turned[3];
  for (int i = 0; i < 3; ++i) {
    u[i] = l->m[0][i] * normal[0] + l->m[1][i] * normal[1] + l->m[2][i] * normal[2];
  }
  double size2 = hapi_v3_dot(u, u);
  for (int i = 0; i < 3; ++i) {
    turned[i] = hapi_v3_dot(b->m[i], u);
  }
  double share = hapi_v3_dot(u, turned) / size2;
  double excess = share - fmax(0.0, fmin(1.0, share));
  if (fabs(excess) <= SOLVER_SLACK) {
    return false;
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      b->m[i][k] -= excess * u[i] * u[k] / size2;
    }
  }
  return true;
}

static bool matrix_is_plausible(const matrix *b, int n)
{
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < n; ++k) {
      if (!(fabs(b->m[i][k]) <= ENTRY_MOST)) { /* false for NaN */
        return false;
      }
    }
    if (b->m[i][i] < DIAGONAL_LEAST || b->m[i][i] > DIAGONAL_MOST) {
      return false;
    }
  }
  return true;
}

/* b = L^-1 b L^-T */
static void matrix_to_measure(const matrix *l, int n, matrix *b)
{
  matrix_solve_lower(l, n, b);
  matrix_transpose(n, b);
  matrix_solve_lower(l, n, b);
  matrix_transpose(n, b);
}

/* ---- a force at a point ---- */

void hapi_free_point(const hapi_free_body *body, const double arm[3], double out[6][3])
{
  for (int k = 0; k < 3; ++k) {
    double force[3] = {0.0, 0.0, 0.0};
    double moment[3];
    double turn[3];
    force[k] = 1.0;
    hapi_v3_cross(arm, force, moment);
    hapi_m3_apply(body->inverse_inertia, moment, turn);
    for (int i = 0; i < 3; ++i) {
      out[i][k] = force[i] * body->inverse_mass;
      out[3 + i][k] = turn[i];
    }
  }
}

/* Acceleration of the point itself. */
static void matrix_at_point(double a[6][3], const double arm[3], matrix *out)
{
  memset(out, 0, sizeof *out);
  for (int k = 0; k < 3; ++k) {
    const double turn[3] = {a[3][k], a[4][k], a[5][k]};
    double way[3];
    hapi_v3_cross(turn, arm, way);
    for (int i = 0; i < 3; ++i) {
      out->m[i][k] = a[i][k] + way[i];
    }
  }
}

/* a += free x, where x are the forces at the point that make the difference. */
static void matrix_correct(double free[6][3], const matrix *l, const matrix *difference,
                           double a[6][3])
{
  matrix x;
  matrix_multiply_transposed(difference, l, 3, &x);
  matrix_solve_upper(l, 3, &x);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 3; ++k) {
      a[i][k] += free[i][0] * x.m[0][k] + free[i][1] * x.m[1][k] + free[i][2] * x.m[2][k];
    }
  }
}

/* True: something was cut off. What is not symmetric is not averaged, however little it is: a
 * push along a floor that lifts the body by one per cent takes it off its contacts, and a cube
 * that friction held flew away in the loop. */
static bool matrix_cut_measured(matrix *b, const matrix *l, const double normal[3])
{
  matrix symmetric = *b;
  matrix_symmetrise(3, &symmetric);
  bool cut = matrix_clip(&symmetric, 3, FRICTION_SLACK) > 0.0;
  if (cut) {
    *b = symmetric;
  }
  return matrix_clip_along(b, l, normal) || cut;
}

hapi_admittance hapi_admittance_tidy_point(const hapi_free_body *body, const double arm[3],
                                           const double normal[3], double a[6][3])
{
  double free[6][3];
  matrix bound;
  matrix l;
  matrix b;
  hapi_free_point(body, arm, free);
  matrix_at_point(free, arm, &bound);
  matrix_at_point(a, arm, &b);
  if (!hapi_finite(&a[0][0], 18) || !matrix_cholesky(&bound, 3, &l)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  matrix_to_measure(&l, 3, &b);
  if (!matrix_is_plausible(&b, 3)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  matrix wanted = b;
  if (!matrix_cut_measured(&wanted, &l, normal)) {
    return HAPI_ADMITTANCE_GOOD;
  }
  for (int i = 0; i < 3; ++i) {
    hapi_v3_sub(wanted.m[i], b.m[i], wanted.m[i]);
  }
  matrix_correct(free, &l, &wanted, a);
  return HAPI_ADMITTANCE_CLIPPED;
}

/* ---- the same for another body ---- */

static void body_free_wrench(const hapi_free_body *body, matrix *out)
{
  memset(out, 0, sizeof *out);
  for (int i = 0; i < 3; ++i) {
    out->m[i][i] = body->inverse_mass;
    for (int k = 0; k < 3; ++k) {
      out->m[3 + i][3 + k] = body->inverse_inertia[3 * i + k];
    }
  }
}

/* The largest that it makes of a vector of length 1; NaN where it cannot be used. */
static double matrix_size(const matrix *b)
{
  matrix gram = {{{0.0}}};
  matrix vectors;
  for (int i = 0; i < N_MAX; ++i) {
    for (int k = 0; k < 3; ++k) {
      if (!(fabs(b->m[i][k]) <= ENTRY_MOST)) { /* false for NaN */
        return (double)NAN;
      }
      for (int j = 0; j < 3; ++j) {
        gram.m[k][j] += b->m[i][k] * b->m[i][j];
      }
    }
  }
  matrix_eigen(&gram, 3, &vectors);
  return sqrt(fmax(0.0, fmax(gram.m[0][0], fmax(gram.m[1][1], gram.m[2][2]))));
}

/* Why half: the answers of point and body together are a matrix between 0 and 1 in this measure,
 * and this is a block beside its diagonal. */
hapi_admittance hapi_admittance_tidy_cross(const hapi_free_body *pushed, const double arm[3],
                                           const hapi_free_body *other, double a[6][3],
                                           double *out_share)
{
  const double most = 0.5 + FRICTION_SLACK;
  double free[6][3];
  matrix bounds[2];
  matrix l[2];
  matrix b = {{{0.0}}};
  *out_share = 0.0;
  hapi_free_point(pushed, arm, free);
  matrix_at_point(free, arm, &bounds[0]);
  body_free_wrench(other, &bounds[1]);
  if (!hapi_finite(&a[0][0], 18) || !matrix_cholesky(&bounds[0], 3, &l[0]) ||
      !matrix_cholesky(&bounds[1], 6, &l[1])) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  for (int i = 0; i < 6; ++i) {
    memcpy(b.m[i], a[i], sizeof a[i]);
  }
  matrix_solve_lower(&l[1], 6, &b);
  /* b = b L^-T, of three columns */
  for (int i = 0; i < N_MAX; ++i) {
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < k; ++j) {
        b.m[i][k] -= l[0].m[k][j] * b.m[i][j];
      }
      b.m[i][k] /= l[0].m[k][k];
    }
  }
  double size = matrix_size(&b);
  if (!isfinite(size)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  *out_share = fmin(size, most);
  for (int i = 0; size > most && i < 6; ++i) {
    hapi_v3_scale(most / size, a[i], a[i]);
  }
  return size > most ? HAPI_ADMITTANCE_CLIPPED : HAPI_ADMITTANCE_GOOD;
}

/* ---- a wrench at the centre of mass ---- */

hapi_admittance hapi_admittance_tidy_body(const hapi_free_body *body, double response[6][6])
{
  matrix bound;
  matrix l;
  matrix b;
  body_free_wrench(body, &bound);
  memcpy(b.m, response, sizeof b.m);
  matrix_symmetrise(6, &b);
  matrix tidy = b;
  if (!hapi_finite(&response[0][0], 36) || !matrix_cholesky(&bound, 6, &l)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  matrix_to_measure(&l, 6, &b);
  if (!matrix_is_plausible(&b, 6)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  double excess = matrix_clip(&b, 6, 0.0);
  if (excess > 0.0) { /* L b L^T */
    matrix half;
    matrix_multiply_transposed(&b, &l, 6, &half);
    matrix_transpose(6, &half);
    matrix_multiply_transposed(&l, &half, 6, &tidy);
    matrix_symmetrise(6, &tidy);
  }
  memcpy(response, tidy.m, sizeof tidy.m);
  return excess > SOLVER_SLACK ? HAPI_ADMITTANCE_CLIPPED : HAPI_ADMITTANCE_GOOD;
}

/* ---- a joint ---- */

/* Of the joint's answer, between none at all and one that lets nothing pass. A spring that is
 * weaker than this within a step is not seen. */
#define ROW_LEAST 1e-8

/* An eigenvector u of value s in the measure of the free pair: wrench L^-T u, answered by 1 and
 * softness 1 / s - 1. */
static void row_from_vector(const matrix *l, const matrix *vectors, int which, double share,
                            hapi_constraint_row *out)
{
  matrix u = {{{0.0}}};
  for (int i = 0; i < 6; ++i) {
    u.m[i][0] = vectors->m[i][which];
  }
  matrix_solve_upper(l, 6, &u);
  for (int i = 0; i < 6; ++i) {
    out->wrench[i] = u.m[i][0];
  }
  double scale = 1.0 / (fmax(hapi_v3_norm(out->wrench), hapi_v3_norm(out->wrench + 3)));
  for (int i = 0; i < 6; ++i) {
    out->wrench[i] *= scale;
  }
  out->softness = scale * scale * (1.0 / share - 1.0);
}

hapi_admittance hapi_admittance_rows(const double free[6][6], const double held[6][6],
                                     hapi_constraint_row out[6], int *out_count)
{
  matrix bound;
  matrix l;
  matrix b;
  matrix vectors;
  double most = 0.0;
  *out_count = 0;
  memcpy(bound.m, free, sizeof bound.m);
  memcpy(b.m, held, sizeof b.m);
  matrix_symmetrise(6, &b);
  if (!hapi_finite(&held[0][0], 36) || !matrix_cholesky(&bound, 6, &l)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  /* b = L^T b L */
  matrix up = l;
  matrix half;
  matrix_transpose(6, &up);
  matrix_multiply_transposed(&up, &b, 6, &half); /* b is symmetric */
  matrix_multiply_transposed(&half, &up, 6, &b);
  if (!matrix_is_plausible(&b, 6)) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  matrix_eigen(&b, 6, &vectors);
  for (int i = 0; i < 6; ++i) {
    most = fmax(most, fabs(b.m[i][i] - fmax(0.0, fmin(1.0, b.m[i][i]))));
  }
  for (bool taken[6] = {false}; *out_count < 6;) {
    int best = -1;
    for (int i = 0; i < 6; ++i) {
      best = !taken[i] && (best < 0 || b.m[i][i] > b.m[best][best]) ? i : best;
    }
    double share = fmax(0.0, fmin(1.0, b.m[best][best]));
    taken[best] = true;
    if (share <= ROW_LEAST) {
      break;
    }
    row_from_vector(&l, &vectors, best, share, &out[(*out_count)++]);
  }
  return most > SOLVER_SLACK ? HAPI_ADMITTANCE_CLIPPED : HAPI_ADMITTANCE_GOOD;
}
