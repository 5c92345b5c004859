/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* wire_stream members: what lib/wire says of each member of each struct.
 * wire_stream world|state STEPS BODIES: messages as they are sent, in hexadecimal ("M channel
 * bytes"), each followed by values of the structs that it was made of ("E ..."). For
 * tests/test_wire_witness.py, which reads the bytes by docs/wire.md alone. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/wire_world.h"
#include "wire/kinds.h"
#include "wire/wire.h"

static void members_print(void)
{
  for (int kind = 0; kind < HAPI_WIRE_KINDS; ++kind) {
    const hapi_wire_record *r = &hapi_wire_records[kind];
    printf("K %d %u %u %s\n", kind, r->prefix, r->known, r->name);
    for (uint32_t i = 0; i < r->field_count; ++i) {
      const hapi_wire_field *f = &r->fields[i];
      printf("F %d %s %u %u %u\n", kind, f->name, f->count, f->type, f->bits);
    }
  }
}

typedef struct stream {
  hapi_wire_server *server;
  hapi_wire_client *client;
  bool up;
  int step;
} stream;

/* Each third message is lost on its way, so that not every one can be a base. */
static hap_status stream_send(void *of, uint32_t channel, uint32_t part, bool reliable,
                              const void *data, uint32_t bytes)
{
  stream *s = of;
  hap_detail detail;
  const uint8_t *at = data;
  (void)part;
  printf("M %u ", channel);
  for (uint32_t i = 0; i < bytes; ++i) {
    printf("%02x", at[i]);
  }
  printf("\n");
  if (!reliable && s->step % 3 == 2) {
    return HAP_OK;
  }
  return s->up ? hapi_wire_server_take(s->server, channel, data, bytes, &detail)
               : hapi_wire_client_take(s->client, channel, data, bytes, &detail);
}

static hap_status silent_send(void *of, uint32_t channel, uint32_t part, bool reliable,
                              const void *data, uint32_t bytes)
{
  stream *s = of;
  hap_detail detail;
  (void)part;
  (void)reliable;
  return s->up ? hapi_wire_client_take(s->client, channel, data, bytes, &detail)
               : hapi_wire_server_take(s->server, channel, data, bytes, &detail);
}

static void numbers_print(const double *values, int count)
{
  for (int i = 0; i < count; ++i) {
    printf(" %.17g", values[i]);
  }
}

static void world_print(hapi_model *model, hapi_near *near)
{
  printf("E model %llu %lld", (unsigned long long)model->number, (long long)model->state_ns);
  numbers_print(&model->time_scale, 1);
  printf("\n");
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_model_body *b = &hapi_model_bodies(model)[i];
    printf("E body %u %u %u %llu", b->slot, b->generation, b->flags, (unsigned long long)b->birth);
    numbers_print(b->pose.position, 3);
    numbers_print(b->pose.quat_wxyz, 4);
    numbers_print(b->twist.linear, 3);
    numbers_print(b->gain_taken, 6);
    numbers_print(&b->mass, 1);
    numbers_print(&b->max_angular_speed, 1);
    printf("\n");
  }
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_model_contact *c = &hapi_model_contacts(model)[i];
    printf("E contact %u %u %u", c->slot, c->body, c->told.count > 0 ? c->told.first : 0);
    numbers_print(c->normal_body, 3);
    numbers_print(c->a[0], 18);
    printf("\n");
  }
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    const hapi_model_joint *j = &hapi_model_joints(model)[i];
    printf("E joint %u %u %u", j->slot, j->body_a, j->limits[2].flags);
    numbers_print(j->place.turn, 4);
    printf("\n");
  }
  for (uint32_t i = 0; i < near->pair_count; ++i) {
    const hapi_near_pair *p = &hapi_near_pairs(near)[i];
    printf("E pair %llu %u %u", (unsigned long long)p->key, p->geom_a, p->geom_b);
    numbers_print(&p->surface.mu, 1);
    numbers_print(p->surface.slip, 2);
    printf("\n");
  }
  for (uint32_t i = 0; i < near->geom_count; ++i) {
    const hapi_near_geom *g = &hapi_near_geoms(near)[i];
    printf("E geom %u %u %llu", g->body, g->shape.kind == HAPI_SHAPE_HULL ? g->hull_first : 0,
           (unsigned long long)g->shape.hull_count);
    numbers_print(g->shape.half, 3);
    numbers_print(g->pose.quat_wxyz, 4);
    printf("\n");
  }
  printf("E end\n");
}

static void state_print(hapi_state *state)
{
  printf("E state %llu %lld", (unsigned long long)state->tick, (long long)state->now_ns);
  numbers_print(state->hand_impulse, 3);
  numbers_print(state->owned_impulse, 3);
  numbers_print(&state->work.spent_ns, 1);
  printf("\n");
  for (uint32_t i = 0; i < state->body_high; ++i) {
    const hapi_state_body *b = &hapi_state_bodies(state)[i];
    if (b->generation != 0) {
      printf("E moved %u %u %lld", i, b->generation, (long long)b->owned_until_ns);
      numbers_print(b->pose.position, 3);
      numbers_print(b->pose.quat_wxyz, 4);
      numbers_print(b->gain, 6);
      numbers_print(b->owned_pose.quat_wxyz, 4);
      printf("\n");
    }
  }
  for (uint32_t i = 0; i < state->contact_count; ++i) {
    const hapi_state_contact *c = &hapi_state_contacts(state)[i];
    printf("E touch %u %u", c->slot, c->touches);
    numbers_print(&c->depth, 1);
    numbers_print(c->force, 3);
    printf("\n");
  }
  printf("E end\n");
}

static int stream_print(bool up, int steps, uint32_t bodies)
{
  stream s = {.up = up};
  hapi_exchange *exchange;
  hap_detail detail;
  const hapi_wire_out loud = {&s, stream_send};
  const hapi_wire_out silent = {&s, silent_send};
  if (hapi_exchange_create(&wire_capacity, &exchange) < HAP_OK ||
      hapi_wire_server_create(&wire_capacity, &s.server) < HAP_OK ||
      hapi_wire_client_create(&wire_capacity, &s.client) < HAP_OK) {
    return 1;
  }
  wire_world world = {.exchange = exchange,
                      .bodies = bodies,
                      .contacts = bodies / 2,
                      .joints = bodies / 3,
                      .geoms = bodies,
                      .pairs = bodies,
                      .rest = 50};
  wire_world hand = {.exchange = exchange, .bodies = bodies};
  hap_status status = HAP_OK;
  for (int i = 0; i < steps && status >= HAP_OK; ++i) {
    hapi_model *model;
    hapi_near *near;
    s.step = i;
    wire_world_step(&world, &model, &near);
    status = hapi_wire_server_send(s.server, model, near, up ? &silent : &loud, &detail);
    hapi_state *state = wire_state_step(&hand);
    if (status >= HAP_OK) {
      status = hapi_wire_client_send(s.client, state, up ? &loud : &silent, &detail);
    }
    if (up) {
      state_print(state);
    } else {
      world_print(model, near);
    }
  }
  if (status < HAP_OK) {
    fprintf(stderr, "%s\n", detail.text);
  }
  hapi_wire_server_destroy(s.server);
  hapi_wire_client_destroy(s.client);
  hapi_exchange_destroy(exchange);
  return status < HAP_OK;
}

int main(int argc, char **argv)
{
  if (argc == 2 && strcmp(argv[1], "members") == 0) {
    members_print();
    return 0;
  }
  if (argc == 4 && (strcmp(argv[1], "world") == 0 || strcmp(argv[1], "state") == 0)) {
    return stream_print(strcmp(argv[1], "state") == 0, atoi(argv[2]), (uint32_t)atoi(argv[3]));
  }
  fprintf(stderr, "wire_stream members | world STEPS BODIES | state STEPS BODIES\n");
  return 2;
}
