/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FAKE_DEVICE_H
#define HAPODE_TESTS_FAKE_DEVICE_H

/* Devices that fail on demand and keep book. Include after tap.h. */

#include <stdatomic.h>

#include <hapode/device_impl.h>

#include "base/vec.h"
#include "device/device.h"

#define FAKES_MAX 4
#define FAKE_DEPTH_X (-0.057) /* m: 3 mm deep in a face at -0.05 */

typedef struct fake_device {
  /* What it shall do. */
  hap_device_info info;
  atomic_int fail_start;
  atomic_int fail_read;
  atomic_int fail_write;
  atomic_int bad_pose;
  double x; /* m, where it is */
  /* May be NULL. The pose is at x, the reached force is the wanted one until they say otherwise. */
  hap_status (*move)(struct fake_device *d, int64_t time_ns, hap_pose *io, uint32_t *buttons);
  void (*push)(struct fake_device *d, const hap_wrench *wanted, hap_wrench *reached);

  /* What was done to it. */
  atomic_int starts;
  atomic_int stops;
  atomic_int closes;
  atomic_int reads;
  atomic_int writes;
  atomic_int zeros;   /* calls of zero */
  atomic_int forces;  /* writes that were not zero */
  atomic_int wrong;   /* calls out of order, or a force that is not finite or beyond the limit */
  atomic_int steep;   /* writes that changed the force by more than 5 N, the default slew limit */
  atomic_int pushing; /* the last force given was not zero */
  atomic_int zeroed;  /* the last of zero and write was a zero */
  atomic_int since_read;
  atomic_int running;
  double written; /* N, last */
} fake_device;

static fake_device fakes[FAKES_MAX]; /* in the order in which they are opened */
static int fakes_opened;

static hap_status fake_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  (void)args;
  (void)detail;
  *self = &fakes[fakes_opened++];
  return HAP_OK;
}

static void fake_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  fake_device *d = self;
  *out = d->info;
}

static hap_status fake_start(void *self)
{
  fake_device *d = self;
  atomic_fetch_add(&d->starts, 1);
  if (atomic_load(&d->fail_start) != 0) {
    return HAP_ERROR_DEVICE;
  }
  atomic_fetch_add(&d->wrong, atomic_exchange(&d->running, 1) != 0);
  return HAP_OK;
}

static hap_status fake_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  fake_device *d = self;
  atomic_fetch_add(&d->reads, 1);
  atomic_fetch_add(&d->wrong, atomic_load(&d->running) != 1);
  atomic_store(&d->since_read, 1);
  memset(&in->twist, 0, sizeof in->twist);
  in->pose = (hap_pose){{d->x, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  in->buttons = 5;
  hap_status status = d->move != NULL ? d->move(d, time_ns, &in->pose, &in->buttons) : HAP_OK;
  if (atomic_load(&d->fail_read) != 0) {
    in->pose.position[0] = -0.02; /* not to be used */
    return HAP_ERROR_DEVICE;
  }
  if (atomic_load(&d->bad_pose) != 0) {
    in->pose.position[1] = (double)NAN;
  }
  return status;
}

static hap_status fake_write(void *self, const hap_device_output *const wanted[],
                             hap_device_output *const reached[])
{
  fake_device *d = self;
  double force = hapi_v3_norm(wanted[0]->wrench.force);
  bool good = hapi_finite(wanted[0]->wrench.force, 3) && hapi_finite(wanted[0]->wrench.torque, 3) &&
              (force <= d->info.max_force * (1.0 + 1e-12) || d->info.max_force == 0.0);
  bool first = atomic_exchange(&d->since_read, 0) == 1; /* one write after one read */
  atomic_fetch_add(&d->writes, 1);
  atomic_fetch_add(&d->wrong, !good || !first || atomic_load(&d->running) != 1);
  reached[0]->wrench = wanted[0]->wrench;
  if (atomic_load(&d->fail_write) != 0) {
    return HAP_ERROR_DEVICE;
  }
  if (d->push != NULL) {
    d->push(d, &wanted[0]->wrench, &reached[0]->wrench);
  }
  atomic_fetch_add(&d->steep, !(fabs(force - d->written) <= 5.0 * (1.0 + 1e-9)));
  d->written = force;
  atomic_fetch_add(&d->forces, force != 0.0);
  atomic_store(&d->pushing, force != 0.0);
  atomic_store(&d->zeroed, force == 0.0);
  return HAP_OK;
}

static void fake_zero(void *self)
{
  fake_device *d = self;
  atomic_fetch_add(&d->zeros, 1);
  atomic_store(&d->pushing, 0);
  atomic_store(&d->zeroed, 1);
}

static void fake_stop(void *self)
{
  fake_device *d = self;
  atomic_fetch_add(&d->stops, 1);
  atomic_fetch_add(&d->wrong, atomic_load(&d->zeroed) != 1); /* zero comes first */
  atomic_fetch_add(&d->wrong, atomic_exchange(&d->running, 0) != 1);
}

static void fake_close(void *self)
{
  fake_device *d = self;
  atomic_fetch_add(&d->closes, 1);
  atomic_fetch_add(&d->wrong, atomic_load(&d->running) != 0 || atomic_load(&d->zeroed) != 1);
}

static hap_device_ops fake_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "fake",
    .help = "for tests",
    .pacing = HAP_PACING_VIRTUAL,
    .open = fake_open,
    .describe = fake_describe,
    .start = fake_start,
    .read = fake_read,
    .write = fake_write,
    .zero = fake_zero,
    .stop = fake_stop,
    .close = fake_close,
};

/* The next fake: 3 DoF, 12 N, 3 mm deep in a face at -0.05 m. The first one after a test has set
 * fakes_opened to 0 forgets those before it. */
static inline fake_device *fake_next(void)
{
  if (fakes_opened == 0) {
    memset(fakes, 0, sizeof fakes);
  }
  fake_device *d = &fakes[fakes_opened];
  d->info = (hap_device_info){.dof = 3, .max_force = 12.0};
  d->x = FAKE_DEPTH_X;
  return d;
}

static inline hap_device *fake_device_open(hap_device_pacing pacing)
{
  hap_detail detail = {""};
  hap_device *device = NULL;
  fake_ops.pacing = pacing;
  REQUIRE_SAY(hapi_device_open_ops(&fake_ops, NULL, "", &device, &detail) == HAP_OK, "%s",
              detail.text);
  return device;
}

#endif
