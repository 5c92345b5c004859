/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <ctype.h>
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "import/mjcf_internal.h"

/* The ways to say where something is. */

static void turn_about(const double axis[3], double angle, double out[4])
{
  out[0] = cos(0.5 * angle);
  hapi_v3_scale(sin(0.5 * angle), axis, out + 1);
}

void mjcf_turn_z(const double direction[3], double out_quat[4])
{
  static const double z[3] = {0.0, 0.0, 1.0};
  double axis[3];
  double v[3];
  hapi_v3_scale(1.0 / hapi_v3_norm(direction), direction, v);
  hapi_v3_cross(z, v, axis);
  double sine = hapi_v3_norm(axis);
  if (sine < 1e-10) {
    hapi_v3_set(axis, 1.0, 0.0, 0.0);
  } else {
    hapi_v3_scale(1.0 / sine, axis, axis);
  }
  turn_about(axis, atan2(sine, v[2]), out_quat);
}

void mjcf_turn_euler(const mjcf *m, const double angles[3], double out_quat[4])
{
  memcpy(out_quat, ((const double[4]){1.0, 0.0, 0.0, 0.0}), 4 * sizeof *out_quat);
  for (int i = 0; i < 3; ++i) {
    const char letter = m->compiler.euler_sequence[i];
    const int k = tolower((unsigned char)letter) - 'x';
    double axis[3] = {k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0, k == 2 ? 1.0 : 0.0};
    double turn[4];
    turn_about(axis, angles[i] * m->compiler.angle, turn);
    if (islower((unsigned char)letter)) { /* about axes that turn along */
      hapi_quat_multiply(out_quat, turn, out_quat);
    } else {
      hapi_quat_multiply(turn, out_quat, out_quat);
    }
  }
}

static void turn_axes(const double x_in[3], const double y_in[3], double out[4])
{
  double x[3];
  double y[3];
  double z[3];
  hapi_v3_scale(1.0 / hapi_v3_norm(x_in), x_in, x);
  hapi_v3_madd(y_in, -hapi_v3_dot(x, y_in), x, y);
  hapi_v3_scale(1.0 / hapi_v3_norm(y), y, y);
  hapi_v3_cross(x, y, z);
  /* The largest of the four by its square, the others by products with it. */
  const double square[4] = {1.0 + x[0] + y[1] + z[2], 1.0 + x[0] - y[1] - z[2],
                            1.0 - x[0] + y[1] - z[2], 1.0 - x[0] - y[1] + z[2]};
  const double rows[4][4] = {{square[0], y[2] - z[1], z[0] - x[2], x[1] - y[0]},
                             {y[2] - z[1], square[1], x[1] + y[0], z[0] + x[2]},
                             {z[0] - x[2], x[1] + y[0], square[2], y[2] + z[1]},
                             {x[1] - y[0], z[0] + x[2], y[2] + z[1], square[3]}};
  int best = 0;
  for (int i = 1; i < 4; ++i) {
    best = square[i] > square[best] ? i : best;
  }
  memcpy(out, rows[best], 4 * sizeof *out);
  hapi_quat_normalize(out);
}

static hap_status no_direction(const mjcf *m, const mjcf_item *item, const char *name)
{
  return import_refuse(m->work, item->element->at, "%s: has no direction", name);
}

static hap_status axes_read(mjcf *m, const mjcf_item *item, double out[4])
{
  double axes[6];
  double across[3];
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "xyaxes", XML_OF(6, 6), axes, &count));
  if (count == 0) {
    return HAP_OK;
  }
  hapi_v3_cross(axes, axes + 3, across);
  if (!(hapi_v3_norm(across) > 1e-12)) {
    return no_direction(m, item, "xyaxes");
  }
  turn_axes(axes, axes + 3, out);
  return HAP_OK;
}

static hap_status turn_read(mjcf *m, const mjcf_item *item, double out[4])
{
  double v[4];
  size_t count;
  HAPI_TRY(mjcf_numbers(m, item, "quat", XML_OF(4, 4), out, &count));
  if (!(out[0] * out[0] + hapi_v3_dot(out + 1, out + 1) > 1e-24)) {
    return no_direction(m, item, "quat");
  }
  hapi_quat_normalize(out);
  HAPI_TRY(mjcf_numbers(m, item, "axisangle", XML_OF(4, 4), v, &count));
  if (count > 0) {
    double length = hapi_v3_norm(v);
    if (!(length > 1e-12)) {
      return no_direction(m, item, "axisangle");
    }
    hapi_v3_scale(1.0 / length, v, v);
    turn_about(v, v[3] * m->compiler.angle, out);
  }
  HAPI_TRY(axes_read(m, item, out));
  HAPI_TRY(mjcf_numbers(m, item, "zaxis", XML_OF(3, 3), v, &count));
  if (count > 0) {
    if (!(hapi_v3_norm(v) > 1e-12)) {
      return no_direction(m, item, "zaxis");
    }
    mjcf_turn_z(v, out);
  }
  HAPI_TRY(mjcf_numbers(m, item, "euler", XML_OF(3, 3), v, &count));
  if (count > 0) {
    mjcf_turn_euler(m, v, out);
  }
  return HAP_OK;
}

hap_status mjcf_pose(mjcf *m, const mjcf_item *item, hap_pose *out)
{
  size_t count;
  *out = (hap_pose){.quat_wxyz = {1.0, 0.0, 0.0, 0.0}};
  HAPI_TRY(mjcf_numbers(m, item, "pos", XML_OF(3, 3), out->position, &count));
  return turn_read(m, item, out->quat_wxyz);
}
