/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* hapode-bench peers: every engine of the build has the same world and gets the same push, and the
 * hand feels the same first force. HAPODE_BENCH: path of the program. */

#include "bench/peers_run.h"
#include "tests/program.h"
#include "tests/tap.h"

#define STEP_S 0.001
#define FLOATS 1e-5 /* relative: most engines count in single precision */

static const peer_setting plain_setting = {STEP_S, 50, false, false};

typedef struct engine_row {
  const char *name; /* of the test */
  const char *engine;
} engine_row;

static const engine_row engine_rows[] = {{"ode_builds_and_pushes", "ode"},
                                         {"bullet_builds_and_pushes", "bullet"},
                                         {"mujoco_builds_and_pushes", "mujoco"},
                                         {"jolt_builds_and_pushes", "jolt"}};

static const peer_engine *engine_of(const engine_row *row)
{
  for (size_t i = 0; peer_engine_at(i) != NULL; ++i) {
    if (strcmp(peer_engine_at(i)->name, row->engine) == 0) {
      return peer_engine_at(i);
    }
  }
  for (size_t i = 0; peer_missing_at(i) != NULL; ++i) {
    if (strncmp(peer_missing_at(i), row->engine, strlen(row->engine)) == 0) {
      SKIP("%s", peer_missing_at(i));
    }
  }
  REQUIRE(false); /* neither there nor told to be missing */
  return NULL;
}

/* ---- the description ---- */

static void world_check(const char *name, int count, double mass)
{
  peer_world world;
  REQUIRE(peer_world_create(name, count, &world));
  CHECK(world.count == (size_t)count);
  CHECK_NEAR(peer_world_mass(&world), mass, 1e-12);
  peer_world_destroy(&world);
}

TEST(worlds_are_as_described)
{
  peer_world world;
  world_check("apart", 10, 2.0);
  world_check("row", 64, 1.0);
  world_check("pile", 30, 2.0);
  world_check("pile", 300, 6.0);
  world_check("carpet", 49, 7.0);
  world_check("tower", 8, 1.6);
  world_check("chain", 10, 1.0);
  world_check("ragdoll", 10, 1.5);
  CHECK(!peer_world_create("row", 0, &world));
  CHECK(!peer_world_create("ragdoll", 11, &world));
  CHECK(!peer_world_create("rows", 10, &world));
  REQUIRE(peer_world_create("mesh", 1, &world));
  CHECK(world.ground.triangle_count >= 100000);
  peer_world_destroy(&world);
}

/* By a closed form: bricks meet, and none is deeper in another one than the layer. */
TEST(boxes_of_a_pile_touch_and_do_not_overlap)
{
  peer_world world;
  REQUIRE(peer_world_create("pile", 64, &world));
  for (size_t i = 0; i < world.count; ++i) {
    int met = 0;
    for (size_t j = 0; j < world.count; ++j) {
      double deep = 1.0;
      for (int k = 0; k < 3; ++k) {
        const peer_box *a = &world.boxes[i];
        const peer_box *b = &world.boxes[j];
        deep = fmin(deep, 0.5 * (a->edges[k] + b->edges[k]) - fabs(a->at[k] - b->at[k]));
      }
      CHECK(i == j || deep < 1.001 * world.layer);
      met += i != j && deep > 0.999 * world.layer;
    }
    CHECK(met >= 2);
  }
  peer_world_destroy(&world);
}

/* k x depth while nothing moves, along the normal, at the face. */
TEST(the_hand_pushes_by_its_spring)
{
  peer_world world;
  peer_reach reach;
  peer_push push;
  double force[3];
  REQUIRE(peer_world_create("apart", 10, &world));
  peer_reach_find(&world, &reach);
  REQUIRE(reach.count == 1 && reach.boxes[0] == 0);
  peer_motion motion = {.quat_wxyz = {1.0}};
  memcpy(motion.position, world.boxes[0].at, sizeof motion.position);
  CHECK(peer_hand_push(&world, &reach, &motion, 0.0, &push, force) == 0);
  CHECK(peer_hand_push(&world, &reach, &motion, 10.0, &push, force) == 1);
  double depth = world.hand.way - 1e-3;
  CHECK_NEAR(force[0], -world.hand.stiffness * depth, 1e-9);
  CHECK_NEAR(push.force[0], -force[0], 0.0);
  CHECK_NEAR(push.point[0], 0.0, 1e-12);
  CHECK_NEAR(push.point[2], world.boxes[0].at[2], 1e-12);
  peer_world_destroy(&world);
}

/* ---- engines ---- */

static void engine_world_check(const peer_engine *engine, const char *name, int count)
{
  peer_world world;
  double mass = 0.0;
  REQUIRE(peer_world_create(name, count, &world));
  void *sim = engine->create(&world, &plain_setting);
  REQUIRE(sim != NULL);
  CHECK(engine->boxes(sim) == (size_t)count);
  for (size_t i = 0; i < world.count; ++i) {
    peer_motion motion;
    engine->read(sim, i, &motion);
    mass += engine->mass(sim, i);
    for (int k = 0; k < 3; ++k) {
      CHECK_NEAR(motion.position[k], world.boxes[i].at[k], FLOATS);
      CHECK_NEAR(motion.linear[k], 0.0, 1e-12);
    }
    CHECK_NEAR(motion.quat_wxyz[0], 1.0, 1e-6);
  }
  CHECK_NEAR(mass, peer_world_mass(&world), FLOATS * mass);
  engine->destroy(sim);
  peer_world_destroy(&world);
}

/* A push on a free box, off its middle: the first step by Newton and Euler. */
static void engine_push_check(const peer_engine *engine)
{
  peer_box box = {{0.05, 0.06, 0.07}, 0.3, {0.1, 0.2, 0.3}};
  peer_world world = {.boxes = &box, .count = 1, .mu = 0.5};
  const peer_push push = {0, {0.075, 0.21, 0.32}, {3.0, 1.0, -2.0}};
  peer_motion motion;
  void *sim = engine->create(&world, &plain_setting);
  REQUIRE(sim != NULL);
  engine->step(sim, &push, 1);
  engine->read(sim, 0, &motion);
  for (int k = 0; k < 3; ++k) {
    int i = (k + 1) % 3;
    int j = (k + 2) % 3;
    double inertia = box.mass / 12.0 * (box.edges[i] * box.edges[i] + box.edges[j] * box.edges[j]);
    double torque =
        (push.point[i] - box.at[i]) * push.force[j] - (push.point[j] - box.at[j]) * push.force[i];
    CHECK_NEAR(motion.linear[k], STEP_S * push.force[k] / box.mass, 1e-5);
    CHECK_NEAR(motion.angular[k], STEP_S * torque / inertia, 1e-4);
  }
  engine->destroy(sim);
}

TEST_EACH(engine_rows, const engine_row *row)
{
  const peer_engine *engine = engine_of(row);
  engine_push_check(engine);
  engine_world_check(engine, "row", 10);
  engine_world_check(engine, "ragdoll", 10);
  engine_world_check(engine, "chain", 10);
  engine_world_check(engine, "mesh", 1);
}

/* What the program's bound holds for as well: a tenth. */
TEST(first_forces_are_alike)
{
  bench b = {.out = "."};
  peer_world world;
  peers_run run;
  peers_run ode;
  const peers_session_setting session = {.physics_hz = 60.0, .haptic_hz = 1000.0};
  REQUIRE(peer_world_create("row", 4, &world));
  REQUIRE(peers_run_engine(&b, &peer_ode, &world, &plain_setting, &ode) >= HAP_OK);
  double wanted = peers_run_first(&world, &ode);
  CHECK(wanted > 0.3 && wanted < 0.7); /* 0.4 N of the spring, and its damper */
  REQUIRE(peers_run_session(&b, &world, &session, &run) >= HAP_OK);
  CHECK_NEAR(peers_run_first(&world, &run), wanted, 0.1 * wanted);
  CHECK(peers_run_error(&run, &ode) < 0.02);
  CHECK(run.parts.contact > 0.0 && run.parts.physics > 0.0);
  CHECK(isnan(ode.parts.contact) && isnan(ode.parts.physics));
  CHECK(run.asleep == 0 && run.us_per_ms > 0.0);
  peers_run_free(&run);
  for (size_t i = 1; peer_engine_at(i) != NULL; ++i) {
    REQUIRE(peers_run_engine(&b, peer_engine_at(i), &world, &plain_setting, &run) >= HAP_OK);
    CHECK_NEAR(peers_run_first(&world, &run), wanted, 0.1 * wanted);
    CHECK(run.asleep == 0);
    peers_run_free(&run);
  }
  peers_run_free(&ode);
  peer_world_destroy(&world);
}

/* Ten bodies, joints, and contacts that slide: 11 and 17 % off while a solve left joints open. */
TEST(a_ragdoll_is_pushed_as_in_the_world_at_every_millisecond)
{
  bench b = {.out = "."};
  peer_world world;
  peers_run ode;
  const peer_setting many = {STEP_S, 1000, false, true};
  REQUIRE(peer_world_create("ragdoll", 10, &world));
  REQUIRE(peers_run_engine(&b, &peer_ode, &world, &many, &ode) >= HAP_OK);
  for (int i = 0; i < 2; ++i) {
    peers_run run;
    const peers_session_setting session = {.physics_hz = i == 0 ? 60.0 : 20.0, .haptic_hz = 1000.0};
    REQUIRE(peers_run_session(&b, &world, &session, &run) >= HAP_OK);
    double error = peers_run_error(&run, &ode);
    printf("# %g Hz: %.1f %% off\n", session.physics_hz, 100.0 * error);
    CHECK(error < 0.09);
    peers_run_free(&run);
  }
  peers_run_free(&ode);
  peer_world_destroy(&world);
}

TEST(boxes_sleep_where_they_may)
{
  bench b = {.out = "."};
  peer_world world;
  peers_run run;
  const peer_setting sleepy = {STEP_S, 10, true, false};
  REQUIRE(peer_world_create("apart", 4, &world));
  world.hand.settle_s = 0.8;
  for (size_t i = 0; peer_engine_at(i) != NULL; ++i) {
    const peer_engine *engine = peer_engine_at(i);
    REQUIRE(peers_run_engine(&b, engine, &world, &sleepy, &run) >= HAP_OK);
    CHECK(run.asleep == (engine->can_sleep ? 4 : 0));
    CHECK(peers_run_peak(&run) > 0.9); /* what the hand meets wakes */
    peers_run_free(&run);
  }
  peer_world_destroy(&world);
}

/* ---- the program ---- */

#define COLUMNS                                                                             \
  "engine,world,bodies,physics_hz,us_per_ms,p99_us,force_rel_rms,force_rel_ode,iterations," \
  "peak_n,rest_mm,asleep,repeats,haptic_hz,tick_us,contact_us,physics_us,truth_floor,"      \
  "force_rel_own\n"

TEST(the_program_leaves_its_table)
{
  folder_clear();
  REQUIRE(run("peers --quick --verify --scene row:4 --out %s", test_folder) == 0);
  CHECK(said_lines("peers: 0 off") == 1);
  const char *text = file_text(folder_path("peers.csv"));
  CHECK(strncmp(text, COLUMNS, strlen(COLUMNS)) == 0);
  CHECK(lines_with(text, "hapode,row,4,60,") == 1);
  CHECK(lines_with(text, "hapode,row,4,20,") == 1);
  for (size_t i = 0; peer_engine_at(i) != NULL; ++i) {
    char begin[64];
    snprintf(begin, sizeof begin, "%s,row,4,1000,", peer_engine_at(i)->name);
    CHECK(lines_with(text, begin) == 1);
  }
  for (size_t i = 0; peer_missing_at(i) != NULL; ++i) {
    CHECK(said_lines(peer_missing_at(i)) == 1);
  }
  CHECK(file_exists(folder_path("peers_trace.csv")));
}

/* Of a row of the table; NaN: there is none. */
static double number_of(const char *row, const char *column)
{
  static const char names[] = COLUMNS;
  const char *end = strstr(names, column);
  for (const char *at = names; at < end; ++at) {
    row = *at == ',' ? strchr(row, ',') + 1 : row;
  }
  char *rest;
  const double value = strtod(row, &rest);
  return rest != row ? value : (double)NAN;
}

/* Four cubes in a row on a floor: their force is known. */
TEST(a_truth_tells_its_floor)
{
  folder_clear();
  REQUIRE(run("peers --quick --scene row:4 --only engine=ode --out %s", test_folder) == 0);
  const char *row = strstr(file_text(folder_path("peers.csv")), "ode,row,4,");
  REQUIRE(row != NULL);
  const double floor = number_of(row, "truth_floor");
  CHECK(floor > 0.0 && floor < 1e-3);
  CHECK(number_of(row, "force_rel_own") == number_of(row, "force_rel_rms"));
}

/* Bricks of a pile share their load as a solver finds it. Against itself a session has what its
 * settings cost alone. */
TEST(a_session_in_a_pile_is_nearer_to_itself_than_to_another_engine)
{
  folder_clear();
  REQUIRE(run("peers --quick --scene pile:10 --only engine=hapode,physics_hz=60 --out %s",
              test_folder) == 0);
  const char *row = strstr(file_text(folder_path("peers.csv")), "hapode,pile,10,60,");
  REQUIRE(row != NULL);
  const double own = number_of(row, "force_rel_own");
  CHECK(own > 1e-5 && own < 0.05);
  CHECK(own < number_of(row, "force_rel_ode"));
}

/* Where bodies say all, every engine agrees with itself, and a session with ODE. */
TEST(the_force_of_a_row_is_sure)
{
  folder_clear();
  REQUIRE(run("spread --quick --verify --scene row:4 --out %s", test_folder) == 0);
  CHECK(said_lines("ok ") == 2 && said_lines("spread: 0 off") == 1);
  const char *text = file_text(folder_path("spread.csv"));
  const char *row = strchr(text, '\n');
  REQUIRE(strncmp(text,
                  "engine,world,bodies,physics_hz,solved,worlds,spread_least,spread_most,"
                  "off_ode,off_own,peak_n\n",
                  91) == 0);
  CHECK(lines_with(text, "hapode,row,4,60,0,3,") == 1);
  CHECK(lines_with(text, "hapode,row,4,20,0,3,") == 1);
  CHECK(lines_with(text, "hapode,row,4,1000,1,3,") == 1);
  CHECK(lines_with(text, "ode,row,4,1000,1,3,") == 2); /* and hapode */
  for (; row != NULL && row[1] != '\0'; row = strchr(row + 1, '\n')) {
    double least;
    double most;
    double off_own;
    double off_ode;
    REQUIRE(sscanf(row + 1, "%*[^,],row,4,%*g,%*d,3,%lf,%lf,%lf,%lf,", &least, &most, &off_ode,
                   &off_own) == 4);
    CHECK(least > 0.0 && least <= most && most < 1e-3);
    CHECK(off_own < 0.02);
    CHECK(row[1] != 'h' || off_ode < 0.02);
  }
  REQUIRE(run("spread --scene row --out %s", test_folder) == 1);
  REQUIRE(run("spread --scene row:1000 --out %s", test_folder) == 1);
  CHECK(run("spread --scene nothing:4 --out %s", test_folder) == 1);
}

/* Half of the pile's friction holds it: bricks stand, and the force is that of the hand's spring
 * alone. Where the range ended among them, bricks sagged before the hand came; where solves ended
 * after two sweeps, they crept by 0.3 mm while it pushed. */
TEST(a_pile_of_300_bricks_does_not_give_way)
{
  bench b = {.out = "."};
  peer_world world;
  peers_run run;
  const peers_session_setting session = {
      .physics_hz = 20.0, .haptic_hz = 1000.0, .range_bodies = 300, .contacts = 24 * 300};
  REQUIRE(peer_world_create("pile", 300, &world));
  const peer_hand *hand = &world.hand;
  double gap = world.boxes[0].at[0] - 0.5 * world.boxes[0].edges[0] - hand->from[0] - hand->radius;
  double stiffest = hand->stiffness * (hand->way - gap);
  REQUIRE(stiffest < 0.5 * world.mu * world.gravity * 300.0 * world.boxes[0].mass);
  REQUIRE(peers_run_session(&b, &world, &session, &run) >= HAP_OK);
  printf("# %zu in the loop, rest %.3f mm, peak %.2f N of %.2f\n", run.owned, 1e3 * run.rest,
         peers_run_peak(&run), stiffest);
  CHECK(run.owned == 300 && !run.cut);
  CHECK(run.rest < 1e-4);
  CHECK_NEAR(peers_run_peak(&run), stiffest, 0.01 * stiffest);
  peers_run_free(&run);
  peer_world_destroy(&world);
}

/* The first force is that of 1 kHz: spring and damper of the hand do not know of ticks. */
TEST(a_hand_of_4_khz_has_the_same_first_force)
{
  bench b = {.out = "."};
  peer_world world;
  peers_run run;
  peers_run ode;
  const peers_session_setting session = {.physics_hz = 60.0, .haptic_hz = 4000.0};
  peer_setting fast = plain_setting;
  fast.step_s = 1.0 / session.haptic_hz;
  REQUIRE(peer_world_create("row", 4, &world));
  REQUIRE(peers_run_engine(&b, &peer_ode, &world, &plain_setting, &ode) >= HAP_OK);
  double wanted = peers_run_first(&world, &ode);
  size_t ticks = ode.count;
  peers_run_free(&ode);
  REQUIRE(peers_run_engine(&b, &peer_ode, &world, &fast, &ode) >= HAP_OK);
  REQUIRE(peers_run_session(&b, &world, &session, &run) >= HAP_OK);
  CHECK(ode.count == 4 * ticks && run.count == 4 * ticks);
  CHECK_NEAR(peers_run_first(&world, &ode), wanted, 0.1 * wanted);
  CHECK_NEAR(peers_run_first(&world, &run), wanted, 0.1 * wanted);
  CHECK(peers_run_error(&run, &ode) < 0.02);
  peers_run_free(&run);
  peers_run_free(&ode);
  peer_world_destroy(&world);
}

TEST(the_program_knows_its_worlds)
{
  CHECK(run("peers --scene rows --out %s", test_folder) == 1);
  CHECK(run("peers --scene row:0 --out %s", test_folder) == 1);
  CHECK(run("peers --scene row:4x --out %s", test_folder) == 1);
  CHECK(run("peers --scene row:4@ --out %s", test_folder) == 1);
  CHECK(run("peers --scene row:4@50 --out %s", test_folder) == 1);
  REQUIRE(run("peers --quick --scene chain:10@4000 --out %s", test_folder) == 0);
  const char *text = file_text(folder_path("peers.csv"));
  CHECK(lines_with(text, "hapode,chain,10,60,") == 1);
  CHECK(lines_with(text, "ode,chain,10,4000,") == 1);
}

SET_UP
{
  return program_use("HAPODE_BENCH");
}
