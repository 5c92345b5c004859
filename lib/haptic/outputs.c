/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/outputs.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/safety.h"

/* ---- the loop's side ---- */

void hapi_outputs_prepare(hapi_pointer_slot *slot)
{
  memset(&slot->outputs, 0, sizeof slot->outputs);
  hapi_triple_init(&slot->outputs.buffer);
}

void hapi_outputs_join(hapi_haptic *haptic, uint32_t index)
{
  memset(&haptic->tick.outputs[index], 0, sizeof haptic->tick.outputs[index]);
  haptic->slots[index].outputs.again = true;
}

static void outputs_move(hapi_tape *tape, uint32_t index, hap_pointer_outputs *io)
{
  char bytes[HAPI_OUTPUTS_CELLS * HAPI_CELL_BYTES] = {0};
  memcpy(bytes, io, sizeof *io);
  for (uint32_t i = 0; i < HAPI_OUTPUTS_CELLS; ++i) {
    hapi_tape_move(tape, hapi_tape_next(tape, HAPI_CELL_OUTPUTS, index)->d,
                   bytes + i * HAPI_CELL_BYTES, HAPI_CELL_BYTES);
  }
  memcpy(io, bytes, sizeof *io);
}

static bool push_is_sound(const hap_axis_push *push)
{
  return fabs(push->force) <= 1e9 && fabs(push->target) <= 1e6 && push->stiffness >= 0.0 &&
         push->stiffness <= 1e9 && push->damping >= 0.0 && push->damping <= 1e6 &&
         push->max_force >= 0.0 && push->max_force <= 1e9 &&
         (push->max_power == HAP_FORCE_POWER_AUTO ||
          (push->max_power >= 0.0 && push->max_power <= 1e9));
}

static bool vibration_is_sound(const hap_vibration *vibration)
{
  return vibration->amplitude >= 0.0 && vibration->amplitude <= 1.0 &&
         vibration->frequency >= 0.0 && vibration->frequency <= 1e5;
}

/* A file may hold anything. */
static bool outputs_are_sound(const hap_pointer_outputs *o)
{
  bool sound =
      o->gripper_closed >= 0.0 && o->gripper_closed < o->gripper_open && o->gripper_open <= 1.0;
  for (int i = 0; i < HAP_AXES_MAX; ++i) {
    sound = sound && push_is_sound(&o->axes[i]) && o->axes[i].max_power >= 0.0;
  }
  for (int i = 0; i < HAP_VIBRATORS_MAX; ++i) {
    sound = sound && vibration_is_sound(&o->vibrators[i]);
  }
  return sound;
}

/* False: nothing was set. */
static bool outputs_play(hapi_haptic *haptic, uint32_t index, hap_pointer_outputs *out)
{
  hapi_tape *tape = haptic->tape;
  if (!hapi_tape_next_is(tape, HAPI_CELL_OUTPUTS) ||
      tape->packet_cells[tape->packet_at].index != index) {
    return false;
  }
  memset(out, 0, sizeof *out);
  outputs_move(tape, index, out);
  tape->broken = tape->broken || !outputs_are_sound(out);
  return !tape->broken;
}

static bool outputs_receive(hapi_haptic *haptic, uint32_t index, hap_pointer_outputs *out)
{
  hapi_outputs_box *box = &haptic->slots[index].outputs;
  (void)hapi_triple_take(&box->buffer);
  *out = box->places[hapi_triple_front(&box->buffer)];
  box->again = false;
  if (out->size != 0 && hapi_tape_records(haptic->tape)) {
    outputs_move(haptic->tape, index, out);
  }
  return out->size != 0;
}

void hapi_outputs_take(hapi_haptic *haptic, uint32_t index)
{
  hap_pointer_outputs taken;
  bool any = hapi_tape_plays(haptic->tape) ? outputs_play(haptic, index, &taken)
                                           : outputs_receive(haptic, index, &taken);
  if (any) {
    hapi_outputs_change(&haptic->tick.outputs[index], &taken, &haptic->tick.axes[index]);
    haptic->tick.pointers.of[index].drives = true;
  }
}

void hapi_outputs_fill(const hapi_outputs *outputs, const hapi_axes *axes, hap_device_output *out)
{
  out->leds = outputs->wanted.leds;
  for (uint32_t i = 0; i < axes->count; ++i) {
    out->axis_forces[i] = outputs->axes[i].force;
  }
  for (int i = 0; i < HAP_VIBRATORS_MAX; ++i) {
    out->vibrators[i] =
        (hap_vibration){outputs->amplitudes[i], outputs->wanted.vibrators[i].frequency};
  }
}

/* ---- the application's side ---- */

static bool is_none(const void *bytes, size_t size)
{
  const char *at = bytes;
  for (size_t i = 0; i < size; ++i) {
    if (at[i] != 0) {
      return false;
    }
  }
  return true;
}

static hap_status axis_check(const hapi_pointer_slot *slot, uint32_t index, hap_axis_push *io,
                             hap_detail *detail)
{
  const hap_axis_info *axis = &slot->axes[index];
  bool pushes = io->force != 0.0 || io->stiffness != 0.0 || io->damping != 0.0;
  if (!push_is_sound(io)) {
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
  return HAP_OK;
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
    if (!vibration_is_sound(vibration)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                       "vibrators[%u]: amplitude %g is not within [0, 1], or frequency %g not "
                       "within [0, 1e5]",
                       i, vibration->amplitude, vibration->frequency);
    }
    if (i >= slot->info.vibrator_count && !is_none(vibration, sizeof *vibration)) {
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
  for (uint32_t i = 0; i < HAP_AXES_MAX; ++i) {
    HAPI_TRY(axis_check(slot, i, &io->axes[i], detail));
  }
  return HAP_OK;
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
    slot->outputs.places[hapi_triple_back(&slot->outputs.buffer)] = checked;
    hapi_triple_publish(&slot->outputs.buffer);
  }
  pthread_mutex_unlock(&slot->lock);
  return status;
}
