/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_HTML_H
#define HAPODE_TOOLS_RUN_HTML_H

/* --html of hapode-run: a run as one page that a browser shows, without a network. */

#include "tools/run_options.h"

typedef struct run_html run_html;

/* Nothing wanted: *out is NULL. HAP_ERROR_IO: the file; detail says why. pointers: of the session.
 * The rig must outlive the page. */
hap_status run_html_open(const run_options *options, const rig *r, size_t pointers, run_html **out,
                         hap_detail *detail);

/* Of each tick, and between two stretches at time t of the run. NULL allowed. */
void run_html_add_row(run_html *html, const hap_trace_row *row);
void run_html_look(run_html *html, double t);

/* Writes the page under its name, and ends it. HAP_ERROR_IO, HAP_ERROR_MEMORY with detail: the file
 * of that name is as it was. NULL allowed. */
hap_status run_html_close(run_html *html, hap_detail *detail);

/* Ends it without a page. NULL allowed. */
void run_html_drop(run_html *html);

#endif
