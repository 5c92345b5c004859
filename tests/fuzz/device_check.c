/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/fuzz/device_check.h"

#include <math.h>

#include "base/vec.h"
#include "device/device.h"
#include "device/one_effector.h"
#include "tests/fuzz/fuzz.h"

#define ROUNDING (1.0 + 1e-9)

static void check_limit(double value)
{
  FUZZ_CHECK(isfinite(value) && value >= 0.0);
}

static void check_info(const hap_device_info *info)
{
  FUZZ_CHECK(info->dof == 3 || info->dof == 6);
  FUZZ_CHECK(memchr(info->name, '\0', sizeof info->name) != NULL && info->name[0] != '\0');
  check_limit(info->max_force);
  check_limit(info->max_torque);
  check_limit(info->rated_stiffness);
  check_limit(info->damping);
  check_limit(info->quantum);
}

static void check_read(const hap_pose *pose, const hap_twist *twist)
{
  const double *q = pose->quat_wxyz;
  FUZZ_CHECK(hapi_finite(pose->position, 3));
  FUZZ_CHECK(hapi_finite(twist->linear, 3) && hapi_finite(twist->angular, 3));
  FUZZ_CHECK(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-9);
}

static void check_write(hap_device *device, double force)
{
  const hap_device_info *info = hapi_device_info(device);
  const hap_wrench wanted = {{force, -force, 0.5 * force}, {0.0, 0.1 * force, 0.0}};
  hap_wrench reached;
  hap_status status =
      hapi_one_write(hapi_device_ops(device), hapi_device_self(device), &wanted, &reached);
  FUZZ_CHECK(status == HAP_OK || status == HAP_SATURATED);
  FUZZ_CHECK(hapi_v3_norm(reached.force) <= info->max_force * ROUNDING);
  FUZZ_CHECK(hapi_v3_norm(reached.torque) <= info->max_torque * ROUNDING);
}

/* From one tick to the next, over a pause, and to the end of time. */
static void check_run(hap_device *device)
{
  static const int64_t times_ns[] = {5, 5, 1000005, 2000005, 500000000, 2000000000, INT64_MAX};
  static const double forces[] = {0.0, 1.0, -3.0, 1e9, 0.0, 2.0, 0.0};
  const hap_device_ops *ops = hapi_device_ops(device);
  void *self = hapi_device_self(device);
  FUZZ_CHECK(ops->start(self) == HAP_OK);
  for (size_t i = 0; i < sizeof times_ns / sizeof times_ns[0]; ++i) {
    hap_pose pose;
    hap_twist twist;
    uint32_t buttons = 0;
    memset(&pose, 0xff, sizeof pose); /* not a number */
    memset(&twist, 0xff, sizeof twist);
    FUZZ_CHECK(hapi_one_read(ops, self, times_ns[i], &pose, &twist, &buttons) == HAP_OK);
    check_read(&pose, &twist);
    check_write(device, forces[i]);
  }
  ops->zero(self);
  ops->stop(self);
}

void fuzz_device(const char *spec)
{
  hap_device *device = (hap_device *)&spec; /* must be overwritten */
  hap_detail detail;
  fuzz_detail_spoil(&detail);
  hap_status status = hap_device_open(spec, &device, &detail);
  fuzz_check_answer(status, device, &detail);
  if (status >= HAP_OK) {
    check_info(hapi_device_info(device));
    check_run(device);
    check_run(device); /* a stopped device starts again */
  }
  hap_device_close(device);
}
