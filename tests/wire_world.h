/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TESTS_WIRE_WORLD_H
#define HAPODE_TESTS_WIRE_WORLD_H

/* Models, near messages and states that no session makes: every member has a value of its own, and
 * from step to step some change, some records go and others come. */

#include <math.h>
#include <string.h>

#include "base/vec.h"
#include "sync/exchange.h"

typedef struct wire_dice {
  uint64_t state;
} wire_dice;

static inline uint32_t dice_below(wire_dice *d, uint32_t most)
{
  d->state = d->state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
  return (uint32_t)((d->state >> 33) % most);
}

/* -1 .. 1 */
static inline double dice_unit(wire_dice *d)
{
  return (double)dice_below(d, 1u << 30) / (double)(1u << 29) - 1.0;
}

static inline void dice_fill(wire_dice *d, double *out, int count)
{
  for (int i = 0; i < count; ++i) {
    out[i] = dice_unit(d);
  }
}

static inline void dice_pose(wire_dice *d, hap_pose *out)
{
  dice_fill(d, out->position, 3);
  dice_fill(d, out->quat_wxyz, 4);
  hapi_quat_normalize(out->quat_wxyz);
}

static inline void dice_twist(wire_dice *d, hap_twist *out)
{
  dice_fill(d, out->linear, 3);
  dice_fill(d, out->angular, 3);
}

static const hapi_capacity wire_capacity = {.bodies = 60,
                                            .contacts = 40,
                                            .pairs = 80,
                                            .pointers = 4,
                                            .geoms = 60,
                                            .hull_points = 200,
                                            .joints = 30,
                                            .tool_points = 20,
                                            .springs = 10,
                                            .triangles = 30,
                                            .feels = 8};

/* What is in the world: generations by slot, 0: nothing. */
typedef struct wire_world {
  wire_dice dice;
  hapi_exchange *exchange;
  uint64_t number;
  uint32_t bodies;   /* slots of them */
  uint32_t contacts; /* likewise */
  uint32_t joints;
  uint32_t geoms;
  uint32_t pairs;
  uint32_t rest; /* of 100 bodies so many do not move from step to step */
} wire_world;

/* The next step of the world, into the exchange's places for messages. */
void wire_world_step(wire_world *w, hapi_model **out_model, hapi_near **out_near);
hapi_state *wire_state_step(wire_world *w);

#endif
