/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/vec.h"
#include "haptic/rt/tick.h"

static void report_bodies(const hapi_tick *tick, hapi_state *out)
{
  hapi_state_body *bodies = hapi_state_bodies(out);
  for (uint32_t i = 0; i < tick->body_high; ++i) {
    const hapi_local_body *in = &tick->bodies[i];
    bodies[i].generation = in->generation;
    bodies[i].flags = in->flags;
    bodies[i].epoch = in->epoch;
    bodies[i].pose = in->pose;
    bodies[i].twist = in->twist;
    hapi_v3_copy(in->impulse, bodies[i].impulse);
    hapi_v3_copy(in->angular_impulse, bodies[i].angular_impulse);
    memcpy(bodies[i].residual, in->residual_taken, sizeof bodies[i].residual);
    memcpy(bodies[i].gain, in->gain, sizeof bodies[i].gain);
    bodies[i].owned_until_ns = in->owned_until_ns;
    if (in->owned_until_ns != 0) {
      bodies[i].owned_pose = in->owned_pose;
      bodies[i].owned_twist = in->owned_twist;
    }
  }
  out->body_high = tick->body_high;
}

static void report_contacts(const hapi_tick *tick, hapi_state *out)
{
  hapi_state_contact *contacts = hapi_state_contacts(out);
  for (uint32_t i = 0; i < tick->contact_count; ++i) {
    const hapi_local_contact *in = &tick->contacts[i];
    contacts[i].slot = in->slot;
    contacts[i].generation = in->generation;
    hapi_v3_copy(in->force, contacts[i].force);
  }
  out->contact_count = tick->contact_count;
}

void hapi_tick_report(const hapi_tick *tick, hapi_state *out)
{
  hapi_v3_copy(tick->hand_impulse, out->hand_impulse);
  hapi_v3_copy(tick->owned_impulse, out->owned_impulse);
  out->now_ns = tick->now_ns;
  out->model_number = tick->model_number;
  out->model = tick->model;
  report_bodies(tick, out);
  report_contacts(tick, out);
  hapi_state_pointer *pointers = hapi_state_pointers(out);
  for (uint32_t i = 0; i < tick->capacity.pointers; ++i) {
    const hapi_tick_pointer *in = &tick->pointers[i];
    pointers[i].generation = in->generation;
    pointers[i].collide_bits = in->collide_bits;
    pointers[i].radius = in->radius;
    pointers[i].stiffness = in->stiffness;
    pointers[i].pose = in->pose;
    pointers[i].twist = in->twist;
  }
}

void hapi_tick_report_poses(const hapi_tick *tick, hapi_poses *out)
{
  hapi_poses_body *bodies = hapi_poses_bodies(out);
  for (uint32_t i = 0; i < tick->live_count; ++i) {
    const hapi_local_body *in = &tick->bodies[tick->live[i]];
    bodies[i].slot = tick->live[i];
    bodies[i].generation = in->generation;
    bodies[i].pose = in->pose;
    bodies[i].twist = in->twist;
  }
  out->body_count = tick->live_count;
  out->model_number = tick->model_number;
}
