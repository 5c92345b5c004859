/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Two hands on one cube, each in a session of its own: squeeze, push and tap, by hands that are
 * tense, relaxed or rigid, at 0 to 100 ms one way. The reference is both hands in the world's
 * session. */

#include "tests/tap.h"

#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/hands_rig.h"

#define EDGE 0.1        /* m */
#define MASS 1.0        /* kg */
#define STIFFNESS 2e3   /* N/m */
#define RADIUS 0.01     /* m */
#define HAND_MASS 0.3   /* kg */
#define JOIN_TICKS 1500 /* until everybody knows the cube */
#define TICKS 3000      /* of the motion */
#define AFTER_TICKS 1000

static bool cube_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  *io = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.3};
  return true;
}

typedef enum task {
  SQUEEZE,
  PUSH,
  TAP
} task;

/* How a hand holds on to where it wants to be: a mass behind spring and damper; rigid: it is there.
 */
typedef struct grip {
  const char *name;
  double stiffness; /* N/m; 0: rigid */
  double damping;   /* N s/m */
} grip;

static const grip grips[] = {{"tense", 1000.0, 20.0}, {"relaxed", 200.0, 8.0}, {"rigid", 0.0, 0.0}};

/* Along x, in from both sides; hand 1 is at +x. m, from the cube's side as it stood first. */
static double hand_wish(task what, int which, double s)
{
  double side = which == 0 ? -1.0 : 1.0;
  double out = 0.02; /* clear of it */
  double at = side * out;
  double rise = s < 0.0 ? 0.0 : fmin(s / 0.3, 1.0);
  rise = rise * rise * (3.0 - 2.0 * rise);
  double fall = s < 2.0 ? 0.0 : fmin((s - 2.0) / 0.3, 1.0);
  fall = fall * fall * (3.0 - 2.0 * fall);
  switch (what) {
    case SQUEEZE: /* both 3 mm in; hand 0 a little later */
      return at - side * (out + 0.003) * (rise - fall);
    case PUSH: /* hand 0 pushes to and fro by 3 cm, hand 1 stays against it */
      return at - side * (out + 0.002) * (rise - fall) +
             (s > 0.5 && s < 2.0 ? 0.015 * (1.0 - cos(2.0 * M_PI * (s - 0.5) / 1.5)) : 0.0);
    case TAP: { /* in turn, 2 Hz */
      double phase = 2.0 * M_PI * 2.0 * s + (which == 0 ? 0.0 : M_PI);
      double in = s > 0.0 && s < 2.0 ? fmax(sin(phase), 0.0) : 0.0;
      return at - side * (out + 0.002) * in * in;
    }
  }
  return at;
}

typedef struct pair_run {
  hands_rig *rig;
  dBodyID cube;
  double at[2]; /* m, of the hands along x */
  double v[2];
  double felt[2][JOIN_TICKS + TICKS + AFTER_TICKS];
  double place[JOIN_TICKS + TICKS + AFTER_TICKS];
  double apart; /* m, of the copies and the world's cube, the most */
  double left;  /* m, half a second after the last touch */
  int touched;  /* tick of that */
} pair_run;

static void run_finish(void *owned)
{
  (void)owned;
}

static pair_run *run_new(double delay)
{
  pair_run *run = tap_own(sizeof *run, run_finish);
  hap_pointer_def hand;
  hands_rig *r = run->rig = rig_new(delay, 4);
  dCreatePlane(r->space, 0.0, 0.0, 1.0, 0.0);
  run->cube = ode_box(r->world, r->space, MASS, AT(EDGE, EDGE, EDGE), AT(0.0, 0.0, 0.5 * EDGE));
  rig_serve(r, cube_surface);
  hap_pointer_def_init(&hand, sizeof hand);
  hand.radius = RADIUS;
  hand.stiffness = STIFFNESS;
  hand.friction = 0.5;
  if (delay >= 0.0) {
    session_run(r->session);
  }
  for (int i = 0; i < 2; ++i) {
    rig_join(r, i, &hand);
    run->at[i] = (i == 0 ? -1.0 : 1.0) * 0.02;
  }
  if (delay < 0.0) {
    session_run(r->session);
  }
  return run;
}

/* A tick: the hands go on by what they want and feel. */
static void run_tick(pair_run *run, task what, const grip *g, int tick)
{
  const double dt = 1e-3;
  for (int i = 0; i < 2; ++i) {
    double side = i == 0 ? -1.0 : 1.0;
    double s = 1e-3 * (tick - JOIN_TICKS);
    double wish = hand_wish(what, i, s);
    double v = (hand_wish(what, i, s + 1e-3) - wish) / dt;
    if (g->stiffness > 0.0) {
      double felt = tick > 0 ? run->felt[i][tick - 1] : 0.0;
      double pull = g->stiffness * (wish - run->at[i]) + g->damping * (v - run->v[i]) + felt;
      run->v[i] += dt * pull / HAND_MASS;
      run->at[i] += dt * run->v[i];
    } else {
      run->at[i] = wish;
      run->v[i] = v;
    }
    double x = side * (0.5 * EDGE + RADIUS) + run->at[i];
    rig_put(run->rig, i, AT(x, 0.0, 0.5 * EDGE), AT(run->v[i], 0.0, 0.0));
  }
  rig_tick(run->rig);
  for (int i = 0; i < 2; ++i) {
    double force[3];
    rig_feel(run->rig, i, force);
    run->felt[i][tick] = force[0];
  }
  run->place[tick] = dBodyGetPosition(run->cube)[0];
}

/* m, of the cube in the hand's session; NaN: it is not there. */
static void copy_place(const pair_run *run, int which, double out[3])
{
  const hapi_bodies *bodies = &run->rig->hands[which].session->haptic->tick.bodies;
  out[0] = (double)NAN;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    if ((body->flags & HAPI_BODY_OWNED) != 0) {
      hapi_v3_copy(body->pose.position, out);
    }
  }
}

static void run_compare(pair_run *run, int tick)
{
  const dReal *world = dBodyGetPosition(run->cube);
  double most = 0.0;
  double at[2][3];
  for (int i = 0; i < 2; ++i) {
    copy_place(run, i, at[i]);
    double way[3];
    hapi_v3_sub(at[i], world, way);
    most = fmax(most, hapi_v3_norm(way));
    run->touched = run->felt[i][tick] != 0.0 ? tick : run->touched;
  }
  double way[3];
  hapi_v3_sub(at[0], at[1], way);
  most = fmax(most, hapi_v3_norm(way));
  run->apart = tick >= JOIN_TICKS ? fmax(run->apart, most) : 0.0;
  if (tick == run->touched + 500) {
    run->left = most;
  }
}

static double peak_of(const double *felt)
{
  double peak = 0.0;
  for (int i = JOIN_TICKS; i < JOIN_TICKS + TICKS; ++i) {
    peak = fmax(peak, fabs(felt[i]));
  }
  return peak;
}

/* RMS of the difference to RMS of the reference. */
static double error_of(const double *felt, const double *reference)
{
  double sums[2] = {0.0, 0.0};
  for (int i = JOIN_TICKS; i < JOIN_TICKS + TICKS; ++i) {
    sums[0] += (felt[i] - reference[i]) * (felt[i] - reference[i]);
    sums[1] += reference[i] * reference[i];
  }
  return sqrt(sums[0] / sums[1]);
}

typedef struct shared_case {
  const char *name;
  task what;
} shared_case;

static const shared_case tasks[] = {{"squeeze", SQUEEZE}, {"push", PUSH}, {"tap", TAP}};

TEST_EACH(tasks, const shared_case *row)
{
  static const double delays[] = {0.0, 0.01, 0.05, 0.1};
  for (int g = 0; g < 3; ++g) {
    pair_run *reference = run_new(-1.0);
    for (int i = 0; i < JOIN_TICKS + TICKS + AFTER_TICKS; ++i) {
      run_tick(reference, row->what, &grips[g], i);
    }
    for (int d = 0; d < 4; ++d) {
      pair_run *run = run_new(delays[d]);
      for (int i = 0; i < JOIN_TICKS + TICKS + AFTER_TICKS; ++i) {
        run_tick(run, row->what, &grips[g], i);
        run_compare(run, i);
      }
      double errors[2];
      double ratios[2];
      for (int i = 0; i < 2; ++i) {
        errors[i] = error_of(run->felt[i], reference->felt[i]);
        ratios[i] = peak_of(run->felt[i]) / peak_of(reference->felt[i]);
      }
      hap_remote_state state = rig_state(run->rig->session);
      printf("# %s, %s, %3.0f ms: errors %.2f %.2f, peaks %.2f %.2f of %.1f %.1f N; cube %.1f mm, "
             "%.1f; apart %.1f mm, left %.2f mm\n",
             row->name, grips[g].name, 1e3 * delays[d], errors[0], errors[1], ratios[0], ratios[1],
             peak_of(reference->felt[0]), peak_of(reference->felt[1]), 1e3 * run->place[4000],
             1e3 * reference->place[4000], 1e3 * run->apart, 1e3 * run->left);
      CHECK(state.bounded == 0 && state.refused == 0 && state.failed == 0);
      CHECK(fmax(ratios[0], ratios[1]) <= 3.5);
      CHECK(delays[d] > 0.01 || fmax(errors[0], errors[1]) <= 0.4);
      tap_release(run->rig);
      tap_release(run);
    }
    tap_release(reference->rig);
    tap_release(reference);
  }
}
