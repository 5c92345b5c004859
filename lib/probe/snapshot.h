/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_SNAPSHOT_H
#define HAPODE_PROBE_SNAPSHOT_H

/* Everything of bodies that a step touches, kept and put back bit by bit. */

#include <stdbool.h>
#include <stdint.h>

#include <ode/ode.h>

#include <hapode/status.h>

typedef struct hapi_body_state {
  dBodyID body;
  dReal position[4];
  dReal quat[4];
  dReal rotation[12];
  dReal linear[4];
  dReal angular[4];
  dReal force[4];
  dReal torque[4];
  bool enabled;
  void (*moved_callback)(dBodyID);
} hapi_body_state;

typedef struct hapi_feedback_state {
  dJointFeedback *feedback;
  dJointFeedback saved;
} hapi_feedback_state;

typedef struct hapi_snapshot {
  hapi_body_state *bodies;
  uint32_t body_count;
  uint32_t body_capacity;
  hapi_feedback_state *feedbacks;
  uint32_t feedback_count;
  uint32_t feedback_capacity;
  unsigned long seed;
} hapi_snapshot;

hap_status hapi_snapshot_reserve(hapi_snapshot *snapshot, uint32_t bodies, uint32_t feedbacks);
void hapi_snapshot_finish(hapi_snapshot *snapshot);
void hapi_snapshot_clear(hapi_snapshot *snapshot);
void hapi_snapshot_add_body(hapi_snapshot *snapshot, dBodyID body, void (*moved_callback)(dBodyID));
void hapi_snapshot_add_feedback(hapi_snapshot *snapshot, dJointFeedback *feedback);
/* Poses, velocities, accumulators and seed, to begin the next probe from. */
void hapi_snapshot_rewind(const hapi_snapshot *snapshot);
/* Rewinds, and restores flags and feedback as well. */
void hapi_snapshot_restore(const hapi_snapshot *snapshot);

#endif
