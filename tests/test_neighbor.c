/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Which bodies a pointer may touch before the next sync, where, and what happens when there are
 * more of them than there is room. */

#include <tests/tap.h>

#include <tests/physics_world.h>
#include <tests/solids.h>

#define RADIUS 0.01 /* m, of the pointer */

typedef struct expectation {
  double distance; /* m, surface to surface */
  double normal[3];
  double tolerance;
} expectation;

static void check_contact(const test_world *w, dBodyID body, const expectation *e)
{
  const hapi_contact_slot *contact = world_contact(w, body, 0);
  REQUIRE(contact != NULL);
  double normal[3];
  hapi_v3_copy(contact->normal_body, normal);
  if (body != NULL) {
    double point[3];
    hapi_quat_rotate(dBodyGetQuaternion(body), contact->normal_body, normal);
    hapi_pose_point(dBodyGetPosition(body), dBodyGetQuaternion(body), contact->point_body, point);
    for (int i = 0; i < 3; ++i) {
      CHECK_NEAR(point[i], contact->point_world[i], 1e-12);
    }
  }
  CHECK_NEAR(contact->distance, e->distance, e->tolerance);
  for (int i = 0; i < 3; ++i) {
    CHECK_NEAR(normal[i], e->normal[i], 10.0 * e->tolerance);
  }
}

/* ---- geom classes ---- */

typedef enum shape {
  BOX,
  CONVEX,
  TRIMESH,
  SPHERE,
  CAPSULE,
  CYLINDER,
  SHAPE_COUNT
} shape;

static const char *const shape_names[] = {"box",    "convex",  "trimesh",
                                          "sphere", "capsule", "cylinder"};

/* Each is 0.03 m high above its centre. */
static dGeomID make_geom(dSpaceID space, shape kind)
{
  static box_arrays box;
  static const double half[3] = {0.05, 0.04, 0.03};
  switch (kind) {
    case BOX:
      return dCreateBox(space, 0.1, 0.08, 0.06);
    case CONVEX:
      return convex_box(space, &box, half);
    case TRIMESH:
      return mesh_box(space, &box, half);
    case SPHERE:
      return dCreateSphere(space, 0.03);
    case CAPSULE:
      return dCreateCapsule(space, 0.01, 0.04);
    case CYLINDER:
      return dCreateCylinder(space, 0.05, 0.06);
    case SHAPE_COUNT:
      break;
  }
  return NULL;
}

static void body_tilt(dBodyID body, const double away[3])
{
  const dQuaternion q = {0.8, 0.36, 0.0, 0.48};
  dBodySetQuaternion(body, q);
  dBodySetPosition(body, away[0], away[1], away[2]);
}

/* The pointer is above the top face, in the body's frame, whatever way the body is turned. */
static void check_shape(shape kind, bool turned)
{
  dMass mass;
  const double apart = 0.004;
  double at[3] = {0.003, -0.002, 0.03 + RADIUS + apart};
  expectation e = {apart, {0, 0, 1}, 1e-9};
  if (kind == SPHERE || kind == CAPSULE) {
    at[0] = at[1] = 0.0;
  }
  test_world *w = world_new(0.0, 20);
  dMassSetBoxTotal(&mass, 0.3, 0.1, 0.08, 0.06);
  dBodyID body = world_add(w, make_geom(w->space, kind), &mass, 0, 0, 0);
  if (turned) {
    body_tilt(body, (const double[3]){1.0, -2.0, 0.5});
    hapi_pose_point(dBodyGetPosition(body), dBodyGetQuaternion(body), at, at);
    hapi_quat_rotate(dBodyGetQuaternion(body), e.normal, e.normal);
  }
  printf("# %s%s\n", shape_names[kind], turned ? ", turned" : "");
  world_start(w, RADIUS, at[0], at[1], at[2]);
  check_contact(w, body, &e);
  CHECK(world_count_contacts(w) == 1);
  const hapi_contact_slot *contact = world_contact(w, body, 0);
  CHECK(contact != NULL && world_contact_answer(w, contact)->probed);
  world_close(w);
}

TEST(all_geom_classes_are_found)
{
  for (int kind = 0; kind < SHAPE_COUNT; ++kind) {
    check_shape((shape)kind, false);
    check_shape((shape)kind, true);
  }
}

/* Beside an edge: the nearest point is on it, and the way to it is slanted. */
TEST(edges_of_convex_and_trimesh)
{
  const double s = sqrt(0.5);
  for (int kind = BOX; kind <= TRIMESH; ++kind) {
    dMass mass;
    const double apart = RADIUS + 0.005;
    expectation e = {0.005, {s, 0, s}, 1e-7};
    printf("# %s\n", shape_names[kind]);
    test_world *w = world_new(0.0, 20);
    dMassSetBoxTotal(&mass, 0.3, 0.1, 0.08, 0.06);
    dBodyID body = world_add(w, make_geom(w->space, (shape)kind), &mass, 0, 0, 0);
    world_start(w, RADIUS, 0.05 + s * apart, 0.01, 0.03 + s * apart);
    check_contact(w, body, &e);
    world_close(w);
  }
}

TEST(a_free_trimesh_and_convex_have_the_accelerance_of_their_mass)
{
  for (int kind = CONVEX; kind <= TRIMESH; ++kind) {
    dMass mass;
    test_world *w = world_new(0.0, 20);
    dMassSetBoxTotal(&mass, 0.3, 0.1, 0.08, 0.06);
    dBodyID body = world_add(w, make_geom(w->space, (shape)kind), &mass, 0, 0, 0);
    world_start(w, RADIUS, 0.01, 0.0, 0.03 + RADIUS + 0.002);
    const hapi_contact_slot *contact = world_contact(w, body, 0);
    REQUIRE(contact != NULL);
    for (int i = 0; i < 3; ++i) {
      CHECK_NEAR(world_contact_answer(w, contact)->a[i][i], 1 / 0.3, 1e-9);
    }
    CHECK_NEAR(world_contact_answer(w, contact)->a[4][2], -0.01 / mass.I[5], 1e-6 / mass.I[5]);
    world_close(w);
  }
}

TEST(planes_are_found)
{
  const double n[3] = {0.6, 0.0, 0.8};
  expectation e = {0.003, {0.6, 0.0, 0.8}, 1e-12};
  test_world *w = world_new(0.0, 20);
  dCreatePlane(w->space, n[0], n[1], n[2], 0.25);
  double out = 0.25 + RADIUS + 0.003;
  world_start(w, RADIUS, n[0] * out, 7.0, n[2] * out);
  check_contact(w, NULL, &e);
  CHECK(world_stats(w).model.neighbours == 0); /* static ones are contacts, not neighbours */
}

TEST(geom_offsets_and_several_geoms_of_a_body)
{
  dMass mass;
  expectation e = {0.002, {0, 0, 1}, 1e-9};
  test_world *w = world_new(0.0, 20);
  dMassSetSphereTotal(&mass, 0.3, 0.05);
  dGeomID low = dCreateBox(w->space, 0.1, 0.1, 0.02);
  dBodyID body = world_add(w, low, &mass, 1, 2, 3);
  dGeomID ball = dCreateSphere(w->space, 0.02);
  dGeomSetBody(ball, body);
  dGeomSetOffsetPosition(ball, 0.3, 0.0, 0.1);
  dBodySetQuaternion(body, (const dQuaternion){sqrt(0.5), 0, 0, sqrt(0.5)}); /* x to y */
  world_start(w, RADIUS, 1.0, 2.3, 3.1 + 0.02 + RADIUS + 0.002);
  CHECK(world_count_contacts(w) == 1);
  check_contact(w, body, &e);
}

/* Between two geoms of one body: two contacts, one neighbour. */
TEST(a_body_is_touched_at_two_geoms)
{
  dMass mass;
  test_world *w = world_new(0.0, 20);
  dMassSetSphereTotal(&mass, 0.3, 0.05);
  dBodyID body = world_add(w, dCreateBox(w->space, 0.1, 0.1, 0.02), &mass, 0, 0, 0);
  dGeomID ball = dCreateSphere(w->space, 0.02);
  dGeomSetBody(ball, body);
  dGeomSetOffsetPosition(ball, 0.04, 0, 0.01 + RADIUS + 0.002);
  world_start(w, RADIUS, 0, 0, 0.01 + RADIUS + 0.002);
  CHECK(world_count_contacts(w) == 2);
  CHECK(hapi_neighbors_bodies(&world_physics(w)->near) == 1);
  hapi_physics *physics = world_physics(w);
  double sum = 0.0;
  for (uint32_t i = 0; i < 2; ++i) {
    CHECK(physics->near.slots.contacts[i].phase == HAPI_SLOT_LIVE &&
          physics->probe.answers.contacts[i].probed);
    sum += physics->near.slots.contacts[i].distance;
  }
  CHECK_NEAR(sum, 0.002 + 0.01, 1e-9);
}

/* ---- spaces ---- */

static int pair_calls;

static bool count_pairs(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)io;
  pair_calls += dGeomGetClass(a) == dBoxClass && dGeomGetClass(b) == dBoxClass;
  return true;
}

TEST(nested_spaces_are_searched)
{
  expectation e = {0.002, {0, 0, 1}, 1e-9};
  test_world *w = world_new(0.0, 20);
  dSpaceID inner = dSimpleSpaceCreate(w->space);
  dSpaceID inmost = dHashSpaceCreate(inner);
  dBodyID cube = world_add_cube(w, 0.05, 0.3, 0, 0, 0);
  dGeomID geom = dBodyGetFirstGeom(cube);
  dSpaceRemove(w->space, geom);
  dSpaceAdd(inmost, geom);
  world_start(w, RADIUS, 0, 0, 0.025 + RADIUS + 0.002);
  check_contact(w, cube, &e);
  world_step(w, 2);
  check_contact(w, cube, &e);
  CHECK(world_physics(w)->world.bodies.used == 1);
}

/* Two cubes that touch in a space of their own, with so many things of the outer space around. */
static int pair_calls_a_step(int things)
{
  test_world *w = world_new(0.0, 20);
  dSpaceID inner = dHashSpaceCreate(w->space);
  for (int i = 0; i < 2; ++i) {
    dBodyID cube = world_add_cube(w, 0.05, 0.3, 0.04999 * i, 0, 0);
    dGeomID geom = dBodyGetFirstGeom(cube);
    dSpaceRemove(w->space, geom);
    dSpaceAdd(inner, geom);
  }
  for (int i = 0; i < things; ++i) {
    dGeomID ball = dCreateSphere(w->space, 0.01); /* within the box around both, touching nothing */
    dGeomSetPosition(ball, 0.025, 0.03, 0.02 + 0.001 * i);
  }
  world_create_session(w, count_pairs);
  world_add_pointer(w, RADIUS, 5, 0, 0);
  CHECK(hap_session_start(w->session) == HAP_OK);
  pair_calls = 0;
  CHECK(hap_session_advance(w->session, 51) == HAP_OK);
  int calls = pair_calls;
  return calls;
}

TEST(pairs_in_nested_spaces_collide_once)
{
  CHECK(pair_calls_a_step(0) == 1);
  CHECK(pair_calls_a_step(1) == 1);
  CHECK(pair_calls_a_step(3) == 1);
}

/* ---- reach ---- */

static bool found_at(double distance, double pointer_speed, double body_speed)
{
  test_world *w = world_new(0.0, 20);
  dBodyID cube = world_add_cube(w, 0.05, 0.3, 0, 0, 0);
  dBodySetLinearVel(cube, body_speed, 0, 0);
  double at = 0.025 + RADIUS + distance;
  world_create_session(w, NULL);
  world_add_pointer(w, RADIUS, at, 0, 0);
  world_move_pointer(w, 0, (const double[3]){at, 0, 0}, (const double[3]){-pointer_speed, 0, 0});
  CHECK(hap_session_start(w->session) == HAP_OK);
  bool found = world_contact(w, cube, 0) != NULL;
  return found;
}

/* 5 mm + v H + 15 m/s^2 H^2 at least, and not the whole world. */
TEST(reach_grows_with_speed)
{
  const double still = 0.005 + 15.0 * 0.05 * 0.05;
  CHECK(found_at(still - 1e-3, 0.0, 0.0));
  CHECK(!found_at(3.0 * still, 0.0, 0.0));
  CHECK(found_at(still + 0.05 * 5.0 - 1e-3, 5.0, 0.0));
  CHECK(found_at(still + 0.05 * 5.0 - 1e-3, 0.0, 5.0));
  CHECK(found_at(still + 0.05 * 7.0 - 1e-3, 5.0, 2.0));
  CHECK(!found_at(still + 0.5, 1.0, 2.0));
}

#define SWARM 24
#define SWARM_HAND 2.0 /* m/s */

/* Boxes at random places and velocities under a hand; the loop owns most of them. */
static test_world *open_swarm(unsigned seed)
{
  test_world *w = world_new(0.0, 20);
  const double edges[3] = {0.05, 0.04, 0.03};
  dRandSetSeed(seed);
  for (int i = 0; i < SWARM; ++i) {
    dBodyID body = world_add_box(w, edges, 0.1, dRandReal(), dRandReal(), dRandReal());
    dBodySetLinearVel(body, 4.0 * dRandReal() * dRandReal(), 0, 0);
  }
  w->def.model = HAP_MODEL_CONTACT;
  w->def.physics_hz = 60.0;
  expert_wish(&w->expert, HAP_EFFECT_RANGE, HAP_EFFECT_ON);
  world_create_session(w, NULL);
  world_add_pointer(w, 0.3, 0.5, 0.5, 0.5);
  world_move_pointer(w, 0, AT(0.5, 0.5, 0.5), AT(SWARM_HAND, 0, 0));
  session_run(w->session);
  return w;
}

/* m, between the boxes of two bodies along the axis where it is largest. */
static double swarm_gap(dBodyID a, dBodyID b)
{
  dReal of[2][6];
  double gap = -HUGE_VAL;
  dGeomGetAABB(dBodyGetFirstGeom(a), of[0]);
  dGeomGetAABB(dBodyGetFirstGeom(b), of[1]);
  for (int k = 0; k < 6; k += 2) {
    gap = fmax(gap, fmax(of[0][k] - of[1][k + 1], of[1][k] - of[0][k + 1]));
  }
  return gap;
}

/* Whether the walk meets the other body from an owned one, which the hand may push. */
static bool swarm_meets(const test_world *w, dBodyID owned, dBodyID other)
{
  const double seconds = 2.0 / 60.0;
  double speed = fmax(dBodyGetLinearVel(owned)[0], SWARM_HAND) + dBodyGetLinearVel(other)[0];
  double reach = 0.005 + 1.5 * speed * seconds + 0.5 * 9.81 * seconds * seconds;
  return (world_slot(w, owned)->flags & HAPI_BODY_OWNED) != 0 && swarm_gap(owned, other) <= reach;
}

static int swarm_pairs(const test_world *w, dBodyID a, dBodyID b)
{
  hapi_near *near = world_physics(w)->near.range.near;
  const hapi_near_geom *geoms = hapi_near_geoms(near);
  uint32_t slots[2] = {(uint32_t)(world_slot(w, a) - world_physics(w)->near.slots.bodies),
                       (uint32_t)(world_slot(w, b) - world_physics(w)->near.slots.bodies)};
  int count = 0;
  for (uint32_t i = 0; i < near->pair_count; ++i) {
    const hapi_near_pair *pair = &hapi_near_pairs(near)[i];
    uint32_t of[2] = {geoms[pair->geom_a].body, geoms[pair->geom_b].body};
    count += (of[0] == slots[0] && of[1] == slots[1]) || (of[0] == slots[1] && of[1] == slots[0]);
  }
  return count;
}

/* Whichever of the two the walk comes to first. */
TEST(a_pair_is_in_the_message_once_if_either_body_may_come_to_the_other)
{
  int pairs = 0;
  int one_way = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    test_world *w = open_swarm(seed);
    for (int i = 0; i < SWARM; ++i) {
      for (int k = 0; k < i; ++k) {
        bool there = swarm_meets(w, w->bodies[i], w->bodies[k]);
        bool back = swarm_meets(w, w->bodies[k], w->bodies[i]);
        CHECK(swarm_pairs(w, w->bodies[i], w->bodies[k]) == (there || back));
        pairs += there || back;
        one_way += there != back;
      }
    }
  }
  CHECK(pairs > SWARM && one_way > 3 && one_way < pairs);
}

/* A fast pointer must not pass through between two syncs: contact before it arrives. */
TEST(a_fast_body_is_known_before_it_arrives)
{
  for (int offset = 0; offset < 5; ++offset) {
    test_world *w = world_new(0.0, 20);
    dBodyID cube = world_add_cube(w, 0.05, 0.3, -1.0 - 0.03 * offset, 0, 0);
    dBodySetLinearVel(cube, 3.0, 0, 0);
    world_start(w, RADIUS, 0, 0, 0);
    double impulse = 0.0;
    for (int i = 0; i < 600 && impulse == 0.0; ++i) {
      CHECK(hap_session_advance(w->session, 1) == HAP_OK);
      impulse = world_stats(w).hand.peak_force_n;
    }
    CHECK(impulse > 0.0);
    CHECK(impulse < 10.0); /* the first touch, not one from deep inside: 3 mm a tick, 1 kN/m */
    world_close(w);
  }
}

TEST(disabled_geoms_and_collide_bits)
{
  test_world *w = world_new(0.0, 20);
  dBodyID cubes[3];
  for (int i = 0; i < 3; ++i) {
    cubes[i] = world_add_cube(w, 0.05, 0.3, 0.06 * (i - 1), 0, 0);
    dGeomSetCategoryBits(dBodyGetFirstGeom(cubes[i]), 1ul << i);
  }
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.radius = 1.0;
  def.collide_bits = 1u | 2u;
  world_create_session(w, NULL);
  REQUIRE(hap_pointer_add(w->session, &def, &w->pointers[0]) == HAP_OK);
  w->pointer_count = 1;
  world_move_pointer(w, 0, (const double[3]){0, 0, 1.0 + 0.025 + 0.01}, NULL);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
  CHECK(world_contact(w, cubes[0], 0) != NULL);
  CHECK(world_contact(w, cubes[1], 0) != NULL);
  CHECK(world_contact(w, cubes[2], 0) == NULL);
  dGeomDisable(dBodyGetFirstGeom(cubes[0]));
  world_step(w, 2);
  CHECK(world_contact(w, cubes[0], 0) == NULL);
  CHECK(world_contact(w, cubes[1], 0) != NULL);
  dGeomEnable(dBodyGetFirstGeom(cubes[0]));
  world_step(w, 1);
  CHECK(world_contact(w, cubes[0], 0) != NULL);
}

/* ---- capacity ---- */

#define CROWD 30

/* Free balls along x; the pointer is a plane to them, number i is i mm farther away than the
 * nearest one. */
static test_world *start_crowd(int bodies, int contacts, bool nearest_first)
{
  test_world *w = world_new(0.0, 20);
  w->def.max_bodies = bodies;
  w->def.max_contacts = contacts;
  for (int i = 0; i < CROWD; ++i) {
    int rank = nearest_first ? i : CROWD - 1 - i;
    world_add_sphere(w, 0.01, 0.1, 0.021 * (i - CROWD / 2), 0, -0.0105 - 0.001 * rank);
  }
  world_start(w, 100.0, 0, 0, 100.0 + 0.0005);
  return w;
}

static int count_nearest(const test_world *w, bool nearest_first, int count)
{
  int held = 0;
  for (int rank = 0; rank < count; ++rank) {
    int i = nearest_first ? rank : CROWD - 1 - rank;
    held += world_contact(w, w->bodies[i], 0) != NULL;
  }
  return held;
}

static void check_crowd(int bodies, int contacts, int expected)
{
  for (int order = 0; order < 2; ++order) {
    printf("# %d bodies, %d contacts, %s\n", bodies, contacts, order ? "nearest first" : "last");
    test_world *w = start_crowd(bodies, contacts, order != 0);
    REQUIRE(w != NULL);
    CHECK(world_count_contacts(w) == expected);
    CHECK(count_nearest(w, order != 0, expected) == expected);
    world_step(w, 3);
    CHECK(count_nearest(w, order != 0, expected) == expected);
    CHECK(world_stats(w).model.capacity_dropped > 0);
  }
}

TEST(the_nearest_have_room_first)
{
  check_crowd(4, 256, 4);
  check_crowd(64, 4, 4);
}

/* More geoms in reach than the first pass has places for (8 a contact). */
TEST(the_nearest_is_found_in_a_crowd)
{
  check_crowd(1, 1, 1);
}

/* Full of bodies that stay near, and a nearer one comes. */
static void check_newcomer(int bodies, int contacts)
{
  test_world *w = world_new(0.0, 20);
  w->def.max_bodies = bodies;
  w->def.max_contacts = contacts;
  for (int i = 0; i < 4; ++i) {
    world_add_sphere(w, 0.01, 0.1, 0.03 * i, 0, -0.010 - 0.010);
  }
  dBodyID late = world_add_sphere(w, 0.01, 0.1, -0.03, 0, -1.0);
  world_start(w, 100.0, 0, 0, 100.0);
  world_step(w, 3);
  CHECK(world_count_contacts(w) == 4);
  CHECK(world_contact(w, late, 0) == NULL);
  dBodySetPosition(late, -0.03, 0, -0.010 - 0.002);
  world_step(w, 5);
  CHECK(world_contact(w, late, 0) != NULL);
  CHECK(world_count_contacts(w) == 4);
}

TEST(a_nearer_newcomer_gets_a_place)
{
  printf("# places for bodies\n");
  check_newcomer(4, 256);
  printf("# places for contacts\n");
  check_newcomer(64, 4);
}
