/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_TICK_H
#define HAPODE_TICK_TICK_H

/* The pure tick: what the haptic thread computes at 1 kHz and more, from the pointers' device poses
 * to the wrenches for the devices. No allocation, lock, system call, log or function pointer in
 * it, but for functions of textures and the clock that times those. All memory is handed over by
 * hapi_tick_reset's caller.
 *
 *   pointer   device pose -> pointer                               (paper step a)
 *   paper     pointer and planes -> forces -> motion of the neighbours: eq. 7-11
 *   local     model CONTACT: the same in one solve, of rows that the solver knows
 *   guard     checks, shares, limits -> device wrench
 *   report    state for physics; trace row; hash; black box
 *
 * Each part has a struct of its own and knows those before it. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/trace.h>

#include "base/effect_clock.h"
#include "guard/guard.h"
#include "local/body.h"
#include "local/contact_memory.h"
#include "local/facts.h"
#include "local/joint_rows.h"
#include "local/rows.h"
#include "local/touch.h"
#include "pointer/axes.h"
#include "pointer/pointer.h"
#include "sync/messages.h"
#include "tick/outputs.h"
#include "tick/own_forces.h"
#include "tick/own_push.h"

/* What the trace shows besides the pointers. */
typedef struct hapi_tick_watch {
  uint32_t count;
  uint32_t slot[HAP_TRACE_BODIES_MAX];
  double position[HAP_TRACE_BODIES_MAX][3];
} hapi_tick_watch;

typedef struct hapi_tick {
  hapi_capacity capacity;
  hapi_tick_facts facts;
  hapi_pointers pointers;
  hapi_own_force *own;   /* HAP_FORCES_MAX of each pointer */
  hapi_axes *axes;       /* by pointer, of those that have some */
  hapi_outputs *outputs; /* by pointer, of those that drive some */
  hapi_bodies bodies;
  hapi_touches touches;
  hapi_body_contacts contacts;
  hapi_joints joints;
  hapi_rows rows;
  hapi_guard guard;
  hapi_effect_sample sample;
  hapi_tick_watch watch;
  bool hashing; /* lockstep */
  uint64_t hash;
} hapi_tick;

/* One of the arrays of a tick, as its owner allocates it. */
typedef struct hapi_tick_array {
  void *at; /* address of the pointer to it */
  size_t count;
  size_t size; /* of an element */
  bool stays;  /* hapi_tick_reset does not touch it */
} hapi_tick_array;

#define HAPI_TICK_ARRAYS 48

/* All of them; the capacity, and that of rows, buckets and work, are set. */
void hapi_tick_arrays(hapi_tick *tick, hapi_tick_array out[HAPI_TICK_ARRAYS]);

/* Zeroes the state; arrays, capacity, period, hashing and the guard's mode are set by the caller
 * before. */
void hapi_tick_reset(hapi_tick *tick);

void hapi_tick_adopt(hapi_tick *tick, hapi_model *model, int64_t now_ns);

/* The set stays in use, and must stay as it is, until the next call. */
void hapi_tick_adopt_patches(hapi_tick *tick, hapi_patches *patches);

/* One tick at now_ns, from the pose and twist of the pointers' devices to their wrench: read, and
 * what follows on it. */
void hapi_tick_run(hapi_tick *tick, int64_t now_ns);

/* Latches the first one. pointer: index + 1 of the one that it came from; 0: none of them. */
void hapi_tick_fault(hapi_tick *tick, hap_fault fault, uint32_t pointer);
void hapi_tick_reset_fault(hapi_tick *tick);

/* ---- parts of hapi_tick_run ---- */

void hapi_tick_read(hapi_tick *tick, int64_t now_ns); /* devices -> pointers */
void hapi_tick_answer(hapi_tick *tick);               /* pointers -> devices */
void hapi_contact_step(hapi_tick *tick);              /* model CONTACT */
void hapi_tick_guard(hapi_tick *tick);                /* world wrenches -> device wrenches */

static inline hapi_own_pushing hapi_tick_pushing(hapi_tick *tick)
{
  return (hapi_own_pushing){.facts = &tick->facts,
                            .pointers = &tick->pointers,
                            .own = tick->own,
                            .bodies = &tick->bodies,
                            .touches = &tick->touches,
                            .rows = &tick->rows};
}

#endif
