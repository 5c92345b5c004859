/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <hapode/record.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "record/reader.h"
#include "session/session_internal.h"

/* Replay. A tick, a physics step and a contact pass of the recording each took what others had told
 * them by then, and the recording says which message that was. So each is run as a whole as soon as
 * the messages it took are there, in one thread, and the mailboxes hand over what was taken then: it
 * does not matter that a step is over before a tick that in truth was run while it
 * was being computed. */

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

static bool shows(const hapi_difference *d)
{
  return d->valued && (d->what == HAPI_DIFFERS_POINTER || d->what == HAPI_DIFFERS_BODY);
}

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

static void word_difference(hap_play_difference *d)
{
  char thing[64];
  char shown[64];
  name_thing(d->what, d->number, d->traced, thing, sizeof thing);
  int used = snprintf(d->text, sizeof d->text, "differs from tick %llu (%.4f s) on, first in %s",
                      (unsigned long long)d->tick, d->t, thing);
  if (d->shown == HAP_DIFFERENCE_NONE && d->what == HAP_DIFFERENCE_POINTER) {
    snprintf(d->text + used, sizeof d->text - (size_t)used,
             ": what it was given or how it moves; its force is the same to the last bit");
  }
  if (d->shown != HAP_DIFFERENCE_NONE && used < (int)sizeof d->text) {
    name_thing(d->shown, d->shown_number, d->traced, shown, sizeof shown);
    snprintf(d->text + used, sizeof d->text - (size_t)used,
             "; at tick %llu %s of %s is off by %.3g %s", (unsigned long long)d->shown_tick,
             d->shown == HAP_DIFFERENCE_POINTER ? "the wrench" : "the pose", shown, d->distance,
             d->shown == HAP_DIFFERENCE_POINTER ? "N" : "m");
  }
}

static void note_difference(hap_player *player, const hapi_difference *found)
{
  hap_play_difference *d = &player->difference;
  if (d->what == HAP_DIFFERENCE_NONE && found->what != HAPI_DIFFERS_NOTHING) {
    d->what = (uint32_t)found->what;
    d->number = found->number;
    d->tick = player->alike;
    d->traced = found->traced;
    player->found = true;
  }
  if (shows(found) && d->shown == HAP_DIFFERENCE_NONE) {
    double apart[3];
    d->shown = (uint32_t)found->what;
    d->shown_number = found->number;
    d->shown_tick = player->alike;
    d->traced = found->traced;
    memcpy(d->recorded, found->recorded, sizeof d->recorded);
    memcpy(d->replayed, found->replayed, sizeof d->replayed);
    hapi_v3_sub(found->replayed, found->recorded, apart);
    d->distance = hapi_v3_norm(apart);
    word_difference(d);
  }
}

/* Of a tick that has been run: whether it, or what was run before it, is the first that differs. */
static bool found_first(hap_player *player)
{
  bool found = player->found;
  if (found) {
    player->difference.t =
        1e-9 * (double)(player->session->played_ns - hapi_reader_whole(player->reader)->start_ns);
    word_difference(&player->difference);
  }
  player->found = false;
  return found;
}

/* ---- the parts of the session, one packet each ---- */

static hap_status contradicts(const hap_player *player, const char *what, hap_detail *detail)
{
  return hapi_fail(detail, HAP_ERROR_FORMAT,
                   "the recording contradicts itself at tick %llu: %s; it cannot be replayed",
                   (unsigned long long)player->alike, what);
}

static hap_status check_after(hap_player *player, hapi_stream stream, hap_detail *detail)
{
  note_difference(player, &player->tapes[stream].first);
  if (player->tapes[stream].broken) {
    return contradicts(player, "its cells are not those that the session asks for", detail);
  }
  hap_status status = hapi_exchange_play_status(player->session->exchange);
  if (status == HAP_ERROR_MEMORY) {
    return hapi_fail(detail, status, "no memory for the messages of a replay");
  }
  return status < HAP_OK ? contradicts(player, "a message is taken that is not there", detail)
                         : HAP_OK;
}

static uint64_t published(const hap_player *player, hapi_channel channel)
{
  return hapi_exchange_published(player->session->exchange, channel);
}

/* Before it nothing of the packet is true yet. */
static hap_status run_cycle(hap_player *player, const hapi_cell *cells, uint32_t count,
                            hap_detail *detail)
{
  hapi_tape *tape = &player->tapes[HAPI_STREAM_PHYSICS];
  if (cells[0].kind != HAPI_CELL_CYCLE ||
      cells[0].u[HAPI_CYCLE_STATE] > published(player, HAPI_CHANNEL_STATE)) {
    return contradicts(player, "a physics step took a message that comes later", detail);
  }
  hapi_exchange_expect(player->session->exchange, HAPI_CHANNEL_STATE, cells[0].u[HAPI_CYCLE_STATE]);
  hapi_tape_load(tape, cells, count);
  hapi_physics_cycle(player->session->physics, cells[0].i[HAPI_CYCLE_TIME],
                     cells[0].i[HAPI_CYCLE_NEXT]);
  hapi_reader_pop(player->reader, HAPI_STREAM_PHYSICS);
  return check_after(player, HAPI_STREAM_PHYSICS, detail);
}

static hap_status run_pass(hap_player *player, const hapi_cell *cell, hap_detail *detail)
{
  hapi_tape *tape = &player->tapes[HAPI_STREAM_CONTACT];
  hapi_exchange *exchange = player->session->exchange;
  uint64_t before = published(player, HAPI_CHANNEL_PATCHES);
  if (cell->u[HAPI_PASS_POSES] > published(player, HAPI_CHANNEL_POSES) ||
      cell->u[HAPI_PASS_NEAR] > published(player, HAPI_CHANNEL_NEAR)) {
    return contradicts(player, "a contact pass took a message that comes later", detail);
  }
  hapi_exchange_expect(exchange, HAPI_CHANNEL_POSES, cell->u[HAPI_PASS_POSES]);
  hapi_exchange_expect(exchange, HAPI_CHANNEL_NEAR, cell->u[HAPI_PASS_NEAR]);
  hapi_tape_load(tape, cell, 1);
  hapi_contact_pass(player->session->contact, cell->i[HAPI_PASS_VALID]);
  hapi_reader_pop(player->reader, HAPI_STREAM_CONTACT);
  if (published(player, HAPI_CHANNEL_PATCHES) == before) {
    return contradicts(player, "a contact pass had nothing to work on", detail);
  }
  return check_after(player, HAPI_STREAM_CONTACT, detail);
}

/* Physics steps until there are so many messages of theirs. HAP_END: the recording has no more. */
static hap_status run_cycles_for(hap_player *player, hapi_channel channel, uint64_t number,
                                 hap_detail *detail)
{
  hap_status status = HAP_OK;
  while (status == HAP_OK && published(player, channel) < number) {
    const hapi_cell *cells = NULL;
    uint32_t count = 0;
    status = hapi_reader_peek(player->reader, HAPI_STREAM_PHYSICS, &cells, &count, detail);
    status = status == HAP_OK ? run_cycle(player, cells, count, detail) : status;
  }
  return status;
}

static hap_status run_passes_for(hap_player *player, uint64_t number, hap_detail *detail)
{
  hap_status status = HAP_OK;
  while (status == HAP_OK && published(player, HAPI_CHANNEL_PATCHES) < number) {
    const hapi_cell *cell = NULL;
    uint32_t count = 0;
    status = hapi_reader_peek(player->reader, HAPI_STREAM_CONTACT, &cell, &count, detail);
    if (status == HAP_OK) {
      status = run_cycles_for(player, HAPI_CHANNEL_NEAR, cell->u[HAPI_PASS_NEAR], detail);
    }
    if (status == HAP_OK) { /* that may have read on, and the cells have moved */
      status = hapi_reader_peek(player->reader, HAPI_STREAM_CONTACT, &cell, &count, detail);
    }
    status = status == HAP_OK ? run_pass(player, cell, detail) : status;
  }
  return status;
}

/* Physics steps whose messages are there, and what the mailbox need keep for the one after them. */
static hap_status run_ready_cycles(hap_player *player, hap_detail *detail)
{
  hapi_exchange *exchange = player->session->exchange;
  hap_status status = HAP_OK;
  for (bool more = true; more && status == HAP_OK;) {
    const hapi_cell *cells = NULL;
    uint32_t count = 0;
    uint64_t there = published(player, HAPI_CHANNEL_STATE);
    status = hapi_reader_glance(player->reader, HAPI_STREAM_PHYSICS, &cells, &count, detail);
    if (status != HAP_OK) {
      return status;
    }
    uint64_t wanted = cells != NULL ? cells->u[HAPI_CYCLE_STATE] : 0;
    more = cells != NULL && count == 2 && wanted <= there;
    if (more) {
      status = run_cycle(player, cells, count, detail);
    } else { /* none in sight, not over in sight, or it waits for a tick */
      hapi_exchange_expect(exchange, HAPI_CHANNEL_STATE, wanted);
      hapi_exchange_forget(exchange, HAPI_CHANNEL_STATE, wanted > there ? wanted : there + 1);
    }
  }
  return status;
}

static hap_status run_ready_passes(hap_player *player, hap_detail *detail)
{
  hapi_exchange *exchange = player->session->exchange;
  hap_status status = HAP_OK;
  for (bool more = true; more && status == HAP_OK;) {
    const hapi_cell *cell = NULL;
    uint32_t count = 0;
    uint64_t poses_there = published(player, HAPI_CHANNEL_POSES);
    uint64_t near_there = published(player, HAPI_CHANNEL_NEAR);
    status = hapi_reader_glance(player->reader, HAPI_STREAM_CONTACT, &cell, &count, detail);
    if (status != HAP_OK) {
      return status;
    }
    uint64_t poses = cell != NULL ? cell->u[HAPI_PASS_POSES] : poses_there + 1;
    uint64_t near = cell != NULL ? cell->u[HAPI_PASS_NEAR] : near_there + 1;
    more = cell != NULL && poses <= poses_there && near <= near_there;
    if (more) {
      status = run_pass(player, cell, detail);
    } else {
      hapi_exchange_expect(exchange, HAPI_CHANNEL_POSES, poses);
      hapi_exchange_forget(exchange, HAPI_CHANNEL_POSES, poses);
      hapi_exchange_expect(exchange, HAPI_CHANNEL_NEAR, near);
      hapi_exchange_forget(exchange, HAPI_CHANNEL_NEAR, near);
    }
  }
  return status;
}

/* ---- a tick ---- */

/* The vertices are in the HULL cells behind the JOINs. */
static bool read_hull(const hapi_cell *cells, uint32_t count, hapi_joined *io,
                      double points[HAPI_TOOL_POINTS_MAX + 1][3])
{
  size_t wanted = io->def.hull_points;
  if (wanted > HAPI_TOOL_POINTS_MAX || HAPI_HULL_CELLS(wanted) > count) {
    return false;
  }
  for (uint32_t i = 0; i < HAPI_HULL_CELLS(wanted); ++i) {
    if (cells[i].kind != HAPI_CELL_HULL) {
      return false;
    }
    memcpy(points[2 * i], cells[i].d, 6 * sizeof(double));
  }
  io->def.hull_xyz = wanted > 0 ? &points[0][0] : NULL;
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
              read_hull(cells + HAPI_JOIN_CELLS, count - HAPI_JOIN_CELLS, &joined, points) &&
              hapi_finite(figures, sizeof figures / sizeof figures[0]) &&
              memchr(info->name, '\0', sizeof info->name) != NULL;
  if (joined.has_device != 0 && joined.def.velocity == HAP_VELOCITY_ESTIMATED) {
    joined.def.velocity = HAP_VELOCITY_AUTO; /* of a device, which is not there */
  }
  if (!good || hapi_session_check_pointer(&joined.def, NULL) < HAP_OK) {
    return contradicts(player, "a pointer comes that there cannot be", detail);
  }
  return HAP_OK;
}

/* What the loop would not have from devices. */
static hap_status check_packet(const hap_player *player, const hapi_cell *cells, uint32_t count,
                               hap_detail *detail)
{
  if (cells[0].index > HAP_FAULT_EMERGENCY) {
    return contradicts(player, "a fault that there is not", detail);
  }
  for (uint32_t i = 1; i < count; ++i) {
    if (cells[i].kind == HAPI_CELL_JOIN) {
      hap_status status = i + HAPI_JOIN_CELLS <= count
                              ? check_join(player, &cells[i], count - i, detail)
                              : contradicts(player, "a pointer comes in part", detail);
      if (status < HAP_OK) {
        return status;
      }
      i += HAPI_JOIN_CELLS - 1;
    }
  }
  return HAP_OK;
}

static void count_missed(hap_player *player, uint64_t window)
{
  if (player->ticked) {
    hapi_haptic_count_missed(player->session->haptic, window - player->window - 1);
  }
  player->ticked = true;
  player->window = window;
}

/* HAP_END: there is none any more; HAP_DIVERGED: the first that is different. */
static hap_status play_tick(hap_player *player, hap_detail *detail)
{
  hap_session *session = player->session;
  const hapi_cell *cells = NULL;
  uint32_t count = 0;
  hap_status status = run_ready_cycles(player, detail);
  status = status == HAP_OK ? run_ready_passes(player, detail) : status;
  status = status == HAP_OK
               ? hapi_reader_peek(player->reader, HAPI_STREAM_HAPTIC, &cells, &count, detail)
               : status;
  status = status == HAP_OK ? check_packet(player, cells, count, detail) : status;
  if (status != HAP_OK) {
    return status;
  }
  uint64_t model = cells->u[HAPI_TICK_MODEL];
  uint64_t patches = cells->u[HAPI_TICK_PATCHES];
  status = run_cycles_for(player, HAPI_CHANNEL_MODEL, model, detail);
  status = status == HAP_OK ? run_passes_for(player, patches, detail) : status;
  /* they may have read on, and the cells have moved */
  status = status == HAP_OK
               ? hapi_reader_peek(player->reader, HAPI_STREAM_HAPTIC, &cells, &count, detail)
               : status;
  if (status != HAP_OK) {
    return status;
  }
  session->played_ns = cells->i[HAPI_TICK_TIME];
  count_missed(player, cells->u[HAPI_TICK_WINDOW]);
  hapi_exchange_expect(session->exchange, HAPI_CHANNEL_MODEL, model);
  hapi_exchange_expect(session->exchange, HAPI_CHANNEL_PATCHES, patches);
  hapi_tape_load(&player->tapes[HAPI_STREAM_HAPTIC], cells, count);
  hapi_haptic_cycle(session->haptic, session->played_ns);
  hapi_reader_pop(player->reader, HAPI_STREAM_HAPTIC);
  status = check_after(player, HAPI_STREAM_HAPTIC, detail);
  bool diverged = status == HAP_OK && found_first(player);
  ++player->alike;
  return status == HAP_OK && diverged ? HAP_DIVERGED : status;
}

hap_status hapi_play_advance(hap_session *session, uint64_t ticks)
{
  hap_detail detail = {""};
  hap_status status = HAP_OK;
  for (uint64_t i = 0; i < ticks && status == HAP_OK; ++i) {
    status = play_tick(session->player, &detail);
  }
  return status < HAP_OK ? hapi_session_fail(session, status, "%s", detail.text) : status;
}

int64_t hapi_play_now(const hap_session *session)
{
  return session->played_ns;
}

/* ---- start ---- */

static hap_status load(hap_player *player, hapi_stream stream, hapi_cell_kind kind,
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
    return contradicts(player, "it does not begin with a start", detail);
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
  hap_status status = HAP_OK;
  /* Reading on moves the cells of the other streams: in the second round all are there. */
  for (int round = 0; round < 2 && status == HAP_OK; ++round) {
    status = load(player, HAPI_STREAM_PHYSICS, HAPI_CELL_WORLD, detail);
    status = status == HAP_OK ? load(player, HAPI_STREAM_HAPTIC, HAPI_CELL_BEGIN, detail) : status;
    status = status == HAP_OK
                 ? hapi_reader_glance(player->reader, HAPI_STREAM_CONTACT, &cells, &count, detail)
                 : status; /* a model without contact passes has none */
  }
  if (status != HAP_OK) {
    return status;
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
  if (published(player, HAPI_CHANNEL_PATCHES) > 0) {
    hapi_reader_pop(player->reader, HAPI_STREAM_CONTACT);
  }
  hap_status status = HAP_OK;
  for (int i = 0; i < HAPI_STREAMS && status == HAP_OK; ++i) {
    status = check_after(player, (hapi_stream)i, detail);
  }
  return status;
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
  if (player == NULL || out == NULL || size_of_out < sizeof out->size) {
    return HAP_ERROR_ARGUMENT;
  }
  const hapi_grammar *whole = hapi_reader_whole(player->reader);
  size_t size = size_of_out < sizeof *out ? size_of_out : sizeof *out;
  hap_player_info info = {
      .size = (uint32_t)size,
      .end = hapi_reader_end(player->reader)->end,
      .ticks = whole->ticks,
      .seconds = whole->ticks > 0 ? 1e-9 * (double)(whole->last_ns - whole->first_ns) : 0.0,
      .edits = whole->edits,
      .pointers = whole->pointers,
      .note = hapi_reader_note(player->reader),
      .note_size = hapi_reader_info(player->reader)->note_size,
  };
  snprintf(info.system, sizeof info.system, "%s", hapi_reader_info(player->reader)->build.system);
  memcpy(out, &info, size);
  return HAP_OK;
}

/* What the recorded session was, over what is there. */
static void fill_defs(const hapi_file_info *info, hap_session_def *def, hap_expert_def *expert,
                      hap_research_def *research)
{
  def->drive = HAP_DRIVE_LOCKSTEP;
  def->model = (hap_model)info->model;
  def->physics_hz = info->physics_hz;
  def->haptic_hz = info->haptic_hz;
  def->max_bodies = info->max_bodies;
  def->max_contacts = info->max_contacts;
  def->max_pointers = info->max_pointers;
  def->accuracy = info->accuracy;
  expert->contact_hz = info->contact_hz;
  expert->max_sweeps = info->max_sweeps;
  expert->range_hops = info->range_hops_1 - 1;
  expert->max_edge_probes = info->max_edge_probes;
  expert->iterations = info->iterations;
  expert->reuse = info->reuse;
  expert->max_hull_points = info->max_hull_points;
  hapi_session_unpack_effects(info->effects, expert);
  research->probe = (hap_probe)info->probe;
  research->impulse_pose = (hap_impulse_pose)info->impulse_pose;
  research->physics_latency_ticks = HAP_LATENCY_DEFAULT;
  research->guard = (hap_guard)info->guard;
}

hap_status hap_player_get_def(const hap_player *player, hap_session_def *def,
                              hap_expert_def *expert, hap_research_def *research)
{
  hap_session_def d;
  hap_expert_def e;
  hap_research_def r;
  hap_session_def_init(&d, sizeof d);
  hap_expert_def_init(&e, sizeof e);
  hap_research_def_init(&r, sizeof r);
  if (player == NULL ||
      hapi_def_read(&d, sizeof d, def, HAPI_SESSION_COOKIE, "hap_session_def_init", NULL) <
          HAP_OK ||
      hapi_def_read(&e, sizeof e, expert, HAPI_EXPERT_COOKIE, "hap_expert_def_init", NULL) <
          HAP_OK ||
      hapi_def_read(&r, sizeof r, research, HAPI_RESEARCH_COOKIE, "hap_research_def_init", NULL) <
          HAP_OK) {
    return HAP_ERROR_ARGUMENT;
  }
  fill_defs(hapi_reader_info(player->reader), &d, &e, &r);
  d.expert = expert;
  d.research = research;
  hapi_def_write(def, &d, sizeof d);
  hapi_def_write(expert, &e, sizeof e);
  hapi_def_write(research, &r, sizeof r);
  return HAP_OK;
}

/* Whether the session is what was recorded. Copies are compared, down to the bytes between members. */
static bool has_recorded_defs(const hap_session *session, const hap_player *player)
{
  hap_session_def def = session->def;
  hap_expert_def expert = session->expert;
  hap_research_def research = session->research;
  const void *const here[] = {&session->def, &session->expert, &session->research};
  const void *const there[] = {&def, &expert, &research};
  const size_t sizes[] = {sizeof def, sizeof expert, sizeof research};
  bool same = true;
  fill_defs(hapi_reader_info(player->reader), &def, &expert, &research);
  for (int i = 0; i < 3; ++i) {
    same = same && memcmp(here[i], there[i], sizes[i]) == 0;
  }
  return same;
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
  hap_status status = check_session(session, player, detail);
  if (status >= HAP_OK && hapi_exchange_play(session->exchange) < HAP_OK) {
    status = hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for a replay");
  }
  if (status >= HAP_OK) {
    session->player = player;
    player->session = session;
  }
  return status;
}

hap_status hap_player_difference(const hap_player *player, hap_play_difference *out,
                                 size_t size_of_out)
{
  if (player == NULL || out == NULL || size_of_out < sizeof out->size) {
    return HAP_ERROR_ARGUMENT;
  }
  size_t size = size_of_out < sizeof *out ? size_of_out : sizeof *out;
  hap_play_difference d = player->difference;
  hapi_file_info here;
  memset(&here, 0, sizeof here);
  hapi_file_describe(&here);
  d.other_system = strcmp(hapi_reader_info(player->reader)->build.system, here.build.system) != 0;
  d.size = (uint32_t)size;
  memcpy(out, &d, size);
  return HAP_OK;
}
