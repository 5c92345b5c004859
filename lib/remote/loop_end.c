/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/loop_end.h"

#include <math.h>
#include <stdio.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"

hap_status hapi_loop_end_begin(hapi_loop_end *loop)
{
  uint32_t bodies = hapi_exchange_capacity(loop->exchange)->bodies;
  loop->left = hapi_alloc_array(bodies, sizeof *loop->left);
  bool hands = hapi_hands_create(&loop->hands, hapi_exchange_capacity(loop->exchange));
  return hands && loop->left != NULL ? HAP_OK : HAP_ERROR_MEMORY;
}

void hapi_loop_end_finish(hapi_loop_end *loop)
{
  hapi_free(loop->left);
  hapi_hands_finish(&loop->hands);
  loop->left = NULL;
}

/* ---- the clocks: messages have the world's; 0 is no time ---- */

static int64_t earlier_of(int64_t a, int64_t b)
{
  return a < b ? a : b;
}

/* No model is of the future, whatever it says: the guard would take it for new for as long. */
static void model_shift(int64_t offset_ns, int64_t now_ns, hapi_model *io)
{
  io->state_ns = earlier_of(io->state_ns - offset_ns, now_ns);
  io->valid_from_ns = earlier_of(io->valid_from_ns - offset_ns, now_ns);
  io->sent_ns = io->sent_ns != 0 ? earlier_of(io->sent_ns - offset_ns, now_ns) : 0;
}

static void state_shift(hapi_loop_end *loop, int64_t offset_ns, hapi_state *io)
{
  io->now_ns += offset_ns;
  for (uint32_t i = 0; i < io->body_high; ++i) {
    hapi_state_body *body = &hapi_state_bodies(io)[i];
    hapi_loop_left *left = &loop->left[i];
    if (body->owned_until_ns == 0) {
      continue;
    }
    if (left->until_ns != body->owned_until_ns) {
      *left = (hapi_loop_left){body->owned_until_ns, body->owned_until_ns + offset_ns};
    }
    body->owned_until_ns = left->told_ns;
  }
}

/* As the loop has it: what it has told, it tells no more where it stays. */
static void state_shift_back(const hapi_loop_end *loop, hapi_state *io)
{
  for (uint32_t i = 0; i < io->body_high; ++i) {
    hapi_state_body *body = &hapi_state_bodies(io)[i];
    if (body->owned_until_ns != 0) {
      body->owned_until_ns = loop->left[i].until_ns;
    }
  }
}

/* ---- in ---- */

static void told_hear(hapi_loop_end *loop, const hap_link_event *event)
{
  hapi_told_body told[HAPI_SCENERY_MOST];
  uint64_t number = 0;
  uint32_t count = hapi_scenery_read(event->data, event->bytes, &number, told);
  if (count == 0) {
    const hap_detail why = {"it does not tell where bodies are"};
    hapi_end_refuse(&loop->end, &why);
  } else if (loop->draws) {
    loop->view.hear(loop->view.of, number, told, count);
  }
}

/* The bodies of two worlds are told by their names, which only worlds that were built alike have
 * in common. A session without bodies of its own draws nothing, and says nothing. */
static void scene_compare(hapi_loop_end *loop, const hapi_scene_print *theirs)
{
  const hapi_scene_print *own = &loop->scene;
  bool same = own->bodies == theirs->bodies && own->shapes == theirs->shapes;
  loop->draws = same && loop->view.hear != NULL;
  if (loop->draws || own->bodies == 0 || loop->view.hear == NULL) {
    return;
  }
  snprintf(loop->end.detail.text, sizeof loop->end.detail.text,
           "bodies are not drawn: the world was built otherwise than this session's own, of %u "
           "bodies there and %u here%s; build both alike, or make this one empty",
           theirs->bodies, own->bodies,
           own->bodies == theirs->bodies ? " with other shapes or masses" : "");
  hapi_log(HAP_LOG_WARNING, "%.300s", loop->end.detail.text);
}

static void loop_hear(void *of, const hap_link_event *event)
{
  hapi_loop_end *loop = of;
  hap_detail why = {""};
  if (event->kind == HAP_LINK_JOINED) {
    loop->end.joined = true;
    loop->end.peer = event->peer;
  } else if (event->kind == HAP_LINK_LEFT) {
    loop->end.joined = loop->agreed = false;
  } else if (event->channel == HAPI_STAMPS_CHANNEL) {
    if (!hapi_stamps_take(&loop->stamps, event->data, event->bytes, event->arrived_ns)) {
      snprintf(why.text, sizeof why.text, "it is no answer about the time");
      hapi_end_refuse(&loop->end, &why);
    }
  } else if (event->channel == HAPI_SCENERY_CHANNEL) {
    told_hear(loop, event);
  } else if (hapi_refusal_read(event->data, event->bytes, &why)) {
    hapi_log(HAP_LOG_ERROR, "the world does not take this session: %.300s", why.text);
    loop->turned_away = true;
    loop->agreed = false;
    loop->end.detail = why;
  } else {
    hapi_terms terms;
    if (hapi_terms_read(event->data, event->bytes, &terms, &why) < HAP_OK ||
        hapi_terms_compare(&loop->terms, &terms, &why) < HAP_OK) {
      hapi_end_refuse(&loop->end, &why);
      return;
    }
    if (!loop->agreed) {
      scene_compare(loop, &terms.scene);
    }
    loop->terms = terms;
    loop->agreed = !loop->turned_away;
    loop->next_ns = loop->end.now_ns;
  }
}

/* A step more is what the world looks ahead by itself, beside what the loop may be late. */
static void trip_judge(hapi_loop_end *loop, int64_t trip_ns)
{
  double trip_s = 1e-9 * (double)trip_ns;
  if (!loop->said_far && loop->stamps.count >= HAPI_STAMPS_KEPT &&
      trip_s > loop->terms.look_ahead_s + loop->terms.period_s) {
    loop->said_far = true;
    hapi_log(HAP_LOG_WARNING,
             "the world is %.0f ms away and back, and looks ahead by %.0f ms: bodies are felt late "
             "or not at all; give its session more look_ahead",
             1e3 * trip_s, 1e3 * loop->terms.look_ahead_s);
  }
}

void hapi_loop_end_receive(hapi_loop_end *loop, int64_t now_ns)
{
  hapi_model *model = hapi_exchange_model_back(loop->exchange);
  hapi_near *near = hapi_exchange_near_back(loop->exchange);
  void *const messages[2] = {model, near};
  loop->end.now_ns = now_ns;
  hapi_end_poll(&loop->end, loop_hear, loop);
  if (!loop->agreed || loop->stamps.count == 0 ||
      !loop->end.codec.give(loop->end.codec.self, messages)) {
    return;
  }
  if (model->number <= loop->number) {
    ++loop->old;
    return;
  }
  loop->number = model->number;
  model->look_ahead_s = loop->terms.look_ahead_s; /* whatever a message says */
  int64_t trip_ns;
  model_shift(hapi_stamps_offset(&loop->stamps, &trip_ns), now_ns, model);
  trip_judge(loop, trip_ns);
  hapi_hands_follow(&loop->hands, now_ns, model, near);
  if (loop->draws) { /* one way late; jitter is not drawn */
    const int64_t times_ns[2] = {earlier_of(model->state_ns + trip_ns / 2, now_ns), now_ns};
    loop->view.draw(loop->view.of, model, loop->terms.period_s, times_ns);
  }
  hapi_exchange_near_publish(loop->exchange);
  hapi_exchange_model_publish(loop->exchange);
}

/* ---- out ---- */

void hapi_loop_end_send(hapi_loop_end *loop, int64_t now_ns)
{
  unsigned char question[HAPI_STAMPS_QUESTION];
  loop->end.now_ns = now_ns;
  bool grows = loop->limits.force > loop->told.force || loop->limits.speed > loop->told.speed;
  if (loop->agreed && (grows || !loop->terms_told)) {
    hapi_terms own = loop->terms;
    own.limits = loop->limits;
    own.draws = loop->draws && loop->scene.bodies > 0;
    hapi_end_send_terms(&loop->end, &own);
    loop->told.force = hapi_max(loop->told.force, loop->limits.force);
    loop->told.speed = hapi_max(loop->told.speed, loop->limits.speed);
    loop->terms_told = true;
  }
  if (loop->agreed && hapi_stamps_ask(&loop->stamps, now_ns, question)) {
    hapi_end_send_stamps(&loop->end, question, sizeof question);
  }
  if (!loop->agreed || now_ns < loop->next_ns) {
    return;
  }
  hapi_state *state = hapi_exchange_state_take(loop->exchange);
  void *const messages[2] = {state, NULL};
  if (state == NULL) {
    return;
  }
  int64_t trip_ns;
  hapi_hands_hide(&loop->hands, state);
  bool shifts = loop->stamps.count > 0; /* before, no body is the loop's, and hands can be told */
  if (shifts) {
    state_shift(loop, hapi_stamps_offset(&loop->stamps, &trip_ns), state);
  }
  hapi_end_send(&loop->end, messages);
  if (shifts) {
    state_shift_back(loop, state);
  }
  int64_t period_ns = llround(1e9 * loop->terms.period_s);
  loop->next_ns += period_ns;
  loop->next_ns = loop->next_ns <= now_ns ? now_ns + period_ns : loop->next_ns;
}
