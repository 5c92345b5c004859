/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_SHOT_H
#define HAPODE_TOOLS_RUN_SHOT_H

/* --shot and --frames of hapode-run: pictures of a run as PNG files. */

#include "tools/run_options.h"

typedef struct run_shot run_shot;

/* Nothing wanted: *out is NULL. HAP_ERROR_UNSUPPORTED: this build or machine draws no pictures;
 * HAP_ERROR_IO: the file or folder; detail says which. seconds: expected length of the run;
 * pointers: of the session. The rig must outlive the shot. */
hap_status run_shot_open(const run_options *options, const rig *r, double seconds, size_t pointers,
                         run_shot **out, hap_detail *detail);

/* Of each tick, and between two stretches at time t of the run. NULL allowed. */
void run_shot_add_row(run_shot *shot, const hap_trace_row *row);
void run_shot_look(run_shot *shot, double t);

/* Draws and writes what is still to be written, and ends it. HAP_ERROR_IO with detail, also where a
 * picture before could not be written. NULL allowed. */
hap_status run_shot_close(run_shot *shot, hap_detail *detail);

/* Ends it without a picture. NULL allowed. */
void run_shot_drop(run_shot *shot);

#endif
