/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Devices that the application makes, and devices around others: by the public headers. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include <hapode/device_impl.h>

#include "tests/files.h"
#include "tests/ode_world.h"

#define STIFFNESS 1000.0
#define RADIUS 0.01
#define TICK_NS 1000000

/* ---- a device of the test's own ---- */

typedef struct own_hand {
  double height; /* m, of the hand */
  bool fails;    /* open, and start */
  int opens, starts, reads, writes, zeros, stops, closes;
  double force; /* N, held, up */
} own_hand;

static hap_status own_open(void *context, const char *args, void **self, hap_detail *detail)
{
  own_hand *hand = context;
  hand->opens += args[0] == '\0';
  if (hand->fails) {
    snprintf(detail->text, sizeof detail->text, "the hand is not there");
    return HAP_ERROR_DEVICE;
  }
  *self = hand;
  return HAP_OK;
}

static void own_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self;
  (void)effector;
  out->dof = 3;
  out->max_force = 8.0;
  out->workspace_low[2] = -0.1;
  out->workspace_high[2] = 0.1;
}

static hap_status own_start(void *self)
{
  own_hand *hand = self;
  ++hand->starts;
  return hand->fails ? HAP_ERROR_DEVICE : HAP_OK;
}

static hap_status own_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  own_hand *hand = self;
  (void)time_ns;
  ++hand->reads;
  out[0]->pose = (hap_pose){{0.0, 0.0, hand->height}, {1.0, 0.0, 0.0, 0.0}};
  memset(&out[0]->twist, 0, sizeof out[0]->twist);
  out[0]->buttons = 2;
  return HAP_OK;
}

static hap_status own_write(void *self, const hap_device_output *const wanted[],
                            hap_device_output *const reached[])
{
  own_hand *hand = self;
  ++hand->writes;
  hand->force = wanted[0]->wrench.force[2];
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void own_zero(void *self)
{
  own_hand *hand = self;
  ++hand->zeros;
  hand->force = 0.0;
}

static void own_stop(void *self)
{
  own_hand *hand = self;
  ++hand->stops;
  hand->force = 0.0;
}

static void own_close(void *self)
{
  own_hand *hand = self;
  ++hand->closes;
}

static const hap_device_ops own_ops = {.abi = HAP_DEVICE_ABI,
                                       .size = sizeof(hap_device_ops),
                                       .name = "own",
                                       .help = "a hand of the test",
                                       .pacing = HAP_PACING_VIRTUAL,
                                       .open = own_open,
                                       .describe = own_describe,
                                       .start = own_start,
                                       .read = own_read,
                                       .write = own_write,
                                       .zero = own_zero,
                                       .stop = own_stop,
                                       .close = own_close};

/* ---- a floor under it ---- */

typedef struct own_stage {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_device *device; /* that the pointer has */
  hap_pointer_id pointer;
  own_hand hand;
} own_stage;

static void own_stage_end(void *owned)
{
  own_stage *s = owned;
  ode_world_end(s->session, s->world, s->space);
  hap_device_close(s->device);
}

static own_stage *own_stage_new(void)
{
  own_stage *s = tap_own(sizeof *s, own_stage_end);
  ode_world_make(9.81, &s->world, &s->space);
  dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
  s->hand.height = 0.05;
  return s;
}

static hap_status own_add(own_stage *s)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.device = s->device;
  def.radius = RADIUS;
  def.stiffness = STIFFNESS;
  return hap_pointer_add(s->session, &def, &s->pointer);
}

static void own_session(own_stage *s)
{
  hap_session_def def;
  hap_ode_def ode;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  def.drive = HAP_DRIVE_LOCKSTEP;
  ode.world = s->world;
  ode.space = s->space;
  REQUIRE(hap_session_create(&def, &ode, &s->session, NULL) == HAP_OK);
}

static void own_begin(own_stage *s)
{
  own_session(s);
  REQUIRE(own_add(s) == HAP_OK);
  REQUIRE(hap_session_start(s->session) == HAP_OK);
  REQUIRE(hap_session_advance(s->session, 50) >= HAP_OK);
}

/* Down to a depth [m] in the floor, and there for a while. */
static void own_press(own_stage *s, double depth)
{
  double from = s->hand.height;
  for (int i = 1; i <= 200; ++i) {
    s->hand.height = from + (RADIUS - depth - from) * i / 200.0;
    REQUIRE(hap_session_advance(s->session, 1) >= HAP_OK);
  }
  REQUIRE(hap_session_advance(s->session, 50) >= HAP_OK);
}

TEST(a_device_of_the_application_is_read_and_pushed)
{
  own_stage *s = own_stage_new();
  hap_device_info info;
  hap_pointer_state state;
  REQUIRE(hap_device_create(&own_ops, &s->hand, &s->device, NULL) == HAP_OK);
  CHECK(hap_device_get_info(s->device, &info, sizeof info) == HAP_OK);
  CHECK(strcmp(info.name, "own") == 0 && info.max_force == 8.0 && info.workspace_high[2] == 0.1);
  own_begin(s);
  CHECK(s->hand.force == 0.0);
  own_press(s, 0.002);
  CHECK_NEAR(s->hand.force, STIFFNESS * 0.002, 1e-9);
  REQUIRE(hap_pointer_get(s->session, s->pointer, &state, sizeof state) == HAP_OK);
  CHECK(state.buttons == 2);
  own_press(s, 0.02);
  CHECK_NEAR(s->hand.force, 8.0, 1e-9); /* its own limit */
  hap_emergency_zero();
  CHECK(s->hand.force == 0.0);
  REQUIRE(hap_session_advance(s->session, 20) >= HAP_OK);
  CHECK(s->hand.force == 0.0);
  hap_session_stop(s->session);
  CHECK(s->hand.opens == 1 && s->hand.starts == 1 && s->hand.stops == 1);
}

TEST(what_cannot_be_made_says_why)
{
  own_hand hand = {.fails = true};
  hap_device *device = (hap_device *)&hand;
  hap_detail detail = {""};
  CHECK(hap_device_create(&own_ops, &hand, &device, &detail) == HAP_ERROR_DEVICE);
  CHECK(device == NULL && strcmp(detail.text, "the hand is not there") == 0);
  CHECK(hap_device_create(NULL, &hand, &device, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_create(&own_ops, &hand, NULL, &detail) == HAP_ERROR_ARGUMENT);
  hap_device_ops ops = own_ops;
  ops.zero = NULL;
  CHECK(hap_device_create(&ops, &hand, &device, &detail) == HAP_ERROR_DEVICE);
  CHECK(strstr(detail.text, "'zero'") != NULL);
  ops = own_ops;
  ops.abi = 2;
  CHECK(hap_device_create(&ops, &hand, &device, &detail) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(detail.text, "device ABI 2") != NULL);
  CHECK(hand.closes == 0);
}

/* ---- around another ---- */

/* Adds a shake to what the guard has let through, and halves what is read of the height. */
typedef struct shaker {
  hap_device *inner;
  double shake; /* N */
  int zeros, stops, closes;
  bool bad;
} shaker;

static hap_status shaker_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  const shaker *s = self;
  hap_status status = hap_device_read(s->inner, time_ns, out);
  out[0]->pose.position[2] *= 0.5;
  return status;
}

static hap_status shaker_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  const shaker *s = self;
  hap_device_output more = *wanted[0];
  const hap_device_output *const all[] = {&more};
  more.wrench.force[2] += s->bad ? (double)NAN : s->shake;
  return hap_device_write(s->inner, all, reached);
}

static void shaker_zero(void *self)
{
  shaker *s = self;
  ++s->zeros;
}

static void shaker_stop(void *self)
{
  shaker *s = self;
  ++s->stops;
}

static void shaker_close(void *self)
{
  shaker *s = self;
  ++s->closes;
}

static const hap_device_ops shaker_ops = {.abi = HAP_DEVICE_ABI,
                                          .size = sizeof(hap_device_ops),
                                          .name = "shaker",
                                          .help = "for tests",
                                          .read = shaker_read,
                                          .write = shaker_write,
                                          .zero = shaker_zero,
                                          .stop = shaker_stop,
                                          .close = shaker_close};

TEST(a_device_around_another_changes_what_goes_through)
{
  own_stage *s = own_stage_new();
  shaker shakes = {.shake = 0.25};
  hap_device_info info;
  REQUIRE(hap_device_create(&own_ops, &s->hand, &shakes.inner, NULL) == HAP_OK);
  REQUIRE(hap_device_wrap(shakes.inner, &shaker_ops, &shakes, &s->device, NULL) == HAP_OK);
  CHECK(hap_device_get_info(s->device, &info, sizeof info) == HAP_OK);
  CHECK(info.max_force == 8.0 && info.dof == 3 && info.pacing == HAP_PACING_VIRTUAL);
  s->hand.height = 0.1;
  own_begin(s);
  CHECK_NEAR(s->hand.force, 0.25, 0.0);
  own_press(s, -0.006); /* at 16 mm, which half of is 2 mm deep */
  CHECK_NEAR(s->hand.force, STIFFNESS * 0.002 + 0.25, 1e-9);
  shakes.bad = true; /* NaN takes all force off, and is a fault */
  hap_stats stats;
  REQUIRE(hap_session_advance(s->session, 1) >= HAP_OK);
  CHECK(s->hand.force == 0.0);
  REQUIRE(hap_session_stats(s->session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.faults.fault == HAP_FAULT_DEVICE_WRITE);
  hap_session_stop(s->session);
  CHECK(s->hand.stops == 1 && shakes.stops == 1 && shakes.zeros > 0 && shakes.closes == 0);
  hap_device_close(shakes.inner); /* in any order */
  CHECK(s->hand.closes == 0);
  hap_session_destroy(s->session);
  s->session = NULL;
  hap_device_close(s->device);
  s->device = NULL;
  CHECK(s->hand.closes == 1 && shakes.closes == 1);
}

static const hap_device_ops bare_ops = {.abi = HAP_DEVICE_ABI,
                                        .size = sizeof(hap_device_ops),
                                        .name = "bare",
                                        .help = "changes nothing"};

static void two_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self;
  (void)effector;
  out->effector_count = 2;
}

/* Zero and stop of the inner device come without any operation of the outer one; two wrappers, one
 * in the other. */
TEST(a_device_around_another_without_operations_is_the_other)
{
  own_stage *s = own_stage_new();
  hap_device *inner = NULL;
  hap_device *middle = NULL;
  REQUIRE(hap_device_create(&own_ops, &s->hand, &inner, NULL) == HAP_OK);
  REQUIRE(hap_device_wrap(inner, &bare_ops, NULL, &middle, NULL) == HAP_OK);
  REQUIRE(hap_device_wrap(middle, &bare_ops, NULL, &s->device, NULL) == HAP_OK);
  own_begin(s);
  own_press(s, 0.002);
  CHECK_NEAR(s->hand.force, STIFFNESS * 0.002, 1e-9);
  hap_emergency_zero();
  CHECK(s->hand.force == 0.0);
  hap_session_stop(s->session);
  CHECK(s->hand.stops == 1);
  hap_device_close(middle);
  hap_device_close(inner);
}

TEST(a_device_in_another_serves_nobody_else)
{
  own_stage *s = own_stage_new();
  hap_device *outer = NULL;
  hap_device *second = NULL;
  hap_device_info info;
  hap_device_input in = {.size = sizeof in};
  hap_device_input *const all[] = {&in};
  hap_detail detail = {""};
  REQUIRE(hap_device_create(&own_ops, &s->hand, &s->device, NULL) == HAP_OK);
  CHECK(hap_device_read(s->device, 0, all) == HAP_ERROR_STATE && s->hand.reads == 0);
  CHECK(hap_device_read(NULL, 0, all) == HAP_ERROR_ARGUMENT);
  CHECK(hap_device_write(NULL, NULL, NULL) == HAP_ERROR_ARGUMENT);
  REQUIRE(hap_device_wrap(s->device, &bare_ops, NULL, &outer, NULL) == HAP_OK);
  CHECK(hap_device_wrap(s->device, &bare_ops, NULL, &second, &detail) == HAP_ERROR_STATE);
  CHECK(second == NULL && detail.text[0] != '\0');
  own_session(s);
  CHECK(own_add(s) == HAP_ERROR_STATE);
  hap_device_close(outer); /* and it is free again */
  CHECK(s->hand.closes == 0 && own_add(s) == HAP_OK);
  CHECK(hap_pointer_remove(s->session, s->pointer) == HAP_OK);
  hap_device_ops ops = bare_ops;
  ops.describe = two_describe;
  REQUIRE(hap_device_wrap(s->device, &ops, NULL, &outer, &detail) == HAP_OK);
  CHECK(hap_device_get_info(outer, &info, sizeof info) == HAP_OK && info.effector_count == 1);
  hap_device_close(outer);
  ops.abi = 2;
  CHECK(hap_device_wrap(s->device, &ops, NULL, &outer, &detail) == HAP_ERROR_UNSUPPORTED);
  ops = bare_ops;
  ops.name = "Bad Name";
  CHECK(hap_device_wrap(s->device, &ops, NULL, &outer, &detail) == HAP_ERROR_DEVICE);
  ops = bare_ops;
  ops.open = own_open;
  own_hand absent = {.fails = true};
  CHECK(hap_device_wrap(s->device, &ops, &absent, &outer, &detail) == HAP_ERROR_DEVICE);
  CHECK(strcmp(detail.text, "the hand is not there") == 0);
  CHECK(hap_device_wrap(NULL, &ops, NULL, &outer, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(own_add(s) == HAP_OK); /* nothing of that has kept it */
}

TEST(a_start_that_fails_leaves_the_inner_device_stopped)
{
  own_stage *s = own_stage_new();
  hap_device *inner = NULL;
  static own_hand outer; /* both are there until the stage has closed its device */
  static hap_device_ops ops;
  ops = bare_ops;
  ops.start = own_start;
  REQUIRE(hap_device_create(&own_ops, &s->hand, &inner, NULL) == HAP_OK);
  REQUIRE(hap_device_wrap(inner, &ops, &outer, &s->device, NULL) == HAP_OK);
  outer.fails = true;
  own_session(s);
  REQUIRE(own_add(s) == HAP_OK);
  CHECK(hap_session_start(s->session) == HAP_ERROR_DEVICE);
  CHECK(s->hand.starts == 1 && s->hand.stops == 1 && s->hand.zeros > 0);
  hap_device_close(inner);
}

/* ---- one device, several hands ---- */

#define FINGERS 3u

/* Each finger has a place of its own along x. */
typedef struct glove {
  double height[FINGERS];
  double force[FINGERS];
  int starts, reads, writes, zeros, stops;
  bool fails_read, fails_write;
  bool bad_pose; /* of the last finger */
} glove;

static void glove_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self;
  out->dof = 3;
  out->effector_count = FINGERS;
  out->max_force = 4.0 + effector;
}

static hap_status glove_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)args;
  (void)detail;
  *self = context;
  return HAP_OK;
}

static hap_status glove_start(void *self)
{
  glove *g = self;
  ++g->starts;
  return HAP_OK;
}

static hap_status glove_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  glove *g = self;
  (void)time_ns;
  ++g->reads;
  for (uint32_t i = 0; i < FINGERS; ++i) {
    out[i]->pose = (hap_pose){{0.1 * i, 0.0, g->height[i]}, {1.0, 0.0, 0.0, 0.0}};
    memset(&out[i]->twist, 0, sizeof out[i]->twist);
    out[i]->buttons = 1u << i;
  }
  out[FINGERS - 1]->pose.position[1] = g->bad_pose ? (double)NAN : 0.0;
  return g->fails_read ? HAP_ERROR_DEVICE : HAP_OK;
}

static hap_status glove_write(void *self, const hap_device_output *const wanted[],
                              hap_device_output *const reached[])
{
  glove *g = self;
  ++g->writes;
  for (uint32_t i = 0; i < FINGERS; ++i) {
    g->force[i] = wanted[i]->wrench.force[2];
    reached[i]->wrench = wanted[i]->wrench;
  }
  return g->fails_write ? HAP_ERROR_DEVICE : HAP_OK;
}

static void glove_zero(void *self)
{
  glove *g = self;
  ++g->zeros;
  memset(g->force, 0, sizeof g->force);
}

static void glove_stop(void *self)
{
  glove *g = self;
  ++g->stops;
  memset(g->force, 0, sizeof g->force);
}

static void glove_close(void *self)
{
  (void)self;
}

static const hap_device_ops glove_ops = {.abi = HAP_DEVICE_ABI,
                                         .size = sizeof(hap_device_ops),
                                         .name = "glove",
                                         .help = "fingers",
                                         .pacing = HAP_PACING_VIRTUAL,
                                         .open = glove_open,
                                         .describe = glove_describe,
                                         .start = glove_start,
                                         .read = glove_read,
                                         .write = glove_write,
                                         .zero = glove_zero,
                                         .stop = glove_stop,
                                         .close = glove_close};

typedef struct glove_stage {
  own_stage s;
  glove glove;
  hap_pointer_id fingers[FINGERS];
} glove_stage;

static void glove_stage_end(void *owned)
{
  glove_stage *g = owned;
  own_stage_end(&g->s);
}

static hap_status finger_add(glove_stage *g, uint32_t finger)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.device = g->s.device;
  def.effector = finger;
  def.radius = RADIUS;
  def.stiffness = STIFFNESS;
  hap_pointer_id id;
  hap_status status = hap_pointer_add(g->s.session, &def, &id);
  if (status >= HAP_OK && finger < FINGERS) {
    g->fingers[finger] = id;
  }
  return status;
}

static glove_stage *glove_new(void)
{
  glove_stage *g = tap_own(sizeof *g, glove_stage_end);
  ode_world_make(9.81, &g->s.world, &g->s.space);
  dCreatePlane(g->s.space, 0.0, 0.0, 1.0, 0.0);
  REQUIRE(hap_device_create(&glove_ops, &g->glove, &g->s.device, NULL) == HAP_OK);
  own_session(&g->s);
  for (uint32_t i = 0; i < FINGERS; ++i) {
    g->glove.height[i] = RADIUS + 0.001;
    REQUIRE(finger_add(g, i) == HAP_OK);
  }
  return g;
}

static void glove_run(glove_stage *g, uint32_t ticks)
{
  REQUIRE(hap_session_advance(g->s.session, ticks) >= HAP_OK);
}

/* Each finger goes 1 mm deeper than the one before. */
static glove_stage *glove_pressing(void)
{
  glove_stage *g = glove_new();
  REQUIRE(hap_session_start(g->s.session) == HAP_OK);
  glove_run(g, 50);
  for (int i = 0; i < 40; ++i) {
    for (uint32_t k = 0; k < FINGERS; ++k) {
      g->glove.height[k] -= (0.002 + 0.001 * k) / 40.0;
    }
    glove_run(g, 1);
  }
  glove_run(g, 50);
  for (uint32_t k = 0; k < FINGERS; ++k) {
    CHECK_NEAR(g->glove.force[k], STIFFNESS * 0.001 * (k + 1), 1e-9);
  }
  return g;
}

static hap_fault fault_of(const glove_stage *g)
{
  hap_stats stats;
  REQUIRE(hap_session_stats(g->s.session, &stats, sizeof stats) == HAP_OK);
  return stats.faults.fault;
}

static bool glove_holds(const glove *g)
{
  return g->force[0] != 0.0 || g->force[1] != 0.0 || g->force[2] != 0.0;
}

TEST(a_device_of_several_fingers_carries_a_pointer_on_each)
{
  glove_stage *g = glove_pressing();
  hap_pointer_state state;
  int reads = g->glove.reads;
  int writes = g->glove.writes;
  glove_run(g, 10); /* once a tick for all of them */
  CHECK(g->glove.reads == reads + 10 && g->glove.writes == writes + 10 && g->glove.starts == 1);
  for (uint32_t i = 0; i < FINGERS; ++i) {
    REQUIRE(hap_pointer_get(g->s.session, g->fingers[i], &state, sizeof state) == HAP_OK);
    CHECK(state.buttons == 1u << i);
    CHECK_NEAR(state.device.position[0], 0.1 * i, 0.0);
    CHECK_NEAR(state.wrench.force[2], STIFFNESS * 0.001 * (i + 1), 1e-9);
  }
  for (int i = 0; i < 100; ++i) { /* each has its own limit */
    g->glove.height[0] -= 1e-4;
    g->glove.height[2] -= 1e-4;
    glove_run(g, 1);
  }
  CHECK_NEAR(g->glove.force[0], 4.0, 1e-9);
  CHECK_NEAR(g->glove.force[2], 6.0, 1e-9);
}

TEST(a_finger_leaves_and_comes_while_the_others_push)
{
  glove_stage *g = glove_pressing();
  int zeros = g->glove.zeros;
  CHECK(hap_pointer_remove(g->s.session, g->fingers[0]) == HAP_OK);
  CHECK(g->glove.stops == 0 && g->glove.zeros == zeros);
  glove_run(g, 1);
  CHECK(g->glove.force[0] == 0.0);
  CHECK_NEAR(g->glove.force[1], STIFFNESS * 0.002, 1e-9);
  CHECK_NEAR(g->glove.force[2], STIFFNESS * 0.003, 1e-9);
  CHECK(finger_add(g, 0) == HAP_OK && g->glove.starts == 1);
  glove_run(g, 200);
  CHECK_NEAR(g->glove.force[0], STIFFNESS * 0.001, 1e-9);
  for (uint32_t i = 0; i < FINGERS; ++i) {
    CHECK(hap_pointer_remove(g->s.session, g->fingers[i]) == HAP_OK);
    CHECK(g->glove.stops == (i == FINGERS - 1 ? 1 : 0));
  }
  CHECK(!glove_holds(&g->glove) && g->glove.zeros > zeros);
}

TEST(a_fault_of_a_device_takes_the_force_of_all_its_fingers)
{
  for (int kind = 0; kind < 4; ++kind) {
    static const hap_fault faults[] = {HAP_FAULT_DEVICE_READ, HAP_FAULT_DEVICE_WRITE,
                                       HAP_FAULT_DEVICE_POSE, HAP_FAULT_EMERGENCY};
    glove_stage *g = glove_pressing();
    g->glove.fails_read = kind == 0;
    g->glove.fails_write = kind == 1;
    g->glove.bad_pose = kind == 2;
    if (kind == 3) {
      hap_emergency_zero();
    }
    glove_run(g, kind == 2 ? 30 : 1); /* a pose that is not finite fades out */
    CHECK(!glove_holds(&g->glove));
    CHECK(fault_of(g) == faults[kind]);
    g->glove.fails_read = g->glove.fails_write = g->glove.bad_pose = false;
    glove_run(g, 20);
    CHECK(!glove_holds(&g->glove));
    CHECK(hap_session_reset_fault(g->s.session) >= HAP_OK);
    glove_run(g, 100);
    CHECK_NEAR(g->glove.force[2], STIFFNESS * 0.003, 1e-9);
    tap_release(g);
  }
}

TEST(a_restart_of_one_finger_is_one_of_the_device)
{
  glove_stage *g = glove_pressing();
  CHECK(hap_pointer_restart(g->s.session, g->fingers[1]) == HAP_OK);
  CHECK(g->glove.starts == 2 && g->glove.stops == 1 && !glove_holds(&g->glove));
  glove_run(g, 200);
  for (uint32_t k = 0; k < FINGERS; ++k) {
    CHECK_NEAR(g->glove.force[k], STIFFNESS * 0.001 * (k + 1), 1e-9);
  }
  hap_session_stop(g->s.session);
  CHECK(g->glove.stops == 2);
}

TEST(an_end_effector_has_one_pointer_and_a_device_one_session)
{
  glove_stage *g = glove_new();
  hap_session *second = NULL;
  hap_session *first = g->s.session;
  hap_device *outer = NULL;
  hap_detail detail = {""};
  CHECK(finger_add(g, 1) == HAP_ERROR_STATE);
  CHECK(finger_add(g, FINGERS) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_detail(first, &detail) >= HAP_OK && strstr(detail.text, "effector") != NULL);
  CHECK(hap_pointer_remove(first, g->fingers[1]) == HAP_OK);
  CHECK(hap_device_wrap(g->s.device, &bare_ops, NULL, &outer, NULL) == HAP_ERROR_STATE);
  dWorldID world = g->s.world;
  dSpaceID space = g->s.space;
  ode_world_make(9.81, &g->s.world, &g->s.space);
  own_session(&g->s);
  second = g->s.session;
  CHECK(finger_add(g, 1) == HAP_ERROR_STATE); /* the others are the first session's */
  hap_pointer_id fingers[] = {g->fingers[0], g->fingers[2]};
  CHECK(hap_pointer_remove(first, fingers[0]) == HAP_OK);
  CHECK(hap_pointer_remove(first, fingers[1]) == HAP_OK);
  CHECK(finger_add(g, 1) == HAP_OK && g->s.session == second);
  ode_world_end(first, world, space);
}

/* A device with one end effector, and a pointer without a device, have the first one alone. */
TEST(the_first_end_effector_is_the_only_one_of_others)
{
  own_stage *s = own_stage_new();
  hap_pointer_def def;
  REQUIRE(hap_device_create(&own_ops, &s->hand, &s->device, NULL) == HAP_OK);
  own_session(s);
  hap_pointer_def_init(&def, sizeof def);
  def.effector = 1;
  CHECK(hap_pointer_add(s->session, &def, &s->pointer) == HAP_ERROR_ARGUMENT);
  def.device = s->device;
  CHECK(hap_pointer_add(s->session, &def, &s->pointer) == HAP_ERROR_ARGUMENT);
  def.effector = 0;
  CHECK(hap_pointer_add(s->session, &def, &s->pointer) == HAP_OK);
}

/* ---- recordings ---- */

#define WAVE_HZ 5.0

/* Fingers that go down into the floor and up again, each by another way. */
static hap_status wave_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  glove *g = self;
  double t = 1e-9 * (double)time_ns;
  for (uint32_t i = 0; i < FINGERS; ++i) {
    g->height[i] = RADIUS + 0.003 * cos(6.28 * WAVE_HZ * t + i);
  }
  return glove_read(self, time_ns, out);
}

static void wave_wait(void)
{
  const struct timespec wait = {.tv_nsec = 100000000};
  (void)nanosleep(&wait, NULL);
}

/* Fingers leave, come, are started again with their device, and lose it: the replay, without the
 * device, has all of it. */
TEST(a_replay_has_all_fingers_of_a_device)
{
  static hap_device_ops ops; /* there until the stage has closed its device */
  hap_detail why = {""};
  hap_record_def file;
  hap_player *player = NULL;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  ops = glove_ops;
  ops.read = wave_read;
  ops.pacing = HAP_PACING_HOST;
  REQUIRE(folder_make());
  hap_record_def_init(&file, sizeof file);
  file.path = folder_path("fingers.rec");
  glove_stage *g = tap_own(sizeof *g, glove_stage_end);
  ode_world_make(9.81, &g->s.world, &g->s.space);
  dCreatePlane(g->s.space, 0.0, 0.0, 1.0, 0.0);
  REQUIRE(hap_device_create(&ops, &g->glove, &g->s.device, NULL) == HAP_OK);
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  def.rt_priority = 0;
  ode.world = g->s.world;
  ode.space = g->s.space;
  g->s.session = session_make(&def, &ode);
  REQUIRE_SAY(hap_session_record(g->s.session, &file, &why) == HAP_OK, "%s", why.text);
  REQUIRE(finger_add(g, 2) == HAP_OK && finger_add(g, 0) == HAP_OK);
  REQUIRE(hap_session_start(g->s.session) >= HAP_OK);
  wave_wait();
  REQUIRE(finger_add(g, 1) == HAP_OK);
  wave_wait();
  CHECK(hap_pointer_remove(g->s.session, g->fingers[2]) == HAP_OK);
  wave_wait();
  CHECK(finger_add(g, 2) == HAP_OK);
  CHECK(hap_pointer_restart(g->s.session, g->fingers[1]) == HAP_OK);
  wave_wait();
  hap_emergency_zero();
  wave_wait();
  CHECK(hap_session_reset_fault(g->s.session) >= HAP_OK);
  wave_wait();
  hap_stats stats;
  CHECK(hap_session_stop(g->s.session) == HAP_OK);
  REQUIRE(hap_session_stats(g->s.session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.loop.contact_ticks > 50 && stats.faults.count == 1);
  tap_release(g);

  own_stage *r = own_stage_new();
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  REQUIRE(hap_player_open(file.path, HAP_PLAY_WHOLE, &player, &why) >= HAP_OK);
  REQUIRE(hap_player_get_def(player, &def, &expert, &research) >= HAP_OK);
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = r->world;
  ode.space = r->space;
  r->session = session_make(&def, &ode);
  REQUIRE(hap_session_play(r->session, player, &why) >= HAP_OK);
  session_run(r->session);
  hap_status status = HAP_OK;
  while (status == HAP_OK || status == HAP_FAULTED) {
    status = hap_session_advance(r->session, 100);
  }
  (void)hap_session_detail(r->session, &why);
  CHECK_SAY(status == HAP_END, "%s", why.text);
  const uint64_t ticks = stats.loop.ticks;
  REQUIRE(hap_session_stats(r->session, &stats, sizeof stats) == HAP_OK);
  CHECK(stats.loop.ticks == ticks && stats.faults.count == 1);
  hap_session_destroy(r->session);
  r->session = NULL;
  hap_player_close(player);
}
