/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/world_end.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"

/* So long a client is waited for that tells what it cannot do, or floods. */
#define PATIENCE_NS INT64_C(1000000000)
/* Messages of a client in one cycle that are looked into. What is more takes no time from others:
 * it is thrown away. */
#define TAKEN_MOST 1024u
#define POLLS_MOST 4096u /* for each client, and once more */

/* ---- life ---- */

hap_status hapi_world_end_begin(hapi_world_end *world)
{
  const hapi_capacity *capacity = hapi_exchange_capacity(world->exchange);
  double late_s = world->terms.look_ahead_s + 2.0 * world->terms.period_s;
  world->terms.capacity = *capacity;
  world->room = world->codecs != NULL ? world->room : 1;
  world->count = world->room + (world->loop != NULL ? 1 : 0);
  world->guests = hapi_alloc_array(world->count, sizeof *world->guests);
  world->contact_guests = hapi_alloc_array(capacity->contacts, sizeof *world->contact_guests);
  bool shares = hapi_shares_create(&world->shares, capacity);
  bool merge = hapi_merge_create(&world->merge, capacity);
  bool hands = hapi_hands_create(&world->hands, capacity);
  hapi_capacity cut = *capacity;
  cut.trail_rows = cut.path_rows = 0;
  world->shares.loop = world->loop != NULL ? (uint8_t)world->room : HAPI_GUEST_NONE;
  if (world->guests == NULL || world->contact_guests == NULL || !shares || !merge || !hands ||
      hapi_exchange_create_late(&cut, &world->cut) < HAP_OK) {
    return HAP_ERROR_MEMORY;
  }
  hap_status status = HAP_OK;
  for (uint32_t i = 0; i < world->count && status >= HAP_OK; ++i) {
    hapi_guest *guest = &world->guests[i];
    status = hapi_guest_create(guest, world->exchange, late_s);
    guest->end.link = world->end.link;
    guest->end.codec =
        world->codecs != NULL && i < world->room ? world->codecs[i] : world->end.codec;
  }
  hapi_world_end_limit(world, &world->terms.limits);
  return status;
}

void hapi_world_end_finish(hapi_world_end *world)
{
  for (uint32_t i = 0; world->guests != NULL && i < world->count; ++i) {
    hapi_guest_finish(&world->guests[i]);
  }
  hapi_free(world->guests);
  hapi_free(world->contact_guests);
  hapi_shares_finish(&world->shares);
  hapi_merge_finish(&world->merge);
  hapi_hands_finish(&world->hands);
  hapi_exchange_destroy(world->cut);
  world->guests = NULL;
  world->contact_guests = NULL;
  world->cut = NULL;
}

void hapi_world_end_limit(hapi_world_end *world, const hapi_limits *most)
{
  world->terms.limits = *most;
  for (uint32_t i = 0; i < world->room; ++i) {
    world->guests[i].bound.most = *most;
  }
}

static uint8_t guest_number(const hapi_world_end *world, const hapi_guest *guest)
{
  return (uint8_t)(guest - world->guests);
}

/* ---- hands: their numbers in the world ---- */

static void hand_drop(hapi_world_end *world, hapi_guest_hand *io)
{
  if (io->generation != 0) {
    world->shares.hands[io->number].guest = HAPI_GUEST_NONE;
    world->shares.hands[io->number].state = NULL;
    world->shares.hands[io->number].hull = NULL;
    io->generation = 0;
  }
}

static void hands_drop(hapi_world_end *world, hapi_guest *guest)
{
  for (uint32_t i = 0; i < world->shares.hand_count; ++i) {
    hand_drop(world, &guest->hands[i]);
  }
}

/* False: all numbers are in use. */
static bool hand_add(hapi_world_end *world, hapi_guest *guest, uint32_t pointer,
                     uint32_t generation)
{
  uint32_t number = 0;
  while (number < world->shares.hand_count &&
         world->shares.hands[number].guest != HAPI_GUEST_NONE) {
    ++number;
  }
  if (number == world->shares.hand_count) {
    return false;
  }
  hapi_share_hand *hand = &world->shares.hands[number];
  hand->guest = guest_number(world, guest);
  hand->pointer = pointer;
  hand->own = generation;
  ++hand->generation;
  hand->generation += hand->generation == 0;
  guest->hands[pointer] = (hapi_guest_hand){generation, number};
  return true;
}

static bool hands_follow(hapi_world_end *world, hapi_guest *guest)
{
  bool all = true;
  for (uint32_t i = 0; i < guest->state->pointer_count; ++i) {
    hapi_state_pointer *in = &hapi_state_pointers(guest->state)[i];
    hapi_guest_hand *hand = &guest->hands[i];
    if (hand->generation != in->generation) {
      hand_drop(world, hand);
      all = (in->generation == 0 || hand_add(world, guest, i, in->generation)) && all;
    }
    if (hand->generation != 0) {
      world->shares.hands[hand->number].state = in;
      world->shares.hands[hand->number].hull = &hapi_state_hulls(guest->state)[i];
    }
  }
  return all;
}

/* ---- clients that come and go ---- */

static void client_leave(hapi_world_end *world, hapi_guest *guest)
{
  guest->end.joined = guest->admitted = false;
  --world->joined;
  world->end.joined = world->joined > 0;
  hapi_guest_let_go(guest, world->terms.haptic_hz);
}

/* Nothing more is taken of it, and it is told why. */
static void client_turn_away(hapi_world_end *world, hapi_guest *guest, const hap_detail *why)
{
  hapi_log(HAP_LOG_WARNING, "the hand's session is turned away: %.300s", why->text);
  hapi_end_send_refusal(&guest->end, guest->end.peer, why->text);
  world->end.detail = *why;
  ++world->turned_away;
  client_leave(world, guest);
}

static void client_refuse(hapi_world_end *world, uint32_t peer)
{
  hap_detail why;
  snprintf(why.text, sizeof why.text,
           world->room > 1 ? "the world has %u hands' sessions already, and room for no more: make "
                             "this one anew when another has left"
                           : "the world has a hand's session already, and room for %u: make this "
                             "one anew when the other has left",
           world->room);
  ++world->turned_away;
  hapi_end_send_refusal(&world->end, peer, why.text);
}

static void client_join(hapi_world_end *world, uint32_t peer)
{
  hapi_guest *guest = NULL;
  for (uint32_t i = 0; i < world->room && guest == NULL; ++i) {
    bool free = !world->guests[i].end.joined && !world->guests[i].leaves;
    guest = free ? &world->guests[i] : NULL;
  }
  if (guest == NULL) {
    client_refuse(world, peer);
    return;
  }
  hapi_guest_begin(guest, world->end.now_ns, &world->terms.capacity);
  guest->end.joined = world->end.joined = true;
  guest->end.peer = peer;
  guest->end.now_ns = world->end.now_ns;
  guest->end.codec.reset(guest->end.codec.self);
  ++world->joined;
  ++world->clients;
  if (world->joined > 1 && world->wake != NULL) {
    world->wake(world->wake_of);
    world->wake = NULL;
  }
  hapi_end_send_terms(&guest->end, &world->terms);
}

static void client_admit(hapi_world_end *world, hapi_guest *guest, const hap_link_event *event)
{
  hapi_terms terms;
  hap_detail why = {""};
  if (hapi_terms_read(event->data, event->bytes, &terms, &why) < HAP_OK ||
      hapi_terms_compare(&terms, &world->terms, &why) < HAP_OK) {
    client_turn_away(world, guest, &why);
  } else {
    guest->admitted = true;
    guest->draws = terms.draws;
    hapi_bound_allow(&guest->bound, &terms.limits);
  }
}

/* ---- in ---- */

/* NULL: there is none, or it is no longer listened to. */
static hapi_guest *guest_find(const hapi_world_end *world, uint32_t peer, bool *out_known)
{
  hapi_guest *found = NULL;
  *out_known = false;
  for (uint32_t i = 0; i < world->room; ++i) {
    hapi_guest *guest = &world->guests[i];
    *out_known = *out_known || guest->end.peer == peer;
    found = guest->end.joined && guest->end.peer == peer ? guest : found;
  }
  return found;
}

static void question_answer(hapi_world_end *world, hapi_guest *guest, const hap_link_event *event)
{
  const hap_detail why = {"it is no question for the time"};
  const int64_t times_ns[2] = {event->arrived_ns, world->end.now_ns};
  unsigned char answer[HAPI_STAMPS_ANSWER];
  if (hapi_stamps_answer(event->data, event->bytes, times_ns, answer)) {
    hapi_end_send_stamps(&guest->end, answer, sizeof answer);
  } else {
    hapi_end_refuse(&world->end, &why);
  }
}

static void message_take(hapi_world_end *world, const hap_link_event *event)
{
  hap_detail why = {""};
  bool known;
  hapi_guest *guest = guest_find(world, event->peer, &known);
  if (guest == NULL && !known) {
    snprintf(why.text, sizeof why.text, "it is of peer %u, who has no part here", event->peer);
    hapi_end_refuse(&world->end, &why);
  } else if (guest == NULL || guest->taken++ >= TAKEN_MOST) {
    ++world->end.refused; /* told to go, or too much: why, stays to be read */
  } else if (event->channel == HAPI_TERMS_CHANNEL) {
    client_admit(world, guest, event);
  } else if (event->channel == HAPI_STAMPS_CHANNEL) {
    question_answer(world, guest, event);
  } else if (guest->end.codec.take(guest->end.codec.self, event, &why) < HAP_OK) {
    hapi_end_refuse(&world->end, &why);
  }
}

static void world_poll(hapi_world_end *world)
{
  hap_link_event event = {.kind = HAP_LINK_MESSAGE};
  hap_status status = HAP_OK;
  bool waits = false; /* for the place of the only client that there may be */
  for (uint32_t i = 0; i < POLLS_MOST * (1 + world->room) && !waits; ++i) {
    bool known;
    status = hap_link_poll(world->end.link, world->end.now_ns, &event, sizeof event);
    if (status != HAP_OK) {
      break;
    }
    hapi_guest *guest = guest_find(world, event.peer, &known);
    if (event.kind == HAP_LINK_JOINED && guest == NULL) {
      client_join(world, event.peer);
    } else if (event.kind == HAP_LINK_LEFT && guest != NULL) {
      client_leave(world, guest);
      waits = world->room == 1;
    } else if (event.kind == HAP_LINK_MESSAGE) {
      message_take(world, &event);
    }
  }
  if (status < HAP_OK) {
    ++world->end.failed;
    (void)hap_link_detail(world->end.link, &world->end.detail);
  }
}

/* Since when something goes on; it is over where it is 0. */
static bool is_long(const hapi_world_end *world, bool goes_on, int64_t *io_since_ns)
{
  int64_t now_ns = world->end.now_ns;
  *io_since_ns = !goes_on ? 0 : *io_since_ns == 0 ? now_ns : *io_since_ns;
  return goes_on && now_ns - *io_since_ns > PATIENCE_NS;
}

/* What a client tells is within what its devices can do; one that goes on otherwise is no longer
 * listened to. */
static void state_take(hapi_world_end *world, hapi_guest *guest, hapi_state *state)
{
  hap_detail why = {""};
  if (state->tick <= guest->tick) { /* totals go on only */
    ++world->old;
    return;
  }
  guest->tick = state->tick;
  if (!guest->admitted) {
    return;
  }
  bool good = hapi_guest_admit(guest, world->end.now_ns, state, &why);
  if (!good) {
    if (world->bounded++ == 0) {
      hapi_log(HAP_LOG_WARNING, "%.300s", why.text);
    }
    world->end.detail = why;
  }
  if (is_long(world, !good, &guest->bounded_ns)) {
    client_turn_away(world, guest, &why);
  }
  if (!good) {
    return;
  }
  size_t size = hapi_exchange_message_size(world->exchange, HAPI_CHANNEL_STATE);
  hapi_guest_take(guest, world->end.now_ns, state, size, world->shares.of,
                  guest_number(world, guest));
  if (!hands_follow(world, guest)) {
    snprintf(why.text, sizeof why.text,
             "the world has room for %u hands of all sessions, and they are in use: raise "
             "max_pointers of all sessions",
             world->shares.hand_count);
    client_turn_away(world, guest, &why);
  }
}

static void flood_judge(hapi_world_end *world, hapi_guest *guest)
{
  hap_detail why;
  if (is_long(world, guest->taken > TAKEN_MOST, &guest->flood_ns)) {
    snprintf(why.text, sizeof why.text, "more than %u messages come from it in each step",
             TAKEN_MOST);
    client_turn_away(world, guest, &why);
  }
  guest->taken = 0;
}

static void guests_take(hapi_world_end *world)
{
  hapi_state *state = hapi_exchange_state_back(world->cut);
  void *const messages[2] = {state, NULL};
  for (uint32_t i = 0; i < world->room; ++i) {
    hapi_guest *guest = &world->guests[i];
    if (guest->end.joined && guest->end.codec.give(guest->end.codec.self, messages)) {
      state_take(world, guest, state);
    }
    if (guest->end.joined) {
      flood_judge(world, guest);
    }
  }
}

/* The world's own loop has no hands: those in it are the clients'. */
static void loop_take(hapi_world_end *world)
{
  hapi_state *state = world->loop != NULL ? hapi_exchange_state_take(world->loop) : NULL;
  if (state == NULL) {
    return;
  }
  hapi_guest *guest = &world->guests[world->shares.loop];
  size_t size = hapi_exchange_message_size(world->exchange, HAPI_CHANNEL_STATE);
  memcpy(guest->state, state, size); /* the loop's own stays as it is */
  hapi_guest_own(guest, guest->state);
  hapi_guest_take(guest, world->end.now_ns, guest->state, size, world->shares.of,
                  world->shares.loop);
}

static void guests_merge(hapi_world_end *world)
{
  const hapi_merge_from from = {.shares = &world->shares,
                                .guests = world->guests,
                                .count = world->count,
                                .model_number = world->model_number,
                                .now_ns = world->end.now_ns,
                                .late_ns = PATIENCE_NS + llround(1e9 * world->terms.look_ahead_s),
                                .contact_guests = world->contact_guests};
  bool fresh = false;
  for (uint32_t i = 0; i < world->count; ++i) {
    fresh = fresh || world->guests[i].fresh;
  }
  if (fresh && hapi_merge_make(&world->merge, &from, hapi_exchange_state_back(world->exchange),
                               &world->terms.capacity)) {
    hapi_exchange_state_publish(world->exchange);
  }
}

/* Of those that have gone what they gave stays. */
static void guests_close(hapi_world_end *world)
{
  for (uint32_t i = 0; i < world->count; ++i) {
    hapi_guest *guest = &world->guests[i];
    guest->fresh = false;
    if (guest->leaves) {
      hapi_merge_leave(&world->merge, &world->shares, guest);
      hapi_shares_leave(&world->shares, guest_number(world, guest));
      hands_drop(world, guest);
      hapi_guest_begin(guest, world->end.now_ns, &world->terms.capacity);
    }
  }
}

/* What it could not send. */
static void failures_take(hapi_world_end *world)
{
  for (uint32_t i = 0; i < world->room; ++i) {
    hapi_end *end = &world->guests[i].end;
    if (end->failed > 0) {
      world->end.failed += end->failed;
      world->end.detail = end->detail;
      end->failed = 0;
    }
  }
}

void hapi_world_end_receive(hapi_world_end *world, int64_t now_ns)
{
  world->end.now_ns = now_ns;
  for (uint32_t i = 0; i < world->room; ++i) {
    world->guests[i].end.now_ns = now_ns;
  }
  world_poll(world);
  guests_take(world);
  loop_take(world);
  guests_merge(world);
  guests_close(world);
  failures_take(world);
}

/* ---- out ---- */

static void contacts_note(const hapi_world_end *world, hapi_model *model)
{
  for (uint32_t i = 0; i < model->contact_count; ++i) {
    const hapi_model_contact *contact = &hapi_model_contacts(model)[i];
    world->contact_guests[contact->slot] = world->shares.hands[contact->pointer].guest;
  }
}

/* What is the guest's until it uses a later model. Also of what is in no model any more: it has
 * yet to say where it has let go of it. */
static void bodies_give(const hapi_world_end *world, hapi_guest *guest, hapi_model *model)
{
  uint8_t number = guest_number(world, guest);
  for (uint32_t i = 0; i < model->body_count; ++i) {
    const hapi_model_body *body = &hapi_model_bodies(model)[i];
    hapi_guest_body *known = &guest->bodies[body->slot];
    if (known->generation != body->generation) {
      *known = (hapi_guest_body){.generation = body->generation};
    }
    if (world->shares.of[body->slot].of == number && (body->flags & HAPI_BODY_OWNED) != 0) {
      known->owned_to = model->number;
    }
  }
  for (uint32_t i = 0; i < world->shares.body_count; ++i) {
    if (world->shares.of[i].of == number) {
      guest->bodies[i].mine_to = model->number;
    }
  }
}

/* What of its own it finds in the model: as of its newest state, which physics has had. */
static void bodies_tell(const hapi_guest *guest, hapi_model *io)
{
  io->tick = guest->has_state ? guest->state->tick : 0;
  for (uint32_t i = 0; i < io->body_count; ++i) {
    hapi_model_body *body = &hapi_model_bodies(io)[i];
    const hapi_guest_body *known = &guest->bodies[body->slot];
    memcpy(body->impulse_taken, known->told, sizeof body->impulse_taken);
    memcpy(body->gain_taken, known->gain, sizeof body->gain_taken);
  }
}

#define FLIGHT_MODELS 4u

/* Only a body that is known to fly falls on from where it was told: what has come to the world's
 * loop just now has no contacts there yet. */
static void copies_tell(const hapi_world_end *world, hapi_model *io)
{
  hapi_state *state = world->loop != NULL ? world->guests[world->shares.loop].state : NULL;
  for (uint32_t i = 0; i < io->body_count && state != NULL; ++i) {
    hapi_model_body *body = &hapi_model_bodies(io)[i];
    if ((body->flags & HAPI_BODY_SHARED) == 0) {
      continue;
    }
    uint32_t flags = body->slot < state->body_high ? hapi_state_bodies(state)[body->slot].flags : 0;
    bool flies = (flags & (HAPI_BODY_OWNED | HAPI_BODY_TOUCHED)) == HAPI_BODY_OWNED &&
                 io->number >= world->shares.of[body->slot].since + FLIGHT_MODELS;
    if (!flies) {
      memset(body->b, 0, sizeof body->b);
    }
  }
}

/* The guest's part of the model. */
static void part_make(const hapi_world_end *world, hapi_guest *guest, hapi_model *model,
                      hapi_near *near, void *const out[2])
{
  hapi_shares_cut(&world->shares, guest_number(world, guest), model, near, out[0], out[1]);
  bodies_give(world, guest, out[0]);
  bodies_tell(guest, out[0]);
}

static void guest_send(const hapi_world_end *world, hapi_guest *guest, hapi_model *model,
                       hapi_near *near)
{
  void *const messages[2] = {hapi_exchange_model_back(world->cut),
                             hapi_exchange_near_back(world->cut)};
  part_make(world, guest, model, near, messages);
  copies_tell(world, messages[0]);
  hapi_bound_note(&guest->bound, messages[0], messages[1]);
  hapi_end_send(&guest->end, messages);
}

/* ---- bodies that a client draws ---- */

typedef struct guest_view {
  const hapi_world_end *world;
  uint8_t number;
} guest_view;

static uint32_t view_places(void *of)
{
  const guest_view *view = of;
  return view->world->bodies.places(view->world->bodies.of);
}

/* What its own loop moves a client knows better; bodies of other loops it is told. */
static void view_read(void *of, uint32_t first, uint32_t count, hapi_told_body *out)
{
  const guest_view *view = of;
  view->world->bodies.read(view->world->bodies.of, first, count, out);
  for (uint32_t i = 0; i < count; ++i) {
    out[i].owned = out[i].owned && out[i].slot < view->world->shares.body_count &&
                   hapi_shares_moves(&view->world->shares, view->number, out[i].slot);
  }
}

static void guest_show(hapi_world_end *world, hapi_guest *guest)
{
  guest_view view = {world, guest_number(world, guest)};
  const hapi_scenery_source from = {&view, view_places, view_read};
  const hapi_scenery_out out = {&guest->end, hapi_end_send_scenery};
  (void)hapi_scenery_step(&guest->scenery, &from, &out); /* without memory: later */
}

static void loop_send(hapi_world_end *world, hapi_model *model, hapi_near *near)
{
  void *const messages[2] = {hapi_exchange_model_back(world->loop),
                             hapi_exchange_near_back(world->loop)};
  part_make(world, &world->guests[world->shares.loop], model, near, messages);
  hapi_hands_follow(&world->hands, world->end.now_ns, messages[0], messages[1]);
  hapi_exchange_near_publish(world->loop);
  hapi_exchange_model_publish(world->loop);
}

void hapi_world_end_send(hapi_world_end *world, int64_t now_ns)
{
  hapi_model *model = hapi_exchange_model_take(world->exchange);
  hapi_near *near = hapi_exchange_near_take(world->exchange);
  if (model == NULL || near == NULL) {
    return;
  }
  world->end.now_ns = now_ns;
  world->model_number = model->number;
  hapi_shares_find(&world->shares, model, near);
  contacts_note(world, model);
  for (uint32_t i = 0; i < world->room; ++i) {
    hapi_guest *guest = &world->guests[i];
    guest->end.now_ns = now_ns;
    if (guest->end.joined) {
      guest_send(world, guest, model, near);
    }
    if (guest->end.joined && guest->draws && world->bodies.read != NULL) {
      guest_show(world, guest);
    }
  }
  if (world->loop != NULL && world->wake == NULL) {
    loop_send(world, model, near);
  }
  failures_take(world);
}
