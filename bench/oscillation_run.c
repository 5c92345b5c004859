/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/oscillation.h"

#include <math.h>
#include <string.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/vec.h"
#include "device/device.h"
#include "tools/session_defs.h"

#define STEP_S 2e-5 /* of the mass */
#define PAST 1024   /* steps that are kept: 20 ms */
#define RADIUS 0.01
#define PRESS_S 0.3
#define TREMOR_HZ 10.0
#define EDGE 0.03 /* m, of bars and cubes */
#define RIDGE 0.004
#define PHYSICS_HZ 60

typedef struct osc_stage {
  const osc_def *def;
  dWorldID world;
  dSpaceID space;
  dBodyID moving; /* driven; NULL: none */
  hap_session *session;
  hap_device *device;
  hap_pointer_id pointer;
  double time; /* s, of the mass */
  double position[3];
  double velocity[3];
  double held[3]; /* N, as told to the motors */
  double past[PAST][3];
  double past_velocity[PAST][3];
  uint64_t steps;
} osc_stage;

void osc_init(osc_def *def)
{
  *def = (osc_def){.stiffness = 1000.0,
                   .haptic_hz = 1000.0,
                   .max_force = 20.0,
                   .seconds = 4.0,
                   .amplitude = 0.006,
                   .speed = 0.3,
                   .hz = 1.0};
}

/* ---- the device ---- */

static double osc_smooth(double share)
{
  double s = fmin(fmax(share, 0.0), 1.0);
  return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
}

/* Where the hand wants to be; the surface is at x = 0 of the pointer. */
static void osc_target(const osc_def *def, double time, double out[3])
{
  double in = osc_smooth(time / PRESS_S);
  double phase = 2.0 * M_PI * def->hz * time;
  double begun = fmax(time - PRESS_S, 0.0);
  hapi_v3_set(out, 0.0, 0.0, 0.0);
  if (def->path != NULL) {
    double at = fmin(time * def->haptic_hz, def->path_count - 1.001);
    int i = (int)at;
    for (int k = 0; k < 3; ++k) {
      out[k] = def->path[i][k] + (at - i) * (def->path[i + 1][k] - def->path[i][k]);
    }
    return;
  }
  switch (def->motion) {
    case OSC_PRESS:
      out[0] = -0.01 + in * (0.01 + def->amplitude);
      break;
    case OSC_SHAKE:
      out[0] = -0.01 + in * (0.01 + def->amplitude) +
               0.5 * def->amplitude * sin(2.0 * M_PI * def->hz * begun);
      break;
    case OSC_TAP:
      out[0] = -def->amplitude * cos(phase);
      break;
    case OSC_HIT:
      out[0] = fmin(-0.03 + def->speed * time, def->amplitude);
      break;
    case OSC_SLIDE:
      out[0] = -0.01 + in * (0.01 + def->amplitude);
      out[1] = def->speed * begun - 0.1;
      break;
  }
  out[0] += def->tremor * sin(2.0 * M_PI * TREMOR_HZ * time);
}

static void osc_step(osc_stage *s)
{
  const osc_plant *p = &s->def->plant;
  double now[3];
  double next[3];
  osc_target(s->def, s->time, now);
  osc_target(s->def, s->time + STEP_S, next);
  for (int k = 0; k < 3; ++k) {
    double target_speed = (next[k] - now[k]) / STEP_S;
    double force = p->flipped == k + 1 ? -s->held[k] : s->held[k];
    if (p->mass > 0.0) {
      force += p->hand_stiffness * (now[k] - s->position[k]) +
               p->hand_damping * (target_speed - s->velocity[k]) - p->damping * s->velocity[k];
      force += k == 0 && s->time > 0.1 ? p->push : 0.0;
      s->velocity[k] += STEP_S * force / p->mass;
      s->position[k] += STEP_S * s->velocity[k];
    } else {
      s->position[k] = next[k];
    }
    s->past[s->steps % PAST][k] = s->position[k];
    s->past_velocity[s->steps % PAST][k] = p->mass > 0.0 ? s->velocity[k] : target_speed;
  }
  s->time += STEP_S;
  ++s->steps;
}

static osc_stage *osc_opening; /* one after the other */

static hap_status osc_open(void *context, const char *args, void **self, hap_detail *detail)
{
  (void)context;
  (void)args;
  (void)detail;
  *self = osc_opening;
  return HAP_OK;
}

static void osc_describe(void *self, uint32_t effector, hap_device_info *out)
{
  (void)effector;
  const osc_stage *s = self;
  out->dof = 3;
  out->max_force = s->def->max_force;
  out->quantum = s->def->plant.quantum;
  out->measures_velocity = out->quantum == 0.0;
}

static hap_status osc_start(void *self)
{
  osc_stage *s = self;
  osc_target(s->def, 0.0, s->position);
  for (int i = 0; i < PAST; ++i) {
    hapi_v3_copy(s->position, s->past[i]);
  }
  return HAP_OK;
}

static hap_status osc_read(void *self, int64_t time_ns, hap_device_input *const out[])
{
  hap_device_input *in = out[0];
  osc_stage *s = self;
  double quantum = s->def->plant.quantum;
  while (s->time < 1e-9 * (double)time_ns - 0.5 * STEP_S) {
    osc_step(s);
  }
  uint64_t age = 1 + (uint64_t)(s->def->plant.delay_s / STEP_S + 0.5);
  memset(&in->pose, 0, sizeof in->pose);
  memset(&in->twist, 0, sizeof in->twist);
  in->pose.quat_wxyz[0] = 1.0;
  hapi_v3_copy(s->past[(s->steps + PAST - age) % PAST], in->pose.position);
  if (s->steps > 0) {
    hapi_v3_copy(s->past_velocity[(s->steps + PAST - age) % PAST], in->twist.linear);
  }
  for (int k = 0; k < 3 && quantum > 0.0; ++k) {
    in->pose.position[k] = quantum * round(in->pose.position[k] / quantum);
  }
  in->buttons = 0;
  return HAP_OK;
}

static hap_status osc_write(void *self, const hap_device_output *const wanted[],
                            hap_device_output *const reached[])
{
  osc_stage *s = self;
  hapi_v3_copy(wanted[0]->wrench.force, s->held);
  reached[0]->wrench = wanted[0]->wrench;
  return HAP_OK;
}

static void osc_zero(void *self)
{
  osc_stage *s = self;
  hapi_v3_set(s->held, 0.0, 0.0, 0.0);
}

static const hap_device_ops osc_ops = {.abi = HAP_DEVICE_ABI,
                                       .size = sizeof(hap_device_ops),
                                       .name = "plain",
                                       .help = "a mass with a hand on it",
                                       .pacing = HAP_PACING_VIRTUAL,
                                       .open = osc_open,
                                       .describe = osc_describe,
                                       .start = osc_start,
                                       .read = osc_read,
                                       .write = osc_write,
                                       .zero = osc_zero,
                                       .stop = osc_zero,
                                       .close = osc_zero};

/* ---- the world ---- */

static dBodyID osc_driven(const osc_stage *s, dGeomID geom, double x)
{
  dBodyID body = dBodyCreate(s->world);
  dBodySetKinematic(body);
  dGeomSetBody(geom, body);
  dBodySetPosition(body, x, 0.0, 0.0);
  return body;
}

static void osc_build(osc_stage *s)
{
  double face = RADIUS;
  s->world = dWorldCreate();
  s->space = dHashSpaceCreate(NULL);
  dWorldSetERP(s->world, 0.2);
  dWorldSetCFM(s->world, 1e-10);
  switch (s->def->world) {
    case OSC_EDGES:
      s->moving = osc_driven(s, dCreateBox(s->space, EDGE, EDGE, 0.2), face + 0.6 * EDGE);
      dBodySetAngularVel(s->moving, 0.0, 0.0, 2.0 * M_PI * s->def->world_hz / 4.0);
      return;
    case OSC_PLATE:
      s->moving = osc_driven(s, dCreateBox(s->space, 0.1, 0.5, 0.5), face + 0.05);
      return;
    case OSC_BUMPS:
      for (int i = -40; i < 40; ++i) {
        dGeomID ridge = dCreateCapsule(s->space, RIDGE, 0.2);
        dGeomSetPosition(ridge, face + RIDGE, 2.0 * RIDGE * i, 0.0);
      }
      return;
    case OSC_CUBES:
      for (int i = 0; i < 5; ++i) {
        dMass mass;
        dBodyID body = dBodyCreate(s->world);
        dMassSetBoxTotal(&mass, 0.1, EDGE, EDGE, EDGE);
        dBodySetMass(body, &mass);
        dGeomSetBody(dCreateBox(s->space, EDGE, EDGE, EDGE), body);
        dBodySetPosition(body, face + 0.5 * EDGE, 0.0, 0.0);
        face += EDGE;
      }
      break;
    case OSC_DROPPED: {
      dMass mass;
      dWorldSetGravity(s->world, 9.81, 0.0, 0.0);
      s->moving = NULL;
      dBodyID body = dBodyCreate(s->world);
      dMassSetSphereTotal(&mass, 0.1, 0.015);
      dBodySetMass(body, &mass);
      dGeomSetBody(dCreateSphere(s->space, 0.015), body);
      dBodySetPosition(body, face + 0.015, 0.0, 0.0);
      face += 0.04;
      break;
    }
    case OSC_WALL:
      break;
  }
  dGeomSetPosition(dCreateBox(s->space, 0.2, 1.0, 1.0), face + 0.1, 0.0, 0.0);
}

static bool osc_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode = dContactApprox1 | dContactBounce;
  io->mu = 0.3;
  io->bounce = 0.8;
  io->bounce_vel = 0.01;
  return true;
}

/* The plate goes to and fro by the amplitude of the press; driven by its velocity. */
static void osc_drive(const osc_stage *s, uint64_t tick)
{
  if (s->moving != NULL && s->def->world == OSC_PLATE) {
    double w = 2.0 * M_PI * s->def->world_hz;
    double time = (double)tick / s->def->haptic_hz;
    dBodySetLinearVel(s->moving, w * 0.5 * s->def->amplitude * cos(w * time), 0.0, 0.0);
  }
}

/* ---- a run ---- */

static hap_status osc_begin(osc_stage *s, hap_detail *detail)
{
  hap_ode_def ode;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_pointer_def pointer;
  hap_ode_def_init(&ode, sizeof ode);
  session_defs_init(&def, &expert, &research);
  hap_pointer_def_init(&pointer, sizeof pointer);
  ode.world = s->world;
  ode.space = s->space;
  ode.surface = osc_surface;
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = s->def->world == OSC_PLATE ? 120 : PHYSICS_HZ;
  def.haptic_hz = s->def->haptic_hz;
  research.guard = s->def->unguarded ? HAP_GUARD_MEASURE : HAP_GUARD_ON;
  osc_opening = s;
  hap_status status = hapi_device_open_ops(&osc_ops, NULL, "", &s->device, detail);
  status = status >= HAP_OK ? hap_session_create(&def, &ode, &s->session, detail) : status;
  pointer.device = s->device;
  pointer.radius = RADIUS;
  pointer.stiffness = s->def->stiffness;
  pointer.max_force = s->def->max_force;
  status = status >= HAP_OK ? hap_pointer_add(s->session, &pointer, &s->pointer) : status;
  status = status >= HAP_OK ? hap_session_start(s->session) : status;
  if (status < HAP_OK && s->session != NULL) {
    (void)hap_session_detail(s->session, detail);
  }
  return status;
}

static hap_status osc_tick(osc_stage *s, osc_result *out)
{
  hap_pointer_state state;
  hap_stats stats;
  int t = out->ticks;
  double time = t / s->def->haptic_hz;
  osc_drive(s, (uint64_t)t);
  hap_status status = hap_session_advance(s->session, 1);
  status =
      status >= HAP_OK ? hap_pointer_get(s->session, s->pointer, &state, sizeof state) : status;
  status = status >= HAP_OK ? hap_session_stats(s->session, &stats, sizeof stats) : status;
  if (status < HAP_OK) {
    return status;
  }
  double force = hapi_v3_norm(s->held);
  bool lowered = (state.guard & HAP_GUARD_OSCILLATION) != 0;
  out->touched_s = out->touched_s < 0.0 && force > 0.0 ? time : out->touched_s;
  out->derated_s = out->derated_s < 0.0 && lowered ? time : out->derated_s;
  if (out->latched_s < 0.0 && stats.faults.fault != HAP_FAULT_NONE) {
    out->latched_s = time;
    out->fault = stats.faults.fault;
  }
  out->peak = fmax(out->peak, force);
  out->derated = stats.safety.oscillation_ticks;
  out->force[t] = s->held[0];
  out->way[t] = s->position[0];
  ++out->ticks;
  return HAP_OK;
}

/* Swings of a force: turns by more than a tenth of its range. */
static void osc_figures(const osc_def *def, int end, osc_result *out)
{
  int begin = end > (int)(0.3 * def->haptic_hz) ? end - (int)(0.3 * def->haptic_hz) : 0;
  double low = out->force[begin];
  double high = low;
  for (int t = begin; t < end; ++t) {
    low = fmin(low, out->force[t]);
    high = fmax(high, out->force[t]);
  }
  double middle = 0.5 * (low + high);
  int turns = 0;
  bool above = out->force[begin] > middle;
  for (int t = begin; t < end; ++t) {
    bool now = above ? out->force[t] > middle - 0.1 * (high - low)
                     : out->force[t] > middle + 0.1 * (high - low);
    turns += now != above;
    above = now;
  }
  out->swing = high - low;
  out->hz = end > begin ? 0.5 * turns * def->haptic_hz / (end - begin) : 0.0;
}

hap_status osc_run(const osc_def *def, osc_result *out, hap_detail *detail)
{
  memset(out, 0, sizeof *out);
  out->touched_s = out->derated_s = out->latched_s = -1.0;
  osc_stage *s = hapi_alloc(sizeof *s);
  if (s == NULL) {
    return hapi_fail(detail, HAP_ERROR_MEMORY, "out of memory");
  }
  s->def = def;
  osc_build(s);
  hap_status status = osc_begin(s, detail);
  int ticks = (int)fmin(def->seconds * def->haptic_hz, OSC_TICKS_MAX);
  for (int t = 0; t < ticks && status >= HAP_OK; ++t) {
    status = osc_tick(s, out);
  }
  int acted = out->derated_s >= 0.0 ? (int)(out->derated_s * def->haptic_hz) : out->ticks;
  osc_figures(def, acted, out);
  int from = acted + (int)(0.2 * def->haptic_hz);
  for (int t = from; t < out->ticks && t < from + (int)(0.2 * def->haptic_hz); ++t) {
    out->after = fmax(out->after, fabs(out->force[t]));
  }
  hap_session_destroy(s->session);
  hap_device_close(s->device);
  dSpaceDestroy(s->space);
  dWorldDestroy(s->world);
  hapi_free(s);
  return status;
}

void osc_plain(const osc_def *def, osc_result *out)
{
  static double past[4096];
  const osc_plant *p = &def->plant;
  const double step = 1e-5;
  const int each = (int)(1.0 / (def->haptic_hz * step) + 0.5);
  const int age = (int)(p->delay_s / step + 0.5);
  double x = -0.01;
  double v = 0.0;
  double force = 0.0;
  memset(out, 0, sizeof *out);
  for (int i = 0; i < 4096; ++i) {
    past[i] = x;
  }
  for (int n = 0; out->ticks < (int)(def->seconds * def->haptic_hz); ++n) {
    double target[3];
    double later[3];
    if (n % each == 0) {
      double told = past[(n + 4096 - age) % 4096];
      force = told > 0.0 ? -fmin(def->stiffness * told, def->max_force) : 0.0;
      out->force[out->ticks] = force;
      out->way[out->ticks] = x;
      out->peak = fmax(out->peak, fabs(force));
      ++out->ticks;
    }
    osc_target(def, n * step, target);
    osc_target(def, (n + 1) * step, later);
    double sum = force + p->hand_stiffness * (target[0] - x) +
                 p->hand_damping * ((later[0] - target[0]) / step - v) - p->damping * v +
                 (n * step > 0.1 ? p->push : 0.0);
    v += step * sum / p->mass;
    x += step * v;
    past[(n + 1) % 4096] = x;
  }
  osc_figures(def, out->ticks, out);
}
