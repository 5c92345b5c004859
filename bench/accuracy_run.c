/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/log.h"
#include "bench/accuracy.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"

#define UNLIMITED_N 1000.0 /* the guard's limit is far */

void accuracy_run_def_init(accuracy_run_def *def)
{
  hap_session_def library;
  hap_session_def_init(&library, sizeof library);
  memset(def, 0, sizeof *def);
  def->model = library.model;
  def->physics_hz = library.physics_hz;
  def->haptic_hz = library.haptic_hz;
  def->contact_hz = library.contact_hz;
  def->latency_ticks = library.physics_latency_ticks;
  def->probe = library.probe;
  def->cross = (hap_effect_wish)library.effects[HAP_EFFECT_CROSS];
  def->coupling = HAP_COUPLING_DIRECT;
  def->max_sweeps = library.max_sweeps;
  def->range_hops = library.range_hops;
  def->max_edge_probes = library.max_edge_probes;
  def->accuracy = library.accuracy;
  def->reuse = library.reuse;
  def->shape = (hap_effect_wish)library.effects[HAP_EFFECT_SHAPE];
  def->integration = HAP_INTEGRATION_AUTO;
}

/* Before the start: the joints are as the scene has built them. The loop's poses are read through the list of
 * the trace. */
static hap_status open_gauge(const scene *s, joint_gauge *out, hap_detail *detail)
{
  hap_status status = joint_gauge_init(out, s->bodies, s->body_count, detail);
  if (status >= HAP_OK && out->count > 0 && s->body_count > HAP_TRACE_BODIES_MAX) {
    status = hapi_fail(detail, HAP_ERROR_UNSUPPORTED, "%s: joints, and more than %d bodies",
                       s->parameters.name, HAP_TRACE_BODIES_MAX);
  }
  return status;
}

static hap_status explain(bench *b, const rig *r, hap_status status)
{
  if (status < HAP_OK) {
    (void)hap_session_detail(r->session, &b->detail);
  }
  return status;
}

static hap_status open_rig(bench *b, const accuracy_run_def *def, rig *r, joint_gauge *gauge)
{
  rig_options options;
  scene_parameters parameters = *def->parameters;
  parameters.iterations = def->iterations > 0 ? def->iterations : parameters.iterations;
  rig_options_init(&options);
  options.parameters = &parameters;
  options.max_force = UNLIMITED_N;
  options.device_count = (size_t)def->parameters->pointers;
  memcpy(options.devices, def->hands, sizeof def->hands);
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.guard = HAP_GUARD_MEASURE;
  options.def.model = def->model;
  options.def.physics_hz = def->physics_hz;
  options.def.haptic_hz = def->haptic_hz;
  options.def.contact_hz = def->contact_hz;
  options.def.physics_latency_ticks = def->latency_ticks;
  options.def.probe = def->probe;
  options.def.effects[HAP_EFFECT_CROSS] = (uint8_t)def->cross;
  options.def.max_sweeps = def->max_sweeps;
  options.def.range_hops = def->range_hops;
  options.def.max_edge_probes = def->max_edge_probes;
  options.def.accuracy = def->accuracy;
  options.def.effects[HAP_EFFECT_SHAPE] = (uint8_t)def->shape;
  options.integration = def->integration;
  options.coupling = def->coupling;
  options.coupling_stiffness = def->coupling_stiffness;
  options.coupling_damping = def->coupling_damping;
  options.def.trace_rows = 8; /* read after each tick */
  options.def.lookback = def->lookback;
  options.def.reuse = def->reuse;
  hap_status status = rig_create(&options, r, &b->detail);
  if (status >= HAP_OK) {
    status = open_gauge(r->scene, gauge, &b->detail);
  }
  return status >= HAP_OK ? explain(b, r, hap_session_start(r->session)) : status;
}

/* The trace does not say which bodies are local; the loop's own list does. */
static uint32_t local_bodies(const rig *r, size_t bodies)
{
  const hapi_tick *tick = &r->session->haptic->tick;
  uint32_t local = 0;
  for (size_t i = 0; i < bodies; ++i) {
    local |= (uint32_t)(tick->watch_slot[i] != HAPI_SLOT_NONE) << i;
  }
  return local;
}

static void note_frame(const rig *r, const hap_trace_row *row, accuracy_frame *out)
{
  for (size_t i = 0; i < row->pointer_count && i < SCENE_POINTERS_MAX; ++i) {
    memcpy(out->force[i], row->pointers[i].force, sizeof out->force[i]);
    memcpy(out->torque[i], row->pointers[i].torque, sizeof out->torque[i]);
    memcpy(out->hand[i], row->pointers[i].position, sizeof out->hand[i]);
  }
  memcpy(out->body, row->body_position, sizeof out->body);
  out->local = local_bodies(r, row->body_count);
}

static void read_joints(const rig *r, const joint_gauge *gauge, accuracy_motion *out)
{
  const hapi_tick *tick = &r->session->haptic->tick;
  hap_pose loop[HAP_TRACE_BODIES_MAX] = {{{0.0}, {0.0}}};
  hap_pose world[HAP_TRACE_BODIES_MAX];
  bool local[HAP_TRACE_BODIES_MAX] = {false};
  for (size_t i = 0; i < tick->watch_count; ++i) {
    local[i] = tick->watch_slot[i] != HAPI_SLOT_NONE;
    if (local[i]) {
      loop[i] = tick->bodies[tick->watch_slot[i]].pose;
    }
    world[i] = joint_gauge_pose(r->scene->bodies[i]);
  }
  joint_gauge_read(gauge, loop, local, &out->joints_loop, NULL);
  joint_gauge_read(gauge, world, local, &out->joints_world, &out->joints_left);
}

static double deepest_now(const rig *r)
{
  const hapi_tick *tick = &r->session->haptic->tick;
  double deepest = 0.0;
  for (uint32_t i = 0; i < tick->contact_count; ++i) {
    deepest = fmax(deepest, tick->contacts[i].ramp.depth);
  }
  return deepest;
}

static double used_seconds(void)
{
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A frame is the newest tick at its time: with a faster loop the first of its ticks, with a slower one
 * the same for as long as it lasts. */
static hap_status record(const rig *r, const joint_gauge *gauge, double haptic_hz,
                         accuracy_motion *out)
{
  hap_trace_row row;
  size_t got = 0;
  double ticks = 0.0;
  hap_status status = HAP_OK;
  memset(&row, 0, sizeof row);
  for (size_t i = 0; i < out->count && status >= HAP_OK; ++i) {
    double newest = floor((double)i * haptic_hz / ACCURACY_HAPTIC_HZ + 1e-9);
    for (; ticks <= newest && status >= HAP_OK; ticks += 1.0) {
      status = hap_session_advance(r->session, 1);
      hap_status read = hap_session_trace_read(r->session, &row, 1, &got);
      status = status >= HAP_OK ? read : status;
      out->deepest = fmax(out->deepest, deepest_now(r));
      read_joints(r, gauge, out);
    }
    note_frame(r, &row, &out->frames[i]);
    out->bodies = row.body_count;
  }
  return status;
}

hap_status accuracy_run(bench *b, const accuracy_run_def *def, accuracy_motion *out)
{
  rig r;
  joint_gauge gauge;
  memset(out, 0, sizeof *out);
  memset(&r, 0, sizeof r);
  out->count = (size_t)lround(def->seconds * ACCURACY_HAPTIC_HZ);
  out->frames = calloc(out->count, sizeof *out->frames);
  if (out->frames == NULL) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for a run");
  }
  hap_status status = open_rig(b, def, &r, &gauge);
  if (status >= HAP_OK) {
    out->joints = gauge.count;
    double before = used_seconds();
    status = explain(b, &r, record(&r, &gauge, def->haptic_hz, out));
    out->used_s = used_seconds() - before;
    (void)hap_session_stats(r.session, &out->stats, sizeof out->stats);
  }
  if (r.session != NULL) {
    rig_destroy(&r);
  }
  if (status < HAP_OK) {
    accuracy_motion_free(out);
  }
  return status;
}

void accuracy_motion_free(accuracy_motion *m)
{
  free(m->frames);
  memset(m, 0, sizeof *m);
}
