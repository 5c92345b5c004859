/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What long runs do to the loop's numbers: orientations stay unit, and what decays does not
 * end in denormals. With the argument "long": 1e7 ticks in place of 1e5. */

#include "tests/tap.h"

#include <float.h>

#include "haptic/haptic_internal.h"
#include "tests/physics_world.h"
#include "tests/tick_world.h"

static long ticks = 100000;

/* How far |q| was from 1 at most. */
static double worst;

static void note_length(const double q[4])
{
  double n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  double off = fabs(sqrt(n2) - 1.0);
  worst = off <= worst ? worst : off; /* also NaN */
}

static hapi_model_body *add_spinning(uint32_t slot, uint32_t flags, const double inertia[3])
{
  hapi_model_body *body = add_body(slot);
  body->flags = flags;
  body->mass = 1.0;
  for (int i = 0; i < 3; ++i) {
    body->inertia[4 * i] = inertia[i];
    body->inverse_inertia[4 * i] = 1.0 / inertia[i];
    body->response[i][i] = 1.0;
    body->response[3 + i][3 + i] = 1.0 / inertia[i];
  }
  body->linear_keep = body->angular_keep = 1.0;
  body->max_angular_speed = HUGE_VAL;
  hapi_v3_set(body->twist.angular, 6.0, 0.6, 8.0); /* 10 rad/s and a little */
  return body;
}

static void adopt_no_contacts(void)
{
  hapi_patches *patches = hapi_exchange_patches_back(f.exchange);
  patches->contact_count = patches->surface_count = 0;
  patches->model_number = f.model->number;
  hapi_tick_adopt_patches(&f.tick, patches);
}

static void check_model(hap_model model)
{
  const double ball[3] = {1.0, 1.0, 1.0};
  const double plank[3] = {0.1, 0.9, 1.0};
  set_up();
  f.tick.hashing = false;
  f.model->model = model;
  begin_model();
  uint32_t owned = model == HAP_MODEL_CONTACT ? HAPI_BODY_OWNED : 0;
  (void)add_spinning(0, owned, ball);
  (void)add_spinning(1, owned | HAPI_BODY_GYROSCOPIC, plank);
  (void)add_spinning(2, HAPI_BODY_DRIVEN, ball);
  (void)add_spinning(3, HAPI_BODY_MEASURED, ball);
  model_adopt();
  adopt_no_contacts();
  worst = 0.0;
  double fastest = 0.0;
  double slowest = HUGE_VAL;
  for (long i = 0; i < ticks; ++i) {
    ticks_run(1);
    for (int k = 0; k < 4; ++k) {
      note_length(f.bodies[k].pose.quat_wxyz);
      double spin = hapi_v3_norm(f.bodies[k].twist.angular);
      fastest = fmax(fastest, spin);
      slowest = fmin(slowest, spin);
    }
  }
  printf("# %s: %.2g after %ld ticks, spin %.4g .. %.4g rad/s\n", hap_model_name(model), worst,
         ticks, slowest, fastest);
  CHECK(worst < 1e-12);
  CHECK(f.tick.guard.latch.fault == HAP_FAULT_NONE);
  CHECK(slowest > 5.0 && fastest < 20.0); /* they did turn */
  CHECK(fabs(f.bodies[0].pose.quat_wxyz[0]) < 1.0 - 1e-9);
}

TEST(orientations_of_bodies_stay_unit)
{
  check_model(HAP_MODEL_ACCELERANCE);
  check_model(HAP_MODEL_CONTACT);
}

/* Models that show the world's poses: blended from one to the next, which are 10 rad/s x 50 ms
 * apart. */
TEST(orientations_that_are_shown_stay_unit)
{
  for (int model = HAP_MODEL_SINGLE; model <= HAP_MODEL_IMPULSE; ++model) {
    set_up();
    f.tick.hashing = false;
    worst = 0.0;
    for (long i = 0; i < ticks; i += 50) {
      f.model->model = (hap_model)model;
      f.model->blend_s = 0.05;
      begin_model();
      hapi_model_body *body = add_body(0);
      double angle = 0.25 * (double)(i / 50);
      body->pose.quat_wxyz[0] = cos(angle);
      body->pose.quat_wxyz[2] = 0.6 * sin(angle);
      body->pose.quat_wxyz[3] = 0.8 * sin(angle);
      model_adopt();
      for (int k = 0; k < 50; ++k) {
        ticks_run(1);
        note_length(f.bodies[0].pose.quat_wxyz);
      }
    }
    printf("# %s: %.2g\n", hap_model_name((hap_model)model), worst);
    CHECK(worst < 1e-12);
  }
}

/* A device that counts its turns with a quaternion that it does not normalise well. */
TEST(orientations_of_pointers_stay_unit)
{
  set_up();
  f.tick.hashing = false;
  hapi_pointer *p = add_pointer(0, 0.0, 0.0, 0.0);
  p->device.pose_world_device = (hap_pose){{1.0, 2.0, 3.0}, {0.5, -0.5, 0.5, 0.5}};
  worst = 0.0;
  for (long i = 0; i < ticks; ++i) {
    double angle = 0.005 * (double)i;
    double length = 1.0 + 1e-4 * sin((double)i);
    p->device.pose.quat_wxyz[0] = length * cos(angle);
    p->device.pose.quat_wxyz[1] = length * sin(angle);
    ticks_run(1);
    note_length(p->pose.quat_wxyz);
  }
  printf("# pointer: %.2g\n", worst);
  CHECK(worst < 1e-12 && f.tick.guard.latch.fault == HAP_FAULT_NONE);
}

/* ---- denormals ---- */

static int count_denormals(const double *values, int count)
{
  int found = 0;
  for (int i = 0; i < count; ++i) {
    found += fpclassify(values[i]) == FP_SUBNORMAL;
  }
  return found;
}

static int denormals_of(const hapi_tick *tick)
{
  int found = 0;
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *b = &tick->bodies.of[tick->bodies.live[i]];
    found += count_denormals(b->pose.position, 3) + count_denormals(b->pose.quat_wxyz, 4) +
             count_denormals(b->twist.linear, 3) + count_denormals(b->twist.angular, 3) +
             count_denormals(b->linear.residual, 6) + count_denormals(b->account.impulse, 3) +
             count_denormals(b->account.angular_impulse, 3) + count_denormals(b->account.gain, 6) +
             count_denormals(b->start_twist, 6);
  }
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    found += count_denormals(tick->touches.of[i].force, 3);
  }
  for (uint32_t i = 0; i < tick->contacts.memory_count; ++i) {
    found += count_denormals(tick->contacts.memory[i].impulse, 3);
  }
  for (uint32_t i = 0; i < tick->rows.solver.row_count; ++i) {
    found += count_denormals(&tick->rows.solver.rows[i].impulse, 1);
  }
  return found;
}

static bool cpu_flushes(void)
{
  volatile double least = DBL_MIN;
  return 0.5 * least == 0.0;
}

static bool flushed_in_step;

static void look_in_step(void *user, double step_s)
{
  (void)user;
  (void)step_s;
  flushed_in_step = flushed_in_step || cpu_flushes();
}

/* A cube near a pointer with a speed and spin that are denormal, as ODE's damping leaves them,
 * and one that is touched and then braked to a tenth of its speed in each step. The arithmetic
 * of the application's thread, which lockstep works in, is as it was. */
static void check_decay(hap_model model, bool touched)
{
  test_world *w = world_new(0.0, 20);
  w->def.model = model;
  w->before_step = look_in_step;
  dBodyID cube = world_add_cube(w, 0.1, 1.0, 0.05, 0.0, 0.0);
  double speed = touched ? 0.0 : 0.125 * DBL_MIN;
  dBodySetLinearDamping(cube, touched ? 0.9 : 0.0);
  dBodySetAngularDamping(cube, touched ? 0.9 : 0.0);
  dBodySetLinearDampingThreshold(cube, 0.0);
  dBodySetAngularDampingThreshold(cube, 0.0);
  dBodySetLinearVel(cube, speed, -speed, speed);
  dBodySetAngularVel(cube, speed, speed, -speed);
  world_start(w, 0.01, touched ? -0.008 : -0.012, 0.03, 0.02);
  CHECK(hap_session_advance(w->session, 20) == HAP_OK);
  const hapi_tick *tick = &w->session->haptic->tick;
  REQUIRE(tick->bodies.live_count == 1);
  const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[0]];
  CHECK((hapi_v3_norm(body->twist.linear) > 1e-3) == touched);
  CHECK((hapi_v3_norm(body->twist.angular) > 1e-3) == touched);
  world_move_pointer(w, 0, (const double[3]){-0.012, 0.03, 0.02}, NULL);
  int found = 0;
  for (int i = 0; i < (touched ? 25000 : 200); ++i) {
    CHECK(hap_session_advance(w->session, 1) == HAP_OK);
    found += denormals_of(tick);
  }
  CHECK(found == 0 && tick->bodies.live_count == 1 && world_stats(w).faults.count == 0);
  CHECK(hapi_v3_norm(body->twist.linear) < 1e-150 && hapi_v3_norm(body->twist.angular) < 1e-150);
  CHECK(!cpu_flushes() && !flushed_in_step);
}

TEST(nothing_in_the_loop_is_denormal)
{
#if !defined(__SSE2__)
  SKIP("denormals are left as they are on this processor");
#endif
  check_decay(HAP_MODEL_CONTACT, true);
  check_decay(HAP_MODEL_CONTACT, false);
  check_decay(HAP_MODEL_ACCELERANCE, false);
}

SET_UP
{
  ticks = strcmp(tap_argument, "long") == 0 ? 10000000 : ticks;
  return true;
}
