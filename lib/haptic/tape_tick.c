/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "base/pointer_id.h"
#include "haptic/axes.h"
#include "tick/report.h"

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

void hapi_tape_standstill(hapi_haptic *haptic, hapi_loop_standstill *io)
{
  if (hapi_tape_records(haptic->tape) && io->blocked) {
    haptic->note->flags |=
        (uint16_t)(HAPI_CELL_BLOCKED | io->pointer << HAPI_CELL_BLOCKED_POINTER_SHIFT);
  } else if (hapi_tape_plays(haptic->tape)) {
    io->blocked = (haptic->tick_cell->flags & HAPI_CELL_BLOCKED) != 0;
    io->pointer = haptic->tick_cell->flags >> HAPI_CELL_BLOCKED_POINTER_SHIFT;
  }
}

void hapi_tape_textures(hapi_haptic *haptic, uint64_t *io_out)
{
  if (hapi_tape_records(haptic->tape)) {
    haptic->note->u[HAPI_TICK_TEXTURES] = *io_out;
  } else if (hapi_tape_plays(haptic->tape)) {
    *io_out = haptic->tick_cell->u[HAPI_TICK_TEXTURES];
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

static void hull_count(size_t points, hapi_tool_hull *out)
{
  out->count = points <= HAPI_TOOL_POINTS_MAX ? (uint32_t)points : 0;
}

static void hull_move(hapi_tape *tape, uint32_t index, hapi_tool_hull *io)
{
  for (uint32_t i = 0; i < io->count; i += 2) {
    size_t size = (i + 1 < io->count ? 2 : 1) * sizeof io->points[0];
    hapi_tape_move(tape, hapi_tape_next(tape, HAPI_CELL_HULL, index)->d,
                   (char *)io->points + i * sizeof io->points[0], size);
  }
}

/* A struct in several cells of one kind; bytes: as many as they have. */
static void cells_move(hapi_tape *tape, hapi_cell_kind kind, uint32_t index, char *bytes,
                       uint32_t count)
{
  for (uint32_t i = 0; i < count; ++i) {
    hapi_tape_move(tape, hapi_tape_next(tape, kind, index)->d, bytes + i * HAPI_CELL_BYTES,
                   HAPI_CELL_BYTES);
  }
}

static void joined_move(hapi_tape *tape, uint32_t index, hapi_joined *io)
{
  char bytes[HAPI_JOIN_CELLS * HAPI_CELL_BYTES] = {0};
  memcpy(bytes, io, sizeof *io);
  cells_move(tape, HAPI_CELL_JOIN, index, bytes, HAPI_JOIN_CELLS);
  memcpy(io, bytes, sizeof *io);
}

static void setting_move(hapi_tape *tape, uint32_t index, hapi_pointer_setting *io)
{
  char bytes[HAPI_SET_CELLS * HAPI_CELL_BYTES] = {0};
  memcpy(bytes, io, sizeof *io);
  cells_move(tape, HAPI_CELL_SET, index, bytes, HAPI_SET_CELLS);
  memcpy(io, bytes, sizeof *io);
}

/* What the file has of a device. */
#define FIGURE(member)                                                       \
  {                                                                          \
    offsetof(hapi_joined_device, member), offsetof(hap_device_info, member), \
        sizeof(((hap_device_info *)0)->member)                               \
  }

static void device_move(const hapi_tape *tape, hapi_joined_device *in_cell, hap_device_info *io)
{
  static const struct {
    size_t joined;
    size_t info;
    size_t size;
  } figures[] = {
      FIGURE(name),     FIGURE(dof),     FIGURE(max_force),         FIGURE(max_torque),
      FIGURE(mass),     FIGURE(damping), FIGURE(quantum),           FIGURE(rated_stiffness),
      FIGURE(friction), FIGURE(delay),   FIGURE(measures_velocity),
  };
  for (size_t i = 0; i < sizeof figures / sizeof figures[0]; ++i) {
    hapi_tape_move(tape, (char *)in_cell + figures[i].joined, (char *)io + figures[i].info,
                   figures[i].size);
  }
}

void hapi_tape_join(hapi_haptic *haptic, uint32_t index)
{
  hapi_pointer_slot *slot = &haptic->slots[index];
  hapi_joined joined;
  if (!hapi_tape_records(haptic->tape)) {
    return;
  }
  memset(&joined, 0, sizeof joined); /* also what is between members */
  joined.def = slot->def;
  joined.def.device = NULL;
  joined.def.hull_xyz = NULL;
  device_move(haptic->tape, &joined.device, &slot->info);
  joined.generation = slot->generation;
  joined.has_device = slot->has_device;
  joined_move(haptic->tape, index, &joined);
  hull_move(haptic->tape, index, &slot->hull);
  hapi_tape_axis_infos(haptic->tape, index, slot->axes, &slot->info);
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
                         hap_device_info *out_info, hap_axis_info *out_axes,
                         hapi_tool_hull *out_hull)
{
  hapi_tape *tape = haptic->tape;
  if (!hapi_tape_next_is(tape, HAPI_CELL_JOIN)) {
    return false;
  }
  *out_index = tape->packet_cells[tape->packet_at].index;
  memset(out, 0, sizeof *out);
  joined_move(tape, *out_index, out);
  memset(out_info, 0, sizeof *out_info);
  out_info->size = sizeof *out_info;
  device_move(tape, &out->device, out_info);
  hull_count(out->def.hull_points, out_hull);
  hull_move(tape, *out_index, out_hull);
  memset(out_axes, 0, HAP_AXES_MAX * sizeof *out_axes);
  hapi_tape_axis_infos(tape, *out_index, out_axes, out_info);
  return !tape->broken && *out_index < haptic->config.capacity.pointers;
}

void hapi_tape_set(hapi_haptic *haptic, uint32_t index, const hapi_pointer_setting *setting,
                   const hapi_tool_hull *hull)
{
  if (hapi_tape_records(haptic->tape)) {
    hapi_pointer_setting copy = *setting;
    hapi_tool_hull points = *hull;
    if ((setting->mask & HAP_SET_SHAPE) == 0) {
      copy.def.hull_points = 0; /* no points follow */
    }
    setting_move(haptic->tape, index, &copy);
    if ((setting->mask & HAP_SET_SHAPE) != 0) {
      hull_move(haptic->tape, index, &points);
    }
  }
}

bool hapi_tape_next_set(hapi_haptic *haptic, uint32_t index, hapi_pointer_setting *out,
                        hapi_tool_hull *out_hull)
{
  hapi_tape *tape = haptic->tape;
  if (!hapi_tape_next_is(tape, HAPI_CELL_SET) ||
      tape->packet_cells[tape->packet_at].index != index) {
    return false;
  }
  memset(out, 0, sizeof *out);
  setting_move(tape, index, out);
  memset(out_hull, 0, sizeof *out_hull);
  if ((out->mask & HAP_SET_SHAPE) != 0) {
    hull_count(out->def.hull_points, out_hull);
    hull_move(tape, index, out_hull);
  }
  return !tape->broken;
}

/* ---- devices ---- */

void hapi_tape_input(hapi_haptic *haptic, uint32_t index, hapi_pointer_input *io)
{
  hapi_tape *tape = haptic->tape;
  hapi_cell *pose = hapi_tape_next(tape, HAPI_CELL_POSE, index);
  hapi_tape_move_flag(tape, pose, HAPI_CELL_FAILED, &io->failed);
  hapi_tape_move_flag(tape, pose, HAPI_CELL_DOUBTED, &io->doubted);
  hapi_tape_move(tape, &pose->word, &io->buttons, sizeof io->buttons);
  hapi_tape_move(tape, pose->d, &io->pose, sizeof io->pose);
  hapi_tape_move(tape, hapi_tape_next(tape, HAPI_CELL_TWIST, index)->d, &io->twist,
                 sizeof io->twist);
}

static uint64_t hash_pointer(const hapi_tick *tick, uint32_t index)
{
  const hapi_pointer *p = &tick->pointers.of[index];
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, p->device.buttons);
  hash = hapi_hash_motion(hash, &p->device.pose, &p->device.twist);
  hash = hapi_hash_motion(hash, &p->pose, &p->twist);
  hash = hapi_hash_doubles(hash, p->wrench.force, 3);
  hash = hapi_hash_doubles(hash, p->device.wrench.force, 3);
  hash = hapi_hash_doubles(hash, p->device.wrench.torque, 3);
  return hapi_tick_hash_axes(tick, index, hash);
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
  hapi_tape *tape = haptic->tape;
  const hapi_pointer *p = &haptic->tick.pointers.of[index];
  uint64_t hash = hash_pointer(&haptic->tick, index);
  double wrench[6];
  double reached[6]; /* bit by bit: no padding in it */
  memcpy(wrench, &p->device.wrench, sizeof wrench);
  memcpy(reached, &io->reached, sizeof reached);
  hapi_cell *force = hapi_tape_next(tape, HAPI_CELL_FORCE, index);
  hapi_tape_move_flag(tape, force, HAPI_CELL_FAILED, &io->failed);
  if (hapi_tape_records(tape)) {
    memcpy(force->d, wrench, sizeof wrench);
    force->u[6] = hash;
    if (memcmp(reached, wrench, sizeof reached) != 0) {
      memcpy(hapi_tape_put(tape, HAPI_CELL_REACHED, index)->d, reached, sizeof reached);
    }
    return;
  }
  if (force->u[6] != hash) {
    hapi_difference difference = {.what = HAPI_DIFFERS_POINTER,
                                  .number = hapi_pointer_id_of(p->generation, index + 1)};
    cell_compare(haptic, &difference, force, wrench, 6);
  }
  if (hapi_tape_next_is(tape, HAPI_CELL_REACHED)) {
    (void)hapi_tape_get(tape, HAPI_CELL_REACHED, index);
  }
}

/* ---- what came of it ---- */

static uint64_t hash_tick(const hapi_tick *tick)
{
  uint64_t hash = hapi_hash_word(HAPI_HASH_BEGIN, tick->facts.model_number);
  hash = hapi_hash_word(hash, (uint64_t)tick->guard.latch.fault);
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    if (tick->pointers.of[i].generation != 0) {
      hash = hapi_hash_word(hash, hash_pointer(tick, i));
    }
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    hash = hapi_hash_word(hash, tick->bodies.live[i]);
    hash = hapi_hash_motion(hash, &body->pose, &body->twist);
  }
  return hash;
}

/* Of many bodies one part after the other. */
static void put_bodies(hapi_haptic *haptic)
{
  const hapi_bodies *bodies = &haptic->tick.bodies;
  uint32_t parts = (bodies->live_count + HAPI_CELL_BODIES - 1) / HAPI_CELL_BODIES;
  uint32_t first = parts > 1 ? haptic->turn++ % parts * HAPI_CELL_BODIES : 0;
  for (uint32_t i = first; i < first + HAPI_CELL_BODIES && i < bodies->live_count; ++i) {
    hapi_cell *cell = hapi_tape_put(haptic->tape, HAPI_CELL_BODY, 0);
    cell->word = bodies->live[i];
    memcpy(cell->d, &bodies->of[bodies->live[i]].pose, sizeof(hap_pose));
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
