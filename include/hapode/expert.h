/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_EXPERT_H
#define HAPODE_EXPERT_H

/* Settings for those who know what they cost. Everybody else leaves hap_session_def.expert and
 * hap_pointer_def.expert NULL. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/accuracy.h>
#include <hapode/attributes.h>
#include <hapode/effects.h>
#include <hapode/pointer.h>
#include <hapode/session.h>

HAP_BEGIN_DECLS

/* A single setting follows the dial (hapode/accuracy.h). */
#define HAP_BY_ACCURACY (-2)

/* For hap_expert_def.range_hops: as far as max_bodies allows. */
#define HAP_RANGE_ALL (-1)

#define HAP_LOOK_AHEAD_MOST 1.0 /* s */

/* Settings of a session. It has a size and may grow at its end. The values in brackets are those of
 * HAP_BY_ACCURACY at HAP_ACCURACY_DEFAULT. */
typedef struct hap_expert_def {
  uint32_t size;   /* set by hap_expert_def_init */
  uint32_t cookie; /* set by hap_expert_def_init */

  /* Single settings of the dial. Default HAP_BY_ACCURACY; any other value stays. */
  /* Hz, 20..1000 [200]: how often model CONTACT finds the contacts between bodies anew */
  double contact_hz;
  /* model CONTACT, 2..10000 [0]: sweeps over the rows of contacts and joints in each solve of a
   * tick. Direct solves come between them, from the second sweep on: 2 means none. Fewer are
   * cheaper; hap_stats.contact.residual_max says what stays undone. 0: until it is solved or the
   * tick's budget is used */
  int32_t max_sweeps;
  /* model CONTACT, 0..1024 [HAP_RANGE_ALL]: how far the range goes from the neighbours, counted
   * in contacts. 0: the neighbours alone; 1: also the bodies that may touch them. Jointed bodies
   * count as one. Bodies beyond answer with their mass, and are held by as much of the last push as
   * the world took up */
  int32_t range_hops;
  /* of QuickStep in all steps of physics, 1..10000 [the world's]. 0: the world's. At another
   * accuracy in proportion */
  int32_t iterations;
  /* m, 0..0.01 [1e-7]: a testing simulation of an island is used again while the island stays
   * like that: the same contacts and joints, and no body moved by more than this since, nor will
   * in a step by its change of velocity and force. A costs no step then, b costs one, and none
   * where all stayed within a hundredth of this. 0: never used again, as with effect TESTING on
   * and with HAP_PROBE_PAPER */
  double reuse;

  /* Time and accuracy. */
  double tick_share;    /* 0.01..1: the tick's own budget. 0 (default): hap_session_def.budget */
  double physics_share; /* 0.01..1: likewise of physics */
  /* 0..0.5, default 0: share of the period of physics for looking back. Short spans of the past
   * are simulated again as model SINGLE would have, for hap_stats.error. In LOCKSTEP all of the
   * time is, whatever the share. 0: never */
  double lookback;
  /* 0.001..1, of the force: the dial goes to the least accuracy at which looking back finds no
   * more than this. Needs lookback above 0. 0 (default): the dial stays at accuracy */
  double force_error_wanted;

  /* Room. */
  /* 0..1048576, default 4096: of all convex geoms near the pointers, and 3 for each triangle of
   * a mesh there */
  int32_t max_hull_points;
  int32_t trace_rows; /* 0..1048576, default 0: rows kept for hap_session_trace_read */

  /* Effects that are not left to the library (hapode/effects.h): bits of HAP_EFFECT_BIT, default 0.
   * HAP_ERROR_ARGUMENT: an unknown bit, or one in both. HAP_ERROR_UNSUPPORTED: the model cannot
   * fulfil the wish. hap_session_set_effect changes a wish later. */
  uint32_t effects_on;
  uint32_t effects_off; /* effects that are off, likewise */

  /* model CONTACT, 1..64, default 1: parts of a step of the world, each with its own collision. The
   * bodies that the loop does not move come out as from a world stepped at physics_hz x substeps.
   * Forces of the application act in all parts; error reduction, softness and damping keep their
   * meaning for the whole step. before_step and after_step come once a step, the surface callback
   * and ODE's moved callbacks in each part. A joint's feedback is that of the last part. */
  int32_t substeps;

  /* s, 0..HAP_LOOK_AHEAD_MOST, default 0: how much longer than two steps of the world a message
   * may be on its way from physics to the loop and back. All that is looked for near the hands and
   * their bodies is looked for so much farther ahead, and the force fades so much later where the
   * world does not answer. The reach grows by 15 m/s^2 times the square of it, so bodies and
   * contacts need more room: hap_stats.ahead says what found none. For a world over a network: the
   * round trip and its jitter (docs/remote.md) */
  double look_ahead;
} hap_expert_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_expert_def_init(hap_expert_def *def, size_t size_of_def);

/* Where the velocity of a pointer's device comes from. Values are never renumbered. */
typedef enum hap_velocity {
  HAP_VELOCITY_AUTO = 0,   /* estimated when the device rounds its positions (quantum > 0) and
                                measures no velocity */
  HAP_VELOCITY_DEVICE = 1, /* as the device says; without a device that of hap_pointer_set_target */
  HAP_VELOCITY_ESTIMATED = 2 /* from the poses, over a window that adapts to quantum and speed */
} hap_velocity;

/* Settings of a pointer. It has a size and may grow at its end. */
typedef struct hap_pointer_expert_def {
  uint32_t size;         /* set by hap_pointer_expert_def_init */
  uint32_t cookie;       /* set by hap_pointer_expert_def_init */
  hap_coupling coupling; /* default HAP_COUPLING_AUTO */
  hap_velocity velocity; /* default HAP_VELOCITY_AUTO */
  /* N/m at the device, 0..1e9: of the coupling's spring, and what the device is taken to hold. 0
   * (default): from the device's figures */
  double coupling_stiffness;
  double coupling_damping; /* N s/m at the device, 0..1e6, default 0; needs coupling_stiffness */
  double proxy_mass;       /* kg, 0..1e6, default 0: of the proxy of PROXY and AUTO */
  /* N s/m, 0..1e3, default 0: the least that the hand always adds to the device's own damping. A
   * finger held loosely: about 1 */
  double hand_damping;
  /* N/s at the device, 0..1e12: fastest change of the force, also on the way to zero after a
   * fault, which takes 100 ms at most. The torque's is in the same proportion to its limit. 0
   * (default): the whole force in 2 ms */
  double max_slew;
} hap_pointer_expert_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_pointer_expert_def_init(hap_pointer_expert_def *def, size_t size_of_def);

HAP_END_DECLS

#endif
