/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_DEVICE_RIG_H
#define HAPODE_TESTS_DEVICE_RIG_H

/* A device by itself, without a session. Include after tap.h. */

#include "device/device.h"
#include "plugins/virtual/virtual.h"

typedef struct device_rig {
  hap_device *device;
  const hap_device_ops *ops;
  void *self;
  hap_pose pose;
  hap_twist twist;
  hap_wrench reached;
  hapi_virtual_port port; /* of the device "virtual", for a test to fill in */
} device_rig;

static inline void rig_owned(void *owned)
{
  device_rig *r = owned;
  if (r->device != NULL) {
    r->ops->zero(r->self);
    r->ops->stop(r->self);
    hap_device_close(r->device);
  }
}

/* Started; it goes when the test has ended. */
static inline device_rig *rig_new(const char *spec)
{
  hap_detail detail;
  device_rig *r = tap_own(sizeof *r, rig_owned);
  bool good = hap_device_open(spec, &r->device, &detail) == HAP_OK;
  REQUIRE_SAY(good, "%s: %s", spec, detail.text);
  r->ops = hapi_device_ops(r->device);
  r->self = hapi_device_self(r->device);
  REQUIRE(r->ops->start(r->self) == HAP_OK);
  return r;
}

#endif
