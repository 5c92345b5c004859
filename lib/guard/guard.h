/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GUARD_GUARD_H
#define HAPODE_GUARD_GUARD_H

/* The last thing between the simulation and the motors. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/session.h>
#include <hapode/stats.h>

#include "base/effect_clock.h"
#include "local/facts.h"
#include "local/touch.h"
#include "pointer/pointer.h"

/* The first fault since the last reset. */
typedef struct hapi_fault_latch {
  hap_fault fault;
  uint32_t pointer;    /* index + 1 of the pointer that it came from; 0: none of them */
  uint32_t generation; /* of that pointer, which may have gone since */
  uint64_t count;
} hapi_fault_latch;

/* How late ticks come. */
typedef struct hapi_lateness {
  double elapsed_s; /* between the last two, at least T */
  double few_s;     /* lost time, of which a little a second is forgotten */
  double lost_s;    /* lost under force, of which half of all time is forgotten */
  double gap_s;     /* the longest of the last gaps that count, shrinking */
  double hold_s;    /* for so long more the gap counts */
  double slew_s;    /* for so long more after a long gap the force changes slowly */
  double fade_s;    /* after the fault: until the force is gone */
  double fade;      /* 0..1, share of the last force that this tick keeps of it */
  bool in_touch;    /* a gap counted since something is felt without a break */
  uint64_t derated_ticks;
} hapi_lateness;

/* What the guard keeps of the whole loop. */
typedef struct hapi_guard {
  hap_guard mode;
  double age_loss; /* 0..1, share of the force that the age of the local model has taken */
  bool stale;
  uint64_t stale_times;
  uint64_t stale_ticks;
  uint64_t slewed_ticks;
  uint64_t energy_ticks;
  uint64_t oscillation_ticks;
  uint64_t saturated_ticks;
  double peak_force; /* N */
  double balance;    /* J, world units: what the hands and the world have put in and not got back */
  double stored_max; /* J, largest energy of the pointer springs and owned bodies */
  double sprung;     /* J, sum over the contacts of the last tick */
  double touch_s;    /* s, since something is felt without a break */
  int64_t observed_ns; /* time of the last tick */
  hapi_lateness late;
  hapi_fault_latch latch;
} hapi_guard;

/* N/m, of the pointer or of what it may touch. */
static inline double hapi_pointer_stiffest(const hapi_pointer *p)
{
  return p->surface.stiffness > p->surface.hardest ? p->surface.stiffness : p->surface.hardest;
}

#endif
