/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/false_input.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/safety.h"
#include "base/vec.h"
#include "bench/seen.h"
#include "device/device.h"
#include "tools/session_defs.h"
#include "tools/spidar-emulator/driven.h"

#define PHYSICS_HZ 50
#define RADIUS 0.01 /* m, of the pointer */
#define FACE 0.025  /* m, x of what it is pressed against */
#define EDGE 0.04   /* m, of the cubes */
#define CUBES 5
#define DRIFT 0.1       /* m/s, of a string */
#define DRIFT_AXIS 0.02 /* m/s */
#define OLD_S 0.05
#define OLD_MAX 512  /* ticks that are kept */
#define STRING 2     /* the one that is false */
#define DAMPING 1.0  /* N s/m, of the contact */
#define HOLD_S 0.004 /* between new positions of the coarse device */
#define QUANTUM 5e-5 /* m, of the same */

/* At home until the strings are wound in; against the surface, and then to and fro along it and a
 * little against it. */
static const char hand_path[] =
    "0:0/0/0;0.5:0/0/0;1.7:0.062/0/0;2.05:0.06/0.003/0;2.2:0.064/0/0.002;2.35:0.06/-0.003/0;"
    "2.5:0.064/0/0;2.8:0.06/0/0;6:0/0/0";

typedef struct stage {
  const false_input_def *def;
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_device *device;
  hap_pointer_id pointer;
  uint32_t dice;
  uint64_t reads;
  seen_motion seen;
  double seen_s; /* < 0: nothing was */
  /* Of the virtual device. */
  hap_device *inner;
  hap_pose told[OLD_MAX]; /* rings: what was right */
  hap_twist told_twist[OLD_MAX];
  int64_t told_ns;
  /* Of the SPIDAR. */
  int32_t counts[OLD_MAX][HAPI_SPIDAR_BOARDS][HAPI_SPIDAR_MOTORS];
} stage;

void false_input_init(false_input_def *def)
{
  *def = (false_input_def){.stiffness = 1000.0, .spike = 0.004, .seed = 1, .haptic_hz = 1000.0};
}

const char *false_input_name(false_input_kind kind)
{
  static const char *const names[FALSE_KINDS] = {[FALSE_NOTHING] = "nothing",
                                                 [FALSE_ONE_SPIKES] = "one-spikes",
                                                 [FALSE_ALL_SPIKES] = "all-spikes",
                                                 [FALSE_SINGLE] = "single",
                                                 [FALSE_ONE_STUCK] = "one-stuck",
                                                 [FALSE_ONE_DRIFTS] = "one-drifts",
                                                 [FALSE_BOARD_STUCK] = "board-stuck",
                                                 [FALSE_ALL_STUCK] = "all-stuck",
                                                 [FALSE_OLD] = "old",
                                                 [FALSE_ALWAYS] = "one-always",
                                                 [FALSE_ALL_ALWAYS] = "all-always"};
  return names[kind];
}

const char *false_input_device_name(false_input_device device)
{
  static const char *const names[FALSE_INPUT_DEVICES] = {"spidar", "virtual", "coarse"};
  return names[device];
}

/* 0 .. 1 */
static double dice_throw(stage *s)
{
  s->dice = s->dice * 1664525u + 1013904223u;
  return (double)(s->dice >> 8) / 16777216.0;
}

static double dice_sign(stage *s)
{
  return dice_throw(s) < 0.5 ? -1.0 : 1.0;
}

/* s since it began; < 0: not now. */
static double false_time(double time)
{
  double since = time - FALSE_INPUT_BEGIN_S;
  return since < FALSE_INPUT_LENGTH_S ? since : -1.0;
}

/* Of the three that are alone, which is now: 1 to 3. */
static int single_number(const stage *s, double since)
{
  double tick = 1.0 / s->def->haptic_hz;
  for (int i = 1; i <= 3; ++i) {
    double at = 0.05 * i;
    if (since >= at - 0.5 * tick && since < at + 0.5 * tick) {
      return i;
    }
  }
  return 0;
}

static bool is_spiked(stage *s, double since)
{
  double share = s->def->kind == FALSE_ALWAYS || s->def->kind == FALSE_ALL_ALWAYS ? 1.0 : 0.05;
  return since >= 0.0 && dice_throw(s) < share;
}

static void seen_note(stage *s, double since, bool is_seen)
{
  if (is_seen && since >= 0.0 && s->seen_s < 0.0) {
    s->seen_s = since;
  }
}

/* ---- SPIDAR ---- */

static void tell_off(driven_spidar *d, int string, double counts)
{
  const emulator_action action = {.kind = EMULATOR_FALSE, .number = {string, round(counts)}};
  emulator_do(&d->emulator, &action);
}

static void tell_stuck(driven_spidar *d, int string, bool stuck)
{
  const emulator_action action = {.kind = EMULATOR_STUCK, .number = {string, stuck ? 1.0 : 0.0}};
  emulator_do(&d->emulator, &action);
}

static void tell_old(stage *s, driven_spidar *d)
{
  uint64_t age = (uint64_t)(OLD_S * s->def->haptic_hz);
  const wire *w = &d->emulator.wire;
  for (int i = 0; i < w->count && s->reads > age; ++i) {
    for (int k = 0; k < 4; ++k) {
      int32_t old = s->counts[(s->reads - age) % OLD_MAX][i][k];
      tell_off(d, 4 * i + k, old - w->boards[i].counts[k]);
    }
  }
}

/* What the boards tell from now on, held against what the encoders would. */
static void spidar_see(stage *s, const driven_spidar *d, double since)
{
  const emulator *e = &d->emulator;
  const hapi_spidar_model *model = &d->device.model;
  const seen_bounds bounds = {.period = 1.0 / s->def->haptic_hz,
                              .hit = HAPI_SAFETY_STRING_SHARE * HAPI_SAFETY_ACCELERATION_LIMIT,
                              .swing = HAPI_SAFETY_STRING_SHARE * HAPI_SAFETY_SWING_LIMIT,
                              .quantum = fabs(model->metres_per_count[0])};
  double told[SEEN_WAYS];
  double error[SEEN_WAYS];
  for (int i = 0; i < SEEN_WAYS; ++i) {
    const board *b = &e->wire.boards[i / 4];
    double count = b->counts[i % 4] + b->lies.false_by[i % 4];
    double right =
        e->first_count + round((e->grip.wound[i] - e->home[i]) / model->metres_per_count[i]);
    told[i] = count * model->metres_per_count[i];
    error[i] = told[i] - right * model->metres_per_count[i];
  }
  bool moves = seen_motion_take(&s->seen, &bounds, told, SEEN_WAYS);
  bool fits = seen_misfit(model->motor, model->grip, &e->grip.pose, error) <= model->residual;
  seen_note(s, since, moves || !fits);
}

static void spidar_spoil(driven_spidar *d, double time, void *user)
{
  stage *s = user;
  double since = false_time(time);
  double metres = fabs(d->device.model.metres_per_count[STRING]);
  double spike = s->def->spike / metres;
  for (int i = 0; i < d->emulator.wire.count; ++i) {
    memcpy(s->counts[s->reads % OLD_MAX][i], d->emulator.wire.boards[i].counts,
           sizeof s->counts[0][0]);
  }
  ++s->reads;
  tell_off(d, -1, 0.0);
  int single = single_number(s, since);
  switch (s->def->kind) {
    case FALSE_ONE_SPIKES:
    case FALSE_ALWAYS:
      if (is_spiked(s, since)) {
        tell_off(d, STRING, dice_sign(s) * spike);
      }
      break;
    case FALSE_ALL_SPIKES:
    case FALSE_ALL_ALWAYS:
      if (is_spiked(s, since)) {
        for (int i = 0; i < 8; ++i) {
          tell_off(d, i, dice_sign(s) * spike);
        }
      }
      break;
    case FALSE_SINGLE:
      if (s->def->kind == FALSE_SINGLE && single > 0) {
        tell_off(d, single == 2 ? -1 : STRING, single == 3 ? 5000.0 : spike);
      }
      break;
    case FALSE_ONE_DRIFTS:
      tell_off(d, STRING, since >= 0.0 ? since * DRIFT / metres : 0.0);
      break;
    case FALSE_ONE_STUCK:
      tell_stuck(d, STRING, since >= 0.0);
      break;
    case FALSE_BOARD_STUCK:
      for (int i = 4; i < 8; ++i) {
        tell_stuck(d, i, since >= 0.0);
      }
      break;
    case FALSE_ALL_STUCK:
      tell_stuck(d, -1, since >= 0.0);
      break;
    case FALSE_OLD:
      if (since >= 0.0 && dice_throw(s) < 0.1) {
        tell_old(s, d);
      }
      break;
    case FALSE_NOTHING:
    case FALSE_KINDS:
      break;
  }
  spidar_see(s, d, time - FALSE_INPUT_BEGIN_S);
}

/* ---- virtual ---- */

static stage *opening; /* whose device is being opened: a test runs one after the other */

static hap_status wrapped_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  hap_status status = hap_device_open(args, &opening->inner, detail);
  *self = status >= HAP_OK ? opening : NULL;
  return status;
}

static const hap_device_ops *inner_ops(const stage *s)
{
  return hapi_device_ops(s->inner);
}

static void *inner_self(const stage *s)
{
  return hapi_device_self(s->inner);
}

static void wrapped_describe(void *self, uint32_t effector, hap_device_info *out)
{
  const stage *s = self;
  inner_ops(s)->describe(inner_self(s), effector, out);
}

static hap_status wrapped_start(void *self)
{
  const stage *s = self;
  return inner_ops(s)->start(inner_self(s));
}

static void pose_spoil(stage *s, double since, hap_pose *io, hap_twist *twist)
{
  uint64_t now = s->reads - 1;
  uint64_t begun = now - (uint64_t)fmax(since * s->def->haptic_hz + 0.5, 0.0);
  uint64_t age = (uint64_t)(OLD_S * s->def->haptic_hz);
  int single = single_number(s, since);
  switch (s->def->kind) {
    case FALSE_ONE_SPIKES:
    case FALSE_ALWAYS:
      io->position[0] += is_spiked(s, since) ? dice_sign(s) * s->def->spike : 0.0;
      break;
    case FALSE_ALL_SPIKES:
    case FALSE_ALL_ALWAYS:
      if (is_spiked(s, since)) {
        for (int k = 0; k < 3; ++k) {
          io->position[k] += dice_sign(s) * s->def->spike;
        }
      }
      break;
    case FALSE_SINGLE:
      io->position[0] += single == 1 ? s->def->spike : single == 2 ? -0.5 * s->def->spike : 0.0;
      io->position[0] += single == 3 ? 0.15 : 0.0;
      break;
    case FALSE_ONE_DRIFTS:
      io->position[1] += since >= 0.0 ? since * DRIFT_AXIS : 0.0;
      break;
    case FALSE_ONE_STUCK:
    case FALSE_ALL_STUCK:
      if (since >= 0.0) {
        *io = s->told[begun % OLD_MAX];
        memset(twist, 0, sizeof *twist);
      }
      break;
    case FALSE_BOARD_STUCK:
      if (since >= 0.0) {
        io->position[0] = s->told[begun % OLD_MAX].position[0];
      }
      break;
    case FALSE_OLD:
      if (since >= 0.0 && dice_throw(s) < 0.1 && now > age) {
        *io = s->told[(now - age) % OLD_MAX];
        *twist = s->told_twist[(now - age) % OLD_MAX];
      }
      break;
    case FALSE_NOTHING:
    case FALSE_KINDS:
      break;
  }
}

/* Of a device that tells each position for some time the first of them counts. */
static void pose_see(stage *s, double since, const hap_pose *told, bool is_first)
{
  bool coarse = s->def->device == FALSE_INPUT_COARSE;
  const seen_bounds bounds = {.period = coarse ? HOLD_S : 1.0 / s->def->haptic_hz,
                              .hit = HAPI_SAFETY_ACCELERATION_LIMIT,
                              .swing = HAPI_SAFETY_SWING_LIMIT,
                              .quantum = coarse ? QUANTUM : 0.0};
  seen_note(s, since, is_first && seen_motion_take(&s->seen, &bounds, told->position, 3));
}

static hap_status wrapped_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  stage *s = self;
  uint64_t before = s->reads;
  bool keeps = s->def->device == FALSE_INPUT_COARSE && before > 0 &&
               1e-9 * (double)(time_ns - s->told_ns) < HOLD_S - 1e-6;
  hap_status status = inner_ops(s)->read(inner_self(s), time_ns, out);
  if (keeps) {
    in->pose = s->told[(before - 1) % OLD_MAX];
    in->twist = s->told_twist[(before - 1) % OLD_MAX];
  } else {
    s->told_ns = time_ns;
  }
  s->told[before % OLD_MAX] = in->pose;
  s->told_twist[before % OLD_MAX] = in->twist;
  ++s->reads;
  double time = 1e-9 * (double)time_ns;
  pose_spoil(s, false_time(time), &in->pose, &in->twist);
  pose_see(s, time - FALSE_INPUT_BEGIN_S, &in->pose, !keeps);
  return status;
}

static hap_status wrapped_write(void *self, const hap_device_output *const wanted[],
                                hap_device_output *const reached[])
{
  const stage *s = self;
  return inner_ops(s)->write(inner_self(s), wanted, reached);
}

static void wrapped_zero(void *self)
{
  const stage *s = self;
  inner_ops(s)->zero(inner_self(s));
}

static void wrapped_stop(void *self)
{
  const stage *s = self;
  inner_ops(s)->stop(inner_self(s));
}

static void wrapped_close(void *self)
{
  stage *s = self;
  hap_device_close(s->inner);
  s->inner = NULL;
}

static const hap_device_ops wrapped_ops = {
    .abi = HAP_DEVICE_ABI,
    .size = sizeof(hap_device_ops),
    .name = "wrapped",
    .help = "a device that tells what is false",
    .pacing = HAP_PACING_VIRTUAL,
    .open = wrapped_open,
    .describe = wrapped_describe,
    .start = wrapped_start,
    .read = wrapped_read,
    .write = wrapped_write,
    .zero = wrapped_zero,
    .stop = wrapped_stop,
    .close = wrapped_close,
};

/* ---- session ---- */

static bool surface_set(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode = dContactApprox1;
  io->mu = 0.5;
  return true;
}

static void build_world(stage *s)
{
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
  dWorldSetERP(s->world, 0.2);
  dWorldSetCFM(s->world, 1e-10);
  double face = FACE + RADIUS;
  for (int i = 0; s->def->row && i < CUBES; ++i) {
    dMass mass;
    dBodyID body = dBodyCreate(s->world);
    dMassSetBoxTotal(&mass, 0.2, EDGE, EDGE, EDGE);
    dBodySetMass(body, &mass);
    dGeomSetBody(dCreateBox(s->space, EDGE, EDGE, EDGE), body);
    dBodySetPosition(body, face + 0.5 * EDGE, 0.0, 0.0);
    face += EDGE;
  }
  dGeomSetPosition(dCreateBox(s->space, 0.2, 1.0, 1.0), face + 0.1, 0.0, 0.0);
}

static hap_status session_create(stage *s, hap_detail *detail)
{
  hap_ode_def ode;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def_init(&ode, sizeof ode);
  session_defs_init(&def, &expert, &research);
  ode.world = s->world;
  ode.space = s->space;
  ode.surface = surface_set;
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = PHYSICS_HZ;
  def.haptic_hz = s->def->haptic_hz;
  return hap_session_create(&def, &ode, &s->session, detail);
}

static hap_status device_open(stage *s, hap_detail *detail)
{
  if (s->def->device == FALSE_INPUT_SPIDAR) {
    hap_status status =
        hapi_device_open_ops(&driven_spidar_ops, NULL, hand_path, &s->device, detail);
    if (status >= HAP_OK) {
      driven_spidar *d = hapi_device_self(s->device);
      d->spoil = spidar_spoil;
      d->user = s;
    }
    return status;
  }
  char spec[400];
  snprintf(spec, sizeof spec, "virtual:hand=relaxed,device_mass=0.1,path=%s%s", hand_path,
           s->def->device == FALSE_INPUT_COARSE ? ",quantum=5e-5" : "");
  opening = s;
  return hapi_device_open_ops(&wrapped_ops, NULL, spec, &s->device, detail);
}

static hap_status pointer_add(stage *s, hap_detail *detail)
{
  hap_pointer_def pointer;
  hap_pointer_def_init(&pointer, sizeof pointer);
  hap_status status = device_open(s, detail);
  if (status < HAP_OK) {
    return status;
  }
  pointer.device = s->device;
  pointer.radius = RADIUS;
  pointer.stiffness = s->def->stiffness;
  pointer.damping = DAMPING;
  pointer.friction = 0.3;
  pointer.max_force = 20.0;
  status = hap_pointer_add(s->session, &pointer, &s->pointer);
  if (status >= HAP_OK) {
    status = hap_session_start(s->session);
  }
  if (status < HAP_OK) {
    (void)hap_session_detail(s->session, detail);
  }
  return status;
}

/* N. A device that tells seldom may come back so far away as a hand goes in the meantime: then its
 * place is believed, and the force there is right. */
static double spring_presses(const stage *s)
{
  double deepest = FACE;
  uint64_t kept = (uint64_t)(2.0 * HOLD_S * s->def->haptic_hz);
  for (uint64_t i = 1; s->def->device == FALSE_INPUT_COARSE && i <= kept && i <= s->reads; ++i) {
    deepest = fmax(deepest, s->told[(s->reads - i) % OLD_MAX].position[0]);
  }
  return s->def->stiffness * (deepest - FACE);
}

static hap_status run_measure(stage *s, false_input_run *out, hap_detail *detail)
{
  hap_status status = HAP_OK;
  out->ticks = (int)(FALSE_INPUT_END_S * s->def->haptic_hz);
  out->fault_s = out->told_s = -1.0;
  for (int i = 0; i < out->ticks && status >= HAP_OK; ++i) {
    hap_pointer_state state;
    hap_stats stats;
    status = hap_session_advance(s->session, 1);
    status =
        status >= HAP_OK ? hap_pointer_get(s->session, s->pointer, &state, sizeof state) : status;
    status = status >= HAP_OK ? hap_session_stats(s->session, &stats, sizeof stats) : status;
    if (status >= HAP_OK) {
      double since = (i + 1) / s->def->haptic_hz - FALSE_INPUT_BEGIN_S;
      hapi_v3_copy(state.wrench.force, out->force[i]);
      out->pressed[i] = spring_presses(s);
      if (stats.faults.fault != HAP_FAULT_NONE && out->fault_s < 0.0) {
        hap_detail why = {""};
        (void)hap_session_detail(s->session, &why);
        snprintf(out->text, sizeof out->text, "%.590s", why.text);
        out->fault = stats.faults.fault;
        out->fault_s = since;
      }
      out->doubted = out->doubted || (state.guard & HAP_GUARD_INPUT) != 0;
      if (since > 0.0 && out->told_s < 0.0 &&
          (state.guard & (HAP_GUARD_FAULT | HAP_GUARD_INPUT)) != 0) {
        out->told_s = since;
      }
    }
  }
  out->seen_s = s->seen_s;
  if (status < HAP_OK) {
    (void)hap_session_detail(s->session, detail);
  }
  return status;
}

hap_status false_input_measure(const false_input_def *def, false_input_run *out, hap_detail *detail)
{
  stage *s = hapi_alloc(sizeof *s);
  memset(out, 0, sizeof *out);
  if (s == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "out of memory");
  }
  s->def = def;
  s->dice = def->seed;
  s->seen_s = -1.0;
  build_world(s);
  hap_status status = session_create(s, detail);
  status = status >= HAP_OK ? pointer_add(s, detail) : status;
  status = status >= HAP_OK ? run_measure(s, out, detail) : status;
  hap_session_destroy(s->session);
  hap_device_close(s->device);
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
  hapi_free(s);
  return status;
}

static void run_extremes(const false_input_def *def, const false_input_run *run, double *out_peak,
                         double *out_step)
{
  int first = (int)(FALSE_INPUT_BEGIN_S * def->haptic_hz);
  int apart = (int)(0.002 * def->haptic_hz + 0.5);
  *out_peak = *out_step = 0.0;
  for (int i = first; i < run->ticks; ++i) {
    double change[3];
    hapi_v3_sub(run->force[i], run->force[i - apart], change);
    *out_peak = fmax(*out_peak, hapi_v3_norm(run->force[i]));
    *out_step = fmax(*out_step, hapi_v3_norm(change));
  }
}

bool false_input_is_told(const false_input_run *run)
{
  return run->seen_s < 0.0 ||
         (run->told_s >= 0.0 && run->told_s <= run->seen_s + FALSE_INPUT_TOLD_S);
}

/* N, more than undisturbed, on a hand that really goes where a slow device says: by the spike to
 * and fro. Spring and damper, with the whole way within the time between two positions. None where
 * no hand goes so far in that time. */
static double motion_more(const false_input_def *def)
{
  bool always = def->kind == FALSE_ALWAYS || def->kind == FALSE_ALL_ALWAYS;
  bool is_motion = 2.0 * def->spike <= HAPI_SAFETY_SWING_LIMIT * HOLD_S * HOLD_S;
  return def->device == FALSE_INPUT_COARSE && always && is_motion
             ? def->spike * (def->stiffness + 2.0 * DAMPING / HOLD_S)
             : 0.0;
}

/* N, by which that changes in 2 ms: half of the way, and from speed to speed. */
static double motion_steps(const false_input_def *def)
{
  return motion_more(def) > 0.0
             ? def->spike * (def->stiffness * 2.0 * 0.002 / HOLD_S + 4.0 * DAMPING / HOLD_S)
             : 0.0;
}

void false_input_compare(const false_input_def *def, const false_input_run *right,
                         const false_input_run *run, false_input_figures *out)
{
  run_extremes(def, right, &out->peak_right, &out->step_right);
  run_extremes(def, run, &out->peak, &out->step);
  out->share = out->step_more = 0.0;
  int apart = (int)(0.002 * def->haptic_hz + 0.5);
  for (int i = (int)(FALSE_INPUT_BEGIN_S * def->haptic_hz); i < run->ticks; ++i) {
    double since = i / def->haptic_hz - FALSE_INPUT_BEGIN_S;
    bool unknown = run->seen_s < 0.0 || since <= run->seen_s + FALSE_INPUT_TOLD_S;
    double right_now = fmax(out->peak_right, run->pressed[i]) + (unknown ? motion_more(def) : 0.0);
    double change[3];
    hapi_v3_sub(run->force[i], run->force[i - apart], change);
    double known = out->step_right + (since <= FALSE_INPUT_LENGTH_S ? motion_steps(def) : 0.0);
    out->step_more = fmax(out->step_more, hapi_v3_norm(change) - known);
    out->share = fmax(out->share, hapi_v3_norm(run->force[i]) / right_now);
  }
}
