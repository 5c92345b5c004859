/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MODEL_H
#define HAPODE_SYNC_MODEL_H

/* physics -> haptic: the local model. */

#include "base/axis_spring.h"
#include "proximity/ball_among.h"
#include "proximity/patch.h"
#include "sync/feel.h"
#include "sync/message.h"
#include "sync/patches.h"

/* ---- joints ---- */

/* How a joint's error is corrected: ODE's parameters, converted to the tick. */
typedef struct hapi_softness {
  double erp;
  double cfm;
  bool soft; /* a spring and damper: the correction stays in the velocity */
} hapi_softness;

enum {
  HAPI_LIMIT_LOW = 1, /* there is such a stop */
  HAPI_LIMIT_HIGH = 2,
  HAPI_LIMIT_LOCKED = 4, /* both at the same place: neither stop nor motor */
  HAPI_LIMIT_MOTOR = 8,
  HAPI_LIMIT_SPRING = 16
};

/* Stops, motor and spring of one free axis. Positions as ODE measures them: how far the first body
 * is turned or moved against the second one, rad or m. */
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
  hapi_axis_spring spring;
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
  double error;   /* m, rad: how far the row was open at the measurement */
  double speed;   /* m/s, rad/s: what a motor asks for, besides the correction of the error */
  double impulse; /* N s, N m s: of one tick at the measurement */
} hapi_measured_row;

enum {
  HAPI_CARRIER_FIRST = 0,
  HAPI_CARRIER_SECOND = 1,
  HAPI_CARRIER_WORLD = 2
};

/* A free axis of a measured joint; ODE tells its position. */
typedef struct hapi_measured_axis {
  double direction[3]; /* carrier's frame; of any length, see AMotor */
  uint32_t carrier;
  bool slides;
  double position; /* at the measurement, as in hapi_model_limit */
} hapi_measured_axis;

/* A joint as testing simulations found it. Where its bodies were is in two members of
 * hapi_joint_place: turn, and anchor_b, which is the centre of the first body in the second one. */
typedef struct hapi_measured_joint {
  uint32_t number; /* of the measurement: rows of another number are other rows */
  uint32_t row_count;
  uint32_t carrier; /* 0, 1: the body that the rows turn with */
  double ahead_s;   /* of hapi_model.state_ns: the measurement is for this time */
  hapi_measured_row rows[HAPI_MEASURED_ROWS];
  double given[6]; /* N, N m on the first body, carrier's frame: of a motor at its limit */
  hapi_measured_axis axes[HAPI_JOINT_LIMITS];
} hapi_measured_joint;

/* Where a joint is, in the frames of its bodies (static world: world frame). Two axes: one of body
 * a and one of body b; a universal joint and a hinge-2 turn about both. Angles go from b to a:
 *
 *   hinge               about axis_a, from reference_b to reference_a
 *   universal, hinge-2  about axis_a, from axis_b to reference_a;
 *                       about axis_b, from reference_b to axis_a */
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
  uint32_t told; /* the application listens to its dJointFeedback */
  hapi_joint_place place;
  hapi_softness along;   /* hinge-2: the suspension, along axis_a */
  hapi_softness linear;  /* anchors */
  hapi_softness angular; /* orientations */
  hapi_model_limit limits[HAPI_JOINT_LIMITS];
  hapi_measured_joint measured; /* of that kind */
} hapi_model_joint;

/* ---- driven bodies ---- */

#define HAPI_COURSE_ORDER 5

/* How a driven body is expected to go until the next sync: its way since hapi_model.state_ns, the
 * sum of ways[k] t^(k + 1), t in s; after the period as fast as at its end. */
typedef struct hapi_model_course {
  uint32_t leaps;  /* it is put back at syncs: no difference is brought in */
  uint32_t begins; /* it was part of the static world until now, at: */
  hap_pose before;
  double period_s;
  double ways[HAPI_COURSE_ORDER][6]; /* m, rad, world axes */
} hapi_model_course;

/* ---- the model ---- */

typedef struct hapi_model_body {
  uint32_t slot;
  uint32_t generation;
  uint32_t flags;
  uint32_t epoch;     /* where it changes, the loop goes on from this pose and twist */
  hap_pose pose;      /* at hapi_model.state_ns */
  hap_twist twist;    /* at hapi_model.state_ns */
  double b[6];        /* acceleration term of eq. 2: m/s^2, rad/s^2 */
  double residual[6]; /* m/s, rad/s, since the slot's generation began: what the linear model missed
                         of the velocity (eq. 14) */

  double impulse_taken[6]; /* of hapi_state_body.impulse and .angular_impulse: in the twist above */

  uint64_t birth;   /* of the body: no other has ever the same */
  double held_mass; /* kg, of one that a pointer holds or pulls, also beside CONTACT; else 0 */
  hapi_tag tag;     /* NULL: a body of the session itself */
  uint32_t course;  /* of a driven one: 1 + index into the model's courses; 0: by its twist */

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
  double brace[6];           /* BRACED: N, N m at the centre, world axes */
  double response[6][6];     /* MEASURED: velocity change per impulse at the centre, world axes */
} hapi_model_body;

/* The triangles of a surface near a pointer. */
typedef struct hapi_told {
  uint32_t first; /* of the model's triangles, which are in the body's frame */
  uint32_t count; /* 0: the surface is not told in triangles */
  double at[3];   /* m, body frame: all triangles are told that come nearer than this */
  double within;  /* m */
} hapi_told;

typedef struct hapi_model_contact {
  uint32_t slot;
  uint32_t generation;
  uint32_t body; /* slot; HAPI_SLOT_NONE: part of the static world */
  uint32_t pointer;
  uint32_t pointer_generation;
  uint32_t has_shape;    /* shape and shape_pose can be asked for the nearest point at every tick */
  uint32_t hidden;       /* by a nearer one, of the same surface: it does not push */
  uint32_t feel;         /* number of a hapi_model_feel; 0: as the pointer has it */
  double point_body[3];  /* contact point, body frame (world frame for the static world) */
  double normal_body[3]; /* unit, out of the body */
  double a[6][3];        /* accelerance of eq. 6: force at the contact point, world axes */
  double turn[6];        /* the same of a torque about the normal: soft finger, model ACCELERANCE */
  double mu;             /* friction of the pointer against the body; 0: none; the static one */
  hapi_shape shape;      /* one with a closed form against a sphere */
  hap_pose shape_pose;   /* in the body's frame */
  uint32_t tool;         /* of a hull: 1 + index into the model's tool points; 0: of a sphere */
  hapi_tag geom;
  uint64_t geom_number; /* of a sphere: no other geom near the pointers has it */
  hapi_told told;       /* of the surface, where it is told in triangles */
} hapi_model_contact;

/* Of a pointer and a geom near it. */
typedef struct hapi_model_feel {
  uint32_t number; /* of the pair, as long as the two are near each other */
  uint32_t pointer;
  hapi_feel feel;
} hapi_model_feel;

/* Cross accelerance: what a force at a pointer contact does to another body. */
typedef struct hapi_model_cross {
  uint32_t contact; /* index in the message; blocks lie in the order of the contacts */
  uint32_t body;    /* slot */
  double a[6][3];   /* world axes, as hapi_model_contact.a */
} hapi_model_cross;

/* A hand of another loop, which the loop has to simulate with its own ones. In contacts, feels and
 * the near message its pointer has the number capacity.pointers + number. */
typedef struct hapi_model_hand {
  uint32_t number;
  uint32_t generation;
  double radius;
  double stiffness;
  double damping;
  double friction;
  double finger_radius;
  hap_pose pose;
  hap_twist twist;
  hapi_tool_hull hull; /* count 0: it is a sphere */
} hapi_model_hand;

typedef struct hapi_model {
  uint64_t number;       /* 1, 2, 3 ... */
  uint64_t tick;         /* of the hapi_state that it was made from */
  int64_t state_ns;      /* time for which poses, A and b hold */
  int64_t valid_from_ns; /* the loop uses the message from this time on */
  int64_t sent_ns;       /* drive FRAME: when physics computed, state_ns or later; else 0 */
  double blend_s;        /* model IMPULSE, interpolated: how long a body takes to its new pose */
  double period_s;       /* H, of the next step */
  double look_ahead_s;   /* by which the message may come later than without a network */
  double time_scale;     /* what passes for bodies in a second; theirs here is the hand's time */
  hap_model model;
  hap_impulse_pose impulse_pose;
  uint32_t wishes;        /* of the effects, base/wishes.h */
  uint32_t max_sweeps;    /* of hapi_solver */
  uint32_t row_updates;   /* its update_budget; 0: unchanged */
  double force_drift;     /* 1/s, drift of hapi_rows */
  uint64_t tick_work;     /* row updates that a tick has time for; 0: no bound */
  int64_t tick_budget_ns; /* ticks that take longer are counted; 0: none are */
  uint32_t touches;       /* near pairs of pointer and geom, also those whose points come later */
  uint32_t bounces;       /* surfaces and stops that bounce; model CONTACT */
  uint32_t body_count;
  uint32_t contact_count;
  uint32_t watch_count;    /* traced bodies */
  uint32_t joint_count;    /* model CONTACT */
  uint32_t tool_count;     /* of models but CONTACT, where the contact thread tells them */
  uint32_t cross_count;    /* model ACCELERANCE */
  uint32_t course_count;   /* of models but CONTACT those alone that begin */
  uint32_t triangle_count; /* model CONTACT */
  uint32_t feel_count;
  uint32_t hand_count; /* 0 where the loop is beside its world */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t joints_offset;
  uint32_t tools_offset;
  uint32_t crosses_offset;
  uint32_t courses_offset;
  uint32_t triangles_offset;
  uint32_t feels_offset;
  uint32_t hands_offset;
  uint32_t watch_slot[HAP_TRACE_BODIES_MAX];      /* HAPI_SLOT_NONE: not local */
  double watch_position[HAP_TRACE_BODIES_MAX][3]; /* at state_ns */
} hapi_model;

HAPI_MESSAGE_ARRAY(hapi_model_bodies, hapi_model, hapi_model_body, bodies_offset)
HAPI_MESSAGE_ARRAY(hapi_model_contacts, hapi_model, hapi_model_contact, contacts_offset)
HAPI_MESSAGE_ARRAY(hapi_model_joints, hapi_model, hapi_model_joint, joints_offset)
HAPI_MESSAGE_ARRAY(hapi_model_tools, hapi_model, hapi_tool_point, tools_offset)
HAPI_MESSAGE_ARRAY(hapi_model_courses, hapi_model, hapi_model_course, courses_offset)
HAPI_MESSAGE_ARRAY(hapi_model_crosses, hapi_model, hapi_model_cross, crosses_offset)
HAPI_MESSAGE_ARRAY(hapi_model_triangles, hapi_model, hapi_triangle, triangles_offset)
HAPI_MESSAGE_ARRAY(hapi_model_feels, hapi_model, hapi_model_feel, feels_offset)
HAPI_MESSAGE_ARRAY(hapi_model_hands, hapi_model, hapi_model_hand, hands_offset)

#endif
