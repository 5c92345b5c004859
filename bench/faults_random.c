/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

/* Worlds of random bodies under a session, a process for each block of them: how many end the
 * process. Half of them are turned by right angles and stand on a grid, where ODE's colliders meet
 * their degenerate cases. World N is the same in every run. */

#include <math.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <hapode/ode.h>

#include "bench/faults.h"

#define BLOCK 200
#define BODIES_MAX 6
#define SESSION_BODIES 16 /* with the default most of the time would go to clearing memory */
#define TICKS 50
#define BLOCK_SECONDS 120 /* a world that takes longer does not end */
#define POINTS_MAX 8
#define FACES_MAX 6
#define POLYGON_MAX 32
#define SAID_MAX 10
#define SOLIDS 3

/* ---- convex shapes ---- */

/* Of unit size; ODE's form: corners, and of each face its count and the corners, seen from outside
 * against the clock. */
typedef struct solid {
  unsigned points;
  unsigned faces;
  double corners[POINTS_MAX][3];
  unsigned polygons[POLYGON_MAX];
} solid;

static const solid solids[SOLIDS] = {
    {8,
     6,
     {{-0.5, -0.5, -0.5},
      {0.5, -0.5, -0.5},
      {-0.5, 0.5, -0.5},
      {0.5, 0.5, -0.5},
      {-0.5, -0.5, 0.5},
      {0.5, -0.5, 0.5},
      {-0.5, 0.5, 0.5},
      {0.5, 0.5, 0.5}},
     {4, 0, 4, 6, 2, 4, 1, 3, 7, 5, 4, 0, 1, 5, 4, 4, 2, 6, 7, 3, 4, 0, 2, 3, 1, 4, 4, 5, 7, 6}},
    {4,
     4,
     {{0.5, 0.5, 0.5}, {-0.5, -0.5, 0.5}, {-0.5, 0.5, -0.5}, {0.5, -0.5, -0.5}},
     {3, 0, 2, 1, 3, 0, 1, 3, 3, 0, 3, 2, 3, 1, 2, 3}},
    {6,
     5,
     {{-0.5, -0.5, -0.5},
      {0.5, -0.5, -0.5},
      {0.0, 0.5, -0.5},
      {-0.5, -0.5, 0.5},
      {0.5, -0.5, 0.5},
      {0.0, 0.5, 0.5}},
     {3, 0, 2, 1, 3, 3, 4, 5, 4, 0, 1, 4, 3, 4, 1, 2, 5, 4, 4, 2, 0, 3, 5}},
};

/* What ODE borrows of a convex geom. */
typedef struct hull {
  double corners[POINTS_MAX][3];
  double planes[FACES_MAX][4];
} hull;

/* ---- a world ---- */

typedef struct random_world {
  uint64_t state;
  dWorldID world;
  dSpaceID space;
  hull hulls[BODIES_MAX];
} random_world;

static double draw_between(random_world *r, double least, double most)
{
  r->state ^= r->state << 13;
  r->state ^= r->state >> 7;
  r->state ^= r->state << 17;
  return least + (most - least) * ((double)(r->state >> 11) / 9007199254740992.0);
}

static bool draw_chance(random_world *r, double share)
{
  return draw_between(r, 0.0, 1.0) < share;
}

static dGeomID hull_create(random_world *r, hull *h, const double size[3])
{
  const solid *s = &solids[(size_t)draw_between(r, 0.0, SOLIDS)];
  const unsigned *polygon = s->polygons;
  for (unsigned i = 0; i < s->points; ++i) {
    for (int k = 0; k < 3; ++k) {
      h->corners[i][k] = size[k] * s->corners[i][k];
    }
  }
  for (unsigned i = 0; i < s->faces; ++i) {
    const double *a = h->corners[polygon[1]];
    const double *b = h->corners[polygon[2]];
    const double *c = h->corners[polygon[3]];
    double *n = h->planes[i];
    double u[3];
    double v[3];
    for (int k = 0; k < 3; ++k) {
      u[k] = b[k] - a[k];
      v[k] = c[k] - a[k];
    }
    n[0] = u[1] * v[2] - u[2] * v[1];
    n[1] = u[2] * v[0] - u[0] * v[2];
    n[2] = u[0] * v[1] - u[1] * v[0];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; ++k) {
      n[k] /= length;
    }
    n[3] = n[0] * a[0] + n[1] * a[1] + n[2] * a[2];
    polygon += 1 + polygon[0];
  }
  return dCreateConvex(r->space, h->planes[0], s->faces, h->corners[0], s->points, s->polygons);
}

static dGeomID geom_create(random_world *r, hull *h, const double size[3])
{
  double kind = draw_between(r, 0.0, 1.0);
  if (kind < 0.4) {
    return hull_create(r, h, size);
  }
  if (kind < 0.7) {
    return dCreateBox(r->space, size[0], size[1], size[2]);
  }
  if (kind < 0.8) {
    return dCreateSphere(r->space, 0.5 * size[0]);
  }
  return kind < 0.9 ? dCreateCapsule(r->space, 0.5 * size[0], size[1])
                    : dCreateCylinder(r->space, 0.5 * size[0], size[1]);
}

static void body_create(random_world *r, hull *h, bool on_grid)
{
  dMass mass;
  dMatrix3 turned;
  double size[3];
  double at[3];
  for (int k = 0; k < 3; ++k) {
    size[k] = on_grid ? 0.02 * floor(draw_between(r, 1.0, 4.0)) : draw_between(r, 0.01, 0.1);
    at[k] = on_grid ? 0.01 * floor(draw_between(r, -5.0, 6.0)) : draw_between(r, -0.06, 0.06);
  }
  dBodyID body = dBodyCreate(r->world);
  dMassSetBoxTotal(&mass, draw_between(r, 0.02, 1.0), size[0], size[1], size[2]);
  dBodySetMass(body, &mass);
  dBodySetPosition(body, at[0], at[1], at[2] + 0.06);
  dRFromEulerAngles(turned, draw_between(r, 0.0, 4.0), draw_between(r, 0.0, 4.0),
                    draw_between(r, 0.0, 4.0));
  if (on_grid) {
    double quarter = 0.5 * M_PI * floor(draw_between(r, 0.0, 4.0));
    dRFromAxisAndAngle(turned, draw_chance(r, 0.5), draw_chance(r, 0.5), 1.0, quarter);
  }
  dBodySetRotation(body, turned);
  dGeomSetBody(geom_create(r, h, size), body);
  if (draw_chance(r, 0.3)) {
    dBodySetLinearVel(body, draw_between(r, -1.0, 1.0), draw_between(r, -1.0, 1.0),
                      draw_between(r, -1.0, 1.0));
    dBodySetAngularVel(body, draw_between(r, -20.0, 20.0), draw_between(r, -20.0, 20.0),
                       draw_between(r, -20.0, 20.0));
  }
}

static void world_create(random_world *r, long number)
{
  memset(r, 0, sizeof *r);
  r->state = (uint64_t)number * 0x9e3779b97f4a7c15u + 0x1234567u;
  for (int i = 0; i < 4; ++i) {
    (void)draw_between(r, 0.0, 1.0);
  }
  bool on_grid = draw_chance(r, 0.5);
  int bodies = 2 + (int)draw_between(r, 0.0, BODIES_MAX - 1.0);
  r->world = dWorldCreate();
  r->space = dHashSpaceCreate(NULL);
  dWorldSetGravity(r->world, 0.0, 0.0, -9.81);
  if (draw_chance(r, 0.7)) {
    dCreatePlane(r->space, 0.0, 0.0, 1.0, 0.0);
  } else {
    dGeomSetPosition(dCreateBox(r->space, 0.4, 0.4, 0.1), 0.0, 0.0, -0.05);
  }
  for (int i = 0; i < bodies; ++i) {
    body_create(r, &r->hulls[i], on_grid);
  }
}

/* A hand goes through it; whether all forces are finite. */
static bool world_run(random_world *r)
{
  bool is_finite = true;
  const double from[3] = {draw_between(r, -0.1, 0.1), draw_between(r, -0.1, 0.1),
                          draw_between(r, 0.0, 0.15)};
  const double speed[3] = {draw_between(r, -1.0, 1.0), draw_between(r, -1.0, 1.0),
                           draw_between(r, -1.0, 0.5)};
  hap_session *session;
  hap_pointer_id hand;
  hap_session_def def;
  hap_ode_def ode;
  hap_pointer_def pointer;
  hap_session_def_init(&def, sizeof def);
  hap_ode_def_init(&ode, sizeof ode);
  hap_pointer_def_init(&pointer, sizeof pointer);
  def.drive = HAP_DRIVE_LOCKSTEP;
  def.physics_hz = draw_chance(r, 0.5) ? 20.0 : 60.0;
  def.max_bodies = SESSION_BODIES;
  def.max_contacts = 12 * SESSION_BODIES;
  ode.world = r->world;
  ode.space = r->space;
  pointer.friction = draw_chance(r, 0.5) ? 0.5 : 0.0;
  if (hap_session_create(&def, &ode, &session, NULL) < HAP_OK) {
    return false;
  }
  if (hap_pointer_add(session, &pointer, &hand) < HAP_OK || hap_session_start(session) < HAP_OK) {
    is_finite = false;
  }
  for (int i = 0; i < TICKS && is_finite; ++i) {
    hap_pose pose = {.quat_wxyz = {1.0}};
    hap_twist twist = {{speed[0], speed[1], speed[2]}, {0.0}};
    hap_pointer_state state;
    for (int k = 0; k < 3; ++k) {
      pose.position[k] = from[k] + FAULTS_TICK_S * i * speed[k];
    }
    is_finite = hap_pointer_set_target(session, hand, &pose, &twist) >= HAP_OK &&
                hap_session_advance(session, 1) >= HAP_OK &&
                hap_pointer_get(session, hand, &state, sizeof state) >= HAP_OK &&
                isfinite(state.wrench.force[0] + state.wrench.force[1] + state.wrench.force[2]);
  }
  hap_session_destroy(session);
  return is_finite;
}

/* ---- blocks ---- */

/* What a block's process tells, also when it ends early. */
typedef struct block_report {
  volatile long at;       /* world that is run */
  volatile long not_well; /* worlds with a fault or a force that is not finite */
} block_report;

static void block_run(block_report *report, long end)
{
  random_world r;
  alarm(BLOCK_SECONDS);
  for (; report->at < end; ++report->at) {
    world_create(&r, report->at);
    report->not_well += !world_run(&r);
    dSpaceDestroy(r.space);
    dWorldDestroy(r.world);
  }
}

hap_status faults_random_run(bench *b, long worlds)
{
  long ended = 0;
  block_report *report =
      mmap(NULL, sizeof *report, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (report == MAP_FAILED) {
    return bench_fail(b, HAP_ERROR_MEMORY, "no memory for the report of a process");
  }
  report->at = 0;
  report->not_well = 0;
  while (report->at < worlds) {
    int how = 0;
    long end = report->at + BLOCK < worlds ? report->at + BLOCK : worlds;
    fflush(stdout);
    pid_t child = fork();
    if (child == 0) {
      block_run(report, end);
      _exit(0);
    }
    if (child < 0 || waitpid(child, &how, 0) != child) {
      munmap(report, sizeof *report);
      return bench_fail(b, HAP_ERROR_THREAD, "no process for the worlds from %ld on", report->at);
    }
    if (!WIFEXITED(how) || WEXITSTATUS(how) != 0) {
      if (ended < SAID_MAX) {
        bench_say("world %ld ended its process: signal %d", report->at, WTERMSIG(how));
      }
      ++ended;
      ++report->at; /* and on behind it */
    }
  }
  bench_check(b, ended == 0, "%ld random worlds: %ld ended the process, %ld had a fault  %s",
              worlds, ended, report->not_well, ended == 0 ? "ok" : "FAULT");
  munmap(report, sizeof *report);
  return HAP_OK;
}
