/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "wire/wire.h"

#include <stdio.h>

#include "base/alloc.h"
#include "wire/receiver.h"
#include "wire/state.h"
#include "wire/world.h"

struct hapi_wire_server {
  hapi_wire_sender sender;
  hapi_wire_receiver receiver;
  hapi_wire_world_out world;
  hapi_wire_state_in state;
};

struct hapi_wire_client {
  hapi_wire_sender sender;
  hapi_wire_receiver receiver;
  hapi_wire_world_in world;
};

static hap_status wire_take(hapi_wire_receiver *receiver, hapi_wire_sender *back, uint32_t channel,
                            const void *data, uint32_t bytes, hap_detail *detail)
{
  detail->text[0] = '\0';
  return channel == HAPI_WIRE_CHANNEL_KNOWN
             ? hapi_wire_receiver_learn(receiver, data, bytes, detail)
             : hapi_wire_receiver_take(receiver, data, bytes, back, detail);
}

static void wire_count(const hapi_wire_sender *sender, const hapi_wire_receiver *receiver,
                       hapi_wire_counts *out)
{
  *out = (hapi_wire_counts){.frames = receiver->frames_given,
                            .lacking = receiver->lacking,
                            .late = receiver->late,
                            .refused = receiver->refused,
                            .acked = sender->base,
                            .newest = sender->number};
}

/* ---- at the server ---- */

hap_status hapi_wire_server_create(const hapi_capacity *capacity, hapi_wire_server **out)
{
  hapi_wire_server *server = hapi_alloc(sizeof *server);
  *out = NULL;
  if (server == NULL) {
    return HAP_ERROR_MEMORY;
  }
  bool good = hapi_wire_sender_create(&server->sender, HAPI_WIRE_CHANNEL_WORLD, HAPI_WIRE_MODEL,
                                      HAPI_WIRE_STATE, capacity);
  good = hapi_wire_receiver_create(&server->receiver, HAPI_WIRE_CHANNEL_STATE, HAPI_WIRE_STATE,
                                   HAPI_WIRE_KINDS, capacity) &&
         good;
  good = hapi_wire_world_out_create(&server->world, capacity) && good;
  good = hapi_wire_state_in_create(&server->state, &server->receiver.shape, capacity) && good;
  if (!good) {
    hapi_wire_server_destroy(server);
    return HAP_ERROR_MEMORY;
  }
  server->receiver.accept = hapi_wire_state_accept;
  server->receiver.of = &server->state;
  *out = server;
  return HAP_OK;
}

void hapi_wire_server_destroy(hapi_wire_server *server)
{
  if (server != NULL) {
    hapi_wire_sender_finish(&server->sender);
    hapi_wire_receiver_finish(&server->receiver);
    hapi_wire_world_out_finish(&server->world);
    hapi_wire_state_in_finish(&server->state);
    hapi_free(server);
  }
}

hap_status hapi_wire_server_send(hapi_wire_server *server, hapi_model *model, hapi_near *near,
                                 const hapi_wire_out *out, hap_detail *detail)
{
  detail->text[0] = '\0';
  hap_status status = hapi_wire_world_pack(&server->world, &server->sender, model, near, detail);
  return status < HAP_OK
             ? status
             : hapi_wire_sender_send(&server->sender, server->receiver.acked, out, detail);
}

hap_status hapi_wire_server_take(hapi_wire_server *server, uint32_t channel, const void *data,
                                 uint32_t bytes, hap_detail *detail)
{
  return wire_take(&server->receiver, &server->sender, channel, data, bytes, detail);
}

bool hapi_wire_server_state(hapi_wire_server *server, hapi_state *out)
{
  return hapi_wire_state_give(&server->state, out);
}

void hapi_wire_server_count(const hapi_wire_server *server, hapi_wire_counts *out)
{
  wire_count(&server->sender, &server->receiver, out);
}

/* ---- at the client ---- */

hap_status hapi_wire_client_create(const hapi_capacity *capacity, hapi_wire_client **out)
{
  hapi_wire_client *client = hapi_alloc(sizeof *client);
  *out = NULL;
  if (client == NULL) {
    return HAP_ERROR_MEMORY;
  }
  bool good = hapi_wire_sender_create(&client->sender, HAPI_WIRE_CHANNEL_STATE, HAPI_WIRE_STATE,
                                      HAPI_WIRE_KINDS, capacity);
  good = hapi_wire_receiver_create(&client->receiver, HAPI_WIRE_CHANNEL_WORLD, HAPI_WIRE_MODEL,
                                   HAPI_WIRE_STATE, capacity) &&
         good;
  good = hapi_wire_world_in_create(&client->world, &client->receiver.shape, capacity) && good;
  if (!good) {
    hapi_wire_client_destroy(client);
    return HAP_ERROR_MEMORY;
  }
  client->receiver.accept = hapi_wire_world_accept;
  client->receiver.of = &client->world;
  *out = client;
  return HAP_OK;
}

void hapi_wire_client_destroy(hapi_wire_client *client)
{
  if (client != NULL) {
    hapi_wire_sender_finish(&client->sender);
    hapi_wire_receiver_finish(&client->receiver);
    hapi_wire_world_in_finish(&client->world);
    hapi_free(client);
  }
}

hap_status hapi_wire_client_send(hapi_wire_client *client, hapi_state *state,
                                 const hapi_wire_out *out, hap_detail *detail)
{
  detail->text[0] = '\0';
  hap_status status = hapi_wire_state_pack(&client->sender, state, detail);
  return status < HAP_OK
             ? status
             : hapi_wire_sender_send(&client->sender, client->receiver.acked, out, detail);
}

hap_status hapi_wire_client_take(hapi_wire_client *client, uint32_t channel, const void *data,
                                 uint32_t bytes, hap_detail *detail)
{
  return wire_take(&client->receiver, &client->sender, channel, data, bytes, detail);
}

bool hapi_wire_client_world(hapi_wire_client *client, hapi_model *out_model, hapi_near *out_near)
{
  return hapi_wire_world_give(&client->world, out_model, out_near);
}

void hapi_wire_client_count(const hapi_wire_client *client, hapi_wire_counts *out)
{
  wire_count(&client->sender, &client->receiver, out);
}
