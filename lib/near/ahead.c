/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "near/ahead.h"

#include <math.h>
#include <stdlib.h>

#include <hapode/expert.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/clock.h"
#include "base/vec.h"
#include "near/near.h"

/* What moves by itself and may come to a pointer, long before it is a neighbour. A step of ODE puts
 * a change of velocity at its begin: what falls or is driven comes up to half a step too early, and
 * nothing tells afterwards by how much. Mechanisms come apart in it. In the loop both are right, so
 * the loop takes them as long as it has room, the soonest first. Bodies that touch each other are
 * taken together or not at all: the range gets no new border here. */

#define LOOK_AHEAD_S 0.5       /* and what the session looks ahead */
#define LOOK_KEEPS 1.2         /* times that, for what the loop has: not given back at once */
#define LOOK_FLOOR 0.005       /* m */
#define LOOK_ACCELERATION 15.0 /* m/s^2, that a body may have beside its velocity */
#define STILL_S 0.25           /* at rest for that long: it does not move by itself */
#define STILL_LEAST 4          /* cycles */
#define OPEN_MOST 1e-3         /* m, of a joint that ODE holds */
#define REFUSED_FOR 10u        /* models, in which an island that found no room is not looked at */
#define ROWS_PER_PAIR 3u       /* that comes near: few of them touch */
#define ROWS_PER_JOINT 6u
#define UPDATES_RESERVED 16u /* with a reserve of as many again */

static const hapi_known_body *known_body(const hapi_nearby *nearby, uint32_t known)
{
  return &nearby->world->bodies.entries[known];
}

/* ---- who may come ---- */

static bool body_is_still(const hapi_nearby *nearby, const hapi_known_body *known)
{
  double cycles = STILL_S / nearby->cycle->probe_step_s;
  return known->still >= fmax(cycles, STILL_LEAST);
}

/* By a walk of this model, or not long ago without room. */
static bool body_is_done(const hapi_nearby *nearby, uint32_t known)
{
  const hapi_visit *visit = &nearby->visits[known];
  uint64_t number = nearby->range.number;
  return visit->ranged_in == number || (visit->refused_in != 0 && visit->refused_in <= number &&
                                        number - visit->refused_in < REFUSED_FOR);
}

static bool body_may_come(const hapi_nearby *nearby, uint32_t known)
{
  dBodyID body = known_body(nearby, known)->body;
  return body != NULL && dBodyIsEnabled(body) && !body_is_done(nearby, known);
}

/* The loop needs nothing but its number, and learns how it goes. */
static bool body_is_driven(const hapi_nearby *nearby, uint32_t known)
{
  return dBodyIsKinematic(known_body(nearby, known)->body) != 0;
}

/* s: when the body may touch a pointer, with its velocity and any acceleration of that size. */
static double body_arrival(const hapi_nearby *nearby, const hapi_known_body *known)
{
  const hapi_state_pointer *pointers = hapi_state_pointers(nearby->cycle->state);
  hap_twist twist;
  hapi_extent_twist(known, &twist);
  double spin = known->extent * hapi_v3_norm(twist.angular);
  double soonest = HUGE_VAL;
  for (uint32_t i = 0; i < nearby->cycle->state->pointer_count; ++i) {
    double way[3];
    double closing[3];
    if (pointers[i].generation == 0) {
      continue;
    }
    double size = pointers[i].is_tool != 0 ? pointers[i].extent : pointers[i].radius;
    hapi_v3_sub(dBodyGetPosition(known->body), pointers[i].pose.position, way);
    hapi_v3_sub(twist.linear, pointers[i].twist.linear, closing);
    double distance = fmax(hapi_v3_norm(way) - known->extent - size - LOOK_FLOOR, 0.0);
    double speed = hapi_v3_norm(closing) + spin;
    double a = LOOK_ACCELERATION;
    soonest = fmin(soonest, (sqrt(speed * speed + 2.0 * a * distance) - speed) / a);
  }
  return soonest;
}

static void comer_add(hapi_nearby *nearby, uint32_t known, double arrival_s)
{
  hapi_ahead *ahead = &nearby->range.ahead;
  if (!hapi_reserve((void **)&ahead->comers, &ahead->capacity, ahead->count, 1,
                    sizeof *ahead->comers)) {
    ++nearby->counts.dropped;
    return;
  }
  ahead->comers[ahead->count++] = (hapi_comer){known, arrival_s};
}

static void comers_collect(hapi_nearby *nearby)
{
  double look_s = LOOK_AHEAD_S + nearby->cycle->config->look_ahead_s;
  for (uint32_t i = 0; i < nearby->world->bodies.high; ++i) {
    const hapi_known_body *known = known_body(nearby, i);
    if (known->body == NULL || body_is_still(nearby, known) || !body_may_come(nearby, i)) {
      continue;
    }
    double arrival_s = body_arrival(nearby, known);
    if (arrival_s <= (known->loop_owned ? LOOK_KEEPS : 1.0) * look_s) {
      comer_add(nearby, i, arrival_s);
    } else if (known->loop_owned && known->jointed && !body_is_driven(nearby, i)) {
      comer_add(nearby, i, HUGE_VAL); /* until it rests */
    }
  }
  const hapi_joint_table *joints = &nearby->world->joints;
  for (uint32_t i = 0; i < joints->count; ++i) {
    uint32_t known = joints->entries[i].index[0];
    if (known != HAPI_NONE && body_may_come(nearby, known) && !body_is_driven(nearby, known) &&
        dJointIsEnabled(joints->entries[i].joint) &&
        hapi_joint_open(&joints->entries[i]) > OPEN_MOST) {
      comer_add(nearby, known, HUGE_VAL);
    }
  }
}

static int comer_by_arrival(const void *a, const void *b)
{
  const hapi_comer *x = a;
  const hapi_comer *y = b;
  int by_time = (x->arrival_s > y->arrival_s) - (x->arrival_s < y->arrival_s);
  return by_time != 0 ? by_time : (x->known > y->known) - (x->known < y->known);
}

/* ---- whether there is room for it and all that it touches ---- */

static bool island_add(hapi_nearby *nearby, uint32_t known)
{
  hapi_range *range = &nearby->range;
  hapi_ahead *ahead = &nearby->range.ahead;
  hapi_visit *visit = &nearby->visits[known];
  if (visit->island_in == range->number) {
    return true;
  }
  if (ahead->island_count + range->owned >= hapi_range_most(nearby->cycle)) {
    return false;
  }
  HAPI_ASSERT_INDEX(ahead->island_count, nearby->cycle->config->capacity.bodies);
  visit->island_in = range->number;
  ahead->island[ahead->island_count++] = known;
  return true;
}

/* A body that was gathered and is not of the island belongs to a mechanism without room. */
static bool island_add_met(hapi_nearby *nearby, uint32_t known)
{
  const hapi_visit *visit = &nearby->visits[known];
  bool refused =
      visit->gathered_in == nearby->range.number && visit->island_in != nearby->range.number;
  return !refused && island_add(nearby, known);
}

static bool island_add_mechanism(hapi_nearby *nearby, uint32_t known)
{
  const hapi_mechanism *mechanism = &nearby->range.mechanism;
  if (nearby->visits[known].gathered_in == nearby->range.number) {
    return true; /* with another of its bodies */
  }
  bool good = hapi_mechanism_gather(nearby, known);
  for (uint32_t i = 0; i < mechanism->moving; ++i) {
    good = island_add(nearby, mechanism->members[i]) && good;
  }
  return good;
}

static bool island_add_links(hapi_nearby *nearby, uint32_t known, hapi_range_need *io)
{
  hapi_ahead *ahead = &nearby->range.ahead;
  const hapi_range *range = &nearby->range;
  hapi_range_links(nearby, known_body(nearby, known));
  if (!hapi_range_can_own(nearby, known_body(nearby, known), io)) {
    return false;
  }
  for (uint32_t i = 0; i < range->links.count; ++i) {
    const hapi_link *link = &range->links.list[i];
    bool has_end = link->body == NULL || dBodyIsKinematic(link->body);
    ahead->half_pairs += has_end ? 2 : 1; /* others are met from both sides */
    if (has_end) {
      continue;
    }
    HAPI_ASSERT_INDEX(link->known, nearby->world->bodies.high); /* can_own has asked for it */
    if (body_is_done(nearby, link->known) || !island_add_met(nearby, link->known)) {
      return false;
    }
  }
  return true;
}

/* Of the tick: what a solve may spend goes for the range's rows. */
static bool tick_has_room(const hapi_nearby *nearby)
{
  const hapi_range *range = &nearby->range;
  uint32_t rows = ROWS_PER_PAIR * (range->near->pair_count + nearby->range.ahead.half_pairs / 2) +
                  ROWS_PER_JOINT * range->mechanism.joint_count;
  return rows <= nearby->cycle->settings.row_updates / UPDATES_RESERVED;
}

/* What gathering has noted is undone: the walk that takes the island gathers again. */
static void island_leave(hapi_nearby *nearby, uint32_t joints_before, bool fits)
{
  hapi_range *range = &nearby->range;
  for (uint32_t i = 0; i < nearby->range.ahead.island_count; ++i) {
    hapi_visit *visit = &nearby->visits[nearby->range.ahead.island[i]];
    visit->gathered_in = fits ? 0 : visit->gathered_in;
    visit->refused_in = fits ? 0 : range->number;
  }
  for (uint32_t i = joints_before; fits && i < range->mechanism.joint_count; ++i) {
    nearby->world->joints.entries[range->mechanism.joints[i]].gathered_in = 0;
  }
  range->mechanism.joint_count = joints_before;
}

static bool island_fits(hapi_nearby *nearby, uint32_t known)
{
  hapi_range *range = &nearby->range;
  hapi_range_need need = {0, 0, 0};
  uint32_t joints_before = range->mechanism.joint_count;
  nearby->range.ahead.island_count = nearby->range.ahead.half_pairs = 0;
  bool fits = island_add_met(nearby, known);
  for (uint32_t i = 0; fits && i < nearby->range.ahead.island_count; ++i) {
    fits = island_add_mechanism(nearby, nearby->range.ahead.island[i]) &&
           island_add_links(nearby, nearby->range.ahead.island[i], &need) && tick_has_room(nearby);
  }
  island_leave(nearby, joints_before, fits);
  return fits;
}

static void ahead_walk(hapi_nearby *nearby)
{
  hapi_range *range = &nearby->range;
  hapi_ahead *ahead = &nearby->range.ahead;
  ahead->count = 0;
  if (hapi_wish_is_off(nearby->cycle->wishes, HAP_EFFECT_RANGE) ||
      nearby->cycle->settings.range_hops != HAP_RANGE_ALL ||
      range->owned >= hapi_range_most(nearby->cycle) ||
      nearby->visit_capacity < nearby->world->bodies.high) { /* no memory for what walks note */
    return;
  }
  comers_collect(nearby);
  if (ahead->count > 0) { /* else there may be no memory, which qsort may not be given */
    qsort(ahead->comers, ahead->count, sizeof *ahead->comers, comer_by_arrival);
  }
  range->hops = 0;
  for (uint32_t i = 0; i < ahead->count; ++i) {
    uint32_t known = ahead->comers[i].known;
    if (body_is_done(nearby, known)) {
      continue;
    }
    bool fits = body_is_driven(nearby, known) ? range->count < nearby->cycle->config->max_bodies
                                              : island_fits(nearby, known);
    if (fits && !hapi_range_follow(nearby, known)) {
      return;
    }
  }
}

void hapi_ahead_range(hapi_nearby *nearby, uint32_t hit_count)
{
  if (nearby->cycle->model != HAP_MODEL_CONTACT || nearby->cycle->state == NULL) {
    return;
  }
  hapi_range_walk(nearby, hit_count);
  int64_t begin_ns = hapi_clock_now();
  ahead_walk(nearby);
  nearby->counts.beyond_s += 1e-9 * (double)(hapi_clock_now() - begin_ns);
  hapi_range_end(nearby, hit_count);
}
