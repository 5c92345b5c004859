/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "vr_device.h"

#include <math.h>

#include "vr_pose.h"

#define FRESH 4u
#define HOLD_S 0.05  /* a pose is carried on for so long */
#define STALE_S 0.1  /* and then not believed any more */
#define CATCH_S 0.01 /* a new pose that is off the line is reached in about this time */

void vr_device_init(vr_device *device)
{
  device->front = 1, device->back = 2, device->shown.quat_wxyz[0] = 1.0;
  atomic_store(&device->middle, 0u);
  atomic_store(&device->force, 0.0);
}

void vr_device_put(vr_device *device, const vr_sample *sample)
{
  device->samples[device->back] = *sample;
  device->back = atomic_exchange(&device->middle, device->back | FRESH) & 3u;
}

double vr_device_force(vr_device *device)
{
  return atomic_load(&device->force);
}

static hap_status vr_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)args, (void)detail;
  *self = context;
  return HAP_OK;
}

static void vr_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)self, (void)effector;
  out->dof = 6, out->max_force = 20, out->max_torque = 1, out->measures_velocity = 1;
}

static hap_status vr_start(void *self)
{
  vr_device *device = self;
  device->has_shown = false;
  return HAP_OK;
}

static hap_status vr_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  vr_device *device = self;
  if ((atomic_load(&device->middle) & FRESH) != 0) {
    device->front = atomic_exchange(&device->middle, device->front) & 3u;
  }
  const vr_sample *newest = &device->samples[device->front];
  double age = 1e-9 * (double)(time_ns - newest->time_ns);
  bool is_good = newest->is_good && age < STALE_S;
  hap_twist twist = is_good && age < HOLD_S ? newest->twist : (hap_twist){{0}, {0}};
  if (is_good) {
    hap_pose now = newest->pose;
    double dt = fmin(1e-9 * (double)(time_ns - device->shown_ns), CATCH_S);
    vr_pose_advance(&now, &newest->twist, fmin(age, HOLD_S));
    vr_pose_advance(&device->shown, &twist, dt);
    vr_pose_approach(&device->shown, &now, device->has_shown ? dt / CATCH_S : 1.0);
  }
  device->has_shown = is_good; /* what comes back may be anywhere */
  device->shown_ns = time_ns;
  out[0]->pose = device->shown;
  out[0]->twist = twist;
  return is_good ? HAP_OK : HAP_STALE;
}

static hap_status vr_write(void *self, const hap_device_output *const wanted[],
                           hap_device_output *const reached[])
{
  vr_device *device = self;
  const double *f = wanted[0]->wrench.force;
  double size = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  atomic_store(&device->force, isfinite(size) ? size : 0.0);
  reached[0]->wrench = wanted[0]->wrench; /* felt, though not as a push */
  return HAP_OK;
}

static void vr_off(void *self)
{
  vr_device *device = self;
  atomic_store(&device->force, 0.0);
}

const hap_device_ops *vr_device_ops(void)
{
  static const hap_device_ops ops = {.abi = HAP_DEVICE_ABI,
                                     .size = sizeof ops,
                                     .name = "vr",
                                     .help = "a tracked controller",
                                     .pacing = HAP_PACING_HOST,
                                     .open = vr_open,
                                     .describe = vr_describe,
                                     .start = vr_start,
                                     .read = vr_read,
                                     .write = vr_write,
                                     .zero = vr_off,
                                     .stop = vr_off,
                                     .close = vr_off};
  return &ops;
}
