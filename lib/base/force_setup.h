/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_FORCE_SETUP_H
#define HAPODE_BASE_FORCE_SETUP_H

#include <stdint.h>

#include <hapode/forces.h>

#define HAPI_MAGNET_PEAK \
  2.598076211353316 /* 1 / (u (1 - u^2)) where that is greatest: 3 sqrt(3) / 2 */

typedef struct hapi_wave_setup {
  uint32_t restart;
  uint32_t sample_count; /* 0: a sine */
  double hz;
  double attack_s;
  double hold_s;
  double decay_s;
  double sample_hz;
} hapi_wave_setup;

/* An own force as the tick has it: a hap_force_def, checked, with its promises filled in. Units and
 * ranges are those of the API. Recordings hold it: a member that moves needs another version of the
 * file. */
typedef struct hapi_force_setup {
  uint32_t kind;   /* hap_force_kind */
  uint32_t frame;  /* hap_force_frame */
  uint32_t target; /* hap_force_target */
  uint32_t serial; /* of the force, of all that the pointer has had; 0: none is here */
  uint32_t number; /* of the setting, of all that the pointer's forces have had */
  uint32_t reserved;
  double origin[3];
  double axis[3]; /* unit */
  double point[3];
  double force[3]; /* of WEIGHT too */
  double torque[3];
  double stiffness; /* that the device can hold, as the next */
  double damping;
  double strength;
  double range;
  double pitch;
  hapi_wave_setup wave;
  double fade_in_s;
  double max_force;
  double max_torque;
  double max_power;
  uint64_t body; /* birth of the one that the force is bound to; 0: none */
} hapi_force_setup;

/* The v of its hap_force_id; place: among the pointer's forces. */
static inline uint64_t hapi_own_force_id(uint32_t serial, uint32_t place)
{
  return (uint64_t)serial << 8 | (place + 1);
}

#endif
