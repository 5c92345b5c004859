/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_GRAB_H
#define HAPODE_GRAB_H

/* A hand holds a body: it feels the weight, the inertia and what the body meets (docs/grab.md). */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* How a held body turns. Values are never renumbered. */
typedef enum hap_grab_turn {
  /* With the hand where the device gives torque, or the application moves the pointer; else as
   * HAP_GRAB_BALL. */
  HAP_GRAB_TURNS = 0,
  HAP_GRAB_BALL = 1 /* freely about the pointer: a ball joint */
} hap_grab_turn;

/* Where the pointer holds the body. Values are never renumbered. */
typedef enum hap_grab_place {
  HAP_GRAB_HERE = 0,   /* where the pointer is: nothing moves */
  HAP_GRAB_AT_POSE = 1 /* at pose_body_pointer: the body comes there at 0.5 m/s and 5 rad/s */
} hap_grab_place;

/* How a pointer holds a body. World units: force_scale and motion_scale come after it. It has a
 * size and may grow at its end. */
typedef struct hap_grab_def {
  uint32_t size;              /* set by hap_grab_def_init */
  uint32_t cookie;            /* set by hap_grab_def_init */
  uint32_t place;             /* hap_grab_place, default HAP_GRAB_HERE */
  uint32_t turns;             /* hap_grab_turn, default HAP_GRAB_TURNS */
  hap_pose pose_body_pointer; /* m, of the pointer in the body's frame, with HAP_GRAB_AT_POSE */
  /* N/m, 0..1e9. 0 (default), rigid: as stiff as the device can hold; of a device without figures
   * the pointer's stiffness. More than the device can hold is cut: HAP_SATURATED. */
  double stiffness;
  double damping;        /* N s/m, 0..1e6; cut likewise. 0 (default): half of the critical one */
  double turn_stiffness; /* N m/rad, 0..1e6. 0 (default): stiffness at an arm of 50 mm */
  double turn_damping;   /* N m s/rad, 0..1e6. 0 (default): half of the critical one */
  /* N and N m, 0..1e6: the grip gives way at this force of its spring. 0 (default): at the largest
   * force and torque of the pointer, which the hand then feels whole. */
  double max_force;
  double max_torque; /* N m, likewise */
} hap_grab_def;

/* Why a grab has ended. Values are never renumbered. */
typedef enum hap_grab_end {
  HAP_GRAB_RELEASED = 1, /* hap_pointer_release, or another hap_pointer_attach */
  /* The body is gone, or was put elsewhere by hap_session_teleport_body; or the pointer is gone. */
  HAP_GRAB_GONE = 2,
  HAP_GRAB_FAULT = 3,  /* a fault is latched */
  HAP_GRAB_REFUSED = 4 /* the session's model or the pointer's coupling has become another one */
} hap_grab_end;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_grab_def_init(hap_grab_def *def, size_t size_of_def);

/* [any] The pointer holds the body (a dBodyID of hapode/ode.h) from the next tick on; where the
 * body was far from all pointers, from the next physics step on. The force comes in within 20 ms,
 * and the pointer's contacts with the body go meanwhile. Another body, or the same one held in
 * another way, is let go first; the same call once more changes nothing. Several pointers may hold
 * one body. A kinematic body is a handle that does not give way. def NULL: the defaults.
 *
 * It ends by hap_pointer_release, with the body, with the pointer, with the session's run, and with
 * a fault: HAP_EVENT_LET_GO says why. None begins while a fault is latched, or where the body does
 * not come within 1 s. hap_pointer_get tells what is held.
 *
 * HAP_SATURATED, and it is held: a stiffness or damping was above what the device can hold and was
 * cut; hap_session_detail has the number. HAP_ERROR_ARGUMENT, and hap_session_detail names the
 * field. HAP_ERROR_NOT_FOUND: no such pointer, or a body that the session does not know.
 * HAP_ERROR_UNSUPPORTED: a model other than CONTACT and SINGLE, or a coupling GOD_OBJECT or
 * VIRTUAL. HAP_ERROR_STATE: the session has not started, or plays a recording, which has its own.
 * HAP_ERROR_UNINITIALISED: def did not go through hap_grab_def_init. */
HAP_NODISCARD HAP_API hap_status hap_pointer_attach(hap_session *session, hap_pointer_id pointer,
                                                    void *body, const hap_grab_def *def);

/* [any] Lets go at the next tick: the force goes within 20 ms, the body goes on as it moves, and
 * the pointer's contacts with it come in as deep ones do. HAP_OK also where nothing is held.
 * HAP_ERROR_NOT_FOUND: no such pointer. HAP_ERROR_STATE: the session plays a recording. */
HAP_API hap_status hap_pointer_release(hap_session *session, hap_pointer_id pointer);

HAP_END_DECLS

#endif
