/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/physics_internal.h"

/* Bodies that joints tie together, without what is tied to them through the static world or a kinematic
 * body. */

static hapi_known_body *entry(hapi_physics *physics, uint32_t known)
{
  return &physics->world.bodies.entries[known];
}

static void swap(uint32_t *a, uint32_t *b)
{
  uint32_t c = *a;
  *a = *b;
  *b = c;
}

/* Those that can move stand before the kinematic ones. */
static bool add_member(hapi_physics *physics, uint32_t known)
{
  hapi_range *range = &physics->near.range;
  bool moves = !dBodyIsKinematic(entry(physics, known)->body);
  entry(physics, known)->rest->gathered_in = range->number;
  if (range->member_count == physics->config.capacity.bodies ||
      range->owned + range->moving + moves > physics->config.max_bodies) {
    ++physics->counts.own.stats.model.capacity_dropped;
    return false;
  }
  uint32_t at = range->member_count++;
  range->members[at] = known;
  if (moves) {
    swap(&range->members[at], &range->members[range->moving++]);
  }
  return true;
}

static bool is_member(const hapi_range *range, uint32_t known)
{
  for (uint32_t i = 0; i < range->member_count; ++i) {
    if (range->members[i] == known) {
      return true;
    }
  }
  return false;
}

/* A kinematic body may stand at the end of more than one mechanism, in a walk and in one of it. */
static bool add_partner(hapi_physics *physics, uint32_t known)
{
  const hapi_range *range = &physics->near.range;
  if (is_member(range, known)) {
    return true;
  }
  bool fixed = dBodyIsKinematic(entry(physics, known)->body);
  bool refused = entry(physics, known)->rest->gathered_in == range->number;
  return (fixed || !refused) && add_member(physics, known);
}

/* Whether the loop has rows for it: of its kind, or those that testing simulations found. */
static bool has_rows(const hapi_physics *physics, hapi_known_joint *known)
{
  const hapi_range *range = &physics->near.range;
  if (hapi_wish_is_off(physics->cycle.wishes, HAP_EFFECT_JOINTS)) {
    return false;
  }
  if (known->carried) {
    return known->usable;
  }
  if (hapi_wish_is_off(physics->cycle.wishes, HAP_EFFECT_TESTING)) {
    return false;
  }
  known->wanted_in = range->number;
  return known->measurement != NULL && known->measurement->good;
}

static bool add_joint(hapi_physics *physics, dJointID joint)
{
  hapi_range *range = &physics->near.range;
  uint32_t index = hapi_joints_find(&physics->world.joints, joint);
  if (index == HAPI_NONE) {
    return false; /* there was no memory for it */
  }
  hapi_known_joint *known = &physics->world.joints.entries[index];
  bool others = known->bodies[1] != NULL;
  if (!has_rows(physics, known) || known->index[0] == HAPI_NONE ||
      (others && known->index[1] == HAPI_NONE)) {
    return false;
  }
  if (known->gathered_in == range->number) {
    return true;
  }
  if (range->joint_count == physics->config.capacity.joints) {
    ++physics->counts.own.stats.model.capacity_dropped;
    return false;
  }
  known->gathered_in = range->number;
  range->joints[range->joint_count++] = index;
  return add_partner(physics, known->index[0]) &&
         (!others || add_partner(physics, known->index[1]));
}

static bool add_joints(hapi_physics *physics, dBodyID body)
{
  int count = dBodyGetNumJoints(body);
  for (int i = 0; i < count; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    if (dJointGetType(joint) != dJointTypeContact && dJointIsEnabled(joint) &&
        !add_joint(physics, joint)) {
      return false;
    }
  }
  return true;
}

bool hapi_mechanism_gather(hapi_physics *physics, uint32_t known)
{
  hapi_range *range = &physics->near.range;
  range->member_count = range->moving = 0;
  bool good = add_member(physics, known);
  for (uint32_t i = 0; good && i < range->moving; ++i) {
    good = add_joints(physics, entry(physics, range->members[i])->body);
  }
  return good;
}

void hapi_mechanism_take(hapi_physics *physics)
{
  hapi_range *range = &physics->near.range;
  for (uint32_t i = 0; i < range->joint_count; ++i) {
    physics->world.joints.entries[range->joints[i]].ranged_in = range->number;
  }
}

void hapi_mechanism_drop(hapi_physics *physics)
{
  hapi_range *range = &physics->near.range;
  while (range->joint_count > 0 &&
         physics->world.joints.entries[range->joints[range->joint_count - 1]].ranged_in !=
             range->number) {
    --range->joint_count;
  }
}
