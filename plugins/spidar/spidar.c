/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The device SPIDAR. A tick sends the currents of its write and takes, without waiting, what the
 * boards answered to those of the tick before: their positions of that moment. */

#include "plugins/spidar/spidar.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/pose.h"
#include "base/safety.h"
#include "base/vec.h"

#define CURRENT_VOLTS (3.3 / 4096.0) /* of a count of current */
#define SPEED_MOST 10.0              /* m/s of a string */
#define TAUT_S 0.3                   /* strings are wound in before the first pose is believed */
#define ANSWER_S 0.25                /* for an exchange of start */
#define PERIOD_S 1e-3                /* between two writes, at least */
#define BYTE_S 5e-6                  /* 10 bits of 2 Mbit/s */
#define WRITE_LATE_S 0.01            /* a longer pause between two writes counts as this */
#define LITTLE 0.01                  /* of the greatest force */
#define WRAP 65536.0
#define RESCUED_TEXT "the port came back, and the guard has taken the force off there"

_Static_assert(ATOMIC_BOOL_LOCK_FREE == 2, "zero is called from signal handlers");

static double now_s(const hapi_spidar_device *device)
{
  return device->line.port.now(device->line.port.self);
}

static void set_cause(hapi_spidar_device *device, hapi_spidar_cause cause)
{
  atomic_store(&device->cause, (int)cause);
}

/* ---- currents ---- */

/* The zero of another thread may have come between the decision for these currents and their way
 * out. */
static int send_currents(hapi_spidar_device *device)
{
  int sent = hapi_spidar_line_send(&device->line, device->current);
  atomic_fetch_add(&device->guard.pulse->beats, 1);
  if (atomic_load(&device->zeroed)) {
    (void)hapi_spidar_serial_force(&device->serial, device->zeros, device->zero_count);
  }
  return sent;
}

static int send_none(hapi_spidar_device *device)
{
  const int16_t none[HAPI_SPIDAR_STRINGS_MAX] = {0};
  return hapi_spidar_line_send(&device->line, none);
}

/* The rounding error is carried to the next tick, so that the mean tensions are the wanted ones.
 * Steps of 0.01 N at some 500 Hz are not felt; a lasting error of all strings is. */
static void tensions_convert(hapi_spidar_device *device, const double *tension)
{
  for (int i = 0; i < device->model.strings; ++i) {
    double wanted = tension[i] * device->model.volts_per_newton[i] / CURRENT_VOLTS;
    double current = floor(wanted + device->rest[i] + 0.5);
    current = fmax(fmin(current, HAPI_SPIDAR_CURRENT_MAX), -HAPI_SPIDAR_CURRENT_MAX);
    device->rest[i] = fmax(fmin(wanted + device->rest[i] - current, 1.0), -1.0);
    device->current[i] = (int16_t)current;
  }
}

/* ---- zero ---- */

static void spidar_zero(void *self)
{
  hapi_spidar_device *device = self;
  atomic_store(&device->zeroed, true);
  atomic_store(&device->guard.pulse->pulling, false);
  (void)hapi_spidar_serial_force(&device->serial, device->zeros, device->zero_count);
}

/* ---- where the grip is ---- */

static void read_counts(const hapi_spidar_device *device, double counts[HAPI_SPIDAR_STRINGS_MAX])
{
  for (int i = 0; i < device->model.strings; ++i) {
    counts[i] = device->line.counts.counts[i];
  }
}

static hapi_spidar_fit solve_pose(hapi_spidar_device *device)
{
  double counts[HAPI_SPIDAR_STRINGS_MAX];
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  read_counts(device, counts);
  hapi_spidar_measure(&device->model, counts, lengths);
  return hapi_spidar_solve(&device->belief.solver, &device->model, lengths);
}

/* Into pose and twist, at the time of the read before: boards answer with the positions of when
 * they were asked, and in a gap they are not. So a loop that was late is no doubt about the
 * strings. False: replies have been doubted for too long, while all strings were pulled. */
static bool believe_counts(hapi_spidar_device *device, int64_t time_ns)
{
  double counts[HAPI_SPIDAR_STRINGS_MAX];
  double now = now_s(device);
  read_counts(device, counts);
  device->doubted =
      hapi_spidar_belief_update(&device->belief, &device->model, time_ns, counts,
                                !atomic_load(&device->zeroed)) != HAPI_SPIDAR_BELIEVED;
  if (!device->doubted || device->poor < 0.0) {
    device->poor = device->doubted ? now : -1.0;
  }
  if (device->doubted) {
    atomic_store(&device->told.string, device->belief.wrong);
    atomic_store(&device->told.off_um, (int)fmax(fmin(1e6 * device->belief.error, 1e9), -1e9));
    atomic_store(&device->told.cause, HAPI_SPIDAR_MISFIT);
  }
  return !device->doubted || now - fmax(device->poor, device->taut) < HAPI_SAFETY_MISFIT_S;
}

static void to_frame(const hapi_spidar_device *device, hap_pose *pose, hap_twist *twist)
{
  hap_pose now = device->belief.solver.pose;
  const hap_pose *grip = &now;
  if (device->reads.late > 0.0) {
    hapi_pose_move(&now, &device->belief.twist, device->reads.late);
  }
  const double *r = device->settings.rotate;
  hapi_pose_point(device->settings.offset, r, grip->position, pose->position);
  /* Turned as the grip is, in the axes of the frame: at home it is the identity. */
  const double back[4] = {r[0], -r[1], -r[2], -r[3]};
  double turned[4];
  hapi_quat_multiply(r, grip->quat_wxyz, turned);
  hapi_quat_multiply(turned, back, pose->quat_wxyz);
  hapi_quat_normalize(pose->quat_wxyz);
  hapi_quat_rotate(r, device->belief.twist.linear, twist->linear);
  hapi_quat_rotate(r, device->belief.twist.angular, twist->angular);
}

/* ---- every tick ---- */

static hap_status device_fail(hapi_spidar_device *device, hapi_spidar_cause cause)
{
  set_cause(device, cause);
  atomic_store(&device->told.cause, (int)cause);
  return HAP_ERROR_DEVICE;
}

static bool needs_restart(const hapi_spidar_device *device)
{
  int cause = atomic_load(&device->cause);
  return cause == HAPI_SPIDAR_HUNG_UP || cause == HAPI_SPIDAR_JUMPED ||
         cause == HAPI_SPIDAR_STALLED || cause == HAPI_SPIDAR_GUARD_LOST;
}

/* s, by which the newest positions are older than those of a loop that is in time. */
static double late_by(const hapi_spidar_device *device, int64_t time_ns)
{
  double gap =
      device->reads.newest_ns >= 0 ? 1e-9 * (double)(time_ns - device->reads.newest_ns) : 0.0;
  double late = gap - device->reads.gap;
  return late > HAPI_SAFETY_READ_LATE_S && gap < HAPI_SAFETY_GAP_MOST_S ? late : 0.0;
}

/* What has come, into pose and twist. */
static hap_status take_answer(hapi_spidar_device *device, int64_t time_ns)
{
  int taken = hapi_spidar_line_receive(&device->line);
  int64_t asked_ns = device->reads.newest_ns >= 0 ? device->reads.newest_ns : time_ns;
  device->reads.late = late_by(device, time_ns);
  device->reads.gap = 1e-9 * (double)(time_ns - asked_ns);
  device->reads.newest_ns = time_ns;
  if (taken < 0) {
    return device_fail(device, HAPI_SPIDAR_HUNG_UP);
  }
  if (taken > 0) {
    if (!believe_counts(device, asked_ns)) {
      return device_fail(device, HAPI_SPIDAR_MISFIT);
    }
    set_cause(device, HAPI_SPIDAR_WELL);
  }
  if (hapi_spidar_line_silence(&device->line) > device->settings.timeout) {
    /* Later the way that they jumped would be one that a string can go in the time. */
    return device_fail(device,
                       device->line.bad_steps > 0 ? HAPI_SPIDAR_JUMPED : HAPI_SPIDAR_SILENT);
  }
  return device->doubted ? HAP_STALE : HAP_OK;
}

/* Nobody wrote since the last read: the boards are asked all the same. */
static hap_status boards_ask(hapi_spidar_device *device)
{
  int sent = 0;
  if (!device->asked) {
    sent = atomic_load(&device->zeroed) ? send_none(device) : send_currents(device);
  }
  device->asked = false;
  return sent < 0 ? device_fail(device, HAPI_SPIDAR_HUNG_UP) : HAP_OK;
}

static hap_status spidar_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  hapi_spidar_device *device = self;
  if (!device->running) {
    return HAP_ERROR_STATE;
  }
  if (needs_restart(device)) {
    return HAP_ERROR_DEVICE;
  }
  if (atomic_load(&device->guard.pulse->stalled)) {
    return device_fail(device, HAPI_SPIDAR_STALLED);
  }
  if (hapi_spidar_guard_is_lost(&device->guard)) {
    return device_fail(device, HAPI_SPIDAR_GUARD_LOST);
  }
  hap_status status = take_answer(device, time_ns);
  hap_status asked = needs_restart(device) ? HAP_OK : boards_ask(device);
  to_frame(device, &in->pose, &in->twist);
  in->buttons = 0;
  return asked < HAP_OK && status >= HAP_OK ? asked : status;
}

/* From write to write, for heat and for the rate of the tensions. */
static double since_write(hapi_spidar_device *device)
{
  double now = now_s(device);
  double passed = device->written >= 0.0 ? now - device->written : PERIOD_S;
  device->written = now;
  return fmax(fmin(passed, WRITE_LATE_S), PERIOD_S);
}

/* Wanted in the model's frame; reached in it, too. */
static bool strings_pull(hapi_spidar_device *device, const hap_wrench *wanted, hap_wrench *reached)
{
  double tension[HAPI_SPIDAR_STRINGS_MAX];
  double passed = since_write(device);
  bool slack = atomic_load(&device->zeroed);
  if (slack) {
    device->taut = device->written;
    memset(device->tensions.tension, 0, sizeof device->tensions.tension);
    memset(device->rest, 0, sizeof device->rest);
  }
  hapi_spidar_heat_step(&device->heat, &device->model, device->tensions.tension, passed,
                        device->tensions.most);
  /* From no tension at once: some strings later than others would be a force in another direction,
   * and who zeroed brings the force back slowly. */
  device->tensions.seconds = slack ? 0.0 : passed;
  hap_status status = hapi_spidar_tensions_solve(
      &device->tensions, &device->model, &device->belief.solver.pose, wanted, tension, reached);
  tensions_convert(device, tension);
  return status == HAP_SATURATED;
}

static bool is_zero(const hap_wrench *wrench)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  bool zero = true;
  for (int i = 0; i < 3; ++i) {
    zero = zero && wrench->force[i] == none.force[i] && wrench->torque[i] == none.torque[i];
  }
  return zero;
}

/* Before currents go out, so that a zero that comes in between is seen behind them. */
static void lower_zero(hapi_spidar_device *device)
{
  atomic_store(&device->guard.pulse->pulling, true);
  atomic_store(&device->zeroed, false);
}

/* What the tensions give, turned to the device's frame. Of no wrench at all the little that the
 * least tensions leave is not told as a force; a geometry in which they do not balance is told. */
static void tell_reached(hapi_spidar_device *device, const hap_wrench *wanted,
                         const hap_wrench *given)
{
  bool little = hapi_v3_norm(given->force) < LITTLE * device->settings.max_force &&
                hapi_v3_norm(given->torque) < LITTLE * device->settings.max_torque;
  memset(&device->held, 0, sizeof device->held);
  if (!is_zero(wanted) || !little) {
    hapi_quat_rotate(device->settings.rotate, given->force, device->held.force);
    if (device->model.dof == 6) {
      hapi_quat_rotate(device->settings.rotate, given->torque, device->held.torque);
    }
  }
}

/* A force at its limit may bring a little more in another direction with it. */
static void keep_limits(hapi_spidar_device *device)
{
  (void)hapi_v3_shorten(device->held.force, device->settings.max_force);
  (void)hapi_v3_shorten(device->held.torque, device->settings.max_torque);
}

static hap_status spidar_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  hapi_spidar_device *device = self;
  hap_wrench local = wanted[0]->wrench;
  hap_wrench given;
  if (!device->running) {
    return HAP_ERROR_STATE;
  }
  if (needs_restart(device)) {
    return HAP_ERROR_DEVICE;
  }
  if (!hapi_finite(wanted[0]->wrench.force, 3) || !hapi_finite(wanted[0]->wrench.torque, 3)) {
    spidar_zero(device);
    return HAP_ERROR_ARGUMENT;
  }
  bool shortened = hapi_v3_shorten(local.force, device->settings.max_force);
  bool eased = hapi_v3_shorten(local.torque, device->settings.max_torque) && device->model.dof == 6;
  hapi_quat_unrotate(device->settings.rotate, local.force, local.force);
  hapi_quat_unrotate(device->settings.rotate, local.torque, local.torque);
  bool taut = strings_pull(device, &local, &given);
  tell_reached(device, &wanted[0]->wrench, &given);
  keep_limits(device);
  lower_zero(device);
  device->asked = true;
  if (send_currents(device) < 0) {
    return device_fail(device, HAPI_SPIDAR_HUNG_UP);
  }
  reached[0]->wrench = device->held;
  return shortened || eased || taut ? HAP_SATURATED : HAP_OK;
}

static void spidar_held(void *self, hap_device_output *const out[])
{
  const hapi_spidar_device *device = self;
  memset(&out[0]->wrench, 0, sizeof out[0]->wrench);
  if (!atomic_load(&device->zeroed)) {
    out[0]->wrench = device->held;
  }
}

/* ---- start and stop ---- */

/* Port and boards as they were at open; what was lost is opened anew. */
static bool device_reopen(hapi_spidar_device *device)
{
  hapi_spidar_boards found;
  hapi_spidar_port port;
  hap_detail detail = {""};
  char path[HAPI_SPIDAR_PATH_MAX];
  memcpy(path, device->serial.path, sizeof path);
  hapi_spidar_serial_shut(&device->serial);
  char name[HAPI_SPIDAR_PATH_MAX]; /* that its adapter has now */
  if (hapi_spidar_identity_find(HAPI_SPIDAR_SYSFS, &device->serial.identity, name, sizeof name)) {
    memcpy(path, name, sizeof path);
  }
  if (hapi_spidar_serial_open(&device->serial, path, &detail) < HAP_OK) {
    (void)device_fail(device, HAPI_SPIDAR_NOT_OPENED);
    return false;
  }
  hapi_spidar_serial_port(&device->serial, &port);
  if (hapi_spidar_line_find(&port, &found, &detail) < HAP_OK) {
    (void)device_fail(device, HAPI_SPIDAR_NOT_OPENED);
    return false;
  }
  if (memcmp(&found, &device->boards, sizeof found) != 0) {
    (void)device_fail(device, HAPI_SPIDAR_OTHER_BOARDS);
    return false;
  }
  return true;
}

static bool is_lost(const hapi_spidar_device *device)
{
  return atomic_load(&device->cause) != HAPI_SPIDAR_WELL;
}

static bool begin_line(hapi_spidar_device *device, const hapi_spidar_port *port)
{
  double finest = fabs(device->model.metres_per_count[0]);
  for (int i = 1; i < device->model.strings; ++i) {
    finest = fmin(finest, fabs(device->model.metres_per_count[i]));
  }
  return hapi_spidar_line_begin(&device->line, port, &device->boards, SPEED_MOST / finest) >=
         HAP_OK;
}

/* Boards count in 16 bits, so of all that a count may be it is the one whose length is nearest to
 * that at home: strings are shorter than a wrap. */
static void unwrap_counts(hapi_spidar_device *device)
{
  hap_pose home;
  double lengths[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_home(&home);
  hapi_spidar_lengths(&device->model, &home, lengths);
  for (int i = 0; i < device->model.strings; ++i) {
    double count = (lengths[i] - device->model.offset[i]) / device->model.metres_per_count[i];
    double wraps = floor((count - device->line.counts.counts[i]) / WRAP + 0.5);
    device->line.counts.counts[i] += (int32_t)(wraps * WRAP);
  }
}

/* Winds the strings in by the least tension, which is about no force at home, and looks where they
 * are. */
static bool strings_tauten(hapi_spidar_device *device)
{
  const hap_wrench none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench given;
  bool good = hapi_spidar_line_exchange(&device->line, device->current, ANSWER_S) >= HAP_OK;
  double end = now_s(device) + TAUT_S;
  if (good && device->model.calibrated) {
    unwrap_counts(device);
  }
  while (good && now_s(device) < end) {
    (void)strings_pull(device, &none, &given);
    lower_zero(device);
    atomic_fetch_add(&device->guard.pulse->beats, 1);
    good = hapi_spidar_line_exchange(&device->line, device->current, ANSWER_S) >= HAP_OK;
    if (device->model.calibrated) {
      (void)solve_pose(device);
    }
  }
  /* The least tension may stay without anybody who writes: the guard has nothing to do yet. */
  atomic_store(&device->guard.pulse->pulling, false);
  return good;
}

/* Where the grip is now: by the calibration that there is, else it is taken to be at home. A fit
 * that does not arrive is none. */
static bool settle_pose(hapi_spidar_device *device)
{
  double counts[HAPI_SPIDAR_STRINGS_MAX];
  hapi_spidar_fit fit = HAPI_SPIDAR_FIT_POOR;
  hapi_spidar_belief_begin(&device->belief, &device->model, NULL);
  if (device->model.calibrated) {
    fit = HAPI_SPIDAR_FIT_MOVING;
    for (int i = 0; i < 20 && fit == HAPI_SPIDAR_FIT_MOVING; ++i) {
      fit = solve_pose(device);
    }
  }
  if (fit != HAPI_SPIDAR_FIT_GOOD && !device->model_calibrated) {
    read_counts(device, counts);
    hapi_spidar_calibrate_at(&device->model, NULL, counts);
    device->model.calibrated = true;
    hapi_spidar_belief_begin(&device->belief, &device->model, NULL);
    fit = solve_pose(device);
  }
  if (fit != HAPI_SPIDAR_FIT_GOOD) {
    return false;
  }
  hap_pose grip = device->belief.solver.pose;
  hapi_spidar_belief_begin(&device->belief, &device->model, &grip);
  return true;
}

static void reset_ticks(hapi_spidar_device *device)
{
  hapi_spidar_belief_begin(&device->belief, &device->model, NULL);
  hapi_spidar_tensions_init(&device->tensions, &device->model);
  memset(&device->held, 0, sizeof device->held);
  memset(device->current, 0, sizeof device->current);
  memset(device->rest, 0, sizeof device->rest);
  device->written = -1.0;
  device->reads.newest_ns = -1;
  device->reads.gap = 0.0;
  device->reads.late = 0.0;
  device->poor = -1.0;
  device->doubted = false;
  device->asked = false;
}

static void let_go(hapi_spidar_device *device)
{
  device->running = false;
  spidar_zero(device);
  bool zeroed = hapi_spidar_serial_force(&device->serial, device->zeros, device->zero_count);
  hapi_spidar_guard_end(&device->guard, zeroed);
}

hapi_spidar_cause hapi_spidar_begin(hapi_spidar_device *device, const hapi_spidar_port *port)
{
  reset_ticks(device);
  if (!begin_line(device, port) || !strings_tauten(device)) {
    return HAPI_SPIDAR_SILENT;
  }
  if (!settle_pose(device)) {
    return HAPI_SPIDAR_MISFIT;
  }
  device->running = true;
  return HAPI_SPIDAR_WELL;
}

/* No guard, no force, unless the user wants it so. */
static bool guard_begin(hapi_spidar_device *device)
{
  const hapi_spidar_guard_def def = {.port = device->serial.fd,
                                     .path = device->serial.path,
                                     .identity = &device->serial.identity,
                                     .boards = &device->boards,
                                     .zeros = device->zeros,
                                     .zero_count = device->zero_count,
                                     .stall_s = device->settings.stall};
  if (atomic_exchange(&device->guard.pulse->rescued, false)) {
    hapi_log(HAP_LOG_WARNING, "spidar: %.200s: " RESCUED_TEXT, device->serial.path);
  }
  if (device->settings.stall > 0.0) {
    return hapi_spidar_guard_start(&device->guard, &def);
  }
  hapi_log(
      HAP_LOG_WARNING,
      "spidar: %.200s: no guard process, as stall=0 asks for: when this program is killed, the "
      "motors keep their currents",
      device->serial.path);
  return true;
}

static hap_status spidar_start(void *self)
{
  hapi_spidar_device *device = self;
  if (is_lost(device) && !device_reopen(device)) {
    return HAP_ERROR_DEVICE;
  }
  set_cause(device, HAPI_SPIDAR_WELL);
  atomic_store(&device->told.cause, HAPI_SPIDAR_WELL);
  atomic_store(&device->told.string, -1);
  hapi_spidar_port port;
  hapi_spidar_serial_port(&device->serial, &port);
  hapi_spidar_cause cause = HAPI_SPIDAR_UNGUARDED;
  if (guard_begin(device)) {
    cause = hapi_spidar_begin(device, &port);
  }
  if (cause != HAPI_SPIDAR_WELL) {
    let_go(device);
    return device_fail(device, cause);
  }
  return HAP_OK;
}

static void spidar_stop(void *self)
{
  let_go(self);
}

/* ---- open and close ---- */

static void spidar_close(void *self)
{
  hapi_spidar_release(self);
  hapi_free(self);
}

static hap_status spidar_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  hapi_spidar_device *device = hapi_alloc(sizeof *device);
  if (device == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "spidar: out of memory");
  }
  device->serial.fd = -1;
  device->guard.channel = -1;
  atomic_init(&device->zeroed, true);
  atomic_init(&device->cause, HAPI_SPIDAR_WELL);
  atomic_init(&device->told.cause, HAPI_SPIDAR_WELL);
  atomic_init(&device->told.string, -1);
  hapi_spidar_heat_init(&device->heat, 0.0);
  hap_status status = hapi_spidar_configure(device, args, detail);
  if (status < HAP_OK) {
    spidar_close(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

/* A force acts when its command has gone out; a read tells the positions of when the tick before
 * asked. */
static double delay_of(const hapi_spidar_device *device)
{
  return PERIOD_S + BYTE_S * (device->zero_count - HAPI_SPIDAR_ZEROS_BEFORE);
}

static void spidar_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  const hapi_spidar_device *device = self;
  const hapi_spidar_model *model = &device->model;
  snprintf(out->name, sizeof out->name, "spidar-%s", model->name);
  out->dof = (unsigned)model->dof;
  out->max_force = device->settings.max_force;
  out->max_torque = model->dof == 6 ? device->settings.max_torque : 0.0;
  out->mass = model->mass;
  out->damping = model->damping;
  out->friction = model->friction;
  out->delay = delay_of(device);
  for (int i = 0; i < model->strings; ++i) {
    out->quantum = fmax(out->quantum, fabs(model->metres_per_count[i]));
  }
}

static const char *text_of(hapi_spidar_cause cause)
{
  switch (cause) {
    case HAPI_SPIDAR_WELL:
      return "";
    case HAPI_SPIDAR_HUNG_UP:
      return "the port is gone: was the cable pulled?";
    case HAPI_SPIDAR_SILENT:
      return "no whole answer within the timeout: are all boards switched on?";
    case HAPI_SPIDAR_JUMPED:
      return "positions jumped further than a string can go: was a board reset?";
    case HAPI_SPIDAR_MISFIT:
      return "the lengths of the strings fit no pose: is one slack or broken, is the model right, "
             "was the grip at home at the start?";
    case HAPI_SPIDAR_STALLED:
      return "nothing was written for too long and the guard took the force off";
    case HAPI_SPIDAR_UNGUARDED:
      return "the guard process, which takes the force off when this program dies, could not be "
             "started: are there too many processes or open files? stall=0 goes without it";
    case HAPI_SPIDAR_GUARD_LOST:
      return "the guard process, which takes the force off when this program dies, has gone: was "
             "it killed? A restart of the device starts it again";
    case HAPI_SPIDAR_NOT_OPENED:
      return "the port does not open or no board answers";
    case HAPI_SPIDAR_OTHER_BOARDS:
      return "not the boards that were there before answer";
  }
  return "";
}

static void explain_string(hapi_spidar_device *device, int string, hap_detail *out)
{
  double off = 1e-3 * atomic_load(&device->told.off_um); /* mm */
  (void)hapi_fail(out, HAP_ERROR_DEVICE,
                  "%.200s: string %d is %.1f mm too %s for the others: %s, or its encoder is wrong",
                  device->serial.path, string, fabs(off), off > 0.0 ? "long" : "short",
                  off > 0.0 ? "is it slack" : "is it broken or off the grip");
}

static void spidar_explain(void *self, hap_detail *out)
{
  hapi_spidar_device *device = self;
  hapi_spidar_cause cause = (hapi_spidar_cause)atomic_load(&device->told.cause);
  int wrong = atomic_load(&device->told.string);
  if (cause == HAPI_SPIDAR_MISFIT && wrong >= 0) {
    explain_string(device, wrong, out);
    return;
  }
  const char *text = text_of(cause);
  int error = atomic_load(&device->guard.error);
  bool unguarded = cause == HAPI_SPIDAR_UNGUARDED;
  if (text[0] != '\0') {
    (void)hapi_fail(out, HAP_ERROR_DEVICE, "%.100s: %s%s%.60s%s", device->serial.path, text,
                    unguarded ? ": " : "", unguarded ? strerror(error) : "",
                    atomic_load(&device->guard.pulse->rescued) ? "; " RESCUED_TEXT : "");
  }
}

const hap_device_ops hapi_spidar_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "spidar",
    .help =
        "SPIDAR on a serial port: [PORT][,model=NAME|FILE][,offset=x/y/z][,rotate=w/x/y/z]"
        "[,timeout=S][,stall=S][,max_force=N][,max_torque=NM]; docs/spidar.md",
    .pacing = HAP_PACING_HOST,
    .open = spidar_open,
    .describe = spidar_describe,
    .start = spidar_start,
    .read = spidar_read,
    .write = spidar_write,
    .zero = spidar_zero,
    .stop = spidar_stop,
    .close = spidar_close,
    .held = spidar_held,
    .explain = spidar_explain,
};
