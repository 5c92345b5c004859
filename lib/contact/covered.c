/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/covered.h"

#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"

#define AHEAD 1e-3 /* m, before a side: what covers it is there, and what slides sinks in by less */
#define STEP 1e-4  /* m, between two surfaces, that is none: as of seams under a pointer */

/* At most half full. */
static uint32_t places_for(uint32_t pairs)
{
  uint32_t places = 2;
  while (places < 2 * pairs) {
    places *= 2;
  }
  return places;
}

bool hapi_covered_create(hapi_covered *covered, const hapi_capacity *capacity)
{
  covered->next = hapi_alloc_array(capacity->pairs, sizeof *covered->next);
  covered->table = hapi_alloc_array(places_for(capacity->pairs), sizeof *covered->table);
  return covered->next != NULL && covered->table != NULL;
}

void hapi_covered_finish(hapi_covered *covered)
{
  hapi_free(covered->next);
  hapi_free(covered->table);
}

static uint32_t body_of(const hapi_places *places, const hapi_kept_pair *pair, int side)
{
  return hapi_near_geoms(places->near)[pair->geoms[side]].body;
}

static bool bodies_are_same(const hapi_places *places, const hapi_kept_pair *a,
                            const hapi_kept_pair *b)
{
  uint32_t bodies[2][2];
  for (int side = 0; side < 2; ++side) {
    bodies[0][side] = body_of(places, a, side);
    bodies[1][side] = body_of(places, b, side);
  }
  return (bodies[0][0] == bodies[1][0] && bodies[0][1] == bodies[1][1]) ||
         (bodies[0][0] == bodies[1][1] && bodies[0][1] == bodies[1][0]);
}

static uint32_t place_of(const hapi_covered *covered, const hapi_places *places,
                         const hapi_kept_pair *pair)
{
  uint64_t a = body_of(places, pair, 0);
  uint64_t b = body_of(places, pair, 1);
  uint64_t both = a < b ? a << 32 | b : b << 32 | a;
  return (uint32_t)(both * 0x9e3779b97f4a7c15u >> 32) & (covered->places - 1);
}

void hapi_covered_take_near(hapi_covered *covered, const hapi_places *places, const hapi_kept *kept)
{
  covered->places = places_for(kept->count);
  memset(covered->table, 0, covered->places * sizeof *covered->table);
  for (uint32_t i = 0; i < kept->count; ++i) {
    uint32_t at = place_of(covered, places, &kept->pairs[i]);
    while (covered->table[at] != 0 &&
           !bodies_are_same(places, &kept->pairs[covered->table[at] - 1], &kept->pairs[i])) {
      at = (at + 1) & (covered->places - 1);
    }
    covered->next[i] = i;
    if (covered->table[at] == 0) {
      covered->table[at] = i + 1;
    } else {
      uint32_t first = covered->table[at] - 1;
      covered->next[i] = covered->next[first];
      covered->next[first] = i;
    }
  }
}

bool hapi_covered_asks(const hapi_covered *covered, uint32_t pair)
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

/* Whether one thing stands before a side of another one at a point, and the other is no higher. */
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
