/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "physics/physics_internal.h"

/* ODE's error reduction, constraint softness and damping are meant for the step of the world. What
 * is stepped at the haptic rate, the loop's contacts and the world itself in model SINGLE, needs
 * those of another step with the same effect. */

/* A softness from which on a contact is a spring, not a rigid one with rounding. */
#define SOFT_CFM 1e-6

static double step_ratio(const hapi_physics *physics)
{
  return physics->config.physics_hz / physics->config.haptic_hz;
}

/* erp = h k / (h k + d), cfm = 1 / (h k + d) for a spring k and a damper d (ODE's manual). */
void hapi_soften(double ratio, double *erp, double *cfm)
{
  double part = ratio * *erp + 1.0 - *erp;
  if (part > 0.0) {
    *erp = ratio * *erp / part;
    *cfm = *cfm / part;
  }
}

static uint32_t flags_of(const dSurfaceParameters *s, double cfm)
{
  const struct {
    int mode;
    uint32_t flag;
  } bits[] = {
      {dContactApprox1_1, HAPI_SURFACE_APPROX1_1}, {dContactApprox1_2, HAPI_SURFACE_APPROX1_2},
      {dContactFDir1, HAPI_SURFACE_FDIR1},         {dContactBounce, HAPI_SURFACE_BOUNCE},
      {dContactSlip1, HAPI_SURFACE_SLIP1},         {dContactSlip2, HAPI_SURFACE_SLIP2},
  };
  bool asked = (s->mode & (dContactSoftERP | dContactSoftCFM)) != 0;
  uint32_t flags = (asked && cfm > 0.0) || cfm > SOFT_CFM ? HAPI_SURFACE_SOFT : 0u;
  for (size_t i = 0; i < sizeof bits / sizeof bits[0]; ++i) {
    flags |= (s->mode & bits[i].mode) != 0 ? bits[i].flag : 0u;
  }
  return flags;
}

static void fill_surface(const hapi_physics *physics, const dSurfaceParameters *s,
                         hapi_surface *out)
{
  dWorldID world = physics->world.ode.world;
  memset(out, 0, sizeof *out);
  out->erp = (s->mode & dContactSoftERP) != 0 ? s->soft_erp : dWorldGetERP(world);
  out->cfm = (s->mode & dContactSoftCFM) != 0 ? s->soft_cfm : dWorldGetCFM(world);
  out->flags = flags_of(s, out->cfm);
  hapi_soften(step_ratio(physics), &out->erp, &out->cfm);
  out->mu = s->mu;
  out->mu2 = (s->mode & dContactMu2) != 0 ? s->mu2 : s->mu;
  out->bounce = s->bounce;
  out->bounce_speed = s->bounce_vel;
  out->layer = dWorldGetContactSurfaceLayer(world);
  out->max_push = dWorldGetContactMaxCorrectingVel(world);
  out->motion[0] = (s->mode & dContactMotion1) != 0 ? s->motion1 : 0.0;
  out->motion[1] = (s->mode & dContactMotion2) != 0 ? s->motion2 : 0.0;
  out->motion[2] = (s->mode & dContactMotionN) != 0 ? s->motionN : 0.0;
  out->slip[0] = s->slip1;
  out->slip[1] = s->slip2;
}

bool hapi_world_surface(hapi_physics *physics, hapi_link *link)
{
  hapi_surface *out = &link->surface;
  dSurfaceParameters surface;
  if (!hapi_world_ask_surface(physics, link->own, link->other, &surface, &link->turned)) {
    return false;
  }
  dGeomID a = link->turned ? link->other : link->own;
  dGeomID b = link->turned ? link->own : link->other;
  fill_surface(physics, &surface, out);
  double direction[3];
  if ((surface.mode & dContactFDir1) != 0 && hapi_world_direction(physics, a, b, direction)) {
    hapi_v3_copy(direction, out->direction);
  } else {
    out->flags &= ~(uint32_t)HAPI_SURFACE_FDIR1;
  }
  if (hapi_wish_is_off(physics->cycle.wishes, HAP_EFFECT_RESTITUTION)) {
    out->flags &= ~(uint32_t)HAPI_SURFACE_BOUNCE;
  }
  return true;
}

/* ---- model SINGLE ---- */

static double keep_of(double damping, double ratio)
{
  return 1.0 - pow(1.0 - fmin(fmax(damping, 0.0), 1.0), ratio);
}

/* Where a joint has error reduction and softness of its own: beside those of the world's rows. */
typedef struct joint_parameters {
  dJointType type;
  dReal (*get)(dJointID, int);
  void (*set)(dJointID, int, dReal);
  int count;
  int names[3][2];
} joint_parameters;

#define STOP(group)                                                          \
  {                                                                          \
    dParamStopERP + (group)*dParamGroup, dParamStopCFM + (group)*dParamGroup \
  }

static const joint_parameters own_parameters[] = {
    {dJointTypeBall, dJointGetBallParam, dJointSetBallParam, 1, {{dParamERP, dParamCFM}}},
    {dJointTypeDBall, dJointGetDBallParam, dJointSetDBallParam, 1, {{dParamERP, dParamCFM}}},
    {dJointTypeDHinge, dJointGetDHingeParam, dJointSetDHingeParam, 1, {{dParamERP, dParamCFM}}},
    {dJointTypeFixed, dJointGetFixedParam, dJointSetFixedParam, 1, {{dParamERP, dParamCFM}}},
    {dJointTypeHinge, dJointGetHingeParam, dJointSetHingeParam, 1, {STOP(0)}},
    {dJointTypeSlider, dJointGetSliderParam, dJointSetSliderParam, 1, {STOP(0)}},
    {dJointTypeUniversal, dJointGetUniversalParam, dJointSetUniversalParam, 2, {STOP(0), STOP(1)}},
    {dJointTypeHinge2,
     dJointGetHinge2Param,
     dJointSetHinge2Param,
     2,
     {STOP(0), {dParamSuspensionERP, dParamSuspensionCFM}}},
    {dJointTypeAMotor, dJointGetAMotorParam, dJointSetAMotorParam, 3, {STOP(0), STOP(1), STOP(2)}},
    {dJointTypeLMotor, dJointGetLMotorParam, dJointSetLMotorParam, 3, {STOP(0), STOP(1), STOP(2)}},
    {dJointTypePR, dJointGetPRParam, dJointSetPRParam, 2, {STOP(0), STOP(1)}},
    {dJointTypePU, dJointGetPUParam, dJointSetPUParam, 3, {STOP(0), STOP(1), STOP(2)}},
    {dJointTypePiston, dJointGetPistonParam, dJointSetPistonParam, 2, {STOP(0), STOP(1)}},
};

static const joint_parameters *parameters_of(dJointID joint)
{
  dJointType type = dJointGetType(joint);
  for (size_t i = 0; i < sizeof own_parameters / sizeof own_parameters[0]; ++i) {
    if (own_parameters[i].type == type) {
      return &own_parameters[i];
    }
  }
  return NULL;
}

void hapi_joint_soften(hapi_known_joint *known, double ratio)
{
  const joint_parameters *own = parameters_of(known->joint);
  for (int i = 0; own != NULL && i < own->count; ++i) {
    double *meant = known->meant[i];
    meant[0] = own->get(known->joint, own->names[i][0]);
    meant[1] = own->get(known->joint, own->names[i][1]);
    double erp = meant[0];
    double cfm = meant[1];
    hapi_soften(ratio, &erp, &cfm);
    own->set(known->joint, own->names[i][0], erp);
    own->set(known->joint, own->names[i][1], cfm);
  }
}

/* The largest error reduction of its own, 0 where it has none. */
double hapi_joint_erp(const hapi_known_joint *known)
{
  const joint_parameters *own = parameters_of(known->joint);
  double most = 0.0;
  for (int i = 0; own != NULL && i < own->count; ++i) {
    most = fmax(most, own->get(known->joint, own->names[i][0]));
  }
  return most;
}

/* Between soften and restore. */
void hapi_joint_leave_open(const hapi_known_joint *known, bool open, double ratio)
{
  const joint_parameters *own = parameters_of(known->joint);
  for (int i = 0; own != NULL && i < own->count; ++i) {
    double erp = known->meant[i][0];
    double cfm = known->meant[i][1];
    hapi_soften(ratio, &erp, &cfm);
    own->set(known->joint, own->names[i][0], open ? 0.0 : erp);
  }
}

void hapi_joint_restore(const hapi_known_joint *known)
{
  const joint_parameters *own = parameters_of(known->joint);
  for (int i = 0; own != NULL && i < own->count; ++i) {
    own->set(known->joint, own->names[i][0], known->meant[i][0]);
    own->set(known->joint, own->names[i][1], known->meant[i][1]);
  }
}

void hapi_world_convert(hapi_physics *physics)
{
  double ratio = step_ratio(physics);
  if (physics->cycle.model != HAP_MODEL_SINGLE || ratio == 1.0) {
    return;
  }
  dWorldID world = physics->world.ode.world;
  double erp = physics->world.meant_erp = dWorldGetERP(world);
  double cfm = physics->world.meant_cfm = dWorldGetCFM(world);
  hapi_soften(ratio, &erp, &cfm);
  dWorldSetERP(world, erp);
  dWorldSetCFM(world, cfm);
  physics->world.converted = true;
  for (uint32_t i = 0; i < physics->world.joints.count; ++i) {
    hapi_joint_soften(&physics->world.joints.entries[i], ratio);
  }
  for (uint32_t i = 0; i < physics->world.bodies.high; ++i) {
    hapi_known_body *known = &physics->world.bodies.entries[i];
    if (known->body != NULL) {
      known->rest->damping[0] = dBodyGetLinearDamping(known->body);
      known->rest->damping[1] = dBodyGetAngularDamping(known->body);
      if (known->rest->damping[0] != 0.0 || known->rest->damping[1] != 0.0) {
        dBodySetLinearDamping(known->body, keep_of(known->rest->damping[0], ratio));
        dBodySetAngularDamping(known->body, keep_of(known->rest->damping[1], ratio));
      }
    }
  }
}

void hapi_world_restore(hapi_physics *physics)
{
  if (!physics->world.converted) {
    return;
  }
  physics->world.converted = false;
  dWorldSetERP(physics->world.ode.world, physics->world.meant_erp);
  dWorldSetCFM(physics->world.ode.world, physics->world.meant_cfm);
  for (uint32_t i = 0; i < physics->world.joints.count; ++i) {
    hapi_joint_restore(&physics->world.joints.entries[i]);
  }
  for (uint32_t i = 0; i < physics->world.bodies.high; ++i) {
    const hapi_known_body *known = &physics->world.bodies.entries[i];
    if (known->body != NULL && (known->rest->damping[0] != 0.0 || known->rest->damping[1] != 0.0)) {
      dBodySetLinearDamping(known->body, known->rest->damping[0]);
      dBodySetAngularDamping(known->body, known->rest->damping[1]);
    }
  }
}
