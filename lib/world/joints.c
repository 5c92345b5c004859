/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* The world's joints, and those of the range as the loop has them. All joints are known from the first
 * cycle on in which they are there: some of what they hold can be read at that time only. */

#define FIRST_CAPACITY 16u
#define UNKNOWN_BIRTH UINT64_MAX /* of a body that there was no memory for */

/* A softness from which on a constraint is a spring, not a rigid one with rounding; as of contacts. */
#define SOFT_CFM 1e-6

/* ODE: a stop at pi and beyond is never met, as the angle goes on at -pi. */
#define WHOLE_TURN (M_PI - 1e-9)

/* ---- the table ---- */

uint32_t hapi_joints_find(const hapi_joint_table *table, dJointID joint)
{
  return hapi_index_get(&table->by_address, hapi_index_address(joint));
}

static uint64_t key_of(const hapi_joint_name *name)
{
  uint64_t bodies = hapi_index_mix(hapi_index_mix(name->births[0]) + name->births[1]);
  return bodies + ((uint64_t)name->type << 32) + name->rank;
}

static bool same_kin(const hapi_joint_name *a, const hapi_joint_name *b)
{
  return a->births[0] == b->births[0] && a->births[1] == b->births[1] && a->type == b->type;
}

static uint32_t find_named(const hapi_joint_table *table, const hapi_joint_name *name)
{
  uint32_t index = hapi_index_get(&table->by_name, key_of(name));
  bool same = index != HAPI_NONE && same_kin(&table->entries[index].name, name) &&
              table->entries[index].name.rank == name->rank;
  return same ? index : HAPI_NONE;
}

static void index_all(hapi_joint_table *table)
{
  hapi_index_clear(&table->by_address);
  hapi_index_clear(&table->by_name);
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_index_put(&table->by_address, hapi_index_address(table->entries[i].joint), i);
    hapi_index_put(&table->by_name, key_of(&table->entries[i].name), i);
  }
}

static bool grow(hapi_joint_table *table)
{
  uint32_t capacity = table->capacity > 0 ? 2 * table->capacity : FIRST_CAPACITY;
  if (!hapi_index_reserve(&table->by_address, capacity) ||
      !hapi_index_reserve(&table->by_name, capacity)) {
    return false;
  }
  hapi_known_joint *entries = hapi_alloc_array(capacity, sizeof *entries);
  if (entries == NULL) {
    return false;
  }
  if (table->count > 0) {
    memcpy(entries, table->entries, table->count * sizeof *entries);
  }
  hapi_free(table->entries);
  table->entries = entries;
  table->capacity = capacity;
  return true;
}

/* HAPI_NONE: no memory. */
static uint32_t add(hapi_joint_table *table, const hapi_joint_name *name)
{
  if (table->starved || (table->count == table->capacity && !grow(table))) {
    table->starved = true;
    return HAPI_NONE;
  }
  hapi_known_joint *known = &table->entries[table->count];
  memset(known, 0, sizeof *known);
  known->name = *name;
  known->slot = HAPI_NONE;
  hapi_index_put(&table->by_name, key_of(name), table->count);
  return table->count++;
}

/* Of an address one entry at most. */
static void set_address(hapi_joint_table *table, uint32_t index, dJointID joint)
{
  hapi_known_joint *known = &table->entries[index];
  if (known->joint == joint) {
    return;
  }
  uint32_t other = hapi_joints_find(table, joint);
  if (other != HAPI_NONE) {
    table->entries[other].joint = NULL; /* it has gone, or its turn is still to come */
  }
  if (known->joint != NULL) {
    hapi_index_remove(&table->by_address, hapi_index_address(known->joint));
  }
  known->joint = joint;
  hapi_index_put(&table->by_address, hapi_index_address(joint), index);
}

/* In their order: the order of a walk over them does not depend on what was destroyed when. */
static void drop_unseen(hapi_joint_table *table)
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < table->count; ++i) {
    const hapi_known_joint *known = &table->entries[i];
    bool seen = known->seen == table->scan;
    if (known->slot != HAPI_NONE) {
      table->slots[known->slot].taken = seen ? kept + 1 : 0;
    }
    if (seen) {
      table->entries[kept++] = *known;
    } else {
      hapi_free(known->measurement);
    }
  }
  if (kept < table->count) {
    table->count = kept;
    index_all(table);
  }
}

static void forget_measurements(hapi_joint_table *table)
{
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_free(table->entries[i].measurement);
    table->entries[i].measurement = NULL;
  }
}

void hapi_joints_finish(hapi_joint_table *table)
{
  forget_measurements(table);
  hapi_free(table->entries);
  hapi_free(table->slots);
  hapi_index_finish(&table->by_address);
  hapi_index_finish(&table->by_name);
  memset(table, 0, sizeof *table);
}

bool hapi_joints_create(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->world.joints;
  table->slots = hapi_alloc_array(physics->config.capacity.joints, sizeof *table->slots);
  return table->slots != NULL;
}

/* ---- which there are ---- */

static bool is_local(const hapi_physics *physics, uint32_t body)
{
  return body != HAPI_NONE && physics->world.bodies.entries[body].slot != HAPI_NONE;
}

/* One that is far from the pointers is read when it is new, and again when it comes near. */
static void look_at(hapi_physics *physics, hapi_known_joint *known, bool is_new)
{
  bool near = is_local(physics, known->index[0]) || is_local(physics, known->index[1]);
  known->seen = physics->world.joints.scan;
  known->carried = hapi_joint_kind_of(known->joint, &known->kind);
  if (known->carried && (is_new || near || known->left_is_known)) {
    hapi_joint_read(known, is_new);
  }
}

/* ODE's own order: the world comes second. */
static void read_bodies(const hapi_physics *physics, dJointID joint, hapi_known_joint *out)
{
  dBodyID a = dJointGetBody(joint, 0);
  dBodyID b = dJointGetBody(joint, 1);
  out->bodies[0] = a != NULL ? a : b;
  out->bodies[1] = a != NULL ? b : NULL;
  for (int i = 0; i < 2; ++i) {
    uint32_t index = hapi_bodies_find(&physics->world.bodies, out->bodies[i]);
    out->index[i] = index;
    out->name.births[i] = out->bodies[i] == NULL ? 0
                          : index == HAPI_NONE   ? UNKNOWN_BIRTH
                                                 : physics->world.bodies.entries[index].rest->birth;
  }
}

/* The entry of a joint that this scan meets for the first time, after all older ones of its bodies. */
static uint32_t find_entry(const hapi_joint_table *table, uint32_t at_address,
                           hapi_joint_name *io_name)
{
  uint32_t index = at_address;
  if (index != HAPI_NONE && table->entries[index].name.rank == 0 &&
      same_kin(&table->entries[index].name, io_name)) {
    return index;
  }
  for (io_name->rank = 0;; ++io_name->rank) {
    index = find_named(table, io_name);
    if (index == HAPI_NONE || table->entries[index].seen != table->scan) {
      return index;
    }
  }
}

static void see(hapi_physics *physics, dJointID joint)
{
  hapi_joint_table *table = &physics->world.joints;
  hapi_known_joint found = {0};
  uint32_t index = hapi_joints_find(table, joint);
  if (index != HAPI_NONE && table->entries[index].seen == table->scan) {
    return; /* by its other body */
  }
  read_bodies(physics, joint, &found);
  found.name.type = dJointGetType(joint);
  index = find_entry(table, index, &found.name);
  bool is_new = index == HAPI_NONE;
  index = is_new ? add(table, &found.name) : index;
  if (index != HAPI_NONE) {
    hapi_known_joint *known = &table->entries[index];
    set_address(table, index, joint);
    memcpy(known->bodies, found.bodies, sizeof known->bodies);
    memcpy(known->index, found.index, sizeof known->index);
    look_at(physics, known, is_new);
  }
}

/* A body has its newest joint first. */
void hapi_joints_scan(hapi_physics *physics)
{
  ++physics->world.joints.scan;
  physics->world.joints.starved = false;
  uint32_t end = physics->world.bodies.jointed_count > 0 ? physics->world.bodies.high : 0;
  for (uint32_t i = 0; i < end; ++i) {
    dBodyID body = physics->world.bodies.handles[i];
    bool jointed = body != NULL && physics->world.bodies.entries[i].jointed;
    for (int k = jointed ? dBodyGetNumJoints(body) : 0; k > 0; --k) {
      dJointID joint = dBodyGetJoint(body, k - 1);
      if (dJointGetType(joint) != dJointTypeContact) {
        see(physics, joint);
      }
    }
  }
  drop_unseen(&physics->world.joints);
}

void hapi_joints_leave(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->world.joints.count; ++i) {
    hapi_joint_leave(&physics->world.joints.entries[i]);
  }
}

void hapi_joints_reset(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->world.joints;
  forget_measurements(table);
  table->count = 0;
  index_all(table);
  for (uint32_t i = 0; i < physics->config.capacity.joints; ++i) {
    table->slots[i].taken = 0;
  }
}

/* ---- joints of bodies that the loop owns are not ODE's ---- */

static bool is_owned(const hapi_physics *physics, uint32_t body)
{
  return body != HAPI_NONE && physics->world.bodies.entries[body].loop_owned;
}

static hapi_body_slot *slot_of(hapi_physics *physics, uint32_t body)
{
  return is_local(physics, body)
             ? &physics->near.slots.bodies[physics->world.bodies.entries[body].slot]
             : NULL;
}

/* A body that the application has just moved is no more the loop's, but what hangs on it is still: it
 * waits for the next model where it was put, or its joints would open. */
static bool hold_partner(hapi_physics *physics, const hapi_known_joint *known, int which)
{
  hapi_body_slot *slot = slot_of(physics, known->index[which]);
  const hapi_body_slot *other = slot_of(physics, known->index[1 - which]);
  dBodyID body = known->bodies[which];
  if (slot == NULL || other == NULL || slot->held || !other->held || dBodyIsKinematic(body) ||
      !dBodyIsEnabled(body)) {
    return false;
  }
  slot->held = true;
  dBodyDisable(body);
  return true;
}

/* ODE's search for islands goes through joints and wakes what it finds. */
void hapi_joints_hold(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->world.joints;
  bool again = true;
  for (uint32_t i = 0; i < table->count; ++i) {
    hapi_known_joint *known = &table->entries[i];
    known->held = dJointIsEnabled(known->joint) != 0 &&
                  (is_owned(physics, known->index[0]) || is_owned(physics, known->index[1]));
    if (known->held) {
      dJointDisable(known->joint);
    }
  }
  while (again) {
    again = false;
    for (uint32_t i = 0; i < table->count; ++i) {
      const hapi_known_joint *known = &table->entries[i];
      again =
          (known->held && (hold_partner(physics, known, 0) || hold_partner(physics, known, 1))) ||
          again;
    }
  }
}

void hapi_joints_let_go(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->world.joints.count; ++i) {
    hapi_known_joint *known = &physics->world.joints.entries[i];
    dJointFeedback *feedback = known->held ? dJointGetFeedback(known->joint) : NULL;
    if (feedback != NULL) {
      memset(feedback, 0, sizeof *feedback);
    }
    if (known->held) {
      dJointEnable(known->joint);
    }
    known->held = false;
  }
}

/* ---- the message ---- */

typedef dReal (*parameter_fn)(dJointID, int);

static hapi_softness softness_of(const hapi_physics *physics, double erp, double cfm)
{
  hapi_softness out = {erp, cfm, cfm > SOFT_CFM};
  hapi_soften(physics->config.physics_hz / physics->config.haptic_hz, &out.erp, &out.cfm);
  return out;
}

static uint32_t stop_flag(double stop, bool turns, uint32_t flag)
{
  bool there = turns ? fabs(stop) < WHOLE_TURN : isfinite(stop);
  return there ? flag : 0u;
}

static void fill_limit(const hapi_physics *physics, dJointID joint, parameter_fn get, int group,
                       bool turns, hapi_model_limit *out)
{
  out->low = get(joint, dParamLoStop + group);
  out->high = get(joint, dParamHiStop + group);
  if (out->low <= out->high) { /* else ODE has none */
    out->flags |= stop_flag(out->low, turns, HAPI_LIMIT_LOW);
    out->flags |= stop_flag(out->high, turns, HAPI_LIMIT_HIGH);
  }
  if (out->flags == (HAPI_LIMIT_LOW | HAPI_LIMIT_HIGH) && out->low == out->high) {
    out->flags = HAPI_LIMIT_LOCKED;
  }
  out->stop =
      softness_of(physics, get(joint, dParamStopERP + group), get(joint, dParamStopCFM + group));
  out->bounce = hapi_wish_is_off(physics->cycle.wishes, HAP_EFFECT_RESTITUTION)
                    ? 0.0
                    : get(joint, dParamBounce + group);
  out->speed = get(joint, dParamVel + group);
  out->force = get(joint, dParamFMax + group);
  out->motor_cfm = get(joint, dParamCFM + group);
  out->fudge = get(joint, dParamFudgeFactor + group);
  bool drives = out->force > 0.0 && (out->flags & HAPI_LIMIT_LOCKED) == 0;
  out->flags |= drives ? HAPI_LIMIT_MOTOR : 0u;
}

static void fill_parameters(const hapi_physics *physics, const hapi_known_joint *known,
                            hapi_model_joint *out)
{
  dJointID joint = known->joint;
  dWorldID world = physics->world.ode.world;
  out->linear = softness_of(physics, dWorldGetERP(world), dWorldGetCFM(world));
  out->angular = out->along = out->linear;
  switch (known->kind) {
    case HAPI_JOINT_BALL:
      out->linear = softness_of(physics, dJointGetBallParam(joint, dParamERP),
                                dJointGetBallParam(joint, dParamCFM));
      break;
    case HAPI_JOINT_HINGE:
      fill_limit(physics, joint, dJointGetHingeParam, 0, true, &out->limits[0]);
      break;
    case HAPI_JOINT_SLIDER:
      fill_limit(physics, joint, dJointGetSliderParam, 0, false, &out->limits[0]);
      break;
    case HAPI_JOINT_UNIVERSAL:
      fill_limit(physics, joint, dJointGetUniversalParam, 0, true, &out->limits[0]);
      fill_limit(physics, joint, dJointGetUniversalParam, dParamGroup, true, &out->limits[1]);
      break;
    case HAPI_JOINT_HINGE2:
      fill_limit(physics, joint, dJointGetHinge2Param, 0, true, &out->limits[0]);
      fill_limit(physics, joint, dJointGetHinge2Param, dParamGroup, true, &out->limits[1]);
      out->limits[1].flags &= HAPI_LIMIT_MOTOR; /* ODE never stops the second axis */
      out->along = softness_of(physics, dJointGetHinge2Param(joint, dParamSuspensionERP),
                               dJointGetHinge2Param(joint, dParamSuspensionCFM));
      break;
    case HAPI_JOINT_FIXED:
      out->linear = softness_of(physics, dJointGetFixedParam(joint, dParamERP),
                                dJointGetFixedParam(joint, dParamCFM));
      break;
    case HAPI_JOINT_MEASURED:
      break;
  }
}

static void fill_limits(const hapi_physics *physics, const hapi_known_joint *known,
                        hapi_model_joint *out)
{
  hapi_joint_axis axes[HAPI_JOINT_LIMITS] = {{0}};
  int count = hapi_joint_axes(known, axes);
  for (int i = 0; i < count; ++i) {
    fill_limit(physics, known->joint, axes[i].get, axes[i].group, !axes[i].slides, &out->limits[i]);
  }
}

static void fill(hapi_physics *physics, const hapi_known_joint *known, hapi_model_joint *out)
{
  memset(out, 0, sizeof *out);
  const hapi_joint_measurement *measured = known->carried ? NULL : known->measurement;
  uint32_t first = measured != NULL ? measured->first : 0;
  const hapi_body_slot *a = slot_of(physics, known->index[first]);
  const hapi_body_slot *b = slot_of(physics, known->index[1 - first]);
  out->slot = known->slot;
  out->generation = physics->world.joints.slots[known->slot].generation;
  out->kind = known->kind;
  out->body_a = (uint32_t)(a - physics->near.slots.bodies);
  out->generation_a = a->generation;
  out->body_b = b != NULL ? (uint32_t)(b - physics->near.slots.bodies) : HAPI_SLOT_NONE;
  out->generation_b = b != NULL ? b->generation : 0;
  if (measured != NULL) {
    out->kind = HAPI_JOINT_MEASURED;
    out->place = measured->place;
    out->measured = measured->found;
    fill_limits(physics, known, out);
    return;
  }
  out->place = known->place;
  fill_parameters(physics, known, out);
}

/* A place among those that the loop keeps impulses for. The range takes no more joints than there are. */
static void take_slot(hapi_joint_table *table, uint32_t index)
{
  uint32_t at = 0;
  while (table->slots[at].taken != 0) {
    ++at;
  }
  table->slots[at].taken = index + 1;
  table->slot_high = at >= table->slot_high ? at + 1 : table->slot_high;
  ++table->slots[at].generation;
  table->entries[index].slot = at;
}

static void free_slots(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->world.joints;
  for (uint32_t i = 0; i < table->slot_high; ++i) {
    hapi_joint_slot *slot = &table->slots[i];
    hapi_known_joint *known = slot->taken != 0 ? &table->entries[slot->taken - 1] : NULL;
    if (known != NULL && known->ranged_in != physics->cycle.model_number) {
      known->slot = HAPI_NONE;
      slot->taken = 0;
    }
  }
}

void hapi_joints_publish(hapi_physics *physics, hapi_model *out)
{
  hapi_range *range = &physics->near.range;
  hapi_model_joint *joints = hapi_model_joints(out);
  out->joint_count = 0;
  if (physics->cycle.model != HAP_MODEL_CONTACT || range->number != physics->cycle.model_number) {
    return;
  }
  free_slots(physics);
  for (uint32_t i = 0; i < range->joint_count; ++i) {
    const hapi_known_joint *known = &physics->world.joints.entries[range->joints[i]];
    if (known->slot == HAPI_NONE) {
      take_slot(&physics->world.joints, range->joints[i]);
    }
    fill(physics, known, &joints[out->joint_count++]);
  }
}
