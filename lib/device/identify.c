/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "device/identify.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/def.h"
#include "base/log.h"
#include "base/pulse.h"
#include "base/vec.h"
#include "device/device.h"
#include "device/emergency.h"
#include "device/watchdog.h"

#define FORCE_SHARE 0.3    /* of the device's own limit */
#define FORCE_UNKNOWN 1.0  /* N, for a device that does not know its limit */
#define REST_S 0.1         /* before an axis */
#define RISE_S 2.0         /* of the force, from zero to its limit, until the device moves */
#define MOVED 1e-3         /* m: it does */
#define SWING_S 8.0        /* to and fro */
#define BRAKE_S 0.4        /* behind an axis */
#define AXIS_S 12.0        /* more than all these */
#define TRAVEL_SHARE 0.2   /* of the bound, for a swing */
#define SPEED_SHARE 0.5    /* of the bound */
#define ACCELERATION 4.0   /* m/s^2 that the force is adjusted to */
#define BRAKE_SPEED 0.2    /* m/s that the brake meets with the whole force */
#define WAVES_OF_A_SPEED 2 /* turns before the other speed is taken */
#define WAVE_S_MAX 0.5     /* without a turn for so long: more force */
#define SPEED_SAMPLES 8u
#define RESIDUAL_MOST 0.1
#define LATE_PERIODS 3.0    /* from tick to tick */
#define STIFFNESS_MOST 30.0 /* N/m; a hand that holds it loosely has 100 and more */
#define WATCH_S 0.1
#define AXES 3

typedef struct run {
  hap_device *device;
  const hap_identify_def *def;
  hap_detail *detail;
  double limit;         /* N */
  uint64_t emergencies; /* calls of hap_emergency_zero before it began */
  int64_t start_ns;
  uint64_t tick;
  double time; /* s since start */
  double watched;
  double position[3];
  double origin[3]; /* where it began */
  int axis;
  hapi_identify_record records[AXES];
  hapi_pulse pulse;
  hapi_watchdog watchdog;
  _Atomic int blocked; /* the watchdog has taken its force off */
} run;

static const hap_identify_def def_defaults = {
    .cookie = 0x48494431u,
    .rate_hz = 1000.0,
    .max_travel = 0.05,
    .max_speed = 0.5,
};
static const hapi_def_type def_type = HAPI_DEF_TYPE(hap_identify_def, def_defaults);

void hap_identify_def_init(hap_identify_def *def, size_t size_of_def)
{
  hapi_def_init(&def_type, def, size_of_def);
}

static hap_status def_check(const hap_identify_def *def, double limit, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, rate_hz, 100.0, 20000.0),
      HAPI_RULE(def, max_force, 0.0, limit),
      HAPI_RULE(def, max_travel, 0.005, 0.5),
      HAPI_RULE(def, max_speed, 0.05, 2.0),
  };
  return hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail);
}

/* ---- one tick ---- */

static hap_status run_fail(const run *r, const char *what)
{
  return hapi_fail(r->detail, HAP_ERROR_DEVICE, "device '%s', axis %c: %s",
                   hapi_device_info(r->device)->name, "xyz"[r->axis], what);
}

/* The time of the next tick, when it has come. */
static int64_t await_tick(run *r)
{
  uint32_t pacing = r->device->ops->pacing;
  int64_t due_ns = r->start_ns + hapi_clock_deadline(++r->tick, r->def->rate_hz);
  if (pacing == HAP_PACING_VIRTUAL) {
    return due_ns;
  }
  if (pacing == HAP_PACING_HOST) {
    hapi_clock_sleep_until(due_ns);
  }
  int64_t now_ns = hapi_clock_now();
  double passed = (double)(now_ns - r->start_ns) / (double)HAPI_NS_PER_S * r->def->rate_hz;
  if (passed > (double)r->tick + 1.0) {
    r->tick = (uint64_t)passed; /* missed ticks are not made up for in a burst */
  }
  return now_ns;
}

static hap_status read_device(run *r)
{
  const double *position = r->device->effectors[0].input.pose.position;
  hapi_pulse_beat(&r->pulse, HAPI_PHASE_WAIT, 0);
  int64_t now_ns = await_tick(r);
  hapi_pulse_beat(&r->pulse, HAPI_PHASE_READ, 0);
  if (!hapi_device_did(hapi_device_read(r->device, now_ns))) {
    return run_fail(r, "it cannot be read");
  }
  if (!hapi_finite(position, 3)) {
    return run_fail(r, "its position is not finite");
  }
  if (r->device->ops->pacing == HAP_PACING_DEVICE) {
    now_ns = hapi_clock_now(); /* the read has waited */
  }
  r->time = (double)(now_ns - r->start_ns) / (double)HAPI_NS_PER_S;
  hapi_v3_copy(position, r->position);
  return HAP_OK;
}

static hap_status sample_record(run *r)
{
  HAPI_ASSERT_INDEX(r->axis, AXES);
  hapi_identify_record *record = &r->records[r->axis];
  if (record->count == record->capacity) {
    return run_fail(r, "it gives more than rate_hz positions a second; raise rate_hz");
  }
  record->samples[record->count++] = (hapi_identify_sample){r->time, r->position[r->axis], 0.0};
  return HAP_OK;
}

/* Over the last samples of the axis. */
static double speed_now(const run *r)
{
  const hapi_identify_record *record = &r->records[r->axis];
  HAPI_ASSERT(record->count > 0);
  uint32_t back = record->count - 1 < SPEED_SAMPLES ? record->count - 1 : SPEED_SAMPLES;
  const hapi_identify_sample *now = &record->samples[record->count - 1];
  double length = now->time - now[-(int)back].time;
  return length > 0.0 ? (now->position - now[-(int)back].position) / length : 0.0;
}

static hap_status check_limits(const run *r)
{
  double way[3];
  char text[160];
  hapi_v3_sub(r->position, r->origin, way);
  if (hapi_v3_norm(way) > r->def->max_travel) {
    snprintf(text, sizeof text,
             "it has moved %.0f mm from where it began, more than %.0f mm: its force was taken off",
             1e3 * hapi_v3_norm(way), 1e3 * r->def->max_travel);
    return run_fail(r, text);
  }
  if (fabs(speed_now(r)) > r->def->max_speed) {
    snprintf(text, sizeof text, "it moves at %.2f m/s, more than %.2f m/s: its force was taken off",
             fabs(speed_now(r)), r->def->max_speed);
    return run_fail(r, text);
  }
  return HAP_OK;
}

static hap_status progress_tell(run *r)
{
  if (r->def->watch == NULL || r->time < r->watched + WATCH_S) {
    return HAP_OK;
  }
  r->watched = r->time;
  double whole = AXES * (REST_S + 0.2 * RISE_S + SWING_S + BRAKE_S);
  return r->def->watch(r->def->user, fmin(r->time / whole, 1.0)) == 0 ? HAP_OK : HAP_END;
}

/* No force after hap_emergency_zero; one that was on its way meanwhile is taken off by the end. */
static hap_status force_write(run *r, double force)
{
  for (int i = 0; i < AXES; ++i) {
    r->device->effectors[0].wanted.wrench.force[i] = i == r->axis ? force : 0.0;
  }
  if (atomic_load(&r->blocked) != 0) {
    return run_fail(r, "it did not come back from a call in time: its force was taken off");
  }
  hapi_pulse_beat(&r->pulse, HAPI_PHASE_WRITE, 0);
  if (hapi_emergencies() == r->emergencies && !hapi_device_did(hapi_device_write(r->device))) {
    return run_fail(r, "it takes no force");
  }
  return hapi_emergencies() == r->emergencies
             ? HAP_OK
             : run_fail(r, "hap_emergency_zero was called: its force was taken off");
}

/* Gives the force, waits for the next tick and reads. Anything but HAP_OK ends the
 * identification. */
static hap_status tick_step(run *r, double force)
{
  hapi_identify_record *axis = &r->records[r->axis];
  HAPI_ASSERT(axis->count > 0 && fabs(force) <= r->limit);
  axis->samples[axis->count - 1].force = force;
  HAPI_TRY(force_write(r, force));
  HAPI_TRY(read_device(r));
  HAPI_TRY(sample_record(r));
  HAPI_TRY(check_limits(r));
  return progress_tell(r);
}

/* ---- the phases of an axis ---- */

/* More and more force until it moves; *level is then that force. */
static hap_status friction_search(run *r, double home, double *level)
{
  double begin = r->time;
  char text[160];
  *level = 0.0;
  while (fabs(r->position[r->axis] - home) < MOVED) {
    if (*level >= r->limit) {
      snprintf(text, sizeof text,
               "it does not move under %.2g N: is it held, at a stop, or switched off?", r->limit);
      return run_fail(r, text);
    }
    *level = fmin((r->time - begin) / RISE_S, 1.0) * r->limit;
    HAPI_TRY(tick_step(r, *level));
  }
  return HAP_OK;
}

/* To and fro between two speeds. */
typedef struct swing {
  double home;
  double level; /* N */
  double share; /* of the level in this wave */
  double direction;
  double speed; /* m/s, at which the force turns round */
  double turned;
  double peak; /* m/s, reached after the last turn in the direction before it, at that time */
  double peak_time;
  double top; /* speed that may be reached */
  int waves;
} swing;

static bool should_turn(const swing *s, double position, double velocity, double travel)
{
  double drift = fmin(fmax((position - s->home) / travel, -0.8), 0.8);
  return s->direction * velocity > s->speed * (1.0 - s->direction * drift) ||
         (s->direction * (position - s->home) > travel && s->direction * velocity > 0.0);
}

/* Behind a turn the speed still rises until the force has come through the device's delay. */
static void note_peak(swing *s, double now, double velocity)
{
  if (-s->direction * velocity > s->peak) {
    s->peak = -s->direction * velocity;
    s->peak_time = now;
  }
}

/* Force for the wanted acceleration and the speeds of the next wave: such that a wave does not go
 * further than travel. Two speeds tell damping from friction. */
static void next_wave(swing *s, double now, double velocity, const run *r)
{
  double travel = TRAVEL_SHARE * r->def->max_travel;
  double change = s->direction * velocity + fmax(s->peak, 0.0);
  double acceleration = fmax(change, 0.0) / fmax(now - s->peak_time, 1e-3);
  if (acceleration < 0.8 * ACCELERATION) {
    s->level = fmin(1.25 * s->level, r->limit);
  } else if (acceleration > 1.25 * ACCELERATION) {
    s->level *= 0.8;
  }
  s->top = fmin(fmin(1.25 * s->top, sqrt(acceleration * travel)), SPEED_SHARE * r->def->max_speed);
  bool slow = s->waves / WAVES_OF_A_SPEED % 2 == 1;
  s->speed = slow ? 0.5 * s->top : s->top;
  s->direction = -s->direction;
  s->turned = now;
  s->peak = 0.0;
  s->peak_time = now;
  ++s->waves;
  /* Under the same force every time a free mass moves by multiples of F/m T^2, like a quantum. */
  s->share = 1.0 - 0.1 * fmod(0.61803398874989485 * s->waves, 1.0);
}

static hap_status swing_about(run *r, double home, double *level)
{
  double travel = TRAVEL_SHARE * r->def->max_travel;
  double speed = 0.2 * SPEED_SHARE * r->def->max_speed;
  double direction = -copysign(1.0, r->position[r->axis] - home);
  swing s = {home, *level, 1.0, direction, speed, r->time, 0.0, r->time, speed, 0};
  for (double end = r->time + SWING_S; r->time < end;) {
    double velocity = speed_now(r);
    note_peak(&s, r->time, velocity);
    if (should_turn(&s, r->position[r->axis], velocity, travel)) {
      next_wave(&s, r->time, velocity, r);
    } else if (r->time - s.turned > WAVE_S_MAX) {
      s.level = fmin(1.25 * s.level, r->limit);
      s.turned = r->time;
    }
    HAPI_TRY(tick_step(r, s.direction * s.share * s.level));
  }
  *level = s.level;
  return HAP_OK;
}

static hap_status move_axis(run *r)
{
  double level = 0.0;
  HAPI_TRY(sample_record(r)); /* of where the last axis ended */
  for (double end = r->time + REST_S; r->time < end;) {
    HAPI_TRY(tick_step(r, 0.0));
  }
  double home = r->position[r->axis];
  HAPI_TRY(friction_search(r, home, &level));
  HAPI_TRY(swing_about(r, home, &level));
  for (double end = r->time + BRAKE_S; r->time < end;) {
    HAPI_TRY(tick_step(r, -level * fmin(fmax(speed_now(r) / BRAKE_SPEED, -1.0), 1.0)));
  }
  return HAP_OK;
}

static hap_status move_all(run *r)
{
  r->start_ns = r->device->ops->pacing == HAP_PACING_VIRTUAL ? 0 : hapi_clock_now();
  HAPI_TRY(read_device(r));
  hapi_v3_copy(r->position, r->origin);
  for (r->axis = 0; r->axis < AXES; ++r->axis) {
    HAPI_TRY(move_axis(r));
  }
  return HAP_OK;
}

/* ---- what it comes to ---- */

/* With a fault of the fit: whether the machine may be the reason, for what moved between two ticks
 * far apart was not seen. */
static hap_status fit_fail(const run *r, int axis, const char *what)
{
  const hapi_identify_record *record = &r->records[axis];
  char text[360];
  run at = *r;
  uint32_t late = 0;
  double longest = 0.0;
  for (uint32_t i = 1; i < record->count; ++i) {
    const double gap = record->samples[i].time - record->samples[i - 1].time;
    late += gap * r->def->rate_hz > LATE_PERIODS;
    longest = fmax(longest, gap);
  }
  const int used = snprintf(text, sizeof text, "%.200s", what);
  if (late > 0) {
    snprintf(text + used, sizeof text - (size_t)used,
             "; %u of %u ticks came late, by up to %.0f ms: end other programs, use a real-time "
             "priority, and try again",
             late, record->count, 1e3 * longest);
  }
  at.axis = axis;
  return run_fail(&at, text);
}

static hap_status add_axis(const run *r, int axis, hap_device_identity *io)
{
  HAPI_ASSERT_INDEX(axis, AXES);
  hapi_identify_fit fit;
  char text[200];
  hap_detail why = {""};
  hap_status status = hapi_identify_fit_record(&r->records[axis], &fit, &why);
  if (status < HAP_OK) {
    return fit_fail(r, axis, why.text);
  }
  if (fit.residual > RESIDUAL_MOST || fit.delay > HAPI_IDENTIFY_DELAY_MAX) {
    snprintf(text, sizeof text,
             "mass, damping, friction and a delay of at most %.0f ms do not explain %.0f %% of the "
             "force",
             1e3 * HAPI_IDENTIFY_DELAY_MAX, 100.0 * fit.residual);
    return fit_fail(r, axis, text);
  }
  if (fit.stiffness > STIFFNESS_MOST) {
    snprintf(text, sizeof text, "a spring of %.0f N/m pulls it back: does a hand hold it?",
             fit.stiffness);
    return fit_fail(r, axis, text);
  }
  io->mass = axis == 0 ? fit.mass : fmin(io->mass, fit.mass);
  io->damping = axis == 0 ? fit.damping : fmin(io->damping, fit.damping);
  io->friction = axis == 0 ? fit.friction : fmin(io->friction, fit.friction);
  io->delay = fmax(io->delay, fit.delay);
  io->quantum = fmax(io->quantum, hapi_identify_quantum(&r->records[axis]));
  io->residual = fmax(io->residual, fit.residual);
  return HAP_OK;
}

static void run_block(void *user, uint64_t word)
{
  run *r = user;
  (void)word;
  atomic_store(&r->blocked, 1);
}

static void run_tell(void *user, uint64_t word)
{
  const run *r = user;
  (void)word;
  hapi_log(HAP_LOG_ERROR, "device %s does not come back from a call: its force was taken off",
           hapi_device_info(r->device)->name);
}

static hap_status run_watch(run *r)
{
  const hapi_watchdog_def def = {.ops = r->device->ops,
                                 .self = r->device->self,
                                 .pulse = &r->pulse,
                                 .rate_hz = r->def->rate_hz,
                                 .blocked = run_block,
                                 .tell = run_tell,
                                 .user = r};
  return hapi_watchdog_start(&r->watchdog, &def) >= HAP_OK
             ? HAP_OK
             : hapi_fail(r->detail, HAP_ERROR_SYSTEM,
                         "the thread of the watchdog could not be started");
}

static hap_status run_device(run *r, hap_device_identity *out)
{
  const hap_device_ops *ops = r->device->ops;
  r->emergencies = hapi_emergencies();
  if (ops->start(r->device->self) < HAP_OK) {
    return hapi_fail(r->detail, HAP_ERROR_DEVICE, "device '%s' did not start",
                     hapi_device_info(r->device)->name);
  }
  bool known = hapi_emergency_add(ops, r->device->self);
  hap_status status =
      known ? run_watch(r)
            : hapi_fail(r->detail, HAP_ERROR_CAPACITY,
                        "all %d places for running devices are in use", HAPI_EMERGENCY_DEVICES);
  if (status >= HAP_OK) {
    status = move_all(r);
  }
  hapi_pulse_beat(&r->pulse, HAPI_PHASE_NONE, 0);
  while (!hapi_watchdog_stop(&r->watchdog)) { /* it uses what is on the stack here */
    run_tell(r, 0);
  }
  ops->zero(r->device->self);
  while (!hapi_emergency_remove(ops, r->device->self)) {
    run_tell(r, 0);
  }
  ops->stop(r->device->self);
  HAPI_TRY(status);
  hap_device_identity_init(out, sizeof *out);
  memcpy(out->device, hapi_device_info(r->device)->name, sizeof out->device);
  for (int axis = 0; axis < AXES; ++axis) {
    HAPI_TRY(add_axis(r, axis, out));
  }
  return HAP_OK;
}

static hap_status run_with_records(run *r, hap_device_identity *out)
{
  hap_status status = HAP_OK;
  uint32_t capacity = (uint32_t)(AXIS_S * r->def->rate_hz);
  for (int axis = 0; axis < AXES; ++axis) {
    r->records[axis].samples = hapi_alloc_array(capacity, sizeof *r->records[axis].samples);
    r->records[axis].capacity = capacity;
    if (r->records[axis].samples == NULL) {
      status = hapi_fail(r->detail, HAP_ERROR_MEMORY, "no memory for the identification");
    }
  }
  if (status == HAP_OK) {
    status = run_device(r, out);
  }
  for (int axis = 0; axis < AXES; ++axis) {
    hapi_free(r->records[axis].samples);
  }
  return status;
}

hap_status hap_device_identify(hap_device *device, const hap_identify_def *def,
                               hap_device_identity *out, hap_detail *detail)
{
  hap_detail unread;
  hap_identify_def known;
  hap_device_identity found;
  if (device == NULL || out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "hap_device_identify: device or out is NULL");
  }
  HAPI_TRY(hapi_def_read(&def_type, def, &known, detail));
  double limit = hapi_device_info(device)->max_force > 0.0
                     ? FORCE_SHARE * hapi_device_info(device)->max_force
                     : FORCE_UNKNOWN;
  HAPI_TRY(def_check(&known, limit, detail));
  if (!hapi_device_claim(device)) {
    return hapi_fail(detail, HAP_ERROR_STATE, "a pointer has the device");
  }
  run r = {.device = device, .def = &known, .detail = detail != NULL ? detail : &unread};
  r.limit = known.max_force > 0.0 ? known.max_force : limit;
  hap_status status = run_with_records(&r, &found);
  hapi_device_release(device);
  return status == HAP_OK ? hapi_device_identity_give(&found, out, detail) : status;
}
