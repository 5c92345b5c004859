/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "base/assert.h"
#include "near/near.h"

/* Bodies that joints tie together, without what is tied to them through the static world or a
 * kinematic body. */

static const hapi_known_body *known_body(const hapi_nearby *nearby, uint32_t known)
{
  return &nearby->world->bodies.entries[known];
}

/* Those that can move stand before the kinematic ones. */
static bool add_member(hapi_nearby *nearby, uint32_t known)
{
  hapi_range *range = &nearby->range;
  bool moves = !dBodyIsKinematic(known_body(nearby, known)->body);
  nearby->visits[known].gathered_in = range->number;
  if (range->mechanism.count == nearby->cycle->config->capacity.bodies ||
      !hapi_range_has_room(nearby, range->mechanism.moving + moves)) {
    ++nearby->counts.dropped;
    return false;
  }
  hapi_mechanism *m = &range->mechanism;
  HAPI_ASSERT(m->moving <= m->count);
  m->members[m->count] = known;
  if (moves) {
    m->members[m->count] = m->members[m->moving];
    m->members[m->moving++] = known;
  }
  ++m->count;
  return true;
}

static bool is_member(const hapi_range *range, uint32_t known)
{
  for (uint32_t i = 0; i < range->mechanism.count; ++i) {
    if (range->mechanism.members[i] == known) {
      return true;
    }
  }
  return false;
}

/* A kinematic body may stand at the end of more than one mechanism, in a walk and in one of it. */
static bool add_partner(hapi_nearby *nearby, uint32_t known)
{
  const hapi_range *range = &nearby->range;
  if (is_member(range, known)) {
    return true;
  }
  bool fixed = dBodyIsKinematic(known_body(nearby, known)->body);
  bool refused = nearby->visits[known].gathered_in == range->number;
  return (fixed || !refused) && add_member(nearby, known);
}

/* Whether the loop has rows for it: of its kind, or those that testing simulations found. */
static bool has_rows(const hapi_nearby *nearby, hapi_known_joint *known)
{
  const hapi_range *range = &nearby->range;
  if (hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_JOINTS)) {
    return false;
  }
  if (known->carried) {
    return known->usable;
  }
  if (hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_TESTING)) {
    return false;
  }
  known->wanted_in = range->number;
  return known->measurement != NULL && known->measurement->good;
}

static bool add_joint(hapi_nearby *nearby, dJointID joint)
{
  hapi_range *range = &nearby->range;
  uint32_t index = hapi_joints_find(&nearby->world->joints, joint);
  if (index == HAPI_NONE) {
    return false; /* there was no memory for it */
  }
  hapi_known_joint *known = &nearby->world->joints.entries[index];
  bool others = known->bodies[1] != NULL;
  if (known->helps) {
    return true;
  }
  if (!has_rows(nearby, known) || known->index[0] == HAPI_NONE ||
      (others && known->index[1] == HAPI_NONE)) {
    return false;
  }
  if (known->gathered_in == range->number) {
    return true;
  }
  if (range->mechanism.joint_count == nearby->cycle->config->capacity.joints) {
    ++nearby->counts.dropped;
    return false;
  }
  known->gathered_in = range->number;
  range->mechanism.joints[range->mechanism.joint_count++] = index;
  return add_partner(nearby, known->index[0]) && (!others || add_partner(nearby, known->index[1]));
}

/* What a contact joint of the application holds cannot be read: such a body stays with ODE, and is
 * measured. */
static bool contacts_are_known(hapi_nearby *nearby, const hapi_known_body *known)
{
  if (known->contacted) {
    hapi_say_once(nearby->cycle, &nearby->range.said_contacted,
                  "the application makes contact joints of its own for a body near a pointer: the "
                  "loop cannot carry them, and goes by testing simulations of the body; a surface "
                  "callback that returns true leaves the contacts to the library");
  }
  return !known->contacted;
}

static bool add_joints(hapi_nearby *nearby, dBodyID body)
{
  int count = dBodyGetNumJoints(body);
  for (int i = 0; i < count; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    if (dJointGetType(joint) != dJointTypeContact && dJointIsEnabled(joint) &&
        !add_joint(nearby, joint)) {
      return false;
    }
  }
  return true;
}

bool hapi_mechanism_gather(hapi_nearby *nearby, uint32_t known)
{
  hapi_range *range = &nearby->range;
  range->mechanism.count = range->mechanism.moving = 0;
  bool good = add_member(nearby, known);
  for (uint32_t i = 0; good && i < range->mechanism.moving; ++i) {
    const hapi_known_body *member = known_body(nearby, range->mechanism.members[i]);
    good = contacts_are_known(nearby, member) && add_joints(nearby, member->body);
  }
  return good;
}

void hapi_mechanism_take(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  for (uint32_t i = 0; i < range->mechanism.joint_count; ++i) {
    nearby->world->joints.entries[range->mechanism.joints[i]].ranged_in = range->number;
  }
}

void hapi_mechanism_drop(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  while (range->mechanism.joint_count > 0 &&
         nearby->world->joints.entries[range->mechanism.joints[range->mechanism.joint_count - 1]]
                 .ranged_in != range->number) {
    --range->mechanism.joint_count;
  }
}
