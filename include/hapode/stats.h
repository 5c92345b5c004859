/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_STATS_H
#define HAPODE_STATS_H

#include <stdint.h>

#include <hapode/attributes.h>

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
  HAP_FAULT_EMERGENCY = 7     /* hap_emergency_zero was called */
} hap_fault;

/* [any] What happened and what to do, one sentence; "" for HAP_FAULT_NONE; never NULL. */
HAP_API const char *hap_fault_text(hap_fault fault);

/* Everything since start. Times of ticks and steps are wall-clock, in lockstep as well; in
 * lockstep they are the only figures that differ from run to run. Grows at its end. */
typedef struct hap_stats {
  uint32_t size;  /* bytes filled in */
  uint32_t model; /* hap_model in force in the loop */

  /* Haptic loop. */
  uint64_t ticks;         /* executed */
  uint64_t missed_ticks;  /* deadlines t0 + jT with no tick begun before t0 + (j+1)T */
  uint64_t contact_ticks; /* ticks in which a pointer was pushed back */
  double tick_us_mean;    /* us, the whole cycle with device input and output */
  double tick_us_p50;
  double tick_us_p99;
  double tick_us_max;
  double haptic_duty; /* mean tick time / T */
  double model_age_s; /* now - time for which the newest adopted model was built */
  double model_age_max_s;
  uint64_t models_adopted;

  /* Physics. */
  uint64_t physics_steps;
  uint64_t physics_missed; /* deadlines of steps passed over because physics was late */
  uint64_t frames_dropped; /* FRAME: steps dropped by hap_session_update */
  double physics_ms_mean;  /* ms a cycle: all of the parts below */
  double physics_ms_p99;
  double physics_ms_max;
  double physics_duty;      /* mean cycle time / H */
  double collide_ms_mean;   /* broad and narrow phase, contact joints and their end */
  double neighbour_ms_mean; /* neighbours and nearest points */
  double testing_ms_mean;   /* testing simulations and what they save and restore */
  double step_ms_mean;      /* the global step */
  double publish_ms_mean;   /* reconcile, messages, poses */
  double last_collide_ms;   /* the newest cycle alone */
  double last_neighbour_ms;
  double last_testing_ms;
  double last_step_ms;
  double last_publish_ms;
  uint64_t quickstep_calls; /* dWorldQuickStep, global and testing */
  uint64_t probe_steps;     /* testing simulations among them */
  uint32_t bodies_known;
  uint32_t neighbours; /* dynamic bodies in the newest model */
  uint32_t neighbours_max;
  uint32_t pointer_contacts; /* pointer-geom pairs in the newest model */
  uint64_t capacity_dropped; /* bodies, contacts or cross accelerances that found no room */
  uint64_t probes_singular;  /* probes whose A could not be used; the last good one was kept, of
                                cross accelerances none */
  uint64_t states_rejected;  /* non-finite states kept away from ODE */
  uint64_t bodies_lost;      /* destroyed without hap_session_forget_body; said once */

  /* Momentum audit: what the hands gave to dynamic bodies, before the limits of the devices, against
   * what the world got. A body that is destroyed takes what it was given since the last sync along. */
  double impulse_ns;        /* N s, norm of the net impulse on the bodies */
  double impulse_abs_ns;    /* N s, sum over ticks of the norms */
  double momentum_ratio;    /* world / hand along the net impulse; NaN while the net is below 5 %
                               of the sum of norms */
  double momentum_error_ns; /* N s, norm of the difference */
  double peak_force_n;      /* N, largest on a hand, before force_scale */

  /* Guard. */
  uint64_t saturated_ticks;
  uint64_t faults;        /* latched so far */
  uint32_t fault;         /* hap_fault latched now */
  uint32_t realtime;      /* 1: haptic thread runs under SCHED_FIFO */
  uint64_t trace_dropped; /* rows that found no room */
  uint64_t trace_hash;    /* lockstep: states and forces of all ticks; 0 otherwise */

  /* Model CONTACT. */
  uint64_t contact_passes;    /* sets of contacts between bodies that the loop has taken */
  double contact_us_mean;     /* us a pass */
  double contact_us_max;      /* us */
  double solver_residual_max; /* m/s, largest correction of a velocity that was left undone */
  uint64_t solver_sweeps;     /* sum over ticks */
  uint32_t local_contacts;    /* contact points between bodies that push in the newest tick */
  uint32_t range_bodies;      /* bodies that the loop moves itself, in the newest model */
  uint32_t edge_bodies;       /* outside of the range, but touched by it: moving boundaries */
  uint32_t measured_bodies;   /* moved by what testing simulations say */
  double range_ms_mean;       /* ms a cycle, part of neighbour_ms: building the local model */
  double last_range_ms;

  uint64_t probes_clipped;    /* accelerances that lay outside of 0 .. M^-1 and were brought back */
  uint64_t contacts_rejected; /* contacts of ODE's colliders with numbers that are none */
  /* Guard. A tick counts once, however many pointers it was for. */
  uint64_t fault_pointer; /* hap_pointer_id.v of the pointer that the latched fault came from; 0: of
                             none in particular */
  uint64_t stale_times;   /* that the local model became older than two physics steps */
  uint64_t stale_ticks;   /* ticks in which it was */
  uint64_t slewed_ticks;  /* ticks in which a force was held back by the slew limit */
  uint64_t energy_ticks;  /* ticks in which a force was held back by the energy observer */

  /* Haptic thread: how late the system woke it up for a tick. 0 in lockstep and where a device sets the
   * pace. */
  double wake_us_mean;
  double wake_us_p50;
  double wake_us_p99;
  double wake_us_p999;
  double wake_us_max;

  double pose_delay_s; /* by which hap_session_poses draws behind */

  /* The world between threads. The haptic loop never waits for the lock. */
  uint64_t locks;          /* times that application threads had the lock */
  double lock_wait_ms_max; /* ms, longest wait of one of them; tries in vain do not count */
  double lock_held_ms_max; /* ms, longest that one of them had it: physics cannot step meanwhile */
  uint64_t edits_run;      /* of hap_session_post */

  uint32_t range_joints; /* model CONTACT: joints that the loop holds itself, in the newest model */
  uint32_t measured_joints; /* of these, the ones whose equations come from testing simulations */
  double joint_error; /* 0.., the largest share by which such equations were off at the end of the
                               last interval: they turn with a body until the next sync */

  /* Where hap_session_def.lookback is above 0: the felt force against that of model SINGLE with the pointers on the
   * same way, over windows of a quarter of a second. A window begins from the state of the session; one that
   * follows directly, as in LOCKSTEP, where model SINGLE would be, for at most ten seconds on end. */
  double force_error; /* RMS of the difference / RMS of the force, of the last windows with contact;
                                0 before the first */
  double force_error_n; /* N, RMS of the difference in the newest one */
  uint64_t lookbacks;   /* windows gone over */
  uint64_t
      lookbacks_spoilt; /* that could not be: something was moved, added or removed meanwhile, or
                           there was too much of it for lookback's share */
  double
      range_error; /* model CONTACT with the effect testing on: by how much the loop moved neighbours
                         otherwise in an interval than testing simulations of the whole world, made at its
                         begin with the pointers' forces, foretold: root of the sums of squares, over
                         that of what they foretold. 0 without it. The forecast is linear in the
                         pointer's impulse: what begins or ends to touch or slide is not in it */
  uint64_t
      probes_reused; /* contacts and bodies whose A was used again at a step (hap_session_def.reuse) */
} hap_stats;

HAP_END_DECLS

#endif
