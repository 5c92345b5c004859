/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/own_tape.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "guard/force_guard.h"

/* Own forces on the tape: a setup, and the samples of a vibration behind it. */

static void setup_move(hapi_tape *tape, uint32_t index, uint32_t *io_place, hapi_force_setup *io)
{
  char bytes[HAPI_OWN_CELLS * HAPI_CELL_BYTES] = {0};
  memcpy(bytes, io, sizeof *io);
  for (uint32_t i = 0; i < HAPI_OWN_CELLS; ++i) {
    hapi_cell *cell = hapi_tape_next(tape, HAPI_CELL_OWN, index);
    hapi_tape_move(tape, &cell->word, io_place, sizeof *io_place);
    hapi_tape_move(tape, cell->d, bytes + i * HAPI_CELL_BYTES, HAPI_CELL_BYTES);
  }
  memcpy(io, bytes, sizeof *io);
}

/* As lib/session lets them in: a file may hold anything. */
static bool setup_is_sound(const hapi_force_setup *s)
{
  if (s->serial == 0) {
    return s->wave.sample_count == 0;
  }
  double numbers[(offsetof(hapi_force_setup, body) - offsetof(hapi_force_setup, origin)) /
                 sizeof(double)];
  memcpy(numbers, s->origin, sizeof numbers);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i) {
    if (!(fabs(numbers[i]) <= HAP_FORCE_FOR_EVER)) {
      return false;
    }
  }
  if ((s->frame == HAP_FORCE_BODY) != (s->body != 0)) {
    return false;
  }
  return s->kind >= HAP_FORCE_CONSTANT && s->kind <= HAP_FORCE_CALL && s->range > 0.0 &&
         s->pitch > 0.0 && s->max_force >= 0.0 && s->max_torque >= 0.0 && s->max_power >= 0.0 &&
         s->wave.sample_count <= HAP_FORCE_SAMPLES_MAX && s->wave.sample_hz >= 0.0;
}

static void samples_move(hapi_tape *tape, uint32_t index, uint32_t count, float *io)
{
  for (uint32_t i = 0; i < count; i += HAPI_CELL_SAMPLE_COUNT) {
    uint32_t here = count - i < HAPI_CELL_SAMPLE_COUNT ? count - i : HAPI_CELL_SAMPLE_COUNT;
    hapi_tape_move(tape, hapi_tape_next(tape, HAPI_CELL_SAMPLES, index)->d, io + i,
                   here * sizeof *io);
  }
}

void hapi_tape_own(hapi_haptic *haptic, uint32_t index, uint32_t place,
                   const hapi_force_setup *setup, const float *samples)
{
  float copy[HAP_FORCE_SAMPLES_MAX];
  hapi_force_setup own = *setup;
  if (!hapi_tape_records(haptic->tape)) {
    return;
  }
  setup_move(haptic->tape, index, &place, &own);
  if (samples != NULL) {
    memcpy(copy, samples, setup->wave.sample_count * sizeof copy[0]);
    samples_move(haptic->tape, index, setup->wave.sample_count, copy);
  }
}

bool hapi_tape_next_own(hapi_haptic *haptic, uint32_t *out_index, uint32_t *out_place,
                        hapi_force_setup *out, const float **out_samples)
{
  hapi_tape *tape = haptic->tape;
  if (!hapi_tape_next_is(tape, HAPI_CELL_OWN)) {
    return false;
  }
  *out_index = tape->packet_cells[tape->packet_at].index;
  *out_samples = NULL;
  memset(out, 0, sizeof *out);
  setup_move(tape, *out_index, out_place, out);
  tape->broken = tape->broken || *out_index >= haptic->config.capacity.pointers ||
                 *out_place >= HAP_FORCES_MAX || !setup_is_sound(out);
  if (!tape->broken && out->wave.sample_count > 0) {
    float *room = hapi_own_list_room(&haptic->slots[*out_index].own, out->wave.sample_count);
    tape->broken = room == NULL;
    if (room != NULL) {
      memset(room, 0, out->wave.sample_count * sizeof *room);
      samples_move(tape, *out_index, out->wave.sample_count, room);
      *out_samples = room;
    }
  }
  return !tape->broken;
}

void hapi_tape_call(hapi_haptic *haptic, uint32_t index, uint32_t place, hap_wrench *io_wrench,
                    uint32_t *io_out)
{
  hapi_tape *tape = haptic->tape;
  double given[6];
  memcpy(given, io_wrench, sizeof given);
  if (hapi_tape_records(tape)) {
    hapi_cell *cell = hapi_tape_put(tape, HAPI_CELL_CALL, index);
    cell->word = place;
    cell->flags = (uint16_t)*io_out;
    memcpy(cell->d, given, sizeof given);
  } else if (hapi_tape_plays(tape)) {
    const hapi_cell *cell = hapi_tape_get(tape, HAPI_CELL_CALL, index);
    memcpy(given, cell->d, sizeof given);
    memcpy(io_wrench, given, sizeof given);
    *io_out = cell->flags;
    tape->broken = tape->broken || cell->word != place || cell->flags > HAP_FORCE_OUT_BLOCKED ||
                   !hapi_guard_usable(io_wrench);
    if (tape->broken) { /* the file may hold anything */
      *io_wrench = (hap_wrench){{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    }
  }
}
