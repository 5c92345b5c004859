/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* remote/scenery.h: which bodies are told, how often, and what a reader makes of any bytes. */

#include "tests/tap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "remote/scenery.h"
#include "tests/failing_heap.h"

#define BODIES_MOST 5000

/* A world, and what a client knows of it by the messages. */
typedef struct stage {
  hapi_told_body bodies[BODIES_MOST];
  uint32_t count;
  hapi_scenery scenery;
  hapi_told_body known[BODIES_MOST]; /* by name - 1 */
  uint64_t numbers[BODIES_MOST];
  double loss;  /* of newest messages */
  bool refuses; /* reliable ones */
  uint32_t newest;
  uint32_t sure;
  uint32_t told; /* bodies */
  uint64_t bytes;
} stage;

static void stage_finish(void *owned)
{
  hapi_scenery_finish(&((stage *)owned)->scenery);
}

static stage *stage_open(uint32_t count)
{
  stage *s = tap_own(sizeof *s, stage_finish);
  s->count = count;
  for (uint32_t i = 0; i < count; ++i) {
    s->bodies[i] = (hapi_told_body){
        .name = i + 1, .birth = i + 1, .pose = {{0.1 * i, 2.0, -3.0}, {1.0, 0.0, 0.0, 0.0}}};
  }
  return s;
}

static uint32_t stage_places(void *of)
{
  return ((stage *)of)->count;
}

static void stage_read(void *of, uint32_t first, uint32_t count, hapi_told_body *out)
{
  const stage *s = of;
  CHECK(first + count <= s->count);
  memcpy(out, s->bodies + first, count * sizeof *out);
}

static bool stage_take(void *of, uint32_t part, bool reliable, const void *data, uint32_t bytes)
{
  stage *s = of;
  hapi_told_body told[HAPI_SCENERY_MOST];
  uint64_t number = 0;
  CHECK(bytes <= HAP_LINK_NEWEST_MOST);
  CHECK(reliable || part == s->newest);
  s->newest += !reliable;
  s->sure += reliable;
  s->bytes += bytes;
  uint32_t count = hapi_scenery_read(data, bytes, &number, told);
  CHECK(count > 0);
  if (reliable ? s->refuses : drand48() < s->loss) {
    return !reliable;
  }
  for (uint32_t i = 0; i < count; ++i) {
    REQUIRE(told[i].name <= s->count);
    if (s->numbers[told[i].name - 1] < number) {
      s->numbers[told[i].name - 1] = number;
      s->known[told[i].name - 1] = told[i];
    }
  }
  s->told += count;
  return true;
}

static void stage_step(stage *s)
{
  const hapi_scenery_source from = {s, stage_places, stage_read};
  const hapi_scenery_out out = {s, stage_take};
  s->newest = s->sure = s->told = 0;
  s->bytes = 0;
  CHECK(hapi_scenery_step(&s->scenery, &from, &out));
  CHECK(s->newest <= HAPI_SCENERY_PARTS && s->sure <= 1);
}

static bool body_is_known(const stage *s, uint32_t i)
{
  double apart = 0.0;
  for (int k = 0; k < 3; ++k) {
    apart = fmax(apart, fabs(s->known[i].pose.position[k] - s->bodies[i].pose.position[k]));
  }
  for (int k = 0; k < 4; ++k) {
    apart = fmax(apart, fabs(s->known[i].pose.quat_wxyz[k] - s->bodies[i].pose.quat_wxyz[k]));
  }
  return apart < 1.3e-4 && s->known[i].birth == s->bodies[i].birth;
}

TEST(bodies_at_rest_are_told_twice_and_never_again)
{
  stage *s = stage_open(30);
  stage_step(s);
  CHECK(s->newest == 1 && s->told == 30 && s->sure == 0);
  CHECK(s->bytes == HAPI_SCENERY_HEAD + 30 * HAPI_SCENERY_BODY);
  uint64_t sum = 0;
  for (int i = 0; i < 30; ++i) {
    stage_step(s);
    sum += s->bytes;
  }
  CHECK(sum == HAPI_SCENERY_HEAD + 30 * HAPI_SCENERY_BODY);
  for (int i = 0; i < 1000; ++i) {
    stage_step(s);
    CHECK(s->bytes == 0);
  }
  s->bodies[7].pose.position[1] += 2e-5;
  stage_step(s);
  CHECK(s->newest == 1 && s->told == 1);
  CHECK(body_is_known(s, 7));
}

TEST(what_is_lost_on_the_way_to_rest_comes_reliably)
{
  stage *s = stage_open(100);
  srand48(5);
  s->loss = 0.9;
  for (int i = 0; i < 200; ++i) {
    for (uint32_t k = 0; k < s->count; ++k) {
      s->bodies[k].pose.position[2] += k % 3 == 0 ? 1e-3 : 0.0;
    }
    stage_step(s);
  }
  s->refuses = true; /* the transport is full for a while */
  for (int i = 0; i < 40; ++i) {
    stage_step(s);
  }
  CHECK(s->sure == 1);
  s->refuses = false;
  for (int i = 0; i < 10; ++i) {
    stage_step(s);
  }
  CHECK(s->bytes == 0);
  for (uint32_t k = 0; k < s->count; ++k) {
    CHECK(body_is_known(s, k));
  }
}

/* Eight messages have 336 bodies: a world of 5000 goes round in 15 steps. */
TEST(of_very_many_bodies_each_has_its_turn)
{
  stage *s = stage_open(BODIES_MOST);
  uint64_t most = 0;
  for (int i = 0; i < 150; ++i) {
    for (uint32_t k = 0; k < s->count; ++k) {
      s->bodies[k].pose.position[0] += 1e-3;
    }
    stage_step(s);
    most = s->bytes > most ? s->bytes : most;
  }
  for (uint32_t k = 0; k < s->count; ++k) {
    CHECK(s->scenery.number - s->numbers[k] < 16);
  }
  printf("# %u bytes a step at most\n", (unsigned)most);
  CHECK(most <= HAPI_SCENERY_PARTS * HAP_LINK_NEWEST_MOST);
}

TEST(bodies_of_the_loop_are_not_told_until_it_has_let_go)
{
  stage *s = stage_open(3);
  for (int i = 0; i < 20; ++i) {
    stage_step(s);
  }
  s->bodies[1].owned = true;
  for (int i = 0; i < 20; ++i) {
    s->bodies[1].pose.position[0] += 0.01;
    stage_step(s);
    CHECK(s->bytes == 0);
  }
  s->bodies[1].owned = false; /* where it was told to be before: the client may have it elsewhere */
  s->bodies[1].pose.position[0] = 0.1;
  stage_step(s);
  CHECK(s->told == 1 && body_is_known(s, 1));
}

TEST(another_life_of_a_body_is_told_reliably)
{
  stage *s = stage_open(3);
  for (int i = 0; i < 20; ++i) {
    stage_step(s);
  }
  s->bodies[2].birth = 9; /* put elsewhere, and the loop has it at once */
  s->bodies[2].owned = true;
  stage_step(s);
  CHECK(s->newest == 0 && s->sure == 1 && s->known[2].birth == 9);
  stage_step(s);
  CHECK(s->bytes == 0);
  s->bodies[0] = (hapi_told_body){.name = 0}; /* destroyed, and another one in its place */
  stage_step(s);
  CHECK(s->bytes == 0);
  s->bodies[0] = (hapi_told_body){.name = 3, .birth = 10, .pose = {{5.0}, {1.0}}};
  stage_step(s);
  CHECK(s->told > 0);
}

TEST(another_client_is_told_everything)
{
  stage *s = stage_open(50);
  for (int i = 0; i < 20; ++i) {
    stage_step(s);
  }
  hapi_scenery_reset(&s->scenery);
  stage_step(s);
  CHECK(s->told == 50);
}

TEST(without_memory_nothing_is_told_and_later_everything)
{
  stage *s = stage_open(50);
  const hapi_scenery_source from = {s, stage_places, stage_read};
  const hapi_scenery_out out = {s, stage_take};
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.allocate = failing_allocate;
  hooks.release = counted_release;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  fail_from_now(1, 1);
  CHECK(!hapi_scenery_step(&s->scenery, &from, &out));
  hap_hooks_init(&hooks, sizeof hooks);
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  stage_step(s);
  CHECK(s->told == 50);
}

/* ---- the reader ---- */

static uint32_t bytes_read(const unsigned char *data, uint32_t bytes)
{
  hapi_told_body told[HAPI_SCENERY_MOST];
  uint64_t number = 0;
  uint32_t count = hapi_scenery_read(data, bytes, &number, told);
  CHECK(count <= HAPI_SCENERY_MOST);
  for (uint32_t i = 0; i < count; ++i) {
    const double *q = told[i].pose.quat_wxyz;
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    CHECK(told[i].name > 0 && told[i].birth > 0 && fabs(norm - 1.0) < 1e-12);
    for (int k = 0; k < 3; ++k) {
      CHECK(fabs(told[i].pose.position[k]) <= 1e6); /* false for NaN */
    }
  }
  return count;
}

TEST(poses_come_back_within_the_rounding_of_the_format)
{
  const hapi_told_body body = {
      .name = 4000000000u, .birth = 12, .pose = {{1.234567, -0.5, 100.0}, {0.5, -0.5, 0.5, -0.5}}};
  unsigned char bytes[HAP_LINK_NEWEST_MOST];
  hapi_told_body told[HAPI_SCENERY_MOST];
  uint64_t number = 0;
  uint32_t size = hapi_scenery_write(UINT64_C(123456789012), &body, 1, bytes);
  REQUIRE(hapi_scenery_read(bytes, size, &number, told) == 1);
  CHECK(number == UINT64_C(123456789012) && told[0].name == 4000000000u && told[0].birth == 12);
  for (int k = 0; k < 3; ++k) {
    CHECK_NEAR(told[0].pose.position[k], body.pose.position[k], 1e-7 * 100.0);
  }
  for (int k = 0; k < 4; ++k) {
    CHECK_NEAR(told[0].pose.quat_wxyz[k], body.pose.quat_wxyz[k], 1.6e-5);
  }
}

TEST(bytes_that_tell_no_bodies_are_refused_whole)
{
  const hapi_told_body two[2] = {
      {.name = 1, .birth = 1, .pose = {{1.0, 2.0, 3.0}, {1.0, 0.0, 0.0, 0.0}}},
      {.name = 2, .birth = 2, .pose = {{1.0, 2.0, 3.0}, {1.0, 0.0, 0.0, 0.0}}}};
  unsigned char good[HAP_LINK_NEWEST_MOST];
  uint32_t size = hapi_scenery_write(1, two, 2, good);
  CHECK(bytes_read(good, size) == 2);
  for (uint32_t bytes = 0; bytes < size; ++bytes) {
    CHECK(bytes_read(good, bytes) == (bytes == size - HAPI_SCENERY_BODY));
  }
  static const struct {
    uint32_t at; /* in the second body */
    unsigned char with[4];
  } bad[] = {
      {0, {0, 0, 0, 0}},              /* no name */
      {4, {0, 0, 0, 0}},              /* no birth */
      {8, {0, 0, 0xc0, 0x7f}},        /* NaN */
      {12, {0, 0, 0x80, 0xff}},       /* minus infinity */
      {16, {0xff, 0xff, 0x7f, 0x7f}}, /* 3e38 m */
      {20, {0, 0, 0, 0}},             /* no quaternion */
      {24, {0xff, 0x7f, 0xff, 0x7f}}, /* one of length 1.7 */
  };
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    unsigned char bytes[HAP_LINK_NEWEST_MOST];
    memcpy(bytes, good, size);
    memcpy(bytes + HAPI_SCENERY_HEAD + HAPI_SCENERY_BODY + bad[i].at, bad[i].with, 4);
    CHECK_SAY(bytes_read(bytes, size) == 0, "case %zu", i);
  }
  unsigned char many[HAPI_SCENERY_HEAD + (HAPI_SCENERY_MOST + 1) * HAPI_SCENERY_BODY] = {0};
  CHECK(bytes_read(many, sizeof many) == 0);
}

TEST(no_bytes_at_all_are_read_as_something_that_cannot_be)
{
  const hapi_told_body body = {
      .name = 1, .birth = 1, .pose = {{1.0, 2.0, 3.0}, {1.0, 0.0, 0.0, 0.0}}};
  srand48(3);
  uint32_t taken = 0;
  for (int i = 0; i < 200000; ++i) {
    unsigned char bytes[HAP_LINK_NEWEST_MOST];
    uint32_t size = hapi_scenery_write(1, &body, 1, bytes);
    for (int k = 0; k < 1 + i % 5; ++k) {
      bytes[(uint32_t)lrand48() % size] = (unsigned char)lrand48();
    }
    taken += bytes_read(bytes, i % 7 != 0 ? size : (uint32_t)lrand48() % sizeof bytes);
  }
  printf("# %u of 200000 are bodies\n", taken);
  CHECK(taken > 10000 && taken < 190000);
}
