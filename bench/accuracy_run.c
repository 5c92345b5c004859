/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"
#include "base/vec.h"
#include "bench/accuracy.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"

/* A device's own limit would be part of the comparison. */
#define NO_LIMIT ",hand=rigid,max_force=1000,max_torque=1000"

/* A finger that comes down to the row and pushes it along: turned and shifted so that it meets the
 * first cube's face. The window has one push; later ones meet a row that lies still. */
#define RECORDING_PLACE \
  ",scale=0.15,rotate=0.8991/-0.018/-0.4357/-0.0371,offset=0.005/-0.0342/-0.036,start=1.5"

static const accuracy_scene scenes[] = {
    {.name = "fig5", .base = "fig5", .bound = 0.005, .rests = true},
    {.name = "fig6", .base = "fig6", .bound = 0.005},
    {.name = "fig7", .base = "fig7", .bound = 0.02, .starts_quick = 3},
    {.name = "slide", .base = "slide", .bound = 0.005, .speeds = true},
    {.name = "row10", .base = "row10", .bound = 0.01, .starts_quick = 3, .speeds = true},
    {.name = "wedge", .base = "wedge", .bound = 0.005},
    {.name = "stack", .base = "stack", .bound = 0.03},
    {.name = "tower", .base = "tower", .bound = 0.03, .starts_quick = 3},
    {.name = "topple", .base = "topple", .bound = 0.01, .speeds = true},
    {.name = "edge", .base = "edge", .bound = 0.03},
    {.name = "hit", .base = "hit", .bound = 0.06},
    {.name = "roll", .base = "roll", .bound = 0.01},
    {.name = "roll_capsule", .base = "roll_capsule", .bound = 0.01},
    {.name = "roll_cylinder", .base = "roll_cylinder", .bound = 0.01},
    {.name = "clump8", .base = "clump8", .bound = 0.03},
    {.name = "spheres", .base = "spheres", .bound = 0.06},
    {.name = "door", .base = "door", .bound = 0.005},
    {.name = "pendulum", .base = "pendulum", .bound = 0.005},
    {.name = "hinged", .base = "hinged", .bound = 0.005},
    {.name = "cart", .base = "cart", .bound = 0.005},
    {.name = "chain", .base = "chain", .bound = 0.005},
    {.name = "lightstand", .base = "lightstand", .bound = 0.03, .starts_quick = 3},
    {.name = "telescope", .base = "telescope", .bound = 0.03, .starts_quick = 3},
    {.name = "grasp", .base = "grasp", .bound = 0.03, .speeds = true},
    {.name = "lever", .base = "lever", .bound = 0.03, .starts_quick = 3},
    {.name = "peg", .base = "peg", .bound = 0.08, .starts_quick = 3, .start_most = 2e-4},
    {.name = "hold", .base = "hold", .seconds_quick = 3, .starts_quick = 2, .rests = true},
    {.name = "recorded",
     .base = "row10",
     .recording = "dfki_index_tip.csv",
     .seconds = 3,
     .bound = 0.03,
     .starts_quick = 3},
    {.name = "field", .base = "field", .bound = 0.005, .starts_quick = 3},
    {.name = "pile8", .base = "pile", .count = 8, .bound = 0.05, .starts_quick = 2},
};

const accuracy_scene *accuracy_scene_at(size_t index)
{
  return index < sizeof scenes / sizeof scenes[0] ? &scenes[index] : NULL;
}

/* A text that grows in a caller's buffer; full: too long once. */
typedef struct writer {
  char *text;
  size_t size;
  size_t used;
  bool full;
} writer;

static void write_part(writer *w, const char *part, size_t length)
{
  if (w->used + length >= w->size) {
    w->full = true;
    return;
  }
  memcpy(w->text + w->used, part, length);
  w->used += length;
  w->text[w->used] = '\0';
}

/* "path=T:x/y/z;T:x/y/z", or turn= for path=, with each T stretched; false: no such thing. */
static bool write_path(writer *w, const char *path, size_t length, double stretch)
{
  const char *end = path + length;
  const char *at = path + strlen("path=");
  write_part(w, path, strlen("path=")); /* as long as the other one */
  while (at < end) {
    char *after = NULL;
    char time[32];
    double seconds = strtod(at, &after);
    size_t rest = strcspn(after, ";,");
    if (after == at || *after != ':') {
      return false;
    }
    int written = snprintf(time, sizeof time, "%.9g", stretch * seconds);
    write_part(w, time, (size_t)written);
    rest += after[rest] == ';';
    write_part(w, after, rest);
    at = after + rest;
  }
  return true;
}

bool accuracy_hand(const char *spec, double stretch, char *out, size_t size)
{
  writer w = {.size = size};
  w.text = out;
  size_t length = strcspn(spec, ":") + 1;
  const char *at = spec + length;
  if (strncmp(spec, "virtual:", length) != 0) {
    return false;
  }
  write_part(&w, spec, length);
  for (bool first = true; *at != '\0'; at += length + (at[length] == ',')) {
    length = strcspn(at, ",");
    if (strncmp(at, "hand=", 5) == 0) {
      continue;
    }
    if (!first) {
      write_part(&w, ",", 1);
    }
    first = false;
    if (strncmp(at, "path=", 5) != 0 && strncmp(at, "turn=", 5) != 0) {
      write_part(&w, at, length);
    } else if (!write_path(&w, at, length, stretch)) {
      return false;
    }
  }
  write_part(&w, NO_LIMIT, strlen(NO_LIMIT));
  return !w.full;
}

hap_status accuracy_recorded_hand(bench *b, const accuracy_scene *which, char *out, size_t size)
{
  char path[ACCURACY_SPEC_MAX];
  const char *shared = getenv("HAPODE_SHARED");
  int length = snprintf(path, sizeof path, "%s/data/%s", shared != NULL ? shared : "../shared",
                        which->recording);
  if (length >= (int)sizeof path || access(path, R_OK) != 0) {
    return bench_fail(b, HAP_ERROR_NOT_FOUND, "no recording HAPODE_SHARED/data/%s",
                      which->recording);
  }
  length = snprintf(out, size, "replay:%s" RECORDING_PLACE, path);
  return length < (int)size ? HAP_OK : bench_fail(b, HAP_ERROR_NOT_FOUND, "%s: too long", path);
}

#define LINES 6        /* the physics rate and 5 harmonics */
#define LINE_STEPS 4.0 /* a line is 2 / window wide to either side */
#define CHANNELS (SCENE_POINTERS_MAX * 3)
#define REST_SPEED 0.01 /* of the hand's largest speed */

static double points_distance(const double a[3], const double b[3])
{
  double apart[3];
  hapi_v3_sub(a, b, apart);
  return hapi_v3_norm(apart);
}

static bool frame_touches(const accuracy_frame *f)
{
  for (size_t i = 0; i < CHANNELS; ++i) {
    if (f->force[i / 3][i % 3] != 0.0) {
      return true;
    }
  }
  return false;
}

static double force_difference(const accuracy_frame *a, const accuracy_frame *b, size_t channel)
{
  return a->force[channel / 3][channel % 3] - b->force[channel / 3][channel % 3];
}

/* ---- forces ---- */

typedef struct sums {
  double error;        /* N^2 */
  double reference;    /* N^2 */
  double torque_error; /* N^2 m^2 */
  double torque;       /* N^2 m^2, of the reference */
  double impulse[2];
  double peak[2];
  size_t ticks;
} sums;

static void add_norms(const accuracy_frame *f, double *impulse, double *peak)
{
  for (size_t i = 0; i < SCENE_POINTERS_MAX; ++i) {
    double force = hapi_v3_norm(f->force[i]);
    *impulse += force;
    *peak = fmax(*peak, force);
  }
}

static void add_tick(const accuracy_frame *reference, const accuracy_frame *test, sums *s)
{
  if (!frame_touches(reference) && !frame_touches(test)) {
    return;
  }
  for (size_t i = 0; i < CHANNELS; ++i) {
    double e = force_difference(test, reference, i);
    double f = reference->force[i / 3][i % 3];
    s->error += e * e;
    s->reference += f * f;
    double torque = reference->torque[i / 3][i % 3];
    double other = test->torque[i / 3][i % 3];
    s->torque_error += (other - torque) * (other - torque);
    s->torque += torque * torque;
  }
  add_norms(reference, &s->impulse[0], &s->peak[0]);
  add_norms(test, &s->impulse[1], &s->peak[1]);
  ++s->ticks;
}

/* ---- lines ---- */

/* Amplitude of the difference at a frequency, N. The window from the first to the last tick with
 * contact, faded at both ends (Hann): what drifts over it, and ends where it did not begin,
 * would else look like a line. */
static double line_at(const accuracy_motion *reference, const accuracy_motion *test,
                      const size_t window[2], double hz)
{
  double re[CHANNELS] = {0.0};
  double im[CHANNELS] = {0.0};
  double weights = 0.0;
  double power = 0.0;
  double length = (double)(window[1] - window[0]);
  for (size_t t = window[0]; t < window[1]; ++t) {
    double w = 0.5 - 0.5 * cos(2.0 * M_PI * ((double)(t - window[0]) + 0.5) / length);
    double phase = 2.0 * M_PI * hz * (double)t / ACCURACY_HAPTIC_HZ;
    weights += w;
    for (size_t i = 0; i < CHANNELS; ++i) {
      double e = w * force_difference(&test->frames[t], &reference->frames[t], i);
      re[i] += e * cos(phase);
      im[i] += e * sin(phase);
    }
  }
  for (size_t i = 0; i < CHANNELS; ++i) {
    power += re[i] * re[i] + im[i] * im[i];
  }
  return 2.0 * sqrt(power) / weights;
}

/* A line is what stands out of its surroundings, here those half way to its neighbours: an
 * impact that is a tick late is in all frequencies alike. Two impacts make a spectrum of hills
 * and valleys, and a harmonic may lie on a hill: what a run at another physics rate has there as
 * well is no line of this one. False: the window is too short to tell the two apart. */
static bool largest_line(const accuracy_motion *reference, const accuracy_motion *test,
                         const accuracy_motion *control, double physics_hz, double *out)
{
  size_t window[2] = {reference->count, 0};
  for (size_t t = 0; t < reference->count; ++t) {
    if (frame_touches(&reference->frames[t]) || frame_touches(&test->frames[t])) {
      window[0] = t < window[0] ? t : window[0];
      window[1] = t + 1;
    }
  }
  *out = 0.0;
  if ((double)(window[1] - window[0]) < LINE_STEPS * ACCURACY_HAPTIC_HZ / physics_hz) {
    return false;
  }
  double before = line_at(reference, test, window, 0.5 * physics_hz);
  for (int i = 1; i <= LINES && (i + 0.5) * physics_hz < 0.5 * ACCURACY_HAPTIC_HZ; ++i) {
    double line = line_at(reference, test, window, i * physics_hz);
    double after = line_at(reference, test, window, (i + 0.5) * physics_hz);
    double around = before * after;
    if (control != NULL) {
      double other = line_at(reference, control, window, i * physics_hz);
      around = fmax(around, other * other);
    }
    *out = fmax(*out, sqrt(fmax(0.0, line * line - around)));
    before = after;
  }
  return true;
}

/* ---- poses ---- */

static bool compare_poses(const accuracy_motion *reference, const accuracy_motion *test,
                          accuracy_errors *out)
{
  double *distances = calloc(test->count * test->bodies + 1, sizeof *distances);
  size_t count = 0;
  if (distances == NULL) {
    return false;
  }
  for (size_t t = 0; t < test->count; ++t) {
    for (size_t i = 0; i < test->bodies; ++i) {
      if ((test->frames[t].local >> i & 1u) != 0) {
        distances[count] = points_distance(test->frames[t].body[i], reference->frames[t].body[i]);
        ++count;
      }
    }
  }
  out->pose_median = bench_median(distances, count);
  out->pose_max = bench_quantile(distances, count, 1.0);
  free(distances);
  return true;
}

bool accuracy_compare(const accuracy_motion *reference, const accuracy_motion *test,
                      const accuracy_motion *control, double physics_hz, accuracy_errors *out)
{
  sums s = {0};
  memset(out, 0, sizeof *out);
  for (size_t t = 0; t < reference->count; ++t) {
    add_tick(&reference->frames[t], &test->frames[t], &s);
  }
  if (!(s.reference > 0.0)) {
    return false;
  }
  out->force = sqrt(s.error / s.reference);
  out->torque = s.torque > 0.0 ? sqrt(s.torque_error / s.torque) : 0.0;
  out->force_rms = sqrt(s.reference / (double)s.ticks);
  out->impulse_ratio = s.impulse[1] / s.impulse[0];
  out->peak_ratio = s.peak[1] / s.peak[0];
  out->lines = largest_line(reference, test, control, physics_hz, &out->line_n) ? 1.0 : 0.0;
  out->joint_loop = test->joints_loop.way;
  out->joint_world = test->joints_world.way;
  out->joint_left = test->joints_left.way;
  out->joint_turn = fmax(test->joints_loop.turn, test->joints_world.turn);
  return compare_poses(reference, test, out);
}

/* ---- the hand ---- */

static double speed_at(const accuracy_motion *m, size_t t)
{
  double fastest = 0.0;
  for (size_t i = 0; i < SCENE_POINTERS_MAX; ++i) {
    fastest = fmax(fastest, points_distance(m->frames[t].hand[i], m->frames[t - 1].hand[i]));
  }
  return fastest * ACCURACY_HAPTIC_HZ;
}

double accuracy_hand_speed(const accuracy_motion *m)
{
  double fastest = 0.0;
  for (size_t t = 1; t < m->count; ++t) {
    fastest = fmax(fastest, speed_at(m, t));
  }
  return fastest;
}

double accuracy_rest_share(const accuracy_motion *m)
{
  double slow = REST_SPEED * accuracy_hand_speed(m);
  size_t touched = 0;
  size_t rested = 0;
  for (size_t t = 1; t < m->count; ++t) {
    if (frame_touches(&m->frames[t])) {
      ++touched;
      rested += speed_at(m, t) <= slow;
    }
  }
  return touched > 0 ? (double)rested / (double)touched : 0.0;
}

#define UNLIMITED_N 1000.0 /* the guard's limit is far */

void accuracy_run_def_init(accuracy_run_def *def)
{
  memset(def, 0, sizeof *def);
  session_defs_init(&def->session, &def->expert, &def->research);
  def->coupling = HAP_COUPLING_DIRECT;
  def->integration = HAP_INTEGRATION_AUTO;
}

/* Before the start: the joints are as the scene has built them. The loop's poses are read
 * through the list of the trace. */
static hap_status open_gauge(const scene *s, joint_gauge *out, hap_detail *detail)
{
  hap_status status = joint_gauge_init(out, s->bodies, s->body_count, detail);
  if (status >= HAP_OK && out->count > 0 && s->body_count > HAP_TRACE_BODIES_MAX) {
    status = hapi_fail(detail, HAP_ERROR_UNSUPPORTED, "%s: joints, and more than %d bodies",
                       s->parameters.name, HAP_TRACE_BODIES_MAX);
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
  options.def = def->session;
  options.expert = def->expert;
  options.research = def->research;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.research.guard = HAP_GUARD_MEASURE;
  options.expert.trace_rows = 8; /* read after each tick */
  options.integration = def->integration;
  options.coupling = def->coupling;
  options.coupling_stiffness = def->coupling_stiffness;
  options.coupling_damping = def->coupling_damping;
  hap_status status = rig_create(&options, r, &b->detail);
  if (status >= HAP_OK) {
    status = open_gauge(r->scene, gauge, &b->detail);
  }
  if (status >= HAP_OK && def->join != NULL) {
    status = bench_explain(b, r->session, def->join(def->join_user, r->session));
  }
  return status >= HAP_OK ? bench_explain(b, r->session, hap_session_start(r->session)) : status;
}

/* The trace does not say which bodies are local; the loop's own list does. */
static uint32_t local_bodies(const rig *r, size_t bodies)
{
  const hapi_tick *tick = &r->session->haptic->tick;
  uint32_t local = 0;
  for (size_t i = 0; i < bodies; ++i) {
    local |= (uint32_t)(tick->watch.slot[i] != HAPI_SLOT_NONE) << i;
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
  for (size_t i = 0; i < tick->watch.count; ++i) {
    local[i] = tick->watch.slot[i] != HAPI_SLOT_NONE;
    if (local[i]) {
      loop[i] = tick->bodies.of[tick->watch.slot[i]].pose;
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
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    deepest = fmax(deepest, tick->touches.of[i].ramp.depth);
  }
  return deepest;
}

/* A frame is the newest tick at its time: with a faster loop the first of its ticks, with a
 * slower one the same for as long as it lasts. */
static hap_status run_record(const rig *r, const joint_gauge *gauge, double haptic_hz,
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
      hap_status read = hap_session_trace_read(r->session, &row, 1, sizeof(hap_trace_row), &got);
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
    double before = bench_used_seconds();
    status = bench_explain(b, r.session, run_record(&r, &gauge, def->session.haptic_hz, out));
    out->used_s = bench_used_seconds() - before;
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
