/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <float.h>

#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* Separating axes: of two boxes one of 15 directions has the largest separation or the least
 * depth: the normals of the faces and the cross products of the edges. Gottschalk, Lin, Manocha,
 * "OBBTree: a hierarchical structure for rapid interference detection", 1996. */

/* An edge axis must beat the faces by this part of the depth and this part of the size: a patch of
 * faces is the steadier answer. The face of b must be beaten by less, to break ties the same way
 * each time. */
static const double edge_bias = 0.05;
static const double edge_bias_size = 1e-5;
static const double tie_bias = 0.005;
static const double tie_bias_size = 1e-4;

/* Edge axes nearer than 5 degrees to a face normal give way to the faces, whose clipping finds the
 * crossing of the edges as well. */
static const double cos_face = 0.9962;

typedef struct sat {
  const hapi_solid *a;
  const hapi_solid *b;
  double dot[3][3]; /* axes of a by axes of b */
  double size[3][3];
  double along_a[3]; /* centre of b to centre of a, along the axes of a */
  double along_b[3];
  double face[2]; /* m, largest separation of the faces of a, b */
  int axis[2];
  double edge; /* m, largest separation of edges */
  int edge_a;  /* -1: none that counts */
  int edge_b;
} sat;

static void sat_start(sat *s, const hapi_solid *a, const hapi_solid *b)
{
  double between[3];
  s->a = a;
  s->b = b;
  hapi_v3_sub(a->center, b->center, between);
  hapi_solid_to_local(a, between, s->along_a);
  hapi_solid_to_local(b, between, s->along_b);
  const double *u = a->rotation;
  const double *v = b->rotation;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      s->dot[i][k] = u[i] * v[k] + u[3 + i] * v[3 + k] + u[6 + i] * v[6 + k];
      s->size[i][k] = fabs(s->dot[i][k]);
    }
  }
}

static void sat_faces(sat *s)
{
  const double *h = s->a->half;
  const double *g = s->b->half;
  s->face[0] = s->face[1] = -DBL_MAX;
  for (int i = 0; i < 3; ++i) {
    const double *r = s->size[i];
    double of_a = fabs(s->along_a[i]) - h[i] - g[0] * r[0] - g[1] * r[1] - g[2] * r[2];
    double of_b = fabs(s->along_b[i]) - g[i] - h[0] * s->size[0][i] - h[1] * s->size[1][i] -
                  h[2] * s->size[2][i];
    if (of_a > s->face[0]) {
      s->face[0] = of_a;
      s->axis[0] = i;
    }
    if (of_b > s->face[1]) {
      s->face[1] = of_b;
      s->axis[1] = i;
    }
  }
}

/* Separation along the cross product of two edges, times its length. */
static double edge_numerator(const sat *s, int i, int k)
{
  static const int after[3] = {1, 2, 0};
  int i1 = after[i];
  int i2 = after[i1];
  int k1 = after[k];
  int k2 = after[k1];
  double offset = s->along_a[i2] * s->dot[i1][k] - s->along_a[i1] * s->dot[i2][k];
  double of_a = s->a->half[i1] * s->size[i2][k] + s->a->half[i2] * s->size[i1][k];
  double of_b = s->b->half[k1] * s->size[i][k2] + s->b->half[k2] * s->size[i][k1];
  return fabs(offset) - of_a - of_b;
}

/* best: what the faces have, with the bias. A numerator below it and zero needs no root. */
static void sat_edges(sat *s, double best)
{
  s->edge_a = s->edge_b = -1;
  s->edge = best;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      double numerator = edge_numerator(s, i, k);
      double sine2 = 1.0 - s->dot[i][k] * s->dot[i][k];
      if ((numerator <= 0.0 && numerator <= s->edge) || sine2 < 1e-6) {
        continue;
      }
      double separation = numerator / sqrt(sine2);
      if (separation > s->edge) {
        s->edge = separation;
        s->edge_a = i;
        s->edge_b = k;
      }
    }
  }
}

/* --- patches ---------------------------------------------------------------------------------- */

/* Area of a face of a box, for ties: the larger face is the reference. */
static double face_area(const hapi_solid *box, int axis)
{
  return box->half[(axis + 1) % 3] * box->half[(axis + 2) % 3];
}

static bool larger_is_a(const sat *s, int axis_a, int axis_b)
{
  return face_area(s->a, axis_a) > face_area(s->b, axis_b) * (1.0 + 1e-9);
}

static bool reference_is_a(const sat *s, double size)
{
  double slack = tie_bias * fabs(s->face[1]) + tie_bias_size * size;
  if (fabs(s->face[0] - s->face[1]) <= slack) {
    return larger_is_a(s, s->axis[0], s->axis[1]);
  }
  return s->face[0] > s->face[1];
}

/* The face of one box that looks at the other along one of its axes is the reference. */
static bool add_faces(const hapi_pair *pair, const sat *s, bool is_a, int axis)
{
  const hapi_solid *fixed = is_a ? s->a : s->b;
  const hapi_solid *moving = is_a ? s->b : s->a;
  double along = is_a ? -s->along_a[axis] : s->along_b[axis];
  double out[3];
  hapi_feature reference;
  hapi_feature incident;
  hapi_solid_axis(fixed, axis, out);
  hapi_v3_scale(along < 0.0 ? -1.0 : 1.0, out, out);
  hapi_feature_face(fixed, out, &reference);
  hapi_v3_scale(-1.0, out, out);
  hapi_feature_face(moving, out, &incident);
  return hapi_patch_add_faces(pair, is_a, &reference, &incident);
}

static void support_edge(const hapi_solid *box, int axis, const double d[3], hapi_edge *out)
{
  double middle[3];
  hapi_solid_to_local(box, d, middle);
  for (int i = 0; i < 3; ++i) {
    middle[i] = middle[i] < 0.0 ? -box->half[i] : box->half[i];
  }
  middle[axis] = 0.0;
  *out = (hapi_edge){.half = box->half[axis]};
  hapi_solid_to_world(box, middle, out->middle);
  hapi_v3_add(box->center, out->middle, out->middle);
  hapi_solid_axis(box, axis, out->direction);
}

static bool add_edges(const hapi_pair *pair, const sat *s, const double normal[3])
{
  double back[3];
  hapi_edge edge_a;
  hapi_edge edge_b;
  hapi_v3_scale(-1.0, normal, back);
  support_edge(s->a, s->edge_a, back, &edge_a);
  support_edge(s->b, s->edge_b, normal, &edge_b);
  return hapi_patch_add_edges(pair, &edge_a, &edge_b, normal);
}

/* The axis most along the normal; its cosine. */
static double nearest_axis(const hapi_solid *box, const double normal[3], int *out_axis)
{
  double local[3];
  hapi_solid_to_local(box, normal, local);
  int k = fabs(local[1]) > fabs(local[0]) ? 1 : 0;
  *out_axis = fabs(local[2]) > fabs(local[k]) ? 2 : k;
  return fabs(local[*out_axis]);
}

/* Two faces that are both near are a tie. */
static bool add_faces_near(const hapi_pair *pair, const sat *s, const double normal[3])
{
  int axis_a;
  int axis_b;
  double cos_a = nearest_axis(s->a, normal, &axis_a);
  double cos_b = nearest_axis(s->b, normal, &axis_b);
  if (fmax(cos_a, cos_b) < cos_face) {
    return false;
  }
  bool is_a = fmin(cos_a, cos_b) < cos_face ? cos_a > cos_b : larger_is_a(s, axis_a, axis_b);
  return add_faces(pair, s, is_a, is_a ? axis_a : axis_b);
}

/* The faces, if the edges are nearly in them, and the edges, if the faces leave them out. */
static bool add_edges_or_near(const hapi_pair *pair, const sat *s, const double normal[3])
{
  bool faces = add_faces_near(pair, s, normal);
  double slack = edge_bias * fabs(s->edge) + edge_bias_size * pair->size;
  if (faces && pair->out->points[0].gap <= s->edge + slack) {
    return true;
  }
  return add_edges(pair, s, normal) || faces;
}

bool hapi_patch_boxes(const hapi_pair *pair)
{
  sat s;
  sat_start(&s, pair->a, pair->b);
  sat_faces(&s);
  double best = fmax(s.face[0], s.face[1]);
  if (best > pair->margin) {
    pair->out->apart = best;
    return true;
  }
  double depth = fmax(0.0, -best);
  sat_edges(&s, best + edge_bias * depth + edge_bias_size * pair->size);
  if (s.edge_a >= 0) {
    double normal[3];
    /* Unit, from b to a. */
    double between[3];
    double u[3];
    double v[3];
    hapi_solid_axis(s.a, s.edge_a, u);
    hapi_solid_axis(s.b, s.edge_b, v);
    hapi_v3_cross(u, v, normal);
    hapi_v3_unit(normal, normal);
    hapi_v3_sub(s.a->center, s.b->center, between);
    if (hapi_v3_dot(between, normal) < 0.0) {
      hapi_v3_scale(-1.0, normal, normal);
    }
    if (s.edge > pair->margin) {
      pair->out->apart = s.edge;
      return true;
    }
    if (add_edges_or_near(pair, &s, normal)) {
      return true;
    }
  }
  bool is_a = reference_is_a(&s, pair->size);
  add_faces(pair, &s, is_a, s.axis[!is_a]);
  return true;
}
