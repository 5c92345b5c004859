/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Accelerance of the neighbours (paper sections 4.2 and 4.3, eq. 3-6). Each pointer contact has its
 * own A: acceleration of the body by a force at the contact point. The zero probe is shared, and
 * the contacts of different islands are probed in the same step, as islands do not feel each
 * other: a round perturbs one contact of each island. */

static hapi_body_slot *body_of(hapi_physics *physics, const hapi_contact_slot *contact)
{
  return &physics->near.slots.bodies[contact->body];
}

/* Probes about the forces that the pointers give: friction and contacts are then as they are under
 * the hand, where eq. 4 asks what another force than the hand's would do to a world without it. */
static bool at_operating_point(const hapi_physics *physics)
{
  return physics->cycle.settings.probe == HAP_PROBE_OPERATING &&
         physics->cycle.model == HAP_MODEL_ACCELERANCE;
}

static void add_force(const hapi_physics *physics, const hapi_contact_slot *contact,
                      const double force[3])
{
  dBodyID body =
      physics->world.bodies.entries[physics->near.slots.bodies[contact->body].known].body;
  double arm[3];
  double moment[3];
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
  hapi_v3_cross(arm, force, moment); /* not at a place: far from the origin that has lost digits */
  dBodyAddForce(body, force[0], force[1], force[2]);
  dBodyAddTorque(body, moment[0], moment[1], moment[2]);
}

static void begin_probe(hapi_physics *physics)
{
  const hapi_test_set *test = &physics->probe.test;
  hapi_test_rewind(physics);
  for (uint32_t i = 0; i < test->contact_count && at_operating_point(physics); ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
    add_force(physics, contact, contact->last_force);
  }
}

static hapi_reuse_book *book_of(hapi_physics *physics)
{
  return &physics->probe.reuse.books[0];
}

/* Of a body of model CONTACT that answers as a whole b is found with that answer, operating_point.c. */
static bool takes_b(const hapi_physics *physics, uint32_t index)
{
  const hapi_body_slot *slot = &physics->near.slots.bodies[index];
  bool tested = slot->phase == HAPI_SLOT_LIVE && (slot->flags & HAPI_BODY_DRIVEN) == 0 &&
                physics->world.bodies.entries[slot->known].island != HAPI_NONE;
  bool whole = physics->cycle.model == HAP_MODEL_CONTACT &&
               (slot->flags & HAPI_BODY_MEASURED) != 0 && hapi_test_is_whole(physics, index);
  return tested && !whole;
}

/* Eq. 3 with no force, or those of the operating point: b, from which those are taken out later. */
static void measure_b(hapi_physics *physics)
{
  begin_probe(physics);
  hapi_test_step(physics);
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (!takes_b(physics, i)) {
      continue;
    }
    double b[6];
    hapi_test_acceleration(physics, slot->known, b);
    slot->b_is_good = hapi_finite(b, 6);
    if (!slot->b_is_good) {
      hapi_reuse_spoil(physics, book_of(physics), slot->known);
    }
    if (slot->b_is_good) {
      memcpy(slot->b, b, sizeof b);
    }
  }
}

/* Eq. 4: as large as the pointer's last force, so that A fits what the hand is doing. Before the
 * first touch that is zero and cannot be used: then the peak of the force that the touch will give,
 * v sqrt(k m). At least a small share of the weight. */
static double size_of_eq4(hapi_physics *physics, const hapi_contact_slot *contact)
{
  double last = hapi_v3_norm(contact->last_force);
  double mass = body_of(physics, contact)->mass;
  double touch = contact->speed * sqrt(contact->stiffness * mass);
  double least = HAPI_PROBE_FLOOR * HAPI_STANDARD_GRAVITY * mass;
  double wanted = last > 0.0 ? last : touch;
  return wanted > least ? wanted : least; /* less would drown in the solver's rounding */
}

double hapi_accelerance_push(hapi_physics *physics, const hapi_contact_slot *contact)
{
  return at_operating_point(physics)
             ? HAPI_PROBE_FLOOR * HAPI_STANDARD_GRAVITY * body_of(physics, contact)->mass
             : size_of_eq4(physics, contact);
}

#define TORSION 3 /* the axis after x, y and z: a torque about the normal, for soft fingers */

static bool has_axis(const hapi_physics *physics, const hapi_contact_slot *contact, int axis)
{
  return axis != TORSION || (physics->cycle.model == HAP_MODEL_ACCELERANCE && contact->mu > 0.0 &&
                             contact->finger_radius > 0.0);
}

/* About the operating point it is small, and goes into the body: a pull at a body that does not feel
 * the pointer yet would take it off what stands behind it. */
static double perturbation(hapi_physics *physics, const hapi_contact_slot *contact, int axis)
{
  const hapi_body_slot *body = body_of(physics, contact);
  double normal[3];
  double size = hapi_accelerance_push(physics, contact);
  if (!at_operating_point(physics)) {
    return size;
  }
  hapi_quat_rotate(hapi_test_state(physics, body->known)->quat, contact->normal_body, normal);
  return axis != TORSION && normal[axis] > 0.0 ? -size : size;
}

/* One column of eq. 5 and 6 for each contact of the round. */
static void measure_column(hapi_physics *physics, hapi_contact_slot *contact, int axis)
{
  const hapi_body_slot *body = body_of(physics, contact);
  double force = perturbation(physics, contact, axis);
  double acceleration[6];
  hapi_test_acceleration(physics, body->known, acceleration);
  for (int i = 0; i < 6; ++i) {
    double change = acceleration[i] - body->b[i];
    if (axis == TORSION) {
      contact->measured_turn[i] = change / (force * contact->finger_radius);
    } else {
      contact->measured[i][axis] = change / force;
    }
  }
  if (axis != TORSION) {
    hapi_cross_column(physics, contact, axis, force);
  }
}

/* As large as the force at the finger's radius. */
static void twist(hapi_physics *physics, const hapi_contact_slot *contact)
{
  dBodyID body = physics->world.bodies.entries[body_of(physics, contact)->known].body;
  double torque[3];
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->normal_body, torque);
  hapi_v3_scale(perturbation(physics, contact, TORSION) * contact->finger_radius, torque, torque);
  dBodyAddTorque(body, torque[0], torque[1], torque[2]);
}

static void push(hapi_physics *physics, const hapi_contact_slot *contact, int axis)
{
  double force[3] = {0.0, 0.0, 0.0};
  force[axis] = perturbation(physics, contact, axis);
  add_force(physics, contact, force);
}

void hapi_accelerance_free_body(dBodyID body, const dReal rotation[12], hapi_free_body *out)
{
  dMass mass;
  double inertia[9];
  double inverse[9];
  double r[9];
  dBodyGetMass(body, &mass);
  for (int i = 0; i < 9; ++i) {
    inertia[i] = mass.I[4 * (i / 3) + i % 3];
    r[i] = rotation[4 * (i / 3) + i % 3];
  }
  hapi_m3_invert(inertia, inverse);
  hapi_m3_turn(r, inverse, out->inverse_inertia);
  out->inverse_mass = 1.0 / mass.mass;
}

/* Within 0 and what it is of the free body: about the normal, the direction that is used. What only a
 * contact makes of a torque is left as it is measured. */
static void keep_turn(hapi_contact_slot *contact, const hapi_free_body *free,
                      const double normal[3])
{
  double of_free[3];
  hapi_m3_apply(free->inverse_inertia, normal, of_free);
  double most = hapi_v3_dot(normal, of_free);
  double turn = hapi_v3_dot(normal, contact->measured_turn + 3);
  double kept = fmin(fmax(turn, 0.0), most);
  if (hapi_finite(contact->measured_turn, 6)) {
    memcpy(contact->turn, contact->measured_turn, sizeof contact->turn);
    hapi_v3_madd(contact->turn + 3, kept - turn, normal, contact->turn + 3);
  }
}

/* A of eq. 6 when it can be one; else the last good one stays, and at first that of a body that does
 * not give way. */
static void keep(hapi_physics *physics, hapi_contact_slot *contact)
{
  hap_stats *stats = &physics->counts.own.stats;
  const hapi_body_slot *slot = body_of(physics, contact);
  const hapi_body_state *tested = hapi_test_state(physics, slot->known);
  hapi_admittance kind = HAPI_ADMITTANCE_SINGULAR;
  if (slot->b_is_good) {
    hapi_free_body free;
    double arm[3];
    double normal[3];
    hapi_accelerance_free_body(tested->body, tested->rotation, &free);
    hapi_quat_rotate(tested->quat, contact->point_body, arm);
    hapi_quat_rotate(tested->quat, contact->normal_body, normal);
    kind = hapi_admittance_tidy_point(&free, arm, normal, contact->measured);
    if (has_axis(physics, contact, TORSION)) {
      keep_turn(contact, &free, normal);
    }
  }
  stats->probes.singular += kind == HAPI_ADMITTANCE_SINGULAR;
  stats->probes.clipped += kind == HAPI_ADMITTANCE_CLIPPED;
  if (kind != HAPI_ADMITTANCE_SINGULAR) {
    memcpy(contact->a, contact->measured, sizeof contact->a);
    contact->probed = true;
  } else {
    hapi_reuse_spoil(physics, book_of(physics), slot->known);
  }
}

/* ---- bodies that nothing holds ---- */

/* What a step makes of such a body is known without one. Damping and the limit of its turning are ODE's own
 * affair, and so is an inertia that turns with it; and what sleeps has no contacts to be seen. */
static bool is_free(dBodyID body)
{
  dMass mass;
  double inertia[9];
  dBodyGetMass(body, &mass);
  for (int i = 0; i < 9; ++i) {
    inertia[i] = mass.I[4 * (i / 3) + i % 3];
  }
  bool limited = dBodyGetMaxAngularSpeed(body) < (double)dInfinity;
  return dBodyIsEnabled(body) && dBodyGetNumJoints(body) == 0 && !limited &&
         dBodyGetLinearDamping(body) == 0.0 && dBodyGetAngularDamping(body) == 0.0 &&
         (dBodyGetGyroscopicMode(body) == 0 || hapi_turns_alike(inertia));
}

static void fill_free(const hapi_physics *physics, hapi_body_slot *slot, dBodyID body)
{
  hapi_free_body free;
  dVector3 gravity = {0.0, 0.0, 0.0};
  hapi_accelerance_free_body(body, dBodyGetRotation(body), &free);
  if (dBodyGetGravityMode(body) != 0) {
    dWorldGetGravity(physics->world.ode.world, gravity);
  }
  const hapi_known_rest *rest =
      physics->world.bodies.entries[slot->known].rest; /* as a probe has them */
  hapi_v3_madd(gravity, free.inverse_mass, rest->user_force, slot->b);
  hapi_m3_apply(free.inverse_inertia, rest->user_torque, slot->b + 3);
}

/* Of a force at the contact point: 1/m, and I^-1 times the arm crossed with it. */
static void fill_free_contact(dBodyID body, hapi_contact_slot *contact)
{
  hapi_free_body free;
  double arm[3];
  double normal[3];
  hapi_accelerance_free_body(body, dBodyGetRotation(body), &free);
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->normal_body, normal);
  for (int axis = 0; axis < 3; ++axis) {
    double unit[3] = {axis == 0, axis == 1, axis == 2};
    double moment[3];
    double turn[3];
    hapi_v3_cross(arm, unit, moment);
    hapi_m3_apply(free.inverse_inertia, moment, turn);
    for (int i = 0; i < 3; ++i) {
      contact->a[i][axis] = i == axis ? free.inverse_mass : 0.0;
      contact->a[3 + i][axis] = turn[i];
    }
  }
  memset(contact->turn, 0, sizeof contact->turn);
  hapi_m3_apply(free.inverse_inertia, normal, contact->turn + 3);
  contact->probed = true;
}

/* The effect testing=auto: before the islands are gathered. */
static void take_free(hapi_physics *physics)
{
  bool looks = physics->cycle.model == HAP_MODEL_ACCELERANCE &&
               hapi_wish(physics->cycle.wishes, HAP_EFFECT_TESTING) == HAP_EFFECT_AUTO &&
               physics->cycle.settings.probe != HAP_PROBE_PAPER;
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    bool live = slot->phase == HAPI_SLOT_LIVE && (slot->flags & HAPI_BODY_DRIVEN) == 0;
    dBodyID body = live ? physics->world.bodies.entries[slot->known].body : NULL;
    slot->known_free = looks && body != NULL && is_free(body);
    if (slot->known_free) {
      fill_free(physics, slot, body);
    }
  }
  for (uint32_t i = 0; looks && i < physics->near.slots.contact_high; ++i) {
    hapi_contact_slot *contact = &physics->near.slots.contacts[i];
    if (contact->phase == HAPI_SLOT_LIVE && contact->body != HAPI_SLOT_NONE &&
        physics->near.slots.bodies[contact->body].known_free) {
      fill_free_contact(
          physics->world.bodies.entries[physics->near.slots.bodies[contact->body].known].body,
          contact);
    }
  }
}

static bool any_has_axis(const hapi_physics *physics, uint32_t round, int axis)
{
  const hapi_test_set *test = &physics->probe.test;
  bool any = false;
  for (uint32_t i = 0; i < test->contact_count; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
    any = any || (contact->round == round && has_axis(physics, contact, axis));
  }
  return any;
}

static void perturb(hapi_physics *physics, uint32_t round, int axis)
{
  const hapi_test_set *test = &physics->probe.test;
  begin_probe(physics);
  for (uint32_t i = 0; i < test->contact_count; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
    if (contact->round == round && has_axis(physics, contact, axis)) {
      if (axis == TORSION) {
        twist(physics, contact);
      } else {
        push(physics, contact, axis);
      }
    }
  }
}

/* Three probes for the contacts of one round, and a fourth one for soft fingers. */
static void measure_round(hapi_physics *physics, uint32_t round)
{
  const hapi_test_set *test = &physics->probe.test;
  for (int axis = 0; axis <= TORSION; ++axis) {
    if (!any_has_axis(physics, round, axis)) {
      continue;
    }
    perturb(physics, round, axis);
    hapi_test_step(physics);
    for (uint32_t i = 0; i < test->contact_count; ++i) {
      hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
      if (contact->round == round && has_axis(physics, contact, axis)) {
        measure_column(physics, contact, axis);
      }
    }
  }
  for (uint32_t i = 0; i < test->contact_count; ++i) {
    hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
    if (contact->round == round) {
      keep(physics, contact);
      hapi_cross_keep(physics, test->contacts[i]);
    }
  }
}

/* The loop adds A f itself, with the A that it is given: b + A f is what was measured with f, whatever
 * became of A. */
static void take_forces_out(hapi_physics *physics)
{
  const hapi_test_set *test = &physics->probe.test;
  if (!at_operating_point(physics)) {
    return;
  }
  for (uint32_t i = 0; i < test->contact_count; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
    hapi_body_slot *body = body_of(physics, contact);
    for (int k = 0; k < 6 && body->b_is_good; ++k) {
      body->b[k] -= hapi_v3_dot(contact->a[k], contact->last_force);
    }
  }
  hapi_cross_take_out(physics);
}

/* Numbers the contacts of each island from 0; how many rounds that makes. With probe=paper each
 * contact has a round of its own. */
static uint32_t plan_rounds(hapi_physics *physics)
{
  const hapi_test_set *test = &physics->probe.test;
  uint32_t most = 0;
  memset(test->rounds, 0, test->island_count * sizeof *test->rounds);
  for (uint32_t i = 0; i < test->contact_count; ++i) {
    hapi_contact_slot *contact = &physics->near.slots.contacts[test->contacts[i]];
    uint32_t known = body_of(physics, contact)->known;
    uint32_t *count = &test->rounds[physics->world.bodies.entries[known].island];
    contact->round = physics->cycle.settings.probe == HAP_PROBE_PAPER ? i : *count;
    ++*count;
    most = *count > most ? *count : most;
  }
  return physics->cycle.settings.probe == HAP_PROBE_PAPER ? test->contact_count : most;
}

static void measure_rounds(hapi_physics *physics)
{
  uint32_t rounds = plan_rounds(physics);
  for (uint32_t round = 0; round < rounds; ++round) {
    if (round == 0 || physics->cycle.settings.probe == HAP_PROBE_PAPER) {
      measure_b(physics);
    }
    measure_round(physics, round);
  }
  take_forces_out(physics);
}

/* Islands whose A holds still. All are gathered again then. */
static hap_status measure_b_alone(hapi_physics *physics)
{
  if (!hapi_reuse_has(book_of(physics), HAPI_REUSE_A)) {
    return HAP_OK;
  }
  hapi_reuse_select(physics, book_of(physics), HAPI_REUSE_A);
  hap_status status = hapi_test_enter(physics);
  if (status >= HAP_OK) {
    measure_b(physics);
    take_forces_out(physics);
    hapi_test_leave(physics);
    status = hapi_test_gather(physics);
  }
  return status;
}

static hap_status measure(hapi_physics *physics)
{
  hap_status status = hapi_test_gather(physics);
  if (status >= HAP_OK) {
    hapi_reuse_look(physics, book_of(physics), false);
    status = measure_b_alone(physics);
  }
  if (status < HAP_OK) {
    return status;
  }
  hapi_cross_begin(physics, book_of(physics));
  hapi_reuse_select(physics, book_of(physics), HAPI_REUSE_NONE);
  if (physics->probe.test.contact_count > 0) {
    status = hapi_test_enter(physics);
    if (status < HAP_OK) {
      return status;
    }
    measure_rounds(physics);
    hapi_test_leave(physics);
  }
  hapi_reuse_keep(physics, book_of(physics));
  return HAP_OK;
}

void hapi_accelerance_measure(hapi_physics *physics)
{
  if (physics->cycle.model != HAP_MODEL_ACCELERANCE && physics->cycle.model != HAP_MODEL_CONTACT) {
    return;
  }
  take_free(physics);
  if (measure(physics) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; the last A and b stay");
  }
}
