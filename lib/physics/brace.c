/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/brace.h"

#include <math.h>
#include <string.h>

#include "base/pose.h"
#include "base/vec.h"

/* The loop gave a wrench P to a body outside of the range, and ODE has stepped the body with it.
 * Free, the body would have got H M^-1 P of velocity; along P it got less. The share that is
 * missing was taken up by what the loop does not have: a floor, a neighbour, a joint.
 *
 *   share = 1 - P.dv / (H P.M^-1 P),   cut to 0 .. 1
 *
 * In the next interval the loop may hold the body with that much of P, and no more. The step says
 * all of it, so nothing has to be tested. */

static dBodyID braced_body(const hapi_account *account, const hapi_body_slot *slot)
{
  const uint32_t others = HAPI_BODY_OWNED | HAPI_BODY_MEASURED | HAPI_BODY_DRIVEN;
  bool outside = slot->phase != HAPI_SLOT_FREE && (slot->flags & others) == 0;
  return outside ? hapi_account_body(account, slot) : NULL;
}

static void body_velocity(dBodyID body, double out[6])
{
  hap_twist twist;
  hapi_twist_read(body, &twist);
  hapi_v3_copy(twist.linear, out);
  hapi_v3_copy(twist.angular, out + 3);
}

static double wrench_dot(const double wrench[6], const double twist[6])
{
  return hapi_v3_dot(wrench, twist) + hapi_v3_dot(wrench + 3, twist + 3);
}

/* out = M^-1 wrench */
static void body_answer(dBodyID body, const double wrench[6], double out[6])
{
  dMass mass;
  double inertia[9];
  double inverse[9];
  double rotation[9];
  dBodyGetMass(body, &mass);
  hapi_matrix_read(mass.I, inertia);
  hapi_matrix_read(dBodyGetRotation(body), rotation);
  hapi_m3_invert(inertia, inverse);
  hapi_m3_turn(rotation, inverse, inertia);
  hapi_v3_scale(1.0 / mass.mass, wrench, out);
  hapi_m3_apply(inertia, wrench + 3, out + 3);
}

static double taken_share(const hapi_account *account, dBodyID body, const double push[6],
                          const double before[6])
{
  double answer[6];
  double after[6];
  body_answer(body, push, answer);
  body_velocity(body, after);
  double free = account->cycle->step_s * wrench_dot(push, answer);
  if (!(free > 0.0) || !hapi_finite(after, 6)) {
    return 0.0;
  }
  double got = wrench_dot(push, after) - wrench_dot(push, before);
  return fmin(fmax(1.0 - got / free, 0.0), 1.0);
}

static uint32_t braced_high(const hapi_account *account)
{
  bool can = account->cycle->model == HAP_MODEL_CONTACT && account->cycle->step_s > 0.0;
  return can ? account->slots->body_high : 0;
}

void hapi_brace_begin(const hapi_account *account)
{
  uint32_t high = braced_high(account);
  for (uint32_t i = 0; i < high; ++i) {
    dBodyID body = braced_body(account, &account->slots->bodies[i]);
    if (body != NULL) {
      body_velocity(body, hapi_account_of(account, i)->before);
    }
  }
}

void hapi_brace_find(const hapi_account *account)
{
  uint32_t high = braced_high(account);
  for (uint32_t i = 0; i < high; ++i) {
    const hapi_body_slot *slot = &account->slots->bodies[i];
    dBodyID body = braced_body(account, slot);
    hapi_slot_account *of = hapi_account_of(account, i);
    memset(of->brace, 0, sizeof of->brace);
    if (body != NULL) {
      double share = taken_share(account, body, slot->exchanged, of->before);
      for (int k = 0; k < 6; ++k) {
        of->brace[k] = -share * slot->exchanged[k];
      }
    }
  }
}
