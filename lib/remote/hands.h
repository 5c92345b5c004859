/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_HANDS_H
#define HAPODE_REMOTE_HANDS_H

/* The hands of others in a loop: each is a pointer of the loop that a model moves. Such a hand
 * stands where it was told last, carried on by its velocity for HAPI_HAND_CARRIED_NS at most: what
 * is carried on longer goes through bodies that the hand itself has stopped at. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/messages.h"

#define HAPI_HAND_CARRIED_NS INT64_C(10000000)

/* What a loop does for a hand. Ids are those of pointers: generation << 32 | place + 1. */
typedef struct hapi_hands_calls {
  void *of;
  uint64_t (*add)(void *of, const hapi_model_hand *hand); /* 0: there is no room */
  bool (*acts)(void *of, uint64_t id); /* a tick has had it: it may be in contacts */
  void (*remove)(void *of, uint64_t id);
  void (*put)(void *of, uint64_t id, const hapi_model_hand *hand, int64_t now_ns);
} hapi_hands_calls;

/* By the number of the hand in the world. */
typedef struct hapi_hand_here {
  uint64_t id; /* 0: it is not here */
  bool acts;
  bool told; /* scratch: the model has it */
  hapi_model_hand is;
} hapi_hand_here;

typedef struct hapi_hands {
  hapi_hands_calls calls;
  hapi_hand_here *of;
  uint32_t *generations; /* by place: of the last hand that had it; 0: none */
  uint32_t count;
  uint64_t left_out; /* models with a hand without room */
} hapi_hands;

bool hapi_hands_create(hapi_hands *hands, const hapi_capacity *capacity); /* false: no memory */
void hapi_hands_finish(hapi_hands *hands);                                /* zeroed allowed */
/* The hands of a model come, go and move; in the messages they get the loop's numbers. What is of a
 * hand that is not there yet, or has no room, is taken out. */
void hapi_hands_follow(hapi_hands *hands, int64_t now_ns, hapi_model *io_model, hapi_near *io_near);
/* Of a message of the loop, which may be older than the newest model: hands of others are not the
 * loop's own. */
void hapi_hands_hide(const hapi_hands *hands, hapi_state *io);

#endif
