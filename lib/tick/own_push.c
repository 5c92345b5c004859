/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "tick/own_push.h"

#include <string.h>

#include "base/safety.h"
#include "base/six.h"
#include "base/vec.h"
#include "guard/promise.h"
#include "local/body_step.h"
#include "local/rows.h"
#include "pointer/own_force.h"
#include "tick/own_hold.h"

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

/* ---- surfaces that pull from a distance ---- */

/* Of a body that can be pushed; false: none is. */
static bool magnet_find(const hapi_own_pushing *at, const hapi_pair_magnet *magnet, own_push *out)
{
  out->body = hapi_bodies_at(at->bodies, magnet->body);
  out->push = magnet->push;
  return magnet->any && out->body != NULL && hapi_dot6(out->push, out->push) > 0.0 &&
         (out->body->flags & HAPI_BODY_DRIVEN) == 0;
}

/* The opposite of what the hand gets, about the body's centre. */
static void magnet_push(hapi_pair_magnet *magnet, const hapi_pointer *p,
                        const hapi_local_body *body)
{
  double arm[3];
  double moment[3];
  hapi_v3_sub(p->pose.position, body->pose.position, arm);
  hapi_v3_cross(arm, magnet->pull.force, moment);
  hapi_v3_add(moment, magnet->pull.torque, moment);
  hapi_v3_scale(-1.0, magnet->pull.force, magnet->push);
  hapi_v3_scale(-1.0, moment, magnet->push + 3);
}

/* What the device cannot hold is cut, and what a light body cannot. */
static void magnet_hold(const hapi_own_pushing *at, hapi_pair_magnet *magnet, hapi_pointer *p,
                        const hapi_local_body *body)
{
  double most = hapi_magnet_hold(p);
  double share = magnet->hardest > most ? most / magnet->hardest : 1.0;
  if (body != NULL) {
    const hapi_own_slope slope = {.stiffness = magnet->hardest};
    magnet_push(magnet, p, body);
    share = hapi_min(share, hapi_own_body_share(body, p, at->facts, magnet->push, slope));
  }
  if (share < 1.0) {
    hapi_v3_scale(share, magnet->pull.force, magnet->pull.force);
    hapi_v3_scale(share, magnet->pull.torque, magnet->pull.torque);
    magnet->hardest *= share;
    p->declared.held = true;
  }
}

/* Within what it promises: its strength, at 1 m/s. */
static void magnet_declare(const hapi_own_pushing *at, hapi_pair_feel *pair, hapi_pointer *p)
{
  hapi_pair_magnet *magnet = &pair->magnet;
  double most = hapi_max(pair->in.feel.magnet_force, magnet->strength);
  const hapi_promise promise = {
      .force = most, .torque = most * p->shape.extent, .power = HAPI_SAFETY_OWN_SPEED * most};
  if (magnet->begins) {
    hapi_purse_fill(&magnet->purse, &promise);
    magnet->begins = false;
  }
  p->declared.held |=
      hapi_promise_keep(&promise, &magnet->purse, &p->declared, at->facts->period, &magnet->pull);
  hapi_declare_following(&p->declared, &magnet->pull, magnet->hardest);
}

/* Bodies of other models than these have no motion of their own in the loop. */
static bool magnet_acts(const hapi_own_pushing *at, const hapi_pair_magnet *magnet)
{
  return magnet->body == HAPI_SLOT_NONE || at->facts->model == HAP_MODEL_CONTACT ||
         at->facts->model == HAP_MODEL_SINGLE;
}

void hapi_magnets_pull(const hapi_own_pushing *at)
{
  own_push p;
  for (uint32_t i = 0; i < at->touches->feel_count; ++i) {
    hapi_pair_feel *pair = &at->touches->feels[i];
    hapi_pair_magnet *magnet = &pair->magnet;
    hapi_pointer *pointer = &at->pointers->of[pair->in.pointer];
    magnet->any = magnet->any && magnet_acts(at, magnet);
    if (!magnet->any) {
      continue;
    }
    const hapi_local_body *body = hapi_bodies_at(at->bodies, magnet->body);
    magnet_hold(at, magnet, pointer, body);
    magnet_declare(at, pair, pointer);
    if (body != NULL) {
      magnet_push(magnet, pointer, body);
    }
    if (magnet_find(at, magnet, &p)) {
      push_audit(at, &p);
      if (at->facts->model == HAP_MODEL_CONTACT) {
        push_velocity(at, &p);
      } else {
        push_outside(at, &p);
      }
    }
  }
}

void hapi_magnets_account(const hapi_own_pushing *at)
{
  own_push p;
  for (uint32_t i = 0; i < at->touches->feel_count; ++i) {
    hapi_pair_magnet *magnet = &at->touches->feels[i].magnet;
    if (magnet_find(at, magnet, &p) && at->facts->model == HAP_MODEL_CONTACT) {
      push_work(at, &p);
    }
    magnet->any = false;
  }
  at->touches->magnets = false;
}
