/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/remote_hands.h"

#include <math.h>
#include <string.h>

#include <hapode/hapode.h>
#include <hapode/ode.h>

#include "base/vec.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tools/session_defs.h"

#define PERIOD 1e-3      /* s */
#define EDGE 0.1         /* m */
#define MASS 1.0         /* kg */
#define FRICTION 0.3     /* on the floor */
#define STIFFNESS 2000.0 /* N/m, of the pointers */
#define RADIUS 0.01      /* m */
#define HAND_MASS 0.3    /* kg */
#define CLEAR 0.02       /* m, from the cube to the hands at first */
#define IN 0.002         /* m, of hands that press */
#define RISE_S 0.3
#define END_S 2.0
#define AFTER_TICKS 500

const char *const remote_tasks[3] = {"squeeze", "push", "tap"};
const char *const remote_grips[3] = {"tense", "relaxed", "rigid"};

typedef struct hand_grip {
  double stiffness; /* N/m; 0: rigid */
  double damping;   /* N s/m */
} hand_grip;

static const hand_grip hand_grips[3] = {{1000.0, 20.0}, {200.0, 8.0}, {0.0, 0.0}};

/* ---- the worlds ---- */

typedef struct hands_side {
  dWorldID world;
  dSpaceID space;
  hap_session *session;
  hap_link *link;
} hands_side;

typedef struct hands_stage {
  const remote_hands *run;
  hap_detail *detail;
  hands_side server;
  hands_side clients[REMOTE_HANDS];
  dBodyID cube;
  hap_pointer_id ids[REMOTE_HANDS];
  double at[REMOTE_HANDS]; /* m, along the line, out of the cube's side at first */
  double v[REMOTE_HANDS];
} hands_stage;

static bool cube_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){.mode = dContactApprox1, .mu = FRICTION};
  return true;
}

static bool is_here(const remote_hands *run)
{
  return run->delay_s < 0.0;
}

static hap_session *hand_session(const hands_stage *stage, int which)
{
  return is_here(stage->run) ? stage->server.session : stage->clients[which].session;
}

static void side_world(hands_side *side)
{
  side->world = dWorldCreate();
  side->space = dHashSpaceCreate(NULL);
}

static hap_status side_create(const hands_stage *stage, hands_side *side)
{
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  session_defs_init(&def, &expert, &research);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = 60.0;
  def.model = stage->run->delay_s == REMOTE_HANDS_ODE ? HAP_MODEL_SINGLE : HAP_MODEL_CONTACT;
  research.guard = HAP_GUARD_MEASURE; /* the force before it is the one to compare */
  def.max_bodies = 8;
  def.max_contacts = 64;
  expert.look_ahead = is_here(stage->run) ? 0.0 : 2.0 * stage->run->delay_s + 0.05;
  hap_ode_def_init(&ode, sizeof ode);
  ode.world = side->world;
  ode.space = side->space;
  ode.surface = cube_surface;
  return hap_session_create(&def, &ode, &side->session, stage->detail);
}

static hap_status server_open(hands_stage *stage)
{
  hands_side *side = &stage->server;
  dMass mass;
  side_world(side);
  dWorldSetGravity(side->world, 0.0, 0.0, -9.81);
  dWorldSetCFM(side->world, 1e-12);
  dWorldSetContactSurfaceLayer(side->world, 1e-4);
  dWorldSetQuickStepNumIterations(side->world,
                                  stage->run->delay_s == REMOTE_HANDS_ODE ? 1000 : 100);
  dCreatePlane(side->space, 0.0, 0.0, 1.0, 0.0);
  stage->cube = dBodyCreate(side->world);
  dMassSetBoxTotal(&mass, MASS, EDGE, EDGE, EDGE);
  dBodySetMass(stage->cube, &mass);
  dBodySetPosition(stage->cube, 0.0, 0.0, 0.5 * EDGE);
  dGeomSetBody(dCreateBox(side->space, EDGE, EDGE, EDGE), stage->cube);
  hap_status status = side_create(stage, side);
  if (status >= HAP_OK && !is_here(stage->run)) {
    status = hap_link_local_serve(&side->link, stage->detail);
    status = status < HAP_OK ? status : hap_session_serve(side->session, side->link);
  }
  return status;
}

static hap_status client_open(hands_stage *stage, int which)
{
  static const char *const names[REMOTE_HANDS] = {"left", "right"};
  hands_side *side = &stage->clients[which];
  hap_link_path_def path;
  hap_link_path_def_init(&path, sizeof path);
  path.delay = stage->run->delay_s;
  path.seed = (uint64_t)which + 1;
  side_world(side);
  hap_status status = side_create(stage, side);
  if (status >= HAP_OK) {
    status = hap_link_local_connect(stage->server.link, names[which], &path, &path, &side->link,
                                    stage->detail);
  }
  return status < HAP_OK ? status : hap_session_connect(side->session, side->link);
}

static hap_status hand_open(hands_stage *stage, int which)
{
  hap_pointer_def def;
  hap_pointer_def_init(&def, sizeof def);
  def.radius = RADIUS;
  def.stiffness = STIFFNESS;
  def.friction = 0.5;
  hap_status status = is_here(stage->run) ? HAP_OK : client_open(stage, which);
  return status < HAP_OK ? status
                         : hap_pointer_add(hand_session(stage, which), &def, &stage->ids[which]);
}

static void side_close(const hands_side *side)
{
  hap_session_destroy(side->session);
  hap_link_close(side->link);
  if (side->world != NULL) {
    while (dSpaceGetNumGeoms(side->space) > 0) {
      dGeomDestroy(dSpaceGetGeom(side->space, 0));
    }
    dSpaceDestroy(side->space);
    dWorldDestroy(side->world);
  }
}

/* ---- the hands ---- */

static double share_smooth(double share)
{
  double s = hapi_clamp(share, 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

/* m, out of the cube's side, where the hand wants to be; s: since the begin. */
static double hand_wish(remote_task task, int which, double s)
{
  double in = share_smooth(s / RISE_S) - share_smooth((s - END_S) / RISE_S);
  double pushed = s > 0.5 && s < END_S ? 0.015 * (1.0 - cos(2.0 * M_PI * (s - 0.5) / 1.5)) : 0.0;
  double wave = s > 0.0 && s < END_S ? sin(2.0 * M_PI * 2.0 * s + M_PI * which) : 0.0;
  double taps = wave > 0.0 ? wave * wave : 0.0;
  switch (task) {
    case REMOTE_SQUEEZE:
      return CLEAR - (CLEAR + 1.5 * IN) * in;
    case REMOTE_PUSH: /* both move along +x, where hand 1 is */
      return CLEAR - (CLEAR + IN) * in + (which == 0 ? -pushed : pushed);
    case REMOTE_TAP:
      return CLEAR - (CLEAR + IN) * taps;
  }
  return CLEAR;
}

static void hand_move(hands_stage *stage, int which, int tick, double felt)
{
  const hand_grip *grip = &hand_grips[stage->run->grip];
  double s = PERIOD * (tick - REMOTE_HANDS_BEGIN);
  double wish = hand_wish(stage->run->task, which, s);
  double speed = (hand_wish(stage->run->task, which, s + PERIOD) - wish) / PERIOD;
  double *at = &stage->at[which];
  double *v = &stage->v[which];
  if (grip->stiffness > 0.0) {
    *v +=
        PERIOD / HAND_MASS * (grip->stiffness * (wish - *at) + grip->damping * (speed - *v) + felt);
    *at += PERIOD * *v;
  } else {
    *at = wish;
    *v = speed;
  }
}

static double side_of(int which)
{
  return which == 0 ? -1.0 : 1.0;
}

static hap_status hand_put(const hands_stage *stage, int which)
{
  double side = side_of(which);
  const hap_pose pose = {{side * (0.5 * EDGE + RADIUS + stage->at[which]), 0.0, 0.5 * EDGE},
                         {1.0, 0.0, 0.0, 0.0}};
  const hap_twist twist = {{side * stage->v[which], 0.0, 0.0}, {0.0, 0.0, 0.0}};
  return hap_pointer_set_target(hand_session(stage, which), stage->ids[which], &pose, &twist);
}

/* ---- the copies ---- */

/* False: the hand's session has none. */
static bool copy_place(const hands_stage *stage, int which, double out[3])
{
  const hapi_bodies *bodies = &stage->clients[which].session->haptic->tick.bodies;
  bool found = false;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    if ((body->flags & HAPI_BODY_OWNED) != 0) {
      hapi_v3_copy(body->pose.position, out);
      found = true;
    }
  }
  return found;
}

static double places_apart(const hands_stage *stage)
{
  double places[REMOTE_HANDS + 1][3];
  double most = 0.0;
  int count = 1;
  hapi_v3_copy(dBodyGetPosition(stage->cube), places[0]);
  for (int i = 0; i < REMOTE_HANDS && !is_here(stage->run); ++i) {
    count += copy_place(stage, i, places[count]);
  }
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < i; ++k) {
      double way[3];
      hapi_v3_sub(places[i], places[k], way);
      most = fmax(most, hapi_v3_norm(way));
    }
  }
  return most;
}

/* ---- the run ---- */

static hap_status stage_tick(hands_stage *stage, remote_hands *run, int tick)
{
  hap_status status = HAP_OK;
  for (int i = 0; i < REMOTE_HANDS && status >= HAP_OK; ++i) {
    double before = tick > 0 ? run->felt[i][tick - 1] : 0.0;
    hand_move(stage, i, tick, before);
    status = hand_put(stage, i);
    if (status >= HAP_OK && !is_here(run)) {
      status = hap_session_advance(stage->clients[i].session, 1);
    }
  }
  status = status < HAP_OK ? status : hap_session_advance(stage->server.session, 1);
  for (int i = 0; i < REMOTE_HANDS && status >= HAP_OK; ++i) {
    hap_pointer_state state;
    status = hap_pointer_get(hand_session(stage, i), stage->ids[i], &state, sizeof state);
    run->felt[i][tick] = side_of(i) * state.wrench.force[0];
  }
  return status;
}

static hap_status figures_take(const hands_stage *stage, remote_hands *run)
{
  hap_remote_state world;
  hap_remote_state hand;
  if (is_here(run)) {
    return HAP_OK;
  }
  hap_status status = hap_session_remote_state(stage->server.session, &world, sizeof world, NULL);
  status = status < HAP_OK
               ? status
               : hap_session_remote_state(stage->clients[0].session, &hand, sizeof hand, NULL);
  if (status >= HAP_OK) {
    double seconds = PERIOD * REMOTE_HANDS_TICKS;
    run->bytes_down = (double)hand.figures.received_bytes / seconds;
    run->bytes_up = (double)hand.figures.sent_bytes / seconds;
    run->refused = world.refused + world.failed + world.bounded + hand.refused + hand.failed;
  }
  return status;
}

static hap_status stage_run(hands_stage *stage, remote_hands *run)
{
  hap_status status = server_open(stage);
  int touched = 0;
  for (int i = 0; i < REMOTE_HANDS && status >= HAP_OK; ++i) {
    stage->at[i] = CLEAR;
    status = hand_open(stage, i);
  }
  status = status < HAP_OK ? status : hap_session_start(stage->server.session);
  for (int i = 0; i < REMOTE_HANDS && status >= HAP_OK && !is_here(run); ++i) {
    status = hap_session_start(stage->clients[i].session);
  }
  run->apart = run->left = 0.0;
  for (int tick = 0; tick < REMOTE_HANDS_TICKS && status >= HAP_OK; ++tick) {
    status = stage_tick(stage, run, tick);
    double apart = places_apart(stage);
    touched = run->felt[0][tick] != 0.0 || run->felt[1][tick] != 0.0 ? tick : touched;
    run->apart = tick < REMOTE_HANDS_BEGIN ? 0.0 : fmax(run->apart, apart);
    run->left = tick < touched + AFTER_TICKS ? 0.0 : fmax(run->left, apart);
  }
  run->place = stage->cube != NULL ? dBodyGetPosition(stage->cube)[0] : 0.0;
  return status < HAP_OK ? status : figures_take(stage, run);
}

hap_status remote_hands_run(remote_hands *run, hap_detail *detail)
{
  hands_stage stage = {.run = run, .detail = detail};
  detail->text[0] = '\0';
  hap_status status = stage_run(&stage, run);
  if (status < HAP_OK && detail->text[0] == '\0' && stage.server.session != NULL) {
    (void)hap_session_detail(stage.server.session, detail);
  }
  for (int i = 0; i < REMOTE_HANDS; ++i) {
    side_close(&stage.clients[i]);
  }
  side_close(&stage.server);
  return status;
}

/* ---- what is held against the reference ---- */

double remote_hands_error(const remote_hands *run, const remote_hands *reference)
{
  double worst = 0.0;
  for (int i = 0; i < REMOTE_HANDS; ++i) {
    double sums[2] = {0.0, 0.0};
    for (int k = REMOTE_HANDS_BEGIN; k < REMOTE_HANDS_TICKS; ++k) {
      double apart = run->felt[i][k] - reference->felt[i][k];
      sums[0] += apart * apart;
      sums[1] += reference->felt[i][k] * reference->felt[i][k];
    }
    worst = fmax(worst, sqrt(sums[0] / sums[1]));
  }
  return worst;
}

static double peak_of(const double *felt)
{
  double peak = 0.0;
  for (int i = REMOTE_HANDS_BEGIN; i < REMOTE_HANDS_TICKS; ++i) {
    peak = fmax(peak, fabs(felt[i]));
  }
  return peak;
}

double remote_hands_peak(const remote_hands *run, const remote_hands *reference)
{
  return fmax(peak_of(run->felt[0]) / peak_of(reference->felt[0]),
              peak_of(run->felt[1]) / peak_of(reference->felt[1]));
}
