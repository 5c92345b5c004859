/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The velocity estimate against the true velocity of quantised motions, beside a plain difference
 * and a fixed window. */

#include "tests/tap.h"

#include <stdint.h>

#include <hapode/device_impl.h>
#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/vec.h"
#include "device/device.h"
#include "pointer/velocity.h"
#include "tools/session_defs.h"

#define PI 3.14159265358979323846
#define QUANTUM 3e-5
#define MS 1000000LL
#define TICKS 4000
#define SETTLED 100 /* ticks at the start that do not count */
#define WINDOW 8    /* samples, of the fixed one */

/* ---- a motion and three estimates of its velocity ---- */

typedef struct motion {
  double ramp;      /* m/s */
  double amplitude; /* m */
  double hz;
} motion;

typedef struct track {
  double truth[TICKS]; /* m/s */
  double adaptive[TICKS];
  double plain[TICKS];
  double fixed[TICKS];
} track;

static track t;

static double motion_position(const motion *m, double time)
{
  return 0.0123456 + m->ramp * time + m->amplitude * sin(2.0 * PI * m->hz * time);
}

static double motion_speed(const motion *m, double time)
{
  return m->ramp + 2.0 * PI * m->hz * m->amplitude * cos(2.0 * PI * m->hz * time);
}

static double slope_of_last(const double *x, int count)
{
  double product = 0.0;
  double square = 0.0;
  for (int i = 0; i < count; ++i) {
    double at = i - 0.5 * (count - 1);
    product += at * x[i - count + 1];
    square += at * at;
  }
  return product / square * 1e3;
}

static void motion_run(const motion *m)
{
  static double x[TICKS];
  hapi_velocity velocity;
  hapi_velocity_reset(&velocity, QUANTUM);
  for (int i = 0; i < TICKS; ++i) {
    hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    hap_twist twist;
    x[i] = QUANTUM * round(motion_position(m, i * 1e-3) / QUANTUM);
    pose.position[1] = x[i];
    hapi_velocity_update(&velocity, i * MS, &pose, 0.0, &twist);
    t.truth[i] = motion_speed(m, i * 1e-3);
    t.adaptive[i] = twist.linear[1];
    t.plain[i] = i > 0 ? (x[i] - x[i - 1]) * 1e3 : 0.0;
    t.fixed[i] = i >= WINDOW ? slope_of_last(&x[i], WINDOW) : 0.0;
    CHECK(twist.linear[0] == 0.0 && twist.linear[2] == 0.0);
  }
}

static double rms_error(const double *estimate, int shift)
{
  double sum = 0.0;
  for (int i = SETTLED; i < TICKS; ++i) {
    sum += pow(estimate[i] - t.truth[i - shift], 2.0);
  }
  return sqrt(sum / (TICKS - SETTLED));
}

/* Ticks by which the estimate is behind: where its error is least. */
static int estimate_lag(const double *estimate)
{
  int best = 0;
  for (int shift = 1; shift < 20; ++shift) {
    best = rms_error(estimate, shift) < rms_error(estimate, best) ? shift : best;
  }
  return best;
}

TEST(ramps_are_smooth_where_differences_jump)
{
  printf("# ramp m/s: rms error mm/s of adaptive, plain, fixed\n");
  static const double ramps[] = {0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0};
  for (int k = 0; k < 7; ++k) {
    motion m = {ramps[k] * 1.0137, 0.0, 0.0};
    motion_run(&m);
    double adaptive = rms_error(t.adaptive, 0);
    double plain = rms_error(t.plain, 0);
    double fixed = rms_error(t.fixed, 0);
    printf("# %5g: %.3f %.3f %.3f\n", ramps[k], 1e3 * adaptive, 1e3 * plain, 1e3 * fixed);
    CHECK(adaptive < 0.7e-3);
    CHECK(adaptive < 0.6 * fixed && adaptive < 0.2 * plain);
  }
}

TEST(sines_lag_less_the_faster_they_turn)
{
  printf("# sine mm, Hz: rms error mm/s (lag ms) of adaptive, plain, fixed\n");
  static const double sines[][2] = {{0.5, 1.0},  {10.0, 0.5}, {10.0, 2.0},
                                    {10.0, 5.0}, {20.0, 8.0}, {2.0, 30.0}};
  int before = 100;
  for (int k = 0; k < 6; ++k) {
    motion m = {0.0, 1e-3 * sines[k][0], sines[k][1]};
    motion_run(&m);
    double w = 2.0 * PI * m.hz;
    double worst = w * w * m.amplitude; /* m/s^2 */
    printf("# %5g %4g: %.2f (%d) %.2f (%d) %.2f (%d)\n", sines[k][0], sines[k][1],
           1e3 * rms_error(t.adaptive, 0), estimate_lag(t.adaptive), 1e3 * rms_error(t.plain, 0),
           estimate_lag(t.plain), 1e3 * rms_error(t.fixed, 0), estimate_lag(t.fixed));
    /* a window over which the motion curves by a quantum: sqrt(8 q / a); half of it is the lag */
    double bound = sqrt(8.0 * QUANTUM / worst);
    CHECK(estimate_lag(t.adaptive) <= 1 + (int)(0.5e3 * 1.5 * bound));
    CHECK(rms_error(t.adaptive, 0) < 0.5 * worst * bound + QUANTUM * 1e3 * 0.3);
    CHECK(estimate_lag(t.adaptive) <= before);
    before = estimate_lag(t.adaptive);
  }
  CHECK(before <= 1); /* at 70 m/s^2 two samples are the window */
}

TEST(rest_is_zero)
{
  motion m = {0.0, 0.0, 0.0};
  motion_run(&m);
  for (int i = 0; i < TICKS; ++i) {
    CHECK(t.adaptive[i] == 0.0);
  }
}

TEST(stop_is_noticed_within_the_window)
{
  hapi_velocity velocity;
  hap_twist twist;
  hapi_velocity_reset(&velocity, QUANTUM);
  for (int i = 0; i < 300; ++i) {
    double x = 0.2 * fmin(i, 200) * 1e-3; /* 0.2 m/s, then at once at rest */
    hap_pose pose = {{QUANTUM * round(x / QUANTUM), 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    hapi_velocity_update(&velocity, i * MS, &pose, 0.0, &twist);
    CHECK(i < 5 || i > 200 || fabs(twist.linear[0] - 0.2) < 0.01);
    CHECK(i < 202 || fabs(twist.linear[0]) <= 0.031); /* at most one quantum per tick */
    CHECK(i < 240 || twist.linear[0] == 0.0);
  }
}

/* Ticks that were late or left out: the time stamps say so. */
TEST(missed_ticks_do_no_harm)
{
  hapi_velocity velocity;
  hap_twist twist;
  srand(5);
  hapi_velocity_reset(&velocity, QUANTUM);
  int64_t now = 0;
  double worst = 0.0;
  for (int i = 0; i < 3000; ++i) {
    now += 700000 + rand() % 600000 + (rand() % 20 == 0 ? (rand() % 50) * MS : 0);
    double x = 0.05 * (double)now * 1e-9;
    hap_pose pose = {{0.0, 0.0, QUANTUM * round(x / QUANTUM)}, {1.0, 0.0, 0.0, 0.0}};
    hapi_velocity_update(&velocity, now, &pose, 0.0, &twist);
    hap_twist again;
    hapi_velocity_update(&velocity, now, &pose, 0.0, &again); /* the same time twice */
    CHECK(memcmp(&again, &twist, sizeof twist) == 0);
    worst = i > 40 ? fmax(worst, fabs(twist.linear[2] - 0.05)) : worst;
  }
  printf("# worst error of 50 mm/s: %.2f mm/s\n", 1e3 * worst);
  CHECK(worst < 2.5e-3);
}

/* A device that tells a position every 4 ms, read at two rates: as if it were read every 4 ms. It
 * comes to rest after 2 s. One position of five is late by half a ms. */
TEST(a_device_that_tells_seldom_is_sampled_as_seldom)
{
  for (int per_ms = 1; per_ms <= 10; per_ms += 9) {
    hapi_velocity fast;
    hapi_velocity slow;
    hap_twist read = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hap_twist told = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    double worst = 0.0;
    double stops = 0.0;
    hapi_velocity_reset(&fast, QUANTUM);
    hapi_velocity_reset(&slow, QUANTUM);
    for (int i = 0; i < 2200 * per_ms; ++i) {
      int since = i % (4 * per_ms);
      bool late = per_ms == 10 && i / (4 * per_ms) % 5 == 0;
      if (since == (late ? per_ms / 2 : 0)) {
        double time = fmin(1e-3 * i / per_ms, 2.0);
        pose.position[0] = QUANTUM * round((0.1 * time + 0.005 * sin(9.0 * time)) / QUANTUM);
        hapi_velocity_update(&slow, i * MS / per_ms, &pose, 0.0, &told);
      }
      hapi_velocity_update(&fast, i * MS / per_ms, &pose, 4e-3, &read);
      bool moves = i > 200 * per_ms && i < 1990 * per_ms;
      worst = moves ? fmax(worst, fabs(read.linear[0] - told.linear[0])) : worst;
      stops = fabs(read.linear[0]) > QUANTUM / 4e-3 ? 1e-3 * i / per_ms : stops;
    }
    printf("# %d kHz: %.2g m/s off, stands after %.1f ms\n", per_ms, worst, 1e3 * (stops - 2.0));
    CHECK(worst < 1e-12);
    CHECK(stops > 1.9 && stops < 2.012);
    CHECK(read.linear[0] == 0.0);
  }
}

/* One of 4 ms, 2 ms late: a mean over the 2 ms until the next one, and not over 1 ms. */
TEST(a_position_that_is_late_makes_no_speed)
{
  for (int late = 0; late <= 2; ++late) { /* ms */
    hapi_velocity velocity;
    hap_twist twist = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    double fastest = 0.0;
    hapi_velocity_reset(&velocity, QUANTUM);
    for (int i = 0; i < 400; ++i) {
      if (i % 4 == 0 && i != 200) {
        pose.position[0] = 2e-4 * i;
      } else if (i == 200 + late) {
        pose.position[0] = 2e-4 * 200;
      }
      hapi_velocity_update(&velocity, i * MS, &pose, 4e-3, &twist);
      fastest = i > 20 ? fmax(fastest, twist.linear[0]) : fastest;
    }
    CHECK_SAY(fastest < 0.41, "%d ms late: %g m/s of 0.2", late, fastest);
  }
}

TEST(turning_has_its_angular_velocity)
{
  hapi_velocity velocity;
  hap_twist twist;
  hapi_velocity_reset(&velocity, QUANTUM);
  for (int i = 0; i < 3000; ++i) {
    double half = 0.5 * 20.0 * i * 1e-3; /* 20 rad/s about 0.6, 0, 0.8 */
    double side = i % 3 == 0 ? -1.0 : 1.0;
    hap_pose pose = {{0.0, 0.0, 0.0},
                     {side * cos(half), side * 0.6 * sin(half), 0.0, side * 0.8 * sin(half)}};
    hapi_velocity_update(&velocity, i * MS, &pose, 0.0, &twist);
    if (i > 0) {
      CHECK_NEAR(twist.angular[0], 12.0, 1e-3);
      CHECK_NEAR(twist.angular[1], 0.0, 1e-9);
      CHECK_NEAR(twist.angular[2], 16.0, 1e-3);
    }
  }
}

TEST(bad_poses_and_times_begin_anew)
{
  static const double bad[] = {(double)NAN, (double)INFINITY, 1e30};
  for (int k = 0; k < 3; ++k) {
    hapi_velocity velocity;
    hap_twist twist;
    hapi_velocity_reset(&velocity, QUANTUM);
    for (int i = 0; i < 60; ++i) {
      hap_pose pose = {{i * 1e-3, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
      pose.position[1] = i == 30 ? bad[k] : 0.0;
      hapi_velocity_update(&velocity, i * MS, &pose, 0.0, &twist);
      bool first = i == 0 || i == 30 || i == 31;
      CHECK_NEAR(twist.linear[0], first ? 0.0 : 1.0, 1e-9);
      CHECK(twist.linear[1] == 0.0);
    }
    hap_pose pose = {{5.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
    hapi_velocity_update(&velocity, 10 * MS, &pose, 0.0, &twist); /* back in time */
    CHECK(twist.linear[0] == 0.0);
  }
}

/* ---- in a session ---- */

/* Largest difference of the pointer's velocity from the truth, and its value at the end, for a hand
 * that moves at 20 mm/s. */
static double session_error(const char *spec, hap_velocity velocity)
{
  dInitODE2(0);
  dWorldID world = dWorldCreate();
  dSpaceID space = dSimpleSpaceCreate(0);
  hap_session_def def;
  hap_ode_def ode;
  hap_session *session = NULL;
  hap_pointer_def pointer;
  hap_pointer_expert_def expert;
  hap_pointer_research_def research;
  hap_pointer_id id;
  hap_pointer_state state;
  double worst = 1e9;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  pointer_defs_init(&pointer, &expert, &research);
  def.drive = HAP_DRIVE_LOCKSTEP;
  ode.world = world;
  ode.space = space;
  expert.velocity = velocity;
  CHECK(hap_device_open(spec, &pointer.device, NULL) == HAP_OK);
  if (hap_session_create(&def, &ode, &session, NULL) == HAP_OK &&
      hap_pointer_add(session, &pointer, &id) == HAP_OK && hap_session_start(session) == HAP_OK) {
    CHECK(hap_session_advance(session, 100) == HAP_OK);
    worst = 0.0;
    for (int i = 0; i < 400; ++i) {
      CHECK(hap_session_advance(session, 1) == HAP_OK);
      CHECK(hap_pointer_get(session, id, &state, sizeof state) == HAP_OK);
      worst = fmax(worst, fabs(state.twist.linear[0] - 0.02));
    }
  }
  hap_session_destroy(session);
  hap_device_close(pointer.device);
  dSpaceDestroy(space);
  dWorldDestroy(world);
  dCloseODE();
  return worst;
}

TEST(pointer_takes_the_velocity_it_should)
{
  static const char rounded[] = "virtual:path=0:0/0/0;9:0.18/0/0,blend=linear,quantum=3e-5";
  static const char exact[] = "virtual:path=0:0/0/0;9:0.18/0/0,blend=linear";
  double automatic = session_error(rounded, HAP_VELOCITY_AUTO);
  CHECK(automatic < 2e-3);
  CHECK(session_error(rounded, HAP_VELOCITY_ESTIMATED) == automatic);
  CHECK_NEAR(session_error(rounded, HAP_VELOCITY_DEVICE), 0.02, 1e-6); /* jumps from 0 to 30 mm/s */
  CHECK(session_error(exact, HAP_VELOCITY_AUTO) == session_error(exact, HAP_VELOCITY_DEVICE));
  CHECK(session_error(exact, HAP_VELOCITY_ESTIMATED) < 1e-9);
  CHECK(session_error(rounded, (hap_velocity)3) == 1e9);
}
