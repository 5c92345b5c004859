/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_SYNC_TOLD_BODY_H
#define HAPODE_SYNC_TOLD_BODY_H

#include <stdbool.h>
#include <stdint.h>

#include <hapode/spatial.h>

/* A body as the world's session tells of it, for those who draw it elsewhere. */
typedef struct hapi_told_body {
  uint64_t name;  /* of equal worlds the same; stays for the body's life; 0: there is none */
  uint64_t birth; /* in messages to the loop; another one after the body was put elsewhere */
  bool owned;     /* the loop moves it, and knows it better */
  uint32_t slot;  /* in models; UINT32_MAX: none */
  hap_pose pose;
} hapi_told_body;

/* What tells equal worlds from others: number of bodies, and a sum of masses and shapes. */
typedef struct hapi_scene_print {
  uint32_t bodies;
  uint64_t shapes;
} hapi_scene_print;

#endif
