/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Friction of a pointer's contact in the tick alone: what sticks does not creep, what rolls does
 * not slide, anchors go over from model to model, energy. */

#include "tests/tap.h"

#include "local/pointer_friction.h"
#include "solver/contact_solver.h"
#include "tests/tick_world.h"

#define K 1000.0
#define MU 0.8
#define RADIUS 0.01

/* A body at slot 0 that the test moves, its surface through the origin across x, and a pointer. */
static hapi_pointer *surface_and_pointer(hap_model model, double finger)
{
  set_up();
  f.model->model = model;
  hapi_pointer *p = add_pointer(0, -RADIUS - 0.001, 0.0, 0.0);
  p->device.turns = true;
  p->surface.finger_radius = finger;
  begin_model();
  add_body(0)->flags = HAPI_BODY_DRIVEN;
  add_contact(0, 0, 0)->mu = MU;
  model_adopt();
  ticks_run(1);
  return p;
}

/* The same message again: what a sync brings when nothing happened. */
static void sync_again(void)
{
  hap_pose pose = f.bodies[0].pose;
  begin_model();
  hapi_model_body *body = add_body(0);
  body->flags = HAPI_BODY_DRIVEN;
  body->pose = pose;
  add_contact(0, 0, 0)->mu = MU;
  model_adopt();
}

static void turn_body(double about_x, double about_y)
{
  double spin[4] = {cos(0.5 * about_x), sin(0.5 * about_x), 0.0, 0.0};
  double tilt[4] = {cos(0.5 * about_y), 0.0, sin(0.5 * about_y), 0.0};
  hapi_quat_multiply(tilt, spin, f.bodies[0].pose.quat_wxyz);
  f.bodies[0].shown.to = f.bodies[0].pose;
}

static double value_rounded(double x, double quantum)
{
  return quantum * floor(x / quantum + 0.5);
}

/* -1 .. 1 */
static double random_noise(uint64_t *state)
{
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (double)(int64_t)*state / 9223372036854775808.0;
}

typedef struct shake {
  hap_model model;
  double finger;
  double tilt; /* rad */
  double spin; /* rad in all */
} shake;

static void pointer_put(hapi_pointer *p, double x, double y, double z)
{
  hapi_v3_set(p->device.pose.position, x, y, z);
}

/* m, by which the point that sticks has crept after a million ticks. */
static double creep_of(const shake *how)
{
  const int ticks = 1000000;
  uint64_t state = 7;
  hapi_pointer *p = surface_and_pointer(how->model, how->finger);
  pointer_put(p, -RADIUS + 0.002, 0.0, 0.0);
  ticks_run(30);
  pointer_put(p, -RADIUS + 0.002, 2e-4, -1e-4);
  ticks_run(2);
  double before[3];
  hapi_v3_copy(p->wrench.force, before);
  for (int i = 0; i < ticks; ++i) {
    double share = (double)i / ticks;
    double swing = sin(2.0 * M_PI * 1000.0 * share);
    turn_body(how->spin * share, how->tilt * swing);
    pointer_put(p, value_rounded(-RADIUS + 0.002 + 1e-5 * random_noise(&state), 3e-5),
                value_rounded(2e-4 + 2e-5 * random_noise(&state), 3e-5),
                value_rounded(-1e-4 + 2e-5 * random_noise(&state), 3e-5));
    if (i % 16 == 0) {
      sync_again();
    }
    ticks_run(1);
  }
  turn_body(0.0, 0.0);
  pointer_put(p, -RADIUS + 0.002, 2e-4, -1e-4);
  ticks_run(2);
  CHECK(hapi_v3_norm(before) > 2.0);
  hapi_v3_sub(p->wrench.force, before, before);
  return hapi_v3_norm(before) / K;
}

TEST(what_sticks_does_not_creep_in_a_million_ticks)
{
  static const shake all[] = {
      {HAP_MODEL_SINGLE, 0.0, 0.02, 0.0},          {HAP_MODEL_CONTACT, 0.0, 0.02, 0.0},
      {HAP_MODEL_CONTACT, 0.005, 0.02, 0.0},       {HAP_MODEL_CONTACT, 0.0, 0.0, 200.0 * M_PI},
      {HAP_MODEL_SINGLE, 0.0, 0.02, 200.0 * M_PI}, {HAP_MODEL_CONTACT, 0.0, 0.3, 0.0},
      {HAP_MODEL_CONTACT, 0.005, 0.3, 0.0},
  };
  for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
    double creep = creep_of(&all[i]);
    printf("# tilt %g, spin %g: %g um\n", all[i].tilt, all[i].spin, 1e6 * creep);
    CHECK(creep < (all[i].tilt < 0.05 ? 1e-10 : 2e-4)); /* rolls 2 mm to and fro, 1000 times */
  }
}

/* The body turns about the place where it touches the pointer, which rests: as it goes round the
 * ball by 0.6 rad, the contact moves by 5 mm on both. */
TEST(what_rolls_does_not_slide)
{
  static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_CONTACT};
  for (int m = 0; m < 2; ++m) {
    hapi_pointer *p = surface_and_pointer(models[m], 0.0);
    const double step[4] = {cos(5e-4), 0.0, sin(5e-4), 0.0};
    double normal[3] = {-1.0, 0.0, 0.0};
    pointer_put(p, -RADIUS + 0.002, 0.0, 0.0);
    ticks_run(30);
    for (int i = 0; i < 600; ++i) {
      static const double out[3] = {-1.0, 0.0, 0.0};
      hap_pose *pose = &f.bodies[0].pose;
      double foot[3];
      double apart[3];
      hapi_v3_sub(p->pose.position, pose->position, apart);
      hapi_v3_madd(p->pose.position, -hapi_v3_dot(normal, apart), normal, foot);
      hapi_v3_sub(pose->position, foot, apart);
      hapi_quat_rotate(step, apart, apart);
      hapi_v3_add(foot, apart, pose->position);
      hapi_quat_multiply(step, pose->quat_wxyz, pose->quat_wxyz);
      f.bodies[0].shown.to = *pose;
      hapi_quat_rotate(pose->quat_wxyz, out, normal);
      ticks_run(1);
    }
    double along = hapi_v3_dot(p->wrench.force, normal);
    hapi_v3_madd(p->wrench.force, -along, normal, normal);
    CHECK_NEAR(along, 2.0, 1e-2);
    CHECK(hapi_v3_norm(normal) < 2e-3); /* N; of 1.6 that hold */
  }
}

/* Of a stretch that is rounding alone, and may be along the normal, too. */
TEST(axes_of_friction_have_length_one)
{
  static const double stretches[][4] = {{0.0, 0.0, 0.0, 0.0},     {3e-19, -2e-18, 1e-19, 0.0},
                                        {0.0, 0.0, 2e-18, 0.0},   {1e-200, 0.0, 0.0, 0.0},
                                        {1e-18, 0.0, 0.0, 1e-18}, {1e-4, 0.0, 0.0, 1e-4}};
  for (size_t i = 0; i < sizeof stretches / sizeof stretches[0]; ++i) {
    hapi_friction friction = {.stiffness = K, .normal = {0.0, 0.0, 1.0}};
    memcpy(friction.stretch, stretches[i], sizeof friction.stretch);
    hapi_friction_aim(&friction, 0.0, NULL);
    for (int k = 0; k < 3; ++k) {
      for (int other = 0; other < 3; ++other) {
        double sum = 0.0;
        for (int j = 0; j < 4; ++j) {
          sum += friction.axes[k][j] * friction.axes[other][j];
        }
        CHECK_NEAR(sum, k == other ? 1.0 : 0.0, 1e-12);
      }
    }
  }
}

/* What one row's impulse does to another is what that one's does to it: else they make energy. */
TEST(all_rows_of_a_measured_body_answer_by_one_matrix)
{
  set_up();
  f.model->model = HAP_MODEL_CONTACT;
  hapi_pointer *p = add_pointer(0, -RADIUS + 0.001, 0.0, 0.0);
  p->device.turns = true;
  p->surface.finger_radius = 0.005;
  begin_model();
  hapi_model_body *body = add_body(0);
  body->flags = HAPI_BODY_MEASURED | HAPI_BODY_WHOLE;
  body->pose.position[1] = 0.03; /* an arm */
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      body->response[i][k] =
          (i == k ? 2.0 : 0.1 / (1.0 + i + k)) * (i < 3 ? 1.0 : 30.0) * (k < 3 ? 1.0 : 30.0);
    }
  }
  add_contact(0, 0, 0)->mu = MU; /* whose own probes say something else */
  model_adopt();
  ticks_run(1);
  for (int i = 0; i < 20; ++i) {
    pointer_put(p, -RADIUS + 0.001, 1e-5 * i, -2e-5 * i);
    ticks_run(1);
  }
  const hapi_solver *solver = &f.tick.rows.solver;
  CHECK(solver->row_count == 4);
  for (uint32_t i = 0; i < solver->row_count; ++i) {
    for (uint32_t k = 0; k < i; ++k) {
      double there = hapi_dot6(solver->rows[i].ja, solver->rows[k].ba);
      double back = hapi_dot6(solver->rows[k].ja, solver->rows[i].ba);
      CHECK_NEAR(there, back, 1e-12 * (fabs(there) + fabs(back) + 1.0));
    }
  }
}
