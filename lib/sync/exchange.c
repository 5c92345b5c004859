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
  bool late;       /* pages come with their use */
  sem_t near_bell; /* rung when there is something to find again */
  _Atomic int near_is_empty;
};

/* Blocks start on cache lines of their own. */
static size_t round_up(size_t size)
{
  return (size + 63u) & ~(size_t)63u;
}

/* ---- what is in a message ---- */

/* An array behind a message's head. All but channel and element are offsets of uint32_t members. */
typedef struct message_array {
  hapi_channel channel;
  size_t begins;  /* in the message: where the array lies */
  size_t count;   /* in the message: elements in use */
  size_t element; /* bytes of one */
  size_t most;    /* in hapi_capacity: elements that there is room for */
} message_array;

#define ARRAY(channel, message, begins, count, element, most)                      \
  {                                                                                \
    channel, offsetof(message, begins), offsetof(message, count), sizeof(element), \
        offsetof(hapi_capacity, most)                                              \
  }

static const message_array arrays[] = {
#define MODEL(...) ARRAY(HAPI_CHANNEL_MODEL, hapi_model, __VA_ARGS__)
    MODEL(bodies_offset, body_count, hapi_model_body, bodies),
    MODEL(contacts_offset, contact_count, hapi_model_contact, contacts),
    MODEL(joints_offset, joint_count, hapi_model_joint, joints),
    MODEL(tools_offset, tool_count, hapi_tool_point, tool_points),
    MODEL(crosses_offset, cross_count, hapi_model_cross, crosses),
    MODEL(courses_offset, course_count, hapi_model_course, bodies),
    MODEL(triangles_offset, triangle_count, hapi_triangle, triangles),
    MODEL(feels_offset, feel_count, hapi_model_feel, feels),
    MODEL(hands_offset, hand_count, hapi_model_hand, pointers),
#define STATE(...) ARRAY(HAPI_CHANNEL_STATE, hapi_state, __VA_ARGS__)
    STATE(bodies_offset, body_high, hapi_state_body, bodies),
    STATE(contacts_offset, contact_count, hapi_state_contact, contacts),
    STATE(pointers_offset, pointer_count, hapi_state_pointer, pointers),
    STATE(hulls_offset, pointer_count, hapi_tool_hull, pointers),
    STATE(springs_offset, spring_count, hapi_state_spring, springs),
    STATE(joints_offset, joint_count, hapi_state_joint, joints),
    STATE(sides_offset, side_count, hapi_tool_side, tool_points),
#define NEAR(...) ARRAY(HAPI_CHANNEL_NEAR, hapi_near, __VA_ARGS__)
    NEAR(bodies_offset, body_count, hapi_near_body, bodies),
    NEAR(geoms_offset, geom_count, hapi_near_geom, geoms),
    NEAR(pairs_offset, pair_count, hapi_near_pair, pairs),
    NEAR(saids_offset, said_count, hapi_near_said, saids),
    NEAR(points_offset, point_count, double[3], hull_points),
    NEAR(tools_offset, tool_count, hapi_near_tool, pointers),
    NEAR(tool_pairs_offset, tool_pair_count, hapi_near_tool_pair, contacts),
#define POSES(...) ARRAY(HAPI_CHANNEL_POSES, hapi_poses, __VA_ARGS__)
    POSES(bodies_offset, body_count, hapi_poses_body, bodies),
    POSES(pointers_offset, pointer_count, hapi_poses_pointer, pointers),
    POSES(sides_offset, side_count, hapi_tool_side, tool_points),
#define PATCHES(...) ARRAY(HAPI_CHANNEL_PATCHES, hapi_patches, __VA_ARGS__)
    PATCHES(contacts_offset, contact_count, hapi_patch_contact, contacts),
    PATCHES(surfaces_offset, surface_count, hapi_surface, contacts),
    PATCHES(pairs_offset, surface_count, hapi_pair_tags, contacts),
    PATCHES(tools_offset, tool_count, hapi_tool_point, tool_points),
};

#define ARRAYS (sizeof arrays / sizeof arrays[0])

static const size_t head_sizes[HAPI_CHANNELS] = {
    [HAPI_CHANNEL_MODEL] = sizeof(hapi_model),     [HAPI_CHANNEL_STATE] = sizeof(hapi_state),
    [HAPI_CHANNEL_NEAR] = sizeof(hapi_near),       [HAPI_CHANNEL_POSES] = sizeof(hapi_poses),
    [HAPI_CHANNEL_PATCHES] = sizeof(hapi_patches),
};

static uint32_t member_at(const void *of, size_t offset)
{
  uint32_t value;
  memcpy(&value, (const char *)of + offset, sizeof value);
  return value;
}

/* Size of a message. Where message is not NULL its head is told where the arrays lie. */
static size_t message_lay_out(hapi_channel name, void *message, const hapi_capacity *capacity)
{
  size_t size = head_sizes[name];
  for (size_t i = 0; i < ARRAYS; ++i) {
    const message_array *array = &arrays[i];
    if (array->channel == name) {
      uint32_t begins = (uint32_t)round_up(size);
      HAPI_ASSERT(round_up(size) <= UINT32_MAX);
      size = begins + member_at(capacity, array->most) * array->element;
      if (message != NULL) {
        memcpy((char *)message + array->begins, &begins, sizeof begins);
      }
    }
  }
  return round_up(size);
}

/* Whether the arrays of a message hold what it counts: for asserts. */
static bool message_fits(hapi_channel name, const void *message, const hapi_capacity *capacity)
{
  bool fits = true;
  for (size_t i = 0; i < ARRAYS; ++i) {
    const message_array *array = &arrays[i];
    fits = fits && (array->channel != name ||
                    member_at(message, array->count) <= member_at(capacity, array->most));
  }
  return fits;
}

/* ---- life ---- */

static hap_status exchange_make(const hapi_capacity *capacity, bool late, hapi_exchange **out)
{
  size_t size = round_up(sizeof(hapi_exchange));
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    size += 3 * message_lay_out((hapi_channel)i, NULL, capacity);
  }
  *out = NULL;
  char *memory = late ? hapi_alloc_late(1, size) : hapi_alloc(size);
  if (memory == NULL) {
    return HAP_ERROR_MEMORY;
  }
  hapi_exchange *e = (hapi_exchange *)(void *)memory;
  e->capacity = *capacity;
  e->size = size;
  e->late = late;
  sem_init(&e->near_bell, 0, 0);
  char *at = memory + round_up(sizeof(hapi_exchange));
  for (int i = 0; i < HAPI_CHANNELS; ++i) {
    e->channels[i].size = message_lay_out((hapi_channel)i, NULL, capacity);
    for (int k = 0; k < 3; ++k) {
      e->channels[i].places[k] = at;
      at += e->channels[i].size;
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

hap_status hapi_exchange_create(const hapi_capacity *capacity, hapi_exchange **out)
{
  return exchange_make(capacity, false, out);
}

hap_status hapi_exchange_create_late(const hapi_capacity *capacity, hapi_exchange **out)
{
  return exchange_make(capacity, true, out);
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
      memset(c->places[k], 0, exchange->late ? head_sizes[i] : c->size);
      (void)message_lay_out((hapi_channel)i, c->places[k], &exchange->capacity);
    }
  }
  for (int k = 0; k < 3; ++k) {
    hapi_state *state = exchange->channels[HAPI_CHANNEL_STATE].places[k];
    state->pointer_count = exchange->capacity.pointers;
    state->spring_capacity = exchange->capacity.springs;
  }
  atomic_store(&exchange->near_is_empty, 1);
  hapi_trail_reset(&exchange->trail);
  hapi_path_reset(&exchange->path);
}

/* ---- the mailboxes ---- */

void *hapi_exchange_back(hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  channel *c = &exchange->channels[name];
  return c->places[hapi_triple_back(&c->buffer)];
}

/* Replay: the writer's place is always the same, and what is in it is copied. */
void hapi_exchange_publish(hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  channel *c = &exchange->channels[name];
  unsigned place = hapi_triple_back(&c->buffer);
  const hapi_near *near = name == HAPI_CHANNEL_NEAR ? c->places[place] : NULL;
  int empty = near != NULL && near->pair_count + near->tool_pair_count == 0 && near->always == 0;
  HAPI_ASSERT(message_fits(name, c->places[place], &exchange->capacity));
  c->numbers[place] = ++c->published;
  if (c->queue != NULL) {
    hapi_message_queue_put(c->queue, c->published, c->places[place]);
  } else {
    hapi_triple_publish(&c->buffer);
  }
  /* Only physics writes near_is_empty, and the contact thread waits only while it is set. So no
   * post is lost, and a superfluous one costs one check. */
  if (near != NULL && atomic_exchange(&exchange->near_is_empty, empty) != 0 && empty == 0) {
    sem_post(&exchange->near_bell);
  }
}

void *hapi_exchange_take(hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  channel *c = &exchange->channels[name];
  if (c->queue != NULL) {
    return hapi_message_queue_take(c->queue);
  }
  return hapi_triple_take(&c->buffer) ? c->places[hapi_triple_front(&c->buffer)] : NULL;
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

/* ---- recordings ---- */

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

hapi_path *hapi_exchange_path(hapi_exchange *exchange)
{
  return &exchange->path;
}

hapi_trail *hapi_exchange_trail(hapi_exchange *exchange)
{
  return &exchange->trail;
}

const hapi_capacity *hapi_exchange_capacity(const hapi_exchange *exchange)
{
  return &exchange->capacity;
}

size_t hapi_exchange_message_size(const hapi_exchange *exchange, hapi_channel name)
{
  HAPI_ASSERT_INDEX(name, HAPI_CHANNELS);
  return exchange->channels[name].size;
}

void *hapi_exchange_memory(hapi_exchange *exchange, size_t *out_size)
{
  *out_size = exchange->size;
  return exchange;
}
