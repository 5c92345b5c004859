/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "research/cross.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/vec.h"

/* The testing simulations of a contact have the answers of the other bodies already; they only
 * have to be read. */

/* Of what a free body would do: below it there is nothing but the solver's rounding. */
#define SHARE_LEAST 1e-6

static bool cross_is_on(const hapi_cross *cross)
{
  return cross->cycle->config->capacity.crosses > 0 &&
         cross->cycle->model == HAP_MODEL_ACCELERANCE &&
         hapi_wish_is_on(cross->cycle->wishes, HAP_EFFECT_CROSS);
}

static void cross_count_time(hapi_cross *cross, int64_t begin_ns)
{
  cross->counts.seconds += 1e-9 * (double)(hapi_clock_now() - begin_ns);
}

static uint32_t known_of_contact(const hapi_cross *cross, uint32_t contact)
{
  return cross->slots->bodies[cross->slots->contacts[contact].body].known;
}

/* ---- a column ---- */

/* A body that the loop moves, which is under test with the contact and is not the one it pushes. */
static bool body_answers(const hapi_cross *cross, uint32_t contact, uint32_t body)
{
  const hapi_body_slot *slot = &cross->slots->bodies[body];
  if (slot->phase != HAPI_SLOT_LIVE ||
      (cross->probe->answers.bodies[body].flags & HAPI_BODY_DRIVEN) != 0 ||
      body == cross->slots->contacts[contact].body) {
    return false;
  }
  const hapi_test_set *test = &cross->probe->test;
  return hapi_test_island(test, slot->known) ==
         hapi_test_island(test, known_of_contact(cross, contact));
}

static void cross_read_column(void *user, uint32_t contact, int axis, double force)
{
  hapi_cross *cross = user;
  int64_t begin_ns = hapi_clock_now();
  for (uint32_t i = 0; i < cross->slots->body_high; ++i) {
    if (body_answers(cross, contact, i)) {
      const double *b = cross->probe->answers.bodies[i].b;
      double acceleration[6];
      hapi_test_acceleration(&cross->probe->test, cross->slots->bodies[i].known, acceleration);
      for (int k = 0; k < 6; ++k) {
        cross->columns[i][k][axis] = (acceleration[k] - b[k]) / force;
      }
    }
  }
  cross_count_time(cross, begin_ns);
}

/* ---- blocks ---- */

/* A free place, or that of the one that answers least, if that is less; NULL: there is none. */
static hapi_cross_block *block_place(hapi_cross *cross, double response)
{
  if (cross->block_count < cross->cycle->config->capacity.crosses) {
    return &cross->blocks[cross->block_count++];
  }
  ++cross->counts.dropped;
  hapi_cross_block *least = &cross->blocks[0];
  for (uint32_t i = 1; i < cross->block_count; ++i) {
    if (cross->blocks[i].response < least->response) {
      least = &cross->blocks[i];
    }
  }
  return least->response < response ? least : NULL;
}

static void block_keep(hapi_cross *cross, uint32_t contact, uint32_t body)
{
  /* (m/s^2)/N, of the body's surface. */
  const double(*column)[3] = (const double(*)[3])cross->columns[body];
  uint32_t known = cross->slots->bodies[body].known;
  double linear = 0.0;
  double angular = 0.0;
  for (int i = 0; i < 3; ++i) {
    linear += hapi_v3_dot(column[i], column[i]);
    angular += hapi_v3_dot(column[3 + i], column[3 + i]);
  }
  double response =
      sqrt(linear) + cross->probe->test.world->bodies.entries[known].extent * sqrt(angular);
  hapi_cross_block *place = block_place(cross, response);
  if (place != NULL) {
    place->contact = contact;
    place->contact_generation = cross->slots->contacts[contact].generation;
    place->body = body;
    place->body_generation = cross->slots->bodies[body].generation;
    place->response = response;
    memcpy(place->a, cross->columns[body], sizeof place->a);
  }
}

/* The bodies as they are free: what is pushed at the contact, and what answers. */
static hapi_admittance columns_tidy(hapi_cross *cross, uint32_t contact, uint32_t body,
                                    double *out_share)
{
  const hapi_contact_slot *slot = &cross->slots->contacts[contact];
  const hapi_body_answer *answers = cross->probe->answers.bodies;
  const hapi_test_set *test = &cross->probe->test;
  *out_share = 0.0;
  if (!answers[slot->body].b_is_good || !answers[body].b_is_good) {
    return HAPI_ADMITTANCE_SINGULAR;
  }
  const hapi_body_state *from = hapi_test_state(test, known_of_contact(cross, contact));
  const hapi_body_state *to = hapi_test_state(test, cross->slots->bodies[body].known);
  hapi_free_body free_from;
  hapi_free_body free_to;
  double arm[3];
  hapi_accelerance_free_body(from->body, from->rotation, &free_from);
  hapi_accelerance_free_body(to->body, to->rotation, &free_to);
  hapi_quat_rotate(from->quat, slot->point_body, arm);
  return hapi_admittance_tidy_cross(&free_from, arm, &free_to, cross->columns[body], out_share);
}

/* What is refused is left out: the body then has the world's state at the sync, and no more. */
static void cross_keep(void *user, uint32_t contact)
{
  hapi_cross *cross = user;
  int64_t begin_ns = hapi_clock_now();
  for (uint32_t i = 0; i < cross->slots->body_high; ++i) {
    double share = 0.0;
    if (body_answers(cross, contact, i)) {
      hapi_admittance kind = columns_tidy(cross, contact, i, &share);
      cross->counts.singular += kind == HAPI_ADMITTANCE_SINGULAR;
      cross->counts.clipped += kind == HAPI_ADMITTANCE_CLIPPED;
    }
    if (share > SHARE_LEAST) {
      block_keep(cross, contact, i);
    }
  }
  cross_count_time(cross, begin_ns);
}

static bool block_holds(const hapi_cross *cross, const hapi_cross_block *block)
{
  const hapi_body_slot *body = &cross->slots->bodies[block->body];
  return block->contact_generation == cross->slots->contacts[block->contact].generation &&
         body->phase == HAPI_SLOT_LIVE && block->body_generation == body->generation;
}

static bool block_stays(const hapi_cross *cross, const hapi_cross_block *block,
                        const hapi_reuse_book *book)
{
  const hapi_contact_slot *contact = &cross->slots->contacts[block->contact];
  return contact->phase == HAPI_SLOT_LIVE && contact->body != HAPI_SLOT_NONE &&
         block_holds(cross, block) &&
         hapi_reuse_kind_of(book, &cross->probe->test, known_of_contact(cross, block->contact)) !=
             HAPI_REUSE_NONE;
}

static void cross_begin(void *user, const hapi_reuse_book *book)
{
  hapi_cross *cross = user;
  uint32_t count = cross->block_count;
  cross->block_count = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (block_stays(cross, &cross->blocks[i], book)) {
      cross->blocks[cross->block_count++] = cross->blocks[i];
    }
  }
}

/* What the last force does to the body by the blocks. Of a body that is not under test b was used
 * again, with nothing in it of what the block adds. */
static void cross_take_out(void *user, uint32_t body, double io_b[6])
{
  hapi_cross *cross = user;
  int64_t begin_ns = hapi_clock_now();
  for (uint32_t i = 0; i < cross->block_count; ++i) {
    const hapi_cross_block *block = &cross->blocks[i];
    const double *force = cross->slots->contacts[block->contact].last_touch.force;
    for (int k = 0; k < 6 && block->body == body && block_holds(cross, block); ++k) {
      io_b[k] -= hapi_v3_dot(block->a[k], force);
    }
  }
  cross_count_time(cross, begin_ns);
}

/* ---- for others ---- */

bool hapi_cross_create(hapi_cross *cross, const hapi_cycle *cycle, const hapi_slots *slots,
                       const hapi_probe *probe)
{
  const hapi_capacity *capacity = &cycle->config->capacity;
  *cross = (hapi_cross){.cycle = cycle, .slots = slots, .probe = probe};
  cross->watch =
      (hapi_contact_watch){cross, cross_begin, cross_read_column, cross_keep, cross_take_out};
  cross->blocks = hapi_alloc_array(capacity->crosses, sizeof *cross->blocks);
  cross->columns = hapi_alloc_array(capacity->bodies, sizeof *cross->columns);
  return cross->blocks != NULL && cross->columns != NULL;
}

void hapi_cross_finish(hapi_cross *cross)
{
  hapi_free(cross->blocks);
  hapi_free(cross->columns);
  memset(cross, 0, sizeof *cross);
}

void hapi_cross_reset(hapi_cross *cross)
{
  cross->block_count = 0;
  cross->counts = (hapi_cross_counts){0};
}

bool hapi_cross_is_full(const hapi_cross *cross)
{
  return cross_is_on(cross) && cross->block_count == cross->cycle->config->capacity.crosses;
}

const hapi_contact_watch *hapi_cross_watch(hapi_cross *cross)
{
  if (cross_is_on(cross)) {
    return &cross->watch;
  }
  bool tests =
      cross->cycle->model == HAP_MODEL_ACCELERANCE || cross->cycle->model == HAP_MODEL_CONTACT;
  cross->block_count = tests ? 0 : cross->block_count; /* they are of older simulations then */
  return NULL;
}

void hapi_cross_publish(hapi_cross *cross, uint32_t contact, uint32_t number, hapi_model *out)
{
  if (!cross_is_on(cross)) {
    return;
  }
  int64_t begin_ns = hapi_clock_now();
  for (uint32_t i = 0; i < cross->block_count; ++i) {
    const hapi_cross_block *block = &cross->blocks[i];
    if (block->contact == contact && block_holds(cross, block)) {
      hapi_model_cross *place = &hapi_model_crosses(out)[out->cross_count++];
      place->contact = number;
      place->body = block->body;
      memcpy(place->a, block->a, sizeof place->a);
    }
  }
  cross_count_time(cross, begin_ns);
}
