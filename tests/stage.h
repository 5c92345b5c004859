/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STAGE_H
#define HAPODE_TESTS_STAGE_H

/* A small world with a session over it, for the tests of sessions. */

#include <stdatomic.h>

#include "base/clock.h"
#include "tests/tap.h"

#include "tests/ode_world.h"

#define MS 1000000LL

/* ---- a world with a cube of 1 kg at the origin, no gravity, no floor ---- */

typedef struct stage {
  dWorldID world;
  dSpaceID space;
  dBodyID cube;
  dGeomID geom;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_session *session;
  hap_detail detail;
  atomic_int steps;
  void (*in_step)(struct stage *s);
  int seen[8];
} stage;

static inline dBodyID add_cube(stage *s, double x, dGeomID *out_geom)
{
  dBodyID body = ode_box(s->world, s->space, 1.0, AT(0.1, 0.1, 0.1), AT(x, 0.0, 0.0));
  if (out_geom != NULL) {
    *out_geom = dBodyGetFirstGeom(body);
  }
  return body;
}

static inline void before_step(void *user, double step_s)
{
  stage *s = user;
  (void)step_s;
  atomic_fetch_add(&s->steps, 1);
  if (s->in_step != NULL) {
    s->in_step(s);
  }
}

static inline void stage_init(stage *s, hap_drive drive)
{
  memset(s, 0, sizeof *s);
  ode_world_make(0.0, &s->world, &s->space);
  s->cube = add_cube(s, 0.0, &s->geom);
  session_defs_init(&s->def, &s->expert, &s->research);
  s->def.drive = drive;
  s->def.physics_hz = 50.0;
  s->def.rt_priority = 0;
  hap_ode_def_init(&s->ode, sizeof s->ode);
  s->ode.world = s->world;
  s->ode.space = s->space;
  s->ode.before_step = before_step;
  s->ode.user = s;
}

static inline hap_status stage_create(stage *s)
{
  return hap_session_create(&s->def, &s->ode, &s->session, &s->detail);
}

/* Created and started. */
static inline void stage_run(stage *s, hap_drive drive)
{
  stage_init(s, drive);
  s->session = session_make(&s->def, &s->ode);
  session_run(s->session);
}

static inline void stage_end(stage *s)
{
  ode_world_end(s->session, s->world, s->space);
  s->world = NULL;
}

static inline void stage_end_owned(void *owned)
{
  stage_end(owned);
}

/* Closed when the test has ended. */
static inline stage *stage_new(hap_drive drive)
{
  stage *s = tap_own(sizeof *s, stage_end_owned);
  stage_init(s, drive);
  return s;
}

/* Created and started. */
static inline stage *stage_running(hap_drive drive)
{
  stage *s = tap_own(sizeof *s, stage_end_owned);
  stage_run(s, drive);
  return s;
}

static inline hap_stats stats_of(const stage *s)
{
  return session_stats(s->session);
}

static inline const char *detail_of(stage *s)
{
  CHECK(hap_session_detail(s->session, &s->detail) == HAP_OK);
  return s->detail.text;
}

static inline bool text_has(const char *text, const char *part)
{
  bool found = strstr(text, part) != NULL;
  if (!found) {
    printf("# \"%s\" does not say \"%s\"\n", text, part);
  }
  return found;
}

static inline void sleep_ms(int ms)
{
  hapi_clock_sleep_until(hapi_clock_now() + ms * MS);
}

#endif
