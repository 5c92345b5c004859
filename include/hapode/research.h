/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RESEARCH_H
#define HAPODE_RESEARCH_H

/* Settings for experiments: comparisons with the paper and measurements with simulated hands. An
 * application leaves hap_session_def.research and hap_pointer_def.research NULL. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>

HAP_BEGIN_DECLS

/* How model ACCELERANCE tests. Values are never renumbered. */
typedef enum hap_probe {
  HAP_PROBE_SHARED = 0, /* one zero probe for all neighbours: 1 + 3N steps */
  HAP_PROBE_PAPER = 1,  /* four steps for each neighbour: 4N steps */
  /* as SHARED, about the operating point: every testing simulation has the pointers' forces, and
   * is perturbed by 1 % of the weight */
  HAP_PROBE_OPERATING = 2,
  HAP_PROBE_BY_ACCURACY = 3 /* SHARED or OPERATING, by the dial (hapode/accuracy.h) */
} hap_probe;

/* Where model IMPULSE shows a body between two physics steps. Values are never renumbered. */
typedef enum hap_impulse_pose {
  HAP_IMPULSE_INTERPOLATED = 0, /* moves from the last but one to the last pose in one step H */
  HAP_IMPULSE_HELD = 1          /* stays at the last pose */
} hap_impulse_pose;

/* Whether the guard shapes the force. Its checks, faults and limits always hold. Values are never
 * renumbered. */
typedef enum hap_guard {
  HAP_GUARD_ON = 0, /* all of it */
  /* for simulated hands: no ramp-in, no fading with an old model, no energy observer, no slew
   * limit. A fault takes the force away in one tick. Not for a device that a person holds */
  HAP_GUARD_MEASURE = 1
} hap_guard;

/* For hap_research_def.physics_latency_ticks. */
#define HAP_LATENCY_DEFAULT (-1)

/* Settings of a session. It has a size and may grow at its end. */
typedef struct hap_research_def {
  uint32_t size;   /* set by hap_research_def_init */
  uint32_t cookie; /* set by hap_research_def_init */
  /* model ACCELERANCE, default HAP_PROBE_BY_ACCURACY: SHARED at HAP_ACCURACY_DEFAULT */
  hap_probe probe;
  hap_impulse_pose impulse_pose; /* model IMPULSE, default HAP_IMPULSE_INTERPOLATED */
  /* LOCKSTEP: ticks from the start of a physics step to the tick that uses its result, at most
   * haptic_hz / physics_hz. Default HAP_LATENCY_DEFAULT: 1 in models CONTACT and ACCELERANCE,
   * one step in model IMPULSE. Model SINGLE always has 0 */
  int32_t physics_latency_ticks;
  hap_guard guard; /* default HAP_GUARD_ON */
} hap_research_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_research_def_init(hap_research_def *def, size_t size_of_def);

/* How the spring of a contact between pointer and body is integrated in model CONTACT. Values are
 * never renumbered. */
typedef enum hap_integration {
  HAP_INTEGRATION_AUTO = 0,     /* midpoint while T^2 a k <= 4, else implicit */
  HAP_INTEGRATION_EXPLICIT = 1, /* eq. 7 with the poses as they are: has a stability limit */
  HAP_INTEGRATION_IMPLICIT = 2, /* stable at any stiffness, and loses energy */
  HAP_INTEGRATION_MIDPOINT = 3  /* keeps energy; rings where T^2 a k > 4 */
} hap_integration;

/* Settings of a pointer. It has a size and may grow at its end. */
typedef struct hap_pointer_research_def {
  uint32_t size;               /* set by hap_pointer_research_def_init */
  uint32_t cookie;             /* set by hap_pointer_research_def_init */
  hap_integration integration; /* default HAP_INTEGRATION_AUTO, which is right */
  /* kg, 1e-6..1e6, default 0.1: of HAP_COUPLING_VIRTUAL. It is felt in the air, and swings on the
   * spring at sqrt(coupling_stiffness / virtual_mass) */
  double virtual_mass;
  /* kg m^2, 0..1e12: of the same tool's hull about every axis through the pointer's origin. 0
   * (default): of a ball of that mass as large as the hull (docs/decisions/proxy.md) */
  double virtual_inertia;
} hap_pointer_research_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_pointer_research_def_init(hap_pointer_research_def *def, size_t size_of_def);

HAP_END_DECLS

#endif
