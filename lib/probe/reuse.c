/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/reuse.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"

/* b is added up at every tick: what it may be off is less than what A may. */
#define SHARE_OF_B 0.01

bool hapi_reuse_create(hapi_reuse *reuse, const hapi_capacity *capacity)
{
  bool good = true;
  for (int i = 0; i < HAPI_REUSE_BOOKS; ++i) {
    hapi_reuse_book *book = &reuse->books[i];
    book->bodies = i == HAPI_REUSE_BODIES;
    uint32_t pushed = book->bodies ? capacity->bodies : capacity->contacts;
    book->places = hapi_alloc_array(capacity->bodies, sizeof *book->places);
    book->next_pushed = hapi_alloc_array(pushed, sizeof *book->next_pushed);
    good = good && book->places != NULL && book->next_pushed != NULL;
  }
  return good;
}

static void sheet_finish(hapi_print_sheet *sheet)
{
  hapi_free(sheet->items);
  hapi_free(sheet->touches);
}

void hapi_reuse_finish(hapi_reuse *reuse)
{
  for (int i = 0; i < HAPI_REUSE_BOOKS; ++i) {
    hapi_reuse_book *book = &reuse->books[i];
    sheet_finish(&book->now);
    sheet_finish(&book->old);
    hapi_free(book->places);
    hapi_free(book->next_pushed);
    hapi_free(book->births);
    hapi_free(book->islands);
  }
  memset(reuse, 0, sizeof *reuse);
}

void hapi_reuse_reset(hapi_reuse *reuse)
{
  for (int i = 0; i < HAPI_REUSE_BOOKS; ++i) {
    reuse->books[i].round += 2; /* no place stands for anything */
  }
}

bool hapi_reuse_open(hapi_reuse *reuse, const hapi_cycle *cycle, bool allowed)
{
  reuse->wanted = allowed && cycle->settings.reuse > 0.0 &&
                  (cycle->model == HAP_MODEL_ACCELERANCE || cycle->model == HAP_MODEL_CONTACT) &&
                  hapi_wish(cycle->wishes, HAP_EFFECT_TESTING) == HAP_EFFECT_AUTO &&
                  cycle->settings.probe != HAP_PROBE_PAPER;
  return reuse->wanted;
}

/* ---- is it the same? ---- */

/* m, at most, that the island moves otherwise in a step than when A and when b were measured. */
static void items_compare(const hapi_print_item *now, const hapi_print_item *old, uint32_t count,
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

static bool touch_is_of_pair(const hapi_touch_print *a, const hapi_touch_print *b)
{
  return a->births[0] == b->births[0] && a->births[1] == b->births[1];
}

static uint32_t touch_count_pair(const hapi_touch_print *first, uint32_t most)
{
  uint32_t count = 0;
  while (count < most && touch_is_of_pair(&first[count], first)) {
    ++count;
  }
  return count;
}

static double touch_way(const hapi_touch_print *a, const hapi_touch_print *b)
{
  double way = fabs(a->depth - b->depth);
  double off[3];
  if (a->surface != b->surface) {
    return HUGE_VAL;
  }
  /* A collider puts a point on the surface of one of the bodies, of either: where two faces lie on
   * each other the last digit decides. Both together have not moved, or their poses or depths
   * would say so. */
  hapi_v3_sub(a->position, b->position, off);
  double along = hapi_v3_dot(off, a->normal);
  double free = fmax(-a->depth, fmin(a->depth, along));
  hapi_v3_madd(off, -free, a->normal, off);
  for (int i = 0; i < 3; ++i) {
    way = fmax(way, fabs(off[i]));
    way = fmax(way, a->arm * fabs(a->normal[i] - b->normal[i]));
    way = fmax(way, a->arm * fabs(a->direction[i] - b->direction[i]));
  }
  return way;
}

/* m, to the nearest point of the line between two others. */
static double touch_way_to_line(const hapi_touch_print *a, const hapi_touch_print *b,
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
  return touch_way(a, &between);
}

/* The points of a pair hold it by the area between them: where the borders of two faces nearly
 * run along each other a collider finds a point more somewhere on the border, or does not. */
static bool touch_lies_within(const hapi_touch_print *touch, const hapi_touch_print *those,
                              uint32_t count, double slack)
{
  for (uint32_t i = 0; i < count; ++i) {
    if (touch_way(touch, &those[i]) <= slack) {
      return true;
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    for (uint32_t k = i + 1; k < count; ++k) {
      if (touch_way_to_line(touch, &those[i], &those[k]) <= slack) {
        return true;
      }
    }
  }
  return false;
}

static bool touches_lie_within(const hapi_touch_print *these, uint32_t count,
                               const hapi_touch_print *those, uint32_t others, double slack)
{
  bool all = true;
  for (uint32_t i = 0; all && i < count; ++i) {
    all = touch_lies_within(&these[i], those, others, slack);
  }
  return all;
}

static bool touches_are_same(const hapi_touch_print *now, uint32_t now_count,
                             const hapi_touch_print *old, uint32_t old_count, double slack)
{
  while (now_count > 0 && old_count > 0 && touch_is_of_pair(now, old)) {
    uint32_t n = touch_count_pair(now, now_count);
    uint32_t o = touch_count_pair(old, old_count);
    if (!touches_lie_within(now, n, old, o, slack) || !touches_lie_within(old, o, now, n, slack)) {
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

static hapi_print_place *island_place(const hapi_reuse_book *book, const hapi_reuse_island *island)
{
  return &book->places[island->slot];
}

static bool round_begin(hapi_reuse_book *book, bool wanted, uint32_t islands)
{
  hapi_print_sheet sheet = book->old;
  book->old = book->now;
  book->now = sheet;
  book->now.count = book->now.touch_count = 0;
  ++book->round;
  book->island_count = 0;
  book->in_use = wanted && hapi_reserve((void **)&book->islands, &book->island_capacity, 0, islands,
                                        sizeof *book->islands);
  return book->in_use;
}

static hapi_reuse_island *island_of(const hapi_reuse_book *book, const hapi_test_set *test,
                                    uint32_t known)
{
  uint32_t island = hapi_test_island(test, known);
  HAPI_ASSERT_INDEX(island, book->island_count);
  return &book->islands[island];
}

/* The island in which a slot of the book's kind is pushed. */
static hapi_reuse_island *island_of_pushed(const hapi_reuse_book *book, const hapi_test_set *test,
                                           const hapi_slots *slots, uint32_t index)
{
  uint32_t body = book->bodies ? index : slots->contacts[index].body;
  return island_of(book, test, slots->bodies[body].known);
}

/* Without any touch there may be no list either. */
static bool island_touches_stay(const hapi_reuse_book *book, const hapi_reuse_island *island,
                                const hapi_print_place *place, double slack)
{
  if (island->touch_count == 0 || place->touch_count == 0) {
    return island->touch_count == place->touch_count;
  }
  return touches_are_same(book->now.touches + island->first_touch, island->touch_count,
                          book->old.touches + place->first_touch, place->touch_count, slack);
}

/* slack: m, that a body may move otherwise in a step. */
static hapi_reuse_kind island_kind(const hapi_reuse_book *book, const hapi_reuse_island *island,
                                   double slack)
{
  const hapi_print_place *place = island_place(book, island);
  double way[2];
  if (island->spoiled || place->round + 1 != book->round ||
      place->generation != island->generation || place->count != island->count) {
    return HAPI_REUSE_NONE;
  }
  items_compare(book->now.items + island->first, book->old.items + place->first, place->count, way);
  if (way[0] > slack || !island_touches_stay(book, island, place, slack)) {
    return HAPI_REUSE_NONE;
  }
  bool all = way[1] <= SHARE_OF_B * slack && !island->has_joints;
  return all ? HAPI_REUSE_ALL : HAPI_REUSE_A;
}

void hapi_reuse_look(hapi_reuse *reuse, hapi_reuse_book *book, const hapi_reuse_input *input,
                     const hapi_pushed *pushed)
{
  if (!round_begin(book, reuse->wanted, input->test->island_count)) {
    return;
  }
  /* The members of an island follow each other. */
  const hapi_test_set *test = input->test;
  book->island_count = test->island_count;
  for (uint32_t i = 0; i < book->island_count; ++i) {
    book->islands[i] = (hapi_reuse_island){.pushed = HAPI_NONE};
  }
  for (uint32_t i = test->member_count; i-- > 0;) {
    uint32_t known = test->members[i];
    HAPI_ASSERT_INDEX(hapi_test_island(test, known), book->island_count);
    hapi_reuse_island *island = &book->islands[hapi_test_island(test, known)];
    island->first_member = i;
    ++island->member_count;
    island->slot = test->world->bodies.entries[known].slot;
  }
  for (uint32_t i = 0; i < book->island_count; ++i) {
    HAPI_ASSERT_INDEX(book->islands[i].slot, input->slots->body_high); /* the first one is pushed */
    book->islands[i].generation = input->slots->bodies[book->islands[i].slot].generation;
  }
  for (uint32_t i = pushed->count; i-- > 0;) {
    uint32_t index = pushed->slots[i];
    hapi_reuse_island *island = island_of_pushed(book, input->test, input->slots, index);
    book->next_pushed[index] = island->pushed;
    island->pushed = index;
    ++island->pushed_count;
  }
  for (uint32_t i = 0; i < book->island_count; ++i) {
    hapi_reuse_island *island = &book->islands[i];
    island->spoiled = !hapi_print_island(input, book, island);
    island->kind = island_kind(book, island, input->cycle->settings.reuse);
  }
}

hapi_reuse_kind hapi_reuse_kind_of(const hapi_reuse_book *book, const hapi_test_set *test,
                                   uint32_t known)
{
  return book->in_use && hapi_test_has(test, known) ? island_of(book, test, known)->kind
                                                    : HAPI_REUSE_NONE;
}

bool hapi_reuse_has(const hapi_reuse_book *book, hapi_reuse_kind kind)
{
  bool has = false;
  for (uint32_t i = 0; book->in_use && i < book->island_count; ++i) {
    has = has || book->islands[i].kind == kind;
  }
  return has;
}

void hapi_reuse_select(const hapi_reuse_book *book, hapi_reuse_kind kind, const hapi_slots *slots,
                       hapi_test_set *test, hapi_pushed *pushed)
{
  uint32_t kept = 0;
  if (!book->in_use) {
    return;
  }
  for (uint32_t i = 0; i < pushed->count; ++i) {
    uint32_t index = pushed->slots[i];
    if (island_of_pushed(book, test, slots, index)->kind == kind) {
      pushed->slots[kept++] = index;
    }
  }
  pushed->count = kept;
  kept = 0;
  for (uint32_t i = 0; i < test->member_count; ++i) {
    uint32_t known = test->members[i];
    if (island_of(book, test, known)->kind == kind) {
      test->places[known].member = kept;
      test->members[kept++] = known;
    } else {
      test->places[known].island = HAPI_NONE;
    }
  }
  test->member_count = kept;
}

void hapi_reuse_spoil(hapi_reuse_book *book, const hapi_test_set *test, uint32_t known)
{
  if (book->in_use) {
    island_of(book, test, known)->spoiled = true;
  }
}

static bool book_keep_touches(hapi_reuse_book *book, const hapi_print_place *old,
                              uint32_t *out_first)
{
  hapi_print_sheet *now = &book->now;
  if (!hapi_reserve((void **)&now->touches, &now->touch_capacity, now->touch_count,
                    old->touch_count, sizeof *now->touches)) {
    return false;
  }
  *out_first = now->touch_count;
  for (uint32_t i = 0; i < old->touch_count; ++i) {
    now->touches[now->touch_count++] = book->old.touches[old->first_touch + i];
  }
  return true;
}

/* What is used again goes on standing for the state that it was measured in. */
static bool book_keep_island(hapi_reuse_book *book, const hapi_reuse_island *island)
{
  hapi_print_place *place = island_place(book, island);
  hapi_print_place now = {book->round,   island->generation,  island->first,
                          island->count, island->first_touch, island->touch_count};
  if (island->kind != HAPI_REUSE_NONE) {
    now.touch_count = place->touch_count;
    if (!book_keep_touches(book, place, &now.first_touch)) {
      return false;
    }
  }
  for (uint32_t i = 0; i < island->count && island->kind != HAPI_REUSE_NONE; ++i) {
    const hapi_print_item *old = &book->old.items[place->first + i];
    hapi_print_item *item = &book->now.items[island->first + i];
    item->value = old->value;
    item->value_b = island->kind == HAPI_REUSE_ALL ? old->value_b : item->value_b;
  }
  *place = now;
  return true;
}

uint32_t hapi_reuse_keep(hapi_reuse_book *book)
{
  uint32_t reused = 0;
  for (uint32_t i = 0; book->in_use && i < book->island_count; ++i) {
    const hapi_reuse_island *island = &book->islands[i];
    if (island->spoiled || !book_keep_island(book, island)) {
      island_place(book, island)->round = 0;
    }
    reused += island->kind != HAPI_REUSE_NONE ? island->pushed_count : 0;
  }
  return reused;
}
