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
  bench_run(b, 20);
  CHECK((hand_state(b).guard & HAP_GUARD_INPUT) == 0);
  b->grip.at[0] = HIGH + 0.06 * RANGE; /* more than a little is false */
  bench_run(b, 1);
  CHECK((hand_state(b).guard & HAP_GUARD_INPUT) != 0);
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

/* ---- what is given ---- */

static hap_pointer_outputs outputs_none(void)
{
  hap_pointer_outputs outputs;
  hap_pointer_outputs_init(&outputs, sizeof outputs);
  return outputs;
}

static void outputs_set(const bench *b, const hap_pointer_outputs *outputs)
{
  hap_detail why = {""};
  bool good = hap_pointer_set_outputs(b->session, b->hand, outputs) == HAP_OK;
  (void)hap_session_detail(b->session, &why);
  REQUIRE_SAY(good, "%s", why.text);
}

/* 5 N at most, of a spring that holds the gripper at 40 mm. */
static hap_pointer_outputs spring_outputs(void)
{
  hap_pointer_outputs outputs = outputs_none();
  outputs.axes[0].stiffness = 200.0;
  outputs.axes[0].target = 0.04;
  outputs.axes[0].damping = 2.0;
  outputs.axes[0].max_force = 5.0;
  outputs.leds = 5;
  outputs.vibrators[0] = (hap_vibration){0.5, 120.0};
  return outputs;
}

TEST(outputs_are_written_beside_the_wrench)
{
  bench *b = bench_new(NULL);
  hap_pointer_outputs outputs = spring_outputs();
  bench_run(b, 50);
  CHECK(b->grip.last.leds == 0 && b->grip.last.axis_forces[0] == 0.0);
  outputs_set(b, &outputs);
  bench_run(b, 50);
  CHECK(b->grip.last.leds == 5 && b->grip.last.axis_forces[1] == 0.0);
  CHECK_NEAR(b->grip.last.axis_forces[0], 200.0 * (0.04 - 0.05), 1e-12);
  CHECK(hand_state(b).axis_forces[0] == b->grip.last.axis_forces[0]);
  CHECK_NEAR(b->grip.last.vibrators[0].amplitude, 0.5, 1e-12);
  CHECK(b->grip.last.vibrators[0].frequency == 120.0);
  for (int i = 0; i < 30; ++i) { /* at 0.5 m/s, towards closed: spring and damper */
    b->grip.at[0] -= 5e-4;
    b->grip.rate[0] = -0.5;
    bench_run(b, 1);
    double wanted = 200.0 * (0.04 - b->grip.at[0]) + 2.0 * 0.5;
    CHECK_NEAR(b->grip.last.axis_forces[0], wanted, 1e-9);
  }
  b->grip.rate[0] = 0.0;
  for (int i = 0; i < 30; ++i) { /* further: to what was promised */
    b->grip.at[0] -= 0.8e-3;
    bench_run(b, 1);
  }
  CHECK_NEAR(b->grip.last.axis_forces[0], 5.0, 1e-12);
  CHECK(hap_session_stop(b->session) == HAP_OK);
  CHECK(b->grip.last.axis_forces[0] == 0.0 && b->grip.last.vibrators[0].amplitude == 0.0);
  session_run(b->session); /* they stay, and come in over 20 ms */
  bench_run(b, 10);
  CHECK(fabs(b->grip.last.axis_forces[0]) < 0.7 * 5.0);
  bench_run(b, 50);
  CHECK_NEAR(b->grip.last.axis_forces[0], 5.0, 1e-12);
  CHECK(hap_pointer_restart(b->session, b->hand) == HAP_OK);
  CHECK(b->grip.last.axis_forces[0] == 0.0);
  bench_run(b, 80);
  CHECK_NEAR(b->grip.last.axis_forces[0], 5.0, 1e-12);
}

/* From +5 to -5 N in 20 ms, and no tick more than a line would. A fault cannot be faster than 2 ms
 * from the axis's own limit. */
TEST(a_change_of_outputs_does_not_leap)
{
  bench *b = bench_new(NULL);
  hap_pointer_outputs outputs = outputs_none();
  outputs.axes[0].force = 5.0;
  outputs.axes[0].max_force = 5.0;
  outputs.axes[0].max_power = 10.0;
  outputs_set(b, &outputs);
  bench_run(b, 100);
  CHECK_NEAR(b->grip.last.axis_forces[0], 5.0, 1e-12);
  for (int k = 0; k < 6; ++k) {
    double before = b->grip.last.axis_forces[0];
    outputs.axes[0].force = -outputs.axes[0].force;
    outputs_set(b, &outputs);
    for (int i = 0; i < 30; ++i) {
      bench_run(b, 1);
      double now = b->grip.last.axis_forces[0];
      CHECK(fabs(now - before) <= 10.0 / 20.0 + 1e-9);
      CHECK(fabs(now) <= 5.0 + 1e-12);
      before = now;
    }
    CHECK_NEAR(before, outputs.axes[0].force, 1e-12);
  }
  b->grip.at[0] = 0.02; /* a jump of the axis moves nothing but the spring, which comes slowly */
  outputs = spring_outputs();
  outputs_set(b, &outputs);
  bench_run(b, 50);
  double before = b->grip.last.axis_forces[0];
  b->grip.at[0] = 0.06;
  for (int i = 0; i < 60; ++i) {
    bench_run(b, 1);
    CHECK(fabs(b->grip.last.axis_forces[0] - before) <= 8.0 / 20.0 + 1e-9);
    before = b->grip.last.axis_forces[0];
  }
  CHECK_NEAR(before, 200.0 * (0.04 - 0.06), 1e-12);
}

#define HELD 4.5 /* N: more than a tick takes off at the slew limit */

static void grip_hold(bench *b)
{
  hap_pointer_outputs outputs = spring_outputs();
  outputs.axes[0].stiffness = 100.0 * HELD;
  outputs_set(b, &outputs);
  bench_run(b, 60);
  CHECK_NEAR(b->grip.last.axis_forces[0], -HELD, 1e-12);
  CHECK_NEAR(b->grip.last.vibrators[0].amplitude, 0.5, 1e-12);
}

static bool grip_gives(const bench *b)
{
  return b->grip.last.axis_forces[0] != 0.0 || b->grip.last.vibrators[0].amplitude != 0.0;
}

/* At once where the device or somebody has taken the force, else within a slew. */
TEST(a_fault_takes_outputs_off)
{
  for (int kind = 0; kind < 4; ++kind) {
    static const int ticks[] = {1, 1, 30, 25};
    bench *b = bench_new(NULL);
    grip_hold(b);
    if (kind == 0) {
      hap_emergency_zero();
      CHECK(!grip_gives(b)); /* before any tick */
    }
    b->grip.status = kind == 1 ? HAP_ERROR_DEVICE : kind == 2 ? HAP_STALE : HAP_OK;
    b->grip.height = kind == 3 ? (double)NAN : b->grip.height;
    bench_run(b, (uint32_t)ticks[kind]);
    CHECK_SAY(!grip_gives(b), "%d: %g", kind, b->grip.last.axis_forces[0]);
    CHECK(bench_fault(b) != HAP_FAULT_NONE);
    CHECK(b->grip.last.leds == 5 || kind == 1); /* no force, and they may say why */
    b->grip.status = HAP_OK;
    b->grip.height = 0.1;
    bench_run(b, 30);
    CHECK(!grip_gives(b));
    CHECK(hap_session_reset_fault(b->session) >= HAP_OK);
    bench_run(b, 5);
    CHECK(fabs(b->grip.last.axis_forces[0]) < 0.5 * HELD); /* and back over 20 ms */
    bench_run(b, 60);
    CHECK_NEAR(b->grip.last.axis_forces[0], -HELD, 1e-12);
    tap_release(b);
  }
}

TEST(a_held_clutch_takes_outputs_off)
{
  bench *b = bench_new(NULL);
  grip_hold(b);
  CHECK(hap_pointer_clutch(b->session, b->hand, true) == HAP_OK);
  bench_run(b, 25);
  CHECK(!grip_gives(b));
  CHECK(hap_pointer_clutch(b->session, b->hand, false) == HAP_OK);
  bench_run(b, 60);
  CHECK_NEAR(b->grip.last.axis_forces[0], -HELD, 1e-12);
  CHECK(hap_pointer_remove(b->session, b->hand) == HAP_OK);
  CHECK(!grip_gives(b));
}

/* A finger that opens 80 mm in a second and closes again, under a constant force of 5 N that opens:
 * each way would be 0.4 J. Of a promised power and what is kept for 0.1 s the opening one gets no
 * more than that, and the closing one is held back with all of the force. */
TEST(an_axis_keeps_its_promise_of_power)
{
  static const double powers[] = {0.1, 0.0, 10.0};
  for (int k = 0; k < 3; ++k) {
    bench *b = bench_new(NULL);
    hap_pointer_outputs outputs = outputs_none();
    outputs.axes[0].force = outputs.axes[0].max_force = 5.0;
    outputs.axes[0].max_power = powers[k];
    outputs_set(b, &outputs);
    bench_run(b, 100);
    for (int way = 0; way < 4; ++way) {
      double work = 0.0;
      double speed = way % 2 == 0 ? -0.05 : 0.05;
      for (int i = 0; i < 1000; ++i) {
        double force = b->grip.last.axis_forces[0];
        b->grip.at[0] += speed * 1e-3;
        b->grip.rate[0] = speed;
        bench_run(b, 1);
        work += force * speed * 1e-3;
      }
      double most = 1.1 * powers[k] + 5.0 * 1e-4;
      CHECK_SAY(speed < 0.0 || work <= most, "%g W, way %d: %g J", powers[k], way, work);
      CHECK_SAY(work <= -0.99 * 0.25 || speed > 0.0, "%g W, way %d: %g J", powers[k], way, work);
      CHECK_SAY(work >= fmin(0.9 * powers[k], 0.99 * 0.25) || speed < 0.0, "%g", work);
      CHECK((hand_state(b).guard & HAP_GUARD_OWN) != 0 || speed < 0.0 || powers[k] > 1.0);
    }
    tap_release(b);
  }
}

/* 5 N at two ranges a second are 0.8 W, and in 0.1 s 80 mJ: of 250 mJ a gripper that opens by 50 mm
 * in 100 ms gets 160. */
TEST(without_a_promise_the_power_is_that_of_two_ranges_a_second)
{
  bench *b = bench_new(NULL);
  hap_pointer_outputs outputs = outputs_none();
  outputs.axes[0].force = outputs.axes[0].max_force = 5.0;
  b->grip.at[0] = 0.0;
  outputs_set(b, &outputs);
  bench_run(b, 500);
  double work = 0.0;
  for (int i = 0; i < 100; ++i) {
    work += b->grip.last.axis_forces[0] * 5e-4;
    b->grip.at[0] += 5e-4;
    b->grip.rate[0] = 0.5;
    bench_run(b, 1);
  }
  CHECK_NEAR(work, 0.8 * 0.1 + 0.08, 0.005);
}

/* Relaxed fingers of the virtual device against a spring: where both springs agree. */
TEST(fingers_yield_to_a_spring)
{
  bench *b = bench_new("virtual:hand=relaxed,gripper=0:0.06");
  hap_pointer_outputs outputs = outputs_none();
  outputs.axes[0].stiffness = 50.0;
  outputs.axes[0].target = 0.0;
  outputs.axes[0].max_force = 8.0;
  outputs_set(b, &outputs);
  bench_run(b, 3000);
  hap_pointer_state state = hand_state(b);
  CHECK_NEAR(state.axes[0], 100.0 * 0.06 / 150.0, 1e-5);
  CHECK_NEAR(state.axis_forces[0], -50.0 * state.axes[0], 1e-3);
}

/* Springs that no sampled loop can hold on so light a gripper, which nobody holds: it rattles, and
 * gets no more energy than is promised. Besides, the guard knows the way of the last tick alone: in
 * a tick the gripper of m may go on by F T^2 / m more. And of a
 * debt up to the largest force on 0.1 mm so much is forgiven in 0.1 s. */
TEST(a_spring_that_is_too_stiff_gives_what_it_promises_at_most)
{
  static const double stiffness[] = {1e3, 1e5, 1e9};
  const double tick = 8.0 * 8.0 * 1e-6 / 0.05; /* J */
  const double debt = 8.0 * 1e-4;
  for (int k = 0; k < 3; ++k) {
    bench *b = bench_new("virtual:hand=none,device_mass=0.1,gripper=0:0.06");
    hap_pointer_outputs outputs = outputs_none();
    outputs.axes[0].stiffness = stiffness[k];
    outputs.axes[0].target = 0.04;
    outputs.axes[0].max_force = 8.0;
    outputs.axes[0].max_power = 0.05;
    outputs_set(b, &outputs);
    bench_run(b, 1);
    double work = 0.0;
    double most = 0.0;
    hap_pointer_state before = hand_state(b);
    for (int i = 1; i <= 5000; ++i) {
      bench_run(b, 1);
      hap_pointer_state now = hand_state(b);
      work += before.axis_forces[0] * (now.axes[0] - before.axes[0]);
      before = now;
      most = fmax(most, work - 0.05 * (1e-3 * i + 0.1) - debt * (1.0 + 1e-2 * i) - tick);
    }
    CHECK_SAY(most <= 0.0, "%g N/m: %g J more than promised", stiffness[k], most);
    CHECK(bench_fault(b) == HAP_FAULT_NONE);
    tap_release(b);
  }
}

typedef struct wrong_outputs {
  void (*spoil)(hap_pointer_outputs *io);
  const char *names; /* in the detail */
} wrong_outputs;

static void spoil_led(hap_pointer_outputs *io)
{
  io->leds = 8;
}
static void spoil_vibrator(hap_pointer_outputs *io)
{
  io->vibrators[1].amplitude = 0.1;
}
static void spoil_amplitude(hap_pointer_outputs *io)
{
  io->vibrators[0].amplitude = 1.1;
}
static void spoil_frequency(hap_pointer_outputs *io)
{
  io->vibrators[0].frequency = NAN;
}
static void spoil_axis(hap_pointer_outputs *io)
{
  io->axes[2].force = io->axes[2].max_force = 1.0;
}
static void spoil_weak(hap_pointer_outputs *io)
{
  io->axes[1].force = io->axes[1].max_force = 1.0;
}
static void spoil_bound(hap_pointer_outputs *io)
{
  io->axes[0].max_force = 0.0;
}
static void spoil_target(hap_pointer_outputs *io)
{
  io->axes[0].target = HIGH + 0.01;
}
static void spoil_force(hap_pointer_outputs *io)
{
  io->axes[0].force = INFINITY;
}
static void spoil_damping(hap_pointer_outputs *io)
{
  io->axes[0].damping = -1.0;
}
static void spoil_power(hap_pointer_outputs *io)
{
  io->axes[0].max_power = -2.0;
}
static void spoil_closed(hap_pointer_outputs *io)
{
  io->gripper_closed = io->gripper_open;
}

TEST(an_axis_is_as_stiff_as_its_device_holds)
{
  hap_detail detail = {""};
  hap_axis_info axis;
  hap_pointer_outputs outputs = outputs_none();
  bench *b = bench_new("virtual:gripper=0:0.03;9:0.03,gripper_stiffness=400,gripper_damping=2");
  REQUIRE(hap_device_get_axis(b->device, 0, 0, &axis, sizeof axis) == HAP_OK);
  CHECK(axis.rated_stiffness == 400.0 && axis.rated_damping == 2.0);
  outputs.axes[0] = (hap_axis_push){.stiffness = 400.0,
                                    .target = 0.04,
                                    .damping = 2.0,
                                    .max_force = 8.0,
                                    .max_power = HAP_FORCE_POWER_AUTO};
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &outputs) == HAP_OK);
  outputs.axes[0].damping = 50.0;
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &outputs) == HAP_SATURATED);
  (void)hap_session_detail(b->session, &detail);
  CHECK(strstr(detail.text, "axes[0].damping 50 is cut to the 2") != NULL);
  outputs.axes[0].stiffness = 5000.0;
  outputs.axes[0].damping = 0.0;
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &outputs) == HAP_SATURATED);
  (void)hap_session_detail(b->session, &detail);
  CHECK(strstr(detail.text, "axes[0].stiffness 5000 is cut to the 400") != NULL);
  bench_run(b, 100);
  CHECK_NEAR(hand_state(b).axis_forces[0], 400.0 * 0.01, 1e-9);
}

/* Nobody holds it; its 0.5 N s/m hold up to 1 kN/m at 1 kHz. Without the figure the same spring
 * rattles (the test above). */
TEST(a_gripper_that_says_what_it_holds_comes_to_rest)
{
  bench *b = bench_new("virtual:hand=none,device_mass=0.1,gripper=0:0.06,gripper_stiffness=400");
  hap_pointer_outputs outputs = outputs_none();
  outputs.axes[0].stiffness = 1e5;
  outputs.axes[0].target = 0.04;
  outputs.axes[0].max_force = 8.0;
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &outputs) == HAP_SATURATED);
  bench_run(b, 4000);
  CHECK_NEAR(hand_state(b).axes[0], 0.04, 1e-4);
  CHECK(fabs(hand_state(b).axis_rates[0]) < 1e-3);
}

TEST(outputs_that_cannot_be_say_why)
{
  static const wrong_outputs wrong[] = {{spoil_led, "leds"},
                                        {spoil_vibrator, "vibrators[1]"},
                                        {spoil_amplitude, "amplitude"},
                                        {spoil_frequency, "frequency"},
                                        {spoil_axis, "axes[2]"},
                                        {spoil_weak, "axes[1]"},
                                        {spoil_bound, "max_force"},
                                        {spoil_target, "target"},
                                        {spoil_force, "axes[0]"},
                                        {spoil_damping, "axes[0]"},
                                        {spoil_power, "axes[0]"},
                                        {spoil_closed, "gripper_closed"}};
  bench *b = bench_new(NULL);
  hap_detail why;
  grip_hold(b);
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    hap_pointer_outputs outputs = spring_outputs();
    wrong[i].spoil(&outputs);
    CHECK(hap_pointer_set_outputs(b->session, b->hand, &outputs) == HAP_ERROR_ARGUMENT);
    CHECK(hap_session_detail(b->session, &why) >= HAP_OK);
    CHECK_SAY(strstr(why.text, wrong[i].names) != NULL, "%s: %s", wrong[i].names, why.text);
  }
  bench_run(b, 30);
  CHECK_NEAR(b->grip.last.axis_forces[0], -HELD, 1e-12); /* nothing has changed */
  hap_pointer_outputs outputs = spring_outputs();
  hap_pointer_outputs bare;
  memset(&bare, 0, sizeof bare);
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &bare) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_pointer_set_outputs(NULL, b->hand, &outputs) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_set_outputs(b->session, (hap_pointer_id){77}, &outputs) == HAP_ERROR_NOT_FOUND);
  hap_pointer_def def;
  hap_pointer_id free_hand;
  hap_pointer_def_init(&def, sizeof def);
  REQUIRE(hap_pointer_add(b->session, &def, &free_hand) == HAP_OK);
  CHECK(hap_pointer_set_outputs(b->session, free_hand, &outputs) == HAP_ERROR_UNSUPPORTED);
}

TEST(what_was_set_is_given_back)
{
  bench *b = bench_new(NULL);
  hap_pointer_outputs set = spring_outputs();
  hap_pointer_outputs out = outputs_none();
  hap_pointer_outputs bare;
  memset(&bare, 0, sizeof bare);
  CHECK(hap_pointer_get_outputs(b->session, b->hand, &out) == HAP_OK); /* nothing yet */
  CHECK(out.axes[0].stiffness == 0.0 && out.axes[0].max_power == HAP_FORCE_POWER_AUTO);
  set.leds = 1;
  outputs_set(b, &set);
  CHECK(hap_pointer_get_outputs(b->session, b->hand, &out) == HAP_OK);
  CHECK(out.leds == 1 && out.gripper_open == set.gripper_open);
  CHECK(out.axes[0].stiffness == set.axes[0].stiffness && out.axes[0].target == set.axes[0].target);
  CHECK(out.axes[0].max_power > 0.0); /* what it promises */
  set.leds = 0xffff;                  /* is refused, and changes nothing */
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &set) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_get_outputs(b->session, b->hand, &out) == HAP_OK && out.leds == 1);
  CHECK(hap_pointer_set_outputs(b->session, b->hand, &out) == HAP_OK); /* it can be set again */
  CHECK(hap_pointer_get_outputs(NULL, b->hand, &out) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_get_outputs(b->session, b->hand, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_get_outputs(b->session, b->hand, &bare) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_pointer_get_outputs(b->session, (hap_pointer_id){77}, &out) == HAP_ERROR_NOT_FOUND);
}

/* ---- events ---- */

static size_t gripper_events(bench *b, hap_event *out, size_t capacity)
{
  hap_event all[64];
  size_t count = 0;
  size_t kept = 0;
  (void)hap_session_events(b->session, all, 64, sizeof all[0], &count);
  for (size_t i = 0; i < count && kept < capacity; ++i) {
    if (all[i].kind == HAP_EVENT_GRIPPER) {
      out[kept++] = all[i];
    }
  }
  return kept;
}

/* From closed over open and back, with noise at the threshold: one event for each crossing. */
TEST(a_gripper_that_closes_and_opens_is_told_once_each)
{
  hap_event events[8];
  bench *b = bench_new(NULL);
  CHECK(gripper_events(b, events, 8) == 0);
  for (int i = 0; i < 400; ++i) { /* 75 mm down and up, 1 mm of noise */
    double way = i < 200 ? i / 200.0 : 2.0 - i / 200.0;
    b->grip.at[0] = HIGH - 0.075 * way + (i % 2 == 0 ? 0.0005 : -0.0005);
    b->grip.rate[0] = i < 200 ? -0.3 : 0.3;
    bench_run(b, 1);
  }
  size_t count = gripper_events(b, events, 8);
  REQUIRE_SAY(count == 2, "%zu", count);
  CHECK(events[0].is_down == 1 && events[0].number == 0 && events[0].speed == -0.3);
  CHECK(events[1].is_down == 0 && events[1].speed == 0.3 && events[1].geom == NULL);
  CHECK(events[0].pointer.v == b->hand.v && events[1].time_ns > events[0].time_ns);
  /* Closed at 0.25 of the range, 10 mm: after 60 of 75 mm, 160 ms; open at 18 mm. */
  CHECK_NEAR(1e-6 * (double)(events[1].time_ns - events[0].time_ns), 40.0 + 61.0, 6.0);
  CHECK(strcmp(hap_event_name(HAP_EVENT_GRIPPER), "gripper") == 0);
  hap_pointer_outputs outputs = outputs_none(); /* 0.9 and 0.95: closed as soon as it is set */
  outputs.gripper_closed = 0.9;
  outputs.gripper_open = 0.95;
  b->grip.at[0] = 0.05;
  outputs_set(b, &outputs);
  bench_run(b, 20);
  count = gripper_events(b, events, 8);
  CHECK(count == 1 && events[0].is_down == 1);
}

/* ---- workspace ---- */

TEST(a_workspace_that_the_device_tells_is_fitted)
{
  const hap_pose box = {{1.0, 2.0, 3.0}, {1.0, 0.0, 0.0, 0.0}};
  bench *b = bench_new(NULL);
  hap_pointer_settings settings;
  hap_pointer_settings_init(&settings, sizeof settings);
  CHECK(hap_pointer_fit_workspace(b->session, b->hand, NULL, NULL, &box, AT(0.8, 0.3, 0.2)) ==
        HAP_OK);
  CHECK(hap_pointer_settings_get(b->session, b->hand, &settings) == HAP_OK);
  CHECK_NEAR(settings.motion_scale, 2.0, 1e-12); /* 0.8 m of 0.4 m */
  CHECK_NEAR(settings.pose_world_device.position[0], 1.0 - 2.0 * 0.1, 1e-12);
  CHECK_NEAR(settings.pose_world_device.position[2], 3.0, 1e-12);
  CHECK(hap_pointer_fit_workspace(b->session, b->hand, AT(0, 0, 0), NULL, &box, AT(1, 1, 1)) ==
        HAP_ERROR_ARGUMENT);
  tap_release(b);
  b = bench_new("virtual");
  CHECK(hap_pointer_fit_workspace(b->session, b->hand, NULL, NULL, &box, AT(1, 1, 1)) ==
        HAP_ERROR_UNSUPPORTED);
  hap_detail why;
  CHECK(hap_session_detail(b->session, &why) >= HAP_OK && strstr(why.text, "workspace") != NULL);
}

/* ---- recordings ---- */

/* A virtual device, as a replay has none: gripper, spring on it, thresholds, all set while it runs,
 * one before the first tick. */
TEST(a_replay_has_axes_and_outputs_bit_for_bit)
{
  hap_detail detail = {""};
  hap_record_def file;
  hap_player *player = NULL;
  hap_expert_def expert;
  hap_research_def research;
  hap_pointer_outputs outputs = outputs_none();
  REQUIRE(folder_make());
  hap_record_def_init(&file, sizeof file);
  file.path = folder_path("axes.rec");
  bench *b = bench_bare();
  b->def.drive = HAP_DRIVE_THREADS;
  b->def.rt_priority = 0;
  REQUIRE(hap_device_open("virtual:hand=relaxed,gripper=0:0.04,gripper_sine=0.03,gripper_hz=3,"
                          "sine=0/0/0.01,vibrators=2,leds=4",
                          &b->device, &detail) == HAP_OK);
  bench_session(b);
  REQUIRE(hap_session_record(b->session, &file, &detail) == HAP_OK);
  bench_hand(b);
  outputs.axes[0] = (hap_axis_push){.stiffness = 60.0, .max_force = 4.0, .max_power = 0.2};
  outputs.leds = 3;
  outputs_set(b, &outputs);
  session_run(b->session);
  for (int i = 0; i < 20; ++i) {
    const struct timespec wait = {.tv_nsec = 20000000};
    (void)nanosleep(&wait, NULL);
    outputs.axes[0].target = 0.004 * i;
    outputs.vibrators[1] = (hap_vibration){0.05 * i, 100.0};
    outputs_set(b, &outputs);
  }
  hap_pointer_state state = hand_state(b);
  CHECK(state.axis_count == 1 && state.axis_forces[0] != 0.0);
  hap_pointer_id hand = b->hand;
  CHECK(hap_session_stop(b->session) == HAP_OK);
  tap_release(b);

  bench *r = bench_bare();
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  REQUIRE(hap_player_open(file.path, HAP_PLAY_WHOLE, &player, &detail) >= HAP_OK);
  REQUIRE(hap_player_get_def(player, &r->def, &expert, &research) >= HAP_OK);
  bench_session(r);
  REQUIRE(hap_session_play(r->session, player, &detail) >= HAP_OK);
  session_run(r->session);
  hap_status status = HAP_OK;
  double least = 1.0;
  double most = 0.0;
  for (r->hand = hand; status == HAP_OK;) {
    status = hap_session_advance(r->session, 1);
    state = hand_state(r);
    least = fmin(least, state.axes[0]);
    most = fmax(most, state.axes[0]);
  }
  (void)hap_session_detail(r->session, &detail);
  REQUIRE_SAY(status == HAP_END, "%s", detail.text);
  CHECK(state.axis_count == 1 && most - least > 0.02);
  CHECK(hap_pointer_set_outputs(r->session, hand, &outputs) == HAP_ERROR_STATE);
  hap_session_destroy(r->session);
  r->session = NULL;
  hap_player_close(player);
}
