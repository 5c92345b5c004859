/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Two hands on one cube, each in a session of its own: squeeze, push and tap, by hands that are
 * tense, relaxed or rigid, at 0 to 100 ms one way. The reference is both hands in the world's
 * session. */

#include "tests/tap.h"

#include "haptic/haptic_internal.h"
#include "physics/physics_internal.h"
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
      printf(
          "# %s, %s, %3.0f ms: errors %.2f %.2f, peaks %.2f %.2f of %.1f %.1f N; cube %.1f mm, "
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

/* ---- hands that come near and go ---- */

/* Hand 0 presses on the top from above, 3 mm in, and takes the cube along; the other one comes near
 * and goes again. */
TEST(a_hand_that_comes_near_and_goes_is_not_felt)
{
  static const double delays[] = {0.0, 0.05, 0.1};
  for (int d = 0; d < 3; ++d) {
    pair_run *run = run_new(delays[d]);
    hands_rig *r = run->rig;
    double before[3] = {0.0};
    double step = 0.0;
    double least = HUGE_VAL;
    for (int i = 0; i < 9000; ++i) {
      double s = 1e-3 * i;
      double z = EDGE + RADIUS + fmax(0.05 - 0.1 * fmax(s - 1.0, 0.0), -0.003);
      double far = s < 4.0   ? 5.0
                   : s < 6.0 ? fmax(5.0 - 3.0 * (s - 4.0), 0.4)
                             : fmin(0.4 + 3.0 * (s - 6.0), 5.0);
      double v = s > 4.0 && far > 0.4 && far < 5.0 ? (s < 6.0 ? -3.0 : 3.0) : 0.0;
      rig_put(r, 0, AT(0.0, 0.0, z), AT(0.0, 0.0, 0.0));
      rig_put(r, 1, AT(far, 0.0, 0.5), AT(v, 0.0, 0.0));
      rig_tick(r);
      double force[3];
      rig_feel(r, 0, force);
      for (int k = 0; k < 3 && i > 3000; ++k) {
        step = fmax(step, fabs(force[k] - before[k]));
      }
      least = i > 3000 ? fmin(least, force[2]) : least;
      memcpy(before, force, sizeof before);
    }
    printf("# %3.0f ms: steps of %.3f N at most, %.3f N at least\n", 1e3 * delays[d], step, least);
    CHECK(step < 0.005);
    CHECK_NEAR(least, 6.0, 0.1); /* the world's cube rests elsewhere in the layer of 0.1 mm */
    tap_release(run->rig);
    tap_release(run);
  }
}

/* ---- momentum ---- */

/* A cube in free space: both hands push it about, one comes later, one is gone at once. What hands
 * gave is what the cube has. */
TEST(the_momentum_of_a_shared_cube_is_what_hands_gave_to_it)
{
  static const double delays[] = {0.0, 0.01, 0.1};
  for (int d = 0; d < 3; ++d) {
    pair_run *run = tap_own(sizeof *run, run_finish);
    hap_pointer_def hand;
    hands_rig *r = run->rig = rig_new(delays[d], 4);
    dWorldSetGravity(r->world, 0.0, 0.0, 0.0);
    run->cube = ode_box(r->world, r->space, MASS, AT(EDGE, EDGE, EDGE), AT(0.0, 0.0, 0.0));
    rig_serve(r, cube_surface);
    hap_pointer_def_init(&hand, sizeof hand);
    hand.radius = RADIUS;
    hand.stiffness = STIFFNESS;
    session_run(r->session);
    rig_join(r, 0, &hand);
    rig_join(r, 1, &hand);
    double given = 0.0;
    double worst = 0.0;
    const double *counted = r->session->physics->account.counts.hand_impulse;
    for (int i = 0; i < 6000; ++i) {
      double s = 1e-3 * i;
      for (int k = 0; k < 2 && r->hands[k].session != NULL; ++k) { /* each follows the cube */
        double side = k == 0 ? -1.0 : 1.0;
        double far = k == 1 && s < 2.0 ? 4.0 : 0.0;
        double in = 0.004 * fmax(sin(2.0 * M_PI * (k == 0 ? 1.0 : 1.3) * s), 0.0) - 0.002;
        in = s < 1.0 || s > 5.0 ? -0.05 : in;
        double x = dBodyGetPosition(run->cube)[0] + side * (0.5 * EDGE + RADIUS - in + far);
        rig_put(r, k, AT(x, 0.0, 0.0), AT(0.0, 0.0, 0.0));
      }
      if (i == 4000) {
        rig_leave(r, 1);
      }
      rig_tick(r);
      given = fmax(given, fabs(counted[0]));
      /* Of the newest state that physics has had. */
      double p = MASS * dBodyGetLinearVel(run->cube)[0];
      worst = fmax(worst, fabs(p - counted[0]));
    }
    double p = MASS * dBodyGetLinearVel(run->cube)[0];
    printf("# %3.0f ms: %.4f N s given at most, %.2g N s not there in between, %.2g at the end\n",
           1e3 * delays[d], given, worst, fabs(p - counted[0]));
    CHECK(given > 0.05);
    CHECK(worst <= 1e-5); /* a velocity on its way is rounded to 4e-6 m/s */
    CHECK(fabs(p - counted[0]) <= 1e-5);
    tap_release(run->rig);
    tap_release(run);
  }
}
