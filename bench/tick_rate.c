/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Eight cubes at one hand, in real time: device, tick and messages of a session with its threads, at 1, 4
 * and 10 kHz. "free": they fall up against the hand and touch nothing else. "floor": the hand presses them
 * down on it, so model CONTACT carries 4 contacts of each as well. The duty is that of the median tick: on a
 * machine that others use the mean counts their work as well; it stands beside it. */

#include "bench/tick_rate.h"

#include <string.h>

#include "base/clock.h"
#include "bench/cycles.h"
#include "bench/tick_contact.h"
#include "tools/rig.h"

#define CUBES 8
#define SETTLED_S 0.5
#define FAST_HZ 10000.0
#define DUTY_BOUND 0.05 /* free, at FAST_HZ */
#define DAMPING 4.0     /* N s/m: soon at rest on the scene's 100 N/m */

static const double rates[] = {1000.0, 4000.0, FAST_HZ};
static const hap_model models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE, HAP_MODEL_CONTACT};

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

typedef struct rate_case {
  hap_model model;
  double haptic_hz;
  bool free;
} rate_case;

/* A cube on one point would roll off within a moment: these are hard to turn. */
static void turn_over(const scene *s)
{
  dWorldSetGravity(s->world, 0.0, 0.0, s->parameters.gravity);
  for (int i = 0; i < s->count; ++i) {
    dMass mass;
    dBodyGetMass(s->bodies[i], &mass);
    for (int axis = 0; axis < 3; ++axis) {
      mass.I[5 * axis] *= 1e6;
    }
    dBodySetMass(s->bodies[i], &mass);
  }
}

static hap_status open_rig(bench *b, const rate_case *what, rig *out)
{
  static scene_parameters field; /* the session keeps no copy */
  rig_options options;
  field = *cycles_scene("field");
  field.damping = DAMPING;
  rig_options_init(&options);
  options.parameters = &field;
  options.count = CUBES;
  options.devices[0] = what->free ? "virtual:path=0:0/0/80.051,hand=rigid" : field.hands[0];
  options.device_count = 1;
  options.max_force = 200.0;
  options.def.drive = HAP_DRIVE_THREADS;
  options.def.model = what->model;
  options.def.haptic_hz = what->haptic_hz;
  hap_status status = rig_create(&options, out, &b->detail);
  if (status >= HAP_OK && what->free) {
    turn_over(out->scene);
  }
  return status >= HAP_OK ? hap_session_start(out->session) : status;
}

static void wait(double seconds)
{
  hapi_clock_sleep_until(hapi_clock_now() + (int64_t)(1e9 * seconds));
}

static hap_status all_push(bench *b, const rig *r)
{
  hap_pointer_state state;
  hap_status status = hap_pointer_get(r->session, r->pointers[0], &state, sizeof state);
  return status < HAP_OK || state.contacts == CUBES
             ? status
             : bench_fail(b, HAP_ERROR_STATE, "%u of %d cubes push the hand", state.contacts,
                          CUBES);
}

static hap_status measure(bench *b, const rate_case *what, hap_stats *out)
{
  rig r;
  memset(&r, 0, sizeof r);
  hap_status status = open_rig(b, what, &r);
  if (status >= HAP_OK) {
    wait(SETTLED_S);
    wait(b->quick ? 0.5 : 2.0);
    (void)hap_session_stats(r.session, out, sizeof *out);
    status = all_push(b, &r);
  } else if (r.session != NULL) {
    (void)hap_session_detail(r.session, &b->detail);
  }
  rig_destroy(&r);
  return status;
}

static void report(bench *b, const rate_case *what, const hap_stats *s, FILE *csv)
{
  double duty = 1e-6 * s->tick_us_p50 * what->haptic_hz;
  const char *name = hap_model_name(what->model);
  const char *layout = what->free ? "free" : "floor";
  const char *text =
      "%s, %d neighbours, %s, %g kHz: the loop takes %.2f us a cycle, %.2f %% of a "
      "core (mean %.2f %%)%s";
  double mean = 100.0 * s->haptic_duty;
  if (what->free && what->haptic_hz == FAST_HZ) {
    bench_check(b, duty <= DUTY_BOUND, text, name, CUBES, layout, 1e-3 * what->haptic_hz,
                s->tick_us_p50, 100.0 * duty, mean, " (bound 5 %)");
  } else {
    bench_say(text, name, CUBES, layout, 1e-3 * what->haptic_hz, s->tick_us_p50, 100.0 * duty, mean,
              "");
  }
  fprintf(csv, "%s,%d,,%.1f,%.2f,%.1f,field_%s,%gkHz,,,,\n", name, CUBES, 1e3 * s->tick_us_p50,
          1e3 * s->tick_us_p50 / CUBES, 1e3 * s->tick_us_p99, layout, 1e-3 * what->haptic_hz);
}

hap_status bench_tick_rate(bench *b, FILE *csv)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < COUNT(models) * COUNT(rates) * 2 && status >= HAP_OK; ++i) {
    hap_stats stats;
    rate_case what = {models[i / 2 / COUNT(rates)], rates[i / 2 % COUNT(rates)], i % 2 == 0};
    if (!b->quick || what.haptic_hz == FAST_HZ) {
      status = measure(b, &what, &stats);
      if (status >= HAP_OK) {
        report(b, &what, &stats, csv);
      }
    }
  }
  return status;
}
