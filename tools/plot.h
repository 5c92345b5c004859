/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_PLOT_H
#define HAPODE_TOOLS_PLOT_H

/* Pictures by gnuplot, for programs and bench. Data goes into the script itself
 * ($name << EOD ... EOD) or is read by it from a file; no shell is involved.
 *
 *   FILE *script = plot_begin("out.svg", 800, 600, detail);
 *   fprintf(script, "plot sin(x) title 'sine' linetype 1\n");
 *   status = plot_end(script, detail);
 */

#include <stdbool.h>
#include <stdio.h>

#include <hapode/status.h>

/* Said on stderr by a program that wanted to draw and could not. */
#define PLOT_ABSENT_TEXT "gnuplot is not installed: no picture"

/* Whether gnuplot is in the PATH and this build draws at all (meson option plots). */
bool plot_available(void);

/* A script whose output will be the SVG file of that size [px], with the house style set: line
 * types 1 to 6 are colours that also the colour-blind can tell apart, grid, thin border. The caller
 * goes on writing to it and hands it to plot_end. NULL on failure. */
FILE *plot_begin(const char *svg_path, int width, int height, hap_detail *detail);

/* Writes text as a string of gnuplot, in quotes: for file names and titles. */
void plot_string(FILE *script, const char *text);

/* Runs and closes the script; waits for gnuplot. HAP_ERROR_UNSUPPORTED when there is no gnuplot,
 * HAP_ERROR_IO with gnuplot's own words when it failed. NULL is HAP_ERROR_ARGUMENT. */
hap_status plot_end(FILE *script, hap_detail *detail);

#endif
