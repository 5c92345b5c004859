/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_STATS_H
#define HAPODE_STATS_H

/* What a session measures about itself, and the faults that it latches. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Why the guard took the force away. Values are never renumbered. */
typedef enum hap_fault {
  HAP_FAULT_NONE = 0,         /* nothing */
  HAP_FAULT_DEVICE_READ = 1,  /* the device's read failed */
  HAP_FAULT_DEVICE_POSE = 2,  /* the device gave a pose that is not finite */
  HAP_FAULT_FORCE = 3,        /* a wrench was not finite */
  HAP_FAULT_LOCAL_STATE = 4,  /* a local body's state was not finite */
  HAP_FAULT_DEVICE_WRITE = 5, /* the device's write failed */
  HAP_FAULT_WORLD = 6,        /* the ODE world holds a body that cannot be stepped */
  HAP_FAULT_EMERGENCY = 7,    /* hap_emergency_zero was called */
  HAP_FAULT_LATE = 8,         /* ticks came too late, or too many were missed, under force */
  HAP_FAULT_OSCILLATION = 9,  /* the device swings by itself, or runs away from a surface */
  HAP_FAULT_BLOCKED = 10,     /* the loop stood still, in a call of a device or elsewhere */
  /* for 18 ms the device told positions that no hand moves to, or said that they are wrong */
  HAP_FAULT_DEVICE_INPUT = 11
} hap_fault;

/* [any] What happened and what to do, in one sentence. "" for HAP_FAULT_NONE; never NULL. */
HAP_API const char *hap_fault_text(hap_fault fault);

/* The statistics are totals since start, unless a field says otherwise. Times are wall-clock, also
 * in drive LOCKSTEP; there they are the only figures that differ from run to run.
 *
 * Each group below is final: it keeps its fields for as long as the soname lasts. A later version
 * adds a group at the end of hap_stats, which carries its size. */

/* The haptic loop. */
typedef struct hap_loop_stats {
  uint32_t model;         /* hap_model in force in the loop */
  uint32_t realtime;      /* 1: the haptic thread runs under SCHED_FIFO */
  uint64_t ticks;         /* executed */
  uint64_t missed_ticks;  /* deadlines t0 + jT with no tick begun before t0 + (j+1)T */
  uint64_t contact_ticks; /* ticks in which a pointer was pushed back */
  double tick_us_mean;    /* us, the whole cycle with device input and output */
  double tick_us_p50;     /* us, half of the ticks take at most this */
  double tick_us_p99;     /* us, 99 of 100 */
  double tick_us_max;     /* us, the longest tick */
  double duty;            /* mean tick time / T */

  /* How late the system woke the haptic thread for a tick. 0 in drive LOCKSTEP, and where a device
   * sets the pace. */
  double wake_us_mean;
  double wake_us_p50;  /* us, half of the ticks */
  double wake_us_p99;  /* us, 99 of 100 */
  double wake_us_p999; /* us, 999 of 1000 */
  double wake_us_max;  /* us, the latest */

  double model_age_s;      /* now - time for which the newest adopted local model was built */
  double model_age_max_s;  /* s, the largest so far */
  uint64_t models_adopted; /* local models that the loop took over */
  uint64_t trace_dropped;  /* trace rows that found no room */
  uint64_t trace_hash;     /* LOCKSTEP: of the states and forces of all ticks; 0 otherwise */
} hap_loop_stats;

/* The hands. The momentum audit compares what the hands gave to dynamic bodies, before the limits
 * of the devices, with what the world received. A destroyed body takes along what it was given
 * since the last sync. */
typedef struct hap_hand_stats {
  double peak_force_n;   /* N, largest on a hand, before force_scale */
  double impulse_ns;     /* N s, norm of the net impulse on the bodies */
  double impulse_abs_ns; /* N s, sum over ticks of the norms */
  /* world / hands along the net impulse; NaN while the net impulse is below 5 % of the sum of
   * norms */
  double momentum_ratio;
  double momentum_error_ns; /* N s, norm of the difference */
} hap_hand_stats;

/* The parts of a physics cycle, ms. */
typedef struct hap_cycle_times {
  double collide_ms;   /* broad and narrow phase, contact joints and their end */
  double neighbour_ms; /* neighbours and nearest points */
  double range_ms;     /* part of neighbour_ms: building the local model */
  double testing_ms;   /* testing simulations, with saving and restoring the world */
  double step_ms;      /* the global step */
  double publish_ms;   /* reconcile, messages, poses */
} hap_cycle_times;

/* Physics. */
typedef struct hap_physics_stats {
  uint64_t steps;           /* global steps */
  uint64_t missed;          /* deadlines of steps that were skipped because physics was late */
  uint64_t frames_dropped;  /* FRAME: steps dropped by hap_session_update */
  uint64_t quickstep_calls; /* dWorldQuickStep, global and testing */
  double ms_mean;           /* ms a cycle, all of its parts */
  double ms_p99;            /* ms, 99 of 100 cycles take at most this */
  double ms_max;            /* ms, the longest cycle */
  double duty;              /* mean cycle time / H */
  double pose_delay_s;      /* how far behind hap_session_poses draws */
  hap_cycle_times mean;     /* over all cycles */
  hap_cycle_times last;     /* the newest cycle alone */
} hap_physics_stats;

/* The local model: the part of the world that the loop has. */
typedef struct hap_model_stats {
  uint64_t capacity_dropped; /* bodies, contacts or cross accelerances that found no room */
  uint32_t bodies_known;     /* to the session */
  uint32_t neighbours;       /* dynamic bodies near a pointer, in the newest model */
  uint32_t neighbours_max;   /* the most so far */
  uint32_t pointer_contacts; /* pairs of pointer and geom in the newest model */

  /* Model CONTACT, in the newest model. */
  uint32_t range_bodies;    /* bodies that the loop moves itself */
  uint32_t edge_bodies;     /* bodies outside of the range that touch it: moving boundaries */
  uint32_t measured_bodies; /* bodies that answer as testing simulations say */
  uint32_t range_joints;    /* joints that the loop holds itself */
  uint32_t measured_joints; /* those of them whose equations come from testing simulations */
  /* 0.., largest share by which such equations were off at the end of the last interval: they
   * turn with a body until the next sync */
  double joint_error;
} hap_model_stats;

/* Testing simulations. */
typedef struct hap_probe_stats {
  uint64_t steps; /* steps of the world that were undone */
  /* probes whose A was not usable. The last good one was kept; of cross accelerances none was
   * kept */
  uint64_t singular;
  uint64_t clipped; /* accelerances outside of 0 .. M^-1 that were brought back */
  uint64_t reused;  /* contacts and bodies whose A was used again (hap_expert_def.reuse) */
} hap_probe_stats;

/* Model CONTACT: contacts between bodies, and the solver of the loop. */
typedef struct hap_contact_stats {
  uint64_t passes;     /* sets of contacts that the loop took */
  double us_mean;      /* us a pass */
  double us_max;       /* us, the longest pass */
  uint64_t sweeps;     /* of the solver, sum over ticks */
  double residual_max; /* m/s, largest correction of a velocity that was left undone */
  uint32_t points;     /* contact points between bodies that push in the newest tick */
} hap_contact_stats;

/* Faults, and what the guard did. A tick counts once, whatever the number of pointers. */
typedef struct hap_fault_stats {
  uint64_t count;             /* faults latched so far */
  uint64_t pointer;           /* hap_pointer_id.v that the latched fault came from; 0: none */
  uint32_t fault;             /* hap_fault that is latched now */
  uint64_t saturated_ticks;   /* ticks in which a force was shortened to a limit */
  uint64_t stale_times;       /* times that the local model became older than two physics steps */
  uint64_t stale_ticks;       /* ticks in which it was older than that */
  uint64_t slewed_ticks;      /* ticks in which the slew limit held a force back */
  uint64_t energy_ticks;      /* ticks in which the energy observer held a force back */
  uint64_t states_rejected;   /* states that are not finite and were kept away from ODE */
  uint64_t contacts_rejected; /* contacts of ODE's colliders with NaN or infinity */
  uint64_t bodies_lost;       /* bodies destroyed without hap_session_forget_body */
} hap_fault_stats;

/* The world between threads. The haptic loop never waits for the lock. */
typedef struct hap_edit_stats {
  uint64_t locks;     /* times that application threads had the lock */
  double wait_ms_max; /* ms, longest wait of one of them; failed hap_session_try_lock left out */
  double held_ms_max; /* ms, longest time that one of them held it; physics cannot step then */
  uint64_t run;       /* edits of hap_session_post that ran */
} hap_edit_stats;

/* The force error, where hap_expert_def.lookback is above 0: the force that was felt, against model
 * SINGLE with the pointers on the same path. It is taken over windows of a quarter of a second. A
 * window begins from the state of the session. A window that follows directly, as in LOCKSTEP,
 * begins where model SINGLE would be, for at most ten seconds in a row. */
typedef struct hap_error_stats {
  /* RMS of the difference / RMS of the force, over the last windows with contact; 0 before the
   * first */
  double force_error;
  double force_error_n; /* N, RMS of the difference in the newest window */
  uint64_t lookbacks;   /* windows that were examined */
  /* windows that could not be: something was moved, added or removed meanwhile, or there was too
   * much for lookback's share */
  uint64_t spoilt;
} hap_error_stats;

/* What the guard did because the loop or the device could not be trusted. A tick counts once,
 * whatever the number of pointers. */
typedef struct hap_safety_stats {
  uint64_t derated_ticks;     /* ticks in which late ticks had lowered a force (docs/safety.md) */
  uint64_t oscillation_ticks; /* the same because a device swung by itself, or seemed to run away */
} hap_safety_stats;

/* Model CONTACT: what a tick has time for. In drive LOCKSTEP and in a replay no time of this
 * machine counts. */
typedef struct hap_room_stats {
  uint64_t unsolved_ticks; /* ticks whose solver left 3 mm/s or more undone */
  uint64_t turns;          /* times that update_ns was set anew */
  double update_ns;        /* ns, of a row update: by what the ticks took. 6 in drive LOCKSTEP */
  uint64_t tick_work;      /* row updates that a tick has time for, at that pace */
  uint32_t range_most;     /* bodies that the range may own in the newest model, up to max_bodies */
  uint32_t range_cut;      /* 1: the newest range ends there, and more bodies could be touched */
} hap_room_stats;

/* What is told to an application that asks (hapode/touches.h). */
typedef struct hap_event_stats {
  uint64_t dropped; /* events that found no room, and touches beyond HAP_TOUCHES_MAX in each tick */
} hap_event_stats;

/* What hap_expert_def.look_ahead comes to. */
typedef struct hap_ahead_stats {
  double look_ahead_s; /* the session's */
  uint64_t dropped; /* sum over models: bodies and contacts that were met without room for them */
  uint32_t dropped_now; /* of the newest model */
  uint32_t reserved;
} hap_ahead_stats;

/* All of it. */
typedef struct hap_stats {
  uint32_t size;             /* bytes filled in */
  hap_loop_stats loop;       /* the haptic loop */
  hap_hand_stats hand;       /* the hands */
  hap_physics_stats physics; /* physics */
  hap_model_stats model;     /* the local model */
  hap_probe_stats probes;    /* testing simulations */
  hap_contact_stats contact; /* contact passes */
  hap_fault_stats faults;    /* faults and the guard */
  hap_edit_stats edits;      /* the world between threads */
  hap_error_stats error;     /* looking back */
  hap_safety_stats safety;   /* forces lowered in doubt */
  hap_room_stats room;       /* what a tick has time for */
  hap_event_stats events;    /* what is told */
  hap_ahead_stats ahead;     /* looking ahead */
} hap_stats;

/* [any] Copies the statistics into *out. size_of_out: sizeof *out of the caller's build. Each
 * counter is exact, but the set may straddle a tick. HAP_ERROR_ARGUMENT: a NULL, or no room for the
 * size. */
HAP_API hap_status hap_session_stats(const hap_session *session, hap_stats *out,
                                     size_t size_of_out);

HAP_END_DECLS

#endif
