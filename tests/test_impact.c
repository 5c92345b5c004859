/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* What a material sounds like to the hand when it is hit, against the closed form: by the public
 * headers. */

#include "tests/tap.h"

#include <math.h>

#include "tests/desk.h"

#define SPEED 0.2   /* m/s */
#define GAP 0.01033 /* m, above the surface at the begin */
#define SIZE 8.0    /* N s/m */
#define DECAY 60.0
#define FREQUENCY 120.0

typedef struct struck {
  double force;
  double decay;
  double hz;
  int calls;
} struck;

static void struck_feel(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  struck *s = user;
  (void)pointer;
  (void)geom;
  CHECK(io->impact_force == 0.0);
  ++s->calls;
  io->impact_force = s->force;
  io->impact_decay = s->decay;
  io->impact_hz = s->hz;
}

static desk *struck_desk(hap_model model, struck *s)
{
  desk *d = desk_new(0.0, model);
  *s = (struck){SIZE, DECAY, FREQUENCY, 0};
  d->ode.pointer_surface = struck_feel;
  d->ode.user = s;
  return d;
}

static hap_wrench own_of(const desk *d)
{
  hap_pointer_state state;
  REQUIRE(hap_pointer_get(d->session, d->hand, &state, sizeof state) == HAP_OK);
  return state.own;
}

/* N, t seconds after a touch with that speed. */
static double struck_force(double speed, double t)
{
  return t < 0.0 ? 0.0 : SIZE * speed * exp(-DECAY * t) * sin(2.0 * M_PI * FREQUENCY * t);
}

/* A hand that goes down at one speed from a height over a surface at z = 0, a tick. */
static void hand_fall(desk *d, double speed, double period)
{
  d->velocity[2] = -speed;
  d->at[2] -= speed * period;
  hand_lead(d);
  REQUIRE(hap_session_advance(d->session, 1) == HAP_OK);
}

typedef struct struck_row {
  const char *name;
  hap_model model;
  double haptic_hz;
} struck_row;

static const struct struck_row rows[] = {
    {"a_tap_in_model_single", HAP_MODEL_SINGLE, 1000.0},
    {"a_tap_in_model_impulse", HAP_MODEL_IMPULSE, 1000.0},
    {"a_tap_in_model_accelerance", HAP_MODEL_ACCELERANCE, 1000.0},
    {"a_tap_in_model_contact", HAP_MODEL_CONTACT, 1000.0},
    {"a_tap_at_5_khz", HAP_MODEL_CONTACT, 5000.0},
    {"a_tap_at_10_khz", HAP_MODEL_CONTACT, 10000.0},
};

TEST_EACH(rows, const struck_row *row)
{
  struck s;
  double period = 1.0 / row->haptic_hz;
  desk *d = struck_desk(row->model, &s);
  d->def.haptic_hz = row->haptic_hz;
  floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS + GAP);
  desk_wait(d, 1);
  double off = 0.0;
  int first = 0;
  int ticks = (int)(0.25 / period);
  for (int i = 1; i <= ticks; ++i) {
    hand_fall(d, SPEED, period);
    double depth = RADIUS - d->at[2];
    double force = own_of(d).force[2];
    first = first == 0 && force != 0.0 ? i : first;
    off = fmax(off, fabs(force - struck_force(SPEED, depth / SPEED)));
    CHECK((force != 0.0) == (first != 0) || fabs(force) < 1e-2);
  }
  printf("# off by %.2g N of %.3g, from tick %d on\n", off, SIZE * SPEED, first);
  CHECK(off <= 0.002); /* what is below 1 mN ends */
  CHECK(first == (int)ceil(GAP / SPEED / period - 1e-9));
  CHECK(own_of(d).force[2] == 0.0); /* long over */
}

/* A body that comes gives the same as a hand that goes; and it gets nothing of it. */
TEST(a_body_that_comes_is_a_tap_as_well)
{
  struck s;
  desk *d = struck_desk(HAP_MODEL_CONTACT, &s);
  dBodyID ball = ode_ball(d->world, d->space, 1000.0, 0.02, AT(0.0, 0.0, 0.0));
  dBodySetLinearVel(ball, 0.0, 0.0, SPEED);
  desk_run(d, 0.0, 0.0, 0.02 + RADIUS + GAP);
  double off = 0.0;
  double most = 0.0;
  for (int i = 1; i <= 150; ++i) {
    desk_wait(d, 1);
    double force = own_of(d).force[2];
    off = fmax(off, fabs(force - struck_force(SPEED, (i - 1) * T - GAP / SPEED)));
    most = fmax(most, force);
  }
  printf("# off by %.2g N of %.4g\n", off, most);
  CHECK(off <= 0.02 * most && most > 1.0); /* a tick sees bodies as they are at its begin */
  CHECK_NEAR(dBodyGetLinearVel(ball)[2], SPEED, 0.01 * SPEED);
}

TEST(each_tap_answers_and_one_that_stays_does_not)
{
  struck s;
  desk *d = struck_desk(HAP_MODEL_CONTACT, &s);
  floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS + 0.004);
  int answers = 0;
  bool quiet = true;
  for (int tap = 0; tap < 3; ++tap) {
    desk_move(d, 0.0, 0.0, -0.005, 25);
    answers += own_of(d).force[2] != 0.0;
    desk_wait(d, 200);
    quiet = quiet && own_of(d).force[2] == 0.0;
    desk_move(d, 0.003, 0.0, 0.0, 30); /* along, pressed */
    quiet = quiet && own_of(d).force[2] == 0.0;
    desk_move(d, 0.0, 0.0, 0.005, 25);
    desk_wait(d, 10);
  }
  CHECK(answers == 3 && quiet);
}

/* Eight at once, as hard as can be. */
TEST(all_together_are_bounded)
{
  struck s;
  desk *d = struck_desk(HAP_MODEL_CONTACT, &s);
  s.force = 1000.0;
  for (int i = 0; i < 8; ++i) {
    dGeomID tile = dCreateBox(d->space, 0.02, 0.02, 0.02);
    dGeomSetPosition(tile, 0.02 * (i % 4) - 0.03, i < 4 ? -0.01 : 0.01, -0.01);
  }
  double corners[8 * 3];
  for (int i = 0; i < 24; ++i) {
    corners[i] = (i / 3 >> i % 3 & 1) != 0 ? 0.035 : -0.035;
  }
  d->hand_def.radius = 0.0;
  d->hand_def.hull_xyz = corners;
  d->hand_def.hull_points = 8;
  desk_run(d, 0.0, 0.0, 0.035 + 0.01);
  double most = 0.0;
  for (int i = 0; i < 100; ++i) {
    hand_fall(d, SPEED, T);
    const hap_wrench own = own_of(d);
    most = fmax(most, sqrt(own.force[0] * own.force[0] + own.force[1] * own.force[1] +
                           own.force[2] * own.force[2]));
  }
  printf("# at most %.4g N\n", most);
  CHECK(most <= 5.0 + 1e-9 && most > 4.0);
}

/* A hand that springs with the vibration, so that each half of it gives: the mean stays at 1 W, and
 * the purse of 0.1 s is spent once. */
TEST(a_hand_that_goes_with_it_gets_no_more_than_the_power)
{
  struck s;
  desk *d = struck_desk(HAP_MODEL_CONTACT, &s);
  s.force = 1000.0;
  s.decay = 10.0;
  s.hz = 20.0;
  floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS + 0.001);
  desk_wait(d, 1);
  hand_fall(d, 2.0, T);
  double work = 0.0;
  double most = 0.0;
  for (int i = 0; i < 300; ++i) {
    double force = own_of(d).force[2];
    double way = 5e-4 * (force > 0.0 ? 1.0 : -1.0);
    work += force * way;
    most = fmax(most, work - 1e-3 * i);
    d->velocity[2] = way / T;
    d->at[2] += way;
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) == HAP_OK);
  }
  printf("# %.3f J in 0.3 s, %.3f J above 1 W at most\n", work, most);
  CHECK(most <= 0.15 && work > 0.05);
}

typedef struct bad_row {
  const char *name;
  struck says;
} bad_row;

static const struct bad_row bad[] = {
    {"a_force_below_0", {-1.0, DECAY, FREQUENCY, 0}},
    {"a_force_that_is_nan", {NAN, DECAY, FREQUENCY, 0}},
    {"a_force_beyond_its_range", {1001.0, DECAY, FREQUENCY, 0}},
    {"one_that_never_ends", {SIZE, 9.0, FREQUENCY, 0}},
    {"a_decay_that_is_nan", {SIZE, NAN, FREQUENCY, 0}},
    {"a_decay_beyond_its_range", {SIZE, INFINITY, FREQUENCY, 0}},
    {"a_frequency_of_0", {SIZE, DECAY, 0.0, 0}},
    {"a_frequency_that_the_loop_cannot_make", {SIZE, DECAY, 251.0, 0}},
};

TEST_EACH(bad, const bad_row *row)
{
  struck s;
  desk *d = struck_desk(HAP_MODEL_CONTACT, &s);
  s = row->says;
  floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS + 0.004);
  hap_status status = HAP_OK;
  for (int i = 0; i < 60 && status == HAP_OK; ++i) {
    status = hap_session_advance(d->session, 1);
  }
  CHECK(status == HAP_FAULTED);
  CHECK(s.calls > 0);
}
