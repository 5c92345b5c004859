/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_EXCHANGE_H
#define HAPODE_SYNC_EXCHANGE_H

/* The mailboxes between physics, contact thread and haptic loop: one writer and one reader each.
 * All memory is taken at create. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/status.h>

#include "sync/messages.h"
#include "sync/path.h"
#include "sync/trail.h"

typedef struct hapi_exchange hapi_exchange;

typedef enum hapi_channel {
  HAPI_CHANNEL_MODEL = 0,
  HAPI_CHANNEL_STATE = 1,
  HAPI_CHANNEL_NEAR = 2,
  HAPI_CHANNEL_POSES = 3,
  HAPI_CHANNEL_PATCHES = 4,
  HAPI_CHANNELS = 5
} hapi_channel;

hap_status hapi_exchange_create(const hapi_capacity *capacity, hapi_exchange **out);
/* Of memory that comes with its use: not for the haptic thread. */
hap_status hapi_exchange_create_late(const hapi_capacity *capacity, hapi_exchange **out);
void hapi_exchange_destroy(hapi_exchange *exchange); /* NULL allowed */

/* Forgets all messages; no thread may be using the exchange. */
void hapi_exchange_reset(hapi_exchange *exchange);

/* For each message: the place to write to, its hand-over, and the newest one (NULL: none newer; the
 * one taken before stays valid then, and only then). */

void *hapi_exchange_back(hapi_exchange *exchange, hapi_channel name);
void hapi_exchange_publish(hapi_exchange *exchange, hapi_channel name);
void *hapi_exchange_take(hapi_exchange *exchange, hapi_channel name);

/* Defines the three for one message. */
/* NOLINTBEGIN(bugprone-macro-parentheses): types */
#define HAPI_MAILBOX(back, publish, take, message, channel) \
  static inline message *back(hapi_exchange *exchange)      \
  {                                                         \
    return hapi_exchange_back(exchange, channel);           \
  }                                                         \
  static inline void publish(hapi_exchange *exchange)       \
  {                                                         \
    hapi_exchange_publish(exchange, channel);               \
  }                                                         \
  static inline message *take(hapi_exchange *exchange)      \
  {                                                         \
    return hapi_exchange_take(exchange, channel);           \
  }
/* NOLINTEND(bugprone-macro-parentheses) */

/* [physics] -> [haptic] */
HAPI_MAILBOX(hapi_exchange_model_back, hapi_exchange_model_publish, hapi_exchange_model_take,
             hapi_model, HAPI_CHANNEL_MODEL)
/* [haptic] -> [physics] */
HAPI_MAILBOX(hapi_exchange_state_back, hapi_exchange_state_publish, hapi_exchange_state_take,
             hapi_state, HAPI_CHANNEL_STATE)
/* [physics] -> [contact] */
HAPI_MAILBOX(hapi_exchange_near_back, hapi_exchange_near_publish, hapi_exchange_near_take,
             hapi_near, HAPI_CHANNEL_NEAR)
/* [haptic] -> [contact] */
HAPI_MAILBOX(hapi_exchange_poses_back, hapi_exchange_poses_publish, hapi_exchange_poses_take,
             hapi_poses, HAPI_CHANNEL_POSES)
/* [contact] -> [haptic] */
HAPI_MAILBOX(hapi_exchange_patches_back, hapi_exchange_patches_publish, hapi_exchange_patches_take,
             hapi_patches, HAPI_CHANNEL_PATCHES)

/* [contact] Waits while the newest message of physics has nothing to find; may come back early. */
void hapi_exchange_near_wait(hapi_exchange *exchange);
void hapi_exchange_near_ring(hapi_exchange *exchange); /* [any] ends such a wait */

/* ---- recordings ---- */

/* Messages of a channel are counted from 1. [reader] number of the message held, 0: none yet. */
uint64_t hapi_exchange_taken(const hapi_exchange *exchange, hapi_channel name);
/* [writer] how many there were */
uint64_t hapi_exchange_published(const hapi_exchange *exchange, hapi_channel name);

/* Replay, one thread. From now on messages are kept, and take gives the expected one. Replay runs
 * the threads of a recording one after the other; so each thread takes the same messages as when it
 * was recorded, however far ahead the others are. Until expect, take gives the newest. Before the
 * first message; ends with destroy. */
hap_status hapi_exchange_play(hapi_exchange *exchange);
/* Number of the message that take gives. 0, or one that is held already: take gives none. */
void hapi_exchange_expect(hapi_exchange *exchange, hapi_channel name, uint64_t number);
/* Messages before number can go, but for the expected one. */
void hapi_exchange_forget(hapi_exchange *exchange, hapi_channel name, uint64_t number);
/* HAP_ERROR_MEMORY, HAP_ERROR_NOT_FOUND: what hapi_message_queue_status says of any of them. */
hap_status hapi_exchange_play_status(const hapi_exchange *exchange);
/* [haptic] -> threads that draw. Not in the block: a ring that is always in use stays in memory. */
hapi_trail *hapi_exchange_trail(hapi_exchange *exchange);
hapi_path *hapi_exchange_path(hapi_exchange *exchange); /* [haptic] -> [physics] */

const hapi_capacity *hapi_exchange_capacity(const hapi_exchange *exchange);
/* Bytes of one message. Those of two exchanges of the same capacity are laid out alike. */
size_t hapi_exchange_message_size(const hapi_exchange *exchange, hapi_channel name);

/* The whole block, for locking it into memory. */
void *hapi_exchange_memory(hapi_exchange *exchange, size_t *out_size);

#endif
