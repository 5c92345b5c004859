/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/effects.h>

#include "base/effect_table.h"
#include "base/log.h"
#include "base/wishes.h"
#include "session/session_internal.h"

/* The effects of a session: what a model can fulfil, wishes and states. */

static const char *const wishes[] = {"auto", "off", "on"};

static bool is_effect(hap_effect effect)
{
  return (int)effect >= 0 && (int)effect < HAP_EFFECTS;
}

static bool is_wish(hap_effect_wish wish)
{
  return (int)wish >= HAP_EFFECT_AUTO && (int)wish <= HAP_EFFECT_ON;
}

const char *hap_effect_name(hap_effect effect)
{
  return is_effect(effect) ? hapi_effect_rows[effect].name : NULL;
}

const char *hap_effect_text(hap_effect effect)
{
  return is_effect(effect) ? hapi_effect_rows[effect].text : NULL;
}

const char *hap_effect_wish_name(hap_effect_wish wish)
{
  return is_wish(wish) ? wishes[wish] : NULL;
}

const char *hap_effect_reason_text(hap_effect_reason reason)
{
  static const char *const texts[] = {
      [HAP_REASON_NOT_YET] = "no sync so far",
      [HAP_REASON_ASKED] = "asked for",
      [HAP_REASON_CALLED] = "the scene calls for it",
      [HAP_REASON_MODEL] = "the model is made of it",
      [HAP_REASON_NOT_IN_MODEL] = "not in this model",
      [HAP_REASON_FAR] = "nothing is near",
      [HAP_REASON_ASLEEP] = "what is near sleeps",
      [HAP_REASON_FREE] = "free",
      [HAP_REASON_ALONE] = "alone",
      [HAP_REASON_OWNED] = "the loop simulates it all",
      [HAP_REASON_NO_BOUNCE] = "nothing bounces",
      [HAP_REASON_NO_FRICTION] = "no friction",
      [HAP_REASON_NO_TORQUE] = "device without torque",
      [HAP_REASON_ROUND] = "a sphere without friction",
      [HAP_REASON_SYMMETRIC] = "symmetric inertia",
      [HAP_REASON_LOCKED] = "rotation locked",
      [HAP_REASON_STILL] = "does not spin",
      [HAP_REASON_NOT_IN_WORLD] = "off in the world",
      [HAP_REASON_FLAT] = "flat",
      [HAP_REASON_NO_CLOSED_FORM] = "no closed form",
      [HAP_REASON_WITHIN] = "the device can hold it",
      [HAP_REASON_DEVICE_UNKNOWN] = "device not known",
      [HAP_REASON_COUPLING] = "as the pointer's coupling says",
      [HAP_REASON_MEASURING] = "the guard only measures",
      [HAP_REASON_NOT_RECORDED] = "not recorded",
      [HAP_REASON_OUTSIDE] = "beyond what the loop can simulate",
      [HAP_REASON_NOT_PAPERS] = "not the paper's",
      [HAP_REASON_ACCURACY] = "not at this accuracy",
  };
  size_t index = (size_t)reason;
  return index < sizeof texts / sizeof texts[0] ? texts[index] : "";
}

/* ---- what can be wished for ---- */

static hap_status effect_refuse(hap_effect effect, hap_effect_wish wish, hap_model model,
                                hap_detail *detail)
{
  const hapi_effect_row *e = &hapi_effect_rows[effect];
  if (effect == HAP_EFFECT_RECORDING) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "recording=on: a recording needs a file: call hap_session_record");
  }
  if (wish == HAP_EFFECT_OFF) {
    return hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                     "%s=off is not supported: model %s is made of %s; use model contact", e->name,
                     hap_model_name(model), e->text);
  }
  return hapi_fail(
      detail, HAP_ERROR_UNSUPPORTED,
      "%s=on is not supported in model %s, which has no %s; use model %s", e->name,
      hap_model_name(model), e->text,
      hap_model_name((e->has & HAPI_MODEL_BIT(HAP_MODEL_CONTACT)) != 0 ? HAP_MODEL_CONTACT
                                                                       : HAP_MODEL_ACCELERANCE));
}

hap_status hap_effect_check(hap_effect effect, hap_effect_wish wish, hap_model model,
                            hap_detail *detail)
{
  if (!is_effect(effect) || !is_wish(wish) || (int)model < 0 || hap_model_name(model) == NULL) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "there is no effect %d, wish %d or model %d",
                     (int)effect, (int)wish, (int)model);
  }
  bool lacks = wish == HAP_EFFECT_ON && (hapi_effect_rows[effect].has & HAPI_MODEL_BIT(model)) == 0;
  bool needs =
      wish == HAP_EFFECT_OFF && (hapi_effect_rows[effect].needs & HAPI_MODEL_BIT(model)) != 0;
  return lacks || needs ? effect_refuse(effect, wish, model, detail) : HAP_OK;
}

/* hap_effect_check, and what else the session says to it. */
static hap_status wish_check(const hap_session_def *def, hap_effect effect, hap_effect_wish wish,
                             hap_model model, hap_detail *detail)
{
  HAPI_TRY(hap_effect_check(effect, wish, model, detail));
  return effect == HAP_EFFECT_OBSERVER && wish == HAP_EFFECT_ON &&
                 def->research->guard == HAP_GUARD_MEASURE
             ? hapi_fail(detail, HAP_ERROR_UNSUPPORTED,
                         "observer=on is not supported with HAP_GUARD_MEASURE, which leaves the "
                         "force as it is; use HAP_GUARD_ON")
             : HAP_OK;
}

#define KNOWN (HAP_EFFECT_BIT(HAP_EFFECTS) - 1u)

static hap_effect_wish wish_of(const hap_expert_def *expert, int effect)
{
  uint32_t bit = HAP_EFFECT_BIT(effect);
  return (expert->effects_on & bit) != 0    ? HAP_EFFECT_ON
         : (expert->effects_off & bit) != 0 ? HAP_EFFECT_OFF
                                            : HAP_EFFECT_AUTO;
}

hap_status hapi_session_check_effects(const hap_session_def *def, hap_detail *detail)
{
  const hap_expert_def *expert = def->expert;
  uint32_t unknown = (expert->effects_on | expert->effects_off) & ~KNOWN;
  if (unknown != 0) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s has unknown bits 0x%x",
                     (expert->effects_on & ~KNOWN) != 0 ? "effects_on" : "effects_off", unknown);
  }
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    if ((expert->effects_on & expert->effects_off & HAP_EFFECT_BIT(i)) != 0) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is in effects_on and in effects_off",
                       hapi_effect_rows[i].name);
    }
    HAPI_TRY(wish_check(def, (hap_effect)i, wish_of(expert, i), def->model, detail));
  }
  return HAP_OK;
}

uint32_t hapi_session_pack_effects(const hap_expert_def *expert)
{
  uint32_t packed = 0;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    packed = hapi_wish_set(packed, (hap_effect)i, wish_of(expert, i));
  }
  return packed;
}

void hapi_session_unpack_effects(uint32_t packed, hap_expert_def *io)
{
  io->effects_on = io->effects_off = 0;
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    hap_effect_wish wish = hapi_wish(packed, (hap_effect)i);
    io->effects_on |= wish == HAP_EFFECT_ON ? HAP_EFFECT_BIT(i) : 0;
    io->effects_off |= wish == HAP_EFFECT_OFF ? HAP_EFFECT_BIT(i) : 0;
  }
}

hap_status hap_session_set_effect(hap_session *session, hap_effect effect, hap_effect_wish wish)
{
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_steer(session));
  hap_status status =
      wish_check(&session->def, effect, wish, hapi_physics_wanted_model(session->physics), &detail);
  if (status >= HAP_OK && effect == HAP_EFFECT_RECORDING && wish == HAP_EFFECT_OFF &&
      session->recorder != NULL) {
    status = hapi_fail(&detail, HAP_ERROR_STATE,
                       "recording=off: the session is recorded, until it is stopped");
  }
  if (status >= HAP_OK) {
    hapi_physics_set_effect(session->physics, effect, wish);
  }
  return hapi_session_note(session, status, &detail);
}

/* ---- what they do ---- */

hap_status hap_session_effects(const hap_session *session, hap_effect_info *out, size_t count,
                               size_t size_of_one)
{
  hap_effect_info all[HAP_EFFECTS];
  if (session == NULL || out == NULL || count > HAP_EFFECTS || size_of_one < sizeof out->size) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  size_t size = size_of_one < sizeof all[0] ? size_of_one : sizeof all[0];
  memset(all, 0, sizeof all);
  for (int i = 0; i < HAP_EFFECTS; ++i) {
    all[i].size = (uint32_t)size;
    all[i].effect = (uint32_t)i;
    all[i].tick_us = all[i].physics_ms = all[i].contact_us = (double)NAN;
  }
  hapi_physics_effects(session->physics, all);
  hapi_haptic_effects(session->haptic, all);
  hapi_contact_effects(session->contact, all);
  hap_effect_info *recording = &all[HAP_EFFECT_RECORDING];
  bool recorded = session->recorder != NULL;
  recording->state = recorded ? HAP_EFFECT_IS_ON : HAP_EFFECT_IS_OFF;
  recording->reason =
      recorded || recording->wish == HAP_EFFECT_OFF ? HAP_REASON_ASKED : HAP_REASON_NOT_RECORDED;
  recording->on = recording->of = 0;
  for (size_t i = 0; i < count; ++i) {
    memcpy((char *)out + i * size_of_one, &all[i], size);
  }
  return HAP_OK;
}
