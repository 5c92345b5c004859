/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_HAPTIC_RT_TICK_H
#define HAPODE_HAPTIC_RT_TICK_H

/* The pure tick: what the haptic thread computes at 1 kHz and more, from the pointers' device poses
 * to the wrenches for the devices. No allocation, lock, system call, log or function pointer in
 * this folder. All memory is handed over by hapi_tick_init's caller.
 *
 *   velocity  device poses -> their twist, where the device measures none
 *   adopt     a new local model, when its time has come            (paper section 6)
 *   coupling  device pose -> pointer                               (paper step a)
 *   render    pointer and planes -> forces, eq. 7                  (step b)
 *   local_dynamics  forces -> motion of the neighbours, eq. 8-11   (step c)
 *   guard     checks, shares, limits -> device wrench      (force_guard, energy_observer)
 *
 * Model CONTACT has one solve in the place of steps b and c:
 *
 *   adopt_patches  new contacts between bodies, with the impulses of the old ones
 *   local_world    free velocities, poses; calls the next four
 *   proxy          pointers that are bodies behind a spring
 *   pointer_rows   pointer contacts as rows; pointer_friction_rows
 *   contact_rows   contacts between bodies as rows
 *   joint_rows     joints likewise
 *   contact_solver, direct_solver  impulses of all rows
 *
 * Pointers that are hulls:
 *
 *   tool_adopt   their contacts, of a new model or new patches, go on from the old ones
 *   tool_place   where these are now, and what part of the stiffness each has
 *   tool_friction  how far the points of a pair have been pulled along, for one that comes to them
 *   touch_place  one of them, or of those between bodies
 *
 *   report    state for physics; trace row; hash
 *   black_box what came out, kept for the case of a fault
 */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/pointer.h>
#include <hapode/record.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/stats.h>

#include "base/wishes.h"
#include "haptic/rt/contact_solver.h"
#include "haptic/rt/velocity.h"
#include "sync/messages.h"
#include "sync/path.h"
#include "sync/trail.h"

/* Beyond this a coordinate [m] or speed [m/s, rad/s] is taken for an error. */
#define HAPI_STATE_LIMIT 1e6

/* What the guard keeps of a pointer. Device frame and units where nothing else is said; zeroed: a
 * pointer that has just come. */
typedef struct hapi_guard_pointer {
  double share;       /* 0..1, of the ramp-in */
  bool placed;        /* position and moved are of the device as it is now */
  double position[3]; /* at the last tick */
  double quat[4];
  double moved[3];    /* since the tick before */
  double turned[3];   /* rad, likewise, of a device that gives torque */
  hap_wrench wanted;  /* before the guard */
  hap_wrench written; /* at the last tick; in force until the next write */
  uint32_t flags;     /* hap_guard_flag, of the last tick */
  double limit;       /* N in the world, of the device */
  double felt;        /* 0..1, share after ramp-in and age */
  double force2;      /* N^2, of this tick: sum over the contacts, other models than CONTACT */
  double power;       /* W, likewise: of the bodies on the springs */
} hapi_guard_pointer;

/* What the guard keeps of the whole loop. */
typedef struct hapi_guard_state {
  hap_guard mode;
  double age_loss; /* 0..1, share of the force that the age of the local model has taken */
  bool stale;
  bool observes; /* the energy observer watches, if the mode has one */
  uint64_t stale_times;
  uint64_t stale_ticks;
  uint64_t slewed_ticks;
  uint64_t energy_ticks;
  double balance;    /* J, world units: what the hands and the world have put in and not got back */
  double stored_max; /* J, largest energy of the pointer springs and owned bodies */
  double sprung;     /* J, sum over the contacts of the last tick */
  double touch_s;    /* s, since something is felt without a break */
  int64_t observed_ns; /* time of the last tick */
  double given; /* J, of this tick: what contacts with things of given motion did on bodies that
                        the loop owns */
} hapi_guard_state;

typedef struct hapi_tick_pointer {
  uint32_t generation; /* 0: no pointer here */
  uint32_t collide_bits;
  double radius;
  const hapi_tool_hull *hull; /* NULL: a sphere */
  double extent;              /* m, from the origin to the farthest point of the surface */
  bool three_dof;             /* the device has no torque, and does not turn a hull */
  double stiffness;
  double damping;
  double friction;
  double finger_radius; /* m, of the torsion; 0: none */
  bool feels_torque;    /* torque is worked out, and given to a device that can take it */
  bool turns;           /* with the device, and gives it torque; else only friction goes by it */
  double motion_scale;
  double force_scale;
  double max_force;   /* N at the device */
  double max_torque;  /* N m at the device */
  double slew_force;  /* N/s at the device */
  double slew_torque; /* N m/s at the device */
  hap_pose pose_world_device;
  bool aligned; /* by it the device's axes are the world's: no turning to be worked out */

  hap_pose device_pose;   /* in, device frame */
  hap_twist device_twist; /* in, device frame */
  hap_pose device_good;   /* the last device_pose that could be used */
  bool placed;            /* there was one */
  bool jumped;            /* between the last one and this one; see coupling.c */
  double jump_s;          /* s, > 0: contacts that arrive deep are so because of a jump */
  double speed_limit;     /* m/s at the device, that a hand can make; 0: none */
  uint32_t buttons;       /* in */
  bool estimates;         /* device_twist is made of poses by velocity, not read */
  hapi_velocity velocity;

  hap_pose pose;            /* world */
  hap_twist twist;          /* world */
  hap_wrench wrench;        /* world, on the hand */
  hap_wrench device_wrench; /* out, device frame, scaled and limited */
  uint32_t contacts;        /* that push */
  hapi_guard_pointer guard;

  /* Coupling; world. Stiffnesses as felt in the world: device's / (motion_scale force_scale). */
  hap_coupling coupling;       /* asked for */
  hap_integration integration; /* model CONTACT */
  bool hold_known;
  double hold; /* N/m, what the device can hold; HUGE_VAL: not known */
  double coupling_stiffness;
  double coupling_damping;
  double proxy_mass;
  double handle_position[3]; /* of the device */
  double handle_velocity[3];
  double near_stiffness;    /* N/m, sum over the contacts near the pointer, as they are found */
  double contact_stiffness; /* N/m, the same of the last tick, whole */
  bool proxied;             /* the pointer is a proxy, of whatever coupling */
  bool rigid;               /* it is one whose contacts do not give: god-object and virtual tool */
  double idle_s;            /* s, that a proxy of coupling AUTO has touched nothing */
  hap_coupling_reason coupling_reason;
  double proxy_position[3];
  double proxy_velocity[3];
  double offset[3];        /* m, from the device to the end of the spring, shrinking */
  double free_velocity[3]; /* m/s, of the proxy with nothing in touch */
  uint32_t row;            /* place in the solver's velocities; 0: direct */
  double response;         /* 1/kg, change of the proxy's velocity by one N s */
  double reach;            /* m, of a rigid one: how far it may come in this tick */
  double speed_most;       /* m/s, rad/s: likewise, along the way to where the device is */
  double spin_most;
  uint32_t near_rows; /* likewise: contacts within that */
  bool pushed_out;    /* likewise: in this tick it moves by move_velocity */
  double move_velocity[6];
  double
      carried[6]; /* of a god-object: that of the bodies under it, as far as forces leave it out */

  /* The same of a hull's turning; zero for a sphere. */
  double spin_stiffness; /* N m/rad */
  double spin_damping;   /* N m s/rad */
  double proxy_inertia;  /* kg m^2 */
  double handle_quat[4];
  double handle_spin[3];
  double proxy_quat[4];
  double proxy_spin[3];  /* rad/s */
  double offset_turn[3]; /* rad */
  double free_spin[3];   /* rad/s */
  double spin_response;  /* 1/(kg m^2) */
} hapi_tick_pointer;

/* Hundreds of them are more than a near cache holds: what every tick reads or tells stands together, first
 * that of all models, then that of some; what a sync writes and few ask for comes last. */
typedef struct hapi_local_body {
  uint32_t generation;
  uint32_t flags;
  uint32_t epoch;
  uint32_t row; /* place in the solver's velocities */
  bool live;    /* in the model in use */
  bool pushed;  /* since it was adopted */
  bool
      round; /* the same inertia about all axes, as cubes and balls have: it does not turn with them */
  bool forced;  /* the application pushes it */
  bool rowed;   /* scratch: it has a row in this tick */
  bool waiting; /* for its first contacts: goes on with its twist until they are known */
  hap_pose pose;
  hap_twist twist;
  double impulse[3];
  double angular_impulse[3];
  double residual_taken[6]; /* of eq. 14, what has been added so far */
  double gain[6];
  int64_t owned_until_ns;

  /* Model CONTACT. */
  uint64_t entered_model;    /* with which the loop came to own the body */
  double start_twist[6];     /* before this tick */
  double rotation[9];        /* of pose */
  double inverse_mass;       /* 0 where it is not used: driven and measured ones */
  double inverse_inertia[9]; /* world */

  double residual[6];     /* of eq. 14, to be added in this tick */
  double acceleration[6]; /* sum of A f in this tick; 0 between ticks, of a body that answers */
  double b[6];
  hapi_model_body given; /* of the newest model */
  hap_pose from;         /* model IMPULSE: pose at adoption, and pose to reach */
  hap_pose to;
  hap_pose owned_pose;
  hap_twist owned_twist;
} hapi_local_body;

/* How much of a contact that arrived deep is felt yet, see contact_ramp.h. */
typedef struct hapi_ramp {
  double depth;  /* m, at the last tick */
  double share;  /* 0..1, of the force */
  double excess; /* m, of the depth that does not count */
  bool held;     /* the excess goes by drawing back alone */

  /* Of the energy observer, at the last tick: */
  double felt_share; /* with what the guard took */
  double felt;       /* what the guard left of friction */
  double felt_excess;
  double sprung; /* J in the spring, as it was felt */
} hapi_ramp;

/* Where the anchors of a contact's friction are. */
typedef struct hapi_friction_place {
  double anchor_pointer[3]; /* m, in the pointer's frame */
  double anchor_body[3];
  double normal_pointer[3]; /* of the surface */
  double normal_body[3];
  double
      mark_pointer[3]; /* unit, along the surface: one direction when they were set; soft finger */
  double mark_body[3];
  double stretch_body[3]; /* m, of the pointer ahead of the body, in the body's frame */
  double turn;            /* rad, likewise, about the normal */
} hapi_friction_place;

/* Friction of a pointer contact, of a sphere's by its slot; see pointer_friction.h. Of four numbers: along
 * the surface in world axes, and about the normal times the finger's radius. */
typedef struct hapi_friction {
  uint32_t generation; /* of the contact */
  uint32_t epoch;      /* of the body */
  uint64_t tick;       /* the last in which the contact was closed */
  hapi_friction_place set;
  hapi_friction_place now; /* the anchors if they were set in this tick */
  double normal[3];
  double at[3];      /* m, world: where the force acts */
  double stretch[4]; /* m, of the pointer ahead of the body */
  double speed[4];   /* m/s, at which it grows */
  double stiffness;  /* N/m, in this tick */
  double damping;    /* N s/m */
  bool rigid;        /* the contact does not give, and what slides begins anew at the next tick: */
  bool slid;         /* it did; the stiffness is the coupling's then */
  double left;       /* 0..1, share of the stretch that sliding has left in this tick */
  double pull;       /* N, of spring and damper where nothing slides */
  double axes[3][4]; /* unit, at right angles; the first along the pull */
  uint32_t axis_count; /* 2; 3 with torsion */
} hapi_friction;

/* Likewise. */
typedef struct hapi_local_contact {
  uint32_t slot;
  uint32_t body;
  uint32_t pointer;
  uint32_t pointer_generation;
  uint32_t generation;
  uint32_t tool;  /* of a hull: 1 + index into the tick's tools; 0: of a sphere */
  uint32_t row;   /* model CONTACT: in this tick, HAPI_NO_ROW */
  bool seen;      /* rendered at least once */
  bool rubs;      /* friction is worked out: there is some, or it was asked for */
  bool has_shape; /* model CONTACT: asked at every tick */
  double point_body[3];
  double normal_body[3];
  hapi_ramp ramp;
  double mu;
  double weight;        /* 0..1, share of the pointer's stiffness; of a sphere 1 */
  double force[3];      /* on the body */
  double couple[3];     /* N m, on the body about the contact point; friction */
  double normal_now[3]; /* model CONTACT, and of hulls all: world, out of the body */
  double point_now[3];
  double a[6][3];
  double turn[6]; /* acceleration by one N m about the normal; soft finger */
  hapi_shape shape;
  hap_pose shape_pose;
} hapi_local_contact;

/* A contact of a pointer that is a hull, beside its hapi_local_contact. */
typedef struct hapi_local_tool {
  hapi_tool_point in;
  uint32_t pair; /* index */
  uint32_t next; /* of the same pair; HAPI_SLOT_NONE: the last one */
  double member; /* 0..1: one that is new, or no longer there, comes and goes slowly */
  bool leaving;  /* no longer there */
  bool placed;   /* in this tick */
  double claim;  /* 0..1, in this tick: its part of the stiffness before it is shared */
  double depth;  /* m, in this tick, less the pair's excess */
  double felt;   /* 0..1, share of the stiffness in this tick */
  hapi_friction friction;
} hapi_local_tool;

/* What the contacts of a hull with one geom have in common. */
typedef struct hapi_tool_pair {
  uint64_t key;
  uint32_t pointer;
  uint32_t first; /* of its tools, by their next */
  bool seen;
  hapi_ramp ramp; /* of the deepest of them */
  double depth;   /* m, of the deepest, at the last tick */
} hapi_tool_pair;

/* Of those that are leaving, and of new ones before the old are dropped. */
#define HAPI_TOOL_PAIRS(capacity) ((size_t)3 * (capacity)->tool_points)

/* The contacts of all hulls. They stand behind the spheres' in the tick's contacts, in the same order. */
typedef struct hapi_tool_world {
  hapi_local_tool *tools;     /* 2 x capacity.tool_points: new ones and those that are leaving */
  hapi_local_tool *old_tools; /* scratch of adopting */
  hapi_local_contact *old_contacts; /* likewise */
  hapi_tool_pair *pairs;            /* HAPI_TOOL_PAIRS */
  hapi_tool_hull *hulls;            /* capacity.pointers */
  uint32_t count;
  uint32_t pair_count;
} hapi_tool_world;

#define HAPI_NO_ROW 0xffffffffu

/* Where a row of the solver comes from. */
typedef struct hapi_row_source {
  uint32_t contact; /* of the patches, or of the pointers */
  uint32_t body_a;  /* slot; HAPI_SLOT_NONE: none */
  uint32_t body_b;
  uint8_t part; /* 0 normal, 1 and 2 friction; of a joint: see joint_rows.c */
  bool pointer;
  bool joint;      /* contact is the index of a joint */
  bool pushes_out; /* its target lifts a body out of another one, or closes a joint: not to stay in
                      the velocity */
  bool gives;      /* may do work on bodies of the loop: a partner that the loop does not own, a
                      surface that moves, a spring */
  double stays;    /* m/s, of a row that pushes out: its target without that */
} hapi_row_source;

/* What is kept of a contact from tick to tick, and from one set of patches to the next. */
typedef struct hapi_contact_memory {
  uint64_t key;
  double core_a[3];
  double impulse[3]; /* N s: normal, friction 1 and 2 */
} hapi_contact_memory;

#define HAPI_JOINT_PARTS 16 /* six that hold, one given, motor and stops of three axes */
#define HAPI_JOINT_ROWS 10u /* at once */

/* What is kept of a joint, by slot. */
typedef struct hapi_joint_memory {
  uint32_t generation;
  uint32_t measurement;             /* whose rows the impulses are of */
  double impulse[HAPI_JOINT_PARTS]; /* N s, N m s */
} hapi_joint_memory;

/* The bodies' contacts and the solver's arrays, model CONTACT. */
typedef struct hapi_local_world {
  hapi_patches *patches;       /* of the contact thread, NULL: none yet */
  hapi_contact_memory *memory; /* of its contacts; capacity.contacts */
  hapi_contact_memory *old_memory;
  uint32_t memory_count;
  uint32_t *buckets;        /* of the matching; HAPI_MEMORY_BUCKETS */
  uint32_t bucket_count;    /* power of 2 */
  uint32_t buckets_used;    /* likewise; scratch of the matching */
  hapi_model_joint *joints; /* of the model in use; capacity.joints */
  uint32_t joint_count;
  hapi_joint_memory *joint_memory; /* by slot; capacity.joints */
  hapi_row_source *sources;        /* of the rows; row_capacity */
  hapi_solver solver;
  uint32_t row_capacity;
  uint32_t resting; /* bodies at the tick's begin */
  uint32_t active;  /* contacts between bodies that push in this tick */
  uint64_t late_passes;
} hapi_local_world;

/* See effect_clock.h; cycles. */
typedef struct hapi_effect_sample {
  bool on; /* this tick is looked at */
  uint64_t spent[HAP_EFFECTS];
} hapi_effect_sample;

typedef struct hapi_tick {
  hapi_capacity capacity;
  double period; /* s, T */
  bool hashing;  /* lockstep */

  hapi_local_body *bodies; /* by slot, capacity.bodies */
  uint32_t *live;          /* slots in the model, live_count */
  /* Of spheres, then of hulls, contact_count in all; capacity.contacts + 2 x capacity.tool_points. */
  hapi_local_contact *contacts;
  hapi_ramp *ramps;            /* by contact slot, of the model before: to go on with */
  uint32_t *ramp_generations;  /* by contact slot */
  hapi_friction *frictions;    /* by contact slot; of spheres */
  hapi_tick_pointer *pointers; /* capacity.pointers */
  hapi_model_cross *crosses;   /* of the model, contact: an index here; capacity.crosses */
  uint32_t live_count;
  uint32_t contact_count;
  uint32_t cross_count;
  uint32_t body_high;
  uint32_t pointer_high; /* from here on no pointer has come yet; before it some may have left */
  hapi_local_world world;
  hapi_tool_world tool;

  uint32_t wishes; /* of the model in use, base/wishes.h */
  bool bounces;    /* some contact or stop of it gives back speed */
  bool rubs;       /* some contact of a pointer rubs */
  bool proxies;    /* some pointer is or may become one */
  hapi_effect_sample sample;

  uint64_t tick;
  int64_t now_ns;
  uint64_t model_number;
  uint64_t adopting; /* scratch of adopt */
  hap_model model;
  hap_impulse_pose impulse_pose;
  double blend_s;
  int64_t adopted_ns;
  int64_t state_ns;
  int64_t sent_ns;
  uint32_t watch_count;
  uint32_t watch_slot[HAP_TRACE_BODIES_MAX];
  double watch_position[HAP_TRACE_BODIES_MAX][3];

  double physics_period; /* s, H of the model in use; 0: not known */
  hapi_guard_state guard;
  hap_fault fault;           /* latched */
  uint32_t fault_pointer;    /* index + 1 of the pointer that it came from; 0: none of them */
  uint32_t fault_generation; /* of that pointer, which may have gone since */
  uint64_t faults;
  uint32_t pushing; /* contacts that push in this tick */
  double peak_force;
  uint64_t contact_ticks;
  uint64_t saturated_ticks;
  double hand_impulse[3]; /* N s on dynamic bodies, all pointers, since start */
  double hand_impulse_abs;
  double owned_impulse[3]; /* see hapi_state */
  double residual_max;     /* m/s, of the solver since start */
  uint64_t sweeps;
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
void hapi_guard_cut(hapi_tick_pointer *pointer);

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
void hapi_proxy_begin_anew(hapi_tick_pointer *pointer);       /* where the device is */
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
void hapi_guard(hapi_tick *tick);                         /* world wrench -> device wrench */
void hapi_energy_observe(hapi_tick *tick); /* part of the guard, on device wrenches */
void hapi_energy_resume(hapi_tick *tick);  /* after ticks that were not observed */
void hapi_tick_feel(hapi_tick_pointer *pointer, hap_effect_wish wish, bool rubs); /* feels_torque */
void hapi_coupling_write(hapi_tick_pointer *pointer); /* world wrench -> device wrench */
double hapi_coupling_torque_scale(const hapi_tick_pointer *pointer); /* device / world */
void hapi_trace_hash(hapi_tick *tick);

#endif
