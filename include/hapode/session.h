/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SESSION_H
#define HAPODE_SESSION_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* A session couples one ODE world to the pointers that a hand holds in it. It is created with
 * hap_session_create of ode.h.
 *
 * Threads. [control]: one application thread at a time, the one that also creates and destroys.
 * [app]: any application thread, but not from a callback. [any]: any thread at all. */
typedef struct hap_session hap_session;

/* Who moves time. Values are fixed. */
typedef enum hap_drive {
  HAP_DRIVE_THREADS = 0, /* the library's own physics and haptic threads, real time */
  HAP_DRIVE_FRAME = 1,   /* the application's frame loop calls hap_session_update for physics;
                            the haptic thread is the library's, real time */
  HAP_DRIVE_LOCKSTEP = 2 /* hap_session_advance; virtual clock from 0, one thread, reproducible */
} hap_drive;

/* How near things are simulated (the paper: Susa, Sato, Hasegawa, World Haptics 2011). */
typedef enum hap_model {
  HAP_MODEL_SINGLE = 0,      /* paper's Method 1: the world itself at the haptic rate */
  HAP_MODEL_IMPULSE = 1,     /* paper's Method 3: force on the last known pose */
  HAP_MODEL_ACCELERANCE = 2, /* paper's Method 2: testing simulations, A and b in the loop */
  HAP_MODEL_CONTACT = 3      /* the loop simulates what is near with its own contacts */
} hap_model;

/* Where model IMPULSE shows a body between two physics steps. */
typedef enum hap_impulse_pose {
  HAP_IMPULSE_INTERPOLATED = 0, /* moves from the last but one to the last pose in one step H */
  HAP_IMPULSE_HELD = 1          /* stays at the last pose */
} hap_impulse_pose;

/* How model ACCELERANCE tests. */
typedef enum hap_probe {
  HAP_PROBE_SHARED = 0,    /* one zero probe for all neighbours: 1 + 3N steps */
  HAP_PROBE_PAPER = 1,     /* four steps for each neighbour: 4N steps */
  HAP_PROBE_OPERATING = 2, /* as SHARED, about the operating point: every testing simulation has the
                              forces that the pointers give, and is perturbed by 1 % of the weight */
  HAP_PROBE_BY_ACCURACY = 3 /* SHARED or OPERATING, as hap_session_def.accuracy says */
} hap_probe;

/* Whether the guard shapes the force. Its checks, faults and limits always hold. */
typedef enum hap_guard {
  HAP_GUARD_ON = 0,     /* all of it */
  HAP_GUARD_MEASURE = 1 /* for measurements with simulated hands: no ramp-in, no fading with an old
                           model, no energy observer, no slew limit. A fault takes the force away
                           in one tick. Not for a device that a person holds. */
} hap_guard;

/* For single settings of hap_session_def: as its accuracy says. */
#define HAP_BY_ACCURACY (-2)

/* For hap_session_def.range_hops: as far as max_bodies goes. */
#define HAP_RANGE_ALL (-1)

/* Room in hap_session_def for effects that may come. */
#define HAP_EFFECT_PLACES 32

/* For hap_session_def.physics_latency_ticks. */
#define HAP_LATENCY_DEFAULT (-1)

typedef struct hap_session_def {
  uint32_t size;        /* set by hap_session_def_init */
  uint32_t cookie;      /* set by hap_session_def_init; an unset def is refused */
  hap_drive drive;      /* default HAP_DRIVE_THREADS */
  hap_model model;      /* default HAP_MODEL_CONTACT */
  double physics_hz;    /* Hz, 1..1000 and at most haptic_hz, default 60; unused by model SINGLE */
  double contact_hz;    /* Hz, 20..1000: how often model CONTACT finds the contacts between bodies
                           anew. HAP_BY_ACCURACY (default): 200 at HAP_ACCURACY_DEFAULT */
  double haptic_hz;     /* Hz, 100..20000, default 1000 */
  int32_t max_bodies;   /* bodies that the loop moves itself, 1..1024, default 64; it knows as many
                           again of those around them */
  int32_t max_contacts; /* contact points between bodies, pairs of geoms that are near, and pointer
                           contacts, of each 1..4096, default 1024. Of contact points those nearest to
                           a touch are kept: give at least 12 for each of max_bodies */
  int32_t max_pointers; /* 1..16, default 4 */
  int32_t rt_priority;  /* SCHED_FIFO priority of the haptic thread, 0..99; 0: do not ask for real
                           time. Default 80. Physics runs at half of it. */
  int32_t physics_latency_ticks; /* LOCKSTEP: ticks from the start of a physics step to the tick
                                    that uses its result, at most haptic_hz / physics_hz. HAP_LATENCY_DEFAULT (default):
                                    1 in models CONTACT and ACCELERANCE, one step in model IMPULSE. Model SINGLE
                                    always has 0. */
  int32_t trace_rows; /* rows kept for hap_session_trace_read, 0..1048576, default 0: none */
  hap_impulse_pose impulse_pose; /* default HAP_IMPULSE_INTERPOLATED */
  hap_probe probe;               /* model ACCELERANCE, default HAP_PROBE_BY_ACCURACY: SHARED at
                                    HAP_ACCURACY_DEFAULT */
  uint32_t flags;                /* no bit is defined; an unknown bit is an error */
  int32_t max_edge_probes; /* model CONTACT: bodies at the border of the range that are probed at a
                              physics step (7 steps of their island, of at most 64 bodies), 0..1024;
                              the others answer with their own mass alone until the next step.
                              HAP_BY_ACCURACY (default): 4 at HAP_ACCURACY_DEFAULT */
  int32_t max_hull_points; /* of all convex geoms near the pointers, and 3 for each triangle of a
                              mesh there, 0..1048576, default 4096 */
  hap_guard guard;         /* default HAP_GUARD_ON */
  int32_t
      max_sweeps; /* model CONTACT: sweeps over the rows of contacts and joints in each solve of a
                         tick, 2..10000; direct solves come between them, from the second one on, so that
                         2 means none. 0: until it is solved or the tick's budget is used.
                         Fewer are cheaper; what is not solved is in hap_stats.contact.residual_max.
                         HAP_BY_ACCURACY (default): 0 at HAP_ACCURACY_DEFAULT */
  int32_t
      range_hops; /* model CONTACT: how far the range goes from the neighbours, in contacts, 0..1024:
                         0 is the neighbours alone, 1 what may touch them as well. What hangs together by
                         joints counts as one. What stands beyond answers as max_edge_probes says.
                         HAP_RANGE_ALL: as far as max_bodies goes. HAP_BY_ACCURACY (default): that at
                         HAP_ACCURACY_DEFAULT */
  double
      lookback; /* 0..0.5, default 0: share of the period of physics in which short times of the past
                      are gone over as model SINGLE would have had them, for hap_stats.error.force_error; in
                      LOCKSTEP all of the time is, whatever the share. 0: never */
  uint8_t
      effects[HAP_EFFECT_PLACES]; /* hap_effect_wish by hap_effect (hapode/effects.h), default all
                                         HAP_EFFECT_AUTO; places beyond HAP_EFFECTS are 0. A wish that
                                         the model cannot fulfil is an error */
  double accuracy; /* 0..1, default HAP_ACCURACY_DEFAULT (hapode/accuracy.h): what the settings
                      that are HAP_BY_ACCURACY come to. They change at its
                      tenths (docs/accuracy.md) */
  double
      force_error_wanted; /* 0.001..1, of the force: the dial goes to the least accuracy with which
                                looking back tells no more. 0 (default): it stays at accuracy. Needs
                                lookback above 0 */
  double
      tick_share; /* 0.01..1, share of the haptic period that a tick may take: the dial of the tick
                           is turned back as far as it takes. 0 (default): no budget. Not in drive
                           LOCKSTEP */
  double physics_share; /* 0.01..1, the same of a cycle of physics and its period */
  int32_t
      iterations;    /* of QuickStep in all steps of physics, 1..10000. 0: as many as the world has.
                           HAP_BY_ACCURACY (default): these at HAP_ACCURACY_DEFAULT, else in
                           proportion */
  uint32_t reserved; /* 0 */
  double
      reuse; /* m, 0..0.01: what testing simulations found of an island is used again while its contacts
                   and joints are the same and none of its bodies, measured where it moves most, has moved
                   by more than this since, nor would in a step by how its velocity and the forces on it have
                   changed: A without a step, b with one, and with none where all has stayed within a
                   hundredth of this. 0: measured anew at each step, as with the effect testing on and with
                   HAP_PROBE_PAPER. HAP_BY_ACCURACY (default): 1e-7 at HAP_ACCURACY_DEFAULT */
} hap_session_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_session_def_init(hap_session_def *def, size_t size_of_def);

/* [control] Stops, writes zero force to every device, frees. NULL is allowed. A lock that this
 * thread holds is given up; in a callback nothing happens. The world goes back
 * to the application as it is, with ODE's auto-disable as it was found. Posted edits that still wait are run. */
HAP_API void hap_session_destroy(hap_session *session);

/* [control] THREADS: starts both threads; FRAME: the haptic one; LOCKSTEP: builds the first local
 * model. HAP_NO_REALTIME when real-time rights were asked for and not given (it runs all the
 * same). HAP_ERROR_STATE when already started; HAP_ERROR_WORLD with a detail text. */
HAP_API HAP_NODISCARD hap_status hap_session_start(hap_session *session);

/* [control] Zero force, then threads end. Idempotent. A stopped session can be started again. */
HAP_API hap_status hap_session_stop(hap_session *session);

/* [control] FRAME: runs the whole physics steps that fit into frame_s, the time since the last call
 * [s, 0 .. 86400], plus the remainder of earlier calls, at most 3; the rest is dropped and counted
 * (HAP_DROPPED, hap_stats.physics.frames_dropped). Less time than the clock's is slow motion, none or no call a
 * pause: the world stands, the loop goes on with what is near, and after two steps the force fades, to
 * come back by itself. Model SINGLE needs another drive: its steps are those of the haptic loop.
 * HAP_ERROR_ARGUMENT: frame_s is not such a time. HAP_ERROR_STATE: another drive,
 * or not started. HAP_ERROR_THREAD: another thread than that of start (ODE keeps data for each thread), a
 * callback, or this thread holds the lock. Nothing is done then, and the remainder stays.
 * HAP_FAULTED, HAP_BODY_LOST: see their texts. */
HAP_API hap_status hap_session_update(hap_session *session, double frame_s);

/* [control] LOCKSTEP: runs that many haptic ticks and the physics steps that fall due.
 * HAP_FAULTED, HAP_BODY_LOST: see their texts. */
HAP_API hap_status hap_session_advance(hap_session *session, uint64_t ticks);

/* [app] Between lock and unlock this thread alone may touch the ODE world. Served in order of arrival: it
 * waits for at most one physics step, and for what application threads before it do under the lock. Not
 * recursive. Physics waits while it is held (hap_stats.edits.held_ms_max), the haptic loop does not. Legal
 * before start and after stop. HAP_ERROR_THREAD, with a text, from a callback or a posted edit, where
 * the world may be touched without it, or when this thread has the lock. */
HAP_API HAP_NODISCARD hap_status hap_session_lock(hap_session *session);

/* [app] As lock, but gives up after timeout_ns (0: at once; INT64_MAX: never) with HAP_ERROR_TIMEOUT.
 * Below 0: HAP_ERROR_ARGUMENT. */
HAP_API HAP_NODISCARD hap_status hap_session_try_lock(hap_session *session, int64_t timeout_ns);

/* [app] The thread that locked; any other, and one in a callback: HAP_ERROR_THREAD. */
HAP_API hap_status hap_session_unlock(hap_session *session);

/* [physics] An edit of the world that hap_session_post was given. */
typedef void (*hap_edit_fn)(void *arg);

/* [any] Runs edit(arg) in the physics thread before its next step. In order of posting; at most
 * 256 wait at a time (HAP_ERROR_CAPACITY: it is not taken). May be called in callbacks and in edits, and
 * before start; not in a device's read or write, as it may wait for another thread that posts. What an
 * edit posts runs at the next step. stop runs the edits that wait and what they post, 16 rounds of it; what
 * is left then waits for the next start, or is run by destroy, which takes no more (HAP_ERROR_STATE). So
 * what was taken is run, once. An edit is a callback: it may touch the world, adopt and forget, but not
 * lock, start, stop, destroy, add or remove pointers. */
HAP_API HAP_NODISCARD hap_status hap_session_post(hap_session *session, hap_edit_fn edit,
                                                  void *arg);

/* [any] From the next sync on. */
HAP_API HAP_NODISCARD hap_status hap_session_set_model(hap_session *session, hap_model model);

/* [any] Clears a latched fault; from the next tick on force is felt again, over 20 ms. Where the pointer
 * is more than 10 mm deep by then, the rest comes in at 0.2 m/s. A fault that lasts latches again; a device
 * that has to be opened anew first needs hap_pointer_restart. */
HAP_API hap_status hap_session_reset_fault(hap_session *session);

/* [any] Text of the last error or fault of this session; "" when there was none. */
HAP_API hap_status hap_session_detail(const hap_session *session, hap_detail *out);

/* [any] Time of the session [ns]: CLOCK_MONOTONIC, in lockstep the virtual clock. */
HAP_API int64_t hap_session_now(const hap_session *session);

/* [any] Name of a model as programs spell it ("accelerance"); NULL for an unknown value. */
HAP_API const char *hap_model_name(hap_model model);

HAP_END_DECLS

#endif
