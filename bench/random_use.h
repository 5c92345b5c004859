/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_RANDOM_USE_H
#define HAPODE_BENCH_RANDOM_USE_H

/* A program of random calls to ODE and to the public headers, over one session in lockstep. The
 * seed decides all of it, so that two runs of a seed must give the same bits, whatever addresses
 * the heap gives. It tells the session of all that docs/editing.md asks for. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>
#include <hapode/status.h>

typedef struct random_use_def {
  uint64_t seed;
  uint32_t ticks;
  void (*ticked)(hap_session *session, void *arg); /* after each advance; may be NULL */
  void *ticked_arg;
  bool chatty; /* every edit as a line of stderr */
} random_use_def;

typedef struct random_use_result {
  uint64_t trace_hash; /* of all that the loop did, over all starts */
  uint64_t world_hash; /* of ODE's bodies after each advance, and of answers of the session */
  uint64_t probe_steps;
  uint64_t edits;
  uint64_t contact_ticks;
  uint64_t faults;
  uint64_t lost;       /* bodies whose marks were all overwritten in a step */
  uint64_t unexpected; /* answers of the session that should not be: 0 */
} random_use_result;

/* dInitODE2 was called. */
hap_status random_use_run(const random_use_def *def, random_use_result *out, hap_detail *detail);

#endif
