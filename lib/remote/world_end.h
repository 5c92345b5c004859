/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_WORLD_END_H
#define HAPODE_REMOTE_WORLD_END_H

/* The world's end of a session whose loop is elsewhere: physics' exchange on one side, the server's
 * link on the other. It has one client at a time; a second one is told so. */

#include "remote/bound.h"
#include "remote/end.h"
#include "sync/exchange.h"

typedef struct hapi_world_end {
  hapi_end end;
  hapi_exchange *exchange; /* of physics */
  hapi_terms terms;        /* for whoever joins */
  void (*renew)(void *of); /* of physics: the totals of another loop begin at zero */
  void *renew_of;
  hapi_scenery_source bodies; /* for a client that draws them; members may be NULL */
  hapi_scenery scenery;
  bool draws;        /* the client does */
  uint64_t tick;     /* of the newest state given */
  uint64_t old;      /* states that came behind a newer one */
  hapi_state *last;  /* the newest state given, while there is a client; else NULL */
  uint64_t clients;  /* that have joined, one after the other */
  hapi_state *store; /* memory of last */
  hapi_bound bound;
  bool admitted;        /* the client has told its terms, and they fit */
  uint64_t bounded;     /* states beyond the bound */
  int64_t bounded_ns;   /* since when they come; 0: the newest was within it */
  uint64_t turned_away; /* clients that were told to go */
} hapi_world_end;

/* [control] The exchange is set, and with it what messages have room for; terms are, too.
 * HAP_ERROR_MEMORY. */
hap_status hapi_world_end_begin(hapi_world_end *world);
void hapi_world_end_finish(hapi_world_end *world); /* zeroed allowed */

/* [physics] Before a cycle: the client's newest state to physics. */
void hapi_world_end_receive(hapi_world_end *world, int64_t now_ns);
/* [physics] After a cycle: its model and its pairs to the client. */
void hapi_world_end_send(hapi_world_end *world, int64_t now_ns);

#endif
