/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/pointer_id.h"
#include "base/vec.h"
#include "haptic/haptic_internal.h"

#define EVENTS 1024u

/* Touches, contacts and events, from the loop to whoever asks. All memory is there from the start;
 * a tick writes to it only once somebody has asked. */

bool hapi_told_create(hapi_haptic *haptic)
{
  const hapi_capacity *c = &haptic->config.capacity;
  hapi_told_things *told = &haptic->told;
  pthread_mutex_init(&told->lock, NULL);
  atomic_init(&told->asked, 0u);
  told->telling.events.capacity = EVENTS;
  told->telling.events.rows = hapi_alloc_array(EVENTS, sizeof *told->telling.events.rows);
  told->telling.lists = hapi_alloc_array(c->pointers, sizeof *told->telling.lists);
  told->of_pointers = hapi_alloc_array(c->pointers, sizeof *told->of_pointers);
  told->touches =
      hapi_alloc_array((size_t)3 * HAP_TOUCHES_MAX * c->pointers, sizeof *told->touches);
  told->contacts = hapi_alloc_array((size_t)3 * c->contacts, sizeof *told->contacts);
  hapi_own_hands *hands = &told->hands;
  hands->of = hapi_alloc_array(c->pointers, sizeof *hands->of);
  hands->list = hapi_alloc_array(c->pointers, sizeof(void *));
  hands->touches = hapi_alloc_array((size_t)HAP_TOUCHES_MAX * c->pointers, sizeof(void *));
  return hands->of != NULL && hands->list != NULL && hands->touches != NULL &&
         told->telling.events.rows != NULL && told->telling.lists != NULL &&
         told->of_pointers != NULL && told->touches != NULL && told->contacts != NULL;
}

void hapi_told_destroy(hapi_haptic *haptic)
{
  hapi_told_things *told = &haptic->told;
  hapi_free(told->telling.events.rows);
  hapi_free(told->telling.lists);
  hapi_free(told->of_pointers);
  hapi_free(told->touches);
  hapi_free(told->contacts);
  hapi_free(told->hands.of);
  hapi_free(told->hands.list);
  hapi_free(told->hands.touches);
  pthread_mutex_destroy(&told->lock);
}

static void list_reset(hapi_told_list *list)
{
  memset(list, 0, sizeof *list);
  hapi_triple_init(&list->buffer);
}

void hapi_told_reset(hapi_haptic *haptic)
{
  const hapi_capacity *c = &haptic->config.capacity;
  hapi_told_things *told = &haptic->told;
  pthread_mutex_lock(&told->lock);
  told->hands.any = false;
  told->hands.out = HAP_FORCE_IN;
  hapi_telling_reset(&told->telling, c->pointers);
  for (uint32_t i = 0; i < c->pointers; ++i) {
    list_reset(&told->of_pointers[i]);
  }
  list_reset(&told->of_bodies);
  memset(told->touches, 0, (size_t)3 * HAP_TOUCHES_MAX * c->pointers * sizeof *told->touches);
  memset(told->contacts, 0, (size_t)3 * c->contacts * sizeof *told->contacts);
  pthread_mutex_unlock(&told->lock);
}

static hap_touch *touches_in(const hapi_told_things *told, uint32_t pointer, unsigned place)
{
  return told->touches + (size_t)(3 * pointer + place) * HAP_TOUCHES_MAX;
}

static void touches_publish(hapi_haptic *haptic, hapi_told_things *told)
{
  for (uint32_t i = 0; i < haptic->tick.pointers.high; ++i) {
    hapi_told_list *list = &told->of_pointers[i];
    unsigned place = hapi_triple_back(&list->buffer);
    list->generations[place] = told->telling.lists[i].generation & HAPI_GENERATION_MASK;
    list->counts[place] = hapi_telling_touches(&told->telling, i, touches_in(told, i, place));
    hapi_triple_publish(&list->buffer);
  }
}

static void contacts_publish(hapi_haptic *haptic, hapi_told_things *told)
{
  uint32_t capacity = haptic->config.capacity.contacts;
  unsigned place = hapi_triple_back(&told->of_bodies.buffer);
  told->of_bodies.counts[place] =
      hapi_telling_contacts(&haptic->tick, told->contacts + (size_t)place * capacity, capacity);
  hapi_triple_publish(&told->of_bodies.buffer);
}

void hapi_told_publish(hapi_haptic *haptic, uint32_t asked)
{
  hapi_told_things *told = &haptic->told;
  if ((asked & (HAPI_ASKED_TOUCHES | HAPI_ASKED_EVENTS)) != 0) {
    hapi_telling_follow(&told->telling, &haptic->tick, (asked & HAPI_ASKED_EVENTS) != 0);
  }
  if ((asked & HAPI_ASKED_TOUCHES) != 0) {
    touches_publish(haptic, told);
  }
  if ((asked & HAPI_ASKED_CONTACTS) != 0) {
    contacts_publish(haptic, told);
  }
}

/* ---- the application's side ---- */

/* Whether it was asked for before. */
static bool told_ask(hapi_told_things *told, uint32_t what)
{
  return (atomic_fetch_or(&told->asked, what) & what) != 0;
}

/* Of the rest, the one with the largest force. */
static size_t touches_hardest(const hap_touch *touches, const bool *taken, size_t count)
{
  size_t best = count;
  double most = -1.0;
  for (size_t i = 0; i < count; ++i) {
    double force = hapi_v3_dot(touches[i].force, touches[i].force);
    if (!taken[i] && force > most) {
      best = i;
      most = force;
    }
  }
  return best;
}

static size_t touches_give(const hap_touch *touches, size_t count, void *out, size_t capacity,
                           size_t size_of_touch)
{
  bool taken[HAP_TOUCHES_MAX] = {false};
  size_t size = size_of_touch < sizeof *touches ? size_of_touch : sizeof *touches;
  size_t given = count < capacity ? count : capacity;
  for (size_t i = 0; i < given; ++i) {
    size_t at = touches_hardest(touches, taken, count);
    taken[at] = true;
    memcpy((char *)out + i * size_of_touch, &touches[at], size);
  }
  return given;
}

hap_status hapi_haptic_touches(hapi_haptic *haptic, hap_pointer_id id, hap_touch *touches,
                               size_t capacity, size_t size_of_touch, size_t *out_count)
{
  hapi_told_things *told = &haptic->told;
  *out_count = 0;
  if (!hapi_haptic_has_pointer(haptic, id)) {
    return HAP_ERROR_NOT_FOUND;
  }
  if (!told_ask(told, HAPI_ASKED_TOUCHES)) {
    return HAP_STALE;
  }
  uint32_t index = (uint32_t)(id.v & 0xffffffffu) - 1;
  hapi_told_list *list = &told->of_pointers[index];
  pthread_mutex_lock(&told->lock);
  hapi_triple_take(&list->buffer);
  unsigned place = hapi_triple_front(&list->buffer);
  if (list->generations[place] == (uint32_t)(id.v >> 32)) { /* else no tick has had it */
    *out_count = touches_give(touches_in(told, index, place), list->counts[place], touches,
                              capacity, size_of_touch);
  }
  pthread_mutex_unlock(&told->lock);
  return *out_count > 0 ? HAP_OK : HAP_END;
}

hap_status hapi_haptic_contacts(hapi_haptic *haptic, hap_body_contact *contacts, size_t capacity,
                                size_t size_of_contact, size_t *out_count)
{
  hapi_told_things *told = &haptic->told;
  size_t size = size_of_contact < sizeof *contacts ? size_of_contact : sizeof *contacts;
  *out_count = 0;
  if (!told_ask(told, HAPI_ASKED_CONTACTS)) {
    return HAP_STALE;
  }
  pthread_mutex_lock(&told->lock);
  hapi_triple_take(&told->of_bodies.buffer);
  unsigned place = hapi_triple_front(&told->of_bodies.buffer);
  const hap_body_contact *from = told->contacts + (size_t)place * haptic->config.capacity.contacts;
  while (*out_count < told->of_bodies.counts[place] && *out_count < capacity) {
    memcpy((char *)contacts + *out_count * size_of_contact, &from[*out_count], size);
    ++*out_count;
  }
  pthread_mutex_unlock(&told->lock);
  return *out_count > 0 ? HAP_OK : HAP_END;
}

size_t hapi_haptic_read_events(hapi_haptic *haptic, hap_event *events, size_t capacity,
                               size_t size_of_event)
{
  hapi_told_things *told = &haptic->told;
  told_ask(told, HAPI_ASKED_EVENTS);
  pthread_mutex_lock(&told->lock);
  size_t count = hapi_events_read(&told->telling.events, events, capacity, size_of_event);
  pthread_mutex_unlock(&told->lock);
  return count;
}
