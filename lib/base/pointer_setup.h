/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_BASE_POINTER_SETUP_H
#define HAPODE_BASE_POINTER_SETUP_H

#include <hapode/expert.h>
#include <hapode/pointer.h>
#include <hapode/pointer_set.h>
#include <hapode/research.h>

/* A pointer's three structs of the API in one, as checked by lib/session. Recordings hold it: a
 * member that moves needs another version of the file. Units and ranges are those of the API. */
typedef struct hapi_pointer_setup {
  uint32_t size;   /* of this struct */
  uint32_t cookie; /* that of hap_pointer_def: a mark in recordings */
  hap_device *device;
  double radius;
  double proxy_mass;
  double stiffness;
  double damping;
  double friction;
  const double *hull_xyz;
  size_t hull_points;
  hap_pose pose_world_device;
  double motion_scale;
  double force_scale;
  double max_force;
  double max_torque;
  hap_coupling coupling;
  uint32_t collide_bits;
  hap_velocity velocity;
  hap_integration integration;
  double coupling_stiffness;
  double coupling_damping;
  double hand_damping;
  double max_slew;
  double finger_radius;
  double virtual_mass;
  double virtual_inertia;
  uint32_t effector;
  uint32_t foreign; /* 1: the hand of another session; in recordings 0 */
} hapi_pointer_setup;

/* Bits of a setting beside those of the API. */
enum {
  HAPI_SET_CLUTCH = 1 << 30,
  /* Those that come in while no force is felt. */
  HAPI_SET_SWAP = HAP_SET_SHAPE | HAP_SET_COLLIDE_BITS | HAP_SET_COUPLING
};

#define HAPI_SET_BITS 32

/* What is set while a pointer runs: the fields of def that the mask names. Recordings hold it. */
typedef struct hapi_pointer_setting {
  hapi_pointer_setup def; /* device and hull_xyz NULL; hull_points with HAP_SET_SHAPE alone */
  hap_twist twist_world_device;
  int64_t base_time_ns; /* 0: of the tick that takes it */
  uint32_t mask;        /* hap_pointer_set_bit, HAPI_SET_CLUTCH */
  uint32_t clutched;
} hapi_pointer_setting;

#endif
