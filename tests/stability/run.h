/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STABILITY_RUN_H
#define HAPODE_TESTS_STABILITY_RUN_H

#include "tests/stability/cases.h"

/* Runs the case for its time, looks at the bounds after every tick, and prints the worst figures
 * as a comment that begins with how. Whether all bounds held. */
bool case_holds(const case_row *row, hap_model model, const char *how);

#endif
