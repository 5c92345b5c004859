/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_HAND_OVER_H
#define HAPODE_TOOLS_RUN_HAND_OVER_H

#include "tools/run_options.h"

/* Where pictures or a window are wanted, a program without them becomes hapode-view, of the same
 * folder and with the same arguments, and does not come back. HAP_ERROR_UNSUPPORTED: there is none;
 * detail says what to install. HAP_OK: this program goes on. */
hap_status run_hand_over(const run_options *options, char *const arguments[], hap_detail *detail);

#endif
