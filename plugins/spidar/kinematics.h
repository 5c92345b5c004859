/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_KINEMATICS_H
#define HAPODE_PLUGINS_SPIDAR_KINEMATICS_H

/* Lengths of strings to a pose of the grip and back, docs/decisions/spidar-strings.md,
 * "Kinematics". Pure: no heap, no lock, no system call, bounded time. Poses and twists are of the
 * grip in the frame of the device. A model has passed hapi_spidar_model_check. Arrays by string
 * have HAPI_SPIDAR_STRINGS_MAX elements; those of the model's strings are used. */

#include <stdint.h>

#include <hapode/spatial.h>

#include "plugins/spidar/model.h"

/* The strings at a pose. */
typedef struct hapi_spidar_rows {
  double length[HAPI_SPIDAR_STRINGS_MAX];    /* m */
  double unit[HAPI_SPIDAR_STRINGS_MAX][3];   /* from the grip to the motor */
  double moment[HAPI_SPIDAR_STRINGS_MAX][3]; /* m, arm of the string x unit; 0 for 3 dof */
} hapi_spidar_rows;

/* A tension t of string i puts force t unit[i] and torque t moment[i] about the grip's origin on
 * the grip; a twist shortens the string by unit[i] . linear + moment[i] . angular a second. */
void hapi_spidar_rows_at(const hapi_spidar_model *model, const hap_pose *pose,
                         hapi_spidar_rows *out);

/* Lengths [m] alone. */
void hapi_spidar_lengths(const hapi_spidar_model *model, const hap_pose *pose,
                         double out_lengths[HAPI_SPIDAR_STRINGS_MAX]);

/* At the origin, not turned. */
void hapi_spidar_home(hap_pose *out);

/* ---- lengths to pose ---- */

typedef enum hapi_spidar_fit {
  HAPI_SPIDAR_FIT_GOOD,   /* converged, and the lengths fit the pose */
  HAPI_SPIDAR_FIT_MOVING, /* not yet converged: the next call goes on */
  HAPI_SPIDAR_FIT_POOR,   /* converged, and a length is off by more than model.residual */
  HAPI_SPIDAR_FIT_INVALID /* a length is not finite; nothing changed */
} hapi_spidar_fit;

typedef struct hapi_spidar_solver {
  hap_pose pose;   /* the newest */
  double residual; /* m, the largest |length at pose - measured length| */
  bool outside;    /* the pose is outside of the model's workspace */
  int iterations;  /* of the last call */
  double damping;  /* grows while steps fail */
  double half_cos; /* of half the largest turn that a pose may have, and its sine */
  double half_sin;
  double work_cos; /* of half the workspace's turn */
  double low[3];   /* m, where a grip can be */
  double high[3];
} hapi_spidar_solver;

/* [control] Begins at start, NULL: at home. Not on the tick: it computes a sine. */
void hapi_spidar_solver_init(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                             const hap_pose *start);

/* Goes from solver->pose to the pose whose lengths [m] are nearest to the measured ones, by
 * least squares. At most 6 steps of at most 10 mm and 0.3 rad; never worse than before. The pose
 * stays finite, within the box of the motors or twice the workspace, and turned by at most
 * workspace_turn + 40 degrees. */
hapi_spidar_fit hapi_spidar_solve(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                                  const double lengths[HAPI_SPIDAR_STRINGS_MAX]);

/* The same with some of the strings alone, as bits. */
hapi_spidar_fit hapi_spidar_solve_with(hapi_spidar_solver *solver, const hapi_spidar_model *model,
                                       const double lengths[HAPI_SPIDAR_STRINGS_MAX],
                                       uint32_t strings);

/* Twist that fits the rates of the lengths [m/s] at the pose best; zero where a rate is not
 * finite. */
void hapi_spidar_twist(const hapi_spidar_model *model, const hap_pose *pose,
                       const double rates[HAPI_SPIDAR_STRINGS_MAX], hap_twist *out);

/* ---- what is wrong when the fit is poor ---- */

typedef struct hapi_spidar_diagnosis {
  /* bit i: without string i all others fit a pose. None: more than one string is wrong, or offsets
   * or geometry are. All: there is no string to spare that could tell */
  uint32_t suspects;
  /* m, of a suspect, measured minus fitting: above 0 it is slack, below 0 it was wound in: broken,
   * or off the grip */
  double error[HAPI_SPIDAR_STRINGS_MAX];
} hapi_spidar_diagnosis;

/* Leaves out each string in turn, from the last pose that fitted. Bounded, but some 40 us: once
 * a fault. */
void hapi_spidar_diagnose(const hapi_spidar_model *model, const hap_pose *good,
                          const double lengths[HAPI_SPIDAR_STRINGS_MAX],
                          hapi_spidar_diagnosis *out);

#endif
