/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/forces.h>

#include "base/log.h"
#include "base/safety.h"
#include "base/vec.h"
#include "session/session_internal.h"

/* Own forces: what the application says, checked, for lib/haptic. */

#define VIBRATION_HZ_MOST 0.45 /* of haptic_hz: beyond it the samples show another wave */
#define CALL_SHARE_MOST 0.5    /* of a haptic period */

static const hap_force_def force_defaults = {
    .cookie = 0x48464631u,
    .axis = {0.0, 0.0, 1.0},
    .gravity = {0.0, 0.0, -9.81},
    .range = 0.02,
    .pitch = 0.005,
    .vibration = {.hz = 100.0, .hold_s = HAP_FORCE_FOR_EVER, .sample_hz = 1000.0},
    .fade_in_s = 0.02,
    .max_power = HAP_FORCE_POWER_AUTO,
};

static const hapi_def_type force_type = HAPI_DEF_TYPE(hap_force_def, force_defaults);

void hap_force_def_init(hap_force_def *def, size_t size_of_def)
{
  hapi_def_init(&force_type, def, size_of_def);
}

const char *hap_force_kind_name(hap_force_kind kind)
{
  switch (kind) {
    case HAP_FORCE_CONSTANT:
      return "constant";
    case HAP_FORCE_SPRING:
      return "spring";
    case HAP_FORCE_VISCOUS:
      return "viscous";
    case HAP_FORCE_WEIGHT:
      return "weight";
    case HAP_FORCE_MAGNET:
      return "magnet";
    case HAP_FORCE_DETENTS:
      return "detents";
    case HAP_FORCE_VIBRATION:
      return "vibration";
    case HAP_FORCE_CALL:
      return "call";
  }
  return NULL;
}

static hap_status vectors_check(const hap_force_def *d, hap_detail *detail)
{
  const struct {
    const char *name;
    const double *v;
    double most;
  } vectors[] = {
      {"origin", d->origin, 1e6}, {"axis", d->axis, 1e6},     {"point", d->point, 100.0},
      {"force", d->force, 1e6},   {"torque", d->torque, 1e6}, {"gravity", d->gravity, 1e3},
  };
  for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; ++i) {
    double norm = hapi_v3_norm(vectors[i].v);
    if (!(norm <= vectors[i].most)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is not finite, or longer than %g",
                       vectors[i].name, vectors[i].most);
    }
  }
  return hapi_v3_norm(d->axis) < 1e-6
             ? hapi_fail(detail, HAP_ERROR_ARGUMENT, "axis has no length: it is a direction")
             : HAP_OK;
}

static hap_status samples_check(const hap_force_wave *v, hap_detail *detail)
{
  if ((v->samples == NULL) != (v->sample_count == 0) || v->sample_count == 1 ||
      v->sample_count > HAP_FORCE_SAMPLES_MAX) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "vibration: sample_count is %u, not within [2, %d] with samples, or not 0 "
                     "without",
                     v->sample_count, HAP_FORCE_SAMPLES_MAX);
  }
  for (uint32_t i = 0; i < v->sample_count; ++i) {
    if (!(fabsf(v->samples[i]) <= 1.0f)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "vibration: sample %u is not within [-1, 1]", i);
    }
  }
  return HAP_OK;
}

static hap_status force_check(const hap_force_def *d, double haptic_hz, hap_detail *detail)
{
  const hap_force_wave *vibration = &d->vibration;
  const hapi_number_rule rules[] = {
      HAPI_RULE(d, kind, HAP_FORCE_CONSTANT, HAP_FORCE_CALL),
      HAPI_RULE(d, frame, HAP_FORCE_WORLD, HAP_FORCE_BODY),
      HAPI_RULE(d, target, HAP_FORCE_POINT, HAP_FORCE_PLANE),
      HAPI_RULE(d, stiffness, 0.0, 1e9),
      HAPI_RULE(d, damping, 0.0, 1e6),
      HAPI_RULE(d, mass, 0.0, 1e3),
      HAPI_RULE(d, strength, 0.0, 1e6),
      HAPI_RULE(d, range, 1e-4, 100.0),
      HAPI_RULE(d, pitch, 1e-5, 100.0),
      HAPI_RULE(d, fade_in_s, 0.0, 60.0),
      HAPI_RULE(d, max_force, 0.0, 1e6),
      HAPI_RULE(d, max_torque, 0.0, 1e6),
      HAPI_RULE_OR(d, max_power, HAP_FORCE_POWER_AUTO, 0.0, 1e6),
      HAPI_RULE(vibration, hz, 0.0, VIBRATION_HZ_MOST * haptic_hz),
      HAPI_RULE(vibration, attack_s, 0.0, 3600.0),
      HAPI_RULE_OR(vibration, hold_s, HAP_FORCE_FOR_EVER, 0.0, 3600.0),
      HAPI_RULE(vibration, decay_s, 0.0, 3600.0),
      HAPI_RULE(vibration, sample_hz, 1e-3, 1e6),
      HAPI_RULE(d, call_most_s, 0.0, CALL_SHARE_MOST / haptic_hz),
  };
  bool turns = d->kind == HAP_FORCE_CONSTANT || d->kind == HAP_FORCE_VIBRATION;
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  HAPI_TRY(vectors_check(d, detail));
  if (d->frame == HAP_FORCE_POINTER && !turns) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "frame is HAP_FORCE_POINTER: a force of kind %s is in the world",
                     hap_force_kind_name((hap_force_kind)d->kind));
  }
  bool bindable = d->kind == HAP_FORCE_SPRING || d->kind == HAP_FORCE_VISCOUS ||
                  d->kind == HAP_FORCE_MAGNET || d->kind == HAP_FORCE_DETENTS;
  if (d->frame == HAP_FORCE_BODY && !bindable) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "frame is HAP_FORCE_BODY: a force of kind %s is bound to no body",
                     hap_force_kind_name((hap_force_kind)d->kind));
  }
  if ((d->frame == HAP_FORCE_BODY) != (d->body != NULL)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     d->body == NULL ? "body is NULL: HAP_FORCE_BODY needs one"
                                     : "body is set: that needs the frame HAP_FORCE_BODY");
  }
  if ((d->kind == HAP_FORCE_CALL) != (d->call != NULL)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     d->call == NULL ? "call is NULL: a force of kind call needs a function"
                                     : "call is set: only a force of kind call has a function");
  }
  if (d->kind == HAP_FORCE_CALL && !(d->max_force > 0.0)) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "max_force is 0: say how large the force of the call gets");
  }
  return samples_check(vibration, detail);
}

static void setup_fill(const hap_force_def *d, hapi_force_setup *out)
{
  memset(out, 0, sizeof *out);
  out->kind = d->kind;
  out->frame = d->frame;
  out->target = d->target;
  out->wave.restart = d->vibration.restart;
  hapi_v3_copy(d->origin, out->origin);
  hapi_v3_scale(1.0 / hapi_v3_norm(d->axis), d->axis, out->axis);
  hapi_v3_copy(d->point, out->point);
  out->fade_in_s = d->fade_in_s;
  out->max_force = d->max_force;
  out->max_torque = d->max_torque;
  out->max_power = d->max_power;
  out->range = d->range;
  out->pitch = d->pitch;
  switch ((hap_force_kind)d->kind) {
    case HAP_FORCE_CONSTANT:
      hapi_v3_copy(d->force, out->force);
      hapi_v3_copy(d->torque, out->torque);
      break;
    case HAP_FORCE_SPRING:
      out->stiffness = d->stiffness;
      out->damping = d->damping;
      break;
    case HAP_FORCE_VISCOUS:
      out->damping = d->damping;
      break;
    case HAP_FORCE_WEIGHT:
      hapi_v3_scale(d->mass, d->gravity, out->force);
      break;
    case HAP_FORCE_MAGNET:
    case HAP_FORCE_DETENTS:
      out->strength = d->strength;
      break;
    case HAP_FORCE_VIBRATION:
      out->strength = d->strength;
      out->wave.hz = d->vibration.hz;
      out->wave.attack_s = d->vibration.attack_s;
      out->wave.hold_s = d->vibration.hold_s;
      out->wave.decay_s = d->vibration.decay_s;
      out->wave.sample_hz = d->vibration.sample_hz;
      out->wave.sample_count = d->vibration.sample_count;
      break;
    case HAP_FORCE_CALL:
      out->stiffness = d->stiffness;
      break;
  }
}

static hap_status force_put(hap_session *session, hap_pointer_id pointer, hap_force_id *io,
                            const hap_force_def *def)
{
  hap_detail detail = {""};
  hap_force_def d;
  hapi_force_setup setup;
  hap_status status = hapi_def_read(&force_type, def, &d, &detail);
  status = status >= HAP_OK ? force_check(&d, session->def.haptic_hz, &detail) : status;
  if (status >= HAP_OK) {
    double share =
        d.call_most_s > 0.0 ? d.call_most_s * session->def.haptic_hz : HAPI_SAFETY_CALL_SHARE;
    const hapi_own_extra extra = {
        .samples = d.vibration.samples,
        .call = {d.call, d.user, (int64_t)(1e9 * share / session->def.haptic_hz)}};
    setup_fill(&d, &setup);
    status =
        d.body != NULL ? hapi_session_find_body(session, d.body, &setup.body, &detail) : status;
    status = status >= HAP_OK
                 ? hapi_haptic_put_force(session->haptic, pointer, io, &setup, &extra, &detail)
                 : status;
  }
  return hapi_session_note(session, status, &detail);
}

hap_status hap_pointer_force_add(hap_session *session, hap_pointer_id pointer,
                                 const hap_force_def *def, hap_force_id *out)
{
  HAPI_TRY(hapi_session_may_change(session));
  if (out == NULL) {
    return hapi_session_say(session, HAP_ERROR_ARGUMENT, __func__);
  }
  out->v = 0;
  return force_put(session, pointer, out, def);
}

hap_status hap_pointer_force_set(hap_session *session, hap_pointer_id pointer, hap_force_id force,
                                 const hap_force_def *def)
{
  HAPI_TRY(hapi_session_may_change(session));
  if (force.v == 0) {
    return hapi_session_fail(session, HAP_ERROR_NOT_FOUND, "0 is the id of no force");
  }
  return force_put(session, pointer, &force, def);
}

hap_status hap_pointer_force_remove(hap_session *session, hap_pointer_id pointer,
                                    hap_force_id force)
{
  hap_detail detail = {""};
  HAPI_TRY(hapi_session_may_change(session));
  hap_status status = hapi_haptic_remove_force(session->haptic, pointer, force, &detail);
  return hapi_session_note(session, status, &detail);
}

hap_status hap_pointer_force_get(hap_session *session, hap_pointer_id pointer, hap_force_id force,
                                 hap_force_state *out, size_t size_of_out)
{
  hap_force_state state;
  if (session == NULL) {
    return HAP_ERROR_ARGUMENT;
  }
  hap_status status = hapi_haptic_get_force(session->haptic, pointer, force, &state);
  if (status >= HAP_OK) {
    hap_status given = hapi_struct_give(&state, sizeof state, out, size_of_out);
    status = given < HAP_OK ? given : status;
  }
  return hapi_session_say(session, status, __func__);
}
