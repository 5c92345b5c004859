/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_POINTER_BELIEF_H
#define HAPODE_POINTER_BELIEF_H

/* What a device is taken to do, see plausible.c. Device frame. Zeroed: nothing is known. */

#include <stdbool.h>
#include <stdint.h>

#include <hapode/spatial.h>

#include "pointer/device_pace.h"

/* Where a device that is not believed says it is. */
typedef struct hapi_elsewhere {
  bool known; /* else it is believed */
  bool moved; /* there is a velocity */
  hap_pose pose;
  double velocity[3];
  double since;   /* s, without another pose */
  double seconds; /* that poses have gone on from there */
} hapi_elsewhere;

/* The way up to the pose that is believed. */
typedef struct hapi_believed_way {
  int64_t sample_ns; /* of the last pose that was another one than before: */
  hap_pose told;
  int64_t line_ns; /* of the pose from which the line begins: */
  hap_pose line;
  double velocity[3];
  double velocity_before[3]; /* of the line before it */
  double off;                /* m, of this pose from that line */
  double spin;               /* rad/s */
  double late[3];            /* m, of the position told last: not felt yet */
  hapi_device_pace pace;
} hapi_believed_way;

typedef struct hapi_pointer_belief {
  bool known;
  bool paced;         /* the velocity is known, too */
  bool jumped;        /* in this tick: it is believed to be where nobody saw it go */
  bool doubted;       /* in this tick: carried on, or the device says so */
  int64_t read_ns;    /* of the last read */
  int64_t believe_ns; /* of the last one that was believed */
  hapi_believed_way way;
  hapi_believed_way before; /* the pose that is believed now: its pose came soon after another */
  bool sure;                /* that pose was told for long enough */
  double votes; /* s, for the pose that is believed, less those for others, since it came */
  hapi_elsewhere elsewhere;
  uint32_t turns; /* how often running the way from tick to tick has turned round */
  bool shakes;    /* it turns round, and the energy observer took much of the force */
  double doubt_s;
  double loss; /* 0..1, share of the force that doubt has taken */
} hapi_pointer_belief;

#endif
