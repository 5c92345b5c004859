/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_FAR_RIG_H
#define HAPODE_TESTS_FAR_RIG_H

/* A session with a cube on a floor, and sessions with a hand at the other end of a link. */

#include "session/session_internal.h"
#include "tests/ode_world.h"
#include "tests/raw_codec.h"
#include "tests/shifted_link.h"

#define MS 1000000LL
#define STEP_HZ 50.0
#define ROUND_TRIP 0.1 /* s */
#define WEIGHT (0.2 * 9.81)

/* ---- the world's session ---- */

#define SERVER_ROOM 2 /* clients */

typedef struct server {
  dWorldID world;
  dSpaceID space;
  dBodyID cube; /* 5 cm, 0.2 kg, on the floor */
  hap_session *session;
  hap_link *link;
  hapi_far far;
  raw_codec raw[SERVER_ROOM];
  hapi_codec codecs[SERVER_ROOM];
} server;

static inline bool cube_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.1};
  return true;
}

static inline void session_def_fill(hap_session_def *def, hap_expert_def *expert,
                                    hap_research_def *research)
{
  session_defs_init(def, expert, research);
  def->drive = HAP_DRIVE_LOCKSTEP;
  def->physics_hz = STEP_HZ;
  def->max_bodies = 8;
  def->max_contacts = 64;
  expert->look_ahead = ROUND_TRIP + 0.05;
}

static inline void server_finish(void *owned)
{
  server *s = owned;
  ode_world_end(s->session, s->world, s->space);
  hapi_far_finish(&s->far);
  hap_link_close(s->link);
  for (int i = 0; i < SERVER_ROOM; ++i) {
    raw_finish(&s->raw[i]);
  }
}

static inline server *server_open_for(hap_surface_fn surface, uint32_t room)
{
  server *s = tap_own(sizeof *s, server_finish);
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  ode_world_make(9.81, &s->world, &s->space);
  ode_world_stiffen(s->world, 100);
  dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
  s->cube = ode_box(s->world, s->space, 0.2, AT(0.05, 0.05, 0.05), AT(0.0, 0.0, 0.025));
  session_def_fill(&def, &expert, &research);
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = s->world;
  ode.space = s->space;
  ode.surface = surface;
  s->session = session_make(&def, &ode);
  REQUIRE(hap_link_local_serve(&s->link, NULL) == HAP_OK);
  for (int i = 0; i < SERVER_ROOM; ++i) {
    REQUIRE(raw_init(&s->raw[i], s->session->exchange, true));
    s->codecs[i] = raw_codec_of(&s->raw[i]);
  }
  s->far.world.end = (hapi_end){.link = s->link};
  s->far.world.codecs = s->codecs;
  s->far.world.room = room;
  REQUIRE(hapi_session_set_far(s->session, HAPI_SIDE_WORLD, &s->far) == HAP_OK);
  session_run(s->session);
  return s;
}

static inline server *server_open_with(hap_surface_fn surface)
{
  return server_open_for(surface, 1);
}

static inline server *server_open(void)
{
  return server_open_with(cube_surface);
}

/* ---- the hand's session ---- */

typedef struct client {
  dWorldID world; /* empty */
  dSpaceID space;
  hap_session *session;
  hap_pointer_id hand;
  hap_link *link;
  shifted clock;
  hapi_far far;
  raw_codec codec;
} client;

static inline void client_finish(void *owned)
{
  client *c = owned;
  ode_world_end(c->session, c->world, c->space);
  hapi_far_finish(&c->far);
  hap_link_close(c->link);
  raw_finish(&c->codec);
}

/* Its clock begins at 0, whatever the server's says. */
static inline client *client_open(server *s, const char *name, double haptic_hz, int32_t max_bodies)
{
  client *c = tap_own(sizeof *c, client_finish);
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_link_path_def path;
  session_def_fill(&def, &expert, &research);
  def.haptic_hz = haptic_hz;
  def.max_bodies = max_bodies;
  ode_world_make(0.0, &c->world, &c->space);
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = c->world;
  ode.space = c->space;
  c->session = session_make(&def, &ode);
  hap_link_path_def_init(&path, sizeof path);
  path.delay = 0.5 * ROUND_TRIP;
  c->clock.ahead_ns = hap_session_now(s->session);
  REQUIRE(hap_link_local_connect(s->link, name, &path, &path, &c->clock.inner, NULL) == HAP_OK);
  REQUIRE(hap_link_create(&shifted_ops, &c->clock, &c->link, NULL) == HAP_OK);
  REQUIRE(raw_init(&c->codec, c->session->exchange, false));
  c->far.loop.end = (hapi_end){.link = c->link, .codec = raw_codec_of(&c->codec)};
  REQUIRE(hapi_session_set_far(c->session, HAPI_SIDE_LOOP, &c->far) == HAP_OK);
  hap_pointer_def hand;
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = 0.01;
  hand.stiffness = 1000.0;
  hand.friction = 0.5;
  REQUIRE(hap_pointer_add(c->session, &hand, &c->hand) == HAP_OK);
  session_run(c->session);
  return c;
}

static inline void client_put(client *c, double x, double z, double vx)
{
  const hap_pose pose = {{x, 0.0, z}, {1.0, 0.0, 0.0, 0.0}};
  const hap_twist twist = {{vx, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  CHECK(hap_pointer_set_target(c->session, c->hand, &pose, &twist) == HAP_OK);
}

static inline void client_feel(const client *c, double out[3])
{
  hap_pointer_state state;
  CHECK(hap_pointer_get(c->session, c->hand, &state, sizeof state) >= HAP_OK);
  memcpy(out, state.wrench.force, 3 * sizeof(double));
}

/* Both, tick by tick. NULL: it has gone, or is not there yet. */
static inline void ends_run(server *s, client *c, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    CHECK(c == NULL || hap_session_advance(c->session, 1) == HAP_OK);
    CHECK(s == NULL || hap_session_advance(s->session, 1) == HAP_OK);
  }
}

/* Presses 3 mm into the top for a second. N, up. */
static inline double hand_press(server *s, client *c)
{
  double force[3];
  client_put(c, 0.0, 0.2, 0.0);
  ends_run(s, c, 500);
  client_put(c, 0.0, 0.057, 0.0);
  ends_run(s, c, 1000);
  client_feel(c, force);
  return force[2];
}

static inline int64_t newest_cycle(const server *s)
{
  const int64_t step_ns = 20 * MS;
  return (hap_session_now(s->session) - MS) / step_ns * step_ns;
}

#endif
