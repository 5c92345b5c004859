/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* b is added up at every tick: what it may be off is less than what A may. */
#define SHARE_OF_B 0.01

bool hapi_reuse_wanted(const hapi_physics *physics)
{
  return physics->cycle.settings.reuse > 0.0 &&
         (physics->cycle.model == HAP_MODEL_ACCELERANCE ||
          physics->cycle.model == HAP_MODEL_CONTACT) &&
         hapi_wish(physics->cycle.wishes, HAP_EFFECT_TESTING) == HAP_EFFECT_AUTO &&
         physics->cycle.settings.probe != HAP_PROBE_PAPER && !hapi_cross_is_full(physics);
}

/* m, at most, that the island moves otherwise in a step than when A and when b were measured. */
static void compare(const hapi_print_item *now, const hapi_print_item *old, uint32_t count,
                    double out[2])
{
  out[0] = out[1] = 0.0;
  for (uint32_t i = 0; i < count; ++i) {
    double weight = now[i].weight;
    if (weight < 0.0) {
      if (old[i].weight >= 0.0 || now[i].value != old[i].value) {
        out[0] = out[1] = HUGE_VAL;
        return;
      }
      continue;
    }
    double off = weight * fabs(now[i].value - old[i].value);
    double off_b = weight * fabs(now[i].value - old[i].value_b);
    out[0] = fmax(out[0], off);
    out[1] = fmax(out[1], off_b);
  }
}

static bool same_pair(const hapi_touch_print *a, const hapi_touch_print *b)
{
  return a->births[0] == b->births[0] && a->births[1] == b->births[1];
}

static uint32_t count_of_pair(const hapi_touch_print *first, uint32_t most)
{
  uint32_t count = 0;
  while (count < most && same_pair(&first[count], first)) {
    ++count;
  }
  return count;
}

/* A collider puts a point on the surface of one of the bodies, of either: where two faces lie on each other
 * the last digit decides. Both together have not moved, or their poses or depths would say so. */
static void apart(const hapi_touch_print *a, const hapi_touch_print *b, double out[3])
{
  hapi_v3_sub(a->position, b->position, out);
  double along = hapi_v3_dot(out, a->normal);
  double free = fmax(-a->depth, fmin(a->depth, along));
  hapi_v3_madd(out, -free, a->normal, out);
}

static double way_between(const hapi_touch_print *a, const hapi_touch_print *b)
{
  double way = fabs(a->depth - b->depth);
  double off[3];
  if (a->surface != b->surface) {
    return HUGE_VAL;
  }
  apart(a, b, off);
  for (int i = 0; i < 3; ++i) {
    way = fmax(way, fabs(off[i]));
    way = fmax(way, a->arm * fabs(a->normal[i] - b->normal[i]));
    way = fmax(way, a->arm * fabs(a->direction[i] - b->direction[i]));
  }
  return way;
}

/* m, to the nearest point of the line between two others. */
static double way_to_line(const hapi_touch_print *a, const hapi_touch_print *b,
                          const hapi_touch_print *c)
{
  hapi_touch_print between = *b;
  double along[3];
  double to[3];
  hapi_v3_sub(c->position, b->position, along);
  hapi_v3_sub(a->position, b->position, to);
  double length2 = hapi_v3_dot(along, along);
  double share = length2 > 0.0 ? hapi_v3_dot(to, along) / length2 : 0.0;
  share = fmax(0.0, fmin(1.0, share));
  hapi_v3_madd(b->position, share, along, between.position);
  between.depth += share * (c->depth - b->depth);
  return way_between(a, &between);
}

/* The points of a pair hold it by the area between them: where the borders of two faces nearly run along each
 * other a collider finds a point more somewhere on the border, or does not. */
static bool lies_within(const hapi_touch_print *touch, const hapi_touch_print *those,
                        uint32_t count, double slack)
{
  for (uint32_t i = 0; i < count; ++i) {
    if (way_between(touch, &those[i]) <= slack) {
      return true;
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    for (uint32_t k = i + 1; k < count; ++k) {
      if (way_to_line(touch, &those[i], &those[k]) <= slack) {
        return true;
      }
    }
  }
  return false;
}

static bool all_lie_within(const hapi_touch_print *these, uint32_t count,
                           const hapi_touch_print *those, uint32_t others, double slack)
{
  bool all = true;
  for (uint32_t i = 0; all && i < count; ++i) {
    all = lies_within(&these[i], those, others, slack);
  }
  return all;
}

static bool touches_are_same(const hapi_touch_print *now, uint32_t now_count,
                             const hapi_touch_print *old, uint32_t old_count, double slack)
{
  while (now_count > 0 && old_count > 0 && same_pair(now, old)) {
    uint32_t n = count_of_pair(now, now_count);
    uint32_t o = count_of_pair(old, old_count);
    if (!all_lie_within(now, n, old, o, slack) || !all_lie_within(old, o, now, n, slack)) {
      return false;
    }
    now += n;
    now_count -= n;
    old += o;
    old_count -= o;
  }
  return now_count == 0 && old_count == 0;
}

/* ---- a round ---- */

static hapi_print_place *place_of(hapi_physics *physics, const hapi_reuse_book *book,
                                  const hapi_reuse_island *island)
{
  return &physics->near.slots.bodies[island->slot].prints[book - physics->probe.reuse.books];
}

static bool begin_round(hapi_physics *physics, hapi_reuse_book *book)
{
  hapi_print_item *items = book->old;
  uint32_t capacity = book->old_capacity;
  book->old = book->items;
  book->old_capacity = book->capacity;
  book->items = items;
  book->capacity = capacity;
  book->count = 0;
  hapi_touch_print *touches = book->old_touches;
  uint32_t touch_capacity = book->old_touch_capacity;
  book->old_touches = book->touches;
  book->old_touch_capacity = book->touch_capacity;
  book->touches = touches;
  book->touch_capacity = touch_capacity;
  book->touch_count = 0;
  ++book->round;
  book->island_count = 0;
  book->in_use = hapi_reuse_wanted(physics) &&
                 hapi_reserve((void **)&book->islands, &book->island_capacity, 0,
                              physics->probe.test.island_count, sizeof *book->islands);
  return book->in_use;
}

/* The members of an island follow each other. */
static void list_members(const hapi_physics *physics, hapi_reuse_book *book)
{
  const hapi_test_set *test = &physics->probe.test;
  book->island_count = test->island_count;
  for (uint32_t i = 0; i < book->island_count; ++i) {
    book->islands[i] = (hapi_reuse_island){.pushed = HAPI_NONE};
  }
  for (uint32_t i = test->member_count; i-- > 0;) {
    const hapi_known_body *known = &physics->world.bodies.entries[test->members[i]];
    hapi_reuse_island *island = &book->islands[known->island];
    island->first_member = i;
    ++island->member_count;
    island->slot = known->slot;
  }
}

static hapi_reuse_island *island_of(const hapi_physics *physics, const hapi_reuse_book *book,
                                    uint32_t known)
{
  return &book->islands[physics->world.bodies.entries[known].island];
}

static void list_pushed(hapi_physics *physics, hapi_reuse_book *book, bool bodies)
{
  const hapi_test_set *test = &physics->probe.test;
  uint32_t count = bodies ? test->body_count : test->contact_count;
  for (uint32_t i = count; i-- > 0;) {
    uint32_t index = bodies ? test->bodies[i] : test->contacts[i];
    uint32_t body = bodies ? index : physics->near.slots.contacts[index].body;
    hapi_reuse_island *island = island_of(physics, book, physics->near.slots.bodies[body].known);
    *(bodies ? &physics->near.slots.bodies[index].next_pushed
             : &physics->near.slots.contacts[index].next_pushed) = island->pushed;
    island->pushed = index;
    ++island->pushed_count;
  }
}

/* Without any touch there may be no list either. */
static bool touches_stay(const hapi_reuse_book *book, const hapi_reuse_island *island,
                         const hapi_print_place *place, double slack)
{
  if (island->touch_count == 0 || place->touch_count == 0) {
    return island->touch_count == place->touch_count;
  }
  return touches_are_same(book->touches + island->first_touch, island->touch_count,
                          book->old_touches + place->first_touch, place->touch_count, slack);
}

static hapi_reuse_kind kind_of(hapi_physics *physics, const hapi_reuse_book *book,
                               const hapi_reuse_island *island)
{
  const hapi_print_place *place = place_of(physics, book, island);
  double way[2];
  if (island->spoiled || place->round + 1 != book->round || place->count != island->count) {
    return HAPI_REUSE_NONE;
  }
  compare(book->items + island->first, book->old + place->first, place->count, way);
  if (way[0] > physics->cycle.settings.reuse ||
      !touches_stay(book, island, place, physics->cycle.settings.reuse)) {
    return HAPI_REUSE_NONE;
  }
  bool all = way[1] <= SHARE_OF_B * physics->cycle.settings.reuse && !island->has_joints;
  return all ? HAPI_REUSE_ALL : HAPI_REUSE_A;
}

void hapi_reuse_look(hapi_physics *physics, hapi_reuse_book *book, bool bodies)
{
  if (!begin_round(physics, book)) {
    return;
  }
  list_members(physics, book);
  list_pushed(physics, book, bodies);
  for (uint32_t i = 0; i < book->island_count; ++i) {
    hapi_reuse_island *island = &book->islands[i];
    island->spoiled = !hapi_print_island(physics, book, i, bodies);
    island->kind = kind_of(physics, book, island);
  }
}

hapi_reuse_kind hapi_reuse_kind_of(const hapi_physics *physics, const hapi_reuse_book *book,
                                   uint32_t known)
{
  uint32_t island = physics->world.bodies.entries[known].island;
  return book->in_use && island != HAPI_NONE ? book->islands[island].kind : HAPI_REUSE_NONE;
}

bool hapi_reuse_has(const hapi_reuse_book *book, hapi_reuse_kind kind)
{
  bool has = false;
  for (uint32_t i = 0; book->in_use && i < book->island_count; ++i) {
    has = has || book->islands[i].kind == kind;
  }
  return has;
}

static uint32_t select_from(const hapi_physics *physics, const hapi_reuse_book *book,
                            hapi_reuse_kind kind, bool bodies, uint32_t *io, uint32_t count)
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t body = bodies ? io[i] : physics->near.slots.contacts[io[i]].body;
    if (island_of(physics, book, physics->near.slots.bodies[body].known)->kind == kind) {
      io[kept++] = io[i];
    }
  }
  return kept;
}

void hapi_reuse_select(hapi_physics *physics, const hapi_reuse_book *book, hapi_reuse_kind kind)
{
  hapi_test_set *test = &physics->probe.test;
  uint32_t kept = 0;
  if (!book->in_use) {
    return;
  }
  test->contact_count =
      select_from(physics, book, kind, false, test->contacts, test->contact_count);
  test->body_count = select_from(physics, book, kind, true, test->bodies, test->body_count);
  for (uint32_t i = 0; i < test->member_count; ++i) {
    hapi_known_body *known = &physics->world.bodies.entries[test->members[i]];
    if (book->islands[known->island].kind == kind) {
      known->rest->member = kept;
      test->members[kept++] = test->members[i];
    } else {
      known->island = HAPI_NONE;
    }
  }
  test->member_count = kept;
}

void hapi_reuse_spoil(hapi_physics *physics, hapi_reuse_book *book, uint32_t known)
{
  if (book->in_use) {
    island_of(physics, book, known)->spoiled = true;
  }
}

static bool keep_touches(hapi_reuse_book *book, const hapi_print_place *old, uint32_t *out_first)
{
  if (!hapi_reserve((void **)&book->touches, &book->touch_capacity, book->touch_count,
                    old->touch_count, sizeof *book->touches)) {
    return false;
  }
  *out_first = book->touch_count;
  for (uint32_t i = 0; i < old->touch_count; ++i) {
    book->touches[book->touch_count++] = book->old_touches[old->first_touch + i];
  }
  return true;
}

/* What is used again goes on standing for the state that it was measured in. */
static bool keep_island(hapi_physics *physics, hapi_reuse_book *book,
                        const hapi_reuse_island *island)
{
  hapi_print_place *place = place_of(physics, book, island);
  hapi_print_place now = {book->round, island->first, island->count, island->first_touch,
                          island->touch_count};
  if (island->kind != HAPI_REUSE_NONE) {
    now.touch_count = place->touch_count;
    if (!keep_touches(book, place, &now.first_touch)) {
      return false;
    }
  }
  for (uint32_t i = 0; i < island->count && island->kind != HAPI_REUSE_NONE; ++i) {
    const hapi_print_item *old = &book->old[place->first + i];
    hapi_print_item *item = &book->items[island->first + i];
    item->value = old->value;
    item->value_b = island->kind == HAPI_REUSE_ALL ? old->value_b : item->value_b;
  }
  *place = now;
  return true;
}

void hapi_reuse_keep(hapi_physics *physics, hapi_reuse_book *book)
{
  for (uint32_t i = 0; book->in_use && i < book->island_count; ++i) {
    const hapi_reuse_island *island = &book->islands[i];
    if (island->spoiled || !keep_island(physics, book, island)) {
      place_of(physics, book, island)->round = 0;
    }
    physics->counts.own.stats.probes.reused +=
        island->kind != HAPI_REUSE_NONE ? island->pushed_count : 0;
  }
}

void hapi_reuse_reset(hapi_physics *physics)
{
  for (int i = 0; i < HAPI_REUSE_BOOKS; ++i) {
    physics->probe.reuse.books[i].round += 2; /* no place stands for anything */
  }
}

void hapi_reuse_finish(hapi_physics *physics)
{
  for (int i = 0; i < HAPI_REUSE_BOOKS; ++i) {
    hapi_free(physics->probe.reuse.books[i].items);
    hapi_free(physics->probe.reuse.books[i].old);
    hapi_free(physics->probe.reuse.books[i].touches);
    hapi_free(physics->probe.reuse.books[i].old_touches);
    hapi_free(physics->probe.reuse.books[i].members);
    hapi_free(physics->probe.reuse.books[i].islands);
  }
}
