/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/pointer_set.h>

#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "session/session_internal.h"

/* What an application sets of a pointer that runs. */

#define SETTINGS_BITS                                                                            \
  (HAP_SET_BASE | HAP_SET_MOTION_SCALE | HAP_SET_FORCE_SCALE | HAP_SET_STIFFNESS |               \
   HAP_SET_DAMPING | HAP_SET_FRICTION | HAP_SET_LIMITS | HAP_SET_UNCLUTCHED | HAP_SET_TELEPORT | \
   HAPI_SET_SWAP)
#define SETTINGS_FIELDS (SETTINGS_BITS & ~(HAP_SET_UNCLUTCHED | HAP_SET_TELEPORT))
#define BASE_TIME_MOST (INT64_MAX / 4) /* ns */

hap_status hapi_session_check_setting(const hapi_pointer_setting *setting, hap_detail *detail)
{
  hapi_pointer_setup def = setting->def;
  const hap_twist *twist = &setting->twist_world_device;
  if ((setting->mask & HAP_SET_SHAPE) == 0) { /* as it was; of a hull the radius may be 0 */
    def.hull_xyz = NULL;
    def.hull_points = 0;
    def.radius = fmax(def.radius, 1e-6);
  }
  const char *wrong =
      (setting->mask & ~(uint32_t)(SETTINGS_BITS | HAPI_SET_CLUTCH)) != 0
          ? "mask has bits that there are not"
      : (setting->mask & HAP_SET_TELEPORT) != 0 &&
              (setting->mask & (HAP_SET_BASE | HAP_SET_UNCLUTCHED)) == 0
          ? "HAP_SET_TELEPORT says how the pointer gets to a new place; set HAP_SET_BASE or "
            "HAP_SET_UNCLUTCHED with it"
      : !(hapi_plausible(twist->linear, 3) && hapi_plausible(twist->angular, 3))
          ? "twist_world_device is not finite or beyond 1e6 m/s or rad/s"
      : setting->base_time_ns < 0 || setting->base_time_ns > BASE_TIME_MOST
          ? "base_time_ns is no time of hap_session_now"
          : NULL;
  return wrong == NULL ? hapi_session_check_pointer(&def, detail)
                       : hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s", wrong);
}

typedef struct settings_given {
  const hap_session *session;
  const hap_pointer_settings *settings;
  hapi_limits *more; /* what the pointer can do to a world by them, beyond what it could */
} settings_given;

static hap_status settings_merge(const void *of, hapi_pointer_setting *io, hapi_tool_hull *io_hull,
                                 hap_detail *detail)
{
  const settings_given *from = of;
  const hap_pointer_settings *s = from->settings;
  const hapi_pointer_setup given = {
      .pose_world_device = s->pose_world_device,
      .motion_scale = s->motion_scale,
      .force_scale = s->force_scale,
      .stiffness = s->stiffness,
      .damping = s->damping,
      .friction = s->friction,
      .finger_radius = s->finger_radius,
      .max_force = s->max_force,
      .max_torque = s->max_torque,
      .radius = s->radius,
      .hull_points = s->hull_points,
      .collide_bits = s->collide_bits,
      .coupling = s->coupling,
      .coupling_stiffness = s->coupling_stiffness,
      .coupling_damping = s->coupling_damping,
  };
  const hapi_limits before = hapi_session_limits_of(&io->def);
  io->mask = s->mask;
  hapi_settings_copy(s->mask, &given, &io->def);
  if ((s->mask & HAP_SET_BASE) != 0) {
    io->twist_world_device = s->twist_world_device;
    io->base_time_ns = s->base_time_ns;
  }
  io->def.hull_xyz = (s->mask & HAP_SET_SHAPE) != 0 ? s->hull_xyz : NULL;
  HAPI_TRY(hapi_session_check_setting(io, detail));
  HAPI_TRY(hapi_session_check_coupling(from->session, &io->def, detail));
  if ((s->mask & HAP_SET_SHAPE) != 0) {
    memset(io_hull, 0, sizeof *io_hull);
    io_hull->count = (uint32_t)s->hull_points;
    if (s->hull_points > 0) {
      memcpy(io_hull->points, s->hull_xyz, 3 * s->hull_points * sizeof(double));
    }
  }
  *from->more = hapi_session_limits_of(&io->def);
  from->more->force -= before.force;
  io->def.hull_xyz = NULL;
  hapi_quat_normalize(io->def.pose_world_device.quat_wxyz);
  return HAP_OK;
}

static hap_status setting_give(hap_session *session, hap_pointer_id pointer,
                               hapi_setting_merge merge, const void *of)
{
  hap_detail detail = {""};
  hap_status status = hapi_haptic_set_pointer(session->haptic, pointer, merge, of, &detail);
  return status == HAP_ERROR_NOT_FOUND ? hapi_session_say_why_not(session, pointer, status)
                                       : hapi_session_note(session, status, &detail);
}

hap_status hap_pointer_set(hap_session *session, hap_pointer_id pointer,
                           const hap_pointer_settings *settings)
{
  hap_pointer_settings known;
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_change(session));
  hap_status status = hapi_def_read(&hapi_pointer_settings_type, settings, &known, &detail);
  if (status < HAP_OK) {
    return hapi_session_note(session, status, &detail);
  }
  hapi_limits more = {0.0, 0.0};
  const settings_given given = {session, &known, &more};
  status = setting_give(session, pointer, settings_merge, &given);
  if (status >= HAP_OK) {
    hapi_session_allow(session, &more);
  }
  return status;
}

hap_status hap_pointer_settings_get(const hap_session *session, hap_pointer_id pointer,
                                    hap_pointer_settings *out)
{
  hapi_pointer_setting setting;
  hap_detail detail = {""};
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  HAPI_TRY(hapi_session_say_why_not(session, pointer,
                                    hapi_haptic_get_settings(session->haptic, pointer, &setting)));
  const hap_pointer_settings known = {
      .mask = SETTINGS_FIELDS & ~(setting.def.hull_points > 0 ? (uint32_t)HAP_SET_SHAPE : 0),
      .pose_world_device = setting.def.pose_world_device,
      .twist_world_device = setting.twist_world_device,
      .base_time_ns = setting.base_time_ns,
      .motion_scale = setting.def.motion_scale,
      .force_scale = setting.def.force_scale,
      .stiffness = setting.def.stiffness,
      .damping = setting.def.damping,
      .friction = setting.def.friction,
      .finger_radius = setting.def.finger_radius,
      .max_force = setting.def.max_force,
      .max_torque = setting.def.max_torque,
      .radius = setting.def.radius,
      .collide_bits = setting.def.collide_bits,
      .coupling = setting.def.coupling,
      .coupling_stiffness = setting.def.coupling_stiffness,
      .coupling_damping = setting.def.coupling_damping,
  };
  return hapi_session_note(
      session, hapi_def_write(&hapi_pointer_settings_type, &known, out, &detail), &detail);
}

static hap_status clutch_merge(const void *of, hapi_pointer_setting *io, hapi_tool_hull *io_hull,
                               hap_detail *detail)
{
  (void)io_hull;
  (void)detail;
  io->mask = HAPI_SET_CLUTCH;
  io->clutched = *(const bool *)of;
  return HAP_OK;
}

hap_status hap_pointer_clutch(hap_session *session, hap_pointer_id pointer, bool holds)
{
  HAPI_TRY(hapi_session_may_change(session));
  return setting_give(session, pointer, clutch_merge, &holds);
}

/* False: an edge has no length. */
static bool boxes_scale(const double device_lo[3], const double device_hi[3], const double edges[3],
                        double *out_scale)
{
  *out_scale = 0.0;
  for (int i = 0; i < 3; ++i) {
    double edge = device_hi[i] - device_lo[i];
    if (!(edge > 0.0) || !(edges[i] > 0.0)) {
      return false;
    }
    *out_scale = fmax(*out_scale, edges[i] / edge);
  }
  return true;
}

/* Of the device, where both are NULL. */
static hap_status workspace_of(hap_session *session, hap_pointer_id pointer, const double **io_lo,
                               const double **io_hi, double room[2][3])
{
  if (*io_lo != NULL || *io_hi != NULL) {
    return HAP_OK;
  }
  hap_status status = hapi_haptic_workspace(session->haptic, pointer, room[0], room[1]);
  *io_lo = room[0];
  *io_hi = room[1];
  return status == HAP_ERROR_UNSUPPORTED
             ? hapi_session_fail(session, status,
                                 "the device does not tell its workspace: give device_lo and "
                                 "device_hi")
             : hapi_session_say_why_not(session, pointer, status);
}

hap_status hap_pointer_fit_workspace(hap_session *session, hap_pointer_id pointer,
                                     const double device_lo[3], const double device_hi[3],
                                     const hap_pose *pose_world_box, const double edges[3])
{
  double middle[3];
  double room[2][3];
  hap_pointer_settings settings;
  hap_pointer_settings_init(&settings, sizeof settings);
  HAPI_TRY(hapi_session_may_change(session));
  HAPI_TRY(workspace_of(session, pointer, &device_lo, &device_hi, room));
  if (device_lo == NULL || device_hi == NULL || pose_world_box == NULL || edges == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  if (!boxes_scale(device_lo, device_hi, edges, &settings.motion_scale)) {
    return hapi_session_fail(session, HAP_ERROR_ARGUMENT,
                             "an edge of a workspace is not above 0: give the low corner of the "
                             "device's box first, and lengths of the world's");
  }
  settings.mask = HAP_SET_BASE | HAP_SET_MOTION_SCALE | HAP_SET_UNCLUTCHED;
  settings.pose_world_device = *pose_world_box;
  hapi_v3_add(device_lo, device_hi, middle);
  hapi_v3_scale(-0.5 * settings.motion_scale, middle, middle);
  hapi_quat_rotate(pose_world_box->quat_wxyz, middle, middle);
  hapi_v3_add(pose_world_box->position, middle, settings.pose_world_device.position);
  return hap_pointer_set(session, pointer, &settings);
}
