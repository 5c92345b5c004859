/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_CALIBRATION_H
#define HAPODE_PLUGINS_SPIDAR_CALIBRATION_H

/* Counts to lengths, docs/decisions/spidar-strings.md, "Calibration". Counts are unwrapped. Arrays
 * by string have HAPI_SPIDAR_STRINGS_MAX elements; those of the model's strings are used. */

#include "plugins/spidar/kinematics.h"

/* Lengths [m] by the model's scales and offsets. Good on the tick. */
void hapi_spidar_measure(const hapi_spidar_model *model,
                         const double counts[HAPI_SPIDAR_STRINGS_MAX],
                         double out_lengths[HAPI_SPIDAR_STRINGS_MAX]);

/* [any] The grip is at a known pose, NULL: at home, all strings taut: sets the model's offsets so
 * that the lengths are those of the pose. */
void hapi_spidar_calibrate_at(hapi_spidar_model *model, const hap_pose *pose,
                              const double counts[HAPI_SPIDAR_STRINGS_MAX]);

/* ---- by least squares over many poses ---- */

#define HAPI_SPIDAR_SAMPLES_MAX 100000

/* What is to be found. Offsets always are. */
#define HAPI_SPIDAR_FIND_SCALES 1u /* metres_per_count of each string */
#define HAPI_SPIDAR_FIND_MOTORS 2u /* motor points */

typedef struct hapi_spidar_sample {
  double counts[HAPI_SPIDAR_STRINGS_MAX];
  bool known;    /* pose was measured by other means; else it is found as well */
  hap_pose pose; /* where known */
} hapi_spidar_sample;

typedef struct hapi_spidar_calibration {
  hapi_spidar_model model; /* what was given, with what was found */
  double residual;         /* m, root mean square of the lengths' errors that are left */
  double worst;            /* m, the largest of them */
  int unknowns;            /* that were looked for, poses not counted */
  int told;                /* how many combinations of them the samples tell */
  int free;           /* how many no sample of this kind can tell: 6 for motor points without known
                              poses, as the whole frame may be anywhere; these stay as they are */
  double condition;   /* weakest of the told against the strongest, 0..1 */
  double weakest;     /* m, standard deviation of the weakest combination that should be told */
  int weakest_string; /* that it is of most */
  /* Standard deviations, of the free combinations not counted. */
  double offset_deviation[HAPI_SPIDAR_STRINGS_MAX]; /* m, in the middle of the counts */
  double scale_deviation[HAPI_SPIDAR_STRINGS_MAX];  /* share of metres_per_count */
  double motor_deviation[HAPI_SPIDAR_STRINGS_MAX];  /* m, of the worst axis */
} hapi_spidar_calibration;

/* [control] From a checked model and samples of all over the workspace, turned all ways. Where the
 * model is not calibrated the first sample is taken as being at home, within some 5 mm, or at its
 * known pose. HAP_ERROR_ARGUMENT with a sentence in detail (may be NULL): too few samples, counts
 * not finite, samples that do not tell the unknowns, or lengths that fit no pose (a slack string).
 * *out then has all figures that were found, but no model. HAP_ERROR_MEMORY. */
HAP_NODISCARD hap_status hapi_spidar_calibrate(const hapi_spidar_model *model,
                                               const hapi_spidar_sample *samples, size_t count,
                                               unsigned find, hapi_spidar_calibration *out,
                                               hap_detail *detail);

#endif
