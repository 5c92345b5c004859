/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_POSES_RUN_H
#define HAPODE_BENCH_POSES_RUN_H

/* What a frame loop would draw of a scene whose hand pushes, in lockstep, held against where the
 * loop itself had hand and bodies at the time that is drawn. Shared by hapode-bench poses and
 * its test. */

#include <stddef.h>

#include <hapode/session.h>

typedef struct poses_def {
  const char *scene;
  hap_model model;
  double physics_hz;
  double frame_hz;
  double seconds;
  int max_bodies; /* of the session; 0: its default */
} poses_def;

/* Largest over the frames. */
typedef struct poses_result {
  size_t frames;
  double moved_mm; /* that the first body went */
  double gap_mm;   /* between neighbouring bodies: how far a corner of one, seen from the other, is
                           from where it was in the loop. No gap and no overlap is off by more */
  double hand_mm;  /* the same of the pointer's centre, seen from the first body */
  /* the same of the newest pointer on the drawn body: without hap_pointer_poses */
  double undelayed_mm;
  double path_mm; /* a corner of a body, from where it was */
  double jump_mm; /* by which a body went farther between two frames than along its path */
  double back_mm; /* by which the first body went back while its path went on */
} poses_result;

hap_status poses_measure(const poses_def *def, poses_result *out, hap_detail *detail);

#endif
