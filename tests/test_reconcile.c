/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Where the loop's world and the application's meet: momentum, and an application that moves,
 * changes, adds, destroys and breaks bodies while a pointer is near them. */

#include <tests/tap.h>

#include <tests/physics_world.h>

#define EDGE 0.05
#define RADIUS 0.01

static void world_forward(test_world *w, int ticks)
{
  CHECK(hap_session_advance(w->session, (uint64_t)ticks) >= HAP_OK);
}

static hap_fault fault_of(const test_world *w)
{
  return (hap_fault)world_stats(w).faults.fault;
}

/* A cube of 1 kg on ice, the pointer 2 mm beside it. */
static test_world *open_cube(void)
{
  test_world *w = world_new(0.0, 20);
  (void)world_add_cube(w, EDGE, 1.0, EDGE / 2, 0, 0);
  world_start(w, RADIUS, -RADIUS - 0.002, 0, 0);
  return w;
}

/* Moves the pointer along x from where the last push ended, tick by tick. */
static void push_along(test_world *w, double *x, double speed, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    *x += 1e-3 * speed;
    world_move_pointer(w, 0, (const double[3]){*x, 0, 0}, (const double[3]){speed, 0, 0});
    world_forward(w, 1);
  }
}

/* ---- momentum ---- */

/* The paper's figure 5: 60 kg at 17 mm/s against a fixed pointer, thrown back as fast. */
static void check_fig5(double stiffness)
{
  test_world *w = world_new(0.0, 20);
  dBodyID cube = world_add_cube(w, 0.2, 60.0, 0.1 + RADIUS + 0.0019, 0, 0);
  dBodySetLinearVel(cube, -0.017, 0, 0);
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.radius = RADIUS;
  def.stiffness = stiffness;
  world_create_session(w, NULL);
  REQUIRE(hap_pointer_add(w->session, &def, &w->pointers[0]) == HAP_OK);
  world_move_pointer(w, 0, (const double[3]){0, 0, 0}, NULL);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
  world_forward(w, 2001);
  hap_stats stats = world_stats(w);
  printf("# k %g: impulse %.6f, ratio %.12f, peak %.4f\n", stiffness, stats.hand.impulse_ns,
         stats.hand.momentum_ratio, stats.hand.peak_force_n);
  CHECK_NEAR(stats.hand.impulse_ns, 2.04, 0.0005 * 2.04);
  CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 1e-9);
  CHECK_NEAR(stats.hand.peak_force_n, 0.017 * sqrt(stiffness * 60.0), 0.0005 * 20.0);
  CHECK_NEAR(dBodyGetLinearVel(cube)[0] * 60.0, stats.hand.impulse_ns - 0.017 * 60.0, 1e-9);
  for (int i = 1; i < 3; ++i) {
    CHECK_NEAR(dBodyGetLinearVel(cube)[i], 0.0, 1e-12);
  }
}

TEST(fig5_keeps_the_momentum)
{
  check_fig5(1000.0);
  check_fig5(3000.0);
  check_fig5(10000.0);
}

/* A row that is pushed must have the momentum that the hand gave. */
TEST(a_pushed_row_keeps_the_momentum)
{
  double x = -RADIUS - 0.001;
  test_world *w = world_new(0.0, 200);
  w->mu = 0.0;
  for (int i = 0; i < 5; ++i) {
    world_add_cube(w, EDGE, 0.5, EDGE / 2 + i * (EDGE - 1e-6), 0, 0);
  }
  world_start(w, RADIUS, x, 0, 0);
  push_along(w, &x, 0.05, 400);
  push_along(w, &x, -0.2, 201); /* away; every impulse has arrived after a step */
  double momentum = 0.0;
  for (int i = 0; i < 5; ++i) {
    momentum += 0.5 * dBodyGetLinearVel(w->bodies[i])[0];
  }
  hap_stats stats = world_stats(w);
  CHECK(stats.hand.impulse_ns > 0.05);
  CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 1e-9);
  CHECK_NEAR(momentum / stats.hand.impulse_ns, 1.0, 1e-6);
}

/* Eq. 14: what the linear model did not know of. The cube is pushed against a wall. */
TEST(an_impact_reaches_the_loop)
{
  double x = -RADIUS - 0.002;
  const double wall = EDGE + 0.02;
  test_world *w = world_new(0.0, 20);
  dCreatePlane(w->space, -1, 0, 0, -wall);
  dBodyID cube = world_add_cube(w, EDGE, 1.0, EDGE / 2, 0, 0);
  world_start(w, RADIUS, x, 0, 0);
  double farthest = 0.0;
  for (int i = 0; i < 40; ++i) {
    push_along(w, &x, x < 0.013 ? 0.1 : 0.0, 25);
    double face = dBodyGetPosition(cube)[0] + EDGE / 2;
    farthest = face > farthest ? face : farthest;
  }
  printf("# farthest %.4f into the wall\n", farthest - wall);
  CHECK(farthest - wall < 0.25 * 0.05); /* 0.25 m/s, at most for one step */
  CHECK(world_stats(w).loop.contact_ticks > 100);
  CHECK(hapi_v3_norm(dBodyGetLinearVel(cube)) < 0.3);
}

/* ---- the application's hand ---- */

typedef struct move_edit {
  dBodyID body;
  double to[3];
} move_edit;

static void move_body(void *arg)
{
  move_edit *edit = arg;
  dBodySetPosition(edit->body, edit->to[0], edit->to[1], edit->to[2]);
}

static void check_moved(bool posted)
{
  double x = -RADIUS - 0.002;
  test_world *w = open_cube();
  dBodyID cube = w->bodies[0];
  move_edit edit = {cube, {0.4, 0.3, 0.2}};
  push_along(w, &x, 0.1, 130); /* in contact, in the middle of a step */
  CHECK(world_stats(w).loop.contact_ticks > 50);
  double speed = dBodyGetLinearVel(cube)[0];
  if (posted) {
    CHECK(hap_session_post(w->session, move_body, &edit) == HAP_OK);
  } else {
    CHECK(hap_session_lock(w->session) == HAP_OK);
    move_body(&edit);
    CHECK(hap_session_unlock(w->session) == HAP_OK);
  }
  world_forward(w, 21); /* over the next step at tick 150 */
  CHECK_NEAR(dBodyGetPosition(cube)[0], 0.4, 0.3 * 0.05);
  CHECK_NEAR(dBodyGetPosition(cube)[1], 0.3, 1e-3);
  CHECK_NEAR(dBodyGetPosition(cube)[2], 0.2, 1e-3);
  world_move_pointer(w, 0, (const double[3]){-1, 0, 0}, NULL);
  double before = dBodyGetPosition(cube)[0];
  world_forward(w, 100);
  CHECK_NEAR(dBodyGetPosition(cube)[1], 0.3, 1e-3);
  CHECK(dBodyGetLinearVel(cube)[0] >= speed - 1e-9 && dBodyGetLinearVel(cube)[0] < 0.3);
  CHECK_NEAR(dBodyGetPosition(cube)[0], before + 0.1 * dBodyGetLinearVel(cube)[0], 1e-3);
  CHECK_NEAR(world_stats(w).hand.momentum_ratio, 1.0, 1e-9); /* the push before the move counts */
}

TEST(what_the_application_moves_stays_there)
{
  check_moved(false);
  check_moved(true);
}

TEST(a_velocity_set_by_the_application_holds)
{
  double x = -RADIUS - 0.002;
  test_world *w = open_cube();
  dBodyID cube = w->bodies[0];
  push_along(w, &x, 0.1, 130);
  dBodySetLinearVel(cube, 0.0, 0.1, 0.0);
  push_along(w, &x, 0.02, 121); /* over three steps, the first one of them from 100 to 150 */
  CHECK_NEAR(dBodyGetLinearVel(cube)[1], 0.1, 0.01);
  CHECK_NEAR(dBodyGetPosition(cube)[1], 0.1 * 0.15, 0.002);
}

static void check_bounded(const test_world *w, dBodyID body, double speed)
{
  CHECK(hapi_finite(dBodyGetPosition(body), 3) && hapi_finite(dBodyGetLinearVel(body), 3));
  CHECK(hapi_v3_norm(dBodyGetLinearVel(body)) < speed);
  CHECK(fault_of(w) == HAP_FAULT_NONE);
}

TEST(a_changed_mass_is_read_again)
{
  dMass mass;
  double x = -RADIUS - 0.002;
  test_world *w = open_cube();
  dBodyID cube = w->bodies[0];
  push_along(w, &x, 0.02, 175);
  const hapi_contact_slot *contact = world_contact(w, cube, 0);
  REQUIRE(contact != NULL);
  CHECK_NEAR(world_contact_answer(w, contact)->a[0][0], 1.0, 1e-9);
  dMassSetBoxTotal(&mass, 4.0, EDGE, EDGE, EDGE);
  dBodySetMass(cube, &mass);
  push_along(w, &x, 0.02, 26);
  contact = world_contact(w, cube, 0);
  REQUIRE(contact != NULL);
  CHECK_NEAR(world_contact_answer(w, contact)->a[0][0], 0.25, 1e-9);
  CHECK_NEAR(world_slot(w, cube)->mass, 4.0, 0.0);
  push_along(w, &x, 0.02, 200);
  check_bounded(w, cube, 0.1);
  CHECK_NEAR(world_stats(w).hand.momentum_ratio, 1.0, 1e-9);
}

TEST(a_body_added_near_the_pointer_is_felt)
{
  test_world *w = world_new(0.0, 20);
  world_start(w, RADIUS, 0, 0, 0);
  world_forward(w, 120);
  CHECK(world_stats(w).model.bodies_known == 0);
  dBodyID cube = world_add_cube(w, EDGE, 1.0, EDGE / 2 + RADIUS + 0.001, 0, 0);
  world_forward(w, 31);
  CHECK(world_stats(w).model.bodies_known == 1);
  CHECK(world_contact(w, cube, 0) != NULL);
  double x = 0.0;
  push_along(w, &x, 0.05, 100);
  CHECK(world_stats(w).loop.contact_ticks > 20);
  check_bounded(w, cube, 0.2);
}

/* ---- bodies that go ---- */

static void destroy_body(dBodyID body)
{
  dGeomID geom = dBodyGetFirstGeom(body);
  dBodyDestroy(body);
  if (geom != NULL) {
    dGeomDestroy(geom);
  }
}

static void destroy_first(test_world *w, bool forget)
{
  if (forget) {
    CHECK(hap_session_forget_geom(w->session, dBodyGetFirstGeom(w->bodies[0])) == HAP_OK);
    CHECK(hap_session_forget_body(w->session, w->bodies[0]) == HAP_OK);
  }
  destroy_body(w->bodies[0]);
  w->bodies[0] = NULL;
}

static void check_destroyed(bool forget)
{
  double x = -RADIUS - 0.002;
  test_world *w = open_cube();
  dBodyID other = world_add_cube(w, EDGE, 1.0, EDGE / 2, 2 * EDGE, 0);
  push_along(w, &x, 0.1, 130);
  CHECK(world_stats(w).loop.contact_ticks > 50);
  CHECK(hap_session_lock(w->session) == HAP_OK);
  destroy_first(w, forget);
  CHECK(hap_session_unlock(w->session) == HAP_OK);
  world_forward(w, 200);
  hap_stats stats = world_stats(w);
  CHECK(stats.faults.bodies_lost == (forget ? 0u : 1u));
  CHECK(stats.model.bodies_known == 1);
  CHECK(fault_of(w) == HAP_FAULT_NONE);
  hap_pointer_state state;
  CHECK(hap_pointer_get(w->session, w->pointers[0], &state, sizeof state) == HAP_OK);
  CHECK(state.contacts == 0 && state.wrench.force[0] == 0.0);
  check_bounded(w, other, 1e-9);
  if (!forget) {
    hap_detail detail;
    CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
    CHECK(strstr(detail.text, "hap_session_forget_body") != NULL);
  }
}

TEST(a_neighbour_is_destroyed)
{
  check_destroyed(true);
  check_destroyed(false);
}

static test_world *callback_world;
static int callback_countdown;
static bool callback_forgets;

static void destroy_in_callback(void *user, double step_s)
{
  (void)user;
  (void)step_s;
  if (--callback_countdown == 0) {
    destroy_first(callback_world, callback_forgets);
  }
}

static void check_destroyed_in_callback(bool after, bool forget)
{
  double x = -RADIUS - 0.002;
  test_world *w = world_new(0.0, 20);
  callback_world = w;
  callback_countdown = 3;
  callback_forgets = forget;
  *(after ? &w->after_step : &w->before_step) = destroy_in_callback;
  world_add_cube(w, EDGE, 1.0, EDGE / 2, 0, 0);
  world_add_cube(w, EDGE, 1.0, EDGE / 2, 2 * EDGE, 0);
  world_start(w, RADIUS, x, 0, 0);
  push_along(w, &x, 0.1, 250);
  CHECK(callback_countdown < 0);
  hap_stats stats = world_stats(w);
  CHECK(stats.model.bodies_known == 1);
  CHECK(stats.faults.bodies_lost == (forget ? 0u : 1u));
  CHECK(fault_of(w) == HAP_FAULT_NONE);
}

/* The callbacks are among the places where the world may be touched (ode.h). */
TEST(a_neighbour_is_destroyed_in_before_step)
{
  check_destroyed_in_callback(false, true);
  check_destroyed_in_callback(false, false);
}

TEST(a_neighbour_is_destroyed_in_after_step)
{
  check_destroyed_in_callback(true, true);
  check_destroyed_in_callback(true, false);
}

TEST(a_body_in_place_of_a_destroyed_one_is_a_new_body)
{
  double x = -RADIUS - 0.002;
  test_world *w = open_cube();
  dBodyID cube = w->bodies[0];
  push_along(w, &x, 0.1, 130);
  destroy_first(w, false);
  dBodyID next = world_add_cube(w, EDGE, 2.0, EDGE / 2, 1.0, 0); /* often the same address */
  printf("# address %s\n", next == cube ? "used again" : "not used again");
  dBodySetAutoDisableFlag(next, 1);
  world_move_pointer(w, 0, (const double[3]){-1, 0, 0}, NULL);
  world_forward(w, 121);
  CHECK(dBodyGetPosition(next)[0] == EDGE / 2 && dBodyGetPosition(next)[1] == 1.0);
  CHECK(hapi_v3_norm(dBodyGetLinearVel(next)) == 0.0);
  CHECK(dBodyGetAutoDisableFlag(next) == 0); /* taken over like any other's */
  CHECK(hap_session_stop(w->session) == HAP_OK);
  CHECK(dBodyGetAutoDisableFlag(next) == 1);
}

/* ---- states that would end the process ---- */

static void break_position(void *arg)
{
  dBodySetPosition(arg, 0.0, (double)NAN, 0.0);
}

static void break_spin(void *arg)
{
  dBodySetAngularVel(arg, 0.0, (double)INFINITY, 0.0);
}

static void break_force(void *arg)
{
  dBodyAddForce(arg, 0.0, 0.0, (double)NAN);
}

static void body_mend(dBodyID body)
{
  dBodySetPosition(body, EDGE / 2, 0, 0);
  dBodySetLinearVel(body, 0, 0, 0);
  dBodySetAngularVel(body, 0, 0, 0);
  dBodySetForce(body, 0, 0, 0);
  dBodySetTorque(body, 0, 0, 0);
}

static void check_broken(hap_edit_fn edit)
{
  hap_detail detail;
  double x = -RADIUS - 0.002;
  test_world *w = open_cube();
  dBodyID cube = w->bodies[0];
  dBodyID witness = world_add_cube(w, EDGE, 1.0, 3, 0, 0);
  dBodySetLinearVel(witness, 0.1, 0, 0);
  push_along(w, &x, 0.1, 130);
  CHECK(hap_session_post(w->session, edit, cube) == HAP_OK);
  world_forward(w, 21);
  double stopped = dBodyGetPosition(witness)[0];
  world_forward(w, 100);
  CHECK(fault_of(w) == HAP_FAULT_WORLD);
  CHECK(world_stats(w).faults.count == 1);
  CHECK(dBodyGetPosition(witness)[0] == stopped); /* not stepped */
  CHECK(hapi_finite(dBodyGetLinearVel(cube), 3)); /* none of the three is in it yet */
  CHECK(hap_session_detail(w->session, &detail) == HAP_OK);
  CHECK(strstr(detail.text, "not finite") != NULL);
  body_mend(cube);
  x = -RADIUS - 0.002;
  world_move_pointer(w, 0, (const double[3]){x, 0, 0}, NULL);
  world_forward(w, 100);
  CHECK(fault_of(w) == HAP_FAULT_WORLD); /* stays until it is reset */
  CHECK(dBodyGetPosition(witness)[0] > stopped);
  CHECK(hap_session_reset_fault(w->session) == HAP_OK);
  world_forward(w, 51);
  CHECK(fault_of(w) == HAP_FAULT_NONE);
  uint64_t touched = world_stats(w).loop.contact_ticks;
  push_along(w, &x, 0.1, 130);
  CHECK(world_stats(w).loop.contact_ticks > touched + 20);
  check_bounded(w, cube, 0.5);
}

TEST(a_broken_body_is_not_stepped)
{
  check_broken(break_position);
  check_broken(break_spin);
  check_broken(break_force);
}

/* The hand must not be let near a world that is not stepped, whoever resets what. */
TEST(a_fault_comes_back_while_the_world_is_broken)
{
  test_world *w = open_cube();
  dBodyID cube = w->bodies[0];
  CHECK(hap_session_post(w->session, break_position, cube) == HAP_OK);
  world_forward(w, 101);
  CHECK(fault_of(w) == HAP_FAULT_WORLD);
  CHECK(hap_session_reset_fault(w->session) == HAP_OK);
  world_forward(w, 101);
  CHECK(fault_of(w) == HAP_FAULT_WORLD);
}

static void break_after(void *user, double step_s)
{
  test_world *w = user;
  (void)step_s;
  if (--callback_countdown == 0) {
    dBodySetAngularVel(w->bodies[1], (double)NAN, 0, 0);
  }
}

/* Between the step and the testing simulations, behind a neighbour: none may be run on it. */
TEST(a_body_broken_in_after_step_is_not_probed)
{
  test_world *w = world_new(0.0, 20);
  callback_countdown = 2;
  w->after_step = break_after;
  dBodyID cube = world_add_cube(w, EDGE, 1.0, EDGE / 2, 0, 0);
  world_add_cube(w, EDGE, 1.0, 1.5 * EDGE - 1e-6, 0, 0);
  world_start(w, RADIUS, -RADIUS - 0.002, 0, 0);
  world_forward(w, 201);
  CHECK(fault_of(w) == HAP_FAULT_WORLD);
  const hapi_contact_slot *contact = world_contact(w, cube, 0);
  CHECK(contact == NULL || hapi_finite(&world_contact_answer(w, contact)->a[0][0], 18));
}

static void break_before(void *user, double step_s)
{
  test_world *w = user;
  (void)step_s;
  if (--callback_countdown == 0) {
    dBodyAddTorque(w->bodies[0], (double)NAN, 0, 0);
  }
}

TEST(a_body_broken_in_before_step_is_not_stepped)
{
  test_world *w = world_new(0.0, 20);
  callback_countdown = 2;
  w->before_step = break_before;
  world_add_cube(w, EDGE, 1.0, EDGE / 2, 0, 0);
  world_start(w, RADIUS, -RADIUS - 0.002, 0, 0);
  world_forward(w, 201);
  CHECK(fault_of(w) == HAP_FAULT_WORLD);
  CHECK(hapi_finite(dBodyGetAngularVel(w->bodies[0]), 3));
}

/* ---- models ---- */

/* A jump is a step of the pose that the velocity does not explain. */
static void check_continuous(dBodyID body, double before[3], double seconds)
{
  double moved[3];
  hapi_v3_sub(dBodyGetPosition(body), before, moved);
  double speed = hapi_v3_norm(dBodyGetLinearVel(body));
  CHECK(hapi_finite(moved, 3));
  CHECK(hapi_v3_norm(moved) <= (speed + 0.1) * seconds + 1e-4);
  hapi_v3_copy(dBodyGetPosition(body), before);
}

/* Within what model IMPULSE keeps stable at 50 Hz: H^2 k / m is 0.1. */
static test_world *open_switching(hap_model first)
{
  hap_pointer_def def;
  test_world *w = world_new(9.81, 50);
  w->mu = 0.1;
  w->def.physics_hz = 50.0;
  w->def.model = first;
  dCreatePlane(w->space, 0, 0, 1, -EDGE / 2 + 1e-5);
  (void)world_add_cube(w, EDGE, 2.0, EDGE / 2, 0, 0);
  hap_pointer_def_init(&def, sizeof def);
  def.radius = RADIUS;
  def.stiffness = 500.0;
  def.damping = 5.0;
  world_create_session(w, NULL);
  CHECK(hap_pointer_add(w->session, &def, &w->pointers[0]) == HAP_OK);
  world_move_pointer(w, 0, (const double[3]){-RADIUS - 0.002, 0, 0}, NULL);
  CHECK(hap_session_start(w->session) == HAP_OK);
  return w;
}

static void switch_models(const hap_model *order, int count, int gap_ticks)
{
  double x = -RADIUS - 0.002;
  double before[3];
  test_world *w = open_switching(order[0]);
  dBodyID cube = w->bodies[0];
  hapi_v3_copy(dBodyGetPosition(cube), before);
  for (int i = 0; i < 20; ++i) {
    CHECK(hap_session_set_model(w->session, order[i % count]) == HAP_OK);
    for (int k = 0; k < gap_ticks; k += 10) {
      push_along(w, &x, 0.03, 10);
      check_continuous(cube, before, 0.04); /* a step is at most 2 H long */
    }
  }
  push_along(w, &x, -0.2, 200);
  hap_stats stats = world_stats(w);
  printf("# gap %d: impulse %.6f, ratio %.12f, peak %.3f, x %.4f\n", gap_ticks,
         stats.hand.impulse_ns, stats.hand.momentum_ratio, stats.hand.peak_force_n,
         dBodyGetPosition(cube)[0]);
  CHECK(stats.hand.impulse_ns > 0.1);
  CHECK_NEAR(stats.hand.momentum_ratio, 1.0, 1e-9);
  CHECK(fault_of(w) == HAP_FAULT_NONE && stats.faults.states_rejected == 0);
  CHECK(stats.hand.peak_force_n < 15.0);
  CHECK(dBodyGetPosition(cube)[0] > 0.03 * 1e-3 * 20 * gap_ticks - 0.03 + EDGE / 2);
}

TEST(models_are_switched_while_pushing)
{
  const hap_model order[] = {HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE, HAP_MODEL_IMPULSE};
  switch_models(order, 3, 100);
  switch_models(order, 3, 70);
  switch_models(order, 3, 130);
}

TEST(models_are_switched_the_other_way)
{
  const hap_model order[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE, HAP_MODEL_SINGLE};
  switch_models(order, 3, 100);
  switch_models(order, 3, 70);
}
