/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A device to copy: three axes with encoders and motors, polled by the host. It is a loadable
 * module that needs nothing but hapode/device_impl.h, where the contract of each function stands;
 * docs/writing-a-device.md goes through this file from top to bottom. What is marked REPLACE is
 * about the toy hardware of the skeleton. */

#include <hapode/device_impl.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hardware.h"

/* REPLACE: the figures of your hardware. */
#define COUNT 1e-5     /* m of a count of the encoders */
#define NEWTON_MA 0.01 /* N of a milliampere */
#define FORCE_MAX 3.0  /* N that it can give for long in every direction */

typedef struct skeleton {
  hardware *board;
  bool started;
  double limit;       /* N */
  int64_t read_ns;    /* of the read before; 0: there was none */
  double position[3]; /* m, then */
  double velocity[3]; /* m/s */
} skeleton;

/* ---- open and close ---- */

/* REPLACE: the arguments of your device, all after "module:/path/of/it.so,". What is not understood
 * is refused: a slip of the pen must not leave a limit where it was. */
static hap_status read_arguments(skeleton *device, const char *args, hap_detail *detail)
{
  static const char key[] = "limit=";
  device->limit = FORCE_MAX;
  if (*args == '\0') {
    return HAP_OK;
  }
  char *end = NULL;
  double limit = strncmp(args, key, strlen(key)) == 0 ? strtod(args + strlen(key), &end) : 0.0;
  if (end == NULL || *end != '\0' || !(limit > 0.0 && limit <= FORCE_MAX)) {
    snprintf(detail->text, sizeof detail->text,
             "skeleton: expected limit=N, above 0 and at most %g newtons, not '%.60s'", FORCE_MAX,
             args);
    return HAP_ERROR_ARGUMENT;
  }
  device->limit = limit;
  return HAP_OK;
}

static hap_status skeleton_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context; /* of an application that makes a device of its own: not of a module */
  skeleton *device = calloc(1, sizeof *device);
  if (device == NULL) {
    snprintf(detail->text, sizeof detail->text, "skeleton: out of memory");
    return HAP_ERROR_MEMORY;
  }
  hap_status status = read_arguments(device, args, detail);
  if (status == HAP_OK) {
    device->board = hardware_open(detail->text, sizeof detail->text);
    status = device->board != NULL ? HAP_OK : HAP_ERROR_DEVICE;
  }
  if (status != HAP_OK) {
    free(device);
    return status;
  }
  *self = device;
  return HAP_OK;
}

/* The device was stopped before. */
static void skeleton_close(void *self)
{
  skeleton *device = self;
  hardware_close(device->board);
  free(device);
}

/* REPLACE: what you know of your device; leave at 0 what you do not know, and let hapode-run
 * --identify measure mass, damping, friction, delay and quantum. */
static void skeleton_describe(void *self, uint32_t effector, hap_device_info *out)
{
  const skeleton *device = self;
  (void)effector; /* there is one */
  out->dof = 3;
  out->max_force = device->limit;
  out->quantum = COUNT;
  out->measures_velocity = 0; /* a difference of counts: the library makes a better one */
}

/* ---- start and stop ---- */

static hap_status skeleton_start(void *self)
{
  skeleton *device = self;
  if (!hardware_enable(device->board)) {
    return HAP_ERROR_DEVICE;
  }
  device->read_ns = 0;
  device->started = true;
  return HAP_OK;
}

static void skeleton_zero(void *self)
{
  const skeleton *device = self;
  hardware_off(device->board);
}

static void skeleton_stop(void *self)
{
  skeleton *device = self;
  device->started = false;
  hardware_disable(device->board);
}

/* ---- every tick ---- */

/* REPLACE: your kinematics. Counts to metres, in a right-handed frame whose origin is where the
 * grip rests; the velocity is a difference to the read before. */
static void pose_from_counts(skeleton *device, int64_t time_ns, const int32_t counts[3])
{
  double length = 1e-9 * (double)(time_ns - device->read_ns);
  bool known = device->read_ns != 0;
  for (int axis = 0; axis < 3; ++axis) {
    double position = COUNT * counts[axis];
    if (!known) {
      device->velocity[axis] = 0.0;
    } else if (length > 0.0) {
      device->velocity[axis] = (position - device->position[axis]) / length;
    }
    device->position[axis] = position;
  }
  device->read_ns = time_ns;
}

static hap_status skeleton_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  skeleton *device = self;
  int32_t counts[3];
  if (!device->started) {
    return HAP_ERROR_STATE;
  }
  if (!hardware_read(device->board, counts)) {
    return HAP_ERROR_DEVICE;
  }
  pose_from_counts(device, time_ns, counts);
  in->pose = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  in->twist = (hap_twist){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  memcpy(in->pose.position, device->position, sizeof in->pose.position);
  memcpy(in->twist.linear, device->velocity, sizeof in->twist.linear);
  in->buttons = 0;
  return HAP_OK;
}

/* To at most that norm, its direction kept; true when it had to. */
static bool force_shorten(double force[3], double limit)
{
  double norm = hypot(hypot(force[0], force[1]), force[2]);
  if (norm <= limit) {
    return false;
  }
  for (int axis = 0; axis < 3; ++axis) {
    force[axis] = force[axis] / norm * limit;
  }
  return true;
}

/* REPLACE: your statics. Rounded towards zero, so that rounding goes beyond no limit; reached is
 * what the rounded currents give. */
static hap_status skeleton_write(void *self, const hap_device_output *const wanted[],
                                 hap_device_output *const reached[])
{
  const skeleton *device = self;
  const double *asked = wanted[0]->wrench.force;
  double *given = reached[0]->wrench.force;
  double force[3] = {asked[0], asked[1], asked[2]};
  int16_t current[3];
  if (!device->started) {
    return HAP_ERROR_STATE;
  }
  if (!(isfinite(force[0]) && isfinite(force[1]) && isfinite(force[2]))) {
    hardware_off(device->board); /* NaN must not become a current */
    return HAP_ERROR_ARGUMENT;
  }
  bool shortened = force_shorten(force, device->limit);
  memset(reached[0]->wrench.torque, 0, sizeof reached[0]->wrench.torque);
  for (int axis = 0; axis < 3; ++axis) {
    current[axis] = (int16_t)(force[axis] / NEWTON_MA);
    given[axis] = NEWTON_MA * current[axis];
  }
  if (!hardware_write(device->board, current)) {
    return HAP_ERROR_DEVICE;
  }
  return shortened ? HAP_SATURATED : HAP_OK;
}

static void skeleton_held(void *self, hap_device_output *const out[])
{
  const skeleton *device = self;
  int16_t current[3];
  hardware_currents(device->board, current);
  memset(&out[0]->wrench, 0, sizeof out[0]->wrench);
  for (int axis = 0; axis < 3; ++axis) {
    out[0]->wrench.force[axis] = NEWTON_MA * current[axis];
  }
}

/* ---- the table ---- */

static const hap_device_ops skeleton_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "skeleton",
    .help = "a device to copy, with a toy of three axes: limit=N",
    .pacing = HAP_PACING_HOST,
    .open = skeleton_open,
    .describe = skeleton_describe,
    .start = skeleton_start,
    .read = skeleton_read,
    .write = skeleton_write,
    .zero = skeleton_zero,
    .stop = skeleton_stop,
    .close = skeleton_close,
    .held = skeleton_held,
};

const hap_device_ops *hapode_device_module(uint32_t host_abi)
{
  return host_abi == HAP_DEVICE_ABI ? &skeleton_ops : NULL;
}
