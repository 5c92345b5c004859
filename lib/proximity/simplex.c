/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/simplex.h"

#include "base/assert.h"
#include "base/vec.h"

/* Every sub-simplex that can hold the nearest point is tried and the least distance wins. Slower
 * than a walk by Voronoi regions, but no sign error in a flat simplex can lead to a wrong region:
 * each candidate is a point of the simplex. */

typedef struct candidate {
  int count;
  int index[3];
  double weight[3];
  double point[3];
  double norm2;
} candidate;

/* The sum goes by edges from the first vertex: small edges then lose no digits to the large
 * coordinates they stand at. */
static void weighted_sum(const double base[3], const double *tips[2], const double weight[3],
                         int count, double out[3])
{
  double sum[3] = {0.0, 0.0, 0.0};
  double edge[3];
  for (int i = 1; i < count && i < 3; ++i) {
    hapi_v3_sub(tips[i - 1], base, edge);
    hapi_v3_madd(sum, weight[i], edge, sum);
  }
  hapi_v3_add(base, sum, out);
}

static void candidate_consider(const hapi_simplex *s, candidate *found, candidate *best)
{
  HAPI_ASSERT(found->count >= 1 && found->count <= 3);
  const double *tips[2] = {s->vertex[found->index[1]].gap, s->vertex[found->index[2]].gap};
  weighted_sum(s->vertex[found->index[0]].gap, tips, found->weight, found->count, found->point);
  found->norm2 = hapi_v3_dot(found->point, found->point);
  if (best->count == 0 || found->norm2 < best->norm2) {
    *best = *found;
  }
}

static void try_vertex(const hapi_simplex *s, int i, candidate *best)
{
  candidate found = {.count = 1, .index = {i, i, i}, .weight = {1.0, 0.0, 0.0}};
  candidate_consider(s, &found, best);
}

static void try_edge(const hapi_simplex *s, int i, int j, candidate *best)
{
  double edge[3];
  hapi_v3_sub(s->vertex[j].gap, s->vertex[i].gap, edge);
  double along = -hapi_v3_dot(s->vertex[i].gap, edge);
  double length2 = hapi_v3_dot(edge, edge);
  if (along > 0.0 && along < length2) {
    double t = along / length2;
    candidate found = {.count = 2, .index = {i, j, i}, .weight = {1.0 - t, t, 0.0}};
    candidate_consider(s, &found, best);
  } else {
    try_vertex(s, along > 0.0 ? j : i, best);
  }
}

static void try_face(const hapi_simplex *s, const int v[3], candidate *best)
{
  const double *origin = s->vertex[v[0]].gap;
  double to_1[3];
  double to_2[3];
  double normal[3];
  double part[3];
  hapi_v3_sub(s->vertex[v[1]].gap, origin, to_1);
  hapi_v3_sub(s->vertex[v[2]].gap, origin, to_2);
  hapi_v3_cross(to_1, to_2, normal);
  double area2 = hapi_v3_dot(normal, normal);
  hapi_v3_cross(to_2, origin, part);
  double weight_1 = hapi_v3_dot(part, normal);
  hapi_v3_cross(origin, to_1, part);
  double weight_2 = hapi_v3_dot(part, normal);
  if (weight_1 > 0.0 && weight_2 > 0.0 && weight_1 + weight_2 < area2) {
    double w[2] = {weight_1 / area2, weight_2 / area2};
    candidate found = {
        .count = 3, .index = {v[0], v[1], v[2]}, .weight = {1.0 - w[0] - w[1], w[0], w[1]}};
    candidate_consider(s, &found, best);
  }
  /* Also when the face took it: for a sliver the weights may be noise. */
  try_edge(s, v[0], v[1], best);
  try_edge(s, v[0], v[2], best);
  try_edge(s, v[1], v[2], best);
}

/* Whether the origin is certainly on the side of a face where the fourth vertex is. */
static bool face_hides_origin(const hapi_simplex *s, const int v[3], int opposite)
{
  double to_1[3];
  double to_2[3];
  double to_opposite[3];
  double normal[3];
  hapi_v3_sub(s->vertex[v[1]].gap, s->vertex[v[0]].gap, to_1);
  hapi_v3_sub(s->vertex[v[2]].gap, s->vertex[v[0]].gap, to_2);
  hapi_v3_sub(s->vertex[opposite].gap, s->vertex[v[0]].gap, to_opposite);
  hapi_v3_cross(to_1, to_2, normal);
  double height = hapi_v3_dot(normal, to_opposite);
  double origin = -hapi_v3_dot(normal, s->vertex[v[0]].gap);
  double flat = 1e-14 * hapi_v3_norm(normal) * hapi_v3_norm(to_opposite);
  return fabs(height) > flat && (height > 0.0 ? origin > 0.0 : origin < 0.0);
}

static bool solid_holds_origin(const hapi_simplex *s, candidate *best)
{
  static const int faces[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
  static const int opposite[4] = {3, 2, 1, 0};
  bool outside = false;
  for (int i = 0; i < 4; ++i) {
    if (!face_hides_origin(s, faces[i], opposite[i])) {
      outside = true;
      try_face(s, faces[i], best);
    }
  }
  return !outside;
}

bool hapi_simplex_reduce(hapi_simplex *simplex, double out_nearest[3])
{
  HAPI_ASSERT(simplex->count >= 1 && simplex->count <= 4);
  static const int face[3] = {0, 1, 2};
  candidate best = {.count = 0};
  if (simplex->count == 1) {
    try_vertex(simplex, 0, &best);
  } else if (simplex->count == 2) {
    try_edge(simplex, 0, 1, &best);
  } else if (simplex->count == 3) {
    try_face(simplex, face, &best);
  } else if (solid_holds_origin(simplex, &best)) {
    return false;
  }
  HAPI_ASSERT(best.count >= 1 && best.count <= simplex->count);
  hapi_simplex kept = {.count = best.count};
  for (int i = 0; i < best.count; ++i) {
    kept.vertex[i] = simplex->vertex[best.index[i]];
    kept.vertex[i].weight = best.weight[i];
  }
  *simplex = kept;
  hapi_v3_copy(best.point, out_nearest);
  return true;
}

void hapi_simplex_witness(const hapi_simplex *simplex, double out_a[3], double out_b[3])
{
  HAPI_ASSERT(simplex->count >= 1 && simplex->count <= 3);
  const hapi_vertex *v = simplex->vertex;
  double weight[3] = {v[0].weight, v[1].weight, v[2].weight};
  const double *tips_a[2] = {v[1].a, v[2].a};
  const double *tips_b[2] = {v[1].b, v[2].b};
  weighted_sum(v[0].a, tips_a, weight, simplex->count, out_a);
  weighted_sum(v[0].b, tips_b, weight, simplex->count, out_b);
}
