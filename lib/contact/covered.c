/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/covered.h"

#include "base/alloc.h"
#include "base/vec.h"

#define AHEAD 1e-3 /* m, before a side: what covers it is there, and what slides sinks in by less */
#define STEP 1e-4  /* m, between two surfaces, that is none: as of seams under a pointer */

bool hapi_covered_create(hapi_covered *covered, const hapi_capacity *capacity)
{
  covered->next = hapi_alloc_array(capacity->pairs, sizeof *covered->next);
  return covered->next != NULL && hapi_index_reserve(&covered->firsts, capacity->pairs);
}

void hapi_covered_finish(hapi_covered *covered)
{
  hapi_free(covered->next);
  hapi_index_finish(&covered->firsts);
}

static uint32_t body_of(const hapi_places *places, const hapi_kept_pair *pair, int side)
{
  return hapi_near_geoms(places->near)[pair->geoms[side]].body;
}

static uint64_t bodies_of(const hapi_places *places, const hapi_kept_pair *pair)
{
  uint64_t a = body_of(places, pair, 0);
  uint64_t b = body_of(places, pair, 1);
  return a < b ? a << 32 | b : b << 32 | a;
}

void hapi_covered_take_near(hapi_covered *covered, const hapi_places *places, const hapi_kept *kept)
{
  for (uint32_t i = 0; i < kept->count; ++i) {
    uint64_t bodies = bodies_of(places, &kept->pairs[i]);
    uint32_t first = hapi_index_get(&covered->firsts, bodies);
    covered->next[i] = i;
    if (first == HAPI_INDEX_NONE) {
      hapi_index_put(&covered->firsts, bodies, i);
    } else {
      covered->next[i] = covered->next[first];
      covered->next[first] = i;
    }
  }
  for (uint32_t i = 0; i < kept->count; ++i) { /* a few of many places: no clear */
    hapi_index_remove(&covered->firsts, bodies_of(places, &kept->pairs[i]));
  }
}

bool hapi_covered_has_others(const hapi_covered *covered, uint32_t pair)
{
  return covered->next[pair] != pair;
}

/* m, from a point to the shape, negative in it; HUGE_VAL: it has no closed form. out_normal: out of
 * the shape. */
static double distance_to(const hapi_placed_geom *geom, const double point[3], double out_normal[3])
{
  static const hapi_shape dot = {.kind = HAPI_SHAPE_SPHERE};
  const hap_pose at = {{point[0], point[1], point[2]}, {1.0, 0.0, 0.0, 0.0}};
  hapi_nearest nearest;
  hapi_v3_set(out_normal, 0.0, 0.0, 0.0);
  if (geom->shape.kind == HAPI_SHAPE_HULL ||
      !hapi_nearest_points(&dot, &at, &geom->shape, &geom->pose, &nearest)) {
    return HUGE_VAL;
  }
  hapi_v3_copy(nearest.normal, out_normal);
  return nearest.distance;
}

/* Whether one geom stands in front of a side of another one at a point, and the other one is no
 * higher. up: out of the first one's surface. */
static bool point_is_covered(const hapi_placed_geom *by, const hapi_placed_geom *side,
                             const double point[3], const double normal[3])
{
  double before[3];
  double above[3];
  double up[3];
  double ignored[3];
  hapi_v3_madd(point, AHEAD, normal, before);
  double depth = -distance_to(by, before, up);
  if (!(depth >= -STEP)) {
    return false;
  }
  hapi_v3_madd(point, hapi_max(depth, 0.0) + 2.0 * STEP, up, above);
  double clear = distance_to(side, above, ignored);
  return clear > STEP && clear < HUGE_VAL;
}

bool hapi_covered_all(const hapi_covered *covered, const hapi_places *places, const hapi_kept *kept,
                      const hapi_covered_patch *patch)
{
  const hapi_kept_pair *pair = &kept->pairs[patch->pair];
  uint32_t body = body_of(places, pair, patch->side);
  hapi_placed_geom side;
  int left = patch->count;
  bool found[HAPI_PATCH_POINTS] = {false};
  if (!hapi_places_geom(places, pair->geoms[patch->side], &side)) {
    return false;
  }
  for (uint32_t i = covered->next[patch->pair]; i != patch->pair && left > 0;
       i = covered->next[i]) {
    const hapi_kept_pair *other = &kept->pairs[i];
    uint32_t geom = other->geoms[body_of(places, other, 0) == body ? 0 : 1];
    hapi_placed_geom by;
    if (geom == pair->geoms[patch->side] || !hapi_places_geom(places, geom, &by)) {
      continue;
    }
    for (int k = 0; k < patch->count; ++k) {
      bool now = !found[k] && point_is_covered(&by, &side, patch->point[k], patch->normal[k]);
      found[k] = found[k] || now;
      left -= now;
    }
  }
  return left == 0;
}
