/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What contacts between bodies keep from one message to the next one, wherever they stand in it. */

#include "tests/tap.h"

#include <stdlib.h>

#include "base/vec.h"
#include "local/contact_memory.h"
#include "local/contact_run.h"
#include "sync/exchange.h"

#define CONTACTS 8u
#define BUCKETS 16u
#define ROWS 3u /* of a contact */

typedef struct things {
  hapi_exchange *messages[2]; /* in turn: the loop looks at the newest one */
  int turn;
  hapi_contact_memory memory[2][CONTACTS];
  hapi_contact_run runs[CONTACTS];
  uint8_t run_lengths[CONTACTS];
  uint32_t buckets[BUCKETS];
  hapi_row_source sources[ROWS * CONTACTS];
  hapi_body_contacts contacts;
  hapi_rows rows;
} things;

/* Of a pair each; contacts of the same pair follow each other. */
typedef struct told_contact {
  uint64_t key;
  uint64_t number;
  double at; /* m, along x of the first body */
} told_contact;

static things *things_new(void)
{
  const hapi_capacity capacity = {2, CONTACTS, 1, 1, 1, 0, 0, 1};
  things *t = aligned_alloc(HAPI_CACHE_LINE, (sizeof *t / HAPI_CACHE_LINE + 1) * HAPI_CACHE_LINE);
  REQUIRE(t != NULL);
  memset(t, 0, sizeof *t);
  for (int i = 0; i < 2; ++i) {
    REQUIRE(hapi_exchange_create(&capacity, &t->messages[i]) >= HAP_OK);
  }
  t->contacts = (hapi_body_contacts){.memory = t->memory[0],
                                     .old_memory = t->memory[1],
                                     .runs = t->runs,
                                     .run_lengths = t->run_lengths,
                                     .buckets = t->buckets,
                                     .bucket_count = BUCKETS};
  t->rows.sources = t->sources;
  t->rows.capacity = ROWS * CONTACTS;
  return t;
}

static void things_free(things *t)
{
  hapi_exchange_destroy(t->messages[0]);
  hapi_exchange_destroy(t->messages[1]);
  free(t);
}

static void message_adopt(things *t, const told_contact *told, uint32_t count, double mu)
{
  hapi_patches *patches = hapi_exchange_patches_back(t->messages[t->turn]);
  t->turn = 1 - t->turn;
  patches->contact_count = count;
  patches->surface_count = 1;
  hapi_patches_surfaces(patches)[0] = (hapi_surface){.mu = mu};
  for (uint32_t i = 0; i < count; ++i) {
    hapi_patches_contacts(patches)[i] =
        (hapi_patch_contact){.key = told[i].key, .number = told[i].number, .core_a = {told[i].at}};
  }
  hapi_body_contacts_adopt(&t->contacts, patches, &t->rows);
}

/* As a tick leaves them: each has its rows and an impulse of its own. */
static void rows_leave(things *t)
{
  t->rows.solver.row_count = 0;
  for (uint32_t i = 0; i < t->contacts.memory_count; ++i) {
    hapi_contact_memory *memory = &t->contacts.memory[i];
    memory->impulse[0] = (double)memory->number;
    memory->kept.what = HAPI_KEPT_ROWS;
    memory->kept.first = t->rows.solver.row_count;
    memory->kept.count = ROWS;
    for (uint32_t k = 0; k < ROWS; ++k) {
      t->sources[t->rows.solver.row_count++] =
          (hapi_row_source){.contact = i, .part = (uint8_t)k, .count = k == 0 ? ROWS : 0};
    }
  }
}

static bool has_rows(const things *t, uint32_t index, uint32_t first)
{
  const hapi_contact_kept *kept = &t->contacts.memory[index].kept;
  bool its = kept->what == HAPI_KEPT_ROWS && kept->first == first;
  for (uint32_t k = 0; its && k < ROWS; ++k) {
    its = t->sources[first + k].contact == index;
  }
  return its;
}

static const told_contact four[] = {{1, 11, 0.0}, {2, 12, 0.0}, {2, 13, 0.1}, {3, 14, 0.0}};

TEST(rows_go_with_contacts_that_come_earlier)
{
  things *t = things_new();
  message_adopt(t, four, 4, 0.0);
  rows_leave(t);
  message_adopt(t, four + 1, 3, 0.0); /* the first one has ended */
  for (uint32_t i = 0; i < 3; ++i) {
    CHECK(t->contacts.memory[i].number == 12 + i);
    CHECK(t->contacts.memory[i].impulse[0] == 12.0 + i);
    CHECK(has_rows(t, i, ROWS * (i + 1)));
  }
  things_free(t);
}

TEST(rows_go_with_contacts_that_come_later)
{
  const told_contact five[] = {
      {1, 11, 0.0}, {9, 20, 0.0}, {2, 12, 0.0}, {2, 13, 0.1}, {3, 14, 0.0}};
  things *t = things_new();
  message_adopt(t, four, 4, 0.0);
  rows_leave(t);
  message_adopt(t, five, 5, 0.0);
  CHECK(has_rows(t, 0, 0));
  CHECK(t->contacts.memory[1].kept.what == HAPI_KEPT_NOTHING);
  CHECK(t->contacts.memory[1].impulse[0] == 0.0);
  for (uint32_t i = 2; i < 5; ++i) {
    CHECK(t->contacts.memory[i].impulse[0] == 10.0 + i);
    CHECK(has_rows(t, i, ROWS * (i - 1)));
  }
  CHECK(t->contacts.adopted);
  things_free(t);
}

/* The nearest old one is still there, farther back: its impulses stay its own. */
TEST(a_new_contact_takes_impulses_of_ended_ones_alone)
{
  const told_contact renewed[] = {{2, 21, 0.001}, {2, 23, 0.5}, {2, 12, 0.0}, {2, 13, 0.1}};
  const told_contact moved[] = {{2, 22, 0.101}, {2, 12, 0.0}};
  things *t = things_new();
  message_adopt(t, four, 4, 0.0);
  rows_leave(t);
  t->contacts.adopted = false;
  message_adopt(t, renewed, 4, 0.0);
  CHECK(t->contacts.adopted); /* as many as before, but others */
  CHECK(t->contacts.memory[0].impulse[0] == 0.0 && t->contacts.memory[1].impulse[0] == 0.0);
  CHECK(t->contacts.memory[2].impulse[0] == 12.0 && t->contacts.memory[3].impulse[0] == 13.0);
  rows_leave(t);
  message_adopt(t, moved, 2, 0.0); /* 13 has ended near the new one */
  CHECK(t->contacts.memory[0].impulse[0] == 13.0 && t->contacts.memory[1].impulse[0] == 12.0);
  /* The rows of a pair are made together. */
  CHECK(t->contacts.memory[1].kept.what == HAPI_KEPT_NOTHING);
  things_free(t);
}

/* Rows that others were written over, and those of another surface, are made anew. */
TEST(rows_that_are_not_there_do_not_go_on)
{
  things *t = things_new();
  message_adopt(t, four, 4, 0.0);
  rows_leave(t);
  t->sources[ROWS * 1].contact = 3;
  t->rows.solver.row_count -= ROWS; /* of the last one */
  message_adopt(t, four + 1, 3, 0.0);
  CHECK(t->contacts.memory[0].kept.what == HAPI_KEPT_NOTHING);
  CHECK(has_rows(t, 1, ROWS * 2));
  CHECK(t->contacts.memory[2].kept.what == HAPI_KEPT_NOTHING);
  CHECK(t->sources[ROWS * 1].contact == 3); /* they are another's */
  rows_leave(t);
  message_adopt(t, four, 4, 1e-3);
  for (uint32_t i = 0; i < 4; ++i) {
    CHECK(t->contacts.memory[i].kept.what == HAPI_KEPT_NOTHING);
    CHECK(t->contacts.memory[i].impulse[0] == (i > 0 ? 11.0 + i : 0.0));
  }
  things_free(t);
}

static bool runs_are(const things *t, uint8_t first, uint8_t second)
{
  const uint8_t *lengths = t->contacts.run_lengths;
  return lengths[0] == first && lengths[1] == second && lengths[2] == 0 && lengths[3] == 0 &&
         lengths[4] == 0;
}

/* One with the first contact, another with the three of a pair. */
static void runs_leave(things *t)
{
  memset(t->run_lengths, 0, sizeof t->run_lengths);
  t->run_lengths[0] = 1;
  t->run_lengths[1] = 3;
}

TEST(a_run_ends_where_one_of_its_contacts_comes_goes_or_changes)
{
  static const told_contact all[] = {
      {1, 11, 0.0}, {2, 12, 0.0}, {2, 13, 0.1}, {2, 14, 0.2}, {3, 15, 0.0}};
  static const told_contact middle[] = {
      {1, 11, 0.0}, {2, 12, 0.0}, {2, 21, 0.1}, {2, 14, 0.2}, {3, 15, 0.0}};
  static const told_contact last[] = {{1, 11, 0.0}, {2, 12, 0.0}, {2, 13, 0.1}};
  static const told_contact more[] = {
      {1, 11, 0.0}, {2, 12, 0.0}, {2, 13, 0.1}, {2, 14, 0.2}, {2, 16, 0.3}};
  static const told_contact other[] = {
      {4, 31, 0.0}, {2, 12, 0.0}, {2, 13, 0.1}, {2, 14, 0.2}, {3, 15, 0.0}};
  static const struct {
    const told_contact *told;
    uint32_t count;
    double mu;
    uint8_t first;
    uint8_t second;
  } cases[] = {{all, 5, 0.0, 1, 3},  {middle, 5, 0.0, 1, 0}, {last, 3, 0.0, 1, 0},
               {more, 5, 0.0, 1, 0}, {other, 5, 0.0, 0, 3},  {all, 5, 1e-3, 0, 0}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    things *t = things_new();
    message_adopt(t, all, 5, 0.0);
    rows_leave(t);
    runs_leave(t);
    message_adopt(t, cases[i].told, cases[i].count, cases[i].mu);
    CHECK_SAY(runs_are(t, cases[i].first, cases[i].second), "case %zu: %d %d", i, t->run_lengths[0],
              t->run_lengths[1]);
    things_free(t);
  }
}
