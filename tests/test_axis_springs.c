/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Springs, dampers and rotors on the axes of joints, held against the equation of motion. A pointer
 * hangs over the axis without touching, so that the loop has the bodies. */

#include "tests/tap.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <hapode/hapode.h>

#define MASS 0.5
#define INERTIA 2e-3 /* kg m^2, of each body about z */

typedef struct rig {
  hap_scene *scene;
  hap_session *session;
  hap_pointer_id pointer;
  hap_pointer_def hand;
  double time_scale;
  double late_s; /* by which poses are drawn late */
} rig;

static void rig_open(rig *r, double gravity)
{
  hap_scene_def def;
  memset(r, 0, sizeof *r);
  r->time_scale = 1.0;
  hap_scene_def_init(&def, sizeof def);
  def.gravity[2] = -gravity;
  REQUIRE(hap_scene_create(&def, &r->scene, NULL) == HAP_OK);
}

/* A box of 0.1 m, whose frame may turn before it is added. */
static uint32_t box_add(const rig *r, double angle, double height)
{
  hap_geom_def geom;
  hap_body_def def;
  uint32_t body = 0;
  hap_geom_def_init(&geom, sizeof geom);
  hap_body_def_init(&def, sizeof def);
  geom.shape = HAP_SHAPE_BOX;
  geom.edges[2] = height;
  def.geoms = &geom;
  def.geom_count = 1;
  def.has_inertia = 1;
  def.mass = MASS;
  def.inertia[0][0] = def.inertia[1][1] = def.inertia[2][2] = INERTIA;
  def.pose.quat_wxyz[0] = cos(0.5 * angle);
  def.pose.quat_wxyz[3] = sin(0.5 * angle);
  REQUIRE(hap_scene_add_body(r->scene, &def, &body, NULL, NULL) == HAP_OK);
  return body;
}

/* device: NULL: no pointer, the world has the bodies. */
static void rig_start(rig *r, hap_model model, double physics_hz, const char *device)
{
  hap_session_def def;
  hap_detail why = {""};
  hap_session_def_init(&def, sizeof def);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = physics_hz;
  r->late_s = 1.0 / physics_hz;
  def.model = model;
  REQUIRE_SAY(hap_scene_session(r->scene, &def, &r->session, &why) == HAP_OK, "%s", why.text);
  if (device != NULL) {
    hap_pointer_def_init(&r->hand, sizeof r->hand);
    r->hand.radius = 0.01;
    REQUIRE_SAY(hap_device_open(device, &r->hand.device, &why) == HAP_OK, "%s", why.text);
    REQUIRE(hap_pointer_add(r->session, &r->hand, &r->pointer) == HAP_OK);
  }
  REQUIRE(hap_session_set_time_scale(r->session, r->time_scale) == HAP_OK);
  REQUIRE(hap_session_start(r->session) >= HAP_OK);
}

static void rig_close(rig *r)
{
  hap_session_destroy(r->session);
  hap_device_close(r->hand.device);
  CHECK(hap_scene_destroy(r->scene) == HAP_OK);
}

static hap_pose pose_now(const rig *r, uint32_t body)
{
  hap_pose pose;
  memset(&pose, 0, sizeof pose);
  CHECK(hap_scene_poses(r->scene, hap_session_now(r->session), body, 1, &pose) == HAP_OK);
  return pose;
}

/* About z. */
static double turn_now(const rig *r, uint32_t body)
{
  hap_pose pose = pose_now(r, body);
  return 2.0 * atan2(pose.quat_wxyz[3], pose.quat_wxyz[0]);
}

/* ---- free motion ---- */

typedef struct axis_case {
  const char *name;
  double stiffness;
  double rest;
  double damping;
  double inertia;
  double speed; /* rad/s or m/s, at the start */
} axis_case;

static const axis_case axis_cases[] = {
    {"a_spring_alone", 0.3, 0.0, 0.0, 0.0, 3.0},
    {"a_spring_with_a_place_of_rest", 0.3, 0.4, 0.0, 0.0, 0.0},
    {"a_damper_alone", 0.0, 0.0, 4e-3, 0.0, 3.0},
    {"a_spring_and_a_damper", 0.3, 0.1, 4e-3, 0.0, 2.0},
    {"a_rotor_with_a_spring", 0.3, 0.0, 2e-3, 3e-3, 2.0},
    {"much_damping", 0.3, 0.5, 0.1, 0.0, 0.0},
    {"a_stiff_spring", 20.0, 0.0, 0.0, 0.0, 8.0},
};

/* (mass + inertia) q'' = -k (q - rest) - d q', by small steps of Runge and Kutta. */
static double motion_of(const axis_case *c, double mass, double seconds)
{
  const int steps = 2000;
  const double h = seconds / steps;
  double q = 0.0;
  double v = c->speed;
  for (int i = 0; i < steps; ++i) {
    double kq[4];
    double kv[4];
    for (int k = 0; k < 4; ++k) {
      const double part = k == 0 ? 0.0 : k == 3 ? h : 0.5 * h;
      const double at = q + (k == 0 ? 0.0 : part * kq[k - 1]);
      kq[k] = v + (k == 0 ? 0.0 : part * kv[k - 1]);
      kv[k] = -(c->stiffness * (at - c->rest) + c->damping * kq[k]) / (mass + c->inertia);
    }
    q += h / 6.0 * (kq[0] + 2.0 * kq[1] + 2.0 * kq[2] + kq[3]);
    v += h / 6.0 * (kv[0] + 2.0 * kv[1] + 2.0 * kv[2] + kv[3]);
  }
  return q;
}

static void joint_add(const rig *r, hap_joint_kind kind, uint32_t a, uint32_t b, const axis_case *c)
{
  hap_joint_def def;
  hap_detail why = {""};
  hap_joint_def_init(&def, sizeof def);
  def.kind = kind;
  def.body_a = a;
  def.body_b = b;
  def.stiffness[0] = c->stiffness;
  def.rest[0] = c->rest;
  def.damping[0] = c->damping;
  def.inertia[0] = c->inertia;
  REQUIRE_SAY(hap_scene_add_joint(r->scene, &def, NULL, &why) == HAP_OK, "%s", why.text);
}

/* The largest difference over a second, of the largest way. What nobody touches is drawn a period
 * late. */
static double error_of(const rig *r, const axis_case *c, bool two, double mass, bool slides)
{
  double worst = 0.0;
  double largest = 0.0;
  REQUIRE(hap_session_advance(r->session, 40) == HAP_OK);
  for (int ms = 60; ms <= 1000; ms += 20) {
    REQUIRE(hap_session_advance(r->session, 20) == HAP_OK);
    double is = slides ? pose_now(r, 0).position[2] : turn_now(r, 0) - (two ? turn_now(r, 1) : 0.0);
    double right = motion_of(c, mass, fmax(1e-3 * ms - r->late_s, 0.0));
    worst = fmax(worst, fabs(is - right));
    largest = fmax(largest, fabs(right));
  }
  return worst / largest;
}

static void motion_check(const axis_case *c, bool two, hap_model model, double hz)
{
  rig r;
  rig_open(&r, 0.0);
  uint32_t a = box_add(&r, 0.0, 0.1);
  uint32_t b = two ? box_add(&r, 0.0, 0.08) : HAP_SCENE_WORLD;
  joint_add(&r, HAP_JOINT_HINGE, a, b, c);
  const double share = two ? 0.5 : 1.0;
  hap_twist twist = {{0.0}, {0.0, 0.0, share * c->speed}};
  CHECK(hap_scene_set_twist(r.scene, a, &twist) == HAP_OK);
  twist.angular[2] = (share - 1.0) * c->speed;
  CHECK(!two || hap_scene_set_twist(r.scene, b, &twist) == HAP_OK);
  rig_start(&r, model, hz, "virtual:path=0:0/0/0.065");
  double error = error_of(&r, c, two, two ? 0.5 * INERTIA : INERTIA, false);
  /* 22 swings: a period that is off by (w T)^2 / 24 */
  double allowed = c->stiffness > 1.0 ? 0.12 : 0.006;
  printf("# %s, two %d, model %d, %g Hz: %.4f\n", c->name, two, (int)model, hz, error);
  CHECK_SAY(error < allowed, "%s, two %d, model %d, %g Hz: %.4f", c->name, two, (int)model, hz,
            error);
  rig_close(&r);
}

TEST(a_hinge_on_the_world_moves_as_its_equation_says)
{
  for (size_t i = 0; i < sizeof axis_cases / sizeof axis_cases[0]; ++i) {
    motion_check(&axis_cases[i], false, HAP_MODEL_CONTACT, 20.0);
    motion_check(&axis_cases[i], false, HAP_MODEL_CONTACT, 60.0);
    motion_check(&axis_cases[i], false, HAP_MODEL_SINGLE, 60.0);
  }
}

/* Both turn, so that a rotor is no inertia of either. */
TEST(a_hinge_between_two_bodies_does_the_same)
{
  for (size_t i = 0; i < sizeof axis_cases / sizeof axis_cases[0]; ++i) {
    motion_check(&axis_cases[i], true, HAP_MODEL_CONTACT, 20.0);
    motion_check(&axis_cases[i], true, HAP_MODEL_CONTACT, 60.0);
    motion_check(&axis_cases[i], true, HAP_MODEL_SINGLE, 60.0);
  }
}

/* Far from hands the world has the motion, in coarse steps: 120 Hz, soft springs. */
TEST(the_world_has_the_same_motion_in_its_own_steps)
{
  for (size_t i = 0; i + 1 < sizeof axis_cases / sizeof axis_cases[0]; ++i) {
    const axis_case *c = &axis_cases[i];
    rig r;
    rig_open(&r, 0.0);
    joint_add(&r, HAP_JOINT_HINGE, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, c);
    hap_twist twist = {{0.0}, {0.0, 0.0, c->speed}};
    CHECK(hap_scene_set_twist(r.scene, 0, &twist) == HAP_OK);
    rig_start(&r, HAP_MODEL_CONTACT, 120.0, NULL);
    double error = error_of(&r, c, false, INERTIA, false);
    CHECK_SAY(error < 0.05, "%s: %.4f", c->name, error);
    rig_close(&r);
  }
}

/* Two axes at right angles, small angles: each moves as if it were alone. */
TEST(the_axes_of_a_universal_joint_move_as_their_equations_say)
{
  static const axis_case cases[2] = {{"first", 0.3, 0.06, 2e-3, 1e-3, 0.0},
                                     {"second", 0.5, -0.05, 3e-3, 0.0, 0.0}};
  for (int i = 0; i < 3; ++i) {
    rig r;
    hap_joint_def def;
    double worst = 0.0;
    rig_open(&r, 0.0);
    hap_joint_def_init(&def, sizeof def);
    def.kind = HAP_JOINT_UNIVERSAL;
    def.body_a = box_add(&r, 0.0, 0.1);
    for (int k = 0; k < 2; ++k) { /* x and y */
      memset(def.axis[k], 0, sizeof def.axis[k]);
      def.axis[k][k] = 1.0;
      def.stiffness[k] = cases[k].stiffness;
      def.rest[k] = cases[k].rest;
      def.damping[k] = cases[k].damping;
      def.inertia[k] = cases[k].inertia;
    }
    REQUIRE(hap_scene_add_joint(r.scene, &def, NULL, NULL) == HAP_OK);
    rig_start(&r, i == 2 ? HAP_MODEL_SINGLE : HAP_MODEL_CONTACT, i == 0 ? 20.0 : 60.0,
              "virtual:path=0:0/0/0.07");
    REQUIRE(hap_session_advance(r.session, 60) == HAP_OK);
    for (int ms = 80; ms <= 1000; ms += 20) {
      REQUIRE(hap_session_advance(r.session, 20) == HAP_OK);
      const hap_pose pose = pose_now(&r, 0);
      for (int k = 0; k < 2; ++k) {
        double right = motion_of(&cases[k], INERTIA, 1e-3 * ms - r.late_s);
        worst = fmax(worst, fabs(2.0 * pose.quat_wxyz[1 + k] - right));
      }
    }
    CHECK_SAY(worst < 2e-3, "%d: %g rad", i, worst);
    rig_close(&r);
  }
}

TEST(a_slider_moves_as_its_equation_says)
{
  static const axis_case along = {"along", 200.0, 0.0, 2.0, 0.3, 0.5};
  for (int i = 0; i < 3; ++i) {
    rig r;
    rig_open(&r, 0.0);
    joint_add(&r, HAP_JOINT_SLIDER, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, &along);
    hap_twist twist = {{0.0, 0.0, along.speed}, {0.0}};
    CHECK(hap_scene_set_twist(r.scene, 0, &twist) == HAP_OK);
    rig_start(&r, i == 2 ? HAP_MODEL_SINGLE : HAP_MODEL_CONTACT, i == 0 ? 20.0 : 60.0,
              "virtual:path=0:0.065/0/0");
    double error = error_of(&r, &along, false, MASS, true);
    CHECK_SAY(error < 0.01, "%d: %.4f", i, error);
    rig_close(&r);
  }
}

/* Its period is far below the tick: it goes to its place and stays there. */
TEST(a_spring_that_is_too_stiff_for_a_step_comes_to_rest)
{
  static const double stiffness[] = {1e4, 1e6, 1e9};
  for (size_t i = 0; i < 6; ++i) {
    const axis_case stiff = {"stiff", stiffness[i % 3], 0.2, 0.0, 0.0, 0.0};
    rig r;
    rig_open(&r, 0.0);
    joint_add(&r, HAP_JOINT_HINGE, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, &stiff);
    rig_start(&r, HAP_MODEL_CONTACT, 60.0, i < 3 ? "virtual:path=0:0/0/0.065" : NULL);
    for (int ms = 0; ms < 500; ms += 10) {
      REQUIRE(hap_session_advance(r.session, 10) == HAP_OK);
      CHECK_SAY(fabs(turn_now(&r, 0)) < 0.5, "%zu: %g rad", i, turn_now(&r, 0));
    }
    CHECK_NEAR(turn_now(&r, 0), 0.2, 1e-3);
    rig_close(&r);
  }
}

/* ---- loads ---- */

TEST(a_weight_hangs_on_its_spring)
{
  static const axis_case hangs = {"hangs", 100.0, 0.0, 5.0, 0.0, 0.0};
  for (int i = 0; i < 2; ++i) { /* far from the hand, near to it */
    rig r;
    rig_open(&r, 9.81);
    joint_add(&r, HAP_JOINT_SLIDER, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, &hangs);
    rig_start(&r, HAP_MODEL_CONTACT, 60.0, i == 0 ? NULL : "virtual:path=0:0.065/0/0");
    REQUIRE(hap_session_advance(r.session, 2000) == HAP_OK);
    CHECK_NEAR(pose_now(&r, 0).position[2], -MASS * 9.81 / hangs.stiffness, 1e-4);
    rig_close(&r);
  }
}

/* A hand 10 mm in the face: its own spring of 1000 N/m and the axis' one in a row. */
TEST(a_hand_feels_the_spring_of_an_axis)
{
  static const axis_case pushed = {"pushed", 250.0, 0.0, 10.0, 0.2, 0.0};
  for (int i = 0; i < 3; ++i) {
    rig r;
    hap_pointer_state state;
    rig_open(&r, 0.0);
    joint_add(&r, HAP_JOINT_SLIDER, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, &pushed);
    rig_start(&r, i == 2 ? HAP_MODEL_SINGLE : HAP_MODEL_CONTACT, i == 0 ? 20.0 : 60.0,
              "virtual:path=0:0/0/0.07;0.5:0/0/0.05");
    REQUIRE(hap_session_advance(r.session, 2500) == HAP_OK);
    REQUIRE(hap_pointer_get(r.session, r.pointer, &state, sizeof state) == HAP_OK);
    CHECK_NEAR(state.wrench.force[2], 0.01 / (1.0 / 1000.0 + 1.0 / 250.0), 0.02);
    CHECK_NEAR(pose_now(&r, 0).position[2], -0.01 * 1000.0 / 1250.0, 1e-4);
    rig_close(&r);
  }
}

/* The spring pulls past a stop: the joint stays there, and leaves it when pushed. */
TEST(a_spring_rests_on_a_stop)
{
  for (int i = 0; i < 3; ++i) {
    rig r;
    hap_joint_def def;
    rig_open(&r, 0.0);
    hap_joint_def_init(&def, sizeof def);
    def.kind = HAP_JOINT_HINGE;
    def.body_a = box_add(&r, 0.0, 0.1);
    def.low[0] = -0.1;
    def.high[0] = 0.3;
    def.stiffness[0] = 0.5;
    def.rest[0] = i == 1 ? -1.0 : 1.0;
    def.damping[0] = 0.02;
    REQUIRE(hap_scene_add_joint(r.scene, &def, NULL, NULL) == HAP_OK);
    rig_start(&r, HAP_MODEL_CONTACT, 60.0, i == 2 ? "virtual:path=0:0/0/0.065" : NULL);
    for (int ms = 0; ms < 2000; ms += 10) {
      REQUIRE(hap_session_advance(r.session, 10) == HAP_OK);
      double turn = turn_now(&r, 0);
      double past = i == 2 ? 0.01 : 0.1; /* the world meets a stop a step late */
      CHECK_SAY(turn > -0.1 - past && turn < 0.3 + past, "%d: %g rad at %d ms", i, turn, ms);
    }
    CHECK_NEAR(turn_now(&r, 0), i == 1 ? -0.1 : 0.3, 5e-3);
    rig_close(&r);
  }
}

/* Friction stays beside it: a spring that is weaker than the friction does not move. */
TEST(friction_and_a_spring_stand_beside_each_other)
{
  for (int i = 0; i < 4; ++i) {
    rig r;
    hap_joint_def def;
    rig_open(&r, 0.0);
    hap_joint_def_init(&def, sizeof def);
    def.kind = HAP_JOINT_HINGE;
    def.body_a = box_add(&r, 0.0, 0.1);
    def.stiffness[0] = 0.5;
    def.rest[0] = 0.4;
    def.damping[0] = 0.08;
    def.motor_force[0] = i % 2 == 0 ? 0.25 : 0.1;
    REQUIRE(hap_scene_add_joint(r.scene, &def, NULL, NULL) == HAP_OK);
    rig_start(&r, HAP_MODEL_CONTACT, 60.0, i < 2 ? "virtual:path=0:0/0/0.065" : NULL);
    REQUIRE(hap_session_advance(r.session, 3000) == HAP_OK);
    CHECK_NEAR(turn_now(&r, 0), i % 2 == 0 ? 0.0 : 0.2, 2e-3);
    rig_close(&r);
  }
}

/* ---- the life of it ---- */

/* At half the speed of the application's time the same way takes twice as long. */
TEST(in_slow_motion_it_is_the_same_motion)
{
  const axis_case *c = &axis_cases[4];
  rig r;
  double worst = 0.0;
  rig_open(&r, 0.0);
  joint_add(&r, HAP_JOINT_HINGE, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, c);
  hap_twist twist = {{0.0}, {0.0, 0.0, c->speed}};
  CHECK(hap_scene_set_twist(r.scene, 0, &twist) == HAP_OK);
  r.time_scale = 0.5;
  rig_start(&r, HAP_MODEL_CONTACT, 60.0, "virtual:path=0:0/0/0.065");
  REQUIRE(hap_session_advance(r.session, 40) == HAP_OK);
  for (int ms = 60; ms <= 1000; ms += 20) {
    REQUIRE(hap_session_advance(r.session, 20) == HAP_OK);
    worst =
        fmax(worst, fabs(turn_now(&r, 0) - motion_of(c, INERTIA, 0.5 * (1e-3 * ms - r.late_s))));
  }
  CHECK_SAY(worst < 0.005, "%g rad", worst);
  rig_close(&r);
}

TEST(a_removed_joint_takes_its_spring_along)
{
  static const axis_case held = {"held", 500.0, 0.0, 20.0, 0.0, 0.0};
  rig r;
  rig_open(&r, 0.0);
  joint_add(&r, HAP_JOINT_SLIDER, box_add(&r, 0.0, 0.1), HAP_SCENE_WORLD, &held);
  joint_add(&r, HAP_JOINT_SLIDER, box_add(&r, 0.5, 0.1), HAP_SCENE_WORLD, &held);
  rig_start(&r, HAP_MODEL_CONTACT, 60.0, "virtual:path=0:0.08/0/0");
  REQUIRE(hap_session_advance(r.session, 100) == HAP_OK);
  CHECK(hap_scene_remove_joint(r.scene, 0) == HAP_OK);
  hap_twist twist = {{0.0, 0.0, 0.2}, {0.0}};
  CHECK(hap_scene_set_twist(r.scene, 0, &twist) == HAP_OK);
  CHECK(hap_scene_remove_body(r.scene, 1) == HAP_OK);
  REQUIRE(hap_session_advance(r.session, 500) == HAP_OK);
  CHECK_NEAR(pose_now(&r, 0).position[2], 0.1, 0.01);
  rig_close(&r);
}

TEST(what_cannot_be_is_refused)
{
  rig r;
  hap_detail why = {""};
  hap_joint_def def;
  rig_open(&r, 0.0);
  hap_joint_def_init(&def, sizeof def);
  def.body_a = box_add(&r, 0.0, 0.1);
  def.kind = HAP_JOINT_BALL;
  def.damping[0] = 1.0;
  CHECK(hap_scene_add_joint(r.scene, &def, NULL, &why) == HAP_ERROR_ARGUMENT);
  CHECK(strstr(why.text, "HINGE, SLIDER") != NULL);
  def.kind = HAP_JOINT_HINGE;
  const double wrong[] = {-1.0, NAN, INFINITY, 1e10};
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    def.damping[0] = wrong[i];
    CHECK(hap_scene_add_joint(r.scene, &def, NULL, &why) == HAP_ERROR_ARGUMENT);
    CHECK(strstr(why.text, "damping") != NULL);
  }
  CHECK(hap_scene_destroy(r.scene) == HAP_OK);
}
