/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Own forces, by the public headers, against closed forms. */

#include "tests/tap.h"

#include <math.h>

#include <hapode/expert.h>
#include <hapode/forces.h>

#include "base/vec.h"
#include "tests/desk.h"

#define EXACT 1e-9 /* N */

static hap_force_def force_of(hap_force_kind kind)
{
  hap_force_def def;
  hap_force_def_init(&def, sizeof def);
  def.kind = (uint32_t)kind;
  def.fade_in_s = 0.0;
  return def;
}

static hap_force_id force_add(desk *d, const hap_force_def *def)
{
  hap_force_id id = {0};
  REQUIRE(hap_pointer_force_add(d->session, d->hand, def, &id) == HAP_OK);
  CHECK(id.v != 0);
  return id;
}

/* A tick at this place and velocity; what the hand feels. */
static hap_wrench felt_at(desk *d, const double at[3], const double velocity[3])
{
  memcpy(d->at, at, sizeof d->at);
  memcpy(d->velocity, velocity, sizeof d->velocity);
  hand_lead(d);
  REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
  return desk_state(d).wrench;
}

static void detail_has(desk *d, const char *words)
{
  hap_detail detail;
  REQUIRE(hap_session_detail(d->session, &detail) == HAP_OK);
  if (strstr(detail.text, words) == NULL) {
    printf("# %s\n", detail.text);
  }
  CHECK(strstr(detail.text, words) != NULL);
}

#define STILL ((const double[3]){0.0, 0.0, 0.0})
#define HERE(x, y, z) ((const double[3]){x, y, z})

/* ---- what each of them is ---- */

TEST(a_constant_force_is_felt_as_it_is_and_in_the_axes_of_the_hand)
{
  desk *d = desk_in_air(0.0, 0.0, 0.3);
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  def.force[0] = 1.5;
  def.torque[1] = 0.25;
  hap_force_id id = force_add(d, &def);
  hap_wrench felt = felt_at(d, HERE(0.0, 0.0, 0.3), STILL);
  check_vector(felt.force, 1.5, 0.0, 0.0, EXACT);
  check_vector(felt.torque, 0.0, 0.25, 0.0, EXACT);
  check_vector(desk_state(d).own.force, 1.5, 0.0, 0.0, EXACT);
  def.frame = HAP_FORCE_POINTER;
  CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
  const hap_pose quarter = {{0.0, 0.0, 0.3}, {sqrt(0.5), 0.0, 0.0, sqrt(0.5)}}; /* about z */
  REQUIRE(hap_pointer_set_target(d->session, d->hand, &quarter, NULL) == HAP_OK);
  REQUIRE(hap_session_advance(d->session, 40) >= HAP_OK);
  felt = desk_state(d).wrench;
  check_vector(felt.force, 0.0, 1.5, 0.0, EXACT);
  check_vector(felt.torque, -0.25, 0.0, 0.0, EXACT);
}

TEST(a_spring_pulls_to_a_point_a_line_and_a_plane)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_SPRING);
  def.stiffness = 200.0;
  def.damping = 3.0;
  def.origin[0] = 0.01;
  def.axis[2] = 7.0; /* of any length */
  const double at[3] = {0.03, -0.02, 0.05};
  const double velocity[3] = {0.1, 0.2, -0.3};
  const double want[3][3] = {{-200.0 * 0.02 - 0.3, 4.0 - 0.6, -10.0 + 0.9},
                             {-200.0 * 0.02 - 0.3, 4.0 - 0.6, 0.0},
                             {0.0, 0.0, -10.0 + 0.9}};
  for (uint32_t target = 0; target < 3; ++target) {
    def.target = target;
    hap_force_id id = force_add(d, &def);
    hap_wrench felt = felt_at(d, at, velocity);
    check_vector(felt.force, want[target][0], want[target][1], want[target][2], EXACT);
    CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
    desk_wait(d, 40);
    check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, EXACT);
  }
}

TEST(a_medium_brakes_and_a_weight_hangs_at_its_point)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def medium = force_of(HAP_FORCE_VISCOUS);
  hap_force_def weight = force_of(HAP_FORCE_WEIGHT);
  medium.damping = 4.0;
  weight.mass = 0.2;
  weight.point[0] = 0.1;
  (void)force_add(d, &medium);
  hap_wrench felt = felt_at(d, HERE(0.0, 0.0, 0.0), HERE(0.5, -0.25, 0.0));
  check_vector(felt.force, -2.0, 1.0, 0.0, EXACT);
  (void)force_add(d, &weight);
  felt = felt_at(d, HERE(0.0, 0.0, 0.0), STILL);
  check_vector(felt.force, 0.0, 0.0, -0.2 * 9.81, EXACT);
  check_vector(felt.torque, 0.0, 0.1 * 0.2 * 9.81, 0.0, EXACT);
}

TEST(a_magnet_is_strongest_on_the_way_and_ends_at_its_range)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_MAGNET);
  def.strength = 3.0;
  def.range = 0.03;
  (void)force_add(d, &def);
  double largest = 0.0;
  double where = 0.0;
  for (int i = 0; i < 310; ++i) {
    double x = 1e-4 * i;
    double force = -felt_at(d, HERE(x, 0.0, 0.0), STILL).force[0];
    CHECK(force >= 0.0);
    where = force > largest ? x : where;
    largest = fmax(force, largest);
  }
  CHECK_NEAR(largest, 3.0, 1e-3);
  CHECK_NEAR(where, 0.03 / sqrt(3.0), 1e-4);
  check_vector(felt_at(d, HERE(0.0, 0.0, 0.0301), STILL).force, 0.0, 0.0, 0.0, EXACT);
}

TEST(detents_hold_at_their_places)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_DETENTS);
  def.strength = 2.0;
  def.pitch = 0.01;
  def.origin[1] = 0.002;
  def.axis[1] = 1.0;
  def.axis[2] = 0.0;
  (void)force_add(d, &def);
  for (int n = -3; n <= 3; ++n) {
    double at = 0.002 + 0.01 * n;
    check_vector(felt_at(d, HERE(0.0, at, 0.0), STILL).force, 0.0, 0.0, 0.0, EXACT);
    check_vector(felt_at(d, HERE(0.0, at + 0.0025, 0.0), STILL).force, 0.0, -2.0, 0.0, EXACT);
    check_vector(felt_at(d, HERE(0.3, at - 0.001, 0.2), STILL).force, 0.0,
                 2.0 * sin(2.0 * M_PI * 0.1), 0.0, EXACT);
  }
}

/* J that the force gives on a closed way of 4 cm across, off the middle. */
static double round_trip(desk *d)
{
  double sum = 0.0;
  double before[3] = {0.0};
  double force[3] = {0.0};
  for (int i = 0; i <= 2000; ++i) {
    double a = 2.0 * M_PI * i / 2000.0;
    const double at[3] = {0.005 + 0.02 * cos(a), 0.02 * sin(a), 0.003 * sin(2.0 * a)};
    hap_wrench felt = felt_at(d, at, STILL);
    for (int k = 0; k < 3 && i > 0; ++k) {
      sum += 0.5 * (felt.force[k] + force[k]) * (at[k] - before[k]);
    }
    memcpy(before, at, sizeof before);
    memcpy(force, felt.force, sizeof force);
  }
  return sum;
}

TEST(springs_magnets_and_detents_do_no_work_on_a_closed_way)
{
  const hap_force_kind kinds[] = {HAP_FORCE_SPRING, HAP_FORCE_MAGNET, HAP_FORCE_DETENTS};
  for (int k = 0; k < 3; ++k) {
    desk *d = desk_in_air(0.025, 0.0, 0.0);
    hap_force_def def = force_of(kinds[k]);
    def.stiffness = 100.0;
    def.strength = 2.0;
    def.max_power = 1e6; /* the way is gone too fast for a hand */
    (void)force_add(d, &def);
    (void)felt_at(d, HERE(0.025, 0.0, 0.0), STILL);
    CHECK_NEAR(round_trip(d), 0.0, 2e-5); /* of 0.04 J that go to and fro */
    tap_release(d);
  }
}

/* ---- vibration ---- */

typedef struct spectrum {
  double amplitude;
  double mean;
} spectrum;

/* Of the force along z, at hz over so many ticks. */
static spectrum wave_listen(desk *d, double hz, int ticks)
{
  double sine = 0.0;
  double cosine = 0.0;
  spectrum out = {0.0, 0.0};
  for (int i = 0; i < ticks; ++i) {
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    double force = desk_state(d).wrench.force[2];
    sine += force * sin(2.0 * M_PI * hz * i * T) / ticks;
    cosine += force * cos(2.0 * M_PI * hz * i * T) / ticks;
    out.mean += force / ticks;
  }
  out.amplitude = 2.0 * sqrt(sine * sine + cosine * cosine);
  return out;
}

TEST(a_vibration_has_its_amplitude_and_no_mean)
{
  const double hz[] = {7.0, 60.0, 123.0, 250.0, 401.0};
  for (int i = 0; i < 5; ++i) {
    desk *d = desk_in_air(0.0, 0.0, 0.0);
    hap_force_def def = force_of(HAP_FORCE_VIBRATION);
    def.strength = 1.2;
    def.vibration.hz = hz[i];
    (void)force_add(d, &def);
    spectrum s = wave_listen(d, hz[i], 1000);
    CHECK_NEAR(s.amplitude, 1.2, 0.02 * 1.2);
    CHECK(fabs(s.mean) <= 0.005 * 1.2);
    tap_release(d);
  }
}

TEST(a_vibration_comes_holds_and_goes)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_VIBRATION);
  def.strength = 2.0;
  def.vibration.hz = 250.0; /* every other tick is a peak */
  def.vibration.attack_s = 0.1;
  def.vibration.hold_s = 0.05;
  def.vibration.decay_s = 0.2;
  hap_force_id id = force_add(d, &def);
  for (int again = 0; again < 2; ++again) {
    for (int i = 0; i < 400; ++i) {
      REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
      double t = i * T;
      double envelope = fmax(fmin(fmin(t / 0.1, 1.0), (0.35 - t) / 0.2), 0.0);
      double want = 2.0 * envelope * sin(2.0 * M_PI * 250.0 * t);
      CHECK_NEAR(desk_state(d).wrench.force[2], want, 1e-6);
    }
    def.vibration.restart = 1;
    CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
  }
}

TEST(samples_are_played_again_and_again)
{
  float wave[3] = {0.0f, 1.0f, -0.5f};
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_VIBRATION);
  def.strength = 2.0;
  def.vibration.samples = wave;
  def.vibration.sample_count = 3;
  def.vibration.sample_hz = 500.0;
  (void)force_add(d, &def);
  memset(wave, 0, sizeof wave); /* they are copied */
  const double want[6] = {0.0, 1.0, 2.0, 0.5, -1.0, -0.5};
  for (int i = 0; i < 60; ++i) {
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    CHECK_NEAR(desk_state(d).wrench.force[2], want[i % 6], 1e-9);
  }
}

/* ---- beside contacts ---- */

/* N along x and z, of a stroke over a floor in a medium. */
static void stroke_feel(hap_model model, double out[3])
{
  desk *d = desk_new(0.0, model);
  hap_force_def def = force_of(HAP_FORCE_VISCOUS);
  floor_add(d);
  d->hand_def.friction = 0.2;
  def.damping = 6.0;
  desk_run(d, 0.0, 0.0, RADIUS + 0.001);
  (void)force_add(d, &def);
  desk_wait(d, 60);
  desk_move(d, 0.0, 0.0, -0.004, 100);
  desk_move(d, 0.1, 0.0, 0.0, 500);
  memcpy(out, desk_state(d).wrench.force, 3 * sizeof out[0]);
  tap_release(d);
}

TEST(a_medium_beside_a_contact_is_the_reference_and_the_closed_form)
{
  double single[3];
  double contact[3];
  stroke_feel(HAP_MODEL_SINGLE, single);
  stroke_feel(HAP_MODEL_CONTACT, contact);
  double press = STIFFNESS * 0.003;
  check_vector(single, -0.2 * press - 6.0 * 0.2, 0.0, press, 0.005 * press);
  check_vector(contact, single[0], single[1], single[2], 0.005 * press);
}

TEST(the_hand_feels_it_behind_a_proxy_which_does_not)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_pointer_expert_def expert;
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  hap_pointer_expert_def_init(&expert, sizeof expert);
  expert.coupling = HAP_COUPLING_PROXY;
  expert.coupling_stiffness = 500.0;
  expert.coupling_damping = 1.0;
  d->hand_def.expert = &expert;
  floor_add(d);
  desk_run(d, 0.0, 0.0, RADIUS + 0.001);
  desk_wait(d, 60);
  desk_move(d, 0.0, 0.0, -0.004, 100);
  desk_wait(d, 200);
  hap_pointer_state before = desk_state(d);
  def.force[2] = -2.0;
  (void)force_add(d, &def);
  desk_wait(d, 100);
  hap_pointer_state after = desk_state(d);
  CHECK_NEAR(after.wrench.force[2], before.wrench.force[2] - 2.0, 1e-6);
  CHECK_NEAR(after.proxy.position[2], before.proxy.position[2], 1e-9);
}

/* ---- coming, changing, going ---- */

TEST(a_force_fades_in_changes_without_a_leap_and_fades_out)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  def.force[0] = 4.0;
  def.fade_in_s = 0.1;
  hap_force_id id = force_add(d, &def);
  for (int i = 1; i <= 120; ++i) {
    desk_wait(d, 1);
    CHECK_NEAR(desk_state(d).wrench.force[0], fmin(0.04 * i, 4.0), EXACT);
  }
  double before = 4.0;
  def.force[0] = -4.0;
  for (int k = 0; k < 4; ++k) { /* changed again before it is there */
    def.force[0] = -def.force[0];
    CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
    for (int i = 0; i < (k < 3 ? 7 : 40); ++i) {
      desk_wait(d, 1);
      double now = desk_state(d).wrench.force[0];
      CHECK(fabs(now - before) <= 8.0 / 20.0 + EXACT);
      before = now;
    }
  }
  CHECK_NEAR(before, -4.0, EXACT);
  CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
  CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_ERROR_NOT_FOUND);
  for (int i = 0; i <= 21; ++i) {
    desk_wait(d, 1);
    CHECK_NEAR(desk_state(d).wrench.force[0], fmin(-4.0 + 0.2 * i, 0.0), EXACT);
  }
}

TEST(forces_are_there_before_the_start_and_after_a_stop)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  def.force[1] = 1.0;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  (void)force_add(d, &def);
  hand_lead(d);
  for (int k = 0; k < 2; ++k) {
    session_run(d->session);
    desk_wait(d, 50);
    CHECK_NEAR(desk_state(d).wrench.force[1], 1.0, EXACT);
    CHECK(hap_session_stop(d->session) == HAP_OK);
  }
}

TEST(no_force_acts_under_a_fault)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  def.force[1] = 3.0;
  hap_force_id id = force_add(d, &def);
  desk_wait(d, 40);
  hap_emergency_zero();
  desk_wait(d, 300);
  check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 0.0);
  CHECK(hap_session_reset_fault(d->session) == HAP_OK);
  double before = 0.0;
  for (int i = 0; i < 40; ++i) {
    desk_wait(d, 1);
    double now = desk_state(d).wrench.force[1];
    CHECK(now - before <= 3.0 / 20.0 + EXACT);
    before = now;
  }
  CHECK_NEAR(before, 3.0, EXACT);
  hap_emergency_zero();
  desk_wait(d, 10);
  CHECK(hap_pointer_force_remove(d->session, d->hand, id) == HAP_OK);
  desk_wait(d, 10);
  CHECK(hap_session_reset_fault(d->session) == HAP_OK);
  desk_wait(d, 40);
  check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 0.0);
}

/* ---- promises ---- */

TEST(a_force_keeps_the_largest_force_that_it_promises)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_SPRING);
  def.stiffness = 1000.0;
  def.max_force = 2.5;
  (void)force_add(d, &def);
  hap_wrench felt = felt_at(d, HERE(0.03, 0.0, -0.04), STILL);
  check_vector(felt.force, -1.5, 0.0, 2.0, EXACT);
}

TEST(the_power_of_a_force_is_bounded_and_no_medium_gives_any)
{
  const double speed = 3.0;
  for (int gives = 0; gives < 2; ++gives) {
    desk *d = desk_in_air(-1.0, 0.0, 0.0);
    hap_force_def def = force_of(HAP_FORCE_CONSTANT);
    double joules = 0.0;
    def.force[0] = gives ? 2.0 : -2.0;
    def.max_power = 0.5;
    (void)force_add(d, &def);
    desk_wait(d, 20);
    for (int i = 0; i < 500; ++i) {
      joules += speed * T * desk_state(d).wrench.force[0];
      (void)felt_at(d, HERE(-1.0 + speed * T * i, 0.0, 0.0), HERE(speed, 0.0, 0.0));
    }
    if (gives) {
      CHECK(joules <= 0.5 * (0.5 + 0.1) + 0.02 && joules > 0.25);
      CHECK((desk_state(d).guard & HAP_GUARD_OWN) != 0);
    } else { /* what resists a hand is not bounded */
      CHECK_NEAR(joules, -2.0 * speed * 0.5, 0.05);
      CHECK(desk_state(d).guard == 0);
    }
    tap_release(d);
  }
  /* A velocity that is a tick old, of a hand that shakes as fast as it can. */
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def medium = force_of(HAP_FORCE_VISCOUS);
  double joules = 0.0;
  double most = 0.0;
  double at = 0.0;
  medium.damping = 10.0;
  medium.max_force = 5.0;
  (void)force_add(d, &medium);
  for (int i = 0; i < 1000; ++i) {
    double before = at;
    at = 0.0002 * sin(2.0 * M_PI * 200.0 * i * T + 0.3);
    joules += desk_state(d).wrench.force[0] * (at - before);
    most = fmax(joules, most);
    double old = 0.0002 * 2.0 * M_PI * 200.0 * cos(2.0 * M_PI * 200.0 * (i - 1) * T + 0.3);
    (void)felt_at(d, HERE(at, 0.0, 0.0), HERE(old, 0.0, 0.0));
  }
  CHECK(most <= 6e-3); /* 0.5 mJ, and as much each 0.1 s; without a bound 0.09 J */
}

/* Where nobody promises less, a force gives what it would give at 1 m/s and at 10 rad/s: 2 W and
 * 1 W here, and what they come to in 0.1 s at once. The hand goes three times as fast. */
TEST(without_a_promise_the_power_is_that_of_a_slow_hand)
{
  for (int turns = 0; turns < 2; ++turns) {
    desk *d = desk_in_air(0.0, 0.0, 0.0);
    hap_force_def def = force_of(HAP_FORCE_CONSTANT);
    const double rate = turns ? 30.0 : 3.0;
    double joules = 0.0;
    (turns ? def.torque : def.force)[0] = turns ? 0.1 : 2.0;
    (void)force_add(d, &def);
    for (int i = 0; i < 500; ++i) {
      double x = rate * T * i;
      hap_pose pose = {{turns ? 0.0 : x, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
      hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
      pose.quat_wxyz[0] = turns ? cos(0.5 * x) : 1.0;
      pose.quat_wxyz[1] = turns ? sin(0.5 * x) : 0.0;
      (turns ? twist.angular : twist.linear)[0] = rate;
      REQUIRE(hap_pointer_set_target(d->session, d->hand, &pose, &twist) == HAP_OK);
      REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
      hap_wrench felt = desk_state(d).wrench;
      joules += rate * T * (turns ? felt.torque : felt.force)[0];
    }
    double power = turns ? 10.0 * 0.1 : 1.0 * 2.0;
    CHECK_NEAR(joules, power * (0.5 + 0.1), 0.02 * power);
    tap_release(d);
  }
}

/* A medium that may give nothing gave by mistake, as its velocity was old. The debt counts against
 * its largest force on 0.1 mm: half of that leaves half of the force, and is forgiven in 0.1 s. */
TEST(a_debt_of_half_the_force_on_a_tenth_of_a_millimetre_leaves_half)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def medium = force_of(HAP_FORCE_VISCOUS);
  const double *old = HERE(-0.5, 0.0, 0.0);
  medium.damping = 10.0;
  medium.max_force = 5.0;
  (void)force_add(d, &medium);
  CHECK_NEAR(felt_at(d, STILL, old).force[0], 5.0, EXACT);
  (void)felt_at(d, HERE(5e-5, 0.0, 0.0), old);
  double debt = 0.5 * (1.0 - T / 0.1);
  CHECK_NEAR(felt_at(d, HERE(5e-5, 0.0, 0.0), old).force[0], 5.0 * (1.0 - debt), 1e-6);
  debt *= 1.0 - T / 0.1;
  CHECK_NEAR(felt_at(d, HERE(5e-5, 0.0, 0.0), old).force[0], 5.0 * (1.0 - debt), 1e-6);
}

/* In a medium as thick as can be, the lightest device that does not tell its mass comes to rest
 * in 10 ms. It never turns round, as with more damping it would swing from tick to tick. */
TEST(a_light_device_comes_to_rest_in_the_thickest_medium)
{
  const double mass = 0.05;
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def medium = force_of(HAP_FORCE_VISCOUS);
  hap_force_id id;
  double at[3] = {0.0, 0.0, 0.0};
  double velocity[3] = {0.1, 0.0, 0.0};
  medium.damping = 1e4;
  CHECK(hap_pointer_force_add(d->session, d->hand, &medium, &id) == HAP_SATURATED);
  for (int i = 0; i < 10; ++i) {
    velocity[0] += T / mass * felt_at(d, at, velocity).force[0];
    at[0] += T * velocity[0];
    CHECK(velocity[0] > -1e-9);
  }
  CHECK(velocity[0] < 0.005);
}

/* ---- what is refused ---- */

typedef struct wrong_row {
  const char *name;
  const char *words;
  void (*spoil)(hap_force_def *def);
} wrong_row;

static const float loud[2] = {0.0f, 1.5f};

static void spoil_kind(hap_force_def *def)
{
  def->kind = 0;
}

static void spoil_axis(hap_force_def *def)
{
  def->axis[2] = 0.0;
}

static void spoil_origin(hap_force_def *def)
{
  def->origin[1] = NAN;
}

static void spoil_frame(hap_force_def *def)
{
  def->kind = HAP_FORCE_SPRING;
  def->frame = HAP_FORCE_POINTER;
}

static void spoil_hz(hap_force_def *def)
{
  def->vibration.hz = 451.0;
}

static void spoil_samples(hap_force_def *def)
{
  def->vibration.samples = loud;
  def->vibration.sample_count = 2;
}

static void spoil_count(hap_force_def *def)
{
  def->vibration.samples = loud;
}

static void spoil_power(hap_force_def *def)
{
  def->max_power = -2.0;
}

static const wrong_row wrong[] = {
    {"no_kind_is_refused", "kind", spoil_kind},
    {"an_axis_of_no_length_is_refused", "axis", spoil_axis},
    {"an_origin_that_is_not_finite_is_refused", "origin", spoil_origin},
    {"a_spring_to_the_hand_itself_is_refused", "frame", spoil_frame},
    {"a_vibration_beyond_the_rate_is_refused", "hz", spoil_hz},
    {"a_sample_beyond_1_is_refused", "sample 1", spoil_samples},
    {"samples_without_their_number_are_refused", "sample_count", spoil_count},
    {"a_power_below_0_is_refused", "max_power", spoil_power},
};

TEST_EACH(wrong, const wrong_row *row)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_id id = {7};
  hap_force_def def = force_of(HAP_FORCE_VIBRATION);
  row->spoil(&def);
  CHECK(hap_pointer_force_add(d->session, d->hand, &def, &id) == HAP_ERROR_ARGUMENT);
  CHECK(id.v == 0);
  detail_has(d, row->words);
}

TEST(places_ids_and_wrong_calls)
{
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  hap_force_def raw;
  hap_force_id ids[HAP_FORCES_MAX];
  hap_force_id other;
  const hap_force_id none = {0};
  def.force[0] = 0.1;
  memset(&raw, 0, sizeof raw);
  for (int i = 0; i < HAP_FORCES_MAX; ++i) {
    ids[i] = force_add(d, &def);
  }
  CHECK(hap_pointer_force_add(d->session, d->hand, &def, &other) == HAP_ERROR_CAPACITY);
  desk_wait(d, 5);
  CHECK_NEAR(desk_state(d).wrench.force[0], 1.6, EXACT);
  CHECK(hap_pointer_force_remove(d->session, d->hand, ids[3]) == HAP_OK);
  other = force_add(d, &def);
  CHECK(other.v != ids[3].v);
  CHECK(hap_pointer_force_remove(d->session, d->hand, ids[3]) == HAP_ERROR_NOT_FOUND);
  desk_wait(d, 30);
  CHECK_NEAR(desk_state(d).wrench.force[0], 1.6, EXACT);
  CHECK(hap_pointer_force_set(d->session, d->hand, none, &def) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_force_add(d->session, d->hand, NULL, &other) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_force_add(d->session, d->hand, &def, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_force_add(NULL, d->hand, &def, &other) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_force_add(d->session, d->hand, &raw, &other) == HAP_ERROR_UNINITIALISED);
  hap_pointer_id gone = d->hand;
  REQUIRE(hap_pointer_remove(d->session, d->hand) == HAP_OK);
  CHECK(hap_pointer_force_add(d->session, gone, &def, &other) == HAP_ERROR_NOT_FOUND);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  hand_lead(d);
  desk_wait(d, 30); /* another pointer has none of them */
  check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 0.0);
  for (int kind = 1; kind <= 8; ++kind) {
    CHECK(hap_force_kind_name((hap_force_kind)kind) != NULL);
  }
  CHECK(hap_force_kind_name((hap_force_kind)9) == NULL);
}

TEST(waves_that_are_replaced_give_their_memory_back)
{
  float wave[HAP_FORCE_SAMPLES_MAX] = {0.0f};
  desk *d = desk_in_air(0.0, 0.0, 0.0);
  hap_force_def def = force_of(HAP_FORCE_VIBRATION);
  def.strength = 1.0;
  def.vibration.samples = wave;
  def.vibration.sample_count = HAP_FORCE_SAMPLES_MAX;
  hap_force_id id = force_add(d, &def);
  for (int i = 0; i < 300; ++i) {
    wave[0] = (float)i / 300.0f;
    CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
    desk_wait(d, 2);
  }
  for (int i = 0; i < 70; ++i) { /* without a tick in between there is an end */
    hap_status status = hap_pointer_force_set(d->session, d->hand, id, &def);
    CHECK(status == (i < 62 ? HAP_OK : HAP_ERROR_MEMORY) || (i >= 60 && i <= 64));
  }
  desk_wait(d, 2);
  CHECK(hap_pointer_force_set(d->session, d->hand, id, &def) == HAP_OK);
}

/* ---- a device ---- */

TEST(what_a_device_cannot_hold_is_cut_and_said)
{
  hap_detail why = {""};
  hap_force_id id = {0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_device *device = NULL;
  REQUIRE(hap_device_open("virtual:path=0:0/0/0;1:0.1/0/0,rated_stiffness=2000,device_damping=2",
                          &device, &why) >= HAP_OK);
  d->hand_def.device = device;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  hap_force_def medium = force_of(HAP_FORCE_VISCOUS);
  medium.damping = 1e4;
  CHECK(hap_pointer_force_add(d->session, d->hand, &medium, &id) == HAP_SATURATED);
  detail_has(d, "damping");
  hap_force_def spring = force_of(HAP_FORCE_SPRING);
  spring.stiffness = 1e6;
  CHECK(hap_pointer_force_add(d->session, d->hand, &spring, &id) == HAP_SATURATED);
  detail_has(d, "stiffness");
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(device);
}

/* The device stands 0.25 mm from the target, and holds 2 kN/m. */
static void steep_check(const hap_force_def *def, double expected, const char *word)
{
  hap_detail why = {""};
  hap_force_id id = {0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_device *device = NULL;
  REQUIRE(hap_device_open("virtual:path=0:0.00025/0/0;9:0.00025/0/0,rated_stiffness=2000", &device,
                          &why) >= HAP_OK);
  d->hand_def.device = device;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  CHECK(hap_pointer_force_add(d->session, d->hand, def, &id) == HAP_SATURATED);
  detail_has(d, word);
  REQUIRE(hap_session_advance(d->session, 60) >= HAP_OK);
  CHECK_NEAR(desk_state(d).own.force[0], expected, EXACT);
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(device);
}

/* On a way of a millimetre, 5 N is as steep as a spring that no device holds. */
TEST(magnets_and_detents_are_as_steep_as_the_device_holds)
{
  hap_force_def detents = force_of(HAP_FORCE_DETENTS);
  detents.axis[0] = 1.0, detents.axis[2] = 0.0;
  detents.strength = 5.0;
  detents.pitch = 1e-3;
  steep_check(&detents, -2000.0 * detents.pitch / (2.0 * M_PI), "strength 5");
  hap_force_def magnet = force_of(HAP_FORCE_MAGNET);
  magnet.strength = 5.0;
  magnet.range = 1e-3;
  const double u = 0.25; /* 2 kN/m in the middle, less farther out: docs/forces.md */
  steep_check(&magnet, -2000.0 * 0.25e-3 * (1.0 - u * u), "strength 5");
}

static void scales_set(desk *d, double force_scale, double motion_scale)
{
  hap_pointer_settings s;
  hap_pointer_settings_init(&s, sizeof s);
  s.mask = HAP_SET_FORCE_SCALE | HAP_SET_MOTION_SCALE;
  s.force_scale = force_scale;
  s.motion_scale = motion_scale;
  REQUIRE(hap_pointer_set(d->session, d->hand, &s) == HAP_OK);
  REQUIRE(hap_session_advance(d->session, 60) >= HAP_OK);
}

/* The device stands 0.25 mm from the target and holds 2 kN/m, 1 kN/m of which are asked. The
 * pointer stays where it is when motion_scale changes. */
TEST(what_a_device_holds_goes_with_its_scales)
{
  const struct {
    double force_scale;
    double motion_scale;
    double stiffness; /* N/m, in the world */
  } rows[] = {{1.0, 1.0, 1000.0}, {2.0, 1.0, 1000.0}, {8.0, 1.0, 250.0},
              {1.0, 10.0, 200.0}, {4.0, 4.0, 125.0},  {0.5, 1.0, 1000.0}};
  hap_detail why = {""};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_device *device = NULL;
  REQUIRE(hap_device_open("virtual:path=0:0.00025/0/0;9:0.00025/0/0,rated_stiffness=2000", &device,
                          &why) >= HAP_OK);
  d->hand_def.device = device;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  hap_force_def spring = force_of(HAP_FORCE_SPRING);
  spring.stiffness = 1000.0;
  hap_force_id id = force_add(d, &spring);
  session_run(d->session);
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    scales_set(d, rows[i].force_scale, rows[i].motion_scale);
    hap_pointer_state state = desk_state(d);
    CHECK_NEAR(state.own.force[0], -rows[i].stiffness * 0.25e-3, EXACT);
    CHECK(((state.guard & HAP_GUARD_OWN) != 0) == (rows[i].stiffness < 1000.0));
  }
  CHECK(hap_pointer_force_set(d->session, d->hand, id, &spring) == HAP_OK); /* of now */
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(device);
}

typedef struct both_row {
  const char *hand;
  double delay;     /* s, of the device */
  double stiffness; /* N/m, that the device holds: 0.8 of 2 N s/m over half a tick and the delay */
} both_row;

/* A contact and a spring, each as stiff as the device holds, and a blow. */
static desk *both_make(const both_row *row)
{
  char spec[256];
  hap_detail why = {""};
  hap_force_id id = {0};
  hap_pointer_expert_def expert;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  snprintf(spec, sizeof spec,
           "virtual:path=0:0/0/0.02;0.5:0/0/0.0065;9:0/0/0.0065,hand=%s,device_mass=0.1,"
           "device_damping=2,delay=%g,kick=1:0/0/0.1",
           row->hand, row->delay);
  REQUIRE(hap_device_open(spec, &d->hand_def.device, &why) >= HAP_OK);
  hap_pointer_expert_def_init(&expert, sizeof expert);
  expert.coupling = HAP_COUPLING_DIRECT;
  d->hand_def.expert = &expert;
  d->hand_def.stiffness = row->stiffness;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  hap_force_def spring = force_of(HAP_FORCE_SPRING);
  spring.target = HAP_FORCE_PLANE;
  spring.origin[2] = 0.007;
  spring.stiffness = 0.999 * row->stiffness;
  CHECK(hap_pointer_force_add(d->session, d->hand, &spring, &id) == HAP_OK);
  session_run(d->session);
  return d;
}

static void both_end(desk *d)
{
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(d->hand_def.device);
}

static void both_check(const both_row *row)
{
  desk *d = both_make(row);
  REQUIRE(hap_session_advance(d->session, 6000) >= HAP_OK);
  hap_pointer_state state = desk_state(d);
  double first = state.wrench.force[2];
  CHECK(state.contacts == 1 && fabs(state.own.force[2]) > 0.1);
  for (int i = 0; i < 200; ++i) {
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    CHECK_NEAR(desk_state(d).wrench.force[2], first, 1e-3);
  }
  CHECK(session_stats(d->session).faults.count == 0);
  both_end(d);
}

/* A hand brings the damping that twice the stiffness needs (docs/forces.md). */
TEST(a_hand_holds_a_contact_and_a_spring_that_the_device_holds_each)
{
  static const both_row rows[] = {{"relaxed", 0.0, 3200.0},
                                  {"tense", 0.0, 3200.0},
                                  {"relaxed", 1e-3, 1066.0},
                                  {"tense", 1e-3, 1066.0}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    both_check(&rows[i]);
  }
}

/* It swings in and out of the contact, and the spring goes on: the force follows the way by two
 * slopes. */
TEST(a_device_that_is_let_go_with_both_is_found_to_swing)
{
  static const both_row rows[] = {{"none", 0.0, 3200.0}, {"none", 1e-3, 1066.0}};
  for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
    desk *d = both_make(&rows[i]);
    (void)hap_session_advance(d->session, 9000);
    hap_stats stats = session_stats(d->session);
    printf("# delay %g s: fault %u, %u ticks lowered\n", rows[i].delay, stats.faults.fault,
           (unsigned)stats.safety.oscillation_ticks);
    CHECK(stats.faults.fault == HAP_FAULT_OSCILLATION && stats.safety.oscillation_ticks > 0);
    CHECK(hapi_v3_norm(desk_state(d).wrench.force) == 0.0);
    both_end(d);
  }
}

TEST(a_spring_on_a_device_without_figures_is_as_stiff_as_contacts)
{
  hap_detail why = {""};
  hap_force_id id = {0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_device *device = NULL;
  REQUIRE(hap_device_open("virtual:path=0:0.004/0/0;9:0.004/0/0", &device, &why) >= HAP_OK);
  d->hand_def.device = device;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  hap_force_def spring = force_of(HAP_FORCE_SPRING);
  spring.stiffness = STIFFNESS;
  CHECK(hap_pointer_force_add(d->session, d->hand, &spring, &id) == HAP_OK);
  spring.stiffness = 2.0 * STIFFNESS;
  CHECK(hap_pointer_force_set(d->session, d->hand, id, &spring) == HAP_SATURATED);
  detail_has(d, "1000");
  REQUIRE(hap_session_advance(d->session, 60) >= HAP_OK);
  CHECK_NEAR(desk_state(d).wrench.force[0], -0.004 * STIFFNESS, EXACT);
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(device);
}

/* ---- recordings ---- */

static void forced_session(desk *d)
{
  float wave[100];
  for (int i = 0; i < 100; ++i) {
    wave[i] = (float)sin(2.0 * M_PI * i / 100.0);
  }
  hap_force_def medium = force_of(HAP_FORCE_VISCOUS);
  hap_force_def shake = force_of(HAP_FORCE_VIBRATION);
  hap_force_def magnet = force_of(HAP_FORCE_MAGNET);
  medium.damping = 2.0;
  shake.strength = 1.0;
  shake.vibration.samples = wave;
  shake.vibration.sample_count = 100;
  shake.vibration.sample_hz = 2345.0;
  magnet.strength = 2.0;
  magnet.range = 0.05;
  hap_force_id first = force_add(d, &medium);
  desk_glide(d, 0.0, 0.0, -0.012);
  (void)force_add(d, &shake);
  (void)force_add(d, &shake);
  desk_glide(d, 0.05, 0.0, 0.0);
  hap_force_id pulls = force_add(d, &magnet);
  desk_glide(d, 0.0, 0.02, 0.0);
  magnet.origin[1] = 0.01;
  CHECK(hap_pointer_force_set(d->session, d->hand, pulls, &magnet) == HAP_OK);
  CHECK(hap_pointer_force_remove(d->session, d->hand, first) == HAP_OK);
  desk_glide(d, -0.05, 0.0, 0.0);
}

TEST(a_replay_has_the_same_forces)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(d);
  d->hand_def.friction = 0.2;
  desk_record(d, "forces.rec", 0.02);
  session_run(d->session);
  forced_session(d);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  hap_pointer_state last = desk_state(d);
  hap_pointer_id hand = d->hand;
  tap_release(d);

  desk *r = desk_new(0.0, HAP_MODEL_CONTACT);
  floor_add(r);
  desk_replay(r, "forces.rec");
  desk_play(r);
  hap_force_def def = force_of(HAP_FORCE_CONSTANT);
  hap_force_id id;
  CHECK(hap_pointer_force_add(r->session, hand, &def, &id) == HAP_ERROR_STATE);
  hap_pointer_state again;
  REQUIRE(hap_pointer_get(r->session, hand, &again, sizeof again) == HAP_OK);
  CHECK(memcmp(&again.wrench, &last.wrench, sizeof last.wrench) == 0);
  CHECK(memcmp(&again.own, &last.own, sizeof last.own) == 0);
  CHECK(last.own.force[1] != 0.0);
}
