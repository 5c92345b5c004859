/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a device measures beyond its pose, and gives beside its wrench: by the public headers. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include <hapode/device_impl.h>

#include "tests/files.h"
#include "tests/ode_world.h"

#define LOW (-0.01) /* of the gripper */
#define HIGH 0.07
#define RANGE (HIGH - LOW)
#define AXIS_FORCE 8.0
#define TURN_HIGH 2.0 /* rad, of the second axis */
#define TAU 6.283185307179586

/* ---- a device with a gripper and a wheel, of the test's own ---- */

typedef struct grip {
  double at[2];
  double rate[2];
  double height; /* m, of the hand */
  hap_status status;
  bool device_paced;
  hap_device_output last; /* written since the last zero */
  int zeros;
} grip;

static hap_status grip_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)args, (void)detail;
  *self = context;
  return HAP_OK;
}

static void grip_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self, (void)effector;
  out->dof = 3;
  out->max_force = 10.0;
  out->axis_count = 2;
  out->led_count = 3;
  out->vibrator_count = 1;
  out->vibrator_hz[0] = 50.0;
  out->vibrator_hz[1] = 300.0;
  out->workspace_low[0] = -0.1;
  out->workspace_high[0] = 0.3;
  out->workspace_low[1] = out->workspace_low[2] = -0.1;
  out->workspace_high[1] = out->workspace_high[2] = 0.1;
}

static void grip_describe_axis(void *self, uint32_t effector, uint32_t axis, hap_axis_info *out)
{
  (void)self, (void)effector;
  out->kind = axis == 0 ? HAP_AXIS_GRIPPER : HAP_AXIS_OTHER;
  out->unit = axis == 0 ? HAP_AXIS_METRES : HAP_AXIS_RADIANS;
  out->low = axis == 0 ? LOW : 0.0;
  out->high = axis == 0 ? HIGH : TURN_HIGH;
  out->max_force = axis == 0 ? AXIS_FORCE : 0.0;
}

static hap_status grip_start(void *self)
{
  grip *g = self;
  memset(&g->last, 0, sizeof g->last);
  return HAP_OK;
}

static hap_status grip_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  const grip *g = self;
  (void)time_ns;
  out[0]->pose = (hap_pose){{0.0, 0.0, g->height}, {1.0, 0.0, 0.0, 0.0}};
  memset(&out[0]->twist, 0, sizeof out[0]->twist);
  out[0]->buttons = 0;
  for (int i = 0; i < 2; ++i) {
    out[0]->axes[i] = g->at[i];
    out[0]->axis_rates[i] = g->rate[i];
  }
  return g->status;
}

static hap_status grip_write(void *self, const hap_device_output *const wanted[],
                             hap_device_output *const reached[])
{
  grip *g = self;
  g->last = *wanted[0];
  reached[0]->wrench = wanted[0]->wrench;
  memcpy(reached[0]->axis_forces, wanted[0]->axis_forces, sizeof reached[0]->axis_forces);
  return HAP_OK;
}

static void grip_zero(void *self)
{
  grip *g = self;
  ++g->zeros;
  memset(&g->last, 0, sizeof g->last);
}

static void grip_close(void *self)
{
  (void)self;
}

static const hap_device_ops grip_ops = {.abi = HAP_DEVICE_ABI,
                                        .size = sizeof(hap_device_ops),
                                        .name = "grip",
                                        .help = "a gripper and a wheel",
                                        .pacing = HAP_PACING_VIRTUAL,
                                        .open = grip_open,
                                        .describe = grip_describe,
                                        .start = grip_start,
                                        .read = grip_read,
                                        .write = grip_write,
                                        .zero = grip_zero,
                                        .stop = grip_zero,
                                        .close = grip_close,
                                        .describe_axis = grip_describe_axis};

/* ---- a session around a device ---- */

typedef struct bench {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_device *device;
  hap_pointer_id hand;
  grip grip;
  hap_session_def def;
} bench;

static void bench_end(void *owned)
{
  bench *b = owned;
  ode_world_end(b->session, b->world, b->space);
  hap_device_close(b->device);
}

static bench *bench_bare(void)
{
  bench *b = tap_own(sizeof *b, bench_end);
  ode_world_make(9.81, &b->world, &b->space);
  dCreatePlane(b->space, 0.0, 0.0, 1.0, 0.0);
  b->grip.height = 0.1;
  b->grip.at[0] = 0.05;
  hap_session_def_init(&b->def, sizeof b->def);
  b->def.drive = HAP_DRIVE_LOCKSTEP;
  return b;
}

static void bench_session(bench *b)
{
  hap_ode_def ode;
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = b->world;
  ode.space = b->space;
  b->session = session_make(&b->def, &ode);
}

static void bench_hand(bench *b)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.device = b->device;
  REQUIRE(hap_pointer_add(b->session, &def, &b->hand) == HAP_OK);
}

/* spec NULL: the test's own. */
static bench *bench_new(const char *spec)
{
  hap_detail why = {""};
  bench *b = bench_bare();
  hap_status status = spec != NULL ? hap_device_open(spec, &b->device, &why)
                                   : hap_device_create(&grip_ops, &b->grip, &b->device, &why);
  REQUIRE_SAY(status == HAP_OK, "%s", why.text);
  bench_session(b);
  bench_hand(b);
  session_run(b->session);
  return b;
}

static void bench_run(bench *b, uint32_t ticks)
{
  REQUIRE(hap_session_advance(b->session, ticks) >= HAP_OK);
}

static hap_pointer_state hand_state(const bench *b)
{
  hap_pointer_state state;
  memset(&state, 0, sizeof state);
  CHECK(hap_pointer_get(b->session, b->hand, &state, sizeof state) == HAP_OK);
  return state;
}

static hap_fault bench_fault(const bench *b)
{
  return (hap_fault)session_stats(b->session).faults.fault;
}

/* ---- what is read ---- */

TEST(the_state_of_a_pointer_has_the_axes_of_its_device)
{
  bench *b = bench_new(NULL);
  b->grip.at[0] = 0.031;
  b->grip.rate[0] = -0.2;
  b->grip.at[1] = 0.05;
  b->grip.rate[1] = 1.5;
  bench_run(b, 10);
  hap_pointer_state state = hand_state(b);
  CHECK(state.axis_count == 2);
  CHECK(state.axes[0] == 0.031 && state.axis_rates[0] == -0.2);
  CHECK(state.axes[1] == 0.05 && state.axis_rates[1] == 1.5);
  CHECK(state.axes[2] == 0.0 && (state.guard & HAP_GUARD_INPUT) == 0);
}

TEST(a_virtual_gripper_follows_its_script)
{
  hap_device_info info;
  hap_axis_info axis;
  bench *b = bench_new("virtual:gripper=0:0.04,gripper_sine=0.03,gripper_hz=2,leds=2,vibrators=1");
  CHECK(hap_device_get_info(b->device, &info, sizeof info) == HAP_OK);
  CHECK(info.axis_count == 1 && info.led_count == 2 && info.vibrator_count == 1);
  CHECK(hap_device_get_axis(b->device, 0, 0, &axis, sizeof axis) == HAP_OK);
  CHECK(axis.kind == HAP_AXIS_GRIPPER && axis.low == 0.0 && axis.high == 0.08);
  int64_t begin_ns = 0;
  for (int i = 0; i < 700; ++i) {
    bench_run(b, 1);
    hap_pointer_state state = hand_state(b);
    begin_ns = i == 0 ? state.stamp_ns : begin_ns;
    double turn = TAU * 2.0 * 1e-9 * (double)(state.stamp_ns - begin_ns);
    REQUIRE(state.axis_count == 1);
    CHECK_NEAR(state.axes[0], 0.04 + 0.03 * sin(turn), 1e-12);
    CHECK_NEAR(state.axis_rates[0], 0.03 * TAU * 2.0 * cos(turn), 1e-12);
  }
}

TEST(a_virtual_gripper_says_what_it_does_not_understand)
{
  static const char *const wrong[] = {"virtual:gripper=0:0.04/1",
                                      "virtual:gripper=1",
                                      "virtual:gripper_hz=2",
                                      "virtual:gripper_force=3",
                                      "virtual:gripper_max=0.1",
                                      "virtual:gripper_sine=nan",
                                      "virtual:leds=33",
                                      "virtual:leds=1.5",
                                      "virtual:vibrators=5",
                                      "virtual:gripper=1:0;0:0.1",
                                      "virtual:gripper=0:0;1:1,loop=1"};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    hap_device *device = NULL;
    hap_detail why = {""};
    CHECK_SAY(hap_device_open(wrong[i], &device, &why) == HAP_ERROR_ARGUMENT, "%s", wrong[i]);
    CHECK(device == NULL && strstr(why.text, "virtual") != NULL);
  }
}

/* A spike of one tick, a value beyond the range, a rate that is none: the value before stands, and
 * the hand's force stays. */
TEST(a_false_value_is_not_taken_over)
{
  static const double false_at[] = {0.02, HIGH + 0.1 * RANGE, LOW - 0.1 * RANGE,
                                    NAN,  INFINITY,           0.05};
  static const double false_rate[] = {0.0, 0.0, 0.0, 0.0, 0.0, -NAN};
  bench *b = bench_new(NULL);
  bench_run(b, 50);
  for (size_t i = 0; i < sizeof false_at / sizeof false_at[0]; ++i) {
    b->grip.at[0] = false_at[i];
    b->grip.rate[0] = false_rate[i];
    bench_run(b, 1);
    hap_pointer_state state = hand_state(b);
    CHECK_SAY(state.axes[0] == 0.05 && state.axis_rates[0] == 0.0, "%zu: %g", i, state.axes[0]);
    CHECK((state.guard & HAP_GUARD_INPUT) != 0);
    b->grip.at[0] = 0.05;
    b->grip.rate[0] = 0.1;
    bench_run(b, 20);
    CHECK(hand_state(b).axis_rates[0] == 0.1);
    b->grip.rate[0] = 0.0;
  }
  CHECK(bench_fault(b) == HAP_FAULT_NONE);
  b->grip.at[0] = HIGH; /* a little beyond is the end of the range */
  for (int i = 0; i < 10; ++i) {
    b->grip.at[0] = HIGH + 0.04 * RANGE * i / 10.0;
    bench_run(b, 1);
  }
  CHECK(hand_state(b).axes[0] == HIGH && bench_fault(b) == HAP_FAULT_NONE);
}

/* A value that stays at another place is believed after 3 ms; noise takes the force and is a
 * fault, as noise of the pose. */
TEST(an_axis_that_jumps_is_believed_and_one_of_noise_is_a_fault)
{
  bench *b = bench_new(NULL);
  bench_run(b, 50);
  b->grip.at[0] = 0.01;
  bench_run(b, 3);
  CHECK(hand_state(b).axes[0] == 0.05);
  bench_run(b, 1);
  CHECK(hand_state(b).axes[0] == 0.01 && bench_fault(b) == HAP_FAULT_NONE);
  bench_run(b, 500);
  int ticks = 0;
  while (bench_fault(b) == HAP_FAULT_NONE && ticks < 100) {
    b->grip.at[0] = ++ticks % 2 == 0 ? 0.06 : 0.03;
    bench_run(b, 1);
  }
  CHECK(bench_fault(b) == HAP_FAULT_DEVICE_INPUT);
  CHECK_SAY(ticks >= 15 && ticks <= 20, "%d", ticks);
  CHECK(hand_state(b).axes[0] == 0.01);
  b->grip.at[0] = 0.03;
  bench_run(b, 20);
  CHECK(hap_session_reset_fault(b->session) >= HAP_OK);
  bench_run(b, 20);
  CHECK(bench_fault(b) == HAP_FAULT_NONE && hand_state(b).axes[0] == 0.03);
}

/* Whole range in 10 ms is a trigger that snaps back. Twice as fast is none. */
TEST(the_fastest_axis_is_followed)
{
  bench *b = bench_new(NULL);
  b->grip.at[0] = LOW;
  bench_run(b, 50);
  for (int i = 1; i <= 10; ++i) {
    b->grip.at[0] = LOW + 0.0999 * RANGE * i;
    bench_run(b, 1);
    CHECK_NEAR(hand_state(b).axes[0], b->grip.at[0], 0.0);
  }
  for (int i = 1; i <= 5; ++i) {
    b->grip.at[0] = LOW + 0.999 * RANGE - 0.19 * RANGE * i;
    bench_run(b, 1);
    CHECK(hand_state(b).axes[0] == LOW + 0.0999 * RANGE * 10);
  }
}
