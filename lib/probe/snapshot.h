/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PROBE_SNAPSHOT_H
#define HAPODE_PROBE_SNAPSHOT_H

/* What a step touches, kept and put back: bodies bit by bit, and the order of the geoms in their
 * spaces. */

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

typedef struct hapi_space_order {
  dGeomID *geoms; /* space by space */
  uint32_t count;
  uint32_t capacity;
} hapi_space_order;

/* Nothing is kept. */
void hapi_space_order_begin(hapi_space_order *order);
/* All spaces that the body's geoms are in, and the spaces around those. HAP_ERROR_MEMORY. */
hap_status hapi_space_order_add(hapi_space_order *order, dBodyID body);
/* After the poses: it asks where the geoms are. */
void hapi_space_order_restore(hapi_space_order *order);
void hapi_space_order_finish(hapi_space_order *order);

#endif
