/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "proximity/direction.h"
#include "proximity/patch_parts.h"

/* Boxes, capsules, cylinders and hulls: the nearest direction first, then faces if one of them
 * stands on it, else edges, else the nearest points themselves. */

/* A face is taken when its normal is within 5 degrees of the nearest direction, or separates as
 * well up to a part of the gap and of the size. */
static const double cos_face = 0.9962;
static const double face_bias = 0.05;
static const double face_bias_size = 1e-4;

typedef struct side {
  hapi_feature face;
  bool taken;
  double cosine;
} side;

typedef struct general {
  const hapi_pair *pair;
  hapi_gjk cores;
  double back[3]; /* -normal */
  double gap;     /* m, of the shapes */
  side a;
  side b;
} general;

static void side_find(const general *g, bool is_a, side *out)
{
  const hapi_pair *pair = g->pair;
  const double *d = is_a ? g->back : g->cores.normal;
  double normal[3];
  out->face.area = out->cosine = 0.0;
  hapi_v3_copy(d, out->face.normal);
  out->taken = hapi_feature_face(is_a ? pair->a : pair->b, d, &out->face);
  if (!out->taken) {
    return;
  }
  out->cosine = hapi_v3_dot(d, out->face.normal);
  hapi_v3_scale(is_a ? -1.0 : 1.0, out->face.normal, normal);
  double slack = face_bias * fabs(g->gap) + face_bias_size * pair->size;
  out->taken = out->cosine > cos_face ||
               hapi_solid_separation(pair->a, pair->b, normal) >= g->cores.distance - slack;
}

/* The face more parallel to the direction is the reference, of equals the larger one, then b's. */
static bool prefer_a(const general *g)
{
  if (!g->a.taken || !g->b.taken) {
    return g->a.taken;
  }
  if (fabs(g->a.cosine - g->b.cosine) > 1e-9) {
    return g->a.cosine > g->b.cosine;
  }
  return g->a.face.area > g->b.face.area * (1.0 + 1e-6);
}

static bool add_faces(const general *g, bool is_a)
{
  const side *fixed = is_a ? &g->a : &g->b;
  double out[3];
  hapi_feature incident;
  if (!fixed->taken) {
    return false;
  }
  hapi_v3_scale(-1.0, fixed->face.normal, out);
  hapi_feature_along(is_a ? g->pair->b : g->pair->a, out, &incident);
  return hapi_patch_add_faces(g->pair, is_a, &fixed->face, &incident);
}

static bool is_polytope(const hapi_solid *solid)
{
  return solid->kind == HAPI_SHAPE_BOX || (solid->kind == HAPI_SHAPE_HULL && solid->ball == 0.0);
}

static bool add_edges(const general *g)
{
  const hapi_pair *pair = g->pair;
  const double *normal = g->cores.normal;
  hapi_edge a;
  hapi_edge b;
  if (!hapi_feature_edge(pair->a, g->back, &a) || !hapi_feature_edge(pair->b, normal, &b)) {
    return false;
  }
  bool round = !is_polytope(pair->a) || !is_polytope(pair->b);
  return hapi_patch_add_edges(pair, &a, &b, normal) ||
         (round && hapi_patch_add_lines(pair, &a, &b, normal));
}

/* Corners, rims: the normal stays on b, right to first order in the motion. What the iteration left
 * between the points across the normal is shared by both. */
static void add_nearest(const general *g)
{
  const hapi_pair *pair = g->pair;
  const hapi_gjk *cores = &g->cores;
  hapi_patch_point p = {.touch = HAPI_TOUCH_FACE_B};
  double middle[3];
  p.ball_a = pair->a->ball;
  p.ball_b = pair->b->ball;
  hapi_v3_copy(cores->normal, p.normal);
  hapi_v3_add(cores->point_a, cores->point_b, middle);
  hapi_v3_scale(0.5, middle, middle);
  hapi_v3_madd(middle, 0.5 * cores->distance, cores->normal, p.core_a);
  hapi_v3_madd(middle, -0.5 * cores->distance, cores->normal, p.core_b);
  hapi_patch_add(pair, &p);
}

/* Faces may leave out what comes nearest: a rim between its corners, a corner beside the face. */
static bool deepest_found(const general *g)
{
  const hapi_patch *patch = g->pair->out;
  double slack = face_bias * fabs(g->gap) + face_bias_size * g->pair->size;
  return patch->count > 0 && patch->points[0].gap <= g->gap + slack;
}

static void add_best(const general *g)
{
  const hapi_pair *pair = g->pair;
  bool a_first = prefer_a(g);
  bool faces = add_faces(g, a_first) || add_faces(g, !a_first);
  if ((faces && deepest_found(g)) || add_edges(g)) {
    return;
  }
  /* Polytopes that are beside each other would push sideways where they should pass. */
  if (g->gap <= 0.0 || !is_polytope(pair->a) || !is_polytope(pair->b)) {
    add_nearest(g);
  }
}

/* Sets what follows from the direction in cores. */
static void look_along(general *g)
{
  g->gap = g->cores.distance - g->pair->a->ball - g->pair->b->ball;
  hapi_v3_scale(-1.0, g->cores.normal, g->back);
  side_find(g, true, &g->a);
  side_find(g, false, &g->b);
}

/* The guess is a face's normal, and what comes nearest along it lies over that face: then no other
 * direction near it separates more, and the long way is not needed. */
static bool guess_is_right(general *g)
{
  static const double same = 1e-12;
  /* cppcheck-suppress ctuuninitvar ; the caller has set the members that are read before they are
   * set */
  const hapi_pair *pair = g->pair;
  look_along(g);
  bool is_a = prefer_a(g);
  const side *fixed = is_a ? &g->a : &g->b;
  if (!fixed->taken || fixed->cosine < 1.0 - same || !add_faces(g, is_a)) {
    return false;
  }
  if (pair->out->points[0].gap <= g->gap + 2e-6 * pair->size) {
    return true;
  }
  pair->out->count = 0;
  return false;
}

bool hapi_patch_general(const hapi_pair *pair)
{
  general g;
  hapi_gjk guess;
  g.pair = pair;
  bool trusted = hapi_patch_guess(pair->a, pair->b, &guess);
  if (guess.distance - pair->a->ball - pair->b->ball > pair->margin) {
    pair->out->apart = guess.distance - pair->a->ball - pair->b->ball;
    return true;
  }
  g.cores = guess;
  if (!trusted || !guess_is_right(&g)) {
    if (!hapi_patch_axis(pair->a, pair->b, &guess, &g.cores)) {
      return false;
    }
    look_along(&g);
    if (g.gap > pair->margin) {
      return true;
    }
    add_best(&g);
  }
  hapi_patch_add_ends(pair);
  return true;
}
