/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_IDENTIFY_H
#define HAPODE_TOOLS_RUN_IDENTIFY_H

/* Finds out what a device's mechanism is like, with a person beside it. */

#include <stdio.h>

#include "tools/run_options.h"

/* Tells the person on stderr what to do, moves the one device of options, writes the identity to
 * options->identify_path and "key: value" lines to out. HAP_END when a signal ended it; then, and
 * on an error, the file is as it was. */
hap_status run_identify(const run_options *options, FILE *out, hap_detail *detail);

#endif
