/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Own forces that are bound to bodies, by the public headers: against closed forms and a plain loop
 * of ODE. */

#include "tests/tap.h"

#include <math.h>

#include <hapode/forces.h>
#include <hapode/research.h>

#include "tests/desk.h"
#include "tests/files.h"

#define EXACT 1e-9 /* N */
#define MASS 0.4
#define BALL 0.03 /* m */

static hap_force_def bound_def(hap_force_kind kind, dBodyID body)
{
  hap_force_def def;
  hap_force_def_init(&def, sizeof def);
  def.kind = (uint32_t)kind;
  def.frame = HAP_FORCE_BODY;
  def.body = body;
  def.fade_in_s = 0.0;
  def.max_power = 1e6;
  return def;
}

static hap_force_id force_add(desk *d, const hap_force_def *def)
{
  hap_force_id id = {0};
  hap_detail why = {""};
  hap_status status = hap_pointer_force_add(d->session, d->hand, def, &id);
  (void)hap_session_detail(d->session, &why);
  REQUIRE_SAY(status == HAP_OK, "%s", why.text);
  return id;
}

typedef struct momentum {
  double linear[3];
  double angular[3]; /* about the origin of the world */
} momentum;

/* What the hand got in a tick. */
static void momentum_take(desk *d, momentum *io)
{
  hap_pointer_state s = desk_state(d);
  const double *h = s.device.position;
  const double *f = s.wrench.force;
  for (int i = 0; i < 3; ++i) {
    int j = (i + 1) % 3;
    int k = (i + 2) % 3;
    io->linear[i] += T * f[i];
    io->angular[i] += T * (h[j] * f[k] - h[k] * f[j] + s.wrench.torque[i]);
  }
}

/* Of a ball. */
static momentum momentum_of(dBodyID ball, double inertia)
{
  const dReal *c = dBodyGetPosition(ball);
  const dReal *v = dBodyGetLinearVel(ball);
  const dReal *w = dBodyGetAngularVel(ball);
  momentum out;
  for (int i = 0; i < 3; ++i) {
    int j = (i + 1) % 3;
    int k = (i + 2) % 3;
    out.linear[i] = MASS * v[i];
    out.angular[i] = MASS * (c[j] * v[k] - c[k] * v[j]) + inertia * w[i];
  }
  return out;
}

/* ---- action and reaction ---- */

TEST(what_the_hand_gets_the_body_gets_the_other_way)
{
  const hap_force_kind kinds[] = {HAP_FORCE_SPRING, HAP_FORCE_MAGNET, HAP_FORCE_DETENTS,
                                  HAP_FORCE_VISCOUS};
  const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE, HAP_MODEL_CONTACT};
  for (int at = 0; at < 12; ++at) {
    desk *d = desk_new(0.0, models[at / 4]);
    hap_expert_def expert;
    hap_expert_def_init(&expert, sizeof expert);
    expert.effects_off = at / 4 == 2 ? HAP_EFFECT_BIT(HAP_EFFECT_RANGE) : 0; /* measured bodies */
    d->def.expert = &expert;
    dBodyID ball = ode_ball(d->world, d->space, MASS, BALL, (const double[3]){0.0, 0.0, 0.0});
    dMass mass;
    momentum hand = {{0.0}, {0.0}};
    d->hand_def.collide_bits = 0; /* no contact */
    desk_run(d, 0.15, 0.02, -0.01);
    desk_wait(d, 60);
    hap_force_def def = bound_def(kinds[at % 4], ball);
    def.target = at % 4 == 0 ? HAP_FORCE_POINT : HAP_FORCE_LINE;
    def.origin[1] = 0.01;
    def.axis[0] = 0.3;
    def.point[2] = 0.004;
    def.stiffness = 60.0;
    def.damping = 8.0;
    def.strength = 2.0;
    def.range = 0.3;
    def.pitch = 0.02;
    hap_force_id id = force_add(d, &def);
    for (int i = 0; i < 400; ++i) {
      desk_move(d, -1e-4 * sin(0.05 * i), 1e-4 * cos(0.03 * i), 5e-5, 1);
      momentum_take(d, &hand);
    }
    CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
    for (int i = 0; i < 100; ++i) { /* until the world has the last of it */
      desk_wait(d, 1);
      momentum_take(d, &hand);
    }
    check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 0.0);
    dBodyGetMass(ball, &mass);
    momentum body = momentum_of(ball, mass.I[0]);
    double size = 0.0;
    for (int i = 0; i < 3; ++i) {
      size = fmax(size, fabs(body.linear[i]));
    }
    CHECK(size > 1e-3);
    for (int i = 0; i < 3; ++i) {
      CHECK_SAY(fabs(hand.linear[i] + body.linear[i]) <= 1e-9 * size, "%d %d: %g of %g", at, i,
                hand.linear[i] + body.linear[i], size);
      CHECK_SAY(fabs(hand.angular[i] + body.angular[i]) <= 1e-9 * size, "%d %d: %g turning of %g",
                at, i, hand.angular[i] + body.angular[i], size);
    }
    hap_stats stats = session_stats(d->session);
    CHECK(stats.hand.momentum_error_ns <= 1e-9);
    tap_release(d);
  }
}

/* ---- against others ---- */

#define SWING 80.0 /* N/m */

/* A semi-implicit step turns the phase by w T with sin(w T / 2) = T / 2 sqrt(k / m): then of the
 * way, and so of the force, f(t + T) = 2 cos(w T) f(t) - f(t - T). The largest one of a second. */
static double swing_listen(desk *d)
{
  double turn = 2.0 * asin(0.5 * T * sqrt(SWING / MASS));
  double most = 0.0;
  double wrong = 0.0;
  double force[2] = {0.0, 0.0};
  for (int i = 0; i < 1000; ++i) {
    desk_wait(d, 1);
    double now = desk_state(d).wrench.force[0];
    if (i >= 2) {
      wrong = fmax(wrong, fabs(now - 2.0 * cos(turn) * force[1] + force[0]));
    }
    force[0] = force[1];
    force[1] = now;
    most = fmax(most, fabs(now));
  }
  CHECK_SAY(wrong <= 1e-9, "%g N", wrong);
  return most;
}

TEST(a_body_swings_on_a_spring_as_its_closed_form)
{
  for (int rests = 0; rests < 2; ++rests) {
    desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
    dBodyID ball = ode_ball(d->world, d->space, MASS, BALL, (const double[3]){0.0, 0.0, 0.0});
    d->hand_def.collide_bits = 0;
    d->def.physics_hz = 20.0;
    desk_run(d, 0.2, 0.0, 0.0);
    desk_wait(d, 120);
    if (rests) {
      REQUIRE(hap_session_lock(d->session) == HAP_OK);
      dBodyDisable(ball);
      REQUIRE(hap_session_unlock(d->session) == HAP_OK);
    }
    hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
    hap_force_id id = force_add(d, &def);
    desk_wait(d, 182); /* until the body is in the loop, just after a step of the world */
    CHECK(dBodyIsEnabled(ball) == !rests);
    def.stiffness = SWING;
    CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
    desk_wait(d, 22); /* the force comes in over 20 ms, and the body goes at once */
    double most = swing_listen(d);
    CHECK_SAY(most > 0.9 * SWING * 0.2 && most < 1.1 * SWING * 0.2, "%g N", most);
    tap_release(d);
  }
}

/* The loop lets go of a body that swings. Physics is 30 ticks late: the body is put where its state
 * of then leads to, with the velocity to which the hand has brought it since. */
TEST(a_body_that_the_loop_lets_go_of_swings_on)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  (void)ode_ball(d->world, d->space, MASS, BALL, (const double[3]){0.0, 0.0, 0.0});
  dBodyID ball = dGeomGetBody(dSpaceGetGeom(d->space, 0));
  d->hand_def.collide_bits = 0;
  hap_research_def research;
  hap_research_def_init(&research, sizeof research);
  research.physics_latency_ticks = 30; /* what the loop gives meanwhile goes along */
  d->def.research = &research;
  d->def.physics_hz = 20.0;
  desk_run(d, 0.2, 0.0, 0.0);
  desk_wait(d, 120);
  hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
  def.stiffness = SWING;
  (void)force_add(d, &def);
  desk_wait(d, 182);
  (void)swing_listen(d);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  dJointAttach(dJointCreatePlane2D(d->world, NULL), ball, NULL); /* it is not the loop's */
  REQUIRE(hap_session_unlock(d->session) == HAP_OK);
  double force[200];
  int at = 2;
  double most = 0.0;
  for (int i = 0; i < 200; ++i) {
    desk_wait(d, 1);
    force[i] = desk_state(d).wrench.force[0];
  }
  for (int i = 2; i < 150; ++i) {
    double here = force[i] - force[i - 1];
    double about = 0.5 * (force[i - 1] - force[i - 2] + force[i + 1] - force[i]);
    at = fabs(here - about) > most ? i : at;
    most = fmax(most, fabs(here - about));
  }
  double leap = force[at] - force[at - 1];
  double before = force[at - 1] - force[at - 2];
  double after = force[at + 2] - force[at + 1];
  printf("# tick %d: a leap of %g N, %g and %g N a tick before and after\n", at, leap, before,
         after);
  CHECK(fabs(leap) > 0.1);
  CHECK(fabs(after - before) < 0.012); /* without what was given 0.041 */
}

#define PULL 150.0 /* N/m */
#define DRAWER 0.5 /* kg */

/* Where the hand is: out by 8 cm and a little across. */
static double hand_way(double t)
{
  return 0.08 * 0.5 * (1.0 - cos(fmin(t, 1.0) * M_PI));
}

/* A drawer on a slider. */
static dBodyID drawer_make(dWorldID world, dSpaceID space)
{
  dBodyID drawer =
      ode_box(world, space, DRAWER, (const double[3]){0.2, 0.2, 0.1}, (const double[3]){0, 0, 0});
  dJointID rail = dJointCreateSlider(world, NULL);
  dJointAttach(rail, drawer, NULL);
  dJointSetSliderAxis(rail, 1.0, 0.0, 0.0);
  return drawer;
}

/* A plain loop: the same forces by hand, stepped by ODE at each tick. Force on the hand along x. */
static void drawer_plain(double *out_force, int ticks)
{
  dWorldID world;
  dSpaceID space;
  ode_world_make(0.0, &world, &space);
  ode_world_stiffen(world, 50);
  dBodyID drawer = drawer_make(world, space);
  for (int i = 0; i < ticks; ++i) {
    double way = hand_way(T * (i + 1)) - dBodyGetPosition(drawer)[0];
    double force = -PULL * way;
    out_force[i] = force;
    dBodyAddForceAtPos(drawer, -force, 0.0, 0.0, dBodyGetPosition(drawer)[0] + 0.2 + way, 0.0, 0.0);
    dWorldQuickStep(world, T);
  }
  ode_world_end(NULL, world, space);
}

static void drawer_run(hap_model model, double physics_hz, double *out_force, int ticks)
{
  desk *d = desk_new(0.0, model);
  dBodyID drawer = drawer_make(d->world, d->space);
  d->def.physics_hz = physics_hz;
  desk_run(d, 0.2, 0.0, 0.0);
  hap_force_def def = bound_def(HAP_FORCE_SPRING, drawer);
  def.target = HAP_FORCE_PLANE;
  def.origin[0] = 0.2;
  def.axis[0] = 1.0;
  def.axis[2] = 0.0;
  def.stiffness = PULL;
  (void)force_add(d, &def);
  desk_wait(d, 120);
  for (int i = 0; i < ticks; ++i) {
    d->at[0] = 0.2 + hand_way(T * (i + 1));
    d->velocity[0] = (hand_way(T * (i + 1)) - hand_way(T * i)) / T;
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    out_force[i] = desk_state(d).wrench.force[0];
  }
  tap_release(d);
}

static double rms_share(const double *a, const double *b, int count)
{
  double off2 = 0.0;
  double all2 = 0.0;
  for (int i = 0; i < count; ++i) {
    off2 += (a[i] - b[i]) * (a[i] - b[i]);
    all2 += b[i] * b[i];
  }
  return sqrt(off2 / all2);
}

TEST(a_drawer_that_is_pulled_feels_as_in_single_and_in_a_plain_loop)
{
  static double plain[1500];
  static double single[1500];
  static double contact[1500];
  drawer_plain(plain, 1500);
  drawer_run(HAP_MODEL_SINGLE, 1000.0, single, 1500);
  const double hz[] = {20.0, 60.0, 120.0};
  CHECK_SAY(rms_share(single, plain, 1500) <= 0.01, "single: %g", rms_share(single, plain, 1500));
  for (int i = 0; i < 3; ++i) {
    drawer_run(HAP_MODEL_CONTACT, hz[i], contact, 1500);
    double off = rms_share(contact, plain, 1500);
    CHECK_SAY(off <= 0.01, "%g Hz: %g of the force", hz[i], off);
    printf("# %g Hz: %.3f %% of the plain loop's, single %.3f %%\n", hz[i], 100.0 * off,
           100.0 * rms_share(single, plain, 1500));
  }
}

/* ---- where the place is ---- */

TEST(a_place_goes_with_a_body_that_turns)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID ball = ode_ball(d->world, d->space, 1e7, BALL, (const double[3]){0.1, 0.0, 0.0});
  const double angle = 0.7;
  dQuaternion turned = {cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)}; /* about z */
  dBodySetQuaternion(ball, turned);
  desk_run(d, 0.0, 0.0, 0.3);
  desk_wait(d, 60);
  hap_force_def def = bound_def(HAP_FORCE_DETENTS, ball);
  def.origin[0] = 0.05;
  def.axis[0] = 1.0;
  def.axis[2] = 0.0;
  def.strength = 1.0;
  def.pitch = 0.01;
  (void)force_add(d, &def);
  desk_wait(d, 60);
  for (int n = -2; n <= 2; ++n) { /* a quarter of a pitch beside a detent */
    double along = 0.05 + 0.01 * n + 0.0025;
    d->at[0] = 0.1 + along * cos(angle);
    d->at[1] = along * sin(angle);
    desk_wait(d, 1);
    check_vector(desk_state(d).wrench.force, -cos(angle), -sin(angle), 0.0, 1e-6);
  }
}

TEST(a_kinematic_body_takes_the_place_along_and_is_not_pushed)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID lift = ode_box(d->world, d->space, 1.0, (const double[3]){0.2, 0.2, 0.02},
                         (const double[3]){0.0, 0.0, 0.0});
  dBodySetKinematic(lift);
  dBodySetLinearVel(lift, 0.0, 0.0, 0.05);
  desk_run(d, 0.0, 0.0, 0.3);
  desk_wait(d, 60);
  hap_force_def def = bound_def(HAP_FORCE_SPRING, lift);
  def.stiffness = 100.0;
  (void)force_add(d, &def);
  desk_wait(d, 60);
  double before = desk_state(d).wrench.force[2];
  for (int i = 0; i < 200; ++i) { /* 5 mN a tick, at each tick and not at each step of the world */
    desk_wait(d, 1);
    double now = desk_state(d).wrench.force[2];
    CHECK_NEAR(now - before, 100.0 * 0.05 * T, 1e-6);
    before = now;
  }
  CHECK_NEAR(dBodyGetLinearVel(lift)[2], 0.05, 0.0);
}

TEST(a_magnet_wakes_a_body_at_rest)
{
  desk *d = desk_new(9.81, HAP_MODEL_CONTACT);
  floor_add(d);
  dBodyID ball = ode_ball(d->world, d->space, MASS, BALL, (const double[3]){0.0, 0.0, BALL});
  desk_run(d, 0.3, 0.0, 0.1);
  desk_wait(d, 200);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  dBodyDisable(ball);
  REQUIRE(hap_session_unlock(d->session) == HAP_OK);
  hap_force_def def = bound_def(HAP_FORCE_MAGNET, ball);
  def.strength = 8.0;
  def.range = 0.15;
  (void)force_add(d, &def);
  desk_wait(d, 500);
  CHECK(dBodyIsEnabled(ball) == 0); /* far off */
  check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 0.0);
  desk_move(d, -0.3, 0.0, -0.01, 600); /* over it: 6 cm up */
  desk_wait(d, 400);
  CHECK(dBodyGetPosition(ball)[2] > BALL + 0.01); /* it is lifted */
}

/* ---- nothing leaps ---- */

TEST(a_body_that_goes_or_is_put_elsewhere_takes_no_force_in_one_step)
{
  for (int how = 0; how < 3; ++how) { /* placed, teleported, destroyed */
    desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
    dBodyID ball = ode_ball(d->world, d->space, 1e5, BALL, (const double[3]){0.0, 0.0, 0.0});
    dGeomID geom = dBodyGetFirstGeom(ball);
    desk_run(d, 0.1, 0.0, 0.0);
    desk_wait(d, 60);
    hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
    def.stiffness = 100.0;
    hap_force_id id = force_add(d, &def);
    desk_wait(d, 60);
    double before = desk_state(d).wrench.force[0];
    CHECK_NEAR(before, -10.0, 0.01);
    if (how == 0) {
      REQUIRE(hap_session_lock(d->session) == HAP_OK);
      dBodySetPosition(ball, 0.2, 0.0, 0.0);
      REQUIRE(hap_session_unlock(d->session) == HAP_OK);
    } else if (how == 1) {
      const hap_pose there = {{0.2, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
      REQUIRE(hap_session_lock(d->session) == HAP_OK);
      CHECK(hap_session_teleport_body(d->session, ball, &there) == HAP_OK);
      REQUIRE(hap_session_unlock(d->session) == HAP_OK);
    } else {
      REQUIRE(hap_session_lock(d->session) == HAP_OK);
      (void)hap_session_forget_body(d->session, ball);
      dGeomDestroy(geom);
      dBodyDestroy(ball);
      REQUIRE(hap_session_unlock(d->session) == HAP_OK);
    }
    for (int i = 0; i < 100; ++i) {
      desk_wait(d, 1);
      double now = desk_state(d).wrench.force[0];
      CHECK_SAY(fabs(now - before) <= 20.0 / 20.0 + 0.01, "%g to %g", before, now);
      before = now;
    }
    CHECK_NEAR(before, how == 0 ? 10.0 : 0.0, 0.02);
    if (how == 1) { /* it is bound anew */
      CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
      desk_wait(d, 100);
      CHECK_NEAR(desk_state(d).wrench.force[0], 10.0, 0.02);
    }
    CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
    tap_release(d);
  }
}

TEST(a_light_body_on_a_stiff_spring_is_bounded)
{
  const double masses[] = {1e-4, 1e-3, 0.01, 0.1};
  for (int i = 0; i < 4; ++i) {
    desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
    dBodyID ball = ode_ball(d->world, d->space, masses[i], 0.01, (const double[3]){0.0, 0.0, 0.0});
    double fastest = 0.0;
    desk_run(d, 0.05, 0.0, 0.0);
    desk_wait(d, 60);
    hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
    def.stiffness = 3000.0;
    def.damping = 5.0;
    def.point[1] = 0.02; /* it turns the body, too */
    def.origin[2] = 0.009;
    (void)force_add(d, &def);
    for (int k = 0; k < 3000; ++k) {
      desk_wait(d, 1);
      double v = dBodyGetLinearVel(ball)[0];
      fastest = k > 1000 ? fmax(fastest, fabs(v)) : fastest;
    }
    CHECK_SAY(fastest < 0.5, "%g kg: %g m/s", masses[i], fastest);
    double felt = fabs(desk_state(d).wrench.force[0]);
    CHECK_SAY(felt < 1.0, "%g kg: %g N", masses[i], felt);
    CHECK(session_stats(d->session).faults.count == 0);
    tap_release(d);
  }
}

/* A spring holds a body of m by no more than 0.3 m / T^2, whatever is asked: with 4 m / T^2 a free
 * body swings from tick to tick. Here 0.3 of 1000 N/m, on 2 mm. */
TEST(a_light_body_answers_to_three_tenths_of_its_mass_in_a_tick)
{
  const double mass = 1e-3;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID ball = ode_ball(d->world, d->space, mass, 0.01, (const double[3]){0.0, 0.0, 0.0});
  d->hand_def.collide_bits = 0; /* no contact */
  desk_run(d, 0.002, 0.0, 0.0);
  hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
  def.stiffness = 1000.0;
  desk_wait(d, 60);
  (void)force_add(d, &def);
  desk_wait(d, 1);
  printf("# %g N\n", desk_state(d).wrench.force[0]);
  CHECK_NEAR(desk_state(d).wrench.force[0], -0.3 * mass / (T * T) * 0.002, 1e-3);
}

/* 1 kN/m on 0.1 g would turn the way about ten times in a tick, and swing up. */
TEST(a_light_body_bounds_a_spring_in_single_too)
{
  desk *d = desk_new(0.0, HAP_MODEL_SINGLE);
  dBodyID ball = ode_ball(d->world, d->space, 1e-4, 0.01, (const double[3]){0.0, 0.0, 0.0});
  d->hand_def.collide_bits = 0;
  desk_run(d, 0.01, 0.0, 0.0);
  desk_wait(d, 60);
  hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
  def.stiffness = 1000.0;
  (void)force_add(d, &def);
  double most = 0.0;
  double first = 0.0;
  for (int k = 0; k < 2000; ++k) {
    desk_wait(d, 1);
    double force = fabs(desk_state(d).wrench.force[0]);
    first = first == 0.0 ? force : first;
    most = fmax(most, force);
  }
  CHECK_NEAR(first, 0.3 / 10.0 * 1000.0 * 0.01, EXACT);
  CHECK_SAY(most < 1.1 * first, "%g N", most);
}

/* ---- what is refused ---- */

TEST(wrong_bonds_are_refused)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID ball = ode_ball(d->world, d->space, MASS, BALL, (const double[3]){0.0, 0.0, 0.0});
  hap_detail detail;
  hap_force_id id;
  desk_run(d, 0.3, 0.0, 0.0);
  desk_wait(d, 60);
  const struct {
    hap_force_kind kind;
    hap_force_frame frame;
    void *body;
    hap_status status;
    const char *words;
  } rows[] = {{HAP_FORCE_CONSTANT, HAP_FORCE_BODY, ball, HAP_ERROR_ARGUMENT, "bound to no body"},
              {HAP_FORCE_SPRING, HAP_FORCE_BODY, NULL, HAP_ERROR_ARGUMENT, "body is NULL"},
              {HAP_FORCE_SPRING, HAP_FORCE_WORLD, ball, HAP_ERROR_ARGUMENT, "body is set"},
              {HAP_FORCE_SPRING, HAP_FORCE_BODY, d, HAP_ERROR_NOT_FOUND, "not known"}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    hap_force_def def = bound_def(rows[i].kind, rows[i].body);
    def.frame = rows[i].frame;
    CHECK(hap_pointer_force_add(d->session, d->hand, &def, &id) == rows[i].status);
    REQUIRE(hap_session_detail(d->session, &detail) == HAP_OK);
    CHECK_SAY(strstr(detail.text, rows[i].words) != NULL, "%s", detail.text);
  }
}

/* ---- recordings ---- */

TEST(a_replay_has_the_bonds)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID ball = ode_ball(d->world, d->space, MASS, BALL, (const double[3]){0.0, 0.0, 0.0});
  d->at[0] = 0.2;
  desk_record(d, "bonds.rec", 0.0);
  session_run(d->session);
  desk_glide(d, 0.0, 0.0, 0.01);
  hap_force_def def = bound_def(HAP_FORCE_SPRING, ball);
  def.stiffness = 50.0;
  (void)force_add(d, &def);
  desk_glide(d, 0.0, 0.02, 0.0);
  desk_glide(d, 0.05, 0.0, 0.0);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  hap_pointer_state last = desk_state(d);
  hap_pointer_id hand = d->hand;
  tap_release(d);

  desk *r = desk_new(0.0, HAP_MODEL_CONTACT);
  (void)ode_ball(r->world, r->space, MASS, BALL, (const double[3]){0.0, 0.0, 0.0});
  desk_replay(r, "bonds.rec");
  desk_replay_compare(r, hand, &last);
  CHECK(last.own.force[0] != 0.0);
}
