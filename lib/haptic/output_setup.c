/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/log.h"
#include "base/safety.h"
#include "haptic/outputs.h"

/* What the application wants of a device beside the wrench: checked against what the device has,
 * promises filled in, and into the pointer's box. */

/* What the device holds. */
static hap_status axis_bound(const hap_axis_info *axis, uint32_t index, hap_axis_push *io,
                             hap_detail *detail)
{
  const struct {
    const char *name;
    double most;
    double *io;
  } numbers[] = {{"stiffness", axis->rated_stiffness, &io->stiffness},
                 {"damping", axis->rated_damping, &io->damping}};
  hap_status status = HAP_OK;
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i) {
    if (numbers[i].most > 0.0 && *numbers[i].io > numbers[i].most) {
      status = hapi_fail(detail, HAP_SATURATED,
                         "axes[%u].%s %g is cut to the %g that the device can hold", index,
                         numbers[i].name, *numbers[i].io, numbers[i].most);
      *numbers[i].io = numbers[i].most;
    }
  }
  return status;
}

static hap_status axis_check(const hapi_pointer_slot *slot, uint32_t index, hap_axis_push *io,
                             hap_detail *detail)
{
  const hap_axis_info *axis = &slot->axes[index];
  bool pushes = io->force != 0.0 || io->stiffness != 0.0 || io->damping != 0.0;
  if (!hapi_outputs_push_is_sound(io)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "axes[%u] has a number that is not finite or out of range: force within 1e9, "
                     "target within 1e6, stiffness, max_force and max_power from 0 to 1e9, damping "
                     "from 0 to 1e6",
                     index);
  }
  if (pushes && !(index < slot->info.axis_count && axis->max_force > 0.0)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     index < slot->info.axis_count
                         ? "axes[%u]: the axis gives no force, its max_force is 0"
                         : "axes[%u]: the device has no such axis; it has %u",
                     index, slot->info.axis_count);
  }
  if (pushes && !(io->max_force > 0.0)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "axes[%u].max_force is 0: say how large the force may get, up to %g", index,
                     axis->max_force);
  }
  if (io->stiffness > 0.0 && !(io->target >= axis->low && io->target <= axis->high)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "axes[%u].target is %g, not within the range of the axis, %g to %g", index,
                     io->target, axis->low, axis->high);
  }
  if (io->max_power < 0.0) {
    double range = index < slot->info.axis_count ? axis->high - axis->low : 0.0;
    io->max_power = HAPI_SAFETY_AXIS_DRIVE * range * fmin(io->max_force, axis->max_force);
  }
  return index < slot->info.axis_count ? axis_bound(axis, index, io, detail) : HAP_OK;
}

static hap_status outputs_check(const hapi_pointer_slot *slot, hap_pointer_outputs *io,
                                hap_detail *detail)
{
  uint32_t leds = slot->info.led_count;
  if (leds < 32 && io->leds >> leds != 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "leds is 0x%x: the device has %u of them",
                     io->leds, leds);
  }
  for (uint32_t i = 0; i < HAP_VIBRATORS_MAX; ++i) {
    const hap_vibration *vibration = &io->vibrators[i];
    if (!hapi_outputs_vibration_is_sound(vibration)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "vibrators[%u]: amplitude %g is not within [0, 1], or frequency %g not "
                       "within [0, 1e5]",
                       i, vibration->amplitude, vibration->frequency);
    }
    if (i >= slot->info.vibrator_count && vibration->amplitude > 0.0) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "vibrators[%u]: the device has %u of them", i,
                       slot->info.vibrator_count);
    }
  }
  if (!(io->gripper_closed >= 0.0 && io->gripper_closed < io->gripper_open &&
        io->gripper_open <= 1.0)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "gripper_closed %g and gripper_open %g are not shares in this order, from 0 "
                     "to 1",
                     io->gripper_closed, io->gripper_open);
  }
  hap_status cut = HAP_OK;
  for (uint32_t i = 0; i < HAP_AXES_MAX; ++i) {
    hap_status status = axis_check(slot, i, &io->axes[i], detail);
    if (status < HAP_OK) {
      return status;
    }
    cut = status != HAP_OK ? status : cut;
  }
  return cut;
}

hap_status hapi_haptic_set_outputs(hapi_haptic *haptic, hap_pointer_id id,
                                   const hap_pointer_outputs *outputs, hap_detail *detail)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  hap_pointer_outputs checked = *outputs;
  if (slot == NULL) {
    return hapi_fail(detail, HAP_ERROR_NOT_FOUND, "there is no such pointer");
  }
  hap_status status = slot->has_device
                          ? outputs_check(slot, &checked, detail)
                          : hapi_fail(detail, HAP_ERROR_UNSUPPORTED, "the pointer has no device");
  if (status >= HAP_OK) {
    slot->outputs.last = checked;
    slot->outputs.places[hapi_triple_back(&slot->outputs.buffer)] = checked;
    hapi_triple_publish(&slot->outputs.buffer);
  }
  pthread_mutex_unlock(&slot->lock);
  return status;
}

hap_status hapi_haptic_get_outputs(hapi_haptic *haptic, hap_pointer_id id, hap_pointer_outputs *io)
{
  hapi_pointer_slot *slot = hapi_slot_lock(haptic, id);
  if (slot == NULL) {
    return HAP_ERROR_NOT_FOUND;
  }
  if (slot->outputs.last.size != 0) {
    *io = slot->outputs.last;
  }
  pthread_mutex_unlock(&slot->lock);
  return HAP_OK;
}
