/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_SET_H
#define HAPODE_POINTER_SET_H

/* A pointer is changed while it runs: its device goes on, and its id stays (docs/pointers.md). */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* What is set: bits of hap_pointer_settings.mask. Values are never renumbered. */
typedef enum hap_pointer_set_bit {
  HAP_SET_BASE = 1, /* pose_world_device, twist_world_device and base_time_ns */
  /* Without HAP_SET_BASE the pointer stays where it is while the scale changes. */
  HAP_SET_MOTION_SCALE = 2,
  HAP_SET_FORCE_SCALE = 4, /* force_scale */
  HAP_SET_STIFFNESS = 8,   /* stiffness */
  HAP_SET_DAMPING = 16,    /* damping */
  HAP_SET_FRICTION = 32,   /* friction and finger_radius */
  HAP_SET_LIMITS = 64,     /* max_force and max_torque */
  /* No field: what clutches have moved the device against the pointer is forgotten. */
  HAP_SET_UNCLUTCHED = 128,
  /* No field: the pointer leaps to where the base puts it. Without this bit it goes there within
   * 20 ms, or leaps where it is farther away than 0.2 m or 2 rad. */
  HAP_SET_TELEPORT = 256,
  HAP_SET_SHAPE = 512,         /* radius, hull_xyz and hull_points */
  HAP_SET_COLLIDE_BITS = 1024, /* collide_bits */
  HAP_SET_COUPLING = 2048      /* coupling, coupling_stiffness and coupling_damping */
} hap_pointer_set_bit;

/* Fields of hap_pointer_def that can be set later. It has a size and may grow at its end. */
typedef struct hap_pointer_settings {
  uint32_t size;   /* set by hap_pointer_settings_init */
  uint32_t cookie; /* set by hap_pointer_settings_init */
  uint32_t mask;   /* hap_pointer_set_bit: the fields that are read; default 0 */
  uint32_t reserved;

  hap_pose pose_world_device;   /* of the device's frame in the world: the base */
  hap_twist twist_world_device; /* m/s, rad/s, world axes, of its origin; at most 1e6; default 0 */
  int64_t base_time_ns;         /* of hap_session_now: when the base was there; 0 (default): now */
  double motion_scale;          /* this and the next: range and meaning as in hap_pointer_def */
  double force_scale;           /* device newtons for a world newton */
  double stiffness;             /* N/m, of contacts */
  double damping;               /* N s/m, of contacts */
  double friction;              /* 0..10, of contacts */
  double finger_radius;         /* m, of a soft finger */
  double max_force;             /* N at the device */
  double max_torque;            /* N m at the device */
  double radius;                /* m */
  const double *hull_xyz;       /* copied by hap_pointer_set */
  size_t hull_points;           /* 4..64; 0 with NULL: a sphere */
  uint32_t collide_bits;        /* geoms that are touched */
  hap_coupling coupling;        /* this and the next: as in hap_pointer_expert_def */
  double coupling_stiffness;    /* N/m, of the spring to the device */
  double coupling_damping;      /* N s/m, likewise */
} hap_pointer_settings;

/* [any] Fills *settings with the defaults of hap_pointer_def and an empty mask. size_of_settings:
 * sizeof *settings of the caller's build. */
HAP_API void hap_pointer_settings_init(hap_pointer_settings *settings, size_t size_of_settings);

/* [any] Sets the fields that mask names, at the next tick; wait-free for the loop. Several calls
 * between two ticks act as one. No force leaps by it:
 *
 *   base                    the pointer moves with twist_world_device until the next setting: for
 *                           50 ms from base_time_ns, and comes to rest in 20 ms more. A new pose
 *                           that is off this way is reached in 20 ms. Surfaces feel the pointer's
 *                           velocity in the world.
 *   motion scale, force scale, stiffness, damping, friction   reached in 20 ms
 *   limits                  a lower one at the slew limit, a higher one in 100 ms
 *   shape, collide bits, coupling   while something is felt, the force goes within 20 ms, and the
 *                           next one comes as that of a deep contact. A shape is known to physics
 *                           from the next step on; until then the pointer touches nothing.
 *
 * HAP_ERROR_ARGUMENT, and nothing changes: an unknown bit, or a field out of the range of
 * hap_pointer_def. HAP_ERROR_UNSUPPORTED: a coupling that needs model CONTACT, in a session of
 * another one. HAP_ERROR_NOT_FOUND: no such pointer. HAP_ERROR_UNINITIALISED: settings did not
 * go through hap_pointer_settings_init. HAP_ERROR_STATE: the session plays a recording, which has
 * what was set. */
HAP_API hap_status hap_pointer_set(hap_session *session, hap_pointer_id pointer,
                                   const hap_pointer_settings *settings);

/* [any] What was set last, or given to hap_pointer_add. mask has the bits of all fields, but not
 * HAP_SET_SHAPE of a hull: its points are not given back, and hull_xyz is NULL. *out went through
 * hap_pointer_settings_init. HAP_ERROR_NOT_FOUND: no such pointer. */
HAP_API hap_status hap_pointer_settings_get(const hap_session *session, hap_pointer_id pointer,
                                            hap_pointer_settings *out);

/* [any] Holds the clutch or lets it go, at the next tick: while it is held the device moves and the
 * pointer stands in its base. The hand's force goes within 20 ms and comes back in 20 ms; bodies go
 * on feeling the pointer. The device's place and turning against the pointer are kept until
 * HAP_SET_UNCLUTCHED, or until the device starts anew. Errors as of hap_pointer_set. */
HAP_API hap_status hap_pointer_clutch(hap_session *session, hap_pointer_id pointer, bool holds);

/* [any] Sets base, motion scale and HAP_SET_UNCLUTCHED so that a box of the world can be reached:
 * the middle of the device's box, device_lo to device_hi in m in its frame, comes to the middle of
 * the world's, which has edges in m along the axes of pose_world_box. The device's axes become
 * those of that box, and the scale is the least with which all of it can be reached. device_lo and
 * device_hi both NULL: the device's box is the workspace of its hap_device_info.
 *
 * HAP_ERROR_ARGUMENT: another NULL, an edge that is not above 0, or a scale or pose out of range.
 * HAP_ERROR_UNSUPPORTED: both NULL, and the device does not tell its workspace. Others as of
 * hap_pointer_set. */
HAP_API hap_status hap_pointer_fit_workspace(hap_session *session, hap_pointer_id pointer,
                                             const double device_lo[3], const double device_hi[3],
                                             const hap_pose *pose_world_box, const double edges[3]);

HAP_END_DECLS

#endif
