/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/own_push.h"

#include <string.h>

#include "base/six.h"
#include "base/vec.h"
#include "local/body_step.h"

/* N, N m on a body, of one force. */
typedef struct own_push {
  hapi_local_body *body;
  const double *push;
} own_push;

/* Of a force that is bound to a body that can be pushed; false: it gives none. */
static bool push_find(const hapi_own_pushing *at, uint32_t pointer, uint32_t place, own_push *out)
{
  const hapi_own_force *own = &at->own[(size_t)pointer * HAP_FORCES_MAX + place];
  if (at->pointers->of[pointer].generation == 0 || own->setup.serial == 0 || !own->bond.here ||
      at->facts->faulted) {
    return false;
  }
  out->body = &at->bodies->of[own->bond.slot];
  out->push = own->bond.push;
  return hapi_dot6(out->push, out->push) > 0.0 && (out->body->flags & HAPI_BODY_DRIVEN) == 0;
}

static void push_audit(const hapi_own_pushing *at, const own_push *p)
{
  hapi_touches *touches = at->touches;
  double period = at->facts->period;
  p->body->pushed = true;
  hapi_v3_madd(touches->hand_impulse, period, p->push, touches->hand_impulse);
  touches->hand_impulse_abs += period * hapi_v3_norm(p->push);
}

/* For physics to pass on. */
static void push_outside(const hapi_own_pushing *at, const own_push *p)
{
  hapi_body_account *account = &p->body->account;
  hapi_v3_madd(account->impulse, at->facts->period, p->push, account->impulse);
  hapi_v3_madd(account->angular_impulse, at->facts->period, p->push + 3, account->angular_impulse);
}

static void push_velocity(const hapi_own_pushing *at, const own_push *p)
{
  hapi_local_body *body = p->body;
  hapi_solver *solver = &at->rows->solver;
  double period = at->facts->period;
  double answer[6];
  if (hapi_body_rests(body)) {
    hapi_body_wake(body, at->rows, period);
  }
  hapi_row_response(body, p->push, answer);
  hapi_madd6(solver->v[body->row], period, answer);
  hapi_madd6(solver->free[body->row], period, answer);
  body->flags |= HAPI_BODY_TOUCHED;
  if (hapi_body_is_owned(body)) {
    hapi_madd6(body->account.gain, period, p->push);
    hapi_v3_madd(at->bodies->owned_impulse, period, p->push, at->bodies->owned_impulse);
  } else {
    push_outside(at, p);
  }
}

/* By the mean of the velocities, as the change of a kinetic energy. */
static void push_work(const hapi_own_pushing *at, const own_push *p)
{
  double both[6];
  if (hapi_body_is_owned(p->body)) {
    memcpy(both, p->body->start_twist, sizeof both);
    hapi_madd6(both, 1.0, at->rows->solver.v[p->body->row]);
    at->bodies->given += 0.5 * at->facts->period * hapi_dot6(p->push, both);
  }
}

void hapi_own_push(const hapi_own_pushing *at)
{
  own_push p;
  for (uint32_t i = 0; i < at->pointers->high; ++i) {
    for (uint32_t k = 0; k < HAP_FORCES_MAX; ++k) {
      if (push_find(at, i, k, &p)) {
        push_velocity(at, &p);
        push_audit(at, &p);
      }
    }
  }
}

void hapi_own_push_account(const hapi_own_pushing *at)
{
  own_push p;
  for (uint32_t i = 0; i < at->pointers->high; ++i) {
    for (uint32_t k = 0; k < HAP_FORCES_MAX; ++k) {
      if (push_find(at, i, k, &p)) {
        push_work(at, &p);
      }
    }
  }
}

void hapi_own_push_world(const hapi_own_pushing *at)
{
  own_push p;
  for (uint32_t i = 0; i < at->pointers->high; ++i) {
    for (uint32_t k = 0; k < HAP_FORCES_MAX; ++k) {
      if (push_find(at, i, k, &p)) {
        push_audit(at, &p);
        push_outside(at, &p);
      }
    }
  }
}
