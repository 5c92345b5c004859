/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "haptic/coupling_gains.h"
#include "session/session_internal.h"

hap_status hapi_session_check_pointer(const hapi_pointer_setup *d, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(d, radius, d->hull_points > 0 ? 0.0 : 1e-6, 100.0),
      HAPI_RULE(d, proxy_mass, 0.0, 1e6),
      HAPI_RULE(d, stiffness, 0.0, 1e9),
      HAPI_RULE(d, damping, 0.0, 1e6),
      HAPI_RULE(d, friction, 0.0, 10.0),
      HAPI_RULE(d, finger_radius, 0.0, 100.0),
      HAPI_RULE(d, motion_scale, 1e-6, 1e6),
      HAPI_RULE(d, force_scale, 0.0, 1e6),
      HAPI_RULE(d, max_force, 1e-6, 1e6),
      HAPI_RULE(d, max_torque, 1e-6, 1e6),
      HAPI_RULE(d, velocity, HAP_VELOCITY_AUTO, HAP_VELOCITY_ESTIMATED),
      HAPI_RULE(d, coupling_stiffness, 0.0, 1e9),
      HAPI_RULE(d, coupling_damping, 0.0, 1e6),
      HAPI_RULE(d, coupling, HAP_COUPLING_DIRECT, HAP_COUPLING_VIRTUAL),
      HAPI_RULE(d, integration, HAP_INTEGRATION_AUTO, HAP_INTEGRATION_MIDPOINT),
      HAPI_RULE(d, hand_damping, 0.0, 1e3),
      HAPI_RULE(d, max_slew, 0.0, 1e12),
      HAPI_RULE(d, virtual_mass, 1e-6, 1e6),
      HAPI_RULE(d, virtual_inertia, 0.0, 1e12),
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  const char *wrong = d->device == NULL && d->velocity == HAP_VELOCITY_ESTIMATED
                          ? "velocity is HAP_VELOCITY_ESTIMATED, which needs a device"
                      : d->coupling_damping > 0.0 && d->coupling_stiffness == 0.0
                          ? "coupling_damping is given without coupling_stiffness"
                      : !hapi_plausible_pose(&d->pose_world_device)
                          ? "pose_world_device is not within 1000 km with a unit quaternion"
                          : NULL;
  return wrong == NULL ? hapi_session_check_hull(d, detail)
                       : hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s", wrong);
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
  setup.effector = d->effector;
  return setup;
}

hap_status hapi_session_read_pointer(const hap_pointer_def *given, hapi_pointer_setup *out,
                                     hap_detail *detail)
{
  hap_pointer_def d;
  hap_pointer_expert_def e;
  hap_pointer_research_def r;
  HAPI_TRY(hapi_def_read(&hapi_pointer_def_type, given, &d, detail));
  HAPI_TRY(hapi_def_read_optional(&hapi_pointer_expert_def_type, d.expert, &e, detail));
  HAPI_TRY(hapi_def_read_optional(&hapi_pointer_research_def_type, d.research, &r, detail));
  *out = setup_of(&d, &e, &r);
  return hapi_session_check_pointer(out, detail);
}

hap_status hapi_session_check_coupling(const hap_session *session, const hapi_pointer_setup *setup,
                                       hap_detail *detail)
{
  return !hapi_coupling_has_spring(setup->coupling) || session->def.model == HAP_MODEL_CONTACT
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                         "coupling %s needs model contact; the session has model %s",
                         hap_coupling_name(setup->coupling), hap_model_name(session->def.model));
}

/* ---- what a hand can do ---- */

#define REACH_M 0.1 /* a hand presses a pointer no farther into what does not give way */

/* A body gets what the pointer's spring gives, also where the device gives less to the hand. */
hapi_limits hapi_session_limits_of(const hapi_pointer_setup *setup)
{
  double felt = setup->force_scale > 0.0 ? setup->max_force / setup->force_scale : 0.0;
  return (hapi_limits){.force = hapi_max(felt, REACH_M * setup->stiffness),
                       .speed = HAPI_SAFETY_SPEED_LIMIT * setup->motion_scale};
}

void hapi_session_allow(hap_session *session, const hapi_limits *more)
{
  hapi_far *far = session->ferry.far;
  pthread_mutex_lock(&session->detail_lock); /* it is for one short text, and short enough */
  hapi_limits *sum = &session->ferry.limits;
  sum->force = hapi_max(sum->force + more->force, 0.0);
  sum->speed = hapi_max(sum->speed, more->speed);
  const hapi_limits now = *sum;
  pthread_mutex_unlock(&session->detail_lock);
  if (far != NULL) {
    pthread_mutex_lock(&far->lock);
    far->loop.limits = now;
    pthread_mutex_unlock(&far->lock);
  }
}

static hap_status hand_add(hap_session *session, const hapi_pointer_setup *setup,
                           hap_pointer_id *out, hap_detail *detail)
{
  hapi_far *far = session->ferry.far;
  if (far != NULL) {
    pthread_mutex_lock(&far->lock);
  }
  hap_status status = hapi_haptic_add_pointer(session->haptic, setup, out, detail);
  if (far != NULL) {
    pthread_mutex_unlock(&far->lock);
  }
  if (status >= HAP_OK) {
    const hapi_limits limits = hapi_session_limits_of(setup);
    hapi_session_allow(session, &limits);
  }
  return status;
}

hap_status hap_pointer_add(hap_session *session, const hap_pointer_def *def, hap_pointer_id *out)
{
  HAPI_TRY(hapi_session_may_change(session));
  if (out == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_detail detail = {""};
  hapi_pointer_setup setup = {0};
  out->v = 0;
  if (session->ferry.side == HAPI_SIDE_WORLD) {
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "the session serves its world, and has no loop: hands are those of "
                             "the session that joins (hap_session_connect)");
  }
  hap_status status = hapi_session_read_pointer(def, &setup, &detail);
  if (status >= HAP_OK) {
    status = hapi_session_check_coupling(session, &setup, &detail);
  }
  if (status >= HAP_OK) {
    hapi_quat_normalize(setup.pose_world_device.quat_wxyz);
    status = hand_add(session, &setup, out, &detail);
  }
  return hapi_session_note(session, status, &detail);
}

hap_status hapi_session_say_why_not(const hap_session *session, hap_pointer_id pointer,
                                    hap_status status)
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
  hapi_pointer_setting setting;
  HAPI_TRY(hapi_session_may_change(session));
  bool known = hapi_haptic_get_settings(session->haptic, pointer, &setting) >= HAP_OK;
  hap_status status = hapi_haptic_remove_pointer(session->haptic, pointer);
  if (status >= HAP_OK && known) {
    const hapi_limits less = {.force = -hapi_session_limits_of(&setting.def).force};
    hapi_session_allow(session, &less);
  }
  return hapi_session_say_why_not(session, pointer, status);
}

hap_status hap_pointer_restart(hap_session *session, hap_pointer_id pointer)
{
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_change(session));
  hap_status status = hapi_haptic_restart_pointer(session->haptic, pointer, &detail);
  return hapi_session_note(session, status, &detail);
}

hap_status hap_pointer_set_target(hap_session *session, hap_pointer_id pointer,
                                  const hap_pose *pose, const hap_twist *twist)
{
  HAPI_TRY(hapi_session_may_change(session));
  if (pose == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  if (!hapi_plausible_pose(pose)) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "the target's position is not finite or beyond 1000 km, or its "
                             "quaternion is not unit; the pointer stays where it was");
  }
  if (twist != NULL && !(hapi_plausible(twist->linear, 3) && hapi_plausible(twist->angular, 3))) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "the target's twist is not finite or beyond 1e6 m/s or rad/s; the "
                             "pointer stays where it was");
  }
  return hapi_session_say_why_not(session, pointer,
                                  hapi_haptic_set_target(session->haptic, pointer, pose, twist));
}

hap_status hap_pointer_poses(hap_session *session, hap_pointer_id pointer, int64_t time_ns,
                             hap_pose *out_proxy, hap_pose *out_device)
{
  hap_pose poses[2];
  if (session == NULL || (out_proxy == NULL && out_device == NULL)) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  int64_t step_ns = 0;
  int64_t drawn_ns = hapi_physics_drawn_time(session->physics, time_ns, &step_ns);
  hap_status status = hapi_haptic_pointer_poses(session->haptic, pointer, drawn_ns, step_ns, poses);
  if (status >= HAP_OK && out_proxy != NULL) {
    *out_proxy = poses[0];
  }
  if (status >= HAP_OK && out_device != NULL) {
    *out_device = poses[1];
  }
  return hapi_session_say_why_not(session, pointer, status);
}

hap_status hap_pointer_get(const hap_session *session, hap_pointer_id pointer,
                           hap_pointer_state *out, size_t size_of_out)
{
  hap_pointer_state state;
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  HAPI_TRY(hapi_session_say_why_not(session, pointer,
                                    hapi_haptic_get_pointer(session->haptic, pointer, &state)));
  return hapi_session_say(session, hapi_struct_give(&state, sizeof state, out, size_of_out),
                          __func__);
}
