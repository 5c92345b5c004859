/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include <hapode/grab.h>

#include "base/log.h"
#include "base/plausible.h"
#include "base/vec.h"
#include "session/session_internal.h"

/* Grabs: what the application says, checked, for lib/haptic. */

static const hap_grab_def grab_defaults = {
    .cookie = 0x48474231u,
    .pose_body_pointer = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0}},
};

static const hapi_def_type grab_type = HAPI_DEF_TYPE(hap_grab_def, grab_defaults);

void hap_grab_def_init(hap_grab_def *def, size_t size_of_def)
{
  hapi_def_init(&grab_type, def, size_of_def);
}

static hap_status grab_check(const hap_grab_def *d, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(d, place, HAP_GRAB_HERE, HAP_GRAB_AT_POSE),
      HAPI_RULE(d, turns, HAP_GRAB_TURNS, HAP_GRAB_BALL),
      HAPI_RULE(d, stiffness, 0.0, 1e9),
      HAPI_RULE(d, damping, 0.0, 1e6),
      HAPI_RULE(d, turn_stiffness, 0.0, 1e6),
      HAPI_RULE(d, turn_damping, 0.0, 1e6),
      HAPI_RULE(d, max_force, 0.0, 1e6),
      HAPI_RULE(d, max_torque, 0.0, 1e6),
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  if (!hapi_plausible_pose(&d->pose_body_pointer)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "pose_body_pointer is not finite, beyond 1000 km, or its quaternion is not "
                     "unit");
  }
  return HAP_OK;
}

static void setup_fill(const hap_grab_def *d, uint64_t birth, hapi_grab_setup *out)
{
  memset(out, 0, sizeof *out);
  out->birth = birth;
  out->at_pose = d->place == HAP_GRAB_AT_POSE;
  out->turns = (uint8_t)d->turns;
  hapi_v3_copy(d->pose_body_pointer.position, out->place);
  memcpy(out->turn, d->pose_body_pointer.quat_wxyz, sizeof out->turn);
  hapi_quat_normalize(out->turn);
  out->stiffness = d->stiffness;
  out->damping = d->damping;
  out->turn_stiffness = d->turn_stiffness;
  out->turn_damping = d->turn_damping;
  out->max_force = d->max_force;
  out->max_torque = d->max_torque;
}

static hap_status model_check(const hap_session *session)
{
  hap_model model = hapi_physics_wanted_model(session->physics);
  if (model == HAP_MODEL_CONTACT || model == HAP_MODEL_SINGLE) {
    return HAP_OK;
  }
  return hapi_session_fail(
      session, HAP_ERROR_UNSUPPORTED,
      "model %s has no bodies that a pointer could hold; use contact or single",
      hap_model_name(model));
}

hap_status hap_pointer_attach(hap_session *session, hap_pointer_id pointer, void *body,
                              const hap_grab_def *def)
{
  hap_detail detail = {""};
  hap_grab_def d = grab_defaults;
  hapi_grab_setup setup;
  uint64_t birth = 0;
  HAPI_TRY(hapi_session_may_change(session));
  if (body == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  hap_status status = def != NULL ? hapi_def_read(&grab_type, def, &d, &detail) : HAP_OK;
  status = status >= HAP_OK ? grab_check(&d, &detail) : status;
  if (status < HAP_OK) {
    return hapi_session_note(session, status, &detail);
  }
  if (!session->started) {
    return hapi_session_fail(session, HAP_ERROR_STATE,
                             "the session does not run: hap_session_start comes first");
  }
  HAPI_TRY(model_check(session));
  status = hapi_session_find_body(session, body, &birth, &detail);
  if (status < HAP_OK) {
    return hapi_session_note(session, status, &detail);
  }
  setup_fill(&d, birth, &setup);
  status = hapi_haptic_grab(session->haptic, pointer, &setup, &detail);
  return status == HAP_ERROR_NOT_FOUND ? hapi_session_say_why_not(session, pointer, status)
                                       : hapi_session_note(session, status, &detail);
}

hap_status hap_pointer_release(hap_session *session, hap_pointer_id pointer)
{
  const hapi_grab_setup none = {.birth = 0};
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_change(session));
  hap_status status = hapi_haptic_grab(session->haptic, pointer, &none, &detail);
  return status == HAP_ERROR_NOT_FOUND ? hapi_session_say_why_not(session, pointer, status)
                                       : status;
}
