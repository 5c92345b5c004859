/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_APP_STAND_H
#define HAPODE_BENCH_APP_STAND_H

/* A world, a session in lockstep and a hand that goes a prescribed way: by the public headers
 * alone, as an application has them. */

#include <hapode/expert.h>
#include <hapode/forces.h>
#include <hapode/ode.h>
#include <hapode/pointer_set.h>
#include <hapode/research.h>
#include <hapode/surface.h>

#include "bench/bench.h"

#define STAND_RADIUS 0.01    /* m, of the pointer */
#define STAND_STIFFNESS 1e3  /* N/m, of contacts */
#define STAND_FORCE_MOST 1e3 /* N: no limit is reached */

typedef struct app_stand {
  bench *bench;
  dWorldID world;
  dSpaceID space;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def hand_def;
  hap_pointer_expert_def hand_expert;
  hap_pointer_research_def hand_research;
  hap_session *session;
  hap_pointer_id hand;
  double at[3];           /* m, of the hand in the tick to come */
  double velocity[3];     /* m/s */
  hap_pointer_state felt; /* of the newest tick */
  hap_device *device;     /* of stand_device; NULL: the hand is led without one */
  double written[3];      /* N, to the device in the newest tick, its frame */
  hap_surface says;       /* of all geoms; says.size 0: they keep the pointer's own */
} app_stand;

/* Defaults; the caller changes them and adds bodies before stand_start. */
void stand_init(bench *b, app_stand *s, double gravity);
dBodyID stand_box(dWorldID world, dSpaceID space, double mass, const double edges[3],
                  const double at[3]);

/* The hand has a device of its own, which is where s->at is and keeps what is written. */
hap_status stand_device(app_stand *s);

/* Session and hand. Between this and stand_run the caller may add textures
 * and own forces. */
hap_status stand_open(app_stand *s);
hap_status stand_run(app_stand *s);

/* A tick at s->at and s->velocity. */
hap_status stand_tick(app_stand *s);
hap_status stand_wait(app_stand *s, int ticks); /* the hand stands */
hap_status stand_glide(app_stand *s, double x, double y, double z, int ticks);

/* Zeroed is fine. */
void stand_finish(app_stand *s);

#endif
