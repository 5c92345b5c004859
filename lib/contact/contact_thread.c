/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "contact/contact_internal.h"

/* Life of the contact thread, and its pace. */

#define CONTACT_HZ 200.0 /* until the first message says more */

hap_status hapi_contact_create(const hapi_contact_config *config, hapi_contact **out)
{
  *out = NULL;
  hapi_contact *contact = hapi_alloc(sizeof *contact);
  if (contact == NULL) {
    return HAP_ERROR_MEMORY;
  }
  contact->config = *config;
  contact->bodies = hapi_alloc_array(config->capacity.bodies, sizeof *contact->bodies);
  contact->pairs = hapi_alloc_array(config->capacity.contacts, sizeof *contact->pairs);
  if (contact->bodies == NULL || contact->pairs == NULL) {
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
  hapi_free(contact->bodies);
  hapi_free(contact->pairs);
  hapi_free(contact);
}

void hapi_contact_set_tape(hapi_contact *contact, hapi_tape *tape)
{
  contact->tape = tape;
}

void hapi_contact_begin(hapi_contact *contact, int64_t start_ns)
{
  contact->near = NULL;
  contact->poses = NULL;
  contact->number = 0;
  contact->lingers = 0;
  atomic_store(&contact->left_out, 0);
  contact->start_ns = start_ns;
  hapi_histogram_reset(&contact->pass_ns);
}

double hapi_contact_period(const hapi_contact *contact)
{
  return 1.0 / (contact->near != NULL ? contact->near->contact_hz : CONTACT_HZ);
}

/* Between two passes the thread looks once a millisecond whether there is a body that waits for its
 * first contacts. Where nothing can touch anything it sleeps until physics says otherwise. */
static void *contact_main(void *arg)
{
  const int64_t look_ns = 1000000;
  hapi_contact *contact = arg;
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
    if (hapi_contact_has_work(contact)) {
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
