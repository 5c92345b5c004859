/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_OUTPUTS_H
#define HAPODE_OUTPUTS_H

/* What a device does beside the wrench on the hand: forces on its axes, such as a gripper,
 * vibrators and LEDs (docs/grippers.md). */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/forces.h>
#include <hapode/pointer.h>
#include <hapode/session.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* What pushes an axis: force + stiffness x (target - axis) - damping x rate, at most max_force. In
 * the unit of the axis and of its force (hap_axis_info); positive ones open a gripper. Of force,
 * stiffness and damping 0 (default) is none. Final. */
typedef struct hap_axis_push {
  double force;     /* within 1e9 */
  double stiffness; /* 0..1e9 */
  double target;    /* within the range of the axis where there is a stiffness */
  double damping;   /* 0..1e6 */
  double max_force; /* 0..1e9, what it promises; that of the axis holds as well. Default 0: none */
  /* W, 0..1e9: energy that it gives to the finger, as a mean over 0.1 s; of an axis in shares as
   * share x share/s. HAP_FORCE_POWER_AUTO (default): the largest force at two ranges a second. */
  double max_power;
} hap_axis_push;

/* What the end effector of a pointer shall do until the next one is set. It has a size and may grow
 * at its end. */
typedef struct hap_pointer_outputs {
  uint32_t size;   /* set by hap_pointer_outputs_init */
  uint32_t cookie; /* set by hap_pointer_outputs_init */
  uint32_t leds;   /* bit 0 is the first one; default 0 */
  uint32_t reserved;
  hap_vibration vibrators[HAP_VIBRATORS_MAX]; /* amplitude 0..1, default 0; frequency 0..1e5 Hz */
  hap_axis_push axes[HAP_AXES_MAX];           /* forces on the axes; default none */
  /* Shares of the range of a gripper, 0..1: HAP_EVENT_GRIPPER says closed at the one and below, and
   * open at the other and above. Default 0.25 and 0.35, gripper_open above gripper_closed. */
  double gripper_closed;
  double gripper_open; /* share from which on it is open */
} hap_pointer_outputs;

/* [any] Fills *outputs with defaults: nothing. size_of_outputs: sizeof *outputs of the caller's
 * build. */
HAP_API void hap_pointer_outputs_init(hap_pointer_outputs *outputs, size_t size_of_outputs);

/* [any] Sets all of them, before start or at the next tick; wait-free for the loop. Of several
 * calls between two ticks the last one acts. They stay until they are set again, also over
 * hap_session_stop and hap_pointer_restart.
 *
 * A force on an axis goes to the new one in 20 ms, and never faster than 2 ms from none to the
 * axis's max_force; an amplitude likewise. A fault, a held clutch, doubt about the device and late
 * ticks act on axes and vibrators as on the wrench: under a fault there is none. LEDs stay.
 *
 * HAP_SATURATED, and they are set: a stiffness or damping was above the rated one of the axis and
 * was cut; hap_session_detail has the number. Of an axis without rated figures nothing is cut.
 *
 * HAP_ERROR_ARGUMENT, and nothing changes: a field out of range, or of something that the device
 * does not have; hap_session_detail names the field. HAP_ERROR_UNSUPPORTED: the pointer has no
 * device. HAP_ERROR_NOT_FOUND: no such pointer. HAP_ERROR_UNINITIALISED: outputs did not go through
 * hap_pointer_outputs_init. HAP_ERROR_STATE: the session plays a recording, which has its own. */
HAP_API hap_status hap_pointer_set_outputs(hap_session *session, hap_pointer_id pointer,
                                           const hap_pointer_outputs *outputs);

/* [any] What was set last, with the promises as they came out: max_power of an axis is no
 * HAP_FORCE_POWER_AUTO any more once something was set. Before that it is what
 * hap_pointer_outputs_init gives; in a replay, too, as a recording keeps to itself what it has.
 * *out went through hap_pointer_outputs_init. HAP_ERROR_NOT_FOUND: no such pointer.
 * HAP_ERROR_UNINITIALISED: out did not go through it. HAP_ERROR_ARGUMENT: a NULL. */
HAP_API hap_status hap_pointer_get_outputs(hap_session *session, hap_pointer_id pointer,
                                           hap_pointer_outputs *out);

HAP_END_DECLS

#endif
