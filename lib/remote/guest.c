/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/guest.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"

#define UNTOLD 1u /* hapi_state_body.reserved: of a body that is another's */

hap_status hapi_guest_create(hapi_guest *guest, const hapi_exchange *exchange, double late_s)
{
  const hapi_capacity *capacity = hapi_exchange_capacity(exchange);
  guest->state = hapi_alloc(hapi_exchange_message_size(exchange, HAPI_CHANNEL_STATE));
  guest->bodies = hapi_alloc_array(capacity->bodies, sizeof *guest->bodies);
  guest->hands = hapi_alloc_array(capacity->pointers, sizeof *guest->hands);
  guest->given = hapi_alloc_array(capacity->joints, sizeof *guest->given);
  bool bound = hapi_bound_create(&guest->bound, capacity->bodies, late_s);
  return bound && guest->state != NULL && guest->bodies != NULL && guest->hands != NULL &&
                 guest->given != NULL
             ? HAP_OK
             : HAP_ERROR_MEMORY;
}

void hapi_guest_finish(hapi_guest *guest)
{
  hapi_bound_finish(&guest->bound);
  hapi_scenery_finish(&guest->scenery);
  hapi_free(guest->state);
  hapi_free(guest->bodies);
  hapi_free(guest->hands);
  hapi_free(guest->given);
  guest->state = NULL;
  guest->bodies = NULL;
  guest->hands = NULL;
  guest->given = NULL;
}

void hapi_guest_begin(hapi_guest *guest, int64_t now_ns, const hapi_capacity *capacity)
{
  hapi_bound_reset(&guest->bound, now_ns);
  hapi_scenery_reset(&guest->scenery);
  guest->draws = false;
  memset(guest->bodies, 0, capacity->bodies * sizeof *guest->bodies);
  memset(guest->hands, 0, capacity->pointers * sizeof *guest->hands);
  memset(guest->given, 0, capacity->joints * sizeof *guest->given);
  guest->admitted = guest->fresh = guest->has_state = guest->leaves = false;
  hapi_v3_set(guest->uncounted, 0.0, 0.0, 0.0);
  guest->tick = guest->model_number = 0;
  guest->model_ns = now_ns;
  guest->bounded_ns = guest->flood_ns = 0;
  guest->taken = 0;
}

/* ---- what it tells ---- */

/* Whatever the guest says: it moves what it was given, and pushes on what it was given. The next
 * model may have come to it before physics hears of the last one, so the number counts of the one
 * that it uses. */
static void body_admit(const hapi_guest_body *known, uint64_t model_number, hapi_state_body *io)
{
  io->reserved = 0;
  if (io->generation == 0 || io->generation != known->generation) {
    io->generation = 0;
    return;
  }
  if (model_number > known->owned_to) {
    io->flags &= ~(uint32_t)HAPI_BODY_OWNED;
  }
  if (model_number > known->mine_to) {
    io->generation = 0;
    io->reserved = UNTOLD;
  }
}

static void body_note(hapi_guest *guest, uint32_t slot, const hapi_state_body *in, bool mine)
{
  hapi_guest_body *known = &guest->bodies[slot];
  double told[6];
  hapi_v3_copy(in->impulse, told);
  hapi_v3_copy(in->angular_impulse, told + 3);
  if ((in->generation == 0 && in->reserved == 0) || !hapi_finite(told, 6) ||
      !hapi_finite(in->gain, 6)) {
    return;
  }
  for (int k = 0; k < 6 && in->reserved == UNTOLD; ++k) {
    known->uncounted[k] += told[k] - known->told[k];
  }
  for (int k = 0; k < 3 && !mine; ++k) {
    guest->uncounted[k] += in->gain[k] - known->gain[k];
  }
  memcpy(known->told, told, sizeof known->told);
  memcpy(known->gain, in->gain, sizeof known->gain);
  if (!mine) {
    known->until_ns = in->owned_until_ns;
  }
}

void hapi_guest_own(const hapi_guest *guest, hapi_state *io)
{
  for (uint32_t i = 0; i < io->body_high; ++i) {
    body_admit(&guest->bodies[i], io->model_number, &hapi_state_bodies(io)[i]);
  }
}

bool hapi_guest_admit(hapi_guest *guest, int64_t now_ns, hapi_state *io, hap_detail *why)
{
  hapi_guest_own(guest, io);
  return hapi_bound_take(&guest->bound, now_ns, io, why);
}

void hapi_guest_take(hapi_guest *guest, int64_t now_ns, hapi_state *state, size_t size,
                     const hapi_share *shares, uint8_t number)
{
  for (uint32_t i = 0; i < state->body_high; ++i) {
    body_note(guest, i, &hapi_state_bodies(state)[i], shares[i].of == number);
  }
  if (state->model_number > guest->model_number) {
    guest->model_number = state->model_number;
    guest->model_ns = now_ns;
  }
  if (state != guest->state) {
    memcpy(guest->state, state, size);
  }
  guest->has_state = guest->fresh = true;
}

bool hapi_guest_counted(const hapi_guest *guest, uint32_t slot, uint32_t generation, double out[6])
{
  const hapi_guest_body *known = &guest->bodies[slot];
  if (known->generation != generation) {
    return false;
  }
  for (int k = 0; k < 6; ++k) {
    out[k] = known->told[k] - known->uncounted[k];
  }
  return true;
}

/* ---- it goes ---- */

void hapi_guest_body_let_go(double time_scale, int64_t left_ns, hapi_state_body *io)
{
  if ((io->flags & HAPI_BODY_OWNED) == 0) {
    return;
  }
  io->flags &= ~(uint32_t)HAPI_BODY_OWNED;
  io->owned_until_ns = left_ns;
  io->owned_pose = io->pose;
  io->owned_twist = io->twist;
  for (int k = 0; k < 3 && time_scale > 0.0; ++k) { /* it is in the world's time */
    io->owned_twist.linear[k] /= time_scale;
    io->owned_twist.angular[k] /= time_scale;
  }
}

void hapi_guest_let_go(hapi_guest *guest, double haptic_hz)
{
  hapi_state *last = guest->state;
  guest->leaves = true;
  guest->fresh = guest->has_state;
  if (!guest->has_state) {
    return;
  }
  int64_t left_ns = last->now_ns + llround(1e9 / haptic_hz); /* the end of its tick */
  for (uint32_t i = 0; i < last->body_high; ++i) {
    hapi_guest_body_let_go(last->time_scale, left_ns, &hapi_state_bodies(last)[i]);
  }
  for (uint32_t i = 0; i < last->pointer_count; ++i) {
    hapi_state_pointers(last)[i].generation = 0;
  }
  last->contact_count = last->joint_count = last->spring_count = last->side_count = 0;
}
