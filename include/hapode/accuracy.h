/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ACCURACY_H
#define HAPODE_ACCURACY_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* One setting for what accuracy costs (docs/accuracy.md, "The dial"). It stands between 0, the least that
 * can still be felt, and 1, all that the library has; HAP_ACCURACY_DEFAULT is what the single settings of
 * hap_session_def are by default. Each setting that is HAP_BY_ACCURACY there follows it, any other one
 * stays as it was given. What the tick does and what the physics thread does have a dial each: both go where
 * hap_session_def.accuracy says, and a time budget turns back the one that takes too long. The tick's has something
 * to turn in model CONTACT alone. */
#define HAP_ACCURACY_DEFAULT 0.5

/* Why a dial stands where it does. UNTOLD: nothing was touched so far, or looking back comes to no end
 * (hap_stats.error.spoilt). Values are fixed. */
typedef enum hap_accuracy_reason {
  HAP_ACCURACY_ASKED = 0,  /* at hap_session_def.accuracy */
  HAP_ACCURACY_ERROR = 1,  /* as force_error_wanted calls for */
  HAP_ACCURACY_BUDGET = 2, /* as much as fits into the share of time */
  HAP_ACCURACY_LEAST = 3,  /* at 0, and it does not fit: the share is too small for the scene */
  HAP_ACCURACY_UNTOLD = 4  /* as ASKED: an error is wanted, and none has been told yet */
} hap_accuracy_reason;

/* A side of the session: the haptic thread's ticks, or the physics thread's cycles. load is what the budget
 * goes by, and may be above what was used in the mean: of ticks the larger one of their mean and of share
 * times the part of them that was over it / 5 %, of cycles the larger one of their mean and 2/3 of
 * the longest. */
typedef struct hap_accuracy_side {
  double accuracy; /* 0..1, in force */
  double share;    /* of a tick or a period of physics, that the budget allows; 0: no budget */
  double load;     /* when it was last looked at; above share: too much. 0: not yet, or no budget */
  uint64_t turns;  /* times that the budget turned it, either way, since start */
  uint32_t reason; /* hap_accuracy_reason */
  uint32_t reserved;
} hap_accuracy_side;

/* The dials, and the settings that come of them. */
typedef struct hap_accuracy_info {
  uint32_t size;             /* bytes filled in */
  uint32_t probe;            /* hap_probe: SHARED, PAPER or OPERATING */
  double accuracy;           /* 0..1, asked for, or as force_error_wanted calls for */
  double force_error_wanted; /* of hap_session_def; 0: none */
  hap_accuracy_side tick;
  hap_accuracy_side physics;
  double contact_hz;    /* Hz */
  int32_t max_sweeps;   /* of a solve; 0: until it is solved, or row_updates are made */
  int32_t range_hops;   /* HAP_RANGE_ALL: as far as max_bodies goes */
  int32_t edge_probes;  /* a physics step */
  int32_t iterations;   /* of QuickStep, in the newest physics step */
  uint32_t shapes;      /* 1: shapes at every tick; 0: planes, where the effect shape is auto */
  uint32_t row_updates; /* the most a solve of a tick may make */
  double reuse;         /* m */
} hap_accuracy_info;

/* [any] Turns the dial, 0..1, from the next sync on. HAP_ERROR_ARGUMENT: not such a number;
 * HAP_ERROR_STATE: the session plays a recording. Nothing is changed then, and hap_session_detail says
 * why. */
HAP_API HAP_NODISCARD hap_status hap_session_set_accuracy(hap_session *session, double accuracy);

/* [any] As hap_session_def.force_error_wanted, from the next sync on; 0: none, and the dial goes back to
 * what accuracy says. HAP_ERROR_UNSUPPORTED: the session does not look back (hap_session_def.lookback). Else as
 * hap_session_set_accuracy. */
HAP_API HAP_NODISCARD hap_status hap_session_set_force_error(hap_session *session, double wanted);

/* [any] As hap_session_def.tick_share and .physics_share, from the next sync on; 0: no budget.
 * HAP_ERROR_UNSUPPORTED in drive LOCKSTEP, but for none. Else as hap_session_set_accuracy. */
HAP_API HAP_NODISCARD hap_status hap_session_set_budget(hap_session *session, double tick_share,
                                                        double physics_share);

/* [any] As of the last sync; before the first start all but size is 0. size_of_out: sizeof *out of the
 * caller's build. */
HAP_API hap_status hap_session_accuracy(const hap_session *session, hap_accuracy_info *out,
                                        size_t size_of_out);

/* [any] The reason in a few words; "" for an unknown value, never NULL. */
HAP_API const char *hap_accuracy_reason_text(hap_accuracy_reason reason);

HAP_END_DECLS

#endif
