/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/world_end.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"

/* So long states beyond the bound are waited out. */
#define BOUNDED_MOST_NS INT64_C(1000000000)

hap_status hapi_world_end_begin(hapi_world_end *world)
{
  size_t size = hapi_exchange_message_size(world->exchange, HAPI_CHANNEL_STATE);
  world->store = hapi_alloc(size);
  world->terms.capacity = *hapi_exchange_capacity(world->exchange);
  world->bound.most = world->terms.limits;
  bool bound = hapi_bound_create(&world->bound, world->terms.capacity.bodies,
                                 world->terms.look_ahead_s + 2.0 * world->terms.period_s);
  return world->store != NULL && bound ? HAP_OK : HAP_ERROR_MEMORY;
}

void hapi_world_end_finish(hapi_world_end *world)
{
  hapi_bound_finish(&world->bound);
  hapi_scenery_finish(&world->scenery);
  hapi_free(world->store);
  world->store = world->last = NULL;
}

static void state_give(hapi_world_end *world, const hapi_state *state)
{
  size_t size = hapi_exchange_message_size(world->exchange, HAPI_CHANNEL_STATE);
  hapi_state *back = hapi_exchange_state_back(world->exchange);
  if (back != state) {
    memcpy(back, state, size);
  }
  hapi_exchange_state_publish(world->exchange);
}

/* ---- a client that leaves ---- */

/* Lets go of a body, as the loop would. left_ns: time for which the poses hold. */
static void body_let_go(const hapi_state *state, int64_t left_ns, hapi_state_body *io)
{
  if ((io->flags & HAPI_BODY_OWNED) == 0) {
    return;
  }
  io->flags &= ~(uint32_t)HAPI_BODY_OWNED;
  io->owned_until_ns = left_ns;
  io->owned_pose = io->pose;
  io->owned_twist = io->twist;
  for (int k = 0; k < 3 && state->time_scale > 0.0; ++k) { /* it is in the world's time */
    io->owned_twist.linear[k] /= state->time_scale;
    io->owned_twist.angular[k] /= state->time_scale;
  }
}

/* The loop can say no more: its hands are gone, and its bodies are the world's again. */
static void loop_let_go(hapi_world_end *world)
{
  hapi_state *last = world->last;
  world->last = NULL;
  if (last == NULL) {
    return;
  }
  int64_t left_ns = last->now_ns + llround(1e9 / world->terms.haptic_hz); /* the end of its tick */
  for (uint32_t i = 0; i < last->body_high; ++i) {
    body_let_go(last, left_ns, &hapi_state_bodies(last)[i]);
  }
  for (uint32_t i = 0; i < last->pointer_count; ++i) {
    hapi_state_pointers(last)[i].generation = 0;
  }
  last->contact_count = last->joint_count = last->spring_count = last->side_count = 0;
  state_give(world, last);
}

/* ---- in ---- */

static void client_join(hapi_world_end *world, uint32_t peer)
{
  world->end.joined = true;
  world->end.peer = peer;
  world->admitted = world->draws = false;
  world->bounded_ns = 0;
  hapi_scenery_reset(&world->scenery);
  hapi_bound_reset(&world->bound, world->end.now_ns);
  world->tick = 0;
  world->end.codec.reset(world->end.codec.self);
  if (world->clients++ > 0) {
    world->renew(world->renew_of);
  }
  hapi_end_send_terms(&world->end, &world->terms);
}

/* Nothing more is taken of it, and it is told why. */
static void client_turn_away(hapi_world_end *world, const hap_detail *why)
{
  hapi_log(HAP_LOG_WARNING, "the hand's session is turned away: %.300s", why->text);
  hapi_end_send_refusal(&world->end, world->end.peer, why->text);
  world->end.joined = world->admitted = false;
  world->end.detail = *why;
  ++world->turned_away;
  loop_let_go(world);
}

static void client_admit(hapi_world_end *world, const hap_link_event *event)
{
  hapi_terms terms;
  hap_detail why = {""};
  if (hapi_terms_read(event->data, event->bytes, &terms, &why) < HAP_OK ||
      hapi_terms_compare(&terms, &world->terms, &why) < HAP_OK) {
    client_turn_away(world, &why);
  } else {
    world->admitted = true;
    world->draws = terms.draws;
    hapi_bound_allow(&world->bound, &terms.limits);
  }
}

static void world_hear(void *of, const hap_link_event *event)
{
  hapi_world_end *world = of;
  hapi_end *end = &world->end;
  if (event->kind == HAP_LINK_JOINED && end->joined) {
    ++world->turned_away;
    hapi_end_send_refusal(end, event->peer,
                          "the world has a hand's session already, and room for one: make this one "
                          "anew when the other has left");
  } else if (event->kind == HAP_LINK_JOINED) {
    client_join(world, event->peer);
  } else if (event->kind == HAP_LINK_LEFT && end->joined && event->peer == end->peer) {
    end->joined = false;
    loop_let_go(world);
  } else if (event->kind == HAP_LINK_MESSAGE && event->channel == HAPI_TERMS_CHANNEL) {
    client_admit(world, event);
  } else if (event->kind == HAP_LINK_MESSAGE) {
    const hap_detail why = {"it is no question for the time"};
    const int64_t times_ns[2] = {event->arrived_ns, end->now_ns};
    unsigned char answer[HAPI_STAMPS_ANSWER];
    if (hapi_stamps_answer(event->data, event->bytes, times_ns, answer)) {
      hapi_end_send_stamps(end, answer, sizeof answer);
    } else {
      hapi_end_refuse(end, &why);
    }
  }
}

/* What a client tells is within what its devices can do; one that goes on otherwise is no longer
 * listened to. */
static bool state_is_bounded(hapi_world_end *world, hapi_state *state)
{
  hap_detail why = {""};
  if (hapi_bound_take(&world->bound, world->end.now_ns, state, &why)) {
    world->bounded_ns = 0;
    return true;
  }
  if (world->bounded++ == 0) {
    hapi_log(HAP_LOG_WARNING, "%.300s", why.text);
  }
  world->end.detail = why;
  world->bounded_ns = world->bounded_ns == 0 ? world->end.now_ns : world->bounded_ns;
  if (world->end.now_ns - world->bounded_ns > BOUNDED_MOST_NS) {
    client_turn_away(world, &why);
  }
  return false;
}

void hapi_world_end_receive(hapi_world_end *world, int64_t now_ns)
{
  hapi_state *state = hapi_exchange_state_back(world->exchange);
  void *const messages[2] = {state, NULL};
  world->end.now_ns = now_ns;
  hapi_end_poll(&world->end, world_hear, world);
  if (!world->end.joined || !world->end.codec.give(world->end.codec.self, messages)) {
    return;
  }
  if (state->tick <= world->tick) { /* totals go on only */
    ++world->old;
    return;
  }
  world->tick = state->tick;
  if (!world->admitted || !state_is_bounded(world, state)) {
    return;
  }
  world->last = world->store;
  memcpy(world->last, state, hapi_exchange_message_size(world->exchange, HAPI_CHANNEL_STATE));
  state_give(world, state);
}

/* ---- out ---- */

void hapi_world_end_send(hapi_world_end *world, int64_t now_ns)
{
  hapi_model *model = hapi_exchange_model_take(world->exchange);
  hapi_near *near = hapi_exchange_near_take(world->exchange);
  void *const messages[2] = {model, near};
  world->end.now_ns = now_ns;
  if (model != NULL) {
    hapi_bound_note(&world->bound, model, near);
  }
  if (model != NULL && near != NULL) {
    hapi_end_send(&world->end, messages);
  }
  if (world->end.joined && world->draws && world->bodies.read != NULL) {
    const hapi_scenery_out out = {&world->end, hapi_end_send_scenery};
    (void)hapi_scenery_step(&world->scenery, &world->bodies, &out); /* without memory: later */
  }
}
