/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_BODY_STILL_H
#define HAPODE_LOCAL_BODY_STILL_H

/* Islands that stand still. Bodies that touch each other and the static world, and of which none
 * has moved by more than creeping for a while, are put at rest: their velocities are 0, and the
 * impulses that hold them stay as they are. Their contacts then have no rows, and their solution is
 * that of the tick before. An island is still as a whole, and wakes as a whole in the tick in which
 * anything that its rows would depend on is another: a bit of a pose, velocity or free velocity of
 * a body, its mass, a contact that came, went or changed its surface, a row of a pointer or joint,
 * or something that comes so near that it would have rows. */

#include "base/assert.h"
#include "local/body.h"
#include "local/body_step.h"
#include "local/contact_memory.h"
#include "local/rows.h"

/* m/s: what softness lets a contact creep by, and rounding. 2e-9 m/s are 7 um in an hour. The turn
 * counts at an arm. */
#define HAPI_STILL_SPEED 2e-9
#define HAPI_STILL_ARM 0.1 /* m */

/* s, in which the motion has not grown by more than the next: what falls over from its edge begins
 * as slowly as creeping does, but gains speed. An acceleration of 2e-10 m/s^2 is not seen. */
#define HAPI_STILL_TIME 0.1
#define HAPI_STILL_GROWTH 1.01
#define HAPI_STILL_NOISE 1e-12 /* m/s: less is rounding */

static inline bool hapi_body_is_still(const hapi_local_body *body)
{
  return body != NULL && body->stay.still.island != 0;
}

/* One of the bodies of its island, the same for all of them. */
static inline hapi_body_still *hapi_still_island(const hapi_bodies *bodies,
                                                 const hapi_local_body *body)
{
  HAPI_ASSERT_INDEX(body->stay.still.island - 1, bodies->high);
  return &bodies->of[body->stay.still.island - 1].stay.still;
}

/* The island wakes in this tick, by hapi_still_check (still_islands.h). */
static inline void hapi_still_end(const hapi_bodies *bodies, const hapi_local_body *body)
{
  if (hapi_body_is_still(body)) {
    hapi_still_island(bodies, body)->ends = true;
  }
}

/* Counts the ticks in which a body hardly moves. After hapi_stay_follow. */
static inline void hapi_still_follow(hapi_local_body *body)
{
  hapi_body_still *still = &body->stay.still;
  double motion = body->stay.speed + HAPI_STILL_ARM * body->stay.spin;
  if (!(motion <= HAPI_STILL_SPEED)) {
    still->quiet = 0;
  } else if (still->quiet == 0 || motion > HAPI_STILL_GROWTH * still->motion) {
    still->quiet = 1;
    still->motion = hapi_max(motion, HAPI_STILL_NOISE);
  } else {
    ++still->quiet;
  }
}

static inline bool hapi_still_is_quiet(const hapi_local_body *body, double period)
{
  return period * body->stay.still.quiet >= HAPI_STILL_TIME;
}

/* Whether a still body is as it was, before anything of this tick touches it. After row, flags and
 * waiting. */
static inline bool hapi_still_holds(const hapi_local_body *body, double period)
{
  static const hap_twist none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const hapi_body_stay *stay = &body->stay;
  double free[6];
  if (stay->number != stay->still.stay || stay->row != body->row || body->waiting ||
      stay->flags != (body->flags & HAPI_STAY_FLAGS) ||
      memcmp(&body->twist, &none, sizeof none) != 0 ||
      memcmp(&body->pose, &stay->still.pose, sizeof body->pose) != 0) {
    return false;
  }
  hapi_body_free_velocity(body, period, free); /* start_twist is 0 as well */
  return memcmp(free, stay->still.free, sizeof free) == 0;
}

/* Whether the contact is one of a still island: its rows are left out. */
static inline bool hapi_contact_is_still(const hapi_contact_kept *kept, const hapi_local_body *a,
                                         const hapi_local_body *b)
{
  return kept->what == HAPI_KEPT_ROWS && (hapi_body_is_still(a) || a == NULL) &&
         (hapi_body_is_still(b) || b == NULL) && hapi_stay_number(a) == kept->stay_a &&
         hapi_stay_number(b) == kept->stay_b;
}

#endif
