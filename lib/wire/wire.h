/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WIRE_WIRE_H
#define HAPODE_WIRE_WIRE_H

/* Messages of physics and loop as datagrams, and back (docs/wire.md). A server has one
 * hapi_wire_server for each of its clients. No sockets, no clock; all memory is taken at create.
 * Any thread, one at a time, never the haptic one.
 *
 *   server_send  -> channels KNOWN, WORLD ->  client_take, client_world
 *   server_take, server_state  <- channels KNOWN, STATE <-  client_send
 *
 * Model CONTACT only. Positions come out to 1 um, orientations to 1e-5 rad, velocities to 4e-6 m/s
 * and rad/s, totals and what does not change with all bits. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>

#include "sync/messages.h"
#include "wire/out.h"

typedef struct hapi_wire_server hapi_wire_server;
typedef struct hapi_wire_client hapi_wire_client;

/* Since create, of one end. */
typedef struct hapi_wire_counts {
  uint64_t frames;  /* given by world or state */
  uint64_t lacking; /* those of them with lost datagrams */
  uint64_t late;    /* datagrams that were late, doubled, replayed, or of no use */
  uint64_t refused; /* messages with an error */
  uint64_t acked;   /* newest frame of this end that the other one has */
  uint64_t newest;  /* newest frame that this end has sent */
} hapi_wire_counts;

/* Both ends have equal capacities. */
hap_status hapi_wire_server_create(const hapi_capacity *capacity, hapi_wire_server **out);
void hapi_wire_server_destroy(hapi_wire_server *server); /* NULL allowed */

/* near: may be NULL; one of another model is left out. HAP_ERROR_UNSUPPORTED: another model than
 * CONTACT, textures, contacts that the application is asked about. HAP_ERROR_ARGUMENT: a number is
 * not finite or out of range. HAP_ERROR_CAPACITY: more than there is room for. Other errors: of
 * out; then the message is lost. */
hap_status hapi_wire_server_send(hapi_wire_server *server, hapi_model *model, hapi_near *near,
                                 const hapi_wire_out *out, hap_detail *detail);

/* A message of channel KNOWN or STATE. What comes late or twice is no error. HAP_ERROR_FORMAT: it
 * is malformed or of another version, with a text, and nothing has changed. */
hap_status hapi_wire_server_take(hapi_wire_server *server, uint32_t channel, const void *data,
                                 uint32_t bytes, hap_detail *detail);

/* The newest state, once. False: there is no newer one, and *out is as it was. out: of these
 * capacities, its arrays laid out (sync/exchange.h). */
bool hapi_wire_server_state(hapi_wire_server *server, hapi_state *out);
void hapi_wire_server_count(const hapi_wire_server *server, hapi_wire_counts *out);

/* The same of a client. */
hap_status hapi_wire_client_create(const hapi_capacity *capacity, hapi_wire_client **out);
void hapi_wire_client_destroy(hapi_wire_client *client);
hap_status hapi_wire_client_send(hapi_wire_client *client, hapi_state *state,
                                 const hapi_wire_out *out, hap_detail *detail);
hap_status hapi_wire_client_take(hapi_wire_client *client, uint32_t channel, const void *data,
                                 uint32_t bytes, hap_detail *detail);
bool hapi_wire_client_world(hapi_wire_client *client, hapi_model *out_model, hapi_near *out_near);
void hapi_wire_client_count(const hapi_wire_client *client, hapi_wire_counts *out);

#endif
