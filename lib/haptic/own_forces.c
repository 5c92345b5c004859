/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/own_forces.h"

#include <string.h>

#include "haptic/own_tape.h"
#include "tick/own_forces.h"

/* Own forces, from the lists of the application, or from the tape, to the tick. */

static hapi_own_force *own_of(hapi_haptic *haptic, uint32_t index)
{
  return &haptic->tick.own[(size_t)index * HAP_FORCES_MAX];
}

/* Samples are taken one set a tick: what a tick puts on the tape has a bound. */
static void list_take(hapi_haptic *haptic, uint32_t index, int64_t now_ns, bool *io_samples)
{
  hapi_own_list *list = &haptic->slots[index].own;
  const hapi_own_message *message = &list->messages[hapi_triple_front(&list->buffer)];
  hapi_own_force *own = own_of(haptic, index);
  list->partly = false;
  for (uint32_t k = 0; k < HAP_FORCES_MAX; ++k) {
    const hapi_force_setup *setup = &message->setups[k];
    bool gone = setup->serial == 0 && own[k].setup.serial != 0 && !own[k].leaves;
    bool changed = setup->serial != 0 && setup->number != own[k].setup.number;
    if (!gone && !changed) {
      continue;
    }
    if (setup->wave.sample_count > 0 && *io_samples) {
      list->partly = true;
      continue;
    }
    *io_samples = *io_samples || setup->wave.sample_count > 0;
    hapi_own_force_change(&own[k], setup, message->samples[k], now_ns);
    haptic->told.hands.any = haptic->told.hands.any || message->calls[k].call != NULL;
    hapi_own_caller_begin(&list->callers[k], &message->calls[k], setup->number);
    hapi_tape_own(haptic, index, k, setup, message->samples[k]);
  }
  haptic->tick.pointers.of[index].own = hapi_own_forces_any(own);
  if (!list->partly) {
    atomic_store_explicit(&list->taken, message->number, memory_order_release);
  }
}

/* A replay has the forces of the recording. */
static void own_play(hapi_haptic *haptic, int64_t now_ns)
{
  hapi_force_setup setup;
  const float *samples = NULL;
  uint32_t index = 0;
  uint32_t place = 0;
  while (hapi_tape_next_own(haptic, &index, &place, &setup, &samples)) {
    hapi_own_force *own = &own_of(haptic, index)[place];
    const float *before = own->samples;
    hapi_own_force_change(own, &setup, samples, now_ns);
    haptic->tick.pointers.of[index].own = hapi_own_forces_any(own_of(haptic, index));
    haptic->told.hands.any = haptic->told.hands.any || setup.kind == HAP_FORCE_CALL;
    if (before != NULL) {
      hapi_own_list_give_back(&haptic->slots[index].own, before);
    }
  }
}

void hapi_own_follow(hapi_haptic *haptic, int64_t now_ns)
{
  bool samples = false;
  if (hapi_tape_plays(haptic->tape)) {
    own_play(haptic, now_ns);
    return;
  }
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    hapi_own_list *list = &haptic->slots[i].own;
    if (haptic->tick.pointers.of[i].generation != 0 &&
        (hapi_triple_take(&list->buffer) || list->partly)) {
      list_take(haptic, i, now_ns, &samples);
    }
  }
}

void hapi_own_begin(hapi_haptic *haptic, uint32_t index)
{
  memset(own_of(haptic, index), 0, HAP_FORCES_MAX * sizeof(hapi_own_force));
  memset(haptic->slots[index].own.callers, 0, sizeof haptic->slots[index].own.callers);
  haptic->slots[index].own.partly = true;
}
