/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_TRANSIENT_H
#define HAPODE_POINTER_TRANSIENT_H

/* What a material sounds like to the hand when it is hit: a vibration that dies down,
 *
 *   Q(t) = A v exp(-B t) sin(2 pi f t)
 *
 * along the normal, with the speed v of the touch and the material's A, B and f (Wellman and Howe
 * 1995; Okamura, Cutkosky and Dennerlein 2001). t is 0 when the surfaces met, which is between two
 * ticks. Each tick turns a pointer in the complex plane once: no sine but at a touch. */

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/safety.h"
#include "base/vec.h"
#include "pointer/declared.h"
#include "sync/feel.h"

#define HAPI_TRANSIENTS 4u
#define HAPI_TRANSIENT_OVER 1e-3 /* N: less is not felt */

typedef struct hapi_transient {
  double z[2];    /* N; the second part is the force */
  double turn[2]; /* of a tick */
  double way[3];  /* unit, world */
} hapi_transient;

/* Zeroed: none. */
typedef struct hapi_transients {
  bool any;
  hapi_purse purse;
  hapi_transient of[HAPI_TRANSIENTS];
} hapi_transients;

static inline void hapi_complex_times(const double a[2], const double b[2], double out[2])
{
  const double real = a[0] * b[0] - a[1] * b[1];
  out[1] = a[0] * b[1] + a[1] * b[0];
  out[0] = real;
}

/* exp(w), |w| below 20, within 1e-12 of its size: a series for w / 64, squared six times. The tick
 * calls no library for it. */
static inline void hapi_complex_exp(const double w[2], double out[2])
{
  const double part[2] = {w[0] / 64.0, w[1] / 64.0};
  out[0] = 1.0;
  out[1] = 0.0;
  for (int k = 12; k > 0; --k) { /* 1 + w (1 + w / 2 (1 + w / 3 ...)) */
    hapi_complex_times(out, part, out);
    out[0] = 1.0 + out[0] / k;
    out[1] /= k;
  }
  for (int i = 0; i < 6; ++i) {
    hapi_complex_times(out, out, out);
  }
}

static inline double hapi_transient_left(const hapi_transient *t)
{
  return t->z[0] * t->z[0] + t->z[1] * t->z[1];
}

/* speed: m/s, of the surfaces to each other. depth: m, that has come since they met. The faintest
 * makes room. */
static inline void hapi_transient_begin(hapi_transients *list, const hapi_impact *impact,
                                        double speed, double depth, const double normal[3],
                                        double period)
{
  double size = hapi_min(impact->force * speed, HAPI_SAFETY_IMPACT_FORCE);
  double since = hapi_min(depth / speed, period);
  double rate = 2.0 * M_PI * impact->hz;
  hapi_transient *out = &list->of[0];
  for (uint32_t i = 1; i < HAPI_TRANSIENTS; ++i) {
    out = hapi_transient_left(&list->of[i]) < hapi_transient_left(out) ? &list->of[i] : out;
  }
  const double after[2] = {-impact->decay * since, rate * since};
  const double tick[2] = {-impact->decay * period, rate * period};
  hapi_complex_exp(after, out->z);
  hapi_complex_exp(tick, out->turn);
  out->z[0] *= size;
  out->z[1] *= size;
  hapi_v3_copy(normal, out->way);
  list->any = true;
}

/* Once a tick, after the touches of the tick were found. *out_force: N, of all, world. */
static inline void hapi_transients_next(hapi_transients *list, double out_force[3])
{
  hapi_v3_set(out_force, 0.0, 0.0, 0.0);
  list->any = false;
  for (uint32_t i = 0; i < HAPI_TRANSIENTS; ++i) {
    hapi_transient *t = &list->of[i];
    if (hapi_transient_left(t) < HAPI_TRANSIENT_OVER * HAPI_TRANSIENT_OVER) {
      memset(t->z, 0, sizeof t->z);
      continue;
    }
    hapi_v3_madd(out_force, t->z[1], t->way, out_force);
    hapi_complex_times(t->z, t->turn, t->z);
    list->any = true;
  }
}

#endif
