/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_PICTURE_H
#define HAPODE_TOOLS_RUN_PICTURE_H

/* What a run leaves behind for its picture: force, position and duty factors over time. The memory
 * does not depend on the length of the run: rows go into bins of time, and each bin keeps its
 * weakest and its strongest tick. */

#include <stddef.h>

#include <hapode/hapode.h>

typedef struct run_picture run_picture;

/* seconds: expected length. A run that is longer has its end in the last bin. NULL: no memory. */
run_picture *run_picture_create(double seconds, size_t pointers, double haptic_hz);
void run_picture_destroy(run_picture *picture); /* NULL allowed */

void run_picture_add_row(run_picture *picture, const hap_trace_row *row);

/* Duty factors of the newest physics cycle at time t; period_s: of the physics. To be called every
 * run_picture_interval seconds or so. */
void run_picture_add_stats(run_picture *picture, double t, const hap_stats *stats, double period_s);
double run_picture_interval(const run_picture *picture);

/* Draws the SVG file. HAP_END: nothing ran, nothing drawn. */
hap_status run_picture_draw(const run_picture *picture, const char *path, const char *title,
                            hap_detail *detail);

#endif
