/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_STATE_H
#define HAPODE_SYNC_STATE_H

/* haptic -> physics: the state of the loop after a tick. */

#include <hapode/forces.h>

#include "sync/message.h"

typedef struct hapi_state_pointer {
  uint32_t generation; /* 0: no pointer here */
  uint32_t collide_bits;
  double radius;
  double stiffness;
  double damping;
  double friction;
  double finger_radius;
  double magnet_hold; /* N/m: a surface that pulls more steeply is cut */
  hap_pose pose;
  hap_twist twist;
  double apart[3];      /* m, of a proxy: from it to the hand */
  double hold;          /* N/m, of a proxy: of the hand against what it touches; else 0 */
  uint32_t is_tool;     /* a hull: see hapi_state_hulls */
  double extent;        /* m, of a hull as in hapi_near_tool, else the radius */
  uint32_t bound_count; /* bodies to which own forces are bound; the births of them: */
  uint64_t bound[HAP_FORCES_MAX];
  uint64_t held; /* birth of the body that it holds or is to hold; 0: none */
} hapi_state_pointer;

/* Of a body that has left the model the loop writes it once into each message: who takes a message
 * leaves its bodies as they are. */
typedef struct hapi_state_body {
  uint32_t generation; /* 0: slot never used */
  uint32_t flags;      /* HAPI_BODY_RESTING while nothing has pushed it */
  uint32_t epoch;      /* of the newest model in use */
  uint32_t reserved;
  hap_pose pose;
  hap_twist twist;
  double impulse[3];         /* N s, since the slot's generation began: what pointers, and in model
                                CONTACT bodies of the range, gave while the loop did not own it */
  double angular_impulse[3]; /* N m s, the same about the centre of mass */
  double residual[6];        /* how much of hapi_model_body.residual is in the twist */
  double gain[6]; /* N s, N m s, running total: what pointers gave while the loop owned it */
  int64_t owned_until_ns; /* last tick in which the loop owned it; 0: none */
  hap_pose owned_pose;    /* at that tick */
  hap_twist owned_twist;  /* in the world's time */
} hapi_state_body;

typedef struct hapi_state_contact {
  uint32_t slot;
  uint32_t generation;
  uint32_t touches; /* of a sphere: what follows holds */
  uint32_t reserved;
  double depth;     /* m, of the pointer in the geom */
  double force[3];  /* N on the body at this tick */
  double ball[3];   /* m, body frame: centre of the pointer if it could not enter the geom */
  double normal[3]; /* unit, body frame: of the surface there */
} hapi_state_contact;

/* Running totals of a joint, since its slot's generation began. */
typedef struct hapi_joint_given {
  double seconds;       /* of the ticks that they are of */
  double impulse[2][6]; /* N s, N m s about the centres of mass, on the first and the second body */
} hapi_joint_given;

/* Since the start, of the ticks that had a budget. */
typedef struct hapi_tick_load {
  uint64_t ticks;
  uint64_t over;
  double spent_ns;
} hapi_tick_load;

/* The work of a tick is counted in row updates of the solver: what it takes to make a row, or to
 * keep it, and what a row costs where bodies are pushed: one of twenty is made, and each is swept
 * two to three times. */
#define HAPI_ROW_MAKING 8u
#define HAPI_ROW_KEEPING 2u
#define HAPI_ROW_WORK 5u

/* Of ticks of model CONTACT. */
typedef struct hapi_tick_work {
  uint64_t ticks; /* this and the next three since the start */
  uint64_t done;
  double spent_ns;
  uint64_t late;  /* ticks with much work that took most of their period */
  uint32_t rows;  /* of the newest tick */
  uint32_t owned; /* bodies of the loop in it */
  uint32_t awake; /* those of them that do not rest, and so have rows */
} hapi_tick_work;

/* What a joint did to its bodies, for dJointFeedback. */
typedef struct hapi_state_joint {
  uint32_t slot;
  uint32_t generation;
  uint32_t body_a; /* slot of the body that comes first */
  uint32_t reserved;
  hapi_joint_given given;
} hapi_state_joint;

/* How far a closed pointer contact with friction is stretched along the surface. */
typedef struct hapi_state_spring {
  uint32_t slot; /* of the contact; HAPI_SLOT_NONE: a point of a hull, told by key and place */
  uint32_t generation;    /* of the contact */
  uint64_t key;           /* of hull and geom */
  double place[3];        /* m, of the point on the hull */
  double stretch_body[3]; /* m, of the pointer ahead of the body, in the body's frame */
  double turn;            /* rad, likewise, about the normal */
} hapi_state_spring;

typedef struct hapi_state {
  uint64_t tick;           /* the next one */
  uint64_t model_number;   /* the local model in use; 0: none yet */
  int64_t now_ns;          /* time for which the poses hold */
  double time_scale;       /* of that model: velocities and impulses are in the hand's time */
  double hand_impulse[3];  /* N s, given to bodies that can move by all pointers since start */
  double owned_impulse[3]; /* N s, what the loop's bodies got of it, and from bodies of ODE */
  hapi_tick_load load;
  bool derated;       /* since the start: some tick had less force because ticks came late */
  bool swings;        /* the same because a device swung by itself */
  uint32_t force_out; /* hap_force_out of the call that was taken out last; 0: none was */
  bool texture_out;   /* since the start the function of some texture was taken out */
  hapi_tick_work work;
  uint32_t unsolved; /* since the start: ticks in a row, at most, that the solver did not solve */
  hap_model model;
  uint32_t body_high; /* slots 0 .. body_high - 1 are in the message */
  uint32_t contact_count;
  uint32_t pointer_count; /* slots */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t pointers_offset;
  uint32_t hulls_offset;
  uint32_t spring_count;
  uint32_t spring_capacity; /* 0: springs are not told */
  uint32_t springs_offset;
  uint32_t joint_count;
  uint32_t joints_offset;
  uint32_t side_count;
  uint32_t sides_offset;
} hapi_state;

HAPI_MESSAGE_ARRAY(hapi_state_bodies, hapi_state, hapi_state_body, bodies_offset)
HAPI_MESSAGE_ARRAY(hapi_state_contacts, hapi_state, hapi_state_contact, contacts_offset)
HAPI_MESSAGE_ARRAY(hapi_state_pointers, hapi_state, hapi_state_pointer, pointers_offset)
HAPI_MESSAGE_ARRAY(hapi_state_springs, hapi_state, hapi_state_spring, springs_offset)
HAPI_MESSAGE_ARRAY(hapi_state_joints, hapi_state, hapi_state_joint, joints_offset)
HAPI_MESSAGE_ARRAY(hapi_state_sides, hapi_state, hapi_tool_side, sides_offset)

/* Whether a pointer holds a body, or some own force is bound to one. NULL: none. */
static inline bool hapi_state_holds(hapi_state *state)
{
  bool any = false;
  for (uint32_t i = 0; state != NULL && i < state->pointer_count; ++i) {
    const hapi_state_pointer *pointer = &hapi_state_pointers(state)[i];
    any = any || (pointer->generation != 0 && (pointer->held != 0 || pointer->bound_count > 0));
  }
  return any;
}

/* By pointer; not set for a sphere. */
HAPI_MESSAGE_ARRAY(hapi_state_hulls, hapi_state, hapi_tool_hull, hulls_offset)

#endif
