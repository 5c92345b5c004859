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

/* A softness from which on a constraint is a spring, not a rigid one with rounding; as of contacts. */
#define SOFT_CFM 1e-6

/* ODE: a stop at pi and beyond is never met, as the angle goes on at -pi. */
#define WHOLE_TURN (M_PI - 1e-9)

/* ---- the table ---- */

static uint32_t hash_of(dJointID joint)
{
  uint64_t x = (uint64_t)(uintptr_t)joint;
  x = (x ^ (x >> 33)) * 0xff51afd7ed558ccdu;
  return (uint32_t)(x ^ (x >> 33));
}

uint32_t hapi_joints_find(const hapi_joint_table *table, dJointID joint)
{
  if (table->bucket_count == 0) {
    return HAPI_NONE;
  }
  uint32_t mask = table->bucket_count - 1;
  for (uint32_t at = hash_of(joint) & mask; table->buckets[at] != 0; at = (at + 1) & mask) {
    if (table->entries[table->buckets[at] - 1].joint == joint) {
      return table->buckets[at] - 1;
    }
  }
  return HAPI_NONE;
}

static void insert_bucket(hapi_joint_table *table, uint32_t index)
{
  uint32_t mask = table->bucket_count - 1;
  uint32_t at = hash_of(table->entries[index].joint) & mask;
  while (table->buckets[at] != 0) {
    at = (at + 1) & mask;
  }
  table->buckets[at] = index + 1;
}

static void rebuild_buckets(hapi_joint_table *table)
{
  memset(table->buckets, 0, table->bucket_count * sizeof *table->buckets);
  for (uint32_t i = 0; i < table->count; ++i) {
    insert_bucket(table, i);
  }
}

static bool grow(hapi_joint_table *table)
{
  uint32_t capacity = table->capacity > 0 ? 2 * table->capacity : FIRST_CAPACITY;
  hapi_known_joint *entries = hapi_alloc_array(capacity, sizeof *entries);
  uint32_t *buckets = hapi_alloc_array((size_t)4 * capacity, sizeof *buckets);
  if (entries == NULL || buckets == NULL) {
    hapi_free(entries);
    hapi_free(buckets);
    return false;
  }
  if (table->count > 0) {
    memcpy(entries, table->entries, table->count * sizeof *entries);
  }
  hapi_free(table->entries);
  hapi_free(table->buckets);
  table->entries = entries;
  table->buckets = buckets;
  table->capacity = capacity;
  table->bucket_count = 4 * capacity;
  rebuild_buckets(table);
  return true;
}

/* NULL: no memory. */
static hapi_known_joint *add(hapi_joint_table *table, dJointID joint)
{
  if (table->count == table->capacity && !grow(table)) {
    return NULL;
  }
  hapi_known_joint *known = &table->entries[table->count];
  memset(known, 0, sizeof *known);
  known->joint = joint;
  known->slot = HAPI_NONE;
  insert_bucket(table, table->count++);
  return known;
}

/* In their order: the order of a walk over them does not depend on what was destroyed when. */
static void drop_unseen(hapi_joint_table *table)
{
  uint32_t kept = 0;
  for (uint32_t i = 0; i < table->count; ++i) {
    if (table->entries[i].seen == table->scan) {
      table->entries[kept++] = table->entries[i];
    } else {
      hapi_free(table->entries[i].measurement);
    }
  }
  if (kept < table->count) {
    table->count = kept;
    rebuild_buckets(table);
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
  hapi_free(table->buckets);
  hapi_free(table->slots);
  memset(table, 0, sizeof *table);
}

bool hapi_joints_create(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->joints;
  table->slots = hapi_alloc_array(physics->config.capacity.joints, sizeof *table->slots);
  return table->slots != NULL;
}

/* ---- which there are ---- */

static bool is_local(const hapi_physics *physics, uint32_t body)
{
  return body != HAPI_NONE && physics->table.entries[body].slot != HAPI_NONE;
}

/* One that is far from the pointers is read when it is new, and again when it comes near. */
static void look_at(hapi_physics *physics, hapi_known_joint *known, bool is_new)
{
  dBodyID a = dJointGetBody(known->joint, 0);
  dBodyID b = dJointGetBody(known->joint, 1);
  dBodyID first = a != NULL ? a : b; /* ODE's own order: the world comes second */
  dBodyID second = a != NULL ? b : NULL;
  hapi_joint_kind kind = HAPI_JOINT_BALL;
  bool carried = hapi_joint_kind_of(known->joint, &kind);
  bool other = is_new || first != known->bodies[0] || second != known->bodies[1] ||
               kind != known->kind || carried != known->carried;
  known->bodies[0] = first;
  known->bodies[1] = second;
  known->index[0] = hapi_bodies_find(&physics->table, first);
  known->index[1] = hapi_bodies_find(&physics->table, second);
  known->kind = kind;
  known->carried = carried;
  if (other) {
    hapi_free(known->measurement);
    known->measurement = NULL;
    known->usable = false;
    known->left_is_known = false;
  }
  bool near = is_local(physics, known->index[0]) || is_local(physics, known->index[1]);
  if (carried && (other || near || known->left_is_known)) {
    hapi_joint_read(known, other);
  }
}

static void see(hapi_physics *physics, dJointID joint)
{
  hapi_joint_table *table = &physics->joints;
  uint32_t index = hapi_joints_find(table, joint);
  hapi_known_joint *known =
      index != HAPI_NONE ? &table->entries[index] : (table->starved ? NULL : add(table, joint));
  if (known == NULL) {
    table->starved = true;
  } else if (known->seen != table->scan) {
    known->seen = table->scan;
    look_at(physics, known, index == HAPI_NONE);
  }
}

void hapi_joints_scan(hapi_physics *physics)
{
  ++physics->joints.scan;
  physics->joints.starved = false;
  for (uint32_t i = 0; i < physics->table.high; ++i) {
    dBodyID body = physics->table.handles[i];
    int count = body != NULL ? dBodyGetNumJoints(body) : 0;
    for (int k = 0; k < count; ++k) {
      dJointID joint = dBodyGetJoint(body, k);
      if (dJointGetType(joint) != dJointTypeContact) {
        see(physics, joint);
      }
    }
  }
  drop_unseen(&physics->joints);
}

void hapi_joints_leave(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->joints.count; ++i) {
    hapi_joint_leave(&physics->joints.entries[i]);
  }
}

void hapi_joints_reset(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->joints;
  forget_measurements(table);
  table->count = 0;
  if (table->bucket_count > 0) {
    rebuild_buckets(table);
  }
  for (uint32_t i = 0; i < physics->config.capacity.joints; ++i) {
    table->slots[i].joint = NULL;
  }
}

/* ---- joints of bodies that the loop owns are not ODE's ---- */

static bool is_owned(const hapi_physics *physics, uint32_t body)
{
  return body != HAPI_NONE && physics->table.entries[body].loop_owned;
}

static hapi_body_slot *slot_of(hapi_physics *physics, uint32_t body)
{
  return is_local(physics, body) ? &physics->bodies[physics->table.entries[body].slot] : NULL;
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
  hapi_joint_table *table = &physics->joints;
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
  for (uint32_t i = 0; i < physics->joints.count; ++i) {
    hapi_known_joint *known = &physics->joints.entries[i];
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
  out->bounce = get(joint, dParamBounce + group);
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
  dWorldID world = physics->ode.world;
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
  out->generation = physics->joints.slots[known->slot].generation;
  out->kind = known->kind;
  out->body_a = (uint32_t)(a - physics->bodies);
  out->generation_a = a->generation;
  out->body_b = b != NULL ? (uint32_t)(b - physics->bodies) : HAPI_SLOT_NONE;
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
static void take_slot(hapi_joint_table *table, hapi_known_joint *known)
{
  uint32_t at = 0;
  while (table->slots[at].joint != NULL) {
    ++at;
  }
  table->slots[at].joint = known->joint;
  ++table->slots[at].generation;
  known->slot = at;
}

static void free_slots(hapi_physics *physics)
{
  hapi_joint_table *table = &physics->joints;
  for (uint32_t i = 0; i < physics->config.capacity.joints; ++i) {
    uint32_t index =
        table->slots[i].joint != NULL ? hapi_joints_find(table, table->slots[i].joint) : HAPI_NONE;
    bool kept = index != HAPI_NONE && table->entries[index].slot == i &&
                table->entries[index].ranged_in == physics->model_number;
    if (!kept) {
      table->slots[i].joint = NULL;
      if (index != HAPI_NONE && table->entries[index].slot == i) {
        table->entries[index].slot = HAPI_NONE;
      }
    }
  }
}

void hapi_joints_publish(hapi_physics *physics, hapi_model *out)
{
  hapi_range *range = &physics->range;
  hapi_model_joint *joints = hapi_model_joints(out);
  out->joint_count = 0;
  if (physics->model != HAP_MODEL_CONTACT || range->number != physics->model_number) {
    return;
  }
  free_slots(physics);
  for (uint32_t i = 0; i < range->joint_count; ++i) {
    hapi_known_joint *known = &physics->joints.entries[range->joints[i]];
    if (known->slot == HAPI_NONE) {
      take_slot(&physics->joints, known);
    }
    fill(physics, known, &joints[out->joint_count++]);
  }
}
