/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "contact/contact.h"

#include <math.h>
#include <stdatomic.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/hash.h"
#include "base/histogram.h"
#include "base/thread.h"
#include "contact/asking.h"
#include "contact/pairs.h"
#include "contact/places.h"
#include "contact/tools.h"

/* One pass: pairs and poses in, contacts out, each with what the tick needs to place it anew. Then
 * the life of the contact thread, and its pace. */

#define AGE_TICKS 2.0 /* from the poses of a pass to the use of its contacts */
#define LINGER_PASSES 20u
#define CONTACT_HZ 200.0 /* until the first message says more */

struct hapi_contact {
  hapi_contact_config config;
  hapi_places places;
  hapi_pairs *pairs;
  hapi_tools *tools;
  hapi_asking asking;
  uint64_t number;
  uint32_t lingers;          /* passes that are made although nothing is left to find */
  _Atomic uint64_t left_out; /* pairs without room for their contacts, sum over the passes */
  hapi_histogram pass_ns;
  hapi_thread thread;
  _Atomic int stop;
  int64_t start_ns;
  hapi_tape *tape; /* of a recording or a replay; NULL: none */
};

/* ---- a pass ---- */

bool hapi_contact_has_news(hapi_contact *contact)
{
  HAPI_ASSERT(hapi_thread_is_mine(&contact->thread));
  hapi_places *places = &contact->places;
  hapi_poses *poses = hapi_exchange_poses_take(contact->config.exchange);
  places->poses = poses != NULL ? poses : places->poses;
  return places->poses != NULL && places->poses->model_number != 0 &&
         (places->near == NULL || places->poses->model_number > places->near->model_number);
}

/* Without the keys, which are counted through all runs of a session. */
static uint64_t patches_hash(hapi_patches *patches)
{
  const hapi_patch_contact *c = hapi_patches_contacts(patches);
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, patches->model_number);
  for (uint32_t i = 0; i < patches->contact_count; ++i) {
    hash = hapi_hash_word(hash, ((uint64_t)c[i].body_a << 32) | c[i].body_b);
    hash = hapi_hash_doubles(hash, c[i].core_a, 3);
    hash = hapi_hash_doubles(hash, c[i].core_b, 3);
    hash = hapi_hash_doubles(hash, c[i].normal, 3);
  }
  const hapi_tool_point *tools = hapi_patches_tools(patches);
  for (uint32_t i = 0; i < patches->tool_count; ++i) {
    hash = hapi_hash_word(hash, ((uint64_t)tools[i].pointer << 32) | tools[i].at.body_b);
    hash = hapi_hash_doubles(hash, tools[i].at.core_a, 3);
    hash = hapi_hash_doubles(hash, tools[i].at.core_b, 3);
    hash = hapi_hash_doubles(hash, tools[i].at.normal, 3);
  }
  return hash;
}

/* The pass's part of a recording: what it was made from, and a hash of what it found. */
static void tape_follow(hapi_contact *contact, hapi_patches *out)
{
  const hapi_exchange *exchange = contact->config.exchange;
  if (hapi_tape_records(contact->tape)) {
    hapi_tape_open(contact->tape);
    hapi_cell *cell = hapi_tape_put(contact->tape, HAPI_CELL_PASS, 0);
    cell->u[HAPI_PASS_NUMBER] = out->number;
    cell->u[HAPI_PASS_POSES] = hapi_exchange_taken(exchange, HAPI_CHANNEL_POSES);
    cell->u[HAPI_PASS_NEAR] = hapi_exchange_taken(exchange, HAPI_CHANNEL_NEAR);
    cell->i[HAPI_PASS_VALID] = out->valid_from_ns;
    cell->u[HAPI_PASS_HASH] = patches_hash(out);
    hapi_verdicts_put(&contact->asking.verdicts, contact->tape, cell);
    hapi_tape_commit(contact->tape);
  } else if (hapi_tape_plays(contact->tape)) {
    const hapi_cell *cell = contact->asking.played;
    const hapi_difference difference = {.what = HAPI_DIFFERS_PASS, .number = out->number};
    if (cell->u[HAPI_PASS_HASH] != patches_hash(out)) {
      hapi_tape_differ(contact->tape, &difference);
    }
  }
}

/* What was found last is taken back where there is nothing any more; points of hulls go slowly. */
static bool work_is_left(const hapi_contact *contact)
{
  const hapi_near *near = contact->places.near;
  return near != NULL && contact->places.poses != NULL &&
         (near->pair_count + near->tool_pair_count > 0 || contact->lingers > 0 ||
          near->always != 0);
}

static void pass_make(hapi_contact *contact, int64_t valid_from_ns)
{
  hapi_places *places = &contact->places;
  hapi_patches *out = hapi_exchange_patches_back(contact->config.exchange);
  hapi_asking_begin(&contact->asking, contact->tape, contact->config.capacity.contacts);
  places->seconds = hapi_contact_period(contact) + AGE_TICKS / contact->config.haptic_hz;
  hapi_places_set_bodies(places);
  hapi_pairs_find(contact->pairs, out);
  hapi_asking_run(&contact->asking, places->near, contact->tape, out);
  hapi_tools_find(contact->tools, out);
  out->number = ++contact->number;
  bool found = out->contact_count + out->tool_count > 0;
  contact->lingers = found ? LINGER_PASSES : contact->lingers - (contact->lingers > 0);
  out->model_number = places->near->model_number;
  out->tick = places->poses->tick;
  out->valid_from_ns = valid_from_ns;
  tape_follow(contact, out);
  hapi_exchange_patches_publish(contact->config.exchange);
}

void hapi_contact_pass(hapi_contact *contact, int64_t valid_from_ns)
{
  int64_t begin_ns = hapi_clock_now();
  bool news = hapi_contact_has_news(contact);
  /* Pairs that the loop is not ready for stay in the mailbox: those that it goes on with would lose
   * their contacts. */
  if (news) {
    hapi_near *near = hapi_exchange_near_take(contact->config.exchange);
    if (near != NULL) {
      hapi_places_take_near(&contact->places, near);
      hapi_pairs_take_near(contact->pairs);
    }
  }
  news = news || hapi_tape_plays(contact->tape);
  if (!work_is_left(contact) || (!news && contact->places.near->between == 0)) {
    return;
  }
  unsigned before = hapi_denormals_flush();
  pass_make(contact, valid_from_ns);
  hapi_denormals_restore(before);
  hapi_histogram_add(&contact->pass_ns, hapi_clock_now() - begin_ns);
}

/* ---- the thread ---- */

hap_status hapi_contact_create(const hapi_contact_config *config, hapi_contact **out)
{
  *out = NULL;
  hapi_contact *contact = hapi_alloc(sizeof *contact);
  if (contact == NULL) {
    return HAP_ERROR_MEMORY;
  }
  contact->config = *config;
  contact->asking.ask = config->ask;
  contact->asking.of = config->ask_of;
  if (!hapi_places_create(&contact->places, &config->capacity) ||
      !hapi_pairs_create(&contact->places, &contact->asking, &config->capacity, &contact->left_out,
                         &contact->pairs) ||
      !hapi_tools_create(&contact->places, config->capacity.tool_points, &contact->left_out,
                         &contact->tools) ||
      (config->ask != NULL && !hapi_asking_create(&contact->asking, config->capacity.contacts))) {
    hapi_contact_destroy(contact);
    return HAP_ERROR_MEMORY;
  }
  *out = contact;
  return HAP_OK;
}

void hapi_contact_destroy(hapi_contact *contact)
{
  if (contact == NULL) {
    return;
  }
  hapi_contact_stop_thread(contact);
  hapi_pairs_destroy(contact->pairs);
  hapi_tools_destroy(contact->tools);
  hapi_places_finish(&contact->places);
  hapi_asking_finish(&contact->asking);
  hapi_free(contact);
}

void hapi_contact_set_tape(hapi_contact *contact, hapi_tape *tape)
{
  contact->tape = tape;
}

void hapi_contact_begin(hapi_contact *contact, int64_t start_ns)
{
  hapi_places_begin(&contact->places);
  hapi_pairs_begin(contact->pairs);
  contact->number = 0;
  contact->lingers = 0;
  atomic_store(&contact->left_out, 0);
  contact->start_ns = start_ns;
  hapi_histogram_reset(&contact->pass_ns);
}

double hapi_contact_period(const hapi_contact *contact)
{
  return 1.0 / (contact->places.near != NULL ? contact->places.near->contact_hz : CONTACT_HZ);
}

/* Between two passes the thread looks once a millisecond whether there is a body that waits for its
 * first contacts. Where nothing can touch anything it sleeps until physics says otherwise. */
static void *contact_main(void *arg)
{
  const int64_t look_ns = 1000000;
  hapi_contact *contact = arg;
  hapi_thread_claim(&contact->thread);
  int64_t due = contact->start_ns;
  while (atomic_load_explicit(&contact->stop, memory_order_acquire) == 0) {
    int64_t now = hapi_clock_now();
    int64_t period = (int64_t)llround(1e9 * hapi_contact_period(contact));
    int64_t pause = period < look_ns ? period : look_ns;
    if (now >= due || hapi_contact_has_news(contact)) {
      hapi_contact_pass(contact, 0); /* due at once */
      due =
          now >= due ? due + ((now - due) / period + 1) * period : due; /* late ones are left out */
    }
    if (work_is_left(contact)) {
      hapi_clock_sleep_until(now + pause < due ? now + pause : due);
    } else {
      hapi_clock_sleep_until(now + pause);
      hapi_exchange_near_wait(contact->config.exchange);
    }
  }
  return NULL;
}

hap_status hapi_contact_start_thread(hapi_contact *contact)
{
  atomic_store(&contact->stop, 0);
  return hapi_thread_start(&contact->thread, contact_main, contact, "hapode-contact",
                           3 * contact->config.rt_priority / 4);
}

void hapi_contact_stop_thread(hapi_contact *contact)
{
  atomic_store(&contact->stop, 1);
  hapi_exchange_near_ring(contact->config.exchange);
  hapi_thread_join(&contact->thread);
}

void hapi_contact_effects(const hapi_contact *contact, hap_effect_info *out)
{
  double mean = 1e-3 * hapi_histogram_mean_ns(&contact->pass_ns);
  out[HAP_EFFECT_CONTACTS].contact_us = out[HAP_EFFECT_PASSES].contact_us = mean;
}

void hapi_contact_stats(const hapi_contact *contact, hap_stats *out)
{
  out->model.capacity_dropped += atomic_load_explicit(&contact->left_out, memory_order_relaxed);
  out->contact.us_mean = 1e-3 * hapi_histogram_mean_ns(&contact->pass_ns);
  out->contact.us_max = 1e-3 * (double)hapi_histogram_max_ns(&contact->pass_ns);
}
