/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "bench/late.h"
#include "bench/progress.h"
#include "device/device.h"
#include "plugins/virtual/virtual.h"
#include "session/session_internal.h"
#include "tools/rig.h"
#include "tools/spidar-emulator/driven.h"

/* hapode-bench late: a loop that is stopped in pulses, with the virtual device and with an emulated
 * SPIDAR. The virtual clock leaves out the ticks of each pulse, and the simulated hand goes on with
 * the force that was held. Every run is compared with the same one without pulses. */

#define LATE_HZ 1000

const late_pulse late_busy[LATE_BUSY] = {
    {7, 1}, {1, 1}, {4, 2},  {1, 4},  {2, 1}, {1, 1}, {2, 3},  {3, 2}, {2, 2}, {3, 2}, {1, 1},
    {3, 2}, {4, 2}, {2, 2},  {1, 4},  {2, 2}, {3, 2}, {5, 3},  {6, 4}, {3, 7}, {9, 2}, {2, 2},
    {7, 2}, {2, 2}, {4, 2},  {1, 3},  {1, 1}, {3, 1}, {3, 1},  {2, 2}, {2, 2}, {1, 1}, {3, 2},
    {5, 2}, {8, 2}, {2, 4},  {1, 3},  {4, 2}, {4, 2}, {5, 5},  {6, 2}, {4, 2}, {2, 2}, {3, 1},
    {1, 1}, {5, 3}, {13, 3}, {2, 2},  {2, 2}, {1, 1}, {5, 1},  {1, 2}, {4, 3}, {3, 2}, {2, 3},
    {2, 2}, {2, 2}, {5, 2},  {4, 1},  {6, 2}, {2, 2}, {6, 2},  {3, 1}, {9, 3}, {4, 4}, {8, 1},
    {2, 1}, {7, 2}, {2, 1},  {5, 1},  {8, 2}, {1, 7}, {2, 2},  {7, 1}, {4, 1}, {8, 2}, {3, 1},
    {1, 3}, {1, 2}, {2, 3},  {4, 1},  {2, 2}, {2, 1}, {13, 3}, {4, 1}, {1, 1}, {2, 3}, {1, 2},
    {1, 1}, {3, 1}, {3, 1},  {23, 1}, {7, 1}, {3, 1}, {2, 2},  {2, 2}, {1, 1}, {2, 1}, {2, 1},
    {2, 2}, {3, 1}, {2, 2},  {2, 2},  {2, 3}, {2, 3}, {8, 2},  {2, 6}, {1, 1}, {4, 2}, {8, 4},
    {1, 4}, {3, 2}, {6, 4},  {2, 2},  {4, 2}, {1, 1}, {1, 2},  {1, 4}, {2, 2}, {2, 2}};

/* Whether the loop runs in a tick: pulses begin with tick 0, wherever the run is disturbed. */
static bool late_runs(const late_def *def, int tick)
{
  uint32_t all = 0;
  for (int i = 0; i < def->pulse_count; ++i) {
    all += def->pulses[i].run + def->pulses[i].stop;
  }
  uint32_t at = all > 0 ? (uint32_t)tick % all : 0;
  for (int i = 0; i < def->pulse_count; ++i) {
    if (at < def->pulses[i].run + def->pulses[i].stop) {
      return at < def->pulses[i].run;
    }
    at -= def->pulses[i].run + def->pulses[i].stop;
  }
  return true;
}

typedef struct late_felt {
  double force[3];
  double peak; /* N */
  double step; /* N, the largest from tick to tick */
  unsigned steps;
} late_felt;

/* explained: N, of a change from tick to tick that is right. */
static void felt_take(late_felt *felt, const double force[3], double explained)
{
  double change = 0.0;
  double norm = 0.0;
  for (int i = 0; i < 3; ++i) {
    change += (force[i] - felt->force[i]) * (force[i] - felt->force[i]);
    norm += force[i] * force[i];
    felt->force[i] = force[i];
  }
  felt->peak = fmax(felt->peak, sqrt(norm));
  felt->step = fmax(felt->step, sqrt(change));
  felt->steps += sqrt(change) > fmax(LATE_STEP_N, explained);
}

/* How the first pointer of a run is looked at. */
typedef struct late_look {
  late_felt felt;
  late_hand hand;
  late_bodies bodies;
  double at[3]; /* m, of the hand at the last tick that ran */
  int ticks;    /* since then */
} late_look;

/* N, by which the force may change in this tick as its truth does; 0: not known. */
static double hand_look(const rig *r, const late_def *def, int tick, const hap_pointer_state *state,
                        late_look *io, late_result *out)
{
  const double *force = state->wrench.force;
  double newtons = hapi_v3_norm(force);
  double moved[3];
  hapi_v3_sub(state->device.position, io->at, moved);
  hapi_v3_scale(LATE_HZ / (double)io->ticks, moved, moved);
  hapi_v3_copy(state->device.position, io->at);
  int ticks = io->ticks;
  io->ticks = 0;
  if (def->course != NULL && tick < LATE_TICKS_MAX) {
    def->course->force[tick] = newtons;
    def->course->speed[tick] =
        newtons > 0.0 ? fmax(-hapi_v3_dot(force, moved) / newtons, 0.0) : 0.0;
  }
  if (!io->hand.prescribed || (state->guard & HAP_GUARD_FAULT) != 0) { /* a fault fades */
    return 0.0;
  }
  const late_place place = {io->at, ticks, (state->guard & HAP_GUARD_LATE) != 0};
  late_true now = late_spring(r->scene, r->session, &place, &io->bodies);
  out->beyond = now.known ? fmax(out->beyond, newtons - now.most) : out->beyond;
  return now.known ? now.change + LATE_BEYOND_N : 0.0;
}

static hap_status late_tick(bench *b, const rig *r, const late_def *def, int tick, late_look *io,
                            late_result *out)
{
  bool stops =
      def->pulse_count > 0 && tick >= def->begin && tick < def->end && !late_runs(def, tick);
  hap_pointer_state state;
  memset(&state, 0, sizeof state);
  r->session->pulses.run_ticks = 0;
  r->session->pulses.stop_ticks = stops ? 1 : 0;
  hap_status status = hap_session_advance(r->session, 1);
  if (status < HAP_OK) {
    return bench_explain(b, r->session, status);
  }
  (void)hap_pointer_get(r->session, r->pointers[0], &state, sizeof state);
  ++io->ticks;
  double explained = stops ? 0.0 : hand_look(r, def, tick, &state, io, out);
  felt_take(&io->felt, state.wrench.force, explained);
  return HAP_OK;
}

static void device_look(const hap_device *device, double *least, late_result *out)
{
  hapi_virtual_port port;
  if (hapi_device_ops(device) == &driven_spidar_ops) {
    const driven_spidar *d = hapi_device_self(device);
    out->pulled = fmax(out->pulled, hapi_v3_norm(d->emulator.grip.wrench.force));
    return;
  }
  hapi_virtual_get_port(hapi_device_self(device), &port);
  *least = fmin(*least, port.work);
  out->gave = fmax(out->gave, port.work - *least);
}

static hap_status late_ticks(bench *b, const rig *r, const late_def *def, late_result *out)
{
  const scene_parameters *p = &r->scene->parameters;
  late_look look = {.hand = late_hand_of(def->device == NULL ? p->hands[0] : NULL)};
  if (def->course != NULL) {
    def->course->hand = look.hand;
    def->course->touch = (late_touch){p->stiffness, p->damping};
  }
  out->beyond = -HUGE_VAL;
  hap_stats stats = {0};
  uint64_t derated = 0;
  double least = 0.0;
  for (int t = 0; t < def->ticks; ++t) {
    hap_status status = late_tick(b, r, def, t, &look, out);
    if (status < HAP_OK) {
      return status;
    }
    device_look(r->devices[0], &least, out);
    (void)hap_session_stats(r->session, &stats, sizeof stats);
    if (t >= def->end && stats.safety.derated_ticks > derated) {
      out->back_ms = t + 1 - def->end;
    }
    derated = stats.safety.derated_ticks;
  }
  out->deep_known = look.bodies.known;
  out->peak = look.felt.peak;
  out->step = look.felt.step;
  out->steps = look.felt.steps;
  out->derated = derated;
  out->fault = stats.faults.fault;
  out->missed = stats.loop.missed_ticks;
  return HAP_OK;
}

hap_status late_run(bench *b, const late_def *def, late_result *out)
{
  rig r;
  rig_options options;
  memset(out, 0, sizeof *out);
  rig_options_init(&options);
  options.scene = def->scene;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.haptic_hz = LATE_HZ;
  hap_status status = HAP_OK;
  if (def->device != NULL && strcmp(def->device, LATE_SPIDAR) == 0) {
    status = hapi_device_open_ops(&driven_spidar_ops, NULL, "", &options.hardware, &b->detail);
    options.device_count = 1;
  } else if (def->device != NULL) {
    options.devices[0] = def->device;
    options.device_count = 1;
  }
  if (status < HAP_OK) {
    return status;
  }
  status = rig_create(&options, &r, &b->detail);
  if (status < HAP_OK) {
    return status;
  }
  status = hap_session_start(r.session);
  status = status < HAP_OK ? bench_explain(b, r.session, status) : late_ticks(b, &r, def, out);
  rig_destroy(&r);
  return status;
}

/* ---- the program ---- */

#define LATE_HEADER                                                                            \
  "scene,stop_ms,run_ms,begin_ms,peak_n,peak_ratio,steps,steps_without,step_n,missed,derated," \
  "fault,back_ms,device,pulled_n,pulled_without_n"

static int longest_stop(const late_def *def)
{
  uint32_t longest = 0;
  for (int i = 0; i < def->pulse_count; ++i) {
    longest = def->pulses[i].stop > longest ? def->pulses[i].stop : longest;
  }
  return (int)longest;
}

/* N, by the course of the run without pulses; 0: nothing is known. */
static double late_demanded(const late_def *def)
{
  const late_course *c = def->course;
  double most = 0.0;
  for (int t = def->begin; c->hand.known && t < def->end && t < LATE_TICKS_MAX; ++t) {
    most = fmax(most,
                late_demands(&c->hand, &c->touch, c->force[t], c->speed[t], 1 + longest_stop(def)));
  }
  return most;
}

/* Within 1.2 of the run without pulses, or else no more than such pulses demand. A prescribed hand
 * never has more than the spring at its true depth. */
static bool peak_is_right(const late_result *now, double ratio, double pulled, double demanded)
{
  bool demands = now->deep_known ? now->beyond <= LATE_BEYOND_N : now->peak <= demanded;
  return pulled <= LATE_PEAK_RATIO && (ratio <= LATE_PEAK_RATIO || demands) &&
         (!now->deep_known || demands);
}

static hap_status late_row(bench *b, FILE *csv, late_def def, const late_result *still)
{
  late_result now;
  char pulse[32] = "busy loops";
  uint32_t stop = def.pulse_count == 1 ? def.pulses[0].stop : 0;
  uint32_t run = def.pulse_count == 1 ? def.pulses[0].run : 0;
  if (def.pulse_count == 1) {
    (void)snprintf(pulse, sizeof pulse, "%u/%u ms", stop, run);
  }
  double demanded = late_demanded(&def);
  def.course = NULL;
  hap_status status = late_run(b, &def, &now);
  if (status < HAP_OK) {
    return status;
  }
  double ratio = still->peak > 0.0 ? now.peak / still->peak : 1.0;
  double pulled = still->pulled > 0.0 ? now.pulled / still->pulled : 1.0;
  char asked[64] = "no closed form";
  if (now.deep_known) {
    (void)snprintf(asked, sizeof asked, "%.2f N beyond the spring's", now.beyond);
  } else if (demanded > 0.0) {
    (void)snprintf(asked, sizeof asked, "closed form %.2f N", demanded);
  }
  const char *device = def.device != NULL ? def.device : "virtual";
  const char *fault = now.fault == HAP_FAULT_NONE   ? "none"
                      : now.fault == HAP_FAULT_LATE ? "latched"
                                                    : "another one";
  bool told = now.fault != HAP_FAULT_NONE || now.derated > 0 || (stop > 0 && stop <= 5);
  bool back = now.fault != HAP_FAULT_NONE || now.back_ms <= LATE_BACK_MS;
  fprintf(csv, "%s,%u,%u,%d,%.4f,%.3f,%u,%u,%.3f,%llu,%llu,%s,%d,%s,%.3f,%.3f\n", def.scene, stop,
          run, def.begin, now.peak, ratio, now.steps, still->steps, now.step,
          (unsigned long long)now.missed, (unsigned long long)now.derated, fault, now.back_ms,
          device, now.pulled, still->pulled);
  bench_check(
      b,
      told && back && peak_is_right(&now, ratio, pulled, demanded) &&
          now.steps <= LATE_PEAK_RATIO * still->steps &&
          (now.fault == HAP_FAULT_NONE || now.fault == HAP_FAULT_LATE),
      "%s, %s, %s from %d ms: %.2f N, %.2f of that without pulses, %s; %u steps above 2 N "
      "(%u without), largest %.2f N; %llu ticks with less force, fault %s, back after %d ms; gave "
      "%.1f mJ (%.1f); strings %.2f N (%.2f)",
      def.scene, device, pulse, def.begin, now.peak, ratio, asked, now.steps, still->steps,
      now.step, (unsigned long long)now.derated, fault, now.back_ms, 1e3 * now.gave,
      1e3 * still->gave, now.pulled, still->pulled);
  return HAP_OK;
}

/* Begins over the way to the cubes, the touch, and the rest there. */
typedef struct late_plan {
  const char *scene;
  const char *device;
  int ticks;
  int first;
  int last;
} late_plan;

#define LATE_BEGIN_EVERY 107

static const late_pulse pulses[] = {{8, 8},   {12, 4}, {15, 5}, {30, 10}, {3, 1},
                                    {45, 45}, {2, 1},  {5, 3},  {10, 20}, {25, 4}};

/* Before this tick all pulses have begun. */
static int last_of(const bench *b, const late_plan *plan)
{
  return b->quick ? plan->first + 1 : plan->last;
}

static size_t rows_of(const bench *b, const late_plan *plan)
{
  int begins = (last_of(b, plan) - plan->first + LATE_BEGIN_EVERY - 1) / LATE_BEGIN_EVERY;
  return (BENCH_COUNT(pulses) + 1) * (size_t)begins;
}

static hap_status late_scene(bench *b, FILE *csv, const late_plan *plan)
{
  static late_course course; /* of the run without pulses */
  late_def def = {
      .scene = plan->scene, .device = plan->device, .ticks = plan->ticks, .course = &course};
  late_result still;
  memset(&course, 0, sizeof course);
  hap_status status = late_run(b, &def, &still);
  for (size_t i = 0; i <= BENCH_COUNT(pulses); ++i) {
    bool alone = i < BENCH_COUNT(pulses);
    def.pulses = alone ? &pulses[i] : late_busy;
    def.pulse_count = alone ? 1 : LATE_BUSY;
    for (int begin = plan->first; begin < last_of(b, plan); begin += LATE_BEGIN_EVERY) {
      def.begin = begin;
      def.end = begin + 1000;
      if (status >= HAP_OK) {
        status = late_row(b, csv, def, &still);
        progress_add(1, plan->ticks);
      }
    }
  }
  return status;
}

hap_status bench_late(bench *b)
{
  const late_plan own = {
      .scene = b->scene != NULL ? b->scene : "row10", .ticks = 2500, .first = 300, .last = 1200};
  /* Whose strings are wound in first. */
  const late_plan spidar = {
      .scene = "row10", .device = LATE_SPIDAR, .ticks = 4200, .first = 1861, .last = 2700};
  FILE *csv = bench_csv_open(b, "late", LATE_HEADER);
  if (csv == NULL) {
    return bench_csv_close(b, csv, HAP_OK);
  }
  size_t rows = rows_of(b, &own);
  size_t more = b->scene == NULL ? rows_of(b, &spidar) : 0;
  progress_begin("late", "rows", rows + more,
                 (double)rows * own.ticks + (double)more * spidar.ticks);
  hap_status status = late_scene(b, csv, &own);
  if (status >= HAP_OK && b->scene == NULL) {
    status = late_scene(b, csv, &spidar);
  }
  progress_end();
  return bench_csv_close(b, csv, status);
}
