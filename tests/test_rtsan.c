/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* No allocation and no lock on the haptic thread, seen by LLVM's real-time sanitizer, whose runtime
 * catches the calls of a region between enter and exit. Linked with HAPODE_RTSAN where
 * libclang_rt.rtsan is (Debian: libclang-rt-19-dev). */

#include "tests/tap.h"

#include <hapode/hapode.h>

#ifndef HAPODE_RTSAN

TEST(haptic_cycle_neither_allocates_nor_locks)
{
  SKIP("needs libclang_rt.rtsan of libclang-rt-19-dev (and no other sanitizer)");
}

int main(void)
{
  RUN(haptic_cycle_neither_allocates_nor_locks);
  return tap_done();
}

#else

#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/vec.h"
#include "haptic/haptic.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "sync/exchange.h"
#include "tick/report.h"

#define TICKS 10000
#define TICK_NS 1000000LL

void __rtsan_init(void);           /* NOLINT: LLVM's names */
void __rtsan_realtime_enter(void); /* NOLINT */
void __rtsan_realtime_exit(void);  /* NOLINT */

/* Runs work in a process of its own, within a real-time region; true when it came to its end. The
 * sanitizer's report, if any, goes to the TAP stream as a comment. */
static bool runs_clean(void (*work)(void), bool show)
{
  int ends[2];
  char line[200];
  fflush(stdout);
  if (pipe(ends) != 0) {
    return false;
  }
  pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], 2);
    close(ends[0]);
    close(ends[1]);
    work();
    _exit(0);
  }
  close(ends[1]);
  FILE *report = fdopen(ends[0], "r");
  while (report != NULL && fgets(line, sizeof line, report) != NULL) {
    if (show) {
      printf("# %s", line);
    }
  }
  fclose(report);
  int status = -1;
  return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static void *volatile sink;

static void heap_allocate(void)
{
  __rtsan_realtime_enter();
  sink = malloc(16);
  __rtsan_realtime_exit();
}

static void heap_release(void)
{
  sink = malloc(16);
  __rtsan_realtime_enter();
  free(sink);
  __rtsan_realtime_exit();
}

static void take_mutex(void)
{
  static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
  __rtsan_realtime_enter();
  pthread_mutex_lock(&mutex);
  __rtsan_realtime_exit();
}

static void violate_nothing(void)
{
  __rtsan_realtime_enter();
  sink = NULL;
  __rtsan_realtime_exit();
}

TEST(the_sanitizer_catches_what_it_should)
{
  CHECK(runs_clean(violate_nothing, true));
  CHECK(!runs_clean(heap_allocate, false));
  CHECK(!runs_clean(heap_release, false));
  CHECK(!runs_clean(take_mutex, false));
}

static hapi_exchange *exchange;
static hapi_haptic *haptic;
static hap_device *devices[3];

/* A body and a wall, met by two pointers with virtual devices. */
static void publish_model(uint64_t number)
{
  hapi_model *model = hapi_exchange_model_back(exchange);
  model->number = number;
  model->state_ns = model->valid_from_ns = (int64_t)number * 10 * TICK_NS;
  static const hap_model models[] = {HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE, HAP_MODEL_CONTACT};
  model->model = models[number / 100 % 3];
  model->blend_s = 0.01;
  model->body_count = 1;
  model->contact_count = 2;
  hapi_model_body *body = hapi_model_bodies(model);
  memset(body, 0, sizeof *body);
  body->generation = 1;
  body->pose.quat_wxyz[0] = 1.0;
  body->flags = HAPI_BODY_OWNED | HAPI_BODY_GYROSCOPIC; /* which model CONTACT alone looks at */
  body->mass = body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = 1e9;
  body->gravity[2] = -9.81;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = 1e-3 * (1 + i);
    body->inverse_inertia[4 * i] = 1.0 / body->inertia[4 * i];
  }
  hapi_model_contact *contacts = hapi_model_contacts(model);
  memset(contacts, 0, 2 * sizeof *contacts);
  for (uint32_t i = 0; i < 2; ++i) {
    contacts[i].slot = i;
    contacts[i].generation = contacts[i].pointer_generation = 1;
    contacts[i].pointer = i;
    contacts[i].body = i == 0 ? 0 : HAPI_SLOT_NONE;
    contacts[i].normal_body[0] = -1.0;
    contacts[i].point_body[0] = 0.01;
    contacts[i].a[0][0] = 1.0;
  }
  hapi_exchange_model_publish(exchange);
}

#define TOOL_HALF 0.01 /* m, of the third pointer, a cube */

/* Its lower face against a floor of its own, with friction; now and then it is found to have
 * other points. */
static void publish_tool(hapi_patches *patches)
{
  hapi_tool_point *tools = hapi_patches_tools(patches);
  patches->tool_count = 4;
  memset(tools, 0, 4 * sizeof *tools);
  for (uint32_t i = 0; i < 4; ++i) {
    double half = patches->number % 7 == 0 ? 0.5 * TOOL_HALF : TOOL_HALF;
    tools[i].pointer = 2;
    tools[i].pointer_generation = 1;
    tools[i].same_within = 0.002;
    tools[i].mu = 0.5;
    tools[i].at.key = 7;
    tools[i].at.body_a = tools[i].at.body_b = HAPI_SLOT_NONE;
    tools[i].at.touch = HAPI_TOUCH_FACE_B;
    hapi_v3_set(tools[i].at.core_a, i % 2 != 0 ? half : -half, i / 2 != 0 ? half : -half,
                -TOOL_HALF);
    hapi_v3_set(tools[i].at.core_b, 0.0, 0.0, -0.05);
    tools[i].at.normal[2] = 1.0;
  }
}

/* Four corners of the body on a floor with friction, and a ball of it. */
static void publish_patches(uint64_t number)
{
  hapi_patches *patches = hapi_exchange_patches_back(exchange);
  hapi_patch_contact *contacts = hapi_patches_contacts(patches);
  patches->number = patches->model_number = number;
  patches->valid_from_ns = 0;
  patches->contact_count = 5;
  patches->surface_count = 1;
  memset(contacts, 0, 5 * sizeof *contacts);
  for (uint32_t i = 0; i < 5; ++i) {
    contacts[i].key = 1;
    contacts[i].generation_a = 1;
    contacts[i].body_b = HAPI_SLOT_NONE;
    contacts[i].touch = i < 4 ? HAPI_TOUCH_FACE_B : HAPI_TOUCH_BALL_A;
    hapi_v3_set(contacts[i].core_a, i % 2 != 0 ? 0.02 : -0.02, i / 2 != 0 ? 0.02 : -0.02, -0.02);
    hapi_v3_set(contacts[i].core_b, 0.0, 0.0, -0.02);
    contacts[i].normal[2] = 1.0;
    contacts[i].ball_a = i < 4 ? 0.0 : 0.01;
    contacts[i].shape.kind = HAPI_SHAPE_PLANE;
    contacts[i].shape_pose = (hap_pose){{0.0, 0.0, -0.03}, {1.0, 0.0, 0.0, 0.0}};
  }
  *hapi_patches_surfaces(patches) =
      (hapi_surface){.flags = HAPI_SURFACE_APPROX1_1 | HAPI_SURFACE_APPROX1_2,
                     .mu = 0.5,
                     .mu2 = 0.5,
                     .erp = 0.01,
                     .max_push = 1.0};
  publish_tool(patches);
  hapi_exchange_patches_publish(exchange);
}

static bool set_up(void)
{
  static const char *const specs[3] = {
      "virtual:sine=0.02/0/0,hz=2,hand=tense", "virtual:path=0:-0.1/0/0;5:0.02/0/0",
      "virtual:dof=6,path=0:0/0/0;2:0/0/-0.042;10:0.1/0/-0.042,turn=0:0/0/0;10:0/0/1"};
  static double corners[8][3];
  const hapi_capacity capacity = {.bodies = 16,
                                  .contacts = 16,
                                  .pointers = 4,
                                  .geoms = 16,
                                  .hull_points = 64,
                                  .tool_points = 8};
  hap_detail detail;
  if (hapi_exchange_create(&capacity, &exchange) != HAP_OK) {
    return false;
  }
  hapi_haptic_config config = {.capacity = capacity,
                               .haptic_hz = 1000.0,
                               .lockstep = true,
                               .trace_rows = 1000,
                               .exchange = exchange};
  bool good = hapi_haptic_create(&config, &haptic) == HAP_OK;
  for (int i = 0; i < 24; ++i) {
    corners[i / 3][i % 3] = (i / 3 >> i % 3 & 1) != 0 ? TOOL_HALF : -TOOL_HALF;
  }
  for (int i = 0; i < 3 && good; ++i) {
    hap_pointer_def def;
    hap_pointer_id id;
    hap_pointer_def_init(&def, sizeof def);
    good = hap_device_open(specs[i], &devices[i], &detail) == HAP_OK;
    def.device = devices[i];
    if (i == 2) {
      def.hull_xyz = &corners[0][0];
      def.hull_points = 8;
      def.radius = 0.0;
      def.finger_radius = 0.005;
    }
    hapi_pointer_setup setup;
    good = good && hapi_session_read_pointer(&def, &setup, &detail) == HAP_OK &&
           hapi_haptic_add_pointer(haptic, &setup, &id, &detail) == HAP_OK;
  }
  return good && hapi_haptic_begin(haptic, 0, &detail) == HAP_OK;
}

static void physics_cycles(void)
{
  int rubbed = 0; /* ticks in which the tool feels friction, in model CONTACT */
  for (int i = 0; i < TICKS; ++i) {
    if (i % 10 == 0) {
      publish_model((uint64_t)i / 10 + 1);
      publish_patches((uint64_t)i / 10 + 1);
    }
    __rtsan_realtime_enter();
    hapi_haptic_cycle(haptic, i * TICK_NS);
    __rtsan_realtime_exit();
    const double *force = haptic->tick.pointers.of[2].wrench.force;
    rubbed += hypot(force[0], force[1]) > 0.1 * force[2] && force[2] > 1.0;
  }
  hap_stats stats;
  memset(&stats, 0, sizeof stats);
  hapi_haptic_stats(haptic, &stats);
  if (rubbed < 500 || stats.loop.ticks != TICKS || stats.loop.contact_ticks < 100 ||
      stats.loop.models_adopted < 900 || stats.contact.passes < 900 ||
      stats.contact.sweeps < 1000) {
    fprintf(stderr, "the loop did not do its work\n");
    _exit(1);
  }
}

/* The ring is full after a tenth of them. */
static void recorded_cycles(void)
{
  static hapi_tape tape;
  static _Atomic int ended;
  if (hapi_tape_create(&tape, TICKS, &ended) != HAP_OK) {
    _exit(1);
  }
  hapi_haptic_set_tape(haptic, &tape);
  physics_cycles();
  if (atomic_load(&tape.written) < TICKS / 2 || atomic_load(&ended) != HAPI_RECORD_OVERFLOW ||
      atomic_load(&tape.lost) < TICKS / 2) {
    fprintf(stderr, "nothing was recorded\n");
    _exit(1);
  }
}

static void loop_ticks(void)
{
  __rtsan_realtime_enter();
  for (int i = 0; i < TICKS; ++i) {
    hapi_tick_run(&haptic->tick, i * TICK_NS);
    hapi_tick_report(&haptic->tick, hapi_exchange_state_back(exchange));
  }
  __rtsan_realtime_exit();
}

TEST(haptic_cycle_neither_allocates_nor_locks)
{
  REQUIRE(set_up());
  CHECK(runs_clean(physics_cycles, true));
  CHECK(runs_clean(recorded_cycles, true));
  CHECK(runs_clean(loop_ticks, true));
}

int main(void)
{
  setenv("RTSAN_OPTIONS", "halt_on_error=1", 0);
  __rtsan_init();
  RUN(the_sanitizer_catches_what_it_should);
  RUN(haptic_cycle_neither_allocates_nor_locks);
  hapi_haptic_destroy(haptic);
  hapi_exchange_destroy(exchange);
  hap_device_close(devices[0]);
  hap_device_close(devices[1]);
  hap_device_close(devices[2]);
  return tap_done();
}

#endif
