/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_CONTACT_CALL_H
#define HAPODE_WORLD_CONTACT_CALL_H

/* The application is asked about contacts, one by one: of the world's step by physics, of the loop
 * by the contact thread. */

#include <stdbool.h>

#include <hapode/ode.h>
#include <hapode/stats.h>

#include "base/verdicts.h"
#include "sync/messages.h"

/* Does not change while the session runs: two threads read it. */
typedef struct hapi_contact_caller {
  hap_contact_fn call; /* NULL: nobody is asked */
  void *user;
  /* [any] As in hapi_physics_config. */
  void (*report)(void *user, hap_fault fault, const char *text);
  void *report_user;
} hapi_contact_caller;

typedef enum hapi_asking_mode {
  HAPI_ASKING_ONLY = 0,
  HAPI_ASKING_RECORDS = 1,
  HAPI_ASKING_PLAYS = 2 /* the verdicts come from a recording, and nobody is asked */
} hapi_asking_mode;

/* Of physics. */
typedef struct hapi_world_asking {
  hapi_contact_caller caller;
  hapi_asking_mode mode;
  hapi_verdicts verdicts; /* of this step */
} hapi_world_asking;

/* Whether a step asks, or has verdicts. */
static inline bool hapi_world_asks(const hapi_world_asking *asking)
{
  return asking->mode == HAPI_ASKING_PLAYS ? asking->verdicts.count > 0
                                           : asking->caller.call != NULL;
}

void hapi_said_surface_give(const hapi_said_surface *said, dSurfaceParameters *out);

/* [any] A hapi_contact_ask_fn; of: the hapi_contact_caller. */
int hapi_contact_call(const void *of, const hapi_surface_terms *terms, const hapi_near_said *said,
                      const hapi_pair_tags *tags, const hapi_contact_spot *spot,
                      hapi_surface *out_surface);

/* [physics] Of a contact of the step, b's surface towards a: the surface, and the direction (of
 * surface.mode dContactFDir1) become what the application says. velocity: m/s, of a against b.
 * False: there is none. */
bool hapi_world_ask_contact(hapi_world_asking *asking, dContact *io, const double velocity[3]);

#endif
