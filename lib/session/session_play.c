/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <hapode/record.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "device/device.h"
#include "record/reader.h"
#include "session/session_internal.h"

/* Replay. A tick, a physics step and a contact pass of the recording each took what others had told
 * them by then, and the recording says which message that was. So each is run as a whole as soon as
 * the messages it took are there, in one thread, and the mailboxes hand over what was taken then:
 * it does not matter that a step is over before a tick that in truth was run while it was being
 * computed. */

struct hap_player {
  hapi_reader *reader;
  hap_session *session;
  hapi_tape tapes[HAPI_STREAMS];
  bool ticked; /* at least once */
  uint64_t window;
  uint64_t alike; /* ticks so far */
  bool found;     /* the first difference, since the last tick */
  hap_play_difference difference;
};

/* ---- what differs ---- */

static void name_thing(uint32_t what, uint64_t number, uint32_t traced, char *out, size_t size)
{
  switch ((hap_difference)what) {
    case HAP_DIFFERENCE_STEP:
      snprintf(out, size, "physics step %llu", (unsigned long long)number - 1);
      return;
    case HAP_DIFFERENCE_PASS:
      snprintf(out, size, "contact pass %llu", (unsigned long long)number);
      return;
    case HAP_DIFFERENCE_POINTER:
      snprintf(out, size, "pointer %u", (unsigned)(number & 0xffffffffu));
      return;
    case HAP_DIFFERENCE_BODY:
      if (traced != UINT32_MAX) {
        snprintf(out, size, "body b%u", traced);
      } else {
        snprintf(out, size, "a body (place %llu in the loop)", (unsigned long long)number);
      }
      return;
    case HAP_DIFFERENCE_TICK:
      snprintf(out, size, "a velocity or a fault");
      return;
    case HAP_DIFFERENCE_NONE:
      break;
  }
  snprintf(out, size, "nothing");
}

static void difference_word(hap_play_difference *d)
{
  char thing[64];
  char shown[64];
  bool pointer = d->shown == HAP_DIFFERENCE_POINTER;
  name_thing(d->what, d->number, d->traced, thing, sizeof thing);
  int used = snprintf(d->text, sizeof d->text, "differs from tick %llu (%.4f s) on, first in %s",
                      (unsigned long long)d->tick, d->t, thing);
  if (used >= (int)sizeof d->text) {
    return;
  }
  char *rest = d->text + used;
  size_t room = sizeof d->text - (size_t)used;
  if (d->shown != HAP_DIFFERENCE_NONE) {
    name_thing(d->shown, d->shown_number, d->traced, shown, sizeof shown);
    snprintf(rest, room, "; at tick %llu %s of %s is off by %.3g %s",
             (unsigned long long)d->shown_tick, pointer ? "the wrench" : "the pose", shown,
             d->distance, pointer ? "N" : "m");
  } else if (d->what == HAP_DIFFERENCE_POINTER) {
    snprintf(rest, room,
             ": what it was given or how it moves; its force is the same to the last bit");
  }
}

static void difference_note(hap_player *player, const hapi_difference *found)
{
  hap_play_difference *d = &player->difference;
  if (d->what == HAP_DIFFERENCE_NONE && found->what != HAPI_DIFFERS_NOTHING) {
    d->what = (uint32_t)found->what;
    d->number = found->number;
    d->tick = player->alike;
    d->traced = found->traced;
    player->found = true;
  }
  bool shows =
      found->valued && (found->what == HAPI_DIFFERS_POINTER || found->what == HAPI_DIFFERS_BODY);
  if (shows && d->shown == HAP_DIFFERENCE_NONE) {
    double apart[3];
    d->shown = (uint32_t)found->what;
    d->shown_number = found->number;
    d->shown_tick = player->alike;
    d->traced = found->traced;
    memcpy(d->recorded, found->recorded, sizeof d->recorded);
    memcpy(d->replayed, found->replayed, sizeof d->replayed);
    hapi_v3_sub(found->replayed, found->recorded, apart);
    d->distance = hapi_v3_norm(apart);
    difference_word(d);
  }
}

/* ---- the parts of the session, one packet each ---- */

static hap_status play_contradicts(const hap_player *player, const char *what, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "the recording contradicts itself at tick %llu: %s; it cannot be replayed",
                   (unsigned long long)player->alike, what);
}

static hap_status check_after(hap_player *player, hapi_stream stream, hap_detail *detail)
{
  difference_note(player, &player->tapes[stream].first);
  if (player->tapes[stream].broken) {
    return play_contradicts(player, "its cells are not those that the session asks for", detail);
  }
  hap_status status = hapi_exchange_play_status(player->session->exchange);
  if (status == HAP_ERROR_MEMORY) {
    return hapi_fail(detail, status, "no memory for the messages of a replay");
  }
  return status < HAP_OK ? play_contradicts(player, "a message is taken that is not there", detail)
                         : HAP_OK;
}

static uint64_t count_published(const hap_player *player, hapi_channel channel)
{
  return hapi_exchange_published(player->session->exchange, channel);
}

/* Before it nothing of the packet is true yet. */
static hap_status run_cycle(hap_player *player, const hapi_cell *cells, uint32_t count,
                            hap_detail *detail)
{
  hapi_tape *tape = &player->tapes[HAPI_STREAM_PHYSICS];
  if (cells == NULL || cells[0].kind != HAPI_CELL_CYCLE ||
      cells[0].u[HAPI_CYCLE_STATE] > count_published(player, HAPI_CHANNEL_STATE)) {
    return play_contradicts(player, "a physics step took a message that comes later", detail);
  }
  hapi_exchange_expect(player->session->exchange, HAPI_CHANNEL_STATE, cells[0].u[HAPI_CYCLE_STATE]);
  hapi_tape_load(tape, cells, count);
  hapi_physics_cycle(player->session->physics, cells[0].i[HAPI_CYCLE_TIME],
                     cells[0].i[HAPI_CYCLE_NEXT]);
  hapi_reader_pop(player->reader, HAPI_STREAM_PHYSICS);
  return check_after(player, HAPI_STREAM_PHYSICS, detail);
}

static hap_status run_pass(hap_player *player, const hapi_cell *cell, uint32_t count,
                           hap_detail *detail)
{
  hapi_tape *tape = &player->tapes[HAPI_STREAM_CONTACT];
  hapi_exchange *exchange = player->session->exchange;
  uint64_t before = count_published(player, HAPI_CHANNEL_PATCHES);
  if (cell == NULL || cell->u[HAPI_PASS_POSES] > count_published(player, HAPI_CHANNEL_POSES) ||
      cell->u[HAPI_PASS_NEAR] > count_published(player, HAPI_CHANNEL_NEAR)) {
    return play_contradicts(player, "a contact pass took a message that comes later", detail);
  }
  hapi_exchange_expect(exchange, HAPI_CHANNEL_POSES, cell->u[HAPI_PASS_POSES]);
  hapi_exchange_expect(exchange, HAPI_CHANNEL_NEAR, cell->u[HAPI_PASS_NEAR]);
  hapi_tape_load(tape, cell, count);
  hapi_contact_pass(player->session->contact, cell->i[HAPI_PASS_VALID]);
  hapi_reader_pop(player->reader, HAPI_STREAM_CONTACT);
  if (count_published(player, HAPI_CHANNEL_PATCHES) == before) {
    return play_contradicts(player, "a contact pass had nothing to work on", detail);
  }
  return check_after(player, HAPI_STREAM_CONTACT, detail);
}

/* Physics steps until there are so many messages of theirs. HAP_END: the recording has no more. */
static hap_status run_cycles_for(hap_player *player, hapi_channel channel, uint64_t number,
                                 hap_detail *detail)
{
  while (count_published(player, channel) < number) {
    const hapi_cell *cells = NULL;
    uint32_t count = 0;
    HAPI_TRY(hapi_reader_peek(player->reader, HAPI_STREAM_PHYSICS, &cells, &count, detail));
    HAPI_TRY(run_cycle(player, cells, count, detail));
  }
  return HAP_OK;
}

static hap_status run_passes_for(hap_player *player, uint64_t number, hap_detail *detail)
{
  while (count_published(player, HAPI_CHANNEL_PATCHES) < number) {
    const hapi_cell *cell = NULL;
    uint32_t count = 0;
    HAPI_TRY(hapi_reader_peek(player->reader, HAPI_STREAM_CONTACT, &cell, &count, detail));
    HAPI_TRY(run_cycles_for(player, HAPI_CHANNEL_NEAR, cell->u[HAPI_PASS_NEAR], detail));
    /* that may have read on, and the cells have moved */
    HAPI_TRY(hapi_reader_peek(player->reader, HAPI_STREAM_CONTACT, &cell, &count, detail));
    HAPI_TRY(run_pass(player, cell, count, detail));
  }
  return HAP_OK;
}

/* The next message that a channel's reader takes; those before it can go. */
static void channel_await(hap_player *player, hapi_channel channel, uint64_t expected,
                          uint64_t needed)
{
  hapi_exchange_expect(player->session->exchange, channel, expected);
  hapi_exchange_forget(player->session->exchange, channel, needed);
}

/* Physics steps whose messages are there, and what the mailbox need keep for the one after them. */
static hap_status run_ready_cycles(hap_player *player, hap_detail *detail)
{
  for (;;) {
    const hapi_cell *cells = NULL;
    uint32_t count = 0;
    uint64_t there = count_published(player, HAPI_CHANNEL_STATE);
    HAPI_TRY(hapi_reader_glance(player->reader, HAPI_STREAM_PHYSICS, &cells, &count, detail));
    uint64_t wanted = cells != NULL ? cells->u[HAPI_CYCLE_STATE] : 0;
    if (count == 0 ||
        wanted > there) { /* none in sight, not over in sight, or it waits for a tick */
      channel_await(player, HAPI_CHANNEL_STATE, wanted, wanted > there ? wanted : there + 1);
      return HAP_OK;
    }
    HAPI_TRY(run_cycle(player, cells, count, detail));
  }
}

static hap_status run_ready_passes(hap_player *player, hap_detail *detail)
{
  for (;;) {
    const hapi_cell *cell = NULL;
    uint32_t count = 0;
    uint64_t poses_there = count_published(player, HAPI_CHANNEL_POSES);
    uint64_t near_there = count_published(player, HAPI_CHANNEL_NEAR);
    HAPI_TRY(hapi_reader_glance(player->reader, HAPI_STREAM_CONTACT, &cell, &count, detail));
    uint64_t poses = cell != NULL ? cell->u[HAPI_PASS_POSES] : poses_there + 1;
    uint64_t near = cell != NULL ? cell->u[HAPI_PASS_NEAR] : near_there + 1;
    if (count == 0 || poses > poses_there || near > near_there) {
      channel_await(player, HAPI_CHANNEL_POSES, poses, poses);
      channel_await(player, HAPI_CHANNEL_NEAR, near, near);
      return HAP_OK;
    }
    HAPI_TRY(run_pass(player, cell, count, detail));
  }
}

/* ---- a tick ---- */

/* The vertices are in the HULL cells behind the JOINs. */
static bool read_hull(const hapi_cell *cells, uint32_t count, hapi_pointer_setup *io,
                      double points[HAPI_TOOL_POINTS_MAX + 1][3])
{
  size_t wanted = io->hull_points;
  if (wanted > HAPI_TOOL_POINTS_MAX || HAPI_HULL_CELLS(wanted) > count) {
    return false;
  }
  for (uint32_t i = 0; i < HAPI_HULL_CELLS(wanted); ++i) {
    if (cells[i].kind != HAPI_CELL_HULL) {
      return false;
    }
    memcpy(points[2 * i], cells[i].d, 6 * sizeof(double));
  }
  io->hull_xyz = wanted > 0 ? &points[0][0] : NULL;
  return true;
}

static hap_status check_join(const hap_player *player, const hapi_cell *cells, uint32_t count,
                             hap_detail *detail)
{
  double points[HAPI_TOOL_POINTS_MAX + 1][3];
  char bytes[HAPI_JOIN_CELLS * HAPI_CELL_BYTES];
  hapi_joined joined;
  for (uint32_t i = 0; i < HAPI_JOIN_CELLS; ++i) {
    memcpy(bytes + i * HAPI_CELL_BYTES, cells[i].d, HAPI_CELL_BYTES);
  }
  memcpy(&joined, bytes, sizeof joined);
  const hapi_joined_device *info = &joined.device;
  const double figures[] = {info->max_force, info->max_torque, info->rated_stiffness, info->damping,
                            info->quantum,   info->mass,       info->friction,        info->delay};
  bool good = cells[0].index < player->session->def.max_pointers && joined.generation != 0 &&
              joined.def.cookie == HAPI_POINTER_COOKIE && joined.def.device == NULL &&
              joined.def.hull_xyz == NULL &&
              read_hull(cells + HAPI_JOIN_CELLS, count - HAPI_JOIN_CELLS, &joined.def, points) &&
              hapi_device_figures_good(figures, sizeof figures / sizeof figures[0]) &&
              memchr(info->name, '\0', sizeof info->name) != NULL;
  if (joined.has_device != 0 && joined.def.velocity == HAP_VELOCITY_ESTIMATED) {
    joined.def.velocity = HAP_VELOCITY_AUTO; /* of a device, which is not there */
  }
  if (!good || hapi_session_check_pointer(&joined.def, NULL) < HAP_OK) {
    return play_contradicts(player, "a pointer comes that there cannot be", detail);
  }
  return HAP_OK;
}

static hap_status check_set(const hap_player *player, const hapi_cell *cells, uint32_t count,
                            hap_detail *detail)
{
  double points[HAPI_TOOL_POINTS_MAX + 1][3];
  char bytes[HAPI_SET_CELLS * HAPI_CELL_BYTES];
  hapi_pointer_setting setting;
  for (uint32_t i = 0; i < HAPI_SET_CELLS; ++i) {
    memcpy(bytes + i * HAPI_CELL_BYTES, cells[i].d, HAPI_CELL_BYTES);
  }
  memcpy(&setting, bytes, sizeof setting);
  bool good = cells[0].index < player->session->def.max_pointers &&
              setting.def.cookie == HAPI_POINTER_COOKIE && setting.def.device == NULL &&
              setting.def.hull_xyz == NULL &&
              read_hull(cells + HAPI_SET_CELLS, count - HAPI_SET_CELLS, &setting.def, points) &&
              hapi_session_check_setting(&setting, NULL) >= HAP_OK;
  return good ? HAP_OK : play_contradicts(player, "a setting that there cannot be", detail);
}

/* Of several cells of one kind, which are of one pointer: whether all are there. */
static bool has_cells(const hapi_cell *cells, uint32_t count, uint32_t wanted)
{
  for (uint32_t i = 0; i < wanted; ++i) {
    if (i >= count || cells[i].kind != cells[0].kind || cells[i].index != cells[0].index) {
      return false;
    }
  }
  return true;
}

/* What the loop would not have from devices. */
static hap_status check_packet(const hap_player *player, const hapi_cell *cells, uint32_t count,
                               hap_detail *detail)
{
  if (cells[0].index > HAP_FAULT_DEVICE_INPUT) {
    return play_contradicts(player, "a fault that there is not", detail);
  }
  if (cells[0].kind == HAPI_CELL_TICK &&
      cells[0].flags >> HAPI_CELL_BLOCKED_POINTER_SHIFT > player->session->def.max_pointers) {
    return play_contradicts(player, "a device that there is not", detail);
  }
  for (uint32_t i = 1; i < count; ++i) {
    if (cells[i].kind == HAPI_CELL_JOIN) {
      HAPI_TRY(i + HAPI_JOIN_CELLS <= count
                   ? check_join(player, &cells[i], count - i, detail)
                   : play_contradicts(player, "a pointer comes in part", detail));
      i += HAPI_JOIN_CELLS - 1;
    } else if (cells[i].kind == HAPI_CELL_SET) {
      HAPI_TRY(has_cells(&cells[i], count - i, HAPI_SET_CELLS)
                   ? check_set(player, &cells[i], count - i, detail)
                   : play_contradicts(player, "a setting comes in part", detail));
      i += HAPI_SET_CELLS - 1;
    }
  }
  return HAP_OK;
}

/* HAP_END: there is none any more; HAP_DIVERGED: the first that is different. */
static hap_status play_tick(hap_player *player, hap_detail *detail)
{
  hap_session *session = player->session;
  hapi_reader *reader = player->reader;
  const hapi_cell *cells = NULL;
  uint32_t count = 0;
  HAPI_TRY(run_ready_cycles(player, detail));
  HAPI_TRY(run_ready_passes(player, detail));
  HAPI_TRY(hapi_reader_peek(reader, HAPI_STREAM_HAPTIC, &cells, &count, detail));
  HAPI_TRY(check_packet(player, cells, count, detail));
  uint64_t model = cells->u[HAPI_TICK_MODEL];
  uint64_t patches = cells->u[HAPI_TICK_PATCHES];
  HAPI_TRY(run_cycles_for(player, HAPI_CHANNEL_MODEL, model, detail));
  HAPI_TRY(run_passes_for(player, patches, detail));
  /* they may have read on, and the cells have moved */
  HAPI_TRY(hapi_reader_peek(reader, HAPI_STREAM_HAPTIC, &cells, &count, detail));
  session->played_ns = cells->i[HAPI_TICK_TIME];
  uint64_t window = cells->u[HAPI_TICK_WINDOW];
  if (player->ticked) {
    hapi_haptic_count_missed(session->haptic, window - player->window - 1);
  }
  player->ticked = true;
  player->window = window;
  hapi_exchange_expect(session->exchange, HAPI_CHANNEL_MODEL, model);
  hapi_exchange_expect(session->exchange, HAPI_CHANNEL_PATCHES, patches);
  hapi_tape_load(&player->tapes[HAPI_STREAM_HAPTIC], cells, count);
  hapi_haptic_cycle(session->haptic, session->played_ns);
  hapi_reader_pop(reader, HAPI_STREAM_HAPTIC);
  hap_status status = check_after(player, HAPI_STREAM_HAPTIC, detail);
  if (status == HAP_OK && player->found) { /* here, or in what was run before it */
    player->difference.t =
        1e-9 * (double)(session->played_ns - hapi_reader_whole(reader)->start_ns);
    difference_word(&player->difference);
    player->found = false;
    status = HAP_DIVERGED;
  }
  ++player->alike;
  return status;
}

hap_status hapi_play_advance(hap_session *session, uint64_t ticks)
{
  hap_detail detail = {""};
  hap_status status = HAP_OK;
  for (uint64_t i = 0; i < ticks && status == HAP_OK; ++i) {
    status = play_tick(session->player, &detail);
  }
  return hapi_session_note(session, status, &detail);
}

/* ---- start ---- */

static hap_status start_load(hap_player *player, hapi_stream stream, hapi_cell_kind kind,
                             hap_detail *detail)
{
  const hapi_cell *cells = NULL;
  uint32_t count = 0;
  hap_status status = hapi_reader_peek(player->reader, stream, &cells, &count, detail);
  if (status == HAP_END) {
    return hapi_fail(detail, HAP_ERROR_FORMAT,
                     "the recording ends before its session had started: nothing can be replayed");
  }
  if (status == HAP_OK && cells[0].kind != kind) {
    return play_contradicts(player, "it does not begin with a start", detail);
  }
  if (status == HAP_OK) {
    hapi_tape_load(&player->tapes[stream], cells, count);
  }
  return status;
}

hap_status hapi_play_begin(hap_session *session, int64_t *out_start_ns, hap_detail *detail)
{
  hap_player *player = session->player;
  const hapi_cell *cells = NULL;
  uint32_t count = 0;
  hapi_tape *const tapes[HAPI_STREAMS] = {&player->tapes[0], &player->tapes[1], &player->tapes[2]};
  /* Reading on moves the cells of the other streams: in the second round all are there. */
  for (int round = 0; round < 2; ++round) {
    HAPI_TRY(start_load(player, HAPI_STREAM_PHYSICS, HAPI_CELL_WORLD, detail));
    HAPI_TRY(start_load(player, HAPI_STREAM_HAPTIC, HAPI_CELL_BEGIN, detail));
    /* a model without contact passes has none */
    HAPI_TRY(hapi_reader_glance(player->reader, HAPI_STREAM_CONTACT, &cells, &count, detail));
  }
  const hapi_tape *loop = &player->tapes[HAPI_STREAM_HAPTIC];
  hapi_tape_load(&player->tapes[HAPI_STREAM_CONTACT], cells, count);
  *out_start_ns = loop->packet_cells[0].i[0];
  hapi_session_set_tapes(session, tapes);
  return check_packet(player, loop->packet_cells, loop->packet_count, detail);
}

hap_status hapi_play_begun(hap_session *session, int64_t start_ns, hap_detail *detail)
{
  hap_player *player = session->player;
  session->played_ns = start_ns;
  hapi_reader_pop(player->reader, HAPI_STREAM_HAPTIC);
  hapi_reader_pop(player->reader, HAPI_STREAM_PHYSICS);
  if (count_published(player, HAPI_CHANNEL_PATCHES) > 0) {
    hapi_reader_pop(player->reader, HAPI_STREAM_CONTACT);
  }
  for (int i = 0; i < HAPI_STREAMS; ++i) {
    HAPI_TRY(check_after(player, (hapi_stream)i, detail));
  }
  return HAP_OK;
}

/* ---- the public side ---- */

hap_status hap_player_open(const char *path, hap_play_extent extent, hap_player **out,
                           hap_detail *detail)
{
  if (path == NULL || out == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "path or out is NULL");
  }
  if (extent != HAP_PLAY_WHOLE && extent != HAP_PLAY_INCOMPLETE) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "extent is %d, not one of hap_play_extent",
                     (int)extent);
  }
  *out = NULL;
  hap_player *player = hapi_alloc(sizeof *player);
  if (player == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a player");
  }
  hap_status status = hapi_reader_open(path, extent == HAP_PLAY_INCOMPLETE,
                                       hapi_physics_ode_configuration(), &player->reader, detail);
  if (status < HAP_OK) {
    hapi_free(player);
    return status;
  }
  for (int i = 0; i < HAPI_STREAMS; ++i) {
    player->tapes[i].mode = HAPI_TAPE_PLAY;
  }
  *out = player;
  return HAP_OK;
}

void hap_player_close(hap_player *player)
{
  if (player != NULL) {
    hapi_reader_close(player->reader);
    hapi_free(player);
  }
}

hap_status hap_player_get_info(const hap_player *player, hap_player_info *out, size_t size_of_out)
{
  if (player == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  const hapi_grammar *whole = hapi_reader_whole(player->reader);
  hap_player_info info = {
      .end = hapi_reader_end(player->reader)->end,
      .ticks = whole->ticks,
      .seconds = whole->ticks > 0 ? 1e-9 * (double)(whole->last_ns - whole->first_ns) : 0.0,
      .edits = whole->edits,
      .pointers = whole->pointers,
      .note = hapi_reader_note(player->reader),
      .note_size = hapi_reader_info(player->reader)->note_size,
  };
  snprintf(info.system, sizeof info.system, "%s", hapi_reader_info(player->reader)->build.system);
  return hapi_struct_give(&info, sizeof info, out, size_of_out);
}

static void recorded_defs(const hap_player *player, hap_session_def *def, hap_expert_def *expert,
                          hap_research_def *research)
{
  hapi_file_info info = *hapi_reader_info(player->reader);
  hapi_session_move_defs(&info, def, expert, research, false);
}

hap_status hap_player_get_def(const hap_player *player, hap_session_def *def,
                              hap_expert_def *expert, hap_research_def *research)
{
  hap_session_def d;
  hap_expert_def e;
  hap_research_def r;
  if (player == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_status status = hapi_def_read(&hapi_session_def_type, def, &d, NULL);
  status = status < HAP_OK ? status : hapi_def_read(&hapi_expert_def_type, expert, &e, NULL);
  status = status < HAP_OK ? status : hapi_def_read(&hapi_research_def_type, research, &r, NULL);
  if (status < HAP_OK) {
    return HAP_ERROR_ARGUMENT;
  }
  recorded_defs(player, &d, &e, &r);
  d.expert = expert;
  d.research = research;
  HAPI_TRY(hapi_def_write(&hapi_session_def_type, &d, def, NULL));
  HAPI_TRY(hapi_def_write(&hapi_expert_def_type, &e, expert, NULL));
  return hapi_def_write(&hapi_research_def_type, &r, research, NULL);
}

/* Whether the session is what was recorded. Copies are compared, down to the bytes between
 * members. */
static bool has_recorded_defs(const hap_session *session, const hap_player *player)
{
  hap_session_def def = session->def;
  hap_expert_def expert = session->expert;
  hap_research_def research = session->research;
  recorded_defs(player, &def, &expert, &research);
  return memcmp(&session->def, &def, sizeof def) == 0 &&
         memcmp(&session->expert, &expert, sizeof expert) == 0 &&
         memcmp(&session->research, &research, sizeof research) == 0;
}

static hap_status check_session(const hap_session *session, const hap_player *player,
                                hap_detail *detail)
{
  if (session->ran || session->player != NULL || session->recorder != NULL ||
      player->session != NULL) {
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "session or player are in use or have been: a replay takes a new one of each");
  }
  if (!has_recorded_defs(session, player)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "the session has another def than the recorded one: create it with that of "
                     "hap_player_get_def");
  }
  if (hapi_haptic_has_pointers(session->haptic)) {
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "the session has pointers of its own: a replay has those of the recording");
  }
  return HAP_OK;
}

hap_status hap_session_play(hap_session *session, hap_player *player, hap_detail *detail)
{
  if (session == NULL || player == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "session or player is NULL");
  }
  HAPI_TRY(check_session(session, player, detail));
  if (hapi_exchange_play(session->exchange) < HAP_OK) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a replay");
  }
  session->player = player;
  player->session = session;
  return HAP_OK;
}

hap_status hap_player_difference(const hap_player *player, hap_play_difference *out,
                                 size_t size_of_out)
{
  if (player == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_play_difference d = player->difference;
  hapi_file_info here;
  memset(&here, 0, sizeof here);
  hapi_file_describe(&here);
  d.other_system = strcmp(hapi_reader_info(player->reader)->build.system, here.build.system) != 0;
  return hapi_struct_give(&d, sizeof d, out, size_of_out);
}
