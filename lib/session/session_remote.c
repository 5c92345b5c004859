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
  uint32_t count; /* of codecs: one for each client that there may be, or the client's own */
  hapi_wire_codec *wires;
  hapi_codec *codecs;
};

static void remote_discard(hapi_remote *own)
{
  for (uint32_t i = 0; own->wires != NULL && i < own->count; ++i) {
    hapi_wire_codec_finish(&own->wires[i]);
  }
  hapi_free(own->wires);
  hapi_free(own->codecs);
  hapi_free(own);
}

static void remote_free(hap_session *session)
{
  hapi_far_finish(&session->ferry.own->far);
  remote_discard(session->ferry.own);
}

/* NULL: no memory. A world has it for a client once that is there. */
static hapi_remote *remote_make(const hapi_capacity *capacity, hapi_side side)
{
  bool world = side == HAPI_SIDE_WORLD;
  hapi_remote *own = hapi_alloc(sizeof *own);
  if (own == NULL) {
    return NULL;
  }
  own->count = world ? capacity->pointers : 1;
  own->wires = hapi_alloc_array(own->count, sizeof *own->wires);
  own->codecs = hapi_alloc_array(own->count, sizeof *own->codecs);
  bool good = own->wires != NULL && own->codecs != NULL;
  for (uint32_t i = 0; i < own->count && good; ++i) {
    hapi_wire_codec_prepare(&own->wires[i], capacity, world, &own->codecs[i]);
    good = world || hapi_wire_codec_open(&own->wires[i]) >= HAP_OK;
  }
  if (!good) {
    remote_discard(own);
    return NULL;
  }
  return own;
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
  hapi_remote *own = remote_make(hapi_exchange_capacity(session->exchange), side);
  if (own == NULL) {
    return hapi_session_fail(session, HAP_ERROR_MEMORY, "no memory for a far loop");
  }
  own->far.world.end = own->far.loop.end = (hapi_end){.link = link, .codec = own->codecs[0]};
  own->far.world.codecs = own->codecs;
  own->far.world.room = own->count;
  hap_status status = hapi_session_set_far(session, side, &own->far);
  if (status >= HAP_OK || session->ferry.far == &own->far) {
    session->ferry.own = own;
    session->ferry.free = remote_free;
  } else {
    remote_discard(own);
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
  hapi_world_end_limit(&session->ferry.own->far.world, &(hapi_limits){force, speed});
  return HAP_OK;
}

/* ---- how it goes ---- */

static void world_tell(const hapi_world_end *world, hap_remote_state *out)
{
  out->joined = world->joined;
  out->joins = world->clients;
  out->look_ahead = world->terms.look_ahead_s;
  out->bounded = world->bounded;
  out->turned_away = world->turned_away;
  out->shared = world->shares.shared;
}

static void loop_tell(const hapi_loop_end *loop, hap_remote_state *out)
{
  out->joined = loop->end.joined && loop->agreed;
  out->joins = loop->number > 0 || loop->agreed;
  out->look_ahead = loop->terms.look_ahead_s;
  out->turned_away = loop->turned_away;
  out->drawn = loop->agreed && loop->draws;
  out->left_out = loop->hands.left_out;
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
