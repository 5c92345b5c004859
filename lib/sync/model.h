/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MODEL_H
#define HAPODE_SYNC_MODEL_H

/* physics -> haptic: the local model. */

#include "proximity/patch.h"
#include "sync/joint.h"
#include "sync/message.h"
#include "sync/patches.h"

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
  uint32_t contact; /* index in the message; blocks lie in the order of the contacts */
  uint32_t body;    /* slot */
  double a[6][3];   /* world axes, as hapi_model_contact.a */
} hapi_model_cross;

typedef struct hapi_model {
  uint64_t number;       /* 1, 2, 3 ... */
  int64_t state_ns;      /* time for which poses, A and b hold */
  int64_t valid_from_ns; /* the loop uses the message from this time on */
  int64_t sent_ns;       /* drive FRAME: when physics computed, state_ns or later; else 0 */
  double blend_s;        /* model IMPULSE, interpolated: how long a body takes to its new pose */
  double period_s;       /* H, of the next step */
  hap_model model;
  hap_impulse_pose impulse_pose;
  uint32_t wishes;        /* of the effects, base/wishes.h */
  uint32_t max_sweeps;    /* of hapi_solver */
  uint32_t row_updates;   /* its update_budget; 0: unchanged */
  int64_t tick_budget_ns; /* ticks that take longer are counted; 0: none are */
  uint32_t touches;       /* near pairs of pointer and geom, also those whose points come later */
  uint32_t bounces;       /* surfaces and stops that bounce; model CONTACT */
  uint32_t body_count;
  uint32_t contact_count;
  uint32_t watch_count; /* traced bodies */
  uint32_t joint_count; /* model CONTACT */
  uint32_t tool_count;  /* of models but CONTACT, where the contact thread tells them */
  uint32_t cross_count; /* model ACCELERANCE */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t joints_offset;
  uint32_t tools_offset;
  uint32_t crosses_offset;
  uint32_t watch_slot[HAP_TRACE_BODIES_MAX];      /* HAPI_SLOT_NONE: not local */
  double watch_position[HAP_TRACE_BODIES_MAX][3]; /* at state_ns */
} hapi_model;

HAPI_MESSAGE_ARRAY(hapi_model_bodies, hapi_model, hapi_model_body, bodies_offset)
HAPI_MESSAGE_ARRAY(hapi_model_contacts, hapi_model, hapi_model_contact, contacts_offset)
HAPI_MESSAGE_ARRAY(hapi_model_joints, hapi_model, hapi_model_joint, joints_offset)
HAPI_MESSAGE_ARRAY(hapi_model_tools, hapi_model, hapi_tool_point, tools_offset)
HAPI_MESSAGE_ARRAY(hapi_model_crosses, hapi_model, hapi_model_cross, crosses_offset)

#endif
