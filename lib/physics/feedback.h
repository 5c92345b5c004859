/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PHYSICS_FEEDBACK_H
#define HAPODE_PHYSICS_FEEDBACK_H

/* dJointFeedback of the joints that the loop has: ODE's step leaves them out. */

#include <stdbool.h>
#include <stdint.h>

#include "sync/messages.h"
#include "world/world.h"

/* Of the joint of a slot. */
typedef struct hapi_told_joint {
  uint32_t generation; /* of the slot; another one begins anew */
  uint32_t body_a;     /* slot of the body that comes first in the loop */
  hapi_joint_given taken;
  hapi_joint_given fresh; /* since the last step */
} hapi_told_joint;

typedef struct hapi_feedback {
  /* What it reads. */
  const hapi_cycle *cycle;
  const hapi_world *world;

  hapi_told_joint *joints; /* by slot; capacity.joints */
} hapi_feedback;

/* What is read outlives it. False: no memory. */
bool hapi_feedback_create(hapi_feedback *feedback, const hapi_cycle *cycle,
                          const hapi_world *world);
void hapi_feedback_finish(hapi_feedback *feedback); /* zeroed allowed */
void hapi_feedback_reset(hapi_feedback *feedback);

/* cycle->state is new. */
void hapi_feedback_take(const hapi_feedback *feedback);
/* After ODE's step, while the joints are still switched off. */
void hapi_feedback_tell(const hapi_feedback *feedback);

#endif
