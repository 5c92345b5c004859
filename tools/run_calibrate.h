/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_CALIBRATE_H
#define HAPODE_TOOLS_RUN_CALIBRATE_H

/* Where the home of a SPIDAR is, told by a person who holds its grip there; and how long its
 * strings are and where its motors, from a motion of that person all over the workspace. */

#include <stdio.h>

#include "tools/run_options.h"

/* Tells the person on stderr what to do, winds in the strings of the one device of options, and
 * writes its model with what was found to options->calibrate_path. When stdin ends after home was
 * told, home is all that is found. HAP_END when a signal ended it, or stdin before home; then, and
 * on an error, the file is as it was. */
hap_status run_calibrate(const run_options *options, FILE *out, hap_detail *detail);

#endif
