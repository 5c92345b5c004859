/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_LIST_H
#define HAPODE_TOOLS_RUN_LIST_H

#include <stdbool.h>
#include <stdio.h>

/* What exists: scenes with their parameters, models, devices, effects. probe: hardware is opened,
 * for which bytes are sent to serial ports. Else nothing is sent, and what the system knows of the
 * ports is told. */
void run_list_print(FILE *out, bool probe);

#endif
