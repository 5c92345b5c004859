/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_BLACK_BOX_H
#define HAPODE_TOOLS_RUN_BLACK_BOX_H

#include <stdio.h>

#include <hapode/hapode.h>

/* Writes a header, and the session's black box where a fault is latched. Returns the ticks in
 * it. */
size_t run_black_box_write(hap_session *session, FILE *file);

#endif
