/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The ticks of the device spidar, one by one, with an emulator in place of its port and in a time
 * of its own: what each cause of a fault needs, and what zero does between two steps of a write. */

#include "tests/tap.h"

#include <errno.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/safety.h"
#include "base/vec.h"
#include "device/one_effector.h"
#include "plugins/spidar/spidar.h"
#include "tools/spidar-emulator/driven.h"

#define TICK_NS 1000000
#define ZEROS 12
#define NEWTON_COUNTS 99.3 /* of current, of model x4r */

typedef struct rig {
  const hap_device_ops *ops;
  driven_spidar *driven;
  hapi_spidar_device *device;
  hapi_spidar_port port; /* the emulator's */
  int board;             /* where the device's own zeros arrive */
  int64_t time_ns;
  bool started;
  int send_error;  /* 0: what is sent arrives */
  int zeros_later; /* sends, until zero comes in the middle of one; 0: not */
} rig;

static void rig_end(void *self)
{
  rig *r = self;
  close(r->board);
  close(r->device->serial.fd);
  r->ops->close(r->driven);
}

/* ---- between the device and its port ---- */

static int rig_send(void *self, const uint8_t *bytes, int count)
{
  rig *r = self;
  if (r->send_error != 0) {
    return -r->send_error;
  }
  if (r->zeros_later > 0 && --r->zeros_later == 0) {
    hapi_spidar_ops.zero(r->device);
  }
  return r->port.send(r->port.self, bytes, count);
}

static int rig_receive(void *self, uint8_t *bytes, int size)
{
  rig *r = self;
  return r->port.receive(r->port.self, bytes, size);
}

static void rig_await(void *self, double seconds)
{
  rig *r = self;
  r->port.await(r->port.self, seconds);
}

static double rig_now(void *self)
{
  rig *r = self;
  return r->port.now(r->port.self);
}

static void rig_flush(void *self)
{
  rig *r = self;
  r->port.flush(r->port.self);
}

/* The hand goes there, m from home, as soon as motors pull. */
static rig *rig_at(const char *path)
{
  int ends[2];
  void *self = NULL;
  hap_detail detail = {""};
  rig *r = tap_own(sizeof *r, rig_end);
  r->ops = &driven_spidar_ops;
  REQUIRE(r->ops->open(NULL, path, &self, &detail) == HAP_OK);
  r->driven = self;
  r->device = &r->driven->device;
  REQUIRE(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) == 0);
  r->device->serial.fd = ends[0];
  r->board = ends[1];
  memset(r->device->zeros, 0x5a, ZEROS);
  r->device->zero_count = ZEROS;
  return r;
}

static const char still[] = "0:0/0/0"; /* of a hand */

static rig *rig_new(void)
{
  return rig_at(still);
}

static void rig_tell(rig *r, const char *line)
{
  emulator_action action;
  hap_detail detail = {""};
  CHECK(emulator_parse(&r->driven->emulator, line, &action, &detail) == HAP_OK);
  emulator_do(&r->driven->emulator, &action);
}

static rig *rig_start_at(const char *path)
{
  rig *r = rig_at(path);
  REQUIRE(r->ops->start(r->driven) == HAP_OK);
  hapi_spidar_port *port = &r->device->line.port;
  r->port = *port;
  *port = (hapi_spidar_port){r, rig_send, rig_receive, rig_await, rig_now, rig_flush};
  return r;
}

/* Of a hand that holds still. */
static rig *rig_start(void)
{
  return rig_start_at(still);
}

static hap_status rig_read(rig *r)
{
  hap_pose pose;
  hap_twist twist;
  uint32_t buttons = 7;
  r->time_ns += TICK_NS;
  hap_status status = hapi_one_read(r->ops, r->driven, r->time_ns, &pose, &twist, &buttons);
  CHECK(status < HAP_OK || buttons == 0);
  return status;
}

static hap_status rig_write(rig *r, double x)
{
  const hap_wrench wanted = {{x, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench reached;
  return hapi_one_write(r->ops, r->driven, &wanted, &reached);
}

/* Reads and writes; how many ticks were good. *out: what ended them. */
static int rig_push(rig *r, double x, int ticks, hap_status *out)
{
  for (int i = 0; i < ticks; ++i) {
    *out = rig_read(r);
    if (*out >= HAP_OK) {
      *out = rig_write(r, x);
    }
    if (*out < HAP_OK) {
      return i;
    }
  }
  return ticks;
}

static bool rig_says(rig *r, const char *word)
{
  hap_detail why = {""};
  r->ops->explain(r->driven, &why);
  if (strstr(why.text, word) == NULL) {
    tap_say("\"%s\" is not in \"%s\"", word, why.text);
    return false;
  }
  return true;
}

/* Bytes of zeros that the device itself has sent; -1: other bytes are among them. */
static int zeros_come(const rig *r)
{
  uint8_t bytes[4096];
  ssize_t count = recv(r->board, bytes, sizeof bytes, MSG_DONTWAIT);
  for (ssize_t i = 0; i < count; ++i) {
    if (bytes[i] != 0x5a) {
      return -1;
    }
  }
  return count > 0 ? (int)count : 0;
}

/* ---- start ---- */

TEST(a_device_that_does_not_run_takes_and_tells_nothing)
{
  rig *r = rig_new();
  CHECK(rig_read(r) == HAP_ERROR_STATE && rig_write(r, 1.0) == HAP_ERROR_STATE);
  REQUIRE(r->ops->start(r->driven) == HAP_OK);
  CHECK(rig_read(r) == HAP_OK && rig_write(r, 1.0) == HAP_OK);
  r->ops->stop(r->driven);
  CHECK(rig_read(r) == HAP_ERROR_STATE && rig_write(r, 1.0) == HAP_ERROR_STATE);
}

TEST(strings_are_wound_in_for_a_third_of_a_second)
{
  rig *r = rig_start();
  CHECK_NEAR(r->driven->now, 0.3, 0.05);
  CHECK_NEAR(r->device->line.step_rate * 3.485e-5, 10.0, 1e-9); /* m/s of a string */
  CHECK(!atomic_load(&r->device->guard.pulse->pulling)); /* the guard has nothing to do yet */
}

TEST(boards_that_do_not_answer_at_the_start_are_not_waited_for)
{
  rig *r = rig_new();
  rig_tell(r, "silent 1 1");
  CHECK(r->ops->start(r->driven) == HAP_ERROR_DEVICE);
  CHECK_NEAR(r->driven->now, 0.25, 0.02);
  rig_tell(r, "silent all 0");
  r->driven->emulator.plugged = false;
  CHECK(r->ops->start(r->driven) == HAP_ERROR_DEVICE);
}

/* A file says where home is, and the strings say that it cannot be. */
TEST(a_calibration_that_fits_no_pose_is_no_start)
{
  rig *r = rig_new();
  r->device->model.calibrated = r->device->model_calibrated = true;
  for (int i = 0; i < 8; ++i) {
    r->device->model.offset[i] = i % 2 == 0 ? 0.02 : 1.0;
  }
  CHECK(r->ops->start(r->driven) == HAP_ERROR_DEVICE && !r->device->running);
  hapi_spidar_forget_home(r->device);
  CHECK(r->ops->start(r->driven) == HAP_OK && r->device->model.calibrated);
}

/* Encoders that are four times finer, of 16 bits all the same. They were at first_count at home. */
static void rig_calibrate(rig *r, hapi_spidar_model *fine, int first_count)
{
  hap_pose home = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_lengths(fine, &home, lengths);
  for (int i = 0; i < fine->strings; ++i) {
    fine->metres_per_count[i] *= 0.25;
    fine->offset[i] = lengths[i] - first_count * fine->metres_per_count[i];
  }
  fine->calibrated = r->device->model_calibrated = true;
  r->device->model = *fine;
  r->driven->emulator.model = fine;
  r->driven->emulator.first_count = first_count;
}

/* 40 mm from home, some 4500 counts, where the counts of some strings have wrapped. */
TEST(a_calibrated_grip_is_found_away_from_home)
{
  static const int first[] = {0, 40000, -40000};
  for (int i = 0; i < 3; ++i) {
    rig *r = rig_at("0:0.025/0.03/0.025");
    hapi_spidar_model fine = r->device->model;
    hapi_spidar_tensions least;
    const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    double tension[HAPI_SPIDAR_STRINGS_MAX];
    hap_wrench best;
    hap_wrench given;
    rig_calibrate(r, &fine, first[i]);
    CHECK(r->ops->start(r->driven) == HAP_OK);
    const hap_pose *place = &r->driven->emulator.grip.pose;
    CHECK(hapi_v3_norm(place->position) > 0.03);
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(r->device->belief.solver.pose.position[k], place->position[k], 1e-4);
    }
    /* The strings have been wound in for the place where it is. */
    hapi_spidar_tensions_init(&least, &fine);
    CHECK(hapi_spidar_tensions_solve(&least, &fine, place, &none, tension, &best) == HAP_OK);
    hapi_spidar_wrench(&fine, place, r->driven->emulator.pull, &given);
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(given.force[k], best.force[k], 0.03);
    }
    r->driven->emulator.model = hapi_spidar_model_find("x4r");
    tap_release(r);
  }
}

TEST(strings_stay_taut_after_the_start)
{
  rig *r = rig_start();
  CHECK(!atomic_load(&r->device->zeroed));
  for (int i = 0; i < 20; ++i) {
    CHECK(rig_read(r) == HAP_OK);
  }
  for (int i = 0; i < 8; ++i) {
    CHECK_NEAR(r->driven->emulator.pull[i], r->device->model.min_tension, 0.05);
  }
}

/* The first answer after a gap tells where the grip was before it. That is a fault of the loop, and
 * not of a string. */
TEST(a_gap_between_reads_is_no_doubt)
{
  rig *r = rig_start_at("0:0/0/0;0.4:0/0/0;0.6:0.02/0/0;0.8:-0.02/0/0;1:0.02/0/0;1.2:0/0/0");
  double far = 0.0;
  double moved = 0.0;
  for (int i = 0; i < 1000; ++i) {
    if (i % 16 == 4) {
      r->time_ns += 11 * TICK_NS;
      i += 11;
    }
    hap_pose pose;
    hap_twist twist;
    uint32_t buttons;
    r->time_ns += TICK_NS;
    CHECK(hapi_one_read(r->ops, r->driven, r->time_ns, &pose, &twist, &buttons) == HAP_OK);
    CHECK(rig_write(r, 0.0) == HAP_OK);
    const double *at = r->driven->emulator.grip.pose.position;
    double speed = hapi_v3_norm(r->driven->emulator.grip.twist.linear);
    far = fmax(far, fabs(pose.position[0] - at[0]) - 2e-3 * speed);
    moved = fmax(moved, fabs(speed));
  }
  CHECK_SAY(moved > 0.2 && far < 1e-3, "%g m/s, %g mm off", moved, 1e3 * far);
}

/* The loop's own jitter is no gap: from 2 ms on the pose is carried on by as much. */
TEST(a_read_that_is_late_by_2_ms_is_carried_on)
{
  static const int64_t late_ns[] = {0, 1900000, 2100000, 6000000, 21000000};
  static const double carried_s[] = {0.0, 0.0, 2.1e-3, 6e-3, 0.0}; /* from 20 ms on it is rest */
  for (int i = 0; i < 5; ++i) {
    rig *r = rig_start();
    for (int k = 0; k < 20; ++k) {
      CHECK(rig_read(r) == HAP_OK && r->device->reads.late == 0.0);
      CHECK(rig_write(r, 0.0) == HAP_OK);
    }
    r->time_ns += late_ns[i];
    CHECK(rig_read(r) == HAP_OK);
    CHECK_NEAR(r->device->reads.late, carried_s[i], 1e-9);
    tap_release(r);
  }
}

/* 10 bits a byte of 2 Mbit/s, and a tick. */
TEST(the_delay_is_that_of_the_commands)
{
  rig *r = rig_new();
  hap_device_info info = {.mass = 0.0};
  r->device->zero_count = HAPI_SPIDAR_ZEROS_BEFORE + 74;
  r->ops->describe(r->driven, 0, &info);
  CHECK_NEAR(info.delay, 1e-3 + 74 * 10 / 2e6, 1e-12);
}

/* ---- writes ---- */

TEST(nothing_but_numbers_becomes_currents)
{
  static const double wrong[] = {NAN, INFINITY, -INFINITY};
  for (int i = 0; i < 6; ++i) {
    rig *r = rig_start();
    hap_status status = HAP_OK;
    hap_wrench wanted = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hap_wrench reached;
    CHECK(rig_push(r, 2.0, 10, &status) == 10 && zeros_come(r) == 0);
    (i < 3 ? wanted.force : wanted.torque)[i % 3] = wrong[i % 3];
    CHECK(hapi_one_write(r->ops, r->driven, &wanted, &reached) == HAP_ERROR_ARGUMENT);
    CHECK(zeros_come(r) == ZEROS && atomic_load(&r->device->zeroed));
    CHECK(!atomic_load(&r->device->guard.pulse->pulling));
    hapi_one_held(r->ops, r->driven, &reached);
    CHECK(hapi_v3_norm(reached.force) == 0.0);
    tap_release(r);
  }
}

TEST(more_than_the_limit_is_shortened_and_said)
{
  hap_wrench reached;
  rig *r = rig_start();
  double most = r->device->settings.max_force;
  double turn = r->device->settings.max_torque;
  const hap_wrench force = {{0.0, 3.0 * most, 0.0}, {0.0, 0.0, 0.0}};
  const hap_wrench torque = {{0.0, 0.0, 0.0}, {0.0, 3.0 * turn, 0.0}};
  for (int i = 0; i < 10; ++i) { /* before the hand yields */
    CHECK(rig_read(r) >= HAP_OK);
    CHECK(hapi_one_write(r->ops, r->driven, &force, &reached) == HAP_SATURATED);
  }
  CHECK_NEAR(hapi_v3_norm(reached.force), most, 0.1 * most);
  CHECK(hapi_v3_norm(reached.force) <= most * (1.0 + 1e-9));
  r = rig_start();
  for (int i = 0; i < 10; ++i) {
    CHECK(rig_read(r) >= HAP_OK);
    CHECK(hapi_one_write(r->ops, r->driven, &torque, &reached) == HAP_SATURATED);
  }
  CHECK_NEAR(hapi_v3_norm(reached.torque), turn, 0.1 * turn);
  CHECK(hapi_v3_norm(reached.torque) <= turn * (1.0 + 1e-9));
}

/* The least tensions leave a little, which is no force; of a wanted force all is told. */
TEST(no_force_is_told_where_none_is_wanted)
{
  hap_wrench held;
  hap_status status = HAP_OK;
  rig *r = rig_start();
  CHECK(rig_push(r, 0.0, 50, &status) == 50);
  hapi_one_held(r->ops, r->driven, &held);
  CHECK(hapi_v3_norm(held.force) == 0.0 && hapi_v3_norm(held.torque) == 0.0);
  double little = 0.009 * r->device->settings.max_force;
  CHECK(rig_push(r, little, 50, &status) == 50);
  hapi_one_held(r->ops, r->driven, &held);
  CHECK_NEAR(held.force[0], little, 0.5 * little);
  /* Away from home the least tensions leave more, up to a hundredth of the limit. */
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench given;
  hap_pose *pose = &r->device->belief.solver.pose;
  pose->position[0] = 0.022;
  CHECK(hapi_one_write(r->ops, r->driven, &none, &held) >= HAP_OK &&
        hapi_v3_norm(held.force) == 0.0);
  hapi_spidar_wrench(&r->device->model, pose, r->device->tensions.tension, &given);
  CHECK(hapi_v3_norm(given.force) > 0.003 * r->device->settings.max_force);
  /* A geometry in which they do not balance is told: as if the pose were far from home. */
  pose->position[0] = 0.03;
  CHECK(hapi_one_write(r->ops, r->driven, &none, &held) >= HAP_OK);
  CHECK(hapi_v3_norm(held.force) > 0.01 * r->device->settings.max_force);
}

/* Tensions change at a rate. A pause between two writes does not let them change at once. */
TEST(the_time_between_two_writes_is_bounded_for_tensions)
{
  static const struct {
    double passed;
    double counted;
  } rows[] = {{1e-3, 1e-3}, {1e-5, 1e-3}, {4e-3, 4e-3}, {0.2, 0.01}};
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 1.0, 5, &status) == 5);
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    (void)rig_write(r, 1.0);
    r->driven->now += rows[i].passed;
    (void)rig_write(r, 1.0);
    CHECK_NEAR(r->device->tensions.seconds, rows[i].counted, 1e-9);
  }
  r->ops->zero(r->driven);
  (void)rig_write(r, 1.0);
  CHECK(r->device->tensions.seconds == 0.0); /* from no tension at once */
}

static double current_most(const rig *r)
{
  double most = 0.0;
  for (int i = 0; i < 8; ++i) {
    most = fmax(most, fabs((double)r->device->current[i]));
  }
  return most;
}

TEST(tensions_become_currents_with_their_mean_kept)
{
  rig *r = rig_start();
  double sum = 0.0;
  double wanted = 0.0;
  for (int i = 0; i < 400; ++i) {
    CHECK(rig_read(r) >= HAP_OK && rig_write(r, 0.5) >= HAP_OK);
    for (int k = 0; i >= 200 && k < 8; ++k) {
      sum += r->device->current[k] * (r->device->model.volts_per_newton[k] > 0.0 ? 1.0 : -1.0);
      wanted += NEWTON_COUNTS * r->device->tensions.tension[k];
      CHECK(fabs(r->device->rest[k]) <= 1.0);
    }
  }
  CHECK_NEAR(sum / wanted, 1.0, 1e-3);
  r->device->model.volts_per_newton[0] *= 1e4; /* no model does that */
  CHECK(rig_read(r) >= HAP_OK && rig_write(r, 0.5) >= HAP_OK);
  CHECK(current_most(r) <= 4095.0 && fabs(r->device->rest[0]) <= 1.0);
}

/* ---- zero ---- */

TEST(zero_in_the_middle_of_a_write_comes_last)
{
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 2.0, 10, &status) == 10 && zeros_come(r) == 0);
  r->zeros_later = 1;
  CHECK(rig_read(r) >= HAP_OK && rig_write(r, 2.0) >= HAP_OK);
  CHECK(zeros_come(r) == 2 * ZEROS); /* of zero itself, and again behind the currents */
  CHECK(atomic_load(&r->device->zeroed));
}

/* Boards are asked where they are all the same, and get no force for that. */
TEST(after_a_zero_boards_are_asked_without_a_force)
{
  rig *r = rig_start();
  double pull[8] = {0.0};
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 3.0, 50, &status) == 50);
  r->ops->zero(r->driven);
  for (int i = 0; i < 50; ++i) {
    CHECK(rig_read(r) >= HAP_OK);
  }
  memcpy(pull, r->driven->emulator.pull, sizeof pull);
  for (int i = 0; i < 8; ++i) {
    CHECK(pull[i] == 0.0);
  }
  CHECK(rig_push(r, 3.0, 50, &status) == 50);
  for (int i = 0; i < 10; ++i) { /* without a zero the last currents stay */
    CHECK(rig_read(r) >= HAP_OK);
  }
  memcpy(pull, r->driven->emulator.pull, sizeof pull);
  CHECK(fmax(fmax(pull[0], pull[1]), fmax(pull[2], pull[3])) > 0.5);
}

TEST(a_stop_sends_zeros_twice_and_leaves_the_guard_nothing_to_do)
{
  hap_wrench held;
  hap_status status = HAP_OK;
  rig *r = rig_start();
  CHECK(rig_push(r, 2.0, 10, &status) == 10 && zeros_come(r) == 0);
  CHECK(atomic_load(&r->device->guard.pulse->pulling));
  hapi_spidar_ops.stop(r->device);
  CHECK(zeros_come(r) == 2 * ZEROS && !r->device->running);
  CHECK(!atomic_load(&r->device->guard.pulse->pulling));
  hapi_one_held(&hapi_spidar_ops, r->device, &held);
  CHECK(hapi_v3_norm(held.force) == 0.0 && hapi_v3_norm(held.torque) == 0.0);
}

/* ---- faults ---- */

TEST(a_port_that_is_gone_needs_a_restart)
{
  for (int way = 0; way < 3; ++way) {
    rig *r = rig_start();
    hap_status status = HAP_OK;
    CHECK(rig_push(r, 2.0, 10, &status) == 10);
    if (way == 0) {
      rig_tell(r, "unplug");
      CHECK(rig_read(r) == HAP_ERROR_DEVICE);
    } else if (way == 1) { /* nothing to read is no error, but nothing can be asked */
      CHECK(rig_read(r) >= HAP_OK);
      r->send_error = EIO;
      CHECK(rig_read(r) == HAP_ERROR_DEVICE);
    } else {
      CHECK(rig_read(r) >= HAP_OK);
      r->send_error = EIO;
      CHECK(rig_write(r, 2.0) == HAP_ERROR_DEVICE);
    }
    CHECK(rig_says(r, "cable"));
    r->send_error = 0;
    rig_tell(r, "plug");
    CHECK(rig_read(r) == HAP_ERROR_DEVICE && rig_write(r, 2.0) == HAP_ERROR_DEVICE);
    r->ops->stop(r->driven);
    CHECK(r->ops->start(r->driven) == HAP_OK && rig_read(r) == HAP_OK);
    tap_release(r);
  }
}

TEST(silence_is_a_fault_after_the_timeout_and_is_over_with_an_answer)
{
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 2.0, 10, &status) == 10);
  rig_tell(r, "silent 0 1");
  int good = rig_push(r, 2.0, 100, &status);
  CHECK_SAY(good >= 19 && good <= 22 && status == HAP_ERROR_DEVICE, "%d ticks", good);
  CHECK(rig_says(r, "no whole answer"));
  rig_tell(r, "silent 0 0");
  for (int i = 0; i < 5 && status < HAP_OK; ++i) {
    status = rig_read(r);
  }
  CHECK(status >= HAP_OK && rig_push(r, 2.0, 10, &status) == 10);
  hap_detail why = {""};
  r->ops->explain(r->driven, &why);
  CHECK(strstr(why.text, "no whole answer") != NULL); /* of the last failure since the start */
}

TEST(a_board_that_was_reset_is_a_jump)
{
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 2.0, 10, &status) == 10);
  rig_tell(r, "false all 8000"); /* more than a string goes in the timeout */
  int good = rig_push(r, 2.0, 100, &status);
  CHECK_SAY(good >= 18 && good <= 23 && status == HAP_ERROR_DEVICE, "%d ticks", good);
  CHECK(rig_says(r, "positions jumped"));
  CHECK(rig_read(r) == HAP_ERROR_DEVICE && rig_write(r, 0.0) == HAP_ERROR_DEVICE);
}

/* Not at once: strings may be slack after a zero. */
TEST(lengths_that_fit_no_pose_are_a_fault_after_a_third_of_a_second)
{
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 2.0, 400, &status) == 400);
  for (int i = 0; i < 8; i += 2) {
    char line[40];
    snprintf(line, sizeof line, "false %d %d", i, i % 4 == 0 ? 280 : -280);
    rig_tell(r, line);
  }
  int good = rig_push(r, 0.0, 1000, &status);
  CHECK_SAY(good >= 295 && good <= 310 && status == HAP_ERROR_DEVICE, "%d ticks", good);
  CHECK(rig_says(r, atomic_load(&r->device->told.string) < 0 ? "fit no pose" : "for the others"));
  for (int i = 0; i < 8; i += 2) {
    char line[40];
    snprintf(line, sizeof line, "false %d 0", i);
    rig_tell(r, line);
  }
  for (int i = 0; i < 500 && status < HAP_OK; ++i) {
    status = rig_read(r); /* it comes back by itself */
  }
  CHECK(status >= HAP_OK);
}

TEST(a_string_that_is_off_is_named)
{
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 2.0, 100, &status) == 100);
  atomic_store(&r->device->told.cause, HAPI_SPIDAR_MISFIT);
  atomic_store(&r->device->told.string, 3);
  atomic_store(&r->device->told.off_um, 4200);
  CHECK(rig_says(r, "string 3 is 4.2 mm too long") && rig_says(r, "slack"));
  atomic_store(&r->device->told.off_um, -4200);
  CHECK(rig_says(r, "string 3 is 4.2 mm too short") && rig_says(r, "broken or off the grip"));
  atomic_store(&r->device->told.string, -1);
  CHECK(rig_says(r, "fit no pose"));
}

TEST(a_guard_that_took_the_force_off_ends_the_ticks)
{
  rig *r = rig_start();
  hap_status status = HAP_OK;
  CHECK(rig_push(r, 2.0, 10, &status) == 10);
  atomic_store(&r->device->guard.pulse->stalled, true);
  CHECK(rig_read(r) == HAP_ERROR_DEVICE && rig_says(r, "guard took the force off"));
  atomic_store(&r->device->guard.pulse->stalled, false);
  CHECK(rig_read(r) == HAP_ERROR_DEVICE && rig_write(r, 2.0) == HAP_ERROR_DEVICE);
}

TEST(every_cause_has_its_text)
{
  static const struct {
    hapi_spidar_cause cause;
    const char *word;
  } rows[] = {{HAPI_SPIDAR_UNGUARDED, "could not be started"},
              {HAPI_SPIDAR_GUARD_LOST, "was it killed"},
              {HAPI_SPIDAR_NOT_OPENED, "does not open"},
              {HAPI_SPIDAR_OTHER_BOARDS, "not the boards"}};
  rig *r = rig_new();
  hap_detail why = {""};
  r->ops->explain(r->driven, &why);
  CHECK(why.text[0] == '\0');
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    atomic_store(&r->device->told.cause, (int)rows[i].cause);
    CHECK(rig_says(r, rows[i].word));
  }
  atomic_store(&r->device->guard.error, EAGAIN);
  CHECK(!atomic_load(&r->device->guard.pulse->rescued));
  atomic_store(&r->device->told.cause, HAPI_SPIDAR_UNGUARDED);
  CHECK(rig_says(r, strerror(EAGAIN)));
  atomic_store(&r->device->guard.pulse->rescued, true);
  CHECK(rig_says(r, "came back"));
}
