/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

/* Physics' part of the statistics. */

/* What the parts count themselves. */
static void counts_gather(const hapi_physics *physics, hap_stats *io_stats)
{
  const hapi_world *world = &physics->world;
  io_stats->bodies_known = world->bodies.used;
  io_stats->bodies_lost = world->bodies.lost;
  io_stats->quickstep_calls += world->counts.steps;
  io_stats->contacts_rejected += world->counts.contacts_rejected;
}

void hapi_counts_show(hapi_physics *physics)
{
  pthread_mutex_lock(&physics->counts.lock);
  physics->counts.shown = physics->counts.own;
  counts_gather(physics, &physics->counts.shown.stats);
  pthread_mutex_unlock(&physics->counts.lock);
}

void hapi_counts_range(hapi_physics *physics, double seconds)
{
  physics->counts.own.range_s += seconds;
  physics->counts.own.stats.last_range_ms = 1e3 * seconds;
}

void hapi_physics_count_dropped_frames(hapi_physics *physics, uint64_t steps)
{
  /* In drive FRAME physics is the caller; but the table of bodies may be another's now. */
  physics->counts.own.stats.frames_dropped += steps;
  physics->tape.dropped_unrecorded += steps;
  pthread_mutex_lock(&physics->counts.lock);
  physics->counts.shown.stats.frames_dropped = physics->counts.own.stats.frames_dropped;
  pthread_mutex_unlock(&physics->counts.lock);
}

static void fill_lock(const hapi_physics *physics, hap_stats *out)
{
  const hapi_lock_figures *f = &physics->lock.figures;
  out->locks = atomic_load(&f->count);
  out->lock_wait_ms_max = 1e-6 * (double)atomic_load(&f->wait_most_ns);
  out->lock_held_ms_max = 1e-6 * (double)atomic_load(&f->held_most_ns);
}

static void fill_times(const hapi_physics *physics, hap_stats *out)
{
  const hapi_physics_counts *f = &physics->counts.shown;
  double per_cycle = f->cycles > 0 ? 1e3 / (double)f->cycles : 0.0;
  out->collide_ms_mean = per_cycle * f->collide_s;
  out->neighbour_ms_mean = per_cycle * f->neighbour_s;
  out->testing_ms_mean = per_cycle * f->testing_s;
  out->step_ms_mean = per_cycle * f->step_s;
  out->range_ms_mean = per_cycle * f->range_s;
  out->publish_ms_mean = per_cycle * f->publish_s;
  out->range_error = f->foretold2 > 0.0 ? sqrt(f->range_error2 / f->foretold2) : 0.0;
  out->physics_ms_mean = 1e-6 * hapi_histogram_mean_ns(&physics->counts.cycle_ns);
  out->physics_ms_p99 = 1e-6 * hapi_histogram_quantile_ns(&physics->counts.cycle_ns, 0.99);
  out->physics_ms_max = 1e-6 * hapi_histogram_max_ns(&physics->counts.cycle_ns);
  out->physics_duty = 1e-3 * out->physics_ms_mean / hapi_physics_next_period(physics);
}

/* Impulse on the world over impulse of the hands, along the latter. */
static void fill_momentum(const hapi_physics *physics, hap_stats *out)
{
  const hapi_physics_counts *f = &physics->counts.shown;
  double net2 = hapi_v3_dot(f->hand_impulse, f->hand_impulse);
  double difference[3];
  hapi_v3_sub(f->world_impulse, f->hand_impulse, difference);
  out->momentum_error_ns = hapi_v3_norm(difference);
  bool meaningful = net2 > 0.0 && sqrt(net2) >= 0.05 * out->impulse_abs_ns;
  out->momentum_ratio =
      meaningful ? hapi_v3_dot(f->world_impulse, f->hand_impulse) / net2 : (double)NAN;
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
  uint64_t lost = physics->counts.shown.stats.bodies_lost;
  pthread_mutex_unlock(&physics->counts.lock);
  return lost;
}

void hapi_physics_stats(hapi_physics *physics, hap_stats *out)
{
  pthread_mutex_lock(&physics->counts.lock);
  hap_stats loop = *out;
  *out = physics->counts.shown.stats;
  out->size = loop.size;
  out->impulse_abs_ns = loop.impulse_abs_ns;
  fill_times(physics, out);
  fill_lock(physics, out);
  fill_momentum(physics, out);
  pthread_mutex_unlock(&physics->counts.lock);
  out->pose_delay_s = hapi_poses_delay(&physics->drawing);
}
