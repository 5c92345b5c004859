/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "session/session_internal.h"

#include "base/log.h"

/* Physics and loop without memory in common: what one knows of the other comes in messages. */

static hap_status far_check(const hap_session *session)
{
  const hap_session_def *def = &session->def;
  const char *what = def->drive != HAP_DRIVE_LOCKSTEP      ? "another drive than lockstep"
                     : def->model != HAP_MODEL_CONTACT     ? "another model than contact"
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
  hapi_exchange *exchange = session->ferry.exchange;
  if (exchange == NULL && ferry->side == HAPI_SIDE_BOTH &&
      hapi_exchange_create(hapi_exchange_capacity(session->exchange), &exchange) < HAP_OK) {
    return hapi_session_fail(session, HAP_ERROR_MEMORY, "no memory for the messages of physics");
  }
  if (exchange != NULL) {
    hapi_physics_set_exchange(session->physics, exchange);
  }
  session->ferry = *ferry;
  session->ferry.exchange = exchange;
  return HAP_OK;
}

/* ---- the ends ---- */

static void far_before_cycle(void *of, int64_t now_ns)
{
  hapi_world_end_receive(&((hapi_far *)of)->world, now_ns);
}

static void far_after_cycle(void *of, int64_t now_ns)
{
  hapi_world_end_send(&((hapi_far *)of)->world, now_ns);
}

static void far_before_tick(void *of, int64_t now_ns)
{
  hapi_loop_end_receive(&((hapi_far *)of)->loop, now_ns);
}

static void far_after_tick(void *of, int64_t now_ns)
{
  hapi_loop_end_send(&((hapi_far *)of)->loop, now_ns);
}

static void far_renew(void *of)
{
  hapi_physics_renew_loop(of);
}

static hap_status far_fill(const hap_session *session, hapi_far *far)
{
  const hap_session_def *def = &session->def;
  hapi_exchange *apart = session->ferry.exchange;
  const hapi_terms terms = {.look_ahead_s = def->expert->look_ahead,
                            .period_s = 1.0 / def->physics_hz,
                            .haptic_hz = def->haptic_hz,
                            .capacity = *hapi_exchange_capacity(session->exchange)};
  far->world.terms = far->loop.terms = terms;
  far->world.exchange = apart != NULL ? apart : session->exchange;
  far->world.renew = far_renew;
  far->world.renew_of = session->physics;
  far->loop.exchange = session->exchange;
  return session->ferry.side != HAPI_SIDE_LOOP ? hapi_world_end_begin(&far->world) : HAP_OK;
}

hap_status hapi_session_set_far(hap_session *session, hapi_side side, hapi_far *far)
{
  hapi_ferry ferry = {.side = side, .of = far};
  if (side != HAPI_SIDE_LOOP) {
    ferry.before_cycle = far_before_cycle;
    ferry.after_cycle = far_after_cycle;
  }
  if (side != HAPI_SIDE_WORLD) {
    ferry.before_tick = far_before_tick;
    ferry.after_tick = far_after_tick;
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
}
