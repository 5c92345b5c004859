/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TICK_TICK_H
#define HAPODE_TICK_TICK_H

/* The pure tick: what the haptic thread computes at 1 kHz and more, from the pointers' device poses
 * to the wrenches for the devices. No allocation, lock, system call, log or function pointer in
 * it. All memory is handed over by hapi_tick_reset's caller.
 *
 *   pointer   device pose -> pointer                               (paper step a)
 *   paper     pointer and planes -> forces -> motion of the neighbours, eq. 7-11: the paper's models
 *   local     model CONTACT: the same in one solve, of rows that the solver knows
 *   guard     checks, shares, limits -> device wrench
 *   report    state for physics; trace row; hash; black box
 *
 * Each part has a struct of its own and knows those before it. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/record.h>

#include "base/effect_clock.h"
#include "guard/guard.h"
#include "local/body.h"
#include "local/contact_memory.h"
#include "local/facts.h"
#include "local/joint_rows.h"
#include "local/rows.h"
#include "local/touch.h"
#include "pointer/pointer.h"
#include "sync/messages.h"
#include "sync/path.h"
#include "sync/trail.h"

/* Cross accelerances of the model in use; contact: an index into the touches. */
typedef struct hapi_crosses {
  hapi_model_cross *of; /* capacity.crosses */
  uint32_t count;
} hapi_crosses;

/* Of the local world, since start. */
typedef struct hapi_local_figures {
  uint64_t contact_ticks;
  double hand_impulse[3]; /* N s on dynamic bodies, all pointers */
  double hand_impulse_abs;
  double owned_impulse[3]; /* see hapi_state */
  double given;            /* J, of this tick: what things of given motion did on owned bodies */
  double residual_max;     /* m/s, of the solver */
  uint64_t sweeps;
} hapi_local_figures;

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
  hapi_bodies bodies;
  hapi_touches touches;
  hapi_crosses crosses;
  hapi_body_contacts contacts;
  hapi_joints joints;
  hapi_rows rows;
  hapi_local_figures figures;
  hapi_guard guard;
  hapi_effect_sample sample;
  hapi_tick_watch watch;
  bool hashing; /* lockstep */
  uint64_t hash;
} hapi_tick;

/* Zeroes the state; arrays, capacity, period, hashing and the guard's mode are set by the caller
 * before. */
void hapi_tick_reset(hapi_tick *tick);

void hapi_tick_adopt(hapi_tick *tick, hapi_model *model, int64_t now_ns);

/* The set stays in use, and must stay as it is, until the next call. */
void hapi_tick_adopt_patches(hapi_tick *tick, hapi_patches *patches);

/* One tick at now_ns from the pointers' device_pose and device_twist to their device_wrench. */
void hapi_tick_run(hapi_tick *tick, int64_t now_ns);

/* Latches the first one. pointer: index + 1 of the one that it came from; 0: none of them. */
void hapi_tick_fault(hapi_tick *tick, hap_fault fault, uint32_t pointer);
void hapi_tick_reset_fault(hapi_tick *tick);

/* The device has zero force at once, whatever the slew limit says. With a fault it stays so. */
void hapi_guard_cut(hapi_pointer *pointer);

void hapi_tick_report(const hapi_tick *tick, hapi_state *out);
void hapi_tick_report_poses(const hapi_tick *tick, hapi_poses *out);
void hapi_tick_report_trail(const hapi_tick *tick, hapi_trail *trail);
void hapi_tick_report_path(const hapi_tick *tick, hapi_path *path);
void hapi_tick_trace(const hapi_tick *tick, hap_trace_row *out);

/* ---- the steps of hapi_tick_run, one file each ---- */

void hapi_coupling_read(hapi_tick *tick);    /* device -> world */
void hapi_local_place(hapi_tick *tick);      /* models SINGLE and IMPULSE: poses now */
void hapi_render(hapi_tick *tick);           /* eq. 7 */
void hapi_local_step(hapi_tick *tick);       /* eq. 8-11, 14 */
void hapi_local_world_step(hapi_tick *tick); /* model CONTACT: b and c in one */
void hapi_local_wake(hapi_tick *tick, hapi_local_body *body); /* a resting one, before its rows */
void hapi_proxy_begin(hapi_tick *tick);                       /* direct or proxy, and why */
void hapi_proxy_begin_anew(hapi_pointer *pointer);            /* where the device is */
void hapi_proxy_none(hapi_tick *tick);                        /* other models: all are direct */
void hapi_proxy_free(hapi_tick *tick);                        /* velocities without contacts */
void hapi_proxy_push_out(hapi_tick *tick); /* rigid ones: moved by the velocities as they are now */
void hapi_proxy_move(hapi_tick *tick);     /* poses and forces on the hands */
void hapi_pointers_brake(hapi_tick *tick); /* rows of god-objects that have been let go */
void hapi_pointers_direct(hapi_tick *tick); /* instead of proxy_begin where there can be none */
void hapi_pointer_rows(hapi_tick *tick);    /* pointer contacts -> rows */
void hapi_pointer_forces(hapi_tick *tick);  /* rows -> wrenches */
void hapi_pointer_forces_with_friction(hapi_tick *tick); /* its part where some contact rubs */
void hapi_contact_wake(hapi_tick *tick);                 /* what is touched by what moves */
void hapi_contact_rows(hapi_tick *tick);                 /* contacts between bodies -> rows */
void hapi_joint_adopt(hapi_tick *tick, hapi_model *model);
void hapi_joint_wake(hapi_tick *tick);     /* what hangs on what moves */
void hapi_joint_rows(hapi_tick *tick);     /* joints -> rows */
void hapi_tool_set_aside(hapi_tick *tick); /* before a model's spheres are taken: their places */
void hapi_tool_adopt_model(hapi_tick *tick, hapi_model *model); /* ... and after them */
void hapi_tool_adopt_patches(hapi_tick *tick, hapi_patches *patches);
void hapi_tool_place(hapi_tick *tick);                    /* all contacts of hulls, once a tick */
void hapi_tool_forget(hapi_tick *tick, uint32_t pointer); /* its contacts begin as deep ones do */
void hapi_guard_run(hapi_tick *tick);
void hapi_energy_observe(hapi_tick *tick); /* part of the guard, on device wrenches */
void hapi_energy_resume(hapi_tick *tick);  /* after ticks that were not observed */
void hapi_tick_feel(hapi_pointer *pointer, hap_effect_wish wish, bool rubs); /* feels_torque */
void hapi_coupling_write(hapi_pointer *pointer);                /* world wrench -> device wrench */
double hapi_coupling_torque_scale(const hapi_pointer *pointer); /* device / world */
void hapi_trace_hash(hapi_tick *tick);

#endif
