/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Friction of pointers that are hulls, against things that do not move: closed forms of
 * sticking, sliding and turning, what comes and goes while it sticks, energy. */

#include "tests/tap.h"

#include "base/vec.h"
#include "tests/tool_world.h"

#define HALF 0.01 /* m, of the tool */
#define K 1000.0
#define MU 0.5
#define DEEP 0.002 /* m */
#define LOAD (K * DEEP)

typedef struct ground {
  hap_model model;
  bool box; /* a static box instead of the floor */
  bool proxied;
  double finger; /* m */
} ground;

static const ground grounds[] = {
    {HAP_MODEL_SINGLE, false, false, 0.0},     {HAP_MODEL_IMPULSE, false, false, 0.0},
    {HAP_MODEL_ACCELERANCE, true, false, 0.0}, {HAP_MODEL_CONTACT, false, false, 0.0},
    {HAP_MODEL_CONTACT, true, false, 0.0},     {HAP_MODEL_CONTACT, true, false, 0.006},
    {HAP_MODEL_CONTACT, true, true, 0.0},      {HAP_MODEL_SINGLE, true, false, 0.006},
};
#define GROUNDS (sizeof grounds / sizeof grounds[0])

/* Turned by an angle about the vertical. */
static void tool_stand(tool_world *w, double x, double y, double z, double angle)
{
  w->pose = (hap_pose){{x, y, z}, {cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)}};
  memset(&w->twist, 0, sizeof w->twist);
}

/* From above what is at z = 0 into it. */
static void tool_start_pressed(tool_world *w)
{
  tool_start(w);
  tool_go(w, 0.0, 0.0, HALF + 0.004, 0.0);
  tool_run(w, 40);
  tool_move(w, 0.0, 0.0, HALF - DEEP, 0.0, 60);
}

/* With its face flat on the ground, pressed into it. */
static tool_world *tool_press(const ground *g)
{
  tool_world *w = tool_new(g->model);
  w->tool_def.friction = MU;
  w->tool_def.finger_radius = g->finger;
  if (g->proxied) {
    w->tool_expert.coupling = HAP_COUPLING_PROXY;
    w->tool_expert.coupling_stiffness = 1e6;
  }
  if (g->box) {
    dGeomSetPosition(dCreateBox(w->space, 0.3, 0.3, 0.1), 0.0, 0.0, -0.05);
  } else {
    tool_add_floor(w);
  }
  tool_start_pressed(w);
  tool_run(w, 40);
  return w;
}

/* N/m, of the contact, and behind a proxy of both springs. */
static double tool_felt(const ground *g)
{
  return g->proxied ? K / (1.0 + K / 1e6) : K;
}

static double slip_of(const tool_world *w)
{
  return hypot(w->state.wrench.force[0], w->state.wrench.force[1]);
}

/* The face has the stiffness of the contact in its plane too, whatever number of points it has. */
TEST(a_face_sticks_as_a_spring)
{
  for (size_t i = 0; i < GROUNDS; ++i) {
    tool_world *w = tool_press(&grounds[i]);
    REQUIRE(w != NULL);
    double k = tool_felt(&grounds[i]);
    CHECK_NEAR(w->state.wrench.force[2], k * DEEP, 1e-3 * LOAD);
    CHECK(slip_of(w) < 1e-6);
    CHECK(w->state.contacts == 4);
    tool_stand(w, 4e-4, -3e-4, HALF - DEEP, 0.0);
    tool_run(w, 300);
    CHECK_NEAR(w->state.wrench.force[0], -k * 4e-4, 1e-3 * k * 4e-4);
    CHECK_NEAR(w->state.wrench.force[1], k * 3e-4, 1e-3 * k * 3e-4);
    double arm = -(HALF - 0.5 * DEEP); /* half-way between the surfaces */
    CHECK_NEAR(w->state.wrench.torque[1], arm * -k * 4e-4, 2e-3 * HALF * k * 4e-4);
    CHECK_NEAR(w->state.wrench.torque[0], -arm * k * 3e-4, 2e-3 * HALF * k * 3e-4);
    tool_end(w);
  }
}

TEST(a_face_slides_as_coulomb_says)
{
  for (size_t i = 0; i < GROUNDS; ++i) {
    tool_world *w = tool_press(&grounds[i]);
    REQUIRE(w != NULL);
    for (int j = 0; j < 8; ++j) {
      double angle = 2.0 * M_PI * (j + 0.3) / 8.0;
      tool_move(w, 0.01 * cos(angle), 0.01 * sin(angle), HALF - DEEP, 0.0, 200);
      double limit = MU * w->state.wrench.force[2];
      CHECK_NEAR(w->state.wrench.force[2], tool_felt(&grounds[i]) * DEEP, 1e-3 * LOAD);
      CHECK_NEAR(slip_of(w), limit, 1e-3 * limit);
      tool_move(w, 0.0, 0.0, HALF - DEEP, 0.0, 200);
      CHECK_NEAR(w->state.wrench.force[0], limit * cos(angle), 2e-3 * limit);
      CHECK_NEAR(w->state.wrench.force[1], limit * sin(angle), 2e-3 * limit);
    }
    tool_end(w);
  }
}

/* All points are at r from the middle: k r^2 phi, and mu N r; with soft fingers of radius a at
 * each, one limit for both: r^2 + a^2 for r^2. A stretch that is dragged round points along the
 * way of its end that is left behind: that takes the cosine of its angle as seen from the
 * middle. */
TEST(a_face_holds_against_turning)
{
  for (size_t i = 0; i < GROUNDS; ++i) {
    double a = grounds[i].finger;
    double radius = sqrt(2.0 * HALF * HALF + a * a);
    tool_world *w = tool_press(&grounds[i]);
    REQUIRE(w != NULL);
    double k = tool_felt(&grounds[i]) * radius * radius;
    for (int j = 1; j <= 5; ++j) {
      tool_stand(w, 0.0, 0.0, HALF - DEEP, 0.01 * j);
      tool_run(w, 20);
      CHECK_NEAR(w->state.wrench.torque[2], -k * 0.01 * j, 2e-3 * k * 0.01 * j);
    }
    CHECK(slip_of(w) < 1e-6);
    for (int j = 0; j < 300; ++j) {
      tool_stand(w, 0.0, 0.0, HALF - DEEP, 0.05 + 1e-3 * j);
      w->twist.angular[2] = 1.0;
      tool_step(w);
    }
    double lag = MU * DEEP / radius;
    double arm2 = 2.0 * HALF * HALF;
    double limit = MU * LOAD / radius * (arm2 * sqrt(1.0 - lag * lag) + a * a);
    CHECK_NEAR(w->state.wrench.torque[2], -limit, 2e-3 * limit);
    tool_end(w);
  }
}

/* ---- what sticks stays ---- */

/* A hand of 0.2 kg that pushes with a force and a torque about the vertical, and rests on the
 * tool with its weight; its wrist tilts a little all the time. */
typedef struct hand {
  double at[3];
  double speed[3];
  double angle;
  double spin;
  double push[3];
  double twist;
  double tilt[2]; /* rad, about x and y */
} hand;

static void hold_tool(tool_world *w, hand *h, int tick)
{
  const double mass = 0.2;
  const double inertia = 2e-4;
  const double t = 1e-3;
  for (int k = 0; k < 3; ++k) {
    double force = h->push[k] + w->state.wrench.force[k] - 2.0 * h->speed[k];
    h->speed[k] += t * force / mass;
    h->at[k] += t * h->speed[k];
  }
  double torque = h->twist + w->state.wrench.torque[2] - 8e-3 * h->spin;
  h->spin += t * torque / inertia;
  h->angle += t * h->spin;
  double about[2] = {h->tilt[0] * sin(0.013 * tick), h->tilt[1] * sin(0.0171 * tick)};
  double turn[4] = {cos(0.5 * h->angle), 0.0, 0.0, sin(0.5 * h->angle)};
  double tilt[4] = {1.0, 0.5 * about[0], 0.5 * about[1], 0.0};
  hapi_quat_normalize(tilt);
  hapi_v3_copy(h->at, w->pose.position);
  hapi_quat_multiply(tilt, turn, w->pose.quat_wxyz);
  hapi_v3_copy(h->speed, w->twist.linear);
  hapi_v3_set(w->twist.angular, 0.0, 0.0, h->spin);
  tool_step(w);
}

/* A round tool: of its corners a patch has four, and others at each pass. */
static void make_round(tool_world *w)
{
  for (int i = 0; i < 32; ++i) {
    int corner = i / 2;
    double angle = 2.0 * M_PI * (corner + 0.25) / 16.0;
    w->hull[3 * i] = HALF * cos(angle);
    w->hull[3 * i + 1] = HALF * sin(angle);
    w->hull[3 * i + 2] = i % 2 == 0 ? -HALF : HALF;
  }
  w->tool_def.hull_points = 32;
}

typedef struct rest {
  hap_model model;
  bool round;
  bool narrow;   /* on a ground that ends below the face */
  double share;  /* of what friction holds, along */
  double twist;  /* likewise, about the vertical */
  double tilt;   /* rad */
  bool one_axis; /* about both it would walk over its corners */
  bool proxied;
} rest;

typedef struct crept {
  double way;  /* m */
  double turn; /* rad */
} crept;

/* In that time, in which it tilts; level before and after. */
static crept tool_creep(const rest *r, int ticks)
{
  crept out = {HUGE_VAL, HUGE_VAL};
  tool_world *w = tool_new(r->model);
  w->tool_def.friction = MU;
  w->tool_def.damping = 2.0;
  if (r->round) {
    make_round(w);
  }
  if (r->proxied) {
    w->tool_expert.coupling = HAP_COUPLING_PROXY;
    w->tool_expert.coupling_stiffness = 5e3;
    w->tool_expert.coupling_damping = 5.0;
  }
  double edge = r->narrow ? 0.025 : 0.2;
  dGeomSetPosition(dCreateBox(w->space, edge, edge, 0.1), r->narrow ? 0.007 : 0.0, 0.0, -0.05);
  hand h = {.at = {0.0, 0.0, HALF + 1e-3}, .push = {0.0, 0.0, -LOAD}};
  double start[3] = {0.0, 0.0, 0.0};
  double angle = 0.0;
  tool_start(w);
  for (int i = 0; i < ticks + 1500; ++i) {
    if (i == 500) {
      h.push[0] = r->share * MU * LOAD * 0.8;
      h.push[1] = r->share * MU * LOAD * 0.6;
      h.twist = r->twist * MU * LOAD * HALF * (r->round ? 1.0 : M_SQRT2);
    }
    if (i == 1000) {
      hapi_v3_copy(h.at, start);
      angle = h.angle;
    }
    h.tilt[0] = i > 1000 && i < 1000 + ticks && !r->one_axis ? r->tilt : 0.0;
    h.tilt[1] = i > 1000 && i < 1000 + ticks ? r->tilt : 0.0;
    hold_tool(w, &h, i - 1000);
  }
  out.way = hypot(h.at[0] - start[0], h.at[1] - start[1]);
  out.turn = h.angle - angle;
  tool_end(w);
  return out;
}

TEST(a_face_that_sticks_does_not_creep)
{
  static const rest rests[] = {
      {HAP_MODEL_CONTACT, false, false, 0.8, 0.0, 0.0},
      {HAP_MODEL_SINGLE, false, false, 0.8, 0.0, 0.0},
      {HAP_MODEL_ACCELERANCE, false, false, 0.8, 0.0, 0.0},
      {HAP_MODEL_IMPULSE, false, false, 0.8, 0.0, 0.0},
      {HAP_MODEL_CONTACT, false, false, 0.0, 0.7, 0.0},
      {HAP_MODEL_CONTACT, false, false, 0.4, 0.2, 0.01},
      {HAP_MODEL_CONTACT, true, false, 0.5, 0.0, 0.01},
      {HAP_MODEL_CONTACT, true, false, 0.0, 0.5, 0.01},
      {HAP_MODEL_CONTACT, true, false, 0.3, 0.2, 0.01},
      {HAP_MODEL_SINGLE, true, false, 0.3, 0.2, 0.01},
      {HAP_MODEL_CONTACT, false, true, 0.4, 0.0, 0.005},
      {HAP_MODEL_CONTACT, false, false, 0.4, 0.0, 0.04, true},
      {HAP_MODEL_CONTACT, false, false, 0.5, 0.2, 0.01, false, true},
      {HAP_MODEL_CONTACT, true, false, 0.3, 0.2, 0.01, false, true},
  };
  for (size_t i = 0; i < sizeof rests / sizeof rests[0]; ++i) {
    const rest *r = &rests[i];
    crept c = tool_creep(r, 10000);
    printf("# %s%s%s%s, %.1f and %.1f of the limit, tilt %.3f: %.3f um, %.2g rad in 10 s\n",
           hap_model_name(r->model), r->round ? ", round" : "", r->narrow ? ", at an edge" : "",
           r->proxied ? ", proxy" : "", r->share, r->twist, r->tilt, 1e6 * c.way, c.turn);
    CHECK(c.way <= 1e-4);
    CHECK(fabs(c.turn) * HALF <= 1e-4);
  }
}

/* What is held stays held when the session changes its model, whoever finds the contacts then. */
TEST(a_change_of_model_lets_nothing_go)
{
  static const hap_model next[] = {HAP_MODEL_SINGLE, HAP_MODEL_CONTACT, HAP_MODEL_ACCELERANCE,
                                   HAP_MODEL_IMPULSE, HAP_MODEL_CONTACT};
  const ground g = {HAP_MODEL_CONTACT, true, false, 0.005};
  tool_world *w = tool_press(&g);
  REQUIRE(w != NULL);
  tool_stand(w, 4e-4, 0.0, HALF - DEEP, 0.02);
  tool_run(w, 50);
  double force = w->state.wrench.force[0];
  double torque = w->state.wrench.torque[2];
  CHECK(force < -0.39 && torque < -4e-3);
  for (int m = 0; m < 5; ++m) {
    CHECK(hap_session_set_model(w->session, next[m]) == HAP_OK);
    tool_run(w, 100);
    CHECK(w->state.contacts == 4);
    CHECK_NEAR(w->state.wrench.force[0], force, 1e-3);
    CHECK_NEAR(w->state.wrench.torque[2], torque, 1e-5);
  }
}

/* A device of 3 dof does not turn its tool, and gets no torque; a world that turns under it does
 * not move it. */
TEST(a_device_without_torque_feels_it_slide)
{
  tool_world *w = tool_new(HAP_MODEL_CONTACT);
  w->tool_def.friction = MU;
  w->tool_def.finger_radius = 0.005;
  REQUIRE(hap_device_open("virtual:path=0:0/0/0.013;0.3:0/0/0.008;1:0.01/0.005/0.008,blend=linear,"
                          "hand=rigid",
                          &w->tool_def.device, &w->detail) == HAP_OK);
  tool_add_floor(w);
  tool_start(w);
  CHECK(hap_session_advance(w->session, 900) == HAP_OK);
  CHECK(hap_pointer_get(w->session, w->tool, &w->state, sizeof w->state) == HAP_OK);
  CHECK_NEAR(w->state.wrench.force[2], LOAD, 1e-6);
  CHECK_NEAR(w->state.wrench.force[0], -MU * LOAD * 2.0 / sqrt(5.0), 1e-3);
  CHECK_NEAR(w->state.wrench.force[1], -MU * LOAD / sqrt(5.0), 1e-3);
  hap_device *device = w->tool_def.device;
  tool_end(w);
  hap_device_close(device);
}

/* On a box that is smaller than the face and shrinks: its corners are the same points of the
 * patch as before, and hold what they held, but where they are now. */
TEST(points_that_leap_hold_where_they_are)
{
  static const hap_model all[] = {HAP_MODEL_SINGLE, HAP_MODEL_CONTACT};
  for (int m = 0; m < 2; ++m) {
    tool_world *w = tool_new(all[m]);
    w->tool_def.friction = MU;
    dGeomID box = dCreateBox(w->space, 0.016, 0.016, 0.1);
    dGeomSetPosition(box, 0.0, 0.0, -0.05);
    tool_start_pressed(w);
    tool_stand(w, 2e-4, 0.0, HALF - DEEP, 0.04);
    tool_run(w, 40);
    double stiffness = 2.0 * K * 0.008 * 0.008;
    CHECK_NEAR(w->state.wrench.torque[2], -stiffness * 0.04, 0.02 * stiffness * 0.04);
    CHECK(hap_session_lock(w->session) == HAP_OK);
    dGeomBoxSetLengths(box, 0.0136, 0.0136, 0.1);
    CHECK(hap_session_unlock(w->session) == HAP_OK);
    tool_run(w, 80);
    stiffness = 2.0 * K * 0.0068 * 0.0068;
    CHECK_NEAR(w->state.wrench.torque[2], -stiffness * 0.04, 0.02 * stiffness * 0.04);
    CHECK_NEAR(w->state.wrench.force[0], -K * 2e-4, 0.01 * K * 2e-4);
    tool_end(w);
  }
}

/* Over the seam between two triangles: held as by a floor, along and about the normal, and no
 * more. */
TEST(a_mesh_holds_as_a_floor)
{
  static const hap_model all[] = {HAP_MODEL_SINGLE, HAP_MODEL_ACCELERANCE, HAP_MODEL_CONTACT};
  for (int m = 0; m < 3; ++m) {
    tool_world *w = tool_new(all[m]);
    w->tool_def.friction = MU;
    mesh_floor(w->space);
    tool_start_pressed(w);
    tool_stand(w, 4e-4, 0.0, HALF - DEEP, 0.0);
    tool_run(w, 1000);
    CHECK_NEAR(w->state.wrench.force[0], -K * 4e-4, 1e-3 * K * 4e-4);
    tool_stand(w, 0.0, 0.0, HALF - DEEP, 0.02);
    tool_run(w, 1000);
    double stiffness = 2.0 * K * HALF * HALF;
    CHECK_NEAR(w->state.wrench.torque[2], -stiffness * 0.02, 2e-3 * stiffness * 0.02);
    tool_move(w, 0.03, 0.004, HALF - DEEP, 0.0, 600);
    CHECK_NEAR(slip_of(w), MU * LOAD, 2e-3 * LOAD);
    tool_end(w);
  }
}

/* ---- what the application says ---- */

static struct {
  dGeomID left;
  double says[2];
  double came_with;
  int calls;
} asked;

static void pointer_surface(void *user, hap_pointer_id pointer, dGeomID geom, hap_surface *io)
{
  (void)user;
  (void)pointer;
  asked.came_with = io->friction_static;
  ++asked.calls;
  io->friction_static = io->friction_dynamic = asked.says[geom == asked.left ? 0 : 1];
}

static void surfaces_change(tool_world *w)
{
  CHECK(hap_session_lock(w->session) == HAP_OK);
  CHECK(hap_session_surface_changed(w->session, NULL) == HAP_OK);
  hap_session_unlock(w->session);
}

/* Across two boxes of which each has a friction of its own: the sum of both, and the moment
 * between them. */
TEST(each_geom_has_its_friction)
{
  for (int m = 0; m < 4; ++m) {
    tool_world *w = tool_new(all_models[m]);
    memset(&asked, 0, sizeof asked);
    asked.says[0] = 0.2;
    asked.says[1] = 0.8;
    w->ode.pointer_surface = pointer_surface;
    w->tool_def.friction = 0.3;
    asked.left = dCreateBox(w->space, 0.1, 0.2, 0.1);
    dGeomSetPosition(asked.left, -0.051, 0.0, -0.05);
    dGeomSetPosition(dCreateBox(w->space, 0.1, 0.2, 0.1), 0.051, 0.0, -0.05);
    tool_start_pressed(w);
    tool_move(w, 0.0, 0.005, HALF - DEEP, 0.0, 100);
    CHECK(asked.calls > 0 && asked.came_with == 0.3);
    CHECK_NEAR(w->state.wrench.force[2], 2.0 * LOAD, 1e-3 * LOAD);
    CHECK_NEAR(w->state.wrench.force[1], -1.0 * LOAD, 2e-3 * LOAD);
    CHECK_NEAR(w->state.wrench.torque[2], -0.6 * LOAD * 0.0055,
               2e-3 * LOAD * HALF); /* 1 to 10 mm */
    asked.says[0] = asked.says[1] = 0.1;
    surfaces_change(w);
    tool_run(w, 60);
    CHECK_NEAR(w->state.wrench.force[1], -0.2 * LOAD, 2e-3 * LOAD);
    asked.says[0] = asked.says[1] = 0.0;
    surfaces_change(w);
    tool_run(w, 60);
    CHECK_NEAR(slip_of(w), 0.0, 1e-9);
    tool_end(w);
  }
}

/* ---- energy ---- */

typedef struct round_trip {
  double work_most; /* J, that the hand got at most */
  double stored;    /* J, that it had put in at most */
} round_trip;

/* Down, along, round, along, back again, with a tilt in between, and off. */
static round_trip go_round(const ground *g, hap_guard guard, double tilt)
{
  round_trip out = {0.0, 0.0};
  tool_world *w = tool_new(g->model);
  w->research.guard = guard;
  w->tool_def.friction = MU;
  w->tool_def.finger_radius = g->finger;
  if (g->proxied) {
    w->tool_expert.coupling = HAP_COUPLING_PROXY;
    w->tool_expert.coupling_stiffness = 1e4;
  }
  dGeomSetPosition(dCreateBox(w->space, 0.3, 0.3, 0.1), 0.0, 0.0, -0.05);
  tool_start(w);
  tool_go(w, 0.0, 0.0, HALF + 0.003, 0.0);
  tool_run(w, 60);
  w->work = w->work_most = 0.0;
  for (int i = 0; i < 4; ++i) {
    tool_move(w, 0.0, 0.0, HALF - DEEP, 0.0, 100);
    out.stored = fmax(out.stored, -w->work);
    for (int j = 0; j < 3; ++j) {
      tool_move(w, 6e-4, 3e-4, HALF - DEEP, 0.0, 50);
      tool_move(w, 6e-4, 3e-4, HALF - DEEP, tilt, 80);
      tool_move(w, -2e-4, -6e-4, HALF - DEEP, tilt, 50);
      tool_move(w, -2e-4, -6e-4, HALF - DEEP, 0.0, 80);
      tool_move(w, 0.0, 0.0, HALF - DEEP, 0.0, 50);
    }
    tool_move(w, 3e-3, 0.0, HALF - DEEP, 0.0, 50);
    tool_move(w, 3e-3, 0.0, HALF + 0.003, 0.0, 100);
    tool_move(w, 0.0, 0.0, HALF + 0.003, 0.0, 20);
  }
  out.work_most = w->work_most;
  tool_end(w);
  return out;
}

TEST(no_round_gives_energy)
{
  for (size_t i = 0; i < GROUNDS; ++i) {
    const ground *g = &grounds[i];
    round_trip level = go_round(g, HAP_GUARD_MEASURE, 0.0);
    round_trip tilted = go_round(g, HAP_GUARD_MEASURE, 0.1);
    round_trip observed = go_round(g, HAP_GUARD_ON, 0.1);
    printf("# %s%s%s: %.4f mJ level, %.4f mJ tilted, %.4f mJ with the observer; of %.3f mJ\n",
           hap_model_name(g->model), g->finger > 0.0 ? ", soft" : "", g->proxied ? ", proxy" : "",
           1e3 * level.work_most, 1e3 * tilted.work_most, 1e3 * observed.work_most,
           1e3 * level.stored);
    CHECK(level.stored > 1e-3);
    CHECK(level.work_most < 0.01 * level.stored);
    CHECK(tilted.work_most < 0.01 * level.stored); /* it loses more by sliding than tilting gives */
    CHECK(observed.work_most < 0.01 * level.stored);
  }
}

/* Along x, and by two angles: about y, then about the vertical. */
typedef struct station {
  double x;
  double tilt;
  double turn;
} station;

static void go_to(tool_world *w, const station *from, const station *to, int ticks)
{
  for (int i = 1; i <= ticks; ++i) {
    double share = (double)i / ticks;
    double tilt = from->tilt + share * (to->tilt - from->tilt);
    double turn = from->turn + share * (to->turn - from->turn);
    double about_y[4] = {cos(0.5 * tilt), 0.0, sin(0.5 * tilt), 0.0};
    double about_z[4] = {cos(0.5 * turn), 0.0, 0.0, sin(0.5 * turn)};
    double back[4] = {w->pose.quat_wxyz[0], -w->pose.quat_wxyz[1], -w->pose.quat_wxyz[2],
                      -w->pose.quat_wxyz[3]};
    double change[4];
    w->pose.position[0] = from->x + share * (to->x - from->x);
    hapi_quat_multiply(about_z, about_y, w->pose.quat_wxyz);
    hapi_quat_multiply(w->pose.quat_wxyz, back, change);
    hapi_v3_set(w->twist.linear, 1e3 * (to->x - from->x) / ticks, 0.0, 0.0);
    hapi_v3_scale(2e3, change + 1, w->twist.angular);
    tool_step(w);
  }
}

/* Held with all that friction can, turned on an edge, laid down flat, turned back on the other
 * edge and taken off: the shares change between points that were pulled by unlike ways. J of the
 * best round for the hand. */
static double turn_on_edges(hap_model model, hap_guard guard, double *out_stored)
{
  static const station stations[] = {{0, 0.07, 0},     {0, 0.07, 0.06}, {0, 0, 0.06},
                                     {0, -0.07, 0.06}, {0, -0.07, 0},   {0, 0, 0}};
  double best = -HUGE_VAL;
  const ground g = {model, true, false, 0.0};
  tool_world *w = tool_new(g.model);
  w->research.guard = guard;
  w->tool_def.friction = 10.0;
  dGeomSetPosition(dCreateBox(w->space, 0.3, 0.3, 0.1), 0.0, 0.0, -0.05);
  tool_start(w);
  tool_go(w, 0.0, 0.0, HALF + 0.004, 0.07);
  tool_run(w, 60);
  *out_stored = 0.0;
  for (int i = 0; i < 5; ++i) {
    w->work = 0.0;
    tool_move(w, 0.0, 0.0, HALF - DEEP, 0.07, 100);
    for (int k = 0; k + 1 < 6; ++k) {
      go_to(w, &stations[k], &stations[k + 1], 100);
      *out_stored = fmax(*out_stored, -w->work);
    }
    tool_move(w, 0.0, 0.0, HALF + 0.004, 0.0, 100);
    tool_move(w, 0.0, 0.0, HALF + 0.004, 0.07, 20);
    best = fmax(best, w->work);
  }
  tool_end(w);
  return best;
}

TEST(turning_on_edges_gives_no_energy)
{
  for (int m = 0; m < 4; ++m) {
    double stored;
    double made = turn_on_edges(all_models[m], HAP_GUARD_MEASURE, &stored);
    double given = turn_on_edges(all_models[m], HAP_GUARD_ON, &stored);
    printf("# %s: %.4f mJ in a round without the observer, %.4f mJ with it, of %.3f mJ\n",
           hap_model_name(all_models[m]), 1e3 * made, 1e3 * given, 1e3 * stored);
    CHECK(stored > 1e-3);
    CHECK(made < 0.01 * stored);
    CHECK(given < 0.01 * stored);
  }
}

/* Each round ends where it began, and nothing slides: what the hand puts in it gets back, and no
 * more. */
TEST(no_round_that_sticks_gives_energy)
{
  static const station rounds[][5] = {
      {{0, 0, 0}, {4e-4, 0, 0}, {4e-4, 0.03, 0}, {-4e-4, 0.03, 0}, {-4e-4, 0, 0}},
      {{0, 0, 0}, {0, 0, 0.02}, {0, 0.03, 0.02}, {0, 0.03, -0.02}, {0, 0, -0.02}},
      {{0, 0, 0}, {3e-4, 0, 0.01}, {3e-4, -0.03, 0.01}, {-3e-4, 0.03, -0.01}, {2e-4, 0, -0.01}},
  };
  for (size_t i = 0; i < GROUNDS; ++i) {
    for (int r = 0; r < 6; ++r) { /* and the other way round */
      tool_world *w = tool_press(&grounds[i]);
      REQUIRE(w != NULL);
      w->work = w->work_most = 0.0;
      for (int j = 0; j < 5; ++j) {
        const station *s = rounds[r % 3];
        for (int k = 0; k < 5; ++k) {
          go_to(w, &s[r < 3 ? k : (5 - k) % 5], &s[r < 3 ? (k + 1) % 5 : 4 - k], 40);
        }
      }
      printf("# %s, round %d: %.3g mJ in five\n", hap_model_name(grounds[i].model), r,
             1e3 * w->work);
      CHECK(w->work < 0.01 * 0.5 * LOAD * DEEP);
      CHECK(w->work_most < 0.01 * 0.5 * LOAD * DEEP);
      tool_end(w);
    }
  }
}
