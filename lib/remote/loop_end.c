/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/loop_end.h"

#include <math.h>

/* ---- in ---- */

static void loop_hear(void *of, const hap_link_event *event)
{
  hapi_loop_end *loop = of;
  hap_detail why = {""};
  if (event->kind == HAP_LINK_JOINED) {
    loop->end.joined = true;
    loop->end.peer = event->peer;
  } else if (event->kind == HAP_LINK_LEFT) {
    loop->end.joined = loop->agreed = false;
  } else {
    hapi_terms terms;
    if (hapi_terms_read(event->data, event->bytes, &terms, &why) < HAP_OK ||
        hapi_terms_compare(&loop->terms, &terms, &why) < HAP_OK) {
      hapi_end_refuse(&loop->end, &why);
      return;
    }
    loop->terms = terms;
    loop->agreed = true;
    loop->next_ns = loop->end.now_ns;
  }
}

void hapi_loop_end_receive(hapi_loop_end *loop, int64_t now_ns)
{
  hapi_model *model = hapi_exchange_model_back(loop->exchange);
  hapi_near *near = hapi_exchange_near_back(loop->exchange);
  void *const messages[2] = {model, near};
  loop->end.now_ns = now_ns;
  hapi_end_poll(&loop->end, loop_hear, loop);
  if (!loop->agreed || !loop->end.codec.give(loop->end.codec.self, messages)) {
    return;
  }
  if (model->number <= loop->number) {
    ++loop->old;
    return;
  }
  loop->number = model->number;
  model->look_ahead_s = loop->terms.look_ahead_s; /* whatever a message says */
  hapi_exchange_near_publish(loop->exchange);
  hapi_exchange_model_publish(loop->exchange);
}

/* ---- out ---- */

void hapi_loop_end_send(hapi_loop_end *loop, int64_t now_ns)
{
  loop->end.now_ns = now_ns;
  if (!loop->agreed || now_ns < loop->next_ns) {
    return;
  }
  hapi_state *state = hapi_exchange_state_take(loop->exchange);
  void *const messages[2] = {state, NULL};
  if (state == NULL) {
    return;
  }
  hapi_end_send(&loop->end, messages);
  int64_t period_ns = llround(1e9 * loop->terms.period_s);
  loop->next_ns += period_ns;
  loop->next_ns = loop->next_ns <= now_ns ? now_ns + period_ns : loop->next_ns;
}
