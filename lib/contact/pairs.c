/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/pairs.h"

#include <math.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "base/vec.h"
#include "contact/covered.h"
#include "contact/flat_areas.h"
#include "contact/kept.h"
#include "sync/mesh_filter.h"

#define LIMIT_STEPS 40 /* halvings: a metre to a picometre */

/* What a pass has of the pairs of a key. */
typedef struct pass_pair {
  double spare;   /* m, gap less margin: how near to a touch, beside what speed and age may make */
  uint32_t count; /* contacts */
  bool left_out;  /* for want of room */
} pass_pair;

/* What is found between the geoms of one key. */
typedef struct pair_group {
  hapi_flat_areas flat;
  hapi_patch_contact contacts[HAPI_FLAT_POINTS];
  hapi_kept_ends ends[HAPI_FLAT_POINTS]; /* where somebody is asked about them */
  uint32_t order[HAPI_FLAT_POINTS];      /* in which they go into the message */
  uint32_t count;
  double gap;    /* m, of the deepest; infinite: none */
  double margin; /* m, within which all were looked for */
  double clear;  /* m, without contacts: the geoms are not nearer; 0: not known */
} pair_group;

struct hapi_pairs {
  const hapi_places *places;
  hapi_asking *asking;
  uint32_t capacity; /* contacts */
  _Atomic uint64_t *left_out;
  hapi_kept kept;
  hapi_covered covered;
  uint64_t numbers;  /* of contacts, that were given */
  uint64_t surfaces; /* of the near message: the same pairs in the same order have the same */
  pass_pair *pass;   /* as the pairs that are kept */
  pair_group *group;
};

/* ---- two geoms ---- */

typedef struct placed_pair {
  hapi_placed_geom a;
  hapi_placed_geom b;
  double margin;
  double clear; /* m, without points: the geoms are not nearer; 0: not known */
  hapi_patch patch;
} placed_pair;

/* A triangle's neighbours in the mesh hide its edges. out: of the triangle. */
static bool triangle_allows(const hapi_placed_geom *geom, const double out[3])
{
  double own[3];
  if (geom->in->open_edges == 0) {
    return true;
  }
  hapi_quat_unrotate(geom->pose.quat_wxyz, out, own);
  return hapi_mesh_allows(geom->in->open_edges, geom->shape.hull, own);
}

static bool point_is_allowed(const hapi_placed_geom *a, const hapi_placed_geom *b,
                             const hapi_patch_point *point)
{
  double into[3];
  hapi_v3_scale(-1.0, point->normal, into);
  return triangle_allows(a, into) && triangle_allows(b, point->normal);
}

static double pair_margin(const hapi_pairs *pairs, const hapi_pass_body *const bodies[2],
                          double extent_a, double extent_b)
{
  return hapi_places_margin(pairs->places, hapi_places_mover(bodies[0], extent_a),
                            hapi_places_mover(bodies[1], extent_b));
}

/* The points of a pair, deepest first, that count. */
static void pair_find(const hapi_pairs *pairs, const hapi_near_pair *pair, placed_pair *out)
{
  const hapi_places *places = pairs->places;
  const hapi_pass_body *bodies[2];
  hapi_patch *patch = &out->patch;
  int count = 0;
  patch->count = 0;
  out->clear = 0.0;
  out->margin = 0.0;
  if (!hapi_places_body(places, pair->geom_a, &bodies[0]) ||
      !hapi_places_body(places, pair->geom_b, &bodies[1])) {
    return;
  }
  out->margin = pair_margin(pairs, bodies, places->geoms[pair->geom_a].extent,
                            places->geoms[pair->geom_b].extent);
  out->clear = hapi_places_clear(places, pair, bodies[0], bodies[1]);
  if (out->clear > out->margin) {
    return;
  }
  (void)hapi_places_geom(places, pair->geom_a, &out->a);
  (void)hapi_places_geom(places, pair->geom_b, &out->b);
  (void)hapi_patch_find(&out->a.shape, &out->a.pose, &out->b.shape, &out->b.pose, out->margin,
                        patch);
  out->clear = patch->count == 0 ? patch->apart : 0.0;
  for (int i = 0; i < patch->count; ++i) {
    if (point_is_allowed(&out->a, &out->b, &patch->points[i])) {
      patch->points[count++] = patch->points[i];
    }
  }
  patch->count = count;
}

static void pair_contact(const placed_pair *found, const hapi_near_pair *pair, int point,
                         hapi_patch_contact *out)
{
  const hapi_touch_side side_a = hapi_placed_side(&found->a);
  const hapi_touch_side side_b = hapi_placed_side(&found->b);
  out->body_a = found->a.in->body;
  out->generation_a = found->a.in->generation;
  out->body_b = found->b.in->body;
  out->generation_b = found->b.in->generation;
  hapi_touch_localise(&side_a, &side_b, &found->patch.points[point], out);
  out->key = pair->key;
}

/* ---- where somebody is asked about contacts ---- */

/* Of side a, or of side b. */
static void surface_point(const hapi_placed_geom *geom, const hapi_patch_point *p, bool of_b,
                          double out[3])
{
  static const double along[3] = {0.0, 0.0, 1.0};
  double side = of_b ? 1.0 : -1.0;
  double rim = of_b ? p->rim_b : p->rim_a;
  hapi_v3_madd(of_b ? p->core_b : p->core_a, side * (of_b ? p->ball_b : p->ball_a), p->normal, out);
  if (rim > 0.0) {
    double axis[3];
    double across[3];
    hapi_quat_rotate(geom->pose.quat_wxyz, along, axis);
    hapi_v3_madd(p->normal, -hapi_v3_dot(p->normal, axis), axis, across);
    double length = hapi_v3_norm(across);
    if (length > 1e-12) {
      hapi_v3_madd(out, side * rim / length, across, out);
    }
  }
}

static void point_to_body(const hapi_pass_body *body, double io[3])
{
  if (body != NULL) {
    hapi_pose_unpoint(body->pose.position, body->pose.quat_wxyz, io, io);
  }
}

static void point_to_world(const hapi_pass_body *body, double io[3])
{
  if (body != NULL) {
    hapi_pose_point(body->pose.position, body->pose.quat_wxyz, io, io);
  }
}

static void pair_ends(const placed_pair *found, int point, hapi_kept_ends *out)
{
  const hapi_patch_point *p = &found->patch.points[point];
  const hapi_pass_body *b = found->b.body;
  surface_point(&found->a, p, false, out->a);
  surface_point(&found->b, p, true, out->b);
  hapi_v3_copy(p->normal, out->normal);
  point_to_body(found->a.body, out->a);
  point_to_body(b, out->b);
  if (b != NULL) {
    hapi_quat_unrotate(b->pose.quat_wxyz, out->normal, out->normal);
  }
}

static void body_velocity(const hapi_pass_body *body, const double point[3], double out[3])
{
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  if (body != NULL) {
    double arm[3];
    hapi_v3_sub(point, body->pose.position, arm);
    hapi_v3_cross(body->twist.angular, arm, out);
    hapi_v3_add(out, body->twist.linear, out);
  }
}

/* What the application is told of a contact: there where the bodies are now. */
static void ends_spot(const hapi_kept_ends *in, const hapi_pass_body *a, const hapi_pass_body *b,
                      hapi_contact_spot *out)
{
  hapi_kept_ends ends = *in;
  double velocity[3];
  double apart[3];
  point_to_world(a, ends.a);
  point_to_world(b, ends.b);
  if (b != NULL) {
    hapi_quat_rotate(b->pose.quat_wxyz, ends.normal, ends.normal);
  }
  hapi_v3_add(ends.a, ends.b, out->point);
  hapi_v3_scale(0.5, out->point, out->point);
  hapi_v3_sub(ends.a, ends.b, apart);
  hapi_v3_copy(ends.normal, out->normal);
  out->gap = hapi_v3_dot(apart, ends.normal);
  body_velocity(a, out->point, out->velocity);
  body_velocity(b, out->point, velocity);
  hapi_v3_sub(out->velocity, velocity, out->velocity);
}

/* ---- the pairs of a key ---- */

/* Neighbours in a mesh share their corners and edges, and each of them finds the point there.
 * False: there is no room for all points. */
static bool group_add(pair_group *group, const placed_pair *found, const hapi_near_pair *pair,
                      bool asks)
{
  uint32_t first = HAPI_SLOT_NONE;
  for (int i = 0; i < found->patch.count; ++i) {
    const hapi_patch_point *point = &found->patch.points[i];
    uint32_t at = hapi_flat_find(&group->flat, point->core_a, point->normal);
    if (at == HAPI_FLAT_POINTS) {
      return false;
    }
    if (at == group->flat.count) {
      (void)hapi_flat_add(&group->flat, point->core_a, point->normal, point->gap);
      pair_contact(found, pair, i, &group->contacts[at]);
      if (asks) {
        pair_ends(found, i, &group->ends[at]);
      }
    }
    first = first == HAPI_SLOT_NONE ? at : first;
    hapi_flat_join(&group->flat, first, at);
  }
  return true;
}

/* Of two geoms of which one or both are made of triangles. */
static void group_find(hapi_pairs *pairs, const hapi_near_pair *near, uint32_t count)
{
  pair_group *group = pairs->group;
  bool all = true;
  group->flat.count = 0;
  group->margin = group->clear = HUGE_VAL;
  for (uint32_t i = 0; i < count; ++i) {
    placed_pair found;
    pair_find(pairs, &near[i], &found);
    group->margin = hapi_min(found.margin, group->margin);
    group->clear = hapi_min(found.clear, group->clear);
    if (found.patch.count > 0) {
      group->gap = hapi_min(found.patch.points[0].gap, group->gap);
      all = group_add(group, &found, &near[i], pairs->kept.ends != NULL) && all;
    }
  }
  atomic_fetch_add_explicit(pairs->left_out, !all, memory_order_relaxed);
  (void)hapi_flat_reduce(&group->flat);
  for (uint32_t i = 0; i < group->flat.count; ++i) {
    if (!group->flat.points[i].spare) {
      group->contacts[group->count] = group->contacts[i];
      group->ends[group->count++] = group->ends[i];
    }
  }
}

/* On either of its two geoms. */
static bool pair_is_covered(const hapi_pairs *pairs, uint32_t index, const placed_pair *found)
{
  for (int side = 0; side < 2; ++side) {
    hapi_covered_patch patch = {.pair = index, .side = side, .count = found->patch.count};
    for (int i = 0; i < patch.count; ++i) {
      const hapi_patch_point *p = &found->patch.points[i];
      surface_point(side == 0 ? &found->a : &found->b, p, side == 1, patch.point[i]);
      hapi_v3_scale(side == 0 ? -1.0 : 1.0, p->normal, patch.normal[i]);
    }
    if (hapi_covered_all(&pairs->covered, pairs->places, &pairs->kept, &patch)) {
      return true;
    }
  }
  return false;
}

static void single_find(hapi_pairs *pairs, const hapi_near_pair *near, uint32_t index)
{
  pair_group *group = pairs->group;
  placed_pair found;
  pair_find(pairs, near, &found);
  if (found.patch.count > 0 && hapi_covered_has_others(&pairs->covered, index) &&
      pair_is_covered(pairs, index, &found)) {
    found.patch.count = 0;
  }
  group->margin = found.margin;
  group->clear = found.clear;
  group->gap = found.patch.count > 0 ? found.patch.points[0].gap : HUGE_VAL;
  for (int i = 0; i < found.patch.count; ++i) {
    pair_contact(&found, near, i, &group->contacts[i]);
    if (pairs->kept.ends != NULL) {
      pair_ends(&found, i, &group->ends[i]);
    }
    ++group->count;
  }
}

/* Into the group, and what of it can be kept. */
static void key_find(hapi_pairs *pairs, const hapi_pass_body *const bodies[2], hapi_kept_pair *io)
{
  const hapi_near_pair *near = &hapi_near_pairs(pairs->places->near)[io->first];
  pair_group *group = pairs->group;
  group->count = 0;
  group->gap = HUGE_VAL;
  if (io->pairs > 1) {
    group_find(pairs, near, io->pairs);
  } else {
    single_find(pairs, near, (uint32_t)(io - pairs->kept.pairs));
  }
  hapi_kept_go_on(&pairs->kept, io, group->contacts, group->count, group->order);
  hapi_kept_find(&pairs->kept, io, bodies[0], bodies[1], group->margin);
  io->gap = group->gap;
  io->clear = group->clear;
  for (uint32_t i = 0; i < group->count; ++i) {
    hapi_patch_contact *contact = &group->contacts[group->order[i]];
    contact->number = contact->number != 0 ? contact->number : ++pairs->numbers;
    hapi_kept_add(&pairs->kept, io, contact, &group->ends[group->order[i]]);
  }
}

/* What its contacts have in common; their points are there. */
static void patches_add_pair(hapi_pairs *pairs, uint32_t index, hapi_patches *out)
{
  const hapi_near_pair *pair = &hapi_near_pairs(pairs->places->near)[index];
  if (pairs->places->near->said_count > 0) {
    pairs->asking->pairs[out->surface_count] = index;
  }
  hapi_patches_pairs(out)[out->surface_count] = pair->tags;
  hapi_patches_surfaces(out)[out->surface_count++] = pair->surface;
}

/* But for the surface. */
static bool is_alike(const hapi_patch_contact *contact, const hapi_patch_contact *other)
{
  hapi_patch_contact copy = *other;
  copy.surface = contact->surface;
  return memcmp(&copy, contact, sizeof copy) == 0;
}

static void patches_add(hapi_pairs *pairs, const hapi_pass_body *const bodies[2],
                        const hapi_patch_contact *contact, const hapi_kept_ends *ends,
                        hapi_patches *out)
{
  if (pairs->places->near->said_count > 0) {
    ends_spot(ends, bodies[0], bodies[1], &pairs->asking->spots[out->contact_count]);
  }
  hapi_patch_contact *c = &hapi_patches_contacts(out)[out->contact_count++];
  if (c->number != contact->number) { /* else an older message had it in this place */
    *c = *contact;
  }
  c->surface = out->surface_count;
  HAPI_ASSERT(is_alike(c, contact));
  out->contents = hapi_hash_word(out->contents, c->number);
}

static void patches_add_kept(hapi_pairs *pairs, const hapi_pass_body *const bodies[2],
                             const hapi_kept_pair *pair, hapi_patches *out)
{
  const hapi_kept *kept = &pairs->kept;
  for (uint32_t i = pair->contacts; i != HAPI_SLOT_NONE; i = kept->next[i]) {
    patches_add(pairs, bodies, &kept->contacts[i], kept->ends != NULL ? &kept->ends[i] : NULL, out);
  }
}

static void patches_add_found(hapi_pairs *pairs, const hapi_pass_body *const bodies[2],
                              hapi_patches *out)
{
  const pair_group *group = pairs->group;
  for (uint32_t i = 0; i < group->count; ++i) {
    uint32_t at = group->order[i];
    patches_add(pairs, bodies, &group->contacts[at], &group->ends[at], out);
  }
}

/* Contacts of a key, where it counts; they go into the message as long as there is room. */
static void key_fill(hapi_pairs *pairs, uint32_t key, uint64_t *io_wanted, hapi_patches *out)
{
  hapi_kept_pair *pair = &pairs->kept.pairs[key];
  pass_pair *pass = &pairs->pass[key];
  const hapi_pass_body *bodies[2];
  pass->count = 0;
  if (pass->left_out || !hapi_places_body(pairs->places, pair->geoms[0], &bodies[0]) ||
      !hapi_places_body(pairs->places, pair->geoms[1], &bodies[1])) {
    return;
  }
  double margin = pair_margin(pairs, bodies, pair->extents[0], pair->extents[1]);
  bool holds = hapi_kept_holds(pair, bodies[0], bodies[1], margin);
  if (!holds) {
    key_find(pairs, bodies, pair);
  }
  pass->count = holds ? pair->count : pairs->group->count;
  pass->spare = pair->gap - margin;
  *io_wanted += pass->count;
  if (pass->count == 0 || *io_wanted > pairs->capacity) {
    return;
  }
  if (holds) {
    patches_add_kept(pairs, bodies, pair, out);
  } else {
    patches_add_found(pairs, bodies, out);
  }
  patches_add_pair(pairs, pair->first, out);
}

/* False: there is no room for all of them. */
static bool keys_fill(hapi_pairs *pairs, hapi_patches *out)
{
  uint64_t wanted = 0;
  out->contact_count = 0;
  out->surface_count = 0;
  out->contents = pairs->surfaces;
  for (uint32_t i = 0; i < pairs->kept.count; ++i) {
    key_fill(pairs, i, &wanted, out);
  }
  return wanted <= pairs->capacity;
}

/* ---- more than there is room for ---- */

static uint64_t count_up_to(const hapi_pairs *pairs, double spare)
{
  uint64_t count = 0;
  for (uint32_t i = 0; i < pairs->kept.count; ++i) {
    count += pairs->pass[i].spare <= spare ? pairs->pass[i].count : 0;
  }
  return count;
}

/* The largest spare up to which there is room for all, from below and from above. */
static void find_limit(const hapi_pairs *pairs, double *out_below, double *out_above)
{
  double least = 0.0; /* no spare is larger: a gap is within its margin */
  for (uint32_t i = 0; i < pairs->kept.count; ++i) {
    bool counts = pairs->pass[i].count > 0;
    least = counts && pairs->pass[i].spare < least ? pairs->pass[i].spare : least;
  }
  *out_below = 2.0 * least - 1.0;
  *out_above = 0.0;
  for (int i = 0; i < LIMIT_STEPS; ++i) {
    double middle = 0.5 * (*out_below + *out_above);
    bool fits = count_up_to(pairs, middle) <= pairs->capacity;
    *(fits ? out_below : out_above) = middle;
  }
}

/* Whoever comes last in the list must not lose the ground under it to pairs that do not touch:
 * first those go that would need to come nearest in order to. */
static void leave_out_farthest(hapi_pairs *pairs)
{
  double below;
  double above;
  find_limit(pairs, &below, &above);
  uint64_t used = count_up_to(pairs, below);
  for (uint32_t i = 0; i < pairs->kept.count; ++i) {
    pass_pair *pair = &pairs->pass[i];
    if (pair->count == 0 || pair->spare <= below) {
      continue;
    }
    bool fits = pair->spare <= above && used + pair->count <= pairs->capacity;
    used += fits ? pair->count : 0;
    pair->left_out = !fits;
    atomic_fetch_add_explicit(pairs->left_out, !fits, memory_order_relaxed);
  }
}

/* ---- a pass ---- */

/* Of two neighbours in the list the surfaces are mostly the same: they are compared first. */
static uint64_t surfaces_of(hapi_near *near)
{
  const hapi_near_pair *pairs = hapi_near_pairs(near);
  uint64_t hash = HAPI_HASH_BEGIN;
  for (uint32_t i = 0; i < near->pair_count; ++i) {
    const hapi_surface *surface = &pairs[i].surface;
    bool again = i > 0 && memcmp(surface, &pairs[i - 1].surface, sizeof *surface) == 0;
    hash = hapi_hash_word(hash, pairs[i].key);
    hash = hapi_hash_word(hash, again ? 0 : hapi_surface_hash(surface));
  }
  return hash;
}

void hapi_pairs_take_near(hapi_pairs *pairs)
{
  hapi_kept_take_near(&pairs->kept, pairs->places);
  hapi_covered_take_near(&pairs->covered, pairs->places, &pairs->kept);
  pairs->surfaces = surfaces_of(pairs->places->near);
}

void hapi_pairs_find(hapi_pairs *pairs, hapi_patches *out)
{
  for (uint32_t i = 0; i < pairs->kept.count; ++i) {
    pairs->pass[i].left_out = false;
  }
  if (!keys_fill(pairs, out)) {
    leave_out_farthest(pairs);
    (void)keys_fill(pairs, out);
  }
}

/* ---- life ---- */

bool hapi_pairs_create(const hapi_places *places, hapi_asking *asking,
                       const hapi_capacity *capacity, _Atomic uint64_t *left_out, hapi_pairs **out)
{
  hapi_pairs *pairs = *out = hapi_alloc(sizeof *pairs);
  if (pairs == NULL) {
    return false;
  }
  pairs->places = places;
  pairs->asking = asking;
  pairs->capacity = capacity->contacts;
  pairs->left_out = left_out;
  pairs->pass = hapi_alloc_array(capacity->pairs, sizeof *pairs->pass);
  pairs->group = hapi_alloc(sizeof *pairs->group);
  bool kept = hapi_kept_create(&pairs->kept, capacity, asking->ask != NULL);
  bool covered = hapi_covered_create(&pairs->covered, capacity);
  return kept && covered && pairs->pass != NULL && pairs->group != NULL;
}

void hapi_pairs_destroy(hapi_pairs *pairs)
{
  if (pairs == NULL) {
    return;
  }
  hapi_kept_finish(&pairs->kept);
  hapi_covered_finish(&pairs->covered);
  hapi_free(pairs->pass);
  hapi_free(pairs->group);
  hapi_free(pairs);
}

void hapi_pairs_begin(hapi_pairs *pairs)
{
  hapi_kept_begin(&pairs->kept);
}
