/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RECORD_H
#define HAPODE_RECORD_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/expert.h>
#include <hapode/pointer.h>
#include <hapode/research.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Pointers and bodies of a trace row; what is beyond is not traced. */
#define HAP_TRACE_POINTERS_MAX 16
#define HAP_TRACE_BODIES_MAX 16

typedef struct hap_trace_pointer {
  double position[3]; /* m, world */
  double force[3];    /* N, on the hand, world, after the guard */
  double torque[3];   /* N m, about the pointer */
} hap_trace_pointer;

/* One tick. */
typedef struct hap_trace_row {
  uint64_t tick;          /* number, from the first of the session */
  double t;               /* s since start */
  double tick_us;         /* us, computing time of the previous tick (this one is not over) */
  double model_age_s;     /* s */
  uint32_t bodies;        /* local bodies */
  uint32_t contacts;      /* contacts that push */
  uint32_t pointer_count; /* places in use: up to the last pointer there is */
  uint32_t body_count;    /* traced bodies, see hap_session_trace_bodies in ode.h */
  hap_trace_pointer pointers[HAP_TRACE_POINTERS_MAX];
  double body_position[HAP_TRACE_BODIES_MAX][3]; /* m: the loop's where the body is local,
                                                    otherwise of the newest physics step */
} hap_trace_row;

/* [app, one reader] Takes up to capacity rows, oldest first. When the reader is too slow new rows
 * are dropped and counted in the statistics. */
HAP_API hap_status hap_session_trace_read(hap_session *session, hap_trace_row *rows,
                                          size_t capacity, size_t *out_count);

/* Ticks that the black box holds. */
#define HAP_BLACK_BOX_TICKS 256

/* One tick of one pointer. Device's frame. */
typedef struct hap_black_box_row {
  uint64_t tick;   /* number, from the first of the session */
  int64_t time_ns; /* of the session */
  hap_pointer_id pointer;
  uint32_t fault;     /* hap_fault latched at the end of the tick */
  uint32_t guard;     /* hap_guard_flag bits */
  hap_pose pose;      /* as the device gave it: not finite, where that was the fault */
  hap_twist twist;    /* the same */
  hap_wrench wanted;  /* what the simulation asked for; may be not finite */
  hap_wrench written; /* what the device was given */
  double model_age_s; /* s, now - time for which the local model was built */
} hap_black_box_row;

/* [app] The last ticks before the latched fault and the first one with it: up to
 * HAP_BLACK_BOX_TICKS ticks, oldest first, of each tick one row for each pointer; the newest capacity
 * rows where that is less. Kept until the fault is reset, filled anew from then on. HAP_END and 0 rows
 * while no fault is latched. */
HAP_API hap_status hap_session_black_box(hap_session *session, hap_black_box_row *rows,
                                         size_t capacity, size_t *out_count);

/* ---- recording and replay of a whole session (docs/recording.md) ---- */

/* A recording holds all that enters a session of drive THREADS or FRAME from outside or depends on
 * timing: what the devices said at each tick, who took which message of whom, pointers that come and
 * go, changes of model, faults and resets. A lockstep session that plays it over the same world
 * does the same, bit for bit, and says where it does not.
 *
 * What the application does to the world itself cannot be recorded: what callbacks, posted edits and
 * code between hap_session_lock and unlock do. That edits and locks happened is. A callback that does
 * the same each time (surface, or a force that depends on the world alone) replays. While ODE's random numbers are drawn for another world at the same time, no
 * replay is promised. */

/* Why a recording has ended. Values are fixed. */
typedef enum hap_record_end {
  HAP_RECORD_GOES_ON = 0,  /* or its session has not been started. Of a file: it breaks off */
  HAP_RECORD_STOPPED = 1,  /* with its session */
  HAP_RECORD_LIMIT = 2,    /* max_bytes */
  HAP_RECORD_OVERFLOW = 3, /* the disk was too slow for the buffer: a replay ends at the gap */
  HAP_RECORD_FAILED = 4    /* the file could not be written any more */
} hap_record_end;

/* Bytes of hap_record_def.note. */
#define HAP_RECORD_NOTE_MAX 4096

/* What is recorded where; see hap_record_def_init. */
typedef struct hap_record_def {
  uint32_t size;      /* set by hap_record_def_init */
  uint32_t cookie;    /* set by hap_record_def_init */
  const char *path;   /* of the file; one that is there is overwritten */
  uint64_t max_bytes; /* 65536 or more, default 2^30: the file grows no further, see
                         HAP_RECORD_LIMIT. A tick of one pointer and ten moving bodies takes about
                         500 bytes */
  double buffer_s;    /* s, 0.01..10, default 1: for so long may the disk keep the writer waiting */
  const void *note;   /* the application's own words for the file, such as how to build the world;
                         NULL: none */
  size_t note_size;   /* at most HAP_RECORD_NOTE_MAX */
} hap_record_def;

/* [any] Fills *def with defaults. */
HAP_API void hap_record_def_init(hap_record_def *def, size_t size_of_def);

/* [control] Records the session from its start to its stop. Before its first start, drives THREADS
 * and FRAME (HAP_ERROR_STATE); the file is opened and begun now (HAP_ERROR_IO). The tick hands
 * fixed-size pieces to a thread that writes; that thread is waited for by nobody but stop. ODE's
 * island threads are off while recording. */
HAP_API HAP_NODISCARD hap_status hap_session_record(hap_session *session, const hap_record_def *def,
                                                    hap_detail *detail);

/* How a recording stands. */
typedef struct hap_record_state {
  uint32_t size;       /* bytes filled in */
  uint32_t end;        /* hap_record_end */
  uint64_t ticks;      /* in the file */
  uint64_t bytes;      /* in the file */
  uint64_t lost_ticks; /* run since an overflow, and not recorded */
} hap_record_state;

/* [any] How the recording stands. HAP_OK; HAP_RECORD_ENDED: limit or overflow, the session goes on;
 * HAP_ERROR_IO: the file could not be written, detail (may be NULL) says why, the session goes on;
 * HAP_ERROR_STATE: there is no recording. */
HAP_API hap_status hap_session_record_state(const hap_session *session, hap_record_state *out,
                                            size_t size_of_out, hap_detail *detail);

/* A recording that is open, and how far its replay has come. */
typedef struct hap_player hap_player;

/* How much of a file hap_player_open takes. Values are never renumbered. */
typedef enum hap_play_extent {
  HAP_PLAY_WHOLE = 0,     /* a file that breaks off is refused */
  HAP_PLAY_INCOMPLETE = 1 /* a file that breaks off is played up to there */
} hap_play_extent;

/* [control] Opens a recording and looks at all of it. On failure *out is NULL and detail (may be NULL)
 * says what is wrong and where: HAP_ERROR_IO, HAP_ERROR_FORMAT (damaged, or broken off),
 * HAP_ERROR_UNSUPPORTED (another machine, byte order, version of file or library). */
HAP_API HAP_NODISCARD hap_status hap_player_open(const char *path, hap_play_extent extent,
                                                 hap_player **out, hap_detail *detail);

/* [control] NULL is allowed. After its session was stopped. */
HAP_API void hap_player_close(hap_player *player);

/* What a recording is. */
typedef struct hap_player_info {
  uint32_t size;    /* bytes filled in */
  uint32_t end;     /* hap_record_end of the file */
  uint64_t ticks;   /* in the file */
  double seconds;   /* from the first to the last tick */
  uint64_t edits;   /* posted edits and locks, none of which is in the file */
  char system[64];  /* C library of the recording: of another one the last digits may differ */
  const void *note; /* of hap_record_def; the player's */
  size_t note_size;
  uint32_t pointers; /* places that pointers had */
  uint32_t reserved;
} hap_player_info;

/* [control] */
HAP_API hap_status hap_player_get_info(const hap_player *player, hap_player_info *out,
                                       size_t size_of_out);

/* [control] Fills the three initialised structs with what the recorded session was, in drive
 * LOCKSTEP, and sets def->expert and def->research to the other two. What does not matter to a
 * replay (trace_rows, rt_priority) stays. HAP_ERROR_ARGUMENT: one of them is NULL or not
 * initialised. */
HAP_API hap_status hap_player_get_def(const hap_player *player, hap_session_def *def,
                                      hap_expert_def *expert, hap_research_def *research);

/* [control] The session, made with the player's def over a world that is built as the recorded one
 * was, plays: hap_session_start looks whether the world is the one (HAP_ERROR_WORLD), hap_session_advance
 * runs recorded ticks. Pointers come from the recording; hap_pointer_add, hap_pointer_remove,
 * hap_pointer_restart, hap_pointer_set_target, hap_session_set_model and hap_session_reset_fault are
 * HAP_ERROR_STATE. Before the session's first start, once; the player outlives the
 * session's stop.
 *
 * hap_session_advance then gives HAP_DIVERGED after the tick in which something is another
 * thing than in the recording for the first time, and stops there; it may be called again and goes on.
 * HAP_END: the recording is over; fewer ticks were run. Errors: the file has changed, or contradicts
 * itself. */
HAP_API HAP_NODISCARD hap_status hap_session_play(hap_session *session, hap_player *player,
                                                  hap_detail *detail);

/* What a replay differs in. Values are fixed. */
typedef enum hap_difference {
  HAP_DIFFERENCE_NONE = 0,    /* the replay is the recording, so far */
  HAP_DIFFERENCE_STEP = 1,    /* what a physics step gave to the loop; number: of the model */
  HAP_DIFFERENCE_PASS = 2,    /* contacts between bodies; number: of the pass */
  HAP_DIFFERENCE_POINTER = 3, /* number: hap_pointer_id.v */
  HAP_DIFFERENCE_BODY = 4,    /* number: its place in the loop */
  HAP_DIFFERENCE_TICK = 5 /* in something of the tick that the file has no values of: a velocity */
} hap_difference;

/* Where a replay is not the recording. */
typedef struct hap_play_difference {
  uint32_t size; /* bytes filled in */
  uint32_t what; /* hap_difference: the first thing that differed */
  uint64_t number;
  uint64_t tick;   /* count of ticks that were alike */
  double t;        /* s since start, of the tick that is not */
  uint32_t shown;  /* hap_difference, POINTER or BODY: where it showed first as a value; 0: nowhere
                       yet, so that what follows is not filled in */
  uint32_t traced; /* BODY: place among hap_session_trace_bodies, UINT32_MAX: none of them */
  uint64_t shown_number;
  uint64_t shown_tick;
  double recorded[7]; /* POINTER: force and torque at the device; BODY: position, quaternion */
  double replayed[7];
  double distance;       /* POINTER: N, of the forces; BODY: m, of the positions */
  char text[256];        /* all of it in words */
  uint32_t other_system; /* 1: the C library is not the one of the recording, see hap_player_info */
  uint32_t reserved;
} hap_play_difference;

/* [control] The first difference; what is HAP_DIFFERENCE_NONE while there is none. */
HAP_API hap_status hap_player_difference(const hap_player *player, hap_play_difference *out,
                                         size_t size_of_out);

HAP_END_DECLS

#endif
