/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The triple buffer and the two mailboxes made of it. */

#include "tests/tap.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include <hapode/hapode.h>

#include "base/clock.h"
#include "sync/exchange.h"
#include "sync/triple_buffer.h"

#define MESSAGES 1200000u
#define TAKEN 20000u
#define PAYLOAD 14 /* words: with number and sum two cache lines */

/* ---- newest value, no other ---- */

TEST(nothing_can_be_taken_before_the_first_message)
{
  hapi_triple_buffer b;
  hapi_triple_init(&b);
  CHECK(!hapi_triple_take(&b));
  CHECK(!hapi_triple_take(&b));
  CHECK(hapi_triple_back(&b) < 3 && hapi_triple_front(&b) < 3);
  CHECK(hapi_triple_back(&b) != hapi_triple_front(&b));
}

TEST(a_message_is_taken_once)
{
  hapi_triple_buffer b;
  int place[3] = {0, 0, 0};
  hapi_triple_init(&b);
  for (int i = 1; i < 100; ++i) {
    place[hapi_triple_back(&b)] = i;
    hapi_triple_publish(&b);
    CHECK(hapi_triple_take(&b));
    CHECK(place[hapi_triple_front(&b)] == i);
    CHECK(!hapi_triple_take(&b));
    CHECK(place[hapi_triple_front(&b)] == i); /* and stays with the reader */
  }
}

TEST(the_newest_of_several_is_taken)
{
  hapi_triple_buffer b;
  int place[3] = {0, 0, 0};
  int number = 0;
  hapi_triple_init(&b);
  for (int burst = 1; burst < 20; ++burst) {
    int held = place[hapi_triple_front(&b)];
    for (int i = 0; i < burst; ++i) {
      place[hapi_triple_back(&b)] = ++number;
      hapi_triple_publish(&b);
      CHECK(place[hapi_triple_front(&b)] == held); /* what the reader holds is not written */
    }
    CHECK(hapi_triple_take(&b));
    CHECK(place[hapi_triple_front(&b)] == number);
    CHECK(!hapi_triple_take(&b));
  }
}

/* All interleavings of up to 12 calls: writer, reader and middle always own different places. */
TEST(three_places_have_three_owners_in_every_order_of_calls)
{
  enum {
    CALLS = 12
  };
  for (unsigned order = 0; order < 1u << CALLS; ++order) {
    hapi_triple_buffer b;
    hapi_triple_init(&b);
    int waiting = 0;
    for (int i = 0; i < CALLS; ++i) {
      if ((order >> i & 1u) != 0) {
        hapi_triple_publish(&b);
        waiting = 1;
      } else {
        CHECK(hapi_triple_take(&b) == (waiting != 0));
        waiting = 0;
      }
      unsigned middle = atomic_load(&b.middle) & 3u;
      unsigned owned = 1u << hapi_triple_back(&b) | 1u << hapi_triple_front(&b) | 1u << middle;
      CHECK(owned == 7u);
    }
  }
}

/* Wait-free by construction: each side is one exchange and at most one load, which the hardware
 * does without a lock; there is no loop to go round in. What can be tested is that the atomic is
 * lock-free and that no side waits for the other, however long that one stands still. */
TEST(neither_side_waits_for_the_other)
{
  hapi_triple_buffer b;
  hapi_triple_init(&b);
  CHECK(atomic_is_lock_free(&b.middle));
  for (int i = 0; i < 1000; ++i) {
    hapi_triple_publish(&b); /* the reader stands still */
  }
  CHECK(hapi_triple_take(&b));
  for (int i = 0; i < 1000; ++i) {
    CHECK(!hapi_triple_take(&b)); /* the writer stands still */
  }
}

/* ---- never torn ---- */

typedef struct message {
  uint64_t number;
  uint64_t words[PAYLOAD];
  uint64_t sum;
} message;

static uint64_t bits_mix(uint64_t x)
{
  x = (x ^ (x >> 31)) * 0x9e3779b97f4a7c15u;
  return x ^ (x >> 29);
}

static void message_fill(message *m, uint64_t number)
{
  m->number = number;
  m->sum = bits_mix(number);
  for (int i = 0; i < PAYLOAD; ++i) {
    m->words[i] = bits_mix(number + (uint64_t)i);
    m->sum += m->words[i];
  }
}

static bool message_is_whole(const message *m)
{
  uint64_t sum = bits_mix(m->number);
  for (int i = 0; i < PAYLOAD; ++i) {
    sum += m->words[i];
  }
  return sum == m->sum && m->words[0] == bits_mix(m->number);
}

typedef struct stream {
  hapi_triple_buffer buffer;
  message places[3];
  atomic_uint ended;
  uint64_t sent;
  uint64_t taken;
  uint64_t torn;
  uint64_t backwards;
  uint64_t last;
} stream;

static void take_one(stream *s)
{
  if (!hapi_triple_take(&s->buffer)) {
    return;
  }
  const message *m = &s->places[hapi_triple_front(&s->buffer)];
  ++s->taken;
  s->torn += !message_is_whole(m);
  s->backwards += m->number <= s->last;
  s->last = m->number;
}

static void send_one(stream *s, uint64_t number)
{
  message_fill(&s->places[hapi_triple_back(&s->buffer)], number);
  hapi_triple_publish(&s->buffer);
}

/* Two streams between two threads: each writes one and reads the other, until both have sent enough
 * and seen enough of the other one (a thread that is not scheduled sees only the last message). */
typedef struct pair {
  stream there;
  stream back;
  atomic_uint content;
  int64_t latest_end_ns;
} pair;

static void run_side(pair *p, stream *out, stream *in)
{
  bool content = false;
  uint64_t number = 0;
  while (atomic_load_explicit(&p->content, memory_order_relaxed) < 2) {
    for (int i = 0; i < 100; ++i) {
      send_one(out, ++number);
      take_one(in);
    }
    bool enough = number >= MESSAGES && in->taken >= TAKEN;
    if (!content && (enough || hapi_clock_now() > p->latest_end_ns)) {
      content = true;
      atomic_fetch_add_explicit(&p->content, 1, memory_order_relaxed);
    }
  }
  out->sent = number;
  atomic_store_explicit(&out->ended, 1, memory_order_release);
  while (atomic_load_explicit(&in->ended, memory_order_acquire) == 0) {
    take_one(in);
  }
  take_one(in);
}

static void *physics_answer(void *arg)
{
  pair *p = arg;
  run_side(p, &p->back, &p->there);
  return NULL;
}

static void check_stream(const stream *s, const char *name)
{
  printf("# %s: %llu of %llu messages taken\n", name, (unsigned long long)s->taken,
         (unsigned long long)s->sent);
  CHECK(s->torn == 0);
  CHECK(s->backwards == 0);
  CHECK_NEAR((double)s->last, (double)s->sent, 0.0); /* the newest one always comes through */
  CHECK(s->taken > 1);
}

TEST(messages_are_never_torn_in_either_direction)
{
  static pair p;
  pthread_t thread;
  memset(&p, 0, sizeof p);
  p.latest_end_ns = hapi_clock_now() + 10000000000LL;
  hapi_triple_init(&p.there.buffer);
  hapi_triple_init(&p.back.buffer);
  int64_t begin = hapi_clock_now();
  REQUIRE(pthread_create(&thread, NULL, physics_answer, &p) == 0);
  run_side(&p, &p.there, &p.back);
  pthread_join(thread, NULL);
  printf("# %.2f s\n", 1e-9 * (double)(hapi_clock_now() - begin));
  check_stream(&p.there, "there");
  check_stream(&p.back, "back");
}

/* ---- the exchange ---- */

static const hapi_capacity capacities[] = {
    {.bodies = 1,
     .contacts = 1,
     .pairs = 1,
     .pointers = 1,
     .joints = 1,
     .tool_points = 2,
     .crosses = 1},
    {.bodies = 3,
     .contacts = 5,
     .pairs = 5,
     .pointers = 2,
     .joints = 7,
     .tool_points = 3,
     .crosses = 9},
    {.bodies = 64,
     .contacts = 256,
     .pairs = 256,
     .pointers = 4,
     .joints = 128,
     .tool_points = 64,
     .crosses = 512},
    {.bodies = 1024,
     .contacts = 4096,
     .pairs = 4096,
     .pointers = 16,
     .joints = 2048,
     .tool_points = 64,
     .crosses = 8192},
};
#define CAPACITIES (sizeof capacities / sizeof capacities[0])

/* A model of full capacity in which every byte of the arrays depends on seed. */
static void fill_model(hapi_model *m, const hapi_capacity *c, uint64_t seed)
{
  m->number = seed;
  m->state_ns = (int64_t)bits_mix(seed);
  m->model = HAP_MODEL_ACCELERANCE;
  m->body_count = c->bodies;
  m->contact_count = c->contacts;
  memset(hapi_model_bodies(m), (int)(bits_mix(seed) & 0xff), c->bodies * sizeof(hapi_model_body));
  memset(hapi_model_contacts(m), (int)(bits_mix(seed + 1) & 0xff),
         c->contacts * sizeof(hapi_model_contact));
  m->joint_count = c->joints;
  memset(hapi_model_joints(m), (int)(bits_mix(seed + 2) & 0xff),
         c->joints * sizeof(hapi_model_joint));
  m->cross_count = c->crosses;
  memset(hapi_model_crosses(m), (int)(bits_mix(seed + 3) & 0xff),
         c->crosses * sizeof(hapi_model_cross));
  m->triangle_count = c->triangles;
  memset(hapi_model_triangles(m), (int)(bits_mix(seed + 5) & 0xff),
         c->triangles * sizeof(hapi_triangle));
  m->tool_count = c->tool_points;
  memset(hapi_model_tools(m), (int)(bits_mix(seed + 4) & 0xff),
         c->tool_points * sizeof(hapi_tool_point));
}

static bool all_bytes(const void *block, size_t size, uint64_t byte)
{
  const unsigned char *at = block;
  for (size_t i = 0; i < size; ++i) {
    if (at[i] != (byte & 0xff)) {
      return false;
    }
  }
  return size > 0;
}

static bool model_is(hapi_model *m, const hapi_capacity *c, uint64_t seed)
{
  return m->number == seed && m->state_ns == (int64_t)bits_mix(seed) &&
         m->body_count == c->bodies && m->contact_count == c->contacts &&
         all_bytes(hapi_model_bodies(m), c->bodies * sizeof(hapi_model_body), bits_mix(seed)) &&
         all_bytes(hapi_model_contacts(m), c->contacts * sizeof(hapi_model_contact),
                   bits_mix(seed + 1)) &&
         m->joint_count == c->joints &&
         all_bytes(hapi_model_joints(m), c->joints * sizeof(hapi_model_joint),
                   bits_mix(seed + 2)) &&
         m->cross_count == c->crosses &&
         all_bytes(hapi_model_crosses(m), c->crosses * sizeof(hapi_model_cross),
                   bits_mix(seed + 3)) &&
         m->tool_count == c->tool_points &&
         all_bytes(hapi_model_tools(m), c->tool_points * sizeof(hapi_tool_point),
                   bits_mix(seed + 4));
}

static void fill_state(hapi_state *s, const hapi_capacity *c, uint64_t seed)
{
  s->model_number = seed;
  s->hand_impulse[0] = (double)(bits_mix(seed) >> 12);
  s->body_high = c->bodies;
  s->contact_count = c->contacts;
  memset(hapi_state_bodies(s), (int)(bits_mix(seed) & 0xff), c->bodies * sizeof(hapi_state_body));
  memset(hapi_state_contacts(s), (int)(bits_mix(seed + 1) & 0xff),
         c->contacts * sizeof(hapi_state_contact));
  memset(hapi_state_pointers(s), (int)(bits_mix(seed + 2) & 0xff),
         c->pointers * sizeof(hapi_state_pointer));
}

static bool state_is(hapi_state *s, const hapi_capacity *c, uint64_t seed)
{
  return s->model_number == seed && s->hand_impulse[0] == (double)(bits_mix(seed) >> 12) &&
         s->body_high == c->bodies && s->pointer_count == c->pointers &&
         all_bytes(hapi_state_bodies(s), c->bodies * sizeof(hapi_state_body), bits_mix(seed)) &&
         all_bytes(hapi_state_contacts(s), c->contacts * sizeof(hapi_state_contact),
                   bits_mix(seed + 1)) &&
         all_bytes(hapi_state_pointers(s), c->pointers * sizeof(hapi_state_pointer),
                   bits_mix(seed + 2));
}

/* The six blocks are filled to the brim before any is read: none may reach into another one. */
TEST(exchange_carries_full_messages_of_every_capacity)
{
  for (size_t i = 0; i < CAPACITIES; ++i) {
    const hapi_capacity *c = &capacities[i];
    hapi_exchange *e = NULL;
    REQUIRE(hapi_exchange_create(c, &e) == HAP_OK);
    CHECK(hapi_exchange_model_take(e) == NULL && hapi_exchange_state_take(e) == NULL);
    for (uint64_t seed = 1; seed <= 7; ++seed) {
      fill_model(hapi_exchange_model_back(e), c, seed);
      fill_state(hapi_exchange_state_back(e), c, seed + 50);
      hapi_exchange_model_publish(e);
      hapi_exchange_state_publish(e);
      fill_model(hapi_exchange_model_back(e), c, seed + 100);
      fill_state(hapi_exchange_state_back(e), c, seed + 150);
      hapi_model *model = hapi_exchange_model_take(e);
      hapi_state *state = hapi_exchange_state_take(e);
      REQUIRE(model != NULL && state != NULL);
      CHECK(model_is(model, c, seed));
      CHECK(state_is(state, c, seed + 50));
      CHECK(hapi_exchange_model_take(e) == NULL && hapi_exchange_state_take(e) == NULL);
      CHECK(model_is(hapi_exchange_model_back(e), c, seed + 100));
      CHECK(state_is(hapi_exchange_state_back(e), c, seed + 150));
    }
    hapi_exchange_destroy(e);
  }
  hapi_exchange_destroy(NULL);
}

TEST(exchange_arrays_are_aligned_and_within_its_block)
{
  for (size_t i = 0; i < CAPACITIES; ++i) {
    const hapi_capacity *c = &capacities[i];
    hapi_exchange *e = NULL;
    REQUIRE(hapi_exchange_create(c, &e) == HAP_OK);
    size_t size = 0;
    char *block = hapi_exchange_memory(e, &size);
    hapi_model *m = hapi_exchange_model_back(e);
    hapi_state *s = hapi_exchange_state_back(e);
    const char *ends[] = {
        (char *)(hapi_model_contacts(m) + c->contacts), (char *)(hapi_model_bodies(m) + c->bodies),
        (char *)(hapi_state_contacts(s) + c->contacts), (char *)(hapi_state_bodies(s) + c->bodies),
        (char *)(hapi_state_pointers(s) + c->pointers)};
    for (size_t k = 0; k < sizeof ends / sizeof ends[0]; ++k) {
      CHECK(ends[k] > block && ends[k] <= block + size);
    }
    CHECK((uintptr_t)hapi_model_bodies(m) % 8 == 0 && (uintptr_t)hapi_model_contacts(m) % 8 == 0);
    CHECK((uintptr_t)hapi_state_bodies(s) % 8 == 0 && (uintptr_t)hapi_state_contacts(s) % 8 == 0);
    CHECK((uintptr_t)hapi_state_pointers(s) % 8 == 0);
    hapi_exchange_destroy(e);
  }
}

TEST(exchange_reset_forgets_everything)
{
  const hapi_capacity *c = &capacities[1];
  hapi_exchange *e = NULL;
  REQUIRE(hapi_exchange_create(c, &e) == HAP_OK);
  for (uint64_t seed = 1; seed < 4; ++seed) {
    fill_model(hapi_exchange_model_back(e), c, seed);
    fill_state(hapi_exchange_state_back(e), c, seed);
    hapi_exchange_model_publish(e);
    hapi_exchange_state_publish(e);
  }
  hapi_exchange_reset(e);
  CHECK(hapi_exchange_model_take(e) == NULL && hapi_exchange_state_take(e) == NULL);
  CHECK(hapi_exchange_model_back(e)->number == 0 && hapi_exchange_state_back(e)->model_number == 0);
  CHECK(hapi_exchange_state_back(e)->pointer_count == c->pointers);
  CHECK(all_bytes(hapi_model_bodies(hapi_exchange_model_back(e)),
                  c->bodies * sizeof(hapi_model_body), 0));
  fill_model(hapi_exchange_model_back(e), c, 9);
  hapi_exchange_model_publish(e);
  hapi_model *model = hapi_exchange_model_take(e);
  REQUIRE(model != NULL);
  CHECK(model_is(model, c, 9));
  hapi_exchange_destroy(e);
}

/* Both mailboxes at once between a slow writer of large models and a fast writer of states, as in a
 * session. */
typedef struct traffic {
  hapi_exchange *exchange;
  const hapi_capacity *capacity;
  atomic_uint ended;
  uint64_t states;
  uint64_t bad;
} traffic;

static void *physics_side(void *arg)
{
  traffic *t = arg;
  for (uint64_t number = 1; number <= 4000; ++number) {
    fill_model(hapi_exchange_model_back(t->exchange), t->capacity, number);
    hapi_exchange_model_publish(t->exchange);
    hapi_state *state = hapi_exchange_state_take(t->exchange);
    if (state != NULL) {
      ++t->states;
      t->bad += !state_is(state, t->capacity, state->model_number);
    }
  }
  atomic_store(&t->ended, 1);
  return NULL;
}

TEST(exchange_is_never_torn_between_two_threads)
{
  traffic t = {.capacity = &capacities[2]};
  pthread_t thread;
  uint64_t models = 0;
  uint64_t last = 0;
  uint64_t bad = 0;
  REQUIRE(hapi_exchange_create(t.capacity, &t.exchange) == HAP_OK);
  REQUIRE(pthread_create(&thread, NULL, physics_side, &t) == 0);
  for (uint64_t tick = 1; last < 4000; ++tick) {
    fill_state(hapi_exchange_state_back(t.exchange), t.capacity, tick);
    hapi_exchange_state_publish(t.exchange);
    hapi_model *model = hapi_exchange_model_take(t.exchange);
    if (model != NULL) {
      ++models;
      bad += !model_is(model, t.capacity, model->number) || model->number <= last;
      last = model->number;
    }
  }
  pthread_join(thread, NULL);
  printf("# %llu models, %llu states\n", (unsigned long long)models, (unsigned long long)t.states);
  CHECK(bad == 0 && t.bad == 0);
  CHECK(models > 0);
  hapi_exchange_destroy(t.exchange);
}
