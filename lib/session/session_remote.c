/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/remote.h>

#include "base/alloc.h"
#include "base/def.h"
#include "base/log.h"
#include "remote/wire_codec.h"
#include "session/session_internal.h"

/* A session of one side, for applications. */

struct hapi_remote {
  hapi_far far;
  hapi_wire_codec codec;
};

static void remote_free(hap_session *session)
{
  hapi_remote *own = session->ferry.own;
  hapi_far_finish(&own->far);
  hapi_wire_codec_finish(&own->codec);
  hapi_free(own);
}

static hap_status remote_check(const hap_session *session, const hap_link *link, hapi_side side)
{
  if (link == NULL) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT, "the link is NULL");
  }
  if (session->ferry.side != HAPI_SIDE_BOTH || session->ferry.of != NULL) {
    return hapi_session_fail(session, HAP_ERROR_STATE, "the session has a link already");
  }
  if (session->recorder != NULL) {
    return hapi_session_fail(session, HAP_ERROR_UNSUPPORTED,
                             "a recording does not go with a loop far from its world");
  }
  if (side == HAPI_SIDE_WORLD && hapi_haptic_has_pointers(session->haptic)) {
    return hapi_session_fail(
        session, HAP_ERROR_STATE,
        "the session has a pointer: hands are those of the session that joins");
  }
  if (side == HAPI_SIDE_LOOP && session->def.drive == HAP_DRIVE_FRAME) {
    return hapi_session_fail(session, HAP_ERROR_UNSUPPORTED,
                             "drive FRAME steps a world, and this session has none: use THREADS");
  }
  return HAP_OK;
}

static hap_status remote_open(hap_session *session, hap_link *link, hapi_side side)
{
  HAPI_TRY(remote_check(session, link, side));
  hapi_remote *own = hapi_alloc(sizeof *own);
  hapi_codec codec;
  bool world = side == HAPI_SIDE_WORLD;
  const hapi_capacity *capacity = hapi_exchange_capacity(session->exchange);
  if (own == NULL || hapi_wire_codec_init(&own->codec, capacity, world, &codec) < HAP_OK) {
    hapi_free(own);
    return hapi_session_fail(session, HAP_ERROR_MEMORY, "no memory for a far loop");
  }
  const hapi_end end = {.link = link, .codec = codec};
  own->far.world.end = own->far.loop.end = end;
  hap_status status = hapi_session_set_far(session, side, &own->far);
  if (status >= HAP_OK || session->ferry.far == &own->far) {
    session->ferry.own = own;
    session->ferry.free = remote_free;
  } else {
    hapi_wire_codec_finish(&own->codec);
    hapi_free(own);
  }
  return status;
}

hap_status hap_session_serve(hap_session *session, hap_link *link)
{
  HAPI_TRY(hapi_session_may_change(session));
  return remote_open(session, link, HAPI_SIDE_WORLD);
}

hap_status hap_session_connect(hap_session *session, hap_link *link)
{
  HAPI_TRY(hapi_session_may_change(session));
  return remote_open(session, link, HAPI_SIDE_LOOP);
}

hap_status hap_session_set_client_limits(hap_session *session, double force, double speed)
{
  HAPI_TRY(hapi_session_may_change(session));
  if (!(force >= 0.0 && force <= 1e9 && speed >= 0.0 && speed <= 1e9)) { /* false for NaN */
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "limits of %g N and %g m/s: from 0 to 1e9 are possible", force, speed);
  }
  if (session->ferry.own == NULL || session->ferry.side != HAPI_SIDE_WORLD || session->started) {
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "limits are for a session that is served and not started");
  }
  hapi_world_end *world = &session->ferry.own->far.world;
  world->terms.limits = world->bound.most = (hapi_limits){force, speed};
  return HAP_OK;
}

/* ---- how it goes ---- */

static void world_tell(const hapi_world_end *world, hap_remote_state *out)
{
  out->joined = world->end.joined;
  out->joins = world->clients;
  out->look_ahead = world->terms.look_ahead_s;
  out->bounded = world->bounded;
  out->turned_away = world->turned_away;
}

static void loop_tell(const hapi_loop_end *loop, hap_remote_state *out)
{
  out->joined = loop->end.joined && loop->agreed;
  out->joins = loop->number > 0 || loop->agreed;
  out->look_ahead = loop->terms.look_ahead_s;
  out->turned_away = loop->turned_away;
  out->drawn = loop->agreed && loop->draws;
  if (loop->stamps.count > 0) {
    int64_t trip_ns;
    out->clock_ahead_s = 1e-9 * (double)hapi_stamps_offset(&loop->stamps, &trip_ns);
    out->round_trip_s = 1e-9 * (double)trip_ns;
  }
}

hap_status hap_session_remote_state(hap_session *session, hap_remote_state *out, size_t size_of_out,
                                    hap_detail *detail)
{
  if (session == NULL || out == NULL || size_of_out < sizeof out->size) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  if (session->ferry.own == NULL) {
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "the session is neither served nor connected");
  }
  hapi_far *far = &session->ferry.own->far;
  bool world = session->ferry.side == HAPI_SIDE_WORLD;
  hap_remote_state state = {.size = sizeof state};
  pthread_mutex_lock(&far->lock);
  const hapi_end *end = world ? &far->world.end : &far->loop.end;
  if (world) {
    world_tell(&far->world, &state);
  } else {
    loop_tell(&far->loop, &state);
  }
  state.refused = end->refused;
  state.failed = end->failed;
  (void)hap_link_get_figures(end->link, &state.figures, sizeof state.figures);
  if (detail != NULL) {
    *detail = end->detail;
  }
  pthread_mutex_unlock(&far->lock);
  return hapi_struct_give(&state, sizeof state, out, size_of_out);
}
