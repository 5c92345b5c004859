/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/outputs.h"

#include <math.h>
#include <string.h>

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

bool hapi_outputs_push_is_sound(const hap_axis_push *push)
{
  return fabs(push->force) <= 1e9 && fabs(push->target) <= 1e6 && push->stiffness >= 0.0 &&
         push->stiffness <= 1e9 && push->damping >= 0.0 && push->damping <= 1e6 &&
         push->max_force >= 0.0 && push->max_force <= 1e9 &&
         (push->max_power == HAP_FORCE_POWER_AUTO ||
          (push->max_power >= 0.0 && push->max_power <= 1e9));
}

bool hapi_outputs_vibration_is_sound(const hap_vibration *vibration)
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
    sound = sound && hapi_outputs_push_is_sound(&o->axes[i]) && o->axes[i].max_power >= 0.0;
  }
  for (int i = 0; i < HAP_VIBRATORS_MAX; ++i) {
    sound = sound && hapi_outputs_vibration_is_sound(&o->vibrators[i]);
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
