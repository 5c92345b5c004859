/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/gjk.h"

#include "base/assert.h"
#include "proximity/direction.h"
#include "proximity/simplex.h"

enum {
  ITERATIONS_MAX = 200 /* polytopes need about 10, two cylinders about 40 */
};

typedef struct search {
  const hapi_solid *a;
  const hapi_solid *b;
  hapi_simplex simplex;
  double nearest[3]; /* of the simplex */
  double size;       /* m, no gap vector is longer */
  bool apart;        /* a support plane has separated the cores */
} search;

/* The point of a - b farthest against the direction. */
static void vertex_find(const search *s, const double direction[3], hapi_vertex *out)
{
  double against[3];
  hapi_v3_scale(-1.0, direction, against);
  hapi_solid_support(s->a, against, out->a);
  hapi_solid_support(s->b, direction, out->b);
  hapi_v3_sub(out->a, out->b, out->gap);
  out->weight = 1.0;
}

/* Notes when the support plane at the vertex lies between the cores; returns how far it is off. */
static double bound_from(search *s, const double direction[3], const hapi_vertex *vertex)
{
  double bound = hapi_v3_dot(direction, vertex->gap) / hapi_v3_norm(direction);
  s->apart = s->apart || bound > 1e-13 * s->size;
  return bound;
}

static void search_start(search *s, const double *start)
{
  static const double any[3] = {1.0, 0.0, 0.0};
  double away[3];
  hapi_v3_sub(s->a->inside, s->b->inside, away);
  s->size = hapi_v3_norm(away) + 2.0 * (s->a->reach + s->b->reach);
  bool coincident = !(hapi_v3_norm(away) > 0.0);
  const double *direction = start != NULL ? start : coincident ? any : away;
  vertex_find(s, direction, &s->simplex.vertex[0]);
  bound_from(s, direction, &s->simplex.vertex[0]);
  s->simplex.count = 1;
  hapi_v3_copy(s->simplex.vertex[0].gap, s->nearest);
}

static bool simplex_has(const hapi_simplex *simplex, const hapi_vertex *vertex)
{
  bool found = false;
  for (int i = 0; i < simplex->count; ++i) {
    found = found || memcmp(simplex->vertex[i].gap, vertex->gap, sizeof vertex->gap) == 0;
  }
  return found;
}

/* Takes the simplex when it comes nearer. */
static bool simplex_accept(search *s, hapi_simplex *grown)
{
  double nearest[3];
  if (!hapi_simplex_reduce(grown, nearest) || hapi_v3_norm(nearest) >= hapi_v3_norm(s->nearest)) {
    return false;
  }
  s->simplex = *grown;
  hapi_v3_copy(nearest, s->nearest);
  return true;
}

/* Adds a vertex. False: doubles give no better answer, because the bound from below (the support
 * plane) has reached the distance, or rounding keeps the distance from falling. The bound is held
 * far below the 1e-10 wanted of the distance: the error of the direction is its root. */
static bool search_step(search *s)
{
  double distance = hapi_v3_norm(s->nearest);
  if (distance <= 1e-13 * s->size) {
    s->apart = false;
    return false;
  }
  hapi_vertex newest;
  vertex_find(s, s->nearest, &newest);
  double bound = bound_from(s, s->nearest, &newest);
  if (distance - bound <= 1e-15 * s->size) {
    return false;
  }
  hapi_simplex grown = s->simplex;
  HAPI_ASSERT(s->simplex.count < 4);
  grown.vertex[grown.count++] = newest;
  if (!simplex_has(&s->simplex, &newest) && simplex_accept(s, &grown)) {
    return true;
  }
  if (!s->apart) {
    return false;
  }
  /* The nearest point as a vertex of its own, for it is a point of a - b like the others, and
   * the newest one. On a rim the vertices crowd until a face of them has no normal in doubles
   * (at 1e-4 of the radius); a line to the newest vertex still leads nearer. */
  hapi_vertex merged = {.weight = 1.0};
  hapi_simplex_witness(&s->simplex, merged.a, merged.b);
  hapi_v3_sub(merged.a, merged.b, merged.gap);
  grown = (hapi_simplex){.vertex = {merged, newest}, .count = 2};
  return simplex_accept(s, &grown);
}

bool hapi_gjk_nearest(const hapi_solid *a, const hapi_solid *b, const double *start, hapi_gjk *out)
{
  HAPI_ASSERT(a->kind != HAPI_SHAPE_PLANE && b->kind != HAPI_SHAPE_PLANE);
  search s = {.a = a, .b = b};
  search_start(&s, start);
  hapi_simplex_reduce(&s.simplex, s.nearest);
  out->iterations = 1;
  while (search_step(&s) && out->iterations < ITERATIONS_MAX) {
    ++out->iterations;
  }
  hapi_v3_set(out->normal, 0.0, 0.0, 1.0);
  out->distance = hapi_v3_unit(s.nearest, out->normal);
  HAPI_ASSERT_UNIT(out->normal);
  hapi_simplex_witness(&s.simplex, out->point_a, out->point_b);
  return s.apart;
}

bool hapi_gjk_shifted(const hapi_solid *a, const hapi_solid *b, const double normal[3],
                      double shift, hapi_gjk *out)
{
  HAPI_ASSERT_UNIT(normal);
  double way[3];
  hapi_solid moved = *a;
  hapi_v3_scale(shift, normal, way);
  hapi_v3_add(moved.center, way, moved.center);
  hapi_v3_add(moved.inside, way, moved.inside);
  if (!hapi_gjk_nearest(&moved, b, normal, out)) {
    return false;
  }
  hapi_v3_sub(out->point_a, way, out->point_a);
  return true;
}
