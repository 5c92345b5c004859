/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Pointers that are hulls drag, turn and hold bodies by friction: against the world stepped at
 * the haptic rate, against momentum, and for how long. */

#include "tests/tap.h"

#include "base/vec.h"
#include "tests/owned_rig.h"
#include "tests/tool_world.h"
#include "tests/unknown_shape.h"

#define HALF 0.01 /* m, of the tool */
#define EDGE 0.06 /* m, of the body */
#define STIFF 2000.0

/* ---- a block on the floor ---- */

static double floor_mu;

static bool floor_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode = dContactApprox1;
  io->mu = floor_mu;
  return true;
}

#define FRAMES 700

typedef struct motion {
  double force[FRAMES][3];
  double torque[FRAMES][3];
  double end[3];
  double turn; /* rad, of the body about the vertical */
} motion;

typedef struct drag {
  const char *what;
  double mu; /* of the tool */
  double floor_mu;
  double beside; /* m, of the middle */
  double turn;   /* rad, of the tool about the vertical */
  double finger; /* m */
  bool proxied;
} drag;

static void drag_block(const drag *d, hap_model model, double physics_hz, motion *out)
{
  const double top = EDGE - 1e-4;
  dMass mass;
  floor_mu = d->floor_mu;
  tool_world *w = tool_new(model);
  w->ode.surface = floor_surface;
  w->def.physics_hz = physics_hz;
  dWorldSetContactSurfaceLayer(w->world, 1e-4);
  dWorldSetQuickStepNumIterations(w->world, model == HAP_MODEL_SINGLE ? 1000 : 50);
  w->tool_def.stiffness = STIFF;
  w->tool_def.damping = 5.0;
  w->tool_def.friction = d->mu;
  w->tool_def.finger_radius = d->finger;
  if (d->proxied && model == HAP_MODEL_CONTACT) {
    w->tool_expert.coupling = HAP_COUPLING_PROXY;
    w->tool_expert.coupling_stiffness = 1e6;
  }
  tool_add_floor(w);
  dBodyID body = dBodyCreate(w->world);
  dGeomSetBody(dCreateBox(w->space, EDGE, EDGE, EDGE), body);
  dMassSetBoxTotal(&mass, 0.3, EDGE, EDGE, EDGE);
  dBodySetMass(body, &mass);
  dBodySetPosition(body, 0.0, 0.0, EDGE / 2 - 1e-4);
  tool_start(w);
  tool_go(w, 0.0, d->beside, top + HALF + 0.003, 0.0);
  tool_run(w, 60);
  tool_move(w, 0.0, d->beside, top + HALF - 0.002, 0.0, 100);
  for (int i = 0; i < FRAMES; ++i) {
    double s = fmin((double)i / (FRAMES - 100), 1.0);
    double rate = s < 1.0 ? 6.0 * s * (1.0 - s) / ((FRAMES - 100) * 1e-3) : 0.0;
    double share = s * s * (3.0 - 2.0 * s);
    double angle = d->turn * share;
    w->pose = (hap_pose){{0.02 * share, d->beside, top + HALF - 0.002},
                         {cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)}};
    hapi_v3_set(w->twist.linear, 0.02 * rate, 0.0, 0.0);
    hapi_v3_set(w->twist.angular, 0.0, 0.0, d->turn * rate);
    tool_step(w);
    hapi_v3_copy(w->state.wrench.force, out->force[i]);
    hapi_v3_copy(w->state.wrench.torque, out->torque[i]);
  }
  CHECK(hap_session_stop(w->session) == HAP_OK);
  hapi_v3_copy(dBodyGetPosition(body), out->end);
  const dReal *q = dBodyGetQuaternion(body);
  out->turn = 2.0 * atan2(q[3], q[0]);
  tool_end(w);
}

/* RMS of the difference over RMS. */
static double error_of(double (*test)[3], double (*reference)[3], int count)
{
  double sums[2] = {0.0, 0.0};
  for (int i = 0; i < count; ++i) {
    double apart[3];
    hapi_v3_sub(test[i], reference[i], apart);
    sums[0] += hapi_v3_dot(apart, apart);
    sums[1] += hapi_v3_dot(reference[i], reference[i]);
  }
  return sqrt(sums[0] / sums[1]);
}

TEST(a_block_is_dragged_as_if_the_world_were_stepped_at_the_haptic_rate)
{
  static const drag drags[] = {
      {"sticks, slides on the floor", 0.9, 0.2, 0.0, 0.0, 0.0, false},
      {"slides on the block", 0.3, 0.9, 0.0, 0.0, 0.0, false},
      {"beside the middle", 0.9, 0.2, 0.015, 0.0, 0.0, false},
      {"turns it", 0.9, 0.1, 0.0, 0.6, 0.0, false},
      {"turns it, soft", 0.9, 0.1, 0.0, 0.6, 0.008, false},
      {"slides and turns on it", 0.3, 0.9, 0.0, 0.6, 0.0, false},
      {"through a proxy", 0.9, 0.2, 0.0, 0.0, 0.0, true},
      {"turns it through a proxy, soft", 0.9, 0.1, 0.0, 0.6, 0.008, true},
  };
  static motion reference;
  static motion test;
  for (size_t i = 0; i < sizeof drags / sizeof drags[0]; ++i) {
    for (int k = 0; k < 2; ++k) {
      double hz = k == 0 ? 20.0 : 60.0;
      drag_block(&drags[i], HAP_MODEL_SINGLE, hz, &reference);
      drag_block(&drags[i], HAP_MODEL_CONTACT, hz, &test);
      double force = error_of(test.force, reference.force, FRAMES);
      double torque = error_of(test.torque, reference.torque, FRAMES);
      double apart[3];
      hapi_v3_sub(test.end, reference.end, apart);
      printf(
          "# %s, %g Hz: force %.3f %%, torque %.3f %%, %.3f mm, %.2g rad; it went %.2f mm and "
          "%.3f rad\n",
          drags[i].what, hz, 100.0 * force, 100.0 * torque, 1e3 * hapi_v3_norm(apart),
          test.turn - reference.turn, 1e3 * test.end[0], test.turn);
      CHECK(force < 0.02);
      CHECK(torque < 0.03);
      CHECK(hapi_v3_norm(apart) < 5e-4);
      CHECK(fabs(test.turn - reference.turn) < 0.01);
      CHECK((drags[i].mu > drags[i].floor_mu) == (test.end[0] > 0.01)); /* what slides stays */
    }
  }
}

/* Model accelerance knows by a testing simulation of its own what a torque of soft fingers does
 * to a body: a block on ice turns with the tool. */
TEST(accelerance_turns_a_block_by_soft_fingers)
{
  static const drag how = {"", 0.9, 0.0, 0.0, 0.6, 0.03, false};
  static motion reference;
  static motion test;
  drag_block(&how, HAP_MODEL_SINGLE, 60.0, &reference);
  drag_block(&how, HAP_MODEL_ACCELERANCE, 60.0, &test);
  double torque = error_of(test.torque, reference.torque, FRAMES);
  printf("# torque %.3f %%, it turned by %.4f and %.4f rad\n", 100.0 * torque, test.turn,
         reference.turn);
  CHECK(torque < 0.2);
}

/* Lockstep has the same bits each time, also with what is found by the contact thread. */
TEST(lockstep_repeats)
{
  static const drag how = {"", 0.6, 0.3, 0.008, 0.5, 0.005, true};
  static motion first;
  static motion second;
  for (int m = 0; m < 4; ++m) {
    memset(&first, 0, sizeof first);
    memset(&second, 0, sizeof second);
    drag_block(&how, all_models[m], 60.0, &first);
    drag_block(&how, all_models[m], 60.0, &second);
    CHECK(memcmp(&first, &second, sizeof first) == 0);
    CHECK(hapi_v3_norm(first.force[FRAMES / 2]) > 1.0);
  }
}

/* ---- what one gives the other gets ---- */

/* Into the face at x = -EDGE / 2 beside its middle, along it, and turning; N s and N m s about
 * the origin of what the tool gave. */
static void press_and_turn(tool_world *w, double impulse[3], double turn[3])
{
  tool_go(w, -EDGE / 2 - HALF - 0.002, 0.004, 0.012, 0.0);
  tool_run(w, 60);
  for (int i = 0; i < 80; ++i) {
    double way = fmin(i, 40);
    w->pose.position[0] = -EDGE / 2 - HALF - 0.002 + 1.5e-4 * way;
    w->pose.position[1] = 0.004 + 1e-4 * way;
    w->pose.position[2] = 0.012;
    double angle = 2e-3 * way;
    w->pose.quat_wxyz[0] = cos(0.5 * angle);
    w->pose.quat_wxyz[1] = sin(0.5 * angle);
    tool_step(w);
    const hap_wrench *f = &w->state.wrench;
    double moment[3];
    hapi_v3_madd(impulse, -1e-3, f->force, impulse);
    hapi_v3_cross(w->state.proxy.position, f->force, moment);
    hapi_v3_add(moment, f->torque, moment);
    hapi_v3_madd(turn, -1e-3, moment, turn);
  }
}

/* A free body, pressed by the tool beside its middle, dragged along and turned, then let go. The
 * last one is measured by testing simulations. */
TEST(momentum_and_spin_go_to_a_free_body)
{
  static const hap_model all[] = {HAP_MODEL_SINGLE, HAP_MODEL_IMPULSE, HAP_MODEL_ACCELERANCE,
                                  HAP_MODEL_CONTACT, HAP_MODEL_CONTACT};
  for (int m = 0; m < 5; ++m) {
    hap_stats stats;
    dMass mass;
    double impulse[3] = {0.0, 0.0, 0.0};
    double turn[3] = {0.0, 0.0, 0.0};
    tool_world *w = tool_new(all[m]);
    dWorldSetGravity(w->world, 0.0, 0.0, 0.0);
    w->tool_def.friction = 0.8;
    w->tool_def.finger_radius = 0.005;
    dBodyID body = dBodyCreate(w->world);
    dGeomSetBody(dCreateBox(w->space, EDGE, EDGE, EDGE), body);
    dMassSetBoxTotal(&mass, 2.0, EDGE, EDGE, EDGE);
    dBodySetMass(body, &mass);
    if (m == 4) {
      add_unknown_shape(w->space, body);
    }
    tool_start(w);
    press_and_turn(w, impulse, turn);
    CHECK(hap_session_stats(w->session, &stats, sizeof stats) == HAP_OK);
    CHECK(m < 4 || stats.model.measured_bodies == 1);
    tool_go(w, -0.2, 0.0, 0.0, 0.0);
    tool_run(w, 60);
    CHECK(hap_session_stop(w->session) == HAP_OK);
    double about[3]; /* the origin */
    hapi_v3_cross(dBodyGetPosition(body), dBodyGetLinearVel(body), about);
    for (int k = 0; k < 3; ++k) {
      double got = 2.0 * dBodyGetLinearVel(body)[k];
      double spun = mass.I[0] * dBodyGetAngularVel(body)[k] + 2.0 * about[k];
      printf("# model %d, %c: %.5f of %.5f N s, %.6f of %.6f N m s\n", (int)all[m], "xyz"[k], got,
             impulse[k], spun, turn[k]);
      CHECK_NEAR(got, impulse[k], 1e-3 * hapi_v3_norm(impulse));
      /* In impulse the loop has the body where the world had it a step ago. */
      double share = all[m] == HAP_MODEL_IMPULSE ? 0.03 : m == 4 ? 0.02 : 0.001;
      CHECK_NEAR(spun, turn[k], share * hapi_v3_norm(turn));
    }
    CHECK(impulse[1] > 0.01 && fabs(turn[0]) > 1e-4);
    tool_end(w);
  }
}

/* ---- scenes ---- */

static scene_parameters parameters_of(const char *name)
{
  size_t i = 0;
  while (strcmp(scene_table_at(i)->name, name) != 0) {
    ++i;
  }
  return *scene_table_at(i);
}

static rig *open_scene(const scene_parameters *parameters, hap_model model, double physics_hz)
{
  rig_options options;
  rig_options_init(&options);
  options.parameters = parameters;
  options.def.drive = HAP_DRIVE_LOCKSTEP;
  options.def.model = model;
  options.def.physics_hz = physics_hz;
  options.research.guard = HAP_GUARD_MEASURE;
  options.expert.trace_rows = 4;
  options.coupling = HAP_COUPLING_DIRECT;
  rig *r = rig_own(&options);
  REQUIRE(hap_session_start(r->session) >= HAP_OK);
  return r;
}

static void next_row(const rig *r, hap_trace_row *out)
{
  size_t count = 0;
  CHECK(hap_session_advance(r->session, 1) == HAP_OK);
  CHECK(hap_session_trace_read(r->session, out, 1, sizeof(hap_trace_row), &count) == HAP_OK &&
        count == 1);
}

#define SCENE_TICKS 2400

typedef struct felt {
  double force[SCENE_TICKS][3];
  double torque[SCENE_TICKS][3];
} felt;

static void feel_scene(const scene_parameters *parameters, hap_model model, double hz, felt *out)
{
  hap_trace_row row;
  scene_parameters own = *parameters;
  own.iterations = model == HAP_MODEL_SINGLE ? 1000 : own.iterations;
  rig *r = open_scene(&own, model, hz);
  for (int i = 0; i < SCENE_TICKS; ++i) {
    next_row(r, &row);
    hapi_v3_copy(row.pointers[0].force, out->force[i]);
    hapi_v3_copy(row.pointers[0].torque, out->torque[i]);
  }
  tap_release(r);
}

TEST(lever_and_peg_with_friction_feel_as_the_reference)
{
  static const char *const names[] = {"lever", "peg"};
  static felt reference;
  static felt bare;
  static felt test;
  for (int i = 0; i < 2; ++i) {
    scene_parameters parameters = parameters_of(names[i]);
    feel_scene(&parameters, HAP_MODEL_CONTACT, 60.0, &bare);
    parameters.friction = 0.5;
    parameters.finger_radius = i == 0 ? 0.0 : 0.003;
    feel_scene(&parameters, HAP_MODEL_SINGLE, 60.0, &reference);
    feel_scene(&parameters, HAP_MODEL_CONTACT, 60.0, &test);
    double force = error_of(test.force, reference.force, SCENE_TICKS);
    double torque = error_of(test.torque, reference.torque, SCENE_TICKS);
    double without = error_of(bare.force, reference.force, SCENE_TICKS);
    printf("# %s: force %.3f %%, torque %.3f %%; without friction it is %.1f %% less or more\n",
           names[i], 100.0 * force, 100.0 * torque, 100.0 * without);
    CHECK(force < 0.02);
    CHECK(torque < 0.03);
    CHECK(without > 5.0 * force);
  }
}

/* ---- held ---- */

typedef struct hold {
  hap_model model;
  double physics_hz;
  double grip;   /* of what is needed */
  double beside; /* m, of the box's middle */
  const char *device;
} hold;

typedef struct held {
  double lost;   /* m, by which the box came down while it was held */
  double turned; /* rad, about the line between the fingers, likewise */
  double last;   /* m, its height at the end */
} held;

/* Scene grasp with fingers that are cubes, from 2 s on for that long. */
static held hold_box(const hold *h, double seconds)
{
  held out = {HUGE_VAL, HUGE_VAL, 0.0};
  scene_parameters p = parameters_of("grasp");
  char hands[2][256];
  double depth = h->grip * p.mass * p.gravity / (2.0 * 0.5) / p.stiffness;
  hap_trace_row row = {0};
  p.friction = 0.5;
  p.finger_radius = 0.0;
  p.radius = 0.001;
  p.tool[0] = p.tool[1] = p.tool[2] = 0.02 - 2.0 * p.radius;
  for (int i = 0; i < 2; ++i) {
    double side = i == 0 ? -1.0 : 1.0;
    double open = side * (p.size / 2 + HALF + 0.001);
    double close = side * (p.size / 2 + HALF - depth);
    snprintf(hands[i], sizeof hands[i],
             "virtual:dof=6,%spath=0:%g/%g/0.03;0.3:%.9g/%g/0.03;1.2:%.9g/%g/0.08,blend=smooth,"
             "hand=rigid",
             h->device, open, h->beside, close, h->beside, close, h->beside);
    p.hands[i] = hands[i];
  }
  rig *r = open_scene(&p, h->model, h->physics_hz);
  for (int i = 0; i < (int)(1000.0 * (2.0 + seconds)); ++i) {
    next_row(r, &row);
    if (i == 2000) {
      out.lost = row.body_position[0][2];
      out.turned = 2.0 * dBodyGetQuaternion(r->scene->bodies[0])[1];
    }
  }
  out.last = row.body_position[0][2];
  out.lost -= out.last;
  out.turned = 2.0 * dBodyGetQuaternion(r->scene->bodies[0])[1] - out.turned;
  tap_release(r);
  return out;
}

TEST(a_box_that_flat_fingers_hold_does_not_creep)
{
  static const hold all[] = {
      {HAP_MODEL_CONTACT, 60.0, 1.5, 0.0, ""},
      {HAP_MODEL_CONTACT, 20.0, 1.5, 0.0, "quantum=3e-5,delay=0.001,"},
      {HAP_MODEL_CONTACT, 60.0, 2.5, 0.006, ""}, /* a ball would let it swing */
      {HAP_MODEL_CONTACT, 60.0, 2.5, 0.006, "quantum=3e-5,"},
      {HAP_MODEL_SINGLE, 60.0, 2.5, 0.006, ""},
      {HAP_MODEL_ACCELERANCE, 60.0, 1.5, 0.0, ""},
  };
  for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
    held h = hold_box(&all[i], 10.0);
    printf("# %s, %g Hz, %g mm beside: came down %.3f um, turned %.2g rad, z %.4f\n",
           hap_model_name(all[i].model), all[i].physics_hz, 1e3 * all[i].beside, 1e6 * h.lost,
           h.turned, h.last);
    CHECK(fabs(h.lost) <= 1e-4);
    CHECK(fabs(h.turned) <= 0.01);
    CHECK(h.last > 0.07);
  }
}

TEST(with_less_grip_than_it_needs_the_box_slides)
{
  static const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE};
  for (int i = 0; i < 3; ++i) {
    const hold weak = {models[i], 60.0, 0.9, 0.0, ""};
    held h = hold_box(&weak, 0.5);
    printf("# %s: z %.4f\n", hap_model_name(models[i]), h.last);
    CHECK(h.last < 0.5 * EDGE + 1e-3); /* it is on the floor */
  }
}
