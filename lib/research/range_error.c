/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "research/range_error.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/log.h"
#include "base/vec.h"

/* What the loop owns needs no testing simulation; here it has some all the same, 1 + 3 for each
 * neighbour, of its whole island with all contacts and joints, about the force that the pointer
 * gives. What they foretell of the next interval is compared with what the loop then made of it:
 * a measure of what lies beyond the range, and of what is linear about the scene. */

#define PROBE_SHARE 0.01 /* of the weight */

bool hapi_range_error_create(hapi_range_error *range, const hapi_capacity *capacity)
{
  range->capacity = capacity->bodies;
  range->bodies = hapi_alloc_array(capacity->bodies, sizeof *range->bodies);
  range->base = hapi_alloc_array(capacity->bodies, sizeof *range->base);
  range->forecasts = hapi_alloc_array(capacity->bodies, sizeof *range->forecasts);
  range->test.keeps_order = true;
  return range->bodies != NULL && range->base != NULL && range->forecasts != NULL;
}

void hapi_range_error_finish(hapi_range_error *range)
{
  hapi_test_finish(&range->test);
  hapi_free(range->bodies);
  hapi_free(range->base);
  hapi_free(range->forecasts);
  memset(range, 0, sizeof *range);
}

void hapi_range_error_reset(hapi_range_error *range)
{
  memset(range->forecasts, 0, range->capacity * sizeof *range->forecasts);
  range->foretold2 = range->error2 = 0.0;
  range->test.steps = 0;
}

bool hapi_range_error_wanted(const hapi_cycle *cycle)
{
  return cycle->model == HAP_MODEL_CONTACT && hapi_wish_is_on(cycle->wishes, HAP_EFFECT_TESTING);
}

/* ---- the last forecast ---- */

static void forecast_compare(hapi_range_error *range, const hapi_cycle *cycle,
                             const hapi_known_body *known, const hapi_body_slot *slot,
                             const hapi_forecast *forecast)
{
  double now[6];
  double impulse[3];
  double error2 = 0.0;
  double foretold2 = 0.0;
  hapi_v3_copy(dBodyGetLinearVel(known->body), now);
  hapi_v3_copy(dBodyGetAngularVel(known->body), now + 3);
  hapi_v3_sub(slot->gain_taken, forecast->gain, impulse);
  for (int i = 0; i < 6; ++i) {
    double weight = i < 3 ? 1.0 : known->extent;
    double foretold =
        weight * (cycle->step_s * forecast->b[i] + hapi_v3_dot(forecast->a[i], impulse));
    double error = weight * (now[i] - forecast->twist[i]) - foretold;
    error2 += error * error;
    foretold2 += foretold * foretold;
  }
  range->error2 += error2;
  range->foretold2 += foretold2;
}

void hapi_range_error_compare(hapi_range_error *range, const hapi_cycle *cycle,
                              const hapi_world *world, const hapi_slots *slots)
{
  HAPI_ASSERT(slots->body_high <= range->capacity);
  for (uint32_t i = 0; i < slots->body_high; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    hapi_forecast *forecast = &range->forecasts[i];
    bool goes_on = slot->phase == HAPI_SLOT_LIVE && forecast->made &&
                   forecast->generation == slot->generation && slot->loop_owned &&
                   !slot->pose_changed && !slot->velocity_changed && cycle->has_new_state;
    if (goes_on) {
      forecast_compare(range, cycle, &world->bodies.entries[slot->known], slot, forecast);
    }
    forecast->made = false;
  }
}

/* ---- the next one ---- */

/* The islands of the neighbours that the loop owns, as far as they can be undone. */
static hap_status owned_gather(hapi_range_error *range, const hapi_cycle *cycle,
                               const hapi_world *world, const hapi_nearby *near)
{
  const hapi_slots *slots = &near->slots;
  range->body_count = 0;
  hap_status status = hapi_test_begin(&range->test, world, cycle->probe_step_s);
  for (uint32_t i = 0; i < slots->body_high && status >= HAP_OK; ++i) {
    const hapi_body_slot *slot = &slots->bodies[i];
    bool owned = slot->phase == HAPI_SLOT_LIVE && (slot->flags & HAPI_BODY_OWNED) != 0;
    if (!owned || (slot->flags & HAPI_BODY_RESTING) != 0 ||
        !hapi_nearby_chose(near, slot->known, cycle->model_number + 1)) {
      continue;
    }
    bool testable = false;
    status = hapi_test_add_island(&range->test, slot->known, &testable);
    if (status >= HAP_OK && testable) {
      range->bodies[range->body_count++] = i;
    }
  }
  return status;
}

/* The contact of a sphere that touches the body; NULL: it is pushed at its centre. */
static const hapi_contact_slot *body_contact(const hapi_slots *slots, uint32_t body)
{
  for (uint32_t i = 0; i < slots->contact_high; ++i) {
    const hapi_contact_slot *contact = &slots->contacts[i];
    if (contact->phase == HAPI_SLOT_LIVE && contact->body == body && !contact->is_tool) {
      return contact;
    }
  }
  return NULL;
}

static void body_push(const hapi_range_error *range, const hapi_slots *slots, uint32_t index,
                      const double force[3])
{
  const hapi_contact_slot *contact = body_contact(slots, index);
  dBodyID body = hapi_test_state(&range->test, slots->bodies[index].known)->body;
  dBodyAddForce(body, force[0], force[1], force[2]);
  if (contact != NULL) {
    double arm[3];
    double moment[3];
    hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
    hapi_v3_cross(arm, force, moment);
    dBodyAddTorque(body, moment[0], moment[1], moment[2]);
  }
}

static void bodies_begin_step(hapi_range_error *range, const hapi_slots *slots)
{
  hapi_test_rewind(&range->test);
  for (uint32_t i = 0; i < range->body_count; ++i) {
    const hapi_contact_slot *contact = body_contact(slots, range->bodies[i]);
    if (contact != NULL) {
      body_push(range, slots, range->bodies[i], contact->last_force);
    }
  }
}

/* b without the force of the pointer, which is in the impulse that is compared. */
static void body_foretell(hapi_range_error *range, const hapi_slots *slots, uint32_t index,
                          const double base[6])
{
  const hapi_body_slot *slot = &slots->bodies[index];
  const hapi_contact_slot *contact = body_contact(slots, index);
  const double force = PROBE_SHARE * HAPI_STANDARD_GRAVITY * slot->mass;
  hapi_forecast *out = &range->forecasts[index];
  for (int axis = 0; axis < 3; ++axis) {
    double along[3] = {0.0, 0.0, 0.0};
    double column[6];
    along[axis] = force;
    bodies_begin_step(range, slots);
    body_push(range, slots, index, along);
    hapi_test_step(&range->test);
    hapi_test_acceleration(&range->test, slot->known, column);
    for (int i = 0; i < 6; ++i) {
      out->a[i][axis] = (column[i] - base[i]) / force;
    }
  }
  for (int i = 0; i < 6; ++i) {
    out->b[i] = base[i] - (contact != NULL ? hapi_v3_dot(out->a[i], contact->last_force) : 0.0);
  }
  const hapi_body_state *before = hapi_test_state(&range->test, slot->known);
  hapi_v3_copy(before->linear, out->twist);
  hapi_v3_copy(before->angular, out->twist + 3);
  hapi_v3_copy(slot->gain_taken, out->gain);
  out->generation = slot->generation;
  out->made = hapi_finite(out->a[0], 18) && hapi_finite(out->b, 6);
}

static void bodies_foretell(hapi_range_error *range, const hapi_slots *slots)
{
  bodies_begin_step(range, slots);
  hapi_test_step(&range->test);
  for (uint32_t i = 0; i < range->body_count; ++i) {
    hapi_test_acceleration(&range->test, slots->bodies[range->bodies[i]].known, range->base[i]);
  }
  for (uint32_t i = 0; i < range->body_count; ++i) {
    body_foretell(range, slots, range->bodies[i], range->base[i]);
  }
}

void hapi_range_error_measure(hapi_range_error *range, const hapi_cycle *cycle,
                              const hapi_world *world, const hapi_nearby *near)
{
  hap_status status = owned_gather(range, cycle, world, near);
  if (status >= HAP_OK && range->body_count > 0) {
    status = hapi_test_enter(&range->test);
  }
  if (status < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; no error of the range is told");
  } else if (range->body_count > 0) {
    bodies_foretell(range, &near->slots);
    hapi_test_leave(&range->test);
  }
}
