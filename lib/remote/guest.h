/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_GUEST_H
#define HAPODE_REMOTE_GUEST_H

/* A loop that takes part in a world: that of a client, or the world's own. What it has told, what
 * of that counts, and under which numbers its hands are in the world. */

#include "remote/bound.h"
#include "remote/end.h"
#include "remote/scenery.h"
#include "remote/shares.h"
#include "sync/exchange.h"

/* Of the body of a slot. */
typedef struct hapi_guest_body {
  uint32_t generation; /* of what follows; 0: the guest was never told of the slot */
  double told[6];      /* N s, N m s: totals of what it gave */
  double uncounted[6]; /* of that: given while the body was another's */
  double gain[6];      /* N s, N m s, as told */
  int64_t until_ns;    /* up to here it has let go of bodies that were another's */
  uint64_t mine_to;    /* newest model that gave the body to it */
  uint64_t owned_to;   /* newest model in which it was to move the body */
} hapi_guest_body;

/* A hand of a guest, by the guest's number of the pointer. */
typedef struct hapi_guest_hand {
  uint32_t generation; /* of the guest's pointer; 0: none */
  uint32_t number;     /* of the pointer in the world */
} hapi_guest_hand;

typedef struct hapi_guest {
  hapi_end end; /* of a client; joined: also of the world's own loop */
  hapi_bound bound;
  bool admitted; /* the client has told its terms, and they fit */
  bool draws;    /* it wants to know where bodies are that it does not move */
  hapi_scenery scenery;
  bool fresh;     /* the state has come since the last one was made for physics */
  bool has_state; /* *state is what it told last, as far as it may */
  bool leaves;    /* it has gone: its state is its last one */
  hapi_state *state;
  hapi_guest_body *bodies; /* by slot */
  hapi_guest_hand *hands;  /* by its own number of a pointer */
  hapi_state_joint *given; /* by slot of a joint: totals as told */
  double uncounted[3];     /* N s: what its hands gave to bodies that were another's */
  uint64_t tick;           /* of the newest state */
  uint64_t model_number;   /* that it has used */
  int64_t model_ns;        /* when that was told first */
  int64_t bounded_ns;      /* since when its states are beyond the bound; 0: the newest was not */
  uint32_t taken;          /* messages in this cycle */
  int64_t flood_ns;        /* since when there are too many in each; 0: the last one was good */
} hapi_guest;

/* late_s: see hapi_bound. HAP_ERROR_MEMORY; finish is due all the same. */
hap_status hapi_guest_create(hapi_guest *guest, const hapi_exchange *exchange, double late_s);
void hapi_guest_finish(hapi_guest *guest); /* zeroed allowed */
/* It is another one, of which nothing is known. */
void hapi_guest_begin(hapi_guest *guest, int64_t now_ns, const hapi_capacity *capacity);

/* A state that it tells. What it says of bodies that it was not given is left out. False: the rest
 * is beyond what it can do, and *why says how. */
bool hapi_guest_admit(hapi_guest *guest, int64_t now_ns, hapi_state *io, hap_detail *why);
/* The same of the world's own loop, which is believed. */
void hapi_guest_own(const hapi_guest *guest, hapi_state *io);
/* Takes it over. shares: by slot, and number: whose of them is this guest's. */
void hapi_guest_take(hapi_guest *guest, int64_t now_ns, hapi_state *state, size_t size,
                     const hapi_share *shares, uint8_t number);
/* The guest can say no more: *state becomes what its loop would tell on letting go of all. */
void hapi_guest_let_go(hapi_guest *guest, double haptic_hz);

/* Of a body in the guest's newest state: what of its totals counts. False: it knows none of that
 * generation. */
bool hapi_guest_counted(const hapi_guest *guest, uint32_t slot, uint32_t generation, double out[6]);

/* Lets go of a body, as a loop would. left_ns: time for which the poses hold. */
void hapi_guest_body_let_go(double time_scale, int64_t left_ns, hapi_state_body *io);

#endif
