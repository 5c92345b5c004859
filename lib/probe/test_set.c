/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/test_set.h"

#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"

/* The testing simulation: a step of the global world that is undone afterwards. Only the islands
 * under test are stepped. All probes whose difference is taken step the same islands from the same
 * seed: QuickStep shuffles its rows, and another order gives another error. */

static bool body_is_dynamic(dBodyID body)
{
  return body != NULL && !dBodyIsKinematic(body);
}

static dBodyID member_body(const hapi_test_set *test, uint32_t member)
{
  HAPI_ASSERT_INDEX(member, test->member_count);
  return test->world->bodies.handles[test->members[member]];
}

/* ---- who is under test ---- */

static hap_status places_reserve(hapi_test_set *test, uint32_t count)
{
  if (count <= test->place_count) {
    return HAP_OK;
  }
  hapi_test_place *places = hapi_alloc_array(count, sizeof *places);
  if (places == NULL) {
    return HAP_ERROR_MEMORY;
  }
  for (uint32_t i = 0; i < count; ++i) {
    places[i].island = HAPI_NONE;
  }
  hapi_free(test->places);
  test->places = places;
  test->place_count = count;
  return HAP_OK;
}

hap_status hapi_test_begin(hapi_test_set *test, const hapi_world *world, double step_s)
{
  HAPI_ASSERT(!test->entered);
  for (uint32_t i = 0; i < test->member_count; ++i) {
    test->places[test->members[i]].island = HAPI_NONE;
  }
  test->world = world;
  test->step_s = step_s;
  test->member_count = 0;
  test->island_count = 0;
  test->mechanisms = false;
  return places_reserve(test, world->bodies.capacity);
}

static bool member_add(hapi_test_set *test, uint32_t known, uint32_t island)
{
  HAPI_ASSERT_INDEX(known, test->place_count);
  if (!hapi_reserve((void **)&test->members, &test->member_capacity, test->member_count, 1,
                    sizeof *test->members)) {
    return false;
  }
  test->places[known] = (hapi_test_place){island, test->member_count};
  test->members[test->member_count++] = known;
  return true;
}

/* Partner of a body in a joint that is switched on; NULL: the static world. */
static dBodyID joint_partner(dBodyID body, dJointID joint)
{
  if (!dJointIsEnabled(joint)) {
    return NULL;
  }
  dBodyID first = dJointGetBody(joint, 0);
  return first == body ? dJointGetBody(joint, 1) : first;
}

/* A kinematic body moves with the island, but nothing passes through it. */
static bool island_add_partners(hapi_test_set *test, dBodyID body, uint32_t island)
{
  int joints = dBodyGetNumJoints(body);
  for (int i = 0; i < joints; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    if (dJointGetType(joint) != dJointTypeContact) {
      test->mechanisms = true;
    }
    uint32_t other = hapi_bodies_find(&test->world->bodies, joint_partner(body, joint));
    if (other != HAPI_NONE && !hapi_test_has(test, other) && !member_add(test, other, island)) {
      return false;
    }
  }
  return true;
}

static bool body_has_transmission(dBodyID body)
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
static bool island_can_be_undone(const hapi_test_set *test, uint32_t first)
{
  for (uint32_t i = first; test->mechanisms && i < test->member_count; ++i) {
    if (body_has_transmission(member_body(test, i))) {
      return false;
    }
  }
  return true;
}

/* The newest island, whose members begin at first, is under test no more. */
static void island_drop(hapi_test_set *test, uint32_t first)
{
  HAPI_ASSERT(test->island_count > 0 && first <= test->member_count);
  for (uint32_t i = first; i < test->member_count; ++i) {
    test->places[test->members[i]].island = HAPI_NONE;
  }
  test->member_count = first;
  --test->island_count;
}

static bool island_gather(hapi_test_set *test, uint32_t start)
{
  uint32_t island = test->island_count++;
  uint32_t next = test->member_count;
  bool good = member_add(test, start, island);
  for (; good && next < test->member_count; ++next) {
    dBodyID body = member_body(test, next);
    bool passes = body_is_dynamic(body);
    test->mechanisms = test->mechanisms || !passes; /* its own joints are not walked */
    good = !passes || island_add_partners(test, body, island);
  }
  return good;
}

hap_status hapi_test_add_island(hapi_test_set *test, uint32_t known, bool *out_testable)
{
  uint32_t first = test->member_count;
  *out_testable = true;
  if (hapi_test_has(test, known)) {
    return HAP_OK;
  }
  if (!island_gather(test, known)) {
    return HAP_ERROR_MEMORY;
  }
  if (!island_can_be_undone(test, first)) {
    island_drop(test, first);
    *out_testable = false;
  }
  return HAP_OK;
}

hap_status hapi_test_add_body(hapi_test_set *test, uint32_t known)
{
  test->mechanisms = true;
  test->island_count = 1;
  return member_add(test, known, 0) ? HAP_OK : HAP_ERROR_MEMORY;
}

/* ---- enter and leave ---- */

static bool joint_list_reserve(hapi_test_off *off, int more)
{
  return hapi_reserve((void **)&off->joints, &off->joint_capacity, off->joint_count, (uint32_t)more,
                      sizeof(dJointID));
}

/* ODE's island search goes through kinematic bodies: their joints to the outside are cut. */
static hap_status joints_cut_outside(hapi_test_set *test)
{
  hapi_test_off *off = &test->off;
  off->joint_count = 0;
  for (uint32_t i = 0; i < test->member_count; ++i) {
    dBodyID body = member_body(test, i);
    int joints = body_is_dynamic(body) ? 0 : dBodyGetNumJoints(body);
    if (!joint_list_reserve(off, joints)) {
      return HAP_ERROR_MEMORY;
    }
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      uint32_t other = hapi_bodies_find(&test->world->bodies, joint_partner(body, joint));
      if (other != HAPI_NONE && !hapi_test_has(test, other)) {
        dJointDisable(joint);
        off->joints[off->joint_count++] = joint;
      }
    }
  }
  return HAP_OK;
}

static hap_status joints_cut_others(hapi_test_set *test, dJointID kept)
{
  hapi_test_off *off = &test->off;
  for (uint32_t i = 0; i < test->member_count; ++i) {
    dBodyID body = member_body(test, i);
    int joints = dBodyGetNumJoints(body);
    if (!joint_list_reserve(off, joints)) {
      return HAP_ERROR_MEMORY;
    }
    for (int k = 0; k < joints; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      if (joint != kept && dJointIsEnabled(joint)) {
        dJointDisable(joint);
        off->joints[off->joint_count++] = joint;
      }
    }
  }
  return HAP_OK;
}

static hap_status members_save(hapi_test_set *test)
{
  uint32_t joints = 0;
  for (uint32_t i = 0; test->mechanisms && i < test->member_count; ++i) {
    joints += (uint32_t)dBodyGetNumJoints(member_body(test, i));
  }
  hap_status status = hapi_snapshot_reserve(&test->snapshot, test->member_count, joints);
  if (status < HAP_OK) {
    return status;
  }
  hapi_snapshot_clear(&test->snapshot);
  for (uint32_t i = 0; i < test->member_count; ++i) {
    const hapi_known_body *known = &test->world->bodies.entries[test->members[i]];
    hapi_snapshot_add_body(&test->snapshot, known->body, known->rest->moved_callback);
    int count = test->mechanisms ? dBodyGetNumJoints(known->body) : 0; /* ours have no feedback */
    for (int k = 0; k < count; ++k) {
      dJointFeedback *feedback = dJointGetFeedback(dBodyGetJoint(known->body, k));
      if (feedback != NULL) {
        hapi_snapshot_add_feedback(&test->snapshot, feedback); /* twice does no harm */
      }
    }
  }
  HAPI_ASSERT(test->snapshot.body_count == test->member_count);
  return HAP_OK;
}

static hap_status members_save_order(hapi_test_set *test)
{
  hap_status status = HAP_OK;
  hapi_space_order_begin(&test->order);
  for (uint32_t i = 0; i < test->member_count && status >= HAP_OK; ++i) {
    dBodyID body = member_body(test, i);
    if (!dBodyIsEnabled(body)) {
      status = hapi_space_order_add(&test->order, body);
    }
  }
  return status;
}

/* All that are awake; the members are switched on again after it. */
static hap_status bodies_switch_off(hapi_test_set *test)
{
  const hapi_body_table *table = &test->world->bodies;
  hapi_test_off *off = &test->off;
  off->body_count = 0;
  if (!hapi_reserve((void **)&off->bodies, &off->body_capacity, 0, table->high, sizeof(dBodyID))) {
    return HAP_ERROR_MEMORY;
  }
  for (uint32_t i = 0; i < table->high; ++i) {
    dBodyID body = table->handles[i];
    if (body != NULL && dBodyIsEnabled(body)) {
      dBodyDisable(body);
      off->bodies[off->body_count++] = body;
    }
  }
  return HAP_OK;
}

hap_status hapi_test_enter(hapi_test_set *test)
{
  HAPI_ASSERT(!test->entered);
  if (test->world->bodies.starved) {
    return HAP_ERROR_MEMORY; /* a body that is not known would move, and stay so */
  }
  hap_status status = members_save(test);
  if (status >= HAP_OK) {
    status = members_save_order(test);
  }
  if (status < HAP_OK) {
    return status;
  }
  dWorldID world = test->world->ode.world;
  test->entered = true;
  test->off.islands_threads = dWorldGetStepIslandsProcessingMaxThreadCount(world);
  dWorldSetStepIslandsProcessingMaxThreadCount(world, 1);
  hapi_islands_rest(test->world);
  status = joints_cut_outside(test);
  if (status >= HAP_OK) {
    status = bodies_switch_off(test);
  }
  for (uint32_t i = 0; i < test->member_count; ++i) {
    const hapi_known_body *known = &test->world->bodies.entries[test->members[i]];
    dBodyEnable(known->body); /* a sleeping body would answer A = 0 */
    if (known->rest->moved_callback != NULL) {
      dBodySetMovedCallback(known->body, NULL);
    }
  }
  if (status < HAP_OK) {
    hapi_test_leave(test);
  }
  return status;
}

hap_status hapi_test_enter_pair(hapi_test_set *test, dJointID joint, const uint32_t index[2])
{
  hap_status status = HAP_OK;
  for (int i = 0; i < 2 && status >= HAP_OK; ++i) {
    if (index[i] != HAPI_NONE) {
      status = hapi_test_add_body(test, index[i]);
    }
  }
  if (status >= HAP_OK) {
    status = hapi_test_enter(test);
  }
  if (status < HAP_OK) {
    return status;
  }
  status = joints_cut_others(test, joint);
  if (status < HAP_OK) {
    hapi_test_leave(test);
  }
  return status;
}

void hapi_test_leave(hapi_test_set *test)
{
  hapi_test_off *off = &test->off;
  HAPI_ASSERT(test->entered && test->snapshot.body_count == test->member_count);
  for (uint32_t i = 0; i < off->joint_count; ++i) {
    dJointEnable(off->joints[i]);
  }
  for (uint32_t i = 0; i < off->body_count; ++i) {
    dBodyEnable(off->bodies[i]);
  }
  hapi_snapshot_restore(&test->snapshot); /* also switches sleeping members off again */
  hapi_space_order_restore(&test->order);
  off->joint_count = 0;
  off->body_count = 0;
  dWorldSetStepIslandsProcessingMaxThreadCount(test->world->ode.world, off->islands_threads);
  hapi_islands_go_on(test->world);
  test->entered = false;
}

/* ---- a testing simulation ---- */

void hapi_test_rewind(hapi_test_set *test)
{
  HAPI_ASSERT(test->entered);
  hapi_snapshot_rewind(&test->snapshot);
  for (uint32_t i = 0; i < test->member_count; ++i) {
    /* The application's forces of the last step act in a probe as well: it may add them at each
     * step, in a callback that probes must not call. What waits in the accumulators already goes
     * first. */
    const hapi_known_body *known = &test->world->bodies.entries[test->members[i]];
    const dReal *f = dBodyGetForce(known->body);
    const dReal *t = dBodyGetTorque(known->body);
    if (f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0 || t[0] != 0.0 || t[1] != 0.0 || t[2] != 0.0) {
      continue;
    }
    dBodySetForce(known->body, known->rest->user_force[0], known->rest->user_force[1],
                  known->rest->user_force[2]);
    dBodySetTorque(known->body, known->rest->user_torque[0], known->rest->user_torque[1],
                   known->rest->user_torque[2]);
  }
}

void hapi_test_step(hapi_test_set *test)
{
  HAPI_ASSERT(test->entered && test->step_s > 0.0);
  ++test->steps;
  hapi_springs_set(test->world->springs, test->step_s);
  dWorldQuickStep(test->world->ode.world, test->step_s);
}

const hapi_body_state *hapi_test_state(const hapi_test_set *test, uint32_t known)
{
  HAPI_ASSERT(hapi_test_has(test, known));
  HAPI_ASSERT_INDEX(test->places[known].member, test->snapshot.body_count);
  return &test->snapshot.bodies[test->places[known].member];
}

void hapi_test_acceleration(const hapi_test_set *test, uint32_t known, double out[6])
{
  const hapi_body_state *before = hapi_test_state(test, known);
  const dReal *linear = dBodyGetLinearVel(before->body);
  const dReal *angular = dBodyGetAngularVel(before->body);
  for (int i = 0; i < 3; ++i) {
    out[i] = (linear[i] - before->linear[i]) / test->step_s;
    out[3 + i] = (angular[i] - before->angular[i]) / test->step_s;
  }
}

void hapi_test_finish(hapi_test_set *test)
{
  hapi_free(test->members);
  hapi_free(test->places);
  hapi_free(test->off.joints);
  hapi_free(test->off.bodies);
  hapi_snapshot_finish(&test->snapshot);
  hapi_space_order_finish(&test->order);
  memset(test, 0, sizeof *test);
}
