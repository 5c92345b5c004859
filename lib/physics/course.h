/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_COURSE_H
#define HAPODE_PHYSICS_COURSE_H

/* Where a body that the application drives goes until the next sync. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/messages.h"

/* What is known of how such a body went. Motion and turn are foretold each by itself. */
typedef struct hapi_course_past {
  bool known;                            /* place holds */
  bool moves;                            /* set holds: the application had given it a velocity */
  uint32_t count;                        /* of the ways */
  double seconds;                        /* of each of them */
  hap_pose place;                        /* at the last sync */
  double ways[HAPI_COURSE_ORDER + 1][6]; /* m, rad: from sync to sync, the newest first */
  double set[6]; /* the way that the velocity at the last sync made expect */
  double missed[2][HAPI_COURSE_ORDER + 1]; /* m; rad: what each order was off by, of late */
  double missed_set[2];
} hapi_course_past;

/* At each sync, after a step of that length. */
void hapi_course_note(hapi_course_past *past, const hap_pose *pose, const hap_twist *twist,
                      double seconds);

/* After the note of a sync: it has been given another velocity for the step to come. */
void hapi_course_set(hapi_course_past *past, const hap_twist *twist, double seconds);

/* Before its first note: it has stood there for so many syncs, that far apart. */
void hapi_course_stand(hapi_course_past *past, const hap_pose *pose, double seconds,
                       uint32_t syncs);

/* For the next period. */
void hapi_course_find(const hapi_course_past *past, const hap_twist *twist, double period_s,
                      hapi_model_course *out);

/* In a time that goes that much faster. */
void hapi_course_scale(double scale, hapi_model_course *io);

/* Its mean velocity in the period. */
void hapi_course_mean(const hapi_model_course *course, hap_twist *out);

#endif
