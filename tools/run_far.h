/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_FAR_H
#define HAPODE_TOOLS_RUN_FAR_H

/* --serve and --connect: the world in one process, the hand in another, by a link over DDS. */

#include <stdio.h>

#include "tools/run_options.h"

typedef struct run_far {
  hap_session *session;
  hap_link *link; /* NULL: the world is in this process, as ever */
  bool serves;
  bool joined; /* as it was said last */
  uint64_t turned_away;
  bool shown; /* bodies are drawn, which need a scene as that of the world */
} run_far;

/* Before the session is started. On failure *out is zeroed. */
hap_status run_far_open(const run_options *options, const rig *r, run_far *out, hap_detail *detail);
/* Says on stderr who comes and goes. HAP_ERROR_STATE: the world does not take this hand.
 * HAP_ERROR_ARGUMENT: bodies are to be drawn, and the world is of another scene. */
hap_status run_far_look(run_far *far, hap_detail *detail);
/* Lines of the summary. */
void run_far_print(const run_far *far, FILE *out);
/* After the session was destroyed; zeroed allowed. */
void run_far_close(run_far *far);

#endif
