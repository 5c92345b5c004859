/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "probe/probe.h"

#include <math.h>
#include <string.h>

#include "base/assert.h"
#include "base/log.h"
#include "base/vec.h"

/* Testing simulations for bodies that a pointer may touch and that the loop of model CONTACT cannot
 * own: jointed ones, and ones on ground that only ODE's collider knows. Of each the response to a
 * wrench at its centre of mass, 6x6, about the operating point: every probe has the mean wrench of
 * the last interval, so that contacts are loaded as they really are. The bodies that the loop owns
 * are not there in a probe: their contacts are the loop's. */

/* Of the weight: within the plateau between rounding and another set of active contacts. */
#define PROBE_SHARE 0.01

static hapi_reuse_book *body_book(hapi_probe *probe)
{
  return &probe->reuse.books[HAPI_REUSE_BODIES];
}

/* ---- which bodies ---- */

/* The islands of the measured bodies. */
static hap_status bodies_gather(hapi_probe *probe)
{
  hapi_test_set *test = &probe->test;
  hapi_pushed *pushed = &probe->bodies.pushed;
  pushed->count = 0;
  hap_status status = hapi_test_begin(test, probe->world, hapi_cycle_test_s(probe->cycle));
  for (uint32_t i = 0; i < probe->slots->body_high && status >= HAP_OK; ++i) {
    const hapi_body_answer *answer = &probe->answers.bodies[i];
    if (probe->slots->bodies[i].phase != HAPI_SLOT_LIVE ||
        (answer->flags & HAPI_BODY_MEASURED) == 0 || !hapi_body_is_whole(probe->slots, i)) {
      continue;
    }
    bool testable = false;
    status = hapi_probe_add_body(probe, i, &testable);
    if (status >= HAP_OK && testable) {
      HAPI_ASSERT_INDEX(pushed->count, pushed->capacity);
      pushed->slots[pushed->count++] = i;
    }
  }
  return status;
}

/* ---- a testing simulation ---- */

static double body_push_force(const hapi_body_slot *slot)
{
  double least = PROBE_SHARE * HAPI_STANDARD_GRAVITY * slot->mass;
  return fmax(least, hapi_v3_norm(slot->exchanged));
}

static void body_add_wrench(dBodyID body, const double wrench[6])
{
  dBodyAddForce(body, wrench[0], wrench[1], wrench[2]);
  dBodyAddTorque(body, wrench[3], wrench[4], wrench[5]);
}

static void bodies_begin_step(hapi_probe *probe)
{
  hapi_test_rewind(&probe->test);
  for (uint32_t i = 0; i < probe->bodies.pushed.count; ++i) {
    const hapi_body_slot *slot = &probe->slots->bodies[probe->bodies.pushed.slots[i]];
    body_add_wrench(hapi_test_state(&probe->test, slot->known)->body, slot->exchanged);
  }
}

/* Without the wrench of the operating point, which the loop's rows give anew. */
static void answer_keep_b(hapi_body_answer *answer, const double exchanged[6], const double base[6])
{
  for (int i = 0; i < 6; ++i) {
    answer->b[i] = base[i];
    for (int k = 0; k < 6; ++k) {
      answer->b[i] -= answer->response[i][k] * exchanged[k];
    }
  }
  answer->flags |= HAPI_BODY_WHOLE;
}

/* Where it cannot be one the last good one stays, or the body is outside. */
static void body_keep(hapi_probe *probe, uint32_t index, double a[6][6], const double base[6])
{
  const hapi_body_slot *slot = &probe->slots->bodies[index];
  hapi_body_answer *answer = &probe->answers.bodies[index];
  const hapi_body_state *tested = hapi_test_state(&probe->test, slot->known);
  hapi_free_body free;
  hapi_accelerance_free_body(tested->body, tested->rotation, &free);
  hapi_admittance kind =
      hapi_finite(base, 6) ? hapi_admittance_tidy_body(&free, a) : HAPI_ADMITTANCE_SINGULAR;
  hapi_probe_count(probe, kind);
  if (kind == HAPI_ADMITTANCE_SINGULAR) {
    answer->flags &= answer->measured ? ~0u : ~(uint32_t)HAPI_BODY_MEASURED;
    answer->flags |= answer->measured ? (uint32_t)HAPI_BODY_WHOLE : 0u;
    hapi_reuse_spoil(body_book(probe), &probe->test, slot->known);
    return;
  }
  HAPI_ASSERT(hapi_assert_is_symmetric(a[0], 6));
  memcpy(answer->response, a, sizeof answer->response);
  answer_keep_b(answer, slot->exchanged, base);
  answer->measured = true;
}

static void body_measure(hapi_probe *probe, uint32_t index, const double base[6])
{
  const hapi_body_slot *slot = &probe->slots->bodies[index];
  double extent = probe->test.world->bodies.entries[slot->known].extent;
  dBodyID body = hapi_test_state(&probe->test, slot->known)->body;
  double a[6][6];
  for (int axis = 0; axis < 6; ++axis) {
    double wrench[6] = {0.0};
    double column[6];
    wrench[axis] =
        axis < 3 ? body_push_force(slot) : (body_push_force(slot) * (extent > 0.0 ? extent : 1.0));
    bodies_begin_step(probe);
    body_add_wrench(body, wrench);
    hapi_test_step(&probe->test);
    hapi_test_acceleration(&probe->test, slot->known, column);
    for (int i = 0; i < 6; ++i) {
      a[i][axis] = (column[i] - base[i]) / wrench[axis];
    }
  }
  body_keep(probe, index, a, base);
}

/* The step that all differences are taken from. */
static void bodies_measure_base(hapi_probe *probe)
{
  bodies_begin_step(probe);
  hapi_test_step(&probe->test);
  for (uint32_t i = 0; i < probe->bodies.pushed.count; ++i) {
    uint32_t known = probe->slots->bodies[probe->bodies.pushed.slots[i]].known;
    hapi_test_acceleration(&probe->test, known, probe->bodies.base[i]);
  }
}

/* ---- all of them ---- */

/* Islands whose response holds still. All are gathered again then. */
static hap_status islands_measure_b_alone(hapi_probe *probe)
{
  hapi_reuse_book *book = body_book(probe);
  if (!hapi_reuse_has(book, HAPI_REUSE_A)) {
    return HAP_OK;
  }
  hapi_reuse_select(book, HAPI_REUSE_A, probe->slots, &probe->test, &probe->bodies.pushed);
  hap_status status = hapi_test_enter(&probe->test);
  if (status < HAP_OK) {
    return status;
  }
  bodies_measure_base(probe);
  for (uint32_t i = 0; i < probe->bodies.pushed.count; ++i) {
    uint32_t index = probe->bodies.pushed.slots[i];
    const hapi_body_slot *slot = &probe->slots->bodies[index];
    if (hapi_finite(probe->bodies.base[i], 6)) {
      answer_keep_b(&probe->answers.bodies[index], slot->exchanged, probe->bodies.base[i]);
    } else {
      hapi_reuse_spoil(book, &probe->test, slot->known);
    }
  }
  hapi_test_leave(&probe->test);
  return bodies_gather(probe);
}

static hap_status bodies_measure(hapi_probe *probe)
{
  hapi_pushed *pushed = &probe->bodies.pushed;
  hapi_reuse_book *book = body_book(probe);
  hap_status status = bodies_gather(probe);
  if (status >= HAP_OK) {
    const hapi_reuse_input input = {probe->cycle, probe->slots, &probe->answers, &probe->test};
    hapi_reuse_look(&probe->reuse, book, &input, pushed);
    status = islands_measure_b_alone(probe);
  }
  if (status < HAP_OK) {
    return status;
  }
  /* The flags are of this cycle, the response of another. */
  for (uint32_t i = 0; i < probe->bodies.pushed.count; ++i) {
    uint32_t index = probe->bodies.pushed.slots[i];
    uint32_t known = probe->slots->bodies[index].known;
    if (hapi_reuse_kind_of(body_book(probe), &probe->test, known) != HAPI_REUSE_NONE) {
      probe->answers.bodies[index].flags |= HAPI_BODY_WHOLE;
    }
  }
  hapi_reuse_select(book, HAPI_REUSE_NONE, probe->slots, &probe->test, pushed);
  if (pushed->count > 0) {
    status = hapi_test_enter(&probe->test);
    if (status < HAP_OK) {
      return status;
    }
    bodies_measure_base(probe);
    for (uint32_t i = 0; i < pushed->count; ++i) {
      body_measure(probe, pushed->slots[i], probe->bodies.base[i]);
    }
    hapi_test_leave(&probe->test);
  }
  probe->counts.reused += hapi_reuse_keep(book);
  return HAP_OK;
}

void hapi_operating_point_measure(hapi_probe *probe)
{
  if (probe->cycle->model != HAP_MODEL_CONTACT) {
    return;
  }
  if (bodies_measure(probe) < HAP_OK) {
    hapi_log(HAP_LOG_ERROR, "no memory for the testing simulations; the last response stays");
  }
}
