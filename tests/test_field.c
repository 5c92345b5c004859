/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A sphere on a heightfield: on a plain, on a slope, over a ridge and beside the field's end, in
 * every model. The forces have closed forms. */

#include "tests/tap.h"

#include "tests/contact_world.h"

#define RADIUS 0.01
#define K 1000.0
#define CELLS 20
#define CELL 0.05 /* m */

typedef double (*height_of)(double x);

static double plain_height(double x)
{
  (void)x;
  return 0.0;
}

static double slope_height(double x)
{
  return 0.5 * x;
}

static double ridge_height(double x)
{
  return -0.5 * fabs(x);
}

static double field_heights[(CELLS + 1) * (CELLS + 1)];

/* Its y is up in the world, and x is x. */
static dHeightfieldDataID add_field(contact_world *w, height_of height)
{
  const double width = CELLS * CELL;
  dHeightfieldDataID data = dGeomHeightfieldDataCreate();
  dMatrix3 upright;
  for (int i = 0; i <= CELLS; ++i) {
    for (int k = 0; k <= CELLS; ++k) {
      field_heights[i * (CELLS + 1) + k] = height(CELL * k - 0.5 * width);
    }
  }
  dGeomHeightfieldDataBuildDouble(data, field_heights, 0, width, width, CELLS + 1, CELLS + 1, 1.0,
                                  0.0, 1.0, 0);
  dGeomID geom = dCreateHeightfield(w->space, data, 1);
  dRFromAxisAndAngle(upright, 1.0, 0.0, 0.0, 0.5 * M_PI);
  dGeomSetRotation(geom, upright);
  return data;
}

/* Down to a place, and what is felt there. */
static void hand_press(height_of height, hap_model model, double x, double z, double out[3])
{
  contact_world w;
  cw_open(&w, 0.0);
  w.def.model = model;
  w.def.physics_hz = 60.0;
  w.hand_def.radius = RADIUS;
  w.hand_def.stiffness = K;
  w.hand_def.damping = 0.0;
  w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  cw_add_cube(&w, 1.0, 0.1, 5.0, 0.0, 0.0);
  dHeightfieldDataID data = add_field(&w, height);
  REQUIRE(cw_start(&w, x, 0.013, z + 0.05));
  cw_move_hand(&w, 0.0, 0.0, -0.05);
  cw_run(&w, 1000);
  cw_move_hand(&w, 0.0, 0.0, 0.0);
  cw_run(&w, 100);
  memcpy(out, w.force, sizeof w.force);
  cw_close(&w);
  dGeomHeightfieldDataDestroy(data);
}

static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_CONTACT};

TEST(a_sphere_feels_a_plain)
{
  for (int i = 0; i < 4; ++i) {
    double force[3] = {0.0};
    hand_press(plain_height, models[i], 0.021, RADIUS - 0.005, force);
    CHECK_NEAR(force[0], 0.0, 1e-6);
    CHECK_NEAR(force[2], 5.0, 1e-6);
  }
}

/* Its centre goes below the surface. */
TEST(a_sphere_feels_a_plain_as_deep_as_it_is)
{
  double force[3] = {0.0};
  hand_press(plain_height, HAP_MODEL_CONTACT, 0.021, RADIUS - 0.03, force);
  CHECK_NEAR(force[2], 30.0, 1e-6);
}

TEST(a_sphere_feels_a_slope_along_its_normal)
{
  const double n[3] = {-0.5 / sqrt(1.25), 0.0, 1.0 / sqrt(1.25)};
  for (int i = 0; i < 4; ++i) {
    double force[3] = {0.0};
    double z = 0.5 * 0.021 + (RADIUS - 0.004) * sqrt(1.25); /* 4 mm deep */
    hand_press(slope_height, models[i], 0.021, z, force);
    CHECK_NEAR(force[0], 4.0 * n[0], 1e-6);
    CHECK_NEAR(force[1], 0.0, 1e-6);
    CHECK_NEAR(force[2], 4.0 * n[2], 1e-6);
  }
}

/* The edge is nearest. */
TEST(a_sphere_feels_a_ridge)
{
  for (int i = 0; i < 4; ++i) {
    double force[3] = {0.0};
    hand_press(ridge_height, models[i], 0.0, RADIUS - 0.003, force);
    CHECK_NEAR(force[0], 0.0, 1e-6);
    CHECK_NEAR(force[2], 3.0, 1e-6);
  }
}

TEST(beside_its_end_a_field_is_not_felt)
{
  double force[3] = {0.0};
  hand_press(plain_height, HAP_MODEL_CONTACT, 0.5 * CELLS * CELL + 2.0 * RADIUS, RADIUS - 0.005,
             force);
  CHECK(force[0] == 0.0 && force[1] == 0.0 && force[2] == 0.0);
}
