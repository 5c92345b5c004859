/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_VIEW_VIEW_MATH_H
#define HAPODE_VIEW_VIEW_MATH_H

/* Vectors and matrices of the viewer, in float as the GPU has them. Matrices are by columns. */

#include <math.h>
#include <string.h>

#include <hapode/spatial.h>

typedef struct view_matrix {
  float at[16]; /* at[4 * column + row] */
} view_matrix;

static inline float view_dot(const float a[3], const float b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void view_cross(const float a[3], const float b[3], float out[3])
{
  float c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  memcpy(out, c, sizeof c);
}

/* A vector of length 0 stays. */
static inline void view_normalize(float io[3])
{
  float length = sqrtf(view_dot(io, io));
  for (int i = 0; i < 3 && length > 0.0F; ++i) {
    io[i] /= length;
  }
}

static inline void view_rotate(const float q[4], const float v[3], float out[3])
{
  float twice[3];
  float across[3];
  view_cross(&q[1], v, twice);
  for (int i = 0; i < 3; ++i) {
    twice[i] *= 2.0F;
  }
  view_cross(&q[1], twice, across);
  for (int i = 0; i < 3; ++i) {
    out[i] = v[i] + q[0] * twice[i] + across[i];
  }
}

/* A point of a frame, in the world. */
static inline void view_transform(const hap_pose *frame, const double point[3], float out[3])
{
  float q[4];
  float v[3];
  for (int i = 0; i < 4; ++i) {
    q[i] = (float)frame->quat_wxyz[i];
  }
  for (int i = 0; i < 3; ++i) {
    v[i] = (float)point[i];
  }
  view_rotate(q, v, out);
  for (int i = 0; i < 3; ++i) {
    out[i] += (float)frame->position[i];
  }
}

static inline void view_quat_product(const double a[4], const double b[4], float out[4])
{
  out[0] = (float)(a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]);
  out[1] = (float)(a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]);
  out[2] = (float)(a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]);
  out[3] = (float)(a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]);
}

/* The shortest turn that takes z to a unit vector. */
static inline void view_quat_from_z(const float to[3], float out[4])
{
  float w = 1.0F + to[2];
  if (w < 1e-6F) {
    memcpy(out, ((const float[4]){0.0F, 1.0F, 0.0F, 0.0F}), 4 * sizeof(float));
    return;
  }
  float length = sqrtf(w * w + to[0] * to[0] + to[1] * to[1]);
  out[0] = w / length;
  out[1] = -to[1] / length;
  out[2] = to[0] / length;
  out[3] = 0.0F;
}

static inline view_matrix view_product(const view_matrix *a, const view_matrix *b)
{
  view_matrix out;
  for (int c = 0; c < 4; ++c) {
    for (int r = 0; r < 4; ++r) {
      float sum = 0.0F;
      for (int k = 0; k < 4; ++k) {
        sum += a->at[4 * k + r] * b->at[4 * c + k];
      }
      out.at[4 * c + r] = sum;
    }
  }
  return out;
}

/* World to the frame of an eye that looks along -z, with y up. */
static inline view_matrix view_look_at(const float eye[3], const float target[3])
{
  float back[3] = {eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]};
  float right[3];
  float up[3];
  view_normalize(back);
  const float steep = fabsf(back[2]) > 0.999F ? 1.0F : 0.0F;
  const float reference[3] = {0.0F, steep, 1.0F - steep};
  view_cross(reference, back, right);
  view_normalize(right);
  view_cross(back, right, up);
  view_matrix out = {{right[0], up[0], back[0], 0.0F, right[1], up[1], back[1], 0.0F, right[2],
                      up[2], back[2], 0.0F, -view_dot(right, eye), -view_dot(up, eye),
                      -view_dot(back, eye), 1.0F}};
  return out;
}

#endif
