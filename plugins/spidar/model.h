/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_MODEL_H
#define HAPODE_PLUGINS_SPIDAR_MODEL_H

/* What a string device is made of. Frame of the device: x right, y up, z towards the user, origin
 * where the grip's origin rests at home with its axes along those of the frame. Motors, strings and
 * all arrays by string have the same order. docs/spidar.md, "Models", says where the figures are
 * from. */

#include <stdbool.h>
#include <stddef.h>

#include <hapode/status.h>

#define HAPI_SPIDAR_STRINGS_MAX 8
#define HAPI_SPIDAR_STRINGS_MIN 4

typedef enum hapi_spidar_board {
  HAPI_SPIDAR_UART, /* boards on a serial line */
  HAPI_SPIDAR_USB   /* a board that the serial line does not reach: geometry only */
} hapi_spidar_board;

typedef struct hapi_spidar_model {
  char name[32]; /* letters, digits, '_', '-', '.' */
  int strings;   /* 4..8 */
  int dof;       /* 3: the grip does not turn; 6 */
  hapi_spidar_board board;

  double motor[HAPI_SPIDAR_STRINGS_MAX][3]; /* m, where the string leaves its motor */
  double grip[HAPI_SPIDAR_STRINGS_MAX][3];  /* m, where it is fixed, in the axes of the grip */

  double volts_per_newton[HAPI_SPIDAR_STRINGS_MAX]; /* signed: motor voltage = tension * this */
  double metres_per_count[HAPI_SPIDAR_STRINGS_MAX]; /* signed: length = count * this + offset */

  /* m, of a calibration, for counts as they were in its session; 0 and false in a plain model. */
  double offset[HAPI_SPIDAR_STRINGS_MAX];
  bool calibrated;

  double min_tension;  /* N, > 0: below it a string may leave its pulley */
  double max_tension;  /* N */
  double tension_rate; /* N/s, the fastest change of a tension */

  /* Of the sum that the tensions minimise: square of the missing force has weight 1. */
  double torque_weight; /* 1/m^2, of the square of the missing torque */
  double spread_weight; /* of the sum of squared tensions */

  double centre[3];      /* m, middle of the workspace */
  double workspace[3];   /* m, half lengths of the box about it in which the device is used */
  double workspace_turn; /* rad, largest turn from the attitude at home; 0 for 3 dof */
  double residual;       /* m, beyond which the lengths do not fit a pose: slack or broken string */

  /* Thermal model of a motor and its string, docs/decisions/spidar-strings.md, "Heat". */
  double heat_tension; /* N, that the motor bears for ever, > min_tension */
  double heat_time;    /* s, its thermal time constant */

  /* Of the mechanism, motors and all, as felt at the grip; 0: not known. No maker publishes
   * them. */
  double mass;     /* kg */
  double damping;  /* N s/m */
  double friction; /* N, Coulomb */
} hapi_spidar_model;

/* [any] A built-in model by its name, in any case of letters: x4r, x4l, x5r, x5l, t1, x3r, x3r4.
 * NULL: there is none of that name. */
const hapi_spidar_model *hapi_spidar_model_find(const char *name);

/* [any] Built-in models by number, from 0; NULL behind the last one. */
const hapi_spidar_model *hapi_spidar_model_at(size_t index);

/* [any] What a file that says nothing about it has: all below the tensions in hapi_spidar_model,
 * made from strings, dof, points and tensions, which must be there. */
void hapi_spidar_model_default(hapi_spidar_model *model);

/* [control] HAP_ERROR_FORMAT with a sentence in detail (may be NULL): a figure is out of its range
 * or not finite, two strings are the same, or the strings do not tell the pose everywhere in the
 * workspace. All that uses a model relies on this. */
HAP_NODISCARD hap_status hapi_spidar_model_check(const hapi_spidar_model *model,
                                                 hap_detail *detail);

/* [control] Reads a geometry file (docs/spidar.md, "Geometry file") and checks it. HAP_ERROR_IO, or
 * HAP_ERROR_FORMAT with file and line in detail (may be NULL); *out is then unchanged. */
HAP_NODISCARD hap_status hapi_spidar_model_read(const char *path, hapi_spidar_model *out,
                                                hap_detail *detail);

/* [control] Checks the model and writes it in the form that is read, with nine digits; a file that
 * was there is replaced when the new one is whole, else stays. HAP_ERROR_IO, HAP_ERROR_FORMAT. */
HAP_NODISCARD hap_status hapi_spidar_model_write(const char *path, const hapi_spidar_model *model,
                                                 hap_detail *detail);

#endif
