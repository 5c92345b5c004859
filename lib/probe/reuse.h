/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_REUSE_H
#define HAPODE_PROBE_REUSE_H

/* Testing simulations that need not be made again (hap_expert_def.reuse). All that decides what
 * they find is written down when they are made: of the world, of each body of the island, of its
 * contacts, joints and pushes. At the next step it is written down anew and compared value by
 * value. No flag says that something has changed, as the application may change anything. */

#include <stdbool.h>
#include <stdint.h>

#include "probe/answers.h"
#include "probe/test_set.h"
#include "world/cycle.h"

/* One value of an island. Off by d it moves a body by d x weight in a step. */
typedef struct hapi_print_item {
  double value;   /* when A was measured */
  double value_b; /* when b was */
  double weight;  /* m per unit of the value; negative: it must be the same */
} hapi_print_item;

/* A point where two bodies touch, or one and the static world. Those of a pair are a set: colliders
 * find the same points in another order, or one of them twice, when a body has moved by its last
 * digit. */
typedef struct hapi_touch_print {
  uint64_t births[2]; /* 0: static world; the points of an island are sorted by them */
  uint64_t surface;   /* hash */
  double arm;         /* m, to the far point of the first body */
  double position[3];
  double normal[3];
  double direction[3]; /* first one of friction, if it is given */
  double depth;
} hapi_touch_print;

/* Where the items of an island are, kept by the slot of its first body. */
typedef struct hapi_print_place {
  uint64_t round;      /* of the book; 0: none */
  uint32_t generation; /* of the slot */
  uint32_t first;
  uint32_t count;
  uint32_t first_touch;
  uint32_t touch_count;
} hapi_print_place;

typedef enum hapi_reuse_kind {
  HAPI_REUSE_NONE = 0, /* A and b are measured */
  HAPI_REUSE_A,        /* b alone is */
  HAPI_REUSE_ALL       /* no step is made of the island */
} hapi_reuse_kind;

typedef struct hapi_reuse_island {
  hapi_reuse_kind kind;
  uint32_t first_member; /* in the test set, as it was gathered */
  uint32_t member_count;
  uint32_t slot;       /* of the first member */
  uint32_t generation; /* of that slot */
  uint32_t first;      /* its items */
  uint32_t count;
  uint32_t first_touch;
  uint32_t touch_count;
  uint32_t pushed; /* first of what is pushed in it: contact slot or body slot; HAPI_NONE: none */
  uint32_t pushed_count;
  bool spoiled;    /* the items do not stand for what the answers hold */
  bool has_joints; /* the application's: not all of what they are has a getter */
} hapi_reuse_island;

typedef struct hapi_member_birth {
  uint64_t birth;
  uint32_t known;
} hapi_member_birth;

/* Items and touches of a round. */
typedef struct hapi_print_sheet {
  hapi_print_item *items;
  uint32_t count;
  uint32_t capacity;
  hapi_touch_print *touches;
  uint32_t touch_count;
  uint32_t touch_capacity;
} hapi_print_sheet;

/* Of one round of testing simulations in each cycle. */
typedef struct hapi_reuse_book {
  bool bodies; /* what is pushed are bodies, else contacts */
  bool in_use; /* this round */
  uint64_t round;
  hapi_print_sheet now;
  hapi_print_sheet old;      /* of the round before */
  hapi_print_place *places;  /* by body slot */
  uint32_t *next_pushed;     /* by slot of what is pushed: the next one of its island */
  hapi_member_birth *births; /* of the members of an island, sorted */
  uint32_t birth_capacity;
  hapi_reuse_island *islands;
  uint32_t island_count;
  uint32_t island_capacity;
} hapi_reuse_book;

#define HAPI_REUSE_CONTACTS 0 /* book of accelerance.c */
#define HAPI_REUSE_BODIES 1   /* of operating_point.c */
#define HAPI_REUSE_BOOKS 2

typedef struct hapi_reuse {
  bool wanted; /* in this cycle */
  hapi_reuse_book books[HAPI_REUSE_BOOKS];
} hapi_reuse;

/* Slots of what is pushed in testing simulations: contacts or bodies. */
typedef struct hapi_pushed {
  uint32_t *slots;
  uint32_t count;
  uint32_t capacity;
} hapi_pushed;

/* What a round of testing simulations reads. */
typedef struct hapi_reuse_input {
  const hapi_cycle *cycle;
  const hapi_slots *slots;
  const hapi_answers *answers;
  const hapi_test_set *test; /* as gathered */
} hapi_reuse_input;

/* reuse.c */
bool hapi_reuse_create(hapi_reuse *reuse, const hapi_capacity *capacity);
void hapi_reuse_finish(hapi_reuse *reuse);
void hapi_reuse_reset(hapi_reuse *reuse);
/* Before the collision phase, whose contacts must be noted where it returns true. allowed: false
 * measures all anew. */
bool hapi_reuse_open(hapi_reuse *reuse, const hapi_cycle *cycle, bool allowed);
/* After the islands of a round are gathered: which of them were tested before and are as they
 * were. */
void hapi_reuse_look(hapi_reuse *reuse, hapi_reuse_book *book, const hapi_reuse_input *input,
                     const hapi_pushed *pushed);
bool hapi_reuse_has(const hapi_reuse_book *book, hapi_reuse_kind kind);
/* Of the island of a body; HAPI_REUSE_NONE where it is not under test. */
hapi_reuse_kind hapi_reuse_kind_of(const hapi_reuse_book *book, const hapi_test_set *test,
                                   uint32_t known);
/* Islands of other kinds leave the test set, and what is pushed in them; gathered again they are
 * there. */
void hapi_reuse_select(const hapi_reuse_book *book, hapi_reuse_kind kind, const hapi_slots *slots,
                       hapi_test_set *test, hapi_pushed *pushed);
/* The island of a body under test: what was found is no good, and nothing of it is used again. */
void hapi_reuse_spoil(hapi_reuse_book *book, const hapi_test_set *test, uint32_t known);
/* Last, unless it failed. Returns how much of what is pushed was not measured anew. */
uint32_t hapi_reuse_keep(hapi_reuse_book *book);

/* reuse_print.c: all that decides what is found of an island, into the book. False: something
 * has no getter, or there is no memory. */
bool hapi_print_island(const hapi_reuse_input *input, hapi_reuse_book *book,
                       hapi_reuse_island *island);

#endif
