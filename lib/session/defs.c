/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/accuracy.h>
#include <hapode/expert.h>
#include <hapode/pointer.h>
#include <hapode/pointer_set.h>
#include <hapode/research.h>

#include "base/log.h"
#include "base/thread.h"
#include "session/session_internal.h"

/* The def structs: defaults and checks. */

static const hap_session_def session_defaults = {
    .cookie = 0x48534531u,
    .drive = HAP_DRIVE_THREADS,
    .model = HAP_MODEL_CONTACT,
    .physics_hz = 60.0,
    .haptic_hz = 1000.0,
    .max_bodies = 256,
    .max_contacts = 3072,
    .max_pointers = 4,
    .rt_priority = 80,
    .accuracy = HAP_ACCURACY_DEFAULT,
    .max_steps_per_update = 3,
};

static const hap_expert_def expert_defaults = {
    .cookie = 0x48455831u,
    .contact_hz = HAP_BY_ACCURACY,
    .max_sweeps = HAP_BY_ACCURACY,
    .range_hops = HAP_BY_ACCURACY,
    .iterations = HAP_BY_ACCURACY,
    .reuse = HAP_BY_ACCURACY,
    .max_hull_points = 4096,
    .substeps = 1,
};

static const hap_research_def research_defaults = {
    .cookie = 0x48525331u,
    .probe = HAP_PROBE_BY_ACCURACY,
    .physics_latency_ticks = HAP_LATENCY_DEFAULT,
};

static const hap_pointer_def pointer_defaults = {
    .cookie = HAPI_POINTER_COOKIE,
    .radius = 0.01,
    .stiffness = 1000.0,
    .pose_world_device = {.quat_wxyz = {1.0}},
    .motion_scale = 1.0,
    .force_scale = 1.0,
    .max_force = 20.0,
    .max_torque = 1.0,
    .collide_bits = 0xffffffffu,
};

static const hap_pointer_expert_def pointer_expert_defaults = {
    .cookie = 0x48505831u,
    .coupling = HAP_COUPLING_AUTO,
};

static const hap_pointer_research_def pointer_research_defaults = {
    .cookie = 0x48505331u,
    .virtual_mass = 0.1,
};

/* As pointer_defaults. */
static const hap_pointer_settings pointer_settings_defaults = {
    .cookie = 0x48505332u,
    .pose_world_device = {.quat_wxyz = {1.0}},
    .motion_scale = 1.0,
    .force_scale = 1.0,
    .stiffness = 1000.0,
    .max_force = 20.0,
    .max_torque = 1.0,
    .radius = 0.01,
    .collide_bits = 0xffffffffu,
    .coupling = HAP_COUPLING_AUTO,
};

const hapi_def_type hapi_session_def_type = HAPI_DEF_TYPE(hap_session_def, session_defaults);
const hapi_def_type hapi_expert_def_type = HAPI_DEF_TYPE(hap_expert_def, expert_defaults);
const hapi_def_type hapi_research_def_type = HAPI_DEF_TYPE(hap_research_def, research_defaults);
const hapi_def_type hapi_pointer_def_type = HAPI_DEF_TYPE(hap_pointer_def, pointer_defaults);
const hapi_def_type hapi_pointer_expert_def_type =
    HAPI_DEF_TYPE(hap_pointer_expert_def, pointer_expert_defaults);
const hapi_def_type hapi_pointer_research_def_type =
    HAPI_DEF_TYPE(hap_pointer_research_def, pointer_research_defaults);
const hapi_def_type hapi_pointer_settings_type =
    HAPI_DEF_TYPE(hap_pointer_settings, pointer_settings_defaults);

void hap_session_def_init(hap_session_def *def, size_t size_of_def)
{
  hapi_def_init(&hapi_session_def_type, def, size_of_def);
}

void hap_expert_def_init(hap_expert_def *def, size_t size_of_def)
{
  hapi_def_init(&hapi_expert_def_type, def, size_of_def);
}

void hap_research_def_init(hap_research_def *def, size_t size_of_def)
{
  hapi_def_init(&hapi_research_def_type, def, size_of_def);
}

void hap_pointer_def_init(hap_pointer_def *def, size_t size_of_def)
{
  hapi_def_init(&hapi_pointer_def_type, def, size_of_def);
}

void hap_pointer_expert_def_init(hap_pointer_expert_def *def, size_t size_of_def)
{
  hapi_def_init(&hapi_pointer_expert_def_type, def, size_of_def);
}

void hap_pointer_research_def_init(hap_pointer_research_def *def, size_t size_of_def)
{
  hapi_def_init(&hapi_pointer_research_def_type, def, size_of_def);
}

void hap_pointer_settings_init(hap_pointer_settings *settings, size_t size_of_settings)
{
  hapi_def_init(&hapi_pointer_settings_type, settings, size_of_settings);
}

static hap_status def_check(const hap_session_def *def, hap_detail *detail)
{
  const hap_expert_def *expert = def->expert;
  const hap_research_def *research = def->research;
  const hapi_number_rule rules[] = {
      HAPI_RULE(def, drive, 0, 2),
      HAPI_RULE(def, model, 0, 3),
      HAPI_RULE(def, haptic_hz, 100.0, 20000.0),
      HAPI_RULE(def, physics_hz, 1.0, 1000.0),
      HAPI_RULE(def, max_bodies, 1, 1024),
      HAPI_RULE(def, max_contacts, 1, 8192),
      HAPI_RULE(def, max_pointers, 1, HAP_TRACE_POINTERS_MAX),
      HAPI_RULE(def, rt_priority, 0, HAPI_THREAD_PRIORITY_MOST - 1),
      HAPI_RULE(def, max_steps_per_update, 1, 64),
      HAPI_RULE(expert, trace_rows, 0, 1048576),
      HAPI_RULE(expert, max_hull_points, 0, 1048576),
      HAPI_RULE(expert, lookback, 0.0, 0.5),
      HAPI_RULE(expert, substeps, 1, 64),
      HAPI_RULE(expert, look_ahead, 0.0, HAP_LOOK_AHEAD_MOST),
      HAPI_RULE_OR(expert, contact_hz, HAP_BY_ACCURACY, 20.0, 1000.0),
      HAPI_RULE_OR(expert, max_sweeps, HAP_BY_ACCURACY, 0, 10000),
      HAPI_RULE_OR(expert, range_hops, HAP_BY_ACCURACY, HAP_RANGE_ALL, 1024),
      HAPI_RULE_OR(expert, iterations, HAP_BY_ACCURACY, 0, 10000),
      HAPI_RULE_OR(expert, reuse, HAP_BY_ACCURACY, 0.0, 0.01),
      HAPI_RULE(research, physics_latency_ticks, -1, 20000),
      HAPI_RULE(research, impulse_pose, 0, 1),
      HAPI_RULE(research, probe, 0, 3),
      HAPI_RULE(research, guard, 0, 1),
  };
  HAPI_TRY(hapi_numbers_check(rules, sizeof rules / sizeof rules[0], detail));
  if (def->physics_hz > def->haptic_hz) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "physics_hz is %g, above haptic_hz %g: there must be at least one tick to a "
                     "step",
                     def->physics_hz, def->haptic_hz);
  }
  double most = floor(def->haptic_hz / def->physics_hz + 1e-9);
  if (research->physics_latency_ticks > most) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "physics_latency_ticks is %d, above the %g ticks of a physics step",
                     research->physics_latency_ticks, most);
  }
  if (expert->max_sweeps == 1) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "max_sweeps is 1: a solve is 2 sweeps at least");
  }
  HAPI_TRY(hapi_session_check_dial(def, detail));
  return hapi_session_check_effects(def, detail);
}

hap_status hapi_session_read_def(const hap_session_def *given, hap_session *out, hap_detail *detail)
{
  hap_session_def *def = &out->def;
  HAPI_TRY(hapi_def_read_optional(&hapi_session_def_type, given, def, detail));
  HAPI_TRY(hapi_def_read_optional(&hapi_expert_def_type, def->expert, &out->expert, detail));
  HAPI_TRY(hapi_def_read_optional(&hapi_research_def_type, def->research, &out->research, detail));
  def->expert = &out->expert;
  def->research = &out->research;
  return def_check(def, detail);
}
