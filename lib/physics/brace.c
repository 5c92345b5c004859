/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/brace.h"

#include <math.h>
#include <string.h>

#include "base/pose.h"
#include "base/vec.h"

/* The loop gave a wrench P to a body outside of the range, and ODE has stepped the body with it and
 * with its weight, an acceleration f. Free, the body would have got H f + H M^-1 P of velocity;
 * along P it got less. The share that is missing was taken up by what the loop does not have: a
 * floor, a neighbour, a joint.
 *
 *   share = 1 - P.(dv - H f) / (H P.M^-1 P),   cut to 0 .. 1
 *
 * In the next interval the loop may hold the body with that much of P, and no more. What else the
 * world did holds the weight, or does not: a body that stands on one of the loop's is held by P
 * alone, and is as heavy in the loop. Its acceleration there is
 *
 *   f (1 + w.f / f.f),   w = dv / H - f - (1 - share) P / m,   between 0 and f
 *
 * The step says all of it, so nothing has to be tested. Of a body that was not outside in that step
 * it is guessed: hapi_brace_guess. */

#define GUESSED_LOAD 100.0 /* weights of the body, that it may carry in its first interval */

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

/* m/s, rad/s: by all but the weight, of a body with these velocities before the step; false: they
 * are no numbers. */
static bool velocity_gained(const hapi_account *account, dBodyID body, const hapi_slot_account *of,
                            double out[6])
{
  body_velocity(body, out);
  for (int k = 0; k < 6; ++k) {
    out[k] -= of->before[k];
  }
  hapi_v3_madd(out, -account->cycle->step_s, of->falls, out);
  return hapi_finite(out, 6);
}

static double taken_share(const hapi_account *account, dBodyID body, const double push[6],
                          const double gained[6])
{
  double answer[6];
  body_answer(body, push, answer);
  double free = account->cycle->step_s * wrench_dot(push, answer);
  return free > 0.0 ? fmin(fmax(1.0 - wrench_dot(push, gained) / free, 0.0), 1.0) : 0.0;
}

/* 0..1, of the weight, that the world holds. */
static double held_share(const hapi_account *account, dBodyID body, const double others_push[3],
                         const double gained[3], const double falls[3])
{
  dMass mass;
  double world[3];
  double falls2 = hapi_v3_dot(falls, falls);
  dBodyGetMass(body, &mass);
  hapi_v3_scale(1.0 / account->cycle->step_s, gained, world);
  hapi_v3_madd(world, -1.0 / mass.mass, others_push, world);
  return falls2 > 0.0 ? fmin(fmax(-hapi_v3_dot(world, falls) / falls2, 0.0), 1.0) : 1.0;
}

/* What the loop is told of a body outside. */
static void brace_find(const hapi_account *account, dBodyID body, const double push[6],
                       hapi_slot_account *io)
{
  double gained[6];
  double not_taken[3];
  if (!velocity_gained(account, body, io, gained)) {
    return;
  }
  double share = taken_share(account, body, push, gained);
  for (int k = 0; k < 6; ++k) {
    io->brace[k] = -share * push[k];
  }
  hapi_v3_scale(1.0 - share, push, not_taken);
  double held = held_share(account, body, not_taken, gained, io->falls);
  hapi_v3_scale(1.0 - held, io->falls, io->unheld);
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
    memset(of->unheld, 0, sizeof of->unheld);
    of->outside = body != NULL;
    if (body != NULL) {
      brace_find(account, body, slot->exchanged, of);
    }
  }
}

/* What rests on a body of the loop has its weight there, and what carries one stands. */
void hapi_brace_guess(const hapi_body_slot *slot, dBodyID body, hapi_slot_account *io)
{
  dMass mass;
  dBodyGetMass(body, &mass);
  if (slot->carried) {
    hapi_v3_copy(io->falls, io->unheld);
  } else {
    hapi_v3_scale(-GUESSED_LOAD * mass.mass, io->falls, io->brace);
  }
}
