/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "base/clock.h"
#include "physics/physics_internal.h"

/* The local model goes out to the loop: each part writes its own into the message. */

static uint32_t count_bounces(const hapi_range *range, hapi_model *model)
{
  if (model->model != HAP_MODEL_CONTACT) {
    return 0;
  }
  uint32_t count = range->number == model->number ? range->bounces : 0;
  for (uint32_t i = 0; i < model->joint_count; ++i) {
    for (int k = 0; k < HAPI_JOINT_LIMITS; ++k) {
      count += hapi_model_joints(model)[i].limits[k].bounce > 0.0;
    }
  }
  return count;
}

static void count_model(hap_stats *stats, const hapi_nearby *near, const hapi_model *model)
{
  stats->model.neighbours = hapi_neighbors_bodies(near);
  stats->model.pointer_contacts = model->contact_count;
  if (model->model == HAP_MODEL_CONTACT && near->range.number == model->number) {
    stats->model.pointer_contacts +=
        near->range.near->tool_pair_count; /* whose points are found later */
  }
  if (stats->model.neighbours > stats->model.neighbours_max) {
    stats->model.neighbours_max = stats->model.neighbours;
  }
}

static void fill_header(hapi_model *out, const hapi_cycle *cycle, int64_t state_ns,
                        int64_t valid_from_ns)
{
  out->number = cycle->model_number;
  out->state_ns = state_ns;
  out->valid_from_ns = valid_from_ns;
  out->blend_s = cycle->model == HAP_MODEL_IMPULSE ? cycle->probe_step_s : 0.0;
  out->model = cycle->model;
  out->impulse_pose = cycle->config->impulse_pose;
  out->wishes = cycle->wishes;
  out->max_sweeps = cycle->settings.max_sweeps;
  out->row_updates = cycle->settings.row_updates;
}

static void send_joints(hapi_physics *physics, const hapi_publishing *p, hapi_model *out)
{
  const hapi_range *range = &physics->near.range;
  int64_t begin_ns = hapi_clock_now();
  out->joint_count = 0;
  if (out->model == HAP_MODEL_CONTACT && range->number == out->number) {
    hapi_joints_take_slots(&physics->world.joints, out->number, range->mechanism.joints,
                           range->mechanism.joint_count);
    hapi_publish_joints(p, range->mechanism.joints, range->mechanism.joint_count, out);
  }
  physics->counts.own.joints_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
}

void hapi_physics_send_model(hapi_physics *physics, int64_t state_ns, int64_t valid_from_ns)
{
  hapi_cycle *cycle = &physics->cycle;
  hapi_model *out = hapi_exchange_model_back(physics->config.exchange);
  const hapi_publishing p = {cycle, &physics->world, &physics->near.slots, &physics->probe.answers,
                             &physics->account};
  ++cycle->model_number;
  HAPI_ASSERT(cycle->probe_step_s > 0.0);
  fill_header(out, cycle, state_ns, valid_from_ns);
  out->sent_ns = hapi_tape_sent(&physics->tape, cycle);
  out->period_s = hapi_config_period(
      &physics->config, hapi_tape_wanted_model(&physics->tape, &physics->wanted, cycle, true));
  out->tick_budget_ns = hapi_dial_tick_budget(&physics->dial, physics->config.haptic_hz);
  hapi_publish_bodies(&p, out);
  hapi_publish_contacts(&p, out);
  out->cross_count = 0;
  for (uint32_t i = 0; i < out->contact_count; ++i) {
    hapi_cross_publish(&physics->cross, hapi_model_contacts(out)[i].slot, i, out);
  }
  send_joints(physics, &p, out);
  out->bounces = count_bounces(&physics->near.range, out);
  hapi_publish_watch(&physics->watch, &physics->world.bodies, out);
  count_model(&physics->counts.own.stats, &physics->near, out);
  out->touches = physics->counts.own.stats.model.pointer_contacts;
  hapi_effects_note(physics->counts.own.effects, cycle, &physics->world, &physics->near,
                    &physics->probe.answers, out);
  hapi_tape_model(&physics->tape, out);
  /* First: the contact thread waits for the loop to use the model. */
  hapi_range_publish(&physics->near);
  hapi_exchange_model_publish(physics->config.exchange);
}
