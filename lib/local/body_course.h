/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_COURSE_H
#define HAPODE_LOCAL_BODY_COURSE_H

/* Bodies that the application drives, between two syncs. */

#include "local/body.h"

/* A new model says how the body goes from its pose there. before: where the loop had it; NULL: it
 * was not there. Sets the body's pose. */
void hapi_course_adopt(hapi_body_course *course, hapi_model *model, const hapi_model_body *in,
                       const hap_pose *before, int64_t now_ns, hapi_local_body *body);

/* Sets the body's twist for a tick. */
void hapi_course_follow(const hapi_body_course *course, int64_t now_ns, double period,
                        hapi_local_body *body);

#endif
