/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ODE_H
#define HAPODE_ODE_H

/* Sessions over an ODE world, and its bodies. The only public header with ODE types; a program that
 * has an ODE world needs no other one to begin with. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ode/ode.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>
#include <hapode/surface.h>
#include <hapode/touches.h>

#ifndef dDOUBLE
#error "hapode needs ODE in double precision (define dIDEDOUBLE, or use ode.pc of such a build)"
#endif

HAP_BEGIN_DECLS

/* ---- callbacks; user is hap_ode_def.user ---- */

/* [physics] Whether a and b collide. io arrives with mode dContactApprox1 and mu = infinity:
 * fill in the surface of the pair. Called once for each pair and step, never in testing
 * simulations, and not for pairs that sleep where most of the world does. With Approx1 the loop of
 * model CONTACT takes a mu above 10 as 10 (84 degrees). */
typedef bool (*hap_surface_fn)(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io);

/* [physics] First friction direction (world axes, any length) of a pair whose surface has
 * dContactFDir1. The part across each contact's normal is used. False: ODE's own direction. */
typedef bool (*hap_direction_fn)(void *user, dGeomID a, dGeomID b, double out_direction[3]);

/* [physics] How a pointer feels a geom: *io comes with what the pointer has of its own. Called
 * once, when the geom comes near the pointer, and again after hap_session_surface_changed or when
 * the geom has been away; never in testing simulations. A geom whose category bits do not meet the
 * pointer's collide bits is not felt and not asked about. A number that is not finite or out of
 * range is HAP_FAULT_WORLD; the geom is not felt, and asked about again at the next step. */
typedef void (*hap_pointer_surface_fn)(void *user, hap_pointer_id pointer, dGeomID geom,
                                       hap_surface *io);

/* [physics] Before a global step: apply forces. After it: read results, and set velocities of
 * kinematic bodies and motors of joints for the step to come. Near a hand they act from then on in
 * model CONTACT; set before a step, they act a step late there (docs/platforms.md). step_s: length
 * of the step, s. Never called for testing simulations. */
typedef void (*hap_step_fn)(void *user, double step_s);

/* A point at which two geoms touch, or soon will. It has a size and may grow at its end. What is
 * above `surface` is to be read; changes of it have no effect. */
typedef struct hap_contact {
  uint32_t size;              /* bytes filled in */
  uint32_t in_loop;           /* 1: a contact of the loop; 0: of the world's step */
  dGeomID a;                  /* in the order of hap_surface_fn; to be compared, and no more: */
  dGeomID b;                  /* in_loop, the application may have destroyed them meanwhile */
  void *data_a;               /* dGeomGetData of a, at the last step of physics */
  void *data_b;               /* of b */
  double point[3];            /* m, world */
  double normal[3];           /* unit, world, from b to a */
  double depth;               /* m; below 0: a gap, and the two do not touch yet */
  double velocity[3];         /* m/s, world: of a at the point, as b sees it */
  dSurfaceParameters surface; /* as hap_surface_fn said it; to be changed for this contact */
  double direction[3]; /* first friction direction, with dContactFDir1 in surface.mode: world axes,
                          any length; to be changed */
} hap_contact;

/* [physics, contact: both may call at once] Whether this contact is one, and with which surface:
 * one side of a platform, a belt that runs round a corner. Called for each contact of the pairs
 * that hap_surface_fn lets collide: in each step of the world (not in testing simulations, which
 * have the contacts of the step), and for contacts of the loop in each contact pass. The answer
 * follows from *io and from memory that no thread writes. Nothing of ODE and of the session is to
 * be called but hap_session_post. A pass waits for the callback, and ticks go on with the contacts
 * of the pass before. Pointers are not asked about: see hap_pointer_surface_fn.
 *
 * False: no contact here. A surface with a number that is not finite or out of range, or a
 * direction that is not finite, is HAP_FAULT_WORLD; the contact stays as hap_surface_fn said it. */
typedef bool (*hap_contact_fn)(void *user, hap_contact *io);

/* The application's world. It has a size and may grow at its end.
 *
 * Access. From start to stop the world is touched only under hap_session_lock, in a posted edit, in
 * before_step, or in after_step. The other callbacks (surface, friction_direction, pointer_surface,
 * ODE's moved callbacks) come while lists of the world are in use. They read the world, and post
 * what they want changed (docs/editing.md).
 *
 * Bodies known to the session: those of the geoms in its spaces and in spaces inside them, the
 * bodies that are jointed to them, and adopted ones. ODE cannot list a world's bodies. Any other
 * body must be adopted, or a testing simulation would move it.
 *
 * Auto-disable. From start to stop the session sets flag, idle time and angular threshold of
 * auto-disable on bodies (dBodyGetAutoDisableFlag says 0), and the axis of finite rotation where
 * that is off. It gives them back at stop. By these it tells a body from a later one at its
 * address. What the application sets of auto-disable meanwhile holds. An idle time that is set to
 * the world's default alone reads as dBodySetAutoDisableFlag(body, 0), which leaves no other trace.
 *
 * Joints belong to the application. They may come, change and go where the world may be touched.
 * Model CONTACT may move the bodies of a ball, hinge, slider, universal, hinge-2 or fixed joint
 * itself. Then ODE does not step the joint: it is switched off during the step. Its dJointFeedback
 * is the mean of the loop's ticks in the step, as ODE would write it, from the second step on after
 * dJointSetFeedback. A fixed joint whose bodies the application moves against each other holds
 * them as they then are; so does a slider across its axis.
 *
 * Numbers. ODE ends the process on NaN, and so the world is examined before each step. start
 * gives HAP_ERROR_WORLD. A running session latches HAP_FAULT_WORLD, steps nothing and says what
 * to set right. Masses are 1e-12 .. 1e12 kg. Inertias are positive definite, 1e-30 .. 1e30 kg
 * m^2. Positions go up to 1e9 m (in the loop 1e6), speeds to 1e8 m/s and 1e7 rad/s. Forces and
 * torques go up to 1e12, gravity to 1e6 m/s^2. ERP is 0 .. 10, CFM 0 .. 1e12, damping at most 1,
 * a joint parameter at most 1e12. ODE does not show the motors of a Plane2D joint: those are not
 * examined. Geoms have no NaN. A surface with such a number, or with a friction, softness or
 * slip below 0, is a fault as well, and no contact. */
typedef struct hap_ode_def {
  uint32_t size;                          /* set by hap_ode_def_init */
  uint32_t cookie;                        /* set by hap_ode_def_init */
  dWorldID world;                         /* borrowed; one session for each world */
  dSpaceID space;                         /* borrowed; more: hap_session_add_space */
  hap_surface_fn surface;                 /* NULL: every pair collides with mu = infinity */
  hap_step_fn before_step;                /* may be NULL */
  hap_step_fn after_step;                 /* may be NULL */
  void *user;                             /* handed to all callbacks; the caller's */
  int32_t max_contacts_per_pair;          /* 1..64, default 8; the loop keeps at most 4 */
  hap_direction_fn friction_direction;    /* may be NULL */
  hap_pointer_surface_fn pointer_surface; /* NULL: everything is felt as the pointers say */
  /* 0..64, default 1: threads that step islands of the world at once. 0: those of the application's
   * dWorldSetStepThreadingImplementation; without one ODE's default, which two worlds of a process
   * must not use at the same time. 1: the thread of the physics, in an implementation that is the
   * world's own. More: a pool of ODE's threads, with the priority of the thread that starts the
   * session; not where results repeat bit by bit: in testing simulations, in LOCKSTEP and while
   * recording. It pays where there are many islands and idle cores; one thread steps one island.
   * But for 0 the world has ODE's default at stop. */
  int32_t island_threads;
  uint32_t reserved;      /* 0 */
  hap_contact_fn contact; /* may be NULL */
  /* m, 0..0.1, default 0: the farthest from which a surface may pull a pointer. pointer_surface is
   * asked about geoms that are as much farther away. */
  double magnet_reach;
} hap_ode_def;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_ode_def_init(hap_ode_def *def, size_t size_of_def);

/* [control] Creates a session over the world; def NULL: defaults. ODE must be initialised
 * (dInitODE2). Nothing moves
 * before hap_session_start. World and space are borrowed until hap_session_destroy; the structs are
 * copied. On failure *out is NULL and detail (may be NULL) says what to do.
 *
 * HAP_ERROR_UNINITIALISED: a struct did not go through its init function. HAP_ERROR_ARGUMENT:
 * detail names the field. HAP_ERROR_UNSUPPORTED: settings that do not go together.
 * HAP_ERROR_STATE: the world has a session. HAP_ERROR_WORLD: a body that cannot be simulated.
 * HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_session_create(const hap_session_def *def,
                                                    const hap_ode_def *ode, hap_session **out,
                                                    hap_detail *detail);

/* ---- bodies that come and go (docs/editing.md). [locked]: between lock and unlock, in a posted
 * edit, in before_step or after_step; elsewhere HAP_ERROR_THREAD ---- */

/* [locked, or control before start] Makes a body known that has no geom and no joint, or is
 * about to lose its last. Forget it before dBodyDestroy: nobody else knows then that it is gone. */
HAP_NODISCARD HAP_API hap_status hap_session_adopt_body(hap_session *session, dBodyID body);

/* [locked] Before dBodyDestroy: the session drops what it knows of the body, and gives back what it
 * had set on it. HAP_ERROR_NOT_FOUND: it knew nothing, which is no harm. Without this call the next
 * step notices that the body is gone, also when a new one has its address. It is counted
 * (hap_stats.faults.bodies_lost, HAP_BODY_LOST) and said once. A body that is forgotten and not
 * destroyed comes in again as a new one. */
HAP_API hap_status hap_session_forget_body(hap_session *session, dBodyID body);

/* [locked] Puts a known body somewhere else at once: pose of the body in the world, m. A pose that
 * dBodySetPosition sets counts as a way that the body went in a step, and is drawn so; here is
 * none. The body is drawn at the new place from the next frame on, and keeps the velocity that ODE
 * has of it. What a hand felt of it ends; at the new place it is a new body, which comes in over 20
 * ms. HAP_ERROR_ARGUMENT, and nothing is moved: the position is not finite or beyond 1e6 m, the
 * quaternion not unit within 1e-3. HAP_ERROR_NOT_FOUND: the session does not know the body. */
HAP_API hap_status hap_session_teleport_body(hap_session *session, dBodyID body,
                                             const hap_pose *pose);

#define HAP_SPACES_MAX 16 /* that are added to a session's first one */

/* What the geoms of an added space meet: bits. */
typedef enum hap_space_pairs {
  HAP_SPACE_INSIDE = 1, /* each other */
  HAP_SPACE_OTHERS = 2 /* geoms of other spaces that have this bit, too; the first space has both */
} hap_space_pairs;

/* [locked, or control before start] The session also has the geoms of this top-level space:
 * pointers touch them, and bodies meet them as pairs (hap_space_pairs) says. Spaces inside the
 * space belong to it. The space is borrowed until it is removed, or the session is destroyed.
 * Meanwhile it is in a private space of the session (dGeomGetSpace).
 *
 * HAP_ERROR_ARGUMENT: no space, no known pair, or a space that is inside another one.
 * HAP_ERROR_STATE: this or another session has it. HAP_ERROR_CAPACITY: HAP_SPACES_MAX are there.
 * HAP_ERROR_MEMORY. */
HAP_NODISCARD HAP_API hap_status hap_session_add_space(hap_session *session, dSpaceID space,
                                                       uint32_t pairs);

/* [locked, or control before start] Before dSpaceDestroy of an added space: the session drops what
 * it knows of its geoms, and forgets their bodies (hap_session_forget_body). Without this call the
 * next step notices that the space is gone, and the session says so. A body that stays in the world
 * is to be adopted. HAP_ERROR_NOT_FOUND: it is not an added one. */
HAP_API hap_status hap_session_remove_space(hap_session *session, dSpaceID space);

/* [locked] Before dGeomDestroy of a geom that a pointer may be near to, and after a change of a
 * mesh's triangles. Without it the next step notices the first. Of the second it notices only what
 * shows in 16 triangles spread over the mesh. */
HAP_API hap_status hap_session_forget_geom(hap_session *session, dGeomID geom);

/* [locked, or control before start] The surface of a geom has changed, of all if geom is NULL:
 * pointer_surface is asked again at the next step for the pointers near it. In a contact that
 * presses, another stiffness comes in over 20 ms. */
HAP_API hap_status hap_session_surface_changed(hap_session *session, dGeomID geom);

/* [locked, or control before start] Sets a body's moved callback (NULL: none). ODE has no getter
 * for it, so the session can keep one silent in testing simulations only when it was set here.
 * It holds until the body is forgotten or noticed to be gone. Between stop and start nothing is
 * noticed: forget the body there. */
HAP_NODISCARD HAP_API hap_status hap_session_set_moved_callback(hap_session *session, dBodyID body,
                                                                void (*callback)(dBodyID));

/* ---- drawing ---- */

/* [any] Poses for drawing at time_ns (see hap_session_now), of all bodies at one time. That time
 * lies hap_stats.physics.pose_delay_s behind time_ns: one physics step, and more where steps
 * regularly come late. Bodies that the loop moves are where it had them at that time; the others
 * are interpolated between two physics steps (slerp). So touching bodies are drawn touching. With
 * growing time_ns nothing goes back or jumps: it does not show when a body enters or leaves the
 * loop, or when the model changes. The hand that belongs to it: hap_pointer_poses.
 *
 * A time that nobody knows yet gives the newest pose of each body, and HAP_STALE when that is
 * later by more than a step: physics is late or paused, or time_ns is in the future, such as a
 * predicted time of display. At least 7 steps are kept (model SINGLE: 1.5); before them
 * HAP_CLAMPED gives the oldest. One call for many bodies is cheaper than many; none of them keeps
 * the haptic thread waiting.
 *
 * HAP_ERROR_NOT_FOUND: some body is not known. hap_session_detail names the first one's place,
 * elements of unknown bodies are untouched, all others are written. A body that was made while the
 * session runs is known when hap_session_unlock, before_step, after_step or the posted edits of a
 * step have ended, so that its first frame has it; where it has neither geom nor joint, from
 * hap_session_adopt_body on. */
HAP_API hap_status hap_session_poses(hap_session *session, int64_t time_ns, const dBodyID *bodies,
                                     size_t count, hap_pose *out);

/* [any] The same without delay. Bodies that the loop moves are as after its newest tick, where
 * hap_pointer_get has the hand. The others are as at the last physics step, carried on by their
 * last motion to that tick, for one step at most. Where that motion has changed they go back
 * with the next step, and may overlap meanwhile. HAP_STALE: physics is late by more than a step. */
HAP_API hap_status hap_session_poses_now(hap_session *session, const dBodyID *bodies, size_t count,
                                         hap_pose *out);

/* [any] Who moves the bodies, in the newest model of the loop. HAP_ERROR_NOT_FOUND: as
 * hap_session_poses. */
HAP_API hap_status hap_session_roles(hap_session *session, const dBodyID *bodies, size_t count,
                                     hap_body_role *out);

/* [locked, or control before start] Bodies whose positions go into the trace (hapode/trace.h), at
 * most HAP_TRACE_BODIES_MAX; replaces an earlier list. */
HAP_NODISCARD HAP_API hap_status hap_session_trace_bodies(hap_session *session,
                                                          const dBodyID *bodies, size_t count);

HAP_END_DECLS

#endif
