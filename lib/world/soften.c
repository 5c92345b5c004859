/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/vec.h"
#include "world/world.h"

/* ODE's error reduction, constraint softness and damping are meant for the step of the world. What
 * is stepped at the haptic rate, the loop's contacts and the world itself in model SINGLE, needs
 * those of another step with the same effect. So does the world in slow motion. */

/* erp = h k / (h k + d), cfm = 1 / (h k + d) for a spring k and a damper d (ODE's manual). */
void hapi_soften(double ratio, double *erp, double *cfm)
{
  HAPI_ASSERT(ratio > 0.0);
  double part = ratio * *erp + 1.0 - *erp;
  if (part > 0.0) {
    *erp = ratio * *erp / part;
    *cfm = *cfm / part;
  }
}

/* ---- model SINGLE ---- */

static double keep_of(double damping, double ratio)
{
  return 1.0 - pow(1.0 - fmin(fmax(damping, 0.0), 1.0), ratio);
}

/* Of a joint's error reductions and softnesses of its own: how many, and the parameter of one. */
static int soft_count(const hapi_joint_traits *traits)
{
  return traits == NULL ? 0 : traits->soft == HAPI_SOFT_OWN ? 1 : traits->groups;
}

static int soft_erp(const hapi_joint_traits *traits, int i)
{
  return traits->soft == HAPI_SOFT_OWN                    ? dParamERP
         : traits->soft == HAPI_SOFT_SUSPENSION && i == 1 ? dParamSuspensionERP
                                                          : dParamStopERP + i * dParamGroup;
}

static int soft_cfm(const hapi_joint_traits *traits, int i)
{
  return traits->soft == HAPI_SOFT_OWN                    ? dParamCFM
         : traits->soft == HAPI_SOFT_SUSPENSION && i == 1 ? dParamSuspensionCFM
                                                          : dParamStopCFM + i * dParamGroup;
}

void hapi_joint_soften(hapi_known_joint *known, double ratio)
{
  const hapi_joint_traits *own = hapi_joint_traits_of(known->joint);
  for (int i = 0; i < soft_count(own); ++i) {
    double *meant = known->meant[i];
    meant[0] = own->get(known->joint, soft_erp(own, i));
    meant[1] = own->get(known->joint, soft_cfm(own, i));
    double erp = meant[0];
    double cfm = meant[1];
    hapi_soften(ratio, &erp, &cfm);
    own->set(known->joint, soft_erp(own, i), erp);
    own->set(known->joint, soft_cfm(own, i), cfm);
  }
}

/* The largest error reduction of its own, 0 where it has none. */
double hapi_joint_erp(const hapi_known_joint *known)
{
  const hapi_joint_traits *own = hapi_joint_traits_of(known->joint);
  double most = 0.0;
  for (int i = 0; i < soft_count(own); ++i) {
    most = fmax(most, own->get(known->joint, soft_erp(own, i)));
  }
  return most;
}

/* Between soften and restore. */
void hapi_joint_leave_open(const hapi_known_joint *known, bool open, double ratio)
{
  const hapi_joint_traits *own = hapi_joint_traits_of(known->joint);
  for (int i = 0; i < soft_count(own); ++i) {
    double erp = known->meant[i][0];
    double cfm = known->meant[i][1];
    hapi_soften(ratio, &erp, &cfm);
    own->set(known->joint, soft_erp(own, i), open ? 0.0 : erp);
  }
}

void hapi_joint_restore(const hapi_known_joint *known)
{
  const hapi_joint_traits *own = hapi_joint_traits_of(known->joint);
  for (int i = 0; i < soft_count(own); ++i) {
    own->set(known->joint, soft_erp(own, i), known->meant[i][0]);
    own->set(known->joint, soft_cfm(own, i), known->meant[i][1]);
  }
}

double hapi_step_ratio(const hapi_cycle *cycle)
{
  return cycle->config->physics_hz / cycle->config->haptic_hz;
}

double hapi_tick_ratio(const hapi_cycle *cycle)
{
  return hapi_step_ratio(cycle) * hapi_cycle_scale(cycle);
}

double hapi_world_ratio(const hapi_cycle *cycle)
{
  double ratio = cycle->model == HAP_MODEL_SINGLE ? hapi_step_ratio(cycle)
                                                  : cycle->soft_s / hapi_cycle_test_s(cycle);
  ratio /= cycle->parts > 1 ? (double)cycle->parts : 1.0;
  return cycle->step_scale > 0.0 ? ratio * cycle->step_scale : ratio;
}

void hapi_world_convert(const hapi_world *world, double ratio, hapi_meant *out)
{
  *out = (hapi_meant){.converted = ratio != 1.0};
  if (!out->converted) {
    return;
  }
  double erp = out->erp = dWorldGetERP(world->ode.world);
  double cfm = out->cfm = dWorldGetCFM(world->ode.world);
  hapi_soften(ratio, &erp, &cfm);
  dWorldSetERP(world->ode.world, erp);
  dWorldSetCFM(world->ode.world, cfm);
  for (uint32_t i = 0; i < world->joints.count; ++i) {
    hapi_joint_soften(&world->joints.entries[i], ratio);
  }
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    hapi_known_body *known = &world->bodies.entries[i];
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

void hapi_world_restore(const hapi_world *world, const hapi_meant *meant)
{
  if (!meant->converted) {
    return;
  }
  dWorldSetERP(world->ode.world, meant->erp);
  dWorldSetCFM(world->ode.world, meant->cfm);
  for (uint32_t i = 0; i < world->joints.count; ++i) {
    hapi_joint_restore(&world->joints.entries[i]);
  }
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    const hapi_known_body *known = &world->bodies.entries[i];
    if (known->body != NULL && (known->rest->damping[0] != 0.0 || known->rest->damping[1] != 0.0)) {
      dBodySetLinearDamping(known->body, known->rest->damping[0]);
      dBodySetAngularDamping(known->body, known->rest->damping[1]);
    }
  }
}
