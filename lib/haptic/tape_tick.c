/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "haptic/haptic_internal.h"

/* The loop's part of a recording: all that a tick has from outside is put on the tape, or in a
 * replay taken from it, and what came of it is hashed. */

static const hapi_cell no_cell;

/* ---- from outside ---- */

static uint64_t window_of(const hapi_haptic *haptic, int64_t now_ns)
{
  double ticks = 1e-9 * (double)(now_ns - haptic->start_ns) * haptic->config.haptic_hz;
  return (uint64_t)llround(fmax(ticks, 0.0));
}

void hapi_tape_begin(hapi_haptic *haptic, int64_t start_ns)
{
  haptic->tick_cell = &no_cell;
  haptic->turn = 0;
  if (hapi_tape_records(haptic->tape)) {
    hapi_tape_open(haptic->tape);
    haptic->note = hapi_tape_put(haptic->tape, HAPI_CELL_BEGIN, 0);
    haptic->note->i[0] = start_ns;
  } else if (hapi_tape_plays(haptic->tape)) {
    (void)hapi_tape_get(haptic->tape, HAPI_CELL_BEGIN, 0);
  }
}

static void close_packet(hapi_haptic *haptic)
{
  uint32_t count = hapi_tape_put_so_far(haptic->tape);
  haptic->note->word = count > 0 ? count - 1 : 0;
  hapi_tape_commit(haptic->tape);
  haptic->note = NULL;
}

void hapi_tape_begun(hapi_haptic *haptic)
{
  if (hapi_tape_records(haptic->tape)) {
    close_packet(haptic);
  }
}

void hapi_tape_tick(hapi_haptic *haptic, int64_t now_ns)
{
  if (hapi_tape_records(haptic->tape)) {
    hapi_tape_open(haptic->tape);
    haptic->note = hapi_tape_put(haptic->tape, HAPI_CELL_TICK, 0);
    haptic->note->u[HAPI_TICK_WINDOW] = window_of(haptic, now_ns);
    haptic->note->i[HAPI_TICK_TIME] = now_ns;
  } else if (hapi_tape_plays(haptic->tape)) {
    /* Its index is an input itself. */
    uint32_t index = haptic->tape->packet_count > 0 ? haptic->tape->packet_cells[0].index : 0;
    haptic->tick_cell = hapi_tape_get(haptic->tape, HAPI_CELL_TICK, index);
  }
}

void hapi_tape_calls(hapi_haptic *haptic, hapi_loop_calls *io)
{
  if (hapi_tape_records(haptic->tape)) {
    haptic->note->flags =
        (uint16_t)((io->reset ? HAPI_CELL_RESET : 0) | (io->emergency ? HAPI_CELL_EMERGENCY : 0));
    haptic->note->index = (uint8_t)io->outside_fault;
  } else if (hapi_tape_plays(haptic->tape)) {
    io->reset = (haptic->tick_cell->flags & HAPI_CELL_RESET) != 0;
    io->emergency = (haptic->tick_cell->flags & HAPI_CELL_EMERGENCY) != 0;
    io->outside_fault = (hap_fault)haptic->tick_cell->index;
  }
}

/* Not before the first tick: there all that is there is taken. */
void hapi_tape_taken(hapi_haptic *haptic, bool model, bool patches)
{
  const hapi_exchange *exchange = haptic->config.exchange;
  if (!hapi_tape_records(haptic->tape) || haptic->note == NULL) {
    return;
  }
  if (model) {
    haptic->note->u[HAPI_TICK_MODEL] = hapi_exchange_taken(exchange, HAPI_CHANNEL_MODEL);
  }
  if (patches) {
    haptic->note->u[HAPI_TICK_PATCHES] = hapi_exchange_taken(exchange, HAPI_CHANNEL_PATCHES);
  }
}

/* ---- pointers come and go ---- */

static void put_hull(hapi_haptic *haptic, uint32_t index)
{
  const hapi_tool_hull *hull = &haptic->slots[index].hull;
  for (uint32_t i = 0; i < hull->count; i += 2) {
    hapi_cell *cell = hapi_tape_put(haptic->tape, HAPI_CELL_HULL, index);
    memset(cell->d, 0, sizeof cell->d);
    hapi_v3_copy(hull->points[i], cell->d);
    if (i + 1 < hull->count) {
      hapi_v3_copy(hull->points[i + 1], cell->d + 3);
    }
  }
}

static void get_hull(hapi_haptic *haptic, uint32_t index, uint32_t count, hapi_tool_hull *out)
{
  out->count = count <= HAPI_TOOL_POINTS_MAX ? count : 0;
  for (uint32_t i = 0; i < out->count; i += 2) {
    const hapi_cell *cell = hapi_tape_get(haptic->tape, HAPI_CELL_HULL, index);
    hapi_v3_copy(cell->d, out->points[i]);
    if (i + 1 < out->count) {
      hapi_v3_copy(cell->d + 3, out->points[i + 1]);
    }
  }
}

static hapi_joined_device device_recorded(const hap_device_info *info)
{
  hapi_joined_device out;
  memset(&out, 0, sizeof out); /* also what is between members */
  memcpy(out.name, info->name, sizeof out.name);
  out.dof = info->dof;
  out.max_force = info->max_force;
  out.max_torque = info->max_torque;
  out.rated_stiffness = info->rated_stiffness;
  out.damping = info->damping;
  out.quantum = info->quantum;
  out.mass = info->mass;
  out.friction = info->friction;
  out.delay = info->delay;
  out.measures_velocity = info->measures_velocity;
  return out;
}

void hapi_tape_join(hapi_haptic *haptic, uint32_t index)
{
  const hapi_pointer_slot *slot = &haptic->slots[index];
  char bytes[HAPI_JOIN_CELLS * HAPI_CELL_BYTES] = {0};
  hapi_joined joined;
  if (!hapi_tape_records(haptic->tape)) {
    return;
  }
  memset(&joined, 0, sizeof joined);
  joined.def = slot->def;
  joined.def.device = NULL;
  joined.def.hull_xyz = NULL;
  joined.device = device_recorded(&slot->info);
  joined.generation = slot->generation;
  joined.has_device = slot->has_device;
  memcpy(bytes, &joined, sizeof joined);
  for (uint32_t i = 0; i < HAPI_JOIN_CELLS; ++i) {
    memcpy(hapi_tape_put(haptic->tape, HAPI_CELL_JOIN, index)->d, bytes + i * HAPI_CELL_BYTES,
           HAPI_CELL_BYTES);
  }
  put_hull(haptic, index);
}

void hapi_tape_leave(hapi_haptic *haptic, uint32_t index, bool pauses)
{
  if (hapi_tape_records(haptic->tape)) {
    hapi_tape_put(haptic->tape, HAPI_CELL_LEAVE, index)->flags = pauses ? HAPI_CELL_PAUSES : 0;
  }
}

bool hapi_tape_next_leave(hapi_haptic *haptic, uint32_t *out_index, bool *out_pauses)
{
  const hapi_tape *tape = haptic->tape;
  if (!hapi_tape_next_is(tape, HAPI_CELL_LEAVE)) {
    return false;
  }
  *out_index = tape->packet_cells[tape->packet_at].index;
  *out_pauses =
      (hapi_tape_get(haptic->tape, HAPI_CELL_LEAVE, *out_index)->flags & HAPI_CELL_PAUSES) != 0;
  return *out_index < haptic->config.capacity.pointers;
}

bool hapi_tape_next_join(hapi_haptic *haptic, uint32_t *out_index, hapi_joined *out,
                         hapi_tool_hull *out_hull)
{
  hapi_tape *tape = haptic->tape;
  char bytes[HAPI_JOIN_CELLS * HAPI_CELL_BYTES];
  if (!hapi_tape_next_is(tape, HAPI_CELL_JOIN)) {
    return false;
  }
  *out_index = tape->packet_cells[tape->packet_at].index;
  for (uint32_t i = 0; i < HAPI_JOIN_CELLS; ++i) {
    memcpy(bytes + i * HAPI_CELL_BYTES, hapi_tape_get(tape, HAPI_CELL_JOIN, *out_index)->d,
           HAPI_CELL_BYTES);
  }
  memcpy(out, bytes, sizeof *out);
  get_hull(haptic, *out_index, (uint32_t)out->def.hull_points, out_hull);
  return !tape->broken && *out_index < haptic->config.capacity.pointers;
}

/* ---- devices ---- */

void hapi_tape_input(hapi_haptic *haptic, uint32_t index, hapi_pointer_input *io)
{
  if (hapi_tape_records(haptic->tape)) {
    hapi_cell *pose = hapi_tape_put(haptic->tape, HAPI_CELL_POSE, index);
    pose->flags = io->failed ? HAPI_CELL_FAILED : 0;
    pose->word = io->buttons;
    memcpy(pose->d, &io->pose, sizeof io->pose);
    memcpy(hapi_tape_put(haptic->tape, HAPI_CELL_TWIST, index)->d, &io->twist, sizeof io->twist);
  } else if (hapi_tape_plays(haptic->tape)) {
    const hapi_cell *pose = hapi_tape_get(haptic->tape, HAPI_CELL_POSE, index);
    io->failed = (pose->flags & HAPI_CELL_FAILED) != 0;
    io->buttons = pose->word;
    memcpy(&io->pose, pose->d, sizeof io->pose);
    memcpy(&io->twist, hapi_tape_get(haptic->tape, HAPI_CELL_TWIST, index)->d, sizeof io->twist);
  }
}

static uint64_t hash_pointer(const hapi_pointer *p)
{
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, p->device.buttons);
  hash = hapi_hash_doubles(hash, p->device.pose.position, 3);
  hash = hapi_hash_doubles(hash, p->device.pose.quat_wxyz, 4);
  hash = hapi_hash_doubles(hash, p->device.twist.linear, 3);
  hash = hapi_hash_doubles(hash, p->device.twist.angular, 3);
  hash = hapi_hash_doubles(hash, p->pose.position, 3);
  hash = hapi_hash_doubles(hash, p->pose.quat_wxyz, 4);
  hash = hapi_hash_doubles(hash, p->twist.linear, 3);
  hash = hapi_hash_doubles(hash, p->twist.angular, 3);
  hash = hapi_hash_doubles(hash, p->wrench.force, 3);
  hash = hapi_hash_doubles(hash, p->device.wrench.force, 3);
  return hapi_hash_doubles(hash, p->device.wrench.torque, 3);
}

static void cell_compare(hapi_haptic *haptic, hapi_difference *difference, const hapi_cell *cell,
                         const double *values, int count)
{
  memcpy(difference->recorded, cell->d, (size_t)count * sizeof cell->d[0]);
  memcpy(difference->replayed, values, (size_t)count * sizeof values[0]);
  difference->valued = memcmp(cell->d, values, (size_t)count * sizeof values[0]) != 0;
  if (difference->valued || difference->what == HAPI_DIFFERS_POINTER) {
    hapi_tape_differ(haptic->tape, difference);
  }
}

void hapi_tape_output(hapi_haptic *haptic, uint32_t index, hapi_pointer_output *io)
{
  const hapi_pointer *p = &haptic->tick.pointers.of[index];
  uint64_t hash =
      hapi_tape_records(haptic->tape) || hapi_tape_plays(haptic->tape) ? hash_pointer(p) : 0;
  if (hapi_tape_records(haptic->tape)) {
    hapi_cell *force = hapi_tape_put(haptic->tape, HAPI_CELL_FORCE, index);
    force->flags = io->failed ? HAPI_CELL_FAILED : 0;
    memcpy(force->d, &p->device.wrench, sizeof p->device.wrench);
    force->u[6] = hash;
    const void *reached = &io->reached; /* bit by bit: no padding in it */
    if (memcmp(reached, &p->device.wrench, sizeof io->reached) != 0) {
      memcpy(hapi_tape_put(haptic->tape, HAPI_CELL_REACHED, index)->d, &io->reached,
             sizeof io->reached);
    }
  } else if (hapi_tape_plays(haptic->tape)) {
    const hapi_cell *force = hapi_tape_get(haptic->tape, HAPI_CELL_FORCE, index);
    io->failed = (force->flags & HAPI_CELL_FAILED) != 0;
    if (force->u[6] != hash) {
      double wrench[6];
      hapi_difference difference = {.what = HAPI_DIFFERS_POINTER,
                                    .number = ((uint64_t)p->generation << 32) | (index + 1)};
      memcpy(wrench, &p->device.wrench, sizeof wrench);
      cell_compare(haptic, &difference, force, wrench, 6);
    }
    if (hapi_tape_next_is(haptic->tape, HAPI_CELL_REACHED)) {
      (void)hapi_tape_get(haptic->tape, HAPI_CELL_REACHED, index);
    }
  }
}

/* ---- what came of it ---- */

static uint64_t hash_tick(const hapi_tick *tick)
{
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, tick->facts.model_number);
  hash = hapi_hash_word(hash, (uint64_t)tick->guard.latch.fault);
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    if (tick->pointers.of[i].generation != 0) {
      hash = hapi_hash_word(hash, hash_pointer(&tick->pointers.of[i]));
    }
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    hash = hapi_hash_word(hash, tick->bodies.live[i]);
    hash = hapi_hash_doubles(hash, body->pose.position, 3);
    hash = hapi_hash_doubles(hash, body->pose.quat_wxyz, 4);
    hash = hapi_hash_doubles(hash, body->twist.linear, 3);
    hash = hapi_hash_doubles(hash, body->twist.angular, 3);
  }
  return hash;
}

/* Of many bodies one part after the other. */
static uint32_t first_body(hapi_haptic *haptic, uint32_t *out_end)
{
  uint32_t count = haptic->tick.bodies.live_count;
  uint32_t parts = (count + HAPI_CELL_BODIES - 1) / HAPI_CELL_BODIES;
  uint32_t first = parts > 1 ? haptic->turn++ % parts * HAPI_CELL_BODIES : 0;
  *out_end = first + HAPI_CELL_BODIES < count ? first + HAPI_CELL_BODIES : count;
  return first;
}

static void put_bodies(hapi_haptic *haptic)
{
  const hapi_tick *tick = &haptic->tick;
  uint32_t end = 0;
  for (uint32_t i = first_body(haptic, &end); i < end; ++i) {
    hapi_cell *cell = hapi_tape_put(haptic->tape, HAPI_CELL_BODY, 0);
    cell->word = tick->bodies.live[i];
    memcpy(cell->d, &tick->bodies.of[tick->bodies.live[i]].pose, sizeof(hap_pose));
  }
}

static uint32_t trace_place(const hapi_tick *tick, uint32_t slot)
{
  for (uint32_t i = 0; i < tick->watch.count; ++i) {
    if (tick->watch.slot[i] == slot) {
      return i;
    }
  }
  return UINT32_MAX;
}

static void compare_bodies(hapi_haptic *haptic)
{
  const hapi_tick *tick = &haptic->tick;
  while (hapi_tape_next_is(haptic->tape, HAPI_CELL_BODY)) {
    const hapi_cell *cell = hapi_tape_get(haptic->tape, HAPI_CELL_BODY, 0);
    double pose[7];
    if (cell->word < tick->capacity.bodies) {
      hapi_difference difference = {
          .what = HAPI_DIFFERS_BODY, .number = cell->word, .traced = trace_place(tick, cell->word)};
      memcpy(pose, &tick->bodies.of[cell->word].pose, sizeof pose);
      cell_compare(haptic, &difference, cell, pose, 7);
    }
  }
}

void hapi_tape_ticked(hapi_haptic *haptic)
{
  if (hapi_tape_records(haptic->tape)) {
    haptic->note->u[HAPI_TICK_HASH] = hash_tick(&haptic->tick);
    haptic->note->u[HAPI_TICK_BODIES] = haptic->tick.bodies.live_count;
    put_bodies(haptic);
    close_packet(haptic);
  } else if (hapi_tape_plays(haptic->tape)) {
    const hapi_difference difference = {.what = HAPI_DIFFERS_TICK};
    compare_bodies(haptic);
    haptic->tape->broken =
        haptic->tape->broken || haptic->tape->packet_at != haptic->tape->packet_count;
    if (haptic->tick_cell->u[HAPI_TICK_HASH] != hash_tick(&haptic->tick)) {
      hapi_tape_differ(haptic->tape, &difference);
    }
  }
}
