/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A module that needs a function that nobody has, and only in zero. */

#include <hapode/device_impl.h>

void hapode_test_nobody_has_this(void);
HAP_API void unresolved_zero(void *self);

void unresolved_zero(void *self)
{
  (void)self;
  hapode_test_nobody_has_this();
}

const hap_device_ops *hapode_device_module(uint32_t host_abi)
{
  static const hap_device_ops ops = {.abi = HAP_DEVICE_ABI, .zero = unresolved_zero};
  (void)host_abi;
  return &ops;
}
