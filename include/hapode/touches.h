/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOUCHES_H
#define HAPODE_TOUCHES_H

/* Who is touched, and how hard: for sounds, sparks, vibration, logs and viewers (docs/touches.md).
 *
 * Geoms and bodies are told as pointers: a dGeomID and a dBodyID of hapode/ode.h. They are to be
 * compared. What was destroyed since may still be told, so use them only where the application
 * knows that it has not destroyed them.
 *
 * Nothing here costs a tick anything until somebody asks for the first time. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

#define HAP_TOUCHES_MAX 64 /* of a pointer, that are told */

/* A geom that pushes a pointer. Its size goes with the call; it may grow at its end. */
typedef struct hap_touch {
  void *geom;          /* dGeomID */
  void *body;          /* dBodyID; NULL: a geom without one */
  double point[3];     /* m, world: middle of the points that push, by their force */
  double normal[3];    /* unit, world, out of the geom */
  double force[3];     /* N, world, on the pointer: with friction, before the guard */
  double slip[3];      /* m/s, world: of the pointer along the surface, as the body sees it */
  int64_t since_ns;    /* tick with which the touch began */
  uint32_t points;     /* points that push: of a hull up to 64 */
  uint32_t is_sliding; /* 1: friction does not hold it; without friction, faster than 1 mm/s */
} hap_touch;

/* [any] What the pointer touches at the newest tick, the hardest touch first. *out_count: how many
 * were written; where there are more than capacity, the hardest. size_of_touch: sizeof *touches of
 * the caller's build.
 *
 * The first call for any pointer of the session begins it: HAP_STALE and none; from the next tick
 * on they are told. HAP_END, and 0 touches: it touches nothing. HAP_ERROR_NOT_FOUND: no such
 * pointer. HAP_ERROR_ARGUMENT: a NULL, or a touch without room for its geom. */
HAP_API hap_status hap_pointer_touches(hap_session *session, hap_pointer_id pointer,
                                       hap_touch *touches, size_t capacity, size_t size_of_touch,
                                       size_t *out_count);

/* Two geoms of bodies near the hand that press on each other. Its size goes with the call; it may
 * grow at its end. */
typedef struct hap_body_contact {
  void *geom_a;     /* dGeomID */
  void *geom_b;     /* dGeomID */
  void *body_a;     /* dBodyID; NULL: a geom without one */
  void *body_b;     /* likewise */
  double point[3];  /* m, world: middle of the points that press, by their force */
  double normal[3]; /* unit, world, from b to a */
  double force[3];  /* N, world, on a: with friction */
  uint32_t points;  /* points that press */
  uint32_t reserved;
} hap_body_contact;

/* [any] Contacts between bodies that the loop moves, and with what is around them, at the newest
 * tick, in no order. Model CONTACT only; there are none in others. size_of_contact: sizeof
 * *contacts of the caller's build. Begun by the first call, and with the statuses of
 * hap_pointer_touches. */
HAP_API hap_status hap_session_contacts(hap_session *session, hap_body_contact *contacts,
                                        size_t capacity, size_t size_of_contact, size_t *out_count);

/* Who moves a body: hap_session_roles of hapode/ode.h. Values are never renumbered. */
typedef enum hap_body_role {
  HAP_ROLE_WORLD = 0,    /* the world alone: it is far, or the session's model leaves it there */
  HAP_ROLE_LOOP = 1,     /* the loop, with its contacts and joints */
  HAP_ROLE_RESTING = 2,  /* the loop, and it stays where it is until something pushes it */
  HAP_ROLE_MEASURED = 3, /* the world; the loop answers for it as testing simulations say */
  HAP_ROLE_EDGE = 4,     /* the world; the loop answers for it with its mass until the next step */
  HAP_ROLE_DRIVEN = 5    /* the application: a kinematic body that the loop knows */
} hap_body_role;

/* What can happen to a hand. Values are never renumbered. */
typedef enum hap_event_kind {
  HAP_EVENT_TOUCH = 1,   /* a geom pushes the pointer, and did not for 5 ms */
  HAP_EVENT_RELEASE = 2, /* it has not for 5 ms */
  HAP_EVENT_SLIDE = 3,   /* the pointer begins to slide on it */
  HAP_EVENT_STICK = 4,   /* it has not slid for 10 ms */
  /* The first blow of a touch that closed at 0.02 m/s or more: pointer and geom do not come nearer
   * any more, or 20 ms are over */
  HAP_EVENT_IMPACT = 5,
  HAP_EVENT_BUTTON = 6, /* pressed or let go */
  HAP_EVENT_FAULT = 7,  /* the guard has taken the force away */
  /* A gripper has closed or opened: see hap_pointer_outputs.gripper_closed. It begins open. */
  HAP_EVENT_GRIPPER = 8,
  HAP_EVENT_FORCE_OUT = 10,  /* the call of an own force was taken out (forces.h) */
  HAP_EVENT_HOLD = 11,       /* the pointer holds a body (grab.h) */
  HAP_EVENT_LET_GO = 12,     /* it does no more */
  HAP_EVENT_TEXTURE_OUT = 13 /* the function of a texture is too late (surface.h) */
} hap_event_kind;

/* Something that has happened. Its size goes with the call; it may grow at its end. What a kind
 * does not have is 0. */
typedef struct hap_event {
  uint32_t kind; /* hap_event_kind */
  /* BUTTON, GRIPPER (its axis): from 0; FAULT: hap_fault; FORCE_OUT: hap_force_out;
   * LET_GO: hap_grab_end; TEXTURE_OUT: of hap_session_add_texture */
  uint32_t number;
  int64_t time_ns;        /* of the tick, on the clock of hap_session_now */
  hap_pointer_id pointer; /* FAULT: v is 0 where it came from none; TEXTURE_OUT: 0 */
  void *geom;             /* as in hap_touch; NULL for BUTTON and all kinds behind it */
  void *body;             /* as in hap_touch */
  double point[3];        /* m, world; HOLD, LET_GO: of the pointer */
  double normal[3];       /* unit, world, out of the geom */
  /* m/s. TOUCH, IMPACT: at which they closed; SLIDE: along the surface. GRIPPER: rate of its axis,
   * in the unit of the axis a second */
  double speed;
  double impulse;   /* N s, along the normal. IMPACT: of the blow; RELEASE: of the whole touch */
  uint32_t is_down; /* BUTTON: 1 pressed, 0 let go; GRIPPER: 1 closed, 0 open */
  uint32_t reserved;
  uint64_t force; /* FORCE_OUT: hap_force_id.v */
} hap_event;

/* [any, one after the other] Takes what happened since the last call, oldest first, up to capacity.
 * 1024 are kept. Where there is no room, new ones are dropped and counted
 * (hap_stats.events.dropped), as are touches beyond HAP_TOUCHES_MAX. Call it once before start to
 * miss nothing: the first call begins it, and gives none. size_of_event: sizeof *events of the
 * caller's build.
 *
 * HAP_END, and 0 events: nothing has happened. HAP_ERROR_ARGUMENT: a NULL, or an event without
 * room for its time. */
HAP_API hap_status hap_session_events(hap_session *session, hap_event *events, size_t capacity,
                                      size_t size_of_event, size_t *out_count);

/* [any] Name of a kind of event as programs spell it ("touch"); NULL for an unknown value. */
HAP_API const char *hap_event_name(hap_event_kind kind);

HAP_END_DECLS

#endif
