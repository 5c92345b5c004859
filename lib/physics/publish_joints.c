/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "physics/publish.h"
#include "probe/joint_probe.h"

/* The joints of the range, as the loop has them. */

/* A softness from which on a constraint is a spring, not a rigid one with rounding; as of
 * contacts. */
#define SOFT_CFM 1e-6

/* ODE: a stop at pi and beyond is never met, as the angle goes on at -pi. */
#define WHOLE_TURN (M_PI - 1e-9)

typedef dReal (*parameter_fn)(dJointID, int);

static const hapi_body_slot *slot_of(const hapi_publishing *p, uint32_t body)
{
  uint32_t slot = body != HAPI_NONE ? p->world->bodies.entries[body].slot : HAPI_NONE;
  return slot != HAPI_NONE ? &p->slots->bodies[slot] : NULL;
}

static hapi_softness softness_of(const hapi_publishing *p, double erp, double cfm)
{
  hapi_softness out = {erp, cfm, cfm > SOFT_CFM};
  hapi_soften(hapi_step_ratio(p->cycle), &out.erp, &out.cfm);
  return out;
}

static uint32_t stop_flag(double stop, bool turns, uint32_t flag)
{
  bool there = turns ? fabs(stop) < WHOLE_TURN : isfinite(stop);
  return there ? flag : 0u;
}

static void fill_limit(const hapi_publishing *p, dJointID joint, parameter_fn get, int group,
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
  out->stop = softness_of(p, get(joint, dParamStopERP + group), get(joint, dParamStopCFM + group));
  out->bounce = hapi_wish_is_off(p->cycle->wishes, HAP_EFFECT_RESTITUTION)
                    ? 0.0
                    : get(joint, dParamBounce + group);
  out->speed = get(joint, dParamVel + group);
  out->force = get(joint, dParamFMax + group);
  out->motor_cfm = get(joint, dParamCFM + group);
  out->fudge = get(joint, dParamFudgeFactor + group);
  bool drives = out->force > 0.0 && (out->flags & HAPI_LIMIT_LOCKED) == 0;
  out->flags |= drives ? HAPI_LIMIT_MOTOR : 0u;
}

static void fill_parameters(const hapi_publishing *p, const hapi_known_joint *known,
                            hapi_model_joint *out)
{
  dJointID joint = known->joint;
  dWorldID world = p->world->ode.world;
  out->linear = softness_of(p, dWorldGetERP(world), dWorldGetCFM(world));
  out->angular = out->along = out->linear;
  switch (known->kind) {
    case HAPI_JOINT_BALL:
      out->linear = softness_of(p, dJointGetBallParam(joint, dParamERP),
                                dJointGetBallParam(joint, dParamCFM));
      break;
    case HAPI_JOINT_HINGE:
      fill_limit(p, joint, dJointGetHingeParam, 0, true, &out->limits[0]);
      break;
    case HAPI_JOINT_SLIDER:
      fill_limit(p, joint, dJointGetSliderParam, 0, false, &out->limits[0]);
      break;
    case HAPI_JOINT_UNIVERSAL:
      fill_limit(p, joint, dJointGetUniversalParam, 0, true, &out->limits[0]);
      fill_limit(p, joint, dJointGetUniversalParam, dParamGroup, true, &out->limits[1]);
      break;
    case HAPI_JOINT_HINGE2:
      fill_limit(p, joint, dJointGetHinge2Param, 0, true, &out->limits[0]);
      fill_limit(p, joint, dJointGetHinge2Param, dParamGroup, true, &out->limits[1]);
      out->limits[1].flags &= HAPI_LIMIT_MOTOR; /* ODE never stops the second axis */
      out->along = softness_of(p, dJointGetHinge2Param(joint, dParamSuspensionERP),
                               dJointGetHinge2Param(joint, dParamSuspensionCFM));
      break;
    case HAPI_JOINT_FIXED:
      out->linear = softness_of(p, dJointGetFixedParam(joint, dParamERP),
                                dJointGetFixedParam(joint, dParamCFM));
      break;
    case HAPI_JOINT_MEASURED:
      break;
  }
}

static void fill_limits(const hapi_publishing *p, const hapi_known_joint *known,
                        hapi_model_joint *out)
{
  hapi_joint_axis axes[HAPI_JOINT_LIMITS] = {{0}};
  int count = hapi_joint_axes(known, axes);
  for (int i = 0; i < count; ++i) {
    fill_limit(p, known->joint, axes[i].get, axes[i].group, !axes[i].slides, &out->limits[i]);
  }
}

static void joint_fill(const hapi_publishing *p, const hapi_known_joint *known,
                       hapi_model_joint *out)
{
  HAPI_ASSERT_INDEX(known->slot, p->world->joints.slot_count);
  memset(out, 0, sizeof *out);
  const hapi_joint_measurement *measured = known->carried ? NULL : known->measurement;
  uint32_t first = measured != NULL ? measured->first : 0;
  const hapi_body_slot *a = slot_of(p, known->index[first]);
  const hapi_body_slot *b = slot_of(p, known->index[1 - first]);
  out->slot = known->slot;
  out->generation = p->world->joints.slots[known->slot].generation;
  out->kind = known->kind;
  out->body_a = (uint32_t)(a - p->slots->bodies);
  out->generation_a = a->generation;
  out->body_b = b != NULL ? (uint32_t)(b - p->slots->bodies) : HAPI_SLOT_NONE;
  out->generation_b = b != NULL ? b->generation : 0;
  if (measured != NULL) {
    out->kind = HAPI_JOINT_MEASURED;
    out->place = measured->place;
    out->measured = measured->found;
    fill_limits(p, known, out);
    return;
  }
  out->place = known->place;
  fill_parameters(p, known, out);
}

void hapi_publish_joints(const hapi_publishing *p, const uint32_t *joints, uint32_t count,
                         hapi_model *out)
{
  hapi_model_joint *to = hapi_model_joints(out);
  HAPI_ASSERT(count <= p->cycle->config->capacity.joints);
  for (uint32_t i = 0; i < count; ++i) {
    joint_fill(p, &p->world->joints.entries[joints[i]], &to[i]);
  }
  out->joint_count = count;
}
