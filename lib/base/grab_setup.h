/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_GRAB_SETUP_H
#define HAPODE_BASE_GRAB_SETUP_H

#include <stdint.h>

#include <hapode/grab.h>

/* A grab as the tick has it: a hap_grab_def, checked. Units and ranges are those of the API.
 * Recordings hold it: a member that moves needs another version of the file. */
typedef struct hapi_grab_setup {
  uint64_t birth;  /* of the body, which has it for life; 0: nothing is to be held */
  uint32_t serial; /* of all that was asked of the pointer */
  uint8_t at_pose; /* it is held at the pose; else where the pointer is */
  uint8_t turns;   /* hap_grab_turn */
  uint16_t reserved;
  double place[3]; /* m, body frame: of the pointer */
  double turn[4];  /* likewise */
  double stiffness;
  double damping;
  double turn_stiffness;
  double turn_damping;
  double max_force;
  double max_torque;
  double damping_most; /* N s/m, that the device can hold */
} hapi_grab_setup;

#endif
