/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/kept.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "base/vec.h"
#include "contact/rule.h"

#define NONE HAPI_SLOT_NONE

#define TABLE_SHARE 4u /* the next power of two behind twice as many */

/* An angle is not more than this times the length of the difference of the quaternions: 4 asin(d/2)
 * of d, up to a radian. */
#define TURN_OF_CHORD 2.1
#define CHORD_MOST 0.5

bool hapi_kept_create(hapi_kept *kept, const hapi_capacity *capacity, bool asks)
{
  kept->contact_capacity = capacity->contacts;
  kept->pairs = hapi_alloc_array(capacity->pairs, sizeof *kept->pairs);
  kept->older = hapi_alloc_array(capacity->pairs, sizeof *kept->older);
  kept->contacts = hapi_alloc_array(capacity->contacts, sizeof *kept->contacts);
  kept->next = hapi_alloc_array(capacity->contacts, sizeof *kept->next);
  kept->table = hapi_alloc_array(capacity->pairs, TABLE_SHARE * sizeof *kept->table);
  kept->ends = asks ? hapi_alloc_array(capacity->contacts, sizeof *kept->ends) : NULL;
  return kept->pairs != NULL && kept->older != NULL && kept->contacts != NULL &&
         kept->next != NULL && kept->table != NULL && (!asks || kept->ends != NULL);
}

void hapi_kept_finish(hapi_kept *kept)
{
  hapi_free(kept->pairs);
  hapi_free(kept->older);
  hapi_free(kept->contacts);
  hapi_free(kept->next);
  hapi_free(kept->ends);
  hapi_free(kept->table);
  *kept = (hapi_kept){0};
}

void hapi_kept_begin(hapi_kept *kept)
{
  kept->count = 0;
  for (uint32_t i = 0; i < kept->contact_capacity; ++i) {
    kept->next[i] = i + 1 < kept->contact_capacity ? i + 1 : NONE;
  }
  kept->free = kept->contact_capacity > 0 ? 0 : NONE;
}

/* ---- contacts ---- */

static void pair_forget(hapi_kept *kept, hapi_kept_pair *pair)
{
  while (pair->contacts != NONE) {
    uint32_t contact = pair->contacts;
    pair->contacts = kept->next[contact];
    kept->next[contact] = kept->free;
    kept->free = contact;
  }
  pair->count = 0;
  pair->valid = false;
}

/* The list is last first; it is read backwards, see hapi_kept_add. */
void hapi_kept_add(hapi_kept *kept, hapi_kept_pair *pair, const hapi_patch_contact *contact,
                   const hapi_kept_ends *ends)
{
  uint32_t at = kept->free;
  if (at == NONE) {
    pair_forget(kept, pair);
    return;
  }
  uint32_t *last = &pair->contacts;
  while (*last != NONE) {
    last = &kept->next[*last];
  }
  kept->free = kept->next[at];
  kept->next[at] = NONE;
  *last = at;
  kept->contacts[at] = *contact;
  if (ends != NULL && kept->ends != NULL) {
    kept->ends[at] = *ends;
  }
  pair->count += 1;
  pair->by_world = pair->by_world ||
                   (contact->touch != HAPI_TOUCH_FACE_A && contact->touch != HAPI_TOUCH_FACE_B);
}

/* ---- a new message ---- */

/* What the pairs of one key are; not yet what was found of them. Returns the first one behind. */
static uint32_t pair_describe(const hapi_places *places, uint32_t first, hapi_kept_pair *out)
{
  const hapi_near_pair *pairs = hapi_near_pairs(places->near);
  uint32_t end = first;
  *out = (hapi_kept_pair){.key = pairs[first].key,
                          .stamp = HAPI_HASH_BEGIN,
                          .first = first,
                          .geoms = {pairs[first].geom_a, pairs[first].geom_b},
                          .contacts = NONE};
  for (; end < places->near->pair_count && pairs[end].key == pairs[first].key; ++end) {
    const hapi_geom_trait *a = &places->geoms[pairs[end].geom_a];
    const hapi_geom_trait *b = &places->geoms[pairs[end].geom_b];
    out->stamp = hapi_hash_word(hapi_hash_word(out->stamp, a->stamp), b->stamp);
    out->extents[0] = hapi_max(a->extent, out->extents[0]);
    out->extents[1] = hapi_max(b->extent, out->extents[1]);
  }
  out->pairs = end - first;
  return end;
}

/* What was found of a pair of the message before goes over to the pair of this one. */
static void pair_hand_over(hapi_kept_pair *from, hapi_kept_pair *to)
{
  hapi_kept_pair now = *to;
  *to = *from;
  to->first = now.first;
  to->geoms[0] = now.geoms[0];
  to->geoms[1] = now.geoms[1];
  from->contacts = NONE;
  from->valid = false;
}

/* At most half full; keys are mixed well. */
static void table_fill(hapi_kept *kept, uint32_t count)
{
  kept->places = 2;
  while (kept->places < 2 * count) {
    kept->places *= 2;
  }
  memset(kept->table, 0, kept->places * sizeof *kept->table);
  for (uint32_t i = 0; i < count; ++i) {
    uint32_t at = (uint32_t)kept->older[i].key & (kept->places - 1);
    while (kept->table[at] != 0) {
      at = (at + 1) & (kept->places - 1);
    }
    kept->table[at] = i + 1;
  }
}

/* Two messages are mostly in the same order. */
static hapi_kept_pair *older_find(hapi_kept *kept, uint32_t count, uint64_t key, uint32_t *io_at)
{
  if (*io_at < count && kept->older[*io_at].key == key) {
    return &kept->older[(*io_at)++];
  }
  if (kept->places == 0) {
    table_fill(kept, count);
  }
  for (uint32_t i = (uint32_t)key & (kept->places - 1); kept->table[i] != 0;
       i = (i + 1) & (kept->places - 1)) {
    hapi_kept_pair *found = &kept->older[kept->table[i] - 1];
    if (found->key == key) {
      *io_at = kept->table[i];
      return found;
    }
  }
  return NULL;
}

void hapi_kept_take_near(hapi_kept *kept, const hapi_places *places)
{
  hapi_kept_pair *older = kept->pairs;
  uint32_t count = kept->count;
  uint32_t at = 0;
  kept->pairs = kept->older;
  kept->older = older;
  kept->count = 0;
  kept->places = 0;
  for (uint32_t i = 0; i < places->near->pair_count;) {
    hapi_kept_pair *pair = &kept->pairs[kept->count++];
    i = pair_describe(places, i, pair);
    hapi_kept_pair *from = older_find(kept, count, pair->key, &at);
    if (from != NULL && from->stamp == pair->stamp && from->pairs == pair->pairs) {
      pair_hand_over(from, pair);
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    pair_forget(kept, &older[i]);
  }
}

/* ---- whether it holds ---- */

/* The body that is seen from the other: the one that reaches less far, or does not stand still. */
static bool first_is_seen(const hapi_kept_pair *pair, const hapi_pass_body *a,
                          const hapi_pass_body *b)
{
  return b == NULL || (a != NULL && pair->extents[0] <= pair->extents[1]);
}

static void pose_apart(const hapi_pass_body *seen, const hapi_pass_body *from, hap_pose *out)
{
  if (from == NULL) {
    *out = seen->pose;
    return;
  }
  const double *q = from->pose.quat_wxyz;
  const double back[4] = {q[0], -q[1], -q[2], -q[3]};
  hapi_pose_unpoint(from->pose.position, q, seen->pose.position, out->position);
  hapi_quat_multiply(back, seen->pose.quat_wxyz, out->quat_wxyz);
}

/* Length of the difference; q and -q are the same turn. */
static double quat_chord(const double p[4], const double q[4])
{
  double sum2 = 0.0;
  double difference2 = 0.0;
  for (int i = 0; i < 4; ++i) {
    sum2 += (p[i] + q[i]) * (p[i] + q[i]);
    difference2 += (p[i] - q[i]) * (p[i] - q[i]);
  }
  return sqrt(hapi_min(sum2, difference2));
}

/* m, infinite beyond a radian. */
static double pair_moved(const hapi_kept_pair *pair, const hapi_pass_body *a,
                         const hapi_pass_body *b)
{
  hap_pose now;
  double way[3];
  bool first = first_is_seen(pair, a, b);
  pose_apart(first ? a : b, first ? b : a, &now);
  hapi_v3_sub(now.position, pair->apart.position, way);
  double chord = quat_chord(now.quat_wxyz, pair->apart.quat_wxyz);
  double turned = TURN_OF_CHORD * chord * pair->extents[first ? 0 : 1];
  return chord <= CHORD_MOST ? hapi_v3_norm(way) + turned : HUGE_VAL;
}

static bool pair_has_turned(const hapi_kept_pair *pair, const hapi_pass_body *a,
                            const hapi_pass_body *b)
{
  const hapi_pass_body *seen = first_is_seen(pair, a, b) ? a : b;
  return pair->by_world && !(quat_chord(seen->pose.quat_wxyz, pair->quat) <= HAPI_KEPT_TURN);
}

static uint64_t body_stay(const hapi_pass_body *body)
{
  return body == NULL ? 0 : body->stay;
}

/* m: how far the bodies may go. */
static double pair_way(const hapi_kept_pair *pair, const hapi_pass_body *a, const hapi_pass_body *b)
{
  double extent = first_is_seen(pair, a, b) ? pair->extents[0] : pair->extents[1];
  return hapi_min(HAPI_KEPT_SHARE * extent, HAPI_KEPT_WAY);
}

/* A margin has a floor beside what the speeds ask for; half of the floor is for what is kept. */
bool hapi_kept_holds(hapi_kept_pair *pair, const hapi_pass_body *a, const hapi_pass_body *b,
                     double margin)
{
  if (!pair->valid || (a == NULL && b == NULL)) {
    return false;
  }
  if (pair->stays[0] != body_stay(a) || pair->stays[1] != body_stay(b)) {
    pair->moved = pair_moved(pair, a, b);
    pair->stays[0] = body_stay(a);
    pair->stays[1] = body_stay(b);
  }
  if (pair->count == 0 && pair->clear > 0.0) {
    return pair->moved + margin <= pair->clear;
  }
  double asked = margin - 0.5 * HAPI_MARGIN_FLOOR;
  return pair->moved <= pair_way(pair, a, b) && pair->moved + asked <= pair->margin &&
         !pair_has_turned(pair, a, b);
}

void hapi_kept_find(hapi_kept *kept, hapi_kept_pair *pair, const hapi_pass_body *a,
                    const hapi_pass_body *b, double margin)
{
  pair_forget(kept, pair);
  if (a == NULL && b == NULL) {
    return;
  }
  bool first = first_is_seen(pair, a, b);
  const hapi_pass_body *seen = first ? a : b;
  pose_apart(seen, first ? b : a, &pair->apart);
  memcpy(pair->quat, seen->pose.quat_wxyz, sizeof pair->quat);
  pair->stays[0] = body_stay(a);
  pair->stays[1] = body_stay(b);
  pair->moved = 0.0;
  pair->margin = margin;
  pair->clear = 0.0;
  pair->gap = HUGE_VAL;
  pair->by_world = false;
  pair->valid = true;
}

/* ---- what is found again ---- */

#define AGAIN_SHARE 0.5 /* of pair_way: crossing edges meet elsewhere on themselves */
#define AGAIN_MOST 64u  /* contacts of a pair: of more all are new */

/* What has ended leaves its place to the next new one: what comes after it stays where it is. */
static void order_fill(const hapi_patch_contact *in, uint32_t count, uint32_t places,
                       uint32_t *io_order)
{
  uint32_t next = 0;
  uint32_t used = 0;
  for (uint32_t i = 0; i < places || used < count; ++i) {
    uint32_t index = i < places ? io_order[i] : NONE;
    while (index == NONE && next < count && in[next].number != 0) {
      ++next;
    }
    index = index == NONE && next < count ? next++ : index;
    if (index != NONE) {
      io_order[used++] = index;
    }
  }
}

/* m, of crossing edges, see pair_way: the static world has an extent of 0. */
static double again_way(const hapi_kept_pair *pair)
{
  const double *e = pair->extents;
  double extent = e[1] <= 0.0 || (e[0] > 0.0 && e[0] <= e[1]) ? e[0] : e[1];
  return AGAIN_SHARE * hapi_min(HAPI_KEPT_SHARE * extent, HAPI_KEPT_WAY);
}

void hapi_kept_go_on(const hapi_kept *kept, const hapi_kept_pair *pair, hapi_patch_contact *io,
                     uint32_t count, uint32_t *out_order)
{
  uint32_t order[2 * AGAIN_MOST];
  uint32_t places = 0;
  double way = again_way(pair);
  for (uint32_t i = 0; i < count; ++i) {
    io[i].number = 0;
    out_order[i] = i;
  }
  if (!pair->valid || pair->count > AGAIN_MOST || count > AGAIN_MOST) {
    return;
  }
  for (uint32_t old = pair->contacts; old != NONE; old = kept->next[old]) {
    uint32_t found = 0;
    while (found < count &&
           (io[found].number != 0 || !hapi_rule_is_same(&kept->contacts[old], &io[found], way))) {
      ++found;
    }
    order[places++] = found < count ? found : NONE;
    if (found < count) {
      io[found] = kept->contacts[old];
    }
  }
  for (uint32_t i = 0; i < count; ++i) {
    for (uint32_t k = 0; io[i].number == 0 && k < count; ++k) {
      if (io[k].number != 0 && hapi_rule_is_of_face(&io[k], &io[i])) {
        hapi_v3_copy(io[k].normal, io[i].normal); /* to the last bit: see packs.h */
      }
    }
  }
  order_fill(io, count, places, order);
  memcpy(out_order, order, count * sizeof *order);
}
