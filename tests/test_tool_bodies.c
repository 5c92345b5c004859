/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Pointers that are hulls against bodies that move. */

#include "tests/tap.h"

#include "base/vec.h"
#include "tests/tool_world.h"

#define HALF 0.01 /* m, of the tool */
#define K 1000.0

static const hap_model all_models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                       HAP_MODEL_CONTACT};

static dBodyID add_box(tool_world *w, double mass, const double half[3], const double at[3])
{
  dMass m;
  dBodyID body = dBodyCreate(w->world);
  dGeomID geom = dCreateBox(w->space, 2.0 * half[0], 2.0 * half[1], 2.0 * half[2]);
  dMassSetBoxTotal(&m, mass, 2.0 * half[0], 2.0 * half[1], 2.0 * half[2]);
  dBodySetMass(body, &m);
  dGeomSetBody(geom, body);
  dBodySetPosition(body, at[0], at[1], at[2]);
  return body;
}

#define FRAMES 600

typedef struct motion {
  double force[FRAMES][3];
  double torque[FRAMES][3];
  double end[3];
} motion;

/* A cube of 0.5 kg on the floor is pushed along by the tool's corner beside its middle, so that it turns. */
static void push_cube(hap_model model, double physics_hz, motion *out)
{
  static const double half[3] = {0.025, 0.025, 0.025};
  static const double at[3] = {0.0, 0.0, 0.0249};
  tool_world w;
  tool_begin(&w, model);
  w.def.physics_hz = physics_hz;
  dWorldSetContactSurfaceLayer(w.world, 1e-4);
  dWorldSetQuickStepNumIterations(w.world, model == HAP_MODEL_SINGLE ? 1000 : 50);
  w.tool_def.damping = 5.0;
  tool_add_floor(&w);
  dBodyID body = add_box(&w, 0.5, half, at);
  CHECK(tool_start(&w));
  tool_go(&w, -0.037, 0.012, 0.025, 0.0);
  tool_run(&w, 30);
  for (int i = 0; i < FRAMES; ++i) {
    double s = (double)i / FRAMES;
    tool_go(&w, -0.037 + 0.03 * s * s * (3.0 - 2.0 * s), 0.012, 0.025, 0.1 * s);
    w.twist.linear[0] = 0.03 * 6.0 * s * (1.0 - s) / (FRAMES * 1e-3);
    w.twist.angular[1] = 0.1 / (FRAMES * 1e-3);
    tool_step(&w);
    hapi_v3_copy(w.state.wrench.force, out->force[i]);
    hapi_v3_copy(w.state.wrench.torque, out->torque[i]);
  }
  CHECK(hap_session_stop(w.session) == HAP_OK);
  hapi_v3_copy(dBodyGetPosition(body), out->end);
  tool_end(&w);
}

/* RMS of the difference over RMS. */
static double error_of(double (*test)[3], double (*reference)[3])
{
  double sums[2] = {0.0, 0.0};
  for (int i = 0; i < FRAMES; ++i) {
    double apart[3];
    hapi_v3_sub(test[i], reference[i], apart);
    sums[0] += hapi_v3_dot(apart, apart);
    sums[1] += hapi_v3_dot(reference[i], reference[i]);
  }
  return sqrt(sums[0] / sums[1]);
}

TEST(a_pushed_cube_feels_as_if_the_world_were_stepped_at_the_haptic_rate)
{
  static motion reference;
  static motion test;
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 2; ++i) {
    push_cube(HAP_MODEL_SINGLE, rates[i], &reference);
    push_cube(HAP_MODEL_CONTACT, rates[i], &test);
    double force = error_of(test.force, reference.force);
    double torque = error_of(test.torque, reference.torque);
    double apart[3];
    hapi_v3_sub(test.end, reference.end, apart);
    printf(
        "# %g Hz: force %.3f %%, torque %.3f %%, %.3f mm at the end; it moved to %.4f %.4f %.4f\n",
        rates[i], 100.0 * force, 100.0 * torque, 1e3 * hapi_v3_norm(apart), test.end[0],
        test.end[1], test.end[2]);
    CHECK(force < 0.03);
    CHECK(torque < 0.03);
    CHECK(hapi_v3_norm(apart) < 1e-3);
  }
}

/* Three cubes side by side under a plate: each geom has the stiffness for itself. */
TEST(several_bodies_are_felt_at_once)
{
  static const double plate[3] = {0.05, 0.01, 0.003};
  static const double middle[3] = {0.0, 0.0, 0.0};
  static const double half[3] = {0.008, 0.008, 0.01};
  for (int m = 0; m < 4; ++m) {
    tool_world w;
    tool_begin(&w, all_models[m]);
    dWorldSetContactSurfaceLayer(w.world, 1e-4);
    tool_set_box(&w, plate, middle);
    tool_add_floor(&w);
    for (int i = -1; i <= 1; ++i) {
      add_box(&w, 1.0, half, (const double[3]){0.03 * i, 0.0, 0.0099});
    }
    CHECK(tool_start(&w));
    tool_go(&w, 0.0, 0.0, 0.0199 + 0.003 + 0.004, 0.0);
    tool_run(&w, 60);
    tool_move(&w, 0.0, 0.0, 0.0199 + 0.003 - 0.001, 0.0, 100);
    tool_run(&w, 200);
    printf("# model %d: %.5f N, %u contacts\n", (int)all_models[m], w.state.wrench.force[2],
           w.state.contacts);
    CHECK(w.state.contacts == 12);
    CHECK_NEAR(w.state.wrench.force[2], 3.0 * K * 0.001, 0.02);
    CHECK_NEAR(hapi_v3_norm(w.state.wrench.torque), 0.0, 1e-3);
    tool_end(&w);
  }
}

/* What the hand gave is what the body got. */
TEST(momentum_and_spin_go_to_a_free_body)
{
  static const double half[3] = {0.02, 0.02, 0.02};
  for (int m = 0; m < 4; ++m) {
    tool_world w;
    double impulse[3] = {0.0, 0.0, 0.0};
    double turn[3] = {0.0, 0.0, 0.0};
    tool_begin(&w, all_models[m]);
    dWorldSetGravity(w.world, 0.0, 0.0, 0.0);
    dBodyID body = add_box(&w, 0.5, half, (const double[3]){0.0, 0.0, 0.0});
    CHECK(tool_start(&w));
    tool_go(&w, -0.032, 0.0, 0.015, 0.0);
    tool_run(&w, 20);
    for (int i = 0; i < 80; ++i) {
      tool_move(&w, -0.032 + 0.0002 * fmin(i, 40), 0.0, 0.015, 0.0, 1);
      const hap_wrench *f = &w.state.wrench;
      double moment[3];
      hapi_v3_madd(impulse, -1e-3, f->force, impulse);
      hapi_v3_cross(w.state.proxy.position, f->force, moment); /* the body hardly moves */
      hapi_v3_add(moment, f->torque, moment);
      hapi_v3_madd(turn, -1e-3, moment, turn);
    }
    tool_go(&w, -0.2, 0.0, 0.0, 0.0);
    tool_run(&w, 60);
    CHECK(hap_session_stop(w.session) == HAP_OK);
    dMass mass;
    dBodyGetMass(body, &mass);
    printf("# model %d: %.6f of %.6f N s, %.7f of %.7f N m s\n", (int)all_models[m],
           0.5 * dBodyGetLinearVel(body)[0], impulse[0], mass.I[5] * dBodyGetAngularVel(body)[1],
           turn[1]);
    CHECK(impulse[0] > 0.01);
    CHECK_NEAR(0.5 * dBodyGetLinearVel(body)[0], impulse[0], 1e-3 * impulse[0]);
    CHECK_NEAR(mass.I[5] * dBodyGetAngularVel(body)[1], turn[1], 0.03 * fabs(turn[1]));
    tool_end(&w);
  }
}

int main(void)
{
  dInitODE2(0);
  RUN(a_pushed_cube_feels_as_if_the_world_were_stepped_at_the_haptic_rate);
  RUN(several_bodies_are_felt_at_once);
  RUN(momentum_and_spin_go_to_a_free_body);
  dCloseODE();
  return tap_done();
}
