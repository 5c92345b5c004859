/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_FORCES_H
#define HAPODE_FORCES_H

/* Forces of the application's own, on a hand, at the haptic rate (docs/forces.md). */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/spatial.h>
#include <hapode/status.h>
#include <hapode/touches.h>

HAP_BEGIN_DECLS

/* What an own force does. Values are never renumbered. */
typedef enum hap_force_kind {
  HAP_FORCE_CONSTANT = 1,  /* force and torque */
  HAP_FORCE_SPRING = 2,    /* -stiffness x way from the target, -damping x velocity on that way */
  HAP_FORCE_VISCOUS = 3,   /* -damping x velocity */
  HAP_FORCE_WEIGHT = 4,    /* mass x gravity, which acts at point: the weight of a tool */
  HAP_FORCE_MAGNET = 5,    /* pulls to the target, from within range on */
  HAP_FORCE_DETENTS = 6,   /* pulls to the nearest of places that are pitch apart, along axis */
  HAP_FORCE_VIBRATION = 7, /* along axis, by time */
  HAP_FORCE_CALL = 8       /* what a function of the application says, in each tick */
} hap_force_kind;

/* Whose axes and origin are meant. Values are never renumbered. */
typedef enum hap_force_frame {
  HAP_FORCE_WORLD = 0,   /* the axes of the world */
  HAP_FORCE_POINTER = 1, /* the axes of the hand: CONSTANT and VIBRATION turn with it */
  /* SPRING, VISCOUS, MAGNET and DETENTS: origin and axis are in the frame of body and go with it;
   * velocities are those that the body sees. The body gets the opposite force and torque */
  HAP_FORCE_BODY = 2
} hap_force_frame;

/* What SPRING, VISCOUS and MAGNET go by: the way to a point, or of a line or a plane the part of it
 * across the line or along the plane's normal. VISCOUS uses the velocity alike. Values are never
 * renumbered. */
typedef enum hap_force_target {
  HAP_FORCE_POINT = 0, /* origin */
  HAP_FORCE_LINE = 1,  /* through origin, along axis */
  HAP_FORCE_PLANE = 2  /* through origin, axis is its normal */
} hap_force_target;

/* How a vibration goes in time. Final. */
typedef struct hap_force_wave {
  double hz;       /* Hz, up to 0.45 of haptic_hz, default 100: of the sine that begins at 0 */
  double attack_s; /* s, 0..3600, default 0: from nothing to strength, linearly */
  double hold_s;   /* s, 0..3600, or HAP_FORCE_FOR_EVER (default) */
  double decay_s;  /* s, 0..3600, default 0: back to nothing, linearly */
  /* In place of the sine: values of -1..1, which are copied, played at sample_hz again and again,
   * and joined by straight lines. NULL (default): the sine. */
  const float *samples;
  uint32_t sample_count; /* 2..HAP_FORCE_SAMPLES_MAX; 0 (default) without samples */
  uint32_t restart;      /* where set gives another number than before, it begins anew */
  double sample_hz;      /* Hz, 1e-3..1e6, default 1000 */
} hap_force_wave;

/* A hand, as a call is told of it. World frame. What is of the tick before is 0 in the first tick.
 * It may grow at its end: a call is given its address. */
typedef struct hap_force_hand {
  hap_pointer_id pointer; /* whose hand it is */
  hap_pose pose;          /* where the device is, in this tick */
  hap_twist twist;        /* likewise */
  hap_pose proxy;         /* of the tick before: the pointer; other than the device for a proxy */
  hap_wrench wrench;      /* of the tick before, on the hand, as hap_pointer_state.wrench */
  uint32_t buttons;       /* bit 0 is the first one */
  uint32_t touch_count;   /* up to HAP_TOUCHES_MAX */
  const hap_touch *const *touches; /* of the tick before, in no order */
} hap_force_hand;

/* What a call is told of a tick. Valid during the call. It may grow at its end. */
typedef struct hap_force_tick {
  uint32_t self;                      /* place among hands of the hand on which the force acts */
  uint32_t hand_count;                /* all pointers that the loop has */
  const hap_force_hand *const *hands; /* in the order of the pointers' places */
  int64_t time_ns;                    /* of the tick, on the clock of hap_session_now */
  double seconds; /* since the tick before: more than a period where ticks were missed */
} hap_force_tick;

/* [haptic] A force of the application's own: fills in *out, which is 0 before. World frame, force
 * [N] and torque [N m] about point of hap_force_def. In drives THREADS and FRAME it is called on
 * the haptic thread, in LOCKSTEP on the thread that is in hap_session_advance; once a tick, between
 * the reading of the devices and the contacts, with subnormal numbers taken for 0. While a fault is
 * latched, and in a replay, it is not called.
 *
 * The tick waits for it. It must not wait for anything, lock, allocate, log, read or write files,
 * or call a function of this library. What it needs from other threads, atomics or messages without
 * locks bring. */
typedef void (*hap_force_call)(void *user, const hap_force_tick *tick, hap_wrench *out);

/* Why the loop does not call a function any more. Values are never renumbered. */
typedef enum hap_force_out {
  HAP_FORCE_IN = 0,             /* it does */
  HAP_FORCE_OUT_NOT_FINITE = 1, /* the wrench was not finite */
  HAP_FORCE_OUT_LATE = 2,       /* it took longer than call_most_s again and again, or very long */
  HAP_FORCE_OUT_BLOCKED = 3     /* the loop stood still in it, until a watchdog ended all force */
} hap_force_out;

#define HAP_FORCE_FOR_EVER 1e9     /* s, in place of a hold_s: it does not end */
#define HAP_FORCE_SAMPLES_MAX 1024 /* of a vibration */
#define HAP_FORCES_MAX 16          /* of a pointer */

/* An own force of a pointer. World frame and units: as the force of contacts it is multiplied by
 * force_scale on its way to the device. It has a size and may grow at its end. */
typedef struct hap_force_def {
  uint32_t size;   /* set by hap_force_def_init */
  uint32_t cookie; /* set by hap_force_def_init */
  uint32_t kind;   /* hap_force_kind; 0 (default) is none */
  uint32_t frame;  /* hap_force_frame, default HAP_FORCE_WORLD */
  uint32_t target; /* hap_force_target, default HAP_FORCE_POINT */
  uint32_t reserved;
  double origin[3]; /* m, default 0: the point, or a point of the line, the plane, the detents */
  double axis[3];   /* any length but 0, default 0 0 1 */
  double point[3];  /* m, pointer's frame, default 0: where on the pointer it acts */

  double force[3];  /* N, CONSTANT */
  double torque[3]; /* N m, CONSTANT */
  /* N/m, 0..1e9. SPRING: what the device cannot hold is cut, HAP_SATURATED. CALL: the most by which
   * the way of the hand changes the force, no more than the device can hold; 0 (default): the force
   * goes by time */
  double stiffness;
  double damping;    /* N s/m, 0..1e6, SPRING and VISCOUS; cut likewise */
  double mass;       /* kg, 0..1e3, WEIGHT */
  double gravity[3]; /* m/s^2, default 0 0 -9.81, WEIGHT */
  /* N, 0..1e6, the largest force of MAGNET, DETENTS and VIBRATION. Of the first two it is cut where
   * they are steeper than the spring that the device can hold: HAP_SATURATED */
  double strength;
  double range;             /* m, 1e-4..100, default 0.02, MAGNET: no force from there on */
  double pitch;             /* m, 1e-5..100, default 0.005, DETENTS */
  hap_force_wave vibration; /* VIBRATION: how it goes in time */

  double fade_in_s; /* s, 0..60, default 0.02: after add the force comes in linearly */
  /* What it promises; the guard holds it to that. 0 (default): what the fields above come to. Of
   * SPRING and VISCOUS that is the max_force of the pointer. A CALL must have a max_force. */
  double max_force;  /* N, 0..1e6 */
  double max_torque; /* N m, 0..1e6 */
  /* W, 0..1e6: energy that it gives to the hand, as a mean over 0.1 s. HAP_FORCE_POWER_AUTO
   * (default): 0 for VISCOUS that is bound to no body, which takes energy alone; for others the
   * largest force at 1 m/s. */
  double max_power;

  hap_force_call call; /* CALL; NULL (default) for other kinds */
  void *user;          /* handed to call; the application's */
  /* s, 0..0.5 of a haptic period, that a call may take; 0 (default): 0.1 of the period */
  double call_most_s;
  void *body; /* dBodyID of hapode/ode.h, HAP_FORCE_BODY; NULL (default) for other frames */
} hap_force_def;

#define HAP_FORCE_POWER_AUTO (-1.0) /* in place of a max_power: by the kind of the force */

/* Index and serial number in one: the id of a removed force is never valid again. 0 is none.
 * Final. */
typedef struct hap_force_id {
  uint64_t v; /* only to be compared with that of another id */
} hap_force_id;

/* [any] Fills *def with defaults. size_of_def: sizeof *def of the caller's build. */
HAP_API void hap_force_def_init(hap_force_def *def, size_t size_of_def);

/* [any] Adds a force to what the pointer's hand feels, before start or from the next tick on. A
 * proxy does not feel it: it acts on the hand. It stays until it is removed, also over
 * hap_session_stop. No force acts while a fault is latched.
 *
 * HAP_SATURATED, and it is added: stiffness, damping or strength was above what the device can hold
 * and was cut; hap_session_detail has the number. HAP_ERROR_ARGUMENT, and hap_session_detail names
 * the field. HAP_ERROR_CAPACITY: HAP_FORCES_MAX. HAP_ERROR_NOT_FOUND: no such pointer.
 * HAP_ERROR_UNINITIALISED: def did not go through hap_force_def_init. HAP_ERROR_STATE: the session
 * plays a recording, which has its own. HAP_ERROR_MEMORY: none for the samples. HAP_ERROR_THREAD:
 * from within a call of a force. HAP_ERROR_NOT_FOUND: or the session does not know the body. */
HAP_NODISCARD HAP_API hap_status hap_pointer_force_add(hap_session *session, hap_pointer_id pointer,
                                                       const hap_force_def *def, hap_force_id *out);

/* [any] Gives it other values, also another kind, from the next tick on. The force does not leap:
 * the difference goes away in 20 ms. A vibration goes on in time unless restart has changed. A CALL
 * that was taken out comes in again. Errors as of hap_pointer_force_add, and then nothing changes.
 * HAP_ERROR_NOT_FOUND: or no such force. HAP_ERROR_TIMEOUT: it is set, but the loop has not come
 * back from the call before within a second; see hap_pointer_force_remove. */
HAP_NODISCARD HAP_API hap_status hap_pointer_force_set(hap_session *session, hap_pointer_id pointer,
                                                       hap_force_id force,
                                                       const hap_force_def *def);

/* [any] It goes away in 20 ms, and its id is invalid at once. Of a CALL it waits up to two ticks:
 * then the function is not called any more, and what it uses may go. In LOCKSTEP nobody must be in
 * hap_session_advance meanwhile. HAP_ERROR_NOT_FOUND: no such pointer or force. HAP_ERROR_STATE:
 * the session plays a recording. HAP_ERROR_TIMEOUT: it is removed, but the loop has not come back
 * within a second; what the call uses must stay until hap_session_stop has given HAP_OK.
 * HAP_ERROR_THREAD: from within a call of a force, and nothing changes. */
HAP_API hap_status hap_pointer_force_remove(hap_session *session, hap_pointer_id pointer,
                                            hap_force_id force);

/* How a call does, since it was last set. It has a size and may grow at its end. Other kinds have 0
 * everywhere. Times are wall-clock, also in LOCKSTEP. */
typedef struct hap_force_state {
  uint32_t size;       /* bytes filled in */
  uint32_t out;        /* hap_force_out */
  uint64_t calls;      /* so many */
  uint64_t late_calls; /* those that took longer than call_most_s */
  double us_mean;      /* us a call */
  double us_max;       /* us, the longest call */
} hap_force_state;

/* [any] State of an own force. size_of_out: sizeof *out of the caller's build. HAP_END: its call
 * was taken out, and out->out says why; hap_pointer_force_set brings it in again.
 * HAP_ERROR_NOT_FOUND: no such pointer or force. HAP_ERROR_ARGUMENT: a NULL, or no room for the
 * size. */
HAP_API hap_status hap_pointer_force_get(hap_session *session, hap_pointer_id pointer,
                                         hap_force_id force, hap_force_state *out,
                                         size_t size_of_out);

/* [any] Name of a kind as programs spell it ("magnet"); NULL for an unknown value. */
HAP_API const char *hap_force_kind_name(hap_force_kind kind);

HAP_END_DECLS

#endif
