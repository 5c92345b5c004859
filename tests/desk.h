/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_DESK_H
#define HAPODE_TESTS_DESK_H

/* A world, a session in lockstep, and a hand without a device that is led. By the public headers
 * alone. Include after tap.h. */

#include <time.h>

#include "tests/files.h"
#include "tests/ode_world.h"

#define T 1e-3 /* s, of a tick */
#define STIFFNESS 1000.0
#define RADIUS 0.01

typedef struct desk {
  dWorldID world;
  dSpaceID space;
  hap_session_def def;
  hap_ode_def ode;
  hap_session *session;
  hap_player *player; /* of a replay */
  hap_pointer_def hand_def;
  hap_pointer_id hand;
  double at[3];
  double velocity[3];
} desk;

static inline void desk_end(void *owned)
{
  desk *d = owned;
  ode_world_end(d->session, d->world, d->space);
  hap_player_close(d->player);
}

static inline desk *desk_new(double gravity, hap_model model)
{
  desk *d = tap_own(sizeof *d, desk_end);
  ode_world_make(gravity, &d->world, &d->space);
  ode_world_stiffen(d->world, 50);
  hap_session_def_init(&d->def, sizeof d->def);
  d->def.drive = HAP_DRIVE_LOCKSTEP;
  d->def.model = model;
  hap_ode_def_init(&d->ode, sizeof d->ode);
  d->ode.world = d->world;
  d->ode.space = d->space;
  hap_pointer_def_init(&d->hand_def, sizeof d->hand_def);
  d->hand_def.stiffness = STIFFNESS;
  d->hand_def.radius = RADIUS;
  d->hand_def.max_force = 1000.0;
  return d;
}

static inline void hand_lead(desk *d)
{
  const hap_pose pose = {{d->at[0], d->at[1], d->at[2]}, {1.0, 0.0, 0.0, 0.0}};
  const hap_twist twist = {{d->velocity[0], d->velocity[1], d->velocity[2]}, {0.0, 0.0, 0.0}};
  REQUIRE(hap_pointer_set_target(d->session, d->hand, &pose, &twist) == HAP_OK);
}

static inline void desk_run(desk *d, double x, double y, double z)
{
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[0] = x;
  d->at[1] = y;
  d->at[2] = z;
  hand_lead(d);
  session_run(d->session);
}

/* The hand stands still. */
static inline void desk_wait(desk *d, int ticks)
{
  memset(d->velocity, 0, sizeof d->velocity);
  hand_lead(d);
  REQUIRE(hap_session_advance(d->session, (uint64_t)ticks) >= HAP_OK);
}

static inline void desk_move(desk *d, double x, double y, double z, int ticks)
{
  const double way[3] = {x, y, z};
  for (int i = 0; i < 3; ++i) {
    d->velocity[i] = way[i] / (ticks * T);
  }
  for (int k = 0; k < ticks; ++k) {
    for (int i = 0; i < 3; ++i) {
      d->at[i] += way[i] / ticks;
    }
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
  }
}

/* A hand in the air at a place, whose ramp-in is over. */
static inline desk *desk_in_air(double x, double y, double z)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  desk_run(d, x, y, z);
  desk_wait(d, 40);
  return d;
}

static inline hap_pointer_state desk_state(const desk *d)
{
  hap_pointer_state state;
  REQUIRE(hap_pointer_get(d->session, d->hand, &state, sizeof state) == HAP_OK);
  return state;
}

/* In real time, to a file of that name. The caller starts it, and stops it at the end. */
static inline void desk_record(desk *d, const char *name, double height)
{
  hap_detail detail = {""};
  hap_record_def file;
  REQUIRE(folder_make());
  hap_record_def_init(&file, sizeof file);
  file.path = folder_path(name);
  d->def.drive = HAP_DRIVE_THREADS;
  d->def.rt_priority = 0;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_session_record(d->session, &file, &detail) == HAP_OK);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  d->at[2] = height;
  hand_lead(d);
}

/* A session that plays that file, over the same things. */
static inline void desk_replay(desk *d, const char *name)
{
  hap_detail detail = {""};
  hap_expert_def expert;
  hap_research_def research;
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  REQUIRE(hap_player_open(folder_path(name), HAP_PLAY_WHOLE, &d->player, &detail) >= HAP_OK);
  REQUIRE(hap_player_get_def(d->player, &d->def, &expert, &research) >= HAP_OK);
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_session_play(d->session, d->player, &detail) >= HAP_OK);
}

static inline void desk_play(desk *d)
{
  hap_detail detail = {""};
  hap_status status = HAP_OK;
  session_run(d->session);
  while (status == HAP_OK) {
    status = hap_session_advance(d->session, 100);
  }
  (void)hap_session_detail(d->session, &detail);
  REQUIRE_SAY(status == HAP_END, "%s", detail.text);
}

/* Through to its end: the same ticks, and the same wrench on the hand as in that state. */
static inline void desk_replay_compare(desk *d, hap_pointer_id hand, const hap_pointer_state *last)
{
  hap_play_difference difference;
  hap_pointer_state again;
  desk_play(d);
  REQUIRE(hap_player_difference(d->player, &difference, sizeof difference) == HAP_OK);
  CHECK_SAY(difference.what == HAP_DIFFERENCE_NONE, "%s", difference.text);
  REQUIRE(hap_pointer_get(d->session, hand, &again, sizeof again) == HAP_OK);
  CHECK(memcmp(&again.wrench, &last->wrench, sizeof last->wrench) == 0);
  CHECK(memcmp(&again.own, &last->own, sizeof last->own) == 0);
  CHECK(again.stamp_ns == last->stamp_ns);
}

/* In real time. */
static inline void desk_glide(desk *d, double x, double y, double z)
{
  const double way[3] = {x, y, z};
  for (int k = 0; k < 50; ++k) {
    for (int i = 0; i < 3; ++i) {
      d->at[i] += way[i] / 50.0;
    }
    hand_lead(d);
    nanosleep(&(struct timespec){.tv_nsec = 4000000}, NULL);
  }
}

static inline dGeomID floor_add(desk *d)
{
  return dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.0);
}

static inline void check_vector(const double a[3], double x, double y, double z, double tolerance)
{
  CHECK_NEAR(a[0], x, tolerance);
  CHECK_NEAR(a[1], y, tolerance);
  CHECK_NEAR(a[2], z, tolerance);
}

#endif
