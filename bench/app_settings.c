/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/app_settings.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "bench/app_stand.h"

#define DEEP 2e-3 /* m */
#define SETTLE 60 /* ticks: beyond every ramp */
#define LOOK 300
#define BASE_SPEED 2.0 /* m/s */
#define FRAME_TICKS 11

static const struct {
  const char *word;
  hap_pointer_settings to; /* mask, and what it names */
} settings[] = {
    {"stiffness", {.mask = HAP_SET_STIFFNESS, .stiffness = 3.0 * STAND_STIFFNESS}},
    {"damping", {.mask = HAP_SET_DAMPING, .damping = 10.0}},
    {"friction", {.mask = HAP_SET_FRICTION, .friction = 0.5, .finger_radius = 0.005}},
    {"motion-scale", {.mask = HAP_SET_MOTION_SCALE, .motion_scale = 3.0}},
    {"force-scale", {.mask = HAP_SET_FORCE_SCALE, .force_scale = 4.0}},
    {"limits", {.mask = HAP_SET_LIMITS, .max_force = 0.5, .max_torque = 1.0}},
    {"radius", {.mask = HAP_SET_SHAPE, .radius = STAND_RADIUS + 0.003}},
    {"collide-bits", {.mask = HAP_SET_COLLIDE_BITS, .collide_bits = 1}},
    {"proxy",
     {.mask = HAP_SET_COUPLING,
      .coupling = HAP_COUPLING_PROXY,
      .coupling_stiffness = STAND_STIFFNESS}},
    {"god-object",
     {.mask = HAP_SET_COUPLING,
      .coupling = HAP_COUPLING_GOD_OBJECT,
      .coupling_stiffness = STAND_STIFFNESS}},
    {"base",
     {.mask = HAP_SET_BASE, .pose_world_device = {{0.0, 0.0, -0.003}, {1.0, 0.0, 0.0, 0.0}}}},
};

size_t app_setting_count(void)
{
  return BENCH_COUNT(settings);
}

const char *app_setting_word(size_t i)
{
  return settings[i].word;
}

/* A floor of bits 2, and a hand that stands in it, or 0.1 m above it. */
static hap_status floor_stand(app_stand *s, bool deep)
{
  dGeomID floor = dCreatePlane(s->space, 0.0, 0.0, 1.0, 0.0);
  dGeomSetCategoryBits(floor, 2u);
  s->hand_def.max_force = APP_LIMIT;
  s->at[2] = STAND_RADIUS + (deep ? 0.001 : 0.1);
  HAPI_TRY(stand_open(s));
  HAPI_TRY(stand_run(s));
  HAPI_TRY(stand_wait(s, SETTLE));
  HAPI_TRY(stand_glide(s, 0.0, 0.0, deep ? -0.001 - DEEP : 0.0, 100));
  return stand_wait(s, SETTLE);
}

static hap_status hand_set(app_stand *s, const hap_pointer_settings *to)
{
  hap_pointer_settings all = *to;
  hap_pointer_settings_init(&all, sizeof all);
  uint32_t size = all.size;
  uint32_t cookie = all.cookie;
  all = *to;
  all.size = size;
  all.cookie = cookie;
  return hap_pointer_set(s->session, s->hand, &all);
}

static double force_apart(const double a[3], const double b[3])
{
  return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* A tick, and by how much its force at the device is off the last one's. */
static hap_status step_look(app_stand *s, double *io_most)
{
  double before[3];
  memcpy(before, s->written, sizeof before);
  HAPI_TRY(stand_wait(s, 1));
  *io_most = fmax(*io_most, force_apart(s->written, before));
  return HAP_OK;
}

static hap_status setting_measure(app_stand *s, size_t i, double *out_step)
{
  *out_step = 0.0;
  HAPI_TRY(stand_device(s));
  HAPI_TRY(floor_stand(s, true));
  HAPI_TRY(hand_set(s, &settings[i].to));
  for (int k = 0; k < LOOK; ++k) {
    HAPI_TRY(step_look(s, out_step));
  }
  return HAP_OK;
}

hap_status app_setting_run(bench *b, hap_model model, size_t i, double *out_step)
{
  app_stand s;
  stand_init(b, &s, 0.0);
  s.def.model = model;
  hap_status status = setting_measure(&s, i, out_step);
  stand_finish(&s);
  return status;
}

static hap_status same_measure(app_stand *s, double *out_step)
{
  *out_step = 0.0;
  HAPI_TRY(stand_device(s));
  HAPI_TRY(floor_stand(s, true));
  for (int k = 0; k < 100; ++k) {
    hap_pointer_settings all;
    hap_pointer_settings_init(&all, sizeof all);
    HAPI_TRY(hap_pointer_settings_get(s->session, s->hand, &all));
    HAPI_TRY(hap_pointer_set(s->session, s->hand, &all));
    HAPI_TRY(step_look(s, out_step));
  }
  return HAP_OK;
}

hap_status app_same_run(bench *b, hap_model model, double *out_step)
{
  app_stand s;
  stand_init(b, &s, 0.0);
  s.def.model = model;
  hap_status status = same_measure(&s, out_step);
  stand_finish(&s);
  return status;
}

static hap_status base_measure(app_stand *s, bool deep, double *out_force)
{
  hap_pointer_settings base = {.mask = HAP_SET_BASE,
                               .pose_world_device = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}},
                               .twist_world_device = {{BASE_SPEED, 0.0, 0.0}, {0.0, 0.0, 0.0}}};
  *out_force = 0.0;
  HAPI_TRY(floor_stand(s, deep));
  const double rest[3] = {s->felt.wrench.force[0], s->felt.wrench.force[1],
                          s->felt.wrench.force[2]};
  for (int frame = 0; frame < 40; ++frame) {
    base.pose_world_device.position[0] = BASE_SPEED * 1e-3 * FRAME_TICKS * frame;
    HAPI_TRY(hand_set(s, &base));
    for (int i = 0; i < FRAME_TICKS; ++i) {
      HAPI_TRY(stand_wait(s, 1));
      *out_force = fmax(*out_force, force_apart(s->felt.wrench.force, rest));
    }
  }
  return HAP_OK;
}

hap_status app_base_run(bench *b, hap_model model, hap_coupling coupling, bool deep,
                        double *out_force)
{
  app_stand s;
  stand_init(b, &s, 0.0);
  s.def.model = model;
  s.hand_expert.coupling = coupling;
  s.hand_expert.coupling_stiffness = 1000.0;
  s.hand_expert.coupling_damping = 2.0;
  hap_status status = base_measure(&s, deep, out_force);
  stand_finish(&s);
  return status;
}
