/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <assert.h>
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <hapode/record.h>

#include "base/log.h"
#include "base/wishes.h"
#include "record/recorder.h"
#include "session/session_internal.h"

#define BYTES_MIN 65536u
#define CELLS_OF_OTHERS 8192u /* rings of physics and contact thread: some seconds */
#define CELLS_OF_VERDICTS 65536u
#define CELLS_MIN 4096.0

static const hap_record_def record_defaults = {
    .cookie = 0x48524331u,
    .max_bytes = (uint64_t)1 << 30,
    .buffer_s = 1.0,
};
static const hapi_def_type record_type = HAPI_DEF_TYPE(hap_record_def, record_defaults);

void hap_record_def_init(hap_record_def *def, size_t size_of_def)
{
  hapi_def_init(&record_type, def, size_of_def);
}

static hap_status def_check(const hap_record_def *d, hap_detail *detail)
{
  const hapi_number_rule rule = HAPI_RULE(d, buffer_s, 0.01, 10.0);
  if (d->path == NULL || d->path[0] == '\0') {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "path is %s", d->path == NULL ? "NULL" : "empty");
  }
  if (d->max_bytes < BYTES_MIN) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "max_bytes is %llu, below %u",
                     (unsigned long long)d->max_bytes, BYTES_MIN);
  }
  if (d->note_size > HAP_RECORD_NOTE_MAX || (d->note_size > 0 && d->note == NULL)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "note is NULL or of more than %d bytes",
                     HAP_RECORD_NOTE_MAX);
  }
  return hapi_numbers_check(&rule, 1, detail);
}

static hap_status session_check(const hap_session *session, hap_detail *detail)
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

/* ---- the defs in the file ---- */

enum {
  OF_SESSION,
  OF_EXPERT,
  OF_RESEARCH
};

/* A member that the file has in the same form. */
typedef struct file_member {
  int def;
  size_t in_def;
  size_t in_file;
  size_t size;
} file_member;

#define SESSION(member) MEMBER(OF_SESSION, hap_session_def, member)
#define EXPERT(member) MEMBER(OF_EXPERT, hap_expert_def, member)
#define RESEARCH(member) MEMBER(OF_RESEARCH, hap_research_def, member)
#define MEMBER(of, def, member)                                  \
  {                                                              \
    of, offsetof(def, member), offsetof(hapi_file_info, member), \
        sizeof(((hapi_file_info *)0)->member)                    \
  }

static const file_member file_members[] = {
    SESSION(model),        SESSION(physics_hz),   SESSION(haptic_hz), SESSION(max_bodies),
    SESSION(max_contacts), SESSION(max_pointers), SESSION(accuracy),  EXPERT(contact_hz),
    EXPERT(max_sweeps),    EXPERT(iterations),    EXPERT(reuse),      EXPERT(max_hull_points),
    EXPERT(look_ahead),    RESEARCH(probe),       RESEARCH(guard),    RESEARCH(impulse_pose),
};

static_assert(sizeof(hap_model) == sizeof(int32_t), "enums are in the file as they are");

void hapi_session_move_defs(hapi_file_info *info, hap_session_def *def, hap_expert_def *expert,
                            hap_research_def *research, bool to_file)
{
  char *const defs[] = {(char *)def, (char *)expert, (char *)research};
  for (size_t i = 0; i < sizeof file_members / sizeof file_members[0]; ++i) {
    const file_member *m = &file_members[i];
    char *in_def = defs[m->def] + m->in_def;
    char *in_file = (char *)info + m->in_file;
    memcpy(to_file ? in_file : in_def, to_file ? in_def : in_file, m->size);
  }
  if (to_file) {
    info->drive = (int32_t)def->drive;
    info->range_hops_1 = expert->range_hops + 1;
    info->more_substeps = expert->substeps - 1;
    info->effects = hapi_session_pack_effects(expert);
  } else {
    def->drive = HAP_DRIVE_LOCKSTEP;
    expert->range_hops = info->range_hops_1 - 1;
    expert->substeps = info->more_substeps + 1;
    hapi_session_unpack_effects(info->effects, expert);
    research->physics_latency_ticks = HAP_LATENCY_DEFAULT;
  }
}

/* ---- begin and end ---- */

hap_status hap_session_record(hap_session *session, const hap_record_def *def, hap_detail *detail)
{
  hap_record_def d;
  if (session == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "session is NULL");
  }
  HAPI_TRY(hapi_def_read(&record_type, def, &d, detail));
  HAPI_TRY(def_check(&d, detail));
  HAPI_TRY(session_check(session, detail));
  hapi_recorder_config config;
  memset(&config, 0, sizeof config);
  config.path = d.path;
  config.max_bytes = d.max_bytes;
  /* Of a tick of which nothing but the usual is recorded: what each pointer read and wrote. */
  double tick = 1.0 + 4.0 * session->def.max_pointers + HAPI_CELL_BODIES;
  double cells = d.buffer_s * session->def.haptic_hz * tick;
  config.cells[HAPI_STREAM_HAPTIC] = (uint32_t)(cells > CELLS_MIN ? cells : CELLS_MIN);
  uint32_t others = hapi_physics_asks(session->physics) ? CELLS_OF_VERDICTS : CELLS_OF_OTHERS;
  config.cells[HAPI_STREAM_PHYSICS] = others;
  config.cells[HAPI_STREAM_CONTACT] = others;
  hapi_session_move_defs(&config.info, &session->def, &session->expert, &session->research, true);
  hapi_file_describe(&config.info);
  snprintf(config.info.build.ode, sizeof config.info.build.ode, "%s",
           hapi_physics_ode_configuration());
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
    return hapi_fail(detail, HAP_ERROR_SYSTEM, "the recording's thread could not be started: %s",
                     strerror(errno));
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
  hap_record_state state = {
      .end = (uint32_t)now.end, .ticks = now.ticks, .bytes = now.bytes, .lost_ticks = now.lost};
  HAPI_TRY(hapi_struct_give(&state, sizeof state, out, size_of_out));
  if (now.end == HAPI_RECORD_FAILED) {
    return hapi_fail(detail, HAP_ERROR_IO, "the recording cannot be written: %s",
                     strerror(now.error));
  }
  return now.end == HAPI_RECORD_LIMIT || now.end == HAPI_RECORD_OVERFLOW ? HAP_RECORD_ENDED
                                                                         : HAP_OK;
}
