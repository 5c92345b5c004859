/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"
#include "world/world.h"

/* Auto-disable. ODE keeps its countdown inside the body, without getter or setter: enabling a body
 * restarts it and a testing simulation advances it, so with probes no body would ever fall asleep,
 * or too soon. So ODE's own is switched off while a session runs, and the same rule is applied
 * here: a body whose mean speed over the last samples stays below its thresholds for so many steps
 * and so long is disabled with its velocity set to zero. */

static void start_countdown(hapi_sleep *sleep)
{
  sleep->steps_left = sleep->idle_steps;
  sleep->time_left = sleep->idle_time;
}

static double value_squared(double value)
{
  return value * value;
}

/* Those that have no mark in their place. */
static bool were_changed(const hapi_sleep *sleep, dBodyID body)
{
  return sleep->linear_threshold != value_squared(dBodyGetAutoDisableLinearThreshold(body)) ||
         sleep->idle_steps != dBodyGetAutoDisableSteps(body) ||
         sleep->samples != dBodyGetAutoDisableAverageSamplesCount(body);
}

static void sleep_take(hapi_known_body *known)
{
  HAPI_ASSERT(!known->mark_placed);
  hapi_sleep *sleep = &known->rest->sleep;
  memset(sleep, 0, sizeof *sleep);
  known->sleep_taken = true;
  known->awake = true;
  known->sleep_automatic = dBodyGetAutoDisableFlag(known->body) != 0;
  if (known->sleep_automatic) {
    dBodyID body = known->body;
    sleep->linear_threshold = value_squared(dBodyGetAutoDisableLinearThreshold(body));
    sleep->angular_threshold = value_squared(dBodyGetAutoDisableAngularThreshold(body));
    sleep->idle_steps = dBodyGetAutoDisableSteps(body);
    sleep->idle_time = dBodyGetAutoDisableTime(body);
    sleep->samples = dBodyGetAutoDisableAverageSamplesCount(body);
    start_countdown(sleep);
    if (sleep->samples > 1) {
      sleep->velocities = hapi_alloc_array((size_t)sleep->samples, 6 * sizeof(double));
      if (sleep->velocities == NULL) {
        hapi_log(HAP_LOG_WARNING, "no memory for a body's sleep: it stays awake");
      }
    }
    /* Switching it off also enables the body, and gives it the world's steps, time and samples. */
    bool enabled = dBodyIsEnabled(body) != 0;
    dBodySetAutoDisableFlag(body, 0);
    dBodySetAutoDisableSteps(body, sleep->idle_steps);
    dBodySetAutoDisableTime(body, sleep->idle_time);
    if (dBodyGetAutoDisableAverageSamplesCount(body) != sleep->samples) {
      dBodySetAutoDisableAverageSamplesCount(body, (unsigned)sleep->samples);
    }
    if (!enabled) {
      dBodyDisable(body);
    }
  }
  hapi_mark_place(known);
}

/* With the settings that the application has given to the body by now. */
static void sleep_take_again(hapi_known_body *known)
{
  hapi_mark_remove(known);
  hapi_free(known->rest->sleep.velocities);
  sleep_take(known);
}

void hapi_sleep_follow(hapi_known_body *known)
{
  if (!known->sleep_taken) {
    sleep_take(known);
    return;
  }
  if (dBodyGetAutoDisableFlag(known->body) != 0) {
    sleep_take_again(known);
    return;
  }
  unsigned changed = hapi_mark_follow(known);
  /* dBodySetAutoDisableFlag(body, 0) gives the body the world's idle time, and leaves no other
   * trace: the flag is off all the time. */
  if (((changed & HAPI_MARK_TIME) != 0 &&
       known->rest->mark.idle_time == dWorldGetAutoDisableTime(dBodyGetWorld(known->body)))) {
    sleep_take_again(known);
  } else if (known->sleep_automatic &&
             (changed != 0 || were_changed(&known->rest->sleep, known->body))) {
    dBodySetAutoDisableFlag(known->body, 1);
    sleep_take_again(known);
  }
}

void hapi_sleep_give_back(hapi_known_body *known)
{
  hapi_sleep *sleep = &known->rest->sleep;
  hapi_mark_remove(known);
  if (known->sleep_taken && known->sleep_automatic) {
    dBodySetAutoDisableFlag(known->body, 1);
    /* What ODE counted before the session does not count any more. */
    dBodyID body = known->body;
    int samples = dBodyGetAutoDisableAverageSamplesCount(body);
    dBodySetAutoDisableAverageSamplesCount(body, (unsigned)samples);
    if (dBodyIsEnabled(body)) {
      dBodyEnable(body);
    }
  }
  hapi_free(sleep->velocities);
  memset(sleep, 0, sizeof *sleep);
  known->sleep_taken = known->sleep_automatic = known->awake = false;
}

/* Takes a sample; true when the mean over all samples is known. */
static bool mean_velocity(hapi_sleep *sleep, dBodyID body, double mean[6])
{
  double now[6];
  memcpy(now, dBodyGetLinearVel(body), 3 * sizeof(double));
  memcpy(now + 3, dBodyGetAngularVel(body), 3 * sizeof(double));
  if (sleep->velocities == NULL) {
    memcpy(mean, now, sizeof now);
    return true;
  }
  HAPI_ASSERT_INDEX(sleep->next_sample, sleep->samples);
  memcpy(sleep->velocities + (size_t)sleep->next_sample * 6, now, sizeof now);
  sleep->next_sample = (sleep->next_sample + 1) % sleep->samples;
  sleep->ring_full = sleep->ring_full || sleep->next_sample == 0;
  memset(mean, 0, sizeof now);
  for (int i = 0; i < 6 * sleep->samples; ++i) {
    mean[i % 6] += sleep->velocities[i];
  }
  for (int i = 0; i < 6; ++i) {
    mean[i] *= 1.0 / (double)sleep->samples;
  }
  return sleep->ring_full;
}

static bool is_idle(hapi_sleep *sleep, dBodyID body)
{
  double v[6];
  if (!mean_velocity(sleep, body, v)) {
    return false;
  }
  double linear = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  double angular = v[3] * v[3] + v[4] * v[4] + v[5] * v[5];
  return !(linear > sleep->linear_threshold) && !(angular > sleep->angular_threshold);
}

static void sleep_step_body(hapi_known_body *known, double step_s)
{
  hapi_sleep *sleep = &known->rest->sleep;
  if (is_idle(sleep, known->body)) {
    --sleep->steps_left;
    sleep->time_left -= step_s;
  } else {
    start_countdown(sleep);
  }
  if (sleep->steps_left <= 0 && sleep->time_left <= 0.0) {
    dBodyDisable(known->body);
    dBodySetLinearVel(known->body, 0.0, 0.0, 0.0);
    dBodySetAngularVel(known->body, 0.0, 0.0, 0.0);
  }
}

/* With no samples ODE never puts a body to sleep; nor do we where they found no memory. */
static bool can_sleep(const hapi_known_body *known)
{
  const hapi_sleep *sleep = &known->rest->sleep;
  return known->sleep_automatic && (sleep->samples == 1 || sleep->velocities != NULL);
}

void hapi_sleep_step(hapi_body_table *table, double step_s)
{
  HAPI_ASSERT(step_s > 0.0);
  for (uint32_t i = 0; i < table->high; ++i) {
    hapi_known_body *known = &table->entries[i];
    if (known->body == NULL || !can_sleep(known)) {
      continue;
    }
    bool awake = dBodyIsEnabled(known->body) != 0;
    if (awake && !known->awake) { /* dBodyEnable does so; being woken by an island does not */
      start_countdown(&known->rest->sleep);
    }
    /* ODE leaves bodies alone that have no joint, and those asleep already. */
    /* A body that the loop owns has its contacts there. */
    if (awake &&
        (dBodyGetJoint(known->body, 0) != NULL || (known->loop_owned && known->loop_touched))) {
      sleep_step_body(known, step_s);
    }
  }
}

void hapi_sleep_note(hapi_known_body *known)
{
  if (known->sleep_automatic) {
    known->awake = dBodyIsEnabled(known->body) != 0;
  }
}
