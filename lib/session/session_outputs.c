/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/outputs.h>

#include "base/log.h"
#include "pointer/axes.h"
#include "session/session_internal.h"

#define NO_PUSH                       \
  {                                   \
    .max_power = HAP_FORCE_POWER_AUTO \
  }

static const hap_pointer_outputs outputs_defaults = {
    .cookie = 0x484f5531u,
    .axes = {NO_PUSH, NO_PUSH, NO_PUSH, NO_PUSH, NO_PUSH, NO_PUSH, NO_PUSH, NO_PUSH},
    .gripper_closed = HAPI_GRIPPER_CLOSED,
    .gripper_open = HAPI_GRIPPER_OPEN,
};

static const hapi_def_type outputs_type = HAPI_DEF_TYPE(hap_pointer_outputs, outputs_defaults);

void hap_pointer_outputs_init(hap_pointer_outputs *outputs, size_t size_of_outputs)
{
  hapi_def_init(&outputs_type, outputs, size_of_outputs);
}

hap_status hap_pointer_set_outputs(hap_session *session, hap_pointer_id pointer,
                                   const hap_pointer_outputs *outputs)
{
  hap_detail detail = {""};
  hap_pointer_outputs known;
  HAPI_TRY(hapi_session_may_change(session));
  hap_status status = hapi_def_read(&outputs_type, outputs, &known, &detail);
  if (status >= HAP_OK) {
    status = hapi_haptic_set_outputs(session->haptic, pointer, &known, &detail);
  }
  return hapi_session_note(session, status, &detail);
}

hap_status hap_pointer_get_outputs(hap_session *session, hap_pointer_id pointer,
                                   hap_pointer_outputs *out)
{
  hap_detail detail = {""};
  hap_pointer_outputs known;
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_pointer_outputs_init(&known, sizeof known);
  HAPI_TRY(hapi_session_say_why_not(session, pointer,
                                    hapi_haptic_get_outputs(session->haptic, pointer, &known)));
  return hapi_session_note(session, hapi_def_write(&outputs_type, &known, out, &detail), &detail);
}
