/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/touch_feel.h"

#include <string.h>

#include "base/wishes.h"

#define NO_PAIR 0xffffffffu

/* ---- a model comes ---- */

static uint32_t pair_find(const hapi_pair_feel *pairs, uint32_t count, uint32_t number)
{
  for (uint32_t i = 0; i < count; ++i) {
    if (pairs[i].in.number == number) {
      return i;
    }
  }
  return NO_PAIR;
}

void hapi_feels_adopt(hapi_touches *touches, hapi_model *model)
{
  const hapi_model_feel *in = hapi_model_feels(model);
  uint32_t old_count = touches->feel_count;
  if (old_count > 0) {
    memcpy(touches->old_feels, touches->feels, old_count * sizeof *touches->feels);
  }
  touches->feel_count = model->feel_count;
  for (uint32_t i = 0; i < model->feel_count; ++i) {
    hapi_pair_feel *out = &touches->feels[i];
    uint32_t old = pair_find(touches->old_feels, old_count, in[i].number);
    *out = old != NO_PAIR ? touches->old_feels[old] : (hapi_pair_feel){.stiffness = HAPI_FEEL_SAID};
    out->in = in[i];
  }
}

void hapi_touch_feel_find(const hapi_touches *touches, hapi_local_contact *c)
{
  uint32_t pair = NO_PAIR;
  if (c->feel.number != 0) {
    pair = pair_find(touches->feels, touches->feel_count, c->feel.number);
  }
  c->feel.special = pair != NO_PAIR && touches->feels[pair].in.pointer == c->pointer;
  c->feel.pair = c->feel.special ? pair : 0;
  c->feel.sticks = c->feel.special && c->feel.sticks;
  c->feel.pull = c->feel.sticks ? c->feel.pull : 0.0;
  if (!c->feel.special) {
    memset(&c->feel.lift, 0, sizeof c->feel.lift);
  }
}

void hapi_touch_feel_adopt(hapi_touches *touches, const hapi_feel_told *told, hapi_local_contact *c)
{
  c->feel.number = told->number;
  c->feel.mu = told->mu;
  c->feel.rubs = told->mu > 0.0 || hapi_wish_is_on(told->wishes, HAP_EFFECT_FRICTION);
  hapi_touch_feel_find(touches, c);
  if (c->feel.special) {
    hapi_pair_feel *pair = &touches->feels[c->feel.pair];
    if (told->goes_on && pair->stiffness == HAPI_FEEL_SAID) {
      pair->stiffness = HAPI_FEEL_OWN;
    }
  }
  touches->rubs |= c->feel.rubs;
}
