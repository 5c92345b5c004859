/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* The testing simulation: a step of the global world that is undone afterwards. Only the islands
 * under test are stepped. All probes whose difference is taken step the same islands from the same
 * seed: QuickStep shuffles its rows, and another order gives another error. */

/* Bodies: what lies behind the border of the range is not worth seven steps of a larger island. */
#define EDGE_ISLAND_MAX 64u

static bool dynamic(dBodyID body)
{
  return body != NULL && !dBodyIsKinematic(body);
}

static bool add_member(hapi_physics *physics, uint32_t index, uint32_t island)
{
  hapi_test_set *test = &physics->probe.test;
  if (!hapi_reserve((void **)&test->members, &test->member_capacity, test->member_count, 1,
                    sizeof *test->members)) {
    return false;
  }
  physics->world.bodies.entries[index].island = island;
  physics->world.bodies.entries[index].rest->member = test->member_count;
  test->members[test->member_count++] = index;
  return true;
}

/* Partner of a body in a joint that is switched on; NULL: the static world. */
static dBodyID partner(dBodyID body, dJointID joint)
{
  if (!dJointIsEnabled(joint)) {
    return NULL;
  }
  dBodyID first = dJointGetBody(joint, 0);
  return first == body ? dJointGetBody(joint, 1) : first;
}

/* A kinematic body moves with the island, but nothing passes through it. */
static bool add_partners(hapi_physics *physics, dBodyID body, uint32_t island)
{
  int joints = dBodyGetNumJoints(body);
  for (int i = 0; i < joints; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    if (dJointGetType(joint) != dJointTypeContact) {
      physics->probe.test.mechanisms = true;
    }
    uint32_t other = hapi_bodies_find(&physics->world.bodies, partner(body, joint));
    if (other != HAPI_NONE && physics->world.bodies.entries[other].island == HAPI_NONE &&
        !add_member(physics, other, island)) {
      return false;
    }
  }
  return true;
}

static bool has_transmission(dBodyID body)
{
  int joints = dBodyGetNumJoints(body);
  for (int i = 0; i < joints; ++i) {
    if (dJointGetType(dBodyGetJoint(body, i)) == dJointTypeTransmission) {
      return true;
    }
  }
  return false;
}

/* A transmission keeps its phase where nobody can put it back: its island is not probed. */
static bool can_be_undone(const hapi_physics *physics, uint32_t first)
{
  const hapi_test_set *test = &physics->probe.test;
  for (uint32_t i = first; test->mechanisms && i < test->member_count; ++i) {
    if (has_transmission(physics->world.bodies.handles[test->members[i]])) {
      return false;
    }
  }
  return true;
}

static void drop_island(hapi_physics *physics, uint32_t first)
{
  hapi_test_set *test = &physics->probe.test;
  for (uint32_t i = first; i < test->member_count; ++i) {
    physics->world.bodies.entries[test->members[i]].island = HAPI_NONE;
  }
  test->member_count = first;
  --test->island_count;
}

static void say_not_probed(hapi_physics *physics)
{
  const char *text =
      "bodies with a transmission joint are not probed: a pointer feels them as "
      "moved by the application";
  hapi_say_once(&physics->cycle, &physics->probe.said_not_probed, text);
}

static bool gather_island(hapi_physics *physics, uint32_t start)
{
  hapi_test_set *test = &physics->probe.test;
  uint32_t island = test->island_count++;
  uint32_t next = test->member_count;
  bool good = add_member(physics, start, island);
  for (; good && next < test->member_count; ++next) {
    dBodyID body = physics->world.bodies.entries[test->members[next]].body;
    bool passes = dynamic(body);
    test->mechanisms = test->mechanisms || !passes; /* its own joints are not walked */
    good = !passes || add_partners(physics, body, island);
  }
  return good;
}

/* More than one pointer contact acts on the body, or another body may. */
bool hapi_test_is_whole(const hapi_physics *physics, uint32_t body)
{
  uint32_t contacts = 0;
  for (uint32_t i = 0; i < physics->near.slots.contact_high && contacts < 2; ++i) {
    const hapi_contact_slot *contact = &physics->near.slots.contacts[i];
    contacts += contact->phase == HAPI_SLOT_LIVE && contact->body == body;
  }
  return physics->near.slots.bodies[body].linked || contacts > 1;
}

static bool contact_moves_a_body(const hapi_physics *physics, const hapi_contact_slot *contact)
{
  if (contact->phase != HAPI_SLOT_LIVE || contact->body == HAPI_SLOT_NONE) {
    return false;
  }
  uint32_t flags = physics->near.slots.bodies[contact->body].flags;
  bool needs = physics->cycle.model == HAP_MODEL_ACCELERANCE ||
               ((flags & HAPI_BODY_MEASURED) != 0 && !hapi_test_is_whole(physics, contact->body));
  return needs && (flags & HAPI_BODY_DRIVEN) == 0 &&
         !physics->near.slots.bodies[contact->body].known_free;
}

static void begin_gathering(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  for (uint32_t i = 0; i < test->member_count; ++i) {
    physics->world.bodies.entries[test->members[i]].island = HAPI_NONE;
  }
  test->member_count = 0;
  test->island_count = 0;
  test->contact_count = 0;
  test->body_count = 0;
  test->mechanisms = false;
}

/* The island of a body joins the test set. *testable: it can be undone; else the body is driven. */
static hap_status gather_body(hapi_physics *physics, hapi_body_slot *body, bool *testable)
{
  uint32_t first = physics->probe.test.member_count;
  *testable = true;
  if (physics->world.bodies.entries[body->known].island == HAPI_NONE &&
      !gather_island(physics, body->known)) {
    return HAP_ERROR_MEMORY;
  }
  if (!can_be_undone(physics, first)) {
    drop_island(physics, first);
    say_not_probed(physics);
    body->flags = HAPI_BODY_DRIVEN;
    *testable = false;
  }
  return HAP_OK;
}

hap_status hapi_test_gather(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  hap_status status = HAP_OK;
  begin_gathering(physics);
  for (uint32_t i = 0; i < physics->near.slots.contact_high && status >= HAP_OK; ++i) {
    if (contact_moves_a_body(physics, &physics->near.slots.contacts[i])) {
      bool testable = false;
      status = gather_body(
          physics, &physics->near.slots.bodies[physics->near.slots.contacts[i].body], &testable);
      if (status >= HAP_OK && testable) {
        test->contacts[test->contact_count++] = i;
      }
    }
  }
  return status;
}

hap_status hapi_test_gather_bodies(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  hap_status status = HAP_OK;
  begin_gathering(physics);
  for (uint32_t i = 0; i < physics->near.slots.body_high && status >= HAP_OK; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[i];
    if (slot->phase == HAPI_SLOT_LIVE && (slot->flags & HAPI_BODY_MEASURED) != 0 &&
        hapi_test_is_whole(physics, i)) {
      bool testable = false;
      uint32_t first = test->member_count;
      status = gather_body(physics, slot, &testable);
      if (status >= HAP_OK && testable && slot->edge &&
          test->member_count - first > EDGE_ISLAND_MAX) {
        drop_island(physics, first);
        slot->flags &= ~(uint32_t)HAPI_BODY_MEASURED;
        testable = false;
      }
      if (status >= HAP_OK && testable) {
        test->bodies[test->body_count++] = i;
      }
    }
  }
  return status;
}

hap_status hapi_test_gather_owned(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  begin_gathering(physics);
  for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
    const hapi_body_slot *slot = &physics->near.slots.bodies[i];
    bool owned = slot->phase == HAPI_SLOT_LIVE && (slot->flags & HAPI_BODY_OWNED) != 0;
    if (!owned || (slot->flags & HAPI_BODY_RESTING) != 0 ||
        physics->world.bodies.entries[slot->known].rest->chosen_in !=
            physics->cycle.model_number + 1) {
      continue;
    }
    uint32_t first = test->member_count;
    bool known = physics->world.bodies.entries[slot->known].island != HAPI_NONE;
    if (!known && !gather_island(physics, slot->known)) {
      return HAP_ERROR_MEMORY;
    }
    if (!known && !can_be_undone(physics, first)) {
      drop_island(physics, first);
    } else {
      test->bodies[test->body_count++] = i;
    }
  }
  return HAP_OK;
}

/* ODE's island search goes through kinematic bodies: their joints to the outside are cut. */
static hap_status cut_joints(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  test->cut_count = 0;
  for (uint32_t i = 0; i < test->member_count; ++i) {
    dBodyID body = physics->world.bodies.entries[test->members[i]].body;
    int joints = dynamic(body) ? 0 : dBodyGetNumJoints(body);
    if (!hapi_reserve((void **)&test->cut, &test->cut_capacity, test->cut_count, (uint32_t)joints,
                      sizeof(dJointID))) {
      return HAP_ERROR_MEMORY;
    }
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      uint32_t other = hapi_bodies_find(&physics->world.bodies, partner(body, joint));
      if (other != HAPI_NONE && physics->world.bodies.entries[other].island == HAPI_NONE) {
        dJointDisable(joint);
        test->cut[test->cut_count++] = joint;
      }
    }
  }
  return HAP_OK;
}

static hap_status save_members(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  uint32_t joints = 0;
  for (uint32_t i = 0; test->mechanisms && i < test->member_count; ++i) {
    joints += (uint32_t)dBodyGetNumJoints(physics->world.bodies.entries[test->members[i]].body);
  }
  hap_status status = hapi_snapshot_reserve(&physics->probe.snapshot, test->member_count, joints);
  if (status < HAP_OK) {
    return status;
  }
  hapi_snapshot_clear(&physics->probe.snapshot);
  for (uint32_t i = 0; i < test->member_count; ++i) {
    const hapi_known_body *known = &physics->world.bodies.entries[test->members[i]];
    hapi_snapshot_add_body(&physics->probe.snapshot, known->body, known->rest->moved_callback);
    int count = test->mechanisms ? dBodyGetNumJoints(known->body) : 0; /* ours have no feedback */
    for (int k = 0; k < count; ++k) {
      dJointFeedback *feedback = dJointGetFeedback(dBodyGetJoint(known->body, k));
      if (feedback != NULL) {
        hapi_snapshot_add_feedback(&physics->probe.snapshot, feedback); /* twice does no harm */
      }
    }
  }
  return HAP_OK;
}

/* All that are awake; the members are switched on again after it. */
static hap_status switch_off(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  test->disabled_count = 0;
  if (!hapi_reserve((void **)&test->disabled, &test->disabled_capacity, 0,
                    physics->world.bodies.high, sizeof(dBodyID))) {
    return HAP_ERROR_MEMORY;
  }
  for (uint32_t i = 0; i < physics->world.bodies.high; ++i) {
    dBodyID body = physics->world.bodies.handles[i];
    if (body != NULL && dBodyIsEnabled(body)) {
      dBodyDisable(body);
      test->disabled[test->disabled_count++] = body;
    }
  }
  return HAP_OK;
}

hap_status hapi_test_enter(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  if (physics->world.bodies.starved) {
    return HAP_ERROR_MEMORY; /* a body that is not known would move, and stay so */
  }
  hap_status status = save_members(physics);
  if (status >= HAP_OK) {
    status = hapi_space_order_save(physics);
  }
  if (status < HAP_OK) {
    return status;
  }
  test->islands_threads = dWorldGetStepIslandsProcessingMaxThreadCount(physics->world.ode.world);
  dWorldSetStepIslandsProcessingMaxThreadCount(physics->world.ode.world, 1);
  hapi_islands_rest(&physics->world);
  status = cut_joints(physics);
  if (status >= HAP_OK) {
    status = switch_off(physics);
  }
  for (uint32_t i = 0; i < test->member_count; ++i) {
    const hapi_known_body *known = &physics->world.bodies.entries[test->members[i]];
    dBodyEnable(known->body); /* a sleeping body would answer A = 0 */
    if (known->rest->moved_callback != NULL) {
      dBodySetMovedCallback(known->body, NULL);
    }
  }
  if (status < HAP_OK) {
    hapi_test_leave(physics);
  }
  return status;
}

static hap_status cut_others(hapi_physics *physics, dJointID kept)
{
  hapi_test_set *test = &physics->probe.test;
  for (uint32_t i = 0; i < test->member_count; ++i) {
    dBodyID body = physics->world.bodies.entries[test->members[i]].body;
    int joints = dBodyGetNumJoints(body);
    if (!hapi_reserve((void **)&test->cut, &test->cut_capacity, test->cut_count, (uint32_t)joints,
                      sizeof(dJointID))) {
      return HAP_ERROR_MEMORY;
    }
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      if (joint != kept && dJointIsEnabled(joint)) {
        dJointDisable(joint);
        test->cut[test->cut_count++] = joint;
      }
    }
  }
  return HAP_OK;
}

hap_status hapi_test_enter_bodies(hapi_physics *physics, const hapi_lookback_body *bodies,
                                  uint32_t count)
{
  begin_gathering(physics);
  physics->probe.test.mechanisms = true;
  physics->probe.test.island_count = 1;
  for (uint32_t i = 0; i < count; ++i) {
    if (!add_member(physics, bodies[i].known, 0)) {
      return HAP_ERROR_MEMORY;
    }
  }
  return hapi_test_enter(physics);
}

hap_status hapi_test_enter_pair(hapi_physics *physics, dJointID joint, const uint32_t index[2])
{
  begin_gathering(physics);
  physics->probe.test.mechanisms = true;
  physics->probe.test.island_count = 1;
  for (int i = 0; i < 2; ++i) {
    if (index[i] != HAPI_NONE && !add_member(physics, index[i], 0)) {
      return HAP_ERROR_MEMORY;
    }
  }
  hap_status status = hapi_test_enter(physics);
  if (status >= HAP_OK) {
    status = cut_others(physics, joint);
    if (status < HAP_OK) {
      hapi_test_leave(physics);
    }
  }
  return status;
}

void hapi_test_leave(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  for (uint32_t i = 0; i < test->cut_count; ++i) {
    dJointEnable(test->cut[i]);
  }
  for (uint32_t i = 0; i < test->disabled_count; ++i) {
    dBodyEnable(test->disabled[i]);
  }
  hapi_snapshot_restore(&physics->probe.snapshot); /* also switches sleeping members off again */
  hapi_space_order_restore(physics); /* it asks where the geoms are: after the poses */
  test->cut_count = 0;
  test->disabled_count = 0;
  dWorldSetStepIslandsProcessingMaxThreadCount(physics->world.ode.world, test->islands_threads);
  hapi_islands_go_on(&physics->world);
}

/* The application's forces of the last step act in a probe as well: it may add them at each step,
 * in a callback that probes must not call. What waits in the accumulators already goes first. */
static void add_user_wrench(const hapi_known_body *known)
{
  const dReal *f = dBodyGetForce(known->body);
  const dReal *t = dBodyGetTorque(known->body);
  if (f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0 || t[0] != 0.0 || t[1] != 0.0 || t[2] != 0.0) {
    return;
  }
  dBodySetForce(known->body, known->rest->user_force[0], known->rest->user_force[1],
                known->rest->user_force[2]);
  dBodySetTorque(known->body, known->rest->user_torque[0], known->rest->user_torque[1],
                 known->rest->user_torque[2]);
}

void hapi_test_rewind(hapi_physics *physics)
{
  hapi_snapshot_rewind(&physics->probe.snapshot);
  for (uint32_t i = 0; i < physics->probe.test.member_count; ++i) {
    add_user_wrench(&physics->world.bodies.entries[physics->probe.test.members[i]]);
  }
}

void hapi_test_step(hapi_physics *physics)
{
  ++physics->counts.own.stats.probes.steps;
  ++physics->counts.own.stats.physics.quickstep_calls;
  dWorldQuickStep(physics->world.ode.world, physics->cycle.probe_step_s);
}

const hapi_body_state *hapi_test_state(const hapi_physics *physics, uint32_t known)
{
  return &physics->probe.snapshot.bodies[physics->world.bodies.entries[known].rest->member];
}

void hapi_test_acceleration(const hapi_physics *physics, uint32_t known, double out[6])
{
  const hapi_body_state *before = hapi_test_state(physics, known);
  const dReal *linear = dBodyGetLinearVel(before->body);
  const dReal *angular = dBodyGetAngularVel(before->body);
  for (int i = 0; i < 3; ++i) {
    out[i] = (linear[i] - before->linear[i]) / physics->cycle.probe_step_s;
    out[3 + i] = (angular[i] - before->angular[i]) / physics->cycle.probe_step_s;
  }
}

void hapi_test_finish(hapi_test_set *test)
{
  hapi_free(test->contacts);
  hapi_free(test->bodies);
  hapi_free(test->base);
  hapi_free(test->rounds);
  hapi_free(test->members);
  hapi_free(test->order);
  hapi_free(test->cut);
  hapi_free(test->disabled);
  memset(test, 0, sizeof *test);
}
