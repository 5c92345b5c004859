/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/vec.h"
#include "physics/physics_internal.h"

/* Testing simulations for bodies that the loop of model CONTACT meets but does not own: jointed
 * ones, ones on ground that only ODE's collider knows, and those at the border of the range. Of each
 * the response to a wrench at its centre of mass, 6x6, about the operating point: every probe has
 * the mean wrench of the last interval, so that contacts are loaded as they really are. The bodies
 * that the loop owns are not there in a probe: their contacts are the loop's. */

/* Of the weight: within the plateau between rounding and another set of active contacts. */
#define PROBE_SHARE 0.01

static double force_of(const hapi_body_slot *slot)
{
  double least = PROBE_SHARE * HAPI_STANDARD_GRAVITY * slot->mass;
  return fmax(least, hapi_v3_norm(slot->exchanged));
}

static double torque_of(const hapi_physics *physics, const hapi_body_slot *slot)
{
  double arm = physics->world.bodies.entries[slot->known].extent;
  return force_of(slot) * (arm > 0.0 ? arm : 1.0);
}

static double exchanged_norm(const hapi_body_slot *slot)
{
  return hapi_v3_norm(slot->exchanged);
}

/* Those that took most of the loop's impulse first. */
static void choose(hapi_physics *physics)
{
  for (uint32_t n = 0; n < physics->cycle.settings.edge_probes; ++n) {
    hapi_body_slot *best = NULL;
    for (uint32_t i = 0; i < physics->near.slots.body_high; ++i) {
      hapi_body_slot *slot = &physics->near.slots.bodies[i];
      uint32_t role = HAPI_BODY_OWNED | HAPI_BODY_MEASURED | HAPI_BODY_DRIVEN;
      bool outside = slot->phase == HAPI_SLOT_LIVE && slot->wanted && (slot->flags & role) == 0;
      if (outside && exchanged_norm(slot) > (best != NULL ? exchanged_norm(best) : 0.0)) {
        best = slot;
      }
    }
    if (best == NULL) {
      return;
    }
    best->edge = true;
    best->flags = (best->flags & ~(uint32_t)HAPI_BODY_RESTING) | HAPI_BODY_MEASURED;
  }
}

static void add_wrench(dBodyID body, const double wrench[6])
{
  dBodyAddForce(body, wrench[0], wrench[1], wrench[2]);
  dBodyAddTorque(body, wrench[3], wrench[4], wrench[5]);
}

static dBodyID body_of(const hapi_physics *physics, const hapi_body_slot *slot)
{
  return physics->world.bodies.entries[slot->known].body;
}

static void begin_probe(hapi_physics *physics)
{
  hapi_test_rewind(physics);
  for (uint32_t i = 0; i < physics->probe.test.body_count; ++i) {
    const hapi_body_slot *slot = &physics->near.slots.bodies[physics->probe.test.bodies[i]];
    add_wrench(body_of(physics, slot), slot->exchanged);
  }
}

static void acceleration(const hapi_physics *physics, const hapi_body_slot *slot, double out[6])
{
  const hapi_body_state *before = hapi_test_state(physics, slot->known);
  const dReal *linear = dBodyGetLinearVel(before->body);
  const dReal *angular = dBodyGetAngularVel(before->body);
  for (int i = 0; i < 3; ++i) {
    out[i] = (linear[i] - before->linear[i]) / physics->cycle.probe_step_s;
    out[3 + i] = (angular[i] - before->angular[i]) / physics->cycle.probe_step_s;
  }
}

static hapi_reuse_book *book_of(hapi_physics *physics)
{
  return &physics->probe.reuse.books[1];
}

/* Without the wrench of the operating point, which the loop's rows give anew. */
static void keep_b(hapi_body_slot *slot, const double base[6])
{
  for (int i = 0; i < 6; ++i) {
    slot->b[i] = base[i];
    for (int k = 0; k < 6; ++k) {
      slot->b[i] -= slot->response[i][k] * slot->exchanged[k];
    }
  }
  slot->flags |= HAPI_BODY_WHOLE;
}

static void keep(hapi_physics *physics, hapi_body_slot *slot, double a[6][6], const double base[6])
{
  hap_stats *stats = &physics->counts.own.stats;
  hapi_free_body free;
  const hapi_body_state *tested = hapi_test_state(physics, slot->known);
  hapi_accelerance_free_body(tested->body, tested->rotation, &free);
  hapi_admittance kind =
      hapi_finite(base, 6) ? hapi_admittance_tidy_body(&free, a) : HAPI_ADMITTANCE_SINGULAR;
  stats->probes.clipped += kind == HAPI_ADMITTANCE_CLIPPED;
  if (kind == HAPI_ADMITTANCE_SINGULAR) {
    ++stats->probes.singular; /* the last good one stays, or the body is outside */
    slot->flags &= slot->measured ? ~0u : ~(uint32_t)HAPI_BODY_MEASURED;
    slot->flags |= slot->measured ? (uint32_t)HAPI_BODY_WHOLE : 0u;
    hapi_reuse_spoil(physics, book_of(physics), slot->known);
    return;
  }
  memcpy(slot->response, a, sizeof slot->response);
  keep_b(slot, base);
  slot->measured = true;
}

static void measure_body(hapi_physics *physics, hapi_body_slot *slot, const double base[6])
{
  double a[6][6];
  for (int axis = 0; axis < 6; ++axis) {
    double wrench[6] = {0.0};
    double column[6];
    wrench[axis] = axis < 3 ? force_of(slot) : torque_of(physics, slot);
    begin_probe(physics);
    add_wrench(body_of(physics, slot), wrench);
    hapi_test_step(physics);
    acceleration(physics, slot, column);
    for (int i = 0; i < 6; ++i) {
      a[i][axis] = (column[i] - base[i]) / wrench[axis];
    }
  }
  keep(physics, slot, a, base);
}

/* The step that all differences are taken from. */
static void measure_base(hapi_physics *physics)
{
  const hapi_test_set *test = &physics->probe.test;
  begin_probe(physics);
  hapi_test_step(physics);
  for (uint32_t i = 0; i < test->body_count; ++i) {
    acceleration(physics, &physics->near.slots.bodies[test->bodies[i]], test->base[i]);
  }
}

/* Islands whose response holds still. All are gathered again then. */
static hap_status measure_b_alone(hapi_physics *physics)
{
  if (!hapi_reuse_has(book_of(physics), HAPI_REUSE_A)) {
    return HAP_OK;
  }
  hapi_reuse_select(physics, book_of(physics), HAPI_REUSE_A);
  hap_status status = hapi_test_enter(physics);
  if (status < HAP_OK) {
    return status;
  }
  measure_base(physics);
  for (uint32_t i = 0; i < physics->probe.test.body_count; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[physics->probe.test.bodies[i]];
    if (hapi_finite(physics->probe.test.base[i], 6)) {
      keep_b(slot, physics->probe.test.base[i]);
    } else {
      hapi_reuse_spoil(physics, book_of(physics), slot->known);
    }
  }
  hapi_test_leave(physics);
  return hapi_test_gather_bodies(physics);
}

/* The flags are of this cycle, the response of another. */
static void take_again(hapi_physics *physics)
{
  for (uint32_t i = 0; i < physics->probe.test.body_count; ++i) {
    hapi_body_slot *slot = &physics->near.slots.bodies[physics->probe.test.bodies[i]];
    if (hapi_reuse_kind_of(physics, book_of(physics), slot->known) != HAPI_REUSE_NONE) {
      slot->flags |= HAPI_BODY_WHOLE;
    }
  }
}

static hap_status measure(hapi_physics *physics)
{
  hapi_test_set *test = &physics->probe.test;
  hap_status status = hapi_test_gather_bodies(physics);
  if (status >= HAP_OK) {
    hapi_reuse_look(physics, book_of(physics), true);
    status = measure_b_alone(physics);
  }
  if (status < HAP_OK) {
    return status;
  }
  take_again(physics);
  hapi_reuse_select(physics, book_of(physics), HAPI_REUSE_NONE);
  if (test->body_count > 0) {
    status = hapi_test_enter(physics);
    if (status < HAP_OK) {
      return status;
    }
    measure_base(physics);
    for (uint32_t i = 0; i < test->body_count; ++i) {
      measure_body(physics, &physics->near.slots.bodies[test->bodies[i]], test->base[i]);
    }
    hapi_test_leave(physics);
  }
  hapi_reuse_keep(physics, book_of(physics));
  return HAP_OK;
}

void hapi_operating_point_measure(hapi_physics *physics)
{
  if (physics->cycle.model != HAP_MODEL_CONTACT) {
    return;
  }
  if (!hapi_wish_is_off(physics->cycle.wishes, HAP_EFFECT_TESTING)) {
    choose(physics);
  }
  if (measure(physics) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; the last response stays");
  }
}
