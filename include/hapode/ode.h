/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_ODE_H
#define HAPODE_ODE_H

/* The only public header with ODE types. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ode/ode.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

#ifndef dDOUBLE
#error "hapode needs ODE in double precision (define dIDEDOUBLE, or use ode.pc of such a build)"
#endif

HAP_BEGIN_DECLS

/* [physics] Whether a and b collide. io arrives with mode dContactApprox1 and mu = infinity; fill
 * in what the pair's surface is. Called once per pair and step, never in testing simulations. With
 * Approx1 the loop of model contact takes a mu above 10 for 10 (84 degrees). */
typedef bool (*hap_surface_fn)(void *user, dGeomID a, dGeomID b, dSurfaceParameters *io);

/* [physics] First friction direction (world axes, any length) of a pair whose surface has
 * dContactFDir1. The part across each contact's normal is used. False: ODE's own direction. */
typedef bool (*hap_direction_fn)(void *user, dGeomID a, dGeomID b, double out_direction[3]);

/* [physics] What friction a pointer has against a geom: *io_mu arrives with hap_pointer_def.friction. Called
 * once a step for each geom near the pointer, after it and never in testing simulations. 0: none; above
 * 10 is taken for 10 (84 degrees). A number that is not finite or below 0 is HAP_FAULT_WORLD, and no
 * friction. What changes is felt from the next step on: more of it holds, less of it slides. */
typedef void (*hap_pointer_surface_fn)(void *user, hap_pointer_id pointer, dGeomID geom,
                                       double *io_mu);

/* [physics] Forces in (before) and results out (after) of a global step of step_s seconds; never
 * called for testing simulations. */
typedef void (*hap_step_fn)(void *user, double step_s);

/* The application's world. From start to stop it is touched only under hap_session_lock, in a
 * posted edit, in before_step, or in after_step. The other callbacks (surface, friction_direction,
 * pointer_surface, ODE's moved callbacks) come while lists of the world are in use: they read it, and what they want changed they
 * post. docs/editing.md has more.
 *
 * What the session sets on bodies from start to stop, and gives back then: flag, idle time and angular
 * threshold of auto-disable (dBodyGetAutoDisableFlag says 0), and the axis of finite rotation where that is off. By these
 * it tells a body from a later one at its address. What the application sets of auto-disable meanwhile
 * holds; an idle time set to the world's default alone reads as dBodySetAutoDisableFlag(body, 0), which
 * leaves no other trace.
 *
 * Bodies known to the session: those of the geoms in space (and in spaces inside it), whatever is
 * jointed to them, and adopted ones. ODE cannot list a world's bodies: a body that is none of these
 * must be adopted, or a testing simulation would move it.
 *
 * Joints belong to the application, and may come, change and go where the world may be touched. While
 * model CONTACT moves the bodies of a ball, hinge, slider, universal, hinge-2 or fixed joint itself, ODE
 * does not step the joint: it is switched off during the step, and its dJointFeedback is zero. A fixed
 * joint (and a slider, across its axis) whose bodies the application moves against each other holds
 * them as they then are.
 *
 * ODE ends the process on numbers that are none, and so the world is looked at before each step: start
 * gives HAP_ERROR_WORLD and a running session latches HAP_FAULT_WORLD, steps nothing and says what to
 * set right. Masses are 1e-12 .. 1e12 kg, inertias positive definite, 1e-30 .. 1e30 kg m^2; positions up
 * to 1e9 m (in the loop 1e6), speeds 1e8 m/s and 1e7 rad/s, forces and torques 1e12, gravity 1e6 m/s^2,
 * ERP 0 .. 10, CFM 0 .. 1e12, dampings at most 1, joint parameters 1e12 (ODE does not show the motors
 * of a Plane2D joint: those are not looked at); no NaN in geoms. A surface with such a number, or with
 * a friction, softness or slip below 0, is a fault as well, and no contact; a pointer's friction that is
 * none, and no friction. */
typedef struct hap_ode_def {
  uint32_t size;                          /* set by hap_ode_def_init */
  uint32_t cookie;                        /* set by hap_ode_def_init */
  dWorldID world;                         /* borrowed; one session per world */
  dSpaceID space;                         /* borrowed */
  hap_surface_fn surface;                 /* NULL: every pair collides with mu = infinity */
  hap_step_fn before_step;                /* may be NULL */
  hap_step_fn after_step;                 /* may be NULL */
  void *user;                             /* handed to all of them */
  int32_t max_contacts_per_pair;          /* 1..64, default 8; the loop keeps at most 4 */
  hap_direction_fn friction_direction;    /* may be NULL */
  hap_pointer_surface_fn pointer_surface; /* NULL: the pointer's own friction against everything */
  /* 1..64, default 1: threads that step islands of the world at once. More than 1: the library gives the
   * world a pool of ODE's while the session runs, and ODE's default at stop, whatever was set with
   * dWorldSetStepThreadingImplementation. They have the priority of the thread that starts the session.
   * Not used in testing simulations, in LOCKSTEP and while recording, which repeat bit by bit. It pays where
   * there are many islands and cores that nothing else needs; one island is stepped by one thread. */
  int32_t island_threads;
} hap_ode_def;

/* [any] */
HAP_API void hap_ode_def_init(hap_ode_def *def, size_t size_of_def);

/* [control] Creates a session over the world. ODE must be initialised (dInitODE2). Nothing moves
 * before start. On failure *out is NULL and detail (may be NULL) says what to do.
 * HAP_ERROR_UNINITIALISED, HAP_ERROR_ARGUMENT (field named in detail), HAP_ERROR_UNSUPPORTED (model
 * CONTACT), HAP_ERROR_WORLD (a body that cannot be simulated), HAP_ERROR_STATE (the world already has a
 * session), HAP_ERROR_MEMORY. */
HAP_API HAP_NODISCARD hap_status hap_session_create(const hap_session_def *def,
                                                    const hap_ode_def *ode, hap_session **out,
                                                    hap_detail *detail);

/* [locked, or control before start] Makes known a body without geom and without joint, or one that is about
 * to lose its last. Forget it before dBodyDestroy: of such a body nobody else knows that it is gone. */
HAP_API HAP_NODISCARD hap_status hap_session_adopt_body(hap_session *session, dBodyID body);

/* [locked] Before dBodyDestroy: the session drops what it knows of the body, and gives back what it had
 * set on it. HAP_ERROR_NOT_FOUND: it knew nothing, which is no harm. Without it a body that is gone is
 * noticed at the next step all the same, also when a new one has got its address: it is counted
 * (hap_stats.faults.bodies_lost, HAP_BODY_LOST) and said once. A body that is forgotten and not destroyed comes in
 * again as a new one. */
HAP_API hap_status hap_session_forget_body(hap_session *session, dBodyID body);

/* [locked] Before dGeomDestroy of a geom that a pointer may be near to, and after a change of the
 * triangles of a mesh. Without it the first is noticed at the next step, and of the second only what
 * shows in 16 triangles spread over the mesh. */
HAP_API hap_status hap_session_forget_geom(hap_session *session, dGeomID geom);

/* [locked, or control before start] ODE has no getter for a body's moved callback, so the session
 * can keep one silent in testing simulations only when it was set here (NULL: none). It holds until the body
 * is forgotten or noticed to be gone; between stop and start nothing is noticed: forget it there. */
HAP_API HAP_NODISCARD hap_status hap_session_set_moved_callback(hap_session *session, dBodyID body,
                                                                void (*callback)(dBodyID));

/* [any] Poses for drawing at time_ns (see hap_session_now), of all bodies at one time, which lies behind
 * time_ns by hap_stats.physics.pose_delay_s: one physics step, and more where steps regularly come late. Bodies
 * that the loop moves are where it had them at that time; the others are interpolated between two
 * physics steps (slerp). So what touches is drawn touching, and with growing time_ns nothing goes back
 * or jumps: bodies that come into the loop or leave it, and a change of model, do not show. The hand
 * that belongs to it: hap_pointer_poses.
 *
 * A time that nobody knows yet gives the newest of each body, and HAP_STALE when that is later by more
 * than a step (physics late or paused, time_ns in the future: a predicted time of display). At least
 * 7 steps are kept (model SINGLE: 1.5), before which HAP_CLAMPED gives the oldest. Unknown bodies give
 * HAP_ERROR_NOT_FOUND and leave out untouched: a body is known from the next step on, or from
 * hap_session_adopt_body. One call for many bodies is cheaper than many; none of them keeps the
 * haptic thread waiting. */
HAP_API hap_status hap_session_poses(hap_session *session, int64_t time_ns, const dBodyID *bodies,
                                     size_t count, hap_pose *out);

/* [any] The same without delay: bodies that the loop moves after its newest tick, where hap_pointer_get
 * has the hand; the others as they were at the last physics step, carried on by their last motion to
 * that tick, for one step at most. Where that motion has changed they go back with the next step, and may
 * meanwhile overlap. HAP_STALE when physics is late by more than a step. */
HAP_API hap_status hap_session_poses_now(hap_session *session, const dBodyID *bodies, size_t count,
                                         hap_pose *out);

/* [locked, or control before start] Bodies whose positions go into the trace, at most
 * HAP_TRACE_BODIES_MAX; replaces an earlier list. */
HAP_API HAP_NODISCARD hap_status hap_session_trace_bodies(hap_session *session,
                                                          const dBodyID *bodies, size_t count);

HAP_END_DECLS

#endif
