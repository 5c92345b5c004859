/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_RUN_HAND_H
#define HAPODE_TOOLS_RUN_HAND_H

/* A device around a simulated one, whose hand can be pulled by the mouse. Before the first pull the
 * inner device goes through unchanged. From then on the hand is a mass behind a spring and a damper
 * to the mouse, with the figures of the inner device's hand: what it holds and pushes makes it
 * lag. */

#include <hapode/device_impl.h>

#include "plugins/virtual/hand.h"
#include "sync/triple_buffer.h"

/* Where the hand is wanted. */
typedef enum run_hand_way {
  RUN_HAND_SCRIPT = 0, /* as the inner device says */
  RUN_HAND_PULLED,
  RUN_HAND_HOME /* back to where the inner device is */
} run_hand_way;

typedef struct run_hand_wish {
  run_hand_way way;
  double target[3]; /* m, in the device's frame */
} run_hand_wish;

typedef struct run_hand {
  hap_device *inner;
  hapi_triple_buffer buffer; /* from the run's thread to the loop */
  run_hand_wish wishes[3];
  run_hand_wish wish; /* the loop's */
  hapi_hand hand;
  hapi_hand_target target; /* of the newest step */
  double force[3];         /* N, on the hand */
  int64_t time_ns;         /* of the newest read */
} run_hand;

/* The outer device; *out stays where it is until the device is closed. Errors of
 * hap_device_wrap. */
hap_status run_hand_open(run_hand *io, hap_device *inner, hap_device **out, hap_detail *detail);

/* One thread. */
void run_hand_pull(run_hand *io, run_hand_way way, const double target[3]);

#endif
