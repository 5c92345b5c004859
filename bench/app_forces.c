/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/app_forces.h"

#include <math.h>
#include <string.h>

#include <hapode/grab.h>

#include "base/log.h"
#include "bench/app_stand.h"

#define PERIOD (1.0 / APP_HZ)
#define FINE 100 /* steps of a plain loop in a tick */
#define PI 3.14159265358979323846
#define G 9.81

/* ---- ways of the hand ---- */

typedef struct app_stop {
  double tick;
  double x;
  double z;
} app_stop;

/* From stop to stop, as slow at both ends as a cosine. */
static void hand_way(const app_stop *stops, size_t count, double tick, double at[3],
                     double velocity[3])
{
  size_t i = 0;
  while (i + 2 < count && tick >= stops[i + 1].tick) {
    ++i;
  }
  const app_stop *from = &stops[i];
  const app_stop *to = &stops[i + 1];
  double share = fmin((tick - from->tick) / (to->tick - from->tick), 1.0);
  double done = 0.5 * (1.0 - cos(PI * share));
  double pace = 0.5 * PI * sin(PI * share) / ((to->tick - from->tick) * PERIOD);
  at[0] = from->x + done * (to->x - from->x);
  at[1] = 0.0;
  at[2] = from->z + done * (to->z - from->z);
  velocity[0] = pace * (to->x - from->x);
  velocity[1] = 0.0;
  velocity[2] = pace * (to->z - from->z);
}

#define DEPTH 1e-3

static const app_stop slide_stops[] = {{0, 0.0, STAND_RADIUS + 0.02},
                                       {400, 0.0, STAND_RADIUS - DEPTH},
                                       {500, 0.0, STAND_RADIUS - DEPTH},
                                       {1100, 0.03, STAND_RADIUS - DEPTH},
                                       {1200, 0.03, STAND_RADIUS - DEPTH}};

static const app_stop medium_stops[] = {
    {0, -STAND_RADIUS - 0.005, 0.0}, {600, 0.05, 0.0}, {900, 0.02, 0.0}, {1200, 0.1, 0.0}};

#define EDGE 0.06
#define LAYER 1e-6 /* m: contacts rest anywhere within it, which is felt by the spring */
#define CUBES 3
#define TOP (CUBES * (EDGE - LAYER) + 0.5 * EDGE)
#define MU 0.5

static const app_stop stack_stops[] = {{0, 0.0, TOP + 0.02},       {300, 0.0, TOP + 0.02},
                                       {600, 0.0, TOP - 0.006},    {900, 0.0, TOP - 0.006},
                                       {1400, 0.012, TOP - 0.006}, {1600, 0.012, TOP - 0.006},
                                       {2000, 0.012, TOP + 0.02}};

static const struct {
  const char *word;
  double bound; /* 1 */
  bool is_plain;
  const app_stop *stops;
  size_t stop_count;
} cases[APP_CASES] = {
    [APP_SLIDE] = {"slide", 0.01, true, slide_stops, BENCH_COUNT(slide_stops)},
    [APP_RUB] = {"rub", 0.01, false, slide_stops, BENCH_COUNT(slide_stops)},
    [APP_MEDIUM] = {"medium", 0.005, true, medium_stops, BENCH_COUNT(medium_stops)},
    [APP_STACK] = {"stack", 0.01, true, stack_stops, BENCH_COUNT(stack_stops)},
};

const char *app_case_word(app_case which)
{
  return cases[which].word;
}

double app_case_bound(app_case which)
{
  return cases[which].bound;
}

bool app_case_is_plain(app_case which)
{
  return cases[which].is_plain;
}

static size_t case_ticks(app_case which)
{
  return (size_t)cases[which].stops[cases[which].stop_count - 1].tick;
}

/* ---- what both have ---- */

#define WAVE 2e-3   /* m */
#define HEIGHT 1e-4 /* m */
#define TURN (2.0 * PI / WAVE)
#define BLOCK_MASS 0.1
#define FREE_MASS 0.5
#define FREE_DAMPING 5.0
#define MEDIUM 6.0 /* N s/m */
#define HOLD_DAMPING 10.0
#define LEVER2 (0.05 * 0.05) /* m^2: docs/grab.md */

static double wave_height(void *arg, const double point[3])
{
  (void)arg;
  return HEIGHT * sin(TURN * point[0]);
}

static dBodyID stack_add(dWorldID world, dSpaceID space)
{
  dCreatePlane(space, 0.0, 0.0, 1.0, 0.0);
  dWorldSetContactSurfaceLayer(world, LAYER);
  dWorldSetQuickStepNumIterations(world, 200);
  const double edges[3] = {EDGE, EDGE, EDGE};
  for (int i = 0; i <= CUBES; ++i) {
    double top = i == CUBES ? TOP + 0.02 : i * (EDGE - LAYER) + 0.5 * EDGE - LAYER;
    dBodyID body =
        stand_box(world, space, i == CUBES ? 0.2 : 0.3, edges, (double[3]){0.0, 0.0, top});
    if (i == CUBES) {
      return body;
    }
  }
  return NULL;
}

/* ---- in a session ---- */

static bool rough_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mu = MU;
  return true;
}

static bool icy_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mu = 0.0;
  return true;
}

static dBodyID slide_build(app_stand *s, bool on_rail)
{
  const double edges[3] = {0.2, 0.2, 0.1};
  dBodyID block = stand_box(s->world, s->space, on_rail ? BLOCK_MASS : 0.3, edges,
                            (double[3]){0.0, 0.0, -0.05});
  if (on_rail) {
    dJointID rail = dJointCreateSlider(s->world, NULL);
    dJointAttach(rail, block, NULL);
    dJointSetSliderAxis(rail, 1.0, 0.0, 0.0);
  } else {
    dCreatePlane(s->space, 0.0, 0.0, 1.0, -0.1);
    s->ode.surface = icy_surface;
  }
  s->says = (hap_surface){.size = sizeof s->says,
                          .touchable = 1,
                          .stiffness = STAND_STIFFNESS,
                          .friction_static = on_rail ? 0.0 : 0.2,
                          .friction_dynamic = on_rail ? 0.0 : 0.2};
  return block;
}

/* The block in a medium, or the cube over the stack. */
static dBodyID case_build(app_stand *s, app_case which)
{
  if (which == APP_MEDIUM) {
    const double edges[3] = {0.1, 0.1, 0.1};
    s->hand_def.damping = FREE_DAMPING;
    return stand_box(s->world, s->space, FREE_MASS, edges, (double[3]){0.05, 0.0, 0.0});
  }
  if (which == APP_STACK) {
    s->ode.surface = rough_surface;
    return stack_add(s->world, s->space);
  }
  return slide_build(s, which == APP_SLIDE);
}

static hap_status texture_add(app_stand *s)
{
  hap_texture_def def;
  hap_texture_def_init(&def, sizeof def);
  def.height = wave_height;
  return hap_session_add_texture(s->session, &def, &s->says.texture);
}

static hap_status medium_add(app_stand *s)
{
  hap_force_id id;
  hap_force_def def;
  hap_force_def_init(&def, sizeof def);
  def.kind = HAP_FORCE_VISCOUS;
  def.damping = MEDIUM;
  def.fade_in_s = 0.0;
  return hap_pointer_force_add(s->session, s->hand, &def, &id);
}

static hap_status body_take(app_stand *s, dBodyID body)
{
  hap_grab_def def;
  hap_grab_def_init(&def, sizeof def);
  def.damping = HOLD_DAMPING;
  def.turn_damping = LEVER2 * HOLD_DAMPING;
  return hap_pointer_attach(s->session, s->hand, body, &def);
}

static hap_status case_start(app_stand *s, app_case which, dBodyID body)
{
  hap_status status = HAP_OK;
  HAPI_TRY(stand_open(s));
  if (which == APP_SLIDE || which == APP_RUB) {
    status = texture_add(s);
  } else if (which == APP_MEDIUM) {
    status = medium_add(s);
  }
  HAPI_TRY(bench_explain(s->bench, s->session, status));
  HAPI_TRY(stand_run(s));
  status = which == APP_STACK ? body_take(s, body) : HAP_OK;
  return bench_explain(s->bench, s->session, status);
}

static hap_status case_record(app_stand *s, app_case which, app_trace *out)
{
  out->count = case_ticks(which);
  for (size_t i = 0; i < out->count; ++i) {
    hand_way(cases[which].stops, cases[which].stop_count, (double)i, s->at, s->velocity);
    HAPI_TRY(stand_tick(s));
    memcpy(out->force[i], s->felt.wrench.force, sizeof out->force[i]);
  }
  return HAP_OK;
}

hap_status app_case_run(bench *b, app_case which, hap_model model, double physics_hz,
                        app_trace *out)
{
  app_stand s;
  stand_init(b, &s, which == APP_STACK || which == APP_RUB ? G : 0.0);
  s.def.model = model;
  s.def.physics_hz = physics_hz;
  dBodyID body = case_build(&s, which);
  hand_way(cases[which].stops, cases[which].stop_count, 0.0, s.at, s.velocity);
  hap_status status = case_start(&s, which, body);
  status = status == HAP_OK ? case_record(&s, which, out) : status;
  stand_finish(&s);
  return status;
}

/* ---- without this library ---- */

/* Along x alone, at 100 steps a tick. The force of a tick is that at the tick's begin. */
static void block_run_plain(app_case which, app_trace *out)
{
  dMass mass;
  dWorldID world = dWorldCreate();
  dBodyID block = dBodyCreate(world);
  dMassSetBoxTotal(&mass, which == APP_SLIDE ? BLOCK_MASS : FREE_MASS, 0.1, 0.1, 0.1);
  dBodySetMass(block, &mass);
  out->count = case_ticks(which);
  for (size_t i = 0; i < out->count * FINE; ++i) {
    double at[3];
    double velocity[3];
    hand_way(cases[which].stops, cases[which].stop_count, (double)i / FINE, at, velocity);
    double x = at[0] - dBodyGetPosition(block)[0]; /* of the hand in the block */
    double felt[3] = {0.0, 0.0, 0.0};
    double push = 0.0; /* on the block */
    if (which == APP_SLIDE) {
      double load = fmax(STAND_STIFFNESS * (STAND_RADIUS - at[2] + HEIGHT * sin(TURN * x)), 0.0);
      push = load * HEIGHT * TURN * cos(TURN * x);
      felt[2] = load;
      felt[0] = -push;
    } else {
      double depth = x + STAND_RADIUS; /* the block's face is at its x */
      double closing = velocity[0] - dBodyGetLinearVel(block)[0];
      push = depth > 0.0 ? fmax(STAND_STIFFNESS * depth + FREE_DAMPING * closing, 0.0) : 0.0;
      felt[0] = -push - MEDIUM * velocity[0];
    }
    if (i % FINE == 0) {
      memcpy(out->force[i / FINE], felt, sizeof felt);
    }
    dBodyAddForce(block, push, 0.0, 0.0);
    dWorldStep(world, PERIOD / FINE);
  }
  dWorldDestroy(world);
}

typedef struct plain_loop {
  dWorldID world;
  dSpaceID space;
  dJointGroupID contacts;
} plain_loop;

#define PLAIN_CONTACTS 8

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
  const dReal *x = dBodyGetPosition(body);
  const dReal *v = dBodyGetLinearVel(body);
  const dReal *q = dBodyGetQuaternion(body);
  const dReal *w = dBodyGetAngularVel(body);
  const double turn = LEVER2 * STAND_STIFFNESS * (q[0] < 0.0 ? 2.0 : -2.0);
  const double brake = LEVER2 * HOLD_DAMPING;
  for (int c = 0; c < 3; ++c) {
    out[c] = -share * (STAND_STIFFNESS * (at[c] - x[c]) + HOLD_DAMPING * (velocity[c] - v[c]));
  }
  dBodyAddForce(body, -out[0], -out[1], -out[2]);
  dBodyAddTorque(body, share * (turn * q[1] - brake * w[0]), share * (turn * q[2] - brake * w[1]),
                 share * (turn * q[3] - brake * w[2]));
}

/* Of QuickStep at 1 kHz. The grip comes in over 20 ms. */
static void stack_run_plain(app_trace *out)
{
  plain_loop p = {.world = dWorldCreate(), .space = dHashSpaceCreate(NULL)};
  dWorldSetGravity(p.world, 0.0, 0.0, -G);
  dWorldSetCFM(p.world, 1e-12);
  p.contacts = dJointGroupCreate(0);
  dBodyID body = stack_add(p.world, p.space);
  out->count = case_ticks(APP_STACK);
  for (size_t i = 0; i < out->count; ++i) {
    double at[3];
    double velocity[3];
    hand_way(stack_stops, BENCH_COUNT(stack_stops), (double)i, at, velocity);
    dSpaceCollide(p.space, &p, plain_meet);
    plain_pull(body, fmin(((double)i + 1.0) / 20.0, 1.0), at, velocity, out->force[i]);
    dWorldQuickStep(p.world, PERIOD);
    dJointGroupEmpty(p.contacts);
  }
  dJointGroupDestroy(p.contacts);
  dSpaceDestroy(p.space);
  dWorldDestroy(p.world);
}

void app_case_run_plain(app_case which, app_trace *out)
{
  if (which == APP_STACK) {
    stack_run_plain(out);
  } else {
    block_run_plain(which, out);
  }
}

double app_trace_error(const app_trace *a, const app_trace *reference)
{
  double apart = 0.0;
  double all = 0.0;
  for (size_t i = 100; i < reference->count; ++i) { /* a grip begins, and the contacts' ramp */
    for (int c = 0; c < 3; ++c) {
      double off = a->force[i][c] - reference->force[i][c];
      apart += off * off;
      all += reference->force[i][c] * reference->force[i][c];
    }
  }
  return sqrt(apart / all);
}
