/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Surfaces of geoms against a pointer, as an application says them: by the public headers, against
 * closed forms. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "tests/surface_world.h"

/* ---- stiffness and damping ---- */

TEST(what_is_left_as_it_came_is_the_pointer_s_own)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    told.other = cw_add_floor(w);
    w->hand_def.damping = 3.0;
    w->hand_def.friction = 0.4;
    floor_start(w);
    hand_press(w, 0.002);
    CHECK(told.came.size == sizeof told.came && told.came.touchable == 1);
    CHECK(told.came.stiffness == STIFFNESS && told.came.damping == 3.0);
    CHECK(told.came.friction_static == 0.4 && told.came.friction_dynamic == 0.4);
    CHECK_NEAR(w->force[2], STIFFNESS * 0.002, 1e-6);
  }
}

TEST(a_surface_has_its_stiffness)
{
  static const double stiffness[] = {150.0, 4000.0};
  for (size_t m = 0; m < 2 * MODELS; ++m) {
    contact_world *w = floor_new(all_models[m / 2]);
    cw_add_floor(w);
    told.says.stiffness = stiffness[m % 2];
    floor_start(w);
    hand_press(w, 0.002);
    CHECK_NEAR(w->force[2], stiffness[m % 2] * 0.002, 1e-6);
  }
}

/* Pressed in at 20 mm/s. */
TEST(a_surface_has_its_damping)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    cw_add_floor(w);
    told.says.damping = 7.0;
    floor_start(w);
    hand_press(w, 0.002);
    double at_rest = w->force[2];
    cw_go(w, 0.0, 0.0, -0.02, 20);
    CHECK_NEAR(w->force[2] - STIFFNESS * (RADIUS - w->hand_at[2]), 7.0 * 0.02, 1e-3);
    CHECK_NEAR(at_rest, STIFFNESS * 0.002, 1e-6);
  }
}

/* The hand feels the contact and the coupling behind it, one after the other. */
TEST(a_proxy_feels_it_through_its_spring)
{
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  cw_add_floor(w);
  w->hand_expert.coupling = HAP_COUPLING_PROXY;
  w->hand_expert.coupling_stiffness = 800.0;
  told.says.stiffness = 400.0;
  floor_start(w);
  hand_press(w, 0.003);
  cw_go(w, 0.0, 0.0, 0.0, 300);
  CHECK_NEAR(w->force[2], 0.003 / (1.0 / 800.0 + 1.0 / 400.0), 5e-3);
}

TEST(the_points_of_a_hull_share_it)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double corners[8 * 3];
    contact_world *w = floor_new(all_models[m]);
    cw_add_floor(w);
    hand_be_cube(w, corners);
    told.says.stiffness = 300.0;
    floor_start(w);
    hand_press(w, 0.002);
    CHECK_NEAR(w->force[2], 300.0 * 0.002, 1e-6);
  }
}

/* Half of the hand's way is on the one, half on the other. */
TEST(each_geom_has_its_own)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    told.other = dCreateBox(w->space, 0.2, 0.2, 0.2);
    dGeomSetPosition(told.other, -0.1, 0.0, -0.1);
    dGeomSetPosition(dCreateBox(w->space, 0.2, 0.2, 0.2), 0.1, 0.0, -0.1);
    told.says.stiffness = 3000.0;
    cw_start(w, -0.03, 0.0, RADIUS + 0.001);
    cw_run(w, 30);
    hand_press(w, 0.001);
    CHECK_NEAR(w->force[2], 1.0, 1e-3);
    cw_go(w, 0.6, 0.0, 0.0, 100);
    cw_go(w, 0.0, 0.0, 0.0, 60);
    CHECK_NEAR(w->force[2], 3.0, 1e-3);
  }
}

/* ---- touchable ---- */

TEST(what_is_not_touchable_is_not_felt)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dGeomID ground = cw_add_floor(w);
    told.says.touchable = 0;
    floor_start(w);
    hand_press(w, 0.002);
    CHECK(cw_norm(w->force) == 0.0 && told.calls > 0);
    told.says.touchable = 1; /* now that the hand is in it, it comes in slowly */
    surface_change(w, ground);
    double before = 0.0;
    for (int i = 0; i < 100; ++i) {
      cw_tick(w);
      CHECK(w->force[2] - before <= 0.2);
      before = w->force[2];
    }
    CHECK_NEAR(w->force[2], STIFFNESS * 0.002, 1e-6);
    told.says.touchable = 0;
    surface_change(w, ground);
    cw_run(w, 30);
    CHECK(cw_norm(w->force) == 0.0);
  }
}

TEST(a_hull_goes_through_what_is_not_touchable)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double corners[8 * 3];
    contact_world *w = floor_new(all_models[m]);
    cw_add_floor(w);
    hand_be_cube(w, corners);
    told.says.touchable = 0;
    floor_start(w);
    hand_press(w, 0.002);
    CHECK(cw_norm(w->force) == 0.0);
  }
}

TEST(a_geom_without_bits_is_not_felt)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dGeomID ground = cw_add_floor(w);
    dGeomSetCategoryBits(ground, 0);
    dGeomSetCollideBits(ground, 0);
    floor_start(w);
    hand_press(w, 0.002);
    CHECK(cw_norm(w->force) == 0.0 && told.calls == 0);
  }
}

/* ---- when it is asked ---- */

TEST(it_is_asked_once_and_again_after_a_change)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dGeomID ground = cw_add_floor(w);
    floor_start(w);
    hand_press(w, 0.002);
    CHECK(told.calls == 1);
    surface_change(w, NULL);
    cw_run(w, 100);
    CHECK(told.calls == 2);
    surface_change(w, ground);
    cw_run(w, 100);
    CHECK(told.calls == 3);
    cw_go(w, 0.0, 0.0, 1.0, 200); /* away, and back */
    cw_go(w, 0.0, 0.0, 0.0, 100);
    cw_go(w, 0.0, 0.0, -1.0, 200);
    CHECK(told.calls == 4);
    hap_pointer_id other;
    CHECK(hap_pointer_remove(w->session, w->hand) == HAP_OK);
    CHECK(hap_pointer_add(w->session, &w->hand_def, &other) == HAP_OK);
    w->hand = other;
    cw_go(w, 0.0, 0.0, 0.0, 100);
    CHECK(told.calls == 5);
  }
}

/* A geom that comes to the address of another one is another one. */
TEST(a_geom_that_is_new_is_asked_about)
{
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  dGeomID first = cw_add_floor(w);
  floor_start(w);
  for (int i = 0; i < 20; ++i) {
    int calls = told.calls;
    CHECK(hap_session_lock(w->session) == HAP_OK);
    CHECK(hap_session_forget_geom(w->session, first) == HAP_OK);
    dGeomDestroy(first);
    first = cw_add_floor(w);
    hap_session_unlock(w->session);
    cw_run(w, 30);
    CHECK(told.calls == calls + 1);
  }
}

TEST(a_change_of_stiffness_comes_in_slowly)
{
  static const double after[] = {4000.0, 250.0, STIFFNESS};
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dGeomID ground = cw_add_floor(w);
    floor_start(w);
    hand_press(w, 0.002);
    for (size_t i = 0; i < sizeof after / sizeof after[0]; ++i) {
      double before = w->force[2];
      double most = fmax(before, after[i] * 0.002) / 20.0; /* 20 ticks of 20 ms */
      told.says.stiffness = after[i];
      surface_change(w, ground);
      for (int k = 0; k < 100; ++k) {
        cw_tick(w);
        CHECK(fabs(w->force[2] - before) <= 1.001 * most);
        before = w->force[2];
      }
      CHECK_NEAR(w->force[2], after[i] * 0.002, 1e-6);
    }
  }
}

/* Without a load there is nothing that could leap. */
TEST(a_change_of_stiffness_in_the_air_is_there_at_once)
{
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  dGeomID ground = cw_add_floor(w);
  floor_start(w);
  told.says.stiffness = 300.0;
  surface_change(w, ground);
  cw_run(w, 20);
  cw_go(w, 0.0, 0.0, -0.3, 10);
  CHECK_NEAR(w->force[2], 300.0 * (RADIUS - w->hand_at[2]), 1e-6);
}

/* ---- friction ---- */

/* Drawn along x, most is the largest force along x, last the one of sliding. */
static void hand_draw(contact_world *w, double speed, int ticks, double *out_most)
{
  *out_most = 0.0;
  cw_move_hand(w, speed, 0.0, 0.0);
  for (int i = 0; i < ticks; ++i) {
    cw_tick(w);
    *out_most = fmax(*out_most, fabs(w->force[0]));
  }
}

TEST(what_sticks_holds_more_than_what_slides)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double most;
    contact_world *w = floor_new(all_models[m]);
    cw_add_floor(w);
    told.says.friction_static = 0.6;
    told.says.friction_dynamic = 0.2;
    floor_start(w);
    hand_press(w, 0.004);
    double load = w->force[2];
    CHECK_NEAR(load, STIFFNESS * 0.004, 1e-6);
    hand_draw(w, 0.01, 400, &most); /* 10 um a tick: 0.01 N */
    CHECK(most > 0.6 * load - 0.02 && most <= 0.6 * load + 1e-9);
    CHECK_NEAR(w->force[0], -0.2 * load, 1e-3 * load);
    hand_draw(w, 0.01, 200, &most); /* it slides on */
    CHECK_NEAR(most, 0.2 * load, 1e-3 * load);
    cw_go(w, 0.0, 0.0, 0.0, 20); /* stands, and sticks again */
    hand_draw(w, 0.01, 400, &most);
    CHECK(most > 0.6 * load - 0.02 && most <= 0.6 * load + 1e-9);
    hand_draw(w, -0.01, 800, &most);
    CHECK(most > 0.6 * load - 0.02 && most <= 0.6 * load + 1e-9);
  }
}

TEST(less_static_than_dynamic_friction_is_the_dynamic_one)
{
  double most;
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  cw_add_floor(w);
  told.says.friction_static = 0.1;
  told.says.friction_dynamic = 0.5;
  floor_start(w);
  hand_press(w, 0.002);
  hand_draw(w, 0.05, 200, &most);
  CHECK_NEAR(most, 0.5 * w->force[2], 1e-3);
  CHECK_NEAR(w->force[0], -0.5 * w->force[2], 1e-3);
}

TEST(a_face_holds_more_while_it_sticks)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double corners[8 * 3];
    double most;
    contact_world *w = floor_new(all_models[m]);
    cw_add_floor(w);
    hand_be_cube(w, corners);
    told.says.friction_static = 0.6;
    told.says.friction_dynamic = 0.2;
    floor_start(w);
    hand_press(w, 0.004);
    hand_draw(w, 0.01, 400, &most);
    CHECK(most > 0.6 * w->force[2] - 0.04 && most <= 0.6 * w->force[2] + 1e-9);
    CHECK_NEAR(w->force[0], -0.2 * w->force[2], 2e-3 * w->force[2]);
  }
}

/* ---- texture ---- */

#define WAVE 2e-3   /* m */
#define HEIGHT 1e-4 /* m */
#define TURN (2.0 * 3.14159265358979323846 / WAVE)

static double wave_height(void *arg, const double point[3])
{
  (void)arg;
  return HEIGHT * sin(TURN * point[0]);
}

static double wave_slope(double x)
{
  return HEIGHT * TURN * cos(TURN * x);
}

static hap_texture_def wave_def(void)
{
  hap_texture_def def;
  hap_texture_def_init(&def, sizeof def);
  def.height = wave_height;
  return def;
}

/* Over a floor with the wave, whose hand is 20 mm above it. */
static contact_world *wave_floor(hap_model model, double haptic_hz, double x)
{
  contact_world *w = floor_new(model);
  cw_add_floor(w);
  w->def.haptic_hz = haptic_hz;
  cw_start(w, x, 0.0, RADIUS + 0.02);
  hap_texture_def def = wave_def();
  texture_use(w, &def);
  return w;
}

typedef struct texture_row {
  const char *name;
  double rate;
  double speed; /* m/s */
} texture_row;

static const texture_row strokes[] = {
    {"each_force_is_that_of_the_height_at_1_khz", 1e3, 0.03},
    {"each_force_is_that_of_the_height_at_5_khz", 5e3, 0.2},
    {"each_force_is_that_of_the_height_at_10_khz", 1e4, 0.5},
};

/* k (g + h) (n - grad h), tick by tick. */
TEST_EACH(strokes, const texture_row *row)
{
  const double depth = 0.001;
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = wave_floor(all_models[m], row->rate, 0.0);
    int second = (int)row->rate;
    cw_go(w, 0.0, 0.0, -(0.02 + depth) / 0.5, second / 2);
    cw_go(w, row->speed, 0.0, 0.0, second / 10);
    double worst = 0.0;
    for (int i = 0; i < second / 10; ++i) {
      cw_tick(w);
      double load = STIFFNESS * (depth + HEIGHT * sin(TURN * w->hand_at[0]));
      worst = fmax(worst, fabs(w->force[2] - load));
      worst = fmax(worst, fabs(w->force[0] + load * wave_slope(w->hand_at[0])));
    }
    CHECK(worst < 1e-3 * STIFFNESS * depth);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

/* The same wave in samples, 40 a period, along y of a box that stands turned. */
TEST(a_patch_of_samples_lies_on_its_geom)
{
  double heights[40];
  for (int i = 0; i < 40; ++i) {
    heights[i] = HEIGHT * sin(TURN * i * WAVE / 40.0);
  }
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dMatrix3 quarter;
    dRFromAxisAndAngle(quarter, 0.0, 0.0, 1.0, -0.5 * 3.14159265358979323846);
    dGeomID tile = dCreateBox(w->space, 0.2, 0.2, 0.02);
    dGeomSetPosition(tile, 0.0, 0.003, -0.01);
    dGeomSetRotation(tile, quarter);
    cw_start(w, 0.0, 0.0, RADIUS + 0.02);
    hap_texture_def def;
    hap_texture_def_init(&def, sizeof def);
    def.heights = heights;
    def.columns = 1;
    def.rows = 40;
    def.pitch = WAVE / 40.0;
    texture_use(w, &def);
    cw_go(w, 0.0, 0.0, -0.042, 500);
    cw_go(w, 0.03, 0.0, 0.0, 100);
    double worst = 0.0;
    for (int i = 0; i < 200; ++i) { /* y of the box is x of the world, from the box's middle */
      cw_tick(w);
      double load = STIFFNESS * (0.001 + HEIGHT * sin(TURN * w->hand_at[0]));
      worst = fmax(worst, fabs(w->force[2] - load));
      worst = fmax(worst, fabs(w->force[0] + load * wave_slope(w->hand_at[0])));
    }
    CHECK(worst < 5e-3 * STIFFNESS * 0.001);
    CHECK_NEAR(w->force[1], 0.0, 1e-9);
  }
}

/* A path in which the hand presses deep on the way up the wave and lightly on the way down. */
static double round_work(contact_world *w)
{
  double work = 0.0;
  const double ways[4][3] = {
      {0.0, 0.0, -1e-3}, {0.25 * WAVE, 0.0, 0.0}, {0.0, 0.0, 1e-3}, {-0.25 * WAVE, 0.0, 0.0}};
  for (int leg = 0; leg < 4; ++leg) {
    cw_move_hand(w, ways[leg][0] / 0.1, ways[leg][1] / 0.1, ways[leg][2] / 0.1);
    for (int i = 0; i < 1000; ++i) {
      double before[3];
      memcpy(before, w->force, sizeof before);
      cw_tick(w);
      for (int k = 0; k < 3; ++k) {
        work += 0.5 * (before[k] + w->force[k]) * w->hand_velocity[k] * 1e-4;
      }
    }
  }
  return work;
}

TEST(no_round_over_a_texture_gives_energy)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = wave_floor(all_models[m], 1e4, -0.125 * WAVE);
    cw_go(w, 0.0, 0.0, -0.0205 / 0.1, 1000);
    double stored = 0.5 * STIFFNESS * 1.6e-3 * 1.6e-3;
    for (int round = 0; round < 3; ++round) {
      CHECK_NEAR(round_work(w), 0.0, 2e-4 * stored);
    }
  }
}

TEST(the_energy_observer_lets_a_texture_be)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    cw_add_floor(w);
    w->research.guard = HAP_GUARD_ON;
    told.says.friction_static = told.says.friction_dynamic = 0.3;
    cw_start(w, 0.0, 0.0, RADIUS + 0.02);
    hap_texture_def def = wave_def();
    texture_use(w, &def);
    cw_go(w, 0.0, 0.0, -0.042, 500);
    for (int round = 0; round < 8; ++round) {
      cw_go(w, round % 2 == 0 ? 0.1 : -0.1, 0.02, 0.0, 150);
      cw_go(w, round % 2 == 0 ? 0.1 : -0.1, -0.02, round % 2 == 0 ? 0.01 : -0.01, 50);
    }
    hap_stats stats = cw_stats(w);
    CHECK(stats.faults.energy_ticks == 0 && stats.faults.fault == HAP_FAULT_NONE);
  }
}

TEST(a_texture_that_comes_under_a_load_does_not_leap)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dGeomID ground = cw_add_floor(w);
    cw_start(w, 0.25 * WAVE, 0.0, RADIUS + 0.001);
    cw_run(w, 30);
    hand_press(w, 0.002);
    hap_texture_def def = wave_def();
    texture_use(w, &def);
    surface_change(w, ground);
    double before = w->force[2];
    for (int i = 0; i < 100; ++i) {
      cw_tick(w);
      CHECK(fabs(w->force[2] - before) <= 1.001 * STIFFNESS * HEIGHT / 20.0);
      before = w->force[2];
    }
    CHECK_NEAR(w->force[2], STIFFNESS * (0.002 + HEIGHT), 1e-6);
  }
}

/* The tops of the wave are felt before the geom is. */
TEST(what_stands_above_the_geom_is_felt_above_it)
{
  contact_world *w = wave_floor(HAP_MODEL_CONTACT, 1e3, 0.25 * WAVE);
  cw_go(w, 0.0, 0.0, -0.04 + 0.5 * HEIGHT / 0.5, 500);
  CHECK_NEAR(w->force[2], STIFFNESS * 0.5 * HEIGHT, 1e-5);
  cw_go(w, 0.5 * WAVE / 0.1, 0.0, 0.0, 100);
  CHECK(cw_norm(w->force) == 0.0);
}

/* A free block on ice, whose top has the wave: what pushes the hand along pushes the block back. */
static contact_world *block_new(hap_model model, double physics_hz)
{
  contact_world *w = floor_new(model);
  w->def.physics_hz = physics_hz;
  w->surface.mu = 0.0;
  told.other = cw_add_floor(w);
  cw_add_box(w, 0.3, AT(0.2, 0.2, 0.1), 0.0, 0.0, 0.05);
  dWorldSetGravity(w->world, 0.0, 0.0, -CW_GRAVITY);
  told.says.friction_static = told.says.friction_dynamic = 0.2;
  cw_start(w, -0.03, 0.0, 0.1 + RADIUS + 0.02);
  hap_texture_def def = wave_def();
  texture_use(w, &def);
  cw_go(w, 0.0, 0.0, -0.0415, 500);
  return w;
}

#define STROKE 600

/* Force errors in shares of the largest of the reference, RMS. */
static double forces_differ(double a[][3], double b[][3], int count)
{
  double sum = 0.0;
  double square = 0.0;
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      sum += (a[i][k] - b[i][k]) * (a[i][k] - b[i][k]);
      square += b[i][k] * b[i][k];
    }
  }
  return sqrt(sum / square);
}

static void block_stroke(contact_world *w, double out[STROKE][3])
{
  cw_move_hand(w, 0.05, 0.0, 0.0);
  for (int i = 0; i < STROKE; ++i) {
    cw_tick(w);
    memcpy(out[i], w->force, sizeof out[i]);
  }
}

TEST(a_slide_on_texture_is_that_of_the_reference)
{
  static const double rates[] = {20.0, 60.0};
  static double reference[STROKE][3];
  static double forces[STROKE][3];
  block_stroke(block_new(HAP_MODEL_SINGLE, 60.0), reference);
  for (int i = 0; i < 2; ++i) {
    block_stroke(block_new(HAP_MODEL_CONTACT, rates[i]), forces);
    double error = forces_differ(forces, reference, STROKE);
    printf("# physics at %g Hz: %.3f %% of the reference\n", rates[i], 100.0 * error);
    CHECK(error < 0.01);
  }
}

/* A plain ODE world: a block on a rail that the hand strokes over, without friction, and the force
 * by the formula of the page. It shares no code. */
TEST(a_slide_on_texture_is_that_of_a_plain_loop)
{
  static double forces[STROKE][3];
  static double plain[STROKE][3];
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  w->def.physics_hz = 20.0;
  cw_add_box(w, 0.1, AT(0.2, 0.2, 0.1), 0.0, 0.0, -0.05);
  dJointID rail = dJointCreateSlider(w->world, NULL);
  dJointAttach(rail, w->bodies[0], NULL);
  dJointSetSliderAxis(rail, 1.0, 0.0, 0.0);
  cw_start(w, 0.0, 0.0, RADIUS + 0.02);
  hap_texture_def def = wave_def();
  texture_use(w, &def);
  cw_go(w, 0.0, 0.0, -0.042, 500);
  double at = w->position[0][0];
  double x = w->hand_at[0] - at;
  double push = STIFFNESS * (0.001 + HEIGHT * sin(TURN * x)) * wave_slope(x);
  double speed = w->velocity[0][0] + 0.5 * PERIOD * push / 0.1; /* was that of half a tick before */
  double begin = w->hand_at[0];
  block_stroke(w, forces);
  dWorldID world = dWorldCreate();
  dMass mass;
  dMassSetBoxTotal(&mass, 0.1, 0.2, 0.2, 0.1);
  dBodyID block = dBodyCreate(world);
  dBodySetMass(block, &mass);
  dBodySetPosition(block, at, 0.0, -0.05);
  dBodySetLinearVel(block, speed, 0.0, 0.0);
  for (int i = 0; i < STROKE * 100; ++i) { /* at 100 kHz */
    double hand = begin + 0.05 * (PERIOD + 1e-5 * i);
    x = hand - dBodyGetPosition(block)[0];
    double load = STIFFNESS * (0.001 + HEIGHT * sin(TURN * x));
    double along = -load * wave_slope(x);
    dBodyAddForce(block, -along, 0.0, 0.0);
    dWorldStep(world, 1e-5);
    if (i % 100 == 0) { /* a tick's force is that of where the block is at its begin */
      plain[i / 100][0] = along;
      plain[i / 100][1] = 0.0;
      plain[i / 100][2] = load;
    }
  }
  dWorldDestroy(world);
  double error = forces_differ(forces, plain, STROKE);
  printf("# %.3f %% of a plain loop at 100 kHz\n", 100.0 * error);
  CHECK(error < 0.01);
}

static double height_of_nan(void *arg, const double point[3])
{
  (void)arg;
  (void)point;
  return (double)NAN;
}

TEST(a_height_that_is_not_finite_is_a_fault)
{
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  cw_add_floor(w);
  w->research.guard = HAP_GUARD_ON;
  cw_start(w, 0.0, 0.0, RADIUS + 0.004);
  hap_texture_def def = wave_def();
  def.height = height_of_nan;
  texture_use(w, &def);
  for (int i = 0; i < 60; ++i) {
    w->hand_at[2] -= 1e-4;
    cw_put_hand(w, 0.0, 0.0, -0.1);
    (void)hap_session_advance(w->session, 1);
    cw_read(w);
  }
  CHECK(cw_stats(w).faults.fault == HAP_FAULT_FORCE);
  CHECK(cw_norm(w->force) == 0.0);
}

static double height_of_a_wall(void *arg, const double point[3])
{
  (void)arg;
  return point[0] > 0.0 ? 1.0 : -1.0;
}

TEST(heights_are_bounded)
{
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  cw_add_floor(w);
  cw_start(w, 0.05, 0.0, RADIUS + 0.02);
  hap_texture_def def = wave_def();
  def.height = height_of_a_wall;
  texture_use(w, &def);
  cw_go(w, 0.0, 0.0, -0.042, 500);
  CHECK_NEAR(w->force[2], STIFFNESS * 0.004, 1e-6);
}

TEST(wrong_textures_are_refused)
{
  double heights[4] = {0.0, 1e-4, -1e-4, 0.0};
  uint32_t number = 7;
  hap_texture_def def;
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  dGeomID ground = cw_add_floor(w);
  floor_start(w);
  memset(&def, 0, sizeof def);
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_session_add_texture(NULL, &def, &number) == HAP_ERROR_ARGUMENT);
  hap_texture_def_init(&def, sizeof def);
  CHECK(hap_session_add_texture(w->session, &def, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT && number == 0);
  def.heights = heights;
  def.columns = def.rows = 2;
  def.height = wave_height;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  def.height = NULL;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_OK && number == 1);
  def.pitch = 0.0;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  def.pitch = 1e-3;
  def.columns = 0;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  def.columns = 2;
  def.along_rows[0] = 0.5;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  def.along_rows[0] = 0.0;
  def.origin[1] = (double)NAN;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  def.origin[1] = 0.0;
  heights[2] = 0.0031;
  hap_detail detail = {""};
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "heights[2]") != NULL);
  heights[2] = (double)NAN;
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_ARGUMENT);
  heights[2] = 0.0;
  for (uint32_t i = 2; i <= 64; ++i) {
    CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_OK && number == i);
  }
  CHECK(hap_session_add_texture(w->session, &def, &number) == HAP_ERROR_CAPACITY && number == 0);
  told.says.texture = 65;
  surface_change(w, ground);
  (void)hap_session_advance(w->session, 20);
  CHECK(cw_stats(w).faults.fault == HAP_FAULT_WORLD);
}

/* Towards a ball of 30 mm, whose surface is curved. */
TEST(no_round_over_a_textured_ball_gives_energy)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = floor_new(all_models[m]);
    dGeomID ball = dCreateSphere(w->space, 0.03);
    dGeomSetPosition(ball, 0.0, 0.0, -0.03);
    w->def.haptic_hz = 1e4;
    cw_start(w, -0.125 * WAVE, 0.0, RADIUS + 0.02);
    hap_texture_def def = wave_def();
    texture_use(w, &def);
    cw_go(w, 0.0, 0.0, -0.0205 / 0.1, 1000);
    double stored = 0.5 * STIFFNESS * 1.6e-3 * 1.6e-3;
    double work = 0.0;
    for (int round = 0; round < 3; ++round) {
      work = round_work(w);
    }
    printf("# ball, model %zu: %.4f %% of what is stored\n", m, 100.0 * work / stored);
    CHECK(fabs(work) < 5e-3 * stored);
  }
}

/* ---- answers that are none ---- */

typedef struct wrong_row {
  const char *name;
  size_t member;
  double value;
} wrong_row;

static const wrong_row wrongs[] = {
    {"stiffness_that_is_not_finite", offsetof(hap_surface, stiffness), (double)NAN},
    {"stiffness_below_0", offsetof(hap_surface, stiffness), -1.0},
    {"stiffness_beyond_all", offsetof(hap_surface, stiffness), 2e9},
    {"damping_that_is_not_finite", offsetof(hap_surface, damping), (double)INFINITY},
    {"damping_below_0", offsetof(hap_surface, damping), -1e-3},
    {"static_friction_below_0", offsetof(hap_surface, friction_static), -0.1},
    {"dynamic_friction_that_is_not_finite", offsetof(hap_surface, friction_dynamic), (double)NAN},
    {"adhesion_that_is_not_finite", offsetof(hap_surface, adhesion), (double)NAN},
    {"adhesion_below_0", offsetof(hap_surface, adhesion), -1e-3},
    {"adhesion_beyond_all", offsetof(hap_surface, adhesion), 100.1},
};

TEST_EACH(wrongs, const wrong_row *row)
{
  hap_detail detail = {""};
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  dGeomID ground = cw_add_floor(w);
  floor_start(w);
  hand_press(w, 0.002);
  memcpy((char *)&told.says + row->member, &row->value, sizeof row->value);
  surface_change(w, ground);
  for (int i = 0; i < 200; ++i) { /* an advance with a fault says so */
    (void)hap_session_advance(w->session, 1);
    cw_read(w);
  }
  CHECK(cw_stats(w).faults.fault == HAP_FAULT_WORLD);
  CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "pointer_surface") != NULL);
  CHECK(cw_norm(w->force) == 0.0);
}

TEST(what_cannot_be_asked_is_refused)
{
  CHECK(hap_session_surface_changed(NULL, NULL) == HAP_ERROR_ARGUMENT);
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  cw_add_floor(w);
  told.changes = w;
  floor_start(w);
  CHECK(told.calls == 1 && told.status == HAP_ERROR_THREAD);
}

/* ---- energy ---- */

/* Pressed and drawn to and fro on surfaces that are other than the pointer: the observer has
 * nothing to hold back. */
TEST(the_energy_observer_finds_nothing)
{
  static const double stiffness[] = {200.0, 5000.0};
  for (size_t m = 0; m < 2 * MODELS; ++m) {
    contact_world *w = floor_new(all_models[m / 2]);
    dGeomID ground = cw_add_floor(w);
    w->research.guard = HAP_GUARD_ON;
    told.says.stiffness = stiffness[m % 2];
    told.says.friction_static = 0.5;
    told.says.friction_dynamic = 0.3;
    floor_start(w);
    for (int round = 0; round < 6; ++round) {
      cw_go(w, 0.02, 0.0, -0.05, 60);
      cw_go(w, 0.04, 0.0, 0.0, 60);
      told.says.stiffness = round % 2 == 0 ? STIFFNESS : stiffness[m % 2];
      surface_change(w, ground);
      cw_go(w, -0.08, 0.0, 0.0, 60);
      cw_go(w, 0.02, 0.0, 0.05, 60);
    }
    CHECK(cw_stats(w).faults.energy_ticks == 0);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}
