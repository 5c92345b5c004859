/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_REMOTE_H
#define HAPODE_REMOTE_H

/* Hands far from the world: a session with a world and no hand, and sessions with a hand and no
 * world, with a link between them (docs/remote.md). Model CONTACT. max_pointers of the world's
 * session is the room for the hands of all sessions: 16 at most.
 *
 * Both sessions have the same max_bodies, max_contacts, max_pointers, max_hull_points and
 * haptic_hz. hap_expert_def.look_ahead of the world's is the round trip and its jitter. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/link.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* [control] The session has the world alone: its hand is in the session of whoever joins. Before
 * start, and without pointers. The link is borrowed: it belongs to the physics thread while the
 * session runs, and is closed after hap_session_destroy. Drives THREADS, FRAME and LOCKSTEP.
 *
 * When a hand's session leaves, its bodies are the world's again. One that finds no room is told
 * so. Bodies that hands of several sessions may touch are moved by a loop of this session, which
 * drives THREADS and FRAME run in a haptic and a contact thread; with max_pointers 1 there is none.
 * A session that is served or connected is started once. What a hand's session does to bodies is
 * bounded by hap_session_set_client_limits.
 *
 * HAP_ERROR_ARGUMENT: a NULL. HAP_ERROR_STATE: started already. HAP_ERROR_UNSUPPORTED: another
 * model than CONTACT, looking back, a contact callback, or a session that is recorded or played;
 * hap_session_detail says which. HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_session_serve(hap_session *session, hap_link *link);

/* [control] The session has hands alone: the world is that of the server at the other end. What
 * the session was created over stays as it is, and may be empty. Before start; the link is borrowed
 * likewise, and belongs to a thread of the session. Drives THREADS and LOCKSTEP.
 *
 * To draw the world, create the session over one that was built as the server's was: the same
 * bodies and shapes in the same order. hap_session_poses and hap_session_roles then tell of its
 * bodies what the server's do: those that the loop moves at once, all others one way late. Bodies
 * that come or go after the start are not told.
 *
 * Model, rate, accuracy, effects and time scale are the server's: to set them here is
 * HAP_ERROR_UNSUPPORTED. Posted edits are run by steps, which this session has none of.
 *
 * Nothing is felt until the server has answered. Without answers the force fades within 100 ms,
 * once the world is older than two steps and the server's look_ahead. When the server has gone, the
 * session is made anew to join again. Errors as above. */
HAP_NODISCARD HAP_API hap_status hap_session_connect(hap_session *session, hap_link *link);

/* What a hand may be able to do that joins, in the world: a session tells what its pointers can,
 * and the smaller counts. */
#define HAP_CLIENT_FORCE 300.0 /* N */
#define HAP_CLIENT_SPEED 10.0  /* m/s */

/* [control] Other limits than HAP_CLIENT_FORCE and HAP_CLIENT_SPEED for whoever joins a served
 * session; before start. A hand then gives bodies no more energy than force x speed over the time,
 * saved up for a second, and no more impulse than force x time, saved up likewise; bodies may pass
 * on what they have. What a hand's session tells beyond that is not taken, and after a second of it
 * the session is turned away (docs/remote.md). HAP_ERROR_ARGUMENT: not from 0 to 1e9.
 * HAP_ERROR_STATE: the session is not served, or was started. */
HAP_API hap_status hap_session_set_client_limits(hap_session *session, double force, double speed);

/* How a session of hap_session_serve or hap_session_connect goes. It has a size and may grow at its
 * end. */
typedef struct hap_remote_state {
  uint32_t size;            /* bytes filled in */
  uint32_t joined;          /* 1: the other session is there, and both fit. World's: how many are */
  uint64_t joins;           /* of hands' sessions so far; of a hand's session 0 or 1 */
  uint64_t refused;         /* messages that were not understood, or from somebody else */
  uint64_t failed;          /* messages that could not be sent */
  double look_ahead;        /* s, of the world's session; before it is known the session's own */
  double round_trip_s;      /* hand's session: the shortest of the last 16; 0: none yet */
  double clock_ahead_s;     /* hand's session: the world's clock - the session's */
  hap_link_figures figures; /* of the link */
  /* World's session: messages of the hand's session beyond its limits, which were not taken */
  uint64_t bounded;
  /* World's session: hands' sessions that were told why they may not join or stay. Hand's session:
   * 1: it was told so, and detail says why */
  uint64_t turned_away;
  /* World's session: bodies in the newest model that hands of several sessions may touch */
  uint64_t shared;
  /* Hand's session: models with a hand of another session for which it had no room; max_pointers is
   * for those as well */
  uint64_t left_out;
  /* Hand's session: 1: the bodies of what it was created over are drawn as the server's are. 0: it
   * is not joined, or its world was built otherwise, and detail says so */
  uint64_t drawn;
} hap_remote_state;

/* [any] HAP_ERROR_ARGUMENT: a NULL, or no room for the size. HAP_ERROR_STATE: the session is
 * neither served nor connected. detail, which may be NULL: why the newest message was refused or
 * failed; "" when none was. */
HAP_API hap_status hap_session_remote_state(hap_session *session, hap_remote_state *out,
                                            size_t size_of_out, hap_detail *detail);

HAP_END_DECLS

#endif
