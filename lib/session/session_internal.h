/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SESSION_SESSION_INTERNAL_H
#define HAPODE_SESSION_SESSION_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include <hapode/expert.h>
#include <hapode/record.h>
#include <hapode/research.h>
#include <hapode/session.h>

#include "base/def.h"
#include "base/thread.h"
#include "contact/contact.h"
#include "haptic/haptic.h"
#include "physics/physics.h"
#include "record/recorder.h"
#include "remote/loop_end.h"
#include "remote/world_end.h"
#include "sync/exchange.h"
#include "sync/texture.h"

#define HAPI_POINTER_COOKIE 0x48505431u /* recordings have it */

/* Who wants to know when a session is freed; NULL: nobody. */
typedef struct hapi_session_gone {
  void (*tell)(void *arg);
  void *arg;
} hapi_session_gone;

typedef struct hapi_remote hapi_remote;

/* Carries the messages between physics and the loop where each has an exchange of its own. Those of
 * cycles are called by whoever runs the cycle, those of ticks in drive LOCKSTEP alone. */
typedef enum hapi_side {
  HAPI_SIDE_BOTH,
  HAPI_SIDE_WORLD, /* the session has no loop: physics alone runs */
  HAPI_SIDE_LOOP   /* the session has no world: loop and contact thread alone run */
} hapi_side;

typedef struct hapi_ferry {
  hapi_side side;
  hapi_exchange *exchange; /* of physics; NULL: it has the loop's, and nothing is carried */
  void *of;
  void (*before_cycle)(void *of, int64_t now_ns); /* the loop's newest state to physics */
  void (*after_cycle)(void *of, int64_t now_ns);  /* model and near away from physics */
  void (*before_tick)(void *of, int64_t now_ns);  /* model and near to the loop */
  void (*after_tick)(void *of, int64_t now_ns);   /* the state away from the loop */
  struct hapi_far *far; /* the ends that are the ferry; NULL: something else is */
  hapi_limits limits;   /* of all pointers, for a world far away; also without a ferry */
  hapi_remote *own;     /* what serve or connect have made; else NULL */
  /* When the session begins, after its world. The caller holds the lock. NULL: nothing is due. */
  hap_status (*begin)(hap_session *session, int64_t start_ns);
  /* A thread of its own, in drives with threads; stop is idempotent. NULL: it needs none. */
  hap_status (*start)(hap_session *session);
  void (*stop)(hap_session *session);
  void (*free)(hap_session *session); /* own */
  bool has_loop;                      /* of a world's side: beside the loops far away */
} hapi_ferry;

/* For tests and the bench: after run_ticks, stop_ticks are left out; 0: none. */
typedef struct hapi_pulses {
  uint32_t run_ticks;
  uint32_t stop_ticks;
} hapi_pulses;

struct hap_session {
  hap_session_def def; /* its expert and research are the next two */
  hap_expert_def expert;
  hap_research_def research;
  hapi_exchange *exchange; /* of the loop, and of physics where there is no other */
  hapi_ferry ferry;
  hapi_haptic *haptic;
  hapi_textures *textures;
  hapi_physics *physics;
  hapi_contact *contact;
  bool started;
  bool memory_locked;

  /* LOCKSTEP: physics step number step, counted from tick base, is due at
   * base + floor(step x ticks a step). */
  _Atomic uint64_t tick;
  uint64_t base;
  uint64_t step;
  uint64_t pass_tick; /* of the next one of the contact thread's part */

  hapi_pulses pulses; /* LOCKSTEP */

  double frame_remainder_s; /* FRAME */
  pthread_t starter;        /* thread of the last start */

  bool ran;                /* was started at least once */
  hapi_recorder *recorder; /* NULL: not recorded */
  hap_player *player;      /* borrowed, until stop; NULL: no replay */
  int64_t played_ns;       /* of a replay: of its newest tick */

  hapi_session_gone gone;

  pthread_mutex_t detail_lock;
  hap_detail detail;
};

/* Notes the text of an error on the session and gives back status. */
hap_status hapi_session_fail(const hap_session *session, hap_status status, const char *format, ...)
    HAP_PRINTF(3, 4);
/* The same with the detail of a failed check, or of what was cut; nothing where the status is
 * none. */
hap_status hapi_session_note(const hap_session *session, hap_status status,
                             const hap_detail *detail);
/* The birth of a body, a dBodyID. HAP_ERROR_NOT_FOUND: the session does not know it. */
hap_status hapi_session_find_body(hap_session *session, void *body, uint64_t *out_birth,
                                  hap_detail *detail);
/* The text of an error that has none of its own: else it would be that of an older one. call: the
 * function's name. Where session is NULL, and for what is no error, nothing. */
hap_status hapi_session_say(const hap_session *session, hap_status status, const char *call);
/* HAP_ERROR_ARGUMENT: NULL. HAP_ERROR_STATE: it plays a recording, and what happened is in it. */
hap_status hapi_session_may_change(const hap_session *session);
/* Likewise, and HAP_ERROR_UNSUPPORTED: it has no world that it could be said to. */
hap_status hapi_session_may_steer(const hap_session *session);
/* What create has made; stopped before. */
void hapi_session_free(hap_session *session);

/* session_far.c: physics and the loop do not share memory from the next start on: the ferry brings
 * what one tells the other. HAP_ERROR_STATE: started already. HAP_ERROR_UNSUPPORTED: another drive
 * than LOCKSTEP, another model than CONTACT, looking back, which reads the loop's path, or an
 * application that is asked about contacts. */
hap_status hapi_session_set_ferry(hap_session *session, const hapi_ferry *ferry);

/* A session's part of a world and a loop that are far from each other: of one side, or of both for
 * tests. The caller fills in links and codecs. */
typedef struct hapi_far {
  hapi_world_end world;
  hapi_loop_end loop;
  bool lockstep;
  pthread_mutex_t lock; /* between the end's thread and those who ask how it goes */
  /* Of a loop's end in drive THREADS. */
  hapi_thread thread;
  _Atomic int stop;
} hapi_far;

/* The ends of that side as the session's ferry. *far outlives the session; finish comes after it.
 * Errors as above, and HAP_ERROR_MEMORY. */
hap_status hapi_session_set_far(hap_session *session, hapi_side side, hapi_far *far);
void hapi_far_finish(hapi_far *far); /* begun before */
/* What a pointer can do to a world. */
hapi_limits hapi_session_limits_of(const hapi_pointer_setup *setup);
/* [any] The pointers together can do so much more, in force that may be less than 0; a world far
 * away is told. */
void hapi_session_allow(hap_session *session, const hapi_limits *more);

/* session_record.c; begin does nothing where there is no recorder, stop where there is no player
 * either */
hap_status hapi_record_begin(hap_session *session, hap_detail *detail);
void hapi_record_stop(hap_session *session);
/* What the recorded session is, between its defs and the file. From the file: over what is there.
 * */
void hapi_session_move_defs(hapi_file_info *info, hap_session_def *def, hap_expert_def *expert,
                            hap_research_def *research, bool to_file);
void hapi_session_set_tapes(hap_session *session, hapi_tape *const tapes[HAPI_STREAMS]);

/* session_play.c, of a session with a player: around what begins a session, and instead of its
 * drive */
hap_status hapi_play_begin(hap_session *session, int64_t *out_start_ns, hap_detail *detail);
hap_status hapi_play_begun(hap_session *session, int64_t start_ns, hap_detail *detail);
hap_status hapi_play_advance(hap_session *session, uint64_t ticks);

/* session_pointer.c; detail may be NULL */
/* The structs of the API in one, checked. */
/* The text for a status without one. */
hap_status hapi_session_say_why_not(const hap_session *session, hap_pointer_id pointer,
                                    hap_status status);
hap_status hapi_session_read_pointer(const hap_pointer_def *given, hapi_pointer_setup *out,
                                     hap_detail *detail);
hap_status hapi_session_check_pointer(const hapi_pointer_setup *def, hap_detail *detail);
/* Whether the session's model has the coupling. */
hap_status hapi_session_check_coupling(const hap_session *session, const hapi_pointer_setup *setup,
                                       hap_detail *detail);
/* What is set while a pointer runs: a fault in any field, also in those that are not set. */
hap_status hapi_session_check_setting(const hapi_pointer_setting *setting, hap_detail *detail);
hap_status hapi_session_check_hull(const hapi_pointer_setup *def, hap_detail *detail);

/* session_accuracy.c: what turns the dial */
hap_status hapi_session_check_dial(const hap_session_def *def, hap_detail *detail);
double hapi_session_share(const hap_session_def *def, double own); /* own, or the budget */

/* session_effects.c: the wishes, and as one word (base/wishes.h) */
hap_status hapi_session_check_effects(const hap_session_def *def, hap_detail *detail);
uint32_t hapi_session_pack_effects(const hap_expert_def *expert);
void hapi_session_unpack_effects(uint32_t packed, hap_expert_def *io);

/* defs.c */
extern const hapi_def_type hapi_session_def_type;
extern const hapi_def_type hapi_expert_def_type;
extern const hapi_def_type hapi_research_def_type;
extern const hapi_def_type hapi_pointer_def_type;
extern const hapi_def_type hapi_pointer_expert_def_type;
extern const hapi_def_type hapi_pointer_research_def_type;
extern const hapi_def_type hapi_pointer_settings_type;
/* Fills in def, expert and research of *out, and checks them. given NULL: defaults. def.expert and
 * def.research are never NULL then. */
hap_status hapi_session_read_def(const hap_session_def *given, hap_session *out,
                                 hap_detail *detail);

#define HAPI_RATE_FALL 4.0 /* how far below its rate at create physics may go while it runs */

#endif
