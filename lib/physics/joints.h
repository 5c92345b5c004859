/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_JOINTS_H
#define HAPODE_PHYSICS_JOINTS_H

/* What is known of the world's joints, and where they are. Included by physics_internal.h. */

#include "physics/physics.h"
#include "sync/messages.h"

/* joints.c */
bool hapi_joints_create(hapi_physics *physics);
void hapi_joints_finish(hapi_joint_table *table);
uint32_t hapi_joints_find(const hapi_joint_table *table, dJointID joint); /* HAPI_NONE */
void hapi_joints_scan(hapi_physics *physics);                             /* after the bodies' */
void hapi_joints_leave(hapi_physics *physics);  /* last: what is left in ODE */
void hapi_joints_reset(hapi_physics *physics);  /* forgets all */
void hapi_joints_hold(hapi_physics *physics);   /* those of owned bodies: off for the step */
void hapi_joints_let_go(hapi_physics *physics); /* after it; their feedback is zero */
void hapi_joints_publish(hapi_physics *physics, hapi_model *out);

/* joint_place.c */
bool hapi_joint_kind_of(dJointID joint, hapi_joint_kind *out); /* false: not one of the loop's */
/* is_new: as it is now; else only where it is another than it was. Sets usable. */
void hapi_joint_read(hapi_known_joint *known, bool is_new);
void hapi_joint_leave(hapi_known_joint *known);
void hapi_joint_probes(hapi_physics *physics); /* of the joints that the walk asks for */
/* joint_axes.c */
int hapi_joint_axes(const hapi_known_joint *known, hapi_joint_axis out[HAPI_JOINT_LIMITS]);
void hapi_joint_take_limits(const hapi_known_joint *known, hapi_joint_limits *out);
void hapi_joint_give_limits(const hapi_known_joint *known, const hapi_joint_limits *limits);

#endif
