/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/poses_run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/pose.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tools/rig.h"

#define BODIES_MAX 10

/* Where something was: rising times. */
typedef struct path {
  int64_t *times_ns;
  hap_pose *poses;
  size_t count;
  size_t capacity;
} path;

typedef struct run {
  const poses_def *def;
  rig rig;
  size_t bodies;
  double half; /* m, edge of the cubes */
  int64_t tick_ns;
  uint64_t steps; /* physics steps seen */
  path paths[BODIES_MAX];
  path hand;
  hap_pose drawn[BODIES_MAX]; /* in the last frame */
  int64_t drawn_ns;
  hap_pose start;
  poses_result *out;
} run;

static double points_distance(const double a[3], const double b[3])
{
  double d[3];
  hapi_v3_sub(a, b, d);
  return hapi_v3_norm(d);
}

static void path_add(path *p, int64_t time_ns, const hap_pose *pose)
{
  if (p->count < p->capacity) {
    p->times_ns[p->count] = time_ns;
    p->poses[p->count++] = *pose;
  }
}

static bool path_init(path *p, size_t capacity)
{
  p->capacity = capacity;
  p->times_ns = calloc(capacity, sizeof *p->times_ns);
  p->poses = malloc(capacity * sizeof *p->poses);
  return p->times_ns != NULL && p->poses != NULL;
}

static void path_finish(path *p)
{
  free(p->times_ns);
  free(p->poses);
}

/* The last entry up to the time; the first one where there is none. */
static size_t path_find(const path *p, int64_t time_ns)
{
  size_t low = 0;
  size_t high = p->count;
  while (high - low > 1) {
    size_t middle = low + (high - low) / 2;
    *(p->times_ns[middle] <= time_ns ? &low : &high) = middle;
  }
  return low;
}

static hap_pose path_at(const path *p, int64_t time_ns)
{
  hap_pose pose;
  size_t i = path_find(p, time_ns);
  if (i + 1 == p->count || time_ns <= p->times_ns[i]) {
    return p->poses[i];
  }
  double share = (double)(time_ns - p->times_ns[i]) / (double)(p->times_ns[i + 1] - p->times_ns[i]);
  hapi_pose_slerp(&p->poses[i], &p->poses[i + 1], share, &pose);
  return pose;
}

/* m that the path is long between two times. */
static double path_length(const path *p, int64_t from_ns, int64_t to_ns)
{
  hap_pose at = path_at(p, from_ns);
  double length = 0.0;
  for (size_t i = path_find(p, from_ns); i < p->count && p->times_ns[i] < to_ns; ++i) {
    if (p->times_ns[i] > from_ns) {
      length += points_distance(at.position, p->poses[i].position);
      at = p->poses[i];
    }
  }
  hap_pose end = path_at(p, to_ns);
  return length + points_distance(at.position, end.position);
}

/* In model SINGLE the loop shows the world as it is; else it moves bodies that it owns or has
 * pushed since the last sync. What it makes do with of the others, until the next sync, is
 * nobody's path. */
static bool loop_has(const hapi_tick *tick, uint32_t slot)
{
  if (slot == HAPI_SLOT_NONE || tick->facts.model == HAP_MODEL_IMPULSE) {
    return false;
  }
  const hapi_local_body *body = &tick->bodies.of[slot];
  return tick->facts.model == HAP_MODEL_SINGLE || (body->flags & HAPI_BODY_OWNED) != 0 ||
         points_distance(body->account.impulse, body->given.impulse_taken) > 0.0;
}

/* A tick moves bodies to the time of the next one. A step of model IMPULSE is for a step ahead, and
 * is reached another one later. */
static void note_tick(run *r)
{
  const hapi_tick *tick = &r->rig.session->haptic->tick;
  int64_t loop_ns = tick->facts.now_ns + (tick->facts.model == HAP_MODEL_SINGLE ? 0 : r->tick_ns);
  int64_t ahead_ns =
      tick->facts.model == HAP_MODEL_IMPULSE ? (int64_t)(2e9 / r->def->physics_hz) : 0;
  int64_t step_ns = hapi_physics_last_cycle(r->rig.session->physics);
  hap_stats stats = {0};
  (void)hap_session_stats(r->rig.session, &stats, sizeof stats);
  bool stepped = stats.physics.steps != r->steps;
  r->steps = stats.physics.steps;
  for (size_t i = 0; i < r->bodies; ++i) {
    uint32_t slot = i < tick->watch.count ? tick->watch.slot[i] : HAPI_SLOT_NONE;
    hap_pose pose;
    hapi_v3_copy(dBodyGetPosition(r->rig.scene->bodies[i]), pose.position);
    memcpy(pose.quat_wxyz, dBodyGetQuaternion(r->rig.scene->bodies[i]), sizeof pose.quat_wxyz);
    if (loop_has(tick, slot)) {
      path_add(&r->paths[i], loop_ns, &tick->bodies.of[slot].pose);
    } else if (stepped) {
      path_add(&r->paths[i], step_ns + ahead_ns, &pose);
    }
  }
  const hapi_pointer *pointer = &tick->pointers.of[0];
  path_add(&r->hand, tick->facts.now_ns + (pointer->proxied ? r->tick_ns : 0), &pointer->pose);
}

static void worst_raise(double *out_mm, double metres)
{
  *out_mm = 1e3 * metres > *out_mm ? 1e3 * metres : *out_mm;
}

/* How far a point, given in frame a, is from where it is when frame b is taken for a. */
static double shift_between(const hap_pose *own_a, const hap_pose *own_b, const hap_pose *drawn_a,
                            const hap_pose *drawn_b, const double point_b[3])
{
  double own[3];
  double drawn[3];
  hapi_pose_point(own_b->position, own_b->quat_wxyz, point_b, own);
  hapi_pose_unpoint(own_a->position, own_a->quat_wxyz, own, own);
  hapi_pose_point(drawn_b->position, drawn_b->quat_wxyz, point_b, drawn);
  hapi_pose_unpoint(drawn_a->position, drawn_a->quat_wxyz, drawn, drawn);
  return points_distance(own, drawn);
}

static void compare_bodies(run *r, size_t i, int64_t time_ns, const hap_pose *drawn)
{
  static const hap_pose world = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  hap_pose own = path_at(&r->paths[i], time_ns);
  for (int corner = 0; corner < 8; ++corner) {
    double point[3] = {corner & 1 ? r->half : -r->half, corner & 2 ? r->half : -r->half,
                       corner & 4 ? r->half : -r->half};
    worst_raise(&r->out->path_mm, shift_between(&world, &own, &world, &drawn[i], point));
    if (i > 0) {
      hap_pose before = path_at(&r->paths[i - 1], time_ns);
      worst_raise(&r->out->gap_mm, shift_between(&before, &own, &drawn[i - 1], &drawn[i], point));
    }
  }
  if (r->out->frames > 0) {
    double along = path_length(&r->paths[i], r->drawn_ns, time_ns);
    worst_raise(&r->out->jump_mm, points_distance(drawn[i].position, r->drawn[i].position) - along);
  }
}

static void compare_hand(run *r, int64_t time_ns, const hap_pose *body, const hap_pose *hand)
{
  static const double center[3] = {0.0, 0.0, 0.0};
  hap_pose own_body = path_at(&r->paths[0], time_ns);
  hap_pose own_hand = path_at(&r->hand, time_ns);
  hap_pointer_state newest;
  worst_raise(&r->out->hand_mm, shift_between(&own_body, &own_hand, body, hand, center));
  if (hap_pointer_get(r->rig.session, r->rig.pointers[0], &newest, sizeof newest) >= HAP_OK) {
    worst_raise(&r->out->undelayed_mm,
                shift_between(&own_body, &own_hand, body, &newest.proxy, center));
  }
}

/* Back along the way of the path from frame to frame. */
static void look_back(run *r, int64_t time_ns, const hap_pose *body)
{
  hap_pose from = path_at(&r->paths[0], r->drawn_ns);
  hap_pose to = path_at(&r->paths[0], time_ns);
  double own[3];
  double drawn[3];
  hapi_v3_sub(to.position, from.position, own);
  hapi_v3_sub(body->position, r->drawn[0].position, drawn);
  double way = hapi_v3_norm(own);
  if (r->out->frames > 0 && way > 0.0) {
    worst_raise(&r->out->back_mm, -hapi_v3_dot(own, drawn) / way);
  }
}

static hap_status draw_frame(run *r, int64_t now_ns, hap_detail *detail)
{
  hap_session *session = r->rig.session;
  hap_pose drawn[BODIES_MAX];
  hap_pose hand;
  hap_stats stats = {0};
  hap_status status = hap_session_poses(session, now_ns, r->rig.scene->bodies, r->bodies, drawn);
  if (status == HAP_OK) {
    status = hap_pointer_poses(session, r->rig.pointers[0], now_ns, &hand, NULL);
  }
  if (status != HAP_OK || hap_session_stats(session, &stats, sizeof stats) < HAP_OK) {
    return hapi_fail(detail, HAP_ERROR_STATE, "poses at %.4f s: %s", 1e-9 * (double)now_ns,
                     hap_status_name(status));
  }
  int64_t time_ns = now_ns - (int64_t)llround(1e9 * stats.physics.pose_delay_s);
  if (time_ns < r->paths[0].times_ns[0] || time_ns < r->hand.times_ns[0]) {
    return HAP_OK; /* before the start */
  }
  for (size_t i = 0; i < r->bodies; ++i) {
    compare_bodies(r, i, time_ns, drawn);
  }
  compare_hand(r, time_ns, &drawn[0], &hand);
  look_back(r, time_ns, &drawn[0]);
  worst_raise(&r->out->moved_mm, points_distance(drawn[0].position, r->start.position));
  memcpy(r->drawn, drawn, sizeof drawn);
  r->drawn_ns = time_ns;
  ++r->out->frames;
  return HAP_OK;
}

static hap_status run_frames(run *r, hap_detail *detail)
{
  uint64_t ticks = (uint64_t)llround(1e9 * r->def->seconds) / (uint64_t)r->tick_ns;
  uint64_t frame = 1;
  hap_status status = hap_session_start(r->rig.session);
  hapi_v3_copy(dBodyGetPosition(r->rig.scene->bodies[0]), r->start.position);
  for (uint64_t i = 0; i < ticks && status >= HAP_OK; ++i) {
    int64_t due = (int64_t)llround(1e9 * (double)frame / r->def->frame_hz);
    status = hap_session_advance(r->rig.session, 1);
    note_tick(r);
    if (status >= HAP_OK && hap_session_now(r->rig.session) >= due) {
      status = draw_frame(r, due, detail);
      ++frame;
    }
  }
  return status;
}

static hap_status open_run(run *r, hap_detail *detail)
{
  rig_options options;
  rig_options_init(&options);
  options.scene = r->def->scene;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.research.guard = HAP_GUARD_MEASURE;
  options.def.model = r->def->model;
  options.def.physics_hz = r->def->physics_hz;
  options.def.max_bodies = r->def->max_bodies > 0 ? r->def->max_bodies : options.def.max_bodies;
  hap_status status = rig_create(&options, &r->rig, detail);
  if (status < HAP_OK) {
    return status;
  }
  r->tick_ns = (int64_t)llround(1e9 / options.def.haptic_hz);
  r->half = 0.5 * r->rig.scene->parameters.size;
  r->bodies = r->rig.scene->body_count < BODIES_MAX ? r->rig.scene->body_count : BODIES_MAX;
  size_t rows = 2 * (size_t)ceil(r->def->seconds * options.def.haptic_hz) + 16;
  bool good = path_init(&r->hand, rows);
  for (size_t i = 0; i < r->bodies; ++i) {
    good = path_init(&r->paths[i], rows) && good;
  }
  return good ? HAP_OK : hapi_fail(detail, HAP_ERROR_MEMORY, "no memory for the paths");
}

hap_status poses_measure(const poses_def *def, poses_result *out, hap_detail *detail)
{
  run r;
  memset(&r, 0, sizeof r);
  memset(out, 0, sizeof *out);
  r.def = def;
  r.out = out;
  hap_status status = open_run(&r, detail);
  if (status >= HAP_OK) {
    status = run_frames(&r, detail);
  }
  for (size_t i = 0; i < BODIES_MAX; ++i) {
    path_finish(&r.paths[i]);
  }
  path_finish(&r.hand);
  if (r.rig.session != NULL) {
    rig_destroy(&r.rig);
  }
  return status;
}
