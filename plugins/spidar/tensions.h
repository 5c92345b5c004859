/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_TENSIONS_H
#define HAPODE_PLUGINS_SPIDAR_TENSIONS_H

/* Wrench on the grip to tensions of the strings, and the heat of the motors,
 * docs/decisions/spidar-strings.md, "Tensions" and "Heat". Pure: no heap, no lock, no system call,
 * bounded time. Arrays by string have HAPI_SPIDAR_STRINGS_MAX elements; those of the model's
 * strings are used. A model has passed hapi_spidar_model_check. */

#include "plugins/spidar/box_qp.h"
#include "plugins/spidar/kinematics.h"

typedef struct hapi_spidar_tensions {
  double tension[HAPI_SPIDAR_STRINGS_MAX]; /* N, the newest; 0 at first */
  /* N, the most that each string may have now, by the caller; model.max_tension at first. Below
   * min_tension it counts as that. */
  double most[HAPI_SPIDAR_STRINGS_MAX];
  /* s, from one solve to the next, by the caller: a tension changes by at most tension_rate
   * times this. 0, as at first: by any amount. */
  double seconds;
  hapi_spidar_at at[HAPI_SPIDAR_STRINGS_MAX];
  int changes; /* of the active set in the last solve; -1: the last solve was not exact */
} hapi_spidar_tensions;

/* No tension, as motors without current have. */
void hapi_spidar_tensions_init(hapi_spidar_tensions *state, const hapi_spidar_model *model);

/* The tensions whose wrench on the grip at pose is nearest to wanted, within min_tension .. most
 * and the rate; from 0 they rise with the rate to min_tension. Torque of a model of 3 dof is not
 * looked at. reached is what the tensions give, 0 torque for 3 dof; it may be NULL.
 * HAP_SATURATED: a string is as taut as it may be now. HAP_ERROR_ARGUMENT: wanted or pose is not
 * finite or beyond 1e6; then the tensions are those of no wrench at the pose, or when that is
 * not finite, unchanged. */
HAP_NODISCARD hap_status hapi_spidar_tensions_solve(hapi_spidar_tensions *state,
                                                    const hapi_spidar_model *model,
                                                    const hap_pose *pose, const hap_wrench *wanted,
                                                    double out_tension[HAPI_SPIDAR_STRINGS_MAX],
                                                    hap_wrench *reached);

/* What tensions [N] give at a pose: also for tensions that a board rounded. */
void hapi_spidar_wrench(const hapi_spidar_model *model, const hap_pose *pose,
                        const double tension[HAPI_SPIDAR_STRINGS_MAX], hap_wrench *out);

/* [control] What the device gives in every direction for long, in the middle of its workspace:
 * the largest force [N] and torque [N m] of which 9 parts of 10 are reached with tensions up to
 * heat_tension. 0 torque for 3 dof. */
void hapi_spidar_capability(const hapi_spidar_model *model, double *out_force, double *out_torque);

/* ---- heat ---- */

typedef struct hapi_spidar_heat {
  /* Of what the motor bears: 0 as cold as the room, 1 as hot as heat_tension makes it. */
  double share[HAPI_SPIDAR_STRINGS_MAX];
} hapi_spidar_heat;

/* All motors alike. 0 for a device that was off for some heat_time, more where nobody knows;
 * what is not within 0..1 is taken as 1. */
void hapi_spidar_heat_init(hapi_spidar_heat *heat, double share);

/* The tensions [N] were held for seconds. out_most: what each motor may do now; it falls
 * smoothly from max_tension, at share 0.8, to heat_tension at share 1, and no share goes beyond
 * 1 for tensions that keep it. A tension that is not finite or far beyond max_tension counts as
 * that, seconds that are not finite or below 0 as none. */
void hapi_spidar_heat_step(hapi_spidar_heat *heat, const hapi_spidar_model *model,
                           const double tension[HAPI_SPIDAR_STRINGS_MAX], double seconds,
                           double out_most[HAPI_SPIDAR_STRINGS_MAX]);

#endif
