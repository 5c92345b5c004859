/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "world/awake.h"

#include "base/assert.h"
#include "world/world.h"

/* A search that is in vain costs a seventh of a collision phase: after one in vain few phases go by
 * without, after several in a row more, so that they cost a hundredth. */
#define AWAKE_FAILURES_MOST 4u
#define AWAKE_WAITS_MOST (1u << AWAKE_FAILURES_MOST)

bool hapi_awake_begin(hapi_world *world)
{
  hapi_awake *awake = &world->awake;
  uint32_t asleep = 0;
  awake->failures = awake->alone ? 0 : awake->failures; /* the last one held to its end */
  awake->count = 0;
  awake->alone = false;
  if (awake->waits > 0) {
    --awake->waits;
    return false;
  }
  for (uint32_t i = 0; i < world->bodies.high; ++i) {
    const hapi_known_body *known = &world->bodies.entries[i];
    if (known->body == NULL || known->rest->geom != NULL) { /* a carrier is in no contact joint */
      continue;
    }
    if (!dBodyIsEnabled(known->body)) {
      ++asleep;
    } else if (!known->loop_owned && !hapi_awake_add(awake, known->body)) {
      return false;
    }
  }
  awake->alone = asleep > HAPI_AWAKE_MOST;
  return awake->alone;
}

uint32_t hapi_awake_find(const hapi_awake *awake, dBodyID body)
{
  for (uint32_t i = 0; i < awake->count; ++i) {
    if (awake->bodies[i] == body) {
      return i;
    }
  }
  return HAPI_NONE;
}

bool hapi_awake_add(hapi_awake *awake, dBodyID body)
{
  if (body == NULL || hapi_awake_find(awake, body) != HAPI_NONE) {
    return true;
  }
  if (awake->count == HAPI_AWAKE_MOST) {
    return false;
  }
  awake->bodies[awake->count++] = body;
  return true;
}

bool hapi_awake_add_partners(hapi_awake *awake, dBodyID body)
{
  HAPI_ASSERT(body != NULL);
  int count = dBodyGetNumJoints(body);
  bool room = true;
  for (int i = 0; i < count && room; ++i) {
    dJointID joint = dBodyGetJoint(body, i);
    room = !dJointIsEnabled(joint) || (hapi_awake_add(awake, dJointGetBody(joint, 0)) &&
                                       hapi_awake_add(awake, dJointGetBody(joint, 1)));
  }
  return room;
}

void hapi_awake_end(hapi_awake *awake)
{
  awake->alone = false;
  awake->waits = AWAKE_WAITS_MOST >> (AWAKE_FAILURES_MOST - awake->failures);
  awake->failures += awake->failures < AWAKE_FAILURES_MOST;
}
