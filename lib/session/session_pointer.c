/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "haptic/coupling_gains.h"
#include "session/session_internal.h"

static bool unit_quaternion(const double q[4])
{
  double n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return fabs(n2 - 1.0) < 1e-3; /* false for NaN */
}

/* False for NaN. What the loop would take for an error is not let in. */
static bool within_reach(const double v[3])
{
  return fabs(v[0]) <= HAPI_STATE_LIMIT && fabs(v[1]) <= HAPI_STATE_LIMIT &&
         fabs(v[2]) <= HAPI_STATE_LIMIT;
}

static bool good_pose(const hap_pose *pose)
{
  return within_reach(pose->position) && unit_quaternion(pose->quat_wxyz);
}

static hap_status need(bool good, const char *what, hap_detail *detail)
{
  return good ? HAP_OK : hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s", what);
}

static bool between(double value, double low, double high)
{
  return value >= low && value <= high;
}

static hap_status check_numbers(const hapi_pointer_setup *d, hap_detail *detail)
{
  const struct {
    bool good;
    const char *what;
  } rules[] = {
      {between(d->radius, d->hull_points > 0 ? 0.0 : 1e-6, 100.0),
       "radius is not in 1e-6 .. 100 m (of a hull 0 .. 100 m)"},
      {between(d->proxy_mass, 0.0, 1e6), "proxy_mass is not in 0 .. 1e6 kg"},
      {between(d->stiffness, 0.0, 1e9), "stiffness is not in 0 .. 1e9 N/m"},
      {between(d->damping, 0.0, 1e6), "damping is not in 0 .. 1e6 N s/m"},
      {between(d->friction, 0.0, 10.0), "friction is not in 0 .. 10"},
      {between(d->finger_radius, 0.0, 100.0), "finger_radius is not in 0 .. 100 m"},
      {between(d->motion_scale, 1e-6, 1e6), "motion_scale is not in 1e-6 .. 1e6"},
      {between(d->force_scale, 0.0, 1e6), "force_scale is not in 0 .. 1e6"},
      {between(d->max_force, 1e-6, 1e6), "max_force is not in 1e-6 .. 1e6 N"},
      {between(d->max_torque, 1e-6, 1e6), "max_torque is not in 1e-6 .. 1e6 N m"},
      {between(d->velocity, HAP_VELOCITY_AUTO, HAP_VELOCITY_ESTIMATED),
       "velocity is not one of hap_velocity"},
      {d->device != NULL || d->velocity != HAP_VELOCITY_ESTIMATED,
       "velocity is HAP_VELOCITY_ESTIMATED, which needs a device"},
      {between(d->coupling_stiffness, 0.0, 1e9), "coupling_stiffness is not in 0 .. 1e9 N/m"},
      {between(d->coupling_damping, 0.0, 1e6), "coupling_damping is not in 0 .. 1e6 N s/m"},
      {d->coupling_damping == 0.0 || d->coupling_stiffness > 0.0,
       "coupling_damping is given without coupling_stiffness"},
      {between(d->coupling, HAP_COUPLING_DIRECT, HAP_COUPLING_VIRTUAL),
       "coupling is not one of hap_coupling"},
      {between(d->integration, HAP_INTEGRATION_AUTO, HAP_INTEGRATION_MIDPOINT),
       "integration is not one of hap_integration"},
      {between(d->hand_damping, 0.0, 1e3), "hand_damping is not in 0 .. 1e3 N s/m"},
      {between(d->max_slew, 0.0, 1e12), "max_slew is not in 0 .. 1e12 N/s"},
      {between(d->virtual_mass, 1e-6, 1e6), "virtual_mass is not in 1e-6 .. 1e6 kg"},
      {between(d->virtual_inertia, 0.0, 1e12), "virtual_inertia is not in 0 .. 1e12 kg m^2"},
      {good_pose(&d->pose_world_device),
       "pose_world_device is not within 1000 km with a unit quaternion"},
  };
  hap_status status = HAP_OK;
  for (size_t i = 0; i < sizeof rules / sizeof rules[0] && status >= HAP_OK; ++i) {
    status = need(rules[i].good, rules[i].what, detail);
  }
  return status;
}

hap_status hapi_session_check_pointer(const hapi_pointer_setup *d, hap_detail *detail)
{
  hap_status status = check_numbers(d, detail);
  return status >= HAP_OK ? hapi_session_check_hull(d, detail) : status;
}

/* A replay has the pointers of the recording, and what moved them. */
static hap_status refuse_in_replay(const hap_session *session)
{
  return hapi_session_fail(session, HAP_ERROR_STATE,
                           "the session plays a recording, which has the pointers in it");
}

static hapi_pointer_setup setup_of(const hap_pointer_def *d, const hap_pointer_expert_def *e,
                                   const hap_pointer_research_def *r)
{
  hapi_pointer_setup setup;
  memset(&setup, 0, sizeof setup);
  setup.size = sizeof setup;
  setup.cookie = HAPI_POINTER_COOKIE;
  setup.device = d->device;
  setup.pose_world_device = d->pose_world_device;
  setup.motion_scale = d->motion_scale;
  setup.force_scale = d->force_scale;
  setup.radius = d->radius;
  setup.hull_xyz = d->hull_xyz;
  setup.hull_points = d->hull_points;
  setup.stiffness = d->stiffness;
  setup.damping = d->damping;
  setup.friction = d->friction;
  setup.finger_radius = d->finger_radius;
  setup.max_force = d->max_force;
  setup.max_torque = d->max_torque;
  setup.collide_bits = d->collide_bits;
  setup.coupling = e->coupling;
  setup.proxy_mass = e->proxy_mass;
  setup.coupling_stiffness = e->coupling_stiffness;
  setup.coupling_damping = e->coupling_damping;
  setup.hand_damping = e->hand_damping;
  setup.max_slew = e->max_slew;
  setup.velocity = e->velocity;
  setup.integration = r->integration;
  setup.virtual_mass = r->virtual_mass;
  setup.virtual_inertia = r->virtual_inertia;
  return setup;
}

hap_status hapi_session_read_pointer(const hap_pointer_def *given, hapi_pointer_setup *out,
                                     hap_detail *detail)
{
  hap_pointer_def d;
  hap_pointer_expert_def e;
  hap_pointer_research_def r;
  hap_pointer_def_init(&d, sizeof d);
  hap_pointer_expert_def_init(&e, sizeof e);
  hap_pointer_research_def_init(&r, sizeof r);
  hap_status status =
      hapi_def_read(&d, sizeof d, given, HAPI_POINTER_COOKIE, "hap_pointer_def_init", detail);
  if (status >= HAP_OK && d.expert != NULL) {
    status = hapi_def_read(&e, sizeof e, d.expert, HAPI_POINTER_EXPERT_COOKIE,
                           "hap_pointer_expert_def_init", detail);
  }
  if (status >= HAP_OK && d.research != NULL) {
    status = hapi_def_read(&r, sizeof r, d.research, HAPI_POINTER_RESEARCH_COOKIE,
                           "hap_pointer_research_def_init", detail);
  }
  *out = setup_of(&d, &e, &r);
  return status >= HAP_OK ? hapi_session_check_pointer(out, detail) : status;
}

hap_status hap_pointer_add(hap_session *session, const hap_pointer_def *def, hap_pointer_id *out)
{
  if (session == NULL || out == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (session->player != NULL) {
    return refuse_in_replay(session);
  }
  hap_detail detail = {""};
  hapi_pointer_setup setup;
  out->v = 0;
  hap_status status = hapi_session_read_pointer(def, &setup, &detail);
  if (status >= HAP_OK && hapi_coupling_has_spring(setup.coupling) &&
      session->def.model != HAP_MODEL_CONTACT) {
    status = hapi_fail(&detail, HAP_ERROR_UNSUPPORTED,
                       "coupling %s needs model contact; the session has model %s",
                       hap_coupling_name(setup.coupling), hap_model_name(session->def.model));
  }
  if (status >= HAP_OK) {
    hapi_quat_normalize(setup.pose_world_device.quat_wxyz);
    status = hapi_haptic_add_pointer(session->haptic, &setup, out, &detail);
  }
  return status < HAP_OK ? hapi_session_fail(session, status, "%s", detail.text) : status;
}

static hap_status say_why_not(const hap_session *session, hap_pointer_id pointer, hap_status status)
{
  if (status == HAP_ERROR_NOT_FOUND) {
    return hapi_session_fail(session, status,
                             "there is no pointer with the id %#llx: it was removed, or it is of "
                             "another session",
                             (unsigned long long)pointer.v);
  }
  if (status == HAP_ERROR_STATE) {
    return hapi_session_fail(session, status,
                             "the pointer has a device, which alone moves it: a target is for one "
                             "without");
  }
  return status;
}

hap_status hap_pointer_remove(hap_session *session, hap_pointer_id pointer)
{
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (session->player != NULL) {
    return refuse_in_replay(session);
  }
  return say_why_not(session, pointer, hapi_haptic_remove_pointer(session->haptic, pointer));
}

hap_status hap_pointer_restart(hap_session *session, hap_pointer_id pointer)
{
  hap_detail detail = {""};
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (session->player != NULL) {
    return refuse_in_replay(session);
  }
  hap_status status = hapi_haptic_restart_pointer(session->haptic, pointer, &detail);
  return status < HAP_OK ? hapi_session_fail(session, status, "%s", detail.text) : status;
}

hap_status hap_pointer_set_target(hap_session *session, hap_pointer_id pointer,
                                  const hap_pose *pose, const hap_twist *twist)
{
  if (session == NULL || pose == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  if (session->player != NULL) {
    return refuse_in_replay(session);
  }
  if (!good_pose(pose)) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "the target's position is not finite or beyond 1000 km, or its "
                             "quaternion is not unit; the pointer stays where it was");
  }
  if (twist != NULL && (!within_reach(twist->linear) || !within_reach(twist->angular))) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "the target's twist is not finite or beyond 1e6 m/s or rad/s; the "
                             "pointer stays where it was");
  }
  return say_why_not(session, pointer,
                     hapi_haptic_set_target(session->haptic, pointer, pose, twist));
}

hap_status hap_pointer_poses(hap_session *session, hap_pointer_id pointer, int64_t time_ns,
                             hap_pose *out_proxy, hap_pose *out_device)
{
  hap_pose poses[2];
  if (session == NULL || (out_proxy == NULL && out_device == NULL)) {
    return HAP_ERROR_ARGUMENT;
  }
  int64_t drawn_ns = hapi_physics_drawn_time(session->physics, time_ns);
  int64_t step_ns = (int64_t)(1e9 / session->def.physics_hz);
  hap_status status = hapi_haptic_pointer_poses(session->haptic, pointer, drawn_ns, step_ns, poses);
  if (status >= HAP_OK && out_proxy != NULL) {
    *out_proxy = poses[0];
  }
  if (status >= HAP_OK && out_device != NULL) {
    *out_device = poses[1];
  }
  return status;
}

hap_status hap_pointer_get(const hap_session *session, hap_pointer_id pointer,
                           hap_pointer_state *out, size_t size_of_out)
{
  hap_pointer_state state;
  if (session == NULL || out == NULL || size_of_out < sizeof state.size) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_status status = hapi_haptic_get_pointer(session->haptic, pointer, &state);
  if (status >= HAP_OK) {
    size_t size = size_of_out < sizeof state ? size_of_out : sizeof state;
    state.size = (uint32_t)size;
    memcpy(out, &state, size);
  }
  return say_why_not(session, pointer, status);
}
