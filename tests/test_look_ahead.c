/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hap_expert_def.look_ahead: a loop whose messages are late by a round trip feels the same force as
 * one beside its world. The reference is ODE alone at 1 kHz with 1000 iterations. */

#include "tests/tap.h"

#include "bench/accuracy.h"
#include "tests/held_messages.h"

#define LATE_S 1.0    /* the hand begins to move so long after the start */
#define MARGIN_S 0.05 /* of looking ahead, beyond the round trip */
#define ITERATIONS 1000

typedef struct far_run {
  const char *scene;
  double delay_s;
  double look_ahead_s;
  held_messages held;
} far_run;

static hap_status far_join(void *user, hap_session *session)
{
  far_run *run = user;
  return held_begin(&run->held, session, run->delay_s);
}

static const accuracy_scene *scene_named(const char *name)
{
  const accuracy_scene *which = NULL;
  for (size_t i = 0; (which = accuracy_scene_at(i)) != NULL && strcmp(which->name, name) != 0;
       ++i) {
  }
  return which;
}

static char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];

/* model SINGLE: beside its world, whatever the delay. */
static void scene_run(bench *b, far_run *run, hap_model model, accuracy_motion *out)
{
  accuracy_run_def def;
  const accuracy_scene *which = scene_named(run->scene);
  REQUIRE(which != NULL);
  scene_parameters parameters = accuracy_parameters(which);
  accuracy_run_def_init(&def);
  parameters.shift[0] = -1e-6;
  parameters.shift[1] = 5e-8;
  def.parameters = &parameters;
  def.seconds = accuracy_seconds(which, true) + LATE_S;
  for (int i = 0; i < parameters.pointers; ++i) {
    REQUIRE(accuracy_hand(parameters.hands[i], 1.0, hands[i], sizeof hands[i] - 16));
    size_t length = strlen(hands[i]);
    (void)snprintf(hands[i] + length, sizeof hands[i] - length, ",start=%g", -LATE_S);
    def.hands[i] = hands[i];
  }
  def.session.model = model;
  def.session.physics_hz = 60.0;
  def.session.max_bodies = 64;
  def.session.max_contacts = 1024;
  if (model == HAP_MODEL_SINGLE) {
    def.iterations = ITERATIONS;
  } else {
    def.expert.look_ahead = run->look_ahead_s;
    def.join = run->delay_s >= 0.0 ? far_join : NULL;
    def.join_user = run;
  }
  hap_status status = accuracy_run(b, &def, out);
  if (status < HAP_OK) {
    printf("# %s\n", b->detail.text);
  }
  held_end(&run->held);
  run->held = (held_messages){0};
  REQUIRE(status >= HAP_OK);
}

static double force_error(bench *b, far_run *run, const accuracy_motion *reference)
{
  accuracy_motion motion;
  accuracy_errors errors;
  scene_run(b, run, HAP_MODEL_CONTACT, &motion);
  CHECK(accuracy_compare(reference, &motion, NULL, 60.0, &errors));
  printf("# %s, %g ms each way, looking ahead %g s: %.2f %%, momentum 1 %+.1e, dropped %llu\n",
         run->scene, 1e3 * run->delay_s, run->look_ahead_s, 100.0 * errors.force,
         motion.stats.hand.momentum_ratio - 1.0, (unsigned long long)motion.stats.ahead.dropped);
  accuracy_motion_free(&motion);
  return errors.force;
}

typedef struct far_case {
  const char *name;
  const char *scene;
  double delay_s;
  double without_least; /* error without looking ahead, at least */
} far_case;

static const far_case cases[] = {
    {"hit", "hit", 0.05, 0.3},
    {"door", "door", 0.1, 0.5},
    {"slide", "slide", 0.2, 0.3},
};

TEST_EACH(cases, const far_case *row)
{
  bench b = {.quick = true};
  accuracy_motion reference;
  far_run run = {.scene = row->scene, .delay_s = -1.0};
  scene_run(&b, &run, HAP_MODEL_SINGLE, &reference);
  double beside = force_error(&b, &run, &reference);
  run.delay_s = row->delay_s;
  double without = force_error(&b, &run, &reference);
  run.look_ahead_s = 2.0 * row->delay_s + MARGIN_S;
  double with = force_error(&b, &run, &reference);
  CHECK(with <= beside + 0.002);
  CHECK(without >= row->without_least);
  accuracy_motion_free(&reference);
}
