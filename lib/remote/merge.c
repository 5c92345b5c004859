/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "remote/merge.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/vec.h"

bool hapi_merge_create(hapi_merge *merge, const hapi_capacity *capacity)
{
  merge->bodies = hapi_alloc_array(capacity->bodies, sizeof *merge->bodies);
  merge->given = hapi_alloc_array(capacity->joints, sizeof *merge->given);
  if (merge->bodies == NULL || merge->given == NULL) {
    return false;
  }
  merge->body_count = capacity->bodies;
  merge->joint_count = capacity->joints;
  return true;
}

void hapi_merge_finish(hapi_merge *merge)
{
  hapi_free(merge->bodies);
  hapi_free(merge->given);
  merge->bodies = NULL;
  merge->given = NULL;
}

/* ---- bodies ---- */

/* What the guest says of the body; NULL: nothing. */
static const hapi_state_body *body_told(const hapi_guest *guest, uint32_t slot, uint32_t generation)
{
  if (!guest->has_state || slot >= guest->state->body_high) {
    return NULL;
  }
  const hapi_state_body *body = &hapi_state_bodies(guest->state)[slot];
  return body->generation == generation && generation != 0 ? body : NULL;
}

static void impulse_sum(const hapi_merge *merge, const hapi_merge_from *from, uint32_t slot,
                        uint32_t generation, hapi_state_body *out)
{
  double sum[6] = {0.0};
  if (merge->bodies[slot].generation == generation) {
    memcpy(sum, merge->bodies[slot].impulse, sizeof sum);
  }
  for (uint32_t i = 0; i < from->count; ++i) {
    double counted[6];
    if (hapi_guest_counted(&from->guests[i], slot, generation, counted)) {
      for (int k = 0; k < 6; ++k) {
        sum[k] += counted[k];
      }
    }
  }
  hapi_v3_copy(sum, out->impulse);
  hapi_v3_copy(sum + 3, out->angular_impulse);
}

/* In the time of the merge, which is that of the newest model of all guests. */
static void body_change_time(double scale, hapi_state_body *io)
{
  if (scale != 1.0) {
    hapi_v3_scale(scale, io->twist.linear, io->twist.linear);
    hapi_v3_scale(scale, io->twist.angular, io->twist.angular);
  }
}

static double time_ratio(double to, double from)
{
  return to > 0.0 && from > 0.0 ? to / from : 1.0;
}

/* The loop that moved it goes on with it elsewhere, or not at all: for the world it lets go of it
 * now, until the next one has it. */
static bool body_hand_over(const hapi_merge_from *from, hapi_share *share, uint32_t slot,
                           hapi_state_body *out)
{
  uint8_t before = share->before;
  share->before = HAPI_GUEST_NONE;
  if (before == HAPI_GUEST_NONE) {
    return false;
  }
  const hapi_state_body *told = body_told(&from->guests[before], slot, share->generation);
  if (told == NULL || (told->flags & HAPI_BODY_OWNED) == 0) {
    return false;
  }
  const hapi_state *state = from->guests[before].state;
  *out = *told;
  hapi_guest_body_let_go(state->time_scale, state->now_ns, out);
  return true;
}

static void body_merge(const hapi_merge *merge, const hapi_merge_from *from, uint32_t slot,
                       double time_scale, hapi_state_body *out)
{
  hapi_share *share = &from->shares->of[slot];
  hapi_guest *guest = share->of != HAPI_GUEST_NONE ? &from->guests[share->of] : NULL;
  const hapi_state_body *told = guest != NULL ? body_told(guest, slot, share->generation) : NULL;
  bool has = told != NULL && (told->flags & HAPI_BODY_OWNED) != 0;
  memset(out, 0, sizeof *out);
  if (has || !body_hand_over(from, share, slot, out)) {
    if (told == NULL || !(guest->fresh || has)) {
      return; /* what the loop only pushes is told once */
    }
    share->before = HAPI_GUEST_NONE;
    *out = *told;
    bool old = told->owned_until_ns <= guest->bodies[slot].until_ns;
    out->owned_until_ns = old ? 0 : told->owned_until_ns;
    body_change_time(time_ratio(time_scale, guest->state->time_scale), out);
  }
  out->reserved = 0;
  impulse_sum(merge, from, slot, share->generation, out);
}

/* ---- totals of loops ---- */

static void totals_add(const hapi_guest *guest, hapi_merge_totals *io)
{
  const hapi_state *state = guest->state;
  for (int k = 0; k < 3; ++k) {
    io->hand_impulse[k] += state->hand_impulse[k] - guest->uncounted[k];
    io->owned_impulse[k] += state->owned_impulse[k] - guest->uncounted[k];
  }
  io->load.ticks += state->load.ticks;
  io->load.over += state->load.over;
  io->load.spent_ns += state->load.spent_ns;
  io->work.ticks += state->work.ticks;
  io->work.done += state->work.done;
  io->work.spent_ns += state->work.spent_ns;
  io->work.late += state->work.late;
}

static uint32_t larger_of(uint32_t a, uint32_t b)
{
  return a > b ? a : b;
}

static void facts_add(const hapi_state *state, hapi_state *io)
{
  io->now_ns = state->now_ns > io->now_ns ? state->now_ns : io->now_ns;
  io->derated = io->derated || state->derated;
  io->swings = io->swings || state->swings;
  io->texture_out = io->texture_out || state->texture_out;
  io->force_out = larger_of(io->force_out, state->force_out);
  io->unsolved = larger_of(io->unsolved, state->unsolved);
  io->work.rows = larger_of(io->work.rows, state->work.rows);
  io->work.owned = larger_of(io->work.owned, state->work.owned);
  io->work.awake = larger_of(io->work.awake, state->work.awake);
}

/* What no loop uses any more can go: slots are waited for by the loop that is farthest behind. */
static uint64_t model_used(const hapi_merge_from *from)
{
  uint64_t least = from->model_number;
  for (uint32_t i = 0; i < from->count; ++i) {
    const hapi_guest *guest = &from->guests[i];
    bool waits = guest->has_state && !guest->leaves && guest->model_number > 0 &&
                 from->now_ns - guest->model_ns < from->late_ns;
    least = waits && guest->model_number < least ? guest->model_number : least;
  }
  return least;
}

/* ---- contacts, joints, hands ---- */

static void contacts_merge(const hapi_merge_from *from, uint32_t number, hapi_state *out,
                           uint32_t most)
{
  hapi_state *state = from->guests[number].state;
  for (uint32_t i = 0; i < state->contact_count && out->contact_count < most; ++i) {
    const hapi_state_contact *in = &hapi_state_contacts(state)[i];
    if (from->contact_guests[in->slot] == number) {
      hapi_state_contacts(out)[out->contact_count++] = *in;
    }
  }
}

/* Of the loop that moves its first body what it gave since the last state. */
static void joints_merge(hapi_merge *merge, const hapi_merge_from *from, uint32_t number,
                         hapi_state *out)
{
  hapi_guest *guest = &from->guests[number];
  for (uint32_t i = 0; i < guest->state->joint_count && out->joint_count < merge->joint_count;
       ++i) {
    const hapi_state_joint *in = &hapi_state_joints(guest->state)[i];
    hapi_state_joint *told = &guest->given[in->slot];
    hapi_state_joint *sum = &merge->given[in->slot];
    if (told->generation != in->generation) {
      *told = (hapi_state_joint){.generation = in->generation};
    }
    if (sum->generation != in->generation) {
      *sum = (hapi_state_joint){.slot = in->slot, .generation = in->generation};
    }
    bool mine = in->body_a < merge->body_count && from->shares->of[in->body_a].of == number;
    if (mine) {
      sum->body_a = in->body_a;
      sum->given.seconds += in->given.seconds - told->given.seconds;
      for (int k = 0; k < 12; ++k) {
        (&sum->given.impulse[0][0])[k] +=
            (&in->given.impulse[0][0])[k] - (&told->given.impulse[0][0])[k];
      }
      hapi_state_joints(out)[out->joint_count++] = *sum;
    }
    *told = *in;
  }
}

static void hands_merge(const hapi_merge_from *from, uint32_t number, hapi_state *out)
{
  const hapi_guest *guest = &from->guests[number];
  for (uint32_t i = 0; i < guest->state->pointer_count; ++i) {
    const hapi_state_pointer *in = &hapi_state_pointers(guest->state)[i];
    const hapi_guest_hand *hand = &guest->hands[i];
    if (in->generation == 0 || hand->generation != in->generation) {
      continue;
    }
    hapi_state_pointer *to = &hapi_state_pointers(out)[hand->number];
    *to = *in;
    to->generation = from->shares->hands[hand->number].generation;
    if (in->is_tool != 0) {
      hapi_state_hulls(out)[hand->number] = hapi_state_hulls(guest->state)[i];
    }
  }
}

static void sides_merge(const hapi_merge_from *from, uint32_t number, hapi_state *out,
                        uint32_t most)
{
  const hapi_guest *guest = &from->guests[number];
  for (uint32_t i = 0; i < guest->state->side_count && out->side_count < most; ++i) {
    hapi_tool_side side = hapi_state_sides(guest->state)[i];
    bool own =
        side.pointer < guest->state->pointer_count && guest->hands[side.pointer].generation != 0;
    if (own) {
      side.pointer = guest->hands[side.pointer].number;
      hapi_state_sides(out)[out->side_count++] = side;
    }
  }
}

/* ---- the message ---- */

static double time_scale_of(const hapi_merge_from *from)
{
  double scale = 1.0;
  uint64_t newest = 0;
  for (uint32_t i = 0; i < from->count; ++i) {
    const hapi_guest *guest = &from->guests[i];
    if (guest->has_state && guest->state->model_number >= newest) {
      newest = guest->state->model_number;
      scale = guest->state->time_scale;
    }
  }
  return scale;
}

static void head_clear(hapi_state *out)
{
  const hapi_state head = *out;
  *out = (hapi_state){.pointer_count = head.pointer_count,
                      .bodies_offset = head.bodies_offset,
                      .contacts_offset = head.contacts_offset,
                      .pointers_offset = head.pointers_offset,
                      .hulls_offset = head.hulls_offset,
                      .spring_capacity = head.spring_capacity,
                      .springs_offset = head.springs_offset,
                      .joints_offset = head.joints_offset,
                      .sides_offset = head.sides_offset,
                      .model = HAP_MODEL_CONTACT};
  for (uint32_t i = 0; i < out->pointer_count; ++i) {
    hapi_state_pointers(out)[i].generation = 0;
  }
}

bool hapi_merge_make(hapi_merge *merge, const hapi_merge_from *from, hapi_state *out,
                     const hapi_capacity *capacity)
{
  hapi_merge_totals totals = merge->gone;
  bool any = false;
  head_clear(out);
  out->time_scale = time_scale_of(from);
  for (uint32_t i = 0; i < from->count; ++i) {
    const hapi_guest *guest = &from->guests[i];
    if (!guest->has_state) {
      continue;
    }
    any = true;
    totals_add(guest, &totals);
    facts_add(guest->state, out);
    out->body_high = larger_of(out->body_high, guest->state->body_high);
    contacts_merge(from, i, out, capacity->contacts);
    hands_merge(from, i, out);
    sides_merge(from, i, out, capacity->tool_points);
    if (guest->fresh) {
      joints_merge(merge, from, i, out);
    }
  }
  if (!any) {
    return false;
  }
  for (uint32_t i = 0; i < out->body_high; ++i) {
    body_merge(merge, from, i, out->time_scale, &hapi_state_bodies(out)[i]);
  }
  hapi_v3_copy(totals.hand_impulse, out->hand_impulse);
  hapi_v3_copy(totals.owned_impulse, out->owned_impulse);
  totals.work.rows = out->work.rows;
  totals.work.owned = out->work.owned;
  totals.work.awake = out->work.awake;
  out->load = totals.load;
  out->work = totals.work;
  out->tick = ++merge->tick;
  out->model_number = model_used(from);
  return true;
}

void hapi_merge_leave(hapi_merge *merge, const hapi_shares *shares, hapi_guest *guest)
{
  for (uint32_t i = 0; i < merge->body_count; ++i) {
    hapi_merge_gone *gone = &merge->bodies[i];
    double counted[6];
    if (!hapi_guest_counted(guest, i, shares->of[i].generation, counted)) {
      continue;
    }
    if (gone->generation != shares->of[i].generation) {
      *gone = (hapi_merge_gone){.generation = shares->of[i].generation};
    }
    for (int k = 0; k < 6; ++k) {
      gone->impulse[k] += counted[k];
    }
  }
  if (guest->has_state) {
    totals_add(guest, &merge->gone);
  }
}
