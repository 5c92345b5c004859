/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A and b of eq. 2-6 against closed forms and against other solvers, the number of testing
 * simulations, and who is left out of them. */

#include <stdarg.h>

#include <tests/tap.h>

#include <tests/body_bits.h>
#include <tests/physics_world.h>

#define EDGE 0.05    /* m */
#define OVERLAP 1e-6 /* m: touching, within the layer where nothing is pushed out */
#define GAP 5e-4     /* m, from the pointer to the body */
#define GRAVITY 9.81 /* m/s^2 */
#define PROBE_STEP 0.05

static int far_moves;

static void count_far(dBodyID body)
{
  (void)body;
  ++far_moves;
}

/* ---- measuring ---- */

/* Planes are smooth, what else there is has the world's mu. */
static bool smooth_planes(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  test_world *w = user;
  bool plane = dGeomGetClass(a) == dPlaneClass || dGeomGetClass(b) == dPlaneClass;
  io->mu = plane ? 0.0 : w->mu;
  return true;
}

static void start_at(test_world *w, hap_surface_fn surface, const double at[3])
{
  world_create_session(w, surface);
  world_add_pointer(w, 0.01, at[0], at[1], at[2]);
  session_run(w->session);
}

static uint64_t world_probe(test_world *w)
{
  uint64_t before = world_physics(w)->probe.test.steps;
  world_measure(w);
  return world_physics(w)->probe.test.steps - before;
}

/* Measures with a last force of this size along -z, as if the pointer had pushed with it. */
static hapi_contact_slot *measure_contact(test_world *w, dBodyID body, double force)
{
  hapi_contact_slot *contact = world_contact(w, body, 0);
  REQUIRE(contact != NULL);
  hapi_v3_set(contact->last_touch.force, 0.0, 0.0, -force);
  world_probe(w);
  return contact;
}

/* ---- a free body ---- */

static void inertia_inverse(dBodyID body, const double inertia[3], const double torque[3],
                            double out[3])
{
  double local[3];
  hapi_quat_unrotate(dBodyGetQuaternion(body), torque, local);
  for (int i = 0; i < 3; ++i) {
    local[i] /= inertia[i];
  }
  hapi_quat_rotate(dBodyGetQuaternion(body), local, out);
}

static void check_free_column(const test_world *w, const hapi_contact_slot *contact, dBodyID body,
                              double mass, const double inertia[3], int axis)
{
  const hapi_contact_answer *answer = world_contact_answer(w, contact);
  double force[3] = {0.0, 0.0, 0.0};
  double arm[3];
  double torque[3];
  double angular[3];
  force[axis] = 1.0;
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
  CHECK(hapi_v3_norm(arm) > 0.02);
  hapi_v3_cross(arm, force, torque);
  inertia_inverse(body, inertia, torque, angular);
  for (int i = 0; i < 3; ++i) {
    CHECK_NEAR(answer->a[i][axis], force[i] / mass, 1e-9 / mass);
    CHECK_NEAR(answer->a[3 + i][axis], angular[i], 1e-9 * 0.05 / inertia[0]);
  }
}

TEST(free_body_has_its_closed_form)
{
  const double mass = 0.4;
  const double inertia[3] = {3e-4, 7e-4, 9e-4};
  dMass m;
  dQuaternion turn = {0.8, 0.3, -0.2, 0.4};
  test_world *w = world_new(GRAVITY, 20);
  dMassSetParameters(&m, mass, 0, 0, 0, inertia[0], inertia[1], inertia[2], 0, 0, 0);
  dBodyID body = world_add(w, dCreateBox(w->space, 0.1, 0.05, 0.04), &m, 1.0, 2.0, 3.0);
  dBodySetQuaternion(body, turn);
  start_at(w, NULL, (const double[3]){0.97, 1.98, 3.05});
  for (int i = 0; i < 3; ++i) {
    const double forces[3] = {0.0, 0.7, 30.0};
    const hapi_contact_slot *contact = measure_contact(w, body, forces[i]);
    for (int axis = 0; axis < 3; ++axis) {
      check_free_column(w, contact, body, mass, inertia, axis);
    }
  }
  const hapi_body_slot *slot = world_slot(w, body);
  REQUIRE(slot != NULL);
  for (int i = 0; i < 6; ++i) {
    CHECK_NEAR(world_answer(w, slot)->b[i], i == 2 ? -GRAVITY : 0.0, 1e-9);
  }
}

/* ---- cases with a closed form, and two other solvers ---- */

typedef struct probe_case {
  const char *name;
  void (*build)(test_world *w);
  double gravity;
  double pointer[3];
  int body;
  int axis;
  int row;
  double force; /* N */
  double expected;
  double tolerance; /* relative */
} probe_case;

static void build_row(test_world *w, int count)
{
  w->mu = 0.0;
  for (int i = 0; i < count; ++i) {
    world_add_cube(w, EDGE, 0.5, EDGE / 2 + i * (EDGE - OVERLAP), 0, 0);
  }
}

static void build_row1(test_world *w)
{
  build_row(w, 1);
}

static void build_row2(test_world *w)
{
  build_row(w, 2);
}

static void build_row5(test_world *w)
{
  build_row(w, 5);
}

static void build_row10(test_world *w)
{
  build_row(w, 10);
}

/* The lower one is pushed at the height of the centre of both, so that nothing tips. */
static void build_stack(test_world *w)
{
  w->mu = dInfinity;
  dCreatePlane(w->space, 0, 0, 1, 0);
  world_add_cube(w, 0.1, 1.0, 0.05, 0, 0.05 - OVERLAP);
  world_add_cube(w, 0.1, 0.5, 0.05, 0, 0.15 - 2 * OVERLAP);
}

static void build_glued(test_world *w)
{
  w->mu = 0.0;
  world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, 0);
  world_add_cube(w, EDGE, 0.25, 1.5 * EDGE, 0, 0);
  dJointID joint = dJointCreateFixed(w->world, NULL);
  dJointAttach(joint, w->bodies[0], w->bodies[1]);
  dJointSetFixed(joint);
}

static void build_door(test_world *w)
{
  world_add_box(w, (const double[3]){0.3, 0.02, 0.3}, 1.0, 0.15, 0, 0);
  dJointID hinge = dJointCreateHinge(w->world, NULL);
  dJointAttach(hinge, w->bodies[0], NULL);
  dJointSetHingeAnchor(hinge, 0, 0, 0);
  dJointSetHingeAxis(hinge, 0, 0, 1);
}

#define DOOR_I (1.0 / 12.0 * (0.3 * 0.3 + 0.02 * 0.02) + 0.15 * 0.15)
#define ROW_AT        \
  {                   \
    -0.01 - GAP, 0, 0 \
  }
#define DOOR_AT          \
  {                      \
    0.24, -0.02 - GAP, 0 \
  }
#define STACK_AT             \
  {                          \
    -0.01 - GAP, 0, 0.25 / 3 \
  }

static const probe_case cases[] = {
    {"row of 1", build_row1, 0, ROW_AT, 0, 0, 0, 3.0, 1 / 0.5, 1e-6},
    {"row of 2", build_row2, 0, ROW_AT, 0, 0, 0, 3.0, 1 / 1.0, 1e-6},
    {"row of 5", build_row5, 0, ROW_AT, 0, 0, 0, 3.0, 1 / 2.5, 1e-6},
    {"row of 10", build_row10, 0, ROW_AT, 0, 0, 0, 3.0, 1 / 5.0, 1e-6},
    {"stack", build_stack, GRAVITY, STACK_AT, 0, 0, 0, 0.5, 1 / 1.5, 1e-6},
    {"glued pair", build_glued, 0, ROW_AT, 0, 0, 0, 3.0, 1 / 0.75, 1e-6},
    {"door, speed", build_door, 0, DOOR_AT, 0, 1, 1, 2.0, 0.15 * 0.24 / DOOR_I, 1e-6},
    {"door, turn", build_door, 0, DOOR_AT, 0, 1, 5, 2.0, 0.24 / DOOR_I, 1e-6},
    {"door, along", build_door, 0, DOOR_AT, 0, 0, 5, 2.0, 0.01 / DOOR_I, 1e-6},
};

static const size_t case_count = sizeof cases / sizeof cases[0];

static double library_answer(const probe_case *c, int iterations)
{
  test_world *w = world_new(c->gravity, iterations);
  c->build(w);
  start_at(w, smooth_planes, c->pointer);
  const hapi_contact_slot *contact = measure_contact(w, w->bodies[c->body], c->force);
  return world_contact_answer(w, contact)->a[c->row][c->axis];
}

static void check_case(const probe_case *c, int iterations, double tolerance)
{
  double answer = library_answer(c, iterations);
  double error = fabs(answer / c->expected - 1.0);
  printf("# %s, %d iterations: %.9g, closed form %.9g, off by %.2g\n", c->name, iterations, answer,
         c->expected, error);
  CHECK_NEAR(answer / c->expected, 1.0, tolerance);
}

TEST(closed_forms_with_1000_iterations)
{
  for (size_t i = 0; i < case_count; ++i) {
    check_case(&cases[i], 1000, cases[i].tolerance);
  }
}

TEST(closed_forms_with_200_iterations)
{
  for (size_t i = 0; i < case_count; ++i) {
    check_case(&cases[i], 200, 10.0 * cases[i].tolerance);
  }
}

/* ---- the oracles, in plain ODE ---- */

static dJointGroupID oracle_group;
static int messages;

static void count_message(int number, const char *text, va_list arguments)
{
  (void)number;
  (void)text;
  (void)arguments;
  ++messages;
}

static void oracle_near(void *user, dGeomID a, dGeomID b)
{
  test_world *w = user;
  dContact contacts[8];
  dSurfaceParameters surface = {.mode = dContactApprox1, .mu = dInfinity};
  smooth_planes(w, a, b, &surface);
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = surface;
    dJointAttach(dJointCreateContact(w->world, oracle_group, &contacts[i]), dGeomGetBody(a),
                 dGeomGetBody(b));
  }
}

/* Change of the body's velocity over one step of a fresh world, divided by the step. */
static double oracle_acceleration(const probe_case *c, bool exact, double force)
{
  double push[3] = {0.0, 0.0, 0.0};
  double at[3];
  test_world *w = world_new(c->gravity, 5000);
  c->build(w);
  dBodyID body = w->bodies[c->body];
  push[c->axis] = force;
  hapi_v3_copy(c->pointer, at);
  at[c->row == 0 ? 0 : 1] += 0.01 + GAP; /* to the face */
  if (c->build == build_door) {
    hapi_v3_set(at, c->pointer[0], -0.01, 0.0);
  }
  oracle_group = dJointGroupCreate(0);
  dRandSetSeed(0);
  dSpaceCollide(w->space, w, oracle_near);
  dBodyAddForceAtPos(body, push[0], push[1], push[2], at[0], at[1], at[2]);
  if (exact) {
    dWorldStep(w->world, PROBE_STEP);
  } else {
    dWorldQuickStep(w->world, PROBE_STEP);
  }
  const dReal *v = c->row < 3 ? dBodyGetLinearVel(body) : dBodyGetAngularVel(body);
  double result = v[c->row % 3] / PROBE_STEP;
  dJointGroupDestroy(oracle_group);
  return result;
}

static double accelerance_oracle(const probe_case *c, bool exact, double force)
{
  double base = oracle_acceleration(c, exact, 0.0);
  return (oracle_acceleration(c, exact, force) - base) / force;
}

TEST(two_of_three_oracles_agree)
{
  dMessageFunction *before = dGetMessageHandler();
  messages = 0;
  dSetMessageHandler(count_message);
  for (size_t i = 0; i < case_count; ++i) {
    const probe_case *c = &cases[i];
    double exact = accelerance_oracle(c, true, 1e-2) / c->expected;
    double quick = accelerance_oracle(c, false, c->force) / c->expected;
    int agree =
        (fabs(exact - 1.0) < 1e-6) + (fabs(quick - 1.0) < 1e-6) + (fabs(exact - quick) < 1e-6);
    printf("# %s: exact %.9g, quick %.9g of the closed form\n", c->name, exact, quick);
    CHECK(agree >= 1);
  }
  dSetMessageHandler(before);
  printf("# %d messages of the exact solver\n", messages);
}

/* ---- cube on a floor: the secant ---- */

typedef struct secant_row {
  double mass;
  double mu;
  double force;
  char direction[8];
  double expected;
} secant_row;

/* Eq. 4 perturbs along +x, +y, +z. For a push down the world stands on its head. */
static double accelerance_secant(const secant_row *row)
{
  bool along = strcmp(row->direction, "x") == 0;
  double up = strcmp(row->direction, "down") == 0 ? -1.0 : 1.0;
  double height = along ? EDGE / 2 : EDGE + 0.01 + GAP;
  test_world *w = world_new(up * GRAVITY, 1000);
  w->mu = row->mu;
  dCreatePlane(w->space, 0, 0, up, 0);
  world_add_cube(w, EDGE, row->mass, 0, 0, up * (EDGE / 2 - OVERLAP));
  const double at[3] = {along ? -EDGE / 2 - 0.01 - GAP : 0.0, 0.0, up * height};
  start_at(w, NULL, at);
  const hapi_contact_slot *contact = measure_contact(w, w->bodies[0], row->force);
  return world_contact_answer(w, contact)->a[along ? 0 : 2][along ? 0 : 2];
}

static int check_secants(FILE *file)
{
  char line[256];
  int rows = 0;
  while (fgets(line, sizeof line, file) != NULL) {
    secant_row row;
    if (sscanf(line, "cube_on_floor,%lf,%lf,%lf,%7[a-z],%lf", &row.mass, &row.mu, &row.force,
               row.direction, &row.expected) != 5) {
      continue;
    }
    double answer = accelerance_secant(&row);
    printf("# %g N %s, mu %g: %.4f, oracle %.3f\n", row.force, row.direction, row.mu, answer,
           row.expected);
    CHECK_NEAR(answer, row.expected, 0.01);
    ++rows;
  }
  return rows;
}

TEST(cube_on_a_floor_follows_the_secant)
{
  char path[400];
  const char *shared = getenv("HAPODE_SHARED");
  snprintf(path, sizeof path, "%s/oracles/secant.csv", shared != NULL ? shared : "../shared");
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    SKIP("no %s", path);
  }
  CHECK(check_secants(file) == 8);
  fclose(file);
}

/* ---- b ---- */

static void push_first(void *user, double step_s)
{
  test_world *w = user;
  (void)step_s;
  dBodyAddForce(w->bodies[0], 0.02, 0.0, 0.0);
  dBodyAddTorque(w->bodies[0], 0.0, 0.0, 1e-6);
}

TEST(b_of_a_resting_body_is_zero)
{
  test_world *w = world_new(GRAVITY, 1000);
  dCreatePlane(w->space, 0, 0, 1, 0);
  dBodyID cube = world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, EDGE / 2 - OVERLAP);
  start_at(w, NULL, (const double[3]){-0.01 - GAP, 0, EDGE / 2});
  const hapi_body_slot *slot = world_slot(w, cube);
  REQUIRE(slot != NULL);
  for (int i = 0; i < 6; ++i) {
    CHECK_NEAR(world_answer(w, slot)->b[i], 0.0, 1e-6);
  }
}

TEST(b_holds_the_forces_of_before_step)
{
  test_world *w = world_new(0.0, 20);
  dBodyID cube = world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, 0);
  dMass mass;
  dBodyGetMass(cube, &mass);
  w->before_step = push_first;
  start_at(w, NULL, (const double[3]){-0.01 - GAP, 0, 0});
  world_step(w, 2);
  const hapi_body_slot *slot = world_slot(w, cube);
  REQUIRE(slot != NULL);
  CHECK_NEAR(world_answer(w, slot)->b[0], 0.02 / 0.5, 1e-12);
  CHECK_NEAR(world_answer(w, slot)->b[5], 1e-6 / mass.I[0], 1e-9);
  CHECK(dBodyGetForce(cube)[0] == 0.0); /* probes left nothing behind */
}

/* ---- how many ---- */

static test_world *open_count(hap_probe probe)
{
  test_world *w = world_new(0.0, 20);
  w->research.probe = probe;
  far_moves = 0;
  return w;
}

/* A large pointer above what lies in the plane z = 0. */
static void start_above(test_world *w)
{
  world_create_session(w, NULL);
  world_add_pointer(w, 1.0, 0.075, 0.0, 1.0 + EDGE / 2 + 0.005);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
}

/* However they are shared out, every contact has its columns. */
static void check_all_measured(const test_world *w)
{
  const hapi_physics *physics = world_physics(w);
  for (uint32_t i = 0; i < physics->config.capacity.contacts; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[i];
    bool moves = contact->phase == HAPI_SLOT_LIVE && contact->body != HAPI_SLOT_NONE &&
                 physics->near.slots.bodies[contact->body].mass > 0.0;
    const hapi_contact_answer *answer = &physics->probe.answers.contacts[i];
    for (int axis = 0; axis < 3 && moves; ++axis) {
      CHECK(answer->probed && answer->a[axis][axis] > 0.1);
    }
  }
}

static uint64_t count_probes(void (*build)(test_world *w), hap_probe probe, int contacts)
{
  test_world *w = open_count(probe);
  build(w);
  start_above(w);
  CHECK(world_count_contacts(w) == contacts);
  uint64_t probes = world_probe(w);
  check_all_measured(w);
  uint64_t before = world_physics(w)->probe.test.steps;
  CHECK(hap_session_advance(w->session, 51) == HAP_OK); /* to the first step, which is in it */
  hap_stats after = world_stats(w);
  CHECK(after.physics.steps == 1);
  CHECK(after.probes.steps == before + probes);
  CHECK(after.physics.quickstep_calls == after.probes.steps + 1);
  return probes;
}

static void build_touching(test_world *w)
{
  build_row(w, 3);
}

static void build_apart(test_world *w)
{
  for (int i = 0; i < 3; ++i) {
    world_add_cube(w, EDGE, 0.5, EDGE / 2 + i * 1.5 * EDGE, 0, 0);
  }
}

static void build_mixed(test_world *w)
{
  build_row(w, 3);
  world_add_cube(w, EDGE, 0.5, EDGE / 2, 2 * EDGE, 0);
}

static void build_unmoved(test_world *w)
{
  dBodyID driven = world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, 0);
  dBodySetKinematic(driven);
  dGeomID fixed = dCreateBox(w->space, EDGE, EDGE, EDGE);
  dGeomSetPosition(fixed, 2 * EDGE, 0, 0);
}

static void build_nothing(test_world *w)
{
  world_add_cube(w, EDGE, 0.5, 5.0, 0, 0);
}

TEST(counts_of_testing_simulations)
{
  CHECK(count_probes(build_touching, HAP_PROBE_SHARED, 3) == 1 + 3 * 3);
  CHECK(count_probes(build_touching, HAP_PROBE_PAPER, 3) == 4 * 3);
  CHECK(count_probes(build_apart, HAP_PROBE_SHARED, 3) == 1 + 3 * 1);
  CHECK(count_probes(build_apart, HAP_PROBE_PAPER, 3) == 4 * 3);
  CHECK(count_probes(build_mixed, HAP_PROBE_SHARED, 4) == 1 + 3 * 3);
  CHECK(count_probes(build_unmoved, HAP_PROBE_SHARED, 2) == 0);
  CHECK(count_probes(build_unmoved, HAP_PROBE_PAPER, 2) == 0);
  CHECK(count_probes(build_nothing, HAP_PROBE_SHARED, 0) == 0);
}

TEST(two_pointers_on_one_body)
{
  test_world *w = world_new(0.0, 20);
  dBodyID cube = world_add_cube(w, EDGE, 0.5, 0, 0, 0);
  world_create_session(w, NULL);
  world_add_pointer(w, 0.01, -EDGE / 2 - 0.01 - GAP, 0.01, 0);
  world_add_pointer(w, 0.01, EDGE / 2 + 0.01 + GAP, -0.02, 0);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
  CHECK(world_probe(w) == 1 + 6);
  const hapi_contact_slot *one = world_contact(w, cube, 0);
  const hapi_contact_slot *two = world_contact(w, cube, 1);
  REQUIRE(one != NULL && two != NULL);
  dMass mass;
  dBodyGetMass(cube, &mass);
  CHECK_NEAR(world_contact_answer(w, one)->a[5][0], -0.01 / mass.I[10], 1e-6 / mass.I[10]);
  CHECK_NEAR(world_contact_answer(w, two)->a[5][0], 0.02 / mass.I[10], 1e-6 / mass.I[10]);
}

TEST(ways_of_probing_agree)
{
  double a[2][6][3];
  for (int k = 0; k < 2; ++k) {
    test_world *w = open_count(k == 0 ? HAP_PROBE_SHARED : HAP_PROBE_PAPER);
    build_mixed(w);
    start_above(w);
    world_probe(w);
    const hapi_contact_slot *contact = world_contact(w, w->bodies[2], 0);
    REQUIRE(contact != NULL);
    memcpy(a[k], world_contact_answer(w, contact)->a, sizeof a[k]);
  }
  CHECK(memcmp(a[0], a[1], sizeof a[0]) == 0);
}

/* ---- who is left out ---- */

TEST(far_bodies_are_not_stepped)
{
  body_bits before;
  body_bits after;
  test_world *w = world_new(GRAVITY, 20);
  world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, 0);
  dBodyID flier = world_add_cube(w, EDGE, 0.5, 9.0, 0, 0);
  dBodySetLinearVel(flier, 0.3, 0.2, 0.1);
  dBodySetAngularVel(flier, 3, 2, 1);
  dBodySetMovedCallback(flier, count_far); /* behind the session's back: not silenced */
  start_at(w, NULL, (const double[3]){-0.01 - GAP, 0, 0});
  far_moves = 0;
  body_read(flier, &before);
  CHECK(world_probe(w) == 4);
  body_read(flier, &after);
  CHECK(far_moves == 0);
  CHECK(memcmp(&before, &after, sizeof before) == 0 && after.enabled);
  CHECK(hap_session_advance(w->session, 51) == HAP_OK);
  CHECK(far_moves == 1);
}

/* Both cubes lie on one plate that the application drives. */
TEST(driven_bodies_do_not_link_islands)
{
  test_world *w = world_new(GRAVITY, 20);
  dBodyID near = world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, EDGE / 2 - OVERLAP);
  dBodyID far = world_add_cube(w, EDGE, 0.5, 1.0, 0, EDGE / 2 - OVERLAP);
  dBodyID plate = world_add_box(w, (const double[3]){3, 1, 0.1}, 1.0, 0, 0, -0.05);
  dBodySetKinematic(plate);
  dBodySetMovedCallback(far, count_far);
  start_at(w, NULL, (const double[3]){-0.01 - GAP, 0, 0.03});
  far_moves = 0;
  CHECK(world_count_contacts(w) == 2); /* cube and plate */
  CHECK(world_probe(w) == 4);
  CHECK(far_moves == 0);
  CHECK(dBodyIsEnabled(far));
  const hapi_contact_slot *contact = world_contact(w, near, 0);
  REQUIRE(contact != NULL);
  CHECK(world_contact_answer(w, contact)->a[2][0] < 0.1); /* it does stand on the plate */
  CHECK(dBodyGetNumJoints(far) >= 3 && dBodyGetNumJoints(plate) >= 6);
  for (int i = 0; i < dBodyGetNumJoints(plate); ++i) {
    CHECK(dJointIsEnabled(dBodyGetJoint(plate, i)));
  }
  CHECK(hap_session_advance(w->session, 51) == HAP_OK);
  CHECK(far_moves == 1);
}

static void measure_on_floor(bool asleep, double a[6][3], double b[6])
{
  test_world *w = world_new(GRAVITY, 50);
  dCreatePlane(w->space, 0, 0, 1, 0);
  dBodyID cube = world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, EDGE / 2 - OVERLAP);
  dBodyID other = world_add_cube(w, EDGE, 0.5, 1.5 * EDGE - OVERLAP, 0, EDGE / 2 - OVERLAP);
  if (asleep) {
    dBodyDisable(cube);
    dBodyDisable(other);
  }
  start_at(w, NULL, AT(-0.01 - GAP, 0, EDGE / 2));
  const hapi_contact_slot *contact = measure_contact(w, cube, 8.0);
  const hapi_body_slot *slot = world_slot(w, cube);
  REQUIRE(slot != NULL);
  memcpy(a, world_contact_answer(w, contact)->a, 18 * sizeof(double));
  memcpy(b, world_answer(w, slot)->b, 6 * sizeof(double));
  CHECK((dBodyIsEnabled(cube) != 0) == !asleep);
  world_step(w, 3);
  CHECK((dBodyIsEnabled(cube) != 0) == !asleep);
  CHECK((dBodyIsEnabled(other) != 0) == !asleep);
  world_close(w);
}

TEST(sleepers_answer_like_those_awake)
{
  double a[2][6][3];
  double b[2][6];
  measure_on_floor(false, a[0], b[0]);
  measure_on_floor(true, a[1], b[1]);
  CHECK(memcmp(a[0], a[1], sizeof a[0]) == 0);
  CHECK(memcmp(b[0], b[1], sizeof b[0]) == 0);
  CHECK(a[0][0][0] > 0.1 && a[0][0][0] < 1.0); /* 8 N against two cubes with friction */
}

static void bodies_glue(test_world *w, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateFixed(w->world, NULL);
  dJointAttach(joint, a, b);
  dJointSetFixed(joint);
}

/* Two bodies without geom hang on a cube, one behind the other. */
TEST(bodies_known_only_by_joints_are_undone_too)
{
  dMass mass;
  body_bits before[3];
  test_world *w = world_new(GRAVITY, 1000);
  world_add_cube(w, EDGE, 0.5, EDGE / 2, 0, 0);
  dMassSetSphereTotal(&mass, 0.25, 0.02);
  world_add(w, NULL, &mass, EDGE / 2, 0, 0);
  world_add(w, NULL, &mass, EDGE / 2, 0, 0);
  bodies_glue(w, w->bodies[1], w->bodies[0]);
  bodies_glue(w, w->bodies[1], w->bodies[2]);
  start_at(w, NULL, (const double[3]){-0.01 - GAP, 0, 0});
  CHECK(world_physics(w)->world.bodies.used == 3);
  for (int i = 0; i < 3; ++i) {
    body_read(w->bodies[i], &before[i]);
  }
  const hapi_contact_slot *contact = measure_contact(w, w->bodies[0], 3.0);
  CHECK_NEAR(world_contact_answer(w, contact)->a[0][0], 1.0, 1e-6);
  for (int i = 0; i < 3; ++i) {
    body_bits after;
    body_read(w->bodies[i], &after);
    CHECK(memcmp(&before[i], &after, sizeof after) == 0);
  }
}
