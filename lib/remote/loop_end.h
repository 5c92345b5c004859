/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_LOOP_END_H
#define HAPODE_REMOTE_LOOP_END_H

/* The loop's end of a session whose world is elsewhere: the exchange of loop and contact thread on
 * one side, the client's link on the other. */

#include "remote/end.h"
#include "remote/hands.h"
#include "sync/exchange.h"

/* When the loop let go of a body, in its own clock and as the world was told. The world tells one
 * such time from another by its value, so it stays when the clocks are compared anew. */
typedef struct hapi_loop_left {
  int64_t until_ns;
  int64_t told_ns;
} hapi_loop_left;

/* Who draws; hear NULL: nobody. */
typedef struct hapi_loop_view {
  void *of;
  void (*hear)(void *of, uint64_t number, const hapi_told_body *bodies, uint32_t count);
  /* With each model. times_ns: for which it is drawn, and now. */
  void (*draw)(void *of, hapi_model *model, double period_s, const int64_t times_ns[2]);
} hapi_loop_view;

typedef struct hapi_loop_end {
  hapi_end end;
  hapi_exchange *exchange; /* of the loop */
  bool agreed;             /* terms have come, and are good */
  hapi_terms terms;        /* before: what the loop has */
  hapi_limits limits;      /* of the session's pointers */
  hapi_limits told;        /* to the world: the largest, which it keeps to */
  bool terms_told;         /* it has heard of this session */
  bool turned_away;        /* by the world, end.detail says why */
  uint64_t number;         /* of the newest model given */
  uint64_t old;            /* models that came behind a newer one */
  int64_t next_ns;         /* when the state is due */
  hapi_stamps stamps;
  hapi_loop_view view;
  hapi_scene_print scene; /* of the session's own world */
  bool draws;             /* the world has the same bodies, and tells where they are */
  bool said_far;          /* that the world does not look ahead far enough */
  hapi_loop_left *left;   /* by slot of a body */
  hapi_hands hands;       /* of others; its calls are set before begin */
} hapi_loop_end;

/* [control] The exchange is set. HAP_ERROR_MEMORY. */
hap_status hapi_loop_end_begin(hapi_loop_end *loop);
void hapi_loop_end_finish(hapi_loop_end *loop); /* zeroed allowed */

/* Between ticks: a newer model and its pairs to the loop and the contact thread. */
void hapi_loop_end_receive(hapi_loop_end *loop, int64_t now_ns);
/* Between ticks: once a step of physics the newest state to the world. */
void hapi_loop_end_send(hapi_loop_end *loop, int64_t now_ns);

#endif
