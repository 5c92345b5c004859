/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_FRAME_H
#define HAPODE_TOOLS_RUN_FRAME_H

/* A moment of a run, as view/view.h draws it, by the public functions of the session. */

#include "tools/run_options.h"
#include "view/view.h"

/* Where moments come from. Rig and scene must outlive it. */
typedef struct run_frame_source {
  const rig *rig;
  const hap_scene *scene; /* that of the rig, once more */
  size_t pointers;        /* of the session, at most VIEW_POINTERS_MAX */
  hap_trace_row row;      /* the newest; used where the rig knows no pointers, of a recording */
} run_frame_source;

/* Room for that many bodies. False: there is no memory; run_frame_free all the same. */
bool run_frame_reserve(view_frame *out, size_t bodies);
void run_frame_free(view_frame *of);

/* Both have room for as many bodies. */
void run_frame_copy(const view_frame *from, view_frame *to);

/* Size and form of the pointers: what the scene's hands have; further ones are as the first. */
void run_frame_pointers(const run_options *options, const hap_scene *from, view_frame *io);

/* Fills in the moment t, s, of the run. */
void run_frame_read(const run_frame_source *from, double t, view_frame *io);

/* The strongest hand's force in a row of the trace, N. */
double run_frame_force(const hap_trace_row *row);

void run_frame_labels(const run_options *options, view_labels *out);

#endif
