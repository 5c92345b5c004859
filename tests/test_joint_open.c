/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* How far joints open: the gauge of hapode-bench accuracy itself, each kind of joint in the loop
 * at every tick, and the scenes that have joints. */

#include "tests/tap.h"

#include <math.h>

#include "base/vec.h"
#include "bench/accuracy.h"
#include "tests/joint_world.h"

#define WAY 2e-3
#define TURN 1e-2
#define SECONDS 1.0
#define ALIGNED 1e-3 /* rad: 0.1 mm at 0.1 m */
#define PLAY 0.05    /* m, of what slides */

/* An axis, one across it, and the one across both. */
static const double along[3] = {0.6, 0.0, 0.8};
static const double across[3] = {0.0, 1.0, 0.0};
static const double third[3] = {-0.8, 0.0, 0.6};

static const double at[3] = {0.2, 0.01, -0.02};

typedef dJointID (*join_fn)(dWorldID world, dBodyID a, dBodyID b);

static dJointID join_ball(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateBall(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetBallAnchor(joint, at[0], at[1], at[2]);
  return joint;
}

static dJointID join_hinge(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateHinge(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetHingeAnchor(joint, at[0], at[1], at[2]);
  dJointSetHingeAxis(joint, along[0], along[1], along[2]);
  return joint;
}

static dJointID join_slider(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateSlider(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetSliderAxis(joint, along[0], along[1], along[2]);
  dJointSetSliderParam(joint, dParamLoStop, -PLAY);
  dJointSetSliderParam(joint, dParamHiStop, PLAY);
  return joint;
}

static dJointID join_universal(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateUniversal(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetUniversalAnchor(joint, at[0], at[1], at[2]);
  dJointSetUniversalAxis1(joint, along[0], along[1], along[2]);
  dJointSetUniversalAxis2(joint, across[0], across[1], across[2]);
  return joint;
}

static dJointID join_hinge2(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateHinge2(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetHinge2Anchor(joint, at[0], at[1], at[2]);
  dJointSetHinge2Axes(joint, along, across);
  return joint;
}

static dJointID join_piston(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreatePiston(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetPistonAnchor(joint, at[0], at[1], at[2]);
  dJointSetPistonAxis(joint, along[0], along[1], along[2]);
  dJointSetPistonParam(joint, dParamLoStop, -PLAY);
  dJointSetPistonParam(joint, dParamHiStop, PLAY);
  return joint;
}

static dJointID join_fixed(dWorldID world, dBodyID a, dBodyID b)
{
  dJointID joint = dJointCreateFixed(world, NULL);
  dJointAttach(joint, a, b);
  dJointSetFixed(joint);
  return joint;
}

static const struct {
  const char *name;
  join_fn join;
  bool slides;      /* along the axis */
  bool turns_along; /* about it */
  bool turns;       /* about the third */
  bool pair;        /* between two bodies only */
} kinds[] = {
    {"ball", join_ball, false, true, true, false},
    {"hinge", join_hinge, false, true, false, false},
    {"slider", join_slider, true, false, false, false},
    {"universal", join_universal, false, true, false, false},
    {"hinge-2", join_hinge2, true, true, false, true},
    {"piston", join_piston, true, true, false, false},
    {"fixed", join_fixed, false, false, false, false},
};

#define KINDS (sizeof kinds / sizeof kinds[0])

/* ---- the gauge ---- */

static void turn_pose(hap_pose *pose, const double axis[3], double angle)
{
  double s = sin(0.5 * angle);
  const double turn[4] = {cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]};
  double q[4];
  hapi_quat_multiply(turn, pose->quat_wxyz, q);
  memcpy(pose->quat_wxyz, q, sizeof q);
}

/* Of the first body moved and turned. */
static joint_opening joint_opened(const joint_gauge *gauge, const dBodyID bodies[2],
                                  const double way[3], const double *axis)
{
  hap_pose poses[2] = {joint_gauge_pose(bodies[0]), joint_gauge_pose(bodies[1])};
  joint_opening worst = {0.0, 0.0};
  hapi_v3_madd(poses[0].position, WAY, way, poses[0].position);
  if (axis != NULL) {
    turn_pose(&poses[0], axis, TURN);
  }
  joint_gauge_read(gauge, poses, NULL, &worst, NULL);
  return worst;
}

static void check_gauge(size_t k, const dBodyID bodies[2])
{
  static const double none[3] = {0.0, 0.0, 0.0};
  joint_gauge gauge;
  REQUIRE(joint_gauge_init(&gauge, bodies, 2, NULL) == HAP_OK);
  CHECK(gauge.count == 1);
  CHECK(joint_opened(&gauge, bodies, none, NULL).way < 1e-12);
  CHECK(joint_opened(&gauge, bodies, none, NULL).turn < 1e-12);
  CHECK_NEAR(joint_opened(&gauge, bodies, across, NULL).way, WAY, 1e-12);
  CHECK_NEAR(joint_opened(&gauge, bodies, third, NULL).way, WAY, 1e-12);
  CHECK_NEAR(joint_opened(&gauge, bodies, along, NULL).way, kinds[k].slides ? 0.0 : WAY, 1e-12);
  CHECK(joint_opened(&gauge, bodies, third, NULL).turn < 1e-12);
  CHECK_NEAR(joint_opened(&gauge, bodies, none, along).turn, kinds[k].turns_along ? 0.0 : TURN,
             1e-9);
  CHECK_NEAR(joint_opened(&gauge, bodies, none, third).turn, kinds[k].turns ? 0.0 : TURN, 1e-9);
}

/* Between two bodies, and between the first and the world in either order. */
TEST(gauge_reads_what_is_open)
{
  for (size_t k = 0; k < KINDS; ++k) {
    for (int order = 0; order < (kinds[k].pair ? 1 : 3); ++order) {
      dWorldID world = dWorldCreate();
      const dBodyID bodies[2] = {dBodyCreate(world), dBodyCreate(world)};
      dBodySetPosition(bodies[0], 0.3, 0.1, -0.2);
      dBodySetPosition(bodies[1], 0.1, -0.1, 0.05);
      dBodySetQuaternion(bodies[0], (const dQuaternion){0.8, 0.36, -0.48, 0.0});
      dBodySetQuaternion(bodies[1], (const dQuaternion){0.6, 0.0, 0.64, 0.48});
      kinds[k].join(world, order == 2 ? NULL : bodies[0],
                    order == 0   ? bodies[1]
                    : order == 2 ? bodies[0]
                                 : NULL);
      printf("# %s, order %d\n", kinds[k].name, order);
      check_gauge(k, bodies);
      dWorldDestroy(world);
    }
  }
}

TEST(gauge_tells_what_the_loop_has_from_the_rest)
{
  dWorldID world = dWorldCreate();
  const dBodyID bodies[2] = {dBodyCreate(world), dBodyCreate(world)};
  const bool second[2] = {false, true};
  joint_gauge gauge;
  joint_opening in = {0.0, 0.0};
  joint_opening out = {0.0, 0.0};
  join_ball(world, bodies[0], NULL);
  join_ball(world, bodies[1], NULL);
  REQUIRE(joint_gauge_init(&gauge, bodies, 2, NULL) == HAP_OK);
  hap_pose poses[2] = {joint_gauge_pose(bodies[0]), joint_gauge_pose(bodies[1])};
  poses[0].position[0] += 1e-3;
  poses[1].position[0] += 2e-3;
  joint_gauge_read(&gauge, poses, second, &in, &out);
  CHECK_NEAR(in.way, 2e-3, 1e-12);
  CHECK_NEAR(out.way, 1e-3, 1e-12);
  dWorldDestroy(world);
}

TEST(gauge_refuses_what_it_does_not_know)
{
  dWorldID world = dWorldCreate();
  const dBodyID bodies[2] = {dBodyCreate(world), dBodyCreate(world)};
  hap_detail detail = {""};
  joint_gauge gauge;
  dJointID joint = dJointCreateLMotor(world, NULL);
  dJointAttach(joint, bodies[0], bodies[1]);
  CHECK(joint_gauge_init(&gauge, bodies, 2, &detail) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(detail.text, "not known") != NULL);
  dJointDestroy(joint);
  join_ball(world, bodies[0], bodies[1]);
  CHECK(joint_gauge_init(&gauge, bodies, 1, &detail) == HAP_ERROR_UNSUPPORTED);
  CHECK(strstr(detail.text, "not in the list") != NULL);
  for (int i = 0; i < JOINT_GAUGE_MAX; ++i) {
    join_ball(world, bodies[0], NULL);
  }
  CHECK(joint_gauge_init(&gauge, bodies, 2, &detail) == HAP_ERROR_MEMORY);
  dWorldDestroy(world);
}

/* ---- each kind in the loop ---- */

static join_fn joined_by;

/* A hinge to the world and the joint behind it, both turning. */
static void build_pair(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, first, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  m->joints[m->joint_count++] = joined_by(m->w.world, first, second);
  dBodySetAngularVel(first, 0.0, 6.0, 0.0);
  dBodySetLinearVel(first, 0.0, 0.0, -0.6);
  dBodySetAngularVel(second, 0.0, 6.0, 0.0);
  dBodySetLinearVel(second, 0.0, 0.0, -1.8);
}

typedef struct both {
  joint_opening loop;
  joint_opening world;
} both;

static void read_both(const mechanism *m, const joint_gauge *gauge, both *out)
{
  hap_pose poses[2];
  CHECK(hap_session_poses_now(m->w.session, m->w.bodies, 2, poses) == HAP_OK);
  joint_gauge_read(gauge, poses, NULL, &out->loop, NULL);
  poses[0] = joint_gauge_pose(m->w.bodies[0]);
  poses[1] = joint_gauge_pose(m->w.bodies[1]);
  joint_gauge_read(gauge, poses, NULL, &out->world, NULL);
}

/* A joint that has to be measured is the loop's one step late, and then closes what ODE has
 * opened. */
static int ticks_until_held(size_t k)
{
  return kinds[k].join == join_piston ? 3 * STEP_TICKS : 0;
}

static void check_kind(size_t k)
{
  joint_gauge gauge;
  both worst = {{0.0, 0.0}, {0.0, 0.0}};
  joined_by = kinds[k].join;
  mechanism *m = mechanism_new(build_pair, 1.0);
  REQUIRE(joint_gauge_init(&gauge, m->w.bodies, 2, NULL) == HAP_OK);
  CHECK(gauge.count == 2);
  start_mechanism(m);
  cw_run(&m->w, ticks_until_held(k));
  for (int t = ticks_until_held(k); t < (int)lround(SECONDS / PERIOD); ++t) {
    cw_tick(&m->w);
    read_both(m, &gauge, &worst);
  }
  printf("# %s: open by %.3g mm in the loop, %.3g mm in the world, turned by %.3g mrad\n",
         kinds[k].name, 1e3 * worst.loop.way, 1e3 * worst.world.way, 1e3 * worst.loop.turn);
  CHECK(worst.loop.way <= CLOSED && worst.world.way <= CLOSED);
  CHECK(worst.loop.turn <= ALIGNED && worst.world.turn <= ALIGNED);
  CHECK(cw_stats(&m->w).model.range_joints == 2);
}

TEST(no_kind_opens_in_the_loop)
{
  for (size_t k = 0; k < KINDS; ++k) {
    check_kind(k);
  }
}

/* ---- what comes into the range ---- */

/* Two bars that swing, the first with a ball at its middle. */
static void build_swing(mechanism *m)
{
  dBodyID first = add_body(m, 0.5, bar, 0.1, 0.0, 0.0);
  dBodyID second = add_body(m, 0.3, bar, 0.3, 0.0, 0.0);
  add_hinge(m, first, NULL, AT(0.0, 0.0, 0.0), AT(0.0, 1.0, 0.0));
  m->joints[m->joint_count++] = join_ball(m->w.world, first, second);
}

/* A hand comes from far to where the ball passes, and waits there. The loop has the bars as soon as
 * ODE's step does not hold their joints. */
TEST(what_ode_has_opened_is_closed_before_a_hand_touches)
{
  joint_gauge gauge;
  both worst = {{0.0, 0.0}, {0.0, 0.0}};
  double before = 0.0;
  int open_ticks = 0;
  bool closed = false;
  mechanism *m = mechanism_new(build_swing, 9.81);
  REQUIRE(joint_gauge_init(&gauge, m->w.bodies, 2, NULL) == HAP_OK);
  cw_start(&m->w, 0.0, -8.0, -0.1);
  cw_move_hand(&m->w, 0.0, 4.0, 0.0);
  for (int t = 0; t < 4000 && cw_norm(m->w.force) == 0.0; ++t) {
    worst = (both){{0.0, 0.0}, {0.0, 0.0}};
    if (m->w.hand_at[1] >= 0.0) {
      cw_move_hand(&m->w, 0.0, 0.0, 0.0);
    }
    cw_tick(&m->w);
    read_both(m, &gauge, &worst);
    bool held = cw_stats(&m->w).model.range_bodies > 0;
    before = held ? before : fmax(before, worst.world.way);
    closed = closed || (held && worst.loop.way <= CLOSED);
    open_ticks += held && !closed;
  }
  printf("# ODE left it open by %.3g mm, the loop for %d ticks, %.3g mm at the touch\n",
         1e3 * before, open_ticks, 1e3 * worst.loop.way);
  CHECK(cw_norm(m->w.force) > 0.0);
  CHECK(before > CLOSED);
  CHECK(open_ticks <= STEP_TICKS);
  CHECK(worst.loop.way <= CLOSED);
}

/* ---- scenes ---- */

static bool run_scene(const char *name, hap_model model, double physics_hz, accuracy_motion *out)
{
  static char hands[SCENE_POINTERS_MAX][ACCURACY_SPEC_MAX];
  bench b;
  accuracy_run_def def;
  scene_parameters parameters;
  size_t i = 0;
  memset(&b, 0, sizeof b);
  while (strcmp(scene_table_at(i)->name, name) != 0) {
    ++i;
  }
  parameters = *scene_table_at(i);
  accuracy_run_def_init(&def);
  def.parameters = &parameters;
  def.seconds = parameters.duration;
  def.session.model = model;
  def.session.physics_hz = physics_hz;
  for (int h = 0; h < parameters.pointers; ++h) {
    def.hands[h] = hands[h];
    if (!accuracy_hand(parameters.hands[h], 1.0, hands[h], sizeof hands[h])) {
      return false;
    }
  }
  bool good = accuracy_run(&b, &def, out) >= HAP_OK;
  if (!good) {
    printf("# %s\n", b.detail.text);
  }
  return good;
}

static void check_scene(const char *name, size_t joints, double physics_hz)
{
  accuracy_motion m;
  REQUIRE(run_scene(name, HAP_MODEL_CONTACT, physics_hz, &m));
  printf(
      "# %s at %g Hz: open by %.3g mm in the loop, %.3g mm in the world, left %.3g mm; %.3g mrad\n",
      name, physics_hz, 1e3 * m.joints_loop.way, 1e3 * m.joints_world.way, 1e3 * m.joints_left.way,
      1e3 * m.joints_loop.turn);
  CHECK(m.joints == joints);
  CHECK(m.joints_loop.way > 0.0 && m.joints_loop.way <= CLOSED);
  CHECK(m.joints_world.way <= CLOSED);
  CHECK(m.joints_loop.turn <= ALIGNED && m.joints_world.turn <= ALIGNED);
  accuracy_motion_free(&m);
}

TEST(scenes_stay_closed)
{
  static const struct {
    const char *name;
    size_t joints;
  } scenes[] = {{"door", 1},  {"pendulum", 1}, {"hinged", 1},     {"cart", 2},
                {"chain", 6}, {"lever", 1},    {"lightstand", 3}, {"telescope", 3}};
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    check_scene(scenes[i].name, scenes[i].joints, 20.0);
    check_scene(scenes[i].name, scenes[i].joints, 60.0);
  }
}

/* What only the steps of physics hold opens, and is seen. */
TEST(other_models_open)
{
  accuracy_motion m;
  REQUIRE(run_scene("pendulum", HAP_MODEL_ACCELERANCE, 20.0, &m));
  CHECK(m.joints_loop.way > CLOSED && m.joints_world.way > CLOSED);
  accuracy_motion_free(&m);
  REQUIRE(run_scene("cart", HAP_MODEL_CONTACT, 20.0, &m));
  CHECK(m.joints_left.way <= CLOSED); /* the cart rolls out of the hand's reach: still the loop's */
  accuracy_motion_free(&m);
  REQUIRE(run_scene("slide", HAP_MODEL_CONTACT, 20.0, &m));
  CHECK(m.joints == 0 && m.joints_loop.way == 0.0 && m.joints_left.way == 0.0);
  accuracy_motion_free(&m);
}
