/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/answers.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

bool hapi_answers_create(hapi_answers *answers, const hapi_capacity *capacity)
{
  answers->bodies = hapi_alloc_array(capacity->bodies, sizeof *answers->bodies);
  answers->contacts = hapi_alloc_array(capacity->contacts, sizeof *answers->contacts);
  answers->body_capacity = capacity->bodies;
  answers->contact_capacity = capacity->contacts;
  return answers->bodies != NULL && answers->contacts != NULL;
}

void hapi_answers_finish(hapi_answers *answers)
{
  hapi_free(answers->bodies);
  hapi_free(answers->contacts);
  memset(answers, 0, sizeof *answers);
}

void hapi_answers_reset(hapi_answers *answers)
{
  memset(answers->bodies, 0, answers->body_capacity * sizeof *answers->bodies);
  memset(answers->contacts, 0, answers->contact_capacity * sizeof *answers->contacts);
}

void hapi_answers_follow(hapi_answers *answers, const hapi_slots *slots)
{
  HAPI_ASSERT(slots->body_high <= answers->body_capacity);
  HAPI_ASSERT(slots->contact_high <= answers->contact_capacity);
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    if (answers->bodies[i].generation != slot->generation) {
      answers->bodies[i] = (hapi_body_answer){.generation = slot->generation};
    }
    answers->bodies[i].flags = slot->flags;
  }
  for (uint32_t i = 0; i < slots->contact_high; ++i) {
    if (answers->contacts[i].generation != slots->contacts[i].generation) {
      answers->contacts[i] = (hapi_contact_answer){.generation = slots->contacts[i].generation};
    }
  }
}

bool hapi_body_is_whole(const hapi_slots *slots, uint32_t body)
{
  uint32_t contacts = 0;
  for (uint32_t i = 0; i < slots->contact_high && contacts < 2; ++i) {
    const hapi_contact_slot *contact = &slots->contacts[i];
    contacts += contact->phase == HAPI_SLOT_LIVE && contact->body == body;
  }
  return slots->bodies[body].linked || slots->bodies[body].held || contacts > 1;
}
