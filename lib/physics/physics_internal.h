/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_PHYSICS_INTERNAL_H
#define HAPODE_PHYSICS_PHYSICS_INTERNAL_H

/* All parts of the physics side in one struct. It belongs to the physics thread, or to whoever
 * holds the lock, unless a member says otherwise. */

#include <stdatomic.h>

#include "accuracy/dial.h"
#include "accuracy/effects.h"
#include "accuracy/lookback.h"
#include "accuracy/room.h"
#include "base/thread.h"
#include "near/near.h"
#include "physics/counts.h"
#include "physics/edits.h"
#include "physics/feedback.h"
#include "physics/physics.h"
#include "physics/poses.h"
#include "physics/reconcile.h"
#include "physics/tape_cycle.h"
#include "physics/world_lock.h"
#include "probe/probe.h"
#include "research/cross.h"
#include "world/world.h"

#define HAPI_WORLD_GONE_TEXT \
  "the ODE world was destroyed while a session steps it: stop or destroy the session first"

/* Bodies whose positions are traced: body table entries. */
typedef struct hapi_watch {
  uint32_t bodies[HAP_TRACE_BODIES_MAX]; /* HAPI_NONE: it is gone */
  uint32_t count;
} hapi_watch;

/* The thread of drive THREADS. */
typedef struct hapi_pace {
  hapi_thread thread;
  _Atomic int stop;
  int64_t start_ns;
} hapi_pace;

/* Warnings that come once in a session. */
typedef struct hapi_said {
  bool late;
  bool unsolved;
  bool derated;
  bool swings;
  bool cut;
  bool force_out;
  bool texture_out;
} hapi_said;

struct hapi_physics {
  hapi_physics_config config;
  hapi_cycle cycle;
  hapi_world world;
  hapi_world_listener listener; /* of world */
  hapi_nearby near;
  hapi_probe probe;
  hapi_cross cross;
  hapi_lookback lookback;
  hapi_dial dial;
  hapi_room room;
  hapi_account account;
  hapi_feedback feedback;
  hapi_watch watch;
  hapi_drawing drawing;
  hapi_taping tape;
  hapi_counts counts;
  hapi_wanted wanted;
  hapi_edits edits;
  hapi_world_lock lock;
  hapi_physics_calls calls;
  hapi_pace pace;
  bool world_faulty; /* holds a state that ODE would abort on: not stepped */
  double late_s;     /* of cycles that took longer than their period, one after the other */
  hapi_said said;
};

/* cycle.c: the collision phase, and testing simulations */
void hapi_physics_collide(hapi_physics *physics);
void hapi_physics_test(hapi_physics *physics);
/* cycle.c: what the dials come to */
void hapi_physics_fill_settings(hapi_physics *physics);
void hapi_physics_enter_dial(hapi_physics *physics);

/* intake.c */
void hapi_physics_listen(hapi_physics *physics); /* to the world, which is created after that */
/* Reads which bodies there are. syncs: once in a cycle. */
hap_status hapi_physics_scan(hapi_physics *physics, bool syncs);
/* The same where there is nobody to tell: what fails is logged. */
void hapi_physics_see(hapi_physics *physics, bool syncs);
/* ODE would abort on what the world holds. *out_text says what it is and what to do. After a
 * scan. */
bool hapi_physics_is_unsound(const hapi_physics *physics, hap_detail *out_text);

void hapi_physics_run_edits(hapi_physics *physics); /* those that wait; the caller has the lock */
/* The newest message of the loop, if there is one. */
void hapi_physics_take_state(hapi_physics *physics);

/* publish.c: the next model is made, renewed after after_step, and sent */
void hapi_physics_make_model(hapi_physics *physics, int64_t state_ns, int64_t valid_from_ns);
/* Velocities of driven bodies and parameters of joints once more: they hold from now on. */
void hapi_physics_renew_model(hapi_physics *physics);
void hapi_physics_send_model(hapi_physics *physics);

#endif
