/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/own_list.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"

#define WAVES_MOST 64u /* of a pointer, with those that the loop has not yet let go */

struct hapi_own_wave {
  hapi_own_wave *next;
  uint64_t gone; /* number of the first message without it; 0: it is wanted */
  float samples[];
};

void hapi_own_list_finish(hapi_own_list *list)
{
  while (list->waves != NULL) {
    hapi_own_wave *wave = list->waves;
    list->waves = wave->next;
    hapi_free(wave);
  }
}

void hapi_own_list_begin(hapi_own_list *list)
{
  hapi_own_list_finish(list);
  memset(list, 0, sizeof *list);
  hapi_triple_init(&list->buffer);
}

/* Frees what the loop has let go; how many are left. */
static uint32_t waves_sweep(hapi_own_list *list)
{
  uint64_t taken = atomic_load_explicit(&list->taken, memory_order_acquire);
  uint32_t count = 0;
  for (hapi_own_wave **at = &list->waves; *at != NULL;) {
    hapi_own_wave *wave = *at;
    if (wave->gone != 0 && wave->gone <= taken) {
      *at = wave->next;
      hapi_free(wave);
    } else {
      at = &wave->next;
      ++count;
    }
  }
  return count;
}

float *hapi_own_list_room(hapi_own_list *list, uint32_t count)
{
  hapi_own_wave *wave = NULL;
  if (waves_sweep(list) < WAVES_MOST) {
    wave = hapi_alloc(sizeof *wave + count * sizeof wave->samples[0]);
  }
  if (wave == NULL) {
    return NULL;
  }
  wave->next = list->waves;
  wave->gone = 0;
  list->waves = wave;
  return wave->samples;
}

void hapi_own_list_give_back(hapi_own_list *list, const float *samples)
{
  hapi_own_wave **at = &list->waves;
  while (*at != NULL && (*at)->samples != samples) {
    at = &(*at)->next;
  }
  if (*at != NULL) {
    hapi_own_wave *wave = *at;
    *at = wave->next;
    hapi_free(wave);
  }
}

/* From the next message on these samples are not wanted. */
static void wave_leave(hapi_own_list *list, const float *samples)
{
  for (hapi_own_wave *wave = list->waves; wave != NULL; wave = wave->next) {
    if (wave->samples == samples) {
      wave->gone = list->wanted.number + 1;
    }
  }
}

static void list_publish(hapi_own_list *list)
{
  ++list->wanted.number;
  list->messages[hapi_triple_back(&list->buffer)] = list->wanted;
  hapi_triple_publish(&list->buffer);
}

uint32_t hapi_own_list_place(const hapi_own_list *list, hap_force_id force)
{
  uint32_t place = (uint32_t)(force.v & 0xffu) - 1;
  bool known = place < HAP_FORCES_MAX && force.v >> 8 != 0 &&
               list->wanted.setups[place].serial == force.v >> 8;
  return known ? place : HAP_FORCES_MAX;
}

bool hapi_own_list_calls(const hapi_own_list *list, hap_force_id force)
{
  uint32_t place = hapi_own_list_place(list, force);
  return place < HAP_FORCES_MAX && list->wanted.calls[place].call != NULL;
}

static uint32_t free_place(const hapi_own_list *list)
{
  uint32_t place = 0;
  while (place < HAP_FORCES_MAX && list->wanted.setups[place].serial != 0) {
    ++place;
  }
  return place;
}

hap_status hapi_own_list_put(hapi_own_list *list, hap_force_id *io, const hapi_force_setup *setup,
                             const hapi_own_extra *extra)
{
  bool adds = io->v == 0;
  uint32_t place = adds ? free_place(list) : hapi_own_list_place(list, *io);
  float *copy = NULL;
  if (place == HAP_FORCES_MAX) {
    return adds ? HAP_ERROR_CAPACITY : HAP_ERROR_NOT_FOUND;
  }
  if (setup->wave.sample_count > 0) {
    copy = hapi_own_list_room(list, setup->wave.sample_count);
    if (copy == NULL) {
      return HAP_ERROR_MEMORY;
    }
    memcpy(copy, extra->samples, setup->wave.sample_count * sizeof copy[0]);
  }
  if (list->wanted.samples[place] != NULL) {
    wave_leave(list, list->wanted.samples[place]);
  }
  hapi_force_setup *wanted = &list->wanted.setups[place];
  uint32_t serial = adds ? ++list->serials : wanted->serial;
  *wanted = *setup;
  wanted->serial = serial;
  wanted->number = ++list->numbers;
  list->wanted.samples[place] = copy;
  list->wanted.calls[place] = extra->call;
  io->v = hapi_own_force_id(serial, place);
  list_publish(list);
  return HAP_OK;
}

hap_status hapi_own_list_remove(hapi_own_list *list, hap_force_id force)
{
  uint32_t place = hapi_own_list_place(list, force);
  if (place == HAP_FORCES_MAX) {
    return HAP_ERROR_NOT_FOUND;
  }
  if (list->wanted.samples[place] != NULL) {
    wave_leave(list, list->wanted.samples[place]);
  }
  memset(&list->wanted.setups[place], 0, sizeof list->wanted.setups[place]);
  list->wanted.samples[place] = NULL;
  list->wanted.calls[place] = (hapi_own_call){.call = NULL};
  list_publish(list);
  (void)waves_sweep(list);
  return HAP_OK;
}

/* ---- the loop's side of a function ---- */

void hapi_own_caller_begin(hapi_own_caller *caller, const hapi_own_call *call, uint32_t number)
{
  caller->of = *call;
  caller->strikes = 0.0;
  atomic_store(&caller->out, HAP_FORCE_IN);
  atomic_store(&caller->calls, 0);
  atomic_store(&caller->late, 0);
  atomic_store(&caller->spent_ns, 0);
  atomic_store(&caller->most_ns, 0);
  atomic_store(&caller->number, number);
}

void hapi_own_caller_tell(const hapi_own_caller *caller, hap_force_state *out)
{
  uint64_t calls = atomic_load(&caller->calls);
  *out = (hap_force_state){.size = sizeof *out,
                           .out = atomic_load(&caller->out),
                           .calls = calls,
                           .late_calls = atomic_load(&caller->late),
                           .us_max = 1e-3 * (double)atomic_load(&caller->most_ns)};
  if (calls > 0) {
    out->us_mean = 1e-3 * (double)atomic_load(&caller->spent_ns) / (double)calls;
  }
}

void hapi_own_call_note(hapi_own_caller *caller, int64_t spent_ns)
{
  bool late = spent_ns > caller->of.most_ns;
  int64_t most_ns = atomic_load_explicit(&caller->most_ns, memory_order_relaxed);
  atomic_fetch_add_explicit(&caller->calls, 1, memory_order_relaxed);
  atomic_fetch_add_explicit(&caller->late, late, memory_order_relaxed);
  atomic_fetch_add_explicit(&caller->spent_ns, spent_ns, memory_order_relaxed);
  atomic_store_explicit(&caller->most_ns, spent_ns > most_ns ? spent_ns : most_ns,
                        memory_order_relaxed);
}
