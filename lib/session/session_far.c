/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/remote.h>

#include "base/clock.h"
#include "base/log.h"
#include "session/session_internal.h"

/* Physics and loop without memory in common: what one knows of the other comes in messages. */

static hap_status far_check(const hap_session *session)
{
  const hap_session_def *def = &session->def;
  const char *what = def->model != HAP_MODEL_CONTACT       ? "another model than contact"
                     : def->expert->lookback > 0.0         ? "looking back"
                     : hapi_physics_asks(session->physics) ? "a contact callback"
                     : session->player != NULL             ? "a replay"
                                                           : NULL;
  return what == NULL ? HAP_OK
                      : hapi_session_fail(session, HAP_ERROR_UNSUPPORTED,
                                          "%s does not go with a loop far from its world", what);
}

hap_status hapi_session_set_ferry(hap_session *session, const hapi_ferry *ferry)
{
  if (session->started || session->ran) {
    return hapi_session_fail(session, HAP_ERROR_STATE, "the session has been started already");
  }
  HAPI_TRY(far_check(session));
  if (ferry->side == HAPI_SIDE_BOTH && session->def.drive != HAP_DRIVE_LOCKSTEP) {
    return hapi_session_fail(session, HAP_ERROR_UNSUPPORTED,
                             "world and loop of one session are apart in drive LOCKSTEP alone");
  }
  hapi_exchange *exchange = session->ferry.exchange;
  bool apart = ferry->side == HAPI_SIDE_BOTH || ferry->has_loop;
  if (exchange == NULL && apart &&
      hapi_exchange_create_late(hapi_exchange_capacity(session->exchange), &exchange) < HAP_OK) {
    return hapi_session_fail(session, HAP_ERROR_MEMORY, "no memory for the messages of physics");
  }
  if (exchange != NULL) {
    hapi_physics_set_exchange(session->physics, exchange);
  }
  const hapi_limits limits = session->ferry.limits;
  session->ferry = *ferry;
  session->ferry.limits = limits;
  session->ferry.exchange = exchange;
  const hapi_physics_calls calls = {ferry->of, ferry->before_cycle, ferry->after_cycle};
  hapi_physics_set_calls(session->physics, &calls);
  return HAP_OK;
}

/* ---- the ends ---- */

/* A cycle is for its deadline, and comes a little later: messages are told when they were looked
 * for. */
static int64_t far_now(const hapi_far *far, int64_t now_ns)
{
  return far->lockstep ? now_ns : hapi_clock_now();
}

static void far_before_cycle(void *of, int64_t now_ns)
{
  hapi_far *far = of;
  pthread_mutex_lock(&far->lock);
  hapi_world_end_receive(&far->world, far_now(far, now_ns));
  pthread_mutex_unlock(&far->lock);
}

static void far_after_cycle(void *of, int64_t now_ns)
{
  hapi_far *far = of;
  pthread_mutex_lock(&far->lock);
  hapi_world_end_send(&far->world, far_now(far, now_ns));
  pthread_mutex_unlock(&far->lock);
}

static void far_before_tick(void *of, int64_t now_ns)
{
  hapi_far *far = of;
  pthread_mutex_lock(&far->lock);
  hapi_loop_end_receive(&far->loop, now_ns);
  pthread_mutex_unlock(&far->lock);
}

static void far_after_tick(void *of, int64_t now_ns)
{
  hapi_far *far = of;
  pthread_mutex_lock(&far->lock);
  hapi_loop_end_send(&far->loop, now_ns);
  pthread_mutex_unlock(&far->lock);
}

/* ---- the thread of a loop's end: looks for messages between ticks, whoever makes them ---- */

#define LOOK_NS 1000000LL

static void *network_main(void *arg)
{
  hapi_far *far = arg;
  int64_t next_ns = hapi_clock_now();
  while (atomic_load(&far->stop) == 0) {
    far_before_tick(far, hapi_clock_now());
    far_after_tick(far, hapi_clock_now());
    next_ns += LOOK_NS;
    int64_t now_ns = hapi_clock_now();
    next_ns = next_ns > now_ns ? next_ns : now_ns;
    hapi_clock_sleep_until(next_ns);
  }
  return NULL;
}

static hap_status network_start(hap_session *session)
{
  hapi_far *far = session->ferry.far;
  atomic_store(&far->stop, 0);
  return hapi_thread_start(&far->thread, network_main, far, "hapode-network",
                           session->def.rt_priority / 2);
}

static void network_stop(hap_session *session)
{
  atomic_store(&session->ferry.far->stop, 1);
  hapi_thread_join(&session->ferry.far->thread);
}

/* ---- who draws ---- */

static uint32_t far_places(void *of)
{
  return hapi_physics_places(of);
}

static void far_tell(void *of, uint32_t first, uint32_t count, hapi_told_body *out)
{
  hapi_physics_tell(of, first, count, out);
}

static void far_hear(void *of, uint64_t number, const hapi_told_body *bodies, uint32_t count)
{
  hapi_physics_hear(of, number, bodies, count);
}

static void far_draw(void *of, hapi_model *model, double period_s, const int64_t times_ns[2])
{
  hapi_physics_draw(of, model, period_s, times_ns);
}

static hap_status far_begin(hap_session *session, int64_t start_ns)
{
  hapi_far *far = session->ferry.far;
  if (session->ferry.side == HAPI_SIDE_LOOP) {
    HAPI_TRY(hapi_physics_begin_drawing(session->physics, start_ns));
  }
  hapi_physics_print_scene(session->physics, &far->loop.scene);
  far->world.terms.scene = far->loop.scene;
  return HAP_OK;
}

/* ---- hands of others: pointers without a device ---- */

/* What a message says is what a pointer may be, or the hand is left out. */
static uint64_t hand_add(void *of, const hapi_model_hand *hand)
{
  hap_pointer_def def;
  hapi_pointer_setup setup;
  hap_pointer_id id;
  hap_detail why;
  hap_pointer_def_init(&def, sizeof def);
  def.radius = hand->radius;
  def.stiffness = hand->stiffness;
  def.damping = hand->damping;
  def.friction = hand->friction;
  def.finger_radius = hand->finger_radius;
  def.hull_points = hand->hull.count;
  def.hull_xyz = hand->hull.count > 0 ? hand->hull.points[0] : NULL;
  if (hapi_session_read_pointer(&def, &setup, &why) < HAP_OK) {
    return 0;
  }
  setup.coupling = HAP_COUPLING_DIRECT;
  setup.foreign = 1;
  if (hapi_haptic_add_pointer(of, &setup, &id, &why) < HAP_OK) {
    return 0;
  }
  return id.v;
}

static bool hand_acts(void *of, uint64_t id)
{
  return hapi_haptic_pointer_acts(of, (hap_pointer_id){id});
}

static void hand_remove(void *of, uint64_t id)
{
  if (hapi_haptic_remove_pointer(of, (hap_pointer_id){id}) < HAP_OK) {
    hapi_log(HAP_LOG_WARNING, "the hand of another session stays: the loop does not come back");
  }
}

static void hand_put(void *of, uint64_t id, const hapi_model_hand *hand, int64_t now_ns)
{
  const int64_t times_ns[2] = {now_ns, HAPI_HAND_CARRIED_NS};
  (void)hapi_haptic_carry_target(of, (hap_pointer_id){id}, &hand->pose, &hand->twist, times_ns);
}

/* Before, there is nothing for the world's own loop to do. */
static void far_wake(void *of)
{
  hap_session *session = of;
  if (hapi_haptic_start_thread(session->haptic) < HAP_OK ||
      hapi_contact_start_thread(session->contact) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no thread for bodies that several hands may touch: they stand still");
  }
}

static hap_status far_fill(hap_session *session, hapi_far *far)
{
  const hap_session_def *def = &session->def;
  hapi_exchange *apart = session->ferry.exchange;
  const hapi_terms terms = {.look_ahead_s = def->expert->look_ahead,
                            .period_s = 1.0 / def->physics_hz,
                            .haptic_hz = def->haptic_hz,
                            .capacity = *hapi_exchange_capacity(session->exchange)};
  far->world.terms = far->loop.terms = terms;
  far->world.terms.limits = (hapi_limits){HAP_CLIENT_FORCE, HAP_CLIENT_SPEED};
  far->loop.limits = session->ferry.limits;
  far->world.exchange = apart != NULL ? apart : session->exchange;
  far->world.bodies = (hapi_scenery_source){session->physics, far_places, far_tell};
  if (session->ferry.side == HAPI_SIDE_LOOP) {
    far->loop.view = (hapi_loop_view){session->physics, far_hear, far_draw};
  }
  far->loop.exchange = session->exchange;
  far->lockstep = def->drive == HAP_DRIVE_LOCKSTEP;
  pthread_mutex_init(&far->lock, NULL);
  far->world.loop = session->ferry.has_loop ? session->exchange : NULL;
  far->world.wake = def->drive != HAP_DRIVE_LOCKSTEP && session->ferry.has_loop ? far_wake : NULL;
  far->world.wake_of = session;
  far->world.hands.calls = far->loop.hands.calls =
      (hapi_hands_calls){session->haptic, hand_add, hand_acts, hand_remove, hand_put};
  HAPI_TRY(hapi_world_end_begin(&far->world));
  return hapi_loop_end_begin(&far->loop);
}

hap_status hapi_session_set_far(hap_session *session, hapi_side side, hapi_far *far)
{
  hapi_ferry ferry = {.side = side, .of = far, .far = far};
  ferry.has_loop = side == HAPI_SIDE_WORLD && far->world.codecs != NULL && far->world.room > 1;
  if (side != HAPI_SIDE_LOOP) {
    ferry.before_cycle = far_before_cycle;
    ferry.after_cycle = far_after_cycle;
  }
  if (side != HAPI_SIDE_WORLD) {
    ferry.before_tick = far_before_tick;
    ferry.after_tick = far_after_tick;
  }
  ferry.begin = side != HAPI_SIDE_BOTH ? far_begin : NULL;
  if (side == HAPI_SIDE_LOOP) {
    ferry.start = network_start;
    ferry.stop = network_stop;
  }
  HAPI_TRY(hapi_session_set_ferry(session, &ferry));
  hap_status status = far_fill(session, far);
  return status >= HAP_OK
             ? status
             : hapi_session_fail(session, status, "no memory for the state of a far loop");
}

void hapi_far_finish(hapi_far *far)
{
  hapi_world_end_finish(&far->world);
  hapi_loop_end_finish(&far->loop);
  pthread_mutex_destroy(&far->lock);
}
