/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_LOCAL_JOINT_ROWS_H
#define HAPODE_LOCAL_JOINT_ROWS_H

/* Joints of the local world, model CONTACT. */

#include "local/facts.h"
#include "local/rows.h"
#include "sync/messages.h"

#define HAPI_JOINT_PARTS 19 /* six that hold, one given, four of each of three axes */
#define HAPI_JOINT_ROWS 10u /* at once */

/* What is kept of a joint, by slot. */
typedef struct hapi_joint_memory {
  uint32_t generation;
  uint32_t measurement;             /* whose rows the impulses are of */
  bool tells;                       /* in this tick, to given */
  double impulse[HAPI_JOINT_PARTS]; /* N s, N m s, of the last tick */
  /* rad/s, m/s: speed of each axis' rotor less that of the axis, after the last tick; 0 where all
   * rows were solved */
  double slip[HAPI_JOINT_LIMITS];
  hapi_joint_given given;
} hapi_joint_memory;

typedef struct hapi_joints {
  hapi_model_joint *of; /* of the model in use; capacity.joints */
  uint32_t count;
  uint32_t told;             /* of these */
  hapi_joint_memory *memory; /* by slot; capacity.joints */
} hapi_joints;

void hapi_joints_adopt(hapi_joints *joints, hapi_model *model);

/* Wakes what hangs on a body that moves. */
void hapi_joint_wake(const hapi_joints *joints, const hapi_bodies *bodies, hapi_rows *rows,
                     double period);

void hapi_joint_rows(hapi_joints *joints, const hapi_bodies *bodies, hapi_rows *rows,
                     const hapi_tick_facts *facts);

/* After the solve: keeps the impulse of a joint's row, and the slip of a rotor. */
void hapi_joint_keep(const hapi_joints *joints, const hapi_rows *rows, uint32_t row);

/* After the solve: adds to what physics is told of joints. */
void hapi_joints_tell(const hapi_joints *joints, const hapi_bodies *bodies, const hapi_rows *rows,
                      double period);

#endif
