/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/world_end.h"

/* ---- in ---- */

static void world_hear(void *of, const hap_link_event *event)
{
  hapi_world_end *world = of;
  hapi_end *end = &world->end;
  if (event->kind == HAP_LINK_JOINED && !end->joined) {
    end->joined = true;
    end->peer = event->peer;
    hapi_end_send_terms(end, &world->terms);
  } else if (event->kind == HAP_LINK_LEFT && end->joined && event->peer == end->peer) {
    end->joined = false;
  } else if (event->kind == HAP_LINK_MESSAGE) {
    const hap_detail why = {"a client has no terms to tell"};
    hapi_end_refuse(end, &why);
  }
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
  hapi_exchange_state_publish(world->exchange);
}

/* ---- out ---- */

void hapi_world_end_send(hapi_world_end *world, int64_t now_ns)
{
  hapi_model *model = hapi_exchange_model_take(world->exchange);
  hapi_near *near = hapi_exchange_near_take(world->exchange);
  void *const messages[2] = {model, near};
  world->end.now_ns = now_ns;
  if (model != NULL && near != NULL) {
    hapi_end_send(&world->end, messages);
  }
}
