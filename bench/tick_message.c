/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a message costs the loop: 64 bodies with a pointer contact each, and 512 contacts between them,
 * 4 a pair. hand-over: publish, by the other thread, and take; nothing is copied there. bodies,
 * contacts: what the tick does with what it has taken, model CONTACT, all of it known before. A time is
 * the median of 5 runs. */

#include "bench/tick_message.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "bench/tick_contact.h"
#include "haptic/tick_memory.h"
#include "sync/exchange.h"

#define RUNS 5
#define BODIES 64u
#define CONTACTS 512u
#define POINTS 4u /* of a pair */
#define BOUND_NS 5000.0

typedef struct message_bed {
  hapi_tick tick;
  hapi_exchange *exchange;
  uint64_t number;
} message_bed;

static void fill_body(hapi_model_body *body, hapi_model_contact *contact, uint32_t index)
{
  memset(body, 0, sizeof *body);
  memset(contact, 0, sizeof *contact);
  body->slot = contact->slot = contact->body = index;
  body->generation = contact->generation = contact->pointer_generation = 1;
  body->flags = HAPI_BODY_OWNED;
  body->mass = body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  body->pose.quat_wxyz[0] = 1.0;
  body->pose.position[0] = index;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = body->inverse_inertia[4 * i] = 1.0;
  }
  contact->normal_body[0] = 1.0;
}

static void publish_model(message_bed *m)
{
  hapi_model *model = hapi_exchange_model_back(m->exchange);
  model->number = ++m->number;
  model->model = HAP_MODEL_CONTACT;
  model->body_count = model->contact_count = BODIES;
  for (uint32_t i = 0; i < BODIES; ++i) {
    fill_body(&hapi_model_bodies(model)[i], &hapi_model_contacts(model)[i], i);
  }
  hapi_exchange_model_publish(m->exchange);
}

static void publish_patches(message_bed *m)
{
  hapi_patches *patches = hapi_exchange_patches_back(m->exchange);
  patches->model_number = m->number;
  patches->contact_count = CONTACTS;
  for (uint32_t i = 0; i < CONTACTS; ++i) {
    hapi_patch_contact *c = &hapi_patches_contacts(patches)[i];
    memset(c, 0, sizeof *c);
    c->key = i / POINTS + 1;
    c->body_a = i / POINTS % BODIES;
    c->body_b = (c->body_a + 1 + i / POINTS / BODIES) % BODIES;
    c->generation_a = c->generation_b = 1;
    c->core_a[0] = (i & 1u) != 0 ? 0.025 : -0.025;
    c->core_a[1] = (i & 2u) != 0 ? 0.025 : -0.025;
  }
  hapi_exchange_patches_publish(m->exchange);
}

static bool open_bed(message_bed *m)
{
  const hapi_capacity capacity = {BODIES, CONTACTS, 1, 1, 1};
  memset(m, 0, sizeof *m);
  m->tick.period = 1e-3;
  if (!hapi_tick_memory_create(&m->tick, &capacity) ||
      hapi_exchange_create(&capacity, &m->exchange) < HAP_OK) {
    return false;
  }
  hapi_tick_reset(&m->tick);
  hapi_tick_pointer *p = &m->tick.pointers[0];
  p->generation = 1;
  p->radius = 0.01;
  p->pose.quat_wxyz[0] = p->pose_world_device.quat_wxyz[0] = p->device_pose.quat_wxyz[0] = 1.0;
  return true;
}

static void close_bed(message_bed *m)
{
  hapi_tick_memory_destroy(&m->tick);
  hapi_exchange_destroy(m->exchange);
}

typedef struct message_times {
  double hand_over[RUNS];
  double bodies[RUNS];
  double contacts[RUNS];
} message_times;

/* Writing a message is the other threads' time. False: a message did not arrive whole. */
static bool measure(message_bed *m, int repeats, int run, message_times *out)
{
  int64_t spent[3] = {0, 0, 0};
  bool whole = true;
  for (int i = 0; i < repeats; ++i) {
    publish_model(m);
    publish_patches(m);
    int64_t begin_ns = hapi_clock_now();
    hapi_model *model = hapi_exchange_model_take(m->exchange);
    hapi_patches *patches = hapi_exchange_patches_take(m->exchange);
    int64_t taken_ns = hapi_clock_now();
    hapi_tick_adopt(&m->tick, model, m->tick.now_ns);
    int64_t bodies_ns = hapi_clock_now();
    hapi_tick_adopt_patches(&m->tick, patches);
    int64_t end_ns = hapi_clock_now();
    spent[0] += taken_ns - begin_ns;
    spent[1] += bodies_ns - taken_ns;
    spent[2] += end_ns - bodies_ns;
    whole = whole && m->tick.live_count == BODIES && m->tick.contact_count == BODIES &&
            m->tick.world.memory_count == CONTACTS;
  }
  out->hand_over[run] = (double)spent[0] / repeats;
  out->bodies[run] = (double)spent[1] / repeats;
  out->contacts[run] = (double)spent[2] / repeats;
  return whole;
}

hap_status bench_tick_message(bench *b, FILE *csv)
{
  message_bed m;
  message_times times;
  bool good = open_bed(&m);
  for (int run = 0; run < RUNS && good; ++run) {
    good = measure(&m, b->quick ? 2000 : 20000, run, &times);
  }
  close_bed(&m);
  if (!good) {
    return bench_fail(b, HAP_ERROR_STATE, "messages: they do not arrive as they were sent");
  }
  double hand_over = bench_median(times.hand_over, RUNS);
  double bodies = bench_median(times.bodies, RUNS);
  double contacts = bench_median(times.contacts, RUNS);
  fprintf(csv, "message,%u,%u,%.1f,%.2f," TICK_CONTACT_EMPTY "\n", BODIES, CONTACTS,
          hand_over + bodies + contacts, (bodies + contacts) / BODIES);
  bench_check(
      b, hand_over <= BOUND_NS,
      "message of %u bodies and %u contacts: hand-over, without a copy, %.0f ns (bound 5000)",
      BODIES, CONTACTS, hand_over);
  bench_say("  taken in by a tick: bodies %.0f ns, contacts %.0f ns", bodies, contacts);
  return HAP_OK;
}
