/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_WIRED_MESSAGES_H
#define HAPODE_TESTS_WIRED_MESSAGES_H

/* Messages between physics and loop by way of the codec, with delay, jitter, loss and duplicates of
 * the datagrams; without a link. */

#include <stdlib.h>
#include <string.h>

#include "session/session_internal.h"
#include "wire/wire.h"

#define WIRED_DATAGRAMS 8192u

typedef struct wired_datagram {
  int64_t due_ns; /* 0: none */
  uint32_t channel;
  uint32_t bytes;
  uint8_t *data;
} wired_datagram;

typedef struct wired_way {
  wired_datagram datagrams[WIRED_DATAGRAMS];
  uint64_t sent;        /* messages of the session */
  uint64_t bytes;       /* of datagrams */
  uint64_t known_bytes; /* of reliable messages */
  uint64_t count;       /* datagrams */
  uint32_t largest;     /* bytes */
  int64_t reliable_ns;  /* when the last reliable message arrives: the next ones come later */
} wired_way;

typedef struct wired_messages {
  double delay_s; /* each way */
  double jitter_s;
  double loss;
  double duplicates;
  uint64_t random;
  uint32_t state_every; /* ticks */
  hapi_exchange *world;
  hapi_exchange *loop;
  hapi_wire_server *server;
  hapi_wire_client *client;
  wired_way down;
  wired_way up;
  uint64_t ticks;
  int64_t now_ns;
  uint64_t errors;
  hap_detail detail; /* of the first error */
  /* Called with what was sent and what came of it; may be NULL. */
  void (*sent)(void *of, hapi_model *model, hapi_near *near, hapi_state *state);
  void (*came)(void *of, hapi_model *model, hapi_near *near, hapi_state *state);
  /* Called with each message that is sent; may be NULL. */
  void (*seen)(void *of, uint32_t channel, const void *data, uint32_t bytes);
  void *of;
} wired_messages;

static inline double wired_random(wired_messages *w)
{
  w->random = w->random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
  return (double)(w->random >> 11) / 9007199254740992.0;
}

static inline void wired_note(wired_messages *w, hap_status status, const hap_detail *detail)
{
  if (status < HAP_OK && w->errors++ == 0) {
    w->detail = *detail;
  }
}

static inline void wired_put(wired_messages *w, wired_way *way, uint32_t channel, bool reliable,
                             const void *data, uint32_t bytes)
{
  int64_t due = w->now_ns + 1 + (int64_t)(1e9 * (w->delay_s + w->jitter_s * wired_random(w)));
  if (reliable) {
    due = due > way->reliable_ns ? due : way->reliable_ns + 1; /* in their order */
    way->reliable_ns = due;
  }
  for (uint32_t i = 0; i < WIRED_DATAGRAMS; ++i) {
    wired_datagram *d = &way->datagrams[i];
    if (d->due_ns == 0) {
      *d = (wired_datagram){due, channel, bytes, malloc(bytes)};
      memcpy(d->data, data, bytes);
      return;
    }
  }
  ++w->errors;
}

static inline hap_status wired_send(wired_messages *w, wired_way *way, uint32_t channel,
                                    bool reliable, const void *data, uint32_t bytes)
{
  if (w->seen != NULL) {
    w->seen(w->of, channel, data, bytes);
  }
  if (reliable) {
    way->known_bytes += bytes;
  } else {
    way->bytes += bytes;
    ++way->count;
    way->largest = bytes > way->largest ? bytes : way->largest;
  }
  if (reliable || wired_random(w) >= w->loss) {
    wired_put(w, way, channel, reliable, data, bytes);
  }
  if (!reliable && wired_random(w) < w->duplicates) {
    wired_put(w, way, channel, reliable, data, bytes);
  }
  return HAP_OK;
}

static inline hap_status wired_send_down(void *of, uint32_t channel, uint32_t part, bool reliable,
                                         const void *data, uint32_t bytes)
{
  wired_messages *w = of;
  (void)part;
  return wired_send(w, &w->down, channel, reliable, data, bytes);
}

static inline hap_status wired_send_up(void *of, uint32_t channel, uint32_t part, bool reliable,
                                       const void *data, uint32_t bytes)
{
  wired_messages *w = of;
  (void)part;
  return wired_send(w, &w->up, channel, reliable, data, bytes);
}

/* In the order of their times. */
static inline wired_datagram *wired_next(wired_way *way, int64_t now_ns)
{
  wired_datagram *next = NULL;
  for (uint32_t i = 0; i < WIRED_DATAGRAMS; ++i) {
    wired_datagram *d = &way->datagrams[i];
    if (d->due_ns != 0 && d->due_ns <= now_ns && (next == NULL || d->due_ns < next->due_ns)) {
      next = d;
    }
  }
  return next;
}

static inline void wired_before_cycle(void *of, int64_t now_ns)
{
  wired_messages *w = of;
  hap_detail detail;
  for (wired_datagram *d; (d = wired_next(&w->up, now_ns)) != NULL; d->due_ns = 0) {
    wired_note(w, hapi_wire_server_take(w->server, d->channel, d->data, d->bytes, &detail),
               &detail);
    free(d->data);
  }
  hapi_state *state = hapi_exchange_state_back(w->world);
  if (hapi_wire_server_state(w->server, state)) {
    if (w->came != NULL) {
      w->came(w->of, NULL, NULL, state);
    }
    hapi_exchange_state_publish(w->world);
  }
}

static inline void wired_after_cycle(void *of, int64_t now_ns)
{
  wired_messages *w = of;
  const hapi_wire_out out = {w, wired_send_down};
  hap_detail detail;
  hapi_model *model = hapi_exchange_model_take(w->world);
  hapi_near *near = hapi_exchange_near_take(w->world);
  w->now_ns = now_ns;
  if (model != NULL) {
    if (w->sent != NULL) {
      w->sent(w->of, model, near, NULL);
    }
    wired_note(w, hapi_wire_server_send(w->server, model, near, &out, &detail), &detail);
    ++w->down.sent;
  }
}

static inline void wired_before_tick(void *of, int64_t now_ns)
{
  wired_messages *w = of;
  hap_detail detail;
  for (wired_datagram *d; (d = wired_next(&w->down, now_ns)) != NULL; d->due_ns = 0) {
    wired_note(w, hapi_wire_client_take(w->client, d->channel, d->data, d->bytes, &detail),
               &detail);
    free(d->data);
  }
  hapi_model *model = hapi_exchange_model_back(w->loop);
  hapi_near *near = hapi_exchange_near_back(w->loop);
  if (hapi_wire_client_world(w->client, model, near)) {
    if (w->came != NULL) {
      w->came(w->of, model, near, NULL);
    }
    hapi_exchange_near_publish(w->loop);
    hapi_exchange_model_publish(w->loop);
  }
}

static inline void wired_after_tick(void *of, int64_t now_ns)
{
  wired_messages *w = of;
  const hapi_wire_out out = {w, wired_send_up};
  hap_detail detail;
  hapi_state *state = hapi_exchange_state_take(w->loop);
  w->now_ns = now_ns;
  if (w->ticks++ % w->state_every == 0 && state != NULL) {
    if (w->sent != NULL) {
      w->sent(w->of, NULL, NULL, state);
    }
    wired_note(w, hapi_wire_client_send(w->client, state, &out, &detail), &detail);
    ++w->up.sent;
  }
}

/* Before the session starts; *w outlives it. */
static inline hap_status wired_begin(wired_messages *w, hap_session *session)
{
  const hapi_ferry ferry = {.of = w,
                            .before_cycle = wired_before_cycle,
                            .after_cycle = wired_after_cycle,
                            .before_tick = wired_before_tick,
                            .after_tick = wired_after_tick};
  hap_status status = hapi_session_set_ferry(session, &ferry);
  if (status < HAP_OK) {
    return status;
  }
  w->random = 1;
  w->state_every = w->state_every != 0 ? w->state_every : 16;
  w->world = session->ferry.exchange;
  w->loop = session->exchange;
  const hapi_capacity *capacity = hapi_exchange_capacity(w->loop);
  status = hapi_wire_server_create(capacity, &w->server);
  return status < HAP_OK ? status : hapi_wire_client_create(capacity, &w->client);
}

static inline void wired_way_end(wired_way *way)
{
  for (uint32_t i = 0; i < WIRED_DATAGRAMS; ++i) {
    if (way->datagrams[i].due_ns != 0) {
      free(way->datagrams[i].data);
    }
  }
}

static inline void wired_end(wired_messages *w)
{
  hapi_wire_server_destroy(w->server);
  hapi_wire_client_destroy(w->client);
  wired_way_end(&w->down);
  wired_way_end(&w->up);
}

#endif
