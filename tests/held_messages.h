/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_HELD_MESSAGES_H
#define HAPODE_TESTS_HELD_MESSAGES_H

/* An oracle for a network: the messages between physics and loop as they are, byte by byte, held
 * back for a time each way. No link, no codec. */

#include <stdlib.h>
#include <string.h>

#include "session/session_internal.h"

#define HELD_MOST 128u      /* messages of a channel on their way */
#define HELD_STATE_EVERY 4u /* ticks: so often the loop tells its state */

typedef struct held_queue {
  hapi_channel channel;
  size_t size;
  char *messages; /* HELD_MOST of size */
  int64_t due_ns[HELD_MOST];
  uint64_t first;
  uint64_t end;
} held_queue;

typedef struct held_messages {
  int64_t delay_ns;       /* each way */
  int64_t silent_from_ns; /* from then on nothing is sent to the loop; 0: never */
  hapi_exchange *world;
  hapi_exchange *loop;
  held_queue model;
  held_queue near;
  held_queue state;
  uint64_t ticks;
} held_messages;

static inline bool held_queue_init(held_queue *q, const hapi_exchange *exchange,
                                   hapi_channel channel)
{
  *q = (held_queue){.channel = channel, .size = hapi_exchange_message_size(exchange, channel)};
  q->messages = calloc(HELD_MOST, q->size);
  return q->messages != NULL;
}

static inline void held_put(held_queue *q, const void *message, int64_t due_ns)
{
  if (message != NULL && q->end - q->first < HELD_MOST) {
    memcpy(q->messages + (q->end % HELD_MOST) * q->size, message, q->size);
    q->due_ns[q->end++ % HELD_MOST] = due_ns;
  }
}

/* The newest that is due, into the exchange. */
static inline void held_give(held_queue *q, hapi_exchange *to, int64_t now_ns)
{
  uint64_t newest = UINT64_MAX;
  for (; q->first < q->end && q->due_ns[q->first % HELD_MOST] <= now_ns; ++q->first) {
    newest = q->first;
  }
  if (newest != UINT64_MAX) {
    memcpy(hapi_exchange_back(to, q->channel), q->messages + (newest % HELD_MOST) * q->size,
           q->size);
    hapi_exchange_publish(to, q->channel);
  }
}

static inline void held_before_cycle(void *of, int64_t now_ns)
{
  held_messages *h = of;
  held_give(&h->state, h->world, now_ns);
}

static inline void held_after_cycle(void *of, int64_t now_ns)
{
  held_messages *h = of;
  void *model = hapi_exchange_take(h->world, HAPI_CHANNEL_MODEL);
  void *near = hapi_exchange_take(h->world, HAPI_CHANNEL_NEAR);
  if (h->silent_from_ns == 0 || now_ns < h->silent_from_ns) {
    held_put(&h->model, model, now_ns + h->delay_ns);
    held_put(&h->near, near, now_ns + h->delay_ns);
  }
}

static inline void held_before_tick(void *of, int64_t now_ns)
{
  held_messages *h = of;
  held_give(&h->near, h->loop, now_ns);
  held_give(&h->model, h->loop, now_ns);
}

static inline void held_after_tick(void *of, int64_t now_ns)
{
  held_messages *h = of;
  void *state = hapi_exchange_take(h->loop, HAPI_CHANNEL_STATE);
  if (h->ticks++ % HELD_STATE_EVERY == 0) {
    held_put(&h->state, state, now_ns + h->delay_ns);
  }
}

/* Before the session starts; *h outlives it. */
static inline hap_status held_begin(held_messages *h, hap_session *session, double delay_s)
{
  const hapi_ferry ferry = {.of = h,
                            .before_cycle = held_before_cycle,
                            .after_cycle = held_after_cycle,
                            .before_tick = held_before_tick,
                            .after_tick = held_after_tick};
  hap_status status = hapi_session_set_ferry(session, &ferry);
  if (status < HAP_OK) {
    return status;
  }
  h->delay_ns = (int64_t)(1e9 * delay_s);
  h->world = session->ferry.exchange;
  h->loop = session->exchange;
  return held_queue_init(&h->model, h->world, HAPI_CHANNEL_MODEL) &&
                 held_queue_init(&h->near, h->world, HAPI_CHANNEL_NEAR) &&
                 held_queue_init(&h->state, h->world, HAPI_CHANNEL_STATE)
             ? HAP_OK
             : HAP_ERROR_MEMORY;
}

static inline void held_end(held_messages *h)
{
  free(h->model.messages);
  free(h->near.messages);
  free(h->state.messages);
}

#endif
