/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_LIST_H
#define HAPODE_TOOLS_RUN_LIST_H

#include <stdio.h>

/* What exists: scenes with their parameters, models, devices, effects. */
void run_list_print(FILE *out);

#endif
