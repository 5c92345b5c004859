/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds that sleep for the most part: contacts are made for what is awake and what that wakes, and
 * the world goes as plain ODE takes it, which has all contacts in each step. */

#include "tests/tap.h"

#include "tests/contact_world.h"
#include "tests/desk.h"

#define G 9.81
#define EDGE 0.1
#define LAYER 1e-4
#define PHYSICS_HZ 100.0
#define STEP_TICKS 10
#define STEPS 60
#define BODIES_MOST 200
#define WIDTH 0.5 /* m, from tower to tower */

typedef struct yard {
  dWorldID world;
  dSpaceID space;
  dSpaceID inner; /* NULL: none */
  dBodyID bodies[BODIES_MOST];
  int count;
} yard;

typedef struct course {
  double z[STEPS][BODIES_MOST];
  double x[STEPS][BODIES_MOST];
  bool asleep[STEPS][BODIES_MOST];
  int steps;
} course;

typedef struct layout {
  const char *name;
  int towers;
  int high;      /* cubes of a tower */
  bool nested;   /* the upper halves are in a space inside the space */
  bool jointed;  /* the first tower's upper cube is on a ball joint to the next tower's */
  bool sways;    /* so high that the order of contacts shows */
  double ball_z; /* m; the ball flies into the first tower. 0: there is none */
} layout;

static void yard_fill(yard *y, const layout *l)
{
  ode_world_stiffen(y->world, 400); /* else the order of its rows shows */
  y->inner = l->nested ? dHashSpaceCreate(y->space) : NULL;
  (void)dCreatePlane(y->space, 0.0, 0.0, 1.0, 0.0);
  for (int i = 0; i < l->towers * l->high; ++i) {
    int tower = i / l->high;
    int floor = i % l->high;
    bool inner = l->nested && floor >= l->high / 2;
    dBodyID cube = ode_box(y->world, inner ? y->inner : y->space, 0.3, AT(EDGE, EDGE, EDGE),
                           AT(0.0, WIDTH * tower, 0.5 * EDGE + (EDGE - LAYER) * floor - LAYER));
    dBodyDisable(cube);
    y->bodies[y->count++] = cube;
  }
  if (l->jointed) {
    dJointID joint = dJointCreateBall(y->world, NULL);
    dJointAttach(joint, y->bodies[l->high - 1], y->bodies[2 * l->high - 1]);
    dJointSetBallAnchor(joint, 0.0, 0.5 * WIDTH, EDGE * l->high);
  }
  if (l->ball_z > 0.0) {
    dBodyID ball = ode_ball(y->world, y->space, 0.02, 0.04, AT(-0.3, 0.0, l->ball_z));
    dBodySetLinearVel(ball, 2.0, 0.0, 0.0);
    y->bodies[y->count++] = ball;
  }
}

static void yard_note(const yard *y, course *to)
{
  for (int i = 0; i < y->count && to->steps < STEPS; ++i) {
    to->x[to->steps][i] = dBodyGetPosition(y->bodies[i])[0];
    to->z[to->steps][i] = dBodyGetPosition(y->bodies[i])[2];
    to->asleep[to->steps][i] = !dBodyIsEnabled(y->bodies[i]);
  }
  ++to->steps;
}

/* ---- plain ODE ---- */

typedef struct plain {
  dWorldID world;
  dJointGroupID contacts;
} plain;

static void plain_near(void *data, dGeomID a, dGeomID b)
{
  const plain *p = data;
  dContact contacts[8];
  if (dGeomIsSpace(a) || dGeomIsSpace(b)) {
    dSpaceCollide2(a, b, data, plain_near);
    return;
  }
  int count = dGeomGetBody(a) == dGeomGetBody(b)
                  ? 0
                  : dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = (dSurfaceParameters){.mode = dContactApprox1, .mu = 0.5};
    dJointAttach(dJointCreateContact(p->world, p->contacts, &contacts[i]), dGeomGetBody(a),
                 dGeomGetBody(b));
  }
}

static void plain_course(const layout *l, course *out)
{
  yard y = {.count = 0};
  ode_world_make(G, &y.world, &y.space);
  yard_fill(&y, l);
  plain p = {y.world, dJointGroupCreate(0)};
  while (out->steps < STEPS) {
    dJointGroupEmpty(p.contacts);
    dSpaceCollide(y.space, &p, plain_near);
    if (y.inner != NULL) {
      dSpaceCollide(y.inner, &p, plain_near);
    }
    dWorldQuickStep(y.world, 1.0 / PHYSICS_HZ);
    yard_note(&y, out);
  }
  dJointGroupDestroy(p.contacts);
  ode_world_end(NULL, y.world, y.space);
}

/* ---- the session ---- */

typedef struct watched {
  yard y;
  course way;
  int asked; /* pairs */
} watched;

static bool pair_ask(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  watched *w = user;
  (void)a;
  (void)b;
  ++w->asked;
  io->mode = dContactApprox1;
  io->mu = 0.5;
  return true;
}

static void step_note(void *user, double seconds)
{
  watched *w = user;
  CHECK(fabs(seconds * PHYSICS_HZ - 1.0) < 1e-9);
  yard_note(&w->y, &w->way);
}

static desk *yard_desk(watched *w, const layout *l, hap_model model)
{
  desk *d = desk_new(G, model);
  d->def.physics_hz = PHYSICS_HZ;
  d->ode.surface = pair_ask;
  d->ode.after_step = step_note;
  d->ode.user = w;
  w->y.world = d->world;
  w->y.space = d->space;
  yard_fill(&w->y, l);
  return d;
}

static double courses_compare(const course *a, const course *b, int bodies)
{
  double most = 0.0;
  for (int i = 0; i < STEPS; ++i) {
    for (int k = 0; k < bodies; ++k) {
      most = fmax(most, fmax(fabs(a->x[i][k] - b->x[i][k]), fabs(a->z[i][k] - b->z[i][k])));
    }
  }
  return most;
}

static int count_sleepers(const course *c, int step, int bodies)
{
  int count = 0;
  for (int k = 0; k < bodies; ++k) {
    count += c->asleep[step][k];
  }
  return count;
}

/* m: how much lower bodies are than with plain ODE at the end of the step that wakes the first
 * ones. One without contacts falls 1 mm in it. */
static double way_sunk(const course *c, const course *plain_way, int bodies)
{
  double most = 0.0;
  int step = 0;
  while (step < STEPS - 1 &&
         count_sleepers(plain_way, step, bodies) == count_sleepers(plain_way, 0, bodies)) {
    ++step;
  }
  for (int k = 0; k < bodies; ++k) {
    most = fmax(most, plain_way->z[step][k] - c->z[step][k]);
  }
  return most;
}

static void check_layout(const layout *l)
{
  static course plain_way;
  static watched w;
  plain_way = (course){.steps = 0};
  w = (watched){.asked = 0};
  plain_course(l, &plain_way);
  desk *d = yard_desk(&w, l, HAP_MODEL_ACCELERANCE); /* which leaves what flies to ODE */
  desk_run(d, -2.0, -2.0, 1.0);
  desk_wait(d, STEP_TICKS * (STEPS + 2));
  REQUIRE(w.way.steps >= STEPS);
  double apart = courses_compare(&w.way, &plain_way, w.y.count);
  int slept = count_sleepers(&w.way, STEPS - 1, w.y.count);
  double fell = way_sunk(&w.way, &plain_way, w.y.count);
  printf("# %s: %d bodies, %d asleep at last, %.2g mm apart, %.2g mm lower, %d pairs asked\n",
         l->name, w.y.count, slept, 1e3 * apart, 1e3 * fell, w.asked);
  CHECK(apart < (l->sways ? 5e-3 : 1e-4));
  CHECK(fell < (l->sways ? 2e-4 : 2e-5));
  for (int i = 0; i < STEPS; ++i) {
    CHECK(count_sleepers(&w.way, i, w.y.count) == count_sleepers(&plain_way, i, w.y.count));
  }
}

TEST(what_is_woken_has_its_contacts_in_that_step)
{
  static const layout layouts[] = {
      {.name = "a ball hits a tower", .towers = 15, .high = 4, .ball_z = 0.25},
      {.name = "a ball hits the lowest cube", .towers = 15, .high = 4, .ball_z = 0.06},
      {.name = "a ball hits a high tower: too many",
       .towers = 2,
       .high = 40,
       .sways = true,
       .ball_z = 0.06},
      {.name = "a joint wakes another tower",
       .towers = 15,
       .high = 4,
       .jointed = true,
       .ball_z = 0.25},
      {.name = "spaces in spaces", .towers = 15, .high = 4, .nested = true, .ball_z = 0.25},
      {.name = "nothing wakes", .towers = 20, .high = 2},
      {.name = "few bodies", .towers = 2, .high = 3, .ball_z = 0.15},
  };
  for (size_t i = 0; i < sizeof layouts / sizeof layouts[0]; ++i) {
    check_layout(&layouts[i]);
  }
}

TEST(pairs_that_sleep_are_not_asked_about)
{
  static watched w;
  const layout l = {.name = "", .towers = 20, .high = 2};
  w = (watched){.asked = 0};
  desk *d = yard_desk(&w, &l, HAP_MODEL_CONTACT);
  desk_run(d, -2.0, -2.0, 1.0);
  desk_wait(d, 10 * STEP_TICKS);
  CHECK(w.asked == 0);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  dBodyEnable(w.y.bodies[1]); /* the upper of two */
  REQUIRE(hap_session_unlock(d->session) == HAP_OK);
  desk_wait(d, 10 * STEP_TICKS);
  printf("# %d pairs in ten steps\n", w.asked);
  CHECK(w.asked >= 2 * 9 && w.asked <= 2 * 11);
  CHECK(dBodyIsEnabled(w.y.bodies[0]) && !dBodyIsEnabled(w.y.bodies[2]));
}

TEST(two_that_are_awake_meet_once)
{
  static watched w;
  const layout l = {.name = "", .towers = 20, .high = 2};
  w = (watched){.asked = 0};
  desk *d = yard_desk(&w, &l, HAP_MODEL_CONTACT);
  desk_run(d, -2.0, -2.0, 1.0);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  dBodyEnable(w.y.bodies[0]);
  dBodyEnable(w.y.bodies[1]);
  REQUIRE(hap_session_unlock(d->session) == HAP_OK);
  desk_wait(d, 3 * STEP_TICKS);
  REQUIRE(hap_session_lock(d->session) == HAP_OK);
  int upper = dBodyGetNumJoints(w.y.bodies[1]);
  int lower = dBodyGetNumJoints(w.y.bodies[0]);
  REQUIRE(hap_session_unlock(d->session) == HAP_OK);
  printf("# contacts: %d and %d\n", upper, lower);
  CHECK(upper > 2 && upper <= 8 && lower == upper + 4); /* of a plane: four corners */
}

/* ---- a hand ---- */

/* N: the peak, as the hand presses the upper cube of the first tower. In models that measure, the
 * cube has the contacts of its tower when it is measured first. */
static double pressed_force(hap_model model, int towers)
{
  static watched w;
  const layout l = {.name = "", .towers = towers, .high = 2};
  double most = 0.0;
  w = (watched){.asked = 0};
  desk *d = yard_desk(&w, &l, model);
  d->ode.after_step = NULL;
  desk_run(d, 0.0, 0.0, 2 * EDGE + RADIUS + 0.004);
  desk_wait(d, 50);
  for (int i = 0; i < 10; ++i) {
    desk_move(d, 0.0, 0.0, -0.001, 10);
    most = fmax(most, desk_state(d).wrench.force[2]);
  }
  return most;
}

TEST(a_hand_feels_a_sleeping_tower_alike_whatever_sleeps_elsewhere)
{
  for (int i = 0; i < 4; ++i) {
    double few = pressed_force(all_models[i], 4);
    double many = pressed_force(all_models[i], 30);
    printf("# %s: %.4f N, among many %.4f N\n", hap_model_name(all_models[i]), few, many);
    CHECK(few > 4.0 && fabs(many - few) < 1e-3 * few);
  }
}

/* ---- fields of sleepers ---- */

#define FIELD 7 /* cubes along x and along y */
#define FIELD_GAP 0.045

static contact_world *field_new(double gap)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < FIELD * FIELD; ++i) {
    double pitch = EDGE + gap;
    dBodyDisable(cw_add_cube(w, 0.2, EDGE, pitch * (i % FIELD), pitch * (i / FIELD), 0.5 * EDGE));
  }
  dWorldSetAutoDisableFlag(w->world, 1);
  return w;
}

/* At 20 Hz a body could fall by 49 mm until the model after the next. Cubes that sleep do not: what
 * the pushed one may come to is in the range, and no chain beyond it. */
TEST(a_field_of_sleepers_is_not_in_the_range)
{
  contact_world *w = field_new(FIELD_GAP);
  cw_start(w, -0.5 * EDGE - 0.012, 0.0, 0.5 * EDGE);
  cw_go(w, 0.05, 0.0, 0.0, 300);
  CHECK(w->seen.range_max >= 3 && w->seen.range_max <= 9);
}

/* Those that touch go on at once. */
TEST(sleepers_that_touch_are_in_the_range)
{
  contact_world *w = field_new(0.0);
  cw_start(w, -0.5 * EDGE - 0.012, 0.0, 0.5 * EDGE);
  cw_go(w, 0.05, 0.0, 0.0, 300);
  CHECK(w->seen.range_max == FIELD * FIELD);
}

/* A push goes along a row with gaps of 4 mm, as long as it takes: each is moved in time, and none
 * goes through the next. */
TEST(a_push_along_sleepers_arrives)
{
  contact_world *w = cw_new(CW_GRAVITY);
  cw_add_floor(w);
  for (int i = 0; i < 8; ++i) {
    dBodyDisable(cw_add_cube(w, 0.2, EDGE, (EDGE + 0.004) * i, 0.0, 0.5 * EDGE));
  }
  cw_start(w, -0.5 * EDGE - 0.012, 0.0, 0.5 * EDGE);
  cw_move_hand(w, 0.2, 0.0, 0.0);
  for (int i = 0; i < 700; ++i) {
    cw_tick(w);
    for (int k = 1; k < 8; ++k) {
      CHECK(w->position[k][0] - w->position[k - 1][0] > EDGE - 1e-3);
    }
  }
  CHECK(w->position[7][0] > (EDGE + 0.004) * 7 + 0.01);
}

/* What is awake may come to a sleeper at any time: a heavy ball drives the pushed cube's neighbour
 * into the next one. */
TEST(what_flies_at_sleepers_is_in_time)
{
  contact_world *w = field_new(FIELD_GAP);
  dBodyID ball = cw_add_ball(w, 2.0, 0.02, EDGE + FIELD_GAP, -0.8, 0.5 * EDGE);
  dBodySetLinearVel(ball, 0.0, 4.0, 0.0);
  cw_start(w, -0.5 * EDGE - 0.012, 0.0, 0.5 * EDGE);
  cw_move_hand(w, 0.02, 0.0, 0.0);
  double least = HUGE_VAL;
  for (int i = 0; i < 400; ++i) {
    cw_tick(w);
    least = fmin(least, w->position[FIELD + 1][1] - w->position[1][1]);
  }
  CHECK(w->position[FIELD + 1][1] > EDGE + FIELD_GAP + 0.01);
  CHECK_SAY(least > EDGE - 2e-3, "cubes came as near as %g m", least);
}
