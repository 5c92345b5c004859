/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_SPIDAR_GRIP_H
#define HAPODE_TOOLS_SPIDAR_GRIP_H

/* The mechanics of a SPIDAR: a grip, strings that pull and never push, and the motors that wind
 * them. SI units, frame of the model. */

#include "plugins/spidar/kinematics.h"

typedef struct grip_def {
  const hapi_spidar_model *model; /* borrowed */
  double mass;                    /* kg, of the grip and of the hand that holds it */
  double inertia;                 /* kg m^2, of both, the same about every axis */
  double string_stiffness;        /* N/m */
  double string_damping;          /* N s/m */
  double rotor_mass;              /* kg, of motor and pulley, as felt along the string */
  double rotor_damping;           /* N s/m */
} grip_def;

/* Round numbers: a grip of 60 g, thin strings of polyethylene, small motors that are driven by a
 * voltage and so are brakes without one. */
void grip_def_init(grip_def *def, const hapi_spidar_model *model);

typedef struct grip {
  grip_def def;
  hap_pose pose;
  hap_twist twist;
  double wound[HAPI_SPIDAR_STRINGS_MAX]; /* m, of string that is out */
  double wound_rate[HAPI_SPIDAR_STRINGS_MAX];
  double tension[HAPI_SPIDAR_STRINGS_MAX]; /* N, of the strings */
  hap_wrench wrench;                       /* of all strings on the grip */
} grip;

/* At home, at rest, strings just straight. */
void grip_init(grip *g, const grip_def *def);

/* pull: N, of each motor; below zero it lets go. other: what else acts on the grip. */
void grip_step(grip *g, const double pull[HAPI_SPIDAR_STRINGS_MAX], const hap_wrench *other,
               double length);

#endif
