/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_H
#define HAPODE_ACCURACY_H

/* The dial: one setting for accuracy against time (docs/accuracy.md). */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* The dial goes from 0, the least that can still be felt, to 1, all that the library has. This is
 * the default of hap_session_def.accuracy. Each setting of hap_expert_def that is HAP_BY_ACCURACY
 * follows the dial; any other value stays. Settings change at the dial's tenths.
 *
 * The tick and the physics thread have a dial each. Both go to hap_session_def.accuracy; a budget
 * turns back the one that takes too long. The tick's dial has something to turn in model CONTACT
 * alone. */
#define HAP_ACCURACY_DEFAULT 0.5

/* Why a dial is where it is. Values are never renumbered. */
typedef enum hap_accuracy_reason {
  HAP_ACCURACY_ASKED = 0,  /* at hap_session_def.accuracy */
  HAP_ACCURACY_ERROR = 1,  /* as force_error_wanted needs */
  HAP_ACCURACY_BUDGET = 2, /* as much as fits into the budget */
  HAP_ACCURACY_LEAST = 3,  /* at 0, and it does not fit: the budget is too small for the scene */
  /* as ASKED: an error is wanted, and none is known yet. Nothing was touched so far, or no
   * window was completed (hap_stats.error.spoilt) */
  HAP_ACCURACY_UNTOLD = 4
} hap_accuracy_reason;

/* One side of the session: the haptic thread's ticks, or the physics thread's cycles. Final: it
 * keeps its fields for as long as the soname lasts. */
typedef struct hap_accuracy_side {
  double accuracy; /* 0..1, in force */
  double share;    /* of its period that the budget allows; 0: no budget */
  /* share of its period that counted when it was last looked at; above share: too much. Of ticks
   * the larger one of their mean and of share times the part of ticks that were over it, divided
   * by 5 %. Of cycles the larger one of their mean and 2/3 of the longest. 0: not yet, or no
   * budget */
  double load;
  uint64_t turns;  /* times that the budget turned the dial, either way, since start */
  uint32_t reason; /* hap_accuracy_reason */
} hap_accuracy_side;

/* The dials and the settings that they give. It has a size and may grow at its end. */
typedef struct hap_accuracy_info {
  uint32_t size;             /* bytes filled in */
  uint32_t probe;            /* hap_probe: SHARED, PAPER or OPERATING */
  double accuracy;           /* 0..1, asked for, or as force_error_wanted needs */
  double force_error_wanted; /* of hap_expert_def; 0: none */
  hap_accuracy_side tick;    /* ticks of the haptic loop */
  hap_accuracy_side physics; /* cycles of physics */
  double contact_hz;         /* Hz */
  int32_t max_sweeps;        /* of a solve; 0: until it is solved, or row_updates are made */
  int32_t range_hops;        /* HAP_RANGE_ALL: as far as max_bodies allows */
  int32_t iterations;        /* of QuickStep, in the newest physics step */
  uint32_t shapes;           /* 1: shapes at every tick; 0: planes, where effect SHAPE is auto */
  uint32_t row_updates;      /* the most that a solve of a tick may make */
  double reuse;              /* m */
} hap_accuracy_info;

/* [any] Turns the dial from the next sync on, 0..1. HAP_ERROR_ARGUMENT: out of range.
 * HAP_ERROR_STATE: the session plays a recording. Then nothing changes, and hap_session_detail says
 * why. */
HAP_NODISCARD HAP_API hap_status hap_session_set_accuracy(hap_session *session, double accuracy);

/* [any] Changes the budgets from the next sync on: the share of its period that a tick and that a
 * cycle of physics may take, 0.01..1; 0: no budget. HAP_ERROR_UNSUPPORTED: a budget in drive
 * LOCKSTEP. Other errors as hap_session_set_accuracy. */
HAP_NODISCARD HAP_API hap_status hap_session_set_budget(hap_session *session, double tick_share,
                                                        double physics_share);

/* [any] As hap_expert_def.force_error_wanted, from the next sync on. 0: none, and the dial goes
 * back to accuracy. HAP_ERROR_UNSUPPORTED: hap_expert_def.lookback is 0. Other errors as
 * hap_session_set_accuracy. */
HAP_NODISCARD HAP_API hap_status hap_session_set_force_error(hap_session *session, double wanted);

/* [any] The dials as of the last sync. Before the first start all but size is 0. size_of_out:
 * sizeof *out of the caller's build. */
HAP_API hap_status hap_session_accuracy(const hap_session *session, hap_accuracy_info *out,
                                        size_t size_of_out);

/* [any] The reason in a few words; "" for an unknown value, never NULL. */
HAP_API const char *hap_accuracy_reason_text(hap_accuracy_reason reason);

HAP_END_DECLS

#endif
