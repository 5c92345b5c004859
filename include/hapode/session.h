/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SESSION_H
#define HAPODE_SESSION_H

/* A session: what it is made of, how it runs, and how threads share the world.
 *
 * A session couples one ODE world to the pointers that hands hold in it. hap_session_create of
 * hapode/ode.h makes one.
 *
 * Thread tags. [control]: one application thread at a time, which also creates and destroys. [app]:
 * any application thread, but not from a callback. [any]: any thread, also in a callback.
 * [physics]: the library's physics thread calls the application. Every function that returns a
 * status gives HAP_ERROR_ARGUMENT for a NULL that is not allowed. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* One world, coupled to its pointers. */
typedef struct hap_session hap_session;

/* Who moves time. Values are never renumbered. */
typedef enum hap_drive {
  HAP_DRIVE_THREADS = 0, /* the library's own physics and haptic threads, in real time */
  /* physics in the application's frame loop, by hap_session_update; the haptic thread is the
   * library's, in real time */
  HAP_DRIVE_FRAME = 1,
  HAP_DRIVE_LOCKSTEP = 2 /* hap_session_advance; virtual clock from 0, one thread, reproducible */
} hap_drive;

/* How the part of the world near the pointers is simulated. The methods are those of the paper:
 * Susa, Sato, Hasegawa, World Haptics 2011. Values are never renumbered. */
typedef enum hap_model {
  HAP_MODEL_SINGLE = 0,      /* Method 1: the world itself at the haptic rate */
  HAP_MODEL_IMPULSE = 1,     /* Method 3: force on the last known pose */
  HAP_MODEL_ACCELERANCE = 2, /* Method 2: testing simulations, A and b in the loop */
  HAP_MODEL_CONTACT = 3      /* the loop simulates the nearby bodies with their own contacts */
} hap_model;

struct hap_expert_def;   /* hapode/expert.h */
struct hap_research_def; /* hapode/research.h */

/* How a session is made. It has a size and may grow at its end. */
typedef struct hap_session_def {
  uint32_t size;   /* set by hap_session_def_init */
  uint32_t cookie; /* set by hap_session_def_init; an unset def is refused */
  hap_drive drive; /* default HAP_DRIVE_THREADS */
  hap_model model; /* default HAP_MODEL_CONTACT */
  /* Hz, 1..1000 and at most haptic_hz, default 60: steps of the world. Not used by model SINGLE */
  double physics_hz;
  double haptic_hz; /* Hz, 100..20000, default 1000: ticks of the loop */
  /* bodies that the loop moves itself, 1..1024, default 256. It knows as many again of those
   * around them */
  int32_t max_bodies;
  /* 1..8192, default 3072: of contact points between bodies and of pointer contacts, this many
   * each, and of pairs of nearby geoms three times as many. The contact points nearest to a touch
   * are kept: give at least 12 for each of max_bodies, and 24 where they touch on all sides */
  int32_t max_contacts;
  int32_t max_pointers; /* 1..16, default 4 */
  /* SCHED_FIFO priority of the haptic thread, 0..98, default 80. Physics runs at half of it, the
   * watchdogs of the devices one above. 0: do not ask for real time */
  int32_t rt_priority;
  double accuracy; /* 0..1, default HAP_ACCURACY_DEFAULT: the dial, see hapode/accuracy.h */
  /* 0.01..1: share of its period that a tick may take, and also a cycle of physics. The dial is
   * turned back as far as that needs. 0 (default): no budget. Not in drive LOCKSTEP */
  double budget;
  const struct hap_expert_def *expert;     /* copied by create; NULL (default): its defaults */
  const struct hap_research_def *research; /* copied by create; NULL (default): its defaults */

  /* FRAME: 1..64, default 3: physics steps that one hap_session_update may run. More catch up after
   * a long frame, and make the next one longer. */
  int32_t max_steps_per_update;
} hap_session_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_session_def_init(hap_session_def *def, size_t size_of_def);

/* [control] Stops, writes zero force to every device, and frees. NULL is allowed. A lock that this
 * thread holds is released. Posted edits that still wait are run. The world goes back to the
 * application as it is, with ODE's auto-disable as it was found. In a callback it does nothing.
 * Before dCloseODE. A session that runs, or was not stopped, when dWorldDestroy is called latches
 * HAP_FAULT_WORLD and touches world and space no more, which is logged as an error; the call needs
 * the lock (hap_session_lock), or the session's threads may be in the world. Without its space
 * alone a session that runs reads freed memory. */
HAP_API void hap_session_destroy(hap_session *session);

/* ---- running ---- */

/* [control] THREADS: starts both threads. FRAME: starts the haptic thread. LOCKSTEP: builds the
 * first local model. HAP_NO_REALTIME: real-time rights were asked for and not given, and the
 * session runs without. HAP_ERROR_STATE: started already. HAP_ERROR_THREAD: in a callback, or
 * this thread holds the lock. HAP_ERROR_WORLD, HAP_ERROR_DEVICE: hap_session_detail says what is
 * wrong. */
HAP_NODISCARD HAP_API hap_status hap_session_start(hap_session *session);

/* [control] Zero force first, then the threads end. Idempotent. A stopped session can be started
 * again. HAP_ERROR_THREAD: in a callback, or this thread holds the lock.
 *
 * HAP_ERROR_TIMEOUT: a device has not come back from a call for a second. Its force is off (see
 * HAP_FAULT_BLOCKED), physics has ended, and the haptic thread ends as soon as the device comes
 * back. Call again until it is HAP_OK. */
HAP_API hap_status hap_session_stop(hap_session *session);

/* [control] FRAME: runs the whole physics steps that fit into frame_s plus the remainder of earlier
 * calls, at most max_steps_per_update. frame_s is the time since the last call, s, 0..86400. The
 * rest is dropped and counted (HAP_DROPPED, hap_stats.physics.frames_dropped).
 *
 * Slow motion and pauses: hap_session_set_time_scale. Less frame time than the clock's leaves the
 * world behind the loop. After two steps without a frame the force fades; it comes back by itself.
 * Model SINGLE needs another drive: its steps are those of the haptic loop.
 *
 * HAP_FAULTED, HAP_BODY_LOST: see their texts. On an error nothing is done and the remainder stays.
 * HAP_ERROR_ARGUMENT: frame_s is out of range. HAP_ERROR_STATE: another drive, or not started.
 * HAP_ERROR_THREAD: not the thread of start (ODE keeps data for each thread), a callback, or this
 * thread holds the lock. */
HAP_API hap_status hap_session_update(hap_session *session, double frame_s);

/* [control] LOCKSTEP: runs that many haptic ticks, and the physics steps that fall due.
 * HAP_FAULTED, HAP_BODY_LOST: see their texts. HAP_ERROR_STATE, HAP_ERROR_THREAD: as
 * hap_session_update. */
HAP_API hap_status hap_session_advance(hap_session *session, uint64_t ticks);

/* [any] Time of the session, ns: CLOCK_MONOTONIC, in drive LOCKSTEP the virtual clock. */
HAP_API int64_t hap_session_now(const hap_session *session);

/* [any] Changes the model from the next sync on. HAP_ERROR_ARGUMENT: no such model.
 * HAP_ERROR_STATE: the session plays a recording. */
HAP_NODISCARD HAP_API hap_status hap_session_set_model(hap_session *session, hap_model model);

/* [any] Slow motion, in all drives: from the next sync on bodies see this share of the hand's time,
 * 0.001..1; 1 at create. 0 is a pause: bodies stand, nothing moves them, all are felt as walls. The
 * rate of syncs stays physics_hz; steps of the world are shorter (step_s of callbacks), a pause has
 * none. Springs and dampers of pointers belong to the hand's time, velocities of bodies, joints and
 * surfaces to the bodies'. HAP_ERROR_ARGUMENT: out of range. HAP_ERROR_STATE: the session plays a
 * recording, which has the scales. */
HAP_NODISCARD HAP_API hap_status hap_session_set_time_scale(hap_session *session, double scale);

/* [any] Steps of the world a second, from the next sync on, until stop: a quarter of the def's
 * physics_hz and more, at most haptic_hz and 1000. ERP and CFM stay meant for a step of the def's
 * rate, so that springs and dampers stay the same. The error estimate (hap_expert_def.lookback)
 * rests at other rates than the def's. Without effect in model SINGLE, whose steps are the loop's.
 * HAP_ERROR_ARGUMENT: out of range. HAP_ERROR_STATE: the session plays a recording, which has the
 * rates. */
HAP_NODISCARD HAP_API hap_status hap_session_set_physics_hz(hap_session *session, double hz);

/* [any] Clears a latched fault. From the next tick on force is felt again, over 20 ms. Where the
 * pointer is more than 10 mm deep by then, the rest comes in at 0.2 m/s. A fault that lasts latches
 * again. A device that must be opened anew needs hap_pointer_restart first. HAP_ERROR_STATE: the
 * session plays a recording. */
HAP_API hap_status hap_session_reset_fault(hap_session *session);

/* [any] Text of the last error or fault of this session, by whichever thread; "" when there was
 * none, and after hap_session_reset_fault. A latched fault comes before errors. */
HAP_API hap_status hap_session_detail(const hap_session *session, hap_detail *out);

/* [any] Name of a model as programs spell it ("accelerance"); NULL for an unknown value. */
HAP_API const char *hap_model_name(hap_model model);

/* ---- the world, between threads (docs/editing.md) ---- */

/* [app] Between lock and unlock this thread alone may touch the ODE world. Threads are served in
 * order of arrival. The wait is for one physics step at most, and for the threads that are served
 * before. Not recursive. Physics waits while the lock is held (hap_stats.edits.held_ms_max), the
 * haptic loop does not. Legal before start and after stop. A thread that ends with the lock loses
 * it: the next one has it within 0.1 s, and that is logged as an error.
 *
 * HAP_ERROR_THREAD, with a text: this thread has the lock, or it is in a callback or a posted edit,
 * where the world may be touched without it. */
HAP_NODISCARD HAP_API hap_status hap_session_lock(hap_session *session);

/* [app] As hap_session_lock, but gives up after timeout_ns with HAP_ERROR_TIMEOUT. 0: at once;
 * INT64_MAX: never. HAP_ERROR_ARGUMENT: below 0. */
HAP_NODISCARD HAP_API hap_status hap_session_try_lock(hap_session *session, int64_t timeout_ns);

/* [app] Gives the lock up. HAP_ERROR_THREAD: this thread does not have it, or is in a callback. */
HAP_API hap_status hap_session_unlock(hap_session *session);

/* [physics] An edit of the world. arg is the one of hap_session_post, and stays the caller's. */
typedef void (*hap_edit_fn)(void *arg);

/* [any] Runs edit(arg) in the physics thread before its next step. Edits run in order of posting,
 * each once. Legal in callbacks and edits, and before start. Not legal in a device's read or write,
 * as it may wait for another thread that posts.
 *
 * An edit that an edit posts runs at the next step. hap_session_stop runs the edits that wait and
 * those that they post, 16 rounds of it. What is left waits for the next start, or is run by
 * hap_session_destroy. An edit is a callback: it may touch the world, adopt and forget, but not
 * lock, start, stop, destroy, or add and remove pointers.
 *
 * HAP_ERROR_CAPACITY: 256 edits wait, and this one is not taken. HAP_ERROR_STATE: the session is
 * being destroyed. */
HAP_NODISCARD HAP_API hap_status hap_session_post(hap_session *session, hap_edit_fn edit,
                                                  void *arg);

HAP_END_DECLS

#endif
