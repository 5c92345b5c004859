/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_PHYSICS_INTERNAL_H
#define HAPODE_PHYSICS_PHYSICS_INTERNAL_H

/* Shared by the files of lib/physics. Everything here belongs to the physics thread, or to whoever
 * holds the lock, unless it says otherwise. */

#include <pthread.h>
#include <stdatomic.h>

#include <hapode/ode.h>

#include "base/effect_figures.h"
#include "base/fair_lock.h"
#include "base/histogram.h"
#include "base/index.h"
#include "base/thread.h"
#include "base/wishes.h"
#include "physics/admittance.h"
#include "physics/claim.h"
#include "physics/dial.h"
#include "physics/islands.h"
#include "physics/joint_probe.h"
#include "physics/lookback.h"
#include "physics/physics.h"
#include "physics/reuse.h"
#include "physics/snapshot.h"
#include "proximity/proximity.h"
#include "record/tape.h"
#include "sync/touch_local.h"

#define HAPI_NONE HAPI_INDEX_NONE
#define HAPI_EDITS_MAX 256
#define HAPI_EDGE_PLACES 8192u    /* of the edges of HAPI_NEAR_TRIANGLES, a power of 2 */
#define HAPI_NEAR_TRIANGLES 1024u /* of a mesh, near one geom; with more ODE itself collides it */
#define HAPI_HULL_POINTS 4096u    /* of a convex geom that are looked at */

/* Standard gravity, for the smallest perturbation of a testing simulation. */
#define HAPI_STANDARD_GRAVITY 9.81
/* Share of the weight that a probe uses at least where the pointer gave no force yet (eq. 4 would
 * divide by zero). */
#define HAPI_PROBE_FLOOR 0.01

/* ---- bodies.c: what is known of the world's bodies ---- */

typedef struct hapi_sleep {
  double linear_threshold;  /* m/s, squared as ODE keeps it */
  double angular_threshold; /* rad/s, squared */
  int idle_steps;
  double idle_time; /* s */
  int samples;
  int steps_left;
  double time_left;
  double *velocities; /* samples x 6, ring; NULL for up to one */
  int next_sample;
  bool ring_full;
} hapi_sleep;

typedef struct hapi_mark {
  double idle_time;         /* s, the application's, which the mark stands in for */
  double angular_threshold; /* rad/s, the same */
} hapi_mark;

/* What a step does not look at where the body is far from the pointers and nothing has changed. */
typedef struct hapi_known_rest {
  uint64_t birth; /* number of this life of the entry, from 1: addresses come again */
  bool adopted;
  double user_force[3]; /* accumulators before the last global step */
  double user_torque[3];
  hapi_mark mark;
  hapi_sleep sleep;
  uint32_t member;    /* scratch: place in the test set and its snapshot */
  uint64_t chosen_in; /* scratch: model that it was chosen for */
  uint64_t ranged_in; /* scratch: walk that met it */
  int32_t hops; /* scratch: of that walk, from the neighbours; of a mechanism they are those of
                           the body that it was met by */
  uint64_t gathered_in; /* scratch: walk that asked whether its mechanism can be owned */
  double damping[2];    /* scratch of soft.c */
  void (*moved_callback)(dBodyID);
} hapi_known_rest;

/* 64 bytes: a scan goes through the memory of all of them. */
typedef struct hapi_known_body {
  dBodyID body;          /* NULL: free entry */
  hapi_known_rest *rest; /* the entry's */
  uint64_t seen;         /* scan that found it */
  uint32_t next;         /* entry that the last scan saw after it; a guess */
  uint32_t slot;         /* local slot, HAPI_NONE: not local */
  double extent;         /* m, from the body's origin to the far corner of its geoms */
  uint64_t
      geoms_print; /* of the geoms that it was measured of; 0: not yet, or they are not sound */
  uint32_t island; /* scratch: number of the island under test, HAPI_NONE outside */
  bool found;      /* at least once, by a geom or a joint: it is gone when it is found no more */
  bool sized;      /* all of its geoms are of classes whose sizes are in geoms_print */
  bool measured;   /* the last scan found its geoms changed */
  bool jointed;
  bool loop_owned; /* in the newest message, also while its slot retires */
  bool loop_touched;
  bool pushed; /* user_force or user_torque is not 0 */
  bool mark_placed;
  bool mark_in_axis;
  bool sleep_taken;
  bool
      sleep_automatic; /* ODE's flag as the application set it; kept by us while the session runs */
  bool awake;          /* after the last global step */
} hapi_known_body;

/* ---- poses.c: what is drawn ---- */

#define HAPI_FRAMES 8u /* of the world, that are kept */
#define HAPI_WAITS 16u

/* Of a known body. Frame number n has place n % HAPI_FRAMES. */
typedef struct hapi_drawn {
  uint64_t first;          /* frame with a pose */
  uint32_t led;            /* bits: in this frame the pose is only the loop's */
  uint32_t slots[2];       /* in the trail: now, and before */
  uint32_t generations[2]; /* 0: none */
} hapi_drawn;

typedef struct hapi_frames {
  int64_t stamps[HAPI_FRAMES]; /* rising; time for which the poses hold in what is felt */
  uint64_t count;              /* frames so far: the newest one is count - 1 */
  uint64_t oldest;             /* that is kept; its place may be used by one that was taken back */
  double waits_ns[HAPI_WAITS]; /* from the stamp of a frame until the next one was known */
  uint32_t wait_count;
  double delay_ns; /* at delay_from_ns, on its way to delay_wanted_ns */
  double delay_wanted_ns;
  int64_t delay_from_ns;
} hapi_frames;

typedef struct hapi_body_table {
  hapi_known_body *entries;
  hapi_known_rest *rests; /* of each entry */
  hapi_drawn *drawn;      /* of each entry */
  hap_pose *poses;        /* HAPI_FRAMES x capacity: a frame is written from end to end */
  dBodyID *handles; /* body of each entry once more, close together: for walks over all bodies */
  uint32_t capacity;
  uint32_t high; /* entries in use are below */
  hapi_index by_address;
  uint64_t births; /* entries begun so far */
  uint32_t used;
  uint64_t scan;
  uint32_t seen_count;    /* entries that this scan saw */
  uint32_t jointed_count; /* of those with joints */
  uint32_t last_seen;
  double fastest;       /* m/s, surface of the bodies that are awake and not local */
  dBodyID unsound_body; /* the first one that the scan met, NULL: none; not of the local ones */
  const char *unsound_text;
  dGeomID unsound_geom;
  uint64_t lost;
  uint32_t replaced; /* among them, not counted yet: another one is at the address */
  bool said_lost;
  bool starved;         /* the newest scan found no memory for a body: not all are known */
  bool geoms_forgotten; /* since the newest scan: another one may be at the address of one */
} hapi_body_table;

/* ---- joints.c: what is known of the world's joints ---- */

/* What a joint is known by. Not by its address: that may be one of a joint that was destroyed, or not,
 * as the heap likes, and lockstep would go another way. */
typedef struct hapi_joint_name {
  uint64_t births[2]; /* of its bodies, in ODE's own order; 0: static world */
  dJointType type;
  uint32_t rank; /* among those of the same bodies and type, the oldest first */
} hapi_joint_name;

typedef struct hapi_known_joint {
  dJointID joint;
  hapi_joint_name name;
  uint64_t seen;     /* scan that found it */
  dBodyID bodies[2]; /* in ODE's own order; the second is NULL: static world */
  uint32_t index[2]; /* of the body table, in this cycle */
  bool carried;      /* of a kind that the loop has */
  bool usable;       /* place holds */
  bool held;         /* scratch: switched off for the global step */
  bool left_is_known;
  hapi_joint_kind kind;
  hapi_joint_place place; /* as it was set */
  hap_pose left;          /* of the second body in the first at the end of the last cycle */
  uint64_t gathered_in;   /* scratch: walk that met it */
  uint64_t ranged_in;     /* model that it is in */
  uint32_t slot;          /* HAPI_NONE: not in the newest model */
  double meant[3][2];     /* scratch of soft.c */
  uint64_t wanted_in;     /* walk that would have taken it if it were measured */
  hapi_joint_measurement *measurement; /* owned; NULL: none */
} hapi_known_joint;

typedef struct hapi_joint_slot {
  uint32_t taken; /* by which entry, + 1; 0: free */
  uint32_t generation;
} hapi_joint_slot;

typedef struct hapi_joint_table {
  hapi_known_joint *entries;
  uint32_t count;
  uint32_t capacity;
  hapi_index by_address;
  hapi_index by_name;
  uint64_t scan;
  bool starved;           /* the newest scan found no memory for a joint */
  hapi_joint_slot *slots; /* capacity.joints */
  uint32_t slot_high;     /* from here on none was ever taken */
} hapi_joint_table;

/* ---- what the loop knows, and what we told it ---- */

typedef enum hapi_slot_phase {
  HAPI_SLOT_FREE = 0,
  HAPI_SLOT_LIVE = 1,
  HAPI_SLOT_RETIRING = 2 /* no longer in the model; the loop may still be using an older one */
} hapi_slot_phase;

typedef struct hapi_body_slot {
  hapi_slot_phase phase;
  uint32_t generation;
  uint32_t epoch;      /* grows when the loop shall start again from ODE\'s state */
  uint32_t known;      /* entry of the body table; HAPI_NONE: the body is gone */
  uint32_t flags;      /* of the message */
  uint64_t retired_at; /* first model without it */
  bool wanted;         /* scratch: in the model being built */
  bool pushed;         /* by a pointer in the last interval: the loop owns its motion */
  bool placed;         /* left_* hold what we left in ODE */
  bool left_enabled;
  bool pose_changed; /* since then, by the application */
  bool velocity_changed;
  double mass;
  double impulse_taken[3];
  double angular_impulse_taken[3];
  double left_position[3];
  double left_quat[4];
  double left_velocity[6];
  double b[6];
  bool b_is_good;        /* scratch: of this cycle's probes */
  double new_impulse[3]; /* of the last interval, to be given to the world */
  double new_angular_impulse[3];
  double residual[6]; /* eq. 14, running total */

  /* Model CONTACT. */
  bool loop_owned;        /* in the newest message: ODE's state is the loop's, and is not stepped */
  bool edge;              /* scratch: measured only because it borders the range */
  bool linked;            /* scratch: a body of the range may touch it */
  bool held;              /* scratch: switched off for the global step */
  int64_t owned_until_ns; /* that the loop's last state was taken for */
  double gain_taken[6];
  double falls[3];       /* m/s^2, by gravity and the application's force */
  double exchanged[6];   /* N, N m: mean wrench from the loop in the last interval */
  double response[6][6]; /* measured */
  bool measured;         /* response and b hold a measurement */
  bool known_free;       /* model ACCELERANCE: nothing holds it, so nothing was measured */

  bool foretold; /* range_error.c: what the world was going to do with an owned body */
  double foretold_a[6][3];
  double foretold_b[6];
  double foretold_twist[6]; /* then */
  double foretold_gain[3];  /* N s, likewise */

  double cross[6][3]; /* scratch: the answer to the contact of its island in this round */

  hapi_print_place prints[HAPI_REUSE_BOOKS]; /* reuse.h, of the island that begins with it */
  uint32_t next_pushed;                      /* scratch */
} hapi_body_slot;

typedef struct hapi_contact_slot {
  hapi_slot_phase phase;
  uint32_t generation;
  uint32_t body; /* slot, HAPI_SLOT_NONE: static world */
  uint32_t pointer;
  uint32_t pointer_generation;
  dGeomID geom; /* compared only, never used */
  bool wanted;
  bool probed;          /* a holds a measured accelerance */
  uint32_t round;       /* scratch: order among the contacts of its island */
  uint32_t next_pushed; /* scratch of reuse.c */
  double point_body[3];
  double normal_body[3];
  bool has_shape;                 /* one with a closed form, and it is wished for */
  hap_effect_reason shape_reason; /* what there would be without a wish */
  hapi_shape shape;
  hap_pose shape_pose;   /* body frame */
  bool placed;           /* what follows holds, of the last model */
  double point_world[3]; /* when it was found */
  double distance;       /* m, then */
  double speed;          /* m/s, pointer against body */
  double stiffness;      /* N/m, the pointer's */
  double mu;             /* of the pair, as the application says */
  double finger_radius;  /* m, the pointer's; 0: no torsion */
  double last_force[3];  /* on the body, newest message */
  double a[6][3];
  double turn[6];        /* the same of a torque about the normal */
  double measured[6][3]; /* scratch: a of this cycle's probes, before it is known to be good */
  double measured_turn[6];
  bool is_tool; /* a point of a hull's patch */
  hapi_tool_point tool;
} hapi_contact_slot;

/* ---- cross.c ---- */

/* Of a contact and a body that it does not push. */
typedef struct hapi_cross {
  uint32_t contact; /* slot */
  uint32_t contact_generation;
  uint32_t body; /* slot */
  uint32_t body_generation;
  double response; /* (m/s^2)/N of the body's surface */
  double a[6][3];
} hapi_cross;

/* ---- cover.c ---- */

typedef struct hapi_covered {
  dReal box[6];
  dGeomID geom;
} hapi_covered;

/* Of a round of questions to a space, in which nothing moves. Zeroed, then created. */
typedef struct hapi_cover {
  dGeomID box_geom; /* private, in no space */
  bool filled;      /* found holds what is in the box */
  bool has_box;
  bool has_asked;
  bool missing;   /* no memory for one */
  dReal box[6];   /* also while it is not filled: what is to be in it */
  dReal asked[6]; /* all questions of this round */
  double boxes_s; /* spent in this round on ODE's boxes around what moved */
  hapi_covered *found;
  uint32_t count;
  uint32_t capacity;
} hapi_cover;

/* ---- neighbor.c ---- */

typedef struct hapi_candidate {
  dGeomID geom;
  uint32_t pointer;
  double reach; /* m, that it was found with */
} hapi_candidate;

typedef struct hapi_hit {
  dGeomID geom;
  uint32_t pointer;
  hapi_nearest nearest; /* a: pointer, b: geom */
  uint32_t tool_first;  /* of a hull: into the points of hapi_tool_search */
  uint32_t tool_count;  /* 0: a sphere */
  double mu;            /* of a hull, of all of its points, once it is taken */
} hapi_hit;

/* ---- tool.c ---- */

typedef struct hapi_found_point {
  hapi_tool_point tool;
  double gap;
  double normal[3]; /* world, out of the geom */
  uint32_t slot;    /* of the contact that it goes on with; HAPI_NONE: none */
} hapi_found_point;

/* A hull that is looked at beside a geom. */
typedef struct hapi_tool_at {
  dGeomID geom;
  uint32_t index; /* of the pointer */
  const hapi_state_pointer *pointer;
  const hapi_tool_hull *hull;
  uint64_t key;   /* of the two */
  double reach;   /* m, at most */
  double horizon; /* s, for which what may come to touch is of interest */
} hapi_tool_at;

/* Points of all hits of a cycle. */
typedef struct hapi_tool_search {
  hapi_found_point *points;
  uint32_t count;
  uint32_t capacity;
} hapi_tool_search;

typedef struct hapi_neighborhood {
  dGeomID probe_geom;     /* private sphere, in no space */
  dGeomID plane_geom;     /* private plane, in no space */
  dContactGeom *vertices; /* HAPI_HULL_POINTS, of a convex geom */
  double *hull;           /* the same, x, y, z */
  hapi_candidate *candidates;
  uint32_t candidate_capacity;
  uint32_t candidate_count;
  struct hapi_hit *hits; /* candidate_capacity */
  uint32_t hit_count;    /* that the newest model has */
  hapi_cover cover;
  double fastest;           /* m/s, of all awake bodies' surfaces */
  uint32_t current_pointer; /* while ODE calls back */
  double current_reach;
} hapi_neighborhood;

/* ---- local_range.c, mesh.c ---- */

typedef struct hapi_link {
  dGeomID own;
  dGeomID other;
  dReal box[6]; /* own's, with the reach */
  hapi_surface surface;
  bool turned; /* the surface is of (other, own) */
} hapi_link;

typedef struct hapi_pair_place {
  uint64_t key;
  uint64_t walk; /* that noted it */
} hapi_pair_place;

typedef struct hapi_geom_name {
  dGeomID geom;    /* compared only */
  uint64_t number; /* from 1; 0: it was forgotten */
  uint64_t walk;   /* newest one that met it */
} hapi_geom_name;

typedef struct hapi_range {
  hapi_near *near; /* message being written */
  dGeomID *geoms;  /* of its geoms; capacity.geoms */
  uint64_t number; /* of the walk: that of its model */
  uint32_t *queue; /* entries of the body table; capacity.bodies */
  uint32_t count;
  uint32_t owned;
  int32_t hops;                 /* of what is put into the queue now */
  uint32_t seeds;               /* neighbours: the first of the queue */
  uint32_t bounces;             /* surfaces of this walk that give back speed */
  hapi_pair_place *pair_places; /* open addressing, a power of 2 */
  uint32_t pair_place_count;
  uint32_t pairs_noted;
  bool refused; /* a body within the hops that the loop cannot own */
  hapi_geom_name *names;
  uint32_t name_count;
  uint32_t name_capacity;
  hapi_index names_by_address;
  uint64_t names_given;
  bool pair_found;  /* scratch */
  double own_speed; /* m/s, while ODE calls back */
  double fastest;   /* m/s, of the pointers */
  dGeomID box_geom; /* private, in no space */
  hapi_cover cover;
  dGeomID own_geom; /* while ODE calls back */
  dBodyID own_body;
  dReal own_box[6];
  hapi_link *links; /* of one body */
  uint32_t link_count;
  uint32_t link_capacity;
  bool links_missing; /* no memory for one */
  uint32_t *members;  /* entries of the body table, of one mechanism; capacity.bodies */
  uint32_t member_count;
  uint32_t moving;  /* that are not kinematic; they come first */
  uint32_t *joints; /* entries of the joint table; capacity.joints */
  uint32_t joint_count;
} hapi_range;

typedef struct hapi_mesh {
  dGeomID geom;
  dTriMeshDataID data;
  uint32_t count;
  uint64_t checked_in; /* walk that looked whether it is the same mesh */
  double *corners;     /* count x 9, geom's frame */
  double *boxes;       /* of every few triangles, x 6 */
} hapi_mesh;

typedef struct hapi_near_triangle {
  double corners[9]; /* world */
  uint32_t index;
  uint32_t open_edges; /* as in hapi_near_geom */
} hapi_near_triangle;

typedef struct hapi_meshes {
  hapi_mesh *meshes;
  uint32_t count;
  uint32_t capacity;
  hapi_near_triangle found[HAPI_NEAR_TRIANGLES];
  uint32_t places[HAPI_EDGE_PLACES]; /* of their edges, + 1; open addressing */
} hapi_meshes;

/* ---- ode_world.c ---- */

typedef struct hapi_surface_entry {
  dGeomID a; /* compared only */
  dGeomID b;
  uint64_t step; /* in which it was asked for */
  bool collides;
  dSurfaceParameters surface;
} hapi_surface_entry;

typedef struct hapi_surface_cache {
  hapi_surface_entry *entries; /* open addressing, a power of 2 */
  uint32_t capacity;
  uint32_t used;
  uint64_t step;
} hapi_surface_cache;

/* ---- probe.c: the islands under test ---- */

typedef struct hapi_test_set {
  uint32_t *contacts; /* slots of the contacts to probe; capacity.contacts */
  uint32_t contact_count;
  uint32_t *bodies;  /* slots of bodies to probe, model CONTACT; capacity.bodies */
  double (*base)[6]; /* their acceleration at the operating point */
  uint32_t body_count;
  uint32_t *rounds;  /* by island: contacts so far; capacity.contacts */
  uint32_t *members; /* entries of the body table, all islands under test */
  uint32_t member_count;
  uint32_t member_capacity;
  uint32_t island_count;
  bool mechanisms; /* there are joints other than contacts */
  dGeomID *order;  /* geoms of the spaces that sleeping members are in, space by space */
  uint32_t order_count;
  bool keeps_order; /* of all members' spaces, not of sleeping ones alone */
  uint32_t order_capacity;
  dJointID *cut; /* joints of kinematic bodies to the outside, disabled for the probe */
  uint32_t cut_count;
  uint32_t cut_capacity;
  dBodyID *disabled; /* switched off for the probe */
  uint32_t disabled_count;
  uint32_t disabled_capacity;
  unsigned islands_threads; /* ODE's setting, restored after the probes */
} hapi_test_set;

typedef struct hapi_physics_counts {
  hap_stats stats; /* physics' part */
  double collide_s;
  double neighbour_s;
  double testing_s;
  double step_s;
  double publish_s;
  double range_s;      /* part of neighbour_s */
  double beyond_s;     /* part of range_s: bodies that are no neighbours */
  double joints_s;     /* of joints: their scan and their part of the message; of publish_s */
  double cross_s;      /* part of testing_s and publish_s */
  double foretold2;    /* m^2/s^2, sum over what testing simulations foretold of owned bodies ... */
  double range_error2; /* ... and over what the loop made different from it */
  hapi_effect_figures effects[HAP_EFFECTS];
  hap_accuracy_info accuracy;
  uint64_t cycles;
  double world_impulse[3]; /* given to the world: predictions and overwrites */
  double hand_impulse[3];  /* given to the bodies, as the loop reported */
  double owned_taken[3];   /* of hapi_state.owned_impulse, in world_impulse */
} hapi_physics_counts;

typedef struct hapi_edit {
  hap_edit_fn run;
  void *arg;
} hapi_edit;

/* Of the application's threads. Written by the one that has the lock. */
typedef struct hapi_lock_figures {
  _Atomic uint64_t count;
  _Atomic int64_t wait_most_ns;
  _Atomic int64_t held_most_ns;
  int64_t taken_ns; /* by the one that has it */
} hapi_lock_figures;

struct hapi_physics {
  hapi_physics_config config;
  hap_ode_def ode;
  hapi_claim claim; /* of ode.world */
  dJointGroupID contact_group;
  dJointGroupID carried_group; /* contacts of what the loop owns, see range_error.c */
  dContact *contact_scratch;

  hapi_fair_lock lock;
  hapi_lock_figures lock_figures;
  pthread_mutex_t edits_lock;
  hapi_edit edits[HAPI_EDITS_MAX];
  uint32_t edit_first;
  uint32_t edit_count;
  bool edits_closed;
  bool editable; /* in a callback that may create and destroy, or in an edit */

  hapi_body_table table;
  hapi_body_slot *bodies;      /* capacity.bodies */
  hapi_contact_slot *contacts; /* capacity.contacts */
  uint32_t body_high;          /* slots that were ever used are below */
  uint32_t contact_high;
  hapi_cross *crosses; /* of the newest testing simulations; capacity.crosses */
  uint32_t cross_count;
  hapi_neighborhood neighborhood;
  hapi_surface_cache surfaces;
  hapi_range range;
  hapi_joint_table joints;
  hapi_meshes meshes;
  hapi_snapshot snapshot;
  hapi_test_set test;
  hapi_reuse reuse;
  hapi_lookback lookback;
  hapi_dial dial;

  _Atomic int wanted_model;
  _Atomic uint32_t wanted_effects; /* base/wishes.h */
  uint32_t wishes;                 /* in force in this cycle */
  hap_model model;                 /* in force in this cycle */
  double step_s;                   /* of this cycle's global step */
  double latency_s;                /* negative: the model's own */
  uint64_t model_number;
  hapi_state *state;     /* newest message of the loop; NULL: none yet */
  bool has_new_state;    /* state came in this cycle */
  double probe_step_s;   /* H */
  int64_t last_cycle_ns; /* time of the last cycle, for which ODE's state holds */
  hapi_frames frames;
  pthread_mutex_t poses_lock; /* physics and those who draw: frames, and the table's places */

  uint32_t watch[HAP_TRACE_BODIES_MAX]; /* body table entries */
  uint32_t watch_count;

  bool converted; /* ODE holds parameters of another step, see soft.c */
  double meant_erp;
  double meant_cfm;
  bool begun;
  unsigned islands_threads; /* ODE's setting as it was found */
  hapi_islands islands;
  bool said_not_probed;  /* of a transmission, once a session */
  bool said_not_held;    /* of a joint that cannot be measured, likewise */
  bool said_not_touched; /* of a heightfield by a hull, likewise */
  hapi_tool_search tools;
  bool world_faulty;   /* holds a state that ODE would abort on: not stepped */
  bool cycling;        /* not at the start */
  uint16_t model_next; /* hap_model wanted at the end of the cycle */
  hapi_thread thread;
  _Atomic int stop;
  _Atomic unsigned long cycle_thread; /* pthread_t of the thread in a cycle, 0: none */
  int64_t start_ns;
  hapi_histogram cycle_ns;
  hapi_physics_counts figures; /* physics' own */
  pthread_mutex_t shown_lock;
  hapi_physics_counts shown; /* copied once a cycle for readers */

  hapi_tape *tape;             /* of a recording or a replay; NULL: none */
  hapi_cell *note;             /* recording: the cell of this cycle */
  const hapi_cell *read;       /* replay: the same */
  const hapi_cell *read_end;   /* and the one of its end */
  uint64_t model_hash;         /* of the model of this cycle, 0: it has none */
  int64_t sent_ns;             /* of that model */
  uint64_t dropped_unrecorded; /* steps of frames, since the last cycle */
  uint32_t missed_unrecorded;  /* steps, likewise */
  uint32_t locks;              /* hap_session_lock, likewise */
};

/* physics.c: H, or T in model SINGLE */
double hapi_period_of(const hapi_physics *physics, hap_model model);

/* bodies.c */
hap_status hapi_bodies_init(hapi_body_table *table);
void hapi_bodies_finish(hapi_body_table *table);
uint32_t hapi_bodies_find(const hapi_body_table *table, dBodyID body); /* HAPI_NONE */
/* Reads which bodies there are; HAP_ERROR_MEMORY when the table cannot grow. */
hap_status hapi_bodies_scan(hapi_physics *physics);
hap_status hapi_bodies_adopt(hapi_physics *physics, dBodyID body, uint32_t *out_index);
hap_status hapi_bodies_forget(hapi_physics *physics, dBodyID body);
hap_status hapi_bodies_set_moved_callback(hapi_physics *physics, dBodyID body,
                                          void (*callback)(dBodyID));

/* extent.c */
bool hapi_extent_follow(hapi_known_body *known); /* measures it when the geoms have changed: true */
/* m/s, of its surface; 0 for one that sleeps */
double hapi_extent_speed(const hapi_known_body *known);

/* mark.c: tells a body from a later one at its address */
void hapi_mark_place(hapi_known_body *known);
bool hapi_mark_is_gone(const hapi_known_body *known); /* it is another body */
/* What the application has set since, of auto-disable. */
#define HAPI_MARK_TIME 1u
#define HAPI_MARK_THRESHOLD 2u
unsigned hapi_mark_follow(hapi_known_body *known);
void hapi_mark_remove(hapi_known_body *known); /* idempotent */

/* accelerance.c */
/* Of a dynamic body at a rotation of ODE's. */
void hapi_accelerance_free_body(dBodyID body, const dReal rotation[12], hapi_free_body *out);

/* soundness.c: what ODE would abort the process on, or make no number of. *out_text says what it is and
 * what to do. */
bool hapi_world_is_unsound(hapi_physics *physics, hap_detail *out_text); /* after a scan */
const char *hapi_body_unsoundness(dBodyID body, bool jointed);           /* NULL: it is sound */
bool hapi_geom_is_sound(dGeomID geom);
/* What a collider found is made of numbers. */
bool hapi_contact_is_sound(const dContactGeom *contact);

/* sleep.c: ODE's auto-disable, kept by us because a probe would reset ODE's own */
void hapi_sleep_follow(hapi_known_body *known);             /* takes over; and what is set later */
void hapi_sleep_give_back(hapi_known_body *known);          /* idempotent */
void hapi_sleep_step(hapi_physics *physics, double step_s); /* just before the global step */
void hapi_sleep_note(hapi_known_body *known); /* after it, before anything wakes one */

/* ode_world.c */
void hapi_world_collide(hapi_physics *physics);
void hapi_world_collide_carried(hapi_physics *physics); /* what the loop carries: carried_group */
void hapi_world_quickstep(hapi_physics *physics, double step_s); /* counted */
/* Contact joints of two geoms for the next step, between these bodies (NULL: the static world). */
void hapi_world_make_contacts(hapi_physics *physics, const dGeomID geoms[2],
                              const dBodyID bodies[2], dSurfaceParameters *surface, bool carried);

double hapi_body_mass(dBodyID body); /* 0 for a kinematic one */

/* What the pair's surface is, from the application's callback; false: no contact. */
bool hapi_world_ask_surface(hapi_physics *physics, dGeomID a, dGeomID b, dSurfaceParameters *out,
                            bool *out_turned); /* it was asked for (b, a) */
/* The same for the loop: soft constraints converted from H to T. */
bool hapi_world_surface(hapi_physics *physics, hapi_link *link);
/* First friction direction of a pair whose surface has dContactFDir1; false: none was given. */
bool hapi_world_direction(hapi_physics *physics, dGeomID a, dGeomID b, double out[3]);

/* soft.c */
/* Constraint parameters of step H as those of step T: the same spring and damper. */
void hapi_soften(double step_ratio, double *erp, double *cfm);
void hapi_joint_soften(hapi_known_joint *known, double step_ratio); /* its own parameters ... */
void hapi_joint_restore(const hapi_known_joint *known);             /* ... and back */
double hapi_joint_erp(const hapi_known_joint *known);
void hapi_joint_leave_open(const hapi_known_joint *known, bool open, double step_ratio);
/* Model SINGLE steps at T: ERP, CFM and damping of the world and its bodies as meant for H. Undone
 * by restore. */
void hapi_world_convert(hapi_physics *physics);
void hapi_world_restore(hapi_physics *physics);

/* cover.c */
bool hapi_cover_create(hapi_cover *cover);
void hapi_cover_finish(hapi_cover *cover);
void hapi_cover_begin(hapi_cover *cover); /* a round: what was moved since counts */
/* As dSpaceCollide2(geom, space, data, callback), of a geom in no space that collides with all. The
 * callback gets the geoms inside of nested spaces, or such a space to ask itself. */
void hapi_cover_ask(hapi_cover *cover, dSpaceID space, dGeomID geom, void *data,
                    dNearCallback *callback);

/* local_range.c: model CONTACT */
bool hapi_range_create(hapi_physics *physics);
void hapi_range_finish(hapi_physics *physics);
void hapi_range_reset(hapi_physics *physics);
void hapi_range_forget_geom(hapi_range *range, dGeomID geom);
void hapi_range_walk(hapi_physics *physics, uint32_t hit_count);
void hapi_range_publish(hapi_physics *physics); /* with the model of the same number */

/* physics.c */
/* To the log and the application. */
void hapi_physics_say_once(hapi_physics *physics, bool *io_said, const char *text);

/* mechanism.c */
/* The bodies that joints tie to this one, itself first, into range.members, and their joints behind
 * range.joints; false: they cannot be owned. */
bool hapi_mechanism_gather(hapi_physics *physics, uint32_t known);
void hapi_mechanism_take(hapi_physics *physics); /* the joints are in the model */
void hapi_mechanism_drop(hapi_physics *physics); /* they are not */

/* mesh.c */
/* Triangles of a static mesh that meet a box of the world, into physics->meshes.found;
 * HAPI_NEAR_TRIANGLES: there may be more, or there is no memory for them, and they are not to be
 * used. */
uint32_t hapi_mesh_near(hapi_physics *physics, dGeomID geom, const double box[6]);
void hapi_meshes_forget(hapi_meshes *meshes, dGeomID geom);
void hapi_meshes_finish(hapi_meshes *meshes);

/* operating_point.c: A and b of whole bodies, model CONTACT */
void hapi_operating_point_measure(hapi_physics *physics);

/* shape.c */
/* The hull of a convex geom in world axes, its points in physics->neighborhood.hull. */
bool hapi_hull_of_convex(hapi_physics *physics, dGeomID geom, hapi_shape *shape, hap_pose *pose);
/* Shape and pose of a geom for proximity; false: of a class that only ODE's collider knows. */
bool hapi_shape_of_geom(dGeomID geom, hapi_shape *out_shape, hap_pose *out_pose);
/* Distance from a sphere's surface to the geom, within reach of it; false: farther. normal out of
 * the geom. */
bool hapi_geom_nearest(hapi_physics *physics, dGeomID geom, const double center[3], double radius,
                       double reach, hapi_nearest *out);

/* neighbor.c */
void hapi_neighbors_collect(hapi_physics *physics); /* before the global step */
void hapi_neighbors_find(hapi_physics *physics);    /* after it: bodies and contacts of the model */
double hapi_neighbors_speed(dGeomID geom, const hapi_state_pointer *pointer,
                            const double point[3]);                   /* m/s, relative */
double hapi_neighbors_reach(double relative_speed, double horizon_s); /* m */
/* m/s, at a distance from the centre of the geom's body, by its turning */
double hapi_neighbors_spin(dGeomID geom, double distance);
/* Dynamic bodies that a pointer may touch, of the newest model. */
uint32_t hapi_neighbors_bodies(const hapi_physics *physics);

/* tool.c: pointers that are hulls */
bool hapi_tool_knows(dGeomID geom); /* whether they can touch it */
bool hapi_tool_find(hapi_physics *physics, const hapi_candidate *candidate, hapi_hit *out);
/* The points of a hull where the pointer's pose puts it, each with its gap; returns how many. */
uint32_t hapi_tool_points(hapi_physics *physics, const hapi_tool_at *at,
                          hapi_found_point out[HAPI_TOOL_SPOTS]);
uint64_t hapi_tool_geom_key(const hapi_physics *physics, dGeomID geom, uint32_t pointer);
void hapi_tool_keep_places(hapi_physics *physics, const hapi_hit *hit, uint32_t body);
void hapi_tool_take(hapi_physics *physics, const hapi_hit *hit, uint32_t body);

/* slots.c */
uint32_t hapi_slots_body(hapi_physics *physics, uint32_t known); /* live slot; HAPI_NONE: full */
/* NULL: there is none. */
hapi_contact_slot *hapi_slots_find_contact(hapi_physics *physics, uint32_t body, dGeomID geom,
                                           uint32_t pointer, uint32_t pointer_generation);
/* The one there is, or a new one in a place that is free or not wanted; NULL: full. */
hapi_contact_slot *hapi_slots_contact(hapi_physics *physics, uint32_t body, dGeomID geom,
                                      uint32_t pointer, uint32_t pointer_generation);
/* In a place that is free or not wanted; NULL: full. */
hapi_contact_slot *hapi_slots_new_contact(hapi_physics *physics, uint32_t body, dGeomID geom,
                                          uint32_t pointer, uint32_t pointer_generation);
void hapi_slots_begin_model(hapi_physics *physics); /* nothing wanted yet */
void hapi_slots_end_model(hapi_physics *physics);   /* what is not wanted retires */
void hapi_slots_release(hapi_physics *physics);     /* retired ones the loop is done with */
void hapi_slots_drop_body(hapi_physics *physics, uint32_t known); /* the body is gone */
void hapi_slots_restart(hapi_body_slot *slot); /* the loop starts again from ODE's state */
void hapi_slots_renew(hapi_body_slot *slot);   /* and forgets what it summed up, too */
void hapi_slots_reset(hapi_physics *physics);

/* space_order.c */
hap_status hapi_space_order_save(hapi_physics *physics); /* when a member sleeps */
void hapi_space_order_restore(hapi_physics *physics);
/* Grows an array of elements of one size to hold count more than those in use. */
bool hapi_reserve(void **array, uint32_t *capacity, uint32_t used, uint32_t count, size_t size);

/* probe.c */
/* Which bodies the wanted contacts can move: their islands. HAP_ERROR_MEMORY. */
hap_status hapi_test_gather(hapi_physics *physics);
/* The islands of the measured bodies of model CONTACT. */
hap_status hapi_test_gather_bodies(hapi_physics *physics);
/* Model CONTACT: whether it must answer all that acts on it by one matrix. */
bool hapi_test_is_whole(const hapi_physics *physics, uint32_t body);
/* The islands of the neighbours that the loop owns, as far as they can be undone. */
hap_status hapi_test_gather_owned(hapi_physics *physics);
/* All others off, state saved; on HAP_ERROR_MEMORY nothing has changed. */
hap_status hapi_test_enter(hapi_physics *physics);
/* These bodies, with whatever joints tie them to; those that slept are awake then. */
hap_status hapi_test_enter_bodies(hapi_physics *physics, const hapi_lookback_body *bodies,
                                  uint32_t count);
/* Two bodies (HAPI_NONE: none) and nothing that holds them but the joint. */
hap_status hapi_test_enter_pair(hapi_physics *physics, dJointID joint, const uint32_t index[2]);
void hapi_test_leave(hapi_physics *physics); /* as if nothing had been */
/* One testing simulation from the saved state; forces were added by prepare. */
void hapi_test_rewind(hapi_physics *physics);
void hapi_test_step(hapi_physics *physics);
const hapi_body_state *hapi_test_state(const hapi_physics *physics, uint32_t known); /* saved */
/* m/s^2, rad/s^2 of a body under test, over the step. */
void hapi_test_acceleration(const hapi_physics *physics, uint32_t known, double out[6]);
void hapi_test_finish(hapi_test_set *test);

/* accelerance.c: eq. 3-6 */
void hapi_accelerance_measure(hapi_physics *physics);
/* N, of the next testing simulations; their directions are of the contact. */
double hapi_accelerance_push(hapi_physics *physics, const hapi_contact_slot *contact);

/* cross.c: cross accelerance, nothing where it is off */
bool hapi_cross_is_full(const hapi_physics *physics);
/* Before the islands that are measured are: blocks of others stay, where A is used again. */
void hapi_cross_begin(hapi_physics *physics, const hapi_reuse_book *book);
/* After a testing simulation with a force [N] at the contact: what the others did. */
void hapi_cross_column(hapi_physics *physics, const hapi_contact_slot *contact, int axis,
                       double force);
void hapi_cross_keep(hapi_physics *physics, uint32_t contact_index); /* after three of them */
void hapi_cross_take_out(hapi_physics *physics); /* of b: what last_force does by the blocks */
/* Those of a contact that is the one of this number in the message. */
void hapi_cross_publish(hapi_physics *physics, uint32_t contact, uint32_t number, hapi_model *out);

/* reconcile.c: eq. 12-14, momentum */
void hapi_reconcile_take(hapi_physics *physics);      /* newest message of the loop */
void hapi_reconcile_own(hapi_physics *physics);       /* model CONTACT: the loop's states */
void hapi_reconcile_hold(hapi_physics *physics);      /* ... are not stepped */
void hapi_reconcile_let_go(hapi_physics *physics);    /* after the step */
void hapi_reconcile_push(hapi_physics *physics);      /* pointers' impulse into the global step */
void hapi_reconcile_residual(hapi_physics *physics);  /* after it: eq. 14 */
void hapi_reconcile_overwrite(hapi_physics *physics); /* eq. 12 and 13 */
void hapi_reconcile_leave(hapi_physics *physics);     /* last: what is left in ODE */

/* publish.c */
void hapi_publish_model(hapi_physics *physics, int64_t state_ns, int64_t valid_from_ns);

/* poses.c */
void hapi_pose_read(dBodyID body, hap_pose *out);
/* A step can leave a pose that is none, which is found out at the next cycle only. */
bool hapi_pose_is_sound(dBodyID body);
/* A frame of all bodies, for stamp_ns, at known_ns. */
void hapi_poses_publish(hapi_physics *physics, int64_t stamp_ns, int64_t known_ns);
/* A body that is new can be drawn at once, as it is now. The caller holds poses_lock. */
void hapi_poses_begin(hapi_physics *physics, uint32_t index);
void hapi_poses_reset(hapi_physics *physics);
double hapi_poses_delay(hapi_physics *physics); /* s */

/* world_lock.c */
void hapi_physics_enter(hapi_physics *physics); /* takes the lock, for calls of the application */
void hapi_physics_leave(hapi_physics *physics);
void hapi_physics_claim(hapi_physics *physics); /* this thread calls the application: it has the */
void hapi_physics_unclaim(hapi_physics *physics); /* lock already, and may not take or give it */
void hapi_lock_figures_reset(hapi_lock_figures *figures);

/* edits.c */
void hapi_edits_run(hapi_physics *physics);

#include "physics/effects.h"
#include "physics/joints.h"
#include "physics/tape_cycle.h"

#endif
