/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BENCH_IMPEDANCE_H
#define HAPODE_BENCH_IMPEDANCE_H

/* hapode-bench impedance: the dynamic stiffness Z(w) = F/X that a hand feels at the port, F on the
 * world, X into it, against closed forms; and how stiff a wall each device can hold. */

#include "bench/port.h"

/* After ODE, whose masses have a member I. */
#include <complex.h>

#define IMPEDANCE_POINTS_MAX 25 /* frequencies */

typedef struct impedance_variant {
  const char *name; /* of the picture */
  hap_model model;
  hap_coupling coupling;
} impedance_variant;

#define IMPEDANCE_VARIANTS 5
extern impedance_variant impedance_variants[IMPEDANCE_VARIANTS]; /* --coupling changes one */

/* A body behind the spring and damper of the contact, and those of the coupling where there is a
 * proxy: what is in series adds up in 1/Z. */
typedef struct impedance_truth {
  bool grounded;             /* the body does not move at all */
  double mass;               /* kg, at the pointer */
  double body_stiffness;     /* N/m, at the pointer: what the preload makes of a body that turns */
  double stiffness;          /* N/m, of the contact */
  double damping;            /* N s/m */
  double coupling_stiffness; /* N/m; 0: direct */
  double coupling_damping;   /* N s/m */
  bool rigid; /* stiffness and damping are the coupling's, the mass has the tool's in it */
} impedance_truth;

typedef struct impedance_point {
  double hz;
  double amplitude;       /* m */
  double complex felt;    /* N/m */
  double complex truth;   /* N/m */
  double complex sampled; /* N/m: what the truth is at ticks */
  double residual; /* rms of the force that is not of this frequency, over the rms of what is */
  double contact_share; /* of the ticks */
} impedance_point;

typedef struct impedance_curve {
  impedance_point points[IMPEDANCE_POINTS_MAX];
  impedance_truth truth;
  impedance_truth fit; /* what the hand would take the body for */
  bool fitted;
} impedance_curve;

typedef struct impedance_table {
  size_t points; /* of each curve */
  impedance_curve curves[PORT_BODIES][IMPEDANCE_VARIANTS];
} impedance_table;

typedef struct impedance_case {
  const char *name;
  const char *title;
  double mass;    /* kg */
  double preload; /* N: keeps the contact closed */
} impedance_case;

extern const impedance_case impedance_cases[PORT_BODIES];

#define IMPEDANCE_STIFFNESS 1000.0 /* N/m, of the contact */
#define IMPEDANCE_DAMPING 2.0      /* N s/m */

/* Of a sine that the hand makes, at its frequency. */
typedef struct impedance_sums {
  size_t ticks; /* and periods: of the window, whole ones */
  double periods;
  double complex force; /* on the world; motion of the device */
  double complex motion;
  double force_mean;
  double force_square;
  size_t touching;
} impedance_sums;

/* Adds up a window after so many ticks that do not count. */
hap_status impedance_listen(bench *b, port *p, int settle_ticks, impedance_sums *io);

/* N/m, the stiffest that a desktop stylus without a hand feels and holds: direct of a wall, else
 * of a coupling's spring before a wall that does not give (1 MN/m). */
hap_status zwidth_of_coupling(bench *b, hap_coupling coupling, double *out);

/* The stiffest walls of several devices at 1, 4 and 10 kHz: zwidth.csv and its picture. */
hap_status zwidth_run(bench *b);

#endif
