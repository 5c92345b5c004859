/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/axes.h"

#include <string.h>

#include "device/device.h"

#define INFO_UNIT_SHIFT 8

void hapi_axes_join(hapi_haptic *haptic, uint32_t index)
{
  const hapi_pointer_slot *slot = &haptic->slots[index];
  uint32_t count = slot->has_device ? slot->info.axis_count : 0;
  hapi_axes_begin(&haptic->tick.axes[index], slot->axes, count);
  haptic->tick.pointers.of[index].has_axes = count > 0;
}

/* Values, then rates. */
static void values_move(hapi_tape *tape, uint32_t index, uint32_t count, double *io)
{
  for (uint32_t i = 0; i < count; i += HAPI_CELL_NUMBERS) {
    uint32_t here = count - i < HAPI_CELL_NUMBERS ? count - i : HAPI_CELL_NUMBERS;
    hapi_tape_move(tape, hapi_tape_next(tape, HAPI_CELL_AXES, index)->d, io + i, here * sizeof *io);
  }
}

bool hapi_axes_read(hapi_haptic *haptic, uint32_t index, int64_t now_ns, bool failed)
{
  const hapi_effector *effector = haptic->slots[index].effector;
  hapi_axes *axes = &haptic->tick.axes[index];
  double values[2 * HAP_AXES_MAX] = {0.0};
  if (effector != NULL) {
    memcpy(values, effector->input.axes, axes->count * sizeof values[0]);
    memcpy(values + axes->count, effector->input.axis_rates, axes->count * sizeof values[0]);
  }
  if (haptic->tape != NULL) {
    values_move(haptic->tape, index, 2 * axes->count, values);
  }
  return !failed && hapi_axes_judge(axes, values, values + axes->count, now_ns);
}

static void info_put(hapi_tape *tape, uint32_t index, const hap_axis_info *axis)
{
  hapi_cell *cell = hapi_tape_put(tape, HAPI_CELL_AXIS, index);
  cell->word = axis->kind | axis->unit << INFO_UNIT_SHIFT;
  cell->d[0] = axis->low;
  cell->d[1] = axis->high;
  cell->d[2] = axis->max_force;
  cell->d[3] = axis->rated_stiffness;
  cell->d[4] = axis->rated_damping;
}

static void info_get(hapi_tape *tape, uint32_t index, hap_axis_info *out)
{
  const hapi_cell *cell = hapi_tape_get(tape, HAPI_CELL_AXIS, index);
  *out = (hap_axis_info){.size = sizeof *out,
                         .kind = cell->word & ((1u << INFO_UNIT_SHIFT) - 1u),
                         .unit = cell->word >> INFO_UNIT_SHIFT,
                         .low = cell->d[0],
                         .high = cell->d[1],
                         .max_force = cell->d[2],
                         .rated_stiffness = cell->d[3],
                         .rated_damping = cell->d[4]};
}

void hapi_tape_axis_infos(hapi_tape *tape, uint32_t index, hap_axis_info *io_axes,
                          hap_device_info *io_info)
{
  if (hapi_tape_records(tape)) {
    for (uint32_t i = 0; i < io_info->axis_count; ++i) {
      info_put(tape, index, &io_axes[i]);
    }
    return;
  }
  io_info->axis_count = 0;
  while (hapi_tape_next_is(tape, HAPI_CELL_AXIS) && io_info->axis_count < HAP_AXES_MAX) {
    hap_axis_info *axis = &io_axes[io_info->axis_count++];
    info_get(tape, index, axis);
    tape->broken = tape->broken || !hapi_device_axis_good(axis); /* a file may hold anything */
  }
}
