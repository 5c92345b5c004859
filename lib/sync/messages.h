/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_MESSAGES_H
#define HAPODE_SYNC_MESSAGES_H

/* What the threads tell each other. A message is one block: a header and arrays behind it at
 * offsets, no pointers. Bodies and contacts have slots, small numbers that physics gives out; a
 * slot's generation tells one user of the slot from the next. World frame, SI. */

#include <stdint.h>

#include <hapode/record.h>
#include <hapode/session.h>
#include <hapode/spatial.h>

#define HAPI_SLOT_NONE 0xffffffffu

typedef struct hapi_capacity {
  uint32_t bodies;
  uint32_t contacts;
  uint32_t pointers;
} hapi_capacity;

enum {
  HAPI_BODY_DRIVEN = 1,  /* moved by the application: keeps its twist, feels no force */
  HAPI_BODY_RESTING = 2, /* asleep in the world: does not move until it is pushed */
  HAPI_BODY_FOLLOWS = 4 /* not pushed in the interval before: the world's state is the better one */
};

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
} hapi_model_body;

typedef struct hapi_model_contact {
  uint32_t slot;
  uint32_t generation;
  uint32_t body; /* slot; HAPI_SLOT_NONE: part of the static world */
  uint32_t pointer;
  uint32_t pointer_generation;
  uint32_t reserved;
  double point_body[3];  /* contact point, body frame (world frame for the static world) */
  double normal_body[3]; /* unit, out of the body */
  double a[6][3];        /* accelerance of eq. 6: force at the contact point, world axes */
} hapi_model_contact;

typedef struct hapi_model {
  uint64_t number;       /* 1, 2, 3 ... */
  int64_t state_ns;      /* time for which poses, A and b hold */
  int64_t valid_from_ns; /* the loop uses the message from this time on */
  double blend_s;        /* model IMPULSE, interpolated: how long a body takes to its new pose */
  hap_model model;
  hap_impulse_pose impulse_pose;
  uint32_t body_count;
  uint32_t contact_count;
  uint32_t watch_count; /* traced bodies */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t reserved;
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

/* ---- haptic -> physics: the state of the loop after a tick ---- */

typedef struct hapi_state_pointer {
  uint32_t generation; /* 0: no pointer here */
  uint32_t collide_bits;
  double radius;
  double stiffness;
  hap_pose pose;
  hap_twist twist;
} hapi_state_pointer;

typedef struct hapi_state_body {
  uint32_t generation; /* 0: slot never used */
  uint32_t flags;      /* HAPI_BODY_RESTING while nothing has pushed it */
  uint32_t epoch;      /* of the newest model in use */
  uint32_t reserved;
  hap_pose pose;
  hap_twist twist;
  double impulse[3];         /* N s, running total of the pointers' force since the slot's
                                generation began */
  double angular_impulse[3]; /* N m s, the same about the centre of mass */
  double residual[6];        /* how much of hapi_model_body.residual is in the twist */
} hapi_state_body;

typedef struct hapi_state_contact {
  uint32_t slot;
  uint32_t generation;
  double force[3]; /* N on the body at this tick */
} hapi_state_contact;

typedef struct hapi_state {
  uint64_t model_number;  /* the local model in use; 0: none yet */
  double hand_impulse[3]; /* N s, given to bodies that can move by all pointers since start */
  hap_model model;
  uint32_t body_high; /* slots 0 .. body_high - 1 are in the message */
  uint32_t contact_count;
  uint32_t pointer_count; /* slots */
  uint32_t bodies_offset;
  uint32_t contacts_offset;
  uint32_t pointers_offset;
  uint32_t reserved;
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

#endif
