/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SESSION_SESSION_INTERNAL_H
#define HAPODE_SESSION_SESSION_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include <hapode/session.h>

#include "base/def.h"
#include "contact/contact.h"
#include "haptic/haptic.h"
#include "physics/physics.h"
#include "sync/exchange.h"

#define HAPI_SESSION_COOKIE 0x48534531u
#define HAPI_POINTER_COOKIE 0x48505431u
#define HAPI_ODE_COOKIE 0x484f4431u

struct hap_session {
  hap_session_def def;
  hapi_exchange *exchange;
  hapi_haptic *haptic;
  hapi_physics *physics;
  hapi_contact *contact;
  bool started;
  bool memory_locked;

  /* LOCKSTEP: physics step number step, counted from tick base, is due at
   * base + floor(step x ticks a step). */
  _Atomic uint64_t tick;
  uint64_t base;
  uint64_t step;
  uint64_t pass; /* of the contact thread's part, the next one */

  double frame_remainder_s; /* FRAME */
  pthread_t starter;        /* thread of the last start */

  pthread_mutex_t detail_lock;
  hap_detail detail;
};

/* Notes the text of an error on the session and gives back status. */
hap_status hapi_session_fail(const hap_session *session, hap_status status, const char *format, ...)
    HAP_PRINTF(3, 4);

hap_status hapi_session_check_def(const hap_session_def *def, hap_detail *detail);

#endif
