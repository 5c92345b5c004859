/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Surfaces that hold the hand back: by the public headers, against closed forms and a plain ODE
 * loop. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/ode.h>
#include <hapode/pointer_set.h>

#include "tests/surface_world.h"

#define ADHESION 1.0 /* N */
#define SLOW 0.01    /* m/s */

static contact_world *sticky_floor(hap_model model)
{
  contact_world *w = floor_new(model);
  cw_add_floor(w);
  told.says.adhesion = ADHESION;
  return w;
}

/* ---- the closed form ---- */

typedef struct rate_row {
  const char *name;
  double rate;
} rate_row;

static const rate_row rates[] = {
    {"drawn_back_at_1_khz", 1e3},
    {"drawn_back_at_5_khz", 5e3},
    {"drawn_back_at_10_khz", 1e4},
};

/* -k x up to the adhesion, then nothing; and nothing on the way back in. */
TEST_EACH(rates, const rate_row *row)
{
  const double step = SLOW / row->rate; /* m a tick */
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = sticky_floor(all_models[m]);
    w->def.haptic_hz = row->rate;
    floor_start(w);
    int second = (int)row->rate;
    cw_go(w, 0.0, 0.0, -0.01, second * 3 / 10); /* from 1 mm above it to 2 mm deep */
    double worst = 0.0;
    double most = 0.0;
    int leaps = 0;
    cw_move_hand(w, 0.0, 0.0, SLOW);
    for (int i = 0; i < second * 6 / 10; ++i) { /* to 4 mm above */
      cw_tick(w);
      double depth = RADIUS - w->hand_at[2];
      bool near_the_end = fabs(STIFFNESS * depth + ADHESION) < 2.0 * STIFFNESS * step;
      double right = STIFFNESS * depth > -ADHESION ? STIFFNESS * depth : 0.0;
      worst = near_the_end ? worst : fmax(worst, fabs(w->force[2] - right));
      most = fmax(most, -w->force[2]);
      leaps += near_the_end && w->force[2] == 0.0;
    }
    CHECK(worst < 1e-9);
    CHECK(most <= ADHESION + 1e-12 && most >= ADHESION - STIFFNESS * step);
    CHECK(leaps > 0);
    cw_move_hand(w, 0.0, 0.0, -SLOW);
    for (int i = 0; i < second * 5 / 10; ++i) { /* and in again */
      cw_tick(w);
      CHECK_NEAR(w->force[2], fmax(STIFFNESS * (RADIUS - w->hand_at[2]), 0.0), 1e-9);
    }
    CHECK(w->force[2] > 0.0 && cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

/* A spring that is soft gives 0.5 N over 10 mm, and no more comes. */
TEST(a_soft_surface_lets_go_10_mm_away)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = sticky_floor(all_models[m]);
    told.says.stiffness = 50.0;
    floor_start(w);
    hand_press(w, 0.001);
    cw_go(w, 0.0, 0.0, 0.01, 1050);
    CHECK_NEAR(w->force[2], -50.0 * 0.0095, 1e-6);
    cw_go(w, 0.0, 0.0, 0.01, 70);
    CHECK(w->force[2] == 0.0);
  }
}

/* Contact and coupling one after the other, up to the adhesion. */
TEST(a_proxy_sticks)
{
  static const hap_coupling kinds[] = {HAP_COUPLING_PROXY, HAP_COUPLING_GOD_OBJECT,
                                       HAP_COUPLING_VIRTUAL};
  for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; ++i) {
    contact_world *w = sticky_floor(HAP_MODEL_CONTACT);
    w->hand_expert.coupling = kinds[i];
    w->hand_expert.coupling_stiffness = 800.0;
    told.says.stiffness = 400.0;
    double felt = kinds[i] == HAP_COUPLING_PROXY ? 1.0 / (1.0 / 800.0 + 1.0 / 400.0) : 800.0;
    floor_start(w);
    hand_press(w, 0.002);
    cw_go(w, 0.0, 0.0, 0.0, 300);
    CHECK_NEAR(w->force[2], 0.002 * felt, 5e-3);
    double end = ADHESION / felt; /* above the surface */
    cw_go(w, 0.0, 0.0, SLOW, (int)((0.002 + 0.8 * end) / SLOW / PERIOD));
    cw_go(w, 0.0, 0.0, 0.0, 300);
    CHECK_NEAR(w->force[2], -0.8 * ADHESION, 0.01);
    cw_go(w, 0.0, 0.0, SLOW, (int)(0.3 * end / SLOW / PERIOD));
    cw_go(w, 0.0, 0.0, 0.0, 300);
    CHECK(w->row.pointers[0].position[2] - RADIUS > 0.5 * end);
    CHECK(kinds[i] == HAP_COUPLING_VIRTUAL || fabs(w->force[2]) < 1e-3); /* that one swings on */
  }
}

/* All of its points share the adhesion, and let go together. */
TEST(a_hull_sticks)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double corners[8 * 3];
    contact_world *w = sticky_floor(all_models[m]);
    hand_be_cube(w, corners);
    told.says.adhesion = 4.0; /* 4 mm away */
    floor_start(w);
    hand_press(w, 0.001);
    double most = 0.0;
    cw_move_hand(w, 0.0, 0.0, SLOW);
    for (int i = 0; i < 480; ++i) {
      cw_tick(w);
      CHECK_NEAR(w->force[2], STIFFNESS * (RADIUS - w->hand_at[2]), 1e-6);
      most = fmax(most, -w->force[2]);
    }
    cw_go(w, 0.0, 0.0, SLOW, 40);
    CHECK(w->force[2] == 0.0 && most > 3.7);
  }
}

/* ---- friction ---- */

/* Goes by the normal force plus the adhesion, also while the hand pulls. */
TEST(what_sticks_rubs)
{
  static const double depths[] = {0.002, 0.0, -0.0006};
  for (size_t m = 0; m < 3 * MODELS; ++m) {
    contact_world *w = sticky_floor(all_models[m / 3]);
    told.says.friction_static = told.says.friction_dynamic = 0.5;
    floor_start(w);
    hand_press(w, 0.001);
    hand_press(w, depths[m % 3]);
    double load = STIFFNESS * depths[m % 3];
    CHECK_NEAR(w->force[2], load, 1e-6);
    cw_go(w, 0.02, 0.0, 0.0, 400);
    CHECK_NEAR(w->force[0], -0.5 * (load + ADHESION), 1e-3);
    CHECK_NEAR(w->force[2], load, 1e-6);
  }
}

TEST(what_sticks_behind_a_proxy_rubs)
{
  contact_world *w = sticky_floor(HAP_MODEL_CONTACT);
  w->hand_expert.coupling = HAP_COUPLING_PROXY;
  w->hand_expert.coupling_stiffness = 800.0;
  told.says.friction_static = told.says.friction_dynamic = 0.5;
  floor_start(w);
  hand_press(w, 0.001);
  hand_press(w, -0.001);
  cw_go(w, 0.02, 0.0, 0.0, 400);
  double pull = -w->force[2];
  CHECK(pull > 0.3 && pull < 0.6);
  CHECK_NEAR(w->force[0], -0.5 * (ADHESION - pull), 5e-3);
}

/* ---- bodies ---- */

/* Springs that are worked out before the solve: drawn back by 0.7 N a tick, none is above the
 * limit, and friction goes by the whole load. */
TEST(an_explicit_spring_sticks)
{
  contact_world *w = floor_new(HAP_MODEL_CONTACT);
  cw_add_box(w, 1e9, AT(0.2, 0.2, 0.2), 0.0, 0.0, -0.1); /* that does not give way */
  told.says.adhesion = ADHESION;
  told.says.friction_static = told.says.friction_dynamic = 0.5;
  w->hand_research.integration = HAP_INTEGRATION_EXPLICIT;
  floor_start(w);
  hand_press(w, 0.001);
  hand_press(w, -0.0006);
  CHECK_NEAR(w->force[2], -0.6, 1e-4);
  cw_go(w, 0.02, 0.0, 0.0, 400);
  CHECK_NEAR(w->force[0], -0.5 * (ADHESION - 0.6), 1e-3);
  hand_press(w, 0.001);
  double most = 0.0;
  cw_move_hand(w, 0.0, 0.0, 0.7);
  for (int i = 0; i < 10; ++i) {
    cw_tick(w);
    most = fmax(most, -w->force[2]);
  }
  CHECK_NEAR(most, ADHESION, 1e-6);
  CHECK(w->force[2] == 0.0);
}

/* A hand that sticks to a ball in free space: what it gets the ball gives. */
TEST(the_body_gets_what_the_hand_feels)
{
  static const hap_coupling kinds[] = {HAP_COUPLING_DIRECT, HAP_COUPLING_PROXY,
                                       HAP_COUPLING_GOD_OBJECT};
  for (size_t i = 0; i < 4; ++i) {
    contact_world *w = floor_new(i < 3 ? HAP_MODEL_CONTACT : HAP_MODEL_SINGLE);
    told.says.adhesion = 4.0;
    cw_add_ball(w, 0.2, 0.03, 0.0, 0.0, -0.03);
    w->hand_expert.coupling = i < 3 ? kinds[i] : HAP_COUPLING_DIRECT;
    w->hand_expert.coupling_stiffness = 800.0;
    floor_start(w);
    cw_go(w, 0.0, 0.0, -0.05, 40);
    cw_go(w, 0.0, 0.0, 0.05, 30);
    CHECK(w->force[2] < -0.5);
    cw_go(w, 0.0, 0.0, 0.05, 20); /* up to a sync */
    CHECK(w->seen.momentum[2] > 1e-3);
    CHECK_NEAR(w->seen.impulse[2], w->seen.momentum[2], 2e-3 * fabs(w->seen.momentum[2]));
  }
}

typedef struct lift_row {
  const char *name;
  double weight; /* of the adhesion */
  double hz;
  hap_model model;
} lift_row;

static const lift_row lifts[] = {
    {"a_light_body_hangs", 0.6, 60.0, HAP_MODEL_CONTACT},
    {"a_light_body_hangs_at_20_hz", 0.6, 20.0, HAP_MODEL_CONTACT},
    {"a_light_body_hangs_in_single", 0.6, 60.0, HAP_MODEL_SINGLE},
    {"a_heavy_body_stays", 1.2, 60.0, HAP_MODEL_CONTACT},
    {"a_heavy_body_stays_at_20_hz", 1.2, 20.0, HAP_MODEL_CONTACT},
    {"a_heavy_body_stays_in_single", 1.2, 60.0, HAP_MODEL_SINGLE},
};

#define LIFT_TICKS 1000
#define DAMPING 2.0

/* m, m/s of the hand's end at a time: 1 mm down in 50 ms, and up at 30 mm/s. */
static double lift_way(double t)
{
  return t < 0.05 ? -0.001 * t / 0.05 : -0.001 + 0.03 * (t - 0.05);
}

static double lift_speed(double t)
{
  return t < 0.05 + 1e-9 ? -0.02 : 0.03;
}

/* A plain ODE world at 4 kHz: a block on a floor, and a force by the rule of the page. It shares no
 * code. */
static void lift_plain(double mass, double at, double out_force[LIFT_TICKS],
                       double out_height[LIFT_TICKS])
{
  dWorldID world = dWorldCreate();
  dMass m;
  dMassSetBoxTotal(&m, mass, 0.06, 0.06, 0.04);
  dBodyID block = dBodyCreate(world);
  dWorldSetGravity(world, 0.0, 0.0, -CW_GRAVITY);
  dBodySetMass(block, &m);
  dBodySetPosition(block, 0.0, 0.0, at);
  bool sticks = false;
  for (int i = 0; i < 4 * LIFT_TICKS; ++i) {
    double t = 0.25 * PERIOD * (i + 4);
    double z = dBodyGetPosition(block)[2];
    double v = dBodyGetLinearVel(block)[2];
    double depth = z - at - lift_way(t);
    double force = STIFFNESS * depth + DAMPING * (v - lift_speed(t));
    if (depth > 0.0) {
      sticks = true;
      force = fmax(force, -ADHESION);
    } else if (!sticks || force <= -ADHESION) {
      sticks = false;
      force = 0.0;
    }
    if (i % 4 == 0) {
      out_force[i / 4] = force;
      out_height[i / 4] = z - at;
    }
    dBodyAddForce(block, 0.0, 0.0, -force);
    double push = mass * CW_GRAVITY + force; /* what the floor bears */
    if (z <= at && push > 0.0) {
      dBodyAddForce(block, 0.0, 0.0, push);
      dBodySetLinearVel(block, 0.0, 0.0, fmax(v, 0.0));
    }
    dWorldStep(world, 0.25 * PERIOD);
  }
  dWorldDestroy(world);
}

TEST_EACH(lifts, const lift_row *row)
{
  static double force[LIFT_TICKS];
  static double height[LIFT_TICKS];
  double mass = row->weight * ADHESION / CW_GRAVITY;
  contact_world *w = floor_new(row->model);
  w->def.physics_hz = row->hz;
  told.other = cw_add_floor(w);
  cw_add_box(w, mass, AT(0.06, 0.06, 0.04), 0.0, 0.0, 0.02);
  dWorldSetGravity(w->world, 0.0, 0.0, -CW_GRAVITY);
  told.says.adhesion = ADHESION;
  told.says.damping = DAMPING;
  told.says.friction_static = told.says.friction_dynamic = 0.5; /* else it tips off the ball */
  cw_start(w, 0.0, 0.0, 0.04 + RADIUS + 0.003);
  cw_run(w, 300); /* it settles */
  double at = w->position[0][2];
  w->hand_at[2] = at + 0.02 + RADIUS;
  lift_plain(mass, at, force, height);
  double sum = 0.0;
  double all = 0.0;
  double apart = 0.0;
  int off = 0; /* ticks in which one of the two has let go, and the other not */
  for (int i = 0; i < LIFT_TICKS; ++i) {
    double t = PERIOD * (i + 1);
    cw_go(w, 0.0, 0.0, (lift_way(t) - lift_way(t - PERIOD)) / PERIOD, 1);
    if ((w->force[2] == 0.0) != (force[i] == 0.0)) {
      ++off;
      continue;
    }
    sum += (w->force[2] - force[i]) * (w->force[2] - force[i]);
    all += force[i] * force[i];
    apart = fmax(apart, fabs(w->position[0][2] - at - height[i]));
  }
  printf("# force %.3f %% off, height %.4f mm, %d ticks\n", 100.0 * sqrt(sum / all), 1e3 * apart,
         off);
  CHECK(sqrt(sum / all) < 0.01 && apart < 1e-4 && off <= 1);
  bool hangs = row->weight < 1.0;
  CHECK(hangs == (w->position[0][2] - at > 0.02));
  CHECK_NEAR(w->force[2], hangs ? -row->weight * ADHESION : 0.0, 0.02);
}

/* ---- energy and guard ---- */

/* In and out costs what the spring holds when it lets go. */
TEST(a_round_costs_what_the_spring_held)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = sticky_floor(all_models[m]);
    w->def.haptic_hz = 1e4;
    floor_start(w);
    for (int round = 0; round < 3; ++round) {
      double work = 0.0;
      for (int i = 0; i < 8000; ++i) {
        double before = w->force[2];
        cw_go(w, 0.0, 0.0, i < 4000 ? -SLOW : SLOW, 1);
        work += 0.5 * (before + w->force[2]) * w->hand_velocity[2] * 1e-4;
      }
      double lost = 0.5 * ADHESION * ADHESION / STIFFNESS;
      CHECK_NEAR(work, -lost, 5e-3 * lost);
    }
  }
}

/* With the guard on: nothing is held back but the leap, by the slew. */
TEST(the_guard_lets_it_be)
{
  for (size_t m = 0; m < 2 * MODELS; ++m) {
    bool proxied = m / MODELS == 1;
    contact_world *w = sticky_floor(proxied ? HAP_MODEL_CONTACT : all_models[m % MODELS]);
    w->research.guard = HAP_GUARD_ON;
    w->hand_def.max_force = 5.0;
    w->hand_expert.coupling = proxied ? HAP_COUPLING_PROXY : HAP_COUPLING_DIRECT;
    w->hand_expert.coupling_stiffness = 800.0;
    told.says.friction_static = told.says.friction_dynamic = 0.4;
    floor_start(w);
    double before = 0.0;
    for (int i = 0; i < 2000; ++i) {
      double up = i % 400 < 200 ? -0.03 : 0.03;
      cw_go(w, i % 800 < 400 ? 0.01 : -0.01, 0.0, up, 1);
      CHECK(fabs(w->force[2] - before) <= 5.0 * PERIOD / 0.002 + 1e-9);
      before = w->force[2];
    }
    hap_stats stats = cw_stats(w);
    CHECK(stats.faults.energy_ticks == 0 && stats.faults.fault == HAP_FAULT_NONE);
    CHECK(stats.faults.slewed_ticks == 0);
  }
}

/* ---- changes, and what is told ---- */

TEST(a_surface_that_sticks_no_more_lets_go)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = sticky_floor(all_models[m]);
    floor_start(w);
    hand_press(w, 0.001);
    hand_press(w, -0.0005);
    CHECK_NEAR(w->force[2], -0.5, 1e-6);
    told.says.adhesion = 0.0;
    surface_change(w, NULL);
    cw_run(w, 30);
    CHECK(w->force[2] == 0.0);
  }
}

typedef struct away_row {
  const char *name;
  int way;
} away_row;

static const away_row aways[] = {
    {"what_stuck_before_a_leap_away_and_back_does_not_stick", 0},
    {"what_stuck_before_a_fault_does_not_stick", 1},
    {"what_stuck_before_a_teleport_does_not_stick", 2},
};

static void hand_leave(contact_world *w, int way)
{
  hap_pointer_settings s;
  hap_pointer_settings_init(&s, sizeof s);
  double at = w->hand_at[2];
  switch (way) {
    case 0:
      w->hand_at[2] = at + 0.05;
      cw_go(w, 0.0, 0.0, 0.0, 1);
      w->hand_at[2] = at;
      break;
    case 1:
      hap_emergency_zero();
      (void)hap_session_advance(w->session, 40);
      CHECK(hap_session_reset_fault(w->session) == HAP_OK);
      break;
    default:
      s.mask = HAP_SET_BASE | HAP_SET_TELEPORT;
      s.pose_world_device = (hap_pose){{0.0, 0.0, 0.05}, {1.0, 0.0, 0.0, 0.0}};
      CHECK(hap_pointer_set(w->session, w->hand, &s) == HAP_OK);
      cw_go(w, 0.0, 0.0, 0.0, 1);
      s.pose_world_device = (hap_pose){{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
      CHECK(hap_pointer_set(w->session, w->hand, &s) == HAP_OK);
  }
}

/* It has not pressed since. */
TEST_EACH(aways, const away_row *row)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = sticky_floor(all_models[m]);
    floor_start(w);
    hand_press(w, 0.001);
    hand_press(w, -0.0005);
    CHECK_NEAR(w->force[2], -0.5, 1e-6);
    hand_leave(w, row->way);
    for (int i = 0; i < 60; ++i) {
      cw_tick(w);
      CHECK(w->force[2] == 0.0);
    }
    hand_press(w, 0.001);
    hand_press(w, -0.0005);
    CHECK_NEAR(w->force[2], -0.5, 1e-6);
  }
}

/* It lasts while it sticks. */
TEST(a_touch_that_sticks_is_one_touch)
{
  contact_world *w = sticky_floor(HAP_MODEL_CONTACT);
  hap_event events[16];
  hap_touch touch;
  size_t count = 0;
  floor_start(w);
  (void)hap_session_events(w->session, events, 16, sizeof events[0], &count);
  (void)hap_pointer_touches(w->session, w->hand, &touch, 1, sizeof touch, &count);
  hand_press(w, 0.001);
  hand_press(w, -0.0008);
  cw_run(w, 50);
  CHECK(hap_pointer_touches(w->session, w->hand, &touch, 1, sizeof touch, &count) == HAP_OK &&
        count == 1);
  CHECK_NEAR(touch.force[2], -0.8, 1e-6);
  cw_go(w, 0.0, 0.0, 0.03, 50);
  (void)hap_session_events(w->session, events, 16, sizeof events[0], &count);
  size_t touched = 0;
  size_t released = 0;
  for (size_t i = 0; i < count; ++i) {
    touched += events[i].kind == HAP_EVENT_TOUCH;
    released += events[i].kind == HAP_EVENT_RELEASE;
  }
  CHECK(touched == 1 && released == 1);
}
