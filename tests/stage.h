/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STAGE_H
#define HAPODE_TESTS_STAGE_H

/* A small world with a session over it, for the tests of sessions. */

#include <stdatomic.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/clock.h"
#include "tests/tap.h"
#include "tools/session_defs.h"

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
  dMass mass;
  dBodyID body = dBodyCreate(s->world);
  dGeomID geom = dCreateBox(s->space, 0.1, 0.1, 0.1);
  dMassSetBoxTotal(&mass, 1.0, 0.1, 0.1, 0.1);
  dBodySetMass(body, &mass);
  dGeomSetBody(geom, body);
  dBodySetPosition(body, x, 0.0, 0.0);
  if (out_geom != NULL) {
    *out_geom = geom;
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
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
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

/* Created and started; false when not. */
static inline bool stage_run(stage *s, hap_drive drive)
{
  stage_init(s, drive);
  return stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK;
}

static inline void stage_end(stage *s)
{
  if (s->world == NULL) { /* closed already */
    return;
  }
  hap_session_destroy(s->session);
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
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

/* Created and started; NULL when not. */
static inline stage *stage_running(hap_drive drive)
{
  stage *s = stage_new(drive);
  bool runs = stage_create(s) == HAP_OK && hap_session_start(s->session) == HAP_OK;
  return runs ? s : NULL;
}

static inline hap_stats stats_of(const stage *s)
{
  hap_stats stats;
  memset(&stats, 0, sizeof stats);
  CHECK(hap_session_stats(s->session, &stats, sizeof stats) == HAP_OK);
  return stats;
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
