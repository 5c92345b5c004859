/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "plugins/common/output.h"

#include "base/assert.h"
#include "base/vec.h"

_Static_assert(ATOMIC_BOOL_LOCK_FREE == 2, "zero is called from signal handlers");

void hapi_output_init(hapi_output *output, double max_force, double max_torque)
{
  HAPI_ASSERT(max_force >= 0.0 && max_torque >= 0.0);
  *output = (hapi_output){.max_force = max_force, .max_torque = max_torque};
  atomic_init(&output->zeroed.raised, true);
}

hap_status hapi_output_write(hapi_output *output, const hap_wrench *wanted, hap_wrench *reached)
{
  if (!hapi_finite(wanted->force, 3) || !hapi_finite(wanted->torque, 3)) {
    return HAP_ERROR_ARGUMENT;
  }
  output->held = *wanted;
  bool shortened = hapi_v3_shorten(output->held.force, output->max_force);
  bool twisted = hapi_v3_shorten(output->held.torque, output->max_torque);
  *reached = output->held;
  /* Last, so that a zero that comes in between is taken as one from before this write. */
  atomic_store_explicit(&output->zeroed.raised, false, memory_order_release);
  return shortened || (twisted && output->max_torque > 0.0) ? HAP_SATURATED : HAP_OK;
}

void hapi_output_zero(hapi_output *output)
{
  atomic_store_explicit(&output->zeroed.raised, true, memory_order_release);
}

bool hapi_output_is_zeroed(const hapi_output *output)
{
  return atomic_load_explicit(&output->zeroed.raised, memory_order_acquire);
}

void hapi_output_get(const hapi_output *output, hap_wrench *out)
{
  if (hapi_output_is_zeroed(output)) {
    *out = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    return;
  }
  *out = output->held;
}
