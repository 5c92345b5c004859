/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <hapode/accuracy.h>

#include "base/log.h"
#include "session/session_internal.h"

/* The dial of a session: what can be asked of it, and where it stands. */

#define ERROR_LEAST 0.001
#define SHARE_LEAST 0.01

const char *hap_accuracy_reason_text(hap_accuracy_reason reason)
{
  static const char *const texts[] = {
      [HAP_ACCURACY_ASKED] = "asked for",
      [HAP_ACCURACY_ERROR] = "for the error that is wanted",
      [HAP_ACCURACY_BUDGET] = "as much as fits",
      [HAP_ACCURACY_UNTOLD] = "no error has been told yet",
      [HAP_ACCURACY_LEAST] = "the least there is, and it does not fit",
  };
  size_t index = (size_t)reason;
  return index < sizeof texts / sizeof texts[0] ? texts[index] : "";
}

static hap_status error_check(const hap_session_def *def, double wanted, hap_detail *detail)
{
  const hapi_number_rule rule = {"force_error_wanted", wanted, ERROR_LEAST, 1.0, "0 or ", 0.0};
  HAPI_TRY(hapi_numbers_check(&rule, 1, detail));
  if (wanted > 0.0 && def->expert->lookback == 0.0) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "force_error_wanted is %g, and nothing tells the error: set lookback, to 0.1 "
                     "say",
                     wanted);
  }
  return HAP_OK;
}

static hap_status budget_check(const hap_session_def *def, double tick_share, double physics_share,
                               hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      {"tick_share", tick_share, SHARE_LEAST, 1.0, "0 or ", 0.0},
      {"physics_share", physics_share, SHARE_LEAST, 1.0, "0 or ", 0.0},
  };
  HAPI_TRY(hapi_numbers_check(rules, 2, detail));
  if ((tick_share > 0.0 || physics_share > 0.0) && def->drive == HAP_DRIVE_LOCKSTEP) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "budget, tick_share or physics_share in drive LOCKSTEP, which does the same "
                     "on every run, however long it takes: set accuracy instead");
  }
  return HAP_OK;
}

double hapi_session_share(const hap_session_def *def, double own)
{
  return own == 0.0 ? def->budget : own;
}

hap_status hapi_session_check_dial(const hap_session_def *def, hap_detail *detail)
{
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, accuracy, 0.0, 1.0),
      HAPI_RULE_OR(def, budget, 0, SHARE_LEAST, 1.0),
  };
  HAPI_TRY(hapi_numbers_check(rules, 2, detail));
  HAPI_TRY(error_check(def, def->expert->force_error_wanted, detail));
  return budget_check(def, hapi_session_share(def, def->expert->tick_share),
                      hapi_session_share(def, def->expert->physics_share), detail);
}

hap_status hap_session_set_accuracy(hap_session *session, double accuracy)
{
  const hapi_number_rule rule = {"accuracy", accuracy, 0.0, 1.0, NULL, 0.0};
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_steer(session));
  hap_status status = hapi_numbers_check(&rule, 1, &detail);
  if (status >= HAP_OK) {
    hapi_physics_set_accuracy(session->physics, accuracy);
  }
  return hapi_session_note(session, status, &detail);
}

hap_status hap_session_set_force_error(hap_session *session, double wanted)
{
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_steer(session));
  hap_status status = error_check(&session->def, wanted, &detail);
  if (status >= HAP_OK) {
    hapi_physics_set_force_error(session->physics, wanted);
  }
  return hapi_session_note(session, status, &detail);
}

hap_status hap_session_set_budget(hap_session *session, double tick_share, double physics_share)
{
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_steer(session));
  hap_status status = budget_check(&session->def, tick_share, physics_share, &detail);
  if (status >= HAP_OK) {
    hapi_physics_set_budget(session->physics, tick_share, physics_share);
  }
  return hapi_session_note(session, status, &detail);
}

hap_status hap_session_accuracy(const hap_session *session, hap_accuracy_info *out,
                                size_t size_of_out)
{
  hap_accuracy_info info;
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hapi_physics_accuracy(session->physics, &info);
  return hapi_session_say(session, hapi_struct_give(&info, sizeof info, out, size_of_out),
                          __func__);
}
