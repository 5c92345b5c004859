/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/probe.h"

#include <string.h>

#include "base/alloc.h"

static bool pushed_create(hapi_pushed *pushed, uint32_t capacity)
{
  pushed->slots = hapi_alloc_array(capacity, sizeof *pushed->slots);
  pushed->capacity = capacity;
  return pushed->slots != NULL;
}

bool hapi_probe_create(hapi_probe *probe, const hapi_cycle *cycle, const hapi_world *world,
                       const hapi_slots *slots)
{
  const hapi_capacity *capacity = &cycle->config->capacity;
  hapi_contact_trials *contacts = &probe->contacts;
  hapi_body_trials *bodies = &probe->bodies;
  probe->cycle = cycle;
  probe->world = world;
  probe->slots = slots;
  contacts->list = hapi_alloc_array(capacity->contacts, sizeof *contacts->list);
  contacts->rounds = hapi_alloc_array(capacity->contacts, sizeof *contacts->rounds);
  bodies->base = hapi_alloc_array(capacity->bodies, sizeof *bodies->base);
  return contacts->list != NULL && contacts->rounds != NULL && bodies->base != NULL &&
         pushed_create(&contacts->pushed, capacity->contacts) &&
         pushed_create(&bodies->pushed, capacity->bodies) &&
         hapi_answers_create(&probe->answers, capacity) &&
         hapi_reuse_create(&probe->reuse, capacity);
}

void hapi_probe_finish(hapi_probe *probe)
{
  hapi_test_finish(&probe->test);
  hapi_answers_finish(&probe->answers);
  hapi_reuse_finish(&probe->reuse);
  hapi_free(probe->contacts.pushed.slots);
  hapi_free(probe->contacts.list);
  hapi_free(probe->contacts.rounds);
  hapi_free(probe->bodies.pushed.slots);
  hapi_free(probe->bodies.base);
  memset(probe, 0, sizeof *probe);
}

void hapi_probe_reset(hapi_probe *probe)
{
  hapi_answers_reset(&probe->answers);
  hapi_reuse_reset(&probe->reuse);
  probe->counts = (hapi_probe_counts){0};
  probe->test.steps = 0;
}

void hapi_probe_count(hapi_probe *probe, hapi_admittance kind)
{
  probe->counts.singular += kind == HAPI_ADMITTANCE_SINGULAR;
  probe->counts.clipped += kind == HAPI_ADMITTANCE_CLIPPED;
}

hap_status hapi_probe_add_body(hapi_probe *probe, uint32_t body, bool *out_testable)
{
  HAPI_ASSERT_INDEX(body, probe->slots->body_high);
  hap_status status =
      hapi_test_add_island(&probe->test, probe->slots->bodies[body].known, out_testable);
  if (status >= HAP_OK && !*out_testable) {
    hapi_say_once(probe->cycle, &probe->said_not_probed,
                  "bodies with a transmission joint are not probed: a pointer feels them as moved "
                  "by the application");
    probe->answers.bodies[body].flags = HAPI_BODY_DRIVEN;
  }
  return status;
}
