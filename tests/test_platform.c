/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* A kinematic platform that an application moves by its pose alone: the hand on it feels no stairs,
 * and one that is put elsewhere does not go on. */

#include "tests/tap.h"

#include "tests/contact_world.h"

#define RADIUS 0.005
#define K 1000.0
#define SPEED 0.06 /* m/s */

typedef struct platform {
  contact_world w;
  dBodyID body;
  double time;   /* s, of the world */
  double height; /* m, that it is put to once, at 1 s; 0: it rises all the time */
} platform;

static platform platform_of_test;

static void platform_move(void *user, double step_s)
{
  platform *p = &platform_of_test;
  (void)user;
  p->time += step_s;
  double z = p->height == 0.0 ? SPEED * p->time : p->time >= 1.0 ? p->height : 0.0;
  dBodySetPosition(p->body, 0.0, 0.0, z - 0.05);
}

static platform *platform_open(double hz, double height)
{
  platform *p = &platform_of_test;
  memset(p, 0, sizeof *p);
  cw_open(&p->w, 0.0);
  p->height = height;
  p->w.def.physics_hz = hz;
  p->w.hand_def.radius = RADIUS;
  p->w.hand_def.stiffness = K;
  p->w.hand_def.damping = 0.0;
  p->w.hand_expert.coupling = HAP_COUPLING_DIRECT;
  p->w.ode.before_step = platform_move;
  p->body = cw_add_cube(&p->w, 1.0, 0.1, 0.0, 0.0, -0.05);
  dBodySetKinematic(p->body);
  return p;
}

TEST(a_platform_that_is_moved_by_pose_has_no_stairs)
{
  static const double rates[] = {20.0, 60.0};
  for (int i = 0; i < 2; ++i) {
    platform *p = platform_open(rates[i], 0.0);
    double steepest = 0.0;
    double before = 0.0;
    cw_start(&p->w, 0.0, 0.0, RADIUS + 0.006);
    for (int k = 0; k < 150; ++k) { /* 3 mm deep when it has risen by 9 mm */
      cw_tick(&p->w);
      double force = p->w.force[2];
      steepest = before > 0.0 && force > 0.0 ? fmax(steepest, fabs(force - before)) : steepest;
      before = force;
    }
    CHECK(before > 1.0);
    CHECK(steepest < 1.01 * K * SPEED / p->w.def.haptic_hz);
    cw_close(&p->w);
  }
}

TEST(a_platform_that_is_put_elsewhere_stays_there)
{
  platform *p = platform_open(20.0, 0.02);
  double most = 0.0;
  cw_start(&p->w, 0.0, 0.0, 0.02 + RADIUS - 0.002); /* will be 2 mm deep */
  for (int k = 0; k < 2000; ++k) {
    cw_tick(&p->w);
    most = fmax(most, p->w.force[2]);
  }
  CHECK_NEAR(p->w.force[2], 0.002 * K, 1e-6);
  CHECK(most < 0.002 * K + 1e-6);
  cw_close(&p->w);
}
