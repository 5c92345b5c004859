/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_STORM_H
#define HAPODE_BENCH_STORM_H

/* A session over a world that several threads change all the time, with hands in the middle of
 * it that come and go. For the bench and the tests. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/ode.h>
#include <hapode/stats.h>

#define STORM_EDITORS_MAX 4
#define STORM_FORCE 10.0 /* N, of its devices */
#define STORM_SLEW 5.0   /* N a tick at 1 kHz: the default slew limit of such a device */
#define STORM_SPOTS 16   /* places where hands are */

/* Whether the session is told before a body goes. */
typedef enum storm_telling {
  STORM_TELLS = 0,
  STORM_TELLS_NOT,
  STORM_TELLS_HALF
} storm_telling;

typedef struct storm_def {
  hap_drive drive;
  hap_model model;
  hap_surface_fn surface; /* may be NULL */
  double seconds;
  double physics_hz;
  uint64_t seed;
  int editors;      /* threads that lock and edit; LOCKSTEP: must be 0 */
  double editor_hz; /* of each; 0: with pauses of up to 6 ms */
  bool posts;       /* a thread that posts edits; LOCKSTEP: the only one posts */
  int hands;        /* at most STORM_SPOTS; half of them with a device */
  bool churn;       /* they come and go */
  bool restarts;    /* the session is stopped and started again in the middle */
  int rt_priority;
  storm_telling telling;
  void (*ticked)(hap_session *session, void *arg); /* LOCKSTEP: after each tick; may be NULL */
  void *ticked_arg;
} storm_def;

typedef struct storm_result {
  hap_stats stats; /* since the last start */
  uint64_t edits;
  uint64_t untold;
  uint64_t lost;       /* in all runs */
  uint64_t faults;     /* but of a machine that keeps the loop from running */
  uint64_t unexpected; /* answers of the session that should not be */
  uint64_t posts_run;
  uint64_t posts_taken;
  uint64_t posts_refused; /* the queue was full */
  uint64_t tries_in_vain; /* of hap_session_try_lock */
  uint64_t hands_added;
  uint64_t writes;     /* of all devices */
  uint64_t bad;        /* forces that no device should get */
  uint64_t unreleased; /* devices that had a force when they were stopped or let go */
  double peak;         /* N */
  double steepest;     /* N, between two writes */
  double wait_ms_p50;  /* of the editors' waits for the lock */
  double wait_ms_p99;
} storm_result;

hap_status storm_run(const storm_def *def, storm_result *out, hap_detail *detail);

#endif
