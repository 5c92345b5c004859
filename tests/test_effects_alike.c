/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tap.h"

#include <math.h>
#include <string.h>

#include <hapode/hapode.h>

#include "base/cycles.h"
#include "tools/rig.h"

/* What is left to the library feels as if it were on: every effect by itself and all together,
 * in scenes that call for different ones, in all models. And what is on has its time told. */

#define TICKS_MAX 900
#define FORCE_BOUND 1e-3

typedef struct hand_force {
  double at[TICKS_MAX][2][3]; /* N, of both pointers */
  double share;               /* root of the sum of squares */
} hand_force;

typedef struct scene_run {
  const char *scene;
  size_t ticks;
} scene_run;

static const scene_run scenes[] = {
    {"fig5", 300},   {"slide", 700},      {"row10:3", 700}, {"door", 900},  {"hit", 300},
    {"hinged", 500}, {"lightstand", 700}, {"grasp", 400},   {"stack", 400}, {"lever", 400}};

#define SCENES (sizeof scenes / sizeof scenes[0])

static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE,
                                   HAP_MODEL_SINGLE};

static bool effect_can(int effect, hap_effect_wish wish, hap_model model)
{
  return hap_effect_check((hap_effect)effect, wish, model, NULL) >= HAP_OK;
}

/* Cross accelerance is another model of the world, and not what auto stands for. */
static bool is_alike(int effect, hap_model model)
{
  return effect_can(effect, HAP_EFFECT_ON, model) && effect != HAP_EFFECT_CROSS;
}

static bool open_rig(const scene_run *of, hap_model model, const uint8_t effects[HAP_EFFECTS],
                     rig *out)
{
  rig_options options;
  hap_detail detail = {""};
  rig_options_init(&options);
  memset(out, 0, sizeof *out);
  options.scene = of->scene;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = model;
  options.expert.trace_rows = 4;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    expert_wish(&options.expert, (hap_effect)i, (hap_effect_wish)effects[i]);
  }
  bool good =
      rig_create(&options, out, &detail) >= HAP_OK && hap_session_start(out->session) >= HAP_OK;
  if (!good) {
    printf("# %s %s: %s\n", of->scene, hap_model_name(model), detail.text);
  }
  return good;
}

/* False: the session failed. info may be NULL. */
static bool scene_run_with(const scene_run *of, hap_model model, const uint8_t effects[HAP_EFFECTS],
                           hand_force *out, hap_effect_info info[HAP_EFFECTS])
{
  rig r;
  double sum2 = 0.0;
  bool good = open_rig(of, model, effects, &r);
  memset(out, 0, sizeof *out);
  for (size_t t = 0; t < of->ticks && good; ++t) {
    hap_trace_row row;
    size_t count = 0;
    good = hap_session_advance(r.session, 1) >= HAP_OK &&
           hap_session_trace_read(r.session, &row, 1, sizeof(hap_trace_row), &count) >= HAP_OK &&
           count == 1;
    for (size_t p = 0; good && p < r.pointer_count; ++p) {
      memcpy(out->at[t][p], row.pointers[p].force, sizeof out->at[t][p]);
      for (int k = 0; k < 3; ++k) {
        sum2 += out->at[t][p][k] * out->at[t][p][k];
      }
    }
  }
  out->share = sqrt(sum2);
  if (good && info != NULL) {
    good = hap_session_effects(r.session, info, HAP_EFFECTS, sizeof info[0]) == HAP_OK;
  }
  rig_destroy(&r);
  return good;
}

static double force_difference(const hand_force *a, const hand_force *b)
{
  const double *x = &a->at[0][0][0];
  const double *y = &b->at[0][0][0];
  double sum2 = 0.0;
  for (size_t i = 0; i < sizeof a->at / sizeof *x; ++i) {
    sum2 += (x[i] - y[i]) * (x[i] - y[i]);
  }
  return a->share > 0.0 ? sqrt(sum2) / a->share : sqrt(sum2);
}

static void check_alike(const scene_run *of, hap_model model, const hand_force *automatic,
                        const uint8_t effects[HAP_EFFECTS], const char *which)
{
  static hand_force on;
  REQUIRE(scene_run_with(of, model, effects, &on, NULL));
  double apart = force_difference(automatic, &on);
  bool alike = apart <= FORCE_BOUND;
  CHECK_SAY(alike, "%s, %s, %s on: force is %.3g %% off", of->scene, hap_model_name(model), which,
            100.0 * apart);
}

static void check_scene(const scene_run *of, hap_model model)
{
  static hand_force automatic;
  uint8_t all[HAP_EFFECTS] = {0};
  REQUIRE(scene_run_with(of, model, (uint8_t[HAP_EFFECTS]){0}, &automatic, NULL));
  CHECK(automatic.share > 0.0); /* something was touched */
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    uint8_t one[HAP_EFFECTS] = {0};
    if (is_alike(i, model)) {
      one[i] = all[i] = HAP_EFFECT_ON;
      check_alike(of, model, &automatic, one, hap_effect_name((hap_effect)i));
    }
  }
  check_alike(of, model, &automatic, all, "all");
}

TEST(auto_is_as_on_in_force)
{
  for (size_t m = 0; m < sizeof models / sizeof models[0]; ++m) {
    for (size_t i = 0; i < SCENES; ++i) {
      check_scene(&scenes[i], models[m]);
    }
  }
}

/* Else the comparison above would say nothing: each of these is felt in one scene at least when
 * it is off. */
TEST(what_is_off_is_felt)
{
  static const struct {
    hap_effect effect;
    scene_run in;
  } cases[] = {{HAP_EFFECT_CONTACTS, {"row10:3", 700}}, {HAP_EFFECT_PASSES, {"edge", 600}},
               {HAP_EFFECT_JOINTS, {"door", 900}},      {HAP_EFFECT_RANGE, {"row10:3", 700}},
               {HAP_EFFECT_FRICTION, {"grasp", 400}},   {HAP_EFFECT_SHAPE, {"roll", 500}}};
  static hand_force automatic;
  static hand_force off;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    uint8_t effects[HAP_EFFECTS] = {0};
    REQUIRE(scene_run_with(&cases[i].in, HAP_MODEL_CONTACT, effects, &automatic, NULL));
    effects[cases[i].effect] = HAP_EFFECT_OFF;
    REQUIRE(scene_run_with(&cases[i].in, HAP_MODEL_CONTACT, effects, &off, NULL));
    double apart = force_difference(&automatic, &off);
    printf("# %s off in %s: force is %.3g %% off\n", hap_effect_name(cases[i].effect),
           cases[i].in.scene, 100.0 * apart);
    CHECK(apart > FORCE_BOUND);
  }
}

/* Where docs/effects.md says that an effect has a time, it has one when it is on in a scene that
 * calls for it; of cross see test_effects. */
TEST(every_time_is_filled_in)
{
  enum {
    TICK = 1,
    PHYSICS = 2,
    PASS = 4
  };
  static const struct {
    hap_effect effect;
    hap_model model;
    unsigned where;
    scene_run in;
  } cases[] = {
      {HAP_EFFECT_TESTING, HAP_MODEL_ACCELERANCE, PHYSICS, {"slide", 400}},
      {HAP_EFFECT_TESTING, HAP_MODEL_CONTACT, PHYSICS, {"slide", 400}},
      {HAP_EFFECT_CONTACTS, HAP_MODEL_CONTACT, TICK | PHYSICS | PASS, {"row10:3", 700}},
      {HAP_EFFECT_PASSES, HAP_MODEL_CONTACT, PASS, {"row10:3", 700}},
      {HAP_EFFECT_JOINTS, HAP_MODEL_CONTACT, TICK | PHYSICS, {"door", 900}},
      {HAP_EFFECT_RANGE, HAP_MODEL_CONTACT, PHYSICS, {"row10:3", 700}},
      {HAP_EFFECT_RESTITUTION, HAP_MODEL_CONTACT, TICK, {"row10:3", 700}},
      {HAP_EFFECT_FRICTION, HAP_MODEL_CONTACT, TICK, {"grasp", 400}},
      {HAP_EFFECT_FRICTION, HAP_MODEL_ACCELERANCE, TICK, {"grasp", 400}},
      {HAP_EFFECT_TORQUE, HAP_MODEL_CONTACT, TICK, {"lever", 400}},
      {HAP_EFFECT_TORQUE, HAP_MODEL_ACCELERANCE, TICK, {"lever", 400}},
      {HAP_EFFECT_GYRO, HAP_MODEL_CONTACT, TICK, {"door", 900}},
      {HAP_EFFECT_SHAPE, HAP_MODEL_CONTACT, TICK, {"slide", 700}},
      {HAP_EFFECT_OBSERVER, HAP_MODEL_CONTACT, TICK, {"slide", 700}},
      {HAP_EFFECT_OBSERVER, HAP_MODEL_SINGLE, TICK, {"slide", 700}},
  };
  static hand_force force;
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
    hap_effect_info info[HAP_EFFECTS];
    uint8_t effects[HAP_EFFECTS] = {0};
    effects[cases[i].effect] = HAP_EFFECT_ON;
    REQUIRE(scene_run_with(&cases[i].in, cases[i].model, effects, &force, info));
    const hap_effect_info *own = &info[cases[i].effect];
    bool tick = (cases[i].where & TICK) == 0 || !HAPI_HAS_CYCLES || own->tick_us > 0.0;
    bool physics = (cases[i].where & PHYSICS) == 0 || own->physics_ms > 0.0;
    bool pass = (cases[i].where & PASS) == 0 || own->contact_us > 0.0;
    if (!(tick && physics && pass)) {
      printf("# %s, %s, %s: %g us a tick, %g ms a step, %g us a pass\n",
             hap_effect_name(cases[i].effect), cases[i].in.scene, hap_model_name(cases[i].model),
             own->tick_us, own->physics_ms, own->contact_us);
    }
    CHECK(tick && physics && pass);
  }
}
