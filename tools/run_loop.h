/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_LOOP_H
#define HAPODE_TOOLS_RUN_LOOP_H

/* Lets a session run for its time and takes the trace out of it on the way. */

#include "tools/run_coupling.h"
#include "tools/run_far.h"
#include "tools/run_html.h"
#include "tools/run_options.h"
#include "tools/run_picture.h"
#include "tools/run_progress.h"
#include "tools/run_shot.h"
#include "tools/run_stage.h"
#include "tools/trace_csv.h"

typedef struct run_loop {
  const run_options *options;
  const rig *rig;
  double seconds;
  trace_csv trace;      /* file NULL: none wanted */
  int trace_errno;      /* why it could not be written any more; 0: it could */
  FILE *black_box;      /* NULL: none wanted */
  run_picture *picture; /* NULL: none wanted */
  run_shot *shot;       /* NULL: none wanted */
  run_html *html;       /* NULL: none wanted */
  run_stage *stage;     /* of the window; NULL: there is none */
  run_progress progress;
  run_far *far;           /* of a world in another process, or a hand */
  run_coupling *coupling; /* filled in on the way */
  size_t pointers;        /* of trace and picture */
} run_loop;

/* Rows that the session has to keep for run_loop_run. 0: nobody wants them. */
int32_t run_loop_trace_rows(const run_options *options);

/* From now on SIGINT, SIGTERM and SIGHUP take the force off at once, whatever the program waits
 * for, and end the run instead of the process; a second one of them ends the process too. Whatever
 * signal ends the process, the force is zero before. */
void run_loop_catch_signals(void);

/* Such a signal has come. */
bool run_loop_stop_wanted(void);

/* Starts the session, runs it, stops it. HAP_NO_REALTIME as of hap_session_start; HAP_END when a
 * signal ended it early; errors with detail. A trace that cannot be written does not end the run: a
 * hand is on the device. Whatever comes back, the session is stopped and *stats
 * is what it came to. */
hap_status run_loop_run(run_loop *loop, hap_stats *stats, hap_detail *detail);

#endif
