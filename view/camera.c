/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "view/camera.h"

#define HALF_ANGLE_TAN 0.2679F /* 30 degrees from the lower to the upper border */
#define MARGIN 1.12F
#define SUN_REACH 3.0F /* sizes of the scene that have shadows */

static const float side[3] = {-0.36F, -1.0F, 0.47F}; /* from the middle to the eye */

static float float_max(float a, float b)
{
  return a > b ? a : b;
}

static void balls_bound(const camera_ball *balls, size_t count, float middle[3], float *out_size)
{
  float low[3] = {INFINITY, INFINITY, INFINITY};
  float high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      low[k] = fminf(low[k], balls[i].centre[k] - balls[i].radius);
      high[k] = fmaxf(high[k], balls[i].centre[k] + balls[i].radius);
    }
  }
  float half[3];
  for (int k = 0; k < 3; ++k) {
    middle[k] = 0.5F * (low[k] + high[k]);
    half[k] = 0.5F * (high[k] - low[k]);
  }
  *out_size = sqrtf(view_dot(half, half));
}

float camera_bound(const camera_ball *balls, size_t count)
{
  float middle[3];
  float size = 0.1F;
  if (count > 0) {
    balls_bound(balls, count, middle, &size);
  }
  return size;
}

void camera_frame(view_camera *io, const camera_ball *balls, size_t count, float aspect)
{
  static const camera_ball nothing = {{0.0F, 0.0F, 0.0F}, 0.1F};
  float back[3] = {side[0], side[1], side[2]};
  float right[3];
  float up[3];
  float bound;
  if (count == 0) {
    balls = &nothing;
    count = 1;
  }
  balls_bound(balls, count, io->target, &bound);
  view_normalize(back);
  view_cross((const float[3]){0.0F, 0.0F, 1.0F}, back, right);
  view_normalize(right);
  view_cross(back, right, up);
  const float high = HALF_ANGLE_TAN * io->free_share;
  const float wide = HALF_ANGLE_TAN * aspect;
  float distance = 0.0F;
  for (size_t i = 0; i < count; ++i) {
    const float *c = balls[i].centre;
    const float r = balls[i].radius;
    float v[3] = {c[0] - io->target[0], c[1] - io->target[1], c[2] - io->target[2]};
    float near = view_dot(v, back);
    distance = float_max(distance, (fabsf(view_dot(v, right)) + r) / wide + near);
    distance = float_max(distance, (fabsf(view_dot(v, up)) + r) / high + near);
  }
  for (int k = 0; k < 3; ++k) {
    io->eye[k] = io->target[k] + MARGIN * distance * back[k];
  }
  camera_look(io, aspect);
}

/* Undoes turn and projection: the three numbers of a pixel are a direction. */
static view_matrix directions_of(const view_matrix *look, const float scale[2], float shift)
{
  view_matrix out = {{0}};
  for (int k = 0; k < 3; ++k) {
    const float right = look->at[4 * k];
    const float up = look->at[4 * k + 1];
    const float back = look->at[4 * k + 2];
    out.at[k] = right / scale[0];
    out.at[4 + k] = up / scale[1];
    out.at[12 + k] = -back - up * shift / scale[1];
  }
  out.at[15] = 1.0F;
  return out;
}

void camera_look(view_camera *io, float aspect)
{
  const float way[3] = {io->eye[0] - io->target[0], io->eye[1] - io->target[1],
                        io->eye[2] - io->target[2]};
  const float distance = sqrtf(view_dot(way, way));
  const float near = 0.02F * distance;
  const float far = distance + 200.0F * io->size;
  const float scale[2] = {1.0F / (HALF_ANGLE_TAN * aspect), 1.0F / HALF_ANGLE_TAN};
  view_matrix turn = view_look_at(io->eye, io->target);
  view_matrix project = {{0}};
  project.at[0] = scale[0];
  project.at[5] = scale[1];
  project.at[9] = -io->up_share; /* times -depth, over depth: up by that share */
  project.at[10] = -(far + near) / (far - near);
  project.at[11] = -1.0F;
  project.at[14] = -2.0F * far * near / (far - near);
  io->look = view_product(&project, &turn);
  io->back = directions_of(&turn, scale, io->up_share);
}

float camera_sun(const view_camera *camera, const float sun[3], int texels, view_matrix *out)
{
  const float reach = SUN_REACH * camera->size;
  float from[3];
  for (int k = 0; k < 3; ++k) {
    from[k] = camera->target[k] + 2.0F * reach * sun[k];
  }
  view_matrix turn = view_look_at(from, camera->target);
  view_matrix flat = {{0}};
  flat.at[0] = flat.at[5] = 1.0F / reach;
  flat.at[10] = -1.0F / (2.0F * reach);
  flat.at[14] = -1.0F;
  flat.at[15] = 1.0F;
  *out = view_product(&flat, &turn);
  return 2.0F * reach / (float)texels;
}
