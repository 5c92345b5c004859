/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_INFLUENCE_SIM_H
#define HAPODE_BENCH_INFLUENCE_SIM_H

/* A world of hapode-bench peers in plain ODE at 1 kHz, of which some bodies may answer otherwise
 * than they would: what hapode-bench influence compares. No code of the library is in it. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bench/peer_ode.h"

#define INFLUENCE_TICK_S 1e-3

/* How a body answers. But for IN and ABSENT it has contacts with bodies that are IN alone, and no
 * gravity: it goes on as it went. */
typedef enum influence_role {
  INFLUENCE_IN,     /* as ODE says */
  INFLUENCE_STAYS,  /* keeps its twist, whatever pushes it */
  INFLUENCE_MASS,   /* by its own mass */
  INFLUENCE_BRACED, /* by its mass, and held by a share of its last push, along that */
  INFLUENCE_ABSENT  /* not at all: what it would push is given */
} influence_role;

typedef struct influence_motion {
  double position[3];
  double quat_wxyz[4];
  double linear[3];
  double angular[3];
} influence_motion;

/* A pair that touches, a < b; of the floor a is -1. */
typedef struct influence_pair {
  int a, b;
  double on_a[6]; /* N, N m */
  double on_b[6];
  uint32_t normals;   /* contacts that push */
  uint32_t saturated; /* components of friction at their bounds */
} influence_pair;

typedef struct influence_contact {
  dJointID joint;
  double normal[3];
  int a, b;
} influence_contact;

typedef struct influence_sim {
  const peer_world *world;
  peer_ode_world ode;
  dJointGroupID group;
  dJointGroupID motors;
  peer_reach reach;
  influence_role *roles; /* of each box */
  double (*given)[6];    /* N, N m: on each box, in the next step */
  influence_contact *contacts;
  dJointFeedback *feedback; /* one each */
  size_t contact_count;
  size_t contact_capacity;
  size_t contacts_lost; /* without room: none, or the results are wrong */
} influence_sim;

/* False: no memory; finish is due all the same. */
bool influence_sim_init(influence_sim *sim, const peer_world *world, int iterations);
void influence_sim_finish(influence_sim *sim);

/* All bodies are IN again. */
void influence_sim_save(const influence_sim *sim, influence_motion *out);
void influence_sim_restore(influence_sim *sim, const influence_motion *motions);

/* After restore. push: N, N m; braced: by share of it. */
void influence_sim_set(influence_sim *sim, size_t box, influence_role role);
void influence_sim_brace(influence_sim *sim, size_t box, const double push[6], double share);

/* t: s since the begin. out_force: N, on the hand, at the begin of the step. */
void influence_sim_step(influence_sim *sim, double t, double out_force[3]);

/* What the contacts of the last step were, sorted; out: at least contact_count. Returns their
 * count. */
size_t influence_sim_pairs(const influence_sim *sim, influence_pair *out);

#endif
