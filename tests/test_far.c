/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Bodies far from all pointers: what is left out for them must not show. */

#include <tests/tap.h>

#include <tests/physics_world.h>

#define RADIUS 0.01 /* m, of the pointer */
#define GEOMS 300
#define ASKED 40

/* ---- questions to a space ---- */

typedef struct answer {
  dGeomID asker;
  dGeomID geoms[GEOMS];
  int count;
} answer;

static void pair_note(void *data, dGeomID a, dGeomID b)
{
  answer *to = data;
  dGeomID geom = a == to->asker ? b : a;
  if (dGeomIsSpace(geom)) {
    dSpaceCollide2(to->asker, geom, data, pair_note);
  } else if (to->count < GEOMS) {
    to->geoms[to->count++] = geom;
  }
}

static double random_uniform(double low, double high)
{
  return low + (high - low) * dRandReal();
}

static void geom_scatter(dGeomID geom)
{
  dGeomSetPosition(geom, random_uniform(-5, 5), random_uniform(-5, 5), random_uniform(-1, 1));
}

/* Some in spaces in the space, switched off, without bits; and a plane, which is everywhere. */
static void fill_space(dSpaceID space, dGeomID geoms[GEOMS])
{
  dSpaceID inner = dHashSpaceCreate(space);
  dSpaceID inmost = dSimpleSpaceCreate(inner);
  dCreatePlane(space, 0, 0, 1, 0);
  for (int i = 0; i < GEOMS - 1; ++i) {
    dSpaceID in = i % 7 == 0 ? inner : i % 11 == 0 ? inmost : space;
    geoms[i] =
        i % 2 == 0 ? dCreateSphere(in, random_uniform(0.01, 0.3)) : dCreateBox(in, 0.1, 0.4, 0.2);
    geom_scatter(geoms[i]);
    if (i % 13 == 0) {
      dGeomDisable(geoms[i]);
    }
    if (i % 17 == 0) {
      dGeomSetCategoryBits(geoms[i], 0);
      dGeomSetCollideBits(geoms[i], 0);
    }
  }
}

static hapi_spaces spaces_of(dSpaceID space)
{
  return (hapi_spaces){.list = {{.space = space}}, .count = 1};
}

/* A round of questions along a way, of which some leave what the round before covered. */
static int ask_round(hapi_cover *cover, dSpaceID space, dGeomID asker, double from)
{
  static answer plain;
  static answer covered;
  int found = 0;
  const hapi_spaces spaces = spaces_of(space);
  const hapi_cover_question question = {&spaces, HAPI_SPACES_ALL, asker};
  hapi_cover_begin(cover);
  for (int i = 0; i < ASKED; ++i) {
    dGeomSetPosition(asker, from + 0.1 * i, random_uniform(-1, 1), 0.0);
    plain = (answer){.asker = asker};
    covered = (answer){.asker = asker};
    hapi_cover_ask(cover, &question, &covered, pair_note);
    dSpaceCollide2(asker, (dGeomID)space, &plain, pair_note);
    CHECK(covered.count == plain.count);
    CHECK(memcmp(covered.geoms, plain.geoms, sizeof plain.geoms) == 0);
    found += plain.count;
  }
  return found;
}

static void check_space(dSpaceID space)
{
  dGeomID geoms[GEOMS];
  hapi_cover cover = {0};
  dGeomID asker = dCreateBox(NULL, 2.0, 2.0, 1.0);
  REQUIRE(hapi_cover_create(&cover));
  fill_space(space, geoms);
  int found = 0;
  for (int round = 0; round < 6; ++round) {
    found += ask_round(&cover, space, asker, -5.0 + round);
    for (int i = round; i < GEOMS - 1; i += 3) {
      geom_scatter(geoms[i]);
    }
  }
  CHECK(found > 6 * ASKED * 2);
  hapi_cover_finish(&cover);
  dGeomDestroy(asker);
  dSpaceDestroy(space);
}

TEST(many_questions_are_answered_as_ode_answers_each)
{
  const dVector3 center = {0, 0, 0, 0};
  const dVector3 extents = {8, 8, 8, 0};
  dRandSetSeed(7);
  printf("# hash space\n");
  check_space(dHashSpaceCreate(NULL));
  printf("# simple space\n");
  check_space(dSimpleSpaceCreate(NULL));
  printf("# sweep and prune\n");
  check_space(dSweepAndPruneSpaceCreate(NULL, dSAP_AXES_XYZ));
  printf("# quadtree\n");
  check_space(dQuadTreeSpaceCreate(NULL, center, extents, 4));
}

/* What the list is for: the space itself is asked a few times in a round, once in the next one. */
TEST(a_round_asks_the_space_seldom)
{
  dSpaceID space = dHashSpaceCreate(NULL);
  dGeomID asker = dCreateBox(NULL, 0.1, 0.1, 0.1);
  hapi_cover cover = {0};
  static answer got;
  int fills[2] = {0, 0};
  const hapi_spaces spaces = spaces_of(space);
  const hapi_cover_question question = {&spaces, HAPI_SPACES_ALL, asker};
  REQUIRE(hapi_cover_create(&cover));
  for (int round = 0; round < 2; ++round) {
    hapi_cover_begin(&cover);
    for (int i = 0; i < 64; ++i) {
      dReal before[6];
      dReal after[6];
      got = (answer){.asker = asker};
      dGeomSetPosition(asker, 0.1 * i, 0, 0);
      dGeomGetAABB(cover.box_geom, before);
      hapi_cover_ask(&cover, &question, &got, pair_note);
      dGeomGetAABB(cover.box_geom, after);
      fills[round] += memcmp(before, after, sizeof after) != 0;
    }
  }
  printf("# %d and %d times\n", fills[0], fills[1]);
  CHECK(fills[0] >= 1 && fills[0] <= 8);
  CHECK(fills[1] == 1);
  hapi_cover_finish(&cover);
  dGeomDestroy(asker);
  dSpaceDestroy(space);
}

/* ---- what an application does to bodies that are far ---- */

#define FAR_BODIES 40

/* One cube under the pointer, the others in the distance, awake and spinning a little. */
static test_world *open_far(void)
{
  test_world *w = world_new(0.0, 20);
  world_add_cube(w, 0.05, 0.3, 0, 0, 0);
  for (int i = 1; i < FAR_BODIES; ++i) {
    dBodyID body = world_add_sphere(w, 0.02, 0.1, 3.0 + i, 0, 0);
    dBodySetAngularVel(body, 0, 0, 0.5);
  }
  w->def.model = HAP_MODEL_CONTACT;
  world_start(w, RADIUS, 0, 0, 0.025 + RADIUS + 0.002);
  world_step(w, 3);
  return w;
}

static const hapi_known_body *known_of(const test_world *w, dBodyID body)
{
  const hapi_body_table *table = &world_physics(w)->world.bodies;
  return &table->entries[hapi_bodies_find(table, body)];
}

TEST(a_far_body_that_grows_is_measured_at_the_next_step)
{
  test_world *w = open_far();
  for (int i = 1; i < FAR_BODIES; ++i) {
    CHECK_NEAR(known_of(w, w->bodies[i])->extent, sqrt(3.0) * 0.02, 1e-12);
    dGeomSphereSetRadius(dBodyGetFirstGeom(w->bodies[i]), 0.02 + 0.01 * i);
    world_step(w, 1);
    CHECK_NEAR(known_of(w, w->bodies[i])->extent, sqrt(3.0) * (0.02 + 0.01 * i), 1e-9);
  }
  dGeomID second = dCreateSphere(w->space, 0.02);
  dGeomSetBody(second, w->bodies[1]);
  dGeomSetOffsetPosition(second, 0.0, 0.0, 2.0);
  world_step(w, 1);
  CHECK(known_of(w, w->bodies[1])->extent > 2.0);
}

TEST(the_fastest_of_all_bodies_sets_the_reach)
{
  test_world *w = open_far();
  const hapi_neighbors *hood = &world_physics(w)->near.neighbors;
  dBodySetLinearVel(w->bodies[FAR_BODIES / 2], 0, 3.0, 0);
  world_step(w, 1);
  CHECK(hood->fastest > 3.0 && hood->fastest < 3.1);
  dBodyDisable(w->bodies[FAR_BODIES / 2]);
  dBodySetLinearVel(w->bodies[0], 0, 0, -2.0); /* away from the pointer */
  world_step(w, 1);
  CHECK(hood->fastest > 1.9 && hood->fastest < 2.1);
}

static bool cube_stands(test_world *w)
{
  uint64_t before = world_stats(w).physics.steps;
  CHECK(hap_session_advance(w->session, 50) == HAP_FAULTED);
  return world_stats(w).physics.steps == before && world_physics(w)->world_faulty;
}

static void go_on(test_world *w)
{
  uint64_t before = world_stats(w).physics.steps;
  (void)hap_session_advance(w->session, 50);
  CHECK(world_stats(w).physics.steps > before);
  CHECK(!world_physics(w)->world_faulty);
  CHECK(hap_session_reset_fault(w->session) == HAP_OK);
  CHECK(hap_session_advance(w->session, 50) == HAP_OK);
}

/* Asleep as well as awake, near as well as far. */
TEST(a_bad_body_is_kept_from_ode_wherever_it_is)
{
  const double nan = (double)NAN;
  const int which[] = {0, 1, FAR_BODIES / 2, FAR_BODIES - 1};
  test_world *w = open_far();
  for (int i = 0; i < 8; ++i) {
    dBodyID body = w->bodies[which[i % 4]];
    if (i >= 4) {
      dBodyDisable(body);
    }
    dBodySetLinearVel(body, nan, 0, 0);
    CHECK(cube_stands(w));
    CHECK(cube_stands(w));
    dBodySetLinearVel(body, 0, 0, 0);
    dBodySetAngularVel(body, 0, 0, 0);
    go_on(w);
  }
}

/* Of a body and of none; a body with its only geom, and one whose other geom is good. */
TEST(a_bad_geom_keeps_the_world_from_being_stepped_until_it_is_set_right)
{
  test_world *w = open_far();
  dGeomID ground = dCreateBox(w->space, 1, 1, 1);
  dGeomSetPosition(ground, 0, 100, 0);
  dGeomID extra = dCreateSphere(w->space, 0.02);
  dGeomSetBody(extra, w->bodies[2]);
  dGeomID geoms[] = {dBodyGetFirstGeom(w->bodies[FAR_BODIES - 1]), dBodyGetFirstGeom(w->bodies[0]),
                     extra};
  world_step(w, 2);
  for (int i = 0; i < 3; ++i) {
    dGeomSetOffsetPosition(geoms[i], 0, 0, (double)NAN);
    CHECK(cube_stands(w));
    CHECK(cube_stands(w)); /* nothing has changed since, and it is no better */
    dGeomSetOffsetPosition(geoms[i], 0, 0, 0);
    go_on(w);
  }
  dGeomSetPosition(ground, (double)NAN, 0, 0);
  CHECK(cube_stands(w));
  CHECK(cube_stands(w));
  dGeomSetPosition(ground, 0, 100, 0);
  go_on(w);
}

/* The geom's size is spoiled while its body's pose is none, and the pose alone is set right. */
TEST(a_bad_geom_is_found_behind_a_bad_pose)
{
  test_world *w = open_far();
  dBodyID body = w->bodies[FAR_BODIES - 2];
  dBodySetPosition(body, (double)NAN, 0, 0);
  dGeomSetOffsetPosition(dBodyGetFirstGeom(body), 0, 0, (double)NAN);
  CHECK(cube_stands(w));
  dBodySetPosition(body, 50, 0, 0);
  CHECK(cube_stands(w));
  dGeomSetOffsetPosition(dBodyGetFirstGeom(body), 0, 0, 0);
  go_on(w);
}

/* ---- which bodies there are ---- */

static void check_table(const test_world *w, int count)
{
  const hapi_body_table *table = &world_physics(w)->world.bodies;
  CHECK(table->used == (uint32_t)count);
  for (int i = 0; i < w->body_count; ++i) {
    uint32_t index = w->bodies[i] != NULL ? hapi_bodies_find(table, w->bodies[i]) : HAPI_NONE;
    CHECK((index != HAPI_NONE) == (w->bodies[i] != NULL));
    CHECK(index == HAPI_NONE || table->entries[index].seen == table->scan);
  }
}

static void destroy_body(test_world *w, int i)
{
  dGeomDestroy(dBodyGetFirstGeom(w->bodies[i]));
  dBodyDestroy(w->bodies[i]);
  w->bodies[i] = NULL;
}

/* Each changes the order in which the scan meets the bodies, or leaves out one that it expects. */
TEST(the_scan_follows_whatever_the_order_becomes)
{
  int count = FAR_BODIES;
  test_world *w = open_far();
  dRandSetSeed(3);
  for (int round = 0; round < 12; ++round) {
    for (int k = 0; k < 6; ++k) {
      int i = 1 + dRandInt(FAR_BODIES - 1);
      if (w->bodies[i] != NULL) {
        dGeomID geom = dBodyGetFirstGeom(w->bodies[i]);
        dSpaceRemove(w->space, geom);
        dSpaceAdd(w->space, geom);
        (dRandInt(2) != 0 ? dBodyDisable : dBodyEnable)(w->bodies[i]);
      }
    }
    int gone = 1 + 3 * round;
    destroy_body(w, gone);
    --count;
    if (round % 3 == 0) {
      world_add_sphere(w, 0.02, 0.1, 60.0 + round, 0, 0);
      ++count;
    }
    CHECK(hap_session_advance(w->session, 50) == HAP_BODY_LOST);
    check_table(w, count);
  }
  CHECK(world_stats(w).faults.bodies_lost == 12);
}

TEST(a_far_chain_without_geoms_is_known_by_its_joints)
{
  test_world *w = open_far();
  dMass mass;
  dMassSetSphereTotal(&mass, 0.1, 0.02);
  for (int i = 0; i < 3; ++i) {
    dBodyID before = w->bodies[w->body_count - 1];
    const dReal *at = dBodyGetPosition(before);
    dBodyID body = world_add(w, NULL, &mass, at[0] + 0.1, at[1], at[2]);
    dJointID joint = dJointCreateBall(w->world, NULL);
    dJointAttach(joint, before, body);
    dJointSetBallAnchor(joint, at[0] + 0.05, at[1], at[2]);
  }
  world_step(w, 1);
  check_table(w, FAR_BODIES + 3);
  dBodySetLinearVel(w->bodies[FAR_BODIES + 2], (double)NAN, 0, 0);
  CHECK(cube_stands(w));
  dBodySetLinearVel(w->bodies[FAR_BODIES + 2], 0, 0, 0);
  go_on(w);
}
