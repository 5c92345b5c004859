/* SPDX-FileCopyrightText: hapode contributors
 * SPDX-License-Identifier: MIT */
#ifndef HAPODE_PLUGINS_SPIDAR_FRAMES_H
#define HAPODE_PLUGINS_SPIDAR_FRAMES_H

/* What goes over the line of SPIDAR's motor boards: bytes in, frames out. Shared by the device and
 * by its emulator. Nothing here knows a port or a clock.
 *
 * A frame is a header byte, (command << 3) | board, and fields whose number depends on the command
 * and on the model of the board; all fields are little-endian and packed. There is no checksum and
 * no sync byte. Where a header is expected, 0x00 and everything from 0x60 on is padding. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HAPI_SPIDAR_BOARDS 8     /* ids on one line */
#define HAPI_SPIDAR_MOTORS 8     /* of one board, at most */
#define HAPI_SPIDAR_FORCES 4     /* force channels of one board, at most */
#define HAPI_SPIDAR_TARGETS 12   /* nTarget of every board */
#define HAPI_SPIDAR_FRAME_MAX 85 /* bytes, header and all: ALL of a B5M */
#define HAPI_SPIDAR_SHARED_MAX (HAPI_SPIDAR_MOTORS * (1 + HAPI_SPIDAR_FORCES)) /* of ALL */

typedef enum hapi_spidar_command {
  HAPI_SPIDAR_NONE = 0,
  HAPI_SPIDAR_BOARD_INFO = 1,
  HAPI_SPIDAR_SET_CMDLEN = 2,
  HAPI_SPIDAR_ALL = 3,
  HAPI_SPIDAR_SENSOR = 4,
  HAPI_SPIDAR_DIRECT = 5,
  HAPI_SPIDAR_CURRENT = 6,
  HAPI_SPIDAR_INTERPOLATE = 7,
  HAPI_SPIDAR_FORCE_CONTROL = 8,
  HAPI_SPIDAR_SET_PARAM = 9,
  HAPI_SPIDAR_RESET_SENSOR = 10,
  HAPI_SPIDAR_GET_PARAM = 11
} hapi_spidar_command;

#define HAPI_SPIDAR_COMMANDS 12

typedef enum hapi_spidar_direction {
  HAPI_SPIDAR_TO_BOARD,
  HAPI_SPIDAR_FROM_BOARD
} hapi_spidar_direction;

/* Values of hapi_spidar_frame.parameter_type. */
typedef enum hapi_spidar_parameter {
  HAPI_SPIDAR_PARAMETER_PD = 0,           /* i16 k[M], b[M] */
  HAPI_SPIDAR_PARAMETER_CURRENT_GAIN = 1, /* i16 a[M] */
  HAPI_SPIDAR_PARAMETER_TORQUE_LIMIT = 2, /* i16 min[M], max[M]; not saved */
  HAPI_SPIDAR_PARAMETER_BOARD_ID = 3,     /* u8 */
  HAPI_SPIDAR_PARAMETER_BAUD = 4,         /* u32[2] */
  HAPI_SPIDAR_PARAMETER_HEAT = 5          /* u16 limit[M], i16 release[M] */
} hapi_spidar_parameter;

#define HAPI_SPIDAR_PARAMETERS 6

/* A kind of board, by its model number; the counts of a reply are not to be trusted. */
typedef struct hapi_spidar_kind {
  const char *name;
  int motors;
  int currents; /* current channels that are sent */
  int forces;
} hapi_spidar_kind;

/* Everything that any command or reply carries; which members count depends on the command. */
typedef struct hapi_spidar_frame {
  uint8_t board;
  uint8_t command; /* hapi_spidar_command */

  uint8_t info[6];                       /* BOARD_INFO: model, nTarget, nMotor, nCurrent,
                                                  nForce, nTouch */
  uint8_t lengths[HAPI_SPIDAR_COMMANDS]; /* SET_CMDLEN */
  uint8_t mode;                          /* ALL */
  uint8_t target_count; /* ALL, INTERPOLATE, FORCE_CONTROL; of the reply: those read */
  uint16_t tick;
  int16_t period;
  int16_t flags;                        /* RESET_SENSOR: 1 motor, 2 force */
  int16_t position[HAPI_SPIDAR_MOTORS]; /* counts */
  int16_t velocity[HAPI_SPIDAR_MOTORS]; /* counts per control tick */
  int16_t current[HAPI_SPIDAR_MOTORS];  /* of 4096 per 3.3 V */
  int16_t force[HAPI_SPIDAR_FORCES];    /* raw, minus offset */
  int16_t jacobian[HAPI_SPIDAR_FORCES][HAPI_SPIDAR_MOTORS];
  int16_t shared[HAPI_SPIDAR_SHARED_MAX];    /* ALL: what its mode says; current, or position and
                                             velocity, or position and jacobian */
  uint8_t parameter_type;                    /* SET_PARAM, GET_PARAM: hapi_spidar_parameter */
  uint8_t parameter[4 * HAPI_SPIDAR_MOTORS]; /* the fields of the union, as they lie on the line */
} hapi_spidar_frame;

/* NULL: there is no such model; they are 1 to 7. */
const hapi_spidar_kind *hapi_spidar_kind_find(int model);

/* By name, "B3M"; 0: none. */
int hapi_spidar_kind_number(const char *name, size_t length);

/* Bytes with the header; 0: there is no such frame. model and command may be any. */
int hapi_spidar_length(int model, int command, hapi_spidar_direction direction);

/* Zero bytes that have to follow a command, so that its reply is over before the next board's
 * begins. */
int hapi_spidar_padding(int model, int command);

static inline uint8_t hapi_spidar_header(int command, int board)
{
  return (uint8_t)(command << 3 | board);
}

static inline bool hapi_spidar_is_header(uint8_t byte)
{
  return byte != 0 && byte < HAPI_SPIDAR_COMMANDS << 3;
}

/* Number of bytes written to out, which has HAPI_SPIDAR_FRAME_MAX; 0: there is no such frame. */
int hapi_spidar_encode(const hapi_spidar_frame *frame, int model, hapi_spidar_direction direction,
                       uint8_t *out);

/* One whole frame. False: size is not that of its header's command. *out is zeroed first. */
bool hapi_spidar_decode(const uint8_t *bytes, size_t size, int model,
                        hapi_spidar_direction direction, hapi_spidar_frame *out);

/* ---- a stream of frames ---- */

/* Cuts a stream by a table of lengths, one for each board: those of SET_CMDLEN are learned by
 * whoever calls. A length of 0 makes a header padding. */
typedef struct hapi_spidar_cutter {
  uint8_t lengths[HAPI_SPIDAR_BOARDS][HAPI_SPIDAR_COMMANDS]; /* with the header; at most
                                                                HAPI_SPIDAR_FRAME_MAX */
  uint8_t bytes[HAPI_SPIDAR_FRAME_MAX];
  int have;
  int need; /* 0: a header comes next */
} hapi_spidar_cutter;

/* Frames of all boards have the lengths of that model. */
void hapi_spidar_cutter_init(hapi_spidar_cutter *cutter, int model,
                             hapi_spidar_direction direction);
void hapi_spidar_cutter_set(hapi_spidar_cutter *cutter, int board,
                            const uint8_t lengths[HAPI_SPIDAR_COMMANDS]);
void hapi_spidar_cutter_drop(hapi_spidar_cutter *cutter); /* what is half there */

/* Size of the frame in bytes that this byte completes; 0: none. */
int hapi_spidar_cutter_push(hapi_spidar_cutter *cutter, uint8_t byte);

#endif
