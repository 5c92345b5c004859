/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_TEST_SET_H
#define HAPODE_PROBE_TEST_SET_H

/* The islands under test: which bodies a testing simulation steps, and what it undoes. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/status.h>
#include <ode/ode.h>

#include "probe/snapshot.h"

typedef struct hapi_physics hapi_physics;
typedef struct hapi_lookback_body hapi_lookback_body;

typedef struct hapi_test_set {
  uint32_t *contacts; /* slots of the contacts to probe; capacity.contacts */
  uint32_t contact_count;
  uint32_t *bodies;  /* slots of bodies to probe, model CONTACT; capacity.bodies */
  double (*base)[6]; /* their acceleration at the operating point */
  uint32_t body_count;
  uint32_t *rounds;  /* by island: contacts so far; capacity.contacts */
  uint32_t *members; /* entries of the body table, all islands under test */
  uint32_t member_count;
  uint32_t member_capacity;
  uint32_t island_count;
  bool mechanisms; /* there are joints other than contacts */
  dGeomID *order;  /* geoms of the spaces that sleeping members are in, space by space */
  uint32_t order_count;
  bool keeps_order; /* of all members' spaces, not of sleeping ones alone */
  uint32_t order_capacity;
  dJointID *cut; /* joints of kinematic bodies to the outside, disabled for the probe */
  uint32_t cut_count;
  uint32_t cut_capacity;
  dBodyID *disabled; /* switched off for the probe */
  uint32_t disabled_count;
  uint32_t disabled_capacity;
  unsigned islands_threads; /* ODE's setting, restored after the probes */
} hapi_test_set;

/* space_order.c */
hap_status hapi_space_order_save(hapi_physics *physics); /* when a member sleeps */
void hapi_space_order_restore(hapi_physics *physics);
/* test_set.c */
/* Which bodies the wanted contacts can move: their islands. HAP_ERROR_MEMORY. */
hap_status hapi_test_gather(hapi_physics *physics);
/* The islands of the measured bodies of model CONTACT. */
hap_status hapi_test_gather_bodies(hapi_physics *physics);
/* Model CONTACT: whether it must answer all that acts on it by one matrix. */
bool hapi_test_is_whole(const hapi_physics *physics, uint32_t body);
/* The islands of the neighbours that the loop owns, as far as they can be undone. */
hap_status hapi_test_gather_owned(hapi_physics *physics);
/* All others off, state saved; on HAP_ERROR_MEMORY nothing has changed. */
hap_status hapi_test_enter(hapi_physics *physics);
/* These bodies, with whatever joints tie them to; those that slept are awake then. */
hap_status hapi_test_enter_bodies(hapi_physics *physics, const hapi_lookback_body *bodies,
                                  uint32_t count);
/* Two bodies (HAPI_NONE: none) and nothing that holds them but the joint. */
hap_status hapi_test_enter_pair(hapi_physics *physics, dJointID joint, const uint32_t index[2]);
void hapi_test_leave(hapi_physics *physics); /* as if nothing had been */
/* One testing simulation from the saved state; forces were added by prepare. */
void hapi_test_rewind(hapi_physics *physics);
void hapi_test_step(hapi_physics *physics);
const hapi_body_state *hapi_test_state(const hapi_physics *physics, uint32_t known); /* saved */
/* m/s^2, rad/s^2 of a body under test, over the step. */
void hapi_test_acceleration(const hapi_physics *physics, uint32_t known, double out[6]);
void hapi_test_finish(hapi_test_set *test);

#endif
