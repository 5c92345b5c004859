/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_BELIEF_H
#define HAPODE_PLUGINS_SPIDAR_BELIEF_H

/* Which replies are believed, and what the grip is taken to do where none is. A pose that does not
 * fit its strings never becomes force. Pure: no heap, no lock, no system call, bounded time. */

#include <stdint.h>

#include "plugins/spidar/kinematics.h"
#include "plugins/spidar/rates.h"

#define HAPI_SPIDAR_REPLIES 256 /* that are remembered, to know them again */

typedef enum hapi_spidar_verdict {
  HAPI_SPIDAR_BELIEVED, /* all strings agree */
  HAPI_SPIDAR_SPARED,   /* all but one agree, which was left out */
  HAPI_SPIDAR_DOUBTED   /* no pose: the last one is carried on for a few ms and then stays */
} hapi_spidar_verdict;

/* Where strings were, and how they went on. */
typedef struct hapi_spidar_course {
  bool known;
  int64_t time_ns;
  double length[HAPI_SPIDAR_STRINGS_MAX]; /* m, believed; of one left out as it should have been */
  double rate[HAPI_SPIDAR_STRINGS_MAX];   /* m/s */
  hap_twist twist;                        /* of the grip, frame of the model */
} hapi_spidar_course;

typedef struct hapi_spidar_belief {
  hapi_spidar_solver solver; /* of the pose that is believed or carried on */
  hapi_spidar_solver trial;  /* goes on from reply to reply, whatever comes of them */
  hap_pose start;            /* the newest that was not carried on */
  hap_twist twist;           /* of the grip, frame of the model */
  hapi_spidar_rates rates;
  hapi_spidar_course before;              /* up to the reply before the newest that is believed */
  bool known;                             /* there is something that a reply can be held against */
  int64_t update_ns;                      /* of the newest reply */
  int64_t believe_ns;                     /* of the newest that was not doubted */
  int64_t change_ns;                      /* of the newest in which some count was another one */
  double pace;                            /* m/s, of the fastest string at that one */
  double counts[HAPI_SPIDAR_STRINGS_MAX]; /* as they were read last */
  uint32_t replies;                       /* that have come; the newest of them, a ring: */
  int32_t reply[HAPI_SPIDAR_REPLIES][HAPI_SPIDAR_STRINGS_MAX];
  double length[HAPI_SPIDAR_STRINGS_MAX]; /* m, believed; of one left out as it should have been */
  int wrong;                              /* the string that was left out last; < 0: none */
  double error;                           /* m, of it, measured minus fitting */
} hapi_spidar_belief;

/* [control] Begins at start, NULL: at home. */
void hapi_spidar_belief_begin(hapi_spidar_belief *belief, const hapi_spidar_model *model,
                              const hap_pose *start);

/* Takes the unwrapped counts that were read at time_ns. taut: the strings are pulled; while they
 * are not there is no force, and every pose is believed. */
hapi_spidar_verdict hapi_spidar_belief_update(hapi_spidar_belief *belief,
                                              const hapi_spidar_model *model, int64_t time_ns,
                                              const double counts[HAPI_SPIDAR_STRINGS_MAX],
                                              bool taut);

#endif
