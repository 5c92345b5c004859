/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_CYCLE_H
#define HAPODE_PLUGINS_SPIDAR_CYCLE_H

/* One exchange with all boards of a line: a CURRENT command to each, a reply of each. Pure.
 *
 * Replies have neither checksum nor number. A damaged one is recognised by its place. The replies
 * of a cycle come in the order of the commands, without gaps; each has its header and a fixed
 * length. Before the first there is a pause or another whole cycle, behind the last the next cycle
 * or nothing. A cycle that breaks one of these rules is dropped whole: strings of two different
 * ticks would give a pose of neither. Then the steps of the positions are checked: a string does
 * not jump. */

#include "plugins/spidar/frames.h"

#define HAPI_SPIDAR_CYCLE_MOTORS (HAPI_SPIDAR_BOARDS * HAPI_SPIDAR_MOTORS)
#define HAPI_SPIDAR_REPLIES_MAX (HAPI_SPIDAR_BOARDS * 41)  /* bytes, of B5M each */
#define HAPI_SPIDAR_COMMANDS_MAX (HAPI_SPIDAR_BOARDS * 61) /* bytes with padding */
#define HAPI_SPIDAR_CURRENT_MAX 4095                       /* of 4096 per 3.3 V */

/* What takes the force off all boards. */
#define HAPI_SPIDAR_ZEROS_BEFORE 16 /* the currents of a B5M */
#define HAPI_SPIDAR_ZEROS_MAX (HAPI_SPIDAR_ZEROS_BEFORE + HAPI_SPIDAR_COMMANDS_MAX)

/* Boards in the order of their ids, which is that of the motors. */
typedef struct hapi_spidar_boards {
  int count;
  uint8_t id[HAPI_SPIDAR_BOARDS];
  uint8_t model[HAPI_SPIDAR_BOARDS];
} hapi_spidar_boards;

typedef struct hapi_spidar_cycle {
  hapi_spidar_boards boards;
  int motors;                                   /* of all boards */
  int length;                                   /* bytes of all replies */
  int start[HAPI_SPIDAR_BOARDS];                /* of each reply in them */
  uint8_t bytes[2 * HAPI_SPIDAR_REPLIES_MAX];   /* received and not used */
  bool begins[2 * HAPI_SPIDAR_REPLIES_MAX + 1]; /* a cycle may begin at this byte: it came after a
                                                 pause, or is the first behind a whole cycle */
  int have;
} hapi_spidar_cycle;

void hapi_spidar_cycle_init(hapi_spidar_cycle *cycle, const hapi_spidar_boards *boards);
void hapi_spidar_cycle_clear(hapi_spidar_cycle *cycle);

/* Commands and padding for all boards; currents in the order of the motors, clipped to what a board
 * takes. Bytes written to out, which has HAPI_SPIDAR_COMMANDS_MAX. */
int hapi_spidar_cycle_commands(const hapi_spidar_cycle *cycle, const int16_t *currents,
                               uint8_t *out);

/* What was received since the push before, of which the first byte is taken to come after a pause.
 * Of more than fits the oldest goes. */
void hapi_spidar_cycle_push(hapi_spidar_cycle *cycle, const uint8_t *bytes, int count);

/* Raw positions of the newest whole cycle, in the order of the motors; false: there is none yet. It
 * and all before it are used up. */
bool hapi_spidar_cycle_take(hapi_spidar_cycle *cycle, int16_t *out_raw);

/* The first board of which nothing that looks like a reply is among what was received; -1: all seem
 * to answer. For error texts. */
int hapi_spidar_cycle_silent(const hapi_spidar_cycle *cycle);

/* ---- positions that do not wrap ---- */

typedef struct hapi_spidar_counts {
  int motors;
  bool known;
  int16_t raw[HAPI_SPIDAR_CYCLE_MOTORS];
  int32_t counts[HAPI_SPIDAR_CYCLE_MOTORS];
} hapi_spidar_counts;

/* Goes on to raw; each step is taken as the shortest. False, and nothing is changed, when one is
 * longer than step_max. The first time everything is taken as it is. */
bool hapi_spidar_counts_advance(hapi_spidar_counts *counts, const int16_t *raw, int step_max);

#endif
