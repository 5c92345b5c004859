/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_TOOL_WORLD_H
#define HAPODE_TESTS_TOOL_WORLD_H

/* A lockstep session with a pointer that is a hull, a cube of 20 mm if nothing else is said,
 * moved by the test. Public API only. Include after tap.h. */

#include <math.h>
#include <string.h>

#include "tests/ode_world.h"
#include "tests/solids.h"

typedef struct tool_world {
  dWorldID world;
  dSpaceID space;
  hap_session_def def;
  hap_expert_def expert;
  hap_research_def research;
  hap_ode_def ode;
  hap_pointer_def tool_def;
  hap_pointer_expert_def tool_expert;
  hap_pointer_research_def tool_research;
  hap_session *session;
  hap_pointer_id tool;
  double hull[64 * 3];
  hap_pose pose;
  hap_twist twist;
  hap_pointer_state state; /* of the newest tick */
  hap_detail detail;
  double steepest;        /* N, between two ticks, since it was set to 0 */
  double steepest_torque; /* N m */
  double work;            /* J, that the tool's wrench did on the hand */
  double work_most;
} tool_world;

static inline bool tool_surface(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io)
{
  (void)user;
  (void)a;
  (void)b;
  io->mode = dContactApprox1;
  io->mu = 0.5;
  return true;
}

/* Corners of a box about (x, y, z). */
static inline void tool_set_box(tool_world *w, const double half[3], const double middle[3])
{
  box_corners(half, middle, w->hull);
  w->tool_def.hull_xyz = w->hull;
  w->tool_def.hull_points = 8;
}

static inline void tool_begin(tool_world *w, hap_model model)
{
  memset(w, 0, sizeof *w);
  ode_world_make(9.81, &w->world, &w->space);
  session_defs_init(&w->def, &w->expert, &w->research);
  w->def.drive = HAP_DRIVE_LOCKSTEP;
  w->def.model = model;
  w->research.guard = HAP_GUARD_MEASURE;
  hap_ode_def_init(&w->ode, sizeof w->ode);
  w->ode.world = w->world;
  w->ode.space = w->space;
  w->ode.surface = tool_surface;
  pointer_defs_init(&w->tool_def, &w->tool_expert, &w->tool_research);
  w->tool_expert.coupling = HAP_COUPLING_DIRECT;
  w->tool_def.radius = 0.0;
  w->tool_def.max_force = 1e4;
  w->tool_def.max_torque = 1e4;
  w->pose.quat_wxyz[0] = 1.0;
  tool_set_box(w, AT(0.01, 0.01, 0.01), AT(0.0, 0.0, 0.0));
}

static inline void tool_add_floor(tool_world *w)
{
  dCreatePlane(w->space, 0.0, 0.0, 1.0, 0.0);
}

static inline void tool_start(tool_world *w)
{
  w->session = session_make(&w->def, &w->ode);
  REQUIRE(hap_pointer_add(w->session, &w->tool_def, &w->tool) == HAP_OK);
  session_run(w->session);
}

static inline void tool_end(tool_world *w)
{
  ode_world_end(w->session, w->world, w->space);
  w->world = NULL;
}

static inline void tool_end_owned(void *owned)
{
  tool_end(owned);
}

/* Closed when the test has ended. */
static inline tool_world *tool_new(hap_model model)
{
  tool_world *w = tap_own(sizeof *w, tool_end_owned);
  tool_begin(w, model);
  return w;
}

static inline void tool_step(tool_world *w)
{
  hap_pointer_state before = w->state;
  double way[3];
  double turn[3];
  CHECK(hap_pointer_set_target(w->session, w->tool, &w->pose, &w->twist) == HAP_OK);
  CHECK(hap_session_advance(w->session, 1) == HAP_OK);
  CHECK(hap_pointer_get(w->session, w->tool, &w->state, sizeof w->state) == HAP_OK);
  if (before.stamp_ns == 0) {
    return;
  }
  double change[2] = {0.0, 0.0};
  for (int k = 0; k < 3; ++k) {
    change[0] += pow(w->state.wrench.force[k] - before.wrench.force[k], 2.0);
    change[1] += pow(w->state.wrench.torque[k] - before.wrench.torque[k], 2.0);
    way[k] = w->state.proxy.position[k] - before.proxy.position[k];
    turn[k] = 0.5 * 1e-3 * (w->state.twist.angular[k] + before.twist.angular[k]);
    w->work += 0.5 * (w->state.wrench.force[k] + before.wrench.force[k]) * way[k] +
               0.5 * (w->state.wrench.torque[k] + before.wrench.torque[k]) * turn[k];
  }
  w->work_most = fmax(w->work_most, w->work);
  w->steepest = fmax(w->steepest, sqrt(change[0]));
  w->steepest_torque = fmax(w->steepest_torque, sqrt(change[1]));
}

static inline void tool_run(tool_world *w, int ticks)
{
  for (int i = 0; i < ticks; ++i) {
    tool_step(w);
  }
}

/* Turned by an angle about y. */
static inline void tool_go(tool_world *w, double x, double y, double z, double angle)
{
  w->pose = (hap_pose){{x, y, z}, {cos(0.5 * angle), 0.0, sin(0.5 * angle), 0.0}};
  memset(&w->twist, 0, sizeof w->twist);
}

static inline double tool_angle(const tool_world *w)
{
  return 2.0 * atan2(w->pose.quat_wxyz[2], w->pose.quat_wxyz[0]);
}

/* There in that many ticks, evenly, turning about y. */
static inline void tool_move(tool_world *w, double x, double y, double z, double angle, int ticks)
{
  const double to[3] = {x, y, z};
  double from[3];
  double before = tool_angle(w);
  memcpy(from, w->pose.position, sizeof from);
  for (int i = 1; i <= ticks; ++i) {
    double share = (double)i / ticks;
    tool_go(w, from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]),
            from[2] + share * (to[2] - from[2]), before + share * (angle - before));
    for (int k = 0; k < 3; ++k) {
      w->twist.linear[k] = (to[k] - from[k]) / ticks * 1e3;
    }
    w->twist.angular[1] = (angle - before) / ticks * 1e3;
    tool_step(w);
  }
  memset(&w->twist, 0, sizeof w->twist);
}

#endif
