/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

/* Physics' part of the statistics. */

void hapi_counts_show(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->counts.lock);
  physics->counts.shown = physics->counts.own;
  physics->counts.shown.range_s = physics->near.counts.range_s;
  physics->counts.shown.beyond_s = physics->near.counts.beyond_s;
  physics->counts.shown_account = physics->account.counts;
  /* What the parts count themselves. */
  hap_stats *shown = &physics->counts.shown.stats;
  const hapi_world *world = &physics->world;
  const hapi_probe *probe = &physics->probe;
  const hapi_cross_counts *cross = &physics->cross.counts;
  shown->model.bodies_known = world->bodies.used;
  shown->faults.bodies_lost = world->bodies.lost;
  shown->physics.quickstep_calls += world->counts.steps + probe->test.steps;
  shown->faults.contacts_rejected += world->counts.contacts_rejected;
  shown->faults.states_rejected += physics->account.counts.states_rejected;
  shown->model.capacity_dropped += physics->account.counts.dropped;
  shown->edits.run = physics->edits.run;
  shown->physics.missed += physics->tape.played_missed;
  shown->physics.frames_dropped += physics->tape.played_dropped;
  shown->probes.steps = probe->test.steps + probe->counts.joint_steps;
  shown->probes.clipped = probe->counts.clipped + cross->clipped;
  shown->probes.singular = probe->counts.singular + cross->singular;
  shown->probes.reused = probe->counts.reused;
  shown->model.measured_joints = probe->counts.joints;
  shown->model.joint_error = probe->counts.joint_error;
  shown->model.capacity_dropped += cross->dropped;
  shown->physics.quickstep_calls += physics->lookback.counts.steps;
  shown->faults.contacts_rejected += physics->lookback.counts.contacts_rejected;
  shown->error.lookbacks = physics->lookback.counts.windows;
  shown->error.spoilt = physics->lookback.counts.spoilt;
  shown->error.force_error = physics->lookback.counts.force_error;
  shown->error.force_error_n = physics->lookback.counts.force_error_n;
  shown->room.turns = physics->room.turns;
  shown->room.update_ns = hapi_room_update_ns(physics->room.pace);
  shown->room.tick_work =
      hapi_room_work(physics->room.pace + physics->room.margin, physics->config.haptic_hz);
  shown->room.range_most = physics->room.bodies;
  shown->room.range_cut = physics->near.range.cut;
  const hapi_near_counts *near = &physics->near.counts;
  shown->model.capacity_dropped += near->dropped;
  shown->ahead = (hap_ahead_stats){.look_ahead_s = physics->config.look_ahead_s,
                                   .dropped = near->ahead_all,
                                   .dropped_now = near->ahead_dropped};
  shown->model.range_bodies = near->range_bodies;
  shown->model.edge_bodies = near->edge_bodies;
  shown->model.measured_bodies = near->measured_bodies;
  shown->model.range_joints = near->range_joints;
  shown->physics.last.range_ms = 1e3 * near->last_range_s;
  physics->counts.shown.cross_s = physics->cross.counts.seconds;
  pthread_mutex_unlock(&physics->counts.lock);
}

void hapi_physics_count_dropped_frames(hapi_physics *physics, uint64_t steps)
{
  /* In drive FRAME physics is the caller; but the table of bodies may be another's now. */
  physics->counts.own.stats.physics.frames_dropped += steps;
  physics->tape.dropped_unrecorded += steps;
  pthread_mutex_lock(&physics->counts.lock);
  physics->counts.shown.stats.physics.frames_dropped += steps;
  pthread_mutex_unlock(&physics->counts.lock);
}

void hapi_physics_accuracy(hapi_physics *physics, hap_accuracy_info *out)
{
  pthread_mutex_lock(&physics->counts.lock);
  *out = physics->counts.shown.accuracy;
  pthread_mutex_unlock(&physics->counts.lock);
}

uint64_t hapi_physics_bodies_lost(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->counts.lock);
  uint64_t lost = physics->counts.shown.stats.faults.bodies_lost;
  pthread_mutex_unlock(&physics->counts.lock);
  return lost;
}

void hapi_physics_stats(hapi_physics *physics, hap_stats *out)
{
  pthread_mutex_lock(&physics->counts.lock);
  hap_stats loop = *out;
  *out = physics->counts.shown.stats;
  out->size = loop.size;
  out->hand.impulse_abs_ns = loop.hand.impulse_abs_ns;
  const hapi_counts *counts = &physics->counts;
  const hapi_physics_counts *f = &counts->shown;
  double per_cycle = f->cycles > 0 ? 1e3 / (double)f->cycles : 0.0;
  out->physics.mean.collide_ms = per_cycle * f->collide_s;
  out->physics.mean.neighbour_ms = per_cycle * f->neighbour_s;
  out->physics.mean.testing_ms = per_cycle * f->testing_s;
  out->physics.mean.step_ms = per_cycle * f->step_s;
  out->physics.mean.range_ms = per_cycle * f->range_s;
  out->physics.mean.publish_ms = per_cycle * f->publish_s;
  out->physics.ms_mean = 1e-6 * hapi_histogram_mean_ns(&counts->cycle_ns);
  out->physics.ms_p99 = 1e-6 * hapi_histogram_quantile_ns(&counts->cycle_ns, 0.99);
  out->physics.ms_max = 1e-6 * hapi_histogram_max_ns(&counts->cycle_ns);
  out->physics.duty =
      1e-3 * out->physics.ms_mean / hapi_wanted_period(&physics->wanted, &physics->config);
  const hapi_lock_figures *lock = &physics->lock.figures;
  out->edits.locks = atomic_load(&lock->count);
  out->edits.wait_ms_max = 1e-6 * (double)atomic_load(&lock->wait_most_ns);
  out->edits.held_ms_max = 1e-6 * (double)atomic_load(&lock->held_most_ns);
  /* Impulse on the world over impulse of the hands, along the latter. */
  const hapi_account_counts *account = &physics->counts.shown_account;
  double net2 = hapi_v3_dot(account->hand_impulse, account->hand_impulse);
  double difference[3];
  hapi_v3_sub(account->world_impulse, account->hand_impulse, difference);
  out->hand.momentum_error_ns = hapi_v3_norm(difference);
  bool meaningful = net2 > 0.0 && sqrt(net2) >= 0.05 * out->hand.impulse_abs_ns;
  out->hand.momentum_ratio =
      meaningful ? hapi_v3_dot(account->world_impulse, account->hand_impulse) / net2 : (double)NAN;
  pthread_mutex_unlock(&physics->counts.lock);
  out->physics.pose_delay_s = hapi_poses_delay(&physics->drawing);
}

void hapi_physics_effects(hapi_physics *physics, hap_effect_info *out)
{
  uint32_t wishes = atomic_load(&physics->wanted.effects);
  pthread_mutex_lock(&physics->counts.lock);
  const hapi_physics_counts *shown = &physics->counts.shown;
  double per_step = shown->cycles > 0 ? 1e3 / (double)shown->cycles : (double)NAN;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    out[i].wish = (uint32_t)hapi_wish(wishes, (hap_effect)i);
    out[i].state = shown->effects[i].state;
    out[i].reason = shown->effects[i].reason;
    out[i].on = shown->effects[i].on;
    out[i].of = shown->effects[i].of;
  }
  out[HAP_EFFECT_TESTING].physics_ms = per_step * shown->testing_s;
  out[HAP_EFFECT_CROSS].physics_ms = per_step * shown->cross_s;
  out[HAP_EFFECT_CONTACTS].physics_ms = per_step * shown->range_s;
  out[HAP_EFFECT_RANGE].physics_ms = per_step * shown->beyond_s;
  out[HAP_EFFECT_JOINTS].physics_ms = per_step * shown->joints_s;
  pthread_mutex_unlock(&physics->counts.lock);
}
