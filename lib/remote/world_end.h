/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_WORLD_END_H
#define HAPODE_REMOTE_WORLD_END_H

/* The world's end of a session whose loops are elsewhere: physics' exchange on one side, the
 * server's link on the other. Physics hears of one loop only, merged of all. */

#include "remote/hands.h"
#include "remote/merge.h"

typedef struct hapi_world_end {
  hapi_end end;            /* its link; codec: of the one client where there are no codecs */
  hapi_codec *codecs;      /* one for each client, room of them; NULL: end.codec */
  uint32_t room;           /* clients that there may be; begin sets it where there are no codecs */
  hapi_exchange *exchange; /* of physics */
  hapi_exchange *loop;     /* of the world's own loop, a guest behind the clients; NULL: none */
  hapi_hands hands;        /* in that; its calls are set before begin */
  hapi_terms terms;        /* for whoever joins */
  hapi_scenery_source bodies; /* for clients that draw them; members may be NULL */
  hapi_guest *guests;         /* count of them */
  uint32_t count;             /* room, and the world's own loop */
  hapi_shares shares;
  hapi_merge merge;
  hapi_exchange *cut;      /* what a guest is sent */
  uint8_t *contact_guests; /* by slot of a contact: whose hand it is of */
  uint64_t model_number;   /* of the newest model */
  uint32_t joined;         /* clients that are there */
  uint64_t old;            /* states that came behind a newer one */
  uint64_t clients;        /* that have joined so far */
  uint64_t bounded;        /* states beyond the bound */
  uint64_t turned_away;    /* clients that were told to go */
} hapi_world_end;

/* [control] The exchange is set, and with it what messages have room for; terms are, too.
 * HAP_ERROR_MEMORY; finish is due all the same. */
hap_status hapi_world_end_begin(hapi_world_end *world);
void hapi_world_end_finish(hapi_world_end *world); /* zeroed allowed */
/* [control] Begun before: clients may have these limits at most. */
void hapi_world_end_limit(hapi_world_end *world, const hapi_limits *most);

/* [physics] Before a cycle: what clients have told to physics. */
void hapi_world_end_receive(hapi_world_end *world, int64_t now_ns);
/* [physics] After a cycle: its model and pairs to the clients, each its part. */
void hapi_world_end_send(hapi_world_end *world, int64_t now_ns);

#endif
