/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_TWO_TURNS_H
#define HAPODE_BASE_TWO_TURNS_H

/* The quaternions of two bodies at once, with the bits of vec.h and pose.h. How a body turns is one
 * long chain of operations that wait for each other: two chains side by side take the time of
 * one. */

#include "base/lanes.h"
#include "base/vec.h"

typedef struct hapi_two_quats {
  hapi_two w;
  hapi_two x;
  hapi_two y;
  hapi_two z;
} hapi_two_quats;

static inline hapi_two_quats hapi_two_quats_load(const double a[4], const double b[4])
{
  return (hapi_two_quats){hapi_two_of(a[0], b[0]), hapi_two_of(a[1], b[1]), hapi_two_of(a[2], b[2]),
                          hapi_two_of(a[3], b[3])};
}

static inline hapi_two hapi_two_dot3(const hapi_two v[3])
{
  hapi_two sum = hapi_two_madd(hapi_two_mul(v[0], v[0]), v[1], v[1]);
  return hapi_two_madd(sum, v[2], v[2]);
}

/* As hapi_quat_multiply. */
static inline hapi_two_quats hapi_two_quats_multiply(hapi_two_quats a, hapi_two_quats b)
{
  hapi_two_quats out;
  out.w = hapi_two_sub(hapi_two_mul(a.w, b.w), hapi_two_mul(a.x, b.x));
  out.w = hapi_two_sub(hapi_two_sub(out.w, hapi_two_mul(a.y, b.y)), hapi_two_mul(a.z, b.z));
  out.x = hapi_two_madd(hapi_two_mul(a.w, b.x), a.x, b.w);
  out.x = hapi_two_sub(hapi_two_madd(out.x, a.y, b.z), hapi_two_mul(a.z, b.y));
  out.y = hapi_two_sub(hapi_two_mul(a.w, b.y), hapi_two_mul(a.x, b.z));
  out.y = hapi_two_madd(hapi_two_madd(out.y, a.y, b.w), a.z, b.x);
  out.z = hapi_two_madd(hapi_two_mul(a.w, b.z), a.x, b.y);
  out.z = hapi_two_madd(hapi_two_sub(out.z, hapi_two_mul(a.y, b.x)), a.z, b.w);
  return out;
}

static inline void hapi_two_quats_store(hapi_two_quats q, double a[4], double b[4])
{
  hapi_two_split(q.w, &a[0], &b[0]);
  hapi_two_split(q.x, &a[1], &b[1]);
  hapi_two_split(q.y, &a[2], &b[2]);
  hapi_two_split(q.z, &a[3], &b[3]);
}

/* As hapi_quat_normalize. */
static inline void hapi_two_quats_normalize(hapi_two_quats q, double a[4], double b[4])
{
  hapi_two n2 = hapi_two_madd(hapi_two_mul(q.w, q.w), q.x, q.x);
  n2 = hapi_two_madd(hapi_two_madd(n2, q.y, q.y), q.z, q.z);
  hapi_two off = hapi_two_sub(n2, hapi_two_all(1.0));
  double off_a;
  double off_b;
  hapi_two_split(off, &off_a, &off_b);
  if (!(fabs(off_a) < 1e-4 && fabs(off_b) < 1e-4)) {
    hapi_two_quats_store(q, a, b);
    hapi_quat_normalize(a);
    hapi_quat_normalize(b);
    return;
  }
  hapi_two s = hapi_two_sub(hapi_two_all(0.375), hapi_two_mul(hapi_two_all(0.3125), off));
  s = hapi_two_sub(hapi_two_all(0.5), hapi_two_mul(off, s));
  s = hapi_two_sub(hapi_two_all(1.0), hapi_two_mul(off, s));
  q.w = hapi_two_mul(q.w, s);
  q.x = hapi_two_mul(q.x, s);
  q.y = hapi_two_mul(q.y, s);
  q.z = hapi_two_mul(q.z, s);
  hapi_two_quats_store(q, a, b);
}

/* The turns of two hapi_pose_move. */
static inline void hapi_two_turns_move(double quat_a[4], const double w_a[3], double quat_b[4],
                                       const double w_b[3], double seconds)
{
  const hapi_two half = hapi_two_all(0.5 * seconds);
  const hapi_two_quats turn = {hapi_two_all(0.0), hapi_two_of(w_a[0], w_b[0]),
                               hapi_two_of(w_a[1], w_b[1]), hapi_two_of(w_a[2], w_b[2])};
  hapi_two_quats q = hapi_two_quats_load(quat_a, quat_b);
  hapi_two_quats rate = hapi_two_quats_multiply(turn, q);
  q.w = hapi_two_madd(q.w, half, rate.w);
  q.x = hapi_two_madd(q.x, half, rate.x);
  q.y = hapi_two_madd(q.y, half, rate.y);
  q.z = hapi_two_madd(q.z, half, rate.z);
  hapi_two_quats_normalize(q, quat_a, quat_b);
}

#endif
