/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "local/body_course.h"

#include <math.h>

#include "base/pose.h"
#include "base/six.h"

/* A driven body goes where physics expects it, see physics/course.c. What it is off by at a sync is
 * brought in over some ticks, as a step of its pose would be one of the force. Farther than a body
 * can be expected to come by itself it has been put, and leaps. */

#define FADE_S 0.02      /* or the whole period, if that is shorter */
#define APART_LEAST 1e-9 /* m, rad: nothing to be brought in */
#define APART_MOST 0.04  /* m: 2 m/s in the time of the fade */
#define TURN_MOST 0.5    /* rad */
#define AGE_MOST 0.1     /* s, of a model */

/* Mean over a part of the period of the rate of a sum of powers, (b^k - a^k) / (b - a). */
static void course_rate(const hapi_model_course *in, double a, double b, hap_twist *out)
{
  double sum = 1.0;
  double power = 1.0;
  double rate[6];
  memcpy(rate, in->ways[0], sizeof rate);
  for (int k = 1; k < HAPI_COURSE_ORDER; ++k) {
    power *= b;
    sum = sum * a + power;
    hapi_madd6(rate, sum, in->ways[k]);
  }
  memcpy(out, rate, sizeof *out);
}

static double course_time(const hapi_body_course *course, int64_t ns)
{
  double t = 1e-9 * (double)(ns - course->begin_ns);
  return t < course->in.period_s ? t : course->in.period_s;
}

static double fade_length(const hapi_body_course *course)
{
  return fmin(FADE_S, course->in.period_s);
}

/* Share of what was apart that is left. */
static double fade_left(const hapi_body_course *course, double seconds)
{
  double u = seconds / fade_length(course);
  return u >= 1.0 ? 0.0 : 1.0 - u * u * (3.0 - 2.0 * u);
}

void hapi_course_adopt(hapi_body_course *course, hapi_model *model, const hapi_model_body *in,
                       const hap_pose *before, int64_t now_ns, hapi_local_body *body)
{
  double age_s = 1e-9 * (double)(now_ns - model->state_ns);
  hap_twist twist;
  course->known = true;
  course->in = hapi_model_courses(model)[in->course - 1];
  course->begin_ns = model->state_ns;
  course->told_ns = now_ns;
  course_rate(&course->in, 0.0, course_time(course, now_ns), &twist);
  body->pose = in->pose;
  hapi_pose_move(&body->pose, &twist, fmin(age_s, AGE_MOST));
  memset(course->apart, 0, sizeof course->apart);
  if (before == NULL || course->in.leaps != 0) {
    return;
  }
  double apart[6];
  hapi_pose_way(&body->pose, before, apart); /* of what turned far it leaps */
  double way = hapi_v3_norm(apart);
  double turn = hapi_v3_norm(apart + 3);
  if ((way > APART_LEAST || turn > APART_LEAST) && way <= APART_MOST && turn <= TURN_MOST) {
    memcpy(course->apart, apart, sizeof course->apart);
    body->pose = *before;
  }
}

void hapi_course_follow(const hapi_body_course *course, int64_t now_ns, double period,
                        hapi_local_body *body)
{
  int64_t next_ns = now_ns + (int64_t)(1e9 * period + 0.5);
  double since = 1e-9 * (double)(now_ns - course->told_ns);
  course_rate(&course->in, course_time(course, now_ns), course_time(course, next_ns), &body->twist);
  double change = fade_left(course, since + period) - fade_left(course, since);
  if (change != 0.0) {
    hapi_v3_madd(body->twist.linear, change / period, course->apart, body->twist.linear);
    hapi_v3_madd(body->twist.angular, change / period, course->apart + 3, body->twist.angular);
  }
}
