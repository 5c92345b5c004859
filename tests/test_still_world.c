/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Two stacks under a hand, as a session runs them: once with islands that stand still, and once
 * with all of them awake. Whatever the hand, the application and the world do, both go the same
 * way. */

#include "tests/tap.h"

#include "haptic/haptic_internal.h"
#include "local/body_still.h"
#include "session/session_internal.h"
#include "tests/contact_world.h"

#define EDGE 0.05
#define LAYER 1e-4
#define HIGH 3      /* cubes of a stack */
#define APART 0.055 /* the loop has both */
/* What is left undone in a tick, and how far the runs may so be apart. */
typedef struct still_case {
  double mu;
  double accuracy;
  double apart; /* m */
  double force; /* share of it */
} still_case;

enum {
  REST,
  PUSH,
  BACK,
  REST_AGAIN,
  HEAVIER,
  ADDED,
  GONE,
  PUSH_AGAIN,
  PHASES
};

static const int ticks_of[PHASES] = {700, 400, 300, 700, 500, 700, 500, 1000};

typedef struct run_result {
  double position[PHASES][CW_TRACED_MAX][3]; /* at the end of each */
  double force[PHASES];                      /* N, mean of its size */
  uint32_t still[PHASES];                    /* bodies, at the end */
  uint32_t still_of_second;                  /* in PUSH, at the least */
} run_result;

static void stacks_build(contact_world *w, double mu)
{
  w->surface.mu = mu;
  dWorldSetContactSurfaceLayer(w->world, LAYER);
  cw_add_floor(w);
  for (int i = 0; i < 2 * HIGH; ++i) {
    const int stack = i / HIGH;
    (void)cw_add_cube(w, 0.3, EDGE, 0.0, APART * stack,
                      EDGE / 2 - LAYER / 2 + (EDGE - LAYER / 2) * (i % HIGH));
  }
}

static void phase_begin(contact_world *w, int phase)
{
  cw_move_hand(w, 0.0, 0.0, 0.0);
  if (phase == PUSH || phase == PUSH_AGAIN) {
    cw_move_hand(w, 0.05, 0.0, 0.0);
  } else if (phase == BACK) {
    cw_move_hand(w, -0.1, 0.0, 0.0);
  } else if (phase == HEAVIER || phase == ADDED || phase == GONE) {
    REQUIRE(hap_session_lock(w->session) == HAP_OK);
    if (phase == HEAVIER) {
      dWorldSetGravity(w->world, 0.0, 0.0, -1.5 * CW_GRAVITY);
    } else if (phase == ADDED) { /* it falls onto the second stack */
      (void)cw_add_cube(w, 0.1, EDGE, 0.005, APART, EDGE * (HIGH + 0.5) + 0.02);
    } else { /* which it left */
      CHECK(hap_session_forget_body(w->session, w->bodies[2 * HIGH]) == HAP_OK);
      dGeomDestroy(dBodyGetFirstGeom(w->bodies[2 * HIGH]));
      dBodyDestroy(w->bodies[2 * HIGH]);
      w->bodies[--w->body_count] = NULL;
    }
    hap_session_unlock(w->session);
  }
}

/* The bodies of the second stack that stand still. */
static uint32_t second_still(const contact_world *w)
{
  const hapi_bodies *bodies = &w->session->haptic->tick.bodies;
  uint32_t count = 0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    count += hapi_body_is_still(body) && body->pose.position[1] > 0.5 * APART;
  }
  return count;
}

static void world_run(const still_case *what, bool awake, run_result *out)
{
  contact_world *w = cw_new(CW_GRAVITY);
  memset(out, 0, sizeof *out);
  stacks_build(w, what->mu);
  w->def.accuracy = what->accuracy;
  cw_start(w, -0.05, 0.0, EDGE * 2.5);
  out->still_of_second = UINT32_MAX;
  for (int phase = 0; phase < PHASES; ++phase) {
    hapi_tick *tick = &w->session->haptic->tick;
    phase_begin(w, phase);
    for (int i = 0; i < ticks_of[phase]; ++i) {
      tick->bodies.never_still = awake;
      cw_tick(w);
      out->force[phase] += cw_norm(w->force) / ticks_of[phase];
      if (phase == PUSH && second_still(w) < out->still_of_second) {
        out->still_of_second = second_still(w);
      }
    }
    out->still[phase] = tick->bodies.still;
    memcpy(out->position[phase], w->position, sizeof w->position);
  }
  CHECK(cw_stats(w).faults.count == 0);
}

static void runs_compare(const still_case *what)
{
  run_result still;
  run_result awake;
  world_run(what, false, &still);
  world_run(what, true, &awake);
  for (int phase = 0; phase < PHASES; ++phase) {
    double apart = 0.0;
    for (int i = 0; i < 2 * HIGH; ++i) {
      for (int k = 0; k < 3; ++k) {
        apart = fmax(apart, fabs(still.position[phase][i][k] - awake.position[phase][i][k]));
      }
    }
    printf("# mu %g, phase %d: %u still, apart by %.2g m, force %.9g and %.9g N\n", what->mu, phase,
           still.still[phase], apart, still.force[phase], awake.force[phase]);
    CHECK(awake.still[phase] == 0);
    CHECK(apart < what->apart);
    CHECK_NEAR(still.force[phase], awake.force[phase], what->force * awake.force[phase]);
  }
  CHECK(awake.force[PUSH] > 0.05 && awake.force[PUSH_AGAIN] > 0.05);
  CHECK(still.still[REST] == 2 * HIGH);
  CHECK(still.still_of_second == HIGH); /* the hand pushes the first stack alone */
}

TEST(solved_to_the_end_both_go_the_same_way)
{
  static const still_case rough = {0.5, 1.0, 1e-6, 1e-5};
  static const still_case slippery = {0.1, 1.0, 1e-8, 1e-6};
  runs_compare(&rough);
  runs_compare(&slippery);
}

TEST(else_they_are_as_far_apart_as_the_solver_lets_them)
{
  static const still_case rough = {0.5, 0.5, 5e-5, 1e-3};
  static const still_case slippery = {0.1, 0.5, 5e-5, 1e-3};
  runs_compare(&rough);
  runs_compare(&slippery);
}

/* ---- what wakes by itself ---- */

static contact_world *world_rest(void)
{
  contact_world *w = cw_new(CW_GRAVITY);
  stacks_build(w, 0.5);
  cw_start(w, -0.05, 0.0, EDGE * 2.5);
  cw_run(w, ticks_of[REST]);
  REQUIRE(w->session->haptic->tick.bodies.still == 2 * HIGH);
  return w;
}

/* The hand holds the highest cube of the first stack, and lifts it. */
TEST(a_grab_wakes_the_stack_of_its_body)
{
  contact_world *w = world_rest();
  REQUIRE(hap_pointer_attach(w->session, w->hand, w->bodies[HIGH - 1], NULL) == HAP_OK);
  double before = w->position[HIGH - 1][2];
  cw_go(w, 0.0, 0.0, 0.05, 400);
  CHECK_SAY(w->position[HIGH - 1][2] > before + 0.01, "%g m", w->position[HIGH - 1][2] - before);
}

/* A cube that falls beside it hangs on the highest cube of the second stack from now on. */
TEST(a_joint_wakes_the_stack_of_its_body)
{
  contact_world *w = world_rest();
  dBodyID top = w->bodies[2 * HIGH - 1];
  const double before = w->position[2 * HIGH - 1][1];
  REQUIRE(hap_session_lock(w->session) == HAP_OK);
  dBodyID hangs = cw_add_cube(w, 1.0, EDGE, 0.0, APART + 2.0 * EDGE, EDGE * (HIGH - 0.5));
  dJointID ball = dJointCreateBall(w->world, NULL);
  dJointAttach(ball, top, hangs);
  dJointSetBallAnchor(ball, 0.0, APART + EDGE, EDGE * (HIGH - 0.5));
  hap_session_unlock(w->session);
  cw_run(w, 400);
  CHECK_SAY(w->position[2 * HIGH - 1][1] > before + 1e-3, "%g m",
            w->position[2 * HIGH - 1][1] - before);
}

/* ---- sets of contacts ---- */

#define SET_MOST 200

/* What a set has, read by itself. */
typedef struct contact_set {
  uint64_t contents;
  uint32_t count;
  uint64_t number[SET_MOST];
  double mu[SET_MOST];
} contact_set;

static void set_read(const contact_world *w, contact_set *out)
{
  hapi_patches *patches = w->session->haptic->tick.contacts.patches;
  memset(out, 0, sizeof *out);
  out->contents = patches->contents;
  out->count = patches->contact_count;
  REQUIRE(out->count <= SET_MOST);
  for (uint32_t i = 0; i < out->count; ++i) {
    const hapi_patch_contact *c = &hapi_patches_contacts(patches)[i];
    out->number[i] = c->number;
    out->mu[i] = hapi_patches_surfaces(patches)[c->surface].mu;
  }
}

static bool set_equals(const contact_set *a, const contact_set *b)
{
  return a->count == b->count && memcmp(a->number, b->number, sizeof a->number) == 0 &&
         memcmp(a->mu, b->mu, sizeof a->mu) == 0;
}

/* Sets that say that they are the same have the same contacts, and where all is at rest those that
 * have the same say so, also after a sync. Each 0.1 s the friction changes. */
TEST(sets_that_say_that_they_are_the_same_are)
{
  contact_world *w = world_rest();
  contact_set before;
  int same[2] = {0, 0};
  int others[2] = {0, 0};
  int unsaid = 0;
  set_read(w, &before);
  for (int i = 0; i < 1200; ++i) {
    contact_set now;
    uint64_t seen = w->session->haptic->tick.contacts.patches->number;
    bool pushed = i >= 600;
    if (i == 600) {
      w->hand_velocity[0] = 0.05;
    }
    if (i < 600 && i % 100 == 0) {
      w->surface.mu = 0.5 + 1e-3 * i;
    }
    cw_tick(w);
    if (w->session->haptic->tick.contacts.patches->number == seen) {
      continue;
    }
    set_read(w, &now);
    CHECK(now.contents != 0);
    if (now.contents == before.contents) {
      CHECK(set_equals(&now, &before));
      CHECK(pushed || !w->session->haptic->tick.contacts.adopted);
    }
    same[pushed] += now.contents == before.contents;
    others[pushed] += !set_equals(&now, &before);
    unsaid += !pushed && now.contents != before.contents && set_equals(&now, &before);
    before = now;
  }
  printf("# at rest %d the same, %d others; pushed %d and %d\n", same[0], others[0], same[1],
         others[1]);
  CHECK(same[0] > 60 && others[0] >= 4 && others[1] > 0 && unsaid == 0);
}

/* ---- what packs know of bodies ---- */

/* R I^-1 R^T of the pose with which the tick begins; R worked out here from the quaternion. */
static void inertia_expect(const hapi_local_body *body, double out[9])
{
  const double *q = body->pose.quat_wxyz;
  double s = q[0];
  const double u[3] = {q[1], q[2], q[3]};
  double r[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      int l = 3 - i - k;
      double skew = i == k ? 0.0 : (k - i == 1 || k - i == -2 ? -1.0 : 1.0) * u[l];
      r[i][k] = 2.0 * (u[i] * u[k] + s * skew) + (i == k ? 2.0 * s * s - 1.0 : 0.0);
    }
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      out[3 * i + k] = 0.0;
      for (int n = 0; n < 9; ++n) {
        out[3 * i + k] += r[i][n / 3] * body->given.inverse_inertia[n] * r[k][n % 3];
      }
    }
  }
}

/* They are used for impulses of this tick, so they are those of its poses. */
TEST(inertias_in_packs_are_those_of_this_ticks_poses)
{
  contact_world *w = cw_new(0.0);
  const double edges[3] = {0.02, 0.06, 0.15};
  dBodyID box = cw_add_box(w, 0.3, edges, 0.0, 0.0, 0.3);
  dBodySetAngularVel(box, 3.0, 5.0, 2.0);
  cw_start_following(w, 0.0, 0.0, 0.2);
  cw_run(w, 50);
  hapi_tick *tick = &w->session->haptic->tick;
  for (int i = 0; i < 20; ++i) {
    REQUIRE(tick->bodies.live_count == 1);
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[0]];
    double expected[9];
    double turned = body->pose.quat_wxyz[1];
    inertia_expect(body, expected);
    cw_tick(w);
    CHECK(body->pose.quat_wxyz[1] != turned);
    for (int k = 0; k < 9; ++k) {
      CHECK_NEAR(tick->rows.solver.packs.inverse_inertia[body->row][k], expected[k],
                 1e-9 * fabs(expected[0] + expected[4] + expected[8]));
    }
  }
}
