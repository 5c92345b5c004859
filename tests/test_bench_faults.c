/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench faults: its controls are good, and the reference is what a formula says.
 * HAPODE_BENCH: path of the program. */

#include <math.h>

#include "bench/faults.h"
#include "tests/program.h"
#include "tests/tap.h"

static const faults_scene *scene_find(const char *name)
{
  const faults_scene *scene;
  size_t i = 0;
  while ((scene = faults_scene_at(i)) != NULL && strcmp(scene->name, name) != 0) {
    ++i;
  }
  return scene;
}

/* The hand's spring alone is felt, along z. */
static void check_spring(const char *name)
{
  faults_run run;
  const faults_scene *scene = scene_find(name);
  REQUIRE(scene != NULL && faults_reference_run(scene, 2000.0, &run));
  for (size_t i = 0; i < run.count; ++i) {
    double at[3];
    double velocity[3];
    faults_hand(&scene->motion, FAULTS_TICK_S * (double)i, at, velocity);
    double depth = fmax(scene->motion.radius - at[2], 0.0);
    CHECK(fabs(run.force[i][2] - scene->motion.stiffness * depth) < 1e-9);
    CHECK(fabs(run.force[i][0]) + fabs(run.force[i][1]) < 1e-12);
  }
  faults_run_free(&run);
}

TEST(a_pressed_block_is_felt_as_its_spring)
{
  check_spring("press");
}

/* A sheet of 0.1 mm with the whole finger through it. */
TEST(the_reference_keeps_its_side_of_a_sheet)
{
  check_spring("sheet_0.1mm");
}

/* A free cube of 1 kg: the hand's work is the energy of cube and spring, 7 mJ. What is
 * missing is in proportion to the step. */
TEST(the_reference_keeps_energy)
{
  faults_run run;
  faults_run half;
  const faults_scene *push = scene_find("push");
  REQUIRE(push != NULL && faults_reference_run(push, 4000.0, &run));
  REQUIRE(faults_reference_run(push, 8000.0, &half));
  CHECK(run.energy_off < 6e-5);
  CHECK(half.energy_off < 0.6 * run.energy_off);
  CHECK(run.force[200][0] < -1.0);
  faults_run_free(&run);
  faults_run_free(&half);
}

/* A session against the reference at that rate. Within: 1, share of the force. */
static void check_force(const faults_scene *scene, double physics_hz, double rate_hz, double within)
{
  bench b = {.out = test_folder};
  faults_run reference;
  faults_run run;
  REQUIRE(faults_reference_run(scene, rate_hz, &reference));
  REQUIRE(faults_session_run(&b, scene, physics_hz, &run) >= HAP_OK);
  double off = 0.0;
  double all = 0.0;
  for (size_t i = 0; i < run.count; ++i) {
    for (int j = 0; j < 3; ++j) {
      off += pow(run.force[i][j] - reference.force[i][j], 2);
      all += pow(reference.force[i][j], 2);
    }
  }
  CHECK(all > 0.0 && off < within * within * all);
  faults_run_free(&reference);
  faults_run_free(&run);
}

/* Where session and reference have the same shapes, nothing is left of a fault. */
TEST(the_same_shapes_give_the_same_force)
{
  static const char *const names[] = {"seam_body", "seam_rub", "field_slope", "mesh_box"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; ++k) {
    REQUIRE(scene_find(names[k]) != NULL);
    faults_scene scene = *scene_find(names[k]);
    scene.alike = true;
    check_force(&scene, 60.0, 4000.0, 2e-3);
  }
}

/* A body that is brought to the hand comes in the same tick as in a world of ODE at the rate of the
 * tick: half a tick would be 6 %. */
TEST(what_arrives_is_as_ode_at_the_rate_of_the_tick)
{
  static const char *const names[] = {"belt", "motor_arm"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; ++k) {
    REQUIRE(scene_find(names[k]) != NULL);
    check_force(scene_find(names[k]), 20.0, 1.0 / FAULTS_TICK_S, 2e-3);
    check_force(scene_find(names[k]), 60.0, 1.0 / FAULTS_TICK_S, 2e-3);
  }
}

TEST(the_controls_are_good)
{
  folder_clear();
  REQUIRE(run("faults --verify --scene push --out %s", test_folder) == 0);
  const char *text = file_text(folder_path("faults.csv"));
  CHECK(lines_with(text, "push") == 2);
  CHECK(lines_with(text, ",ok") == 2);
}

TEST(random_worlds_end_no_process)
{
  CHECK(run("faults --verify --random 60") == 0);
  CHECK(said_lines("60 random worlds: 0 ended") == 1);
  CHECK(run("faults --random 0") == 2);
  CHECK(run("faults --random 5 --scene push") == 2);
  CHECK(run("fig5 --random 5") == 2);
}

TEST(a_scene_that_is_not_there_is_refused)
{
  folder_clear();
  CHECK(run("faults --scene nothing --out %s", test_folder) == 1);
}

SET_UP
{
  return program_use("HAPODE_BENCH");
}
