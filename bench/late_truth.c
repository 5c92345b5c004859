/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "bench/late_truth.h"

#include <math.h>
#include <string.h>

#include <hapode/ode.h>

/* Three closed forms.
 *
 * Way. In a gap nobody steps the bodies, and the hand goes on. Gaps of 5 ms and less take no force,
 * so a hand of v is deeper by v t, and a spring of k has k v t more.
 *
 * Blow. While only every n-th tick runs, bodies have 1 / n of their speed. A hand that went along
 * with one at v meets a wall that goes away at v / n. The spring stops the rest of its speed,
 * u = v (1 - 1 / n). With w^2 = (k + k_h) / m and the damping ratio z the largest force more is
 *
 *   k u / w exp(-z / sqrt(1 - z^2) acos z)
 *
 * Swing. Then the force falls to 1 / n, and the spring to k / n: so much a device holds. A hand
 * that pressed with F falls in. Its rest is F (1 - 1 / n) / (k / n + k_h) farther, and it swings
 * about that:
 *
 *   F / n + (k / n) F (1 - 1 / n) / (k / n + k_h) (1 + exp(-pi z / sqrt(1 - z^2)))
 *
 * This is most where n is 2 to 3, and not at the longest gap. The longest of the last gaps is
 * slowly forgotten, so every n up to it counts.
 *
 * A prescribed hand neither stops nor swings: its force is that of the spring at its true depth. */

#define LATE_TRUTH_HZ 1000.0 /* of the loop */
#define GAP_MOST 5           /* ms, that take no force */
#define LATE_TAKES 0.25      /* of the force, that less force for late ticks takes in one of them */

late_hand late_hand_of(const char *spec)
{
  static const struct {
    const char *word;
    late_hand hand;
  } hands[] = {{"hand=rigid", {.known = true, .prescribed = true}},
               {"hand=relaxed", {true, false, 0.2, 3.0, 150.0}},
               {"hand=tense", {true, false, 0.3, 10.0, 800.0}}};
  for (size_t i = 0; spec != NULL && i < sizeof hands / sizeof hands[0]; ++i) {
    if (strstr(spec, hands[i].word) != NULL && strstr(spec, "mass=") == NULL) {
      return hands[i].hand;
    }
  }
  return (late_hand){.known = false};
}

static double damping_ratio(const late_hand *hand, double stiffness, double damping)
{
  double z = (hand->damping + damping) / (2.0 * sqrt(hand->mass * (stiffness + hand->stiffness)));
  return fmin(z, 1.0 - 1e-9);
}

static double late_blow(const late_hand *hand, const late_touch *touch, double speed, double n)
{
  double k = touch->stiffness;
  double z = damping_ratio(hand, k, touch->damping);
  double w = sqrt((k + hand->stiffness) / hand->mass);
  return k * speed * (1.0 - 1.0 / n) / w * exp(-z / sqrt(1.0 - z * z) * acos(z));
}

/* In forces with which the hand pressed. */
static double late_swing(const late_hand *hand, const late_touch *touch, double n)
{
  double k = touch->stiffness / n;
  double z = damping_ratio(hand, k, touch->damping / n);
  double farther = (1.0 - 1.0 / n) / (k + hand->stiffness);
  return 1.0 / n + k * farther * (1.0 + exp(-M_PI * z / sqrt(1.0 - z * z)));
}

double late_demands(const late_hand *hand, const late_touch *touch, double force, double speed,
                    int n)
{
  double gap = 1e-3 * fmin(n - 1, GAP_MOST);
  double more = touch->stiffness * speed * gap;
  double swing = 1.0;
  if (hand->prescribed) {
    return force + more;
  }
  more = fmax(more, late_blow(hand, touch, speed, n));
  for (int i = 2; i <= n; ++i) {
    swing = fmax(swing, late_swing(hand, touch, i));
  }
  return (force + more) * swing;
}

/* ---- the spring at its true depth ---- */

static double length_of(const double v[3])
{
  return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* m, of a ball in a box; at: its middle in the box's frame. */
static double box_depth(const double at[3], const double edges[3], double radius)
{
  double outside = 0.0;
  double inside = -INFINITY;
  for (int i = 0; i < 3; ++i) {
    double beyond = fabs(at[i]) - 0.5 * edges[i];
    outside += beyond > 0.0 ? beyond * beyond : 0.0;
    inside = fmax(inside, beyond);
  }
  return radius - (outside > 0.0 ? sqrt(outside) : inside);
}

/* pose: of the geom's body; NULL: it has none. */
static double geom_depth(dGeomID geom, const hap_pose *pose, const double at[3], double radius)
{
  dVector4 plane;
  dVector3 edges;
  dMatrix3 turn = {0.0};
  double local[3] = {0.0, 0.0, 0.0};
  if (dGeomGetClass(geom) == dPlaneClass) {
    dGeomPlaneGetParams(geom, plane);
    return radius - (plane[0] * at[0] + plane[1] * at[1] + plane[2] * at[2] - plane[3]);
  }
  const dReal *middle = pose != NULL ? pose->position : dGeomGetPosition(geom);
  if (pose != NULL) {
    dQtoR(pose->quat_wxyz, turn);
  } else {
    memcpy(turn, dGeomGetRotation(geom), sizeof turn);
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      local[i] += turn[4 * k + i] * (at[k] - middle[k]);
    }
  }
  if (dGeomGetClass(geom) == dSphereClass) {
    return radius + dGeomSphereGetRadius(geom) - length_of(local);
  }
  if (dGeomGetClass(geom) == dCapsuleClass) {
    dReal thick;
    dReal length;
    dGeomCapsuleGetParams(geom, &thick, &length);
    local[2] -= fmax(fmin(local[2], 0.5 * length), -0.5 * length);
    return radius + thick - length_of(local);
  }
  dGeomBoxGetLengths(geom, edges);
  return box_depth(local, edges, radius);
}

static const hap_pose *body_pose(const scene *s, const late_bodies *bodies, dGeomID geom)
{
  for (size_t i = 0; i < s->body_count; ++i) {
    if (s->bodies[i] == dGeomGetBody(geom)) {
      return &bodies->poses[i];
    }
  }
  return NULL;
}

static bool scene_is_simple(const scene *s)
{
  bool simple = s->body_count <= LATE_BODIES_MAX && !(s->parameters.tool[0] > 0.0);
  for (int i = 0; i < dSpaceGetNumGeoms(s->space); ++i) {
    int kind = dGeomGetClass(dSpaceGetGeom(s->space, i));
    simple = simple && (kind == dBoxClass || kind == dPlaneClass || kind == dSphereClass ||
                        kind == dCapsuleClass);
  }
  return simple;
}

/* N, of spring and damper at a depth that grows at a rate. */
static double spring_force(const scene_parameters *p, double depth, double rate)
{
  return fmax(p->stiffness * depth + p->damping * rate, 0.0);
}

/* A tick may know a touch as it begins or as it ends: both are right. */
static void geom_press(const scene *s, dGeomID geom, const double at[3], int ticks,
                       const late_bodies *before, late_bodies *io)
{
  const scene_parameters *p = &s->parameters;
  const hap_pose *pose = body_pose(s, before, geom);
  double was = geom_depth(geom, pose, before->at, p->radius);
  double begins = geom_depth(geom, pose, at, p->radius);
  double ends = geom_depth(geom, body_pose(s, io, geom), at, p->radius);
  double rate = LATE_TRUTH_HZ * ((begins - was) / ticks + ends - begins);
  double early = ends > 0.0 ? spring_force(p, ends, rate) : 0.0;
  double late = begins > 0.0 ? spring_force(p, begins, rate) : 0.0;
  io->lowest += fmin(early, late);
  io->highest += fmax(early, late);
}

late_true late_spring(const scene *s, hap_session *session, const late_place *place,
                      late_bodies *io)
{
  const double *at = place->at;
  const int ticks = place->ticks;
  const scene_parameters *p = &s->parameters;
  const late_bodies before = *io;
  const double way[3] = {at[0] - io->at[0], at[1] - io->at[1], at[2] - io->at[2]};
  double moved = LATE_TRUTH_HZ * length_of(way) / ticks;
  double depth = 0.0;
  double speed = 0.0;
  io->known = scene_is_simple(s) &&
              hap_session_poses_now(session, s->bodies, s->body_count, io->poses) >= HAP_OK;
  memcpy(io->at, at, sizeof io->at);
  io->lowest = io->highest = io->speed = 0.0;
  if (!io->known || !before.known) {
    return (late_true){.known = false};
  }
  for (int i = 0; i < dSpaceGetNumGeoms(s->space); ++i) {
    dGeomID geom = dSpaceGetGeom(s->space, i);
    const hap_pose *pose = body_pose(s, &before, geom);
    double deep = geom_depth(geom, pose, at, p->radius);
    geom_press(s, geom, at, ticks, &before, io);
    if (deep > 0.0) {
      depth += deep;
      for (int k = 0; pose != NULL && k < 3; ++k) {
        double went = body_pose(s, io, geom)->position[k] - pose->position[k];
        speed = fmax(speed, fabs(went) * LATE_TRUTH_HZ);
      }
    }
  }
  io->speed = speed;
  speed = fmax(speed, before.speed); /* a sync moves a body between two ticks */
  double press = p->stiffness * depth + (depth > 0.0 ? p->damping * (moved + 2.0 * speed) : 0.0);
  double rubs = sqrt(1.0 + p->friction * p->friction);
  double rises = io->highest - before.lowest;
  double falls = before.highest - (place->less ? 1.0 - LATE_TAKES : 1.0) * io->lowest;
  return (late_true){true, press * rubs, rubs * fmax(rises, falls)};
}
