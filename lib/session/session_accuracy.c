/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <string.h>

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

/* 0 is none. */
static hap_status check_wish(double value, double least, const char *name, hap_detail *detail)
{
  return value == 0.0 || (value >= least && value <= 1.0) /* false for NaN */
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is %g, not 0 or in %g .. 1", name, value,
                         least);
}

static hap_status check_accuracy(double accuracy, hap_detail *detail)
{
  return accuracy >= 0.0 && accuracy <= 1.0
             ? HAP_OK
             : hapi_fail(detail, HAP_ERROR_ARGUMENT, "accuracy is %g, not in 0 .. 1", accuracy);
}

static hap_status check_error(const hap_session_def *def, double wanted, hap_detail *detail)
{
  hap_status status = check_wish(wanted, ERROR_LEAST, "force_error_wanted", detail);
  if (status >= HAP_OK && wanted > 0.0 && def->expert->lookback == 0.0) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "force_error_wanted is %g, and nothing tells the error: set lookback, to 0.1 "
                     "say",
                     wanted);
  }
  return status;
}

static hap_status check_budget(const hap_session_def *def, double tick_share, double physics_share,
                               hap_detail *detail)
{
  hap_status status = check_wish(tick_share, SHARE_LEAST, "tick_share", detail);
  if (status >= HAP_OK) {
    status = check_wish(physics_share, SHARE_LEAST, "physics_share", detail);
  }
  bool budget = tick_share > 0.0 || physics_share > 0.0;
  if (status >= HAP_OK && budget && def->drive == HAP_DRIVE_LOCKSTEP) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "budget, tick_share or physics_share in drive LOCKSTEP, which does the same "
                     "on every run, however long it takes: set accuracy instead");
  }
  return status;
}

double hapi_session_share(const hap_session_def *def, double own)
{
  return own == 0.0 ? def->budget : own;
}

hap_status hapi_session_check_dial(const hap_session_def *def, hap_detail *detail)
{
  hap_status status = check_accuracy(def->accuracy, detail);
  if (status >= HAP_OK) {
    status = check_error(def, def->expert->force_error_wanted, detail);
  }
  if (status >= HAP_OK) {
    status = check_wish(def->budget, SHARE_LEAST, "budget", detail);
  }
  return status >= HAP_OK
             ? check_budget(def, hapi_session_share(def, def->expert->tick_share),
                            hapi_session_share(def, def->expert->physics_share), detail)
             : status;
}

static hap_status check_free(const hap_session *session, hap_detail *detail)
{
  return session->player != NULL
             ? hapi_fail(detail, HAP_ERROR_STATE,
                         "the session plays a recording, and what happened is in it")
             : HAP_OK;
}

static hap_status give(hap_session *session, hap_status status, const hap_detail *detail)
{
  return status < HAP_OK ? hapi_session_fail(session, status, "%s", detail->text) : HAP_OK;
}

hap_status hap_session_set_accuracy(hap_session *session, double accuracy)
{
  hap_detail detail = {""};
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_status status = check_accuracy(accuracy, &detail);
  if (status >= HAP_OK) {
    status = check_free(session, &detail);
  }
  if (status >= HAP_OK) {
    hapi_physics_set_accuracy(session->physics, accuracy);
  }
  return give(session, status, &detail);
}

hap_status hap_session_set_force_error(hap_session *session, double wanted)
{
  hap_detail detail = {""};
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_status status = check_error(&session->def, wanted, &detail);
  if (status >= HAP_OK) {
    status = check_free(session, &detail);
  }
  if (status >= HAP_OK) {
    hapi_physics_set_force_error(session->physics, wanted);
  }
  return give(session, status, &detail);
}

hap_status hap_session_set_budget(hap_session *session, double tick_share, double physics_share)
{
  hap_detail detail = {""};
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_status status = check_budget(&session->def, tick_share, physics_share, &detail);
  if (status >= HAP_OK) {
    status = check_free(session, &detail);
  }
  if (status >= HAP_OK) {
    hapi_physics_set_budget(session->physics, tick_share, physics_share);
  }
  return give(session, status, &detail);
}

hap_status hap_session_accuracy(const hap_session *session, hap_accuracy_info *out,
                                size_t size_of_out)
{
  hap_accuracy_info info;
  if (session == NULL || out == NULL || size_of_out < sizeof out->size) {
    return HAP_ERROR_ARGUMENT;
  }
  size_t size = size_of_out < sizeof info ? size_of_out : sizeof info;
  hapi_physics_accuracy(session->physics, &info);
  info.size = (uint32_t)size;
  memcpy(out, &info, size);
  return HAP_OK;
}
