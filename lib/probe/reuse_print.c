/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* All that decides what a testing simulation finds. Lengths are compared as they are, turns at the far
 * point of a body, velocities by the way of a step, forces by the way that they would push the body in
 * one. What only has kinds or is set by the application must be the same. Bodies are known by their birth and
 * not by their address, so that a replay decides as the run did; geoms by what their contacts are. */

#define SAME (-1.0)

void hapi_print_value(hapi_printer *p, double value, double weight)
{
  hapi_reuse_book *book = p->book;
  bool room = book->count < book->capacity || hapi_reserve((void **)&book->items, &book->capacity,
                                                           book->count, 1, sizeof *book->items);
  if (!room || (weight >= 0.0 && !isfinite(value))) {
    p->good = false;
    return;
  }
  book->items[book->count++] = (hapi_print_item){value, value, weight};
}

void hapi_print_vector(hapi_printer *p, const double *values, int count, double weight)
{
  for (int i = 0; i < count; ++i) {
    hapi_print_value(p, values[i], weight);
  }
}

static void print_hash(hapi_printer *p, uint64_t hash)
{
  hapi_print_value(p, (double)(uint32_t)hash, SAME);
  hapi_print_value(p, (double)(hash >> 32), SAME);
}

static void print_world(hapi_printer *p)
{
  const hapi_physics *physics = p->physics;
  dWorldID world = physics->world.ode.world;
  dVector3 gravity = {0.0, 0.0, 0.0, 0.0};
  dWorldGetGravity(world, gravity);
  hapi_print_vector(p, gravity, 3, SAME);
  hapi_print_value(p, dWorldGetERP(world), SAME);
  hapi_print_value(p, dWorldGetCFM(world), SAME);
  hapi_print_value(p, dWorldGetQuickStepNumIterations(world), SAME);
  hapi_print_value(p, dWorldGetQuickStepW(world), SAME);
  hapi_print_value(p, dWorldGetContactMaxCorrectingVel(world), SAME);
  hapi_print_value(p, dWorldGetContactSurfaceLayer(world), SAME);
  hapi_print_value(p, physics->cycle.probe_step_s, SAME);
  hapi_print_value(p, physics->cycle.model, SAME);
  hapi_print_value(p, hapi_wish(physics->cycle.wishes, HAP_EFFECT_CROSS), SAME);
}

/* ---- bodies ---- */

/* How far a value of a body moves it in a step. */
typedef struct measures {
  double arm;      /* m, to its far point */
  double velocity; /* m per m/s */
  double force;    /* m per N */
  double torque;   /* m per N m, at the far point */
} measures;

static void measure(const hapi_physics *physics, uint32_t known, const dMass *mass, measures *out)
{
  double step = physics->cycle.probe_step_s;
  double extent = physics->world.bodies.entries[known].extent;
  double inertia[9];
  double inverse[9];
  for (int i = 0; i < 9; ++i) {
    inertia[i] = mass->I[4 * (i / 3) + i % 3];
  }
  hapi_m3_invert(inertia, inverse);
  out->arm = extent > 0.0 ? extent : 1.0;
  out->velocity = step;
  out->force = step * step / mass->mass;
  out->torque = step * step * out->arm * (inverse[0] + inverse[4] + inverse[8]);
}

static void print_wrench(hapi_printer *p, const double *force, const double *torque,
                         const measures *m)
{
  hapi_print_vector(p, force, 3, m->force);
  hapi_print_vector(p, torque, 3, m->torque);
}

static void print_mass(hapi_printer *p, dBodyID body, const dMass *mass)
{
  hapi_print_value(p, mass->mass, SAME);
  for (int i = 0; i < 3; ++i) {
    hapi_print_vector(p, mass->I + (size_t)4 * (size_t)i, 3, SAME);
  }
  hapi_print_value(p, dBodyIsKinematic(body), SAME);
  hapi_print_value(p, dBodyGetGravityMode(body), SAME);
  hapi_print_value(p, dBodyGetGyroscopicMode(body), SAME);
  hapi_print_value(p, dBodyGetLinearDamping(body), SAME);
  hapi_print_value(p, dBodyGetAngularDamping(body), SAME);
  hapi_print_value(p, dBodyGetLinearDampingThreshold(body), SAME);
  hapi_print_value(p, dBodyGetAngularDampingThreshold(body), SAME);
  hapi_print_value(p, dBodyGetMaxAngularSpeed(body), SAME);
}

/* The loop's slot: what is found is kept there. */
static void print_slot(hapi_printer *p, uint32_t index)
{
  const hapi_body_slot *slot = index != HAPI_NONE ? &p->physics->near.slots.bodies[index] : NULL;
  hapi_print_value(p, index, SAME);
  hapi_print_value(p, slot != NULL ? slot->generation : 0, SAME);
  hapi_print_value(p, slot != NULL ? slot->flags & HAPI_BODY_DRIVEN : 0, SAME);
}

static void print_body(hapi_printer *p, uint32_t known, const dMass *mass, const measures *m)
{
  const hapi_known_body *entry = &p->physics->world.bodies.entries[known];
  dBodyID body = entry->body;
  print_hash(p, entry->rest->birth);
  print_slot(p, entry->slot);
  print_mass(p, body, mass);
  hapi_print_vector(p, dBodyGetPosition(body), 3, 1.0);
  hapi_print_vector(p, dBodyGetQuaternion(body), 4, 2.0 * m->arm);
  hapi_print_vector(p, dBodyGetLinearVel(body), 3, m->velocity);
  hapi_print_vector(p, dBodyGetAngularVel(body), 3, m->velocity * m->arm);
  print_wrench(p, dBodyGetForce(body), dBodyGetTorque(body), m);
  print_wrench(p, entry->rest->user_force, entry->rest->user_torque, m);
}

/* ---- contacts and joints ---- */

static uint64_t hash_of_surface(const dSurfaceParameters *s)
{
  const double values[] = {s->mode,    s->mu,      s->mu2,        s->rho,      s->rho2,
                           s->rhoN,    s->bounce,  s->bounce_vel, s->soft_erp, s->soft_cfm,
                           s->motion1, s->motion2, s->motionN,    s->slip1,    s->slip2};
  uint64_t hash = 0xcbf29ce484222325u;
  for (size_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
    uint64_t bits;
    memcpy(&bits, &values[i], sizeof bits);
    hash = (hash ^ bits) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  }
  return hash;
}

static uint64_t birth_of(const hapi_physics *physics, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&physics->world.bodies, body);
  return known != HAPI_NONE ? physics->world.bodies.entries[known].rest->birth : 0;
}

/* Directions that are those of one of the bodies. */
#define MOTIONS (dContactMotion1 | dContactMotion2 | dContactMotionN)

/* A space gives a pair in any order. */
static void print_contact(hapi_printer *p, dJointID joint, double arm)
{
  hapi_reuse_book *book = p->book;
  const dContact *contact = hapi_world_contact_of(&p->physics->world, joint);
  p->good = p->good && contact != NULL &&
            hapi_reserve((void **)&book->touches, &book->touch_capacity, book->touch_count, 1,
                         sizeof *book->touches);
  if (!p->good) {
    return;
  }
  hapi_touch_print *out = &book->touches[book->touch_count++];
  memset(out, 0, sizeof *out);
  uint64_t first = birth_of(p->physics, dJointGetBody(joint, 0));
  uint64_t second = birth_of(p->physics, dJointGetBody(joint, 1));
  bool turned = first > second && (contact->surface.mode & MOTIONS) == 0;
  out->births[0] = turned ? second : first;
  out->births[1] = turned ? first : second;
  out->surface = hash_of_surface(&contact->surface);
  out->arm = arm;
  hapi_v3_copy(contact->geom.pos, out->position);
  hapi_v3_scale(turned ? -1.0 : 1.0, contact->geom.normal, out->normal);
  out->depth = contact->geom.depth;
  if ((contact->surface.mode & dContactFDir1) != 0) {
    hapi_v3_copy(contact->fdir1, out->direction);
  }
}

static void print_held(hapi_printer *p, dJointID joint, double arm)
{
  if (dJointGetType(joint) == dJointTypeContact) {
    print_contact(p, joint, arm);
    return;
  }
  p->island->has_joints = true;
  hapi_print_value(p, dJointGetType(joint), SAME);
  for (int i = 0; i < 2; ++i) {
    print_hash(p, birth_of(p->physics, dJointGetBody(joint, i)));
  }
  hapi_print_joint(p, joint, arm);
}

/* A joint of two moving bodies is met at the first of them. */
static bool is_met_here(dBodyID body, dJointID joint)
{
  dBodyID first = dJointGetBody(joint, 0);
  return first == NULL || first == body || dBodyIsKinematic(first);
}

static void print_member(hapi_printer *p, uint32_t known)
{
  dBodyID body = p->physics->world.bodies.entries[known].body;
  dMass mass;
  measures m;
  dBodyGetMass(body, &mass);
  measure(p->physics, known, &mass, &m);
  print_body(p, known, &mass, &m);
  int joints = dBodyIsKinematic(body) ? 0 : dBodyGetNumJoints(body);
  for (int i = 0; i < joints && p->good; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    if (dJointIsEnabled(joint) && is_met_here(body, joint)) {
      print_held(p, joint, m.arm);
    }
  }
}

/* ---- what is pushed ---- */

static void print_pushed_contact(hapi_printer *p, uint32_t index)
{
  const hapi_contact_slot *contact = &p->physics->near.slots.contacts[index];
  uint32_t known = p->physics->near.slots.bodies[contact->body].known;
  dMass mass;
  measures m;
  dBodyGetMass(p->physics->world.bodies.entries[known].body, &mass);
  measure(p->physics, known, &mass, &m);
  hapi_print_value(p, index, SAME);
  hapi_print_value(p, contact->generation, SAME);
  hapi_print_value(p, contact->body, SAME);
  hapi_print_value(p, contact->probed, SAME);
  hapi_print_value(p, contact->mu > 0.0, SAME);
  hapi_print_value(p, contact->finger_radius, SAME);
  hapi_print_vector(p, contact->point_body, 3, 1.0);
  hapi_print_vector(p, contact->normal_body, 3, m.arm);
  hapi_print_vector(p, contact->last_force, 3, m.force);
  hapi_print_value(p, hapi_accelerance_push(p->physics, contact), m.force);
}

static void print_pushed_body(hapi_printer *p, uint32_t index)
{
  const hapi_body_slot *slot = &p->physics->near.slots.bodies[index];
  dMass mass;
  measures m;
  dBodyGetMass(p->physics->world.bodies.entries[slot->known].body, &mass);
  measure(p->physics, slot->known, &mass, &m);
  hapi_print_value(p, index, SAME);
  hapi_print_value(p, slot->generation, SAME);
  hapi_print_value(p, slot->measured, SAME);
  hapi_print_value(p, m.arm, SAME);
  print_wrench(p, slot->exchanged, slot->exchanged + 3, &m);
}

static int compare_pairs(const void *a, const void *b)
{
  const hapi_touch_print *x = a;
  const hapi_touch_print *y = b;
  int first = (x->births[0] > y->births[0]) - (x->births[0] < y->births[0]);
  int second = (x->births[1] > y->births[1]) - (x->births[1] < y->births[1]);
  return first != 0 ? first : second;
}

static void sort_touches(hapi_touch_print *touches, uint32_t count)
{
  if (count > 0) {
    qsort(touches, count, sizeof *touches, compare_pairs);
  }
}

static int compare_births(const void *a, const void *b)
{
  const hapi_member_birth *x = a;
  const hapi_member_birth *y = b;
  return (x->birth > y->birth) - (x->birth < y->birth);
}

/* Members are gathered along their contacts, which come in any order. */
static bool sort_members(hapi_printer *p)
{
  hapi_reuse_book *book = p->book;
  const hapi_reuse_island *island = p->island;
  if (!hapi_reserve((void **)&book->members, &book->member_capacity, 0, island->member_count,
                    sizeof *book->members)) {
    return false;
  }
  for (uint32_t i = 0; i < island->member_count; ++i) {
    uint32_t known = p->physics->probe.test.members[island->first_member + i];
    book->members[i].known = known;
    book->members[i].birth = p->physics->world.bodies.entries[known].rest->birth;
  }
  qsort(book->members, island->member_count, sizeof *book->members, compare_births);
  return true;
}

/* A body that goes farther than that within a step will be elsewhere, or will have another velocity: what is
 * found now cannot be used again. Most islands that a hand pushes are left out here. */
static bool moves_on(const hapi_printer *p)
{
  const hapi_physics *physics = p->physics;
  double most = physics->cycle.settings.reuse / physics->cycle.probe_step_s;
  for (uint32_t i = 0; i < p->island->member_count; ++i) {
    uint32_t known = physics->probe.test.members[p->island->first_member + i];
    const hapi_known_body *entry = &physics->world.bodies.entries[known];
    double arm = entry->extent > 0.0 ? entry->extent : 1.0;
    if (hapi_v3_norm(dBodyGetLinearVel(entry->body)) > most ||
        arm * hapi_v3_norm(dBodyGetAngularVel(entry->body)) > most) {
      return true;
    }
  }
  return false;
}

bool hapi_print_island(hapi_physics *physics, hapi_reuse_book *book, uint32_t island, bool bodies)
{
  hapi_reuse_island *of = &book->islands[island];
  hapi_printer p = {physics, book, of, true};
  of->first = book->count;
  of->first_touch = book->touch_count;
  p.good = !moves_on(&p) && sort_members(&p);
  if (!p.good) {
    return false;
  }
  print_world(&p);
  for (uint32_t i = 0; i < of->member_count && p.good; ++i) {
    print_member(&p, book->members[i].known);
  }
  for (uint32_t i = of->pushed; i != HAPI_NONE && p.good;) {
    if (bodies) {
      print_pushed_body(&p, i);
      i = physics->near.slots.bodies[i].next_pushed;
    } else {
      print_pushed_contact(&p, i);
      i = physics->near.slots.contacts[i].next_pushed;
    }
  }
  of->count = book->count - of->first;
  of->touch_count = book->touch_count - of->first_touch;
  if (of->touch_count > 0) { /* else there may be none at all yet, nor a place for them */
    sort_touches(book->touches + of->first_touch, of->touch_count);
  }
  return p.good;
}
