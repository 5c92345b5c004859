/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_NEAR_SLOTS_H
#define HAPODE_NEAR_SLOTS_H

/* What the loop knows, by small numbers: a slot for each body and each contact of a model. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/effects.h>
#include <ode/ode.h>

#include "proximity/proximity.h"
#include "sync/messages.h"

typedef struct hapi_nearby hapi_nearby;

typedef enum hapi_slot_phase {
  HAPI_SLOT_FREE = 0,
  HAPI_SLOT_LIVE = 1,
  HAPI_SLOT_RETIRING = 2 /* no longer in the model; the loop may still be using an older one */
} hapi_slot_phase;

typedef struct hapi_body_slot {
  hapi_slot_phase phase;
  uint32_t generation;
  uint32_t epoch;      /* grows when the loop shall start again from ODE's state */
  uint32_t known;      /* entry of the body table; HAPI_NONE: the body is gone */
  uint32_t flags;      /* of the message */
  uint64_t retired_at; /* first model without it */
  bool wanted;         /* scratch: in the model being built */
  bool held;           /* by a pointer: it is in the model wherever it is */
  bool alive;          /* scratch: a geom of it is there after after_step */
  bool pushed;         /* by a pointer in the last interval: the loop owns its motion */
  bool pose_changed;   /* since then, by the application */
  bool velocity_changed;
  double mass;

  /* Model CONTACT. */
  bool loop_owned; /* in the newest message: ODE's state is the loop's, and is not stepped */
  bool linked;     /* scratch: a body of the range may touch it */
  bool carried;    /* likewise: it rests on one, as far as the range may end there */
  double gain_taken[6];
  double exchanged[6]; /* N, N m: mean wrench from the loop in the last interval */
} hapi_body_slot;

/* How a pointer touched at the newest message of the loop; all but the force of a sphere alone. */
typedef struct hapi_last_touch {
  double force[3];  /* N, on the body */
  bool touched;     /* what follows holds */
  uint32_t epoch;   /* of the body, when the model was made */
  double depth;     /* m, of the pointer in the geom */
  double ball[3];   /* m, body frame: of the pointer if it could not enter the geom */
  double normal[3]; /* unit, body frame */
} hapi_last_touch;

/* What the application says of pointer and geom. */
typedef struct hapi_contact_said {
  double mu;
  uint32_t feel; /* as hapi_model_contact.feel */
} hapi_contact_said;

typedef struct hapi_contact_slot {
  hapi_slot_phase phase;
  uint32_t generation; /* grows with each new contact in this place */
  uint32_t body;       /* slot, HAPI_SLOT_NONE: static world */
  uint32_t pointer;
  uint32_t pointer_generation;
  dGeomID geom;         /* compared only, never used; NULL: it is gone */
  uint64_t geom_number; /* of a sphere's: hapi_geom_names_get */
  bool wanted;
  bool hidden; /* by a nearer one, of the same surface */
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
  hapi_contact_said said;
  double finger_radius; /* m, the pointer's; 0: no torsion */
  hapi_last_touch last_touch;
  bool is_tool; /* a point of a hull's patch */
  hapi_tool_point tool;
} hapi_contact_slot;

typedef struct hapi_slots {
  hapi_body_slot *bodies;      /* capacity.bodies */
  hapi_contact_slot *contacts; /* capacity.contacts */
  uint32_t body_high;          /* slots that were ever used are below */
  uint32_t contact_high;
} hapi_slots;

uint32_t hapi_slots_body(hapi_nearby *nearby, uint32_t known); /* live slot; HAPI_NONE: full */
/* NULL: there is none. */
hapi_contact_slot *hapi_slots_find_contact(hapi_nearby *nearby, uint32_t body, dGeomID geom,
                                           uint32_t pointer, uint32_t pointer_generation);
/* The one there is, or a new one in a place that is free or not wanted; NULL: full. */
hapi_contact_slot *hapi_slots_contact(hapi_nearby *nearby, uint32_t body, dGeomID geom,
                                      uint32_t pointer, uint32_t pointer_generation);
/* In a place that is free or not wanted; NULL: full. */
hapi_contact_slot *hapi_slots_new_contact(hapi_nearby *nearby, uint32_t body, dGeomID geom,
                                          uint32_t pointer, uint32_t pointer_generation);
void hapi_slots_begin_model(hapi_nearby *nearby); /* nothing wanted yet */
/* What touched geoms that have got a carrier since goes on as contacts of that. */
void hapi_slots_hand_over(hapi_nearby *nearby);
void hapi_slots_end_model(hapi_nearby *nearby); /* what is not wanted retires */
void hapi_slots_release(hapi_nearby *nearby);   /* retired ones the loop is done with */
void hapi_slots_drop_body(hapi_nearby *nearby, uint32_t known); /* the body is gone */
void hapi_slots_restart(hapi_body_slot *slot); /* the loop starts again from ODE's state */
void hapi_slots_renew(hapi_body_slot *slot);   /* and forgets what it summed up, too */
/* Roles of the bodies in the model to come, as testing simulations have changed them. */
void hapi_slots_set_flags(hapi_slots *slots, uint32_t body, uint32_t flags);
void hapi_slots_reset(hapi_nearby *nearby);

#endif
