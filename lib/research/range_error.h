/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_RESEARCH_RANGE_ERROR_H
#define HAPODE_RESEARCH_RANGE_ERROR_H

/* The effect testing=on of model CONTACT: how well testing simulations would have foretold what the
 * loop made of the bodies that it owns. */

#include <stdbool.h>
#include <stdint.h>

#include "near/near.h"
#include "probe/probe.h"

/* What the world was going to do with an owned body. */
typedef struct hapi_forecast {
  uint32_t generation; /* of its slot */
  bool made;
  double a[6][3];
  double b[6];
  double twist[6]; /* then */
  double gain[3];  /* N s, likewise */
} hapi_forecast;

typedef struct hapi_range_error {
  hapi_test_set test;
  uint32_t *bodies;  /* slots of the bodies under test */
  double (*base)[6]; /* their acceleration */
  uint32_t body_count;
  hapi_forecast *forecasts; /* by body slot */
  uint32_t capacity;
  double foretold2; /* m^2/s^2, sum over what was foretold of owned bodies ... */
  double error2;    /* ... and over what the loop made different from it */
} hapi_range_error;

bool hapi_range_error_create(hapi_range_error *range, const hapi_capacity *capacity);
void hapi_range_error_finish(hapi_range_error *range);
void hapi_range_error_reset(hapi_range_error *range);
bool hapi_range_error_wanted(const hapi_cycle *cycle);
/* After the step: the last forecast. */
void hapi_range_error_compare(hapi_range_error *range, const hapi_cycle *cycle,
                              const hapi_world *world, const hapi_slots *slots);
/* The next one. The contacts of what the loop carries are in ODE meanwhile. */
void hapi_range_error_measure(hapi_range_error *range, const hapi_cycle *cycle,
                              const hapi_world *world, const hapi_nearby *near);

#endif
