/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "bench/peers_run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "bench/peer_ode.h"

#define MAX_FORCE 200.0 /* N: nothing limits the hand */
#define FULL_ACCURACY 1.0
#define FULL_CONTACT_HZ 1000.0

static size_t settle_ticks(const peer_world *world, double tick_s)
{
  return (size_t)lround(world->hand.settle_s / tick_s);
}

static hap_status run_create(bench *b, const peer_world *world, double tick_s, peers_run *out)
{
  memset(out, 0, sizeof *out);
  out->tick_s = tick_s;
  out->count = (size_t)lround(world->hand.seconds / tick_s);
  out->parts.contact = out->parts.physics = (double)NAN;
  out->force = calloc(out->count, sizeof *out->force);
  out->tick_us = calloc(out->count, sizeof *out->tick_us);
  if (out->force == NULL || out->tick_us == NULL) {
    (void)bench_fail(b, HAP_ERROR_MEMORY, "no memory for the forces");
    return HAP_ERROR_MEMORY;
  }
  return HAP_OK;
}

void peers_run_free(peers_run *run)
{
  free(run->force);
  free(run->tick_us);
  memset(run, 0, sizeof *run);
}

static double wall_us(void)
{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static double way_from(const double a[3], const double b[3])
{
  return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static void run_note_use(peers_run *run, double used_s)
{
  run->us_per_ms = 1e6 * used_s / (1e3 * run->tick_s * (double)run->count);
}

/* ---- an engine ---- */

/* What an application does in each of its steps: where the boxes are, the hand's force, a step. */
static void engine_tick(const peer_engine *engine, void *sim, const peer_world *world,
                        const peer_reach *reach, double t, double out_force[3])
{
  peer_motion motions[PEER_REACH_MAX];
  peer_push pushes[PEER_REACH_MAX];
  for (size_t i = 0; i < reach->count; ++i) {
    engine->read(sim, reach->boxes[i], &motions[i]);
  }
  size_t count = peer_hand_push(world, reach, motions, t, pushes, out_force);
  engine->step(sim, pushes, count);
}

static void engine_rest(const peer_engine *engine, const void *sim, const peer_world *world,
                        peers_run *out)
{
  for (size_t i = 0; i < world->count; ++i) {
    peer_motion motion;
    engine->read(sim, i, &motion);
    out->rest = fmax(out->rest, way_from(motion.position, world->boxes[i].at));
    out->asleep += engine->sleeps(sim, i);
  }
}

hap_status peers_run_engine(bench *b, const peer_engine *engine, const peer_world *world,
                            const peer_setting *setting, peers_run *out)
{
  double ignored[3];
  peer_reach reach;
  hap_status status = run_create(b, world, setting->step_s, out);
  void *sim = status >= HAP_OK ? engine->create(world, setting) : NULL;
  if (sim == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "%s could not build the world", engine->name);
  }
  size_t settle = settle_ticks(world, out->tick_s);
  peer_reach_find(world, &reach);
  for (size_t i = 0; i < settle; ++i) {
    engine_tick(engine, sim, world, &reach, out->tick_s * (double)i, ignored);
  }
  engine_rest(engine, sim, world, out);
  double used = bench_used_seconds();
  for (size_t i = 0; i < out->count; ++i) {
    double begin = wall_us();
    engine_tick(engine, sim, world, &reach, out->tick_s * (double)(settle + i), out->force[i]);
    out->tick_us[i] = wall_us() - begin;
  }
  run_note_use(out, bench_used_seconds() - used);
  engine->destroy(sim);
  return HAP_OK;
}

/* ---- a session ---- */

/* us, since the session began: contact passes, cycles. */
static void parts_read(const hap_session *session, double out[2], peers_run *io)
{
  hap_stats stats;
  if (hap_session_stats(session, &stats, sizeof stats) < HAP_OK) {
    out[0] = out[1] = (double)NAN;
    return;
  }
  out[0] = stats.contact.us_mean * (double)stats.contact.passes;
  out[1] = 1e3 * stats.physics.ms_mean * (double)stats.physics.steps;
  io->owned = stats.model.range_bodies;
  io->cut = stats.room.range_cut != 0;
}

static void parts_note(peers_run *run, const double before[2], const double after[2])
{
  double ms = 1e3 * run->tick_s * (double)run->count;
  run->parts.contact = (after[0] - before[0]) / ms;
  run->parts.physics = (after[1] - before[1]) / ms;
}

typedef struct session_bed {
  const peer_world *world;
  const peers_session_setting *setting;
  peer_ode_world ode;
  hap_session *session;
  hap_pointer_id hand;
  hap_trace_row *rows; /* of the measured ticks */
} session_bed;

static bool session_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  const session_bed *bed = user;
  io->mu = bed->world->mu;
  return peer_ode_collides(bed->world, a, b);
}

static hap_status session_open(bench *b, size_t ticks, session_bed *bed)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def pointer;
  const peer_hand *hand = &bed->world->hand;
  hap_session_def_init(&def, sizeof def);
  hap_expert_def_init(&expert, sizeof expert);
  hap_research_def_init(&research, sizeof research);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&pointer, sizeof pointer);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = bed->setting->physics_hz;
  def.haptic_hz = bed->setting->haptic_hz;
  expert.trace_rows = (int32_t)ticks;
  if (bed->setting->to_the_end) {
    def.accuracy = FULL_ACCURACY;
    expert.contact_hz = FULL_CONTACT_HZ;
  }
  if (bed->setting->range_hops > 0) {
    expert.range_hops = bed->setting->range_hops;
  }
  if (bed->setting->range_bodies > 0) {
    def.max_bodies = bed->setting->range_bodies;
  }
  if (bed->setting->contacts > 0) {
    def.max_contacts = bed->setting->contacts;
  }
  def.expert = &expert;
  research.guard = HAP_GUARD_MEASURE; /* the hand is a prescribed motion */
  def.research = &research;
  ode.world = bed->ode.world;
  ode.space = bed->ode.space;
  ode.surface = session_surface;
  ode.user = bed;
  ode.max_contacts_per_pair = peer_ode_contacts(bed->world);
  hap_status status = hap_session_create(&def, &ode, &bed->session, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  pointer.radius = hand->radius;
  pointer.stiffness = hand->stiffness;
  pointer.damping = hand->damping;
  pointer.max_force = MAX_FORCE;
  return bench_explain(b, bed->session, hap_pointer_add(bed->session, &pointer, &bed->hand));
}

static hap_status session_tick(bench *b, session_bed *bed, size_t tick, double out_force[3])
{
  hap_pose pose = {.quat_wxyz = {1.0}};
  hap_twist twist = {{0.0}, {0.0}};
  hap_pointer_state state = {0};
  double t = (double)tick / bed->setting->haptic_hz;
  peer_hand_at(&bed->world->hand, t, pose.position, twist.linear);
  hap_status status = hap_pointer_set_target(bed->session, bed->hand, &pose, &twist);
  if (status >= HAP_OK && tick == 0) {
    status = hap_session_start(bed->session);
  }
  if (status >= HAP_OK) {
    status = hap_session_advance(bed->session, 1);
  }
  if (status >= HAP_OK) {
    status = hap_pointer_get(bed->session, bed->hand, &state, sizeof state);
  }
  memcpy(out_force, state.wrench.force, sizeof state.wrench.force);
  return bench_explain(b, bed->session, status);
}

static void session_rest(const session_bed *bed, peers_run *out)
{
  for (size_t i = 0; i < bed->world->count; ++i) {
    const dReal *at = dBodyGetPosition(bed->ode.bodies[i]);
    out->rest = fmax(out->rest, way_from(at, bed->world->boxes[i].at));
    out->asleep += dBodyIsEnabled(bed->ode.bodies[i]) == 0;
  }
}

/* A row has the time of the tick before it: the first one's is of the last tick of settling. */
static hap_status session_times(bench *b, const session_bed *bed, peers_run *out)
{
  size_t got = 0;
  hap_status status =
      hap_session_trace_read(bed->session, bed->rows, out->count, sizeof *bed->rows, &got);
  if (status < HAP_OK || got != out->count) {
    return bench_fail(b, HAP_ERROR_STATE, "the session has told %zu of %zu ticks", got, out->count);
  }
  for (size_t i = 0; i < out->count; ++i) {
    out->tick_us[i] = bed->rows[i].tick_us;
  }
  return HAP_OK;
}

static hap_status session_run(bench *b, session_bed *bed, peers_run *out)
{
  double ignored[3];
  size_t settle = settle_ticks(bed->world, out->tick_s);
  size_t ticks = settle > out->count ? settle : out->count;
  hap_status status = session_open(b, ticks, bed);
  for (size_t i = 0; i < settle && status >= HAP_OK; ++i) {
    status = session_tick(b, bed, i, ignored);
  }
  for (size_t got = 1; got > 0 && status >= HAP_OK;) {
    status = hap_session_trace_read(bed->session, bed->rows, out->count, sizeof *bed->rows, &got);
  }
  session_rest(bed, out);
  double parts[2][2];
  parts_read(bed->session, parts[0], out);
  double used = bench_used_seconds();
  for (size_t i = 0; i < out->count && status >= HAP_OK; ++i) {
    status = session_tick(b, bed, settle + i, out->force[i]);
  }
  used = bench_used_seconds() - used;
  parts_read(bed->session, parts[1], out);
  parts_note(out, parts[0], parts[1]);
  if (status >= HAP_OK) {
    status = session_times(b, bed, out);
  }
  run_note_use(out, used);
  return status;
}

hap_status peers_run_session(bench *b, const peer_world *world,
                             const peers_session_setting *setting, peers_run *out)
{
  session_bed bed = {.world = world, .setting = setting};
  hap_status status = run_create(b, world, 1.0 / setting->haptic_hz, out);
  bed.rows = status >= HAP_OK ? calloc(out->count, sizeof *bed.rows) : NULL;
  if (status >= HAP_OK &&
      (bed.rows == NULL || !peer_ode_world_create(world, setting->may_sleep, &bed.ode))) {
    status = bench_fail(b, HAP_ERROR_MEMORY, "no memory for a world of %zu boxes", world->count);
  }
  if (status >= HAP_OK) {
    status = session_run(b, &bed, out);
  }
  hap_session_destroy(bed.session);
  peer_ode_world_destroy(&bed.ode);
  free(bed.rows);
  return status;
}

/* ---- what a run says ---- */

double peers_run_error(const peers_run *run, const peers_run *truth)
{
  double off = 0.0;
  double all = 0.0;
  if (truth->force == NULL) {
    return (double)NAN;
  }
  for (size_t i = 0; i < run->count && i < truth->count; ++i) {
    for (int k = 0; k < 3; ++k) {
      double d = run->force[i][k] - truth->force[i][k];
      off += d * d;
      all += truth->force[i][k] * truth->force[i][k];
    }
  }
  return sqrt(off / all);
}

static double force_of(const double f[3])
{
  return hypot(hypot(f[0], f[1]), f[2]);
}

double peers_run_peak(const peers_run *run)
{
  double peak = 0.0;
  for (size_t i = 0; i < run->count; ++i) {
    peak = fmax(peak, force_of(run->force[i]));
  }
  return peak;
}

double peers_run_first(const peer_world *world, const peers_run *run)
{
  const peer_hand *hand = &world->hand;
  for (size_t i = 0; i < run->count; ++i) {
    double at[3];
    double velocity[3];
    peer_hand_at(hand, hand->settle_s + run->tick_s * (double)i, at, velocity);
    if (at[0] + hand->radius >= PEERS_FIRST_DEPTH) { /* the face is at x = 0 */
      return force_of(run->force[i]);
    }
  }
  return (double)NAN;
}
