/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_H
#define HAPODE_POINTER_H

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Index and generation in one number: an id of a removed pointer is never valid again. 0 is
 * none. */
typedef struct hap_pointer_id {
  uint64_t v; /* to be compared with another one's, no more */
} hap_pointer_id;

/* Between the device and what touches the world. Values are fixed. */
typedef enum hap_coupling {
  HAP_COUPLING_DIRECT = 0, /* the pointer is at the pose of the device (the paper) */
  HAP_COUPLING_PROXY = 1, /* the pointer is a light body that a spring pulls to the device: what the
                              hand feels is never stiffer than the spring, however many contacts
                              push. Model contact only: in another one, when the session changes its
                              model, the pointer is direct meanwhile */
  HAP_COUPLING_AUTO = 2,  /* direct, and a proxy as soon as the stiffnesses of the contacts near the
                              pointer add up to more than the device can hold; where it does not say
                              what that is, and in other models than contact, direct */
  /* The two that the literature knows, to compare with. Their contacts do not give: the pointer does not
   * enter bodies, and stiffness, damping and integration of hap_pointer_def have no part in them; the
   * spring to the device, and where they are in force, are those of PROXY. docs/numerics.md. */
  HAP_COUPLING_GOD_OBJECT =
      3, /* constraint-based: the pointer has no mass and is, of all places out of the
                                  bodies that it can slide to, where the spring to the device is shortest
                                  (Zilles and Salisbury 1995; tools: Ortega, Redon and Coquillart 2007).
                                  In the air it is the device, and there is no force */
  HAP_COUPLING_VIRTUAL =
      4 /* virtual coupling: the pointer is a rigid body of virtual_mass that the spring
                              pulls, and meets bodies as such, without rebound (Colgate, Stanley and Brown
                              1995; McNeely, Puterbaugh and Troy 1999). In the air its mass is felt */
} hap_coupling;

/* [any] Name of a coupling as programs spell it ("god-object"); NULL for an unknown value. */
HAP_API const char *hap_coupling_name(hap_coupling coupling);

/* Why a pointer has the coupling that it has. Values are fixed. */
typedef enum hap_coupling_reason {
  HAP_COUPLING_ASKED = 0,   /* by its definition */
  HAP_COUPLING_UNKNOWN = 1, /* direct: the device gives neither damping nor rated stiffness, or
                               force_scale is 0 */
  HAP_COUPLING_MODEL = 2,   /* direct: the session's model is not contact */
  HAP_COUPLING_WITHIN = 3,  /* direct: the device can hold what is near */
  HAP_COUPLING_ABOVE = 4    /* proxy: it cannot */
} hap_coupling_reason;

/* How the spring of a contact between pointer and body is integrated, model contact. For comparisons;
 * the default is right. Values are fixed. */
typedef enum hap_integration {
  HAP_INTEGRATION_AUTO = 0,     /* midpoint while T^2 a k <= 4, else implicit */
  HAP_INTEGRATION_EXPLICIT = 1, /* eq. 7 with the poses as they are: has a stability limit */
  HAP_INTEGRATION_IMPLICIT = 2,
  HAP_INTEGRATION_MIDPOINT = 3 /* keeps energy; rings where T^2 a k > 4 */
} hap_integration;

/* Where the velocity of a pointer's device comes from. Values are fixed. */
typedef enum hap_velocity {
  HAP_VELOCITY_AUTO = 0,     /* estimated when the device rounds its positions (quantum > 0) and
                                measures no velocity */
  HAP_VELOCITY_DEVICE = 1,   /* as the device says */
  HAP_VELOCITY_ESTIMATED = 2 /* from the poses, over a window that adapts to quantum and speed */
} hap_velocity;

/* What the hand holds in the world. */
typedef struct hap_pointer_def {
  uint32_t size;      /* set by hap_pointer_def_init */
  uint32_t cookie;    /* set by hap_pointer_def_init */
  hap_device *device; /* borrowed, one pointer per device; NULL: hap_pointer_set_target moves it,
                         and it is not in the world before the first target */
  double radius; /* m, 1e-6..100, default 0.01: the pointer is a sphere. With a hull 0..100: it is
                         rounded by a ball of that radius, which is swept over it; 0: sharp */
  double mass;   /* kg, 0..1e6, default 0: of HAP_COUPLING_PROXY and AUTO's proxy */
  double stiffness; /* N/m, 0..1e9, default 1000: k of eq. 7. The points at which a hull touches one
                         geom and is pushed the same way have it together, each the same share: a
                         flat push feels k, a face of the half width r that is tilted on a plane
                         turns back with k r^2 about its middle */
  double damping; /* N s/m, 0..1e6, default 0: d of eq. 7, acts while in contact; shared likewise */
  double friction; /* 0..10, default 0: Coulomb friction against what it touches, sticking and
                          sliding; hap_ode_def.pointer_surface says another one for a geom. Each point
                          at which a hull touches has its own share of it, so that a face also holds
                          against turning (docs/numerics.md) */
  const double *hull_xyz; /* m, x, y, z of each point, within 100 of the pointer's origin; copied.
                                 NULL (default): a sphere. Else the pointer is a tool: their convex
                                 hull, in the pointer's frame, which turns with the device. It must
                                 have a thickness: points in a plane or on a line are refused. Touches
                                 all but heightfields and geoms of user-made classes */
  size_t hull_points;     /* 4..64; 0 (default) without hull_xyz */
  hap_pose pose_world_device; /* pose of the device's frame in the world, default identity */
  double motion_scale;        /* world metres per device metre, > 0, default 1 */
  double force_scale;         /* device newtons per world newton, >= 0, default 1. The stiffness
                                 felt at the device is stiffness x motion_scale x force_scale. */
  double max_force;           /* N at the device, > 0; the device's own limit holds as well.
                                 Default 20. */
  double max_torque;          /* N m at the device, > 0, default 1. The torque, about the pointer's
                                 origin, is scaled by force_scale / motion_scale. A device of 3 dof
                                 gets none, and does not turn a tool: that keeps the orientation of
                                 pose_world_device */
  hap_coupling coupling;      /* default HAP_COUPLING_AUTO */
  uint32_t collide_bits;      /* the pointer touches geoms whose category bits meet these; default
                                 all */
  hap_velocity velocity;      /* default HAP_VELOCITY_AUTO; of a pointer without device it is that
                                 of hap_pointer_set_target */
  hap_integration integration;
  double
      coupling_stiffness;  /* N/m at the device, 0..1e9: of the proxy's spring, and what the device
                                is taken to hold; default 0: from the device's figures */
  double coupling_damping; /* N s/m at the device, 0..1e6; with coupling_stiffness only */
  double hand_damping;     /* N s/m, 0..1e3, default 0: the least that the hand always adds to the
                                device's own damping (a finger held loosely: about 1) */
  double max_slew; /* N/s at the device, >= 0: fastest change of the force, also on the way to zero
                      after a fault, which takes 100 ms at most; the torque's is in the same
                      proportion to its limit. 0 (default): the whole force in 2 ms */
  double
      finger_radius; /* m, 0..100, default 0: off. Of a soft finger, which holds what it touches against
                           turning about the contact's normal by up to friction x normal force x this
                           radius: 2/3 of that of a patch with even pressure. Sliding and turning share
                           one limit (docs/numerics.md). Needs friction. A pointer whose device has 3
                           degrees of freedom does not turn itself; others turn with the device, whose
                           torque is about the pointer's centre. Of a hull it is the radius at each of
                           its points, beside the arms that these have. */
  double
      virtual_mass; /* kg, 1e-6..1e6, default 0.1: of HAP_COUPLING_VIRTUAL. It is felt in the air, and
                             swings on the spring at sqrt(coupling_stiffness / virtual_mass) */
  double
      virtual_inertia; /* kg m^2, 0..1e12: of its hull about every axis through the pointer's origin;
                             0 (default): of a ball of that mass as large as the hull (docs/numerics.md) */
} hap_pointer_def;

/* [any] Fills *def with defaults. */
HAP_API void hap_pointer_def_init(hap_pointer_def *def, size_t size_of_def);

/* [control] Adds a pointer, also while running; it feels forces from the next sync on, ramped in as at
 * the start. HAP_ERROR_CAPACITY beyond max_pointers; HAP_ERROR_STATE when the device serves another
 * pointer, of this session or another one. */
HAP_API HAP_NODISCARD hap_status hap_pointer_add(hap_session *session, const hap_pointer_def *def,
                                                 hap_pointer_id *out);

/* [control] Zero force, device stopped, id invalid; the last thing that the device was given is zero.
 * Waits for the loop's next tick, not for the lock. HAP_ERROR_NOT_FOUND for an id of a pointer that was
 * removed, here and below: its place may have another pointer by now, which has another id. */
HAP_API hap_status hap_pointer_remove(hap_session *session, hap_pointer_id pointer);

/* [control] Stops the pointer's device and starts it again: for one that was lost, unplugged or switched
 * off, and has to be opened anew. Blocks as long as the device's start does; the loop and the other
 * pointers go on. The pointer is out of the world meanwhile, its id stays valid. This alone brings no
 * force back that a fault has taken: that does hap_session_reset_fault afterwards, over 20 ms. Without
 * a fault the pointer comes in as one that was just added, also over 20 ms. HAP_ERROR_DEVICE: it did not
 * start; the pointer stays out of the world, and this may be tried again. HAP_ERROR_STATE: the session is
 * not started, or the pointer has no device. */
HAP_API HAP_NODISCARD hap_status hap_pointer_restart(hap_session *session, hap_pointer_id pointer);

/* [app] Moves a pointer without device: pose and twist (may be NULL: at rest) in the device's
 * frame, from the next tick on. Values that are not finite or beyond 1e6 (m, m/s, rad/s), and a
 * quaternion that is not unit within 1e-3, are HAP_ERROR_ARGUMENT and change nothing. */
HAP_API hap_status hap_pointer_set_target(hap_session *session, hap_pointer_id pointer,
                                          const hap_pose *pose, const hap_twist *twist);

/* What the guard did to a pointer's force. Bits; values are fixed. */
typedef enum hap_guard_flag {
  HAP_GUARD_STALE = 1,      /* less force: the local model is older than two physics steps */
  HAP_GUARD_RAMP_IN = 2,    /* less force: the first 20 ms after a start or a reset */
  HAP_GUARD_ENERGY = 4,     /* the energy observer held force back */
  HAP_GUARD_SLEW = 8,       /* the slew limit held it back */
  HAP_GUARD_SATURATED = 16, /* beyond a limit and shortened, direction kept */
  HAP_GUARD_FAULT = 32      /* a fault is latched: on the way to zero, or there */
} hap_guard_flag;

/* What a pointer is doing, of its last tick. */
typedef struct hap_pointer_state {
  uint32_t size;             /* bytes that were filled in */
  uint32_t contacts;         /* bodies that push back now; of a tool the points at which they do */
  int64_t stamp_ns;          /* of the tick */
  hap_pose device;           /* device's frame */
  hap_pose proxy;            /* pointer in the world: of the proxy where there is one */
  hap_twist twist;           /* pointer in the world */
  hap_wrench wrench;         /* on the hand, world frame, after the guard: what was written to the
                           device, divided by force_scale */
  uint32_t buttons;          /* bit 0 is the first one */
  uint32_t coupling;         /* hap_coupling in force: never HAP_COUPLING_AUTO */
  uint32_t coupling_reason;  /* hap_coupling_reason */
  uint32_t guard;            /* hap_guard_flag bits */
  double coupling_stiffness; /* N/m at the device, of the proxy's spring; 0: there is none */
  double coupling_damping;   /* N s/m at the device */
  double
      contact_stiffness; /* N/m at the device, sum over the contacts near the pointer; 0 where they
                                do not give (god-object, virtual) */
} hap_pointer_state;

/* [any] State after the newest tick. */
HAP_API hap_status hap_pointer_get(const hap_session *session, hap_pointer_id pointer,
                                   hap_pointer_state *out, size_t size_of_out);

/* [any] For drawing: the pointer (out_proxy) and the device (out_device) in the world at the time that
 * hap_session_poses draws for time_ns, so that the drawn hand touches the drawn body. Either may be
 * NULL. The two are apart only for a pointer that is a proxy, god-object or virtual tool; a sphere turns with the device also then.
 * HAP_STALE, HAP_CLAMPED: as hap_session_poses. HAP_ERROR_NOT_FOUND, and nothing is written: no such
 * pointer, or no tick has had it yet. The newest: hap_pointer_get. */
HAP_API hap_status hap_pointer_poses(hap_session *session, hap_pointer_id pointer, int64_t time_ns,
                                     hap_pose *out_proxy, hap_pose *out_device);

HAP_END_DECLS

#endif
