/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_JOINT_H
#define HAPODE_SYNC_JOINT_H

/* A joint as physics tells it to the loop. */

#include <stdbool.h>
#include <stdint.h>

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
  HAPI_LIMIT_MOTOR = 8
};

/* Stops and motor of one free axis. Positions as ODE measures them: how far the first body is
 * turned or moved against the second one, rad or m. */
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
  hapi_joint_place place;
  hapi_softness along;   /* hinge-2: the suspension, along axis_a */
  hapi_softness linear;  /* anchors */
  hapi_softness angular; /* orientations */
  hapi_model_limit limits[HAPI_JOINT_LIMITS];
  hapi_measured_joint measured; /* of that kind */
} hapi_model_joint;

#endif
