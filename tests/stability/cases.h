/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_STABILITY_CASES_H
#define HAPODE_TESTS_STABILITY_CASES_H

#include "tests/stability/worlds.h"

/* Models that claim a case. */
#define CONTACT (1u << HAP_MODEL_CONTACT)
#define SINGLE (1u << HAP_MODEL_SINGLE)
#define ACCELERANCE (1u << HAP_MODEL_ACCELERANCE)
#define IMPULSE (1u << HAP_MODEL_IMPULSE)

typedef struct case_row {
  const char *name;
  world_build_fn build;
  int n;       /* bodies, links or hands, as the builder says */
  double mass; /* kg of each */
  double size; /* of the builder */
  double k;    /* N/m of the pointer's contact */
  case_hand hand;
  double seconds; /* of the quick run */
  unsigned judged;
  double room; /* m, from where it started, that no body leaves */
  /* Where a case differs; 0: it does not. */
  double physics_hz;         /* 60 */
  double device_damping;     /* N s/m, 2 */
  double max_force;          /* N, of the device, 100 */
  const char *device;        /* more arguments of the virtual device */
  double origin;             /* m, along x, of the whole scene */
  double cfm;                /* 1e-12; negative: 0 */
  double coupling_stiffness; /* N/m, of a proxy; its damping is 0 then */
  hap_coupling coupling;     /* with it: god-object or virtual, and not a proxy */
  double given;              /* J, that the world has at its start without having been given it */
  double depth;              /* m, of penetration at the start */
  double mu;                 /* of the hands, 0 */
  double finger;             /* m, radius of soft fingers, 0 */
  double gain;               /* of the largest stored energy, 0.01 */
  bool late;                 /* ODE moves what is touched: bodies answer an interval later */
} case_row;

extern const case_row stability_cases[];
extern const size_t stability_case_count;

#endif
