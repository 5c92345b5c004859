/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_DEVICE_IMPL_H
#define HAPODE_DEVICE_IMPL_H

/* For people who write a device. Copy plugins/skeleton, read docs/writing-a-device.md, and check
 * the result against this contract with "hapode-run --check-device".
 *
 * Threads. The application's thread calls open, describe, start, stop and close. The haptic thread
 * calls read and write; in drive LOCKSTEP one thread calls all of them. Any thread calls zero. No
 * two of the others are called at the same time on one device. A session calls start, then read and
 * write once a tick in this order. When the haptic thread has let go of the device, it calls zero
 * and stop.
 *
 * Devices are independent: two of them may be open at once, each with its own self. Where the
 * hardware is there only once, the second open fails and says so. */

#include <stddef.h>
#include <stdint.h>

#include <hapode/attributes.h>
#include <hapode/device.h>
#include <hapode/spatial.h>
#include <hapode/status.h>

HAP_BEGIN_DECLS

/* Goes up when a member of hap_device_ops changes its meaning. */
#define HAP_DEVICE_ABI 3u

/* Who sets the pace of the loop. Values are never renumbered. */
typedef enum hap_device_pacing {
  HAP_PACING_VIRTUAL = 0, /* lives in the time it is given; may run in lockstep */
  HAP_PACING_HOST = 1,    /* answers at once with its newest state; the loop sleeps */
  HAP_PACING_DEVICE = 2   /* read blocks until the device's own tick, at most two ticks */
} hap_device_pacing;

/* What an end effector measures. Sessions judge axes as they judge the pose, and tell them in
 * hap_pointer_state. It has a size, set by the library, and may grow at its end. */
typedef struct hap_device_input {
  uint32_t size;    /* bytes that there is room for */
  uint32_t buttons; /* bit 0 is the first one */
  hap_pose pose;    /* in the device's frame; a device of dof 3 gives a constant quaternion */
  hap_twist twist;  /* velocity of that pose, in the same axes */
  double axes[HAP_AXES_MAX];       /* as many as axis_count says, in the units of hap_axis_info */
  double axis_rates[HAP_AXES_MAX]; /* of those, a second */
} hap_device_input;

/* What an end effector shall do, or does. Sessions leave what is not the wrench 0 until the
 * application calls hap_pointer_set_outputs (hapode/outputs.h). It has a size, set by the library,
 * and may grow at its end. */
typedef struct hap_device_output {
  uint32_t size;                    /* bytes that are filled in, or that there is room for */
  uint32_t leds;                    /* bit 0 is the first one */
  hap_wrench wrench;                /* on the hand, in the device's frame */
  double axis_forces[HAP_AXES_MAX]; /* on the hand: positive ones open a gripper */
  hap_vibration vibrators[HAP_VIBRATORS_MAX]; /* as many as vibrator_count says */
} hap_device_output;

/* Whether a struct of this build's headers, from a library of maybe another one, has the member. */
#define HAP_HAS_MEMBER(object, member) \
  ((object)->size >= (size_t)((const char *)(&(object)->member + 1) - (const char *)(object)))

/* The operations of a device. It has a size and may grow at its end.
 *
 * What read, write and held pass are arrays of pointers: one for each end effector, in their
 * order. A device with one end effector uses the first. A library of an older build passes shorter
 * structs: members that this header calls newer than ABI 3 are asked for with HAP_HAS_MEMBER. */
typedef struct hap_device_ops {
  uint32_t abi;     /* HAP_DEVICE_ABI; checked before any other member */
  uint32_t size;    /* sizeof(hap_device_ops) of the device's build */
  const char *name; /* of the spec, [a-z0-9_-] */
  const char *help; /* one line: what it is and its arguments */
  uint32_t pacing;  /* hap_device_pacing */

  /* May block, may allocate. context is that of hap_device_create; NULL for a module. args is the
   * text after "name:" or "", and is not kept. An argument that is not understood is refused. No
   * force yet. On success *self is not NULL. On failure it stays NULL, detail (never NULL) says
   * why, and nothing is left open. */
  hap_status (*open)(void *context, const char *args, void **self, hap_detail *detail);

  /* Fills *out for an end effector, from 0; *out arrives zeroed but for its size, and no member
   * beyond out->size is written. name may be left empty, and effector_count 0 stands for 1. The
   * same at every call. Never fails, never blocks. */
  void (*describe)(void *self, uint32_t effector, hap_device_info *out);

  /* Energises the device with zero force. May block. Also after stop, and after the device was
   * lost: what must be opened anew is opened here. */
  hap_status (*start)(void *self);

  /* All end effectors at time_ns (pacing DEVICE: not later than time_ns). Fills in buttons, pose
   * and twist of each, and its axes; the quaternion is unit. Never blocks except with pacing
   * DEVICE, never allocates. HAP_ERROR_STATE before start and after stop.
   *
   * HAP_STALE: the device does not believe what it measures, and the outputs are its last good
   * ones, carried on for a few ms. The session goes on with them, takes the force away over 18 ms
   * and then latches HAP_FAULT_DEVICE_INPUT. Where there is no force yet, it comes in when they are
   * good.
   *
   * After an error the outputs are not used, and the session latches a fault and calls zero. A
   * positive number that is no hap_status counts as an error, for write too. The session goes on
   * reading: a device that was unplugged may answer again, and is used again after
   * hap_session_reset_fault. start is called in between only by hap_pointer_restart. */
  hap_status (*read)(void *self, int64_t time_ns, hap_device_input *const out[]);

  /* What each end effector shall do until the next write. Never blocks, never allocates. A force or
   * torque beyond max_force or max_torque is shortened, its direction kept, an axis force beyond
   * its own likewise: HAP_SATURATED. The wrench and axis_forces of reached are what the device
   * really gives, and are filled in unless the status is an error; the rest of reached is not
   * looked at. What is not finite gives no force: HAP_ERROR_ARGUMENT, or a zero. HAP_ERROR_STATE
   * before start and after stop: then nothing reaches the motors. */
  hap_status (*write)(void *self, const hap_device_output *const wanted[],
                      hap_device_output *const reached[]);

  /* Zero force now, of all end effectors, axes and vibrators. Any thread, also a signal handler,
   * which may have interrupted any other function of the device: no lock, no allocation. From open
   * to close at any time; idempotent; never fails. The force stays off until the next write. A
   * write that is under way may come after it; the session then calls zero once more. */
  void (*zero)(void *self);

  /* De-energises: the force is off, also when zero was not called before. May block. A second stop
   * and one without start do nothing. */
  void (*stop)(void *self);

  /* Frees self, after stop. No thread, timer or signal handler of the device is left: its code may
   * be gone when this returns. */
  void (*close)(void *self);

  /* Optional, NULL or beyond size: what the motors were told last, wrench and axis_forces; zero
   * where they are off. Called by the thread that writes, or when none does, from open to close.
   * For checks. */
  void (*held)(void *self, hap_device_output *const out[]);

  /* Optional, NULL or beyond size: why start, read or write failed last, in one sentence that says
   * what to do. out arrives empty and stays so when nothing failed. Any thread, from open to close,
   * at the same time as any other operation; never blocks. */
  void (*explain)(void *self, hap_detail *out);

  /* For devices whose describe says axis_count: an axis of an end effector, both from 0. As
   * describe: rated_stiffness and rated_damping are newer than ABI 3 (HAP_HAS_MEMBER). */
  void (*describe_axis)(void *self, uint32_t effector, uint32_t axis, hap_axis_info *out);
} hap_device_ops;

/* ---- a device in the application ---- */

/* [control] Makes a device of these operations: open gets the context, and "" as arguments. It is
 * checked as one of a module. ops and what context points to stay until the device is closed.
 * HAP_ERROR_ARGUMENT: ops or out is NULL; else errors as of hap_device_open, and detail, which may
 * be NULL, says why. */
HAP_NODISCARD HAP_API hap_status hap_device_create(const hap_device_ops *ops, void *context,
                                                   hap_device **out, hap_detail *detail);

/* [control] Makes a device around another: a filter, a recorder, a shaker. All operations of ops
 * may be NULL, and are then the inner device's; read and write, where they are there, call
 * hap_device_read and hap_device_write of it. Without open the context is self. The pacing is the
 * inner device's. describe and describe_axis get what the inner device says, and change it;
 * effector_count stays. start comes after the inner device's. zero and stop reach the inner device
 * whatever ops has.
 *
 * The inner device is borrowed until the outer one is closed; no pointer can have it meanwhile, and
 * both may be closed in any order. The guard checks what goes to the outer device: what is added to
 * it there meets the limits of the inner device alone. HAP_ERROR_STATE: a pointer or another
 * wrapper has the inner device; else as hap_device_create. */
HAP_NODISCARD HAP_API hap_status hap_device_wrap(hap_device *inner, const hap_device_ops *ops,
                                                 void *context, hap_device **out,
                                                 hap_detail *detail);

/* [haptic, in read of a device around inner] As read of hap_device_ops. HAP_ERROR_STATE: inner is
 * in no device. */
HAP_API hap_status hap_device_read(hap_device *inner, int64_t time_ns,
                                   hap_device_input *const out[]);

/* [haptic, in write of a device around inner] As write of hap_device_ops. What is not finite is
 * zero of the whole device, and HAP_ERROR_ARGUMENT. */
HAP_API hap_status hap_device_write(hap_device *inner, const hap_device_output *const wanted[],
                                    hap_device_output *const reached[]);

/* ---- a device in a module ---- */

/* [control] The one symbol of a loadable device, "module:/whole/path/of/it.so[,ARGS]". host_abi is
 * the HAP_DEVICE_ABI of the library that asks. NULL: the device cannot serve that one. It is called
 * once for every device that is opened, by the thread that opens; there may be several. The table
 * must last as long as the module is loaded, which is until the last of its devices was closed. */
HAP_API const hap_device_ops *hapode_device_module(uint32_t host_abi);

HAP_END_DECLS

#endif
