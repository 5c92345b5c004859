/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_VEC_H
#define HAPODE_BASE_VEC_H

/* Small fixed-size algebra on plain arrays: vectors of 3, quaternions w, x, y, z. Outputs may be
 * the inputs unless a comment says otherwise. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/assert.h"

static inline void hapi_v3_copy(const double a[3], double out[3])
{
  out[0] = a[0];
  out[1] = a[1];
  out[2] = a[2];
}

/* fmin and fmax without a call, of which a tick would make a thousand. NaN gives the bound. */
static inline double hapi_min(double x, double bound)
{
  return x < bound ? x : bound;
}

static inline double hapi_max(double x, double bound)
{
  return x > bound ? x : bound;
}

static inline void hapi_v3_set(double out[3], double x, double y, double z)
{
  out[0] = x;
  out[1] = y;
  out[2] = z;
}

static inline void hapi_v3_add(const double a[3], const double b[3], double out[3])
{
  out[0] = a[0] + b[0];
  out[1] = a[1] + b[1];
  out[2] = a[2] + b[2];
}

static inline void hapi_v3_sub(const double a[3], const double b[3], double out[3])
{
  out[0] = a[0] - b[0];
  out[1] = a[1] - b[1];
  out[2] = a[2] - b[2];
}

static inline void hapi_v3_scale(double s, const double a[3], double out[3])
{
  out[0] = s * a[0];
  out[1] = s * a[1];
  out[2] = s * a[2];
}

/* out = a + s b */
static inline void hapi_v3_madd(const double a[3], double s, const double b[3], double out[3])
{
  out[0] = a[0] + s * b[0];
  out[1] = a[1] + s * b[1];
  out[2] = a[2] + s * b[2];
}

static inline double hapi_v3_dot(const double a[3], const double b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double hapi_v3_norm(const double a[3])
{
  return sqrt(hapi_v3_dot(a, a));
}

/* To a length of at most limit, direction kept. True: it was longer. The largest component comes
 * out first, so that no square overflows. */
static inline bool hapi_v3_shorten(double v[3], double limit)
{
  HAPI_ASSERT(limit >= 0.0);
  double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
  if (largest == 0.0) {
    return false;
  }
  double unit[3] = {v[0] / largest, v[1] / largest, v[2] / largest};
  double norm = hapi_v3_norm(unit);
  if (largest * norm <= limit) {
    return false;
  }
  hapi_v3_scale(limit / norm, unit, v);
  return true;
}

static inline void hapi_v3_cross(const double a[3], const double b[3], double out[3])
{
  double x = a[1] * b[2] - a[2] * b[1];
  double y = a[2] * b[0] - a[0] * b[2];
  double z = a[0] * b[1] - a[1] * b[0];
  hapi_v3_set(out, x, y, z);
}

/* Finite is tested without isfinite so that it holds under any math flags: x - x is 0 only then. */
static inline bool hapi_finite(const double *values, int count)
{
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    sum += values[i] - values[i];
  }
  return sum == 0.0;
}

/* out = q v q*, for a unit quaternion */
static inline void hapi_quat_rotate(const double q[4], const double v[3], double out[3])
{
  double t[3];
  double u[3];
  hapi_v3_cross(q + 1, v, t);
  hapi_v3_scale(2.0, t, t);
  hapi_v3_cross(q + 1, t, u);
  hapi_v3_set(out, v[0] + q[0] * t[0] + u[0], v[1] + q[0] * t[1] + u[1], v[2] + q[0] * t[2] + u[2]);
}

/* out = q* v q */
static inline void hapi_quat_unrotate(const double q[4], const double v[3], double out[3])
{
  double c[4] = {q[0], -q[1], -q[2], -q[3]};
  hapi_quat_rotate(c, v, out);
}

static inline void hapi_quat_multiply(const double a[4], const double b[4], double out[4])
{
  double w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  double x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  double y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  double z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
  out[0] = w;
  out[1] = x;
  out[2] = y;
  out[3] = z;
}

/* Unit length; a quaternion too short to have a direction becomes the identity. */
static inline void hapi_quat_normalize(double q[4])
{
  double n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!(n2 > 1e-24)) {
    q[0] = 1.0;
    q[1] = q[2] = q[3] = 0.0;
    return;
  }
  /* After a small turn the length is nearly 1: there the series is exact to rounding, without the
   * latency of a root and a division. */
  double off = n2 - 1.0;
  double s = fabs(off) < 1e-4 ? 1.0 - off * (0.5 - off * (0.375 - 0.3125 * off)) : 1.0 / sqrt(n2);
  q[0] *= s;
  q[1] *= s;
  q[2] *= s;
  q[3] *= s;
}

/* Row-major 3x3 of a unit quaternion. */
static inline void hapi_quat_to_matrix(const double q[4], double r[9])
{
  HAPI_ASSERT_UNIT_QUAT(q);
  double w = q[0];
  double x = q[1];
  double y = q[2];
  double z = q[3];
  r[0] = 1.0 - 2.0 * (y * y + z * z);
  r[1] = 2.0 * (x * y - w * z);
  r[2] = 2.0 * (x * z + w * y);
  r[3] = 2.0 * (x * y + w * z);
  r[4] = 1.0 - 2.0 * (x * x + z * z);
  r[5] = 2.0 * (y * z - w * x);
  r[6] = 2.0 * (x * z - w * y);
  r[7] = 2.0 * (y * z + w * x);
  r[8] = 1.0 - 2.0 * (x * x + y * y);
}

/* out = m v, m row-major 3x3; out is not v */
static inline void hapi_m3_apply(const double m[9], const double v[3], double out[3])
{
  HAPI_ASSERT(v != out);
  out[0] = m[0] * v[0] + m[1] * v[1] + m[2] * v[2];
  out[1] = m[3] * v[0] + m[4] * v[1] + m[5] * v[2];
  out[2] = m[6] * v[0] + m[7] * v[1] + m[8] * v[2];
}

/* out = m^T v; out is not v */
static inline void hapi_m3_apply_transposed(const double m[9], const double v[3], double out[3])
{
  HAPI_ASSERT(v != out);
  out[0] = m[0] * v[0] + m[3] * v[1] + m[6] * v[2];
  out[1] = m[1] * v[0] + m[4] * v[1] + m[7] * v[2];
  out[2] = m[2] * v[0] + m[5] * v[1] + m[8] * v[2];
}

/* out = a b; out may be a or b */
static inline void hapi_m3_multiply(const double a[9], const double b[9], double out[9])
{
  double product[9];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      product[3 * i + k] = a[3 * i] * b[k] + a[3 * i + 1] * b[3 + k] + a[3 * i + 2] * b[6 + k];
    }
  }
  memcpy(out, product, sizeof product);
}

/* out = r m r^T: a tensor of the body in world axes; out is neither r nor m */
static inline void hapi_m3_turn(const double r[9], const double m[9], double out[9])
{
  HAPI_ASSERT(out != r && out != m);
  double rm[9];
  for (int i = 0; i < 3; ++i) {
    hapi_m3_apply_transposed(m, r + 3 * i, rm + 3 * i); /* row i of r m */
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      out[3 * i + k] = hapi_v3_dot(rm + 3 * i, r + 3 * k);
    }
  }
}

/* Whether it is a number times the unit matrix: a tensor that no turn changes. */
static inline bool hapi_m3_is_scalar(const double m[9])
{
  bool off = m[1] != 0.0 || m[2] != 0.0 || m[3] != 0.0 || m[5] != 0.0 || m[6] != 0.0 || m[7] != 0.0;
  return !off && m[0] == m[4] && m[4] == m[8];
}

/* An inertia that is the same about every axis, as of a ball or a cube, to 1e-9. */
static inline bool hapi_turns_alike(const double inertia[9])
{
  double off = fabs(inertia[1]) + fabs(inertia[2]) + fabs(inertia[5]);
  double spread = fabs(inertia[0] - inertia[4]) + fabs(inertia[0] - inertia[8]);
  return off + spread <= 1e-9 * inertia[0];
}

/* By the adjugate; a singular one becomes 0. out is not m */
static inline void hapi_m3_invert(const double m[9], double out[9])
{
  HAPI_ASSERT(m != out);
  double adjugate[9] = {
      m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
      m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
      m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
  double det = m[0] * adjugate[0] + m[1] * adjugate[3] + m[2] * adjugate[6];
  for (int i = 0; i < 9; ++i) {
    out[i] = det != 0.0 ? adjugate[i] / det : 0.0;
  }
}

/* Point of a frame to the world, and back. */
static inline void hapi_pose_point(const double position[3], const double quat[4],
                                   const double point[3], double out[3])
{
  hapi_quat_rotate(quat, point, out);
  hapi_v3_add(out, position, out);
}

static inline void hapi_pose_unpoint(const double position[3], const double quat[4],
                                     const double point[3], double out[3])
{
  hapi_v3_sub(point, position, out);
  hapi_quat_unrotate(quat, out, out);
}

#endif
