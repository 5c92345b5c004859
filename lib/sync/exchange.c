/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/exchange.h"

#include <string.h>

#include "base/alloc.h"
#include "sync/triple_buffer.h"

struct hapi_exchange {
  hapi_triple_buffer model_buffer;
  hapi_triple_buffer state_buffer;
  hapi_capacity capacity;
  size_t size;
  hapi_model *models[3];
  hapi_state *states[3];
};

/* Blocks start on cache lines of their own. */
static size_t round_up(size_t size)
{
  return (size + 63u) & ~(size_t)63u;
}

static size_t model_size(const hapi_capacity *c)
{
  return round_up(round_up(sizeof(hapi_model)) + c->bodies * sizeof(hapi_model_body) +
                  c->contacts * sizeof(hapi_model_contact));
}

static size_t state_size(const hapi_capacity *c)
{
  return round_up(round_up(sizeof(hapi_state)) + c->bodies * sizeof(hapi_state_body) +
                  c->contacts * sizeof(hapi_state_contact) +
                  c->pointers * sizeof(hapi_state_pointer));
}

static void lay_out_model(hapi_model *m, const hapi_capacity *c)
{
  m->bodies_offset = (uint32_t)round_up(sizeof(hapi_model));
  m->contacts_offset = m->bodies_offset + c->bodies * (uint32_t)sizeof(hapi_model_body);
}

static void lay_out_state(hapi_state *s, const hapi_capacity *c)
{
  s->bodies_offset = (uint32_t)round_up(sizeof(hapi_state));
  s->contacts_offset = s->bodies_offset + c->bodies * (uint32_t)sizeof(hapi_state_body);
  s->pointers_offset = s->contacts_offset + c->contacts * (uint32_t)sizeof(hapi_state_contact);
  s->pointer_count = c->pointers;
}

hap_status hapi_exchange_create(const hapi_capacity *capacity, hapi_exchange **out)
{
  size_t model_bytes = model_size(capacity);
  size_t state_bytes = state_size(capacity);
  size_t size = round_up(sizeof(hapi_exchange)) + 3 * (model_bytes + state_bytes);
  *out = NULL;
  char *memory = hapi_alloc(size);
  if (memory == NULL) {
    return HAP_ERROR_MEMORY;
  }
  hapi_exchange *e = (hapi_exchange *)(void *)memory;
  e->capacity = *capacity;
  e->size = size;
  char *at = memory + round_up(sizeof(hapi_exchange));
  for (int i = 0; i < 3; ++i) {
    e->models[i] = (hapi_model *)(void *)at;
    at += model_bytes;
    e->states[i] = (hapi_state *)(void *)at;
    at += state_bytes;
  }
  hapi_exchange_reset(e);
  *out = e;
  return HAP_OK;
}

void hapi_exchange_destroy(hapi_exchange *exchange)
{
  hapi_free(exchange);
}

void hapi_exchange_reset(hapi_exchange *exchange)
{
  hapi_triple_init(&exchange->model_buffer);
  hapi_triple_init(&exchange->state_buffer);
  for (int i = 0; i < 3; ++i) {
    memset(exchange->models[i], 0, model_size(&exchange->capacity));
    memset(exchange->states[i], 0, state_size(&exchange->capacity));
    lay_out_model(exchange->models[i], &exchange->capacity);
    lay_out_state(exchange->states[i], &exchange->capacity);
  }
}

hapi_model *hapi_exchange_model_back(hapi_exchange *exchange)
{
  return exchange->models[hapi_triple_back(&exchange->model_buffer)];
}

void hapi_exchange_model_publish(hapi_exchange *exchange)
{
  hapi_triple_publish(&exchange->model_buffer);
}

hapi_state *hapi_exchange_state_take(hapi_exchange *exchange)
{
  if (!hapi_triple_take(&exchange->state_buffer)) {
    return NULL;
  }
  return exchange->states[hapi_triple_front(&exchange->state_buffer)];
}

hapi_model *hapi_exchange_model_take(hapi_exchange *exchange)
{
  if (!hapi_triple_take(&exchange->model_buffer)) {
    return NULL;
  }
  return exchange->models[hapi_triple_front(&exchange->model_buffer)];
}

hapi_state *hapi_exchange_state_back(hapi_exchange *exchange)
{
  return exchange->states[hapi_triple_back(&exchange->state_buffer)];
}

void hapi_exchange_state_publish(hapi_exchange *exchange)
{
  hapi_triple_publish(&exchange->state_buffer);
}

void *hapi_exchange_memory(hapi_exchange *exchange, size_t *out_size)
{
  *out_size = exchange->size;
  return exchange;
}
