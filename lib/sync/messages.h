/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MESSAGES_H
#define HAPODE_SYNC_MESSAGES_H

/* What the threads tell each other. A message is one block: a header and arrays behind it at
 * offsets, no pointers. Bodies and contacts have slots, small numbers that physics gives out; a
 * slot's generation tells one user of the slot from the next. World frame, SI.
 *
 *   physics -> haptic    hapi_model    bodies, pointer contacts, joints
 *   haptic  -> physics   hapi_state    where they have come to, what was exchanged
 *   physics -> contact   hapi_near     geoms and pairs near the pointers   (model CONTACT)
 *   haptic  -> contact   hapi_poses    newest poses of the bodies          (model CONTACT)
 *   contact -> haptic    hapi_patches  contacts between bodies             (model CONTACT) */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/record.h>
#include <hapode/session.h>
#include <hapode/spatial.h>

#include "proximity/patch.h"

#define HAPI_SLOT_NONE 0xffffffffu

typedef struct hapi_capacity {
  uint32_t bodies; /* slots: those of the range, and as many again for what lies around it */
  uint32_t contacts;
  uint32_t pointers;
  uint32_t geoms;        /* near the pointers */
  uint32_t hull_points;  /* of all of them together */
  uint32_t trail_rows;   /* 0: none are kept */
  uint32_t trail_stride; /* ticks from row to row */
  uint32_t joints;       /* between bodies of the range */
  uint32_t tool_points;  /* contacts of pointers that are hulls */
  uint32_t crosses;      /* cross accelerances; 0: none are measured */
  uint32_t path_rows;    /* 0: none are kept */
} hapi_capacity;

#define HAPI_TOOL_POINTS_MAX 64u /* vertices of a pointer's hull */

/* A pointer's hull, in the pointer's frame. */
typedef struct hapi_tool_hull {
  uint32_t count; /* 0: the pointer is a sphere */
  double points[HAPI_TOOL_POINTS_MAX][3];
} hapi_tool_hull;

enum {
  HAPI_BODY_DRIVEN = 1,    /* moved by the application: keeps its twist, feels no force */
  HAPI_BODY_RESTING = 2,   /* asleep in the world: does not move until it is pushed */
  HAPI_BODY_FOLLOWS = 4,   /* not pushed in the interval before: the world's state is better */
  HAPI_BODY_OWNED = 8,     /* model CONTACT: the loop moves it, ODE takes its state from the loop.
                            A body with neither this nor DRIVEN nor MEASURED is outside of the range:
                            it goes on with its twist, and ODE gets what the loop gave to it */
  HAPI_BODY_MEASURED = 16, /* model CONTACT: the loop moves it by response and b, ODE by itself */
  HAPI_BODY_GYROSCOPIC = 32,
  HAPI_BODY_TOUCHED = 64, /* of the loop's message: a contact carried it in this tick */
  HAPI_BODY_ALONE =
      256,              /* an OWNED one that nothing can touch before the next sync: it waits for no
                            contacts */
  HAPI_BODY_WHOLE = 128 /* of a MEASURED one: all its rows go by response; else those of its only
                             pointer contact by that contact's a */
};

/* A body that turns more slowly is taken to be one that does not: what the gyroscopic term would add in a tick
 * is a millionth of its turning. */
#define HAPI_SPIN_LEAST 1e-3 /* rad/s */

/* ---- how two shapes touch ---- */

/* A point of hapi_patch with everything in the frames of the bodies, to be placed anew at every
 * tick. Static world: world frame. */
typedef struct hapi_patch_contact {
  uint64_t key; /* of the pair; contacts of a pair follow each other */
  uint32_t body_a;
  uint32_t generation_a;
  uint32_t body_b; /* HAPI_SLOT_NONE: static world */
  uint32_t generation_b;
  uint32_t surface; /* index into the message's surfaces */
  hapi_touch touch;
  hapi_slide slide;
  double core_a[3];
  double core_b[3];
  double normal[3]; /* from b to a: frame of the face's body; EDGES: world, for the sign */
  double ball_a;
  double ball_b;
  double rim_a;
  double rim_b;
  /* The others are for some contacts only: a tick that comes by a thousand leaves them where they are. */
  double axis_a[3]; /* of the rims */
  double axis_b[3];
  double edge_a[3]; /* EDGES and slides */
  double edge_b[3];
  hapi_shape shape; /* BALL: what the ball touches */
  hap_pose shape_pose;
} hapi_patch_contact;

/* A point of a patch between a pointer's hull (a) and a geom of a body (b). Side a is in the pointer's
 * frame. */
typedef struct hapi_tool_point {
  uint32_t pointer;
  uint32_t pointer_generation;
  double
      same_within; /* m, in the pointer's frame: a new point that is nearer to an old one is it */
  double mu;       /* friction of the pointer against the geom; 0: none */
  hapi_patch_contact at;
} hapi_tool_point;

/* ---- physics -> haptic: the local model ---- */

typedef struct hapi_model_body {
  uint32_t slot;
  uint32_t generation;
  uint32_t flags;
  uint32_t epoch;     /* another one than before: the loop goes on from this pose and twist */
  hap_pose pose;      /* at hapi_model.state_ns */
  hap_twist twist;    /* at hapi_model.state_ns */
  double b[6];        /* acceleration term of eq. 2: m/s^2, rad/s^2 */
  double residual[6]; /* velocity that the linear model missed (eq. 14), running total since the
                         slot's generation began: m/s, rad/s */

  double impulse_taken[6]; /* of hapi_state_body.impulse and .angular_impulse: in the twist above */

  /* Model CONTACT only. */
  double mass;
  double gravity[3];     /* m/s^2; zero where the body has none */
  double user_wrench[6]; /* N, N m about the centre of mass: the application's, held */
  double linear_keep;    /* share of the velocity that damping leaves after a tick */
  double angular_keep;
  double linear_threshold2; /* m^2/s^2: damping acts above it */
  double angular_threshold2;
  double max_angular_speed;  /* rad/s */
  double inertia[9];         /* kg m^2, body frame, row-major */
  double inverse_inertia[9]; /* body frame, row-major */
  double gain_taken[6];      /* of hapi_state_body.gain, the same */
  double response[6][6];     /* MEASURED: velocity change per impulse at the centre, world axes */
} hapi_model_body;

typedef struct hapi_model_contact {
  uint32_t slot;
  uint32_t generation;
  uint32_t body; /* slot; HAPI_SLOT_NONE: part of the static world */
  uint32_t pointer;
  uint32_t pointer_generation;
  uint32_t has_shape;    /* shape and shape_pose can be asked for the nearest point at every tick */
  double point_body[3];  /* contact point, body frame (world frame for the static world) */
  double normal_body[3]; /* unit, out of the body */
  double a[6][3];        /* accelerance of eq. 6: force at the contact point, world axes */
  double turn[6];        /* the same of a torque about the normal: soft finger, model ACCELERANCE */
  double mu;             /* friction of the pointer against the body; 0: none */
  hapi_shape shape;      /* one with a closed form against a sphere */
  hap_pose shape_pose;   /* in the body's frame */
  uint32_t tool;         /* of a hull: 1 + index into the model's tool points; 0: of a sphere */
} hapi_model_contact;

/* Cross accelerance: what a force at a pointer contact does to another body. */
typedef struct hapi_model_cross {
  uint32_t
      contact;   /* index in the message; the blocks of a contact follow each other, in its order */
  uint32_t body; /* slot */
  double a[6][3]; /* world axes, as hapi_model_contact.a */
} hapi_model_cross;

/* How a joint's error is taken back: ODE's parameters at the tick. */
typedef struct hapi_softness {
  double erp;
  double cfm;
  bool soft; /* a spring and damper: the correction stays in the velocity */
} hapi_softness;

enum {
  HAPI_LIMIT_LOW = 1, /* there is such a stop */
  HAPI_LIMIT_HIGH = 2,
  HAPI_LIMIT_LOCKED = 4, /* both at the same place: neither stop nor motor */
  HAPI_LIMIT_MOTOR = 8
};

/* Stops and motor of one free axis. Positions as ODE measures them: how far the first body is turned or
 * moved against the second one, rad or m. */
typedef struct hapi_model_limit {
  uint32_t flags;
  double low;
  double high;
  hapi_softness stop;
  double bounce;
  double speed;     /* of the motor: rad/s, m/s */
  double force;     /* its largest torque or force: N m, N */
  double motor_cfm; /* (rad/s)/(N m), (m/s)/N: the same at every step */
  double fudge;     /* share of the force while it drives away from a stop */
} hapi_model_limit;

typedef enum hapi_joint_kind {
  HAPI_JOINT_BALL,
  HAPI_JOINT_HINGE,
  HAPI_JOINT_SLIDER,
  HAPI_JOINT_UNIVERSAL,
  HAPI_JOINT_HINGE2,
  HAPI_JOINT_FIXED,
  HAPI_JOINT_MEASURED /* any other: the rows that testing simulations found */
} hapi_joint_kind;

#define HAPI_MEASURED_ROWS 6u
#define HAPI_JOINT_LIMITS 3

/* Wrench on the first body about its centre of mass, with the reaction on the second one. */
typedef struct hapi_measured_row {
  double force[3]; /* frame of the carrier; the longer of force and torque, N and N m, is 1 */
  double torque[3];
  hapi_softness softness;
  double error;   /* m, rad: how far the row was open then */
  double speed;   /* m/s, rad/s: that it asks for beside that, as of a motor */
  double impulse; /* N s, N m s that it took in a tick then */
} hapi_measured_row;

enum {
  HAPI_CARRIER_FIRST = 0,
  HAPI_CARRIER_SECOND = 1,
  HAPI_CARRIER_WORLD = 2
};

/* A free axis of such a joint, of which ODE says where it is. */
typedef struct hapi_measured_axis {
  double direction[3]; /* carrier's frame; of any length, see AMotor */
  uint32_t carrier;
  bool slides;
  double position; /* as of hapi_model_limit, then */
} hapi_measured_axis;

/* What testing simulations found a joint to be, where its bodies were then: the two parts of
 * hapi_joint_place that say that are turn and anchor_b, the centre of the first body in the second one. */
typedef struct hapi_measured_joint {
  uint32_t number; /* of the measurement: another one has other rows */
  uint32_t row_count;
  uint32_t carrier; /* 0, 1: the body that the rows turn with */
  double ahead_s;   /* of hapi_model.state_ns: the measurement is for this time */
  hapi_measured_row rows[HAPI_MEASURED_ROWS];
  double given[6]; /* N, N m on the first body, carrier's frame: of a motor at its limit */
  hapi_measured_axis axes[HAPI_JOINT_LIMITS];
} hapi_measured_joint;

/* Where a joint is, in the frames of its bodies (static world: world frame). Two axes: the one of body a
 * and the one of body b; a universal joint and a hinge-2 turn about both. An angle about an axis goes
 * from something of b to something of a:
 *
 *   hinge               about axis_a from reference_b to reference_a
 *   universal, hinge-2  about axis_a from axis_b to reference_a; about axis_b from reference_b to axis_a */
typedef struct hapi_joint_place {
  double anchor_a[3]; /* slider: the centre of a, and in b where it is at position 0 */
  double anchor_b[3];
  double axis_a[3];      /* unit; slider: of the motion */
  double axis_b[3];      /* hinge: where axis_a is to be */
  double reference_a[3]; /* unit, across axis_a */
  double reference_b[3];
  double turn[4];  /* slider, fixed: orientation of b in the frame of a */
  double cos_axes; /* universal, hinge-2: of the angle that the axes shall have */
  double sin_axes;
} hapi_joint_place;

/* A joint between two bodies of the model, or one and the static world. */
typedef struct hapi_model_joint {
  uint32_t slot;
  uint32_t generation;
  hapi_joint_kind kind;
  uint32_t body_a; /* slot */
  uint32_t generation_a;
  uint32_t body_b; /* HAPI_SLOT_NONE: static world */
  uint32_t generation_b;
  hapi_joint_place place;
  hapi_softness along;   /* hinge-2: the suspension, along axis_a */
  hapi_softness linear;  /* anchors */
  hapi_softness angular; /* orientations */
  hapi_model_limit limits[HAPI_JOINT_LIMITS];
  hapi_measured_joint measured; /* of that kind */
} hapi_model_joint;

typedef struct hapi_model {
  uint64_t number;       /* 1, 2, 3 ... */
  int64_t state_ns;      /* time for which poses, A and b hold */
  int64_t valid_from_ns; /* the loop uses the message from this time on */
  int64_t
      sent_ns; /* drive FRAME: when physics was at work, which may be later than state_ns; else 0 */
  double blend_s;  /* model IMPULSE, interpolated: how long a body takes to its new pose */
  double period_s; /* H, of the next step */
  hap_model model;
  hap_impulse_pose impulse_pose;
  uint32_t wishes;        /* of the effects, base/wishes.h */
  uint32_t max_sweeps;    /* of hapi_solver */
  uint32_t row_updates;   /* its update_budget; 0: as it was */
  int64_t tick_budget_ns; /* ticks that take longer are counted; 0: none are */
  uint32_t
      touches; /* pairs of a pointer and a geom that are near, also those whose points come later */
  uint32_t bounces; /* surfaces and stops that give back speed; model CONTACT */
  uint32_t body_count;
  uint32_t contact_count;
  uint32_t watch_count; /* traced bodies */
  uint32_t joint_count; /* model CONTACT */
  uint32_t tool_count;  /* other models: model CONTACT has them of the contact thread */
  uint32_t cross_count; /* model ACCELERANCE */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t joints_offset;
  uint32_t tools_offset;
  uint32_t crosses_offset;
  uint32_t watch_slot[HAP_TRACE_BODIES_MAX];      /* HAPI_SLOT_NONE: not local */
  double watch_position[HAP_TRACE_BODIES_MAX][3]; /* at state_ns */
} hapi_model;

static inline hapi_model_body *hapi_model_bodies(hapi_model *m)
{
  return (hapi_model_body *)(void *)((char *)m + m->bodies_offset);
}

static inline hapi_model_contact *hapi_model_contacts(hapi_model *m)
{
  return (hapi_model_contact *)(void *)((char *)m + m->contacts_offset);
}

static inline hapi_model_joint *hapi_model_joints(hapi_model *m)
{
  return (hapi_model_joint *)(void *)((char *)m + m->joints_offset);
}

static inline hapi_tool_point *hapi_model_tools(hapi_model *m)
{
  return (hapi_tool_point *)(void *)((char *)m + m->tools_offset);
}

static inline hapi_model_cross *hapi_model_crosses(hapi_model *m)
{
  return (hapi_model_cross *)(void *)((char *)m + m->crosses_offset);
}

/* ---- physics -> contact: what may touch what (model CONTACT) ---- */

/* ODE's dSurfaceParameters with fdir1; soft constraints converted from the world's step to the tick
 * (the same spring and damper). */
typedef struct hapi_surface {
  uint32_t flags; /* HAPI_SURFACE_* */
  double mu;      /* with APPROX1: friction coefficient, else N */
  double mu2;
  double direction[3]; /* unit, world: first friction direction, with FDIR1 */
  double bounce;
  double bounce_speed; /* m/s */
  double erp;          /* at the tick */
  double cfm;          /* (m/s)/N at the tick: J v = target - cfm x force */
  double layer;        /* m, depth that is not pushed out */
  double max_push;     /* m/s, largest correcting velocity */
  double motion[3];    /* m/s along friction 1, friction 2, normal */
  double slip[2];      /* m/(N s) */
} hapi_surface;

enum {
  HAPI_SURFACE_APPROX1_1 = 1,
  HAPI_SURFACE_APPROX1_2 = 2,
  HAPI_SURFACE_FDIR1 = 4,
  HAPI_SURFACE_BOUNCE = 8,
  HAPI_SURFACE_SOFT = 16, /* push-out is a spring's, and stays in the velocity */
  HAPI_SURFACE_SLIP1 = 32,
  HAPI_SURFACE_SLIP2 = 64
};

typedef struct hapi_near_geom {
  uint32_t body; /* slot; HAPI_SLOT_NONE: part of the static world */
  uint32_t generation;
  hapi_shape shape;    /* hull: not set here, see hull_first */
  double extent;       /* m, of a hull: farthest point from the frame's origin */
  uint32_t hull_first; /* into the message's points */
  uint32_t open_edges; /* a triangle of a mesh: bits 0, 1, 2 for edges that may be touched, as no
                          neighbour goes on there in the same plane or rises; bit 3: a triangle */
  hap_pose pose;       /* in the body's frame; world for the static world */
} hapi_near_geom;

typedef struct hapi_near_pair {
  uint64_t key; /* the same as long as the pair is */
  uint32_t geom_a;
  uint32_t geom_b;
  hapi_surface surface;
} hapi_near_pair;

/* A body of the message, for poses that the loop has not yet told. */
typedef struct hapi_near_body {
  uint32_t slot;
  uint32_t generation;
  hap_pose pose;
  hap_twist twist;
} hapi_near_body;

/* A pointer that is a hull. */
typedef struct hapi_near_tool {
  uint32_t pointer;
  uint32_t generation;
  double radius; /* m, of the rounding */
  double extent; /* m, from the frame's origin to the farthest point of the surface */
  hap_pose pose; /* world, for one that the loop has not yet told */
  hap_twist twist;
  hapi_tool_hull hull;
} hapi_near_tool;

typedef struct hapi_near_tool_pair {
  uint64_t key; /* of a mesh: of all of its triangles */
  uint32_t tool;
  uint32_t geom;
  double mu; /* of its points */
} hapi_near_tool_pair;

typedef struct hapi_near {
  uint64_t model_number; /* of the model that it belongs to */
  uint32_t body_count;
  uint32_t geom_count;
  uint32_t pair_count;
  uint32_t point_count;
  uint32_t tool_count;
  uint32_t tool_pair_count; /* those of a key follow each other */
  uint32_t between;         /* passes are made between two syncs as well */
  uint32_t always;          /* and also where there is nothing to find */
  double contact_hz;        /* passes are made so often */
  uint32_t bodies_offset;
  uint32_t geoms_offset;
  uint32_t pairs_offset;
  uint32_t points_offset;
  uint32_t tools_offset;
  uint32_t tool_pairs_offset;
} hapi_near;

static inline hapi_near_body *hapi_near_bodies(hapi_near *n)
{
  return (hapi_near_body *)(void *)((char *)n + n->bodies_offset);
}

static inline hapi_near_geom *hapi_near_geoms(hapi_near *n)
{
  return (hapi_near_geom *)(void *)((char *)n + n->geoms_offset);
}

static inline hapi_near_pair *hapi_near_pairs(hapi_near *n)
{
  return (hapi_near_pair *)(void *)((char *)n + n->pairs_offset);
}

static inline double *hapi_near_points(hapi_near *n)
{
  return (double *)(void *)((char *)n + n->points_offset);
}

static inline hapi_near_tool *hapi_near_tools(hapi_near *n)
{
  return (hapi_near_tool *)(void *)((char *)n + n->tools_offset);
}

static inline hapi_near_tool_pair *hapi_near_tool_pairs(hapi_near *n)
{
  return (hapi_near_tool_pair *)(void *)((char *)n + n->tool_pairs_offset);
}

/* ---- haptic -> contact: where the bodies are (model CONTACT) ---- */

typedef struct hapi_poses_body {
  uint32_t slot;
  uint32_t generation;
  hap_pose pose;
  hap_twist twist;
} hapi_poses_body;

typedef struct hapi_poses_pointer {
  uint32_t generation; /* 0: no hull here */
  hap_pose pose;
  hap_twist twist;
} hapi_poses_pointer;

typedef struct hapi_poses {
  uint64_t model_number; /* the local model in use */
  uint32_t body_count;
  uint32_t bodies_offset;
  uint32_t pointers_offset; /* capacity.pointers */
} hapi_poses;

static inline hapi_poses_body *hapi_poses_bodies(hapi_poses *p)
{
  return (hapi_poses_body *)(void *)((char *)p + p->bodies_offset);
}

static inline hapi_poses_pointer *hapi_poses_pointers(hapi_poses *p)
{
  return (hapi_poses_pointer *)(void *)((char *)p + p->pointers_offset);
}

/* ---- contact -> haptic: contacts between bodies (model CONTACT) ---- */

typedef struct hapi_patches {
  uint64_t number;       /* 1, 2, 3 ... */
  uint64_t model_number; /* of the hapi_near that it was made from */
  int64_t valid_from_ns; /* the loop uses the message from this time on */
  uint32_t contact_count;
  uint32_t surface_count;
  uint32_t tool_count; /* of pointers that are hulls; those of a key follow each other */
  uint32_t contacts_offset;
  uint32_t surfaces_offset;
  uint32_t tools_offset;
} hapi_patches;

static inline hapi_patch_contact *hapi_patches_contacts(hapi_patches *p)
{
  return (hapi_patch_contact *)(void *)((char *)p + p->contacts_offset);
}

static inline hapi_surface *hapi_patches_surfaces(hapi_patches *p)
{
  return (hapi_surface *)(void *)((char *)p + p->surfaces_offset);
}

static inline hapi_tool_point *hapi_patches_tools(hapi_patches *p)
{
  return (hapi_tool_point *)(void *)((char *)p + p->tools_offset);
}

/* ---- haptic -> physics: the state of the loop after a tick ---- */

typedef struct hapi_state_pointer {
  uint32_t generation; /* 0: no pointer here */
  uint32_t collide_bits;
  double radius;
  double stiffness;
  double friction;
  double finger_radius;
  hap_pose pose;
  hap_twist twist;
  uint32_t is_tool; /* a hull: see hapi_state_hulls */
  double extent;    /* m, of a hull as in hapi_near_tool, else the radius */
} hapi_state_pointer;

typedef struct hapi_state_body {
  uint32_t generation; /* 0: slot never used */
  uint32_t flags;      /* HAPI_BODY_RESTING while nothing has pushed it */
  uint32_t epoch;      /* of the newest model in use */
  uint32_t reserved;
  hap_pose pose;
  hap_twist twist;
  double impulse[3];         /* N s, running total since the slot's generation began of what the
                                pointers, and in model CONTACT the bodies of the range, gave to the
                                body while the loop did not own it */
  double angular_impulse[3]; /* N m s, the same about the centre of mass */
  double residual[6];        /* how much of hapi_model_body.residual is in the twist */
  double gain[6]; /* N s, N m s, running total of what pointers gave while the loop owned it */
  int64_t
      owned_until_ns;  /* when the loop owned it for the last time; 0: it never did. The tick's own
                             time while it owns it */
  hap_pose owned_pose; /* where the loop left it then */
  hap_twist owned_twist;
} hapi_state_body;

typedef struct hapi_state_contact {
  uint32_t slot;
  uint32_t generation;
  double force[3]; /* N on the body at this tick */
} hapi_state_contact;

/* Since the begin, of the ticks for which there was a budget. */
typedef struct hapi_tick_load {
  uint64_t ticks;
  uint64_t over;
  double spent_ns;
} hapi_tick_load;

/* How far a pointer contact that is closed is pulled along the surface, of those with friction. */
typedef struct hapi_state_spring {
  uint32_t slot;       /* of the contact; HAPI_SLOT_NONE: of a point of a hull, by the next two */
  uint32_t generation; /* of the contact */
  uint64_t key;        /* of hull and geom */
  double place[3];     /* m, of the point on the hull */
  double stretch_body[3]; /* m, of the pointer ahead of the body, in the body's frame */
  double turn;            /* rad, likewise, about the normal */
} hapi_state_spring;

typedef struct hapi_state {
  uint64_t model_number;   /* the local model in use; 0: none yet */
  int64_t now_ns;          /* time for which the poses hold */
  double hand_impulse[3];  /* N s, given to bodies that can move by all pointers since start */
  double owned_impulse[3]; /* N s, what bodies that the loop owns got of it, and from bodies that it
                              does not own */
  hapi_tick_load load;
  hap_model model;
  uint32_t body_high; /* slots 0 .. body_high - 1 are in the message */
  uint32_t contact_count;
  uint32_t pointer_count; /* slots */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t pointers_offset;
  uint32_t hulls_offset;
  uint32_t spring_count;
  uint32_t spring_capacity; /* 0: nobody wants to know */
  uint32_t springs_offset;
} hapi_state;

static inline hapi_state_body *hapi_state_bodies(hapi_state *s)
{
  return (hapi_state_body *)(void *)((char *)s + s->bodies_offset);
}

static inline hapi_state_contact *hapi_state_contacts(hapi_state *s)
{
  return (hapi_state_contact *)(void *)((char *)s + s->contacts_offset);
}

static inline hapi_state_pointer *hapi_state_pointers(hapi_state *s)
{
  return (hapi_state_pointer *)(void *)((char *)s + s->pointers_offset);
}

static inline hapi_state_spring *hapi_state_springs(hapi_state *s)
{
  return (hapi_state_spring *)(void *)((char *)s + s->springs_offset);
}

/* By pointer; of one that is a sphere not set. */
static inline hapi_tool_hull *hapi_state_hulls(hapi_state *s)
{
  return (hapi_tool_hull *)(void *)((char *)s + s->hulls_offset);
}

#endif
