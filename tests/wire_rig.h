/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_WIRE_RIG_H
#define HAPODE_TESTS_WIRE_RIG_H

/* Both ends of the codec, with what they send to each other. */

#include "tests/tap.h"

#include "base/alloc.h"
#include "tests/wire_world.h"
#include "wire/sender.h"
#include "wire/wire.h"

#define POST_MOST 400u

typedef struct parcel {
  uint32_t channel;
  uint32_t part;
  uint32_t bytes;
  uint8_t data[HAPI_WIRE_RELIABLE];
} parcel;

/* What was sent in one direction, in order. */
typedef struct post {
  parcel *parcels;
  uint32_t count;
  bool refuses; /* reliable messages: there is no room */
} post;

static inline hap_status post_send(void *of, uint32_t channel, uint32_t part, bool reliable,
                                   const void *data, uint32_t bytes)
{
  post *p = of;
  if (reliable && p->refuses) {
    return HAP_ERROR_CAPACITY;
  }
  if (p->count == POST_MOST || (!reliable && bytes > 1200)) {
    return HAP_ERROR_IO;
  }
  parcel *to = &p->parcels[p->count++];
  to->channel = channel;
  to->part = part;
  to->bytes = bytes;
  memcpy(to->data, data, bytes);
  return HAP_OK;
}

typedef struct rig {
  hapi_wire_server *server;
  hapi_wire_client *client;
  hapi_exchange *out; /* where messages are made */
  hapi_exchange *in;  /* where they arrive */
  post down;
  post up;
  wire_world world;
  wire_world hand;
  hap_detail detail;
} rig;

static inline void rig_finish(void *owned)
{
  rig *r = owned;
  hapi_wire_server_destroy(r->server);
  hapi_wire_client_destroy(r->client);
  hapi_exchange_destroy(r->out);
  hapi_exchange_destroy(r->in);
  free(r->down.parcels);
  free(r->up.parcels);
}

static inline rig *rig_make(void)
{
  rig *r = tap_own(sizeof *r, rig_finish);
  REQUIRE(hapi_exchange_create(&wire_capacity, &r->out) == HAP_OK);
  REQUIRE(hapi_exchange_create(&wire_capacity, &r->in) == HAP_OK);
  REQUIRE(hapi_wire_server_create(&wire_capacity, &r->server) == HAP_OK);
  REQUIRE(hapi_wire_client_create(&wire_capacity, &r->client) == HAP_OK);
  r->down.parcels = calloc(POST_MOST, sizeof(parcel));
  r->up.parcels = calloc(POST_MOST, sizeof(parcel));
  REQUIRE(r->down.parcels != NULL && r->up.parcels != NULL);
  r->world = (wire_world){.exchange = r->out,
                          .bodies = 40,
                          .contacts = 20,
                          .joints = 12,
                          .geoms = 40,
                          .pairs = 50,
                          .rest = 30};
  r->hand = (wire_world){.exchange = r->out, .bodies = 40};
  return r;
}

static inline hap_status send_down(rig *r, hapi_model **model, hapi_near **near)
{
  const hapi_wire_out out = {&r->down, post_send};
  wire_world_step(&r->world, model, near);
  return hapi_wire_server_send(r->server, *model, *near, &out, &r->detail);
}

static inline hap_status send_up(rig *r, hapi_state **state)
{
  const hapi_wire_out out = {&r->up, post_send};
  *state = wire_state_step(&r->hand);
  return hapi_wire_client_send(r->client, *state, &out, &r->detail);
}

static inline hap_status take_down(rig *r, const parcel *p)
{
  return hapi_wire_client_take(r->client, p->channel, p->data, p->bytes, &r->detail);
}

static inline hap_status take_up(rig *r, const parcel *p)
{
  return hapi_wire_server_take(r->server, p->channel, p->data, p->bytes, &r->detail);
}

static inline void take_all(rig *r)
{
  for (uint32_t i = 0; i < r->down.count; ++i) {
    REQUIRE_SAY(take_down(r, &r->down.parcels[i]) == HAP_OK, "%s", r->detail.text);
  }
  for (uint32_t i = 0; i < r->up.count; ++i) {
    REQUIRE_SAY(take_up(r, &r->up.parcels[i]) == HAP_OK, "%s", r->detail.text);
  }
  r->down.count = r->up.count = 0;
}

static inline bool world_of(rig *r, hapi_model **model, hapi_near **near)
{
  *model = hapi_exchange_model_back(r->in);
  *near = hapi_exchange_near_back(r->in);
  return hapi_wire_client_world(r->client, *model, *near);
}

static inline bool state_of(rig *r, hapi_state **state)
{
  *state = hapi_exchange_state_back(r->in);
  return hapi_wire_server_state(r->server, *state);
}

#endif
