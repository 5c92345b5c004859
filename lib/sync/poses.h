/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_POSES_H
#define HAPODE_SYNC_POSES_H

/* haptic -> contact: where the bodies are (model CONTACT). */

#include "sync/message.h"

typedef struct hapi_poses_body {
  uint32_t slot;
  uint32_t generation;
  hap_pose pose;
  hap_twist twist;
} hapi_poses_body;

typedef struct hapi_poses_pointer {
  uint32_t generation; /* 0: no hull here */
  hap_pose pose;
  hap_twist twist;
} hapi_poses_pointer;

typedef struct hapi_poses {
  uint64_t model_number; /* the local model in use */
  uint32_t body_count;
  uint32_t pointer_count;
  uint32_t bodies_offset;
  uint32_t pointers_offset;
} hapi_poses;

HAPI_MESSAGE_ARRAY(hapi_poses_bodies, hapi_poses, hapi_poses_body, bodies_offset)
HAPI_MESSAGE_ARRAY(hapi_poses_pointers, hapi_poses, hapi_poses_pointer, pointers_offset)

#endif
