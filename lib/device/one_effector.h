/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_ONE_EFFECTOR_H
#define HAPODE_DEVICE_ONE_EFFECTOR_H

/* Operations of a device with one end effector and no axes, called without a session: for tools
 * and tests. What the device does not fill in is NaN. */

#include <string.h>

#include <hapode/device_impl.h>

static inline hap_status hapi_one_read(const hap_device_ops *ops, void *self, int64_t time_ns,
                                       hap_pose *out_pose, hap_twist *out_twist,
                                       uint32_t *out_buttons)
{
  hap_device_input in;
  hap_device_input *const all[] = {&in};
  memset(&in, 0xff, sizeof in);
  in.size = sizeof in;
  hap_status status = ops->read(self, time_ns, all);
  *out_pose = in.pose;
  *out_twist = in.twist;
  *out_buttons = in.buttons;
  return status;
}

static inline hap_status hapi_one_write(const hap_device_ops *ops, void *self,
                                        const hap_wrench *wanted, hap_wrench *out_reached)
{
  const hap_device_output want = {.size = sizeof want, .wrench = *wanted};
  const hap_device_output *const all_wanted[] = {&want};
  hap_device_output reached;
  hap_device_output *const all_reached[] = {&reached};
  memset(&reached, 0xff, sizeof reached);
  reached.size = sizeof reached;
  hap_status status = ops->write(self, all_wanted, all_reached);
  *out_reached = reached.wrench;
  return status;
}

static inline void hapi_one_held(const hap_device_ops *ops, void *self, hap_wrench *out)
{
  hap_device_output held;
  hap_device_output *const all[] = {&held};
  memset(&held, 0xff, sizeof held);
  held.size = sizeof held;
  ops->held(self, all);
  *out = held.wrench;
}

#endif
