/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include <hapode/record.h>

#include "base/log.h"
#include "base/wishes.h"
#include "record/recorder.h"
#include "session/session_internal.h"

#define BYTES_MIN 65536u
#define CELLS_OF_OTHERS 8192u /* rings of physics and contact thread: some seconds */
#define CELLS_MIN 4096.0

void hap_record_def_init(hap_record_def *def, size_t size_of_def)
{
  hap_record_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_RECORD_COOKIE;
  d.max_bytes = (uint64_t)1 << 30;
  d.buffer_s = 1.0;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

static hap_status check_def(const hap_record_def *d, hap_detail *detail)
{
  if (d->path == NULL || d->path[0] == '\0') {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "path is %s", d->path == NULL ? "NULL" : "empty");
  }
  if (d->max_bytes < BYTES_MIN) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "max_bytes is %llu, below %u",
                     (unsigned long long)d->max_bytes, BYTES_MIN);
  }
  if (!(d->buffer_s >= 0.01 && d->buffer_s <= 10.0)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "buffer_s is %g, not in 0.01 .. 10", d->buffer_s);
  }
  if (d->note_size > HAP_RECORD_NOTE_MAX || (d->note_size > 0 && d->note == NULL)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "note is NULL or of more than %d bytes",
                     HAP_RECORD_NOTE_MAX);
  }
  return HAP_OK;
}

static hap_status check_session(const hap_session *session, hap_detail *detail)
{
  if (session->recorder != NULL || session->player != NULL) {
    return hapi_fail(detail, HAP_ERROR_STATE, "the session is recorded or plays already");
  }
  if (session->ran) {
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "the session has been started before: what it remembers of that is not in a "
                     "recording; create a new one");
  }
  if (hapi_wish_is_off(hapi_physics_wanted_effects(session->physics), HAP_EFFECT_RECORDING)) {
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "the effect recording is off: set it to auto by hap_session_set_effect first");
  }
  if (session->def.drive == HAP_DRIVE_LOCKSTEP) {
    return hapi_fail(detail, HAP_ERROR_STATE,
                     "a lockstep session is not recorded: it does the same on every run by itself");
  }
  return HAP_OK;
}

static void describe(const hap_session_def *def, hapi_file_info *out)
{
  hapi_file_describe(out);
  snprintf(out->build.ode, sizeof out->build.ode, "%s", hapi_physics_ode_configuration());
  out->physics_hz = def->physics_hz;
  out->contact_hz = def->expert->contact_hz;
  out->haptic_hz = def->haptic_hz;
  out->drive = (int32_t)def->drive;
  out->model = (int32_t)def->model;
  out->max_bodies = def->max_bodies;
  out->max_contacts = def->max_contacts;
  out->max_pointers = def->max_pointers;
  out->impulse_pose = (int32_t)def->research->impulse_pose;
  out->probe = (int32_t)def->research->probe;
  out->max_edge_probes = def->expert->max_edge_probes;
  out->max_hull_points = def->expert->max_hull_points;
  out->guard = (int32_t)def->research->guard;
  out->max_sweeps = def->expert->max_sweeps;
  out->range_hops_1 = def->expert->range_hops + 1;
  out->reuse = def->expert->reuse;
  out->effects = hapi_session_pack_effects(def->expert);
  out->iterations = def->expert->iterations;
  out->accuracy = def->accuracy;
}

/* A tick of which nothing but the usual is recorded: of each pointer what was read and written. */
static uint32_t cells_of_loop(const hap_session_def *def, double buffer_s)
{
  double tick = 1.0 + 4.0 * def->max_pointers + HAPI_CELL_BODIES;
  double cells = buffer_s * def->haptic_hz * tick;
  return (uint32_t)(cells > CELLS_MIN ? cells : CELLS_MIN);
}

hap_status hap_session_record(hap_session *session, const hap_record_def *def, hap_detail *detail)
{
  hap_record_def d;
  if (session == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "session is NULL");
  }
  hap_record_def_init(&d, sizeof d);
  hap_status status =
      hapi_def_read(&d, sizeof d, def, HAPI_RECORD_COOKIE, "hap_record_def_init", detail);
  if (status >= HAP_OK) {
    status = check_def(&d, detail);
  }
  if (status >= HAP_OK) {
    status = check_session(session, detail);
  }
  if (status < HAP_OK) {
    return status;
  }
  hapi_recorder_config config;
  memset(&config, 0, sizeof config);
  config.path = d.path;
  config.max_bytes = d.max_bytes;
  config.cells[HAPI_STREAM_HAPTIC] = cells_of_loop(&session->def, d.buffer_s);
  config.cells[HAPI_STREAM_PHYSICS] = CELLS_OF_OTHERS;
  config.cells[HAPI_STREAM_CONTACT] = CELLS_OF_OTHERS;
  describe(&session->def, &config.info);
  config.info.note_size = (uint32_t)d.note_size;
  config.note = d.note;
  return hapi_recorder_create(&config, &session->recorder, detail);
}

void hapi_session_set_tapes(hap_session *session, hapi_tape *const tapes[HAPI_STREAMS])
{
  hapi_haptic_set_tape(session->haptic, tapes[HAPI_STREAM_HAPTIC]);
  hapi_physics_set_tape(session->physics, tapes[HAPI_STREAM_PHYSICS]);
  hapi_contact_set_tape(session->contact, tapes[HAPI_STREAM_CONTACT]);
}

hap_status hapi_record_begin(hap_session *session, hap_detail *detail)
{
  hapi_tape *tapes[HAPI_STREAMS];
  if (session->recorder == NULL || session->ran) {
    return HAP_OK;
  }
  for (int i = 0; i < HAPI_STREAMS; ++i) {
    tapes[i] = hapi_recorder_tape(session->recorder, (hapi_stream)i);
  }
  if (hapi_recorder_start(session->recorder) < HAP_OK) {
    return hapi_fail(detail, HAP_ERROR_SYSTEM, "the thread of the recording could not be started");
  }
  hapi_session_set_tapes(session, tapes);
  return HAP_OK;
}

void hapi_record_stop(hap_session *session)
{
  hapi_tape *const none[HAPI_STREAMS] = {NULL, NULL, NULL};
  hapi_session_set_tapes(session, none); /* a player may be gone before its session */
  if (session->recorder != NULL) {
    hapi_recorder_stop(session->recorder);
  }
}

hap_status hap_session_record_state(const hap_session *session, hap_record_state *out,
                                    size_t size_of_out, hap_detail *detail)
{
  if (session == NULL || out == NULL || size_of_out < sizeof out->size) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "session or out is NULL, or its size too small");
  }
  if (session->recorder == NULL) {
    return hapi_fail(detail, HAP_ERROR_STATE, "the session is not recorded");
  }
  hapi_recorder_state now = hapi_recorder_look(session->recorder);
  size_t size = size_of_out < sizeof *out ? size_of_out : sizeof *out;
  hap_record_state state = {.size = (uint32_t)size,
                            .end = (uint32_t)now.end,
                            .ticks = now.ticks,
                            .bytes = now.bytes,
                            .lost_ticks = now.lost};
  memcpy(out, &state, size);
  if (now.end == HAPI_RECORD_FAILED) {
    return hapi_fail(detail, HAP_ERROR_IO, "the recording cannot be written: %s",
                     strerror(now.error));
  }
  return now.end == HAPI_RECORD_LIMIT || now.end == HAPI_RECORD_OVERFLOW ? HAP_RECORD_ENDED
                                                                         : HAP_OK;
}
