/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_SPIDAR_DRIVEN_H
#define HAPODE_TOOLS_SPIDAR_DRIVEN_H

/* The device spidar, of model x4r, with an emulator in place of its port, in the time of the
 * session: for drive LOCKSTEP. The ticks are those of the real device, and so is its start behind
 * the open port; there is no guard process. */

#include "plugins/spidar/spidar.h"
#include "tools/spidar-emulator/emulator.h"

typedef struct driven_spidar {
  hapi_spidar_device device;
  emulator emulator;
  double now;   /* s, of the emulator */
  double begun; /* s, of the emulator when the session's clock was 0; < 0: not yet read */
  /* NULL, or at every read before it: to spoil what the boards tell. time: s, of the session */
  void (*spoil)(struct driven_spidar *d, double time, void *user);
  void *user;
} driven_spidar;

/* The argument is the path of the hand, "T:x/y/z;...", m from home in the model's frame, which is
 * the device's. Self is a driven_spidar. */
extern const hap_device_ops driven_spidar_ops;

#endif
