/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tests/stability/bounds.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "base/vec.h"
#include "device/device.h"
#include "haptic/haptic_internal.h"
#include "local/pointer_friction.h"
#include "physics/physics_internal.h"
#include "session/session_internal.h"

#define LEAST_ENERGY 1e-7 /* J: 50 nm of a cube's height; solves may leave 0.1 um a tick */
#define LEAST_DEPTH 1e-7  /* m, of ODE's collider between rounded things */

/* A body as whoever moves it has it, loop or ODE, and as the hand meets it. */
typedef struct seen_body {
  bool there;
  bool owned;
  hap_pose pose;
  hap_twist twist;
  hap_pose met_pose;
  hap_twist met_twist;
} seen_body;

static const hapi_tick *tick_of(const bounds *b)
{
  return &b->w->session->haptic->tick;
}

static bool all_finite(const double *values, int count)
{
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    sum += 0.0 * values[i];
  }
  return sum == 0.0;
}

/* ---- bodies ---- */

static int index_of_slot(const bounds *b, uint32_t slot)
{
  const hapi_physics *physics = b->w->session->physics;
  uint32_t known = slot == HAPI_SLOT_NONE ? HAPI_NONE : physics->near.slots.bodies[slot].known;
  dBodyID body = known == HAPI_NONE ? NULL : physics->world.bodies.entries[known].body;
  for (int i = 0; i < b->w->body_count; ++i) {
    if (body != NULL && b->w->bodies[i] == body) {
      return i;
    }
  }
  return -1;
}

static void see_bodies(const bounds *b, seen_body seen[WORLD_BODIES_MAX])
{
  const hapi_tick *tick = tick_of(b);
  for (int i = 0; i < b->w->body_count; ++i) {
    dBodyID body = b->w->bodies[i];
    seen[i].there = body != NULL;
    seen[i].owned = false;
    if (body != NULL) {
      memcpy(seen[i].pose.position, dBodyGetPosition(body), 3 * sizeof(double));
      memcpy(seen[i].pose.quat_wxyz, dBodyGetQuaternion(body), 4 * sizeof(double));
      memcpy(seen[i].twist.linear, dBodyGetLinearVel(body), 3 * sizeof(double));
      memcpy(seen[i].twist.angular, dBodyGetAngularVel(body), 3 * sizeof(double));
      seen[i].met_pose = seen[i].pose;
      seen[i].met_twist = seen[i].twist;
    }
  }
  for (uint32_t i = 0; i < tick->bodies.live_count; ++i) {
    const hapi_local_body *body = &tick->bodies.of[tick->bodies.live[i]];
    int index = index_of_slot(b, tick->bodies.live[i]);
    if (index >= 0) {
      seen[index].met_pose = body->pose;
      seen[index].met_twist = body->twist;
    }
    if (index >= 0 && (body->flags & HAPI_BODY_OWNED) != 0) {
      seen[index].owned = true;
      seen[index].pose = body->pose;
      seen[index].twist = body->twist;
    }
  }
}

static double kinetic_of(dBodyID body, const seen_body *s)
{
  dMass mass;
  dMatrix3 rotation;
  dVector3 spin; /* in the body */
  dVector3 moment;
  dQuaternion q;
  memcpy(q, s->pose.quat_wxyz, 4 * sizeof(double));
  dBodyGetMass(body, &mass);
  dRfromQ(rotation, q);
  dMultiply1_331(spin, rotation, s->twist.angular);
  dMultiply0_331(moment, mass.I, spin);
  return 0.5 * mass.mass * hapi_v3_dot(s->twist.linear, s->twist.linear) +
         0.5 * hapi_v3_dot(spin, moment);
}

/* J, against where it started. */
static double height_of(const bounds *b, int index, const seen_body *s)
{
  dMass mass;
  dVector3 gravity;
  double way[3];
  dBodyGetMass(b->w->bodies[index], &mass);
  dWorldGetGravity(b->w->world, gravity);
  hapi_v3_sub(s->pose.position, b->w->start[index], way);
  return -mass.mass * hapi_v3_dot(gravity, way);
}

static bool body_is_finite(const seen_body *s, dBodyID body)
{
  return all_finite(s->pose.position, 3) && all_finite(s->pose.quat_wxyz, 4) &&
         all_finite(s->twist.linear, 3) && all_finite(s->twist.angular, 3) &&
         all_finite(s->met_pose.position, 3) && all_finite(s->met_pose.quat_wxyz, 4) &&
         all_finite(s->met_twist.linear, 3) && all_finite(s->met_twist.angular, 3) &&
         all_finite(dBodyGetPosition(body), 3) && all_finite(dBodyGetQuaternion(body), 4) &&
         all_finite(dBodyGetLinearVel(body), 3) && all_finite(dBodyGetAngularVel(body), 3);
}

static double quat_length(const double q[4])
{
  return sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

/* ---- times ---- */

/* Whether the force of a pointer contact is that of the tick's own time, as the body feels it;
 * else it is that of the time after it. */
static bool is_now(const hapi_tick *tick, const hapi_local_contact *c)
{
  const hapi_pointer *p = &tick->pointers.of[c->pointer];
  const hapi_row *row = &tick->rows.solver.rows[c->row];
  double k = p->rigid ? p->coupling.stiffness : c->ramp.share * p->surface.stiffness;
  double stiffness = tick->facts.period * tick->facts.period * k * hapi_dot6(row->ja, row->ba);
  return stiffness <= (p->proxied ? 0.25 : 4.0); /* lib/local/pointer_spring.h */
}

/* J of which springs and bodies are ahead of the hands' work. */
static double contacts_ahead(const bounds *b)
{
  const hapi_tick *tick = tick_of(b);
  double sum = 0.0;
  for (uint32_t i = 0; i < tick->touches.count && b->model == HAP_MODEL_CONTACT; ++i) {
    const hapi_local_contact *c = &tick->touches.of[i];
    if (c->row == HAPI_NO_ROW || c->body == HAPI_SLOT_NONE) {
      continue;
    }
    const hapi_local_body *body = &tick->bodies.of[c->body];
    const hapi_pointer *p = &tick->pointers.of[c->pointer];
    double arm[3];
    double velocity[3];
    hapi_v3_sub(c->point_now, body->pose.position, arm);
    hapi_v3_cross(body->twist.angular, arm, velocity);
    hapi_v3_add(velocity, body->twist.linear, velocity);
    if (p->rigid && p->coupling.mass > 0.0) {
      continue; /* a body that another one hits */
    }
    if (is_now(tick, c)) {
      sum += 0.5 * tick->facts.period * hapi_v3_dot(c->force, velocity);
    } else if (!p->proxied) {
      sum += tick->facts.period * hapi_v3_dot(c->force, p->twist.linear);
    }
  }
  return sum;
}

/* The same of a virtual tool that swings on its spring: pose and velocity are half a tick apart. */
static double tools_ahead(const bounds *b)
{
  const hapi_tick *tick = tick_of(b);
  double sum = 0.0;
  for (int i = 0; i < b->w->hand_count; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    if (p->rigid && p->coupling.mass > 0.0) {
      double apart[3];
      hapi_v3_sub(p->proxy.position, p->handle.position, apart);
      hapi_v3_sub(apart, p->proxy.offset, apart);
      sum +=
          0.5 * tick->facts.period * p->coupling.stiffness * hapi_v3_dot(apart, p->proxy.velocity);
      sum += 0.5 * tick->facts.period * hapi_v3_dot(p->wrench.torque, p->proxy.spin);
    }
  }
  return sum;
}

/* The same of a body that falls: its pose is half a tick ahead of its velocity. One that ODE
 * moves has come to it, or goes from it, with pose and velocity of one time. */
static double fall_ahead(const bounds *b, int index, const seen_body *s)
{
  dMass mass;
  dVector3 gravity;
  if (!s->owned) {
    return 0.0;
  }
  dBodyGetMass(b->w->bodies[index], &mass);
  dWorldGetGravity(b->w->world, gravity);
  return -0.5 * tick_of(b)->facts.period * mass.mass * hapi_v3_dot(gravity, s->twist.linear);
}

/* ---- springs and hands ---- */

static double spring_energy(const bounds *b)
{
  const hapi_tick *tick = tick_of(b);
  double sum = 0.0;
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    const hapi_local_contact *c = &tick->touches.of[i];
    const hapi_pointer *p = &tick->pointers.of[c->pointer];
    if (p->rigid) {
      continue;
    }
    if (c->weight > 0.0) {
      sum += 0.5 * hapi_v3_dot(c->force, c->force) / (c->weight * p->surface.stiffness);
    }
    if (p->surface.finger_radius > 0.0 && hapi_v3_norm(c->force) > 0.0) {
      double turn = hapi_friction_of(&tick->touches, c)->stretch[3];
      sum += 0.5 * c->weight * p->surface.stiffness * turn * turn;
    }
  }
  for (int i = 0; i < b->w->hand_count; ++i) {
    const hapi_pointer *p = &tick->pointers.of[i];
    double apart[3];
    if (p->proxied) {
      hapi_v3_sub(p->proxy.position, p->handle.position, apart);
      hapi_v3_sub(apart, p->proxy.offset, apart);
      sum += 0.5 * p->coupling.stiffness * hapi_v3_dot(apart, apart);
      sum += 0.5 * p->coupling.mass * hapi_v3_dot(p->proxy.velocity, p->proxy.velocity);
    }
    if (p->proxied && p->shape.hull != NULL) {
      sum += 0.5 * hapi_v3_dot(p->wrench.torque, p->wrench.torque) / p->coupling.spin_stiffness;
      sum += 0.5 * p->coupling.inertia * hapi_v3_dot(p->proxy.spin, p->proxy.spin);
    }
  }
  return sum;
}

/* Takes the way of a hand since the last tick into the account. */
static void look_at_hand(bounds *b, int index, double *work, double *kinetic)
{
  const hapi_pointer *p = &tick_of(b)->pointers.of[index];
  hapi_virtual_port was = b->ports[index];
  hapi_virtual_port *now = &b->ports[index];
  double period = 1.0 / b->w->def.haptic_hz;
  double way[3];
  hapi_virtual_get_port(hapi_device_self(b->w->devices[index]), now);
  hapi_v3_sub(now->position, was.position, way);
  double mean = hapi_v3_dot(way, way) / (period * period);
  double ends =
      0.5 * (hapi_v3_dot(was.velocity, was.velocity) + hapi_v3_dot(now->velocity, now->velocity));
  b->loss += b->w->device_damping * period * (2.0 * mean + ends) / 3.0;
  double held_back[3];
  hapi_v3_sub(p->guard.wanted.force, p->guard.written.force, held_back);
  b->cut += fmin(0.0, hapi_v3_dot(held_back, way));
  *work += now->work;
  *kinetic += 0.5 * now->mass * hapi_v3_dot(now->velocity, now->velocity) +
              0.5 * now->inertia * hapi_v3_dot(now->turn_rate, now->turn_rate);
  double turn[3];
  hapi_v3_sub(now->turn, was.turn, turn);
  hapi_v3_sub(p->guard.wanted.torque, p->guard.written.torque, held_back);
  b->cut += fmin(0.0, hapi_v3_dot(held_back, turn));
  double written = hapi_v3_norm(p->guard.written.force);
  b->worst.force = fmax(b->worst.force, fmax(written, hapi_v3_norm(now->force)));
  b->worst.finite = b->worst.finite && all_finite(now->position, 3) &&
                    all_finite(now->velocity, 3) && isfinite(written) && isfinite(now->work) &&
                    all_finite(p->wrench.force, 3) && all_finite(p->pose.position, 3) &&
                    all_finite(p->twist.linear, 3) && all_finite(p->proxy.position, 3);
}

/* ---- the bounds ---- */

/* ODE moves what is touched, and hears of it at the end of an interval. */
static bool answers_late(const bounds *b)
{
  return b->row->late || b->model != HAP_MODEL_CONTACT;
}

static void look_at_energy(bounds *b, const seen_body seen[WORLD_BODIES_MAX])
{
  double work = 0.0;
  double held = 0.0;
  double kinetic = 0.0;
  double height = 0.0;
  for (int i = 0; i < b->w->hand_count; ++i) {
    look_at_hand(b, i, &work, &held);
  }
  for (int i = 0; i < b->w->body_count; ++i) {
    if (seen[i].there) {
      kinetic += kinetic_of(b->w->bodies[i], &seen[i]);
      height += height_of(b, i, &seen[i]) - fall_ahead(b, i, &seen[i]);
      double way[3];
      hapi_v3_sub(seen[i].pose.position, b->w->start[i], way);
      b->worst.way = fmax(b->worst.way, hapi_v3_norm(way));
      b->worst.finite = b->worst.finite && body_is_finite(&seen[i], b->w->bodies[i]);
      b->worst.unit = fmax(b->worst.unit, fabs(quat_length(seen[i].pose.quat_wxyz) - 1.0));
    }
  }
  kinetic -= contacts_ahead(b) + tools_ahead(b);
  if (b->ticks == 0) {
    b->given = b->row->given + kinetic + height;
  }
  double before = b->ticks >= b->interval ? b->work[b->ticks % b->interval] : 0.0;
  b->work[b->ticks % b->interval] = work;
  double springs = spring_energy(b);
  double late = answers_late(b) ? fabs(work - before) : 0.0;
  double made = work - b->loss + b->cut + kinetic + height - b->given - late;
  b->made_max = fmax(b->made_max, made);
  b->least = fmin(b->least, made + springs);
  b->gain = fmax(b->gain, made + springs - b->least);
  b->stored_max = fmax(b->stored_max, kinetic + held + springs);
  b->worst.finite = b->worst.finite && isfinite(work + kinetic + height);
}

static void look_at_depth(bounds *b, const seen_body seen[WORLD_BODIES_MAX])
{
  const hapi_tick *tick = tick_of(b);
  double step = b->model == HAP_MODEL_SINGLE ? tick->facts.period : 1.0 / b->w->def.physics_hz;
  for (uint32_t i = 0; i < tick->touches.count; ++i) {
    const hapi_local_contact *c = &tick->touches.of[i];
    const hapi_pointer *p = &tick->pointers.of[c->pointer];
    int index = index_of_slot(b, c->body);
    dContactGeom found;
    dQuaternion q;
    if (index < 0 || b->clones[index] == NULL || c->tool != 0) {
      continue; /* a tool is no ball */
    }
    const seen_body *s = &seen[index];
    memcpy(q, s->met_pose.quat_wxyz, 4 * sizeof(double));
    const double *at = s->met_pose.position;
    dGeomSetPosition(b->clones[index], at[0], at[1], at[2]);
    dGeomSetQuaternion(b->clones[index], q);
    dGeomSetPosition(b->balls[c->pointer], p->pose.position[0], p->pose.position[1],
                     p->pose.position[2]);
    if (dCollide(b->balls[c->pointer], b->clones[index], 1, &found, sizeof found) == 1) {
      double arm[3];
      hapi_v3_sub(found.pos, at, arm);
      double speed = hapi_v3_norm(p->twist.linear) + hapi_v3_norm(s->met_twist.linear) +
                     hapi_v3_norm(s->met_twist.angular) * hapi_v3_norm(arm);
      double yields = p->rigid ? 0.0 : hapi_v3_norm(c->force) / p->surface.stiffness;
      double allowed = yields + speed * step + b->row->depth;
      b->worst.depth = fmax(b->worst.depth, found.depth);
      b->worst.deeper = fmax(b->worst.deeper, found.depth / (allowed + LEAST_DEPTH));
    }
  }
}

static void look_at_momentum(bounds *b)
{
  hap_stats stats;
  double now = tick_of(b)->touches.hand_impulse_abs;
  double before = b->ticks >= b->interval ? b->impulse[b->ticks % b->interval] : 0.0;
  b->impulse[b->ticks % b->interval] = now;
  if (hap_session_stats(b->w->session, &stats, sizeof stats) != HAP_OK) {
    b->worst.finite = false;
    return;
  }
  /* of one interval, and rounding */
  double allowed = now - before + 1e-9 * now + 1e-12;
  b->worst.residual = fmax(b->worst.residual, stats.hand.momentum_error_ns / allowed);
  b->worst.finite = b->worst.finite && isfinite(stats.hand.momentum_error_ns);
  b->worst.fault = stats.faults.fault != 0 ? stats.faults.fault : b->worst.fault;
  b->worst.contact_ticks = stats.loop.contact_ticks;
}

/* The shape alone, of a body with one geom in its middle. */
static dGeomID clone_geom(dGeomID geom)
{
  dReal a;
  dReal c;
  dVector3 edges;
  if (geom == NULL || dBodyGetNextGeom(geom) != NULL || dGeomIsOffset(geom)) {
    return NULL;
  }
  switch (dGeomGetClass(geom)) {
    case dSphereClass:
      return dCreateSphere(NULL, dGeomSphereGetRadius(geom));
    case dBoxClass:
      dGeomBoxGetLengths(geom, edges);
      return dCreateBox(NULL, edges[0], edges[1], edges[2]);
    case dCapsuleClass:
      dGeomCapsuleGetParams(geom, &a, &c);
      return dCreateCapsule(NULL, a, c);
    case dCylinderClass:
      dGeomCylinderGetParams(geom, &a, &c);
      return dCreateCylinder(NULL, a, c);
    default:
      return NULL;
  }
}

void bounds_begin(bounds *b, const case_row *row, world *w, hap_model model)
{
  memset(b, 0, sizeof *b);
  b->row = row;
  b->w = w;
  b->model = model;
  b->worst.finite = true;
  double step = model == HAP_MODEL_SINGLE ? 1.0 : ceil(w->def.haptic_hz / w->def.physics_hz);
  b->interval = (uint64_t)(model == HAP_MODEL_IMPULSE ? 2.0 * step : step) + 2;
  for (int i = 0; i < w->body_count; ++i) {
    b->clones[i] = clone_geom(dBodyGetFirstGeom(w->bodies[i]));
  }
  for (int i = 0; i < w->hand_count; ++i) {
    b->balls[i] = dCreateSphere(NULL, w->pointer.radius);
    hapi_virtual_get_port(hapi_device_self(w->devices[i]), &b->ports[i]);
  }
}

void bounds_look(bounds *b)
{
  seen_body seen[WORLD_BODIES_MAX];
  see_bodies(b, seen);
  look_at_energy(b, seen);
  look_at_momentum(b);
  if (b->worst.finite) {
    look_at_depth(b, seen);
  }
  ++b->ticks;
}

void bounds_end(bounds *b)
{
  for (int i = 0; i < WORLD_BODIES_MAX; ++i) {
    if (b->clones[i] != NULL) {
      dGeomDestroy(b->clones[i]);
    }
  }
  for (int i = 0; i < WORLD_HANDS_MAX; ++i) {
    if (b->balls[i] != NULL) {
      dGeomDestroy(b->balls[i]);
    }
  }
}

double bounds_energy(const bounds *b)
{
  return b->made_max / fmax(b->stored_max, LEAST_ENERGY);
}

double bounds_gain(const bounds *b)
{
  return fmax(0.0, b->gain - b->row->given) / fmax(b->stored_max, LEAST_ENERGY);
}

static void bound_note(char *out, size_t size, bool broken, const char *what)
{
  size_t length = strlen(out);
  if (broken) {
    snprintf(out + length, size - length, " %s", what);
  }
}

bool bounds_hold(const bounds *b, char *out_broken, size_t size)
{
  out_broken[0] = '\0';
  bound_note(out_broken, size, !b->worst.finite, "finite");
  bound_note(out_broken, size, b->worst.fault != HAP_FAULT_NONE, "fault");
  bound_note(out_broken, size, !(b->worst.force <= b->w->max_force * (1.0 + 1e-12)), "force");
  bound_note(out_broken, size, !(bounds_energy(b) <= BOUNDS_ENERGY), "energy");
  double gain = b->row->gain > 0.0 ? b->row->gain : BOUNDS_ENERGY;
  bound_note(out_broken, size, !answers_late(b) && !(bounds_gain(b) <= gain), "gain");
  bound_note(out_broken, size, !(b->worst.deeper <= 1.0), "depth");
  bound_note(out_broken, size, !(b->worst.residual <= 1.0), "momentum");
  bound_note(out_broken, size, !(b->worst.unit <= BOUNDS_UNIT), "unit");
  bound_note(out_broken, size, !(b->worst.way <= b->row->room), "room");
  bound_note(out_broken, size, b->worst.contact_ticks == 0, "nothing was touched");
  return out_broken[0] == '\0';
}
