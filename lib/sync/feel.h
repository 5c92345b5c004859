/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_FEEL_H
#define HAPODE_SYNC_FEEL_H

/* How a pointer feels a geom, as the application says it (hapode/surface.h), checked. */

#include <stdint.h>

#include <hapode/spatial.h>

#include "sync/texture.h"

/* What is not the pointer's own spring with one coefficient of friction. */
enum {
  HAPI_FEEL_SPRING = 1, /* stiffness and damping */
  HAPI_FEEL_STATIC = 2, /* what sticks holds more than what slides */
  HAPI_FEEL_TEXTURE = 4,
  HAPI_FEEL_IMPACT = 8,
  HAPI_FEEL_ADHESION = 16,
  HAPI_FEEL_MAGNET = 32
};

/* pointer/transient.h */
typedef struct hapi_impact {
  double force; /* N s/m */
  double decay; /* 1/s */
  double hz;
} hapi_impact;

typedef struct hapi_feel {
  uint32_t more; /* HAPI_FEEL_* */
  uint32_t texture_number;
  double mu;                   /* friction of what slides; 0: none */
  double mu_static;            /* of what sticks; mu or more */
  double stiffness;            /* N/m; SPRING */
  double damping;              /* N s/m; SPRING */
  const hapi_texture *texture; /* NULL: smooth */
  hapi_impact impact;          /* IMPACT */
  double adhesion;             /* N; ADHESION */
  double magnet_force;         /* N; MAGNET */
  double magnet_reach;         /* m; MAGNET */
  hap_pose geom;               /* of its frame in that of its body; TEXTURE */
} hapi_feel;

#endif
