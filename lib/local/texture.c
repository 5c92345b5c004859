/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/texture.h"

#include <math.h>

#include "base/assert.h"
#include "base/safety.h"
#include "base/vec.h"

/* Between samples a relief is a cubic (Catmull and Rom): its height and slope have no steps. A
 * function has its slope by differences over 2 x DIFFERENCE. */

#define DIFFERENCE 1e-5 /* m */

typedef struct spline {
  double weights[4];
  double slopes[4];
  uint32_t at[4]; /* of the samples */
} spline;

static uint32_t sample_at(int64_t i, uint32_t count, bool repeats)
{
  int64_t n = (int64_t)count;
  if (repeats) {
    return (uint32_t)(((i % n) + n) % n);
  }
  return (uint32_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
}

/* x in samples. */
static void spline_set(double x, uint32_t count, bool repeats, spline *out)
{
  double whole = floor(x);
  double t = x - whole;
  int64_t first = (int64_t)whole - 1;
  double t2 = t * t;
  double t3 = t2 * t;
  const double weights[4] = {-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0,
                             -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2};
  const double slopes[4] = {-1.5 * t2 + 2.0 * t - 0.5, 4.5 * t2 - 5.0 * t,
                            -4.5 * t2 + 4.0 * t + 0.5, 1.5 * t2 - t};
  for (int i = 0; i < 4; ++i) {
    out->weights[i] = weights[i];
    out->slopes[i] = slopes[i];
    out->at[i] = sample_at(first + i, count, repeats);
  }
}

static double patch_height(const hapi_texture *t, const double point[3], double out_slope[3])
{
  double from[3];
  spline u;
  spline v;
  double height = 0.0;
  double du = 0.0;
  double dv = 0.0;
  hapi_v3_sub(point, t->origin, from);
  spline_set(t->per_m * hapi_v3_dot(from, t->along[0]), t->columns, t->repeats != 0, &u);
  spline_set(t->per_m * hapi_v3_dot(from, t->along[1]), t->rows, t->repeats != 0, &v);
  for (int j = 0; j < 4; ++j) {
    const double *row = t->heights + (size_t)v.at[j] * t->columns;
    double sum = 0.0;
    double rise = 0.0;
    for (int i = 0; i < 4; ++i) {
      HAPI_ASSERT_INDEX(u.at[i], t->columns);
      sum += u.weights[i] * row[u.at[i]];
      rise += u.slopes[i] * row[u.at[i]];
    }
    height += v.weights[j] * sum;
    du += v.weights[j] * rise;
    dv += v.slopes[j] * sum;
  }
  hapi_v3_scale(t->per_m * du, t->along[0], out_slope);
  hapi_v3_madd(out_slope, t->per_m * dv, t->along[1], out_slope);
  return height;
}

/* What is beyond the bound is flat; NaN stays, and is the guard's. */
static double height_bound(double height)
{
  const double most = HAPI_SAFETY_TEXTURE_HEIGHT;
  return height > most ? most : height < -most ? -most : height;
}

void hapi_texture_tangents(const double normal[3], double out[2][3])
{
  int least = fabs(normal[0]) < 0.6 ? 0 : 1;
  double any[3] = {0.0, 0.0, 0.0};
  any[least] = 1.0;
  hapi_v3_cross(normal, any, out[0]);
  hapi_v3_scale(1.0 / hapi_v3_norm(out[0]), out[0], out[0]);
  hapi_v3_cross(normal, out[0], out[1]);
}

static double height_beside(const hapi_texture *t, const double point[3], double way,
                            const double direction[3])
{
  double beside[3];
  hapi_v3_madd(point, way, direction, beside);
  return height_bound(t->height(t->arg, beside));
}

static double function_height(const hapi_texture *t, const double point[3], const double normal[3],
                              double out_slope[3])
{
  double along[2][3];
  hapi_texture_tangents(normal, along);
  hapi_v3_set(out_slope, 0.0, 0.0, 0.0);
  for (int i = 0; i < 2; ++i) {
    double change = height_beside(t, point, DIFFERENCE, along[i]) -
                    height_beside(t, point, -DIFFERENCE, along[i]);
    hapi_v3_madd(out_slope, change / (2.0 * DIFFERENCE), along[i], out_slope);
  }
  return height_bound(t->height(t->arg, point));
}

double hapi_texture_height(const hapi_texture *t, const double point[3], const double normal[3],
                           double out_slope[3])
{
  return t->heights != NULL ? patch_height(t, point, out_slope)
                            : function_height(t, point, normal, out_slope);
}

int64_t hapi_texture_begin(const hapi_texture_calls *calls, const hapi_texture *t)
{
  return t->heights == NULL && calls->clock != NULL ? calls->clock() : 0;
}

void hapi_texture_end(hapi_texture_calls *calls, const hapi_texture *t, uint32_t number,
                      int64_t begin_ns)
{
  HAPI_ASSERT_INDEX(number - 1, HAPI_TEXTURES);
  if (t->heights == NULL && calls->clock != NULL) {
    uint64_t bit = hapi_texture_bit(number);
    int64_t before_ns = (calls->called & bit) != 0 ? calls->spent_ns[number - 1] : 0;
    calls->spent_ns[number - 1] = before_ns + (calls->clock() - begin_ns);
    calls->called |= bit;
  }
}
