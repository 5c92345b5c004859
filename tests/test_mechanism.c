/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The mechanism of the virtual device (mass, damping, friction, delay, quantum) against closed
 * forms and a fine integration. */

#include "tests/tap.h"

#include <stdint.h>

#include <hapode/device_impl.h>
#include <hapode/hapode.h>

#include "base/vec.h"
#include "device/one_effector.h"
#include "tests/device_rig.h"

#define MS 1000000LL

static double rig_read(device_rig *r, int64_t since_ns)
{
  uint32_t buttons = 0;
  CHECK(hapi_one_read(r->ops, r->self, 7000 + since_ns, &r->pose, &r->twist, &buttons) == HAP_OK);
  hapi_virtual_get_port(r->self, &r->port);
  return r->pose.position[0];
}

static void rig_push(device_rig *r, double x, double y)
{
  hap_wrench wanted = {{x, y, 0.0}, {0.0, 0.0, 0.0}};
  hap_wrench reached;
  CHECK(hapi_one_write(r->ops, r->self, &wanted, &reached) == HAP_OK);
}

TEST(device_alone_has_mass_and_damping)
{
  static const int64_t steps[] = {1 * MS, 333333, 37 * MS};
  for (int k = 0; k < 3; ++k) {
    device_rig *r =
        rig_new("virtual:hand=none,device_mass=0.4,device_damping=2,path=0:1/2/3;1:9/9/9");
    REQUIRE(r != NULL);
    CHECK_NEAR(rig_read(r, 0), 1.0, 0.0);
    CHECK(hapi_v3_norm(r->twist.linear) == 0.0);
    rig_push(r, 3.0, 0.0);
    for (int i = 1; i <= 300; ++i) {
      double t = (double)(i * steps[k]) / 1e9;
      double x = rig_read(r, i * steps[k]);
      double rise = 1.0 - exp(-5.0 * t);
      CHECK_NEAR(r->twist.linear[0], 1.5 * rise, 1e-11);
      CHECK_NEAR(x, 1.0 + 1.5 * (t - rise / 5.0), 1e-11 * (1.0 + t));
      CHECK(r->pose.position[1] == 2.0 && r->pose.position[2] == 3.0);
    }
  }
}

/* Hand and device are one body: the damping of the hand acts to its target, that of the device to
 * the ground, which at rest is the same. */
TEST(hand_and_device_are_one_body)
{
  device_rig *both = rig_new("virtual:hand=relaxed,device_mass=0.3,device_damping=4");
  device_rig *hand = rig_new("virtual:mass=0.5,damping=7,stiffness=150");
  rig_read(both, 0);
  rig_read(hand, 0);
  rig_push(both, 2.0, 0.0);
  rig_push(hand, 2.0, 0.0);
  for (int i = 1; i < 800; ++i) {
    CHECK_NEAR(rig_read(both, i * MS), rig_read(hand, i * MS), 1e-15);
  }
  CHECK_NEAR(both->port.mass, 0.5, 1e-15);
  /* moved along, the ground holds back: it lags behind the target by b v / k */
  both = rig_new("virtual:path=0:0/0/0;9:0.9/0/0,blend=linear,hand=tense,device_damping=4");
  rig_read(both, 0);
  for (int i = 1; i <= 4000; ++i) {
    rig_read(both, i * MS);
  }
  CHECK_NEAR(both->pose.position[0], 0.4 - 4.0 * 0.1 / 800.0, 1e-9);
}

TEST(rigid_hand_does_not_feel_the_mechanism)
{
  device_rig *plain = rig_new("virtual:path=0:0/0/0;1:0.1/0.2/0");
  device_rig *heavy = rig_new(
      "virtual:path=0:0/0/0;1:0.1/0.2/0,device_mass=2,device_damping=9,friction=3,"
      "delay=0.0013");
  for (int i = 0; i < 1200; ++i) {
    CHECK(rig_read(plain, i * MS) == rig_read(heavy, i * MS));
    CHECK(memcmp(&plain->twist, &heavy->twist, sizeof plain->twist) == 0);
    rig_push(plain, 5.0, 0.0);
    rig_push(heavy, 5.0, 0.0);
  }
  CHECK_NEAR(plain->port.work, 0.5, 1e-12);
  double early = heavy->port.work; /* the way before the force came is not paid for */
  CHECK(early < 0.5 && early > 0.4999);
  CHECK(plain->port.mass == 0.0);
}

TEST(info_says_what_the_mechanism_is)
{
  device_rig *r = rig_new(
      "virtual:device_mass=0.25,device_damping=1.5,friction=0.2,delay=0.0015,"
      "quantum=3e-5,rated_stiffness=900");
  hap_device_info info;
  CHECK(hap_device_get_info(r->device, &info, sizeof info) == HAP_OK);
  CHECK(info.mass == 0.25 && info.damping == 1.5 && info.friction == 0.2);
  CHECK(info.delay == 0.0015 && info.quantum == 3e-5 && info.rated_stiffness == 900.0);
  CHECK(info.measures_velocity == 0);
  r = rig_new("virtual");
  CHECK(hapi_device_info(r->device)->measures_velocity == 1);
}

TEST(friction_stops_a_mass_and_holds_it)
{
  static const int64_t steps[] = {1 * MS, 333333, 7 * MS, 50 * MS};
  for (int k = 0; k < 4; ++k) {
    device_rig *r = rig_new("virtual:hand=none,device_mass=0.5,friction=0.25,kick=0:0.2/-0.1/0");
    rig_read(r, 0);
    for (int64_t at = steps[k]; at < 1000 * MS; at += steps[k]) {
      double t = (double)at / 1e9; /* 0.5 m/s^2: at rest after 0.4 s and 0.2 s */
      double x = rig_read(r, at);
      CHECK_NEAR(x, t < 0.4 ? 0.2 * t - 0.25 * t * t : 0.04, 1e-12);
      CHECK_NEAR(r->pose.position[1], t < 0.2 ? -0.1 * t + 0.25 * t * t : -0.01, 1e-12);
      CHECK(t < 0.4001 || r->twist.linear[0] == 0.0);
    }
    rig_push(r, 0.2499, -0.2499);
    double x = rig_read(r, 2000 * MS);
    CHECK_NEAR(x, 0.04, 1e-12);
    CHECK(hapi_v3_norm(r->twist.linear) == 0.0);
    rig_push(r, 0.75, 0.0); /* 1 m/s^2 beyond the friction */
    CHECK_NEAR(rig_read(r, 3000 * MS), 0.54, 1e-11);
  }
}

/* Mass on a spring whose end swings, in steps of 1 us. */
static void drag_reference(double state[2], double target, double friction)
{
  double h = 1e-6;
  double net = 400.0 * (target - state[0]);
  if (state[1] == 0.0 && fabs(net) <= friction) {
    return;
  }
  double sign = state[1] != 0.0 ? copysign(1.0, state[1]) : copysign(1.0, net);
  double next = state[1] + h / 0.3 * (net - sign * friction);
  state[1] = next * sign > 0.0 ? next : 0.0;
  state[0] += h * state[1];
}

TEST(friction_sticks_and_slips_without_chatter)
{
  device_rig *r = rig_new(
      "virtual:sine=0.005/0/0,hz=1,mass=0.1,damping=0,stiffness=400,device_mass=0.2,"
      "friction=0.5");
  rig_read(r, 0);
  double state[2] = {0.0, r->twist.linear[0]};
  int stops = 0;
  int resting = 0;
  bool moved = true;
  for (int i = 1; i <= 4000; ++i) {
    for (int k = 0; k < 1000; ++k) {
      drag_reference(state, 0.005 * sin(2e-6 * acos(-1.0) * (i * 1000 - 1000 + k)), 0.5);
    }
    CHECK_NEAR(rig_read(r, i * MS), state[0], 1e-7);
    stops += moved && r->twist.linear[0] == 0.0;
    resting += r->twist.linear[0] == 0.0;
    moved = r->twist.linear[0] != 0.0;
  }
  printf("# %d stops, at rest in %d of 4000 reads\n", stops, resting);
  CHECK(stops >= 8 && stops <= 30 && resting > 500);
}

TEST(delay_shifts_the_answer_exactly)
{
  static const double delays[] = {0.0, 0.0005, 0.00037, 0.001, 0.00225, 0.1};
  for (int k = 0; k < 6; ++k) {
    char spec[120];
    snprintf(spec, sizeof spec, "virtual:hand=none,device_mass=0.5,delay=%.17g", delays[k]);
    device_rig *r = rig_new(spec);
    rig_read(r, 0);
    double forces[300];
    srand(3);
    for (int i = 0; i < 300; ++i) {
      double x = 0.0;
      double work = 0.0;
      double v = 0.0;
      double now = i * 1e-3 - delays[k];
      for (int j = 0; j < i && j * 1e-3 < now; ++j) { /* each force for as long as it has acted */
        double h = fmin(1e-3, now - j * 1e-3);
        double way = v * h + forces[j] * h * h;
        work += forces[j] * way;
        x += way;
        v += 2.0 * forces[j] * h;
      }
      CHECK_NEAR(rig_read(r, i * MS), x, 1e-12);
      CHECK_NEAR(r->twist.linear[0], v, 1e-12);
      CHECK_NEAR(r->port.work, work, 1e-12);
      CHECK_NEAR(r->port.work, 0.25 * v * v, 1e-12); /* all of it is motion */
      forces[i] = 4.0 * rand() / RAND_MAX - 2.0;
      rig_push(r, forces[i], 0.0);
    }
  }
}

TEST(full_line_of_commands_loses_none_but_the_last)
{
  device_rig *r = rig_new("virtual:hand=none,device_mass=1,delay=0.1");
  rig_read(r, 0);
  for (int i = 0; i < 10000; ++i) { /* at 1 MHz */
    rig_push(r, i < 5000 ? 1.0 : -3.0, 0.0);
    rig_read(r, i * 1000 + 1000);
  }
  rig_read(r, 104 * MS);
  CHECK_NEAR(r->twist.linear[0], 0.004, 1e-9);
  rig_read(r, 200 * MS);
  CHECK(r->port.force[0] == -3.0);
}

TEST(zero_goes_through_the_delay)
{
  device_rig *r = rig_new("virtual:hand=none,device_mass=1,delay=0.01");
  rig_read(r, 0);
  rig_push(r, 1.0, 0.0);
  rig_read(r, 100 * MS);
  r->ops->zero(r->self);
  rig_read(r, 200 * MS);
  CHECK_NEAR(r->twist.linear[0], 0.1, 1e-12); /* from 10 ms to 110 ms */
  rig_push(r, 1.0, 0.0);
  rig_read(r, 250 * MS);
  CHECK(r->port.force[0] == 1.0);
  r->ops->stop(r->self);
  CHECK(r->ops->start(r->self) == HAP_OK);
  rig_read(r, 0);
  rig_read(r, 5 * MS);
  CHECK(r->twist.linear[0] == 0.0 && r->port.work == 0.0);
}

TEST(quantum_rounds_what_is_measured)
{
  static const char *const specs[] = {
      "virtual:sine=0.02/0.01/0,hz=2,quantum=3e-5",
      "virtual:sine=0.02/0.01/0,hz=2,quantum=3e-5,hand=relaxed,device_mass=0.1"};
  for (int k = 0; k < 2; ++k) {
    device_rig *r = rig_new(specs[k]);
    rig_read(r, 0);
    CHECK(r->twist.linear[0] == 0.0);
    for (int i = 1; i < 1000; ++i) {
      double before = r->pose.position[0];
      double x = rig_read(r, i * MS);
      CHECK_NEAR(x / 3e-5, round(x / 3e-5), 1e-9);
      CHECK_NEAR(x, r->port.position[0], 1.5001e-5);
      CHECK_NEAR(r->twist.linear[0], (x - before) / 1e-3, 1e-9);
      double again = r->twist.linear[0];
      CHECK(rig_read(r, i * MS) == x && r->twist.linear[0] == again);
    }
  }
}

TEST(kick_is_a_jump_of_the_velocity)
{
  device_rig *r = rig_new("virtual:hand=none,device_mass=2,kick=0.1503:0.02/0/-0.01,start=0.1");
  for (int i = 0; i < 200; ++i) {
    double t = fmax(0.0, i * 1e-3 - 0.0503);
    CHECK_NEAR(rig_read(r, i * MS), 0.02 * t, 1e-15);
    CHECK_NEAR(r->pose.position[2], -0.01 * t, 1e-15);
  }
  r->ops->stop(r->self);
  CHECK(r->ops->start(r->self) == HAP_OK);
  rig_read(r, 0);
  CHECK_NEAR(rig_read(r, 150 * MS), 0.02 * 0.0997, 1e-15); /* once after every start */
  CHECK_NEAR(rig_read(r, 250 * MS), 0.02 * 0.1997, 1e-15);
}

TEST(bad_specs_say_why)
{
  static const char *const bad[][2] = {
      {"virtual:hand=none", "device_mass"},
      {"virtual:hand=none,device_mass=0.0001", "device_mass"},
      {"virtual:hand=none,device_mass=1,stiffness=3", "hand=none has no"},
      {"virtual:device_mass=-1", "device_mass"},
      {"virtual:friction=-1", "friction"},
      {"virtual:delay=0.2", "delay"},
      {"virtual:delay=nan", "delay"},
      {"virtual:quantum=1", "quantum"},
      {"virtual:kick=0:1/0/0", "rigid"},
      {"virtual:hand=relaxed,kick=0:1/0", "kick: expected T:vx/vy/vz"},
      {"virtual:hand=relaxed,kick=1/0/0", "kick: expected"},
      {"virtual:hand=relaxed,kick=0:1000/0/0", "kick: expected"},
      {"virtual:hand=relaxed,start=2,kick=1:1/0/0", "before start"}};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hap_device *device = NULL;
    hap_detail detail = {""};
    CHECK(hap_device_open(bad[i][0], &device, &detail) == HAP_ERROR_ARGUMENT && device == NULL);
    CHECK(strstr(detail.text, bad[i][1]) != NULL);
    if (strstr(detail.text, bad[i][1]) == NULL) {
      printf("# '%s' gave '%s'\n", bad[i][0], detail.text);
    }
  }
}
