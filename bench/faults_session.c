/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The same worlds in a session, by public headers alone. */

#include <math.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "bench/faults.h"

#define MAX_TORQUE 1.0

typedef struct run_state {
  faults_world w;
  double physics_hz;
  double world_s; /* time of the application's world */
  unsigned long steps;
  double open; /* m, the widest hinge so far */
} run_state;

static atomic_ulong lines_said;

static void count_line(hap_log_level level, const char *text, void *user)
{
  (void)text, (void)user;
  if (level != HAP_LOG_INFO) {
    atomic_fetch_add(&lines_said, 1);
  }
}

static bool pair_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  const run_state *run = user;
  dBodyID x = dGeomGetBody(a);
  io->mu = run->w.mu;
  return !run->w.scene->has_own_contacts && (x == NULL || x != dGeomGetBody(b));
}

static void before_step(void *user, double step_s)
{
  run_state *run = user;
  if (run->w.scene->before != NULL) {
    run->w.scene->before(&run->w, run->world_s, run->world_s + step_s);
  }
}

static void after_step(void *user, double step_s)
{
  run_state *run = user;
  if (run->w.scene->after != NULL) {
    run->w.scene->after(&run->w, run->world_s, run->world_s + step_s);
  }
  run->world_s += step_s;
  ++run->steps;
  run->open = fmax(run->open, faults_world_open(&run->w));
}

/* Corners of a cube whose half edge is the pointer's radius. */
static void cube_corners(double half, double out[FAULTS_HULL_MAX][3])
{
  for (int i = 0; i < FAULTS_HULL_MAX; ++i) {
    for (int k = 0; k < 3; ++k) {
      out[i][k] = (i >> k & 1) != 0 ? half : -half;
    }
  }
}

static hap_status pointer_add(bench *b, const faults_scene *scene, hap_session *session,
                              hap_pointer_id *out)
{
  const faults_motion *m = &scene->motion;
  double corners[FAULTS_HULL_MAX][3];
  hap_pointer_def def;
  hap_pointer_expert_def expert;
  hap_pointer_def_init(&def, sizeof def);
  hap_pointer_expert_def_init(&expert, sizeof expert);
  def.radius = m->radius;
  def.stiffness = m->stiffness;
  def.damping = m->damping;
  def.friction = m->friction;
  def.max_force = m->max_force > 0.0 ? m->max_force : def.max_force;
  def.max_torque = MAX_TORQUE;
  if (m->cube_tool) {
    cube_corners(m->radius, corners);
    def.radius = 0.0;
    def.hull_xyz = &corners[0][0];
    def.hull_points = FAULTS_HULL_MAX;
  }
  if (m->through != NULL) {
    if (!bench_find_coupling(m->through, &expert.coupling)) {
      return bench_fail(b, HAP_ERROR_ARGUMENT, "no coupling %s", m->through);
    }
    expert.coupling_stiffness = m->stiffness;
    def.expert = &expert;
  }
  return bench_explain(b, session, hap_pointer_add(session, &def, out));
}

/* In lockstep a physics step runs inside of a tick: what such a tick takes longer than others. */
typedef struct tick_times {
  double with_step; /* s, sum */
  double without;
  unsigned long seen; /* steps of the world */
  unsigned long steps;
  unsigned long others;
} tick_times;

static void tick_times_add(tick_times *t, double spent, unsigned long seen)
{
  bool has_step = seen != t->seen;
  t->seen = seen;
  *(has_step ? &t->with_step : &t->without) += spent;
  *(has_step ? &t->steps : &t->others) += 1;
}

static double tick_times_step(const tick_times *t)
{
  if (t->steps == 0 || t->others == 0) {
    return 0.0;
  }
  return t->with_step / (double)t->steps - t->without / (double)t->others;
}

static hap_status ticks_run(bench *b, hap_session *session, hap_pointer_id hand, run_state *run,
                            faults_run *out)
{
  tick_times times = {.steps = 0};
  for (size_t i = 0; i < out->count; ++i) {
    hap_pose pose = {.quat_wxyz = {1.0}};
    hap_twist twist = {{0.0}, {0.0}};
    hap_pointer_state state;
    faults_hand(&run->w.scene->motion, (double)i * FAULTS_TICK_S, pose.position, twist.linear);
    hap_status status = hap_pointer_set_target(session, hand, &pose, &twist);
    if (status >= HAP_OK && i == 0) {
      status = hap_session_start(session);
    }
    double begin = bench_used_seconds();
    if (status >= HAP_OK) {
      status = hap_session_advance(session, 1);
    }
    tick_times_add(&times, bench_used_seconds() - begin, run->steps);
    if (status >= HAP_OK) {
      status = hap_pointer_get(session, hand, &state, sizeof state);
    }
    if (status < HAP_OK) {
      return bench_explain(b, session, status);
    }
    memcpy(out->force[i], state.wrench.force, sizeof out->force[i]);
    out->told[i] = run->w.told;
  }
  out->duty = tick_times_step(&times);
  return HAP_OK;
}

/* In real time: a frame of the application is a step of physics, in slow motion. */
static hap_status frames_run(bench *b, hap_session *session, hap_pointer_id hand, run_state *run,
                             faults_run *out)
{
  const faults_scene *scene = run->w.scene;
  double frame_s = 1.0 / run->physics_hz;
  double next_frame = frame_s;
  struct timespec at;
  clock_gettime(CLOCK_MONOTONIC, &at);
  for (size_t i = 0; i < out->count; ++i) {
    hap_pose pose = {.quat_wxyz = {1.0}};
    hap_twist twist = {{0.0}, {0.0}};
    hap_pose drawn;
    hap_pointer_state state;
    double t = (double)i * FAULTS_TICK_S;
    faults_hand(&scene->motion, t, pose.position, twist.linear);
    hap_status status = hap_pointer_set_target(session, hand, &pose, &twist);
    if (status >= HAP_OK && i == 0) {
      status = hap_session_set_time_scale(session, scene->slow);
    }
    if (status >= HAP_OK && i == 0) {
      status = hap_session_start(session);
    }
    if (status >= HAP_OK && t >= next_frame) {
      next_frame += frame_s;
      status = hap_session_update(session, frame_s);
    }
    at.tv_nsec += (long)(1e9 * FAULTS_TICK_S);
    at.tv_sec += at.tv_nsec / 1000000000;
    at.tv_nsec %= 1000000000;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
    if (status >= HAP_OK) {
      status = hap_pointer_get(session, hand, &state, sizeof state);
    }
    if (status >= HAP_OK && run->w.body_count > 0) {
      status = hap_session_poses_now(session, run->w.bodies, 1, &drawn);
      out->told[i] = drawn.position[2];
    }
    if (status < HAP_OK) {
      return bench_explain(b, session, status);
    }
    memcpy(out->force[i], state.wrench.force, sizeof out->force[i]);
  }
  return HAP_OK;
}

static hap_status session_make(bench *b, hap_model model, run_state *run, hap_session **out)
{
  hap_session_def def;
  hap_research_def research;
  hap_ode_def ode;
  hap_session_def_init(&def, sizeof def);
  hap_research_def_init(&research, sizeof research);
  hap_ode_def_init(&ode, sizeof ode);
  def.drive = run->w.scene->slow > 0.0 ? HAP_DRIVE_FRAME : HAP_DRIVE_LOCKSTEP;
  def.model = model;
  def.physics_hz = run->physics_hz;
  /* In slow motion the guard fades the force while physics waits: that is felt too. */
  research.guard = run->w.scene->slow > 0.0 ? HAP_GUARD_ON : HAP_GUARD_MEASURE;
  def.research = &research;
  ode.world = run->w.world;
  ode.space = run->w.space;
  ode.surface = pair_surface;
  ode.before_step = before_step;
  ode.after_step = after_step;
  ode.user = run;
  return hap_session_create(&def, &ode, out, &b->detail);
}

static hap_model scene_model(const faults_scene *scene)
{
  int model = HAP_MODEL_SINGLE;
  while (scene->check.model != NULL && hap_model_name((hap_model)model) != NULL &&
         strcmp(hap_model_name((hap_model)model), scene->check.model) != 0) {
    ++model;
  }
  return scene->check.model == NULL ? HAP_MODEL_CONTACT : (hap_model)model;
}

hap_status faults_session_run(bench *b, const faults_scene *scene, double physics_hz,
                              faults_run *out)
{
  run_state run = {.physics_hz = physics_hz};
  hap_session *session = NULL;
  hap_pointer_id hand = {0};
  hap_stats stats;
  hap_hooks hooks;
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = count_line;
  atomic_store(&lines_said, 0);
  if (hap_hooks_set(&hooks) < HAP_OK || !faults_run_create(scene, out) ||
      !faults_world_create(scene, scene->alike, &run.w)) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for %s", scene->name);
  }
  hap_status status = session_make(b, scene_model(scene), &run, &session);
  if (status >= HAP_OK) {
    status = pointer_add(b, scene, session, &hand);
  }
  if (status >= HAP_OK) {
    status = scene->slow > 0.0 ? frames_run(b, session, hand, &run, out)
                               : ticks_run(b, session, hand, &run, out);
  }
  if (status >= HAP_OK && hap_session_stats(session, &stats, sizeof stats) >= HAP_OK) {
    out->dropped = (unsigned long)stats.model.capacity_dropped;
    const hap_cycle_times *mean = &stats.physics.mean;
    double plain = (mean->collide_ms + mean->step_ms) / stats.physics.ms_mean;
    out->duty *= physics_hz;
    out->duty_own = out->duty * (1.0 - plain);
    out->joint_open = run.open;
  }
  hap_session_destroy(session);
  faults_world_destroy(&run.w);
  (void)hap_hooks_set(NULL);
  out->said = atomic_load(&lines_said);
  return status;
}
