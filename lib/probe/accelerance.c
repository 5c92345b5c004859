/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/probe.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/log.h"
#include "base/vec.h"

/* Accelerance of the neighbours (paper sections 4.2 and 4.3, eq. 3-6). Each pointer contact has its
 * own A: acceleration of the body by a force at the contact point. The zero probe is shared, and
 * the contacts of different islands are probed in the same step, as islands do not feel each
 * other: a round perturbs one contact of each island. */

/* Share of the weight that a probe uses at least where the pointer gave no force yet (eq. 4 would
 * divide by zero). */
#define PUSH_LEAST 0.01
#define TORSION 3 /* the axis after x, y and z: a torque about the normal, for soft fingers */

static uint32_t contact_known(const hapi_probe *probe, const hapi_contact_slot *contact)
{
  HAPI_ASSERT_INDEX(contact->body, probe->slots->body_high);
  return probe->slots->bodies[contact->body].known;
}

/* Probes about the forces that the pointers give: friction and contacts are then as they are under
 * the hand, where eq. 4 asks what another force than the hand's would do to a world without it. */
static bool at_operating_point(const hapi_probe *probe)
{
  return probe->cycle->settings.probe == HAP_PROBE_OPERATING &&
         probe->cycle->model == HAP_MODEL_ACCELERANCE;
}

static hapi_reuse_book *contact_book(hapi_probe *probe)
{
  return &probe->reuse.books[HAPI_REUSE_CONTACTS];
}

/* ---- which contacts ---- */

static bool contact_moves_a_body(const hapi_probe *probe, const hapi_contact_slot *contact)
{
  if (contact->phase != HAPI_SLOT_LIVE || contact->body == HAPI_SLOT_NONE) {
    return false;
  }
  const hapi_body_answer *body = &probe->answers.bodies[contact->body];
  bool needs =
      probe->cycle->model == HAP_MODEL_ACCELERANCE ||
      ((body->flags & HAPI_BODY_MEASURED) != 0 && !hapi_body_is_whole(probe->slots, contact->body));
  return needs && (body->flags & HAPI_BODY_DRIVEN) == 0 && !body->known_free;
}

/* Which bodies the contacts can move: their islands. */
static hap_status contacts_gather(hapi_probe *probe)
{
  hapi_pushed *pushed = &probe->contacts.pushed;
  pushed->count = 0;
  hap_status status = hapi_test_begin(&probe->test, probe->world, hapi_cycle_test_s(probe->cycle));
  for (uint32_t i = 0; i < probe->slots->contact_high && status >= HAP_OK; ++i) {
    const hapi_contact_slot *contact = &probe->slots->contacts[i];
    if (contact_moves_a_body(probe, contact)) {
      bool testable = false;
      status = hapi_probe_add_body(probe, contact->body, &testable);
      if (status >= HAP_OK && testable) {
        HAPI_ASSERT_INDEX(pushed->count, pushed->capacity);
        pushed->slots[pushed->count++] = i;
      }
    }
  }
  return status;
}

/* Eq. 4: as large as the pointer's last force, so that A fits what the hand is doing. Before the
 * first touch that is zero and cannot be used: then the peak of the force that the touch will give,
 * v sqrt(k m). At least a small share of the weight. */
static double contact_push(const hapi_probe *probe, const hapi_contact_slot *contact, double mass)
{
  double least = PUSH_LEAST * HAPI_STANDARD_GRAVITY * mass;
  if (at_operating_point(probe)) {
    return least;
  }
  double last = hapi_v3_norm(contact->last_touch.force);
  double touch = contact->speed * sqrt(contact->stiffness * mass);
  double wanted = last > 0.0 ? last : touch;
  return wanted > least ? wanted : least; /* less would drown in the solver's rounding */
}

/* ---- a testing simulation ---- */

static void contact_add_force(const hapi_probe *probe, const hapi_contact_slot *contact,
                              const double force[3])
{
  dBodyID body = hapi_test_state(&probe->test, contact_known(probe, contact))->body;
  double arm[3];
  double moment[3];
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
  hapi_v3_cross(arm, force, moment); /* not at a place: far from the origin that has lost digits */
  dBodyAddForce(body, force[0], force[1], force[2]);
  dBodyAddTorque(body, moment[0], moment[1], moment[2]);
}

static void contacts_begin_step(hapi_probe *probe)
{
  const hapi_pushed *pushed = &probe->contacts.pushed;
  hapi_test_rewind(&probe->test);
  for (uint32_t i = 0; i < pushed->count && at_operating_point(probe); ++i) {
    const hapi_contact_slot *contact = &probe->slots->contacts[pushed->slots[i]];
    contact_add_force(probe, contact, contact->last_touch.force);
  }
}

/* Of a body of model CONTACT that answers as a whole b is found with that answer,
 * operating_point.c. */
static bool body_takes_b(const hapi_probe *probe, uint32_t index)
{
  const hapi_body_slot *slot = &probe->slots->bodies[index];
  uint32_t flags = probe->answers.bodies[index].flags;
  bool tested = slot->phase == HAPI_SLOT_LIVE && (flags & HAPI_BODY_DRIVEN) == 0 &&
                hapi_test_has(&probe->test, slot->known);
  bool whole = probe->cycle->model == HAP_MODEL_CONTACT && (flags & HAPI_BODY_MEASURED) != 0 &&
               hapi_body_is_whole(probe->slots, index);
  return tested && !whole;
}

/* Eq. 3 with no force, or those of the operating point: b, from which those are taken out later. */
static void bodies_measure_b(hapi_probe *probe)
{
  contacts_begin_step(probe);
  hapi_test_step(&probe->test);
  for (uint32_t i = 0; i < probe->slots->body_high; ++i) {
    hapi_body_answer *answer = &probe->answers.bodies[i];
    if (!body_takes_b(probe, i)) {
      continue;
    }
    double b[6];
    hapi_test_acceleration(&probe->test, probe->slots->bodies[i].known, b);
    answer->b_is_good = hapi_finite(b, 6);
    if (answer->b_is_good) {
      memcpy(answer->b, b, sizeof b);
    } else {
      hapi_reuse_spoil(contact_book(probe), &probe->test, probe->slots->bodies[i].known);
    }
  }
}

static bool contact_has_axis(const hapi_probe *probe, const hapi_contact_slot *contact, int axis)
{
  return axis != TORSION || (probe->cycle->model == HAP_MODEL_ACCELERANCE &&
                             contact->said.mu > 0.0 && contact->finger_radius > 0.0);
}

/* About the operating point it is small, and goes into the body: a pull at a body that does not
 * feel the pointer yet would take it off what stands behind it. */
static double contact_perturbation(const hapi_probe *probe, uint32_t index, int axis)
{
  const hapi_contact_slot *contact = &probe->slots->contacts[index];
  double normal[3];
  double size = probe->answers.contacts[index].push;
  if (!at_operating_point(probe)) {
    return size;
  }
  const hapi_body_state *tested = hapi_test_state(&probe->test, contact_known(probe, contact));
  hapi_quat_rotate(tested->quat, contact->normal_body, normal);
  return axis != TORSION && normal[axis] > 0.0 ? -size : size;
}

static void contact_perturb(const hapi_probe *probe, uint32_t index, int axis)
{
  if (axis == TORSION) {
    /* As large as the force at the finger's radius. */
    const hapi_contact_slot *contact = &probe->slots->contacts[index];
    dBodyID body = hapi_test_state(&probe->test, contact_known(probe, contact))->body;
    double size = contact_perturbation(probe, index, TORSION);
    double torque[3];
    hapi_quat_rotate(dBodyGetQuaternion(body), contact->normal_body, torque);
    hapi_v3_scale(size * contact->finger_radius, torque, torque);
    dBodyAddTorque(body, torque[0], torque[1], torque[2]);
    return;
  }
  double force[3] = {0.0, 0.0, 0.0};
  force[axis] = contact_perturbation(probe, index, axis);
  contact_add_force(probe, &probe->slots->contacts[index], force);
}

/* ---- what comes out ---- */

/* One column of eq. 5 and 6 for a contact of the round. */
static void contact_measure_column(hapi_probe *probe, uint32_t index, int axis,
                                   const hapi_contact_watch *watch)
{
  const hapi_contact_slot *contact = &probe->slots->contacts[index];
  const hapi_body_answer *body = &probe->answers.bodies[contact->body];
  hapi_contact_trial *trial = &probe->contacts.list[index];
  double force = contact_perturbation(probe, index, axis);
  double acceleration[6];
  hapi_test_acceleration(&probe->test, contact_known(probe, contact), acceleration);
  for (int i = 0; i < 6; ++i) {
    double change = acceleration[i] - body->b[i];
    if (axis == TORSION) {
      trial->measured_turn[i] = change / (force * contact->finger_radius);
    } else {
      trial->measured[i][axis] = change / force;
    }
  }
  if (axis != TORSION && watch != NULL) {
    watch->column(watch->user, index, axis, force);
  }
}

void hapi_accelerance_free_body(dBodyID body, const dReal rotation[12], hapi_free_body *out)
{
  dMass mass;
  double inertia[9];
  double inverse[9];
  double r[9];
  dBodyGetMass(body, &mass);
  HAPI_ASSERT(mass.mass > 0.0);
  hapi_matrix_read(mass.I, inertia);
  hapi_matrix_read(rotation, r);
  hapi_m3_invert(inertia, inverse);
  hapi_m3_turn(r, inverse, out->inverse_inertia);
  HAPI_ASSERT_POSITIVE(out->inverse_inertia, 3);
  out->inverse_mass = 1.0 / mass.mass;
}

/* A of eq. 6 when it can be one; else the last good one stays, and at first that of a body that
 * does not give way. */
static void contact_keep(hapi_probe *probe, uint32_t index)
{
  const hapi_contact_slot *contact = &probe->slots->contacts[index];
  uint32_t known = contact_known(probe, contact);
  const hapi_body_state *tested = hapi_test_state(&probe->test, known);
  hapi_contact_trial *trial = &probe->contacts.list[index];
  hapi_contact_answer *answer = &probe->answers.contacts[index];
  hapi_admittance kind = HAPI_ADMITTANCE_SINGULAR;
  if (probe->answers.bodies[contact->body].b_is_good) {
    hapi_free_body free;
    double arm[3];
    double normal[3];
    hapi_accelerance_free_body(tested->body, tested->rotation, &free);
    hapi_quat_rotate(tested->quat, contact->point_body, arm);
    hapi_quat_rotate(tested->quat, contact->normal_body, normal);
    kind = hapi_admittance_tidy_point(&free, arm, normal, trial->measured);
    if (contact_has_axis(probe, contact, TORSION)) {
      /* Within 0 and what it is of the free body: about the normal, the direction that is used.
       * What only a contact makes of a torque is left as it is measured. */
      double *out_turn = answer->turn;
      double of_free[3];
      hapi_m3_apply(free.inverse_inertia, normal, of_free);
      double most = hapi_v3_dot(normal, of_free);
      double turn = hapi_v3_dot(normal, trial->measured_turn + 3);
      double kept = fmin(fmax(turn, 0.0), most);
      if (hapi_finite(trial->measured_turn, 6)) {
        memcpy(out_turn, trial->measured_turn, sizeof trial->measured_turn);
        hapi_v3_madd(out_turn + 3, kept - turn, normal, out_turn + 3);
      }
    }
  }
  hapi_probe_count(probe, kind);
  if (kind != HAPI_ADMITTANCE_SINGULAR) {
    HAPI_ASSERT_FINITE(trial->measured[0], 18);
    memcpy(answer->a, trial->measured, sizeof answer->a);
    answer->probed = true;
  } else {
    hapi_reuse_spoil(contact_book(probe), &probe->test, known);
  }
}

/* ---- bodies that nothing holds ---- */

/* What a step makes of such a body is known without one. Damping and the limit of its turning are
 * ODE's own affair, and so is an inertia that turns with it; and what sleeps has no contacts to be
 * seen. */
static bool body_is_free(dBodyID body)
{
  dMass mass;
  double inertia[9];
  dBodyGetMass(body, &mass);
  hapi_matrix_read(mass.I, inertia);
  bool limited = dBodyGetMaxAngularSpeed(body) < (double)dInfinity;
  return dBodyIsEnabled(body) && dBodyGetNumJoints(body) == 0 && !limited &&
         dBodyGetLinearDamping(body) == 0.0 && dBodyGetAngularDamping(body) == 0.0 &&
         (dBodyGetGyroscopicMode(body) == 0 || hapi_turns_alike(inertia));
}

/* Of a force at the contact point: 1/m, and I^-1 times the arm crossed with it. */
static void contact_fill_free(dBodyID body, const hapi_contact_slot *contact,
                              hapi_contact_answer *out)
{
  hapi_free_body free;
  double arm[3];
  double normal[3];
  hapi_accelerance_free_body(body, dBodyGetRotation(body), &free);
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
  hapi_quat_rotate(dBodyGetQuaternion(body), contact->normal_body, normal);
  hapi_free_point(&free, arm, out->a);
  memset(out->turn, 0, sizeof out->turn);
  hapi_m3_apply(free.inverse_inertia, normal, out->turn + 3);
  out->probed = true;
}

/* The effect testing=auto: before the islands are gathered. */
static void answers_take_free(hapi_probe *probe)
{
  bool looks = probe->cycle->model == HAP_MODEL_ACCELERANCE &&
               hapi_wish(probe->cycle->wishes, HAP_EFFECT_TESTING) == HAP_EFFECT_AUTO &&
               probe->cycle->settings.probe != HAP_PROBE_PAPER;
  for (uint32_t i = 0; i < probe->slots->body_high; ++i) {
    const hapi_body_slot *slot = &probe->slots->bodies[i];
    hapi_body_answer *answer = &probe->answers.bodies[i];
    bool live = slot->phase == HAPI_SLOT_LIVE && (answer->flags & HAPI_BODY_DRIVEN) == 0;
    dBodyID body = live ? probe->world->bodies.entries[slot->known].body : NULL;
    answer->known_free = looks && body != NULL && body_is_free(body);
    if (answer->known_free) {
      const hapi_known_body *known = &probe->world->bodies.entries[slot->known];
      hapi_free_body free;
      dVector3 gravity = {0.0, 0.0, 0.0};
      hapi_accelerance_free_body(known->body, dBodyGetRotation(known->body), &free);
      if (dBodyGetGravityMode(known->body) != 0) {
        dWorldGetGravity(probe->world->ode.world, gravity);
      }
      const hapi_known_rest *rest = known->rest; /* as a probe has them */
      hapi_v3_madd(gravity, free.inverse_mass, rest->user_force, answer->b);
      hapi_m3_apply(free.inverse_inertia, rest->user_torque, answer->b + 3);
    }
  }
  for (uint32_t i = 0; looks && i < probe->slots->contact_high; ++i) {
    const hapi_contact_slot *contact = &probe->slots->contacts[i];
    if (contact->phase == HAPI_SLOT_LIVE && contact->body != HAPI_SLOT_NONE &&
        probe->answers.bodies[contact->body].known_free) {
      uint32_t known = contact_known(probe, contact);
      contact_fill_free(probe->world->bodies.entries[known].body, contact,
                        &probe->answers.contacts[i]);
    }
  }
}

/* ---- rounds ---- */

/* The contact i of those under test, if it is perturbed along the axis in a round; HAPI_NONE: it is
 * not. */
static uint32_t round_contact(const hapi_probe *probe, uint32_t i, uint32_t round, int axis)
{
  uint32_t index = probe->contacts.pushed.slots[i];
  bool has = probe->contacts.list[index].round == round &&
             contact_has_axis(probe, &probe->slots->contacts[index], axis);
  return has ? index : HAPI_NONE;
}

static bool round_has_axis(const hapi_probe *probe, uint32_t round, int axis)
{
  bool any = false;
  for (uint32_t i = 0; i < probe->contacts.pushed.count; ++i) {
    any = any || round_contact(probe, i, round, axis) != HAPI_NONE;
  }
  return any;
}

/* Three probes for the contacts of one round, and a fourth one for soft fingers. */
static void round_measure(hapi_probe *probe, uint32_t round, const hapi_contact_watch *watch)
{
  const hapi_pushed *pushed = &probe->contacts.pushed;
  for (int axis = 0; axis <= TORSION; ++axis) {
    if (!round_has_axis(probe, round, axis)) {
      continue;
    }
    contacts_begin_step(probe);
    for (uint32_t i = 0; i < probe->contacts.pushed.count; ++i) {
      uint32_t index = round_contact(probe, i, round, axis);
      if (index != HAPI_NONE) {
        contact_perturb(probe, index, axis);
      }
    }
    hapi_test_step(&probe->test);
    for (uint32_t i = 0; i < pushed->count; ++i) {
      uint32_t index = round_contact(probe, i, round, axis);
      if (index != HAPI_NONE) {
        contact_measure_column(probe, index, axis, watch);
      }
    }
  }
  for (uint32_t i = 0; i < pushed->count; ++i) {
    uint32_t index = pushed->slots[i];
    if (probe->contacts.list[index].round == round) {
      contact_keep(probe, index);
      if (watch != NULL) {
        watch->keep(watch->user, index);
      }
    }
  }
}

/* The loop adds A f itself, with the A that it is given: b + A f is what was measured with f,
 * whatever became of A. */
static void forces_take_out(hapi_probe *probe, const hapi_contact_watch *watch)
{
  if (!at_operating_point(probe)) {
    return;
  }
  for (uint32_t i = 0; i < probe->contacts.pushed.count; ++i) {
    uint32_t index = probe->contacts.pushed.slots[i];
    const hapi_contact_slot *contact = &probe->slots->contacts[index];
    const hapi_contact_answer *answer = &probe->answers.contacts[index];
    hapi_body_answer *body = &probe->answers.bodies[contact->body];
    for (int k = 0; k < 6 && body->b_is_good; ++k) {
      body->b[k] -= hapi_v3_dot(answer->a[k], contact->last_touch.force);
    }
  }
  for (uint32_t i = 0; watch != NULL && i < probe->slots->body_high; ++i) {
    const hapi_body_slot *slot = &probe->slots->bodies[i];
    if (slot->phase == HAPI_SLOT_LIVE && hapi_test_has(&probe->test, slot->known)) {
      watch->take_out(watch->user, i, probe->answers.bodies[i].b);
    }
  }
}

/* Numbers the contacts of each island from 0; how many rounds that makes. With probe=paper each
 * contact has a round of its own. */
static uint32_t rounds_plan(hapi_probe *probe)
{
  hapi_contact_trials *trials = &probe->contacts;
  uint32_t most = 0;
  memset(trials->rounds, 0, probe->test.island_count * sizeof *trials->rounds);
  for (uint32_t i = 0; i < trials->pushed.count; ++i) {
    uint32_t index = trials->pushed.slots[i];
    uint32_t known = contact_known(probe, &probe->slots->contacts[index]);
    uint32_t *count = &trials->rounds[hapi_test_island(&probe->test, known)];
    trials->list[index].round = probe->cycle->settings.probe == HAP_PROBE_PAPER ? i : *count;
    ++*count;
    most = *count > most ? *count : most;
  }
  return probe->cycle->settings.probe == HAP_PROBE_PAPER ? trials->pushed.count : most;
}

/* Islands whose A holds still. All are gathered again then. */
static hap_status islands_measure_b_alone(hapi_probe *probe, const hapi_contact_watch *watch)
{
  const hapi_reuse_book *book = contact_book(probe);
  if (!hapi_reuse_has(book, HAPI_REUSE_A)) {
    return HAP_OK;
  }
  hapi_reuse_select(book, HAPI_REUSE_A, probe->slots, &probe->test, &probe->contacts.pushed);
  hap_status status = hapi_test_enter(&probe->test);
  if (status >= HAP_OK) {
    bodies_measure_b(probe);
    forces_take_out(probe, watch);
    hapi_test_leave(&probe->test);
    status = contacts_gather(probe);
  }
  return status;
}

static hap_status contacts_measure(hapi_probe *probe, const hapi_contact_watch *watch)
{
  hapi_reuse_book *book = contact_book(probe);
  hap_status status = contacts_gather(probe);
  if (status >= HAP_OK) {
    const hapi_reuse_input input = {probe->cycle, probe->slots, &probe->answers, &probe->test};
    for (uint32_t i = 0; i < probe->contacts.pushed.count; ++i) {
      uint32_t index = probe->contacts.pushed.slots[i];
      const hapi_contact_slot *contact = &probe->slots->contacts[index];
      probe->answers.contacts[index].push =
          contact_push(probe, contact, probe->slots->bodies[contact->body].mass);
    }
    hapi_reuse_look(&probe->reuse, book, &input, &probe->contacts.pushed);
    status = islands_measure_b_alone(probe, watch);
  }
  if (status < HAP_OK) {
    return status;
  }
  if (watch != NULL) {
    watch->begin(watch->user, book);
  }
  hapi_reuse_select(book, HAPI_REUSE_NONE, probe->slots, &probe->test, &probe->contacts.pushed);
  if (probe->contacts.pushed.count > 0) {
    status = hapi_test_enter(&probe->test);
    if (status < HAP_OK) {
      return status;
    }
    uint32_t rounds = rounds_plan(probe);
    for (uint32_t round = 0; round < rounds; ++round) {
      if (round == 0 || probe->cycle->settings.probe == HAP_PROBE_PAPER) {
        bodies_measure_b(probe);
      }
      round_measure(probe, round, watch);
    }
    forces_take_out(probe, watch);
    hapi_test_leave(&probe->test);
  }
  probe->counts.reused += hapi_reuse_keep(book);
  return HAP_OK;
}

void hapi_accelerance_measure(hapi_probe *probe, const hapi_contact_watch *watch)
{
  if (probe->cycle->model != HAP_MODEL_ACCELERANCE && probe->cycle->model != HAP_MODEL_CONTACT) {
    return;
  }
  answers_take_free(probe);
  if (contacts_measure(probe, watch) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; the last A and b stay");
  }
}
