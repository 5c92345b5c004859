/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* The effect testing=on of model CONTACT. What the loop owns needs no testing simulation; here it has some all
 * the same, 1 + 3 for each neighbour, of its whole island with all contacts and joints, about the force that
 * the pointer gives. What they foretell of the next interval is held against what the loop then made of it:
 * a measure of what lies beyond the range, and of what is linear about the scene. */

#define PROBE_SHARE 0.01 /* of the weight */

bool hapi_range_error_wanted(const hapi_physics *physics)
{
  return physics->cycle.model == HAP_MODEL_CONTACT &&
         hapi_wish_is_on(physics->cycle.wishes, HAP_EFFECT_TESTING);
}

static dBodyID body_of(const hapi_physics *physics, const hapi_body_slot *slot)
{
  return physics->world.bodies.entries[slot->known].body;
}

static void read_twist(dBodyID body, double out[6])
{
  hapi_v3_copy(dBodyGetLinearVel(body), out);
  hapi_v3_copy(dBodyGetAngularVel(body), out + 3);
}

/* ---- the last forecast ---- */

static void compare(hapi_physics *physics, hapi_body_slot *slot)
{
  const hapi_known_body *known = &physics->world.bodies.entries[slot->known];
  double now[6];
  double impulse[3];
  double error2 = 0.0;
  double foretold2 = 0.0;
  read_twist(known->body, now);
  hapi_v3_sub(slot->gain_taken, slot->foretold_gain, impulse);
  for (int i = 0; i < 6; ++i) {
    double weight = i < 3 ? 1.0 : known->extent;
    double foretold = weight * (physics->cycle.step_s * slot->foretold_b[i] +
                                hapi_v3_dot(slot->foretold_a[i], impulse));
    double error = weight * (now[i] - slot->foretold_twist[i]) - foretold;
    error2 += error * error;
    foretold2 += foretold * foretold;
  }
  physics->counts.own.range_error2 += error2;
  physics->counts.own.foretold2 += foretold2;
}

static void compare_all(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    bool goes_on = slot->phase == HAPI_SLOT_LIVE && slot->foretold && slot->loop_owned &&
                   !slot->pose_changed && !slot->velocity_changed && physics->cycle.has_new_state;
    if (goes_on) {
      compare(physics, slot);
    }
    slot->foretold = false;
  }
}

/* ---- the next one ---- */

/* The contact of a sphere that touches the body; NULL: it is pushed at its centre. */
static const hapi_contact_slot *contact_of(const hapi_physics *physics, uint32_t body)
{
  for (uint32_t i = 0; i < physics->near.slots.contact_high; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[i];
    if (contact->phase == HAPI_SLOT_LIVE && contact->body == body && !contact->is_tool) {
      return contact;
    }
  }
  return NULL;
}

static void push(const hapi_physics *physics, uint32_t index, const double force[3])
{
  const hapi_contact_slot *contact = contact_of(physics, index);
  dBodyID body = body_of(physics, &physics->near.slots.bodies[index]);
  dBodyAddForce(body, force[0], force[1], force[2]);
  if (contact != NULL) {
    double arm[3];
    double moment[3];
    hapi_quat_rotate(dBodyGetQuaternion(body), contact->point_body, arm);
    hapi_v3_cross(arm, force, moment);
    dBodyAddTorque(body, moment[0], moment[1], moment[2]);
  }
}

static void begin_probe(hapi_physics *physics)
{
  hapi_test_rewind(physics);
  for (uint32_t i = 0; i < physics->probe.test.body_count; ++i) {
    const hapi_contact_slot *contact = contact_of(physics, physics->probe.test.bodies[i]);
    if (contact != NULL) {
      push(physics, physics->probe.test.bodies[i], contact->last_force);
    }
  }
}

/* b without the force of the pointer, which is in the impulse that is compared. */
static void foretell(hapi_physics *physics, uint32_t index, const double base[6])
{
  hapi_body_slot *slot = &physics->near.slots.bodies[index];
  const hapi_contact_slot *contact = contact_of(physics, index);
  const double force = PROBE_SHARE * HAPI_STANDARD_GRAVITY * slot->mass;
  for (int axis = 0; axis < 3; ++axis) {
    double along[3] = {0.0, 0.0, 0.0};
    double column[6];
    along[axis] = force;
    begin_probe(physics);
    push(physics, index, along);
    hapi_test_step(physics);
    hapi_test_acceleration(physics, slot->known, column);
    for (int i = 0; i < 6; ++i) {
      slot->foretold_a[i][axis] = (column[i] - base[i]) / force;
    }
  }
  for (int i = 0; i < 6; ++i) {
    slot->foretold_b[i] =
        base[i] - (contact != NULL ? hapi_v3_dot(slot->foretold_a[i], contact->last_force) : 0.0);
  }
  const hapi_body_state *before = hapi_test_state(physics, slot->known);
  hapi_v3_copy(before->linear, slot->foretold_twist);
  hapi_v3_copy(before->angular, slot->foretold_twist + 3);
  hapi_v3_copy(slot->gain_taken, slot->foretold_gain);
  slot->foretold = hapi_finite(slot->foretold_a[0], 18) && hapi_finite(slot->foretold_b, 6);
}

static void measure(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  begin_probe(physics);
  hapi_test_step(physics);
  for (uint32_t i = 0; i < test->body_count; ++i) {
    hapi_test_acceleration(physics, physics->near.slots.bodies[test->bodies[i]].known,
                           test->base[i]);
  }
  for (uint32_t i = 0; i < test->body_count; ++i) {
    foretell(physics, test->bodies[i], test->base[i]);
  }
}

void hapi_range_error_measure(hapi_physics *physics)
{
  if (!hapi_range_error_wanted(physics)) {
    return;
  }
  compare_all(physics);
  /* Not in the collision phase: who asks for a surface first says in which order a pair is looked at. */
  physics->counts.own.stats.faults.contacts_rejected +=
      hapi_world_collide_carried(&physics->world, &physics->cycle);
  hap_status status = hapi_test_gather_owned(physics);
  physics->probe.test.keeps_order = true;
  if (status >= HAP_OK && physics->probe.test.body_count > 0) {
    status = hapi_test_enter(physics);
  }
  if (status < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; no error of the range is told");
  } else if (physics->probe.test.body_count > 0) {
    measure(physics);
    hapi_test_leave(physics);
  }
  physics->probe.test.keeps_order = false;
  dJointGroupEmpty(physics->world.carried_group);
}
