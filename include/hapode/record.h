/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_H
#define HAPODE_RECORD_H

/* Recording and replay of a whole session (docs/recording.md).
 *
 * A recording holds all that enters a session of drive THREADS or FRAME from outside or depends on
 * timing: what the devices said at each tick, which message who took, pointers that come and go,
 * changes of model, faults and resets. A lockstep session that plays it over the same world does
 * the same, bit for bit, and says where it does not.
 *
 * A recording cannot hold what the application does to the world itself: in callbacks, in posted
 * edits, and between hap_session_lock and unlock. It holds that edits and locks happened. A
 * callback that does the same each time replays: surface, or a force that depends on the world
 * alone. No replay is promised while ODE's random numbers are drawn for another world at the
 * same time. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/expert.h>
#include <hapode/research.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* ---- recording ---- */

/* Why a recording has ended. Values are never renumbered. */
typedef enum hap_record_end {
  HAP_RECORD_GOES_ON = 0,  /* or its session has not been started. Of a file: it breaks off */
  HAP_RECORD_STOPPED = 1,  /* with its session */
  HAP_RECORD_LIMIT = 2,    /* max_bytes */
  HAP_RECORD_OVERFLOW = 3, /* the disk was too slow for the buffer: a replay ends at the gap */
  HAP_RECORD_FAILED = 4    /* the file could not be written any more */
} hap_record_end;

/* Bytes of hap_record_def.note. */
#define HAP_RECORD_NOTE_MAX 4096

/* What is recorded where. It has a size and may grow at its end. */
typedef struct hap_record_def {
  uint32_t size;    /* set by hap_record_def_init */
  uint32_t cookie;  /* set by hap_record_def_init */
  const char *path; /* of the file, copied; a regular file that is there is overwritten */
  /* 65536 or more, default 2^30: the file grows no further (HAP_RECORD_LIMIT). A tick of one
   * pointer and ten moving bodies takes about 500 bytes. */
  uint64_t max_bytes;
  double buffer_s;  /* s, 0.01..10, default 1: for so long may the disk keep the writer waiting */
  const void *note; /* the application's own bytes for the file, copied, such as how to build the
                       world; NULL: none */
  size_t note_size; /* at most HAP_RECORD_NOTE_MAX */
} hap_record_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_record_def_init(hap_record_def *def, size_t size_of_def);

/* [control] Records the session from its start to its stop. To be called before its first start.
 * The file is opened and begun now. The tick hands fixed-size pieces to a thread that writes;
 * only stop waits for that thread. ODE's island threads are off while recording.
 * HAP_ERROR_STATE: drive LOCKSTEP, a session that was started or is recorded, or effect
 * RECORDING is off. HAP_ERROR_IO: the file, which must not be a pipe or socket, nor another device
 * than /dev/null. detail may be NULL. */
HAP_NODISCARD HAP_API hap_status hap_session_record(hap_session *session, const hap_record_def *def,
                                                    hap_detail *detail);

/* The state of a recording. It has a size and may grow at its end. */
typedef struct hap_record_state {
  uint32_t size;       /* bytes filled in */
  uint32_t end;        /* hap_record_end */
  uint64_t ticks;      /* in the file */
  uint64_t bytes;      /* in the file */
  uint64_t lost_ticks; /* run since an overflow, and not recorded */
} hap_record_state;

/* [any] The state of the recording. size_of_out: sizeof *out of the caller's build. HAP_OK.
 * HAP_RECORD_ENDED: limit or overflow; the session goes on. HAP_ERROR_IO: the file could not be
 * written, and detail (may be NULL) says why; the session goes on. HAP_ERROR_STATE: there is no
 * recording. */
HAP_API hap_status hap_session_record_state(const hap_session *session, hap_record_state *out,
                                            size_t size_of_out, hap_detail *detail);

/* ---- replay ---- */

/* A recording that is open, and how far its replay has come. */
typedef struct hap_player hap_player;

/* How much of a file hap_player_open takes. Values are never renumbered. */
typedef enum hap_play_extent {
  HAP_PLAY_WHOLE = 0,     /* a file that breaks off is refused */
  HAP_PLAY_INCOMPLETE = 1 /* a file that breaks off is played up to there */
} hap_play_extent;

/* [control] Opens a recording and examines all of it. On failure *out is NULL and detail (may be
 * NULL) says what is wrong and where. HAP_ERROR_IO. HAP_ERROR_FORMAT: damaged, or broken off.
 * HAP_ERROR_UNSUPPORTED: another machine, byte order, version of file or library. */
HAP_NODISCARD HAP_API hap_status hap_player_open(const char *path, hap_play_extent extent,
                                                 hap_player **out, hap_detail *detail);

/* [control] After its session was stopped. NULL is allowed. */
HAP_API void hap_player_close(hap_player *player);

/* What a recording is. It has a size and may grow at its end. */
typedef struct hap_player_info {
  uint32_t size;     /* bytes filled in */
  uint32_t end;      /* hap_record_end of the file */
  uint64_t ticks;    /* in the file */
  double seconds;    /* from the first to the last tick */
  uint64_t edits;    /* posted edits and locks, none of which is in the file */
  char system[64];   /* C library of the recording: with another one the last digits may differ */
  const void *note;  /* of hap_record_def; the player's */
  size_t note_size;  /* of note */
  uint32_t pointers; /* places that pointers had */
} hap_player_info;

/* [control] size_of_out: sizeof *out of the caller's build. */
HAP_API hap_status hap_player_get_info(const hap_player *player, hap_player_info *out,
                                       size_t size_of_out);

/* [control] Fills the three initialised structs with what the recorded session was, in drive
 * LOCKSTEP, and sets def->expert and def->research to the other two. What does not matter to a
 * replay (trace_rows, rt_priority) stays. HAP_ERROR_ARGUMENT: one of them is NULL or not
 * initialised. */
HAP_API hap_status hap_player_get_def(const hap_player *player, hap_session_def *def,
                                      hap_expert_def *expert, hap_research_def *research);

/* [control] The session is to play the recording, before its first start, once. It is made with the
 * def of hap_player_get_def, over a world that is built as the recorded one was. The player must
 * outlive the session's stop.
 *
 * hap_session_start then checks that the world is the same (HAP_ERROR_WORLD), and
 * hap_session_advance runs recorded ticks. It gives HAP_DIVERGED after the tick in which something
 * differs for the first time, and stops there; called again it goes on. HAP_END: the recording is
 * over, and fewer ticks were run. An error: the file has changed, or contradicts itself.
 *
 * Pointers come from the recording. hap_pointer_add, hap_pointer_remove, hap_pointer_restart,
 * hap_pointer_set_target, hap_session_set_model and hap_session_reset_fault are HAP_ERROR_STATE. */
HAP_NODISCARD HAP_API hap_status hap_session_play(hap_session *session, hap_player *player,
                                                  hap_detail *detail);

/* What a replay differs in. Values are never renumbered. */
typedef enum hap_difference {
  HAP_DIFFERENCE_NONE = 0,    /* the replay is the recording, so far */
  HAP_DIFFERENCE_STEP = 1,    /* what a physics step gave to the loop; number: of the model */
  HAP_DIFFERENCE_PASS = 2,    /* contacts between bodies; number: of the pass */
  HAP_DIFFERENCE_POINTER = 3, /* number: hap_pointer_id.v */
  HAP_DIFFERENCE_BODY = 4,    /* number: its place in the loop */
  HAP_DIFFERENCE_TICK = 5 /* in something of the tick that the file has no values of: a velocity */
} hap_difference;

/* Where a replay differs from the recording. It has a size and may grow at its end. */
typedef struct hap_play_difference {
  uint32_t size;   /* bytes filled in */
  uint32_t what;   /* hap_difference: the first thing that differed */
  uint64_t number; /* of what */
  uint64_t tick;   /* count of ticks that were alike */
  double t;        /* s since start, of the tick that differs */
  /* hap_difference, POINTER or BODY: where it showed first as a value. 0: nowhere yet, and the
   * fields below are not filled in. */
  uint32_t shown;
  uint32_t traced;       /* BODY: place among hap_session_trace_bodies; UINT32_MAX: none of them */
  uint64_t shown_number; /* of what showed it */
  uint64_t shown_tick;   /* count of ticks before it showed */
  double recorded[7];    /* POINTER: force and torque at the device; BODY: position, quaternion */
  double replayed[7];    /* the same of the replay */
  double distance;       /* POINTER: N, of the forces; BODY: m, of the positions */
  char text[256];        /* all of it in words */
  uint32_t other_system; /* 1: the C library is not that of the recording (hap_player_info) */
} hap_play_difference;

/* [control] The first difference; what is HAP_DIFFERENCE_NONE while there is none. size_of_out:
 * sizeof *out of the caller's build. */
HAP_API hap_status hap_player_difference(const hap_player *player, hap_play_difference *out,
                                         size_t size_of_out);

HAP_END_DECLS

#endif
