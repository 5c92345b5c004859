/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_RECORDING_H
#define HAPODE_TOOLS_RUN_RECORDING_H

/* --record and --play of hapode-run. */

#include <stdio.h>

#include "tools/run_options.h"

typedef struct run_recording {
  hap_record_def def;
  char note[256];
  hap_player *player; /* --play; NULL: none */
  hap_player_info info;
  char scene[128]; /* of the recording */
} run_recording;

/* Before the rig is made: fills in what options->rig needs for it. --play takes scene, model and
 * rates from the file. */
hap_status run_recording_open(run_options *options, run_recording *out, hap_detail *detail);
void run_recording_close(
    run_recording *recording); /* after the rig was destroyed; zeroed allowed */

/* What came of it: lines of the summary. False, and a text for stderr: the recording could not be
 * written, or the replay was another one. */
bool run_recording_print(const run_recording *recording, const run_options *options,
                         const hap_session *session, FILE *out, hap_detail *detail);

#endif
