/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Surfaces that pull the hand from a distance: by the public headers, against closed forms. */

#include "tests/tap.h"

#include <hapode/hapode.h>
#include <hapode/hooks.h>
#include <hapode/ode.h>

#include "pointer/own_force.h"
#include "tests/surface_world.h"

#define FORCE 2.0   /* N */
#define REACH 0.015 /* m */
#define PEAK (1.5 * sqrt(3.0))

static contact_world *magnet_floor(hap_model model)
{
  contact_world *w = floor_new(model);
  w->ode.magnet_reach = 0.02;
  told.says.magnet_force = FORCE;
  told.says.magnet_reach = REACH;
  return w;
}

/* N at a gap, towards the surface. */
static double magnet_of(double gap)
{
  double u = gap / REACH;
  return u > 0.0 && u < 1.0 ? FORCE * PEAK * u * (1.0 - u * u) : 0.0;
}

typedef struct rate_row {
  const char *name;
  double rate;
} rate_row;

static const rate_row rates[] = {
    {"it_pulls_at_1_khz", 1e3},
    {"it_pulls_at_5_khz", 5e3},
    {"it_pulls_at_10_khz", 1e4},
};

/* Down from beyond its reach into the surface, and up again: each tick, all models. */
TEST_EACH(rates, const rate_row *row)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = magnet_floor(all_models[m]);
    cw_add_floor(w);
    w->def.haptic_hz = row->rate;
    cw_start(w, 0.0, 0.0, RADIUS + 0.03);
    double worst = 0.0;
    double work = 0.0;
    int second = (int)row->rate;
    cw_run(w, second / 20);
    for (int i = 0; i < 2 * second; ++i) {
      double before = w->force[2];
      cw_go(w, 0.0, 0.0, i < second ? -0.032 : 0.032, 1);
      double gap = w->hand_at[2] - RADIUS;
      double right = gap > 0.0 ? -magnet_of(gap) : -STIFFNESS * gap;
      worst = fmax(worst, fabs(w->force[2] - right));
      work += 0.5 * (before + w->force[2]) * w->hand_velocity[2] / row->rate;
    }
    printf("# model %zu: %.2g N, %.2g J\n", m, worst, work);
    CHECK(worst < 1e-9 && fabs(work) < 1e-9 * row->rate);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

/* A round beside and over a ball: no energy. */
TEST(no_round_about_a_ball_gives_energy)
{
  contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
  dGeomSetPosition(dCreateSphere(w->space, 0.03), 0.0, 0.0, -0.03);
  w->def.haptic_hz = 1e4;
  cw_start(w, 0.0, 0.0, RADIUS + 0.004);
  cw_run(w, 1000);
  double work = 0.0;
  double most = 0.0;
  const double ways[4][3] = {
      {0.02, 0.0, 0.0}, {0.0, 0.0, 0.006}, {-0.02, 0.0, 0.0}, {0.0, 0.0, -0.006}};
  for (int leg = 0; leg < 4; ++leg) {
    cw_move_hand(w, ways[leg][0] / 0.2, ways[leg][1] / 0.2, ways[leg][2] / 0.2);
    for (int i = 0; i < 2000; ++i) {
      double before[3];
      memcpy(before, w->force, sizeof before);
      cw_tick(w);
      for (int k = 0; k < 3; ++k) {
        work += 0.5 * (before[k] + w->force[k]) * w->hand_velocity[k] * 1e-4;
      }
      most = fmax(most, cw_norm(w->force));
    }
  }
  printf("# %.3g J of %.3g\n", work, FORCE * REACH);
  CHECK(most > 0.5 * FORCE && fabs(work) < 1e-4 * FORCE * REACH);
}

/* A ball in free space is drawn to the hand by what the hand feels. */
TEST(the_body_gets_what_the_hand_feels)
{
  for (int i = 0; i < 2; ++i) {
    contact_world *w = magnet_floor(i == 0 ? HAP_MODEL_CONTACT : HAP_MODEL_SINGLE);
    cw_add_ball(w, 0.2, 0.03, 0.0, 0.0, -0.03);
    cw_start(w, 0.0, 0.0, RADIUS + 0.008);
    cw_run(w, 30);
    CHECK(w->force[2] < -0.3 * FORCE);
    CHECK(w->seen.momentum[2] > 1e-3);
    CHECK_NEAR(w->seen.impulse[2], w->seen.momentum[2], 2e-3 * w->seen.momentum[2]);
  }
}

/* A block that has gone to sleep on the floor is drawn up, and its floor is there. */
TEST(a_body_that_sleeps_wakes)
{
  static const double forces[] = {1.0, 4.0};
  for (int i = 0; i < 2; ++i) {
    contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
    told.other = cw_add_floor(w);
    dWorldSetGravity(w->world, 0.0, 0.0, -CW_GRAVITY);
    dWorldSetAutoDisableFlag(w->world, 1);
    dBodyID block = cw_add_box(w, 0.2, AT(0.06, 0.06, 0.04), 0.0, 0.0, 0.02);
    dBodySetAutoDisableFlag(block, 1);
    told.says.magnet_force = forces[i];
    cw_start(w, 0.0, 0.0, 0.04 + RADIUS + 0.1);
    cw_run(w, 1500);
    double at = w->position[0][2];
    double lowest = at;
    cw_move_hand(w, 0.0, 0.0, -0.93);
    for (int k = 0; k < 400; ++k) {
      if (k == 100) {
        cw_move_hand(w, 0.0, 0.0, 0.0);
      }
      cw_tick(w);
      lowest = fmin(lowest, w->position[0][2]);
    }
    CHECK(at - lowest < 1e-7);
    CHECK((w->position[0][2] - at > 1e-3) == (i == 1)); /* 4 N lift 2 N */
  }
}

/* Beside its middle a box is turned by what the hand feels, as it is at the hand. */
TEST(a_box_is_turned_by_the_arm)
{
  contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
  dMass mass;
  double turned[3] = {0.0, 0.0, 0.0}; /* N m s */
  double synced[3] = {0.0, 0.0, 0.0}; /* up to the newest sync */
  dBodyID box = cw_add_box(w, 5.0, AT(0.1, 0.1, 0.1), 0.0, 0.0, -0.05);
  cw_start(w, 0.03, 0.02, RADIUS + 0.008);
  for (int i = 0; i < 100; ++i) {
    double arm[3];
    uint32_t steps = w->seen.steps;
    cw_tick(w);
    if (w->seen.steps != steps) {
      memcpy(synced, turned, sizeof synced);
    }
    for (int k = 0; k < 3; ++k) {
      arm[k] = w->hand_at[k] - w->position[0][k];
    }
    turned[0] -= PERIOD * (arm[1] * w->force[2] - arm[2] * w->force[1]);
    turned[1] -= PERIOD * (arm[2] * w->force[0] - arm[0] * w->force[2]);
    turned[2] -= PERIOD * (arm[0] * w->force[1] - arm[1] * w->force[0]);
  }
  dBodyGetMass(box, &mass);
  const dReal *spin = dBodyGetAngularVel(box);
  CHECK(synced[0] > 1e-3 && synced[1] < -1e-3);
  for (int k = 0; k < 3; ++k) {
    CHECK_NEAR(mass.I[0] * spin[k], synced[k], 2e-3 * synced[0]);
  }
}

/* What a ball of 1 g can hold of 20 N on 3 mm: a change of 0.3 of its way in a tick. It comes at
 * once, as the hand was out of reach. */
TEST(a_light_body_bounds_the_pull)
{
  const double mass = 0.001;
  const double reach = 0.003;
  const double steep = PEAK * 20.0 / reach * PERIOD * PERIOD / mass;
  const double u = 0.002 / reach;
  contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
  told.says.magnet_force = 20.0;
  told.says.magnet_reach = reach;
  cw_add_ball(w, mass, 0.03, 0.0, 0.0, -0.03);
  cw_start(w, 0.0, 0.0, RADIUS + 0.0035);
  cw_run(w, 50);
  CHECK(w->force[2] == 0.0);
  cw_go(w, 0.0, 0.0, -1.5, 1);
  CHECK_NEAR(w->force[2], -20.0 * PEAK * u * (1.0 - u * u) * 0.3 / steep, 1e-6);
}

static int steep_lines;

static void steep_count(hap_log_level level, const char *text, void *user)
{
  (void)user;
  steep_lines += level >= HAP_LOG_WARNING && strstr(text, "than the device can hold") != NULL;
}

typedef struct hold_row {
  const char *name;
  const char *device;
  hap_coupling coupling;
  double holds; /* N/m */
  int lines;
} hold_row;

static const hold_row holds[] = {
    {"a_rated_device_bounds_the_pull", ",rated_stiffness=2000", HAP_COUPLING_DIRECT, 2000.0, 1},
    {"behind_a_proxy_a_little_more", ",rated_stiffness=2000", HAP_COUPLING_PROXY, 1800.0, 1},
    {"damping_bounds_the_pull", ",device_damping=1", HAP_COUPLING_DIRECT, 1600.0, 1},
    {"of_an_unknown_device_the_contacts_do", "", HAP_COUPLING_DIRECT, STIFFNESS, 1},
    {"what_it_holds_is_whole", ",rated_stiffness=40000", HAP_COUPLING_DIRECT, 17320.508, 0},
};

/* 20 N on 3 mm are 17 kN/m at the surface: what is felt is as steep as the device holds. */
TEST_EACH(holds, const hold_row *row)
{
  contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
  char spec[128];
  hap_hooks hooks;
  hap_detail why = {""};
  hap_pointer_state state;
  (void)snprintf(spec, sizeof spec, "virtual:path=0:0/0/%g;9:0/0/%g,hand=rigid,max_force=30%s",
                 RADIUS + 0.001, RADIUS + 0.001, row->device);
  hap_hooks_init(&hooks, sizeof hooks);
  hooks.log = steep_count;
  steep_lines = 0;
  REQUIRE(hap_hooks_set(&hooks) == HAP_OK);
  told.says.magnet_force = 20.0;
  told.says.magnet_reach = 0.003;
  cw_add_floor(w);
  (void)dCreatePlane(w->space, 0.0, 1.0, 0.0, -RADIUS - 0.02); /* a second one is not told */
  w->hand_expert.coupling = row->coupling;
  w->hand_def.max_force = 30.0;
  w->ode.user = w;
  w->ode.world = w->world;
  w->ode.space = w->space;
  hap_device *device = NULL;
  REQUIRE(hap_device_open(spec, &device, &why) == HAP_OK);
  w->hand_def.device = device;
  REQUIRE(hap_session_create(&w->def, &w->ode, &w->session, &why) == HAP_OK);
  REQUIRE(hap_pointer_add(w->session, &w->hand_def, &w->hand) == HAP_OK);
  REQUIRE(hap_session_start(w->session) == HAP_OK);
  REQUIRE(hap_session_advance(w->session, 300) >= HAP_OK);
  REQUIRE(hap_pointer_get(w->session, w->hand, &state, sizeof state) >= HAP_OK);
  CHECK_NEAR(state.wrench.force[2], -row->holds * 0.001 * (1.0 - 1.0 / 9.0), 1e-5);
  CHECK(steep_lines == row->lines);
  CHECK(((state.guard & HAP_GUARD_OWN) != 0) == (row->lines > 0));
  CHECK(hap_hooks_set(NULL) == HAP_OK);
  hap_session_destroy(w->session);
  w->session = NULL;
  hap_device_close(device);
}

/* Their bodies do not move in the loop, so nothing pulls at them. */
TEST(bodies_of_the_papers_models_are_not_pulled)
{
  static const hap_model models[] = {HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE};
  for (int i = 0; i < 2; ++i) {
    contact_world *w = magnet_floor(models[i]);
    cw_add_ball(w, 0.2, 0.03, 0.0, 0.0, -0.03);
    cw_start(w, 0.0, 0.0, RADIUS + 0.008);
    cw_run(w, 60);
    CHECK(cw_norm(w->force) == 0.0 && cw_norm(w->seen.momentum) == 0.0);
  }
}

/* 1 g of it cannot swing faster than the tick. */
TEST(light_bodies_stay_bounded)
{
  static const double masses[] = {0.001, 0.01, 0.1, 1.0};
  for (size_t i = 0; i < 4; ++i) {
    contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
    w->research.guard = HAP_GUARD_ON;
    told.says.magnet_force = 20.0;
    told.says.magnet_reach = 0.003;
    told.says.damping = 1.0;
    cw_add_ball(w, masses[i], 0.03, 0.0, 0.0, -0.03);
    cw_start(w, 0.0, 0.0, RADIUS + 0.002);
    double fastest = 0.0;
    for (int k = 0; k < 2000; ++k) {
      cw_go(w, 0.0, 0.0, k % 200 < 100 ? 0.02 : -0.02, 1);
      fastest = fmax(fastest, cw_norm(w->velocity[0]));
    }
    double depth = 20.0 * 0.003 * PEAK / 4.0; /* J, of the potential */
    printf("# %g kg: %.3g m/s\n", masses[i], fastest);
    CHECK(fastest < 0.1 + 2.0 * sqrt(2.0 * depth / masses[i]));
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_NONE);
  }
}

TEST(a_magnet_that_comes_about_the_hand_does_not_leap)
{
  for (size_t m = 0; m < MODELS; ++m) {
    contact_world *w = magnet_floor(all_models[m]);
    cw_add_floor(w);
    told.says.magnet_force = 0.0;
    cw_start(w, 0.0, 0.0, RADIUS + 0.008);
    cw_run(w, 50);
    CHECK(cw_norm(w->force) == 0.0);
    for (int round = 0; round < 2; ++round) {
      told.says.magnet_force = round == 0 ? FORCE : 0.5 * FORCE;
      surface_change(w, NULL);
      double before = w->force[2];
      for (int i = 0; i < 100; ++i) {
        cw_tick(w);
        CHECK(fabs(w->force[2] - before) <= FORCE / 20.0 + 1e-9);
        before = w->force[2];
      }
      CHECK_NEAR(w->force[2], -magnet_of(0.008) * (round == 0 ? 1.0 : 0.5), 1e-9);
    }
  }
}

/* With the guard: no observer holds it back. */
TEST(the_guard_lets_it_be)
{
  contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
  cw_add_floor(w);
  w->research.guard = HAP_GUARD_ON;
  w->hand_def.max_force = 5.0;
  cw_start(w, 0.0, 0.0, RADIUS + 0.02);
  cw_run(w, 50);
  for (int i = 0; i < 4000; ++i) {
    cw_go(w, 0.0, 0.0, i % 800 < 400 ? -0.05 : 0.05, 1);
    double gap = w->hand_at[2] - RADIUS;
    CHECK_NEAR(w->force[2], gap > 0.0 ? -magnet_of(gap) : -STIFFNESS * gap, 1e-6);
  }
  hap_stats stats = cw_stats(w);
  CHECK(stats.faults.energy_ticks == 0 && stats.faults.fault == HAP_FAULT_NONE);
}

/* Where coupling AUTO takes a proxy or leaves it, the pull is cut alike: a hand that goes to and
 * fro there would get the difference in each round. */
TEST(what_the_device_holds_does_not_leap_with_the_proxy)
{
  hapi_pointer p;
  memset(&p, 0, sizeof p);
  p.coupling.hold_known = true;
  p.coupling.own.stiffness = 1000.0;
  p.coupling.kind = HAP_COUPLING_DIRECT;
  CHECK(hapi_magnet_hold(&p) == 1000.0);
  const hap_coupling kinds[] = {HAP_COUPLING_AUTO, HAP_COUPLING_PROXY};
  for (int i = 0; i < 2; ++i) {
    p.coupling.kind = kinds[i];
    p.proxied = false;
    double without = hapi_magnet_hold(&p);
    p.proxied = true;
    CHECK(hapi_magnet_hold(&p) == without);
    CHECK(without < 1000.0 && without >= 500.0);
  }
}

/* Behind a proxy the pull is that of the tick before, however hard its spring is damped: so says
 * the page of constants. */
TEST(behind_a_proxy_the_pull_is_a_tick_old)
{
  static const double dampings[] = {0.1, 1.0, 5.0};
  for (int i = 0; i < 3; ++i) {
    contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
    cw_add_floor(w);
    w->hand_expert.coupling = HAP_COUPLING_PROXY;
    w->hand_expert.coupling_stiffness = 1000.0;
    w->hand_expert.coupling_damping = dampings[i];
    cw_start(w, 0.0, 0.0, RADIUS + 0.02);
    cw_run(w, 50);
    for (int k = 0; k < 300; ++k) {
      double before = w->hand_at[2] - RADIUS;
      cw_go(w, 0.0, 0.0, -0.05, 1);
      if (k > 100) { /* it keeps its speed */
        CHECK_NEAR(w->force[2], -magnet_of(before), 1e-4);
      }
    }
  }
}

/* Towards one geom, and from the geom's own reach on. */
TEST(what_is_wrong_is_refused)
{
  static const double reaches[] = {0.0009, 0.0201, (double)NAN, 0.02};
  static const double forces[] = {1.0, 1.0, 1.0, 100.1};
  for (int i = 0; i < 4; ++i) {
    contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
    cw_add_floor(w);
    cw_start(w, 0.0, 0.0, RADIUS + 0.004);
    told.says.magnet_reach = reaches[i];
    told.says.magnet_force = forces[i];
    surface_change(w, NULL);
    (void)hap_session_advance(w->session, 40);
    CHECK(cw_stats(w).faults.fault == HAP_FAULT_WORLD);
  }
  contact_world *w = magnet_floor(HAP_MODEL_CONTACT);
  hap_detail detail = {""};
  w->ode.magnet_reach = 0.11;
  w->ode.world = w->world;
  w->ode.space = w->space;
  CHECK(hap_session_create(&w->def, &w->ode, &w->session, &detail) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(detail.text, "magnet_reach") != NULL);
}

/* Its points share it. */
TEST(a_hull_is_pulled)
{
  for (size_t m = 0; m < MODELS; ++m) {
    double corners[8 * 3];
    contact_world *w = magnet_floor(all_models[m]);
    cw_add_floor(w);
    hand_be_cube(w, corners);
    cw_start(w, 0.0, 0.0, RADIUS + 0.03);
    cw_run(w, 50);
    double worst = 0.0;
    for (int i = 0; i < 1000; ++i) {
      cw_go(w, 0.0, 0.0, -0.032, 1);
      double gap = w->hand_at[2] - RADIUS;
      worst = fmax(worst, fabs(w->force[2] - (gap > 0.0 ? -magnet_of(gap) : -STIFFNESS * gap)));
    }
    printf("# model %zu: %.2g N\n", m, worst);
    CHECK(worst < 1e-6);
  }
}
