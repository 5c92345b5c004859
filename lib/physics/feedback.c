/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#include "physics/feedback.h"

#include <string.h>

#include "base/alloc.h"
#include "base/assert.h"
#include "base/vec.h"

/* An application reads after a step what a joint gave in the step, as its mean. A joint of the loop
 * was solved in its ticks: the mean is their impulses over their time, which is less than the step
 * where the loop came to own the joint in it. Where the loop let go of a joint, ODE steps the whole
 * interval and writes the feedback itself. A joint of bodies that rest has no rows in the loop, and
 * keeps what it had, as in ODE. */

bool hapi_feedback_create(hapi_feedback *feedback, const hapi_cycle *cycle, const hapi_world *world)
{
  feedback->cycle = cycle;
  feedback->world = world;
  feedback->joints = hapi_alloc_array(cycle->config->capacity.joints, sizeof *feedback->joints);
  return feedback->joints != NULL;
}

void hapi_feedback_finish(hapi_feedback *feedback)
{
  hapi_free(feedback->joints);
  feedback->joints = NULL;
}

void hapi_feedback_reset(hapi_feedback *feedback)
{
  memset(feedback->joints, 0, feedback->cycle->config->capacity.joints * sizeof *feedback->joints);
}

static bool given_is_finite(const hapi_joint_given *given)
{
  return hapi_finite(&given->seconds, 1) && hapi_finite(given->impulse[0], 6) &&
         hapi_finite(given->impulse[1], 6);
}

void hapi_feedback_take(const hapi_feedback *feedback)
{
  HAPI_ASSERT(feedback->cycle->has_new_state);
  const hapi_state_joint *in = hapi_state_joints(feedback->cycle->state);
  for (uint32_t i = 0; i < feedback->cycle->state->joint_count; ++i) {
    HAPI_ASSERT_INDEX(in[i].slot, feedback->cycle->config->capacity.joints);
    hapi_told_joint *to = &feedback->joints[in[i].slot];
    if (!given_is_finite(&in[i].given)) {
      continue;
    }
    if (to->generation != in[i].generation) {
      *to = (hapi_told_joint){.generation = in[i].generation};
    }
    to->body_a = in[i].body_a;
    to->fresh.seconds += in[i].given.seconds - to->taken.seconds;
    for (int k = 0; k < 6; ++k) {
      to->fresh.impulse[0][k] += in[i].given.impulse[0][k] - to->taken.impulse[0][k];
      to->fresh.impulse[1][k] += in[i].given.impulse[1][k] - to->taken.impulse[1][k];
    }
    to->taken = in[i].given;
  }
}

static void mean_write(const double impulse[6], double seconds, dVector3 force, dVector3 torque)
{
  hapi_v3_scale(1.0 / seconds, impulse, force);
  hapi_v3_scale(1.0 / seconds, impulse + 3, torque);
}

static void joint_write(const hapi_feedback *feedback, const hapi_known_joint *known,
                        const hapi_told_joint *told, dJointFeedback *out)
{
  const hapi_body_table *bodies = &feedback->world->bodies;
  /* ODE's order of the bodies, whichever of them was attached first. A body that has left its slot
   * meanwhile leaves the joint's order unknown. */
  bool in_order = bodies->entries[known->index[0]].slot == told->body_a;
  bool turned =
      known->index[1] != HAPI_NONE && bodies->entries[known->index[1]].slot == told->body_a;
  if (!in_order && !turned) {
    return;
  }
  mean_write(told->fresh.impulse[in_order ? 0 : 1], told->fresh.seconds, out->f1, out->t1);
  if (known->bodies[1] != NULL) { /* else ODE writes none */
    mean_write(told->fresh.impulse[in_order ? 1 : 0], told->fresh.seconds, out->f2, out->t2);
  }
}

void hapi_feedback_tell(const hapi_feedback *feedback)
{
  const hapi_joint_table *table = &feedback->world->joints;
  for (uint32_t i = 0; i < table->slot_high; ++i) {
    hapi_told_joint *told = &feedback->joints[i];
    const hapi_joint_slot *slot = &table->slots[i];
    if (told->fresh.seconds > 0.0 && slot->taken != 0 && slot->generation == told->generation) {
      const hapi_known_joint *known = &table->entries[slot->taken - 1];
      dJointFeedback *out = known->held ? dJointGetFeedback(known->joint) : NULL;
      if (out != NULL) {
        joint_write(feedback, known, told, out);
      }
    }
    memset(&told->fresh, 0, sizeof told->fresh);
  }
}
