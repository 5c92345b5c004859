/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Seams: what lies side by side is one surface, and an inner corner is two. The forces have closed
 * forms, those of one spring and of two. */

#include "tests/tap.h"

#include "tests/contact_world.h"
#include "tests/solids.h"

#define RADIUS 0.005
#define K 1000.0
#define DEEP 0.002 /* m */
#define SPEED 0.05 /* m/s, along the surface */

static void open_world(contact_world *w, double friction)
{
  cw_open(w, 0.0);
  w->def.physics_hz = 20.0;
  w->hand_def.radius = RADIUS;
  w->hand_def.stiffness = K;
  w->hand_def.damping = 0.0;
  w->hand_def.friction = friction;
  w->hand_expert.coupling = HAP_COUPLING_DIRECT;
  cw_add_cube(w, 1.0, 0.1, 5.0, 0.0, 0.0);
}

static dGeomID add_block(contact_world *w, double x, double z)
{
  dGeomID geom = dCreateBox(w->space, 0.1, 0.1, 0.1);
  dGeomSetPosition(geom, x, 0.0, z);
  return geom;
}

/* Across the seam at x = 0, pressed in. Largest error of the force's two parts, N. */
static double slide_error(contact_world *w, double mu)
{
  double worst = 0.0;
  cw_start(w, -0.02, 0.001, RADIUS + 0.001);
  cw_move_hand(w, 0.0, 0.0, -0.03);
  cw_run(w, 100);
  cw_move_hand(w, SPEED, 0.0, 0.0);
  cw_run(w, 100);
  for (int i = 0; i < 600; ++i) {
    cw_tick(w);
    worst = fmax(worst, fabs(w->force[2] - K * DEEP));
    worst = fmax(worst, fabs(w->force[0] + mu * K * DEEP));
    worst = fmax(worst, fabs(w->force[1]));
  }
  CHECK(w->hand_at[0] > 0.01);
  return worst;
}

TEST(two_flush_boxes_push_once)
{
  static const double frictions[] = {0.0, 0.5};
  for (int i = 0; i < 2; ++i) {
    contact_world w;
    open_world(&w, frictions[i]);
    (void)add_block(&w, -0.05, -0.05);
    (void)add_block(&w, 0.05, -0.05);
    CHECK(slide_error(&w, frictions[i]) < 1e-6);
    cw_close(&w);
  }
}

/* Where the corners of four meet, and at the rims of two: as far from their middles as it goes. */
TEST(corners_and_rims_are_hidden_as_well)
{
  contact_world w;
  open_world(&w, 0.0);
  for (int i = 0; i < 4; ++i) {
    dGeomID block = add_block(&w, i < 2 ? -0.05 : 0.05, -0.05);
    dGeomSetPosition(block, i < 2 ? -0.05 : 0.05, i % 2 == 0 ? -0.049 : 0.051, -0.05);
  }
  CHECK(slide_error(&w, 0.0) < 1e-6);
  cw_close(&w);
  open_world(&w, 0.0);
  for (int i = 0; i < 2; ++i) {
    dGeomID rod = dCreateCylinder(w.space, 0.05, 0.1);
    dMatrix3 along_x;
    dRFromAxisAndAngle(along_x, 0.0, 1.0, 0.0, M_PI / 2.0);
    dGeomSetRotation(rod, along_x);
    dGeomSetPosition(rod, i == 0 ? -0.05 : 0.05, 0.001, -0.05);
  }
  CHECK(slide_error(&w, 0.0) < 1e-6);
  cw_close(&w);
}

/* A body at x of boxes at these places in it, which does not move. */
static void add_body(contact_world *w, double x, const double (*at)[2], int count)
{
  dBodyID body = cw_add_cube(w, 1.0, 0.1, x, 0.0, -0.05);
  dBodySetKinematic(body);
  for (int i = 0; i < count; ++i) {
    dGeomID box = i == 0 ? dBodyGetFirstGeom(body) : dCreateBox(w->space, 0.1, 0.1, 0.1);
    dGeomSetBody(box, body);
    dGeomSetOffsetPosition(box, at[i][0], 0.0, at[i][1]);
  }
}

TEST(one_body_of_two_boxes_pushes_once)
{
  static const double at[2][2] = {{-0.05, 0.0}, {0.05, 0.0}};
  static const double aside[2][2] = {{-0.45, 0.0}, {-0.35, 0.0}};
  for (int i = 0; i < 2; ++i) {
    contact_world w;
    open_world(&w, 0.3);
    add_body(&w, i == 0 ? 0.0 : 0.4, i == 0 ? at : aside, 2);
    CHECK(slide_error(&w, 0.3) < 1e-6);
    cw_close(&w);
  }
}

/* They reach into each other, one of them a little lower. */
TEST(one_body_of_boxes_that_overlap_pushes_once)
{
  static const double at[3][2] = {{-0.05, 0.0}, {0.04, 0.0}, {-0.01, -0.003}};
  contact_world w;
  open_world(&w, 0.5);
  add_body(&w, 0.0, at, 3);
  CHECK(slide_error(&w, 0.5) < 1e-6);
  cw_close(&w);
}

TEST(both_sides_of_an_inner_corner_push)
{
  contact_world w;
  open_world(&w, 0.0);
  (void)cw_add_floor(&w);
  (void)add_block(&w, -0.05, 0.05); /* a wall at x = 0 that stands on it */
  cw_start(&w, RADIUS + 0.001, 0.0, RADIUS + 0.001);
  cw_move_hand(&w, -0.05, 0.0, -0.03);
  for (int i = 0; i < 200; ++i) { /* until its middle is in the wall */
    cw_tick(&w);
    CHECK_NEAR(w.force[0], K * fmax(RADIUS - w.hand_at[0], 0.0), 1e-6);
    CHECK_NEAR(w.force[2], K * fmax(RADIUS - w.hand_at[2], 0.0), 1e-6);
  }
  CHECK(w.hand_at[0] < -0.003 && w.hand_at[2] < 0.001);
  cw_close(&w);
}

/* A step of a tenth of the finger's radius is one. */
TEST(a_step_is_no_seam)
{
  contact_world w;
  double most = 0.0;
  open_world(&w, 0.0);
  (void)add_block(&w, -0.05, -0.05);
  (void)add_block(&w, 0.05, -0.05 + 0.1 * RADIUS);
  cw_start(&w, -0.01, 0.0, RADIUS - DEEP);
  cw_run(&w, 100);
  cw_move_hand(&w, SPEED, 0.0, 0.0);
  for (int i = 0; i < 300; ++i) {
    cw_tick(&w);
    most = fmax(most, -w.force[0]);
  }
  CHECK(most > 0.1);
  CHECK_NEAR(w.force[2], K * (DEEP + 0.1 * RADIUS), 1e-6);
  cw_close(&w);
}

/* One that is lower or higher by less than what is a step, a hundredth of the radius: each pushes
 * where it is the deeper one, with the edge of the higher one where that is. */
TEST(one_that_is_a_little_higher_pushes_once)
{
  static const double steps[] = {1e-6, 1e-5, 4.5e-5, -1e-6, -1e-5, -4.5e-5}; /* m, up at x = 0 */
  for (size_t n = 0; n < sizeof steps / sizeof steps[0]; ++n) {
    contact_world w;
    double worst = 0.0;
    open_world(&w, 0.0);
    (void)add_block(&w, -0.05, -0.05);
    (void)add_block(&w, 0.05, -0.05 + steps[n]);
    cw_start(&w, -0.01, 0.0, RADIUS - DEEP);
    cw_run(&w, 100);
    cw_move_hand(&w, SPEED, 0.0, 0.0);
    for (int i = 0; i < 400; ++i) {
      cw_tick(&w);
      double x = w.hand_at[0];
      double left = hypot(fmax(x, 0.0), RADIUS - DEEP); /* from its middle to the two boxes */
      double right = hypot(fmin(x, 0.0), RADIUS - DEEP - steps[n]);
      double off = cw_norm(w.force) - K * (RADIUS - fmin(left, right));
      worst = fmax(worst, fabs(off));
    }
    CHECK_SAY(worst < 1e-6, "a step of %g m: %g N off", steps[n], worst);
    CHECK(w.hand_at[0] > 0.005);
    cw_close(&w);
  }
}

/* Over the corner where four meet that are not as high: two of them meet there alone. Also so deep
 * that an edge points aside. */
TEST(four_that_are_not_as_high_push_once)
{
  static const double heights[4] = {-1.2e-5, -5e-6, 1.8e-5, -3e-6};
  static const double depths[] = {0.0005, 0.0013, 0.002, 0.0035, 0.0044};
  for (size_t n = 0; n < 2 * (sizeof depths / sizeof depths[0]); ++n) {
    contact_world w;
    double deep = depths[n / 2];
    double worst = 0.0;
    open_world(&w, 0.0);
    w.def.model = n % 2 == 0 ? HAP_MODEL_CONTACT : HAP_MODEL_SINGLE; /* physics finds seams there */
    for (int i = 0; i < 4; ++i) {
      dGeomID block = add_block(&w, i < 2 ? -0.05 : 0.05, -0.05 + heights[i]);
      dGeomSetPosition(block, i < 2 ? -0.05 : 0.05, i % 2 == 0 ? 0.05 : -0.05, -0.05 + heights[i]);
    }
    cw_start(&w, -0.004, 0.0016, RADIUS - deep);
    cw_run(&w, 100);
    cw_move_hand(&w, SPEED, -0.4 * SPEED, 0.0);
    for (int i = 0; i < 160; ++i) {
      cw_tick(&w);
      double deepest = 0.0;
      for (int k = 0; k < 4; ++k) {
        double x = k < 2 ? fmax(w.hand_at[0], 0.0) : fmin(w.hand_at[0], 0.0);
        double y = k % 2 == 0 ? fmin(w.hand_at[1], 0.0) : fmax(w.hand_at[1], 0.0);
        double way = hypot(hypot(x, y), w.hand_at[2] - heights[k]);
        deepest = fmax(deepest, RADIUS - way);
      }
      worst = fmax(worst, fabs(cw_norm(w.force) / (K * deepest) - 1.0));
    }
    CHECK_SAY(worst < 0.02, "%g m deep: %g off", deep, worst);
    cw_close(&w);
  }
}

/* Beside a wall, over an edge on which the pointer is so deep that it points away from the wall. */
TEST(a_wall_beside_such_an_edge_pushes_as_well)
{
  const double wall = -0.0041; /* m */
  const double step = 2e-5;
  const double deep = 0.0044;
  contact_world w;
  open_world(&w, 0.0);
  (void)add_block(&w, -0.05, -0.05);
  (void)add_block(&w, 0.05, -0.05 - step);
  (void)add_block(&w, wall - 0.05, 0.05);
  cw_start(&w, 0.006, 0.0, RADIUS - deep);
  cw_run(&w, 100);
  cw_move_hand(&w, -SPEED, 0.0, 0.0);
  for (int i = 0; i < 120; ++i) {
    cw_tick(&w);
    double x = w.hand_at[0];
    CHECK(w.force[0] > 0.9 * K * (RADIUS - (x - wall)));
    CHECK(w.force[2] > 0.9 * K * deep && w.force[2] < 1.1 * K * deep);
  }
  CHECK(w.hand_at[0] < 1e-4);
  cw_close(&w);
}

/* A slit that opens parts one thing into two. In no tick does much come to the force. */
TEST(a_slit_that_opens_is_felt_little_by_little)
{
  const double slow = 1e-3; /* m/s */
  contact_world w;
  double before = K * DEEP;
  double most = 0.0;
  open_world(&w, 0.0);
  (void)add_block(&w, -0.05, -0.05);
  dBodyID right = cw_add_cube(&w, 1.0, 0.1, 0.05, 0.0, -0.05);
  dBodySetKinematic(right);
  dBodySetLinearVel(right, slow, 0.0, 0.0);
  cw_start(&w, -1e-3, 0.0, RADIUS - DEEP);
  for (int i = 0; i < 300; ++i) {
    cw_tick(&w);
    if (i >= 20) { /* it has come in */
      most = fmax(most, fabs(w.force[2] - before));
    }
    before = w.force[2];
  }
  double apart = hypot(1e-3 + 0.3 * slow, RADIUS - DEEP);
  double second = K * (RADIUS - apart) * (RADIUS - DEEP) / apart; /* what its edge gives at last */
  CHECK_NEAR(w.force[2], K * DEEP + second, 0.02);
  CHECK_SAY(most < 0.05 * K * DEEP, "%g N in a tick", most);
  cw_close(&w);
}

/* Geoms that the loop cannot ask, and models that ask none: a plane for each between two syncs. */

static void add_hull(contact_world *w, box_arrays *box, double x, double z)
{
  dGeomSetPosition(convex_box(w->space, box, AT(0.05, 0.05, 0.05)), x, 0.0, z);
}

TEST(two_flush_hulls_push_once_in_every_model)
{
  static box_arrays boxes[2];
  for (int m = 0; m < 4; ++m) {
    for (int hull = 0; hull < 2; ++hull) {
      contact_world w;
      open_world(&w, 0.0);
      w.def.model = all_models[m];
      if (hull != 0) {
        add_hull(&w, &boxes[0], -0.05, -0.05);
        add_hull(&w, &boxes[1], 0.05, -0.05);
      } else {
        (void)add_block(&w, -0.05, -0.05);
        (void)add_block(&w, 0.05, -0.05);
      }
      double error = slide_error(&w, 0.0);
      CHECK(error < 1e-6);
      cw_close(&w);
    }
  }
}

/* Where the loop asks no shape, physics finds the seam. */
TEST(two_flush_boxes_push_once_where_no_shape_is_asked)
{
  for (int i = 0; i < 2; ++i) {
    contact_world w;
    open_world(&w, 0.0);
    w.expert.effects_off = i == 0 ? HAP_EFFECT_BIT(HAP_EFFECT_SHAPE) : 0;
    w.def.accuracy = i == 0 ? w.def.accuracy : 0.0;
    (void)add_block(&w, -0.05, -0.05);
    (void)add_block(&w, 0.05, -0.05);
    CHECK(slide_error(&w, 0.0) < 1e-6);
    cw_close(&w);
  }
}
