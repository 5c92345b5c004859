/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* wire/wire.h. The input is a row of messages: a byte with the channel, whose high bit says that
 * the message goes to the server, two bytes with its length, and the message. */

#include "fuzz.h"

#include "sync/exchange.h"
#include "sync/mesh_filter.h"
#include "wire/wire.h"

/* Small, so that an input takes little time. The corpus is of such a world. */
static const hapi_capacity fuzz_capacity = {.bodies = 12,
                                            .contacts = 20,
                                            .pairs = 12,
                                            .pointers = 4,
                                            .geoms = 12,
                                            .hull_points = 24,
                                            .joints = 20,
                                            .tool_points = 10,
                                            .springs = 10,
                                            .triangles = 9,
                                            .feels = 5};

static void model_check(hapi_model *model, hapi_near *near)
{
  FUZZ_CHECK(model->body_count <= fuzz_capacity.bodies &&
             model->joint_count <= fuzz_capacity.joints);
  FUZZ_CHECK(model->contact_count <= fuzz_capacity.contacts &&
             near->geom_count <= fuzz_capacity.geoms);
  FUZZ_CHECK(near->pair_count <= fuzz_capacity.pairs &&
             near->point_count <= fuzz_capacity.hull_points);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_model_body *body = &hapi_model_bodies(model)[i];
    FUZZ_CHECK(body->slot < fuzz_capacity.bodies && body->course <= model->course_count);
    FUZZ_CHECK(hapi_assert_is_unit(body->pose.quat_wxyz, 4));
    FUZZ_CHECK(hapi_assert_is_finite(body->pose.position, 3) && body->mass - body->mass == 0.0);
    FUZZ_CHECK((body->flags & HAPI_BODY_DRIVEN) != 0 || body->mass > 0.0);
  }
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_model_contact *c = &hapi_model_contacts(model)[i];
    FUZZ_CHECK(c->slot < fuzz_capacity.contacts && c->pointer < fuzz_capacity.pointers);
    FUZZ_CHECK(c->told.first <= model->triangle_count);
    FUZZ_CHECK(c->told.count <= model->triangle_count - c->told.first);
  }
  for (uint32_t i = 0; i < near->geom_count; ++i) {
    const hapi_near_geom *g = &hapi_near_geoms(near)[i];
    FUZZ_CHECK(g->shape.kind != HAPI_SHAPE_HULL ||
               g->hull_first + g->shape.hull_count <= near->point_count);
    FUZZ_CHECK(g->open_edges == 0 || g->shape.hull_count == 3);
    FUZZ_CHECK((g->open_edges & ~HAPI_TRIANGLE_BITS) == 0);
  }
  for (uint32_t i = 0; i < near->pair_count; ++i) {
    const hapi_near_pair *pair = &hapi_near_pairs(near)[i];
    FUZZ_CHECK(pair->geom_a < near->geom_count && pair->geom_b < near->geom_count);
  }
}

static void state_check(hapi_state *state)
{
  FUZZ_CHECK(state->body_high <= fuzz_capacity.bodies &&
             state->contact_count <= fuzz_capacity.contacts);
  for (uint32_t i = 0; i < state->contact_count; ++i) {
    FUZZ_CHECK(hapi_state_contacts(state)[i].slot < fuzz_capacity.contacts);
  }
  for (uint32_t i = 0; i < state->pointer_count; ++i) {
    const hapi_state_pointer *pointer = &hapi_state_pointers(state)[i];
    FUZZ_CHECK(pointer->bound_count <= HAP_FORCES_MAX);
    FUZZ_CHECK(pointer->is_tool == 0 ||
               hapi_state_hulls(state)[i].count - 1 < HAPI_TOOL_POINTS_MAX);
  }
}

static hap_status silent_send(void *of, uint32_t channel, uint32_t part, bool reliable,
                              const void *data, uint32_t bytes)
{
  (void)of, (void)channel, (void)part, (void)reliable, (void)data, (void)bytes;
  return HAP_OK;
}

typedef struct ends {
  hapi_wire_server *server;
  hapi_wire_client *client;
  hapi_exchange *exchange;
} ends;

static void message_take(const ends *e, uint8_t to, const uint8_t *data, uint32_t bytes)
{
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  uint8_t *copy = malloc(bytes > 0 ? bytes : 1); /* of just its size */
  memcpy(copy, data, bytes);
  hap_status status = (to & 0x80u) != 0
                          ? hapi_wire_server_take(e->server, to & 0x7fu, copy, bytes, &detail)
                          : hapi_wire_client_take(e->client, to, copy, bytes, &detail);
  free(copy);
  FUZZ_CHECK(status == HAP_OK || status == HAP_ERROR_FORMAT);
  FUZZ_CHECK((status == HAP_ERROR_FORMAT) == (detail.text[0] != '\0'));
  hapi_model *model = hapi_exchange_model_back(e->exchange);
  hapi_near *near = hapi_exchange_near_back(e->exchange);
  hapi_state *state = hapi_exchange_state_back(e->exchange);
  if (hapi_wire_client_world(e->client, model, near)) {
    model_check(model, near);
  }
  if (hapi_wire_server_state(e->server, state)) {
    state_check(state);
  }
}

/* So that there is something to acknowledge. */
static void answers_send(const ends *e)
{
  const hapi_wire_out out = {NULL, silent_send};
  hap_detail detail;
  hapi_model *model = hapi_exchange_model_back(e->exchange);
  hapi_state *state = hapi_exchange_state_back(e->exchange);
  memset(model, 0, offsetof(hapi_model, bodies_offset));
  model->model = HAP_MODEL_CONTACT;
  FUZZ_CHECK(hapi_wire_server_send(e->server, model, NULL, &out, &detail) == HAP_OK);
  state->body_high = state->contact_count = state->joint_count = state->side_count = 0;
  state->spring_count = 0;
  for (uint32_t i = 0; i < state->pointer_count; ++i) {
    hapi_state_pointers(state)[i].generation = 0;
  }
  FUZZ_CHECK(hapi_wire_client_send(e->client, state, &out, &detail) == HAP_OK);
}

void fuzz_one(const uint8_t *data, size_t size)
{
  ends e = {NULL, NULL, NULL};
  bool made = hapi_exchange_create(&fuzz_capacity, &e.exchange) == HAP_OK;
  made = made && hapi_wire_server_create(&fuzz_capacity, &e.server) == HAP_OK;
  made = made && hapi_wire_client_create(&fuzz_capacity, &e.client) == HAP_OK;
  FUZZ_CHECK(made || fuzz_starved());
  if (made) {
    answers_send(&e);
  }
  while (made && size >= 3) {
    uint32_t bytes = (uint32_t)data[1] | (uint32_t)data[2] << 8;
    bytes = bytes < size - 3 ? bytes : (uint32_t)(size - 3);
    message_take(&e, data[0], data + 3, bytes);
    data += 3 + bytes;
    size -= 3 + bytes;
  }
  hapi_wire_server_destroy(e.server);
  hapi_wire_client_destroy(e.client);
  hapi_exchange_destroy(e.exchange);
}
