/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* The border of the range: the loop has some of the bodies that touch each other, ODE the others.
 * Public API only. The witness is ODE alone, at the rate of the loop, with a pointer of its own. */

#include "tests/tap.h"

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "haptic/haptic_internal.h"
#include "session/session_internal.h"
#include "tests/contact_world.h"

#define EDGE 0.05
#define RADIUS 0.01
#define MASS 0.2
#define STIFFNESS 2000.0

typedef enum border_kind {
  BORDER_ROW,
  BORDER_GRID,
  BORDER_WALL,
  BORDER_PILE,
  BORDER_CHAIN /* a row that ends in hinges */
} border_kind;

typedef struct border_scene {
  border_kind kind;
  int count; /* along the push; bodies of a pile */
  int in_loop;
  double hz;
  double overlap; /* m */
  int iterations;
  double mu;
  double speed; /* m/s, of the hand */
  double way;   /* m, of the hand */
} border_scene;

/* What came of a push. */
typedef struct border_push {
  double force;   /* N, the largest */
  double force2;  /* N^2, the mean of its square */
  double fastest; /* m/s, of all bodies */
  double gained;  /* J, the most that all bodies have more than at first, less the hand's work */
  double work;    /* J, of the hand */
} border_push;

/* ---- scenes ---- */

static void border_add(contact_world *w, double x, double y, double z)
{
  (void)cw_add_cube(w, MASS, EDGE, x, y, z);
}

static void border_hinge(contact_world *w, int a, double x, double z)
{
  dJointID hinge = dJointCreateHinge(w->world, 0);
  dJointAttach(hinge, w->bodies[a], w->bodies[a + 1]);
  dJointSetHingeAnchor(hinge, x, 0.0, z);
  dJointSetHingeAxis(hinge, 0.0, 0.0, 1.0);
}

static void border_make(contact_world *w, const border_scene *s)
{
  double pitch = EDGE - s->overlap;
  double first = 0.5 * EDGE;
  double z = 0.5 * EDGE - s->overlap;
  int half = s->count / 2;
  cw_add_floor(w);
  for (int i = 0; i < s->count; ++i) {
    int layer = i / 16;
    int cell = i % 16;
    int row = cell / 4 - 2;
    int beyond = i > half ? i - half : 0; /* gaps between hinged cubes */
    switch (s->kind) {
      case BORDER_ROW:
        border_add(w, first + pitch * i, 0.0, z);
        break;
      case BORDER_GRID:
        for (int k = -half; k <= half; ++k) {
          border_add(w, first + pitch * i, pitch * k, z);
        }
        break;
      case BORDER_WALL:
        for (int k = 0; k < 3; ++k) {
          border_add(w, first + pitch * (i + 0.5 * (k % 2)), 0.0, z + pitch * k);
        }
        break;
      case BORDER_PILE:
        border_add(w, first + pitch * (cell % 4), pitch * row + 0.003 * layer, z + pitch * layer);
        break;
      case BORDER_CHAIN:
        border_add(w, first + pitch * i + 0.002 * beyond, 0.0, z);
        break;
    }
  }
  for (int i = half; s->kind == BORDER_CHAIN && i + 1 < s->count; ++i) {
    border_hinge(w, i, first + pitch * i + 0.026 + 0.002 * (i - half), z);
  }
}

static void border_open(contact_world *w, const border_scene *s)
{
  dWorldSetQuickStepNumIterations(w->world, s->iterations);
  w->def.max_bodies = s->in_loop;
  w->def.physics_hz = s->hz;
  w->surface.mu = s->mu;
  border_make(w, s);
}

/* J, with the turning of a cube about its centre. */
static double border_energy(const contact_world *w, double *io_fastest)
{
  double all = 0.0;
  for (int i = 0; i < w->body_count; ++i) {
    double speed = cw_norm(dBodyGetLinearVel(w->bodies[i]));
    double spin = EDGE * cw_norm(dBodyGetAngularVel(w->bodies[i]));
    all += 0.5 * MASS * (speed * speed + spin * spin / 6.0);
    all += MASS * CW_GRAVITY * dBodyGetPosition(w->bodies[i])[2];
    *io_fastest = fmax(*io_fastest, speed);
  }
  return all;
}

/* The hand goes its way and stays there for a while. */
static int border_ticks(const border_scene *s)
{
  return (int)(1000.0 * s->way / s->speed) + 200;
}

static double border_speed(const border_scene *s, int tick)
{
  return tick < (int)(1000.0 * s->way / s->speed) ? s->speed : 0.0;
}

static border_push border_run(const border_scene *s)
{
  border_push out = {0.0};
  contact_world *w = cw_new(CW_GRAVITY);
  uint32_t steps = 0;
  border_open(w, s);
  double first = border_energy(w, &out.fastest);
  cw_start(w, -0.011, 0.0, 0.025);
  for (int i = 0; i < border_ticks(s); ++i) {
    cw_move_hand(w, border_speed(s, i), 0.0, 0.0);
    cw_tick(w);
    double force = cw_norm(w->force);
    out.force = fmax(out.force, force);
    out.force2 += force * force / border_ticks(s);
    out.work -= 1e-3 * w->force[0] * w->hand_velocity[0];
    if (w->seen.steps != steps) {
      steps = w->seen.steps;
      out.gained = fmax(out.gained, border_energy(w, &out.fastest) - first - out.work);
    }
  }
  CHECK(cw_stats(w).faults.count == 0);
  CHECK(cw_stats(w).probes.steps == 0);
  cw_close(w);
  return out;
}

/* ---- the witness ---- */

typedef struct witness_world {
  contact_world *w;
  dJointGroupID group;
} witness_world;

static void witness_near(void *data, dGeomID a, dGeomID b)
{
  const witness_world *at = data;
  dContact contacts[8];
  dBodyID body_a = dGeomGetBody(a);
  dBodyID body_b = dGeomGetBody(b);
  if (body_a != NULL && body_b != NULL &&
      dAreConnectedExcluding(body_a, body_b, dJointTypeContact)) {
    return;
  }
  int count = dCollide(a, b, 8, &contacts[0].geom, sizeof contacts[0]);
  for (int i = 0; i < count; ++i) {
    contacts[i].surface = at->w->surface;
    dJointAttach(dJointCreateContact(at->w->world, at->group, &contacts[i]), body_a, body_b);
  }
}

/* The spring of a sphere against the nearest face of each cube; the force on the hand along x. */
static double witness_push(const contact_world *w, double x, double v)
{
  double all[3] = {0.0, 0.0, 0.0};
  for (int i = 0; i < w->body_count; ++i) {
    dVector3 local;
    dVector3 point;
    dVector3 speed;
    double way[3];
    dBodyGetPosRelPoint(w->bodies[i], x, 0.0, 0.025, local);
    for (int k = 0; k < 3; ++k) {
      local[k] = fmin(fmax(local[k], -0.5 * EDGE), 0.5 * EDGE);
    }
    dBodyGetRelPointPos(w->bodies[i], local[0], local[1], local[2], point);
    way[0] = point[0] - x, way[1] = point[1], way[2] = point[2] - 0.025;
    double distance = cw_norm(way);
    if (!(distance < RADIUS) || distance == 0.0) {
      continue;
    }
    dBodyGetRelPointVel(w->bodies[i], local[0], local[1], local[2], speed);
    double closing = ((v - speed[0]) * way[0] - speed[1] * way[1] - speed[2] * way[2]) / distance;
    double force = fmax(STIFFNESS * (RADIUS - distance) + 20.0 * closing, 0.0);
    dBodyAddForceAtPos(w->bodies[i], force * way[0] / distance, force * way[1] / distance,
                       force * way[2] / distance, point[0], point[1], point[2]);
    for (int k = 0; k < 3; ++k) {
      all[k] += force * way[k] / distance;
    }
  }
  return cw_norm(all);
}

static border_push witness_run(const border_scene *s)
{
  border_push out = {0.0};
  contact_world *w = cw_new(CW_GRAVITY);
  witness_world at = {w, dJointGroupCreate(0)};
  double x = -0.011;
  border_open(w, s);
  double first = border_energy(w, &out.fastest);
  dWorldSetERP(w->world, 0.2 * 1e-3 * s->hz); /* the same rate of push-out */
  dWorldSetQuickStepNumIterations(w->world, 200);
  for (int i = 0; i < border_ticks(s); ++i) {
    double v = border_speed(s, i);
    x += 1e-3 * v;
    double force = witness_push(w, x, v);
    out.force = fmax(out.force, force);
    out.force2 += force * force / border_ticks(s);
    dSpaceCollide(w->space, &at, witness_near);
    dWorldQuickStep(w->world, 1e-3);
    dJointGroupEmpty(at.group);
    out.work += 1e-3 * v * force;
    out.gained = fmax(out.gained, border_energy(w, &out.fastest) - first - out.work);
  }
  dJointGroupDestroy(at.group);
  cw_close(w);
  return out;
}

/* ---- tests ---- */

/* What friction lets a row be pushed with. */
static double row_friction(const border_scene *s)
{
  return s->mu * s->count * MASS * CW_GRAVITY;
}

/* J, that it takes to lift all bodies out of each other. */
static double overlap_energy(const border_scene *s)
{
  static const double layers[] = {[BORDER_ROW] = 1,
                                  [BORDER_GRID] = 1,
                                  [BORDER_WALL] = 3,
                                  [BORDER_PILE] = 3,
                                  [BORDER_CHAIN] = 1};
  int bodies = s->kind == BORDER_GRID   ? s->count * (s->count + 1)
               : s->kind == BORDER_WALL ? 3 * s->count
                                        : s->count;
  return bodies * MASS * CW_GRAVITY * s->overlap * layers[s->kind];
}

static void border_print(const border_scene *s, const border_push *push)
{
  printf(
      "# kind %d, %d, %d in the loop, %g Hz, overlap %g mm, %d iterations: force %.2f N, rms "
      "%.2f, %.3f m/s, %.4f J from nowhere, work %.4f J\n",
      (int)s->kind, s->count, s->in_loop, s->hz, 1e3 * s->overlap, s->iterations, push->force,
      sqrt(push->force2), push->fastest, push->gained, push->work);
}

/* Between the hand's spring with the border's in series, docs/decisions/border.md, and what
 * friction holds. */
TEST(a_long_row_with_a_border_is_held_and_stays_together)
{
  static const int iterations[] = {20, 100, 400};
  static const double rates[] = {20.0, 60.0, 120.0};
  for (int i = 0; i < 9; ++i) {
    border_scene s = {.kind = BORDER_ROW,
                      .count = 30,
                      .in_loop = 6,
                      .hz = rates[i / 3],
                      .overlap = 1e-4,
                      .iterations = iterations[i % 3],
                      .mu = 0.5,
                      .speed = 0.05,
                      .way = 0.024};
    border_push push = border_run(&s);
    double spring = 2.0 * MASS * s.hz * s.hz;
    border_print(&s, &push);
    CHECK(push.force <= 1.2 * row_friction(&s));
    CHECK(push.force >= spring / (spring + STIFFNESS) * row_friction(&s));
    CHECK(push.fastest <= 10.0 * s.speed);
    CHECK(push.gained <= 0.1 * push.work);
  }
}

/* What the hand gave, what the overlap was, and no more than the hand's work on top. */
TEST(no_border_flies_apart)
{
  static const border_scene scenes[] = {
      {BORDER_ROW, 10, 4, 60, 1e-3, 50, 0.5, 0.1, 0.03},
      {BORDER_ROW, 60, 32, 120, 0, 10, 0.5, 0.3, 0.03},
      {BORDER_ROW, 45, 6, 20, 5e-3, 20, 1.0, 0.05, 0.02},
      {BORDER_ROW, 20, 8, 60, 0, 100, 0.0, 0.1, 0.03},
      {BORDER_GRID, 5, 8, 60, 1e-4, 20, 0.5, 0.1, 0.03},
      {BORDER_GRID, 5, 16, 20, 1e-3, 20, 1.0, 0.05, 0.02},
      {BORDER_WALL, 8, 6, 20, 1e-4, 20, 0.5, 0.05, 0.02},
      {BORDER_WALL, 8, 16, 60, 1e-3, 50, 0.5, 0.1, 0.03},
      {BORDER_PILE, 48, 16, 60, 1e-4, 20, 0.5, 0.1, 0.03},
      {BORDER_PILE, 48, 6, 20, 0, 20, 0.5, 0.05, 0.02},
      {BORDER_PILE, 32, 12, 120, 1e-3, 50, 0.2, 0.1, 0.03},
      {BORDER_CHAIN, 12, 4, 60, 1e-4, 100, 0.5, 0.1, 0.03},
      {BORDER_CHAIN, 12, 6, 20, 1e-3, 20, 0.5, 0.05, 0.02},
  };
  for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; ++i) {
    border_push push = border_run(&scenes[i]);
    border_print(&scenes[i], &push);
    CHECK(push.gained <= push.work + 2.0 * overlap_energy(&scenes[i]));
  }
}

TEST(with_a_border_a_hand_feels_what_ode_alone_gives)
{
  static const border_kind kinds[] = {BORDER_ROW, BORDER_CHAIN};
  for (int i = 0; i < 4; ++i) {
    border_scene s = {.kind = kinds[i % 2],
                      .count = 10,
                      .in_loop = 6,
                      .hz = i < 2 ? 60.0 : 120.0,
                      .overlap = 1e-4,
                      .iterations = 100,
                      .mu = 0.5,
                      .speed = 0.05,
                      .way = 0.024};
    border_push here = border_run(&s);
    border_push there = witness_run(&s);
    border_print(&s, &here);
    border_print(&s, &there);
    CHECK(here.force <= 1.1 * there.force);
    CHECK(here.force2 >= 0.8 * there.force2 && here.force2 <= 1.1 * there.force2);
  }
}

/* Only the lower one is in the loop, which carries the contact. What stands on it was let fall in
 * each other step, with 0.15 m/s. */
TEST(what_stands_on_a_body_of_the_loop_is_held_all_the_time)
{
  contact_world *w = cw_new(CW_GRAVITY);
  double fastest = 0.0;
  w->def.physics_hz = 60.0;
  w->expert.range_hops = 0;
  cw_add_floor(w);
  border_add(w, 0.0, 0.0, 0.5 * EDGE - 1e-5);
  border_add(w, 0.0, 0.0, 1.5 * EDGE - 2e-5);
  w->hand_def.radius = 0.01;
  cw_start(w, -0.5 * EDGE - 0.012, 0.0, 0.5 * EDGE);
  cw_run(w, 300);
  for (int i = 0; i < 500; ++i) {
    cw_run(w, 1);
    fastest = fmax(fastest, cw_norm(dBodyGetLinearVel(w->bodies[1])));
  }
  hap_stats stats = cw_stats(w);
  CHECK(stats.model.range_bodies == 1 && stats.model.edge_bodies == 1);
  CHECK_SAY(fastest < 0.02, "%g m/s", fastest);
}

/* m: the farthest way down or up of a stack in 2 s, beside whose cube `at` a hand rests. That one
 * alone is in the loop. */
static double stack_way(double physics_hz, int cubes, int at)
{
  const double deep = 1e-4;
  contact_world *w = cw_new(CW_GRAVITY);
  double from[8];
  double most = 0.0;
  w->def.physics_hz = physics_hz;
  w->expert.range_hops = 0;
  dWorldSetContactSurfaceLayer(w->world, deep);
  dWorldSetQuickStepNumIterations(w->world, 50);
  cw_add_floor(w);
  for (int i = 0; i < cubes; ++i) {
    border_add(w, 0.0, 0.0, 0.5 * EDGE - deep + i * (EDGE - deep));
    from[i] = dBodyGetPosition(w->bodies[i])[2];
  }
  w->hand_def.radius = 0.01;
  cw_start(w, -0.5 * EDGE - 0.012, 0.0, (0.5 + at) * EDGE);
  for (int i = 0; i < 2000; ++i) {
    cw_run(w, 1);
    for (int k = 0; k < cubes; ++k) {
      most = fmax(most, fabs(dBodyGetPosition(w->bodies[k])[2] - from[k]));
    }
  }
  hap_stats stats = cw_stats(w);
  printf("# %g Hz, %d, hand at %d: %u in the loop, %u at its border, %.3f mm\n", physics_hz, cubes,
         at, stats.model.range_bodies, stats.model.edge_bodies, 1e3 * most);
  CHECK(stats.model.range_bodies >= 1 && stats.model.range_bodies < 4);
  return most;
}

/* In the interval in which a body comes to the border, what rests on the loop's was let fall, and
 * what carries it gave way: 0.7 and 0.6 mm, 2.5 and 2.0, 100 mm. */
TEST(what_comes_to_the_border_is_held_from_the_first_interval_on)
{
  CHECK(stack_way(120.0, 2, 0) < 2e-4);
  CHECK(stack_way(120.0, 2, 1) < 4.5e-4);
  CHECK(stack_way(60.0, 2, 0) < 5e-4);
  CHECK(stack_way(60.0, 2, 1) < 1.2e-3);
  CHECK(stack_way(30.0, 3, 2) < 1e-2);
}

/* Square layers, each a cube narrower than the one below. */
static void pyramid_add(contact_world *w, int side)
{
  const double pitch = EDGE - 1e-5;
  cw_add_floor(w);
  for (int layer = 0; layer < 4; ++layer) {
    int width = side - layer;
    for (int i = 0; i < width * width; ++i) {
      int along = i / width;
      border_add(w, 0.5 * EDGE + pitch * (along + 0.5 * layer),
                 pitch * (i % width - 0.5 * (width - 1) + 0.2 * (along % 2)),
                 0.5 * EDGE - 1e-5 + pitch * layer);
    }
  }
}

static double farthest_way(const contact_world *w, const double (*from)[3])
{
  double most = 0.0;
  for (int i = 0; i < w->body_count; ++i) {
    double way[3];
    hapi_v3_sub(dBodyGetPosition(w->bodies[i]), from[i], way);
    most = fmax(most, hapi_v3_norm(way));
  }
  return most;
}

/* Of the loop's bodies from ODE's; an interval's motion is part of it. */
static double farthest_apart(const contact_world *w)
{
  const hapi_bodies *bodies = &w->session->haptic->tick.bodies;
  double most = 0.0;
  for (uint32_t i = 0; i < bodies->live_count; ++i) {
    const hapi_local_body *body = &bodies->of[bodies->live[i]];
    double way[3];
    hapi_v3_sub(dBodyGetPosition((dBodyID)body->given.tag), body->pose.position, way);
    most = fmax(most, hapi_v3_norm(way));
  }
  return most;
}

/* At rest, all in the loop, of which half then leave it. They sank and tilted for as long as they
 * stood at the border: 2.3 mm in a second. */
TEST(a_pile_at_rest_stays_a_pile_when_the_range_shrinks)
{
  contact_world *w = cw_new(CW_GRAVITY);
  double from[16][3] = {{0.0}};
  w->def.physics_hz = 60.0;
  dWorldSetQuickStepNumIterations(w->world, 50);
  pyramid_add(w, 3);
  REQUIRE(w->body_count == 14);
  w->hand_def.radius = 0.01;
  cw_start(w, -0.012, 0.0, 0.5 * EDGE);
  cw_run(w, 500);
  CHECK(cw_stats(w).model.range_bodies == 14);
  for (int i = 0; i < w->body_count; ++i) {
    hapi_v3_copy(dBodyGetPosition(w->bodies[i]), from[i]);
  }
  CHECK(hap_session_set_accuracy(w->session, 0.0) == HAP_OK);
  cw_run(w, 1000);
  hap_stats stats = cw_stats(w);
  CHECK(stats.model.range_bodies < 10 && stats.model.edge_bodies > 4);
  double most = farthest_way(w, (const double(*)[3])from);
  double apart = farthest_apart(w);
  printf("# %u in the loop, %u at its border: %.2f mm, apart %.3f mm\n", stats.model.range_bodies,
         stats.model.edge_bodies, 1e3 * most, 1e3 * apart);
  CHECK_SAY(most < 1.6e-3, "%g mm", 1e3 * most);
  CHECK_SAY(apart < 0.2e-3, "%g mm", 1e3 * apart);
}
