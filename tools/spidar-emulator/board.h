/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_TOOLS_SPIDAR_BOARD_H
#define HAPODE_TOOLS_SPIDAR_BOARD_H

/* One motor board: what it does with the bytes of the command line, and when it answers. It knows
 * no clock and no strings; times are told, in s, and never go back. */

#include "plugins/spidar/frames.h"

#define BOARD_BYTE_S 5e-6        /* of 2 Mbit/s, 8N1 */
#define BOARD_FIFO 6             /* bytes that raise the receiver's interrupt */
#define BOARD_REPLY_MIN_S 2.5e-6 /* from the header on */
#define BOARD_REPLY_MAX_S 55e-6
#define BOARD_EXECUTE_S 20e-6 /* from the last byte of a command until it takes effect */
#define BOARD_CURRENT_MAX 4095

/* What control mode the board is in. The numbers that ALL carries for it are those of this list. */
typedef enum board_mode {
  BOARD_SKIP = 0, /* of ALL: leaves the mode */
  BOARD_DIRECT = 1,
  BOARD_CURRENT = 2,
  BOARD_INTERPOLATE = 3,
  BOARD_FORCE_CONTROL = 4
} board_mode;

typedef struct board_reply {
  double start; /* s, of the first byte */
  int size;
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX];
} board_reply;

/* Of the receiver. */
typedef struct board_fifo {
  uint8_t bytes[BOARD_FIFO];
  double times[BOARD_FIFO];
  int have;
} board_fifo;

/* What is wrong with its encoders. */
typedef struct board_lies {
  int16_t false_by[HAPI_SPIDAR_MOTORS]; /* counts that it is off */
  bool stuck[HAPI_SPIDAR_MOTORS];       /* it stands still */
} board_lies;

typedef struct board {
  int id;
  int model;         /* what it is */
  int reported;      /* what BOARD_INFO says it is */
  int current_limit; /* 0..4095: currents are clipped to it */

  hapi_spidar_cutter cutter;
  board_fifo fifo;

  hapi_spidar_frame pending; /* a command whose last byte came */
  double pending_due;        /* s; < 0: none */
  uint8_t asked;             /* parameter type of the GET_PARAM before */
  uint8_t parameters[HAPI_SPIDAR_PARAMETERS][4 * HAPI_SPIDAR_MOTORS];
  board_mode mode;
  int16_t current[HAPI_SPIDAR_MOTORS]; /* wanted by the host, clipped */
  int16_t target[HAPI_SPIDAR_MOTORS];  /* counts, of the modes with positions */
  int16_t target_velocity[HAPI_SPIDAR_MOTORS];
  uint8_t target_count;

  /* Of the last control tick. */
  uint16_t tick;
  int32_t counts[HAPI_SPIDAR_MOTORS];   /* of the encoder, from power-on */
  int32_t origin[HAPI_SPIDAR_MOTORS];   /* subtracted: RESET_SENSOR */
  int16_t velocity[HAPI_SPIDAR_MOTORS]; /* counts per control tick */
  int16_t output[HAPI_SPIDAR_MOTORS];   /* current that the motor gets */
  board_lies lies;
  int16_t force[HAPI_SPIDAR_FORCES];

  uint32_t dice;
  unsigned executed; /* commands */
} board;

/* As after power-on; counts: where the encoders begin. */
void board_init(board *b, int id, int model, int32_t counts);

/* Control ticks a second. */
double board_tick_hz(const board *b);

/* A byte of the command line. True: *out is a reply, of which the bytes come every BOARD_BYTE_S
 * from out->start on. */
bool board_receive(board *b, uint8_t byte, double time, board_reply *out);

/* Executes what is due. */
void board_run(board *b, double time);

/* A control tick: encoders [counts, from power-on on] and what the motors get from now on. */
void board_tick(board *b, const int32_t counts[HAPI_SPIDAR_MOTORS]);

/* A position as the line carries it. */
int16_t board_position(const board *b, int motor);

#endif
