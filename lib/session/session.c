/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "session/session_internal.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "session/frame_clock.h"

#define TIME_SCALE_LEAST 1e-3 /* masses go with its inverse square */

const char *hap_model_name(hap_model model)
{
  switch (model) {
    case HAP_MODEL_SINGLE:
      return "single";
    case HAP_MODEL_IMPULSE:
      return "impulse";
    case HAP_MODEL_ACCELERANCE:
      return "accelerance";
    case HAP_MODEL_CONTACT:
      return "contact";
  }
  return NULL;
}

hap_status hapi_session_fail(const hap_session *session, hap_status status, const char *format, ...)
{
  hap_session *s = (hap_session *)(uintptr_t)session; /* the text is no part of its value */
  va_list arguments;
  va_start(arguments, format);
  pthread_mutex_lock(&s->detail_lock);
  vsnprintf(s->detail.text, sizeof s->detail.text, format, arguments);
  pthread_mutex_unlock(&s->detail_lock);
  va_end(arguments);
  return status;
}

hap_status hapi_session_note(const hap_session *session, hap_status status,
                             const hap_detail *detail)
{
  return status < HAP_OK || status == HAP_SATURATED
             ? hapi_session_fail(session, status, "%s", detail->text)
             : status;
}

hap_status hapi_session_find_body(hap_session *session, void *body, uint64_t *out_birth,
                                  hap_detail *detail)
{
  if (hapi_physics_birth(session->physics, body, out_birth) >= HAP_OK) {
    return HAP_OK;
  }
  return hapi_fail(detail, HAP_ERROR_NOT_FOUND,
                   "the body is not known to the session: it was destroyed or forgotten, or it has "
                   "neither geom nor joint and was not adopted (hap_session_adopt_body), or it is "
                   "new, and the next step will see it");
}

hap_status hapi_session_say(const hap_session *session, hap_status status, const char *call)
{
  return session != NULL && status < HAP_OK
             ? hapi_session_fail(session, status, "%s: %s", call, hap_status_text(status))
             : status;
}

hap_status hapi_session_may_change(const hap_session *session)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  return session->player == NULL
             ? HAP_OK
             : hapi_session_fail(session, HAP_ERROR_STATE,
                                 "the session plays a recording, and what happened is in it");
}

hap_status hapi_session_may_steer(const hap_session *session)
{
  HAPI_TRY(hapi_session_may_change(session));
  return session->ferry.side != HAPI_SIDE_LOOP
             ? HAP_OK
             : hapi_session_fail(session, HAP_ERROR_UNSUPPORTED,
                                 "the world is in another session, which decides this");
}

/* What the haptic thread uses stays as it is while that thread is somewhere in a device. So do the
 * devices, which the session still has. */
static void session_leave(const hap_session *session)
{
  hap_detail where;
  hapi_haptic_where(session->haptic, &where);
  hapi_log(HAP_LOG_ERROR,
           "hap_session_destroy: the force is off, but memory and devices of the session are not "
           "freed, as they are in use: %.300s",
           where.text);
}

void hapi_session_free(hap_session *session)
{
  bool stuck = session->started;
  if (stuck) {
    session_leave(session);
  } else {
    hapi_haptic_destroy(session->haptic);
  }
  hapi_physics_destroy(session->physics);
  hapi_contact_destroy(session->contact);
  hapi_exchange_destroy(session->ferry.exchange);
  if (session->ferry.free != NULL) {
    session->ferry.free(session);
  }
  if (!stuck) {
    hapi_exchange_destroy(session->exchange);
    hapi_recorder_destroy(session->recorder);
    hapi_textures_destroy(session->textures);
  }
  if (session->gone.tell != NULL) {
    session->gone.tell(session->gone.arg);
  }
  pthread_mutex_destroy(&session->detail_lock);
  hapi_free(session);
}

void hap_session_destroy(hap_session *session)
{
  if (session == NULL) {
    return;
  }
  if (hapi_physics_in_callback(session->physics)) {
    hapi_log(HAP_LOG_ERROR, "hap_session_destroy was called in a callback: nothing is destroyed");
    return;
  }
  (void)hapi_physics_unlock(session->physics); /* where this thread has it, stop would wait */
  hap_session_stop(session);
  hapi_physics_close(session->physics);
  hapi_session_free(session);
}

/* ---- start and stop ---- */

/* What takes the lock itself must not be called by a thread that has it. */
static bool may_run(hap_session *session)
{
  return !hapi_physics_in_callback(session->physics) &&
         !hapi_physics_lock_is_mine(session->physics);
}

static void ferry_call(const hap_session *session, void (*call)(void *of, int64_t now_ns),
                       int64_t now_ns)
{
  if (call != NULL) {
    call(session->ferry.of, now_ns);
  }
}

static bool has_loop(const hap_session *session)
{
  return session->ferry.side != HAPI_SIDE_WORLD || session->ferry.has_loop;
}

static bool has_world(const hap_session *session)
{
  return session->ferry.side != HAPI_SIDE_LOOP;
}

/* The loop beside a served world gets its threads with the second hand (session_far.c). */
static bool has_loop_at_once(const hap_session *session)
{
  return session->ferry.side != HAPI_SIDE_WORLD;
}

/* *out_which: the thread that is to be told of where one does not start. */
static hap_status threads_run(hap_session *session, const char **out_which)
{
  *out_which = "haptic";
  if (has_loop_at_once(session)) {
    HAPI_TRY(hapi_haptic_start_thread(session->haptic));
  }
  *out_which = "physics";
  if (has_world(session) && session->def.drive == HAP_DRIVE_THREADS) {
    HAPI_TRY(hapi_physics_start_thread(session->physics));
  }
  *out_which = "contact";
  if (has_loop_at_once(session)) {
    HAPI_TRY(hapi_contact_start_thread(session->contact));
  }
  *out_which = "network";
  return session->ferry.start != NULL ? session->ferry.start(session) : HAP_OK;
}

static hap_status start_threads(hap_session *session)
{
  const char *which = NULL;
  hap_status status = threads_run(session, &which);
  if (status < HAP_OK) {
    return hapi_session_fail(
        session, status, "the %s thread could not be started: %s%s", which, strerror(errno),
        errno == EAGAIN ? " (a limit of threads or memory: ulimit -u, -v)" : "");
  }
  bool wanted = session->def.rt_priority > 0 && has_loop_at_once(session);
  bool given = hapi_haptic_is_realtime(session->haptic) && session->memory_locked;
  return wanted && !given ? HAP_NO_REALTIME : HAP_OK;
}

static hap_status session_begin(hap_session *session, hap_detail *detail)
{
  int64_t start_ns = session->def.drive == HAP_DRIVE_LOCKSTEP ? 0 : hapi_clock_now();
  hapi_exchange_reset(session->exchange);
  if (session->ferry.exchange != NULL) {
    hapi_exchange_reset(session->ferry.exchange);
  }
  HAPI_TRY(session->player != NULL ? hapi_play_begin(session, &start_ns, detail)
                                   : hapi_record_begin(session, detail));
  if (has_loop(session)) {
    HAPI_TRY(hapi_haptic_begin(session->haptic, start_ns, detail));
  }
  if (has_world(session)) {
    HAPI_TRY(hapi_physics_begin(session->physics, &start_ns, detail));
  }
  if (session->ferry.begin != NULL) {
    HAPI_TRY(session->ferry.begin(session, start_ns));
  }
  if (has_world(session)) {
    ferry_call(session, session->ferry.after_cycle, start_ns);
  }
  /* The first local model, and the first contacts: the first tick has both. */
  if (has_loop(session)) {
    hapi_haptic_set_start(session->haptic, start_ns);
    hapi_contact_begin(session->contact, start_ns);
    hapi_haptic_receive(session->haptic, start_ns);
    hapi_contact_pass(session->contact, start_ns);
    hapi_haptic_receive(session->haptic, start_ns);
  }
  atomic_store(&session->tick, 0);
  session->base = session->step = session->pass_tick = 0;
  session->frame_remainder_s = 0.0;
  return session->player != NULL ? hapi_play_begun(session, start_ns, detail) : HAP_OK;
}

hap_status hap_session_start(hap_session *session)
{
  size_t size = 0;
  hap_detail detail = {""};
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (session->started) {
    return hapi_session_fail(session, HAP_ERROR_STATE, "the session has been started already");
  }
  if (!may_run(session) || hapi_physics_lock(session->physics, -1) < HAP_OK) {
    return hapi_session_fail(session, HAP_ERROR_THREAD,
                             "start in a callback or while this thread holds the lock");
  }
  if (session->ran && session->ferry.own != NULL) {
    (void)hapi_physics_unlock(session->physics);
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "a session that is served or connected is started once: the other "
                             "end would take it for the same; create it anew");
  }
  if (session->ran && session->player != NULL) {
    (void)hapi_physics_unlock(session->physics);
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "a replay is started once: open the recording and create the session "
                             "anew");
  }
  hap_status status = hapi_session_note(session, session_begin(session, &detail), &detail);
  session->started = session->ran = true; /* under the lock: hap_session_unlock reads it */
  (void)hapi_physics_unlock(session->physics);
  session->starter = pthread_self();
  if (status >= HAP_OK && session->def.drive != HAP_DRIVE_LOCKSTEP) {
    void *block = hapi_exchange_memory(session->exchange, &size);
    session->memory_locked = session->def.rt_priority > 0 && hapi_memory_lock(block, size);
    status = start_threads(session);
  }
  if (status < HAP_OK) {
    hap_session_stop(session);
  }
  return status;
}

hap_status hap_session_stop(hap_session *session)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (!may_run(session)) {
    return hapi_session_fail(session, HAP_ERROR_THREAD,
                             "stop in a callback or while this thread holds the lock");
  }
  if (!session->started) {
    return HAP_OK;
  }
  if (session->ferry.has_loop) {
    hapi_physics_stop_thread(session->physics); /* which may be starting the loop */
  }
  bool ended = hapi_haptic_end(session->haptic); /* first: the hand is let go */
  hapi_contact_stop_thread(session->contact);
  if (session->ferry.stop != NULL) {
    session->ferry.stop(session);
  }
  hapi_physics_end(session->physics);
  if (!ended) {
    hap_detail where;
    hapi_haptic_where(session->haptic, &where);
    return hapi_session_fail(session, HAP_ERROR_TIMEOUT,
                             "the session has not stopped, and its force is off: %.300s; stop "
                             "again when the device has come back",
                             where.text);
  }
  hapi_record_stop(session);
  if (session->memory_locked) {
    size_t size = 0;
    void *block = hapi_exchange_memory(session->exchange, &size);
    hapi_memory_unlock(block, size);
    session->memory_locked = false;
  }
  session->started = false;
  return HAP_OK;
}

/* ---- the drives ---- */

/* What update and advance have to say when they have done their work. */
static hap_status drive_outcome(const hap_session *session, uint64_t lost_before)
{
  if (hapi_haptic_has_fault(session->haptic)) {
    return HAP_FAULTED;
  }
  bool lost = hapi_physics_bodies_lost(session->physics) > lost_before;
  return lost ? HAP_BODY_LOST : HAP_OK;
}

static hap_status update_check(hap_session *session, double frame_s)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (!(frame_s >= 0.0 && frame_s <= HAPI_FRAME_S_MOST)) { /* false for NaN */
    return hapi_session_fail(
        session, HAP_ERROR_ARGUMENT,
        "frame_s is %g: the seconds since the last call, 0 .. %g, are asked for", frame_s,
        HAPI_FRAME_S_MOST);
  }
  if (!session->started || session->def.drive != HAP_DRIVE_FRAME) {
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "update belongs to drive FRAME between start and stop");
  }
  if (pthread_equal(session->starter, pthread_self()) == 0) {
    return hapi_session_fail(session, HAP_ERROR_THREAD,
                             "update in another thread than start: call both in the frame loop's");
  }
  if (!may_run(session)) {
    return hapi_session_fail(session, HAP_ERROR_THREAD,
                             "update in a callback or while this thread holds the lock");
  }
  return HAP_OK;
}

static int64_t seconds_in_ns(double seconds)
{
  return (int64_t)llround(1e9 * seconds);
}

/* Runs the steps of one rate that fit, at most *io_most of them; true: none were dropped. now_ns:
 * of the end of frame_s. */
static bool run_frame_steps(hap_session *session, double frame_s, int64_t now_ns, int *io_most)
{
  double period = hapi_physics_period(session->physics);
  double next_period = hapi_physics_next_period(session->physics);
  hapi_frame_steps steps = hapi_frame_take(&session->frame_remainder_s, frame_s, period, *io_most,
                                           now_ns, hapi_physics_last_cycle(session->physics));
  for (int i = 0; i < steps.count; ++i) {
    int64_t now = steps.first_ns + i * steps.apart_ns;
    hapi_physics_cycle(session->physics, now, now + seconds_in_ns(next_period));
  }
  *io_most -= steps.count;
  hapi_physics_count_dropped_frames(session->physics, steps.dropped);
  return steps.dropped == 0;
}

hap_status hap_session_update(hap_session *session, double frame_s)
{
  HAPI_TRY(update_check(session, frame_s));
  uint64_t lost = hapi_physics_bodies_lost(session->physics);
  int64_t now_ns = hapi_clock_now();
  int most = session->def.max_steps_per_update;
  double rest_s = frame_s;
  double period = hapi_physics_period(session->physics);
  if (period != hapi_physics_next_period(session->physics)) { /* up to its end the old one holds */
    double first_s = fmin(fmax(period - session->frame_remainder_s, 0.0), frame_s);
    rest_s -= first_s;
    (void)run_frame_steps(session, first_s, now_ns - seconds_in_ns(rest_s), &most);
  }
  return run_frame_steps(session, rest_s, now_ns, &most) ? drive_outcome(session, lost)
                                                         : HAP_DROPPED;
}

/* Whole ones; signed on the way, as unsigned numbers are dear to convert. */
static uint64_t ticks_of(const hap_session *session, double period, uint64_t steps)
{
  return (uint64_t)(int64_t)((double)steps * period * session->def.haptic_hz + 1e-6);
}

static int64_t time_of(const hap_session *session, uint64_t tick)
{
  return hapi_clock_deadline(tick, session->def.haptic_hz);
}

/* Runs the physics cycle of this tick when one is due. A change of model starts a new count. */
static void step_when_due(hap_session *session)
{
  double period = hapi_physics_period(session->physics);
  if (session->tick != session->base + ticks_of(session, period, session->step)) {
    return;
  }
  double next_period = hapi_physics_next_period(session->physics);
  bool changes = next_period != period;
  /* Where H is no whole number of ticks, the step's own time lies between two ticks. */
  int64_t now = time_of(session, session->base) + seconds_in_ns((double)session->step * period);
  /* SINGLE steps up to now, and at the start there is nothing to step. */
  if (session->tick > 0 || !hapi_physics_steps_to_now(session->physics)) {
    hapi_physics_cycle(session->physics, now, now + seconds_in_ns(next_period));
  }
  session->base = changes ? session->tick : session->base;
  session->step = changes ? 1 : session->step + 1;
}

/* The contact thread's part: at its rate, and when bodies have come into the range. Its contacts
 * are used from the next tick on. */
static void find_contacts_when_due(hap_session *session)
{
  double period = hapi_contact_period(session->contact);
  bool due = session->tick >= session->pass_tick;
  if (due) {
    uint64_t next =
        (uint64_t)floor((double)session->tick / (period * session->def.haptic_hz) + 1e-6) + 1;
    session->pass_tick = ticks_of(session, period, next);
  }
  if (due || hapi_contact_has_news(session->contact)) {
    int64_t half_tick = (int64_t)(0.5e9 / session->def.haptic_hz);
    hapi_contact_pass(session->contact, time_of(session, session->tick + 1) - half_tick);
  }
}

/* False: the loop is stopped in this tick's time. */
static bool tick_runs(const hap_session *session)
{
  uint64_t turn = session->pulses.run_ticks + session->pulses.stop_ticks;
  return session->pulses.stop_ticks == 0 || session->tick % turn < session->pulses.run_ticks;
}

hap_status hap_session_advance(hap_session *session, uint64_t ticks)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (!session->started || session->def.drive != HAP_DRIVE_LOCKSTEP) {
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "advance belongs to drive LOCKSTEP between start and stop");
  }
  if (!may_run(session)) {
    return hapi_session_fail(session, HAP_ERROR_THREAD,
                             "advance in a callback or while this thread holds the lock");
  }
  uint64_t lost = hapi_physics_bodies_lost(session->physics);
  if (session->player != NULL) {
    hap_status status = hapi_play_advance(session, ticks);
    return status != HAP_OK ? status : drive_outcome(session, lost);
  }
  for (uint64_t i = 0; i < ticks; ++i) {
    int64_t now = time_of(session, session->tick);
    bool runs = has_loop(session) && tick_runs(session);
    if (runs) {
      ferry_call(session, session->ferry.before_tick, now);
      hapi_haptic_receive(session->haptic, now);
    }
    if (has_world(session)) {
      step_when_due(session);
    }
    if (has_loop(session)) {
      find_contacts_when_due(session);
    }
    if (runs) {
      hapi_haptic_cycle(session->haptic, now);
      ferry_call(session, session->ferry.after_tick, now);
    } else if (has_loop(session)) {
      hapi_haptic_count_missed(session->haptic, 1);
    }
    atomic_fetch_add_explicit(&session->tick, 1, memory_order_relaxed);
  }
  return drive_outcome(session, lost);
}

int64_t hap_session_now(const hap_session *session)
{
  if (session != NULL && session->player != NULL) {
    return session->played_ns;
  }
  bool virtual_clock = session != NULL && session->def.drive == HAP_DRIVE_LOCKSTEP;
  return virtual_clock ? time_of(session, session->tick) : hapi_clock_now();
}

/* ---- the world, between threads ---- */

static hap_status say_why_not_locked(hap_session *session, hap_status status)
{
  if (status == HAP_ERROR_THREAD) {
    return hapi_session_fail(session, status, "%s",
                             hapi_physics_in_callback(session->physics)
                                 ? "lock in a callback or a posted edit: there the world may be "
                                   "touched without it"
                                 : "lock by a thread that has the lock already: it is not "
                                   "recursive, unlock first");
  }
  return hapi_session_say(session, status, "hap_session_try_lock");
}

hap_status hap_session_lock(hap_session *session)
{
  return session == NULL ? HAP_ERROR_ARGUMENT
                         : say_why_not_locked(session, hapi_physics_lock(session->physics, -1));
}

hap_status hap_session_try_lock(hap_session *session, int64_t timeout_ns)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (timeout_ns < 0) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "timeout_ns is %lld: below 0; hap_session_lock waits without end",
                             (long long)timeout_ns);
  }
  return say_why_not_locked(session, hapi_physics_lock(session->physics, timeout_ns));
}

hap_status hap_session_unlock(hap_session *session)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (session->ran && !has_world(session) && hapi_physics_lock_is_mine(session->physics)) {
    hapi_physics_see_drawn(session->physics); /* there are no steps that would */
  }
  hap_status status = hapi_physics_unlock(session->physics);
  return status < HAP_OK
             ? hapi_session_fail(session, status, "unlock by a thread that does not have the lock")
             : status;
}

hap_status hap_session_post(hap_session *session, hap_edit_fn edit, void *arg)
{
  if (session == NULL || edit == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_status status = hapi_physics_post(session->physics, edit, arg);
  if (status == HAP_ERROR_CAPACITY) {
    return hapi_session_fail(
        session, status,
        "256 posted edits wait for the next physics step already; this one was "
        "not taken");
  }
  return status < HAP_OK
             ? hapi_session_fail(session, status,
                                 "the session is being destroyed: the edit was not taken")
             : status;
}

hap_status hap_session_set_model(hap_session *session, hap_model model)
{
  HAPI_TRY(hapi_session_may_steer(session));
  if ((int)model < 0 || hap_model_name(model) == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  if (session->ferry.own != NULL && model != HAP_MODEL_CONTACT) {
    return hapi_session_fail(session, HAP_ERROR_UNSUPPORTED,
                             "model %s does not go with a loop far from its world: only contact",
                             hap_model_name(model));
  }
  hapi_physics_set_model(session->physics, model);
  return HAP_OK;
}

hap_status hap_session_set_time_scale(hap_session *session, double scale)
{
  HAPI_TRY(hapi_session_may_steer(session));
  if (!(scale == 0.0 || (scale >= TIME_SCALE_LEAST && scale <= 1.0))) { /* NaN too */
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "a time scale of %g: 0 for a pause, or %g to 1", scale,
                             TIME_SCALE_LEAST);
  }
  hapi_physics_set_time_scale(session->physics, scale);
  return HAP_OK;
}

hap_status hap_session_set_physics_hz(hap_session *session, double hz)
{
  HAPI_TRY(hapi_session_may_steer(session));
  double least = session->def.physics_hz / HAPI_RATE_FALL;
  double most = fmin(session->def.haptic_hz, 1000.0);
  if (!(hz >= least && hz <= most)) { /* NaN too */
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "physics_hz is %g: %g to %g are possible here, from a quarter of the "
                             "session's physics_hz on",
                             hz, least, most);
  }
  hapi_physics_set_period(session->physics, seconds_in_ns(1.0 / hz));
  return HAP_OK;
}

/* ---- faults and figures ---- */

const char *hap_fault_text(hap_fault fault)
{
  switch (fault) {
    case HAP_FAULT_NONE:
      return "";
    case HAP_FAULT_DEVICE_READ:
      return "the device could not be read; force is zero until the fault is reset";
    case HAP_FAULT_DEVICE_POSE:
      return "the device gave a pose that is not finite or beyond 1000 km; force is zero until the "
             "fault is reset";
    case HAP_FAULT_FORCE:
      return "a contact force was not finite; force is zero until the fault is reset";
    case HAP_FAULT_LOCAL_STATE:
      return "the state of a body in the loop was not finite; force is zero until the fault is "
             "reset";
    case HAP_FAULT_DEVICE_WRITE:
      return "the device did not take a force; force is zero until the fault is reset";
    case HAP_FAULT_WORLD:
      return "the ODE world holds a body that cannot be stepped; force is zero until the fault is "
             "reset";
    case HAP_FAULT_DEVICE_INPUT:
      return "the device told positions for 18 ms that are not plausible: look at encoders, cables "
             "and strings; force is zero until the fault is reset";
    case HAP_FAULT_EMERGENCY:
      return "hap_emergency_zero was called; force is zero until the fault is reset";
    case HAP_FAULT_LATE:
      return "the haptic loop came too late under force (missed_ticks); give it real time or less "
             "to do (docs/realtime.md, What a machine must provide); force is zero until the fault "
             "is reset";
    case HAP_FAULT_OSCILLATION:
      return "the device swung by itself, or ran away from a surface, at high force; lower the "
             "stiffness, or check delay, damping and the sign of each axis (docs/safety.md: "
             "Oscillation); force is zero until the fault is reset";
    case HAP_FAULT_BLOCKED:
      return "the loop stood still and a watchdog took the force off: a device hangs, or other "
             "programs hold the processors (docs/realtime.md, What a machine must provide); force "
             "is "
             "zero until the fault is reset";
  }
  return "";
}

hap_status hap_session_reset_fault(hap_session *session)
{
  HAPI_TRY(hapi_session_may_change(session));
  hapi_haptic_reset_fault(session->haptic);
  (void)hapi_session_fail(session, HAP_OK, "%s", ""); /* a fault of the world has its text there */
  return HAP_OK;
}

hap_status hap_session_stats(const hap_session *session, hap_stats *out, size_t size_of_out)
{
  hap_stats stats;
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  memset(&stats, 0, sizeof stats);
  hapi_haptic_stats(session->haptic, &stats); /* physics looks at it */
  hapi_physics_stats(session->physics, &stats);
  hapi_haptic_stats(session->haptic, &stats);
  hapi_contact_stats(session->contact, &stats);
  return hapi_session_say(session, hapi_struct_give(&stats, sizeof stats, out, size_of_out),
                          __func__);
}

hap_status hap_session_detail(const hap_session *session, hap_detail *out)
{
  if (session == NULL || out == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_stats stats;
  hap_session *s = (hap_session *)(uintptr_t)session;
  pthread_mutex_lock(&s->detail_lock);
  *out = s->detail;
  pthread_mutex_unlock(&s->detail_lock);
  hapi_haptic_stats(session->haptic, &stats);
  hap_fault fault = (hap_fault)stats.faults.fault;
  if (fault == HAP_FAULT_NONE || fault == HAP_FAULT_WORLD) {
    return HAP_OK;
  }
  unsigned place = (unsigned)(stats.faults.pointer & 0xffffffffu);
  hap_detail why = {""}; /* the pointer it came from, by the number of its place, and its device */
  if (fault == HAP_FAULT_BLOCKED) { /* a device that hangs is not asked */
    hapi_haptic_where(session->haptic, &why);
  }
  if (place == 0) {
    snprintf(out->text, sizeof out->text, "%s%s%.300s", hap_fault_text(fault),
             why.text[0] != '\0' ? ": " : "", why.text);
    return HAP_OK;
  }
  if (fault == HAP_FAULT_DEVICE_READ || fault == HAP_FAULT_DEVICE_WRITE ||
      fault == HAP_FAULT_DEVICE_INPUT) {
    hapi_haptic_explain(session->haptic, (hap_pointer_id){stats.faults.pointer}, &why);
  }
  snprintf(out->text, sizeof out->text, "pointer %u: %s%s%.300s", place, hap_fault_text(fault),
           why.text[0] != '\0' ? ": " : "", why.text);
  return HAP_OK;
}

hap_status hap_session_trace_read(hap_session *session, hap_trace_row *rows, size_t capacity,
                                  size_t size_of_row, size_t *out_count)
{
  if (session == NULL || rows == NULL || out_count == NULL || size_of_row < sizeof rows->tick) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  *out_count = hapi_haptic_read_trace(session->haptic, rows, capacity, size_of_row);
  return *out_count == 0 ? HAP_END : HAP_OK;
}

hap_status hap_session_black_box(hap_session *session, hap_black_box_row *rows, size_t capacity,
                                 size_t size_of_row, size_t *out_count)
{
  if (session == NULL || rows == NULL || out_count == NULL || size_of_row < sizeof rows->tick) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  *out_count = hapi_haptic_read_black_box(session->haptic, rows, capacity, size_of_row);
  return *out_count == 0 ? HAP_END : HAP_OK;
}
