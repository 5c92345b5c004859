/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_SHARES_H
#define HAPODE_REMOTE_SHARES_H

/* Which loop moves which body. Bodies that may touch each other, or hang together, before the next
 * sync are an island. An island that hands of one guest reach is that guest's. One that hands of
 * several guests reach is moved by the world's own loop, with all these hands; each of the guests
 * has a copy. It stays so until no hand reaches it: a change of the loop is a change of the body's
 * place by what messages take. Where the guest that moves an island holds a body of it, or the
 * world has no loop of its own, one guest moves it, and it is a moved wall for the others. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/messages.h"

#define HAPI_GUESTS_MOST 32u /* bits of a set */
#define HAPI_GUEST_NONE 0xffu

/* Of the body of a slot. */
typedef struct hapi_share {
  uint32_t generation; /* 0: no model had the slot */
  uint64_t since;      /* the model with which that loop came to move it */
  uint32_t link;       /* scratch: another body of the island, or itself */
  uint32_t hands;      /* of the island, in the newest model: set of guests */
  uint8_t of;          /* whose loop moves it */
  uint8_t before;      /* the guest that moved it up to the newest model; HAPI_GUEST_NONE: none */
  uint8_t chosen;      /* scratch, of an island: who shall move it */
  uint32_t holders;    /* of the island: set of guests whose hands hold a body of it */
  bool there;          /* in the newest model, and not driven */
  bool wanted;         /* scratch: goes to the guest */
} hapi_share;

/* A hand in the world, by its number there. */
typedef struct hapi_share_hand {
  uint8_t guest;                   /* HAPI_GUEST_NONE: there is none */
  uint32_t pointer;                /* its guest's number of it */
  uint32_t generation;             /* in the world */
  uint32_t own;                    /* its guest's generation */
  const hapi_state_pointer *state; /* what its guest told last; NULL: nothing */
  const hapi_tool_hull *hull;
  bool goes; /* scratch: the guest has to know it */
} hapi_share_hand;

typedef struct hapi_shares {
  hapi_share *of;         /* by slot */
  hapi_share_hand *hands; /* by number */
  uint32_t *places;       /* scratch: 1 + place in what is cut, of geoms, triangles, tools */
  uint32_t body_count;
  uint32_t hand_count;
  uint8_t loop;    /* the guest that is the world's own loop; HAPI_GUEST_NONE: it has none */
  uint32_t shared; /* bodies of it in the newest model */
} hapi_shares;

/* False: no memory; finish is due all the same. */
bool hapi_shares_create(hapi_shares *shares, const hapi_capacity *capacity);
void hapi_shares_finish(hapi_shares *shares); /* zeroed allowed */

/* Of a new model. */
void hapi_shares_find(hapi_shares *shares, hapi_model *model, hapi_near *near);
/* The guest has gone, and what it moved is nobody's. */
void hapi_shares_leave(hapi_shares *shares, uint8_t guest);

/* What the guest is to have of a model and its near message, under its own numbers of its hands.
 * *out_model, *out_near: of the same capacity, with their arrays laid out. */
void hapi_shares_cut(const hapi_shares *shares, uint8_t guest, hapi_model *model, hapi_near *near,
                     hapi_model *out_model, hapi_near *out_near);
/* Whether the guest's loop moves the body: as its own, or a copy of it. */
bool hapi_shares_moves(const hapi_shares *shares, uint8_t guest, uint32_t slot);
/* Number of a hand in the messages to a guest: its own number, or this behind all of those. */
static inline uint32_t hapi_share_number(const hapi_shares *shares, uint8_t guest, uint32_t hand)
{
  return shares->hands[hand].guest == guest ? shares->hands[hand].pointer
                                            : shares->hand_count + hand;
}

#endif
