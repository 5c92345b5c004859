/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ode/ode.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "probe/reuse.h"

/* All that decides what a testing simulation finds. Lengths are compared as they are, turns at
 * the far point of a body, velocities by the way of a step, forces by the way that they would
 * push the body in one. What only has kinds or is set by the application must be the same.
 * Bodies are known by their birth and not by their address, so that a replay decides as the run
 * did; geoms by what their contacts are. */

#define SAME (-1.0)

typedef struct printer {
  const hapi_reuse_input *input;
  hapi_reuse_book *book;
  hapi_reuse_island *island;
  bool good; /* false: something has no getter, or there is no memory */
} printer;

/* weight as in an item */
static void print_value(printer *p, double value, double weight)
{
  hapi_print_sheet *sheet = &p->book->now;
  bool room =
      sheet->count < sheet->capacity ||
      hapi_reserve((void **)&sheet->items, &sheet->capacity, sheet->count, 1, sizeof *sheet->items);
  if (!room || (weight >= 0.0 && !isfinite(value))) {
    p->good = false;
    return;
  }
  sheet->items[sheet->count++] = (hapi_print_item){value, value, weight};
}

static void print_vector(printer *p, const double *values, int count, double weight)
{
  for (int i = 0; i < count; ++i) {
    print_value(p, values[i], weight);
  }
}

/* ---- joints ---- */

/* What ODE's getters say of a joint. Some of it has none: how a fixed joint or a slider has its
 * bodies turned. That shows as an error of the joint, which is in b; so b of an island with
 * joints is always measured. Of LMotor and Plane2D the axes or motors have no getter, and a
 * transmission is not probed. */

static void print_joint(printer *p, dJointID joint, double arm)
{
  const hapi_joint_traits *traits = hapi_joint_traits_of(joint);
  if (traits == NULL || !traits->told) {
    p->good = false;
    return;
  }
  void (*const points[])(dJointID, dVector3) = {traits->anchor, traits->anchor2};
  void (*const axes[])(dJointID, dVector3) = {traits->axis, traits->axis2, traits->axis3};
  dReal (*const angles[])(dJointID) = {traits->angle, traits->angle2};
  static const int names[] = {dParamLoStop,        dParamHiStop,        dParamVel,
                              dParamFMax,          dParamFudgeFactor,   dParamBounce,
                              dParamCFM,           dParamStopERP,       dParamStopCFM,
                              dParamSuspensionERP, dParamSuspensionCFM, dParamERP};
  for (int group = 0; group < traits->groups; ++group) {
    for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
      print_value(p, traits->get(joint, names[i] + group * dParamGroup), -1.0);
    }
  }
  dVector3 v = {0.0, 0.0, 0.0, 0.0};
  for (int i = 0; i < 2 && points[i] != NULL; ++i) {
    points[i](joint, v);
    print_vector(p, v, 3, 1.0);
  }
  for (int i = 0; i < 3 && axes[i] != NULL; ++i) {
    axes[i](joint, v);
    print_vector(p, v, 3, arm);
  }
  if (traits->length != NULL) {
    print_value(p, traits->length(joint), 1.0);
  }
  for (int i = 0; i < 2 && angles[i] != NULL; ++i) {
    print_value(p, angles[i](joint), arm);
  }
  if (traits->type == dJointTypeAMotor) {
    dVector3 axis = {0.0, 0.0, 0.0, 0.0};
    int count = dJointGetAMotorNumAxes(joint);
    print_value(p, count, -1.0);
    print_value(p, dJointGetAMotorMode(joint), -1.0);
    for (int i = 0; i < count; ++i) {
      print_value(p, dJointGetAMotorAxisRel(joint, i), -1.0);
      dJointGetAMotorAxis(joint, i, axis);
      print_vector(p, axis, 3, arm);
      print_value(p, dJointGetAMotorAngle(joint, i), arm);
    }
  }
}

static void print_hash(printer *p, uint64_t hash)
{
  print_value(p, (double)(uint32_t)hash, SAME);
  print_value(p, (double)(hash >> 32), SAME);
}

static void print_world(printer *p)
{
  const hapi_cycle *cycle = p->input->cycle;
  dWorldID world = p->input->test->world->ode.world;
  dVector3 gravity = {0.0, 0.0, 0.0, 0.0};
  dWorldGetGravity(world, gravity);
  print_vector(p, gravity, 3, SAME);
  print_value(p, dWorldGetERP(world), SAME);
  print_value(p, dWorldGetCFM(world), SAME);
  print_value(p, dWorldGetQuickStepNumIterations(world), SAME);
  print_value(p, dWorldGetQuickStepW(world), SAME);
  print_value(p, dWorldGetContactMaxCorrectingVel(world), SAME);
  print_value(p, dWorldGetContactSurfaceLayer(world), SAME);
  print_value(p, cycle->probe_step_s, SAME);
  print_value(p, cycle->model, SAME);
  print_value(p, hapi_wish(cycle->wishes, HAP_EFFECT_CROSS), SAME);
}

/* ---- bodies ---- */

/* How far a value of a body moves it in a step. */
typedef struct measures {
  double arm;      /* m, to its far point */
  double velocity; /* m per m/s */
  double force;    /* m per N */
  double torque;   /* m per N m, at the far point */
} measures;

static const hapi_known_body *known_body(const printer *p, uint32_t known)
{
  return &p->input->test->world->bodies.entries[known];
}

static void body_measures(const printer *p, uint32_t known, const dMass *mass, measures *out)
{
  double step = p->input->cycle->probe_step_s;
  double extent = known_body(p, known)->extent;
  double inertia[9];
  double inverse[9];
  hapi_matrix_read(mass->I, inertia);
  hapi_m3_invert(inertia, inverse);
  out->arm = extent > 0.0 ? extent : 1.0;
  out->velocity = step;
  out->force = step * step / mass->mass;
  out->torque = step * step * out->arm * (inverse[0] + inverse[4] + inverse[8]);
}

static void print_wrench(printer *p, const double *force, const double *torque, const measures *m)
{
  print_vector(p, force, 3, m->force);
  print_vector(p, torque, 3, m->torque);
}

/* ---- contacts and joints ---- */

static uint64_t body_birth(const printer *p, dBodyID body)
{
  uint32_t known = hapi_bodies_find(&p->input->test->world->bodies, body);
  return known != HAPI_NONE ? known_body(p, known)->rest->birth : 0;
}

/* Directions that are those of one of the bodies. */
#define MOTIONS (dContactMotion1 | dContactMotion2 | dContactMotionN)

/* A space gives a pair in any order. */
static void print_contact(printer *p, dJointID joint, double arm)
{
  hapi_print_sheet *sheet = &p->book->now;
  const dContact *contact = hapi_world_contact_of(p->input->test->world, joint);
  p->good = p->good && contact != NULL &&
            hapi_reserve((void **)&sheet->touches, &sheet->touch_capacity, sheet->touch_count, 1,
                         sizeof *sheet->touches);
  if (!p->good) {
    return;
  }
  hapi_touch_print *out = &sheet->touches[sheet->touch_count++];
  memset(out, 0, sizeof *out);
  uint64_t first = body_birth(p, dJointGetBody(joint, 0));
  uint64_t second = body_birth(p, dJointGetBody(joint, 1));
  bool turned = first > second && (contact->surface.mode & MOTIONS) == 0;
  out->births[0] = turned ? second : first;
  out->births[1] = turned ? first : second;
  const dSurfaceParameters *s = &contact->surface;
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
  out->surface = hash;
  out->arm = arm;
  hapi_v3_copy(contact->geom.pos, out->position);
  hapi_v3_scale(turned ? -1.0 : 1.0, contact->geom.normal, out->normal);
  out->depth = contact->geom.depth;
  if ((contact->surface.mode & dContactFDir1) != 0) {
    hapi_v3_copy(contact->fdir1, out->direction);
  }
}

static void print_held(printer *p, dJointID joint, double arm)
{
  if (dJointGetType(joint) == dJointTypeContact) {
    print_contact(p, joint, arm);
    return;
  }
  p->island->has_joints = true;
  print_value(p, dJointGetType(joint), SAME);
  for (int i = 0; i < 2; ++i) {
    print_hash(p, body_birth(p, dJointGetBody(joint, i)));
  }
  print_joint(p, joint, arm);
}

/* A joint of two moving bodies is met at the first of them. */
static bool joint_is_met_at(dBodyID body, dJointID joint)
{
  dBodyID first = dJointGetBody(joint, 0);
  return first == NULL || first == body || dBodyIsKinematic(first);
}

static void print_member(printer *p, uint32_t known)
{
  const hapi_known_body *entry = known_body(p, known);
  dBodyID body = entry->body;
  dMass mass;
  measures m;
  dBodyGetMass(body, &mass);
  body_measures(p, known, &mass, &m);
  print_hash(p, entry->rest->birth);
  /* The loop's slot: what is found is kept there. */
  uint32_t index = entry->slot;
  bool local = index != HAPI_NONE;
  print_value(p, index, SAME);
  print_value(p, local ? p->input->slots->bodies[index].generation : 0, SAME);
  print_value(p, local ? p->input->answers->bodies[index].flags & HAPI_BODY_DRIVEN : 0, SAME);
  print_value(p, mass.mass, SAME);
  for (int i = 0; i < 3; ++i) {
    print_vector(p, mass.I + (size_t)4 * (size_t)i, 3, SAME);
  }
  print_value(p, dBodyIsKinematic(body), SAME);
  print_value(p, dBodyGetGravityMode(body), SAME);
  print_value(p, dBodyGetGyroscopicMode(body), SAME);
  print_value(p, dBodyGetLinearDamping(body), SAME);
  print_value(p, dBodyGetAngularDamping(body), SAME);
  print_value(p, dBodyGetLinearDampingThreshold(body), SAME);
  print_value(p, dBodyGetAngularDampingThreshold(body), SAME);
  print_value(p, dBodyGetMaxAngularSpeed(body), SAME);
  print_vector(p, dBodyGetPosition(body), 3, 1.0);
  print_vector(p, dBodyGetQuaternion(body), 4, 2.0 * m.arm);
  print_vector(p, dBodyGetLinearVel(body), 3, m.velocity);
  print_vector(p, dBodyGetAngularVel(body), 3, m.velocity * m.arm);
  print_wrench(p, dBodyGetForce(body), dBodyGetTorque(body), &m);
  print_wrench(p, entry->rest->user_force, entry->rest->user_torque, &m);
  int joints = dBodyIsKinematic(body) ? 0 : dBodyGetNumJoints(body);
  for (int i = 0; i < joints && p->good; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    if (dJointIsEnabled(joint) && joint_is_met_at(body, joint)) {
      print_held(p, joint, m.arm);
    }
  }
}

/* ---- what is pushed ---- */

static void print_pushed_contact(printer *p, uint32_t index)
{
  const hapi_contact_slot *contact = &p->input->slots->contacts[index];
  const hapi_contact_answer *answer = &p->input->answers->contacts[index];
  uint32_t known = p->input->slots->bodies[contact->body].known;
  dMass mass;
  measures m;
  dBodyGetMass(known_body(p, known)->body, &mass);
  body_measures(p, known, &mass, &m);
  print_value(p, index, SAME);
  print_value(p, contact->generation, SAME);
  print_value(p, contact->body, SAME);
  print_value(p, answer->probed, SAME);
  print_value(p, contact->said.mu > 0.0, SAME);
  print_value(p, contact->finger_radius, SAME);
  print_vector(p, contact->point_body, 3, 1.0);
  print_vector(p, contact->normal_body, 3, m.arm);
  print_vector(p, contact->last_touch.force, 3, m.force);
  print_value(p, answer->push, m.force);
}

static void print_pushed_body(printer *p, uint32_t index)
{
  const hapi_body_slot *slot = &p->input->slots->bodies[index];
  dMass mass;
  measures m;
  dBodyGetMass(known_body(p, slot->known)->body, &mass);
  body_measures(p, slot->known, &mass, &m);
  print_value(p, index, SAME);
  print_value(p, slot->generation, SAME);
  print_value(p, p->input->answers->bodies[index].measured, SAME);
  print_value(p, m.arm, SAME);
  print_wrench(p, slot->exchanged, slot->exchanged + 3, &m);
}

static int touches_compare(const void *a, const void *b)
{
  const hapi_touch_print *x = a;
  const hapi_touch_print *y = b;
  int first = (x->births[0] > y->births[0]) - (x->births[0] < y->births[0]);
  int second = (x->births[1] > y->births[1]) - (x->births[1] < y->births[1]);
  return first != 0 ? first : second;
}

static int births_compare(const void *a, const void *b)
{
  const hapi_member_birth *x = a;
  const hapi_member_birth *y = b;
  return (x->birth > y->birth) - (x->birth < y->birth);
}

/* Members are gathered along their contacts, which come in any order. */
static bool members_sort(printer *p)
{
  hapi_reuse_book *book = p->book;
  const hapi_reuse_island *island = p->island;
  if (!hapi_reserve((void **)&book->births, &book->birth_capacity, 0, island->member_count,
                    sizeof *book->births)) {
    return false;
  }
  for (uint32_t i = 0; i < island->member_count; ++i) {
    uint32_t known = p->input->test->members[island->first_member + i];
    book->births[i].known = known;
    book->births[i].birth = known_body(p, known)->rest->birth;
  }
  qsort(book->births, island->member_count, sizeof *book->births, births_compare);
  return true;
}

/* A body that goes farther than that within a step will be elsewhere, or will have another
 * velocity: what is found now cannot be used again. Most islands that a hand pushes are left out
 * here. */
static bool island_moves_on(const printer *p)
{
  const hapi_cycle *cycle = p->input->cycle;
  double most = cycle->settings.reuse / cycle->probe_step_s;
  for (uint32_t i = 0; i < p->island->member_count; ++i) {
    uint32_t known = p->input->test->members[p->island->first_member + i];
    const hapi_known_body *entry = known_body(p, known);
    double arm = entry->extent > 0.0 ? entry->extent : 1.0;
    if (hapi_v3_norm(dBodyGetLinearVel(entry->body)) > most ||
        arm * hapi_v3_norm(dBodyGetAngularVel(entry->body)) > most) {
      return true;
    }
  }
  return false;
}

bool hapi_print_island(const hapi_reuse_input *input, hapi_reuse_book *book, hapi_reuse_island *of)
{
  printer holder = {input, book, of, true};
  printer *p = &holder;
  of->first = book->now.count;
  of->first_touch = book->now.touch_count;
  p->good = !island_moves_on(p) && members_sort(p);
  if (!p->good) {
    return false;
  }
  print_world(p);
  for (uint32_t i = 0; i < of->member_count && p->good; ++i) {
    print_member(p, book->births[i].known);
  }
  for (uint32_t i = of->pushed; i != HAPI_NONE && p->good; i = book->next_pushed[i]) {
    if (book->bodies) {
      print_pushed_body(p, i);
    } else {
      print_pushed_contact(p, i);
    }
  }
  of->count = book->now.count - of->first;
  of->touch_count = book->now.touch_count - of->first_touch;
  if (of->touch_count > 0) { /* else there may be none at all yet, nor a place for them */
    hapi_touch_print *touches = book->now.touches + of->first_touch;
    qsort(touches, of->touch_count, sizeof *touches, touches_compare);
  }
  return p->good;
}
