/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_COUPLING_H
#define HAPODE_TOOLS_RUN_COUPLING_H

/* How the pointers of a run were coupled to their devices, and why. */

#include <stdio.h>

#include "tools/rig.h"

/* By pointer: its state when the stiffest contacts were near it. */
typedef struct run_coupling {
  hap_pointer_state stiffest[RIG_POINTERS_MAX];
} run_coupling;

/* From time to time during the run. */
void run_coupling_look(run_coupling *io, const rig *r);

/* "coupling: proxy (ABOVE: 8000 N/m near, the device holds 320 N/m)", several pointers joined by "
 * + ". */
void run_coupling_print(const run_coupling *coupling, size_t pointers, FILE *out);

#endif
