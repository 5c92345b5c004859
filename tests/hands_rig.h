/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_HANDS_RIG_H
#define HAPODE_TESTS_HANDS_RIG_H

/* A world and several hands, by the public API and on the virtual clock: each hand in a session of
 * its own at the other end of a link, or all in the world's session. Include after tap.h. */

#include "tests/ode_world.h"
#include "tests/shifted_link.h"

#define RIG_HANDS 16
#define RIG_PHYSICS_HZ 60.0

typedef struct rig_hand {
  dWorldID world; /* empty */
  dSpaceID space;
  hap_session *session; /* NULL: it is not there; the world's: all hands are there */
  hap_pointer_id id;
  hap_link *link;
  shifted clock; /* it begins at 0 */
} rig_hand;

typedef struct hands_rig {
  dWorldID world;
  dSpaceID space;
  hap_session *session; /* of the world */
  hap_link *link;       /* NULL: hands are in that session */
  double delay;         /* s, one way */
  double jitter;        /* s, 0 at first */
  double loss;          /* likewise; as many come twice */
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  rig_hand hands[RIG_HANDS];
} hands_rig;

static inline void rig_leave(hands_rig *r, int which)
{
  rig_hand *hand = &r->hands[which];
  if (hand->session != NULL && hand->session != r->session) {
    ode_world_end(hand->session, hand->world, hand->space);
    hap_link_close(hand->link);
  }
  hand->session = NULL;
}

static inline void rig_finish(void *owned)
{
  hands_rig *r = owned;
  for (int i = 0; i < RIG_HANDS; ++i) {
    rig_leave(r, i);
  }
  ode_world_end(r->session, r->world, r->space);
  hap_link_close(r->link);
}

/* The application's world is still to be filled. delay negative: all in one session. */
static inline hands_rig *rig_new(double delay, int32_t pointers)
{
  hands_rig *r = tap_own(sizeof *r, rig_finish);
  session_defs_init(&r->def, &r->expert, &r->research);
  r->delay = delay;
  r->def.drive = HAP_DRIVE_LOCKSTEP;
  r->def.physics_hz = RIG_PHYSICS_HZ;
  r->def.max_pointers = pointers;
  r->def.max_bodies = 32;
  r->def.max_contacts = 128;
  r->def.expert = &r->expert;
  r->expert.look_ahead = delay > 0.0 ? 2.0 * delay + 0.05 : delay == 0.0 ? 0.05 : 0.0;
  ode_world_make(9.81, &r->world, &r->space);
  ode_world_stiffen(r->world, 100);
  return r;
}

static inline void rig_serve(hands_rig *r, hap_surface_fn surface)
{
  hap_ode_def ode;
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = r->world;
  ode.space = r->space;
  ode.surface = surface;
  r->session = session_make(&r->def, &ode);
  if (r->delay >= 0.0) {
    REQUIRE(hap_link_local_serve(&r->link, NULL) == HAP_OK);
    REQUIRE(hap_session_serve(r->session, r->link) == HAP_OK);
  }
}

/* Before the world's session runs, where all are in one. */
static inline void rig_join(hands_rig *r, int which, const hap_pointer_def *def)
{
  rig_hand *hand = &r->hands[which];
  char name[24];
  hand->session = r->session;
  if (r->delay >= 0.0) {
    hap_ode_def ode;
    hap_link_path_def path;
    hap_link_path_def_init(&path, sizeof path);
    path.delay = r->delay;
    path.jitter = r->jitter;
    path.loss = path.duplicate = r->loss;
    path.seed = (uint64_t)which + 1;
    ode_world_make(0.0, &hand->world, &hand->space);
    hap_ode_def_init(&ode, sizeof ode);
    ode.world = hand->world;
    ode.space = hand->space;
    hand->session = session_make(&r->def, &ode);
    snprintf(name, sizeof name, "hand %d", which);
    hap_link **inner = &hand->clock.inner;
    hand->clock.ahead_ns = hap_session_now(r->session);
    REQUIRE(hap_link_local_connect(r->link, name, &path, &path, inner, NULL) == HAP_OK);
    REQUIRE(hap_link_create(&shifted_ops, &hand->clock, &hand->link, NULL) == HAP_OK);
    REQUIRE(hap_session_connect(hand->session, hand->link) == HAP_OK);
  }
  REQUIRE(hap_pointer_add(hand->session, def, &hand->id) == HAP_OK);
  if (r->delay >= 0.0) {
    session_run(hand->session);
  }
}

static inline void rig_put(const hands_rig *r, int which, const double at[3], const double v[3])
{
  const rig_hand *hand = &r->hands[which];
  const hap_pose pose = {{at[0], at[1], at[2]}, {1.0, 0.0, 0.0, 0.0}};
  const hap_twist twist = {{v[0], v[1], v[2]}, {0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(hand->session, hand->id, &pose, &twist) == HAP_OK);
}

static inline void rig_feel(const hands_rig *r, int which, double out[3])
{
  hap_pointer_state state;
  const rig_hand *hand = &r->hands[which];
  CHECK(hap_pointer_get(hand->session, hand->id, &state, sizeof state) >= HAP_OK);
  memcpy(out, state.wrench.force, sizeof state.wrench.force);
}

/* A tick of all sessions that there are. */
static inline void rig_tick(const hands_rig *r)
{
  for (int i = 0; i < RIG_HANDS; ++i) {
    hap_session *session = r->hands[i].session;
    if (session != NULL && session != r->session) {
      CHECK(hap_session_advance(session, 1) == HAP_OK);
    }
  }
  CHECK(hap_session_advance(r->session, 1) == HAP_OK);
}

static inline hap_remote_state rig_state(hap_session *session)
{
  hap_remote_state state;
  hap_detail detail;
  CHECK(hap_session_remote_state(session, &state, sizeof state, &detail) == HAP_OK);
  if (detail.text[0] != '\0') {
    printf("# %s\n", detail.text);
  }
  return state;
}

#endif
