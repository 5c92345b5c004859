/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "haptic/grabs.h"

#include <math.h>
#include <string.h>

#include "base/plausible.h"

/* What a pointer is to hold: handed over by a triple buffer, the newest wish alone. What a tick
 * takes is an input and goes on the tape. */

#define NUMBER_MOST 1e9 /* of a recording: the largest that lib/session lets in */

/* ---- the tape ---- */

static void setup_move(hapi_tape *tape, uint32_t index, hapi_grab_setup *io)
{
  char bytes[HAPI_GRAB_CELLS * HAPI_CELL_BYTES] = {0};
  memcpy(bytes, io, sizeof *io);
  for (uint32_t i = 0; i < HAPI_GRAB_CELLS; ++i) {
    hapi_tape_move(tape, hapi_tape_next(tape, HAPI_CELL_GRAB, index)->d,
                   bytes + i * HAPI_CELL_BYTES, HAPI_CELL_BYTES);
  }
  memcpy(io, bytes, sizeof *io);
}

/* As lib/session lets them in: a file may hold anything. */
static bool setup_is_sound(const hapi_grab_setup *s)
{
  const double numbers[] = {s->stiffness, s->damping,    s->turn_stiffness, s->turn_damping,
                            s->max_force, s->max_torque, s->damping_most};
  hap_pose pose;
  memcpy(pose.position, s->place, sizeof pose.position);
  memcpy(pose.quat_wxyz, s->turn, sizeof pose.quat_wxyz);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i) {
    if (!(numbers[i] >= 0.0 && numbers[i] <= NUMBER_MOST)) {
      return false;
    }
  }
  return s->birth == 0 || (s->turns <= HAP_GRAB_BALL && hapi_plausible_pose(&pose));
}

static bool tape_next(hapi_haptic *haptic, uint32_t index, hapi_grab_setup *out)
{
  hapi_tape *tape = haptic->tape;
  if (!hapi_tape_next_is(tape, HAPI_CELL_GRAB) ||
      tape->packet_cells[tape->packet_at].index != index) {
    return false;
  }
  memset(out, 0, sizeof *out);
  setup_move(tape, index, out);
  tape->broken = tape->broken || !setup_is_sound(out);
  return !tape->broken;
}

/* ---- the loop's side ---- */

void hapi_grabs_reset(hapi_haptic *haptic)
{
  for (uint32_t i = 0; i < haptic->config.capacity.pointers; ++i) {
    hapi_pointer_slot *slot = &haptic->slots[i];
    pthread_mutex_lock(&slot->lock);
    hapi_triple_init(&slot->grab.buffer);
    pthread_mutex_unlock(&slot->lock);
  }
}

void hapi_grab_follow(hapi_haptic *haptic, uint32_t index)
{
  hapi_grab_box *box = &haptic->slots[index].grab;
  hapi_grab *grab = &haptic->tick.pointers.of[index].grab;
  hapi_grab_setup setup;
  if (hapi_tape_plays(haptic->tape)) {
    if (!tape_next(haptic, index, &setup)) {
      return;
    }
  } else {
    if (!hapi_triple_take(&box->buffer)) {
      return;
    }
    setup = box->places[hapi_triple_front(&box->buffer)];
    if (hapi_tape_records(haptic->tape)) {
      setup_move(haptic->tape, index, &setup);
    }
  }
  grab->wanted = setup;
  grab->any = true;
  haptic->tick.pointers.grabs = true;
}
