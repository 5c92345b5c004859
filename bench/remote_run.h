/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_REMOTE_RUN_H
#define HAPODE_BENCH_REMOTE_RUN_H

/* A scene of hapode-bench accuracy whose loop is far from its world: both in one process, on the
 * virtual clock, with nothing but a link between them. */

#include "bench/accuracy.h"
#include "remote/wire_codec.h"
#include "session/session_internal.h"

#define REMOTE_PHYSICS_HZ 60.0
#define REMOTE_LATE_S 1.0    /* the hand begins to move so long after the start */
#define REMOTE_MARGIN_S 0.05 /* looked ahead beyond the round trip: two losses in a row */

/* The way of the messages, the same in both directions. */
typedef struct remote_way {
  double delay_s;
  double jitter_s;
  double loss;
  double duplicate;
  uint64_t seed;
} remote_way;

/* Makes codecs for the world's end and the loop's; NULL stands for those of the library. */
typedef struct remote_codecs {
  hap_status (*open)(void *user, const hapi_exchange *exchange, hapi_codec out[2]);
  void (*close)(void *user);
  void *user;
} remote_codecs;

typedef struct remote_run {
  const accuracy_scene *scene;
  remote_way way;
  double look_ahead_s; /* negative: the round trip, its jitter and REMOTE_MARGIN_S */
  double seconds;      /* 0: the scene's */
  const remote_codecs *codecs;

  /* What came of it. */
  double bytes_down; /* a second of simulated time, payload */
  double bytes_up;
  double age_s; /* of a model, the largest */
  uint64_t refused;
  uint64_t failed;
  uint64_t bounded; /* states that the world's end did not take, as of a hand that does too much */
  uint64_t old;
  hap_detail detail;

  /* While it runs. */
  hapi_far far;
  hapi_wire_codec wire[2];
  hap_link *server;
  hap_link *client;
} remote_run;

double remote_look_ahead(const remote_run *run); /* s, of physics */

/* NULL: there is none of that name. */
const accuracy_scene *remote_scene(const char *name);

/* Whether something touches a hand before that begins to move: then nobody may have joined yet. */
bool remote_is_early(const accuracy_motion *reference);

/* ODE alone at 1 kHz, with the same hand. */
hap_status remote_reference(bench *b, const accuracy_scene *which, double seconds,
                            accuracy_motion *out);
/* Loop and world in one session, without anything between them. */
hap_status remote_beside(bench *b, const accuracy_scene *which, accuracy_motion *out);
hap_status remote_apart(bench *b, remote_run *run, accuracy_motion *out);

#endif
