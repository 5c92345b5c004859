/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_BARE_H
#define HAPODE_BENCH_BARE_H

/* A second copy of a scene that is stepped by plain ODE calls and nothing else: what a simulator
 * without haptics spends on the same states. ODE's random seed is left as it was found, so that
 * nothing here shows in the run that is measured. */

#include <hapode/status.h>

#include "scenes/scenes.h"

typedef struct bare {
  scene *scene;
  dJointGroupID contacts;
  dContact *scratch;
} bare;

hap_status bare_create(const scene_parameters *parameters, int count, bare *out,
                       hap_detail *detail);
void bare_destroy(bare *b); /* zeroed allowed */

/* Puts every body into the state that it has in another copy of the scene. */
void bare_follow(bare *b, const scene *from);

/* Collision and global step over step_s, timed [s]. */
double bare_cycle(bare *b, double step_s);

/* One QuickStep of the island of the first body, all other bodies switched off: median of repeats
 * [s]. The contacts are those of the last bare_cycle. Nothing is undone: bare_follow puts the bodies
 * right again. */
double bare_island_step(bare *b, double step_s, int repeats);

#endif
