/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_RANDOM_HANDS_H
#define HAPODE_BENCH_RANDOM_HANDS_H

/* Random calls of what an application does with a hand: settings, clutch, own forces and functions,
 * grabs, outputs, and what is asked of touches and events. Values are within their ranges but for
 * one call in sixteen. */

#include <stdint.h>

#include <hapode/forces.h>
#include <hapode/ode.h>

#define RANDOM_FORCES 24

typedef struct random_hands {
  uint64_t dice; /* of its own: what else a program does stays as it was */
  uint64_t hash; /* of all answers */
  uint64_t bad;  /* answers that the headers do not allow */
  struct {
    hap_pointer_id pointer;
    hap_force_id id; /* 0: none */
  } forces[RANDOM_FORCES];
} random_hands;

void random_hands_begin(random_hands *h, uint64_t seed);

/* One call, under no lock. body: NULL, or one that the session may know. */
void random_hands_change(random_hands *h, hap_session *session, hap_pointer_id pointer,
                         dBodyID body);

/* What is told of hands and touches, into the hash. */
void random_hands_ask(random_hands *h, hap_session *session, hap_pointer_id pointer);

#endif
