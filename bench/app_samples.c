/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/app_samples.h"

#include <math.h>

#include "base/log.h"
#include "bench/app_stand.h"

#define PI 3.14159265358979323846
#define SETTLE_S 0.06 /* s: beyond every ramp */

static hap_surface plain_surface(void)
{
  return (hap_surface){.size = sizeof(hap_surface), .touchable = 1, .stiffness = STAND_STIFFNESS};
}

/* A floor, and a hand 1 mm above it. */
static void floor_init(bench *b, app_stand *s, hap_model model, double haptic_hz)
{
  stand_init(b, s, 0.0);
  dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
  s->def.model = model;
  s->def.haptic_hz = haptic_hz;
  s->says = plain_surface();
  s->at[2] = STAND_RADIUS + 0.001;
}

static int ticks_of(const app_stand *s, double seconds)
{
  return (int)lround(seconds * s->def.haptic_hz);
}

/* ---- vibration ---- */

#define SHAKE 1.2  /* N */
#define PRESS 2e-3 /* m */

static hap_status shake_add(app_stand *s, double hz)
{
  hap_force_id id;
  hap_force_def def;
  hap_force_def_init(&def, sizeof def);
  def.kind = HAP_FORCE_VIBRATION;
  def.strength = SHAKE;
  def.fade_in_s = 0.0;
  def.vibration.hz = hz;
  hap_status status = hap_pointer_force_add(s->session, s->hand, &def, &id);
  return bench_explain(s->bench, s->session, status);
}

/* Whole periods: hz is a whole number. */
static hap_status shake_listen(app_stand *s, double hz, app_vibration *out)
{
  double sine = 0.0;
  double cosine = 0.0;
  double mean = 0.0;
  int ticks = ticks_of(s, 1.0);
  for (int i = 0; i < ticks; ++i) {
    HAPI_TRY(stand_tick(s));
    double force = s->felt.wrench.force[2];
    sine += force * sin(2.0 * PI * hz * i / ticks) / ticks;
    cosine += force * cos(2.0 * PI * hz * i / ticks) / ticks;
    mean += force / ticks;
  }
  out->amplitude = fabs(2.0 * sqrt(sine * sine + cosine * cosine) - SHAKE) / SHAKE;
  out->mean = fabs(mean - STAND_STIFFNESS * PRESS) / SHAKE;
  return HAP_OK;
}

static hap_status shake_measure(app_stand *s, double hz, app_vibration *out)
{
  HAPI_TRY(stand_open(s));
  HAPI_TRY(stand_run(s));
  HAPI_TRY(stand_wait(s, ticks_of(s, SETTLE_S)));
  HAPI_TRY(stand_glide(s, 0.0, 0.0, -0.001 - PRESS, ticks_of(s, 0.1)));
  HAPI_TRY(stand_wait(s, ticks_of(s, SETTLE_S)));
  HAPI_TRY(shake_add(s, hz));
  return shake_listen(s, hz, out);
}

hap_status app_vibration_run(bench *b, hap_model model, double haptic_hz, double hz,
                             app_vibration *out)
{
  app_stand s;
  floor_init(b, &s, model, haptic_hz);
  hap_status status = shake_measure(&s, hz, out);
  stand_finish(&s);
  return status;
}

/* ---- texture ---- */

#define WAVE 2e-3   /* m */
#define HEIGHT 1e-4 /* m */
#define TURN (2.0 * PI / WAVE)
#define DEPTH 1e-3 /* m */
#define STROKE_S 0.2

static double wave_height(void *arg, const double point[3])
{
  (void)arg;
  return HEIGHT * sin(TURN * point[0]);
}

static hap_status texture_measure(app_stand *s, double *out_worst)
{
  hap_texture_def def;
  hap_texture_def_init(&def, sizeof def);
  def.height = wave_height;
  HAPI_TRY(stand_open(s));
  HAPI_TRY(bench_explain(s->bench, s->session,
                         hap_session_add_texture(s->session, &def, &s->says.texture)));
  HAPI_TRY(stand_run(s));
  HAPI_TRY(stand_wait(s, ticks_of(s, SETTLE_S)));
  HAPI_TRY(stand_glide(s, 0.0, 0.0, -0.001 - DEPTH, ticks_of(s, 0.1)));
  HAPI_TRY(stand_wait(s, ticks_of(s, SETTLE_S)));
  *out_worst = 0.0;
  for (int i = 0; i < ticks_of(s, STROKE_S); ++i) {
    HAPI_TRY(stand_glide(s, 0.02 / ticks_of(s, STROKE_S), 0.0, 0.0, 1));
    double load = STAND_STIFFNESS * (DEPTH + HEIGHT * sin(TURN * s->at[0]));
    double along = -load * HEIGHT * TURN * cos(TURN * s->at[0]);
    const double *felt = s->felt.wrench.force;
    double off = hypot(hypot(felt[0] - along, felt[1]), felt[2] - load) / hypot(load, along);
    *out_worst = fmax(*out_worst, off);
  }
  return HAP_OK;
}

hap_status app_texture_run(bench *b, hap_model model, double haptic_hz, double *out_worst)
{
  app_stand s;
  floor_init(b, &s, model, haptic_hz);
  hap_status status = texture_measure(&s, out_worst);
  stand_finish(&s);
  return status;
}

/* ---- taps ---- */

#define TAP_SPEED 0.2   /* m/s */
#define TAP_GAP 0.01033 /* m: the touch is between two ticks */
#define TAP_FORCE 8.0   /* N s/m */
#define TAP_DECAY 60.0
#define TAP_HZ 120.0

static hap_status tap_measure(app_stand *s, app_tap *out)
{
  int first = 0;
  int touch = 0;
  HAPI_TRY(stand_open(s));
  HAPI_TRY(stand_run(s));
  HAPI_TRY(stand_wait(s, 1));
  *out = (app_tap){0};
  for (int i = 1; i <= ticks_of(s, 0.25); ++i) {
    HAPI_TRY(stand_glide(s, 0.0, 0.0, -TAP_SPEED / s->def.haptic_hz, 1));
    double since = (STAND_RADIUS - s->at[2]) / TAP_SPEED;
    double force = s->felt.own.force[2];
    double ring = exp(-TAP_DECAY * since) * sin(2.0 * PI * TAP_HZ * since);
    double want = since > 0.0 ? TAP_FORCE * TAP_SPEED * ring : 0.0;
    touch = touch == 0 && since > 0.0 ? i : touch;
    first = first == 0 && force != 0.0 ? i : first;
    out->off = fmax(out->off, fabs(force - want) / (TAP_FORCE * TAP_SPEED));
  }
  out->late = first - touch;
  return HAP_OK;
}

hap_status app_tap_run(bench *b, hap_model model, double haptic_hz, app_tap *out)
{
  app_stand s;
  floor_init(b, &s, model, haptic_hz);
  s.at[2] = STAND_RADIUS + TAP_GAP;
  s.says.impact_force = TAP_FORCE;
  s.says.impact_decay = TAP_DECAY;
  s.says.impact_hz = TAP_HZ;
  hap_status status = tap_measure(&s, out);
  stand_finish(&s);
  return status;
}
