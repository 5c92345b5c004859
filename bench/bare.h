/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_BARE_H
#define HAPODE_BENCH_BARE_H

/* A second copy of a scene that is stepped by plain ODE calls and nothing else: what a simulator
 * without haptics spends on the same states. ODE's random seed is left as it was found, so that
 * nothing here shows in the run that is measured. */

#include <stdbool.h>

#include <hapode/status.h>

#include "scenes/scenes.h"

typedef struct bare_state {
  dReal position[3];
  dReal quat[4];
  dReal linear[3];
  dReal angular[3];
} bare_state;

typedef struct bare {
  scene *scene;
  dJointGroupID contacts;
  dContact *scratch;
  size_t contact_count; /* of the last collision */
  bare_state *states;   /* of the bodies, to begin from */
} bare;

hap_status bare_create(const scene_parameters *parameters, int count, bare *out,
                       hap_detail *detail);
void bare_destroy(bare *b); /* zeroed allowed */

/* Puts every body into the state that it has in another copy of the scene. */
void bare_follow(bare *b, const scene *from);

/* Collision and global step over step_s, timed [s]; step_alone: of the two the step alone is. */
double bare_cycle(bare *b, double step_s, bool step_alone);

/* The same with ODE's direct solver. Forces that were added before act in it. */
void bare_exact_step(bare *b, double step_s);

/* One QuickStep of the islands of the bodies nearest to the hand, all others switched off [s]:
 * the mean of four in a row from the same state, without and with a force on the nearest body
 * along x, y and z, as testing simulations are. So it has what makes these dearer than a step
 * alone: colder caches at first, and friction that slips under the force. The contacts are those
 * of the last bare_cycle. The last step is not undone. */
double bare_island_step(bare *b, size_t neighbours, const double hand[3], double force,
                        double step_s);

#endif
