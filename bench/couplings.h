/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_COUPLINGS_H
#define HAPODE_BENCH_COUPLINGS_H

/* hapode-bench couplings: the library's own couplings and the two that the literature knows, side by
 * side. In the scenes the coupling's spring and damper are those of the scene's contacts, so that the hand
 * feels a wall as the reference has it, but through a proxy half as stiff. */

#include "bench/accuracy.h"
#include "bench/bench.h"

#define COUPLINGS 4
#define COUPLINGS_SCENES 4

extern const hap_coupling couplings_compared[COUPLINGS];
extern const char *const couplings_scenes[COUPLINGS_SCENES];

typedef struct couplings_cell {
  accuracy_errors errors; /* against model single without a coupling */
  double deepest;         /* m, of the pointer in bodies */
  double tick_us;
} couplings_cell;

typedef struct couplings_column {
  couplings_cell scenes[COUPLINGS_SCENES];
  double stiffness; /* N/m, the most that a desktop stylus holds and feels */
  double mass;      /* kg, felt in the air */
  double damping;   /* N s/m, likewise */
} couplings_column;

typedef struct couplings_table {
  couplings_column columns[COUPLINGS];
  accuracy_motion reference; /* of the first scene, and with the couplings: for the picture */
  accuracy_motion motions[COUPLINGS];
} couplings_table;

/* ---- couplings_picture.c ---- */

hap_status couplings_draw(bench *b, const couplings_table *table);

#endif
