/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_PHYSICS_H
#define HAPODE_PHYSICS_PHYSICS_H

/* The physics side of a session: the application's ODE world, its neighbours of the pointers, and
 * the testing simulations. No ODE types here. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/accuracy.h>
#include <hapode/effects.h>
#include <hapode/session.h>
#include <hapode/stats.h>
#include <hapode/touches.h>

#include "record/tape.h"
#include "world/config.h"

struct hap_ode_def;
struct dxBody;  /* dBodyID is a pointer to it */
struct dxSpace; /* dSpaceID */
struct hapi_contact_caller;

typedef struct hapi_physics hapi_physics;

hap_status hapi_physics_create(const hapi_physics_config *config, const struct hap_ode_def *ode,
                               hapi_physics **out, hap_detail *detail);
void hapi_physics_destroy(hapi_physics *physics); /* NULL allowed; ended before */

/* [any] Who is asked about contacts; it does not change. */
const struct hapi_contact_caller *hapi_physics_caller(const hapi_physics *physics);
bool hapi_physics_asks(const hapi_physics *physics); /* whether there is anybody */

struct hapi_springs;
/* [control] Before begin: the springs on the axes of the world's joints; they stay the caller's. */
void hapi_physics_set_springs(hapi_physics *physics, const struct hapi_springs *springs);

/* [control] Takes the world over and builds the first local model; *start_ns is the time for which
 * it holds: 0 in lockstep, else now. */
hap_status hapi_physics_begin(hapi_physics *physics, int64_t *start_ns, hap_detail *detail);
void hapi_physics_end(hapi_physics *physics); /* gives the world back; idempotent */

/* [control] Before begin: from then on what comes from outside goes to the tape or comes from
 * it, until the tape is taken away after end. NULL: none. A replay has the session's clock from
 * the tape, and what the threads do and lockstep does not. */
void hapi_physics_set_tape(hapi_physics *physics, hapi_tape *tape);
const char *hapi_physics_ode_configuration(void); /* [any] what ODE was built as */
/* [control] After end, before anything of the session is destroyed: runs the edits that are
 * left, which may call the session. Nothing can be posted any more. */
void hapi_physics_close(hapi_physics *physics);

/* [control] Between begin and end: the thread of drive THREADS. */
hap_status hapi_physics_start_thread(hapi_physics *physics);
void hapi_physics_stop_thread(hapi_physics *physics); /* idempotent */

/* [physics] One cycle at now_ns, the next one being planned for next_ns: the world goes one period
 * on. Takes and gives the lock. */
void hapi_physics_cycle(hapi_physics *physics, int64_t now_ns, int64_t next_ns);

/* [physics] Time that the last cycle was for. */
int64_t hapi_physics_last_cycle(const hapi_physics *physics);

/* [physics] Seconds from the last cycle to the next one in the model in force: H, or T in model
 * SINGLE; and as it will be after the next cycle. */
double hapi_physics_period(const hapi_physics *physics);
double hapi_physics_next_period(const hapi_physics *physics);

/* What is done before and after each cycle, in its thread; members may be NULL. */
typedef struct hapi_physics_calls {
  void *of;
  void (*before)(void *of, int64_t now_ns);
  void (*after)(void *of, int64_t now_ns);
} hapi_physics_calls;

/* [control] Before begin. */
void hapi_physics_set_calls(hapi_physics *physics, const hapi_physics_calls *calls);
/* [control] Before begin: an exchange of the same capacity in place of that of the config. */
void hapi_physics_set_exchange(hapi_physics *physics, hapi_exchange *exchange);

/* far.c: bodies that are drawn in another session than that of the world. */
struct hapi_told_body;
struct hapi_scene_print;
struct hapi_model;
/* [physics] Entries of the table of bodies, and where the bodies of count of them are. */
uint32_t hapi_physics_places(hapi_physics *physics);
void hapi_physics_tell(hapi_physics *physics, uint32_t first, uint32_t count,
                       struct hapi_told_body *out);
/* [control] The caller holds the lock. */
void hapi_physics_print_scene(hapi_physics *physics, struct hapi_scene_print *out);
/* [control] In place of begin, in a session whose world is elsewhere: its own bodies are drawn. The
 * caller holds the lock. */
hap_status hapi_physics_begin_drawing(hapi_physics *physics, int64_t now_ns);
/* [any] There, with the lock: bodies that the application has made or destroyed. */
void hapi_physics_see_drawn(hapi_physics *physics);
/* [network] There: what the world has told of a step, and a frame for those who draw. times_ns: for
 * which it holds, and now. period_s: H of the world. */
void hapi_physics_hear(hapi_physics *physics, uint64_t number, const struct hapi_told_body *bodies,
                       uint32_t count);
void hapi_physics_draw(hapi_physics *physics, struct hapi_model *model, double period_s,
                       const int64_t times_ns[2]);

/* [control] LOCKSTEP: time from a cycle to the use of its model; negative: the model's own. */
void hapi_physics_set_latency(hapi_physics *physics, double seconds);

/* [physics] Whether the model in force steps the world up to now, not ahead (IMPULSE). */
bool hapi_physics_steps_to_now(const hapi_physics *physics);

/* ode.h; the caller holds the lock or runs in a cycle, or nothing runs */
bool hapi_physics_may_edit(hapi_physics *physics);
hap_status hapi_physics_adopt(hapi_physics *physics, struct dxBody *body);
hap_status hapi_physics_forget(hapi_physics *physics, struct dxBody *body);
/* The body is where it was put, and did not go there. */
hap_status hapi_physics_teleport(hapi_physics *physics, struct dxBody *body, const hap_pose *pose);
hap_status hapi_physics_set_moved_callback(hapi_physics *physics, struct dxBody *body,
                                           void (*callback)(struct dxBody *));
hap_status hapi_physics_trace_bodies(hapi_physics *physics, struct dxBody *const *bodies,
                                     size_t count);
void hapi_physics_forget_geom(hapi_physics *physics, const void *geom);
void hapi_physics_surface_changed(hapi_physics *physics, const void *geom); /* NULL: of all */
hap_status hapi_physics_add_space(hapi_physics *physics, struct dxSpace *space, uint32_t pairs);
hap_status hapi_physics_remove_space(hapi_physics *physics, struct dxSpace *space);
#define HAPI_ALL_KNOWN SIZE_MAX

/* [any] At the time drawn for time_ns; newest of all; roles. HAP_ERROR_NOT_FOUND: the body at
 * *out_unknown is not known, perhaps others behind it; those that are known are told. */
hap_status hapi_physics_poses(hapi_physics *physics, int64_t time_ns, struct dxBody *const *bodies,
                              size_t count, hap_pose *out, size_t *out_unknown);
hap_status hapi_physics_poses_now(hapi_physics *physics, struct dxBody *const *bodies, size_t count,
                                  hap_pose *out, size_t *out_unknown);
/* [any] The number that names the body in every run alike. HAP_ERROR_NOT_FOUND: it is not known. */
hap_status hapi_physics_birth(hapi_physics *physics, struct dxBody *body, uint64_t *out);
hap_status hapi_physics_roles(hapi_physics *physics, struct dxBody *const *bodies, size_t count,
                              hap_body_role *out, size_t *out_unknown);
/* [any] *out_step_ns: H. */
int64_t hapi_physics_drawn_time(hapi_physics *physics, int64_t time_ns, int64_t *out_step_ns);

/* session.h */
void hapi_physics_set_model(hapi_physics *physics, hap_model model); /* [any] */
hap_model hapi_physics_wanted_model(hapi_physics *physics);          /* [any] */
/* [any] From the next cycle on. */
void hapi_physics_set_effect(hapi_physics *physics, hap_effect effect, hap_effect_wish wish);
void hapi_physics_set_time_scale(hapi_physics *physics, double scale); /* [any] 0..1, likewise */
void hapi_physics_set_period(hapi_physics *physics,
                             int64_t period_ns);             /* [any] until the next start */
uint32_t hapi_physics_wanted_effects(hapi_physics *physics); /* [any] as in base/wishes.h */
/* [any] Its part of HAP_EFFECTS places. */
void hapi_physics_effects(hapi_physics *physics, hap_effect_info *out);
/* [any] From the next cycle on; as in hap_session_def. */
void hapi_physics_set_accuracy(hapi_physics *physics, double accuracy);
void hapi_physics_set_force_error(hapi_physics *physics, double wanted);
void hapi_physics_set_budget(hapi_physics *physics, double tick_share, double physics_share);
void hapi_physics_accuracy(hapi_physics *physics, hap_accuracy_info *out); /* [any] */
hap_status hapi_physics_lock(hapi_physics *physics, int64_t timeout_ns);   /* negative: for ever */
bool hapi_physics_lock_is_mine(hapi_physics *physics);
hap_status hapi_physics_unlock(hapi_physics *physics);
hap_status hapi_physics_post(hapi_physics *physics, hap_edit_fn edit, void *arg); /* [any] */
bool hapi_physics_in_callback(const hapi_physics *physics); /* calling thread runs a cycle */
void hapi_physics_count_dropped_frames(hapi_physics *physics, uint64_t steps);
uint64_t hapi_physics_bodies_lost(hapi_physics *physics);       /* [any] */
void hapi_physics_stats(hapi_physics *physics, hap_stats *out); /* [any] its part of *out */

#endif
