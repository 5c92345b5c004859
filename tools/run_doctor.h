/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_DOCTOR_H
#define HAPODE_TOOLS_RUN_DOCTOR_H

/* hapode-run --doctor: what of this machine helps or hinders a haptic loop. */

#include <stdbool.h>
#include <stdio.h>

/* Prints each check as a line, or all as one JSON object. Takes about two seconds. Opens no port
 * and sends nothing. root: prefix of /proc, /sys, /etc, /dev and the rules' folders; "" outside of
 * tests. False: at least one check is a problem. */
bool run_doctor(FILE *out, const char *root, bool json);

#endif
