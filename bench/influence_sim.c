/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */

#include "bench/influence_sim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CONTACTS_MOST 8 /* of a pair */
#define CONTACTS_PER_BOX 96
#define PUSHES_LEAST 1e-3    /* of a box's weight: a contact that pushes */
#define SATURATED_LEAST 0.99 /* of the bound of friction */
#define SEED 1               /* ODE's solver takes rows in random order */

/* ---- the world ---- */

bool influence_sim_init(influence_sim *sim, const peer_world *world, int iterations)
{
  memset(sim, 0, sizeof *sim);
  sim->world = world;
  if (!peer_ode_world_create(world, false, &sim->ode)) {
    return false;
  }
  dWorldSetQuickStepNumIterations(sim->ode.world, iterations);
  sim->group = dJointGroupCreate(0);
  sim->motors = dJointGroupCreate(0);
  peer_reach_find(world, &sim->reach);
  sim->contact_capacity = CONTACTS_PER_BOX * world->count;
  sim->roles = calloc(world->count, sizeof *sim->roles);
  sim->given = calloc(world->count, sizeof *sim->given);
  sim->contacts = calloc(sim->contact_capacity, sizeof *sim->contacts);
  sim->feedback = calloc(sim->contact_capacity, sizeof *sim->feedback);
  for (size_t i = 0; i < world->count; ++i) {
    dBodySetData(sim->ode.bodies[i], (void *)(uintptr_t)i);
  }
  return sim->roles != NULL && sim->given != NULL && sim->contacts != NULL && sim->feedback != NULL;
}

void influence_sim_finish(influence_sim *sim)
{
  if (sim->group != NULL) {
    dJointGroupDestroy(sim->group);
    dJointGroupDestroy(sim->motors);
  }
  peer_ode_world_destroy(&sim->ode);
  free(sim->roles);
  free(sim->given);
  free(sim->contacts);
  free(sim->feedback);
  memset(sim, 0, sizeof *sim);
}

void influence_sim_save(const influence_sim *sim, influence_motion *out)
{
  for (size_t i = 0; i < sim->world->count; ++i) {
    dBodyID body = sim->ode.bodies[i];
    memcpy(out[i].position, dBodyGetPosition(body), sizeof out[i].position);
    memcpy(out[i].quat_wxyz, dBodyGetQuaternion(body), sizeof out[i].quat_wxyz);
    memcpy(out[i].linear, dBodyGetLinearVel(body), sizeof out[i].linear);
    memcpy(out[i].angular, dBodyGetAngularVel(body), sizeof out[i].angular);
  }
}

void influence_sim_restore(influence_sim *sim, const influence_motion *motions)
{
  dJointGroupEmpty(sim->group);
  dJointGroupEmpty(sim->motors);
  sim->contact_count = 0;
  for (size_t i = 0; i < sim->world->count; ++i) {
    const influence_motion *m = &motions[i];
    dBodyID body = sim->ode.bodies[i];
    sim->roles[i] = INFLUENCE_IN;
    memset(sim->given[i], 0, sizeof sim->given[i]);
    dBodySetDynamic(body);
    dBodyEnable(body);
    dBodySetForce(body, 0.0, 0.0, 0.0);
    dBodySetTorque(body, 0.0, 0.0, 0.0);
    dBodySetGravityMode(body, 1);
    dBodySetPosition(body, m->position[0], m->position[1], m->position[2]);
    dBodySetQuaternion(body, m->quat_wxyz);
    dBodySetLinearVel(body, m->linear[0], m->linear[1], m->linear[2]);
    dBodySetAngularVel(body, m->angular[0], m->angular[1], m->angular[2]);
  }
  dRandSetSeed(SEED);
}

void influence_sim_set(influence_sim *sim, size_t box, influence_role role)
{
  dBodyID body = sim->ode.bodies[box];
  sim->roles[box] = role;
  if (role == INFLUENCE_IN) {
    return;
  }
  dBodySetGravityMode(body, 0);
  if (role == INFLUENCE_STAYS) {
    dBodySetKinematic(body);
  } else if (role == INFLUENCE_ABSENT) {
    dBodyDisable(body);
  }
}

/* A motor along the push, that holds the velocity of now with a bounded force: the same as a
 * friction against it, but that it would also hold against a pull. */
void influence_sim_brace(influence_sim *sim, size_t box, const double push[6], double share)
{
  dBodyID body = sim->ode.bodies[box];
  double size = sqrt(dCalcVectorDot3(push, push));
  influence_sim_set(sim, box, INFLUENCE_BRACED);
  if (size == 0.0 || share <= 0.0) {
    return;
  }
  dJointID motor = dJointCreateLMotor(sim->ode.world, sim->motors);
  dJointAttach(motor, body, NULL);
  dJointSetLMotorNumAxes(motor, 1);
  dJointSetLMotorAxis(motor, 0, 0, push[0] / size, push[1] / size, push[2] / size);
  dJointSetLMotorParam(motor, dParamVel, dCalcVectorDot3(push, dBodyGetLinearVel(body)) / size);
  dJointSetLMotorParam(motor, dParamFMax, share * size);
}

/* ---- a step ---- */

static int box_of(dBodyID body)
{
  return body == NULL ? -1 : (int)(uintptr_t)dBodyGetData(body);
}

static influence_role role_of(const influence_sim *sim, int box)
{
  return box < 0 ? INFLUENCE_STAYS : sim->roles[box];
}

static void contact_note(influence_sim *sim, dJointID joint, const dContact *contact, int x, int y)
{
  if (sim->contact_count == sim->contact_capacity) {
    ++sim->contacts_lost;
    return;
  }
  influence_contact *out = &sim->contacts[sim->contact_count];
  out->joint = joint;
  out->a = x;
  out->b = y;
  memcpy(out->normal, contact->geom.normal, sizeof out->normal);
  dJointSetFeedback(joint, &sim->feedback[sim->contact_count++]);
}

static void sim_near(void *data, dGeomID a, dGeomID b)
{
  influence_sim *sim = data;
  dContact contacts[CONTACTS_MOST];
  dBodyID x = dGeomGetBody(a);
  dBodyID y = dGeomGetBody(b);
  influence_role rx = role_of(sim, box_of(x));
  influence_role ry = role_of(sim, box_of(y));
  bool one_in = rx == INFLUENCE_IN || ry == INFLUENCE_IN;
  if (!peer_ode_collides(sim->world, a, b) || !one_in || rx == INFLUENCE_ABSENT ||
      ry == INFLUENCE_ABSENT) {
    return;
  }
  int count = peer_ode_touch(sim->world, a, b, CONTACTS_MOST, contacts);
  for (int i = 0; i < count; ++i) {
    dJointID joint = dJointCreateContact(sim->ode.world, sim->group, &contacts[i]);
    dJointAttach(joint, x, y);
    contact_note(sim, joint, &contacts[i], box_of(x), box_of(y));
  }
}

static void motion_read(dBodyID body, peer_motion *out)
{
  memcpy(out->position, dBodyGetPosition(body), sizeof out->position);
  memcpy(out->quat_wxyz, dBodyGetQuaternion(body), sizeof out->quat_wxyz);
  memcpy(out->linear, dBodyGetLinearVel(body), sizeof out->linear);
  memcpy(out->angular, dBodyGetAngularVel(body), sizeof out->angular);
}

void influence_sim_step(influence_sim *sim, double t, double out_force[3])
{
  peer_motion motions[PEER_REACH_MAX];
  peer_push pushes[PEER_REACH_MAX];
  for (size_t i = 0; i < sim->reach.count; ++i) {
    motion_read(sim->ode.bodies[sim->reach.boxes[i]], &motions[i]);
  }
  size_t count = peer_hand_push(sim->world, &sim->reach, motions, t, pushes, out_force);
  for (size_t i = 0; i < count; ++i) {
    const double *f = pushes[i].force;
    const double *p = pushes[i].point;
    dBodyAddForceAtPos(sim->ode.bodies[pushes[i].box], f[0], f[1], f[2], p[0], p[1], p[2]);
  }
  for (size_t i = 0; i < sim->world->count; ++i) {
    const double *w = sim->given[i];
    dBodyAddForce(sim->ode.bodies[i], w[0], w[1], w[2]);
    dBodyAddTorque(sim->ode.bodies[i], w[3], w[4], w[5]);
  }
  dJointGroupEmpty(sim->group);
  sim->contact_count = 0;
  dSpaceCollide(sim->ode.space, sim, sim_near);
  dWorldQuickStep(sim->ode.world, INFLUENCE_TICK_S);
}

/* ---- contacts ---- */

static int by_boxes(const void *x, const void *y)
{
  const influence_pair *a = x;
  const influence_pair *b = y;
  return a->a != b->a ? (a->a > b->a) - (a->a < b->a) : (a->b > b->b) - (a->b < b->b);
}

/* Of the pyramid of friction: the directions are ODE's own. */
static uint32_t saturated_of(const double force[3], const double normal[3], double push, double mu)
{
  dVector3 along;
  dVector3 across;
  dVector3 n = {normal[0], normal[1], normal[2]};
  dPlaneSpace(n, along, across);
  double bound = SATURATED_LEAST * mu * push;
  return (uint32_t)(fabs(dCalcVectorDot3(force, along)) >= bound) +
         (uint32_t)(fabs(dCalcVectorDot3(force, across)) >= bound);
}

static void contact_read(const influence_sim *sim, size_t index, influence_pair *out)
{
  const influence_contact *c = &sim->contacts[index];
  const dJointFeedback *f = &sim->feedback[index];
  bool turned = c->b < c->a; /* floor and lower number first */
  int known = c->a < 0 ? c->b : c->a;
  bool b_first = turned || c->a < 0; /* ODE has a body before the floor */
  const double *forces[2] = {b_first ? f->f2 : f->f1, b_first ? f->f1 : f->f2};
  const double *torques[2] = {b_first ? f->t2 : f->t1, b_first ? f->t1 : f->t2};
  double push = fabs(dCalcVectorDot3(forces[1], c->normal));
  double weight = sim->world->boxes[known].mass * sim->world->gravity;
  memset(out, 0, sizeof *out);
  out->a = turned ? c->b : c->a;
  out->b = turned ? c->a : c->b;
  for (int k = 0; k < 3; ++k) {
    out->on_a[k] = out->a < 0 ? 0.0 : forces[0][k];
    out->on_a[k + 3] = out->a < 0 ? 0.0 : torques[0][k];
    out->on_b[k] = forces[1][k];
    out->on_b[k + 3] = torques[1][k];
  }
  if (push > PUSHES_LEAST * weight) {
    out->normals = 1;
    out->saturated = saturated_of(forces[1], c->normal, push, sim->world->mu);
  }
}

size_t influence_sim_pairs(const influence_sim *sim, influence_pair *out)
{
  size_t count = 0;
  for (size_t i = 0; i < sim->contact_count; ++i) {
    contact_read(sim, i, &out[i]);
  }
  qsort(out, sim->contact_count, sizeof *out, by_boxes);
  for (size_t i = 0; i < sim->contact_count; ++i) {
    if (count > 0 && by_boxes(&out[count - 1], &out[i]) == 0) {
      influence_pair *sum = &out[count - 1];
      sum->normals += out[i].normals;
      sum->saturated += out[i].saturated;
      for (int k = 0; k < 6; ++k) {
        sum->on_a[k] += out[i].on_a[k];
        sum->on_b[k] += out[i].on_b[k];
      }
    } else {
      out[count++] = out[i];
    }
  }
  return count;
}
