/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_H
#define HAPODE_POINTER_H

/* A pointer: what a hand holds in the world. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Index and generation in one number: the id of a removed pointer is never valid again. 0 is none.
 * Final. */
typedef struct hap_pointer_id {
  uint64_t v; /* only to be compared with that of another id */
} hap_pointer_id;

struct hap_pointer_expert_def;   /* hapode/expert.h */
struct hap_pointer_research_def; /* hapode/research.h */

/* How a pointer is made. It has a size and may grow at its end. */
typedef struct hap_pointer_def {
  uint32_t size;   /* set by hap_pointer_def_init */
  uint32_t cookie; /* set by hap_pointer_def_init */

  /* Borrowed, one pointer for each of its end effectors, all of one session. NULL (default):
   * hap_pointer_set_target moves the pointer, and it is not in the world before its first
   * target. */
  hap_device *device;
  hap_pose pose_world_device; /* of the device's frame in the world, default identity */
  double motion_scale;        /* world metres for a device metre, 1e-6..1e6, default 1 */
  /* Device newtons for a world newton, 0..1e6, default 1. The stiffness felt at the device is
   * stiffness x motion_scale x force_scale. */
  double force_scale;

  /* m, 1e-6..100, default 0.01: the pointer is a sphere. With a hull 0..100: a ball of this radius
   * is swept over the hull and rounds it; 0: sharp. */
  double radius;
  /* m, x y z of each point, within 100 m of the pointer's origin; copied. NULL (default): a sphere.
   * Else the pointer is a tool: the convex hull of the points, in the pointer's frame, which turns
   * with the device. Points in a plane or on a line are refused. A tool touches all geoms but
   * heightfields and those of user-made classes. */
  const double *hull_xyz;
  size_t hull_points; /* 4..64; 0 (default) without hull_xyz */

  /* N/m, 0..1e9, default 1000: k of eq. 7. The points at which a hull touches one geom and is
   * pushed the same way share it equally: a flat push feels k. A face of half width r that is
   * tilted on a plane turns back with k r^2 about its middle. */
  double stiffness;
  double damping; /* N s/m, 0..1e6, default 0: d of eq. 7, acts in contact; shared likewise */
  /* 0..10, default 0: Coulomb friction against what the pointer touches, sticking and sliding.
   * hap_ode_def.pointer_surface gives other values for a geom. Each point of a hull that touches
   * has its own share, so that a face also holds against turning
   * (docs/decisions/friction.md). */
  double friction;
  /* m, 0..100, default 0: off. Radius of a soft finger. It holds what it touches against turning
   * about the contact's normal, by up to friction x normal force x this radius: 2/3 of the
   * radius of a patch with even pressure. Sliding and turning share one limit
   * (docs/decisions/friction.md). Needs friction. A pointer on a device of 3 degrees of freedom
   * does not turn itself. Others turn with the device, whose torque is about the pointer's centre.
   * Of a hull it is the radius at each of its points, beside the arms that these have. */
  double finger_radius;

  double max_force; /* N at the device, 1e-6..1e6, default 20; the device's own holds as well */
  /* N m at the device, 1e-6..1e6, default 1. The torque about the pointer's origin is scaled by
   * force_scale / motion_scale. A device of 3 degrees of freedom gets none and does not turn a
   * tool, which keeps the orientation of pose_world_device. */
  double max_torque;
  uint32_t collide_bits; /* the pointer touches geoms whose category bits meet these; default all */

  const struct hap_pointer_expert_def *expert;     /* copied by add; NULL (default): its defaults */
  const struct hap_pointer_research_def *research; /* copied by add; NULL (default): its defaults */

  /* From 0 (default): which end effector of the device, below effector_count of hap_device_info.
   * Each may have a pointer of its own. */
  uint32_t effector;
  uint32_t reserved;
} hap_pointer_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_pointer_def_init(hap_pointer_def *def, size_t size_of_def);

/* [control] Adds a pointer, also while running. It feels forces from the next sync on, over 20
 * ms. *def and what it refers to are copied, but the device is borrowed until the pointer is
 * removed. HAP_ERROR_ARGUMENT, HAP_ERROR_UNSUPPORTED: hap_session_detail names the field.
 * HAP_ERROR_CAPACITY: more than max_pointers. HAP_ERROR_STATE: the end effector serves another
 * pointer, the device one of another session, or the session plays a recording. HAP_ERROR_DEVICE:
 * it did not start. */
HAP_NODISCARD HAP_API hap_status hap_pointer_add(hap_session *session, const hap_pointer_def *def,
                                                 hap_pointer_id *out);

/* [control] Writes zero force, stops the device, and makes the id invalid. Waits for the loop's
 * next tick, not for the lock. HAP_ERROR_NOT_FOUND, here and below: the id is of a pointer that
 * was removed; another pointer in its place has another id. */
HAP_API hap_status hap_pointer_remove(hap_session *session, hap_pointer_id pointer);

/* [control] Stops the pointer's device and starts it again: for one that was lost, unplugged or
 * switched off and must be opened anew. Blocks as long as the device's start does; the loop and the
 * pointers of other devices go on. All pointers of the device are out of the world meanwhile, and
 * their ids stay valid.
 *
 * A force that a fault took away stays away until hap_session_reset_fault. Without a fault the
 * pointer comes in as one that was just added. HAP_ERROR_DEVICE: it did not start; the pointer
 * stays out of the world, and the call may be tried again. HAP_ERROR_STATE: the session is not
 * started or plays a recording, or the pointer has no device. */
HAP_NODISCARD HAP_API hap_status hap_pointer_restart(hap_session *session, hap_pointer_id pointer);

/* [app] Moves a pointer without device, from the next tick on: pose and twist in the device's
 * frame. twist may be NULL: at rest. HAP_ERROR_ARGUMENT, and nothing changes: a value that is
 * not finite or beyond 1e6 (m, m/s, rad/s), or a quaternion that is not unit within 1e-3.
 * HAP_ERROR_STATE: the pointer has a device, or the session plays a recording. */
HAP_API hap_status hap_pointer_set_target(hap_session *session, hap_pointer_id pointer,
                                          const hap_pose *pose, const hap_twist *twist);

/* ---- what a pointer is doing ---- */

/* What is between the device and the thing that touches the world. Values are never renumbered. */
typedef enum hap_coupling {
  HAP_COUPLING_DIRECT = 0, /* the pointer is at the pose of the device (the paper) */
  /* The pointer is a light body that a spring pulls to the device. The hand never feels more than
   * the spring's stiffness, however many contacts push. Model CONTACT only; while the session has
   * another model the pointer is direct. */
  HAP_COUPLING_PROXY = 1,
  /* Direct, and a proxy as soon as the stiffnesses of the contacts near the pointer add up to
   * more than the device can hold. Direct where the device does not say what that is, and in
   * other models than CONTACT. */
  HAP_COUPLING_AUTO = 2,

  /* The two of the literature, to compare with (docs/decisions/literature-couplings.md). Their
   * contacts do not give: the pointer does not enter bodies. Stiffness, damping and integration
   * have no part in them. The spring to the device is that of PROXY, and they are in force where
   * PROXY is. */

  /* Constraint-based: the pointer has no mass. It is, of all places outside of the bodies that
   * it can slide to, where the spring to the device is shortest (Zilles and Salisbury 1995;
   * tools: Ortega, Redon and Coquillart 2007). In the air it is the device, and there is no
   * force. */
  HAP_COUPLING_GOD_OBJECT = 3,
  /* Virtual coupling: the pointer is a rigid body of virtual_mass that the spring pulls. It meets
   * bodies without rebound (Colgate, Stanley and Brown 1995; McNeely, Puterbaugh and Troy 1999). In
   * the air its mass is felt. */
  HAP_COUPLING_VIRTUAL = 4
} hap_coupling;

/* [any] Name of a coupling as programs spell it ("god-object"); NULL for an unknown value. */
HAP_API const char *hap_coupling_name(hap_coupling coupling);

/* Why a pointer has the coupling that it has. Values are never renumbered. */
typedef enum hap_coupling_reason {
  HAP_COUPLING_ASKED = 0, /* by its definition */
  /* direct: the device gives neither damping nor rated stiffness, or force_scale is 0 */
  HAP_COUPLING_UNKNOWN = 1,
  HAP_COUPLING_MODEL = 2,  /* direct: the session's model is not CONTACT */
  HAP_COUPLING_WITHIN = 3, /* direct: the device can hold what is near */
  HAP_COUPLING_ABOVE = 4   /* proxy: it cannot */
} hap_coupling_reason;

/* What the guard did to a pointer's force. Bits; values are never renumbered. */
typedef enum hap_guard_flag {
  HAP_GUARD_STALE = 1,         /* less force: the local model is older than two physics steps */
  HAP_GUARD_RAMP_IN = 2,       /* less force: the first 20 ms after a start or a reset */
  HAP_GUARD_ENERGY = 4,        /* the energy observer held force back */
  HAP_GUARD_SLEW = 8,          /* the slew limit held force back */
  HAP_GUARD_SATURATED = 16,    /* beyond a limit and shortened, direction kept */
  HAP_GUARD_FAULT = 32,        /* a fault is latched: on the way to zero, or there */
  HAP_GUARD_LATE = 64,         /* less force: ticks of the loop came late */
  HAP_GUARD_OSCILLATION = 128, /* less force: the device swings by itself, or seems to run away */
  HAP_GUARD_INPUT = 256,       /* the device is not believed, or no motion explains the force */
  /* an own force (forces.h) or one on an axis (outputs.h) was more than it promises: shortened */
  HAP_GUARD_OWN = 512
} hap_guard_flag;

/* A pointer in its last tick. It has a size and may grow at its end. */
typedef struct hap_pointer_state {
  uint32_t size;     /* bytes filled in */
  uint32_t contacts; /* bodies that push back; of a tool the points at which they do */
  int64_t stamp_ns;  /* of the tick */
  hap_pose device;   /* in the device's frame */
  hap_pose proxy;    /* pointer in the world: of the proxy where there is one */
  hap_twist twist;   /* pointer in the world */
  /* on the hand, world frame, after the guard: what was written to the device, divided by
   * force_scale */
  hap_wrench wrench;
  uint32_t buttons;          /* bit 0 is the first one */
  uint32_t coupling;         /* hap_coupling in force: never HAP_COUPLING_AUTO */
  uint32_t coupling_reason;  /* hap_coupling_reason */
  uint32_t guard;            /* hap_guard_flag bits */
  double coupling_stiffness; /* N/m at the device, of the proxy's spring; 0: there is none */
  double coupling_damping;   /* N s/m at the device */
  /* N/m at the device, sum over the contacts near the pointer; 0 where contacts do not give
   * (GOD_OBJECT, VIRTUAL) */
  double contact_stiffness;
  hap_wrench own; /* part of wrench that own forces and surfaces' vibrations have (forces.h) */
  /* What the end effector measures beyond its pose, such as a gripper's opening, in the units of
   * hap_axis_info: checked, and from low to high. A value that no hand can have made is not taken
   * over: the one before stands, with a rate of 0. */
  uint32_t axis_count; /* 0: none */
  uint32_t reserved;
  double axes[HAP_AXES_MAX];        /* values, as many as axis_count says */
  double axis_rates[HAP_AXES_MAX];  /* of those, a second */
  double axis_forces[HAP_AXES_MAX]; /* what was written to the device (outputs.h) */
  void *held; /* dBodyID, to be compared: what the pointer holds (grab.h); NULL: nothing */
} hap_pointer_state;

/* [any] State after the newest tick. size_of_out: sizeof *out of the caller's build.
 * HAP_ERROR_NOT_FOUND: no such pointer. */
HAP_API hap_status hap_pointer_get(const hap_session *session, hap_pointer_id pointer,
                                   hap_pointer_state *out, size_t size_of_out);

/* [any] For drawing: the pointer (out_proxy) and the device (out_device) in the world, at the time
 * that hap_session_poses draws for time_ns. So the drawn hand touches the drawn body. Either may be
 * NULL. The two differ only for a pointer that is a proxy, god-object or virtual tool; a sphere
 * turns with the device also then. HAP_STALE, HAP_CLAMPED: as hap_session_poses.
 * HAP_ERROR_NOT_FOUND, and nothing is written: no such pointer, or no tick had it yet. */
HAP_API hap_status hap_pointer_poses(hap_session *session, hap_pointer_id pointer, int64_t time_ns,
                                     hap_pose *out_proxy, hap_pose *out_device);

HAP_END_DECLS

#endif
