/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_WORLD_JOINTS_H
#define HAPODE_WORLD_JOINTS_H

/* What is known of the world's joints: a table with an entry for each. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include "base/index.h"
#include "sync/messages.h"
#include "world/joint_traits.h"

typedef struct hapi_world hapi_world;

/* Names a joint in every run alike. Its address cannot: the heap may give the address of a
 * destroyed joint again or not, and lockstep would depend on that. */
typedef struct hapi_joint_name {
  uint64_t births[2]; /* of its bodies, in ODE's own order; 0: static world */
  dJointType type;
  uint32_t rank; /* among those of the same bodies and type, the oldest first */
} hapi_joint_name;

/* The equations of a joint of another kind than the loop has, found by testing simulations
 * (probe/joint_probe.c). */
typedef struct hapi_joint_measurement {
  bool good;      /* what follows holds */
  uint32_t first; /* of the joint's bodies, the one that was pushed */
  hapi_measured_joint found;
  hapi_joint_place place;
  double turn[2][4]; /* orientations of the pushed body and the other one, world */
  double held[6][6]; /* see hapi_admittance_rows, world axes */
  double error;      /* 0.., what turning the measurement before this one on would have missed */
} hapi_joint_measurement;

typedef struct hapi_known_joint {
  dJointID joint;
  hapi_joint_name name;
  uint64_t seen;     /* scan that found it */
  dBodyID bodies[2]; /* in ODE's own order; the second is NULL: static world */
  uint32_t index[2]; /* of the body table, in this cycle */
  bool carried;      /* of a kind that the loop has */
  bool helps;  /* the motor of a spring: the loop has it with the joint that the spring is on */
  bool usable; /* place holds */
  bool held;   /* switched off for the global step */
  bool left_is_known;
  hapi_joint_kind kind;
  hapi_joint_place place; /* as it was set */
  hap_pose left;          /* of the second body in the first at the end of the last cycle */
  uint64_t gathered_in;   /* scratch: walk that met it */
  uint64_t ranged_in;     /* model that it is in */
  uint32_t slot;          /* HAPI_NONE: not in the newest model */
  double meant[3][2];     /* softness of its own as the application means it, while converted */
  uint64_t wanted_in;     /* walk that would have taken it if it were measured */
  hapi_joint_measurement *measurement; /* owned; NULL: none */
} hapi_known_joint;

typedef struct hapi_joint_slot {
  uint32_t taken; /* by which entry, + 1; 0: free */
  uint32_t generation;
  uint64_t model; /* newest one that its joint was in before */
} hapi_joint_slot;

typedef struct hapi_joint_table {
  hapi_known_joint *entries;
  uint32_t count;
  uint32_t capacity;
  hapi_index by_address;
  hapi_index by_name;
  uint64_t scan;
  bool starved;           /* the newest scan found no memory for a joint */
  hapi_joint_slot *slots; /* numbers of joints in the loop */
  uint32_t slot_count;
  uint32_t slot_high; /* from here on none was ever taken */
} hapi_joint_table;

/* joints.c */
bool hapi_joints_create(hapi_joint_table *table, uint32_t slots);
void hapi_joints_finish(hapi_joint_table *table);
uint32_t hapi_joints_find(const hapi_joint_table *table, dJointID joint); /* HAPI_NONE */
void hapi_joints_scan(hapi_world *world);                                 /* after the bodies' */
void hapi_joints_leave(hapi_joint_table *table); /* last: what is left in ODE */
void hapi_joints_reset(hapi_joint_table *table); /* forgets all */
/* Slots for the joints of a model: entries of the table. Those of no other joint stay taken. */
void hapi_joints_take_slots(hapi_joint_table *table, uint64_t model, const uint32_t *joints,
                            uint32_t count);

/* joint_place.c */
/* is_new: as it is now; else only where it is another than it was. Sets usable. */
void hapi_joint_read(hapi_known_joint *known, bool is_new);
void hapi_joint_leave(hapi_known_joint *known);
/* m, by which its anchors are apart; 0 where its place is not known. */
double hapi_joint_open(const hapi_known_joint *known);

/* joint_axes.c */

/* A free axis with its motor and stops. */
typedef struct hapi_joint_axis {
  dReal (*get)(dJointID, int);
  int group;
  uint32_t carrier; /* HAPI_CARRIER_*, of the joint's bodies in ODE's own order */
  bool slides;
  double direction[3]; /* world */
  double position;
} hapi_joint_axis;

/* Motors and stops of other joints, as far as ODE says where their axes are. */
typedef struct hapi_joint_limits {
  double values[HAPI_JOINT_LIMITS][3];
} hapi_joint_limits;

int hapi_joint_axes(const hapi_known_joint *known, hapi_joint_axis out[HAPI_JOINT_LIMITS]);
void hapi_joint_take_limits(const hapi_known_joint *known, hapi_joint_limits *out);
void hapi_joint_give_limits(const hapi_known_joint *known, const hapi_joint_limits *limits);

/* soften.c */
void hapi_joint_soften(hapi_known_joint *known, double step_ratio); /* its own parameters ... */
void hapi_joint_restore(const hapi_known_joint *known);             /* ... and back */
double hapi_joint_erp(const hapi_known_joint *known);
void hapi_joint_leave_open(const hapi_known_joint *known, bool open, double step_ratio);

#endif
