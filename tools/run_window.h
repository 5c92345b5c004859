/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_WINDOW_H
#define HAPODE_TOOLS_RUN_WINDOW_H

/* The window of --view. */

#include "tools/run_options.h"
#include "tools/run_stage.h"

/* Opens the window in this thread, which must be the program's first, and calls run in another one
 * until it returns; *out_code is what it returned. HAP_ERROR_UNSUPPORTED: this build has no
 * windows, or there is no display; detail says it in a sentence. HAP_ERROR_MEMORY. */
hap_status run_window(run_options *options, int (*run)(run_options *options), int *out_code,
                      hap_detail *detail);

#endif
