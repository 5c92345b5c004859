/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The virtual device against closed forms. */

#include "tests/tap.h"

#include <signal.h>
#include <stdint.h>

#include <hapode/device_impl.h>
#include <hapode/hapode.h>

#include "base/vec.h"
#include "device/one_effector.h"
#include "tests/device_rig.h"

#define PI 3.14159265358979323846
#define T0 5000000000LL /* ns; the device must not care where time begins */

static hap_status rig_read(device_rig *r, int64_t since_ns)
{
  uint32_t buttons = 77;
  hap_status status = hapi_one_read(r->ops, r->self, T0 + since_ns, &r->pose, &r->twist, &buttons);
  CHECK(status < 0 || buttons == 0);
  return status;
}

static hap_status rig_push(device_rig *r, double x, double y, double z)
{
  hap_wrench wanted = {{x, y, z}, {0.0, 0.0, 0.0}};
  return hapi_one_write(r->ops, r->self, &wanted, &r->reached);
}

/* x of a default read, NaN on failure */
static double x_at(device_rig *r, double seconds)
{
  return rig_read(r, llround(seconds * 1e9)) == HAP_OK ? r->pose.position[0] : (double)NAN;
}

TEST(default_rests_at_the_origin)
{
  hap_device_info info;
  device_rig *r = rig_new("virtual");
  REQUIRE(hap_device_get_info(r->device, &info, sizeof info) == HAP_OK);
  CHECK(strcmp(info.name, "virtual") == 0 && info.dof == 3);
  CHECK(r->ops->pacing == HAP_PACING_VIRTUAL);
  CHECK_NEAR(info.max_force, 20.0, 0.0);
  CHECK_NEAR(info.max_torque, 1.0, 0.0);
  for (int i = 0; i < 100; ++i) {
    CHECK(rig_read(r, i * 1000000) == HAP_OK);
    CHECK(rig_push(r, 10.0, 10.0, 0.0) == HAP_OK); /* a rigid hand does not care */
    CHECK(hapi_v3_norm(r->pose.position) == 0.0 && hapi_v3_norm(r->twist.linear) == 0.0);
    CHECK(r->pose.quat_wxyz[0] == 1.0 && hapi_v3_norm(r->twist.angular) == 0.0);
  }
}

TEST(info_follows_the_arguments)
{
  device_rig *r = rig_new(
      "virtual:max_force=5,max_torque=0.25,rated_stiffness=2000,"
      "device_damping=1.5,dof=6,orientation=0/2/0/0");
  const hap_device_info *info = hapi_device_info(r->device);
  CHECK(info->max_force == 5.0 && info->max_torque == 0.25 && info->rated_stiffness == 2000.0);
  CHECK(info->damping == 1.5 && info->dof == 6 && info->quantum == 0.0);
  CHECK(rig_read(r, 0) == HAP_OK && r->pose.quat_wxyz[1] == 1.0);
}

TEST(smooth_path_is_minimum_jerk)
{
  device_rig *r = rig_new("virtual:path=0.5:1/2/3;1.5:3/2/-1;2:3/2/0");
  for (int i = 0; i <= 2500; ++i) {
    double t = i * 1e-3;
    CHECK(rig_read(r, i * 1000000LL) == HAP_OK);
    double u = fmin(fmax(t - 0.5, 0.0), 1.0);
    double s = 10.0 * pow(u, 3) - 15.0 * pow(u, 4) + 6.0 * pow(u, 5);
    double v = 30.0 * pow(u, 2) - 60.0 * pow(u, 3) + 30.0 * pow(u, 4);
    CHECK_NEAR(r->pose.position[0], 1.0 + 2.0 * s, 1e-13);
    CHECK_NEAR(r->pose.position[1], 2.0, 0.0);
    CHECK_NEAR(r->twist.linear[0], 2.0 * v, 1e-12);
    if (t <= 1.5) {
      CHECK_NEAR(r->pose.position[2], 3.0 - 4.0 * s, 1e-13);
    }
    if (t >= 2.0) {
      CHECK(r->pose.position[2] == 0.0 && r->twist.linear[2] == 0.0);
    }
  }
}

TEST(linear_path_has_constant_velocity)
{
  device_rig *r = rig_new("virtual:path=0:0/0/0;0.1:0.017/0/0;0.3:0.017/-1/0,blend=linear");
  for (int i = 0; i <= 400; ++i) {
    double t = i * 1e-3;
    CHECK_NEAR(x_at(r, t), t < 0.1 ? 0.17 * t : 0.017, 1e-15);
    CHECK_NEAR(r->pose.position[1], t < 0.1 ? 0.0 : -fmin((t - 0.1) / 0.2, 1.0), 1e-14);
    CHECK_NEAR(r->twist.linear[0], i < 100 ? 0.17 : 0.0, 1e-14);
    CHECK_NEAR(r->twist.linear[1], i >= 100 && i < 300 ? -5.0 : 0.0, 1e-14);
  }
}

TEST(loop_comes_round)
{
  device_rig *r = rig_new("virtual:path=1:0/0/0;1.25:1/0/0;2:0/0/0,blend=linear,loop=1");
  for (int i = 0; i < 9000; i += 7) {
    double t = i * 1e-3;
    double u = fmod(fmax(t - 1.0, 0.0), 1.0);
    double expected = u < 0.25 ? 4.0 * u : 1.0 - (u - 0.25) / 0.75;
    CHECK_NEAR(x_at(r, t), expected, 1e-11);
  }
}

TEST(sine_is_a_sine)
{
  device_rig *r = rig_new("virtual:path=0:1/1/1,sine=0.01/0/-0.02,hz=3,start=0.125");
  for (int i = 0; i < 2000; ++i) {
    double angle = 2.0 * PI * 3.0 * (i * 1e-3 + 0.125);
    CHECK(rig_read(r, i * 1000000LL) == HAP_OK);
    CHECK_NEAR(r->pose.position[0], 1.0 + 0.01 * sin(angle), 1e-14);
    CHECK_NEAR(r->pose.position[2], 1.0 - 0.02 * sin(angle), 1e-14);
    CHECK_NEAR(r->twist.linear[0], 0.01 * 6.0 * PI * cos(angle), 1e-12);
  }
}

TEST(motion_begins_anew_after_start)
{
  device_rig *r = rig_new("virtual:path=0:0/0/0;1:1/0/0,start=0.25,blend=linear");
  CHECK_NEAR(x_at(r, 0.0), 0.25, 1e-15);
  CHECK_NEAR(x_at(r, 0.5), 0.75, 1e-15);
  r->ops->stop(r->self);
  CHECK(rig_read(r, 600000000) == HAP_ERROR_STATE);
  CHECK(rig_push(r, 1.0, 0.0, 0.0) == HAP_ERROR_STATE);
  CHECK(r->ops->start(r->self) == HAP_OK);
  CHECK_NEAR(x_at(r, 0.1), 0.25, 1e-15); /* an earlier time than before: a new clock */
  CHECK_NEAR(x_at(r, 0.3), 0.45, 1e-15);
}

TEST(time_must_not_go_back)
{
  device_rig *r = rig_new("virtual:hand=relaxed");
  CHECK(rig_read(r, 5000000) == HAP_OK);
  CHECK(rig_push(r, 1.0, 0.0, 0.0) == HAP_OK);
  CHECK(rig_read(r, 9000000) == HAP_OK);
  double x = r->pose.position[0];
  CHECK(x > 0.0);
  CHECK(rig_read(r, 8999999) == HAP_ERROR_ARGUMENT);
  CHECK(rig_read(r, 9000000) == HAP_OK);
  CHECK(r->pose.position[0] == x);
}

/* Answer of a hand at rest to a constant force, by its closed form. */
static double step_response(double m, double c, double k, double f, double t)
{
  double w = sqrt(k / m);
  double z = c / (2.0 * sqrt(k * m));
  if (z < 1.0) {
    double wd = w * sqrt(1.0 - z * z);
    return f / k * (1.0 - exp(-z * w * t) * (cos(wd * t) + z * w / wd * sin(wd * t)));
  }
  double root = sqrt(z * z - 1.0);
  double a = -w * (z - root);
  double b = -w * (z + root);
  return f / k * (1.0 - (b * exp(a * t) - a * exp(b * t)) / (b - a));
}

typedef struct hand_case {
  const char *spec;
  double m;
  double c;
  double k;
  int64_t step_ns;
} hand_case;

static const hand_case hands[] = {
    {"virtual:hand=relaxed", 0.2, 3.0, 150.0, 1000000},
    {"virtual:hand=tense", 0.3, 10.0, 800.0, 1000000},
    {"virtual:hand=tense", 0.3, 10.0, 800.0, 333333},
    {"virtual:hand=tense", 0.3, 10.0, 800.0, 37000000},
    {"virtual:mass=0.5", 0.5, 3.0, 150.0, 1000000},
    {"virtual:mass=1,damping=0,stiffness=400", 1.0, 0.0, 400.0, 1000000},
    {"virtual:mass=0.1,damping=50,stiffness=900", 0.1, 50.0, 900.0, 1000000},
    {"virtual:hand=tense,damping=31", 0.3, 31.0, 800.0, 1000000}, /* nearly critical: 30.98 */
    {"virtual:mass=0.001,damping=0.2,stiffness=1e5", 0.001, 0.2, 1e5, 700000000},
};

TEST(hand_answers_a_step_by_its_closed_form)
{
  for (size_t h = 0; h < sizeof hands / sizeof hands[0]; ++h) {
    const hand_case *hand = &hands[h];
    device_rig *r = rig_new(hand->spec);
    CHECK(rig_read(r, 0) == HAP_OK);
    for (int i = 1; i <= 1500; ++i) {
      CHECK(rig_push(r, 0.0, -2.0, 0.0) == HAP_OK);
      CHECK(rig_read(r, i * hand->step_ns) == HAP_OK);
      double t = (double)(i * hand->step_ns) / 1e9;
      double y = step_response(hand->m, hand->c, hand->k, -2.0, t);
      CHECK_NEAR(r->pose.position[1], y, 1e-10 * 2.0 / hand->k * 10.0);
      CHECK(r->pose.position[0] == 0.0 && r->pose.position[2] == 0.0);
    }
  }
}

TEST(hand_yields_by_force_over_stiffness)
{
  static const char *const specs[] = {"virtual:hand=relaxed", "virtual:hand=tense",
                                      "virtual:stiffness=2500"};
  static const double k[] = {150.0, 800.0, 2500.0};
  for (int i = 0; i < 3; ++i) {
    device_rig *r = rig_new(specs[i]);
    CHECK(rig_read(r, 0) == HAP_OK);
    CHECK(rig_push(r, 6.0, 0.0, -9.0) == HAP_OK);
    CHECK(rig_read(r, 5000000000) == HAP_OK);
    CHECK_NEAR(r->pose.position[0], 6.0 / k[i], 1e-12);
    CHECK_NEAR(r->pose.position[2], -9.0 / k[i], 1e-12);
    CHECK_NEAR(hapi_v3_norm(r->twist.linear), 0.0, 1e-9);
  }
}

/* Frequency and damping ratio as one would measure them: from successive peaks of the ringing. */
TEST(hand_rings_at_its_frequency)
{
  device_rig *r = rig_new("virtual:hand=relaxed");
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK(rig_push(r, 3.0, 0.0, 0.0) == HAP_OK);
  CHECK(rig_read(r, 5000000000) == HAP_OK);
  CHECK(rig_push(r, 0.0, 0.0, 0.0) == HAP_OK);
  double peak_time[3];
  double peak[3];
  int peaks = 0;
  double before = -1.0;
  for (int i = 1; i < 40000 && peaks < 3; ++i) {
    CHECK(rig_read(r, 5000000000 + i * 50000LL) == HAP_OK);
    double v = r->twist.linear[0];
    if (before > 0.0 && v <= 0.0) {
      peak_time[peaks] = i * 5e-5;
      peak[peaks++] = r->pose.position[0];
    }
    before = v;
  }
  REQUIRE(peaks == 3);
  double zeta = 3.0 / (2.0 * sqrt(0.2 * 150.0));
  double wd = sqrt(150.0 / 0.2) * sqrt(1.0 - zeta * zeta);
  double decrement = log(peak[0] / peak[1]);
  CHECK_NEAR(2.0 * PI / (peak_time[1] - peak_time[0]), wd, 2e-3 * wd);
  CHECK_NEAR(2.0 * PI / (peak_time[2] - peak_time[1]), wd, 2e-3 * wd);
  CHECK_NEAR(decrement / sqrt(4.0 * PI * PI + decrement * decrement), zeta, 1e-4);
}

TEST(free_mass_falls_by_half_a_t_squared)
{
  device_rig *r = rig_new("virtual:mass=2,damping=0,stiffness=0");
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK(rig_push(r, 4.0, 0.0, 0.0) == HAP_OK);
  for (int i = 1; i <= 1000; ++i) {
    CHECK_NEAR(x_at(r, i * 2e-3), i * 2e-3 * i * 2e-3, 1e-11);
    CHECK_NEAR(r->twist.linear[0], i * 4e-3, 1e-11);
  }
}

static double random_log(double low, double high)
{
  return low * pow(high / low, (double)rand() / RAND_MAX);
}

TEST(hand_never_gains_energy)
{
  srand(11);
  for (int trial = 0; trial < 300; ++trial) {
    double m = random_log(1e-3, 1e3);
    double c = trial % 3 == 0 ? 0.0 : random_log(1e-3, 1e5);
    double k = trial % 7 == 0 ? 0.0 : random_log(1e-2, 1e7);
    char spec[160];
    snprintf(spec, sizeof spec, "virtual:mass=%.17g,damping=%.17g,stiffness=%.17g", m, c, k);
    device_rig *r = rig_new(spec);
    CHECK(rig_read(r, 0) == HAP_OK);
    CHECK(rig_push(r, 20.0, 0.0, 0.0) == HAP_OK);
    int64_t now = 20000000;
    CHECK(rig_read(r, now) == HAP_OK);
    CHECK(rig_push(r, 0.0, 0.0, 0.0) == HAP_OK);
    double energy = INFINITY;
    for (int i = 0; i < 300; ++i) {
      double x = r->pose.position[0];
      double v = r->twist.linear[0];
      double next = 0.5 * (m * v * v + k * x * x);
      CHECK(hapi_finite(&next, 1));
      CHECK(next <= energy * (1.0 + 1e-9) + 1e-300);
      energy = next;
      now += llround(random_log(1e3, 1e9));
      CHECK(rig_read(r, now) == HAP_OK);
    }
  }
}

/* The hand pulled along by a script, by Runge-Kutta in steps of 10 us. */
static void reference_rates(double t, const double state[2], double out[2])
{
  double u = fmin(t / 0.4, 1.0);
  double w = 2.0 * PI * 5.0;
  double target = 0.1 * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u) + 0.01 * sin(w * t);
  double speed = 0.1 / 0.4 * 30.0 * u * u * (1.0 - u) * (1.0 - u) + 0.01 * w * cos(w * t);
  out[0] = state[1];
  out[1] = (800.0 * (target - state[0]) + 10.0 * (speed - state[1]) + 1.5) / 0.3;
}

static void reference_step(double t, double h, double state[2])
{
  double k[4][2];
  double probe[2];
  static const double share[4] = {0.0, 0.5, 0.5, 1.0};
  for (int s = 0; s < 4; ++s) {
    for (int i = 0; i < 2; ++i) {
      probe[i] = state[i] + (s > 0 ? share[s] * h * k[s - 1][i] : 0.0);
    }
    reference_rates(t + share[s] * h, probe, k[s]);
  }
  for (int i = 0; i < 2; ++i) {
    state[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
  }
}

/* The pull of the script is taken as straight within 1 ms: an error of the second order, for the
 * sine (2 pi 5 Hz 1 ms)^2 / 12 of 10 mm, times 1.5 as the hand is near its resonance. */
static void path_follow(int64_t step_ns)
{
  double share = pow(fmin((double)step_ns / 1e6, 1.0), 2.0);
  device_rig *r = rig_new("virtual:path=0:0/0/0;0.4:0.1/0/0,sine=0.01/0/0,hz=5,hand=tense");
  double state[2] = {0.0, 0.01 * 2.0 * PI * 5.0};
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK_NEAR(r->twist.linear[0], state[1], 1e-14);
  CHECK(rig_push(r, 1.5, 0.0, 0.0) == HAP_OK);
  int64_t now = 0;
  while (now < 1000000000) {
    int64_t until = now + step_ns;
    for (; now < until; now += 10000) {
      reference_step((double)now / 1e9, 1e-5, state);
    }
    CHECK(rig_read(r, now) == HAP_OK);
    CHECK_NEAR(r->pose.position[0], state[0], 2e-6 * share);
    CHECK_NEAR(r->twist.linear[0], state[1], 6e-5 * share);
  }
}

TEST(hand_follows_the_script)
{
  path_follow(1000000);
  path_follow(250000);
  path_follow(20000000); /* the script is still looked at every millisecond */
  path_follow(500000000);
}

TEST(reads_are_reproducible)
{
  static const char spec[] =
      "virtual:path=0:0/0/0;0.3:0.1/0.02/0;0.5:0/0/0,loop=1,sine=0/0/0.003,hz=7,hand=relaxed";
  device_rig *a = rig_new(spec);
  device_rig *b = rig_new(spec);
  b->ops->stop(b->self);
  CHECK(b->ops->start(b->self) == HAP_OK);
  for (int i = 0; i < 3000; ++i) {
    int64_t now = i * 1000000LL + i % 3;
    CHECK(rig_read(a, now) == HAP_OK && rig_read(b, now) == HAP_OK);
    for (int k = 0; k < 3; ++k) {
      CHECK(a->pose.position[k] == b->pose.position[k]);
      CHECK(a->twist.linear[k] == b->twist.linear[k]);
    }
    CHECK(rig_push(a, sin(i * 0.1), -a->pose.position[1] * 100.0, 0.0) == HAP_OK);
    CHECK(rig_push(b, sin(i * 0.1), -b->pose.position[1] * 100.0, 0.0) == HAP_OK);
  }
}

/* Turns about a fixed axis: the quaternion's angle and the angular velocity are the script's. */
TEST(a_rigid_hand_turns_by_its_script)
{
  device_rig *r = rig_new("virtual:dof=6,orientation=0/1/0/0,turn=0:0/0/0;1:0/0.4/0,blend=linear");
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK_NEAR(r->pose.quat_wxyz[1], 1.0, 1e-15);
  CHECK(rig_read(r, 500000000) == HAP_OK);
  double q[4] = {cos(0.1), 0.0, sin(0.1), 0.0};
  double base[4] = {0.0, 1.0, 0.0, 0.0};
  hapi_quat_multiply(q, base, q);
  for (int i = 0; i < 4; ++i) {
    CHECK_NEAR(r->pose.quat_wxyz[i], q[i], 1e-12);
  }
  CHECK_NEAR(r->twist.angular[1], 0.4, 1e-12);
  CHECK_NEAR(r->twist.angular[0], 0.0, 1e-12);
}

/* Held on: the angle at which the wrist's spring balances the torque; and the first instant, in
 * which it is an inertia alone. */
TEST(a_wrist_gives_way_to_a_torque)
{
  hap_wrench twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.3}};
  device_rig *r =
      rig_new("virtual:dof=6,hand=tense,inertia=0.002,turn_damping=0.1,turn_stiffness=3");
  REQUIRE(r != NULL);
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK(hapi_one_write(r->ops, r->self, &twist, &r->reached) == HAP_OK);
  CHECK(rig_read(r, 100000) == HAP_OK);
  CHECK_NEAR(r->twist.angular[2], 0.3 * 1e-4 / 0.002, 0.01 * 0.3 * 1e-4 / 0.002);
  for (int i = 1; i <= 3000; ++i) {
    CHECK(rig_read(r, 100000 + 1000000LL * i) == HAP_OK);
    CHECK(hapi_one_write(r->ops, r->self, &twist, &r->reached) == HAP_OK);
  }
  CHECK_NEAR(2.0 * asin(r->pose.quat_wxyz[3]), 0.1, 1e-6);
  CHECK_NEAR(hapi_v3_norm(r->pose.position), 0.0, 1e-12); /* a torque moves nothing along */
}

/* A free handle: what the torque did is what it has of energy, about whatever axes it turns. */
TEST(turning_does_the_work_of_the_torque)
{
  hapi_virtual_port port;
  double work = 0.0;
  device_rig *r = rig_new("virtual:dof=6,hand=none,device_mass=1,device_inertia=0.01,delay=0.0015");
  CHECK(rig_read(r, 0) == HAP_OK);
  for (int i = 1; i <= 1000; ++i) {
    double t = 1e-3 * i;
    hap_wrench twist = {{0.0, 0.0, 0.0}, {0.05 * cos(7.0 * t), 0.08 * sin(5.0 * t), 0.03}};
    double before[3];
    hapi_virtual_get_port(r->self, &port);
    hapi_v3_copy(r->twist.angular, before);
    CHECK(hapi_one_write(r->ops, r->self, &twist, &r->reached) == HAP_OK);
    CHECK(rig_read(r, 1000000LL * i) == HAP_OK);
    hapi_v3_add(before, r->twist.angular, before);
    work += 0.5 * 1e-3 * hapi_v3_dot(port.torque, before); /* to the order of a delayed tick */
  }
  hapi_virtual_get_port(r->self, &port);
  double energy = 0.5 * port.inertia * hapi_v3_dot(port.turn_rate, port.turn_rate);
  CHECK(energy > 1e-3);
  CHECK_NEAR(port.work, energy, 1e-6 * energy);
  CHECK_NEAR(work, energy, 0.02 * energy);
}

TEST(force_is_limited)
{
  device_rig *r = rig_new("virtual:max_force=5");
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK(rig_push(r, 30.0, 0.0, 40.0) == HAP_SATURATED);
  CHECK_NEAR(r->reached.force[0], 3.0, 1e-14);
  CHECK_NEAR(r->reached.force[2], 4.0, 1e-14);
  hap_wrench twist = {{1.0, 0.0, 0.0}, {0.1, 0.0, 0.0}};
  CHECK(hapi_one_write(r->ops, r->self, &twist, &r->reached) == HAP_OK);
  CHECK(r->reached.force[0] == 1.0 && r->reached.torque[0] == 0.0); /* three degrees of freedom */
  CHECK(rig_push(r, (double)NAN, 0.0, 0.0) == HAP_ERROR_ARGUMENT);
  r = rig_new("virtual:dof=6");
  CHECK(hapi_one_write(r->ops, r->self, &twist, &r->reached) == HAP_OK &&
        r->reached.torque[0] == 0.1);
  twist.torque[0] = 3.0;
  CHECK(hapi_one_write(r->ops, r->self, &twist, &r->reached) == HAP_SATURATED);
  CHECK_NEAR(r->reached.torque[0], 1.0, 1e-15);
}

static device_rig *in_signal;

static void zero_now(int number)
{
  (void)number;
  in_signal->ops->zero(in_signal->self);
}

TEST(zero_works_in_a_signal_handler)
{
  in_signal = rig_new("virtual:mass=1,damping=0,stiffness=0");
  CHECK(rig_read(in_signal, 0) == HAP_OK);
  CHECK(rig_push(in_signal, 1.0, 0.0, 0.0) == HAP_OK);
  CHECK(rig_read(in_signal, 1000000000) == HAP_OK);
  void (*before)(int) = signal(SIGUSR1, zero_now);
  CHECK(raise(SIGUSR1) == 0);
  CHECK(raise(SIGUSR1) == 0);
  signal(SIGUSR1, before);
  CHECK_NEAR(x_at(in_signal, 2.0), 1.5, 1e-12); /* half a metre, then on at 1 m/s */
  CHECK_NEAR(in_signal->twist.linear[0], 1.0, 1e-12);
  CHECK(rig_push(in_signal, -1.0, 0.0, 0.0) == HAP_OK); /* the next write counts again */
  CHECK_NEAR(x_at(in_signal, 3.0), 2.0, 1e-12);
}

TEST(start_forgets_the_force)
{
  device_rig *r = rig_new("virtual:hand=relaxed");
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK(rig_push(r, 5.0, 0.0, 0.0) == HAP_OK);
  CHECK(rig_read(r, 100000000) == HAP_OK);
  CHECK(r->pose.position[0] > 0.0);
  r->ops->stop(r->self);
  CHECK(r->ops->start(r->self) == HAP_OK);
  CHECK(x_at(r, 1.0) == 0.0);
  CHECK(x_at(r, 2.0) == 0.0);
}

TEST(long_pauses_are_bounded)
{
  device_rig *r = rig_new("virtual:hand=tense,sine=0.01/0/0,hz=2");
  CHECK(rig_read(r, 0) == HAP_OK);
  CHECK(rig_push(r, 8.0, 0.0, 0.0) == HAP_OK);
  CHECK(rig_read(r, 86400LL * 365 * 1000000000) == HAP_OK);
  CHECK(fabs(r->pose.position[0]) < 0.1);
}

TEST(bad_specs_say_why)
{
  static const char *const bad[][2] = {
      {"virtual:pathh=1", "no argument 'pathh'"},
      {"virtual:path", "key=value"},
      {"virtual:path=", "path: expected T:x/y/z"},
      {"virtual:path=0:0/0", "waypoint 1"},
      {"virtual:path=0:0/0/0;", "waypoint 2"},
      {"virtual:path=0:0/0/0;1:1/1/x", "waypoint 2"},
      {"virtual:path=0:0/0/0;1:1/1/1/1", "waypoint 2"},
      {"virtual:path=0:0/0/0;0:1/0/0", "later"},
      {"virtual:path=1:0/0/0;0.5:1/0/0", "waypoint 2"},
      {"virtual:path=0:nan/0/0", "waypoint 1"},
      {"virtual:path=inf:0/0/0", "waypoint 1"},
      {"virtual:path=0:1e4/0/0", "waypoint 1"},
      {"virtual:path=0:0/0/0;1:1/0/0,loop=1", "end where it begins"},
      {"virtual:blend=cubic", "smooth or linear"},
      {"virtual:loop=yes", "0 or 1"},
      {"virtual:hz=3", "without sine"},
      {"virtual:sine=1/1/1,hz=-1", "hz"},
      {"virtual:hand=limp", "rigid, relaxed, tense or none"},
      {"virtual:hand=rigid,mass=1", "rigid"},
      {"virtual:mass=0", "mass"},
      {"virtual:damping=-1", "damping"},
      {"virtual:stiffness=nan", "stiffness"},
      {"virtual:mass=1,mass=2", "twice"},
      {"virtual:max_force=0", "max_force"},
      {"virtual:orientation=0/0/0/0", "orientation"},
      {"virtual:dof=4", "3 or 6"},
      {"virtual:turn=0:0/0/0", "turn needs dof=6"},
      {"virtual:device_turn_damping=1,dof=3", "needs dof=6"},
      {"virtual:dof=6,turn=0:0/0", "turn: waypoint 1: expected T:rx/ry/rz"},
      {"virtual:dof=6,turn=0:0/0/0;1:0/3.1/0", "waypoint 2 is a turn by 3.1 rad"},
      {"virtual:dof=6,turn=0:0/0/0;1:0/1/0,loop=1", "the turn must end where it begins"},
      {"virtual:dof=6,turn_hz=2", "without turn_sine"},
      {"virtual:dof=6,hand=rigid,inertia=1", "rigid"},
      {"virtual:start=1e300", "start"}};
  for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
    hap_device *device = NULL;
    hap_detail detail = {""};
    CHECK(hap_device_open(bad[i][0], &device, &detail) == HAP_ERROR_ARGUMENT);
    CHECK(device == NULL);
    CHECK(strstr(detail.text, bad[i][1]) != NULL);
    if (strstr(detail.text, bad[i][1]) == NULL) {
      printf("# '%s' gave '%s'\n", bad[i][0], detail.text);
    }
  }
}
