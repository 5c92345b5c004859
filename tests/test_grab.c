/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Bodies that a hand holds, by the public headers but where ticks are missed: against closed forms,
 * a plain loop of ODE, and the world stepped at the haptic rate. */

#include "tests/tap.h"

#include <math.h>

#include <hapode/grab.h>

#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/desk.h"

#define G 9.81
#define EVENTS 64

static hap_grab_def grab_of(void)
{
  hap_grab_def def;
  hap_grab_def_init(&def, sizeof def);
  return def;
}

static hap_pose pose_of(desk *d, dBodyID body)
{
  hap_pose pose = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}};
  REQUIRE(hap_session_poses_now(d->session, &body, 1, &pose) >= HAP_OK);
  return pose;
}

static size_t events_of(desk *d, hap_event *out)
{
  size_t count = 0;
  (void)hap_session_events(d->session, out, EVENTS, sizeof *out, &count);
  return count;
}

static const hap_event *event_of(const hap_event *events, size_t count, hap_event_kind kind)
{
  for (size_t i = 0; i < count; ++i) {
    if (events[i].kind == (uint32_t)kind) {
      return &events[i];
    }
  }
  return NULL;
}

static void detail_has(desk *d, const char *words)
{
  hap_detail detail;
  REQUIRE(hap_session_detail(d->session, &detail) == HAP_OK);
  if (strstr(detail.text, words) == NULL) {
    printf("# %s\n", detail.text);
  }
  CHECK(strstr(detail.text, words) != NULL);
}

typedef struct how_row {
  const char *name;
  hap_model model;
  double physics_hz;
} how_row;

static desk *how_desk(const how_row *how, double gravity)
{
  desk *d = desk_new(gravity, how->model);
  d->def.physics_hz = how->physics_hz;
  return d;
}

/* A box of 0.1 m in the air, in the middle of which the hand takes hold. */
static dBodyID box_add(desk *d, double mass)
{
  return ode_box(d->world, d->space, mass, AT(0.1, 0.1, 0.1), AT(0.0, 0.0, 0.5));
}

static void desk_hold(desk *d, dBodyID body, const hap_grab_def *def)
{
  hap_status status = hap_pointer_attach(d->session, d->hand, body, def);
  hap_detail detail = {""};
  (void)hap_session_detail(d->session, &detail);
  REQUIRE_SAY(status == HAP_OK, "%s", detail.text);
}

/* ---- closed forms ---- */

#define HOW(what)                                                   \
  {what "_in_model_single", HAP_MODEL_SINGLE, 1000.0},              \
      {what "_in_model_contact_at_60_hz", HAP_MODEL_CONTACT, 60.0}, \
  {                                                                 \
    what "_in_model_contact_at_20_hz", HAP_MODEL_CONTACT, 20.0      \
  }

static const how_row weights[] = {HOW("the_hand_feels_the_weight_of_a_body")};

TEST_EACH(weights, const how_row *row)
{
  const double masses[] = {0.05, 0.5, 5.0};
  for (int i = 0; i < 3; ++i) {
    desk *d = how_desk(row, G);
    dBodyID body = box_add(d, masses[i]);
    hap_grab_def def = grab_of();
    def.damping = 2.0 * sqrt(STIFFNESS * masses[i]);
    desk_run(d, 0.0, 0.0, 0.5);
    desk_hold(d, body, &def);
    desk_wait(d, 1500);
    hap_pointer_state state = desk_state(d);
    check_vector(state.wrench.force, 0.0, 0.0, -masses[i] * G, 1e-3 * masses[i] * G);
    CHECK(state.held == body);
    CHECK(state.contacts == 1);
  }
}

static const how_row inertias[] = {HOW("the_hand_feels_the_inertia_of_a_body")};

/* A hand that goes to and fro: m x'' = k (h - x) + d (h' - x'). */
TEST_EACH(inertias, const how_row *row)
{
  const double mass = 0.5;
  const double w = 2.0 * M_PI * 2.0;
  const double damping = 5.0;
  const double far = 0.03;
  desk *d = how_desk(row, 0.0);
  dBodyID body = box_add(d, mass);
  hap_grab_def def = grab_of();
  def.damping = damping;
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, body, &def);
  double sine = 0.0;
  double cosine = 0.0;
  for (int k = 1; k <= 5000; ++k) {
    d->at[0] = far * sin(w * k * T);
    d->velocity[0] = far * w * cos(w * k * T);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    if (k > 3000) { /* four whole swings */
      double force = -desk_state(d).wrench.force[0];
      sine += force * sin(w * k * T) / 1000.0;
      cosine += force * cos(w * k * T) / 1000.0;
    }
  }
  /* F / h = -m w^2 (k + i w d) / (k - m w^2 + i w d) */
  double re = STIFFNESS - mass * w * w;
  double im = w * damping;
  double size = mass * w * w / (re * re + im * im);
  double want_sine = -size * (STIFFNESS * re + im * im) * far;
  double want_cosine = -size * (im * re - STIFFNESS * im) * far;
  double force = hypot(want_sine, want_cosine);
  CHECK_NEAR(sine, want_sine, 3e-3 * force);
  CHECK_NEAR(cosine, want_cosine, 1e-2 * force);
}

static const how_row swings[] = {HOW("a_rod_swings_from_the_hand_as_a_pendulum")};

TEST_EACH(swings, const how_row *row)
{
  const double mass = 0.2;
  const double edge = 0.02;
  const double length = 0.3;
  const double arm = 0.14;
  desk *d = how_desk(row, G);
  dBodyID rod = ode_box(d->world, d->space, mass, AT(edge, edge, length), AT(0.0, 0.0, 0.5 - arm));
  hap_grab_def def = grab_of();
  def.turns = HAP_GRAB_BALL;
  def.stiffness = 20000.0;
  def.damping = 20.0;
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, rod, &def);
  desk_move(d, 0.005, 0.0, 0.0, 100);
  desk_wait(d, 300);
  double first = 0.0;
  double last = 0.0;
  int turns = 0;
  double before = 0.0;
  for (int k = 0; k < 9000; ++k) {
    desk_wait(d, 1);
    double across = pose_of(d, rod).position[0] - d->at[0];
    if (k > 0 && before < 0.0 && across >= 0.0) {
      double at = k - across / (across - before);
      first = turns == 0 ? at : first;
      last = at;
      ++turns;
    }
    before = across;
  }
  double inertia = mass * (length * length + edge * edge) / 12.0 + mass * arm * arm;
  double period = 2.0 * M_PI * sqrt(inertia / (mass * G * arm));
  REQUIRE(turns >= 8);
  CHECK_NEAR(T * (last - first) / (turns - 1), period, 2e-3 * period);
}

static const how_row torques[] = {HOW("a_body_held_beside_its_centre_turns_the_hand")};

TEST_EACH(torques, const how_row *row)
{
  const double mass = 0.3;
  const double arm = 0.04;
  desk *d = how_desk(row, G);
  dBodyID body = box_add(d, mass);
  hap_grab_def def = grab_of();
  def.stiffness = 4000.0;
  def.damping = 30.0;
  def.turn_damping = 0.1;
  d->hand_def.max_torque = 100.0;
  desk_run(d, arm, 0.0, 0.5);
  desk_hold(d, body, &def);
  desk_wait(d, 2000);
  hap_pointer_state state = desk_state(d);
  double lever = d->at[0] - pose_of(d, body).position[0]; /* it hangs a little aslant */
  check_vector(state.wrench.force, 0.0, 0.0, -mass * G, 1e-3 * mass * G);
  CHECK_NEAR(state.wrench.torque[1], -mass * G * lever, 5e-3 * mass * G * arm);
  CHECK(fabs(lever - arm) < 0.1 * arm);
}

/* ---- carried into a stack ---- */

#define EDGE 0.06
#define LAYER 1e-6 /* m: contacts rest anywhere within it, which is felt by the spring */
#define TOP (CUBES * (EDGE - LAYER) + 0.5 * EDGE)
#define CUBES 3
#define WAY_TICKS 2000
#define MU 0.5

/* A stack of cubes on a floor; the last cube is held above it. */
static dBodyID stack_add(dWorldID world, dSpaceID space)
{
  dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  dWorldSetContactSurfaceLayer(world, LAYER);
  dWorldSetQuickStepNumIterations(world, 200);
  for (int i = 0; i < CUBES; ++i) {
    (void)ode_box(world, space, 0.3, AT(EDGE, EDGE, EDGE),
                  AT(0.0, 0.0, i * (EDGE - LAYER) + 0.5 * EDGE - LAYER));
  }
  return ode_box(world, space, 0.2, AT(EDGE, EDGE, EDGE), AT(0.0, 0.0, TOP + 0.02));
}

/* The hand in the middle of the held cube: down, it presses, drags, and lifts. */
static void stack_hand(int k, double at[3], double velocity[3])
{
  static const double stops[][4] = {{0.0, 0.0, 0.0, 0.02},        {300.0, 0.0, 0.0, 0.02},
                                    {600.0, 0.0, 0.0, -0.006},    {900.0, 0.0, 0.0, -0.006},
                                    {1400.0, 0.012, 0.0, -0.006}, {1600.0, 0.012, 0.0, -0.006},
                                    {2000.0, 0.012, 0.0, 0.02}};
  int i = 0;
  while (i < 5 && k >= stops[i + 1][0]) {
    ++i;
  }
  double ticks = stops[i + 1][0] - stops[i][0];
  double share = (k - stops[i][0]) / ticks;
  for (int c = 0; c < 3; ++c) {
    double from = stops[i][c + 1];
    double way = stops[i + 1][c + 1] - from;
    double rest = c == 2 ? TOP : 0.0;
    at[c] = rest + from + way * 0.5 * (1.0 - cos(M_PI * share));
    velocity[c] = way * 0.5 * M_PI * sin(M_PI * share) / (ticks * T);
  }
}

static bool stack_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mu = MU;
  return true;
}

static void stack_run(const how_row *how, double out[WAY_TICKS][3])
{
  desk *d = how_desk(how, G);
  dBodyID body = stack_add(d->world, d->space);
  d->ode.surface = stack_surface;
  hap_grab_def def = grab_of();
  def.damping = 10.0;
  def.turn_damping = 0.05 * 0.05 * 10.0;
  stack_hand(0, d->at, d->velocity);
  desk_run(d, d->at[0], d->at[1], d->at[2]);
  desk_hold(d, body, &def);
  for (int k = 0; k < WAY_TICKS; ++k) {
    stack_hand(k, d->at, d->velocity);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    memcpy(out[k], desk_state(d).wrench.force, sizeof out[k]);
  }
  tap_release(d);
}

/* ---- the same without this library ---- */

#define PLAIN_CONTACTS 8

typedef struct plain_loop {
  dWorldID world;
  dSpaceID space;
  dJointGroupID contacts;
} plain_loop;

static void plain_meet(void *data, dGeomID a, dGeomID b)
{
  plain_loop *p = data;
  dContact found[PLAIN_CONTACTS];
  memset(found, 0, sizeof found);
  int count = dCollide(a, b, PLAIN_CONTACTS, &found[0].geom, sizeof found[0]);
  for (int i = 0; i < count; ++i) {
    found[i].surface.mode = dContactApprox1;
    found[i].surface.mu = MU;
    dJointAttach(dJointCreateContact(p->world, p->contacts, &found[i]), dGeomGetBody(a),
                 dGeomGetBody(b));
  }
}

/* Spring and damper from the middle of the body to the hand, which keeps its turn. */
static void plain_pull(dBodyID body, double share, const double at[3], const double velocity[3],
                       double out[3])
{
  static const double k[2] = {STIFFNESS, 0.05 * 0.05 * STIFFNESS};
  static const double d[2] = {10.0, 0.05 * 0.05 * 10.0};
  const dReal *x = dBodyGetPosition(body);
  const dReal *v = dBodyGetLinearVel(body);
  const dReal *q = dBodyGetQuaternion(body);
  const dReal *w = dBodyGetAngularVel(body);
  double sign = q[0] < 0.0 ? 2.0 : -2.0;
  for (int c = 0; c < 3; ++c) {
    out[c] = -share * (k[0] * (at[c] - x[c]) + d[0] * (velocity[c] - v[c]));
  }
  dBodyAddForce(body, -out[0], -out[1], -out[2]);
  dBodyAddTorque(body, share * (k[1] * sign * q[1] - d[1] * w[0]),
                 share * (k[1] * sign * q[2] - d[1] * w[1]),
                 share * (k[1] * sign * q[3] - d[1] * w[2]));
}

static void stack_plain(double out[WAY_TICKS][3])
{
  plain_loop p;
  ode_world_make(G, &p.world, &p.space);
  ode_world_stiffen(p.world, 50);
  p.contacts = dJointGroupCreate(0);
  dBodyID body = stack_add(p.world, p.space);
  for (int i = 0; i < WAY_TICKS; ++i) {
    double at[3];
    double velocity[3];
    stack_hand(i, at, velocity);
    dSpaceCollide(p.space, &p, plain_meet);
    plain_pull(body, fmin((i + 1) / 20.0, 1.0), at, velocity, out[i]);
    dWorldQuickStep(p.world, T);
    dJointGroupEmpty(p.contacts);
  }
  dJointGroupDestroy(p.contacts);
  ode_world_end(NULL, p.world, p.space);
}

static double stack_error(double a[WAY_TICKS][3], double b[WAY_TICKS][3])
{
  double apart = 0.0;
  double all = 0.0;
  for (int k = 100; k < WAY_TICKS; ++k) {
    for (int c = 0; c < 3; ++c) {
      apart += (a[k][c] - b[k][c]) * (a[k][c] - b[k][c]);
      all += b[k][c] * b[k][c];
    }
  }
  return sqrt(apart / all);
}

TEST(a_body_carried_into_a_stack_feels_as_in_model_single_and_in_a_plain_loop)
{
  static double reference[WAY_TICKS][3];
  static double plain[WAY_TICKS][3];
  static double felt[WAY_TICKS][3];
  const how_row single = {"", HAP_MODEL_SINGLE, 1000.0};
  stack_run(&single, reference);
  stack_plain(plain);
  for (int i = 0; i < 2; ++i) {
    const how_row contact = {"", HAP_MODEL_CONTACT, i == 0 ? 60.0 : 20.0};
    stack_run(&contact, felt);
    double error = stack_error(felt, reference);
    double apart = stack_error(felt, plain);
    printf("# %g Hz: %.3f %% of single, %.3f %% of plain ODE\n", contact.physics_hz, 100.0 * error,
           100.0 * apart);
    CHECK(error < 0.01);
    CHECK(apart < 0.01);
  }
}

/* ---- what there is to be told ---- */

TEST(what_is_held_and_why_it_ended_is_told)
{
  hap_event events[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 1.0);
  desk_run(d, 0.0, 0.0, 0.5);
  (void)events_of(d, events);
  CHECK(desk_state(d).held == NULL);
  desk_wait(d, 30);
  desk_hold(d, body, NULL);
  desk_wait(d, 30);
  CHECK(desk_state(d).held == body);
  const hap_event *event = event_of(events, events_of(d, events), HAP_EVENT_HOLD);
  REQUIRE(event != NULL);
  CHECK(event->body == body);
  check_vector(event->point, 0.0, 0.0, 0.5, 1e-12);
  CHECK(hap_pointer_release(d->session, d->hand) == HAP_OK);
  desk_wait(d, 30);
  CHECK(desk_state(d).held == NULL);
  event = event_of(events, events_of(d, events), HAP_EVENT_LET_GO);
  REQUIRE(event != NULL);
  CHECK(event->number == HAP_GRAB_RELEASED);
  CHECK(hap_pointer_release(d->session, d->hand) == HAP_OK);
  CHECK(strcmp(hap_event_name(HAP_EVENT_HOLD), "hold") == 0);
  CHECK(strcmp(hap_event_name(HAP_EVENT_LET_GO), "let-go") == 0);
  detail_has(d, "");
}

TEST(a_grab_that_cannot_be_says_why)
{
  const hap_pointer_id nobody = {0};
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 1.0);
  dBodyID other = dBodyCreate(d->world); /* with neither geom nor joint */
  hap_grab_def def = grab_of();
  hap_grab_def raw;
  memset(&raw, 0, sizeof raw);
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  hand_lead(d);
  CHECK(hap_pointer_attach(d->session, d->hand, body, NULL) == HAP_ERROR_STATE);
  detail_has(d, "hap_session_start");
  session_run(d->session);
  CHECK(hap_pointer_attach(NULL, d->hand, body, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_attach(d->session, d->hand, NULL, NULL) == HAP_ERROR_ARGUMENT);
  CHECK(hap_pointer_attach(d->session, d->hand, other, NULL) == HAP_ERROR_NOT_FOUND);
  detail_has(d, "hap_session_adopt_body");
  CHECK(hap_pointer_attach(d->session, nobody, body, NULL) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_attach(d->session, d->hand, body, &raw) == HAP_ERROR_UNINITIALISED);
  CHECK(hap_pointer_release(d->session, nobody) == HAP_ERROR_NOT_FOUND);
  CHECK(hap_pointer_release(NULL, d->hand) == HAP_ERROR_ARGUMENT);
  const struct {
    size_t at;
    double value;
    const char *name;
  } wrong[] = {
      {offsetof(hap_grab_def, stiffness), -1.0, "stiffness"},
      {offsetof(hap_grab_def, damping), (double)NAN, "damping"},
      {offsetof(hap_grab_def, turn_stiffness), 1e7, "turn_stiffness"},
      {offsetof(hap_grab_def, turn_damping), -1e-9, "turn_damping"},
      {offsetof(hap_grab_def, max_force), (double)INFINITY, "max_force"},
      {offsetof(hap_grab_def, max_torque), -1.0, "max_torque"},
      {offsetof(hap_grab_def, pose_body_pointer), (double)NAN, "pose_body_pointer"},
  };
  for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
    hap_grab_def bad = def;
    memcpy((char *)&bad + wrong[i].at, &wrong[i].value, sizeof wrong[i].value);
    CHECK(hap_pointer_attach(d->session, d->hand, body, &bad) == HAP_ERROR_ARGUMENT);
    detail_has(d, wrong[i].name);
  }
  def.turns = 7;
  CHECK(hap_pointer_attach(d->session, d->hand, body, &def) == HAP_ERROR_ARGUMENT);
  def = grab_of();
  def.place = 2;
  CHECK(hap_pointer_attach(d->session, d->hand, body, &def) == HAP_ERROR_ARGUMENT);
  CHECK(hap_session_set_model(d->session, HAP_MODEL_IMPULSE) == HAP_OK);
  CHECK(hap_pointer_attach(d->session, d->hand, body, NULL) == HAP_ERROR_UNSUPPORTED);
  detail_has(d, "contact or single");
  desk_wait(d, 50);
  CHECK(desk_state(d).held == NULL);
  dBodyDestroy(other);
}

TEST(a_grip_that_the_device_cannot_hold_is_cut_and_said)
{
  hap_detail why = {""};
  hap_grab_def def;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  hap_device *device = NULL;
  const double edges[3] = {0.04, 0.04, 0.04};
  const double place[3] = {0.0, 0.0, 0.1};
  dBodyID body = ode_box(d->world, d->space, 0.2, edges, place);
  REQUIRE(hap_device_open("virtual:path=0:0/0/0;9:0/0/0,rated_stiffness=700", &device, &why) >=
          HAP_OK);
  d->hand_def.device = device;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  REQUIRE(hap_session_advance(d->session, 50) >= HAP_OK);
  hap_grab_def_init(&def, sizeof def);
  def.stiffness = 5000.0;
  CHECK(hap_pointer_attach(d->session, d->hand, body, &def) == HAP_SATURATED);
  (void)hap_session_detail(d->session, &why);
  CHECK(strstr(why.text, "stiffness 5000 is cut to the 700") != NULL);
  hap_session_destroy(d->session);
  d->session = NULL;
  hap_device_close(device);
}

TEST(another_model_and_a_rigid_coupling_end_it)
{
  hap_event events[EVENTS];
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 1.0);
  desk_run(d, 0.0, 0.0, 0.5);
  (void)events_of(d, events);
  desk_hold(d, body, NULL);
  desk_wait(d, 50);
  REQUIRE(desk_state(d).held == body);
  CHECK(hap_session_set_model(d->session, HAP_MODEL_ACCELERANCE) == HAP_OK);
  desk_wait(d, 100);
  CHECK(desk_state(d).held == NULL);
  const hap_event *event = event_of(events, events_of(d, events), HAP_EVENT_LET_GO);
  REQUIRE(event != NULL);
  CHECK(event->number == HAP_GRAB_REFUSED);
}

TEST(models_contact_and_single_hand_the_body_over)
{
  const hap_model models[] = {HAP_MODEL_SINGLE, HAP_MODEL_CONTACT, HAP_MODEL_SINGLE};
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 0.5);
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, body, NULL);
  desk_wait(d, 1000);
  for (int i = 0; i < 3; ++i) {
    double least = 0.0;
    double most = -1000.0;
    CHECK(hap_session_set_model(d->session, models[i]) == HAP_OK);
    for (int k = 0; k < 500; ++k) {
      desk_wait(d, 1);
      least = fmin(least, desk_state(d).wrench.force[2]);
      most = fmax(most, desk_state(d).wrench.force[2]);
    }
    printf("# %g .. %g N\n", least, most);
    CHECK(desk_state(d).held == body);
    CHECK(least > -0.5 * G * 1.15 && most < -0.5 * G * 0.85);
  }
}

TEST(a_body_that_is_destroyed_or_put_elsewhere_is_let_go)
{
  for (int way = 0; way < 2; ++way) {
    hap_event events[EVENTS];
    const hap_pose there = {{1.0, 0.0, 0.5}, {1.0, 0.0, 0.0, 0.0}};
    desk *d = desk_new(G, HAP_MODEL_CONTACT);
    dBodyID body = box_add(d, 1.0);
    desk_run(d, 0.0, 0.0, 0.5);
    (void)events_of(d, events);
    desk_hold(d, body, NULL);
    desk_wait(d, 500);
    CHECK(desk_state(d).wrench.force[2] < -5.0);
    if (way == 0) {
      dGeomDestroy(dBodyGetFirstGeom(body));
      dBodyDestroy(body);
    } else {
      CHECK(hap_session_teleport_body(d->session, body, &there) == HAP_OK);
    }
    desk_wait(d, 60);
    CHECK(desk_state(d).held == NULL);
    check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 1e-9);
    const hap_event *event = event_of(events, events_of(d, events), HAP_EVENT_LET_GO);
    REQUIRE(event != NULL);
    CHECK(event->number == HAP_GRAB_GONE);
  }
}

/* ---- how it begins and ends ---- */

static const how_row begins[] = {HOW("nothing_leaps_when_a_body_is_taken_and_let_go")};

TEST_EACH(begins, const how_row *row)
{
  const double mass = 1.0;
  desk *d = how_desk(row, G);
  dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.45);
  dBodyID body = box_add(d, mass); /* it stands */
  desk_run(d, 0.0, 0.0, 0.56);     /* the hand above it */
  desk_wait(d, 100);
  desk_move(d, 0.0, 0.0, -0.004, 100); /* presses with 4 N */
  desk_wait(d, 200);
  double pressed = desk_state(d).wrench.force[2];
  CHECK_NEAR(pressed, 4.0, 0.1);
  desk_hold(d, body, NULL);
  double before = pressed;
  double step = 0.0;
  for (int k = 0; k < 100; ++k) {
    desk_wait(d, 1);
    double force = desk_state(d).wrench.force[2];
    step = fmax(step, fabs(force - before));
    before = force;
  }
  CHECK(step < 2.5 * 4.0 / 20.0); /* in 20 ms, not at once */
  CHECK_NEAR(before, 0.0, 0.05);
  desk_move(d, 0.0, 0.0, 0.2, 1000);
  desk_wait(d, 1000);
  CHECK_NEAR(desk_state(d).wrench.force[2], -mass * G, 1e-3 * mass * G);
  double height = pose_of(d, body).position[2];
  CHECK(hap_pointer_release(d->session, d->hand) == HAP_OK);
  before = desk_state(d).wrench.force[2];
  step = 0.0;
  for (int k = 0; k < 25; ++k) {
    desk_wait(d, 1);
    double force = desk_state(d).wrench.force[2];
    step = fmax(step, fabs(force - before));
    before = force;
  }
  CHECK(step < 1.5 * mass * G / 20.0);
  desk_wait(d, 75);
  check_vector(desk_state(d).wrench.force, 0.0, 0.0, 0.0, 1e-9);
  double fallen = height - pose_of(d, body).position[2];
  CHECK(fallen > 0.5 * G * 0.08 * 0.08 && fallen < 0.5 * G * 0.1 * 0.1);
}

/* J, of the energy observer. */
static double ledger_of(const desk *d)
{
  return d->session->haptic->tick.guard.balance;
}

/* The hand stands pressed into a floor by 1 mm and has stretched the grip by 5 mm. What was in the
 * grip's spring must not pay for a later force: it is lost, and 0.5 mJ of the floor are left. */
TEST(what_the_grip_had_stored_is_lost_when_it_lets_go)
{
  const double floor_holds = 0.5 * STIFFNESS * 1e-3 * 1e-3;
  const double grip_holds = 0.5 * STIFFNESS * 5e-3 * 5e-3;
  for (int sudden = 0; sudden < 2; ++sudden) {
    desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
    floor_add(d);
    dBodyID body = box_add(d, 1.0);
    dBodySetKinematic(body);
    desk_run(d, 0.0, 0.0, RADIUS + 0.001);
    desk_wait(d, 40);
    desk_move(d, 0.0, 0.0, -0.002, 100);
    desk_hold(d, body, NULL);
    desk_wait(d, 100);
    desk_move(d, 0.005, 0.0, 0.0, 50);
    desk_wait(d, 20);
    CHECK_NEAR(desk_state(d).wrench.force[0], -STIFFNESS * 5e-3, 0.01);
    CHECK_NEAR(ledger_of(d), grip_holds + floor_holds, 0.05 * grip_holds);
    if (sudden != 0) {
      dGeomDestroy(dBodyGetFirstGeom(body));
      dBodyDestroy(body);
    } else {
      CHECK(hap_pointer_release(d->session, d->hand) == HAP_OK);
    }
    desk_wait(d, 60);
    CHECK_NEAR(desk_state(d).wrench.force[0], 0.0, 1e-9);
    CHECK_NEAR(ledger_of(d), floor_holds, 0.05 * grip_holds);
    tap_release(d);
  }
}

TEST(a_body_comes_to_the_pose_that_was_asked_for)
{
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 0.5);
  hap_grab_def def = grab_of();
  def.place = HAP_GRAB_AT_POSE;
  def.pose_body_pointer = (hap_pose){{0.02, -0.03, 0.0}, {sqrt(0.5), 0.0, 0.0, sqrt(0.5)}};
  desk_run(d, 0.0, 0.2, 0.5);
  desk_hold(d, body, &def);
  double peak = 0.0;
  for (int k = 0; k < 1500; ++k) {
    desk_wait(d, 1);
    peak = fmax(peak, fabs(desk_state(d).wrench.force[1]));
  }
  /* The hand's turn is none, so the body's is -90 degrees about z. */
  hap_pose pose = pose_of(d, body);
  CHECK_NEAR(fabs(pose.quat_wxyz[0]), sqrt(0.5), 1e-3);
  CHECK_NEAR(-pose.quat_wxyz[3] * (pose.quat_wxyz[0] < 0.0 ? -1.0 : 1.0), sqrt(0.5), 1e-3);
  check_vector(pose.position, 0.03, 0.2 + 0.02, 0.5, 1e-3);
  CHECK(peak > 1.0 &&
        peak < 1.5 * 0.5 * sqrt(STIFFNESS * 0.5)); /* struck at 0.5 m/s: v sqrt(k m) */
}

TEST(a_body_far_from_the_hand_is_held_from_the_next_step_on)
{
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 0.5);
  dBodySetGravityMode(body, 0);
  desk_run(d, 0.0, 1.0, 0.5);
  desk_wait(d, 100);
  desk_hold(d, body, NULL);
  desk_wait(d, 60);
  CHECK(desk_state(d).held == body);
  desk_move(d, 0.1, 0.0, 0.0, 500);
  desk_wait(d, 8000);
  hap_pose pose = pose_of(d, body);
  CHECK_NEAR(pose.position[0], 0.1, 1e-3); /* it turns with the hand, a metre away */
  CHECK_NEAR(pose.position[1], 0.0, 1e-3);
}

/* ---- several, and what does not give way ---- */

TEST(two_hands_share_the_weight_of_a_bar)
{
  hap_pointer_id second;
  hap_pointer_state states[2];
  hap_grab_def def = grab_of();
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dBodyID bar = ode_box(d->world, d->space, 1.2, AT(0.4, 0.04, 0.04), AT(0.0, 0.0, 0.5));
  def.turns = HAP_GRAB_BALL;
  def.damping = 20.0;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &second) == HAP_OK);
  const hap_pose there = {{0.1, 0.0, 0.5}, {1.0, 0.0, 0.0, 0.0}};
  const hap_twist still = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  REQUIRE(hap_pointer_set_target(d->session, second, &there, &still) == HAP_OK);
  d->at[0] = -0.2;
  d->at[2] = 0.5;
  hand_lead(d);
  session_run(d->session);
  desk_hold(d, bar, &def);
  REQUIRE(hap_pointer_attach(d->session, second, bar, &def) == HAP_OK);
  desk_wait(d, 3000);
  states[0] = desk_state(d);
  REQUIRE(hap_pointer_get(d->session, second, &states[1], sizeof states[1]) == HAP_OK);
  /* Levers about the middle: 0.2 and 0.1 m. */
  CHECK_NEAR(states[0].wrench.force[2], -1.2 * G / 3.0, 0.02 * 1.2 * G);
  CHECK_NEAR(states[1].wrench.force[2], -1.2 * G * 2.0 / 3.0, 0.02 * 1.2 * G);
  CHECK_NEAR(states[0].wrench.force[2] + states[1].wrench.force[2], -1.2 * G, 1e-3 * 1.2 * G);
  CHECK(hap_pointer_release(d->session, second) == HAP_OK);
  desk_wait(d, 1000);
  REQUIRE(hap_pointer_get(d->session, second, &states[1], sizeof states[1]) == HAP_OK);
  check_vector(states[1].wrench.force, 0.0, 0.0, 0.0, 1e-9);
  CHECK(desk_state(d).held == bar); /* and it swings there */
}

TEST(a_kinematic_body_is_a_handle)
{
  const hap_model models[] = {HAP_MODEL_CONTACT, HAP_MODEL_SINGLE};
  for (int i = 0; i < 2; ++i) {
    desk *d = desk_new(G, models[i]);
    dBodyID body = box_add(d, 1.0);
    dBodySetKinematic(body);
    desk_run(d, 0.0, 0.0, 0.5);
    desk_hold(d, body, NULL);
    desk_wait(d, 30);
    desk_move(d, 0.003, 0.0, -0.002, 100);
    desk_wait(d, 50);
    check_vector(desk_state(d).wrench.force, -3.0, 0.0, 2.0, 1e-9);
  }
}

/* A handle that is driven goes ahead of the hand: what it gives in each round is its drive's work,
 * and no energy out of nothing. */
TEST(what_a_driven_handle_gives_is_felt)
{
  const double w = 2.0 * M_PI; /* 1/s */
  const double far = 0.01;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 1.0);
  dBodySetKinematic(body);
  d->hand_def.max_force = 20.0;
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, body, NULL);
  desk_wait(d, 50);
  double work = 0.0;
  double worst = 0.0;
  for (int k = 1; k <= 2000; ++k) {
    double t = T * k;
    if (k % 10 == 1) { /* the twist that holds until the next step */
      REQUIRE(hap_session_lock(d->session) == HAP_OK);
      dBodySetLinearVel(body, far * w * cos(w * t), 0.0, 0.0);
      hap_session_unlock(d->session);
    }
    d->at[0] = far * (sin(w * t - 1.0) + sin(1.0));
    d->velocity[0] = far * w * cos(w * t - 1.0);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    double force = desk_state(d).wrench.force[0];
    work += T * force * d->velocity[0];
    double right = 1000.0 * (pose_of(d, body).position[0] - d->at[0]);
    worst = k > 100 ? fmax(worst, fabs(force - right)) : 0.0; /* the hand begins at full speed */
  }
  printf("# %.3g J, %.3g N off\n", work, worst);
  CHECK_NEAR(work, 2.0 * 1000.0 * M_PI * far * far * sin(1.0), 0.05); /* two rounds */
  CHECK(worst < 0.5);
  CHECK(session_stats(d->session).faults.fault == HAP_FAULT_NONE);
}

/* A handle goes to and fro at 8 Hz, ahead of the hand. Its drive gives the hand k pi A^2 sin(1) a
 * round, and the force is that of the spring in the middle of the tick in which it is held. */
TEST(what_a_fast_handle_gives_is_felt_whole)
{
  const double w = 2.0 * M_PI * 8.0; /* 1/s */
  const double far = 0.01;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 1.0);
  dBodySetKinematic(body);
  d->def.physics_hz = 1000.0;
  d->hand_def.max_force = 30.0;
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, body, NULL);
  desk_wait(d, 50);
  double work = 0.0;
  double worst = 0.0;
  uint64_t begun = 0;
  for (int k = 1; k <= 2000; ++k) {
    double t = T * k;
    REQUIRE(hap_session_lock(d->session) == HAP_OK);
    dBodySetLinearVel(body, far * (sin(w * t) - sin(w * (t - T))) / T, 0.0, 0.0);
    hap_session_unlock(d->session);
    d->at[0] = far * (sin(w * t - 1.0) + sin(1.0));
    d->velocity[0] = far * w * cos(w * t - 1.0);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    double force = desk_state(d).wrench.force[0];
    double next = far * (sin(w * (t + T) - 1.0) + sin(1.0));
    double middle = t + 0.5 * T;
    double right = 1000.0 * far * (sin(w * middle) - sin(w * middle - 1.0) - sin(1.0));
    work += force * (next - d->at[0]);
    worst = k > 100 ? fmax(worst, fabs(force - right)) : 0.0; /* the hand begins at full speed */
    begun = k == 100 ? session_stats(d->session).faults.energy_ticks : begun;
  }
  hap_stats stats = session_stats(d->session);
  printf("# %.4g J, %.3g N off\n", work, worst);
  CHECK_NEAR(work, 16.0 * 1000.0 * M_PI * far * far * sin(1.0), 0.02);
  CHECK(worst < 0.03);
  CHECK(stats.faults.energy_ticks == begun && stats.faults.fault == HAP_FAULT_NONE);
}

/* ---- ticks that are missed ---- */

typedef struct gap_row {
  const char *name;
  uint64_t run; /* ticks, and again */
  uint64_t stop;
} gap_row;

/* What docs/safety.md says of late ticks: times in ms. */
typedef struct gap_law {
  double few;
  double longest;
  double hold;
  double loss;
} gap_law;

/* Share of the way since the last tick in which the spring stays as it was. */
static double gap_stands(const gap_law *law, double elapsed)
{
  double lost = elapsed - 1.0;
  return lost + law->few > 5.0 ? lost / elapsed : 0.0;
}

static void gap_follow(gap_law *law, double elapsed)
{
  double lost = elapsed - 1.0;
  law->few = fmin(fmax(law->few + lost - 0.03 * elapsed, 0.0), 60.0);
  law->longest *= 1.0 - elapsed / 200.0;
  law->hold -= elapsed;
  if (lost > 5.0 || (lost > 0.0 && law->few > 30.0)) {
    law->longest = fmax(law->longest, elapsed);
    law->hold = 80.0;
  }
  double least = law->hold > 0.0 && law->longest > 1.0 ? 1.0 - 1.0 / law->longest : 0.0;
  law->loss = least > law->loss ? fmin(law->loss + 0.25, least) : fmax(law->loss - 0.01, least);
}

static const gap_row gaps[] = {{"a_spring_is_stretched_slowly_after_one_gap_of_9", 60, 9},
                               {"a_spring_is_stretched_slowly_after_7_of_12", 5, 7},
                               {"a_spring_is_stretched_slowly_after_3_of_4", 1, 3},
                               {"a_spring_is_stretched_at_once_after_gaps_of_4", 200, 4},
                               {"a_spring_is_stretched_slowly_after_40_of_80", 40, 40}};

/* A hand draws at a handle that stays, and turns it: force and torque are those of the springs in
 * the middle of a tick, but for the way of the gaps, which comes in at 0.5 m/s and 5 rad/s. */
TEST_EACH(gaps, const gap_row *row)
{
  const double speed = 0.2;   /* m/s */
  const double spin = 2.0;    /* rad/s, about x */
  const double torsion = 2.5; /* N m/rad: 1 kN/m at 50 mm */
  gap_law law = {0.0, 0.0, 0.0, 0.0};
  double late = 0.0;      /* m */
  double late_turn = 0.0; /* rad */
  double worst = 0.0;
  double worst_turn = 0.0;
  double held_back = 0.0;
  double before = -1.0; /* tick that ran last */
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  d->hand_def.max_torque = 100.0;
  dBodyID body = box_add(d, 1.0);
  dBodySetKinematic(body);
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, body, NULL);
  desk_wait(d, 50);
  for (int t = 0; t < 480; ++t) {
    bool runs = (uint64_t)t % (row->run + row->stop) < row->run;
    double turn = 0.5 * spin * T * (t + 1);
    hap_pose pose = {{speed * T * (t + 1), 0.0, 0.5}, {cos(turn), sin(turn), 0.0, 0.0}};
    hap_twist twist = {{speed, 0.0, 0.0}, {spin, 0.0, 0.0}};
    REQUIRE(hap_pointer_set_target(d->session, d->hand, &pose, &twist) == HAP_OK);
    d->session->pulses.run_ticks = 0;
    d->session->pulses.stop_ticks = runs ? 0 : 1;
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    if (runs) {
      double elapsed = t - before;
      double stands = gap_stands(&law, elapsed);
      late = fmax(late + stands * speed * T * elapsed - 0.5 * T, 0.0);
      late_turn = fmax(late_turn + stands * spin * T * elapsed - 5.0 * T, 0.0);
      gap_follow(&law, elapsed);
      before = t;
      held_back = fmax(held_back, late);
      const hap_wrench felt = desk_state(d).wrench;
      double left = 1.0 - law.loss;
      double force = -1000.0 * (pose.position[0] + 0.5 * speed * T - late) * left;
      double torque = -torsion * (2.0 * sin(turn - 0.5 * late_turn) + 0.5 * spin * T) * left;
      worst = fmax(worst, fabs(felt.force[0] - force));
      worst_turn = fmax(worst_turn, fabs(felt.torque[0] - torque));
    }
  }
  printf("# %.3g N, %.3g N m off; %.3g mm held back\n", worst, worst_turn, 1e3 * held_back);
  CHECK(worst < 1e-9 && worst_turn < 1e-3);
}

/* ---- whatever moves the body ---- */

/* N, amplitude at the sine of a hand that goes to and fro along x, once it goes on alike. */
static double shaken_force(desk *d, double far, double hz)
{
  const double w = 2.0 * M_PI * hz;
  const double begin = d->at[0];
  double sine = 0.0;
  for (int k = 1; k <= 4000; ++k) {
    d->at[0] = begin + far * sin(w * k * T);
    d->velocity[0] = far * w * cos(w * k * T);
    hand_lead(d);
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    sine += k > 2000 ? -desk_state(d).wrench.force[0] * sin(w * k * T) / 1000.0 : 0.0;
  }
  return sine;
}

/* Of a mass on spring and damper, see above. */
static double shaken_mass(double mass, double stiffness, double damping, double far, double hz)
{
  const double w = 2.0 * M_PI * hz;
  double re = stiffness - mass * w * w;
  double im = w * damping;
  return -mass * w * w * (stiffness * re + im * im) / (re * re + im * im) * far;
}

TEST(a_door_is_moved_by_its_handle)
{
  const double mass = 2.0;
  const double width = 0.5;
  const double arm = 0.45;
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dBodyID door = ode_box(d->world, d->space, mass, AT(0.02, width, 0.6), AT(0.0, 0.0, 0.5));
  dJointID hinge = dJointCreateHinge(d->world, NULL);
  dJointAttach(hinge, door, NULL);
  dJointSetHingeAnchor(hinge, 0.0, -0.5 * width, 0.5);
  dJointSetHingeAxis(hinge, 0.0, 0.0, 1.0);
  hap_grab_def def = grab_of();
  def.turns = HAP_GRAB_BALL;
  def.damping = 20.0;
  desk_run(d, 0.0, arm - 0.5 * width, 0.5);
  desk_hold(d, door, &def);
  double inertia = mass * (width * width + 0.02 * 0.02) / 12.0 + mass * 0.25 * width * width;
  double want = shaken_mass(inertia / (arm * arm), STIFFNESS, 20.0, 0.01, 2.0);
  CHECK_NEAR(shaken_force(d, 0.01, 2.0), want, 5e-3 * fabs(want));
  CHECK_NEAR(desk_state(d).wrench.force[2], 0.0, 1e-3); /* the hinge has the weight */
}

/* With a joint that testing simulations find; and itself found by them. */
TEST(a_body_that_is_measured_is_held)
{
  for (int i = 0; i < 2; ++i) {
    hap_expert_def expert;
    hap_body_role role = HAP_ROLE_WORLD;
    hap_grab_def def = grab_of();
    desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
    dBodyID body = box_add(d, 0.5);
    hap_expert_def_init(&expert, sizeof expert);
    d->def.expert = &expert;
    if (i == 0) {
      dJointAttach(dJointCreatePlane2D(d->world, NULL), body, NULL);
    } else { /* what is near a floor that the loop shall not know */
      dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.445);
      expert.effects_off = HAP_EFFECT_BIT(HAP_EFFECT_CONTACTS);
    }
    def.damping = 10.0;
    def.turns = HAP_GRAB_BALL;
    desk_run(d, 0.0, 0.0, 0.5);
    desk_hold(d, body, &def);
    double want = shaken_mass(0.5, STIFFNESS, 10.0, 0.02, 2.0);
    CHECK_NEAR(shaken_force(d, 0.02, 2.0), want, 0.01 * fabs(want));
    CHECK(hap_session_roles(d->session, &body, 1, &role) == HAP_OK);
    CHECK(role == (i == 0 ? HAP_ROLE_LOOP : HAP_ROLE_MEASURED));
  }
}

TEST(a_body_that_sleeps_is_woken)
{
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.45);
  dBodyID body = box_add(d, 0.5);
  dBodySetAutoDisableFlag(body, 1);
  desk_run(d, 0.0, 0.3, 0.8);
  desk_wait(d, 2000);
  CHECK(dBodyIsEnabled(body) == 0);
  desk_move(d, 0.0, -0.3, -0.24, 300);
  desk_hold(d, body, NULL);
  desk_move(d, 0.0, 0.0, 0.1, 300);
  desk_wait(d, 1000);
  CHECK_NEAR(desk_state(d).wrench.force[2], -0.5 * G, 1e-3 * 0.5 * G);
}

typedef struct set_row {
  const char *name;
  double time_scale;
  hap_coupling coupling;
  int32_t substeps;
  bool hull;
} set_row;

static const set_row sets[] = {
    {"the_weight_is_the_same_in_slow_motion", 0.3, HAP_COUPLING_AUTO, 1, false},
    {"the_weight_is_the_same_behind_a_proxy", 1.0, HAP_COUPLING_PROXY, 1, false},
    {"the_weight_is_the_same_with_substeps", 1.0, HAP_COUPLING_AUTO, 4, false},
    {"the_weight_is_the_same_on_a_hull", 1.0, HAP_COUPLING_AUTO, 1, true},
    {"the_weight_is_the_same_on_a_hull_behind_a_proxy", 1.0, HAP_COUPLING_PROXY, 1, true},
};

TEST_EACH(sets, const set_row *row)
{
  static const double corners[] = {0.02, 0.0,  -0.01, -0.02, 0.0, -0.01,
                                   0.0,  0.02, -0.01, 0.0,   0.0, 0.03};
  const double arm = 0.03;
  hap_pointer_expert_def expert;
  hap_expert_def session_expert;
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 0.4);
  hap_grab_def def = grab_of();
  def.damping = 40.0;
  def.turn_stiffness = 20.0;
  def.turn_damping = 0.2;
  hap_pointer_expert_def_init(&expert, sizeof expert);
  hap_expert_def_init(&session_expert, sizeof session_expert);
  expert.coupling = row->coupling;
  if (row->coupling == HAP_COUPLING_PROXY) {
    expert.coupling_stiffness = 2000.0;
    expert.coupling_damping = 10.0;
  }
  session_expert.substeps = row->substeps;
  d->def.expert = &session_expert;
  d->hand_def.expert = &expert;
  d->hand_def.max_torque = 50.0;
  if (row->hull) {
    d->hand_def.hull_xyz = corners;
    d->hand_def.hull_points = 4;
    d->hand_def.radius = 0.0;
  }
  desk_run(d, arm, 0.0, 0.5);
  CHECK(hap_session_set_time_scale(d->session, row->time_scale) == HAP_OK);
  desk_hold(d, body, &def);
  desk_wait(d, 6000);
  hap_pointer_state state = desk_state(d);
  double lever = d->at[0] - pose_of(d, body).position[0];
  CHECK(state.held == body);
  check_vector(state.wrench.force, 0.0, 0.0, -0.4 * G, 1e-3 * 0.4 * G);
  CHECK_NEAR(state.wrench.torque[1], -0.4 * G * lever, 0.01 * 0.4 * G * arm);
  /* Away by 10 cm: the body comes along. */
  desk_move(d, 0.1, 0.05, 0.0, 500);
  desk_wait(d, 4000);
  CHECK_NEAR(pose_of(d, body).position[0], 0.1 + arm - lever, 1e-3);
  CHECK_NEAR(pose_of(d, body).position[1], 0.05, 1e-3);
}

/* ---- bounds ---- */

typedef struct bound_row {
  const char *name;
  double mass;
  double stiffness; /* of the pointer */
} bound_row;

static const bound_row bounds[] = {
    {"10_g_on_1_kN_per_m_stays_bounded", 0.01, 1e3},
    {"10_g_on_100_kN_per_m_stays_bounded", 0.01, 1e5},
    {"1_kg_on_100_kN_per_m_stays_bounded", 1.0, 1e5},
    {"100_kg_on_1_kN_per_m_stays_bounded", 100.0, 1e3},
    {"100_kg_on_100_kN_per_m_stays_bounded", 100.0, 1e5},
};

/* A hand that goes to and fro by 10 cm, with a wall and a floor in the way. */
TEST_EACH(bounds, const bound_row *row)
{
  for (int i = 0; i < 2; ++i) {
    desk *d = desk_new(G, i == 0 ? HAP_MODEL_CONTACT : HAP_MODEL_SINGLE);
    dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.44);
    dCreatePlane(d->space, -1.0, 0.0, 0.0, -0.08);
    dBodyID body = box_add(d, row->mass);
    d->hand_def.stiffness = row->stiffness;
    d->hand_def.max_force = 20.0;
    d->hand_def.max_torque = 1.0;
    desk_run(d, 0.02, 0.01, 0.5);
    desk_hold(d, body, NULL);
    double fastest = 0.0;
    double hardest = 0.0;
    hap_pose last = pose_of(d, body);
    for (int k = 0; k < 4000; ++k) {
      double phase = 2.0 * M_PI * 1.5 * k * T;
      d->at[0] = 0.02 + 0.1 * sin(phase);
      d->at[2] = 0.5 - 0.05 * sin(2.0 * phase);
      d->velocity[0] = 0.1 * 2.0 * M_PI * 1.5 * cos(phase);
      d->velocity[2] = -0.05 * 4.0 * M_PI * 1.5 * cos(2.0 * phase);
      hand_lead(d);
      REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
      hap_pose pose = pose_of(d, body);
      hap_pointer_state state = desk_state(d);
      double way = 0.0;
      double force = 0.0;
      for (int c = 0; c < 3; ++c) {
        way += (pose.position[c] - last.position[c]) * (pose.position[c] - last.position[c]);
        force += state.wrench.force[c] * state.wrench.force[c];
      }
      fastest = fmax(fastest, sqrt(way) / T);
      hardest = fmax(hardest, sqrt(force));
      last = pose;
    }
    hap_stats stats = session_stats(d->session);
    printf("# model %d: %.2f m/s, %.1f N\n", i, fastest, hardest);
    CHECK(fastest < 8.0); /* 20 N pull 10 g for some ms */
    CHECK(hardest < 20.0 + 1e-6);
    CHECK(stats.faults.fault == 0);
    CHECK(fabs(last.position[0]) < 0.5 && last.position[2] > 0.3 && last.position[2] < 1.0);
  }
}

TEST(a_hand_that_leaps_takes_the_body_along_slowly)
{
  hap_pointer_settings settings;
  desk *d = desk_new(0.0, HAP_MODEL_CONTACT);
  dBodyID body = box_add(d, 0.5);
  desk_run(d, 0.0, 0.0, 0.5);
  desk_hold(d, body, NULL);
  desk_wait(d, 50);
  hap_pointer_settings_init(&settings, sizeof settings);
  REQUIRE(hap_pointer_settings_get(d->session, d->hand, &settings) == HAP_OK);
  settings.mask = HAP_SET_BASE | HAP_SET_TELEPORT;
  settings.pose_world_device.position[0] += 1.0;
  REQUIRE(hap_pointer_set(d->session, d->hand, &settings) == HAP_OK);
  double hardest = 0.0;
  for (int k = 0; k < 4000; ++k) {
    desk_wait(d, 1);
    hardest = fmax(hardest, fabs(desk_state(d).wrench.force[0]));
  }
  printf("# %.2f N\n", hardest);
  CHECK(hardest < 1.5 * 0.5 * sqrt(STIFFNESS * 0.5)); /* at 0.5 m/s */
  CHECK_NEAR(pose_of(d, body).position[0], 1.0, 1e-3);
  CHECK(desk_state(d).held == body);
}

/* ---- whatever an application does ---- */

#define STORM_BODIES 12

static uint32_t storm_next(uint32_t *io)
{
  *io = *io * 1664525u + 1013904223u;
  return *io >> 8;
}

/* Each has a place of its own: bodies that begin in each other are thrown by ODE itself. */
static double storm_x(uint32_t which)
{
  return 0.1 * (which % 4u) - 0.15;
}

static double storm_y(uint32_t which)
{
  uint32_t row = which / 4u;
  return 0.1 * row - 0.1;
}

static dBodyID storm_body(desk *d, uint32_t which, double height, uint32_t *io)
{
  double edge = 0.02 + 0.01 * (storm_next(io) % 6);
  double mass = 0.01 * pow(10.0, storm_next(io) % 4);
  return ode_box(d->world, d->space, mass, AT(edge, edge, edge),
                 AT(storm_x(which), storm_y(which), height));
}

/* Another one is there before one goes untold: at its address lockstep runs may differ. */
static void storm_replace(desk *d, uint32_t which, bool told, dBodyID bodies[STORM_BODIES],
                          uint32_t *io)
{
  dBodyID old = bodies[which];
  if (told) {
    CHECK(hap_session_forget_body(d->session, old) >= HAP_OK);
  } else {
    bodies[which] = storm_body(d, which, 0.5, io);
  }
  dGeomDestroy(dBodyGetFirstGeom(old));
  dBodyDestroy(old);
  if (told) {
    bodies[which] = storm_body(d, which, 0.5, io);
  }
}

static void storm_act(desk *d, hap_pointer_id hand, dBodyID bodies[STORM_BODIES], uint32_t *io)
{
  static const double scales[] = {1.0, 0.5, 1.0, 0.0};
  hap_grab_def def = grab_of();
  uint32_t which = storm_next(io) % STORM_BODIES;
  switch (storm_next(io) % 12) {
    case 0:
      CHECK(hap_pointer_release(d->session, hand) == HAP_OK);
      break;
    case 1:
      storm_replace(d, which, storm_next(io) % 2 == 0, bodies, io);
      break;
    case 2:
      dBodySetPosition(bodies[which], storm_x(which), storm_y(which), 0.7);
      break;
    case 3:
      CHECK(hap_session_set_time_scale(d->session, scales[storm_next(io) % 4]) == HAP_OK);
      break;
    case 4:
      CHECK(hap_session_set_model(
                d->session, storm_next(io) % 3 == 0 ? HAP_MODEL_IMPULSE : HAP_MODEL_CONTACT) ==
            HAP_OK);
      break;
    case 5:
      hap_session_reset_fault(d->session);
      CHECK(hap_pointer_clutch(d->session, hand, storm_next(io) % 2 == 0) == HAP_OK);
      break;
    default:
      def.place = storm_next(io) % 2;
      def.turns = storm_next(io) % 2;
      def.stiffness = storm_next(io) % 3 == 0 ? 1e9 : 0.0;
      def.max_force = storm_next(io) % 3 == 0 ? 1e6 : 0.0;
      (void)hap_pointer_attach(d->session, hand, bodies[which], &def);
      break;
  }
}

static uint64_t storm_run(uint32_t seed)
{
  hap_detail detail = {""};
  hap_device *devices[2] = {NULL, NULL};
  hap_pointer_id hands[2];
  dBodyID bodies[STORM_BODIES];
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.0);
  for (int i = 0; i < STORM_BODIES; ++i) {
    bodies[i] = storm_body(d, (uint32_t)i, 0.05, &seed);
  }
  d->session = session_make(&d->def, &d->ode);
  for (int i = 0; i < 2; ++i) {
    const char *spec = i == 0 ? "virtual:dof=6,path=0:0/0/0.2;1:0.2/0.1/0.05;2:-0.2/0/0.2;3:0/0/0.1"
                              : "virtual:path=0:0/0.1/0.1;1:-0.2/0/0.05;2:0.1/0/0.02;3:0/0/0.2";
    REQUIRE_SAY(hap_device_open(spec, &devices[i], &detail) == HAP_OK, "%s", detail.text);
    d->hand_def.device = devices[i];
    d->hand_def.max_force = 8.0;
    d->hand_def.stiffness = i == 0 ? 1e3 : 1e5;
    REQUIRE(hap_pointer_add(d->session, &d->hand_def, &hands[i]) == HAP_OK);
  }
  session_run(d->session);
  for (int k = 0; k < 4000; ++k) {
    if (storm_next(&seed) % 15 == 0 && k < 3900) { /* in the end all are known */
      storm_act(d, hands[k % 2], bodies, &seed);
    }
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    for (int i = 0; i < 2; ++i) {
      hap_pointer_state state;
      REQUIRE(hap_pointer_get(d->session, hands[i], &state, sizeof state) == HAP_OK);
      double force = sqrt(state.wrench.force[0] * state.wrench.force[0] +
                          state.wrench.force[1] * state.wrench.force[1] +
                          state.wrench.force[2] * state.wrench.force[2]);
      CHECK(force <= 8.0 + 1e-9); /* NaN is not */
    }
  }
  uint64_t hash = session_stats(d->session).loop.trace_hash;
  for (int i = 0; i < STORM_BODIES; ++i) {
    hap_pose pose = pose_of(d, bodies[i]);
    CHECK(fabs(pose.position[0]) < 20.0 && fabs(pose.position[2]) < 20.0);
  }
  CHECK(hap_session_stop(d->session) == HAP_OK);
  for (int i = 0; i < 2; ++i) {
    CHECK(hap_pointer_remove(d->session, hands[i]) == HAP_OK);
    hap_device_close(devices[i]);
  }
  tap_release(d);
  return hash;
}

TEST(a_storm_of_grabs_stays_bounded_and_repeats)
{
  for (uint32_t seed = 1; seed <= 6; ++seed) {
    uint64_t once = storm_run(seed);
    CHECK(storm_run(seed) == once);
  }
}

/* ---- on a device ---- */

/* A hand of the simulated device that lifts a body from the floor, carries it against a wall, and
 * puts it down. */
static hap_stats lift_on_device(desk *d, double mass, const char *device, double *out_step)
{
  hap_detail detail = {""};
  hap_device *hand = NULL;
  double before[3] = {0.0, 0.0, 0.0};
  dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.0);
  dCreatePlane(d->space, -1.0, 0.0, 0.0, -0.1);
  dBodyID body = ode_box(d->world, d->space, mass, AT(0.04, 0.04, 0.04), AT(0.0, 0.0, 0.02));
  REQUIRE_SAY(hap_device_open(device, &hand, &detail) == HAP_OK, "%s", detail.text);
  d->hand_def.device = hand;
  d->hand_def.max_force = 8.0;
  d->session = session_make(&d->def, &d->ode);
  REQUIRE(hap_pointer_add(d->session, &d->hand_def, &d->hand) == HAP_OK);
  session_run(d->session);
  REQUIRE(hap_session_advance(d->session, 300) >= HAP_OK);
  *out_step = 0.0;
  for (int k = 0; k < 3700; ++k) {
    if (k == 100) {
      REQUIRE(hap_pointer_attach(d->session, d->hand, body, NULL) >= HAP_OK);
    } else if (k == 3200) {
      CHECK(hap_pointer_release(d->session, d->hand) == HAP_OK);
    }
    REQUIRE(hap_session_advance(d->session, 1) >= HAP_OK);
    hap_pointer_state state = desk_state(d);
    double step = 0.0;
    for (int c = 0; c < 3; ++c) {
      double change = state.wrench.force[c] - before[c];
      step += change * change;
      before[c] = state.wrench.force[c];
    }
    *out_step = fmax(*out_step, sqrt(step));
    CHECK(state.held == (k >= 100 && k < 3215 ? body : state.held));
  }
  check_vector(before, 0.0, 0.0, 0.0, 0.5);
  hap_stats stats = session_stats(d->session);
  hap_session_stop(d->session);
  hap_pointer_remove(d->session, d->hand);
  hap_device_close(hand);
  return stats;
}

typedef struct device_row {
  const char *name;
  const char *device;
} device_row;

#define LIFT                                                                    \
  "virtual:path=0:0/0/0.08;0.3:0/0/0.05;0.5:0/0/0.05;1:0/0/0.1;1.5:0.09/0/0.1;" \
  "2:0.09/0/0.08;2.5:0/0/0.1;3:0/0/0.05;4:0/0/0.05,"

static const device_row lifts[] = {
    {"a_simulated_hand_lifts_a_body", LIFT "dof=3"},
    {"a_simulated_hand_lifts_and_turns_a_body",
     LIFT "dof=6,turn=0:0/0/0;1:0/0/0;1.5:0/0.5/0;2:0/0/0.7;2.5:0/0/0"},
    {"a_tense_hand_on_a_stiff_device_lifts_a_body",
     LIFT "dof=6,hand=tense,rated_stiffness=3000,device_damping=3,device_mass=0.1"},
    {"a_relaxed_hand_on_a_late_device_lifts_a_body",
     LIFT "dof=3,hand=relaxed,rated_stiffness=1500,device_damping=2,quantum=2e-5,delay=0.001"},
};

TEST_EACH(lifts, const device_row *row)
{
  const double masses[] = {0.02, 0.2, 0.6, 20.0};
  for (int i = 0; i < 4; ++i) {
    double step = 0.0;
    desk *d = desk_new(G, HAP_MODEL_CONTACT);
    hap_stats stats = lift_on_device(d, masses[i], row->device, &step);
    printf("# %g kg: step %.2f N, energy %llu, swings %llu ticks\n", masses[i], step,
           (unsigned long long)stats.faults.energy_ticks,
           (unsigned long long)stats.safety.oscillation_ticks);
    CHECK(stats.faults.fault == 0);
    CHECK(step < 4.0 + 1e-6); /* N a tick, the slew limit */
    CHECK(stats.safety.oscillation_ticks == 0);
    CHECK(stats.faults.energy_ticks < 30); /* of 3700: at the touch before */
  }
}

/* ---- recordings ---- */

static void grabbed_session(desk *d, dBodyID body)
{
  hap_grab_def def = grab_of();
  def.turns = HAP_GRAB_BALL;
  desk_glide(d, 0.0, 0.0, -0.03);
  desk_hold(d, body, NULL);
  desk_glide(d, 0.0, 0.0, 0.03);
  desk_glide(d, 0.03, 0.0, 0.02);
  CHECK(hap_pointer_release(d->session, d->hand) == HAP_OK);
  desk_glide(d, 0.0, 0.0, -0.06);
  desk_hold(d, body, &def);
  desk_glide(d, 0.0, 0.02, 0.02);
}

static dBodyID recorded_world(desk *d)
{
  dCreatePlane(d->space, 0.0, 0.0, 1.0, 0.0);
  (void)ode_box(d->world, d->space, 0.3, AT(0.1, 0.1, 0.02), AT(0.05, 0.0, 0.01));
  return ode_box(d->world, d->space, 0.2, AT(0.04, 0.04, 0.04), AT(0.0, 0.0, 0.04));
}

TEST(a_replay_holds_and_lets_go_in_the_same_ticks)
{
  hap_play_difference difference;
  hap_pointer_state again;
  desk *d = desk_new(G, HAP_MODEL_CONTACT);
  dBodyID body = recorded_world(d);
  desk_record(d, "grab.rec", 0.07);
  session_run(d->session);
  grabbed_session(d, body);
  CHECK(desk_state(d).held == body);
  CHECK(hap_session_stop(d->session) == HAP_OK);
  hap_pointer_state last = desk_state(d);
  hap_pointer_id hand = d->hand;
  tap_release(d);

  desk *r = desk_new(G, HAP_MODEL_CONTACT);
  body = recorded_world(r);
  desk_replay(r, "grab.rec");
  desk_play(r);
  CHECK(hap_pointer_attach(r->session, hand, body, NULL) == HAP_ERROR_STATE);
  CHECK(hap_pointer_release(r->session, hand) == HAP_ERROR_STATE);
  REQUIRE(hap_pointer_get(r->session, hand, &again, sizeof again) == HAP_OK);
  CHECK(again.held == body);
  CHECK(memcmp(&again.wrench, &last.wrench, sizeof last.wrench) == 0);
  CHECK(last.wrench.force[2] < 0.0);
  CHECK(hap_player_difference(r->player, &difference, sizeof difference) == HAP_OK);
  CHECK(difference.what == HAP_DIFFERENCE_NONE);
}
