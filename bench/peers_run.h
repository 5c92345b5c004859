/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_PEERS_RUN_H
#define HAPODE_BENCH_PEERS_RUN_H

/* One run of hapode-bench peers: a world, the hand's whole path, an engine at the rate of the hand
 * or a session. */

#include "bench/bench.h"
#include "bench/peer.h"

typedef struct peers_run {
  double tick_s;
  size_t count;       /* ticks, from the end of settling on */
  double (*force)[3]; /* N, on the hand, in each of them */
  double *tick_us;    /* us, wall clock: of each step of the engine or tick of the session */
  double us_per_ms;   /* us of processor a simulated ms, all that was done in these ticks */
  struct {            /* us a simulated ms by the clock; of an engine NaN */
    double contact;   /* contact passes */
    double physics;   /* cycles: ODE's step, neighbours, range, messages */
  } parts;
  double rest;   /* m, farthest way of a box from its begin while all settled */
  size_t asleep; /* boxes, at the end of settling */
  size_t owned;  /* boxes of the loop at the end; of an engine 0 */
  bool cut;      /* of a session: its range ends there, and more boxes touch */
} peers_run;

hap_status peers_run_engine(bench *b, const peer_engine *engine, const peer_world *world,
                            const peer_setting *setting, peers_run *out);

typedef struct peers_session_setting {
  double physics_hz;
  double haptic_hz;
  bool may_sleep;
  bool to_the_end;  /* its own truth: accuracy 1, contact passes at 1 kHz */
  int range_hops;   /* of the range; 0: as by default */
  int range_bodies; /* of the range at most; 0: as by default */
  int contacts;     /* that there are places for; 0: as by default */
} peers_session_setting;

/* Model CONTACT at all defaults but for these, in drive LOCKSTEP: everything is done by the calling
 * thread. */
hap_status peers_run_session(bench *b, const peer_world *world,
                             const peers_session_setting *setting, peers_run *out);

void peers_run_free(peers_run *run); /* zeroed allowed */

/* RMS of the difference / RMS of the truth; NaN without a truth. */
double peers_run_error(const peers_run *run, const peers_run *truth);

double peers_run_peak(const peers_run *run);

/* N, the force when the hand is this deep beyond where the box began: friction still holds it. */
#define PEERS_FIRST_DEPTH 2e-4 /* m */
double peers_run_first(const peer_world *world, const peers_run *run);

#endif
