/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_STAGE_H
#define HAPODE_TOOLS_RUN_STAGE_H

/* Between the thread that runs sessions and the thread that has the window. The run's thread reads
 * moments of the session and leaves them here, and does what was wished; it never draws. The
 * window's thread draws, and never touches a session. One mutex, held for copies only; the haptic
 * thread has no part in it. */

#include "tools/run_options.h"
#include "view/view.h"

typedef struct run_stage run_stage;

/* What the window wants of the run. */
typedef enum stage_wish {
  STAGE_END = 0,
  STAGE_AGAIN,
  STAGE_SCENE_NEXT,
  STAGE_SCENE_BEFORE,
  STAGE_MODEL,
  STAGE_RATE_UP,
  STAGE_RATE_DOWN,
  STAGE_FINER,
  STAGE_COARSER,
  STAGE_SLOWER,
  STAGE_FASTER,
  STAGE_PAUSE,
  STAGE_STEP,
  STAGE_RESET,
  STAGE_HAND,   /* the next one is the mouse's */
  STAGE_SCRIPT, /* the hand goes its own way again */
  STAGE_LET_GO,
  STAGE_WISHES
} stage_wish;

/* What the window shows; its own. */
typedef struct stage_picture {
  view_frame frame; /* bodies and roles: room for as many as the scene has */
  view_strips strips;
  view_labels labels;
  unsigned scene; /* that was taken; 0: none */
  size_t hand;    /* pointer that the mouse moves */
  bool can_pull;  /* it is a simulated hand */
  bool is_held;   /* it holds a body */
  bool is_over;   /* there is no run any more */
  double end;     /* s, of a recording: up to where it is known; else 0 */
} stage_picture;

/* NULL: no memory. */
run_stage *run_stage_create(void);
void run_stage_destroy(run_stage *stage); /* NULL allowed */

/* ---- the run's thread; where stage is NULL nothing is done ---- */

/* Before a rig is made: hands that can be pulled. */
void run_stage_prepare(run_stage *stage, run_options *io);
/* A session over the rig is about to begin. seconds: of the strips, of a recording; 0: endless. */
hap_status run_stage_enter(run_stage *stage, const run_options *options, const rig *r,
                           size_t pointers, double seconds, hap_detail *detail);
void run_stage_leave(run_stage *stage);
void run_stage_add_row(run_stage *stage, const hap_trace_row *row);
/* Between two stretches, at time t, s: reads a moment and does what was wished. HAP_END: the run is
 * to end. */
hap_status run_stage_look(run_stage *stage, double t);
/* Waits until a run at time t, s, is not ahead of the clock on the wall. */
void run_stage_pace(run_stage *stage, double t);
/* Whether another run is wanted, and changes the options to it. */
bool run_stage_goes_on(run_stage *stage, run_options *io);
void run_stage_finish(run_stage *stage);

/* ---- the window's thread ---- */

void run_stage_wish(run_stage *stage, stage_wish wish);
/* The mouse's hand is wanted there, m, world. */
void run_stage_pull(run_stage *stage, const double target[3]);
/* It is to go to the point and to hold the body there, whose number is that of the scene; on the
 * way it stays lift, m, off what it may push. */
void run_stage_grab(run_stage *stage, uint32_t body, const double point[3], const double lift[3]);
/* Gives the view the scene of the newest run, and the picture room for its bodies: HAP_STALE.
 * HAP_OK: both have it. HAP_ERROR_MEMORY. */
hap_status run_stage_scene(run_stage *stage, view *v, stage_picture *io, hap_detail *detail);
/* Copies the newest moment, or that of time t where t is not negative. False: there is none of the
 * scene that was taken. */
bool run_stage_take(run_stage *stage, double t, stage_picture *io);

#endif
