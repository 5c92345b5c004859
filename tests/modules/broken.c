/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device that is right in all, dof 6, but for what its argument says: "break=NAME". A module,
 * like those that people write. break=none: nothing is wrong. */

#define _POSIX_C_SOURCE 200809L

#include <hapode/device_impl.h>

#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define FORCE_MAX 10.0
#define TORQUE_MAX 0.5
#define SMALL_FORCE 1.0 /* N, that no check may go beyond without being told to */
#define TURN 0.3        /* rad */
#define AXIS_FORCE 2.0  /* N */
#define RATE 12.0       /* rad/s */

typedef struct broken {
  char fault[40];
  bool started;
  int starts;
  int reads;
  int reads_pushed; /* since the first force */
  int64_t first_ns;
  int64_t before_ns;
  hap_wrench held;
  double held_axis;
  bool pushed; /* since it was opened */
  atomic_bool zeroed;
  atomic_bool disturbed;
  pthread_t loop;
  pthread_mutex_t lock;
} broken;

static hap_device_ops ops;
static hap_wrench shared;       /* of all devices, where that is the fault */
static hap_wrench of_last_life; /* likewise */
static int closes;

static const hap_wrench some = {{1.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};

static bool fault_is(const broken *d, const char *fault)
{
  return strcmp(d->fault, fault) == 0;
}

static void rest_ms(double ms)
{
  const struct timespec time = {0, (long)(1e6 * ms)};
  nanosleep(&time, NULL);
}

static int64_t clock_now(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void *wait_for_ever(void *unused)
{
  for (;;) {
    rest_ms(500.0);
  }
  return unused;
}

static void memory_leak(const broken *d)
{
  pthread_t thread;
  static void *volatile kept;
  if (fault_is(d, "leak_memory")) {
    kept = malloc(5000);
    memset(kept, 1, 5000);
  } else if (fault_is(d, "leak_file")) {
    (void)!open("/dev/null", O_RDONLY);
  } else if (fault_is(d, "leak_thread")) {
    (void)pthread_create(&thread, NULL, wait_for_ever, NULL);
  }
}

static void wrench_hold(broken *d, const hap_wrench *wrench)
{
  d->held = *wrench;
  if (fault_is(d, "shared")) {
    shared = *wrench;
  }
  atomic_store(&d->zeroed, false);
}

/* ---- operations ---- */

static hap_status broken_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  static const char key[] = "break=";
  broken *d = calloc(1, sizeof *d);
  if (d == NULL) {
    return HAP_ERROR_MEMORY;
  }
  const char *fault = strncmp(args, key, strlen(key)) == 0 ? args + strlen(key) : "none";
  snprintf(d->fault, sizeof d->fault, "%.*s", (int)strcspn(fault, ","), fault);
  const char *rest = strchr(fault, ',');
  ops.help = fault_is(d, "help_of_two_lines") ? "two\nlines" : "a device for tests: break=NAME";
  if (rest != NULL && strcmp(rest, ",pacing=host") == 0) {
    ops.pacing = HAP_PACING_HOST;
  } else if (rest != NULL && strcmp(rest, ",pacing=device") == 0) {
    ops.pacing = HAP_PACING_DEVICE;
  } else if (rest != NULL && !fault_is(d, "takes_any_argument")) {
    snprintf(detail->text, sizeof detail->text, "%s",
             fault_is(d, "silent_refusal") ? "" : "there is no such argument");
    *self = fault_is(d, "self_of_failure") ? &shared : NULL;
    free(d);
    return HAP_ERROR_ARGUMENT;
  }
  pthread_mutex_init(&d->lock, NULL);
  atomic_init(&d->zeroed, true);
  if (fault_is(d, "force_at_open")) {
    wrench_hold(d, &some);
  } else if (fault_is(d, "force_of_last_life") && closes > 0) {
    wrench_hold(d, &of_last_life);
  }
  memory_leak(d);
  *self = d;
  return HAP_OK;
}

static void broken_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  const broken *d = self;
  out->dof = 6;
  out->effector_count = fault_is(d, "two_effectors") ? 2 : 1;
  out->max_force = fault_is(d, "info_changes") && d->started ? 2.0 * FORCE_MAX : FORCE_MAX;
  out->max_torque = TORQUE_MAX;
  out->measures_velocity = fault_is(d, "measures_twice") ? 2 : 1;
  out->axis_count = 1;
  out->led_count = 2;
  out->vibrator_count = 1;
  for (int i = 0; i < 3; ++i) {
    double shift = fault_is(d, "workspace_is_elsewhere") ? 0.1 : 0.0;
    out->workspace_low[i] = shift - 0.05;
    out->workspace_high[i] = shift + 0.05;
  }
}

static void broken_describe_axis(void *self, uint32_t effector, uint32_t axis, hap_axis_info *out)
{
  (void)self;
  (void)effector;
  (void)axis;
  out->kind = HAP_AXIS_GRIPPER;
  out->unit = HAP_AXIS_METRES;
  out->high = 0.05;
  out->max_force = AXIS_FORCE;
}

static hap_status broken_start(void *self)
{
  broken *d = self;
  ++d->starts;
  if (fault_is(d, "start_fails") || (fault_is(d, "starts_once") && d->starts > 1) ||
      (fault_is(d, "unplugged_for_ever") && d->reads > 500) ||
      (fault_is(d, "unplugged") && d->reads > 0 && d->starts < 4)) {
    return HAP_ERROR_DEVICE;
  }
  if (fault_is(d, "start_resumes") && d->starts > 1) {
    atomic_store(&d->zeroed, false);
  }
  if (fault_is(d, "force_at_start")) {
    wrench_hold(d, &some);
  }
  d->loop = pthread_self();
  d->first_ns = 0;
  d->pushed = d->pushed && !fault_is(d, "zero_is_for_ever");
  d->started = true;
  return HAP_OK;
}

/* A sine along x, y and about z. */
static void hand_move(const broken *d, double t, hap_pose *pose, hap_twist *twist)
{
  double s = sin(RATE * t);
  double c = RATE * cos(RATE * t);
  double wrong = fault_is(d, "twist_is_double")    ? 2.0
                 : fault_is(d, "twist_is_against") ? -1.0
                                                   : 1.0;
  double turned = fault_is(d, "twist_in_degrees") ? 57.3 : 1.0;
  double scale = fault_is(d, "quaternion_is_not_unit") ? 1.01 : 1.0;
  *pose = (hap_pose){{0.02 * s, 0.01 * s, 0.0},
                     {scale * cos(0.5 * TURN * s), 0.0, 0.0, scale * sin(0.5 * TURN * s)}};
  *twist = (hap_twist){{wrong * 0.02 * c, wrong * 0.01 * c, 0.0}, {0.0, 0.0, turned * TURN * c}};
}

static hap_status status_of_read(broken *d, int64_t time_ns)
{
  bool late = d->before_ns != 0 && time_ns - d->before_ns > 200000000;
  d->before_ns = time_ns;
  if (!d->started && !fault_is(d, "read_before_start") &&
      !(fault_is(d, "read_after_stop") && d->starts > 0)) {
    return HAP_ERROR_STATE;
  }
  if ((fault_is(d, "pause_is_fatal") && late) || (fault_is(d, "read_fails") && d->reads > 200) ||
      (fault_is(d, "zero_disturbs") && atomic_load(&d->disturbed)) ||
      ((fault_is(d, "unplugged") || fault_is(d, "unplugged_for_ever")) && d->starts == 1 &&
       d->reads > 500)) {
    return HAP_ERROR_DEVICE;
  }
  return fault_is(d, "odd_status") ? (hap_status)42 : HAP_OK;
}

static void spoil_read(const broken *d, hap_pose *pose, hap_twist *twist)
{
  const double nan = (double)NAN;
  if (fault_is(d, "pose_is_nan") && d->reads % 50 == 49) {
    pose->position[1] = nan;
  } else if (fault_is(d, "pose_is_far")) {
    pose->position[0] = 1e30;
  } else if (fault_is(d, "runs_away")) {
    pose->position[2] += 5e-4 * d->reads_pushed;
  } else if (fault_is(d, "twist_is_nan")) {
    twist->angular[2] = nan;
  } else if (fault_is(d, "jumps") && d->reads % 100 == 99) {
    pose->position[0] += 0.2;
  } else if (fault_is(d, "read_is_slow")) {
    rest_ms(ops.pacing == HAP_PACING_DEVICE ? 2.5 : 1.5);
  } else if (fault_is(d, "read_hangs")) {
    rest_ms(990.0);
    (void)wait_for_ever(NULL);
  }
}

static hap_status broken_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  broken *d = self;
  hap_pose here;
  if (fault_is(d, "zero_locks")) {
    pthread_mutex_lock(&d->lock);
    rest_ms(0.3);
    pthread_mutex_unlock(&d->lock);
  }
  if (ops.pacing == HAP_PACING_DEVICE && d->started) {
    rest_ms(0.9); /* its own clock */
    time_ns = clock_now();
  }
  hap_status status = status_of_read(d, time_ns);
  if (status < HAP_OK) {
    return status;
  }
  d->first_ns = d->first_ns == 0 ? time_ns : d->first_ns;
  ++d->reads;
  d->reads_pushed += d->pushed;
  hand_move(d, 1e-9 * (double)(time_ns - d->first_ns), &here, &in->twist);
  spoil_read(d, &here, &in->twist);
  if (fault_is(d, "pose_is_not_filled_in")) {
    memcpy(in->pose.position, here.position, sizeof here.position);
  } else {
    in->pose = here;
  }
  if (!fault_is(d, "buttons_are_not_filled_in")) {
    in->buttons = 0;
  }
  const double turns = 3.0 * 6.283185307179586; /* 1/s */
  double angle = turns * 1e-9 * (double)(time_ns - d->first_ns);
  in->axes[0] = fault_is(d, "axis_is_nan")      ? (double)NAN
                : fault_is(d, "axis_is_beyond") ? 0.06
                                                : 0.02 + 0.01 * sin(angle);
  in->axis_rates[0] = 0.01 * turns * cos(angle) *
                      (fault_is(d, "axis_rate_is_double")    ? 2.0
                       : fault_is(d, "axis_rate_is_against") ? -1.0
                       : fault_is(d, "axis_rate_is_none")    ? 0.0
                                                             : 1.0);
  if (fault_is(d, "two_effectors")) { /* the second one as the first, 10 mm beside it */
    out[1]->pose = in->pose;
    out[1]->pose.position[1] += 0.01;
    out[1]->twist = in->twist;
    out[1]->buttons = 0;
    out[1]->axes[0] = in->axes[0];
    out[1]->axis_rates[0] = in->axis_rates[0];
  }
  return status;
}

static double vector_norm(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static bool vector_shorten(const broken *d, double v[3], double limit)
{
  bool beyond = vector_norm(v) > limit;
  if (fault_is(d, "no_limit")) {
    return beyond;
  }
  double scale = beyond ? limit / vector_norm(v) : 1.0;
  for (int i = 0; i < 3; ++i) {
    v[i] =
        fault_is(d, "limit_per_axis") ? fmin(fmax(v[i], -0.5 * limit), 0.5 * limit) : scale * v[i];
  }
  return beyond;
}

static bool is_finite(const hap_wrench *w)
{
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += 0.0 * w->force[i] + 0.0 * w->torque[i];
  }
  return sum == 0.0;
}

static hap_status check_write(broken *d, const hap_wrench *wanted)
{
  bool finite = is_finite(wanted);
  if (!d->started && !fault_is(d, "write_before_start") &&
      !(fault_is(d, "write_after_stop") && d->starts > 0)) {
    return HAP_ERROR_STATE;
  }
  if ((fault_is(d, "runs_away") && d->reads_pushed > 110 && vector_norm(wanted->force) > 0.0) ||
      (fault_is(d, "refuses_all_force") &&
       vector_norm(wanted->force) + vector_norm(wanted->torque) > 0.0) ||
      (fault_is(d, "refuses_much_force") &&
       !(finite && vector_norm(wanted->force) <= SMALL_FORCE))) {
    puts("# it was asked for what this check must not ask for");
    return HAP_ERROR_DEVICE;
  }
  if (fault_is(d, "zero_is_for_ever") && atomic_load(&d->zeroed) && d->pushed) {
    return HAP_ERROR_DEVICE;
  }
  if (!finite && fault_is(d, "nan_is_held")) {
    wrench_hold(d, &some);
  }
  return finite || fault_is(d, "nan_is_taken") ? HAP_OK : HAP_ERROR_ARGUMENT;
}

/* The force of the axis; true: it was shortened. */
static bool axis_give(broken *d, double wanted, double *reached)
{
  double most = fault_is(d, "axis_has_no_limit") ? 1e9 : AXIS_FORCE;
  double factor = fault_is(d, "axis_gives_double")    ? 2.0
                  : fault_is(d, "axis_gives_against") ? -1.0
                                                      : 1.0;
  double given = fmin(fmax(factor * wanted, -most), most);
  d->held_axis = given;
  if (!fault_is(d, "axis_reached_is_not_filled_in")) {
    *reached = given;
  }
  return fabs(wanted) > AXIS_FORCE;
}

static hap_status broken_write(void *self, const hap_device_output *const wanted[],
                               hap_device_output *const reached[])
{
  broken *d = self;
  hap_status status = check_write(d, &wanted[0]->wrench);
  if (status < HAP_OK) {
    return status;
  }
  if (!(fabs(wanted[0]->axis_forces[0]) <= 1e300)) {
    d->held_axis = fault_is(d, "axis_nan_is_held") ? 1.0 : 0.0;
    atomic_store(&d->zeroed, !fault_is(d, "axis_nan_is_held"));
    return HAP_ERROR_ARGUMENT;
  }
  if (fault_is(d, "vibrators_are_refused") && wanted[0]->vibrators[0].amplitude > 0.0) {
    return HAP_ERROR_DEVICE;
  }
  hap_wrench given = wanted[0]->wrench;
  double factor = fault_is(d, "gives_double") ? 2.0 : fault_is(d, "gives_against") ? -1.0 : 1.0;
  for (int i = 0; i < 3; ++i) {
    given.force[i] *= factor;
    given.torque[i] *= factor;
  }
  bool saturated = vector_shorten(d, given.force, FORCE_MAX);
  saturated = vector_shorten(d, given.torque, TORQUE_MAX) || saturated;
  bool axis_saturated = axis_give(d, wanted[0]->axis_forces[0], &reached[0]->axis_forces[0]);
  d->pushed = d->pushed || vector_norm(given.force) > 0.0;
  if (!fault_is(d, "reached_is_not_filled_in")) {
    reached[0]->wrench = given;
  }
  if (fault_is(d, "two_effectors")) {
    reached[1]->wrench = wanted[1]->wrench;
    reached[1]->axis_forces[0] = wanted[1]->axis_forces[0];
  }
  if (fault_is(d, "reached_is_a_lie")) {
    for (int i = 0; i < 3; ++i) {
      given.force[i] *= 0.5;
    }
  }
  wrench_hold(d, &given);
  if (fault_is(d, "write_is_slow")) {
    rest_ms(1.5);
  }
  if (fault_is(d, "odd_write_status")) {
    return (hap_status)42;
  }
  saturated = saturated && !fault_is(d, "limit_is_not_said");
  return saturated || axis_saturated ? HAP_SATURATED : HAP_OK;
}

static void broken_zero(void *self)
{
  broken *d = self;
  if (fault_is(d, "zero_locks")) {
    pthread_mutex_lock(&d->lock);
    pthread_mutex_unlock(&d->lock);
  } else if (fault_is(d, "zero_is_slow")) {
    rest_ms(1.5);
  } else if (fault_is(d, "zero_disturbs") && d->started &&
             !pthread_equal(d->loop, pthread_self())) {
    atomic_store(&d->disturbed, true);
  } else if (fault_is(d, "zero_does_nothing") && d->started) {
    return;
  } else if (fault_is(d, "shared")) {
    memset(&shared, 0, sizeof shared);
  }
  atomic_store(&d->zeroed, true);
}

static void broken_stop(void *self)
{
  broken *d = self;
  bool again = !d->started && d->starts > 0;
  if (!fault_is(d, "stop_keeps_force")) {
    broken_zero(self);
  }
  d->started = false;
  if ((fault_is(d, "second_stop_gives_force") && again) ||
      (fault_is(d, "stop_before_start_gives_force") && d->starts == 0)) {
    wrench_hold(d, &some);
  } else if (fault_is(d, "zero_does_nothing")) {
    atomic_store(&d->zeroed, true);
  }
}

static void broken_close(void *self)
{
  broken *d = self;
  if (d->pushed) {
    of_last_life = some;
    ++closes;
  }
  pthread_mutex_destroy(&d->lock);
  free(d);
}

static void broken_held(void *self, hap_device_output *const out[])
{
  const broken *d = self;
  bool off = atomic_load(&d->zeroed) && !fault_is(d, "axis_is_not_zeroed");
  out[0]->axis_forces[0] = off ? 0.0 : d->held_axis;
  memset(&out[0]->wrench, 0, sizeof out[0]->wrench);
  if (fault_is(d, "shared")) {
    out[0]->wrench = shared;
  } else if (!atomic_load(&d->zeroed)) {
    out[0]->wrench = d->held;
  }
}

static hap_device_ops ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "broken",
    .pacing = HAP_PACING_VIRTUAL,
    .open = broken_open,
    .describe = broken_describe,
    .start = broken_start,
    .read = broken_read,
    .write = broken_write,
    .zero = broken_zero,
    .stop = broken_stop,
    .close = broken_close,
    .held = broken_held,
    .describe_axis = broken_describe_axis,
};

const hap_device_ops *hapode_device_module(uint32_t host_abi)
{
  (void)host_abi;
  return &ops;
}
