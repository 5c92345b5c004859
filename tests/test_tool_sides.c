/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A hull stays on the side of a thin thing where it touched, and what lies side by side under it is
 * one surface. The forces have closed forms, those of one spring. */

#include "tests/tap.h"

#include "tests/tool_world.h"

#define HALF 0.005 /* m, of the cube that is the hull */
#define K 1000.0

static void world_begin(tool_world *w, hap_model model, double hz)
{
  tool_begin(w, model);
  dWorldSetGravity(w->world, 0.0, 0.0, 0.0);
  tool_set_box(w, AT(HALF, HALF, HALF), AT(0.0, 0.0, 0.0));
  w->def.physics_hz = hz;
  w->tool_def.stiffness = K;
  w->tool_def.damping = 0.0;
}

/* m: how deep the hull is in what has its upper side at z = 0. */
static double depth_of(const tool_world *w)
{
  return fmax(HALF - w->pose.position[2], 0.0);
}

static double force_error(const tool_world *w, double stiffness)
{
  const double *f = w->state.wrench.force;
  return fmax(fabs(f[2] - stiffness * depth_of(w)), hypot(f[0], f[1]));
}

typedef struct press {
  sheet_kind kind;
  double thick; /* m */
  hap_coupling coupling;
  hap_model model;
  double speed; /* m/s */
} press;

/* Down until the hull is 30 mm deep, and back up. */
static void check_press(const press *t)
{
  tool_world w;
  box_arrays box;
  world_begin(&w, t->model, 60.0);
  w.tool_expert.coupling = t->coupling;
  w.tool_expert.coupling_stiffness = K;
  sheet_create(w.space, &box, t->kind, 0.1, t->thick);
  tool_go(&w, 0.003, 0.002, HALF + 0.1, 0.0);
  tool_start(&w);
  double stiffness = t->coupling == HAP_COUPLING_PROXY ? 0.5 * K : K;
  int ticks = (int)(0.13 / (1e-3 * t->speed));
  tool_move(&w, 0.003, 0.002, HALF - 0.03, 0.0, ticks);
  tool_run(&w, 200);
  double error = force_error(&w, stiffness);
  tool_move(&w, 0.003, 0.002, HALF + 0.02, 0.0, 250);
  tool_run(&w, 50);
  bool good = error < 0.3 && fabs(w.state.wrench.force[2]) < 1e-9;
  if (!good) {
    printf("# %s of %g mm, coupling %d, model %d, %g m/s: %g N off, %g N after it\n",
           sheet_names[t->kind], 1e3 * t->thick, (int)t->coupling, (int)t->model, t->speed, error,
           w.state.wrench.force[2]);
  }
  CHECK(good);
  tool_end(&w);
}

static const double thicknesses[] = {0.0001, 0.001, 0.02};

TEST(no_sheet_gives_way_in_any_model)
{
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    for (int m = 0; m < 4; ++m) {
      for (int i = 0; i < 3; ++i) {
        const press t = {(sheet_kind)kind, thicknesses[i], HAP_COUPLING_DIRECT, all_models[m], 0.1};
        check_press(&t);
      }
    }
  }
}

TEST(no_sheet_gives_way_in_any_coupling)
{
  static const hap_coupling couplings[] = {HAP_COUPLING_AUTO, HAP_COUPLING_PROXY,
                                           HAP_COUPLING_GOD_OBJECT};
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    for (int m = 0; m < 3; ++m) {
      const press t = {(sheet_kind)kind, 0.0003, couplings[m], HAP_MODEL_CONTACT, 0.1};
      check_press(&t);
    }
  }
}

TEST(no_sheet_gives_way_to_a_fast_hand)
{
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    for (int i = 0; i < 3; ++i) {
      const press t = {(sheet_kind)kind, thicknesses[i], HAP_COUPLING_DIRECT, HAP_MODEL_CONTACT,
                       2.0};
      check_press(&t);
    }
  }
}

/* What is put behind a sheet is behind it: nobody pressed it through. */
TEST(a_jump_through_a_sheet_is_no_touch)
{
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    tool_world w;
    box_arrays box;
    world_begin(&w, HAP_MODEL_CONTACT, 60.0);
    sheet_create(w.space, &box, (sheet_kind)kind, 0.1, 0.001);
    tool_go(&w, 0.003, 0.002, HALF + 0.01, 0.0);
    tool_start(&w);
    tool_move(&w, 0.003, 0.002, HALF - 0.002, 0.0, 200);
    CHECK_NEAR(w.state.wrench.force[2], 2.0, 1e-6);
    tool_go(&w, 0.003, 0.002, -0.04, 0.0);
    tool_run(&w, 300);
    CHECK_NEAR(w.state.wrench.force[2], 0.0, 1e-9);
    tool_move(&w, 0.003, 0.002, -0.001 - HALF + 0.002, 0.0, 300); /* and presses from below */
    CHECK_NEAR(w.state.wrench.force[2], -2.0, 1e-6);
    tool_end(&w);
  }
}

/* A sheet that the application puts elsewhere is not touched there by what it left behind. */
TEST(a_sheet_that_is_put_away_lets_go)
{
  tool_world w;
  world_begin(&w, HAP_MODEL_CONTACT, 60.0);
  dBodyID body = dBodyCreate(w.world);
  dGeomID geom = dCreateBox(w.space, 0.1, 0.1, 0.001);
  dGeomSetBody(geom, body);
  dBodySetKinematic(body);
  dBodySetPosition(body, 0.0, 0.0, -0.0005);
  tool_go(&w, 0.003, 0.002, HALF + 0.01, 0.0);
  tool_start(&w);
  tool_move(&w, 0.003, 0.002, HALF - 0.01, 0.0, 200);
  CHECK_NEAR(w.state.wrench.force[2], 10.0, 1e-6);
  REQUIRE(hap_session_lock(w.session) == HAP_OK);
  dBodySetPosition(body, 0.0, 0.0, 0.3);
  REQUIRE(hap_session_unlock(w.session) == HAP_OK);
  tool_run(&w, 200);
  CHECK_NEAR(w.state.wrench.force[2], 0.0, 1e-9);
  tool_end(&w);
}

/* Deep in a sheet and off its edge: free, and what comes back from below is below. */
TEST(an_edge_is_a_way_round)
{
  for (int kind = 0; kind < SHEET_KINDS; ++kind) {
    tool_world w;
    box_arrays box;
    world_begin(&w, HAP_MODEL_CONTACT, 60.0);
    sheet_create(w.space, &box, (sheet_kind)kind, 0.1, 0.001);
    tool_go(&w, 0.03, 0.0, HALF + 0.002, 0.0);
    tool_start(&w);
    tool_move(&w, 0.03, 0.0, -0.007, 0.0, 200); /* 12 mm deep, and under the sheet */
    CHECK_NEAR(w.state.wrench.force[2], 12.0, 1e-6);
    tool_move(&w, 0.07, 0.0, -0.007, 0.0, 400);
    tool_run(&w, 50);
    CHECK_NEAR(w.state.wrench.force[2], 0.0, 1e-9);
    tool_move(&w, 0.03, 0.0, -0.007, 0.0, 400);
    CHECK_NEAR(w.state.wrench.force[2], 0.0, 1e-9);
    CHECK_NEAR(w.state.wrench.force[0], 0.0, 1e-9);
    tool_end(&w);
  }
}

/* ---- seams ---- */

static void block_add(tool_world *w, double x, double z)
{
  dGeomSetPosition(dCreateBox(w->space, 0.1, 0.1, 0.1), x, 0.0, z);
}

/* 2 mm deep from x = -0.02 to 0.02 and back. Largest error of the two parts of the force, N. */
static double slide_error(tool_world *w, double mu, double turn)
{
  double worst = 0.0;
  tool_go(w, -0.02, 0.003, HALF + 0.001, 0.0);
  w->pose.quat_wxyz[0] = cos(0.5 * turn);
  w->pose.quat_wxyz[3] = sin(0.5 * turn);
  tool_start(w);
  tool_run(w, 100);
  for (int i = 0; i < 1000; ++i) {
    double down = i < 100 ? 0.003 * i / 100.0 : 0.003;
    double way = i < 150 ? 0.0 : i < 550 ? 1e-4 * (i - 150) : i < 600 ? 0.04 : 1e-4 * (1000 - i);
    w->pose.position[0] = -0.02 + way;
    w->pose.position[2] = HALF + 0.001 - down;
    w->twist.linear[0] = i < 150 ? 0.0 : i < 550 ? 0.1 : i < 600 ? 0.0 : -0.1;
    w->twist.linear[2] = i < 100 ? -0.03 : 0.0;
    tool_step(w);
    const double *f = w->state.wrench.force;
    bool slides = (i > 200 && i < 550) || i > 700;
    worst = fmax(worst, fabs(f[2] - K * depth_of(w)));
    worst = fmax(worst, fabs(f[1]));
    double rub = i < 550 ? -mu : mu;
    worst = fmax(worst, slides ? fabs(f[0] - rub * f[2]) : 0.0);
  }
  return worst;
}

TEST(flush_boxes_push_once_in_every_model)
{
  for (int m = 0; m < 4; ++m) {
    for (int i = 0; i < 4; ++i) {
      tool_world w;
      double mu = i % 2 == 0 ? 0.0 : 0.5;
      world_begin(&w, all_models[m], 60.0);
      w.tool_def.friction = mu;
      block_add(&w, -0.05, -0.05);
      block_add(&w, 0.05, -0.05);
      double error = slide_error(&w, mu, i < 2 ? 0.0 : 0.4);
      double most = mu > 0.0 ? 1e-3 : 1e-6; /* points that change begin with what the others hold */
      if (!(error < most)) {
        printf("# model %d, friction %g: %g N off\n", m, mu, error);
      }
      CHECK(error < most);
      tool_end(&w);
    }
  }
}

/* Boxes that reach into each other, and one that lies under both. */
TEST(boxes_that_overlap_push_once)
{
  tool_world w;
  world_begin(&w, HAP_MODEL_CONTACT, 20.0);
  block_add(&w, -0.05, -0.05);
  block_add(&w, 0.035, -0.05);
  block_add(&w, 0.0, -0.055);
  CHECK(slide_error(&w, 0.0, 0.0) < 1e-6);
  tool_end(&w);
}

/* A hull that leans is held by as much, and turned back about as much as on one box. */
TEST(a_leaning_hull_feels_one_surface)
{
  double torque[2];
  for (int i = 0; i < 2; ++i) {
    tool_world w;
    world_begin(&w, HAP_MODEL_CONTACT, 20.0);
    block_add(&w, i == 0 ? 0.0 : -0.05, -0.05);
    if (i != 0) {
      block_add(&w, 0.05, -0.05);
    }
    tool_go(&w, 0.002, 0.0, HALF + 0.001, 0.0);
    tool_start(&w);
    tool_move(&w, 0.002, 0.0, HALF - 0.002, 0.0, 100);
    tool_move(&w, 0.002, 0.0, HALF - 0.002, 0.02, 100);
    tool_run(&w, 100);
    torque[i] = w.state.wrench.torque[1];
    CHECK_NEAR(w.state.wrench.force[2], 2.0, 0.01);
    tool_end(&w);
  }
  CHECK_NEAR(torque[1] / torque[0], 1.0, 0.3);
}

/* Things that do not adjoin push each for itself. */
TEST(blocks_that_are_apart_push_each)
{
  tool_world w;
  world_begin(&w, HAP_MODEL_CONTACT, 20.0);
  block_add(&w, -0.052, -0.05);
  block_add(&w, 0.052, -0.05);
  tool_go(&w, 0.0, 0.0, HALF + 0.001, 0.0);
  tool_start(&w);
  tool_move(&w, 0.0, 0.0, HALF - 0.002, 0.0, 100);
  CHECK_NEAR(w.state.wrench.force[2], 4.0, 1e-6);
  tool_end(&w);
}

TEST(both_sides_of_an_inner_corner_push)
{
  tool_world w;
  world_begin(&w, HAP_MODEL_CONTACT, 20.0);
  block_add(&w, 0.0, -0.05);
  block_add(&w, -0.05, 0.05); /* a wall at x = 0 that stands on it */
  tool_go(&w, HALF + 0.001, 0.0, HALF + 0.001, 0.0);
  tool_start(&w);
  tool_run(&w, 100);
  for (int i = 1; i <= 200; ++i) {
    tool_go(&w, HALF + 0.001 - 5e-5 * i, 0.0, HALF + 0.001 - 3e-5 * i, 0.0);
    tool_step(&w);
    CHECK_NEAR(w.state.wrench.force[0], K * fmax(HALF - w.pose.position[0], 0.0), 1e-6);
    CHECK_NEAR(w.state.wrench.force[2], K * depth_of(&w), 1e-6);
  }
  tool_end(&w);
}

/* ---- heightfields ---- */

/* Fine cells, pressed deep, and along: the triangles that are near stay few. */
TEST(a_level_heightfield_holds)
{
  static const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_CONTACT};
  static grid g;
  for (int m = 0; m < 2; ++m) {
    tool_world w;
    world_begin(&w, models[m], 60.0);
    grid_fill(&g, 40, 0.005, grid_level);
    grid_field(w.space, &g);
    tool_go(&w, 0.0013, 0.0027, 0.02, 0.0);
    tool_start(&w);
    tool_move(&w, 0.0013, 0.0027, HALF - 0.02, 0.0, 350);
    CHECK_NEAR(w.state.wrench.force[2], 20.0, 1e-6);
    w.steepest = 0.0;
    tool_move(&w, 0.01, 0.0027, HALF - 0.02, 0.0, 100);
    CHECK(w.steepest < 1e-6);
    tool_end(&w);
  }
}
