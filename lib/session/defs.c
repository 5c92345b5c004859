/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include <hapode/accuracy.h>
#include <hapode/expert.h>
#include <hapode/pointer.h>
#include <hapode/research.h>

#include "base/log.h"
#include "session/session_internal.h"

/* The def structs: defaults and checks. */

void hap_session_def_init(hap_session_def *def, size_t size_of_def)
{
  hap_session_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_SESSION_COOKIE;
  d.drive = HAP_DRIVE_THREADS;
  d.model = HAP_MODEL_CONTACT;
  d.physics_hz = 60.0;
  d.haptic_hz = 1000.0;
  d.max_bodies = 64;
  d.max_contacts = 1024;
  d.max_pointers = 4;
  d.rt_priority = 80;
  d.accuracy = HAP_ACCURACY_DEFAULT;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

void hap_expert_def_init(hap_expert_def *def, size_t size_of_def)
{
  hap_expert_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_EXPERT_COOKIE;
  d.contact_hz = HAP_BY_ACCURACY;
  d.max_sweeps = HAP_BY_ACCURACY;
  d.range_hops = HAP_BY_ACCURACY;
  d.max_edge_probes = HAP_BY_ACCURACY;
  d.iterations = HAP_BY_ACCURACY;
  d.reuse = HAP_BY_ACCURACY;
  d.max_hull_points = 4096;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

void hap_research_def_init(hap_research_def *def, size_t size_of_def)
{
  hap_research_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_RESEARCH_COOKIE;
  d.probe = HAP_PROBE_BY_ACCURACY;
  d.physics_latency_ticks = HAP_LATENCY_DEFAULT;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

void hap_pointer_def_init(hap_pointer_def *def, size_t size_of_def)
{
  hap_pointer_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_POINTER_COOKIE;
  d.radius = 0.01;
  d.stiffness = 1000.0;
  d.pose_world_device.quat_wxyz[0] = 1.0;
  d.motion_scale = 1.0;
  d.force_scale = 1.0;
  d.max_force = 20.0;
  d.max_torque = 1.0;
  d.collide_bits = 0xffffffffu;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

void hap_pointer_expert_def_init(hap_pointer_expert_def *def, size_t size_of_def)
{
  hap_pointer_expert_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_POINTER_EXPERT_COOKIE;
  d.coupling = HAP_COUPLING_AUTO;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

void hap_pointer_research_def_init(hap_pointer_research_def *def, size_t size_of_def)
{
  hap_pointer_research_def d;
  memset(&d, 0, sizeof d);
  d.cookie = HAPI_POINTER_RESEARCH_COOKIE;
  d.virtual_mass = 0.1;
  hapi_def_init(def, size_of_def, &d, sizeof d);
}

static hap_status check_number(double value, double low, double high, const char *name,
                               hap_detail *detail)
{
  if (value >= low && value <= high) { /* false for NaN */
    return HAP_OK;
  }
  return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is %g, not in %g .. %g", name, value, low, high);
}

typedef struct number_rule {
  double value;
  double low;
  double high;
  const char *name;
} number_rule;

static hap_status check_numbers(const number_rule *rules, size_t count, hap_detail *detail)
{
  hap_status status = HAP_OK;
  for (size_t i = 0; i < count && status >= HAP_OK; ++i) {
    status = check_number(rules[i].value, rules[i].low, rules[i].high, rules[i].name, detail);
  }
  return status;
}

/* HAP_BY_ACCURACY, or a number within its limits. */
static hap_status check_knobs(const hap_expert_def *expert, hap_detail *detail)
{
  const number_rule rules[] = {
      {expert->contact_hz, 20.0, 1000.0, "contact_hz"},
      {expert->max_edge_probes, 0, 1024, "max_edge_probes"},
      {expert->max_sweeps, 0, 10000, "max_sweeps"},
      {expert->range_hops, HAP_RANGE_ALL, 1024, "range_hops"},
      {expert->iterations, 0, 10000, "iterations"},
      {expert->reuse, 0.0, 0.01, "reuse"},
  };
  for (size_t i = 0; i < sizeof rules / sizeof rules[0]; ++i) {
    const number_rule *r = &rules[i];
    if (r->value != HAP_BY_ACCURACY && !(r->value >= r->low && r->value <= r->high)) {
      return hapi_fail(detail, HAP_ERROR_ARGUMENT, "%s is %g, not HAP_BY_ACCURACY or in %g .. %g",
                       r->name, r->value, r->low, r->high);
    }
  }
  return HAP_OK;
}

static hap_status check_choices(const hap_session_def *def, hap_detail *detail)
{
  if (def->expert->max_sweeps == 1) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT, "max_sweeps is 1: a solve is 2 sweeps at least");
  }
  hap_status status = check_knobs(def->expert, detail);
  if (status >= HAP_OK) {
    status = hapi_session_check_dial(def, detail);
  }
  return status >= HAP_OK ? hapi_session_check_effects(def, detail) : status;
}

static hap_status check_def(const hap_session_def *def, hap_detail *detail)
{
  const hap_expert_def *expert = def->expert;
  const hap_research_def *research = def->research;
  const number_rule rules[] = {
      {def->drive, 0, 2, "drive"},
      {def->model, 0, 3, "model"},
      {def->haptic_hz, 100.0, 20000.0, "haptic_hz"},
      {def->physics_hz, 1.0, 1000.0, "physics_hz"},
      {def->max_bodies, 1, 1024, "max_bodies"},
      {def->max_contacts, 1, 4096, "max_contacts"},
      {def->max_pointers, 1, HAP_TRACE_POINTERS_MAX, "max_pointers"},
      {def->rt_priority, 0, 99, "rt_priority"},
      {research->physics_latency_ticks, -1, 20000, "physics_latency_ticks"},
      {expert->trace_rows, 0, 1048576, "trace_rows"},
      {research->impulse_pose, 0, 1, "impulse_pose"},
      {research->probe, 0, 3, "probe"},
      {expert->max_hull_points, 0, 1048576, "max_hull_points"},
      {research->guard, 0, 1, "guard"},
      {expert->lookback, 0.0, 0.5, "lookback"},
  };
  hap_status status = check_numbers(rules, sizeof rules / sizeof rules[0], detail);
  if (status >= HAP_OK && def->physics_hz > def->haptic_hz) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "physics_hz is %g, above haptic_hz %g: there must be at least one tick to a "
                     "step",
                     def->physics_hz, def->haptic_hz);
  }
  double most = floor(def->haptic_hz / def->physics_hz + 1e-9);
  if (status >= HAP_OK && research->physics_latency_ticks > most) {
    return hapi_fail(detail, HAP_ERROR_ARGUMENT,
                     "physics_latency_ticks is %d, above the %g ticks of a physics step",
                     research->physics_latency_ticks, most);
  }
  return status >= HAP_OK ? check_choices(def, detail) : status;
}

hap_status hapi_session_read_def(const hap_session_def *given, hap_session *out, hap_detail *detail)
{
  hap_session_def *def = &out->def;
  hap_session_def_init(def, sizeof *def);
  hap_expert_def_init(&out->expert, sizeof out->expert);
  hap_research_def_init(&out->research, sizeof out->research);
  hap_status status = HAP_OK;
  if (given != NULL) {
    status =
        hapi_def_read(def, sizeof *def, given, HAPI_SESSION_COOKIE, "hap_session_def_init", detail);
  }
  if (status >= HAP_OK && def->expert != NULL) {
    status = hapi_def_read(&out->expert, sizeof out->expert, def->expert, HAPI_EXPERT_COOKIE,
                           "hap_expert_def_init", detail);
  }
  if (status >= HAP_OK && def->research != NULL) {
    status = hapi_def_read(&out->research, sizeof out->research, def->research,
                           HAPI_RESEARCH_COOKIE, "hap_research_def_init", detail);
  }
  def->expert = &out->expert;
  def->research = &out->research;
  return status >= HAP_OK ? check_def(def, detail) : status;
}
