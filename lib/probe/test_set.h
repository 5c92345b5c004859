/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_TEST_SET_H
#define HAPODE_PROBE_TEST_SET_H

/* The islands under test: which bodies a testing simulation steps, and what it undoes.
 *
 * begin; add islands; enter; for each simulation rewind, add forces, step, read; leave. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>
#include <ode/ode.h>

#include "base/assert.h"
#include "probe/snapshot.h"
#include "world/world.h"

/* Of a body. */
typedef struct hapi_test_place {
  uint32_t island; /* HAPI_NONE: it is not under test */
  uint32_t member; /* place among the members and in the snapshot */
} hapi_test_place;

/* Switched off for the tests. */
typedef struct hapi_test_off {
  dJointID *joints;
  uint32_t joint_count;
  uint32_t joint_capacity;
  dBodyID *bodies;
  uint32_t body_count;
  uint32_t body_capacity;
  unsigned islands_threads; /* ODE's setting */
} hapi_test_off;

typedef struct hapi_test_set {
  const hapi_world *world; /* of the members */
  uint32_t *members;       /* entries of the body table, island by island */
  uint32_t member_count;
  uint32_t member_capacity;
  uint32_t island_count;
  hapi_test_place *places; /* by entry of the body table, as of the newest begin */
  uint32_t place_count;
  bool mechanisms; /* there are joints other than contacts */
  bool entered;
  double step_s;
  uint64_t steps; /* testing simulations so far */
  hapi_snapshot snapshot;
  hapi_space_order order;
  hapi_test_off off;
} hapi_test_set;

/* Nothing is under test. step_s: of the steps to come. HAP_ERROR_MEMORY. */
hap_status hapi_test_begin(hapi_test_set *test, const hapi_world *world, double step_s);
/* The island of a body. *out_testable: it can be undone, else nothing was added.
 * HAP_ERROR_MEMORY. */
hap_status hapi_test_add_island(hapi_test_set *test, uint32_t known, bool *out_testable);
/* The body alone, with whatever joints hold it. */
hap_status hapi_test_add_body(hapi_test_set *test, uint32_t known);
/* All others off, state saved; on HAP_ERROR_MEMORY nothing has changed. Who slept is awake then. */
hap_status hapi_test_enter(hapi_test_set *test);
/* The same for two bodies (HAPI_NONE: none) and nothing that holds them but the joint. */
hap_status hapi_test_enter_pair(hapi_test_set *test, dJointID joint, const uint32_t index[2]);
void hapi_test_leave(hapi_test_set *test); /* as if nothing had been */
/* The saved state, with the application's forces. */
void hapi_test_rewind(hapi_test_set *test);
void hapi_test_step(hapi_test_set *test);

static inline bool hapi_test_has(const hapi_test_set *test, uint32_t known)
{
  HAPI_ASSERT_INDEX(known, test->place_count);
  return test->places[known].island != HAPI_NONE;
}

/* HAPI_NONE: not under test. */
static inline uint32_t hapi_test_island(const hapi_test_set *test, uint32_t known)
{
  HAPI_ASSERT_INDEX(known, test->place_count);
  return test->places[known].island;
}

/* Of a body under test, as saved. */
const hapi_body_state *hapi_test_state(const hapi_test_set *test, uint32_t known);
/* m/s^2, rad/s^2, over the step. */
void hapi_test_acceleration(const hapi_test_set *test, uint32_t known, double out[6]);
void hapi_test_finish(hapi_test_set *test);

#endif
