/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "sync/exchange.h"

#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "sync/message_queue.h"
#include "sync/triple_buffer.h"

typedef struct channel {
  hapi_triple_buffer buffer;
  size_t size; /* of one message */
  void *places[3];
  uint64_t numbers[3];       /* of the messages in the places; with the place they change hands */
  uint64_t published;        /* of the writer */
  hapi_message_queue *queue; /* replay; NULL: none */
} channel;

struct hapi_exchange {
  channel channels[HAPI_CHANNELS];
  hapi_capacity capacity;
  hapi_trail trail;
  hapi_path path;
  size_t size;
  sem_t near_bell; /* rung when there is something to find again */
  _Atomic int near_is_empty;
};

/* Blocks start on cache lines of their own. */
static size_t round_up(size_t size)
{
  return (size + 63u) & ~(size_t)63u;
}

/* Offset of an array of a message; moves *at behind it. */
static uint32_t place_array(size_t *at, size_t count, size_t size)
{
  HAPI_ASSERT(round_up(*at) <= UINT32_MAX);
  size_t offset = round_up(*at);
  *at = offset + count * size;
  return (uint32_t)offset;
}

static size_t lay_out_model(hapi_model *m, const hapi_capacity *c)
{
  size_t at = sizeof *m;
  m->bodies_offset = place_array(&at, c->bodies, sizeof(hapi_model_body));
  m->contacts_offset = place_array(&at, c->contacts, sizeof(hapi_model_contact));
  m->joints_offset = place_array(&at, c->joints, sizeof(hapi_model_joint));
  m->tools_offset = place_array(&at, c->tool_points, sizeof(hapi_tool_point));
  m->crosses_offset = place_array(&at, c->crosses, sizeof(hapi_model_cross));
  return at;
}

static size_t lay_out_state(hapi_state *s, const hapi_capacity *c)
{
  size_t at = sizeof *s;
  s->bodies_offset = place_array(&at, c->bodies, sizeof(hapi_state_body));
  s->contacts_offset = place_array(&at, c->contacts, sizeof(hapi_state_contact));
  s->pointers_offset = place_array(&at, c->pointers, sizeof(hapi_state_pointer));
  s->hulls_offset = place_array(&at, c->pointers, sizeof(hapi_tool_hull));
  s->pointer_count = c->pointers;
  s->spring_capacity = c->path_rows > 0 ? c->contacts + 2 * c->tool_points : 0;
  s->springs_offset = place_array(&at, s->spring_capacity, sizeof(hapi_state_spring));
  return at;
}

static size_t lay_out_near(hapi_near *n, const hapi_capacity *c)
{
  size_t at = sizeof *n;
  n->bodies_offset = place_array(&at, c->bodies, sizeof(hapi_near_body));
  n->geoms_offset = place_array(&at, c->geoms, sizeof(hapi_near_geom));
  n->pairs_offset = place_array(&at, c->contacts, sizeof(hapi_near_pair));
  n->points_offset = place_array(&at, c->hull_points, 3 * sizeof(double));
  n->tools_offset = place_array(&at, c->pointers, sizeof(hapi_near_tool));
  n->tool_pairs_offset = place_array(&at, c->contacts, sizeof(hapi_near_tool_pair));
  return at;
}

static size_t lay_out_poses(hapi_poses *p, const hapi_capacity *c)
{
  size_t at = sizeof *p;
  p->bodies_offset = place_array(&at, c->bodies, sizeof(hapi_poses_body));
  p->pointers_offset = place_array(&at, c->pointers, sizeof(hapi_poses_pointer));
  return at;
}

static size_t lay_out_patches(hapi_patches *p, const hapi_capacity *c)
{
  size_t at = sizeof *p;
  p->contacts_offset = place_array(&at, c->contacts, sizeof(hapi_patch_contact));
  p->surfaces_offset = place_array(&at, c->contacts, sizeof(hapi_surface));
  p->tools_offset = place_array(&at, c->tool_points, sizeof(hapi_tool_point));
  return at;
}

/* Writes the offsets of a message, and gives back its size. */
static size_t lay_out(hapi_channel name, void *message, const hapi_capacity *c)
{
  switch (name) {
    case HAPI_CHANNEL_MODEL:
      return lay_out_model(message, c);
    case HAPI_CHANNEL_STATE:
      return lay_out_state(message, c);
    case HAPI_CHANNEL_NEAR:
      return lay_out_near(message, c);
    case HAPI_CHANNEL_POSES:
      return lay_out_poses(message, c);
    case HAPI_CHANNEL_PATCHES:
      return lay_out_patches(message, c);
    case HAPI_CHANNELS:
      break;
  }
  return 0;
}

static void slots_measure(const hapi_capacity *capacity, size_t sizes[HAPI_CHANNELS])
{
  union {
    hapi_model model;
    hapi_state state;
    hapi_near near;
    hapi_poses poses;
    hapi_patches patches;
  } scratch;
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    sizes[i] = round_up(lay_out((hapi_channel)i, &scratch, capacity));
  }
}

hap_status hapi_exchange_create(const hapi_capacity *capacity, hapi_exchange **out)
{
  size_t sizes[HAPI_CHANNELS];
  size_t size = round_up(sizeof(hapi_exchange));
  slots_measure(capacity, sizes);
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    size += 3 * sizes[i];
  }
  *out = NULL;
  char *memory = hapi_alloc(size);
  if (memory == NULL) {
    return HAP_ERROR_MEMORY;
  }
  hapi_exchange *e = (hapi_exchange *)(void *)memory;
  e->capacity = *capacity;
  e->size = size;
  sem_init(&e->near_bell, 0, 0);
  char *at = memory + round_up(sizeof(hapi_exchange));
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    e->channels[i].size = sizes[i];
    for (int k = 0; k < 3; ++k) {
      e->channels[i].places[k] = at;
      at += sizes[i];
    }
  }
  e->trail.rows = capacity->trail_rows;
  e->trail.stride = capacity->trail_stride;
  e->trail.bodies = capacity->bodies;
  e->trail.pointers = capacity->pointers;
  e->path.rows = capacity->path_rows;
  e->path.pointers = capacity->pointers;
  if (hapi_trail_create(&e->trail) < HAP_OK || hapi_path_create(&e->path) < HAP_OK) {
    hapi_exchange_destroy(e);
    return HAP_ERROR_MEMORY;
  }
  hapi_exchange_reset(e);
  *out = e;
  return HAP_OK;
}

void hapi_exchange_destroy(hapi_exchange *exchange)
{
  for (int i = 0; exchange != NULL && i < HAPI_CHANNELS; ++i) {
    hapi_message_queue_destroy(exchange->channels[i].queue);
  }
  if (exchange != NULL) {
    hapi_trail_finish(&exchange->trail);
    hapi_path_finish(&exchange->path);
    sem_destroy(&exchange->near_bell);
  }
  hapi_free(exchange);
}

void hapi_exchange_reset(hapi_exchange *exchange)
{
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    channel *c = &exchange->channels[i];
    hapi_triple_init(&c->buffer);
    c->published = 0;
    for (int k = 0; k < 3; ++k) {
      c->numbers[k] = 0;
      memset(c->places[k], 0, c->size);
      lay_out((hapi_channel)i, c->places[k], &exchange->capacity);
    }
  }
  atomic_store(&exchange->near_is_empty, 1);
  hapi_trail_reset(&exchange->trail);
  hapi_path_reset(&exchange->path);
}

static void *channel_back(hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  channel *c = &exchange->channels[name];
  return c->places[hapi_triple_back(&c->buffer)];
}

/* Replay: the writer's place is always the same, and what is in it is copied. */
static void channel_publish(hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  channel *c = &exchange->channels[name];
  unsigned place = hapi_triple_back(&c->buffer);
  c->numbers[place] = ++c->published;
  if (c->queue != NULL) {
    hapi_message_queue_put(c->queue, c->published, c->places[place]);
    return;
  }
  hapi_triple_publish(&c->buffer);
}

static void *channel_take(hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  channel *c = &exchange->channels[name];
  if (c->queue != NULL) {
    return hapi_message_queue_take(c->queue);
  }
  return hapi_triple_take(&c->buffer) ? c->places[hapi_triple_front(&c->buffer)] : NULL;
}

uint64_t hapi_exchange_taken(const hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  const channel *c = &exchange->channels[name];
  return c->queue != NULL ? hapi_message_queue_held(c->queue)
                          : c->numbers[hapi_triple_front(&c->buffer)];
}

uint64_t hapi_exchange_published(const hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  return exchange->channels[name].published;
}

hap_status hapi_exchange_play(hapi_exchange *exchange)
{
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    channel *c = &exchange->channels[i];
    if (c->queue == NULL && hapi_message_queue_create(c->size, &c->queue) < HAP_OK) {
      return HAP_ERROR_MEMORY;
    }
  }
  return HAP_OK;
}

void hapi_exchange_expect(hapi_exchange *exchange, hapi_channel name, uint64_t number)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  HAPI_ASSERT(exchange->channels[name].queue != NULL);
  hapi_message_queue_expect(exchange->channels[name].queue, number);
}

void hapi_exchange_forget(hapi_exchange *exchange, hapi_channel name, uint64_t number)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  HAPI_ASSERT(exchange->channels[name].queue != NULL);
  hapi_message_queue_forget(exchange->channels[name].queue, number);
}

hap_status hapi_exchange_play_status(const hapi_exchange *exchange)
{
  hap_status status = HAP_OK;
  for (int i = 0; i < HAPI_CHANNELS && status == HAP_OK; ++i) {
    const hapi_message_queue *queue = exchange->channels[i].queue;
    status = queue != NULL ? hapi_message_queue_status(queue) : HAP_OK;
  }
  return status;
}

/* ---- whether the arrays of a message hold what it counts: for asserts ---- */

static bool model_fits(const hapi_model *m, const hapi_capacity *c)
{
  return m->body_count <= c->bodies && m->contact_count <= c->contacts &&
         m->joint_count <= c->joints && m->tool_count <= c->tool_points &&
         m->cross_count <= c->crosses && m->watch_count <= HAP_TRACE_BODIES_MAX;
}

static bool state_fits(const hapi_state *s, const hapi_capacity *c)
{
  return s->body_high <= c->bodies && s->contact_count <= c->contacts &&
         s->pointer_count == c->pointers && s->spring_count <= s->spring_capacity;
}

static bool near_fits(const hapi_near *n, const hapi_capacity *c)
{
  return n->body_count <= c->bodies && n->geom_count <= c->geoms && n->pair_count <= c->contacts &&
         n->point_count <= c->hull_points && n->tool_count <= c->pointers &&
         n->tool_pair_count <= c->contacts;
}

static bool poses_fit(const hapi_poses *p, const hapi_capacity *c)
{
  return p->body_count <= c->bodies;
}

static bool patches_fit(const hapi_patches *p, const hapi_capacity *c)
{
  return p->contact_count <= c->contacts && p->surface_count <= c->contacts &&
         p->tool_count <= c->tool_points;
}

/* ---- the mailboxes ---- */

hapi_model *hapi_exchange_model_back(hapi_exchange *exchange)
{
  return channel_back(exchange, HAPI_CHANNEL_MODEL);
}

void hapi_exchange_model_publish(hapi_exchange *exchange)
{
  HAPI_ASSERT(model_fits(channel_back(exchange, HAPI_CHANNEL_MODEL), &exchange->capacity));
  channel_publish(exchange, HAPI_CHANNEL_MODEL);
}

hapi_model *hapi_exchange_model_take(hapi_exchange *exchange)
{
  return channel_take(exchange, HAPI_CHANNEL_MODEL);
}

hapi_state *hapi_exchange_state_back(hapi_exchange *exchange)
{
  return channel_back(exchange, HAPI_CHANNEL_STATE);
}

void hapi_exchange_state_publish(hapi_exchange *exchange)
{
  HAPI_ASSERT(state_fits(channel_back(exchange, HAPI_CHANNEL_STATE), &exchange->capacity));
  channel_publish(exchange, HAPI_CHANNEL_STATE);
}

hapi_state *hapi_exchange_state_take(hapi_exchange *exchange)
{
  return channel_take(exchange, HAPI_CHANNEL_STATE);
}

hapi_near *hapi_exchange_near_back(hapi_exchange *exchange)
{
  return channel_back(exchange, HAPI_CHANNEL_NEAR);
}

/* Only physics writes near_is_empty, and the contact thread waits only while it is set. So no post
 * is lost, and a superfluous one costs one check. */
void hapi_exchange_near_publish(hapi_exchange *exchange)
{
  const hapi_near *near = channel_back(exchange, HAPI_CHANNEL_NEAR);
  HAPI_ASSERT(near_fits(near, &exchange->capacity));
  int empty = near->pair_count + near->tool_pair_count == 0 && near->always == 0;
  channel_publish(exchange, HAPI_CHANNEL_NEAR);
  if (atomic_exchange(&exchange->near_is_empty, empty) != 0 && empty == 0) {
    sem_post(&exchange->near_bell);
  }
}

void hapi_exchange_near_wait(hapi_exchange *exchange)
{
  if (atomic_load(&exchange->near_is_empty) != 0) {
    (void)sem_wait(&exchange->near_bell); /* a signal may end it early */
  }
}

void hapi_exchange_near_ring(hapi_exchange *exchange)
{
  sem_post(&exchange->near_bell);
}

hapi_near *hapi_exchange_near_take(hapi_exchange *exchange)
{
  return channel_take(exchange, HAPI_CHANNEL_NEAR);
}

hapi_poses *hapi_exchange_poses_back(hapi_exchange *exchange)
{
  return channel_back(exchange, HAPI_CHANNEL_POSES);
}

void hapi_exchange_poses_publish(hapi_exchange *exchange)
{
  HAPI_ASSERT(poses_fit(channel_back(exchange, HAPI_CHANNEL_POSES), &exchange->capacity));
  channel_publish(exchange, HAPI_CHANNEL_POSES);
}

hapi_poses *hapi_exchange_poses_take(hapi_exchange *exchange)
{
  return channel_take(exchange, HAPI_CHANNEL_POSES);
}

hapi_patches *hapi_exchange_patches_back(hapi_exchange *exchange)
{
  return channel_back(exchange, HAPI_CHANNEL_PATCHES);
}

void hapi_exchange_patches_publish(hapi_exchange *exchange)
{
  HAPI_ASSERT(patches_fit(channel_back(exchange, HAPI_CHANNEL_PATCHES), &exchange->capacity));
  channel_publish(exchange, HAPI_CHANNEL_PATCHES);
}

hapi_patches *hapi_exchange_patches_take(hapi_exchange *exchange)
{
  return channel_take(exchange, HAPI_CHANNEL_PATCHES);
}

hapi_path *hapi_exchange_path(hapi_exchange *exchange)
{
  return &exchange->path;
}

hapi_trail *hapi_exchange_trail(hapi_exchange *exchange)
{
  return &exchange->trail;
}

void *hapi_exchange_memory(hapi_exchange *exchange, size_t *out_size)
{
  *out_size = exchange->size;
  return exchange;
}
